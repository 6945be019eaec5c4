"""The names of a document: declared, found in its formulas, or guessed where it asks for that.

Values of parameters, put in exactly.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from inverse_service import errors
from inverse_service.expressions import refusals
from inverse_service.expressions import tree as ex
from inverse_service.reading import guessing, moving_names, reader
from inverse_service.reading.names import (
    Names,
    check_clashes,
    check_domain,
    declared_name,
    escaped,
    refuse_two_spellings,
)
from inverse_service.reading.tokens import closing

ParameterValue = str | int | float | None


def parameter_values(parameters: Sequence[str] | Mapping[str, ParameterValue]) -> dict[str, ex.Expression]:
    """The values given, as trees; a parameter without a value (None) stays generic and is left out.

    A value is a number or a constant such as "1/2", "sqrt(2)" or "2*pi"; a float stands for its
    shortest decimal form. InputError with the pointer of the parameter for anything else.
    """
    if not isinstance(parameters, Mapping):
        return {}
    values = {}
    for name, value in parameters.items():
        pointer = f"/parameters/{escaped(name)}"
        if value is not None:
            values[declared_name(name, pointer, "parameter")] = _constant(value, pointer)
    return values


def _constant(value: str | int | float, pointer: str) -> ex.Expression:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise errors.InputError('the value of a parameter is not a number: write it as in "1/2".', pointer)
    text = value if isinstance(value, str) else repr(value) if isinstance(value, float) else _digits(value, pointer)
    try:
        return reader.read_formula(text, Names(time=False))
    except errors.InputError as error:
        if error.declare:
            detail = 'the value of a parameter contains a name: write a number as in "1/2" or "2*pi", or use "where".'
            raise errors.InputError(detail, pointer, error.column) from None
        raise error.at(pointer) from None


def _digits(value: int, pointer: str) -> str:
    if value.bit_length() > 4_000:  # str of a huge integer is slow, and refused by Python
        raise errors.InputError("the value of a parameter has too many digits: write a smaller number.", pointer)
    return str(value)


def with_values(expression: ex.Expression, values: Mapping[str, ex.Expression]) -> ex.Expression:
    """The tree with the values put in; InputError where it then has no value (1/0, log of 0)."""
    if not values:
        return expression
    result = ex.substitute(expression, {ex.Symbol(name): value for name, value in values.items()})
    for node in ex.walk(result):
        _check_defined(node)
    return result


def _check_defined(node: ex.Expression) -> None:
    match node:
        case ex.Power(ex.Number(base), ex.Number(exponent)):
            undefined = (base == 0 and exponent < 0) or (base < 0 and exponent.denominator != 1)
        case ex.Apply(function, argument):
            try:
                check_domain(function, argument, 1)
                undefined = False
            except errors.InputError:
                undefined = True
        case _:
            undefined = False
    if undefined:
        raise errors.InputError(
            "with these values of the parameters a formula has no real value (a division by zero, a root or a "
            "logarithm): give other values.",
            "/parameters",
        )


Parameters = Sequence[str] | Mapping[str, ParameterValue] | str
GUESS = "guess"
AND_GUESS = "..."
NO_ACCELERATION = (
    "the equations contain no acceleration such as x'', x_ddot, \\ddot{x} or diff(x, t, 2), so there are no "
    "coordinates: write equations of second order in the time t, or name the coordinates."
)


@dataclass(frozen=True, slots=True)
class Declared:
    """What a document says of its names. `parameters` may be "guess", or have the entry "..." for: guess the rest.

    `where` are formulas that stand for a name, put in exactly. At most `most` coordinates are accepted.
    """

    coordinates: Sequence[str] | None = None
    parameters: Parameters = ()
    functions: Mapping[str, Sequence[str]] = field(default_factory=dict)
    where: Mapping[str, str] = field(default_factory=dict)
    most: int = refusals.LIMITS.coordinates

    @property
    def guesses(self) -> bool:
        """Whether undeclared names are to be taken as constants."""
        return self.parameters == GUESS or (not isinstance(self.parameters, str) and AND_GUESS in self.parameters)

    def named_parameters(self) -> Sequence[str] | Mapping[str, ParameterValue]:
        """The parameters that are named, with their values where these are given."""
        if isinstance(self.parameters, str):
            return ()
        if isinstance(self.parameters, Mapping):
            return {name: value for name, value in self.parameters.items() if name != AND_GUESS}
        return [name for name in self.parameters if name != AND_GUESS]


@dataclass(frozen=True, slots=True)
class Known:
    """The names of a document, and what is put in for those that have a formula or a value."""

    names: Names
    definitions: Mapping[ex.Expression, ex.Expression]
    values: Mapping[str, ex.Expression]

    def put_in(self, tree: ex.Expression) -> ex.Expression:
        """The tree with definitions and values; InputError where it then has no value."""
        return with_values(ex.substitute(tree, dict(self.definitions)) if self.definitions else tree, self.values)

    def remaining(self) -> Names:
        """The names that can still occur after that."""
        gone = {*self.values, *(node.name for node in self.definitions if isinstance(node, ex.Symbol))}
        parameters = tuple(name for name in self.names.parameters if name not in gone)
        return replace(self.names, parameters=parameters, definitions={})


def known_names(
    declared: Declared, texts: Mapping[str, str], order: int = 2, keys: Sequence[str] = (), pairs: bool = False
) -> Known:
    """The names that the formulas of a document may use, and what they stand for; see `document_names`."""
    where = {f"/where/{escaped(name)}": text for name, text in declared.where.items()}
    names = document_names(declared, {**texts, **where}, order, keys, pairs)
    definitions = _definitions(declared.where, names)
    values = parameter_values(declared.named_parameters())
    return Known(replace(names, definitions=definitions), definitions, values)


def _definitions(where: Mapping[str, str], names: Names) -> dict[ex.Expression, ex.Expression]:
    """Each name of `where` with its formula, in which no such name is left; InputError where they go in a circle."""
    pointers = {declared_name(name, f"/where/{escaped(name)}"): f"/where/{escaped(name)}" for name in where}
    texts = dict(zip(pointers, where.values(), strict=False))
    found: dict[ex.Expression, ex.Expression] = {}
    name = ""
    try:
        used = {name: _names_in(text, names) & texts.keys() for name, text in texts.items()}
        for name in _ordered(used):
            found[ex.Symbol(name)] = ex.substitute(
                reader.read_formula(texts[name], replace(names, definitions=found)), found
            )
    except errors.InputError as error:
        raise error if error.pointer else error.at(pointers[name]) from None
    return found


def _ordered(used: Mapping[str, set[str]]) -> list[str]:
    """The names so that each comes after those that its formula uses; InputError where they go in a circle."""
    done: dict[str, None] = {}
    while len(done) < len(used):
        ready = [name for name in used if name not in done and used[name] <= done.keys()]
        if not ready:
            path = [next(name for name in used if name not in done)]
            while path[-1] not in path[:-1]:
                path.append(min(used[path[-1]] - done.keys()))
            detail = f"the formula of {path[-1]} leads back to {path[-1]}: define it by other names."
            raise errors.InputError(detail, f"/where/{path[-1]}")
        done |= dict.fromkeys(ready)
    return list(done)


def _names_in(text: str, names: Names) -> set[str]:
    """The names that stand in a formula."""
    return {names.spelling(token.text) for token in reader.read_tokens(text, names) if token.kind == "name"}


def document_names(
    declared: Declared, texts: Mapping[str, str], order: int = 2, keys: Sequence[str] = (), pairs: bool = False
) -> Names:
    """The names that the formulas of a document may use; InputError with the pointer of one that is wrong.

    `texts` are the formulas by their pointers, `order` is that of the derivative that makes a coordinate, and
    `keys` are those of `equations`, where each is the equation of a coordinate. `pairs`: the coordinates found are
    those of first-order equations, momenta among them.
    """
    named = declared.named_parameters()
    keyed = isinstance(named, Mapping)
    parameters = tuple(
        declared_name(parameter, f"/parameters/{escaped(parameter) if keyed else place}", "parameter")
        for place, parameter in enumerate(bounded(list(named), "/parameters", "parameters", refusals.LIMITS.names))
    )
    functions = {
        declared_name(key, f"/functions/{escaped(key)}", "function"): _arguments(key, words)
        for key, words in declared.functions.items()
    }
    bounded(list(declared.functions), "/functions", "functions", refusals.LIMITS.names)
    defined = tuple(declared_name(name, f"/where/{escaped(name)}") for name in declared.where)
    names = with_products(Names((), (*parameters, *defined), functions), declared, texts, order)
    names = replace(names, coordinates=_coordinates(declared, names, texts, order, keys))
    if declared.guesses:
        names = guessing.with_guessed(texts, names)
    if not pairs:
        check_clashes(names, keyed)
    refuse_two_spellings(texts, names.declared())
    return replace(names, functions=_checked_functions(names, texts))


def with_products(names: Names, declared: Declared, texts: Mapping[str, str], order: int = 2) -> Names:
    """The names, with m and x'' in mx'' where undeclared names may be guessed."""
    if not declared.guesses:
        return names
    names = replace(names, guesses=True)
    return replace(names, splits=moving_names.moving_products(texts, names, order))


def bounded(words: list[str], pointer: str, what: str, most: int) -> list[str]:
    """The words; LimitError where there are too many."""
    if len(words) > most:
        raise errors.LimitError(f"there are {len(words)} {what}: the limit is {most}; declare fewer.", pointer)
    return words


def _arguments(function: str, words: Sequence[str]) -> tuple[str, ...]:
    pointer = f"/functions/{escaped(function)}"
    if isinstance(words, str) or not words:
        raise errors.InputError(
            f"the function {refusals.shorten(function)} has no list of arguments: name the coordinates it depends on, "
            'as in ["r1"].',
            pointer,
        )
    bounded(list(words), pointer, "arguments", refusals.LIMITS.function_arguments)
    return tuple(
        "t" if word == "t" else declared_name(_VELOCITY.sub(r"\1\2_dot", word), f"{pointer}/{place}", "argument")
        for place, word in enumerate(words)
    )


_VELOCITY = re.compile(r"\s*(?:\\dot\s*\{?\s*(\\?\w+)\s*\}?|(.+)')\s*")


def _checked_functions(names: Names, texts: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The functions over coordinates; one over other names is refused where it occurs, and left out where not."""
    foreign: dict[str, int] = {}
    for function, arguments in names.functions.items():
        for place, argument in enumerate(arguments):
            if argument in arguments[:place]:
                pointer = f"/functions/{function}/{place}"
                raise errors.InputError(f"{function} has the argument {argument} twice: name it once.", pointer)
            if argument != "t" and argument not in names.coordinates and names.derivative(argument) is None:
                foreign.setdefault(function, place)
    for function, place in foreign.items():
        if all(_always_called(function, text, names) for text in texts.values()) and texts:
            if any(function in text for text in texts.values()):
                foreign = {name: at for name, at in foreign.items() if name != function}  # a dummy
        elif not texts or any(function in text for text in texts.values()):
            raise errors.InputError(
                f"{function} depends on {names.functions[function][place]}, which is not a coordinate: use one of "
                f"{refusals.joined(names.coordinates)}.",
                f"/functions/{function}/{place}",
            )
    return {function: arguments for function, arguments in names.functions.items() if function not in foreign}


