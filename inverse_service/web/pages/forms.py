"""Forms as browsers send them: fields and uploaded files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qs

from inverse_service.errors import DocumentRefused, InputError, Place
from inverse_service.service.jobs.tasks import UNREADABLE

MAX_FIELDS = 120
_BOUNDARY = re.compile(r'boundary="?([^";]{1,70})"?', re.IGNORECASE)
_NAME = re.compile(rb'[ ;]name="([^"]{0,80})"')
_FILE_NAME = re.compile(rb'filename="([^"]{0,300})"')


@dataclass(frozen=True, slots=True)
class Upload:
    """An uploaded file."""

    name: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Form:
    """Fields with all their values, and files that were chosen."""

    fields: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    files: Mapping[str, Upload] = field(default_factory=dict)

    def text(self, name: str) -> str:
        """The first value of a field with line ends as \\n, or nothing."""
        values = self.fields.get(name, ())
        return values[0].replace("\r\n", "\n").strip() if values else ""

    def every(self, name: str) -> tuple[str, ...]:
        """All values of a field: the ticked boxes of one name."""
        return self.fields.get(name, ())


def form_of(body: bytes, content_type: str) -> Form:
    """The sent form; raises InputError for what no browser sends."""
    if content_type.lower().startswith("multipart/form-data"):
        return _multipart(body, content_type)
    return _urlencoded(body)


def _urlencoded(body: bytes) -> Form:
    try:
        found = parse_qs(body.decode("ascii"), max_num_fields=MAX_FIELDS, errors="strict", keep_blank_values=True)
    except ValueError:
        raise unreadable() from None
    return Form({name: tuple(values) for name, values in found.items()})


def _multipart(body: bytes, content_type: str) -> Form:
    boundary = _BOUNDARY.search(content_type)
    if boundary is None:
        raise unreadable()
    parts = (b"\r\n" + body).split(b"\r\n--" + boundary.group(1).encode())
    if not 2 <= len(parts) <= MAX_FIELDS + 2 or not parts[-1].startswith(b"--"):
        raise unreadable()
    fields: dict[str, tuple[str, ...]] = {}
    files: dict[str, Upload] = {}
    for part in parts[1:-1]:
        _take(part, fields, files)
    return Form(fields, files)


def _take(part: bytes, fields: dict[str, tuple[str, ...]], files: dict[str, Upload]) -> None:
    head, separator, data = part.partition(b"\r\n\r\n")
    name = _NAME.search(head)
    if not separator or name is None:
        raise unreadable()
    try:
        key = name.group(1).decode()
        file_name = _FILE_NAME.search(head)
        if file_name is None:
            fields[key] = (*fields.get(key, ()), data.decode())
        elif file_name.group(1) or data:
            files[key] = Upload(file_name.group(1).decode(), data)
    except UnicodeDecodeError:
        raise unreadable() from None


def unreadable() -> InputError:
    """The body is no form."""
    detail = "The form was not sent as a browser sends it."
    return DocumentRefused((Place(detail, code=UNREADABLE),))
