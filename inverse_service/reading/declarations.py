"""What a document declares: coordinates, parameters with their values, functions, and names that
have a formula; values and formulas are substituted exactly.
"""

import graphlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import calculus, tree as ex
from inverse_service.expressions.refusals import LIMITS, fault, shorten
from inverse_service.reading import names as nm, operations as op, reader, signs
from inverse_service.reading.tokens import (
    walk,
)

ParameterValue = str | int | float | None
Parameters = Sequence[str] | Mapping[str, ParameterValue] | str
Words = tuple[str, ...]
Texts = Mapping[str, str]  # formulas by name or pointer
GUESS = "guess"
# The keys that declare names; in a document with none of them, undeclared names are constants.
DECLARING = ("coordinates", "parameters", "functions")
AND_GUESS = "..."
_CALL = re.compile(r"([^\s(),;]+)\s*\(([^()]*)\)")  # A(r1), a user-defined function
_CALLS = re.compile(rf"[\s,;]*(?:{_CALL.pattern}[\s,;]*)*")
# A comma, or a blank before a name that is not part of a value such as 2 pi.
_BETWEEN_PARAMETERS = re.compile(
    rf"[,;\n]|(?<![-+*/^(=\s])\s+(?=[^\W\d]|\\)(?!(?:{'|'.join(nm.RESERVED)})\b)"
)


def parameter_values(
    parameters: Sequence[str] | Mapping[str, ParameterValue],
) -> dict[str, ex.Expression]:
    """The given values as trees, without the parameters that have no value (None) and remain
    generic.

    A value is a number or a constant such as "1/2", "sqrt(2)" or "2*pi"; a float stands for its
    shortest decimal form. InputError with the pointer of the parameter for anything else.
    """
    pairs = parameters.items() if isinstance(parameters, Mapping) else ()
    given = [
        (name, f"/parameters/{nm.escaped(name)}", value)
        for name, value in pairs
        if value is not None
    ]
    return {
        nm.declared_name(name, at, "parameter"): _constant(value, at) for name, at, value in given
    }


def _constant(value: str | int | float, pointer: str) -> ex.Expression:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise fault("value", pointer)
    if (
        isinstance(value, int) and value.bit_length() > 4_000
    ):  # Python refuses to convert a huge integer to str
        raise fault("long value", pointer)
    try:
        return reader.read_formula(
            value if isinstance(value, str) else repr(value), nm.Names(time=False)
        )
    except errors.InputError as error:
        raise (fault("name in a value", error.column or 1) if error.declare else error).at(
            pointer
        ) from None


def with_values(expression: ex.Expression, values: Mapping[str, ex.Expression]) -> ex.Expression:
    """The tree with the values substituted; InputError if it then has no value (1/0, log of 0)."""
    if not values:
        return expression
    result = ex.substitute(expression, {ex.Symbol(name): value for name, value in values.items()})
    if not all(map(_is_defined, ex.walk(result))):
        raise fault("values without a real value", "/parameters")
    return result


def _is_defined(node: ex.Expression) -> bool:
    match node:
        case ex.Power(ex.Number(base), ex.Number(exponent)):
            return exponent >= 0 if base == 0 else base > 0 or exponent.denominator == 1
        case ex.Apply(function, argument):
            return nm.is_defined(function, argument)
    return True


@dataclass(frozen=True, slots=True)
class Declared:
    """The declarations of a document. `parameters` may be "guess", or contain "..." to guess the
    remaining names.

    `where` maps names to formulas, which are substituted exactly. At most `most` coordinates are
    accepted.
    """

    coordinates: Sequence[str] | None = None
    parameters: Parameters = ()
    functions: Mapping[str, Sequence[str]] = field(default_factory=dict)
    where: Texts = field(default_factory=dict)
    most: int = LIMITS.coordinates

    @property
    def guesses(self) -> bool:
        """Whether undeclared names are treated as constants."""
        return self.parameters == GUESS or (
            not isinstance(self.parameters, str) and AND_GUESS in self.parameters
        )

    def named_parameters(self) -> Sequence[str] | Mapping[str, ParameterValue]:
        """The named parameters, with their values if given."""
        if isinstance(self.parameters, Mapping):
            return {name: value for name, value in self.parameters.items() if name != AND_GUESS}
        return (
            []
            if isinstance(self.parameters, str)
            else [name for name in self.parameters if name != AND_GUESS]
        )


@dataclass(frozen=True, slots=True)
class Known:
    """The names of a document, and the substitutions for the names with a formula or a value."""

    names: nm.Names
    definitions: Mapping[ex.Expression, ex.Expression]
    calls: calculus.Definitions
    values: Mapping[str, ex.Expression]

    def put_in(self, tree: ex.Expression) -> ex.Expression:
        """The tree with definitions and values substituted; InputError if it then has no value."""
        if self.definitions:
            whole = calculus.define_functions(tree, self.calls)
            tree = op.check_size(ex.substitute(whole, dict(self.definitions)))
        return with_values(tree, self.values)

    def remaining(self) -> nm.Names:
        """The names that can still occur after the substitution."""
        gone = {
            *self.values,
            *(node.name for node in self.definitions if isinstance(node, ex.Symbol)),
        }
        parameters = tuple(name for name in self.names.parameters if name not in gone)
        functions = {
            name: arguments for name, arguments in self.names.functions.items() if name not in gone
        }
        return replace(self.names, parameters=parameters, functions=functions, definitions={})


class TypedLines(NamedTuple):
    """Both sides of each line of a document as typed, and what its names are."""

    known: Known
    sides: tuple[tuple[ex.Expression, ex.Expression], ...]


