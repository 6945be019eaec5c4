"""A program as a whole compiled run: steps, substeps of a composition, Newton, compensated sums,
records.

Implicit blocks are Newton's method with a dense solve, one linear solve, or a fixed-point
iteration; small linear systems are written out: Gaussian elimination with row pivoting by
selection, no branch.

`memory` holds what `Layout` lists and is handed in and out, `weights` the substeps of the
composition, `control` = [steps to do, substeps, record every, steps to the next record, steps done,
rows written, Newton iterations], `record` one row of `Layout.columns` for each recorded step.

Kernels that choose their own steps make as many between the points of the grid as their error
estimate asks for. A trial step is accepted where the squared norm of its error is at most 1; the
next one is longer or shorter by 0.9 error^(-1/k), within a factor of 5. The last step before a
point of the grid ends on it. Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
Differential Equations I (1993), II.4.
"""

import operator
from collections.abc import Callable, Sequence
from functools import reduce
from typing import NamedTuple

import symengine

from inverse_service.kernels.codegen import program as programs
from inverse_service.kernels.codegen.llvm_writer import Emitter, LlvmWriter, Operand, Value
from inverse_service.kernels.codegen.symengine_trees import ALPHA, STEP, WHOLE_STEP, Formula, symbol

MOST_NEWTON_STEPS = 32
MOST_ITERATIONS = 200
# Newton's last correction may be this large (relative): quadratic convergence squares it.
LAST_CORRECTION = 1e-9
ROUND_OFF = 4.5e-16
# A correction that no longer falls is noise if it is this small compared with the greatest
# increments so far.
NOISE = 1e-6
NO_RANK = 1e-13  # of the product of the sums of its rows: a determinant that is round-off
EARLIEST_NOISE = 4  # iterations after which quadratic convergence has come to its end
HUGE = 1.7e308
ROUND_OFF_AT_START = (
    1e-14  # of what a variable of the start changes in a quantity: below, its sign is not known
)
CONTROL = ("steps", "stages", "every", "until_record", "done", "rows", "iterations")
SAFETY, MOST, LEAST = 0.9, 5.0, 0.2
FIRST = 1e-2  # of the grid's step: the first trial
SHORTEST = 1e-15  # of the grid's step
MOST_TRIES = 4_000_000  # between two points of the grid


def solve_dense(
    matrix: Sequence[Sequence[Value]], right: Sequence[Value]
) -> tuple[list[Value], Value]:
    """(solution of matrix x = right, determinant)."""
    size = len(right)
    if size == 1:
        return [right[0] / matrix[0][0]], matrix[0][0]
    if size == 2:  # Cramer's rule
        (a, b), (c, d) = matrix
        determinant = a * d - b * c
        above = right[0] * d - b * right[1], a * right[1] - right[0] * c
        return [one / determinant for one in above], determinant
    rows, inverses, determinant = _eliminated(
        [[*row, value] for row, value in zip(matrix, right, strict=True)]
    )
    solution = [line[size] for line in rows]
    for row in reversed(range(size)):
        for place in range(row + 1, size):
            solution[row] = solution[row] - rows[row][place] * solution[place]
        solution[row] = solution[row] * inverses[row]
    return solution, determinant


def determinant_of(matrix: Sequence[Sequence[Value]]) -> Value:
    """0 where a column has no pivot."""
    if len(matrix) == 1:
        return matrix[0][0]
    if len(matrix) == 2:
        (a, b), (c, d) = matrix
        return a * d - b * c
    if len(matrix) == 3:
        (a, b, c), (d, e, f), (g, h, i) = matrix
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    found = _eliminated(matrix).determinant
    return found.equals(found).choose(found, 0.0)


class Known(NamedTuple):
    """What does not change as a block is iterated: the round-off of the state variables that
    unknowns are added to, that of multipliers, the greatest size so far by the first letter, and
    the sizes of h p.
    """

    places: Operand
    multipliers: Operand
    sizes: dict[str, Value]
    pushes: Sequence[Value]


class Eliminated(NamedTuple):
    """Rows in which only what is above the diagonal counts, the reciprocals of the diagonal, and
    the determinant of the first columns.
    """

    rows: list[list[Value]]
    inverses: list[Value]
    determinant: Value


