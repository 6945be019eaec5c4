"""A program as a whole compiled run: steps, substeps of a composition, Newton, compensated sums, records.

Implicit blocks are Newton's method with a dense solve, one linear solve, or a fixed-point iteration; small linear
systems are written out: Gaussian elimination with row pivoting by selection, no branch.

`memory` holds what `Layout` lists and is handed in and out, `weights` the substeps of the composition, `control` =
[steps to do, substeps, record every, steps to the next record, steps done, rows written, Newton iterations], `record`
one row of `Layout.columns` for each recorded step.

Kernels that choose their own steps make as many between the points of the grid as their error estimate asks for. A
trial step is accepted where the squared norm of its error is at most 1; the next one is longer or shorter by 0.9
error^(-1/k), within a factor of 5. The last step before a point of the grid ends on it. Source: E. Hairer, S. P.
Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), II.4.
"""

from collections.abc import Sequence

import symengine

from inverse_service.kernels.codegen import program as programs
from inverse_service.kernels.codegen.llvm_writer import Emitter, LlvmWriter
from inverse_service.kernels.codegen.symengine_trees import ALPHA, STEP, WHOLE_STEP, Formula, symbol

MOST_NEWTON_STEPS = 32
MOST_ITERATIONS = 200
# Newton's last correction may be this large (relative): quadratic convergence squares it.
LAST_CORRECTION = 1e-9
ROUND_OFF = 4.5e-16
# A correction that no longer falls is noise if it is this small compared with the greatest increments so far.
NOISE = 1e-6
EARLIEST_NOISE = 4  # iterations after which quadratic convergence has come to its end
HUGE = 1.7e308
ROUND_OFF_AT_START = 1e-14  # of what a variable of the start changes in a quantity: below, its sign is not known
CONTROL = ("steps", "stages", "every", "until_record", "done", "rows", "iterations")
SAFETY, MOST, LEAST = 0.9, 5.0, 0.2
FIRST = 1e-2  # of the grid's step: the first trial
SHORTEST = 1e-15  # of the grid's step
MOST_TRIES = 4_000_000  # between two points of the grid


def solve_dense(writer: LlvmWriter, matrix: Sequence[Sequence[str]], right: Sequence[str]) -> tuple[list[str], str]:
    """(solution of matrix x = right, determinant), in values of the writer."""
    size = len(right)
    if size == 1:
        return [writer.binary("/", right[0], matrix[0][0])], matrix[0][0]
    if size == 2:
        return _by_cramer(writer, matrix, right)
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    determinant = writer.number(1.0)
    for column in range(size):
        determinant = _pivot(writer, rows, column, determinant)
        determinant = writer.binary("*", determinant, rows[column][column])
        for row in range(column + 1, size):
            factor = writer.binary("/", rows[row][column], rows[column][column])
            for place in range(column + 1, size + 1):
                rows[row][place] = _less(writer, rows[row][place], factor, rows[column][place])
    return _back(writer, rows), determinant


def _less(writer: LlvmWriter, value: str, factor: str, other: str) -> str:
    return writer.binary("-", value, writer.binary("*", factor, other))


def _by_cramer(writer: LlvmWriter, matrix: Sequence[Sequence[str]], right: Sequence[str]) -> tuple[list[str], str]:
    (a, b), (c, d) = matrix
    determinant = _less(writer, writer.binary("*", a, d), b, c)
    first = _less(writer, writer.binary("*", right[0], d), b, right[1])
    second = _less(writer, writer.binary("*", a, right[1]), c, right[0])
    return [writer.binary("/", first, determinant), writer.binary("/", second, determinant)], determinant


def _pivot(writer: LlvmWriter, rows: list[list[str]], column: int, determinant: str) -> str:
    """The largest entry of the column comes up by exchanges, each of which turns the determinant's sign."""
    for row in range(column + 1, len(rows)):
        larger = writer.compare(">", writer.absolute(rows[row][column]), writer.absolute(rows[column][column]))
        for place in range(column, len(rows[row])):
            upper, lower = rows[column][place], rows[row][place]
            rows[column][place] = writer.select(larger, lower, upper)
            rows[row][place] = writer.select(larger, upper, lower)
        determinant = writer.select(larger, writer.negate(determinant), determinant)
    return determinant


