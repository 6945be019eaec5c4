"""Motions in pieces: events that act on the state, and switches of sign, abs and pieces.

Between two switches every sqrt(u^2) is s u with s = 1 or -1, so that a piece of the motion is smooth; it is run by the
method itself to the event, which `events` locates. With f+ and f- on both sides of u = 0 and u' along each:

    u'+ and u'- of one sign     the motion passes to that side
    u'+ < 0 < u'-               it sticks: f = ((1 + s) f+ + (1 - s) f-)/2 with u' = 0, until |s| = 1
    u'- < 0 < u'+               more than one motion begins there: the run ends by name

Where u depends on positions only, and u' = 0, u'' decides. Source: A. F. Filippov, Differential Equations with
Discontinuous Righthand Sides, 1988, chapter 2; several functions at once as V. I. Utkin's equivalent control.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import Any

import numpy as np

from inverse_service.expressions import arrays, calculus, collecting, printing, tree as ex
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    accelerations as accelerating,
    derivation,
    execution,
    initial,
    numeric_formulas as nf,
    observing,
    scene_data as data,
)
from inverse_service.simulation.events import CONTINUED, NOISE, Found, Point, first_of, joined, located, nowhere
from inverse_service.simulation.sentences import say

FIRST, MOST = 16, 4096  # steps of a piece that is looked at for events at once
SAME = 1e-12  # of a step: events at one time; of the size of a state: what does not move
AT_ZERO = 1e-9  # of the size of a state: what sticks is zero
CANCELLED = 1e-12  # of its summands: less is no acceleration
HOP, MOST_HOPS = 1e-15, 8  # of the size of a formula: what it rises between two events at rest; so often in a row
MOST_AT_ONCE = 1000  # events at one moment
SOON = 1e-10  # of a step or of the time: events closer than this are taken to accumulate
MOST_TOGETHER = 3  # switching functions that are zero at once
STICKS = 0
SPENT = ("force_evaluations", "newton_iterations", "compile_seconds", "run_seconds")  # by the parts of a run
MOST_TRIES = 64  # shorter steps up to a switch where the formulas of one side end behind it
BEGIN_ELSEWHERE = "begin elsewhere"
ENDS_BEYOND = ("singular", "not_finite", "off_domain", "no_convergence")  # of a step that may lead beyond a switch
Sides = dict[ex.Expression, int]  # of each switching function: 1 above zero, -1 below, 0 where the motion sticks
Key = tuple[tuple[ex.Expression, int], ...]


@dataclass(frozen=True, slots=True)
class Switch:
    """At time t a switching function passed to a side: 1, -1, or 0 if it sticks."""

    function: ex.Expression
    time: float
    side: int


@dataclass(frozen=True, slots=True)
class Place:
    """On which side of its zero a formula is, or to which it moves if it is `at_zero`, 0 if it stays there; and how far
    from zero it goes before it turns, as a share of its size."""

    side: int
    at_zero: bool
    hop: float = np.inf


@dataclass(frozen=True, slots=True)
class Run:
    """The run of a method; where it is `in_pieces`, with velocities at its points, no momenta, the events and switches
    on the way, and the state at the end."""

    trajectory: Trajectory
    in_pieces: bool = False
    events: tuple[Found, ...] = ()
    switches: tuple[Switch, ...] = ()
    final: Point | None = None


def on_sides(tree: ex.Expression, sides: Mapping[ex.Expression, int]) -> ex.Expression:
    """The tree with s u for each sqrt(u^2)."""

    def replaced(part: ex.Expression) -> ex.Expression:
        if not isinstance(part, ex.Power) or (root := ex.powers_of(part)[0][1]).denominator == 1:
            return ex.rebuild(part, replaced)
        outside, inside = [], []
        for factor, (u, even) in zip(ex.factors_of(part.base), ex.powers_of(part.base), strict=True):
            power = root
            if even.denominator != 1 and isinstance(u, ex.Power):  # a root of u^2 under another one
                power, ((u, even),) = root * even, ex.powers_of(u)
            if even % 2 == 0 and (side := sides.get(u)):
                power, u = even * power, replaced(u)
                # A root of u remains a root of u^2, so that a step beyond u = 0 has a value.
                outside.append(ex.number(side) ** power * u**power if power.denominator == 1 else (u**2) ** (power / 2))
            else:
                inside.append(replaced(factor))
        return ex.multiply(*outside, ex.multiply(*inside) ** root)

    return collecting.merge_powers(replaced(tree))  # u/u has a value where u is zero


def _size(state: Point) -> float:
    """The greatest position or velocity, not 0."""
    return float(np.abs(np.concatenate(state[1:])).max()) + 1e-300


def joined_spans(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans of time, in order, each joined to the one before where that ends at its begin."""
    found: list[tuple[float, float]] = []
    for begin, end in spans:
        if found and begin <= found[-1][1] + SAME * (1 + abs(begin)):
            begin, _ = found.pop()
        found.append((begin, end))
    return found


