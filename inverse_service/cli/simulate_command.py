"""`inverse-service simulate`: files for every method, figures, a summary; `work-precision`: table, JSON, figure."""

import json
import sys
from collections.abc import Mapping
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from shutil import get_terminal_size, which
from typing import Annotated, Any

import typer

from inverse_service import errors, settings
from inverse_service.cli import command_line as cli
from inverse_service.service.jobs import tasks, workers

DEFAULT_SECONDS, MEASURING_SECONDS = 600.0, 300.0
COLUMNS = (
    "method",
    "order",
    "step",
    "tolerance",
    "error",
    "seconds",
    "evaluations",
    "at_floor",
    "reason",
)
LONG = ("seconds", "energy_error", "energy_drift", "constraint_error", "shape_change")
NARROWEST = 80
# How `simulate` prints its summary.
SummaryFormat = StrEnum("SummaryFormat", "json text")


@cli.command("simulate scene.json --output out")
def simulate(
    scene: Annotated[
        str, typer.Argument(help="A Scene document: JSON, YAML (.yaml) or TOML (.toml); - is JSON.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Directory for CSV, NPZ, figures and summary.json."),
    ] = None,
    form: Annotated[
        SummaryFormat | None,
        typer.Option(
            "--format",
            "-f",
            help="Default: json, text with --output.",
            **cli.one_of(SummaryFormat, "format"),
        ),
    ] = None,
    time_limit: Annotated[float | None, cli.time_limit(f"{DEFAULT_SECONDS:.0f}")] = None,
    figures: Annotated[bool, typer.Option(help="Draw figures into the directory.")] = True,
    moving: Annotated[
        Path | None,
        typer.Option(
            "--animate", help="A moving picture of the first method: FILE.gif or FILE.mp4."
        ),
    ] = None,
) -> cli.ExitCode:
    """Integrate a scene by its methods. Exit 1 only if every method failed; `doubt` flags inaccurate runs."""
    document = scene_document(scene)
    folder = None if output is None else made_folder(output)
    found = _simulated(document, time_limit or DEFAULT_SECONDS, moving, folder is not None)
    summary = without_points(found["result"])
    if folder is not None:
        write_files(folder, document, found, summary, figures)
    is_json = form is SummaryFormat.json or (form is None and folder is None)
    cli.write(cli.in_json(summary) if is_json else page(summary))
    _say_written(folder, moving)
    completed = any(method["outcome"] in ("completed", "partly") for method in summary["methods"])
    return cli.ExitCode.DONE if completed else cli.ExitCode.OPEN


def _simulated(document: Any, limit: float, moving: Path | None, is_whole: bool) -> Any:
    """The result, and the tables of all points where they are written: no array is handed on for nothing."""
    if moving is not None:
        refuse_picture(moving)
        return value_in_time(tasks.animate_task, document, limit, str(moving), is_whole)
    if is_whole:
        return value_in_time(tasks.tables_task, document, limit)
    return {"result": value_in_time(tasks.simulate_task, document, limit)}


def refuse_picture(path: Path) -> None:
    """InputError for a moving picture that cannot be written, before any work."""
    if path.suffix not in (".gif", ".mp4"):
        raise errors.InputError("--animate needs the name of a file that ends with .gif or .mp4.")
    if path.suffix == ".mp4" and which("ffmpeg") is None:
        raise errors.InputError(
            "A .mp4 file needs the program ffmpeg: install it, or write a .gif file."
        )
    if not path.parent.is_dir():
        raise errors.InputError("The directory of --animate does not exist: name another.")


def scene_document(name: str) -> Any:
    """The scene of a file or of standard input; InputError for equations in its place."""
    if name != "-" and not cli.is_file(name) and ("=" in name or "''" in name):
        detail = (
            "These are equations, and a scene is a file: a system with its initial values, a step, a time, and "
            "methods. "
            f'Write {{"system": {{"equations": "{name[:60]}"}}, "initial": {{"positions": {{"x": 1}}, "velocities": '
            '{"x": 0}}, "step": 0.1, "time": 10, "methods": ["adaptive"]}, with your coordinates, into scene.json.'
        )
        raise errors.InputError(detail)
    return cli.read_document(name)


def value_in_time(task: Any, document: Any, limit: float, *others: Any) -> Any:
    """The result of the task; a limit that is reached becomes an error that names it and says what to do."""
    outcome = workers.run_alone(
        task, (document, None, limit, *others), limit, settings.read_settings().memory_limit
    )
    if outcome.status == "deadline":
        raise errors.WorkerFailed(
            f"The scene was not done in {limit:g} s: take fewer steps or a longer --time-limit."
        )
    return tasks.value_of(outcome)


def made_folder(output: Path) -> Path:
    """The directory, created if it is missing; InputError if it cannot be created."""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        detail = f"The directory of --output cannot be created: {error.strerror}; name another."
        raise errors.InputError(detail) from None
    return output


