"""Find the names of a document: declared, derived from its formulas, or guessed on request.

A name with a time derivative is a coordinate. The answer lists all guessed names.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from inverse_service import errors
from inverse_service.expressions.refusals import LIMITS, fault, listed_names
from inverse_service.reading import (
    declarations,
    guessed_names,
    names as nm,
    reader,
    time_derivatives,
)
from inverse_service.reading.declarations import Declared, Known, Texts, Words
from inverse_service.reading.tokens import (
    Line,
    Token,
    after_power,
    at,
    places,
    spelled,
    split_at,
    walk,
)

# Other spellings of a second derivative, with the message for each.
_SPELLED = {
    "two subscripts": re.compile(
        r"(?<![A-Za-z0-9_])(?!I_)([A-Za-z]\w*)_\{?([a-ce-z])\2\}?(?![A-Za-z0-9_])"
    ),
}
HAMILTONIAN = re.compile(r"\s*(\\(?:mathcal|mathscr)\s*\{?\s*H\s*\}?|H)\s*(?:\([^()]*\))?\s*=")
# Angles of planes and cones.
_INCLINATIONS = frozenset(("alpha", "beta", "gamma"))


def known_names(
    declared: Declared, texts: Texts, order: int = 2, keys: Sequence[str] = (), pairs: bool = False
) -> Known:
    """The names that the formulas of a document may use, with their substitutions; see
    `document_names`.
    """
    where = {f"/where/{nm.escaped(name)}": text for name, text in declared.where.items()}
    names = document_names(declared, {**texts, **where}, order, keys, pairs)
    definitions, calls = declarations.expanded_definitions(declared.where, names)
    values = declarations.parameter_values(declared.named_parameters())
    return Known(replace(names, definitions=definitions), definitions, calls, values)


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
            declarations.bounded(list(named), "/parameters", "parameters", LIMITS.names)
        )
    )
    functions = {
        nm.declared_name(
            key, f"/functions/{nm.escaped(key)}", "function"
        ): declarations.declared_arguments(key, words)
        for key, words in declared.functions.items()
    }
    declarations.bounded(list(declared.functions), "/functions", "functions", LIMITS.names)
    called = {
        declarations.defined_name(key): key.partition("(")[2].rstrip(" )")
        for key in declared.where
        if key.endswith(")")
    }
    functions |= {
        name: declarations.declared_arguments(name, words.split(","))
        for name, words in called.items()
    }
    defined = tuple(
        name for key in declared.where if (name := declarations.defined_name(key)) not in called
    )
    names = nm.Names((), (*parameters, *defined), functions)
    names = replace(names, raised=reader.letters_with_indices(texts.values()))
    names = with_products(names, declared, texts, order)
    if declared.guesses and order == 2 and declared.coordinates is None:
        driven = _driving_motions(texts, names, keys)
        for name in driven:
            reader.note(f"{name}(t)", "a given motion", f"a coordinate {name}")
        names = replace(names, functions={**names.functions, **dict.fromkeys(driven, ("t",))})
    names = replace(names, coordinates=_coordinates(declared, names, texts, order, keys))
    if declared.guesses:
        names = guessed_names.with_undeclared(
            texts, names, {argument for name in called for argument in functions[name]}
        )
    if not pairs:
        nm.check_clashes(names, keyed)
    nm.refuse_two_spellings(texts, names.declared(), reader.parts)
    return replace(names, functions=_checked_functions(names, texts))


def _driving_motions(texts: Texts, names: nm.Names, keys: Sequence[str]) -> Words:
    """The y of c (x' - y'(t)) + k (x - y(t)): always written as a function of the time next to an x
    that never is, in fewer equations than names with two primes. Such a y moves as it is told.

    An x(t) alone may be the coordinate x, whose equation was forgotten.
    """
    lines = [reader.tokens_if_any(text, names) for text in texts.values()]
    letters = {token.text for line in lines for token in walk(line)}
    called = [
        (_last_of_run(line[place], names, letters), spelled(at(line, place + 1).inside) == "t")
        for tokens in lines
        for line, place, _ in places(tokens)
        if line[place].kind == "name"
    ]
    plain = {name.text for name, timed in called if not timed}
    moving = {name for line in lines for name in time_derivatives.moving_names(line, 2)}
    equations = len(keys) or sum(token.is_operator("=") for line in lines for token in line)
    told = [
        name.text
        for name, timed in called
        if timed and name.text not in plain and names.role_meant(name.text) is None
    ]
    own = moving - {*told}
    if not own or not own <= plain or len(own) > equations:
        return ()
    rates = {name.text for name, timed in called if timed and name.order}
    alone = {
        name
        for name in told
        if name in rates or name not in letters or _is_beside(name, own, lines)
    }
    return tuple(
        name
        for name in dict.fromkeys(told)
        if name in alone
        and nm.looks_like_a_coordinate(name)
        and (name not in moving or len(moving) > equations)
    )


def _last_of_run(token: Token, names: nm.Names, letters: Collection[str]) -> Token:
    """The y of ky next to k or mx'': the product of a stiffness or damping and y."""
    name = token.text
    run = len(name) == 2 and name[0] in "bckm" and nm.looks_like_a_coordinate(name[1])
    apart = names.splits or name[0] in letters
    known = name in names.splits or names.role_meant(name)
    return replace(token, text=name[1]) if run and apart and not known else token


def _is_beside(name: str, moving: Collection[str], lines: Sequence[Line]) -> bool:
    """Whether the y of x - y(t) is here, a difference of two positions in brackets."""
    inside = (
        {spelled(term) for term in split_at("+-", token.inside)}
        for line in lines
        for token in walk(line)
        if token.is_bracket()
    )
    return any(f"{name}(t)" in terms and terms & {*moving} for terms in inside)


def with_products(names: nm.Names, declared: Declared, texts: Texts, order: int = 2) -> nm.Names:
    """The names, including the m and x of mx'' if undeclared names may be guessed."""
    if not declared.guesses:
        return names
    names = replace(names, guesses=True)
    products = time_derivatives.moving_products(texts, names, order)
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
        found = tuple(
            dict.fromkeys(time_derivatives.key_name(key, names) for key in keys)
        ) or time_derivatives.inferred_coordinates(texts, names, order)
        if order == 1 and names.guesses and declared.where:
            found = tuple(dict.fromkeys((*found, *_moved_by_definitions(texts, names))))
        if texts and not found:
            raise _nothing_moves(texts, names, order) or _without_motion(texts, order, pointer)
    if not found:
        raise fault("no coordinates", pointer)
    return tuple(declarations.bounded(list(found), pointer, "coordinates", declared.most))


def _without_motion(texts: Texts, order: int, pointer: str) -> errors.InputError:
    """The error for an L without velocities, and for equations without accelerations."""
    if order == 1:
        return fault("no velocity", pointer)
    slow = [
        name
        for text in texts.values()
        for name in time_derivatives.moving_names(reader.tokens_if_any(text, nm.Names()), 1)
    ]
    if slow:
        return fault("first order", pointer, name=slow[0])
    equal = any("=" in text for text in texts.values())
    return fault("no acceleration" if equal else "no equation", pointer)


def _moved_by_definitions(texts: Texts, names: nm.Names) -> list[str]:
    """The theta of x = l sin(theta) and the r of x = r cos(phi) if L has x': angles, and names such
    as r, rho, and x.

    An angle is the argument of a sine or cosine with numbers as its only factors: nothing moves in
    cos(omega t + phi), nor the alpha of y = x tan(alpha) and x = r sin(alpha) cos(theta), nor the r
    of x = r theta, the way that a wheel rolls, where theta has a velocity of its own.
    """
    formulas = {
        name: text
        for pointer, text in texts.items()
        if (name := names.spelling(pointer.removeprefix("/where/")))
    }
    todo = [
        names.spelling(name)
        for name in time_derivatives.inferred_coordinates(
            texts, replace(names, parameters=(), functions={}), 1
        )
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
        ways = [term for term in terms if not term & nm.FUNCTIONS]
        radii = {each for way in ways if way & alone & nm.GREEK_NAMES for each in way - alone}
        for line, place, outer in places(tokens):
            token, each = line[place], names.spelling(line[place].text)
            theta = token.text == "th" and _is_theta(at(line, place + 1), outer)
            known = token.text in nm.FUNCTIONS | {"pi"} and not theta
            if token.kind != "name" or token.text == "t" or known:
                continue
            if names.role(each) == "parameter" and each not in todo:
                todo.append(each)
            elif nm.only_split(each, moving):
                continue  # k x of y = A cos(kx)
            elif names.role(each) is None and (
                each == "rho"
                or spelled([at(line, place + 1)]) == "(t)"
                or (
                    nm.looks_like_a_coordinate(each)
                    and each not in radii
                    and not guessed_names.lost_power(each, [*alone])
                )
                or (each not in fixed and is_angle(line, place, outer))
            ):
                found.setdefault(each)
    return list(found)


def _is_theta(after: Token, outer: Token) -> bool:
    """Whether th is no tanh: without a bracket behind it, and in sin(th(t))."""
    timed = spelled([after]) == "(t)" and outer.text in ("sin", "cos")
    return after.kind != "bracket" or timed


def is_angle(line: Line, place: int, outer: Token) -> bool:
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
    for name in time_derivatives.inferred_coordinates(texts, nm.Names(), order):
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
