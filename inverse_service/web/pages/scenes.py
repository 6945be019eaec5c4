"""The form of a scene: what is filled in for a system, and the Scene document of what was sent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from inverse_service.errors import InputError
from inverse_service.web.pages.forms import Form

METHODS = (
    ("variational", "Variational", "discrete Euler-Lagrange equations of a free Lagrangian", True),
    ("nonholonomic", "Nonholonomic", "discrete constraint forces, the constraint holds exactly", True),
    ("modified", "Modified", "variational in the base, discrete constraints for the rest", True),
    ("runge-kutta", "Runge-Kutta", "order 4, for comparison", False),
    ("reference", "Reference", "to high accuracy, step by step", False),
    ("exact", "Exact", "the formula, where there is one", False),
)
OBSERVABLES = (
    ("trajectory", "Trajectory", "the motion itself"),
    ("energy", "Energy", "its error"),
    ("constraints", "Constraints", "how well they hold"),
    ("error", "Error", "against the true motion"),
    ("matching_circle", "Matching circle", "radius and drift of the centre"),
)
TICKED_METHODS = ("variational", "nonholonomic", "exact")
TICKED_OBSERVABLES = ("trajectory", "energy", "constraints")
PLANE = ("x", "y")


@dataclass(frozen=True, slots=True)
class SceneForm:
    """Everything that the form shows, as texts; `system` names a catalogue entry, `job` a result."""

    system: str = ""
    job: str = ""
    title: str = ""
    coordinates: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    functions: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    positions: Mapping[str, str] = field(default_factory=dict)
    velocities: Mapping[str, str] = field(default_factory=dict)
    step: str = "0.05"
    steps: str = "600"
    methods: tuple[str, ...] = TICKED_METHODS
    alphas: Mapping[str, str] = field(default_factory=dict)
    observe: tuple[str, ...] = TICKED_OBSERVABLES


def scene_form(document: Mapping[str, Any], title: str, system: str = "", job: str = "") -> SceneForm:
    """The form for a system, filled so that it can be run as it is.

    The velocities beyond the first two are left to the constraints, or zero where there are none.
    """
    coordinates = tuple(document["coordinates"])
    has_constraints = bool(document.get("constraints"))
    given = document.get("parameters") or []
    parameters = given if isinstance(given, dict) else dict.fromkeys(given)
    functions = {name: tuple(arguments) for name, arguments in (document.get("functions") or {}).items()}
    has_plane = set(PLANE) <= set(coordinates) and "z" not in coordinates
    return SceneForm(
        system,
        job,
        title,
        coordinates,
        {name: str(value or "1") for name, value in parameters.items()},
        {name: (f"{name}({', '.join(of)})", f"1 + {of[0]}^2/4") for name, of in functions.items()},
        {name: "0.1" if place == 0 else "0" for place, name in enumerate(coordinates)},
        {name: "1" if k < 2 else ("" if has_constraints else "0") for k, name in enumerate(coordinates)},
        methods=TICKED_METHODS if has_constraints else ("variational", "reference"),
        observe=(*TICKED_OBSERVABLES, *(("matching_circle",) if has_plane and has_constraints else ()))
        if has_constraints
        else ("trajectory", "energy"),
    )


def with_sent(form: SceneForm, sent: Form) -> SceneForm:
    """The form with what was sent in it."""

    def texts(prefix: str, names: Mapping[str, Any]) -> dict[str, str]:
        return {name: sent.text(f"{prefix}.{name}") for name in names}

    return SceneForm(
        form.system,
        form.job,
        form.title,
        form.coordinates,
        texts("parameter", form.parameters),
        {name: (label, sent.text(f"function.{name}")) for name, (label, _) in form.functions.items()},
        texts("position", form.positions),
        texts("velocity", form.velocities),
        sent.text("step"),
        sent.text("steps"),
        tuple(name for name, *_ in METHODS if name in sent.every("method")),
        {name: sent.text(f"alpha.{name}") for name, _, _, takes_alpha in METHODS if takes_alpha},
        tuple(name for name, *_ in OBSERVABLES if name in sent.every("observe")),
    )


def scene_document(form: SceneForm, system: Mapping[str, Any] | None) -> dict[str, Any]:
    """The Scene document, of `system` or of the form's catalogue entry; InputError where nothing is ticked."""
    if not form.methods:
        raise InputError("Tick at least one method.", "/methods")
    if not form.steps.isdigit() or len(form.steps) > 12:
        raise InputError("The number of steps must be a whole number.", "/steps")
    scene: dict[str, Any] = {
        "name": form.title,
        "system": {"catalogue": form.system} if system is None else dict(system),
        "parameters": dict(form.parameters),
        "initial": {"positions": _filled(form.positions), "velocities": _filled(form.velocities)},
        "step": form.step,
        "steps": int(form.steps),
        "methods": [_method(name, form.alphas) for name in form.methods],
        "observe": list(form.observe),
    }
    if form.functions:
        scene["functions"] = {name: text for name, (_, text) in form.functions.items()}
    return scene


def _method(name: str, alphas: Mapping[str, str]) -> dict[str, Any]:
    alpha = alphas.get(name, "")
    return {"method": name, "alpha": alpha} if alpha else {"method": name}


def _filled(values: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in values.items() if value}


def form_of_scene(form: SceneForm, scene: Mapping[str, Any]) -> SceneForm:
    """The form filled with a scene that was run before."""
    initial = scene.get("initial", {})
    methods = [entry if isinstance(entry, dict) else {"method": entry} for entry in scene.get("methods", [])]
    alphas = {entry["method"]: str(entry["alpha"]) for entry in methods if entry.get("alpha") is not None}
    positions, velocities = initial.get("positions", {}), initial.get("velocities") or {}
    functions = scene.get("functions", {})
    return SceneForm(
        form.system,
        form.job,
        form.title,
        form.coordinates,
        {name: str(scene.get("parameters", {}).get(name, value)) for name, value in form.parameters.items()},
        {name: (label, str(functions.get(name, text))) for name, (label, text) in form.functions.items()},
        {name: str(positions.get(name, "")) for name in form.coordinates},
        {name: str(velocities.get(name, "")) for name in form.coordinates},
        str(scene.get("step", form.step)),
        str(scene.get("steps", form.steps)),
        tuple(dict.fromkeys(str(entry["method"]) for entry in methods)),
        alphas,
        tuple(scene.get("observe", form.observe)),
    )
