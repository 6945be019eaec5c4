"""A small campaign finds no wrong verdict, and a planted one is detected."""

from __future__ import annotations

import dataclasses
import json
import random
from pathlib import Path

import mpmath
import pytest

from inverse_service.decision.deciding import decide
from inverse_service.expressions.calculus import evaluate
from inverse_service.expressions.tree import Expression, Symbol, Velocity
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import TIMED
from tests.soundness import campaign, cases
from tests.soundness.__main__ import main
from tests.soundness.cases import KINDS, Outcome, run_case
from tests.soundness.corruption import found_valid
from tests.soundness.rewriting import rewritten

EQUATIONS = {"x": "sin(x*y)*x'^2+sqrt(1+x^2)", "y": "exp(x-y)*log(y)*y'+cos(x)*x'*y'/(1+y^2)"}


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=pytest.mark.slow if kind == "corrupted" else ()) for kind in KINDS],
)
def test_no_verdict_is_wrong(kind: str) -> None:
    count = 4 if kind in ("corrupted", "disguised") else 10
    outcomes = [run_case(kind, 5, index) for index in range(count)]
    assert [outcome.wrong for outcome in outcomes] == [[]] * count
    assert all(outcome.verdicts or outcome.corrupted for outcome in outcomes)
    assert kind != "corrupted" or sum(outcome.corrupted["invalid"] for outcome in outcomes) > 60


def test_a_wrong_verdict_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = decide(read_system(["x", "y"], {"x": "x*y", "y": "0"}), TIMED)
    assert refused.verdict == "not_variational"
    monkeypatch.setattr(cases, "decide", lambda *_, **__: refused)
    assert "has a Lagrangian" in run_case("generated", 5, 8).wrong[0]


def test_other_dimensions_are_reported_although_the_verdict_is_right(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter(range(9))
    right = cases.decide

    def shifting(*arguments: object, **options: object) -> object:
        return dataclasses.replace(right(*arguments, **options), history=((next(answers),),))  # type: ignore[arg-type]

    monkeypatch.setattr(cases, "decide", shifting)
    assert run_case("rewritten", 5, 8).wrong


def test_a_fault_of_ours_counts_as_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(outcome: Outcome, seed: int, index: int) -> None:
        raise ZeroDivisionError("nothing")

    monkeypatch.setitem(KINDS, "random", failing)
    assert run_case("random", 5, 0).wrong == ["ZeroDivisionError: nothing"]


def test_a_corrupted_certificate_that_is_true_is_reported() -> None:
    """The corrupted kind can fail: a true certificate is reported as valid."""
    true = {
        "format": "inverse-service/certificate/2", "question": "autonomous", "claim": "variational",
        "kind": "lagrangian", "system": {"coordinates": ["x"], "equations": {"x": "-x"}}, "lagrangian": "x'^2-x^2",
    }  # fmt: skip
    counts, wrong = found_valid(
        iter([("nothing", true), ("the sign", {**true, "lagrangian": "x'^2+x^2"})])
    )
    assert counts == {"valid": 1, "invalid": 1}
    assert [name for name, _ in wrong] == ["nothing"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_what_is_written_otherwise_has_the_same_values(seed: int) -> None:
    given, names = read_system(["x", "y"], EQUATIONS), ("x", "y")
    texts = rewritten(given, seed)
    assert texts != EQUATIONS
    other = read_system(names, texts)
    rng = random.Random(seed)
    atoms: list[Expression] = [*map(Symbol, names), *map(Velocity, names)]
    with mpmath.workdps(30):
        point = {atom: mpmath.mpf(rng.uniform(0.2, 0.9)) for atom in atoms}
        for first, second in zip(given.accelerations, other.accelerations, strict=True):
            assert abs(evaluate(first, point) - evaluate(second, point)) < 1e-24


SMALL = (
    "--random",
    "3",
    "--generated",
    "2",
    "--rewritten",
    "1",
    "--corrupted",
    "1",
    "--disguised",
    "1",
)


@pytest.mark.slow
def test_a_campaign_resumes_and_writes_its_page(tmp_path: Path) -> None:
    arguments = [*SMALL, "--processes", "1", "--output", str(tmp_path), "--seed", "4"]
    assert main(arguments) == 0
    path, page = tmp_path / "cases-4.ndjson", (tmp_path / "soundness.md").read_text()
    lines = path.read_text().splitlines()
    assert len(lines) == 8
    assert "Not ended" not in page
    path.write_text("\n".join(lines[:5]) + "\n" + lines[5][:20])
    assert main([*arguments, "--so-far"]) == 0
    assert "**Not ended:** 5 of 8 cases have run." in (tmp_path / "soundness.md").read_text()
    assert main(arguments) == 0
    again = path.read_text().splitlines()
    assert again[:5] == lines[:5]
    without_time = [{**json.loads(line), "seconds": 0} for line in again[5:]]
    assert without_time == [{**json.loads(line), "seconds": 0} for line in lines[5:]]
    assert "| random | 3 | 0 | 6 | 0 | 6 | 0 | 0 | 0 |" in page


def test_a_wrong_verdict_gives_exit_code_one_and_is_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        campaign, "run_case", lambda kind, _, index: Outcome(kind, index, n=1, wrong=["sentence"])
    )
    assert main([*SMALL, "--processes", "1", "--output", str(tmp_path)]) == 1
    assert "- random 2: sentence" in (tmp_path / "soundness.md").read_text()
