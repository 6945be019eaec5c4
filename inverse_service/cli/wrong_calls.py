"""One sentence for a call that the command line does not take: what is wrong, and a call that is
right.

The classes of these errors are private to typer, so they are told apart by their names.
"""

from __future__ import annotations

import sys
from difflib import get_close_matches
from typing import Any

import typer

# typer's own error for a call that it does not take, which it does not export.
WRONG_CALL: type[Exception] = typer.BadParameter.__bases__[0]


def is_bare(error: Exception) -> bool:
    """Whether a group of commands was called without any; the text of this error is the group's help."""
    return type(error).__name__ == "NoArgsIsHelpError"


def sentence_of_error(error: Any) -> str:
    """The sentence for an error of typer, with the example of the command's help."""
    kind = type(error).__name__
    if kind == "BadOptionUsage":
        has_value = any(word.startswith(f"{error.option_name}=") for word in sys.argv[1:])
        wrong = "takes no value" if has_value else "needs a value after it"
        return f"{error.option_name} {wrong}; --help lists the options with their values."
    path = " ".join(_path(error.ctx))
    if kind == "MissingParameter":
        missing = error.param.opts[0]
        if error.param.param_type_name == "argument":
            missing = f"its argument {{{error.param.name}}}"
        return f"'{path}' lacks {missing}. {_example(error.ctx)}"
    if kind == "NoSuchOption":
        near = get_close_matches(error.option_name, error.possibilities or (), 1, 0.7)
        advice = f"Did you mean {near[0]}?" if near else f"'{path} --help' lists its options."
        return f"'{path}' has no option {error.option_name[:40]}. {advice}"
    if hasattr(error.cmd, "commands"):
        words = [word for word in sys.argv[1:] if not word.startswith("-")]
        wrong = words[len(_path(error.ctx))][:40]
        return _unknown_command(error.ctx, wrong)
    if kind == "UsageError":
        return (
            f"'{path}' takes fewer words; put a text with blanks in quotes. {_example(error.ctx)}"
        )
    return f"{error.format_message().rstrip('.')}. {_example(error.ctx)}"


def _path(context: Any) -> list[str]:
    """The names of a command and of those that contain it, without the program's."""
    return [] if context.parent is None else [*_path(context.parent), context.info_name]


def _unknown_command(context: Any, word: str) -> str:
    wrong = f"There is no command '{word}'"
    names = [*context.command.commands]
    if near := get_close_matches(word, names, 1, 0.7):
        return f"{wrong}. Did you mean '{near[0]}'?"
    is_system = not _path(context) and any(mark in word for mark in "='(")
    advice = " Equations come after 'solve'." if is_system else ""
    return f"{wrong}: choose one of {', '.join(names)}.{advice}"


def _example(context: Any) -> str:
    """The call with which the help of a command opens, as a sentence."""
    return str(context.command.help).removeprefix("\b\n").partition("\n")[0]
