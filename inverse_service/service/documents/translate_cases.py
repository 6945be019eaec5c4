"""The tree of special cases as the part of a result."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from api_schemas import result
from inverse_service.decision.solutions import Verdict
from inverse_service.expressions import printing, printing_latex
from inverse_service.solving.special_cases import cases
from inverse_service.solving.special_cases.case_tree import Node, SpecialCases

Reading = Callable[[cases.Case], Verdict | None]


def to_special_cases(found: SpecialCases) -> result.SpecialCasesPart:
    """The part of the document; raises nothing."""
    both = found.root.case.autonomous is not None and found.root.case.with_time is not None
    return result.SpecialCasesPart(
        tree=_node(found.root),
        variational_when=list(_variational(found.root, main_verdict, False)),
        variational_when_with_time=list(_variational(found.root, lambda case: case.with_time, False)) if both else None,
        examined=len(found.examined),
        complete=found.complete,
        complete_with_time=found.complete_with_time if both else None,
        reasons=list(found.reasons),
    )


def main_verdict(case: cases.Case) -> Verdict | None:
    """The verdict of the question that a result answers in its main fields."""
    return case.autonomous if case.autonomous is not None else case.with_time


def _node(node: Node) -> result.CaseNode:
    case = node.case
    main = main_verdict(case)
    assert main is not None, "each case answers a question"
    return result.CaseNode(
        conditions=_conditions_of(case),
        verdict=main,
        verdict_with_time=case.with_time,
        dimension=case.stratum.dimension,
        statement=case.statement,
        reason=case.reason,
        children=[_node(child) for child in node.children],
    )


def _variational(node: Node, verdict: Reading, inside: bool) -> Iterator[result.VariationalCase]:
    """The largest cases with this verdict, in the order of the tree."""
    here = verdict(node.case) == "variational"
    if here and not inside:
        yield result.VariationalCase(
            conditions=_conditions_of(node.case),
            dimension=node.case.stratum.dimension,
            exceptions=[_conditions_of(child.case) for child in node.children if verdict(child.case) != "variational"],
        )
    for child in node.children:
        yield from _variational(child, verdict, here)


def _conditions_of(case: cases.Case) -> list[result.Formula]:
    return [
        result.Formula(
            text=f"{printing.to_text(left)} = {printing.to_text(right)}",
            latex=f"{printing_latex.to_latex(left)} = {printing_latex.to_latex(right)}",
        )
        for left, right in cases.conditions(case)
    ]
