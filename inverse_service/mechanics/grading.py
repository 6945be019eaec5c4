"""The scalings and reflections of a motion, and the products of its generators of one degree.

A scaling multiplies each generator, and the time, by a power of a number; a reflection by 1 or -1.
If it maps motions to motions, the conditions on L split into one set for each degree: the parts of
a Lagrangian that are homogeneous are Lagrangians, or vanish. So the products of generators are
tried one degree at a time, some hundred instead of thousands. All scalings are the null space of
the exponents of the terms of the equations: each term of an equation for x'' has the weight of x
and twice that of 1/t. A generator that is a function of others, such as sin(x), has the weight 0,
and x too; a reflection may change the sign of x and sin(x).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm
from operator import mul

import numpy as np
import numpy.typing as npt
from flint import fmpz_mat, nmod_mat

from inverse_service.expressions import terms as tm, tree as ex

Integers = npt.NDArray[np.int64]
# A linear combination of the unknown weights: of symbols, of exponentials, and of 1/t, whose key is
# TIME.
Form = dict[ex.Expression, Fraction]
_ODD = {"sin", "tan", "sinh", "tanh", "asin", "atan", "asinh", "atanh"}
_EVEN = {"cos", "cosh", "abs"}


def _sum(left: Form, right: Form, factor: Fraction | int = 1) -> Form:
    return {
        key: value
        for key in {**left, **right}
        if (value := left.get(key, Fraction(0)) + factor * right.get(key, Fraction(0)))
    }


@dataclass(slots=True)
class _Weights:
    """The weights of generators as forms, and the forms that have to vanish; modulo 2 for
    reflections.
    """

    is_reflection: bool
    zero: list[Form] = field(default_factory=list)
    known: dict[ex.Expression, Form] = field(default_factory=dict)

    def of_terms(self, terms: Iterable[tm.Monomial]) -> Form:
        """The weight of a sum, whose terms have equal weights."""
        first, *others = [self.of_product(key) for key in terms] or [Form()]
        self.zero += [_sum(other, first, -1) for other in others if other != first]
        return first

    def of_product(self, key: tm.Monomial) -> Form:
        total = Form()
        for letter, e in key:
            own = self.of_letter(letter)
            if self.is_reflection and e.denominator > 1:
                self.zero.append(own)  # the root of a negative number is not real
            else:
                for x, weight in own.items():
                    total[x] = total[x] + e * weight if x in total else e * weight
        return {x: weight for x, weight in total.items() if weight}

    def of_letter(self, letter: ex.Expression) -> Form:
        if letter not in self.known:
            self.known[letter] = self._of_letter(letter)
        return self.known[letter]

    def _of_letter(self, letter: ex.Expression) -> Form:
        match letter:
            case ex.Symbol():
                return {letter: Fraction(-1 if letter == ex.TIME else 1)}
            case ex.Velocity(name):
                return {ex.Symbol(name): Fraction(1), ex.TIME: Fraction(1)}
            case ex.Sum() | ex.Product():
                return self.of_terms(tm.terms_of(letter))
            case ex.Apply("exp", ex.Symbol() as exponent) if not self.is_reflection:
                self.zero.append(self.of_letter(exponent))
                return {letter: Fraction(1)}
            case ex.Apply(function, argument):
                inside = self.of_terms(tm.terms_of(argument))
                if self.is_reflection and function in _ODD:
                    return inside
                if not (self.is_reflection and function in _EVEN):
                    self.zero.append(inside)
            case ex.Power(base, exponent):
                self.zero += [self.of_letter(base), self.of_terms(tm.terms_of(exponent))]
            case ex.Arbitrary(_, arguments):
                self.zero += [self.of_terms(tm.terms_of(argument)) for argument in arguments]
        return {}


@dataclass(frozen=True, slots=True)
class Gradings:
    """The weights of each symbol, of 1/t (under TIME), and of exponentials, (letters, gradings),
    for both kinds.
    """

    scalings: Mapping[ex.Expression, tuple[int, ...]]
    reflections: Mapping[ex.Expression, tuple[int, ...]]

    def degrees_of(self, keys: Iterable[tm.Monomial]) -> Integers:
        """The degree of each product in each scaling, in multiples of 1/12, and reflection,
        (products, gradings).
        """
        keys = list(keys)
        scaled = [self._degree(key, self.scalings, _Weights(False)) for key in keys]
        turned = [self._degree(key, self.reflections, _Weights(True)) for key in keys]
        whole = [
            [*map(int, (12 * x for x in a)), *(int(x) % 2 for x in b)]
            for a, b in zip(scaled, turned, strict=True)
        ]
        return np.array(whole, np.int64).reshape(len(keys), -1)

    def reduced(self, degrees: Integers) -> Integers:
        """Sums of degrees, those in reflections modulo 2."""
        found, reflections = degrees.copy(), len(next(iter(self.reflections.values()), ()))
        if reflections:
            found[..., -reflections:] %= 2
        return found

    @staticmethod
    def _degree(
        key: tm.Monomial, table: Mapping[ex.Expression, tuple[int, ...]], weights: _Weights
    ) -> list[Fraction]:
        count = len(next(iter(table.values()), ()))
        total = [Fraction(0)] * count
        for unknown, factor in weights.of_product(key).items():
            row = table.get(unknown, (0,) * count)
            total = [a + factor * b for a, b in zip(total, row, strict=True)]
        return total


@dataclass(frozen=True, slots=True)
class _Degree:
    """The degree of a tree in each of some gradings, and the combinations of these degrees that
    vanish where it is homogeneous.
    """

    degrees: tuple[Fraction | int, ...]
    zero: frozenset[tuple[Fraction | int, ...]] = frozenset()

    def times(self, exponent: int) -> "_Degree":
        return _Degree(tuple(exponent * one for one in self.degrees), self.zero)


@dataclass(slots=True)
class Degrees:
    """The degrees of trees in gradings, each computed once."""

    gradings: Gradings
    known: dict[ex.Expression, tuple[_Degree, _Degree]] = field(default_factory=dict)

    def of_products(
        self, trees: Sequence[ex.Expression], products: Sequence[Sequence[int]]
    ) -> Integers:
        """The degree of each product of trees, given by their places, in the gradings in which all
        trees are homogeneous, (products, gradings); TooManyTerms where a sum has too many terms.
        """
        known = [self._of(tree) for tree in trees]
        scaled = _in_common([one for one, _ in known])
        turned = _in_common([one for _, one in known], modulus=2)
        table, longest = np.concatenate([scaled, turned], 1), max(map(len, products))
        filled = [[*product, *[len(trees)] * (longest - len(product))] for product in products]
        found: Integers = np.concatenate([table, 0 * table[:1]])[filled].sum(1)
        found[:, scaled.shape[1] :] %= 2
        return found

    def _of(self, tree: ex.Expression) -> tuple[_Degree, _Degree]:
        """The degree in scalings, and in reflections."""
        found = self.known.get(tree)
        if found is None:
            match tree:
                case ex.Product(factors):
                    parts = [self._of(factor) for factor in factors]
                    found = _total([a for a, _ in parts]), _total([b for _, b in parts])
                case ex.Power(base, ex.Number(e)) if e.denominator == 1:
                    own = self._of(base)
                    found = own[0].times(int(e)), own[1].times(int(e))
                case _:
                    terms = tm.terms_of(tree)
                    tables = (self.gradings.scalings, False), (self.gradings.reflections, True)
                    first, second = (_degree_of(terms, *table) for table in tables)
                    found = first, second
            self.known[tree] = found
        return found


def _total(parts: Sequence[_Degree]) -> _Degree:
    degrees = zip(*(part.degrees for part in parts), strict=True)
    return _Degree(tuple(map(sum, degrees)), frozenset().union(*(part.zero for part in parts)))


def _degree_of(
    terms: Iterable[tm.Monomial],
    table: Mapping[ex.Expression, tuple[int, ...]],
    is_reflection: bool,
) -> _Degree:
    """The degree of a sum in the gradings of a table."""
    weights, count = _Weights(is_reflection), len(next(iter(table.values()), ()))
    forms = [weights.of_terms(terms), *weights.zero]
    own, *zero = (
        tuple(
            sum(factor * table[x][k] for x, factor in form.items() if x in table)
            for k in range(count)
        )
        for form in forms
    )
    return _Degree(own, frozenset(one for one in zero if any(one)))


def _in_common(degrees: Sequence[_Degree], modulus: int = 0) -> Integers:
    """The degrees in the gradings in which all are homogeneous, (degrees, gradings)."""
    rows = [one.degrees for one in degrees]
    zero = list(frozenset().union(*(one.zero for one in degrees)))
    if zero:
        whole = [[int(x * lcm(*(y.denominator for y in row))) for x in row] for row in zero]
        basis, nullity = (nmod_mat(whole, modulus) if modulus else fmpz_mat(whole)).nullspace()
        columns = [[int(basis[i, k]) for i in range(len(whole[0]))] for k in range(nullity)]
        rows = [tuple(sum(map(mul, row, column)) for column in columns) for row in rows]
    scale = lcm(*(x.denominator for row in rows for x in row))
    found = [[int(x * scale) for x in row] for row in rows]
    return np.array(found, np.int64).reshape(len(degrees), -1)


def gradings_of(
    equations: Iterable[tuple[Form, Iterable[tm.Monomial]]],
    fixed: Iterable[ex.Symbol] = (),
) -> Gradings:
    """All scalings and reflections of equations, each a weight that the terms of a sum must have;
    they leave the `fixed` symbols as they are.
    """
    given = [(weight, list(terms)) for weight, terms in equations]
    given += [({symbol: Fraction(1)}, [tm.EMPTY]) for symbol in fixed]
    tables = []
    for is_reflection in (False, True):
        weights = _Weights(is_reflection)
        for weight, terms in given:
            weights.zero += [_sum(weights.of_product(key), weight, -1) for key in terms]
        forms = [*(weight for weight, _ in given), *weights.zero]
        unknowns = list(dict.fromkeys([ex.TIME, *(x for form in forms for x in form)]))
        different = dict.fromkeys(frozenset(form.items()) for form in weights.zero)
        rows = [[form.get(x, Fraction(0)) for x in unknowns] for form in map(dict, different)]
        whole = [[int(x * lcm(*(y.denominator for y in row))) for x in row] for row in rows] or [
            [0] * len(unknowns)
        ]
        basis, nullity = (nmod_mat(whole, 2) if is_reflection else fmpz_mat(whole)).nullspace()
        tables.append(
            {x: tuple(int(basis[i, k]) for k in range(nullity)) for i, x in enumerate(unknowns)}
        )
    return Gradings(*tables)


def second_order(name: str, terms: Iterable[tm.Monomial]) -> tuple[Form, Iterable[tm.Monomial]]:
    """The equation x'' = a sum of terms."""
    return {ex.Symbol(name): Fraction(1), ex.TIME: Fraction(2)}, terms


def first_order(name: str, terms: Iterable[tm.Monomial]) -> tuple[Form, Iterable[tm.Monomial]]:
    """The equation x' = a sum of terms."""
    return {ex.Symbol(name): Fraction(1), ex.TIME: Fraction(1)}, terms


