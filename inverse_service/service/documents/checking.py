"""The check of a result: its certificates by the independent checker, its system against the document as given."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from inverse_service.algebra.real_point import are_positive, table_at
from inverse_service.certificate.checker import CheckResult, check_certificate, check_result, check_text, judged
from inverse_service.certificate.formulas import FORMAT, OLD_FORMAT, RESULT_FORMAT
from inverse_service.deadline import now
from inverse_service.errors import CertificateRefused, InputError
from inverse_service.expressions.tree import Arbitrary, walk
from inverse_service.mechanics.agreement import Canonical
from inverse_service.mechanics.second_order_system import SecondOrderSystem, branches_of
from inverse_service.service.documents import accepting, translate
from inverse_service.service.documents.comparison import compared_claim, compared_with_document
from inverse_service.service.documents.hamiltonians import compared_hamiltonians
from inverse_service.service.documents.own_lagrangian import check_lagrangian
from inverse_service.service.documents.plain_data import read_json
from inverse_service.service.documents.preparing import inward, is_motion, is_nonholonomic, prepared

TIME_LIMIT = 60.0  # of processor time: what a busy machine does decides no verdict
OPEN_MOTION = "Whether this motion can be given a Hamiltonian by any associated system is open."
NEVER_CHECKED = "LaTeX, names and sentences of any part, where det g is 0 (conditions A != 0), the branch that H has"
NOT_COMPARED = "The equations as given were not compared."
_SYSTEM: Final[dict[str, Any]] = {"coordinates": [], "equations": {}, "parameters": [], "functions": {}}
# What the check compares with the certificates, as FORMAT.md says.
_COVERED: Final = {
    "format", "system", "question", "verdict", "verdict_with_time", "certificate", "certificate_with_time", "checked",
    "lagrangian", "hamiltonian", "integrals", "domain", "branches", "with_time", "kinds", "instead", "any_associated",
    "with_clock", "guessed", "id", "near", "kind", "factor", "equations", "dissipation",
}  # fmt: skip
_PARTS = ("with_time", "instead", "with_clock")  # answers besides the main one
# Answers without a verdict; each says what was computed and claims nothing that a certificate could prove.
_WITHOUT_CLAIM: Final = ("inverse-service/forward/", "inverse-service/simulation/", "inverse-service/work-precision/")
_NO_CLAIM: Final = "This answer claims no verdict, so there is nothing to check; to check L, solve its equations."
_FROM_BEST = ("valid", "incomplete", "invalid")


def check_document(text: str) -> dict[str, Any]:
    """The verdict on the JSON text of a result, of a certificate, or of {"document": …, "result": …}.

    The document is that of the user; without one, a result is compared with the document that it
    carries as `system.given`. {"system": …, "lagrangian": "…"} asks whether a Lagrangian of the user has the equations
    of a document (`own_lagrangian`). What `solve --format identities` writes is checked exactly. InputError where
    one of these cannot be read.
    """
    end = now() + TIME_LIMIT
    try:
        found = read_json(text)
    except InputError:  # the checker says what is wrong with it
        return answer(check_text(text))
    if isinstance(found, dict) and found.keys() == {"system", "lagrangian"} and isinstance(found["lagrangian"], str):
        return check_lagrangian(found["system"], found["lagrangian"], end - now())
    if claims_nothing(found):
        return {"verdict": "incomplete", "reasons": [_NO_CLAIM]}
    if isinstance(found, dict) and "theorems" in found:
        from inverse_service.inverse_problem.proofs.identities import checked_identities

        return answer(judged(lambda tools: checked_identities(found), TIME_LIMIT, None))
    if isinstance(found, dict) and "document" in found and "result" in found:
        from inverse_service.service.jobs.model import write_json  # brings all that jobs are made of

        result = inward(found["result"]) if isinstance(found["result"], dict) else found["result"]
        alone = check_text(write_json(result))
        return answer(_with_comparison(alone, result, found["document"], end))
    if isinstance(found, dict) and inward(found) is not found:
        return check_plain(found)
    return answer(_with_comparison(check_text(text), found, None, end))


def check_plain(result: object, document: object = None) -> dict[str, Any]:
    """The same for a result or a certificate as plain data."""
    if claims_nothing(result):
        return {"verdict": "incomplete", "reasons": [_NO_CLAIM]}
    end = now() + TIME_LIMIT
    result = inward(result) if isinstance(result, dict) else result
    check = check_certificate if _object(result).get("format") in (FORMAT, OLD_FORMAT) else check_result
    return answer(_with_comparison(check(result), result, document, end))


def claims_nothing(found: object) -> bool:
    """Whether it is the answer to another question than whether a Lagrangian exists, alone or with its document."""
    result = _object(found).get("result", found)
    return "verdict" not in _object(result) and str(_object(result).get("format", "")).startswith(_WITHOUT_CLAIM)


def answer(found: CheckResult) -> dict[str, Any]:
    return {"verdict": found.verdict, "reasons": list(found.reasons)}


def compare_before_leaving(result: dict[str, Any], time_limit: float) -> None:
    """Make a result undetermined where its system could not be compared with the document as given.

    Raises CertificateRefused where the system is found to be another one: that is a fault of ours.
    """
    end = now() + max(1.0, time_limit)
    compare_motion(result, end - now())
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
    for holder in (result, *result["branches"]):
        for certificate in _claims(holder):
            found = compared_claim(result["system"]["given"], certificate, time_limit)
            if found.verdict != "valid":
                why = f"An answer was found, but the motion could not be compared with the document: {found.reasons[0]}"
                holder["any_associated"] = _open(holder["any_associated"], why)
                break


def _open(part: dict[str, Any], why: str) -> dict[str, Any]:
    kept = {"statement": OPEN_MOTION, "reason": why, "verdict": "undetermined", "verdict_with_time": "undetermined"}
    return dict.fromkeys(part, None) | {"parts": [], "image": [], "freedom": "", "explanation": []} | kept


def _with_comparison(alone: CheckResult, result: Any, document: object, end: float) -> CheckResult:
    if alone.verdict == "invalid":
        return alone
    given = _object(result.get("system")).get("given") if document is None else document
    found = None if given is None else _compared(result, given, end)
    listed = result.get("branches") if given is not None else None
    further = listed[1:] if isinstance(listed, list) else []
    for certificate in (one for holder in (result, *further) for one in _claims(_object(holder)) if given is not None):
        motion = compared_claim(given, certificate, end - now())
        found = motion if found is None or motion.verdict != "valid" else found
    for part in _parts_compared(given, result, end) if isinstance(result, dict) else ():
        found = part if part is not None and (found is None or part.verdict != "valid") else found
    energy = compared_hamiltonians(result, end) if isinstance(result, dict) else CheckResult("valid")
    if energy.verdict == "invalid":
        return energy
    if energy.verdict != "valid" and (found is None or found.verdict == "valid"):
        found = energy
    if found is not None:
        worst = max(alone.verdict, found.verdict, key=_FROM_BEST.index)
        reasons = (*(reason for reason in alone.reasons if reason != NOT_COMPARED), *found.reasons)
        alone = CheckResult(worst, reasons)
    lacks = _answers_all(result, given) if alone.verdict == "valid" and _is_result(result) and given else None
    if lacks is not None:
        return lacks
    left = _not_checked(result, bool(energy.reasons))
    told = f"Not checked: {', '.join(left)}; {NEVER_CHECKED}."
    return CheckResult(alone.verdict, (*alone.reasons, told)) if left and alone.verdict == "valid" else alone


def _parts_compared(given: object, result: dict[str, Any], end: float) -> Iterator[CheckResult | None]:
    """The verdicts on answers about other systems that follow from that of a result; each brings its engine."""
    if clock := _object(result.get("with_clock")):
        from inverse_service.service.documents.clock_part import compared_clock

        yield compared_clock(given, clock, end - now())
    if given is not None and (reduced := _object(result.get("reduced"))):
        from inverse_service.service.documents.reduced_documents import compared_reduced

        yield compared_reduced(given, reduced, end - now())
    if given is not None and result.get("instead"):
        from inverse_service.service.documents.instead import compared_instead

        yield compared_instead(given, result, end - now())


def _is_result(result: Any) -> bool:
    return bool(_object(result).get("format") == RESULT_FORMAT)


def _not_checked(result: Any, hamiltonian: bool) -> list[str]:
    """The keys of a result and of its parts that the check says nothing of."""
    if not _is_result(result):
        return []
    kinds, branches = _object(result.get("kinds")), result.get("branches")
    parts = [result, *kinds.values(), *(branches if isinstance(branches, list) else [])]
    parts += [part.get(key) for part in (result, *parts) for key in _PARTS if isinstance(part, dict)]
    named = [(part, key) for part in map(_object, parts) for key in part if key not in _COVERED]
    motion = _object(result.get("any_associated"))
    found = [key for part, key in named if part[key] not in (None, "", [], {})]
    found += [f"any_associated.{key}" for key in motion if key not in _COVERED - {"hamiltonian"} and motion[key]]
    found += ["hamiltonian"] * hamiltonian
    return list(dict.fromkeys(found))


def _answers_all(result: dict[str, Any], given: object) -> CheckResult | None:
    """What is wrong where a result does not answer on every branch, or for the vector fields, that the document has."""
    from inverse_service.service.documents.kinds_part import to_kinds

    try:
        document = prepared(given).document
        if is_nonholonomic(document) or is_motion(document):
            return None
        schema = accepting.to_schema(document)
        system = accepting.to_solvable(schema)
        kinds = {kind.name: translate.plain(kind.among) for kind in to_kinds(schema, system)}
    except InputError:
        return CheckResult("invalid", ("The document as given cannot be read.",))
    if not _are_all_branches(branches_of(system), result.get("branches") or []):
        return CheckResult("invalid", ("The branches are not those of the document as given.",))
    for name, answer in _object(result.get("kinds")).items():
        among = _object(_object(answer).get("certificate")).get("among")
        if name not in kinds or (among is not None and among != kinds[name]):
            return CheckResult("invalid", (f"The kind {ascii(name)[1:-1]} is not that of the document as given.",))
    return None


def _are_all_branches(wanted: Sequence[SecondOrderSystem], shown: Sequence[dict[str, Any]]) -> bool:
    """Whether each of the branches has one of the answers: its conditions hold at the point that the proof names."""
    certificates = [_object(each.get("certificate")) for each in shown]
    domains = {tuple(sorted(each.get("domain") or [])) for each in shown}
    if len(wanted) != max(1, len(shown)) or len(domains) != len(shown):
        return False
    if not shown or not all(each.get("near") for each in certificates):
        return True  # one answer, or one without proof: what is said of the whole is incomplete
    tables = [table_at(each["near"]) for each in certificates]
    known = [one.positive for one in wanted if not any(isinstance(n, Arbitrary) for u in one.positive for n in walk(u))]
    return all(any(are_positive(positive, table) for table in tables) for positive in known)


def _compared(result: dict[str, Any], given: object, end: float) -> CheckResult | None:
    """The first comparison that does not hold, else the last one; None where there is no certificate."""
    found = None
    for canonical in _systems(result):
        found = compared_with_document(given, canonical, end - now())
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
