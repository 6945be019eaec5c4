"""Equations of motion with multipliers as L and constraints: x'' = lambda sin(u), …, x' sin(u) = y' cos(u).

Without multipliers the lines are the Euler-Lagrange equations of a Lagrangian L, each times a factor. The force with
each multiplier has to be a multiple of the form w_i v^i of one constraint (d'Alembert's principle): then the motion is
that of L with the constraints.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from inverse_service import errors
from inverse_service.expressions import collecting, derivative, printing, tree as ex
from inverse_service.mechanics import euler_lagrange, second_order_system
from inverse_service.reading import document_names, reader
from inverse_service.reading.names import Names

_MULTIPLIER = re.compile(r"(?:lambda|mu|Lambda)(?:_?\w+)?")


@dataclass(frozen=True, slots=True)
class Constrained:
    """L and the constraints as texts, with the pointers of the texts that have the constraints."""

    coordinates: list[str]
    multipliers: list[str]
    lagrangian: str
    constraints: list[str]
    pointers: list[str]


def constrained(texts: Mapping[str, str], declared: document_names.Declared) -> Constrained | None:
    """The Lagrangian and the constraints of equations with multipliers; None where they are no such equations."""
    try:
        names = document_names.known_names(declared, texts).names
        kinds = {pointer: replace(names, forms=pointer.startswith("/constraints")) for pointer in texts}
        lines = [(at, *pair) for at, text in texts.items() for pair in reader.read_equations(text, kinds[at])]
    except errors.InputError:
        return None
    moving = [left - right for _, left, right in lines if _holds(left - right, ex.Acceleration)]
    held = [line for line in lines if not _holds(line[1] - line[2], ex.Acceleration)]
    forms = [_form(left - right, names.coordinates) for _, left, right in held]
    multipliers = [
        ex.Symbol(name)
        for name in names.parameters
        if _MULTIPLIER.fullmatch(name) and any(ex.holds(line, ex.Symbol(name)) for line in moving)
    ]
    if len(moving) != len(names.coordinates) or not held or len(multipliers) != len(held) or None in forms:
        return None
    lagrangian = _lagrangian(names, moving, multipliers, [form for form in forms if form])
    if lagrangian is None:
        return None
    return Constrained(
        list(names.coordinates),
        [multiplier.name for multiplier in multipliers],
        printing.to_text(lagrangian),
        [f"{printing.to_text(left)} = {printing.to_text(right)}" for _, left, right in held],
        [pointer for pointer, _, _ in held],
    )


def _holds(tree: ex.Expression, kind: type[ex.Expression]) -> bool:
    return any(isinstance(node, kind) for node in ex.walk(tree))


def _form(tree: ex.Expression, coordinates: Sequence[str]) -> list[ex.Expression] | None:
    """w of w_i v^i + c = 0; None where no velocity occurs, or one occurs otherwise."""
    slopes = [derivative.differentiate(tree, ex.Velocity(name)) for name in coordinates]
    if not _holds(tree, ex.Velocity) or any(_holds(slope, ex.Velocity) for slope in slopes):
        return None
    return slopes


def _lagrangian(
    names: Names,
    lines: Sequence[ex.Expression],
    multipliers: Sequence[ex.Symbol],
    forms: Sequence[Sequence[ex.Expression]],
) -> ex.Expression | None:
    from inverse_service.search.row_factors import lagrangian_as_given

    none = dict[ex.Expression, ex.Expression](dict.fromkeys(multipliers, ex.ZERO))
    free = [ex.substitute(line, none) for line in lines]
    found = lagrangian_as_given(second_order_system.unsolved_system(names, free), free)
    if found is None:
        return None
    accelerations = [ex.Acceleration(name) for name in names.coordinates]
    equations = euler_lagrange.euler_lagrange_residual(found, names.coordinates, accelerations)
    forces = [[derivative.differentiate(line, multiplier) for line in lines] for multiplier in multipliers]
    if any(ex.holds(entry, *multipliers) for force in forces for entry in force):
        return None
    left = list(forms)
    for force in forces:
        scaled = [_scaled(*part) for part in zip(equations, free, accelerations, force, strict=True)]
        if None in scaled:
            return None
        same = next((form for form in left if _are_parallel([one for one in scaled if one is not None], form)), None)
        if same is None:
            return None
        left.remove(same)
    return found


def _scaled(
    equation: ex.Expression, line: ex.Expression, acceleration: ex.Acceleration, force: ex.Expression
) -> ex.Expression | None:
    """The force times c where the equation of L is c times the line; None where it is no such multiple."""
    over, under = (derivative.differentiate(tree, acceleration) for tree in (equation, line))
    same = under != ex.ZERO and _is_zero(equation * under - line * over)
    return force * over / under if same else None


def _are_parallel(force: Sequence[ex.Expression], form: Sequence[ex.Expression]) -> bool:
    pairs = combinations(range(len(form)), 2)
    return any(not _is_zero(one) for one in force) and all(
        _is_zero(force[i] * form[j] - force[j] * form[i]) for i, j in pairs
    )


def _is_zero(tree: ex.Expression) -> bool:
    return collecting.collect(tree) == ex.ZERO
