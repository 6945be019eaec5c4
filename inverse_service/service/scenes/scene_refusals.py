"""From the complaints of the scene's schema to one clear sentence a fault, with its place."""

from __future__ import annotations

from typing import Any, get_args

from api_schemas.scene import MAX_METHODS, MAX_STEPS, SYSTEM_TAGS, MethodName, Observed, SceneDocument, SceneMethod
from api_schemas.system import TAGS
from inverse_service.service.documents.accepting import FORMULA, Steps, Wording, validated, without
from inverse_service.service.documents.preparing import prepared_scene

HIDDEN = frozenset({*TAGS, "[key]", "quantity", "formulas", "columns", "list"})
SYSTEM = (
    'an object: {"catalogue": name}, {"document": {...}}, {"result": {...}} or a document with coordinates and '
    "lagrangian or equations"
)
NUMBER = 'a number, or a text such as "1/2" or "pi/4"'
EXPECTED: dict[Steps, str] = {
    (): "an object with system, initial, step, steps and methods",
    ("name",): "a text",
    ("system",): SYSTEM,
    ("system", "catalogue"): 'the name of a system, such as "vertically-rolling-disk"',
    ("system", "document"): "a document with coordinates and lagrangian or equations",
    ("system", "result"): "the result that solve gave",
    ("parameters",): 'an object with values, such as {"M": 1, "R": "1/2"}',
    ("parameters", "*"): NUMBER,
    ("functions",): 'an object with formulas, such as {"A": "cos(r1)"}',
    ("functions", "*"): FORMULA,
    ("effects",): 'a list of names such as ["constraints", "potential"]',
    ("effects", "*"): "a name",
    ("terms",): """an object of terms of L by name, such as {"spring": "-k*x^2/2"}""",
    ("terms", "*"): FORMULA,
    ("initial",): "an object with positions and velocities or momenta",
    ("initial", "positions"): "an object with a number for each coordinate",
    ("initial", "velocities"): "an object with numbers by coordinate",
    ("initial", "momenta"): "an object with a number for each coordinate",
    **{("initial", key, "*"): NUMBER for key in ("positions", "velocities", "momenta")},
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
    ("forces", "*"): FORMULA,
    ("rayleigh",): FORMULA,
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
    return validated(prepared_scene(document), SceneDocument, WORDING)


def _steps(loc: Steps) -> Steps:
    steps = without(loc, HIDDEN)
    is_tagged = len(steps) > 1 and steps[0] == "system" and steps[1] in SYSTEM_TAGS
    # The tag of the form that the system has is not a key of the document.
    return (steps[0], *steps[2:]) if is_tagged else steps


def _unknown(steps: Steps, where: str) -> str:
    if steps[-1] in NOT_SIMULATED:
        return NOT_SIMULATED[str(steps[-1])]
    return f"The key {where} is not known here; the keys are {', '.join(_keys(steps))}."


def _keys(steps: Steps) -> list[str]:
    if len(steps) == 1:
        return list(SceneDocument.model_fields)
    if steps[0] == "initial":
        return ["positions", "velocities", "momenta", "project"]
    return list(SceneMethod.model_fields) if steps[0] == "methods" else [str(steps[0])]


WORDING = Wording("The scene", EXPECTED, _unknown, _steps)
