"""Members with a Lagrangian of a given kind, L = e^s (v G v/2 + A(q) v - V(q)), s = g0 t + g q:
their conditions, and the nearest of them.

With phi_i = G_ij f^j and D = d/dt + v d/dq at fixed v, e^s G is a multiplier of q'' = f exactly if

    d phi_i/dv_j + d phi_j/dv_i + 2 (g0 + g v) G_ij = 0,
    d phi_i/dq_j - d phi_j/dq_i + g_j phi_i - g_i phi_j
        - (D + g0 + g v)(d phi_i/dv_j - d phi_j/dv_i)/2 = 0

(Helmholtz 1887; Santilli 1978, 2.1.16). For f linear in coefficients c they are K c + k = 0, where
K and k are linear in G and in (1, g0, g). So the nearest member for given G and s is a projection,
and the rest is a search in a few numbers (variable projection, Golub and Pereyra 1973), from
several starts. Terms are compared as products of powers of atoms, which is sufficient; where atoms
are related, it may ask for more than is needed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from inverse_service import deadline
from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.fitting.fitted import FittedSystem, Floats

Entry = tuple[int, int]
# Ratio of the eigenvalues of G that is searched: beyond it a member is a limit, and none is
# nearest.
MOST_RATIO = 1e4
WEIGHTS = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4)  # of the conditions, one after the other
STEPS = 14  # for each of them
MOST_OPTIMA = 4  # that are compared
TINY = 1e-9  # of the conditions, in standard errors, where they are taken as satisfied


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of Lagrangian: whether s may hold t and q, and whether G is the unit matrix."""

    name: str
    timed: bool = False
    placed: bool = False
    unit: bool = False


KINDS = (
    Kind("equal_masses", unit=True),
    Kind("natural"),
    Kind("damped", timed=True),
    Kind("exponential", placed=True),
    Kind("damped_exponential", timed=True, placed=True),
)


@dataclass(frozen=True, slots=True)
class Conditions:
    """table[g, r, i, j, e, k]: g is the factor 1, g0, g_1 ..., r a product of atoms in the first or
    second condition, (i, j) its indices, e an entry of G, k = 0 the constant part, then the
    coefficients.
    """

    table: Floats
    exact: tuple[tuple[tuple[int, ...], Fraction], ...]
    entries: tuple[Entry, ...]

    @property
    def size(self) -> int:
        return int(self.table.shape[2])


@dataclass(frozen=True, slots=True)
class Optimum:
    """Where a search ended: G and (g0, g) in numbers, the coefficients, the distance.

    `starts` were made; `attained` is False where G tends to a singular matrix.
    """

    matrix: Floats
    rates: Floats
    coefficients: Floats
    distance: float
    starts: int
    attained: bool


