"""The formulas of a motion as one graph: L, its derivatives, constraints and forces; numbers at
many points; programs.

    momenta    p = L_v                     pulls   L_q + Q
    masses     g = L_vv                    rates   L_vq v + L_vt, the change of p at constant v
    linear     [[g, -w^T], [w, 0]] (q'', lambda) = (L_q + Q - L_vq v - L_vt, -w' v - c')

A discrete step with weight alpha has u = (d, mu) as unknowns, at q + alpha d, d/h and t + alpha h:

    L_v - (1 - alpha) h (L_q + Q) + mu w(q_k) = p_k,   w v + c = 0;   p_(k+1) = p_k + h (L_q + Q) -
    mu w(q_k)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from inverse_service.expressions import tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.kernels.codegen.graph import Graph, NotInGraph
from inverse_service.simulation.scene_data import Problem

MOMENT, PLACE, SPEED, STEP, SETTING, PARAMETER, FORCE, BEGIN, SOLVED = (
    1 << k for k in range(9)
)  # kinds of leaves
MOST_NEWTON, SETTLED, NEARLY = 60, 1e-13, 1e-9  # for velocities of masses that depend on them
Nodes = list[int]
Entries = dict[tuple[int, int], int]


class WithRates(NamedTuple):
    """Accelerations and multipliers, their rates, and the sizes of the terms of both."""

    values: Array
    rates: Array
    sizes: Array
    sizes_of_rates: Array


class DiscreteStep(NamedTuple):
    """Left sides of a step, their derivatives, and the rates of the momenta."""

    left: Nodes
    slopes: Entries
    pushes: Nodes


@dataclass(frozen=True)
class SceneGraph:
    """The graph of a problem; each part is added at first use. InputError for a name or function
    without a value.
    """

    problem: Problem
    graph: Graph = field(default_factory=Graph)

    def __post_init__(self) -> None:
        g, what = self.graph, self.problem
        g.leaf(0, MOMENT, ex.TIME)
        for k, name in enumerate(what.coordinates):
            g.leaf(1 + k, PLACE, ex.Symbol(name))
            g.leaf(1 + self.size + k, SPEED, ex.Velocity(name))
        for k, name in enumerate(what.parameters):
            g.leaf(3 + 2 * self.size + k, PARAMETER, ex.Symbol(name))

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return len(self.problem.coordinates)

    @cached_property
    def step(self) -> int:
        """h."""
        return self.graph.leaf(1 + 2 * self.size, STEP)

    @cached_property
    def alpha(self) -> int:
        """The weight of the end of a step."""
        return self.graph.leaf(2 + 2 * self.size, SETTING)

    @cached_property
    def speeds(self) -> Nodes:
        """v."""
        return [self.graph.leaf(1 + self.size + k, SPEED) for k in range(self.size)]

    @cached_property
    def lagrangian(self) -> int:
        """L, or the L~ of a problem that has no other."""
        what = self.problem
        tree = what.free_lagrangian if what.lagrangian is None else what.lagrangian
        assert tree is not None
        return self.graph.node(tree)

    @cached_property
    def _slopes(self) -> dict[int, int]:
        return self.graph.gradient(self.lagrangian, PLACE | SPEED)

    @cached_property
    def momenta(self) -> Nodes:
        """L_v."""
        zero = self.graph.constant(0.0)
        return [self._slopes.get(1 + self.size + k, zero) for k in range(self.size)]

    @cached_property
    def forces(self) -> Nodes:
        """Q, empty without forces."""
        return [self.graph.node(force) for force in self.problem.forces]

    @cached_property
    def pulls(self) -> Nodes:
        """L_q + Q."""
        zero = self.graph.constant(0.0)
        found = [self._slopes.get(1 + k, zero) for k in range(self.size)]
        return (
            [self.graph.add(*pair) for pair in zip(found, self.forces, strict=True)]
            if self.forces
            else found
        )

    @cached_property
    def masses(self) -> Entries:
        """L_vv, entries that are not 0."""
        found = {}
        for row, momentum in enumerate(self.momenta):
            for place, node in self.graph.gradient(momentum, SPEED).items():
                if not self.graph.is_zero(node):
                    found[row, place - 1 - self.size] = node
        return found

    @cached_property
    def constraints(self) -> Nodes:
        """w v + c."""
        return [self.graph.node(tree) for tree in self.problem.constraints]

    @cached_property
    def forms(self) -> Entries:
        """w, entries that are not 0, by constraint and coordinate."""
        found = {}
        for row, constraint in enumerate(self.constraints):
            for place, node in self.graph.gradient(constraint, SPEED).items():
                if not self.graph.is_zero(node):
                    found[row, place - 1 - self.size] = node
        return found

    @cached_property
    def directions(self) -> Entries:
        """Those of the forces of the constraints: w, where the problem gives no others."""
        given = {(row, k): self.graph.node(tree)
                 for row, pull in enumerate(self.problem.pulls) for k, tree in enumerate(pull)}  # fmt: skip
        return (
            {place: node for place, node in given.items() if not self.graph.is_zero(node)}
            if given
            else self.forms
        )

    def _at_constant_speed(self, nodes: Sequence[int]) -> Nodes:
        """The changes of nodes along q' = v, t' = 1."""
        along = {1 + k: speed for k, speed in enumerate(self.speeds)}
        return self.graph.rate(nodes, along | {0: self.graph.constant(1.0)})

    @cached_property
    def linear(self) -> tuple[Nodes, Entries]:
        """The right-hand side and the entries of the equations for (q'', lambda)."""
        g, n = self.graph, self.size
        rates = self._at_constant_speed([*self.momenta, *self.constraints])
        right = [g.subtract(*pair) for pair in zip(self.pulls, rates[:n], strict=True)]
        right += [g.negative(rate) for rate in rates[n:]]
        entries = dict(self.masses)
        entries |= {(n + row, k): node for (row, k), node in self.forms.items()}
        entries |= {(k, n + row): g.negative(node) for (row, k), node in self.directions.items()}
        return right, entries

    @cached_property
    def eliminated(self) -> Nodes:
        """The accelerations as nodes: those given, or of `linear` by elimination with pivots on the
        diagonal while there are any, constant ones first, then those that fill in least.
        """
        if self.problem.accelerations is not None:
            return self.accelerations
        g, (right, entries) = self.graph, self.linear
        values, table, pivots = list(right), dict(entries), dict[int, int]()  # columns by rows
        while len(pivots) < len(values):
            done = {*pivots.values()}
            open_ = sorted((i, j) for i, j in table if i not in pivots and j not in done)
            if not open_:
                raise NotInGraph("The linear equations for the accelerations are singular.")

            def cost(at: tuple[int, int]) -> tuple[bool, int]:
                return g.number(table[at]) is None, sum(i == at[0] or j == at[1] for i, j in table)

            own, column = min([(i, j) for i, j in open_ if i == j] or open_, key=cost)
            pivots[own] = column
            done.add(column)
            inverse = g.reciprocal(table[own, column])
            row = {j: node for (i, j), node in table.items() if i == own and j not in done}
            for i in [i for i, j in table if j == column and i not in pivots]:
                factor = g.multiply(table[i, column], inverse)
                values[i] = g.subtract(values[i], g.multiply(factor, values[own]))
                for j, node in row.items():
                    more, old = g.negative(g.multiply(factor, node)), table.get((i, j))
                    table[i, j] = more if old is None else g.add(old, more)
                    if g.is_zero(table[i, j]):
                        del table[i, j]
        found = dict[int, int]()
        for own, column in reversed(pivots.items()):
            known = [
                g.multiply(table[own, j], node) for j, node in found.items() if (own, j) in table
            ]
            whole = g.subtract(values[own], g.total(known))
            found[column] = g.multiply(g.reciprocal(table[own, column]), whole)
        return [found[k] for k in range(self.size)]

    @cached_property
    def solved(self) -> Nodes:
        """Leaves for (q'', lambda)."""
        first = 3 + 3 * self.size + len(self.problem.parameters) + len(self.constraints)
        count = self.size + len(self.constraints)
        return [self.graph.leaf(first + k, SOLVED) for k in range(count)]

    @cached_property
    def later(self) -> Nodes:
        """The right-hand side of the equations for the rates of (q'', lambda), which have the
        matrix of `linear`: b' - A' (q'', lambda).
        """
        g, n, (right, entries) = self.graph, self.size, self.linear
        along = {0: g.constant(1.0)}
        along |= {1 + k: speed for k, speed in enumerate(self.speeds)}
        along |= {1 + n + k: self.solved[k] for k in range(n)}
        found = g.rate([*right, *entries.values()], along)
        left, rates = found[: len(right)], found[len(right) :]
        for (i, j), rate in zip(entries, rates, strict=True):
            left[i] = g.subtract(left[i], g.multiply(rate, self.solved[j]))
        return left

    def solution(self, inputs: Mapping[int, Any], count: int) -> Array:
        """(q'', lambda) at `count` points, (count, n + m), nan where it is not determined; given
        accelerations have no lambda.
        """
        if self.problem.accelerations is not None:
            return self.values(self.accelerations, inputs, count).T
        right, entries = self.linear
        found = self.values([*right, *entries.values()], inputs, count)
        matrix = filled_matrices(entries, found[len(right) :], len(right))
        return solved_rows(matrix, found[: len(right)].T)

    def matrix(self, inputs: Mapping[int, Any], count: int) -> Array:
        """That of the linear equations for (q'', lambda) at `count` points, (count, n + m, n + m)."""
        right, entries = self.linear
        values = self.values([*entries.values()], inputs, count)
        return filled_matrices(entries, values, len(right))

    def slopes(self, inputs: Mapping[int, Any]) -> Array:
        """The derivatives of the accelerations by q and v at one point, (n, 2 n), nan where there
        are none: those of A x = b have the same matrix, A x_s = b_s - A_s x.
        """
        n, g = self.size, self.graph
        is_given = self.problem.accelerations is not None
        right, entries = (self.accelerations, Entries()) if is_given else self.linear
        solution = self.solution(inputs, 1)[0]
        found = np.zeros((len(right), 2 * n))
        rows = [(i, 1.0, node) for i, node in enumerate(right)]
        rows += [(i, -float(solution[j]), node) for (i, j), node in entries.items()]
        for i, weight, node in rows:
            slopes = g.gradient(node, PLACE | SPEED)
            values = self.values([*slopes.values()], inputs, 1)[:, 0]
            for place, value in zip(slopes, values, strict=True):
                found[i, place - 1] += weight * value
        if is_given:
            return found
        matrix = self.matrix(inputs, 1)
        return np.stack([solved_rows(matrix, row[None])[0, :n] for row in found.T], axis=1)

    def with_rates(self, inputs: Mapping[int, Any], count: int) -> WithRates:
        """(q'', lambda) at `count` points, their rates along the motion, and the sizes of the terms
        that make up both, (count, n + m) each.
        """
        right, matrix = self.linear[0], self.matrix(inputs, count)
        with np.errstate(all="ignore"):
            lift = np.abs(inverses(matrix))
        found, sizes, own = list[Array](), list[Array](), dict(inputs)
        for nodes in (right, self.later):
            found.append(solved_rows(matrix, self.values(nodes, own, count).T))
            terms = [self.graph.summands(node) for node in nodes]
            values = np.abs(self.values([term for row in terms for term in row], own, count))
            ends = np.cumsum([len(row) for row in terms])[:-1]
            sums = np.array([part.sum(axis=0) for part in np.split(values, ends)])
            with np.errstate(all="ignore"):
                sizes.append(np.einsum("pij,jp->pi", lift, sums))
            own |= {self.graph.keys[leaf][1]: found[0][:, k] for k, leaf in enumerate(self.solved)}
        return WithRates(found[0], found[1], sizes[0], sizes[1])

    @cached_property
    def power(self) -> int:
        """v L_v."""
        pairs = zip(self.speeds, self.momenta, strict=True)
        return self.graph.total(self.graph.multiply(*pair) for pair in pairs)

    @cached_property
    def energy(self) -> int:
        """v L_v - L."""
        return self.graph.subtract(self.power, self.lagrangian)

    @cached_property
    def discrete(self) -> DiscreteStep:
        """Of a step: left-hand sides (n + m,), their derivatives by the unknowns, and the rates of
        the momenta.
        """
        g, n, m = self.graph, self.size, len(self.constraints)
        rest = g.multiply(g.subtract(g.constant(1.0), self.alpha), self.step)
        left = [
            g.subtract(p, g.multiply(rest, pull))
            for p, pull in zip(self.momenta, self.pulls, strict=True)
        ]
        first = 3 + 2 * n + len(self.problem.parameters)
        multipliers = [g.leaf(first + a, FORCE) for a in range(m)]
        pushes, over, entries = list(self.pulls), g.reciprocal(self.step), Entries()
        for i, node in enumerate((*left, *self.constraints)):
            for place, slope in g.gradient(node, PLACE | SPEED).items():
                moves = place > n
                part = g.multiply(over if moves else self.alpha, slope)
                j = place - 1 - n if moves else place - 1
                entries[i, j] = g.add(entries[i, j], part) if (i, j) in entries else part
        if m:
            held = g.moved(
                list(self.forms.values()), {1 + k: g.leaf(first + m + k, BEGIN) for k in range(n)}
            )
            for (a, k), form in zip(self.forms, held, strict=True):
                left[k] = g.add(left[k], g.multiply(multipliers[a], form))
                pushes[k] = g.subtract(
                    pushes[k], g.multiply(over, g.multiply(multipliers[a], form))
                )
                entries[k, n + a] = form
        return DiscreteStep([*left, *self.constraints], entries, pushes)

    def terms(self) -> Nodes:
        """The squares of the terms of each acceleration, as of a coordinate that moves alone,
        (n,).
        """
        g, n = self.graph, self.size
        sums = self.accelerations if self.problem.accelerations is not None else self.linear[0][:n]
        one = g.constant(1.0)
        masses = {} if self.problem.accelerations is not None else self.masses
        found = []
        for k, node in enumerate(sums):
            parts, mass = g.summands(node), masses.get((k, k), one)
            total = (
                g.total(g.multiply(part, part) for part in parts)
                if len(parts) > 1
                else g.constant(0.0)
            )
            found.append(g.multiply(total, g.power(mass, -2)))
        return found

    @cached_property
    def accelerations(self) -> Nodes:
        """Those given by formulas."""
        return [self.graph.node(tree) for tree in self.problem.accelerations or ()]

    def inputs(
        self,
        positions: Array,
        velocities: Array | None,
        values: Mapping[str, Any],
        times: Array | float = 0.0,
    ) -> dict[int, Any]:
        """What leaves are at m points: positions and velocities (m, n), parameters numbers or
        (m,).
        """
        found: dict[int, Any] = {0: times}
        found |= {1 + k: column for k, column in enumerate(positions.T)}
        speeds = np.zeros_like(positions) if velocities is None else velocities
        found |= {1 + self.size + k: column for k, column in enumerate(speeds.T)}
        found |= {
            3 + 2 * self.size + k: values[name] for k, name in enumerate(self.problem.parameters)
        }
        return found

    def values(self, nodes: Sequence[int], inputs: Mapping[int, Any], count: int) -> Array:
        """The values of nodes at `count` points, (nodes, count)."""
        found = self.graph.values(nodes, inputs)
        return np.array([np.broadcast_to(one, count) for one in found], dtype=float).reshape(
            len(nodes), count
        )

    def velocities(
        self, positions: Array, momenta: Array, values: Mapping[str, Any], times: Array
    ) -> Array | None:
        """v (m, n) with L_v + w^T s = p and w v + c = 0 at m points, nan where there is none; a
        matrix of numbers is solved once for all. None where it is singular at a point.
        """
        count, n = positions.shape
        v, nodes = np.zeros_like(positions), [*self.momenta, *self.constraints]
        target = np.pad(momenta, ((0, 0), (0, len(self.constraints)))).T
        masks = [self.graph.masks[node] for node in (*self.masses.values(), *self.forms.values())]
        moves, turns = (any(mask & kinds for mask in masks) for kinds in (~PARAMETER, SPEED))
        is_one = not moves and not any(np.ndim(value) for value in values.values())
        for _ in range(MOST_NEWTON if turns else 1):
            inputs = self.inputs(positions, v, values, times)
            left = (target - self.values(nodes, inputs, count)).T
            change: Any  # numpy's types of the two are different
            try:
                if is_one:
                    matrix = self.saddle(self.inputs(positions[:1], v[:1], values, 0.0), 1)[0]
                    change = np.linalg.solve(matrix, left.T).T[:, :n]
                else:
                    change = np.linalg.solve(self.saddle(inputs, count), left[:, :, None])[:, :n, 0]
            except np.linalg.LinAlgError:
                return None
            v = np.asarray(v + change, dtype=np.float64)
            if (np.abs(change) <= SETTLED * (1 + np.abs(v))).all():
                return v
        near = np.abs(change) <= NEARLY * (1 + np.abs(v))
        return np.where(np.all(near, axis=1, keepdims=True), v, np.nan) if turns else v

    def saddle(self, inputs: Mapping[int, Any], count: int) -> Array:
        """[[g, w^T], [w, 0]] at `count` points, (count, n + m, n + m)."""
        n, m = self.size, len(self.constraints)
        whole = np.zeros((count, n + m, n + m))
        pairs = [*self.masses, *((n + a, k) for a, k in self.forms)]
        found = self.values([*self.masses.values(), *self.forms.values()], inputs, count)
        for (i, j), value in zip(pairs, found, strict=True):
            whole[:, i, j] = value
            if i >= n:
                whole[:, j, i] = value
        return whole


def filled_matrices(entries: Entries, values: Array, size: int) -> Array:
    """(points, size, size)"""
    found = np.zeros((values.shape[1], size, size))
    for (i, j), value in zip(entries, values, strict=True):
        found[:, i, j] = value
    return found


def solved_rows(matrix: Array, right: Array) -> Array:
    """The solutions of matrix (points, N, N) x = right (points, N), nan where there is none."""
    good = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    found = np.full(right.shape, np.nan)
    try:
        found[good] = np.linalg.solve(matrix[good], right[good][:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        for k in np.flatnonzero(good):
            with suppress(np.linalg.LinAlgError):
                found[k] = np.linalg.solve(matrix[k], right[k])
    return found


def inverses(matrix: Array) -> Array:
    """Those of (points, N, N), nan where there is none."""
    unit = np.eye(matrix.shape[1])
    columns = [solved_rows(matrix, np.broadcast_to(row, matrix.shape[:2])) for row in unit]
    return np.stack(columns, axis=2)


class OnTable(NamedTuple):
    """A graph with the inputs of a table, and the number of its points."""

    graph: SceneGraph
    inputs: dict[int, Any]
    points: int


def on_table(
    coordinates: tuple[str, ...], lagrangian: ex.Expression | None, constraints: tuple[ex.Expression, ...],
    table: Mapping[ex.Expression, Any],
) -> OnTable:  # fmt: skip
    """The graph of L and constraints, with the inputs of a table of names and values, and the
    number of its points.
    """
    known = {*map(ex.Symbol, coordinates), ex.TIME}
    names = tuple(tree.name for tree in table if isinstance(tree, ex.Symbol) and tree not in known)
    scene = graph_of(Problem(coordinates, names, lagrangian, constraints))
    inputs = {scene.graph.keys[scene.graph.read[tree]][1]: value for tree, value in table.items()}
    return OnTable(
        scene, inputs, max((len(value) for value in table.values() if np.ndim(value)), default=1)
    )


def uses_own_lagrangian(problem: Problem) -> bool:
    """Whether L~ is the regular L of a scene without constraints, so that no H is needed: p = L_v
    determines v.
    """
    return (
        problem.free_hamiltonian is None
        and problem.free_lagrangian == problem.lagrangian is not None
    )


@lru_cache(maxsize=8)
def graph_of(problem: Problem) -> SceneGraph:
    """The graph of a problem, which one use shares with another."""
    return SceneGraph(problem)
