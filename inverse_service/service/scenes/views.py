"""What the figures of a simulation show: the page draws these views with its script, files with
matplotlib; and what was measured as people read it: numbers, times, names of methods, and what an
error costs.

A figure has views to choose from. A view has axes and a line for each method, which keeps its color
by its place in the scene; observed quantities are functions of a method and its table of recorded
columns.
"""

import itertools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from inverse_service.expressions import printing
from inverse_service.integrators.trajectory import Array

Method = Mapping[str, Any]
Table = Mapping[str, Array]
Tables = Mapping[str, Table]
Column = Callable[[Method, Table], Array | None]
Line = tuple[int, Method, Array, Array]  # the place of a method, times, values

TRUE = ("exact", "reference")
# Okabe and Ito (2008), the yellow and the last two darkened: distinct for every color vision, on
# light and dark paper.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#8A6D3B", "#7E57C2")
DASHES = ("solid", "dash", "dashdot", "dot", "longdash", "longdashdot", "solid", "dash")
MOST_POINTS, BINS = 2001, 1000
DIGITS = 7
ROUND_OFF = 1e-9  # of the greatest value
# Observed quantities.
NAMES = (
    "runs",
    "path",
    "coordinates",
    "section",
    "work-precision",
    "energy",
    "constraints",
    "error",
    "observed",
)
TITLES = {"energy": "Energy error", "constraints": "Constraint defect", "error": "Trajectory error"}
# Columns that figures of their own show; "observed" has all others.
OF_OTHER_FIGURES = re.compile(
    r"t|error|(mechanical_|discrete_)?energy|energy_error|conserved_1|constraint_\d+|members?(_.*)?"
)
DASH, PRIME = "\u2013", "\u2032"
NAMES_OF_METHODS = {
    "runge-kutta": "Runge\u2013Kutta", "stormer-verlet": "St\u00f8rmer\u2013Verlet", "heyoka": "Taylor (heyoka)",
    "variational": "Variational", "nonholonomic": "Nonholonomic", "modified": "Modified", "adaptive": "Adaptive",
    "stiff": "Stiff", "reference": "Reference", "exact": "Exact",
}  # fmt: skip
LABEL = re.compile(
    rf"({'|'.join(NAMES_OF_METHODS)})(?:-(\d[\d._]*))?(?:-order(\d+))?((?:-[a-z]+)*)"
)


def short_number(value: Any, digits: int = 3) -> str:
    """So many digits, or a power of ten if it is shorter; a dash if the value is not a number."""
    if not isinstance(value, int | float):
        return DASH
    rounded = float(f"{value or 0:.{digits}g}")  # -0.0 is 0
    return f"{rounded:g}".replace("e-0", "e-").replace("e+0", "e")


def duration(seconds: Any) -> str:
    """Two digits of seconds, or of ms and microseconds where they are small: no time that is
    measured has more.
    """
    if not isinstance(seconds, int | float):
        return DASH
    for factor, unit in ((1e6, "\N{MICRO SIGN}s"), (1e3, "ms")):
        if seconds * factor < 999.5:
            return f"{short_number(seconds * factor, 2)} {unit}"
    return f"{short_number(seconds, 2)} s"


def power_of_ten(error: float) -> str:
    """A power of ten: 1e-3."""
    return f"{error:.0e}".replace("e-0", "e-").replace("e+00", "")


def method_name(label: str) -> str:
    """A method in words: "Variational 4" for variational-0.5-order4; a label of the scene's own as
    it is.
    """
    found = LABEL.fullmatch(label)
    if found is None:
        return label
    method, alpha, order, more = found.groups()
    words = NAMES_OF_METHODS[method] + (f" {order}" if order else "") + more.replace("-", ", ")
    return words if alpha in (None, "0.5") else f"{words}, \u03b1 = {alpha.replace('_', '/')}"


