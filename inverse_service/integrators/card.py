"""What a method is, for tables and refusals."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MethodCard:
    """`order` at alpha = 1/2 and at any other alpha; `requires` and `source` in words."""

    name: str
    order: str
    requires: str
    source: str
