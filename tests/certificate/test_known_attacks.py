"""Known attacks on the checker of format 1, with their numbers, and on that of format 2."""

from __future__ import annotations

import copy
import itertools
from typing import Any

import pytest

from inverse_service import check
from inverse_service.certificate.checker import check_certificate, check_text
from tests.certificate.documents import Document, all_rows
from tests.certificate.tricks import D

FORMAT = "inverse-service/certificate/2"
FAR = "1" + "0" * 80


def certificate(equations: dict[str, str], kind: str, **content: Any) -> Document:
    claim = "not_variational" if kind == "nonexistence" else "variational"
    system = {"coordinates": [*equations], "equations": equations}
    system |= {key: content.pop(key) for key in ("parameters", "functions") if key in content}
    return {
        "format": FORMAT, "system": system, "question": "autonomous", "claim": claim, "kind": kind, **content
    }  # fmt: skip


def of_lagrangian(x: str, y: str, lagrangian: str, **content: Any) -> Document:
    return certificate({"x": x, "y": y}, "lagrangian", lagrangian=lagrangian, **content)


def result_of(one: Document) -> Document:
    shown = {"lagrangian": {"text": one["lagrangian"]}} if one["kind"] == "lagrangian" else {}
    return {"format": "inverse-service/result/1", "system": one["system"], "verdict": one["claim"],
            "certificate": one, **shown}  # fmt: skip


# --- 1.1, 1.2: dimensions of a system whose first derivatives seem to vanish relative to a huge
# coordinate
DIMENSIONS = {"order": 1, "degree": 1, "dimensions": [3, 10],
              "symbol": {"dimension": 7, "prolonged": 12, "characters": [3, 3, 1, 0]}}  # fmt: skip
FAR_AWAY = [
    ("-sin(x)-y'", "-y", FAR),
    ("x*cos(x)+y", "-sin(y)*x'", FAR),
    ("-sin(x)-x+y*x'", "-y^3+x'", "1" + "0" * 300),
    ("-y' + 0*exp(1)", "-y", "1" + "0" * 100),
]


@pytest.mark.slow
@pytest.mark.parametrize(("x", "y", "place"), FAR_AWAY)
def test_one_certificate_for_all_systems_proves_none(x: str, y: str, place: str) -> None:
    forged = certificate({"x": x, "y": y}, "existence", near={"y": place}, **DIMENSIONS)
    for seed in range(4):
        assert check_certificate(forged, seed=seed).verdict != "valid"
    assert (
        check(result_of(forged), {"equations": {"x": x.replace(" + 0*exp(1)", ""), "y": y}})[
            "verdict"
        ]
        != "valid"
    )


# --- 1.3, 1.4: Lagrangians of other systems
OSCILLATORS = "x'^2/2+y'^2/2-x^2/2-y^2"
FALSE_LAGRANGIANS = {
    "1.3 a factor that knows the precision": of_lagrangian(
        "x^2+y^2", "0", f"exp(-200-490*({D}))*(x'^2+y'^2)/2"
    ),
    "1.3 a switch": of_lagrangian(
        "x^2+y^2", "0", "exp(-445-245*tanh(1000*x))*(x'^2+y'^2)/2", near={"x": "0", "y": "0.5"}
    ),
    "1.4 a bell at 30": of_lagrangian(
        "-x+y*exp(-x^2)", "-2*y+x'*exp(-x^2)", OSCILLATORS, near={"x": "30"}
    ),
    "1.4 a tail at 900": of_lagrangian(
        "-exp(-x)*y'", "-2*x*exp(-x)", "x'^2/2+y'^2/2", near={"x": "900"}
    ),
    "1.4 a parameter of 1e300": of_lagrangian(
        "-a*sin(x)+y'",
        "-a*y",
        "x'^2/2+y'^2/2+a*cos(x)-a*y^2/2",
        near={"a": "1" + "0" * 300},
        parameters=["a"],
    ),
}


@pytest.mark.parametrize("name", FALSE_LAGRANGIANS)
def test_a_lagrangian_of_another_system_is_refused(name: str) -> None:
    forged = FALSE_LAGRANGIANS[name]
    for seed in range(4):
        assert check_certificate(forged, seed=seed).verdict == "invalid"
    given = {
        "equations": forged["system"]["equations"],
        "parameters": forged["system"].get("parameters", []),
    }
    assert check(result_of(forged), given)["verdict"] == "invalid"


