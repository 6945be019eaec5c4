"""Error against time as it runs inside a worker process: scene document in, result document out."""

import dataclasses
import platform
import sys
import time
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from api_schemas.scene import SceneDocument, SceneMethod
from inverse_service import __version__, errors, settings
from inverse_service.integrators import method_table
from inverse_service.mechanics import euler_lagrange
from inverse_service.service.scenes import scene_lagrangian, scene_reading, simulating, views
from inverse_service.simulation import (
    accuracy,
    advice as advising,
    derivation,
    precision,
    scene_data,
)
from inverse_service.simulation.sentences import say

FORMAT = "inverse-service/work-precision/1"
FEWEST_STEPS = 8
MEASURED = (
    "median_seconds",
    "first_seconds",
    "compile_seconds",
    "repeats",
    "newton_iterations",
    "at_floor",
    "reason",
)
PACKAGES = ("numpy", "llvmlite", "symengine", "heyoka", "scipy")


@np.errstate(all="ignore")
def work_precision(
    document: Any, progress: scene_data.Progress | None = None, time_limit: float = 60.0
) -> dict[str, Any]:
    """The work-precision document of a scene. Raises InputError for a scene that cannot be
    accepted.
    """
    begun = time.monotonic()
    schema = scene_reading.scene_schema(document)
    steps = _steps(schema)
    with scene_reading.as_typed(document):
        scene, system = scene_reading.read_scene(schema)
    find = scene_lagrangian.finder(schema, system)
    if not schema.methods:
        schema = schema.model_copy(update={"methods": _suitable(derivation.Derived(scene, find))})
        scene = dataclasses.replace(scene, methods=scene_reading.read_methods(schema))
    # Errors are always compared, even if the scene does not observe them, so the true motion is
    # always derived.
    named = {requested.method for requested in scene.methods}
    # heyoka and the integrators of SciPy if they are installed and the scene does not name them.
    peers = [("heyoka", "heyoka")] if "heyoka" not in named and _version("heyoka") else []
    peers += [
        (name, f"SciPy {shown}") for name, shown in method_table.SCIPY.items() if _version("scipy")
    ]
    others = (scene_data.Requested(label, scene_data.MethodChoice(name)) for name, label in peers)
    compared = dataclasses.replace(scene, observe=("error",), methods=(*scene.methods, *others))
    derived = derivation.Derived(compared, find)
    left = time_limit - (time.monotonic() - begun)
    try:
        measured = precision.measure(derived, steps, schema.repeats, left, progress, schema.long)
    except scene_data.Unavailable as error:
        raise errors.InputError(
            f"the errors of this scene cannot be measured: {error.detail}", "/system"
        ) from None
    advice = advising.advice(derivation.with_energy(derived).scene, derived)
    return simulating.as_plain(_document(measured, advice))


def _suitable(derived: derivation.Derived) -> list[SceneMethod]:
    """The methods that are measured if the scene names none."""
    scene = derived.scene
    chosen: list[dict[str, Any]] = [{"method": "adaptive"}, {"method": "reference"}]
    chosen += [{"method": "runge-kutta", "order": order} for order in (4, 8)]
    if scene.lagrangian is not None:
        separable = (
            euler_lagrange.is_separable(scene.lagrangian, scene.coordinates) and not scene.forces
        )
        own = (
            "nonholonomic"
            if scene.constraints
            else "stormer-verlet"
            if separable
            else "variational"
        )
        chosen += [{"method": own, "order": order} for order in (2, 4, 8)]
    if advising.is_stiff(derived):
        chosen.append({"method": "stiff"})
    return [SceneMethod.model_validate(one) for one in chosen]


def _steps(schema: SceneDocument) -> tuple[float, ...]:
    sizes, least = schema.step_sizes or (), scene_reading.POSITIVE
    if 0 < len(sizes) < FEWEST_STEPS:
        raise scene_reading.refusal("few_sizes", "/step_sizes", least=FEWEST_STEPS)
    return tuple(
        scene_reading.number_of(text, f"/step_sizes/{k}", "step_size", least)
        for k, text in enumerate(sizes)
    )


