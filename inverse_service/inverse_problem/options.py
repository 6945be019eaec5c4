"""What a caller asks of the solver, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SolveOptions:
    """Which question, which random numbers, how long.

    `time_dependent`: False asks for L(q, q'), True for L(t, q, q'), None for both. `seed` fixes
    the random points and primes, so that a run can be repeated. `time_limit` is in seconds; the
    solver looks at it between its stages and ends as undetermined.
    """

    time_dependent: bool | None = None
    seed: int = 1
    time_limit: float = 60.0
