"""The motion on each side of the switches of sign, abs and pieces.

Between two switches every sqrt(u^2) is s u with s = 1 or -1, so that a piece of the motion is
smooth. With f+ and f- on both sides of u = 0 and u' along each:

    u'+ and u'- of one sign     the motion passes to that side u'+ < 0 < u'-               it
    sticks: f = ((1 + s) f+ + (1 - s) f-)/2 with u' = 0, until |s| = 1 u'- < 0 < u'+
    more than one motion begins there: the run ends by name

Where u depends on positions only, and u' = 0, u'' decides. Source: A. F. Filippov, Differential
Equations with Discontinuous Righthand Sides, 1988, chapter 2; several functions at once as V. I.
Utkin's equivalent control.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import Any

import numpy as np

from inverse_service.expressions import arrays, calculus, collecting, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation import (
    accelerations as accelerating,
    contacts as touching,
    numeric_formulas as nf,
    scene_data as data,
)
from inverse_service.simulation.scene_data import Point
from inverse_service.simulation.sentences import say

NOISE = 1e-14  # of the size of a state: what is zero
SAME = 1e-12  # of the size of a state: what does not move
AT_ZERO = 1e-9  # of the size of a state: what sticks is zero
CANCELLED = 1e-12  # of its summands: less is no acceleration
MOST_TOGETHER = 3  # switching functions that are zero at once
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
    """The formulas of a motion on each side, made when they are first needed, and their values at a
    state; with contacts, while the `active` ones press.
    """

    scene: data.Scene
    values: Mapping[str, float]
    problem: data.Problem
    formulas: Callable[[], tuple[ex.Expression, ...]]
    functions: tuple[ex.Expression, ...]
    made: dict[Key, tuple[tuple[ex.Expression, ...], dict[ex.Expression, ex.Expression]]] = field(
        default_factory=dict
    )
    rates: dict[tuple[ex.Expression, Key], tuple[ex.Expression, ...]] = field(default_factory=dict)
    problems: dict[tuple[bool, Key], data.Problem] = field(default_factory=dict)
    contacts: touching.Contacts | None = None
    active: touching.Active = ()
    siblings: dict[touching.Active, Motion] = field(default_factory=dict)
    scale: float = 0.0  # of the accelerations that contacts cancel

    @property
    def accelerations(self) -> tuple[ex.Expression, ...]:
        """Their formulas, derived where a side or an event asks for one."""
        return self.formulas()

    def pressed_by(self, active: touching.Active, scale: float) -> Motion:
        """The motion while these contacts press, from that of a scene whose contacts are all open;
        `scale` is that of the accelerations which they cancel.
        """
        if not active or self.contacts is None:
            return self
        if active not in self.siblings:
            contacts = self.contacts

            def formulas() -> tuple[ex.Expression, ...]:
                if (found := contacts.accelerations(active)) is None:
                    raise data.Unavailable(say("too_coupled_contacts"))
                return found

            own = Motion(self.scene, self.values, self.problem, formulas, self.functions)
            own.contacts, own.active = contacts, active
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
        middle, slopes = self._corners(self.contacts.forces, sides)
        shares = self.shares(sides)
        forces = [f + ex.add(*(shares[u] * slope[k] for u, slope in slopes.items() if u in shares))
                  for k, f in enumerate(middle)]  # fmt: skip
        return replace(self.contacts, forces=tuple(forces))

    def _corners(
        self, trees: Sequence[ex.Expression], sides: Sides
    ) -> tuple[list[ex.Expression], dict[ex.Expression, list[ex.Expression]]]:
        """The mean of the trees on both sides of what sticks, and half of their differences, by
        function.
        """
        stuck, n = [u for u, side in sides.items() if side == STICKS], len(trees)
        corners = []
        for signs in product((1, -1), repeat=len(stuck)):
            own = sides | dict(zip(stuck, signs, strict=True))
            corners.append((signs, [on_sides(tree, own) for tree in trees]))
        share = ex.number(1) / ex.number(len(corners))
        middle = [share * ex.add(*(trees[k] for _, trees in corners)) for k in range(n)]
        slopes = {u: [share * ex.add(*(signs[j] * trees[k] for signs, trees in corners)) for k in range(n)]
                  for j, u in enumerate(stuck)}  # fmt: skip
        return middle, slopes

    def at(self, trees: Sequence[ex.Expression], state: Point) -> Array:
        time, q, v = state
        table = nf.table_of(
            self.scene.coordinates, q[None], v[None], dict(self.values), np.array([time])
        )
        return np.array(arrays.array_values(trees, table)).ravel()

    def value(self, u: ex.Expression, sides: Sides, state: Point) -> float:
        """A switching function there, with those that it contains on their sides."""
        return float(self.at([on_sides(u, sides)], state)[0])

    def rate(self, u: ex.Expression, forces: Sequence[ex.Expression]) -> ex.Expression:
        """u' along q'' = forces."""
        return accelerating.rate(u, self.scene.coordinates, forces)

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
            else self.rate(own, [ex.ZERO] * len(names))
        )

    def forces(self, sides: Sides) -> tuple[ex.Expression, ...]:
        """The accelerations, with those of sticking functions such that they stay zero."""
        if (key := (*sides.items(),)) not in self.made:
            self.made[key] = self._make(sides)
        return self.made[key][0]

    def shares(self, sides: Sides) -> dict[ex.Expression, ex.Expression]:
        """The s in [-1, 1] of each function that sticks."""
        self.forces(sides)
        return self.made[*sides.items(),][1]

    def _make(
        self, sides: Sides
    ) -> tuple[tuple[ex.Expression, ...], dict[ex.Expression, ex.Expression]]:
        stuck = [u for u, side in sides.items() if side == STICKS]
        if not stuck:
            return tuple(on_sides(force, sides) for force in self.accelerations), {}
        middle, halves = self._corners(self.accelerations, sides)
        slopes, n = list(halves.values()), len(middle)
        surfaces = [self.surface(u, sides) for u in stuck]
        right = [-self.rate(w, middle) for w in surfaces]
        rows = [[ex.dot(self.slopes(w), slope) for slope in slopes] for w in surfaces]
        whole = collecting.determinant(rows)
        if whole == ex.ZERO:
            return tuple(middle), {}
        found = {}
        for j, u in enumerate(stuck):
            changed = [
                [*row[:j], value, *row[j + 1 :]] for row, value in zip(rows, right, strict=True)
            ]
            found[u] = collecting.determinant(changed) / whole
        forces = [
            middle[k] + ex.add(*(found[u] * slopes[j][k] for j, u in enumerate(stuck)))
            for k in range(n)
        ]
        # By the formulas alone round-off would move what sticks: one coordinate follows from the
        # others.
        free = list(range(n))
        for w in surfaces:
            weights = self.slopes(w)
            held = [k for k in free if isinstance(weights[k], ex.Number) and weights[k] != ex.ZERO]
            for k in held[:1]:
                free.remove(k)
                forces[k] = ex.ZERO
                forces[k] = -self.rate(w, forces) / weights[k]
        return tuple(forces), found

    def problem_on(self, sides: Sides, by_forces: bool) -> data.Problem:
        """The problem of the method with s u for sqrt(u^2); that of the accelerations where
        something sticks.
        """
        key, problem = (by_forces, (*sides.items(),)), self.problem
        if key not in self.problems and self.active and STICKS not in sides.values():
            self.problems[key] = self._pressed(sides)
        if key not in self.problems:
            names = ("lagrangian", "free_lagrangian", "free_hamiltonian")
            trees = {name: None if by_forces else getattr(problem, name) for name in names}
            own: dict[str, Any] = {
                name: tree and on_sides(tree, sides) for name, tree in trees.items()
            }
            own["forces"] = (
                () if by_forces else tuple(on_sides(force, sides) for force in problem.forces)
            )
            own["domain"] = () if by_forces else problem.domain
            own["accelerations"] = (
                self.forces(sides) if by_forces else problem.accelerations and self.forces(sides)
            )
            self.problems[key] = replace(problem, **own)
        return self.problems[key]

    def _pressed(self, sides: Sides) -> data.Problem:
        """The problem while contacts press: their forces are unknowns, as those of constraints
        are.
        """
        assert self.contacts is not None
        scene, names = self.scene, self.scene.coordinates
        zero, pulls = self.contacts.rows(self.active)
        own = [
            calculus.differentiate(w, ex.Velocity(name))
            for w in scene.constraints
            for name in names
        ]
        rows = tuple(tuple(own[k : k + len(names)]) for k in range(0, len(own), len(names)))
        lagrangian, forces = scene.lagrangian, scene.forces
        if lagrangian is None:  # given equations of one coordinate, as those of a unit mass
            lagrangian, forces = ex.HALF * ex.Velocity(names[0]) ** 2, scene.accelerations or ()
        return data.Problem(
            names, tuple(scene.values), on_sides(lagrangian, sides), (*scene.constraints, *zero),
            forces=tuple(on_sides(force, sides) for force in forces), pulls=(*rows, *pulls),
        )  # fmt: skip

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
        if len(zero) > MOST_TOGETHER:
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
        values = np.array([self.at(self.forces(sides), state) for sides in passing])
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
                    shares, forces = list(self.shares(sides).values()), self.forces(sides)
                    values = self.at(shares, state)
                    rates = self.at([self.rate(one, forces) for one in shares], state)
                    # A share that stays at its limit, as on a curve that one side's motion keeps,
                    # has a rate of noise.
                    slowest = AT_ZERO * np.abs(rates).max(initial=1 / abs(self.scene.grid.step))
                    grows = values * rates > slowest
                    inside = len(shares) == count and bool((np.abs(values) <= 1 + AT_ZERO).all())
                    inside = inside and not ((np.abs(values) > 1 - AT_ZERO) & grows).any()
                    rest = [u for u in others if not self._held(u, stuck, sides, state)]
                    if inside and self.goes(sides, rest, state):
                        return sides
        return None

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
        rate = self.at([self.rate(surfaces[-1], self.forces(sides))], state)
        free = self.at(self.forces(sides | dict.fromkeys(stuck, 1)), state)
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
            own, forces = on_sides(u, sides), self.forces(sides)
            first = self.rate(own, forces)
            second = self.rate(first, forces)
            places = [
                calculus.differentiate(own, name) for name in map(ex.Symbol, self.scene.coordinates)
            ]
            slopes = [*places, *self.slopes(own), calculus.differentiate(own, ex.TIME)]
            self.rates[key] = own, first, second, *slopes, *ex.summands(second)
        n, step = len(self.scene.coordinates), abs(self.scene.grid.step)
        value, first, second, *others = self.at(self.rates[key], state).tolist()
        steep, parts = np.abs(others[: 2 * n + 1]), np.abs(others[2 * n + 1 :])
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
            own, forces = on_sides(u, sides), self.forces(sides)
            first = self.rate(own, forces)
            rates = self.at([first, self.rate(first, forces)], state)
            scale = 1e-9 * (abs(rates[1]) + float(np.abs(state[2]).max()) + 1e-300)
            slow = abs(rates[0]) <= scale
            if not sides[u] * rates[1 if slow else 0] > 0:
                return False
        return True
