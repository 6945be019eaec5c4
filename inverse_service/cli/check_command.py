"""`inverse-service check`, `batch` and `table`: the independent checker, and many systems at once."""

import csv
import io
import json
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal
from xml.etree import ElementTree

import typer

from inverse_service import errors
from inverse_service.cli import command_line as cli, solve_command
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import plain_data
from inverse_service.service.jobs import batch as batches, model, tasks, workers
from inverse_service.settings import read_settings

MAX_RESULT_BYTES = 200_000_000
Report = Callable[[batches.Line], None]
# Off a terminal, one line so often says how far the batch is; s.
BETWEEN_LINES = 60.0
NAMES = {
    "error": ("error line", "error lines"),
    "fault": ("fault of the program", "faults of the program"),
}


@cli.command("check result.json")
def check(
    file: Annotated[
        str,
        typer.Argument(
            help="A result or certificate (JSON), the .ndjson of a batch, or - for standard input; "
            "with --lagrangian what solve takes."
        ),
    ],
    document: Annotated[
        str | None,
        typer.Option(
            "--document", help="Check against this document instead of the one in the result."
        ),
    ] = None,
    lagrangian: Annotated[
        str | None,
        typer.Option(
            "--lagrangian", help="Test whether this Lagrangian yields the equations of FILE."
        ),
    ] = None,
    form: Annotated[
        Literal["text", "json"] | None,
        typer.Option("--format", help="Default: text on a terminal, json otherwise."),
    ] = None,
    exceptions: Annotated[
        bool,
        typer.Option(
            "--exceptions", help="Decide the parameter values that the result leaves out."
        ),
    ] = False,
) -> cli.ExitCode:
    """Check the certificate of a result, or a Lagrangian of yours. Exit 0 valid, 1 not valid, 2 unreadable."""
    if exceptions:
        return _check_exceptions(file, form)
    if lagrangian is None and document is None and is_batch(file):
        return check_batch(file)
    from inverse_service.service.documents.answers import check_document

    if lagrangian is not None:
        from inverse_service.service.documents.own_lagrangian import document_given_in

        whole = file == "-" or file.lower().endswith(".json")
        found = _read(file) if whole else solve_command.given_document(file, None)
        given, _ = model.split_options(document_given_in(found))
        text = plain_data.write_json({"system": given, "lagrangian": lagrangian})
    else:
        result = _read(file)
        text = plain_data.write_json(result)
        if document is not None:
            given, _ = model.split_options(cli.read_document(document))
            text = plain_data.write_json({"document": given, "result": result})
    settings = read_settings()
    outcome = workers.run_alone(
        tasks.check_task, (text,), settings.time_limit, settings.memory_limit
    )
    found = check_document(outcome)
    _print(found, form, lambda: check_lines(found))
    return cli.ExitCode.DONE if found["verdict"] == "valid" else cli.ExitCode.OPEN


def _print(found: dict[str, Any], form: str | None, lines: Callable[[], list[str]]) -> None:
    """Print JSON into a pipe and lines on a terminal, unless the format is given."""
    plain = form == "json" or (form is None and not sys.stdout.isatty())
    cli.write(cli.in_json(found) if plain else "\n".join(lines()) + "\n")


def _check_exceptions(name: str, form: str | None) -> cli.ExitCode:
    """Solve the systems of a result at the values of the parameters that it leaves out."""
    from inverse_service.service.documents.derived import documents_of_exceptions

    result, settings = _read(name), read_settings()
    decided = list[dict[str, Any]]()
    for text, document in documents_of_exceptions(result):
        entry: dict[str, Any] = {
            "where": text,
            "verdict": "undetermined",
            "verdict_with_time": None,
        }
        if document is not None:
            work = (document, SolveOptions(time_limit=settings.time_limit))
            outcome = workers.run_alone(
                tasks.solve_task, work, settings.time_limit, settings.memory_limit
            )
            if outcome.status not in ("deadline", "memory"):
                found = tasks.value_of(outcome)
                entry |= {
                    key: found[key] for key in ("verdict", "verdict_with_time", "checked", "domain")
                }
                entry["lagrangian"] = (found["lagrangian"] or {}).get("text")
        decided.append(entry)
    lines = [line for one in decided for line in _exception_lines(one)]
    _print({"exceptions": decided}, form, lambda: lines or ["no exceptions"])
    return (
        cli.ExitCode.DONE
        if all(one["verdict"] != "undetermined" for one in decided)
        else cli.ExitCode.OPEN
    )


