"""Points on the flow of q'' = f, and formulas interpolated from their values.

Forces and their tensors as numbers: truncated series along the motion with gradients, at many points modulo a prime.

At a random point the motion is a power series in s (order by order, q'' = f); f is evaluated once more on these series
with its gradients in the 2 n directions of q and v. That gives J = f_v and K = f_q as matrix series along the flow,
where Gamma is d/ds:

    N = -J/2,  Phi = J' - 2 K - J^2/2 (twice the Jacobi endomorphism),  nabla T = T' + N T - T N.

No derivative is taken in symbols, and f is never multiplied out. All points of a batch are one array: a `Jet` has the
shape (1 + directions, order, points), its first row the value.

What a formula is made of are generators with independent random values: t, coordinates, velocities, parameters; for the
angles of circular functions a rational point (2 u, 1 - u^2)/(1 + u^2) of the circle, beside the coordinate's own value;
for exponentials, logarithms, and arctangents a residue; for arbitrary functions each partial derivative. Roots are true
roots: the prime is a safe one, so that a square has one root that is a square, and a point without it is dropped.

A vector of polynomials that is known up to a factor at points modulo a prime (Zippel 1979, projectively).

The vector (v_1 : ... : v_m) is one common polynomial vector (P_1, ..., P_m): with a reference entry r the unknown
coefficients solve v_e P_r(x) - v_r P_e(x) = 0, and no denominator is asked for. For each variable alone the least
degree for which there is a fit is found, the others fixed; then the variables are added one at a time, the support so
far times powers of the new one, and what comes out as 0 is dropped. The least degrees make the vector primitive.

The basis in an angle is c^a s^b with b <= 1, in any other variable its powers. Coefficients are divided by one of them
and reconstructed as rational numbers; that the result is right is for the caller to check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from math import factorial, lcm

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service import deadline
from inverse_service.expressions import tree as ex
from inverse_service.field import modular, tower
from inverse_service.search.terms import Monomial, Terms, add_terms, monomial_tree, terms_of, times

Numbers = npt.NDArray[np.int64]
PRIME = 2_147_483_579  # 2 q + 1 with q prime
_HALF = (PRIME - 1) // 2
# A generator: a variable, ("angle" | "exp", unit), ("log" | "atan", tree), or (name, argument values' key, orders).
Generator = tuple[str, object]


def inverses(values: Numbers) -> Numbers:
    """1/x modulo the prime, 0 for 0."""
    return powers(values, PRIME - 2)


def powers(values: Numbers, exponent: int) -> Numbers:
    result, base = np.ones_like(values), values % PRIME
    while exponent:
        if exponent & 1:
            result = result * base % PRIME
        base = base * base % PRIME
        exponent >>= 1
    return result


def residue(value: Fraction) -> int:
    """The number modulo the prime."""
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


@dataclass(frozen=True, slots=True)
class Jet:
    """Values and gradients along the flow, (1 + directions, order, points)."""

    data: Numbers

    def __add__(self, other: Jet) -> Jet:
        return Jet((self.data + other.data) % PRIME)

    def scaled(self, factor: int) -> Jet:
        return Jet(self.data * factor % PRIME)

    def __mul__(self, other: Jet) -> Jet:
        a, b = self.data, other.data
        result = np.zeros_like(a)
        for k in range(a.shape[1]):
            for j in range(k + 1):
                result[0, k] += a[0, j] * b[0, k - j] % PRIME
                if a.shape[0] > 1:
                    result[1:, k] += (a[1:, j] * b[0, k - j] + a[0, j] * b[1:, k - j] % PRIME) % PRIME
        return Jet(result % PRIME)

    def with_series(self, value: Numbers, slope: Numbers) -> Jet:
        """h(self) for a function with these series of h and of h' along the flow."""
        result = np.empty_like(self.data)
        result[0] = value
        for k in range(value.shape[0]):
            result[1:, k] = sum(slope[j] * self.data[1:, k - j] % PRIME for j in range(k + 1)) % PRIME
        return Jet(result)


def _times(a: Numbers, b: Numbers) -> Numbers:
    """The product of two series, (order, points) each."""
    result = np.zeros_like(a)
    for k in range(a.shape[0]):
        for j in range(k + 1):
            result[k] += a[j] * b[k - j] % PRIME
    return result % PRIME


