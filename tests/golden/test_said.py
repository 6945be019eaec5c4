"""What is said of texts and certificates is what was said."""

from __future__ import annotations

import json

import pytest

from tests.golden import said

KNOWN = json.loads(said.STORED.read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", said.KINDS)
def test_each_answer_is_what_it_was(kind: str) -> None:
    found = said.said(kind)
    known, now = KNOWN[kind], said.digests(found)
    changed = [name for name in now if now[name] != known.get(name)]
    assert not changed, "\n".join(f"{name}: {found[name][:1000]}" for name in changed[:10])
    assert now.keys() == known.keys()