def _document(measured: precision.Precision, taken: dict[str, Any] | None) -> dict[str, Any]:
    drawn = precision.curves(measured)
    named = {setting.requested.label: setting.requested for setting in measured.settings}
    targets = target_errors(measured, named)
    # Only methods that were run here are recommended.
    run = {requested.method for requested in named.values()} | {"stormer-verlet"}
    advice = (
        taken
        if taken is not None and taken["method"].replace("-", "_") in run | {"stormer_verlet"}
        else None
    )
    return {
        "format": FORMAT,
        "name": measured.scene.name,
        "time": measured.scene.grid.step * measured.scene.grid.steps,
        "scale": measured.scale,
        "error": "greatest distance of a coordinate from the true motion at 8 common times; relative is over scale",
        "truth": {"against": measured.truth.against, "uncertainty": measured.truth.uncertainty},
        "targets": targets,
        "sentences": [*views.price_sentences(targets), long_run(measured)],
        "advice": advice,
        "methods": [
            {
                "label": label,
                "method": requested.method.replace("_", "-"),
                "family": method_table.METHODS[requested.method].family,
                "order": accuracy.order_of(requested),
                "measured_order": precision.measured_order(drawn[label], measured.scale),
            }
            for label, requested in named.items()
        ],
        "runs": [_run(s, measured.scale) for s in measured.settings],
        "long": [
            {
                name: value
                for name, value in _run(one.setting, 1.0).items()
                if name in ("method", "step", "tolerance")
            }
            | {
                field.name: getattr(one, field.name)
                for field in dataclasses.fields(one)
                if field.name != "setting"
            }
            for one in measured.long
        ],
        "machine": machine(),
        "provenance": {"program": "inverse-service", "version": __version__},
    }


def target_errors(
    measured: precision.Precision, named: dict[str, scene_data.Requested]
) -> list[dict[str, Any]]:
    """The cost of each relative error, cheapest method first; methods that miss it come last,
    without numbers.
    """
    found, own = [], precision.by_method(measured.settings)
    for target, reached in precision.prices(measured).items():
        best = next(iter(reached.values())).seconds if reached else None
        rows = []
        for label in [*reached, *(label for label in named if label not in reached)]:
            price = reached.get(label)
            numbers = {} if price is None else dataclasses.asdict(price)
            blank = dict.fromkeys(("seconds", "step", "tolerance", "evaluations", "at_most"))
            ratio = None if price is None or not best else price.seconds / best
            what = {"method": label, "order": accuracy.order_of(named[label])}
            too_slow = price is None and own[label][-1].reason in (precision.CUT, precision.LATE)
            rows.append(what | blank | numbers | {"ratio": ratio, "too_slow": too_slow})
        found.append({"error": target, "rows": rows})
    return found


def _run(setting: precision.Setting, scale: float) -> dict[str, Any]:
    """A run with all that was measured; the step is given only if the method uses it."""
    named = {"method": setting.requested.label, "order": accuracy.order_of(setting.requested)}
    steps = (setting.step, setting.steps) if setting.tolerance is None else (None, None)
    numbers = {"step": steps[0], "steps": steps[1], "tolerance": setting.tolerance}
    numbers["error"] = None if setting.error is None else setting.error / scale
    numbers |= {"seconds": setting.best_seconds, "evaluations": setting.force_evaluations}
    return named | numbers | {name: getattr(setting, name) for name in MEASURED}


def machine() -> dict[str, Any]:
    """The processor, the cores and the versions with which the times were measured."""
    names = list[str]()
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": next(iter(names), "") or platform.processor() or "unknown",
        "cores": settings.cores(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": sys.version.split()[0],
        **{name: found for name in PACKAGES if (found := _version(name)) is not None},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def long_run(measured: precision.Precision) -> str:
    """Say which method preserves the energy, or the shape of the orbit, best over a long time."""
    done = [run for run in measured.long if not run.reason]
    if not done:
        return (
            say("long_runs")
            if not measured.long
            else "No method completed a run of a hundred times the time."
        )
    key = "energy_drift" if any(run.energy_drift is not None for run in done) else "shape_change"
    what = {"energy_drift": "the energy drifts", "shape_change": "the shape changes"}[key]
    known = [(getattr(run, key), run) for run in done if getattr(run, key) is not None]
    (least, best), (most, worst) = (pick(known, key=lambda pair: pair[0]) for pick in (min, max))
    text = f"Over {precision.LONG} times the time {what} least by {best.setting.requested.label}: {least:.1e} in "
    text += views.duration(best.seconds or 0.0)
    return (
        f"{text}, and most by {worst.setting.requested.label}: {most:.1e}."
        if worst is not best
        else f"{text}."
    )
