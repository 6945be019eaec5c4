"""The pages are true: the tests run or validate every fenced block of README and docs."""

from __future__ import annotations

import doctest
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

import inverse_service.sympy
from api_schemas.scene import SceneDocument
from benchmarks.measured import conditions
from inverse_service import catalogue
from inverse_service.service.documents.documents import look
from inverse_service.service.documents.plain_data import read_json
from tests.docs.blocks import (
    ADDRESS,
    DOCUMENTS,
    LANGUAGES,
    MARKS,
    PAGES,
    PROGRAMS,
    ROOT,
    Block,
    blocks,
    name,
    pattern,
    programs,
    run_page,
)

# The number of programs of a page that are not run, and why; all other programs run.
NOT_RUN = {
    "README.md": (3, "one does not end, one is these tests, one runs overnight"),
    "CONTRIBUTING.md": (2, "these are the tests themselves, and hooks are installed"),
    "docs/how-to/deploy.md": (
        8,
        "tests/deploy/test_operating.py runs them in a Debian of its own, but for Docker",
    ),
    "docs/how-to/install.md": (1, "downloads and installs"),
    "docs/how-to/operate.md": (1, "tests/store/test_backup.py runs it"),
    "docs/how-to/scale.md": (
        4,
        "no cluster, SLURM or PostgreSQL here; tests/cluster and tests/store have theirs",
    ),
    "docs/records/benchmarks.md": (1, "ten minutes"),
    "docs/records/reliability.md": (1, "these are the tests themselves"),
    "docs/tutorials/rest.md": (1, "no Julia where the tests run"),
    "docs/reference/open-questions.md": (1, "minutes"),
}
# Blocks of plain text: diagrams, and blocks that other tests compare.
TEXTS = {
    "docs/explanation/architecture.md": (3, "pictures of the house, the way of a document"),
    "docs/how-to/constrained-systems.md": (
        1,
        "compared by tests/service/test_nonholonomic_page.py",
    ),
    "docs/how-to/teach.md": (2, "what is pasted into a page, and into a Moodle"),
    "docs/simulation.md": (1, "the times of one machine"),
}
COMMAND = re.compile(
    r"^(?:\$ |    )(?:[A-Z_]+=\S+ )?(?:\.venv/|inverse-service |python |pip |make |curl |dask |docker |git )",
    re.M,
)
IDS = [name(page) for page in PAGES]
ALL = [block for page in PAGES for block in blocks(page)]
QUICK = [page for page in PAGES if programs(page, with_slow=False)]
LONG = [
    page
    for page in PAGES
    if len(programs(page, with_slow=True)) > len(programs(page, with_slow=False))
]
BASE = catalogue.document("vertically-rolling-disk")


