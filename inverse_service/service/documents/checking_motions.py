"""The statements of a result about motions on constraints and their associated systems, compared with
their certificates: each function claims what it has compared.
"""

import json
from contextlib import suppress
from typing import Any

from inverse_service.decision import certify
from inverse_service.errors import LimitError
from inverse_service.expressions.printing import to_latex
from inverse_service.reading import reader
from inverse_service.service.documents import (
    accepting,
    canonical,
    comparison,
    examining,
    growing,
)
from inverse_service.service.documents.comparison import as_object
from inverse_service.service.documents.examining import Examination


def motions(examination: Examination, plain: Any, timed: bool) -> None:
    """The statements about a motion on constraints, on each branch."""
    branches = examination.result.get("branches") or []
    for at, holder in [
        ("", examination.result),
        *((f"/branches/{k}", one) for k, one in enumerate(branches)),
    ]:
        part = holder.get("any_associated")
        if part is not None:
            _motion(examination, f"{at}/any_associated", part, plain, timed)


def _motion(
    examination: Examination, at: str, part: dict[str, Any], plain: Any, timed: bool
) -> None:
    keys = [key for key in ("certificate", "certificate_with_time") if part.get(key) is not None]
    certificates = [part[key] for key in keys]
    for key, certificate in zip(keys, certificates, strict=True):
        proof = examination.proof(certificate)
        examination.claim(*(f"{at}/{key}/{name}" for name in examining.read_keys(certificate)))
        if proof.verdict == "invalid":
            examination.contradict(f"{at}/{key}", certificate.get("claim"), proof.reasons[0])
            return
        # One without velocities is about the free coordinates alone, whose equations contain no
        # others.
        alone = "velocities" not in as_object(certificate.get("system"))
        if alone and not examination.has_document:
            examination.unsettled(
                f"{at}/{key} is about the free coordinates alone: the document is needed."
            )
            return
        if (alone and certificate["claim"] != "variational") or certificate.get(
            "among"
        ) is not None:
            examination.contradict(f"{at}/{key}/system", "", examining.OTHER_SYSTEM)
            return
        if proof.verdict == "incomplete":
            examination.unsettled(proof.reasons[0])
            return
        examination.reasons.extend(proof.reasons)
        examination.narrow(certificate, examination.with_document(certificate, moving=True))
        examination.further.append(canonical.of_certificate(certificate, proof))
    parts = [
        one["system"].get(key) or {} for one in certificates for key in ("equations", "velocities")
    ]
    timed = timed or any(map(examining.contains_time, parts))
    if any(one["system"] != certificates[0]["system"] for one in certificates):
        examination.contradict(f"{at}/certificate_with_time/system", "", "It is about two motions.")
    asked = {
        "verdict": "time_dependent" if timed else "autonomous",
        "verdict_with_time": "time_dependent",
    }
    for key, question in asked.items():
        good = part.get(key) in ("undetermined", None) or any(
            examining.proves(one, question, part.get(key)) for one in certificates
        )
        examination.agree(f"{at}/{key}", good, part.get(key), "No certificate claims that.")
    used = all(
        any(examining.proves(one, asked[key], part.get(key)) for key in asked)
        for one in certificates
    )
    examination.agree(f"{at}/certificate/claim", used, "", "A certificate claims another verdict.")
    proofs = [one for one in certificates if one["kind"] == "lagrangian"]
    says, shape = examining.text_of(part.get("lagrangian")), as_object(part.get("lagrangian"))
    same_ones = [
        one
        for one in proofs
        if says is not None and examining.tokens_of(says) == examining.tokens_of(one["lagrangian"])
    ]
    place, good = (
        (f"{at}/lagrangian", not proofs)
        if says is None
        else (f"{at}/lagrangian/text", bool(same_ones))
    )
    examination.agree(place, good, says, "Its certificate proves another.")
    for one in same_ones[:1] if "domain" in shape else ():
        examination.domain(
            f"{at}/lagrangian/domain", shape["domain"], examination.proof(one).formulas, one
        )
    if part.get("checked") is not None and certificates:
        examination.agree(
            f"{at}/checked",
            part["checked"] == "valid",
            part["checked"],
            "The checker says valid.",
        )
    found = [
        one for certificate in certificates for one in examination.proof(certificate).exceptions
    ]
    examination.exceptions(at, part.get("exceptions", found), found)
    if "undetermined" in (
        part.get("verdict"),
        part.get("verdict_with_time"),
    ) and growing.asks_motion_alone(plain):
        examination.unsettled(examining.OPEN)


def associated(examination: Examination, plain: Any, own: dict[str, Any]) -> None:
    """The associated system of the main fields is the one that the document names; the image of
    D is that of D.
    """
    from inverse_service.service.documents import motion_documents

    result, alone = examination.result, growing.asks_motion_alone(plain)
    made = motion_documents.asked_fields(plain) if examination.has_document else None
    if made is not None:
        for name in ("coordinates", "parameters", "functions") if alone else ():
            good = own[name] == made[name]
            examination.agree(
                f"/system/{name}", good, str(own[name]), f"The document has {made[name]}."
            )
        same = comparison.same_formulas(
            own["equations"], made["equations"], certify.names_of_certificate(own)
        )
        if same is None and not alone:
            examination.unsettled(
                "It could not be decided whether this is the associated system that the document names."
            )
        elif same is not None and alone:
            examination.agree("/system/equations", same, "", "They are not those of the document.")
        elif same is not None:
            asked = plain.get("associated")
            examination.agree(
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
        and "/hamiltonian/momenta" in examination.claimed
    ):
        good = comparison.image_agrees(
            plain, energy, certify.names_of_certificate(own, certificate, energy["momenta"])
        )
        if good is not None:
            proven = "It is not the image of the constraints."
            examination.agree("/hamiltonian/constraints", good, energy["constraints"], proven)
            if energy.get("image"):
                same = good and [one["text"] for one in energy["image"]] == energy["constraints"]
                examination.agree("/hamiltonian/image", same, str(energy["image"])[:200], proven)


def covered(examination: Examination, plain: Any) -> None:
    """Every point of the document that is found lies in a cell that is answered, or listed as
    not answered.
    """
    schema = accepting.to_schema(plain)
    branches = examination.result.get("branches") or []
    domains = [tuple(sorted(one.get("domain") or [])) for one in branches]
    if len(domains) != len({*domains}):
        examination.contradict("/branches", "", "Two branches have one domain.")
    if not examination.contradictions and not examination.open:
        gap = comparison.gaps(
            accepting.to_solvable(schema),
            examination.result,
            [one["sides"] for one in examination.cells],
        )
        if gap:
            examination.contradict("/branches", f"{len(examination.cells)} cells", gap)


def named(examination: Examination, plain: Any, own: dict[str, Any]) -> None:
    """LaTeX of the equations, names that were guessed, and the branches themselves."""
    latex, names = (
        as_object(examination.result["system"].get("latex")),
        certify.names_of_certificate(own),
    )
    for name, text in latex.items():
        with suppress(LimitError):  # too long to be read again: it is not compared
            written = to_latex(reader.read_formula(own["equations"].get(name, "0"), names))
            if text.endswith(f" = {written}"):
                examination.claim(f"/system/latex/{name}")
    guessed = examination.result.get("guessed")
    known = {*own["parameters"], *own["functions"]}
    if isinstance(guessed, list) and guessed and {*guessed} <= known and isinstance(plain, dict):
        declared = json.dumps([plain.get("parameters"), plain.get("functions")])
        if not any(f'"{name}"' in declared for name in guessed):
            examination.claim("/guessed")
