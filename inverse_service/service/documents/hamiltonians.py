"""Whether the Hamiltonian of an answer belongs to its Lagrangian: in the rings of the checker, by its own reader."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from inverse_service.certificate import cell, checker, formulas
from inverse_service.certificate import question as checks
from inverse_service.expressions import derivative
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names

_SHAPE = {"text": r"(?s:.*)", "momenta": {}, "domain?": [formulas.TEXT, formulas.MAX_LISTED]}
_WRONG = "The Hamiltonian of an answer is not that of its Lagrangian."
_NAMED = "The momenta are not p_x for each coordinate x."
_VELOCITIES = "A Hamiltonian that is not implicit holds no velocities."
_IMPLICIT = "A Hamiltonian that is implicit holds velocities."


@dataclass(frozen=True, slots=True)
class Judged:
    """The verdict on H; whether that is proven, and whether its stated domain has all that H needs."""

    verdict: str
    reason: str = ""
    proven: bool = True
    whole: bool = True


def judge(certificate: Mapping[str, Any], shown: Any, time_limit: float) -> Judged:
    """H(q, p) = p v - L and p = dL/dv, where v is that of a point at which the domain of H holds.

    That point is the one of the certificate, or else any other one. Momenta go by their names, and velocities occur in
    an H that is `implicit` alone.
    """
    found, notes = checker.CheckResult("incomplete"), dict[str, bool]()
    for claim in (certificate, {**certificate, "near": None}):
        if found.verdict == "incomplete":
            found = checker.judged(functools.partial(_agreed, claim, shown, notes), time_limit, None)
    reason = found.reasons[0] if found.reasons else ""
    return Judged(found.verdict, reason, notes.get("proven", False), notes.get("whole", False))


def momenta_of(names: Sequence[str], momenta: Mapping[str, Any]) -> dict[str, str]:
    """{coordinate: the name of its momentum}: p_x, or momentum_x, momentum_x_2, … where that is taken."""
    found = dict[str, str]()
    for name in names:
        others = (key for key in momenta if key == f"momentum_{name}" or key.startswith(f"momentum_{name}_"))
        chosen = f"p_{name}" if f"p_{name}" in momenta else next(others, None)
        if chosen is None:
            return {}
        found[name] = chosen
    return found if len({*found.values()}) == len(momenta) else {}


def _agreed(certificate: Mapping[str, Any], shown: Any, notes: dict[str, bool], tools: Any) -> list[str]:
    formulas.check_shape(shown, _SHAPE, "hamiltonian")
    question = checks.Question(tools, certificate["system"], True, dict(certificate))
    question.read_integrals(certificate.get("integrals") or {})
    lagrangian, energy = (
        formulas.read_tokens(certificate["lagrangian"], "lagrangian"),
        formulas.read_tokens(shown["text"], "hamiltonian"),
    )
    named = momenta_of(question.coordinates, shown["momenta"])
    formulas.require(named, _NAMED)
    momenta = {named[x]: formulas.read_tokens(shown["momenta"][named[x]], "momenta") for x in question.coordinates}
    holds = any(token.rstrip("'") in question.coordinates and token.endswith("'") for token in energy)
    formulas.require(holds <= bool(shown.get("implicit")), _VELOCITIES)
    formulas.require(holds >= bool(shown.get("implicit")), _IMPLICIT)
    listed = [text for text in shown.get("domain") or [] if "!=" not in text]
    conditions = sorted({checks.read_condition(text) for text in listed})
    speeds = [f"{name}'" for name in question.coordinates]

    before = list[cell.Need]()  # of L, the momenta, and what the stated domain says is positive

    def parts(ring: Any) -> Any:
        question.held = False  # L and p need not be defined everywhere
        whole, p = formulas.Reader(ring, lagrangian).value, {}
        for name, text in momenta.items():
            p[name] = formulas.Reader(ring, text).value
        if isinstance(ring, cell.Letters):
            before.clear()
            before.extend([*ring.needs, *(need for value in (whole, *p.values()) for need in ring.needs_of(value))])
        stated = [ring.add([formulas.Reader(ring, side, **p).value for side in pair], [1, -1]) for pair in conditions]
        for value in () if question.rational else stated:
            ring.elementary("log", value)
        question.held = True
        if isinstance(ring, cell.Letters):
            ring.needs = {}
        work = [ring.multiply(ring.names[v], x, ring.degree) for v, x in zip(speeds, p.values(), strict=True)]
        return whole, p, ring.add([formulas.Reader(ring, energy, **p).value, whole, *work], [1, 1] + [-1] * len(work))

    def claims(ring: Any) -> checks.Claims:
        whole, p, difference = parts(ring)
        slopes = [{0: ring.arithmetic.settle({0: whole.get(ring.units[v], 0)}).get(0, 0)} for v in ring.v]
        pairs = zip(p.values(), slopes, strict=True)
        zeros = [ring.add([{0: value.get(0, 0)}, slope], [1, -1]) for value, slope in pairs]
        return checks.Claims([(ring.settle({0: zero.get(0, 0)}), _WRONG) for zero in (difference, *zeros)], [])

    question.claimed, notes["proven"] = (claims, 1), True
    try:
        question.prepare(parts, [lagrangian, energy, *momenta.values()])
        question.settle(1, claims)
    except formulas.Ended as end:
        if end.args[0] == "invalid" or question.rational or not question.place.values:
            raise
        notes["proven"] = False
        question.look_around()  # which may refute it

    def read(ring: cell.Letters) -> None:
        question.read_all(ring)
        _, p, difference = parts(ring)
        moving = {ring.texts.index(v) for v in speeds}
        held = [need for need in before if not moving & {*ring.holds(need.polynomial)}]  # which L needs of positions
        needed = [*held, *ring.needs, *ring.needs_of(difference), *ring.cut]
        stated = [list(cell.needs_of_text(ring, text, p)) for text in shown.get("domain") or []]
        known = cell.Knowledge(
            ring, [*(need for need in before if need not in held), *(n for one in stated for n in one)]
        )
        follow = cell.Knowledge(ring, [*before, *needed])
        notes["whole"] = all(map(known.implies, needed)) and all(follow.implies(n) for one in stated for n in one)

    if notes["proven"]:
        cell.letters_of(question, read)
    return [""]


def same_formulas(one: Mapping[str, str], other: Mapping[str, str], names: Names) -> bool | None:
    """Whether formulas by name are equal as functions; None where that is not settled."""
    if one == other:
        return True
    if one.keys() != other.keys():
        return False
    trees = [reader.read_formula(one[key], names) - reader.read_formula(other[key], names) for key in one]
    return _vanish(trees, names, names.coordinates)


def image_agrees(document: Any, shown: Mapping[str, Any], names: Names) -> bool | None:
    """Whether the `constraints` of H vanish where the constraints of the document hold and p are its momenta.

    As many as those, and independent; None where the document has none or it is not settled.
    """
    from inverse_service.constrained.hamiltonise import rank_at_point
    from inverse_service.mechanics.constrained_motion import equations_of_motion
    from inverse_service.service.documents import translate_nonholonomic

    if not isinstance(document, dict) or "lagrangian" not in document:
        return None
    schema = translate_nonholonomic.to_nonholonomic_schema(document)
    motion = equations_of_motion(translate_nonholonomic.to_nonholonomic(schema))
    listed = [reader.read_formula(text, names) for text in shown["constraints"]]
    if len(listed) != len(motion.dependent):
        return False
    momenta: dict[ex.Expression, ex.Expression] = {
        ex.Symbol(name): reader.read_formula(text, names) for name, text in shown["momenta"].items()
    }
    held = [ex.substitute(ex.substitute(tree, momenta), motion.on_constraints) for tree in listed]
    good = _vanish(held, names, motion.free)
    slopes = [[derivative.differentiate(tree, ex.Symbol(p)) for p in shown["momenta"]] for tree in listed]
    variables = [ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Symbol, names.parameters)]
    return good if not good else rank_at_point(slopes, variables) == len(listed) or None


def _vanish(trees: Sequence[ex.Expression], names: Names, moving: Sequence[str]) -> bool | None:
    from inverse_service.constrained.hamiltonise import vanish

    constants = [ex.Symbol(name) for name in names.parameters]
    return vanish(trees, [ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Velocity, moving), *constants])
