"""A result holds the answer once, and not the page that shows it."""

from __future__ import annotations

import json
from typing import Any

import pytest

import inverse_service

KNIFE_EDGE = {
    "coordinates": ["x", "y", "phi"],
    "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
    "constraints": ["y'*cos(phi) - x'*sin(phi)"],
}


@pytest.mark.parametrize(
    ("document", "most"),
    [({"coordinates": ["x"], "equations": {"x": "-x - c*x'"}, "parameters": ["c"]}, 6_000), (KNIFE_EDGE, 30_000)],
)
def test_an_answer_is_short(document: dict[str, Any], most: int) -> None:
    result = inverse_service.solve(document)
    assert result["lagrangian"]["text"]
    assert len(json.dumps(dict(result), ensure_ascii=False, separators=(",", ":")).encode()) <= most
    assert not [step for step in (result["with_time"] or {}).get("details", []) if step in result["details"]]
    for step in result["explanation"]:
        assert step["text"]
    for step in result["details"]:
        assert len({"text", "parts"} & set(step)) == 1
