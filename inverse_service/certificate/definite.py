"""Claims about Lagrangians with a Hessian that is definite at a real point: see FORMAT.md."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import combinations_with_replacement
from typing import Any

from .checker import Question, Tools
from .formulas import NUMBER, Ended, Reader, check_shape, is_irrational, read_tokens, require
from .numbers import Arithmetic, Series, Unsettled
from .series import Elimination, Expansion

Rationals = list[list[Fraction]]


class DefiniteExpansion(Expansion):
    """Series at the point itself take the given matrix for g(p), once it solves all rows for g(p)."""

    def entries(self, matrix: Rationals) -> Series:
        """By the coefficients of L: those of tr(matrix g)/2, and half the values of these where g = matrix."""
        pairs = combinations_with_replacement(range(len(self.v)), 2)
        found = {self.units[self.v[i]] + self.units[self.v[j]]: self.arithmetic.number(matrix[i][j]) for i, j in pairs}
        return self.settle(found)

    def matrix(self, elimination: Elimination) -> list[list[Any]]:
        given, orthogonal = self.question.member, self.question.orthogonal
        if not self.question.pinned:
            return super().matrix(elimination)
        if orthogonal:  # 0 where tr(orthogonal g) follows from the rows
            return [[self.arithmetic.number(Fraction(elimination.insert(self.entries(orthogonal))))]]
        halves = [[x / 2 if i == j else x for j, x in enumerate(row)] for i, row in enumerate(given)]
        values, one = self.entries(halves), self.arithmetic.number(Fraction(1))
        for pivot, row in zip(elimination.pivots, elimination.rows, strict=True):
            if pivot >> self.shift == self.offset:
                solved = self.solved(row | {pivot: one}, values)
                require(solved, "The multiplier is not one that is left at the point.")
        return self.hessian(values)


class Definite(Question):
    """A system, and the checks of certificates about definite Hessians at the point `near`."""

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        self.pinned, self.member, self.orthogonal = False, Rationals(), Rationals()
        super().__init__(tools, document, timed, claim)
        whole = {*self.variables, *self.parameters}
        require(whole <= {*self.near}, "near has to name the whole point.")

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        if self.pinned:
            arithmetic.values |= {name: arithmetic.number(value) for name, value in self.near.items()}
        return DefiniteExpansion(arithmetic, degree)

    def modulo(self, degree: int, work: Callable[[Expansion], Any], count: int = 2) -> list[Any]:
        """At the point itself; for existence also at random points, which are to give the same."""
        if not degree or not (self.member or self.orthogonal):
            return super().modulo(degree, work, count)
        if self.functions or any("pi" in text or is_irrational(text) for text in self.texts()):
            raise Ended("incomplete", "Where f is not rational only a Lagrangian itself proves anything.")
        found = super().modulo(degree, work, count) if self.member else []
        self.pinned = True
        return found + super().modulo(degree, work, count)

    def symmetric(self, document: dict[str, Any], key: str) -> Rationals:
        size = len(self.coordinates)
        check_shape(document, {key: ((NUMBER,) * size,) * size}, "certificate")
        found = [[Fraction(x) for x in row] for row in document[key]]
        require(found == [[*column] for column in zip(*found, strict=True)], f"{key} is not symmetric.")
        return found

    def lagrangian(self, document: dict[str, Any]) -> str:
        told = super().lagrangian(document)
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")

        def real(ring: Expansion) -> None:
            rows = ring.hessian(Reader(ring, formula).value)
            sign = 1 if rows[0][0] > 0 else -1
            require(is_definite([[entry * sign for entry in row] for row in rows]), "The Hessian is not definite.")

        self.proven_in_balls(self.jet, real, "Balls at the real point do not show that the Hessian is definite.")
        return told

    def existence(self, document: dict[str, Any]) -> str:
        self.member = self.symmetric(document, "multiplier")
        require(is_definite(self.member), "The multiplier is not positive definite.")
        return super().existence(document)

    def nonexistence(self, document: dict[str, Any]) -> str:
        self.orthogonal = self.symmetric(document, "orthogonal")
        good = any(map(any, self.orthogonal)) and is_definite(self.orthogonal, semi=True)
        require(good, "orthogonal is zero, or not positive semidefinite.")
        return super().nonexistence(document).replace("regular", "definite")


def is_definite(matrix: list[list[Any]], semi: bool = False) -> bool:
    """By symmetric elimination: all pivots are positive, or zero with their rows; Unsettled where a ball is open."""
    rows = [[*row] for row in matrix]
    for k, row in enumerate(rows):
        if row[k] < 0 or (row[k] == 0 and (not semi or any(row[k:]))):
            return False
        if row[k] == 0:
            continue
        if not row[k] > 0:
            raise Unsettled
        for other in rows[k + 1 :]:
            factor = other[k] / row[k]
            other[:] = [a - factor * b for a, b in zip(other, row, strict=True)]
    return True
