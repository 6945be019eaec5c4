"""Implicit blocks of a step as code: Newton with a dense solve, one linear solve, or a fixed-point iteration.

Small dense linear systems, written out: Gaussian elimination with row pivoting by selection, no branch.
"""

from __future__ import annotations

from collections.abc import Sequence

import symengine

from inverse_service.kernels.codegen.llvm_writer import LlvmWriter
from inverse_service.kernels.codegen.program import (
    CLOCK,
    GUARDED,
    NO_CONVERGENCE,
    SINGULAR,
    STATUS,
    STOPPED_AT,
    STOPPED_VALUE,
    Iterate,
    Solve,
    size_name,
)
from inverse_service.kernels.codegen.straight_line import Emitter
from inverse_service.kernels.codegen.symengine_trees import Formula, symbol


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


MOST_NEWTON_STEPS = 32
MOST_ITERATIONS = 200
# Newton's last correction may be this large (relative): quadratic convergence squares it.
LAST_CORRECTION = 1e-9
ROUND_OFF = 4.5e-16
# A correction that no longer falls is noise if it is this small compared with the greatest increments so far.
NOISE = 1e-6
EARLIEST_NOISE = 4  # iterations after which quadratic convergence has come to its end
HUGE = 1.7e308


class Blocks:
    """Writes implicit blocks and the tests that end a run, and counts them."""

    def __init__(self, writer: LlvmWriter, emitter: Emitter) -> None:
        self.writer, self.emitter = writer, emitter
        self._solves = self._labels = self._iterated = self._stops = 0
        self.active: str | None = None  # where it does not hold, nothing stops a run and no sign is kept

    def write(self, block: Solve | Iterate) -> None:
        if isinstance(block, Iterate):
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
        status = w.read(STATUS)
        good, going = w.number(0.0), w.compare("==", status, w.number(0.0))
        new = w.select(condition, good, w.number(float(code)))
        status_now = w.select(going, new, status)
        status_now = status_now if self.active is None else w.select(self.active, status_now, status)
        stops = w.compare("!=", status_now, status)
        w.write(STATUS, status_now)
        w.write(STOPPED_AT, w.select(stops, w.read(CLOCK), w.read(STOPPED_AT)))
        w.write(STOPPED_VALUE, w.select(stops, value, w.read(STOPPED_VALUE)))

    def _branch_off(self, condition: str, code: int, value: str) -> None:
        """One trajectory: a jump that is hardly ever taken costs less than the choice of four values."""
        w = self.writer
        self._stops += 1
        fails, first, onwards = (f"{name}_{self._stops}" for name in ("fails", "first_to_fail", "holds"))
        w.branch(condition, onwards, fails, rare=True)
        w.open(fails)
        w.branch(w.compare("==", w.read(STATUS), w.number(0.0)), first, onwards)
        w.open(first)
        w.write(STATUS, w.number(float(code)))
        w.write(STOPPED_AT, w.read(CLOCK))
        w.write(STOPPED_VALUE, value)
        w.jump(onwards)
        w.open(onwards)

    def keep_sign(self, slot: str, value: str, code: int) -> None:
        """The value must keep the sign it had first; where the slot is 0 there is no first yet."""
        w = self.writer
        sign, zero = w.read(slot), w.number(0.0)
        own = w.select(w.compare("<", value, zero), w.number(-1.0), w.number(1.0))
        fresh = w.compare("==", sign, zero)
        sign = w.select(fresh, own, sign)
        good = w.compare(">", w.binary("*", sign, value), zero)
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

    def _linear(self, block: Solve) -> None:
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

    def _end_linear(self, block: Solve, solution: Sequence[str], determinant: str) -> None:
        w, e = self.writer, self.emitter
        self._count_iteration()
        self._test_determinant(determinant)
        going = w.compare("==", w.read(STATUS), w.number(0.0))
        for name, value in zip(block.unknowns, solution, strict=True):
            rate = w.binary("/", value, e.value(symbol("h")))
            w.write(f"{name}_rate", w.select(going, rate, w.read(f"{name}_rate")))

    def _test_determinant(self, determinant: str) -> None:
        """It must keep its sign; the first and the last good one are kept."""
        w, place = self.writer, self._solves
        first = w.read(f"first_{place}")
        good = w.compare(">=", w.binary("*", first, determinant), w.number(0.0))
        good = w.both(good, w.compare("!=", determinant, w.number(0.0)))
        self.stop_unless(good, SINGULAR + place, determinant)
        going = w.compare("==", w.read(STATUS), w.number(0.0))
        begun = w.compare("!=", first, w.number(0.0))
        w.write(f"first_{place}", w.select(begun, first, w.select(going, determinant, first)))
        w.write(f"last_{place}", w.select(going, determinant, w.read(f"last_{place}")))
        self._solves += 1

    def _guard(self, block: Solve, determinant: str) -> None:
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
        self.stop_unless(w.compare("<", ratio, w.number(1.0)), GUARDED + self._solves, ratio)

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
        stopped = w.compare("!=", w.read(STATUS), w.number(0.0))
        good = w.compare("==", w.select(stopped, w.number(1.0), settled), w.number(1.0))
        w.branch(w.everywhere(good), f"{label}_done", f"{label}_test")
        w.open(f"{label}_test")
        w.branch(w.compare_counters("<", count, str(most)), label, f"{label}_done")
        w.open(f"{label}_done")

    def _newton(self, block: Solve) -> None:
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
        self.stop_unless(good, NO_CONVERGENCE + self._solves, w.read(f"{tag}_determinant"))
        self._guard(block, w.read(f"{tag}_determinant"))
        self._test_determinant(w.read(f"{tag}_determinant"))
        self._keep_rates(block.unknowns)

    def _keep_worst(self, slot: str, determinant: str) -> None:
        """The determinant, or one of the wrong sign that an iterate met before: Newton has then left its basin."""
        w = self.writer
        first, met = w.read(f"first_{self._solves}"), w.read(slot)
        turned = w.compare("<", w.binary("*", first, met), w.number(0.0))
        w.write(slot, w.select(turned, met, determinant))

    def _apply(self, label: str, block: Solve | Iterate, change: Sequence[str], relative: float) -> str:
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

    def _noise(self, block: Solve | Iterate) -> str:
        """The round-off of the state variables that the unknowns are added to."""
        w, noise = self.writer, self.writer.number(0.0)
        for scale in dict.fromkeys(scale for scale in block.scales if scale):
            size = w.binary("*", w.number(ROUND_OFF), w.absolute(self.emitter.value(symbol(scale))))
            noise = w.binary("+", noise, size)
        return noise

    def _bounds(self, block: Solve | Iterate) -> dict[str, str]:
        """What counts as small for the unknowns of each letter: NOISE times the greatest so far.

        Multipliers m are h times a change of momenta: what is small compared with h p is small, too, as all of them are
        noise where a motion needs no force.
        """
        w, e, found = self.writer, self.emitter, {}
        for letter in dict.fromkeys(name[0] for name in block.unknowns):
            greatest = w.read(size_name(self._iterated, letter))
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
        going = w.compare("==", w.read(STATUS), w.number(0.0))
        for name in unknowns:
            value = w.read(name)
            e.bind(name, value)
            w.write(f"{name}_rate", w.select(going, w.binary("/", value, step), w.read(f"{name}_rate")))
            size, kept = w.absolute(value), size_name(self._iterated, name)
            larger = w.both(going, w.compare(">", size, w.read(kept)))
            w.write(kept, w.select(larger, size, w.read(kept)))
        self._iterated += 1

    def _iterate(self, block: Iterate) -> None:
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
        self.stop_unless(good, NO_CONVERGENCE + 50, w.number(0.0))
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
