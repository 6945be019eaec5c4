"""One formula for two cases, L = (L_1 + L_2)/2 + D |s| with D = (L_1 - L_2)/(2 s), where s > 0 and s < 0; and how
it moves in each of them.
"""

from __future__ import annotations

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
    """L of both cases as a text, and H, if it is seen; with `where`, s = 0 as a text, L is also once differentiable
    there.

    `of_every` is the coordinate if L then gives the equations for each of its values: they are continuous, too.
    """

    lagrangian: str
    hamiltonian: str
    where: str
    of_every: str


def joined_of(
    branches: Sequence[Mapping[str, Any]], names: nm.Names, equations: Iterable[str]
) -> Joined | None:
    """The formulas of two branches on the two sides of a value of one coordinate; None where none is seen.

    The formula equals each L up to a constant, which changes no equation. `equations` are the accelerations as given.
    """
    found = _of_both(branches, names, _lagrangian_of)
    if found is None:
        return None
    text, where, name = found
    energy = _of_both(branches, names, _hamiltonian_of)
    is_whole = where and all(_is_continuous(one, name, names) for one in equations)
    return Joined(text, energy[0] if energy else "", where, name if is_whole else "")


# What is joined: its text, its own domain, and the names of what is not a place, velocities or momenta.
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


def _of_both(
    branches: Sequence[Mapping[str, Any]], names: nm.Names, read: _Read
) -> tuple[str, str, str] | None:
    """The formula of both sides, where they join, and the coordinate."""
    sides = [side for branch in branches if (side := _side_of(branch, names, read)) is not None]
    if len(sides) != 2 or len(branches) != 2:
        return None
    above = max(sides, key=lambda side: side.sign)
    below = min(sides, key=lambda side: side.sign)
    if (above.sign, below.sign) != (1, -1) or (above.name, above.at) != (below.name, below.at):
        return None
    try:
        found = _joined(above, below, names)
    except ArithmeticError:
        return None
    return None if found is None else (*found, above.name)


@dataclass(frozen=True, slots=True)
class _Side:
    """A formula where the coordinate is above (1) or below (-1) a constant; `moving` are velocities or momenta."""

    name: str
    at: ex.Expression
    sign: int
    formula: ex.Expression
    moving: tuple[ex.Expression, ...]


def _side_of(branch: Mapping[str, Any], names: nm.Names, read: _Read) -> _Side | None:
    """None for a branch with another condition than x > c or x < c, or without a formula on all of it."""
    found, place = read(branch, names), half_of(branch.get("domain") or (), names)
    if found is None or place is None:
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
    return _Side(*place, tree, tuple(moving))


def half_of(domain: Sequence[str], names: nm.Names) -> tuple[str, ex.Expression, int] | None:
    """The coordinate, the constant, and 1 or -1 for the only condition x > c or x < c; None for another domain."""
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


def _joined(one: _Side, other: _Side, names: nm.Names) -> tuple[str, str] | None:
    x, half = ex.Symbol(one.name), ex.number(Fraction(1, 2))
    s = ex.subtract(x, one.at)

    def at_boundary(tree: ex.Expression) -> ex.Expression:
        return writing.simplified(ex.substitute(tree, {x: one.at}))

    def is_constant(tree: ex.Expression) -> bool:
        return _is_constant(tree, names) and not any(ex.holds(tree, each) for each in one.moving)

    above, below = one.formula, other.formula
    if not (_is_entire(above, x) and _is_entire(below, x)):
        return None
    jump = at_boundary(ex.subtract(above, below))
    if not is_constant(jump):
        return None
    level = ex.substitute(at_boundary(above), dict.fromkeys(one.moving, ex.ZERO))
    level = level if is_constant(level) else ex.ZERO
    above, below = ex.subtract(above, level), ex.subtract(ex.add(below, jump), level)
    slope = writing.simplified(half * ex.divide(ex.subtract(above, below), s))
    mean = writing.simplified(half * ex.add(above, below))
    if not _is_entire(slope, x):
        return None
    shown = [
        printing.to_text(ex.add(collecting.collect(mean), ex.multiply(slope, _SIZE))),
        printing.to_text(collecting.collect(ex.add(mean, ex.multiply(slope, _SIZE)))),
    ]
    text = min(shown, key=len).replace(_SIZE.name, f"abs({printing.to_text(s)})")
    if len(text) > LONGEST:
        return None
    joins = at_boundary(slope) == ex.ZERO
    return text, f"{one.name} = {printing.to_text(one.at)}" if joins else ""


_ENTIRE = frozenset({"exp", "sin", "cos", "sinh", "cosh"})
_SIZE = ex.Symbol("sizeofs")


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
    """Whether a text is seen to be a continuous function of a coordinate, with |u|, sqrt(u^2), in it."""
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
    """What is certain of the motion on a branch, as words and formulas alternately; empty where nothing short is.

    With x'' = f(x) on a side of x = c the sign of f says where it is pushed, and f = -k (x - c) gives half a swing,
    (x - c) = A sin(sqrt(k) (t - s)), of the length pi/sqrt(k). Else it is the shortest conserved quantity.
    """
    return _pushed(branch, names) or next(
        (
            ["", text, " stays the same"]
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
