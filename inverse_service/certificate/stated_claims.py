"""What a result states beside its certificate: where it holds, and its Hamiltonian."""

from __future__ import annotations

import random
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from . import cell, formulas as fm, question as qu
from .cell import Cell
from .judging import CheckResult, judged

_SHAPE = {"text": r"(?s:.*)", "momenta": {}, "domain?": [fm.TEXT, fm.MAX_LISTED]}
_WRONG = "The Hamiltonian of an answer is not that of its Lagrangian."
_NAMED = "The momenta are not p_x for each coordinate x."
_VELOCITIES = "A Hamiltonian that is not implicit must not contain velocities."
_IMPLICIT = "An implicit Hamiltonian must contain velocities."


class Lacking(NamedTuple):
    """Members of a proven cell that a stated domain lacks, and the places of stated ones that were
    not proven.
    """

    missing: list[str]
    beyond: set[int]


def lacking_members(
    certificate: Mapping[str, Any], stated: Sequence[str], proven: Cell | None, limit: float
) -> Lacking:
    """The members of the proven cell that do not follow from a stated domain; stated ones that were
    not proven.
    """
    if proven is None:
        return Lacking([], {*range(len(stated))})
    try:
        missing, beyond = cell.lacking(certified_question(certificate, limit), stated, proven)
    except fm.Ended as end:
        return (
            Lacking([*end.reasons], set())
            if end.verdict == "invalid"
            else Lacking([], {*range(len(stated))})
        )
    return Lacking(missing, {*beyond})


def certified_question(certificate: Mapping[str, Any], limit: float) -> qu.Question:
    tools = qu.Tools(random.Random(), time.thread_time() + max(1.0, limit))
    question = qu.Question(tools, certificate["system"], claim=dict(certificate))
    question.read_integrals(certificate.get("integrals") or {})
    return question


def narrowed(
    certificate: Mapping[str, Any],
    proof: CheckResult,
    where: Cell | None,
    limit: float,
) -> CheckResult:
    """A proof about q'' = f as one about equations as given, which say the same on a cell only."""
    if where is None or where == Cell() or proof.cell is None or proof.formulas is None:
        return proof
    try:
        more, _ = cell.lacking(certified_question(certificate, limit), proof.cell.domain, where)
    except fm.Ended:
        more = [*where.domain]

    def both(one: Cell) -> Cell:
        return replace(one, domain=(*one.domain, *more), unknown=one.unknown or where.unknown)

    return replace(proof, cell=both(proof.cell), formulas=both(proof.formulas))


@dataclass(frozen=True, slots=True)
class Judged:
    """The verdict on H; whether that is proven, whether its stated domain has all that H needs,
    and what it lacks of positions and t; of constants alone, exceptions say that.
    """

    verdict: str
    reason: str = ""
    proven: bool = True
    whole: bool = True
    lacks: Sequence[str] = ()


class _StatedDomain(NamedTuple):
    """Whether it is that of H, and the conditions on positions and t that it lacks."""

    whole: bool
    lacks: list[str]


def judge_hamiltonian(certificate: Mapping[str, Any], shown: Any, time_limit: float) -> Judged:
    """H(q, p) = p v - L and p = dL/dv, where v is that of a point at which the domain of H holds.

    That point is the one of the certificate, or else any other one. Momenta go by their names, and
    velocities occur in an H that is `implicit` alone.
    """
    notes: dict[str, Any] = {"proven": False, "whole": False}
    found = CheckResult("incomplete")
    for claim in (certificate, {**certificate, "near": None}):
        if found.verdict == "incomplete":
            found = judged(partial(_agreed, claim, shown, notes), time_limit, None)
    reason = found.reasons[0] if found.reasons else ""
    return Judged(found.verdict, reason, **notes)


def momenta_of(names: Sequence[str], momenta: Mapping[str, Any]) -> dict[str, str]:
    """{coordinate: the name of its momentum}: p_x, or momentum_x, momentum_x_2, … where that is
    taken.
    """
    found = dict[str, str]()
    for name in names:
        others = (
            key
            for key in momenta
            if key == f"momentum_{name}" or key.startswith(f"momentum_{name}_")
        )
        chosen = f"p_{name}" if f"p_{name}" in momenta else next(others, None)
        if chosen is None:
            return {}
        found[name] = chosen
    return found if len({*found.values()}) == len(momenta) else {}


