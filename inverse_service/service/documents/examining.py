"""What is found where the statements of a result are compared with its certificates, one answer
after another.

`Examination` collects the JSON pointers that a comparison claimed; `checking` lists every other leaf
that says something.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.decision import certify
from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_latex
from inverse_service.field import real_branch
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import (
    comparison,
    matrices_beside,
)
from inverse_service.service.documents.comparison import as_object, system_fields

OPEN: Final = "A verdict is undetermined, or no certificate proves it."
OTHER_SYSTEM: Final = "It is about a different system."
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
                    self.contradict(f"{at}/{key}", text_of(part[key]), "Nothing is proven here.")
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
            self.contradict(f"{at}/certificate/system", "", OTHER_SYSTEM)
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
            says = text_of(part.get(key))
            place = f"{at}/{key}/text" if isinstance(part.get(key), dict) else f"{at}/{key}"
            if isinstance(part.get(key), str):
                self.contradict(place, says, "A formula is an object with text and LaTeX.")
            same = (says is None) == (proven is None) and (
                says is None or tokens_of(says) == tokens_of(proven)
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
                at, text_of(energy), "It belongs to no Lagrangian that a certificate proves."
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
            found = self.compared[key] = compared(document, certificate, moving, self.end - now())
            if found.verdict == "invalid":
                self.contradict("/system", "", found.reasons[0])
            elif found.verdict != "valid":
                self.unsettled(found.reasons[0])
            else:
                self.reasons.extend(found.reasons)
                if not moving:  # a motion on constraints is not the associated system that is shown
                    self.claim(*(f"/system/{name}" for name in system_fields({})))
        return self.compared[key].cell


def compared(
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


def _same_system(one: dict[str, Any], other: dict[str, Any]) -> bool:
    plain = all(one[key] == other[key] for key in ("coordinates", "parameters", "functions"))
    pairs = [(one["equations"].get(key), text) for key, text in other["equations"].items()]
    return (
        plain
        and len(pairs) == len(one["equations"])
        and all(a and tokens_of(a) == tokens_of(b) for a, b in pairs)
    )


def tokens_of(text: Any) -> tuple[str, ...]:
    return checker.read_tokens(text, "formula")


def contains_time(formulas: Mapping[str, str]) -> bool:
    return any("t" in tokens_of(text) for text in formulas.values())


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


def text_of(part: Any) -> Any:
    return part.get("text") if isinstance(part, dict) else part