def _back(writer: LlvmWriter, rows: Sequence[Sequence[str]]) -> list[str]:
    size = len(rows)
    solution = [""] * size
    for row in reversed(range(size)):
        value = rows[row][size]
        for place in range(row + 1, size):
            value = _less(writer, value, rows[row][place], solution[place])
        solution[row] = writer.binary("/", value, rows[row][row])
    return solution


class Blocks:
    """Writes implicit blocks and the tests that end a run, and counts them."""

    def __init__(self, writer: LlvmWriter, emitter: Emitter) -> None:
        self.writer, self.emitter = writer, emitter
        self._solves = self._labels = self._iterated = self._stops = 0
        self.active: str | None = None  # where it does not hold, nothing stops a run and no sign is kept

    def write(self, block: programs.Solve | programs.Iterate) -> None:
        if isinstance(block, programs.Iterate):
            self._iterate(block)
        elif block.affine:
            self._linear(block)
        else:
            self._newton(block)

    def stop_unless(self, condition: str, code: int, value: str) -> None:
        """Set the status of lanes where the condition fails and that have not stopped before."""
        w = self.writer
        if w.lanes == 1 and self.active is None:
            self._branch_off(condition, code, value)
            return
        status = w.read(programs.STATUS)
        good, going = w.number(0.0), w.compare("==", status, w.number(0.0))
        new = w.select(condition, good, w.number(float(code)))
        status_now = w.select(going, new, status)
        status_now = status_now if self.active is None else w.select(self.active, status_now, status)
        stops = w.compare("!=", status_now, status)
        w.write(programs.STATUS, status_now)
        w.write(programs.STOPPED_AT, w.select(stops, w.read(programs.CLOCK), w.read(programs.STOPPED_AT)))
        w.write(programs.STOPPED_VALUE, w.select(stops, value, w.read(programs.STOPPED_VALUE)))

    def _branch_off(self, condition: str, code: int, value: str) -> None:
        """One trajectory: a jump that is hardly ever taken costs less than the choice of four values."""
        w = self.writer
        self._stops += 1
        fails, first, onwards = (f"{name}_{self._stops}" for name in ("fails", "first_to_fail", "holds"))
        w.branch(condition, onwards, fails, rare=True)
        w.open(fails)
        w.branch(w.compare("==", w.read(programs.STATUS), w.number(0.0)), first, onwards)
        w.open(first)
        w.write(programs.STATUS, w.number(float(code)))
        w.write(programs.STOPPED_AT, w.read(programs.CLOCK))
        w.write(programs.STOPPED_VALUE, value)
        w.jump(onwards)
        w.open(onwards)

    def keep_sign(self, slot: str, value: str, code: int, share: float = 0.0) -> None:
        """The value must keep the sign it had first, and this share of its size; where the slot is 0 there is no first
        yet."""
        w = self.writer
        sign, zero = w.read(slot), w.number(0.0)
        if share:
            own = w.binary("/", w.number(1.0), value)
        else:
            own = w.select(w.compare("<", value, zero), w.number(-1.0), w.number(1.0))
        fresh = w.compare("==", sign, zero)
        sign = w.select(fresh, own, sign)
        good = w.compare(">", w.binary("*", sign, value), w.number(share))
        w.write(slot, sign if self.active is None else w.select(self.active, sign, w.read(slot)))
        self.stop_unless(good, code, value)

    def _declare(self, names: Sequence[str]) -> None:
        for name in names:
            self.writer.slot(name)

    def _hoisted(self, formulas: Sequence[Formula], unknowns: Sequence[str]) -> list[Formula]:
        """Formulas in which parts without unknowns are names, bound to values computed before the loop."""
        self._labels += 1
        parts: dict[Formula, Formula] = {}
        changing = {symbol(name) for name in unknowns}
        reduced = [_take_out(formula, changing, parts, f"k{self._labels}_") for formula in formulas]
        for name, value in zip(parts.values(), self.emitter.write(list(parts)) if parts else [], strict=True):
            self.emitter.bind(str(name), value)
        return reduced

    def _linear(self, block: programs.Solve) -> None:
        w, e = self.writer, self.emitter
        zero = {symbol(name): symengine.Integer(0) for name in block.unknowns}
        size = len(block.unknowns)
        entries = [entry for row in block.jacobian for entry in row]
        values = e.write([*(residual.subs(zero) for residual in block.residuals), *entries])
        matrix = [values[size * (k + 1) : size * (k + 2)] for k in range(size)]
        solution, determinant = solve_dense(w, matrix, [w.negate(value) for value in values[:size]])
        for name, value in zip(block.unknowns, solution, strict=True):
            e.bind(name, value)
        if block.tested:
            self._end_linear(block, solution, determinant)

    def _end_linear(self, block: programs.Solve, solution: Sequence[str], determinant: str) -> None:
        w, e = self.writer, self.emitter
        self._count_iteration()
        self._test_determinant(determinant)
        going = w.compare("==", w.read(programs.STATUS), w.number(0.0))
        for name, value in zip(block.unknowns, solution, strict=True):
            rate = w.binary("/", value, e.value(symbol("h")))
            w.write(f"{name}_rate", w.select(going, rate, w.read(f"{name}_rate")))

    def _test_determinant(self, determinant: str) -> None:
        """It must keep its sign; the first and the last good one are kept."""
        w, place = self.writer, self._solves
        first = w.read(f"first_{place}")
        good = w.compare(">=", w.binary("*", first, determinant), w.number(0.0))
        good = w.both(good, w.compare("!=", determinant, w.number(0.0)))
        self.stop_unless(good, programs.SINGULAR + place, determinant)
        going = w.compare("==", w.read(programs.STATUS), w.number(0.0))
        begun = w.compare("!=", first, w.number(0.0))
        w.write(f"first_{place}", w.select(begun, first, w.select(going, determinant, first)))
        w.write(f"last_{place}", w.select(going, determinant, w.read(f"last_{place}")))
        self._solves += 1

    def _guard(self, block: programs.Solve, determinant: str) -> None:
        """|det - det0| < |det0| with det0 that of h -> 0 (at the new rates)."""
        if block.limit is None:
            return
        w, e = self.writer, self.emitter
        with e.inner():
            for name in block.unknowns:
                e.bind(name, w.read(name))
            limit = e.value(block.limit)
        distance = w.absolute(w.binary("-", determinant, limit))
        ratio = w.binary("/", distance, w.absolute(limit))
        self.stop_unless(w.compare("<", ratio, w.number(1.0)), programs.GUARDED + self._solves, ratio)

    def _count_iteration(self) -> None:
        w = self.writer
        w.write_counter("iterations", w.add_counters(w.read_counter("iterations"), "1"))

    def _begin_loop(self, unknowns: Sequence[str]) -> str:
        """Slots, first guesses rate * h and the label of the loop."""
        w, e = self.writer, self.emitter
        label = f"iterate_{self._labels}"
        self._declare([*unknowns, f"{label}_settled", f"{label}_before"])
        w.write(f"{label}_settled", w.number(0.0))
        w.write(f"{label}_before", w.number(HUGE))
        step = e.value(symbol("h"))
        for name in unknowns:
            w.write(name, w.binary("*", w.read(f"{name}_rate"), step))
        w.counter(label)
        w.write_counter(label, "0")
        w.label(label)
        for name in unknowns:
            e.bind(name, w.read(name))
        return label

    def _end_loop(self, label: str, settled: str, most: int) -> None:
        w = self.writer
        w.write(f"{label}_settled", settled)
        count = w.add_counters(w.read_counter(label), "1")
        w.write_counter(label, count)
        self._count_iteration()
        stopped = w.compare("!=", w.read(programs.STATUS), w.number(0.0))
        good = w.compare("==", w.select(stopped, w.number(1.0), settled), w.number(1.0))
        w.branch(w.everywhere(good), f"{label}_done", f"{label}_test")
        w.open(f"{label}_test")
        w.branch(w.compare_counters("<", count, str(most)), label, f"{label}_done")
        w.open(f"{label}_done")

    def _newton(self, block: programs.Solve) -> None:
        w, e = self.writer, self.emitter
        size = len(block.unknowns)
        entries = [entry for row in block.jacobian for entry in row]
        formulas = self._hoisted([*block.residuals, *entries], block.unknowns)
        tag = f"b{self._solves}"
        self._declare([f"{tag}_determinant"])
        w.write(f"{tag}_determinant", w.number(0.0))
        with e.inner():
            label = self._begin_loop(block.unknowns)
            values = e.write(formulas)
            matrix = [values[size * (k + 1) : size * (k + 2)] for k in range(size)]
            change, determinant = solve_dense(w, matrix, values[:size])
            settled = self._apply(label, block, change, LAST_CORRECTION)
            self._keep_worst(f"{tag}_determinant", determinant)
            self._end_loop(label, settled, MOST_NEWTON_STEPS)
        good = w.compare("==", w.read(f"{label}_settled"), w.number(1.0))
        self.stop_unless(good, programs.NO_CONVERGENCE + self._solves, w.read(f"{tag}_determinant"))
        self._guard(block, w.read(f"{tag}_determinant"))
        self._test_determinant(w.read(f"{tag}_determinant"))
        self._keep_rates(block.unknowns)

    def _keep_worst(self, slot: str, determinant: str) -> None:
        """The determinant, or one of the wrong sign that an iterate met before: Newton has then left its basin."""
        w = self.writer
        first, met = w.read(f"first_{self._solves}"), w.read(slot)
        turned = w.compare("<", w.binary("*", first, met), w.number(0.0))
        w.write(slot, w.select(turned, met, determinant))

    def _apply(
        self, label: str, block: programs.Solve | programs.Iterate, change: Sequence[str], relative: float
    ) -> str:
        """unknown -= change; 1 from where every change is within its tolerance or is noise, else 0.

        The round-off of every state variable of the block counts for every unknown: an angle of 1e5 is known to 1e-11
        only, and so is a change of momentum that passes 0 there. Corrections are noise where they no longer fall
        (Hairer, Lubich, Wanner, VIII.6) and are small compared with the greatest increments so far: a stiff force
        is known to its stiffness times the round-off of the place, however small it is itself.
        """
        w = self.writer
        within, small, total, noise = w.number(1.0), w.number(1.0), w.number(0.0), self._noise(block)
        bounds = self._bounds(block)
        for name, delta in zip(block.unknowns, change, strict=True):
            new = w.binary("-", self.emitter.value(symbol(name)), delta)
            w.write(name, new)
            size, moved = w.absolute(delta), w.absolute(new)
            allowed = w.binary("+", w.binary("*", w.number(relative), moved), noise)
            within = w.select(w.compare("<=", size, allowed), within, w.number(0.0))
            small = w.select(w.compare("<=", size, bounds[name[0]]), small, w.number(0.0))
            total = w.binary("+", total, w.binary("*", delta, delta))
        stalls = w.compare(">=", total, w.read(f"{label}_before"))
        early = w.compare_counters("<", w.read_counter(label), str(EARLIEST_NOISE))
        w.write(f"{label}_before", w.choose(early, w.number(HUGE), total))
        reached = w.select(w.compare("==", within, w.number(1.0)), within, w.select(stalls, small, w.number(0.0)))
        before = w.read(f"{label}_settled")
        return w.select(w.compare("==", before, w.number(1.0)), before, reached)

    def _noise(self, block: programs.Solve | programs.Iterate) -> str:
        """The round-off of the state variables that the unknowns are added to."""
        w, noise = self.writer, self.writer.number(0.0)
        for scale in dict.fromkeys(scale for scale in block.scales if scale):
            size = w.binary("*", w.number(ROUND_OFF), w.absolute(self.emitter.value(symbol(scale))))
            noise = w.binary("+", noise, size)
        return noise

    def _bounds(self, block: programs.Solve | programs.Iterate) -> dict[str, str]:
        """What counts as small for the unknowns of each letter: NOISE times the greatest so far.

        Multipliers m are h times a change of momenta: what is small compared with h p is small, too, as all of them are
        noise where a motion needs no force.
        """
        w, e, found = self.writer, self.emitter, {}
        for letter in dict.fromkeys(name[0] for name in block.unknowns):
            greatest = w.read(programs.size_name(self._iterated, letter))
            sizes = [symbol(name) for name in block.unknowns if name[0] == letter]
            if letter == "m":
                sizes += [symbol("h") * symbol(f"p{scale[1:]}") for scale in block.scales if scale]
            for size in map(w.absolute, e.write(sizes)):
                greatest = w.select(w.compare(">", size, greatest), size, greatest)
            found[letter] = w.binary("*", w.number(NOISE), greatest)
        return found

    def _keep_rates(self, unknowns: Sequence[str]) -> None:
        w, e = self.writer, self.emitter
        step = e.value(symbol("h"))
        going = w.compare("==", w.read(programs.STATUS), w.number(0.0))
        for name in unknowns:
            value = w.read(name)
            e.bind(name, value)
            w.write(f"{name}_rate", w.select(going, w.binary("/", value, step), w.read(f"{name}_rate")))
            size, kept = w.absolute(value), programs.size_name(self._iterated, name)
            larger = w.both(going, w.compare(">", size, w.read(kept)))
            w.write(kept, w.select(larger, size, w.read(kept)))
        self._iterated += 1

    def _iterate(self, block: programs.Iterate) -> None:
        w, e = self.writer, self.emitter
        formulas = self._hoisted(block.formulas, block.unknowns)
        with e.inner():
            label = self._begin_loop(block.unknowns)
            values = e.write(formulas)
            change = [
                w.binary("-", e.value(symbol(name)), value) for name, value in zip(block.unknowns, values, strict=True)
            ]
            settled = self._apply(label, block, change, ROUND_OFF)
            self._end_loop(label, settled, MOST_ITERATIONS)
        good = w.compare("==", w.read(f"{label}_settled"), w.number(1.0))
        self.stop_unless(good, programs.NO_CONVERGENCE + 50, w.number(0.0))
        self._keep_rates(block.unknowns)


