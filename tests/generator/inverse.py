"""Compute the exact inverse of a small matrix of elementary functions quickly.

Every exponential, root, sine, and cosine gets its own symbol, so all arithmetic is that of
polynomials; roots are reduced modulo their squares before they are substituted back.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import sympy
from sympy.polys.matrices import DomainMatrix

# exp(x/6) is the generator for exponentials of x: the coefficients drawn have denominators 1, 2, 3
EXPONENTIAL_STEP = 6


@dataclass(frozen=True, slots=True)
class Atoms:
    """The meaning of the generator symbols: `meaning` for all, `radicand` for the square roots."""

    meaning: dict[sympy.Symbol, sympy.Expr] = field(default_factory=dict)
    radicand: dict[sympy.Symbol, sympy.Expr] = field(default_factory=dict)

    def symbol(self, meaning: sympy.Expr) -> sympy.Symbol:
        for known, value in self.meaning.items():
            if value == meaning:
                return known
        created = sympy.Symbol(f"atom{len(self.meaning)}")
        self.meaning[created] = meaning
        return created


def inverse(matrix: sympy.Matrix) -> sympy.Matrix:
    """The inverse. Raises ValueError if the determinant is zero.

    Cofactors over determinant: Gauss in the fraction field takes up to a minute for n = 4, and
    DomainMatrix.adj_det of SymPy 1.14 fails where a coefficient of the characteristic polynomial is
    0.
    """
    atoms = Atoms()
    named = matrix.applyfunc(lambda entry: _named(sympy.expand(entry), atoms))
    scale, polynomial = DomainMatrix.from_Matrix(named).clear_denoms(convert=True)
    ring, dense = polynomial.domain, polynomial.to_dense()
    bar = _reduced(ring.to_sympy(dense.det()), atoms)
    if bar == 0:
        raise ValueError("the Lagrangian is singular")
    factor = ring.to_sympy(scale.element)
    size = matrix.rows

    def entry(i: int, j: int) -> sympy.Expr:
        minor = factor * ring.to_sympy(_minor(dense, j, i)) * (-1) ** (i + j)
        return _quotient(_reduced(minor, atoms), bar, atoms)

    return sympy.Matrix(size, size, entry)


def _minor(matrix: DomainMatrix, row: int, column: int) -> Any:
    """Determinant without one row and one column, an element of the ring; 1 for a matrix (1, 1)."""
    size = range(matrix.shape[0])
    if len(size) == 1:
        return matrix.domain.one
    return matrix.extract([i for i in size if i != row], [j for j in size if j != column]).det()


def _named(expression: sympy.Expr, atoms: Atoms) -> sympy.Expr:
    if isinstance(expression, sympy.exp):
        return sympy.Mul(
            *(
                _exponential(term, atoms)
                for term in sympy.Add.make_args(sympy.expand(expression.exp))
            )
        )
    if isinstance(expression, sympy.Function):
        return atoms.symbol(expression)
    if expression.is_Pow and not expression.exp.is_Integer:
        root = atoms.symbol(sympy.sqrt(expression.base))
        atoms.radicand[root] = _named(expression.base, atoms)
        return root ** (2 * expression.exp)
    if expression.args:
        return expression.func(*(_named(part, atoms) for part in expression.args))
    return expression


def _exponential(term: sympy.Expr, atoms: Atoms) -> sympy.Expr:
    number, rest = term.as_coeff_Mul()
    return atoms.symbol(sympy.exp(rest / EXPONENTIAL_STEP)) ** (EXPONENTIAL_STEP * number)


def _reduced(polynomial: sympy.Expr, atoms: Atoms) -> sympy.Expr:
    for root, square in atoms.radicand.items():
        polynomial = sympy.rem(sympy.expand(polynomial), root**2 - square, root)
    return polynomial


def _quotient(numerator: sympy.Expr, denominator: sympy.Expr, atoms: Atoms) -> sympy.Expr:
    quotient = sympy.cancel(numerator / denominator)
    return sympy.factor_terms(quotient).subs(atoms.meaning)
