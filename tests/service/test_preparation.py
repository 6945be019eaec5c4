"""The preparation of a document is a chain of steps that can be printed."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import errors
from inverse_service.service.documents import accepting

Document = dict[str, Any]
# Documents with the steps that change them.
CHANGED: list[tuple[Document, set[str]]] = [
    ({"equations": {"x": "-x"}, "parameters": []}, set()),
    ({"equations": {"x": "-x"}}, {"guess names"}),
    ({"equations": {"x": "-k*x"}, "parameters": ["k"], "_why": "note"}, {"keep the id"}),
    ({"equations": {"x": "-x"}, "parameters": [], "id": "7"}, {"keep the id"}),
    ({"equations": {"x": "-x"}, "parameters": [], "colour": 1}, {"leave out unknown keys"}),
    ({"equations": "y'' = 6*y^2 + x"}, {"guess names", "name the time"}),
    ({"equations": {"x": "-x/s"}, "parameters": [], "time": "s"}, {"name the time"}),
    ({"equations": "L = x'^2/2 - x^2/2"}, {"guess names", "find the lagrangian"}),
    ({"lagrangian": "x'^2", "constraints": [], "parameters": []}, {"find the lagrangian"}),
]


@pytest.mark.parametrize(("document", "steps"), CHANGED)
def test_each_step_changes_what_its_name_says(document: Document, steps: set[str]) -> None:
    before, changed = accepting.Prepared(document), set[str]()
    for name, after in accepting.steps_of(document):
        if after != before:
            changed.add(name)
        before = after
    assert changed == steps
    assert before == accepting.prepared(document)


def test_a_text_that_is_too_long_ends_the_chain_before_it_is_read() -> None:
    *_, (last, ready) = accepting.steps_of({"equations": "x'' = " + "-x" * 200_000})
    assert last == "leave long texts"
    assert ready.is_unread


def test_the_preparation_changes_no_document_of_the_caller() -> None:
    document = {"lagrangian": "x'^2/2", "constraints": [], "time": "t", "id": "7"}
    given = dict(document)
    accepting.prepared(document)
    assert document == given


def test_a_result_is_no_document() -> None:
    with pytest.raises(errors.InputError, match="result"):
        accepting.prepared({"format": "inverse-service/result/1"})
