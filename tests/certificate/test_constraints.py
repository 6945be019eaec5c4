"""Correct claims about motions on constraints are valid; altered claims are not."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.constrained import existence
from inverse_service.constrained.existence import analyze_motion, decide_motion
from inverse_service.decision.certify import FORMAT
from inverse_service.linear_pde import involution
from inverse_service.statements.questions import PLAIN, TIMED, Question
from tests.certificate.motions import BLADE, SLEIGH, given, heisenberg, knife_edge, motion_of

Document = dict[str, Any]
SLEIGH_DOCUMENT = {
    "coordinates": ["phi", "x", "y"],
    "constraints": BLADE,
    "lagrangian": SLEIGH + "+J*phi'^2/2",
    "parameters": ["a", "J"],
}


def certificate_of(document: Document, question: Question = PLAIN) -> Document:
    analyzed = analyze_motion(motion_of(document))
    found = decide_motion(analyzed, question, 1, float("inf"), lambda _: None)
    return existence.of_finding(analyzed, found, question)


def rows_of(document: Document, question: Question) -> Document:
    """The certificate of a prolonged system, which is used where one solution does not decide."""
    analyzed = analyze_motion(motion_of(document))
    card, limits = existence.ConstrainedAt(analyzed, question), involution.Limits(9, math.inf, 9**6)
    return existence.of_finding(
        analyzed, involution.settle(card, 1, limits, lambda _: None), question
    )


def verdict(certificate: Document) -> str:
    return check_certificate(certificate, seed=1).verdict


def changed(certificate: Document, *path: str | int, to: Any) -> Document:
    other = copy.deepcopy(certificate)
    place: Any = other
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return other


# The knife edge on an inclined plane, x' = s cos(phi), with a quadratic term and no square of the
# constraint.
INCLINED = (
    "phi'^2/2 - x'^2/(2*cos(phi)^2*phi') + x*x'*tan(phi) + G*x'*tan(phi)/(2*phi'^2) - G*x/(2*phi')"
    " - G^2*sin(phi)^2/(8*phi'^3) + (x - x'*tan(phi)/phi' + G*sin(phi)^2/(2*phi'^2))*(y' - tan(phi)*x')"
)
INCLINED_SYSTEM = {
    "coordinates": ["phi", "x", "y"],
    "equations": {"phi": "0", "x": "-tan(phi)*phi'*x' + G*cos(phi)^2"},
    "velocities": {"y": "tan(phi)*x'"},
    "parameters": ["G"],
}
LAGRANGIAN = {
    "format": FORMAT, "system": INCLINED_SYSTEM, "question": "autonomous", "claim": "variational", "kind": "lagrangian",
    "lagrangian": INCLINED,
}  # fmt: skip


def test_the_lagrangian_of_the_inclined_knife_edge_is_one() -> None:
    assert verdict(LAGRANGIAN) == "valid"


@pytest.mark.parametrize(
    "more", [" + x", " + x^3*(y' - tan(phi)*x')", " + phi'^2*x'", " + y'", " - phi'^2/2 + x^2"]
)
def test_other_terms_make_it_none_unless_they_vanish_on_the_constraints(more: str) -> None:
    expected = "valid" if more == " + y'" else "invalid"
    assert verdict(LAGRANGIAN | {"lagrangian": INCLINED + more}) == expected


@pytest.mark.parametrize("square", ["(y' - tan(phi)*x')^2", "x^3*(y' - tan(phi)*x')^2/7"])
def test_squares_of_constraints_change_nothing_on_the_constraints(square: str) -> None:
    assert verdict(LAGRANGIAN | {"lagrangian": f"{INCLINED} + {square}"}) == "valid"


def test_a_lagrangian_that_is_singular_on_the_constraints_is_refused() -> None:
    assert verdict(LAGRANGIAN | {"lagrangian": "y'"}) == "invalid"


@pytest.mark.parametrize(
    "system",
    [
        INCLINED_SYSTEM | {"velocities": {}},
        INCLINED_SYSTEM | {"velocities": {"y": 3}},
        INCLINED_SYSTEM | {"velocities": {"y": "tan(phi)*y'"}},
        INCLINED_SYSTEM | {"velocities": {"y": "tan(phi)*x'", "x": "1"}},
        INCLINED_SYSTEM | {"coordinates": ["y", "phi", "x"]},
        INCLINED_SYSTEM | {"equations": {"phi": "0", "x": "y'"}},
        INCLINED_SYSTEM | {"equations": {}},
    ],
)
def test_systems_that_do_not_fit_together_are_refused(system: Document) -> None:
    assert verdict(LAGRANGIAN | {"system": system}) == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize("question", [PLAIN, TIMED])
def test_rows_prove_that_the_chaplygin_sleigh_has_none(question: Question) -> None:
    proof = rows_of(SLEIGH_DOCUMENT, question)
    assert verdict(proof) == "valid"
    assert verdict(changed(proof, "rows", to=proof["rows"][:-1])) == "invalid"
    assert verdict(changed(proof, "rows", to=[*proof["rows"], proof["rows"][0]])) == "invalid"
    assert verdict(changed(proof, "system", "parameters", to=["a"])) == "invalid"


def test_rows_of_one_motion_prove_nothing_of_another() -> None:
    proof = rows_of(SLEIGH_DOCUMENT, PLAIN)
    other = existence.certificate_of_lagrangian(
        analyze_motion(motion_of(knife_edge("0"))),
        motion_of(knife_edge("0")).free_accelerations[0],
        PLAIN,
    )
    assert verdict(proof | {"system": other["system"], "near": {}}) == "invalid"


def test_existence_is_proven_by_an_involutive_system() -> None:
    proof = certificate_of(heisenberg("0"))
    assert proof["kind"] == "existence"
    assert verdict(proof) == "valid"
    assert verdict(changed(proof, "dimensions", 1, to=proof["dimensions"][1] + 1)) == "invalid"
    assert (
        verdict(changed(proof, "symbol", "prolonged", to=proof["symbol"]["prolonged"] + 1))
        == "invalid"
    )
    assert verdict(changed(proof, "degree", to=0)) == "invalid"


def test_without_dependent_coordinates_it_is_the_inverse_problem() -> None:
    """The claim without dependent velocities: a system without a Lagrangian has none here
    either.
    """
    analyzed = analyze_motion(given({"x": "x*y'", "y": "y*x'^2"}, {}))
    found = decide_motion(analyzed, PLAIN, 1, float("inf"), lambda _: None)
    proof = existence.of_finding(analyzed, found, PLAIN)
    assert proof["kind"] == "nonexistence"
    assert verdict(proof) == "valid"
