"""Formulas as numbers along the motion q'' = f, at many points modulo a prime: truncated series
with gradients.

At a random point the motion is a power series in s (order by order, q'' = f); f is evaluated once
more on these series with its gradients in the 2 n directions of q and v. That gives J = f_v and K =
f_q as matrix series along the flow, where Gamma is d/ds:

    N = -J/2,  Phi = J' - 2 K - J^2/2 (twice the Jacobi endomorphism),  nabla T = T' + N T - T N.

There are no symbolic derivatives, and f is never expanded. All points of a batch are in one array:
a `Jet` has the shape (1 + directions, order, points), and its first row is the value.

A formula consists of generators with independent random values: t, coordinates, velocities, and
parameters; for the angles of circular functions, a rational point (2 u, 1 - u^2)/(1 + u^2) of the
circle and the value of the coordinate; for exponentials, logarithms, and arctangents, a residue;
for arbitrary functions, each partial derivative. Roots are true roots: the prime is a safe prime,
so that a square has exactly one root that is a square, and points without roots are dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from itertools import product
from math import factorial, lcm
from operator import add, mul

import numpy as np
import numpy.typing as npt

from inverse_service import deadline
from inverse_service.expressions import calculus, collecting, functions, jets, tree as ex
from inverse_service.field import modular, tower

Numbers = npt.NDArray[np.int64]
# 2 q + 1 with q prime, modulo which 2, 3, 5, 7, 11, 13, and 17 are squares.
PRIME = 2_147_454_839
_HALF = (PRIME - 1) // 2
# ("variable" | "root", itself), ("angle" | "exp", its unit), ("function", a derivative of it),
# (name, argument) else.
Generator = tuple[str, ex.Expression]
_INVERSES = ("log", *functions.INVERSE)
_ARGUMENT = ex.Symbol("argument of a function")


def inverses(values: Numbers) -> Numbers:
    """1/x modulo the prime, 0 for 0."""
    return powers(values, PRIME - 2)


def powers(values: Numbers, exponent: int) -> Numbers:
    result, base = np.ones_like(values), values % PRIME
    while exponent:
        if exponent & 1:
            result = result * base % PRIME
        if exponent := exponent >> 1:
            base = base * base % PRIME
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
                if (
                    a.shape[0] > 1
                ):  # both terms of a gradient in one pass, as most of the time goes here
                    result[1:, k] += (
                        a[1:, j] * b[0, k - j] + a[0, j] * b[1:, k - j] % PRIME
                    ) % PRIME
        return Jet(result % PRIME)

    def with_series(self, value: Numbers, slope: Numbers) -> Jet:
        """h(self) for a function with these series of h and of h' along the flow."""
        slopes = _times(self.data[1:].swapaxes(0, 1), slope[:, None]).swapaxes(0, 1)
        return Jet(np.concatenate([value[None], slopes]))


def _times(
    a: Numbers, b: Numbers, product: Callable[[Numbers, Numbers], Numbers] = np.multiply
) -> Numbers:
    """The product of two series, (order, …) each, of the shape of the first, by the product of
    coefficients.
    """
    result = np.zeros_like(a)
    for k in range(a.shape[0]):
        for j in range(k + 1):
            result[k] += product(a[j], b[k - j]) % PRIME
    return result % PRIME


def _power(a: Numbers, exponent: int, start: Numbers, least: Numbers) -> Numbers:
    """a^e, e a residue, with constant term `start`, least = 1/a_0: k a_0 y_k = sum_j (e j - (k -
    j)) a_j y_(k-j).
    """
    result = np.zeros_like(a)
    result[0] = start
    for k in range(1, a.shape[0]):
        total = sum(
            ((exponent * j - (k - j)) % PRIME) * (a[j] * result[k - j] % PRIME) % PRIME
            for j in range(1, k + 1)
        )
        result[k] = total % PRIME * least % PRIME * pow(k, -1, PRIME) % PRIME
    return result


