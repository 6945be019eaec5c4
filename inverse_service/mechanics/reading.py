"""Documents to systems: all forms of coordinates, equations, parameters and functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.equations import read_equation
from inverse_service.expressions.limits import LIMITS
from inverse_service.expressions.names import Names, check_clashes, declared_name
from inverse_service.expressions.reader import read_formula, split_equations
from inverse_service.expressions.tokens import joined, shorten
from inverse_service.expressions.tree import (
    Acceleration,
    Expression,
    subtract,
)
from inverse_service.mechanics.coordinate_names import inferred_coordinates, key_coordinate
from inverse_service.mechanics.implicit_equations import solve_accelerations
from inverse_service.mechanics.linear_parts import has_acceleration, linear_equation
from inverse_service.mechanics.parameter_values import ParameterValue, parameter_values, with_values
from inverse_service.mechanics.second_order_system import FunctionDeclaration, SecondOrderSystem

Equations = Mapping[str, str] | Sequence[str] | str
Parameters = Sequence[str] | Mapping[str, ParameterValue]
NO_ACCELERATION = (
    "the equations contain no acceleration such as x'', x_ddot, \\ddot{x} or diff(x, t, 2), so there are no "
    'coordinates: write equations of second order in the time t, or name the "coordinates".'
)
_Equation = tuple[Expression, Expression, str]  # left side, right side, pointer


def read_system(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: Parameters = (),
    functions: Mapping[str, Sequence[str]] | None = None,
    name: str = "",
) -> SecondOrderSystem:
    """The system q'' = f of a document.

    `coordinates` left out are the keys of `equations`, or the names with two primes in it, in their
    order. `equations` gives each acceleration, or whole equations (a list, or a text) that are solved
    for the accelerations. Parameters with a value are replaced by it exactly. InputError with JSON
    pointer and column for anything that is wrong, LimitError for more than `LIMITS.coordinates`.
    """
    names, found = _understood(coordinates, equations, parameters, functions or {})
    return SecondOrderSystem(
        coordinates=names.coordinates,
        accelerations=_accelerations(found, names.coordinates),
        parameters=names.parameters,
        functions=tuple(FunctionDeclaration(function, arguments) for function, arguments in names.functions.items()),
        name=name,
    )


@dataclass(frozen=True, slots=True)
class GivenEquations:
    """What a document says before anything is solved: its names, parameters with a value left out, and E = 0."""

    names: Names
    residuals: tuple[Expression, ...]


def read_given(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: Parameters = (),
    functions: Mapping[str, Sequence[str]] | None = None,
) -> GivenEquations:
    """The equations of a document as they stand, left side minus right side; InputError as in `read_system`."""
    names, found = _understood(coordinates, equations, parameters, functions or {})
    return GivenEquations(names, tuple(subtract(left, right) for left, right, _ in found))


def _understood(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: Parameters,
    functions: Mapping[str, Sequence[str]],
) -> tuple[Names, list[_Equation]]:
    """The names without the parameters that have values, and the equations with these values put in."""
    names = _names(coordinates, equations, parameters, functions)
    found = _read(equations, names)
    values = parameter_values(parameters)
    generic = tuple(parameter for parameter in names.parameters if parameter not in values)
    return replace(names, parameters=generic), [
        (with_values(left, values), with_values(right, values), pointer) for left, right, pointer in found
    ]


def read_names(
    coordinates: Sequence[str], parameters: Parameters = (), functions: Mapping[str, Sequence[str]] | None = None
) -> Names:
    """The declared names, checked; InputError with the pointer of a name that cannot be declared."""
    return _names(coordinates, (), parameters, functions or {})


def escaped(key: str) -> str:
    """A key as a part of a JSON pointer (RFC 6901)."""
    return key.replace("~", "~0").replace("/", "~1")


def _names(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: Parameters,
    functions: Mapping[str, Sequence[str]],
) -> Names:
    keyed = isinstance(parameters, Mapping)
    declared = tuple(
        declared_name(parameter, f"/parameters/{escaped(parameter) if keyed else place}", "parameter")
        for place, parameter in enumerate(_bounded(list(parameters), "/parameters", "parameters", LIMITS.names))
    )
    arguments = {
        declared_name(key, f"/functions/{escaped(key)}", "function"): _arguments(key, words)
        for key, words in functions.items()
    }
    _bounded(list(functions), "/functions", "functions", LIMITS.names)
    found = _coordinates(coordinates, equations, declared, arguments)
    names = Names(found, declared, arguments)
    check_clashes(names, keyed)
    return replace(names, functions=_checked_functions(names, equations))


def _bounded(words: list[str], pointer: str, what: str, most: int) -> list[str]:
    if len(words) > most:
        raise LimitError(f"there are {len(words)} {what}: the limit is {most}; declare fewer.", pointer)
    return words


def _arguments(function: str, words: Sequence[str]) -> tuple[str, ...]:
    pointer = f"/functions/{escaped(function)}"
    if isinstance(words, str) or not words:
        raise InputError(
            f"the function {shorten(function)} has no list of arguments: name the coordinates it depends on, "
            'as in ["r1"].',
            pointer,
        )
    _bounded(list(words), pointer, "arguments", LIMITS.function_arguments)
    return tuple(
        "t" if word == "t" else declared_name(word, f"{pointer}/{place}", "argument")
        for place, word in enumerate(words)
    )


def _checked_functions(names: Names, equations: Equations) -> dict[str, tuple[str, ...]]:
    """The functions over coordinates; one over other names is refused where it occurs, and left out where not."""
    foreign: dict[str, int] = {}
    for function, arguments in names.functions.items():
        for place, argument in enumerate(arguments):
            if argument in arguments[:place]:
                pointer = f"/functions/{function}/{place}"
                raise InputError(f"{function} has the argument {argument} twice: name it once.", pointer)
            if argument != "t" and argument not in names.coordinates:
                foreign.setdefault(function, place)
    for function, place in foreign.items():
        if not equations or any(function in text for text in _texts(equations)):
            raise InputError(
                f"{function} depends on {names.functions[function][place]}, which is not a coordinate: use one of "
                f"{joined(names.coordinates)}.",
                f"/functions/{function}/{place}",
            )
    return {function: arguments for function, arguments in names.functions.items() if function not in foreign}


def _texts(equations: Equations) -> list[str]:
    if isinstance(equations, str):
        return [equations]
    return [str(text) for text in (equations.values() if isinstance(equations, Mapping) else equations)]


def _coordinates(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: tuple[str, ...],
    functions: Mapping[str, tuple[str, ...]],
) -> tuple[str, ...]:
    if coordinates is None:
        declared = Names((), parameters, functions)
        found = inferred_coordinates(equations, declared)
        pointer = "/equations"
        if equations and not found:
            raise InputError(NO_ACCELERATION, pointer)
    else:
        pointer = "/coordinates"
        found = tuple(declared_name(word, f"{pointer}/{place}", "coordinate") for place, word in enumerate(coordinates))
    if not found:
        raise InputError("there are no coordinates: name at least one, or write equations that contain x''.", pointer)
    _bounded(list(found), pointer, "coordinates", LIMITS.coordinates)
    return found


def _read(equations: Equations, names: Names) -> list[_Equation]:
    if isinstance(equations, str):
        return _whole_equations(equations, names, "/equations")
    if isinstance(equations, Mapping):
        return _keyed_equations(equations, names)
    _bounded(list(equations), "/equations", "equations", LIMITS.coordinates)
    return [
        equation
        for place, text in enumerate(equations)
        for equation in _whole_equations(text, names, f"/equations/{place}")
    ]


def _whole_equations(text: str, names: Names, pointer: str) -> list[_Equation]:
    try:
        groups = split_equations(_text(text), names)
        if len(groups) > LIMITS.coordinates:
            most = LIMITS.coordinates
            raise LimitError(f"there are {len(groups)} equations: the limit is {most}; write fewer.")
        return [(*read_equation(group, names), pointer) for group in groups]
    except InputError as error:
        raise error.at(pointer) from None


def _text(value: object) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    if not isinstance(value, str):
        raise InputError('an equation is not a text: write it in quotation marks, as in "-x".')
    return value


def _keyed_equations(equations: Mapping[str, str], names: Names) -> list[_Equation]:
    found: dict[str, _Equation] = {}
    for key, value in equations.items():
        pointer = f"/equations/{escaped(key)}"
        coordinate = key_coordinate(key, names, pointer)
        if coordinate in found:
            raise InputError(f"there are two equations for {coordinate}: leave one out.", pointer)
        found[coordinate] = (Acceleration(coordinate), _right_side(value, coordinate, names, pointer), pointer)
    for coordinate in names.coordinates:
        if coordinate not in found:
            raise InputError(
                f"the equation of {coordinate} is missing: add {coordinate} with its acceleration, 0 if it has none.",
                "/equations",
            )
    return [found[coordinate] for coordinate in names.coordinates]


def _right_side(value: str, coordinate: str, names: Names, pointer: str) -> Expression:
    try:
        text = _text(value)
        if "=" not in text:
            return read_formula(text, names)
        groups = split_equations(text, names)
        if len(groups) != 1:
            raise InputError("several equations stand here: write only the acceleration.", column=1)
        left, right = read_equation(groups[0], names)
        if left != Acceleration(coordinate):
            raise InputError(f"the left side is not {coordinate}'': write only the acceleration.", column=1)
        return right
    except InputError as error:
        raise error.at(pointer) from None


def _accelerations(found: list[_Equation], coordinates: tuple[str, ...]) -> tuple[Expression, ...]:
    explicit = {left.coordinate: right for left, right, _ in found if isinstance(left, Acceleration)}
    solved = not any(has_acceleration(right) for right in explicit.values())
    if solved and len(explicit) == len(found) == len(coordinates):
        return tuple(explicit[coordinate] for coordinate in coordinates)
    residuals = [linear_equation(subtract(left, right), pointer) for left, right, pointer in found]
    return solve_accelerations(residuals, coordinates)
