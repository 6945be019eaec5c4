"""A result as a LaTeX document that compiles by itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from inverse_service.cli.forward_page import forward_latex, is_forward_result
from inverse_service.cli.nonholonomic_pages import nonholonomic_latex
from inverse_service.cli.special_cases_pages import special_cases_latex
from inverse_service.cli.text_page import asks_for_time, branches_of, verdict_sentence
from inverse_service.service.documents.latex_proof import display, escaped, latex_proof

SIGNS = {"!=": r"\neq"}


def latex_page(result: dict[str, Any], explain: bool) -> str:
    """The whole document, ending with a newline."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb}", r"\begin{document}"]
    if is_forward_result(result):
        return "\n".join([*lines, *forward_latex(result), r"\end{document}"]) + "\n"
    if result.get("nonholonomic") is not None:
        lines += [escaped(result["any_associated"]["statement"])] if result.get("any_associated") else []
        lines += nonholonomic_latex(result["nonholonomic"])
    if result["system"] is not None:
        lines += [escaped(result["system"]["name"]), *map(display, result["system"]["latex"].values())]
    for branch in branches_of(result):
        lines += _answer(branch, asks_for_time(result), explain)
        if branch["with_time"] is not None:
            lines += _answer(branch["with_time"], True, explain)
    if result.get("special_cases") is not None:
        lines += special_cases_latex(result["special_cases"])
    return "\n".join([*lines, r"\end{document}"]) + "\n"


def _in_formula_mode(text: str) -> str:
    """Inequality signs as LaTeX prints them in any font encoding."""
    return re.sub("(!=|[<>])", lambda found: f"${SIGNS.get(found[0], found[0])}$", text)


def _answer(answer: dict[str, Any], with_time: bool, explain: bool) -> Iterator[str]:
    sentence = verdict_sentence(answer["verdict"], with_time, answer.get("domain"))
    yield _in_formula_mode(escaped(f"{sentence} {answer['reason']}".strip()))
    for letter, part in (("L", answer["lagrangian"]), ("H", answer["hamiltonian"])):
        if part is not None:
            yield display(f"{letter} = {part['latex']}")
            if part.get("domain"):
                yield _in_formula_mode(escaped(f"where {', '.join(part['domain'])}."))
    if answer["solution_space"] is not None:
        yield escaped(answer["solution_space"]["statement"])
    if explain:
        yield from latex_proof(answer["explanation"])
