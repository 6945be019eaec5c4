"""The sets of a family of a result, compared with their certificates: each function claims what it
has compared.
"""

from typing import Any

from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.service.documents import (
    comparison,
    examining,
    family_parts,
    growing,
    translate,
)
from inverse_service.service.documents.comparison import as_object, system_fields
from inverse_service.service.documents.examining import Examination, Shown


def family(examination: Examination, document: Any, own: dict[str, Any], moving: bool) -> None:
    """Each leaf with a proof: its equations are those of its solved member, about which the
    certificate is.
    """
    part = as_object(examination.result.get("family"))
    of_motions = moving and growing.asks_motion_alone(document)
    proven = _all_members(
        examination, _system_of_motions(examination, part, document) if of_motions else own
    )
    if of_motions:
        _family_of_motions(examination, part, document)
    for k, leaf in enumerate(part.get("leaves") or () if not moving else ()):
        at, proof = f"/family/leaves/{k}", as_object(leaf.get("proof"))
        examination.agree(f"{at}/id", leaf.get("id") == k, leaf.get("id"), f"It is leaf {k}.")
        if not proof:
            for key in ("lagrangian", "hamiltonian"):
                if leaf.get(key) is not None:
                    examination.contradict(
                        f"{at}/{key}", examining.text_of(leaf[key]), "Nothing is proven here."
                    )
            if k not in proven:
                examination.open_places.append(at)
            continue
        system = family_parts.system_of_leaf(document, leaf)
        good = None if system is None else family_parts.follows(document, leaf)
        if good is None:
            examination.open_places.append(f"{at}/equations")
        else:
            examination.agree(
                f"{at}/equations", good, "", "They are not those of the solved members."
            )
        for place in range(len(leaf["equations"])) if good else ():
            examination.claim(f"{at}/equations/{place}/text", f"{at}/solved/{place}/text")
        member = None if system is None else translate.plain_fields(system)
        for name in ("proof", "proof_without_time"):
            if one := as_object(leaf.get(name)):
                same = system and family_parts.is_written_otherwise(system, one.get("equations"))
                if same is None and system is not None:
                    examination.open_places.append(f"{at}/{name}")  # roots, written in another way
                    continue
                own_words = {"equations": one["equations"]} if same else {}
                _leaf_proof(examination, at, name, leaf, one, member and {**member, **own_words})


def _system_of_motions(
    examination: Examination, part: dict[str, Any], document: Any
) -> dict[str, Any]:
    """What the certificate of a family of motions is about, if that is the motion of the
    document.
    """
    certificate = as_object(part.get("certificate"))
    if not as_object(certificate.get("system")).get("velocities"):
        return {}
    same = comparison.compared_claim(document, certificate, examination.end - now())
    return comparison.system_fields(certificate) if same.verdict == "valid" else {}


def _family_of_motions(examination: Examination, part: dict[str, Any], document: Any) -> None:
    """Each leaf with a proof: its certificate is about the motion of its general member, and
    claims its verdicts.
    """
    for k, leaf in enumerate(part.get("leaves") or ()):
        at, proof = f"/family/leaves/{k}", as_object(leaf.get("proof"))
        examination.agree(f"{at}/id", leaf.get("id") == k, leaf.get("id"), f"It is leaf {k}.")
        if not proof:
            if leaf.get("lagrangian") is not None:
                shown = examining.text_of(leaf["lagrangian"])
                examination.contradict(f"{at}/lagrangian", shown, "Nothing is proven here.")
            examination.open_places.append(at)
            continue
        member = family_parts.document_of_leaf(document, leaf)
        good = None if member is None else family_parts.follows(document, leaf)
        if good is None or member is None:
            examination.open_places.append(at)
            continue
        examination.agree(f"{at}/equations", good, "", "They are not those of the solved members.")
        for place in range(len(leaf["equations"])) if good else ():
            examination.claim(f"{at}/equations/{place}/text", f"{at}/solved/{place}/text")
        _leaf_of_motion(examination, at, leaf, proof, member)
    if not part.get("certificate"):
        examination.agree(
            "/family/covered", not part.get("covered"), "", "No certificate proves it."
        )


def _leaf_of_motion(
    examination: Examination,
    at: str,
    leaf: dict[str, Any],
    given: dict[str, Any],
    member: dict[str, Any],
) -> None:
    certificate = as_object(given.get("certificate"))
    proof, system = examination.proof(certificate), as_object(certificate.get("system"))
    if proof.verdict == "incomplete":
        examination.unsettled(f"{at}/proof: {proof.reasons[0]}")
        return
    if proof.verdict == "invalid" or "velocities" not in system:
        examination.contradict(f"{at}/proof", certificate.get("claim"), proof.reasons[0])
        return
    same = comparison.compared_claim(member, certificate, examination.end - now())
    if same.verdict != "valid":
        said = same.reasons[0] if same.reasons else "It is about another motion."
        examination.contradict(f"{at}/proof", "", said)
        return
    examination.claim(
        *(f"{at}/proof/certificate/{name}" for name in examining.read_keys(certificate))
    )
    sides = {"equations": {**system["equations"], **system["velocities"]}}
    for key in ("equations", "parameters", "functions"):
        wanted = sides.get(key) or system.get(key) or None
        good = (given.get(key) or None) == wanted
        examination.agree(f"{at}/proof/{key}", good, "", "Its certificate is about another motion.")
    examination.agree(f"{at}/proof/checked", given.get("checked") == "valid", "", "It is valid.")
    examination.exceptions(f"{at}/proof", given.get("exceptions") or [], proof.exceptions)
    timed = leaf.get("verdict_with_time") is None and certificate["question"] == "time_dependent"  # fmt: skip
    asked = {
        "verdict": "time_dependent" if timed else "autonomous",
        "verdict_with_time": "time_dependent",
    }
    for key, question in asked.items():
        good = leaf.get(key) is None or examining.proves(certificate, question, leaf[key])
        if leaf.get(key) == "not_variational" and not good:
            examination.open_places.append(f"{at}/{key}")  # shown is the yes to the other question
        else:
            examination.agree(f"{at}/{key}", good, leaf.get(key), "Its certificate claims another.")
    says = examining.text_of(leaf.get("lagrangian"))
    if says is not None:
        proven = certificate.get("lagrangian")
        good = proven is not None and examining.tokens_of(says) == examining.tokens_of(proven)
        examination.agree(f"{at}/lagrangian/text", good, says, "Its certificate proves another.")


