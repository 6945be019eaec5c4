"""What a batch was expected to answer: the differences, and a report as JUnit writes it for continuous integration."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from inverse_service import errors
from inverse_service.service.jobs import batch


@dataclass(frozen=True, slots=True)
class Judged:
    """A line with its verdict or its error, and in what it differs from what was expected."""

    name: str
    verdict: str
    error: str = ""
    differences: tuple[str, ...] = field(default=())


def judged(output: Path, expected: Path | None) -> Iterator[Judged]:
    """Each line of a batch's output, then those that were expected and are not there.

    A line of `expected` has an `id` and keys of a result with their values, such as verdict. InputError for others.
    """
    wanted = {} if expected is None else _wanted(expected)
    with batch.open_source(output) as stream:
        for line, answer in batch.read_answers(stream):
            name = _name(answer["id"], line.number)
            yield _judged(name, answer, wanted.pop(name, {}))
    yield from (Judged(name, "", differences=("no answer",)) for name in wanted)


def _wanted(path: Path) -> dict[str, Mapping[str, Any]]:
    found: dict[str, Mapping[str, Any]] = {}
    with batch.open_source(path) as stream:
        for line in batch.read_lines(stream):
            value = _object(line.raw)
            if value is None or len(value) < 2 or "id" not in value:
                raise errors.InputError(
                    f"Line {line.number} of the expected answers has no 'id' and key, such as 'verdict'."
                )
            found[_name(value["id"], line.number)] = value
    return found


def _object(raw: bytes) -> Mapping[str, Any] | None:
    try:
        value = json.loads(raw)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _name(identifier: Any, number: int) -> str:
    return f"line {number}" if identifier is None else str(identifier)


def _judged(name: str, answer: Mapping[str, Any], wanted: Mapping[str, Any]) -> Judged:
    keys = [key for key in wanted if key != "id"]
    differences = tuple(
        f"{key} is {json.dumps(answer.get(key))}, expected {json.dumps(wanted[key])}"
        for key in keys
        if answer.get(key) != wanted[key]
    )
    error = answer.get("error")
    detail = str(error.get("detail") or error.get("title") or "error") if isinstance(error, dict) else ""
    return Judged(name, str(answer.get("verdict") or ""), detail if "error" not in wanted else "", differences)


def write_junit(path: Path, lines: list[Judged]) -> None:
    """The report: a failure for each line that differs, an error for each that has no answer."""
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
    """Without the characters that XML cannot hold."""
    return "".join(c if c >= " " and not 0xD800 <= ord(c) <= 0xDFFF and c not in "\ufffe\uffff" else "?" for c in text)
