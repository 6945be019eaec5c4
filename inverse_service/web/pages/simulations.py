"""The page of a simulation or a work-precision measurement: tables, figures as data for scripts and as files."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service.expressions import letters
from inverse_service.reading.names import Names
from inverse_service.service.documents.text_page import notes_of_formulas
from inverse_service.web.pages import preview, typesetting
from inverse_service.web.pages.rendering import duration, method_name, page, short_number

PICTURES = {"svg": "image/svg+xml", "png": "image/png"}
TABLES = {"csv": "text/csv", "npz": "application/zip"}
PRIME = "\u2032"
MOST_MEMBERS = 200  # of an ensemble on the page; the JSON has all
FIELD = "See `conserved`: "  # of the JSON
QUANTITIES = (
    ("max_energy_error", "energy error"),
    ("max_constraint", "constraint"),
    ("estimated_error", "estimated error"),
    ("max_error", "error"),
)


def simulation_result(address: str, job: Mapping[str, Any], document: str) -> HTMLResponse:
    """The page of a job of kind "simulate"; `address` is that of the service."""
    result = job["result"]
    columns = quantities(result)
    return page(
        "simulation.html",
        active="/simulate",
        job=job,
        result=result,
        headings=[heading for _, heading in columns],
        formulas=typesetting.formulas_of(result["system"]),
        start={name: f"{v or 0:.10g}" for name, v in start_of(result).items()},
        rows=[
            (m, [short_number(_value(m, key)) for key, _ in columns], _why(m), columns_of(m)) for m in result["methods"]
        ],
        ensembles=[(m["label"], *_members(of)) for m in result["methods"] if (of := m.get("members_columns"))],
        free=free_lagrangians(result),
        costs=costs(result),
        parts=part_costs(result),
        notes=notes_of(result),
        figures=figure_names(result),
        motion=motion_of(result),
        scene=document,
        curl=f"curl -s {address}/v1/simulate -H 'Content-Type: application/json' -d @scene.json",
    )


def _members(columns: Mapping[str, Sequence[Any]]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The headings and the first rows of the numbers of an ensemble, one row for each run."""
    rows = zip(*columns.values(), strict=True)
    shown = [(k, list(map(short_number, row))) for k, row in enumerate(itertools.islice(rows, MOST_MEMBERS), 1)]
    return list(map(_heading, columns)), shown


def _heading(column: str) -> str:
    """v_x_end as x\u2032 at the end."""
    name, _, place = column.rpartition("_")
    if place not in ("start", "end"):
        return column.replace("_", " ")
    return f"{name.removeprefix('v_')}{PRIME * name.startswith('v_')} at the {place}"


def start_of(result: Mapping[str, Any]) -> dict[str, float]:
    """The values of the parameters, the coordinates and the velocities at the start."""
    initial = result["initial"]
    velocities = {f"{name}{PRIME}": v for name, v in initial["velocities"].items()}
    return {**result["system"]["parameters"], **initial["positions"], **velocities}


@dataclass(frozen=True, slots=True)
class Price:
    """What an error costs by a method: the time, the ratio to the best, the step; a dash where it is not reached."""

    time: str = "\u2013"
    ratio: str = "not reached"
    setting: str = ""
    is_best: bool = False


@dataclass(frozen=True, slots=True)
class Curve:
    """A method as it was measured, from coarse to fine settings: steps, or the `tolerance`s of one that chooses them.

    The first `failed` settings were too coarse: they have no error.
    """

    label: str
    order: int | None
    setting: str
    at: list[float]
    errors: list[float]
    seconds: list[float]
    failed: int
    reason: str  # why nothing was measured; empty where something was

    @property
    def name(self) -> str:
        """The method in words."""
        return method_name(self.label)


def precision_result(job: Mapping[str, Any], document: str) -> HTMLResponse:
    """The page of a job of kind "work-precision": the picture, two sentences, the prices."""
    result = job["result"]
    curves = curves_of(result)
    measured = [curve for curve in curves if curve.errors]
    missing: dict[str, list[str]] = {}
    for curve in curves:
        if not curve.errors:
            missing.setdefault(curve.reason, []).append(curve.name)
    return page(
        "precision.html",
        active="/simulate",
        job=job,
        result=result,
        curves=measured,
        plots=[plot_of(measured, *size) for size in ((640, 400), (350, 320))] if measured else [],
        played=[{**asdict(curve), "name": curve.name} for curve in measured],
        sentences=price_sentences(result),
        errors=[power(target["error"]) for target in result["targets"]],
        prices=[[price_of(target, curve) for target in result["targets"]] for curve in measured],
        missing=[(", ".join(names), reason) for reason, names in missing.items()],
        scene=document,
    )


