"""The manual under /learn and the about page are complete, linked with each other, and free of raw
markup.
"""

from __future__ import annotations

import re

import httpx
import pytest

from inverse_service.web.pages.library import PAGES

NAMES = [name for name, _ in PAGES]


@pytest.mark.parametrize("name", NAMES)
def test_each_page_of_the_manual_is_served_and_its_links_lead_somewhere(
    service: str, name: str
) -> None:
    answer = httpx.get(f"{service}/learn/{name}", timeout=60)
    assert answer.status_code == 200
    article = answer.text.partition('<article class="manual">')[2].partition("</article>")[0]
    assert article.count("<h2>") > 1
    assert "<script" not in article
    assert "$" not in article
    targets = {link.partition("#")[0] for link in re.findall(r'href="([^"]+)"', article)}
    local = {target for target in targets if target and not target.startswith("http")}
    assert local <= {"/learn", "/docs", *(f"/learn/{other}" for other in NAMES)}


def test_a_page_that_is_not_there_is_not_found(service: str) -> None:
    assert httpx.get(f"{service}/learn/nope", timeout=60).status_code == 404


def test_the_about_page_names_the_paper_the_version_and_how_to_cite(service: str) -> None:
    text = httpx.get(f"{service}/about", timeout=60).text
    for words in (
        "Hamiltonization and geometric integration",
        "Mestdag",
        "@software",
        "@misc{mestdag",
        "MIT license",
    ):
        assert words in text
    assert 'href="/about"' in httpx.get(service, timeout=60).text
