"""Error against time as it runs inside a worker process: scene document in, result document out."""

from __future__ import annotations

import dataclasses
import math
import os
import platform
import sys
import time
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from api_schemas.scene import SceneDocument
from inverse_service import __version__
from inverse_service.errors import InputError
from inverse_service.integrators.methods import SCIPY
from inverse_service.service.scenes.scene_lagrangian import finder
from inverse_service.service.scenes.scene_methods import number_of
from inverse_service.service.scenes.scene_reading import read_scene
from inverse_service.service.scenes.scene_refusals import scene_schema
from inverse_service.service.scenes.simulating import advice_of, as_plain, catalogue_name
from inverse_service.simulation.advice import sentence_of
from inverse_service.simulation.derivation import derive
from inverse_service.simulation.precision import Precision, Setting, default_steps, measure
from inverse_service.simulation.scene_data import MethodChoice, Progress, Requested, Scene, Unavailable

FORMAT = "inverse-service/work-precision/1"
FEWEST_STEPS = 8
PACKAGES = ("numpy", "llvmlite", "symengine", "heyoka", "scipy")


@np.errstate(all="ignore")
def work_precision(document: Any, progress: Progress | None = None, time_limit: float = 60.0) -> dict[str, Any]:
    """The work-precision document of a scene. Raises InputError for a scene that cannot be accepted."""
    begun = time.monotonic()
    schema = scene_schema(document)
    steps = _steps(schema)
    scene, system = read_scene(schema)
    # Errors are always compared, whatever the scene observes, so the true motion is always derived.
    compared = dataclasses.replace(scene, observe=("error",), methods=(*scene.methods, *_peers(scene)))
    derived = derive(compared, finder(schema, system, catalogue_name(schema)))
    left = time_limit - (time.monotonic() - begun)
    measured = measure(
        compared, derived, steps or default_steps(scene.grid.step), schema.repeats, left, progress, not steps
    )
    if isinstance(measured, Unavailable):
        raise InputError(f"the errors of this scene cannot be measured: {measured.reason}", "/system")
    plain: dict[str, Any] = as_plain(_document(measured, advice_of(scene, derived)))
    return plain


def _peers(scene: Scene) -> list[Requested]:
    """heyoka and SciPy's integrators where they are installed and the scene does not name them."""
    named = {requested.method for requested in scene.methods}
    found = [] if "heyoka" in named or _version("heyoka") is None else [("heyoka", "heyoka")]
    found += [(name, f"SciPy {shown}") for name, shown in SCIPY.items() if _version("scipy") is not None]
    return [Requested(label, name, None, MethodChoice(name)) for name, label in found]


def _steps(schema: SceneDocument) -> tuple[float, ...]:
    if schema.step_sizes is None:
        return ()
    if len(schema.step_sizes) < FEWEST_STEPS:
        raise InputError(f"give at least {FEWEST_STEPS} step sizes, or none for the usual ten.", "/step_sizes")
    found = tuple(number_of(text, f"/step_sizes/{k}") for k, text in enumerate(schema.step_sizes))
    for k, step in enumerate(found):
        if step <= 0:
            raise InputError("a step size must be a positive number.", f"/step_sizes/{k}")
    return found


def _document(measured: Precision, taken: dict[str, Any] | None) -> dict[str, Any]:
    drawn = curves(measured)
    labels = list(drawn)
    return {
        "format": FORMAT,
        "name": measured.scene.name,
        "time": measured.scene.grid.step * measured.scene.grid.steps,
        "scale": measured.scale,
        "error": "greatest distance of a coordinate from the true motion at 8 common times; relative is over scale",
        "truth": {"against": measured.truth.against, "uncertainty": measured.truth.uncertainty},
        "conclusion": f"{conclusion(measured)} {sentence_of(taken)}",
        "advice": taken,
        "methods": [
            {
                "label": label,
                "method": _first(measured, label).requested.method.replace("_", "-"),
                "measured_order": measured_order(drawn[label], measured.scale),
                "settings": [_setting(s, measured.scale) for s in measured.settings if s.requested.label == label],
            }
            for label in labels
        ],
        "failed": [
            {"label": s.requested.label, "step": s.step, "tolerance": s.tolerance, "reason": s.reason}
            for s in measured.settings
            if s.reason
        ],
        "seconds_to_error": times_to_errors(measured),
        "at_most": reached_at_once(measured),
        "machine": machine(),
        "provenance": {"program": "inverse-service", "version": __version__},
    }


