"""What can be copied from a result runs where it is pasted."""

from __future__ import annotations

import json
import shlex

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.solving import solve_document
from inverse_service.web.pages.exports import curl_of, latex_of, python_call


def test_calls_hold_the_document() -> None:
    document = {"name": "it's", "equations": "x'' = -x"}
    words = shlex.split(curl_of(document, "http://h"))
    assert json.loads(words[-1]) == document
    compile(python_call(document, "http://h"), "call", "exec")


def test_latex_is_balanced() -> None:
    result = solve_document({"equations": "x'' = -x"}, SolveOptions(time_limit=60.0))
    latex = latex_of(result)
    assert latex.count(r"\begin{align*}") == latex.count(r"\end{align*}") >= 2
    assert latex.count("{") == latex.count("}")
