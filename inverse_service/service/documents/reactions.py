"""The forces that hold a motion on its constraints, lambda times the form of one: equations with
such multipliers as a Lagrangian with constraints, and refusals of multipliers that are of no
constraint.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.expressions.refusals import fault
from inverse_service.mechanics import euler_lagrange
from inverse_service.reading import declarations, document_names, names as nm, reader
from inverse_service.reading.rules import multiplier_names
from inverse_service.reading.typed_text import columns_of


class Constrained(NamedTuple):
    """Keys of a document, the texts that they come from, and the names of the multipliers."""

    document: dict[str, Any]
    pointers: list[str]
    multipliers: list[str]


def constrained(texts: Mapping[str, str], declared: declarations.Declared) -> Constrained | None:
    """L and the constraints of equations with multipliers as keys of a document; None where they
    are no such equations.

    With them the pointers of the texts that have the constraints, and the multipliers.
    """
    try:
        names = document_names.known_names(declared, texts).names
        kinds = {
            pointer: replace(names, forms=pointer.startswith("/constraints")) for pointer in texts
        }
        lines = [
            (at, *pair)
            for at, text in texts.items()
            for pair in reader.read_equations(text, kinds[at])
        ]
    except errors.InputError:
        return None
    trees = [(pointer, left - right) for pointer, left, right in lines]
    moving = [tree for _, tree in trees if ex.has(tree, ex.Acceleration)]
    held = [(pointer, tree) for pointer, tree in trees if not ex.has(tree, ex.Acceleration)]
    if len(moving) != len(names.coordinates) or not held:
        return None
    of_positions = [not ex.has(tree, ex.Velocity) for _, tree in held]
    rates = [
        calculus.differentiate_in_time(tree, names.coordinates) if still else tree
        for (_, tree), still in zip(held, of_positions, strict=True)
    ]
    rows = _rows(rates, names.coordinates)
    forces = {
        name: [calculus.differentiate(line, ex.Symbol(name)) for line in moving]
        for name in names.parameters
        if any(ex.holds(line, ex.Symbol(name)) for line in moving)
    }
    named = [name for name in forces if name.startswith(multiplier_names.MULTIPLIERS)]
    reactions = [
        name for name, force in forces.items() if any(_are_parallel(force, row) for row in rows)
    ]
    multipliers = [ex.Symbol(name) for name in named or reactions]
    if not len(multipliers) == len(held) == len(rows):
        return None
    lagrangian = _lagrangian(names, moving, multipliers, rows)
    if lagrangian is None:
        return None
    made = {
        "coordinates": list(names.coordinates),
        "lagrangian": printing.to_text(lagrangian),
        # x^2 + y^2 = l^2 is refused, with its derivative, where it was written
        "constraints": [
            texts[pointer] if still else f"{printing.to_text(tree)} = 0"
            for (pointer, tree), still in zip(held, of_positions, strict=True)
        ],
    }
    return Constrained(
        made, [pointer for pointer, _ in held], [multiplier.name for multiplier in multipliers]
    )


def refuse_other_multipliers(
    forces: Mapping[str, str],
    lagrangian: str,
    constraints: Sequence[str],
    known: Collection[str] | None,
    defined: Collection[str],
) -> None:
    """InputError where the lambda y of d/dt dL/dx' - dL/dx = lambda y, by x, is no reaction of a
    constraint.

    So it is where a lambda that is not known multiplies a constraint in L.
    """
    texts = {
        "/lagrangian": lagrangian,
        **{f"/constraints/{k}": text for k, text in enumerate(constraints)},
    }
    texts |= {f"/forces/{name}": text for name, text in forces.items()}
    if not forces and not any(map(_may_have_a_multiplier, texts.values())):
        return
    try:
        names = document_names.known_names(
            declarations.Declared(parameters="guess"), texts, 1
        ).names
        pairs = [
            pair
            for text in constraints
            for pair in reader.read_equations(text, replace(names, forms=True))
        ]
        given = {
            names.spelling(name.rstrip("'")): reader.read_formula(text, names)
            for name, text in forces.items()
        }
        whole = reader.read_formula(lagrangian, replace(names, energy=True))
    except errors.InputError:
        return  # reported where it is read
    multipliers = [
        ex.Symbol(name)
        for name in names.parameters
        if name.startswith(multiplier_names.MULTIPLIERS)
    ]
    free = dict.fromkeys(multipliers, ex.ZERO)
    if constraints and any(ex.substitute(force, free) != ex.ZERO for force in given.values()):
        raise fault("force next to a constraint", "")
    places = [place for place, name in enumerate(names.coordinates) if name in given]
    forms = [
        [row[k] for k in places]
        for row in _rows([left - right for left, right in pairs], names.coordinates)
    ]
    for multiplier in multipliers:
        force = [calculus.differentiate(given[names.coordinates[k]], multiplier) for k in places]
        if any(entry != ex.ZERO for entry in force) and not any(
            _are_parallel(force, form) for form in forms
        ):
            raise fault("no reaction", "", name=multiplier.name)
        if known is not None and multiplier.name not in known:
            _ask_about_multiplied(
                whole, multiplier, [a - b for a, b in pairs], lagrangian, names, defined
            )


def _may_have_a_multiplier(text: str) -> bool:
    """Whether a text has one, before it is read; every text with other letters than Latin ones may."""
    return not text.isascii() or any(name in text for name in multiplier_names.MULTIPLIERS)


def _ask_about_multiplied(
    whole: ex.Expression,
    multiplier: ex.Symbol,
    held: Sequence[ex.Expression],
    text: str,
    names: nm.Names,
    defined: Collection[str],
) -> None:
    """InputError for the lambda of L + lambda (x^2 + y^2 - l^2): of this constraint, or a constant.

    A constant would not multiply a term in which nothing moves.
    """
    slope = calculus.differentiate(whole, multiplier)
    parts = slope.factors if isinstance(slope, ex.Product) else (slope,)
    terms = [term for part in parts if isinstance(part, ex.Sum) for term in part.terms]
    moving = {ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Velocity, names.coordinates)}
    moving |= set(map(ex.Symbol, defined))  # r of r = sqrt(x^2 + y^2)
    still = [term for term in terms if not moving & {*ex.walk(term)} and ex.has(term, ex.Symbol)]
    is_held = any(_is_zero(slope - tree) or _is_zero(slope + tree) for tree in held)
    if not is_held and not (still and all(isinstance(part, ex.Number | ex.Sum) for part in parts)):
        return
    rest = printing.to_text(ex.substitute(whole, {multiplier: ex.ZERO}))
    meant = rest if is_held else f"{rest}; {printing.to_text(slope)} = 0"
    column = (multiplier_names.place_of_multiplier(text) or 0) + 1
    raise fault("multiplier or constant", column, columns_of(text), (meant,), name=multiplier.name)


def _rows(trees: Iterable[ex.Expression], coordinates: Sequence[str]) -> list[list[ex.Expression]]:
    """w of each w_i v^i + c = 0; none for a tree without velocities, or with others."""
    forms = [euler_lagrange.linear_parts(tree, ex.Velocity) for tree in trees]
    linear = [form[0] for form in forms if isinstance(form, tuple) and form[0]]
    return [[row.get(ex.Velocity(name), ex.ZERO) for name in coordinates] for row in linear]


def _lagrangian(
    names: nm.Names,
    lines: Sequence[ex.Expression],
    multipliers: Sequence[ex.Symbol],
    forms: Sequence[Sequence[ex.Expression]],
) -> ex.Expression | None:
    from inverse_service.mechanics import second_order_system
    from inverse_service.search.row_factors import lagrangian_as_given

    none = dict(dict.fromkeys(multipliers, ex.ZERO))
    free = [ex.substitute(line, none) for line in lines]
    found = lagrangian_as_given(second_order_system.unsolved_system(names, free), free)
    if found is None:
        return None
    accelerations = [ex.Acceleration(name) for name in names.coordinates]
    equations = euler_lagrange.euler_lagrange_residual(found, names.coordinates, accelerations)
    forces = [
        [calculus.differentiate(line, multiplier) for line in lines] for multiplier in multipliers
    ]
    if any(ex.holds(entry, *multipliers) for force in forces for entry in force):
        return None
    left = list(forms)
    for force in forces:
        scaled = [
            _scaled(*part) for part in zip(equations, free, accelerations, force, strict=True)
        ]
        if None in scaled:
            return None
        same = next(
            (
                form
                for form in left
                if _are_parallel([one for one in scaled if one is not None], form)
            ),
            None,
        )
        if same is None:
            return None
        left.remove(same)
    return found


def _scaled(
    equation: ex.Expression,
    line: ex.Expression,
    acceleration: ex.Acceleration,
    force: ex.Expression,
) -> ex.Expression | None:
    """The force times c where the equation of L is c times the line; None where it is no such
    multiple.
    """
    over, under = (calculus.differentiate(tree, acceleration) for tree in (equation, line))
    same = under != ex.ZERO and _is_zero(equation * under - line * over)
    return force * over / under if same else None


def _are_parallel(force: Sequence[ex.Expression], form: Sequence[ex.Expression]) -> bool:
    pairs = combinations(range(len(form)), 2)
    return any(not _is_zero(one) for one in force) and all(
        _is_zero(force[i] * form[j] - force[j] * form[i]) for i, j in pairs
    )


def _is_zero(tree: ex.Expression) -> bool:
    if collecting.collect(tree) == ex.ZERO:
        return True
    from inverse_service.field import exact_field

    with suppress(exact_field.TooLarge, ZeroDivisionError, KeyError):  # sin(x) = cos(x)*tan(x)
        return (
            exact_field.exact_ring([tree], [], None, exact_field.Budget.short()).value(tree).is_zero
        )
    return False
