"""The checker gives the known verdict for true and forged certificates of the corpus."""

from __future__ import annotations

import pytest

from tests.certificate.documents import CLAIMS
from tests.certificate.judged import judged
from tests.doors.rows import Row, marks


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=name, marks=marks(row)) for name, row in CLAIMS.items()]
)
def test_a_claim_is_judged_as_is_known(row: Row) -> None:
    for seed in row["seeds"]:
        found = judged(row["certificate"], seed)
        assert found.verdict in row["verdict"], found.reasons
        assert found.verdict != "valid" or (found.cell is not None and not found.cell.unknown)
