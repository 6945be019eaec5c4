"""Equations in quotes, dsolve('D2y = -y', 'y(0) = 1', 'x') of MATLAB, as equations of functions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

from inverse_service.reading.scripts import nodes as nd

# D2y and Dy are y'' and y' there, a letter has no value of the program.
_RATE = re.compile(r"D(\d?)([A-Za-z]\w*)")
_NAME = re.compile(r"\s*([A-Za-z]\w*)\s*")
OWN = "<own>"  # a letter of such a text


class Texts(NamedTuple):
    """The equations among the arguments of a dsolve, and the functions in them."""

    equations: tuple[nd.Node, ...]
    functions: tuple[str, ...]


def equations_of(arguments: Sequence[nd.Node], parts: Sequence[Sequence[nd.Node]]) -> Texts | None:
    """The equations of a dsolve whose texts have these parts; None where it has none.

    The independent variable is the last argument, if this is a name, and t otherwise.
    """
    time = _time_of(arguments[-1])
    trees = [tree for part in parts for tree in part]
    words = {node.text for tree in trees for node in nd.walk(tree) if isinstance(node, nd.Name)}
    rates = {word: match for word in sorted(words) if (match := _RATE.fullmatch(word))}
    functions = tuple(dict.fromkeys(match[2] for match in rates.values()))
    if not functions:
        return None
    found = [tree for tree in trees if not _is_initial(tree, {*functions, *rates})]
    return Texts(tuple(_with_rates(tree, rates, functions, time) for tree in found), functions)


def _time_of(last: nd.Node) -> str:
    match last:
        case nd.Name(text=text):
            return text
        case nd.Constant(value=str() as text) if named := _NAME.fullmatch(text):
            return named[1]
    return "t"


def _is_initial(tree: nd.Node, functions: set[str]) -> bool:
    """Whether this is Dx(0) = 1, or the name of the independent variable."""
    side = tree.left if isinstance(tree, nd.Binary) and tree.sign == "==" else tree
    called = side.function if isinstance(side, nd.Call) else side
    alone = side is tree and isinstance(tree, nd.Name)
    initial = isinstance(side, nd.Call) and isinstance(called, nd.Name) and called.text in functions
    return alone or initial


def _with_rates(
    node: nd.Node, rates: dict[str, re.Match[str]], functions: Sequence[str], time: str
) -> nd.Node:
    """The tree with diff(y, t, 2) for D2y, and with letters that are those of the text alone."""

    def changed(one: Any) -> Any:
        if isinstance(one, tuple):
            return tuple(map(changed, one))
        if not isinstance(one, nd.Node):
            return one
        if isinstance(one, nd.Call) and isinstance(one.function, nd.Name):
            name = one.function.text
            if name in functions and one.arguments in ((nd.Name(one.arguments[0].at, time),),):
                return nd.Name(one.at, name)  # y(t)
            return replace(one, arguments=changed(one.arguments))
        if isinstance(one, nd.Name) and one.text in rates:
            digits, name = rates[one.text].groups()
            order = nd.Constant(one.at, Fraction(digits or 1), True)
            by = (nd.Name(one.at, name), nd.Name(one.at, time), order)
            return nd.Call(one.at, nd.Name(one.at, "diff"), by)
        if isinstance(one, nd.Name):
            if one.text in functions or one.text == time:
                return one
            return nd.Call(one.at, nd.Name(one.at, OWN), (nd.Constant(one.at, one.text),))
        fields = {name: changed(getattr(one, name)) for name in one.__dataclass_fields__}
        return type(one)(**fields)

    found: nd.Node = changed(node)
    return found
