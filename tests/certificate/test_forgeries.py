"""Deceptive certificates: none is valid, at any point, scale, precision, or form of the text.

Three families of false claims, each with every trick: a nonzero term that looks like zero (to reals
of any number of digits, at one chosen root, modulo a known prime), a zero term that does not look
like zero, and points far away.
"""

from __future__ import annotations

import random

import pytest

from inverse_service import check
from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import Document, all_rows
from tests.certificate.tricks import HIDDEN, TINY

FORMAT = "inverse-service/certificate/2"


def about(equations: dict[str, str], near: dict[str, str], **content: object) -> Document:
    system = {
        "coordinates": ["x", "y"],
        "equations": equations,
        "parameters": ["a"],
        "functions": {"A": ["x"]},
    }
    return {"format": FORMAT, "system": system, "question": "autonomous", "near": near, **content}


@pytest.mark.slow
@pytest.mark.parametrize("trick", TINY)
def test_a_term_that_looks_like_zero_is_not_zero(trick: str) -> None:
    """Two oscillators with a coupling that has no Lagrangian, times a term that looks like zero."""
    text, near = TINY[trick]
    equations = {"x": f"-x+({text})*y", "y": f"-2*y+({text})*x'*x"}
    claim = {"claim": "variational", "kind": "lagrangian", "lagrangian": "(x'^2-x^2)/2+y'^2/2-y^2"}
    found = check_certificate(about(equations, near, **claim))
    assert found.verdict != "valid", found.reasons


@pytest.mark.slow
@pytest.mark.parametrize("trick", TINY)
def test_a_false_lagrangian_times_an_apparent_zero_is_rejected(trick: str) -> None:
    text, near = TINY[trick]
    claim = {"claim": "variational", "kind": "lagrangian", "lagrangian": f"({text})*(x'^2+y'^2)/2"}
    found = check_certificate(about({"x": "x^2+y^2", "y": "0"}, near, **claim))
    assert found.verdict != "valid", found.reasons


@pytest.mark.slow
@pytest.mark.parametrize("trick", HIDDEN)
@pytest.mark.parametrize("order", [1, 2])
def test_a_term_that_is_zero_excludes_nothing(trick: str, order: int) -> None:
    """The coupling is multiplied by the zero term, so these are two uncoupled oscillators."""
    text, near = HIDDEN[trick]
    equations = {"x": f"-x-({text})*y'", "y": f"-2*y+({text})*x*x'"}
    rows = all_rows(2, 4, order)
    claim = {"claim": "not_variational", "kind": "nonexistence", "order": order, "rows": rows}
    found = check_certificate(about(equations, near, **claim))
    assert found.verdict != "valid", found.reasons


NOT_VARIATIONAL = {
    "sine": {"x": "-sin(x)-y'", "y": "-y"},
    "product": {"x": "x*cos(x)+y", "y": "-sin(y)*x'"},
    "cubic": {"x": "-sin(x)-x+y*x'", "y": "-y^3+x'"},
    "rational in disguise": {"x": "-y'+0*exp(1)", "y": "-y"},
    "Douglas IIIb": {"x": "x^2+y^2+0*sin(x)", "y": "0"},
}
DATA = {"order": 1, "degree": 1, "dimensions": [3, 10],
        "symbol": {"dimension": 7, "prolonged": 12, "characters": [3, 3, 1, 0]}}  # fmt: skip


@pytest.mark.parametrize("name", NOT_VARIATIONAL)
@pytest.mark.parametrize(
    "near", [{"y": "1" + "0" * 80}, {"y": "1" + "0" * 300}, {"x'": "1e90"}, {"x": "1e-90"}, {}]
)
def test_numbers_from_far_away_prove_no_existence(name: str, near: dict[str, str]) -> None:
    document = about(NOT_VARIATIONAL[name], near, claim="variational", kind="existence", **DATA)
    assert check_certificate(document).verdict != "valid"


def test_rows_near_a_special_place_prove_no_nonexistence() -> None:
    """x'' = x x'^2 + y', y'' = -exp(-x^2) x' - 2 y has a Lagrangian; near x = 20 it looks like one
    that has none.
    """
    equations = {"x": "x*x'^2+y'", "y": "-exp(-x^2)*x'-2*y"}
    for order in (1, 2, 3):
        claim = {
            "claim": "not_variational",
            "kind": "nonexistence",
            "order": order,
            "rows": all_rows(2, 4, order),
        }
        assert check_certificate(about(equations, {"x": "20"}, **claim)).verdict != "valid"


