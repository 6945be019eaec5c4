"""A result in short, as the atlas keeps it: all that is stated, without what solving its document
again makes.

Left out are proofs (certificates but for their heads, explanations), tensors, multipliers, first
integrals, and the document, which stands beside it.
"""

from collections.abc import Mapping
from typing import Any

from inverse_service.service.documents import stated

_LEFT_OUT = frozenset((
    "answers", "given", "explanation", "details", "steps", "multiplier", "solution_space", "advice",
    "first_integrals",
    "first_integrals_complete", "special_cases", "equations_of_motion", "integrable", "measure_density", "paper_class",
    "hamiltonisation", "parts", "statement", "without_clock", "ignored", "readings",
))  # fmt: skip
# Of the document, and what is as large as its proof.
_OF_DOCUMENT = ("id", "document_id", "metadata", "conditions", "family", "nearest")
_CERTIFICATES = ("certificate", "certificate_with_time")
_PROOFS = ("proof", "proof_without_time")
_HEAD = ("format", "question", "claim", "kind", "among", "near")
_POINTERS = ("certificate", "explanation")
# What printers and programs find in each formula, verdict, and answer, even if it is empty.
_ALWAYS = frozenset((
    "lagrangian", "hamiltonian", "verdict", "domain", "constraints", "momenta", "image", "auxiliary", "reason",
))  # fmt: skip


def shortened(result: Mapping[str, Any]) -> dict[str, Any]:
    """The result in short, for a file."""
    version = {"version": result["provenance"]["version"]}
    kept = {key: value for key, value in result.items() if key not in _OF_DOCUMENT}
    short: dict[str, Any] = _short("", kept)
    if result.get("family"):
        short["family"] = _short_family(result["family"])
    return short | {"provenance": version}


def _short_family(family: Mapping[str, Any]) -> dict[str, Any]:
    """The sets of a family without their proofs."""
    leaves = [
        {name: one for name, one in leaf.items() if name not in _PROOFS}
        for leaf in family["leaves"]
    ]
    return {**family, "certificate": None, "leaves": leaves}


def _short(key: str, value: Any) -> Any:
    if key in _CERTIFICATES and isinstance(value, dict):
        return {name: value[name] for name in _HEAD if name in value}
    if key == "system" and value:
        return {name: one for name, one in value.items() if name != "given"}
    if isinstance(value, list):
        return [_short("", one) for one in value]
    if isinstance(value, dict):
        kept = {name: _short(name, one) for name, one in value.items() if name not in _LEFT_OUT}
        return {
            name: one
            for name, one in kept.items()
            if name in _ALWAYS or one not in (None, "", [], {})
        }
    return value


def unfolded(short: Mapping[str, Any], document: Mapping[str, Any]) -> dict[str, Any]:
    """A short result with its document, as printers read it."""
    system = short.get("system")
    return {**short, "system": system and {**system, "given": dict(document)}}


def for_programs(short: Mapping[str, Any]) -> dict[str, Any]:
    """A short result as a client gets it: the system and the answers, which say without proof what
    was proven.
    """
    answers = [
        {key: value for key, value in one.items() if key not in _POINTERS}
        for one in stated.answers_of(short)
    ]
    kept = (
        "format",
        "system",
        "question",
        "verdict",
        "verdict_with_time",
        "not_answered",
        "family",
        "provenance",
    )
    return {key: short[key] for key in kept if key in short} | {"answers": answers}
