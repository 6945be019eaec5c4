"""The members of a family for which the L of their set is none, such as b = 0 for L = b (x'^2 -
y'^2): the question for the general one of them, in which a constant is replaced.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import stated

MOST = 4  # of a set


class Special(NamedTuple):
    """A condition on the constants, and the document of the members on which it holds."""

    condition: str
    document: Mapping[str, Any]


def singular_of(leaf: Mapping[str, Any], result: Mapping[str, Any]) -> list[str]:
    """The conditions on which the L of a leaf is none, without those that are apart from the leaf:
    F_0 = 0 for F(r) = F_0 r, where F' != 0.
    """
    proof = leaf.get("proof") or {}
    said_before = {f"{text} = 0" for text in leaf["nonzero"]}
    found = checker.read_exceptions(proof.get("exceptions") or ()).values
    left = [one for one in found if one not in said_before]
    apart = inequations_of(leaf, stated.names_of(result["system"])) if left else []
    return [one for one in left if not any(_vanishes(tree, one, names) for tree, names in apart)]


class Inequation(NamedTuple):
    """What does not vanish, with the solved constants and functions put in, and its names."""

    tree: ex.Expression
    names: Names


def inequations_of(leaf: Mapping[str, Any], names: Names) -> list[Inequation]:
    """The inequations of a leaf; [] where a solved part is not read."""
    try:
        trees = [reader.read_formula(text, names) for text in leaf["nonzero"]]
        for part in leaf.get("solved") or ():
            left, _, right = part["text"].partition(" = ")
            whole = reader.read_formula(left, names)
            functions = {name: _arguments(right, name) for name in part["new_functions"]}
            names = replace(
                names,
                parameters=(*names.parameters, *part["new_constants"]),
                functions={**names.functions, **functions},
            )
            value = reader.read_formula(right, names)
            trees = [_with_part(tree, whole, value) for tree in trees]
    except (errors.InputError, AttributeError, ValueError, ZeroDivisionError):
        return []
    return [Inequation(collecting.collect(tree), names) for tree in trees]


def _arguments(text: str, name: str) -> tuple[str, ...]:
    return tuple(text.partition(f"{name}(")[2].partition(")")[0].split(", "))


def _with_part(tree: ex.Expression, left: ex.Expression, right: ex.Expression) -> ex.Expression:
    from inverse_service.solving import closed_members

    if isinstance(left, ex.Arbitrary):
        return closed_members.put_function(tree, closed_members.Solved(left, right))
    return ex.substitute(tree, {left: right})


def _vanishes(tree: ex.Expression, condition: str, names: Names) -> bool:
    """Whether an element is seen to vanish where a condition on a constant holds."""
    with suppress(errors.InputError, ZeroDivisionError, calculus.NoRealValue):
        left, _, right = condition.partition(" = ")
        solved = _solved(reader.read_formula(f"{left} - ({right})", names), names.parameters)
        if solved is not None:
            put = {ex.Symbol(solved.constant): solved.value}
            return collecting.collect(ex.substitute(tree, put)) == ex.ZERO
    return False


def special_members(leaf: Mapping[str, Any], result: Mapping[str, Any]) -> list[Special]:
    """The documents of those conditions that can be solved for a constant."""
    proof = leaf.get("proof") or {}
    if stated.is_constrained(result) or not {"equations", "parameters"} <= proof.keys():
        return []
    return [*_specials(leaf, result)][:MOST]


def _specials(leaf: Mapping[str, Any], result: Mapping[str, Any]) -> Iterator[Special]:
    proof, whole = leaf["proof"], result["system"]
    functions = proof.get("functions") or {}
    names = Names(tuple(whole["coordinates"]), tuple(proof["parameters"]), functions)
    time = {} if whole.get("time", "t") == "t" else {"time": whole["time"]}
    for condition in singular_of(leaf, result):
        with suppress(errors.InputError, ZeroDivisionError, calculus.NoRealValue):
            left, _, right = condition.partition(" = ")
            tree = reader.read_formula(f"{left} - ({right})", names)
            solved = _solved(tree, names.parameters)
            if solved is None:
                continue
            constant, value = solved
            put = {ex.Symbol(constant): value}
            equations = {
                name: printing.to_text(ex.substitute(reader.read_formula(text, names), put))
                for name, text in proof["equations"].items()
            }
            for text in equations.values():
                reader.read_formula(text, names)  # it refuses x/0
            parameters = [name for name in names.parameters if name != constant]
            document = {
                "coordinates": list(names.coordinates), "equations": equations, "parameters": parameters, **time,
            }  # fmt: skip
            more = {"functions": {name: list(of) for name, of in functions.items()}}
            yield Special(condition, document | (more if functions else {}))


class _Solved(NamedTuple):
    constant: str
    value: ex.Expression


def _solved(tree: ex.Expression, constants: tuple[str, ...]) -> _Solved | None:
    """A constant that occurs in the tree linearly, times a number, and its value where the tree
    vanishes.
    """
    for name in constants:
        slope = calculus.differentiate(tree, ex.Symbol(name))
        if isinstance(slope, ex.Number) and slope != ex.ZERO:
            rest = ex.substitute(tree, {ex.Symbol(name): ex.ZERO})
            return _Solved(name, ex.negate(ex.divide(rest, slope)))
    return None
