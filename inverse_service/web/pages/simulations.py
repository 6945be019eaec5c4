"""The page of a simulation or of a work-precision measurement, with its figures and files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service.reading.names import Names
from inverse_service.service.documents.text_page import notes_of_formulas
from inverse_service.web.pages import figures, typesetting
from inverse_service.web.pages.rendering import duration, page, short_number
from inverse_service.web.pages.scenes import formulas_of

PICTURES = {"svg": "image/svg+xml", "png": "image/png"}
TABLES = {"csv": "text/csv", "npz": "application/zip"}
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
        formulas=formulas_of(result["system"]),
        start={name: f"{v or 0:.10g}" for name, v in start_of(result).items()},
        rows=[(m, _numbers(m, columns), _why(m), figures.columns_of(m)) for m in result["methods"]],
        free=free_lagrangians(result),
        costs=costs(result),
        parts=part_costs(result),
        notes=notes_of(result),
        figures=figures.figure_names(result),
        motion=figures.motion_of(result),
        scene=document,
        curl=f"curl -s {address}/v1/simulate -H 'Content-Type: application/json' -d @scene.json",
    )


def start_of(result: Mapping[str, Any]) -> dict[str, float]:
    """The values of the parameters, the coordinates and the velocities at the start."""
    initial = result["initial"]
    velocities = {f"{name}\u2032": v for name, v in initial["velocities"].items()}
    return {**result["system"]["parameters"], **initial["positions"], **velocities}


@dataclass(frozen=True, slots=True)
class Price:
    """What an error costs by a method: the time, the ratio to the best, the step; a dash where it is not reached."""

    time: str
    how: str
    is_best: bool = False


def precision_result(job: Mapping[str, Any], document: str) -> HTMLResponse:
    """The page of a job of kind "work-precision": the picture, two sentences, the prices."""
    result = job["result"]
    ranked = methods_of(result)
    return page(
        "precision.html",
        active="/simulate",
        job=job,
        result=result,
        figures=figures.figure_names(result),
        methods=ranked,
        prices=[
            (short_number(target["error"]), prices_of(target, [one["label"] for one in ranked]))
            for target in result["targets"]
        ],
        missing=[(method["label"], reason) for method in result["methods"] if (reason := _why_missing(method))],
        scene=document,
    )


def methods_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """{label, order} of the methods that reach an error, those that reach most first, of these the fastest."""
    ranks: dict[str, tuple[int, float]] = {}
    orders: dict[str, Any] = {}
    for target in result["targets"]:
        for row in target["rows"]:
            reached = ranks.get(row["method"], (0, 0.0))[0]
            if row["seconds"] is not None:
                ranks[row["method"]] = (reached - 1, row["seconds"])
                orders[row["method"]] = row["order"]
    return [{"label": label, "order": orders[label]} for label in sorted(ranks, key=ranks.__getitem__)]


def prices_of(target: Mapping[str, Any], labels: list[str]) -> list[Price]:
    """The row of the table for an error."""
    rows = {row["method"]: row for row in target["rows"] if row["seconds"] is not None}
    best = min((row["seconds"] for row in rows.values()), default=None)
    found = []
    for label in labels:
        row = rows.get(label)
        if row is None:
            found.append(Price("\u2013", "not reached"))
            continue
        setting = f"step {short_number(row['step'])}" if row["step"] else f"tolerance {short_number(row['tolerance'])}"
        is_best = row["seconds"] == best
        ratio = "best" if is_best else f"{short_number(row['ratio'])} \u00d7"
        found.append(Price(duration(row["seconds"]), f"{ratio}, {setting}", is_best))
    return found


def prices_csv(result: Mapping[str, Any]) -> str:
    """The prices as CSV: one line for an error and a method."""
    keys = ("method", "order", "step", "tolerance", "seconds", "ratio", "evaluations")
    lines = [",".join(("error", *keys))]
    for target in result["targets"]:
        for row in target["rows"]:
            lines.append(
                ",".join("" if value is None else str(value) for value in (target["error"], *map(row.get, keys)))
            )
    return "\n".join(lines) + "\n"


def _why_missing(method: Mapping[str, Any]) -> str:
    """Why no setting of a method could be measured; nothing where one was."""
    settings = method["settings"]
    if any(setting["error"] is not None for setting in settings):
        return ""
    return next((setting["reason"].rstrip(".") for setting in settings if setting.get("reason")), "it was not measured")


def quantities(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(key, heading) of the numbers that some method has; a circle's under "circle.NAME"."""
    methods = result["methods"]
    found = [(key, heading) for key, heading in QUANTITIES if any(m.get(key) is not None for m in methods)]
    if any(method.get("circle") for method in methods):
        found += [("circle.radius_first", "radius, first circle"), ("circle.radius_last", "radius, last circle")]
        found += [("circle.centre_drift", "drift of the center")]
    return found


def _numbers(method: Mapping[str, Any], columns: list[tuple[str, str]]) -> list[str]:
    return [short_number(_value(method, key)) for key, _ in columns]


def _why(method: Mapping[str, Any]) -> str:
    """Why a method stopped or did not begin, or where what it did is not the motion."""
    if stopped := method.get("stopped"):
        remedy = stopped.get("remedy") or ""
        return f"Stopped at step {stopped.get('step')}: {stopped.get('quantity')}. {remedy[:1].upper()}{remedy[1:]}"
    return method.get("reason") or method.get("doubt") or ""


def notes_of(result: Mapping[str, Any]) -> list[str]:
    """Notes of the scene and its methods, besides their numbers; the same note of several methods once."""
    found: dict[str, list[str]] = {}
    for method in result["methods"]:
        own = [str(method[key]) for key in ("note", "energy_note", "error_note", "phase_note") if method.get(key)]
        for text in (*(f"{text[:1].upper()}{text[1:]}".replace(FIELD, "") for text in own), *notes_of_formulas(method)):
            found.setdefault(text, []).append(method["label"])
    return [*result["notes"], *(f"{', '.join(labels)}: {note}" for note, labels in found.items())]


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
    rows = [(stage, [duration(method["seconds"].get(stage)) for method in methods]) for stage in stages]
    shared = [(stage, duration(value)) for stage, value in result.get("seconds", {}).items()]
    return {"labels": [method["label"] for method in methods], "rows": rows, "shared": shared}


def part_costs(result: Mapping[str, Any]) -> dict[str, Any]:
    """What each effect and observed quantity adds to a step, where the scene observed that; else empty."""
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
    return {"labels": [method["label"] for method in methods], "rows": rows, "notes": list(notes)}


def _price(part: Mapping[str, Any]) -> str:
    if part["step_ns"] is None:
        return "\u2013"
    return "nothing" if not part["operations"] and part.get("note") else f"{part['step_ns']:.1f} ns"


def pretty(document: str | bytes) -> str:
    """A JSON text with indents."""
    return json.dumps(json.loads(document), indent=1, ensure_ascii=False)
