"""The verdict of a result as a file that Coq compiles (`coq`), or as identities (`identities`)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from inverse_service import deadline, errors
from inverse_service.decision import certify, deciding
from inverse_service.explanation import hierarchy, negative
from inverse_service.explanation.coq import coq
from inverse_service.explanation.identities import (
    Theorem,
    determinant_vanishes,
    euler_lagrange_hold,
    identities,
)
from inverse_service.field import exact_field
from inverse_service.mechanics import second_order_system
from inverse_service.reading import reader

TERM_LIMIT, TIME_LIMIT = (
    20_000,
    10.0,
)  # terms of one polynomial, and seconds, for all theorems of a verdict


class NoTheorem(Exception):
    """The verdict has no proof of this kind; its text says why."""


def proof_document(result: dict[str, Any], form: str, seed: int) -> str:
    """A file for "coq", or the "identities" as JSON; where there are none, the reason in their
    place.
    """
    theorems, reason = _theorems(result, seed)
    domain = result.get("domain") or []
    if form == "identities":
        found = {"theorems": identities(theorems), "domain": domain, "reason": reason}
        return json.dumps(found, ensure_ascii=False, indent=2) + "\n"
    lines = _about(result) if theorems else [reason]
    return (coq(theorems) if theorems else "") + "".join(f"(* {line} *)\n" for line in lines)


def _about(result: dict[str, Any]) -> list[str]:
    """Which system the theorems are about, and on which set its formulas are those."""
    equations = _certificate(result)["system"]["equations"]
    lines = [f"The system: {name}'' = {text}" for name, text in equations.items()]
    return (
        [*lines, f"The formulas are those on {', '.join(result['domain'])}."]
        if result.get("domain")
        else lines
    )


def _theorems(result: dict[str, Any], seed: int) -> tuple[Sequence[Theorem], str]:
    try:
        return _of_certificate(_certificate(result), seed), ""
    except (NoTheorem, exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError) as problem:
        return (), f"No proof by identities is written: {str(problem).rstrip('.')}."


def _certificate(result: dict[str, Any]) -> dict[str, Any]:
    found = result.get("certificate") or (result.get("with_time") or {}).get("certificate")
    if not isinstance(found, dict):
        raise NoTheorem("the answer has no certificate")
    if "velocities" in found["system"]:
        raise NoTheorem(
            "the claim is about the motion on constraints, not about a single system of equations"
        )
    return found


def _of_certificate(certificate: dict[str, Any], seed: int) -> Sequence[Theorem]:
    given = certificate["system"]
    names = certify.names_of_certificate(given)
    if any(map(reader.has_acceleration, given["equations"].values())):
        raise NoTheorem("the equations are not solved for the accelerations")
    system = second_order_system.read_system(
        names.coordinates, given["equations"], names.parameters, names.functions
    )
    budget = exact_field.Budget(TERM_LIMIT, deadline.now() + TIME_LIMIT)
    if certificate["kind"] == "nonexistence":
        return [_negative(system, seed, budget)]
    if certificate["kind"] == "existence":
        raise NoTheorem(
            "no Lagrangian in closed form was found; its existence follows from involution"
        )
    if certificate.get("integrals"):
        raise NoTheorem("the Lagrangian holds integrals")
    lagrangian = reader.read_formula(certificate["lagrangian"], names)
    return euler_lagrange_hold(deciding.analyze(system).system, lagrangian, budget)


def _negative(
    system: second_order_system.SecondOrderSystem, seed: int, budget: exact_field.Budget
) -> Theorem:
    analysis = deciding.analyze(system)
    chosen = hierarchy.smallest_sufficient_set(analysis, seed)
    if chosen is None:
        raise NoTheorem(
            "the argument differentiates the conditions, so it does not consist of algebraic steps alone"
        )
    if len(system.coordinates) > negative.MOST_COORDINATES:
        raise NoTheorem(f"there are more than {negative.MOST_COORDINATES} coordinates")
    return determinant_vanishes(analysis, chosen, seed, budget)
