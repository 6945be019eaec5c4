"""docs/records/: each table is measured again by one command, or its command stands beside it."""

import itertools
import re
from pathlib import Path

import pytest

from benchmarks import records

ROOT = Path(__file__).parents[2]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
RECIPES = "\n".join(
    re.findall(
        r"^(?:records|bench-service|paper|soundness):[^\n]*\n((?:\t[^\n]*\n)+)", MAKEFILE, re.M
    )
)
# Pages, or all named places of a page, that a command of `make records` writes.
WRITTEN = {
    "hard-cases.md": "benchmarks hard-cases --long",
    "kinds.md": "tests.docs.test_known_kinds",
    "nearest.md": "benchmarks.nearest --write",
    "paper.md": "paper --output docs",
    "simulation-peers.md": "benchmarks peers",
    "simulation-size.md": "benchmarks size --write",
    "soundness.md": "tests.soundness --output",
}
NAMED = re.compile(
    r"<!-- (?!run: )(?P<name>[^\n]*?) -->\n.*?<!-- end of (?P=name) -->\n", re.DOTALL
)
# The other tables, by the beginning of their heads.
BESIDE = {
    "families.md": {"| motion | sets with a Lagrangian |": "inverse-service solve --family"},
    "pages.md": {
        "| page | wide | narrow |": "make screens",
    },
    "quality.md": {
        "| Sample, drawn | At commit |": "by hand, and python -m tests.mutation.drawn",
        "| Added | Files |": 'python -m pytest -m "slow or nightly" tests/docs/test_recipes.py',
    },
    "reliability.md": {
        "| what is sent | longest `/livez` |": "pytest tests/attacks",
        "| weight | load average |": "python -m benchmarks.ready --weight 500",
        "| | worker processes |": "python -m benchmarks cluster, by process",
        "| kill -9 during a batch": "tests/cluster/test_kills.py",
        "| | ours: uvicorn with": "other servers, by hand",
        "| store, document | callers |": "python -m benchmarks.acceptance",
        "| callers | before | now |": "python -m benchmarks.acceptance",
    },
    "review-checklist.md": {"| item | command or file |": "a person"},
    "search.md": {
        "| left out | systems | what is lost |": "parts that are no rows, by hand",
        "| equations | number | median, s |": "two thirds of a collection",
        "| equation | why there is no closed form |": "worked out by hand",
    },
}
PAGES = sorted(records.PAGES.glob("*.md"))


def heads(text: str) -> list[str]:
    """The first lines of the tables of a page."""
    lines = ["", *text.splitlines()]
    return [
        line
        for before, line in itertools.pairwise(lines)
        if line.startswith("|") and not before.startswith("|")
    ]


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_each_table_is_measured_again_by_a_command_or_has_it_beside_it(page: Path) -> None:
    text = records.PLACE.sub("", page.read_text(encoding="utf-8"))
    if page.name in WRITTEN:
        assert WRITTEN[page.name] in RECIPES
        return
    rest = heads(NAMED.sub("", text))
    beside = BESIDE.get(page.name, {})
    assert [head for head in rest if not head.startswith(tuple(beside))] == []
    assert [head for head in beside if not any(one.startswith(head) for one in rest)] == []


def test_make_records_runs_the_commands_of_all_places() -> None:
    assert "python -m benchmarks.records\n" in RECIPES
    assert sum(len(list(records.places(page))) for page in PAGES) >= 20


def test_a_command_replaces_its_table_alone(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    command = "python -c \"print('# Page'); print('by whom'); print('## Part'); print('| new |')\""
    page.write_text(
        f"before\n<!-- run: {command} -->\n| old |\n<!-- end of run -->\n"
        "<!-- run: other -->\n| other |\n<!-- end of run -->\nafter\n"
    )
    records.measured(page, command)
    first, second = records.places(page)
    assert first["text"].endswith("\n\n| new |\n")
    assert "commit" in first["text"]
    assert second["text"] == "| other |\n"
    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("\nafter\n")


def test_a_command_that_fails_leaves_the_table_as_it_is(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    text = "<!-- run: python -c raise -->\n| old |\n<!-- end of run -->\n"
    page.write_text(text)
    assert records.main([str(page)]) == 1
    assert page.read_text() == text


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("no command at all\n", []),
        ("<!-- run: python -c 1 -->\n<!-- end of run -->\n", ["--only", "another"]),
    ],
)
def test_a_page_that_is_named_has_a_command_that_is_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, options: list[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    assert records.main([str(page), *options]) == 1
    assert "page.md: no command" in capsys.readouterr().err
    assert page.read_text() == text
