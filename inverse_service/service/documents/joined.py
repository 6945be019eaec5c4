"""One formula for cases between values c_1 < c_2 < ... of one coordinate x, L_0 below the first and
L_n above the last: L = (L_0 + L_n)/2 + D_1 |x - c_1| + ... with D_i = (L_i - L_(i-1))/(2 (x -
c_i)); and how it moves in each of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from inverse_service import errors
from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import writing
from inverse_service.reading import names as nm, reader

LONGEST = 200  # characters of a formula


@dataclass(frozen=True, slots=True)
class Joined:
    """L of all cases as a text, and H, if it is seen; where x = c, a text in `where`, L is also
    once differentiable.

    `of_every` is the coordinate if L gives the equations for each of its values: at each c it is
    once differentiable, and they are continuous.
    """

    lagrangian: str
    hamiltonian: str
    where: tuple[str, ...]
    of_every: str


def joined_of(
    branches: Sequence[Mapping[str, Any]], names: nm.Names, equations: Iterable[str]
) -> Joined | None:
    """The formulas of branches on the parts of one coordinate; None where none is seen.

    The formula equals each L up to a constant, which changes no equation. `equations` are the
    accelerations as given.
    """
    found = _of_all(branches, names, _lagrangian_of)
    if found is None:
        return None
    energy = _of_all(branches, names, _hamiltonian_of)
    # H is p q' - L of this L: a constant is left out of both or of neither.
    is_level = energy is None or collecting.collect(ex.add(found.level, energy.level)) == ex.ZERO
    where, name = found.where, found.coordinate
    is_whole = len(where) == len(branches) - 1
    is_whole = is_whole and all(_is_continuous(one, name, names) for one in equations)
    shown = [one.level_text if is_level else one.text for one in (found, energy) if one]
    return Joined(shown[0], shown[1] if energy else "", where, name if is_whole else "")


def places_of(branches: Sequence[Mapping[str, Any]], names: nm.Names) -> list[int]:
    """The place of each branch from left to right, 0, 1, ..., on the line of the coordinate; all 0
    if they are no parts of one.
    """
    parts = [_part_of(branch.get("domain") or (), names) for branch in branches]
    known = [part for part in parts if part is not None]
    ordered = _in_order(known) if len(known) == len(parts) else None
    return [0] * len(parts) if ordered is None else [ordered.index(part) for part in known]


# What is joined: its text, its own domain, and the names of what is not a place, velocities or
# momenta.
_Read = Callable[[Mapping[str, Any], nm.Names], "tuple[str, Sequence[str], tuple[str, ...]] | None"]


def _lagrangian_of(
    branch: Mapping[str, Any], names: nm.Names
) -> tuple[str, Sequence[str], tuple[str, ...]] | None:
    part = branch.get("lagrangian")
    if not part or part.get("auxiliary"):
        return None
    return part["text"], part.get("domain") or (), ()


def _hamiltonian_of(
    branch: Mapping[str, Any], names: nm.Names
) -> tuple[str, Sequence[str], tuple[str, ...]] | None:
    part = branch.get("hamiltonian")
    if not part or part.get("implicit") or part.get("constraints"):
        return None
    # p = dL/dq' has to be the same function of q' in both cases, without the place.
    momenta = part["momenta"]
    if list(momenta.values()) != [f"{name}'" for name in names.coordinates]:
        return None
    return part["text"], part.get("domain") or (), tuple(momenta)


@dataclass(frozen=True, slots=True)
class _Part:
    """Where a coordinate is between two constants; None is without end."""

    name: str
    low: ex.Expression | None
    high: ex.Expression | None


@dataclass(frozen=True, slots=True)
class _Piece:
    """A formula on a part; `moving` are velocities or momenta."""

    part: _Part
    formula: ex.Expression
    moving: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class _Whole:
    """The formula of all parts, without its constant `level` and with it, where they join, and the
    coordinate.
    """

    level_text: str
    text: str
    level: ex.Expression
    where: tuple[str, ...]
    coordinate: str


def _of_all(branches: Sequence[Mapping[str, Any]], names: nm.Names, read: _Read) -> _Whole | None:
    """The formula of all parts; None where none is seen."""
    pieces = [piece for one in branches if (piece := _piece_of(one, names, read)) is not None]
    if len(pieces) != len(branches) or (order := _in_order([one.part for one in pieces])) is None:
        return None
    pieces.sort(key=lambda piece: order.index(piece.part))
    try:
        return _joined(pieces, names)
    except ArithmeticError:
        return None


def _piece_of(branch: Mapping[str, Any], names: nm.Names, read: _Read) -> _Piece | None:
    """None for a branch that is no part of one coordinate, or without a formula on all of it."""
    found, part = read(branch, names), _part_of(branch.get("domain") or (), names)
    if found is None or part is None:
        return None
    text, domain, momenta = found
    if len(text) > LONGEST or not {*domain} <= {*branch["domain"]}:
        return None
    try:
        tree = reader.read_formula(text, replace(names, parameters=(*names.parameters, *momenta)))
    except errors.InputError:
        return None
    moving: list[ex.Expression] = [*map(ex.Symbol, momenta)]
    moving = moving or [*map(ex.Velocity, names.coordinates)]
    return _Piece(part, tree, tuple(moving))


def _part_of(domain: Sequence[str], names: nm.Names) -> _Part | None:
    """The part of x > c, of x < d, or of both; None for another domain."""
    halves = [half_of((one,), names) for one in domain]
    known = [half for half in halves if half is not None]
    ends = {sign: at for _, at, sign in known}
    if not known or len(known) != len(halves) or len(ends) != len(halves):
        return None
    if len({name for name, _, _ in known}) != 1:
        return None
    return _Part(known[0][0], ends.get(1), ends.get(-1))


def _in_order(parts: Sequence[_Part]) -> list[_Part] | None:
    """At least two parts from left to right, each of which begins where the one before it ends;
    None if they do not.
    """
    first = [part for part in parts if part.low is None]
    if len(parts) < 2 or len(first) != 1 or len({part.name for part in parts}) != 1:
        return None
    ordered = first
    while ordered[-1].high is not None and len(ordered) < len(parts):
        following = [part for part in parts if part.low == ordered[-1].high]
        if len(following) != 1:
            return None
        ordered = [*ordered, *following]
    return ordered if len(ordered) == len(parts) and ordered[-1].high is None else None


_HALF = re.compile(r"([^\s<>=]+) ([<>]) ([^<>=]+)")


def in_ranges(conditions: Iterable[str]) -> list[str]:
    """Conditions as they are shown: x > a and x < b, if no other one bounds x, are a < x < b at the
    place of the first.
    """
    given = list(conditions)
    halves = [half.groups() for text in given if (half := _HALF.fullmatch(text))]
    for name in dict.fromkeys(name for name, _, _ in halves):
        ends = [(sign, end) for other, sign, end in halves if other == name]
        if sorted(sign for sign, _ in ends) == ["<", ">"]:
            low, high = (dict(ends)[sign] for sign in "><")
            place = min(given.index(f"{name} {sign} {end}") for sign, end in ends)
            given[place] = f"{low} < {name} < {high}"
            given = [text for text in given if text not in (f"{name} > {low}", f"{name} < {high}")]
    return given


def half_of(domain: Sequence[str], names: nm.Names) -> tuple[str, ex.Expression, int] | None:
    """The coordinate, the constant, and 1 or -1 for the only condition x > c or x < c; None for
    another domain.
    """
    if len(domain) != 1:
        return None
    for sign, word in ((1, " > "), (-1, " < ")):
        left, found, right = domain[0].partition(word)
        if found and left in names.coordinates:
            try:
                at = reader.read_formula(right, names)
            except errors.InputError:
                return None
            return (left, at, sign) if _is_constant(at, names) else None
    return None


def _is_constant(tree: ex.Expression, names: nm.Names) -> bool:
    """Whether no coordinate, velocity or unknown function occurs in a tree."""
    return not any(
        isinstance(node, ex.Velocity | ex.Arbitrary)
        or (isinstance(node, ex.Symbol) and node.name in names.coordinates)
        for node in ex.walk(tree)
    )


def _joined(pieces: Sequence[_Piece], names: nm.Names) -> _Whole | None:
    """The formula of pieces from left to right, and where it is once differentiable."""
    x, half = ex.Symbol(pieces[0].part.name), ex.number(Fraction(1, 2))
    ends = [piece.part.high for piece in pieces[:-1] if piece.part.high is not None]
    gaps = [ex.subtract(x, end) for end in ends]

    def at(tree: ex.Expression, end: ex.Expression) -> ex.Expression:
        return writing.simplified(ex.substitute(tree, {x: end}))

    def is_constant(tree: ex.Expression) -> bool:
        still = _is_constant(tree, names)
        return still and not any(ex.holds(tree, each) for each in pieces[0].moving)

    if not all(_is_entire(piece.formula, x) for piece in pieces):
        return None
    jumps = [
        at(ex.subtract(right.formula, left.formula), end)
        for left, right, end in zip(pieces, pieces[1:], ends, strict=False)
    ]
    if not all(map(is_constant, jumps)):
        return None
    level = ex.substitute(at(pieces[1].formula, ends[0]), dict.fromkeys(pieces[0].moving, ex.ZERO))
    level = level if is_constant(level) else ex.ZERO
    # Each is shifted by a constant, so that it continues the one before it.
    shifts = [ex.subtract(jumps[0], level), ex.negate(level)]
    for jump in jumps[1:]:
        shifts.append(ex.subtract(shifts[-1], jump))
    shifted = [ex.add(piece.formula, shift) for piece, shift in zip(pieces, shifts, strict=True)]
    slopes = [
        writing.simplified(half * ex.divide(ex.subtract(right, left), gap))
        for left, right, gap in zip(shifted, shifted[1:], gaps, strict=False)
    ]
    if not all(_is_entire(slope, x) for slope in slopes):
        return None
    mean = writing.simplified(half * ex.add(shifted[0], shifted[-1]))
    text = _shortest(mean, slopes, gaps)
    terms = ex.summands(collecting.collect(mean))
    level = ex.add(*filter(is_constant, terms))
    moving = ex.add(*(term for term in terms if not is_constant(term)))
    level_text = text if level == ex.ZERO else _shortest(moving, slopes, gaps)
    joins = [end for slope, end in zip(slopes, ends, strict=True) if at(slope, end) == ex.ZERO]
    where = tuple(f"{x.name} = {printing.to_text(end)}" for end in joins)
    if len(text) > LONGEST:
        return None
    return _Whole(level_text, text, level, where, x.name)


def _shortest(
    mean: ex.Expression, slopes: Sequence[ex.Expression], gaps: Sequence[ex.Expression]
) -> str:
    """mean + slope |gap| + ..., printed."""
    sizes = [ex.Symbol(f"{_SIZE}{chr(ord('a') + k)}") for k in range(len(gaps))]
    parts = [ex.multiply(slope, size) for slope, size in zip(slopes, sizes, strict=True)]
    shown = [
        printing.to_text(ex.add(collecting.collect(mean), *parts)),
        printing.to_text(collecting.collect(ex.add(mean, *parts))),
    ]
    text = min(shown, key=len)
    for size, gap in zip(sizes, gaps, strict=True):
        text = text.replace(size.name, f"abs({printing.to_text(gap)})")
    return text


_ENTIRE = frozenset({"exp", "sin", "cos", "sinh", "cosh"})
_SIZE = "sizeof"


def _is_entire(tree: ex.Expression, x: ex.Symbol) -> bool:
    """Whether a tree is seen to have a value for every x: each formula has to hold on both sides."""
    for node in ex.walk(tree):
        if not ex.holds(node, x) or isinstance(node, ex.Symbol | ex.Sum | ex.Product):
            continue
        if isinstance(node, ex.Power):
            power = node.exponent
            if isinstance(power, ex.Number) and power.value > 0 and power.value.denominator == 1:
                continue
            return False
        if not (isinstance(node, ex.Apply) and node.function in _ENTIRE):
            return False
    return True


def _is_continuous(text: str, name: str, names: nm.Names) -> bool:
    """Whether a text is seen to be a continuous function of a coordinate, with |u|, sqrt(u^2), in
    it.
    """
    try:
        tree = reader.read_formula(text, names)
    except errors.InputError:
        return False
    sizes = {
        node: node.base for node in ex.walk(tree) if isinstance(node, ex.Power) and _is_size(node)
    }
    return _is_entire(ex.substitute(tree, sizes), ex.Symbol(name))


def _is_size(tree: ex.Power) -> bool:
    """Whether it is a positive power of an even power, |u|^r."""
    power, base = tree.exponent, tree.base
    if not (isinstance(power, ex.Number) and power.value > 0 and isinstance(base, ex.Power)):
        return False
    inner = base.exponent
    return isinstance(inner, ex.Number) and inner.value > 0 and inner.value % 2 == 0


# How it moves.


def motion_of(branch: Mapping[str, Any], names: nm.Names) -> list[str]:
    """What is certain of the motion on a branch, as words and formulas alternately; empty where
    nothing short is.

    With x'' = f(x) on a side of x = c the sign of f says where it is pushed, and f = -k (x - c)
    gives half a swing, (x - c) = A sin(sqrt(k) (t - s)), of the length pi/sqrt(k). Else it is the
    shortest conserved quantity.
    """
    return _pushed(branch, names) or next(
        (
            ["", text, " is constant"]
            for text in sorted(
                (one["text"] for one in branch.get("first_integrals") or ()), key=len
            )[:1]
            if len(text) <= LONGEST
        ),
        [],
    )


def _pushed(branch: Mapping[str, Any], names: nm.Names) -> list[str]:
    place = half_of(branch.get("domain") or (), names)
    if place is None or len(names.coordinates) != 1:
        return []
    name, at, sign = place
    try:
        f = reader.read_formula(branch.get("equations", {}).get(name, ""), names)
    except errors.InputError:
        return []
    x = ex.Symbol(name)
    if ex.has(f, ex.Velocity) or ex.has(f, ex.Arbitrary) or ex.holds(f, ex.TIME):
        return []
    boundary = f"{name} = {printing.to_text(at)}"
    if f == ex.ZERO:
        return ["constant speed"]
    out = ex.multiply(ex.number(sign), ex.subtract(x, at))
    push = ex.multiply(ex.number(sign), f)
    if real_branch.is_positive(push, (out,)):
        return ["pushed away from ", boundary, "; once it moves away, it does not return"]
    if not real_branch.is_positive(ex.negate(push), (out,)):
        return []
    rate = writing.simplified(ex.negate(ex.divide(push, out)))
    if _is_constant(rate, names) and real_branch.is_positive(rate):
        length = ex.divide(ex.PI, ex.power(rate, ex.number(Fraction(1, 2))))
        lasts = printing.to_text(writing.simplified(length))
        return ["half a swing; every visit from ", boundary, " lasts ", lasts]
    return ["pushed toward ", boundary]