def run(page: Path, folder: Path, request: pytest.FixtureRequest, with_slow: bool) -> None:
    """Run a page, with a service if the page calls one."""
    speaks = any(ADDRESS in block.text for block, _ in programs(page, with_slow))
    if shutil.which("bash") is None or (speaks and shutil.which("curl") is None):
        pytest.skip("bash and curl are needed")
    address = request.getfixturevalue("service") if speaks else ADDRESS
    assert run_page(page, folder, address, with_slow) == []


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page, id=name(page), marks=() if page.name == "README.md" else pytest.mark.slow
        )
        for page in QUICK
    ],
)
def test_every_program_does_what_the_page_says(
    page: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    run(page, tmp_path, request, with_slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", LONG, ids=name)
def test_the_long_programs_too(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    run(page, tmp_path, request, with_slow=True)


@pytest.mark.parametrize(
    "block", [one for one in ALL if one.language == "diff"], ids=lambda block: block.place
)
def test_every_change_that_is_shown_applies(block: Block) -> None:
    command = ["git", "apply", "--check", "-C1", "-"]
    done = subprocess.run(
        command, cwd=ROOT, input=block.text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "module", [inverse_service, inverse_service.sympy], ids=lambda module: module.__name__
)
def test_examples_of_the_reference_run(module: ModuleType) -> None:
    assert doctest.testmod(module) == (0, 4)


def test_every_toml_is_read() -> None:
    assert all(tomllib.loads(block.text) for block in ALL if block.language == "toml")


def _written(folder: Path) -> list[Path]:
    """Write each Python block as a file, because each is a separate program."""
    written = []
    for block in ALL:
        if block.language == "python":
            page = name(block.page).replace("/", "_").removesuffix(".md").replace("-", "_")
            written.append(folder / f"{page}_{block.line}.py")
            written[-1].write_text(block.text, encoding="utf-8")
    assert len(written) > 10
    return written


@pytest.mark.slow
def test_python_in_the_pages_passes_mypy_strict(tmp_path: Path) -> None:
    files = map(str, _written(tmp_path))
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--cache-dir",
        str(tmp_path / "cache"),
        *files,
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.skipif(
    not find_spec("pyright") or not shutil.which("npm"), reason="pyright and npm are not installed"
)
def test_python_in_the_pages_passes_pyright_strict(tmp_path: Path) -> None:
    """Missing types in SymPy itself are ignored."""
    of_sympy = ("reportMissingTypeStubs", "reportUnknownVariableType", "reportUnknownMemberType")
    for file in _written(tmp_path):
        text = file.read_text(encoding="utf-8")
        rules = ["strict", *(f"{rule}=false" for rule in of_sympy if "from sympy" in text)]
        file.write_text("".join(f"# pyright: {rule}\n" for rule in rules) + text, encoding="utf-8")
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_a_measurement_names_its_commit() -> None:
    head = subprocess.run(
        ["git", "rev-parse", "--short=8", "HEAD"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert conditions().startswith(
        f"commit {head.stdout.strip()}" if head.returncode == 0 else "no commit"
    )


def test_the_pages_have_programs() -> None:
    assert sum(len(programs(page, with_slow=True)) for page in PAGES) >= 35


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_no_block_is_left_out_in_silence(page: Path) -> None:
    for block in blocks(page):
        assert block.language in LANGUAGES, f"{block.place}: no such language"
        assert block.language in DOCUMENTS or block.mark in ("", *MARKS), (
            f"{block.place}: no such mark"
        )
    assert (
        sum(block.mark == "not-run" for block in blocks(page))
        == NOT_RUN.get(name(page), (0, ""))[0]
    )
    assert (
        sum(block.language == "text" for block in blocks(page)) == TEXTS.get(name(page), (0, ""))[0]
    )


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_output_belongs_to_a_program(page: Path) -> None:
    before = ""
    for block in blocks(page):
        assert block.language != "output" or before in PROGRAMS, block.place
        before = block.language


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_commands_stand_in_blocks_that_are_run(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for block in blocks(page):
        if block.language != "text":
            text = text.replace(f"{block.text}```", "```")
    assert COMMAND.findall(text) == []


@pytest.mark.parametrize(
    "block", [one for one in ALL if one.language in DOCUMENTS], ids=lambda block: block.place
)
def test_every_document_is_accepted(block: Block) -> None:
    if block.language == "yaml":
        assert list(yaml.safe_load_all(block.text))
    elif block.mark.endswith(".ndjson"):
        for line in block.text.splitlines():
            accept(
                {key: value for key, value in read_json(line).items() if key != "id"}
            )  # a line of a batch
    else:
        accept(read_json(block.text))


def accept(document: Any) -> None:
    """Raise unless this is a System, Nonholonomic, or Scene document, or some keys of a
    Nonholonomic one.
    """
    if "methods" in document or "step" in document:
        SceneDocument.model_validate(document)
    elif {"equations", "lagrangian"} & set(document):
        look(document)
    else:
        look({**BASE, **document})


def test_the_comparison_finds_what_is_wrong() -> None:
    assert pattern("a\n...\nb c...\n").fullmatch("a\nx\ny\nb cd\n")
    assert pattern("a\n  ...\nb\n").fullmatch("a\nb\n")
    assert not pattern("a\n...\nb\n").fullmatch("a\nx\n")
    assert not pattern("a\n").fullmatch("a\nb\n")


def test_a_page_that_is_wrong_is_found(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "made-up.md"
    own = (
        Block(page, 1, "sh", "", "echo 4\n"), Block(page, 2, "output", "", "5\n"),
        Block(page, 3, "sh", "", "false\n"), Block(page, 4, "sh", "", "echo never\n"),
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.docs.blocks.blocks", lambda _: own)
        wrong, ended = run_page(page, tmp_path, ADDRESS, with_slow=False)
    assert wrong.startswith("docs/made-up.md:1 printed\n4")
    assert ended.startswith("docs/made-up.md:3 ended with 1")
