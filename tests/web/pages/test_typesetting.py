"""Texts and LaTeX of results as MathML."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from inverse_service import catalogue
from inverse_service.expressions.notation import theory
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.service.documents.documents import solve_document, solve_system
from inverse_service.web.pages import sheets, typesetting
from inverse_service.web.pages.typesetting import low_fences

NAMES = Names(("phi", "x"), ("R", "g_11", "g_12", "p_x"), {"A": ("x",)})


def test_the_class_of_constraints_is_typeset_from_its_parts() -> None:
    """The letters of the paper and the coordinates that stand for them; what is no formula is escaped."""
    disk = {"lagrangian": "(x'^2 + phi'^2)/2 + y'^2/2", "constraints": "y' - x*phi'"}
    part = solve_document(disk, SolveOptions(time_limit=60))["nonholonomic"]["paper_class"]
    assert part["statement"] == "The system is in the class s' = -A(r_1) r_2' with r_1 = x, r_2 = phi."
    shown = typesetting.sentence(part, NAMES) + typesetting.sentence({"parts": [" <b>"]}, NAMES)
    read = text_of(f"<p>{shown}</p>")
    assert read == "The system is in the class s\u2032=\u2212A(r1)r2\u2032 with r1=x, r2=\u03c6. <b>"
    assert shown.count("<msub") == 4
    assert typesetting.sentence("a < b", NAMES) == "a &lt; b"


@pytest.mark.parametrize(
    ("formula", "shown"),
    [
        ("dL/dx' = R*x'", "\u2202L\u2202x\u02d9=R\u2062x\u02d9"),
        ("Phi = [[x, 0], [R, 1]]", "\u03a6=(x0R1)"),
        ("x > 0, 4*R > x^2", "x>0,4\u2062R>x2"),
        ("(nabla Phi)_13", "\u2207\u03a613"),
    ],
)
def test_formulas_of_proofs_are_typeset_from_their_texts(formula: str, shown: str) -> None:
    """As parts of a step: words and formulas alternately, or {kind, text} as in results of before."""
    new = typesetting.sentence({"parts": ["so ", formula, "."]}, NAMES)
    old = typesetting.sentence({"parts": [{"kind": "text", "text": "so "}, {"kind": "formula", "text": formula},
                                          {"kind": "text", "text": "."}]}, NAMES)  # fmt: skip
    assert new == old
    assert text_of(f"<p>{new}</p>") == f"so {shown}."


def text_of(mathml: str) -> str:
    """The characters of well-formed MathML; raises where it is not well-formed."""
    return "".join(ElementTree.fromstring(mathml).itertext())


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("g_ij R^j_kl", "gijRklj"),
        ("Gamma(g) = g N + (g N)^T", "Γ(g)=gN+(gN)T"),
        ("nabla Phi", "∇Φ"),
        ("dg_ij/dv^k = dg_ik/dv^j", "∂gij/∂vk=∂gik/∂vj"),
        ("det g = 0", "detg=0"),
        ("x' int F(h)/x'^2 d x'", "x\u2032∫F(h)/x\u20322dx\u2032"),
        ("", ""),
    ],
)
def test_the_notation_of_the_theory_becomes_well_formed_mathml(text: str, shown: str) -> None:
    assert text_of(f"<math>{theory(text).mathml}</math>") == shown


def test_texts_of_users_cannot_be_markup() -> None:
    shown = typesetting.sentence({"parts": ["<b>", "<script>", ""]}, NAMES)
    assert "<b>" not in shown
    assert "<script" not in shown


@pytest.mark.slow
def test_every_step_of_a_proof_and_of_a_search_is_typeset() -> None:
    for name in ("vertically-rolling-disk-first", "knife-edge-second"):
        result = solve_system(catalogue.document(name), SolveOptions(time_limit=60.0))
        ((_, steps),) = sheets.sheet_of(result).proofs
        assert len(steps) == len(result["explanation"])
        for shown in steps:
            assert "<code>" not in shown


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


def test_small_fractions_in_exponents_stay_on_their_line() -> None:
    names = Names(("x",), ("c",))
    assert "<mfrac>" not in str(typesetting.formula("exp(-c*t/10)", names))
    assert "<mfrac>" in str(typesetting.formula("exp((c + t)/10)", names))


def test_d_dt_and_the_slopes_of_l_are_fractions() -> None:
    assert str(typesetting.of_theory("d/dt(dL/dv)")).count("<mfrac>") == 2


DOMAINS = [
    (["c < 2", "c > 0", "-c^2 + 4 != 0"], ["c < 2", "c > 0"]),
    (["x > 0", "x' > 0", "c > 0", "c*x*x' + x^2 + x'^2 > 0", "x + x' > 0"], ["x > 0", "x' > 0", "c > 0"]),
    (["x != 0", "x > 0"], ["x > 0"]),
    (["x > 0", "x' < 0", "x*x' != 0", "x - x' > 0", "x + x' > 0"], ["x > 0", "x' < 0", "x + x' > 0"]),
    (["x < 5", "x - 5 != 0", "x - 4 != 0"], ["x < 5", "x - 4 != 0"]),
    (["x > -1", "x^2 != 0", "x + 1 > 0", "x^2 + 1 != 0"], ["x > -1", "x^2 != 0", "x + 1 > 0"]),
    (["x > 1", "x^2 - 1 != 0", "x^2 - 2 != 0", "1/x - 1 != 0"], ["x > 1", "x^2 - 2 != 0", "1/x - 1 != 0"]),
    (["x > 0", "sqrt(x) != 0", "x - c != 0", "exp(x) - 1 != 0"], ["x > 0", "x - c != 0", "exp(x) - 1 != 0"]),
    (["det g is not 0", "x != 0"], ["det g is not 0", "x != 0"]),
]


@pytest.mark.parametrize(("conditions", "needed"), DOMAINS)
def test_a_domain_is_shown_without_what_follows_from_bounds(conditions: list[str], needed: list[str]) -> None:
    names = Names(("x",), ("c",))
    assert typesetting.conditions(conditions, names) == [typesetting.formula(text, names) for text in needed]


def test_an_integral_is_shown_with_what_it_is() -> None:
    known = {"G": {"arguments": ["x"], "derivatives": {"x": "F(x) + x"}}}
    names = typesetting.names_of({"coordinates": ["x"], "parameters": [], "functions": {"F": ["x"]}}, known)
    (line,) = typesetting.integrals(known, names)
    shown = text_of(f"<p>{line}</p>").replace("\u2061", "")
    assert shown == "G(x) = \u222b (F(x)+x) dx"
    assert "<code>" not in typesetting.equation("L", "x'^2/2 - G(x)", names)


def test_a_formula_has_the_text_that_is_copied() -> None:
    names = Names(("x", "y"))
    long = "x'^2*y'^2*x^3*y^5/2 + x^4*y'^4*x'^6 - 2*x*y*x'*y' < 0"
    assert 'data-text="L = x&#39;^2/2"' in typesetting.equation("L", "x'^2/2", names)
    assert typesetting.formula(long, names).count("data-text") == 1