def test_a_document_is_compared_by_the_same_rules() -> None:
    """Near x = 30 these two differ by 1e-391."""
    certificate = about({"x": "-x*sqrt(1+x^2)", "y": "-2*y"}, {"x": "30"}, claim="variational", kind="lagrangian",
                        lagrangian="x'^2/2-(1+x^2)^(3/2)/3+y'^2/2-y^2")  # fmt: skip
    certificate["system"]["functions"], certificate["system"]["parameters"] = {}, []
    assert check_certificate(certificate).verdict == "valid"
    other = {"equations": {"x": "-x*sqrt(1+x^2)+y'*exp(-x^2)", "y": "-2*y+exp(-x^2)*x"}}
    assert check(certificate, other)["verdict"] == "invalid"


KINETIC = {"claim": "variational", "kind": "lagrangian", "lagrangian": "x'^2/2+y'^2/2"}
SQUARE = {"x": "(sqrt(x^2)-x)*y'", "y": "0"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parts", "verdict"),
    [
        ({"conditions": ["x > 0"]}, "valid"),
        ({"roots": [{"root": "sqrt(x^2)", "is": "x"}]}, "valid"),
        ({}, "incomplete"),
        ({"conditions": ["x < 0"]}, "incomplete"),  # does not hold at the point
        ({"conditions": ["x > 2"]}, "incomplete"),  # nor does equality
        ({"conditions": ["0 > 0", "x > 0"]}, "incomplete"),
        ({"conditions": ["x != 0"]}, "invalid"),
        ({"conditions": ["x > 0 > y"]}, "invalid"),
        ({"roots": [{"root": "sqrt(x^2)", "is": "-x"}]}, "incomplete"),
        ({"roots": [{"root": "sqrt(x^2)", "is": "x+1/10^300"}]}, "incomplete"),
        ({"roots": [{"root": "sqrt(x^2)", "is": "2*x"}]}, "invalid"),
        ({"roots": [{"root": "0*y", "is": "x"}]}, "invalid"),
        # No root restricts x, so x would be positive at the point only, and U is the whole plane.
        *(
            ({"roots": [{"root": root, "is": "x"}]}, "invalid")
            for root in (
                "x",
                "(x)",
                "0+sqrt(x^2)",
                "sqrt(x^2)*1",
                "(x)*(1)",
                "(x^2)^(1/2)+0",
                "x+sqrt(y^2)-sqrt(y^2)",
                "(x)^(1)",
                "(x)+(0)^(1/2)",
                "sqrt(x^2)^(1)",
                "(x)^(2)^(1/2)",
                "sqrt",
                "exp(log(x))",
            )
        ),
        ({"roots": [{"root": "(x^2)^(1/2)", "is": "x"}]}, "valid"),
        ({"near": {"x": "-2"}, "conditions": ["x > 0"]}, "incomplete"),
        ({"near": {"x": "-2"}, "roots": [{"root": "sqrt(x^2)", "is": "x"}]}, "incomplete"),
        ({"near": {"x": "-2"}, "conditions": ["x < 0"]}, "invalid"),
        ({"near": {"x": "-2"}, "roots": [{"root": "sqrt(x^2)", "is": "-x"}]}, "invalid"),
    ],
    ids=str,
)
def test_conditions_and_roots_have_to_hold(parts: Document, verdict: str) -> None:
    found = check_certificate({**about(SQUARE, {"x": "2"}, **KINETIC), **parts})
    assert found.verdict == verdict, found.reasons


def test_a_certificate_of_format_1_proves_too_little() -> None:
    document = {
        **about({"x": "0", "y": "0"}, {}, **KINETIC),
        "format": "inverse-service/certificate/1",
    }
    found = check_certificate(document)
    assert (found.verdict, found.reasons) == (
        "incomplete",
        ("Format 1 proves too little; solve again.",),
    )


