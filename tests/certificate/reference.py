"""Build the order-r system column by column from its definition, for polynomial f over a prime
field.

This method differs from the checker's: it substitutes each unknown L = one monomial in the
displacements into the Helmholtz conditions as polynomials, and computes all ranks by dense
elimination.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import sympy

PRIME = 2**61 - 1
Polynomial = dict[tuple[int, ...], int]
Matrix = list[list[int]]
Forces = Callable[..., list[sympy.Expr]]


def rank(rows: Matrix) -> int:
    """Rank modulo PRIME by dense elimination."""
    rows, found = [[entry % PRIME for entry in row] for row in rows], 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((k for k in range(found, len(rows)) if rows[k][column]), None)
        if pivot is None:
            continue
        rows[found], rows[pivot] = rows[pivot], rows[found]
        inverse = pow(rows[found][column], -1, PRIME)
        for k in range(found + 1, len(rows)):
            if factor := rows[k][column] * inverse % PRIME:
                rows[k] = [
                    (a - factor * b) % PRIME for a, b in zip(rows[k], rows[found], strict=True)
                ]
        found += 1
    return found


def add(*polynomials: Polynomial, factor: int = 1) -> Polynomial:
    total: Polynomial = {}
    for polynomial in polynomials:
        for exponents, value in polynomial.items():
            total[exponents] = (total.get(exponents, 0) + factor * value) % PRIME
    return total


def multiply(left: Polynomial, right: Polynomial) -> Polynomial:
    total: Polynomial = {}
    for a, value in left.items():
        for b, other in right.items():
            key = tuple(map(sum, zip(a, b, strict=True)))
            total[key] = (total.get(key, 0) + value * other) % PRIME
    return total


def derivative(polynomial: Polynomial, a: int) -> Polynomial:
    return {
        (*key[:a], key[a] - 1, *key[a + 1 :]): value * key[a] % PRIME
        for key, value in polynomial.items()
        if key[a]
    }


class Reference:
    """f(t, q…, v…) as polynomials in the displacements from a point; with `timed`, t is the first
    variable.
    """

    def __init__(self, forces: Forces, n: int, timed: bool, point: list[int]) -> None:
        self.n, self.m, self.timed = n, 2 * n + timed, timed
        symbols = sympy.symbols(f"d0:{self.m}")
        shifted = [symbol + value for symbol, value in zip(symbols, point, strict=True)]
        time, rest = (shifted[:1], shifted[1:]) if timed else ([sympy.Integer(0)], shifted)
        self.f = [self.polynomial(one, symbols) for one in forces(*time, *rest)]
        self.speeds = [self.polynomial(speed, symbols) for speed in rest[n:]]

    def polynomial(self, expression: sympy.Expr, symbols: tuple[sympy.Symbol, ...]) -> Polynomial:
        return {
            key: int(value) % PRIME
            for key, value in sympy.Poly(expression, *symbols).as_dict().items()
        }

    def gamma(self, polynomial: Polynomial) -> Polynomial:
        rates = [{(0,) * self.m: 1}] * self.timed + self.speeds + self.f
        return add(*(multiply(rate, derivative(polynomial, a)) for a, rate in enumerate(rates)))

    def slope(self, k: int, j: int) -> Polynomial:
        return derivative(self.f[k], self.m - self.n + j)

    def phi(self, k: int, j: int) -> Polynomial:
        """2 Phi^k_j."""
        squares = [multiply(self.slope(k, a), self.slope(a, j)) for a in range(self.n)]
        place = derivative(self.f[k], self.m - 2 * self.n + j)
        return add(
            *[self.gamma(self.slope(k, j))] * 2,
            *[add(place, factor=-4)],
            *(add(s, factor=-1) for s in squares),
        )

    def conditions(
        self, unknown: tuple[int, ...], order: int
    ) -> dict[tuple[str, int, int, tuple[int, ...]], int]:
        """The coefficients of H2 and H3 for L = one monomial."""
        n, velocity = self.n, self.m - self.n
        g = [
            [derivative(derivative({unknown: 1}, velocity + i), velocity + j) for j in range(n)]
            for i in range(n)
        ]
        found = {}
        for i, j in combinations_with_replacement(range(n), 2):
            halves = [multiply(g[i][k], self.slope(k, j)) for k in range(n)]
            halves += [multiply(g[j][k], self.slope(k, i)) for k in range(n)]
            for key, value in add(*[self.gamma(g[i][j])] * 2, *halves).items():
                if sum(key) < order:
                    found["H2", i, j, key] = value
            left = [multiply(g[i][k], self.phi(k, j)) for k in range(n)]
            right = [add(multiply(g[j][k], self.phi(k, i)), factor=-1) for k in range(n)]
            for key, value in add(*left, *right).items() if i < j else ():
                if sum(key) <= order:
                    found["H3", i, j, key] = value
        return found

    def unknowns(self, order: int) -> list[tuple[int, ...]]:
        """Monomials of L in ascending degree."""
        keys = [
            tuple(chosen.count(a) for a in range(self.m))
            for degree in range(2, order + 3)
            for chosen in combinations_with_replacement(range(self.m), degree)
        ]
        return [key for key in keys if sum(key[self.m - self.n :]) >= 2]

    def dimensions(self, order: int) -> list[int]:
        """D_0 … D_order: dimensions of the projections to degree <= k of the solutions of the
        order-r system.

        dim of the projection = dim of all solutions - dim of those that vanish up to degree k.
        """
        columns = self.unknowns(order)
        images = [self.conditions(key, order) for key in columns]
        names = sorted({name for image in images for name in image})
        vectors = [[image.get(name, 0) for name in names] for image in images]
        whole = len(columns) - rank(vectors)
        found = []
        for degree in range(order + 1):
            above = [
                vector
                for key, vector in zip(columns, vectors, strict=True)
                if sum(key) > degree + 2
            ]
            found.append(whole - (len(above) - rank(above)))
        return found