@dataclass(frozen=True, slots=True)
class Price:
    """What an error costs by a method: the time, the ratio to the best, the step; a dash where it
    is not reached.
    """

    time: str = DASH
    ratio: str = "not reached"
    setting: str = ""
    is_best: bool = False


def price_of(target: Mapping[str, Any], label: str) -> Price:
    """The cost of a target error by a method."""
    row = next(row for row in target["rows"] if row["method"] == label)
    if row["seconds"] is None:
        return Price(ratio="too slow" if row.get("too_slow") else "not reached")
    is_best = row["seconds"] == min(
        row["seconds"] for row in target["rows"] if row["seconds"] is not None
    )
    at_most = (
        "\u2264 " if row["at_most"] else ""
    )  # its coarsest setting is better than the error asked for
    setting = "step" if row["tolerance"] is None else "tolerance"
    ratio = "best" if is_best else f"{short_number(row['ratio'], 2)} \u00d7"
    return Price(
        f"{at_most}{duration(row['seconds'])}",
        ratio,
        f"{setting} {short_number(row[setting], 2)}",
        is_best,
    )


def best_first(result: Mapping[str, Any]) -> list[str]:
    """The labels of the methods: those that reach most errors first, of these the cheapest at the
    smallest of them.
    """
    ranks: dict[str, tuple[int, float]] = {}
    for target in result["targets"]:
        for row in target["rows"]:
            reached, seconds = ranks.get(row["method"], (0, 0.0))
            known = row["seconds"] is not None
            ranks[row["method"]] = (reached - known, row["seconds"] if known else seconds)
    return sorted(ranks, key=ranks.__getitem__)


def price_sentences(
    targets: Iterable[Mapping[str, Any]], called: Callable[[str], str] = str
) -> list[str]:
    """Which method is the fastest for which error, and what three more digits take with the best
    and the worst.

    `called` gives the names of the methods.
    """
    fastest: dict[str, list[str]] = {}
    known = []  # each error with the seconds of the methods that reach it and not more, the fastest first
    for target in targets:
        rows = [row for row in target["rows"] if row["seconds"] is not None]
        known.append(
            (target["error"], {row["method"]: row["seconds"] for row in rows if not row["at_most"]})
        )
        # What is better at its coarsest setting might be faster still.
        first = [*rows[:1], *(row for row in rows[1:] if row["at_most"])][:2]
        if first:
            names = " or ".join(called(row["method"]) for row in first)
            fastest.setdefault(names, []).append(power_of_ten(target["error"]))
    if not fastest:
        return ["No method reached a relative error of 1e-3. Take smaller steps."]
    cases = [f"{', '.join(errors)}: {names}" for names, errors in fastest.items()]
    found = [f"The fastest for an error of {'; for '.join(cases)}."]
    for (coarse, before), (fine, after) in itertools.pairwise(known):
        factors = {name: after[name] / before[name] for name in after if name in before}
        if coarse < 1e-3 and len(factors) > 1:
            best, worst = next(iter(factors)), max(factors, key=factors.__getitem__)
            each = [
                (short_number(factors[name], 2), called(name))
                for name in dict.fromkeys((best, worst))
            ]
            longer = [(f"{times} times " if times != "1" else "", name) for times, name in each]
            sentence = " and ".join(f"{times}as long with {name}" for times, name in longer)
            found.append(
                f"Three more digits, from {power_of_ten(coarse)} to {power_of_ten(fine)}, take {sentence}."
            )
            break
    return found


@dataclass(frozen=True, slots=True)
class Quantity:
    """What is drawn: the label and the name of its size, and the signed columns, each with its
    label.
    """

    label: str
    words: str
    size: Column
    signed: Callable[[Mapping[str, Any], Tables, Table | None], Iterable[tuple[str, Column]]]


def keeps_energy(method: Method, name: str = "energy") -> bool:
    """Whether a column of energies would be constant on the true motion, so that it has an
    error.
    """
    return "energy_note" not in method if name == "energy" else f"max_{name}_error" in method


