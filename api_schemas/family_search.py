"""The search among associated systems: what a document may ask, and the part of a result that answers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from api_schemas.base import Document

Verdict = Literal["variational", "not_variational", "undetermined"]
FamilyName = Literal["products", "forces", "ratios", "mixtures", "multiples"]
MAX_DEPTH = 60
MAX_MEMBERS = 100_000


class FamilySearchOptions(Document):
    """Which families (left out: all), the highest power or multiple, and the most members of each family."""

    families: Annotated[list[FamilyName], Field(min_length=1, max_length=5)] | None = None
    depth: Annotated[int, Field(ge=1, le=MAX_DEPTH, strict=True)] = 2
    members: Annotated[int, Field(ge=1, le=MAX_MEMBERS, strict=True)] = 1_000


class FamilyPart(Document):
    """One family: `size` choices, of which the simplest `members` different ones were taken, by verdict."""

    name: str
    description: str
    size: int
    members: int
    decided: int
    variational: int
    not_variational: int
    undetermined: int


class FoundFormula(Document):
    """A formula in plain text and in LaTeX."""

    text: str
    latex: str


class FoundMember(Document):
    """A variational associated system and what was found for it.

    `kinds` names first, second, third where it is one of these. `checked` is the independent checker's
    verdict; `holds` says that the flow of H on the image of the constraints was confirmed to be the
    nonholonomic motion, null where it was not tested.
    """

    families: list[str]
    kinds: list[str]
    equations: dict[str, str]
    latex: dict[str, str]
    verdict: Verdict = "variational"
    checked: Literal["valid", "incomplete", "invalid"] | None = None
    statement: str = ""
    lagrangian: FoundFormula | None = None
    hamiltonian: FoundFormula | None = None
    constraints: list[FoundFormula] = Field(default_factory=list)
    holds: bool | None = None


class SearchPart(Document):
    """The families with their counts, and every variational system found, each once."""

    question: Literal["L(q, q')", "L(t, q, q')"]
    families: list[FamilyPart]
    different: int
    variational: list[FoundMember]
    covered: str
    seconds: float
