"""The pages that are made from the program are those that it makes now."""

from __future__ import annotations

import inspect

import inverse_service
from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs.reference import DOCS, fields_page, reference

AGAIN = "run `make reference`"


def test_the_page_of_fields_is_that_of_the_description() -> None:
    assert (DOCS / "fields.md").read_text() == fields_page(create_application(read_settings()).openapi()), AGAIN


def test_the_python_reference_is_that_of_the_docstrings() -> None:
    page = (DOCS / "reference.md").read_text()
    assert page == reference(), AGAIN
    for name in inverse_service.__all__:
        assert inspect.ismodule(getattr(inverse_service, name)) or f"### {name}\n" in page


def test_every_entry_of_the_reference_says_something() -> None:
    entries = (DOCS / "reference.md").read_text().split("\n### ")[1:]
    assert len(entries) > 25
    assert [entry.split("\n")[0] for entry in entries if len(entry.split("\n\n")) < 3] == []