def energy_error(name: str) -> Column:
    """E/E_0 - 1, or E - E_0 where E_0 is 0, of a column of energies; none if no energy is
    conserved.
    """

    def error(method: Method, table: Table) -> Array | None:
        start = method.get("energy_start")
        if name not in table or start is None or not keeps_energy(method, name):
            return None
        found: Array = (table[name] - start) / (abs(start) or 1.0)
        return found

    return error


def constraint_defect(method: Method, table: Table) -> Array | None:
    """The greatest defect of all constraints."""
    columns = [np.abs(column) for name, column in table.items() if name.startswith("constraint_")]
    return np.max(columns, axis=0) if columns else None


def column(name: str) -> Column:
    """An unchanged column of the table."""
    return lambda method, table: table.get(name)


def difference(name: str, times: Array, true: Array) -> Column:
    """q - q(t) of one coordinate at the times that both have; a run that ended early has its last
    time alone.
    """

    def found(method: Method, table: Table) -> Array | None:
        if method["method"] in TRUE:
            return None
        near = np.clip(np.searchsorted(times, table["t"] * (1 - 1e-9)), 0, len(times) - 1)
        return np.where(np.isclose(times[near], table["t"]), table[name] - true[near], np.nan)

    return found


def _differences(
    result: Mapping[str, Any], tables: Tables, truth: Table | None
) -> Iterable[tuple[str, Column]]:
    if truth is None:
        return
    for name in result["system"]["coordinates"]:
        label = with_unit(f"{name} \u2212 true {name}", result, name)
        yield label, difference(name, truth["t"], truth[name])


def _constraints(
    result: Mapping[str, Any], tables: Tables, truth: Table | None
) -> Iterable[tuple[str, Column]]:
    names = dict.fromkeys(
        name for table in tables.values() for name in table if name.startswith("constraint_")
    )
    for name in names:
        yield name.replace("_", " "), column(name)


def _energy(name: str) -> Quantity:
    label = "E/E₀ \u2212 1" + (" (discrete)" if name == "discrete_energy" else "")

    def varying(method: Method, table: Table) -> Array | None:
        return (
            None if keeps_energy(method, name) else table.get("mechanical_energy", table.get(name))
        )

    def signed(
        result: Mapping[str, Any], tables: Tables, truth: Table | None
    ) -> Iterable[tuple[str, Column]]:
        # The energy of an L that was found for given equations is T + V only where a factor of t
        # was taken out.
        is_known = any("mechanical_energy" in one for one in tables.values())
        found = result["system"]["lagrangian"] is None and not is_known
        yield label, energy_error(name)
        yield "energy of the L found" if found else "E = T + V", varying
        if name == "energy":
            yield f"conserved {_conserved_name(result)}, relative drift", column("conserved_1")

    return Quantity(f"|{label}|", name.replace("_", " ") + " error", energy_error(name), signed)


FIGURES = {
    "energy": _energy("energy"),
    "discrete_energy": _energy("discrete_energy"),
    "constraints": Quantity("greatest |ω(q) q'|", "defect of the constraints", constraint_defect, _constraints),
    "error": Quantity("greatest distance", "trajectory error", column("error"), _differences),
    "phase": Quantity(
        "|phase error| in radians", "phase error", column("phase_error"),
        lambda *_: iter([("phase error", column("phase_error"))]),
    ),
}  # fmt: skip


def method_lines(result: Mapping[str, Any], tables: Tables, column_of: Column) -> list[Line]:
    """The methods that have a column, but the exact one, which has no error."""
    return [
        (place, method, table["t"], values)
        for place, method, table in _drawn(result, tables, least=1)
        if method["method"] != "exact"
        and (values := column_of(method, table)) is not None
        and np.isfinite(values).any()
    ]


def without_start(values: Array) -> Array:
    """Sizes without the rounding of the first two points, which would stretch a logarithmic axis
    for nothing.
    """
    is_rounding = (np.arange(len(values)) < 2) & (values <= ROUND_OFF * np.nanmax(values))
    return np.where(is_rounding, np.nan, values)


