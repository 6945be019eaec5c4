"""Contacts: gaps g_i(t, q) >= 0 with restitution e, friction mu, and sliding velocity u = U v +
u_0.

Impact, wherever gaps are zero and close: one contact after another, the one that closes fastest
first, until none closes; where several are the fastest, each order has to lead to the same
velocities,

    v+ = v + B (G^T L + U^T S),   g'+ = -e g'-,   u+ = 0 if |S| <= mu L, else S = -mu sign(u) L

with G = g_q and B the inverse of the masses on the velocities that constraints leave. Below SLOW
times the velocity that a fall by DEEP gives, e is 0; such contacts rest. At rest

    M a = F + w^T l + G^T L + U^T S,   0 <= L _|_ g'' >= 0,   sticks: u' = 0, |S| <= mu L
                                                              slips:  S = -mu sign(u) L

is asked for all sets of contacts that press, with all ways to slide where u = 0. More than one
motion, or none, ends the run. A touch without a force is no constraint.

The work of an impact is L (g'+ + g'-)/2 + S (u+ + u-)/2. Where an impulse L changes u, too, this law
with friction can make it positive (T. R. Kane, D. A. Levinson, Dynamics, 1985, section 5.8), which
is said of the run.

Sources: F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, 1996; B. Brogliato,
Nonsmooth Mechanics, 2016 (laws for several impacts at once); P. Painleve, C. R. Acad. Sci. 121
(1895) 112 (none, or more than one motion).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions import arrays, calculus, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    accelerations as accelerating,
    numeric_formulas as nf,
    scene_data as data,
)
from inverse_service.simulation.sentences import say

DEEP = 1e-13  # of the size of a motion: how far behind a gap an impact is located
NEAR = 1e-11  # of that size: a gap that is zero, more than the height of a fall from which nothing bounces
STILL = 1e-9  # of the velocities: what does not slide
TIED = 1e-10  # of the velocity of closing: the same one
SLOW = 4.0  # times the velocity that falling by DEEP gives: what closes more slowly comes to rest
CLOSES = 1e-13  # of the velocities: less is none
ROUND_OFF = 1e-9  # of the forces
DEPENDENT = 1e-10  # of rows of size 1: less is none of a further direction
SAME_MOTION = 1e-7  # of the accelerations
MOST_IMPACTS = 200  # of each contact at one moment; then it rests
MOST_WAYS = 4096  # sets of contacts with their ways to slide


class Way(IntEnum):
    """How a contact that presses slides: along `slides`, against it, not at all, or without
    friction.
    """

    BACKWARD = -1
    SMOOTH = 0
    FORWARD = 1
    STICKS = 2


Active = tuple[tuple[int, Way], ...]  # the contacts that press, and how they slide


@dataclass(frozen=True, slots=True)
class Terms:
    """Numbers at m points: masses (m, n, n), forces (m, n), constraints w (m, c, n) with w' v + c'
    (m, c); of k contacts the gaps, g', g'' without accelerations, and u, u' without them (m, k),
    and their slopes G, U (m, k, n).
    """

    masses: Array
    forces: Array
    rows: Array
    drifts: Array
    gaps: Array
    rates: Array
    bends: Array
    slides: Array
    slide_bends: Array
    slopes: Array
    slide_slopes: Array


@dataclass(frozen=True, slots=True)
class Pressed:
    """Accelerations (m, n), normal forces and friction (m, k), 0 where there is no contact."""

    accelerations: Array
    normal: Array
    friction: Array


class Impulse(NamedTuple):
    """The change of the velocities by one impact, (n,), and the impulses L and S."""

    change: Array
    normal: float
    friction: float


class InTurn(NamedTuple):
    """The velocities after impacts in turn, the impacts of each contact, whether several were the
    fastest to close, and the contacts whose impacts did positive work.
    """

    velocities: Array
    counts: NDArray[np.int64]
    tied: bool
    gained: frozenset[int]


@dataclass(frozen=True, slots=True)
class Impacts:
    """What all impacts at one moment leave: the state, the contacts that touch and do not open
    then, how many impacts each had, (k,), whether another order of those that close equally fast
    leaves the same, and the contacts whose impacts did positive work.
    """

    state: data.Point
    resting: tuple[int, ...]
    counts: NDArray[np.int64]
    is_one: bool = True
    gained: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Scale:
    """The greatest position and velocity of a motion so far, its step, and the greatest
    acceleration of a gap and force that it would have without contacts.
    """

    farthest: float
    fastest: float
    step: float
    fall: float = 0.0
    force: float = 0.0

    @property
    def size(self) -> float:
        return self.farthest + self.step * self.fastest

    @property
    def deep(self) -> float:
        return DEEP * self.size

    @property
    def least(self) -> float:
        """The velocity that is none."""
        return CLOSES * self.fastest

    def with_state(self, state: data.Point, contacts: Contacts) -> Scale:
        """What a step of falling gives counts too, so that bodies at rest have a scale, also
        where a force begins at 0.
        """
        pushes = contacts.pushes(state, self.step)
        fall, force = (max(one) for one in zip(pushes, (self.fall, self.force), strict=True))
        farthest, fastest = (float(np.abs(one).max()) for one in state[1:])
        fastest = max(self.fastest, fastest, self.step * fall)
        return Scale(max(self.farthest, farthest), fastest, self.step, fall, force)


@dataclass(frozen=True)
class Contacts:
    """The contacts of a scene with its Lagrangian; of given equations with mass 1. `forces` (n,)
    are M q'' without contacts and constraints; `numbers` gives names in them their values at
    points.
    """

    scene: data.Scene
    values: Mapping[str, float]
    forces: tuple[ex.Expression, ...]
    numbers: Callable[[Array, Array, Array], Mapping[ex.Expression, Array]] | None = None

    @property
    def count(self) -> int:
        return len(self.scene.contacts)

    @cached_property
    def masses(self) -> tuple[tuple[ex.Expression, ...], ...]:
        """(n, n)"""
        names = self.scene.coordinates
        if self.scene.lagrangian is None:
            return tuple(
                tuple(ex.number(int(i == k)) for k in range(len(names))) for i in range(len(names))
            )
        return euler_lagrange.hessian(self.scene.lagrangian, names)

    @cached_property
    def rates(self) -> tuple[ex.Expression, ...]:
        """g' of each contact."""
        names = self.scene.coordinates
        return tuple(
            accelerating.rate(one.gap, names, [ex.ZERO] * len(names)) for one in self.scene.contacts
        )

    @cached_property
    def slides(self) -> tuple[ex.Expression, ...]:
        """u of each contact, 0 where it has no friction."""
        return tuple(one.slides if one.friction else ex.ZERO for one in self.scene.contacts)

    @cached_property
    def _formulas(self) -> tuple[ex.Expression, ...]:
        names, scene = self.scene.coordinates, self.scene
        still = [ex.ZERO] * len(names)

        def bends(trees: Iterable[ex.Expression]) -> list[ex.Expression]:
            return [accelerating.rate(tree, names, still) for tree in trees]

        def slopes(trees: Iterable[ex.Expression]) -> list[ex.Expression]:
            return [
                calculus.differentiate(tree, ex.Velocity(name)) for tree in trees for name in names
            ]

        gaps = [one.gap for one in scene.contacts]
        return (
            *(entry for row in self.masses for entry in row), *self.forces, *slopes(scene.constraints),
            *bends(scene.constraints), *gaps, *self.rates, *bends(self.rates), *self.slides, *bends(self.slides),
            *slopes(self.rates), *slopes(self.slides),
        )  # fmt: skip

    def at(self, times: Array, positions: Array, velocities: Array) -> Terms:
        """The numbers at these points."""
        n, c, k, m = (
            len(self.scene.coordinates),
            len(self.scene.constraints),
            self.count,
            len(times),
        )
        table = nf.arrays_by_name(
            self.scene.coordinates, positions, velocities, dict(self.values), times
        )
        if self.numbers is not None:
            table |= self.numbers(times, positions, velocities)
        values = np.array(arrays.array_values(self._formulas, table)).reshape(-1, m).T
        shapes = ((n, n), (n,), (c, n), (c,), *((k,),) * 5, (k, n), (k, n))
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(values, ends[:-1], axis=1)
        return Terms(*(part.reshape(m, *shape) for part, shape in zip(parts, shapes, strict=True)))

    def pressed(self, terms: Terms, active: Active) -> Pressed:
        """The motion where these contacts press."""
        (m, n), c = terms.forces.shape, terms.rows.shape[1]
        which = [i for i, _ in active]
        sticking = [i for i, way in active if way == Way.STICKS]
        friction = np.array(
            [self.scene.contacts[i].friction * way * (way != Way.STICKS) for i, way in active]
        )
        pulls = terms.slopes[:, which] - friction[:, None] * terms.slide_slopes[:, which]
        rows = np.concatenate(
            [terms.rows, terms.slopes[:, which], terms.slide_slopes[:, sticking]], axis=1
        )
        along = np.concatenate([terms.rows, pulls, terms.slide_slopes[:, sticking]], axis=1)
        size = n + rows.shape[1]
        whole, right = np.zeros((m, size, size)), np.empty((m, size))
        whole[:, :n, :n], whole[:, n:, :n], whole[:, :n, n:] = (
            terms.masses,
            rows,
            -along.transpose(0, 2, 1),
        )
        right[:, :n], right[:, n : n + c] = terms.forces, -terms.drifts
        right[:, n + c :] = -np.concatenate(
            [terms.bends[:, which], terms.slide_bends[:, sticking]], axis=1
        )
        found = np.linalg.solve(whole, right[:, :, None])[
            :, :, 0
        ]  # LinAlgError where they depend on one another
        normal, tangential = np.zeros((m, self.count)), np.zeros((m, self.count))
        normal[:, which] = found[:, n + c : n + c + len(which)]
        tangential[:, which] = -friction * normal[:, which]
        tangential[:, sticking] = found[:, n + c + len(which) :]
        return Pressed(found[:, :n], normal, tangential)

    def pushes(self, state: data.Point, step: float) -> tuple[float, float]:
        """The greatest acceleration of a gap, and force, without contacts, now and a step later."""
        time, q, v = state
        terms = self.at(np.array([time, time + step]), np.stack([q, q]), np.stack([v, v]))
        greatest = 0.0
        for k in range(2):
            a = np.linalg.lstsq(terms.masses[k], terms.forces[k], rcond=None)[0]
            gaps = np.abs(terms.slopes[k]) @ np.abs(a) + np.abs(terms.bends[k])
            greatest = max(greatest, float(gaps.max(initial=0.0)))
        return greatest, float(np.abs(terms.forces).max(initial=0.0))

    def before_overlap(self, state: data.Point, active: Active, scale: Scale) -> data.Point:
        """The state at the moment at which the gaps that are overlapped by less than NEAR, and
        close, were zero.
        """
        terms = self._of(state)
        gaps, rates = terms.gaps[0], terms.rates[0]
        closing = (gaps < 0) & (gaps >= -NEAR * scale.size) & (rates < -scale.least)
        late = float((gaps[closing] / rates[closing]).max(initial=0.0))
        if late > NEAR * scale.step:  # so slow that it comes to rest there
            return state
        accelerations = self.pressed(terms, active).accelerations[0]
        return state[0] - late, state[1] - late * state[2], state[2] - late * accelerations

    def stopped(self, state: data.Point, which: Sequence[int]) -> data.Point:
        """The state where these contacts do not slide, nor open or close."""
        terms = self._of(state)
        lift = _on_constraints(terms.masses[0], terms.rows[0])
        rows = np.concatenate([terms.slide_slopes[0, which], terms.slopes[0, which]])
        amounts = np.concatenate([terms.slides[0, which], terms.rates[0, which]])
        return state[0], state[1], state[2] - _projection(lift, rows, amounts)

    def impact(self, state: data.Point, scale: Scale) -> Impacts:
        """All impacts at this moment."""
        time, q, begun = state[0], state[1].copy(), state[2]
        terms = self._of(state)
        touching = [int(i) for i in np.flatnonzero(terms.gaps[0] <= NEAR * scale.size)]
        if not touching:
            return Impacts(state, (), np.zeros(self.count, dtype=np.int64))
        lift = _on_constraints(terms.masses[0], terms.rows[0])
        deep = [i for i in touching if terms.gaps[0, i] < 0]
        if deep:  # back to the surface, in the metric of the kinetic energy: by DEEP at most, or by round-off
            q -= _projection(lift, terms.slopes[0, deep], terms.gaps[0, deep])
            terms = self._of((time, q, begun))
        slow = SLOW * float(np.sqrt(2 * scale.fall * scale.deep)) + scale.least
        found = self._in_turn(terms, lift, begun, touching, scale, slow)
        v, is_one = found.velocities, True
        if found.tied:
            other = self._in_turn(terms, lift, begun, touching[::-1], scale, slow)
            is_one = float(np.abs(v - other.velocities).max()) <= STILL * scale.fastest
        offsets = terms.rates[0] - terms.slopes[0] @ begun
        belts = terms.slides[0] - terms.slide_slopes[0] @ begun
        closing = {i: float(terms.slopes[0, i] @ v + offsets[i]) for i in touching}
        resting = [i for i in touching if abs(closing[i]) <= slow]
        if resting:
            # Small jumps that are left out had as much friction for their impulses as what presses
            # in the meantime has, but for that of the velocity taken away here.
            slides = terms.slide_slopes[0, resting] @ v + belts[resting]
            slipping = np.sign(slides) * (np.abs(slides) > STILL * scale.fastest)
            weights = np.array([self.scene.contacts[i].friction for i in resting]) * slipping
            rows = terms.slopes[0, resting]
            pulls = rows - weights[:, None] * terms.slide_slopes[0, resting]
            v -= _projection(lift, rows, np.array([closing[i] for i in resting]), pulls)
        return Impacts((time, q, v), tuple(resting), found.counts, is_one, found.gained)

    def _in_turn(
        self, terms: Terms, lift: Array, begun: Array, touching: Sequence[int], scale: Scale, slow: float
    ) -> InTurn:  # fmt: skip
        """The velocities after one impact after another, how many each contact had, and whether
        several were the fastest to close: the first of `touching` is then the next.
        """
        v, counts, tied = begun.copy(), np.zeros(self.count, dtype=np.int64), False
        gained = set[int]()
        offsets = terms.rates[0] - terms.slopes[0] @ v
        belts = terms.slides[0] - terms.slide_slopes[0] @ v
        most = MOST_IMPACTS * len(touching)
        for turn in range(2 * most):
            closing = {i: float(terms.slopes[0, i] @ v + offsets[i]) for i in touching}
            fastest = min(closing.values())
            if fastest >= -scale.least:
                break
            first, *others = (i for i in touching if closing[i] <= (1 - TIED) * fastest)
            tied = tied or bool(others)
            contact, rests = self.scene.contacts[first], -closing[first] <= slow or turn >= most
            slope, slide = terms.slopes[0, first], terms.slide_slopes[0, first]
            slides = float(slide @ v + belts[first])
            by = _impulse(
                lift, slope, slide, closing[first], slides,
                0.0 if rests else contact.restitution, contact.friction,
            )  # fmt: skip
            v += by.change
            counts[first] += not rests
            works = (
                by.normal * (closing[first] + slope @ by.change / 2),
                by.friction * (slides + slide @ by.change / 2),
            )
            if not rests and sum(works) > STILL * max(map(abs, works)):
                gained.add(first)
        return InTurn(v, counts, tied, frozenset(gained))

    def motions(
        self, state: data.Point, resting: Sequence[int], slipped: Sequence[int], scale: Scale
    ) -> list[Active]:  # fmt: skip
        """The sets of these contacts that can press there, one for each motion that goes on; those
        that have just `slipped` do not stick.
        """
        terms, fastest = self._of(state), scale.fastest
        ways = [self._ways(i, float(terms.slides[0, i]), fastest, i in slipped) for i in resting]
        rough = [i for i, own in zip(resting, ways, strict=True) if Way.STICKS in own]
        if len(rough) > 1 and not _are_independent(terms, resting, rough):
            # What others hold needs no friction: a rod that lies on two supports.
            ways = [[own[0], Way.SMOOTH, *own[1:]] if Way.STICKS in own else own for own in ways]
        if np.prod([1 + len(one) for one in ways]) > MOST_WAYS:
            return []
        found: list[tuple[Active, Array]] = []
        for count in range(len(resting), -1, -1):
            for places in combinations(range(len(resting)), count):
                for how in product(*(ways[place] for place in places)):
                    active = tuple(
                        (resting[place], way) for place, way in zip(places, how, strict=True)
                    )
                    a = self._accelerations(terms, active, resting, scale)
                    near = SAME_MOTION * scale.fall
                    if a is not None and not any(
                        (np.abs(a - other) <= near).all() for _, other in found
                    ):
                        found.append((active, a))
        return [active for active, _ in found]

    def _ways(self, i: int, slides: float, fastest: float, slipped: bool) -> list[Way]:
        if not self.scene.contacts[i].friction:
            return [Way.SMOOTH]
        if abs(slides) > STILL * fastest:
            return [Way.FORWARD if slides > 0 else Way.BACKWARD]
        return [Way.FORWARD, Way.BACKWARD] if slipped else [Way.STICKS, Way.FORWARD, Way.BACKWARD]

    def _accelerations(
        self, terms: Terms, active: Active, resting: Sequence[int], scale: Scale
    ) -> Array | None:
        """The accelerations if the laws hold where these contacts press, else None."""
        sticking = [i for i, way in active if way == Way.STICKS]
        if not _are_independent(terms, [i for i, _ in active], sticking):
            return None  # fewer of them have the same motion
        try:
            one = self.pressed(terms, active)
        except np.linalg.LinAlgError:
            return None
        a, noise, least = one.accelerations[0], ROUND_OFF * scale.force, ROUND_OFF * scale.fall
        if not np.isfinite(a).all():
            return None
        opening = terms.slopes[0] @ a + terms.bends[0]
        for i, way in active:
            normal, mu = one.normal[0, i], self.scene.contacts[i].friction
            if not normal > noise:
                return None
            slope, bend = terms.slide_slopes[0, i], terms.slide_bends[0, i]
            if way == Way.STICKS and abs(one.friction[0, i]) > mu * normal + noise:
                return None
            is_slow = abs(terms.slides[0, i]) <= STILL * scale.fastest
            if way in (Way.FORWARD, Way.BACKWARD) and is_slow and way * (slope @ a + bend) < -least:
                return None
            if way == Way.SMOOTH and mu and abs(slope @ a + bend) > least:
                return None
        pressing = {i for i, _ in active}
        open_ = all(opening[i] >= -least for i in resting if i not in pressing)
        return a if open_ else None

    def rows(
        self, active: Active
    ) -> tuple[tuple[ex.Expression, ...], tuple[tuple[ex.Expression, ...], ...]]:
        """What is zero and linear in the velocities while these press, and the directions of its
        forces, (n,) each.
        """
        names, contacts = self.scene.coordinates, self.scene.contacts
        zero, pulls = [], []
        for i, way in active:
            zero.append(self.rates[i])
            slopes = euler_lagrange.momenta(self.rates[i], names)
            if way in (Way.FORWARD, Way.BACKWARD):
                weight = ex.number(way) * contacts[i].weight
                along = euler_lagrange.momenta(self.slides[i], names)
                slopes = tuple(a - weight * b for a, b in zip(slopes, along, strict=True))
            pulls.append(slopes)
        for i, way in active:
            if way == Way.STICKS:
                zero.append(self.slides[i])
                pulls.append(euler_lagrange.momenta(self.slides[i], names))
        return tuple(zero), tuple(pulls)

    def _of(self, state: data.Point) -> Terms:
        return self.at(np.array([state[0]]), state[1][None], state[2][None])


