"""Rows that leave a regular multiplier prove nothing; rows that leave none prove nonexistence."""

from __future__ import annotations

import random
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import changed, nonexistence

RIGHT = [
    ("douglas-IIIb", 2, "autonomous"),
    ("douglas-IIIb", 2, "time_dependent"),
    ("damped-henon-heiles", 2, "autonomous"),
    ("differential-obstruction", 3, "autonomous"),
    ("differential-obstruction", 3, "time_dependent"),
    ("poynting-robertson", 2, "autonomous"),
    ("knife-edge-first", 2, "time_dependent"),
    ("lie-A4,7", 3, "autonomous"),
    ("robot-second", 2, "time_dependent"),
]

WRONG = [
    ("free", 2, "autonomous"),
    ("van-der-pol", 3, "autonomous"),
    ("henon-heiles", 3, "autonomous"),
    ("henon-heiles", 3, "time_dependent"),
    ("damped-henon-heiles", 3, "time_dependent"),
    ("differential-obstruction", 2, "autonomous"),
    ("spherical-pendulum", 3, "autonomous"),
    ("central-sine", 3, "autonomous"),
    ("generic-second", 2, "autonomous"),
    ("painleve-I", 3, "time_dependent"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "order", "question"), RIGHT)
def test_all_rows_of_a_sufficient_order_are_valid(name: str, order: int, question: str) -> None:
    found = check_certificate(nonexistence(name, order, question), seed=1)
    assert found.verdict == "valid", found.reasons


@pytest.mark.parametrize(("name", "order", "question"), WRONG)
def test_systems_with_a_multiplier_left_are_not_refuted(
    name: str, order: int, question: str
) -> None:
    found = check_certificate(nonexistence(name, order, question), seed=1)
    assert found.verdict == "invalid", found.reasons
    assert "regular" in found.reasons[0]


def test_sin_2u_is_not_independent_of_sin_u() -> None:
    """With an independent function S(u) instead of sin(2 u) the rows refute; with sin(2 u) they do
    not.
    """
    trap = nonexistence("spherical-pendulum", 2)
    independent = changed(trap, "system.equations.u", "S(u)/2*w'^2 - G*sin(u)")
    independent["system"]["functions"] = {"S": ["u"]}
    assert check_certificate(independent, seed=1).verdict == "valid"
    assert check_certificate(trap, seed=1).verdict == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("exp(x+y)", "exp(x)*exp(y)"),
        ("sqrt(x^2*y^2+x^2)", "x*sqrt(y^2+1)"),
        ("sqrt(8)", "2*sqrt(2)"),
        ("log(9)", "2*log(3)"),
    ],
)
def test_dependent_atoms_refute_nothing(written: str, meant: str) -> None:
    """The system is a disguised x'' = y, y'' = x, which has a Lagrangian."""
    document = nonexistence("henon-heiles", 3)
    extra = f"({written} - {meant})"
    document["system"]["equations"] = {"x": f"y + {extra}*x'*y", "y": f"x - {extra}*y'^2"}
    document["near"] = {"x": "1", "y": "1"}
    document["conditions"] = ["x > 0"]
    assert check_certificate(document, seed=1).verdict == "invalid"
    document["conditions"] = []
    assert check_certificate(document, seed=1).verdict in ("invalid", "incomplete")


def test_a_few_rows_that_suffice_are_valid_and_fewer_are_not() -> None:
    """Every row of a minimal set is needed."""
    document = nonexistence("douglas-IIIb", 2)
    rows = list(document["rows"])
    generator = random.Random(5)
    for row in generator.sample(rows, len(rows)):
        rest = [other for other in rows if other != row]
        if check_certificate({**document, "rows": rest}, seed=1).verdict == "valid":
            rows = rest
    assert 0 < len(rows) < 20
    assert check_certificate({**document, "rows": rows}, seed=2).verdict == "valid"
    for row in rows:
        rest = [other for other in rows if other != row]
        assert check_certificate({**document, "rows": rest}, seed=3).verdict == "invalid"


def test_rows_of_one_condition_alone_do_not_refute() -> None:
    document = nonexistence("douglas-IIIb", 2)
    for kind in ("H2", "H3"):
        rows = [row for row in document["rows"] if row[0] == kind and sum(row[3]) == 0]
        assert check_certificate({**document, "rows": rows}, seed=1).verdict == "invalid"


def test_another_system_under_the_rows_is_refused() -> None:
    document = nonexistence("douglas-IIIb", 2)
    assert (
        check_certificate(changed(document, "system.equations.x", "x^2"), seed=1).verdict
        == "invalid"
    )
    assert (
        check_certificate(changed(document, "system.equations.y", "2*x*y"), seed=1).verdict
        == "invalid"
    )


def test_special_values_of_parameters_are_not_the_generic_ones() -> None:
    """x'' = -a x' + b y, y'' = x has a Lagrangian only where a = 0."""
    document = nonexistence("henon-heiles", 2)
    document["system"] |= {"equations": {"x": "-a*x' + b*y", "y": "x"}, "parameters": ["a", "b"]}
    assert check_certificate(document, seed=1).verdict == "valid"
    special = changed(changed(document, "system.parameters", ["b"]), "system.equations.x", "b*y")
    assert check_certificate(special, seed=1).verdict == "invalid"


