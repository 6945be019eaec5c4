"""The report on the paper marks statements that the computation contradicts, and the pages show the
findings.
"""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from inverse_service.expressions.tree import add, multiply, number
from paper import errata, pages, paper_systems, propositions
from paper.paper import sections
from paper.paper_systems import Member, constants, images, lagrangian, member
from paper.statement import Figure, Section, Statement, Table

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def particle() -> Member:
    return member("nonholonomic-particle")


@pytest.mark.slow
def test_the_statements_of_section_two_agree_for_the_particle(particle: Member) -> None:
    found = [make([particle]) for make in propositions.STATEMENTS]
    assert [statement.finding for statement in found] == ["agrees"] * len(found)


@pytest.mark.slow
def test_a_wrong_formula_differs(particle: Member, monkeypatch: pytest.MonkeyPatch) -> None:
    def doubled(system: Member, form: int) -> object:
        return add(
            lagrangian(system, form),
            multiply(number(2), lagrangian(system, form), lagrangian(system, form)),
        )

    monkeypatch.setattr(propositions, "lagrangian", doubled)
    assert propositions.second_has_lagrangians([particle]).finding == "differs"
    assert propositions.hamiltonians([particle]).finding == "differs"


@pytest.mark.slow
def test_wrong_motion_and_wrong_associated_systems_differ(particle: Member) -> None:
    other = replace(particle, slopes=tuple(multiply(number(2), slope) for slope in particle.slopes))
    assert propositions.equations_of_motion([other]).finding == "differs"
    assert propositions.associated_systems([other]).finding == "differs"


@pytest.mark.slow
def test_a_verdict_without_a_check_differs_and_is_printed(particle: Member) -> None:
    associated = [
        {**one, "verdict": "undetermined", "checked": None} for one in particle.result["associated"]
    ]
    other = replace(particle, result={**particle.result, "associated": associated})
    found = propositions.first_has_no_lagrangian([other])
    assert found.finding == "differs"
    assert "| not checked |" in pages.markdown([Section("2", (found,))], "", "")


def test_the_images_of_the_constraints_are_not_zero_by_themselves(particle: Member) -> None:
    names = [*constants(particle, 1), *(f"p_{name}" for name in particle.coordinates)]
    assert not particle.vanish(images(particle, 1), names)


def test_the_errata_are_seen() -> None:
    found = errata.section_errata(lambda _: None)
    assert {statement.finding for statement in found.statements} == {"erratum"}
    assert len(found.statements) == 5
    # The page is what the command writes; its head counts all sections.
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8").splitlines()
    others = {*pages.side_by_side([found]).splitlines()} - {*page, f"## {found.heading}"}
    assert {line.split(" | ")[0] for line in others} <= {f"| {name}" for name in pages.MEANING}


def test_every_classical_system_is_in_the_catalogue() -> None:
    assert len(paper_systems.CLASSICAL) == 5


SAMPLE = Section(
    "A <section>",
    (
        Statement(
            "key", "where", "L~ = x'^2*y <claim>", "differs", "a|b_c", "file.py",
            (Table(("one", "two"), (("x*y", "a|b"),)),), (Figure("picture", "a caption", "what is seen"),),
        ),
    ),
)  # fmt: skip


def test_the_markdown_shows_findings_tables_and_figures() -> None:
    text = pages.markdown([SAMPLE], "paper", "machine")
    assert "### where: differs" in text
    assert "| `x*y` | a\\|b |" in text
    assert "![what is seen](paper/picture.svg)" in text
    assert "| differs | 1 |" in text
    assert "&lt;claim>" in text


def test_the_side_by_side_page_has_a_row_for_each_statement() -> None:
    text = pages.side_by_side([SAMPLE])
    assert r"| where | L~ = x'^2\*y &lt;claim> | **differs**: a\|b\_c |" in text


def test_the_html_is_well_formed_and_escapes_formulas() -> None:
    class Balance(HTMLParser):
        def __init__(self) -> None:
            super().__init__()
            self.open: list[str] = []

        def handle_starttag(self, tag: str, attrs: object) -> None:
            if tag not in ("meta", "img"):
                self.open.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert self.open.pop() == tag

    text = pages.page([SAMPLE], "paper", "machine")
    parser = Balance()
    parser.feed(text)
    assert parser.open == []
    assert "<claim>" not in text
    assert 'src="paper/picture.svg"' in text
    assert "http" not in text


@pytest.mark.slow
def test_no_statement_of_the_paper_differs(tmp_path: Path) -> None:
    found = sections(tmp_path, lambda _: None)
    number_of = pages.counts(found)
    assert number_of["differs"] == 0
    assert sum(number_of.values()) >= 25
    for section in found:
        for statement in section.statements:
            assert statement.key in pages.HOW
            for figure in statement.figures:
                assert (tmp_path / f"{figure.name}.svg").is_file()
