"""Numbers of the checker: what counts as zero, what as one, and what is too close to say."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import pytest

from inverse_service.certificate.checker import PRECISIONS, Arithmetic, Ended, check_certificate, read_tokens

PRIME = (1 << 61) - 1


@dataclass
class Asking:
    generator: random.Random


def reals(precision: tuple[int, int, int] = PRECISIONS[0]) -> Arithmetic:
    asking: Any = Asking(random.Random(1))
    return Arithmetic(asking, 0, *precision)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_real_is_zero_below_the_cut_and_another_number_above_the_gap(precision: tuple[int, int, int]) -> None:
    field, (bits, cut, gap) = reals(precision), precision
    assert field.vanishes(0, field.one)
    assert field.vanishes(1 << bits - cut, field.one)
    assert not field.vanishes(-(1 << bits - gap), field.one)
    for between in ((1 << bits - cut) + 1, (1 << bits - gap) - 1, -(1 << bits - gap - 9)):
        with pytest.raises(Ended, match="too close to zero"):
            field.vanishes(between, field.one)


def test_zero_is_beside_the_size_of_the_terms() -> None:
    field = reals()
    assert field.vanishes(1 << 300, field.one << 40)
    assert not field.vanishes(1 << 300, field.one >> 100)


def test_a_row_of_rounding_errors_is_no_row() -> None:
    """Made 1, the largest of them would become a consequence that nobody derived."""
    field = reals()
    assert field.row({3: 1 << 200, 4: -(1 << 210)}, scale=field.one) == {}
    assert field.row({3: 1 << 100}) == {}


def test_a_row_is_made_one_at_its_largest_entry() -> None:
    field = reals()
    row = field.row({3: 5 * field.one, 4: -10 * field.one, 5: 1 << 130}, scale=field.one)
    assert row == {3: field.one // 2, 4: -field.one}
    assert field.row({3: 5 * field.one}) == {3: 5 * field.one}


def test_products_of_reals_are_brought_back_to_scale() -> None:
    field = reals()
    half = field.one // 2
    assert field.reduce(half * half) == field.one // 4
    assert field.settle({1: half * half, 2: field.one}, field.bits) == {1: field.one // 4}


def test_modulo_a_prime_only_multiples_of_it_are_zero() -> None:
    asking: Any = Asking(random.Random(1))
    field = Arithmetic(asking, PRIME)
    assert field.vanishes(3 * PRIME, 1)
    assert not field.vanishes(3 * PRIME + 1, 1 << 900)
    assert field.row({1: PRIME, 2: PRIME + 2, 3: -1}) == {2: 2, 3: PRIME - 1}
    assert field.reduce((PRIME - 2) * (PRIME - 3)) == 6
    assert len({field.draw() for _ in range(50)}) == 50


@pytest.mark.parametrize(("formula", "column"), [("$", 1), ("x + $", 5), ("x  +\n#", 6)])
def test_what_is_no_formula_is_named_by_its_column(formula: str, column: int) -> None:
    with pytest.raises(Ended, match=f"at column {column} is no part"):
        read_tokens(formula, "here")


@pytest.mark.parametrize("number", ["9" * 401, "1." + "0" * 400, "12." + "5" * 399, "0." + "1" * 400])
def test_a_number_of_more_digits_than_the_limit_is_refused(number: str) -> None:
    with pytest.raises(Ended, match="at column 3 is no part"):
        read_tokens(f"x+{number}", "here")
    assert read_tokens(f"x+{number[:400]}", "here") == ("x", "+", number[:400], "")


@pytest.mark.parametrize(("digits", "verdict"), [(110, "invalid"), (130, "incomplete"), (260, "incomplete")])
def test_a_small_error_of_a_lagrangian_is_never_taken_for_none(digits: int, verdict: str) -> None:
    """Beside terms of the size 1: seen above 1e-120, too close to zero to judge down to 1e-270."""
    certificate = {
        "format": "inverse-service/certificate/1", "question": "autonomous", "claim": "variational",
        "kind": "lagrangian", "system": {"coordinates": ["x"], "equations": {"x": "-x"}},
        "lagrangian": f"x'^2-x^2+exp(x)/10^{digits}",
    }  # fmt: skip
    assert check_certificate(certificate, seed=1).verdict == verdict


@pytest.mark.parametrize(("count", "verdict"), [(6, "valid"), (7, "invalid")])
def test_functions_have_at_most_six_arguments(count: int, verdict: str) -> None:
    names = list("abcdefg")
    equations = dict.fromkeys(names, "0") | {"a": "A'(a)"}
    system = {"coordinates": names, "equations": equations, "functions": {"A": ["a"], "B": names[:count]}}
    kinetic = "+".join(f"{name}'^2/2" for name in names)
    certificate = {
        "format": "inverse-service/certificate/1", "question": "autonomous", "claim": "variational",
        "kind": "lagrangian", "system": system, "lagrangian": f"{kinetic}+A(a)",
    }  # fmt: skip
    assert check_certificate(certificate, seed=1).verdict == verdict


def test_related_functions_leave_no_consequence_of_their_rounding_errors() -> None:
    """(sin^2 + cos^2 - 1) x'^2 y' and the like is zero to all digits: a harmonic oscillator stays what it is."""
    zero = "(sin(3*x)^2+cos(3*x)^2-1)"
    system = {"coordinates": ["x", "y"], "equations": {"x": f"-x+{zero}*x'^2*y'", "y": f"-2*y+{zero}*exp(x)*y'^3"}}
    claim = {"format": "inverse-service/certificate/1", "system": system, "question": "autonomous"}
    pairs = [("H2", 0, 0), ("H2", 0, 1), ("H2", 1, 1), ("H3", 0, 1)]
    units = [[int(a == b) for a in range(4)] for b in range(4)]
    rows = [[*pair, alpha] for pair in pairs for alpha in ([0] * 4, *units)]
    false = claim | {"claim": "not_variational", "kind": "nonexistence", "order": 2, "rows": rows}
    assert check_certificate(false, seed=2).verdict == "invalid"
    true = claim | {"claim": "variational", "kind": "lagrangian", "lagrangian": "x'^2-x^2+y'^2-2*y^2"}
    assert check_certificate(true, seed=2).verdict == "valid"
