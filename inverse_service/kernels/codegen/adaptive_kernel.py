"""Kernels that choose their own steps: between the points of the grid as many as their error estimate asks for.

A trial step is accepted where the squared norm of its error is at most 1; the next one is longer or shorter by
0.9 error^(-1/k), within a factor of 5. The last step before a point of the grid ends on it. Source: E. Hairer, S. P.
Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), II.4.
"""

from __future__ import annotations

from inverse_service.kernels.codegen.kernel import Kernel
from inverse_service.kernels.codegen.program import (
    STATUS,
    TOO_MANY,
    TOO_SHORT,
    TRIAL,
)
from inverse_service.kernels.codegen.symengine_trees import ALPHA, WHOLE_STEP

SAFETY, MOST, LEAST = 0.9, 5.0, 0.2
FIRST = 1e-2  # of the grid's step: the first trial
SHORTEST = 1e-18  # of the grid's step
MOST_TRIES = 4_000_000  # between two points of the grid


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
        self.blocks.stop_unless(w.compare("==", w.read("left"), zero), TOO_MANY, w.read("length"))
        # A motion that ends at this very point of the grid, as x'' = x'^2 at t = 1/x'(0): the time itself is not known
        # to more than the tolerance.
        known = w.binary("*", self.emitter.value(ALPHA), w.absolute(self._whole_step))
        self.blocks.stop_unless(w.compare(">", w.absolute(w.read(TRIAL)), known), TOO_SHORT, w.read(TRIAL))
        self._end_step()

    def _arrived(self) -> str:
        w = self.writer
        stopped = w.compare("!=", w.read(STATUS), w.number(0.0))
        at_end = w.compare("==", w.read("left"), w.number(0.0))
        one = w.number(1.0)
        return w.compare("==", w.select(stopped, one, w.select(at_end, one, w.number(0.0))), one)

    def _try(self) -> None:
        w, e = self.writer, self.emitter
        left, trial, zero = w.read("left"), w.read(TRIAL), w.number(0.0)
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
        going = w.both(w.compare("==", w.read(STATUS), zero), w.compare("!=", left, zero))
        accepted = w.both(going, w.compare("<=", error, w.number(1.0)))
        self.blocks.active = accepted
        self._watch()
        seen = self._seen()
        self._observe(seen)
        self._update()
        accepted = w.both(accepted, w.compare("==", w.read(STATUS), zero))
        w.write("left", w.select(accepted, w.binary("-", left, length, exact=True), left))
        self._next_trial(error, length, trial, accepted, going)
        self._count()

    def _next_trial(self, error: str, length: str, trial: str, accepted: str, going: str) -> None:
        """length times 0.9 error^(-1/2k), within bounds; a step that was cut short by the grid does not shorten it."""
        w = self.writer
        power = w.call("pow", error, w.number(-0.5 / self.program.order))
        factor = w.binary("*", w.number(SAFETY), power)
        factor = w.select(w.compare("<", factor, w.number(MOST)), factor, w.number(MOST))
        factor = w.select(w.compare(">", factor, w.number(LEAST)), factor, w.number(LEAST))
        factor = w.select(w.compare("==", error, error), factor, w.number(LEAST))
        new = w.binary("*", length, factor)
        keeps = w.both(accepted, w.compare("<", w.absolute(new), w.absolute(trial)))
        cut = w.both(keeps, w.compare("<", w.absolute(length), w.absolute(trial)))
        w.write(TRIAL, w.select(going, w.select(cut, trial, new), w.read(TRIAL)))
        shortest = w.binary("*", w.number(SHORTEST), w.absolute(self._whole_step))
        self.blocks.active = going
        self.blocks.stop_unless(w.compare(">", w.absolute(new), shortest), TOO_SHORT, new)

    def _count(self) -> None:
        w = self.writer
        for name in ("tries", "iterations"):
            w.write_counter(name, w.add_counters(w.read_counter(name), "1"))

    def _alive(self, value: str) -> str:
        return self.writer.select(self.blocks.active or "true", value, self.writer.number(0.0))
