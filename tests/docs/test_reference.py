"""The generated pages are up to date with the program."""

from __future__ import annotations

from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs import manual
from tests.docs.reference import PAGE, fields_page

AGAIN = "run `make reference`"


def test_the_page_of_fields_is_that_of_the_description() -> None:
    assert PAGE.read_text() == fields_page(create_application(read_settings()).openapi()), AGAIN


def test_the_manual_page_is_the_help_of_the_program() -> None:
    assert manual.PAGE.read_text(encoding="utf-8") == manual.manual(), AGAIN