def _power(a: Numbers, exponent: int, start: Numbers) -> Numbers:
    """a^e with e a residue and the given constant term: k a_0 y_k = sum_j (e j - (k - j)) a_j y_(k-j)."""
    result, least = np.zeros_like(a), inverses(a[0])
    result[0] = start
    for k in range(1, a.shape[0]):
        total = sum(
            ((exponent * j - (k - j)) % PRIME) * (a[j] * result[k - j] % PRIME) % PRIME for j in range(1, k + 1)
        )
        result[k] = total % PRIME * least % PRIME * pow(k, -1, PRIME) % PRIME
    return result


def _primitive(rate: Numbers, start: Numbers) -> Numbers:
    """The series with this derivative in s, of which the last coefficient is not asked."""
    result = np.zeros_like(rate)
    result[0] = start
    for k in range(1, rate.shape[0]):
        result[k] = rate[k - 1] * pow(k, -1, PRIME) % PRIME
    return result


def _derivative(a: Numbers) -> Numbers:
    """da/ds; its last coefficient is unknown and 0."""
    result = np.zeros_like(a)
    for k in range(1, a.shape[0]):
        result[k - 1] = a[k] * k % PRIME
    return result


@dataclass(slots=True)
class Units:
    """How fine the generators of angles and exponentials have to be: for each unit the common denominator."""

    angles: dict[Monomial, int] = field(default_factory=dict)
    exponentials: dict[Monomial, int] = field(default_factory=dict)

    @classmethod
    def of(cls, trees: Iterable[ex.Expression]) -> Units:
        """Of all circular functions and exponentials in these kernels. TooManyTerms for a long argument."""
        found = cls()
        for node in ex.distinct_nodes(trees):
            if isinstance(node, ex.Apply) and node.function in ("sin", "cos", "exp"):
                table = found.exponentials if node.function == "exp" else found.angles
                for key, value in terms_of(node.argument).items():
                    table[key] = lcm(table.get(key, 1), value.denominator)
        return found


@dataclass(slots=True)
class Points:
    """A batch of points: the values of all generators, drawn when asked for, and which points are still good.

    `fixed` are generators with given values, one for all points or one for each; the others are random.
    """

    coordinates: tuple[str, ...]
    units: Units
    count: int
    random: np.random.Generator
    fixed: Mapping[Generator, int | Numbers] = field(default_factory=dict)
    values: dict[Generator, Numbers] = field(default_factory=dict)
    good: npt.NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        self.good = np.ones(self.count, bool)

    def value(self, generator: Generator) -> Numbers:
        if generator not in self.values:
            if generator in self.fixed:
                self.values[generator] = np.full(self.count, self.fixed[generator] % PRIME, np.int64)
            else:
                self.values[generator] = self.random.integers(2, PRIME - 2, self.count)
        return self.values[generator]

    def circle(self, unit: Monomial) -> tuple[Numbers, Numbers]:
        """(sin, cos) of the unit over its denominator."""
        u = self.value(("angle", unit))
        square = u * u % PRIME
        below = inverses(1 + square)
        return 2 * u % PRIME * below % PRIME, (1 - square) % PRIME * below % PRIME

    def again(self, velocities: Sequence[Numbers | None]) -> Points:
        """The same points with other velocities; random ones where None is given."""
        names = [("variable", ex.Velocity(name)) for name in self.coordinates]
        kept = {key: value for key, value in self.values.items() if key not in names}
        other = Points(self.coordinates, self.units, self.count, self.random, self.fixed, kept)
        other.values |= {key: v for key, v in zip(names, velocities, strict=True) if v is not None}
        return other


