"""The tree of special cases: generic first, then wherever a verdict may change, decided again.

Each case is decided by `decide` on the system with its values put in; the side conditions of the
verdict lead to smaller cases. A case whose verdicts are those of the smallest kept cases that contain
it is implied and is not listed. The tree is complete when every case was settled: its verdicts hold on
all of it off the cases below.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.expressions import printing
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.solving.special_cases import splitting
from inverse_service.solving.special_cases.cases import (
    UNDEFINED,
    Case,
    FunctionCase,
    Progress,
    Question,
    condition_texts,
    equation_texts,
    examine,
)
from inverse_service.solving.special_cases.strata import ParameterSpace, Stratum

MOST_CASES = 120
DEEPEST = 8


@dataclass(frozen=True)
class Node:
    """A kept case with the kept cases inside it whose verdicts differ."""

    case: Case
    children: tuple[Node, ...] = ()


@dataclass(frozen=True)
class SpecialCases:
    """The tree, the cases examined on the way, and what is not known."""

    question: Question
    root: Node
    examined: tuple[Case, ...]
    reasons: tuple[str, ...]
    complete_with_time: bool

    @property
    def complete(self) -> bool:
        """Whether no other case has another verdict on any question asked."""
        return not self.reasons


@dataclass(slots=True)
class _Exploration:
    """The cases found so far and those still waiting, with their depth."""

    question: Question
    waiting: list[tuple[Stratum, FunctionCase, int]]
    seen: list[tuple[Stratum, FunctionCase]]
    cases: list[Case] = field(default_factory=list)
    # What is not known, and where; whether that is about L(q, v) alone.
    reasons: list[tuple[str, str]] = field(default_factory=list)
    time_is_open: bool = False


def special_cases(
    system: SecondOrderSystem,
    time_dependent: bool | None,
    deadline: float = float("inf"),
    progress: Progress | None = None,
    seed: int = 1,
    most: int = MOST_CASES,
) -> SpecialCases:
    """For which values of the parameters, and which functions, is the system variational?

    `time_dependent` as in `SolveOptions`. At most `most` cases are examined, until `deadline`
    (`now`); what was left out is named in the reasons.
    """
    constants = _constants(system)
    space = ParameterSpace((*system.parameters, *itertools.chain.from_iterable(constants.values())))
    question = Question(system, space, constants, time_dependent, seed, deadline, progress or (lambda _: None))
    starts = _starts(question)
    work = _Exploration(question, [(s, f, 0) for s, f in starts], list(starts))
    _advance(work)  # the generic case is examined whatever the limits
    while work.waiting and not _stopped(work, most):
        _advance(work)
    root = _tree(question, work.cases)
    return SpecialCases(question, root, tuple(work.cases), tuple(_grouped(work.reasons)), not work.time_is_open)


def _grouped(reasons: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Each reason once, with the first of the cases that it holds for."""
    table: dict[str, list[str]] = {}
    for text, where in reasons:
        table.setdefault(text, []).append(where)
    for text, places in table.items():
        named = [place for place in places if place]
        others = f" and {len(named) - 1} more" if len(named) > 1 else ""
        yield f"{text} ({named[0]}{others})" if named else text


def _constants(system: SecondOrderSystem) -> dict[str, tuple[str, ...]]:
    """For each function that occurs, unused names for its coefficients as a polynomial."""
    occurring = {node.name for f in system.accelerations for node in ex.walk(f) if isinstance(node, ex.Arbitrary)}
    used = {*system.parameters, *system.coordinates}
    found: dict[str, tuple[str, ...]] = {}
    for name, arguments in system.functions:
        if name in occurring:
            stem = name + "_"
            while any(f"{stem}{k}" in used for k in range(3)):
                stem += "_"
            degree = (2 if len(occurring) == 1 else 1) if len(arguments) == 1 else 0
            found[name] = tuple(f"{stem}{k}" for k in range(degree + 1))
    return found


def _starts(question: Question) -> list[tuple[Stratum, FunctionCase]]:
    """Each function arbitrary, or a polynomial, in every combination; high degrees before low ones."""
    names = list(question.constants)
    found = []
    for size in range(len(names) + 1):
        for chosen in itertools.combinations(names, size):
            functions = frozenset(chosen)
            plain = _unused(question, functions)
            lengths = [range(len(question.constants[name]), 0, -1) for name in chosen]
            for kept in itertools.product(*lengths):
                zero = [c for name, k in zip(chosen, kept, strict=True) for c in question.constants[name][k:]]
                found.append((_zero(question, [*plain, *zero]), functions))
    return found


def _unused(question: Question, functions: FunctionCase) -> list[str]:
    """Coefficients of functions that stay arbitrary: no parameters of the case, and put to zero."""
    return [c for name, constants in question.constants.items() if name not in functions for c in constants]


def _zero(question: Question, names: Sequence[str]) -> Stratum:
    space = question.space
    return splitting.split(space, [space.context.gen(space.names.index(name)) for name in names])[0]


def _stopped(work: _Exploration, most: int) -> bool:
    over = now() > work.question.deadline
    if len(work.cases) < most and not over:
        return False
    work.time_is_open = True
    limit = "the time limit" if over else f"the limit of {most} cases"
    work.reasons.append((f"{limit} came with {len(work.waiting)} cases not yet examined", ""))
    return True


