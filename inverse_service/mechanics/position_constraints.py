"""Coordinates on the positions that constraints leave: x = l cos(theta), y = l sin(theta) for x^2 +
y^2 = l^2.

A constraint on positions (a holonomic constraint) is fulfilled by coordinates of its own, which are
put into L. Two shapes of constraints have one usual choice:

- a coordinate that enters linearly, with a constant factor, is solved for: x2 = l - x1 for x1 + x2
  = l;
- two or three squares with constant factors, c_i u_i^2, u_i linear in coordinates that r does not
  have, with the sum r^2: then u_i = r n_i/sqrt(c_i), n a unit vector, (cos(theta), sin(theta)) or
  (sin(theta) cos(phi), sin(theta) sin(phi), cos(theta)). In a uniform field, theta = 0 is the
  lowest point: (sin(theta), -cos(theta)) for V = m g y.
"""

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction

from inverse_service.expressions import calculus, collecting, graphs, tree as ex

Definitions = dict[str, ex.Expression]
_FIRST, _SECOND = ("theta", "alpha", "chi"), ("phi", "psi", "beta")  # names of angles


def definitions_on(
    constraints: Sequence[ex.Expression],
    lagrangian: ex.Expression,
    coordinates: Sequence[str],
    taken: Collection[str],
) -> tuple[list[Definitions], tuple[str, ...]] | None:
    """What the constraints on L, each zero and without velocities, define, and the names of the
    coordinates left.

    None if a constraint has neither shape. An angle has none of the `taken` names.
    """
    first, second = (_angles(names, taken, len(constraints) > 1) for names in (_FIRST, _SECOND))
    left, angles, found, linear = list(coordinates), list[str](), list[Definitions](), Definitions()
    for constraint in constraints:
        tree = ex.substitute(
            constraint, {ex.Symbol(name): formula for name, formula in linear.items()}
        )
        solved = _solved(tree, left)
        linear |= solved
        forms = (tree, collecting.collect(tree), collecting.collect(ex.negate(tree)))
        if not solved and (
            squares := next(filter(None, (_squares(form, left) for form in forms)), None)
        ):
            own = [ex.Symbol(next(names)) for names in (first, second)[: len(squares) - 1]]
            solved = _on_sphere(
                squares, own, [_fall(name, lagrangian, coordinates) for _, name, _ in squares]
            )
            angles += [angle.name for angle in own]
        if not solved:
            return None
        left = [name for name in left if name not in solved]
        found.append(solved)
    formulas = {name: formula for solved in found for name, formula in solved.items()}
    used = {name: formulas.keys() & _names(formula) for name, formula in formulas.items()}
    is_circular = any(len(names) > 1 for names in graphs.components(used))
    return None if is_circular or not left + angles else (found, (*left, *angles))


def _angles(names: Sequence[str], taken: Collection[str], numbered: bool) -> Iterator[str]:
    """theta, or theta1, theta2, …: a name of which no form is taken."""
    free = (name for name in names if not any(other.startswith(name) for other in taken))
    name = next(free, "angle")
    return (f"{name}{k}" for k in itertools.count(1)) if numbered else itertools.chain([name], free)


def _names(tree: ex.Expression) -> set[str]:
    return {node.name for node in ex.walk(tree) if isinstance(node, ex.Symbol)}


def _slopes(tree: ex.Expression, names: Sequence[str]) -> Definitions | None:
    """The factors a_i, without names, of a tree a_i q_i + b; None if it is not linear in the
    names.
    """
    found = {
        name: collecting.collect(calculus.differentiate(tree, ex.Symbol(name))) for name in names
    }
    moving = {*names, ex.TIME.name}
    return found if all(moving.isdisjoint(_names(slope)) for slope in found.values()) else None


def _solved(tree: ex.Expression, names: Sequence[str]) -> Definitions:
    """The last of the names that enters linearly with a constant factor, a number if possible, as a
    formula.
    """
    slopes = {name: (_slopes(tree, [name]) or {name: ex.ZERO})[name] for name in reversed(names)}
    constant = [
        name
        for name, slope in slopes.items()
        if slope != ex.ZERO and _names(slope).isdisjoint(names)
    ]
    for name in sorted(constant, key=lambda name: not isinstance(slopes[name], ex.Number)):
        rest = ex.substitute(tree, {ex.Symbol(name): ex.ZERO})
        return {name: collecting.collect(ex.negate(rest) / slopes[name])}
    return {}


