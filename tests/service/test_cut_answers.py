"""Answers cut at a time limit contain everything known at half of it, and only proven or undecided
parts.
"""

from __future__ import annotations

import time
from typing import Any

import pytest

import inverse_service
from tests.doors.rows import rows

ALL = 120.0
MOTIONS = [row for row in rows("constrained") if "constraints" in row["document"]][-20:]
SYSTEMS = [*(row for row in rows("books") if row["id"].endswith("-added") and "lagrangian" in row)][
    :10
] + [row for row in rows("literature") if len(row["document"]["equations"]) > 1][:10]


@pytest.mark.nightly
@pytest.mark.parametrize("row", [*MOTIONS, *SYSTEMS], ids=lambda row: row["id"])
def test_a_limit_takes_no_part_that_was_known_at_half_of_it(row: dict[str, Any]) -> None:
    """Limits are measured here in processor seconds of this thread."""
    known: dict[str, float] = {}
    began = time.thread_time()

    def note(part: str, _: object) -> None:
        known.setdefault(part, time.thread_time() - began)

    inverse_service.solve(row["document"], time_limit=ALL, progress=note)
    for limit in (1.0, 3.0, 10.0, 60.0):
        cut = inverse_service.solve(row["document"], time_limit=limit)
        missing = {one["part"] for one in cut["incomplete"]}
        assert not {part for part, moment in known.items() if moment < limit / 2} & missing, limit
        assert inverse_service.check(cut)["verdict"] in ("valid", "incomplete"), limit