def _always_called(function: str, text: str, names: Names) -> bool:
    """Whether brackets with arguments follow the function wherever it occurs in a text."""
    try:
        tokens = reader.read_tokens(text, names)
    except errors.InputError:
        return True
    for place, token in enumerate(tokens):
        if token.kind == "name" and names.spelling(token.text) == function:
            after = place + 1
            while after < len(tokens) and (tokens[after].kind == "prime" or tokens[after].is_operator("^")):
                after += 1 + (tokens[after].text == "^")
            if after < len(tokens) and tokens[after].is_operator("["):
                after = closing(tokens, after) + 1
            if after >= len(tokens) or not tokens[after].is_operator("("):
                return False
    return True


def _coordinates(
    declared: Declared, names: Names, texts: Mapping[str, str], order: int, keys: Sequence[str]
) -> tuple[str, ...]:
    if declared.coordinates is not None:
        pointer = "/coordinates"
        found = tuple(
            declared_name(word, f"{pointer}/{place}", "coordinate") for place, word in enumerate(declared.coordinates)
        )
    else:
        pointer = "/equations" if order == 2 else "/lagrangian"
        found = tuple(
            dict.fromkeys(moving_names.key_name(key, names) for key in keys)
        ) or moving_names.inferred_coordinates(texts, names, order)
        if texts and not found:
            missing = NO_ACCELERATION if order == 2 else _NO_VELOCITY
            raise _nothing_moves(texts, names, order) or errors.InputError(missing, pointer)
    if not found:
        raise errors.InputError(
            "there are no coordinates: name at least one, or write equations that contain x''.", pointer
        )
    return tuple(bounded(list(found), pointer, "coordinates", declared.most))