def _agreed(
    certificate: Mapping[str, Any], shown: Any, notes: dict[str, Any], tools: Any
) -> list[str]:
    fm.check_shape(shown, _SHAPE, "hamiltonian")
    question = qu.Question(tools, certificate["system"], claim=dict(certificate))
    question.read_integrals(certificate.get("integrals") or {})
    lagrangian = fm.read_tokens(certificate["lagrangian"], "lagrangian")
    energy = fm.read_tokens(shown["text"], "hamiltonian")
    named = momenta_of(question.coordinates, shown["momenta"])
    fm.require(named, _NAMED)
    momenta = {
        named[x]: fm.read_tokens(shown["momenta"][named[x]], "momenta")
        for x in question.coordinates
    }
    holds = any(
        token.rstrip("'") in question.coordinates and token.endswith("'") for token in energy
    )
    fm.require(holds <= bool(shown.get("implicit")), _VELOCITIES)
    fm.require(holds >= bool(shown.get("implicit")), _IMPLICIT)
    listed = [text for text in shown.get("domain") or [] if "!=" not in text]
    conditions = sorted({qu.read_condition(text) for text in listed})
    speeds = [f"{name}'" for name in question.coordinates]

    before = list[cell.Need]()  # of L, the momenta, and what the stated domain says is positive

    def parts(ring: Any) -> Any:
        whole, p = fm.value_of(ring, lagrangian), {}
        for name, text in momenta.items():
            p[name] = fm.value_of(ring, text)
        if isinstance(ring, cell.Letters):
            before.clear()
            before.extend(
                [
                    *ring.needs,
                    *(need for value in (whole, *p.values()) for need in ring.needs_of(value)),
                ]
            )
        stated = [
            ring.add([fm.value_of(ring, side, **p) for side in pair], [1, -1])
            for pair in conditions
        ]
        for value in () if question.rational else stated:
            ring.elementary("log", value)
        question.held = True  # f, L, and p need not be defined everywhere
        if isinstance(ring, cell.Letters):
            ring.needs = {}
        work = [
            ring.multiply(ring.names[v], x, ring.degree)
            for v, x in zip(speeds, p.values(), strict=True)
        ]
        return (
            whole,
            p,
            ring.add([fm.value_of(ring, energy, **p), whole, *work], [1, 1] + [-1] * len(work)),
        )

    def claims(ring: Any) -> qu.Claims:
        whole, p, difference = parts(ring)
        slopes = [
            {0: ring.arithmetic.settle({0: whole.get(ring.units[v], 0)}).get(0, 0)} for v in ring.v
        ]
        pairs = zip(p.values(), slopes, strict=True)
        zeros = [ring.add([{0: value.get(0, 0)}, slope], [1, -1]) for value, slope in pairs]
        return qu.Claims(
            [qu.Zero(ring.settle({0: zero.get(0, 0)}), _WRONG) for zero in (difference, *zeros)],
            [],
        )

    question.claimed, notes["proven"] = (claims, 1), True
    try:
        question.prepare(parts, [lagrangian, energy, *momenta.values()])
        question.settle(1, claims)
    except fm.Ended as end:
        if end.verdict == "invalid" or question.rational or not question.place.values:
            raise
        notes["proven"] = False
        question.look_around()  # which may refute it

    def stated_domain(ring: cell.Letters, apart: bool) -> _StatedDomain:
        """`apart`: with sines and cosines of sums expanded."""
        ring.apart = apart
        question.read_all(ring)
        _, p, difference = parts(ring)
        moving = {ring.texts.index(v) for v in speeds}
        # What L needs of positions alone has to be listed, also where it is a factor of what it
        # needs of velocities.
        each = [one for need in before for one in _apart(ring, need, moving)]
        held = [need for need in each if not moving & {*ring.holds(need.polynomial)}]
        needed = [*held, *ring.needs, *ring.needs_of(difference), *ring.cut]
        ring.needs = {}
        stated = [list(cell.needs_of_text(ring, text, p)) for text in shown.get("domain") or []]
        moving_ones = (need for need in each if need not in held)
        # An inequality that holds has two sides that are defined.
        known = cell.Knowledge(
            ring, [*moving_ones, *ring.needs, *(n for one in stated for n in one)]
        )
        follow = cell.Knowledge(ring, [*before, *needed])
        missing = [need for need in needed if not known.implies(need)]
        constants = {ring.texts.index(name) for name in ("pi", *question.own_parameters)}
        lacks = [
            f"{ring.text(need.polynomial)} {need.kind} 0"
            for need, places in ((need, {*ring.holds(need.polynomial)}) for need in missing)
            if not moving & places and not places <= constants
        ]
        same = all(follow.implies(n) for one in stated for n in one)
        return _StatedDomain(same and not missing, lacks)

    if notes["proven"]:
        notes["whole"], notes["lacks"] = cell.in_letters(
            question, partial(stated_domain, apart=False)
        )
        if (
            not notes["whole"]
            and cell.in_letters(question, partial(stated_domain, apart=True)).whole
        ):
            notes.update(whole=True, lacks=[])
    return [""]


def _apart(ring: cell.Letters, need: cell.Need, moving: set[int]) -> list[cell.Need]:
    """The need, or that none of its factors is zero where some contain the generators `moving` and
    some do not.
    """
    found = [p for p, _ in ring.factors(need.polynomial)[1]]
    moves = {bool(moving & {*ring.holds(p)}) for p in found}
    return [cell.need_of("!=", p) for p in found] if len(moves) == 2 else [need]
