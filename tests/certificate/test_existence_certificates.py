"""Existence is accepted only with the right dimensions, a regular value and an involutive
symbol.
"""

from __future__ import annotations

from typing import Any

import pytest
from sympy import Expr

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import certificate, changed, existence
from tests.certificate.reference import Forces, Reference

TIMED = "time_dependent"
RIGHT: list[tuple[str, int, list[int], list[int], str]] = [
    ("free", 1, [1, 2], [1, 1, 1], "autonomous"),
    ("oscillator", 2, [1, 2], [1, 1, 1, 0], "autonomous"),
    ("oscillator", 2, [1, 2, 3], [1, 1, 1, 0], "autonomous"),
    ("van-der-pol", 2, [1, 2], [1, 1, 1], "autonomous"),
    ("van-der-pol", 2, [1, 3], [2, 3, 1, 1], TIMED),
    ("painleve-I", 2, [1, 3], [2, 3, 1, 1, 0], TIMED),
    ("free-pair", 2, [3, 8], [5, 7, 3, 2], "autonomous"),
    ("free-pair", 3, [3, 8, 15], [7, 9, 5, 2, 0, 0], "autonomous"),
    ("henon-heiles", 2, [1, 1], [0, 0], "autonomous"),
    ("henon-heiles", 2, [1, 1], [0, 0, 0, 0, 0, 0, 0], TIMED),
    ("damped-henon-heiles", 2, [1, 1], [0, 0], TIMED),
    ("spherical-pendulum", 2, [1, 1], [0, 0], "autonomous"),
]


def free_pair(t: Expr, x: Expr, y: Expr, v: Expr, w: Expr) -> list[Expr]:
    return [0 * x, 0 * y]


def henon_heiles(t: Expr, x: Expr, y: Expr, v: Expr, w: Expr) -> list[Expr]:
    return [-x - 2 * x * y, -y - x**2 + y**2]


def damped(t: Expr, x: Expr, y: Expr, v: Expr, w: Expr) -> list[Expr]:
    return [-x - 2 * x * y - v, -y - x**2 + y**2 - w]


def painleve(t: Expr, x: Expr, v: Expr) -> list[Expr]:
    return [6 * x**2 + t]


def oscillator(t: Expr, x: Expr, v: Expr) -> list[Expr]:
    return [-x]


REFERENCES: dict[str, Forces] = {
    "free-pair": free_pair,
    "henon-heiles": henon_heiles,
    "damped-henon-heiles": damped,
    "painleve-I": painleve,
    "oscillator": oscillator,
}


@pytest.mark.parametrize(("name", "order", "dimensions", "symbol", "question"), RIGHT)
def test_right_data_are_valid(
    name: str, order: int, dimensions: list[int], symbol: list[int], question: str
) -> None:
    found = check_certificate(existence(name, order, dimensions, symbol, question), seed=1)
    assert found.verdict == "valid", found.reasons


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "order", "dimensions", "symbol", "question"),
    [one for one in RIGHT if one[0] in REFERENCES],
)
def test_the_right_data_are_those_of_the_definition(
    name: str, order: int, dimensions: list[int], symbol: list[int], question: str
) -> None:
    """The reference finds the dimensions and, at the next order, the growth that the characters
    predict.
    """
    n = len(existence(name, order, dimensions, symbol)["system"]["coordinates"])
    reference = Reference(
        REFERENCES[name], n, question == TIMED, [3, 5, 7, 11, 13][: 2 * n + (question == TIMED)]
    )
    degree = len(dimensions) - 1
    assert reference.dimensions(order)[: degree + 1] == dimensions
    later = reference.dimensions(order + 1)
    assert later[: degree + 1] == dimensions
    assert symbol[0] == dimensions[-1] - dimensions[-2] == sum(symbol[2:])
    assert symbol[1] == sum(k * a for k, a in enumerate(symbol[2:], start=1))
    if order > degree:
        assert later[degree + 1] - later[degree] == symbol[1]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "order", "dimensions", "symbol", "question"), RIGHT)