def curves_of(result: Mapping[str, Any]) -> list[Curve]:
    """All methods, those that reach most errors first, of these the fastest at the smallest."""
    ranks: dict[str, tuple[int, float]] = {}
    for target in result["targets"]:
        for row in target["rows"]:
            reached, seconds = ranks.get(row["method"], (0, math.inf))
            ranks[row["method"]] = (reached, seconds) if row["seconds"] is None else (reached - 1, row["seconds"])
    methods = sorted(result["methods"], key=lambda method: ranks.get(method["label"], (0, math.inf)))
    return [_curve(method) for method in methods]


def _curve(method: Mapping[str, Any]) -> Curve:
    settings = [s for s in method["settings"] if not s["at_floor"]]
    good = [s for s in settings if s["error"] and s["best_seconds"]]
    setting = "step" if settings and settings[0]["tolerance"] is None else "tolerance"
    coarse = settings[: settings.index(good[0])] if good else []
    reason = "" if good else next((s["reason"].rstrip(".") for s in settings if s["reason"]), "it was not measured")
    return Curve(
        method["label"],
        method["order"],
        setting,
        [s[setting] for s in (*coarse, *good)],
        [s["relative_error"] for s in good],
        [s["best_seconds"] for s in good],
        len(coarse),
        reason,
    )


def price_of(target: Mapping[str, Any], curve: Curve) -> Price:
    """The cost of a target error by a method."""
    row = next((row for row in target["rows"] if row["method"] == curve.label and row["seconds"] is not None), None)
    if row is None:
        return Price()
    best = min(row["seconds"] for row in target["rows"] if row["seconds"] is not None)
    is_best = row["seconds"] == best
    at_most = "\u2264 " if row["at_most"] else ""  # its coarsest setting is better than the error asked for
    setting = f"{curve.setting} {short_number(row[curve.setting], 2)}"
    ratio = "best" if is_best else f"{short_number(row['ratio'], 2)} \u00d7"
    return Price(f"{at_most}{duration(row['seconds'])}", ratio, setting, is_best)


def power(error: float) -> str:
    """A power of ten: 1e-3."""
    return f"{error:.0e}".replace("e-0", "e-").replace("e+00", "")


def price_sentences(result: Mapping[str, Any]) -> list[str]:
    """Which method is the fastest for which error, and what three more digits take with the best and the worst."""
    fastest: dict[str, list[str]] = {}
    known = []  # of each error: the seconds of the methods that reach it and not more, the fastest first
    for target in result["targets"]:
        rows = [row for row in target["rows"] if row["seconds"] is not None]
        known.append({row["method"]: row["seconds"] for row in rows if not row["at_most"]})
        # What is better at its coarsest setting might be faster still.
        first = [*rows[:1], *(row for row in rows[1:] if row["at_most"])][:2]
        if first:
            names = " or ".join(method_name(row["method"]) for row in first)
            fastest.setdefault(names, []).append(power(target["error"]))
    if not fastest:
        return ["No method reached a relative error of 1e-3. Take smaller steps."]
    cases = [f"{', '.join(errors)}: {names}" for names, errors in fastest.items()]
    found = [f"The fastest for an error of {'; for '.join(cases)}."]
    targets = zip(itertools.pairwise(result["targets"]), itertools.pairwise(known), strict=True)
    for (coarse, fine), (before, after) in targets:
        factors = {name: after[name] / before[name] for name in after if name in before}
        if coarse["error"] < 1e-3 and len(factors) > 1:
            best, worst = next(iter(factors)), max(factors, key=factors.__getitem__)
            each = [(short_number(factors[name], 2), method_name(name)) for name in dict.fromkeys((best, worst))]
            sentence = " and ".join(f"{times} times as long with {name}" for times, name in each)
            errors = f"from {power(coarse['error'])} to {power(fine['error'])}"
            found.append(f"Three more digits, {errors}, take {sentence}.")
            break
    return found


CHARACTER, LINE = 6.6, 15.0  # of a label of a curve


