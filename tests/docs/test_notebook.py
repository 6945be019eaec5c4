"""The notebooks of the manual run in a new kernel and print their stored output."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest

from tests.docs.notebooks import NOTEBOOKS, execute, texts

BY_NAME = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


@BY_NAME
def test_the_notebook_is_valid_and_executed(path: Path) -> None:
    found = nbformat.read(path, as_version=4)
    nbformat.validate(found)
    code = [cell for cell in found.cells if cell.cell_type == "code"]
    assert len(code) > 3
    assert all(
        cell["outputs"] for cell in code if not cell.source.startswith(("import", "t = ", "def "))
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@BY_NAME
def test_every_cell_prints_what_the_notebook_shows(path: Path) -> None:
    shown = nbformat.read(path, as_version=4)
    for before, after in zip(shown.cells, execute(path).cells, strict=True):
        if before.cell_type == "code" and "varies" not in before.metadata.get("tags", ()):
            assert texts(after) == texts(before), before.source
