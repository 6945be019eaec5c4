"""Numbers of a scene: constants written as numbers or short formulas, and the grid of times."""

from __future__ import annotations

import math
import re

from api_schemas.scene import MAX_STEPS, SceneDocument
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.simulation.array_values import NoValue, array_value
from inverse_service.simulation.choices import Grid

MOST_RECORDED = 100_000
MOST_WITH_EVENTS = 2_000_000
_DECIMAL = re.compile(r"[-+]?[0-9]{1,40}(\.[0-9]{0,40})?([eE][-+]?[0-9]{1,3})?")


def number_of(text: str, pointer: str, what: str = "a number") -> float:
    """A number written as 0.1, "1/2" or "pi/4"; InputError for anything else and for what is not finite."""
    if _DECIMAL.fullmatch(text) and math.isfinite(value := float(text)):
        return value
    try:
        tree = read_formula(text, Names(time=False))
        value = float(array_value(tree, {})[0])
    except InputError as error:
        raise type(error)(error.detail, pointer, error.column) from None
    except (NoValue, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f'this is not {what}: write it as in 0.25, "1/4" or "pi/4".', pointer)
    return value


def read_grid(schema: SceneDocument, begin: float = 0.0) -> tuple[Grid, tuple[str, ...]]:
    """Step, number of steps and which are recorded, with a note where that is not every one asked for."""
    step = number_of(schema.step, "/step")
    if step <= 0:
        raise InputError(
            "the step must be a positive number: to run backwards, write -t for t in the system, which turns the signs "
            "of the velocities and of all terms that are odd in them.",
            "/step",
        )
    if (schema.steps is None) == (schema.time is None):
        raise InputError("give either 'steps' or 'time' beside 'step'.", "")
    steps = schema.steps or _steps_of(schema, step)
    notes: tuple[str, ...] = ()
    length = None if schema.time is None else number_of(schema.time, "/time")
    if length is not None and abs(steps * step - length) > 1e-9 * length:
        notes = (f"The run takes {steps * step:.10g}, to the first point of the grid beyond {length:.10g}.",)
    if steps > MAX_STEPS:
        raise LimitError(f"the scene has {steps} steps: the limit is {MAX_STEPS}; take a larger step.", "/time")
    every = schema.record_every or 1
    if schema.events:
        if every > 1 or steps > MOST_WITH_EVENTS:
            raise InputError(
                f"events need every step, and at most {MOST_WITH_EVENTS}: leave record_every out.", "/events"
            )
        return Grid(step, steps, 1, begin), notes
    if steps // every <= MOST_RECORDED:
        return Grid(step, steps, min(every, steps), begin), notes
    every = math.ceil(steps / MOST_RECORDED)
    note = f"Every {every}th step is recorded, so that at most {MOST_RECORDED} points are kept."
    return Grid(step, steps, every, begin), (*notes, note)


def _steps_of(schema: SceneDocument, step: float) -> int:
    length = number_of(schema.time or "", "/time")
    if length <= 0:
        raise InputError("the time must be a positive number.", "/time")
    count = length / step
    if count > 10 * MAX_STEPS:
        raise LimitError(f"the scene has more than {MAX_STEPS} steps: take a larger step or a shorter time.", "/time")
    return max(1, round(count) if abs(count - round(count)) < 1e-9 * count else math.ceil(count))