def _all_members(examination: Examination, own: dict[str, Any]) -> set[int]:
    """The leaves of a family are those of its certificate; those whose verdicts it proves for
    all members.
    """
    part = as_object(examination.result.get("family"))
    if not part:
        return set()
    certificate = as_object(part.get("certificate"))
    proof = checker.CheckResult("incomplete", ("No certificate proves it.",))
    if certificate.get("format") == checker.FORMAT_OF_FAMILIES:
        seconds = max(1.0, examination.end - now())
        proof = checker.check_certificate(certificate, time_limit=seconds)
    if proof.verdict != "valid":
        if certificate and proof.verdict == "invalid":
            examination.contradict("/family/certificate", "", proof.reasons[0])
        elif part.get("covered") or certificate:
            examination.unsettled(f"/family: {proof.reasons[0]}")
        good = part.get("checked") != "valid"
        examination.agree("/family/checked", good, part.get("checked"), "No certificate proves it.")
        return set()
    same = (
        system_fields(certificate) == own
        and part.get("letters") == certificate["letters"]
        and sorted(part.get("functions") or {}) == sorted(certificate["functions"])
    )
    examination.agree("/family/certificate", same, "", "It is about another family.")
    leaves, stated = part.get("leaves") or [], certificate["leaves"]
    good = len(leaves) == len(stated)
    examination.agree("/family/leaves", good, "", "The certificate is about other leaves.")
    for k, (leaf, proven) in enumerate(zip(leaves, stated, strict=False)):
        _leaf_of_certificate(examination, f"/family/leaves/{k}", leaf, proven)
    is_whole = not certificate.get("open")
    for key, says, wanted in (
        ("checked", part.get("checked"), "valid"),
        ("covered", part.get("covered"), is_whole),
    ):
        examination.agree(f"/family/{key}", says == wanted, says, f"Its certificate says {wanted}.")
    if is_whole:
        examination.agree("/family/open", not part.get("open"), "", "No member is open.")
    examination.claim("/family/letters", "/family/functions")
    examination.reasons += proof.reasons
    return {
        k
        for k, one in enumerate(stated)
        if k == 0 or any(f" with {checker.condition_text(one)}: " in said for said in proof.reasons)
    }


def _leaf_of_certificate(
    examination: Examination, at: str, leaf: dict[str, Any], proven: dict[str, Any]
) -> None:
    for key, wanted in (
        ("equations", proven["equations"]),
        ("nonzero", proven.get("nonzero") or []),
    ):
        says = [one if isinstance(one, str) else one.get("text") for one in leaf.get(key) or []]
        told = "The certificate says more, or less."
        if examination.agree(f"{at}/{key}", says == wanted, examining.text_of(says), told):
            ends = [""] * len(says) if key == "nonzero" else ["/text"] * len(says)
            examination.claim(*(f"{at}/{key}/{i}{end}" for i, end in enumerate(ends)))
    timed = proven.get("time_dependent")
    for key, verdict in (
        ("verdict", proven.get("autonomous") or timed),
        ("verdict_with_time", timed),
    ):
        examination.agree(
            f"{at}/{key}",
            leaf.get(key) == verdict,
            leaf.get(key),
            f"Its certificate says {verdict}.",
        )


def _leaf_proof(
    examination: Examination,
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
        examination.contradict(
            f"{at}/{name}", "", "It is not about the general member of the leaf."
        )
        return
    examination.claim(f"{at}/{name}/equations")
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
    held, place = {*examination.claimed}, f"{at}/{name}"
    if (
        examination.answer(
            Shown(place, shown, question, str(claim), own, key="verdict", follows=True)
        )
        is None
    ):
        examination.unsettled(f"{place}: no certificate proves it.")
        return
    found = examination.proof(certificate).exceptions
    examination.exceptions(place, shown["exceptions"], found)
    moved = {
        one
        for one in examination.claimed - held
        if one.startswith((f"{place}/lagrangian", f"{place}/hamiltonian"))
    }
    examination.claim(*(one.replace(place, at, 1) for one in moved))
    main_is_timed = leaf.get("verdict_with_time") is None or examining.contains_time(
        own["equations"]
    )
    for key, asks_time in (("verdict", main_is_timed and timed), ("verdict_with_time", True)):
        covers = (
            timed is asks_time
            or (not timed and claim == "variational")
            or (timed and claim != "variational")
        )
        if covers and leaf.get(key) is not None:
            examination.agree(
                f"{at}/{key}", leaf[key] == claim, leaf[key], f"Its certificate proves {claim}."
            )
