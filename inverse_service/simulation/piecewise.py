"""Motions in pieces: events that act on the state, contacts, and switches of sign, abs and pieces.

A piece is smooth, and is run by the method itself to the first event, which `events` locates. Each
step of the machine leads from a position to the next one, or to an end:

    advance: integrate a piece of so many steps of the grid, or a part of one
    shorten: the method refused; half of the way, as a switch may be before its end
    pass_switch: what follows the first passage of a switch is cut off
    act: events, impacts, and all that they lead to at the same moment, until none acts; then the
        sides of the switches and the contacts that press are chosen for what follows
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from fractions import Fraction

import numpy as np

from inverse_service.expressions import arrays, printing, tree as ex
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    contacts as touching,
    derivation,
    execution,
    initial,
    numeric_formulas as nf,
    observing,
    scene_data as data,
)
from inverse_service.simulation.events import (
    CONTINUED,
    Found,
    event_of_parts,
    first_of,
    located,
    nowhere,
)
from inverse_service.simulation.scene_data import Point
from inverse_service.simulation.sentences import say
from inverse_service.simulation.switching import (
    AT_ZERO,
    NOISE,
    SAME,
    STICKS,
    Motion,
    Sides,
    on_sides,
    share_of,
    size_of,
    switches_of,
)

FIRST, MOST = 16, 4096  # steps of a piece that is looked at for events at once
AT_ONCE = 1e-12  # of a step: events at one time
HOP, MOST_HOPS = (
    1e-15,
    8,
)  # of the size of a formula: what it rises between two events at rest; so often in a row
MOST_AT_ONCE = 1000  # events at one moment
SOON = 1e-10  # of a step or of the time: events closer than this are taken to accumulate
MOST_CHANGES = 100_000  # of contacts in a run
MOST_CHOICES = 8  # of sides and pressing contacts, one after the other, until they agree
SPENT = (
    "force_evaluations",
    "newton_iterations",
    "compile_seconds",
    "run_seconds",
)  # by the parts of a run
MOST_TRIES = 64  # shorter steps up to a switch where the formulas of one side end behind it
BEGIN_ELSEWHERE = "begin elsewhere"
ENDS_BEYOND = (
    "singular",
    "not_finite",
    "off_domain",
    "no_convergence",
)  # of a step that may lead beyond a switch


@dataclass(frozen=True, slots=True)
class Switch:
    """At time t a switching function passed to a side: 1, -1, or 0 if it sticks."""

    function: ex.Expression
    time: float
    side: int


@dataclass(frozen=True, slots=True)
class Touched:
    """What a contact did in a run: its impacts, the spans of time in which it pressed, and its
    greatest force.
    """

    name: str
    impacts: int
    rests: tuple[tuple[float, float], ...]
    greatest_force: float


@dataclass(frozen=True, slots=True)
class Run:
    """The run of a method; where it is `in_pieces`, with velocities at its points, no momenta, the
    events and switches on the way, what the contacts did, and the state at the end.
    """

    trajectory: Trajectory
    in_pieces: bool = False
    events: tuple[Found, ...] = ()
    switches: tuple[Switch, ...] = ()
    final: Point | None = None
    contacts: tuple[Touched, ...] = ()


@dataclass(frozen=True, slots=True)
class Position:
    """Where a run is: at a state behind the point `place` of the grid, on these sides, with these
    contacts pressing.

    `begun` is the start of the method where it has made no step; the next piece has `count` steps,
    or a `share` of one after so many `tries`, since the method `refused` with an outcome at a
    state.
    """

    place: int
    state: Point
    sides: Sides
    active: touching.Active = ()
    begun: data.Start | None = None
    count: int = FIRST
    share: float = 1.0
    tries: int = 0
    refused: tuple[Outcome, Point] | None = None


class End(Enum):
    """Why a run ends."""

    COMPLETED = auto()
    STOPPED = auto()  # by an event
    CANCELLED = auto()
    ZENO = auto()
    NO_ONE_MOTION = auto()
    METHOD = auto()  # it cannot continue


@dataclass(frozen=True, slots=True)
class Ended:
    why: End
    outcome: Outcome
    state: Point


@dataclass(frozen=True, slots=True)
class Piece:
    """What a method made from a position: its points, and the run with what is needed to follow it
    between them.
    """

    ran: Trajectory
    observed: observing.Observed
    ahead: float

    @property
    def velocities(self) -> Array:
        assert self.ran.velocities is not None
        return self.ran.velocities

    def point(self, row: int) -> Point:
        return float(self.ran.times[row]), self.ran.positions[row], self.velocities[row]

    def until(self, count: int) -> Piece:
        """Its first `count` points."""
        if count >= len(self.ran.times):
            return self
        observed = replace(self.observed, trajectory=self.observed.trajectory.part(slice(count)))
        ran = replace(self.ran.part(slice(count)), outcome=Outcome("completed"))
        return replace(self, ran=ran, observed=observed)


class Change(Enum):
    """How a contact ends a piece."""

    CLOSES = auto()
    OPENS = auto()
    SLIPS = auto()
    STICKS = auto()


@dataclass(frozen=True, slots=True)
class Contacting:
    """A contact ends a piece."""

    change: Change
    contact: int


Kind = (
    int | ex.Expression | Contacting
)  # an event of the scene by its place, a switching function, or a contact


def _slack(motion: Motion, u: ex.Expression, sides: Sides) -> data.Measure:
    """1 - s^2 of a function that sticks, which is released where it falls through 0."""

    def measure(times: Array, positions: Array, velocities: Array) -> Array:
        return np.asarray(1.0 - motion.shares_at(sides, times, positions, velocities)[u] ** 2)

    return measure


def joined_spans(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans of time, in order, each joined to the one before where that ends at its begin."""
    found: list[tuple[float, float]] = []
    for begin, end in spans:
        if found and begin <= found[-1][1] + SAME * (1 + abs(begin)):
            begin, _ = found.pop()
        found.append((begin, end))
    return found


