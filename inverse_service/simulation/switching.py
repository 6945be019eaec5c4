"""The motion on each side of the switches of sign, abs and pieces.

Between two switches every sqrt(u^2) is s u with s = 1 or -1, so that a piece of the motion is
smooth. With f+ and f- on both sides of u = 0 and u' along each:

    u'+ and u'- of one sign: the motion passes to that side
    u'+ < 0 < u'-: it sticks, f = ((1 + s) f+ + (1 - s) f-)/2 with u' = 0, until |s| = 1
    u'- < 0 < u'+: more than one motion begins there, and the run ends by name

Where u depends on positions only, and u' = 0, u'' decides. Source: A. F. Filippov, Differential
Equations with Discontinuous Righthand Sides, 1988, chapter 2; several functions at once as V. I.
Utkin's equivalent control.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np

from inverse_service.expressions import arrays, calculus, collecting, printing, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    accelerations as accelerating,
    contacts as touching,
    numeric_formulas as nf,
    scene_data as data,
    scene_graph,
)
from inverse_service.simulation.scene_data import Point

NOISE = 1e-14  # of the size of a state: what is zero
SAME = 1e-12  # of the size of a state: what does not move
AT_ZERO = 1e-9  # of the size of a state: what sticks is zero
CANCELLED = 1e-12  # of its summands: less is no acceleration
SINGULAR = 1e12  # of linear equations in rows of size 1: they determine nothing
MOST_WAYS = 250  # to go on where functions are zero, which are tried one after another
MOST_PIVOTS = 1000
STICKS = 0
Sides = dict[
    ex.Expression, int
]  # of each switching function: 1 above zero, -1 below, 0 where the motion sticks
Key = tuple[tuple[ex.Expression, int], ...]


@dataclass(frozen=True, slots=True)
class Place:
    """On which side of its zero a formula is, or to which it moves if it is `at_zero`, 0 if it
    stays there; and how far from zero it goes before it turns, as a share of its size.
    """

    side: int
    at_zero: bool
    hop: float = np.inf


def on_sides(tree: ex.Expression, sides: Mapping[ex.Expression, int]) -> ex.Expression:
    """The tree with s u for each sqrt(u^2)."""

    def replaced(part: ex.Expression) -> ex.Expression:
        if not isinstance(part, ex.Power) or (root := ex.powers_of(part)[0][1]).denominator == 1:
            return ex.rebuild(part, replaced)
        outside, inside = [], []
        for factor, (u, even) in zip(
            ex.factors_of(part.base), ex.powers_of(part.base), strict=True
        ):
            power = root
            if even.denominator != 1 and isinstance(u, ex.Power):  # a root of u^2 under another one
                power, ((u, even),) = root * even, ex.powers_of(u)
            if even % 2 == 0 and (side := sides.get(u)):
                power, u = even * power, replaced(u)
                # A root of u remains a root of u^2, so that a step beyond u = 0 has a value.
                outside.append(
                    ex.number(side) ** power * u**power
                    if power.denominator == 1
                    else (u**2) ** (power / 2)
                )
            else:
                inside.append(replaced(factor))
        return ex.multiply(*outside, ex.multiply(*inside) ** root)

    return collecting.merge_powers(replaced(tree))  # u/u has a value where u is zero


def _corners(
    trees: Sequence[ex.Expression], sides: Sides
) -> tuple[list[ex.Expression], dict[ex.Expression, list[ex.Expression]]]:
    """The mean of the trees on both sides of what sticks, and half of their differences, by
    function: term by term, as most terms change with none of them or with one.
    """
    stuck = [u for u, side in sides.items() if side == STICKS]
    middle, slopes = [], {u: list[ex.Expression]() for u in stuck}
    for tree in trees:
        whole, rises = list[ex.Expression](), {u: list[ex.Expression]() for u in stuck}
        for term in ex.summands(tree):
            own = [u for u in stuck if on_sides(term, {u: 1}) != on_sides(term, {u: -1})]
            share = ex.HALF ** ex.number(len(own))
            for signs in product((1, -1), repeat=len(own)):
                corner = share * on_sides(term, sides | dict(zip(own, signs, strict=True)))
                whole.append(corner)
                for u, sign in zip(own, signs, strict=True):
                    rises[u].append(sign * corner)
        middle.append(ex.add(*whole))
        for u in stuck:
            slopes[u].append(ex.add(*rises[u]))
    return middle, slopes


def acceleration_of(name: str) -> ex.Expression:
    """The name, which no user can write, of an acceleration in formulas."""
    return ex.Symbol(f"acceleration of {name}")


def jerk_of(name: str) -> ex.Expression:
    """That of its rate."""
    return ex.Symbol(f"rate of the acceleration of {name}")


def share_of(u: ex.Expression) -> ex.Expression:
    """That of the share of a function that sticks."""
    return ex.Symbol(f"share of {printing.to_text(u)}")


def rate_of_share(u: ex.Expression) -> ex.Expression:
    """That of its rate."""
    return ex.Symbol(f"rate of the share of {printing.to_text(u)}")


@dataclass(frozen=True, slots=True)
class Numbers:
    """(q'', lambda) at m points, their rates along the motion, and the sizes of the terms of which
    both are made, (m, n + c) each; the shares of what sticks are the last of them.
    """

    solution: Array
    rates: Array
    sizes: Array
    sizes_of_rates: Array


def size_of(state: Point) -> float:
    """The greatest position or velocity, not 0."""
    return float(np.abs(np.concatenate(state[1:])).max()) + 1e-300


def switches_of(problem: data.Problem, scene: data.Scene) -> tuple[ex.Expression, ...]:
    trees = (
        scene.lagrangian, *scene.forces, *(scene.accelerations or ()), problem.free_lagrangian,
        *(problem.accelerations or ()),
    )  # fmt: skip
    return nf.switching_functions(trees, scene.coordinates)


@dataclass
class Motion:
    """The linear equations of a motion on each side, made when they are first needed, and numbers
    at a state; with contacts, while the `active` ones press.

    Accelerations, the shares of what sticks, and their rates are names in formulas, which get their
    numbers from these equations.
    """

    scene: data.Scene
    values: Mapping[str, float]
    problem: data.Problem
    functions: tuple[ex.Expression, ...]
    blocks: dict[Key, scene_graph.SceneGraph] = field(default_factory=dict)
    rates: dict[tuple[ex.Expression, Key], tuple[ex.Expression, ...]] = field(default_factory=dict)
    problems: dict[tuple[bool, Key], data.Problem] = field(default_factory=dict)
    contacts: touching.Contacts | None = None
    active: touching.Active = ()
    siblings: dict[touching.Active, Motion] = field(default_factory=dict)
    scale: float = 0.0  # of the accelerations that contacts cancel
    latest: tuple[Any, Numbers] | None = None

    def pressed_by(self, active: touching.Active, scale: float) -> Motion:
        """The motion while these contacts press, from that of a scene whose contacts are all open;
        `scale` is that of the accelerations which they cancel.
        """
        if not active or self.contacts is None:
            return self
        if active not in self.siblings:
            own = Motion(self.scene, self.values, self.problem, self.functions)
            own.contacts, own.active = self.contacts, active
            self.siblings[active] = own
        self.siblings[active].scale = scale
        return self.siblings[active]

    def contacts_on(self, sides: Sides) -> touching.Contacts:
        """The contacts with the forces on these sides; of sticking functions their forces as they
        stick.
        """
        assert self.contacts is not None
        if not sides:
            return self.contacts
        middle, slopes = _corners(self.contacts.forces, sides)
        forces = [f + ex.add(*(share_of(u) * slope[k] for u, slope in slopes.items()))
                  for k, f in enumerate(middle)]  # fmt: skip

        def shares(times: Array, positions: Array, velocities: Array) -> dict[ex.Expression, Array]:
            found = self.shares_at(sides, times, positions, velocities)
            return {share_of(u): value for u, value in found.items()}

        return replace(self.contacts, forces=tuple(forces), numbers=shares)

    def block(self, sides: Sides) -> scene_graph.SceneGraph:
        """The linear equations on these sides: with those of what sticks and of the contacts that
        press, whose forces are unknowns, as those of constraints are.
        """
        if (key := (*sides.items(),)) not in self.blocks:
            self.blocks[key] = scene_graph.graph_of(self._equations(sides))
        return self.blocks[key]

    def _equations(self, sides: Sides) -> data.Problem:
        scene, names = self.scene, self.scene.coordinates
        zero, pulls = self.contacts.rows(self.active) if self.contacts is not None else ((), ())
        own = [euler_lagrange.momenta(w, names) for w in scene.constraints]
        smooth, switched = self.parts
        forces = scene.forces if scene.lagrangian is not None else scene.accelerations or ()
        (other, *means), _ = _corners((switched, *forces), sides)
        lagrangian = ex.add(smooth, other)
        stuck = self.stuck(sides)
        if stuck:
            known = scene if scene.lagrangian is None else replace(scene, lagrangian=switched)
            slopes = _corners(touching.forces_of(known), sides)[1]
            zero = (*zero, *(self.surface(u, sides) for u in stuck))
            pulls = (*pulls, *(tuple(slopes[u]) for u in stuck))
        return data.Problem(
            names, tuple(scene.values), lagrangian, (*scene.constraints, *zero), forces=tuple(means),
            pulls=(*own, *pulls) if zero else (),
        )  # fmt: skip

    @cached_property
    def parts(self) -> tuple[ex.Expression, ex.Expression]:
        """The terms of L without switches, and those with them; of given accelerations, L of unit
        masses.
        """
        if (whole := self.scene.lagrangian) is None:
            speeds = map(ex.Velocity, self.scene.coordinates)
            return ex.HALF * ex.add(*(v**2 for v in speeds)), ex.ZERO
        above = dict.fromkeys(self.functions, 1)
        terms = [(term, on_sides(term, above) != term) for term in ex.summands(whole)]
        smooth, switched = (
            ex.add(*(term for term, turns in terms if turns == kind)) for kind in (False, True)
        )
        return smooth, switched

    def stuck(self, sides: Sides) -> list[ex.Expression]:
        """The functions that stick, in the order of their shares."""
        return [u for u, side in sides.items() if side == STICKS]

    def numbers(self, sides: Sides, times: Array, positions: Array, velocities: Array) -> Numbers:
        """Those of the linear equations at m points; the last ones are kept."""
        key = (*sides.items(),), times.tobytes(), positions.tobytes(), velocities.tobytes()
        if self.latest is None or self.latest[0] != key:
            graph = self.block(sides)
            inputs = graph.inputs(positions, velocities, self.values, times)
            with np.errstate(all="ignore"):
                self.latest = key, Numbers(*graph.with_rates(inputs, len(times)))
        return self.latest[1]

    def _solution(self, sides: Sides, times: Array, positions: Array, velocities: Array) -> Array:
        """(q'', lambda) at m points, (m, n + c)."""
        graph = self.block(sides)
        return graph.solution(graph.inputs(positions, velocities, self.values, times), len(times))

    def shares_at(
        self, sides: Sides, times: Array, positions: Array, velocities: Array
    ) -> dict[ex.Expression, Array]:
        """The s in [-1, 1] of each function that sticks, (m,), nan where none is determined."""
        stuck = self.stuck(sides)
        if not stuck:
            return {}
        found = self._solution(sides, times, positions, velocities)
        return {u: found[:, k - len(stuck)] for k, u in enumerate(stuck)}

    def at(
        self,
        trees: Sequence[ex.Expression],
        state: Point,
        sides: Sides | None = None,
        sizes: bool = False,
    ) -> Array:
        """Their values at a state; on `sides` also of what holds accelerations and shares. `sizes`:
        the sizes of the terms of which these are made, in the place of their values.
        """
        time, q, v = state
        points = np.array([time]), q[None], v[None]
        table = nf.arrays_by_name(self.scene.coordinates, *points[1:], dict(self.values), points[0])
        if sides is not None:
            found, names, stuck = (
                self.numbers(sides, *points), self.scene.coordinates, self.stuck(sides),
            )  # fmt: skip
            own, rates = (
                (found.sizes, found.sizes_of_rates) if sizes else (found.solution, found.rates)
            )
            unknown = [*map(acceleration_of, names)], [*map(share_of, stuck)]
            later = [*map(jerk_of, names)], [*map(rate_of_share, stuck)]
            for (moves, holds), numbers in ((unknown, own), (later, rates)):
                table |= {name: numbers[:, k] for k, name in enumerate(moves)}
                table |= {name: numbers[:, k - len(holds)] for k, name in enumerate(holds)}
        return np.array(arrays.array_values(trees, table)).ravel()

    def accelerations_at(self, state: Point, sides: Sides) -> Array:
        """(n,)"""
        time, q, v = state
        found = self._solution(sides, np.array([time]), q[None], v[None])
        return found[0, : len(self.scene.coordinates)]

    def value(self, u: ex.Expression, sides: Sides, state: Point) -> float:
        """A switching function there, with those that it contains on their sides."""
        return float(self.at([on_sides(u, sides)], state)[0])

    def rate(self, tree: ex.Expression) -> ex.Expression:
        """Its rate along the motion."""
        names = self.scene.coordinates
        pairs = [(acceleration_of(name), jerk_of(name)) for name in names]
        pairs += [(share_of(u), rate_of_share(u)) for u in self.functions]
        moved = accelerating.rate(tree, names, [name for name, _ in pairs[: len(names)]])
        others = [calculus.differentiate(tree, name) * rate for name, rate in pairs]
        return ex.add(moved, *others)

    def slopes(self, u: ex.Expression) -> list[ex.Expression]:
        """du/dv, (n,)."""
        return [calculus.differentiate(u, ex.Velocity(name)) for name in self.scene.coordinates]

    def surface(self, u: ex.Expression, sides: Sides) -> ex.Expression:
        """u, or u' if u contains no velocity: the function that stays zero while the motion
        sticks.
        """
        own, names = on_sides(u, sides), self.scene.coordinates
        return (
            own
            if ex.holds(own, *map(ex.Velocity, names))
            else accelerating.rate(own, names, [ex.ZERO] * len(names))
        )

    def problem_on(self, sides: Sides, by_forces: bool) -> data.Problem:
        """The problem of the method with s u for sqrt(u^2); the linear equations for the
        accelerations where something sticks or presses.
        """
        key, problem = (by_forces, (*sides.items(),)), self.problem
        if key not in self.problems and (by_forces or self.active or STICKS in sides.values()):
            self.problems[key] = self.block(sides).problem
        if key not in self.problems:
            names = ("lagrangian", "free_lagrangian", "free_hamiltonian")
            own: dict[str, Any] = {
                name: (tree := getattr(problem, name)) and on_sides(tree, sides) for name in names
            }
            for name in ("forces", "accelerations"):
                given = getattr(problem, name)
                own[name] = given and tuple(on_sides(tree, sides) for tree in given)
            self.problems[key] = replace(problem, **own)
        return self.problems[key]

    def sides_at(
        self, state: Point, before: Sides, zero: Sequence[ex.Expression], known: Sides
    ) -> Sides | None:
        """The sides on which the motion continues if the functions `zero` are zero and others are
        on `known` sides; None if there is no such choice or more than one.
        """
        found: Sides = {}
        for u in self.functions:
            value = self.value(u, before | found, state)
            found[u] = before.get(u, STICKS) if u in zero else known.get(u, 1 if value > 0 else -1)
        if not zero:
            return found
        if (sides := self._by_pivoting(state, found, zero)) is not None:
            return sides
        if 3 ** len(zero) > MOST_WAYS:
            return None
        passing = [
            found | dict(zip(zero, signs, strict=True))
            for signs in product((1, -1), repeat=len(zero))
        ]
        fits = [sides for sides in passing if self.goes(sides, zero, state)]
        if len(fits) == 1:
            return fits[0]
        if fits:  # from one side only crossing is a motion
            onward = [sides for sides in fits if all(sides[u] == -before.get(u, 0) for u in zero)]
            return onward[0] if len(onward) == 1 else None
        values = np.array([self.accelerations_at(state, sides) for sides in passing])
        if (
            np.ptp(values, axis=0) <= CANCELLED * max(np.abs(values).max(initial=0.0), self.scale)
        ).all():
            # At rest on a kink, where forces have one value: nothing moves it away, or it is seen
            # later.
            return found | {u: before.get(u) or 1 for u in zero}
        for count in range(1, len(zero) + 1):
            for stuck in combinations(zero, count):
                others = [u for u in zero if u not in stuck]
                for signs in product((1, -1), repeat=len(others)):
                    sides = (
                        found | dict.fromkeys(stuck, STICKS) | dict(zip(others, signs, strict=True))
                    )
                    if len(self.stuck(sides)) == count and self._goes_on(sides, zero, state):
                        return sides
        return None

    def _goes_on(self, sides: Sides, zero: Sequence[ex.Expression], state: Point) -> bool:
        """Whether what sticks on these sides is held, and the other zeros are left to their sides."""
        stuck = self.stuck(sides)
        shares = [*map(share_of, stuck)]
        values = self.at(shares, state, sides)
        rates = self.at([*map(self.rate, shares)], state, sides)
        # A share that stays at its limit, as on a curve that one side's motion keeps, has a rate of
        # noise.
        slowest = AT_ZERO * np.abs(rates).max(initial=1 / abs(self.scene.grid.step))
        grows = values * rates > slowest
        inside = bool((np.abs(values) <= 1 + AT_ZERO).all()) and self._is_determined(sides, state)
        if not inside or ((np.abs(values) > 1 - AT_ZERO) & grows).any():
            return False
        others = [u for u in zero if sides[u] != STICKS]
        rest = [u for u in others if not self._held(u, stuck, sides, state)]
        return self.goes(sides, rest, state)

    def _by_pivoting(
        self, state: Point, found: Sides, zero: Sequence[ex.Expression]
    ) -> Sides | None:
        """The sides where the forces of the functions oppose their rates, as friction does.

        With r the rates of their surfaces, the shares are s = s_0 - G r. If D G, where a force is
        -D s along the gradient of its surface, is positive definite, there is one r with |s| <= 1
        where r = 0 and s = sign(r) elsewhere, which principal pivoting finds (K. G. Murty, Linear
        Complementarity, 1988, chapter 4). None where it is not, or the motion does not go so.
        """
        sides = found | dict.fromkeys(zero, STICKS)
        if any(self.surface(u, sides) != on_sides(u, sides) for u in zero):
            return None
        if not self._is_determined(sides, state):
            return None
        time, q, v = state
        graph, n = self.block(sides), len(q)
        inputs = graph.inputs(q[None], v[None], self.values, np.array([time]))
        matrix = graph.matrix(inputs, 1)[0]
        first = len(matrix) - len(stuck := self.stuck(sides))
        own = [first + stuck.index(u) for u in zero]
        shares = graph.solution(inputs, 1)[0, own]
        lift = -np.linalg.inv(matrix)[np.ix_(own, own)]
        rows, pulls = matrix[own, :n], matrix[:n, own]
        opposing = np.einsum("ki,ik->i", pulls, rows) / np.einsum("ik,ik->i", rows, rows)
        scaled = opposing[:, None] * lift
        if not (opposing > 0).all() or np.linalg.eigvalsh(scaled + scaled.T).min() <= 0:
            return None
        signs = np.zeros(len(zero))
        for _ in range(MOST_PIVOTS):
            moving = np.flatnonzero(signs)
            rates, now = np.zeros(len(zero)), shares.copy()
            if len(moving):
                rates[moving] = np.linalg.solve(
                    lift[np.ix_(moving, moving)], (shares - signs)[moving]
                )
                now = shares - lift @ rates
            wrong = np.where(signs == 0, np.abs(now) > 1 + AT_ZERO, signs * rates < 0)
            if not wrong.any():
                break
            k = int(wrong.argmax())
            signs[k] = 0.0 if signs[k] else np.sign(now[k])
        else:
            return None
        sides = found | {u: int(sign) for u, sign in zip(zero, signs, strict=True)}
        return sides if self._goes_on(sides, zero, state) else None

    def _is_determined(self, sides: Sides, state: Point) -> bool:
        """Whether what sticks has one share each: their surfaces are independent."""
        time, q, v = state
        graph = self.block(sides)
        inputs = graph.inputs(q[None], v[None], self.values, np.array([time]))
        matrix = graph.matrix(inputs, 1)[0]
        return bool(np.linalg.cond(matrix / np.abs(matrix).max(axis=1, keepdims=True)) < SINGULAR)

    def _held(
        self, u: ex.Expression, stuck: Sequence[ex.Expression], sides: Sides, state: Point
    ) -> bool:
        """Whether a function stays zero because others stick, as two blocks at rest on the ground
        do not rub.
        """
        names, surfaces = self.scene.coordinates, [self.surface(one, sides) for one in (*stuck, u)]
        rows = self.at([slope for w in surfaces for slope in self.slopes(w)], state).reshape(
            -1, len(names)
        )
        rate = self.at([self.rate(surfaces[-1])], state, sides)
        free = self.accelerations_at(state, sides | dict.fromkeys(stuck, 1))
        still = bool(np.abs(rate).max() <= AT_ZERO * np.abs(free).max(initial=0.0))
        return still and bool(np.linalg.matrix_rank(rows) == np.linalg.matrix_rank(rows[:-1]))

    def place_of(self, u: ex.Expression, sides: Sides, state: Point) -> Place:
        """Where a formula u is at a state: its side of zero, or, at zero, the side to which u' and
        u'' lead.

        It is at zero where |u| is at most AT_ZERO of sum |u_q| |q| + sum |u_v| |v| + |u_t| |t|,
        with for |q| the greatest position and the way of a step. A u'' that its summands cancel to
        CANCELLED of them is 0.
        """
        if (key := (u, (*sides.items(),))) not in self.rates:
            own = on_sides(u, sides)
            first = self.rate(own)
            second = self.rate(first)
            places = [
                calculus.differentiate(own, name) for name in map(ex.Symbol, self.scene.coordinates)
            ]
            slopes = [*places, *self.slopes(own), calculus.differentiate(own, ex.TIME)]
            self.rates[key] = own, first, second, *slopes, *ex.summands(second)
        n, step = len(self.scene.coordinates), abs(self.scene.grid.step)
        value, first, second, *others = self.at(self.rates[key], state, sides).tolist()
        steep = np.abs(others[: 2 * n + 1])
        parts = np.abs(self.at(self.rates[key][2 * n + 4 :], state, sides, sizes=True))
        time, fastest, farthest = (
            abs(state[0]) + step,
            *(float(np.abs(one).max()) for one in (state[2], state[1])),
        )
        size = (
            steep[:n].sum() * (farthest + step * fastest)
            + steep[n:-1].sum() * fastest
            + steep[-1] * time
        )
        if not abs(value) <= AT_ZERO * size:
            return Place(int(np.sign(value)), False)
        slow = abs(first) <= AT_ZERO * (abs(second) + fastest)
        turns = 0.0 if abs(second) <= CANCELLED * parts.sum() else second
        hop = first**2 / (2 * abs(turns) * size) if first * turns < 0 else np.inf
        return Place(int(np.sign(turns if slow else first)), True, hop)

    def goes(self, sides: Sides, zero: Sequence[ex.Expression], state: Point) -> bool:
        """Whether the motion on these sides moves away from each zero to its side."""
        for u in zero:
            first = self.rate(on_sides(u, sides))
            rates = self.at([first, self.rate(first)], state, sides)
            scale = 1e-9 * (abs(rates[1]) + float(np.abs(state[2]).max()) + 1e-300)
            slow = abs(rates[0]) <= scale
            if not sides[u] * rates[1 if slow else 0] > 0:
                return False
        return True
