"""Wronskians, as whose vanishing the linear dependence of functions is recognized.

W(u, v, w) = det [[u, v, w], [u', v', w'], [u'', v'', w'']] is zero for analytic functions of one
variable exactly if they are linearly dependent (Bocher 1900).
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

from flint import fmpq, fmpq_mat

from inverse_service.expressions import polynomials, terms, tree as ex

Form = dict[tuple[str, ...], Fraction]  # names in all orders, and the coefficient


def dependent(tree: ex.Expression) -> tuple[ex.Expression, ...]:
    """The functions whose Wronskian the tree is, up to a factor; () if it is none.

    They are linear combinations with rational coefficients of unknown functions of one variable. A
    Wronskian is a sum of c f_i f_j' f_k'' ..., where c changes its sign with the order of i, j, k,
    ..., and so is such a sum if as many linear forms as it has factors are enough to write it.
    """
    try:
        found = terms.terms_of(tree)
    except terms.TooManyTerms:
        return ()
    whole, form = dict[str, ex.Arbitrary](), Form()
    for monomial, value in found.items():
        by_order = dict[int, str]()
        for factor, exponent in monomial:
            if not isinstance(factor, ex.Arbitrary) or len(factor.orders) != 1 or exponent != 1:
                return ()
            by_order[factor.orders[0]] = factor.name
            whole[factor.name] = ex.Arbitrary(factor.name, factor.arguments, (0,))
        if sorted(by_order) != [*range(len(monomial))]:
            return ()
        form[tuple(by_order[order] for order in range(len(monomial)))] = value
    count = len(next(iter(form), ()))
    names = sorted(whole)
    if count < 2 or len({one.arguments for one in whole.values()}) != 1:
        return ()
    if not _is_alternating(form, count):
        return ()
    # A form of degree k is a product of k linear ones exactly if its contractions span k of them.
    contracted = [
        [form.get((name, *others), Fraction(0)) for name in names]
        for others in itertools.combinations(names, count - 1)
    ]
    rows = [[fmpq(value.numerator, value.denominator) for value in row] for row in contracted]
    reduced, rank = fmpq_mat(rows).rref()
    if rank != count:
        return ()
    basis = [map(polynomials.as_fraction, row) for row in reduced.tolist()[:rank]]
    return tuple(
        ex.add(*(ex.number(c) * whole[name] for name, c in zip(names, row, strict=True) if c))
        for row in basis
    )


def _is_alternating(form: Form, count: int) -> bool:
    if any(len(key) != count or len({*key}) != count for key in form):
        return False
    for key in form:
        ordered = tuple(sorted(key))
        for turned in itertools.permutations(range(count)):
            sign = math.prod(-1 if a > b else 1 for a, b in itertools.combinations(turned, 2))
            if form.get(tuple(ordered[k] for k in turned), 0) != sign * form.get(ordered, 0):
                return False
    return True