@pytest.mark.nightly
def test_random_combinations_of_forgeries_are_rejected() -> None:
    """Sums and products of tricks, at points of all sizes."""
    chance, names = random.Random(7), list(TINY)
    # A formula of another branch is zero there, and the claim is true: at most one, in its place.
    single = names[: names.index("the other branch of a square root")]
    for _ in range(400):
        first, second = TINY[chance.choice(names)], TINY[chance.choice(single)]
        text = chance.choice(["({})*({})", "({})+({})*exp(-7)", "({})^2-3*({})^3"]).format(
            first[0], second[0]
        )
        near = second[1] | first[1] | {"y'": chance.choice(["1e-80", "1e80", "3/7"])}
        equations = {"x": f"-x+({text})*y", "y": f"-2*y+({text})*x'*x"}
        claim = {
            "claim": "variational",
            "kind": "lagrangian",
            "lagrangian": "(x'^2-x^2)/2+y'^2/2-y^2",
        }
        assert check_certificate(about(equations, near, **claim)).verdict != "valid", (text, near)


ROOTS = [  # a factor, the inequalities, whether it is zero: for roots that are products of roots
    ("sqrt(1-x^2) - sqrt(1-x)*sqrt(1+x)", ["x < 1", "x > -1"], True),
    ("sqrt(1-x^2) + sqrt(1-x)*sqrt(1+x)", ["x < 1", "x > -1"], False),
    ("sqrt((x-1)^2) - x + 1", ["x > 1"], True),
    ("sqrt((x-1)^2) - x + 1", ["x < 1"], False),
    ("sqrt(sqrt(x^2+1)+x)*sqrt(sqrt(x^2+1)-x) - 1", [], True),
    ("sqrt(sqrt(x^2+1)+x)*sqrt(sqrt(x^2+1)-x) + 1", [], False),
    (
        "(1-x)^(1/3)*(1+x)^(2/3)*(1-x)^(1/3)*(1+x)^(2/3) - (1-x)^(2/3)*(1+x)^(4/3)",
        ["x < 1", "x > -1"],
        True,
    ),
    ("(1-x)^(1/3)*(1+x)^(2/3) - (1-x)^(2/3)*(1+x)^(1/3)", ["x < 1", "x > -1"], False),
    ("(1-x)^(1/4)*(1+x)^(1/4) - sqrt(sqrt(1-x^2))", ["x < 1", "x > -1"], True),
    ("(1-x)^(1/4)*(1+x)^(3/4) - (1-x^2)^(3/4)", ["x < 1", "x > -1"], False),
    ("sqrt((1-x^2)*(2+x))*sqrt((1-x)*(2+x)) - (1-x)*(2+x)*sqrt(1+x)", ["x < 1", "x > -1"], True),
    ("sqrt((1-x^2)*(2+x))*sqrt((1-x)*(2+x)) + (1-x)*(2+x)*sqrt(1+x)", ["x < 1", "x > -1"], False),
]


@pytest.mark.parametrize(("factor", "conditions", "zero"), ROOTS)
def test_products_of_roots_differ_from_those_with_another_sign(
    factor: str, conditions: list[str], zero: bool
) -> None:
    near = {"x": "3" if conditions == ["x > 1"] else "0.3"}
    system = {"coordinates": ["x"], "equations": {"x": "0"}}
    claim = {"claim": "variational", "kind": "lagrangian", "lagrangian": f"x'^2 + x*({factor})"}
    proof = {
        "format": FORMAT,
        "system": system,
        "question": "autonomous",
        "near": near,
        "conditions": conditions,
        **claim,
    }
    assert check_certificate(proof).verdict == ("valid" if zero else "invalid")


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 8])
@pytest.mark.parametrize("spoiled", [False, True])
def test_each_velocity_of_many_relativistic_particles_has_two_bounds(
    count: int, spoiled: bool
) -> None:
    """L = -sum sqrt(1 - v^2) - V on abs(v) < 1 (Goldstein, 7.9): 2^count choices of the roots, not
    4^count.
    """
    names = [f"x{k}" for k in range(count)]
    forces = {"x0": "-x1*(1-x0'^2)^(3/2)", "x1": "-x0*(1-x1'^2)^(3/2)"}
    equations = dict.fromkeys(names, "0") | forces
    energy = "x0*x1" if not spoiled else "x0*x1*(1+x2/1000)"
    proof = {
        "format": FORMAT, "system": {"coordinates": names, "equations": equations}, "question": "autonomous",
        "conditions": [f"{q}' {bound}" for q in names for bound in ("< 1", "> -1")], "claim": "variational",
        "kind": "lagrangian", "lagrangian": "-".join(["", *(f"sqrt(1-{q}'^2)" for q in names), energy]),
    }  # fmt: skip
    found = check_certificate(proof)
    assert found.verdict == ("invalid" if spoiled else "valid"), found.reasons
