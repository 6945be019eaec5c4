"""What reading costs grows like the text: counted in calls, which do not depend on the machine."""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

import pytest

from inverse_service.reading import names as nm, reader

# What a text repeats: words that join a condition, ends of lines, names.
REPEATED = ("for ", "if ", "where ", "\n", "a ", ">>> x\n")


def _calls(text: str) -> int:
    """Calls of functions that reading the text makes."""
    count = 0

    def noted(frame: FrameType, event: str, _: Any) -> None:
        nonlocal count
        count += event == "call"

    before = sys.getprofile()
    sys.setprofile(noted)
    try:
        reader.read_tokens(text, nm.Names(guesses=True))
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize("repeated", REPEATED)
def test_a_text_twice_as_long_costs_twice_as_much(repeated: str) -> None:
    _calls("x'' = -x " + repeated)  # what is made once
    short, long = (_calls("x'' = -x " + repeated * n) for n in (300, 600))
    assert long < 2.2 * short