def has_pieces(scene: data.Scene, problem: data.Problem) -> bool:
    """Whether a run of this problem consists of pieces. A Lagrangian found for given equations is
    valid on one side, and its run ends there.
    """
    if scene.contacts or any(event.acts or event.most > 1 for event in scene.events):
        return True
    return bool(switches_of(problem, scene)) and not (
        scene.accelerations and problem.free_lagrangian is not None
    )


def run_motion(
    derived: derivation.Derived, requested: data.Requested, problem: data.Problem, start: data.Start,
    values: Mapping[str, float],
) -> Run:  # fmt: skip
    """The run of a method with what the scene observes at every step, in pieces where it has
    some.
    """
    scene = derived.scene

    def integrate(
        what: data.Problem, by: data.MethodChoice, begin: data.Start, grid: data.Grid
    ) -> Trajectory:
        own, observation = observing.observed_problem(scene, what, by)
        return execution.run(own, by, begin, grid, values, observation, derived.stop)

    if not has_pieces(scene, problem):
        return Run(integrate(problem, requested.choice, start, scene.grid))
    formulas = Motion(scene, values, problem, switches_of(problem, scene))
    if scene.contacts:
        formulas.contacts = touching.Contacts(scene, values, touching.forces_of(scene))
    every_point = replace(scene, grid=replace(scene.grid, record_every=1))
    run = _Pieces(every_point, requested, formulas, integrate, derived.stop).go(start)
    return replace(
        run, trajectory=run.trajectory.thinned(scene.grid.steps, scene.grid.record_every)
    )


