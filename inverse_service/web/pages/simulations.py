"""The page of a simulation or a work-precision measurement: tables, figures as data for scripts and as files."""

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any
from urllib.parse import urlencode

from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import printed_pages, sheets
from inverse_service.service.scenes import views
from inverse_service.web.pages import forms, preview, rendering, typesetting

PICTURES = {"svg": "image/svg+xml", "png": "image/png"}
TABLES = {"csv": "text/csv", "npz": "application/zip"}

OF_EQUATIONS = ("name", "time", "coordinates", "equations", "parameters", "functions")
MOST_VALUES = 12  # of a number in which runs differ
MOST_MEMBERS = 200  # of an ensemble on the page; the JSON has all
FIELD = "See `conserved`: "  # of the JSON
CHARACTER, LINE = 6.6, 15.0  # of a label of a curve


def simulation_result(address: str, job: Mapping[str, Any], document: str) -> HTMLResponse:
    """The page of a job of kind "simulate"; `address` is that of the service."""
    result = job["result"]
    columns, tables = printed_pages.quantities(result), views.tables_of(result)
    return rendering.page(
        "simulation.html",
        active="/simulate",
        job=job,
        result=result,
        headings=[heading for _, heading in columns],
        formulas=typesetting.formulas_of(result["system"]),
        start=dict(start_shown(result)),
        rows=[
            (m, _numbers(m, columns), printed_pages.why(m), m["label"] in tables)
            for m in result["methods"]
        ],
        ensembles=[
            (m["label"], *_members(of))
            for m in result["methods"]
            if (of := m.get("members_columns"))
        ],
        free=free_lagrangians(result),
        costs=costs(result),
        parts=part_costs(result),
        notes=notes_of(result),
        figures=views.figures_of(result),
        motion=moving_tracks(result, tables),
        scene=document,
        link=scene_address(json.loads(document)),
        curl=f"curl -s {address}/v1/simulate -H 'Content-Type: application/json' -d @scene.json",
    )


def _numbers(method: Mapping[str, Any], columns: Sequence[tuple[str, str]]) -> list[str]:
    return [views.short_number(printed_pages.value_at(method, key)) for key, _ in columns]


