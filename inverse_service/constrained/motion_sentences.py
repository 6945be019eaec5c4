"""What was found about a motion on constraints, in words.

Where a Lagrangian exists and none is known in closed form: the beginning of the power series of l and lambda_a.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from math import comb

from inverse_service import bounds
from inverse_service.constrained.existence import AnalyzedMotion, ConstrainedAt
from inverse_service.constrained.lagrangian import JetOnConstraints
from inverse_service.decision.analysis import is_irrational
from inverse_service.decision.power_series import (
    RationalSeries,
    as_tree,
    reconstructed,
    solution,
)
from inverse_service.decision.solutions import Step
from inverse_service.explanation.wording import said, separated
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.field.modular import safe_prime
from inverse_service.field.point import Point, Variable
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.linear_pde.emission import advance, start
from inverse_service.linear_pde.involution import matrix_at
from inverse_service.linear_pde.involutive_form import Finding
from inverse_service.linear_pde.unknowns import unknown_names

_QUESTION = {False: "L(q, q')", True: "L(t, q, q')"}


def finding_steps(analyzed: AnalyzedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
    """What is asked, and why the answer is what it is."""
    k = len(analyzed.motion.free)
    steps = [
        said(
            f"A regular {_QUESTION[with_time]} has this motion on the constraints exactly if `l` and `lambda_a`, in "
            "`L = l + lambda_a mu^a + ...` along the constraints, make its Euler-Lagrange expressions vanish there, a "
            f"linear system. The second derivatives of `l` by the free velocities and the first of `lambda_a` must "
            f"have rank {k} together."
        )
    ]
    if found.exists is False:
        steps += _bivector_steps(found)
        alone = "At a point, by power series along one solution"
        how = f"Prolonged to order {found.order}" if found.along is None else alone
        steps.append(
            said(
                f"{how}, {len(found.rows)} equations leave a rank below {k} in every solution: no associated system is "
                "variational.",
                about=("prolonged", "associated") if found.along is None else ("associated",),
            )
        )
    elif found.symbol is not None:
        steps.append(
            said(
                f"Prolonged to order {found.order} the system is involutive at degree {found.degree}, with solutions "
                f"of rank {found.ranks[0]}; the derivatives of l alone have rank {found.ranks[1]}. "
                "So there is such a Lagrangian near the generic point.",
                about=("prolonged", "involutive"),
            )
        )
    return tuple(steps)


def _bivector_steps(found: Finding) -> list[Step]:
    """Why the equations of the bivectors hold, where the proof uses them."""
    rows = [row for row in found.rows if str(row[0]).startswith("B")]
    orders = [int(str(name)[1:].partition("_")[0]) for name, *_ in rows]
    if not orders:
        return []
    # Without derivatives they are equations for the values of the 2-form, which are arbitrary but for these.
    alone = rows == list(found.rows) and not any(any(row[-1]) for row in rows if isinstance(row[-1], tuple))
    return [
        said(
            "The 2-form of such a Lagrangian vanishes on the Lie derivatives along the motion of the bivectors of the "
            f"free velocities: equations of first order, of which {len(orders)} are used, to order {max(orders)}."
            f"{' Each 2-form that does has a vertical vector in its kernel.' * alone}"
        )
    ]


def lagrangian_steps(lagrangian: Expression, jet: JetOnConstraints) -> tuple[Step, ...]:
    """L and its 1-jet along the constraints."""
    momenta = [row(f"lambda_{k} = ", tree) for k, tree in enumerate(jet.transverse_momenta, 1)]
    return (
        said("A Lagrangian, found by an ansatz or known for an associated system: ", shown=[row("L = ", lagrangian)]),
        said("Along the constraints it is ", row("l = ", jet.on_constraints), *separated(["", *momenta]), "."),
    )


def reduced_steps(names: Sequence[str]) -> tuple[Step, ...]:
    """Why a Lagrangian of the free coordinates is one of the motion."""
    listed = ", ".join(names)
    return (
        said(
            f"The equations of {listed} contain no other coordinate. A Lagrangian of theirs and half the squares of "
            "the constraints together give the whole motion on the constraints."
        ),
    )


def open_reason(found: Finding) -> str:
    """How far the decision came."""
    if not found.history:
        return found.reason
    dimensions = ", ".join(map(str, found.history[-1][:3]))
    return (
        f"{found.reason}: at order {found.order} rank {found.ranks[0] if found.ranks else 'unknown'} is possible, "
        f"dimensions {dimensions} in degrees 0, 1, 2"
    )


def freedom(found: Finding, n: int, with_time: bool) -> str:
    """On how many functions of how many variables L along the constraints depends, total derivatives not counted.

    The dimension of the symbol in degree d + j is sum alpha_k C(k - 1 + j, k - 1); `_gauge` says what F takes away.
    """
    if found.symbol is None:
        return ""
    characters, degree, variables = found.symbol.characters, found.degree, n + with_time

    def size(j: int) -> int:
        total = sum(a * comb(k - 1 + j, k - 1) for k, a in enumerate(characters, 1))
        return total - _gauge(degree + j, variables) + _gauge(degree + j - 1, variables)

    values, power, leading = [size(j) for j in range(len(characters) + 1)], -1, 0
    while any(values):
        power, leading = power + 1, values[0]
        values = [b - a for a, b in pairwise(values)]
    if power < 0:
        constants = found.history[found.order][degree] - _gauge(degree, variables)
        return f"{constants} constant{'s' * (constants != 1)}"
    return f"{leading} function{'s' * (leading != 1)} of {power + 1} variable{'s' * (power > 0)}"


def _gauge(degree: int, variables: int) -> int:
    """The dimension of l = Gamma(F), lambda_a = dF/ds^a, F of so many variables, in unknowns up to a degree.

    Those of F of degree up to d + 1, but for F = 1, and the derivatives along Gamma, in l, of those of degree d + 2.
    """
    return comb(variables + degree + 1, variables) - 1 + comb(variables + degree, variables - 1)


Place = tuple[int, tuple[int, ...]]  # of a coefficient: which function, which exponents


def series_steps(analyzed: AnalyzedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
    """One step with l and lambda_a to the degree at which the system is involutive; none where they are not rational.

    Every solution of the projected system to this degree is the beginning of an analytic one.
    """
    motion = analyzed.motion
    if any(is_irrational(node) for tree in (*analyzed.velocities, *analyzed.forces) for node in walk(tree)):
        return ()
    variables: list[Variable] = [*[TIME] * with_time, *map(Symbol, analyzed.names), *map(Velocity, motion.free)]
    symbols = [*variables, *map(Symbol, motion.parameters)]
    for first in range(1, 1 + bounds.ATTEMPTS):
        values = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            coefficients = _coefficients(analyzed, found, with_time, values)
        except SingularPoint:
            continue
        if coefficients is not None and len(coefficients) <= bounds.SHOWN:
            return (_written(variables, values, coefficients, len(motion.dependent)),)
    return ()


def _coefficients(
    analyzed: AnalyzedMotion, found: Finding, with_time: bool, values: Mapping[Variable, int]
) -> dict[Place, Fraction] | None:
    card = ConstrainedAt(analyzed, with_time, lambda seed: Point(safe_prime(seed), seed, variables=dict(values)))
    return reconstructed(lambda seed: _residues(card, found, seed))


def _residues(card: ConstrainedAt, found: Finding, seed: int) -> tuple[int, dict[Place, int] | None]:
    """A solution of full rank modulo a prime; squares have the coefficient 1/2, all else that is free is zero."""
    prolongation = start(card.at(seed, found.order))
    for _ in range(found.order + 1):
        advance(prolongation)
    prime = prolongation.local.prime
    if prolongation.dimension(found.degree) != found.history[found.order][found.degree]:
        return prime, None
    places = [place for degree in range(found.degree + 1) for place in unknown_names(card.unknowns, degree)]
    half = pow(2, -1, prime)
    values = solution(prolongation.echelon, len(places), lambda k: half if _is_square(places[k]) else 0)
    regular = matrix_at(card.unknowns, card.matrix, values, prime).rank() == card.matrix.rank
    return prime, {place: values[k] for k, place in enumerate(places)} if regular else None


def _is_square(place: Place) -> bool:
    return sum(place[1]) == 2 and 2 in place[1]


def _written(
    variables: list[Variable], values: Mapping[Variable, int], found: Mapping[Place, Fraction], dependent: int
) -> Step:
    def series(function: int) -> Expression:
        chosen = {index: a for (which, index), a in found.items() if which == function and a}
        return as_tree(RationalSeries(0, tuple(variables), values, chosen))

    where = separated([row(symbol, f" = {value}") for symbol, value in values.items()])
    shown = [row(f"lambda_{a} = ", series(a), " + ...") for a in range(1, dependent + 1)]
    return said(
        "No closed form was found. Near ", *where, " a solution of full rank begins ",
        shown=[row("l = ", series(0), " + ..."), *shown],
    )  # fmt: skip