def without_points(result: Mapping[str, Any]) -> dict[str, Any]:
    """The document without the points, which the CSV and NPZ files hold."""
    methods = [
        {key: value for key, value in method.items() if key not in ("points", "members_columns")}
        for method in result["methods"]
    ]
    return {**result, "methods": methods}


def write_files(
    folder: Path, document: Any, found: Mapping[str, Any], summary: dict[str, Any], figures: bool
) -> None:
    """LABEL.csv and LABEL.npz with every recorded point and all columns, figures as SVG and PNG,
    summary.json.

    Of an ensemble the CSV has a row for each member. NPZ files hold the scene and the version as
    text in `metadata`.
    """
    from inverse_service.service.scenes.simulating import csv_bytes, npz_bytes

    tables, version = found["tables"], summary["provenance"]
    for method in summary["methods"]:
        label = method["label"]
        if label not in tables:
            continue
        name, table = file_name(label), tables[label]
        members = {
            key.removeprefix("member_"): column
            for key, column in table.items()
            if key.startswith("member_")
        }
        (folder / f"{name}.csv").write_bytes(csv_bytes(members or table))
        archive, metadata = npz_bytes(table, document, label, version)
        (folder / f"{name}.npz").write_bytes(archive)
        method["files"] = [f"{name}.csv", f"{name}.npz"]
        if find_spec("h5netcdf") is not None and find_spec("h5py") is not None:
            write_netcdf(folder / f"{name}.nc", table, summary["units"], metadata)
            method["files"].append(f"{name}.nc")
        if label in found["events"]:
            (folder / f"{name}-events.csv").write_bytes(csv_bytes(found["events"][label]))
            method["files"].append(f"{name}-events.csv")
    if figures:
        from inverse_service.service.scenes.drawing import draw_simulation

        summary["figures"] = draw_simulation(folder, summary, tables, found["truth"])
    (folder / "summary.json").write_text(
        cli.in_json(summary | {"scene": document}), encoding="utf-8"
    )


def write_netcdf(
    path: Path, table: Mapping[str, Any], units: Mapping[str, str], metadata: str
) -> None:
    """NetCDF 4, which is HDF5: each column over `t`, those of an ensemble over `member` and `t`, with their units."""
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        members = next((len(column) for column in table.values() if column.ndim == 2), 0)
        file.dimensions = {"t": len(table["t"])} | ({"member": members} if members else {})
        file.attrs.update({"Conventions": "CF-1.11", "metadata": metadata})
        for name, column in table.items():
            over = (
                ("member", "t")
                if column.ndim == 2
                else ("member",)
                if name.startswith("member_")
                else ("t",)
            )
            variable = file.create_variable(name.replace("/", "_"), over, column.dtype, data=column)
            if name in units:
                variable.attrs["units"] = units[name]


def file_name(label: str) -> str:
    """The label with only characters that every file system takes."""
    return (
        "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in label).lstrip(
            "."
        )
        or "method"
    )


def page(summary: Mapping[str, Any]) -> str:
    """One line per method: outcome and observed quantities."""
    from inverse_service.service.documents import (
        printed_pages,
    )  # which loads the reader of formulas

    columns = printed_pages.quantities(summary)
    rows = [["method", "outcome", "steps", *(heading for _, heading in columns)]]
    for method in summary["methods"]:
        numbers = [_number(printed_pages.value_at(method, key)) for key, _ in columns]
        rows.append([method["label"], method["outcome"], str(method["steps"]), *numbers])
    lines = [
        *_aligned(rows),
        *_reasons(summary),
        *_effects(summary),
        *_costs(summary),
        *summary["notes"],
    ]
    return "\n".join(lines) + "\n"


def _effects(summary: Mapping[str, Any]) -> list[str]:
    """What acted and what was left out, with the operations of a step."""
    lines, effects = [], summary["effects"]
    for key, what in (("acting", "Effects that act"), ("left_out", "Left out")):
        parts = [
            part["name"]
            if part["operations"] is None
            else f"{part['name']} ({part['operations']} operations a step)"
            for part in effects[key]
        ]
        lines += [f"{what}: {', '.join(parts)}."] if parts else []
    return lines


def _number(value: Any) -> str:
    return "-" if value is None else f"{value or 0:.4g}"


def _costs(summary: Mapping[str, Any]) -> list[str]:
    """What a step costs and what each part adds, where the scene observes it."""
    lines = []
    for method in summary["methods"]:
        cost = method.get("cost") or {}
        if cost.get("step_ns") is None:
            continue
        parts = [
            f"{part['name']}{' observed' if part['kind'] == 'observed' else ''} {_price(part)}"
            for part in cost["parts"]
            if part["step_ns"] is not None and part["operations"]
        ]
        added = f"; of these {', '.join(parts)}" if parts else ""
        lines.append(f"{method['label']}: a step takes {_price(cost)}{added}")
    return lines


