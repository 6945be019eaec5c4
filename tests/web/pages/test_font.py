"""The mathematics font of the pages has every character that our MathML writes, and the table that
stretches signs.
"""

from __future__ import annotations

import base64
import hashlib
import html
import re
from importlib import resources

import pytest
from fontTools.ttLib import TTFont

from inverse_service import catalogue
from inverse_service.reading.names import Names
from inverse_service.service.documents import stated
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.rendering import address, asset, page
from tests.values import slow

STATIC = resources.files("inverse_service.web") / "static"
FONT = TTFont(str(STATIC / "stix-two-math.woff2"))
EVERYTHING = "sqrt(x^2)/2*theta''*sin(y') - diff(A(x), x) + exp(-k*t)*atan(q_1)/x^3 != 0"


def characters(mathml: str) -> set[str]:
    return set(html.unescape(re.sub(r"<[^>]*>", "", mathml)))


@pytest.mark.parametrize("every", [5, slow(1)])
def test_every_character_of_our_formulas_is_in_the_font(every: int) -> None:
    letters = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau phi chi psi omega"
    names = Names(
        ("x", "y", "theta", "q_1"),
        ("k", *(w for w in letters.split() if w != "theta")),
        {"A": ("x",)},
    )
    shown = [
        typesetting.formula(EVERYTHING, names),
        *(typesetting.formula(word, names) for word in letters.split()),
    ]
    for name in list(catalogue.names())[::every]:
        document = catalogue.document(name)
        if isinstance(document.get("equations"), dict):
            named = stated.names_of(
                {"parameters": list(document.get("parameters") or ()), **document}
            )
            shown += [typesetting.formula(text, named) for text in document["equations"].values()]
    used = set().union(*(characters(str(one)) for one in shown))
    assert {
        f"{ord(c):04X}" for c in used if c.strip() and ord(c) not in FONT.getBestCmap()
    } == set()


def test_the_font_can_stretch_brackets_and_roots_and_carries_its_licence() -> None:
    variants = FONT["MATH"].table.MathVariants.VertGlyphCoverage.glyphs
    assert {FONT.getBestCmap()[ord(sign)] for sign in "()\u221a"} <= set(variants)
    assert "SIL OPEN FONT LICENSE" in (STATIC / "stix-two-math.LICENSE").read_text()


def test_the_policy_names_the_style_sheet_of_the_page() -> None:
    """A browser applies it only if the digest of the text between the tags is in the policy."""
    found = page("missing.html", 404, active="", title="Nothing", detail="here")
    text = bytes(found.body).decode()
    inside = text.partition("<style>")[2].partition("</style>")[0]
    digest = base64.b64encode(hashlib.sha256(inside.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in found.headers["content-security-policy"]
    assert address("stix-two-math.woff2") in inside
    assert f'<script src="{address("formulas.js")}"></script>' in text
    (font,) = re.findall(r'atob\("([^"]*)"\)', asset("formulas.js")[0].decode())
    assert base64.b64decode(font) == (STATIC / "stix-two-math.woff2").read_bytes()