def with_unit(label: str, result: Mapping[str, Any], name: str = "") -> str:
    """The label of an axis, with the unit that the scene gives to the name."""
    unit = result.get("units", {}).get(name or label)
    return f"{label} [{unit}]" if unit else label


# The figures of a result.


def tables_of(result: Mapping[str, Any]) -> dict[str, Table]:
    """The recorded columns of the methods that have some."""
    return {
        method["label"]: {
            name: np.array(values, dtype=float)
            for name, values in method["points"]["columns"].items()
        }
        for method in result["methods"]
        if method.get("points")
    }


def figures_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The figures of a simulation, each with its name, its title and its views."""
    if any("members" in method for method in result["methods"]):
        ends = run_views(result)
        return [{"name": "runs", "title": "The end of each run", "views": ends}] if ends else []
    tables, observed, pair = tables_of(result), set(result["observe"]), result["circle_coordinates"]
    found: list[tuple[str, str, list[dict[str, Any]]]] = []
    if "trajectory" in observed:
        if pair:
            path = path_view(result, tables)
            found.append(("path", path["label"] if path else "", [path] if path else []))
        names, kinds = result["system"]["coordinates"], (time_view, portrait_view)
        shown = [view for name in names for kind in kinds if (view := kind(name, result, tables))]
        found.append(("coordinates", "Coordinates in time", shown))
    found.append(("section", "Points at events", section_views(result)))
    for name in TITLES:
        if name in observed or name == "error":  # a true motion alone gives differences
            sizes = method_lines(result, tables, FIGURES[name].size)
            title = TITLES[name] if sizes or name != "energy" else "Energy"
            found.append((name, title, quantity_views(name, result, tables)))
    found.append(("observed", "Observed quantities", observed_views(result, tables)))
    return [{"name": name, "title": title, "views": shown} for name, title, shown in found if shown]


def varied_of(result: Mapping[str, Any]) -> dict[str, list[float]]:
    """What differs among the runs of an ensemble: parameters, and starts as x_start and v_x_start."""
    found = (columns for m in result["methods"] if (columns := m.get("members_columns")))
    names = result["system"]["parameters"]
    return {
        name: column
        for name, column in next(found, {}).items()
        if (name in names or name.endswith("_start")) and len(set(column)) > 1
    }


def heading_of(column: str) -> str:
    """v_x_end as x\u2032 at the end."""
    name, _, place = column.rpartition("_")
    if place not in ("start", "end"):
        return column.replace("_", " ")
    return f"{name.removeprefix('v_')}{PRIME * name.startswith('v_')} at the {place}"


def run_views(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Where each run of an ensemble ends, over the one number in which they differ."""
    varied = [*varied_of(result)]
    if len(varied) != 1:
        return []
    runs = [(k, m, of) for k, m in enumerate(result["methods"]) if (of := m.get("members_columns"))]
    found = []
    for name in (f"{q}_end" for q in result["system"]["coordinates"]):
        lines = [
            (k, m, np.array(of[varied[0]], dtype=float), np.array(of[name], dtype=float))
            for k, m, of in runs
        ]
        label = heading_of(name)
        found.append(view_of(label, heading_of(varied[0]), label, lines, dots=True))
    return [view for view in found if view]


def quantity_views(name: str, result: Mapping[str, Any], tables: Tables) -> list[dict[str, Any]]:
    """The sizes of a quantity on a logarithmic axis, and each of its columns with its sign."""
    quantity, draw = FIGURES[name], partial(method_lines, result, tables)
    true = next(
        (
            tables[m["label"]]
            for m in result["methods"]
            if m["method"] in TRUE and m["label"] in tables
        ),
        None,
    )
    sizes = [(*line[:3], without_start(np.abs(line[3]))) for line in draw(quantity.size)]
    sizes = [(*line[:3], np.where(line[3] > 0, line[3], np.nan)) for line in sizes]
    signed = [
        (label, draw(column_of)) for label, column_of in quantity.signed(result, tables, true)
    ]
    found = [
        view_of("size, logarithmic", with_unit("t", result), quantity.label, sizes, log_y=True)
    ]
    found += [
        view_of(f"{label}, with its sign", with_unit("t", result), label, lines, signed=True)
        for label, lines in signed
    ]
    return [
        view for view in (_kept_view(result, tables) if name == "energy" else None, *found) if view
    ]


