"""What all documents have in common."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """Frozen, no unknown keys, no silent change of types."""

    # Built at the first use: a single call needs few of them, and all take 0.02 s.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)
