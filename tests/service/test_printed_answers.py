"""The order and the notation in which text, LaTeX and the page print an answer."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from inverse_service.expressions.printing_latex import LINE, lines_of_latex
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.latex_page import display, latex_page
from inverse_service.service.documents.text_page import answers_of, text_page
from inverse_service.web.pages.shown_results import glance_of, other_question, shown_of

SYSTEM = {"coordinates": ["x"], "parameters": [], "functions": {}}


@lru_cache(maxsize=1)
def damped() -> dict[str, Any]:
    document = {"coordinates": ["x"], "equations": {"x": "-x - x'/10"}}
    return solve_document(document, SolveOptions(time_limit=600))


def test_the_textbook_lagrangian_of_the_damped_oscillator_comes_first_everywhere() -> None:
    result = damped()
    assert "atan" in result["lagrangian"]["text"]  # the question asked keeps its place in the JSON
    text = text_page(result, False)
    assert 0 < text.index("L = exp(t/10)*(x'^2 - x^2)/2") < text.index("atan(")
    latex = latex_page(result, False)
    assert 0 < latex.index("L(t, q, q')") < latex.index("L(q, q')")
    main, other = shown_of(result, result)
    assert main.lagrangian is not None
    assert other is not None
    assert other.lagrangian is not None
    assert (main.lagrangian.text, "atan" in other.lagrangian.text) == ("L = exp(t/10)*(x'^2 - x^2)/2", True)
    assert other_question(result, main).startswith("There is one without the time")
    glance = glance_of(result)
    assert glance is not None
    assert [answer.question for answer in glance["answers"]] == ["L(t, q, q\u2032)", "L(q, q\u2032)"]


def order(autonomous: str, with_time: str) -> list[bool]:
    other = {"lagrangian": {"text": with_time}}
    result = {"system": SYSTEM, "question": "L(q, q')", "lagrangian": {"text": autonomous}, "with_time": other}
    return [timed for _, timed in answers_of(result, result)]


@pytest.mark.parametrize(
    ("autonomous", "with_time", "timed_first"),
    [
        ("x'^2/2 - cos(x)", "exp(t)*x'^2/2", False),
        ("x'^4 - x", "exp(t)*x'^2/2", False),
        ("1/(x' + x)", "exp(t)*x'^2/2", True),
        ("x'*log(x') - x", "exp(t)*x'^2/2", True),
        ("1/(x' + x)", "t*log(x')", False),
        ("x'*log(x')", "t/x'", True),
        ("x'*log(x') - x", "F(t)*x'^2 - unreadable(", False),
    ],
)
def test_the_kinds_of_lagrangians_have_an_order(autonomous: str, with_time: str, timed_first: bool) -> None:
    assert order(autonomous, with_time) == ([True, False] if timed_first else [False, True])


@pytest.mark.parametrize("verdict", ["not_variational", "undetermined"])
def test_an_answer_that_there_is_no_lagrangian_keeps_its_place(verdict: str) -> None:
    other = {"lagrangian": {"text": "x'^2"}}
    result = {"system": SYSTEM, "question": "L(q, q')", "lagrangian": None, "verdict": verdict, "with_time": other}
    assert [timed for _, timed in answers_of(result, result)] == [False, True]


def test_latex_sets_conditions_and_theory_as_mathematics(tmp_path: Path) -> None:
    latex = latex_page(damped(), True)
    assert "textasciicircum" not in latex
    assert "textbackslash" not in latex
    assert r"$10 x^{2} + x \dot{x} + 10 \dot{x}^{2} > 0$" in latex
    sentences = re.sub(r"\$[^$]*\$|\\\[.*?\\\]", "", latex)
    assert not [word for word in ("phi(", "Gamma", "dL/d") if word in sentences]
    if shutil.which("pdflatex"):
        (tmp_path / "page.tex").write_text(latex)
        command = ["pdflatex", "-interaction=batchmode", "-halt-on-error", "page.tex"]
        assert subprocess.run(command, cwd=tmp_path, check=False, capture_output=True).returncode == 0


def test_long_formulas_are_broken_between_their_terms() -> None:
    terms = [rf"\left(a_{{{k}}} + \frac{{b + c}}{{d - e}}\right)" for k in range(12)]
    formula = "L = " + " + ".join(terms)
    shown = display(formula)
    assert shown.count(r"\\ & \quad ") >= 2
    inner = shown.removeprefix(r"\[ \begin{aligned} & ").removesuffix(r" \end{aligned} \]")
    assert inner.replace(r"\\ & \quad ", "").replace(" ", "") == formula.replace(" ", "")
    assert display("L = a + b") == r"\[ L = a + b \]"


SUM = " - ".join(rf"x_{{{k}}} \dot{{y}}^{{2}}" for k in range(40))
WIDE = {
    "sum": SUM,
    "bracket": rf"m \left({SUM}\right)^{{2}} + c",
    "function": rf"k - \ln\left(\left({SUM}\right) q\right)",
    "fraction": rf"-\frac{{{SUM}}}{{2 m}} + 1",
    "denominator": rf"\frac{{1}}{{{SUM}}}",
    "both": rf"\frac{{a + {SUM}}}{{{SUM}}}",
    "root": rf"\sqrt{{{SUM}}}",
    "exponential": rf"x e^{{{SUM}}}",
    "product": " ".join(rf"\sin\left(x_{{{k}}}\right)" for k in range(30)),
    "small matrix": r"\begin{pmatrix} " + " & ".join([r"a + \dot{b} - c"] * 6) + r" \end{pmatrix}",
    "matrix": rf"g = \begin{{pmatrix}} 1 & {SUM} \\ {SUM} & 0 \end{{pmatrix}}",
}


@pytest.mark.parametrize("formula", WIDE.values(), ids=WIDE)
def test_no_line_of_a_long_formula_is_wider_than_a_page_and_each_is_latex_by_itself(formula: str) -> None:
    lines = lines_of_latex(formula)
    assert len(lines) > 1 or "smallmatrix" in lines[0]
    assert [lines_of_latex(line, LINE + 40) for line in lines if "matrix" not in line] == [
        [line] for line in lines if "matrix" not in line
    ]
    for line in lines:
        assert line.count("{") == line.count("}")
        assert line.count(r"\left") == line.count(r"\right")
    assert all(f"x_{{{k}}}" in "".join(lines) for k in range(30)) or "matrix" in lines[0]


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="needs pdflatex")
def test_pages_with_long_formulas_compile_and_stay_within_their_margins(tmp_path: Path) -> None:
    restricted = "-x/(x^2+y^2)^(3/2)+mu*(x-1)/((x-1)^2+y^2)^(3/2)+2*w*y'", "-y/(x^2+y^2)^(3/2)-2*w*x'"
    document = {"equations": dict(zip("xy", restricted, strict=True)), "parameters": ["mu", "w"]}
    results = [damped(), solve_document(document, SolveOptions(time_limit=600))]
    shown = "\n".join(display(formula) for formula in WIDE.values())
    texts = [latex_page(result, True) for result in results]
    for text in (*texts, texts[0].replace(r"\end{document}", shown + r"\end{document}")):
        (tmp_path / "page.tex").write_text(text)
        command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "page.tex"]
        found = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True, errors="replace")
        assert [
            float(width) for width in re.findall(r"Overfull \\hbox \(([\d.]+)pt", found.stdout) if float(width) > 2
        ] == []


def test_the_multiplier_of_the_damped_oscillator_is_one_quotient_and_its_momentum_one_arctangent() -> None:
    document = {"equations": "m*x'' = -k*(x - 1) - c*x'", "parameters": ["m", "k", "c"]}
    result = solve_document(document, SolveOptions(time_limit=600))
    assert result["multiplier"] == [["1/(k*x^2 + c*x*x' - 2*k*x + m*x'^2 - c*x' + k)"]]
    hamiltonian = result["hamiltonian"]
    assert hamiltonian["momenta"]["p_x"].count("atan") == 1
    assert len(hamiltonian["text"]) < 300
    assert damped()["multiplier"] == [["1/(10*x^2 + x*x' + 10*x'^2)"]]


def test_kinds_say_of_which_question_case_and_point_they_speak() -> None:
    document = {"equations": {"x": "-abs(x)*x'"}, "kinds": ["natural", "positive_definite", "rayleigh"]}
    result = solve_document(document, SolveOptions(time_limit=600))
    text = text_page(result, False).split("Lagrangians of a kind:")[1]
    near = ", ".join(f"{name} = {value}" for name, value in result["kinds"]["positive_definite"]["near"].items())
    for line in (
        "natural, L(q, q') on x > 0, x' > 0: no",
        f"positive_definite, L(q, q') on x > 0, x' > 0 at {near}: yes",
        "D = -x*x'^2/2",
    ):
        assert line in text
    latex = latex_page(result, False)
    assert r"positive\_definite" in latex
    assert r"D = -\frac{x \dot{x}^{2}}{2}" in latex


def test_latex_has_what_there_is_instead_and_the_answer_with_another_clock() -> None:
    document = {"equations": {"x": "-x-x'*y'", "y": "-y-x'"}, "clock": "sqrt(x - 2)"}
    result = solve_document(document, SolveOptions(time_limit=600))
    latex = latex_page(result, False)
    assert ("Instead: " in latex) == bool(result["instead"])
    assert latex.index("With the clock dtau = (sqrt(x - 2)) dt:") < latex.index("$x > 2$")


REGULAR = [  # equations, where L is regular, conditions of H
    ({"x": "-x-x'/10"}, "everywhere", []),
    ({"r": "r*a'^2-1/r^2", "a": "-2*r'*a'/r"}, "everywhere", ["r != 0"]),
    ({"x": "(1-x'^2)^(3/2)"}, "everywhere", []),
    ({"x": "-atan(x)"}, "everywhere", []),
    ({"x": "-x'^3"}, "everywhere", ["x' > 0", "p_x < 0"]),
    ({"x": "-x*cosh(y)", "y": "-sinh(y)*x^2/2"}, "everywhere", []),
    ({"a": "-a", "b": "a*b'^2"}, "at generic points, where det g is not 0", []),
]


@pytest.mark.parametrize(("equations", "regular", "conditions"), REGULAR)
def test_L_is_regular_everywhere_where_its_multiplier_shows_it_and_H_has_no_idle_conditions(
    equations: dict[str, str], regular: str, conditions: list[str]
) -> None:
    result = solve_document({"equations": equations}, SolveOptions(time_limit=600))
    answer = next(answer for answer, _ in answers_of(result, result) if answer["lagrangian"])
    assert answer["lagrangian"]["regular"] == regular
    assert answer["hamiltonian"]["domain"] == conditions  # those of L among them


def test_a_closed_form_comes_before_a_lagrangian_that_is_only_known_to_exist() -> None:
    result = solve_document({"equations": {"u": "-u^2-u-u'/7"}}, SolveOptions(time_limit=600))
    assert (result["lagrangian"], result["verdict"]) == (None, "variational")
    (first, with_time), (second, _) = answers_of(result, result)
    assert with_time
    assert "exp(t/7)" in first["lagrangian"]["text"]
    assert second["verdict"] == "variational"


def test_names_that_were_not_declared_are_said_as_what_they_were_taken_for() -> None:
    document = {"equations": "m*x'' = -V'(x) - k*x", "parameters": "guess"}
    text = text_page(solve_document(document, SolveOptions(time_limit=600)), False)
    assert "not declared, taken as constants: m, k; taken as any functions: V(x)" in text


def test_two_open_questions_say_that_the_reason_is_one() -> None:
    result = solve_document({"equations": "x'' = -sqrt(2 + sin(atan(x)/3))"}, SolveOptions())
    lines = text_page(result, False).splitlines()
    places = [place for place, line in enumerate(lines) if line.startswith("Undetermined")]
    assert len(places) == 2
    assert lines[places[0] + 1].startswith("  an angle with pi or an arctangent")
    assert lines[places[1] + 1] == "  for the same reason"


@pytest.mark.slow
def test_a_motion_whose_lagrangian_has_no_closed_form_is_printed_with_the_beginning_of_a_series() -> None:
    """In five seconds none is looked for: its existence is proven alone."""
    document = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2 - x",
        "constraints": ["z' + x*y'"],
        "associated": "any",
    }
    result = solve_document(document, SolveOptions(time_limit=5.0))
    assert result["any_associated"]["certificate"]["kind"] == "existence"
    assert "  no Lagrangian in closed form was found; --explain shows how one begins\n" in text_page(result, False)
    lines = [line.strip() for line in text_page(result, True).splitlines()]
    assert any(line.startswith("l = ") and line.endswith(" + ...") for line in lines)
    assert any(line.startswith("lambda_1 = ") and line.endswith(" + ...") for line in lines)


def test_a_step_that_divides_by_a_parameter_says_not_equal_and_each_component_once() -> None:
    document = {"equations": "x'' = -x - a*x'*y'; y'' = -y + x^2", "parameters": ["a"]}
    result = solve_document(document, SolveOptions(time_limit=20))
    page = latex_page(result, explain=True)
    assert r"a \neq  0" in page
    assert "!=" not in page
    parts = [part for step in result["explanation"] for part in step["parts"]]
    (condition,) = {part["mathml"] for part in parts if part["text"] == "a != 0"}
    assert "<mo>≠</mo>" in condition
    components = next(step for step in result["explanation"] if "components of Phi" in step["text"])
    texts = [part["text"] for part in components["parts"] if part["kind"] in ("formula", "display")]
    assert texts[1:] == sorted({text for text in texts if text.startswith("(Phi)^")})
    assert len(texts) == 5
    assert all(components["text"].count(text) == 1 for text in texts[1:])
