"""The systems that a result leaves out: with the special values of its `exceptions` put in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from inverse_service.expressions import collecting, printing
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.service.documents import canonical


def left_out(result: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any] | None]]:
    """Each exception with the document of the system there; None where it cannot be solved for a parameter."""
    other = result.get("with_time") or {}
    for text in dict.fromkeys([*(result.get("exceptions") or ()), *(other.get("exceptions") or ())]):
        yield text, _there(result["system"], text) if "=" in text else None


def _there(system: Mapping[str, Any], text: str) -> dict[str, Any] | None:
    names, parameters = canonical.names_of(system), list(system["parameters"])
    *sides, last = [reader.read_formula(side, names) for side in text.split("=")]
    values = dict[ex.Expression, ex.Expression]()
    for side in sides:
        found = next(filter(None, (_solved(collecting.collect(side - last), name) for name in parameters)), None)
        if found is None:
            return None
        values |= found
    equations = {name: reader.read_formula(formula, names) for name, formula in system["equations"].items()}
    kept = [name for name in parameters if ex.Symbol(name) not in values]
    return {
        "coordinates": system["coordinates"],
        "equations": {
            name: printing.to_text(collecting.collect(ex.substitute(tree, values))) for name, tree in equations.items()
        },
        "parameters": kept,
        "functions": system.get("functions") or {},
    }


def _solved(tree: ex.Expression, name: str) -> dict[ex.Expression, ex.Expression] | None:
    """The parameter's value where the tree is 0, if it is a number times the parameter and what does not hold it."""
    at = [collecting.collect(ex.substitute(tree, {ex.Symbol(name): ex.number(k)})) for k in range(3)]
    slope = collecting.collect(at[1] - at[0])
    is_linear = collecting.collect(at[2] - at[1] - slope) == ex.ZERO
    if not is_linear or not isinstance(slope, ex.Number) or slope == ex.ZERO:
        return None
    return {ex.Symbol(name): collecting.collect(-at[0] / slope)}
