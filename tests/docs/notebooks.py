"""The notebooks of the documentation: `python -m tests.docs.notebooks` executes them in place.

A code cell with the tag `varies` prints times or sentences; it is executed, but its output is not
compared.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted(ROOT.glob("docs/**/*.ipynb"))
ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def execute(path: Path, write: bool = False) -> Any:
    """Execute the notebook with a new kernel in its folder. Raises CellExecutionError."""
    found = nbformat.read(path, as_version=4)
    os.environ["PYTHONPATH"] = str(ROOT)
    client = NotebookClient(
        found,
        timeout=120,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()
    for cell in found.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell["execution_count"] = None
            cell["outputs"] = [
                _without_count(output)
                for output in cell["outputs"]
                if output.get("name") != "stderr"
            ]
    if write:
        nbformat.write(found, path)
    return found


def texts(cell: Any) -> str:
    """The printed output of the cell and its value as text, without pictures."""
    shown = [
        output.get("text") or output.get("data", {}).get("text/plain", "")
        for output in cell["outputs"]
    ]
    return "".join(ADDRESS.sub("", text) for text in shown if not text.startswith("<Figure"))


def _without_count(output: Any) -> Any:
    if "execution_count" in output:
        output["execution_count"] = None
    return output


if __name__ == "__main__":
    for chosen in [Path(name).resolve() for name in sys.argv[1:]] or NOTEBOOKS:
        execute(chosen, write=True)
