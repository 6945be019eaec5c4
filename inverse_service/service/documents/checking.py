"""The check of a result: its certificates by the independent checker, its system against the document as given."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Final

from inverse_service.certificate.checker import CheckResult, check_certificate, check_result, check_text
from inverse_service.certificate.formulas import FORMAT, OLD_FORMAT
from inverse_service.errors import CertificateRefused, InputError
from inverse_service.mechanics.agreement import Canonical
from inverse_service.service.documents.comparison import compared_claim, compared_with_document
from inverse_service.service.documents.preparing import inward
from inverse_service.service.documents.reading import read_json

TIME_LIMIT = 60.0  # of processor time: what a busy machine does decides no verdict
OPEN_MOTION = "Whether this motion can be hamiltonised by any associated system is open."
NOT_COMPARED = "The equations as given were not compared."
_SYSTEM: Final[dict[str, Any]] = {"coordinates": [], "equations": {}, "parameters": [], "functions": {}}
_NOTHING: Final = dict.fromkeys(("certificate", "lagrangian", "with_time", "verdict_with_time"))  # of another branch
_FROM_BEST = ("valid", "incomplete", "invalid")


def check_document(text: str) -> dict[str, Any]:
    """The verdict on the JSON text of a result, of a certificate, or of {"document": …, "result": …}.

    The document is that of the user; without one, a result is compared with the document that it
    carries as `system.given`. {"system": …, "lagrangian": "…"} asks whether a Lagrangian of the user has the equations
    of a document (`own_lagrangian`); InputError where one of these cannot be read.
    """
    end = time.thread_time() + TIME_LIMIT
    try:
        found = read_json(text)
    except InputError:  # the checker says what is wrong with it
        return answer(check_text(text))
    if isinstance(found, dict) and found.keys() == {"system", "lagrangian"} and isinstance(found["lagrangian"], str):
        from inverse_service.service.documents.own_lagrangian import check_lagrangian  # brings the engine

        return check_lagrangian(found["system"], found["lagrangian"], end - time.thread_time())
    if isinstance(found, dict) and "document" in found and "result" in found:
        from inverse_service.service.jobs.identity import write_json  # brings all that jobs are made of

        result = inward(found["result"]) if isinstance(found["result"], dict) else found["result"]
        alone = check_text(write_json(result))
        return answer(_with_comparison(alone, result, found["document"], end))
    if isinstance(found, dict) and inward(found) is not found:
        return check_plain(found)
    return answer(_with_comparison(check_text(text), found, None, end))


def check_plain(result: object, document: object = None) -> dict[str, Any]:
    """The same for a result or a certificate as plain data."""
    end = time.thread_time() + TIME_LIMIT
    result = inward(result) if isinstance(result, dict) else result
    check = check_certificate if _object(result).get("format") in (FORMAT, OLD_FORMAT) else check_result
    return answer(_with_comparison(check(result), result, document, end))


def answer(found: CheckResult) -> dict[str, Any]:
    return {"verdict": found.verdict, "reasons": list(found.reasons)}


def compare_before_leaving(result: dict[str, Any], time_limit: float) -> None:
    """Make a result undetermined where its system could not be compared with the document as given.

    Raises CertificateRefused where the system is found to be another one: that is a fault of ours.
    """
    end = time.thread_time() + max(1.0, time_limit)
    compare_motion(result, end - time.thread_time())
    found = _compared(result, result["system"]["given"], end)
    if found is None or found.verdict == "valid":
        return
    why = "; ".join(found.reasons)
    if found.verdict == "invalid":
        raise CertificateRefused(f"what was solved is not what was given: {why}"[:500])
    branches = [each for branch in result["branches"] for each in (branch, branch["with_time"])]
    result |= {"instead": None} if result.get("instead") else {}
    for one in (result.get("kinds") or {}).values():
        one |= {"certificate": None, "checked": None, "lagrangian": None, "dissipation": None}
    for one in filter(None, (result, result["with_time"], *branches, *(result.get("kinds") or {}).values())):
        for key in ("verdict", "verdict_with_time"):
            if one.get(key) is not None:
                one[key] = "undetermined"
                one["reason"] = f"An answer was found, but the system could not be compared with the document: {why}"


def compare_motion(result: dict[str, Any], time_limit: float) -> None:
    """The same for the answer about a motion on constraints, which takes no other answer with it."""
    for certificate in _claims(result):
        found = compared_claim(result["system"]["given"], certificate, time_limit)
        if found.verdict != "valid":
            why = f"An answer was found, but the motion could not be compared with the document: {found.reasons[0]}"
            result["any_associated"] = _open(result["any_associated"], why)
            return


def _open(part: dict[str, Any], why: str) -> dict[str, Any]:
    kept = {"statement": OPEN_MOTION, "reason": why, "verdict": "undetermined", "verdict_with_time": "undetermined"}
    return dict.fromkeys(part, None) | {"image": [], "freedom": "", "explanation": []} | kept


def _with_branches(alone: CheckResult, result: Any) -> CheckResult:
    """The worst of the verdicts on a result and on each of its branches, which are shown to the checker one by one."""
    listed = _object(result).get("branches")
    found = alone
    for branch in listed[1:] if isinstance(listed, list) else []:
        other = check_result({**result, **_NOTHING, **_object(branch), "branches": []})
        if _FROM_BEST.index(other.verdict) > _FROM_BEST.index(found.verdict):
            found = other
    return found


def _with_comparison(alone: CheckResult, result: Any, document: object, end: float) -> CheckResult:
    alone = _with_branches(alone, result)
    if alone.verdict == "invalid":
        return alone
    given = _object(result.get("system")).get("given") if document is None else document
    found = None if given is None else _compared(result, given, end)
    for certificate in _claims(result) if given is not None else ():
        motion = compared_claim(given, certificate, end - time.thread_time())
        found = motion if found is None or motion.verdict != "valid" else found
    changed = _object(result.get("with_clock")) if isinstance(result, dict) else {}
    if changed:
        from inverse_service.service.documents.clock import compared_clock  # brings the engine

        clock = compared_clock(given, changed, end - time.monotonic())
        found = clock if clock is not None and (found is None or clock.verdict != "valid") else found
    reduced = _object(result.get("reduced")) if isinstance(result, dict) and given is not None else {}
    if reduced:
        from inverse_service.service.documents.reduced import compared_reduced

        part = compared_reduced(given, reduced, end - time.thread_time())
        found = part if part is not None and (found is None or part.verdict != "valid") else found
    if given is not None and isinstance(result, dict) and result.get("instead"):
        from inverse_service.service.documents.instead import compared_instead

        other = compared_instead(given, result, end - time.thread_time())
        found = other if other is not None and (found is None or other.verdict != "valid") else found
    if found is None:
        return alone
    worst = max(alone.verdict, found.verdict, key=_FROM_BEST.index)
    return CheckResult(worst, (*(reason for reason in alone.reasons if reason != NOT_COMPARED), *found.reasons))


def _compared(result: dict[str, Any], given: object, end: float) -> CheckResult | None:
    """The first comparison that does not hold, else the last one; None where there is no certificate."""
    found = None
    for canonical in _systems(result):
        found = compared_with_document(given, canonical, end - time.thread_time())
        if found.verdict != "valid":
            break
    return found


def _claims(result: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The certificates about the motion on constraints itself."""
    part = _object(result.get("any_associated"))
    yield from (found for key in ("certificate", "certificate_with_time") if (found := _object(part.get(key))))