def _eliminated(matrix: Sequence[Sequence[Value]]) -> Eliminated:
    """Each pivot is divided by once: a division takes as long as three products."""
    rows, size, inverses = [[*row] for row in matrix], len(matrix), list[Value]()
    sign: Operand = 1.0
    for column in range(size):
        for row in range(column + 1, size):  # the largest entry of the column comes up by exchanges
            larger = abs(rows[row][column]) > abs(rows[column][column])
            for place in range(column, len(rows[row])):
                upper, lower = rows[column][place], rows[row][place]
                rows[column][place], rows[row][place] = (
                    larger.choose(lower, upper),
                    larger.choose(upper, lower),
                )
            sign = larger.choose(-sign, sign)
        inverses.append(1.0 / rows[column][column])
        for row in range(column + 1, size):
            factor = rows[row][column] * inverses[column]
            for place in range(column + 1, len(rows[row])):
                rows[row][place] = rows[row][place] - factor * rows[column][place]
    determinant = reduce(operator.mul, (rows[k][k] for k in range(size))) * sign
    return Eliminated(rows, inverses, determinant)


class Blocks:
    """Writes implicit blocks and the tests that end a run, and counts them."""

    def __init__(self, writer: LlvmWriter, emitter: Emitter, momenta: Sequence[str] = ()) -> None:
        self.writer, self.emitter, self.momenta = writer, emitter, momenta
        self._solves = self._labels = self._iterated = self._stops = 0
        self.active: Value | None = (
            None  # where it does not hold, nothing stops a run and no sign is kept
        )

    def going(self) -> Value:
        """Whether nothing has stopped the run."""
        return self.writer[programs.STATUS].equals(0.0)

    def stop_unless(
        self,
        condition: Value,
        code: int,
        value: Operand | Callable[[], Operand],
        counts: Callable[[], Value] | None = None,
    ) -> None:
        """Set the status of lanes where the condition fails, and that `counts`, and that have not
        stopped before. What is a function is only calculated there.
        """
        w = self.writer
        if w.lanes == 1 and self.active is None:
            self._branch_off(condition, code, value, counts)
            return
        status = w[programs.STATUS]
        going = status.equals(0.0)
        if counts is not None:
            going = going & counts()
        now = going.choose(condition.choose(0.0, float(code)), status)
        now = now if self.active is None else self.active.choose(now, status)
        stops = now.differs(status)
        w[programs.STATUS] = now
        w[programs.STOPPED_AT] = stops.choose(w[programs.CLOCK], w[programs.STOPPED_AT])
        shown = value() if callable(value) else value
        w[programs.STOPPED_VALUE] = stops.choose(shown, w[programs.STOPPED_VALUE])

    def _branch_off(
        self,
        condition: Value,
        code: int,
        value: Operand | Callable[[], Operand],
        counts: Callable[[], Value] | None,
    ) -> None:
        """One trajectory: a jump that is hardly ever taken costs less than the choice of four
        values.
        """
        w = self.writer
        self._stops += 1
        fails, first, onwards = (
            f"{name}_{self._stops}" for name in ("fails", "first_to_fail", "holds")
        )
        w.branch(condition, onwards, fails, expected="yes")
        w.open(fails)
        w.branch(self.going() if counts is None else self.going() & counts(), first, onwards)
        w.open(first)
        w[programs.STATUS], w[programs.STOPPED_AT] = float(code), w[programs.CLOCK]
        w[programs.STOPPED_VALUE] = value() if callable(value) else value
        w.label(onwards)

    def keep_sign(self, slot: str, value: Value, code: int, share: float = 0.0) -> None:
        """The value must keep the sign it had first, and this share of its size; where the slot is
        0 there is no first yet.
        """
        w = self.writer
        sign = w[slot]
        own = 1.0 / value if share else (value < 0.0).choose(-1.0, 1.0)
        kept = sign.equals(0.0).choose(own, sign)
        good = kept * value > share
        w[slot] = kept if self.active is None else self.active.choose(kept, w[slot])
        self.stop_unless(good, code, value)

    def linear(self, block: programs.Solve) -> None:
        w, e = self.writer, self.emitter
        size = len(block.unknowns)
        values = e.write(_formulas_of(block))
        matrix = [values[size * (k + 1) : size * (k + 2)] for k in range(size)]
        solution, determinant = solve_dense(matrix, [-value for value in values[:size]])
        for name, value in zip(block.unknowns, solution, strict=True):
            e.bind(name, value)
        if block.tested:
            w["iterations"] = w["iterations"] + 1
            self._test_determinant(determinant)
            going = self.going()
            for name, value in zip(block.unknowns, solution, strict=True):
                rate = value * e.value(1 / STEP)
                w[f"{name}_rate"] = going.choose(rate, w[f"{name}_rate"])

    def _test_determinant(self, determinant: Value) -> None:
        """It must keep its sign; the first and the last good one are kept."""
        w, place = self.writer, self._solves
        first = w[f"first_{place}"]
        good = first * determinant >= 0.0
        good = good & determinant.differs(0.0)
        self.stop_unless(good, programs.SINGULAR + place, determinant)
        going = self.going()
        begun = first.differs(0.0)
        w[f"first_{place}"] = begun.choose(first, going.choose(determinant, first))
        w[f"last_{place}"] = going.choose(determinant, w[f"last_{place}"])
        self._solves += 1

    def iterate(self, block: programs.Solve) -> None:
        """Newton's method, or a contraction where there is no Jacobian."""
        w, e, size, entries = self.writer, self.emitter, len(block.unknowns), block.entries
        self._labels += 1
        names, whole = [*block.unknowns], [*block.residuals, *entries]
        for one in block.inner:
            names += one.unknowns
            whole += _formulas_of(one)
        label, worst, determinant = f"iterate_{self._labels}", f"b{self._solves}_determinant", None
        w.slot(worst, 0.0)
        with e.inner():
            e.prepare(whole, names)
            w.slot(f"{label}_settled", 0.0)
            w.slot(f"{label}_before", HUGE)
            w.slot(label, 0, kind="counter")
            step = e.value(STEP)
            for name, guess in zip(block.unknowns, self._first_guesses(block, step), strict=True):
                w.slot(name, guess)
            known = self._known_before(block)
            w.label(label)
            for name in block.unknowns:
                e.bind(name, w[name])
            for one in block.inner:
                self.linear(one)
            change = e.write([*block.residuals, *entries])
            if entries:
                matrix = [change[size * (k + 1) : size * (k + 2)] for k in range(size)]
                change, determinant = solve_dense(matrix, change[:size])
            last = LAST_CORRECTION if entries else ROUND_OFF
            self._apply(label, block, change, last, known)
            if determinant is not None:
                # One of the wrong sign that an iterate met before counts: Newton has then left its
                # basin.
                first, met = w[f"first_{self._solves}"], w[worst]
                w[worst] = (first * met < 0.0).choose(met, determinant)
            w[label] = count = w[label] + 1
            w["iterations"] = w["iterations"] + 1
            good = w[programs.STATUS].differs(0.0).choose(1.0, w[f"{label}_settled"]).equals(1.0)
            w.branch(w.everywhere(good), f"{label}_done", f"{label}_test")
            w.open(f"{label}_test")
            w.branch(
                count < (MOST_NEWTON_STEPS if entries else MOST_ITERATIONS), label, f"{label}_done"
            )
            w.open(f"{label}_done")
        code = programs.NO_CONVERGENCE + (self._solves if entries else programs.CONTRACTION)
        self.stop_unless(w[f"{label}_settled"].equals(1.0), code, w[worst])
        if block.limit:  # |det - det0| < |det0| with det0 that of h -> 0 (at the new rates)
            with e.inner():
                for name in block.unknowns:
                    e.bind(name, w[name])
                values = e.write([entry for row in block.limit for entry in row])
            rows = [values[size * k : size * (k + 1)] for k in range(size)]
            limit = determinant_of(rows)
            away, size_of_limit = abs(w[worst] - limit), abs(limit)

            # Of a matrix without a rank the determinant is round-off, and nothing is compared.
            def has_rank() -> Value:
                sums = (reduce(operator.add, map(abs, row)) for row in rows)
                none = size_of_limit <= NO_RANK * reduce(operator.mul, sums)
                return none.choose(0.0, 1.0).equals(1.0)

            code = programs.GUARDED + self._solves
            self.stop_unless(away < size_of_limit, code, lambda: away / size_of_limit, has_rank)
        if entries:
            self._test_determinant(w[worst])
        step, inverse, going = e.value(STEP), e.value(1 / STEP), self.going()
        repeats = w["repeats"].equals(1.0)
        for name in block.unknowns:
            value = w[name]
            e.bind(name, value)
            before, rate = w[f"{name}_rate"], value * inverse
            if not block.guesses:
                # The next step goes on as the last two do, where they are of one length.
                goes_on = before.differs(0.0) & repeats
                w[f"{name}_trend"] = goes_on.choose(value - before * step, 0.0)
            w[f"{name}_rate"] = going.choose(rate, before)
            moved, kept = abs(value), programs.size_name(self._iterated, name)
            larger = going & (moved > w[kept])
            w[kept] = larger.choose(moved, w[kept])
        self._iterated += 1

    def _first_guesses(self, block: programs.Solve, step: Value) -> list[Value]:
        """What stages go on to is far from them after a jump, and then not taken."""
        w, names = self.writer, block.unknowns
        rates = [w[f"{name}_rate"] for name in names]
        if not block.guesses:
            return [
                rate * step + w[f"{name}_trend"] for name, rate in zip(names, rates, strict=True)
            ]
        with self.emitter.inner():
            for name, rate in zip(names, rates, strict=True):
                self.emitter.bind(name, rate)
            guesses = self.emitter.write(block.guesses)
        pairs = zip(guesses, rates, strict=True)
        return [(abs(one - rate) < abs(rate)).choose(one, rate) * step for one, rate in pairs]

    def _known_before(self, block: programs.Solve) -> Known:
        """The round-off of every state variable of the block counts for every unknown: an angle of
        1e5 is known to 1e-11 only, and so is a change of momentum that passes 0 there.

        Multipliers m are h times a change of momenta: what is small compared with h p is small,
        too, where a motion needs no force, and they are known to the round-off of h p.
        """
        places: Operand = 0.0
        for scale in dict.fromkeys(scale for scale in block.scales if scale):
            places = places + ROUND_OFF * abs(self.emitter.value(symbol(scale)))
        letters = dict.fromkeys(name[0] for name in block.unknowns)
        sizes = {one: self.writer[programs.size_name(self._iterated, one)] for one in letters}
        multipliers, pushes = places, list[Value]()
        if "m" in sizes:
            pushes = [*map(abs, self.emitter.write([STEP * symbol(name) for name in self.momenta]))]
            multipliers = places + ROUND_OFF * reduce(operator.add, pushes)
        return Known(places, multipliers, sizes, pushes)

    def _apply(
        self,
        label: str,
        block: programs.Solve,
        change: Sequence[Value],
        relative: float,
        known: Known,
    ) -> None:
        """unknown -= change; settled (1) from where every change is within its tolerance or is
        noise.

        Corrections are noise where they no longer fall (Hairer, Lubich, Wanner, VIII.6) and are
        small compared with the greatest increments so far: a stiff force is known to its stiffness
        times the round-off of the place, however small it is itself.
        """
        w, within = self.writer, list[Value]()
        before = w[f"{label}_settled"]
        for name, delta in zip(block.unknowns, change, strict=True):
            w[name] = new = self.emitter.value(symbol(name)) - delta
            noise = known.multipliers if name[0] == "m" else known.places
            within.append(abs(delta) <= relative * abs(new) + noise)
        reached = reduce(operator.and_, within).choose(1.0, before)
        w[f"{label}_settled"] = before.equals(1.0).choose(before, reached)
        w.branch(w[label] < EARLIEST_NOISE, f"{label}_applied", f"{label}_noise")
        w.open(f"{label}_noise")
        self._settle_noise(label, block, change, known)
        w.label(f"{label}_applied")

    def _settle_noise(
        self, label: str, block: programs.Solve, change: Sequence[Value], known: Known
    ) -> None:
        """Settled, too, where corrections no longer fall and are small."""
        w, bounds = self.writer, dict[str, Value]()
        for letter, greatest in known.sizes.items():
            pushes = known.pushes if letter == "m" else ()
            own = (self.emitter.value(symbol(name)) for name in block.unknowns if name[0] == letter)
            for size in (*pushes, *map(abs, own)):
                greatest = (size > greatest).choose(size, greatest)
            bounds[letter] = NOISE * greatest
        pairs = list(zip(block.unknowns, change, strict=True))
        small = (abs(delta) <= bounds[name[0]] for name, delta in pairs)
        total = reduce(operator.add, (delta * delta for _, delta in pairs))
        stalls = total >= w[f"{label}_before"]
        w[f"{label}_before"] = total
        settled = w[f"{label}_settled"]
        noisy = stalls.choose(reduce(operator.and_, small).choose(1.0, settled), settled)
        w[f"{label}_settled"] = settled.equals(1.0).choose(settled, noisy)


