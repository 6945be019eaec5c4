"""Find roots that equal simple functions on the side of a real point: sqrt(sin(u)^2) = sin(u) where sin(u) > 0.

A certificate lists them under "roots" as {"root": …, "is": …}. The checker proves each and restricts its claim to the
side on which it is true; this module judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING

import mpmath

from inverse_service import bounds, errors
from inverse_service.decision import deciding
from inverse_service.expressions import collecting, evaluation, printing, tree as ex
from inverse_service.field import real_point, reduction, tower

if TYPE_CHECKING:
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

Entry = dict[str, str]
_CIRCULAR = ("sin", "cos", "tan", "sec", "csc", "cot", "sinh", "cosh", "tanh", "sech", "csch", "coth")


def of_system(analysis: deciding.Analysis) -> list[Entry]:
    """The hints for every claim about the system: from its branch, halves of arctangents, and roots of numbers."""
    return [*_of_branch(analysis.system), *_halved(analysis), *_of_numbers(analysis)]


def of_formulas(formulas: Sequence[ex.Expression], table: real_point.RealTable | None) -> list[Entry]:
    """The roots in the formulas, or implied by their inverse functions, that equal functions or sums of roots."""
    hidden = _hidden_radicands(formulas)
    with_hidden = [*formulas, *map(ex.square_root, hidden)]
    return [*_circular(with_hidden, table), *_of_squares(hidden, table), *_with_roots_inside(formulas, table)]


def of_signs(analysis: deciding.Analysis) -> list[Entry]:
    """The signs of functions under roots, as sqrt(u^2) = u: sqrt(1 + tan(x)^2) is 1/cos(x) where cos(x) > 0."""
    signed = (factor if sign > 0 else -factor for factor, sign in analysis.tower.signs)
    return [_of_square(u) for u in signed if ex.has(u, ex.Apply)]


def _hidden_radicands(formulas: Sequence[ex.Expression]) -> list[ex.Expression]:
    """The radicands implied by inverse functions: 1 - u^2 for asin u and acos u."""
    found = list[ex.Expression]()
    for node in ex.distinct_nodes(formulas):
        match node:
            case ex.Apply("asin" | "acos", u):
                found.append(1 - u**2)
            case ex.Apply("acosh", u):
                found.append(u**2 - 1)
            case ex.Apply("asinh", u):
                found.append(u**2 + 1)
    return found


def _of_squares(radicands: Sequence[ex.Expression], table: real_point.RealTable | None) -> list[Entry]:
    """The roots of the radicands that are squares, valid on the side of the point."""
    found = list[Entry]()
    for under in radicands if table is not None else ():
        with suppress(errors.IrreducibleAtoms, evaluation.NoRealValue):
            if (value := _root_here(under, table or {})) is not None:
                found.append(_entry(ex.square_root(collecting.collect(under)), value))
    return found


def _with_roots_inside(formulas: Sequence[ex.Expression], table: real_point.RealTable | None) -> list[Entry]:
    """sqrt(a + b r) = sqrt((a + d)/2) +- sqrt((a - d)/2) for r = sqrt(v), d^2 = a^2 - b^2 v, on the side of the point.

    If b = 0 after replacing r^2 by v, it is the root of the square a.
    """
    found = list[Entry]()
    for node in ex.distinct_nodes(formulas) if table is not None else ():
        nested = _nested_root(node)
        if nested is None:
            continue
        a, b, v = nested
        value: ex.Expression | None
        with suppress(errors.IrreducibleAtoms, evaluation.NoRealValue):
            value = _root_here(a if b == ex.ZERO else a**2 - b**2 * v, table or {})
            if value is not None and b != ex.ZERO:
                first, second = (ex.square_root(collecting.collect((a + d) / 2)) for d in (value, -value))
                value = first + second if real_point.are_positive([b], table or {}) else first - second
            if value is not None:
                found.append(_entry(node, collecting.collect(value)))
    return found


def _nested_root(node: ex.Expression) -> tuple[ex.Expression, ex.Expression, ex.Expression] | None:
    """(a, b, v) of sqrt(a + b sqrt(v)), in which a and b contain no other even root; None if it has another form."""
    if not (isinstance(node, ex.Power) and node.exponent == ex.HALF):
        return None
    inner = [one for one in ex.distinct_nodes([node.base]) if isinstance(one, ex.Power) and tower.is_even_root(one)]
    if len(inner) != 1 or inner[0].exponent != ex.HALF:
        return None
    letter, v = ex.Symbol("_r"), inner[0].base
    parts = list[ex.Expression]([ex.ZERO, ex.ZERO])
    for monomial, coefficient in collecting.expand(ex.substitute(node.base, {inner[0]: letter})):
        power = dict(monomial).get(letter, Fraction(0))
        if power.denominator > 1 or power < 0:
            return None
        rest = [atom ** ex.number(exponent) for atom, exponent in monomial if atom != letter]
        parts[int(power % 2)] += ex.multiply(ex.number(coefficient), v ** ex.number(power // 2), *rest)
    a, b = map(collecting.collect, parts)
    return None if ex.holds(a, letter) or ex.holds(b, letter) else (a, b, v)


def _root_here(square: ex.Expression, table: real_point.RealTable) -> ex.Expression | None:
    """The positive root of a square without a root sign, on the side of the point; None if it is not a square."""
    root = ex.square_root(collecting.collect(square))
    if isinstance(root, ex.Number):
        return root
    return next((value for side, value in reduction.root_ways(root) if real_point.are_positive(side, table)), None)


def _circular(formulas: Sequence[ex.Expression], table: real_point.RealTable | None) -> list[Entry]:
    """sqrt(1 - sin(u)^2) = +-cos u, sqrt(sinh(u)^2 + 1) = cosh u, and similar roots, on the side of the point.

    Also roots of a number times the square of a function in the formulas: sqrt((1 - x)/2) = sin(acos(x)/2).
    """
    found = list[Entry]()
    others = [node for node in ex.distinct_nodes(formulas) if isinstance(node, ex.Apply) and real_point.varies(node)]
    for node in ex.distinct_nodes(formulas) if table is not None else ():
        if not isinstance(node, ex.Power) or not tower.is_even_root(node):
            continue
        angles = dict.fromkeys(angle for one in ex.walk(node.base) if (angle := _angle(one)) is not None)
        parts = [part for u in angles for part in (u, u / 2, u / 2 + ex.PI / 4)]
        for value in [*(ex.Apply(name, part) for part in parts for name in _CIRCULAR), *others]:
            factor = _ratio(node.base, value**2, table or {})
            if factor is not None:
                sign = 1 if real_point.are_positive([value], table or {}) else -1
                found.append(_entry(ex.square_root(node.base), sign * ex.square_root(ex.number(factor)) * value))
                break
    return found


def _angle(node: ex.Expression) -> ex.Expression | None:
    match node:
        case ex.Apply(name, u) if name in _CIRCULAR and real_point.varies(u):
            return u
    return None


def _ratio(base: ex.Expression, square: ex.Expression, table: real_point.RealTable) -> Fraction | None:
    """A rational number that the quotient apparently equals; the checker proves it."""
    ratios = []
    for shift in (mpmath.mpf(0), mpmath.mpf(1) / 7, mpmath.mpf(-2) / 9):
        with suppress(evaluation.NoRealValue, ZeroDivisionError):
            # Each variable gets a separate factor, because a quotient may be homogeneous of degree 0.
            moved = {key: value * (1 + shift / (k + 1)) for k, (key, value) in enumerate(table.items())}
            ratios.append(evaluation.evaluate(base, moved) / evaluation.evaluate(square, moved))
    if len(ratios) < 3 or ratios[0] <= 0:
        return None
    factor = Fraction(mpmath.nstr(ratios[0], 15)).limit_denominator(1000)
    number = mpmath.mpf(factor.numerator) / factor.denominator
    return factor if all(abs(ratio - number) < mpmath.mpf(10) ** -12 * ratio for ratio in ratios) else None


def _of_branch(system: SecondOrderSystem) -> list[Entry]:
    found = () if system.branch is None else system.branch.roots
    return [_entry(*pair) for root in found if (pair := _on_branch(*root)) is not None]


def _on_branch(node: ex.Expression, value: ex.Expression) -> tuple[ex.Expression, ex.Expression] | None:
    """A root with a positive exponent; for asin(sin u), sqrt(1 - sin(u)^2) = cos u or -cos u; acos(cos u) likewise."""
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            return base**-exponent, value**-1
        case ex.Power():
            return node, value
        case ex.Apply("asin" | "acos" as function, ex.Apply(inner, u)):
            other = ex.Apply("cos" if function == "asin" else "sin", u)
            root = ex.square_root(1 - ex.Apply(inner, u) ** 2)
            return root, other if value == u else -other
        case ex.Apply("Heaviside", u):
            return ex.square_root(u**2), -u if value == ex.ZERO else u
        case _:
            return None


def _halved(analysis: deciding.Analysis) -> list[Entry]:
    """cos(atan(w)/2) > 0 if f has roots, because nested roots may be products of it and others."""
    if not any(
        tower.is_even_root(node) and real_point.varies(node) for node in ex.distinct_nodes(analysis.system.given)
    ):
        return []
    rules = [rule for rule in analysis.tower.rules if isinstance(rule, tower.AngleRule) and not rule.turns]
    halved = (atom for rule in rules for atom, a in rule.arctangents if a.denominator % 2 == 0)
    return [_of_square(ex.Apply("cos", atom / 2)) for atom in dict.fromkeys(halved)]


def _of_numbers(analysis: deciding.Analysis) -> Iterator[Entry]:
    """Nested roots of numbers expressed by the roots in f: (2 + sqrt(5))^(1/3) = (1 + sqrt(5))/2 (by PSLQ)."""
    nodes = (
        node
        for node in ex.distinct_nodes(analysis.accelerations)
        if isinstance(node, ex.Power) and not real_point.varies(node)
    )
    roots = [node for node in nodes if isinstance(node.exponent, ex.Number) and deciding.is_irrational(node)]
    for node in roots:
        others = [one for one in roots if node not in ex.walk(one)]
        if {*others}.isdisjoint(ex.walk(node.base)) or not isinstance(node.exponent, ex.Number):
            continue
        whole = node.base ** Fraction(1, node.exponent.value.denominator)
        known: list[ex.Expression] = [ex.number(1), *others]
        try:
            with mpmath.workdps(bounds.DIGITS):
                values = [evaluation.evaluate(one, {}) for one in (whole, *known)]
                found = mpmath.pslq(values, maxcoeff=bounds.RATIO, maxsteps=bounds.RATIO)
        except evaluation.NoRealValue:
            continue
        if found and found[0]:
            terms = (Fraction(-a, found[0]) * b for a, b in zip(found[1:], known, strict=True))
            yield _entry(whole, ex.add(*terms))


def _of_square(u: ex.Expression) -> Entry:
    return {"root": f"sqrt(({printing.to_text(u)})^2)", "is": printing.to_text(u)}


def _entry(root: ex.Expression, value: ex.Expression) -> Entry:
    """An entry of the roots of a certificate."""
    return {"root": printing.to_text(root), "is": printing.to_text(value)}