def _exception_lines(one: dict[str, Any]) -> Iterator[str]:
    yield f"{one['where']}: {one['verdict'].replace('_', ' ')}"
    if one["verdict_with_time"] not in (None, one["verdict"]):
        yield f"  with the time: {one['verdict_with_time'].replace('_', ' ')}"
    if one.get("lagrangian"):
        yield f"  L = {one['lagrangian']}"


def _read(name: str) -> dict[str, Any]:
    data, is_json = (
        cli.read_bytes(name, MAX_RESULT_BYTES),
        not name.lower().endswith((".yaml", ".yml", ".toml")),
    )
    found = plain_data.read_json(data) if is_json else plain_data.read_document(data, name)
    if not isinstance(found, dict):
        detail = "The file is not a result: a JSON object with verdict, system and certificate is needed."
        raise errors.InputError(detail)
    return found


def check_lines(found: dict[str, Any]) -> list[str]:
    """An answer of the checker as plain text."""
    lines = [found["verdict"]]
    if found.get("statement"):
        lines += ["", *found["statement"]["text"].split("\n")]
    cells = found.get("cells") or []
    if found.get("residual") is not None or len(cells) > 1:
        lines += ["", *(line for cell in cells for line in _cell_lines(cell))]
    lines += [""] if found.get("contradictions") else []
    lines += [
        f"{one['field'] or '/'}: {one['proven']}" for one in found.get("contradictions") or []
    ]
    if found["verdict"] != "valid":
        told = {
            f"{one['field'] or 'the result'}: {one['proven']}"
            for one in found.get("contradictions") or []
        }
        lines += [reason for reason in found["reasons"] if reason not in told]
    residual = (found.get("residual") or {}) if found["verdict"] in ("invalid", "differs") else {}
    lines += [
        f"  d/dt(dL/d{x}') - dL/d{x} = {part['text']}, where it should be 0"
        for x, part in residual.items()
    ]
    lines += [
        f"  this L gives {x}'' = {part['text']}"
        for x, part in (found.get("equations") or {}).items()
    ]
    left = found.get("not_checked") or []
    return [*lines, "", f"Not checked: {', '.join(left)}."] if left else lines


def _cell_lines(cell: dict[str, Any]) -> Iterator[str]:
    yield f"{', '.join(cell['domain']) or 'everywhere'}: {cell['verdict'].replace('_', ' ')}"
    if cell.get("at"):
        yield f"  at {', '.join(f'{name} = {value}' for name, value in cell['at'].items())}:"
        for name, value in (cell.get("accelerations") or {}).get("given", {}).items():
            yield f"  {name}'' = {value} as given, {cell['accelerations']['lagrangian'][name]} by this L"


def is_batch(name: str) -> bool:
    """Whether the file is the output of a batch: by its suffix, or by a complete object in line 1."""
    if name.endswith((".ndjson", ".jsonl", ".gz")):
        return True
    try:
        with Path(name).open(encoding="utf-8") as stream:
            first, second = stream.readline(MAX_RESULT_BYTES), stream.readline(2)
        return bool(second.strip()) and isinstance(json.loads(first), dict)
    except (OSError, ValueError):
        return False