def _advance(work: _Exploration) -> None:
    """Examine the next case; breadth first, so that large cases come before the small ones inside them."""
    stratum, functions, depth = work.waiting.pop(0)
    work.question.progress(f"special cases: {len(work.cases)} examined, {len(work.waiting)} waiting")
    if stratum.unsolved:
        work.time_is_open = True
        text = ", ".join(equation_texts(stratum, stratum.unsolved))
        work.reasons.append((f"not solved for a parameter: {text}", ""))
        return
    case = examine(work.question, stratum, functions)
    if case.unsettled == UNDEFINED and work.cases:
        return
    work.cases.append(case)
    reasons = _reasons(case)
    work.reasons += reasons
    work.time_is_open |= bool(reasons[case.time_settled :])
    inner = _inside(work.question, case)
    if inner and depth == DEEPEST:
        work.time_is_open = True
        work.reasons.append((f"further cases lie beyond the depth {DEEPEST}", _where(case)))
        return
    for piece in inner:
        if not any(functions == f and piece.contains(s) and s.contains(piece) for s, f in work.seen):
            work.seen.append((piece, functions))
            work.waiting.append((piece, functions, depth + 1))


def _inside(question: Question, case: Case) -> list[Stratum]:
    """The pieces of a case on which a divisor vanishes."""
    stratum, space = case.stratum, question.space
    ideals = [ideal.polynomials for ideal in case.ideals if ideal.polynomials]
    ideals += [(factor,) for factor in stratum.excluded]
    if case.unsettled:
        occurring = {node.name for f in case.system.accelerations for node in ex.walk(f) if isinstance(node, ex.Symbol)}
        ideals += [(space.context.gen(space.names.index(name)),) for name in stratum.free if name in occurring]
    found = [splitting.split(space, [*stratum.equations, *polynomials]) for polynomials in ideals]
    return [inner for pieces in found for inner in pieces if not inner.contains(stratum)]


def _reasons(case: Case) -> list[tuple[str, str]]:
    """Why not all is known inside a case; one that is about L(q, v) alone comes first."""
    about = "for L(q, q') alone: " if case.time_settled else ""
    found = [(f"{about}{case.unsettled}", _where(case))] if case.unsettled else []
    for ideal in case.ideals:
        if ideal.functional and not any(_is_covered(case.question, tree) for tree in ideal.functional):
            found.append((f"not examined where {_together(ideal.functional)}", _where(case)))
    return found


def _together(trees: Sequence[ex.Expression]) -> str:
    """Equations that hold together; the first of them where they fill pages."""
    texts = sorted((f"{printing.to_text(tree)} = 0" for tree in trees), key=len)
    whole = " and ".join(texts)
    if len(whole) <= bounds.SHOWN:
        return whole
    shown = texts[0] if len(texts[0]) <= bounds.SHOWN else "a long condition on the functions holds"
    return shown if len(texts) == 1 else f"{shown} and {len(texts) - 1} more equations hold with it"


def _is_covered(question: Question, tree: ex.Expression) -> bool:
    """Whether the tree vanishes only for polynomials of the degrees that are cases of their own."""
    match tree:
        case ex.Product(parts):
            return all(isinstance(part, ex.Number) or _is_covered(question, part) for part in parts)
        case ex.Power(base, ex.Number()):
            return _is_covered(question, base)
        case ex.Arbitrary(name, _, orders):
            return len(orders) == 1 and orders[0] <= len(question.constants.get(name, ()))
    return False


def _where(case: Case) -> str:
    texts = condition_texts(case)
    return "in general" if not texts else "where " + ", ".join(texts)


def _tree(question: Question, cases: Sequence[Case]) -> Node:
    """Cases whose verdicts differ from those of the smallest kept cases around them, under one of these."""
    kept: list[Case] = []
    parents: list[int] = []
    for case in sorted(cases, key=lambda c: (len(c.functions), -c.stratum.dimension)):
        around = [k for k, other in enumerate(kept) if _contains(question, other, case)]
        smallest = [k for k in around if not any(k != m and _contains(question, kept[k], kept[m]) for m in around)]
        other = [k for k in smallest if kept[k].verdicts != case.verdicts]
        if not smallest or other:
            kept.append(case)
            parents.append(other[0] if other else -1)
    return _node(kept, parents, 0)


def _node(kept: Sequence[Case], parents: Sequence[int], place: int) -> Node:
    inner = [k for k, parent in enumerate(parents) if parent == place]
    return Node(kept[place], tuple(_node(kept, parents, k) for k in inner))


def _contains(question: Question, large: Case, small: Case) -> bool:
    """Whether the small case is part of the closure of the large one."""
    if not large.functions <= small.functions:
        return False
    unused = _unused(question, large.functions)
    generators = [question.space.context.gen(question.space.names.index(name)) for name in unused]
    equations = [e for e in large.stratum.equations if not any(e == g for g in generators)]
    if not all(small.stratum.vanishes(equation) for equation in equations):
        return False
    return len(equations) < 2 or not any(small.stratum.vanishes(factor) for factor in large.stratum.excluded)
