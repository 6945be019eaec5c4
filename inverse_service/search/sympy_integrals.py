"""Integrals of elementary formulas by SymPy, as candidates."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial

import sympy
from sympy.integrals.heurisch import heurisch
from sympy.simplify.fu import TR8

from inverse_service.expressions import tree as ex
from inverse_service.reading import sympy_trees


def elementary_antiderivatives(
    slope: ex.Expression, variable: ex.Symbol, signs: Mapping[ex.Symbol, int]
) -> Iterator[ex.Expression]:
    """Elementary candidates from SymPy for the integral of a formula in real symbols with these signs.

    They are not verified: the first case of a piecewise integral is taken, and `floor` is replaced by 0.
    """
    symbols = {
        name: sympy.Symbol(name.name, **{"positive" if sign > 0 else "negative": True}) for name, sign in signs.items()
    }
    symbols[variable] = x = sympy.Symbol(variable.name, real=True)
    leaves = sympy_trees.Leaves({each: name for name, each in symbols.items()}, {})
    given = sympy_trees.to_sympy(slope, lambda node: symbols[node])  # type: ignore[index]
    logarithms = {
        each: sympy.log(each.args[0] + sympy.sqrt(each.args[0] ** 2 - 1)) for each in given.atoms(sympy.acosh)
    }
    plain = given.xreplace(logarithms).rewrite((sympy.sinh, sympy.cosh, sympy.tanh), sympy.exp)
    circular = plain.atoms(sympy.sin, sympy.cos)
    sums = [TR8(plain)] if len({each.args for each in circular}) > 1 else []  # of products of sines
    for integrate in (partial(sympy.integrate, meijerg=False), heurisch):
        for formula in dict.fromkeys((*sums, plain, given)):
            with suppress(Exception):  # SymPy's are of all kinds
                found = integrate(formula, x)
                if found is not None and not found.has(sympy.Integral, sympy.I):
                    found = found.xreplace({long: u for u, long in logarithms.items()})
                    found = found.replace(sympy.floor, lambda _: sympy.S.Zero)
                    yield sympy_trees.from_sympy(found.replace(sympy.Piecewise, lambda first, *_: first[0]), leaves)
