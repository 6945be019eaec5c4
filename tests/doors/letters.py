"""Values of the constants at which a printed L is none, although the result does not say so."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import mpmath

from tests.doors import judge
from tests.doors.formulas import DIGITS, NotReal

VALUES = ("-3", "-2", "-1", "0", "1/2", "1", "2", "3")
OPEN = "single values"  # so a result says that it does not know them
TRIES = 400


def lagrangians_of(result: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], Sequence[str]]]:
    """The answers with an L of the equations themselves, and the domain of each."""
    parts = [result, result.get("with_time") or {}, *(result.get("branches") or ())]
    return [
        (part, part.get("domain", result.get("domain") or ()))
        for part in parts
        if part.get("lagrangian")
    ]


def letters_of(system: Mapping[str, Any]) -> list[str]:
    """The constants without a value."""
    given = system["parameters"]
    if isinstance(given, Mapping):
        return [name for name, value in given.items() if value is None]
    return list(given)


def false_values(
    system: Mapping[str, Any],
    answer: Mapping[str, Any],
    domain: Sequence[str] = (),
    integrals: Mapping[str, Any] | None = None,
) -> list[str]:
    """The values "n = 1" at which f has values and L is singular, has none, or has other equations,
    and which no exception of the answer names.
    """
    lagrangian, said = answer["lagrangian"], answer.get("exceptions") or ()
    if any(one.startswith(OPEN) for one in said):
        return []
    where = [*domain, *lagrangian["domain"]]
    more = answer.get("integrals") or integrals
    found = list[str]()
    for name, value in itertools.product(letters_of(system), VALUES):
        given = judge.equations_of(system, {name: value})
        with mpmath.workdps(DIGITS):
            if next(judge.points(given, where, tries=TRIES), None) is None:
                continue
        fault = judge.faults_of_lagrangian(
            lagrangian["text"], given, where, integrals=more, count=1, tries=TRIES
        )
        if fault is not None and not any(holds(one, given) for one in said):
            found.append(f"{name} = {value}")
    return found


def holds(text: str, given: judge.Equations) -> bool:
    """Whether an equation between constants holds for all values of those without one."""
    *lefts, right = text.split(" = ")
    alone = judge.Equations((), (), given.values, given.time)
    with mpmath.workdps(DIGITS):
        for seed in (1, 2):
            point = next(judge.points(alone, seed=seed))
            try:
                values = [point.value(f"({left}) - ({right})") for left in lefts]
            except NotReal:
                return False
            if not lefts or any(abs(value) > judge.NEAR_ZERO for value in values):
                return False
    return True
