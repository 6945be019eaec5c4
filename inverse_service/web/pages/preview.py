"""A scene for the script that plays with it: its formulas as plain lists, which it interprets and never evaluates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from inverse_service import errors
from inverse_service.expressions import calculus, functions, printing, tree as trees
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import printed_pages
from inverse_service.service.scenes import views

if TYPE_CHECKING:
    from inverse_service.simulation.scene_data import Scene

# Formulas of more nodes are left to the service.
MOST_NODES = 4_000
LONG = "These equations cannot be played with in the browser; Run computes them."
# The steps of a price: of longer runs the error is that after so many.
MOST_PRICED, FEW = 2_000, 50


def accelerations_of(document: Mapping[str, Any]) -> tuple[Scene, tuple[trees.Expression, ...] | None]:
    """A scene without its methods, and the accelerations of its motion if they can be solved for.

    Called in workers only: the web process loads nothing of this.
    """
    from inverse_service.service.scenes.scene_reading import read_scene, scene_schema
    from inverse_service.simulation import derivation, scene_data

    scene, _ = read_scene(scene_schema({**document, "methods": ["runge-kutta"], "observe": []}))
    try:
        return scene, derivation.accelerations_of(scene)
    except scene_data.Unavailable:
        return scene, None


def preview_task(document: Mapping[str, Any]) -> dict[str, Any]:
    """The data that the script needs of a Scene document, or {"reason": a sentence}."""
    scene, found = accelerations_of(document)
    formulas = (*(found or ()), *scene.constraints)
    if found is None or sum(map(trees.node_count, formulas)) > MOST_NODES:
        return {"reason": LONG}
    return _played(scene.coordinates, dict(scene.values), found, scene.constraints)


def _played(
    coordinates: Sequence[str],
    values: Mapping[str, float],
    accelerations: Sequence[trees.Expression],
    constraints: Sequence[trees.Expression],
) -> dict[str, Any]:
    """What the script needs of any motion; InputError for a function without a formula."""
    return {
        "coordinates": list(coordinates),
        "labels": labels_of((*coordinates, *values)),
        "values": values,
        "equations": [listed(tree) for tree in accelerations],
        "constraints": [listed(tree) for tree in constraints],
        "angles": angles_of(coordinates, (*accelerations, *constraints)),
    }


def price_task(document: Mapping[str, Any]) -> dict[str, Any]:
    """What the step of a scene costs by its first method that takes steps: {"method", "step", "order", "error",
    "seconds", "until"}, or {"reason": a sentence}.

    The error is estimated from runs with the step, a half and a quarter of it (Richardson, 1911); it and the time
    belong to the motion up to `until`, the time to the whole.
    """
    from inverse_service.service.scenes.simulating import simulate

    methods = [one if isinstance(one, dict) else {"method": one} for one in document["methods"]]
    chosen = next((one for one in methods if one["method"] not in views.TRUE), None)
    if chosen is None:
        return {"reason": ""}
    step, steps = Fraction(str(document["step"])), int(document["steps"])
    few = max(1, min(steps, MOST_PRICED) // FEW)
    ends, seconds = [], 0.0
    for part in (1, 2, 4):
        count = part * few * (min(steps, MOST_PRICED) // few)
        scene = {"step": str(step / part), "steps": count, "record_every": part * few, "methods": [chosen]}
        method = simulate({**document, **scene, "observe": ["trajectory"]})["methods"][0]
        name = views.method_name(method["label"])
        if method["outcome"] != "completed":
            return {"reason": f"{name} with step {float(step / part):g}: {printed_pages.why(method)}"}
        columns = method["points"]["columns"]
        ends.append([columns[name] for name in columns if name != "t" and not name.startswith(("v_", "p_"))])
        if part == 1:
            seconds, until = method["seconds"]["run"] * steps / count, columns["t"][-1]
    coarse, fine = (_distance(*pair) for pair in itertools.pairwise(ends))
    order = min(12.0, max(1.0, math.log2(coarse / fine))) if coarse and fine else 1.0
    error = coarse / (1 - 2**-order)
    return {"method": name, "step": float(step), "order": order, "error": error, "seconds": seconds, "until": until}


def _distance(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> float:
    """The greatest distance of two motions at the same times."""
    points = [zip(*columns, strict=True) for columns in (left, right)]
    return max(math.dist(p, q) for p, q in zip(*points, strict=True))


@dataclass(frozen=True, slots=True)
class Moving:
    """The formulas of a result's motion: the accelerations of its coordinates, the velocities that the constraints
    give, and the constraints; arbitrary functions have a formula of their own, as on the form of a simulation."""

    names: nm.Names
    accelerations: tuple[trees.Expression, ...]
    velocities: dict[str, trees.Expression]
    constraints: tuple[trees.Expression, ...]
    definitions: dict[str, tuple[tuple[str, ...], trees.Expression]]

    def read(self, text: str) -> trees.Expression:
        """A formula or a condition with the functions defined."""
        is_condition = any(sign in text for sign in (" > ", " < ", " != "))
        tree = (reader.read_condition if is_condition else reader.read_formula)(text, self.names)
        return calculus.define_functions(tree, self.definitions)


def moving_of(result: Mapping[str, Any]) -> Moving | None:
    """None if the accelerations are not solved for or cannot be read."""
    system, part = result["system"], result.get("nonholonomic") or {}
    if system is None or any(reader.has_acceleration(text) for text in system["equations"].values()):
        return None
    motion, time = part.get("equations_of_motion") or {}, system.get("time", "t")
    functions, parameters = system.get("functions") or {}, tuple(system["parameters"])
    names = nm.Names(tuple(system["coordinates"]), (*parameters, *((time,) if time != "t" else ())), functions)
    texts = system["equations"] | {name: f["text"] for name, f in motion.get("accelerations", {}).items()}
    try:
        definitions = {
            name: (tuple(of), reader.read_formula(f"1 + {of[0]}^2/4", names)) for name, of in functions.items()
        }
        found = Moving(names, (), {}, (), definitions)
        return replace(
            found,
            accelerations=tuple(found.read(texts[name]) for name in names.coordinates),
            velocities={name: found.read(one["text"]) for name, one in motion.get("first_order", {}).items()},
            constraints=tuple(found.read(one["text"]) for one in part.get("constraints") or ()),
        )
    except (errors.InputError, ValueError):
        return None


def motion_of_result(result: Mapping[str, Any], domain: Sequence[str] = ()) -> dict[str, Any] | None:
    """What the script needs to move a result: trees, names, and the conditions that the start keeps; None without."""
    moving = moving_of(result)
    if moving is None:
        return None
    formulas = (*moving.accelerations, *moving.constraints)
    if sum(map(trees.node_count, formulas)) > MOST_NODES:
        return None
    system = result["system"]
    given = system["given"].get("parameters") if isinstance(system.get("given"), Mapping) else None
    values = given if isinstance(given, Mapping) else {}
    numbers = {name: float(Fraction(values[name])) if values.get(name) else 1 for name in system["parameters"]}
    constrained = (result.get("nonholonomic") or {}).get("equations_of_motion")
    try:
        played = _played(system["coordinates"], numbers, moving.accelerations, moving.constraints)
        sides = [listed(moving.read(text)) for text in domain]
    except (errors.InputError, ValueError):
        return None
    return played | {
        "time": system.get("time", "t"),
        "free": constrained["free"] if constrained else None,
        "domain": sides,
        "signs": [" > " in text or " < " in text for text in domain],
    }


def labels_of(names: Iterable[str]) -> dict[str, str]:
    """The names as the picture shows them."""
    return {name: printing.shown(name) for name in names}


def listed(tree: trees.Expression) -> Any:
    """A tree as JSON: a number, a name (x' is a velocity), or [operation, part, …]."""
    match tree:
        case trees.Number(value):
            return float(value)
        case trees.Symbol(name):
            return name
        case trees.Velocity(coordinate):
            return f"{coordinate}'"
        case trees.Sum(terms):
            return ["+", *map(listed, terms)]
        case trees.Product(factors):
            return ["*", *map(listed, factors)]
        case trees.Power(base, exponent):
            return ["^", listed(base), listed(exponent)]
        case trees.Apply(function, argument):
            return [function, listed(argument)]
    raise errors.InputError("A function of the equations was given no formula.")


def angles_of(coordinates: Iterable[str], formulas: Iterable[trees.Expression]) -> list[str]:
    """The coordinates that stand in periodic functions only: they are drawn as angles."""
    formulas = tuple(formulas)
    inside = {
        name.name
        for node in trees.distinct_nodes(formulas)
        if isinstance(node, trees.Apply) and node.function in functions.CIRCULAR
        for name in trees.walk(node.argument)
        if isinstance(name, trees.Symbol)
    }
    outside = {name.name for formula in formulas for name in _plainly(formula)}
    return [name for name in coordinates if name in inside - outside]


def angles_of_texts(system: Mapping[str, Any]) -> list[str]:
    """The same of the formulas of a simulated system, which are written out."""
    names = nm.Names(tuple(system["coordinates"]), tuple(system["parameters"]))
    texts = [system["lagrangian"] or "0", *system["constraints"], *(system["equations"] or {}).values()]
    try:
        return angles_of(system["coordinates"], [reader.read_formula(text, names) for text in texts])
    except errors.InputError:
        return []


def _plainly(tree: trees.Expression) -> Iterable[trees.Symbol]:
    """The names of a tree that stand in no periodic function."""
    if isinstance(tree, trees.Apply) and tree.function in functions.CIRCULAR:
        return ()
    if isinstance(tree, trees.Symbol):
        return (tree,)
    return (name for part in trees.children(tree) for name in _plainly(part))