def forces_of(scene: data.Scene) -> tuple[ex.Expression, ...]:
    """L_q - L_vq v - L_vt + Q, (n,); the accelerations given, of a system without a Lagrangian."""
    if scene.lagrangian is None:
        return scene.accelerations or ()
    names = scene.coordinates
    own = tuple(
        -e
        for e in euler_lagrange.euler_lagrange_sums(scene.lagrangian, names, [ex.ZERO] * len(names))
    )
    return tuple(map(ex.add, own, scene.forces)) if scene.forces else own


def _are_independent(terms: Terms, pressing: Sequence[int], sticking: Sequence[int]) -> bool:
    """Whether the rows of constraints, gaps and what sticks are, so that each has one force."""
    rows = np.concatenate(
        [terms.rows[0], terms.slopes[0, [*pressing]], terms.slide_slopes[0, [*sticking]]]
    )
    sizes = np.abs(rows).max(axis=1, initial=0.0, keepdims=True)
    if not (sizes > 0).all():
        return False
    return bool(np.linalg.matrix_rank(rows / sizes, DEPENDENT) == len(rows))


def _on_constraints(masses: Array, rows: Array) -> Array:
    """M^-1 - M^-1 w^T (w M^-1 w^T)^-1 w M^-1, (n, n): velocities by impulses."""
    inverse: Array = np.asarray(np.linalg.inv(masses), dtype=np.float64)
    if not len(rows):
        return inverse
    lifted = inverse @ rows.T
    return np.asarray(inverse - lifted @ np.linalg.pinv(rows @ lifted) @ lifted.T, dtype=np.float64)


