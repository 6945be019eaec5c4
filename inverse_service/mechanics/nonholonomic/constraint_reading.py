"""Texts of a Lagrangian and of constraints to a nonholonomic system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ZERO, Expression, Symbol, Velocity, substitute, walk
from inverse_service.mechanics.nonholonomic.geometry import NonholonomicSystem
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion, motion_on
from inverse_service.reading.document_names import Declared, Parameters, known_names, parameter_values, with_values
from inverse_service.reading.names import Names, escaped
from inverse_service.reading.reader import placed_at, read_equations, read_formula, without_accelerations

# Coordinates of a system with constraints.
MOST_CONSTRAINED = 12


def read_nonholonomic(
    coordinates: Sequence[str] | None,
    lagrangian: str,
    constraints: Sequence[str] | str,
    parameters: Parameters = (),
    functions: Mapping[str, Sequence[str]] | None = None,
    name: str = "",
    most: int = MOST_CONSTRAINED,
    where: Mapping[str, str] | None = None,
) -> NonholonomicSystem:
    """The system of a document; a constraint is a formula that is zero, or an equation.

    `constraints` is a list, or one text with the constraints separated by semicolons. InputError with
    JSON pointer and column for anything that is wrong, LimitError for too many coordinates.
    """
    declared = Declared(coordinates, parameters, functions or {}, where or {}, most)
    known = known_names(declared, {"/lagrangian": lagrangian, **_by_pointer(constraints)}, order=1)
    names = known.remaining()
    return NonholonomicSystem(
        coordinates=names.coordinates,
        lagrangian=known.put_in(read_lagrangian(lagrangian, known.names)),
        constraints=tuple(known.put_in(tree) for tree in _constraints(constraints, known.names, most)),
        parameters=names.parameters,
        functions=tuple(names.functions.items()),
        name=name,
    )


def read_motion(
    coordinates: Sequence[str] | None,
    motion: Mapping[str, str],
    constraints: Sequence[str] | str,
    parameters: Parameters = (),
    functions: Mapping[str, Sequence[str]] | None = None,
    where: Mapping[str, str] | None = None,
) -> ConstrainedMotion:
    """A motion given by the accelerations of the free coordinates on the constraints.

    InputError where the free coordinates are not as many as the constraints leave, or do not fix the others.
    """
    texts = {f"/motion/{name}": text for name, text in motion.items()}
    declared = Declared(coordinates or None, parameters, functions or {}, where or {}, MOST_CONSTRAINED)
    known = known_names(declared, texts | _by_pointer(constraints), order=1)
    names, trees = known.remaining(), _constraints(constraints, known.names, MOST_CONSTRAINED)
    free = {known.names.spelling(name): name for name in motion}
    strange = next((name for key, name in free.items() if key not in names.coordinates), None)
    if strange is not None:
        raise InputError(f"there is a motion for '{strange}', which is not a coordinate.", "/motion")
    if len(free) + len(trees) != len(names.coordinates):
        raise InputError(
            f"{len(names.coordinates)} coordinates with {len(trees)} constraints leave "
            f"{len(names.coordinates) - len(trees)} free velocities: give their accelerations, not {len(free)}.",
            "/motion",
        )
    system = NonholonomicSystem(
        names.coordinates, ZERO, tuple(map(known.put_in, trees)), names.parameters, tuple(names.functions.items())
    )
    read = {
        key: known.put_in(_formula(motion[name], known.names, f"the acceleration of {name}", f"/motion/{name}"))
        for key, name in free.items()
    }
    return motion_on(system, read)


def _formula(text: str, names: Names, what: str, pointer: str) -> Expression:
    with placed_at(pointer):
        tree = substitute(read_formula(text, names), dict(names.definitions))
    return without_accelerations(tree, what, pointer)


def read_lagrangian(text: str, names: Names) -> Expression:
    """L(t, q, q') of a text; InputError where an acceleration is in it, or no velocity."""
    pointer = "/lagrangian"
    tree = _formula(text, names, "the Lagrangian", pointer)
    if not any(isinstance(node, Velocity) for node in walk(tree)):
        raise InputError("the Lagrangian contains no velocity: write kinetic minus potential energy.", pointer)
    return _smooth(tree, pointer)


def _smooth(tree: Expression, pointer: str) -> Expression:
    """The tree; InputError where it is piecewise and its derivatives are looked for."""
    with placed_at(pointer):
        for leaf in {node for node in walk(tree) if isinstance(node, Symbol | Velocity)}:
            differentiate(tree, leaf)
    return tree


def _constraints(constraints: Sequence[str] | str, names: Names, most: int) -> list[Expression]:
    found: list[Expression] = []
    for pointer, text in _by_pointer(constraints).items():
        with placed_at(pointer):
            pairs = read_equations(text, replace(names, forms=True))
        for left, right in pairs:
            tree = substitute(left - right, dict(names.definitions))
            found.append(_smooth(without_accelerations(tree, f"constraint {len(found) + 1}", pointer), pointer))
    if not found:
        raise InputError(
            "there are no constraints: give at least one, or send the equations of motion as a system.", "/constraints"
        )
    if len(found) > most:
        raise LimitError(f"there are {len(found)} constraints: the limit is {most}; write fewer.", "/constraints")
    return found


def _by_pointer(constraints: Sequence[str] | str) -> dict[str, str]:
    if isinstance(constraints, str):
        return {"/constraints": constraints}
    return {f"/constraints/{place}": text for place, text in enumerate(constraints)}


def read_multiples(
    multiples: Mapping[str, str],
    system: NonholonomicSystem,
    parameters: Parameters,
    pointer: str = "/multiples",
) -> tuple[Expression, ...]:
    """What a user adds to each acceleration, in the order of the coordinates; 0 where nothing is said.

    InputError for a key that is no coordinate, and for what `read_formula` refuses.
    """
    named = Declared(parameters=parameters).named_parameters()
    known = tuple(dict.fromkeys((*system.parameters, *named)))
    names = Names(system.coordinates, known, dict(system.functions))
    values = parameter_values(named)
    found: dict[str, Expression] = {}
    for key, text in multiples.items():
        place = f"{pointer}/{escaped(key)}"
        name = names.spelling(key)
        if name not in system.coordinates:
            raise InputError(
                f"there is a multiple for a name that is not a coordinate: the coordinates are "
                f"{', '.join(system.coordinates)}.",
                place,
            )
        with placed_at(place):
            tree = with_values(read_formula(text, names), values)
        found[name] = without_accelerations(tree, f"the multiple for {name}", place)
    zero = read_formula("0", names)
    return tuple(found.get(name, zero) for name in system.coordinates)