class Flow:
    """f along the motion at a batch of points; `order` coefficients in s are kept."""

    def __init__(self, points: Points, forces: Sequence[ex.Expression], order: int, gradients: bool = True) -> None:
        self.points, self.order, n = points, order, len(forces)
        self.size = 1 + (2 * n if gradients else 0)
        names = points.coordinates
        kernels = [tower.to_kernels(f) for f in forces]
        q = np.zeros((n, order + 2, points.count), np.int64)
        q[:, 0] = [points.value(("variable", ex.Symbol(name))) for name in names]
        q[:, 1] = [points.value(("variable", ex.Velocity(name))) for name in names]
        for k in range(order if n else 0):
            plain = _Evaluation(points, names, q[:, : k + 1], _derivatives(q)[:, : k + 1], 1)
            for i, f in enumerate(kernels):
                q[i, k + 2] = plain.jet(f).data[0, k] * pow((k + 1) * (k + 2), -1, PRIME) % PRIME
        self.q = q
        self.evaluation = _Evaluation(points, names, q[:, :order], _derivatives(q)[:, :order], self.size)
        self.forces = [self.evaluation.jet(f) for f in kernels]

    def tree(self, tree: ex.Expression) -> Jet:
        """The series of any formula in the same generators."""
        return self.evaluation.jet(tower.to_kernels(tree))

    def slopes(self) -> tuple[Numbers, Numbers]:
        """(f_v, f_q), (order, points, n, n) each."""
        n = len(self.forces)
        whole = np.array([force.data[1:] for force in self.forces])  # force, direction, order, point
        arranged = whole.transpose(2, 3, 0, 1)
        return arranged[..., n:], arranged[..., :n]

    def tensors(self, count: int) -> tuple[Numbers, list[Numbers]]:
        """(N, [Phi, nabla Phi, …]) at the points, (points, n, n) each; `count` <= order - 1 of them."""
        by_velocity, by_position = self.slopes()
        half = pow(2, -1, PRIME)
        connection = -by_velocity * half % PRIME
        rate = _derivative(by_velocity)
        current = (rate - 2 * by_position - _matrices(by_velocity, by_velocity) * half) % PRIME
        found = [current[0]]
        for _ in range(count - 1):
            turned = _matrices(connection, current) - _matrices(current, connection)
            current = (_derivative(current) + turned) % PRIME
            found.append(current[0])
        return connection[0], found


def _matrices(a: Numbers, b: Numbers) -> Numbers:
    """Products of matrix series, (order, points, n, n)."""
    result = np.zeros_like(a)
    for k in range(a.shape[0]):
        for j in range(k + 1):
            result[k] += matrix_product(a[j], b[k - j])
    return result % PRIME


def matrix_product(a: Numbers, b: Numbers) -> Numbers:
    """(points, n, n) times (points, n, n)."""
    total = np.zeros_like(a)
    for m in range(a.shape[-1]):
        total += a[..., :, m, None] * b[..., None, m, :] % PRIME
    return total % PRIME


def _derivatives(q: Numbers) -> Numbers:
    return np.array([_derivative(one) for one in q])


