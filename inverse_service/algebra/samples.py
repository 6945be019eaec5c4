"""Random points of one prime, and linear relations over Q among the values of trees there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from flint import nmod_mat

from inverse_service.algebra.point import Expansion, Point, evaluate
from inverse_service.algebra.primes import is_positive, reconstruct
from inverse_service.algebra.series import derivative, value_at_point
from inverse_service.algebra.tower import Requirement, Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Expression

# A residue of 61 bits is a fraction below the bound by chance with probability 10^-6.
_COEFFICIENT_BOUND = 10**6


@dataclass(slots=True)
class Samples:
    """Points of one prime at which all rules of a tower hold, used to find linear relations.

    `pending` are signs of quantities some of whose atoms have no rule yet.
    """

    tower: Tower
    points: list[Point] = field(default_factory=list)
    pending: list[Requirement] = field(default_factory=list)

    def values(self, expression: Expression) -> list[int]:
        return [evaluate(expression, point) for point in self.points]

    def gradients(self, expression: Expression) -> list[list[int]]:
        """Per point the partial derivatives with respect to all variables and parameters."""
        rows = []
        for point in self.points:
            series = Expansion(point, self.tower.variables, 1).expand(expression)
            rows.append([value_at_point(derivative(series, k)) for k in range(len(self.tower.variables))])
        return rows

    @property
    def prime(self) -> int:
        return self.points[0].prime

    def solve(self, columns: Sequence[Sequence[int]], target: Sequence[int]) -> list[Fraction] | None:
        """Rational a with sum a_j columns_j = target, or None; refuses what is not unique."""
        if not columns:
            return None if any(target) else []
        rows = [[*entries, b] for entries, b in zip(zip(*columns, strict=True), target, strict=True)]
        reduced, rank = nmod_mat(len(rows), len(rows[0]), [x for row in rows for x in row], self.prime).rref()
        pivots = [next(k for k in range(len(rows[0])) if int(reduced[i, k])) for i in range(rank)]
        if len(columns) in pivots:
            return None
        if rank < len(columns):
            raise IrreducibleAtoms("arguments of exponentials, logarithms or angles have irrational ratios")
        solution = [reconstruct(int(reduced[i, len(columns)]), self.prime, _COEFFICIENT_BOUND) for i in range(rank)]
        return None if any(a is None for a in solution) else [a for a in solution if a is not None]

    def ensure(self, columns: int) -> None:
        """Enough points for a linear system of so many unknowns, with all rules so far replayed."""
        prime = self.points[0].prime if self.points else draw_point(self.tower, 7).prime
        while len(self.points) < columns + 6:
            self.points.append(draw_point(self.tower, 1000 + len(self.points), prime))

    def admit_pending(self) -> None:
        """From now on the signs hold of those pending quantities that have a value by now."""
        ready = [requirement for requirement in self.pending if self.tower.values_all(requirement[0])]
        if ready:
            self.pending = [requirement for requirement in self.pending if requirement not in ready]
            self.tower.signs += [requirement for requirement in ready if requirement not in self.tower.signs]
            self.points.clear()

    def require_positive(self, radicand: Expression) -> None:
        """From now on only points at which the radicand has a root."""
        if radicand not in self.tower.radicands:
            self.tower.radicands.append(radicand)
            self.points[:] = [p for p in self.points if is_positive(evaluate(radicand, p), p.prime)]
