"""From the complaints of the scene's schema to one clear sentence a fault, with its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import ValidationError

from api_schemas.scene import MAX_METHODS, MAX_STEPS, SYSTEM_TAGS, MethodName, Observed, SceneDocument, SceneMethod
from api_schemas.system import TAGS
from inverse_service.errors import DocumentRefused, Place
from inverse_service.service.documents.accepting import MAX_PLACES
from inverse_service.service.documents.preparing import prepared_scene
from inverse_service.service.documents.reading import escape

HIDDEN = frozenset({*TAGS, "[key]", "quantity", "formulas", "columns", "list"})
SYSTEM = (
    'an object: {"catalogue": name}, {"document": {...}}, {"result": {...}} or a document with coordinates and '
    "lagrangian or equations"
)
NUMBER = 'a number, or a text such as "1/2" or "pi/4"'
EXPECTED = {
    (): "an object with system, initial, step, steps and methods",
    ("name",): "a text",
    ("system",): SYSTEM,
    ("system", "catalogue"): 'the name of a system, such as "vertically-rolling-disk"',
    ("system", "document"): "a document with coordinates and lagrangian or equations",
    ("system", "result"): "the result that solve gave",
    ("parameters",): 'an object with values, such as {"M": 1, "R": "1/2"}',
    ("parameters", "*"): NUMBER,
    ("functions",): 'an object with formulas, such as {"A": "cos(r1)"}',
    ("functions", "*"): "a formula written as text",
    ("effects",): 'a list of names such as ["constraints", "potential"]',
    ("effects", "*"): "a name",
    ("terms",): """an object of terms of L by name, such as {"spring": "-k*x^2/2"}""",
    ("terms", "*"): "a formula written as text",
    ("initial",): "an object with positions and velocities or momenta",
    ("initial", "positions"): "an object with a number for each coordinate",
    ("initial", "velocities"): "an object with numbers by coordinate",
    ("initial", "momenta"): "an object with a number for each coordinate",
    ("initial", "project"): "true or false",
    ("step",): "a positive number, the size of a step",
    ("steps",): f"an integer from 1 to {MAX_STEPS}",
    ("time",): "a positive number, the length of time",
    ("record_every",): f"an integer from 1 to {MAX_STEPS}",
    ("methods",): f'a list of 1 to {MAX_METHODS} methods such as {{"method": "variational", "alpha": "1/2"}}',
    ("methods", "*"): 'an object such as {"method": "variational", "alpha": "1/2"}',
    ("methods", "*", "method"): "one of " + ", ".join(get_args(MethodName)),
    ("methods", "*", "alpha"): "a number from 0 to 1",
    ("methods", "*", "symmetrised"): "true or false",
    ("methods", "*", "order"): "2, 4, 6 or 8 (4, 5 or 8 for runge-kutta)",
    ("methods", "*", "form"): '"hamiltonian" or "raw"',
    ("methods", "*", "start"): '"momenta" or "discrete_constraint"',
    ("methods", "*", "constants"): "an object with numbers",
    ("observe",): "a list of names of quantities",
    ("observe", "*"): "one of " + ", ".join(get_args(Observed)) + """, or formulas by name: {"Lz": "x*y' - y*x'"}""",
    ("forces",): """an object with a force for each coordinate, such as {"x": "-c*x'"}""",
    ("forces", "*"): "a formula written as text",
    ("rayleigh",): "a formula written as text",
    ("start_time",): NUMBER,
    ("restart",): "the result of a scene, as simulate gave it",
    ("events",): 'a list of events such as {"when": "y = 0", "direction": -1, "do": "stop"}',
    ("events", "*"): 'an object such as {"when": "y = 0", "direction": -1, "do": "stop"}',
    ("events", "*", "direction"): "1, -1 or 0",
    ("events", "*", "do"): '"record" or "stop"',
    ("ensemble",): 'an object with initial and parameters, such as {"parameters": {"k": [1, 2]}}',
    ("as_lagrangian",): "true or false",
    ("start",): '"momenta" or "discrete_constraint"',
    ("free_lagrangian",): 'a formula written as text, or "first", "second" or "third" for that associated system',
    ("constants",): 'an object with numbers, such as {"C_x": "1/100"}',
    ("units",): 'an object of units by name, such as {"x": "m", "t": "s"}',
    ("circle",): 'two coordinates such as ["x", "y"]',
    ("step_sizes",): "a list of positive numbers",
    ("repeats",): "an integer from 1 to 50",
}

IMPACTS = "Impacts are not simulated: stop at an event, and begin again at its point with the velocities after it."
NOISE = (
    "Noise is not simulated: every motion follows from its start; write a force that is a formula of t and the state."
)
DELAYS = "Delays are not simulated: a force depends on t and on the state at t."
NOT_SIMULATED = {
    **dict.fromkeys(("contact", "contacts", "impact", "impacts", "collision", "collisions"), IMPACTS),
    **dict.fromkeys(("noise", "random", "stochastic"), NOISE),
    **dict.fromkeys(("delay", "delays"), DELAYS),
}


def scene_schema(document: Any) -> SceneDocument:
    """The scene in its schema; raises DocumentRefused with every fault found."""
    try:
        return SceneDocument.model_validate(prepared_scene(document))
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False, include_context=True)
        raise DocumentRefused(tuple(_place(fault) for fault in found[:MAX_PLACES])) from None


def _place(fault: Mapping[str, Any]) -> Place:
    steps = [step for step in fault["loc"] if step not in HIDDEN]
    if len(steps) > 1 and steps[0] == "system" and steps[1] in SYSTEM_TAGS:
        del steps[1]  # the tag of the form that the value has, not a key of the document
    pointer = "".join(f"/{escape(step)}" for step in steps)
    code = "limit" if fault["type"].endswith("too_long") else "bad-input"
    return Place(_sentence(fault, steps), pointer, None, code)


def _sentence(fault: Mapping[str, Any], steps: list[Any]) -> str:
    kind, context = fault["type"], fault.get("ctx", {})
    where = f"'{'/'.join(escape(step) for step in steps)}'" if steps else "The scene"
    if kind == "missing":
        return f"The key {where} is missing; it must be {_expected(steps)}."
    if kind == "extra_forbidden" and steps[-1] in NOT_SIMULATED:
        return NOT_SIMULATED[steps[-1]]
    if kind == "extra_forbidden":
        return f"The key {where} is not known here; the keys are {', '.join(_keys(steps))}."
    if kind.endswith("too_long"):
        counted = "characters" if kind.startswith("string") else "entries"
        return f"{where} is too long: at most {context['max_length']} {counted} are accepted."
    return f"{where} is not what is wanted; it must be {_expected(steps)}."


def _expected(steps: list[Any]) -> str:
    path = tuple("*" if place and (isinstance(step, int) or steps[0] in OPEN) else step
                 for place, step in enumerate(steps))  # fmt: skip
    while path:
        if path in EXPECTED:
            return EXPECTED[path]
        if len(path) == 3 and path[0] == "initial":
            return NUMBER
        path = path[:-1]
    return EXPECTED[()]


OPEN = frozenset({"parameters", "functions", "terms", "constants", "effects", "observe", "forces"})


def _keys(steps: list[Any]) -> list[str]:
    if len(steps) == 1:
        return list(SceneDocument.model_fields)
    if steps[0] == "initial":
        return ["positions", "velocities", "momenta", "project"]
    return list(SceneMethod.model_fields) if steps[0] == "methods" else [str(steps[0])]
