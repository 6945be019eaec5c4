"""A scene for the script that plays with it: its formulas as plain lists, which it interprets and never evaluates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import mpmath

from inverse_service import errors
from inverse_service.expressions import calculus, functions, printing, tree as trees
from inverse_service.mechanics import euler_lagrange
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import joined, printed_pages, sheets, stated
from inverse_service.service.scenes import views
from inverse_service.web.pages import constants, pictures, typesetting

if TYPE_CHECKING:
    from inverse_service.simulation.scene_data import Scene

# Formulas of more nodes are left to the service.
MOST_NODES = 4_000
NOT_SHOWN = {
    "ensemble": " The first run of the list.",
    "contacts": " The preview is without contacts; Run has them.",
}
AGREES = 1e-9  # difference of two formulas for one acceleration, rounded
LONG = "These equations cannot be played with in the browser; Run computes them."
# The steps of a price: of longer runs the error is that after so many.
MOST_PRICED, FEW = 2_000, 50
SUBSCRIPTS = str.maketrans(
    "0123456789", "\u2080\u2081\u2082\u2083\u2084\u2085\u2086\u2087\u2088\u2089"
)
MOST_METERS, LONGEST_METER, MOST_SLIDERS = 3, 40, 6
# Conserved quantities whose names say which they are where their formula is too long for a meter.
NAMED = ("energy", "momentum", "angular momentum")


class Motion(NamedTuple):
    """A scene, and its accelerations if they are formulas."""

    scene: Scene
    accelerations: tuple[trees.Expression, ...] | None


def accelerations_of(
    document: Mapping[str, Any],
) -> Motion:
    """A scene without its methods, and the accelerations of its motion if they can be solved for.

    Called in workers only: the web process loads nothing of this.
    """
    from inverse_service.service.scenes.scene_reading import read_scene, scene_schema
    from inverse_service.simulation import derivation, scene_data

    scene, _ = read_scene(scene_schema({**document, "methods": ["runge-kutta"], "observe": []}))
    try:
        return Motion(scene, derivation.accelerations_of(scene))
    except scene_data.Unavailable:
        return Motion(scene, None)


def preview_task(document: Mapping[str, Any]) -> dict[str, Any]:
    """The data that the script needs of a Scene document, or {"reason": a sentence}."""
    scene, found = accelerations_of(document)
    formulas = (*(found or ()), *scene.constraints)
    if found is None or sum(map(trees.node_count, formulas)) > MOST_NODES:
        return {"reason": LONG}
    played = _played(scene.coordinates, dict(scene.values), found, scene.constraints)
    names = nm.Names(tuple(scene.coordinates), tuple(scene.values))
    known = pictures.Facts(
        names, tuple(found), tuple(played["angles"]), values=dict(scene.values), lagrangian=scene.lagrangian,
        constraints=tuple(scene.constraints),
    )  # fmt: skip
    picture = pictures.picture_of(known)
    shown = {"picture": picture.kind, "known": _written(picture.trees), "meters": []}
    more = [text for key, text in NOT_SHOWN.items() if document.get(key)]
    return (
        played
        | multiplied(known)
        | shown
        | {"caption": typesetting.said((*picture.caption, *more))}
    )


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


def multiplied(facts: pictures.Facts) -> dict[str, Any]:
    """{"multiplied"}: M, F, A, b of M q'' = F + A^T lambda, A q'' + b = 0 for L with constraints.

    The accelerations solved for may divide by what is 0 somewhere on the way, such as cos(a); these
    do not.

    Empty where the accelerations do not satisfy them at a point, as other forces act, or where L is
    not known.
    """
    if not facts.constraints or facts.lagrangian is None or not facts.accelerations:
        return {}
    names, lagrangian = facts.coordinates, facts.lagrangian
    places, speeds = [*map(trees.Symbol, names)], [*map(trees.Velocity, names)]
    rates = [*zip(places, speeds, strict=True)]
    slope = calculus.differentiate
    found: dict[str, Any] = {
        "mass": euler_lagrange.hessian(lagrangian, names),
        "force": [
            trees.subtract(
                slope(lagrangian, q), calculus.time_derivative(slope(lagrangian, v), rates)
            )
            for q, v in rates
        ],
        "rows": [[slope(one, v) for v in speeds] for one in facts.constraints],
        "turned": [calculus.time_derivative(one, rates) for one in facts.constraints],
    }
    return {"multiplied": _written(found)} if _are_met(facts, found) else {}


def _are_met(facts: pictures.Facts, known: Mapping[str, Any]) -> bool:
    """Whether the accelerations satisfy the equations with multipliers at a point on the constraints."""
    point: dict[trees.Expression, Any] = {trees.Symbol(facts.time): mpmath.mpf("0.41")}
    for k, name in enumerate(facts.coordinates):
        point[trees.Symbol(name)] = mpmath.mpf("0.37") + k * mpmath.mpf("0.23")
        point[trees.Velocity(name)] = mpmath.mpf("0.61") - k * mpmath.mpf("0.19")

    def at(tree: trees.Expression) -> mpmath.mpf:
        return facts.value(tree, point)

    # The nearest velocities that the constraints, which are linear in them, allow.
    rows = mpmath.matrix([[at(one) for one in row] for row in known["rows"]])
    rest = mpmath.matrix([at(one) for one in facts.constraints])
    try:
        moved = rows.T * mpmath.lu_solve(rows * rows.T, rest)
        for k, name in enumerate(facts.coordinates):
            point[trees.Velocity(name)] -= moved[k]
        q = mpmath.matrix([at(one) for one in facts.accelerations])
        mass = mpmath.matrix([[at(one) for one in row] for row in known["mass"]])
        left = mass * q - mpmath.matrix([at(one) for one in known["force"]])
        pushed = rows.T * mpmath.lu_solve(rows * rows.T, rows * left)
        turned = rows * q + mpmath.matrix([at(one) for one in known["turned"]])
    except (ArithmeticError, ValueError):
        return False
    return bool(max(map(abs, (*(left - pushed), *turned))) < AGREES)  # not of nan


def price_task(document: Mapping[str, Any]) -> dict[str, Any]:
    """What the step of a scene costs by its first method that takes steps and can run: {"method",
    "step", "order", "error", "seconds", "until", "parts": what each effect adds to a step in s}, or
    {"reason": a sentence}.
    """
    if document.get("contacts"):
        return {"reason": "A step is priced without contacts."}
    document = {key: part for key, part in document.items() if key != "ensemble"}
    methods = [one if isinstance(one, dict) else {"method": one} for one in document["methods"]]
    stepping = [one for one in methods if one["method"] not in views.TRUE]
    told: dict[str, Any] = {"reason": ""}
    for chosen in stepping:
        told = _price_of(document, chosen)
        if told.get("outcome") != "unavailable":
            break
    told.pop("outcome", None)
    if "reason" in told:
        return told
    # A free Lagrangian holds the effects in one formula.
    apart = next((one for one in stepping if one["method"] != "variational"), chosen)
    return told | {"parts": _parts_of_step({**document, "methods": [apart], "steps": FEW})}


def _price_of(document: Mapping[str, Any], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """The price of a step by one method, or {"reason", "outcome"} of a run that ends.

    The error is estimated from runs with the step, a half and a quarter of it (Richardson, 1911);
    it and the time belong to the motion up to `until`, the time to the whole.
    """
    from inverse_service.service.scenes.simulating import simulate

    step, steps = Fraction(str(document["step"])), int(document["steps"])
    few = max(1, min(steps, MOST_PRICED) // FEW)
    ends, seconds = [], 0.0
    for part in (1, 2, 4):
        count = part * few * (min(steps, MOST_PRICED) // few)
        scene = {
            "step": str(step / part),
            "steps": count,
            "record_every": part * few,
            "methods": [chosen],
        }
        method = simulate({**document, **scene, "observe": ["trajectory"]})["methods"][0]
        name = views.method_name(method["label"])
        if method["outcome"] != "completed":
            why = f"{name} with step {float(step / part):g}: {printed_pages.why(method)}"
            return {"reason": why, "outcome": method["outcome"]}
        columns = method["points"]["columns"]
        ends.append(
            [columns[name] for name in columns if name != "t" and not name.startswith(("v_", "p_"))]
        )
        if part == 1:
            seconds, until = method["seconds"]["run"] * steps / count, columns["t"][-1]
    coarse, fine = (_distance(*pair) for pair in itertools.pairwise(ends))
    order = min(12.0, max(1.0, math.log2(coarse / fine))) if coarse and fine else 1.0
    return {
        "method": name,
        "step": float(step),
        "order": order,
        "error": coarse / (1 - 2**-order),
        "seconds": seconds,
        "until": until,
    }


def _parts_of_step(scene: Mapping[str, Any]) -> dict[str, float]:
    """What each effect adds to a step, in s."""
    from inverse_service.service.scenes.simulating import simulate

    cost = (
        simulate({**scene, "record_every": 1, "observe": ["cost"]})["methods"][0].get("cost") or {}
    )
    return {
        one["name"]: one["step_ns"] * 1e-9
        for one in cost.get("parts") or ()
        if one["kind"] == "effect"
    }


def _distance(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> float:
    """The greatest distance of two motions at the same times."""
    points = [zip(*columns, strict=True) for columns in (left, right)]
    return max(math.dist(p, q) for p, q in zip(*points, strict=True))


@dataclass(frozen=True, slots=True)
class Moving:
    """The formulas of a result's motion: the accelerations of its coordinates, the velocities that
    the constraints give, and the constraints."""

    names: nm.Names
    accelerations: tuple[trees.Expression, ...]
    velocities: dict[str, trees.Expression]
    constraints: tuple[trees.Expression, ...]

    def read(self, text: str) -> trees.Expression:
        """A formula or a condition."""
        is_condition = any(sign in text for sign in (" > ", " < ", " != "))
        return (reader.read_condition if is_condition else reader.read_formula)(text, self.names)


def moving_of(result: Mapping[str, Any]) -> Moving | None:
    """None if the accelerations are not solved for, cannot be read, or hold an unknown function.

    A function would have to be invented to move anything.
    """
    system, part = result["system"], result.get("nonholonomic") or {}
    if system is None or system.get("functions"):
        return None
    if any(reader.has_acceleration(text) for text in system["equations"].values()):
        return None
    motion, time = part.get("equations_of_motion") or {}, system.get("time", "t")
    parameters = tuple(system["parameters"])
    names = nm.Names(tuple(system["coordinates"]), (*parameters, *((time,) if time != "t" else ())))
    texts = system["equations"] | {
        name: f["text"] for name, f in motion.get("accelerations", {}).items()
    }
    try:
        return Moving(
            names,
            tuple(reader.read_formula(texts[name], names) for name in names.coordinates),
            {
                name: reader.read_formula(one["text"], names)
                for name, one in motion.get("first_order", {}).items()
            },
            tuple(reader.read_formula(one["text"], names) for one in part.get("constraints") or ()),
        )
    except (errors.InputError, ValueError):
        return None


@dataclass(frozen=True, slots=True)
class Shown:
    """A motion as a page shows it: the data of the script, the caption, and conserved quantities as
    meters.

    `agreement` shows beside the proof that the conditions on g agree.
    """

    data: Mapping[str, Any]
    caption: sheets.Sentence = ()
    meters: tuple[tuple[str, sheets.Formula | str], ...] = ()
    rows: int = 0  # of sliders, whose room is kept until the script makes them
    agreement: Shown | None = None


def motion_of_result(
    result: Mapping[str, Any], domain: Sequence[str] = (), reveals: bool = True
) -> Shown | None:
    """What a page needs to move a result; the start keeps the conditions of `domain`. None where
    nothing moves.

    Without `reveals` the picture follows from the equations alone.
    """
    moving = moving_of(result)
    if moving is None:
        return None
    if sum(map(trees.node_count, (*moving.accelerations, *moving.constraints))) > MOST_NODES:
        return None
    system = result["system"]
    numbers = values_of(result, moving)
    constrained = (result.get("nonholonomic") or {}).get("equations_of_motion")
    try:
        played = _played(system["coordinates"], numbers, moving.accelerations, moving.constraints)
        facts = facts_of(result, moving, numbers, tuple(played["angles"]), reveals)
        sides = [listed(moving.read(text)) for text in (() if facts.cases else domain)]
        picture, beside = pictures.picture_of(facts), pictures.agreement_of(facts)
    except (errors.InputError, ValueError):  # so are derivatives of a formula in pieces
        return None
    is_given = "verdict" not in result  # L is
    kept = [
        (_meter_name(name, tree, facts, is_given), text, tree)
        for name, text, tree in facts.integrals
    ]
    telling = [one for one in kept if one[0].startswith(NAMED) or len(one[1]) <= LONGEST_METER]
    meters = telling[:MOST_METERS] if reveals else []
    if meters and picture.kind == "charge":  # whose speed stays, and its direction does not
        turned = trees.Velocity(system["coordinates"][1])
        meters = [*meters, ("not kept", f"{turned.coordinate}'", turned)]
    time = system.get("time", "t")
    data = played | {
        "time": time,
        "labels": played["labels"] | labels_of([time] if time != "t" else []),
        "free": constrained["free"] if constrained else None,
        "domain": sides,
        "signs": [" > " in text or " < " in text for text in domain] if sides else [],
        "picture": picture.kind,
        "known": _written(picture.trees),
        "meters": [listed(tree) for _, _, tree in meters],
    }
    data |= multiplied(facts)
    said = tuple(
        (name, facts.said(text) if len(text) <= LONGEST_METER else "") for name, text, _ in meters
    )
    agreement = None
    if beside is not None:
        lines = {"picture": beside.kind, "known": _written(beside.trees), "meters": []}
        agreement = Shown(data | lines, beside.caption, (), _rows_of_sliders(data))
    return Shown(data, picture.caption, said, _rows_of_sliders(data), agreement)


def values_of(result: Mapping[str, Any], moving: Moving) -> dict[str, float]:
    """The values of the constants with which a picture begins: the given ones, or those of a general member."""
    system = result["system"]
    given = system["given"].get("parameters") if isinstance(system.get("given"), Mapping) else None
    values = given if isinstance(given, Mapping) else {}
    parameters = tuple(system["parameters"])
    known = {name: float(Fraction(values[name])) for name in parameters if values.get(name)}
    statements = stated.main_statements(result) if "verdict" in result else []
    excepted = [text for one in statements for text in one.part.get("exceptions") or ()]
    letters = nm.Names(moving.names.coordinates, parameters)
    return constants.general_values(letters, moving.accelerations, known, excepted)


def with_conditions(result: Mapping[str, Any], shown: Shown) -> Shown:
    """The motion of a member of a family with the conditions on g as lines, where they can be
    drawn.
    """
    moving = moving_of(result)
    with suppress(errors.InputError, ValueError):
        facts = moving and facts_of(result, moving, shown.data["values"], (), True)
        picture = facts and pictures.lines_of(facts)
        if picture:
            lines = {"picture": picture.kind, "known": _written(picture.trees)}
            return replace(shown, data={**shown.data, **lines}, caption=picture.caption)
    return shown


def _rows_of_sliders(data: Mapping[str, Any]) -> int:
    """As the script makes them: parameters, and the free velocities of several coordinates if there is room for all."""
    free = data["free"] if data["free"] is not None else data["coordinates"]
    return rows_of_sliders(len(data["values"]), len(free) * (len(data["coordinates"]) > 1))


def rows_of_sliders(parameters: int, velocities: int) -> int:
    """The rows of sliders for so many parameters, and so many velocities if there is room for all."""
    count = min(MOST_SLIDERS, parameters)
    return -(-(count + (velocities if count + velocities <= MOST_SLIDERS else 0)) // 3)


def facts_of(
    result: Mapping[str, Any],
    moving: Moving,
    values: Mapping[str, float],
    angles: tuple[str, ...],
    reveals: bool,
) -> pictures.Facts:
    """What the result says of the motion; without `reveals` the equations alone."""
    facts = pictures.Facts(
        moving.names, moving.accelerations, angles, result["system"].get("time", "t"), values,
        constraints=moving.constraints, velocities=moving.velocities,
    )  # fmt: skip
    if stated.is_constrained(result):  # a motion that is given by itself has no Lagrangian
        part = result.get("nonholonomic") or {}
        given = part.get("lagrangian")
        known = replace(facts, lagrangian=moving.read(given["text"])) if given else facts
        return replace(known, integrals=tuple(_kept_of(part, moving))) if reveals else known
    if not reveals:
        return facts
    if "verdict" not in result:  # a Lagrangian with its equations
        given = moving.read(result["lagrangian"]["text"])
        kept = tuple(_kept_of({"first_integrals": result.get("conserved")}, moving))
        return replace(facts, lagrangian=given, integrals=kept)
    branches = stated.branches_of(result)
    shown = {**branches[0], **stated.main_statements(result)[0].part}
    if len(branches) > 1:
        cases = [
            (", ".join(joined.in_ranges(texts)), tuple(map(moving.read, texts)))
            for one in branches
            if (texts := one["domain"])
        ]
        here = {*moving.names.coordinates}
        here |= {f"{name}'" for name in here} if len(here) == 1 else set()
        is_of_places = len(moving.names.coordinates) <= 2 and all(
            _names_in(side) <= here for _, sides in cases for side in sides
        )
        return (
            replace(facts, cases=tuple(cases))
            if len(cases) == len(branches) and is_of_places
            else facts
        )
    # An L with functions that are known by their derivatives alone has no values.
    text = None if stated.auxiliary_of(shown) else (shown.get("lagrangian") or {}).get("text")
    tensors, conditions = None, result.get("conditions") or {}
    is_known = text or shown.get("verdict") == "not_variational"
    is_drawn = is_known and len(moving.accelerations) == 2
    if is_drawn and conditions.get("Phi") and conditions.get("nabla_Phi"):
        first, second = (
            [list(map(moving.read, row)) for row in conditions[key]] for key in ("Phi", "nabla_Phi")
        )
        tensors = (first, second)
    return replace(
        facts,
        lagrangian=moving.read(text) if text else None,
        integrals=tuple(_kept_of(shown, moving)),
        tensors=tensors,
    )


def _meter_name(name: str, tree: trees.Expression, facts: pictures.Facts, is_given: bool) -> str:
    """What a conserved quantity is called: energy only if it is a polynomial in the velocities, and
    for a single equation only without forces that depend on the velocity, or where L is given.

    A damped oscillator has an L without t, a fall with drag g - k v^2 one with exp(2 k y): what
    these conserve is not the energy.
    """
    polynomial = trees.reading_class(tree, trees.TIME) < 2
    is_one = len(facts.accelerations) == 1 and not is_given
    resisted = is_one and any(trees.has(f, trees.Velocity) for f in facts.accelerations)
    return name if name != "energy" or (polynomial and not resisted) else "conserved"


def _kept_of(
    shown: Mapping[str, Any], moving: Moving
) -> Iterable[tuple[str, str, trees.Expression]]:
    """The conserved quantities that can be computed."""
    for one in shown.get("first_integrals") or ():
        with suppress(errors.InputError):
            yield one["name"], one["text"], moving.read(one["text"])


def _names_in(tree: trees.Expression) -> set[str]:
    """The names of coordinates, of velocities with a prime, and of parameters in a tree."""
    leaves = (node for node in trees.walk(tree) if isinstance(node, trees.Symbol | trees.Velocity))
    return {
        leaf.name if isinstance(leaf, trees.Symbol) else f"{leaf.coordinate}'" for leaf in leaves
    }


def _written(known: Any) -> Any:
    """What a picture knows, its trees as lists; a list of trees is {"list": […]}, since a tree is a list, too."""
    if isinstance(known, Mapping):
        return {name: _written(one) for name, one in known.items()}
    if isinstance(known, list | tuple):
        return {"list": [_written(one) for one in known]}
    return listed(known) if isinstance(known, trees.Expression) else known


def labels_of(names: Iterable[str]) -> dict[str, str]:
    """The names as the picture shows them: Greek letters, and numbers as subscripts."""
    return {name: _label(name) for name in names}


def _label(name: str) -> str:
    letter, below = printing.body_and_subscript(name)
    if not all(word.isdigit() for word in below):
        return printing.displayed_name(name)
    return printing.displayed_name(letter) + "\u202f".join(
        word.translate(SUBSCRIPTS) for word in below
    )


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
        case trees.Apply(function, argument) if function not in functions.SPECIAL:
            return [function, listed(argument)]
    raise errors.InputError("The picture has no values of a function in the equations.")


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
    texts = [
        system["lagrangian"] or "0",
        *system["constraints"],
        *(system["equations"] or {}).values(),
    ]
    try:
        return angles_of(
            system["coordinates"], [reader.read_formula(text, names) for text in texts]
        )
    except errors.InputError:
        return []


def picture_of_texts(system: Mapping[str, Any]) -> dict[str, Any]:
    """The picture of a simulated system, as far as it needs no values of formulas."""
    names = nm.Names(tuple(system["coordinates"]), tuple(system["parameters"]))
    try:
        lagrangian = (
            reader.read_formula(system["lagrangian"], names) if system["lagrangian"] else None
        )
        constraints = tuple(reader.read_formula(text, names) for text in system["constraints"])
    except errors.InputError:
        return {}
    angles = tuple(angles_of_texts(system))
    picture = pictures.picture_of(
        pictures.Facts(names, (), angles, lagrangian=lagrangian, constraints=constraints)
    )
    return {
        "picture": picture.kind,
        "known": {k: _written(v) for k, v in picture.trees.items() if _is_plain(v)},
    }


def _is_plain(known: Any) -> bool:
    """Whether what a picture knows is numbers of coordinates, or a word, and no formula."""
    if isinstance(known, list):
        return all(map(_is_plain, known))
    return isinstance(known, int | str)


def _plainly(tree: trees.Expression) -> Iterable[trees.Symbol]:
    """The names of a tree that stand in no periodic function."""
    if isinstance(tree, trees.Apply) and tree.function in functions.CIRCULAR:
        return ()
    if isinstance(tree, trees.Symbol):
        return (tree,)
    return (name for part in trees.children(tree) for name in _plainly(part))
