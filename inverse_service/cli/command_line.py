"""The commands of `inverse-service` and what they share: the exit codes of the contract, reading,
and writing.

Each command is in a module of `COMMANDS`, which is loaded when its command is called, and all of
them for `--help`.
"""

import contextlib
import importlib
import inspect
import json
import logging
import os
import re
import sys
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from inverse_service import __version__, errors, garbage
from inverse_service.cli import wrong_calls
from inverse_service.service.documents import plain_data
from inverse_service.settings import PURPOSE

# The module of each command, in the order of the help.
COMMANDS = {
    **dict.fromkeys(("solve", "catalogue"), "inverse_service.cli.solve_command"),
    "nearest": "inverse_service.cli.nearest_command",
    **dict.fromkeys(("check", "batch", "table"), "inverse_service.cli.check_command"),
    **dict.fromkeys(("simulate", "work-precision"), "inverse_service.cli.simulate_command"),
    **dict.fromkeys(("serve", "mcp", "admin"), "inverse_service.cli.serving"),
}
EXAMPLE = "Example: inverse-service solve \"x'' = -x - c*x'\" --format text"
Command = TypeVar("Command", bound=Callable[..., Any])
MAX_BYTES = 10_000_000
MAX_TIME_LIMIT = 86_400.0


class ExitCode(IntEnum):
    """0 a definite verdict (valid, done), 1 undetermined (not valid), 2 invalid input, 3 internal error."""

    DONE = 0
    OPEN = 1
    BAD_INPUT = 2
    FAULT = 3
    INTERRUPTED = 130


def _end(code: ExitCode | None, **_: Any) -> None:
    """End the process with the exit code that a command returned."""
    sys.exit(code)


application = typer.Typer(
    name="inverse-service",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
    rich_markup_mode=None,
    result_callback=_end,
)


def command(
    example: str, name: str | None = None, of: typer.Typer = application
) -> Callable[[Command], Command]:
    """Register a command, whose help begins with an example and continues with the docstring."""

    def register(function: Command) -> Command:
        text = inspect.cleandoc(function.__doc__ or "")
        first = re.split(r"[.;:]\s|\.$|\n", text)[0]
        whole = f"\b\nExample: inverse-service {example}\n\n{text}"
        of.command(name, help=whole, short_help=f"{first}.")(function)
        return function

    return register


def one_of(words: type[StrEnum], what: str) -> dict[str, Any]:
    """Settings of an option that takes one of some words: it is refused in our words, and completed by the shell."""

    def chosen(text: str) -> StrEnum:
        try:
            return words(text.lower())
        except ValueError:
            near = get_close_matches(text.lower(), [*words], 1, 0.7)
            meant = f" Did you mean '{near[0]}'?" if near else ""
            shown = f"There is no {what} '{text[:40]}': choose one of {', '.join(words)}.{meant}"
            raise errors.InputError(shown) from None

    return {"parser": chosen, "metavar": "|".join(words), "autocompletion": lambda: [*words]}


def _version(wanted: bool) -> None:
    if wanted:
        print(f"inverse-service {__version__}")
        raise typer.Exit


@application.callback(help=f"\b\n{EXAMPLE}\n\n{PURPOSE}")
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", help="Show the version and exit.", callback=_version, is_eager=True
        ),
    ] = False,
) -> None:
    """The options before a command."""


def integer(name: str, low: int, high: int) -> dict[str, Any]:
    """Settings of an option that takes an integer from `low` to `high`: it is refused in our words."""

    def chosen(text: Any) -> int:
        with contextlib.suppress(ValueError):
            if low <= (found := int(text)) <= high:
                return found
        raise errors.InputError(f"{name} must be an integer from {low} to {high}.")

    return {"parser": chosen, "metavar": f"<{low} to {high}>"}


def _seconds(text: Any) -> float:
    with contextlib.suppress(ValueError):
        if 0 < (found := float(text)) <= MAX_TIME_LIMIT:
            return found
    raise errors.InputError(
        f"--time-limit must be a number of seconds above 0 and at most {MAX_TIME_LIMIT:.0f}."
    )


def time_limit(default: str) -> Any:
    """The option --time-limit, which refuses values that are not valid time limits."""
    about = f"Seconds; default {default}."
    return typer.Option("--time-limit", help=about, parser=_seconds, metavar="<seconds>")


