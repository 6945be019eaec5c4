"""The tree of special cases in documents and on the pages of the command line."""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from inverse_service.cli.command_line import application
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_system
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page

OSCILLATORS = {
    "coordinates": ["x", "y"],
    "equations": {"x": "-a*x' + b*y", "y": "-c*y' + d*x"},
    "parameters": ["a", "b", "c", "d"],
    "time_dependent_lagrangian": True,
}


@functools.cache
def result() -> Any:
    return solve_system(OSCILLATORS | {"special_cases": True}, SolveOptions(time_limit=60))


def texts(cases: list[dict[str, Any]]) -> list[list[str]]:
    return [[condition["text"] for condition in case["conditions"]] for case in cases]


def test_the_question_for_which_parameters_is_answered() -> None:
    part = result()["special_cases"]
    assert part["complete"]
    assert not part["reasons"]
    assert sorted(texts(part["variational_when"])) == [["a = -c"], ["a = c"], ["b = 0", "d = 0"]]
    assert part["tree"]["verdict"] == result()["verdict"] == "not_variational"
    assert {child["verdict"] for child in part["tree"]["children"]} == {"variational"}


def test_without_the_option_there_is_no_tree() -> None:
    assert solve_system(OSCILLATORS, SolveOptions(time_limit=60))["special_cases"] is None


def test_progress_is_reported() -> None:
    said: list[str] = []
    solve_system(OSCILLATORS | {"special_cases": True}, SolveOptions(time_limit=60), said.append)
    assert any(line.startswith("special cases: ") for line in said)


def test_the_pages_say_when() -> None:
    page = text_page(result(), explain=False)
    assert "A Lagrangian exists where b = 0, d = 0." in page
    assert "The tree is complete" in page
    assert "$a = - c$" in latex_page(result(), explain=False) or "$a = -c$" in latex_page(result(), explain=False)


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs a LaTeX installation")
def test_the_latex_page_compiles(tmp_path: Path) -> None:
    (tmp_path / "page.tex").write_text(latex_page(result(), explain=False))
    subprocess.run(["pdflatex", "-halt-on-error", "page.tex"], cwd=tmp_path, check=True, capture_output=True)


def test_the_command_line_has_the_option(tmp_path: Path) -> None:
    (tmp_path / "system.json").write_text(json.dumps(OSCILLATORS))
    ran = CliRunner().invoke(application, ["solve", str(tmp_path / "system.json"), "--special-cases"])
    assert ran.exit_code == 0
    assert json.loads(ran.stdout)["special_cases"]["complete"]