def _squares(
    tree: ex.Expression, names: Sequence[str]
) -> list[tuple[ex.Expression, str, ex.Expression]]:
    """Each square as its u, the name that u alone holds, and r/sqrt(c); empty if the tree is no
    such sum.
    """
    sides = [(term, *_side(term, names)) for term in ex.summands(tree)]
    squares = [(u, factor) for _, u, factor in sides if u != ex.ZERO and not _is_negative(factor)]
    radius = ex.negate(ex.add(*(term for term, u, factor in sides if (u, factor) not in squares)))
    found = list[tuple[ex.Expression, str, ex.Expression]]()
    for u, factor in squares:
        others = _names(radius).union(*(_names(other) for other, _ in squares if other is not u))
        slopes = _slopes(u, names) or {}
        own = [
            name
            for name in reversed(names)
            if name not in others and slopes.get(name, ex.ZERO) != ex.ZERO
        ]
        own.sort(key=lambda name: slopes[name] != ex.ONE)  # x of (x - X)^2
        ratio = min(radius / factor, collecting.collect(radius / factor), key=ex.node_count)
        if not own or len(squares) not in (2, 3) or radius == ex.ZERO or _is_negative(ratio):
            return []
        found.append((u, own[0], _root(ratio)))
    return found


def _side(term: ex.Expression, moving: Collection[str]) -> tuple[ex.Expression, ex.Expression]:
    """(u, c) of c u^2; (0, 1) for any other term."""
    factors = ex.factors_of(term)
    inside = [factor for factor in factors if not _names(factor).isdisjoint(moving)]
    match inside:
        case [ex.Power(u, ex.Number(Fraction(numerator=2, denominator=1)))]:
            return u, ex.multiply(*(factor for factor in factors if factor is not inside[0]))
    return ex.ZERO, ex.ONE


def _is_negative(tree: ex.Expression) -> bool:
    """Whether all terms have a negative number as a factor."""
    factors = map(ex.factors_of, ex.summands(tree))
    return all(
        any(isinstance(factor, ex.Number) and factor.value < 0 for factor in each)
        for each in factors
    )


def _root(tree: ex.Expression) -> ex.Expression:
    """A square root; its sign is that of any: a unit vector takes both."""
    return ex.multiply(*(_root_of_power(p, e) for p, e in ex.powers_of(tree)))


def _root_of_power(base: ex.Expression, exponent: Fraction) -> ex.Expression:
    """A square root of a power; 2 for that of 4."""
    if isinstance(base, ex.Number) and base.value > 0 and exponent == 1:
        over, under = base.value.as_integer_ratio()
        if math.isqrt(over) ** 2 == over and math.isqrt(under) ** 2 == under:
            return ex.number(Fraction(math.isqrt(over), math.isqrt(under)))
    return base ** (exponent / 2)


def _fall(name: str, lagrangian: ex.Expression, coordinates: Sequence[str]) -> int:
    """1 if L grows along the coordinate at a constant rate (it points down), -1 if L decreases, 0
    otherwise.
    """
    slope = collecting.collect(calculus.differentiate(lagrangian, ex.Symbol(name)))
    moves = not _names(slope).isdisjoint({*coordinates, ex.TIME.name}) or ex.has(slope, ex.Velocity)
    return 0 if moves or slope == ex.ZERO else -1 if _is_negative(slope) else 1


def _on_sphere(
    squares: Sequence[tuple[ex.Expression, str, ex.Expression]],
    angles: Sequence[ex.Symbol],
    falls: Sequence[int],
) -> Definitions:
    sine, cosine = ex.Apply("sin", angles[0]), ex.Apply("cos", angles[0])
    unit: list[ex.Expression] = [cosine, sine]
    if len(angles) == 2:
        unit = [
            sine * ex.Apply("cos", angles[1]),
            sine * ex.Apply("sin", angles[1]),
            cosine * (falls[-1] or 1),
        ]
    elif sum(map(abs, falls)) == 1:
        unit = [cosine * fall if fall else sine for fall in falls]
    found = Definitions()
    for (u, name, radius), n in zip(squares, unit, strict=True):
        slope = calculus.differentiate(u, ex.Symbol(name))
        rest = ex.substitute(u, {ex.Symbol(name): ex.ZERO})
        found[name] = ex.add(ex.negate(rest) / slope, radius * n / slope)
    return found
