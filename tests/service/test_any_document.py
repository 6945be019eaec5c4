"""Whatever a document holds, it is understood or refused with a sentence; it is never a fault."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents import documents
from inverse_service.service.documents.plain_data import read_json, read_toml, read_yaml
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.outcome import guard

SETTINGS = settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
WORDS = (
    "x y x' y'' t k A A(x) A'(x) sin cos( sqrt( log exp( ( ) + - * / ^ ** , ; = 0 1 2 0.5 1e3 3/2 pi e ' _ [ ] . .. "
    "\\frac{ } { \\dot{x} \\sin diff(x,t) x_dot 9^9 \u00b2 \u03b1 \u00e9"
)
PIECES = st.sampled_from([*WORDS.split(), "\n"])
FORMULAS = st.lists(PIECES, max_size=12).map("".join) | st.text(max_size=20)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | FORMULAS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
DOCUMENTS = st.fixed_dictionaries(
    {},
    optional={
        "coordinates": st.lists(st.sampled_from(["x", "y", "z1"]) | FORMULAS, max_size=3) | VALUES,
        "equations": st.dictionaries(st.sampled_from(["x", "y", "z1"]), FORMULAS) | FORMULAS | VALUES,
        "parameters": st.lists(st.sampled_from(["k", "m"])) | VALUES,
        "functions": st.just({"A": ["x"]}) | VALUES,
        "time_dependent_lagrangian": VALUES,
    },
)


def understood_or_refused(document: Any) -> None:
    outcome = guard(documents.parse_document, document)
    assert outcome.status in ("done", "refused"), outcome.detail
    for place in outcome.places:
        assert place.detail
        assert len(place.detail) < 600
        assert place.column is None or place.column >= 1


@pytest.mark.slow
@SETTINGS
@given(DOCUMENTS | VALUES)
def test_any_document_is_understood_or_refused(document: Any) -> None:
    understood_or_refused(document)


@pytest.mark.slow
@SETTINGS
@given(st.dictionaries(st.sampled_from(["x", "y"]), FORMULAS, min_size=2))
def test_any_formulas_are_understood_or_refused(equations: dict[str, str]) -> None:
    understood_or_refused(
        {"coordinates": ["x", "y"], "equations": equations, "parameters": ["k"], "functions": {"A": ["x"]}}
    )


@SETTINGS
@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda text: json.dumps(text)[:-1].encode()))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    for read in (read_json, read_yaml, read_toml):
        detail = refusal(read, data)
        assert detail is None or 0 < len(detail) < 400


def refusal(read: Callable[[bytes], Any], data: bytes) -> str | None:
    """The sentence of a refusal, None where there is none; any other exception fails the test."""
    try:
        read(data)
    except InputError as error:
        return error.detail
    return None


@pytest.mark.parametrize(
    "text", ["\u221a0", "sqrt(x-x)*y", "sqrt(sin(x)^2+cos(x)^2-1)", "(sin(x)^2+cos(x)^2-1)^(-1/2)"]
)
def test_a_root_of_zero_is_no_fault(text: str) -> None:
    document = {"coordinates": ["x", "y"], "equations": {"x": text, "y": "0"}}
    assert guard(tasks.solve_task, document, SolveOptions(time_limit=20.0)).status == "done"
