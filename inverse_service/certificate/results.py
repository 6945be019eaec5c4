"""Whether the parts of a result document agree with each other and with its certificates: see FORMAT.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .checker import Question, Tools, certified, check_certificate_shape, read_condition
from .formulas import MAX_LISTED, RESULT, TEXT, VERDICTS, Ended, check_shape, read_tokens, require
from .kinds import KINDS, named

DIFFERENT = "The {} of an answer is not the one that its certificate proves."


@dataclass(frozen=True, slots=True)
class Shown:
    """An answer that a result shows beside its certificate, which proves it; `kind` names the kind of Lagrangians."""

    answer: dict[str, Any]
    verdict: str | None
    question: str
    kind: str = ""
    around: Any = None  # the domain of the answer around one about a kind


def each_branch(result: Any) -> list[Any]:
    """The result, and for each of its further branches the same with the answer of this branch."""
    listed = result.get("branches") if isinstance(result, dict) else None
    further = [one for one in (listed[1:9] if isinstance(listed, list) else []) if isinstance(one, dict)]
    others = ("certificate", "lagrangian", "with_time", "verdict_with_time", "kinds", "instead", "branches")
    asked = ("format", "system", "question")
    return [result, *({**result, **dict.fromkeys(others), **one, **{key: result.get(key) for key in asked}}
                      for one in further)]  # fmt: skip


def compared(result: Any, tools: Tools) -> list[str]:
    """Check a result: first that its parts agree, then its certificates."""
    check_shape(result, RESULT, "result")
    system, asked = Question(tools, result["system"]), result.get("question")
    require(not system.bound, "A result is about a system of second order.")
    timed = asked == "L(t, q, q')" or (asked is None and system.contains_time)
    verdict, later, other = result["verdict"], result.get("verdict_with_time"), result.get("with_time")
    require(not timed or later in (None, verdict), "verdict and verdict_with_time answer one question differently.")
    require((verdict, later) != ("variational", "not_variational"), "An L(q, q') is an L(t, q, q') too.")
    main = [Shown(result, verdict, "time_dependent" if timed else "autonomous")]
    require(other is None or other.get("verdict") in (None, later), "with_time.verdict is not verdict_with_time.")
    main += [] if other is None else [Shown(other, later, "time_dependent")]
    first = (result.get("branches") or [{}])[0]
    require(all(b == result.get(a) for a, b in first.items()), "The first branch is not what the main fields say.")
    certificates, kinds = ([agreed(one, system, tools) for one in some] for some in (main, of_kinds(result, system)))
    motions = on_constraints(result, timed, tools)
    found = [certified(one, tools, everywhere=True) for one in (*certificates, *kinds, *motions) if one]
    given, motion = result["system"].get("given"), result.get("any_associated")
    only = isinstance(given, dict) and ("motion" in given or given.get("associated") == "any")
    if only and motion and {verdict, later} <= {"undetermined", None}:
        certificates, verdict, later = motions, motion["verdict"], motion["verdict_with_time"]
    proven = later is None or any(one and proves(one, "time_dependent", later) for one in certificates)
    if not proven or None in certificates or "undetermined" in (verdict, later):
        raise Ended("incomplete", "A verdict is undetermined, or no certificate proves it.")
    return found if given is None else [*found, "The equations as given were not compared."]


def of_kinds(result: Any, system: Question) -> Iterator[Shown]:
    """The answers about kinds of Lagrangians; what there is instead of L(q, q') is a yes about a kind."""
    kinds, instead = result.get("kinds") or {}, result.get("instead")
    check_shape(list(kinds), [KINDS + "|invariant", MAX_LISTED], "kinds")
    check_shape(kinds, {kind: {"verdict": VERDICTS} for kind in kinds}, "kinds")
    listed = [*kinds.items()]
    if instead is not None:
        shape = {"kind": "time|rayleigh|parameters|reduced", "lagrangian": {}, "certificate": {}}
        check_shape(instead, shape, "instead")
        if instead["kind"] in ("time", "rayleigh"):  # others are about another system
            listed.append((instead["kind"], instead | {"verdict": "variational"}))
    for kind, answer in listed:
        shown = answer["verdict"] != "undetermined" or answer.get("lagrangian") or answer.get("dissipation")
        require(answer.get("certificate") is not None or not shown, "A kind has no proof.")
        asked = "time_dependent" if system.contains_time or kind == "time" else "autonomous"
        yield Shown(answer, answer["verdict"], asked, kind, result.get("domain") or [])


def on_constraints(result: Any, timed: bool, tools: Tools) -> list[Any]:
    """The certificates of what a result says about a motion on constraints, which prove all of it."""
    answer, given = result.get("any_associated"), result["system"].get("given")
    if answer is None:
        return []
    check_shape(answer, {"verdict": VERDICTS, "verdict_with_time": VERDICTS}, "any_associated")
    found = [one for key in ("certificate", "certificate_with_time") if (one := answer.get(key)) is not None]
    for one in found:
        check_certificate_shape(one)
        moving = one["system"].get("velocities") is not None
        # One without velocities is about the free coordinates alone, whose equations contain no others.
        good = (moving or one["claim"] == "variational") and one.get("among") is None
        require(good, "A certificate in any_associated is about another thing.")
    timed = timed or (isinstance(given, dict) and given.get("time_dependent_lagrangian") is True)
    about = [Question(tools, one["system"]) for one in found]
    require(all(one.content == about[0].content for one in about), "any_associated is about two motions.")
    timed = timed or any(one.contains_time for one in about)
    asked = {"verdict": "time_dependent" if timed else "autonomous", "verdict_with_time": "time_dependent"}
    for key, question in asked.items():
        proven = answer[key] == "undetermined" or any(proves(one, question, answer[key]) for one in found)
        require(proven, "A verdict on the motion has no certificate.")
    used = all(any(proves(one, asked[key], answer[key]) for key in asked) for one in found)
    require(used, "A certificate does not claim the verdict that it stands beside.")
    proofs = [formula_of(one, "lagrangian") for one in found if one["kind"] == "lagrangian"]
    require(formula_of(answer, "lagrangian") in (proofs or [None]), DIFFERENT.format("lagrangian"))
    return found


def proves(certificate: dict[str, Any], question: str, verdict: str | None) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate["claim"] == verdict and certificate["question"] in (question, wider)


def agreed(shown: Shown, system: Question, tools: Tools) -> Any:
    """The certificate of an answer, if it has one, once it is seen to speak of the same things."""
    answer, certificate = shown.answer, shown.answer.get("certificate")
    if certificate is None:
        return None
    check_certificate_shape(certificate)
    among, no = certificate.get("among"), shown.verdict == "not_variational"
    friction = "rayleigh" in shown.kind  # with which there may be a Lagrangian where none is without
    whole = shown.kind in ("", "time") or (no and not friction)
    good = named(among) == shown.kind if among is not None else whole
    good = good and proves(certificate, shown.question, shown.verdict)
    require(good, "A certificate does not claim the verdict that it stands beside.")
    require(system.content == Question(tools, certificate["system"]).content, "A certificate is about another system.")
    for key in ("lagrangian", "dissipation"):
        proven = formula_of(certificate, key) if certificate["kind"] == "lagrangian" else None
        require(formula_of(answer, key) == proven, DIFFERENT.format(key))
    part, held = answer.get("lagrangian"), {read_condition(text) for text in certificate.get("conditions") or []}
    holders = (answer, part if isinstance(part, dict) else {})
    listed = [one for holder in holders if (one := holder.get("domain")) is not None]
    listed += [[]] * (shown.around is None and answer.get("domain") is None)  # an answer without one holds everywhere
    same = all(inequalities(one) == held for one in listed) and (listed or held <= inequalities(shown.around))
    require(same, "The domain of an answer is not that of its certificate.")
    near = certificate.get("near")
    good = answer.get("checked") in (None, "valid") and (answer.get("near") or near) == near
    require(good, "An answer does not show what its certificate says.")
    same = not answer.get("integrals") or answer["integrals"] == certificate.get("integrals")
    require(same, DIFFERENT.format("integrals"))
    return certificate


def inequalities(listed: Any) -> set[Any]:
    """The conditions of a domain without A != 0."""
    check_shape(listed, [TEXT, MAX_LISTED], "domain")
    return {read_condition(text) for text in listed if "!=" not in text or {*text} & {*"<>"}}


def formula_of(holder: dict[str, Any], key: str) -> tuple[str, ...] | None:
    """The tokens of a formula, which stands alone in a certificate and as `text` in an answer."""
    part = holder.get(key)
    return None if part is None else read_tokens(part.get("text") if isinstance(part, dict) else part, key)
