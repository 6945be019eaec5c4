"""A motion of a result as a picture, integrated from a start by Runge-Kutta steps of order 4."""

from __future__ import annotations

import base64
import importlib.util
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inverse_service.errors import InputError, missing_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from inverse_service.sympy.result_objects import Result

STEPS = 2000
START = 0.6  # of the first position; each further one is a third larger, velocities are 0
LARGE = 1e6


def draw_motion(
    result: Result, start: Sequence[float] | None, parameters: Mapping[str, float], time: float, axes: Axes | None
) -> Axes:
    """(x, x') for one coordinate, the path of the first two for more; InputError where the motion has no numbers."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise missing_extra(error) or error from None
    names = list(result._table.coordinates)
    states = motion(result, start, parameters, time)
    if axes is None:
        axes = Figure(figsize=(4, 3), layout="constrained").subplots()
    columns, labels = ((0, 1), (names[0], f"{names[0]}'")) if len(names) == 1 else ((0, 1), (names[0], names[1]))
    axes.plot(states[:, columns[0]], states[:, columns[1]], linewidth=1)
    axes.plot(*states[0, list(columns)], "o", markersize=4)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    if names[1:]:
        axes.set_aspect("equal", adjustable="datalim")
    return axes


def motion(
    result: Result, start: Sequence[float] | None, parameters: Mapping[str, float], time: float
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The states (q, v) at 0, …, `time`, cut off where they leave every bound; shape (steps + 1, 2 n)."""
    n, known = len(result._table.coordinates), list(result._table.parameters)
    if unknown := [name for name in parameters if name not in known]:
        raise InputError(f"{unknown[0]} is not a parameter of the system: it has {', '.join(known) or 'none'}.")
    if result._table.functions:
        raise InputError("A motion needs a formula for each arbitrary function: give it by 'where'.")
    usual = [*(START * (1 + k / 3) for k in range(n)), *[0.0] * n]
    state = np.array(usual if start is None else start, dtype=float)
    if state.shape != (2 * n,):
        raise InputError(f"A start has {2 * n} numbers: the positions, then the velocities.")
    values, force, step = (
        [float(parameters.get(name, 1)) for name in known],
        result.lambdify("accelerations"),
        time / STEPS,
    )

    def rate(t: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.concatenate([y[n:], np.array(force(t, *y, *values), dtype=float)])

    states = [state]
    with np.errstate(all="ignore"):
        for place in range(STEPS):
            t = place * step
            try:
                first = rate(t, state)
                second = rate(t + step / 2, state + step / 2 * first)
                third = rate(t + step / 2, state + step / 2 * second)
                last = rate(t + step, state + step * third)
            except (ArithmeticError, TypeError, ValueError):
                break
            state = state + step / 6 * (first + 2 * second + 2 * third + last)
            if not (np.abs(state) < LARGE).all():
                break
            states.append(state)
    return np.array(states)


def as_image(result: Result) -> str | None:
    """A PNG as an address for HTML; None where matplotlib is absent or the motion cannot be drawn."""
    if importlib.util.find_spec("matplotlib") is None or not result.get("verdict") or len(result.branches) > 1:
        return None
    try:
        axes = draw_motion(result, None, {}, 20.0, None)
    except (InputError, ValueError):
        return None
    stream = io.BytesIO()
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.savefig(stream, format="png", dpi=90)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
