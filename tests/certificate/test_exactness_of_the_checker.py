"""What the checker promises of its own numbers: its primes, its digits, its bounds, the meaning of incomplete."""

from __future__ import annotations

from typing import Any

import mpmath
import pytest

from inverse_service.certificate import checker
from inverse_service.certificate.checker import Arithmetic, Elimination, Ended, Undefined, check_certificate
from tests.certificate.documents import Document, changed, existence, lagrangian, nonexistence
from tests.certificate.test_arithmetic_of_the_checker import reals


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """(prime, bits) of each arithmetic that a check makes."""
    made: list[tuple[int, int]] = []

    class Noted(Arithmetic):
        def __init__(self, question: Any, prime: int = 0, bits: int = 0, cut: int = 0, gap: int = 0) -> None:
            made.append((prime, bits))
            super().__init__(question, prime, bits, cut, gap)

    monkeypatch.setattr(checker, "Arithmetic", Noted)
    return made


@pytest.mark.parametrize(
    ("document", "count"),
    [
        (lagrangian("oscillator", "x'^2/2 - x^2/2"), 3),
        (nonexistence("douglas-IIIb", 2), 2),
        (existence("henon-heiles", 2, [1, 1], [0, 0]), 2),
    ],
)
def test_rational_documents_are_judged_modulo_random_primes_of_61_bits(
    document: Document, count: int, drawn: list[tuple[int, int]]
) -> None:
    for seed in range(4):
        assert check_certificate(document, seed=seed).verdict == "valid"
    primes = [prime for prime, _ in drawn]
    assert len(set(primes)) == len(primes) == 4 * count
    assert all(prime.bit_length() == 61 and mpmath.libmp.isprime(prime) for prime in primes)


@pytest.mark.parametrize(
    ("document", "bits"),
    [
        (lagrangian("oscillator", "x'^2/2 - x^2/2 + 0*sin(x)"), [480, 1440]),
        (nonexistence("knife-edge-first", 2, "time_dependent"), [480]),
    ],
)
def test_other_documents_are_judged_in_reals_and_a_lagrangian_twice(
    document: Document, bits: list[int], drawn: list[tuple[int, int]]
) -> None:
    assert check_certificate(document, seed=1).verdict == "valid"
    assert drawn == [(0, each) for each in bits]


def test_a_seed_makes_the_choices_repeatable_and_none_makes_them_anew(drawn: list[tuple[int, int]]) -> None:
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
def test_an_error_that_few_digits_leave_open_is_settled_by_more(digits: int) -> None:
    """Between 1e-60 and 1e-27 of the terms, 144 digits cannot judge; 433 can."""
    text = f"x'^2/2 - x^2/2 + exp(x)/10^{digits}"
    assert check_certificate(lagrangian("oscillator", text), seed=1).verdict == "invalid"
    rows = nonexistence("henon-heiles", 2)
    rows["system"]["equations"] = {"x": f"-x+exp(y)*y'^2/10^{digits}", "y": "-2*y"}
    assert check_certificate(rows, seed=1).verdict == "valid"
    assert check_certificate(changed(rows, "system.equations.x", "-x+exp(y)*y'^2/10^400"), seed=1).verdict == "invalid"


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ("sin(1000+x)", "valid"), ("sin(1100+x)", "incomplete"), ("exp(44)+x", "valid"), ("exp(45)+x", "incomplete"),
        ("(2+x)^1000", "valid"), ("(2+x)^1001", "incomplete"), ("(2+x)^(-1000)", "valid"),
        ("(2+x)^-1001", "incomplete"),
    ],
)  # fmt: skip
def test_numbers_beyond_the_bounds_make_incomplete(text: str, verdict: str) -> None:
    """Elementary functions of numbers above 1024 or with values above 2^64, integral powers above 1000."""
    assert check_certificate(lagrangian("free", f"x'^2/2 + 0*({text})"), seed=1).verdict == verdict


@pytest.mark.parametrize("other", ["", " + 0*sin(x)"])
def test_a_declared_function_is_taken_at_numbers_of_any_length(other: str) -> None:
    """Of 16,000 digits, which Python does not write down."""
    document = lagrangian("free", f"x'^2/2 + 0*A(((10^400)^20)^2){other}")
    document["system"]["functions"] = {"A": ["x"]}
    assert check_certificate(document, seed=1).verdict == "valid"


@pytest.mark.parametrize("name", ["exp", "log", "sin", "cos", "atan", "pi"])
def test_modulo_a_prime_no_elementary_function_has_a_value(name: str) -> None:
    asking: Any = None
    for argument in (0, 1, 4):
        with pytest.raises(Undefined):
            Arithmetic(asking, 2**61 - 1).real(name, argument)
    assert reals().real(name, reals().one >> 1)


def test_a_factor_too_close_to_zero_is_not_used_in_an_elimination() -> None:
    field = reals()
    field.question.check_time = lambda: None  # type: ignore[method-assign]
    elimination = Elimination(field, 8)
    elimination.insert([{1: field.one, 2: field.one}])
    with pytest.raises(Ended, match="too close to zero"):
        elimination.insert([{1: field.one >> 100, 2: 3 * field.one}])
    elimination.insert([{1: field.one >> 300, 2: 3 * field.one}])
    assert elimination.pivots == [1, 2]


def test_a_number_without_an_inverse_modulo_the_prime_of_a_series_is_an_answer_not_a_fault() -> None:
    prime = 2**61 - 1
    series = {"order": 2, "point": {"x": "3", "x'": "5"}, "prime": prime, "terms": [[[0, 2], f"1/{prime}"]]}
    for wrong in (series, {**series, "point": {"x": f"2/{3 * prime}", "x'": "5"}, "terms": [[[0, 2], "1"]]}):
        found = check_certificate(existence("oscillator", 2, [1, 2], [1, 1, 1], series=wrong), seed=1)
        assert found.verdict == "invalid"
        assert "not defined" in found.reasons[0]
    system = existence("oscillator", 2, [1, 2], [1, 1, 1], series={**series, "terms": [[[0, 2], "1"]]})
    assert check_certificate(system, seed=1).verdict == "valid"
    assert check_certificate(changed(system, "system.equations.x", f"-x/{prime}"), seed=1).verdict == "invalid"


def test_expansions_of_too_many_terms_are_not_begun() -> None:
    names = [f"q{k}" for k in range(16)]
    document = existence("henon-heiles", 2, [1, 1], [0, 0])
    document["system"] = {"coordinates": names, "equations": dict.fromkeys(names, "0")}
    found = check_certificate(document, seed=1)
    assert found.verdict == "incomplete"
    assert "400000 terms" in found.reasons[0]
