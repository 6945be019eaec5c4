"""Whether the implicit equations of a step have one root only, however large the step is.

One equation F(d) = 0 whose derivative has one sign for all real values has at most one root: so for a convex potential
at any step, 1 + h^2 V''/4 > 0. Signs are read off the formula: even powers, exponentials and hyperbolic cosines,
parameters by their values; what cannot be read off is not claimed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import symengine

from inverse_service.codegen.algebra import Formula, free_names, number, symbol
from inverse_service.codegen.program import Iterate, Program

_POSITIVE = ("exp", "cosh")


class Sign(NamedTuple):
    """value * formula >= 0 for all real values of its names; > 0 where `strict`."""

    value: int
    strict: bool


def has_unique_roots(program: Program, known: Mapping[str, float]) -> bool:
    """True where every implicit block is one monotone equation or linear; `known` gives h, a and the parameters.

    Names of `known` that are missing count as of any sign.
    """
    if any(watch.kind == "bound" for watch in program.watches):
        return False
    for block in program.blocks:
        if isinstance(block, Iterate):
            return False
        if block.affine:
            continue
        sign = sign_of(block.jacobian[0][0], known) if len(block.unknowns) == 1 else None
        if sign is None or not sign.strict:
            return False
    return True


def sign_of(formula: Formula, known: Mapping[str, float]) -> Sign | None:
    """The sign that the formula has for all real values of the names that are not known; None where none is seen."""
    names = free_names(formula)
    if names <= known.keys():
        return _of_number(float(formula.subs({symbol(name): number(float(known[name])) for name in names})))
    if formula.is_Symbol:
        return None
    if isinstance(formula, symengine.Pow):
        base, exponent = formula.args
        return _of_power(base, exponent, known)
    parts = [sign_of(part, known) for part in formula.args]
    if isinstance(formula, symengine.Add):
        return _of_sum(parts)
    if isinstance(formula, symengine.Mul):
        return _of_product(parts)
    return Sign(1, True) if type(formula).__name__.lower() in _POSITIVE else None


def _of_number(value: float) -> Sign | None:
    return Sign(1 if value >= 0 else -1, value != 0) if value == value else None


def _of_sum(parts: list[Sign | None]) -> Sign | None:
    signs = [part for part in parts if part is not None]
    if len(signs) < len(parts) or len({sign.value for sign in signs}) != 1:
        return None
    return Sign(signs[0].value, any(sign.strict for sign in signs))


def _of_product(parts: list[Sign | None]) -> Sign | None:
    value, strict = 1, True
    for part in parts:
        if part is None:
            return None
        value, strict = value * part.value, strict and part.strict
    return Sign(value, strict)


def _of_power(base: Formula, exponent: Formula, known: Mapping[str, float]) -> Sign | None:
    if base == symengine.E:
        return Sign(1, True)
    inner = sign_of(base, known)
    strict = inner is not None and inner.strict
    if exponent.free_symbols or (float(exponent) < 0 and not strict):
        return None
    if isinstance(exponent, symengine.Integer):
        if int(exponent) % 2 == 0:
            return Sign(1, strict)
        return None if inner is None else Sign(inner.value, strict)
    return Sign(1, strict) if inner is not None and inner.value > 0 else None