def has_pieces(scene: data.Scene, problem: data.Problem) -> bool:
    """Whether a run of this problem consists of pieces. A Lagrangian found for given equations is valid on one side,
    and its run ends there."""
    if any(event.acts or event.most > 1 for event in scene.events):
        return True
    return bool(switches_of(problem, scene)) and not (scene.accelerations and problem.free_lagrangian is not None)


def switches_of(problem: data.Problem, scene: data.Scene) -> tuple[ex.Expression, ...]:
    trees = (
        scene.lagrangian, *scene.forces, *(scene.accelerations or ()), problem.free_lagrangian,
        *(problem.accelerations or ()),
    )  # fmt: skip
    return nf.switching_functions(trees, scene.coordinates)


@dataclass
class _Motion:
    """The formulas of a motion on each side, made when they are first needed, and their values at a state."""

    scene: data.Scene
    values: Mapping[str, float]
    problem: data.Problem
    formulas: Callable[[], tuple[ex.Expression, ...]]
    functions: tuple[ex.Expression, ...]
    made: dict[Key, tuple[tuple[ex.Expression, ...], dict[ex.Expression, ex.Expression]]] = field(default_factory=dict)
    rates: dict[tuple[ex.Expression, Key], tuple[ex.Expression, ...]] = field(default_factory=dict)
    problems: dict[tuple[bool, Key], data.Problem] = field(default_factory=dict)

    @property
    def accelerations(self) -> tuple[ex.Expression, ...]:
        """Their formulas, derived where a side or an event asks for one."""
        return self.formulas()

    def at(self, trees: Sequence[ex.Expression], state: Point) -> Array:
        time, q, v = state
        table = nf.table_of(self.scene.coordinates, q[None], v[None], dict(self.values), np.array([time]))
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
        """u, or u' if u contains no velocity: the function that stays zero while the motion sticks."""
        own, names = on_sides(u, sides), self.scene.coordinates
        return own if ex.holds(own, *map(ex.Velocity, names)) else self.rate(own, [ex.ZERO] * len(names))

    def forces(self, sides: Sides) -> tuple[ex.Expression, ...]:
        """The accelerations, with those of sticking functions such that they stay zero."""
        if (key := (*sides.items(),)) not in self.made:
            self.made[key] = self._make(sides)
        return self.made[key][0]

    def shares(self, sides: Sides) -> dict[ex.Expression, ex.Expression]:
        """The s in [-1, 1] of each function that sticks."""
        self.forces(sides)
        return self.made[*sides.items(),][1]

    def _make(self, sides: Sides) -> tuple[tuple[ex.Expression, ...], dict[ex.Expression, ex.Expression]]:
        stuck = [u for u, side in sides.items() if side == STICKS]
        if not stuck:
            return tuple(on_sides(force, sides) for force in self.accelerations), {}
        corners = []
        for signs in product((1, -1), repeat=len(stuck)):
            own = sides | dict(zip(stuck, signs, strict=True))
            corners.append((signs, [on_sides(force, own) for force in self.accelerations]))
        share, n = ex.number(1) / ex.number(len(corners)), len(self.accelerations)
        middle = [share * ex.add(*(forces[k] for _, forces in corners)) for k in range(n)]
        slopes = [[share * ex.add(*(signs[j] * forces[k] for signs, forces in corners)) for k in range(n)]
                  for j in range(len(stuck))]  # fmt: skip
        surfaces = [self.surface(u, sides) for u in stuck]
        right = [-self.rate(w, middle) for w in surfaces]
        rows = [[ex.dot(self.slopes(w), slope) for slope in slopes] for w in surfaces]
        whole = collecting.determinant(rows)
        if whole == ex.ZERO:
            return tuple(middle), {}
        found = {}
        for j, u in enumerate(stuck):
            changed = [[*row[:j], value, *row[j + 1 :]] for row, value in zip(rows, right, strict=True)]
            found[u] = collecting.determinant(changed) / whole
        forces = [middle[k] + ex.add(*(found[u] * slopes[j][k] for j, u in enumerate(stuck))) for k in range(n)]
        # By the formulas alone round-off would move what sticks: one coordinate follows from the others.
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
        """The problem of the method with s u for sqrt(u^2); that of the accelerations where something sticks."""
        key, problem = (by_forces, (*sides.items(),)), self.problem
        if key not in self.problems:
            names = ("lagrangian", "free_lagrangian", "free_hamiltonian")
            trees = {name: None if by_forces else getattr(problem, name) for name in names}
            own: dict[str, Any] = {name: tree and on_sides(tree, sides) for name, tree in trees.items()}
            own["forces"] = () if by_forces else tuple(on_sides(force, sides) for force in problem.forces)
            own["domain"] = () if by_forces else problem.domain
            own["accelerations"] = self.forces(sides) if by_forces else problem.accelerations and self.forces(sides)
            self.problems[key] = replace(problem, **own)
        return self.problems[key]

    def sides_at(self, state: Point, before: Sides, zero: Sequence[ex.Expression], known: Sides) -> Sides | None:
        """The sides on which the motion continues if the functions `zero` are zero and others are on `known` sides;
        None if there is no such choice or more than one."""
        found: Sides = {}
        for u in self.functions:
            value = self.value(u, before | found, state)
            found[u] = before.get(u, STICKS) if u in zero else known.get(u, 1 if value > 0 else -1)
        if not zero:
            return found
        if len(zero) > MOST_TOGETHER:
            return None
        passing = [found | dict(zip(zero, signs, strict=True)) for signs in product((1, -1), repeat=len(zero))]
        fits = [sides for sides in passing if self.goes(sides, zero, state)]
        if len(fits) == 1:
            return fits[0]
        if fits:  # from one side only crossing is a motion
            onward = [sides for sides in fits if all(sides[u] == -before.get(u, 0) for u in zero)]
            return onward[0] if len(onward) == 1 else None
        values = np.array([self.at(self.forces(sides), state) for sides in passing])
        if (np.ptp(values, axis=0) <= 1e-12 * np.abs(values).max(initial=0.0)).all():
            # At rest on a kink, where forces have one value: nothing moves it away, or it is seen later.
            return found | {u: before.get(u) or 1 for u in zero}
        for count in range(1, len(zero) + 1):
            for stuck in combinations(zero, count):
                others = [u for u in zero if u not in stuck]
                for signs in product((1, -1), repeat=len(others)):
                    sides = found | dict.fromkeys(stuck, STICKS) | dict(zip(others, signs, strict=True))
                    shares, forces = list(self.shares(sides).values()), self.forces(sides)
                    values = self.at(shares, state)
                    rates = self.at([self.rate(one, forces) for one in shares], state)
                    # A share that stays at its limit, as on a curve that one side's motion keeps, has a rate of noise.
                    slowest = AT_ZERO * np.abs(rates).max(initial=1 / abs(self.scene.grid.step))
                    grows = values * rates > slowest
                    inside = len(shares) == count and bool((np.abs(values) <= 1 + AT_ZERO).all())
                    inside = inside and not ((np.abs(values) > 1 - AT_ZERO) & grows).any()
                    rest = [u for u in others if not self._held(u, stuck, sides, state)]
                    if inside and self.goes(sides, rest, state):
                        return sides
        return None

    def _held(self, u: ex.Expression, stuck: Sequence[ex.Expression], sides: Sides, state: Point) -> bool:
        """Whether a function stays zero because others stick, as two blocks at rest on the ground do not rub."""
        names, surfaces = self.scene.coordinates, [self.surface(one, sides) for one in (*stuck, u)]
        rows = self.at([slope for w in surfaces for slope in self.slopes(w)], state).reshape(-1, len(names))
        rate = self.at([self.rate(surfaces[-1], self.forces(sides))], state)
        free = self.at(self.forces(sides | dict.fromkeys(stuck, 1)), state)
        still = bool(np.abs(rate).max() <= AT_ZERO * np.abs(free).max(initial=0.0))
        return still and bool(np.linalg.matrix_rank(rows) == np.linalg.matrix_rank(rows[:-1]))

    def place_of(self, u: ex.Expression, sides: Sides, state: Point) -> Place:
        """Where a formula u is at a state: its side of zero, or, at zero, the side to which u' and u'' lead.

        It is at zero where |u| is at most AT_ZERO of sum |u_q| |q| + sum |u_v| |v| + |u_t| |t|, with for |q| the
        greatest position and the way of a step. A u'' that its summands cancel to CANCELLED of them is 0.
        """
        if (key := (u, (*sides.items(),))) not in self.rates:
            own, forces = on_sides(u, sides), self.forces(sides)
            first = self.rate(own, forces)
            second = self.rate(first, forces)
            places = [calculus.differentiate(own, name) for name in map(ex.Symbol, self.scene.coordinates)]
            slopes = [*places, *self.slopes(own), calculus.differentiate(own, ex.TIME)]
            self.rates[key] = own, first, second, *slopes, *ex.summands(second)
        n, step = len(self.scene.coordinates), abs(self.scene.grid.step)
        value, first, second, *others = self.at(self.rates[key], state).tolist()
        steep, parts = np.abs(others[: 2 * n + 1]), np.abs(others[2 * n + 1 :])
        time, fastest, farthest = abs(state[0]) + step, *(float(np.abs(one).max()) for one in (state[2], state[1]))
        size = steep[:n].sum() * (farthest + step * fastest) + steep[n:-1].sum() * fastest + steep[-1] * time
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


