"""Compare the statements of a result with its certificates.

The checker judges the certificates; from them a canonical statement is written. Each field of a
result is derived from the certificates, or compared with them and with the document as given, or it
is listed as not checked: `Examination` collects the JSON pointers that a comparison claimed, and
every other leaf that says something is listed.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from api_schemas.base import CHECK_FORMAT
from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.decision import certify
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions import collecting, printing, refusals, tree as ex
from inverse_service.expressions.printing import to_latex
from inverse_service.field import real_branch
from inverse_service.mechanics import second_order_system
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import (
    accepting,
    canonical,
    comparison,
    derived,
    family_parts,
    growing,
    matrices_beside,
    nearest_parts,
    own_lagrangian,
    stated,
    translate,
)
from inverse_service.service.documents.comparison import as_object, system_fields
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
_OPEN: Final = "A verdict is undetermined, or no certificate proves it."
_VERDICTS: Final = ("variational", "not_variational", "undetermined")
# The keys of a certificate that the checker reads: of each one, and by `among` and `kind`. Others
# have no effect.
_READ: Final = {
    "format", "question", "claim", "kind", "near", "conditions", "among", "system/coordinates",
    "system/equations", "system/parameters", "system/functions", "system/velocities",
}  # fmt: skip
_READ_OF: Final = {
    ("", "lagrangian"): {"lagrangian", "integrals", "factors"},
    ("", "existence"): {
        *(
            "order",
            "degree",
            "dimensions",
            "symbol/dimension",
            "symbol/prolonged",
            "symbol/characters",
        )
    },
    ("", "nonexistence"): {"order", "rows"},
    ("positive_definite", "existence"): {"multiplier"},
    ("positive_definite", "nonexistence"): {"orthogonal"},
    ("rayleigh", "lagrangian"): {"dissipation"},
    ("rayleigh_general", "lagrangian"): {"dissipation"},
}
_READ_OF_MOTION: Final = {"bivectors", "along"}
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
            examination.examine()
    except LimitError as error:  # what we print may be longer than what we read
        examination.unsettled(f"A formula is too long to be read again: {error.detail}")
    except checker.Incomplete as error:
        examination.unsettled(error.reasons[0][:200])
    except checker.Ended as error:
        examination.contradict("", error.reasons[0][:200], "")
    except (InputError, LookupError, TypeError, ValueError, AttributeError, RecursionError):
        examination.contradict("", "A part has another form.", "")
    return examination.report()


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
        compared = _compared(
            document, certificate, "velocities" in as_object(certificate.get("system")), end - now()
        )
        reasons = (*reasons, *compared.reasons)
        found = compared if compared.verdict != "valid" else proof
        proof = checker.narrowed(certificate, proof, compared.cell, end - now())
    statement = None if found.verdict != "valid" else canonical.of_certificate(certificate, proof)
    more = {
        "statement": statement,
        "cells": [] if statement is None else [canonical.cell_of(statement)],
        "not_checked": [*unclaimed(certificate, "", {f"/{key}" for key in read_keys(certificate)})],
    }
    return _answer(checker.CheckResult(found.verdict, reasons), **more)


@dataclass(frozen=True, slots=True)
class Shown:
    """An answer at a place of a result: its question, its system, and its kind."""

    at: str
    part: dict[str, Any]
    question: str
    verdict: str | None
    system: dict[str, Any]
    kind: str = ""
    around: Any = None  # the domain of the answer around one about a kind
    key: str = "verdict"  # under which the verdict is
    follows: bool = (
        False  # whether it is about another system, that follows from the one of the document
    )


@dataclass(slots=True)
class Examination:
    """A result, the document it is compared with, and what was found."""

    result: dict[str, Any]
    handed: object
    end: float
    claimed: set[str] = field(default_factory=set)
    contradictions: list[dict[str, Any]] = field(default_factory=list)
    open: list[str] = field(default_factory=list)
    open_places: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    proofs: dict[str, checker.CheckResult] = field(default_factory=dict)
    compared: dict[str, checker.CheckResult] = field(default_factory=dict)
    cells: list[dict[str, Any]] = field(default_factory=list)
    timed_cells: list[dict[str, Any]] = field(
        default_factory=list
    )  # of answers on L(t, q, q') beside the main ones
    statement: dict[str, Any] | None = None
    further: list[dict[str, Any]] = field(default_factory=list)  # about the motion on constraints
    has_document: bool = False

    # What was found.

    def claim(self, *places: str) -> None:
        self.claimed.update(places)

    def contradict(self, place: str, says: Any, proven: str) -> None:
        self.claim(place)
        entry = {"field": place, "says": says, "proven": proven}
        if entry not in self.contradictions:
            self.contradictions.append(entry)

    def agree(self, place: str, good: object, says: Any, proven: str) -> bool:
        """Claim the field; where it is wrong, it contradicts the proof."""
        self.claim(place)
        if not good:
            self.contradict(place, says, proven)
        return bool(good)

    def unsettled(self, why: str) -> None:
        if why not in self.open:
            self.open.append(why)

    def report(self) -> dict[str, Any]:
        verdict = "invalid" if self.contradictions else "incomplete" if self.open else "valid"
        wrong = [
            f"{one['field'] or 'the result'}: {one['proven'] or one['says']}"
            for one in self.contradictions
        ]
        listed = [place for place in unclaimed(self.result, "", self.claimed) if place]
        listed += [place for place in self.open_places if place not in listed]
        reasons = [*wrong, *self.open] if verdict != "valid" else [*dict.fromkeys(self.reasons)]
        told = [f"Not checked: {', '.join(listed)}."] if listed and verdict == "valid" else []
        return _answer(
            checker.CheckResult(verdict, (*reasons, *told)),  # type: ignore[arg-type]
            statement=self.statement if verdict != "invalid" else None,
            cells=[canonical.cell_of(one) for one in self.cells],
            contradictions=self.contradictions,
            not_checked=listed,
        )

    # The comparisons.

    def examine(self) -> None:
        result, system = self.result, self.result["system"]
        own = system_fields(result)
        given = system.get("given")
        document = given if self.handed is None else self.handed
        self.agree(
            "/format",
            result["format"] == checker.RESULT_FORMAT,
            result["format"],
            checker.RESULT_FORMAT,
        )
        if self.handed is not None and given is not None:
            self.claim(*(["/system/given"] if given == self.handed else []))
        self.has_document = document is not None
        if document is None:  # the canonical equations say all that there is to say
            document = own
            self.reasons.append("The equations as given were not compared: there is no document.")
        elif given is not None and self.handed is None and isinstance(given, dict):
            self.claim(*(f"/system/given/{key}" for key in given if key in _OF_DOCUMENT))
        ready = accepting.prepared(document)
        plain = ready.document
        if "time" in system and (self.has_document or system["time"] == "t"):
            self.agree(
                "/system/time",
                system["time"] == ready.time,
                system["time"],
                f"It is called {ready.time}.",
            )
        if isinstance(document, dict) and "id" in document:
            for key in ("id", "document_id"):
                good = result.get(key, document["id"]) == document["id"]
                self.agree(f"/{key}", good, result.get(key), "the id as given")
            self.claim("/system/given/id")
        if (
            isinstance(document, dict)
            and system.get("name")
            and document.get("name") == system.get("name")
        ):
            self.claim("/system/name", "/system/given/name")
        moving = isinstance(plain, dict) and (
            accepting.is_nonholonomic(plain) or accepting.is_motion(plain)
        )
        timed = self.question(plain, own)
        branches = result.get("branches") or []
        first = {key: branches[0].get(key) for key in stated.VERDICTS if self.differ(key)}
        main = self.main(result | first, "", timed, own)
        for key in stated.VERDICTS:
            if key in first or result.get(key) == "differs":
                good = (result.get(key) == "differs") is (key in first)
                self.agree(
                    f"/{key}",
                    good,
                    result.get(key),
                    "It does not follow from the verdicts of the cells.",
                )
        for place, branch in enumerate(result.get("branches") or []):
            at = f"/branches/{place}"
            if place == 0:
                for key, value in branch.items():
                    several = key in stated.VERDICTS and self.differ(key)
                    if key == "equations":  # of this branch alone
                        continue
                    if value != result.get(key) and not several:
                        self.contradict(
                            f"{at}/{key}",
                            value,
                            "The first branch does not agree with the main fields.",
                        )
            main = self.main(branch, at, timed, own) and main
            self.equations_there(branch, at, own)
        self.kinds(plain, own, moving)
        self.instead(document, own)
        self.motions(plain, timed)
        self.others(document, own)
        if not moving:
            self.left_out(document)
        self.family(document, own, moving)
        self.nearest(document)
        if not main and not (growing.asks_motion_alone(plain) and result.get("any_associated")):
            self.unsettled(_OPEN)
        if moving:
            self.associated(plain, own)
        elif document is not own:
            self.covered(plain)
        self.named(plain, own)
        self.answers()
        if not self.contradictions:
            both = [canonical.of_cells(own, each) for each in (self.cells, self.timed_cells)]
            if both[1] and stated.statements_of(result)[0].at.endswith(
                "/with_time"
            ):  # what people are shown first
                both.reverse()
            self.statement = canonical.first_with_words([*both, *self.further])

    def answers(self) -> None:
        """The list of answers says what the fields say from which it is made."""
        if (listed := self.result.get("answers")) is None:  # of a program that wrote none
            return
        made = {_identity(one): one for one in stated.answers_of({**self.result, "answers": []})}
        self.agree(
            "/answers", len(listed) == len(made), len(listed), f"There are {len(made)} answers."
        )
        for place, one in enumerate(listed):
            wanted = made.pop(_identity(one), None)
            if wanted is None:
                self.contradict(f"/answers/{place}", one.get("about"), "There is no such answer.")
                continue
            for key in sorted(one.keys() | wanted.keys()):
                says, other = (_text(part.get(key)) for part in (one, wanted))
                good = one.get(key) == wanted.get(key)
                self.agree(
                    f"/answers/{place}/{key}",
                    good,
                    str(says)[:200],
                    f"It is {str(other)[:200]} in its field.",
                )

    def differ(self, key: str) -> bool:
        """Whether the cells have different verdicts."""
        return len({str(one.get(key)) for one in self.result.get("branches") or []}) > 1

    def question(self, plain: Any, own: dict[str, Any]) -> bool:
        """Whether the main fields answer L(t, q, q')."""
        contains = _contains_time(own["equations"])
        asked = isinstance(plain, dict) and plain.get("time_dependent_lagrangian") is True
        timed, stated = contains or asked, self.result.get("question")
        if stated is not None:
            if (
                self.result["system"].get("given") is None and self.handed is None
            ):  # no other question was asked
                timed = timed or stated == canonical.QUESTIONS["time_dependent"]
            proven = canonical.QUESTIONS["time_dependent" if timed else "autonomous"]
            self.agree("/question", stated == proven, stated, f"The question is that of {proven}.")
        return timed

    def all_integrals(self, part: dict[str, Any], at: str, own: dict[str, Any]) -> None:
        """That there are no other first integrals: a certificate about the system with some of
        those listed.
        """
        found = as_object(part.get("first_integrals_complete"))
        if not found:
            return
        at, certificate = f"{at}/first_integrals_complete", as_object(found.get("certificate"))
        proof = checker.check_certificate(certificate, time_limit=max(1.0, self.end - now()))
        good = (
            certificate.get("format") == checker.FORMAT_OF_INTEGRALS
            and proof.verdict == found.get("checked") == "valid"
        )
        self.agree(
            f"{at}/checked", good, found.get("checked"), "The certificate does not prove it."
        )
        for key, proven in (
            ("degree", certificate.get("degree")),
            ("number", certificate.get("number")),
            ("timed", certificate.get("question") == "time_dependent"),
        ):
            self.agree(
                f"{at}/{key}",
                found.get(key) == proven,
                found.get(key),
                f"The certificate says {proven}.",
            )
        general = [*checker.in_general(as_object(certificate.get("system")))]
        self.agree(
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
        self.agree(
            f"{at}/certificate",
            same,
            "",
            "It is about another system, or about integrals that are not listed.",
        )
        self.claim(*(place for place, text in listed.items() if text in used))

    def main(self, part: dict[str, Any], at: str, timed: bool, own: dict[str, Any]) -> bool:
        """The answers to both questions on one cell; whether both are decided."""
        self.all_integrals(part, at, own)
        verdict, later, other = (
            part.get("verdict"),
            part.get("verdict_with_time"),
            part.get("with_time"),
        )
        asked = "time_dependent" if timed else "autonomous"
        if timed and later not in (None, verdict):
            self.contradict(
                f"{at}/verdict_with_time", later, "The two answers to the same question differ."
            )
        for key, value in (("verdict", verdict), ("verdict_with_time", later)):
            if value not in (*_VERDICTS, None) and (at or value != "differs"):
                self.contradict(f"{at}/{key}", value, "It is no verdict.")
        if (verdict, later) == ("variational", "not_variational"):
            self.contradict(f"{at}/verdict_with_time", later, "An L(q, q') is an L(t, q, q') too.")
        shown = [Shown(at, part, asked, verdict, own)]
        if other is not None:
            if other.get("verdict") not in (None, later):
                self.contradict(
                    f"{at}/with_time/verdict", other.get("verdict"), "verdict_with_time is another."
                )
            shown.append(Shown(f"{at}/with_time", other, "time_dependent", later, own))
        certificates = [self.answer(one) for one in shown]
        proven = [one for one in certificates if one is not None]
        good = later is None or any(proves(one, "time_dependent", later) for one in proven)
        if good and later is not None:
            self.claim(f"{at}/verdict_with_time", f"{at}/with_time/verdict")
        if at == "" and self.result.get("branches"):
            return True  # said by the first branch
        if verdict != "undetermined" and certificates[0] is not None:
            proof = self.proof(certificates[0])
            energy = part.get("hamiltonian") if f"{at}/hamiltonian/text" in self.claimed else None
            whole = f"{at}/hamiltonian/domain" in self.claimed
            self.cells.append(
                canonical.cell(own, str(verdict), certificates[0], proof, energy, whole)
            )
        if (
            other is not None
            and later != "undetermined"
            and (certificate := certificates[1]) is not None
        ):
            energy = (
                other.get("hamiltonian")
                if f"{at}/with_time/hamiltonian/text" in self.claimed
                else None
            )
            whole = f"{at}/with_time/hamiltonian/domain" in self.claimed
            proof = self.proof(certificate)
            self.timed_cells.append(
                canonical.cell(own, str(later), certificate, proof, energy, whole)
            )
        return good and None not in certificates and "undetermined" not in (verdict, later)

    def equations_there(self, branch: dict[str, Any], at: str, own: dict[str, Any]) -> None:
        """That the equations of a branch are those of its certificate on the cell of that."""
        equations, certificate = branch.get("equations"), branch.get("certificate")
        if not equations or not certificate:
            return
        there = {**own, "equations": equations}
        claimed = comparison.Canonical(system_fields(certificate), certificate)
        found = comparison.compared_with_document(there, claimed, self.end - now())
        good = found.verdict == "valid"
        # The proof compares them near its point, where a root or an inverse has one sign.
        if good and comparison.divides_anew(there, own, branch):
            self.agree(f"{at}/equations", False, equations, "They divide by 0 there.")
        elif found.verdict == "invalid" or (good and comparison.stays_one_formula(there, branch)):
            self.agree(f"{at}/equations", good, equations, "They are others there.")

    def proof(self, certificate: dict[str, Any]) -> checker.CheckResult:
        """The checker's verdict, found once."""
        key = json.dumps(certificate, sort_keys=True)
        if key not in self.proofs:
            self.proofs[key] = checker.check_certificate(
                certificate, time_limit=max(1.0, self.end - now())
            )
        return self.proofs[key]

    def narrow(
        self, certificate: dict[str, Any], where: checker.Cell | None
    ) -> checker.CheckResult:
        """The proof on the part of its cell where the document says the same as its certificate."""
        proof = checker.narrowed(certificate, self.proof(certificate), where, self.end - now())
        self.proofs[json.dumps(certificate, sort_keys=True)] = proof
        return proof

    def answer(self, shown: Shown) -> dict[str, Any] | None:
        """Compare an answer with its certificate; the certificate where it proves the verdict."""
        at, part, certificate = shown.at, shown.part, shown.part.get("certificate")
        if certificate is None:
            if shown.verdict == "undetermined":
                self.claim(f"{at}/{shown.key}")
            for key in ("lagrangian", "hamiltonian", "dissipation"):
                if part.get(key) is not None:
                    self.contradict(f"{at}/{key}", _text(part[key]), "Nothing is proven here.")
            return None
        if not isinstance(certificate, dict):
            self.contradict(f"{at}/certificate", str(certificate)[:40], "It is no certificate.")
            return None
        proof = self.proof(certificate)
        self.claim(*(f"{at}/certificate/{key}" for key in read_keys(certificate)))
        if proof.verdict == "invalid":
            self.contradict(f"{at}/certificate", certificate.get("claim"), proof.reasons[0])
            return None
        good = self.fits(shown, certificate)
        self.agree(
            f"{at}/{shown.key}", good, shown.verdict, "Its certificate makes a different claim."
        )
        same = _same_system(system_fields(certificate), shown.system)
        if not same:
            self.contradict(f"{at}/certificate/system", "", "It is about a different system.")
        if proof.verdict == "incomplete":
            self.unsettled(proof.reasons[0])
            return None
        if not good or not same:
            return None
        self.reasons.extend(proof.reasons)
        if not shown.follows:
            proof = self.narrow(certificate, self.with_document(certificate))
            # A part of a result that an older program wrote has no list.
            self.exceptions(
                at,
                part.get("exceptions", [*proof.exceptions] if shown.kind else []),
                proof.exceptions,
            )
        elif "exceptions" in part:
            self.exceptions(at, part["exceptions"], proof.exceptions)
        if "checked" in part:
            self.agree(
                f"{at}/checked",
                part["checked"] == "valid",
                part["checked"],
                "The checker says valid.",
            )
        self.formulas(shown, certificate)
        self.domains(shown, certificate, proof)
        self.energy(shown, certificate)
        self.multiplier(shown, certificate)
        return certificate

    def fits(self, shown: Shown, certificate: dict[str, Any]) -> bool:
        among, no = certificate.get("among"), shown.verdict == "not_variational"
        friction = (
            "rayleigh" in shown.kind
        )  # with which there may be a Lagrangian where none is without
        whole = shown.kind in ("", "time") or (no and not friction)
        good = checker.kind_named(among) == shown.kind if among is not None else whole
        return good and proves(certificate, shown.question, shown.verdict)

    def formulas(self, shown: Shown, certificate: dict[str, Any]) -> None:
        at, part = shown.at, shown.part
        for key in ("lagrangian", "dissipation"):
            proven = certificate.get(key) if key in read_keys(certificate) else None
            says = _text(part.get(key))
            place = f"{at}/{key}/text" if isinstance(part.get(key), dict) else f"{at}/{key}"
            if isinstance(part.get(key), str):
                self.contradict(place, says, "A formula is an object with text and LaTeX.")
            same = (says is None) == (proven is None) and (
                says is None or _tokens(says) == _tokens(proven)
            )
            self.agree(
                place,
                same,
                says,
                f"Its certificate proves {proven or 'that one exists, and gives none'}.",
            )
            if same and says is not None and isinstance(part[key], dict):
                self.latex(f"{at}/{key}", part[key], certificate, shown.system)
        if part.get("integrals"):
            proven = certificate.get("integrals")
            self.agree(
                f"{at}/integrals",
                part["integrals"] == proven,
                "",
                "The certificate has different integrals.",
            )
        if defined := as_object(part.get("lagrangian")).get("auxiliary"):
            good = defined == certificate.get("integrals")
            self.agree(
                f"{at}/lagrangian/auxiliary", good, "", "The certificate has different integrals."
            )

    def latex(
        self, at: str, part: dict[str, Any], certificate: dict[str, Any], system: dict[str, Any]
    ) -> None:
        """Claim the LaTeX if it is that of the formula."""
        names = certify.names_of_certificate(system, certificate, part.get("momenta") or ())
        if part.get("latex") and part["latex"] == to_latex(
            reader.read_formula(part["text"], names)
        ):
            self.claim(f"{at}/latex")

    def domains(
        self, shown: Shown, certificate: dict[str, Any], proof: checker.CheckResult
    ) -> None:
        """Each stated domain has all members of the cell that was proven: of the verdict, or of
        L.
        """
        at, part = shown.at, shown.part
        near = certificate.get("near") or {}
        if part.get("near"):
            self.agree(
                f"{at}/near",
                part["near"] == near,
                part["near"],
                "The certificate is about another point.",
            )
        shape = part.get("lagrangian") if isinstance(part.get("lagrangian"), dict) else {}
        holders = [
            (f"{at}/domain", part.get("domain"), proof.cell),
            (f"{at}/lagrangian/domain", (shape or {}).get("domain"), proof.formulas),
        ]
        listed = [(place, says, cell) for place, says, cell in holders if says is not None]
        if not listed:
            listed = [(f"{at}/domain", shown.around or [], proof.cell)]
        for place, says, cell in listed:
            self.domain(place, says, cell, certificate, shown.around or [])

    def domain(
        self,
        at: str,
        stated: Sequence[str],
        cell: checker.Cell | None,
        certificate: dict[str, Any],
        around: Sequence[str] = (),
    ) -> None:
        """A stated domain has all members of the cell; about a kind, together with that of the
        answer around it.
        """
        whole = [*stated, *(one for one in around if one not in stated)]
        if cell is not None and cell.unknown:
            self.unsettled(
                f"The formulas are too long to determine what {at or '/domain'} has to contain."
            )
            return
        missing, beyond = checker.lacking_members(certificate, whole, cell, self.end - now())
        if missing:
            self.unsettled(f"{at or '/domain'} lacks {', '.join(missing)}.")
        else:
            self.claim(*(f"{at}/{k}" for k in range(len(stated)) if k not in beyond))

    def exceptions(self, at: str, stated: Sequence[str], found: Sequence[str]) -> None:
        """The stated list has all values of parameters for which the proof is none, each of which
        is proven one.
        """
        place = f"{at}/exceptions"
        parts = checker.read_exceptions(stated)
        is_cut = parts.not_found or checker.read_exceptions(found).not_found or now() > self.end
        if is_cut or ({*parts.values} == {*found} and parts.functions):
            self.open_places.append(
                place
            )  # for one of both the time was over, before it was known of functions
            return
        proven = f"It is proven for general parameters, without {', '.join(found) or 'exceptions'}."
        good = isinstance(stated, list) and {*stated} == {*found}
        self.agree(place, good, ", ".join(map(str, stated)), proven)

    def energy(self, shown: Shown, certificate: dict[str, Any]) -> None:
        """A Hamiltonian belongs to a proven Lagrangian."""
        at, energy = f"{shown.at}/hamiltonian", shown.part.get("hamiltonian")
        if energy is None:
            return
        if not isinstance(energy, dict) or not isinstance(certificate.get("lagrangian"), str):
            self.contradict(
                at, _text(energy), "It belongs to no Lagrangian that a certificate proves."
            )
            return
        found = checker.judge_hamiltonian(certificate, energy, self.end - now())
        if found.verdict == "invalid":
            self.contradict(f"{at}/text", energy.get("text"), found.reason)
        elif found.verdict == "incomplete":
            self.unsettled(found.reason)
        elif found.proven:
            self.claim(f"{at}/text", f"{at}/momenta", f"{at}/implicit")
            names = certify.names_of_certificate(shown.system, certificate, energy["momenta"])
            is_defined = _is_defined(energy["text"], energy.get("domain") or [], names)
            if found.whole and is_defined:
                self.claim(f"{at}/domain")
            else:  # also an empty one, which says "everywhere"
                self.open_places.append(f"{at}/domain")
            if found.lacks and not is_defined:
                self.unsettled(f"{at}/domain lacks {', '.join(dict.fromkeys(found.lacks))}.")
            self.latex(at, energy, certificate, shown.system)
            self.mass_matrix(at, energy, certificate, names)

    def mass_matrix(
        self, at: str, energy: dict[str, Any], certificate: dict[str, Any], names: nm.Names
    ) -> None:
        """Claim M and V of H = p^T M^-1 p/2 + V, and the LaTeX of V."""
        rows, potential = energy.get("mass_matrix"), energy.get("potential")
        if not rows or not potential:
            return
        near = certificate.get("near") or {}
        found = matrices_beside.mass_matrix(energy, certificate["lagrangian"], names, near)
        if found == "wrong":
            self.contradict(
                f"{at}/mass_matrix", str(rows)[:200], "M and V are not those of this H."
            )
        elif found == "holds":
            self.claim(f"{at}/mass_matrix", f"{at}/potential/text")
            if potential.get("latex") == to_latex(reader.read_formula(potential["text"], names)):
                self.claim(f"{at}/potential/latex")

    def multiplier(self, shown: Shown, certificate: dict[str, Any]) -> None:
        """Claim g = d2L/dv2."""
        at, rows = f"{shown.at}/multiplier", shown.part.get("multiplier")
        if rows is None or not isinstance(certificate.get("lagrangian"), str):
            return
        names = certify.names_of_certificate(shown.system, certificate, ())
        near = certificate.get("near") or {}
        found = matrices_beside.multiplier(rows, certificate["lagrangian"], names, near)
        if found == "wrong":
            self.contradict(at, str(rows)[:200], "It is not d2L/dv2 of this L.")
        elif found == "holds":
            self.claim(at)

    def with_document(
        self, certificate: dict[str, Any], moving: bool = False
    ) -> checker.Cell | None:
        """The system of a certificate is that of the document on the set of the claim, where the
        cell has no more.
        """
        document = self.result["system"].get("given") if self.handed is None else self.handed
        if document is None:
            return None
        parts = [
            moving,
            *(certificate.get(key) for key in ("system", "near", "conditions", "roots")),
        ]
        key = json.dumps(parts, sort_keys=True)
        if key not in self.compared:
            found = self.compared[key] = _compared(document, certificate, moving, self.end - now())
            if found.verdict == "invalid":
                self.contradict("/system", "", found.reasons[0])
            elif found.verdict != "valid":
                self.unsettled(found.reasons[0])
            else:
                self.reasons.extend(found.reasons)
                if not moving:  # a motion on constraints is not the associated system that is shown
                    self.claim(*(f"/system/{name}" for name in system_fields({})))
        return self.compared[key].cell

    def kinds(self, plain: Any, own: dict[str, Any], moving: bool) -> None:
        """Answers about kinds of Lagrangians, each of which is a kind of the document."""
        listed = self.result.get("kinds")
        if not listed:
            return
        known: dict[str, Any] = {}
        if not moving:
            schema = accepting.to_schema(plain)
            asked = derived.to_kinds(schema, accepting.to_solvable(schema))
            known = {one.name: translate.as_plain_data(one.among) for one in asked}
        question = "time_dependent" if _contains_time(own["equations"]) else "autonomous"
        for name, part in listed.items():
            at, among = f"/kinds/{name}", as_object(part.get("certificate")).get("among")
            if name not in (*checker.KINDS.split("|"), "invariant"):
                self.contradict(at, name, "No such type exists.")
                continue
            if "given" in self.result["system"] or self.handed is not None:
                good = name in known and among in (None, known[name])
                self.agree(
                    f"{at}/certificate/among",
                    good,
                    str(among),
                    "The document requests other types.",
                )
            around = self.result.get("domain") or []
            settled = self.answer(Shown(at, part, question, part.get("verdict"), own, name, around))
            if part.get("verdict") != "undetermined" and settled is None:
                self.unsettled(f"{at}: no certificate proves the verdict.")

    def instead(self, document: Any, own: dict[str, Any]) -> None:
        part = as_object(self.result.get("instead"))
        if not part:
            return
        kind = part.get("kind")
        if kind in ("time", "rayleigh"):
            asked = (
                "time_dependent"
                if kind == "time" or _contains_time(own["equations"])
                else "autonomous"
            )
            around = self.result.get("domain") or []
            if (
                self.answer(Shown("/instead", part, asked, "variational", own, kind, around))
                is None
            ):
                self.unsettled("/instead: no certificate proves it.")
            self.claim("/instead/kind")
            return
        if kind not in ("parameters", "reduced"):
            self.contradict(
                "/instead/kind", str(kind), "It is not one of time, rayleigh, parameters, reduced."
            )
            return
        if kind == "parameters":
            found = derived.system_there(document, part.get("conditions"))
            self.about_another("/instead", part, found, ("kind", "equations", "conditions"))
        else:  # which is compared itself
            good = derived.is_of_reduced(part, as_object(self.result.get("reduced")))
            self.agree("/instead/kind", good, kind, "It is not the reduced system.")
            if document is not own:  # else the reduced system itself is compared with nothing
                self.claim(*(f"/instead/{key}" for key in derived.OF_REDUCED))

    def left_out(self, document: Any) -> None:
        """The answers at the special values of the parameters that the main answer does not
        cover.
        """
        holders = (self.result, as_object(self.result.get("with_time")))
        proven = {text for one in holders for text in one.get("exceptions") or ()}
        for k, part in enumerate(self.result.get("left_out") or ()):
            at, text = f"/left_out/{k}", part["where"]["text"]
            if text not in proven:
                self.open_places.append(at)  # equations between functions
                self.agree(
                    f"{at}/decided",
                    part["decided"] is False,
                    part["decided"],
                    "No special value is decided.",
                )
                continue
            self.claim(f"{at}/where/text")
            if part["decided"]:
                system = derived.system_at(document, text)
                self.about_another(at, part, system, ("equations", "decided"))
            else:
                self.agree(
                    f"{at}/verdict",
                    part["verdict"] == "undetermined",
                    part["verdict"],
                    "It is not decided.",
                )

    def family(self, document: Any, own: dict[str, Any], moving: bool) -> None:
        """Each leaf with a proof: its equations are those of its solved member, about which the
        certificate is.
        """
        part = as_object(self.result.get("family"))
        of_motions = moving and growing.asks_motion_alone(document)
        proven = self.all_members(self.system_of_motions(part, document) if of_motions else own)
        if of_motions:
            self.family_of_motions(part, document)
        for k, leaf in enumerate(part.get("leaves") or () if not moving else ()):
            at, proof = f"/family/leaves/{k}", as_object(leaf.get("proof"))
            self.agree(f"{at}/id", leaf.get("id") == k, leaf.get("id"), f"It is leaf {k}.")
            if not proof:
                for key in ("lagrangian", "hamiltonian"):
                    if leaf.get(key) is not None:
                        self.contradict(f"{at}/{key}", _text(leaf[key]), "Nothing is proven here.")
                if k not in proven:
                    self.open_places.append(at)
                continue
            system = family_parts.system_of_leaf(document, leaf)
            good = None if system is None else family_parts.follows(document, leaf)
            if good is None:
                self.open_places.append(f"{at}/equations")
            else:
                self.agree(f"{at}/equations", good, "", "They are not those of the solved members.")
            for place in range(len(leaf["equations"])) if good else ():
                self.claim(f"{at}/equations/{place}/text", f"{at}/solved/{place}/text")
            member = None if system is None else translate.plain_fields(system)
            for name in ("proof", "proof_without_time"):
                if one := as_object(leaf.get(name)):
                    same = system and family_parts.is_written_otherwise(
                        system, one.get("equations")
                    )
                    if same is None and system is not None:
                        self.open_places.append(f"{at}/{name}")  # roots, written in another way
                        continue
                    own_words = {"equations": one["equations"]} if same else {}
                    self.leaf_proof(at, name, leaf, one, member and {**member, **own_words})

    def system_of_motions(self, part: dict[str, Any], document: Any) -> dict[str, Any]:
        """What the certificate of a family of motions is about, if that is the motion of the
        document.
        """
        certificate = as_object(part.get("certificate"))
        if not as_object(certificate.get("system")).get("velocities"):
            return {}
        same = comparison.compared_claim(document, certificate, self.end - now())
        return comparison.system_fields(certificate) if same.verdict == "valid" else {}

    def family_of_motions(self, part: dict[str, Any], document: Any) -> None:
        """Each leaf with a proof: its certificate is about the motion of its general member, and
        claims its verdicts.
        """
        for k, leaf in enumerate(part.get("leaves") or ()):
            at, proof = f"/family/leaves/{k}", as_object(leaf.get("proof"))
            self.agree(f"{at}/id", leaf.get("id") == k, leaf.get("id"), f"It is leaf {k}.")
            if not proof:
                if leaf.get("lagrangian") is not None:
                    shown = _text(leaf["lagrangian"])
                    self.contradict(f"{at}/lagrangian", shown, "Nothing is proven here.")
                self.open_places.append(at)
                continue
            member = family_parts.document_of_leaf(document, leaf)
            good = None if member is None else family_parts.follows(document, leaf)
            if good is None or member is None:
                self.open_places.append(at)
                continue
            self.agree(f"{at}/equations", good, "", "They are not those of the solved members.")
            for place in range(len(leaf["equations"])) if good else ():
                self.claim(f"{at}/equations/{place}/text", f"{at}/solved/{place}/text")
            self.leaf_of_motion(at, leaf, proof, member)
        if not part.get("certificate"):
            self.agree("/family/covered", not part.get("covered"), "", "No certificate proves it.")

    def leaf_of_motion(
        self, at: str, leaf: dict[str, Any], given: dict[str, Any], member: dict[str, Any]
    ) -> None:
        certificate = as_object(given.get("certificate"))
        proof, system = self.proof(certificate), as_object(certificate.get("system"))
        if proof.verdict == "incomplete":
            self.unsettled(f"{at}/proof: {proof.reasons[0]}")
            return
        if proof.verdict == "invalid" or "velocities" not in system:
            self.contradict(f"{at}/proof", certificate.get("claim"), proof.reasons[0])
            return
        same = comparison.compared_claim(member, certificate, self.end - now())
        if same.verdict != "valid":
            said = same.reasons[0] if same.reasons else "It is about another motion."
            self.contradict(f"{at}/proof", "", said)
            return
        self.claim(*(f"{at}/proof/certificate/{name}" for name in read_keys(certificate)))
        sides = {"equations": {**system["equations"], **system["velocities"]}}
        for key in ("equations", "parameters", "functions"):
            wanted = sides.get(key) or system.get(key) or None
            good = (given.get(key) or None) == wanted
            self.agree(f"{at}/proof/{key}", good, "", "Its certificate is about another motion.")
        self.agree(f"{at}/proof/checked", given.get("checked") == "valid", "", "It is valid.")
        self.exceptions(f"{at}/proof", given.get("exceptions") or [], proof.exceptions)
        timed = leaf.get("verdict_with_time") is None and certificate["question"] == "time_dependent"  # fmt: skip
        asked = {
            "verdict": "time_dependent" if timed else "autonomous",
            "verdict_with_time": "time_dependent",
        }
        for key, question in asked.items():
            good = leaf.get(key) is None or proves(certificate, question, leaf[key])
            if leaf.get(key) == "not_variational" and not good:
                self.open_places.append(f"{at}/{key}")  # shown is the yes to the other question
            else:
                self.agree(f"{at}/{key}", good, leaf.get(key), "Its certificate claims another.")
        says = _text(leaf.get("lagrangian"))
        if says is not None:
            proven = certificate.get("lagrangian")
            good = proven is not None and _tokens(says) == _tokens(proven)
            self.agree(f"{at}/lagrangian/text", good, says, "Its certificate proves another.")

    def nearest(self, document: Any) -> None:
        """Each nearest system: its equations are those of the document with what moved, its
        distance is recomputed, and its own result is checked.
        """
        parts = self.result.get("nearest") or ()
        if not parts:
            return
        fitted = nearest_parts.fitted_system(
            accepting.to_schema(accepting.prepared(document).document)
        )
        for k, part in enumerate(parts):
            at, inner = f"/nearest/{k}", as_object(part.get("result"))
            coefficients = nearest_parts.with_moved(fitted, part["moved"])
            distance = fitted.distance(coefficients)
            close = abs(distance - float(part["distance"])) <= 1e-9 * (1 + distance)
            self.agree(f"{at}/distance", close, part["distance"], f"It is {distance:.10g}.")
            if part["chi2"] is not None:
                same = abs(float(part["chi2"]) - distance**2) <= 1e-8 * (1 + distance**2)
                self.agree(f"{at}/chi2", same, part["chi2"], f"It is {distance**2:.10g}.")
            wanted = fitted.member(coefficients)
            own = accepting.to_system(
                accepting.to_schema(accepting.prepared(system_fields(inner)).document)
            )
            good = wanted.coordinates == own.coordinates and all(
                collecting.collect(a - b) == ex.ZERO
                for a, b in zip(wanted.accelerations, own.accelerations, strict=True)
            )
            self.agree(f"{at}/moved", good, part["moved"], "The equations are others.")
            for name in part["moved"]:
                self.claim(*(f"{at}/moved/{nm.escaped(name)}/{key}" for key in ("from", "to")))
            found = check_plain(inner)
            if found["verdict"] == "incomplete":
                self.open_places.append(f"{at}/result")
                continue
            proven = found["verdict"] == "valid" and nearest_parts.has_valid_proof(inner)
            self.agree(f"{at}/result", proven, inner.get("verdict"), "No Lagrangian is proven.")

    def all_members(self, own: dict[str, Any]) -> set[int]:
        """The leaves of a family are those of its certificate; those whose verdicts it proves for
        all members.
        """
        part = as_object(self.result.get("family"))
        if not part:
            return set()
        certificate = as_object(part.get("certificate"))
        proof = checker.CheckResult("incomplete", ("No certificate proves it.",))
        if certificate.get("format") == checker.FORMAT_OF_FAMILIES:
            seconds = max(1.0, self.end - now())
            proof = checker.check_certificate(certificate, time_limit=seconds)
        if proof.verdict != "valid":
            if certificate and proof.verdict == "invalid":
                self.contradict("/family/certificate", "", proof.reasons[0])
            elif part.get("covered") or certificate:
                self.unsettled(f"/family: {proof.reasons[0]}")
            good = part.get("checked") != "valid"
            self.agree("/family/checked", good, part.get("checked"), "No certificate proves it.")
            return set()
        same = (
            system_fields(certificate) == own
            and part.get("letters") == certificate["letters"]
            and sorted(part.get("functions") or {}) == sorted(certificate["functions"])
        )
        self.agree("/family/certificate", same, "", "It is about another family.")
        leaves, stated = part.get("leaves") or [], certificate["leaves"]
        good = len(leaves) == len(stated)
        self.agree("/family/leaves", good, "", "The certificate is about other leaves.")
        for k, (leaf, proven) in enumerate(zip(leaves, stated, strict=False)):
            self.leaf_of_certificate(f"/family/leaves/{k}", leaf, proven)
        is_whole = not certificate.get("open")
        for key, says, wanted in (
            ("checked", part.get("checked"), "valid"),
            ("covered", part.get("covered"), is_whole),
        ):
            self.agree(f"/family/{key}", says == wanted, says, f"Its certificate says {wanted}.")
        if is_whole:
            self.agree("/family/open", not part.get("open"), "", "No member is open.")
        self.claim("/family/letters", "/family/functions")
        self.reasons += proof.reasons
        return {
            k
            for k, one in enumerate(stated)
            if k == 0
            or any(f" with {checker.condition_text(one)}: " in said for said in proof.reasons)
        }

    def leaf_of_certificate(self, at: str, leaf: dict[str, Any], proven: dict[str, Any]) -> None:
        for key, wanted in (
            ("equations", proven["equations"]),
            ("nonzero", proven.get("nonzero") or []),
        ):
            says = [one if isinstance(one, str) else one.get("text") for one in leaf.get(key) or []]
            if self.agree(f"{at}/{key}", says == wanted, _text(says), "The certificate says more, or less."):  # fmt: skip
                ends = [""] * len(says) if key == "nonzero" else ["/text"] * len(says)
                self.claim(*(f"{at}/{key}/{i}{end}" for i, end in enumerate(ends)))
        timed = proven.get("time_dependent")
        for key, verdict in (
            ("verdict", proven.get("autonomous") or timed),
            ("verdict_with_time", timed),
        ):
            self.agree(
                f"{at}/{key}",
                leaf.get(key) == verdict,
                leaf.get(key),
                f"Its certificate says {verdict}.",
            )

    def leaf_proof(
        self,
        at: str,
        name: str,
        leaf: dict[str, Any],
        proof: dict[str, Any],
        own: dict[str, Any] | None,
    ) -> None:
        """A certificate about the general member of a leaf, which proves its verdicts and its
        Lagrangian.
        """
        if own is None or proof.get("equations") != own["equations"]:
            self.contradict(f"{at}/{name}", "", "It is not about the general member of the leaf.")
            return
        self.claim(f"{at}/{name}/equations")
        certificate = as_object(proof.get("certificate"))
        timed, claim = certificate.get("question") == "time_dependent", certificate.get("claim")
        keys = ("lagrangian", "hamiltonian", "integrals", "near") if name == "proof" else ()
        shown = {key: leaf.get(key) for key in keys} | {
            "certificate": certificate, "checked": proof.get("checked"), "exceptions": proof.get("exceptions") or [],
            "domain": proof.get("domain") or [],
        }  # fmt: skip
        if name != "proof" and certificate.get("kind") == "lagrangian":
            shown["lagrangian"] = {"text": certificate.get("lagrangian")}
        if certificate.get("kind") == "nonexistence":
            shown = {key: shown[key] for key in ("certificate", "checked", "exceptions", "domain")}
        question = str(certificate.get("question"))
        held, place = {*self.claimed}, f"{at}/{name}"
        if (
            self.answer(Shown(place, shown, question, str(claim), own, key="verdict", follows=True))
            is None
        ):
            self.unsettled(f"{place}: no certificate proves it.")
            return
        found = self.proof(certificate).exceptions
        self.exceptions(place, shown["exceptions"], found)
        moved = {
            one
            for one in self.claimed - held
            if one.startswith((f"{place}/lagrangian", f"{place}/hamiltonian"))
        }
        self.claim(*(one.replace(place, at, 1) for one in moved))
        main_is_timed = leaf.get("verdict_with_time") is None or _contains_time(own["equations"])
        for key, asks_time in (("verdict", main_is_timed and timed), ("verdict_with_time", True)):
            covers = (
                timed is asks_time
                or (not timed and claim == "variational")
                or (timed and claim != "variational")
            )
            if covers and leaf.get(key) is not None:
                self.agree(
                    f"{at}/{key}", leaf[key] == claim, leaf[key], f"Its certificate proves {claim}."
                )

    def about_another(
        self,
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
            self.claim(f"{at}/verdict", f"{at}/factor")  # nothing was found
            return
        own = None if system is None else translate.plain_fields(system)
        if system is None or own is None or part.get("equations") != own["equations"]:
            self.contradict(
                at, verdict, "It is not about the system that follows from the document's."
            )
            return
        self.claim(*(f"{at}/{name}" for name in compared))
        certificate, questions = (
            as_object(part.get("certificate")),
            derived.questions_of(part, system),
        )
        if (
            system.positive
            and certificate
            and not derived.is_inside(system, certificate.get("near") or {})
        ):
            self.contradict(
                f"{at}/certificate/near", "", "It is about a different branch of signs."
            )
        question = (
            certificate.get("question")
            if certificate.get("question") in questions
            else questions[0]
        )
        found = self.answer(Shown(at, part, str(question), verdict, own, follows=True))
        if found is None and verdict != "undetermined":
            self.unsettled(f"{at}: no certificate proves it.")

    def others(self, document: Any, own: dict[str, Any]) -> None:
        """The system with another clock, and the reduced one."""
        if clock := as_object(self.result.get("with_clock")):
            self.about_another("/with_clock", clock, derived.system_with_clock(document, clock))
        reduced = as_object(self.result.get("reduced"))
        if reduced and document is not own:
            from inverse_service.service.documents import motion_documents

            found, clocked = motion_documents.systems_of_reduced(document, reduced)
            self.about_another("/reduced", reduced, found)
            if clock := as_object(reduced.get("with_clock")):
                self.about_another("/reduced/with_clock", clock, clocked)

    def motions(self, plain: Any, timed: bool) -> None:
        """The statements about a motion on constraints, on each branch."""
        branches = self.result.get("branches") or []
        for at, holder in [
            ("", self.result),
            *((f"/branches/{k}", one) for k, one in enumerate(branches)),
        ]:
            part = holder.get("any_associated")
            if part is not None:
                self.motion(f"{at}/any_associated", part, plain, timed)

    def motion(self, at: str, part: dict[str, Any], plain: Any, timed: bool) -> None:
        keys = [
            key for key in ("certificate", "certificate_with_time") if part.get(key) is not None
        ]
        certificates = [part[key] for key in keys]
        for key, certificate in zip(keys, certificates, strict=True):
            proof = self.proof(certificate)
            self.claim(*(f"{at}/{key}/{name}" for name in read_keys(certificate)))
            if proof.verdict == "invalid":
                self.contradict(f"{at}/{key}", certificate.get("claim"), proof.reasons[0])
                return
            # One without velocities is about the free coordinates alone, whose equations contain no
            # others.
            alone = "velocities" not in as_object(certificate.get("system"))
            if alone and not self.has_document:
                self.unsettled(
                    f"{at}/{key} is about the free coordinates alone: the document is needed."
                )
                return
            if (alone and certificate["claim"] != "variational") or certificate.get(
                "among"
            ) is not None:
                self.contradict(f"{at}/{key}/system", "", "It is about a different system.")
                return
            if proof.verdict == "incomplete":
                self.unsettled(proof.reasons[0])
                return
            self.reasons.extend(proof.reasons)
            self.narrow(certificate, self.with_document(certificate, moving=True))
            self.further.append(canonical.of_certificate(certificate, proof))
        parts = [
            one["system"].get(key) or {}
            for one in certificates
            for key in ("equations", "velocities")
        ]
        timed = timed or any(map(_contains_time, parts))
        if any(one["system"] != certificates[0]["system"] for one in certificates):
            self.contradict(f"{at}/certificate_with_time/system", "", "It is about two motions.")
        asked = {
            "verdict": "time_dependent" if timed else "autonomous",
            "verdict_with_time": "time_dependent",
        }
        for key, question in asked.items():
            good = part.get(key) in ("undetermined", None) or any(
                proves(one, question, part.get(key)) for one in certificates
            )
            self.agree(f"{at}/{key}", good, part.get(key), "No certificate claims that.")
        used = all(
            any(proves(one, asked[key], part.get(key)) for key in asked) for one in certificates
        )
        self.agree(f"{at}/certificate/claim", used, "", "A certificate claims another verdict.")
        proofs = [one for one in certificates if one["kind"] == "lagrangian"]
        says, shape = _text(part.get("lagrangian")), as_object(part.get("lagrangian"))
        same_ones = [
            one
            for one in proofs
            if says is not None and _tokens(says) == _tokens(one["lagrangian"])
        ]
        place, good = (
            (f"{at}/lagrangian", not proofs)
            if says is None
            else (f"{at}/lagrangian/text", bool(same_ones))
        )
        self.agree(place, good, says, "Its certificate proves another.")
        for one in same_ones[:1] if "domain" in shape else ():
            self.domain(f"{at}/lagrangian/domain", shape["domain"], self.proof(one).formulas, one)
        if part.get("checked") is not None and certificates:
            self.agree(
                f"{at}/checked",
                part["checked"] == "valid",
                part["checked"],
                "The checker says valid.",
            )
        found = [one for certificate in certificates for one in self.proof(certificate).exceptions]
        self.exceptions(at, part.get("exceptions", found), found)
        if "undetermined" in (
            part.get("verdict"),
            part.get("verdict_with_time"),
        ) and growing.asks_motion_alone(plain):
            self.unsettled(_OPEN)

    def associated(self, plain: Any, own: dict[str, Any]) -> None:
        """The associated system of the main fields is the one that the document names; the image of
        D is that of D.
        """
        from inverse_service.service.documents import motion_documents

        result, alone = self.result, growing.asks_motion_alone(plain)
        made = motion_documents.asked_fields(plain) if self.has_document else None
        if made is not None:
            for name in ("coordinates", "parameters", "functions") if alone else ():
                good = own[name] == made[name]
                self.agree(
                    f"/system/{name}", good, str(own[name]), f"The document has {made[name]}."
                )
            same = comparison.same_formulas(
                own["equations"], made["equations"], certify.names_of_certificate(own)
            )
            if same is None and not alone:
                self.unsettled(
                    "It could not be decided whether this is the associated system that the document names."
                )
            elif same is not None and alone:
                self.agree("/system/equations", same, "", "They are not those of the document.")
            elif same is not None:
                asked = plain.get("associated")
                self.agree(
                    "/system/given/associated",
                    same,
                    asked,
                    "The equations are another associated system.",
                )
        energy = result.get("hamiltonian")
        certificate = as_object(result.get("certificate"))
        if (
            isinstance(energy, dict)
            and energy.get("constraints")
            and "/hamiltonian/momenta" in self.claimed
        ):
            good = comparison.image_agrees(
                plain, energy, certify.names_of_certificate(own, certificate, energy["momenta"])
            )
            if good is not None:
                proven = "It is not the image of the constraints."
                self.agree("/hamiltonian/constraints", good, energy["constraints"], proven)
                if energy.get("image"):
                    same = (
                        good and [one["text"] for one in energy["image"]] == energy["constraints"]
                    )
                    self.agree("/hamiltonian/image", same, str(energy["image"])[:200], proven)

    def covered(self, plain: Any) -> None:
        """Every point of the document that is found lies in a cell that is answered, or listed as
        not answered.
        """
        schema = accepting.to_schema(plain)
        branches = self.result.get("branches") or []
        domains = [tuple(sorted(one.get("domain") or [])) for one in branches]
        if len(domains) != len({*domains}):
            self.contradict("/branches", "", "Two branches have one domain.")
        if not self.contradictions and not self.open:
            gap = comparison.gaps(
                accepting.to_solvable(schema), self.result, [one["sides"] for one in self.cells]
            )
            if gap:
                self.contradict("/branches", f"{len(self.cells)} cells", gap)

    def named(self, plain: Any, own: dict[str, Any]) -> None:
        """LaTeX of the equations, names that were guessed, and the branches themselves."""
        latex, names = (
            as_object(self.result["system"].get("latex")),
            certify.names_of_certificate(own),
        )
        for name, text in latex.items():
            with suppress(LimitError):  # too long to be read again: it is not compared
                written = to_latex(reader.read_formula(own["equations"].get(name, "0"), names))
                if text.endswith(f" = {written}"):
                    self.claim(f"/system/latex/{name}")
        guessed = self.result.get("guessed")
        known = {*own["parameters"], *own["functions"]}
        if (
            isinstance(guessed, list)
            and guessed
            and {*guessed} <= known
            and isinstance(plain, dict)
        ):
            declared = json.dumps([plain.get("parameters"), plain.get("functions")])
            if not any(f'"{name}"' in declared for name in guessed):
                self.claim("/guessed")


def _compared(
    document: Any, certificate: dict[str, Any], moving: bool, limit: float
) -> checker.CheckResult:
    """Whether a certificate is about the system of a document, or about its motion on
    constraints.
    """
    if moving:
        return comparison.compared_claim(document, certificate, limit)
    return comparison.compared_with_document(
        document, comparison.Canonical(system_fields(certificate), certificate), limit
    )


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


def read_keys(certificate: Mapping[str, Any]) -> set[str]:
    """What the checker reads of this certificate."""
    among, kind = str(certificate.get("among")), str(certificate.get("kind"))
    moving = "velocities" in as_object(certificate.get("system"))
    found = [_READ_OF.get((of, kind), set()) for of in ("", among)]
    roots = (
        f"roots/{k}/{key}"
        for k in range(len(certificate.get("roots") or ()))
        for key in ("root", "is")
    )
    return _READ.union(*found, _READ_OF_MOTION if moving else (), roots)


def proves(certificate: Mapping[str, Any], question: str, verdict: str | None) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate["claim"] == verdict and certificate["question"] in (question, wider)


def _identity(answer: Mapping[str, Any]) -> tuple[object, ...]:
    """What tells an entry of `answers` from the others of its result."""
    return stated.question_of(answer), answer.get("cell", 0), str(answer.get("equations"))


def _same_system(one: dict[str, Any], other: dict[str, Any]) -> bool:
    plain = all(one[key] == other[key] for key in ("coordinates", "parameters", "functions"))
    pairs = [(one["equations"].get(key), text) for key, text in other["equations"].items()]
    return (
        plain
        and len(pairs) == len(one["equations"])
        and all(a and _tokens(a) == _tokens(b) for a, b in pairs)
    )


def _tokens(text: Any) -> tuple[str, ...]:
    return checker.read_tokens(text, "formula")


def _contains_time(formulas: Mapping[str, str]) -> bool:
    return any("t" in _tokens(text) for text in formulas.values())


def _is_defined(formula: str, domain: Sequence[str], names: nm.Names) -> bool:
    """Whether a formula has a value wherever a stated domain holds, whatever values its names
    have.
    """
    try:
        tree = reader.read_formula(formula, names)
        stated = [(reader.read_condition(one, names), "!=" in one) for one in domain]
    except (InputError, ValueError):  # a chain a < b < c, for one
        return False
    nonzero, positive = (
        [one for one, unequal in stated if unequal is kind] for kind in (True, False)
    )
    known = (*positive, *(one**2 for one in nonzero))
    return all(
        real_branch.is_positive(one, known) for one in real_branch.own_requirements([tree])
    ) and all(real_branch.is_nonzero(one, nonzero, positive) for one in real_branch.poles([tree]))


def _text(part: Any) -> Any:
    return part.get("text") if isinstance(part, dict) else part
