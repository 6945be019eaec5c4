"""A system with its atoms reduced to independent generators: what every later stage starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Symbol,
    Velocity,
    substitute,
)
from inverse_service.field.elementary import to_kernels
from inverse_service.field.point import Expansion, Point, Variable
from inverse_service.field.real_point import RealTable, find_real_point
from inverse_service.field.reduction import reduce_atoms
from inverse_service.field.tower import Tower
from inverse_service.field.truncated_series import Series, SeriesRing
from inverse_service.mechanics.second_order_system import SecondOrderSystem, branches_of

if TYPE_CHECKING:
    from inverse_service.certificate.checker import CheckResult
    from inverse_service.field.sample_points import KnownTower


@dataclass(frozen=True, slots=True)
class Analysis:
    """f in kernels and the tower of its atoms; made once, used for both questions.

    `towers` keeps those that ansätze needed, with their random points; these lie on the constraints where
    velocities are `constrained` to be functions of the others. `proofs` keeps what the checker said of certificates.
    """

    system: SecondOrderSystem
    accelerations: tuple[Expression, ...]
    tower: Tower
    real_point: RealTable | None
    constrained: Mapping[Velocity, Expression] = field(default_factory=dict)
    towers: list[KnownTower] = field(default_factory=list, compare=False, repr=False)
    proofs: dict[str, tuple[dict[str, Any], CheckResult]] = field(default_factory=dict, compare=False, repr=False)

    def series(self, point: Point, with_time: bool, order: int) -> tuple[SeriesRing, list[Series], list[Series]]:
        """The ring of series in (t?, q, v) about the point, and v and f in it; SingularPoint where f has none."""
        expansion = Expansion(point, moving_variables(self.system, with_time), order)
        velocities = [expansion.expand(Velocity(name)) for name in self.system.coordinates]
        return expansion.ring, velocities, [expansion.expand(f) for f in self.accelerations]


def variables_of(system: SecondOrderSystem) -> tuple[Variable, ...]:
    """t, q, v and the parameters, and accelerations that are letters."""
    return (
        TIME,
        *(Symbol(name) for name in system.coordinates),
        *(Velocity(name) for name in system.coordinates),
        *(Symbol(name) for name in system.parameters),
        *system.letters,
    )


def moving_variables(system: SecondOrderSystem, with_time: bool) -> tuple[Variable, ...]:
    """(t?, q, v)."""
    return variables_of(system)[not with_time : 1 + 2 * len(system.coordinates)]


def analyze(system: SecondOrderSystem) -> Analysis:
    """The first branch of the system; IrreducibleAtoms where the relations among the atoms cannot be settled."""
    system = branches_of(system)[0]
    kernels = tuple(to_kernels(f) for f in system.accelerations)
    variables = variables_of(system)
    # Each other piece of a piecewise formula need not be defined on this one.
    roots = system.branch.roots if system.branch else ()
    steps: dict[Expression, Expression] = {node: one for node, one in roots if isinstance(node, Apply)}
    given = [to_kernels(substitute(f, steps)) for f in system.given] if system.positive else []
    if steps and find_real_point(tuple(map(to_kernels, system.given)), variables, 1, system.positive) is None:
        raise IrreducibleAtoms(_alone(system))
    # Of predators and prey, of which one is a coordinate, both are positive, as are their rates.
    positive = [*map(Symbol, system.parameters), *(tree for _, tree in system.others)] if system.others else []
    sides = [*system.positive, *positive]
    points = (find_real_point([*kernels, *given], variables, 1, tuple(side)) for side in (sides, system.positive))
    table = next((point for point in points if point is not None), None)
    tower = reduce_atoms(kernels, variables, table)
    return Analysis(system, kernels, tower, table)


def _alone(system: SecondOrderSystem) -> str:
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    equations = ", ".join(f"{name}'' = {to_text(f)}" for name, f in pairs)
    return f"other pieces of the formula seem to have no real value here: ask about this piece alone, {equations}"


def is_irrational(node: Expression) -> bool:
    """Whether the topmost operation of a formula is not rational."""
    if isinstance(node, Power):
        return not (isinstance(node.exponent, Number) and node.exponent.value.denominator == 1)
    return isinstance(node, Apply | Arbitrary)