def _price(part: Mapping[str, Any]) -> str:
    return f"{part['step_ns']:.0f} ns ({part['operations']} operations)"


def _reasons(summary: Mapping[str, Any]) -> list[str]:
    from inverse_service.service.documents import printed_pages as pages

    lines = []
    for method in summary["methods"]:
        told = (
            pages.why(method),
            method.get("note"),
            method.get("doubt"),
            *pages.notes_of_quantities(method),
            *pages.notes_of_formulas(method),
        )
        lines += [f"{method['label']}: {text}" for text in dict.fromkeys(filter(None, told))]
    return lines


@cli.command("work-precision scene.json --output out", "work-precision")
def work_precision(
    scene: Annotated[
        str, typer.Argument(help="A Scene document; its methods are run at many steps.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory for CSV, JSON and picture.")
    ] = None,
    long: Annotated[
        bool, typer.Option("--long", help="Also run a hundred times as long, to show drift.")
    ] = False,
    evaluations: Annotated[
        bool, typer.Option("--evaluations", help="A second panel: force evaluations.")
    ] = False,
    time_limit: Annotated[float | None, cli.time_limit(f"{MEASURING_SECONDS:.0f}")] = None,
) -> cli.ExitCode:
    """Measure error against run time for every method of a scene: a table, a picture, all runs."""
    document = scene_document(scene)
    folder = None if output is None else made_folder(output)
    if long and isinstance(document, dict):
        document = document | {"long": True}
    result = value_in_time(tasks.work_precision_task, document, time_limit or MEASURING_SECONDS)
    if folder is None:
        cli.write(price_list(result) if sys.stdout.isatty() else cli.in_json(result))
        return cli.ExitCode.DONE
    from inverse_service.service.scenes.drawing import precision_figure, save

    figure, caption = precision_figure(result, evaluations)
    result["figures"] = [
        {"files": save(figure, folder, "work-precision", caption), "caption": caption}
    ]
    (folder / "work-precision.json").write_text(cli.in_json(result), encoding="utf-8")
    (folder / "work-precision.csv").write_text(comma_table(result), encoding="utf-8")
    cli.write(price_list(result))
    _say_written(folder)
    return cli.ExitCode.DONE


def _say_written(folder: Path | None, moving: Path | None = None) -> None:
    if folder is not None:
        print(
            f"Written to {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}",
            file=sys.stderr,
        )
    if moving is not None and (folder is None or moving.parent.resolve() != folder.resolve()):
        print(f"Written: {moving}", file=sys.stderr)


def comma_table(result: Mapping[str, Any]) -> str:
    """One line for each run, errors relative to the size of the motion; cells without a measurement are empty."""
    lines = [",".join(COLUMNS)]
    for run in result["runs"]:
        cells = ("" if run[key] in (None, "") else run[key] for key in COLUMNS)
        lines.append(
            ",".join(
                json.dumps(cell) if isinstance(cell, str) and cell else str(cell) for cell in cells
            )
        )
    return "\n".join(lines) + "\n"


def price_list(result: Mapping[str, Any]) -> str:
    """What each error costs: a column for each method, the best first, as many as the terminal is
    wide; two sentences; the long run, where it was measured."""
    from inverse_service.service.scenes import views  # which loads NumPy

    labels, rows = views.best_first(result), []
    for target in result["targets"]:
        row = [views.price_of(target, label) for label in labels]
        rows.append([views.power_of_ten(target["error"]), *(price.time for price in row)])
        rows.append(["", *(", ".join(filter(None, (price.ratio, price.setting))) for price in row)])
    table = [["error", *labels], *rows]
    width = max(NARROWEST, get_terminal_size().columns)
    count = len(labels)
    while count > 1 and max(map(len, _aligned([row[: count + 1] for row in table]))) > width:
        count -= 1
    left = f"Not shown: {', '.join(labels[count:])}." if count < len(labels) else ""
    lines = [*_aligned([row[: count + 1] for row in table]), left, "", *result["sentences"]]
    if result["long"]:
        done = [run for run in result["long"] if not run["reason"]]
        names = [name for name in LONG if any(run[name] is not None for run in done)]
        heads = ["100 times the time", "step", *(name.replace("_", " ") for name in names)]
        lines += ["", *_aligned([heads, *(
            [run["method"], f"{run['step'] or run['tolerance']:.2g}", *(_number(run[name]) for name in names)]
            for run in done
        )])]  # fmt: skip
    machine = result["machine"]
    lines.append(
        f"{machine['processor']}, one core; each time is the best of several runs without compiling."
    )
    return "\n".join(line for k, line in enumerate(lines) if line or lines[k - 1]) + "\n"


def _aligned(rows: list[list[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