# --- 1.4, 1.5: rows of another system
DECOUPLED = {"x": "x*x'^2+y'", "y": "-2*y"}
BELL = {"x": "x*x'^2+y'", "y": "-exp(-x^2)*x'-2*y"}
DAMPED = {"x": "-y'", "y": "-y"}
FREE = {"x": f"-(1-{D})*y' + 0*exp(1)", "y": "-y"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("true", "forged", "near"),
    [(DECOUPLED, BELL, {"x": "20"}), (DAMPED, FREE, {})],
    ids=["1.4", "1.5"],
)
def test_rows_of_another_system_prove_nothing(
    true: Document, forged: Document, near: Document
) -> None:
    """The same rows prove the claim for the other system, so the test is meaningful."""
    verdicts = []
    for order in (1, 2, 3):
        claim = {"order": order, "rows": all_rows(2, 4, order), "near": near}
        verdicts.append(check_certificate(certificate(true, "nonexistence", **claim)).verdict)
        assert check_certificate(certificate(forged, "nonexistence", **claim)).verdict != "valid"
    assert "valid" in verdicts


# --- 1.6: a document that is almost that of the certificate
def test_a_document_that_differs_by_little_is_another() -> None:
    honest = of_lagrangian(
        "-x*sqrt(1+x^2)", "-2*y", "x'^2/2-(1+x^2)^(3/2)/3+y'^2/2-y^2", near={"x": "30"}
    )
    given = {"equations": {"x": "-x*sqrt(1+x^2)+y'*exp(-x^2)", "y": "-2*y+exp(-x^2)*x"}}
    assert (
        check(result_of(honest), {"equations": honest["system"]["equations"]})["verdict"] == "valid"
    )
    assert check(result_of(honest), given)["verdict"] == "invalid"


# --- format 2: integrals
def integral(slope: str, by: str = "t") -> Document:
    return {"F": {"arguments": [by], "derivatives": {by: slope}}}


TIMED = {"question": "time_dependent"}


def test_an_integral_may_hold_those_before_it_only() -> None:
    """F'' = 1 + x'^2 through F' = G."""
    first, second = integral("1+x'^2", "x'")["F"], integral("G(x')", "x'")["F"]
    made = of_lagrangian("-1/(1+x'^2)", "0", "F(x')-x+y'^2")
    assert check_certificate({**made, "integrals": {"G": first, "F": second}}).verdict == "valid"
    turned = check_certificate({**made, "integrals": {"F": second, "G": first}})
    assert turned.verdict == "invalid"
    assert any("integrals.F" in reason for reason in turned.reasons)


@pytest.mark.parametrize(
    ("slope", "by", "lagrangian", "verdict"),
    [
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "valid"),
        ("F(w)", "w", "(x'^2+y'^2)/2-G(x^2+y^2)", "valid"),
        ("2*F(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)/2", "valid"),
        ("2*u*F(u^2)", "u", "(x'^2+y'^2)/2-G(sqrt(x^2+y^2))", "valid"),
        # at other arguments, too
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)+x'*G(x)", "valid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)+x'*G(y)", "invalid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)+G(2)*x*x'", "valid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2-y^2)", "invalid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2+2*y^2)", "invalid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-2*G(x^2+y^2)", "invalid"),
        ("F(u)+1", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        # no function of one variable
        ("F(u)*x", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(u)*x'", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(u)*t", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G(x^2,y^2)", "invalid"),
        ("F(u)", "u", "(x'^2+y'^2)/2-G'(x^2+y^2)", "invalid"),
        ("G(u)", "u", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        # names that are taken
        ("F(F)", "F", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(G)", "G", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(pi)", "pi", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
        ("F(x)", "x", "(x'^2+y'^2)/2-G(x^2+y^2)", "invalid"),
    ],
)
def test_a_function_of_one_variable_has_its_derivative_at_every_argument(
    slope: str, by: str, lagrangian: str, verdict: str
) -> None:
    """x'' = -2 x F(x^2 + y^2), y'' = -2 y F(x^2 + y^2): a central force, with any F."""
    made = of_lagrangian("-2*x*F(x^2+y^2)", "-2*y*F(x^2+y^2)", lagrangian)
    made["system"]["functions"] = {"F": ["u"]}
    known = {"G": {"arguments": [by], "derivatives": {by: slope}}}
    assert check_certificate({**made, "integrals": known}).verdict == verdict


@pytest.mark.parametrize(
    ("forces", "lagrangian", "slope", "verdict"),
    [
        ("-sqrt(1+(x*y)^3)*y -sqrt(1+(x*y)^3)*x", "(x'^2+y'^2)/2-G(x*y)", "sqrt(1+u^3)", "valid"),
        ("-sqrt(1+(x*y)^3)*y -sqrt(1+(x*y)^3)*x", "(x'^2+y'^2)/2+G(x*y)", "sqrt(1+u^3)", "invalid"),
        ("-log(x+y) -log(x+y)", "(x'^2+y'^2)/2-G(x+y)", "log(u)", "valid"),
        ("-log(2*x+2*y) -log(x+y)", "(x'^2+y'^2)/2-G(x+y)", "log(u)", "invalid"),
        ("0 0", "G(x'^2+y'^2)", "1/u", "valid"),
        ("0 0", "G(x'+y')", "exp(u^2)", "invalid"),  # it is singular
        ("0 0", "(x'^2+y'^2)/2+G(x+y)*(x'+y')", "cos(u)/u", "valid"),  # dG/dt, and not
        ("0 0", "(x'^2+y'^2)/2+G(x+y)*(x'-y')", "cos(u)/u", "invalid"),
    ],
)
def test_a_function_of_one_variable_may_have_any_derivative(
    forces: str, lagrangian: str, slope: str, verdict: str
) -> None:
    """By hand: the derivatives of G(w) are those of w times the formula at w."""
    made = of_lagrangian(*forces.split(), lagrangian)
    known = {"G": {"arguments": ["u"], "derivatives": {"u": slope}}}
    assert check_certificate({**made, "integrals": known}).verdict == verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "1/(cos(x/10^300)-1)",
        "log(1-cos(x/10^300/10^300))",
        "sin(x+2^(10^30))",
        "sin(x+2^(10^300))",
        "sin(x^(10^30))",
        "exp(exp(exp(exp(x))))",
        "atan(tan(x+2^(10^30)))",
        "log(2)^(10^300)",
        "+".join(f"log({2**49 + k})" for k in range(40)),
    ],
)
@pytest.mark.parametrize("place", ["1/3", "3"])
def test_numbers_of_any_size_leave_the_checker_alive(text: str, place: str) -> None:
    forged = of_lagrangian(f"-x+0*({text})", "0", "x'^2+y'^2", near={"x": place})
    assert check_certificate(forged, time_limit=5).verdict != "valid"


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", "null", "NaN", '"x"', "[" * 100_000, '{"a":' * 100_000, "1" * 100_000, '{"format": 1e999}',
        '{"format": "inverse-service/certificate/2", "format": "inverse-service/certificate/2"}',
        '{"format": "inverse-service/certificate/2", "system": {"coordinates": ["x", ["x"]], "equations": {"x": "0"}}}',
        '{"format": "inverse-service/result/1", "system": null}',
    ],
    ids=lambda text: text[:30],
)  # fmt: skip
def test_text_that_is_not_a_document_is_invalid(text: str) -> None:
    assert check_text(text).verdict == "invalid"


