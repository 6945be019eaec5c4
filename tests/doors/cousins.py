"""What a row of the corpus asks and states, without its numbers.

A row that asks the same as another and states all that it states is its cousin.
"""

from __future__ import annotations

import json

from tests.doors.rows import Row

NOTES = {
    *("id", "source", "document", "certificate", "scene", "equations", "why", "proof", "cited"),
    *("slow", "nightly", "doors", "open", "same_as", "seeds", "size", "reason", "noted"),
    *("known", "cousin"),  # what proves a verdict without the program; the row that stands for it
}
BY_VALUE = ("verdict", "verdict_with_time", "any_associated")
ASKED = ("constraints", "motion", "lagrangian", "functions", "clock", "where", "family")
CLAIM = ("question", "claim", "among", "kind")

Statement = tuple[frozenset[str], frozenset[str]]


def statement(row: Row) -> Statement:
    """What a row asks, and what it states: its keys, and the words among their values.

    A scene asks what its motion is given by, and states outcomes; a certificate asks for its claim.
    """
    keys = {key for key in row if key not in NOTES}
    words = {f"{key} {row[key]}" for key in BY_VALUE if isinstance(row.get(key), str | list)}
    if "scene" in row:
        given = row["scene"].keys() | row["scene"]["system"].keys()
        ends = {json.dumps(one) for one in row.get("outcomes", {}).values()}
        ends |= {"no motion to the end"} if row.get("final", 0) is None else set()
        asked = given & {"constraints", "forces", "events", "contacts"}
        return frozenset(asked), frozenset(keys | words | ends)
    if "certificate" in row:
        asked = {f"{key} {row['certificate'].get(key)}" for key in CLAIM}
        return frozenset(asked), frozenset(words)
    document = row["document"]
    asked = {key for key in ASKED if isinstance(document, dict) and document.get(key)}
    if "constraints" in asked:  # their Lagrangian is given, with functions or without
        asked -= {"lagrangian", "functions", "motion"}
    return frozenset(asked), frozenset(keys | words)


def is_cousin(one: Statement, other: Statement) -> bool:
    """Whether the first asks what the other asks, and states all of it."""
    return one[0] == other[0] and one[1] >= other[1]
