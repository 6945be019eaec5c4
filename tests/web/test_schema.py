"""Valid and invalid requests generated from the OpenAPI document find no failure."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis.checks import CHECKS, load_all_checks
from schemathesis.generation import GenerationMode

load_all_checks()
# A document may have the right shape and still be meaningless; then an error is correct.
LEFT_OUT = [CHECKS.get_one("positive_data_acceptance")]
# For a wrong result the check returns `invalid`, not an error.
JUDGED = "POST /v1/check"
MODES = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)


def ask_all(service: str, examples: int, derandomize: bool, by_turns: bool = False) -> list[str]:
    """Send this many requests of each mode, or of one by turns, to each operation; return the
    operations.
    """
    description = schemathesis.openapi.from_url(f"{service}/openapi.json")
    operations = [found.ok() for found in description.get_all_operations()]
    for place, operation in enumerate(operations):
        for mode in MODES[place % 2 : place % 2 + 1] if by_turns else MODES:
            ask(operation, mode, examples, derandomize)
    return [operation.label for operation in operations]


def ask(operation: Any, mode: GenerationMode, examples: int, derandomize: bool) -> None:
    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=derandomize,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode))
    def answers_as_described(case: Any) -> None:
        if operation.label != JUDGED or mode is not GenerationMode.NEGATIVE:
            case.call_and_validate(excluded_checks=LEFT_OUT, timeout=30)
            return
        excluded = [*LEFT_OUT, CHECKS.get_one("negative_data_rejection")]
        answer = case.call_and_validate(excluded_checks=excluded, timeout=30)
        assert answer.status_code != 200 or answer.json()["verdict"] != "valid"

    # A call without parameters cannot be invalid.
    with (
        contextlib.suppress(Unsatisfiable)
        if mode is GenerationMode.NEGATIVE
        else contextlib.nullcontext()
    ):
        answers_as_described()


def test_every_call_answers_as_described(service: str) -> None:
    found = ask_all(service, 1, derandomize=True, by_turns=True)
    assert {
        "POST /v1/solve",
        "POST /v1/batches",
        "DELETE /v1/jobs/{id}",
        "GET /v1/jobs/{id}/events",
    } <= set(found)


@pytest.mark.nightly
def test_every_call_answers_as_described_to_thousands_of_requests(service: str) -> None:
    ask_all(service, 500, derandomize=False)