def _formulas_of(block: programs.Solve) -> list[Formula]:
    """What is written for a linear block: the right-hand sides and the matrix."""
    zero = {symbol(name): symengine.Integer(0) for name in block.unknowns}
    return [*(residual.subs(zero) for residual in block.residuals), *block.entries]


class Kernel:
    """Writes one program with one writer."""

    def __init__(self, program: programs.Program, writer: LlvmWriter) -> None:
        self.program, self.writer = program, writer
        self.layout: programs.Layout = programs.layout_of(program)
        self.emitter = Emitter(writer)
        momenta = [name for name in program.state if name[0] == "p"]
        self.blocks = Blocks(writer, self.emitter, momenta)

    def write(self) -> str:
        """The kernel's text."""
        w = self.writer
        self._open()
        w.label("next_step")
        w.branch(w["done"] < w["steps"], "begin_step", "finish")
        w.open("begin_step")
        self._step()
        self._end_step()
        w.open("stopped_early")
        w.label("finish")
        for array, names in (("memory", self.layout.persistent), ("control", CONTROL)):
            for place, name in enumerate(names):
                w.store(array, place, w[name])
        return w.text()

    def _open(self) -> None:
        w = self.writer
        for place, name in enumerate(self.layout.persistent):
            w.slot(name, w.load("memory", place))
        for name in self.layout.arguments:
            self.emitter.bind(name, w.load("memory", self.layout.names.index(name)))
        self.emitter.fix()
        self._whole_step = self.emitter.value(STEP)
        for place, name in enumerate(CONTROL):
            w.slot(name, w.load("control", place, kind="counter"), kind="counter")
        w.slot("stage", kind="counter")
        w.slot("repeats", w.select("i1", w["stages"] < 2, 1.0, 0.0))
        for place in range(len(self.program.observed)):
            w.slot(f"seen_{place}")
        with self.emitter.inner():
            self._first_signs()

    def _first_signs(self) -> None:
        """Those of the quantities that keep their signs, where the start shows them: the first step
        may pass a zero.
        """
        w, e = self.writer, self.emitter
        self._bind_state()
        known = {symbol(name) for name in (*self.program.state, *self.layout.arguments)}
        for place, watch in enumerate(self.program.watches):
            if watch.begin is None or not watch.begin.free_symbols <= known:
                continue
            noise = [watch.begin.diff(x) * x for x in map(symbol, self.program.state)]
            value, least = e.write(
                [watch.begin, sum(part**2 for part in noise) * ROUND_OFF_AT_START**2]
            )
            slot = f"watch_{place}"
            sign = (value < 0.0).choose(-1.0, 1.0)
            sign = (value * value > least).choose(sign, 0.0)
            w[slot] = w[slot].equals(0.0).choose(sign, w[slot])

    def _step(self) -> None:
        w = self.writer
        w["stage"] = 0
        w.label("next_stage")
        stage = w["stage"]
        with self.emitter.inner():
            self.emitter.bind("h", self._whole_step * w.load_shared("weights", stage))
            self._calculate()
            self._watch()
            seen = self._seen()
            self._leave_if_stopped("stopped_early", "go_on")
            self._observe(seen)
            self._update()
        w["stage"] = after = stage + 1
        w.branch(after < w["stages"], "next_stage", "end_stages")
        w.open("end_stages")

    def _calculate(self) -> None:
        """The statements, at the state."""
        self._bind_state()
        for statement in self.program.statements:
            if isinstance(statement, programs.Assign):
                self.emitter.bind(statement.name, self.emitter.value(statement.formula))
            else:
                (self.blocks.linear if statement.affine else self.blocks.iterate)(statement)

    def _bind_state(self) -> None:
        for name in self.program.state:
            self.emitter.bind(name, self.writer[name])

    def _watch(self) -> None:
        watches = self.program.watches
        entries = [entry for watch in watches for entry in watch.entries]
        values = iter(self.emitter.write(entries) if entries else [])
        for place, watch in enumerate(watches):
            value = determinant_of([[next(values) for _ in row] for row in watch.rows])
            if watch.kind in ("sign", "rank"):
                share = watch.limit if watch.kind == "rank" else 0.0
                self.blocks.keep_sign(f"watch_{place}", value, programs.WATCHED + place, share)
                continue
            if watch.kind in ("positive", "domain"):
                good = value > 0.0
            elif watch.kind == "bound":
                good = abs(value) < watch.limit
            else:
                good = (abs(value) > watch.limit).choose(watch.limit, 0.0).equals(0.0)
            self.blocks.stop_unless(good, programs.WATCHED + place, value)

    def _leave_if_stopped(self, stopped: str, onwards: str) -> None:
        """A single trajectory ends here; lanes continue until all have ended."""
        w = self.writer
        w.branch(w.everywhere(w[programs.STATUS].differs(0.0)), stopped, onwards)
        w.open(onwards)

    def _alive(self, value: Value) -> Value:
        """The value, 0 in lanes that have stopped."""
        return value if self.writer.lanes == 1 else self.blocks.going().choose(value, 0.0)

    def _seen(self) -> list[Value]:
        """The observed values; one that is not finite ends the run."""
        values = (
            self.emitter.write([formula for _, formula in self.program.observed])
            if self.program.observed
            else []
        )
        for place, value in enumerate(values):
            self.blocks.stop_unless((value * 0.0).equals(0.0), programs.UNOBSERVABLE + place, value)
        return values

    def _observe(self, values: list[Value]) -> None:
        w = self.writer
        for place, value in enumerate(values):
            size, greatest = abs(self._alive(value)), w[f"maximum_{place}"]
            w[f"maximum_{place}"] = (size > greatest).choose(size, greatest)
            w[f"seen_{place}"] = value

    def _update(self) -> None:
        """Compensated sums, Kahan (1965): the low part is what the sum lost."""
        w, names = self.writer, programs.changing(self.program)
        values = self.emitter.write(
            [update for update in self.program.updates if update is not None]
        )
        for name, value in zip(names, values, strict=True):
            increment, old = self._alive(value), w[name]
            with w.exact():
                step = increment - w[f"{name}_low"]
                new = old + step
                w[f"{name}_low"] = (new - old) - step
            w[name] = new

    def _end_step(self) -> None:
        w, names = self.writer, programs.changing(self.program)
        total: Operand = 0.0
        for name in names:
            total = total + w[name] * 0.0
        if isinstance(total, Value):
            self.blocks.stop_unless(total.equals(0.0), programs.NOT_FINITE, total)
        w[programs.CLOCK] = w[programs.CLOCK] + 1.0
        self._leave_if_stopped("stopped_early", "step_is_good")
        w["done"] = w["done"] + 1
        w["until_record"] = until = w["until_record"] + -1
        w.branch(until > 0, "next_step", "record_row")
        w.open("record_row")
        row = w["rows"]
        first = row * len(self.layout.columns)
        values = [
            w[name] for name in (*names, *(f"seen_{k}" for k in range(len(self.program.observed))))
        ]
        for place, value in enumerate(values):
            w.store("record", first + place, value)
        w["rows"] = row + 1
        w["until_record"] = w["every"]
        w.jump("next_step")