def test_every_number_matters(
    name: str, order: int, dimensions: list[int], symbol: list[int], question: str
) -> None:
    document = existence(name, order, dimensions, symbol, question)
    for k in range(len(dimensions)):
        for wrong in (dimensions[k] + 1, dimensions[k] - 1):
            assert (
                check_certificate(changed(document, f"dimensions.{k}", wrong), seed=1).verdict
                == "invalid"
            )
    for key in ("dimension", "prolonged"):
        wrong = document["symbol"][key] + 1
        assert (
            check_certificate(changed(document, f"symbol.{key}", wrong), seed=1).verdict
            == "invalid"
        )


@pytest.mark.parametrize(
    ("symbol", "name"),
    [
        ([5, 7, 2, 3], "free-pair"), ([5, 7, 4, 0, 1], "free-pair"), ([5, 7, 3, 2, 0, 0, 0], "free-pair"),
        ([5, 7, 0, 0, 3, 2], "free-pair"), ([5, 5, 5], "free-pair"), ([0, 0], "free-pair"), ([5, 7], "free-pair"),
        ([1, 2, 0, 1], "oscillator"), ([1, 1, 1, 1], "oscillator"),
    ],
)  # fmt: skip
def test_false_characters_are_refused(symbol: list[int], name: str) -> None:
    dimensions = {"free-pair": [3, 8], "oscillator": [1, 2]}[name]
    assert check_certificate(existence(name, 2, dimensions, symbol), seed=1).verdict == "invalid"


def test_dimensions_that_still_fall_are_refused() -> None:
    """At order 1 the free pair has D_1 = 10, at order 2 only 8; Henon-Heiles has D_2 = 7, then
    1.
    """
    assert (
        check_certificate(existence("free-pair", 1, [3, 10], [7, 9, 5, 2]), seed=1).verdict
        == "invalid"
    )
    assert (
        check_certificate(existence("henon-heiles", 2, [1, 1, 7], [6, 0, 6]), seed=1).verdict
        == "invalid"
    )


def test_a_differential_obstruction_is_not_passed_over() -> None:
    """Every algebraic condition leaves one regular g(p); the order-3 system kills it."""
    for order, dimensions in ((1, [1, 1]), (2, [1, 1]), (2, [1, 0]), (3, [0, 0]), (3, [1, 1])):
        document = existence("differential-obstruction", order, dimensions, [0, 0])
        assert check_certificate(document, seed=1).verdict == "invalid"


def test_systems_without_a_regular_multiplier_have_no_existence() -> None:
    for dimensions, symbol in (([1, 2], [1, 1, 1]), ([1, 2], [0, 0]), ([1, 1], [0, 0])):
        assert (
            check_certificate(existence("douglas-IIIb", 2, dimensions, symbol), seed=1).verdict
            == "invalid"
        )
    assert (
        check_certificate(existence("damped-henon-heiles", 2, [0, 0], [0, 0]), seed=1).verdict
        == "invalid"
    )


def test_data_of_one_question_do_not_settle_the_other() -> None:
    assert (
        check_certificate(existence("van-der-pol", 2, [1, 2], [1, 1, 1], TIMED), seed=1).verdict
        == "invalid"
    )
    assert (
        check_certificate(existence("van-der-pol", 2, [1, 3], [2, 3, 1, 1]), seed=1).verdict
        == "invalid"
    )
    assert (
        check_certificate(existence("damped-henon-heiles", 2, [1, 1], [0, 0]), seed=1).verdict
        == "invalid"
    )