def _take_out(formula: Formula, changing: set[Formula], parts: dict[Formula, Formula], prefix: str) -> Formula:
    """The formula with its parts that do not depend on `changing` named; plain names and numbers stay."""
    if not formula.args:
        return formula
    if not (formula.free_symbols & changing):
        return _named(formula, parts, prefix)
    if isinstance(formula, symengine.Add | symengine.Mul):
        fixed = [part for part in formula.args if not (part.free_symbols & changing)]
        moving = [part for part in formula.args if part.free_symbols & changing]
        group = [_take_out(type(formula)(*fixed), changing, parts, prefix)] if fixed else []
        return formula.func(*group, *(_take_out(part, changing, parts, prefix) for part in moving))
    return formula.func(*(_take_out(part, changing, parts, prefix) for part in formula.args))


def _named(formula: Formula, parts: dict[Formula, Formula], prefix: str) -> Formula:
    if formula.free_symbols:
        return parts.setdefault(formula, symbol(f"{prefix}{len(parts)}"))
    return formula


class Kernel:
    """Writes one program with one writer."""

    def __init__(self, program: programs.Program, writer: LlvmWriter) -> None:
        self.program, self.writer = program, writer
        self.layout: programs.Layout = programs.layout_of(program)
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
        for place in range(len(self.program.observed)):
            w.slot(f"seen_{place}")
        with self.emitter.inner():
            self._first_signs()

    def _first_signs(self) -> None:
        """Those of the quantities that keep their signs, where the start shows them: the first step may pass a zero."""
        w, e = self.writer, self.emitter
        self._bind_state()
        known = set(map(symbol, (*self.program.state, *self.layout.arguments)))
        for place, watch in enumerate(self.program.watches):
            if watch.begin is None or not watch.begin.free_symbols <= known:
                continue
            noise = [watch.begin.diff(x) * x for x in map(symbol, self.program.state)]
            value, least = e.write([watch.begin, sum(part**2 for part in noise) * ROUND_OFF_AT_START**2])
            zero, slot = w.number(0.0), f"watch_{place}"
            sign = w.select(w.compare("<", value, zero), w.number(-1.0), w.number(1.0))
            sign = w.select(w.compare(">", w.binary("*", value, value), least), sign, zero)
            w.write(slot, w.select(w.compare("==", w.read(slot), zero), sign, w.read(slot)))

    def _step(self) -> None:
        w = self.writer
        w.label("next_step")
        left = w.compare_counters("<", w.read_counter("done"), w.read_counter("steps"))
        w.branch(left, "begin_step", "finish")
        w.open("begin_step")
        w.write_counter("stage", "0")
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
            if isinstance(statement, programs.Assign):
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
            if watch.kind in ("sign", "rank"):
                share = watch.limit if watch.kind == "rank" else 0.0
                self.blocks.keep_sign(f"watch_{place}", value, programs.WATCHED + place, share)
                continue
            if watch.kind in ("positive", "domain"):
                good = w.compare(">", value, zero)
            elif watch.kind == "bound":
                good = w.compare("<", w.absolute(value), limit)
            else:
                beyond = w.compare(">", w.absolute(value), limit)
                good = w.compare("==", w.select(beyond, limit, zero), zero)
            self.blocks.stop_unless(good, programs.WATCHED + place, value)

    def _leave_if_stopped(self, stopped: str, onwards: str) -> None:
        """A single trajectory ends here; lanes continue until all have ended."""
        w = self.writer
        w.branch(w.everywhere(w.compare("!=", w.read(programs.STATUS), w.number(0.0))), stopped, onwards)
        w.open(onwards)

    def _alive(self, value: str) -> str:
        """The value, 0 in lanes that have stopped."""
        if self.writer.lanes == 1:
            return value
        going = self.writer.compare("==", self.writer.read(programs.STATUS), self.writer.number(0.0))
        return self.writer.select(going, value, self.writer.number(0.0))

    def _seen(self) -> list[str]:
        """The observed values; one that is not finite ends the run."""
        w = self.writer
        values = self.emitter.write([formula for _, formula in self.program.observed]) if self.program.observed else []
        for place, value in enumerate(values):
            finite = w.compare("==", w.binary("*", value, w.number(0.0)), w.number(0.0))
            self.blocks.stop_unless(finite, programs.UNOBSERVABLE + place, value)
        return values

    def _observe(self, values: list[str]) -> None:
        w = self.writer
        for place, value in enumerate(values):
            size, greatest = w.absolute(self._alive(value)), w.read(f"maximum_{place}")
            w.write(f"maximum_{place}", w.select(w.compare(">", size, greatest), size, greatest))
            w.write(f"seen_{place}", value)

    def _update(self) -> None:
        names = programs.changing(self.program)
        values = self.emitter.write([update for update in self.program.updates if update is not None])
        for name, value in zip(names, values, strict=True):
            self._add_compensated(name, self._alive(value))

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
        w.write(programs.CLOCK, w.binary("+", w.read(programs.CLOCK), w.number(1.0)))
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
        names = programs.changing(self.program)
        if not names:
            return
        total = w.number(0.0)
        for name in names:
            total = w.binary("+", total, w.binary("*", w.read(name), w.number(0.0)))
        self.blocks.stop_unless(w.compare("==", total, w.number(0.0)), programs.NOT_FINITE, total)

    def _record(self) -> None:
        w = self.writer
        row = w.read_counter("rows")
        first = w.multiply_counters(row, str(len(self.layout.columns)))
        values = [w.read(name) for name in programs.changing(self.program)]
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


