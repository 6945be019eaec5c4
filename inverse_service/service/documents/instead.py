"""The key `instead` of a result: what holds where there is no L(q, q'), the first of what is quickly found.

Special cases, friction and clocks are loaded by the documents that have use for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from api_schemas.result import ClockPart, InsteadPart, ResultDocument
from inverse_service import errors
from inverse_service.certificate.checker import CheckResult
from inverse_service.deadline import now
from inverse_service.decision import deciding
from inverse_service.decision.solutions import Solution, SolveOptions
from inverse_service.explanation import positive
from inverse_service.expressions import collecting, printing
from inverse_service.expressions import tree as ex
from inverse_service.mechanics import second_order_system
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting, preparing, translate
from inverse_service.solving import solving

if TYPE_CHECKING:
    from api_schemas.nonholonomic import ReducedPart
    from inverse_service.solving.special_cases.case_tree import Node

_MOST_CASES = 6
_SHOWN = ("lagrangian", "hamiltonian", "certificate", "checked")
_WRONG = CheckResult("invalid", ("instead is not about the document's system with these parameters.",))
Values = Mapping[ex.Expression, ex.Expression]


def with_instead(result: ResultDocument, solution: Solution, asked: SolveOptions, deadline: float) -> ResultDocument:
    """The result with an L(t, q, q'), T - V with friction, or parameter values that leave an L(q, q')."""
    if solution.autonomous is None or solution.autonomous.verdict != "not_variational" or result.branches:
        return result
    found = _with_time(result) or _with_friction(solution, asked, deadline)
    found = found or _with_parameters(solution.system, asked.seed, deadline)
    return result if found is None else result.model_copy(update={"instead": found})


def _with_time(result: ResultDocument) -> InsteadPart | None:
    other = result.with_time
    if other is None or other.lagrangian is None or other.certificate is None:
        return None
    return InsteadPart(kind="time", lagrangian=other.lagrangian, hamiltonian=other.hamiltonian,
                       certificate=other.certificate, checked="valid")  # fmt: skip


def _with_friction(solution: Solution, asked: SolveOptions, deadline: float) -> InsteadPart | None:
    from inverse_service.solving.of_kind.rayleigh import quick_rayleigh

    given = [second_order_system.on_branch(equation, solution.system) for equation in asked.given]
    found = quick_rayleigh(deciding.analyze(solution.system), given, deadline)
    if found is None or found.lagrangian is None:
        return None
    from inverse_service.service.documents.kinds_part import kind_part

    names, lagrangian = solution.system.coordinates, found.lagrangian
    hamiltonian = positive.hamiltonian_of(lagrangian.expression, names, lagrangian.positive)
    shown_hamiltonian = None if hamiltonian is None else translate.hamiltonian_part(hamiltonian)
    shown = kind_part(found).model_dump(include={"lagrangian", "dissipation", "certificate", "checked"})
    return InsteadPart(kind="rayleigh", hamiltonian=shown_hamiltonian, **shown)


def _with_parameters(system: second_order_system.SecondOrderSystem, seed: int, deadline: float) -> InsteadPart | None:
    """The first of the special cases, parameters given by others, where a Lagrangian is found."""
    if not system.parameters or system.functions or now() > deadline:
        return None
    from inverse_service.service.documents.clock_part import answered
    from inverse_service.solving.special_cases.case_tree import special_cases
    from inverse_service.solving.special_cases.cases import conditions

    found = special_cases(system, False, deadline, None, seed, _MOST_CASES)
    for node in _variational(found.root):
        values = dict(conditions(node.case))
        left = deadline - now()
        if left < 0 or not values or not all(isinstance(name, ex.Symbol) for name in values):
            continue
        options = SolveOptions(time_dependent=False, seed=seed, time_limit=left, conditions=False)
        special = solving.solve(specialised(system, values), options)
        answer = special.autonomous
        if answer is not None and answer.lagrangian is not None and answer.checked == "valid":
            fields = answered(special.system, answer)
            texts = [f"{printing.to_text(name)} = {printing.to_text(value)}" for name, value in values.items()]
            return InsteadPart(kind="parameters", conditions=texts, equations=fields["equations"],
                               **{key: fields[key] for key in _SHOWN})  # fmt: skip
    return None


def _variational(node: Node) -> Iterator[Node]:
    if node.case.autonomous == "variational":
        yield node
    for child in node.children:
        yield from _variational(child)


def specialised(system: second_order_system.SecondOrderSystem, values: Values) -> second_order_system.SecondOrderSystem:
    """The system with these values of its parameters, which may hold others."""
    forces = tuple(collecting.collect(ex.substitute(f, dict(values))) for f in system.given)
    left = tuple(name for name in system.parameters if ex.Symbol(name) not in values)
    return replace(system, accelerations=forces, parameters=left, branch=None)


def of_reduced(reduced: ReducedPart | None) -> InsteadPart | None:
    """Of a motion on constraints: the reduced system, with Chaplygin's clock where it needs one."""
    for part in (reduced, reduced and reduced.with_clock):
        if part is not None and part.lagrangian is not None and part.checked == "valid":
            shown = {key: getattr(part, key) for key in _SHOWN}
            clock = part.factor if isinstance(part, ClockPart) else ""
            return InsteadPart(kind="reduced", equations=part.equations, clock=clock, **shown)
    return None


def compared_instead(document: Any, result: dict[str, Any], time_limit: float) -> CheckResult | None:
    """The checker's verdict on an `instead` about another system than the document's; None where there is none."""
    part = result.get("instead")
    if not isinstance(part, dict) or part.get("kind") not in ("reduced", "parameters"):
        return None
    from inverse_service.service.documents.clock_part import compared_answer

    if part["kind"] == "reduced":  # which is compared itself
        reduced = result.get("reduced") or {}
        known = [reduced, reduced.get("with_clock") or {}]
        good = any(all(one.get(key) == part.get(key) for key in (*_SHOWN, "equations")) for one in known)
        return None if good else _WRONG
    try:
        system = accepting.to_system(accepting.to_schema(preparing.prepared(document).document))
        names = Names(parameters=system.parameters, time=False)  # constants: a = x is no condition
        pairs = [text.split(" = ") for text in part["conditions"]]
        values = {reader.read_formula(name, names): reader.read_formula(value, names) for name, value in pairs}
    except (errors.InputError, KeyError, ValueError, AttributeError, TypeError):
        return _WRONG
    held = {node for tree in values.values() for node in ex.walk(tree)}
    if (
        not values
        or len(values) < len(pairs)
        or not {*values} <= {ex.Symbol(name) for name in system.parameters} - held
    ):
        return _WRONG
    return compared_answer({**part, "verdict": "variational"}, specialised(system, values), _WRONG, time_limit)
