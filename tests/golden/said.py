"""All that is said of texts and certificates of the corpus by default, as digests.

Their own tests compare what a row states: equations, a verdict, words of a refusal. Here the whole
answer is compared: hints, columns, spans, notes, how an equation is written, and the reasons,
the domain, and the exceptions of the checker.
`python -m tests.golden.said` writes the digests again. With a PATH it also writes the texts
there, and prints how they differ from those that another state of the code wrote there.
"""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from inverse_service.errors import InputError
from inverse_service.service.documents import answers
from tests.certificate.judged import judged
from tests.doors import choosing, parsing
from tests.doors.rows import Row, rows

STORED = Path(__file__).with_name("said.json")
KINDS = ("certificates", "readings", "typed", "refusals")
APART = {"refusals": 5}  # one row in so many


def chosen(kind: str) -> Iterator[Row]:
    """The rows of a file that are default ones."""
    for place, row in enumerate(rows(kind)):
        if {"slow", "nightly", "open"} & set(row) or place % APART.get(kind, 1):
            continue
        if kind not in choosing.CHOSEN or choosing.is_quick(kind, place, row):
            yield row


def said(kind: str) -> dict[str, str]:
    """What is said of each row of a kind, by its name."""
    return {f"{k} {row['id']}": _text(_answer(kind, row)) for k, row in enumerate(chosen(kind))}


def digests(found: dict[str, str]) -> dict[str, str]:
    return {name: hashlib.sha256(text.encode()).hexdigest()[:12] for name, text in found.items()}


def _answer(kind: str, row: Row) -> Any:
    if kind == "certificates":
        return dataclasses.asdict(judged(row["certificate"], row["seeds"][0]))
    read = parsing.parsed(row["document"])
    return answers.of_input_error(read) if isinstance(read, InputError) else read


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, indent=1, ensure_ascii=False)


def main() -> None:
    """Write the digests; where a path is given, the texts too, and how they differ from its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("texts", nargs="*", type=Path)
    paths: list[Path] = parser.parse_args().texts
    every = {kind: said(kind) for kind in KINDS}
    for path in paths:
        old = path.read_text(encoding="utf-8").split("\n") if path.exists() else []
        new = [line for kind in KINDS for pair in every[kind].items() for line in _lines(pair)]
        if old:
            print("\n".join(difflib.unified_diff(old, new, "before", "now", lineterm="", n=2)))
        path.write_text("\n".join(new), encoding="utf-8")
    stored = {kind: digests(found) for kind, found in every.items()}
    STORED.write_text(json.dumps(stored, indent=0, ensure_ascii=True) + "\n", encoding="utf-8")


def _lines(pair: tuple[str, str]) -> list[str]:
    return [pair[0], *pair[1].split("\n")]


if __name__ == "__main__":
    main()
