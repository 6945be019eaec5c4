"""What is read is written down once; at other points only what the atoms need is computed again."""

from __future__ import annotations

import random

import pytest

from inverse_service.certificate.formulas import Incomplete
from inverse_service.certificate.numbers import Balls
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.tape import Tape
from tests.certificate.documents import system

# The force on a body that two others attract has two roots, in sums that hold no atom.
SYSTEMS = {
    "spherical-pendulum": system("spherical-pendulum"),
    "two-centers": {
        "coordinates": ["x", "y"],
        "equations": {
            "x": "-a*x/(x^2 + y^2)^(3/2) - b*(x - 1)*sin(x)/sqrt((x - 1)^2 + y^2)",
            "y": "-a*y/(x^2 + y^2)^(3/2) - b*y*log(1 + x^2)",
        },
        "parameters": ["a", "b"],
    },
    "function": {
        "coordinates": ["x"],
        "equations": {"x": "-V'(x)*sqrt(1 + V(x)^2) - V(2*x)"},
        "functions": {"V": ["x"]},
    },
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_tape_meets_the_atoms_of_the_whole_reading(name: str) -> None:
    """With the same values in the same order, by fewer steps than were written down."""
    question = Question(Tools(random.Random(1), float("inf")), SYSTEMS[name], timed=False)
    question.prepare(lambda ring: None)
    whole = Balls(question, question.place, None)
    question.expansion(whole, 0)
    again = question.met_at(question.place)
    assert [str(atom) for atom in again.trace] == [str(atom) for atom in whole.trace]
    assert again.trace
    assert again.met == whole.met
    assert len(question.tape.needed) < len(question.tape.steps)


def test_a_tape_that_meets_other_atoms_ends_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a value would be taken for one of another atom."""
    written = Tape.__init__

    def without_the_last(self: Tape, question: Question) -> None:
        written(self, question)
        last = max(place for place in self.needed if self.steps[place].meets)
        self.needed.remove(last)

    monkeypatch.setattr(Tape, "__init__", without_the_last)
    question = Question(Tools(random.Random(1), float("inf")), SYSTEMS["two-centers"], timed=False)
    with pytest.raises(Incomplete, match="other atoms"):
        question.prepare(lambda ring: None)
