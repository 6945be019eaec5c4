"""The methods of a scene with their settings and labels, and the pair of coordinates for circles."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from api_schemas.scene import SceneDocument, SceneMethod
from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import Number
from inverse_service.service.documents.reading import escape
from inverse_service.service.scenes.scene_numbers import number_of
from inverse_service.simulation.choices import OWN_STEPS, TOLERANCES, MethodChoice
from inverse_service.simulation.scene import Requested

METHODS = {"runge-kutta": "runge_kutta", "stormer-verlet": "variational"}
ORDERS: dict[str, tuple[int, ...]] = dict.fromkeys(("exact", "reference", *OWN_STEPS), ()) | {"runge_kutta": (4, 5, 8)}
USES_ALPHA = frozenset({"variational", "nonholonomic", "modified"})


def read_methods(schema: SceneDocument) -> tuple[Requested, ...]:
    """The methods in the order of the scene, each with a label of its own."""
    found: list[Requested] = []
    for place, given in enumerate(schema.methods):
        found.append(_requested(schema, given, f"/methods/{place}"))
    return tuple(_with_distinct_labels(found))


def _requested(schema: SceneDocument, given: SceneMethod, pointer: str) -> Requested:
    verlet = given.method == "stormer-verlet"
    method = METHODS.get(given.method, given.method)
    alpha = number_of(given.alpha, f"{pointer}/alpha") if given.alpha is not None else 0.5
    if not 0 <= alpha <= 1:
        raise InputError("alpha must be a number from 0 to 1.", f"{pointer}/alpha")
    allowed = ORDERS.get(method, (2, 4, 6, 8))
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
    shown = ("0" if verlet else _shown(given.alpha, alpha)) if method in USES_ALPHA else None
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
        return TOLERANCES.get(method, 0.0)
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
                raise InputError(f"this is no coordinate: the coordinates are {known}.", f"/circle/{place}")
        if pair[0] == pair[1]:
            raise InputError("the two coordinates of the circle are the same: name two.", "/circle")
    elif {"x", "y"} <= set(names.coordinates):
        pair = ["x", "y"]
    elif len(names.coordinates) >= 2:
        pair = list(names.coordinates[-2:])
    else:
        return None
    return names.coordinates.index(pair[0]), names.coordinates.index(pair[1])