def run_motion(
    derived: derivation.Derived, requested: data.Requested, problem: data.Problem, start: data.Start,
    values: Mapping[str, float],
) -> Run:  # fmt: skip
    """The run of a method with what the scene observes at every step, in pieces where it has some."""
    scene = derived.scene

    def integrate(what: data.Problem, by: data.MethodChoice, begin: data.Start, grid: data.Grid) -> Trajectory:
        own, observation = observing.observed_problem(scene, what)
        return execution.run(own, by, begin, grid, values, observation, derived.stop)

    if not has_pieces(scene, problem):
        return Run(integrate(problem, requested.choice, start, scene.grid))
    formulas = _Motion(scene, values, problem, derived.accelerations, switches_of(problem, scene))
    every_point = replace(scene, grid=replace(scene.grid, record_every=1))
    run = _Pieces(every_point, requested, formulas, integrate, derived.stop).go(start)
    return replace(run, trajectory=run.trajectory.thinned(scene.grid.steps, scene.grid.record_every))


@dataclass
class _Pieces:
    scene: data.Scene
    requested: data.Requested
    motion: _Motion
    integrate: Callable[[data.Problem, data.MethodChoice, data.Start, data.Grid], Trajectory]
    stop: data.Stop | None

    def __post_init__(self) -> None:
        self.parts: list[Trajectory] = []
        size = len(self.scene.coordinates)
        self.seen: list[list[Found]] = [[nowhere(event, size)] for event in self.scene.events]
        self.notes: dict[int, str] = {}
        self.still: dict[int, list[tuple[float, float]]] = {}  # when a formula was zero within round-off
        self.hops = 0  # events in a row between which nothing rises
        self.switches: list[Switch] = []
        self.acted: list[float] = []
        self.settled: set[ex.Expression] = set()  # functions whose sides at the last event are known
        self.held: dict[int, float] = {}  # the sense in which each event was reached that turned the motion back
        self.side = [0] * len(self.scene.events)  # on which each formula was when it was last not at zero

    def go(self, start: data.Start) -> Run:
        scene, grid = self.scene, self.scene.grid
        state: Point = grid.begin, np.array(start.positions, dtype=float), np.array(start.velocities, dtype=float)
        begun: data.Start | None = start
        sides, outcome = self._sides(state, {}, self._zeros(state, {})), None
        if sides is not None:
            self.side = [self.motion.place_of(event.formula, sides, state).side for event in scene.events]
            if kinds := self._at_start(state, sides):
                begun, (state, outcome) = None, self._act(state, kinds, sides)
                sides = self._sides(state, sides, self._zeros(state, sides))
        place, count = 0, FIRST
        share, tries, failed = 1.0, 0, None
        while sides is not None and outcome is None and place < grid.steps:
            if self.stop is not None and self.stop():
                outcome = Outcome("cancelled", place, state[0])
                break
            # If a piece begins between two grid points, first step to the next one; then take many steps at once.
            ahead = grid.begin + (place + 1) * grid.step - state[0]
            between = abs(ahead - grid.step) > SAME * (abs(grid.step) + abs(state[0]))
            many = 1 if between or share < 1 else min(count, grid.steps - place)
            piece = data.Grid(share * (ahead if between else grid.step), many, 1, state[0])
            stuck = STICKS in sides.values()
            by_forces = stuck and self.requested.method not in method_table.POINT_METHODS
            choice = CONTINUED if by_forces else self.requested.choice
            what = self.motion.problem_on(sides, by_forces)
            begin = begun or data.Start(state[1], state[2])
            ran = self.integrate(what, choice, begin, piece)
            if len(ran.times) < 2:
                failed, share, tries = failed or (ran.outcome, state), share / 2, tries + 1
                if self.motion.functions and ran.outcome.kind in ENDS_BEYOND and tries < MOST_TRIES:
                    continue
                state = failed[1]
                outcome = replace(failed[0], step=place, time=state[0])
                break
            observed = observing.Observed(
                replace(scene, grid=piece), replace(self.requested, choice=choice,
                alpha=None if by_forces else self.requested.alpha), ran, what, self.motion.values, None,
            )  # fmt: skip
            velocities = observed.velocities
            if velocities is None:
                raise data.Unavailable("The method has no velocities at its points, which events need.")
            ran = replace(ran, velocities=velocities, momenta=None)
            points = list(zip(ran.times[:3].tolist(), ran.positions[:3], velocities[:3], strict=True))
            if (turned := self._turned(points, sides)) is not None:
                sides = turned
                continue
            # What follows the first passage of a switch is no motion, and may end where none can be followed.
            last = self._passed(ran, velocities, sides)
            if last < len(ran.times):
                ran = replace(ran.part(slice(last)), outcome=Outcome("completed"))
                observed = replace(observed, trajectory=observed.trajectory.part(slice(last)))
                velocities = velocities[:last]
            found, begun = self._first(observed, sides), None
            arrived = float(ran.times[-1]), ran.positions[-1], velocities[-1]
            if self._fell_through(points[1], np.inf if found is None else found[0][0]) or (
                found is None and self._leaked(arrived, sides)
            ):
                outcome = self._zeno(state[0], place)
                break
            away = min((side * self.motion.value(u, sides, arrived) for u, side in sides.items()), default=0.0)
            if found is None and away < -AT_ZERO * _size(arrived):
                sides = None  # it left a zero at which it began, to the other side
                break
            if found is None and share < 1:
                self._keep(ran, 1)
                state, tries = arrived, tries + 1
                continue
            if found is None:
                self._keep(ran, len(ran.times))
                place += len(ran.times) - 1
                state = (grid.begin + place * grid.step, *arrived[1:])
                count = min(2 * count, MOST)
                if not (ran.outcome.completed or ran.outcome.kind in ENDS_BEYOND):
                    outcome = replace(ran.outcome, step=place, time=state[0])
                continue
            share, tries, failed = 1.0, 0, None
            state, kinds = found
            row = max(1, int((ran.times < state[0] - SAME * abs(grid.step)).sum()))
            self._keep(ran, row)
            place, count = place + row - 1, max(FIRST // 2, 2 * row)
            state, ended = self._act(state, kinds, sides)
            here = grid.begin + (place + 1) * grid.step
            if abs(state[0] - here) <= SAME * (abs(grid.step) + abs(here)) and row < len(ran.times):
                # The event is at a grid point, which is recorded with the state after the event.
                at = ran.part(slice(row, row + 1))
                self.parts.append(replace(at, positions=state[1][None], velocities=state[2][None]))
                place, state = place + 1, (here, state[1], state[2])
            if ended is not None:
                outcome = replace(ended, step=place)
                break
            zero = [one for one in kinds if isinstance(one, ex.Expression)]
            sides = self._sides(state, sides, zero)
        if sides is None:
            text = " = ".join(map(printing.to_text, self._zeros(state, {}) or self.motion.functions))
            outcome = Outcome("singular", place, state[0], say("no_one_motion", text), None, BEGIN_ELSEWHERE)
        whole = self._joined(outcome or Outcome("completed", grid.steps, grid.begin + grid.steps * grid.step), start)
        events = tuple(joined(parts, self._note_of(k, whole)) for k, parts in enumerate(self.seen))
        return Run(whole, True, events, tuple(self.switches), state)

    def _note_of(self, index: int, whole: Trajectory) -> str:
        """What else was seen of an event."""
        (begin, end), *_ = self.still.get(index, [(0.0, -1.0)])
        if index in self.notes or end < begin:
            return self.notes.get(index, "")
        always = begin <= whole.times[0] and end >= whole.times[-1]
        return say("event_always_zero") if always else say("event_zero_between", begin, end)

    def _passed(self, ran: Trajectory, velocities: Array, sides: Sides) -> int:
        """How many points lead to the first beyond a switch, or all."""
        table = nf.table_of(self.scene.coordinates, ran.positions, velocities, self.motion.values, ran.times)
        values = [side * arrays.array_value(on_sides(u, sides), table) for u, side in sides.items() if side]
        passed = np.any([value[1:] < 0 for value in values], axis=0) if values else np.zeros(1, dtype=bool)
        return int(passed.argmax()) + 2 if passed.any() else len(ran.times)

    def _turned(self, points: Sequence[Point], sides: Sides) -> Sides | None:
        """The sides, where a function that was zero at the start of a piece went to the other one at once: its sides
        have the same force there, and what moves it is of a higher order. `points` are the first of the piece."""
        for u, side in sides.items():
            begin, *others = (self.motion.value(u, sides, point) for point in points)
            turns = side and u not in self.settled and begin == 0 and all(side * value < 0 for value in others)
            if turns and not self.motion.goes(sides, [u], points[0]):
                self.settled.add(u)
                return sides | {u: -side}
        return None

    def _zeros(self, state: Point, sides: Sides) -> list[ex.Expression]:
        """The switching functions that are zero at the start."""
        return [u for u in self.motion.functions if abs(self.motion.value(u, sides, state)) <= NOISE * _size(state)]

    def _sides(self, state: Point, before: Sides, zero: Sequence[ex.Expression]) -> Sides | None:
        released = {}
        for u in zero:
            if before.get(u) == STICKS:  # it is released to the side to which its share has come
                released[u] = 1 if self.motion.at([self.motion.shares(before)[u]], state)[0] > 0 else -1
        self.settled = set(released)
        # What else is zero and stays so is decided with them: its force may not hold any more, and an event may have
        # moved it. That is what sticks, and what slides although the greatest friction just holds it.
        stuck = [u for u, side in before.items() if u not in zero and self._stays(u, side, before, state)]
        found = self.motion.sides_at(state, before, [u for u in (*zero, *stuck) if u not in released], released)
        if found is not None and before:
            self.switches += [Switch(u, state[0], found[u]) for u in (*zero, *stuck) if found[u] != before[u]]
        return found

    def _stays(self, u: ex.Expression, side: int, before: Sides, state: Point) -> bool:
        """Whether a function that is zero is so for more than a moment: it sticks, or does not move in a step."""
        value, size = abs(self.motion.value(u, before, state)), _size(state)
        if side == STICKS:
            return value <= AT_ZERO * size
        rate = self.motion.rate(on_sides(u, before), self.motion.forces(before))
        moved = abs(self.scene.grid.step) * abs(float(self.motion.at([rate], state)[0]))
        return value + moved <= SAME * size

    def _first(self, run: observing.Observed, sides: Sides) -> tuple[Point, list[int | ex.Expression]] | None:
        """The state at the first event of a piece that acts, stops or switches, and all events at that time."""
        shares = self.motion.shares(sides)
        events = self.scene.events
        watched: list[tuple[int | ex.Expression, data.Event]] = [*enumerate(events)]
        for u, side in sides.items():
            formula = ex.ONE - shares[u] ** 2 if side == STICKS and u in shares else on_sides(u, sides)
            if side != STICKS or u in shares:
                watched.append((u, data.Event(formula, -side or -1, True)))
        begin, least = run.trajectory.times[0], SAME * abs(self.scene.grid.step)
        motion = replace(self.motion.problem, accelerations=self.motion.forces(sides))
        found = located(run, [event for _, event in watched], lambda: motion)
        later = [one.part(one.times > begin + (least if self.parts else -least)) for one in found]
        pairs = zip(watched, later, strict=True)
        ends = [(kind, one) for (kind, event), one in pairs if (event.acts or event.stops) and len(one.times)]
        first = first_of([one for _, one in ends])
        end = np.inf if first is None else first[0]
        for k, (event, one) in enumerate(zip(events, later, strict=False)):
            if one.note == say("event_always_zero"):
                until = min(end, float(run.trajectory.times[-1]))
                self.still[k] = joined_spans([*self.still.get(k, []), (float(begin), until)])
            elif one.note:
                self.notes[k] = one.note
            if not (event.acts or event.stops):
                self.seen[k].append(one.part(one.times <= end))
        return first and (first, [kind for kind, one in ends if one.times[0] <= end + least])

    def _act(self, state: Point, kinds: Sequence[int | ex.Expression], sides: Sides) -> tuple[Point, Outcome | None]:
        """The state after the events, one after another, and after those that they lead to at the same moment; the
        outcome where they end the run."""
        time, waiting = state[0], [kind for kind in kinds if isinstance(kind, int)]
        for index, event in enumerate(self.scene.events):
            place = self.motion.place_of(event.formula, sides, state)
            if index in waiting:
                self.side[index] = event.direction or -self.side[index] or place.side
            elif not place.at_zero:
                self.side[index] = place.side
        for _ in range(MOST_AT_ONCE):
            if not waiting:
                break
            index = waiting.pop(0)
            event, reached = self.scene.events[index], state
            if event.acts:
                after = (time, *self._after(event, state, sides))
                if not np.isfinite(np.concatenate(after[1:])).all():
                    text = f"what the event {printing.to_text(event.formula)} = 0 sets, which has no value"
                    return after, Outcome("off_domain", None, time, text, None, BEGIN_ELSEWHERE)
                if self._turns_again(index, state, after, sides):
                    self.side[index] = -self.side[index]
                    continue
                if sense := self._sense_held(event, state, after, sides):
                    self.held[index] = sense
                state = after
            self.seen[index].append(Found(event, np.array([time]), reached[1][None], reached[2][None]))
            if sum(len(one.times) for one in self.seen[index]) >= event.most and (event.acts or event.stops):
                note = say("ended_by_event", time) if event.most == 1 else say("many_events", event.most, time)
                return state, Outcome("completed", None, time, note=note)
            if event.acts:
                waiting += self._led_to(index, reached, state, sides, waiting)
        else:
            return state, self._zeno(time, None)
        self.acted.append(time)
        # The time is known only to round-off, so much shorter times have no meaning.
        soon = SOON * max(abs(self.scene.grid.step), abs(time))
        if self.hops > MOST_HOPS or (len(self.acted) > 8 and self.acted[-1] - self.acted[-5] < soon):
            return state, self._zeno(time, None)
        return state, None

    def _turns_again(self, index: int, before: Point, after: Point, sides: Sides) -> bool:
        """Whether an earlier event at this moment has turned back what this one would turn round again."""
        formula, crossed = self.scene.events[index].formula, self.side[index]
        if (old := self.motion.place_of(formula, sides, before)).side != -crossed or not old.at_zero:
            return False
        new = self.motion.place_of(formula, sides, after)
        return new.at_zero and new.side == crossed

    def _led_to(
        self, acted: int, before: Point, after: Point, sides: Sides, waiting: Sequence[int]
    ) -> list[int]:  # fmt: skip
        """The other events whose formula is zero and moves, after the state has changed, to another side than the one
        on which it was: from a zero at rest too."""
        found = []
        for index, event in enumerate(self.scene.events):
            was, new = self.side[index], self.motion.place_of(event.formula, sides, after)
            if index == acted:  # on the side from which it came, if it is at rest there
                self.side[index] = new.side or -was
                self.hops = self.hops + 1 if new.hop < HOP else 0
                continue
            if index in waiting or new.side in (0, was):
                continue
            self.side[index] = new.side
            if event.direction not in (0, new.side):
                continue
            # Without a direction, a formula that was always zero has an event where its side has changed.
            known = event.direction or was or self.motion.place_of(event.formula, sides, before).side != new.side
            if new.at_zero and known:
                found.append(index)
            elif was and not new.at_zero:
                self.notes[index] = say("event_jumped", after[0])
        return found

    def _leaked(self, arrived: Point, sides: Sides) -> bool:
        """Whether the formula of an event that turns the motion back has passed its zero without having been found: the
        motion began at zero, and was pushed through it. Sides are noted."""
        leaked = False
        for index, event in enumerate(self.scene.events):
            place, was = self.motion.place_of(event.formula, sides, arrived), self.side[index]
            if place.at_zero:
                continue
            if event.acts and place.side == event.direction != was and not leaked:
                rate = self.motion.rate(on_sides(event.formula, sides), self.motion.forces(sides))
                turned = (arrived[0], *self._after(event, arrived, sides))
                leaked = event.direction * float(self.motion.at([rate], turned)[0]) <= 0
            self.side[index] = place.side
        return leaked

    def _at_start(self, state: Point, sides: Sides) -> list[int | ex.Expression]:
        """The events at which the motion begins, goes on in their direction, and is turned back: a ball on a floor."""
        motion, least, held = self.motion, NOISE * _size(state), self._sense_held
        acting = [(k, one) for k, one in enumerate(self.scene.events) if one.acts and one.direction]
        zero = [(k, one) for k, one in acting if abs(motion.value(one.formula, sides, state)) <= least]
        onward = [(k, e) for k, e in zero if motion.goes(sides | {e.formula: e.direction}, [e.formula], state)]
        return [k for k, e in onward if held(e, state, (state[0], *self._after(e, state, sides)), sides)]

    def _after(self, event: data.Event, state: Point, sides: Sides) -> tuple[Array, Array]:
        """Position and velocity with what the event sets."""
        whole, names = np.concatenate(state[1:]), nf.state_names(self.scene.coordinates)
        targets = self.motion.at([on_sides(tree, sides) for _, tree in event.sets], state)
        for (target, _), value in zip(event.sets, targets, strict=True):
            whole[names.index(target)] = value
        q, v = np.split(whole, 2)
        if self.scene.constraints and np.isfinite(whole).all():
            given = dict(zip(self.scene.coordinates, map(float, v), strict=True))
            v = initial.initial_velocities(self.scene, self.motion.values, q, given, project=True)
        return q, v

    def _zeno(self, time: float, place: int | None) -> Outcome:
        gap = self.acted[-1] - self.acted[-2] if len(self.acted) > 1 else 0.0
        return Outcome("zeno", place, time, say("zeno"), gap, say("zeno_remedy"))

    def _sense_held(self, event: data.Event, before: Point, after: Point, sides: Sides) -> float:
        """1 or -1: the sense in which the formula reached its zero, if it is still zero and the event has stopped or
        reversed it; 0 elsewhere. The rate is noise where events come ever faster: against the event's own direction it
        shows that this one was not located."""
        own, forces = on_sides(event.formula, sides), self.motion.forces(sides)
        rate = self.motion.rate(own, forces)
        (old,), (value, new) = self.motion.at([rate], before), self.motion.at([own, rate], after)
        sense = float(event.direction or np.sign(old))
        return sense if abs(value) <= AT_ZERO * _size(before) and (sense * new <= 0 or sense * old < 0) else 0.0

    def _fell_through(self, after: Point, until: float) -> bool:
        """Whether the motion passes in the sense in which an event has just turned it back: the next event, sooner
        than can be located, is missed."""
        held, self.held = self.held, {}
        formulas = {k: self.scene.events[k].formula for k in held} if after[0] < until else {}
        return any(held[k] * self.motion.at([formula], after)[0] > 0 for k, formula in formulas.items())

    def _keep(self, ran: Trajectory, count: int) -> None:
        """So many points of a piece, without its start unless it is the first."""
        self.parts.append(ran.part(slice(1 if self.parts else 0, count)))

    def _joined(self, outcome: Outcome, start: data.Start) -> Trajectory:
        parts, grid = self.parts, self.scene.grid
        if not parts:
            return Trajectory.of_start(grid.begin, start.positions, self.scene.velocities, outcome)
        positions = np.concatenate([part.positions for part in parts])
        velocities = np.concatenate([np.asarray(part.velocities) for part in parts])
        times = np.asarray(grid.begin + grid.step * np.arange(len(positions)), dtype=np.float64)
        series = {name: np.concatenate([part.series[name] for part in parts]) for name in parts[0].series}
        spent = {name: sum(getattr(part, name) for part in parts) for name in SPENT}
        whole = Trajectory(times, positions, None, velocities, outcome, series=series, **spent)
        return whole.ended(slice(None), outcome)
