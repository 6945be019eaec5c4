"""A program as a whole compiled run: steps, substeps of a composition, Newton, compensated sums, records.

`memory` holds what `Layout` lists and is handed in and out, `weights` the
substeps of the composition, `control` = [steps to do, substeps, record every, steps to the next record, steps done,
rows written, Newton iterations], `record` one row of `Layout.columns` for each recorded step.
"""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.kernels.codegen.implicit import Blocks
from inverse_service.kernels.codegen.llvm_writer import LlvmWriter
from inverse_service.kernels.codegen.program import (
    CLOCK,
    NOT_FINITE,
    PACE,
    STATUS,
    UNOBSERVABLE,
    UNRESOLVED,
    WATCHED,
    Assign,
    Layout,
    Program,
    changing,
    layout_of,
)
from inverse_service.kernels.codegen.straight_line import Emitter
from inverse_service.kernels.codegen.symengine_trees import STEP

CONTROL = ("steps", "stages", "every", "until_record", "done", "rows", "iterations")


# Four to five steps in a turn of what moves most are the least.
LEAST_RESOLVED = 0.16
# Of the square of 4 b; below it the test holds: with |a - 2 b + c| <= 0.2 |4 b| is |a| + 2 |b| + |c| >= 0.8 |4 b|.
EASILY_RESOLVED = 0.04
NOISE_OF_PLACE = 1e-10
FADING = 0.81  # a step, of the square of a pace