@dataclass
class _Pieces:
    """The machine, with what has been seen on the way."""

    scene: data.Scene
    requested: data.Requested
    whole: Motion
    integrate: Callable[[data.Problem, data.MethodChoice, data.Start, data.Grid], Trajectory]
    stop: data.Stop | None

    def __post_init__(self) -> None:
        self.parts: list[Trajectory] = []
        size = len(self.scene.coordinates)
        self.seen: list[list[Found]] = [[nowhere(event, size)] for event in self.scene.events]
        self.notes: dict[int, str] = {}
        self.still: dict[
            int, list[tuple[float, float]]
        ] = {}  # when a formula was zero within round-off
        self.hops = 0  # events in a row between which nothing rises
        self.switches: list[Switch] = []
        self.acted: list[float] = []
        self.settled: set[ex.Expression] = (
            set()
        )  # functions whose sides at the last event are known
        self.held: dict[
            int, float
        ] = {}  # the sense in which each event was reached that turned the motion back
        self.side = [0] * len(
            self.scene.events
        )  # on which each formula was when it was last not at zero
        self.impacts = np.zeros(len(self.scene.contacts), dtype=np.int64)
        self.gained = set[int]()  # contacts whose impacts did positive work
        self.rests: list[list[tuple[float, float]]] = [[] for _ in self.scene.contacts]
        self.greatest = np.zeros(len(self.scene.contacts))
        self.changes = 0
        self.resting: tuple[
            int, ...
        ] = ()  # contacts that touch and do not open, after the last change
        q, v = np.abs(self.scene.positions), np.abs(self.scene.velocities)
        self.scale = touching.Scale(float(q.max()), float(v.max()), abs(self.scene.grid.step))

    def go(self, start: data.Start) -> Run:
        found = self.begin(start)
        while isinstance(found, Position):
            found = self.step(found)
        whole = self._joined(self._with_gains(found.outcome), start)
        events = tuple(
            event_of_parts(parts, self._note_of(k, whole)) for k, parts in enumerate(self.seen)
        )
        self._note_rests((), float(whole.times[-1]))
        contacts = tuple(
            Touched(one.name, int(self.impacts[k]), tuple(self.rests[k]), float(self.greatest[k]))
            for k, one in enumerate(self.scene.contacts)
        )
        return Run(whole, True, events, tuple(self.switches), found.state, contacts)

    def _with_gains(self, outcome: Outcome) -> Outcome:
        """What is doubted of a run in which impacts won energy."""
        if not self.gained:
            return outcome
        names = ", ".join(self.scene.contacts[i].name for i in sorted(self.gained))
        doubts = filter(None, (outcome.doubt, say("impacts_gain", names)))
        return replace(outcome, doubt=" ".join(doubts))

    def begin(self, start: data.Start) -> Position | Ended:
        """The first position, after what happens at the start."""
        state: Point = (
            self.scene.grid.begin, np.array(start.positions, dtype=float), np.array(start.velocities, dtype=float),
        )  # fmt: skip
        if (sides := self._sides(self.whole, state, {}, self._zeros(state, {}))) is None:
            return self._no_one_motion(0, state)
        position = Position(0, state, sides, begun=start)
        self.side = [
            self.whole.place_of(event.formula, sides, state).side for event in self.scene.events
        ]
        kinds = self._at_start(position)
        if not kinds and not self.scene.contacts:
            return position
        reached, ended = self._settled(position, state, kinds)
        if ended is not None:
            return Ended(ended.why, replace(ended.outcome, step=0), reached)
        is_same = all(
            np.array_equal(old, new) for old, new in zip(state[1:], reached[1:], strict=True)
        )
        zero = self._zeros(reached, sides)
        chosen = self._chosen(position, reached, zero if kinds else [], ())
        if chosen is None:
            return self._no_one_motion(0, reached, self.resting)
        return replace(
            position,
            state=reached,
            sides=chosen[0],
            active=chosen[1],
            begun=start if is_same else None,
        )

    def step(self, position: Position) -> Position | Ended:
        """The next position."""
        grid, state = self.scene.grid, position.state
        if position.place >= grid.steps:
            end = grid.begin + grid.steps * grid.step
            return Ended(End.COMPLETED, Outcome("completed", grid.steps, end), state)
        if self.stop is not None and self.stop():
            return Ended(End.CANCELLED, Outcome("cancelled", position.place, state[0]), state)
        piece = self.advance(position)
        if isinstance(piece, Outcome):
            return self.shorten(position, piece)
        piece = self.with_gaps(piece)
        if isinstance(piece, Outcome):
            return self.shorten(position, piece)
        if (turned := self._turned(position, piece)) is not None:
            return replace(position, sides=turned)
        piece = self.pass_switch(position, piece)
        found = self._first(position, piece)
        until = np.inf if found is None else found[0][0]
        if self._fell_through(piece.point(1), until) or (
            found is None and self._leaked(position, piece.point(-1))
        ):
            return self._zeno(state, position.place)
        return self.go_on(position, piece) if found is None else self.act(position, piece, *found)

    def motion(self, position: Position) -> Motion:
        return self.whole.pressed_by(position.active, self.scale.fall)

    def advance(self, position: Position) -> Piece | Outcome:
        """A piece from a position; the outcome where the method makes no step."""
        scene, grid, (begin, q, v) = self.scene, self.scene.grid, position.state
        # If a piece begins between two grid points, first step to the next one; then take many
        # steps at once.
        ahead = grid.begin + (position.place + 1) * grid.step - begin
        between = abs(ahead - grid.step) > SAME * (abs(grid.step) + abs(begin))
        many = (
            1 if between or position.share < 1 else min(position.count, grid.steps - position.place)
        )
        own = data.Grid(position.share * (ahead if between else grid.step), many, 1, begin)
        stuck, method = STICKS in position.sides.values(), self.requested.method
        # What sticks has formulas of its own, and the forces of contacts are unknowns of explicit
        # methods.
        by_forces = (stuck and method not in method_table.POINT_METHODS) or (
            bool(position.active) and method not in method_table.EXPLICIT
        )
        choice = CONTINUED if by_forces else self.requested.choice
        what = self.motion(position).problem_on(position.sides, by_forces)
        ran = self.integrate(what, choice, position.begun or data.Start(q, v), own)
        if len(ran.times) < 2:
            return ran.outcome
        observed = observing.Observed(
            replace(scene, grid=own), replace(self.requested, choice=choice,
            alpha=None if by_forces else self.requested.alpha), ran, what, self.whole.values, None,
        )  # fmt: skip
        if (velocities := observed.velocities) is None:
            raise data.Unavailable("The method has no velocities at its points, which events need.")
        return Piece(replace(ran, velocities=velocities, momenta=None), observed, ahead)

    def shorten(self, position: Position, outcome: Outcome) -> Position | Ended:
        """Half of the way, where a switch may be before the point at which the method refused."""
        refused, tries = position.refused or (outcome, position.state), position.tries + 1
        if (
            (self.whole.functions or self.scene.contacts)
            and outcome.kind in ENDS_BEYOND
            and tries < MOST_TRIES
        ):
            return replace(position, refused=refused, share=position.share / 2, tries=tries)
        first, state = refused
        return Ended(End.METHOD, replace(first, step=position.place, time=state[0]), state)

    def pass_switch(self, position: Position, piece: Piece) -> Piece:
        """The piece up to the first point beyond a switch: what follows is no motion, and may end
        where none can be followed.
        """
        ran, motion = piece.ran, self.whole
        table = nf.arrays_by_name(
            self.scene.coordinates, ran.positions, piece.velocities, motion.values, ran.times
        )
        values = [side * arrays.array_value(on_sides(u, position.sides), table)
                  for u, side in position.sides.items() if side]  # fmt: skip
        passed = (
            np.any([value[1:] < 0 for value in values], axis=0)
            if values
            else np.zeros(1, dtype=bool)
        )
        if not passed.any():
            return piece
        return piece.until(int(passed.argmax()) + 2)

    def with_gaps(self, piece: Piece) -> Piece | Outcome:
        """The piece up to the last point at which all gaps have values; the outcome where there is
        none after its start. That a gap closes before it ends would not be seen.
        """
        ran = piece.ran
        table = nf.arrays_by_name(
            self.scene.coordinates, ran.positions, piece.velocities, self.whole.values, ran.times
        )
        for contact in self.scene.contacts:
            lost = ~np.isfinite(arrays.array_value(contact.gap, table))
            if lost[:2].any():
                text = say("gap_without_value", contact.name)
                return Outcome("off_domain", None, float(ran.times[0]), text, None, BEGIN_ELSEWHERE)
            if lost.any():
                piece = piece.until(int(lost.argmax()))
        return piece

    def go_on(self, position: Position, piece: Piece) -> Position | Ended:
        """The position at the end of a piece in which nothing happens."""
        ran, arrived, grid = piece.ran, piece.point(-1), self.scene.grid
        motion, sides = self.motion(position), position.sides
        away = min(
            (side * motion.value(u, sides, arrived) for u, side in sides.items()), default=0.0
        )
        if away < -AT_ZERO * self._size(
            arrived
        ):  # it left a zero at which it began, to the other side
            return self._no_one_motion(position.place, position.state)
        if position.share < 1:
            self._keep(position, piece, 1)
            return replace(position, state=arrived, tries=position.tries + 1, begun=None)
        self._keep(position, piece, len(ran.times))
        place = position.place + len(ran.times) - 1
        state = (grid.begin + place * grid.step, *arrived[1:])
        if not (ran.outcome.completed or ran.outcome.kind in ENDS_BEYOND):
            return Ended(End.METHOD, replace(ran.outcome, step=place, time=state[0]), state)
        return replace(
            position, place=place, state=state, count=min(2 * position.count, MOST), begun=None
        )

    def act(
        self, position: Position, piece: Piece, state: Point, kinds: list[Kind]
    ) -> Position | Ended:
        """The position after all events at the first moment of a piece at which there is one."""
        grid, ran = self.scene.grid, piece.ran
        if STICKS in position.sides.values() and not np.isfinite(np.concatenate(state[1:])).all():
            return self._no_one_motion(position.place, position.state)  # nothing holds it there
        if any(isinstance(one, Contacting) and one.change == Change.CLOSES for one in kinds):
            state = self._contacts_of(position).before_overlap(state, position.active, self.scale)
        row = max(1, int((ran.times < state[0] - AT_ONCE * abs(grid.step)).sum()))
        self._keep(position, piece, row)
        place, count = position.place + row - 1, max(FIRST // 2, 2 * row)
        reached, ended = self._settled(position, state, kinds)
        zero = [one for one in kinds if isinstance(one, ex.Expression)]
        slipped = [
            one.contact
            for one in kinds
            if isinstance(one, Contacting) and one.change == Change.SLIPS
        ]
        chosen = None if ended is not None else self._chosen(position, reached, zero, slipped)
        here = grid.begin + (place + 1) * grid.step
        if abs(reached[0] - here) <= AT_ONCE * (abs(grid.step) + abs(here)) and row < len(
            ran.times
        ):
            # The event is at a grid point, which is recorded with the state after the event.
            at = replace(
                ran.part(slice(row, row + 1)),
                positions=reached[1][None],
                velocities=reached[2][None],
            )
            sides, active = chosen or (position.sides, ())
            self._record(replace(position, sides=sides, active=active), at)
            place, reached = place + 1, (here, *reached[1:])
        if ended is not None:
            return Ended(ended.why, replace(ended.outcome, step=place), reached)
        if chosen is None:
            return self._no_one_motion(place, reached, self.resting)
        return Position(place, reached, *chosen, count=count)

    def _settled(
        self, position: Position, state: Point, kinds: Sequence[Kind]
    ) -> tuple[Point, Ended | None]:
        """The state after events and impacts at one moment, until none acts."""
        reached, ended = self._act(state, kinds, position)
        if not self.scene.contacts:
            return reached, ended
        contacts = self._contacts_of(position)
        self.scale = self.scale.with_state(reached, contacts)
        if stops := [
            one.contact
            for one in kinds
            if isinstance(one, Contacting) and one.change == Change.STICKS
        ]:
            reached = contacts.stopped(reached, stops)
        for _ in range(MOST_AT_ONCE):
            if ended is not None:
                return reached, ended
            before = reached
            struck = contacts.impact(before, self.scale)
            reached, self.resting = struck.state, struck.resting
            self.impacts += struck.counts
            self.gained |= struck.gained
            if not struck.is_one:
                return reached, self._no_one_order(reached, np.flatnonzero(struck.counts).tolist())
            if not (waiting := self._led_to(-1, before, reached, position, ())):
                break
            reached, ended = self._act(reached, waiting, position)
        self.changes += 1
        return reached, self._zeno(
            reached, None
        ) if waiting or self.changes > MOST_CHANGES else None

    def _contacts_of(self, position: Position) -> touching.Contacts:
        """The contacts with the forces that act at a position."""
        return self.motion(position).contacts_on(position.sides)

    def _chosen(
        self,
        position: Position,
        state: Point,
        zero: Sequence[ex.Expression],
        slipped: Sequence[int],
    ) -> tuple[Sides, touching.Active] | None:
        """The sides and the contacts that press from a state on; None where no motion goes on, or
        more than one.
        """
        if not self.scene.contacts:
            sides = self._sides(self.whole, state, position.sides, zero)
            return None if sides is None else (sides, ())
        active = tuple(pair for pair in position.active if pair[0] in self.resting)
        noted = len(self.switches)
        for _ in range(MOST_CHOICES):
            del self.switches[noted:]
            motion = self.whole.pressed_by(active, self.scale.fall)
            sides = self._sides(motion, state, position.sides, zero) if self.whole.functions else {}
            if sides is None:
                return None
            options = motion.contacts_on(sides).motions(state, self.resting, slipped, self.scale)
            if len(options) != 1:
                return None
            if options[0] == active:
                self._note_rests(active, state[0])
                return sides, active
            active = options[0]
        return None

    def _note_rests(self, active: touching.Active, time: float) -> None:
        """From this time on these contacts press; a span is open until its end is known."""
        pressing = {i for i, _ in active}
        for i, spans in enumerate(self.rests):
            is_open = bool(spans) and np.isnan(spans[-1][1])
            if is_open and i not in pressing:
                begin, _ = spans.pop()
                if time > begin:
                    self.rests[i] = joined_spans([*spans, (begin, time)])
            elif not is_open and i in pressing:
                spans.append((time, np.nan))

    def _no_one_motion(self, place: int, state: Point, contacts: Sequence[int] = ()) -> Ended:
        """Where more than one motion begins, or none."""
        if contacts:
            names = ", ".join(self.scene.contacts[i].name for i in contacts)
            quantity = say("no_one_motion_of_contacts", names)
            outcome = Outcome(
                "no_one_motion", place, state[0], quantity, None, say("contacts_remedy")
            )
            return Ended(End.NO_ONE_MOTION, outcome, state)
        text = " = ".join(map(printing.to_text, self._zeros(state, {}) or self.whole.functions))
        outcome = Outcome(
            "singular", place, state[0], say("no_one_motion", text), None, BEGIN_ELSEWHERE
        )
        return Ended(End.NO_ONE_MOTION, outcome, state)

    def _no_one_order(self, state: Point, contacts: Sequence[int]) -> Ended:
        """Where the order of impacts that are equally fast decides."""
        names = ", ".join(self.scene.contacts[i].name for i in contacts)
        outcome = Outcome(
            "no_one_motion",
            None,
            state[0],
            say("order_of_impacts", names),
            None,
            say("order_remedy"),
        )
        return Ended(End.NO_ONE_MOTION, outcome, state)

    def _watched_contacts(self, position: Position) -> list[tuple[Kind, data.Event]]:
        """What ends the piece of a position by its contacts: open ones that close, and those that
        press no more, begin to slip, or stick again.
        """
        if self.whole.contacts is None:
            return []
        contacts, pressing = self._contacts_of(position), dict(position.active)
        found = list[tuple[Kind, data.Event]]()
        deep, slow = ex.number(Fraction(self.scale.deep)), ex.number(Fraction(self.scale.least))

        latest: dict[tuple[bytes, ...], touching.Pressed] = {}  # all are asked at the same points

        def measured(value: Callable[[touching.Pressed], Array]) -> data.Event:
            def measure(*points: Array) -> Array:
                key = tuple(one.tobytes() for one in points)
                if key not in latest:
                    latest.clear()
                    latest[key] = contacts.pressed(contacts.at(*points), position.active)
                return value(latest[key])

            return data.Event(ex.ZERO, -1, True, measure=measure)

        for i, contact in enumerate(self.scene.contacts):
            if (way := pressing.get(i)) is None:
                found.append(
                    (Contacting(Change.CLOSES, i), data.Event(contact.gap + deep, -1, True))
                )
                continue
            found.append((Contacting(Change.OPENS, i), measured(lambda one, i=i: one.normal[:, i])))  # type: ignore[misc]
            mu = contact.friction * (1 + touching.CLOSES)
            if way == touching.Way.STICKS:
                margin = measured(
                    lambda one, i=i, mu=mu: mu * one.normal[:, i] - np.abs(one.friction[:, i])  # type: ignore[misc]
                )
                found.append((Contacting(Change.SLIPS, i), margin))
            elif way != touching.Way.SMOOTH:
                formula = ex.number(int(way)) * contacts.slides[i] + slow
                found.append((Contacting(Change.STICKS, i), data.Event(formula, -1, True)))
        return found

    def _size(self, state: Point) -> float:
        """That of a state; with contacts, that of the motion so far, as all may be at rest at 0."""
        return max(size_of(state), self.scale.size) if self.scene.contacts else size_of(state)

    def _note_of(self, index: int, whole: Trajectory) -> str:
        """What else was seen of an event."""
        (begin, end), *_ = self.still.get(index, [(0.0, -1.0)])
        if index in self.notes or end < begin:
            return self.notes.get(index, "")
        always = begin <= whole.times[0] and end >= whole.times[-1]
        return say("event_always_zero") if always else say("event_zero_between", begin, end)

    def _turned(self, position: Position, piece: Piece) -> Sides | None:
        """The sides, where a function that was zero at the start of a piece went to the other one
        at once: its sides have the same force there, and what moves it is of a higher order.
        """
        motion, sides = self.motion(position), position.sides
        if not sides:
            return None
        points = [piece.point(row) for row in range(min(3, len(piece.ran.times)))]
        for u, side in sides.items():
            begin, *others = (motion.value(u, sides, point) for point in points)
            turns = (
                side
                and u not in self.settled
                and begin == 0
                and all(side * value < 0 for value in others)
            )
            if turns and not motion.goes(sides, [u], points[0]):
                self.settled.add(u)
                return sides | {u: -side}
        return None

    def _zeros(self, state: Point, sides: Sides) -> list[ex.Expression]:
        """The switching functions that are zero at the start."""
        return [
            u
            for u in self.whole.functions
            if abs(self.whole.value(u, sides, state)) <= NOISE * self._size(state)
        ]

    def _sides(
        self, motion: Motion, state: Point, before: Sides, zero: Sequence[ex.Expression]
    ) -> Sides | None:  # fmt: skip
        """The sides on which a motion continues from a state, None where it has no one
        continuation.
        """
        released = {}
        for u in zero:
            if before.get(u) == STICKS:  # it is released to the side to which its share has come
                released[u] = 1 if motion.at([share_of(u)], state, before)[0] > 0 else -1
        self.settled = set(released)
        # What else is zero and stays so is decided with them: its force may not hold any more, and
        # an event may have moved it. That is what sticks, and what slides although the greatest
        # friction just holds it.
        stuck = [
            u
            for u, side in before.items()
            if u not in zero and self._stays(motion, u, side, before, state)
        ]
        found = motion.sides_at(
            state, before, [u for u in (*zero, *stuck) if u not in released], released
        )
        if found is not None and before:
            self.switches += [
                Switch(u, state[0], found[u]) for u in (*zero, *stuck) if found[u] != before[u]
            ]
        return found

    def _stays(
        self, motion: Motion, u: ex.Expression, side: int, before: Sides, state: Point
    ) -> bool:
        """Whether a function that is zero is so for more than a moment: it sticks, or does not move
        in a step.
        """
        value, size = abs(motion.value(u, before, state)), self._size(state)
        if side == STICKS:
            return value <= AT_ZERO * size
        rate = motion.rate(on_sides(u, before))
        moved = abs(self.scene.grid.step) * abs(float(motion.at([rate], state, before)[0]))
        return value + moved <= SAME * size

    def _first(self, position: Position, piece: Piece) -> tuple[Point, list[Kind]] | None:
        """The state at the first event of a piece that acts, stops or switches, and all events at
        that time.
        """
        motion, sides, run = self.motion(position), position.sides, piece.observed
        events = self.scene.events
        watched: list[tuple[Kind, data.Event]] = [*enumerate(events)]
        for u, side in sides.items():
            if side == STICKS:
                watched.append((u, data.Event(ex.ZERO, -1, True, measure=_slack(motion, u, sides))))
            else:
                watched.append((u, data.Event(on_sides(u, sides), -side, True)))
        watched += self._watched_contacts(position)
        begin, least = float(run.trajectory.times[0]), AT_ONCE * abs(self.scene.grid.step)
        found = located(
            run, [event for _, event in watched],
            lambda: motion.problem_on(sides, by_forces=True),
        )  # fmt: skip
        later = [one.part(one.times > begin + (least if self.parts else -least)) for one in found]
        pairs = zip(watched, later, strict=True)
        ends = [
            (kind, one)
            for (kind, event), one in pairs
            if (event.acts or event.stops) and len(one.times)
        ]
        first = first_of([one for _, one in ends])
        end = np.inf if first is None else first[0]
        for k, (event, one) in enumerate(zip(events, later, strict=False)):
            if one.note == say("event_always_zero"):
                until = min(end, float(run.trajectory.times[-1]))
                self.still[k] = joined_spans([*self.still.get(k, []), (begin, until)])
            elif one.note:
                self.notes[k] = one.note
            if not (event.acts or event.stops):
                self.seen[k].append(one.part(one.times <= end))
        return first and (first, [kind for kind, one in ends if one.times[0] <= end + least])

    def _act(
        self, state: Point, kinds: Sequence[Kind], position: Position
    ) -> tuple[Point, Ended | None]:
        """The state after the events, one after another, and after those that they lead to at the
        same moment; the outcome where they end the run.
        """
        time, motion, sides = state[0], self.motion(position), position.sides
        waiting = [kind for kind in kinds if isinstance(kind, int)]
        for index, event in enumerate(self.scene.events):
            place = motion.place_of(event.formula, sides, state)
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
                after = (time, *self._after(event, state, position))
                if not np.isfinite(np.concatenate(after[1:])).all():
                    text = f"what the event {printing.to_text(event.formula)} = 0 sets, which has no value"
                    return after, Ended(
                        End.METHOD,
                        Outcome("off_domain", None, time, text, None, BEGIN_ELSEWHERE),
                        after,
                    )
                if self._turns_again(index, state, after, position):
                    self.side[index] = -self.side[index]
                    continue
                if sense := self._sense_held(event, state, after, position):
                    self.held[index] = sense
                state = after
            self.seen[index].append(
                Found(event, np.array([time]), reached[1][None], reached[2][None])
            )
            if sum(len(one.times) for one in self.seen[index]) >= event.most and (
                event.acts or event.stops
            ):
                note = (
                    say("ended_by_event", time)
                    if event.most == 1
                    else say("many_events", event.most, time)
                )
                return state, Ended(End.STOPPED, Outcome("completed", None, time, note=note), state)
            if event.acts:
                waiting += self._led_to(index, reached, state, position, waiting)
        else:
            return state, self._zeno(state, None)
        self.acted.append(time)
        # The time is known only to round-off, so much shorter times have no meaning.
        soon = SOON * max(abs(self.scene.grid.step), abs(time))
        if self.hops > MOST_HOPS or (
            len(self.acted) > 8 and self.acted[-1] - self.acted[-5] < soon
        ):
            return state, self._zeno(state, None)
        return state, None

    def _turns_again(self, index: int, before: Point, after: Point, position: Position) -> bool:
        """Whether an earlier event at this moment has turned back what this one would turn round
        again.
        """
        formula, crossed = self.scene.events[index].formula, self.side[index]
        motion, sides = self.motion(position), position.sides
        if (old := motion.place_of(formula, sides, before)).side != -crossed or not old.at_zero:
            return False
        new = motion.place_of(formula, sides, after)
        return new.at_zero and new.side == crossed

    def _led_to(
        self, acted: int, before: Point, after: Point, position: Position, waiting: Sequence[int]
    ) -> list[int]:  # fmt: skip
        """The other events whose formula is zero and moves, after the state has changed, to another
        side than the one on which it was: from a zero at rest too.
        """
        found, motion, sides = [], self.motion(position), position.sides
        for index, event in enumerate(self.scene.events):
            was, new = self.side[index], motion.place_of(event.formula, sides, after)
            if index == acted:  # on the side from which it came, if it is at rest there
                self.side[index] = new.side or -was
                self.hops = self.hops + 1 if new.hop < HOP else 0
                continue
            if index in waiting or new.side in (0, was):
                continue
            self.side[index] = new.side
            if event.direction not in (0, new.side):
                continue
            # Without a direction, a formula that was always zero has an event where its side has
            # changed.
            known = (
                event.direction
                or was
                or motion.place_of(event.formula, sides, before).side != new.side
            )
            if new.at_zero and known:
                found.append(index)
            elif was and not new.at_zero:
                self.notes[index] = say("event_jumped", after[0])
        return found

    def _leaked(self, position: Position, arrived: Point) -> bool:
        """Whether the formula of an event that turns the motion back has passed its zero without
        having been found: the motion began at zero, and was pushed through it. Sides are noted.
        """
        leaked, motion, sides = False, self.motion(position), position.sides
        for index, event in enumerate(self.scene.events):
            place, was = motion.place_of(event.formula, sides, arrived), self.side[index]
            if place.at_zero:
                continue
            if event.acts and place.side == event.direction != was and not leaked:
                rate = motion.rate(on_sides(event.formula, sides))
                turned = (arrived[0], *self._after(event, arrived, position))
                leaked = event.direction * float(motion.at([rate], turned, sides)[0]) <= 0
            self.side[index] = place.side
        return leaked

    def _at_start(self, position: Position) -> list[Kind]:
        """The events at which the motion begins, goes on in their direction, and is turned back: a
        ball on a floor.
        """
        motion, sides, state, held = (
            self.motion(position),
            position.sides,
            position.state,
            self._sense_held,
        )
        least = NOISE * self._size(state)
        acting = [(k, one) for k, one in enumerate(self.scene.events) if one.acts and one.direction]
        zero = [
            (k, one) for k, one in acting if abs(motion.value(one.formula, sides, state)) <= least
        ]
        onward = [
            (k, e)
            for k, e in zero
            if motion.goes(sides | {e.formula: e.direction}, [e.formula], state)
        ]
        return [
            k
            for k, e in onward
            if held(e, state, (state[0], *self._after(e, state, position)), position)
        ]

    def _after(self, event: data.Event, state: Point, position: Position) -> tuple[Array, Array]:
        """Position and velocity with what the event sets."""
        whole, names = np.concatenate(state[1:]), nf.state_names(self.scene.coordinates)
        targets = self.whole.at([on_sides(tree, position.sides) for _, tree in event.sets], state)
        for (target, _), value in zip(event.sets, targets, strict=True):
            whole[names.index(target)] = value
        q, v = np.split(whole, 2)
        if self.scene.constraints and np.isfinite(whole).all():
            given = dict(zip(self.scene.coordinates, map(float, v), strict=True))
            v = initial.initial_velocities(self.scene, self.whole.values, q, given, project=True)
        return q, v

    def _zeno(self, state: Point, place: int | None) -> Ended:
        gap = self.acted[-1] - self.acted[-2] if len(self.acted) > 1 else 0.0
        return Ended(
            End.ZENO, Outcome("zeno", place, state[0], say("zeno"), gap, say("zeno_remedy")), state
        )

    def _sense_held(
        self, event: data.Event, before: Point, after: Point, position: Position
    ) -> float:
        """1 or -1: the sense in which the formula reached its zero, if it is still zero and the
        event has stopped or reversed it; 0 elsewhere. The rate is noise where events come ever
        faster: against the event's own direction it shows that this one was not located.

        An event sets what its scene says, so that no law of contacts puts the motion to rest: a
        ball that an event keeps above a floor would otherwise end below it, and complete.
        """
        motion, sides = self.motion(position), position.sides
        own = on_sides(event.formula, sides)
        rate = motion.rate(own)
        (old,), (value, new) = (
            motion.at([rate], before, sides), motion.at([own, rate], after, sides),
        )  # fmt: skip
        sense = float(event.direction or np.sign(old))
        return (
            sense
            if abs(value) <= AT_ZERO * self._size(before) and (sense * new <= 0 or sense * old < 0)
            else 0.0
        )

    def _fell_through(self, after: Point, until: float) -> bool:
        """Whether the motion passes in the sense in which an event has just turned it back: the
        next event, sooner than can be located, is missed. So ends a ball that an event of its scene
        keeps above a floor on which it lies; contacts rest there.
        """
        held, self.held = self.held, {}
        formulas = {k: self.scene.events[k].formula for k in held} if after[0] < until else {}
        return any(
            held[k] * self.whole.at([formula], after)[0] > 0 for k, formula in formulas.items()
        )

    def _keep(self, position: Position, piece: Piece, count: int) -> None:
        """So many points of a piece, without its start unless it is the first."""
        self._record(position, piece.ran.part(slice(1 if self.parts else 0, count)))

    def _record(self, position: Position, part: Trajectory) -> None:
        """Points of the run, with the forces of contacts that act there."""
        if self.scene.contacts:
            shape = (len(part.times), len(self.scene.contacts))
            normal, friction = np.zeros(shape), np.zeros(shape)
            if position.active and len(part.times):
                assert part.velocities is not None
                contacts = self._contacts_of(position)
                pressed = contacts.pressed(
                    contacts.at(part.times, part.positions, part.velocities), position.active
                )
                normal, friction = pressed.normal, pressed.friction
                self.greatest = np.maximum(self.greatest, normal.max(axis=0))
            series = dict(part.series)
            for k, contact in enumerate(
                self.scene.contacts if "contact_forces" in self.scene.observe else ()
            ):
                series |= {
                    f"normal_{contact.name}": normal[:, k],
                    f"friction_{contact.name}": friction[:, k],
                }
            part = replace(part, series=series)
        self.parts.append(part)

    def _joined(self, outcome: Outcome, start: data.Start) -> Trajectory:
        parts, grid = self.parts, self.scene.grid
        if not parts:
            return Trajectory.of_start(grid.begin, start.positions, self.scene.velocities, outcome)
        positions = np.concatenate([part.positions for part in parts])
        velocities = np.concatenate([np.asarray(part.velocities) for part in parts])
        times = np.asarray(grid.begin + grid.step * np.arange(len(positions)), dtype=np.float64)
        # What each piece has: those at rest by another method have no discrete energy.
        common = [name for name in parts[0].series if all(name in part.series for part in parts)]
        series = {name: np.concatenate([part.series[name] for part in parts]) for name in common}
        spent = {name: sum(getattr(part, name) for part in parts) for name in SPENT}
        whole = Trajectory(times, positions, None, velocities, outcome, series=series, **spent)
        return whole.ended(slice(None), outcome)
