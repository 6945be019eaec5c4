"""Links between the pages resolve, and no page names a machine or a registry."""

from __future__ import annotations

import itertools
import re
import tomllib
from pathlib import Path

import pytest
import yaml

import inverse_service
from inverse_service.cli.command_line import application, load_commands
from tests.docs.blocks import PAGES, ROOT, name

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"`[^`\n]*`")
FENCED = re.compile(r"^```.*\n(?:.*\n)*?```$", re.MULTILINE)
MACHINE = re.compile(r"(?:/home/|/root/|/Users/|/work/|/mnt/|C:\\)")
REGISTRY = re.compile(
    r"pypi\.org|pythonhosted\.org|npmjs\.|docker\.io|ghcr\.io|quay\.io|crates\.io|anaconda\.org|artifactory|nexus\d?\.",
    re.IGNORECASE,
)
NAMED = re.compile(r"`((?:tests|docs|inverse_service|api_schemas)/[\w./-]+)`")
TEXTS = [*PAGES, *(ROOT / name for name in ("Makefile", "Dockerfile", "pyproject.toml", "constraints.txt",
                                            "CITATION.cff", "LICENSE"))]  # fmt: skip


def anchors(page: Path) -> set[str]:
    """The anchors of the headings of a page, as Markdown renderers make them."""
    text = CODE.sub("", FENCED.sub("", page.read_text(encoding="utf-8")))
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_leads_somewhere(page: Path) -> None:
    for target in LINK.findall(CODE.sub("", FENCED.sub("", page.read_text(encoding="utf-8")))):
        if target.startswith(("https://", "http://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), f"{page.name}: {target}"
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_file_that_is_named_is_there(page: Path) -> None:
    names = NAMED.findall(page.read_text(encoding="utf-8"))
    assert [name for name in names if not (ROOT / name).exists()] == []


def test_every_command_is_on_its_page() -> None:
    page = (ROOT / "docs/reference/cli.md").read_text(encoding="utf-8")
    load_commands()
    for command in application.registered_commands:
        name = command.name or command.callback.__name__
        assert re.search(rf"^\| .*`{name}[ `].* \|$", page, re.MULTILINE), name


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.name)
def test_no_machine_and_no_registry_is_named(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert MACHINE.findall(text) == []
    assert REGISTRY.findall(text) == []


def test_the_names_of_machines_and_registries_are_found() -> None:
    assert MACHINE.search("see /home/ada/x")
    assert REGISTRY.search("--index-url https://pypi.org/simple")
    assert not MACHINE.search("--tmpfs /tmp -v jobs:/var/lib")


def declared() -> set[str]:
    """The packages of pyproject.toml, without the project itself."""
    whole = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = whole["project"]["optional-dependencies"].values()
    lines = [
        *whole["build-system"]["requires"],
        *whole["project"]["dependencies"],
        *itertools.chain(*extras),
    ]
    return {re.split(r"[\[<>=~! ]", line)[0] for line in lines} - {"inverse-service"}


def test_every_dependency_has_its_reason() -> None:
    page = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?:`\w+` \| )?([\w\-, ]+) \|", page, re.MULTILINE)
    told = {name.strip() for row in rows for name in row.split(",")} - {"package", "extra", "---"}
    assert told == {"psycopg" if name.startswith("psycopg") else name for name in declared()}


def test_citation_and_licence_belong_to_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["version"] == inverse_service.__version__
    assert citation["license"] == project["license"] == "MIT"
    assert "MIT License" in (ROOT / project["license-files"][0]).read_text(encoding="utf-8")
    assert f"## {inverse_service.__version__}" in (ROOT / "CHANGELOG.md").read_text(
        encoding="utf-8"
    )
