"""The preparation of a document is a chain of steps that can be printed."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import errors
from inverse_service.service.documents import accepting, renaming

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


@pytest.mark.parametrize(
    ("document", "pointer", "column"),
    [
        ({"equations": "x'' = -tau*x + )", "time": "tau"}, "/equations", 16),
        ({"equations": r"\ddot x = -\tau x + )", "time": "tau"}, "/equations", 21),
        ({"equations": {"x": "-tau*x + )"}, "time": "tau"}, "/equations/x", 10),
        ({"equations": "y'' = -xy + )", "time": "x"}, "/equations", 13),
    ],
)
def test_an_error_points_to_what_was_typed_where_the_time_has_another_name(
    document: Document, pointer: str, column: int
) -> None:
    ready = accepting.prepared(document)
    with pytest.raises(errors.InputError) as found:
        accepting.to_system(accepting.to_schema(ready.document))
    error = ready.error(found.value)
    assert (error.pointer, error.column) == (pointer, column)


def test_an_error_in_a_scene_points_to_what_was_typed_where_the_time_has_another_name() -> None:
    system = {"document": {"equations": "x'' = -x", "time": "tau"}}
    prepared = accepting.prepared_scene({"system": system, "observe": [{"a": "tau*x + )"}]})
    (text,) = prepared.document["observe"][0].values()
    assert text == "t*x + )"
    error = prepared.error(errors.InputError("wrong at column 7.", "/observe/0/a", 7))
    assert (error.column, error.detail) == (9, "wrong at column 9.")


def test_a_long_name_is_whole_in_latex_where_the_time_has_another_name() -> None:
    table = {"t": "time", "s": "t"}
    latex = renaming.with_names({"latex": r"\mathrm{gravity} m_{\mathrm{total}} t+ s"}, table)
    assert latex == {"latex": r"\mathrm{gravity} m_{\mathrm{total}} \mathrm{time} + t"}