def _primitive(rate: Numbers, start: Numbers) -> Numbers:
    """The series with this derivative in s, whose last coefficient is not used."""
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
    """The common denominator of each unit of the generators of angles and exponentials.

    `roots` are the variables whose square roots occur and serve as generators. `radicands` are
    polynomials whose square roots occur, by each of their variables; no two share a variable.
    """

    angles: dict[ex.Expression, int] = field(default_factory=dict)
    exponentials: dict[ex.Expression, int] = field(default_factory=dict)
    roots: set[ex.Expression] = field(default_factory=set)
    radicands: dict[ex.Expression, ex.Expression] = field(default_factory=dict)

    @classmethod
    def of(cls, trees: Iterable[ex.Expression]) -> Units:
        """The units of all circular functions, exponentials, and roots in these kernels."""
        found = cls()
        for node in ex.distinct_nodes(jets.with_laws(trees)):
            match node:
                case ex.Power(ex.Symbol() | ex.Velocity() as base, ex.Number(e)) if (
                    e.denominator == 2
                ):
                    found.roots.add(base)
                case ex.Power(ex.Sum() as base, ex.Number(e)) if e.denominator == 2:
                    letters = {
                        p: base
                        for key, _ in collecting.expand(base)
                        for p, _ in collecting.powers_in_order(key)
                    }
                    plain = letters.keys() == {*modular.variables_in(base)}
                    if plain and not letters.keys() & found.radicands.keys():
                        found.radicands |= letters
            if isinstance(node, ex.Apply) and node.function in ("sin", "cos", "exp"):
                table = found.exponentials if node.function == "exp" else found.angles
                for unit, value in _multiples(node.argument):
                    table[unit] = lcm(table.get(unit, 1), value.denominator)
        return found


@dataclass(slots=True)
class Points:
    """A batch of points: the values of all generators, drawn on demand, and which points are still
    good.

    `fixed` are generators with given values, one for all points or one per point; the others are
    random. If `moving` is given, generators that contain none of its variables have one value for
    all points.
    """

    coordinates: tuple[str, ...]
    units: Units
    count: int
    random: np.random.Generator
    fixed: Mapping[Generator, int | Numbers] = field(default_factory=dict)
    values: dict[Generator, Numbers] = field(default_factory=dict)
    moving: tuple[ex.Expression, ...] = ()
    good: npt.NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        self.good = np.ones(self.count, bool)

    def value(self, generator: Generator) -> Numbers:
        if generator not in self.values:
            kind, what = generator
            if kind == "variable" and what in self.units.roots:
                root = self.value(("root", what))
                self.good &= powers(root, _HALF) == 1
                self.values[generator] = root * root % PRIME
            elif generator in self.fixed:
                self.values[generator] = np.full(
                    self.count, self.fixed[generator] % PRIME, np.int64
                )
            else:
                drawn = self.count if not self.moving or ex.holds(what, *self.moving) else 1
                self.values[generator] = np.broadcast_to(
                    self.random.integers(2, PRIME - 2, drawn), self.count
                )
        return self.values[generator]

    def circle(self, unit: ex.Expression) -> tuple[Numbers, Numbers]:
        """(sin, cos) of the unit over its denominator."""
        u = self.value(("angle", unit))
        square = u * u % PRIME
        below = inverses(1 + square)
        return 2 * u % PRIME * below % PRIME, (1 - square) % PRIME * below % PRIME

    def again(self, velocities: Sequence[Numbers | None]) -> Points:
        """The same points with other velocities; None stands for random ones."""
        names = [("variable", ex.Velocity(name)) for name in self.coordinates]
        kept = {
            key: value for key, value in self.values.items() if ("variable", key[1]) not in names
        }
        other = Points(self.coordinates, self.units, self.count, self.random, self.fixed, kept)
        other.values |= {key: v for key, v in zip(names, velocities, strict=True) if v is not None}
        other.good = self.good.copy()
        return other