# Other spellings of a second derivative, with what is said of each.
_SPELLED = {
    re.compile(r"([A-Za-z]\w*)\s*\(t\)\s*(?:''|\u2033|\u2019\u2019)"): (
        "the primes come after (t): write {meant} or {name}'' for a second derivative."
    ),
    re.compile(r"(?<![A-Za-z0-9_])([A-Za-z]\w*)_\{?([a-ce-z])\2\}?(?![A-Za-z0-9_])"): (
        "{whole} is read as a name: write {meant} for a second derivative."
    ),
}


def _nothing_moves(texts: Mapping[str, str], names: Names, order: int) -> errors.InputError | None:
    """What hides the coordinates: a declaration of the same name, or another spelling of derivatives; None for
    neither."""
    for name in moving_names.inferred_coordinates(texts, Names(), order):
        known = names.spelling(name)
        derivatives = "two derivatives" if order == 2 else "a derivative"
        return errors.InputError(
            f"{name} has {derivatives} in time, and {known} is declared as a {names.role(known)}: take it out, or "
            "name the coordinates.",
            "/equations" if order == 2 else "/lagrangian",
        )
    for pattern, said in _SPELLED.items():
        for pointer, text in texts.items():
            if found := pattern.search(text):
                meant, span = f"{found[1]}''({(*found.groups(), 't')[1]})", (found.start() + 1, found.end() + 1)
                detail = said.format(whole=found[0], name=found[1], meant=meant)
                return errors.InputError(detail, pointer, span[0], (meant,), span)
    return None


_NO_VELOCITY = "the Lagrangian contains no velocity such as x': write kinetic minus potential energy."
