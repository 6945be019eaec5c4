"""The checker guesses relations of atoms: a right guess makes true documents valid, a wrong one
proves nothing.
"""

from __future__ import annotations

from fractions import Fraction

import pytest
from flint import arb, ctx

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.formulas import Ended
from inverse_service.certificate.numbers import Atom, Plan, exactly
from tests.certificate.documents import lagrangian
from tests.certificate.test_primes_and_choices import question


def verdict(difference: str) -> str:
    """The verdict on the claim that x'^2/2 plus vanishing terms is a Lagrangian of free motion."""
    return check_certificate(
        lagrangian("free", f"x'^2/2 + x^2*({difference})", near={"x": "2"}), seed=1
    ).verdict


@pytest.mark.parametrize(
    "difference",
    [
        "sin(x + pi/3) - sin(x)/2 - sqrt(3)*cos(x)/2",
        "sin(x + 1) - sin(x)*cos(1) - cos(x)*sin(1)",
        "log(12*x/5) - 2*log(2) - log(3) + log(5) - log(x)",
        "exp((sqrt(2) + sqrt(3))*x) - exp(sqrt(2)*x)*exp(sqrt(3)*x)",
        "x^(1/2)*(x + 1)^(1/3)*x^(1/3) - x^(5/6)*(x + 1)^(1/3)",
        "x*tan(atan(x)/2) - sqrt(1 + x^2) + 1",
        "log(x^2) - 2*log(x)",
    ],
)
def test_what_is_guessed_right_makes_a_true_document_valid(difference: str) -> None:
    assert verdict(difference) == "valid"


@pytest.mark.parametrize(
    "difference", ["x^(1/5000) - 1", "2^(1/29) - 1", "cos(1) - 5/4", "exp(1) - 2"]
)
def test_a_false_relation_is_not_used(difference: str) -> None:
    assert verdict(difference) != "valid"


@pytest.mark.parametrize(
    ("formula", "degree"),
    [("x*sin(pi/36)", 72), ("x*2^(1/9)", 18), ("x*3^(1/9)", 18), ("x*5^(1/9)", 18)],
)
def test_primes_have_the_roots_of_numbers_that_a_formula_holds(formula: str, degree: int) -> None:
    asked = question(formula)
    assert all((asked.prime() - 1) % degree == 0 for _ in range(4))


@pytest.mark.parametrize("formula", ["exp(x)", "sin(x)"])
def test_where_only_the_point_itself_can_be_reached_nothing_is_settled(formula: str) -> None:
    """At x = 0 alone x seems to be 0, so the guessed relations are false."""
    document = lagrangian(
        "free", f"x'^2/2 + 0*{formula}", near={"x": "0"}, conditions=["1/10^40 - x^2 > 0"]
    )
    assert check_certificate(document, seed=1).verdict == "incomplete"


@pytest.mark.slow
def test_a_zero_that_is_not_seen_refutes_nothing() -> None:
    zero = "+".join(f"2*cos({k}*2*pi/61)" for k in range(1, 31))
    assert verdict(f"1 + {zero}") == "incomplete"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formula", "power"),
    [
        ("atan(x) + atan(1/x)", 24),
        ("atan(x) + 2*atan(sqrt(1 + x^2) - x)", 48),
        ("atan(tan(atan(x)/5))", 120),
    ],
)
def test_of_a_dependent_angle_a_power_is_tested_that_leaves_multiples_of_one_part_of_pi(
    formula: str, power: int
) -> None:
    """l = sum a_j l_j + c pi i/R by w^(2R) = prod e_j^(2 R a_j), R the multiple of 12 and of all
    denominators.
    """
    assert question(formula).plan.entries[-1].times == power


@pytest.mark.parametrize(("radius", "known"), [("0.01", True), ("0.25", False), ("1", False)])
def test_a_multiple_of_pi_is_the_only_one_in_a_ball_whatever_its_middle_says(
    radius: str, known: bool
) -> None:
    with ctx.workprec(600):
        angle = arb("1.5", arb(radius))
        traces = [[Atom(True, True, angle + k)] * 2 for k in range(8)]
        if known:
            assert Plan(traces, 600).entries[1].parts == ((5, Fraction(1)),)
            return
        with pytest.raises(Ended, match="branch of an arctangent"):
            Plan(traces, 600)


def test_a_number_that_is_huge_or_tiny_is_not_written_down() -> None:
    """Its digits would fill the memory: exp(exp(60)) has 10^26 of them."""
    for exponent in (30_000, -30_000):
        assert exactly(arb(2) ** exponent) == exactly(-(arb(2) ** exponent)) == 0
    assert exactly(arb(2) ** -10_000) == Fraction(1, 2**10_000)