def fitted_conditions(fitted: FittedSystem) -> Conditions:
    """The two conditions for a system that is linear in its coefficients."""
    assert fitted.columns is not None
    names = fitted.system.coordinates
    n = len(names)
    entries = tuple(itertools.combinations_with_replacement(range(n), 2))
    rows = dict[tuple[int, tm.Monomial], int]()
    cells = dict[tuple[int, ...], Fraction]()

    def put(
        kind: int, factor: int, i: int, j: int, e: int, k: int, tree: ex.Expression, scale: Fraction
    ) -> None:
        for monomial, value in collecting.expand(tree):
            row = rows.setdefault((kind, monomial), len(rows))
            key = (factor, row, i, j, e, k)
            cells[key] = cells.get(key, Fraction(0)) + scale * value

    coordinates, velocities = [*map(ex.Symbol, names)], [*map(ex.Velocity, names)]
    one, half = Fraction(1), Fraction(1, 2)
    for e, (a, b) in enumerate(entries):
        for i, j in {(a, b), (b, a)}:
            put(0, 1, i, j, e, 0, ex.ONE, 2 * one)
            for place, velocity in enumerate(velocities):
                put(0, 2 + place, i, j, e, 0, velocity, 2 * one)
        for k, column in enumerate((fitted.fixed, *fitted.columns)):
            for i, source in {(a, b), (b, a)}:
                f = column[source]
                if f == ex.ZERO:
                    continue
                for j in range(n):
                    slope = calculus.differentiate(f, velocities[j])
                    put(0, 0, i, j, e, k, slope, one)
                    put(0, 0, j, i, e, k, slope, one)
                    if i == j:
                        continue
                    curl = calculus.differentiate(f, coordinates[j])
                    drift = calculus.time_derivative(
                        slope, zip(coordinates, velocities, strict=True)
                    )
                    for (p, q), sign in (((i, j), one), ((j, i), -one)):
                        put(1, 0, p, q, e, k, curl, sign)
                        put(1, 0, p, q, e, k, drift, -sign * half)
                        put(1, 2 + j, p, q, e, k, f, sign)
                        put(1, 1, p, q, e, k, slope, -sign * half)
                        for place, velocity in enumerate(velocities):
                            put(1, 2 + place, p, q, e, k, velocity * slope, -sign * half)
    exact = tuple((key, value) for key, value in cells.items() if value)
    table = np.zeros((2 + n, len(rows), n, n, len(entries), 1 + len(fitted.columns)))
    for key, value in exact:
        table[key] = float(value)
    return Conditions(table, exact, entries)


def patterns(conditions: Conditions, fitted: FittedSystem) -> Iterator[tuple[int, ...]]:
    """The entries of G that may differ from 0: all, those inside the parts of a partition of the
    coordinates, the diagonal.

    On a smaller set fewer conditions remain, which no search in the larger one finds.
    """
    n = conditions.size
    seen = set[tuple[int, ...]]()
    for parts in _partitions(n, fitted):
        block = {q: place for place, part in enumerate(parts) for q in part}
        found = tuple(k for k, (i, j) in enumerate(conditions.entries) if block[i] == block[j])
        if found not in seen:
            seen.add(found)
            yield found


def _partitions(n: int, fitted: FittedSystem) -> Iterator[list[list[int]]]:
    yield [list(range(n))]
    yield [[q] for q in range(n)]
    if n == 3:
        yield from ([[0, 1], [2]], [[0, 2], [1]], [[1, 2], [0]])
    if n > 3:
        names = fitted.system.coordinates
        links = [
            {i, j}
            for i, f in enumerate(fitted.system.accelerations)
            for j, name in enumerate(names)
            if ex.holds(f, ex.Symbol(name), ex.Velocity(name))
        ]
        groups = [{q} for q in range(n)]
        for link in links:
            touched = [group for group in groups if group & link]
            groups = [group for group in groups if not group & link] + [set().union(*touched)]
        yield [sorted(group) for group in groups]