def _systems(result: dict[str, Any]) -> Iterator[Canonical]:
    """The system that a result shows and those that its certificates are about, each once; none without one."""
    if result.get("format") in (FORMAT, OLD_FORMAT):
        yield Canonical(_system(result), result)
        return
    listed = _object(result.get("nonholonomic")).get("associated")
    associated = listed if isinstance(listed, list) else []
    instead = _object(result.get("instead"))
    own = instead if instead.get("kind") in ("time", "rayleigh") else None  # others are about another system
    kinds = [*_object(result.get("kinds")).values(), own]
    answers = (_object(each) for each in (result, result.get("with_time"), *associated, *kinds))
    certificates = [found for each in answers if (found := _object(each.get("certificate")))]
    shown = [Canonical(_system(result), each) for each in certificates[:1]]
    seen: list[object] = []
    for each in (*shown, *(Canonical(_system(found), found) for found in certificates)):
        if each.system not in seen:
            seen.append(each.system)
            yield each
    branches = result.get("branches")
    for branch in branches[1:] if isinstance(branches, list) else []:
        found = _object(_object(branch).get("certificate"))
        if found:
            yield Canonical(_system(found), found)


def _system(holder: dict[str, Any]) -> dict[str, Any]:
    """What says the same in a result and in a certificate."""
    system = _object(holder.get("system"))
    return {key: system.get(key) or empty for key, empty in _SYSTEM.items()}


def _object(value: Any) -> dict[str, Any]:
    """The value where it is an object, else an empty one."""
    return value if isinstance(value, dict) else {}