class Flow:
    """f along the motion at a batch of points, to `order` coefficients in s."""

    def __init__(
        self, points: Points, forces: Sequence[ex.Expression], order: int, gradients: bool = True
    ) -> None:
        self.points, self.order, n = points, order, len(forces)
        self.size = 1 + (2 * n if gradients else 0)
        names = points.coordinates
        kernels = [tower.to_kernels(f) for f in forces]
        q = np.zeros((n, order + 2, points.count), np.int64)
        q[:, 0] = [points.value(("variable", ex.Symbol(name))) for name in names]
        q[:, 1] = [points.value(("variable", ex.Velocity(name))) for name in names]
        for k in range(order if n else 0):
            plain = Evaluation(points, names, q[:, : k + 1], _derivatives(q)[:, : k + 1], 1)
            for i, f in enumerate(kernels):
                q[i, k + 2] = plain.jet(f).data[0, k] * pow((k + 1) * (k + 2), -1, PRIME) % PRIME
        self.q = q
        self.evaluation = Evaluation(
            points, names, q[:, :order], _derivatives(q)[:, :order], self.size
        )
        self.forces = [self.evaluation.jet(f) for f in kernels]

    def tree(self, tree: ex.Expression) -> Jet:
        """The series of a formula in the same generators."""
        return self.evaluation.jet(tower.to_kernels(tree))

    def slopes(self) -> tuple[Numbers, Numbers]:
        """(f_v, f_q), (order, points, n, n) each."""
        n = len(self.forces)
        whole = np.array(
            [force.data[1:] for force in self.forces]
        )  # force, direction, order, point
        arranged = whole.transpose(2, 3, 0, 1)
        return arranged[..., n:], arranged[..., :n]

    def tensors(self, count: int) -> tuple[Numbers, list[Numbers]]:
        """(N, [Phi, nabla Phi, …]) at the points, (points, n, n) each; `count` <= order - 1 of
        them.
        """
        by_velocity, by_position = self.slopes()
        half = pow(2, -1, PRIME)
        connection = -by_velocity * half % PRIME
        rate = _derivative(by_velocity)
        current = (
            rate - 2 * by_position - _times(by_velocity, by_velocity, matrix_product) * half
        ) % PRIME
        found = [current[0]]
        for _ in range(count - 1):
            turned = _times(connection, current, matrix_product) - _times(
                current, connection, matrix_product
            )
            current = (_derivative(current) + turned) % PRIME
            found.append(current[0])
        return connection[0], found


def matrix_product(a: Numbers, b: Numbers) -> Numbers:
    """(points, n, n) times (points, n, n)."""
    total = np.zeros_like(a)
    for m in range(a.shape[-1]):
        total += a[..., :, m, None] * b[..., None, m, :] % PRIME
    return total % PRIME


def _derivatives(q: Numbers) -> Numbers:
    return np.array([_derivative(one) for one in q])


