"""Sets of parameter values: some parameters are functions of the others, which are free.

The functions are rational, or one root of a quadratic equation; `splitting` makes them from equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from flint import Ordering, fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field


@dataclass(frozen=True)
class ParameterSpace:
    """The polynomial ring over Q in the parameters."""

    names: tuple[str, ...]

    @cached_property
    def context(self) -> fmpq_mpoly_ctx:
        return fmpq_mpoly_ctx.get(self.names or ("none",), Ordering.lex)

    def tree(self, polynomial: fmpq_mpoly) -> ex.Expression:
        """The polynomial as a sum of monomials."""
        symbols = [ex.Symbol(name) for name in self.names]
        return ex.add(
            *(
                ex.multiply(
                    ex.number(exact_field.as_fraction(c)),
                    *(s ** int(e) for s, e in zip(symbols, exponents, strict=False)),
                )
                for exponents, c in polynomial.terms()
            )
        )


@dataclass(frozen=True)
class Fraction:
    """numerator / denominator in the free parameters."""

    numerator: fmpq_mpoly
    denominator: fmpq_mpoly


# (index, A, B, C): the parameter of this index is a root of A a^2 + B a + C.
Root = tuple[int, fmpq_mpoly, fmpq_mpoly, fmpq_mpoly]


@dataclass(frozen=True)
class Stratum:
    """Where all `equations` vanish and none of `excluded` does; `values` gives parameters by index.

    `roots` are parameters that solve quadratic equations; `unsolved` are equations for which no
    parametrization was found.
    """

    space: ParameterSpace
    equations: tuple[fmpq_mpoly, ...] = ()
    excluded: tuple[fmpq_mpoly, ...] = ()
    values: Mapping[int, Fraction] = field(default_factory=dict)
    roots: tuple[Root, ...] = ()
    unsolved: tuple[fmpq_mpoly, ...] = ()

    @property
    def dimension(self) -> int:
        """The number of free parameters."""
        return len(self.free) - len(self.unsolved)

    @property
    def free(self) -> tuple[str, ...]:
        gone = {*self.values, *(root[0] for root in self.roots)}
        return tuple(name for index, name in enumerate(self.space.names) if index not in gone)

    def trees(self) -> dict[ex.Expression, ex.Expression]:
        """Each solved parameter as a tree in the free ones."""
        table: dict[ex.Expression, ex.Expression] = {}
        for index, high, middle, low in self.roots:
            root = self._root(middle * middle - high * low * 4) - self.space.tree(middle)
            table[ex.Symbol(self.space.names[index])] = root / (2 * self.space.tree(high))
        values = {ex.Symbol(self.space.names[index]): self._fraction(value) for index, value in self.values.items()}
        return table | {name: ex.substitute(tree, table) for name, tree in values.items()}

    def _root(self, radicand: fmpq_mpoly) -> ex.Expression:
        """The square root, squares taken out (the other sign is the conjugate, with the same verdict)."""
        content, parts = exact_field.factor_polynomial(radicand)
        outside = [self.space.tree(base) ** (exponent // 2) for base, exponent in parts]
        inside = [self.space.tree(base) for base, exponent in parts if exponent % 2]
        return ex.multiply(*outside, ex.square_root(ex.multiply(ex.number(content), *inside)))

    def _fraction(self, value: Fraction) -> ex.Expression:
        if value.denominator.is_constant():
            return self.space.tree(value.numerator / value.denominator.leading_coefficient())
        return self.space.tree(value.numerator) / self.space.tree(value.denominator)

    def vanishes(self, polynomial: fmpq_mpoly) -> bool:
        """Whether a polynomial in all parameters is zero on the whole stratum."""
        return bool(self.reduced(polynomial).is_zero())

    def reduced(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The polynomial on the stratum, times a power of what does not vanish there."""
        for index, value in self.values.items():
            polynomial = put_in(polynomial, index, value)
        for index, a, b, c in self.roots:
            x = self.space.context.gen(index)
            polynomial = pseudo_remainder(polynomial, a * x * x + b * x + c, index)
        return polynomial

    def contains(self, other: Stratum) -> bool:
        """Whether the other stratum lies in the closure of this one; False where that is not certain."""
        if self.unsolved or other.unsolved:
            return self.equations == () or set(map(str, self.equations)) <= set(map(str, other.equations))
        if not all(other.vanishes(equation) for equation in self.equations):
            return False
        return len(self.equations) < 2 or not any(other.vanishes(factor) for factor in self.excluded)


def coefficients_in(polynomial: fmpq_mpoly, index: int) -> list[fmpq_mpoly]:
    """Coefficients of 1, x, x^2, … for the generator x of this index."""
    found = exact_field.coefficients_of(polynomial, [index])
    return [found.get((degree,), polynomial * 0) for degree in range(max(found, default=(-1,))[0] + 1)]


def put_in(polynomial: fmpq_mpoly, index: int, value: Fraction, power: int = 0) -> fmpq_mpoly:
    """The numerator of the polynomial with N/D for one generator, over D^power at least."""
    parts = coefficients_in(polynomial, index)
    total, most = polynomial * 0, max(power, len(parts) - 1)
    for degree, part in enumerate(parts):
        total += part * value.numerator**degree * value.denominator ** (most - degree)
    return total


def pseudo_remainder(polynomial: fmpq_mpoly, divisor: fmpq_mpoly, index: int) -> fmpq_mpoly:
    """A remainder of lower degree in one generator, after multiplying by powers of the leading coefficient."""
    leading = coefficients_in(divisor, index)
    degree, x = len(leading) - 1, polynomial.context().gen(index)
    while not polynomial.is_zero() and len(parts := coefficients_in(polynomial, index)) > degree:
        polynomial = polynomial * leading[-1] - parts[-1] * x ** (len(parts) - 1 - degree) * divisor
    return polynomial


def factors(polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
    """The distinct irreducible factors over Q that are not numbers."""
    if polynomial.is_constant():
        return []
    found = [factor for factor, _ in exact_field.factor_polynomial(polynomial)[1] if not factor.is_constant()]
    return [factor / factor.leading_coefficient() for factor in found]
