"""The page of a scene: its form for a system, a result, or a scene that was run before, and its way to a result."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import chain, combinations, islice, product
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from inverse_service import catalogue, errors
from inverse_service.deadline import now
from inverse_service.reading import declarations, names as nm, reader
from inverse_service.service.documents import accepting, stated
from inverse_service.web.pages import (
    WORDS,
    chains,
    forms,
    library,
    preview,
    rendering,
    result_tasks,
    results,
    solve,
)
from inverse_service.web.pages.typesetting import formulas_of
from inverse_service.web.problems import REFUSED, Refusal, known, refusal_of

router = APIRouter()
METHODS: list[tuple[str, str, str, bool]] = WORDS["methods"]
OBSERVABLES: list[tuple[str, str, str]] = WORDS["observables"]
Observed = str | Mapping[str, Any]  # a quantity, or formulas by name
Offered = tuple[Observed, str, str]  # with its label and what it is
EFFECTS: list[tuple[str, str]] = WORDS["effects"]
TICKED_METHODS = ("variational", "nonholonomic", "exact")
TICKED_OBSERVABLES = ("trajectory", "energy", "constraints")
# Of use with constraints only, and without them.
OF_CONSTRAINTS = ("nonholonomic", "modified", "constraints")
OF_FREE = ("stormer-verlet",)
CONTACT = ("gap", "restitution", "friction", "slides")
MOST_CONTACTS = 4  # that the form has fields for
MOST_RUNS = 200  # of an ensemble of the form, all of which the page lists
MANY = 8  # coordinates from which on the boxes of the start are folded
PLANE = ("x", "y")
CONSTRAINED = (
    "name",
    "time",
    "coordinates",
    "lagrangian",
    "where",
    "constraints",
    "parameters",
    "functions",
)
FIRST_SYSTEM = "vertically-rolling-disk"
WITHOUT_LAGRANGIAN = ("runge-kutta", "reference")
# What a price is compared with, besides the methods that are ticked.
COMPARED: tuple[dict[str, Any], ...] = (
    {"method": "adaptive"}, {"method": "runge-kutta"}, {"method": "runge-kutta", "order": 8}, {"method": "reference"},
)  # fmt: skip
ADDRESS = ("system", "job", "scene", "given")  # what a form may be about
# What a scene raises that the form does not show, or that is none.
NO_FORM = (AttributeError, IndexError, KeyError, RecursionError, TypeError, ValueError)
SCENES = ("simulate", "work-precision")  # the kinds of jobs that have one
SHARE = 0.8  # of the steps that a motion lasts
LONGEST_TRIAL = 3.0  # s
MOST_CHOICES = 100  # of velocities that are given
# Where a document says it, and the field of the form that is about it.
FIELDS = (
    ("/parameters/", "parameter."),
    ("/functions/", "function."),
    ("/initial/positions/", "position."),
    ("/initial/velocities/", "velocity."),
)


# The form as data, and the Scene document that it is.


@dataclass(frozen=True, slots=True)
class SceneForm:
    """Everything that the form shows, as texts.

    `system` names a catalogue entry, `job` a result, `scene` a scene that was run before, `given`
    is one in a link: the form is about one of them. `further` are methods of that scene that the
    form has no fields for, with those that stay ticked first.
    """

    system: str = ""
    job: str = ""
    scene: str = ""
    given: str = ""
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
    form: str = ""  # of the variational method: "raw" for that of L
    constants: str = ""  # free ones of the Lagrangian, as "C_x = 1/100, C_y = 1"
    start_time: str = ""
    contacts: tuple[Mapping[str, str], ...] = ()
    contact_names: tuple[str, ...] = ()  # of a scene that was run before
    observe: tuple[Observed, ...] = TICKED_OBSERVABLES
    further: tuple[Mapping[str, Any], ...] = ()
    kept: tuple[int, ...] = ()
    # Parts of L that may be left out, with what they are; `effects` are those that act. Empty
    # without a Lagrangian.
    parts: tuple[tuple[str, str], ...] = ()
    effects: tuple[str, ...] = ()
    # L and the constraints, or the equations, typeset.
    formulas: tuple[Markup, ...] = ()

    def offers(self, name: str) -> bool:
        """Whether a method or an observed quantity can mean something here; what is ticked is shown in any case."""
        if name in (*self.methods, *self.observe):
            return True
        is_constrained = "constraints" in dict(self.parts)
        return name not in (OF_FREE if is_constrained else OF_CONSTRAINTS)

    @property
    def observables(self) -> dict[str, Offered]:
        """What can be observed by the value that is sent for it, with its label and what it is:
        those that are always offered, and all others of the scene.
        """
        found: dict[str, Offered] = {
            name: (name, label, what) for name, label, what in OBSERVABLES if self.offers(name)
        }
        for one in self.observe:
            if isinstance(one, str):
                found.setdefault(one, (one, one.replace("_", " ").capitalize(), "as in the scene"))
            else:
                found[json.dumps(one)] = (one, ", ".join(one), "as in the scene")
        return found

    @property
    def can_touch(self) -> bool:
        """Whether contacts have the masses that they need: those of L, or of a single coordinate."""
        return bool(self.parts or self.contacts) or len(self.coordinates) == 1

    @property
    def contact_rows(self) -> tuple[Mapping[str, str], ...]:
        """The contacts, and an empty row for one more."""
        empty = dict.fromkeys(CONTACT, "")
        return (*self.contacts, empty)[:MOST_CONTACTS]

    @property
    def dials(self) -> int:
        """The rows of sliders below the picture, as the script makes them."""
        free = sum(map(bool, self.velocities.values())) if len(self.coordinates) > 1 else 0
        return preview.rows_of_sliders(len(self.parameters), free)


def form_for(document: Mapping[str, Any], title: str, **address: Any) -> SceneForm:
    """The form for a system, filled so that it can be run as it is.

    The velocities beyond the first two are left to the constraints, or zero where there are none.
    """
    coordinates = tuple(document["coordinates"])
    given = document.get("parameters") or []
    parameters = given if isinstance(given, dict) else dict.fromkeys(given)
    functions = {
        name: tuple(arguments) for name, arguments in (document.get("functions") or {}).items()
    }
    others = "0"  # velocities that are not determined by constraints
    methods: tuple[str, ...] = ("variational", "reference")
    observe: tuple[str, ...] = ("trajectory", "energy")
    if document.get("constraints"):
        has_plane = set(PLANE) <= set(coordinates) and "z" not in coordinates
        others, methods, observe = (
            "",
            TICKED_METHODS,
            (*TICKED_OBSERVABLES, *["matching_circle"] * has_plane),
        )
    return SceneForm(
        **address,
        title=title,
        coordinates=coordinates,
        parameters={name: str(value or "1") for name, value in parameters.items()},
        functions={
            name: (f"{name}({', '.join(of)})", f"1 + {of[0]}^2/4") for name, of in functions.items()
        },
        positions={name: "0" if place else "0.1" for place, name in enumerate(coordinates)},
        velocities={name: "1" if place < 2 else others for place, name in enumerate(coordinates)},
        methods=methods,
        observe=observe,
        parts=parts_of(document),
        effects=tuple(name for name, _ in parts_of(document)),
        formulas=formulas_of(document),
    )


def parts_of(document: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """The effects that a system can have."""
    if "lagrangian" not in document:
        return ()
    return tuple(
        effect for effect in EFFECTS if effect[0] != "constraints" or document.get("constraints")
    )


def with_sent(form: SceneForm, sent: forms.Form) -> SceneForm:
    """The form with the values that were sent."""

    def texts(prefix: str, names: Mapping[str, Any]) -> dict[str, str]:
        return {name: sent.text(f"{prefix}.{name}") for name in names}

    return replace(
        form,
        parameters=texts("parameter", form.parameters),
        functions={
            name: (label, sent.text(f"function.{name}"))
            for name, (label, _) in form.functions.items()
        },
        positions=texts("position", form.positions),
        velocities=texts("velocity", form.velocities),
        step=sent.text("step"),
        steps=sent.text("steps"),
        methods=tuple(name for name, *_ in METHODS if name in sent.every("method")),
        alphas={
            name: sent.text(f"alpha.{name}") for name, _, _, takes_alpha in METHODS if takes_alpha
        },
        form="raw" if sent.text("form") == "raw" else "",
        constants=sent.text("constants"),
        start_time=sent.text("start_time"),
        contacts=tuple(
            one
            for k in range(MOST_CONTACTS)
            if any((one := {name: sent.text(f"contact.{k}.{name}") for name in CONTACT}).values())
        ),
        observe=tuple(
            one for value, (one, *_) in form.observables.items() if value in sent.every("observe")
        ),
        kept=tuple(k for k in range(len(form.further)) if str(k) in sent.every("further")),
        effects=tuple(name for name, _ in form.parts if name in sent.every("effect")),
    )


def scene_document(form: SceneForm, system: Mapping[str, Any]) -> dict[str, Any]:
    """The Scene document of a system; errors.InputError if nothing is ticked."""
    if not form.methods and not form.kept:
        raise errors.InputError("Tick at least one method.", "/methods")
    if not form.steps.isdigit() or len(form.steps) > 12:
        raise errors.InputError("The number of steps must be a positive integer.", "/steps")
    scene: dict[str, Any] = {
        "system": dict(system),
        "parameters": _firsts(form.parameters),
        "initial": {"positions": _firsts(form.positions), "velocities": _firsts(form.velocities)},
        "step": form.step,
        "steps": int(form.steps),
        "methods": [
            *(_method(name, form) for name in form.methods),
            *(form.further[k] for k in form.kept),
        ],
        "observe": list(form.observe),
    }
    if form.title:
        scene["name"] = form.title
    if len(form.effects) < len(form.parts):
        scene["effects"] = list(form.effects)
    if form.functions:
        scene["functions"] = {name: text for name, (_, text) in form.functions.items()}
    if form.constants:
        scene["constants"] = _constants(form.constants)
    if form.start_time:
        scene["start_time"] = form.start_time
    if form.contacts:
        scene["contacts"] = [_contact(form, k) for k in range(len(form.contacts))]
    if ensemble := _ensemble(form):
        scene["ensemble"] = ensemble
    return scene


def _contact(form: SceneForm, place: int) -> dict[str, str]:
    """A contact of the scene; errors.InputError for one without a gap."""
    given = {name: text for name, text in form.contacts[place].items() if text}
    if "gap" not in given:
        detail = "A contact needs its gap, a formula that is positive above it, such as y."
        raise errors.InputError(detail, f"/contacts/{place}/gap")
    names = form.contact_names
    return {"name": names[place], **given} if place < len(names) else given


def _parts_of(text: str) -> list[str]:
    """The values of a box: one, or a list 1, 2, 3."""
    return [part for one in text.split(",") if (part := one.strip())]


def _firsts(values: Mapping[str, str]) -> dict[str, str]:
    """The first value of each box that is not empty."""
    return {name: parts[0] for name, text in values.items() if (parts := _parts_of(text))}


def _ensemble(form: SceneForm) -> dict[str, Any]:
    """All combinations of the lists in the boxes; empty without a list. errors.InputError for too many."""
    groups = (form.parameters, form.positions, form.velocities)
    parameters, positions, velocities = (
        {name: parts for name, text in group.items() if len(parts := _parts_of(text)) > 1}
        for group in groups
    )
    runs = math.prod(
        len(parts) for group in (parameters, positions, velocities) for parts in group.values()
    )
    if runs == 1:
        return {}
    if runs > MOST_RUNS:
        raise errors.InputError(
            f"The lists make {runs:,} runs; the form takes {MOST_RUNS}, a document more.",
            "/ensemble",
        )
    columns = list(zip(*product(*positions.values(), *velocities.values()), strict=True))
    found: dict[str, Any] = {"parameters": parameters} if parameters else {}
    if columns:
        of_positions = dict(zip(positions, map(list, columns), strict=False))
        of_velocities = dict(zip(velocities, map(list, columns[len(positions) :]), strict=True))
        found["initial"] = {"positions": of_positions, "velocities": of_velocities}
    return found


def _lists_of(scene: Mapping[str, Any]) -> dict[str, dict[str, str]] | None:
    """The lists of an ensemble as texts of the boxes; None where the form has none that would mean it."""
    ensemble = scene.get("ensemble") or {}
    columns = ensemble.get("initial") or {}
    if not isinstance(columns, Mapping):
        return None
    found = {
        kind: {name: list(map(str, column)) for name, column in (columns.get(kind) or {}).items()}
        for kind in ("positions", "velocities")
    }
    found["parameters"] = {
        name: list(map(str, column)) for name, column in (ensemble.get("parameters") or {}).items()
    }
    each = {
        kind: {name: list(dict.fromkeys(column)) for name, column in group.items()}
        for kind, group in found.items()
    }
    starts = [*found["positions"].values(), *found["velocities"].values()]
    unique = [*each["positions"].values(), *each["velocities"].values()]
    if starts and list(zip(*starts, strict=False)) != list(product(*unique)):
        return None
    return {
        kind: {name: ", ".join(parts) for name, parts in group.items()}
        for kind, group in each.items()
    }


def _method(name: str, form: SceneForm) -> dict[str, Any]:
    alpha = form.alphas.get(name, "")
    found = {"method": name, "alpha": alpha} if alpha else {"method": name}
    return found | {"form": form.form} if name == "variational" and form.form else found


def _constants(text: str) -> dict[str, str]:
    """Free constants with their values; InputError for one without."""
    found = declarations.parameters_of(text)
    open_one = next((name for name, value in found.items() if value is None), None)
    if open_one is not None:
        raise errors.InputError(f"{open_one} has no value. Write {open_one} = 1/100.", "/constants")
    return {name: str(value) for name, value in found.items()}


def form_of_scene(form: SceneForm, scene: Mapping[str, Any]) -> SceneForm:
    """The form filled with a scene that was run before."""
    initial = scene.get("initial", {})
    methods = [
        entry if isinstance(entry, dict) else {"method": entry}
        for entry in scene.get("methods", [])
    ]
    fitting = _fitting(methods)
    further = tuple(entry for entry in methods if entry not in fitting.values())
    positions, velocities = initial.get("positions", {}), initial.get("velocities") or {}
    functions, values = scene.get("functions", {}), scene.get("parameters") or {}
    lists = _lists_of(scene) or {"positions": {}, "velocities": {}, "parameters": {}}
    positions, velocities = (
        positions | lists["positions"],
        velocities | lists["velocities"],
    )
    values = values | lists["parameters"]
    contacts = _contacts_of(scene)
    parts = (
        (*form.parts, *((name, "a term of the scene") for name in scene.get("terms") or {}))
        if form.parts
        else ()
    )
    return replace(
        form,
        title=scene.get("name") or form.title,
        parameters={name: str(values.get(name, value)) for name, value in form.parameters.items()},
        functions={
            name: (label, str(functions.get(name, text)))
            for name, (label, text) in form.functions.items()
        },
        positions={name: str(positions.get(name, "")) for name in form.coordinates},
        velocities={name: str(velocities.get(name, "")) for name in form.coordinates},
        step=str(scene.get("step", form.step)),
        steps=_steps(scene, form.steps),
        methods=tuple(fitting),
        alphas={
            name: str(entry["alpha"])
            for name, entry in fitting.items()
            if entry.get("alpha") is not None
        },
        form=next((str(one["form"]) for one in fitting.values() if one.get("form") == "raw"), ""),
        constants=", ".join(
            f"{name} = {value}" for name, value in (scene.get("constants") or {}).items()
        ),
        start_time=str(scene.get("start_time") or ""),
        contacts=contacts,
        contact_names=tuple(
            str(one.get("name") or f"contact_{k}")
            for k, one in enumerate(scene.get("contacts") or (), 1)
        ),
        observe=tuple(scene.get("observe", form.observe)),
        further=further,
        kept=tuple(range(len(further))),
        parts=parts,
        effects=tuple(name for name, _ in parts if name in scene.get("effects", dict(parts))),
    )


def _contacts_of(scene: Mapping[str, Any]) -> tuple[Mapping[str, str], ...]:
    """The contacts of a scene for the form; none where it has no room for all."""
    given = scene.get("contacts") or ()
    if len(given) > MOST_CONTACTS:
        return ()
    return tuple({name: str(one.get(name) or "") for name in CONTACT} for one in given)


def changed_scene(base: Mapping[str, Any], scene: Mapping[str, Any]) -> dict[str, Any]:
    """A scene that was run before with what the form says; what the form does not show stays."""
    shown = ["time", "steps", "effects", "constants", "start_time"]
    shown += ["ensemble"] if _lists_of(base) is not None or "ensemble" in scene else []
    shown += ["contacts"] if _contacts_of(base) or "contacts" in scene else []
    kept = {key: value for key, value in base.items() if key not in shown}
    initial = dict(scene["initial"])
    before = base.get("initial") or {}
    if before.get("project"):
        initial["project"] = True
    if before.get("momenta") and not initial["velocities"]:
        initial = {key: value for key, value in initial.items() if key != "velocities"} | {
            "momenta": before["momenta"]
        }
    return kept | dict(scene) | {"initial": initial}


def _fitting(methods: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """The methods that the form has a line for: the first of each name, with no settings but alpha."""
    names, found = {name for name, *_ in METHODS}, {}
    for entry in methods:
        name = str(entry["method"])
        if (
            name in names
            and name not in found
            and set(entry) <= {"method", "alpha", *["form"] * (name == "variational")}
        ):
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


# A start from which a system can be run.


def with_good_start(
    form: SceneForm,
    system: Mapping[str, Any],
    answer: Mapping[str, Any],
    further: Mapping[str, Any] | None = None,
) -> SceneForm:
    """The form with the start that lasts longest, and as many steps as it lasts; `further` is part
    of its scene.

    On the way the conditions of the domain of the answer's Lagrangian hold, its Hessian stays
    regular, and no wall of the accelerations is passed. With constraints it is the first start from
    which all methods can begin.
    """
    from inverse_service.simulation.numeric_formulas import walls
    from inverse_service.web.pages import starts

    domain = (answer.get("lagrangian") or {}).get("domain", ())
    form = _with_velocities_that_fit(form, system)
    try:
        scene, found = preview.accelerations_of(scene_document(form, system))
        names = nm.Names(scene.coordinates, tuple(scene.values))
        watched = tuple(reader.read_condition(condition, names) for condition in domain)
        hessian = tuple(
            reader.read_formula(text, names)
            for line in answer.get("multiplier") or ()
            for text in line
        )
    except errors.InputError:
        return form
    if scene.constraints:
        return _where_all_methods_begin(form, system, further or {})
    if found is None:
        return form
    watched += tuple(
        dict.fromkeys(wall for tree in found for wall in walls(tree, scene.coordinates))
    )
    q, v = starts.every_start(len(scene.coordinates))
    steps_lasted, evenness, _ = starts.lasted(
        scene, (*found, *watched), hessian, q, v, int(form.steps)
    )
    best = int((steps_lasted + evenness).argmax())
    if not steps_lasted[best]:
        return form
    whole = steps_lasted[best] == int(form.steps)
    steps = int(form.steps) if whole else max(1, int(SHARE * steps_lasted[best]))
    positions, velocities = (_texts(scene.coordinates, values[best]) for values in (q, v))
    return _as_long_as_it_runs(
        replace(form, positions=positions, velocities=velocities, steps=str(steps)), system
    )


def _with_velocities_that_fit(form: SceneForm, system: Mapping[str, Any]) -> SceneForm:
    """The form with the first choice of velocities from which the constraints determine those left empty."""
    if all(form.velocities.values()):
        return form
    names, most = form.coordinates, len(form.coordinates) - 1
    chosen = (given for size in range(most, 0, -1) for given in combinations(names, size))
    choices = (
        replace(form, velocities={name: "1" if name in given else "" for name in names})
        for given in chosen
    )
    for tried in islice(chain((form,), choices), MOST_CHOICES):
        with suppress(errors.InputError):
            preview.accelerations_of(scene_document(tried, system))
            return tried
    return form


def _texts(names: Sequence[str], values: Iterable[float]) -> dict[str, str]:
    return {name: f"{value or 0:g}" for name, value in zip(names, values, strict=True)}


def _where_all_methods_begin(
    form: SceneForm, system: Mapping[str, Any], further: Mapping[str, Any]
) -> SceneForm:
    """The form at the first of some places at which each ticked method begins; as it is where there is none."""
    from inverse_service.service.scenes.simulating import simulate
    from inverse_service.web.pages.starts import every_start

    places = [_texts(form.coordinates, place) for place in every_start(len(form.coordinates))[0]]
    end = now() + LONGEST_TRIAL
    for positions in (form.positions, *places):
        if now() > end:
            break
        tried = replace(form, positions=positions, steps="1")
        methods = simulate({**scene_document(tried, system), **further}, time_limit=LONGEST_TRIAL)[
            "methods"
        ]
        if not {"unavailable", "off_domain"} & {method["outcome"] for method in methods}:
            return replace(form, positions=positions)
    return form


def _as_long_as_it_runs(form: SceneForm, system: Mapping[str, Any]) -> SceneForm:
    """The form with fewer steps where a method ends before the motion does: its steps are tried."""
    from inverse_service.service.scenes.simulating import simulate

    methods = simulate(scene_document(form, system), time_limit=LONGEST_TRIAL)["methods"]
    # What a busy machine does not finish says nothing about the motion.
    ended = [
        m["steps"] for m in methods if m["outcome"] not in ("completed", "unavailable", "cancelled")
    ]
    return replace(form, steps=str(max(1, int(SHARE * min(ended))))) if ended else form


# The pages.


@router.get("/simulate")
async def form(request: Request) -> Response:
    """The form for a system of the catalogue, for a chain, for a result, or for a scene that was run before."""
    query = request.query_params
    if "chain" in query:
        asked = f"chain:{query['chain']}:{query.get('bodies', '')}"
        return RedirectResponse(f"/simulate?{urlencode({'system': asked})}", 303)
    asked_for = {"system": FIRST_SYSTEM, **query}
    found, _ = await _form_about(request, **{key: asked_for.get(key, "") for key in ADDRESS})
    if "step" in query:  # a scene in the address, before it is run
        fields = {name: tuple(query.getlist(name)) for name in query}
        found = with_sent(found, forms.Form(fields))
    return simulate_page(found)


@router.post("/simulate")
async def run(request: Request) -> Response:
    """The job of the scene; redirect to its page, or back to the form with corrections."""
    sent = await results.read_form(request)
    filled, base = await _sent_form(request, sent)
    try:
        scene = changed_scene(base, scene_document(filled, base["system"]))
        # A value that cannot be read is reported next to its field, and no job is created.
        outcome = await results.quick(request, preview.preview_task, scene)
        if outcome.places:
            raise errors.DocumentRefused(tuple(outcome.places))
        kind = "work-precision" if sent.text("kind") == "work-precision" else "simulate"
        if kind == "work-precision":
            scene["methods"] += [one for one in COMPARED if one not in scene["methods"]]
        job = await results.ask(request, kind, scene)
    except REFUSED as error:
        refusal = refusal_of(request, error)
        return simulate_page(filled, forms.problem_of(refusal, {}), refusal.status)
    return RedirectResponse(f"/results/{job.id}", 303)


def field_of(pointer: str) -> str:
    """The name of the form field that a pointer into a scene refers to; empty if there is none."""
    for start, name in FIELDS:
        if pointer.startswith(start):
            return name + pointer.removeprefix(start)
    match pointer.split("/")[1:]:
        case ["step" | "steps" | "start_time" as name]:
            return name
        case ["contacts", place, name]:
            return f"contact.{place}.{name}"
        case ["constants", *_]:
            return "constants"
        case ["ensemble", "parameters", name, *_]:
            return f"parameter.{name}"
        case ["ensemble", "initial", "positions" | "velocities" as kind, name, *_]:
            return f"{'position' if kind == 'positions' else 'velocity'}.{name}"
    return ""


@router.post("/simulate/preview")
async def moving(request: Request) -> Response:
    """The formulas and the start of the current form, for the script that animates them."""
    return await _of_form(request, preview.preview_task)


@router.post("/simulate/price")
async def price(request: Request) -> Response:
    """The cost of a step of the form."""
    return await _of_form(request, preview.price_task)


async def _of_form(
    request: Request, task: Callable[[Mapping[str, Any]], dict[str, Any]]
) -> Response:
    """The result of a task for the current form, or the errors and their fields."""
    sent = await results.read_form(request)
    form, base = await _sent_form(request, sent)
    try:
        scene = changed_scene(base, scene_document(form, base["system"]))
        outcome = await results.quick(request, task, scene)
        found = outcome.value if outcome.status == "done" else _told(outcome.places)
    except errors.InputError as error:
        found = _told(error.places)
    return JSONResponse(found)


def _told(places: Sequence[errors.Place]) -> dict[str, Any]:
    """The errors, and next to which fields they are shown."""
    faults = {field_of(place.pointer): forms.sentence(place) for place in places}
    return {
        "reason": " ".join(faults.values()),
        "faults": {name: said for name, said in faults.items() if name},
    }


async def _sent_form(request: Request, sent: forms.Form) -> tuple[SceneForm, dict[str, Any]]:
    """The form as sent, and the base of its scenes."""
    empty, base = await _form_about(request, **{key: sent.text(key) for key in ADDRESS})
    return with_sent(empty, sent), base


async def _form_about(
    request: Request, *, system: str, job: str, scene: str, given: str
) -> tuple[SceneForm, dict[str, Any]]:
    """The form about one of these, and the base of its scenes."""
    if scene:
        return await _form_of_scene(request, scene)
    return _form_of_link(given) if given else await _empty_form(request, system, job)


def simulate_page(
    form: SceneForm, problem: forms.Problem | None = None, status: int = 200
) -> HTMLResponse:
    """The page with the form filled in."""
    systems = [(name, catalogue.entry(name)["title"]) for name in catalogue.names("nonholonomic")]
    return rendering.page(
        "simulate.html",
        status,
        active="/simulate",
        form=form,
        body=library.body_of(form.system),
        systems=systems,
        chains=WORDS["chains"],
        longest=chains.LONGEST,
        longest_of_rods=chains.LONGEST_OF_RODS,
        many=MANY,
        methods=METHODS,
        problem=problem,
        faults=(faults := {field_of(place.pointer): place.detail for place in problem or ()}),
        has_faulty_contact=any(name.startswith("contact.") for name in faults),
    )


async def _empty_form(request: Request, system: str, job: str) -> tuple[SceneForm, dict[str, Any]]:
    """The form of a result or of a catalogue entry, with what its scenes begin with.

    A result of a constrained system gives that one with the Lagrangian that was found for an
    associated system as the free Lagrangian, any other its equations with their Lagrangian.
    """
    if not job and (chain_asked := chains.chain_of(system)):
        document = chains.document_of(*chain_asked)
        address = f"chain:{':'.join(map(str, chain_asked))}"
        filled = form_for(document, document["name"], system=address)
        return _at_rest(filled, chain_asked[0]), {"system": {"document": document}}
    if not job:
        return form_of_system({"catalogue": system}), {"system": {"catalogue": system}}
    await results.successful(request, job)
    choose = partial(_form_of_result, job=job)
    found: tuple[SceneForm, dict[str, Any]] | None = await results.made(
        request, job, result_tasks.part_task, choose
    )
    return known(found, "result with a system at this address.")


def _at_rest(form: SceneForm, kind: str) -> SceneForm:
    """A chain of which the first body is out of its place, with methods of its kind."""
    rest = dict.fromkeys(form.coordinates, "0")
    methods = ("variational",) if kind == "rods" else ("stormer-verlet",)
    return replace(
        form,
        positions=rest | {form.coordinates[0]: "1"},
        velocities=rest,
        methods=(*methods, "adaptive"),
    )


def _form_of_result(result: Mapping[str, Any], job: str) -> tuple[SceneForm, dict[str, Any]] | None:
    """The same of a result, inside a worker; None where it has no system that was solved."""
    given = (result.get("system") or {}).get("given")
    if not given:
        return None
    answer: Mapping[str, Any] = {}
    found, is_forward = dict[str, str](), "verdict" not in result
    if result.get("nonholonomic") or is_forward:
        # L and constraints may stand in one text. Names that were left to be found in it are taken
        # from what was found.
        ready = accepting.prepared(given)
        read = ready.outward(ready.document) | {
            key: given[key] for key in ("time",) if key in given
        }
        if is_forward and read.pop("where", None):  # x = l sin(theta) is put in
            read["lagrangian"] = result["lagrangian"]["text"]
        names = {key: result["system"][key] for key in ("coordinates", "parameters", "functions")
                 if key in result["system"] and not isinstance(given.get(key), list | dict)}  # fmt: skip
        system: dict[str, Any] = {
            "document": {key: read[key] for key in CONSTRAINED if key in read} | names
        }
        # A Lagrangian with arbitrary functions is looked for again, with the functions that the
        # scene gives.
        if not is_forward and result.get("lagrangian") and not given.get("functions"):
            found = {"free_lagrangian": result["lagrangian"]["text"]}
    else:
        system = {"result": result}
        answer = next(
            (one.part for one in stated.main_statements(result) if one.part.get("lagrangian")),
            answer,
        )
    form = with_good_start(form_of_system(system, job=job), system, answer, found)
    return form, {"system": system, **found}


def form_of_system(system: Mapping[str, Any], **address: str) -> SceneForm:
    """The form for a scene's `system`: an entry of the catalogue, a document, a result, or a system written out."""
    if "catalogue" in system:
        name = system["catalogue"]
        return form_for(
            solve.example_document(name), catalogue.entry(name)["title"], system=name, **address
        )
    if "result" in system:
        shown = system["result"]["system"]
        kept = ("coordinates", "parameters", "functions", "equations")
        solved = {key: shown[key] for key in kept if key in shown}
        unsolved = any(
            reader.has_acceleration(text) for text in shown.get("equations", {}).values()
        )
        form = form_for(shown["given"] if unsolved else solved, shown["name"] or "", **address)
        answers = (system["result"], system["result"].get("with_time") or {})
        # Without a Lagrangian there is nothing to discretize but the equations.
        return (
            form
            if any(a.get("lagrangian") for a in answers)
            else replace(form, methods=WITHOUT_LAGRANGIAN)
        )
    document = system.get("document", system)
    return form_for(document, document.get("name") or "", **address)


async def _form_of_scene(request: Request, identifier: str) -> tuple[SceneForm, dict[str, Any]]:
    """The form filled with a scene that was run before, and that scene."""
    job = await results.finished(request, identifier)
    job = known(job if job.kind in SCENES else None, "scene at this address.")
    scene = json.loads(job.document)
    try:
        empty = form_of_system(scene["system"], scene=identifier)
    except NO_FORM:
        raise Refusal(
            422, "bad-input", "This scene names no coordinates; change its document instead."
        ) from None
    return form_of_scene(empty, scene), scene


def _form_of_link(given: str) -> tuple[SceneForm, dict[str, Any]]:
    """The form filled with the scene of a link, and that scene."""
    try:
        scene: dict[str, Any] = json.loads(given)
        return form_of_scene(form_of_system(scene["system"], given=given), scene), scene
    except NO_FORM:
        detail = "The scene in this link cannot be read. Copy the whole link."
        raise Refusal(422, "bad-input", detail) from None