BAD: list[tuple[str, Any]] = [
    ("order", 0), ("order", 21), ("order", "2"), ("order", 2.0), ("order", ...), ("degree", 0), ("degree", 3),
    ("degree", True), ("degree", 2), ("dimensions", [1]), ("dimensions", []), ("dimensions", None),
    ("dimensions.0", -1),
    ("dimensions", [1, 1, 1]), ("dimensions.0", 10**400), ("dimensions.1", "1"), ("symbol", ...), ("symbol", []),
    ("symbol.dimension", ...), ("symbol.dimension", None), ("symbol.characters", ...), ("symbol.characters", [0] * 5),
    ("symbol.characters", [0, -1, 1]), ("symbol.prolonged", 0.0), ("claim", "not_variational"),
    ("kind", "nonexistence"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value"), BAD)
def test_malformed_data_are_invalid(path: str, value: Any) -> None:
    document = existence("henon-heiles", 2, [1, 1], [0, 0, 0, 0, 0, 0])
    assert check_certificate(document, seed=1).verdict == "valid"
    assert check_certificate(changed(document, path, value), seed=1).verdict == "invalid"


def oscillator_series(prime: int | None) -> dict[str, Any]:
    """L = (v^2 - x^2)/2 about (x, v) = (3, 5): its only coefficient of v-degree two or more is
    1/2.
    """
    half = "1/2" if prime is None else str(pow(2, -1, prime))
    return {"order": 2, "point": {"x": "3", "x'": 5}, "prime": prime, "terms": [[[0, 2], half]]}


@pytest.mark.parametrize("prime", [None, 2**61 - 1])
def test_the_series_of_a_regular_solution_is_compared(prime: int | None) -> None:
    document = existence("oscillator", 2, [1, 2], [1, 1, 1], series=oscillator_series(prime))
    found = check_certificate(document, seed=1)
    assert found.verdict == "valid"
    assert "series" in found.reasons[0]


@pytest.mark.parametrize("prime", [None, 2**61 - 1])
@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("terms", []), ("terms.0.1", "0"), ("terms", [[[0, 2], "1"], [[1, 2], "1"]]),
        ("terms", [[[0, 2], "1"], [[0, 3], 1]]),
        ("terms.0.0", [2]), ("terms.0.0", [0, 5]), ("terms.0", [[0, 2]]), ("terms.0.1", "1e333"), ("terms.0.1", None),
        ("point", {"x": "3"}), ("point", {}), ("point.x", "NaN"), ("order", 30), ("prime", 15), ("prime", 2**61),
        ("prime", 7), ("prime", -1), ("terms", {"0": 1}), ("terms.0.1", "1/0"),
    ],
)  # fmt: skip
def test_a_series_that_is_not_a_regular_solution_is_rejected(
    prime: int | None, path: str, value: Any
) -> None:
    series = changed(oscillator_series(prime), path, value)
    assert (
        check_certificate(
            existence("oscillator", 2, [1, 2], [1, 1, 1], series=series), seed=1
        ).verdict
        == "invalid"
    )


@pytest.mark.slow
def test_ranks_that_a_hidden_zero_makes_smaller_are_not_proven() -> None:
    """The number is 0, which the checker cannot see for such a small part of pi; the system has
    more multipliers.
    """
    zero = "(1+2*(" + "+".join(f"cos({k}*2*pi/61)" for k in range(1, 31)) + "))"
    right = existence("henon-heiles", 2, [1, 1], [0, 0])
    for factor, verdict in (("cos(pi/61)", "valid"), (zero, "incomplete")):
        equations = {"x": f"-x-2*{factor}*x*y", "y": f"-y-{factor}*(x^2-y^2)"}
        found = check_certificate(
            right | {"system": {"coordinates": ["x", "y"], "equations": equations}}, seed=1
        )
        assert found.verdict == verdict, found.reasons


@pytest.mark.parametrize(
    "force", ["-x-(x^2-1)*x'", "sin(x*x')*exp(x'^3)+sqrt(1+x^2)", "log(x)*x'^5/(x-x')"]
)
def test_of_one_coordinate_existence_is_a_theorem(force: str) -> None:
    proof = certificate("oscillator", "existence", order=1, degree=1, dimensions=[1, 2],
                        symbol={"dimension": 1, "prolonged": 1, "characters": [1]})  # fmt: skip
    proof["system"]["equations"] = {"x": force}
    found = check_certificate(proof, seed=1)
    assert (found.verdict, "Sonin" in found.reasons[0]) == ("valid", True)