ODD = [None, 0, 1.5, True, "", [], {}, "F", "x'", "9" * 5000, 10**2000, "\ud800", [[[]]], ["x"] * 40, float("nan"),
       "x^x^x", "exp(exp(exp(exp(9))))", "(0)^(-1)", "sqrt(-1)", "\u00b2"]  # fmt: skip
MOTION = {"coordinates": ["r", "s"], "equations": {"r": "-r"}, "velocities": {"s": "r*r'"}}
HONEST = {
    "atoms": of_lagrangian(
        "-sin(x)", "-y", "x'^2/2+cos(x)+y'^2/2-y^2/2", near={"x": "1/3"}, conditions=["x > -3"],
        roots=[{"root": "sqrt((x+5)^2)", "is": "x+5"}],
    ),
    "integrals": of_lagrangian("-x", "0", "(x'^2+y'^2-x^2)/2+F(t)", integrals=integral("t"), **TIMED),
    "motion": {**of_lagrangian("0", "0", "r'^2-r^2"), "system": MOTION},
}  # fmt: skip


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = list(
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    return [path, *(place for key, part in items for place in places(part, (*path, key)))]


@pytest.mark.slow
@pytest.mark.parametrize("name", HONEST)
def test_no_oddity_at_any_place_ends_in_an_exception(name: str) -> None:
    for *path, last in places(HONEST[name])[1:]:
        for odd in ODD:
            changed = copy.deepcopy(HONEST[name])
            part: Any = changed
            for key in path:
                part = part[key]
            part[last] = odd
            assert check_certificate(changed, time_limit=2).verdict in (
                "valid",
                "incomplete",
                "invalid",
            )


def test_no_load_of_the_machine_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check does not use a clock that advances a minute per call."""
    minutes = itertools.count(0, 60)
    monkeypatch.setattr("time.monotonic", lambda: float(next(minutes)))
    one = result_of(of_lagrangian("-x", "-y", "x'^2+y'^2-x^2-y^2"))
    assert check(one, {"equations": one["system"]["equations"]})["verdict"] == "valid"


def test_a_branch_does_not_borrow_the_proof_of_another() -> None:
    honest = of_lagrangian("-x", "-y", "x'^2+y'^2-x^2-y^2")
    one = result_of(honest)
    branch = {key: one[key] for key in ("verdict", "certificate", "lagrangian")}
    assert check({**one, "branches": [branch]})["verdict"] == "valid"
    other = {"verdict": "variational", "domain": ["x > 0"]}
    assert check({**one, "branches": [branch, other]})["verdict"] == "incomplete"
    assert check({**one, "branches": [branch, {}]})["verdict"] != "valid"