class Evaluation:
    """Trees on given series of the coordinates and velocities; equal trees are evaluated once."""

    def __init__(
        self, points: Points, names: Sequence[str], q: Numbers, v: Numbers, size: int
    ) -> None:
        self.points, self.size, self.order = points, size, q.shape[1]
        self.given = names, q, v
        self.start: Evaluation | None = None  # the same, to order 0
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
            case ex.Symbol() | ex.Velocity():
                jet = self.constant(self.points.value(("variable", tree)))
                if tree == ex.TIME and self.order > 1:
                    jet.data[0, 1] = 1
                return jet
            case ex.Sum(terms):
                return reduce(add, map(self.jet, terms))
            case ex.Product((ex.Number(value), *factors)):
                return reduce(mul, map(self.jet, factors)).scaled(residue(value))
            case ex.Product(factors):
                return reduce(mul, map(self.jet, factors))
            case ex.Power(base, ex.Number(exponent)):
                return self._rational_power(self.jet(base), exponent)
            case ex.Apply(function, argument):
                return self._apply(function, argument)
            case ex.Arbitrary():
                return self._arbitrary(tree)
        raise ValueError(f"{type(tree).__name__} has no value here")

    def _rational_power(self, base: Jet, exponent: Fraction) -> Jet:
        if exponent.denominator == 1 and 0 < exponent <= 4:
            return reduce(mul, [base] * int(exponent))
        value = base.data[0, 0]
        if exponent < 0 or exponent.denominator > 1:
            self.points.good &= value != 0
        least = inverses(value)
        if exponent.denominator == 1:
            start = powers(value if exponent > 0 else least, abs(int(exponent)))
        else:
            square = powers(value, _HALF) == 1
            e = exponent.numerator * pow(exponent.denominator, -1, _HALF) % _HALF
            start = powers(np.where(square, value, PRIME - value), e)
            if exponent.denominator % 2 == 0:
                self.points.good &= square
            elif exponent.numerator % 2:
                start = np.where(square, start, PRIME - start)
        e = residue(exponent)
        series = _power(base.data[0], e, start, least)
        if self.size == 1:
            return Jet(series[None])
        slope = _power(base.data[0], (e - 1) % PRIME, start * least % PRIME, least) * e % PRIME
        return base.with_series(series, slope)

    def _apply(self, function: str, argument: ex.Expression) -> Jet:
        inner = self.jet(argument)
        series = inner.data[0]
        if function == "exp":
            start = np.ones(self.points.count, np.int64)
            for unit, value in _multiples(argument):
                exponent = int(value * self.points.units.exponentials[unit])
                one = self.points.value(("exp", unit))
                start = (
                    start * powers(one if exponent > 0 else inverses(one), abs(exponent)) % PRIME
                )
            grown = self._exponential(series, start)
            return inner.with_series(grown, grown)
        if function in ("sin", "cos"):
            sine, cosine = self._sine_and_cosine(argument, series)
            if function == "sin":
                return inner.with_series(sine, cosine)
            return inner.with_series(cosine, (PRIME - sine) % PRIME)
        if function in _INVERSES:
            rate = ex.substitute(
                calculus.differentiate(ex.Apply(function, _ARGUMENT), _ARGUMENT),
                {_ARGUMENT: argument},
            )
            slope = self.jet(tower.to_kernels(rate)).data[0]
            start = self.points.value((function, argument))
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
        for unit, value in _multiples(argument):
            times = int(value * self.points.units.angles[unit])
            s, c = self.points.circle(unit)
            s = s if times > 0 else (PRIME - s) % PRIME
            for _ in range(abs(times)):
                sine, cosine = (
                    (sine * c + cosine * s % PRIME) % PRIME,
                    (cosine * c - sine * s % PRIME) % PRIME,
                )
        sines, cosines = np.zeros_like(series), np.zeros_like(series)
        sines[0], cosines[0] = sine, cosine
        for k in range(1, series.shape[0]):
            rates = [(j * series[j] % PRIME, k - j) for j in range(1, k + 1)]
            least = pow(k, -1, PRIME)
            sines[k] = sum(rate * cosines[m] % PRIME for rate, m in rates) % PRIME * least % PRIME
            cosines[k] = (
                -(sum(rate * sines[m] % PRIME for rate, m in rates) % PRIME) * least % PRIME
            )
        return sines, cosines

    def _arbitrary(self, tree: ex.Arbitrary) -> Jet:
        """The Taylor series about the values of the arguments, with the partial derivatives as
        generators.
        """
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

    def _taylor(
        self, tree: ex.Arbitrary, orders: tuple[int, ...], moved: Sequence[Numbers]
    ) -> Numbers:
        total = np.zeros_like(moved[0])
        for more in product(range(self.order), repeat=len(moved)):
            if sum(more) < self.order:
                name = ex.Arbitrary(
                    tree.name,
                    tree.arguments,
                    tuple(a + b for a, b in zip(orders, more, strict=True)),
                )
                term = np.zeros_like(total)
                term[0] = self._partial(name)
                for series, times in zip(moved, more, strict=True):
                    for _ in range(times):
                        term = _times(term, series)
                    term = term * pow(factorial(times), -1, PRIME) % PRIME
                total = (total + term) % PRIME
        return total

    def _partial(self, function: ex.Arbitrary) -> Numbers:
        """The partial derivative at the points, a generator unless it is one of a special function
        with a law.
        """
        law = jets.by_independent(function)
        if law is None:
            return self.points.value(("function", function))
        if self.start is None:
            names, q, v = self.given
            self.start = Evaluation(self.points, names, q[:, :1], v[:, :1], 1)
        values: Numbers = self.start.jet(tower.to_kernels(law)).data[0, 0]
        return values


def values_of(tree: ex.Expression, points: Points) -> Numbers:
    """The values of a formula at the points."""
    nothing = np.zeros((0, 1, points.count), np.int64)
    values: Numbers = (
        Evaluation(points, (), nothing, nothing, 1).jet(tower.to_kernels(tree)).data[0, 0]
    )
    return values


def _multiples(argument: ex.Expression) -> list[tuple[ex.Expression, Fraction]]:
    """The argument as a sum of multiples of units."""
    return [(collecting.monomial_tree(unit), value) for unit, value in collecting.expand(argument)]


def generator_tree(generator: Generator, units: Units) -> ex.Expression:
    """The expression that represents the generator in a formula; for an angle, its cosine."""
    kind, what = generator
    if kind == "exp":
        return ex.Apply("exp", Fraction(1, units.exponentials[what]) * what)
    if kind == "angle":
        return ex.Apply("cos", Fraction(1, units.angles[what]) * what)
    if kind == "root":
        return ex.square_root(what)
    return ex.Apply(kind, what) if kind in _INVERSES else what