class _Evaluation:
    """Trees on given series of the coordinates and velocities; equal trees are evaluated once."""

    def __init__(self, points: Points, names: Sequence[str], q: Numbers, v: Numbers, size: int) -> None:
        self.points, self.size, self.order = points, size, q.shape[1]
        self.known: dict[ex.Expression, Jet] = {}
        for i, name in enumerate(names):
            for series, leaf, direction in (
                (q[i], ex.Symbol(name), 1 + i),
                (v[i], ex.Velocity(name), 1 + len(names) + i),
            ):
                data = np.zeros((size, self.order, points.count), np.int64)
                data[0] = series
                if size > 1:
                    data[direction, 0] = 1
                self.known[leaf] = Jet(data)

    def constant(self, values: Numbers | int) -> Jet:
        data = np.zeros((self.size, self.order, self.points.count), np.int64)
        data[0, 0] = values
        return Jet(data)

    def jet(self, tree: ex.Expression) -> Jet:
        found = self.known.get(tree)
        if found is None:
            deadline.check(self.size * self.order)
            found = self.known[tree] = self._jet(tree)
        return found

    def _jet(self, tree: ex.Expression) -> Jet:
        match tree:
            case ex.Number(value):
                return self.constant(residue(value))
            case ex.Symbol():
                jet = self.constant(self.points.value(("variable", tree)))
                if tree == ex.TIME and self.order > 1:
                    jet.data[0, 1] = 1
                return jet
            case ex.Sum(terms):
                total = self.jet(terms[0])
                for term in terms[1:]:
                    total = total + self.jet(term)
                return total
            case ex.Product(factors):
                total = self.jet(factors[0])
                for factor in factors[1:]:
                    total = (
                        total.scaled(residue(factor.value))
                        if isinstance(factor, ex.Number)
                        else total * self.jet(factor)
                    )
                return total
            case ex.Power(base, ex.Number(exponent)):
                return self._rational_power(self.jet(base), exponent)
            case ex.Apply(function, argument):
                return self._apply(function, argument)
            case ex.Arbitrary():
                return self._arbitrary(tree)
        raise ValueError(f"{type(tree).__name__} has no value here")

    def _rational_power(self, base: Jet, exponent: Fraction) -> Jet:
        if exponent.denominator == 1 and 0 < exponent <= 4:
            result = base
            for _ in range(int(exponent) - 1):
                result = result * base
            return result
        value = base.data[0, 0]
        if exponent < 0 or exponent.denominator > 1:
            self.points.good &= value != 0
        if exponent.denominator == 1:
            start = powers(value, int(exponent) % (PRIME - 1))
        else:
            square = powers(value, _HALF) == 1
            e = exponent.numerator * pow(exponent.denominator, -1, _HALF) % _HALF
            start = powers(np.where(square, value, PRIME - value), e)
            if exponent.denominator % 2 == 0:
                self.points.good &= square
            elif exponent.numerator % 2:
                start = np.where(square, start, PRIME - start)
        e = residue(exponent)
        series = _power(base.data[0], e, start)
        slope = _power(base.data[0], (e - 1) % PRIME, start * inverses(value) % PRIME) * e % PRIME
        return base.with_series(series, slope)

    def _apply(self, function: str, argument: ex.Expression) -> Jet:
        inner = self.jet(argument)
        series = inner.data[0]
        if function == "exp":
            start = np.ones(self.points.count, np.int64)
            for key, value in terms_of(argument).items():
                scale = self.points.units.exponentials[key]
                exponent = int(value * scale)
                unit = self.points.value(("exp", key))
                start = start * powers(unit if exponent > 0 else inverses(unit), abs(exponent)) % PRIME
            grown = self._exponential(series, start)
            return inner.with_series(grown, grown)
        if function in ("sin", "cos"):
            sine, cosine = self._sine_and_cosine(argument, series)
            if function == "sin":
                return inner.with_series(sine, cosine)
            return inner.with_series(cosine, (PRIME - sine) % PRIME)
        if function in ("log", "atan"):
            start = self.points.value((function, argument))
            if function == "log":
                slope = _power(series, PRIME - 1, inverses(series[0]))
                self.points.good &= series[0] != 0
            else:
                below = _times(series, series)
                below[0] = (below[0] + 1) % PRIME
                slope = _power(below, PRIME - 1, inverses(below[0]))
            return inner.with_series(_primitive(_times(slope, _derivative(series)), start), slope)
        raise ValueError(f"{function} has no value here")

    def _exponential(self, series: Numbers, start: Numbers) -> Numbers:
        """y' = a' y."""
        result = np.zeros_like(series)
        result[0] = start
        for k in range(1, series.shape[0]):
            total = sum(j * series[j] % PRIME * result[k - j] % PRIME for j in range(1, k + 1))
            result[k] = total % PRIME * pow(k, -1, PRIME) % PRIME
        return result

    def _sine_and_cosine(self, argument: ex.Expression, series: Numbers) -> tuple[Numbers, Numbers]:
        sine, cosine = np.zeros(self.points.count, np.int64), np.ones(self.points.count, np.int64)
        for key, value in terms_of(argument).items():
            times = int(value * self.points.units.angles[key])
            s, c = self.points.circle(key)
            s = s if times > 0 else (PRIME - s) % PRIME
            for _ in range(abs(times)):
                sine, cosine = (sine * c + cosine * s % PRIME) % PRIME, (cosine * c - sine * s % PRIME) % PRIME
        sines, cosines = np.zeros_like(series), np.zeros_like(series)
        sines[0], cosines[0] = sine, cosine
        for k in range(1, series.shape[0]):
            rates = [(j * series[j] % PRIME, k - j) for j in range(1, k + 1)]
            least = pow(k, -1, PRIME)
            sines[k] = sum(rate * cosines[m] % PRIME for rate, m in rates) % PRIME * least % PRIME
            cosines[k] = -(sum(rate * sines[m] % PRIME for rate, m in rates) % PRIME) * least % PRIME
        return sines, cosines

    def _arbitrary(self, tree: ex.Arbitrary) -> Jet:
        """Taylor's series about the place of the arguments, their partial derivatives as generators."""
        inner = [self.jet(argument) for argument in tree.arguments]
        moved = [jet.data[0].copy() for jet in inner]
        for series in moved:
            series[0] = 0
        value = self._taylor(tree, tree.orders, moved)
        result = self.constant(0)
        result.data[0] = value
        for place, jet in enumerate(inner):
            if self.size > 1:
                orders = tuple(order + (k == place) for k, order in enumerate(tree.orders))
                slope = self._taylor(tree, orders, moved)
                result.data[1:] = (result.data[1:] + jet.with_series(value, slope).data[1:]) % PRIME
        return result

    def _taylor(self, tree: ex.Arbitrary, orders: tuple[int, ...], moved: Sequence[Numbers]) -> Numbers:
        total = np.zeros_like(moved[0])
        for more in product(range(self.order), repeat=len(moved)):
            if sum(more) < self.order:
                name = ex.Arbitrary(tree.name, tree.arguments, tuple(a + b for a, b in zip(orders, more, strict=True)))
                term = np.zeros_like(total)
                term[0] = self.points.value(("function", name))
                for series, times in zip(moved, more, strict=True):
                    for _ in range(times):
                        term = _times(term, series)
                    term = term * pow(factorial(times), -1, PRIME) % PRIME
                total = (total + term) % PRIME
        return total