class AdaptiveKernel(Kernel):
    """Writes a program that estimates its error."""

    def _step(self) -> None:
        w = self.writer
        for name in ("left", "length"):
            w.slot(name)
        w.counter("tries")
        w.label("next_step")
        left = w.compare_counters("<", w.read_counter("done"), w.read_counter("steps"))
        w.branch(left, "begin_step", "finish")
        w.open("begin_step")
        w.write("left", self._whole_step)
        w.write_counter("tries", "0")
        w.label("next_try")
        with self.emitter.inner():
            self._try()
        more = w.compare_counters("<", w.read_counter("tries"), str(MOST_TRIES))
        w.branch(w.everywhere(self._arrived()), "end_tries", "try_again")
        w.open("try_again")
        w.branch(more, "next_try", "end_tries")
        w.open("end_tries")
        self.blocks.active = None
        zero = w.number(0.0)
        self.blocks.stop_unless(w.compare("==", w.read("left"), zero), programs.TOO_MANY, w.read("length"))
        # A motion that ends at this very point of the grid, as x'' = x'^2 at t = 1/x'(0): the time itself is not known
        # to more than the tolerance.
        known = w.binary("*", self.emitter.value(ALPHA), w.absolute(self._whole_step))
        self.blocks.stop_unless(
            w.compare(">", w.absolute(w.read(programs.TRIAL)), known), programs.TOO_SHORT, w.read(programs.TRIAL)
        )
        self._end_step()

    def _arrived(self) -> str:
        w = self.writer
        stopped = w.compare("!=", w.read(programs.STATUS), w.number(0.0))
        at_end = w.compare("==", w.read("left"), w.number(0.0))
        one = w.number(1.0)
        return w.compare("==", w.select(stopped, one, w.select(at_end, one, w.number(0.0))), one)

    def _try(self) -> None:
        w, e = self.writer, self.emitter
        left, trial, zero = w.read("left"), w.read(programs.TRIAL), w.number(0.0)
        trial = w.select(w.compare("==", trial, zero), w.binary("*", self._whole_step, w.number(FIRST)), trial)
        ends = w.compare("<=", w.absolute(left), w.binary("*", w.absolute(trial), w.number(1.01)))
        length = w.select(ends, left, trial)
        w.write("length", length)
        e.bind("h", length)
        e.bind(str(WHOLE_STEP), self._whole_step)
        self._bind_state()
        self._statements()
        assert self.program.error is not None
        error = e.value(self.program.error)
        going = w.both(w.compare("==", w.read(programs.STATUS), zero), w.compare("!=", left, zero))
        accepted = w.both(going, w.compare("<=", error, w.number(1.0)))
        self.blocks.active = accepted
        self._watch()
        seen = self._seen()
        self._observe(seen)
        self._update()
        accepted = w.both(accepted, w.compare("==", w.read(programs.STATUS), zero))
        w.write("left", w.select(accepted, w.binary("-", left, length, exact=True), left))
        self._next_trial(error, length, trial, accepted, going)
        self._count()

    def _next_trial(self, error: str, length: str, trial: str, accepted: str, going: str) -> None:
        """length times 0.9 error^(-1/2k), within bounds; a step that was cut short by the grid does not shorten it."""
        w = self.writer
        factor = w.binary("*", w.number(SAFETY), w.rough_root(error, 2 * self.program.order))
        factor = w.select(w.compare("<", factor, w.number(MOST)), factor, w.number(MOST))
        factor = w.select(w.compare(">", factor, w.number(LEAST)), factor, w.number(LEAST))
        factor = w.select(w.compare("==", error, error), factor, w.number(LEAST))
        new = w.binary("*", length, factor)
        keeps = w.both(accepted, w.compare("<", w.absolute(new), w.absolute(trial)))
        cut = w.both(keeps, w.compare("<", w.absolute(length), w.absolute(trial)))
        w.write(programs.TRIAL, w.select(going, w.select(cut, trial, new), w.read(programs.TRIAL)))
        shortest = w.binary("*", w.number(SHORTEST), w.absolute(self._whole_step))
        self.blocks.active = going
        self.blocks.stop_unless(w.compare(">", w.absolute(new), shortest), programs.TOO_SHORT, new)

    def _count(self) -> None:
        w = self.writer
        for name in ("tries", "iterations"):
            w.write_counter(name, w.add_counters(w.read_counter(name), "1"))

    def _alive(self, value: str) -> str:
        return self.writer.select(self.blocks.active or "true", value, self.writer.number(0.0))
