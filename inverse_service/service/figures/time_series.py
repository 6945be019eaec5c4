"""Observed quantities against time, with their signs and their sizes, and error against work, one line per method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import style as styles

Tables = Mapping[str, Mapping[str, Array]]
FLOOR, ROUND_OFF = 1e-17, 1e-12
BINS = 160
MOST_PANELS = 4
# A signed panel shows values up to this multiple of the median of the greatest values; larger ones leave it.
REACH = 8
Column = Callable[[Mapping[str, Any], Mapping[str, Array]], Array | None]
Line = tuple[int, Mapping[str, Any], Array, Array]


@dataclass(frozen=True, slots=True)
class Quantity:
    """What is drawn: the label and the name of its size, and the signed columns, each with its label."""

    label: str
    words: str
    size: Column
    signed: Callable[[Mapping[str, Any], Tables, Mapping[str, Array] | None], Iterable[tuple[str, Column]]]


def keeps_energy(method: Mapping[str, Any], name: str = "energy") -> bool:
    """Whether a column of energies would be constant on the true motion, so that it has an error."""
    return "energy_note" not in method if name == "energy" else f"max_{name}_error" in method


def energy_error(name: str) -> Column:
    """E/E_0 - 1, or E - E_0 where E_0 is 0, of a column of energies; none if no energy is conserved."""

    def error(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
        if name not in table or not keeps_energy(method, name):
            return None
        start = method["energy_start"]
        found: Array = (table[name] - start) / (abs(start) or 1.0)
        return found

    return error


def constraint_defect(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
    """The greatest defect of all constraints."""
    columns = [np.abs(column) for name, column in table.items() if name.startswith("constraint_")]
    return np.max(columns, axis=0) if columns else None


def column(name: str) -> Column:
    """An unchanged column of the table."""
    return lambda method, table: table.get(name)


def difference(name: str, true: Array) -> Column:
    """q - q(t) of one coordinate; a run that ended early is compared at the points before its last."""

    def found(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
        own = table[name]
        count = len(own) if len(own) == len(true) else len(own) - 1
        return np.append(own[:count] - true[:count], [np.nan] * (len(own) - count))

    return found


def _differences(
    result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None
) -> Iterable[tuple[str, Column]]:
    for name, true in (truth or {}).items():
        yield styles.with_unit(f"{name} - true {name}", result, name), difference(name, true)


def _constraints(
    result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None
) -> Iterable[tuple[str, Column]]:
    names = dict.fromkeys(name for table in tables.values() for name in table if name.startswith("constraint_"))
    for name in names:
        yield name.replace("_", " "), column(name)


def _energy(name: str) -> Quantity:
    label = "E/E₀ - 1" + (" (discrete)" if name == "discrete_energy" else "")
    words = name.replace("_", " ") + " error"

    def varying(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
        return None if keeps_energy(method, name) else table.get("mechanical_energy", table.get(name))

    def signed(
        result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None
    ) -> Iterable[tuple[str, Column]]:
        # The energy of an L that was found for given equations is T + V only where a factor of t was taken out.
        found = result["system"]["lagrangian"] is None and not any(
            "mechanical_energy" in one for one in tables.values()
        )
        yield label, energy_error(name)
        yield "energy of the L found" if found else "E = T + V", varying
        if name == "energy":
            yield "conserved H, relative drift", column("conserved_1")

    return Quantity(f"|{label}|", words, energy_error(name), signed)


QUANTITIES = {
    "energy": _energy("energy"),
    "discrete_energy": _energy("discrete_energy"),
    "constraints": Quantity("greatest |ω(q) q'|", "defect of the constraints", constraint_defect, _constraints),
    "error": Quantity("greatest distance", "trajectory error", column("error"), _differences),
    "phase": Quantity(
        "|phase error| in radians", "phase error", column("phase_error"),
        lambda *_: iter([("phase error", column("phase_error"))]),
    ),
}  # fmt: skip


def series_figure(
    name: str, result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None = None
) -> tuple[Figure, str] | None:
    """The figure of one observed quantity with its caption: signed panels, and its size on a logarithmic axis.

    None where no method has it.
    """
    quantity = QUANTITIES[name]
    sizes = [
        (place, method, times, np.abs(values)) for place, method, times, values in _lines(result, tables, quantity.size)
    ]
    panels = [(label, lines) for label, one in quantity.signed(result, tables, truth)
              if (lines := _lines(result, tables, one))][:MOST_PANELS]  # fmt: skip
    if not sizes and not panels:
        return None
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.6, 3.4 + 1.7 * len(panels))
        heights = [1] * len(panels) + [1.9] * bool(sizes)
        axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights).ravel()
        notes = [note for one, panel in zip(axes, panels, strict=False) if (note := _signed(one, *panel))]
        every = _sizes(axes[-1], sizes, quantity.label) if sizes else 1
        axes[-1].set(xlabel=styles.with_unit(result.get("time", "t"), result))
        handles, labels = axes[-1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    return figure, series_caption(quantity.words, sizes) + styles.thinned(every) + "".join(dict.fromkeys(notes))


def _lines(result: Mapping[str, Any], tables: Tables, column_of: Column) -> list[Line]:
    found = []
    for place, method in enumerate(result["methods"]):
        table = tables.get(method["label"])
        values = None if table is None or method["method"] == "exact" else column_of(method, table)
        if table is not None and values is not None and np.isfinite(values).any():
            found.append((place, method, table["t"], values))
    return found


def _signed(axes: Axes, label: str, lines: Sequence[Line]) -> str:
    """Draw a panel centered at zero. Return a sentence if a line leaves it."""
    greatest = [float(np.nanmax(np.abs(np.where(np.isfinite(line[3]), line[3], np.nan)))) for line in lines]
    largest = max(greatest)
    reach = (
        min(largest, REACH * float(np.median([one for one in greatest if one > 1e-9 * largest] or [largest]))) or 1e-16
    )
    for place, method, times, values in lines:
        styles.draw_line(axes, times, values, styles.look(place, method["method"]), method["label"])
    axes.axhline(0, color="#888888", linewidth=0.6, zorder=1)
    axes.set(ylabel=styles.plain(label), ylim=(-1.08 * reach, 1.08 * reach))
    return " Larger values are outside the signed panels." if largest > reach else ""


def _sizes(axes: Axes, lines: Sequence[Line], label: str) -> int:
    """The sizes on a logarithmic axis; of how many points a piece has."""
    most = 1
    for shift, (place, method, times, values) in enumerate(lines):
        style = styles.look(place, method["method"])
        # The start is given and has no error; zeros are drawn at the floor.
        begin = 1 if len(values) > 1 and values[0] <= ROUND_OFF * np.nanmax(values) else 0
        heights = np.maximum(np.where(np.isfinite(values), values, np.nan), FLOOR)[begin:]
        t, _, high, every = styles.envelope(times[begin:], heights, BINS)
        most = max(most, every)
        axes.plot(
            t, high, color=style.color, linestyle=style.line, linewidth=1.3, marker=style.marker, markersize=4.5,
            markevery=styles.spread(len(t), 12, 7 * shift), fillstyle="none", label=styles.plain(method["label"]),
        )  # fmt: skip
    axes.set(yscale="log", ylim=_limits(lines), ylabel=label)
    return most


def _limits(lines: Sequence[Line]) -> tuple[float, float]:
    """From the smallest to the greatest positive value, with a margin, but not below round-off."""
    values = np.concatenate([line[3] for line in lines])
    values = values[np.isfinite(values) & (values > 0)]
    if not len(values):
        return 1e-17, 1e-15
    low = max(3e-18, 0.3 * min(float(np.nanmax(line[3][1:], initial=0.0)) or 1e-16 for line in lines) / 100)
    return low, 4 * float(values.max())


def series_caption(words: str, lines: Sequence[Line]) -> str:
    """Say which method preserves the quantity best and which one worst."""
    sizes = {method["label"]: float(np.nanmax(values)) for _, method, _, values in lines if np.isfinite(values).any()}
    sizes = {name: size for name, size in sizes.items() if math.isfinite(size)}
    if not sizes:
        return ""
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if best == worst:
        return f"Greatest {words}: {styles.shown(sizes[best])} ({best})."
    least, most = styles.shown(sizes[best]), styles.shown(sizes[worst])
    return f"Greatest {words}: {best} has the least ({least}), {worst} the most ({most})."


FAMILIES = {"geometric": "#0072B2", "explicit": "#D55E00", "implicit": "#009E73", "taylor": "#CC79A7"}
BY_ORDER = ((2, ":"), (4, "-."), (6, "--"), (99, "-"))
DRAWN_FIRST, PALE, LABEL_HEIGHT = 8, 0.3, 0.045  # curves in full color; how pale others are; of the height of the panel
PANELS = (("seconds", "time in s"), ("evaluations", "force evaluations"))


def precision_figure(result: Mapping[str, Any], evaluations: bool = False) -> tuple[Figure, str]:
    """The figure of a work-precision document and its caption: time against the error, and evaluations on request.

    A color for each family of methods, a line style for each order, the names at the ends of the curves. Points are
    joined in the order of h and end at the round-off floor; what failed is not drawn.
    """
    panels = PANELS[: 1 + evaluations]
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.6 * len(panels), 5.0)
        for axes, (key, label) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            ends = [
                end for place, name in enumerate(best_first(result)) if (end := _curve(axes, place, name, result, key))
            ]
            axes.set(xscale="log", yscale="log", xlabel="relative error of the trajectory, smaller to the right")
            axes.set_ylabel(label)
            axes.invert_xaxis()
            _label_ends(axes, [end for end in ends if end is not None])
    title = f"{result['name']}. " if result["name"] else ""
    return figure, f"{title}{result['sentences'][0]} Lower is better; curves end at the round-off floor."


def best_first(result: Mapping[str, Any]) -> list[str]:
    """The labels of the methods: those that reach most errors first, of these the cheapest at the smallest of them."""
    ranks: dict[str, tuple[int, float]] = {}
    for target in result["targets"]:
        for row in target["rows"]:
            reached, seconds = ranks.get(row["method"], (0, 0.0))
            known = row["seconds"] is not None
            ranks[row["method"]] = (reached - known, row["seconds"] if known else seconds)
    return sorted(ranks, key=ranks.__getitem__)


End = tuple[float, float, str, Any]


def _curve(axes: Axes, place: int, name: str, result: Mapping[str, Any], key: str) -> End | None:
    """Draw a method; (x, y, name, color) of its end."""
    drawn = [
        run for run in result["runs"] if run["method"] == name and run["error"] and run[key] and not run["at_floor"]
    ]
    method = next(one for one in result["methods"] if one["label"] == name)
    if not drawn:
        return None
    color = FAMILIES.get(method["family"], styles.TRUE_COLOR)
    line = next(line for order, line in BY_ORDER if (method["order"] or 99) <= order)
    faint = 1.0 if place < DRAWN_FIRST else PALE
    x, y = [run["error"] for run in drawn], [run[key] for run in drawn]
    axes.plot(x, y, color=color, linestyle=line, linewidth=1.5, alpha=faint, label=styles.plain(name))
    return x[-1], y[-1], name, (color, faint)


def _label_ends(axes: Axes, ends: Sequence[End]) -> None:
    """The names at the ends of the curves, moved up where they would lie on each other."""
    low, high = (math.log10(limit) for limit in axes.get_ylim())
    gap, top = LABEL_HEIGHT * (high - low), -math.inf
    for x, y, name, (color, faint) in sorted(ends, key=lambda end: end[1]):
        top = max(math.log10(y), top + gap)
        axes.annotate(
            styles.plain(name), (x, y), (1.02, (top - low) / (high - low)), textcoords="axes fraction", color=color,
            alpha=max(faint, 0.6), fontsize=8.5, va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": color, "alpha": 0.3 * faint, "linewidth": 0.6},
        )  # fmt: skip