def generator_tree(generator: Generator, units: Units) -> ex.Expression:
    """What stands for the generator in a formula; of an angle its cosine."""
    kind, what = generator
    if kind == "exp":
        return ex.Apply("exp", Fraction(1, units.exponentials[what]) * monomial_tree(what))  # type: ignore[index,arg-type]
    if kind == "angle":
        return ex.Apply("cos", Fraction(1, units.angles[what]) * monomial_tree(what))  # type: ignore[index,arg-type]
    if kind in ("log", "atan"):
        return ex.Apply(kind, what)  # type: ignore[arg-type]
    return what  # type: ignore[return-value]


# Degrees in one variable, unknown coefficients, and draws for one batch of points.
_DEGREE, _UNKNOWNS, _DRAWS = 8, 1_200, 24
# Points for the degree in one variable.
_BLOCK = 24
# Numerators and denominators that one prime of 31 bits can tell apart.
_LARGEST = 32_767
Power = tuple[int, int]
# The vector at points with these generators fixed, (entries, points), and the good points themselves.
Given = Mapping[Generator, int | Numbers]
Values = Callable[[Given, int], tuple[Numbers, Points]]


class NoFit(ArithmeticError):
    """No polynomial vector of moderate degree was found."""


@dataclass(slots=True)
class Interpolation:
    """The vector as polynomials in the variables; `polynomials[e]` maps exponents of all variables to coefficients."""

    values: Values
    variables: Sequence[Generator]
    units: Units

    def terms(self) -> list[Terms]:
        """The entries as sums of products of letters, with integer coefficients without a common factor."""
        anchor_values, anchor = self.drawn({}, 1)
        fixed = {variable: int(anchor.value(variable)[0]) for variable in self.variables}
        entries = [e for e in range(anchor_values.shape[0]) if anchor_values[e, 0]]
        entries = sorted({*entries, *self._met(anchor_values.shape[0])})
        support: list[list[tuple[Power, ...]]] = [[()] for _ in entries]
        done: list[Generator] = []
        vector: list[int] = [1] * len(entries)
        if len(entries) > 1:
            degrees = self._degrees(entries, fixed)
            for variable in self.variables:
                if degrees[variable] == 0:
                    continue
                done.append(variable)
                added = _basis(variable, degrees[variable])
                candidates = [[(*old, power) for power in added for old in olds] for olds in support]
                support, vector = self._fitted(candidates, entries, done, fixed)
            if not done:
                support, vector = self._fitted(support, entries, done, fixed)
        found = self._trees(support, vector, done)
        whole: list[Terms] = [{} for _ in range(anchor_values.shape[0])]
        for e, terms in zip(entries, found, strict=True):
            whole[e] = terms
        return whole

    def drawn(self, fixed: Given, count: int) -> tuple[Numbers, Points]:
        """At least so many points, all good."""
        for k in range(_DRAWS):
            deadline.check(count)
            values, points = self.values(fixed, (count + 8) << min(k, 3))
            if values.shape[1] >= count:
                return values, points
        raise NoFit("too few points")

    def _met(self, size: int) -> set[int]:
        values, _ = self.drawn({}, 3)
        return {e for e in range(size) if values[e].any()}

    def _degrees(self, entries: Sequence[int], fixed: Mapping[Generator, int]) -> dict[Generator, int]:
        """The least degree in each variable, the others fixed: all of them from one batch of points."""
        block, generator = _BLOCK, np.random.default_rng(block_seed(fixed))
        total = block * len(self.variables)
        given: dict[Generator, int | Numbers] = {}
        for place, variable in enumerate(self.variables):
            values = np.full(total, fixed[variable], np.int64)
            values[place * block : (place + 1) * block] = generator.integers(2, PRIME - 2, block)
            given[variable] = values
        values, points = self.values(given, total)
        own = np.arange(total)[points.good] // block
        found = {}
        for place, variable in enumerate(self.variables):
            mine = np.flatnonzero(own == place)
            for degree in range(_DEGREE + 1):
                basis = [[(power,) for power in _basis(variable, degree)] for _ in entries]
                if _needed(basis) <= len(mine):
                    fits = _fits(basis, entries, values, _powers(basis, [variable], points), mine)
                else:
                    fits = self._kernel(basis, entries, [variable], _without(fixed, [variable]))
                if fits:
                    found[variable] = degree
                    break
            else:
                raise NoFit("the degree in one variable is high")
        return found

    def _fitted(
        self,
        candidates: list[list[tuple[Power, ...]]],
        entries: Sequence[int],
        done: Sequence[Generator],
        fixed: Mapping[Generator, int],
    ) -> tuple[list[list[tuple[Power, ...]]], list[int]]:
        """The support and the coefficients of the only vector in the span of the candidates."""
        kernel = self._kernel(candidates, entries, done, _without(fixed, done))
        if len(kernel) != 1:
            raise NoFit("the vector is not the only one in its support")
        (vector,), place = kernel, 0
        kept, coefficients = list[list[tuple[Power, ...]]](), list[int]()
        for olds in candidates:
            values = vector[place : place + len(olds)]
            place += len(olds)
            kept.append([old for old, value in zip(olds, values, strict=True) if value])
            coefficients += [value for value in values if value]
        return kept, coefficients

    def _kernel(
        self,
        candidates: Sequence[Sequence[tuple[Power, ...]]],
        entries: Sequence[int],
        done: Sequence[Generator],
        others: Given,
    ) -> list[list[int]]:
        """A basis of the coefficients of all fits."""
        unknowns = sum(map(len, candidates))
        if unknowns > _UNKNOWNS:
            raise NoFit("too many unknown coefficients")
        count = _needed(candidates)
        values, points = self.drawn(others, count)
        return _fits(candidates, entries, values, _powers(candidates, done, points), np.arange(count))

    def _trees(
        self, support: Sequence[Sequence[tuple[Power, ...]]], vector: Sequence[int], done: Sequence[Generator]
    ) -> list[Terms]:
        unit = pow(vector[0], -1, PRIME)
        numbers = [modular.reconstruct(value * unit % PRIME, PRIME, _LARGEST) for value in vector]
        if any(number is None for number in numbers):
            raise NoFit("the coefficients are no small rational numbers")
        found, place = list[Terms](), 0
        letters = [letters_of(variable, self.units) for variable in done]
        for olds in support:
            total: Terms = {}
            for old in olds:
                key: Monomial = frozenset()
                for power, pair in zip(old, letters, strict=True):
                    for letter, e in zip(pair, power, strict=True):
                        key = times(key, letter, e) if e else key
                number = numbers[place]
                assert number is not None
                total = add_terms(total, {key: number})
                place += 1
            found.append(total)
        return found


