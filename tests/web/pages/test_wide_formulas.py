"""A formula that is too wide for a line of the page ends lines between its terms."""

from __future__ import annotations

import html
import re

import pytest

from inverse_service.reading.names import Names
from inverse_service.web.pages import typesetting

NAMES = Names(("x", "alpha", "beta"), ("m_0", "m_1", "m_2", "l_1", "l_2", "g"))
WIDE = "(m_0*m_1 + m_1*(m_1 + m_2)*sin(alpha)^2 + m_0*m_2*sin(alpha - beta)^2)"
ABOVE = "(2*m_1*(m_1 + m_2)*l_1*sin(alpha)*alpha'^2 + 9.81*m_1*(m_1 + m_2)*sin(2*alpha))"
MINUS = "\u2212"
LONGEST = 60  # characters of a piece, which a phone has room for


def pieces(text: str) -> list[str]:
    """What is between the places at which a line may end, without its tags."""
    found = re.findall(r"<math>.*?</math>", str(typesetting.formula(text, NAMES)))
    return [html.unescape(re.sub(r"<[^>]*>", "", one)) for one in found]


@pytest.mark.parametrize("below", [WIDE, f"(2*{WIDE})", f"(2*l_2*{WIDE})", f"(l_2*{WIDE}^2)"])
@pytest.mark.parametrize("above", [ABOVE, f"-{ABOVE}", f"3*{ABOVE}", "g*alpha'"])
def test_a_wide_divisor_is_written_term_by_term_behind_a_slash(above: str, below: str) -> None:
    text = f"x'' = {above}/{below}"
    found = pieces(text)
    whole = "".join(found)
    assert len(found) > 3
    assert max(map(len, found)) < LONGEST
    assert "<mfrac>" not in str(typesetting.formula(text, NAMES))
    over, under = whole.split("/")
    for side in (over, under):
        assert side.count("(") == side.count(")")
    assert ("9.81" in over) == ("9.81" in above)
    assert (MINUS in over) == ("-" in above)
    assert "sin" in under
    assert MINUS in under


def test_a_narrow_divisor_stays_below_the_fraction_line() -> None:
    assert "<mfrac>" in str(typesetting.formula(f"x'' = {ABOVE}/(m_0 + m_1)", NAMES))
    assert "<mfrac>" in str(typesetting.formula("alpha'' = -g*sin(alpha)/(2*l_1)", NAMES))
