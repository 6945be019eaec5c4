"""A question about L(q, q') of forces that hold t is one about L(t, q, q')."""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import PLAIN, TIMED


@pytest.mark.parametrize(
    ("forces", "plain", "timed"),
    [
        ({"x": "-x"}, "variational", "variational"),
        ({"x": "-x*cos(t)", "y": "-y"}, "variational", "variational"),
        ({"x": "-x - x'", "y": "-y - y'"}, "variational", "variational"),
        ({"x": "-x - x'", "y": "-y - y' + sin(t)"}, "variational", "variational"),
        ({"x": "y", "y": "y'*t"}, "not_variational", "not_variational"),
        ({"x": "y", "y": "0"}, "variational", "variational"),
    ],
)
def test_a_question_is_about_time_where_the_forces_are(
    forces: dict[str, str], plain: str, timed: str
) -> None:
    system = read_system([*forces], forces)
    for question, verdict in ((PLAIN, plain), (TIMED, timed)):
        found = deciding.decide(system, question)
        assert found.question == question.widened(system.depends_on_time)
        assert found.question.timed == (
            question.timed or any("t" in one for one in forces.values())
        )
        assert found.verdict == verdict
