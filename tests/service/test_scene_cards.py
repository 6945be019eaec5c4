"""Each card's scene has the outcome of the card, in the engine and (slow) on the command line."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate
from tests.simulation.cards import CARDS, Card, judge

EACH = pytest.mark.parametrize("card", CARDS, ids=lambda card: card.name)


LONG = ("a charged particle with drag, by its equations", "a snakeboard with feedback")
QUICK = [
    pytest.param(card, marks=pytest.mark.slow if card.name in LONG else (), id=card.name)
    for card in CARDS
]


@pytest.mark.slow
@pytest.mark.parametrize("card", QUICK)
def test_a_scene_is_answered_as_its_card_says(card: Card) -> None:
    if isinstance(card.answer, str):
        with pytest.raises(InputError) as refused:
            simulate(card.scene)
        assert card.answer in str(refused.value)
        return
    judge(card, simulate(card.scene, None, 60.0)["methods"])


@pytest.mark.slow
@EACH
def test_the_command_line_answers_as_the_card_says(card: Card) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "inverse_service", "simulate", "-"], input=json.dumps(card.scene), capture_output=True,
        text=True, check=False, timeout=300,
    )  # fmt: skip
    if isinstance(card.answer, str):
        assert ran.returncode == 2
        assert card.answer in ran.stderr
        return
    methods = json.loads(ran.stdout)["methods"]
    judge(card, methods)
    assert ran.returncode == (
        0 if any(method["outcome"] == "completed" for method in methods) else 1
    )
