"""Whether a motion on constraints can be hamiltonised at all: the constrained card settled for one motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Point, Variable
from inverse_service.algebra.real_point import RealTable, find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series_program import SeriesProgram, TooLarge
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.kinds import bivectors, constrained
from inverse_service.inverse_problem.kinds.constrained import Shape
from inverse_service.linear_pde.deciding import Coefficients, Finding, Limits, settle
from inverse_service.linear_pde.emission import LocalEquations
from inverse_service.linear_pde.involution import Matrix
from inverse_service.linear_pde.unknowns import Unknowns
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion

Integers = npt.NDArray[np.int64]
_HIGHEST_ORDER, _MOST_UNKNOWNS = 16, 120_000


@dataclass(frozen=True, slots=True)
class AnalysedMotion:
    """w and F in kernels with the tower of their atoms, and a real point of D."""

    motion: ConstrainedMotion
    velocities: tuple[Expression, ...]
    forces: tuple[Expression, ...]
    tower: Tower
    real_point: RealTable | None

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates, the free ones first."""
        return (*self.motion.free, *self.motion.dependent)


def analyse_motion(motion: ConstrainedMotion) -> AnalysedMotion:
    """Raises IrreducibleAtoms where the relations among the atoms cannot be settled."""
    velocities, forces = (
        tuple(map(to_kernels, motion.dependent_velocities)),
        tuple(map(to_kernels, motion.free_accelerations)),
    )
    variables = variables_of(motion)
    table = find_real_point([*velocities, *forces], variables, seed=1)
    return AnalysedMotion(motion, velocities, forces, reduce_atoms([*velocities, *forces], variables, table), table)


def variables_of(motion: ConstrainedMotion) -> list[Variable]:
    """t, the coordinates, the free velocities and the parameters."""
    coordinates, velocities = map(Symbol, motion.coordinates), map(Velocity, motion.free)
    return [TIME, *coordinates, *velocities, *map(Symbol, motion.parameters)]


class ConstrainedAt:
    """The card for one motion, at random points or those that `draw` gives."""

    __slots__ = ("_first", "_series", "_shape", "matrix", "others", "unknowns")

    def __init__(self, analysed: AnalysedMotion, with_time: bool, draw: Callable[[int], Point] | None = None) -> None:
        motion = analysed.motion
        self._shape = shape = Shape(len(motion.free), len(motion.dependent), with_time)
        self.unknowns: Unknowns = constrained.unknowns_of(shape)
        self.matrix: Matrix = constrained.matrix_of(shape)
        self.others: tuple[Matrix, ...] = (constrained.regular_on_constraints(shape),)
        free: list[Expression] = [Velocity(name) for name in motion.free]
        variables: list[Variable] = [*[TIME] * with_time, *map(Symbol, analysed.names), *map(Velocity, motion.free)]
        field = [*free, *analysed.velocities, *analysed.forces]
        self._first = 0

        def write(order: int) -> tuple[SeriesProgram, Integers]:
            series = constrained.written(shape, variables, field, order)
            self._first = bivectors.write_brackets(shape, series)
            return series, np.array(series.instructions, np.int64).ravel()

        self._series = Coefficients(
            write,
            draw or (lambda seed: draw_point(analysed.tower, seed)),
            lambda order: bivectors.degree_for(shape, order),
        )

    def at(self, seed: int, order: int) -> LocalEquations:
        """Raises TooLarge where the series would take too many words."""
        prime, registers = self._series.at(seed, order)
        own = constrained.compiled_equations(self._shape, prime, order, registers)
        given = (registers, self._first, self._shape.slope(0, 0))
        return replace(own, equations=(*bivectors.equations(self._shape, self.unknowns, order, *given), *own.equations))


def decide_motion(
    analysed: AnalysedMotion, with_time: bool, seed: int, deadline: float, progress: Callable[[str], None]
) -> Finding:
    """Is the motion that of a regular L(q, v) on the constraints, or of an L(t, q, v)? Two points must agree."""
    limits = Limits(_HIGHEST_ORDER, deadline, _MOST_UNKNOWNS)
    try:
        return settle(ConstrainedAt(analysed, with_time), seed, limits, progress)
    except TooLarge:
        return Finding(None, 0, "its series are too large")
    except IrreducibleAtoms as problem:
        return Finding(None, 0, problem.detail)