class AdaptiveKernel(Kernel):
    """Writes a program that estimates its error."""

    def _step(self) -> None:
        w = self.writer
        for name in ("left", "length"):
            w.slot(name)
        w.slot("tries", kind="counter")
        w["left"], w["tries"] = self._whole_step, 0
        w.label("next_try")
        with self.emitter.inner():
            self._try()
        more = w["tries"] < MOST_TRIES
        stopped, at_end = w[programs.STATUS].differs(0.0), w["left"].equals(0.0)
        arrived = stopped.choose(1.0, at_end.choose(1.0, 0.0)).equals(1.0)
        w.branch(w.everywhere(arrived), "end_tries", "try_again")
        w.open("try_again")
        w.branch(more, "next_try", "end_tries")
        w.open("end_tries")
        self.blocks.active = None
        self.blocks.stop_unless(w["left"].equals(0.0), programs.TOO_MANY, w["length"])
        # A motion that ends at this very point of the grid, as x'' = x'^2 at t = 1/x'(0): the time
        # itself is not known to more than the tolerance.
        known = self.emitter.value(ALPHA) * abs(self._whole_step)
        self.blocks.stop_unless(
            abs(w[programs.TRIAL]) > known, programs.TOO_SHORT, w[programs.TRIAL]
        )

    def _try(self) -> None:
        w, e = self.writer, self.emitter
        left, trial = w["left"], w[programs.TRIAL]
        trial = trial.equals(0.0).choose(self._whole_step * FIRST, trial)
        length = (abs(left) <= abs(trial) * 1.01).choose(left, trial)
        w["length"] = length
        e.bind("h", length)
        e.bind(str(WHOLE_STEP), self._whole_step)
        self._calculate()
        assert self.program.error is not None
        error = e.value(self.program.error)
        going = self.blocks.going() & left.differs(0.0)
        accepted = going & (error <= 1.0)
        self.blocks.active = accepted
        self._watch()
        seen = self._seen()
        self._observe(seen)
        self._update()
        accepted = accepted & self.blocks.going()
        with w.exact():
            w["left"] = accepted.choose(left - length, left)
        self._next_trial(error, length, trial, accepted, going)
        for name in ("tries", "iterations"):
            w[name] = w[name] + 1

    def _next_trial(
        self, error: Value, length: Value, trial: Value, accepted: Value, going: Value
    ) -> None:
        """length times 0.9 error^(-1/2k), within bounds; a step that was cut short by the grid does
        not shorten it.
        """
        w = self.writer
        factor = SAFETY * w.rough_root(error, 2 * self.program.order)
        factor = (factor < MOST).choose(factor, MOST)
        factor = (factor > LEAST).choose(factor, LEAST)
        factor = error.equals(error).choose(factor, LEAST)
        new = length * factor
        keeps = accepted & (abs(new) < abs(trial))
        cut = keeps & (abs(length) < abs(trial))
        w[programs.TRIAL] = going.choose(cut.choose(trial, new), w[programs.TRIAL])
        shortest = SHORTEST * abs(self._whole_step)
        self.blocks.active = going
        self.blocks.stop_unless(abs(new) > shortest, programs.TOO_SHORT, new)
        if self.program.instant is None:
            return
        if w.lanes == 1:
            w.branch(error <= 1.0, "is_long", "is_refused")
            w.open("is_refused")
        with self.emitter.inner():
            instant = self.emitter.value(self.program.instant)
        # In the first step from rest, where a force begins at 0, no velocity is known yet.
        least = (w[programs.CLOCK] > 0.0).choose(instant, 0.0)
        holds = (error <= 1.0).choose(1.0, (new * new > least).choose(1.0, 0.0))
        self.blocks.stop_unless(holds.equals(1.0), programs.TOO_SHORT, new)
        if w.lanes == 1:
            w.label("is_long")

    def _alive(self, value: Value) -> Value:
        return value if self.blocks.active is None else self.blocks.active.choose(value, 0.0)
