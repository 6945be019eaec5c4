"""The guarantees of the checker's arithmetic: primes, digits, bounds, and the meaning of
incomplete.
"""

from __future__ import annotations

from typing import Any

import pytest
from flint import fmpz

from inverse_service.certificate import checker, question as checks
from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.numbers import Balls, Residues
from tests.certificate.documents import Document, changed, existence, lagrangian, nonexistence


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The prime of each arithmetic that a check uses, 0 for balls."""
    made: list[int] = []

    class NotedResidues(Residues):
        def __init__(self, question: Any, prime: int, seed: int, choice: dict[int, int]) -> None:
            made.append(prime)
            super().__init__(question, prime, seed, choice)

    class NotedBalls(Balls):
        def __init__(self, question: Any, place: Any, classes: Any) -> None:
            made.append(0)
            super().__init__(question, place, classes)

    monkeypatch.setattr(checks, "Residues", NotedResidues)
    monkeypatch.setattr(checks, "Balls", NotedBalls)
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "count"),
    [
        (lagrangian("oscillator", "x'^2/2 - x^2/2"), 3),
        (nonexistence("douglas-IIIb", 2), 2),
        (existence("henon-heiles", 2, [1, 1], [0, 0]), 2),
    ],
)
def test_rational_documents_are_judged_modulo_random_primes_of_61_bits(
    document: Document, count: int, drawn: list[int]
) -> None:
    for seed in range(4):
        assert check_certificate(document, seed=seed).verdict == "valid"
    assert (
        len(set(drawn)) == len(drawn) == 4 * (count + 1)
    )  # the first only tests that f is defined
    assert all(prime.bit_length() == 61 and fmpz(prime).is_probable_prime() for prime in drawn)


@pytest.mark.parametrize(
    "document",
    [
        lagrangian("oscillator", "x'^2/2 - x^2/2 + 0*sin(x)"),
        nonexistence("knife-edge-first", 2, "time_dependent"),
        existence("spherical-pendulum", 2, [1, 1], [0, 0]),
    ],
)
def test_other_documents_are_judged_modulo_two_primes_and_in_balls(
    document: Document, drawn: list[int]
) -> None:
    assert check_certificate(document, seed=1).verdict == "valid"
    assert len({prime for prime in drawn if prime}) == 2
    assert 0 in drawn


def test_the_choices_repeat_with_a_seed_and_differ_without(drawn: list[int]) -> None:
    found = []
    for seed in (1, 1, 2, None, None):
        drawn.clear()
        check_certificate(lagrangian("free", "x'^2"), seed=seed)
        found.append(tuple(drawn))
    assert found[0] == found[1]
    assert len(set(found)) == 4


@pytest.mark.parametrize("digits", [13, 100, 300, 390])
def test_in_rational_formulas_no_error_is_too_small_to_be_seen(digits: int) -> None:
    text = f"x'^2/2 - x^2/2 + x^3/10^{digits}"
    assert check_certificate(lagrangian("oscillator", text), seed=1).verdict == "invalid"


@pytest.mark.parametrize("digits", [30, 45, 58])
def test_what_is_tiny_is_not_zero(digits: int) -> None:
    text = f"x'^2/2 - x^2/2 + exp(x)/10^{digits}"
    assert check_certificate(lagrangian("oscillator", text), seed=1).verdict == "invalid"
    rows = nonexistence("henon-heiles", 2)
    for size in (digits, 400):
        rows["system"]["equations"] = {"x": f"-x+exp(y)*y'^2/10^{size}", "y": "-2*y"}
        assert check_certificate(rows, seed=1).verdict == "valid"
    rows["system"]["equations"] = {"x": "-x", "y": "-2*y"}
    assert check_certificate(rows, seed=1).verdict == "invalid"


@pytest.mark.parametrize(
    "text",
    ["sin(1100+x)", "sin(10^300*x)", "exp(45)+x", "exp(-10^6+x)", "log(x^2+3000)", "sqrt(1025)*x", "(2+x)^1001",
     "(2+x)^-5000", "(2+x)^(10^30)", "(2+x^2)^123456789012345678901234567890", "exp(100000000000000000001*x)"],
)  # fmt: skip
def test_numbers_of_any_size_are_read(text: str) -> None:
    assert (
        check_certificate(
            lagrangian("free", f"x'^2/2 + 0*({text})", near={"x": "0.4"}), seed=1
        ).verdict
        == "valid"
    )
    assert (
        check_certificate(lagrangian("free", f"x'^2/2 + ({text})*x", near={"x": "0.4"})).verdict
        == "invalid"
    )


@pytest.mark.parametrize("text", ["((2+x)^4000)^4000", "9^4000^1*x + (10^390)^4000"])
def test_degrees_and_heights_beyond_the_bounds_make_incomplete(text: str) -> None:
    found = check_certificate(lagrangian("free", f"x'^2/2 + 0*({text})"), seed=1)
    assert found.verdict == "incomplete"
    assert "degree" in found.reasons[0]


@pytest.mark.parametrize("other", ["", " + 0*sin(x)"])
def test_a_declared_function_is_taken_at_numbers_of_any_length(other: str) -> None:
    """Numbers of 16,000 digits, which Python does not convert to text."""
    document = lagrangian("free", f"x'^2/2 + 0*A(((10^400)^20)^2){other}")
    document["system"]["functions"] = {"A": ["x"]}
    assert check_certificate(document, seed=1).verdict == "valid"


def test_a_number_without_an_inverse_modulo_the_prime_of_a_series_is_an_answer_not_a_fault() -> (
    None
):
    prime = 2**61 - 1
    series = {
        "order": 2,
        "point": {"x": "3", "x'": "5"},
        "prime": prime,
        "terms": [[[0, 2], f"1/{prime}"]],
    }
    for wrong in (
        series,
        {**series, "point": {"x": f"2/{3 * prime}", "x'": "5"}, "terms": [[[0, 2], "1"]]},
    ):
        found = check_certificate(
            existence("oscillator", 2, [1, 2], [1, 1, 1], series=wrong), seed=1
        )
        assert found.verdict == "invalid"
        assert "not defined" in found.reasons[0]
    system = existence(
        "oscillator", 2, [1, 2], [1, 1, 1], series={**series, "terms": [[[0, 2], "1"]]}
    )
    assert check_certificate(system, seed=1).verdict == "valid"
    assert (
        check_certificate(changed(system, "system.equations.x", f"-x/{prime}"), seed=1).verdict
        == "invalid"
    )


def test_expansions_of_too_many_terms_are_not_begun() -> None:
    names = [f"q{k}" for k in range(16)]
    document = existence("henon-heiles", 2, [1, 1], [0, 0])
    document["system"] = {"coordinates": names, "equations": dict.fromkeys(names, "0")}
    found = check_certificate(document, seed=1)
    assert found.verdict == "incomplete"
    assert "400000 terms" in found.reasons[0]


def test_a_stated_condition_on_pi_alone_is_read() -> None:
    """pi > 0 says nothing of pi + x, which is the pole of f."""
    certificate = {
        "format": checker.FORMAT,
        "system": {"coordinates": ["x"], "equations": {"x": "-1/(x + pi)^2"}},
        "question": "autonomous",
        "claim": "variational",
        "kind": "lagrangian",
        "lagrangian": "x'^2/2 + 1/(x + pi)",
    }
    proof = checker.check_certificate(certificate)
    assert checker.lacking_members(certificate, ["pi > 0"], proof.cell, 10.0) == (
        ["pi + x != 0"],
        set(),
    )
