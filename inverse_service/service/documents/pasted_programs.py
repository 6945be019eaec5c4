"""A pasted program, whose lines are no equations, as the document of the system that it comes to."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from inverse_service.expressions import refusals
from inverse_service.reading import declarations, framing
from inverse_service.reading.scripts import languages as scripts, nodes as nd, systems
from inverse_service.service.documents import renaming

_SET = re.compile(r"^[ \t]*([A-Za-z]\w*)[ \t]*:?=(?!=)", re.MULTILINE)


def text_of(document: Mapping[str, Any]) -> str:
    """The text that may be a program, if the document declares nothing else; else nothing."""
    text = document.get("equations")
    plain = document.get("parameters") in (None, declarations.GUESS) and not any(
        document.get(key) for key in ("coordinates", "functions", "where", "lagrangian", "time")
    )
    if not isinstance(text, str) or not plain or not scripts.is_program(text):
        return ""
    return text


@lru_cache(maxsize=64)
def run_in_symbols(text: str) -> systems.Run | nd.NotRead:
    """What a program comes to, or why it is not run."""
    try:
        return scripts.what_it_comes_to(text)
    except nd.NotRead as error:
        return error
    except (RecursionError, ValueError, ArithmeticError):
        return nd.NotRead("")


def with_system(document: Mapping[str, Any], text: str) -> dict[str, Any] | None:
    """The document with the system in place of the program; None where it is not run."""
    found = run_in_symbols(text)
    if isinstance(found, nd.NotRead):
        return None
    kept = {key: value for key, value in document.items() if key not in ("equations", "parameters")}
    timed = {}
    if found.time != "t":
        timed = {**renaming.with_names(found.document, {"t": found.time}), "time": found.time}
    return {**kept, **found.document, **timed}


def is_more_than_lines(text: str) -> bool:
    """Whether a program calls functions of its own, passes other values than the default ones, or
    clears a name, so that its lines alone do not say it.
    """
    found = run_in_symbols(text)
    return isinstance(found, systems.Run) and found.is_more_than_lines


def set_aside(text: str) -> tuple[str, ...]:
    """The values, g = 9.81, that a program gives to letters of its system, which stay letters."""
    found = run_in_symbols(text)
    return found.aside if isinstance(found, systems.Run) else ()


def names_set(text: str) -> set[str]:
    """The names that statements of a program set."""
    return {*_SET.findall(text)}


def refuse_a_trap(text: str) -> None:
    """InputError for a program whose result depends on what its lines do not say: a loop, a
    condition, a list that is changed in place.
    """
    found = run_in_symbols(text)
    if isinstance(found, nd.Trap):
        error = refusals.fault("a trap in a program", found.at or 1, part=found.what)
        raise error.placed("/equations")


def refuse_more_than_equations(document: Any) -> None:
    """InputError for a program with an event or a constraint that no equation says."""
    text = document.get("equations") if isinstance(document, Mapping) else None
    if isinstance(text, str):
        for trap in framing.traps(text):
            run = run_in_symbols(text) if trap.run else None
            if isinstance(run, systems.Run) and trap.run in run.took:
                continue
            error = refusals.fault("a trap in a program", trap.at + 1, part=trap.what)
            raise error.placed("/equations")


def shown(text: str) -> str:
    """The first line of a program, by which an answer calls it."""
    return next((line.strip() for line in text.splitlines() if line.strip()), text)[:60]
