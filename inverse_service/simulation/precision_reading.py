"""What measured errors and times say: orders, the time to an error, and who is faster where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from inverse_service.simulation.precision import Precision, Setting

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
GEOMETRIC = frozenset({"variational", "nonholonomic", "modified"})


def curves(measured: Precision) -> dict[str, list[Setting]]:
    """For each method what is drawn: settings with an error and a time, by falling step, up to the floor."""
    found: dict[str, list[Setting]] = {}
    for setting in measured.settings:
        own = found.setdefault(setting.requested.label, [])
        if setting.error and setting.best is not None and not setting.at_floor:
            own.append(setting)
    return found


def measured_order(curve: Sequence[Setting], scale: float) -> float | None:
    """The median slope of log error over log step where errors are below 1 % of the motion and above round-off.

    None for a method that chooses its steps itself.
    """
    if any(setting.tolerance is not None for setting in curve):
        return None
    slopes = [
        math.log(a.error / b.error) / math.log(a.step / b.step)
        for a, b in pairwise(curve)
        if a.error and b.error and a.error < 1e-2 * scale and b.error > 1e-12 * scale
    ]
    return sorted(slopes)[len(slopes) // 2] if slopes else None


def seconds_to(curve: Sequence[Setting], error: float) -> float | None:
    """The time at which a curve first gets below an error, interpolated between its points; None if it never does."""
    for a, b in pairwise(curve):
        if a.error and b.error and a.best and b.best and a.error > error >= b.error:
            share = math.log(a.error / error) / math.log(a.error / b.error)
            return float(a.best * (b.best / a.best) ** share)
    return curve[0].best if curve and curve[0].error is not None and curve[0].error <= error else None


def reached_at_once(measured: Precision) -> dict[str, list[str]]:
    """For each error the methods whose coarsest setting is better already: their time is at most what is told."""
    drawn = curves(measured)
    return {
        f"{target:g}": [
            label for label, curve in drawn.items() if curve and (curve[0].error or np.inf) <= target * measured.scale
        ]
        for target in TARGETS
    }


def times_to_errors(measured: Precision) -> dict[str, dict[str, float | None]]:
    """For each error, relative to the size of the motion, the seconds of each method."""
    drawn = curves(measured)
    return {
        f"{target:g}": {label: seconds_to(curve, target * measured.scale) for label, curve in drawn.items()}
        for target in TARGETS
    }


def conclusion(measured: Precision) -> str:
    """Who reaches which error first, and where the variational method loses."""
    methods = {setting.requested.label: setting.requested.method for setting in measured.settings}
    firsts: dict[str, list[str]] = {}
    lost, won = [], []
    at_most = reached_at_once(measured)
    for key, times in times_to_errors(measured).items():
        target = key.replace("e-0", "e-")
        known = {label: seconds for label, seconds in times.items() if seconds is not None}
        if not known:
            continue
        first = min(known, key=known.__getitem__)
        sign = "at most " if first in at_most[key] else ""
        firsts.setdefault(first, []).append(f"{target} in {sign}{_time(known[first])}")
        own = {label: seconds for label, seconds in known.items() if methods[label] == "variational"}
        if own and methods[first] != "variational":
            nearest = min(own, key=own.__getitem__)
            sign = "at most " if nearest in at_most[key] else "at least " if first in at_most[key] else ""
            lost.append(f"{sign}{own[nearest] / known[first]:.2g} times that at {target}")
        elif own and len(known) > len(own):
            won.append(target)
        elif not own and "variational" in methods.values():
            lost.append(f"without end at {target}, which it does not reach")
    if not firsts:
        return "No method reached a relative error of 1e-2 with these steps: take smaller ones."
    text = " ".join(f"{label} is first at a relative error of {', '.join(cases)}." for label, cases in firsts.items())
    if lost:
        text += f" At equal trajectory error the variational method loses: its time is {', '.join(lost)}."
    if won:
        text += f" The variational method wins at {', '.join(won)}."
    if methods and set(methods.values()) & GEOMETRIC:
        text += " What a long run does to energy, constraints and the shape of the orbit this comparison does not show."
    return text


def _time(seconds: float) -> str:
    return f"{1e6 * seconds:.3g} \N{MICRO SIGN}s" if seconds < 1e-3 else f"{1e3 * seconds:.3g} ms"
