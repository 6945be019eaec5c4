"""The coefficients of a system by compiled series: one program for all points, the constants at each made once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.point import Point
from inverse_service.algebra.series_program import Registers, SeriesProgram, constants_at, run
from inverse_service.linear_pde.deciding import SECOND_ORDER

Integers = npt.NDArray[np.int64]


@dataclass(slots=True)
class Coefficients:
    """Series at random points; `write(order)` makes the program and its instructions for series to that order.

    To prolong to an order takes series to `degree` of it. `written` is the order of prolongation that the
    program serves, `constants` holds (prime, constants) for each seed.
    """

    write: Callable[[int], tuple[SeriesProgram, Integers]]
    draw: Callable[[int], Point]
    degree: Callable[[int], int] = lambda order: order + 2
    program: tuple[SeriesProgram, Integers] | None = None
    written: int = 0
    constants: dict[int, tuple[int, npt.NDArray[np.uint64]]] = field(default_factory=dict)

    def at(self, seed: int, order: int) -> tuple[int, Registers]:
        """The prime and all registers; SingularPoint where a denominator vanishes, TooLarge for too many words."""
        if self.program is None or order > self.written:
            self.written, self.constants = max(order, SECOND_ORDER), {}
            self.program = self.write(self.degree(self.written))
        series, instructions = self.program
        if seed not in self.constants:
            point = self.draw(seed)
            self.constants[seed] = (point.prime, constants_at(series, point))
        prime, constants = self.constants[seed]
        return prime, run(series, instructions, constants, prime, self.degree(order))
