"""One formula for two cases: L = (L_1 + L_2)/2 + D |s| with D = (L_1 - L_2)/(2 s), where s > 0 and s < 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from inverse_service import errors
from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.mechanics import writing
from inverse_service.reading import names as nm, reader

LONGEST = 200  # characters of a formula


@dataclass(frozen=True, slots=True)
class Joined:
    """L of both cases as a text; with `where`, s = 0 as a text, it is also once differentiable there."""

    lagrangian: str
    where: str


def joined_of(branches: Sequence[Mapping[str, Any]], names: nm.Names) -> Joined | None:
    """The formula of two branches on the two sides of a value of one coordinate; None where none is seen.

    The formula equals each L up to a constant, which changes no equation.
    """
    sides = [side for branch in branches if (side := _side_of(branch, names)) is not None]
    if len(sides) != 2 or len(branches) != 2:
        return None
    above = max(sides, key=lambda side: side.sign)
    below = min(sides, key=lambda side: side.sign)
    if (above.sign, below.sign) != (1, -1) or (above.name, above.at) != (below.name, below.at):
        return None
    try:
        return _joined(above, below, names)
    except ArithmeticError:
        return None


@dataclass(frozen=True, slots=True)
class _Side:
    """L where the coordinate is above (1) or below (-1) a constant."""

    name: str
    at: ex.Expression
    sign: int
    lagrangian: ex.Expression


def _side_of(branch: Mapping[str, Any], names: nm.Names) -> _Side | None:
    """None for a branch with another condition than x > c or x < c, or without L on all of it."""
    lagrangian, domain = branch.get("lagrangian"), list(branch.get("domain") or ())
    if not lagrangian or lagrangian.get("auxiliary") or len(domain) != 1:
        return None
    if len(lagrangian["text"]) > LONGEST or not {*lagrangian.get("domain", ())} <= {*domain}:
        return None
    for sign, word in ((1, " > "), (-1, " < ")):
        left, found, right = domain[0].partition(word)
        if found and left in names.coordinates:
            try:
                at = reader.read_formula(right, names)
                tree = reader.read_formula(lagrangian["text"], names)
            except errors.InputError:
                return None
            return _Side(left, at, sign, tree) if _is_constant(at, names) else None
    return None


def _is_constant(tree: ex.Expression, names: nm.Names) -> bool:
    """Whether no coordinate, velocity or unknown function occurs in a tree."""
    return not any(
        isinstance(node, ex.Velocity | ex.Arbitrary)
        or (isinstance(node, ex.Symbol) and node.name in names.coordinates)
        for node in ex.walk(tree)
    )


def _joined(one: _Side, other: _Side, names: nm.Names) -> Joined | None:
    x, half = ex.Symbol(one.name), ex.number(Fraction(1, 2))
    s = ex.subtract(x, one.at)

    def at_boundary(tree: ex.Expression) -> ex.Expression:
        return writing.simplified(ex.substitute(tree, {x: one.at}))

    above, below = one.lagrangian, other.lagrangian
    if not (_is_entire(above, x) and _is_entire(below, x)):
        return None
    jump = at_boundary(ex.subtract(above, below))
    if not _is_constant(jump, names):
        return None
    still: dict[ex.Expression, ex.Expression] = {
        ex.Velocity(name): ex.ZERO for name in names.coordinates
    }
    level = ex.substitute(at_boundary(above), still)
    level = level if _is_constant(level, names) else ex.ZERO
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
    return Joined(text, f"{one.name} = {printing.to_text(one.at)}" if joins else "")


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
