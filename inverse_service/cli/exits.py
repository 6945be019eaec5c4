"""Exit codes of the contract, and how a command ends with one."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from enum import IntEnum

from inverse_service.errors import InputError, InverseServiceError


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
    except InputError as error:
        stop(f"{_place(error)}{error.detail}", ExitCode.BAD_INPUT)
    except InverseServiceError as error:
        stop(error.detail, ExitCode.FAULT)
    except KeyboardInterrupt:
        stop("Interrupted.", ExitCode.INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output went away: not worth a word, but Python must not flush again at its end.
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(ExitCode.DONE)
    except Exception as error:  # the last boundary: a person gets a sentence, never a traceback
        stop(f"The program failed ({type(error).__name__}); that is a fault of the program.", ExitCode.FAULT)


def stop(sentence: str, code: ExitCode) -> None:
    """Say it on standard error and end."""
    printable = "".join(c if c.isprintable() else "?" for c in sentence)
    print(printable.encode("utf-8", "replace").decode("utf-8"), file=sys.stderr)
    sys.exit(code)


def _place(error: InputError) -> str:
    column = f"column {error.column}" if error.column is not None else ""
    if column in error.detail:  # once is enough
        column = ""
    place = ", ".join(part for part in (error.pointer, column) if part)
    return f"{place}: " if place else ""
