"""Unions of documents: what the checker reads, what came of a question or of a job, by its `format`."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, RootModel

from api_schemas.base import CheckAnswer, Document
from api_schemas.nonholonomic import NonholonomicDocument
from api_schemas.result import ForwardResult, LagrangianDocument, ResultDocument
from api_schemas.simulation import SimulationResult, WorkPrecisionResult
from api_schemas.system import SystemDocument

ByFormat = Field(discriminator="format")
Solved = ResultDocument | ForwardResult


class SolveResult(RootModel[Annotated[Solved, ByFormat]]):
    """What came of a system, by `format`."""


class JobResult(RootModel[Annotated[Solved | SimulationResult | WorkPrecisionResult | CheckAnswer, ByFormat]]):
    """What came of a job, by `format`."""


class ResultOfDocument(Document):
    """A result with the document that it is to be of."""

    document: SystemDocument | NonholonomicDocument | LagrangianDocument
    result: Annotated[Solved, ByFormat]


class OwnLagrangian(Document):
    """A Lagrangian that may yield the equations of a system."""

    system: SystemDocument | NonholonomicDocument
    lagrangian: str


class Certificate(BaseModel):
    """A certificate alone, as older results had it."""

    format: Literal["inverse-service/certificate/2", "inverse-service/certificate/1"]
    system: dict[str, Any]


class Identities(BaseModel):
    """The output of `solve --format identities`."""

    theorems: list[Any] = Field(description="The output of `solve --format identities`.")


class CheckedDocument(RootModel[ResultDocument | ResultOfDocument | OwnLagrangian | Certificate | Identities]):
    """What the checker reads; of anything else it says itself what is missing."""
