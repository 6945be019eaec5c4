"""Find the names of a document: declared, derived from its formulas, or guessed on request;
substitute values exactly.

A name with a time derivative is a coordinate. If names may be guessed, an unknown name before (t)
or before coordinates in brackets is a function of them. Any other unknown name is a parameter,
unless it may have another meaning: kx, dx, sinx, or an r without an equation. In that case an error
asks the writer what is meant. The answer lists all guessed names.
"""

import graphlib
import itertools
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.expressions.refusals import LIMITS, fault, listed_names, shorten
from inverse_service.reading import labels, names as nm, prose, reader
from inverse_service.reading.tokens import (
    WHOLE_NAMES,
    Line,
    Token,
    after_power,
    at,
    flat,
    places,
    source,
    spelled,
    split_at,
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
ANY_SPEED = ("u", "v", "s", "V")  # of x' = v cos(theta), y' = v sin(theta)
_VELOCITY = re.compile(r"\s*(?:\\dot\s*\{?\s*(\\?\w+)\s*\}?|(.+)')\s*")
# Other spellings of a second derivative, with the message for each.
_SPELLED = {
    "two subscripts": re.compile(
        r"(?<![A-Za-z0-9_])(?!I_)([A-Za-z]\w*)_\{?([a-ce-z])\2\}?(?![A-Za-z0-9_])"
    ),
}
HAMILTONIAN = re.compile(r"\s*(\\(?:mathcal|mathscr)\s*\{?\s*H\s*\}?|H)\s*(?:\([^()]*\))?\s*=")
# Factors before an acceleration without a sign: m, ml, I, r.
_FACTOR_OF_MOTION = re.compile("([mMIJLCRlrabckghqGQ][0-9]?){1,4}")
_WEIGHT = re.compile("[mM]g[lLhHrRabd]|G[mM][mM]|GMm|q[BE]")  # and a charge times a field
_LUMP = re.compile("[a-z][A-Z]")
_FREQUENCY = re.compile("w[cdnprs]")  # w with an index, as in w_n^2
# Names refused as functions or numbers; guessing does not make them parameters either.
NEVER_GUESSED = (
    nm.RESERVED
    | nm.FUNCTIONS
    | nm.REFUSED.keys()
    | {"e", "E", "Pi"}
    | (nm.REFUSED_UNLESS_DECLARED.keys() - {"I", "gamma", "Gamma", "zeta", *nm.MAY_BE_CONSTANTS})
)
CALLED_LETTERS = nm.FUNCTION_LETTERS | {"g", "G", "phi", "Phi", "psi", "Psi", "P", "Q"}
_PROGRAMS = re.compile(
    r"\b(?:Eq|diff|Derivative|Mul|Add)\s*\(|\["
)  # in these notations E is Euler's number
_OF_PROGRAMS = re.compile(
    r"\b(?:diff|Derivative|Eq|der|syms|symbols|def|function|return|end|begin)\b|:=|@|\w[\[(]\d[\])]|\w\["
)
# Of these, h(x - b) is taken as a function, and is often a product.
_FACTORS_OR_FUNCTIONS = frozenset("hHgGpPQuvwW")
# Angles of planes and cones.
_INCLINATIONS = frozenset(("alpha", "beta", "gamma"))
# Letters of fields, whose u_xx is usually a second derivative; I_xx and k_xx are constants.
_FIELDS = frozenset(("u", "v", "w", "phi", "psi", "eta"))
# As functions of t, these usually denote impulses and steps.
_IMPULSES = frozenset(("delta", "theta", "Theta", "H"))
_Found = tuple[str, Token, int]  # pointer, token, and the column after the arguments
_ONE_UNIT = r"(?:k?[gmNJW]|[cm]m|m?s|V|Hz|rad|k?Pa)(?:\^\(?-?\d\)?)?"
_UNIT = re.compile(rf"{_ONE_UNIT}(?:[*/]{_ONE_UNIT})*")  # of k = 3 N/m
_MOST_ROUNDS = 4  # splitting one run may reveal a name that splits other runs
_COMPONENTS = frozenset("ABEFJPVpv")  # Fx and Fy are usually two components
_CALL = re.compile(r"\s*([^\s(),;]+)\s*\(([^()]*)\)")  # A(r1), a user-defined function
# A comma, or a blank before a name that is not part of a value such as 2 pi.
_BETWEEN_PARAMETERS = re.compile(
    rf"[,;\n]|(?<![-+*/^(=\s])\s+(?=[^\W\d]|\\)(?!(?:{'|'.join(nm.RESERVED)})\b)"
)
_WORDS_OF_MOTION = {"v": "'", "velocity": "'", "speed": "'", "position": "", "acceleration": "''"}


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
        tree = calculus.define_functions(tree, self.calls)
        return with_values(
            ex.substitute(tree, dict(self.definitions)) if self.definitions else tree, self.values
        )

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


def known_names(
    declared: Declared, texts: Texts, order: int = 2, keys: Sequence[str] = (), pairs: bool = False
) -> Known:
    """The names that the formulas of a document may use, with their substitutions; see
    `document_names`.
    """
    where = {f"/where/{nm.escaped(name)}": text for name, text in declared.where.items()}
    names = document_names(declared, {**texts, **where}, order, keys, pairs)
    definitions, calls = _definitions(declared.where, names)
    values = parameter_values(declared.named_parameters())
    return Known(replace(names, definitions=definitions), definitions, calls, values)


def defined_name(key: str) -> str:
    """The name that a key of `where` defines: r, or V for V(x)."""
    pointer = f"/where/{nm.escaped(key)}"
    return nm.declared_name(key.partition("(")[0] if key.rstrip().endswith(")") else key, pointer)


def _definitions(
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
            tree = ex.substitute(calculus.define_functions(tree, calls), found)
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


def document_names(
    declared: Declared, texts: Texts, order: int = 2, keys: Sequence[str] = (), pairs: bool = False
) -> nm.Names:
    """The names that the formulas of a document may use; InputError with the pointer of an invalid
    one.

    `texts` maps pointers to formulas, `order` is the order of the time derivative that makes a name
    a coordinate, and `keys` are the keys of `equations`, each naming a coordinate. With `pairs`,
    the coordinates found are those of first-order equations, including momenta.
    """
    named = declared.named_parameters()
    keyed = isinstance(named, Mapping)
    parameters = tuple(
        nm.declared_name(
            parameter, f"/parameters/{nm.escaped(parameter) if keyed else place}", "parameter"
        )
        for place, parameter in enumerate(
            bounded(list(named), "/parameters", "parameters", LIMITS.names)
        )
    )
    functions = {
        nm.declared_name(key, f"/functions/{nm.escaped(key)}", "function"): _arguments(key, words)
        for key, words in declared.functions.items()
    }
    bounded(list(declared.functions), "/functions", "functions", LIMITS.names)
    called = {
        defined_name(key): key.partition("(")[2].rstrip(" )")
        for key in declared.where
        if key.endswith(")")
    }
    functions |= {name: _arguments(name, words.split(",")) for name, words in called.items()}
    defined = tuple(name for key in declared.where if (name := defined_name(key)) not in called)
    names = nm.Names((), (*parameters, *defined), functions)
    names = replace(names, raised=reader.letters_with_indices(texts.values()))
    names = with_products(names, declared, texts, order)
    names = replace(names, coordinates=_coordinates(declared, names, texts, order, keys))
    if declared.guesses:
        names = _with_guessed(
            texts, names, {argument for name in called for argument in functions[name]}
        )
    if not pairs:
        nm.check_clashes(names, keyed)
    nm.refuse_two_spellings(texts, names.declared(), reader.parts)
    return replace(names, functions=_checked_functions(names, texts))


def with_products(names: nm.Names, declared: Declared, texts: Texts, order: int = 2) -> nm.Names:
    """The names, including the m and x of mx'' if undeclared names may be guessed."""
    if not declared.guesses:
        return names
    names = replace(names, guesses=True)
    products = moving_products(texts, names, order)
    return replace(names, splits=_products_of_definitions(texts, names, declared.where) | products)


def _products_of_definitions(
    texts: Texts, names: nm.Names, where: Collection[str]
) -> dict[str, Words]:
    """The m, g, h of mgh where h has a definition."""
    letters = {key for key in where if len(key) == 1 and key.isalpha()}
    if not letters:
        return {}
    lines = (reader.tokens_if_any(text, names) for text in texts.values())
    words = {token.text for line in lines for token in walk(line) if token.kind == "name"}
    return {
        word: tuple(word)
        for word in words
        if word[-1:] in letters
        and 2 < len(word) < 5
        and word.isascii()
        and word.isalpha()
        and not names.role(word)
        and word not in nm.FUNCTIONS | nm.GREEK_NAMES
        and not {*word} & {*"dDeij"}
    }


def bounded(words: list[str], pointer: str, what: str, most: int) -> list[str]:
    """The words; LimitError for more than `most`."""
    if len(words) > most:
        raise errors.LimitError(
            f"there are {len(words)} {what}: the limit is {most}; declare fewer.", pointer
        )
    return words


def _arguments(function: str, words: Sequence[str]) -> Words:
    pointer = f"/functions/{nm.escaped(function)}"
    if isinstance(words, str) or not words:
        raise fault("no list of arguments", pointer, name=shorten(function))
    bounded(list(words), pointer, "arguments", LIMITS.function_arguments)
    return tuple(
        "t"
        if word == "t"
        else nm.declared_name(_VELOCITY.sub(r"\1\2_dot", word), f"{pointer}/{place}")
        for place, word in enumerate(words)
    )


def _checked_functions(names: nm.Names, texts: Texts) -> dict[str, Words]:
    """The functions of coordinates; InputError for a function of other names in a formula; others
    are omitted.
    """
    foreign: dict[str, int] = {}
    for function, arguments in names.functions.items():
        for place, argument in enumerate(arguments):
            if argument in arguments[:place]:
                raise fault(
                    "repeated argument",
                    f"/functions/{function}/{place}",
                    name=function,
                    argument=argument,
                )
            if (
                argument != "t"
                and argument not in names.coordinates
                and names.derivative(argument) is None
            ):
                foreign.setdefault(function, place)
    for function, place in foreign.items():
        calls = [
            call
            for text in texts.values()
            if (call := _always_called(function, text, names)) is not None
        ]
        if calls and all(calls):
            foreign = {
                name: at for name, at in foreign.items() if name != function
            }  # a dummy argument
        elif calls or not texts:
            words = {
                "argument": names.functions[function][place],
                "coordinates": listed_names(names.coordinates),
            }
            raise fault(
                "foreign argument", f"/functions/{function}/{place}", name=function, **words
            )
    return {
        function: arguments
        for function, arguments in names.functions.items()
        if function not in foreign
    }


def _always_called(function: str, text: str, names: nm.Names) -> bool | None:
    """Whether arguments in brackets follow every occurrence of the function in a text; None if it
    does not occur.
    """
    tokens = reader.tokens_if_any(text, names)
    called = []
    for line, place, _ in places(tokens):
        if line[place].kind == "name" and names.spelling(line[place].text) == function:
            after = after_power(line, place + 1)
            called.append(at(line, after + at(line, after).is_bracket("[")).is_bracket())
    return all(called) if called else (not tokens and function in text) or None


def _coordinates(
    declared: Declared, names: nm.Names, texts: Texts, order: int, keys: Sequence[str]
) -> Words:
    if declared.coordinates is not None:
        pointer = "/coordinates"
        pointers = [
            (word, f"/coordinates/{place}") for place, word in enumerate(declared.coordinates)
        ]
        found = tuple(nm.declared_name(*pair, "coordinate") for pair in pointers)
    else:
        pointer = "/equations" if order == 2 else "/lagrangian"
        found = tuple(dict.fromkeys(key_name(key, names) for key in keys)) or inferred_coordinates(
            texts, names, order
        )
        if order == 1 and names.guesses and declared.where:
            found = tuple(dict.fromkeys((*found, *_moved_by_definitions(texts, names))))
        if texts and not found:
            raise _nothing_moves(texts, names, order) or _without_motion(texts, order, pointer)
    if not found:
        raise fault("no coordinates", pointer)
    return tuple(bounded(list(found), pointer, "coordinates", declared.most))


def _without_motion(texts: Texts, order: int, pointer: str) -> errors.InputError:
    """The error for an L without velocities, and for equations without accelerations."""
    if order == 1:
        return fault("no velocity", pointer)
    slow = [
        name
        for text in texts.values()
        for name in moving_names(reader.tokens_if_any(text, nm.Names()), 1)
    ]
    if slow:
        return fault("first order", pointer, name=slow[0])
    equal = any("=" in text for text in texts.values())
    return fault("no acceleration" if equal else "no equation", pointer)


def _moved_by_definitions(texts: Texts, names: nm.Names) -> list[str]:
    """The theta of x = l sin(theta) and the r of x = r cos(phi) if L has x': angles, and names such
    as r, rho, and x.

    An angle is the argument of a sine or cosine with numbers as its only factors: nothing moves in
    cos(omega t + phi), nor the alpha of y = x tan(alpha) and x = r sin(alpha) cos(theta).
    """
    formulas = {
        name: text
        for pointer, text in texts.items()
        if (name := names.spelling(pointer.removeprefix("/where/")))
    }
    todo = [
        names.spelling(name)
        for name in inferred_coordinates(texts, replace(names, parameters=(), functions={}), 1)
    ]
    alone = {name for name in todo if names.role(name) != "parameter"}
    moving = replace(names, coordinates=tuple(alone))
    found: dict[str, None] = {}
    for name in todo:
        tokens = (
            reader.tokens_if_any(formulas.get(name, ""), names)
            if names.role(name) == "parameter"
            else []
        )
        terms = [
            {names.spelling(token.text) for token in walk(term)} for term in split_at("+-", tokens)
        ]
        fixed = {each for term in terms if term & alone for each in term}
        fixed |= {
            each
            for term in terms
            if any(map(nm.looks_like_a_coordinate, term))
            for each in term & _INCLINATIONS
        }
        for line, place, outer in places(tokens):
            token, each = line[place], names.spelling(line[place].text)
            if token.kind != "name" or token.text == "t" or token.text in nm.FUNCTIONS | {"pi"}:
                continue
            if names.role(each) == "parameter" and each not in todo:
                todo.append(each)
            elif nm.only_split(each, moving):
                continue  # k x of y = A cos(kx)
            elif names.role(each) is None and (
                each == "rho"
                or spelled([at(line, place + 1)]) == "(t)"
                or (nm.looks_like_a_coordinate(each) and not _lost_power(each, [*alone]))
                or (each not in fixed and _is_angle(line, place, outer))
            ):
                found.setdefault(each)
    return list(found)


def _is_angle(line: Line, place: int, outer: Token) -> bool:
    """Whether the name is the argument of a sine or cosine, or a term of one without t, with
    numeric factors only.
    """
    start = place - 1
    while at(line, start).kind in ("name", "number") or at(line, start).is_operator("+", "-", "*"):
        if at(line, start).text in nm.FUNCTIONS:
            break
        start -= 1
    bracket = start < 0
    inside = line if bracket else line[start + 1 : place + 2]
    beside = (at(line, place - 1 - at(line, place - 1).is_operator("*")), at(line, place + 1))[
        1 - bracket :
    ]
    alone = not any(token.kind == "name" or token.is_operator("*", "/") for token in beside)
    bare = bracket or all(token.kind == "number" for token in line[start + 1 : place])
    timed = any(token.text == "t" for token in walk(inside))
    return (
        alone
        and bare
        and not timed
        and (outer if bracket else line[start]).text in ("sin", "cos", "tan")
    )


def _nothing_moves(texts: Texts, names: nm.Names, order: int) -> errors.InputError | None:
    """Why no coordinates were found: a declaration of the name or a spelling of derivatives; else
    None.
    """
    for name in inferred_coordinates(texts, nm.Names(), order):
        known = names.spelling(name)
        what = f"{name} has {'two derivatives' if order == 2 else 'a derivative'} in time"
        if at := next(
            (at for at in texts if names.spelling(at.removeprefix("/where/")) == known), None
        ):
            return fault("defined name that moves", at, what=what)
        pointer = "/equations" if order == 2 else "/lagrangian"
        return fault(
            "declared name that moves", pointer, what=what, name=known, role=names.role(known)
        )
    for key, pattern in _SPELLED.items():
        for pointer, text in texts.items():
            if found := pattern.search(text):
                second, span = (
                    f"{found[1]}''({(*found.groups(), 't')[1]})",
                    (found.start() + 1, found.end() + 1),
                )
                return fault(key, span[0], span, shown=found[0], name=found[1], second=second).at(
                    pointer
                )
    alone = next(
        (pointer for pointer, text in texts.items() if order == 2 and HAMILTONIAN.match(text)), None
    )
    return None if alone is None else fault("no equations of H", alone)


def moving_products(texts: Texts, declared: nm.Names, order: int = 2) -> dict[str, Words]:
    """The products among the runs of letters with primes: mx'' is m x''; likewise yy'' and LI''."""
    lines = [line for text in texts.values() if (line := reader.tokens_if_any(text, declared))]
    words = [
        (token.text, token.order > 0)
        for line in lines
        for token in walk(line)
        if token.kind == "name"
    ]
    alone, primed = ({word for word, moves in words if moves is which} for which in (False, True))
    found: dict[str, Words] = {}
    for line in lines:
        for name in moving_names(line, order):
            if (
                name in nm.GREEK_NAMES
                or declared.role_meant(name)
                or not name.replace("_", "").isalnum()
            ):
                continue
            for cut in range(1, len(name)):
                factor, moving = name[:cut], name[cut:]
                single = (
                    len(moving) == 1
                    or moving in nm.GREEK_NAMES
                    or re.fullmatch("[A-Za-z]_?[0-9]", moving)
                )
                elsewhere = moving in alone | primed
                if name in alone and (moving not in primed or nm.is_momentum(name, (moving,))):
                    continue
                mechanical = _FACTOR_OF_MOTION.fullmatch(factor) or factor in nm.GREEK_NAMES
                named = (
                    nm.looks_like_a_coordinate(moving) or moving in nm.GREEK_NAMES
                ) and mechanical
                plain = mechanical or (
                    len(factor) < 3 and factor.isalpha() and not {*factor} & {*"dDeij"}
                )
                bending = (
                    len(factor) == 2 and factor.isupper() and nm.looks_like_a_coordinate(moving)
                )  # E I y
                if single and moving != "t" and plain and (bending or elsewhere or named):
                    factors = (
                        [factor]
                        if factor in nm.GREEK_NAMES
                        else re.findall("[A-Za-z][0-9]?", factor)
                    )
                    found.setdefault(name, (*factors, moving))
    return found


def _refuse_products(tokens: Line, products: Mapping[str, Words]) -> None:
    """InputError for mx'', which means m*x''."""
    for token in walk(tokens):
        if token.text in products and token.order:
            meant, primes = "*".join(products[token.text]), "'" * token.order
            raise fault(
                "product with primes",
                token.column,
                name=token.text,
                meant_name=meant,
                primes=primes,
            )


def inferred_coordinates(texts: Texts, declared: nm.Names, order: int = 2) -> Words:
    """The names with this many time derivatives (x'', x_ddot, diff(x, t, 2), …), each once, in
    order.

    `texts` maps pointers to formulas; `declared` holds parameters and functions, which are not
    coordinates.
    """
    found: dict[str, None] = {}
    for pointer, text in texts.items():
        with reader.placed_at(pointer):
            tokens = reader.read_tokens(text, declared)
            if not declared.guesses:
                _refuse_products(tokens, moving_products({pointer: text}, declared, order))
            moving = moving_names(tokens, order)
            moving += (
                reader.moving_in_forms(tokens, declared)
                if pointer.startswith("/constraints")
                else []
            )
            names = [name for name in moving if declared.role_meant(name) is None]
            _refuse_sums(tokens, names, order)
            _refuse_glued_words(tokens, [*found, *names])
        found.update(dict.fromkeys(nm.declared_name(name, pointer, "coordinate") for name in names))
    return tuple(found)


def _refuse_sums(tokens: Line, moving: Sequence[str], order: int) -> None:
    """InputError for x_i'x_i', which may be a sum over i, as may each term of a Lagrangian with
    x_i.
    """
    words = [*walk(tokens)]
    for place, token in enumerate(words):
        summed = token.text in moving and re.search("_[ijk]$", token.text) and token.order < 2
        if summed and (order == 1 or at(words, place + 1).text == token.text):
            raise fault("summed index", token.column, name=token.text, stem=token.text[:-1])


def _refuse_glued_words(tokens: Line, moving: Sequence[str]) -> None:
    """InputError for constraintz' next to z', which is the word and the coordinate."""
    known = {*moving}
    for token in walk(tokens):
        name = token.text if token.text in known else ""
        heads = [(name[:k], name[k:]) for k in range(1, len(name)) if name[k:] in known]
        if meant := next(
            (f"{head} {q}" for head, q in heads if head.lower() in prose.BEGINNINGS), None
        ):
            raise nm.undeclared(token.text, token.column, (meant,))


def key_coordinate(key: str, names: nm.Names, pointer: str) -> str:
    """The coordinate that a key x, x'', x_ddot or \\ddot{x} of `equations` means; InputError if
    there is none.
    """
    name = names.spelling(key_name(key, names))
    if name not in names.coordinates:
        raise fault(
            "equation for another name",
            pointer,
            name=shorten(key),
            coordinates=listed_names(names.coordinates),
        )
    return name


def key_name(key: str, names: nm.Names) -> str:
    """The name in a key of `equations`, with or without two derivatives."""
    pointer = f"/equations/{nm.escaped(key)}"
    if names.role(key):
        return key
    tokens = reader.tokens_if_any(key[:200], names)
    accelerated = moving_names(tokens, 2)
    if len(accelerated) == len(tokens) == 1:
        return accelerated[0]
    return nm.declared_name(key, pointer, "coordinate")


def moving_names(tokens: Line, order: int) -> list[str]:
    """The names with at least this many time derivatives, in order of appearance; V''(x) does not
    count.
    """
    return [name for name, by, times in derivatives(tokens) if by == "t" and times >= order]


def derivatives(line: Line) -> list[tuple[str, str, int]]:
    """(y, x, k) for each y differentiated k times by x, including nested ones, diff(x diff(y, x),
    x); y'' is by t.
    """
    found: list[tuple[str, str, int]] = []
    for place, token in enumerate(line):
        name, after = token.text if token.kind == "name" else "", at(line, place + 1)
        if name in nm.DERIVATIVE_NAMES:
            operand, *variables = split_at(",", after.inside)
            found += _differentiated(
                operand, [word.text for part in variables for word in walk(part)]
            )
        elif name and token.order:
            by = _variable(after)
            found += (
                [(name, by or "t", token.order)] if by or _multiplies_a_sum(token, after) else []
            )
        elif token.inside and at(line, place - 1).text not in nm.DERIVATIVE_NAMES:
            found += derivatives(token.inside)
    return found


def _differentiated(operand: Line, words: Sequence[str]) -> list[tuple[str, str, int]]:
    """The derivatives in diff(operand, x, x), (x, 2) or ((x, 2)); primes in the operand also
    differentiate by x.
    """
    variable, *more = [word for word in words if word not in ("(", ",")] or [""]
    if {*more} - {variable} and not (len(more) == 1 and more[0].isdigit()):
        return []
    times = int(more[0]) if more and more[0] != variable else 1 + len(more)
    first = at(operand, 0)
    if (
        first.kind == "name"
        and not first.order
        and spelled(operand[1:]) in ("", f"({variable})", "(t)")
    ):
        return [(first.text, variable, times)]
    by = (variable, "t")[
        : 1 + (not first.order)
    ]  # the prime of diff(x y', x) is by x, that of diff(y', x) is not
    return [
        (name, variable, order + times)
        for name, inner, order in derivatives(operand)
        if inner in by
    ]


def _variable(after: Token) -> str:
    """x if the token is (x), t if it is not a bracket, and "" for any other bracket."""
    if not after.is_bracket():
        return "t"
    return (
        after.inside[0].text
        if [(each.kind, each.order) for each in after.inside] == [("name", 0)]
        else ""
    )


def _multiplies_a_sum(name: Token, bracket: Token) -> bool:
    """Whether the brackets after the primes are a factor: x''(1 + x^2), r'' (M + m); V''(x - y) is
    a function.
    """
    plain = nm.looks_like_a_coordinate(name.text) or name.text in nm.GREEK_NAMES
    return plain and any(token.is_operator("+", "-") for token in [*walk(bracket.inside)][1:])


def _with_guessed(texts: Texts, declared: nm.Names, dummies: Collection[str]) -> nm.Names:
    """The names plus the undeclared ones that the texts use; InputError as in `_Guesser`."""
    for _ in range(_MOST_ROUNDS):
        found = _Guesser(texts, declared, dummies)
        parameters = found.parameters()
        if not found.splits:
            break
        declared = replace(declared, splits={**declared.splits, **found.splits})
    both = (*declared.parameters, *parameters)
    return replace(declared, parameters=both, functions={**declared.functions, **found.functions})


class _Guesser:
    """The undeclared names in the texts (formulas by pointer) that are not coordinates.

    `dummies` are the arguments of functions that the texts define. A text that cannot be tokenized
    adds nothing: its error is reported when it is parsed. InputError with suggestions for a
    suspicious name. Found are `functions` with their arguments, and `splits`, the runs of letters
    that are products.
    """

    def __init__(self, texts: Texts, declared: nm.Names, dummies: Collection[str]) -> None:
        self._declared, self._coordinates = declared, declared.coordinates
        self._texts, self._lines = texts, dict[str, Line]()
        for pointer, text in texts.items():
            kind = replace(declared, forms=pointer.startswith("/constraints"))
            self._lines[pointer] = reader.tokens_if_any(text, kind)
        everywhere = [place for line in self._lines.values() for place in places(line)]
        self._raised = {
            line[place].text: at(line, place + 2).kind == "number"
            for line, place, _ in everywhere
            if at(line, place + 1).is_operator("^") and not line[place].order
        }
        programmed = any(map(_PROGRAMS.search, texts.values()))
        field = {"E"} if not (programmed or "E" in self._raised or declared.role("E")) else set()
        maxima = "e" not in self._raised and any("'diff(" in text for text in texts.values())
        maxima = maxima and any(line[place].text == "e" for line, place, _ in everywhere)
        if declared.role("e") is None and (maxima or _is_charge(self._lines.values())):
            reader.note("e", "a constant", "Euler's number exp(1)")
            field.add("e")
        self._known = {*declared.declared(), *NEVER_GUESSED, *dummies} - field
        pairs = [(line[place], at(line, place + 1)) for line, place, _ in everywhere]
        called = [
            (name.text, self._call(after, True))
            for name, after in pairs
            if not _is_apart(name, after)
        ]
        self._calls = {(name, arguments) for name, arguments in called if arguments}
        self._factors = {
            line[place].text
            for line, place, outer in everywhere
            if _is_constant(line, place, outer)
        }
        self._defined = {
            declared.spelling(key.removeprefix("/where/"))
            for key in texts
            if key.startswith("/where/")
        }
        self._alone = reader.alone(self._lines.values())
        self._explicit = _has_explicit_products(everywhere)
        plain = [text for text in texts.values() if not reader.is_latex(text)]
        of_programs = self._explicit and any(map(_OF_PROGRAMS.search, plain))
        self._whole_words = of_programs or any(map(WHOLE_NAMES.search, plain))
        self._slopes = _slopes(self._lines.values(), declared)
        self._constants = dict[str, _Found]()
        self._subscripted = dict[str, _Found]()  # U_x(x, y) may be a derivative
        self.functions, self.splits = dict[str, Words](), dict[str, Words]()

    def parameters(self) -> Words:
        """The names of constants, in order of appearance."""
        for pointer, tokens in self._lines.items():
            with reader.placed_at(pointer):
                for line, place, outer in places(tokens):
                    unknown = not self._is_known(line[place])
                    marked = unknown or (
                        line is tokens and not all(map(self._is_known, line[place].inside))
                    )
                    if marked and not nm.only_split(
                        line[place].text, self._declared
                    ):  # cosx sinx is not a remark
                        reader.refuse_remark(line, place, self._alone)
                    if unknown:
                        self._refuse_other_meanings(line, place, outer, pointer)
                        self._add(line, place, pointer)
        self.functions = {**self.functions, **self._slopes, **self.functions}
        names = replace(self._declared, functions={**self._declared.functions, **self.functions})
        _ask_back(self._subscripted, replace(names, parameters=()), {}, False)
        guessed = {
            name: found for name, found in self._constants.items() if name not in self.functions
        }
        asked = {
            name: found
            for name, found in guessed.items()
            if name != "r" or not (self._has_wheel() or self._has_radius())
        }
        if self._whole_words:
            _ask_about_motion(asked, names)
        else:
            self.splits |= _ask_back(asked, names, self._raised, self._explicit)
            if not self._explicit:
                _note_products(name for name in guessed if name not in self.splits)
        return _as_in_products(
            [name for name in guessed if name not in self.splits], self._lines.values()
        )

    def _has_wheel(self) -> bool:
        """Whether r is in a constraint next to an angle: then it is the radius of a wheel."""
        held = [
            token.text
            for pointer, line in self._lines.items()
            for part in split_at(";,", line)
            if pointer.startswith("/constraints")
            or (pointer.startswith("/equations") and not moving_names(part, 2))
            for token in walk(part)
        ]
        return "r" in held and not nm.GREEK_NAMES.isdisjoint(
            name.rstrip("_0123456789") for name in self._coordinates
        )

    def _has_radius(self) -> bool:
        """Whether x^2 + y^2 is written out in each equation that has r: then r is a constant,
        which is noted.
        """
        written = _radius(self._coordinates)
        parts = [part for line in self._lines.values() for part in split_at(";,", line)]
        with_r = [
            part
            for part in parts
            if any(token.text == "r" for token in walk(part)) and not labels.is_at_a_number(part)
        ]
        out = written and all(
            any(written in spelled(token.inside).replace("(t)", "") for token in walk(part))
            for part in with_r
        )
        if out:
            reader.note("r", "one constant", *_may_be_motion("r", self._coordinates))
        return bool(out)

    def _is_known(self, token: Token) -> bool:
        if token.kind != "name" or _slope_of(token, self._declared)[0] in self._slopes:
            return True
        return not self._known.isdisjoint((token.text, self._declared.spelling(token.text)))

    def _call(self, bracket: Token, timed: bool) -> Words:
        """The coordinates (and t) in brackets after a name; empty if the brackets contain anything
        else.
        """
        names = tuple(
            spelled(part).removesuffix("(t)") for part in split_at(",", bracket.inside)
        )  # x(t) is x
        distinct = len(names) == len({*names}) and {*self._coordinates, *["t"] * timed}.issuperset(
            names
        )
        return names if bracket.is_bracket() and distinct else ()

    def _arguments(self, line: Line, place: int) -> Words:
        """The arguments after an undeclared name: coordinates, or u1, u2 of any formulas; empty for
        a factor.
        """
        name, after = line[place].text, at(line, after_power(line, place + 1))
        bracket = after if spelled(after.inside) == "t" else at(line, place + 1)  # omega^2(t)
        found = self._call(bracket, _may_depend_on_time(name))
        count = (
            0
            if found or name in self._factors
            else _called_with(line, place, self._declared, self._defined)
        )
        numbered = tuple(f"u{number}" for number in range(1, count + 1))
        return found or (numbered and self.functions.get(name, numbered))

    def _add(self, line: Line, place: int, pointer: str) -> None:
        """Add the undeclared name as a function, a product, or a constant."""
        token, after, arguments = line[place], at(line, place + 1), self._arguments(line, place)
        name = token.text
        factors, parts = (
            nm.only_split(name, self._declared),
            nm.split_at_function(name, self._declared),
        )
        of_function = (
            bool(arguments and factors) and self._declared.role(factors[-1]) == "function"
        )  # qA(x)
        if len(arguments) == 1 and _is_apart(token, after) and not of_function:
            raise _product_or_function(token, after, arguments[0], self._texts[pointer])
        ends = next(filter(name.endswith, nm.ENDINGS), "")
        takes = bool(ends) and _takes_argument(token, after)
        if ends and takes and not (parts or of_function or after.is_bracket()):
            raise nm.undeclared(name, token.column, (f"{name.removesuffix(ends)}*{ends}",))
        if of_function or (parts and (takes or not ends)):
            self.splits[name] = factors if of_function else parts
            return
        if arguments and "_" in name:
            self._subscripted.setdefault(name, (pointer, token, after.end + 1))
        if arguments and not _looks_like_a_function(name):
            self.functions.setdefault(name, arguments)
            _note_function(token, after)
        elif not arguments and token.order and factors:
            self.splits[name] = factors
        elif not (arguments or token.order or (name in nm.FUNCTION_LETTERS and after.is_bracket())):
            self._constants.setdefault(name, (pointer, token, 0))

    def _refuse_other_meanings(self, line: Line, place: int, outer: Token, pointer: str) -> None:
        """InputError for x^T, Delta x (usually a difference), diff(V, x) of a constant V, 2j,
        3mu^2, and cn(u, k).
        """
        token, before, after = line[place], at(line, place - 1), at(line, place + 1)
        name, column = token.text, token.column
        if name == "T" and (before.is_operator("^") or (outer.is_operator("^") and len(line) == 1)):
            raise fault("raised T", column)
        by = (
            at(line, place + 2).text
            if not place and outer.text in nm.DERIVATIVE_NAMES and after.text == ","
            else ""
        )
        if by in self._coordinates and name not in self._slopes:
            raise fault("derivative of a parameter", column, name=name, by=by)
        if name == "j" and not token.space_before and before.kind == "number":
            reason = nm.REFUSED_UNLESS_DECLARED["i"]
            raise nm.refused(f"j {reason.problem}", reason, column)
        head, _, below = name.partition("_")
        if head in _FIELDS and len(below) == 2 and below[0] == below[1] and below.isalpha():
            raise fault("second slope", column, token.span, shown=name, by=below[0])
        of_base = nm.reason_against(name, column) if name.startswith("log_") else None
        if error := of_base or _half_a_number(line, place):
            raise error
        alone = line is self._lines[pointer]  # 1/(2 m) has no unit
        if before.kind == "number" and (unit := _unit(line, place, alone, self._coordinates)):
            span = (before.column, column + len(unit))
            raise fault("unit", column, span, number=before.text, unit=unit)
        over = at(line, place - 2)
        if _LUMP.fullmatch(name) and before.is_operator("/") and over.kind == "name":  # q/mE
            words = {"over": over.text, "under": name[0], "rest": name[1]}
            if not (token.space_before or over.order or self._whole_words):
                raise fault("end of a quotient", column, (over.column, token.span[1]), **words)
        self._refuse_raised_call(*(at(line, place + k) for k in range(4)))
        if name == "d" and after.text == "t":
            raise fault("differential", column)
        if name == "Delta" and after.kind == "name":
            raise fault("difference", column, name=after.text)
        typed = self._texts[pointer][column - 1 : column + 1]
        if "u" in self._coordinates and typed == name and name in ("mu", "nu"):
            lines = [token for line in self._lines.values() for token in walk(line)]
            product = before.kind == "number" or after.is_operator("^")  # 3mu^2
            alone = any(one.text == name[0] for one in lines)
            if product or alone or self._declared.role(name[0]):
                raise nm.undeclared(name, column, (f"{name[0]}*u",))
            reader.note(name, "the Greek letter", f"{name[0]}*u")
        arguments = _elliptic_arguments(line, place)
        if arguments and (
            error := nm.reason_against(name, column, '["u", "k"]' if arguments > 1 else '["u"]')
        ):
            raise error
        if after.is_bracket() and not after.space_before and nm.misspelt(name):
            raise nm.unknown_name(name, self._declared, column, "(")

    def _refuse_raised_call(
        self, name: Token, caret: Token, exponent: Token, bracket: Token
    ) -> None:
        """InputError for k^2(x), which may be (k(x))^2 or a product, and for f^(2)(x), a
        derivative.

        k^2(x - y) is a product, k^2(t) the square of k(t), and k^2(x) that of k(x) if k(x) occurs
        in the texts.
        """
        if not caret.is_operator("^") or not bracket.is_bracket():
            return
        raised = at(exponent.inside, 0)
        inside = [
            each.text
            for each in walk(bracket.inside)
            if each.kind != "bracket" and not each.is_operator(",")
        ]
        if (
            raised.kind == "number" and raised.column > exponent.column
        ):  # typed by the writer, not from LaTeX
            words = {"name": name.text, "power": raised.text, "of": spelled(bracket.inside[:1])}
            raise fault("power or derivative", name.column, **words)
        called = inside == ["t"] or (name.text, tuple(inside)) in self._calls
        if inside and not called and {"t", *self._coordinates}.issuperset(inside):
            power = spelled([exponent]).strip("()")
            raise fault(
                "power before a bracket", name.column, name=name.text, power=power, of=inside[0]
            )


def _as_in_products(names: Sequence[str], lines: Iterable[Line]) -> Words:
    """The names ordered as in the products: m, g, l for m l^2 theta'' = -m g l sin(theta);
    otherwise as they appear.
    """
    products = list[list[str]]()
    for line in lines:
        products.append([])
        for token in flat(line):
            if token.kind == "operator" and token.text not in ("*", "^", "/"):
                products.append([])
            products[-1].append(token.text)
    return collecting.in_order_of_products(names, products)


def _product_or_function(
    name: Token, bracket: Token, argument: str, text: str
) -> errors.InputError:
    """The error for k (x) and k [x], with both ways to write it."""
    plain = text[bracket.end - 1 : bracket.end] in (")", "]")  # not \\right)
    span = (name.column, bracket.end + 1) if plain else None
    return fault(
        "product or function", name.column, span, name=name.text, argument=argument, span=span
    )


def _slopes(lines: Iterable[Line], declared: nm.Names) -> dict[str, Words]:
    """Each undeclared V as a function of the coordinates that its derivatives use: all, or r alone
    for dV/dr.

    A potential U or V depends on no momenta.
    """
    found: dict[str, set[str]] = {}
    partial: set[str] = set()
    for line, place, _ in (each for tokens in lines for each in places(tokens)):
        called, inside = line[place], at(line, place + 1).inside
        head, letters = _slope_of(called, declared)
        if head:
            found.setdefault(head, set()).update(letters)
            partial.add(head)
            continue
        name, comma = at(inside, 0), at(inside, 1)
        if called.text not in nm.DERIVATIVE_NAMES or name.kind != "name" or name.order:
            continue
        by = [token.text for token in inside[2:] if not token.is_operator(",")]
        if not called.value and any(each.endswith(("_i", "_j")) for each in by):
            continue  # \partial V/\partial x_i means all x_1, x_2, …
        if (
            comma.is_operator(",")
            and by
            and {*by} <= {*declared.coordinates}
            and not declared.role(name.text)
        ):
            found.setdefault(name.text, set()).update(by)
            partial |= set() if called.value else {name.text}
    every = {*declared.coordinates}
    positions = {name for name in every if not nm.is_momentum(name, declared.coordinates)}
    known = {
        name: by
        for name, by in found.items()
        if by == (positions if name in nm.POTENTIALS else every)
        or (len(by) == 1 and name not in partial)
    }
    return {name: tuple(x for x in declared.coordinates if x in by) for name, by in known.items()}


def _slope_of(token: Token, declared: nm.Names) -> tuple[str, Sequence[str]]:
    """(V, coordinates) for the V_x of an undeclared potential V; ("", ()) for other tokens."""
    head, _, below = token.text.partition("_") if token.kind == "name" else ("", "", "")
    letters, moving = [below], below in declared.coordinates
    free = not (token.order or declared.role(head) or declared.role_meant(token.text))
    return (head, letters) if head in nm.POTENTIALS and moving and free else ("", ())


def _is_one_of_many(name: str, coordinates: Sequence[str]) -> bool:
    """Whether it is x_1 or x2 and a coordinate is x or x with another number; x_0 is usually a
    constant.
    """
    numbered = re.fullmatch("([A-Za-z]+)_?([1-9][0-9]*)", name)
    stems = {re.sub("_?[0-9]+$", "", coordinate) for coordinate in coordinates}
    if numbered is None or numbered[1] not in stems:
        return False
    return nm.looks_like_a_coordinate(numbered[1]) or numbered[1] in nm.GREEK_NAMES


def _takes_argument(name: Token, after: Token) -> bool:
    """Whether an argument follows the cos of Rcos: a bracket, a name, or a number; after ln, one
    without a space.
    """
    touches = not after.space_before or (after.kind == "name" and not name.text.endswith("ln"))
    return after.is_bracket() or (after.kind in ("name", "number") and touches)


def _is_constant(line: Line, place: int, outer: Token) -> bool:
    """Whether the g here precedes no bracket and is not differentiated; if so, g( is a product
    everywhere.
    """
    after = at(line, after_power(line, place + 1))
    differentiated = not place and outer.text in nm.DERIVATIVE_NAMES
    return line[place].text in ("g", "G") and not differentiated and after.kind != "bracket"


def _is_charge(lines: Iterable[Line]) -> bool:
    """Whether every e is that of e E, e B/(m c), or e^2/r, next to a field or over a distance; not
    that of e^(-t), of the A e-kt whose exponent lost its place, nor of e x, which may be e^x.
    """
    every = [each for tokens in lines for each in places(tokens)]
    words = {line[place].text.partition("_")[0] for line, place, _ in every}
    potential = any(
        line[place].text in ("phi", "varphi", "V", "U") and at(line, place + 1).is_bracket()
        for line, place, _ in every
    )
    found = False
    for line, place, _ in every:
        token, before, after = (at(line, place + k) for k in (0, -1, 1))
        if token.text != "e" or token.kind != "name":
            continue
        behind = after_power(line, place + 1)
        power, end = [*walk(line[place + 2 : behind])], at(line, behind)
        glued = end.is_operator("+", "-") and not (end.space_before and line[behind + 1 :][:1])
        squared = spelled(power[-1:]) == "2" and not _is_factor(end)
        alone = len(line) == 1  # e/(2 c) in LaTeX
        field = (potential or not words.isdisjoint(("E", "B", "A", "Phi", "epsilon"))) and (
            bool(power)
            or alone
            or any(_is_factor(one) or one.is_operator(*"*/") for one in (before, after))
        )
        numeric = all(each.kind in ("number", "bracket") for each in power)
        if token.order or glued or not numeric or not (squared or field):
            return False
        found = True
    return found


def _is_factor(token: Token) -> bool:
    return token.kind in ("name", "number", "bracket")


def _called_with(line: Line, place: int, declared: nm.Names, defined: Collection[str]) -> int:
    """The number of arguments of an undeclared F in F(x*y), F(x, x') or f(y/x); 0 if it may be a
    factor.

    V(r) also counts for a `defined` r, as in r = sqrt(x^2 + y^2).
    """
    bracket, name = at(line, place + 1), line[place].text
    count = len(split_at(",", bracket.inside))
    if not bracket.is_bracket() or (name not in CALLED_LETTERS and (count == 1 or len(name) > 1)):
        return 0
    names = [declared.spelling(token.text) for token in walk(bracket.inside)]
    moves = any(each in ("t", *defined) or declared.role(each) == "coordinate" for each in names)
    heavy = at(line, place - 1).text in ("m", "M")
    weight = heavy or any(
        [each.kind for each in term] == ["number"] for term in split_at("+-", bracket.inside)
    )
    product = weight and name in ("g", "G")  # g(1 - x/l), mg(l - x)
    return 0 if bracket.space_before or not moves or product else count


def _has_explicit_products(found: Iterable[tuple[Line, int, Token]]) -> bool:
    """Whether every product has its sign, as in programs."""
    signs = False
    for line, place, _ in found:
        token, after = line[place], at(line, place + 1)
        signs |= token.is_operator("*")
        factor = token.kind in ("name", "number", "bracket")
        called = token.kind == "name" and after.is_bracket()
        if factor and not called and after.kind in ("name", "number", "bracket"):
            return False
    return signs


def _ask_back(
    guessed: Mapping[str, _Found], names: nm.Names, raised: Mapping[str, bool], explicit: bool
) -> dict[str, Words]:
    """The runs of letters that are clearly products; InputError for the first name that may not be
    a constant.
    """
    words = [name for name in guessed if 1 < len(name) < 4 and name.isalpha() and name[0] != "d"]
    shared = {
        letter
        for first, second in itertools.combinations(words, 2)
        for letter in {*first} & {*second}
    }
    plain = [name for name in guessed if re.fullmatch("[A-Za-z][0-9]*", name)]
    letters = (*plain, *shared)  # ml and mgl are products
    together = nm.Names(names.coordinates, (*names.parameters, *letters), names.functions)
    seen: dict[str, str] = {}
    splits: dict[str, Words] = {}
    ends = [name for name in guessed if name[0] in _COMPONENTS and name[1:] in names.coordinates]
    heads = [name[0] for name in ends]
    components = {name for name in ends if heads.count(name[0]) > 1}  # Fx and Fy
    for name, (pointer, token, end) in guessed.items():
        column = token.column
        if name not in components and (parts := nm.only_split(name, together)):
            splits[name] = parts
            continue
        parts = nm.factors_of(name)
        mechanical = name.removesuffix("e" * (not raised.get(name, True)))  # k e^(-x)
        of_motion = _FACTOR_OF_MOTION.fullmatch(mechanical) is not None
        squared = name in raised and name not in plain and parts  # ml^2 is m*l^2
        mixed = name[:2] == "mg" or not (name.islower() or name.istitle() or name.isupper())
        if _WEIGHT.fullmatch(name) or (
            of_motion and (squared or (mixed and {*parts} & {*plain}))
        ):  # ml^2, mgl, and GMm
            splits[name] = parts
            continue
        if _FREQUENCY.fullmatch(name) and not {*parts} & {*plain}:
            _note_products([name])
            continue
        if squared and not (explicit and {*parts}.isdisjoint(plain)):  # wn^2 of a program
            raise nm.undeclared(name, column, ("*".join(parts),)).at(pointer)
        if meant := nm.readings(name, together) or _lost_power(name, names.coordinates):
            raise nm.undeclared(name, column, meant, (column, end) if end else None).at(pointer)
        _ask_about_motion({name: (pointer, token, end)}, names)
        other = seen.setdefault(name.replace("_", ""), name)
        if other != name:
            raise fault("two spellings", column, name=shorten(name), other=other).at(pointer)
    return splits


def _note_function(name: Token, bracket: Token) -> None:
    """Note that h(x - b) is a value of a function, and could be a product."""
    sums = any(token.is_operator("+", "-") for token in bracket.inside[1:])
    if name.text in _FACTORS_OR_FUNCTIONS and sums and len(split_at(",", bracket.inside)) == 1:
        inside = source([bracket])
        reader.note(f"{name.text}{inside}", f"a function {name.text}", f"{name.text}*{inside}")


def _note_products(names: Iterable[str]) -> None:
    """Note that EI is one constant, and could be E I."""
    for name in names:
        parts = nm.factors_of(name)
        if [len(part) for part in parts] == [1, 1] and name.isascii():
            reader.note(name, "one constant", "*".join(parts))


def _ask_about_motion(guessed: Mapping[str, _Found], names: nm.Names) -> None:
    """InputError for the first name that may move, or be the time; no more is asked about the names
    of a program, which has no products without a sign: Mc and mut are names.
    """
    for name, (pointer, token, _) in guessed.items():
        column = token.column
        if name == "x" or _is_one_of_many(name, names.coordinates):
            raise nm.ask_for_the_time(name, column, names.coordinates).at(pointer)
        if name in ANY_SPEED and pointer.startswith("/constraints"):
            raise fault("any speed", column, name=name).at(pointer)
        if alike := _may_be_motion(name, names.coordinates):
            raise nm.undeclared(name, column, alike).at(pointer)


def _lost_power(name: str, coordinates: Sequence[str]) -> Words:
    """x^2 for x2 next to x, a*x^2 for ax2, xdot^2 for xdot2, and dx/dt for dxdt, which lost a sign
    when pasted.

    Also a*q2 for aq2 next to q1; Fx1 is usually a component.
    """
    if dotted := re.fullmatch("([A-Za-z]+dot)([2-9])|d([A-Za-z]+)dt", name):
        return (f"d{dotted[3]}/dt" if dotted[3] else f"{dotted[1]}^{dotted[2]}",)
    cut = re.fullmatch("((?:[A-Za-z][0-9]?){0,3}?)([A-Za-z])([1-9])", name)
    if cut is None or cut[1] in _COMPONENTS:
        return ()
    if cut[2] in coordinates and cut[3] != "1":
        return (f"{cut[1]}{'*' * bool(cut[1])}{cut[2]}^{cut[3]}",)
    return (
        (f"{cut[1]}*{cut[2]}{cut[3]}",)
        if cut[1] and _is_one_of_many(cut[2] + cut[3], coordinates)
        else ()
    )


def _radius(coordinates: Sequence[str]) -> str:
    """x^2+y^2+z^2, or what of it moves; empty without x and y."""
    moving = [name for name in ("x", "y", "z") if name in coordinates]
    return "+".join(f"{name}^2" for name in moving) if moving[:2] == ["x", "y"] else ""


def _may_be_motion(name: str, coordinates: Sequence[str]) -> Words:
    """What a name may mean: t for time, a length for r, x' for v, Theta for theta, x for X; R and r
    may coexist.
    """
    if name == "time":
        return ("t",)
    if name == "r" and (written := _radius(coordinates)):
        return (f"sqrt({written.replace('+', ' + ')})",)
    if name in _WORDS_OF_MOTION:
        return tuple(f"{each}{_WORDS_OF_MOTION[name]}" for each in coordinates[:1])
    meant = name.lower() if name in ("X", "Y", "Z") else name
    return tuple(other for other in coordinates if other != name and other.lower() == meant)


def _unit(line: Line, place: int, alone: bool, coordinates: Sequence[str]) -> str:
    """The N/m of k = 3 N/m and of 3 N/m `alone`, the m/s of 2 m/s; empty for other names after a
    number.
    """
    rest = list(itertools.takewhile(lambda token: not token.is_operator(",", ";"), line[place:]))
    given = line[place].space_before and (
        at(line, place - 2).is_operator("=") or (alone and place < 2)
    )
    if (
        given
        and _UNIT.fullmatch(source(rest))
        and not {token.text for token in rest} & {*coordinates}
    ):
        return source(rest)
    return "m/s" * (spelled(line[place : place + 3]) == "m/s" and "s" not in coordinates)


def _half_a_number(line: Line, place: int) -> errors.InputError | None:
    """The error for 1.0d-3 and 2D0 (Fortran), 0.5f (C), 1f0 (Julia), 0o7, whose letters are not
    factors.
    """
    token, before = line[place], at(line, place - 1)
    if before.kind != "number" or token.space_before:
        return None
    text, after = (
        token.text,
        [other.text for other in line[place + 1 : place + 3] if not other.space_before],
    )
    power = text in ("d", "D") and len(after) == 2 and after[0] in "+-" and after[1].isdigit()
    suffix = re.fullmatch("[dDfF][0-9]{1,3}", text) is not None or (
        text in ("f", "F") and "." in before.text
    )
    if not (power or suffix or before.text == "0"):
        return None
    shown = before.text + text + "".join(after) * power
    return fault("half a number", before.column, shown=shown, letters=text)


def _is_apart(name: Token, after: Token) -> bool:
    """Whether this is k (x), which may be k*x; f (x) and V (x) are usually functions."""
    return name.text not in nm.FUNCTION_LETTERS and after.is_bracket() and after.space_before


def _looks_like_a_function(name: str) -> bool:
    """Whether the name may be a known function, such as a mistyped sqrt or acot; then it is not
    guessed.

    gamma(t) and zeta(x) are usually coefficients; Gamma is the function.
    """
    is_word = re.match("[A-Za-z]{3}", name) is not None and name not in nm.GREEK_NAMES
    known = nm.REFUSED_UNLESS_DECLARED.keys() - {"gamma", "zeta"}
    return is_word or not known.isdisjoint((name, name.replace("_", "")))


def _elliptic_arguments(line: Line, place: int) -> int:
    """The number of arguments of sn u, cn(u, k) and dn^2(u, k); 0 for a constant, as in cn*x."""
    after = at(line, after_power(line, place + 1))
    if line[place].text not in nm.ELLIPTIC:
        return 0
    return len(split_at(",", after.inside)) if after.is_bracket() else int(after.kind == "name")


def _may_depend_on_time(name: str) -> bool:
    """Whether name(t) may be a function of time: not x(t), a coordinate without an equation,
    delta(t), or a word.
    """
    moves = nm.looks_like_a_coordinate(name) and name not in ("q", "r", "s", "tau")
    return not (moves or name in _IMPULSES or _looks_like_a_function(name))


def words_of(text: str) -> list[str]:
    """ "x y" and "k, m" as lists of names."""
    return [word for word in re.split(r"[,\s;]+", text) if word]


def parameters_of(text: str) -> dict[str, str | None]:
    """ "m, k = 1/2" and "k = 2 m" as names with their values, None for a generic one."""
    pairs = [part.partition("=") for part in _BETWEEN_PARAMETERS.split(text)]
    return {name.strip(): value.strip() or None for name, _, value in pairs if name.strip()}


def functions_of(text: str) -> dict[str, list[str]]:
    """ "A(r1), V(x, y)" as names with their arguments; raises InputError for anything else."""
    if _CALL.sub("", text).strip(" ,;\n"):
        raise fault("functions as a text", "/functions")
    return {match[1]: words_of(match[2]) for match in _CALL.finditer(text)}


def with_guess(document: Mapping[str, Any]) -> dict[str, Any]:
    """The same document, with undeclared names treated as constants."""
    named = document.get("parameters") or ()
    if isinstance(named, Mapping):
        return {**document, "parameters": {**named, AND_GUESS: None}}
    declared = isinstance(named, list) and named
    return {**document, "parameters": [*named, AND_GUESS] if declared else GUESS}