def _conserved_name(result: Mapping[str, Any]) -> str:
    """The name of the first constant of the motion beside an energy that varies."""
    found = (name for method in result["methods"] for name in method.get("conserved") or ())
    name = next(found, "H")
    return name if name == "H" else f"quantity ({name})"


def _kept_view(result: Mapping[str, Any], tables: Tables) -> dict[str, Any] | None:
    """T + V with the H that a damped motion keeps, each divided by its start."""
    lines: list[dict[str, Any]] = []
    for place, method in enumerate(result["methods"]):
        table = tables.get(method["label"], {})
        if "conserved_1" not in table:
            continue
        mechanical = table.get("mechanical_energy", table["energy"])
        both = [(_conserved_name(result), "dash", 1 + table["conserved_1"])]
        both += [("T + V", "solid", mechanical / mechanical[0])] * bool(mechanical[0])
        for name, dash, values in both:
            line = _line(place, method, table["t"], values)
            lines.append({**line, "label": f"{name}, {line['label']}", "dash": dash})
    label = f"T + V and the conserved {_conserved_name(result)}, from 1 at the start"
    return {"label": label, "x": "t", "y": "part of the start", "lines": lines} if lines else None


def time_view(name: str, result: Mapping[str, Any], tables: Tables) -> dict[str, Any] | None:
    """A coordinate in time."""
    q = printing.displayed_name(name)
    lines = [(k, method, table["t"], table[name]) for k, method, table in _drawn(result, tables)]
    return view_of(f"{q} in time", with_unit("t", result), with_unit(q, result, name), lines)


def portrait_view(name: str, result: Mapping[str, Any], tables: Tables) -> dict[str, Any] | None:
    """Velocity against position; where no velocity was recorded, the slope between the recorded
    points.
    """
    q = printing.displayed_name(name)
    lines = [
        (
            k,
            method,
            table[name],
            table[f"v_{name}"] if f"v_{name}" in table else np.gradient(table[name], table["t"]),
        )
        for k, method, table in _drawn(result, tables)
    ]
    label = f"{q}, phase portrait"
    return view_of(
        label, with_unit(q, result, name), f"{q}\u2032", lines, dots=is_thinned(result, tables)
    )


def path_view(result: Mapping[str, Any], tables: Tables) -> dict[str, Any] | None:
    """The path in the plane of two coordinates."""
    a, b = pair = result["circle_coordinates"]
    is_plane = (a, b) == ("x", "y")
    title = (
        "Path in the plane"
        if is_plane
        else f"{printing.displayed_name(b)} over {printing.displayed_name(a)}"
    )
    x, y = (with_unit(printing.displayed_name(name), result, name) for name in pair)
    lines = [(k, method, table[a], table[b]) for k, method, table in _drawn(result, tables)]
    return view_of(title, x, y, lines, equal=is_plane, dots=is_thinned(result, tables))


