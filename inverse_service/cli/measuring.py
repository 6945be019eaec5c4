"""`inverse-service work-precision`: table, JSON and log-log figure."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from inverse_service.cli.exits import ExitCode, read_bytes, write
from inverse_service.cli.simulating import made_folder, value_in_time
from inverse_service.cli.solving import time_limit_or
from inverse_service.service.documents.reading import read_document
from inverse_service.service.jobs import tasks

DEFAULT_SECONDS = 300.0
COLUMNS = (
    "step", "steps", "relative_error", "compile_seconds", "first_seconds", "best_seconds", "median_seconds",
    "force_evaluations", "newton_iterations", "tolerance", "velocity_error", "energy_error", "constraint_error",
)  # fmt: skip


def measure_file(name: str, output: Path | None, time_limit: float | None) -> ExitCode:
    """Measure the scene in a process of its own; write DIR, or the document on standard output."""
    limit = time_limit_or(DEFAULT_SECONDS, time_limit)
    document = read_document(read_bytes(name), name)
    folder = None if output is None else made_folder(output)
    result = value_in_time(tasks.work_precision_task, document, limit)
    if folder is None:
        write(json.dumps(result, ensure_ascii=False, indent=2) + "\n")
        return ExitCode.DONE
    from inverse_service.service.figures.series import precision_figure
    from inverse_service.service.figures.style import save

    figure, caption = precision_figure(result)
    result["figures"] = [{"files": save(figure, folder, "work-precision", caption), "caption": caption}]
    text = json.dumps(result, ensure_ascii=False, indent=2)
    (folder / "work-precision.json").write_text(text + "\n", encoding="utf-8")
    (folder / "work-precision.csv").write_text(comma_table(result), encoding="utf-8")
    page = text_table(result)
    (folder / "work-precision.txt").write_text(page, encoding="utf-8")
    write(page)
    print(f"Written to {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}", file=sys.stderr)
    return ExitCode.DONE


def comma_table(result: Mapping[str, Any]) -> str:
    """One line a setting; empty cells where nothing was measured."""
    lines = [",".join(("label", *COLUMNS, "at_floor", "reason"))]
    for method in result["methods"]:
        for setting in method["settings"]:
            cells = ["" if setting[key] is None else repr(setting[key]) for key in COLUMNS]
            reason = json.dumps(setting["reason"]) if setting["reason"] else ""
            lines.append(",".join((method["label"], *cells, str(setting["at_floor"]).lower(), reason)))
    return "\n".join(lines) + "\n"


def text_table(result: Mapping[str, Any]) -> str:
    """The table for a person, with machine and conclusion below it."""
    heads = ["method", *(name.replace("_seconds", " s").replace("_", " ") for name in COLUMNS), ""]
    rows = [heads]
    for method in result["methods"]:
        for setting in method["settings"]:
            note = setting["reason"] or ("round-off" if setting["at_floor"] else "")
            rows.append([method["label"], *(_cell(setting[key]) for key in COLUMNS), note])
    widths = [max(len(row[k]) for row in rows) for k in range(len(heads))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    machine = ", ".join(f"{key} {value}" for key, value in result["machine"].items())
    orders = ", ".join(
        f"{method['label']} {method['measured_order']:.2f}"
        for method in result["methods"]
        if method["measured_order"] is not None
    )
    below = [f"Measured orders: {orders or 'none'}.", f"Machine: {machine}.", result["conclusion"]]
    return "\n".join([*lines, "", *below, ""])


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.3g}"
