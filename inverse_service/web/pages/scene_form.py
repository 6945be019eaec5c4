"""The form of a scene as data: filled for a system, a scene, or with what was sent; the Scene document of a form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from markupsafe import Markup

from inverse_service import errors
from inverse_service.web.pages import typesetting, words
from inverse_service.web.pages.forms import Form

METHODS: list[tuple[str, str, str, bool]] = words.TABLES["methods"]
OBSERVABLES: list[tuple[str, str, str]] = words.TABLES["observables"]
EFFECTS: list[tuple[str, str]] = words.TABLES["effects"]
TICKED_METHODS = ("variational", "nonholonomic", "exact")
TICKED_OBSERVABLES = ("trajectory", "energy", "constraints")
# Of use with constraints only.
OF_CONSTRAINTS = ("nonholonomic", "modified", "constraints")
PLANE = ("x", "y")


@dataclass(frozen=True, slots=True)
class SceneForm:
    """Everything that the form shows, as texts.

    `system` names a catalogue entry, `job` a result, `scene` a scene that was run before: the form is about one of
    them. `further` are methods of that scene that the form has no fields for, with those that stay ticked first.
    """

    system: str = ""
    job: str = ""
    scene: str = ""
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
    further: tuple[Mapping[str, Any], ...] = ()
    kept: tuple[int, ...] = ()
    # Parts of L that may be left out, with what they are; `effects` are those that act. Empty without a Lagrangian.
    parts: tuple[tuple[str, str], ...] = ()
    effects: tuple[str, ...] = ()
    # L and the constraints, or the equations, typeset.
    formulas: tuple[Markup, ...] = ()

    def offers(self, name: str) -> bool:
        """Whether a method or an observed quantity can mean something here; what is ticked is shown in any case."""
        is_constrained = "constraints" in dict(self.parts)
        return is_constrained or name not in OF_CONSTRAINTS or name in (*self.methods, *self.observe)


def form_for(document: Mapping[str, Any], title: str, system: str = "", job: str = "", scene: str = "") -> SceneForm:
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
        scene,
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
        parts=parts_of(document),
        effects=tuple(name for name, _ in parts_of(document)),
        formulas=typesetting.formulas_of(document),
    )


def parts_of(document: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """The effects that a system can have."""
    if "lagrangian" not in document:
        return ()
    return tuple(effect for effect in EFFECTS if effect[0] != "constraints" or document.get("constraints"))


def with_sent(form: SceneForm, sent: Form) -> SceneForm:
    """The form with the values that were sent."""

    def texts(prefix: str, names: Mapping[str, Any]) -> dict[str, str]:
        return {name: sent.text(f"{prefix}.{name}") for name in names}

    return replace(
        form,
        parameters=texts("parameter", form.parameters),
        functions={name: (label, sent.text(f"function.{name}")) for name, (label, _) in form.functions.items()},
        positions=texts("position", form.positions),
        velocities=texts("velocity", form.velocities),
        step=sent.text("step"),
        steps=sent.text("steps"),
        methods=tuple(name for name, *_ in METHODS if name in sent.every("method")),
        alphas={name: sent.text(f"alpha.{name}") for name, _, _, takes_alpha in METHODS if takes_alpha},
        observe=tuple(name for name, *_ in OBSERVABLES if name in sent.every("observe")),
        kept=tuple(k for k in range(len(form.further)) if str(k) in sent.every("further")),
        effects=tuple(name for name, _ in form.parts if name in sent.every("effect")),
    )


def scene_document(form: SceneForm, system: Mapping[str, Any]) -> dict[str, Any]:
    """The Scene document of a system; InputError if nothing is ticked."""
    if not form.methods and not form.kept:
        raise errors.InputError("Tick at least one method.", "/methods")
    if not form.steps.isdigit() or len(form.steps) > 12:
        raise errors.InputError("The number of steps must be a positive integer.", "/steps")
    scene: dict[str, Any] = {
        "system": dict(system),
        "parameters": dict(form.parameters),
        "initial": {"positions": _filled(form.positions), "velocities": _filled(form.velocities)},
        "step": form.step,
        "steps": int(form.steps),
        "methods": [*(_method(name, form.alphas) for name in form.methods), *(form.further[k] for k in form.kept)],
        "observe": list(form.observe),
    }
    if form.title:
        scene["name"] = form.title
    if len(form.effects) < len(form.parts):
        scene["effects"] = list(form.effects)
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
    fitting = _fitting(methods)
    further = tuple(entry for entry in methods if entry not in fitting.values())
    positions, velocities = initial.get("positions", {}), initial.get("velocities") or {}
    functions, values = scene.get("functions", {}), scene.get("parameters") or {}
    parts = (*form.parts, *((name, "a term of the scene") for name in scene.get("terms") or {})) if form.parts else ()
    return replace(
        form,
        title=scene.get("name") or form.title,
        parameters={name: str(values.get(name, value)) for name, value in form.parameters.items()},
        functions={name: (label, str(functions.get(name, text))) for name, (label, text) in form.functions.items()},
        positions={name: str(positions.get(name, "")) for name in form.coordinates},
        velocities={name: str(velocities.get(name, "")) for name in form.coordinates},
        step=str(scene.get("step", form.step)),
        steps=_steps(scene, form.steps),
        methods=tuple(fitting),
        alphas={name: str(entry["alpha"]) for name, entry in fitting.items() if entry.get("alpha") is not None},
        observe=tuple(scene.get("observe", form.observe)),
        further=further,
        kept=tuple(range(len(further))),
        parts=parts,
        effects=tuple(name for name, _ in parts if name in scene.get("effects", dict(parts))),
    )


def changed_scene(base: Mapping[str, Any], scene: Mapping[str, Any]) -> dict[str, Any]:
    """A scene that was run before with what the form says; what the form does not show stays."""
    kept = {key: value for key, value in base.items() if key not in ("time", "steps", "effects")}
    initial = dict(scene["initial"])
    before = base.get("initial") or {}
    if before.get("project"):
        initial["project"] = True
    if before.get("momenta") and not initial["velocities"]:
        initial = {key: value for key, value in initial.items() if key != "velocities"} | {"momenta": before["momenta"]}
    return kept | dict(scene) | {"initial": initial}


def _fitting(methods: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """The methods that the form has a line for: the first of each name, with no settings but alpha."""
    names, found = {name for name, *_ in METHODS}, {}
    for entry in methods:
        name = str(entry["method"])
        if name in names and name not in found and set(entry) <= {"method", "alpha"}:
            found[name] = entry
    return found


def _steps(scene: Mapping[str, Any], otherwise: str) -> str:
    """The number of steps, computed from the length of time if the scene gives that."""
    if scene.get("steps") is not None or scene.get("time") is None:
        return str(scene.get("steps") or otherwise)
    try:
        return str(max(1, round(Fraction(str(scene["time"])) / Fraction(str(scene["step"])))))
    except (ValueError, ZeroDivisionError, KeyError):
        return otherwise
