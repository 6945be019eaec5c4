"""Whether the Hamiltonian of an answer belongs to its Lagrangian: in the rings of the checker, by its own reader."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import Any

from inverse_service.certificate.checker import CheckResult, Claims, Question, judged
from inverse_service.certificate.formulas import Ended, Reader, check_shape, read_tokens
from inverse_service.certificate.results import inequalities
from inverse_service.deadline import now

_SHAPE = {
    "text": r"(?s:.*)",
    "momenta": {},
}
RIGHT, UNPROVEN = "It is that of its Lagrangian.", "It is so at some points."
_WRONG = "The Hamiltonian of an answer is not that of its Lagrangian."
_PARTS = ("with_time", "instead", "with_clock")
Certificate = Mapping[str, Any]


def compared_hamiltonians(result: Mapping[str, Any], end: float) -> CheckResult:
    """The worst of the verdicts on all Hamiltonians; `reasons` are UNPROVEN where one only seems to be right."""
    worst = CheckResult("valid")
    for answer in _answers(result):
        found = _compared(answer["certificate"], answer["hamiltonian"], end - now())
        if found.verdict != "valid":
            return found
        worst = CheckResult("valid", found.reasons) if UNPROVEN in found.reasons else worst
    return worst


def _answers(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The answers with a Hamiltonian besides the proven Lagrangian."""
    branches = result.get("branches")
    for part in (result, *(branches if isinstance(branches, list) else [])):
        for answer in (part, *(part.get(key) for key in _PARTS)) if isinstance(part, dict) else ():
            proof = answer.get("certificate") if isinstance(answer, dict) else None
            known = isinstance(proof, dict) and isinstance(proof.get("lagrangian"), str)
            if isinstance(answer, dict) and known and answer.get("hamiltonian") is not None:
                yield answer


def _compared(certificate: Certificate, shown: Any, time_limit: float) -> CheckResult:
    """H(q, p) = p v - L and p = dL/dv, where v is that of a point at which the domain of H holds.

    That point is the one of the certificate, or else any other one.
    """
    found = CheckResult("incomplete")
    for claim in (certificate, {**certificate, "near": None}):
        if found.verdict == "incomplete":
            found = judged(functools.partial(_agreed, claim, shown), time_limit, None)
    return found


def _agreed(certificate: Certificate, shown: Any, tools: Any) -> list[str]:
    check_shape(shown, _SHAPE, "hamiltonian")
    question = Question(tools, certificate["system"], True, dict(certificate))
    question.read_integrals(certificate.get("integrals") or {})
    lagrangian, energy = read_tokens(certificate["lagrangian"], "lagrangian"), read_tokens(shown["text"], "hamiltonian")
    momenta = {name: read_tokens(text, "momenta") for name, text in shown["momenta"].items()}
    conditions = sorted(inequalities(shown.get("domain") or []))
    speeds = [f"{name}'" for name in question.coordinates]

    def parts(ring: Any) -> Any:
        whole, p = Reader(ring, lagrangian).value, {}
        for name, text in momenta.items():
            p[name] = Reader(ring, text).value
        question.held = False
        for more, less in () if question.rational else conditions:
            sides = [Reader(ring, side, **p).value for side in (more, less)]
            ring.elementary("log", ring.add(sides, [1, -1]))
        question.held = True
        work = [ring.multiply(ring.names[v], x, ring.degree) for v, x in zip(speeds, p.values(), strict=True)]
        return whole, p, ring.add([Reader(ring, energy, **p).value, whole, *work], [1, 1] + [-1] * len(work))

    def claims(ring: Any) -> Claims:
        whole, p, difference = parts(ring)
        slopes = [{0: ring.arithmetic.settle({0: whole.get(ring.units[v], 0)}).get(0, 0)} for v in ring.v]
        pairs = zip(p.values(), slopes, strict=True)
        zeros = [ring.add([{0: value.get(0, 0)}, slope], [1, -1]) for value, slope in pairs]
        return Claims([(ring.settle({0: zero.get(0, 0)}), _WRONG) for zero in (difference, *zeros)], [])

    question.claimed, found = (claims, 1), RIGHT
    try:
        question.prepare(parts, [lagrangian, energy, *momenta.values()])
        question.settle(1, claims)
    except Ended as end:
        if end.args[0] == "invalid" or question.rational or not question.place.values:
            raise
        found = UNPROVEN
    seen = 1 if question.rational else question.look_around()
    if not seen:
        raise Ended("incomplete", "No point was found at which the Hamiltonian of an answer is defined.")
    return [found]
