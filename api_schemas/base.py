"""What all documents have in common."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """Frozen, no unknown keys, no silent change of types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)
