"""The systems that a result leaves out: with the special values of its `exceptions` put in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ZERO, Expression, Number, Symbol, number, substitute
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents import canonical


def left_out(result: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any] | None]]:
    """Each exception with the document of the system there; None where it cannot be solved for a parameter."""
    other = result.get("with_time") or {}
    for text in dict.fromkeys([*(result.get("exceptions") or ()), *(other.get("exceptions") or ())]):
        yield text, _there(result["system"], text) if "=" in text else None


def _there(system: Mapping[str, Any], text: str) -> dict[str, Any] | None:
    names, parameters = canonical.names_of(system), list(system["parameters"])
    *sides, last = [read_formula(side, names) for side in text.split("=")]
    values = dict[Expression, Expression]()
    for side in sides:
        found = next(filter(None, (_solved(collect(side - last), name) for name in parameters)), None)
        if found is None:
            return None
        values |= found
    equations = {name: read_formula(formula, names) for name, formula in system["equations"].items()}
    kept = [name for name in parameters if Symbol(name) not in values]
    return {
        "coordinates": system["coordinates"],
        "equations": {name: to_text(collect(substitute(tree, values))) for name, tree in equations.items()},
        "parameters": kept,
        "functions": system.get("functions") or {},
    }


def _solved(tree: Expression, name: str) -> dict[Expression, Expression] | None:
    """The parameter's value where the tree is 0, if it is a number times the parameter and what does not hold it."""
    at = [collect(substitute(tree, {Symbol(name): number(k)})) for k in range(3)]
    slope = collect(at[1] - at[0])
    is_linear = collect(at[2] - at[1] - slope) == ZERO
    if not is_linear or not isinstance(slope, Number) or slope == ZERO:
        return None
    return {Symbol(name): collect(-at[0] / slope)}
