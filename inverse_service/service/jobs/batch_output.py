"""The output of a batch: answers that an earlier run left there, and those that are added.

A file only grows: plain lines, or for .gz one compressed member after the other, so that a run that
was killed loses at most what it was writing. Each answer has the digest of its question; on resuming
it counts for a line with the same digest only.
"""

from __future__ import annotations

import contextlib
import gzip
import json
import stat
import sys
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from inverse_service.errors import InputError
from inverse_service.service.documents.answers import as_bytes, problem_document
from inverse_service.service.jobs.batch_files import STANDARD, Line
from inverse_service.service.jobs.batches import BatchAnswer
from inverse_service.service.jobs.locks import lock
from inverse_service.service.jobs.tasks import label_of


def answer_line(answer: BatchAnswer) -> bytes:
    """JSON with the `id` and the number of the line in front, and a line feed at the end."""
    if answer.status != "successful" or answer.body is None:
        return error_line(answer.number, answer.identifier, _problem(answer), digest=answer.digest)
    head = line_head(answer)
    result = answer.body.strip()
    inside = result[1:-1].strip() if result[:1] == b"{" else b'"result": ' + result
    return head + (b", " + inside if inside else b"") + b"}\n"


def line_head(answer: BatchAnswer) -> bytes:
    """What stands before the result in its line: the result follows without its first bracket, after a comma."""
    digest = f', "digest": "{answer.digest}"' if answer.digest else ""
    return f'{{"id": {answer.identifier}, "line": {answer.number}{digest}'.encode()


def error_line(
    number: int, identifier: str, problem: dict[str, Any], duplicate_of: int | None = None, digest: str = ""
) -> bytes:
    """A problem document with the id of its line; `error` holds it once more for who looks for that key."""
    told = problem | {"detail": f"Line {number}: {problem['detail']}"}
    line: dict[str, Any] = {"id": json.loads(identifier), "line": number}
    more = {"digest": digest or None, "duplicate_of": duplicate_of}
    line |= {key: value for key, value in more.items() if value is not None}
    return as_bytes(line | told | {"error": told}) + b"\n"


def _problem(answer: BatchAnswer) -> dict[str, Any]:
    if answer.body is None:
        return problem_document(410, "dismissed", "The job of this line was dismissed.")
    found: dict[str, Any] = json.loads(answer.body)
    return found


MAX_ANSWER_BYTES = 200_000_000
MEMBER_BYTES, MEMBER_SECONDS = 262_144, 5.0
CHUNK = 1 << 20


@dataclass(frozen=True, slots=True)
class Known:
    """An answer: to which question, what it is counted as (a verdict, "error", "fault"), and why."""

    digest: str
    label: str
    reason: str


class Output:
    """Answers by their keys, and a place to write more; `superseded`: some were replaced by later ones."""

    def __init__(self, stream: IO[bytes], compressed: bool = False) -> None:
        self._stream, self._compressed = stream, compressed
        self._kept, self._since = bytearray(), time.monotonic()
        self.known: dict[str, Known] = {}
        self.superseded = False

    def note(self, answer: dict[str, Any]) -> Known:
        """Remember an answer; one of the same key is superseded."""
        key = answer_key(answer)
        self.superseded |= key in self.known
        self.known[key] = Known(answer.get("digest", ""), _label(answer), _reason(answer))
        return self.known[key]

    def add(self, line: bytes) -> Known:
        """Write one answer. Raises InputError where the output takes no more."""
        self._kept += line
        is_late = time.monotonic() - self._since > MEMBER_SECONDS
        if not self._compressed or len(self._kept) > MEMBER_BYTES or is_late:
            self.flush()
        return self.note(json.loads(line))

    def flush(self) -> None:
        """Hand over what was kept back to be compressed together."""
        data = memoryview(gzip.compress(self._kept) if self._compressed and self._kept else bytes(self._kept))
        self._kept, self._since = bytearray(), time.monotonic()
        try:
            while data:
                data = data[self._stream.write(data) :]
            self._stream.flush()
        except (OSError, ValueError) as error:
            if isinstance(error, BrokenPipeError):
                raise
            reason = (getattr(error, "strerror", None) or "it is closed").lower()
            raise InputError(f"The output cannot be written: {reason}.") from None


def answer_key(answer: dict[str, Any]) -> str:
    """By id; by line number for a line without a readable id or with the id of another line."""
    if answer.get("id") is None or answer.get("duplicate_of") is not None:
        return f"line {answer.get('line')}"
    return f"id {json.dumps(answer['id'])}"