def _members(columns: Mapping[str, Sequence[Any]]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The headings and the first rows of the numbers of an ensemble, one row for each run."""
    told = {name: list(map(views.short_number, column)) for name, column in columns.items()}
    told["completed"] = ["yes" if done else "no" for done in columns["completed"]]
    rows = itertools.islice(zip(*told.values(), strict=True), MOST_MEMBERS)
    return list(map(views.heading_of, told)), [(k, list(row)) for k, row in enumerate(rows, 1)]


def start_shown(result: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Parameters and start with their numbers; of runs that differ in one all of them, if they are few."""
    varied = views.varied_of(result)
    initial = result["initial"]
    columns = {name: f"{name}_start" for name in initial["positions"]}
    columns |= {f"{name}{views.PRIME}": f"v_{name}_start" for name in initial["velocities"]}
    for name, value in start_of(result).items():
        each = [f"{one:.10g}" for one in dict.fromkeys(varied.get(columns.get(name, name), ()))]
        if len(each) > MOST_VALUES:
            each = [*each[:3], "\u2026", each[-1]]
        yield name, ", ".join(each) or f"{value or 0:.10g}"


def start_of(result: Mapping[str, Any]) -> dict[str, float]:
    """The values of the parameters, the coordinates and the velocities at the start."""
    initial = result["initial"]
    velocities = {f"{name}{views.PRIME}": v for name, v in initial["velocities"].items()}
    return {**result["system"]["parameters"], **initial["positions"], **velocities}


@dataclass(frozen=True, slots=True)
class Curve:
    """A method as it was measured, from coarse to fine settings: steps, or the `tolerance`s of one
    that chooses them.

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
        return views.method_name(self.label)


def precision_result(job: Mapping[str, Any], document: str) -> HTMLResponse:
    """The page of a job of kind "work-precision": the picture, two sentences, the prices."""
    result = job["result"]
    curves = curves_of(result)
    measured = [curve for curve in curves if curve.errors]
    missing: dict[str, list[str]] = {}
    for curve in curves:
        if not curve.errors:
            missing.setdefault(curve.reason, []).append(curve.name)
    return rendering.page(
        "precision.html",
        active="/simulate",
        job=job,
        result=result,
        curves=measured,
        plots=[plot_of(measured, *size) for size in ((640, 400), (350, 320))] if measured else [],
        played=[{**asdict(curve), "name": curve.name} for curve in measured],
        sentences=views.price_sentences(result["targets"], views.method_name),
        errors=[views.power_of_ten(target["error"]) for target in result["targets"]],
        prices=[
            [views.price_of(target, curve.label) for target in result["targets"]]
            for curve in measured
        ],
        missing=[(", ".join(names), reason) for reason, names in missing.items()],
        scene=document,
        link=scene_address(json.loads(document)),
    )


def scene_address(scene: Mapping[str, Any]) -> str:
    """The link that fills the form with this scene without running it; empty if it would be too
    long.

    A result in it is left to be found again from its equations; there is none where these are not
    solved.
    """
    system = (scene["system"].get("result") or {}).get("system")
    if system:
        if any(map(reader.has_acceleration, system["equations"].values())):
            return ""
        given = {key: system[key] for key in OF_EQUATIONS if system.get(key)}
        scene = {**scene, "system": {"document": given}}
    text = json.dumps(scene, ensure_ascii=False, separators=(",", ":"))
    address = f"/simulate?{urlencode({'given': text})}"
    return address if len(address) <= forms.LONGEST_LINK else ""


def curves_of(result: Mapping[str, Any]) -> list[Curve]:
    """All methods, the best first."""
    places = {label: place for place, label in enumerate(views.best_first(result))}
    methods = sorted(result["methods"], key=lambda method: places.get(method["label"], len(places)))
    return [
        _curve(method, [run for run in result["runs"] if run["method"] == method["label"]])
        for method in methods
    ]


def _curve(method: Mapping[str, Any], runs: Sequence[Mapping[str, Any]]) -> Curve:
    settings = [run for run in runs if not run["at_floor"]]
    good = [run for run in settings if run["error"] and run["seconds"]]
    setting = "step" if settings and settings[0]["tolerance"] is None else "tolerance"
    coarse = settings[: settings.index(good[0])] if good else []
    reason = (
        ""
        if good
        else next((s["reason"].rstrip(".") for s in settings if s["reason"]), "it was not measured")
    )
    return Curve(
        method["label"],
        method["order"],
        setting,
        [s[setting] for s in (*coarse, *good)],
        [run["error"] for run in good],
        [run["seconds"] for run in good],
        len(coarse),
        reason,
    )


def plot_of(curves: Sequence[Curve], width: int, height: int) -> dict[str, Any]:
    """Time over error as lines of a picture of this size: ticks (place, text), of each curve its
    path and its label.

    Smaller errors are to the right, the names of the curves at their ends.
    """
    margin = CHARACTER * max(len(curve.name) for curve in curves) + 12
    left, right, top, bottom = 50.0, width - margin, 22.0, height - 46.0
    errors = [math.log10(error) for curve in curves for error in curve.errors]
    times = [math.log10(seconds) for curve in curves for seconds in curve.seconds]
    high, low = max(errors), min(min(errors), max(errors) - 1)
    floor, ceiling = math.floor(min(times)), math.ceil(max(times))

    def at(error: float, seconds: float) -> tuple[float, float]:
        x = left + (right - left) * (high - math.log10(error)) / (high - low)
        return round(x, 1), round(
            bottom - (bottom - top) * (math.log10(seconds) - floor) / (ceiling - floor), 1
        )

    every = 3 if high - low > 4 else 1
    lines = [
        [at(*pair) for pair in zip(curve.errors, curve.seconds, strict=True)] for curve in curves
    ]
    labels, leaders = _labels(
        [line[-1] for line in lines], [curve.name for curve in curves], right, top
    )
    ticks = [10.0**k for k in range(0, math.floor(low), -1) if low <= k <= high and k % every == 0]
    seconds = [10.0**k for k in range(floor, ceiling + 1)]
    frame = {"width": width, "height": height, "left": left, "right": right, "bottom": bottom}
    return frame | {
        "errors": [(at(error, 1.0)[0], views.power_of_ten(error)) for error in ticks],
        "times": [(at(1.0, time)[1], views.duration(time)) for time in seconds],
        "paths": ["M" + "L".join(f"{x} {y}" for x, y in line) for line in lines],
        "labels": labels,
        "leaders": leaders,
    }


def _labels(
    ends: Sequence[tuple[float, float]], names: Sequence[str], right: float, top: float
) -> tuple[list[tuple[float, float, str]], list[str]]:
    """The names in the margin, each moved down where it would lie on the one above, and lines to them from the ends."""
    heights, lowest = dict[int, float](), top - LINE
    for k in sorted(range(len(ends)), key=lambda k: ends[k][1]):
        lowest = heights[k] = round(max(ends[k][1], lowest + LINE), 1)
    labels = [(right + 8, heights[k], name) for k, name in enumerate(names)]
    return labels, [f"M{x + 2} {y}L{right + 5} {heights[k]}" for k, (x, y) in enumerate(ends)]


def table_of(result: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """The table of the page: a line for each method, or of a measurement one for each error and method."""
    if "targets" in result:
        keys = ("error", "method", "order", "step", "tolerance", "seconds", "ratio", "evaluations")
        rows = [
            {**row, "error": target["error"]}
            for target in result["targets"]
            for row in target["rows"]
        ]
        return [keys, *(tuple(row[key] for key in keys) for row in rows)]
    columns = [
        ("label", "method"),
        ("outcome", "outcome"),
        ("steps", "steps"),
        *printed_pages.quantities(result),
    ]
    columns += [("seconds.run", "seconds")]
    lines = [
        tuple(printed_pages.value_at(method, key) for key, _ in columns)
        for method in result["methods"]
    ]
    return [tuple(heading for _, heading in columns), *lines]


def notes_of(result: Mapping[str, Any]) -> list[str]:
    """Notes of the scene and its methods, besides their numbers; the same note of several methods once."""
    found: dict[str, list[str]] = {}
    for method in result["methods"]:
        own = [*filter(None, [method.get("note")]), *printed_pages.notes_of_quantities(method)]
        own = [sheets.capitalized(text).replace(FIELD, "") for text in own]
        for text in (*own, *printed_pages.notes_of_formulas(method)):
            found.setdefault(text, []).append(method["label"])
    return [
        *result["notes"],
        *(f"{', '.join(map(views.method_name, labels))}: {note}" for note, labels in found.items()),
    ]


def free_lagrangians(result: Mapping[str, Any]) -> list[tuple[Markup, str, str]]:
    """The Lagrangians without constraints that methods of a constrained system used, each once:
    typeset, with the first of these methods and where it comes from."""
    found: dict[str, tuple[Markup, str, str]] = {}
    for method in result["methods"]:
        text = method.get("free_lagrangian")
        if text and text not in found and result["system"].get("constraints"):
            letters = tuple(
                dict.fromkeys(
                    (*result["system"].get("parameters", {}), *(method.get("constants") or {}))
                )
            )
            math = typesetting.equation(
                "L", text, Names(tuple(result["system"]["coordinates"]), letters)
            )
            found[text] = (
                math,
                method["label"],
                _named(method.get("free_lagrangian_source") or ""),
            )
    return list(found.values())


def _named(source: str) -> str:
    """L~2 with its tilde above and its index below."""
    for index, below in (("1", "\u2081"), ("2", "\u2082"), ("3", "\u2083"), ("", "")):
        source = source.replace(f"L~{index}", f"L\u0303{below}")
    return source


def costs(result: Mapping[str, Any]) -> dict[str, Any]:
    """What each tick cost: seconds of every stage by method, and what was derived for all of them."""
    methods = [method for method in result["methods"] if method.get("seconds")]
    stages = list(dict.fromkeys(stage for method in methods for stage in method["seconds"]))
    rows = [
        (
            stage.replace("_", " "),
            [views.duration(method["seconds"].get(stage)) for method in methods],
        )
        for stage in stages
    ]
    shared = [(stage, views.duration(value)) for stage, value in result.get("seconds", {}).items()]
    return {
        "labels": [views.method_name(method["label"]) for method in methods],
        "rows": rows,
        "shared": shared,
    }


def part_costs(result: Mapping[str, Any]) -> dict[str, Any]:
    """What each effect and observed quantity adds to a step, if the scene observed that; otherwise empty."""
    methods = [
        method
        for method in result["methods"]
        if (method.get("cost") or {}).get("step_ns") is not None
    ]
    if not methods:
        return {}
    names = dict.fromkeys(
        (p["kind"], p["name"]) for method in methods for p in method["cost"]["parts"]
    )
    rows = [("the whole step", [_price(method["cost"]) for method in methods])]
    for kind, name in names:
        found = [
            [p for p in method["cost"]["parts"] if (p["kind"], p["name"]) == (kind, name)]
            for method in methods
        ]
        title = f"{name} observed" if kind == "observed" else name
        rows.append((title, [_price(part[0]) if part else "\u2013" for part in found]))
    notes = dict.fromkeys(
        method["cost"]["note"] for method in methods if method["cost"].get("note")
    )
    return {
        "labels": [views.method_name(method["label"]) for method in methods],
        "rows": rows,
        "notes": list(notes),
    }


def _price(part: Mapping[str, Any]) -> str:
    if part["step_ns"] is None:
        return "\u2013"
    return "nothing" if not part["operations"] and part.get("note") else f"{part['step_ns']:.1f} ns"


def pretty(document: str | bytes) -> str:
    """A JSON text with indents."""
    return json.dumps(json.loads(document), indent=1, ensure_ascii=False)


def moving_tracks(result: Mapping[str, Any], tables: views.Tables) -> dict[str, Any] | None:
    """The motion of each method with the columns of all coordinates, thinned; None where nothing moved."""
    coordinates = result["system"]["coordinates"]
    tracks = []
    for label, table in tables.items():
        if len(table["t"]) > 1 and all(name in table for name in coordinates):
            every = max(1, math.ceil(len(table["t"]) / views.MOST_POINTS))
            t, *q = (views.shortened(table[name][::every]) for name in ("t", *coordinates))
            tracks.append({"label": label, "t": t, "q": q})
    if not tracks:
        return None
    return {
        "coordinates": coordinates,
        "labels": preview.labels_of(coordinates),
        "angles": preview.angles_of_texts(result["system"]),
        "tracks": tracks,
    } | preview.picture_of_texts(result["system"])