@dataclass(frozen=True, slots=True)
class Plot:
    """Time over error as lines of a picture: ticks (place, text), and of each curve its path and its label."""

    width: int
    height: int
    left: float
    right: float
    bottom: float
    errors: list[tuple[float, str]]
    times: list[tuple[float, str]]
    paths: list[str]
    labels: list[tuple[float, float, str]]
    leaders: list[str]


def plot_of(curves: Sequence[Curve], width: int, height: int) -> Plot:
    """The curves in a picture of this size, smaller errors to the right, with their names at their ends."""
    margin = CHARACTER * max(len(curve.name) for curve in curves) + 12
    left, right, top, bottom = 50.0, width - margin, 22.0, height - 46.0
    errors = [math.log10(error) for curve in curves for error in curve.errors]
    times = [math.log10(seconds) for curve in curves for seconds in curve.seconds]
    high, low = max(errors), min(min(errors), max(errors) - 1)
    floor, ceiling = math.floor(min(times)), math.ceil(max(times))

    def at(error: float, seconds: float) -> tuple[float, float]:
        x = left + (right - left) * (high - math.log10(error)) / (high - low)
        return round(x, 1), round(bottom - (bottom - top) * (math.log10(seconds) - floor) / (ceiling - floor), 1)

    every = 3 if high - low > 4 else 1
    lines = [[at(*pair) for pair in zip(curve.errors, curve.seconds, strict=True)] for curve in curves]
    labels, leaders = _labels([line[-1] for line in lines], [curve.name for curve in curves], right, top)
    return Plot(
        width,
        height,
        left,
        right,
        bottom,
        [(at(10.0**k, 1.0)[0], power(10.0**k)) for k in range(0, math.floor(low), -1)
         if low <= k <= high and k % every == 0],
        [(at(1.0, 10.0**k)[1], duration(10.0**k)) for k in range(floor, ceiling + 1)],
        ["M" + "L".join(f"{x} {y}" for x, y in line) for line in lines],
        labels,
        leaders,
    )  # fmt: skip


def _labels(
    ends: Sequence[tuple[float, float]], names: Sequence[str], right: float, top: float
) -> tuple[list[tuple[float, float, str]], list[str]]:
    """The names next to the ends of the curves, or in the margin where an end is near it, moved off each other."""
    taken: list[tuple[float, float, float]] = []
    placed: dict[int, tuple[float, float, str]] = {}
    leaders = [""] * len(ends)
    for k in sorted(range(len(ends)), key=lambda k: ends[k][1]):
        x, y = ends[k]
        length = CHARACTER * len(names[k])
        start = right + 8 if x + length / 2 > right - 60 else x + 8
        shifts = sorted((LINE / 3 * n for n in range(-60, 61)), key=abs)
        shift = next(
            shift for shift in shifts
            if y + shift >= top
            and all(abs(y + shift - b) >= LINE or start > a + reach or start + length < a for a, b, reach in taken)
        )  # fmt: skip
        taken.append((start, y + shift, length))
        placed[k] = (start, round(y + shift, 1), names[k])
        if shift or start - x > 20:
            leaders[k] = f"M{x + 2} {y}L{start - 3} {round(y + shift, 1)}"
    return [placed[k] for k in range(len(ends))], leaders