def _projection(lift: Array, rows: Array, amounts: Array, pulls: Array | None = None) -> Array:
    """The change of a state, (n,), that takes these amounts from the rows, along `pulls`."""
    along = rows if pulls is None else pulls
    found: Array = lift @ along.T @ np.linalg.lstsq(rows @ lift @ along.T, amounts, rcond=1e-12)[0]
    return found


def _impulse(
    lift: Array, slope: Array, slide: Array, closing: float, slides: float, restitution: float, friction: float
) -> Impulse:  # fmt: skip
    """One impact; Unavailable where the contact slides along its own gap."""
    a, b, c = slope @ lift @ slope, slope @ lift @ slide, slide @ lift @ slide
    jump = -(1 + restitution) * closing
    normal, tangential = jump / a, 0.0
    if friction and c > 0:
        if a * c - b * b <= DEPENDENT**2 * a * c:
            raise data.Unavailable(say("slides_along_gap"))
        normal, tangential = np.linalg.solve(np.array([[a, b], [b, c]]), [jump, -slides])
        if abs(tangential) > friction * normal:
            sign = np.sign(slides) or -np.sign(tangential)
            normal = jump / (a - friction * sign * b)
            tangential = -friction * sign * normal
    change = np.asarray(lift @ (slope * normal + slide * tangential), dtype=np.float64)
    return Impulse(change, float(normal), float(tangential))