def section_views(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The points at each event, each coordinate with its velocity (Poincare sections), but one that
    is zero there.
    """
    methods = [(k, method) for k, method in enumerate(result["methods"]) if method.get("events")]
    views = []
    for place, event in enumerate(methods[0][1]["events"] if methods else ()):
        moving = [name for name in result["system"]["coordinates"] if name != event["when"]]
        points = [(k, method, method["events"][place]["columns"]) for k, method in methods]
        for name in moving or result["system"]["coordinates"]:
            q = printing.displayed_name(name)
            lines = [
                (k, method, *(np.array(columns[key], dtype=float) for key in (name, f"v_{name}")))
                for k, method, columns in points
            ]
            label = f"{event['when']} = 0: {q}, {q}\u2032"
            views.append(view_of(label, with_unit(q, result, name), f"{q}\u2032", lines, dots=True))
    return [view for view in views if view]


def observed_views(result: Mapping[str, Any], tables: Tables) -> list[dict[str, Any]]:
    """Each column that no other figure shows, in time: whatever is observed is drawn."""
    names = result["system"]["coordinates"]
    portrayed = names if "trajectory" in result["observe"] else ()
    shown = {*names, *(f"v_{name}" for name in portrayed)}
    shown |= {name for pair in result.get("bodies", {}).values() for name in pair}
    own = {name for method in result["methods"] for name in method.get("observables") or ()}
    found = []
    for name in dict.fromkeys(name for table in tables.values() for name in table):
        if name in shown or OF_OTHER_FIGURES.fullmatch(name):
            continue
        parts = [name] if name in own else name.split("_")
        words = " ".join(map(printing.displayed_name, parts))
        lines = [
            (k, method, table["t"], table[name])
            for k, method, table in _drawn(result, tables)
            if name in table
        ]
        axes = with_unit("t", result), with_unit(words, result, name)
        found.append(view_of(f"{words} in time", *axes, lines))
    return [view for view in found if view]


def is_thinned(result: Mapping[str, Any], tables: Tables) -> bool:
    """Whether points were left out: lines between every k-th step would fill a circle to a ring."""
    every = result.get("record_every", 1)
    left_out = any(
        (method.get("points") or {}).get("every", 1) > every for method in result["methods"]
    )
    return left_out or any(len(table["t"]) > MOST_POINTS for table in tables.values())


def _drawn(
    result: Mapping[str, Any], tables: Tables, least: int = 2
) -> list[tuple[int, Method, Table]]:
    """The methods that recorded so many points at least, each with its place."""
    found = [
        (k, method, tables.get(method["label"], {})) for k, method in enumerate(result["methods"])
    ]
    return [(k, method, table) for k, method, table in found if len(table.get("t", ())) >= least]


def view_of(
    label: str, x: str, y: str, lines: Sequence[Line], **axes: bool
) -> dict[str, Any] | None:
    """None if no line has a point."""
    drawn = [_line(*line) for line in lines if np.isfinite(line[3]).any()]
    return {"label": label, "x": x, "y": y, "lines": drawn, **axes} if drawn else None


def _line(place: int, method: Method, x: Array, y: Array) -> dict[str, Any]:
    is_true = method["method"] in TRUE
    x, y = outline(x, y)
    return {
        "label": method_name(method["label"]),
        "place": place,
        "color": "ink" if is_true else color_of(place),
        "dash": "solid" if is_true else DASHES[(place + place // len(COLORS)) % len(DASHES)],
        "x": shortened(x),
        "y": shortened(y),
    }


def color_of(place: int) -> str:
    """The color of the method or body at this place."""
    return COLORS[place % len(COLORS)]


def outline(x: Array, y: Array) -> tuple[Array, Array]:
    """At most MOST_POINTS points of a line: every k-th one, or of each of BINS pieces of a function
    of time the least and the greatest, so that no peak is lost.
    """
    if len(x) <= MOST_POINTS:
        return x, y
    if not (np.diff(x) > 0).all():
        every = math.ceil(len(x) / MOST_POINTS)
        return x[::every], y[::every]
    edges, finite = np.linspace(0, len(y), BINS + 1).astype(int)[:-1], np.isfinite(y)
    low = np.minimum.reduceat(np.where(finite, y, np.inf), edges)
    high = np.maximum.reduceat(np.where(finite, y, -np.inf), edges)
    return np.repeat(x[edges], 2), np.stack([low, high], axis=1).ravel()


def shortened(values: Array) -> list[float | None]:
    """Numbers with so many digits as a picture shows; None for what is not one."""
    return [
        float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None for value in values.tolist()
    ]
