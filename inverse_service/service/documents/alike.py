"""The form of a system up to the names of coordinates and parameters, the order of equations, and
constant factors.

Two systems with one form need not be equivalent: a search shows them side by side, and each has its
own answer.
"""

import hashlib
from collections.abc import Mapping
from itertools import permutations
from typing import Any

from inverse_service import errors
from inverse_service.expressions import collecting, tree as trees
from inverse_service.reading import names as nm, reader

MOST_COORDINATES = 4  # whose orders are all tried


def form_of(system: Mapping[str, Any], at_rest: bool = False) -> str:
    """A short key, the same for systems of one form; empty where there is none.

    `system` has coordinates, equations, parameters, functions, and the name of the time, as in a
    result. With `at_rest` it is that of the accelerations for velocities 0, which friction does not
    change; empty where these are 0, too.
    """
    coordinates, texts = tuple(system["coordinates"]), system["equations"]
    if not 0 < len(coordinates) <= MOST_COORDINATES or any(
        reader.has_acceleration(text) for text in texts.values()
    ):
        return ""
    time = system.get("time", "t")
    parameters = (*system["parameters"], *((time,) if time != "t" else ()))
    try:
        names = nm.Names(coordinates, parameters, system.get("functions") or {})
        formulas = [reader.read_formula(texts[name], names) for name in coordinates]
    except errors.InputError:
        return ""
    if at_rest:
        still: dict[trees.Velocity, trees.Expression] = {
            trees.Velocity(name): trees.ZERO for name in coordinates
        }
        try:
            formulas = [trees.substitute(formula, still) for formula in formulas]
        except ZeroDivisionError:
            return ""
        if all(formula == trees.ZERO for formula in formulas):
            return ""
    written = []
    for order in permutations(range(len(coordinates))):
        places = {coordinates[k]: f"q{place}" for place, k in enumerate(order)}
        written.append(";".join(_form(formulas[k], places, time) or "0" for k in order))
    return hashlib.sha256(min(written).encode()).hexdigest()[:16]


def _form(tree: trees.Expression, places: Mapping[str, str], time: str) -> str:
    """The terms of a formula without their constant factors, sorted; empty for a zero.

    exp(2 x) is exp(x)^2 as a term, so the exponent of an exponential is a factor in it.
    """
    found = set()
    for monomial, coefficient in collecting.expand(tree):
        if coefficient:
            pairs = [(_atom(atom, places, time), exponent) for atom, exponent in monomial]
            factors = [
                base if exponent == 1 or base.startswith("exp(") else f"({base})^{exponent}"
                for base, exponent in pairs
                if base
            ]
            found.add("*".join(sorted(factors)) or "c")
    return "+".join(sorted(found))


def _atom(tree: trees.Expression, places: Mapping[str, str], time: str) -> str:
    """An atom by its shape; empty for a constant."""
    match tree:
        case trees.Symbol(name):
            return places.get(name, "t" if name in ("t", time) else "")
        case trees.Velocity(name):
            return f"{places[name]}'"
        case trees.Ordered(function, argument, order):
            inner, above = _form(argument, places, time), _form(order, places, time)
            return f"{function}({above},{inner})" if inner not in ("", "c") else ""
        case trees.Apply(function, argument):
            inner = _form(argument, places, time)
            return f"{function}({inner})" if inner not in ("", "c") else ""
        case trees.Arbitrary(_, arguments, orders):
            inner = ",".join(_form(argument, places, time) for argument in arguments)
            return f"F{orders}({inner})"
        case trees.Power(base, exponent):
            inner, above = _form(base, places, time), _form(exponent, places, time)
            if isinstance(exponent, trees.Number):
                return f"({inner})^{exponent.value}" if inner not in ("", "c") else ""
            return f"({inner})^({above})" if {inner, above} - {"", "c"} else ""
        case trees.Sum() | trees.Product():
            inner = _form(tree, places, time) if len(collecting.expand(tree)) > 1 else ""
            return f"({inner})" if inner not in ("", "c") else ""
    return ""
