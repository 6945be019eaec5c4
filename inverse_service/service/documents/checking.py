"""Compare the statements of a result with its certificates.

The checker judges the certificates; from them a canonical statement is written. Each field of a
result is derived from the certificates, or compared with them and with the document as given, or it
is listed as not checked: `Examination` collects the JSON pointers that a comparison claimed, and
every other leaf that says something is listed.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from api_schemas.base import CHECK_FORMAT
from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions import collecting, printing, refusals, tree as ex
from inverse_service.mechanics import second_order_system
from inverse_service.reading import names as nm
from inverse_service.service.documents import (
    accepting,
    canonical,
    checking_motions,
    checking_sets,
    comparison,
    derived,
    examining,
    growing,
    nearest_parts,
    own_lagrangian,
    stated,
    translate,
)
from inverse_service.service.documents.comparison import as_object, system_fields
from inverse_service.service.documents.examining import Examination, Shown
from inverse_service.service.documents.plain_data import read_json

TIME_LIMIT = 60.0  # of processor time, so that the load of the machine decides no verdict
# Answers without a verdict; each says what was computed and claims nothing that a certificate could
# prove.
_WITHOUT_CLAIM: Final = (
    "inverse-service/forward/",
    "inverse-service/simulation/",
    "inverse-service/work-precision/",
)
_NO_CLAIM: Final = (
    "This answer claims no verdict, so there is nothing to check; to check L, solve its equations."
)
_NO_RESULT: Final = "The document is not a result: it has no known format, system, and verdict."
_VERDICTS: Final = ("variational", "not_variational", "undetermined")
# The keys of a document that a comparison reads.
_OF_DOCUMENT: Final = {
    "coordinates", "equations", "parameters", "functions", "where", "time", "lagrangian", "constraints", "motion",
    "associated", "kinds", "clock", "time_dependent_lagrangian", "multiples",
}  # fmt: skip


def check_document(text: str) -> dict[str, Any]:
    """{format, verdict, statement, cells, contradictions, not_checked, reasons} on the JSON text of
    one of these.

    A result or a certificate; {"document": …, "result": …}, where the document is that of the user,
    which else is the one that a result carries as `system.given`; {"system": …, "lagrangian": "…"},
    whether a Lagrangian of the user has the equations of a document (`own_lagrangian`); what `solve
    --format identities` writes. InputError where one of these cannot be read.
    """
    end = now() + TIME_LIMIT
    try:
        found = read_json(text)
    except InputError:  # the checker says what is wrong with it
        return _answer(checker.check_text(text))
    if (
        isinstance(found, dict)
        and found.keys() == {"system", "lagrangian"}
        and isinstance(found["lagrangian"], str)
    ):
        return own_lagrangian.check_lagrangian(found["system"], found["lagrangian"], end - now())
    if isinstance(found, dict) and "theorems" in found:
        from inverse_service.explanation.identities import checked_identities

        return _answer(checker.judged(lambda tools: checked_identities(found), TIME_LIMIT, None))
    if isinstance(found, dict) and "document" in found and "result" in found:
        return check_plain(found["result"], found["document"])
    return check_plain(found)


def check_plain(result: object, document: object = None) -> dict[str, Any]:
    """The same for a result or a certificate as plain data."""
    end = now() + TIME_LIMIT
    if claims_nothing(result):
        return _answer(checker.CheckResult("incomplete", (_NO_CLAIM,)))
    result = accepting.inward(result) if isinstance(result, dict) else result
    if as_object(result).get("format") in (checker.FORMAT, checker.OLD_FORMAT):
        return _of_certificate(as_object(result), document, end)
    system = as_object(as_object(result).get("system"))
    verdict, coordinates = as_object(result).get("verdict"), system.get("coordinates")
    good = (
        as_object(result).get("format") == checker.RESULT_FORMAT
        and verdict in (*_VERDICTS, "differs")
        and isinstance(coordinates, list)
    )
    if (
        not good
        or not isinstance(system.get("equations"), dict)
        or len(as_object(result)) > checker.MAX_MEMBERS
    ):
        return _answer(checker.CheckResult("invalid", (_NO_RESULT,)))
    examination = Examination(as_object(result), document, end)
    try:
        typed = accepting.typed_decimals(system.get("given"))
        with refusals.longer_texts(stated.LONGER), printing.with_decimals(typed):
            _examine(examination)
    except LimitError as error:  # what we print may be longer than what we read
        examination.unsettled(f"A formula is too long to be read again: {error.detail}")
    except checker.Incomplete as error:
        examination.unsettled(error.reasons[0][:200])
    except checker.Ended as error:
        examination.contradict("", error.reasons[0][:200], "")
    except (InputError, LookupError, TypeError, ValueError, AttributeError, RecursionError):
        examination.contradict("", "A part has another form.", "")
    return _report(examination)


def claims_nothing(found: object) -> bool:
    """Whether it is the answer to another question than whether a Lagrangian exists, alone or with
    its document.
    """
    result = as_object(found).get("result", found)
    return "verdict" not in as_object(result) and str(
        as_object(result).get("format", "")
    ).startswith(_WITHOUT_CLAIM)


def _answer(found: checker.CheckResult, **more: Any) -> dict[str, Any]:
    empty: dict[str, Any] = {
        "statement": None,
        "cells": [],
        "contradictions": [],
        "not_checked": [],
    }
    return (
        {"format": CHECK_FORMAT, "verdict": found.verdict}
        | empty
        | {"reasons": list(found.reasons)}
        | more
    )


def _of_certificate(certificate: dict[str, Any], document: object, end: float) -> dict[str, Any]:
    """The answer about a certificate by itself, compared with a document where there is one."""
    proof = checker.check_certificate(certificate, time_limit=max(1.0, end - now()))
    found, reasons = proof, proof.reasons
    if document is not None and proof.verdict == "valid":
        compared = examining.compared(
            document, certificate, "velocities" in as_object(certificate.get("system")), end - now()
        )
        reasons = (*reasons, *compared.reasons)
        found = compared if compared.verdict != "valid" else proof
        proof = checker.narrowed(certificate, proof, compared.cell, end - now())
    statement = None if found.verdict != "valid" else canonical.of_certificate(certificate, proof)
    more = {
        "statement": statement,
        "cells": [] if statement is None else [canonical.cell_of(statement)],
        "not_checked": [
            *unclaimed(certificate, "", {f"/{key}" for key in examining.read_keys(certificate)})
        ],
    }
    return _answer(checker.CheckResult(found.verdict, reasons), **more)


def _report(examination: Examination) -> dict[str, Any]:
    verdict = (
        "invalid" if examination.contradictions else "incomplete" if examination.open else "valid"
    )
    wrong = [
        f"{one['field'] or 'the result'}: {one['proven'] or one['says']}"
        for one in examination.contradictions
    ]
    listed = [place for place in unclaimed(examination.result, "", examination.claimed) if place]
    listed += [place for place in examination.open_places if place not in listed]
    reasons = (
        [*wrong, *examination.open] if verdict != "valid" else [*dict.fromkeys(examination.reasons)]
    )
    told = [f"Not checked: {', '.join(listed)}."] if listed and verdict == "valid" else []
    return _answer(
        checker.CheckResult(verdict, (*reasons, *told)),  # type: ignore[arg-type]
        statement=examination.statement if verdict != "invalid" else None,
        cells=[canonical.cell_of(one) for one in examination.cells],
        contradictions=examination.contradictions,
        not_checked=listed,
    )


def _examine(examination: Examination) -> None:
    result, system = examination.result, examination.result["system"]
    own = system_fields(result)
    given = system.get("given")
    document = given if examination.handed is None else examination.handed
    examination.agree(
        "/format",
        result["format"] == checker.RESULT_FORMAT,
        result["format"],
        checker.RESULT_FORMAT,
    )
    if examination.handed is not None and given is not None:
        examination.claim(*(["/system/given"] if given == examination.handed else []))
    examination.has_document = document is not None
    if document is None:  # the canonical equations say all that there is to say
        document = own
        examination.reasons.append(
            "The equations as given were not compared: there is no document."
        )
    elif given is not None and examination.handed is None and isinstance(given, dict):
        examination.claim(*(f"/system/given/{key}" for key in given if key in _OF_DOCUMENT))
    ready = accepting.prepared(document)
    plain = ready.document
    if "time" in system and (examination.has_document or system["time"] == "t"):
        examination.agree(
            "/system/time",
            system["time"] == ready.time,
            system["time"],
            f"It is called {ready.time}.",
        )
    if isinstance(document, dict) and "id" in document:
        for key in ("id", "document_id"):
            good = result.get(key, document["id"]) == document["id"]
            examination.agree(f"/{key}", good, result.get(key), "the id as given")
        examination.claim("/system/given/id")
    if (
        isinstance(document, dict)
        and system.get("name")
        and document.get("name") == system.get("name")
    ):
        examination.claim("/system/name", "/system/given/name")
    moving = isinstance(plain, dict) and (
        accepting.is_nonholonomic(plain) or accepting.is_motion(plain)
    )
    timed = _question(examination, plain, own)
    branches = result.get("branches") or []
    first = {key: branches[0].get(key) for key in stated.VERDICTS if _differ(examination, key)}
    main = _main(examination, result | first, "", timed, own)
    for key in stated.VERDICTS:
        if key in first or result.get(key) == "differs":
            good = (result.get(key) == "differs") is (key in first)
            examination.agree(
                f"/{key}",
                good,
                result.get(key),
                "It does not follow from the verdicts of the cells.",
            )
    for place, branch in enumerate(result.get("branches") or []):
        at = f"/branches/{place}"
        if place == 0:
            for key, value in branch.items():
                several = key in stated.VERDICTS and _differ(examination, key)
                if key == "equations":  # of this branch alone
                    continue
                if value != result.get(key) and not several:
                    examination.contradict(
                        f"{at}/{key}",
                        value,
                        "The first branch does not agree with the main fields.",
                    )
        main = _main(examination, branch, at, timed, own) and main
        _equations_there(examination, branch, at, own)
    _kinds(examination, plain, own, moving)
    _instead(examination, document, own)
    checking_motions.motions(examination, plain, timed)
    _others(examination, document, own)
    if not moving:
        _left_out(examination, document)
    checking_sets.family(examination, document, own, moving)
    _nearest(examination, document)
    if not main and not (growing.asks_motion_alone(plain) and result.get("any_associated")):
        examination.unsettled(examining.OPEN)
    if moving:
        checking_motions.associated(examination, plain, own)
    elif document is not own:
        checking_motions.covered(examination, plain)
    checking_motions.named(examination, plain, own)
    _answers(examination)
    if not examination.contradictions:
        both = [
            canonical.of_cells(own, each) for each in (examination.cells, examination.timed_cells)
        ]
        if both[1] and stated.statements_of(result)[0].at.endswith(
            "/with_time"
        ):  # what people are shown first
            both.reverse()
        examination.statement = canonical.first_with_words([*both, *examination.further])


def _answers(examination: Examination) -> None:
    """The list of answers says what the fields say from which it is made."""
    if (listed := examination.result.get("answers")) is None:  # of a program that wrote none
        return
    made = {_identity(one): one for one in stated.answers_of({**examination.result, "answers": []})}
    examination.agree(
        "/answers", len(listed) == len(made), len(listed), f"There are {len(made)} answers."
    )
    for place, one in enumerate(listed):
        wanted = made.pop(_identity(one), None)
        if wanted is None:
            examination.contradict(
                f"/answers/{place}", one.get("about"), "There is no such answer."
            )
            continue
        for key in sorted(one.keys() | wanted.keys()):
            says, other = (examining.text_of(part.get(key)) for part in (one, wanted))
            good = one.get(key) == wanted.get(key)
            examination.agree(
                f"/answers/{place}/{key}",
                good,
                str(says)[:200],
                f"It is {str(other)[:200]} in its field.",
            )


def _differ(examination: Examination, key: str) -> bool:
    """Whether the cells have different verdicts."""
    return len({str(one.get(key)) for one in examination.result.get("branches") or []}) > 1


def _question(examination: Examination, plain: Any, own: dict[str, Any]) -> bool:
    """Whether the main fields answer L(t, q, q')."""
    contains = examining.contains_time(own["equations"])
    asked = isinstance(plain, dict) and plain.get("time_dependent_lagrangian") is True
    timed, stated = contains or asked, examination.result.get("question")
    if stated is not None:
        if (
            examination.result["system"].get("given") is None and examination.handed is None
        ):  # no other question was asked
            timed = timed or stated == canonical.QUESTIONS["time_dependent"]
        proven = canonical.QUESTIONS["time_dependent" if timed else "autonomous"]
        examination.agree(
            "/question", stated == proven, stated, f"The question is that of {proven}."
        )
    return timed


def _all_integrals(
    examination: Examination, part: dict[str, Any], at: str, own: dict[str, Any]
) -> None:
    """That there are no other first integrals: a certificate about the system with some of
    those listed.
    """
    found = as_object(part.get("first_integrals_complete"))
    if not found:
        return
    at, certificate = f"{at}/first_integrals_complete", as_object(found.get("certificate"))
    proof = checker.check_certificate(certificate, time_limit=max(1.0, examination.end - now()))
    good = (
        certificate.get("format") == checker.FORMAT_OF_INTEGRALS
        and proof.verdict == found.get("checked") == "valid"
    )
    examination.agree(
        f"{at}/checked", good, found.get("checked"), "The certificate does not prove it."
    )
    for key, proven in (
        ("degree", certificate.get("degree")),
        ("number", certificate.get("number")),
        ("timed", certificate.get("question") == "time_dependent"),
    ):
        examination.agree(
            f"{at}/{key}",
            found.get(key) == proven,
            found.get(key),
            f"The certificate says {proven}.",
        )
    general = [*checker.in_general(as_object(certificate.get("system")))]
    examination.agree(
        f"{at}/exceptions",
        (found.get("exceptions") or []) == general,
        found.get("exceptions"),
        f"Its exceptions are {', '.join(general) or 'none'}.",
    )
    used = certificate.get("integrals") or []
    listed = {
        f"{place}/{k}/text": as_object(one).get("text")
        for place, several in (
            (at.removesuffix("_complete"), part.get("first_integrals")),
            (f"{at}/others", found.get("others")),
        )
        for k, one in enumerate(several or [])
    }
    same = system_fields(certificate) == own and {*listed.values()}.issuperset(used)
    examination.agree(
        f"{at}/certificate",
        same,
        "",
        "It is about another system, or about integrals that are not listed.",
    )
    examination.claim(*(place for place, text in listed.items() if text in used))


def _main(
    examination: Examination, part: dict[str, Any], at: str, timed: bool, own: dict[str, Any]
) -> bool:
    """The answers to both questions on one cell; whether both are decided."""
    _all_integrals(examination, part, at, own)
    verdict, later, other = (
        part.get("verdict"),
        part.get("verdict_with_time"),
        part.get("with_time"),
    )
    asked = "time_dependent" if timed else "autonomous"
    if timed and later not in (None, verdict):
        examination.contradict(
            f"{at}/verdict_with_time", later, "The two answers to the same question differ."
        )
    for key, value in (("verdict", verdict), ("verdict_with_time", later)):
        if value not in (*_VERDICTS, None) and (at or value != "differs"):
            examination.contradict(f"{at}/{key}", value, "It is no verdict.")
    if (verdict, later) == ("variational", "not_variational"):
        examination.contradict(
            f"{at}/verdict_with_time", later, "An L(q, q') is an L(t, q, q') too."
        )
    shown = [Shown(at, part, asked, verdict, own)]
    if other is not None:
        if other.get("verdict") not in (None, later):
            examination.contradict(
                f"{at}/with_time/verdict", other.get("verdict"), "verdict_with_time is another."
            )
        shown.append(Shown(f"{at}/with_time", other, "time_dependent", later, own))
    certificates = [examination.answer(one) for one in shown]
    proven = [one for one in certificates if one is not None]
    good = later is None or any(examining.proves(one, "time_dependent", later) for one in proven)
    if good and later is not None:
        examination.claim(f"{at}/verdict_with_time", f"{at}/with_time/verdict")
    if at == "" and examination.result.get("branches"):
        return True  # said by the first branch
    if verdict != "undetermined" and certificates[0] is not None:
        proof = examination.proof(certificates[0])
        energy = (
            part.get("hamiltonian") if f"{at}/hamiltonian/text" in examination.claimed else None
        )
        whole = f"{at}/hamiltonian/domain" in examination.claimed
        examination.cells.append(
            canonical.cell(own, str(verdict), certificates[0], proof, energy, whole)
        )
    if (
        other is not None
        and later != "undetermined"
        and (certificate := certificates[1]) is not None
    ):
        energy = (
            other.get("hamiltonian")
            if f"{at}/with_time/hamiltonian/text" in examination.claimed
            else None
        )
        whole = f"{at}/with_time/hamiltonian/domain" in examination.claimed
        proof = examination.proof(certificate)
        examination.timed_cells.append(
            canonical.cell(own, str(later), certificate, proof, energy, whole)
        )
    return good and None not in certificates and "undetermined" not in (verdict, later)


def _equations_there(
    examination: Examination, branch: dict[str, Any], at: str, own: dict[str, Any]
) -> None:
    """That the equations of a branch are those of its certificate on the cell of that."""
    equations, certificate = branch.get("equations"), branch.get("certificate")
    if not equations or not certificate:
        return
    there = {**own, "equations": equations}
    claimed = comparison.Canonical(system_fields(certificate), certificate)
    found = comparison.compared_with_document(there, claimed, examination.end - now())
    good = found.verdict == "valid"
    # The proof compares them near its point, where a root or an inverse has one sign.
    if good and comparison.divides_anew(there, own, branch):
        examination.agree(f"{at}/equations", False, equations, "They divide by 0 there.")
    elif found.verdict == "invalid" or (good and comparison.stays_one_formula(there, branch)):
        examination.agree(f"{at}/equations", good, equations, "They are others there.")


def _kinds(examination: Examination, plain: Any, own: dict[str, Any], moving: bool) -> None:
    """Answers about kinds of Lagrangians, each of which is a kind of the document."""
    listed = examination.result.get("kinds")
    if not listed:
        return
    known: dict[str, Any] = {}
    if not moving:
        schema = accepting.to_schema(plain)
        asked = derived.to_kinds(schema, accepting.to_solvable(schema))
        known = {one.name: translate.as_plain_data(one.among) for one in asked}
    question = "time_dependent" if examining.contains_time(own["equations"]) else "autonomous"
    for name, part in listed.items():
        at, among = f"/kinds/{name}", as_object(part.get("certificate")).get("among")
        if name not in (*checker.KINDS.split("|"), "invariant"):
            examination.contradict(at, name, "No such type exists.")
            continue
        if "given" in examination.result["system"] or examination.handed is not None:
            good = name in known and among in (None, known[name])
            examination.agree(
                f"{at}/certificate/among",
                good,
                str(among),
                "The document requests other types.",
            )
        around = examination.result.get("domain") or []
        settled = examination.answer(
            Shown(at, part, question, part.get("verdict"), own, name, around)
        )
        if part.get("verdict") != "undetermined" and settled is None:
            examination.unsettled(f"{at}: no certificate proves the verdict.")


def _instead(examination: Examination, document: Any, own: dict[str, Any]) -> None:
    part = as_object(examination.result.get("instead"))
    if not part:
        return
    kind = part.get("kind")
    if kind in ("time", "rayleigh"):
        asked = (
            "time_dependent"
            if kind == "time" or examining.contains_time(own["equations"])
            else "autonomous"
        )
        around = examination.result.get("domain") or []
        if (
            examination.answer(Shown("/instead", part, asked, "variational", own, kind, around))
            is None
        ):
            examination.unsettled("/instead: no certificate proves it.")
        examination.claim("/instead/kind")
        return
    if kind not in ("parameters", "reduced"):
        examination.contradict(
            "/instead/kind", str(kind), "It is not one of time, rayleigh, parameters, reduced."
        )
        return
    if kind == "parameters":
        found = derived.system_there(document, part.get("conditions"))
        _about_another(examination, "/instead", part, found, ("kind", "equations", "conditions"))
    else:  # which is compared itself
        good = derived.is_of_reduced(part, as_object(examination.result.get("reduced")))
        examination.agree("/instead/kind", good, kind, "It is not the reduced system.")
        if document is not own:  # else the reduced system itself is compared with nothing
            examination.claim(*(f"/instead/{key}" for key in derived.OF_REDUCED))


def _left_out(examination: Examination, document: Any) -> None:
    """The answers at the special values of the parameters that the main answer does not
    cover.
    """
    holders = (examination.result, as_object(examination.result.get("with_time")))
    proven = {text for one in holders for text in one.get("exceptions") or ()}
    for k, part in enumerate(examination.result.get("left_out") or ()):
        at, text = f"/left_out/{k}", part["where"]["text"]
        if text not in proven:
            examination.open_places.append(at)  # equations between functions
            examination.agree(
                f"{at}/decided",
                part["decided"] is False,
                part["decided"],
                "No special value is decided.",
            )
            continue
        examination.claim(f"{at}/where/text")
        if part["decided"]:
            system = derived.system_at(document, text)
            _about_another(examination, at, part, system, ("equations", "decided"))
        else:
            examination.agree(
                f"{at}/verdict",
                part["verdict"] == "undetermined",
                part["verdict"],
                "It is not decided.",
            )


def _nearest(examination: Examination, document: Any) -> None:
    """Each nearest system: its equations are those of the document with what moved, its
    distance is recomputed, and its own result is checked.
    """
    parts = examination.result.get("nearest") or ()
    if not parts:
        return
    fitted = nearest_parts.fitted_system(accepting.to_schema(accepting.prepared(document).document))
    for k, part in enumerate(parts):
        at, inner = f"/nearest/{k}", as_object(part.get("result"))
        coefficients = nearest_parts.with_moved(fitted, part["moved"])
        distance = fitted.distance(coefficients)
        close = abs(distance - float(part["distance"])) <= 1e-9 * (1 + distance)
        examination.agree(f"{at}/distance", close, part["distance"], f"It is {distance:.10g}.")
        if part["chi2"] is not None:
            same = abs(float(part["chi2"]) - distance**2) <= 1e-8 * (1 + distance**2)
            examination.agree(f"{at}/chi2", same, part["chi2"], f"It is {distance**2:.10g}.")
        wanted = fitted.member(coefficients)
        own = accepting.to_system(
            accepting.to_schema(accepting.prepared(system_fields(inner)).document)
        )
        good = wanted.coordinates == own.coordinates and all(
            collecting.collect(a - b) == ex.ZERO
            for a, b in zip(wanted.accelerations, own.accelerations, strict=True)
        )
        examination.agree(f"{at}/moved", good, part["moved"], "The equations are others.")
        for name in part["moved"]:
            examination.claim(*(f"{at}/moved/{nm.escaped(name)}/{key}" for key in ("from", "to")))
        found = check_plain(inner)
        if found["verdict"] == "incomplete":
            examination.open_places.append(f"{at}/result")
            continue
        proven = found["verdict"] == "valid" and nearest_parts.has_valid_proof(inner)
        examination.agree(f"{at}/result", proven, inner.get("verdict"), "No Lagrangian is proven.")


def _about_another(
    examination: Examination,
    at: str,
    part: dict[str, Any],
    system: second_order_system.SecondOrderSystem | None,
    compared: Sequence[str] = ("equations", "factor"),
) -> None:
    """An answer about a system that follows from that of the document; with it these fields are
    compared.
    """
    verdict = part.get("verdict", "variational")
    if verdict == "undetermined" and not part.get("certificate") and not part.get("equations"):
        examination.claim(f"{at}/verdict", f"{at}/factor")  # nothing was found
        return
    own = None if system is None else translate.plain_fields(system)
    if system is None or own is None or part.get("equations") != own["equations"]:
        examination.contradict(
            at, verdict, "It is not about the system that follows from the document's."
        )
        return
    examination.claim(*(f"{at}/{name}" for name in compared))
    certificate, questions = (
        as_object(part.get("certificate")),
        derived.questions_of(part, system),
    )
    if (
        system.positive
        and certificate
        and not derived.is_inside(system, certificate.get("near") or {})
    ):
        examination.contradict(
            f"{at}/certificate/near", "", "It is about a different branch of signs."
        )
    question = (
        certificate.get("question") if certificate.get("question") in questions else questions[0]
    )
    found = examination.answer(Shown(at, part, str(question), verdict, own, follows=True))
    if found is None and verdict != "undetermined":
        examination.unsettled(f"{at}: no certificate proves it.")


def _others(examination: Examination, document: Any, own: dict[str, Any]) -> None:
    """The system with another clock, and the reduced one."""
    if clock := as_object(examination.result.get("with_clock")):
        _about_another(
            examination, "/with_clock", clock, derived.system_with_clock(document, clock)
        )
    reduced = as_object(examination.result.get("reduced"))
    if reduced and document is not own:
        from inverse_service.service.documents import motion_documents

        found, clocked = motion_documents.systems_of_reduced(document, reduced)
        _about_another(examination, "/reduced", reduced, found)
        if clock := as_object(reduced.get("with_clock")):
            _about_another(examination, "/reduced/with_clock", clock, clocked)


def unclaimed(value: Any, at: str, claimed: set[str]) -> Iterator[str]:
    """The pointers of what says something and was not compared, each as far up as nothing below
    was.
    """
    if at in claimed or value in (None, "", [], {}):
        return
    below = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    if at and not any(place.startswith(f"{at}/") for place in claimed):
        yield at
        return
    for key, part in below:
        yield from unclaimed(part, f"{at}/{key}", claimed)


def _identity(answer: Mapping[str, Any]) -> tuple[object, ...]:
    """What tells an entry of `answers` from the others of its result."""
    return stated.question_of(answer), answer.get("cell", 0), str(answer.get("equations"))