class Kernel:
    """Writes one program with one writer."""

    def __init__(self, program: Program, writer: LlvmWriter) -> None:
        self.program, self.writer = program, writer
        self.layout: Layout = layout_of(program)
        self.emitter = Emitter(writer)
        self.blocks = Blocks(writer, self.emitter)

    def write(self) -> str:
        """The kernel's text."""
        self._open()
        self._step()
        self._close()
        return self.writer.text()

    def _open(self) -> None:
        w = self.writer
        for place, name in enumerate(self.layout.persistent):
            w.slot(name)
            w.write(name, w.load("memory", place))
        for name in self.layout.arguments:
            self.emitter.bind(name, w.load("memory", self.layout.argument_place(name)))
        self._whole_step = self.emitter.value(STEP)
        for place, name in enumerate(CONTROL):
            w.counter(name)
            w.write_counter(name, w.load_counter("control", place))
        w.counter("stage")
        for name in self._sums():
            w.slot(name)
        for place in range(len(self.program.observed)):
            w.slot(f"seen_{place}")

    def _step(self) -> None:
        w = self.writer
        w.label("next_step")
        left = w.compare_counters("<", w.read_counter("done"), w.read_counter("steps"))
        w.branch(left, "begin_step", "finish")
        w.open("begin_step")
        w.write_counter("stage", "0")
        for name in self._sums():
            w.write(name, w.number(0.0))
        w.label("next_stage")
        stage = w.read_counter("stage")
        with self.emitter.inner():
            self._stage(stage)
        after = w.add_counters(stage, "1")
        w.write_counter("stage", after)
        more = w.compare_counters("<", after, w.read_counter("stages"))
        w.branch(more, "next_stage", "end_stages")
        w.open("end_stages")
        self._end_step()

    def _stage(self, stage: str) -> None:
        w, e = self.writer, self.emitter
        e.bind("h", w.binary("*", self._whole_step, w.load_shared("weights", stage)))
        self._bind_state()
        self._statements()
        self._watch()
        seen = self._seen()
        self._leave_if_stopped("stopped_early", "go_on")
        self._observe(seen)
        self._update()

    def _statements(self) -> None:
        for statement in self.program.statements:
            if isinstance(statement, Assign):
                self.emitter.bind(statement.name, self.emitter.value(statement.formula))
            else:
                self.blocks.write(statement)

    def _bind_state(self) -> None:
        for name in self.program.state:
            self.emitter.bind(name, self.writer.read(name))

    def _watch(self) -> None:
        w = self.writer
        watches = self.program.watches
        values = self.emitter.write([watch.formula for watch in watches]) if watches else []
        for place, (watch, value) in enumerate(zip(watches, values, strict=True)):
            limit, zero = w.number(watch.limit), w.number(0.0)
            if watch.kind == "sign":
                self.blocks.keep_sign(f"watch_{place}", value, WATCHED + place)
                continue
            if watch.kind in ("positive", "domain"):
                good = w.compare(">", value, zero)
            elif watch.kind in ("bound", "resolution"):
                good = w.compare("<", w.absolute(value), limit)
            else:
                beyond = w.compare(">", w.absolute(value), limit)
                good = w.compare("==", w.select(beyond, limit, zero), zero)
            self.blocks.stop_unless(good, WATCHED + place, value)

    def _leave_if_stopped(self, stopped: str, onwards: str) -> None:
        """A single trajectory ends here; lanes go on until all have ended."""
        w = self.writer
        w.branch(w.everywhere(w.compare("!=", w.read(STATUS), w.number(0.0))), stopped, onwards)
        w.open(onwards)

    def _alive(self, value: str) -> str:
        """The value, 0 in lanes that have stopped."""
        if self.writer.lanes == 1:
            return value
        going = self.writer.compare("==", self.writer.read(STATUS), self.writer.number(0.0))
        return self.writer.select(going, value, self.writer.number(0.0))

    def _seen(self) -> list[str]:
        """The observed values; one that is not finite ends the run."""
        w = self.writer
        values = self.emitter.write([formula for _, formula in self.program.observed]) if self.program.observed else []
        for place, value in enumerate(values):
            finite = w.compare("==", w.binary("*", value, w.number(0.0)), w.number(0.0))
            self.blocks.stop_unless(finite, UNOBSERVABLE + place, value)
        return values

    def _observe(self, values: list[str]) -> None:
        w = self.writer
        for place, value in enumerate(values):
            size, greatest = w.absolute(self._alive(value)), w.read(f"maximum_{place}")
            w.write(f"maximum_{place}", w.select(w.compare(">", size, greatest), size, greatest))
            w.write(f"seen_{place}", value)

    def _update(self) -> None:
        w, e = self.writer, self.emitter
        names = changing(self.program)
        moves = [*self.program.displacement, *self.program.way]
        values = e.write([*(update for update in self.program.updates if update is not None), *moves])
        for name, value in zip(names, values, strict=False):
            self._add_compensated(name, self._alive(value))
        for name, value in zip(self._sums(), values[len(names) :], strict=True):
            w.write(name, w.binary("+", w.read(name), value))

    def _sums(self) -> list[str]:
        """What is added up over the substeps of a composition."""
        moved = [f"moved_{k}" for k in range(len(self.program.displacement))]
        return [*moved, *(f"way_{k}" for k in range(len(self.program.way)))]

    def _add_compensated(self, name: str, increment: str) -> None:
        """Kahan (1965): the low part is what the sum lost."""
        w = self.writer
        old = w.read(name)
        step = w.binary("-", increment, w.read(f"{name}_low"), exact=True)
        new = w.binary("+", old, step, exact=True)
        w.write(f"{name}_low", w.binary("-", w.binary("-", new, old, exact=True), step, exact=True))
        w.write(name, new)

    def _end_step(self) -> None:
        w = self.writer
        self._test_finite()
        if self.program.way:
            self._test_resolution()
        w.write(CLOCK, w.binary("+", w.read(CLOCK), w.number(1.0)))
        self._leave_if_stopped("stopped_early", "step_is_good")
        w.write_counter("done", w.add_counters(w.read_counter("done"), "1"))
        until = w.add_counters(w.read_counter("until_record"), "-1")
        w.write_counter("until_record", until)
        w.branch(w.compare_counters(">", until, "0"), "next_step", "record_row")
        w.open("record_row")
        self._record()
        w.jump("next_step")

    def _test_finite(self) -> None:
        w = self.writer
        names = changing(self.program)
        if not names:
            return
        total = w.number(0.0)
        for name in names:
            total = w.binary("+", total, w.binary("*", w.read(name), w.number(0.0)))
        self.blocks.stop_unless(w.compare("==", total, w.number(0.0)), NOT_FINITE, total)

    def _test_resolution(self) -> None:
        """Sum of (a - 2 b + c)^2 below LEAST_RESOLVED times that of (|a| + 2 |b| + |c|)^2, for three steps in a row.

        For an oscillation the quotient is (1 - cos(h omega))^2/4. Round-off of the position counts nothing, and where
        the motion stands still for a moment its pace before counts, which fades.
        """
        w, places = self.writer, range(len(self.program.way))
        steps = [tuple(w.read(f"{name}_{k}") for name in ("way", "later", "before")) for k in places]
        bent = self._squares([w.binary("+", w.binary("-", a, w.binary("+", b, b)), c) for a, b, c in steps])
        pace = w.binary("*", w.number(16.0), self._squares([last for _, last, _ in steps]))
        past = w.binary("*", w.number(FADING), w.read(PACE))
        pace = w.select(w.compare(">", pace, past), pace, past)
        w.write(PACE, pace)
        for place, (now, last, _) in zip(places, steps, strict=True):
            w.write(f"before_{place}", last)
            w.write(f"later_{place}", now)
        easy = w.compare("<=", bent, w.binary("*", w.number(EASILY_RESOLVED), pace))
        w.branch(w.everywhere(easy), "resolved", "look_closer", rare=True)
        w.open("look_closer")
        self._look_closer(steps, bent, past)
        w.label("resolved")

    def _look_closer(self, steps: Sequence[tuple[str, ...]], bent: str, past: str) -> None:
        w = self.writer
        sizes = []
        for place, (now, last, before) in enumerate(steps):
            twice = w.absolute(w.binary("+", last, last))
            total = w.binary("+", w.binary("+", w.absolute(now), twice), w.absolute(before))
            noise = w.binary("*", w.number(NOISE_OF_PLACE), w.absolute(w.read(self.program.state[place])))
            sizes.append(w.binary("+", total, noise))
        size = self._squares(sizes)
        size = w.select(w.compare(">", size, past), size, past)
        w.write(PACE, size)
        early = w.compare("<", w.read(CLOCK), w.number(2.0))
        good = w.compare("<=", bent, w.binary("*", w.number(LEAST_RESOLVED), size))
        one = w.number(1.0)
        good = w.compare("==", w.select(early, one, w.select(good, one, w.number(0.0))), one)
        self.blocks.stop_unless(good, UNRESOLVED, w.binary("/", bent, size))

    def _squares(self, values: Sequence[str]) -> str:
        w, total = self.writer, self.writer.number(0.0)
        for value in values:
            total = w.binary("+", total, w.binary("*", value, value))
        return total

    def _record(self) -> None:
        w = self.writer
        row = w.read_counter("rows")
        first = w.multiply_counters(row, str(len(self.layout.columns)))
        values = [w.read(name) for name in changing(self.program)]
        moved = range(len(self.program.displacement))
        values += [w.binary("/", w.read(f"moved_{k}"), self._whole_step) for k in moved]
        values += [w.read(f"seen_{k}") for k in range(len(self.program.observed))]
        for place, value in enumerate(values):
            w.store("record", w.add_counters(first, str(place)), value)
        w.write_counter("rows", w.add_counters(row, "1"))
        w.write_counter("until_record", w.read_counter("every"))

    def _close(self) -> None:
        w = self.writer
        w.open("stopped_early")
        w.label("finish")
        for place, name in enumerate(self.layout.persistent):
            w.store("memory", place, w.read(name))
        for place, name in enumerate(CONTROL):
            w.store_counter("control", place, w.read_counter(name))
