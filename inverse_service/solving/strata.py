"""Sets of parameter values in which some parameters are functions of the others, which are free.

The functions are rational, or one root of a quadratic equation. Polynomial equations between parameters are split into
such sets by their factors over Q. A a + B = 0 is solved for a where A is not zero, and A = B = 0 is a separate set, so
that no value is lost. Equations of degree above two in every parameter remain unsolved, and the stratum lists them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from flint import fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field

# (index, A, B, C): the parameter of this index is a root of A a^2 + B a + C.
Root = tuple[int, fmpq_mpoly, fmpq_mpoly, fmpq_mpoly]
# A piece that would require more splits than this remains unsolved.
MOST_SPLITS = 200


@dataclass(frozen=True)
class ParameterSpace:
    """The polynomial ring over Q in the parameters."""

    names: tuple[str, ...]

    @cached_property
    def ring(self) -> exact_field.ExactRing:
        """The field of rational functions of the parameters."""
        return exact_field.opaque_ring(map(ex.Symbol, self.names))

    @property
    def context(self) -> fmpq_mpoly_ctx:
        return self.ring.field.context

    def generator(self, name: str) -> fmpq_mpoly:
        """The parameter of this name."""
        return self.context.gen(self.names.index(name))

    def tree(self, polynomial: fmpq_mpoly) -> ex.Expression:
        """The polynomial as a sum of monomials."""
        return exact_field.polynomial_tree(self.ring, polynomial)

    def element(self, polynomial: fmpq_mpoly) -> exact_field.Quotient:
        return exact_field.Quotient(self.ring.field, polynomial, ())

    def put_in(self, polynomial: fmpq_mpoly, index: int, value: exact_field.Quotient) -> exact_field.Quotient:
        """The polynomial with the value substituted for one parameter."""
        parts = map(self.element, coefficients_in(polynomial, index))
        return exact_field.sum_of(self.ring.constant(0), [part * value**degree for degree, part in enumerate(parts)])


@dataclass(frozen=True)
class Stratum:
    """The set where all `equations` vanish and none of `excluded` does; `values` maps indices to solved parameters.

    `roots` are parameters that solve quadratic equations; `unsolved` are equations without a known parametrization.
    """

    space: ParameterSpace
    equations: tuple[fmpq_mpoly, ...] = ()
    excluded: tuple[fmpq_mpoly, ...] = ()
    values: Mapping[int, exact_field.Quotient] = field(default_factory=dict)
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
        """Each solved parameter as a tree in the free parameters."""
        table: dict[ex.Expression, ex.Expression] = {}
        for index, high, middle, low in self.roots:
            root = self._root(middle * middle - high * low * 4) - self.space.tree(middle)
            table[ex.Symbol(self.space.names[index])] = root / (2 * self.space.tree(high))
        space, expand = self.space, self.space.ring.field.expand
        values = {
            ex.Symbol(space.names[index]): space.tree(value.numerator) / space.tree(expand(value.exponents))
            for index, value in self.values.items()
        }
        return table | {name: ex.substitute(tree, table) for name, tree in values.items()}

    def _root(self, radicand: fmpq_mpoly) -> ex.Expression:
        """The square root with squares taken out (the other sign is the conjugate, with the same verdict)."""
        content, parts = exact_field.factor_polynomial(radicand)
        outside = [self.space.tree(base) ** (exponent // 2) for base, exponent in parts]
        inside = [self.space.tree(base) for base, exponent in parts if exponent % 2]
        return ex.multiply(*outside, ex.square_root(ex.multiply(ex.number(content), *inside)))

    def vanishes(self, polynomial: fmpq_mpoly) -> bool:
        """Whether a polynomial in all parameters is zero on the whole stratum."""
        return bool(self.reduced(polynomial).is_zero())

    def reduced(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The polynomial on the stratum, times a power of an element that does not vanish there."""
        for index, value in self.values.items():
            polynomial = self.space.put_in(polynomial, index, value).numerator
        for index, a, b, c in self.roots:
            x = self.space.context.gen(index)
            polynomial = exact_field.pseudo_division(polynomial, a * x * x + b * x + c, index)[2]
        return polynomial

    def contains(self, other: Stratum) -> bool:
        """Whether the other stratum is certainly in the closure of this one."""
        if self.unsolved or other.unsolved:
            return self.equations == () or set(map(str, self.equations)) <= set(map(str, other.equations))
        if not all(other.vanishes(equation) for equation in self.equations):
            return False
        return len(self.equations) < 2 or not any(other.vanishes(factor) for factor in self.excluded)


