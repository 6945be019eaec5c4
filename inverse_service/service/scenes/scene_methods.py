"""Numbers of a scene, the grid of times, the methods with their settings and labels, the coordinates for circles."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from fractions import Fraction

from api_schemas.scene import MAX_STEPS, SceneDocument, SceneMethod
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.refusals import shorten
from inverse_service.expressions.tree import Number
from inverse_service.integrators.method_table import GEOMETRIC, METHODS, OWN_STEPS
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.plain_data import escape
from inverse_service.simulation.array_values import NoValue, array_value
from inverse_service.simulation.scene_data import Grid, MethodChoice, Requested

MOST_RECORDED = 100_000
MOST_WITH_EVENTS = 2_000_000
_DECIMAL = re.compile(r"[-+]?[0-9]{1,40}(\.[0-9]{0,40})?([eE][-+]?[0-9]{1,3})?")


def number_of(text: str, pointer: str, what: str = "a number") -> float:
    """A number written as 0.1, "1/2" or "pi/4"; InputError for anything else and for what is not finite."""
    if _DECIMAL.fullmatch(text) and math.isfinite(value := float(text)):
        return value
    try:
        tree = read_formula(text, Names(time=False))
        value = float(array_value(tree, {})[0])
    except (InputError, NoValue, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f'\'{shorten(text)}\' is not {what}: write it as in 0.25, "1/4" or "pi/4".', pointer)
    return value


def read_grid(schema: SceneDocument, begin: float = 0.0) -> tuple[Grid, tuple[str, ...]]:
    """Step, number of steps and which are recorded, with a note where that is not every one asked for."""
    step = number_of(schema.step, "/step")
    if step <= 0:
        raise InputError(
            "the step must be a positive number: to run backwards, write -t for t in the system, which turns the signs "
            "of the velocities and of all terms that are odd in them.",
            "/step",
        )
    if (schema.steps is None) == (schema.time is None):
        raise InputError("give either 'steps' or 'time' with 'step'.", "")
    steps = schema.steps or _steps_of(schema, step)
    notes: tuple[str, ...] = ()
    length = None if schema.time is None else number_of(schema.time, "/time")
    if length is not None and abs(steps * step - length) > 1e-9 * length:
        notes = (f"The run takes {steps * step:.10g}, to the first point of the grid beyond {length:.10g}.",)
    if steps > MAX_STEPS:
        raise LimitError(f"the scene has {steps} steps: the limit is {MAX_STEPS}; take a larger step.", "/time")
    every = schema.record_every or 1
    if schema.events:
        if every > 1 or steps > MOST_WITH_EVENTS:
            raise InputError(
                f"events need every step, and at most {MOST_WITH_EVENTS}: leave record_every out.", "/events"
            )
        return Grid(step, steps, 1, begin), notes
    if steps // every <= MOST_RECORDED:
        return Grid(step, steps, min(every, steps), begin), notes
    every = math.ceil(steps / MOST_RECORDED)
    note = f"One step in {every} is recorded, so that at most {MOST_RECORDED} points are kept."
    return Grid(step, steps, every, begin), (*notes, note)


def _steps_of(schema: SceneDocument, step: float) -> int:
    length = number_of(schema.time or "", "/time")
    if length <= 0:
        raise InputError("the time must be a positive number.", "/time")
    count = length / step
    if count > 10 * MAX_STEPS:
        raise LimitError(f"the scene has more than {MAX_STEPS} steps: take a larger step or a shorter time.", "/time")
    return max(1, round(count) if abs(count - round(count)) < 1e-9 * count else math.ceil(count))


INSIDE = {"runge-kutta": "runge_kutta", "stormer-verlet": "variational"}


def read_methods(schema: SceneDocument) -> tuple[Requested, ...]:
    """The methods in the order of the scene, each with a label of its own."""
    found: list[Requested] = []
    for place, given in enumerate(schema.methods or [SceneMethod(method="adaptive")]):
        found.append(_requested(schema, given, f"/methods/{place}"))
    return tuple(_with_distinct_labels(found))


def _requested(schema: SceneDocument, given: SceneMethod, pointer: str) -> Requested:
    verlet = given.method == "stormer-verlet"
    method = INSIDE.get(given.method, given.method)
    alpha = number_of(given.alpha, f"{pointer}/alpha") if given.alpha is not None else 0.5
    if not 0 <= alpha <= 1:
        raise InputError("alpha must be a number from 0 to 1.", f"{pointer}/alpha")
    allowed = METHODS[method].orders
    if given.order is not None and given.order not in allowed:
        choice = f"takes the orders {', '.join(map(str, allowed))}" if allowed else "has no order to choose"
        raise InputError(f"the method {given.method} {choice}.", f"{pointer}/order")
    if method == "exact":
        return Requested(given.label or "exact", method, None, None)
    order = given.order or (allowed[0] if allowed else 2)
    tolerance = _tolerance(given, method, pointer)
    if verlet and (given.alpha is not None or given.symmetrised or given.form != "hamiltonian"):
        raise InputError("stormer-verlet has an order, and no alpha, form or symmetrised.", pointer)
    choice_of = MethodChoice(method, alpha, given.symmetrised, order, given.form, given.guard, tolerance)
    if verlet:
        choice_of = replace(choice_of, alpha=0.0, symmetrised=True, form="verlet")
    shown = ("0" if verlet else _shown(given.alpha, alpha)) if method in GEOMETRIC else None
    constants = [
        (key, number_of(text, f"{pointer}/constants/{escape(key)}")) for key, text in (given.constants or {}).items()
    ]
    return Requested(
        label=given.label or _label(given, shown, order),
        method=method,
        alpha=shown,
        choice=choice_of,
        convention=given.start or schema.start,
        free=given.free_lagrangian,
        constants=tuple(constants),
    )


def _tolerance(given: SceneMethod, method: str, pointer: str) -> float:
    """The relative error that a step may make, of methods that choose their steps."""
    if given.tolerance is None:
        return METHODS[method].tolerance or 0.0
    if method not in OWN_STEPS:
        raise InputError(f"the method {given.method} takes steps, not a tolerance.", f"{pointer}/tolerance")
    tolerance = number_of(given.tolerance, f"{pointer}/tolerance")
    if not 1e-18 <= tolerance <= 0.1:
        raise InputError("the tolerance must be a number from 1e-18 to 0.1.", f"{pointer}/tolerance")
    return tolerance


def _shown(text: str | None, alpha: float) -> str:
    """alpha as a person writes it: 0.5, 1/3."""
    if text is None:
        return f"{alpha:g}"
    tree = read_formula(text, Names(time=False))
    value = tree.value if isinstance(tree, Number) else None
    if value is None or not _is_short(value):
        return f"{value}" if value is not None else f"{alpha:g}"
    return f"{alpha:g}"


def _is_short(value: Fraction) -> bool:
    return Fraction(f"{float(value):g}") == value


def _label(given: SceneMethod, alpha: str | None, order: int) -> str:
    shown = alpha is not None and given.method != "stormer-verlet"
    parts = [given.method, *([str(alpha).replace("/", "_")] if shown else [])]
    if given.order is not None and given.order != 2:
        parts.append(f"order{order}")
    if given.symmetrised:
        parts.append("symmetrised")
    if given.method == "variational" and given.form == "raw":
        parts.append("raw")
    if given.free_lagrangian in ("first", "second", "third"):
        parts.append(str(given.free_lagrangian))
    return "-".join(parts)


def _with_distinct_labels(found: list[Requested]) -> list[Requested]:
    counts: dict[str, int] = {}
    distinct = []
    for one in found:
        counts[one.label] = counts.get(one.label, 0) + 1
        count = counts[one.label]
        distinct.append(one if count == 1 else replace(one, label=f"{one.label}-{count}"))
    return distinct


def read_circle(schema: SceneDocument, names: Names) -> tuple[int, int] | None:
    """The pair of coordinates named, else x and y, else the last two."""
    if schema.circle is not None:
        pair = [names.spelling(name) for name in schema.circle]
        for place, name in enumerate(pair):
            if name not in names.coordinates:
                known = ", ".join(names.coordinates)
                raise InputError(f"this is not a coordinate: the coordinates are {known}.", f"/circle/{place}")
        if pair[0] == pair[1]:
            raise InputError("the two coordinates of the circle are the same: name two.", "/circle")
    elif {"x", "y"} <= set(names.coordinates):
        pair = ["x", "y"]
    elif len(names.coordinates) >= 2:
        pair = list(names.coordinates[-2:])
    else:
        return None
    return names.coordinates.index(pair[0]), names.coordinates.index(pair[1])
