"""The bounds in FORMAT.md: values at a bound are accepted; values one beyond it are rejected for
that reason.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.certificate.checker import CheckResult, check_certificate
from tests.certificate.documents import Document, changed, lagrangian, nonexistence


def checked(document: Document) -> CheckResult:
    return check_certificate(document, seed=1)


def free(names: list[str], **parts: Any) -> Document:
    """A certificate of free motion with its kinetic energy."""
    document = lagrangian("free", "+".join(f"{name}'^2" for name in names))
    document["system"] = {"coordinates": names, "equations": dict.fromkeys(names, "0"), **parts}
    return document


def numbered(stem: str, count: int) -> list[str]:
    return [f"{stem}{k}" for k in range(count)]


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        (free(numbered("q", 64)), free(numbered("q", 65)), "at most 64"),
        (
            free(["x"], parameters=numbered("a", 200)),
            free(["x"], parameters=numbered("a", 201)),
            "at most 200",
        ),
        (
            free(["x"], functions={name: ["x"] for name in numbered("A", 200)}),
            free(["x"], functions={name: ["x"] for name in numbered("A", 201)}),
            "at most 200",
        ),
        (free(["x" * 100]), free(["x" * 101]), "a text of the form"),
        (
            changed(free(["x"]), "lagrangian", "x'^2" + " " * 59_996),
            changed(free(["x"]), "lagrangian", "x'^2" + " " * 59_997),
            "a text of the form",
        ),
        (
            changed(free(["x"]), "system.equations.x", "0" + " " * 59_999),
            changed(free(["x"]), "system.equations.x", "0" + " " * 60_000),
            "a text of the form",
        ),
    ],
    ids=["coordinates", "parameters", "functions", "name", "lagrangian", "equation"],
)
def test_a_bound_is_kept_to_the_last(right: Document, wrong: Document, words: str) -> None:
    assert checked(right).verdict == "valid"
    found = checked(wrong)
    assert found.verdict == "invalid"
    assert words in found.reasons[0]


def test_two_hundred_thousand_rows_are_the_most() -> None:
    found = checked(nonexistence("douglas-IIIb", 2, rows=[None] * 200_001))
    assert "at most 200000" in found.reasons[0]
    assert (
        "an item of" in checked(nonexistence("douglas-IIIb", 2, rows=[None] * 200_000)).reasons[0]
    )


@pytest.mark.parametrize("kind", ["lagrangian", "existence", "nonexistence"])
def test_a_kind_claims_one_verdict_only(kind: str) -> None:
    document = free(["x"]) | {
        "kind": kind,
        "claim": "variational" if kind == "nonexistence" else "not_variational",
    }
    assert f"of kind {kind} has to claim" in checked(document).reasons[0]


def read_beside(text: str) -> CheckResult:
    """Add the formula without effect on the claim, so that it is parsed."""
    return checked(lagrangian("free", f"x'^2/2 + 0*({text})", near={"x": "2"}))


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ("(x^1000)^1048", "(x^1000)^1049"),
        ("sqrt(x)*(x^1000)^500", "sqrt(x)*(x^1000)^600"),  # times the choices of roots
        (
            "exp(x)^200*exp(x/4096)",
            "exp(x)^300*exp(x/4096)",
        ),  # exp(x) is the 4096th power of a generator
        ("exp(x/4096)*exp(x)^200", "exp(x/4096)*exp(x)^300"),
        (
            "sqrt(x)*(x^1000)^300/(x^1000)^300",
            "log(sqrt(x)*(x^1000)^300/(x^1000)^300)",
        ),  # the square of w is compared
        (
            "log(x^3*(x^1000)^350/(x^1000)^350)",
            "log(x^3*(x^1000)^350/(x^1000)^350) + log(x)",
        ),  # the cube of x
        (
            "tan(atan(x*(x^1000)^21/(x^1000)^21)/2)",
            "tan(atan(x*(x^1000)^22/(x^1000)^22)/2)",
        ),  # by sqrt(1 + u^2)
    ],
)
def test_a_degree_of_2_to_the_20_is_the_highest_that_anything_has_which_is_tested(
    within: str, beyond: str
) -> None:
    """The probability in Lemma 2 is the degree divided by the prime."""
    assert read_beside(within).verdict == "valid"
    found = read_beside(beyond)
    assert found.verdict == "incomplete"
    assert "above 1048576" in found.reasons[0]


@pytest.mark.parametrize("number", [2, 3, 5])
def test_roots_of_numbers_are_counted_with_the_primes_that_have_roots_of_unity(number: int) -> None:
    assert read_beside(f"{number}^(1/11)*7^(1/2)").verdict == "valid"
    found = read_beside(f"{number}^(1/11)*7^(1/4)")
    assert found.verdict == "incomplete"
    assert "too few primes" in found.reasons[0]
