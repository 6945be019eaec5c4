"""A form says what its document says, a link what its form says, and an error stands where it is,
wherever a text breaks off.
"""

from __future__ import annotations

import random
from typing import Any
from urllib.parse import parse_qsl

import pytest

from inverse_service import errors
from inverse_service.service.documents.documents import parse_document
from inverse_service.web.pages import forms
from tests.doors import rows

ASKED: list[dict[str, Any]] = [
    {"equations": "x'' = -k x\ny'' = -y", "parameters": ["k"], "kinds": ["natural", "finsler"], "name": "two"},
    {"equations": {"x": "-k*x + f(t)"}, "parameters": {"k": "1/2"}, "functions": {"f": ["t"]}, "clock": "search"},
    {"equations": {"x": "-a*x"}, "nearest": {"errors": {"a": "0.02"}}, "options": {"time_limit": 12.5}},
    {"equations": {"x": "-a*x"}, "nearest": True, "time_dependent_lagrangian": True, "family": True},
    {"equations": {"x": "-x"}, "ansatz": ["x'^2", "sin(x, y)"], "time_dependent_lagrangian": False},
    {"lagrangian": "(x'^2 + y'^2)/2", "constraints": ["y' - x*x'"], "associated": "third", "coordinates": ["x", "y"]},
]  # fmt: skip
KEYS = (
    "coordinates",
    "parameters",
    "functions",
    "equations",
    "constraints",
    "kind",
    "lagrangian",
    "names",
)


def _drawn(count: int) -> list[dict[str, Any]]:
    found = [row["document"] for row in rows.systems() if isinstance(row["document"], dict)]
    return random.Random(3).sample(found, count)


def _meaning(document: dict[str, Any]) -> dict[str, Any]:
    found = parse_document(document)
    return {key: found[key] for key in KEYS if key in found}


def test_a_form_of_a_document_is_a_document_of_the_same_form() -> None:
    """For documents of the corpus, and for one with each question of the form."""
    for document in [*ASKED, *_drawn(200)]:
        fields = forms.fields_from(document)
        assert set(fields) == set(forms.FIELDS)
        back = forms.document_of_fields(fields)
        assert forms.fields_from(back) == fields
        link = forms.link_of_fields(fields)
        kept = forms.fields_of_link(dict(parse_qsl(link.partition("?")[2])))
        assert forms.is_whole(fields) == (kept == fields and len(link) <= forms.LONGEST_LINK)
        assert kept == {
            name: fields[name] if name in (*forms.LINKED, "kind") else "" for name in fields
        }
        for key in (
            "nearest",
            "kinds",
            "clock",
            "ansatz",
            "family",
            "time_dependent_lagrangian",
            "name",
        ):
            if document in ASKED or isinstance(document.get(key), str | bool):
                assert back.get(key) == document.get(key), key


def test_a_document_from_a_form_means_the_same_system() -> None:
    for document in [*ASKED[:2], *_drawn(4)]:
        try:
            expected = _meaning(document)
        except errors.InputError:
            continue
        back = forms.document_of_fields(forms.fields_from(document))
        given = {
            key: back[key] for key in back if key not in ("parameters", "functions", "coordinates")
        }
        assert _meaning(given | {key: back[key] for key in back if key in document}) == expected


TYPED = [
    ("equations", "  x'' = -sin(x) + a*y'\ny'' = -(x - 1)/sqrt(y)"),
    ("lagrangian", " L = (x'^2 + exp(2*y)*y'^2)/2 - cos(x)"),
    ("constraints", "y' - x*x'; z' = sin(x)*x'"),
]


@pytest.mark.parametrize(("field", "text"), TYPED)
def test_an_error_is_marked_where_it_is(field: str, text: str) -> None:
    """In texts that break off, or have a strange sign, at any place: its line, around the marked
    character, and the column of that in it; never no place where the reader knows one.
    """
    rest = {"lagrangian": "(x'^2 + y'^2 + z'^2)/2"} if field == "constraints" else {}
    kind = {"kind": "equations" if field == "equations" else "nonholonomic"}
    marked = 0
    for k in range(len(text), 2, -2):
        for typed in (text[:k], f"{text[:k]}\u00a7{text[k:]}"):
            fields = dict.fromkeys(forms.FIELDS, "") | kind | rest | {field: typed}
            try:
                parse_document(forms.document_of_fields(fields))
            except errors.InputError as error:
                for place, shown in zip(error.places, forms.problem_of(error, fields), strict=True):
                    if place.column is None or not place.pointer.startswith(f"/{field}"):
                        continue
                    marked += 1
                    assert shown.line is not None
                    assert shown.column is not None
                    line = typed.split("\n")[shown.line - 1]
                    assert f"{shown.before}{shown.marked}{shown.after}".rstrip() == line.rstrip()
                    assert len(shown.before) == shown.column - 1
                    if "\u00a7" in typed and shown.marked != "\u00a7":
                        assert "\u00a7" not in shown.detail
    assert marked > 10


def test_guess_in_place_of_the_constants_is_no_name() -> None:
    """A link, and the form, take it as documents do: undeclared names are constants."""
    fields = forms.fields_of_link({"equations": "x'' = -k*x", "parameters": " guess "})
    assert fields is not None
    document = forms.document_of_fields(fields)
    assert document == {"equations": "x'' = -k*x", "parameters": "guess"}
    assert parse_document(document)["guessed"] == ["k"]