def refuse_without_pools(what: str) -> None:
    """InputError on systems without file locks and forked processes, on which pools of workers rest (Windows)."""
    try:
        import fcntl  # noqa: F401
    except ImportError:
        detail = (
            f"{what} needs file locks and forked processes, which this system lacks: run it on Linux or macOS, or in "
            "WSL on Windows. 'solve', 'check', 'simulate' and the Python interface work here."
        )
        raise errors.InputError(detail) from None


def load_commands(wanted: str | None = None) -> None:
    """Load the module of a command, or of all commands if there is no command of this name."""
    for module in dict.fromkeys([COMMANDS[wanted]] if wanted in COMMANDS else COMMANDS.values()):
        importlib.import_module(module)


def run() -> None:
    """Run the command of this process's arguments and exit."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")
    # What is imported stays: to look through it for garbage again and again takes 0.05 s.
    garbage.look_seldom()
    # Nothing here multiplies large matrices of floats, and threads for it take NumPy 0.05 s to
    # start.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.argv[1:2] != ["serve"]:
        # To look for plugins of pydantic reads the metadata of every installed package, 0.01 s.
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if sys.argv[1:] in (["help"], ["version"]):
        sys.argv[1] = f"--{sys.argv[1]}"
    # What goes wrong is said in one sentence; the log with its tracebacks belongs to the service.
    logging.getLogger("inverse_service").addHandler(logging.NullHandler())
    with exit_codes():
        if sys.argv[1:] not in (["--version"], ["-V"]):
            load_commands(next(iter(sys.argv[1:]), None))
        # typer's own errors come here instead of being printed in its words.
        sys.exit(application(standalone_mode=False))


@contextlib.contextmanager
def exit_codes() -> Iterator[None]:
    """Turn every exception into one sentence on standard error and its exit code."""
    try:
        yield
    except wrong_calls.WRONG_CALL as error:
        if wrong_calls.is_bare(error):
            print(error, file=sys.stderr)
            sys.exit(ExitCode.BAD_INPUT)
        stop(wrong_calls.sentence_of_error(error), ExitCode.BAD_INPUT)
    except errors.InputError as error:
        stop(f"{_place(error)}{error.detail}", ExitCode.BAD_INPUT)
    except errors.InverseServiceError as error:
        stop(error.detail, ExitCode.FAULT)
    except KeyboardInterrupt:
        stop("Interrupted.", ExitCode.INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output went away: not worth a word, but Python must not flush again at
        # its end.
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(ExitCode.DONE)
    except Exception as error:  # the last boundary: a person gets a sentence, never a traceback
        missing = errors.missing_extra(error) if isinstance(error, ImportError) else None
        if missing is not None:
            stop(missing.detail, ExitCode.BAD_INPUT)
        stop(
            f"The program failed ({type(error).__name__}); this is an error in the program.",
            ExitCode.FAULT,
        )


def stop(sentence: str, code: ExitCode) -> None:
    """Print the sentence on standard error and end the process."""
    printable = "".join(c if c.isprintable() else "?" for c in sentence)
    print(printable.encode("utf-8", "replace").decode("utf-8"), file=sys.stderr)
    sys.exit(code)


def _place(error: errors.InputError) -> str:
    column = f"column {error.column}" if error.column is not None else ""
    if column in error.detail:  # once is enough
        column = ""
    place = ", ".join(part for part in (error.pointer, column) if part)
    return f"{place}: " if place else ""


def read_bytes(name: str, limit: int = MAX_BYTES) -> bytes:
    """The bytes of a file or of standard input; raises InputError if there is no input or too much."""
    if not name:
        raise errors.InputError(
            "The name of the file is empty; name a file, or - for standard input."
        )
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
        detail = (
            f"The file '{shown}' cannot be read: {reason}; name a file, or - for standard input."
        )
        raise errors.InputError(detail) from None
    if len(data) > limit:
        raise errors.LimitError(
            f"The file is larger than {limit} bytes; a document of one system is far smaller."
        )
    return data


def is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):  # too long, or with a character that no name has
        return False


def read_document(name: str) -> Any:
    """The document of a file, by its ending, or of standard input."""
    return plain_data.read_document(read_bytes(name), name)


def in_json(value: Any) -> str:
    """Lines of JSON as a person reads them."""
    return json.dumps(value, ensure_ascii=False, indent=2, default=str) + "\n"


def write(text: str, target: Path | None = None) -> None:
    """Write to standard output, or to a file; raises InputError if the disk is full or the stream closed."""
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
        detail = f"The output cannot be written: {(error.strerror or 'it is closed').lower()}."
        raise errors.InputError(detail) from None
