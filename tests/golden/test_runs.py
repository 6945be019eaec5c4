"""Short runs have the results that they had."""

from __future__ import annotations

import json

import pytest

from tests.golden import runs

KNOWN = json.loads(runs.STORED.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", runs.SCENES)
def test_a_run_has_the_result_that_it_had(name: str) -> None:
    found = json.loads(json.dumps(runs.found(name)))
    assert found.keys() == KNOWN[name].keys()
    changed = {
        place: (KNOWN[name][place], value)
        for place, value in found.items()
        if not is_same(value, KNOWN[name][place])
    }
    assert changed == {}


def is_same(one: object, other: object) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return one == pytest.approx(other, rel=1e-6, abs=1e-8, nan_ok=True)
    return one == other
