"""Names, commands and characters that formulas cannot have, from refused.ndjson, and what to write instead."""

import json
from pathlib import Path
from typing import NamedTuple

_TEXT = Path(__file__).with_name("refused.ndjson").read_text(encoding="utf-8")


class Reason(NamedTuple):
    """The problem with a word, what to write instead, the member that could declare it, and texts for its place."""

    problem: str
    instead: str
    declare: str = ""
    offers: tuple[str, ...] = ()


def reasons(kind: str) -> dict[str, Reason]:
    """The reasons by word, for words of one kind; WORD in a sentence is the word itself."""
    rows = [row for row in map(json.loads, _TEXT.splitlines()) if row["of"] == kind]
    return {
        word: Reason(
            row.get("problem", ""), row["instead"].replace("WORD", word), row.get("declare", ""),
            tuple(row.get("offers", ())),
        )
        for row in rows
        for word in row["words"]
    }  # fmt: skip
