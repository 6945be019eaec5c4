"""Find the Lagrangian of a unique matrix allowed by the algebraic conditions: compute G(t, q) and
phi with g = phi G.

At points modulo a prime, the conditions g T = (g T)^T for T = Phi, nabla Phi, … at several
velocities over one (t, q) determine one vector of entries G_11 : … : G_nn, which is interpolated as
a whole. For any nonzero entry e of G, (H2) reads

    S = Gamma(log phi) = ((G N + N^T G)_e - Gamma G_e)/G_e = Q_k v_k + T.

In most systems S = 0 and phi = 1. If one entry of g is constant, phi is 1/G_e; otherwise (1 : Q :
T) is interpolated and integrated. The remaining terms of L are A_i v_i - V with

    d_i V = -phi W_i,  d_i A_j - d_j A_i = phi F_ij,  W = G f at v = 0,  F = G f_v + d_t G + T G at
    v = 0,

where (1 : W : F) is interpolated as well, because determinants of mass matrices cancel in it.

The conditions can allow more than one matrix: for carts with pendulums, the multipliers are M_t g +
p p^T with a conserved momentum p. G is then the matrix of least degree, as in textbooks. With the
constants fixed, (H2) and (H3) are linear in the coefficients of

    g_ij = sum of c_ijm m(t, q),  m a product of at most `degree` generators: cos, sin of angles,
    coordinates.

If the solution at the least degree with a solution is unique, its terms are kept, and their
coefficients are interpolated as one vector in the constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from itertools import combinations, product
from typing import Literal

import numpy as np

from inverse_service import deadline, errors
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, real_branch, tower
from inverse_service.field.flow import (
    PRIME,
    Flow,
    Generator,
    Numbers,
    Points,
    Units,
    inverses,
    matrix_product,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import antiderivatives, families, interpolation, material as mt

# Limits on the degree and on the unknown coefficients.
_DEGREE, _UNKNOWNS = 2, 700
# A coefficient: the entry of the matrix and the product of generators.
Column = tuple[int, tm.Monomial]


def propose(material: mt.Material, seed: int) -> list[ex.Expression]:
    """The Lagrangian of phi G with one matrix G(t, q), which the caller must verify; empty if none
    is found.
    """
    system, table = material.analysis.system, material.analysis.real_point
    search = OneMatrix.of(system, seed)
    if search is None:
        return []
    entries = search.matrix()
    for integral_signs in (False, True):
        found = search.lagrangian(
            material, antiderivatives.Integrator(system, table, integral_signs), entries
        )
        if found is not None:
            return [found]
    return []


@dataclass(frozen=True, slots=True)
class OneMatrix:
    """A system at points modulo the prime; `pairs` are the index pairs of the entries of symmetric
    matrices.

    Its conditions are those of some `tensors` at some `velocities`.
    """

    system: SecondOrderSystem
    forces: tuple[ex.Expression, ...]
    units: Units
    random: np.random.Generator
    pairs: list[tuple[int, int]]
    velocities: int = 1  # over one (t, q)
    tensors: int = 1  # how many of Phi, nabla Phi, … give conditions
    kernel: int = 0  # dimension of the matrices that the conditions allow

    @classmethod
    def of(cls, system: SecondOrderSystem, seed: int) -> OneMatrix | None:
        """The search, or None if the conditions allow no matrix free of the velocities.

        Velocities over one (t, q) are added while the dimension falls, at least two and at most n
        (or 3).
        """
        one = cls._with_one_velocity(system, seed)
        velocities, kernel = 1, one.dimension(1, one.tensors)
        for velocities in range(2, max(3, len(one.forces)) + 1):
            before, kernel = kernel, one.dimension(velocities, one.tensors)
            if kernel <= 1 or (kernel == before and velocities > 2):
                break
        if not kernel or not one.dimension(velocities, one.tensors + 1):
            return None
        return replace(one, velocities=velocities, kernel=kernel)

    @classmethod
    def at_one_velocity(cls, system: SecondOrderSystem, seed: int) -> OneMatrix | None:
        """The search, or None unless one velocity allows exactly one matrix, and several over one
        (t, q) allow none.
        """
        one = cls._with_one_velocity(system, seed)
        tensors = one.tensors + 1
        several, kernel = (one.dimension(velocities, tensors) for velocities in (2, 1))
        return replace(one, tensors=tensors, kernel=1) if kernel == 1 and not several else None

    @classmethod
    def _with_one_velocity(cls, system: SecondOrderSystem, seed: int) -> OneMatrix:
        forces = tuple(map(tower.to_kernels, system.accelerations))
        n = len(forces)
        pairs = [(i, j) for i in range(n) for j in range(i, n)]
        return cls(
            system,
            forces,
            Units.of(forces),
            np.random.default_rng(seed),
            pairs,
            tensors=1 if n == 2 else 2,
        )

    def points(self, fixed: interpolation.Given, count: int) -> Points:
        return Points(self.system.coordinates, self.units, count, self.random, fixed)

    def dimension(self, velocities: int, tensors: int) -> int:
        """The dimension of the matrices that the conditions of so many tensors at so many
        velocities allow at a random place.
        """
        for k in range(12):  # points with many roots are few
            kernels, points = self._kernels({}, 4 << min(k, 6), velocities, tensors)
            if points.good.any():
                return len(kernels[0])
        raise interpolation.NoFit("no point")

    def _kernels(
        self, fixed: interpolation.Given, count: int, velocities: int, depth: int
    ) -> tuple[list[list[list[int]]], Points]:
        """The kernel of the conditions of `depth` tensors at each good point."""
        n, base = len(self.forces), self.points(fixed, count)
        batches, good = list[list[Numbers]](), base.good
        for k in range(velocities):
            points = base if k == 0 else base.again([None] * n)
            _, tensors = Flow(points, self.forces, depth + 1).tensors(depth)
            batches.append(tensors)
            good = good & points.good
            base.values |= {
                key: value for key, value in points.values.items() if key not in base.values
            }
        base.good = good
        rows = np.concatenate(
            [self.conditions(tensor) for batch in batches for tensor in batch], axis=1
        )
        return [interpolation.null_basis(rows[k]) for k in np.flatnonzero(good)], base

    def unit_products(self, tensor: Numbers) -> Numbers:
        """E T for the symmetric matrix E with ones in each entry of `pairs`, (points, entries, n,
        n).
        """
        units = np.zeros((len(self.pairs), *tensor.shape[1:]), np.int64)
        for unit, (i, j) in zip(units, self.pairs, strict=True):
            unit[i, j] = unit[j, i] = 1
        product: Numbers = units @ tensor[:, None]
        return product

    def conditions(self, tensor: Numbers) -> Numbers:
        """The rows of (g T)_ij = (g T)_ji in the entries of g, (points, rows, entries)."""
        product = self.unit_products(tensor)
        i, j = np.triu_indices(len(self.forces), 1)
        return (product[:, :, i, j] - product[:, :, j, i]).transpose(0, 2, 1) % PRIME

    def matrix_values(self, fixed: interpolation.Given, count: int) -> interpolation.Drawn:
        """G_11 : … : G_nn at good points."""
        kernels, points = self._kernels(fixed, count, self.velocities, self.tensors)
        kept = [k for k, kernel in enumerate(kernels) if len(kernel) == 1]
        where = np.flatnonzero(points.good)[kept]
        points.good = np.isin(np.arange(points.count), where)
        entries = np.array([kernels[k][0] for k in kept], np.int64)
        return interpolation.Drawn(entries.reshape(len(kept), len(self.pairs)).T, points)

    def variables(self, of: Literal["place", "motion"] = "place") -> list[Generator]:
        """The generators of functions of t and q (the place), and for a motion those of the
        velocities too. Angles come first, then exponentials, velocities, coordinates, and finally
        parameters.
        """
        points = self.points({}, 1)
        Flow(points, self.forces, 2)
        own = set(map(ex.Symbol, self.system.coordinates)) | {ex.TIME}

        def rank(generator: Generator) -> int:
            if tm.has_velocity(generator[1]):
                return 2
            return {"angle": 0, "exp": 1}.get(generator[0], 3 if generator[1] in own else 4)

        used = [
            one for one in points.values if one[0] != "variable" or one[1] not in self.units.roots
        ]
        return sorted(
            (one for one in used if of == "motion" or not tm.has_velocity(one[1])), key=rank
        )

    def matrix(self) -> list[tm.Terms]:
        """The unique matrix, or the matrix of least degree if there are several."""
        if self.kernel > 1:
            return lowest_matrix(self)
        return interpolation.Interpolation(self.matrix_values, self.variables(), self.units).terms()

    def lagrangian(
        self,
        material: mt.Material,
        integrator: antiderivatives.Integrator,
        entries: Sequence[tm.Terms],
    ) -> ex.Expression | None:
        """The Lagrangian whose Hessian is this matrix times a factor that is computed."""
        variables = self.variables()
        matrix = self.oriented(entries, integrator)
        phi = self.scale(matrix, variables, integrator)
        if phi is None:
            return None
        velocities = list(map(ex.Velocity, self.system.coordinates))
        kinetic = tm.Terms()
        for (i, j), terms in zip(self.pairs, matrix, strict=True):
            square, weight = (
                tm.monomial(velocities[i], velocities[j]),
                Fraction(1, 2 if i == j else 1),
            )
            kinetic = tm.add_terms(
                kinetic, tm.multiply_by(tm.shortest_in_angles(terms), square, factor=weight)
            )
        try:
            wanted = self._wanted(matrix, variables, phi)
        except interpolation.NoFit:  # where f has roots
            found = families.with_potential(material, tm.multiply_terms(phi, kinetic), integrator)
            return tm.tree_of(found) if found else None
        rest = integrator.linear_terms([tm.multiply_terms(phi, w) for w in wanted])
        return (
            None
            if rest is None
            else ex.add(tm.tree_of(phi) * tm.tree_of(kinetic), tm.tree_of(rest))
        )

    def oriented(
        self, matrix: Sequence[tm.Terms], integrator: antiderivatives.Integrator
    ) -> list[tm.Terms]:
        """The matrix with its first nonzero diagonal entry positive at rest or, if that fails, at
        the real point.
        """
        entry = next(
            (m for (i, j), m in zip(self.pairs, matrix, strict=True) if i == j and m), matrix[0]
        )
        tree = tm.tree_of(entry)
        zeros: dict[ex.Expression, ex.Expression] = {
            ex.Velocity(name): ex.ZERO for name in self.system.coordinates
        }
        for form in (ex.substitute(tree, zeros), tree):
            with suppress(calculus.NoRealValue, errors.IrreducibleAtoms, ZeroDivisionError):
                if integrator.table is not None and (
                    sign := real_branch.real_sign(form, integrator.table)
                ):
                    return [tm.scaled(terms, sign) for terms in matrix]
        return list(matrix)

    def _at(self, points: Points, matrix: Sequence[tm.Terms], order: int) -> tuple[Flow, Numbers]:
        """The flow, and G with its derivatives along it, (order, points, n, n)."""
        flow, n = Flow(points, self.forces, order), len(self.forces)
        values = np.zeros((order, points.count, n, n), np.int64)
        for (i, j), terms in zip(self.pairs, matrix, strict=True):
            if terms:
                values[:, :, i, j] = values[:, :, j, i] = flow.tree(tm.tree_of(terms)).data[0]
        return flow, values

    def _rates(
        self, points: Points, matrix: Sequence[tm.Terms]
    ) -> tuple[Numbers, Numbers, Numbers]:
        """(G, Gamma G, G N + N^T G) at the points, (points, n, n)."""
        flow, values = self._at(points, matrix, 2)
        by_velocity, _ = flow.slopes()
        half = matrix_product(values[0], -by_velocity[0] * pow(2, -1, PRIME) % PRIME)
        return values[0], values[1], (half + half.transpose(0, 2, 1)) % PRIME

    def scale(
        self,
        matrix: Sequence[tm.Terms],
        variables: Sequence[Generator],
        integrator: antiderivatives.Integrator,
    ) -> tm.Terms | None:
        """The factor phi(t, q) with (H2) for phi G; None if there is none, or none is found.

        Three cases: (H2) holds for G itself, so phi = 1. An entry of phi G is constant, because (G
        N + N^T G)_e = 0 for it, so phi = 1/G_e. Else S = Gamma(log phi) = T + Q_k v_k is formed
        from one entry; it must be affine in the velocities, and d log phi = T dt + Q_k dq_k is
        interpolated and integrated.
        """
        points = self.points({}, 12)
        _, along, turned = self._rates(points, matrix)
        good = points.good
        defect = (turned - along) % PRIME
        if not defect[good].any():
            return dict(antiderivatives.ONE_TERM)
        for (i, j), terms in zip(self.pairs, matrix, strict=True):
            if terms and not turned[good][:, i, j].any():
                return tm.terms_of(ex.power(tm.tree_of(tm.shortest_in_angles(terms)), -1))
        e = next(pair for pair, terms in zip(self.pairs, matrix, strict=True) if terms)
        n = len(self.forces)

        def rate(points: Points) -> Numbers:
            values, along, turned = self._rates(points, matrix)
            return (turned - along)[:, e[0], e[1]] % PRIME * inverses(values[:, e[0], e[1]]) % PRIME

        def form(fixed: interpolation.Given, count: int) -> interpolation.Drawn:
            # Not at rest, where logarithms and roots of velocities have no value.
            start = [self.random.integers(2, PRIME - 2, count) for _ in range(n)]
            first = self.points(fixed, count).again(start)
            level, slopes, good = rate(first), list[Numbers](), first.good
            for k in range(n):
                moved = first.again([(v + (i == k)) % PRIME for i, v in enumerate(start)])
                slopes.append((rate(moved) - level) % PRIME)
                good = good & moved.good
            first.good = good
            level = level - sum(v * slope % PRIME for v, slope in zip(start, slopes, strict=True))
            values = np.array([np.ones(count, np.int64), level % PRIME, *slopes])
            return interpolation.Drawn(values[:, good], first)

        start, step = (
            [self.random.integers(2, PRIME - 2, points.count) for _ in range(n)] for _ in range(2)
        )
        along_a_line = [
            points.again([(v + k * w) % PRIME for v, w in zip(start, step, strict=True)])
            for k in range(3)
        ]
        first, second, third = map(rate, along_a_line)
        bent = (first - 2 * second + third) % PRIME  # 0 if S is affine in the velocities
        if bent[np.all([one.good for one in along_a_line], axis=0)].any():
            return None
        below, *above = interpolation.Interpolation(form, variables, self.units).terms()
        names = [ex.TIME, *map(ex.Symbol, self.system.coordinates)]
        logarithm = integrator.function_of(
            names, mt.divided(above, below, names, exact_field.Budget.long())
        )
        return None if logarithm is None else integrator.exponential(logarithm)

    def _wanted(
        self, matrix: Sequence[tm.Terms], variables: Sequence[Generator], phi: tm.Terms
    ) -> list[tm.Terms]:
        """-(W_i + F_ij v_j), the Euler-Lagrange expressions of A_i v_i - V divided by phi."""
        n = len(self.forces)
        places = list(combinations(range(n), 2))
        drag = tm.collected(
            calculus.differentiate(tm.tree_of(phi), ex.TIME) / tm.tree_of(phi)
        )  # d_t log phi

        def form(fixed: interpolation.Given, count: int) -> interpolation.Drawn:
            points = self.points(fixed, count).again([np.zeros(count, np.int64)] * n)
            flow, values = self._at(points, matrix, 2)
            by_velocity, _ = flow.slopes()
            forces = np.array([force.data[0, 0] for force in flow.forces]).T
            pushes = sum(values[0][:, :, m] * forces[:, m, None] % PRIME for m in range(n)) % PRIME
            fields = (matrix_product(values[0], by_velocity[0]) + values[1]) % PRIME
            if drag != ex.ZERO:
                factor = flow.tree(drag).data[0, 0]
                fields = (fields + values[0] * factor[:, None, None]) % PRIME
            if ((fields + fields.transpose(0, 2, 1)) % PRIME)[points.good].any():
                raise interpolation.NoFit("f is not that of a multiplier without velocities")
            found = [np.ones(count, np.int64), *pushes.T, *(fields[:, i, j] for i, j in places)]
            return interpolation.Drawn(np.array(found)[:, points.good], points)

        below, *above = interpolation.Interpolation(form, variables, self.units).terms()
        names = [ex.TIME, *map(ex.Symbol, self.system.coordinates)]
        above = list(
            map(tm.shortest_in_angles, mt.divided(above, below, names, exact_field.Budget.long()))
        )
        wanted = [tm.scaled(terms, -1) for terms in above[:n]]
        for (i, j), terms in zip(places, above[n:], strict=True):
            deadline.check()
            v, w = (tm.monomial(ex.Velocity(self.system.coordinates[k])) for k in (i, j))
            wanted[i] = tm.add_terms(wanted[i], tm.multiply_by(terms, w), -1)
            wanted[j] = tm.add_terms(wanted[j], tm.multiply_by(terms, v))
        return wanted


def lowest_matrix(search: OneMatrix) -> list[tm.Terms]:
    """The entries of the matrix; NoFit if no degree has exactly one regular solution."""
    variables = search.variables()
    names = {ex.TIME, *map(ex.Symbol, search.system.coordinates)}
    own = [v for v in variables if ex.holds(v[1], *names)]
    constants = [v for v in variables if v not in own]
    anchor = search.points({}, 1)
    fixed = {constant: int(anchor.value(constant)[0]) for constant in constants}
    for degree in range(_DEGREE + 1):
        monomials = list(_monomials(own, search, degree))
        columns = [(entry, key) for entry in range(len(search.pairs)) for key in monomials]
        if len(columns) > _UNKNOWNS:
            break
        found = _coefficients(search, columns, fixed, 1)
        if found and len(found[0]) == 1:
            (vector,) = found[0]
            support = [column for column, value in zip(columns, vector, strict=True) if value]
            return _interpolated(search, support, constants)
        if found and found[0]:
            break
    raise interpolation.NoFit("no least degree has one matrix")


def _monomials(own: Sequence[Generator], search: OneMatrix, degree: int) -> list[tm.Monomial]:
    """Products of generators of at most `degree` different variables; an angle occurs only in its
    sine and cosine.
    """
    angles = {what for kind, what in own if kind == "angle"}
    used = [v for v in own if not (v[0] == "variable" and v[1] in angles)]
    found: dict[tm.Monomial, None] = {tm.EMPTY: None}
    for size in range(1, degree + 1):
        for chosen in combinations(used, size):
            letters = [
                [letter for letter in interpolation.basis_monomials(v, search.units) if letter]
                for v in chosen
            ]
            for some in product(*letters):
                found[reduce(tm.times, some)] = None
    return list(found)


def _interpolated(
    search: OneMatrix, support: Sequence[Column], constants: Sequence[Generator]
) -> list[tm.Terms]:
    """The coefficients of the columns of the support as one vector in the constants,
    interpolated.
    """

    def values(given: interpolation.Given, count: int) -> interpolation.Drawn:
        points = search.points(given, count)
        own = {constant: points.value(constant) for constant in constants}
        vectors = _coefficients(search, support, own, count)
        good = [k for k, kernel in enumerate(vectors) if len(kernel) == 1]
        points.good = np.isin(np.arange(count), good)
        found = np.array([vectors[k][0] for k in good], np.int64)
        return interpolation.Drawn(found.reshape(len(good), len(support)).T, points)

    coefficients = interpolation.Interpolation(values, constants, search.units).terms()
    matrix: list[tm.Terms] = [{} for _ in search.pairs]
    for (entry, key), terms in zip(support, coefficients, strict=True):
        matrix[entry] = tm.add_terms(matrix[entry], tm.multiply_by(terms, key))
    return matrix


def _coefficients(
    search: OneMatrix, columns: Sequence[Column], given: interpolation.Given, count: int
) -> list[list[list[int]]]:
    """The coefficients of sums of these columns that satisfy (H2) and (H3), for each of `count`
    values of the given generators; all others are random, at enough points for every value.
    """
    n = len(search.forces)
    entries = len(search.pairs)
    each = entries + n * (n - 1) // 2
    places = -(-len(columns) // each) + 3
    wide = {
        key: np.repeat(np.broadcast_to(np.asarray(v, np.int64), count), 2 * places)
        for key, v in given.items()
    }
    points = search.points(wide, 2 * places * count)
    flow = Flow(points, search.forces, 2)
    connection, (tensor,) = flow.tensors(1)
    series = {key: flow.tree(tm.monomial_tree(key)).data[0] for key in {key for _, key in columns}}
    deadline.check(len(columns) * points.count)
    bent, (i, j) = search.unit_products(connection), np.triu_indices(n)
    damping, skew = (bent[:, :, i, j] + bent[:, :, j, i]) % PRIME, search.conditions(tensor)
    rows = np.zeros((points.count, each, len(columns)), np.int64)
    for c, (entry, key) in enumerate(columns):
        value, rate = series[key][0, :, None], series[key][1]
        rows[:, :entries, c] = -value * damping[:, entry]
        rows[:, entry, c] += rate
        rows[:, entries:, c] = value * skew[:, :, entry]
    rows %= PRIME
    found = []
    for k in range(count):
        block = slice(2 * places * k, 2 * places * (k + 1))
        good = np.flatnonzero(points.good[block])[:places] + 2 * places * k
        whole = rows[good].reshape(-1, len(columns))
        found.append(interpolation.null_basis(whole) if len(good) >= places else [])
    return found
