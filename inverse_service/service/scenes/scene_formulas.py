"""Formulas for arbitrary functions, put in with their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inverse_service.errors import InputError
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import Arbitrary, Expression, Symbol, Velocity, rebuild, substitute, walk

Definitions = Mapping[str, tuple[tuple[str, ...], Expression]]


def read_definitions(given: Mapping[str, str], names: Names) -> Definitions:
    """The formula of each function over its own arguments; InputError with the pointer below /functions."""
    found = {}
    for key, text in given.items():
        pointer = f"/functions/{key}"
        name = names.spelling(key)
        if name not in names.functions:
            known = ", ".join(names.functions) or "none"
            raise InputError(f"'{key[:40]}' is no function of this system: its functions are {known}.", pointer)
        arguments = names.functions[name]
        try:
            tree = read_formula(text, Names(names.coordinates, names.parameters))
        except InputError as error:
            raise type(error)(error.detail, pointer, error.column) from None
        foreign = [n for n in walk(tree) if isinstance(n, Velocity) or _is_other(n, arguments, names)]
        if foreign:
            raise InputError(f"{name} depends on {', '.join(arguments)} only: write it in these.", pointer)
        found[name] = (arguments, tree)
    return found


def _is_other(node: Expression, arguments: tuple[str, ...], names: Names) -> bool:
    return isinstance(node, Symbol) and node.name in names.coordinates and node.name not in arguments


def defined(tree: Expression, definitions: Definitions) -> Expression:
    """The tree with the formulas of its functions put in, derivatives taken."""
    if not definitions:
        return tree
    inner = rebuild(tree, lambda part: defined(part, definitions))
    if not isinstance(inner, Arbitrary) or inner.name not in definitions:
        return inner
    arguments, found = definitions[inner.name]
    for name, order in zip(arguments, inner.orders, strict=True):
        for _ in range(order):
            found = differentiate(found, Symbol(name))
    return substitute(found, {Symbol(name): value for name, value in zip(arguments, inner.arguments, strict=True)})


def refuse_open_functions(formulas: Sequence[Expression], names: Names) -> None:
    """InputError where a formula still holds a function without a formula of its own."""
    missing = sorted({node.name for tree in formulas for node in walk(tree) if isinstance(node, Arbitrary)})
    if not missing:
        return
    example = f'{{"{missing[0]}": "cos({names.functions[missing[0]][0]})"}}'
    raise InputError(
        f"the functions {', '.join(missing)} are arbitrary: give each a formula in 'functions', as in {example}.",
        "/functions",
    )