@dataclass(slots=True)
class _Search:
    """The conditions of a kind with the entries of a pattern, as functions of theta = (G, rates)
    and y, c = c0 + L y.
    """

    table: Floats  # (factors, rows, n, n, entries, 1 + m)
    entries: Sequence[Entry]
    factors: Sequence[int]
    fitted: Floats
    root: Floats
    scale: float
    size: int

    def matrix(self, theta: Floats) -> Floats:
        """G, (..., n, n) of theta (..., p)."""
        found = np.zeros((*theta.shape[:-1], self.size, self.size))
        for k, (i, j) in enumerate(self.entries):
            found[..., i, j] = found[..., j, i] = theta[..., k]
        return found

    def rates(self, theta: Floats) -> Floats:
        """(g0, g_1, ...), with zeros for those that the kind does not have."""
        found = np.zeros(1 + self.size)
        found[[factor - 1 for factor in self.factors]] = theta[len(self.entries) :]
        return found

    def is_regular(self, theta: Floats) -> bool:
        sizes = np.abs(np.linalg.eigvalsh(self.matrix(theta)))
        return bool(sizes.min() * MOST_RATIO > sizes.max() > 0)

    def parts(self, theta: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """The conditions h (R,), dh/dy (R, m), and dh/dtheta (R, p) by central differences.

        h has |G|^(-1/2) on both sides, so that it does not see the size of G, in standard errors.
        """
        at_c = self.table @ np.concatenate([[1.0], self.fitted + self.root @ y])
        step, count = 1e-6, len(theta)
        steps = step * np.eye(count)
        around = np.concatenate([theta[None], theta + steps, theta - steps])
        own, factors = self.split(around)
        by_entry = np.tensordot(factors, at_c, 1)
        values = np.matmul(by_entry.reshape(len(around), -1, own.shape[1]), own[..., None])
        h = self.whitened(around, values.reshape(len(around), -1, self.size, self.size, 1))[..., 0]
        slopes = (h[1 : 1 + count] - h[1 + count :]) / (2 * step)
        at_theta = np.tensordot(factors[0], self.table, 1)
        in_c = np.tensordot(at_theta, own[0], ((3,), (0,)))[..., 1:] @ self.root
        return h[0], self.whitened(theta[None], in_c[None])[0], slopes.T

    def split(self, theta: Floats) -> tuple[Floats, Floats]:
        """The entries of G, and (1, rates), of theta (..., p)."""
        count = len(self.entries)
        ones = np.ones((*theta.shape[:-1], 1))
        return theta[..., :count], np.concatenate([ones, theta[..., count:]], axis=-1)

    def whitened(self, theta: Floats, values: Floats) -> Floats:
        """(N, R, ...) of theta (N, p) and (N, rows, n, n, ...): a row for each pair i <= j."""
        sizes, vectors = np.linalg.eigh(self.matrix(theta))
        roots = np.maximum(np.abs(sizes), 1e-12) ** -0.5
        white = np.matmul(vectors * roots[:, None, :], vectors.transpose(0, 2, 1))
        pairs = [(i, j) for i in range(self.size) for j in range(i, self.size)]
        # (white v white)_ij = sum_ab white_ia v_ab white_bj
        outer = np.stack([white[:, i, :, None] * white[:, None, :, j] for i, j in pairs], axis=1)
        rows, count = values.shape[1], math.prod(values.shape[4:])  # there may be no rows
        flat = values.reshape(len(values), rows, self.size**2, count)
        turned = np.matmul(outer.reshape(len(white), 1, len(pairs), -1), flat)
        return np.asarray(turned.reshape(len(white), rows * len(pairs), count) / self.scale)


def _solved(
    search: _Search, theta: Floats, y: Floats, weight: float
) -> tuple[Floats, Floats, float]:
    """Levenberg and Marquardt's method for |y|^2 + |weight h(theta, y)|^2."""
    damping = 1e-3
    h, in_y, in_theta = search.parts(theta, y)
    cost = float(y @ y + weight**2 * h @ h)
    size, count = len(y), len(theta)
    for _ in range(STEPS):
        jacobian = np.hstack([in_y, in_theta]) * weight
        normal = jacobian.T @ jacobian
        normal[range(size), range(size)] += 1.0
        right = -(weight * jacobian.T @ h)
        right[:size] -= y
        better = False
        while damping < 1e10:
            lifted = normal.copy()
            lifted[range(size, size + count), range(size, size + count)] += damping * (
                1.0 + np.diag(normal)[size:]
            )
            step = np.linalg.lstsq(lifted, right, rcond=None)[0]
            tried, moved = np.asarray(theta + step[size:]), np.asarray(y + step[:size])
            if search.is_regular(tried):
                parts = search.parts(tried, moved)
                new = float(moved @ moved + weight**2 * parts[0] @ parts[0])
                if new < cost:
                    better = True
                    break
            damping *= 8
        if not better:
            break
        gain = cost - new
        length = float(np.linalg.norm(tried[: len(search.entries)]))
        tried = tried.copy()
        tried[: len(search.entries)] /= length  # h does not see the size of G
        theta, y, cost = tried, moved, new
        h, in_y, in_theta = search.parts(theta, y)
        damping = max(damping / 10, 1e-12)
        if gain <= 1e-9 * cost:
            break
    return theta, y, cost


def _polished(search: _Search, theta: Floats, y: Floats) -> tuple[Floats, Floats] | None:
    """The nearest point with h = 0 by Newton's method; None where there is none nearby."""
    size = len(y)
    for _ in range(40):
        h, in_y, in_theta = search.parts(theta, y)
        # The shortest (y + dy, dtheta / far) with h + in_y dy + in_theta dtheta = 0.
        far = 1e2
        jacobian = np.hstack([in_y, in_theta * far])
        found = np.linalg.lstsq(jacobian, in_y @ y - h, rcond=1e-11)[0]
        new, tried = np.asarray(found[:size]), np.asarray(theta + far * found[size:])
        if not search.is_regular(tried) or not np.all(np.isfinite(new)):
            return None
        tried[: len(search.entries)] /= float(np.linalg.norm(tried[: len(search.entries)]))
        change = float(np.linalg.norm(new - y) + np.linalg.norm(tried - theta))
        theta, y = tried, new
        if change < 1e-12 * (1 + np.linalg.norm(y)):
            break
    h = search.parts(theta, y)[0]
    good = float(np.abs(h).max(initial=0.0)) <= TINY * max(1.0, float(np.linalg.norm(y)))
    return (theta, y) if good else None


def optima_of(
    conditions: Conditions,
    fitted: FittedSystem,
    kind: Kind,
    pattern: Sequence[int],
    starts: int,
    seed: int,
    end: float,
) -> list[Optimum]:
    """The points where starts ended, members of a kind with these entries of G, the nearest first."""
    n = conditions.size
    entries = [conditions.entries[k] for k in pattern]
    factors = [*([1] if kind.timed else []), *(range(2, 2 + n) if kind.placed else [])]
    table = conditions.table[[0, *factors]][..., list(pattern), :]
    table = table[:, np.abs(table).max(axis=(0, 2, 3, 4, 5)) > 0]
    root = fitted.metric.root
    scale = float(np.median(np.abs(np.diag(root))))
    search = _Search(table, entries, factors, fitted.fitted, root, scale, n)
    found = list[tuple[float, Floats, Floats, bool]]()
    made = 0
    for theta in _starts(search, starts, seed):
        if deadline.now() > end and made:
            break
        made += 1
        y = np.zeros(len(root))
        for weight in WEIGHTS:
            theta, y, _ = _solved(search, theta, y, weight)
        sizes = np.abs(np.linalg.eigvalsh(search.matrix(theta)))
        attained = bool(sizes.min() * MOST_RATIO > 2 * sizes.max())
        polished = _polished(search, theta, y)
        if polished is not None:
            found.append((float(np.linalg.norm(polished[1])), *polished, attained))
            if found[-1][0] < TINY:
                break  # the fitted system itself
    found.sort(key=lambda one: one[0])
    optima = list[Optimum]()
    for distance, theta, y, attained in found:
        if not optima or distance > optima[-1].distance * (1 + 1e-6) + 1e-9:
            coefficients = fitted.fitted + root @ y
            matrix, rates = search.matrix(theta), search.rates(theta)
            optima.append(Optimum(matrix, rates, coefficients, distance, made, attained))
    return optima[:MOST_OPTIMA]


def _starts(search: _Search, count: int, seed: int) -> Iterator[Floats]:
    """What nearly satisfies the conditions at the fitted coefficients, the unit matrix, and random
    ones of each signature.
    """
    random = np.random.default_rng(seed)
    none = np.zeros(len(search.factors))
    diagonal = [float(i == j) for i, j in search.entries]
    rough = np.array(diagonal)
    c = np.concatenate([[1.0], search.fitted])
    rates = [none]
    if search.factors:
        # The rates at which the conditions are nearly satisfied by the unit matrix.
        at_c = np.einsum("grijek,e,k->grij", search.table, rough, c).reshape(len(none) + 1, -1)
        rates.insert(0, np.linalg.lstsq(at_c[1:].T, -at_c[0], rcond=None)[0])
    made = 0
    for rate in rates:
        at_c = np.einsum("g,grijek,k->rije", np.concatenate([[1.0], rate]), search.table, c)
        _, _, vectors = np.linalg.svd(at_c.reshape(-1, len(search.entries)))
        for vector in (vectors[-1], rough, *vectors[-2:-1]):
            theta = np.concatenate([vector / np.linalg.norm(vector), rate])
            if search.is_regular(theta):
                made += 1
                yield theta
    while made < count:
        signs = random.choice([-1.0, 1.0], search.size) if made % 2 else np.ones(search.size)
        turn = np.linalg.qr(random.normal(size=(search.size, search.size)))[0]
        whole = turn @ np.diag(signs * np.exp(random.normal(0, 1, search.size))) @ turn.T
        own = np.array([whole[i, j] for i, j in search.entries])
        rate = rates[0] + random.normal(0, 0.2, len(none)) * (1 + np.abs(rates[0]))
        theta = np.concatenate([own / np.linalg.norm(own), rate])
        made += 1
        if search.is_regular(theta):
            yield theta


def linear_conditions(
    conditions: Conditions, matrix: Sequence[Sequence[Fraction]], rates: Sequence[Fraction]
) -> list[list[Fraction]]:
    """The rows (k, K) of K c + k = 0 for given G and (g0, g), exact; rows of zeros and repeated
    ones are left out.
    """
    factors = [Fraction(1), *rates]
    table = dict[tuple[int, int, int], dict[int, Fraction]]()
    for (g, row, i, j, e, k), value in conditions.exact:
        a, b = conditions.entries[e]
        product = factors[g] * matrix[a][b] * value
        if product and i <= j:
            line = table.setdefault((row, i, j), {})
            line[k] = line.get(k, Fraction(0)) + product
    width = conditions.table.shape[-1]
    found = dict[tuple[Fraction, ...], None]()
    for line in table.values():
        whole = [line.get(k, Fraction(0)) for k in range(width)]
        lead = next((value for value in reversed(whole) if value), None)
        if lead is not None:
            found[tuple(value / lead for value in whole)] = None
    return [list(row) for row in found]


def degrees_of(
    conditions: Conditions,
    fitted: FittedSystem,
    kind: Kind,
    pattern: Sequence[int],
    optimum: Optimum,
) -> int:
    """How many independent equations the members of the kind satisfy near this one: the rank of the
    conditions in all unknowns less that in G and the rates.
    """
    n = conditions.size
    entries = [conditions.entries[k] for k in pattern]
    factors = [*([1] if kind.timed else []), *(range(2, 2 + n) if kind.placed else [])]
    table = conditions.table[[0, *factors]][..., list(pattern), :]
    root = fitted.metric.root
    search = _Search(
        table, entries, factors, optimum.coefficients, root, float(np.median(np.diag(root))), n
    )
    own = np.array([optimum.matrix[i, j] for i, j in entries])
    theta = np.concatenate([own, [optimum.rates[factor - 1] for factor in factors]])
    _, in_y, in_theta = search.parts(theta, np.zeros(len(root)))
    moving = in_theta if not kind.unit else in_theta[:, len(entries) :]
    whole = np.hstack([in_y, moving])
    sizes = np.linalg.norm(whole, axis=0)
    # Columns of rounding errors count as zero.
    scaled = np.where(sizes > 1e-8 * sizes.max(initial=0.0), whole / np.maximum(sizes, 1e-300), 0)
    return _rank(scaled) - (_rank(scaled[:, len(root) :]) if moving.shape[1] else 0)


def _rank(matrix: NDArray[np.float64]) -> int:
    return int(np.linalg.matrix_rank(matrix, tol=1e-7)) if matrix.size else 0
