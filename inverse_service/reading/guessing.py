"""Which names in a text are parameters and arbitrary functions, where the writer did not say.

An unknown name followed by coordinates or t in brackets is a function of them; any other is a parameter,
unless it may be something else: kx, dx, sinx, or an r that no equation moves. Then the writer is
asked. What was guessed is shown to the writer.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from inverse_service import errors
from inverse_service.expressions import refusals
from inverse_service.reading import moving_names, reader, tokens
from inverse_service.reading.names import (
    DERIVATIVE_NAMES,
    FUNCTIONS,
    GREEK_NAMES,
    REFUSED,
    REFUSED_UNLESS_DECLARED,
    RESERVED,
    Names,
    ask_for_the_time,
    looks_like_a_coordinate,
    not_declared,
    only_split,
    readings,
    reason_against,
    refused,
    split_before_argument,
    undeclared,
)

# Refused as functions or as numbers, so they would be a strange guess for a parameter too.
NEVER_GUESSED = (
    RESERVED
    | FUNCTIONS
    | REFUSED.keys()
    | {"e", "E", "Pi"}
    | (REFUSED_UNLESS_DECLARED.keys() - {"I", "gamma", "Gamma", "zeta", "sn", "cn", "dn"})
)
# Bessel's, Airy's and the integral functions; as constants these names are as good as any.
_SPECIAL = frozenset(("J0", "J1", "Y0", "Y1", "Ai", "Bi", "Si", "Ci", "Ei", "Li"))
FUNCTION_LETTERS = frozenset("fFhHUVW")
CALLED_LETTERS = FUNCTION_LETTERS | {"g", "G", "phi", "Phi", "psi", "Psi", "P", "Q"}
# Of t these are impulses and steps to most.
Call = tuple[str, tuple[str, ...]]  # a name with the names in the brackets after it
_PROGRAMS = re.compile(r"\b(?:Eq|diff|Derivative|Mul|Add)\s*\(|\[")  # where E is Euler's number
_IMPULSES = frozenset(("delta", "theta", "Theta", "H"))


@dataclass(frozen=True, slots=True)
class Guess:
    """Names in the order in which they occur; `functions` with their arguments; `splits` are runs of letters."""

    parameters: tuple[str, ...] = ()
    functions: dict[str, tuple[str, ...]] = field(default_factory=dict)
    splits: dict[str, tuple[str, ...]] = field(default_factory=dict)


_MOST_ROUNDS = 4  # a run that is split may hold a name that splits others


def with_guessed(texts: Mapping[str, str], declared: Names) -> Names:
    """The names with those that the texts use beyond what is declared and the coordinates; InputError as `_guessed`.

    Where it asks back, a bracket without its other half is named first, as it may change all that.
    """
    try:
        for _ in range(_MOST_ROUNDS):
            guess = _guessed(texts, declared)
            if not guess.splits:
                break
            declared = replace(declared, splits={**declared.splits, **guess.splits})
        both = (*declared.parameters, *guess.parameters)
        return replace(declared, parameters=both, functions={**declared.functions, **guess.functions})
    except errors.InputError:
        for pointer, text in texts.items():
            try:
                tokens.check_brackets(_tokens(text, declared))
            except errors.InputError as error:
                raise error.at(pointer) from None
        raise


def _guessed(texts: Mapping[str, str], declared: Names) -> Guess:
    """What the texts, given by their pointers, use beyond what is declared and the coordinates.

    A text that cannot be read adds nothing: its fault is reported where it is read. InputError, with what may
    have been meant, for a suspect name.
    """
    lines = {
        pointer: _tokens(text, replace(declared, forms=pointer.startswith("/constraints")))
        for pointer, text in texts.items()
    }
    coordinates = declared.coordinates
    found_functions: dict[str, tuple[str, ...]] = {}
    found_parameters: dict[str, tuple[str, tokens.Token]] = {}
    called: dict[str, tuple[str, tokens.Token]] = {}  # U_x(x, y) may be a derivative
    splits: dict[str, tuple[str, ...]] = {}
    slopes = _slopes(lines.values(), declared)
    known = {*coordinates, *declared.declared(), *NEVER_GUESSED}
    raised = {a.text for line in lines.values() for a, b in itertools.pairwise(line) if b.is_operator("^")}
    if "E" not in raised and not any(_PROGRAMS.search(text) for text in texts.values()):
        known -= {"E"}  # a field
    calls = {
        (token.text, arguments)
        for line in lines.values()
        for place, token in enumerate(line)
        if (arguments := _call_arguments(line, place + 1, (*coordinates, "t"))) and not _is_apart(line, place)
    }
    for pointer, line in lines.items():
        for place, token in enumerate(line):
            names = {token.text, declared.spelling(token.text), moving_names.derived_stem(token.text)}
            if token.kind != "name" or names & known:
                continue
            _refuse_operators(line, place, pointer, coordinates, calls, slopes)
            if error := reader.remark(line, place):
                raise error.at(pointer)
            timed = (*coordinates, "t") if _may_depend_on_time(token.text) else coordinates
            arguments = _call_arguments(line, place + 1, timed)
            if not arguments and (count := _called_with(line, place, declared)):
                arguments = tuple(f"u{number}" for number in range(1, count + 1))
                arguments = found_functions.get(token.text, arguments)
            if len(arguments) == 1 and _is_apart(line, place):
                raise _product_or_function(line, place, arguments[0], texts[pointer]).at(pointer)
            if _takes_argument(line, place) and (parts := split_before_argument(token.text, declared)):
                splits[token.text] = parts
                continue
            if arguments and "_" in token.text:
                called.setdefault(token.text, (pointer, token))
            if arguments and not _looks_like_a_function(token.text):
                found_functions.setdefault(token.text, arguments)
            elif not arguments and moving_names.is_primed(line, place):
                if parts := only_split(token.text, declared):
                    splits[token.text] = parts
            elif not arguments and not _may_be_called(line, place):
                found_parameters.setdefault(token.text, (pointer, token))
    for name, by in slopes.items():
        if by == {*coordinates}:
            found_functions.setdefault(name, coordinates)
    guessed = {name: at for name, at in found_parameters.items() if name not in found_functions}
    _ask_back(called, Names(coordinates, (), {**declared.functions, **found_functions}))
    known_names = Names(coordinates, declared.parameters, {**declared.functions, **found_functions})
    splits |= _ask_back(guessed, known_names)
    return Guess(tuple(name for name in guessed if name not in splits), found_functions, splits)


def _product_or_function(line: Sequence[tokens.Token], place: int, argument: str, text: str) -> errors.InputError:
    """The refusal of k (x) and k [x], with both ways to write it."""
    name, end = line[place], line[tokens.closing(line, place + 1)].column
    plain = text[end - 1 : end] in (")", "]")  # and no \\right)
    both = (f"{name.text}*({argument})", f"{name.text}({argument})")
    instead, what = f"write {both[0]} for a product, {both[1]} for a function", f"{name.text} ( could be"
    span = (name.column, end + 1) if plain else None
    return refusals.refusal(f"{what} a product or a function", name.column, instead, both if plain else (), span)


def _slopes(lines: Iterable[Sequence[tokens.Token]], declared: Names) -> dict[str, set[str]]:
    """V with x and y where dV/dx and dV/dy, or diff(V, x), occur and V is not declared."""
    found: dict[str, set[str]] = {}
    for line in lines:
        for place in range(len(line) - 4):
            called, opening, name, *rest = line[place : place + 5]
            if called.text not in DERIVATIVE_NAMES or not opening.is_operator("(") or name.kind != "name":
                continue
            by = [
                token.text for token in line[place + 3 : tokens.closing(line, place + 1)] if not token.is_operator(",")
            ]
            if rest[0].is_operator(",") and by and {*by} <= {*declared.coordinates} and not declared.role(name.text):
                found.setdefault(name.text, set()).update(by)
    return found


def _is_one_of_many(name: str, coordinates: Sequence[str]) -> bool:
    """Whether it is x_1 or x2 and x, or x with another number, is a coordinate; x_0 is a constant to most."""
    numbered = re.fullmatch("([A-Za-z]+)_?([1-9][0-9]*)", name)
    stems = {re.sub("_?[0-9]+$", "", coordinate) for coordinate in coordinates}
    return numbered is not None and numbered[1] in stems and looks_like_a_coordinate(numbered[1])


def _takes_argument(line: Sequence[tokens.Token], place: int) -> bool:
    """Whether a bracket, a name or a number follows at once: Rcos(x), Rcos x of Rcos and a Greek letter."""
    after = line[place + 1] if place + 1 < len(line) else None
    return after is not None and (
        after.is_operator("(") or (after.kind in ("name", "number") and not after.space_before)
    )


_COMPONENTS = frozenset("ABEFJPVpv")  # Fx and Fy are two components to most


def _called_with(line: Sequence[tokens.Token], place: int, declared: Names) -> int:
    """How many arguments stand in F(x*y), F(x, x') and f(y/x), F undeclared; 0 where it may be a factor."""
    opening = place + 1
    while opening < len(line) and line[opening].kind == "prime":
        opening += 1
    if opening >= len(line) or not line[opening].is_operator("("):
        return 0
    end = tokens.closing(line, opening)
    inside = line[opening + 1 : end]
    count = len(tokens.split_at_commas(inside))
    if line[place].text not in CALLED_LETTERS and (count == 1 or len(line[place].text) > 1):
        return 0
    moves = any(token.text == "t" or declared.role(declared.spelling(token.text)) == "coordinate" for token in inside)
    if line[opening].space_before or end == len(line) or not moves:
        return 0
    return count


def _ask_back(guessed: Mapping[str, tuple[str, tokens.Token]], names: Names) -> dict[str, tuple[str, ...]]:
    """The runs of letters that are products to every reader; InputError for the first name that may be no constant."""
    words = [name for name in guessed if 1 < len(name) < 4 and name.isalpha() and name[0] != "d"]
    shared = {letter for first, second in itertools.combinations(words, 2) for letter in {*first} & {*second}}
    letters = (*(name for name in guessed if len(name) == 1), *shared)  # ml and mgl are products
    together = Names(names.coordinates, (*names.parameters, *letters), names.functions)
    seen: dict[str, str] = {}
    splits: dict[str, tuple[str, ...]] = {}
    ends: dict[str, set[str]] = {}  # by its first letter, the coordinates that Fx and Fy end in
    for name in guessed:
        if name[0] in _COMPONENTS and name[1:] in names.coordinates:
            ends.setdefault(name[0], set()).add(name)
    components = {name for both in ends.values() if len(both) > 1 for name in both}
    for name, (pointer, token) in guessed.items():
        column = token.column
        if name not in components and (parts := only_split(name, together)):
            splits[name] = parts
            continue
        if meant := readings(name, together):
            raise undeclared(name, column, meant).at(pointer)
        if name == "x" or _is_one_of_many(name, names.coordinates):
            raise ask_for_the_time(name, column, names.coordinates).at(pointer)
        if name == "r" and {"x", "y"} <= {*names.coordinates}:
            length = "sqrt(" + " + ".join(f"{q}^2" for q in ("x", "y", "z") if q in names.coordinates) + ")"
            raise undeclared(name, column, (length,)).at(pointer)
        if alike := _word_of_motion(name, names.coordinates) or _may_be_motion(name, names.coordinates):
            raise undeclared(name, column, alike).at(pointer)
        other = seen.setdefault(name.replace("_", ""), name)
        if other != name:
            instead = f"{other} occurs too; write one of the two"
            raise refusals.refusal(not_declared(name), token.column, instead, (other,)).at(pointer)
    return splits


_WORDS_OF_MOTION = {"velocity": "'", "speed": "'", "position": "", "acceleration": "''"}


def _word_of_motion(name: str, coordinates: Sequence[str]) -> tuple[str, ...]:
    """t for time, the velocity of the first coordinate for velocity."""
    if name == "time":
        return ("t",)
    return tuple(f"{each}{_WORDS_OF_MOTION[name]}" for each in coordinates[:1] if name in _WORDS_OF_MOTION)


def _may_be_motion(name: str, coordinates: Sequence[str]) -> tuple[str, ...]:
    """The velocities for v, the coordinate Theta for theta, x for X; R beside r is a constant to most."""
    if name == "v":
        return tuple(f"{coordinate}'" for coordinate in coordinates[:1])
    meant = name.lower() if name in ("X", "Y", "Z") else name
    return tuple(other for other in coordinates if other != name and other.lower() == meant)


def _refuse_operators(
    line: Sequence[tokens.Token],
    place: int,
    pointer: str,
    coordinates: Sequence[str],
    calls: Collection[Call],
    slopes: Mapping[str, set[str]],
) -> None:
    """InputError for x^T, Delta x (a difference to most), diff(V, x) of a constant V, and 2j."""
    token = line[place]
    before = [other.text for other in line[max(place - 2, 0) : place]]
    after = line[place + 1] if place + 1 < len(line) else None
    if token.text == "T" and (before[-1:] == ["^"] or (before == ["^", "("] and after and after.is_operator(")"))):
        instead = "a transpose? write components"
        raise refusals.refusal("a raised T occurs", token.column, instead, declare="parameters").at(pointer)
    around = [other.text for other in line[place + 1 : place + 3]]
    by = around[1] if len(before) == 2 and before[0] in DERIVATIVE_NAMES and around[:1] == [","] and around[1:] else ""
    if by in coordinates and slopes.get(token.text) != {*coordinates}:
        meant = f"diff({token.text}({by}), {by})"
        what, called = f"a derivative of {token.text} by {by} occurs", (f"{token.text}({by})",)
        raise refusals.refusal(what, token.column, f"write {meant}", called, declare="parameters").at(pointer)
    if token.text == "j" and not token.space_before and place and line[place - 1].kind == "number":
        reason = REFUSED_UNLESS_DECLARED["i"]
        raise refused(f"j {reason[0]}", reason, token.column).at(pointer)
    based = reason_against(token.text, token.column) if token.text.startswith("log_") else None
    if error := based or _half_a_number(line, place):
        raise error.at(pointer)
    following = [other.text for other in line[place + 1 : place + 6]]
    is_unit = [token.text, *following[:2]] == ["m", "/", "s"] and "s" not in coordinates
    if is_unit and place and line[place - 1].kind == "number":
        instead = "leave units out, write * between a number and a name"
        raise refusals.refusal("m/s could be a unit", token.column, instead).at(pointer)
    if error := _raised_call(line, place, coordinates, calls):
        raise error.at(pointer)
    if token.text == "d" and after is not None and after.text == "t":
        raise refusals.refusal("a differential occurs", token.column, "write x' or dx/dt for a derivative").at(pointer)
    if token.text == "Delta" and after is not None and after.kind == "name":
        instead = f"a product? declare the constant Delta and write Delta*{after.text}"
        what = f"Delta {after.text} is a difference or a Laplacian to most; it occurs"
        raise refusals.refusal(what, token.column, instead, (f"Delta*{after.text}",)).at(pointer)


def _raised_call(
    line: Sequence[tokens.Token], place: int, coordinates: Sequence[str], calls: Collection[Call]
) -> errors.InputError | None:
    """The refusal of k^2(t), a square of k(t) or a product, and f^(2)(x), a derivative; k^2(x - y) is a product.

    Where k(t) is among the `calls` of the texts, k^2(t) is its square.
    """
    name, start = line[place], place + 2
    if start >= len(line) or not line[place + 1].is_operator("^"):
        return None
    opening = (tokens.closing(line, start) if line[start].is_operator("(") else start) + 1
    if opening >= len(line) or not line[opening].is_operator("("):
        return None
    raised, end = line[start + 1], tokens.closing(line, opening)
    if raised.kind == "number" and raised.column > line[start].column:  # brackets of the writer, not of LaTeX
        instead = f"write {name.text}''({line[opening + 1].text}) for a derivative, ^{raised.text}* for a product"
        return refusals.refusal(f"{name.text}^({raised.text})( could be a derivative", name.column, instead)
    inside = [token.text for token in line[opening:end] if not token.is_operator("(", ",")]
    if not inside or not {")", "t", *coordinates}.issuperset(inside) or (name.text, tuple(inside)) in calls:
        return None
    power, of = "".join(token.text for token in line[start:opening]).strip("()"), inside[0]
    instead = f"write {name.text}({of})^({power}) for a function, {name.text}^({power})*({of}) for a product"
    return refusals.refusal(f"{name.text} to a power before ( could be a function", name.column, instead)


def _half_a_number(line: Sequence[tokens.Token], place: int) -> errors.InputError | None:
    """The refusal of 1.0d-3 and 2D0 (Fortran), 0.5f (C), 1f0 (Julia), 0o7, whose letters are no factors."""
    token, before = line[place], line[place - 1] if place else None
    if before is None or before.kind != "number" or token.space_before:
        return None
    text, after = token.text, [other.text for other in line[place + 1 : place + 3] if not other.space_before]
    power = text in ("d", "D") and len(after) == 2 and after[0] in "+-" and after[1].isdigit()
    suffix = re.fullmatch("[dDfF][0-9]{1,3}", text) is not None or (text in ("f", "F") and "." in before.text)
    if not (power or suffix or before.text == "0"):
        return None
    shown = before.text + text + "".join(after) * power
    return refusals.refusal(
        f"{shown} could be one number", before.column, f"write 2*{text} for a product, 2e-3 for a number"
    )


def _is_apart(line: Sequence[tokens.Token], place: int) -> bool:
    """Whether k (x) stands there, which may be k*x; f (x) and V (x) are functions to most."""
    return (
        line[place].text not in FUNCTION_LETTERS and line[place + 1].is_operator("(") and line[place + 1].space_before
    )


def _tokens(text: str, declared: Names) -> list[tokens.Token]:
    try:
        return reader.read_tokens(text, declared)
    except errors.InputError:
        return []


def _looks_like_a_function(name: str) -> bool:
    """Whether the name may be a known function, such as sqrt mistyped, acot or gamma; then it is not guessed."""
    is_word = re.match("[A-Za-z]{3}", name) is not None and name not in GREEK_NAMES
    return is_word or name.replace("_", "") in _SPECIAL or name in REFUSED_UNLESS_DECLARED


def _may_depend_on_time(name: str) -> bool:
    """Not x(t), a coordinate without an equation, nor delta(t), nor words."""
    moves = looks_like_a_coordinate(name) and name not in ("q", "r", "s", "tau")
    return not (moves or name in _IMPULSES or _looks_like_a_function(name))


def _may_be_called(line: Sequence[tokens.Token], place: int) -> bool:
    """Whether f (x - y) stands there: a function rather than a factor, so the writer is asked."""
    after = line[place + 1 :][:1]
    return line[place].text in FUNCTION_LETTERS and bool(after) and after[0].is_operator("(")


def _call_arguments(line: Sequence[tokens.Token], place: int, coordinates: Sequence[str]) -> tuple[str, ...]:
    """The coordinates (and t) in brackets after a name and its primes; nothing where something else stands there."""
    while place < len(line) and line[place].kind == "prime":
        place += 1
    if place >= len(line) or not line[place].is_operator("("):
        return ()
    found: list[str] = []
    texts = [token.text for token in line]
    at_t = {end for end in range(place, len(line)) if texts[end : end + 3] == ["(", "t", ")"]}  # x(t) is x
    skipped = {after for end in at_t if texts[end - 1] in coordinates for after in range(end, end + 3)}
    for index, token in enumerate(line[place + 1 :], place + 1):
        if index in skipped:
            continue
        if token.is_operator(")"):
            return tuple(found) if len(set(found)) == len(found) else ()
        if token.kind == "name" and token.text in coordinates:
            found.append(token.text)
        elif not token.is_operator(","):
            return ()
    return ()
