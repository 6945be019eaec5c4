"""What can be copied from a result runs where it is pasted."""

from __future__ import annotations

import json
import shlex

import pytest

from inverse_service import __version__, catalogue
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents import documents
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.web.pages.result_tasks import curl_of, python_call


def test_calls_hold_the_document() -> None:
    document = {"name": "it's", "equations": "x'' = -x"}
    words = shlex.split(curl_of(document, "http://h"))
    assert json.loads(words[-1]) == document
    compile(python_call(document, "http://h"), "call", "exec")


@pytest.mark.slow
def test_the_latex_of_a_motion_with_constraints_has_all_that_the_page_shows() -> None:
    document = {**catalogue.document("nonholonomic-particle"), "associated": "second"}
    found = documents.solve_document(document, SolveOptions())
    latex = latex_page(found, True, "http://h/results/a_1")
    for formula in (r"\dot{z} + x \dot{y} = 0", "L = ", "H = ", "p_{x} = ", "p_{z} + p_{y} = 0"):
        assert formula in latex
    assert latex.count("{") == latex.count("}")
    assert rf"Found by inverse-service {__version__}: \url{{http://h/results/a_1}}." in latex
