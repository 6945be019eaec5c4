"""Random real points of a Lagrangian, and the check of an inverse momentum map there with 40 digits."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mpmath import mp, mpf

from inverse_service import bounds
from inverse_service.expressions import collecting, evaluation, tree as ex

_ROUGH_DIGITS, _MOST_DIGITS = 2, 300
_MOST_POINTS, _FEWER_POINTS = 20, 8
_MANY_NAMES = 100
_MOST_POSITIVE = 6
_FEWEST_POINTS = 3
_SEED = 18_340_115
_WIDTHS = ("1", "1", "3", "0.4", "6", "0.1")

Point = dict[ex.Expression, Any]


@dataclass(frozen=True, slots=True)
class Claim:
    """v(p) and H(p) for L(v); `momenta` gives each momentum symbol as a function of v."""

    lagrangian: ex.Expression
    names: tuple[str, ...]
    momenta: Mapping[ex.Symbol, ex.Expression]
    velocities: tuple[ex.Expression, ...]
    hamiltonian: ex.Expression


@dataclass(frozen=True, slots=True)
class Judgment:
    """At how many points a claim holds; where it does not hold everywhere, on which conditions it does."""

    holding: int
    conditions: tuple[ex.Expression, ...]


def sample_points(
    trees: Sequence[ex.Expression], positive: Sequence[ex.Expression] = (), most: int = _MOST_POINTS
) -> list[Point]:
    """Up to 20 points (8 of many names) at which every tree is real, up to six of them with all names positive.

    All trees of `positive` are so at each of them. `most` is a lower limit on their number.

    Equal calls of an arbitrary function get the same value however their arguments are written.
    """
    leaves, calls = _leaves((*trees, *positive))
    source, boxes = random.Random(_SEED), _boxes(positive)
    most = most if len(leaves) <= _MANY_NAMES else min(most, _FEWER_POINTS)
    found: list[Point] = []
    in_all = 0
    with mp.workdps(bounds.DIGITS):
        least = mpf("0.05")
        for attempt in range(bounds.TRIES):
            width = mpf(_WIDTHS[attempt // 2 % len(_WIDTHS)])
            in_quadrant = attempt % 2 == 0
            if in_quadrant and in_all == _MOST_POSITIVE:
                continue
            point = {
                leaf: _draw_inside(source, *boxes[leaf], _draw(source, width, least, True))
                if leaf in boxes
                else _draw(source, width, least, in_quadrant)
                for leaf in leaves
            }
            point.update({call: point[canonical] for call, canonical in calls.items()})
            inside = all(_is_positive(condition, point) for condition in positive)
            if inside and all(value(tree, point) is not None for tree in trees):
                found.append(point)
                in_all += in_quadrant
            if len(found) == most:
                break
    return found


def _leaves(trees: Sequence[ex.Expression]) -> tuple[list[ex.Expression], dict[ex.Arbitrary, ex.Expression]]:
    """What is drawn, and for every call of an arbitrary function its canonical form, which is drawn too."""
    nodes = dict.fromkeys(ex.distinct_nodes(trees))
    if any(isinstance(node, ex.Arbitrary) for node in nodes):  # calls that only collecting brings to light
        nodes |= dict.fromkeys(ex.distinct_nodes(map(collecting.collect, trees)))
    calls = {node: collecting.collect(node) for node in nodes if isinstance(node, ex.Arbitrary)}
    drawn = [node for node in nodes if isinstance(node, ex.Symbol | ex.Velocity) and node != ex.PI]
    return [*drawn, *dict.fromkeys(calls.values())], calls


def _draw(source: random.Random, width: evaluation.Real, least: evaluation.Real, positive: bool) -> evaluation.Real:
    size = width * (mpf(source.randrange(1, 10**18)) / 10**18 + least)
    return size if positive or source.random() < 0.5 else -size


def _draw_inside(source: random.Random, low: Fraction | None, high: Fraction | None, size: Any) -> evaluation.Real:
    """Between the two, or at a distance of this size from the only one."""
    if low is None or high is None:
        return _real(low) + size if low is not None else _real(high or Fraction(0)) - size
    return _real(low + (high - low) * Fraction(source.randrange(1, 10**18), 10**18))


def _real(value: Fraction) -> evaluation.Real:
    return mpf(value.numerator) / value.denominator


def _boxes(positive: Sequence[ex.Expression]) -> dict[ex.Expression, tuple[Fraction | None, Fraction | None]]:
    """(a, b) of each name u of which u - a > 0 or b - u > 0 are among the conditions; None for what is not."""
    low: dict[ex.Expression, Fraction] = {}
    high: dict[ex.Expression, Fraction] = {}
    for condition in positive:
        slope, level = (condition, Fraction(0))
        match condition:
            case ex.Sum((part, ex.Number(c))):
                slope, level = part, c
        match slope:
            case ex.Symbol() | ex.Velocity() as leaf:
                low[leaf] = max(-level, low.get(leaf, -level))
            case ex.Product((ex.Number(k), ex.Symbol() | ex.Velocity() as leaf)) if k == -1:
                high[leaf] = min(level, high.get(leaf, level))
    leaves = dict.fromkeys([*low, *high])
    return {u: (low.get(u), high.get(u)) for u in leaves if u not in low or u not in high or low[u] < high[u]}


def value(tree: ex.Expression, point: Point) -> evaluation.Real | None:
    """The value in the working precision, None where there is none; the point keeps it, with those of its parts."""
    try:
        return evaluation.evaluate_once(tree, point)
    except evaluation.NoRealValue:
        return None


def judge(claim: Claim, conditions: Sequence[ex.Expression], points: Sequence[Point]) -> Judgment | None:
    """Where the claim holds; None unless it holds at three points at least and wherever the conditions do."""
    nodes = ex.distinct_nodes((*claim.velocities, claim.hamiltonian))
    calls = [node for node in nodes if isinstance(node, ex.Arbitrary)]
    with mp.workdps(bounds.DIGITS):
        known = [_with_momenta(claim, point, calls) for point in points]
        holds = [point is not None and (_holds(claim, point) or _holds_closer(claim, point, calls)) for point in known]
        signs = [[point is not None and _is_positive(c, point) for c in conditions] for point in known]
    needed = list(range(len(conditions)))
    if not _is_right(holds, signs, needed):
        return None
    for place in list(needed):
        fewer = [other for other in needed if other != place]
        if _is_right(holds, signs, fewer):
            needed = fewer
    return Judgment(sum(holds), tuple(conditions[place] for place in needed))


def _is_right(holds: Sequence[bool], signs: Sequence[Sequence[bool]], needed: Sequence[int]) -> bool:
    """Whether the claim holds at all points, three at least, at which the needed conditions hold."""
    inside = [held for held, row in zip(holds, signs, strict=True) if all(row[place] for place in needed)]
    return len(inside) >= _FEWEST_POINTS and all(inside)


def _is_positive(condition: ex.Expression, point: Point) -> bool:
    number = value(condition, point)
    return number is not None and bool(number > 0)


def _with_momenta(claim: Claim, point: Point, calls: Sequence[ex.Arbitrary]) -> Point | None:
    momenta: dict[ex.Expression, evaluation.Real] = {
        symbol: value(tree, point) for symbol, tree in claim.momenta.items()
    }
    if any(p is None for p in momenta.values()):
        return None
    return _with_equal_calls(calls, {**point, **momenta})


def _with_equal_calls(calls: Sequence[ex.Arbitrary], point: Point) -> Point:
    """The point with those calls valued whose arguments have the values of those of a call that is drawn."""
    fresh = [call for call in calls if call not in point]
    drawn = [call for call in point if isinstance(call, ex.Arbitrary)] if fresh else []
    for call in fresh:
        same = [other for other in drawn if (other.name, other.orders) == (call.name, call.orders)]
        equal = next((other for other in same if _are_equal(other.arguments, call.arguments, point)), None)
        if equal is not None:
            point[call] = point[equal]
    return point


def _are_equal(left: Sequence[ex.Expression], right: Sequence[ex.Expression], point: Point) -> bool:
    """Whether the values agree to 40 digits, each pair."""
    pairs = [(value(a, point), value(b, point)) for a, b in zip(left, right, strict=True)]
    near = mpf(10) ** -bounds.AGREEING
    return all(a is not None and b is not None and abs(a - b) <= near * (1 + abs(a)) for a, b in pairs)


def _holds_closer(claim: Claim, point: Point, calls: Sequence[ex.Arbitrary]) -> bool:
    """The same with more digits, where digits seem to have been lost in differences of large numbers."""
    if not _holds(claim, point, _ROUGH_DIGITS):
        return False
    with mp.workdps(_MOST_DIGITS):
        leaves = [leaf for leaf in point if isinstance(leaf, ex.Symbol | ex.Velocity | ex.Arbitrary)]
        fresh: Point = {leaf: point[leaf] for leaf in leaves}
        closer = _with_momenta(claim, fresh, calls)
        return closer is not None and _holds(claim, closer)


def _holds(claim: Claim, point: Point, digits: int = bounds.AGREEING) -> bool:
    """v(q, p(q, v)) = v and H(q, p(q, v)) = p v - L at a point, to so many digits."""
    lagrangian = value(claim.lagrangian, point)
    if lagrangian is None:
        return False
    rates = [point[ex.Velocity(name)] for name in claim.names]
    works = [point[symbol] * v for symbol, v in zip(claim.momenta, rates, strict=True)]
    expected = [*rates, mp.fsum([*works, -lagrangian])]
    found = [value(tree, point) for tree in (*claim.velocities, claim.hamiltonian)]
    scales = [abs(rate) for rate in rates] + [abs(lagrangian) + mp.fsum(map(abs, works))]
    return all(
        a is not None and abs(a - b) <= mpf(10) ** -digits * scale
        for a, b, scale in zip(found, expected, scales, strict=True)
    )


def signs_of_momenta(
    claim: Claim,
    shifts: Mapping[ex.Expression, ex.Expression],
    positive: Sequence[ex.Expression],
    points: Sequence[Point],
) -> tuple[ex.Expression, ...]:
    """s (p - A) > 0, s = 1 or -1, for momenta p that have this sign where L is defined, if H has values beyond it.

    x' = 4 p^2/9 of p = 3 sqrt(x')/2 has values for p < 0 as well, which belong to another motion.
    """
    is_restricted = any(ex.has(tree, ex.Velocity) for tree in positive)
    allows_all = not is_restricted and _is_polynomial_in_velocities(claim.lagrangian)
    bounded = {p: tree for p, tree in claim.momenta.items() if not (allows_all and _is_affine(tree))}
    if not bounded:
        return ()
    with mp.workdps(bounds.DIGITS):
        known = [point for point in (_with_momenta(claim, point, []) for point in points) if point is not None]
        return tuple(
            tree if sign > 0 else -tree
            for symbol in bounded
            if (sign := _sign_at(tree := shifts.get(symbol, symbol), known))
            and _leaves_the_image(claim, symbol, tree, positive, known)
        )


def _is_polynomial_in_velocities(tree: ex.Expression) -> bool:
    """Whether velocities occur in no functions and only in positive integer powers: all their values are allowed."""
    for node in ex.distinct_nodes((tree,)):
        match node:
            case ex.Power(_, ex.Number(exponent)) if exponent > 0 and exponent.denominator == 1:
                continue
            case ex.Power() | ex.Apply() | ex.Arbitrary() if ex.has(node, ex.Velocity):
                return False
    return True


def _is_affine(tree: ex.Expression) -> bool:
    """Whether a polynomial in the velocities is of degree 1, so that it takes all values."""
    for node in ex.distinct_nodes((tree,)):
        factors = node.factors if isinstance(node, ex.Product) else (node, node) if isinstance(node, ex.Power) else ()
        if sum(ex.has(factor, ex.Velocity) for factor in factors) > 1:
            return False
    return ex.has(tree, ex.Velocity)


def _sign_at(tree: ex.Expression, points: Sequence[Point]) -> int:
    """1 or -1 where it has this sign at all points, else 0."""
    signs = {int(mp.sign(number)) if (number := value(tree, point)) is not None else 0 for point in points}
    return signs.pop() if len(signs) == 1 else 0


def _leaves_the_image(
    claim: Claim, symbol: ex.Symbol, tree: ex.Expression, positive: Sequence[ex.Expression], points: Sequence[Point]
) -> bool:
    """Whether H and v(p) have values with the other sign of p - A, and p(v(p)) is never p where L is defined."""
    wrong, near = False, mpf(10) ** -bounds.AGREEING
    for point in points:
        mirrored: Point = {leaf: point[leaf] for leaf in point if isinstance(leaf, ex.Symbol | ex.Arbitrary)}
        mirrored[symbol] -= 2 * point[tree]
        rates = [value(rate, dict(mirrored)) for rate in claim.velocities]
        if None in rates or value(claim.hamiltonian, dict(mirrored)) is None:
            continue
        there: Point = {**mirrored, **dict(zip(map(ex.Velocity, claim.names), rates, strict=True))}
        found = [(value(p, there), mirrored[name]) for name, p in claim.momenta.items()]
        is_image = all(a is not None and abs(a - b) <= near * (1 + abs(b)) for a, b in found)
        if is_image and all(_is_positive(condition, there) for condition in positive):
            return False
        wrong = True
    return wrong


def vanishes_at(tree: ex.Expression, points: Sequence[Point]) -> bool:
    """Whether the tree is 0 to 40 digits at every point at which it is real (one at least)."""
    with mp.workdps(bounds.DIGITS):
        values = [number for number in (value(tree, point) for point in points) if number is not None]
        return bool(values) and all(abs(number) <= mpf(10) ** -bounds.AGREEING for number in values)


def is_singular(matrix: Sequence[Sequence[ex.Expression]], points: Sequence[Point]) -> bool:
    """Whether the determinant vanishes at every point at which the entries are real (one at least)."""
    verdicts = []
    with mp.workdps(bounds.DIGITS):
        for point in points:
            rows = [[value(entry, point) for entry in row] for row in matrix]
            if all(entry is not None for row in rows for entry in row):
                verdicts.append(_vanishes(rows))
            if verdicts and not verdicts[-1]:
                return False
    return bool(verdicts)


def _vanishes(rows: list[list[evaluation.Real]]) -> bool:
    """|det| against the product of the lengths of the rows (Hadamard)."""
    bound = mp.fprod(mp.norm(row) for row in rows)
    return bool(bound == 0 or abs(mp.det(mp.matrix(rows))) <= mpf(10) ** -bounds.AGREEING * bound)