def coefficients_in(polynomial: fmpq_mpoly, index: int) -> list[fmpq_mpoly]:
    """The coefficients of 1, x, x^2, … for the generator x of this index."""
    found = exact_field.coefficients_of(polynomial, [index])
    return [found.get((degree,), polynomial * 0) for degree in range(max(found, default=(-1,))[0] + 1)]


def factors(polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
    """The distinct irreducible factors over Q that are not numbers."""
    if polynomial.is_constant():
        return []
    found = [factor for factor, _ in exact_field.factor_polynomial(polynomial)[1] if not factor.is_constant()]
    return [factor / factor.leading_coefficient() for factor in found]


# Split equations into solved pieces.


@dataclass(frozen=True)
class _Open:
    """The equations not yet used, and the stratum solved so far."""

    left: tuple[fmpq_mpoly, ...]
    stratum: Stratum


def split(space: ParameterSpace, equations: Sequence[fmpq_mpoly], domain: Sequence[fmpq_mpoly] = ()) -> list[Stratum]:
    """Strata whose union is the set where all equations vanish and no factor of `domain` does."""
    waiting = [_Open(tuple(equations), Stratum(space))]
    found: list[Stratum] = []
    for _ in range(MOST_SPLITS):
        if not waiting:
            break
        following = _step(waiting.pop())
        waiting += [item for item in following if not _is_excluded(item.stratum, domain)]
        if not following:
            continue
        done = [item for item in waiting if not item.left]
        waiting = [item for item in waiting if item.left]
        found += [item.stratum for item in done]
    found += [replace(item.stratum, equations=(*item.stratum.equations, *item.left), unsolved=item.left)
              for item in waiting]  # fmt: skip
    return _without_contained(found)


def _is_excluded(stratum: Stratum, domain: Sequence[fmpq_mpoly]) -> bool:
    return any(stratum.vanishes(factor) for factor in (*domain, *stratum.excluded))


def _without_contained(strata: Sequence[Stratum]) -> list[Stratum]:
    kept: list[Stratum] = []
    for stratum in sorted(strata, key=lambda s: (-s.dimension, len(s.equations))):
        if not any(other.contains(stratum) for other in kept):
            kept.append(stratum)
    return kept


def _step(item: _Open) -> list[_Open]:
    """Solve one equation, or split it by its factors."""
    table = _distinct(item.left)
    if any(not parts for parts in table):
        return []
    if not table:
        return [_Open((), item.stratum)]
    simple = next((k for k, parts in enumerate(table) if len(parts) == 1 and _has_number_slope(parts[0])), None)
    if simple is not None:
        chosen = table[simple][0]
        rest = [math.prod(parts[1:], start=parts[0]) for k, parts in enumerate(table) if k != simple]
        return _solved_linear([chosen], item.stratum, rest)
    if any(len(parts) > 1 for parts in table):
        several = (parts for parts in table if len(parts) > 1)
        chosen_parts = min(several, key=lambda parts: (len(parts), sum(map(len, parts))))
        rest = [math.prod(parts[1:], start=parts[0]) for parts in table if parts is not chosen_parts]
        return [_Open((part, *rest), item.stratum) for part in chosen_parts]
    plain = [parts[0] for parts in table]
    return _solved_linear(plain, item.stratum, ()) or _solved_quadratic(plain, item.stratum)


def _distinct(equations: Sequence[fmpq_mpoly]) -> list[list[fmpq_mpoly]]:
    """The factors of each equation that is not implied by another; [] for an equation without solutions."""
    table = {frozenset(map(str, parts)): parts for parts in (factors(p) for p in equations if not p.is_zero())}
    least = [key for key in table if not any(other < key for other in table)]
    return [table[key] for key in least]


def _has_number_slope(equation: fmpq_mpoly) -> bool:
    """Whether the equation is linear in some parameter with a numeric coefficient."""
    return any(
        degree == 1 and coefficients_in(equation, index)[1].is_constant()
        for index, degree in enumerate(equation.degrees())
    )


def _linear_choices(equations: Sequence[fmpq_mpoly]) -> Iterator[tuple[tuple[int, int, int], int, int]]:
    for place, equation in enumerate(equations):
        for index, degree in enumerate(equation.degrees()):
            if degree == 1:
                low, high = coefficients_in(equation, index)
                yield (0 if high.is_constant() else len(high), len(low) + len(high), index), place, index


def _solved_linear(equations: Sequence[fmpq_mpoly], stratum: Stratum, others: Sequence[fmpq_mpoly]) -> list[_Open]:
    """A a + B = 0 solved for a, and the piece A = B = 0. Empty if none of `equations` is linear in a parameter."""
    choice = min(_linear_choices(equations), default=None)
    if choice is None:
        return []
    _, place, index = choice
    equation = equations[place]
    rest = [*others, *(p for k, p in enumerate(equations) if k != place)]
    low, high = coefficients_in(equation, index)
    space = stratum.space
    value = space.element(-low) / space.element(high)
    solved = replace(
        stratum,
        equations=(*stratum.equations, equation),
        excluded=stratum.excluded if high.is_constant() else (*stratum.excluded, *factors(high)),
        values={**{k: _updated(space, old, index, value) for k, old in stratum.values.items()}, index: value},
        roots=tuple(_updated_root(space, root, index, value) for root in stratum.roots),
    )
    found = [_Open(tuple(space.put_in(p, index, value).numerator for p in rest), solved)]
    if not high.is_constant():
        found.append(_Open((high, low, *rest), stratum))
    return found


def _updated(
    space: ParameterSpace, old: exact_field.Quotient, index: int, value: exact_field.Quotient
) -> exact_field.Quotient:
    """A previous value with the new one substituted."""
    below = space.put_in(space.ring.field.expand(old.exponents), index, value)
    if below.is_zero:
        return old  # an excluded polynomial vanishes there, so the piece is dropped
    return space.put_in(old.numerator, index, value) / below


def _updated_root(space: ParameterSpace, root: Root, index: int, value: exact_field.Quotient) -> Root:
    """The coefficients of a quadratic equation with the new value substituted."""
    own, high, middle, low = root
    x = high.context().gen(own)
    parts = coefficients_in(space.put_in(high * x * x + middle * x + low, index, value).numerator, own)
    return own, parts[2], parts[1], parts[0]


def _solved_quadratic(equations: list[fmpq_mpoly], stratum: Stratum) -> list[_Open]:
    """Solve A a^2 + B a + C = 0, by its real zeros if the discriminant is nowhere positive, else by a root."""
    choices = [
        (len(equation), place, index)
        for place, equation in enumerate(equations)
        for index, degree in enumerate(equation.degrees())
        if degree == 2
    ]
    if not choices:
        return [_Open((), replace(stratum, equations=(*stratum.equations, *equations), unsolved=tuple(equations)))]
    _, place, index = min(choices)
    equation = equations[place]
    rest = [p for k, p in enumerate(equations) if k != place]
    low, middle, high = coefficients_in(equation, index)
    discriminant = middle * middle - high * low * 4
    x = equation.context().gen(index)
    if is_nowhere_positive(discriminant):
        squares = [equation.context().from_dict({e: 1}) for e, _ in discriminant.terms()]
        return [_Open((*squares, high * x * 2 + middle, equation, *rest), stratum)] if squares else []
    reduced = [exact_field.pseudo_division(p, equation, index)[2] for p in rest]
    if any(p.degrees()[index] for p in reduced if not p.is_zero()):
        return [_Open((equation, *reduced), stratum)]
    solved = replace(
        stratum,
        equations=(*stratum.equations, equation),
        excluded=(*stratum.excluded, *factors(high)),
        roots=(*stratum.roots, (index, high, middle, low)),
    )
    found = [_Open(tuple(reduced), solved)]
    return found if high.is_constant() else [*found, _Open((high, middle * x + low, *rest), stratum)]


def is_nowhere_positive(polynomial: fmpq_mpoly) -> bool:
    """Whether it is minus a sum of even monomials, hence negative, or zero where all of them are."""
    return all(value < 0 and not any(int(e) % 2 for e in exponents) for exponents, value in polynomial.terms())
