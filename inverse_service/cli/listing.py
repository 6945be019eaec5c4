"""`inverse-service catalogue` and `inverse-service table`."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

from inverse_service import catalogue
from inverse_service.cli.exits import ExitCode, write
from inverse_service.errors import InputError
from inverse_service.service.jobs.batch_files import open_source, read_lines
from inverse_service.sympy.result import row_of


def list_catalogue(name: str | None, form: str | None) -> ExitCode:
    """Print the list of names, or one system; raises InputError for a name that is not there."""
    write((_all(form or "text") if name is None else _one(name, form or "json")) + "\n")
    return ExitCode.DONE


def _all(form: str) -> str:
    entries = [catalogue.entry(name) for name in catalogue.names()]
    if form == "json":
        lines = [{key: entry.get(key, "") for key in ("name", "title", "group")} for entry in entries]
        return json.dumps({"systems": lines}, ensure_ascii=False, indent=2)
    width = max((len(entry["name"]) for entry in entries), default=0)
    return "\n".join(f"{entry['name']:<{width}}  {entry.get('title', '')}" for entry in entries)


def _one(name: str, form: str) -> str:
    try:
        entry = catalogue.entry(name)
    except KeyError as error:
        raise InputError(f"There is {error.args[0]}; 'inverse-service catalogue' lists all names.") from None
    document = entry["document"]
    if form == "json":
        return json.dumps(document, ensure_ascii=False, indent=2)
    lines = [entry.get("title", name), f"source: {entry.get('source', '')}"]
    lines += [
        f"expected: {key} = {value}" for key, value in entry.get("expected", {}).items() if isinstance(value, str)
    ]
    return "\n".join([*lines, json.dumps(document, ensure_ascii=False, indent=2)])


def write_table(path: Path) -> ExitCode:
    """Print one row of CSV for each line of a batch's output; raises InputError for a line that is no JSON object."""
    with open_source(path) as source:
        for place, line in enumerate(read_lines(source)):
            if line.document is None:
                raise InputError(f"Line {line.number} is not an answer of a batch.")
            row, text = row_of({**line.document, "id": line.identifier}), io.StringIO()
            writer = csv.DictWriter(text, list(row))
            if place == 0:
                writer.writeheader()
            writer.writerow(row)
            write(text.getvalue())
    return ExitCode.DONE
