"""The part of a result that says for which parameters and functions a Lagrangian exists."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api_schemas.base import Document

Verdict = Literal["variational", "not_variational", "undetermined"]


class Condition(Document):
    """An equation between parameters, or what a function is, in plain text and in LaTeX."""

    text: str
    latex: str


class CaseNode(Document):
    """The system where all conditions hold and none of those of its children.

    `dimension` counts the parameters that stay free, `statement` says how large the space of
    multipliers is. `verdict` answers the question of the result, `verdict_with_time` L(t, q, q').
    """

    conditions: list[Condition]
    verdict: Verdict
    verdict_with_time: Verdict | None = None
    dimension: int
    statement: str = ""
    reason: str = ""
    children: list[CaseNode] = Field(default_factory=list)


class VariationalCase(Document):
    """A largest case with a Lagrangian; each of `exceptions` is a list of conditions inside it."""

    conditions: list[Condition]
    dimension: int
    exceptions: list[list[Condition]] = Field(default_factory=list)


class SpecialCasesPart(Document):
    """The tree of cases from the generic one down; those with the verdict of what contains them are left out.

    `variational_when` answers the question of the result, `variational_when_with_time` L(t, q, q').
    `complete`: no other case has another verdict; else `reasons` say where this is not known.
    `complete_with_time` is that for L(t, q, q') alone, where both questions are asked.
    """

    tree: CaseNode
    variational_when: list[VariationalCase]
    variational_when_with_time: list[VariationalCase] | None = None
    examined: int
    complete: bool
    complete_with_time: bool | None = None
    reasons: list[str] = Field(default_factory=list)