def check_batch(name: str) -> cli.ExitCode:
    """Check every line of a batch's output and print the invalid lines and the totals. 0: every claim is valid."""
    cli.refuse_without_pools("The check of many answers")
    settings = read_settings()
    options = model.JobOptions(settings.time_limit, settings.memory_limit)
    summary, others = batches.Summary(), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        claims, answers = Path(folder) / "claims.ndjson", Path(folder) / "answers.ndjson"
        ids = _claims(name, claims, others)
        if ids:
            plan = batches.BatchPlan(claims, answers, options, settings.workers, kind="check")
            with progress(summary, len(ids)) as report:
                batches.run_batch(plan, summary, report)
            with answers.open(encoding="utf-8") as stream:
                for answer in map(json.loads, stream):
                    number, verdict = answer["id"], answer.get("verdict", "error")
                    if verdict != "valid":
                        reasons = " ".join(answer.get("reasons") or [answer["error"]["detail"]])
                        cli.write(f"line {number}, id {ids[number]}: {verdict}: {reasons}\n")
    found = (*sorted(summary.labels.items()), *others.items())
    counts = [f"{count} {NAMES.get(what, (what, what))[count != 1]}" for what, count in found]
    cli.write(f"{', '.join(counts) or 'no lines'}.\n")
    return (
        cli.ExitCode.OPEN
        if others["error"] or summary.labels.keys() - {"valid"}
        else cli.ExitCode.DONE
    )


def _claims(name: str, target: Path, others: Counter[str]) -> dict[int, str]:
    """Write the results that make a claim under their line numbers; return their ids and count the other results."""
    ids = {}
    with batches.open_source(Path(name)) as source, target.open("w", encoding="utf-8") as stream:
        for line, result in batches.read_answers(source):
            if "error" in result:
                others["error"] += 1
            elif "verdict" not in result:
                others["without a verdict to check"] += 1
            else:
                ids[line.number] = json.dumps(line.identifier)
                stream.write(plain_data.write_json({**result, "id": line.number}) + "\n")
    return ids


@cli.command("batch systems.ndjson --output answers.ndjson")
def batch(
    file: Annotated[
        Path,
        typer.Argument(help="NDJSON (or .gz), one System per line with a unique id; - for stdin."),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="NDJSON (or .gz) of results; a run resumes it; - for stdout."
        ),
    ],
    processes: Annotated[
        int | None,
        typer.Option(
            "--workers",
            help="Number of processes (default: one per core).",
            **cli.integer("--workers", 1, 256),
        ),
    ] = None,
    time_limit: Annotated[float | None, cli.time_limit("from the settings, 60")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786.")
    ] = None,
    again: Annotated[
        str, typer.Option(help="Retry lines of an earlier run: errors,undetermined.")
    ] = "",
    expect: Annotated[
        Path | None,
        typer.Option(
            "--expect", help="NDJSON of ids and expected values of the answers, such as verdict."
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option("--junit", help="Write a JUnit XML report, one test case per line."),
    ] = None,
) -> cli.ExitCode:
    """Solve many systems, one per line; run the same command again to resume.

    Exit 0 all answered (and as expected), 1 some error lines or other answers than expected, 2 bad
    files or nothing but errors, 3 a fault of the program, 130 interrupted.
    """
    cli.refuse_without_pools("'batch'")
    if (expect or junit) and str(output) == "-":
        raise errors.InputError(
            "--expect and --junit read the output again: give a file with --output."
        )
    # A wrong file is refused before a batch that may run for hours.
    wanted = {} if expect is None else _wanted(expect)
    if junit is not None:
        _refuse_report(junit, [file, output, *([expect] if expect else [])])
    settings = read_settings()
    options = model.JobOptions(time_limit or settings.time_limit, settings.memory_limit)
    kinds = frozenset(part.strip() for part in again.split(",") if part.strip())
    if not kinds <= batches.AGAIN.keys():
        raise errors.InputError(
            f"--again takes {' and '.join(batches.AGAIN)}, with a comma between them."
        )
    count = processes or settings.workers
    plan = batches.BatchPlan(file, output, options, count, cluster or settings.cluster, kinds)
    summary, began = batches.Summary(), time.monotonic()
    # Schedulers end a job by SIGTERM: it is the same as Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    total = batches.count_lines(file)
    solve_command.warm_alone(settings.memory_limit)
    try:
        with progress(summary, total) as report:
            batches.run_batch(plan, summary, report)
    except KeyboardInterrupt:
        print(f"{_how_far(summary, total)}; run the same command again to resume.", file=sys.stderr)
        return cli.ExitCode.INTERRUPTED
    sentences = summary_sentences(summary, time.monotonic() - began)
    if summary.replaced:
        sentences.append(f"Answers that were replaced are in {batches.replaced_path(output)}.")
    print("\n".join(sentences), file=sys.stderr)
    code = (
        cli.ExitCode.FAULT
        if summary.labels["fault"]
        else cli.ExitCode(min(1, summary.labels["error"]))
    )
    if expect is None and junit is None:
        return code
    lines = list(judged(output, wanted))
    if junit is not None:
        write_junit(junit, lines)
    differ = [line for line in lines if line.differences]
    cli.write(
        "".join(
            f"{line.name}: {difference}\n" for line in differ for difference in line.differences
        )
    )
    if expect is None or code is cli.ExitCode.FAULT:
        return code
    return cli.ExitCode(int(bool(differ) or any(line.error for line in lines)))


