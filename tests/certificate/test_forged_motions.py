"""False claims about motions on constraints: none is valid; beside each stands a true one that is."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import check_result

Document = dict[str, Any]
FORMAT = "inverse-service/certificate/2"


def motion(equations: dict[str, str], velocities: object, **more: object) -> Document:
    dependent = list(velocities) if isinstance(velocities, dict) else []
    return {"coordinates": [*equations, *dependent], "equations": equations, "velocities": velocities, **more}


def claim(system: Document, lagrangian: str = "", **more: object) -> Document:
    head = {"format": FORMAT, "system": system, "question": "autonomous", "claim": "variational"}
    return head | ({"kind": "lagrangian", "lagrangian": lagrangian} if lagrangian else {}) | more


def no(system: Document, order: int, rows: list[Any], **more: object) -> Document:
    more = {"claim": "not_variational", "kind": "nonexistence", "order": order, "rows": rows} | more
    return claim(system, **more)


def every_row(free: int, dependent: int, variables: int, order: int) -> list[Any]:
    alphas = [list(a) for a in product(range(order), repeat=variables) if sum(a) < order]
    places = [*(("free", i) for i in range(free)), *(("dependent", a) for a in range(dependent))]
    return [[kind, i, alpha] for kind, i in places for alpha in alphas]


# The knife edge phi'' = 0, x'' = -tan(phi) phi' x' with y' = tan(phi) x', and one of its Lagrangians.
BLADE = motion({"phi": "0", "x": "-tan(phi)*phi'*x'"}, {"y": "tan(phi)*x'"})
ON_BLADE = "phi'^2/2 - x'^2/(2*cos(phi)^2*phi') + x*x'*tan(phi)"
L_BLADE = ON_BLADE + " + (x - x'*tan(phi)/phi')*(y' - tan(phi)*x')"
HEISENBERG = motion({"x": "-y*x'*y'/(1 + y^2)", "y": "0"}, {"z": "y*x'"})
SLEIGH = motion({"phi": "-x'*phi'", "x": "phi'^2"}, {"y": "0"})
PARABOLA = motion({"x": "0"}, {"y": "x'^2"})
FREE = motion({"x": "0", "y": "0"}, {"z": "0"})
ALL_FREE = every_row(2, 1, 5, 2)
DATA = {"kind": "existence", "order": 1, "degree": 1, "dimensions": [3, 10],
        "symbol": {"dimension": 7, "prolonged": 12, "characters": [3, 3, 1]}}  # fmt: skip

TRUE = {
    "the knife edge": claim(BLADE, L_BLADE),
    "a curved constraint": claim(PARABOLA, "x'^2/2 + (y' - x'^2)^2/2"),
    "free particles on a plane": claim(FREE, "x'^2/2 + y'^2/2 + z'^2/2"),
    "time in the constraint": claim(
        motion({"x": "0"}, {"y": "t"}), "x'^2/2 + (y' - t)^2/2", question="time_dependent"
    ),
    "a root on its branch": claim(
        motion({"x": "0"}, {"y": "sqrt(x^2)*x'"}), "x'^2/2 + (y' + x*x')^2/2",
        near={"x": "-2"}, roots=[{"root": "sqrt(x^2)", "is": "-x"}],
    ),
}  # fmt: skip

FALSE = {
    "a Hessian that is regular on a chart only": claim(PARABOLA, "y' + (y' - x'^2)^2/2"),
    "another constraint": claim(BLADE | {"velocities": {"y": "2*tan(phi)*x'"}}, L_BLADE),
    "another force": claim(BLADE | {"equations": {"phi": "0", "x": "tan(phi)*phi'*x'"}}, L_BLADE),
    "a force that is almost zero": claim(BLADE | {"equations": {"phi": "1e-90", "x": "-tan(phi)*phi'*x'"}}, L_BLADE),
    "a term that is almost zero": claim(BLADE, L_BLADE + " + 1e-99*x^2"),
    "a wrong L times what is small far away": claim(FREE, "exp(-x^2)*(x'^2 + y'^2 + z'^2)", near={"x": "30"}),
    "a rational motion in disguise": claim(
        FREE | {"equations": {"x": "0*exp(1) + y", "y": "0"}}, "x'^2/2 + y'^2/2 + z'^2/2", near={"y": "1e-90"}
    ),
    "a singular L": claim(BLADE, "x*(y' - tan(phi)*x')"),
    "a total derivative": claim(FREE, "x*x' + y'*z + z'*y"),
    "L on the constraints alone": claim(HEISENBERG, "x'^2/2 + y'^2/2 + (z' - y*x')^2/2"),
    "L of the leaves": claim(FREE | {"velocities": {"z": "x*y'"}}, "x'^2 + y'^2 + z'^2"),
    "L with t for the question without": claim(motion({"x": "0"}, {"y": "0"}), "x'^2/2 + t*y'*x' + y'^2"),
    "a constraint with t for the question without": claim(motion({"x": "0"}, {"y": "t"}), "x'^2/2 + (y' - t)^2/2"),
    "a root on the other branch": claim(
        motion({"x": "0"}, {"y": "sqrt(x^2)*x'"}), "x'^2/2 + (y' - x*x')^2/2",
        near={"x": "-2"}, roots=[{"root": "sqrt(x^2)", "is": "x"}],
    ),
    "a root that is not what it is said to be": claim(
        motion({"x": "0"}, {"y": "sqrt(x^2)*x'"}), "x'^2/2 + (y' - 2*x*x')^2/2",
        near={"x": "2"}, roots=[{"root": "sqrt(x^2)", "is": "2*x"}],
    ),
    "one arbitrary function for another": claim(
        motion({"x": "0"}, {"y": "A(x)*x'"}, functions={"A": ["x"]}), "x'^2/2 + (y' - x*x')^2/2 + A(x)^2"
    ),
    "a constraint that blows up at the point": claim(
        motion({"x": "0"}, {"y": "x'*exp(1/x)"}), "x'^2/2 + (y' - x'*exp(1/x))^2/2", near={"x": "0"}
    ),
    "a huge power": claim(FREE, "x'^2 + y'^2 + z'^2 + (x*y*z + 1)^99999999"),
    "functions by their derivatives": claim(FREE, "F(t)*x'^2", integrals={"F": {"arguments": ["t"]}}),
    "a name of the dependent velocity in the force": claim(motion({"x": "y'"}, {"y": "x'"}), "x'^2 + y'^2"),
    "dependent coordinates first": claim(FREE | {"coordinates": ["z", "x", "y"]}, "x'^2 + y'^2 + z'^2"),
    "a coordinate without an equation": claim(FREE | {"equations": {"x": "0"}}, "x'^2 + y'^2 + z'^2"),
    "velocities that are none": claim(FREE | {"velocities": ["z"]}, "x'^2 + y'^2 + z'^2"),
    "a kind of Lagrangians": claim(FREE, "x'^2 + y'^2 + z'^2", among="natural"),
    "no L where there is one": no(FREE, 2, ALL_FREE),
    "no L near a special place": no(
        motion({"x": "exp(-x^2)*y'", "y": "-exp(-x^2)*x'"}, {"z": "0"}), 2, ALL_FREE, near={"x": "30"}
    ),
    "no L on a curved constraint": no(PARABOLA, 3, every_row(1, 1, 3, 3)),
    "no L with time": no(FREE, 2, every_row(2, 1, 6, 2), question="time_dependent"),
    "no rows": no(SLEIGH, 1, []),
    "a row twice": no(SLEIGH, 1, every_row(2, 1, 5, 1) * 2),
    "a row of no equation": no(SLEIGH, 1, [["dependent", 1, [0] * 5]]),
    "rows of the inverse problem": no(SLEIGH, 1, [["H3", 0, 1, [0] * 5]]),
    "a row beyond the order": no(SLEIGH, 1, [["free", 0, [1, 0, 0, 0, 0]]]),
    "a yes by rows": no(SLEIGH, 2, every_row(2, 1, 5, 2)) | {"claim": "variational"},
    "existence by invented numbers": claim(SLEIGH, **DATA),
    "existence of degree 0": claim(FREE, **DATA | {"degree": 0, "dimensions": [3]}),
    "existence at a place where all is small": claim(
        motion({"x": "exp(-x^2)*y'", "y": "-2*exp(-x^2)*y*x'"}, {"z": "x*y'*exp(-x^2)"}), **DATA, near={"x": "1e9"}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TRUE)
def test_true_claims_are_valid(name: str) -> None:
    found = check_certificate(TRUE[name], seed=1)
    assert found.verdict == "valid", found.reasons


@pytest.mark.parametrize("name", FALSE)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_false_claim_about_a_motion_is_not_valid(name: str, seed: int) -> None:
    found = check_certificate(FALSE[name], seed=seed)
    assert found.verdict != "valid", found.reasons


YES = {"x'' = 0": claim({"coordinates": ["x"], "equations": {"x": "0"}}, "x'^2/2")}["x'' = 0"]
MAIN = {
    "format": "inverse-service/result/1", "system": YES["system"], "verdict": "variational", "certificate": YES,
    "verdict_with_time": "variational", "lagrangian": {"text": "x'^2/2"},
}  # fmt: skip
SHOWN = {"verdict": "variational", "verdict_with_time": "variational", "certificate": TRUE["the knife edge"],
         "lagrangian": {"text": L_BLADE}}  # fmt: skip
LATER = TRUE["time in the constraint"]
AT_SOME_TIME = claim(FREE, "x'^2 + y'^2 + z'^2", question="time_dependent")


def test_a_true_answer_about_a_motion_is_valid() -> None:
    assert check_result(MAIN | {"any_associated": SHOWN}, seed=1).verdict == "valid"


@pytest.mark.parametrize(
    "part",
    [
        SHOWN | {"verdict": "not_variational"},
        SHOWN | {"verdict_with_time": "not_variational"},
        SHOWN | {"certificate": None},
        SHOWN | {"certificate": YES, "lagrangian": {"text": "x'^2/2"}},
        SHOWN | {"lagrangian": {"text": L_BLADE + " + x^2"}},
        SHOWN | {"lagrangian": {"text": 3}},
        SHOWN | {"certificate": AT_SOME_TIME, "verdict_with_time": "undetermined", "lagrangian": None},
        SHOWN | {"certificate": LATER | {"question": "autonomous"}, "lagrangian": None},
    ],
)
def test_what_is_said_of_a_motion_is_what_its_certificate_proves(part: Document) -> None:
    assert check_result(MAIN | {"any_associated": part}, seed=1).verdict != "valid"


def test_a_claim_about_a_motion_proves_no_main_verdict() -> None:
    proof = TRUE["the knife edge"]
    whole = MAIN | {"system": proof["system"], "certificate": proof, "lagrangian": {"text": L_BLADE}}
    assert check_result(whole, seed=1).verdict != "valid"
    assert check_result(MAIN | {"certificate": proof}, seed=1).verdict != "valid"