def key_of(line: Line) -> str:
    """The key of the answer to a line."""
    return answer_key({"id": line.identifier, "line": line.number, "duplicate_of": line.duplicate_of})


@contextlib.contextmanager
def open_output(path: Path) -> Iterator[Output]:
    """The output, with the answers of earlier runs; for this process alone. Raises InputError.

    What was half written is cut off. At a regular end superseded answers are moved to `path`.replaced.
    """
    if str(path) == STANDARD:
        if sys.stdout is None:
            raise InputError("Standard output is closed; name a file with --output.")
        yield Output(sys.stdout.buffer)
        return
    with _locked(path) as stream:
        output = Output(stream, path.suffix == ".gz")
        stream.truncate(_note_earlier(path, output))
        try:
            yield output
        finally:
            output.flush()
        if output.superseded:
            _part_superseded(path)


def _note_earlier(path: Path, output: Output) -> int:
    """How many bytes of the file are whole."""
    whole = 0
    for number, (data, end) in enumerate(_whole_lines(path), 1):
        answer = None
        with contextlib.suppress(ValueError, RecursionError):
            answer = json.loads(data)
        if not isinstance(answer, dict) or "line" not in answer or "id" not in answer:
            raise InputError(f"Line {number} of the output file is not an answer of a batch; choose another file.")
        output.note(answer)
        whole = end
    return whole


def _whole_lines(path: Path) -> Iterator[tuple[bytes, int]]:
    """Each line that was written whole, and up to where the file is whole with it."""
    if path.suffix == ".gz":
        for lines, end in _members(path):
            yield from ((line, end) for line in lines)
        return
    end = 0
    with path.open("rb") as stream:
        while (line := stream.readline(MAX_ANSWER_BYTES)).endswith(b"\n"):
            end += len(line)
            yield line, end
    if len(line) >= MAX_ANSWER_BYTES:
        raise InputError("The output file is not that of a batch: it has a line without an end; choose another file.")


def _members(path: Path) -> Iterator[tuple[list[bytes], int]]:
    """The lines of each whole member of a compressed file, and where it ends."""
    with path.open("rb") as stream:
        rest, end = stream.read(CHUNK), 0
        while rest:
            member, lines = zlib.decompressobj(31), bytearray()
            while rest and not member.eof:
                try:
                    lines += member.decompress(rest, MAX_ANSWER_BYTES)
                except zlib.error:
                    raise InputError("The output file is not, or not all, of gzip; choose another file.") from None
                if len(lines) >= MAX_ANSWER_BYTES:
                    raise InputError("The output file is not that of a batch; choose another file.")
                end += len(rest) - len(member.unused_data)
                rest = member.unused_data or stream.read(CHUNK)
            if member.eof:
                yield bytes(lines).splitlines(keepends=True), end


def _part_superseded(path: Path) -> None:
    """Keep the last answer of each key; append the others to a file next to it."""
    last = {answer_key(json.loads(line)): number for number, (line, _) in enumerate(_whole_lines(path))}
    fresh = path.with_name(f"{path.name}.fresh")
    opened = gzip.open if path.suffix == ".gz" else open
    # A folder that takes no new file: whoever reads by id still has the last answer of each line.
    with contextlib.suppress(PermissionError):
        with opened(fresh, "wb") as kept, opened(replaced_path(path), "ab") as replaced:
            for number, (line, _) in enumerate(_whole_lines(path)):
                (kept if last[answer_key(json.loads(line))] == number else replaced).write(line)
        fresh.chmod(stat.S_IMODE(path.stat().st_mode))
        fresh.replace(path.resolve())


def replaced_path(path: Path) -> Path:
    """Where answers go that later ones replaced."""
    return path.with_name(f"{path.name}.replaced")


def _label(answer: dict[str, Any]) -> str:
    if "error" not in answer:
        return label_of(answer)
    return "fault" if answer["error"]["status"] >= 500 else "error"


def _reason(answer: dict[str, Any]) -> str:
    return str(answer["error"]["detail"] if "error" in answer else answer.get("reason") or "")


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[IO[bytes]]:
    """The file, open for appending without a buffer, for this process alone; no device, pipe or folder."""
    try:
        if path.exists() and not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"The output {path} is not a regular file; name a file, or - for standard output.")
        stream = path.open("ab", buffering=0)
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or "the name is not a file name").lower()
        raise InputError(f"The output file cannot be written: {reason}.") from None
    with stream:
        try:
            lock(stream.fileno())
        except OSError:
            detail = "Another batch is writing to the output file; wait for it or choose another file."
            raise InputError(detail) from None
        yield stream
