"""Which kind of document is meant, seen from its keys."""

from __future__ import annotations

from typing import Any


def is_nonholonomic(document: Any) -> bool:
    """Whether a document is meant as a Lagrangian with constraints."""
    return isinstance(document, dict) and ("lagrangian" in document or "constraints" in document)
