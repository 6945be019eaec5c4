"""The notebook of the manual is one, and each of its cells prints what stands under it."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "tutorials" / "sympy.ipynb"
KEYS = {"code": {"cell_type", "id", "metadata", "source", "execution_count", "outputs"}}
MARKDOWN = {"cell_type", "id", "metadata", "source"}


def test_the_notebook_has_the_format_of_notebooks() -> None:
    found = json.loads(NOTEBOOK.read_text())
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    assert found["metadata"]["kernelspec"]["name"] == "python3"
    assert len({cell["id"] for cell in found["cells"]}) == len(found["cells"])
    assert all(cell.keys() == KEYS.get(cell["cell_type"], MARKDOWN) for cell in found["cells"])


@pytest.mark.slow
def test_every_cell_prints_what_the_notebook_shows() -> None:
    names: dict[str, Any] = {}
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    assert len(cells) > 3
    for cell in cells:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec("".join(cell["source"]), names)
        assert printed.getvalue() == "".join(line for output in cell["outputs"] for line in output["text"])
