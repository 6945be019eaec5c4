"""The pages of the manual are listed under their own headings."""

from __future__ import annotations

from pathlib import Path

from inverse_service.web.pages import library

MANUAL = Path(library.__file__).parents[1] / "manual"


def test_a_page_is_listed_by_its_heading() -> None:
    headings = {
        page.stem: page.read_text(encoding="utf-8").partition("\n")[0]
        for page in MANUAL.glob("*.md")
    }
    assert headings == {name: f"# {title}" for name, title in library.PAGES}
