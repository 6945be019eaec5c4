"""Whether the first integrals found are all that are polynomials in the velocities up to a degree,
with a certificate.

Where there is room for more, cubic and quartic ones are sought at the lowest degree that has it.
Products of the known ones are counted, and the checker (`certificate.conserved`) proves that there
is no room for more: the number of solutions of Gamma F = 0, prolonged at one point, is that of the
products.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import combinations_with_replacement
from math import comb
from typing import Any

import mpmath
import numpy as np

from inverse_service import bounds
from inverse_service.certificate import checker, conserved
from inverse_service.deadline import now
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import AllIntegrals
from inverse_service.expressions import calculus, tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.mechanics.first_integrals import FirstIntegral, higher_integrals, motion_of

# Orders beyond the degree, unknowns, and products of integrals that a proof may take.
_MORE_ORDERS, _MOST_UNKNOWNS, _MOST_PRODUCTS = (1, 2, 3, 4), 450, 60
# A singular value of this relative size counts as zero when products are chosen, which the checker
# proves.
_TINY = 1e-9


def with_higher(
    analysis: deciding.Analysis, found: Sequence[FirstIntegral], seed: int, limit: float
) -> tuple[tuple[FirstIntegral, ...], AllIntegrals | None]:
    """The integrals, with those of the lowest degree at which there are more, and the proof that
    there are no others.

    Fewer than 2 n - 1 independent ones without t leave room for more. Each proof takes at most
    `limit` seconds, the search four times as long.
    """
    system = analysis.system
    complete = all_integrals(analysis, found, system.depends_on_time, limit)
    degree = 1 if complete is None else complete.degree + 1
    still = [one for one in found if not ex.holds(one.expression, ex.TIME)]
    room = len(still) < 2 * len(system.coordinates) - 1 and not system.depends_on_time
    if not (room and 2 <= degree <= conserved.MAX_DEGREE):
        return tuple(found), complete
    more = higher_integrals(motion_of(system), found, degree, seed, 4 * limit)
    if len(more) == len(found):
        return tuple(found), complete
    return more, all_integrals(analysis, more, False, limit) or complete


def all_integrals(
    analysis: deciding.Analysis, found: Sequence[FirstIntegral], with_time: bool, limit: float
) -> AllIntegrals | None:
    """The highest degree up to which the integrals are complete; None if that is not proven within
    `limit` seconds.

    Only systems without arbitrary functions whose f is a polynomial in the velocities have such a
    proof.
    """
    end, system = now() + limit, analysis.system
    trees = [one.expression for one in found if with_time or not ex.holds(one.expression, ex.TIME)]
    degrees = [(tree, d) for tree in trees if (d := degree_of(tree)) is not None and d > 0]
    # A result shows f as it was given, not as it is on one of its branches.
    is_given = tuple(system.given) == tuple(system.accelerations)
    if (
        system.functions
        or system.positive
        or not is_given
        or any(degree_of(f) is None for f in system.accelerations)
    ):
        return None
    complete = None
    for degree in range(
        1, conserved.MAX_DEGREE + 1
    ):  # complete to a degree only if it is to all lower ones
        proven = _complete_to(analysis, degrees, with_time, degree, end)
        if proven is None:
            break
        complete = proven
    return complete


def _complete_to(
    analysis: deciding.Analysis,
    degrees: Sequence[tuple[ex.Expression, int]],
    with_time: bool,
    degree: int,
    end: float,
) -> AllIntegrals | None:
    """The proof for one degree, at the lowest order at which it succeeds."""
    n, products = len(analysis.system.coordinates), list(_products(degrees, degree))
    if len(products) > _MOST_PRODUCTS:
        return None
    products = _independent(analysis, [tree for tree, _ in degrees], products)
    for order in (degree + more for more in _MORE_ORDERS):
        unknowns = comb(n + degree, n) * comb(n + with_time + order, order)
        if unknowns > _MOST_UNKNOWNS or now() > end:
            return None
        document = _document(
            analysis, [tree for tree, _ in degrees], with_time, degree, order, products
        )
        proven = checker.check_certificate(document, max(0.1, end - now()))
        if proven.verdict == "valid":
            return AllIntegrals(degree, len(products), with_time, document)
        if proven.verdict == "invalid":
            return None
    return None


def degree_of(tree: ex.Expression) -> int | None:
    """The degree as a polynomial in the velocities as it is written; None if it is none."""
    match tree:
        case ex.Velocity():
            return 1
        case ex.Sum(terms):
            degrees = [degree_of(term) for term in terms]
            return None if None in degrees else max(d for d in degrees if d is not None)
        case ex.Product(factors):
            degrees = [degree_of(factor) for factor in factors]
            return None if None in degrees else sum(d for d in degrees if d is not None)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1 and exponent > 0:
            inside = degree_of(base)
            return None if inside is None else inside * int(exponent)
    return None if ex.has(tree, ex.Velocity) else 0


def _products(degrees: Sequence[tuple[ex.Expression, int]], most: int) -> Iterator[tuple[int, ...]]:
    """The products of integrals up to a degree, short ones first, by their places."""
    for count in range(most + 1):
        for chosen in combinations_with_replacement(range(len(degrees)), count):
            if sum(degrees[k][1] for k in chosen) <= most:
                yield chosen


def _independent(
    analysis: deciding.Analysis, trees: Sequence[ex.Expression], products: Sequence[tuple[int, ...]]
) -> list[tuple[int, ...]]:
    """The products that are no combinations of those before, by their values at points near the
    real one.
    """
    table = analysis.real_point
    if table is None or not trees:
        return [()]
    moving = {*analysis.system.variables}
    random = np.random.default_rng(1)
    rows = list[list[float]]()
    with mpmath.workdps(bounds.DIGITS):
        for _ in range(8 * len(products)):
            place = {
                x: value * (1 + mpmath.mpf(random.uniform(-0.3, 0.3)) * (x in moving))
                for x, value in table.items()
            }
            with suppress(calculus.NoRealValue):
                values = [calculus.evaluate(tree, place) for tree in trees]
                rows.append([float(mpmath.fprod(values[k] for k in chosen)) for chosen in products])
            if len(rows) == 2 * len(products):
                break
    if not rows:  # an integral has no value: F(x) with F' = sin(x^2)
        return [()]
    matrix, kept = np.array(rows, float), list[int]()
    for number in range(len(products)):
        columns = matrix[:, np.array([*kept, number])]
        sizes = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
        if sizes[-1] > _TINY * sizes[0]:
            kept.append(number)
    return [products[k] for k in kept]


def _document(
    analysis: deciding.Analysis,
    trees: Sequence[ex.Expression],
    with_time: bool,
    degree: int,
    order: int,
    products: Sequence[tuple[int, ...]],
) -> Mapping[str, Any]:
    system = analysis.system
    names: list[ex.Symbol | ex.Velocity] = [*map(ex.Symbol, system.coordinates), ex.TIME]
    names += map(ex.Velocity, system.coordinates)
    return {
        "format": conserved.FORMAT,
        "system": {
            "coordinates": list(system.coordinates),
            "equations": {
                q: to_text(f) for q, f in zip(system.coordinates, system.accelerations, strict=True)
            },
            "parameters": list(system.parameters),
            "functions": {},
        },
        "question": "time_dependent" if with_time else "autonomous",
        "near": certify.near_of(analysis.real_point, [*names, *map(ex.Symbol, system.parameters)]),
        "degree": degree,
        "order": order,
        "number": len(products),
        "integrals": [to_text(tree) for tree in trees],
        "products": [list(chosen) for chosen in products],
    }