def defined_name(key: str) -> str:
    """The name that a key of `where` defines: r, or V for V(x)."""
    pointer = f"/where/{nm.escaped(key)}"
    return nm.declared_name(key.partition("(")[0] if key.rstrip().endswith(")") else key, pointer)


def expanded_definitions(
    where: Texts, names: nm.Names
) -> tuple[dict[ex.Expression, ex.Expression], dict[str, tuple[Words, ex.Expression]]]:
    """The formulas of `where` with their definitions expanded: one map for names, one for functions
    with their arguments.

    InputError for circular definitions, and if the formula of a function uses more than its
    arguments.
    """
    pointers = {defined_name(name): f"/where/{nm.escaped(name)}" for name in where}
    if len(pointers) < len(where):
        raise fault("two definitions", "/where")
    texts = dict(zip(pointers, where.values(), strict=True))
    found: dict[ex.Expression, ex.Expression] = {}
    calls: dict[str, tuple[Words, ex.Expression]] = {}
    name = ""
    try:
        used = dict[str, set[str]]()
        for name, text in texts.items():
            used[name] = {
                names.spelling(token.text) for token in walk(reader.read_tokens(text, names))
            } & texts.keys()
        for name in _ordered(used):
            arguments = names.functions.get(name, ())
            known = (
                *names.parameters,
                *(argument for argument in arguments if names.role(argument) is None),
            )
            tree = reader.read_formula(
                texts[name], replace(names, parameters=known, definitions=found)
            )
            tree = op.check_size(ex.substitute(calculus.define_functions(tree, calls), found))
            found[ex.Symbol(name)] = tree
            if arguments:
                calls[name] = arguments, _of_its_arguments(tree, name, arguments, names)
                continue
            if (
                isinstance(tree, ex.Power) and tree.exponent == ex.HALF
            ):  # r = sqrt(x^2 + y^2) also defines r^2
                found |= {
                    ex.power(ex.Symbol(name), 2 * k): ex.power(tree.base, k)
                    for k in (-3, -2, -1, 1, 2, 3)
                }
    except errors.InputError as error:
        raise error if error.pointer else error.at(pointers[name]) from None
    return found, calls


def _of_its_arguments(
    tree: ex.Expression, name: str, arguments: Sequence[str], names: nm.Names
) -> ex.Expression:
    """The formula of a function; InputError if it contains velocities or coordinates other than the
    arguments.
    """
    others = {
        f"{node.coordinate}'": None for node in ex.walk(tree) if isinstance(node, ex.Velocity)
    }
    symbols = [node.name for node in ex.walk(tree) if isinstance(node, ex.Symbol)]
    others |= {
        each: None for each in symbols if each in names.coordinates and each not in arguments
    }
    if others:
        raise fault(
            "missing arguments", "", call=f"{name}({', '.join(arguments)}", more=", ".join(others)
        )
    return tree


def _ordered(used: Mapping[str, set[str]]) -> list[str]:
    """The names sorted so that each follows the names in its formula; InputError for circular
    definitions.
    """
    try:
        return [*graphlib.TopologicalSorter(used).static_order()]
    except graphlib.CycleError as error:
        name = next(name for name in used if name in error.args[1])
        raise fault("circular definition", f"/where/{name}", name=name) from None


def bounded(words: list[str], pointer: str, what: str, most: int) -> list[str]:
    """The words; LimitError for more than `most`."""
    if len(words) > most:
        raise errors.LimitError(
            f"there are {len(words)} {what}: the limit is {most}; declare fewer.", pointer
        )
    return words


def declared_arguments(function: str, words: Sequence[str]) -> Words:
    pointer = f"/functions/{nm.escaped(function)}"
    if isinstance(words, str) or not words:
        raise fault("no list of arguments", pointer, name=shorten(function))
    bounded(list(words), pointer, "arguments", LIMITS.function_arguments)
    return tuple(
        "t" if word == "t" else nm.declared_name(_argument(word), f"{pointer}/{place}")
        for place, word in enumerate(words)
    )


def _argument(word: str) -> str:
    r"""x_dot for x' and \dot{x}, q_1_dot for \dot{q}_1."""
    texts = [sign.text for sign in signs.of(word)]
    dotted, primed = texts[:1] == ["\\dot"], texts[-1:] == ["'"]
    if dotted == primed:
        return word
    name = texts[1:] if dotted else texts[:-1]
    return f"{''.join(text for text in name if text not in ('{', '}'))}_dot"


def words_of(text: str) -> list[str]:
    """ "x y" and "k, m" as lists of names."""
    return [word for word in re.split(r"[,\s;]+", text) if word]


def parameters_of(text: str) -> dict[str, str | None]:
    """ "m, k = 1/2" and "k = 2 m" as names with their values, None for a generic one.

    "guess" alone declares none.
    """
    if text.strip() == GUESS:
        return {}
    pairs = [part.partition("=") for part in _BETWEEN_PARAMETERS.split(text)]
    return {name.strip(): value.strip() or None for name, _, value in pairs if name.strip()}


def functions_of(text: str) -> dict[str, list[str]]:
    """ "A(r1), V(x, y)" as names with their arguments; raises InputError for anything else."""
    if not _CALLS.fullmatch(text):
        raise fault("functions as a text", "/functions")
    return {match[1]: words_of(match[2]) for match in _CALL.finditer(text)}


def with_guess(document: Mapping[str, Any]) -> dict[str, Any]:
    """The same document, with undeclared names treated as constants."""
    named = document.get("parameters") or ()
    if isinstance(named, Mapping):
        return {**document, "parameters": {**named, AND_GUESS: None}}
    declared = isinstance(named, list) and named
    return {**document, "parameters": [*named, AND_GUESS] if declared else GUESS}
