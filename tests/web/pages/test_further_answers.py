"""A page shows what holds instead of a no, with its proof checked."""

from __future__ import annotations

import httpx

DAMPED = {
    "equations": "x'' = -2*x + y - 2*x' + y'; y'' = x - 2*y + x' - 3*y'",
    "kinds": ["natural"],
}


def test_a_damped_chain_leaves_with_l_and_d(service: str) -> None:
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json=DAMPED, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        result = found.json()
        assert result["verdict"] == "not_variational"
        assert result["instead"]["kind"] == "rayleigh"
        page = client.get(f"/results/{address}").text
    assert "Instead: With friction" in page
    assert "<mi>D</mi>" in page
    assert "of the kind \u201cnatural\u201d: no" in page
