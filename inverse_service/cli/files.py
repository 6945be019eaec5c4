"""Reading what a command was given: a file, or - for standard input."""

from __future__ import annotations

import sys
from pathlib import Path

from inverse_service.errors import InputError, LimitError

MAX_BYTES = 10_000_000


def read_bytes(name: str, limit: int = MAX_BYTES) -> bytes:
    """The bytes of a file or of standard input; raises InputError where there is none or too much."""
    try:
        if name == "-" and sys.stdin is None:
            raise InputError("Standard input is closed; name a file.")
        if name == "-":
            data = sys.stdin.buffer.read(limit + 1)
        else:
            with Path(name).open("rb") as stream:
                data = stream.read(limit + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the name is not a file name"
        shown = "".join(c if c.isprintable() else "?" for c in name[:200])
        raise InputError(
            f"The file '{shown}' cannot be read: {reason}; name a file, or - for standard input."
        ) from None
    if len(data) > limit:
        raise LimitError(f"The file is larger than {limit} bytes; a document of one system is far smaller.")
    return data


def write(text: str, target: Path | None = None) -> None:
    """Write to standard output, or to a file; raises InputError where it takes no more: a full disk, or closed."""
    if target is None and sys.stdout is None:
        raise InputError("Standard output is closed; send it to a file.")
    try:
        if target is not None:
            target.write_text(text, encoding="utf-8")
            return
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"The output cannot be written: {(error.strerror or 'it is closed').lower()}.") from None
