"""The checker detects arbitrarily small errors and never takes a rounding error for a
consequence.
"""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.formulas import Ended, read_tokens


@pytest.mark.parametrize(("formula", "column"), [("$", 1), ("x + $", 5), ("x  +\n#", 6)])
def test_an_invalid_formula_is_reported_with_its_column(formula: str, column: int) -> None:
    with pytest.raises(Ended, match=f"at column {column} is not part"):
        read_tokens(formula, "here")


@pytest.mark.parametrize(
    "number", ["9" * 401, "1." + "0" * 400, "12." + "5" * 399, "0." + "1" * 400]
)
def test_a_number_of_more_digits_than_the_limit_is_refused(number: str) -> None:
    with pytest.raises(Ended, match="at column 3 is"):
        read_tokens(f"x+{number}", "here")
    assert read_tokens(f"x+{number[:400]}", "here") == ("x", "+", number[:400], "")


@pytest.mark.parametrize("digits", [110, 130, 260, 390])
def test_a_small_error_of_a_lagrangian_is_never_taken_for_none(digits: int) -> None:
    certificate = {
        "format": "inverse-service/certificate/2", "question": "autonomous", "claim": "variational",
        "kind": "lagrangian", "system": {"coordinates": ["x"], "equations": {"x": "-x"}},
        "lagrangian": f"x'^2-x^2+exp(x)/10^{digits}",
    }  # fmt: skip
    assert check_certificate(certificate, seed=1).verdict == "invalid"


@pytest.mark.parametrize(("count", "verdict"), [(6, "valid"), (7, "invalid")])
def test_functions_have_at_most_six_arguments(count: int, verdict: str) -> None:
    names = list("abcdefg")
    equations = dict.fromkeys(names, "0") | {"a": "A'(a)"}
    system = {
        "coordinates": names,
        "equations": equations,
        "functions": {"A": ["a"], "B": names[:count]},
    }
    kinetic = "+".join(f"{name}'^2/2" for name in names)
    certificate = {
        "format": "inverse-service/certificate/2", "question": "autonomous", "claim": "variational",
        "kind": "lagrangian", "system": system, "lagrangian": f"{kinetic}+A(a)",
    }  # fmt: skip
    assert check_certificate(certificate, seed=1).verdict == verdict


def test_related_functions_leave_no_consequence_of_their_rounding_errors() -> None:
    """(sin^2 + cos^2 - 1) x'^2 y' and similar terms are zero to all digits, so the oscillator is
    unchanged.
    """
    zero = "(sin(3*x)^2+cos(3*x)^2-1)"
    system = {
        "coordinates": ["x", "y"],
        "equations": {"x": f"-x+{zero}*x'^2*y'", "y": f"-2*y+{zero}*exp(x)*y'^3"},
    }
    claim = {"format": "inverse-service/certificate/2", "system": system, "question": "autonomous"}
    pairs = [("H2", 0, 0), ("H2", 0, 1), ("H2", 1, 1), ("H3", 0, 1)]
    units = [[int(a == b) for a in range(4)] for b in range(4)]
    rows = [[*pair, alpha] for pair in pairs for alpha in ([0] * 4, *units)]
    false = claim | {"claim": "not_variational", "kind": "nonexistence", "order": 2, "rows": rows}
    assert check_certificate(false, seed=2).verdict == "invalid"
    true = claim | {
        "claim": "variational",
        "kind": "lagrangian",
        "lagrangian": "x'^2-x^2+y'^2-2*y^2",
    }
    assert check_certificate(true, seed=2).verdict == "valid"