def _without(fixed: Mapping[Generator, int], done: Sequence[Generator]) -> dict[Generator, int]:
    return {key: value for key, value in fixed.items() if key not in done}


def block_seed(fixed: Mapping[Generator, int]) -> int:
    """A seed that follows from the anchor."""
    return sum(fixed.values()) % PRIME


def _needed(candidates: Sequence[Sequence[tuple[Power, ...]]]) -> int:
    """Points that determine all coefficients: each entry has one equation with the reference at each."""
    least = min(map(len, candidates))
    together = -(-sum(map(len, candidates)) // max(1, len(candidates) - 1))
    return max(together, least + max(map(len, candidates))) + 4


def _powers(
    candidates: Sequence[Sequence[tuple[Power, ...]]], done: Sequence[Generator], points: Points
) -> dict[tuple[Power, ...], Numbers]:
    """The value of each product of powers at the good points."""
    found = {}
    for old in dict.fromkeys(old for olds in candidates for old in olds):
        result = np.ones(int(points.good.sum()), np.int64)
        for power, variable in zip(old, done, strict=True):
            for base, e in zip(letters_at(variable, points), power, strict=True):
                for _ in range(e):
                    result = result * base[points.good] % PRIME
        found[old] = result
    return found


def _fits(
    candidates: Sequence[Sequence[tuple[Power, ...]]],
    entries: Sequence[int],
    values: Numbers,
    powers: Mapping[tuple[Power, ...], Numbers],
    chosen: Numbers,
) -> list[list[int]]:
    """A basis of the coefficients with v_e P_r = v_r P_e at the chosen points."""
    reference = min(range(len(entries)), key=lambda k: (len(candidates[k]), k))
    starts = np.cumsum([0, *map(len, candidates)])
    blocks = []
    for k, e in enumerate(entries):
        if k == reference:
            continue
        block = np.zeros((len(chosen), int(starts[-1])), np.int64)
        for j, old in enumerate(candidates[reference]):
            block[:, starts[reference] + j] = values[e][chosen] * powers[old][chosen] % PRIME
        for j, old in enumerate(candidates[k]):
            block[:, starts[k] + j] = (PRIME - values[entries[reference]][chosen]) * powers[old][chosen] % PRIME
        blocks.append(block)
    return kernel_of(np.concatenate(blocks))


def kernel_of(rows: Numbers) -> list[list[int]]:
    """A basis of the vectors that a matrix modulo the prime takes to 0."""
    height, width = rows.shape
    matrix = nmod_mat(height, width, rows.ravel().tolist(), PRIME)
    echelon, rank = matrix.rref()
    if rank == width:
        return []
    table = [[int(echelon[i, j]) for j in range(width)] for i in range(rank)]
    pivots = [next(j for j, value in enumerate(row) if value) for row in table]
    found = []
    for free in (j for j in range(width) if j not in set(pivots)):
        vector = [0] * width
        vector[free] = 1
        for pivot, row in zip(pivots, table, strict=True):
            vector[pivot] = -row[free] % PRIME
        found.append(vector)
    return found


def _basis(variable: Generator, degree: int) -> list[Power]:
    """Exponents of (cos, sin) of an angle, of (x, nothing) for other variables."""
    if variable[0] == "angle":
        return [(total - b, b) for total in range(degree + 1) for b in (0, 1) if b <= total]
    return [(k, 0) for k in range(degree + 1)]


def letters_at(variable: Generator, points: Points) -> tuple[Numbers, Numbers]:
    """The values of the two letters of a variable, the second one of an angle alone."""
    if variable[0] == "angle":
        sine, cosine = points.circle(variable[1])  # type: ignore[arg-type]
        return cosine, sine
    return points.value(variable), np.ones(points.count, np.int64)


def letters_of(variable: Generator, units: Units) -> tuple[Monomial, Monomial]:
    """The two letters of a variable as monomials."""
    tree = generator_tree(variable, units)
    second = ex.Apply("sin", tree.argument) if variable[0] == "angle" and isinstance(tree, ex.Apply) else ex.ONE
    return _monomial(tree), _monomial(second)


def _monomial(tree: ex.Expression) -> Monomial:
    terms = terms_of(tree)
    ((key, value),) = terms.items()
    if value != 1:
        raise NoFit("a letter has a factor")
    return key


def whole_numbers(vector: Sequence[Terms]) -> list[Terms]:
    """The vector times the number that makes its coefficients integers without a common factor."""
    from math import gcd, lcm

    numbers = [value for terms in vector for value in terms.values()]
    if not numbers:
        return list(vector)
    factor = Fraction(lcm(*(n.denominator for n in numbers)), gcd(*(n.numerator for n in numbers)))
    return [{key: value * factor for key, value in terms.items()} for terms in vector]
