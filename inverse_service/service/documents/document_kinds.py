"""Which kind of document is meant, seen from its keys."""

from __future__ import annotations

from typing import Any


def is_motion(document: Any) -> bool:
    """Whether a document gives a motion on constraints as it is."""
    return isinstance(document, dict) and "motion" in document


def is_nonholonomic(document: Any) -> bool:
    """Whether a document is meant as a Lagrangian with constraints."""
    return isinstance(document, dict) and ("lagrangian" in document or "constraints" in document)


def is_forward(document: Any) -> bool:
    """Whether a document is a Lagrangian and nothing else that says what moves."""
    if not isinstance(document, dict) or "equations" in document:
        return False
    return "lagrangian" in document and document.get("constraints") in (None, [], "")
