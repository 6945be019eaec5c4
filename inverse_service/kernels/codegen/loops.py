"""The loops of methods for any number of coordinates, as LLVM IR: compiled once for a processor,
for all scenes.

A scene contributes `evaluate(x, y)`, its right-hand side and the entries of its matrix, and
`inspect(x, z)`, what is watched and observed. Stages, sums of a tableau, the norm of an error,
Newton's method, the elimination within a band and compensated sums do not depend on it. A step is
that of `kernel`, with the same memory, control and record.

`PLAN` names the words that a run hands over: numbers, and addresses of arrays. The inputs x are t,
q, v, h, a, the parameters, and the unknowns of an implicit step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from inverse_service.kernels.codegen import kernel as written, program as programs
from inverse_service.kernels.codegen.llvm_writer import HARDLY_EVER, LlvmWriter, Operand, Value

# Numbers of coordinates, rows, entries; of entries below and above the diagonal; the place of an
# entry is row * stride + column + shift; cells of the matrix. `direct`: the outputs are the
# accelerations. `constant`: the matrix is. `kept`: rates of unknowns in the memory, or, of explicit
# methods, which coordinates stay at rest. The last four are those of a method that chooses its
# steps.
NUMBERS = (
    "size", "rows", "entries", "below", "above", "stride", "shift", "cells", "constant", "direct", "parameters",
    "walls", "observed", "kept", "stages", "nystrom", "estimates", "falls", "adaptive", "noisy", "root_of_one",
    "factored",
)  # fmt: skip
ADDRESSES = (
    "evaluate", "inspect", "noise", "places", "order", "x", "y", "z", "matrix", "right", "pivots", "nodes",
    "row_weights", "place_weights", "stage_weights", "ends", "errors", "end_errors", "speeds", "forces", "scratch",
    "kinds",
)  # fmt: skip
PLAN = (*NUMBERS, *ADDRESSES)
FIXED = (
    programs.STATUS,
    programs.CLOCK,
    programs.STOPPED_AT,
    programs.STOPPED_VALUE,
    programs.TRIAL,
    "t",
    "t_low",
)
TRIAL, MOMENT, MOMENT_LOW, STATE = (
    4,
    5,
    6,
    len(FIXED),
)  # places in the memory, then q, v, and what their sums lost
SCRATCH = 19  # times the size: rows of numbers that a step needs for itself
SIGN_OF_DETERMINANT = programs.SINGULAR
FAR_END, SMALLEST, OTHERS, AT_ENDS = 1e-40, 1e-300, 1e-6, 0.01  # those of `schemes`, squared
SMALLEST_NORM, ROUND_OFF = 1e-200, 1e-15
# States that differ by -5/5 to 5/5 of this: enough for other last bits in all that follows.
PATTERN, MIDDLE, CHANGE = 11, 5, 1e-14
FAR_ABOVE = 1e7  # times the round-off of a place
SPREAD = 10.0  # times the differences: what round-off may make of an error


class LoopWriter(LlvmWriter):
    """Writes functions with loops over arrays, which are pointers by name."""

    def __init__(self) -> None:
        super().__init__()
        self._labels = 0
        self.functions: list[str] = []

    def address(self, name: str) -> None:
        """Make an array of the plan known by its name."""
        at = self._address("plan", PLAN.index(name), "i64")
        self.lines.append(f"  %{name} = load ptr, ptr {at}, align 8")

    def numbers(self, *names: str) -> list[Value]:
        """Numbers of the plan."""
        return [self.load("plan", PLAN.index(name), kind="counter") for name in names]

    def part(self, name: str, array: str, place: int | Value) -> None:
        """A name for an array from a place on."""
        self.lines.append(
            f"  %{name} = getelementptr double, ptr %{array}, i64 {self._text(place, 'counter')}"
        )

    def fresh(self, name: str) -> str:
        self._labels += 1
        return f"{name}_{self._labels}"

    @contextmanager
    def loop(self, begin: int | Value, end: int | Value) -> Iterator[Value]:
        """For each counter from `begin` up to `end`, that excluded."""
        name = self.fresh("loop")
        self.slot(name, kind="counter")
        self._set(name, begin)
        self.label(name)
        place = self[name]
        self.branch(
            self.new(f"icmp slt i64 {place.text}, {self._text(end, 'counter')}"),
            f"{name}_body",
            f"{name}_end",
        )
        self.open(f"{name}_body")
        yield place
        self[name] = place + 1
        self.jump(name)
        self.open(f"{name}_end")

    def _set(self, name: str, value: int | Value) -> None:
        self.lines.append(f"  store i64 {self._text(value, 'counter')}, ptr %s_{name}")

    @contextmanager
    def when(self, condition: Value) -> Iterator[None]:
        """Only where the condition holds."""
        name = self.fresh("when")
        self.branch(condition, name, f"{name}_end")
        self.open(name)
        yield
        self.label(f"{name}_end")

    def least(self, a: Value, b: Value) -> Value:
        """The smaller counter."""
        return self.new(f"select i1 {(a < b).text}, i64 {a.text}, i64 {b.text}", kind="counter")

    def either(self, condition: Value, yes: Value, no: Value) -> Value:
        """One of two counters."""
        return self.new(
            f"select i1 {condition.text}, i64 {yes.text}, i64 {no.text}", kind="counter"
        )

    def run(self, function: str, *arguments: str) -> None:
        """Call a function of the scene, at an address of the plan."""
        self.lines.append(
            f"  call void %{function}({', '.join(f'ptr %{one}' for one in arguments)})"
        )

    def define(self, head: str, body: Callable[[], None], ending: str = "ret void") -> None:
        """A function with this head."""
        self.lines, self._slots = [], {}
        body()
        slots = [
            f"  %s_{name} = alloca {'i64' if kind == 'counter' else 'double'}"
            for name, kind in self._slots.items()
        ]
        self.functions.append(
            "\n".join([f"{head} nounwind {{", "entry:", *slots, *self.lines, f"  {ending}", "}"])
        )


def driver_text(name: str) -> str:
    """The IR of `explicit` or `implicit`, a function of (plan, memory, weights, control, record)."""
    w = LoopWriter()
    three = "ptr noalias %out, ptr noalias %by, ptr noalias %of"
    w.define(
        f"define internal void @combined({three}, i64 %count, i64 %size)", lambda: _combined(w)
    )
    w.define("define internal double @factored(ptr %plan)", lambda: _factored(w), "ret double 0.0")
    w.define("define internal void @substituted(ptr %plan)", lambda: _substituted(w))
    arrays = ", ".join(
        f"ptr noalias %{name}" for name in ("plan", "memory", "weights", "control", "record")
    )
    run = _Run(w)
    w.define(
        f"define void @{name}({arrays})", {"explicit": run.explicit, "implicit": run.implicit}[name]
    )
    return "\n".join([*w.declared.values(), *w.functions, HARDLY_EVER]) + "\n"


def _combined(w: LoopWriter) -> None:
    """out_k = sum_j by_j of_jk: rows of numbers with their weights, most of which are 0."""
    count, size = (Value(w, name, kind="counter") for name in ("%count", "%size"))
    with w.loop(0, size) as k:
        w.store("out", k, 0.0)
    with w.loop(0, count) as j:
        weight, begin = w.load("by", j), j * size
        with w.when(weight.differs(0.0)), w.loop(0, size) as k:
            w.store("out", k, w.load("out", k) + weight * w.load("of", begin + k))


def _factored(w: LoopWriter) -> None:
    """L U of the matrix of the outputs, rows exchanged within the band; returns the sign of its
    determinant, or 0.
    """
    for name in ("y", "matrix", "places", "pivots"):
        w.address(name)
    size, entries, below, above, stride, shift, cells = w.numbers(
        "rows", "entries", "below", "above", "stride", "shift", "cells"
    )
    with w.loop(0, cells) as k:
        w.store("matrix", k, 0.0)
    with w.loop(0, entries) as k:
        w.store("matrix", w.load("places", k, kind="counter"), w.load("y", size + k))
    w.slot("sign", 1.0)
    w.slot("best")
    w.slot("pivot", kind="counter")
    reach = below + above
    with w.loop(0, size) as k:
        own, after = k * stride + shift, k + 1
        last, end = w.least(after + below, size), w.least(after + reach, size)
        w["best"], w["pivot"] = abs(w.load("matrix", own + k)), k
        with w.loop(after, last) as i:
            value = abs(w.load("matrix", i * stride + shift + k))
            larger = value > w["best"]
            w["best"] = larger.choose(value, w["best"])
            w["pivot"] = w.either(larger, i, w["pivot"])
        row = w["pivot"]
        w.store("pivots", k, row)
        good = w.fresh("regular")
        w.branch(w["best"] > 0.0, good, f"{good}_not", expected="yes")
        w.open(f"{good}_not")
        w.lines.append("  ret double 0.0")
        w.open(good)
        with w.when(row.differs(k)):
            other = row * stride + shift
            with w.loop(k, end) as j:
                upper, lower = w.load("matrix", own + j), w.load("matrix", other + j)
                w.store("matrix", own + j, lower)
                w.store("matrix", other + j, upper)
            w["sign"] = -w["sign"]
        pivot = w.load("matrix", own + k)
        w["sign"] = (pivot < 0.0).choose(-w["sign"], w["sign"])
        inverse = 1.0 / pivot
        with w.loop(after, last) as i:
            begin = i * stride + shift
            factor = w.load("matrix", begin + k) * inverse
            w.store("matrix", begin + k, factor)
            with w.when(factor.differs(0.0)), w.loop(after, end) as j:
                w.store(
                    "matrix",
                    begin + j,
                    w.load("matrix", begin + j) - factor * w.load("matrix", own + j),
                )
    w.give("double", w["sign"])
    w.open("never")


def _substituted(w: LoopWriter) -> None:
    """The solution of (L U) u = right, in its place."""
    for name in ("matrix", "right", "pivots"):
        w.address(name)
    size, below, above, stride, shift = w.numbers("rows", "below", "above", "stride", "shift")
    reach = below + above
    with w.loop(0, size) as k:
        row = w.load("pivots", k, kind="counter")
        value = w.load("right", row)
        w.store("right", row, w.load("right", k))
        w.store("right", k, value)
        with w.when(value.differs(0.0)), w.loop(k + 1, w.least(k + 1 + below, size)) as i:
            w.store(
                "right", i, w.load("right", i) - w.load("matrix", i * stride + shift + k) * value
            )
    w.slot("total")
    with w.loop(0, size) as back:
        k = size - back + -1
        own = k * stride + shift
        w["total"] = w.load("right", k)
        with w.loop(k + 1, w.least(k + 1 + reach, size)) as j:
            w["total"] = w["total"] - w.load("matrix", own + j) * w.load("right", j)
        w.store("right", k, w["total"] / w.load("matrix", own + k))


class _Run:
    """Writes the steps of a run."""

    def __init__(self, w: LoopWriter) -> None:
        self.w = w

    def _open(self) -> None:
        w = self.w
        for name in ADDRESSES:
            w.address(name)
        self.n, self.rows, self.walls, self.observed, parameters = w.numbers(
            "size", "rows", "walls", "observed", "parameters"
        )
        self.low = self.n + self.n + STATE  # what the sums of q, v have lost
        self.signs = (
            self.low + self.n + self.n + 2
        )  # behind the signs of the determinant: first and last
        self.maxima = self.signs + self.walls
        self.rates = self.maxima + self.observed
        self.arguments = self.rates + w.numbers("kept")[0]
        self.h, self.a = w.load("memory", self.arguments), w.load("memory", self.arguments + 1)
        inputs = self.n + self.n + 1
        w.store("x", inputs, self.h)
        w.store("x", inputs + 1, self.a)
        with w.loop(0, parameters) as k:
            w.store("x", inputs + 2 + k, w.load("memory", self.arguments + 2 + k))
        for place, name in enumerate(written.CONTROL):
            w.slot(name, w.load("control", place, kind="counter"), kind="counter")
        for name in ("status", "clock", "stopped_at", "stopped_value"):
            w.slot(name, w.load("memory", FIXED.index(name)))

    def _close(self) -> None:
        w = self.w
        w.label("finish")
        for place, name in enumerate(written.CONTROL):
            w.store("control", place, w[name])
        for name in ("status", "clock", "stopped_at", "stopped_value"):
            w.store("memory", FIXED.index(name), w[name])

    def _stop(self, code: Operand, value: Operand) -> None:
        w = self.w
        w["status"], w["stopped_at"], w["stopped_value"] = code, w["clock"], value
        w.jump("finish")

    def _stop_unless(self, condition: Value, code: Operand, value: Operand) -> None:
        w = self.w
        good = w.fresh("holds")
        w.branch(condition, good, f"{good}_not", expected="yes")
        w.open(f"{good}_not")
        self._stop(code, value)
        w.open(good)

    @contextmanager
    def _steps(self) -> Iterator[None]:
        """Each step of the grid, its record after it."""
        w = self.w
        w.label("next_step")
        w.branch(w["done"] < w["steps"], "begin_step", "finish")
        w.open("begin_step")
        w.branch(w["status"].equals(0.0), "may_step", "finish")
        w.open("may_step")
        yield
        w["clock"] = w["clock"] + 1.0
        w["done"] = w["done"] + 1
        w["until_record"] = until = w["until_record"] + -1
        w.branch(until > 0, "next_step", "record_row")
        w.open("record_row")
        both = self.n + self.n
        first = w["rows"] * (both + self.observed)
        with w.loop(0, both) as k:
            w.store("record", first + k, w.load("memory", k + STATE))
        with w.loop(0, self.observed) as k:
            w.store("record", first + both + k, w.load("z", self.walls + k))
        w["rows"] = w["rows"] + 1
        w["until_record"] = w["every"]
        w.jump("next_step")

    def _add(self, place: int | Value, lost: int | Value, change: Value) -> Value:
        """A compensated sum in the memory; returns the new value."""
        w = self.w
        old = w.load("memory", place)
        with w.exact():
            step = change - w.load("memory", lost)
            new = old + step
            w.store("memory", lost, (new - old) - step)
        w.store("memory", place, new)
        return new

    def _inspect(self) -> None:
        """The walls keep their signs, and what is observed has a value, at the inputs as they
        are.
        """
        w = self.w
        w.run("inspect", "x", "z")
        w.slot("code")
        w["code"] = float(programs.WATCHED)
        with w.loop(0, self.walls) as k:
            value, sign = w.load("z", k), w.load("memory", self.signs + k)
            own = (value < 0.0).choose(-1.0, 1.0)
            kept = sign.equals(0.0).choose(own, sign)
            w.store("memory", self.signs + k, kept)
            is_domain = w.load("kinds", k, kind="counter").differs(0)
            self._stop_unless(
                is_domain_or(w, is_domain, value > 0.0, kept * value > 0.0), w["code"], value
            )
            w["code"] = w["code"] + 1.0
        w["code"] = float(programs.UNOBSERVABLE)
        with w.loop(0, self.observed) as k:
            value, most = w.load("z", self.walls + k), w.load("memory", self.maxima + k)
            self._stop_unless((value * 0.0).equals(0.0), w["code"], value)
            size = abs(value)
            w.store("memory", self.maxima + k, (size > most).choose(size, most))
            w["code"] = w["code"] + 1.0

    def _test_sign(self, sign: Value) -> None:
        """That of the determinant must stay as it was first."""
        w = self.w
        place = self.signs + -2
        first = w.load("memory", place)
        self._stop_unless((first * sign) >= 0.0, float(SIGN_OF_DETERMINANT), sign)
        self._stop_unless(sign.differs(0.0), float(SIGN_OF_DETERMINANT), sign)
        w.store("memory", place, first.equals(0.0).choose(sign, first))
        w.store("memory", place + 1, sign)

    def _solve(self, regular: str) -> None:
        """Set the slot `regular` to the sign of the determinant at the inputs, 0 where there is no
        solution; the accelerations are then in `right`, as `order` says.
        """
        w = self.w
        w.run("evaluate", "x", "y")
        rows, entries = w.numbers("rows", "entries")
        with w.when(w["change"].differs(0.0)), w.loop(0, rows + entries) as k:
            w.store("y", k, w.load("y", k) * (1.0 + self._share(k) * (ROUND_OFF / MIDDLE)))
        direct, constant, done = w.numbers("direct", "constant", "factored")
        first = w.load("memory", self.signs + -2)
        w[regular] = first.equals(0.0).choose(1.0, first)
        name = w.fresh("solve")
        w.branch(direct.differs(0), f"{name}_end", name)
        w.open(name)
        kept = w.new(f"and i64 {constant.text}, {done.text}", kind="counter")
        w.branch(kept.differs(0), f"{name}_kept", f"{name}_new")
        w.open(f"{name}_new")
        w[regular] = w.new("call double @factored(ptr %plan)")
        w.branch(w[regular].equals(0.0), f"{name}_end", f"{name}_good")
        w.open(f"{name}_good")
        w.store("plan", PLAN.index("factored"), Value(w, "1", kind="counter"))
        w.label(f"{name}_kept")
        with w.loop(0, self.rows) as k:
            w.store("right", w.load("order", k, kind="counter"), w.load("y", k))
        w.lines.append("  call void @substituted(ptr %plan)")
        w.label(f"{name}_end")

    def explicit(self) -> None:
        """Explicit Runge-Kutta and Nystrom methods, of one step length or of their own."""
        w = self.w
        self._open()
        n = self.n
        both = n + n
        stages, nystrom, estimates, falls, adaptive, noisy, root_of_one, direct = w.numbers(
            "stages", "nystrom", "estimates", "falls", "adaptive", "noisy", "root_of_one", "direct"
        )
        chooses, is_nystrom, is_direct = adaptive.differs(0), nystrom.differs(0), direct.differs(0)
        rows = {
            "dq": 0, "dv": 1, "sizes": 2, "eq": 4, "ev": 5, "terms": 6, "kept": 7, "e": 9, "other": 13, "blur": 15,
        }  # fmt: skip
        for name, row in rows.items():
            w.part(name, "scratch", n * row)
        for name in (
            *("left", "length", "sum", "error", "coarse", "regular", "whole_q", "whole_v"),
            *("place", "speed", "force", "unknown", "near", "instant"),
        ):
            w.slot(name)
        w.slot("change")
        w.slot("tries", kind="counter")
        w.slot("refused", 0, kind="counter")
        w.slot("forgiven", 0, kind="counter")
        sources = w.new(f"select i1 {is_nystrom.text}, ptr %forces, ptr %speeds").text
        with self._steps():
            w["left"], w["tries"] = self.h, Value(w, "0", kind="counter")
            w.label("next_try")
            left, trial = w["left"], w.load("memory", TRIAL)
            trial = trial.equals(0.0).choose(self.h * written.FIRST, trial)
            near = (abs(left) <= abs(trial) * 1.01).choose(left, trial)
            w["length"] = length = chooses.choose(near, left)
            scale = is_nystrom.choose(length * length, length)
            moment = w.load("memory", MOMENT)
            w["change"] = 0.0
            with w.loop(0, both) as k:
                w.store("other", k, 0.0)
            w.label("make_step")
            change = w["change"]
            with w.loop(0, stages) as stage:
                node = w.load("nodes", stage)
                # Of a changed state, t is another one too.
                late = noisy.differs(0).choose(moment * ROUND_OFF, 0.0)
                late = change.differs(0.0).choose(late, 0.0)
                w.store("x", 0, (moment + late) + node * length)
                begin = stage * stages
                name = w.fresh("rows")
                for array, weights in (
                    (f"{name}_q", "place_weights"),
                    (f"{name}_v", "row_weights"),
                ):
                    w.lines.append(
                        f"  %{array} = getelementptr double, ptr %{weights}, i64 {begin.text}"
                    )
                self._combine("dq", f"%{name}_q", sources, stage)
                self._combine("dv", f"%{name}_v", "%forces", stage)
                drift = is_nystrom.choose(node * length, 0.0)
                with w.loop(0, n) as k:
                    q = w.load("memory", k + STATE) * (1.0 + w.load("other", k))
                    v = w.load("memory", k + n + STATE) * (1.0 + w.load("other", k + n))
                    w.store("x", k + 1, q + (drift * v + scale * w.load("dq", k)))
                    speed = v + length * w.load("dv", k)
                    w.store("x", k + n + 1, speed)
                    w.store("speeds", stage * n + k, speed)
                self._solve("regular")
                first = w.new(f"icmp eq i64 {stage.text}, 0")
                watched = w.new(
                    f"and i1 {first.text}, {w.new(f'xor i1 {chooses.text}, true').text}"
                )
                watched = w.new(
                    f"and i1 {watched.text}, {w.new(f'xor i1 {is_direct.text}, true').text}"
                )
                with w.when(watched):
                    self._test_sign(w["regular"])
                lost = is_direct.choose(1.0, w["regular"]).equals(0.0)
                with w.loop(0, n) as k:
                    found = lost.choose(float("nan"), self._acceleration(k, is_direct))
                    rests = w.load("memory", self.rates + k).differs(0.0)
                    w.store("forces", stage * n + k, rests.choose(0.0, found))
            self._combine("dq", "%ends", sources, stages)
            self._combine("dv", "%stage_weights", "%forces", stages)
            with w.loop(0, n) as k:
                drift = is_nystrom.choose(length * w.load("memory", k + n + STATE), 0.0)
                w.store("dq", k, drift + scale * w.load("dq", k))
                w.store("dv", k, length * w.load("dv", k))
            w["error"] = 0.0
            with w.when(change.differs(0.0)):
                self._restore()
            with w.when(chooses):
                self._estimate(sources, scale, length, moment, estimates, noisy, both)
            error = w["error"]
            rejected = w.new(f"xor i1 {(error <= 1.0).text}, true")
            # The same step from states that differ by round-off shows how much of the error no
            # shorter step makes smaller, where it is refused again.
            first = change.equals(0.0)
            w["refused"] = w.either(rejected & first, w["refused"] + 1, w["refused"])
            with w.when(rejected & first):
                self._measure_instant(length, noisy)
            # A step near the round-off of t and of the places leads to a pole, where that excuses
            # nothing.
            is_far = length * length > w["near"] * FAR_ABOVE**2
            again = rejected & first & (w["refused"] > 1) & is_far
            w.branch(chooses & again, "change_state", "judge", expected="yes")
            w.open("change_state")
            self._change_state(both)
            w["change"] = change + 1.0
            w.jump("make_step")
            w.open("judge")
            w.branch(rejected, "rejected", "accepted")
            w.open("accepted")
            # Where round-off was all of an error, the next steps that are refused ask for it at
            # once: shorter ones have no smaller error.
            few, one, none = (Value(w, digit, kind="counter") for digit in "410")
            left = w["forgiven"] + -1
            forgave = (w["refused"] > 1) & change.differs(0.0)
            w["forgiven"] = w.either(forgave, few, w.either(left > 0, left, none))
            w["refused"] = w.either(w["forgiven"] > 0, one, none)
            self._add(MOMENT, MOMENT_LOW, length)
            w["sum"] = 0.0
            with w.loop(0, n) as k:
                for array, place in (("dq", k), ("dv", k + n)):
                    new = self._add(place + STATE, place + self.low, w.load(array, k))
                    w["sum"] = w["sum"] + new * 0.0
            self._stop_unless(w["sum"].equals(0.0), float(programs.NOT_FINITE), w["sum"])
            with w.exact():
                w["left"] = w["left"] - length
            w.label("rejected")
            w["tries"], w["iterations"] = w["tries"] + 1, w["iterations"] + 1
            with w.when(chooses):
                self._next_trial(error, length, trial, falls, root_of_one)
            w.branch(w["left"].equals(0.0), "end_tries", "try_again")
            w.open("try_again")
            w.branch(w["tries"] < written.MOST_TRIES, "next_try", "end_tries")
            w.open("end_tries")
            self._stop_unless(w["left"].equals(0.0), float(programs.TOO_MANY), w["length"])
            known = chooses.choose(self.a * abs(self.h), -1.0)
            self._stop_unless(
                abs(w.load("memory", TRIAL)) > known,
                float(programs.TOO_SHORT),
                w.load("memory", TRIAL),
            )
            w.store("x", 0, w.load("memory", MOMENT))
            with w.loop(0, both) as k:
                w.store("x", k + 1, w.load("memory", k + STATE))
            self._inspect()
        self._close()

    def _combine(self, out: str, weights: str, source: str, count: Value) -> None:
        arguments = f"ptr %{out}, ptr {weights}, ptr {source}, i64 {count.text}, i64 {self.n.text}"
        self.w.lines.append(f"  call void @combined({arguments})")

    def _acceleration(self, k: Value, is_direct: Value) -> Value:
        w = self.w
        array = w.new(f"select i1 {is_direct.text}, ptr %y, ptr %right").text
        place = w.either(is_direct, k, w.load("order", k, kind="counter"))
        return w.new(
            f"load double, ptr {w.new(f'getelementptr double, ptr {array}, i64 {place.text}').text}, align 8"
        )

    def _estimate(
        self,
        sources: str,
        scale: Value,
        length: Value,
        moment: Value,
        estimates: Value,
        noisy: Value,
        both: Value,
    ) -> None:
        """The squared norm of the error, as `schemes` has it."""
        w, n = self.w, self.n
        with w.when(noisy.differs(0)):
            w.store("x", 0, moment + length)
            with w.loop(0, both) as k:
                w.store("x", k + 1, w.load("memory", k + STATE))
            w.run("noise", "x", "terms")
        is_changed = w["change"].differs(0.0)
        with w.when(w["change"].equals(0.0)):
            w["whole_q"], w["whole_v"] = 0.0, 0.0
            share = ROUND_OFF * length / self.a
            with w.loop(0, n) as k:
                q, v = w.load("memory", k + STATE), w.load("memory", k + n + STATE)
                noise = share * share * w.load("terms", k)
                dq, dv, fq, fv = (
                    w.load("dq", k),
                    w.load("dv", k),
                    length * v,
                    length * w.load("forces", k),
                )
                other, rate = v * self.h, q / self.h
                size_q = (
                    q * q + dq * dq + fq * fq + OTHERS * (other * other) + length * length * noise
                )
                size_v = v * v + dv * dv + fv * fv + OTHERS * (rate * rate) + noise
                w.store("sizes", k, size_q)
                w.store("sizes", n + k, size_v)
                w["whole_q"], w["whole_v"] = w["whole_q"] + size_q, w["whole_v"] + size_v
        w["coarse"] = 0.0
        with w.loop(0, estimates) as e:
            stages = w.numbers("stages")[0]
            name = w.fresh("weights")
            for array, weights in ((f"{name}_q", "end_errors"), (f"{name}_v", "errors")):
                w.lines.append(
                    f"  %{array} = getelementptr double, ptr %{weights}, i64 {(e * stages).text}"
                )
            self._combine("eq", f"%{name}_q", sources, stages)
            self._combine("ev", f"%{name}_v", "%forces", stages)
            w["sum"] = 0.0
            with w.loop(0, both) as k:
                is_place = k < n
                place = e * both + k
                factor, whole = (
                    is_place.choose(*pair)
                    for pair in ((scale, length), (w["whole_q"], w["whole_v"]))
                )
                found, old = factor * w.load("eq", k), w.load("e", place)
                apart = abs(found - old) * (SPREAD / self.a)
                known = is_changed & (apart * 0.0).equals(0.0)
                before = is_changed.choose(w.load("blur", place), 0.0)
                blur = known.choose((apart > before).choose(apart, before), before)
                w.store("blur", place, blur)
                error = is_changed.choose(old, found)
                w.store("e", place, error)
                size = w.load("sizes", k) + whole * FAR_END + SMALLEST
                w["sum"] = w["sum"] + error * error / (size + blur * blur)
            count = w.new(f"sitofp i64 {both.text} to double")
            found = w["sum"] / (count * (self.a * self.a))
            w["coarse"] = w.new(
                f"select i1 {e.equals(1).text}, double {found.text}, double {w['coarse'].text}"
            )
            w["error"] = w.new(
                f"select i1 {e.equals(0).text}, double {found.text}, double {w['error'].text}"
            )
        error = w["error"]
        mixed = error * error / (error + w["coarse"] * AT_ENDS + SMALLEST_NORM)
        w["error"] = (estimates > 1).choose(mixed, error)

    def _change_state(self, both: Value) -> None:
        """Keep the step, and set `other` to shares of round-off by which a state differs."""
        w = self.w
        with w.loop(0, both) as k:
            w.store("kept", k, w.load("dq", k))
            w.store("other", k, self._share(k) * (CHANGE / MIDDLE))

    def _share(self, k: Value) -> Value:
        """From -MIDDLE to MIDDLE, for each place another one in each changed state."""
        w = self.w
        count = w.new(f"fptosi double {w['change'].text} to i64", kind="counter")
        digit = w.new(f"srem i64 {((k + 1) * (count * 3 + 4)).text}, {PATTERN}", kind="counter")
        return w.new(f"sitofp i64 {(digit + -MIDDLE).text} to double")

    def _restore(self) -> None:
        """The step as it was kept."""
        w, n = self.w, self.n
        with w.loop(0, n + n) as k:
            w.store("dq", k, w.load("kept", k))

    def _next_trial(
        self,
        error: Value,
        length: Value,
        trial: Value,
        falls: Value,
        root_of_one: Value,
    ) -> None:
        w = self.w
        bits = w.new(f"bitcast double {error.text} to i64").text
        part = w.new(f"udiv i64 {bits}, {(falls + falls).text}").text
        root = w.new(f"bitcast i64 {w.new(f'sub i64 {root_of_one.text}, {part}').text} to double")
        factor = written.SAFETY * root
        factor = (factor < written.MOST).choose(factor, written.MOST)
        factor = (factor > written.LEAST).choose(factor, written.LEAST)
        factor = error.equals(error).choose(factor, written.LEAST)
        new = length * factor
        keeps = (error <= 1.0) & (abs(new) < abs(trial))
        cut = keeps & (abs(length) < abs(trial))
        w.store("memory", TRIAL, cut.choose(trial, new))
        self._stop_unless(abs(new) > written.SHORTEST * abs(self.h), float(programs.TOO_SHORT), new)
        with w.when(w.new(f"xor i1 {(error <= 1.0).text}, true")):
            # In the first step from rest, where a force begins at 0, no velocity is known yet.
            least = (w[programs.CLOCK] > 0.0).choose(w["instant"], 0.0)
            self._stop_unless(new * new > least, float(programs.TOO_SHORT), new)

    def _measure_instant(self, length: Value, noisy: Value) -> None:
        """Set `instant` to the square of a step whose stages are at one place and time, as
        `schemes` has it, and `near` to what it is where the force is not known.
        """
        w, n = self.w, self.n
        for name in ("place", "speed", "force", "unknown"):
            w[name] = 0.0
        with w.loop(0, n) as k:
            parts = {
                "place": w.load("memory", k + STATE),
                "speed": w.load("memory", k + n + STATE),
                "force": length * w.load("forces", k),
                "unknown": w.load("e", k + n),
            }
            for name, part in parts.items():
                w[name] = w[name] + part * part
        place, speed, force = w["place"], w["speed"], w["force"]
        slow = place * programs.CREEPING**2 / (self.h * self.h)
        span = place / (speed + slow + SMALLEST)
        felt = force / (force + programs.FELT**2 * (speed + slow) + SMALLEST)
        unknown = w["unknown"] / (w["unknown"] + programs.UNKNOWN**2 * force + SMALLEST)
        moment = noisy.differs(0).choose(w.load("memory", MOMENT), 0.0)
        # A changed state has another t by its round-off, and other places by ten times theirs and
        # more.
        w["near"] = programs.INSTANT**2 * (span + 1e-6 * (moment * moment)) * felt
        w["instant"] = programs.INSTANT**2 * (span + moment * moment) * felt * unknown

    def implicit(self) -> None:
        """Steps on (q, p) by Newton's method."""
        w = self.w
        self._open()
        n, rows = self.n, self.rows
        (parameters,) = w.numbers("parameters")
        multipliers = n + n + parameters + 3
        entries, constant = w.numbers("entries", "constant")
        w.part("u", "scratch", 0)
        for name in (
            "h_now",
            "before",
            "total",
            "noise",
            "settled",
            "small",
            "sign",
            "sum",
            "most",
            "turn",
        ):
            w.slot(name)
        for name in ("stage", "tries"):
            w.slot(name, kind="counter")
        zero = Value(w, "0", kind="counter")

        def set_point() -> None:
            """The inputs at the discrete point."""
            h = w["h_now"]
            w.store("x", 0, w.load("memory", MOMENT) + self.a * h)
            w.store("x", n + n + 1, h)
            with w.loop(0, n) as k:
                q, d = w.load("memory", k + STATE), w.load("u", k)
                w.store("x", k + 1, q + self.a * d)
                w.store("x", k + n + 1, d / h)
                w.store("x", multipliers + (rows - n) + k, q)
            with w.loop(n, rows) as k:
                w.store("x", multipliers + (k - n), w.load("u", k))
            w.run("evaluate", "x", "y")

        with self._steps():
            w["stage"] = zero
            w.label("next_stage")
            stage = w["stage"]
            w["h_now"] = h = self.h * w.load("weights", stage)
            w["noise"] = 0.0
            with w.loop(0, n) as k:
                w["noise"] = w["noise"] + written.ROUND_OFF * abs(w.load("memory", k + STATE))
            with w.loop(0, rows) as k:
                w.store("u", k, w.load("memory", self.rates + k) * h)
            w["before"], w["tries"] = written.HUGE, zero
            # The matrix has 1/h in the columns of d, and its determinant n times.
            odd = w.new(f"and i64 {n.text}, 1", kind="counter")
            w["turn"] = odd.differs(0).choose((h < 0.0).choose(-1.0, 1.0), 1.0)
            first = w.load("memory", self.signs + -2)
            w["sign"] = constant.differs(0).choose(first.equals(0.0).choose(1.0, first), 0.0)
            w.label("iterate")
            set_point()
            (done,) = w.numbers("factored")
            kept = w.new(f"and i64 {constant.text}, {done.text}", kind="counter")
            with w.when(kept.equals(0)):
                # A determinant of the wrong sign that an iterate met counts: Newton has then left
                # its basin.
                found = w.new("call double @factored(ptr %plan)") * w["turn"]
                self._stop_unless(found.differs(0.0), float(programs.NO_CONVERGENCE), float("nan"))
                w["sign"] = (w.load("memory", self.signs + -2) * w["sign"] < 0.0).choose(
                    w["sign"], found
                )
                w.store("plan", PLAN.index("factored"), Value(w, "1", kind="counter"))
            with w.loop(0, rows) as k:
                is_momentum = k < n
                place = w.either(is_momentum, k, zero)
                target = is_momentum.choose(w.load("memory", place + n + STATE), 0.0)
                w.store("right", w.load("order", k, kind="counter"), target - w.load("y", k))
            w.lines.append("  call void @substituted(ptr %plan)")
            w["total"], w["settled"], w["small"] = 0.0, 1.0, 1.0
            w["most"] = w.load("memory", TRIAL)
            with w.loop(0, n) as k:
                size = abs(w.load("u", k))
                w["most"] = (size > w["most"]).choose(size, w["most"])
            with w.loop(0, rows) as k:
                change = w.load("right", w.load("order", k, kind="counter"))
                new = w.load("u", k) + change
                w.store("u", k, new)
                size = abs(change)
                is_force = w.new(f"xor i1 {(k < n).text}, true")
                within = size <= (written.LAST_CORRECTION * abs(new) + w["noise"])
                w["settled"] = within.choose(w["settled"], is_force.choose(w["settled"], 0.0))
                small = size <= written.NOISE * w["most"]
                w["small"] = small.choose(w["small"], is_force.choose(w["small"], 0.0))
                w["total"] = w["total"] + is_force.choose(0.0, change * change)
            self._stop_unless(
                (w["total"] * 0.0).equals(0.0), float(programs.NO_CONVERGENCE), w["total"]
            )
            stalls = w["total"] >= w["before"]
            w["settled"] = stalls.choose(
                (w["small"] > w["settled"]).choose(w["small"], w["settled"]), w["settled"]
            )
            early = w["tries"] < written.EARLIEST_NOISE
            w["before"] = early.choose(written.HUGE, w["total"])
            w["tries"], w["iterations"] = w["tries"] + 1, w["iterations"] + 1
            w.branch(w["settled"].equals(1.0), "settled", "again")
            w.open("again")
            w.branch(w["tries"] < written.MOST_NEWTON_STEPS, "iterate", "lost")
            w.open("lost")
            self._stop(float(programs.NO_CONVERGENCE), w["sign"])
            w.open("settled")
            self._test_sign(w["sign"])
            set_point()
            self._inspect()
            pushes = rows + entries
            w["sum"] = 0.0
            h = w["h_now"]
            with w.loop(0, n) as k:
                d = w.load("u", k)
                w["sum"] = w["sum"] + self._add(k + STATE, k + self.low, d) * 0.0
                push = h * w.load("y", pushes + k)
                w["sum"] = w["sum"] + self._add(k + n + STATE, k + n + self.low, push) * 0.0
                size = abs(d)
                greatest = w.load("memory", TRIAL)
                w.store("memory", TRIAL, (size > greatest).choose(size, greatest))
            with w.loop(0, rows) as k:
                w.store("memory", self.rates + k, w.load("u", k) / h)
            self._add(MOMENT, MOMENT_LOW, h)
            self._stop_unless(w["sum"].equals(0.0), float(programs.NOT_FINITE), w["sum"])
            w["stage"] = after = w["stage"] + 1
            w.branch(after < w["stages"], "next_stage", "end_stages")
            w.open("end_stages")
        self._close()


def is_domain_or(w: LoopWriter, is_domain: Value, positive: Value, kept: Value) -> Value:
    """Whether a quantity is positive, where it has to be, or else keeps its sign."""
    return w.new(f"select i1 {is_domain.text}, i1 {positive.text}, i1 {kept.text}")
