"""The conditions of the hierarchy in numbers, at a point with rational values (`rational_points`)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import cast

from inverse_service.algebra.point import Expansion, Point, Variable, number_value
from inverse_service.algebra.primes import safe_prime
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.explanation.hierarchy import (
    ConditionName,
    EquationName,
    SufficientSet,
    all_singular,
    hierarchy,
    kernel,
    tensors_at,
    unknowns,
)
from inverse_service.inverse_problem.explanation.pointwise import LocalScalar, motion_of_series
from inverse_service.inverse_problem.explanation.rational_points import (
    PlainPoint,
    SmallPoint,
    atoms_and_jets,
    bare_variables,
    has_points,
    in_fractions,
    is_real,
    residues_at,
)
from inverse_service.mechanics.conditions import Tensor11

_ATTEMPTS = 400

Values = Mapping[object, Fraction]


@dataclass(frozen=True, slots=True)
class NumbersAtAPoint:
    """Values of variables and atoms, of the tensors (n, n) and of the equations over `unknowns`.

    `real` says whether a real point has these values; else they only respect the algebraic relations.
    """

    variables: Mapping[Variable, Fraction]
    atoms: Mapping[Expression, Fraction]
    tensors: Mapping[ConditionName, tuple[tuple[Fraction, ...], ...]]
    rows: Mapping[EquationName, tuple[Fraction, ...]]
    real: bool = True


def numbers_at_a_point(
    analysis: Analysis, chosen: SufficientSet, deadline: float = float("inf")
) -> NumbersAtAPoint | None:
    """The chosen equations at a point where they still leave only singular g.

    None where none was met before the deadline (time.monotonic), or numbers such as pi have no value.
    """
    if not has_points(analysis):
        return None
    size = len(analysis.system.coordinates)
    for attempt in range(_ATTEMPTS):
        if time.monotonic() > deadline:
            break
        values = in_fractions(analysis, partial(_residues, analysis, chosen, attempt))
        if values is None:
            continue
        rows = {name: tuple(values[name, k] for k in range(len(unknowns(size)))) for name in chosen.equations}
        if _leaves_singular_only(rows, size):
            return _collected(analysis, chosen, values, rows)
    return None


def _leaves_singular_only(rows: Mapping[EquationName, tuple[Fraction, ...]], size: int) -> bool:
    """Whether every symmetric matrix that fulfils the rows is singular."""
    prime = safe_prime(7_003)
    residues = [tuple(number_value(entry, prime) for entry in row) for row in rows.values()]
    return all_singular(kernel(residues, len(unknowns(size)), prime), size, prime)


def _collected(
    analysis: Analysis, chosen: SufficientSet, values: Values, rows: Mapping[EquationName, tuple[Fraction, ...]]
) -> NumbersAtAPoint:
    """The values by what they are values of."""
    size = range(len(analysis.system.coordinates))
    bare = {name for f in analysis.accelerations for name in bare_variables(f)}
    variables = {key: value for key, value in values.items() if isinstance(key, Symbol | Velocity) and key in bare}
    atoms = {atom: values[atom] for atom in _atoms(analysis, chosen)}
    tensors = {
        condition: tuple(tuple(values[condition, i, k] for k in size) for i in size)
        for condition in chosen.conditions
        if not condition.cyclic
    }
    return NumbersAtAPoint(variables, atoms, tensors, rows, is_real(analysis))


def _residues(analysis: Analysis, chosen: SufficientSet, attempt: int, prime: int) -> dict[object, int] | None:
    """Everything at the point number `attempt`, modulo the prime; None where it is singular."""
    kind = PlainPoint if attempt % 2 else SmallPoint
    point = kind(prime, attempt // 2, dict(analysis.tower.real_signs))
    return residues_at(analysis, point, _atoms(analysis, chosen), lambda there: _conditions(analysis, chosen, there))


def _atoms(analysis: Analysis, chosen: SufficientSet) -> list[Expression]:
    return atoms_and_jets(analysis, max(condition.order for condition in chosen.conditions) - 1)


def _conditions(analysis: Analysis, chosen: SufficientSet, point: Point) -> dict[object, int]:
    """The tensors' components and the rows of the equations at the point."""
    system = analysis.system
    depth = max(condition.order for condition in chosen.conditions) - 2
    moment: list[Variable] = [TIME] if system.depends_on_time else []
    positions: list[Variable] = [Symbol(name) for name in system.coordinates]
    velocities: list[Variable] = [Velocity(name) for name in system.coordinates]
    variables = [*moment, *positions, *velocities]
    expansion = Expansion(point, variables, depth + 2)
    forces = [expansion.expand(f) for f in analysis.accelerations]
    local = motion_of_series(expansion.ring, [expansion.expand(v) for v in velocities], forces)
    tensors, rows = hierarchy(local.motion, depth), tensors_at(local, depth).rows
    found: dict[object, int] = {}
    for condition in chosen.conditions:
        if not condition.cyclic:
            plain = cast("Tensor11[LocalScalar]", tensors[condition])
            found |= {(condition, i, k): entry.value for i, row in enumerate(plain) for k, entry in enumerate(row)}
    for name in chosen.equations:
        found |= {(name, column): entry for column, entry in enumerate(rows[name])}
    return found