def rows_of(summary: batches.Summary) -> list[tuple[str, int]]:
    """The counts with their names; error lines are listed even if there are none."""
    counts = summary.labels | {"error": summary.labels["error"]}
    order = sorted(counts, key=lambda label: (label in NAMES, label))
    rows = [
        (NAMES.get(label, (label.replace("_", " "),) * 2)[counts[label] != 1], counts[label])
        for label in order
    ]
    others = (
        ("answered by an earlier run", summary.earlier),
        ("computed once with another line", summary.duplicates),
    )
    return rows + [(name, count) for name, count in others if count]


def summary_sentences(summary: batches.Summary, seconds: float) -> list[str]:
    """All counts, the rate, and the first reason why a line has no verdict."""
    if not summary.labels.total():
        return ["The input has no lines, so there is nothing to answer."]
    sentences = [", ".join(f"{count} {name}" for name, count in rows_of(summary)) + "."]
    if summary.new:
        lines = "line" if summary.new == 1 else "lines"
        sentences.append(
            f"{summary.new} {lines} in {seconds:.1f} s, {summary.new / seconds:.3g} a second."
        )
    for label in ("undetermined", "error", "fault"):
        if label in summary.first:
            sentences.append(f"The first {NAMES.get(label, (label,))[0]}: {summary.first[label]}")
    return sentences


def _how_far(summary: batches.Summary, total: int | None) -> str:
    of_all = "" if total is None else f" of {total}"
    return f"{summary.labels.total()}{of_all} lines answered"


@contextmanager
def progress(summary: batches.Summary, total: int | None) -> Iterator[Report]:
    """A progress bar on a terminal, otherwise a line every minute."""
    if not sys.stderr.isatty():
        said = time.monotonic()

        def say(line: batches.Line) -> None:
            nonlocal said
            if time.monotonic() - said > BETWEEN_LINES:
                said = time.monotonic()
                print(f"{_how_far(summary, total)}.", file=sys.stderr)

        yield say
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("systems", total=total)
        yield lambda line: progress.update(task, completed=line.number)


@cli.command("table answers.ndjson")
def table(
    file: Annotated[
        Path, typer.Argument(help="The output of a batch: NDJSON (or .gz); - for standard input.")
    ],
    every: Annotated[
        bool, typer.Option("--all", help="One row for each answer, not for the first alone.")
    ] = False,
) -> cli.ExitCode:
    """Convert the results of a batch to CSV, one row per line: the answer that people are shown first."""
    from inverse_service.service.documents import answer_rows  # for this command only

    header = dict(zip(answer_rows.COLUMNS, answer_rows.COLUMNS, strict=True))
    with batches.open_source(file) as source:
        tables = (
            answer_rows.rows(answer) if every else [answer_rows.first_row(answer)]
            for _, answer in batches.read_answers(source)
        )
        cli.write(_as_csv(answer_rows.COLUMNS, [header, *next(tables, [])]))
        for rows in tables:
            cli.write(_as_csv(answer_rows.COLUMNS, rows))
    return cli.ExitCode.DONE