def prices_csv(result: Mapping[str, Any]) -> str:
    """The prices as CSV: one line for an error and a method."""
    stream = io.StringIO()
    keys = ("error", "method", "order", "step", "tolerance", "seconds", "ratio", "evaluations")
    table = csv.DictWriter(stream, keys, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows(row | {"error": target["error"]} for target in result["targets"] for row in target["rows"])
    return stream.getvalue()


def quantities(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(key, heading) of the numbers that some method has; a circle's under "circle.NAME"."""
    methods = result["methods"]
    found = [(key, heading) for key, heading in QUANTITIES if any(m.get(key) is not None for m in methods)]
    if any(method.get("circle") for method in methods):
        found += [("circle.radius_first", "radius, first circle"), ("circle.radius_last", "radius, last circle")]
        found += [("circle.centre_drift", "drift of the center")]
    return found


def _why(method: Mapping[str, Any]) -> str:
    """Why a method stopped or did not begin, or where what it did is not the motion."""
    stopped = (method.get("stopped") or {}).get("sentence")
    return stopped or method.get("reason") or method.get("doubt") or ""


def notes_of(result: Mapping[str, Any]) -> list[str]:
    """Notes of the scene and its methods, besides their numbers; the same note of several methods once."""
    found: dict[str, list[str]] = {}
    for method in result["methods"]:
        own = [str(method[key]) for key in ("note", "energy_note", "error_note", "phase_note") if method.get(key)]
        for text in (*(typesetting.capitalized(text).replace(FIELD, "") for text in own), *notes_of_formulas(method)):
            found.setdefault(text, []).append(method["label"])
    return [*result["notes"], *(f"{', '.join(map(method_name, labels))}: {note}" for note, labels in found.items())]


def free_lagrangians(result: Mapping[str, Any]) -> list[tuple[Markup, str, str]]:
    """The Lagrangians without constraints that methods of a constrained system used, each once: typeset, with the first
    of these methods and where it comes from."""
    found: dict[str, tuple[Markup, str, str]] = {}
    for method in result["methods"]:
        text = method.get("free_lagrangian")
        if text and text not in found and result["system"].get("constraints"):
            letters = tuple(dict.fromkeys((*result["system"].get("parameters", {}), *(method.get("constants") or {}))))
            math = typesetting.equation("L", text, Names(tuple(result["system"]["coordinates"]), letters))
            found[text] = (math, method["label"], _named(method.get("free_lagrangian_source") or ""))
    return list(found.values())


def _named(source: str) -> str:
    """L~2 with its tilde above and its index below."""
    for index, below in (("1", "\u2081"), ("2", "\u2082"), ("3", "\u2083"), ("", "")):
        source = source.replace(f"L~{index}", f"L\u0303{below}")
    return source


def _value(method: Mapping[str, Any], key: str) -> Any:
    outer, _, inner = key.partition(".")
    found = method.get(outer)
    return found.get(inner) if inner and isinstance(found, dict) else found


def costs(result: Mapping[str, Any]) -> dict[str, Any]:
    """What each tick cost: seconds of every stage by method, and what was derived for all of them."""
    methods = [method for method in result["methods"] if method.get("seconds")]
    stages = list(dict.fromkeys(stage for method in methods for stage in method["seconds"]))
    rows = [
        (stage.replace("_", " "), [duration(method["seconds"].get(stage)) for method in methods]) for stage in stages
    ]
    shared = [(stage, duration(value)) for stage, value in result.get("seconds", {}).items()]
    return {"labels": [method_name(method["label"]) for method in methods], "rows": rows, "shared": shared}


def part_costs(result: Mapping[str, Any]) -> dict[str, Any]:
    """What each effect and observed quantity adds to a step, if the scene observed that; otherwise empty."""
    methods = [method for method in result["methods"] if (method.get("cost") or {}).get("step_ns") is not None]
    if not methods:
        return {}
    names = dict.fromkeys((p["kind"], p["name"]) for method in methods for p in method["cost"]["parts"])
    rows = [("the whole step", [_price(method["cost"]) for method in methods])]
    for kind, name in names:
        found = [[p for p in method["cost"]["parts"] if (p["kind"], p["name"]) == (kind, name)] for method in methods]
        title = f"{name} observed" if kind == "observed" else name
        rows.append((title, [_price(part[0]) if part else "\u2013" for part in found]))
    notes = dict.fromkeys(method["cost"]["note"] for method in methods if method["cost"].get("note"))
    return {"labels": [method_name(method["label"]) for method in methods], "rows": rows, "notes": list(notes)}


def _price(part: Mapping[str, Any]) -> str:
    if part["step_ns"] is None:
        return "\u2013"
    return "nothing" if not part["operations"] and part.get("note") else f"{part['step_ns']:.1f} ns"


def pretty(document: str | bytes) -> str:
    """A JSON text with indents."""
    return json.dumps(json.loads(document), indent=1, ensure_ascii=False)


TRUE = ("exact", "reference")
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#8A6D3B", "#7E57C2")
DASHES = ("solid", "dash", "dashdot", "dot", "longdash", "longdashdot", "solid", "dash")
MOST_POINTS = 2001
DIGITS = 7
ROUNDING = 1e-13
SERIES = {
    "energy": ("Energy error", "|E/E\u2080 \u2212 1|"),
    "constraints": ("Constraint defect", "greatest |\u03c9(q) q\u2032|"),
    "error": ("Trajectory error", "greatest distance from the true motion"),
}
NAMES = ("path", "coordinates", "section", "work-precision", *SERIES)
MOST_PANELS = 6


def figure_names(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(name, title) of the figures that this result has."""
    if result["format"].startswith("inverse-service/work-precision"):
        return [("work-precision", "Work and precision")]
    if any("members" in method for method in result["methods"]):
        return []  # of an ensemble the page has the table
    observed, found = set(result["observe"]), []
    if "trajectory" in observed:
        if result["circle_coordinates"]:
            a, b = map(letters.shown, result["circle_coordinates"])
            found.append(("path", "Path in the plane" if (a, b) == ("x", "y") else f"{b} over {a}"))
        found.append(("coordinates", "Coordinates in time"))
    if any(event["count"] for method in result["methods"] for event in method.get("events", ())):
        found.append(("section", "Points at events"))
    if (
        "energy" in observed
        and not _has(result, "energy")
        and any(columns_of(m).get("energy") for m in result["methods"])
    ):
        found.append(("energy", "Energy"))
    return found + [(name, SERIES[name][0]) for name in SERIES if name in observed and _has(result, name)]


def _has(result: Mapping[str, Any], name: str) -> bool:
    return any(series(name, method) for method in result["methods"])


def columns_of(method: Mapping[str, Any]) -> Mapping[str, list[float | None]]:
    """The recorded columns of a method; empty if it has none."""
    columns: Mapping[str, list[float | None]] = (method.get("points") or {}).get("columns", {})
    return columns


def series(name: str, method: Mapping[str, Any]) -> list[float | None]:
    """The sizes of an observed quantity; None where they are zero, unknown or only the rounding of the start.

    No sizes of an energy that the true motion does not keep.
    """
    columns = columns_of(method)
    if name == "energy" and "energy_note" in method:
        return []
    if name == "energy":
        start = method.get("energy_start")
        values = columns.get("energy", [])
        errors = [None if e is None or start is None else (e - start) / (abs(start) or 1.0) for e in values]
        return _after_start([_positive(error) for error in errors])
    if name == "constraints":
        rows = [column for key, column in columns.items() if key.startswith("constraint_")]
        worst = [max((abs(w) for w in at if w is not None), default=None) for at in zip(*rows, strict=True)]
        return _after_start([_positive(value) for value in worst])
    return _after_start([_positive(value) for value in columns.get(name, [])])


def _after_start(values: list[float | None]) -> list[float | None]:
    """Without the rounding of the start, which a two-step method has twice: it would stretch the axis for nothing."""
    start = [None if value is not None and value < ROUNDING else value for value in values[:2]]
    return start + values[2:]


def _positive(value: float | None) -> float | None:
    return None if not value else abs(value)


def figure_data(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The data for the script: each figure with its axes and its lines."""
    return [
        {"name": name, "title": title, "views": _views(name, title, result)} for name, title in figure_names(result)
    ]


def _views(name: str, title: str, result: Mapping[str, Any]) -> list[dict[str, Any]]:
    methods = result["methods"]
    if name == "path":
        pair = result["circle_coordinates"]
        return [_plane_view(title, result, pair, equal=tuple(pair) == ("x", "y"))]
    if name == "coordinates":
        return [view for c in result["system"]["coordinates"] for view in _views_of(c, methods)]
    if name == "section":
        return _sections(result)
    others = [method for method in methods if method["method"] != "exact"]
    views = [
        _view(
            "size, logarithmic",
            "t",
            SERIES[name][1],
            _lines(others, _times, partial(series, name), methods),
            log_y=True,
        )
    ]
    kept = _kept_views(result) if name == "energy" else []
    return [view for view in (*kept, *views, *_signed_views(name, result, others)) if view["lines"]]


def _kept_views(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """T + V with the H that the motion keeps, each divided by its start, and the drift of H: of damped motions."""
    methods = result["methods"]
    kept = [method for method in methods if "conserved_1" in columns_of(method)]
    kept = [method for method in kept if method["method"] not in TRUE] or kept
    drifts = _lines(kept, _times, partial(_column, "conserved_1"), methods)
    both = []
    for line, method in zip(drifts, kept, strict=True):
        columns: Mapping[str, Any] = columns_of(method)
        name = method_name(method["label"])
        energies = columns.get("mechanical_energy") or [None]
        if energies[0]:
            mechanical = [None if e is None else e / energies[0] for e in energies]
            both.append(
                {**_line(line["place"], method, columns["t"], mechanical), "label": f"T + V, {name}", "dash": "solid"}
            )
        constant = [None if drift is None else 1 + drift for drift in columns["conserved_1"]]
        both.append({**_line(line["place"], method, columns["t"], constant), "label": f"H, {name}", "dash": "dash"})
    sizes = [{**line, "y": [_positive(value) for value in line["y"]]} for line in drifts]
    return [
        _view("T + V and the conserved H, from 1 at the start", "t", "part of the start", both),
        _view("conserved H, relative drift, logarithmic", "t", "|H/H\u2080 \u2212 1|", sizes, log_y=True),
    ]


def _sections(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The points of each event, each coordinate with its velocity: Poincare sections."""
    methods = [method for method in result["methods"] if method.get("events")]
    views = []
    for k, event in enumerate(methods[0]["events"]):
        moving = [name for name in result["system"]["coordinates"] if name != event["when"]]
        for name in moving or result["system"]["coordinates"]:
            q, columns = letters.shown(name), [method["events"][k]["columns"] for method in methods]
            lines = [
                {**_line(place, method, [], []), "x": found[name], "y": found[f"v_{name}"]}
                for place, (method, found) in enumerate(zip(methods, columns, strict=True))
            ]
            views.append(_view(f"{event['when']} = 0: {q}, {q}\u2032", q, f"{q}\u2032", lines, dots=True))
    return views


def _plane_view(title: str, result: Mapping[str, Any], pair: Sequence[str], equal: bool = True) -> dict[str, Any]:
    """One coordinate over another."""
    a, b = pair
    lines = _lines(result["methods"], partial(_column, a), partial(_column, b))
    dots = is_thinned(result)
    return _view(title, letters.shown(a), letters.shown(b), lines, equal=equal, dots=dots)


def is_thinned(result: Mapping[str, Any]) -> bool:
    """Whether points were left out: lines between every k-th step would fill a circle to a ring."""
    every = result.get("record_every", 1)
    return any((method.get("points") or {}).get("every", 1) > every for method in result["methods"])


def _signed_views(name: str, result: Mapping[str, Any], methods: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The energy, or each constraint, with its sign."""
    columns: dict[str, str] = {}
    if name == "energy":
        # Of an L that contains the time, T + V is what is left of its energy without the factor of t.
        is_timed = any("mechanical_energy" in columns_of(method) for method in methods)
        columns = {"T + V": "mechanical_energy", "energy of the L found": "energy"} if is_timed else {"E": "energy"}
    if name == "constraints":
        count = len(result["system"]["constraints"])
        columns = {f"\u03c9{k}(q) q\u2032": f"constraint_{k}" for k in range(1, count + 1)}
    return [
        _view(
            f"{label}, with its sign", "t", label, _lines(methods, _times, partial(_column, column), result["methods"])
        )
        for label, column in columns.items()
    ]


def _column(name: str, method: Mapping[str, Any]) -> list[float | None] | None:
    return columns_of(method).get(name)


def _views_of(name: str, methods: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A coordinate in time, its difference from the true motion where that was computed, and its phase portrait."""
    q = letters.shown(name)
    views = [_view(f"{q} in time", "t", q, _lines(methods, _times, partial(_column, name)))]
    truth = next((columns_of(m) for m in methods if m["method"] in TRUE), {})
    if truth.get(name) and len(methods) > 1:
        true = dict(zip(truth["t"], truth[name], strict=True))
        others = [method for method in methods if method["method"] not in TRUE]
        lines = _lines(others, _times, lambda m: _difference(columns_of(m), name, true), methods)
        views.append(_view(f"{q}, difference from the true motion", "t", f"{q} \u2212 true {q}", lines))
    lines = _lines(methods, partial(_column, name), lambda m: _rate(columns_of(m), name))
    return [*views, _view(f"{q}, phase portrait", q, f"{q}\u2032", lines)]


def _times(method: Mapping[str, Any]) -> list[float | None] | None:
    return columns_of(method).get("t")


def _difference(columns: Mapping[str, list[Any]], name: str, true: Mapping[Any, Any]) -> list[float | None]:
    pairs = [(q, true.get(t)) for t, q in zip(columns.get("t", ()), columns.get(name, ()), strict=True)]
    return [None if q is None or at is None else q - at for q, at in pairs]


def _rate(columns: Mapping[str, list[Any]], name: str) -> list[float | None]:
    """The recorded velocity; where there is none, that between the recorded points on either side."""
    if f"v_{name}" in columns:
        return columns[f"v_{name}"]
    t, q = columns.get("t", []), columns.get(name, [])
    last = len(q) - 1
    ends = [(max(0, k - 1), min(last, k + 1)) for k in range(len(q))]
    return [None if q[a] is None or q[b] is None or a == b else (q[b] - q[a]) / (t[b] - t[a]) for a, b in ends]


def _view(label: str, x: str, y: str, lines: Sequence[Mapping[str, Any]], **axes: bool) -> dict[str, Any]:
    return {"label": label, "x": x, "y": y, "lines": [line for line in lines if line["x"]], **axes}


Column = Callable[[Mapping[str, Any]], Sequence[Any] | None]


def _lines(
    methods: Sequence[Mapping[str, Any]], x: Column, y: Column, whole: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """A line for each method, which keeps its color by its place among the `whole`."""
    places = {method["label"]: k for k, method in enumerate(whole or methods)}
    return [_line(places[method["label"]], method, x(method), y(method)) for method in methods]


def _line(k: int, method: Mapping[str, Any], x: Sequence[Any] | None, y: Sequence[Any] | None) -> dict[str, Any]:
    every = max(1, math.ceil(len(x or ()) / MOST_POINTS))
    is_true = method["method"] in TRUE
    return {
        "label": method_name(method["label"]),
        "place": k,
        "color": "ink" if is_true else COLORS[k % len(COLORS)],
        "dash": "solid" if is_true else DASHES[k % len(DASHES)],
        "x": [_short(value) for value in (x or ())[::every]] if y else [],
        "y": [_short(value) for value in (y or ())[::every]],
    }


def motion_of(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """The motion of each method with the columns of all coordinates, thinned; None where nothing moved."""
    coordinates = result["system"]["coordinates"]
    tracks = []
    for method in result["methods"]:
        columns = columns_of(method)
        if len(columns.get("t", ())) > 1 and all(name in columns for name in coordinates):
            every = max(1, math.ceil(len(columns["t"]) / MOST_POINTS))
            t, *q = ([_short(value) for value in columns[name][::every]] for name in ("t", *coordinates))
            tracks.append({"label": method["label"], "t": t, "q": q})
    if not tracks:
        return None
    return {
        "coordinates": coordinates,
        "labels": preview.labels_of(coordinates),
        "angles": preview.angles_of_texts(result["system"]),
        "tracks": tracks,
    }


def _short(value: Any) -> Any:
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def picture(result: Mapping[str, Any], name: str, ending: str) -> bytes | None:
    """A figure as an SVG or PNG file; None for a figure that the result does not have."""
    if name not in dict(figure_names(result)):
        return None
    import matplotlib

    from inverse_service.service.figures.style import RESOLUTION, SETTINGS

    stream = io.BytesIO()
    with matplotlib.rc_context(SETTINGS):
        metadata = {"Title": name} | ({"Date": None} if ending == "svg" else {})
        figure = _figure_of(result, name)
        if figure is not None:
            figure.savefig(stream, format=ending, dpi=RESOLUTION, metadata=metadata)
    return stream.getvalue() or None


def _figure_of(result: Mapping[str, Any], name: str) -> Any:
    import numpy as np

    from inverse_service.service.figures.drawing import coordinate_figure, path_figure, view_figure
    from inverse_service.service.figures.time_series import precision_figure, series_figure

    if name == "work-precision":
        return precision_figure(result)[0]
    if name == "section":
        views = _sections(result)[:MOST_PANELS]
        return view_figure(views, 4.0 * len(views), 3.6)
    tables = {
        method["label"]: {column: np.asarray(values, dtype=float) for column, values in columns_of(method).items()}
        for method in result["methods"]
        if columns_of(method)
    }
    if name == "path":
        return path_figure(result, tables, None)[0]
    if name == "coordinates":
        return coordinate_figure(result, tables, None)[0]
    drawn = series_figure(name, result, tables)
    return None if drawn is None else drawn[0]
