"""Texts and LaTeX of results as MathML."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest

from inverse_service import catalogue
from inverse_service.expressions.notation import theory
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.service.documents.documents import solve_document, solve_system
from inverse_service.web.pages import shown_results, steps, typesetting
from inverse_service.web.pages.typesetting import low_fences

NAMES = Names(("phi", "x"), ("R", "g_11", "g_12", "p_x"), {"A": ("x",)})


def test_the_class_of_constraints_is_typeset_from_its_parts() -> None:
    """The letters of the paper and the coordinates that stand for them; what is no formula is escaped."""
    disk = {"lagrangian": "(x'^2 + phi'^2)/2 + y'^2/2", "constraints": "y' - x*phi'"}
    part = solve_document(disk, SolveOptions(time_limit=60))["nonholonomic"]["paper_class"]
    assert part["statement"] == "The system is in the class s' = -A(r_1) r_2' with r_1 = x, r_2 = phi."
    shown = steps.sentence_of(part["statement"], [*part["parts"], {"kind": "text", "text": " <b>"}], NAMES)
    read = text_of(f"<p>{shown}</p>")
    assert read == "The system is in the class s\u2032=\u2212A(r1)r2\u2032 with r1=x, r2=\u03c6. <b>"
    assert shown.count("<msub") == 4
    assert steps.sentence_of("a < b", (), NAMES) == "a &lt; b"


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
    step = {
        "text": "<b>",
        "latex": "",
        "parts": [{"kind": "text", "text": "<b>"}, {"kind": "formula", "text": "<script>"}],
    }
    shown = steps.step_of(step, NAMES, [])
    assert "<b>" not in shown.text
    assert "<script" not in shown.text


def test_a_step_of_an_older_result_keeps_its_words() -> None:
    assert (
        str(steps.step_of({"text": "There is no Lagrangian.", "latex": ""}, NAMES, []).text)
        == "There is no Lagrangian."
    )


@pytest.mark.slow
def test_every_step_of_a_proof_and_of_a_search_is_typeset() -> None:
    for name in ("vertically-rolling-disk-first", "knife-edge-second"):
        result = solve_system(catalogue.document(name), SolveOptions(time_limit=60.0))
        answer = shown_results.answer_of(result, result["question"], result)
        assert len(answer.steps) == len(result["explanation"])
        for shown, step in zip(answer.steps, result["explanation"], strict=True):
            assert "<math" in shown.text + (shown.formula or "") or not step["latex"]
            assert "<code>" not in shown.text + (shown.formula or ""), json.dumps(step)


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


def test_the_rate_d_dt_is_a_fraction() -> None:
    assert str(typesetting.of_theory("d/dt(dL/dv)")).count("<mfrac>") == 1


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


def test_matrices_too_long_for_a_page_are_named_with_their_length() -> None:
    entry = " + ".join(f"{k}*x*y'^2" for k in range(2, 40))
    conditions = {"Phi": [[entry, "0"], ["0", entry]], "nabla_Phi": [[entry] * 5] * 5, "R": [[["0", "x"], ["x", "0"]]]}
    phi, nabla, curvature = steps.matrices_of(conditions, Names(("x", "y"), ()))
    assert nabla.math.startswith(f'<p class="hint">\u2207\u03a6 has {25 * len(entry):,} characters')
    assert all("<math" in shown.math for shown in (phi, curvature))
    assert sum(len(shown.math) for shown in (phi, nabla, curvature)) < 300_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "kept"),
    [
        ({"r": "r*p'^2 - 1/r^2", "p": "-2*r'*p'/r"}, ["H", "p_p"]),
        ({"x": "0", "y": "-y"}, ["H", "p_x"]),
        ({"x": "-x - x'/10"}, []),
        ({"x": "-x + sin(t)"}, []),
    ],
)
def test_a_page_names_what_is_conserved(equations: dict[str, str], kept: list[str]) -> None:
    """H where the time does not occur in L, and the momentum of each coordinate that does not."""
    document = {"coordinates": list(equations), "equations": equations}
    result = solve_system(document, SolveOptions(time_limit=600))
    part, _ = shown_results.shown_of(result, result)
    assert part.hamiltonian is not None
    assert [text_of(f"<p>{one}</p>").split(" is")[0] for one in part.hamiltonian.kept] == [
        one.replace("_", "") for one in kept
    ]
