"""Texts and LaTeX of results as MathML."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest

from inverse_service import catalogue
from inverse_service.expressions.names import Names
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.solving import parse_document, solve_document
from inverse_service.web.pages import answers, typesetting
from inverse_service.web.pages.latex_mathml import UnknownLatex, latex_to_mathml, low_fences

NAMES = Names(("phi", "x"), ("R", "g_11", "g_12", "p_x"), {"A": ("x",)})


def text_of(mathml: str) -> str:
    """The characters of well-formed MathML; raises where it is not well-formed."""
    return "".join(ElementTree.fromstring(mathml).itertext())


@pytest.mark.parametrize(
    ("latex", "shown"),
    [
        (r"\frac{\dot{\varphi}^{2}}{2}", "φ˙22"),
        (r"R \sin^{2}\left(\varphi\right)", "Rsin2(φ)"),
        (r"\sqrt{x} \neq 0", "x≠0"),
        (r"A''\left(x\right)", "A″(x)".replace("″", "\u2032\u2032")),
        (r"g = \begin{pmatrix} 1 & 0 \\ 0 & x \end{pmatrix}", "g=(100x)"),
        (r"\operatorname{asinh}\left(x\right)", "asinh(x)"),
        (r"(\nabla\Phi)^{3}{}_{1} = 0", "(∇Φ)31=0"),
        ("", ""),
    ],
)
def test_latex_becomes_well_formed_mathml(latex: str, shown: str) -> None:
    assert text_of(latex_to_mathml(latex)) == shown


@pytest.mark.parametrize("latex", [r"\unknown{x}", r"{x", r"\left(x", r"x}", r"\begin{cases} x \end{cases}", "{" * 500])
def test_other_latex_is_refused_and_shown_as_it_is(latex: str) -> None:
    with pytest.raises(UnknownLatex):
        latex_to_mathml(latex)
    assert "<code>" in typesetting.latex(latex)


def test_names_in_latex_cannot_be_markup() -> None:
    assert "<script" not in typesetting.latex(r"\mathrm{<script>}")
    assert "<b>" not in typesetting.sentence("a <b> = 1 & c", NAMES)[0]


def test_every_formula_of_the_catalogue_is_typeset_from_its_latex() -> None:
    for name in catalogue.names():
        parsed = parse_document(catalogue.document(name))
        for formula in parsed["equations"].values():
            text_of(latex_to_mathml(formula["latex"]))


def test_every_step_of_a_proof_and_of_a_search_is_typeset() -> None:
    for name in ("vertically-rolling-disk-first", "knife-edge-second"):
        result = solve_document(catalogue.document(name), SolveOptions(time_limit=60.0))
        answer = answers.answer_of(result, result["question"], result)
        assert len(answer.steps) == len(result["explanation"])
        for shown, step in zip(answer.steps, result["explanation"], strict=True):
            assert "<math" in shown.text + (shown.formula or "") or not step["latex"]
            assert "<code>" not in shown.text + (shown.formula or ""), json.dumps(step)


def test_a_sentence_keeps_its_words_and_sets_its_formulas() -> None:
    html, has_equation = typesetting.sentence("(Phi)_23: R*g_11 = 0. As R is not zero, g_12 = -x/R.", NAMES)
    assert has_equation
    assert html.count("<math") == 4
    assert "is not zero" in html
    names = typesetting.names_of({"coordinates": ["x"], "parameters": [], "functions": {}})
    higher, _ = typesetting.sentence("T = Phi, nabla Phi and nabla^2 Phi (indices: 1 for x).", names)
    assert "nabla" not in higher
    plain, has_equation = typesetting.sentence("There is no Lagrangian.", NAMES)
    assert (str(plain), has_equation) == ("There is no Lagrangian.", False)


def test_a_long_formula_can_be_broken_between_its_terms() -> None:
    text = " + ".join(f"{k}*x*R*g_11*sin(x + R)" for k in range(2, 8)) + " = 0"
    html = typesetting.formula(text, NAMES)
    assert html.count("<math") == 7
    assert "sin" in html
    assert typesetting.formula("@", NAMES) == "<code>@</code>"


def test_only_brackets_around_tall_things_stretch() -> None:
    low = low_fences("<mo>(</mo><mi>x</mi><mo>)</mo><mo>(</mo><mfrac></mfrac><mo>)</mo>")
    assert low.count('stretchy="false"') == 2
    assert low.endswith("<mo>(</mo><mfrac></mfrac><mo>)</mo>")


def test_a_name_that_is_an_article_belongs_to_the_formula_behind_an_operator() -> None:
    names = Names(("x",), ("a", "c"))
    shown, _ = typesetting.sentence("As c - a and c + a are not zero, a Lagrangian exists.", names)
    assert shown.count("<mi>a</mi>") == 2
    assert "- a" not in shown
    assert ", a Lagrangian" in shown
