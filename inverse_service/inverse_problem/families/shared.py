"""Systems that are combinations of the same letters, decided at common points with common series.

The atoms of all letters are reduced once; at each point and order each letter is expanded once, and f of a
member is a linear combination of these series. First the algebraic conditions to `_LEVEL` are tried at two
points over two primes: where they leave only singular g at both, the member is not variational. The
others are decided by prolongation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from inverse_service.algebra import series as ps
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Expansion, Variable
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series import Series, SeriesRing, SingularPoint
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis, variables_of
from inverse_service.inverse_problem.decision.deciding import Decision, decide
from inverse_service.inverse_problem.decision.local_system import LocalSystem, local_system
from inverse_service.inverse_problem.explanation.hierarchy import all_singular, tensors_at
from inverse_service.inverse_problem.explanation.pointwise import motion_of_series
from inverse_service.inverse_problem.outcome import Verdict
from inverse_service.linear_pde.deciding import Limits
from inverse_service.mechanics.nonholonomic.associated_families import Member, accelerations
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_LEVEL = 1


@dataclass(frozen=True, slots=True)
class _Expanded:
    """The series of the velocities and of every letter at one point."""

    ring: SeriesRing
    speeds: list[Series]
    letters: list[Series]

    def force(self, combination: Sequence[tuple[int, Fraction]]) -> Series:
        """A linear combination of letters."""
        total = self.ring.constant(0)
        for letter, factor in combination:
            residue = factor.numerator * self.ring.invert_number(factor.denominator) % self.ring.prime
            series = self.letters[letter]
            total = ps.add(total, series if residue == 1 else ps.scale(series, residue))
        return total


@dataclass(slots=True)
class SharedLetters:
    """The letters with their tower and the expansions made so far; `system` gives names and parameters."""

    system: SecondOrderSystem
    letters: tuple[Expression, ...]
    kernels: tuple[Expression, ...]
    tower: Tower
    expansions: dict[tuple[bool, int, int], _Expanded] = field(default_factory=dict)

    @classmethod
    def of(cls, system: SecondOrderSystem, letters: Sequence[Expression]) -> SharedLetters:
        """Raises IrreducibleAtoms where relations among the atoms cannot be settled."""
        kernels = tuple(map(to_kernels, letters))
        variables = variables_of(system)
        tower = reduce_atoms(kernels, variables, find_real_point(kernels, variables, seed=1))
        return cls(system, tuple(letters), kernels, tower)

    def member_system(self, member: Member, name: str = "") -> SecondOrderSystem:
        """The member as a system of its own."""
        trees = accelerations(member, self.letters)
        return SecondOrderSystem(self.system.coordinates, trees, self.system.parameters, self.system.functions, name)

    def expanded(self, with_time: bool, seed: int, order: int) -> _Expanded:
        """All letters at the point of this seed."""
        key = with_time, seed, order
        if key not in self.expansions:
            point = draw_point(self.tower, seed)
            velocities = [Velocity(name) for name in self.system.coordinates]
            positions = [Symbol(name) for name in self.system.coordinates]
            variables: list[Variable] = [*([TIME] if with_time else []), *positions, *velocities]
            expansion = Expansion(point, variables, order)
            speeds = [expansion.expand(v) for v in velocities]
            letters = [expansion.expand(kernel) for kernel in self.kernels]
            self.expansions[key] = _Expanded(expansion.ring, speeds, letters)
        return self.expansions[key]

    def verdict(self, member: Member, with_time: bool, seed: int, limits: Limits) -> Verdict:
        """The decision on a member; points where a letter is singular are not replaced by others here."""
        if all(self._algebraic(member, with_time, 2 * seed + k) for k in (0, 1)):
            return "not_variational"
        return self.decision(member, with_time, seed, limits).verdict

    def _algebraic(self, member: Member, with_time: bool, seed: int) -> bool:
        """Whether the algebraic conditions leave only singular multipliers at the point."""
        try:
            found = self.expanded(with_time, seed, _LEVEL + 2)
        except SingularPoint:
            return False
        local = motion_of_series(found.ring, found.speeds, [found.force(part) for part in member])
        table = tensors_at(local, _LEVEL)
        return all_singular(table.kernel(list(table.rows)), table.size, table.prime)

    def decision(self, member: Member, with_time: bool, seed: int, limits: Limits) -> Decision:
        """By prolongation."""
        system = self.member_system(member)
        forces = tuple(accelerations(member, self.kernels))
        analysis = Analysis(system, forces, self.tower, None)

        def expander(time: bool, point: int, order: int) -> LocalSystem:
            found = self.expanded(time, point, order + 2)
            return local_system(found.ring, found.speeds, [found.force(part) for part in member], time)

        try:
            return decide(system, with_time, seed, limits, analysis=analysis, expander=expander)
        except IrreducibleAtoms as problem:
            return Decision("undetermined", with_time, 0, reason=problem.detail)
