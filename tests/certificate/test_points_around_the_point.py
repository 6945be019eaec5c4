"""What holds near P only is not said of all points at which the conditions hold."""

from __future__ import annotations

import random
import time

import pytest

from inverse_service.certificate.checker import CheckResult, Question, check_result
from tests.certificate.documents import lagrangian, result, system


def answered(text: str, near: str, conditions: list[str], seed: int = 1) -> CheckResult:
    proof = lagrangian("free", text, near={"x": near}, conditions=conditions)
    shown = result("free", "variational", proof, domain=conditions, lagrangian={"text": text, "domain": conditions})
    return check_result(shown, seed=seed)


TURN = "x'^2/2 + x^2*(atan(x) + atan(1/x) - pi/2)"  # where x < 0 that is x'^2/2 - pi*x^2


def test_an_l_of_one_side_is_none_of_both() -> None:
    assert answered(TURN, "2", ["x > 0"]).verdict == "valid"
    for seed in range(3):
        found = answered(TURN, "2", [], seed)
        assert found.verdict == "invalid"
        assert "does not hold wherever" in found.reasons[0]


@pytest.mark.parametrize("seed", range(3))
def test_a_border_is_looked_for_near_the_point_however_far_that_is(seed: int) -> None:
    """Between 999,500 and 1,000,000 there is no value."""
    text = "x'^2/2 + x'*log((x - 999500)*(x - 1000000))"
    assert answered(text, "1000001", ["x > 1000000"], seed).verdict == "valid"
    found = answered(text, "1000001", ["x > 0"], seed)
    assert found.verdict == "invalid"
    assert "not defined wherever" in found.reasons[0]


def test_points_at_which_conditions_fail_are_none() -> None:
    claim = {"near": {"x": "0", "x'": "1"}, "conditions": ["1/10^40 - x^2 > 0"]}
    question = Question((random.Random(1), time.thread_time() + 60), system("free"), True, claim)
    question.prepare(lambda ring: None, rational=False)
    assert question.look_around() == 0