@dataclass(frozen=True, slots=True)
class Block:
    """A product of generators with the exponents to try. `kind` is the one for `limits`, if any.

    `moves`: whether it is a velocity, or `bends`, another function of the velocities.
    """

    product: tm.Monomial
    exponents: Sequence[Fraction | int]
    kind: str = ""
    moves: bool = False
    bends: bool = False

    def curvature(self, exponent: Fraction | int) -> int:
        """At least 2 in all for a product with a Hessian."""
        if self.moves and exponent in (0, 1):
            return int(exponent)
        return 2 * ((self.moves or self.bends) and exponent != 0)


def products_by_degree(
    blocks: Sequence[Block], gradings: Gradings, limits: Mapping[str, int], most: int, longest: int
) -> Iterator[list[tm.Monomial]]:
    """The products of powers of the blocks of each degree, simple ones first; degrees with simple
    Hessians come first.

    The positive exponents of the blocks of a kind have at most the sum in `limits`. Degrees without
    a product that has a Hessian, or with more than `longest` products, are omitted; TooManyTerms
    for more than `most` products in all.
    """
    table = np.zeros((1, 0), np.int64)
    counts = {kind: np.zeros(1, np.int64) for kind in limits}
    for block in blocks:
        steps, before = np.arange(len(block.exponents)), len(table)
        table = np.concatenate(
            [np.repeat(table, len(steps), 0), np.tile(steps, before)[:, None]], 1
        )
        counts = {kind: np.repeat(count, len(steps)) for kind, count in counts.items()}
        if block.kind in limits:
            counts[block.kind] += np.array([max(0, int(e)) for e in block.exponents])[table[:, -1]]
            kept = counts[block.kind] <= limits[block.kind]
            table, counts = table[kept], {kind: count[kept] for kind, count in counts.items()}
        if len(table) > most:
            raise tm.TooManyTerms
    degrees: Integers = np.zeros((len(table), 1), np.int64)
    sizes, bends = np.zeros((2, len(table)), np.int64)
    powers = [[tm.times(tm.EMPTY, block.product, e) for e in block.exponents] for block in blocks]
    for k, block in enumerate(blocks):
        degrees = degrees + gradings.degrees_of(powers[k])[table[:, k]]
        sizes += np.array([int(abs(2 * Fraction(e)) + 3 * (e < 0)) for e in block.exponents])[
            table[:, k]
        ]
        bends += np.array(list(map(block.curvature, block.exponents)))[table[:, k]]
    degrees = gradings.reduced(degrees)
    places = np.zeros(len(table), np.int64)  # unique rows by columns, four times as fast as by rows
    for column in degrees.T - degrees.min(0)[:, None]:
        _, places = np.unique(places * (column.max() + 1) + column, return_inverse=True)
    order = np.lexsort((sizes, places))
    parts = np.split(order, np.cumsum(np.bincount(places))[:-1])
    simple = [
        (int(sizes[part][bends[part] > 1].min()), len(part), part)
        for part in parts
        if (bends[part] > 1).any()
    ]
    for _, count, part in sorted(simple, key=lambda item: item[:2]):
        if count <= longest:
            rows = table[part].tolist()
            yield list(dict.fromkeys(_product(powers, row) for row in rows))


def _product(powers: Sequence[Sequence[tm.Monomial]], row: Sequence[int]) -> tm.Monomial:
    """The product of one power of each block."""
    table = dict[ex.Expression, Fraction]()
    for own, k in zip(powers, row, strict=True):
        for letter, e in own[k]:
            table[letter] = table[letter] + e if letter in table else e
    return frozenset(item for item in table.items() if item[1])
