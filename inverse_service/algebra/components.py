"""The connected part of {p_1 > 0, p_2 > 0, …} that contains a real point, cut out by more inequalities of that kind.

Functions that continue each other along paths are one thing on a connected set only. The p_i are factored; the signs
of all factors at the point are conditions, `cylinders.py` adds those that make the set connected. It may become
smaller by that, never wrong. What cannot be treated so (mostly functions of several variables) is left for a box about
the point, on which the conditions are shown to hold by ball arithmetic.

Formulas on boxes, by Arb's balls: what is shown to be positive there is positive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import mpmath
from flint import arb, fmpq, fmpq_mpoly

from inverse_service.algebra.cylinders import MOST_TERMS, SignedRing, connecting
from inverse_service.algebra.generators import Quotient, factors, to_quotient, used_generators
from inverse_service.algebra.point import Variable
from inverse_service.algebra.rational_functions import coefficients_of
from inverse_service.algebra.real_point import RealTable, real_sign, varies
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.inequalities import is_plainly_positive
from inverse_service.expressions.tree import (
    HALF,
    PI,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    apply,
    number,
    walk,
)

_REST: dict[str, Callable[[arb], arb]] = {
    "cot": lambda u: u.cos() / u.sin(),
    "sec": lambda u: 1 / u.cos(),
    "csc": lambda u: 1 / u.sin(),
    "coth": lambda u: u.cosh() / u.sinh(),
    "sech": lambda u: 1 / u.cosh(),
    "csch": lambda u: 1 / u.sinh(),
}


def encloses_positive(
    tree: Expression, center: Mapping[Variable, Fraction], reach: Mapping[Variable, Fraction]
) -> bool:
    """Whether the tree is positive on all of the box |z - center| <= reach; False where that is not shown."""
    try:
        return bool(_ball(tree, center, reach) > 0)
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return False


def _ball(tree: Expression, center: Mapping[Variable, Fraction], reach: Mapping[Variable, Fraction]) -> arb:
    def value(part: Expression) -> arb:
        match part:
            case Number(exact):
                return arb(fmpq(exact.numerator, exact.denominator))
            case Sum(terms):
                return sum((value(term) for term in terms), arb(0))
            case Product(factors):
                product = arb(1)
                for factor in factors:
                    product *= value(factor)
                return product
            case Power(base, Number(exact)) if exact.denominator == 1:
                return value(base) ** int(exact)
            case Power(base, exponent):
                return (value(exponent) * value(base).log()).exp()
            case Apply(function, argument):
                inner = value(argument)
                known = _REST.get(function)
                return known(inner) if known else getattr(inner, function)()
            case _ if part == PI:
                return arb.pi()
            case _:
                middle, radius = center[part], reach[part]  # type: ignore[index]
                return arb(fmpq(middle.numerator, middle.denominator)) + arb(0, float(radius) * (1 + 1e-9))
        raise TypeError

    return value(tree)


_DIGITS = 40
_WIDTHS = tuple(Fraction(1, 2) ** k for k in range(-3, 30))
_DOUBLINGS = 8  # of one side of a box


def component(positive: Iterable[Expression], table: RealTable, constants: Sequence[Symbol] = ()) -> list[Expression]:
    """Trees whose being positive cuts out an open connected set with the point on which all of `positive` are.

    `constants` are parameters: their signs are fixed before those of coordinates. IrreducibleAtoms where a sign cannot
    be determined at the point or no such set is found.
    """
    cell = _Cell(table, frozenset(constants))
    for tree in positive:
        cell.require(tree)
    return _strongest(cell.connected(), table)


@dataclass(slots=True)
class _Cell(SignedRing):
    """Irreducible polynomials that are positive at the point."""

    conditions: list[fmpq_mpoly] = field(default_factory=list)

    def require(self, tree: Expression) -> None:
        """Add all factors of the tree with their signs at the point."""
        self.conditions += [piece for piece in self._pieces_of(tree) if piece not in self.conditions]

    def _pieces_of(self, tree: Expression) -> list[fmpq_mpoly]:
        replaced = self._simpler(tree)
        if replaced is not None:
            return [piece for each in replaced for piece in self._pieces_of(each)]
        quotient = to_quotient(self.ring, tree)
        if max(len(quotient.numerator), len(quotient.denominator)) > MOST_TERMS:
            raise IrreducibleAtoms("a condition is too long")
        sides = (quotient.numerator, quotient.denominator)
        return [piece for side in sides for factor, _ in factors(side)[1] for piece in self.pieces(factor)]

    def pieces(self, factor: fmpq_mpoly) -> list[fmpq_mpoly]:
        """Conditions by which the factor keeps the sign that it has at the point."""
        tree = self.ring.tree_of(factor)
        if not varies(tree):
            return []
        sign = real_sign(tree, self.table)
        replaced = self._simpler(tree if sign > 0 else -tree)
        if replaced is not None:
            return [piece for each in replaced for piece in self._pieces_of(each)]
        polynomial = factor * sign
        norm = None if self.is_positive(polynomial) else self._norm(polynomial)
        if norm is None:
            return [polynomial]
        return [piece for part, _ in factors(norm)[1] for piece in self.pieces(part)]

    def _norm(self, polynomial: fmpq_mpoly) -> fmpq_mpoly | None:
        """A^2 - B^2 w for A + B sqrt(w), which vanishes only where this does; None where there is no square root.

        Where w > 0 (a condition of its own) and the norm is not 0, A + B sqrt(w) keeps its sign.
        """
        for k in used_generators(polynomial):
            match self.ring.trees[k]:
                case Power(base, Number(exponent)) if exponent == Fraction(1, 2):
                    even, odd, below = self._by_parity(polynomial, k, to_quotient(self.ring, base))
                    return even * even * below.denominator - odd * odd * below.numerator
        return None

    def _by_parity(self, polynomial: fmpq_mpoly, k: int, radicand: Quotient) -> tuple[fmpq_mpoly, fmpq_mpoly, Quotient]:
        """(A, B, w), up to a common factor, for A + B r with r^2 = w put in."""
        most = polynomial.degrees()[k] // 2
        parts = [self.ring.constant(Fraction(0)), self.ring.constant(Fraction(0))]
        for (power,), rest in coefficients_of(polynomial, [k]).items():
            half = power // 2
            parts[power % 2] += rest * radicand.numerator**half * radicand.denominator ** (most - half)
        return parts[0], parts[1], radicand

    def _simpler(self, tree: Expression) -> list[Expression] | None:
        """Conditions on u for sin u > 0, cos u > 0, log u > 0, or their negatives; None for another tree."""
        shifted = [] if is_plainly_positive(tree) else self._touching(tree) or _beyond_exponential(tree)
        if shifted is not None:
            return shifted
        sign, inner = _signed(tree)
        match inner:
            case Apply("sin" | "cos" as function, u):
                return self._between(u if function == "sin" else u + HALF * PI)
            case Apply("log", u):
                return [sign * (u - 1), u]
            case Apply("atan" | "sinh" | "tanh" | "asin" | "asinh" | "atanh", u):
                return [sign * u]
            case Apply("exp" | "cosh" | "sech"):
                return []
        return None

    def _touching(self, tree: Expression) -> list[Expression] | None:
        """1 - sin u > 0 and its kin, which touch 0: between two of the places where they do."""
        terms = dict.fromkeys(getattr(tree, "terms", ()))
        for node in terms:
            sign, inner = _signed(node)
            if len(terms) != 2 or not isinstance(inner, Apply) or inner.function not in ("sin", "cos", "cosh"):
                continue
            if sign * inner != node or number(-1 if inner.function == "cosh" else 1) not in terms:
                continue
            u = inner.argument
            if inner.function == "cosh":
                return [u if real_sign(u, self.table) > 0 else -u] if sign > 0 else None
            turns = Fraction(sign, 2) if inner.function == "sin" else Fraction(sign + 1, 2)
            return self._between(HALF * (u + turns * PI))
        return None

    def _between(self, u: Expression) -> list[Expression]:
        """k pi < u < (k + 1) pi, as at the point."""
        with mpmath.workdps(_DIGITS):
            k: int = int(mpmath.floor(evaluate(u, self.table) / mpmath.pi))
        return [u - k * PI, (k + 1) * PI - u]

    def connected(self) -> list[Expression]:
        """The conditions with those that make the set connected; definite ones are left out."""
        found: list[fmpq_mpoly] = []
        lost: list[fmpq_mpoly] = []
        for group in self._groups():
            more = connecting(self, group)
            (lost if more is None else found).extend(group)
            found += more or []
        kept = list(dict.fromkeys(self.ring.tree_of(p) for p in found if not self.is_positive(p)))
        return [*kept, *self._box([self.ring.tree_of(p) for p in lost])]

    def _groups(self) -> list[list[fmpq_mpoly]]:
        """Conditions that share variables, together."""
        groups: list[tuple[set[Expression], list[fmpq_mpoly]]] = []
        for polynomial in self.conditions:
            names = {node for k in used_generators(polynomial) for node in self.leaves(k)}
            touching = [group for group in groups if group[0] & names]
            groups = [group for group in groups if not group[0] & names]
            joined = [p for group in touching for p in group[1]]
            groups.append((names.union(*(group[0] for group in touching)), [*joined, polynomial]))
        return [group for _, group in groups]

    def _box(self, trees: list[Expression]) -> list[Expression]:
        """|z - z0| < r for the variables of these trees, with the largest r of a few for which all are positive."""
        if not trees:
            return []
        nodes = dict.fromkeys(node for tree in trees for node in walk(tree))
        names = [node for node in nodes if isinstance(node, Symbol | Velocity) and node != PI]
        for k, width in enumerate(_WIDTHS):
            digits = 3 + k // 3  # the point stays within a sixteenth of the reach, so it is in the box itself
            center = {name: Fraction(mpmath.nstr(self.table[name], digits)) for name in names}
            reach = {name: width * max(abs(value), Fraction(1, 100)) for name, value in center.items()}
            if all(encloses_positive(tree, center, reach) for tree in trees):
                reach = _stretched(trees, center, reach)
                above = [name - (center[name] - reach[name]) for name in names]
                return above + [center[name] + reach[name] - name for name in names]
        raise IrreducibleAtoms("no connected set was found on which all functions are defined")


def _stretched(
    trees: Sequence[Expression], center: Mapping[Variable, Fraction], reach: dict[Variable, Fraction]
) -> dict[Variable, Fraction]:
    """The reach of each variable by itself, doubled while all trees stay positive."""
    for name in reach:
        for _ in range(_DOUBLINGS):
            wider = {**reach, name: 2 * reach[name]}
            if not all(encloses_positive(tree, center, wider) for tree in trees):
                break
            reach = wider
    return reach


def extent(trees: Iterable[Expression], table: RealTable) -> mpmath.mpf:
    """The least (b - a)/|z| of the variables with bounds a < z < b among the conditions; infinite where none has."""
    limits = dict[Variable, dict[int, mpmath.mpf]]()
    for tree in trees:
        if (bound := bound_of(tree)) is not None:
            limits.setdefault(bound[0], {})[bound[1]] = evaluate(bound[2], {})
    sizes = {name: max(abs(table[name]), mpmath.mpf("0.01")) for name in limits}
    widths = [(side[-1] - side[1]) / sizes[name] for name, side in limits.items() if len(side) == 2]
    return min(widths, default=mpmath.inf)


def _beyond_exponential(tree: Expression) -> list[Expression] | None:
    """a e^u + b > 0 as a condition on u, where a and b are numbers of different signs."""
    if not isinstance(tree, Sum) or len(tree.terms) != 2 or not isinstance(tree.terms[1], Number):
        return None
    constant, factor, inner = tree.terms[1].value, Fraction(1), tree.terms[0]
    if isinstance(inner, Product) and isinstance(inner.factors[0], Number) and len(inner.factors) == 2:
        factor, inner = inner.factors[0].value, inner.factors[1]
    if not isinstance(inner, Apply) or inner.function != "exp":
        return None
    ratio = -constant / factor
    limit = apply("log", number(ratio)) if ratio != 1 else number(0)
    return [(1 if factor > 0 else -1) * (inner.argument - limit)] if ratio > 0 else None


def _signed(tree: Expression) -> tuple[int, Expression]:
    """(1, u) or (-1, u) for c u with a number c."""
    match tree:
        case Product((Number(factor), inner)):
            return (1 if factor > 0 else -1), inner
        case _:
            return 1, tree


def _strongest(trees: Sequence[Expression], table: RealTable) -> list[Expression]:
    """Without those bounds z > a, z < b of one variable that follow from another, and without what follows from all."""
    best: dict[tuple[Expression, int], tuple[mpmath.mpf, Expression]] = {}
    others = []
    for tree in trees:
        found = bound_of(tree)
        if found is None:
            others.append(tree)
            continue
        variable, side, value = found
        with mpmath.workdps(_DIGITS):
            limit = evaluate(value, table) * side
        if (variable, side) not in best or limit > best[variable, side][0]:
            best[variable, side] = (limit, tree)
    bounds = [tree for _, tree in best.values()]
    for tree in list(others):
        rest = [other for other in others if other != tree]
        if is_plainly_positive(tree, known_positive([*bounds, *rest])):
            others = rest
    return [*bounds, *others]


def known_positive(trees: Sequence[Expression]) -> set[Expression]:
    """What is positive where these trees are: they, and z for bounds z > a with a number a that is not below 0."""
    known, bounds = set(trees), [bound for tree in trees if (bound := bound_of(tree)) is not None]
    with mpmath.workdps(_DIGITS):
        return known | {variable for variable, side, value in bounds if side > 0 and evaluate(value, {}) >= 0}


def bound_of(tree: Expression) -> tuple[Variable, int, Expression] | None:
    """(z, 1, a) for z > a, (z, -1, a) for z < a, where the tree > 0 says just that and a is a number; else None."""
    terms = getattr(tree, "terms", (tree,))
    varying = [term for term in terms if varies(term)]
    if len(varying) != 1:
        return None
    parts = getattr(varying[0], "factors", (varying[0],))
    slope = parts[0].value if isinstance(parts[0], Number) else Fraction(1)
    variable = parts[-1]
    if len(parts) > 2 or (len(parts) == 2 and slope == 1) or not isinstance(variable, Symbol | Velocity):
        return None
    rest = [-1 / slope * term for term in terms if term is not varying[0]]
    return variable, 1 if slope > 0 else -1, add(*rest)
