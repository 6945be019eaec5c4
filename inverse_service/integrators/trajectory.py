"""The result of a run: the recorded motion and the outcome, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

# The meaning of each kind of outcome.
WORDS = {
    "singular": "the motion or the method ends there",
    "guard": "the step is too long for its equation",
    "unresolved": "the step is too long for the motion",
    "no_convergence": "the equation of the step was not solved",
    "not_finite": "a number is too large",
    "off_domain": "a formula ends",
    "no_one_motion": "no motion follows, or more than one",
    "zeno": "the events come ever faster",
    "cancelled": "the time was over",
}
Array = NDArray[np.float64]
Row = Sequence[float] | Array
Rows = NDArray[np.bool_] | NDArray[np.int64] | slice


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended.

    `kind` is "completed", "singular" (a quantity of the method vanished), "guard" (the implicit
    equations of a step are not safely solvable), "unresolved" (the motion turns too much in a
    step), "no_convergence" (Newton), "not_finite", "off_domain" (a formula has no value there),
    "no_one_motion" (contacts allow none, or several), "failed" (a fault of ours) or "cancelled".
    Where a run stopped, `step` says how many steps were done, `time` where the last of them led,
    `quantity` and `value` what vanished or passed its limit, `remedy` what to do about it. `note`
    says what was not checked, or why a guard did not count, `doubt` where a run to the end is not
    the motion.
    """

    kind: str
    step: int | None = None
    time: float | None = None
    quantity: str | None = None
    value: float | None = None
    remedy: str | None = None
    note: str = ""
    doubt: str = ""

    @property
    def completed(self) -> bool:
        return self.kind == "completed"

    @property
    def sentence(self) -> str:
        """What happened, when, and what to do: Stopped at t = 2.4: the step is too long (...). Take
        a smaller step.
        """
        what = WORDS.get(self.kind, self.kind.replace("_", " "))
        if self.quantity:
            value = "" if self.value is None or self.value != self.value else f" = {self.value:.3g}"
            what += f" ({self.quantity}{value})"
        remedy = f" {self.remedy[:1].upper()}{self.remedy[1:]}." if self.remedy else ""
        return f"Stopped at t = {self.time or 0.0:.6g}: {what}.{remedy}"


@dataclass(frozen=True, slots=True)
class Trajectory:
    """m + 1 recorded points of a motion with n coordinates; row 0 is the start.

    `times` (m + 1,), `positions` (m + 1, n). `momenta` (m + 1, n) are the discrete momenta of
    methods that have them, `velocities` (m + 1, n) the velocities at the points of those that carry
    them. `series[name]` (m + 1,) is an observed quantity at the recorded steps (row 0 that of the
    first step), `maxima[name]` its greatest absolute value over all steps, recorded or not.
    """

    times: Array
    positions: Array
    momenta: Array | None
    velocities: Array | None
    outcome: Outcome
    force_evaluations: int = 0
    newton_iterations: int = 0
    compile_seconds: float = 0.0
    run_seconds: float = 0.0
    series: Mapping[str, Array] = field(default_factory=dict)
    maxima: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_start(
        cls, time: float, positions: Row, velocities: Row | None, outcome: Outcome
    ) -> Trajectory:
        """A run that contains only its start."""
        speeds = None if velocities is None else np.array([velocities], dtype=float)
        return cls(np.array([time]), np.array([positions], dtype=float), None, speeds, outcome)

    def part(self, rows: Rows) -> Trajectory:
        """The same run with some of its points."""
        known = {
            name: getattr(self, name) for name in ("times", "positions", "momenta", "velocities")
        }
        points = {name: column[rows] for name, column in known.items() if column is not None}
        return replace(
            self, **points, series={name: column[rows] for name, column in self.series.items()}
        )

    def thinned(self, steps: int, every: int) -> Trajectory:
        """Every so many of its points, and the last one of a run that made all steps."""
        rows = range(0, len(self.times), every)
        last = [steps] if steps == len(self.times) - 1 and steps % every else []
        return self.part(np.array([*rows, *last], dtype=np.int64)) if every > 1 else self

    def ended(self, rows: Rows, outcome: Outcome) -> Trajectory:
        """The run truncated to these points; maxima are those recorded."""
        part = self.part(rows)
        maxima = {
            name: float(np.abs(column).max(initial=0.0)) for name, column in part.series.items()
        }
        return replace(part, outcome=outcome, maxima=maxima)