def _as_csv(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    csv.DictWriter(text, columns).writerows(rows)
    return text.getvalue()


@dataclass(frozen=True, slots=True)
class Judged:
    """A line with its verdict or error, and its differences from the expected values."""

    name: str
    verdict: str
    error: str = ""
    differences: tuple[str, ...] = field(default=())


def judged(output: Path, expected: Mapping[str, Mapping[str, Any]]) -> Iterator[Judged]:
    """Each line of a batch's output, then the lines that are missing of those expected, which are by name."""
    wanted = dict(expected)
    with batches.open_source(output) as stream:
        for line, answer in batches.read_answers(stream):
            name = _name(answer["id"], answer.get("line", line.number))
            yield _judged(name, answer, wanted.pop(name, {}))
    yield from (Judged(name, "", differences=("no answer",)) for name in wanted)


def _wanted(path: Path) -> dict[str, Mapping[str, Any]]:
    """By name, an `id` and keys of a result with their values, such as verdict; InputError for other lines."""
    found: dict[str, Mapping[str, Any]] = {}
    with batches.open_source(path) as stream:
        for line in batches.read_lines(stream):
            try:
                value = json.loads(line.raw)
            except ValueError:
                value = None
            if not isinstance(value, dict) or len(value) < 2 or "id" not in value:
                detail = f"Line {line.number} of the expected answers has no 'id' and key, such as 'verdict'."
                raise errors.InputError(detail)
            name = _name(value["id"], line.number)
            if name in found:
                raise errors.InputError(
                    f"Line {line.number} of the expected answers repeats the id {name}."
                )
            found[name] = value
    return found


def _name(identifier: Any, number: int) -> str:
    return f"line {number}" if identifier is None else str(identifier)


def _judged(name: str, answer: Mapping[str, Any], wanted: Mapping[str, Any]) -> Judged:
    differ = [key for key in wanted if key != "id" and answer.get(key) != wanted[key]]
    pairs = [(key, json.dumps(answer.get(key)), json.dumps(wanted[key])) for key in differ]
    differences = tuple(f"{key} is {found}, expected {expected}" for key, found, expected in pairs)
    error = answer.get("error")
    detail = (
        str(error.get("detail") or error.get("title") or "error") if isinstance(error, dict) else ""
    )
    return Judged(
        name, str(answer.get("verdict") or ""), detail if "error" not in wanted else "", differences
    )


def _refuse_report(path: Path, others: Sequence[Path]) -> None:
    """InputError where a report would overwrite another file of the batch, or has no folder."""
    if path.resolve() in {other.resolve() for other in others}:
        raise errors.InputError(
            f"The report would overwrite {path}; choose another file for --junit."
        )
    if not path.parent.is_dir():
        raise errors.InputError(f"The report cannot be written: there is no folder {path.parent}.")


def write_junit(path: Path, lines: list[Judged]) -> None:
    """The report: a failure for each line that differs, an error for each line without an answer."""
    failed = [line for line in lines if line.differences]
    bad = [line for line in lines if line.error and not line.differences]
    counts = {"tests": str(len(lines)), "failures": str(len(failed)), "errors": str(len(bad))}
    suite = ElementTree.Element("testsuite", {"name": "inverse-service", **counts})
    for line in lines:
        case = ElementTree.SubElement(suite, "testcase", classname="batch", name=_plain(line.name))
        if line.differences:
            ElementTree.SubElement(case, "failure", message=_plain("; ".join(line.differences)))
        elif line.error:
            ElementTree.SubElement(case, "error", message=_plain(line.error))
        else:
            ElementTree.SubElement(case, "system-out").text = line.verdict
    try:
        ElementTree.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise errors.InputError(f"The report cannot be written: {error.strerror}.") from None


def _plain(text: str) -> str:
    """The text with `?` in place of characters that XML cannot contain."""
    return "".join(
        c if c >= " " and not 0xD800 <= ord(c) <= 0xDFFF and c not in "\ufffe\uffff" else "?"
        for c in text
    )
