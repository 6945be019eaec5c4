"""The beginning of the power series of l and lambda_a, where a Lagrangian exists and none is known in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from inverse_service.algebra.modular import safe_prime
from inverse_service.algebra.point import Point, Variable
from inverse_service.algebra.series import SingularPoint
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.inverse_problem.constrained.deciding import AnalysedMotion, ConstrainedAt
from inverse_service.inverse_problem.decision.analysis import is_irrational
from inverse_service.inverse_problem.decision.power_series import (
    RationalSeries,
    as_tree,
    reconstructed,
    solution,
)
from inverse_service.inverse_problem.explanation.wording import said, separated
from inverse_service.inverse_problem.outcome import Step
from inverse_service.linear_pde.deciding import Finding
from inverse_service.linear_pde.emission import advance, start
from inverse_service.linear_pde.involution import matrix_at
from inverse_service.linear_pde.unknowns import unknown_names

_POINTS, _MOST_TERMS = 4, 400
Place = tuple[int, tuple[int, ...]]  # of a coefficient: which function, which exponents


def series_steps(analysed: AnalysedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
    """One step with l and lambda_a to the degree at which the system is involutive; none where they are not rational.

    Every solution of the projected system to this degree is the beginning of an analytic one.
    """
    motion = analysed.motion
    if any(is_irrational(node) for tree in (*analysed.velocities, *analysed.forces) for node in walk(tree)):
        return ()
    variables: list[Variable] = [*[TIME] * with_time, *map(Symbol, analysed.names), *map(Velocity, motion.free)]
    symbols = [*variables, *map(Symbol, motion.parameters)]
    for first in range(1, 1 + _POINTS):
        values = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            coefficients = _coefficients(analysed, found, with_time, values)
        except SingularPoint:
            continue
        if coefficients is not None and len(coefficients) <= _MOST_TERMS:
            return (_written(variables, values, coefficients, len(motion.dependent)),)
    return ()


def _coefficients(
    analysed: AnalysedMotion, found: Finding, with_time: bool, values: Mapping[Variable, int]
) -> dict[Place, Fraction] | None:
    card = ConstrainedAt(analysed, with_time, lambda seed: Point(safe_prime(seed), seed, variables=dict(values)))
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
