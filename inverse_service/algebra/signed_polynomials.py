"""Polynomials over variables and functions, with the signs that they have at one real point."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from flint import fmpq, fmpq_mpoly

from inverse_service.algebra.generators import Generators, used_generators
from inverse_service.algebra.real_point import RealTable, real_sign
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
        if rank_if_semidefinite(polynomial) == len(used_generators(polynomial)) + 1:
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
        if self._has_even_terms(polynomial, frozenset()) or rank_if_semidefinite(polynomial):
            return []
        if not self._has_even_terms(polynomial, self.constants):
            return None
        odd = {k for exponents in polynomial.monoms() for k, e in enumerate(exponents) if e % 2}
        named = [k for k in sorted(odd) if not self._is_positive_generator(k)]
        return [self.ring.context.gen(k) * real_sign(self.ring.trees[k], self.table) for k in named]


def rank_if_semidefinite(polynomial: fmpq_mpoly) -> int:
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
    rank = 0
    for k in range(size):
        if matrix[k][k] < 0 or (matrix[k][k] == 0 and any(matrix[k][k:])):
            return 0
        for i in range(k + 1, size):
            if matrix[k][k]:
                ratio = matrix[i][k] / matrix[k][k]
                matrix[i] = [a - ratio * b for a, b in zip(matrix[i], matrix[k], strict=True)]
        rank += matrix[k][k] > 0
    return rank
