"""What is printed of small documents is what was printed."""

from __future__ import annotations

import json

import pytest

from tests.doors.rows import systems
from tests.doors.test_systems import assert_as_known
from tests.golden import printed

ROWS = {row["id"].replace(" ", "-"): row for row in systems()}
KNOWN = json.loads(printed.STORED.read_text(encoding="utf-8"))


def test_every_document_has_its_digests() -> None:
    assert [*KNOWN] == [*printed.documents(), *printed.JUDGED]


@pytest.mark.parametrize("name", printed.documents())
def test_each_form_of_an_answer_is_what_it_was(name: str) -> None:
    """That of a row of the corpus is also what is known."""
    answer = printed.answered(name)
    if name in printed.ROWS:
        assert_as_known(ROWS[name], answer)
    assert_same(name, printed.forms(name, answer))


@pytest.mark.parametrize("name", printed.JUDGED)
def test_what_is_said_of_a_lagrangian_is_what_it_was(name: str) -> None:
    assert_same(name, printed.judged(name))


def assert_same(name: str, found: dict[str, str]) -> None:
    now = printed.digests(found)
    assert now.keys() == KNOWN[name].keys()
    changed = [form for form in now if now[form] != KNOWN[name][form]]
    assert not changed, "\n".join(f"{form}: {found[form][:1000]}" for form in changed)
