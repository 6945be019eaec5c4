"""The tree of special cases as the page shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from inverse_service.expressions.names import Names
from inverse_service.web.pages import typesetting


@dataclass(frozen=True, slots=True)
class Case:
    """A case with its conditions, verdict and the cases inside it."""

    conditions: list[Markup]
    verdict: str
    statement: str
    children: list[Case]


@dataclass(frozen=True, slots=True)
class Cases:
    """The tree, and where a Lagrangian exists: conditions with the exceptions inside them."""

    tree: Case
    variational_when: list[tuple[list[Markup], list[list[Markup]]]]
    complete: bool
    examined: int
    reasons: list[str]


def cases_of(result: Mapping[str, Any]) -> Cases | None:
    """The special cases of a result, None where they were not asked for."""
    part = result.get("special_cases")
    if not part:
        return None
    names = typesetting.names_of(result["system"])
    when = [
        (_conditions(case["conditions"], names), [_conditions(exception, names) for exception in case["exceptions"]])
        for case in part["variational_when"]
    ]
    return Cases(_case(part["tree"], names), when, part["complete"], part["examined"], part["reasons"])


def _case(node: Mapping[str, Any], names: Names) -> Case:
    children = [_case(child, names) for child in node["children"]]
    statement = node["statement"] or node["reason"]
    return Case(_conditions(node["conditions"], names), node["verdict"], statement, children)


def _conditions(conditions: Sequence[Mapping[str, str]], names: Names) -> list[Markup]:
    return [typesetting.formula(condition["text"], names) for condition in conditions]
