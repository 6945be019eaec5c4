"""The Lagrangian document without constraints, and its answer: the forward problem."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from api_schemas.base import MAX_FORWARD, Document
from api_schemas.problem import ParseAnswer, ParsedFormula
from api_schemas.result import Formula, HamiltonianPart, UnderstoodSystem
from api_schemas.system import Name, NamedDocument, Text

FORWARD_FORMAT: Final = "inverse-service/forward/1"


class LagrangianDocument(NamedDocument):
    """A Lagrangian L(t, q, q') alone: its equations of motion, momenta and Hamiltonian are asked for."""

    coordinates: Annotated[list[Name], Field(min_length=1, max_length=MAX_FORWARD)] | None = None
    lagrangian: Text


class ForwardParseAnswer(ParseAnswer):
    """What was understood; `equations` are the accelerations of the motion."""

    lagrangian: ParsedFormula


class ConservedQuantity(Formula):
    """A function that is constant along the motion."""

    name: str


class ForwardResult(Document):
    """The equations q'' = f of a Lagrangian, p_i = dL/dv_i, H, and what the symmetries of its letters conserve."""

    format: Literal["inverse-service/forward/1"] = FORWARD_FORMAT
    system: UnderstoodSystem
    lagrangian: Formula
    equations: dict[str, Formula]
    momenta: dict[str, Formula]
    hamiltonian: HamiltonianPart
    conserved: list[ConservedQuantity]
    guessed: list[str] = Field(default_factory=list)
