"""What all documents have in common: strictness, and sizes; formulas have further limits where they are read."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

MAX_COORDINATES = 12
MAX_SIMULATED = 32  # coordinates of a scene
MAX_FORWARD = 256  # coordinates of a Lagrangian whose equations are asked for
MAX_PARAMETERS = 32
MAX_FUNCTIONS = 16
MAX_FUNCTION_ARGUMENTS = 6
MAX_NAME_CHARACTERS = 40
MAX_TITLE_CHARACTERS = 500
MAX_FORMULA_CHARACTERS = 20_000
MAX_EQUATIONS = 16
MAX_VALUE_CHARACTERS = 200


class Document(BaseModel):
    """Frozen, no unknown keys, no silent change of types."""

    # Built at the first use: a single call needs few of them, and all take 0.02 s.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)
