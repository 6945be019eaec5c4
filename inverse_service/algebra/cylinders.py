"""Sets of points where polynomials are positive, made connected by more inequalities of that kind.

Variables are eliminated one after another such that every fiber is an interval: over a connected base the whole is
connected (a cylinder). On a line the signs of all derivatives make an interval (Thom's lemma; Bochnak, Coste, Roy,
Real Algebraic Geometry (1998), 2.5.4).

Polynomials over variables and functions, with the signs that they have at one real point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from flint import fmpq, fmpq_mpoly

from inverse_service.algebra.generators import Generators, factors, used_generators
from inverse_service.algebra.real_point import RealTable, real_sign
from inverse_service.algebra.semidefinite import rank_if_semidefinite
from inverse_service.algebra.tower import Tower
from inverse_service.expressions.tree import PI, Apply, Arbitrary, Expression, Power, Symbol, Velocity, walk


@dataclass(slots=True)
class SignedRing:
    """The ring over what conditions are made of; `constants` are parameters, whose signs may be fixed first."""

    table: RealTable
    constants: frozenset[Expression]
    ring: Generators = field(default_factory=lambda: Generators(Tower(()), opaque=True))

    def leaves(self, k: int) -> set[Expression]:
        """The variables that a generator is made of; an arbitrary function is one."""
        tree = self.ring.trees[k]
        if isinstance(tree, Arbitrary):
            return {tree}
        return {node for node in walk(tree) if isinstance(node, Symbol | Velocity | Arbitrary) and node != PI}

    def is_variable(self, k: int) -> bool:
        return isinstance(self.ring.trees[k], Symbol | Velocity | Arbitrary) and self.ring.trees[k] != PI

    def is_constant(self, polynomial: fmpq_mpoly) -> bool:
        return not any(self.leaves(k) for k in used_generators(polynomial))

    def pieces(self, factor: fmpq_mpoly) -> list[fmpq_mpoly]:
        """Conditions by which the factor keeps the sign that it has at the point."""
        return [factor * self.sign_at_point(factor)]

    def sign_at_point(self, polynomial: fmpq_mpoly) -> int:
        return real_sign(self.ring.tree_of(polynomial), self.table)

    def is_positive(self, polynomial: fmpq_mpoly) -> bool:
        """Whether it is positive everywhere: a definite square, or all terms positive and one of them a constant."""
        if _rank_of_square(polynomial) == len(used_generators(polynomial)) + 1:
            return True
        return self._has_even_terms(polynomial, frozenset()) and any(
            not any(e for k, e in enumerate(exponents) if e and not self._is_positive_generator(k))
            for exponents in polynomial.monoms()
        )

    def _is_positive_generator(self, k: int) -> bool:
        tree = self.ring.trees[k]
        if isinstance(tree, Apply):
            return tree.function in ("exp", "cosh", "sech")
        return isinstance(tree, Power) or tree == PI

    def _has_even_terms(self, polynomial: fmpq_mpoly, fixed: frozenset[Expression]) -> bool:
        """Whether every term is positive or zero: even in all but positive generators and those of fixed sign."""
        for exponents, coefficient in polynomial.to_dict().items():
            sign = 1 if fmpq(coefficient) > 0 else -1
            for k, e in enumerate(exponents):
                if e % 2 and not self._is_positive_generator(k):
                    if self.ring.trees[k] not in fixed:
                        return False
                    sign *= real_sign(self.ring.trees[k], self.table)
            if sign < 0:
                return False
        return True

    def definite_by(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly] | None:
        """The signs of constants by which it is at least 0 everywhere, and 0 at most where two functions vanish."""
        if len(polynomial) < 2 or not all(
            self.is_variable(k) or self._is_positive_generator(k) for k in used_generators(polynomial)
        ):
            return None
        if self._has_even_terms(polynomial, frozenset()) or _rank_of_square(polynomial):
            return []
        if not self._has_even_terms(polynomial, self.constants):
            return None
        odd = {k for exponents in polynomial.monoms() for k, e in enumerate(exponents) if e % 2}
        named = [k for k in sorted(odd) if not self._is_positive_generator(k)]
        return [self.ring.context.gen(k) * real_sign(self.ring.trees[k], self.table) for k in named]


def _rank_of_square(polynomial: fmpq_mpoly) -> int:
    """The rank of the homogeneous form of a polynomial of degree 2 that is nowhere negative; 0 for any other."""
    names = used_generators(polynomial)
    if polynomial.total_degree() != 2:
        return 0
    size = len(names) + 1
    matrix = [[Fraction(0)] * size for _ in range(size)]
    for exponents, coefficient in polynomial.to_dict().items():
        places = [j for j, k in enumerate(names) for _ in range(int(exponents[k]))]
        i, j = (*places, size - 1, size - 1)[:2]
        value = Fraction(int(coefficient.p), int(coefficient.q)) / 2
        matrix[i][j] += value
        matrix[j][i] += value
    return rank_if_semidefinite(matrix) or 0


# A polynomial with more terms is not eliminated.
MOST_TERMS = 200
_FAR = Fraction(10) ** 60


def connecting(cell: SignedRing, conditions: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly] | None:
    """Further conditions that make the set where these are positive connected; None where it is not seen how."""
    return _Elimination(cell).extras(conditions)


def _distinct(polynomials: Iterable[fmpq_mpoly]) -> list[fmpq_mpoly]:
    """Each once; polynomials of flint have no hash."""
    found: list[fmpq_mpoly] = []
    for polynomial in polynomials:
        if polynomial not in found:
            found.append(polynomial)
    return found


@dataclass(slots=True)
class _Elimination:
    """Variables taken away one after another; a fiber has to be an interval that is nowhere empty."""

    cell: SignedRing

    def extras(self, conditions: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly] | None:
        """Further conditions that make the set connected; None where it is not seen how."""
        extras: list[fmpq_mpoly] = []
        rest: list[fmpq_mpoly] = []
        for polynomial in conditions:
            signs = self.cell.definite_by(polynomial)
            if signs is None:
                rest.append(polynomial)
            else:
                extras += signs
        rest += [sign for sign in extras if sign not in rest]
        rest = [p for p in rest if not self.cell.is_constant(p)]
        if not rest:
            return extras
        if any(len(p) > MOST_TERMS for p in rest):
            return None
        used = sorted({k for p in rest for k in used_generators(p) if self.cell.leaves(k)})
        names = [k for k in used if self.cell.is_variable(k)]
        more = None
        if names == used:
            more = self._on_a_line(rest, names[0]) if len(names) == 1 else self._outside(rest, names)
        if more is None:
            inside = set().union(*(self.cell.leaves(k) for k in used if k not in names))
            more = self._projected(rest, [k for k in names if not inside & self.cell.leaves(k)])
        return None if more is None else [*extras, *more]

    def _on_a_line(self, conditions: Sequence[fmpq_mpoly], k: int) -> list[fmpq_mpoly]:
        """The signs of all derivatives (Thom's lemma); those of degree 1 and concave ones of degree 2 need none."""
        extras = []
        for polynomial in conditions:
            if polynomial.degrees()[k] == 2 and self.cell.sign_at_point(polynomial.derivative(k).derivative(k)) < 0:
                continue
            while (polynomial := polynomial.derivative(k)).degrees()[k] > 0:
                extras.append(self._sided(polynomial))
        return extras

    def _outside(self, conditions: Sequence[fmpq_mpoly], names: Sequence[int]) -> list[fmpq_mpoly] | None:
        """[] for the outside of one ellipsoid."""
        if len(conditions) > 1 or conditions[0].total_degree() != 2:
            return None
        lifted = conditions[0] + self.cell.ring.constant(_FAR)
        is_ellipsoid = len(names) > 1 and _rank_of_square(lifted) == len(names) + 1
        return [] if is_ellipsoid else None

    def _projected(self, conditions: Sequence[fmpq_mpoly], names: Sequence[int]) -> list[fmpq_mpoly] | None:
        for way in (self._by_constant_slope, self._by_slope, self._by_square):
            for k in names:
                found = way(conditions, k)
                if found is not None:
                    return found
        return None

    def _by_constant_slope(self, conditions: Sequence[fmpq_mpoly], k: int) -> list[fmpq_mpoly] | None:
        return self._linear(conditions, k, self.cell.is_constant)

    def _by_slope(self, conditions: Sequence[fmpq_mpoly], k: int) -> list[fmpq_mpoly] | None:
        return self._linear(conditions, k, lambda slope: True)

    def _linear(
        self, conditions: Sequence[fmpq_mpoly], k: int, accepts: Callable[[fmpq_mpoly], bool]
    ) -> list[fmpq_mpoly] | None:
        """Conditions a z + b > 0: bounds -b/a from below and above, the former less than the latter."""
        touching, base = _parted(conditions, k)
        if any(p.degrees()[k] > 1 or not accepts(p.derivative(k)) for p in touching):
            return None
        signs = self._signs([p.derivative(k) for p in touching])
        lower: list[tuple[fmpq_mpoly, fmpq_mpoly]] = []
        upper: list[tuple[fmpq_mpoly, fmpq_mpoly]] = []
        for polynomial in touching:
            slope = polynomial.derivative(k)
            rest = polynomial - slope * self.cell.ring.context.gen(k)
            (lower if self.cell.sign_at_point(slope) > 0 else upper).append((slope, rest))
        between = [a * d - c * b for a, b in lower for c, d in upper]
        return self._with_base([*base, *signs, *self._factors(between)], [*signs, *self._not_implied(between)])

    def _by_square(self, conditions: Sequence[fmpq_mpoly], k: int) -> list[fmpq_mpoly] | None:
        """One condition a z^2 + b z + c > 0: between its zeros, or beyond the vertex on the side of the point."""
        touching, base = _parted(conditions, k)
        if len(touching) != 1 or touching[0].degrees()[k] != 2:
            return None
        first = touching[0].derivative(k)
        second = first.derivative(k)
        signs = self._signs([second])
        if self.cell.sign_at_point(second) < 0:
            rest = touching[0] - first * self.cell.ring.context.gen(k) + second * self.cell.ring.context.gen(k) ** 2 / 2
            slope = first - second * self.cell.ring.context.gen(k)
            discriminant = slope * slope - second * rest * 2
            further = [*signs, *self._not_implied([discriminant])]
            return self._with_base([*base, *signs, *self._factors([discriminant])], further)
        found = self._with_base([*base, *signs], signs)
        return None if found is None else [*found, self._sided(first)]

    def _sided(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The polynomial without its rational content, positive at the point."""
        content = factors(polynomial)[0]
        return polynomial / fmpq(content.numerator, content.denominator) * self._side(polynomial, content)

    def _side(self, polynomial: fmpq_mpoly, content: Fraction) -> int:
        return self.cell.sign_at_point(polynomial) * (1 if content > 0 else -1)

    def _with_base(self, base: Sequence[fmpq_mpoly], signs: list[fmpq_mpoly]) -> list[fmpq_mpoly] | None:
        more = self.extras(_distinct(base))
        return None if more is None else [*signs, *more]

    def _signs(self, polynomials: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly]:
        """The factors of these that could change their sign, as they are at the point."""
        found = self._factors([p for p in polynomials if not self.cell.is_constant(p)])
        return [p for p in found if not self.cell.is_positive(p)]

    def _not_implied(self, polynomials: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly]:
        """The conditions for those that are positive on the set without their factors having one sign there."""
        plain = [p for p in polynomials if [k for _, k in factors(p)[1]] != [1] or len(self._factors([p])) != 1]
        return self._factors([p for p in plain if not self._is_concave(p)])

    def _is_concave(self, polynomial: fmpq_mpoly) -> bool:
        """Whether it is of degree 2 in one variable, and positive at the point, which is between its zeros."""
        names = used_generators(polynomial)
        if len(names) != 1 or not self.cell.is_variable(names[0]) or polynomial.total_degree() != 2:
            return False
        curvature = polynomial.derivative(names[0]).derivative(names[0])
        return self.cell.sign_at_point(curvature) < 0 < self.cell.sign_at_point(polynomial)

    def _factors(self, polynomials: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly]:
        """Conditions by which all factors keep their signs; what is concave on a line stays whole."""
        found = [[p] if self._is_concave(p) else self._pieces(p) for p in polynomials]
        return _distinct(piece for pieces in found for piece in pieces)

    def _pieces(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
        return [piece for factor, _ in factors(polynomial)[1] for piece in self.cell.pieces(factor)]


def _parted(conditions: Sequence[fmpq_mpoly], k: int) -> tuple[list[fmpq_mpoly], list[fmpq_mpoly]]:
    """Those that hold generator k, and the others."""
    touching = [p for p in conditions if p.degrees()[k] > 0]
    return touching, [p for p in conditions if p.degrees()[k] == 0]
