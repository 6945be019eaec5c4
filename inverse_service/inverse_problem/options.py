"""What a caller asks of the solver, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from inverse_service.expressions.tree import Expression

if TYPE_CHECKING:
    from inverse_service.inverse_problem.solutions import Solution


@dataclass(frozen=True, slots=True)
class SolveOptions:
    """Which question, which random numbers, how long, and the caller's own ideas.

    `time_dependent`: False asks for L(q, q'), True for L(t, q, q'), None for both. `seed` fixes the random points and
    primes, so that a run can be repeated. `time_limit` is in seconds; the solver looks at it between its stages and
    ends as undetermined. `ansatz`: terms that a Lagrangian is first looked for in. `given`: the equations as they were
    written, one tree for each that vanishes along the motion, accelerations unsolved: their own multiplier is tried
    first. `series_order`: up to which order the multiplier is expanded where no closed form is found; None leaves the
    choice to the solver. `conditions`: whether Phi, nabla Phi and R are written out. `so_far`: told an answer that the
    checker has confirmed, while there is more to find.
    """

    time_dependent: bool | None = None
    seed: int = 1
    time_limit: float = 60.0
    ansatz: tuple[Expression, ...] = ()
    given: tuple[Expression, ...] = ()
    series_order: int | None = None
    conditions: bool = True
    so_far: Callable[[Solution], None] | None = None
