"""The messages for a waiting visitor, and the texts of the form."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from markupsafe import Markup

from inverse_service.service.documents import documents
from inverse_service.web.pages.forms import understood
from inverse_service.web.pages.kept import Kept
from inverse_service.web.pages.rendering import page
from inverse_service.web.pages.results import asked_of


@pytest.mark.parametrize(
    ("document", "lines"),
    [
        ({"equations": "x'' = -x"}, ["x'' = -x"]),
        ({"name": "two", "equations": {"x": "-y", "y": "x"}}, ["two", "x'' = -y", "y'' = x"]),
        ({"equations": ["x'' = 0"]}, ["x'' = 0"]),
        ({"lagrangian": "x'^2/2", "constraints": ["x'"]}, ["x'^2/2", "x'"]),
        ({"system": {"catalogue": "knife-edge"}, "step": 1}, ["knife-edge"]),
        ({"system": {"document": {"equations": {"x": "1"}}}}, []),
        ([], []),
        ("text", []),
        ({"equations": 3}, ["3"]),
    ],
)
def test_the_question_is_on_the_page_of_its_job(document: Any, lines: list[str]) -> None:
    assert asked_of(document) == lines


def test_the_page_of_work_tells_since_when_it_waits() -> None:
    job = {"id": "a", "status": "running", "progress": None, "created": 0.0}
    text = bytes(
        page("working.html", 200, active="", job=job, asked=["x'' = <b>"], waited=17).body
    ).decode()
    assert 'data-seconds="17"' in text
    assert "x&#39;&#39; = &lt;b&gt;" in text


def test_the_echo_of_a_constrained_system_is_said_to_be_the_motion() -> None:
    """The equations of d'Alembert are the same for every associated system."""
    document = {
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["z' - y*x'"],
        "associated": "third",
    }
    headings = [heading for heading, _ in understood(documents.parse_document(document), {}).groups]
    assert headings == ["Lagrangian", "Constraints", "Motion"]


def test_a_part_of_a_page_is_made_once_and_the_oldest_goes_first() -> None:
    parts, made = Kept(2), list[str]()

    async def ask(key: str) -> Markup | None:
        async def make() -> Markup:
            made.append(key)
            await asyncio.sleep(0)
            return Markup(key)

        return await parts.of(key, make, 10)

    async def visit() -> None:
        assert await asyncio.gather(ask("a"), ask("a")) == [Markup("a")] * 2
        for key in "abcb":
            assert await ask(key) == Markup(key)

    asyncio.run(visit())
    assert made == ["a", "b", "c"]
    assert [*parts.made] == ["b", "c"]