def _first(measured: Precision, label: str) -> Setting:
    return next(setting for setting in measured.settings if setting.requested.label == label)


def _setting(setting: Setting, scale: float) -> dict[str, Any]:
    return {
        "step": setting.step if setting.tolerance is None else None,
        "steps": setting.steps if setting.tolerance is None else None,
        "tolerance": setting.tolerance,
        "error": setting.error,
        "relative_error": None if setting.error is None else setting.error / scale,
        "compile_seconds": setting.compile,
        "first_seconds": setting.first,
        "best_seconds": setting.best,
        "median_seconds": setting.median,
        "repeats": setting.repeats,
        "force_evaluations": setting.force_evaluations,
        "newton_iterations": setting.newton_iterations,
        "at_floor": setting.at_floor,
        "reason": setting.reason,
        **{f"{name}_error": setting.further.get(f"{name}_error") for name in ("velocity", "energy", "constraint")},
    }


def machine() -> dict[str, Any]:
    """Processor, cores and versions that the times belong to."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": sys.version.split()[0],
        **{name: found for name in PACKAGES if (found := _version(name)) is not None},
    }


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.processor() or "unknown"
    lines = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return lines[0] if lines else platform.processor() or "unknown"


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
MISSED = " The variational method does not reach {} with these steps."
UNDECIDED = " At {} no method is first for certain: some are better than that at their coarsest setting already."
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
    """For each error the methods whose coarsest setting is better already: their time is at most what is reported."""
    drawn = curves(measured)
    coarsest = {label: _first(measured, label) for label in drawn}  # where it failed a longer step is not faster
    return {
        f"{target:g}": [
            label
            for label, curve in drawn.items()
            if curve and curve[0] is coarsest[label] and (curve[0].error or np.inf) <= target * measured.scale
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
    """Who reaches which error first, and where the variational method loses.

    A method that is better at its coarsest setting is as fast as that at least: where one might be faster than the
    first, no order is told.
    """
    methods = {setting.requested.label: setting.requested.method for setting in measured.settings}
    firsts: dict[str, list[str]] = {}
    lost, won, missed, undecided = [], [], [], []
    at_most = reached_at_once(measured)
    for key, times in times_to_errors(measured).items():
        target = key.replace("e-0", "e-")
        known = {label: seconds for label, seconds in times.items() if seconds is not None}
        if not known:
            continue
        first = min(known, key=known.__getitem__)
        unsure = set(at_most[key]) - {first}
        if unsure:
            undecided.append(target)
        else:
            sign = "at most " if first in at_most[key] else ""
            firsts.setdefault(first, []).append(f"{target} in {sign}{_time(known[first])}")
        own = {label: seconds for label, seconds in known.items() if methods[label] == "variational"}
        if own and methods[first] != "variational" and not unsure & set(own):
            sign = "at least " if first in at_most[key] else ""
            lost.append(f"{sign}{min(own.values()) / known[first]:.2g} times that at {target}")
        elif own and methods[first] == "variational" and unsure <= set(own) and len(known) > len(own):
            won.append(target)
        elif not own and "variational" in methods.values():
            missed.append(target)
    if not firsts and not undecided:
        return "No method reached a relative error of 1e-2 with these steps: take smaller ones."
    text = "".join(f" {label} is first at a relative error of {', '.join(cases)}." for label, cases in firsts.items())
    if undecided:
        text += UNDECIDED.format(", ".join(undecided))
    if lost:
        text += f" At equal trajectory error the variational method loses: its time is {', '.join(lost)}."
    if missed:
        text += (
            f" It does not reach {', '.join(missed)} with these steps." if lost else MISSED.format(", ".join(missed))
        )
    if won:
        text += f" The variational method wins at {', '.join(won)}."
    if methods and set(methods.values()) & GEOMETRIC:
        text += " What a long run does to energy, constraints and the shape of the orbit this comparison does not show."
    return text.strip()


def _time(seconds: float) -> str:
    return f"{1e6 * seconds:.3g} \N{MICRO SIGN}s" if seconds < 1e-3 else f"{1e3 * seconds:.3g} ms"
