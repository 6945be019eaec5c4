"""A stored answer whose certificate has an older format is shown without the badge, with the advice to ask again."""

from __future__ import annotations

import pytest

from inverse_service import solve
from inverse_service.web.pages.shown_results import answer_of, proof_of


@pytest.mark.slow
@pytest.mark.parametrize(("form", "shown"), [("1", "old"), ("2", "valid")])
def test_an_older_proof_has_no_badge(form: str, shown: str) -> None:
    result = solve({"equations": "x'' = -x"})
    result["certificate"]["format"] = f"inverse-service/certificate/{form}"
    assert answer_of(result, result["question"], result).checked == shown
    assert proof_of({"checked": "valid", "certificate": None}) == "valid"
