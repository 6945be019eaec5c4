"""Texts of the corpus, each parsed once in a process that asks several things of it."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from inverse_service.errors import InputError
from inverse_service.service.documents.documents import parse_document


def read(document: Any) -> Any:
    """What a document is parsed as, or the InputError with which it is refused."""
    try:
        return parse_document(document)
    except InputError as error:
        return error


def parsed(document: Any) -> Any:
    """The same, which nobody changes."""
    return _parsed(json.dumps(document))


@cache
def _parsed(text: str) -> Any:
    return read(json.loads(text))
