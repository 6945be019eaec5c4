"""Zeros of L~'s denominators that lie just ahead of where a run stopped, and whether the formulas have a pole there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from inverse_service.codegen.algebra import Formula, real_value
from inverse_service.simulation.formulas import Denominator, Formulas

# So far ahead a pole is felt by the guard or by Newton; the way there is nearly straight.
STEPS_AHEAD = 20
_NEAR = 1e-9
_LARGE = 1e4

State = Mapping[str, float]


def pole_ahead(f: Formulas, state: State, rates: Sequence[float], step: float) -> tuple[str, float] | None:
    """(text, value now) of the first denominator that passes 0 in STEPS_AHEAD steps, where dH~/dq has a pole.

    `state` gives positions, momenta and parameters by kernel name, `rates` the velocities. Denominators that H~ is
    smooth through, as cos(phi) of the disk, do not count.
    """
    for item in f.denominators:
        part = _zero_ahead(item, state, rates, step)
        if part is not None and _has_pole(f, state, rates, part * step):
            return item.text, real_value(item.formula, _moved(state, rates, 0.0))
    return None


def _moved(state: State, rates: Sequence[float], time: float) -> dict[str, float]:
    table = dict(state) | {f"v{k}": rate for k, rate in enumerate(rates)}
    return table | {f"q{k}": state[f"q{k}"] + time * rate for k, rate in enumerate(rates)}


def _zero_ahead(item: Denominator, state: State, rates: Sequence[float], step: float) -> float | None:
    """After how many steps on the straight way the denominator passes 0, by bisection; None where it does not."""
    value = real_value(item.formula, _moved(state, rates, 0.0))
    for k in range(STEPS_AHEAD):
        low, high = float(k), float(k + 1)
        if not value * real_value(item.formula, _moved(state, rates, high * step)) <= 0:
            continue
        while high - low > _NEAR:
            middle = (low + high) / 2
            passed = value * real_value(item.formula, _moved(state, rates, middle * step)) <= 0
            low, high = (low, middle) if passed else (middle, high)
        return low
    return None


def _has_pole(f: Formulas, state: State, rates: Sequence[float], time: float) -> bool:
    slopes: list[Formula] = [f.hamiltonian.diff(q) for q in f.symbols("q")]
    now, there = (
        max(abs(real_value(slope, _moved(state, rates, moment))) for slope in slopes) for moment in (0.0, time)
    )
    return not math.isfinite(there) or there > _LARGE * (1.0 + now)