def test_a_value_at_which_powers_cancel_is_excluded() -> None:
    """x'' = y'^n - 1/y', y'' = -y has no Lagrangian, but for n = -1, where x is free."""
    document = nonexistence("henon-heiles", 2)
    document["system"] |= {
        "equations": {"x": "y'^n - 1/y'", "y": "-y"}, "parameters": ["n"]
    }  # fmt: skip
    found = check_certificate(document, seed=1)
    assert found.verdict == "valid"
    assert "n = -1" in found.exceptions


def test_the_value_of_a_constant_under_a_root_is_excluded() -> None:
    """x'' = (sqrt(a) - 2) x' + y, y'' = x has a Lagrangian only where a = 4."""
    document = nonexistence("henon-heiles", 2)
    document["system"] |= {
        "equations": {"x": "(sqrt(a) - 2)*x' + y", "y": "x"}, "parameters": ["a"]
    }  # fmt: skip
    found = check_certificate(document, seed=1)
    assert found.verdict == "valid"
    assert "a = 4" in found.exceptions


BAD_ROWS: list[Any] = [
    [], None, {}, "rows", 7, [[]], [["H2"]], [["H2", 0, 0, [0, 0, 0, 0], 1]], [["H1", 0, 0, [0, 0, 0, 0]]],
    [["H2", 1, 0, [0, 0, 0, 0]]], [["H3", 0, 0, [0, 0, 0, 0]]], [["H2", 0, 2, [0, 0, 0, 0]]],
    [["H2", -1, 0, [0, 0, 0, 0]]], [["H2", 0, 0, [0, 0, 0]]], [["H2", 0, 0, [0, 0, 0, 0, 0]]],
    [["H2", 0, 0, [2, 0, 0, 0]]], [["H3", 0, 1, [1, 1, 1, 0]]], [["H3", 0, 1, [-1, 1, 0, 0]]],
    [["H2", 0.0, 0, [0, 0, 0, 0]]], [["H2", True, True, [0, 0, 0, 0]]], [["H2", 0, 0, [0, 0, 0, "0"]]],
    [["H2", 0, 0, [0, 0, 0, 10**5000]]], [["H2", 0, 0, None]], [[["H2"], 0, 0, [0, 0, 0, 0]]], [None] * 50,
    [["H2", 0, 0, [0, 0, 0, 0]], ["H2", 0, 0, [0, 0, 0, 0]]],
]  # fmt: skip


@pytest.mark.parametrize("rows", BAD_ROWS)
def test_rows_that_are_none_make_the_certificate_invalid(rows: Any) -> None:
    assert (
        check_certificate(nonexistence("douglas-IIIb", 2, rows=rows), seed=1).verdict == "invalid"
    )


def test_one_row_named_twice_is_refused() -> None:
    document = nonexistence("douglas-IIIb", 2)
    doubled = {**document, "rows": [*document["rows"], document["rows"][-1]]}
    found = check_certificate(doubled, seed=1)
    assert found.verdict == "invalid"
    assert "twice" in found.reasons[0]


@pytest.mark.parametrize("order", [0, 1, -1, 21, 10**400, 2.0, "2", None, True, [2]])
def test_an_order_too_low_or_out_of_range_is_refused(order: Any) -> None:
    assert (
        check_certificate({**nonexistence("douglas-IIIb", 2), "order": order}, seed=1).verdict
        == "invalid"
    )


def test_one_equation_is_never_refuted() -> None:
    for name in ("free", "oscillator", "van-der-pol"):
        assert check_certificate(nonexistence(name, 4), seed=1).verdict == "invalid"


def test_the_time_limit_ends_the_check() -> None:
    for limit in (0, -1, float("nan"), 0.05):
        found = check_certificate(nonexistence("lie-A4,7", 3), time_limit=limit, seed=1)
        assert found.verdict == "incomplete"
        assert "time limit" in found.reasons[0]


@pytest.mark.slow
def test_the_verdict_does_not_hang_on_the_seed() -> None:
    for seed in (*range(20), None):
        assert (
            check_certificate(nonexistence("differential-obstruction", 3), seed=seed).verdict
            == "valid"
        )
        assert (
            check_certificate(nonexistence("differential-obstruction", 2), seed=seed).verdict
            == "invalid"
        )
        assert (
            check_certificate(nonexistence("poynting-robertson", 2), seed=seed).verdict == "valid"
        )


def test_seven_rows_of_h3_alone_suffice_and_six_do_not() -> None:
    """Phi is expanded as far as H3 needs it even if no row of H2 is listed."""
    first = [(0, 1), (0, 2), (0, 3), (1, 2)]
    rows = [["H3", i, j, [0] * 8] for i, j in first]
    rows += [
        ["H3", i, j, [int(a == b) for b in range(8)]]
        for i, j, a in ((1, 2, 7), (1, 3, 6), (2, 3, 5))
    ]
    assert check_certificate(nonexistence("lie-A4,7", 1, rows=rows), seed=1).verdict == "valid"
    for left_out in rows:
        fewer = nonexistence("lie-A4,7", 1, rows=[row for row in rows if row is not left_out])
        assert "leave a regular multiplier" in check_certificate(fewer, seed=1).reasons[0]
