"""Where a command reads and writes, and how it ends: the exit codes of the contract."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path

from inverse_service import errors


class ExitCode(IntEnum):
    """0 a definite verdict (valid, done), 1 undetermined (not valid), 2 bad input, 3 our fault."""

    DONE = 0
    OPEN = 1
    BAD_INPUT = 2
    FAULT = 3
    INTERRUPTED = 130


@contextlib.contextmanager
def exit_codes() -> Iterator[None]:
    """Turn every exception into one sentence on standard error and its exit code."""
    try:
        yield
    except errors.InputError as error:
        stop(f"{_place(error)}{error.detail}", ExitCode.BAD_INPUT)
    except errors.InverseServiceError as error:
        stop(error.detail, ExitCode.FAULT)
    except KeyboardInterrupt:
        stop("Interrupted.", ExitCode.INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output went away: not worth a word, but Python must not flush again at its end.
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(ExitCode.DONE)
    except Exception as error:  # the last boundary: a person gets a sentence, never a traceback
        missing = errors.missing_extra(error) if isinstance(error, ImportError) else None
        if missing is not None:
            stop(missing.detail, ExitCode.BAD_INPUT)
        stop(f"The program failed ({type(error).__name__}); that is a fault of the program.", ExitCode.FAULT)


def stop(sentence: str, code: ExitCode) -> None:
    """Say it on standard error and end."""
    printable = "".join(c if c.isprintable() else "?" for c in sentence)
    print(printable.encode("utf-8", "replace").decode("utf-8"), file=sys.stderr)
    sys.exit(code)


def _place(error: errors.InputError) -> str:
    column = f"column {error.column}" if error.column is not None else ""
    if column in error.detail:  # once is enough
        column = ""
    place = ", ".join(part for part in (error.pointer, column) if part)
    return f"{place}: " if place else ""


MAX_BYTES = 10_000_000


def read_bytes(name: str, limit: int = MAX_BYTES) -> bytes:
    """The bytes of a file or of standard input; raises InputError where there is none or too much."""
    try:
        if name == "-" and sys.stdin is None:
            raise errors.InputError("Standard input is closed; name a file.")
        if name == "-":
            data = sys.stdin.buffer.read(limit + 1)
        else:
            with Path(name).open("rb") as stream:
                data = stream.read(limit + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the name is not a file name"
        shown = "".join(c if c.isprintable() else "?" for c in name[:200])
        raise errors.InputError(
            f"The file '{shown}' cannot be read: {reason}; name a file, or - for standard input."
        ) from None
    if len(data) > limit:
        raise errors.LimitError(f"The file is larger than {limit} bytes; a document of one system is far smaller.")
    return data


def write(text: str, target: Path | None = None) -> None:
    """Write to standard output, or to a file; raises InputError where it takes no more: a full disk, or closed."""
    if target is None and sys.stdout is None:
        raise errors.InputError("Standard output is closed; send it to a file.")
    try:
        if target is not None:
            target.write_text(text, encoding="utf-8")
            return
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise errors.InputError(
            f"The output cannot be written: {(error.strerror or 'it is closed').lower()}."
        ) from None
