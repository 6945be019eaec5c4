"""False claims about Lagrangians of a kind: none is valid; beside them stand true ones that are."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import check_result

Document = dict[str, Any]
FORMAT, GENERAL = "inverse-service/certificate/2", "rayleigh_general"


def claim(kind: object, lagrangian: str = "", /, *forces: str, **more: object) -> Document:
    names = ["x", "y", "z"][: len(forces)]
    system = {"coordinates": names, "equations": dict(zip(names, forces, strict=True)), "parameters": ["a"]}
    head = {"format": FORMAT, "system": system, "question": "autonomous", "claim": "variational", "among": kind}
    return head | ({"kind": "lagrangian", "lagrangian": lagrangian} if lagrangian else {}) | more


def rows_of(kinds: dict[str, int], variables: int, order: int) -> list[Any]:
    """All rows of two coordinates, by the order of each condition."""
    found = []
    for kind, (i, j) in product(kinds, ((0, 0), (0, 1), (1, 1))):
        if ((kind[:1] in "CD" or kind == "H3") and i == j) or (kind[0] == "S" and i < j):
            continue
        least = order - kinds[kind]
        alphas = (list(a) for a in product(range(least + 1), repeat=variables) if sum(a) <= least)
        found += [[kind, i, j, alpha] for alpha in alphas]
    return found


NATURAL = {"H2": 1, "H3": 0, "K0": 1, "K1": 1}
HOMOGENEOUS = NATURAL | {"K2": 1, "S2": 0}
FINSLER = {"H2": 1, "H3": 0, "K0": 1, "S0": 0}
RAYLEIGH = NATURAL | {"S0": 0, "C0": 1, "C1": 1}
ANY_DRAG = {"C0": 1, "C1": 1}


def no(kind: object, rows: list[Any], /, *forces: str, **more: object) -> Document:
    more = {"claim": "not_variational", "kind": "nonexistence", "order": 2, "rows": rows} | more
    return claim(kind, "", *forces, **more)


TURN: Document = {"invariant": [{"x": "-y", "y": "x"}]}
SHIFT: Document = {"invariant": [{"x": "1"}]}
POTENTIAL = "x^3/3 + y^3/3 + x^2*y^2 + x*y"
DRIVEN = ("-(x^2 + 2*x*y^2 + y)", "-(y^2 + 2*x^2*y + x)/(1 + t)")
DATA = {"kind": "existence", "order": 1, "degree": 1, "dimensions": [3, 3],
        "symbol": {"dimension": 0, "prolonged": 0, "characters": []}}  # fmt: skip

TRUE = {
    "natural": claim("natural", "x'^2/2 - x^2/2", "-x"),
    "no natural": no("natural", rows_of(NATURAL, 4, 2), "x'*y'", "y'^2"),
    "riemannian": claim("riemannian", "x'^2/2 + x^2*y'^2/2", "x*y'^2", "-2*x'*y'/x"),
    "finsler": claim("finsler", "x'^4/y'^2", "0", "0"),
    "invariant": claim(TURN, "x'^2 + y'^2 - x^2 - y^2", "-x", "-y"),
    "no invariant": no(SHIFT, rows_of(FINSLER, 4, 2), "x", "-x*y"),
    "rayleigh": claim("rayleigh", "x'^2/2 - x^2/2", "-x - a*x'", dissipation="-a*x'^2/2"),
    "rayleigh with time": claim(
        "rayleigh", f"x'^2/2 + (1 + t)*y'^2/2 - ({POTENTIAL})", *DRIVEN,
        dissipation="y'^2/2", question="time_dependent",
    ),
    "any friction": claim(GENERAL, "x'^2/2", "-x - x'^3", dissipation="-x*x' - x'^4/4"),
    "any friction with time": claim(
        GENERAL, "x'^2/2 + exp(t)*y'^2/2", "-t*x'^3", "-y'", dissipation="-t*x'^4/4", question="time_dependent"
    ),
    "no riemannian": no("riemannian", [["S2", i, i, [0] * 4] for i in (0, 1)], "x'^3/y'", "x"),
    "no rayleigh": no("rayleigh", [["S0", 0, 0, [0, 0]]], "-x - x'^3"),
    "no rayleigh with time": no("rayleigh", [["S0", 0, 0, [0, 0, 0]]], "-t*x'^3", question="time_dependent"),
}  # fmt: skip

FALSE = {
    "natural with a metric of velocities": claim("natural", "x'^4/12", "0"),
    "natural with a little of it": claim("natural", "x'^2/2 + 1e-200*x'^3", "0"),
    "natural with a metric of velocities far away": claim("natural", "x'^2/2 + exp(-x'^2)", "0", near={"x'": "50"}),
    "natural with friction": claim("natural", "x'^2/2 - x^2/2", "-x - x'", dissipation="-x'^2/2"),
    "natural with t in the metric": claim("natural", "exp(t)*(x'^2 - x^2)/2", "-x - x'"),
    "natural but singular": claim("natural", "x'^2/2 + y'*x", "0", "0"),
    "natural, of another force": claim("natural", "x'^2/2 - x^2/2", "-2*x"),
    "riemannian with a potential": claim("riemannian", "x'^2/2 - x^2/2", "-x"),
    "riemannian with a constant": claim("riemannian", "x'^2/2 + 1", "0"),
    "riemannian with a gyroscope": claim("riemannian", "x'^2/2 + y'^2/2 + x*y'", "y'", "-x'"),
    "riemannian with t": claim("riemannian", "x'^2/2", "0", question="time_dependent"),
    "riemannian that is finsler": claim("riemannian", "x'^4/y'^2", "0", "0"),
    "finsler of another degree": claim("finsler", "x'^4 + y'^4", "0", "0"),
    "finsler with a potential": claim("finsler", "x'^2/2 - x^2/2", "-x"),
    "finsler with t": claim("finsler", "x'^2/2", "0", question="time_dependent"),
    "invariant up to a derivative": claim(SHIFT, "x'^2/2 + x", "1"),
    "invariant at one point": claim(TURN, "x'^2 + y'^2 - x^2 - 2*y^2", "-x", "-2*y", near={"x": "0", "y": "0"}),
    "invariant under another field": claim({"invariant": [{"x": "y"}]}, "x'^2 + y'^2 - x^2 - y^2", "-x", "-y"),
    "invariant under one field of two": claim(
        {"invariant": [{"x": "-y", "y": "x"}, {"x": "1"}]}, "x'^2 + y'^2 - x^2 - y^2", "-x", "-y"
    ),
    "invariant under no field": claim({"invariant": []}, "x'^2/2", "0"),
    "invariant under an empty field": claim({"invariant": [{}]}, "x'^2/2", "0"),
    "a field of velocities": claim({"invariant": [{"x": "x'"}]}, "x'^2/2", "0"),
    "a field of time": claim({"invariant": [{"x": "t"}]}, "x'^2/2", "0", question="time_dependent"),
    "an irrational field": claim({"invariant": [{"x": "exp(1)"}]}, "x'^2/2", "0"),
    "a field along no coordinate": claim({"invariant": [{"w": "1"}]}, "x'^2/2", "0"),
    "a field with a pole at the point": claim({"invariant": [{"x": "0/x"}]}, "x'^2/2 + 0*exp(x)", "0", near={"x": "0"}),
    "two kinds in one": claim({"natural": 1} | SHIFT, "x'^4/12", "0"),
    "no kind": claim("spherical", "x'^2/2", "0"),
    "a list of kinds": claim(["natural"], "x'^2/2", "0"),
    "linear friction": claim("rayleigh", "x'^2/2", "a", dissipation="a*x'"),
    "cubic friction": claim("rayleigh", "x'^2/2", "-x'^2", dissipation="-x'^3/3"),
    "friction with a potential": claim("rayleigh", "x'^2/2", "-x'", dissipation="-x'^2/2 + x"),
    "friction of degree 2 that is no polynomial": claim(
        "rayleigh", "x'^2/2 + y'^2/2", "3*x'^2/y'", "-x'^3/y'^2", dissipation="x'^3/y'"
    ),
    "friction of the other sign": claim("rayleigh", "x'^2/2", "-x'", dissipation="x'^2/2"),
    "friction with t": claim("rayleigh", "x'^2/2", "-x'", dissipation="-x'^2/2 + 0*t"),
    "friction on both sides": claim("rayleigh", "x'^4/12", "0", dissipation="0"),
    "friction without D": claim("rayleigh", "x'^2/2 - x^2/2", "-x"),
    "friction of a singular L": claim("rayleigh", "x", "0", dissipation="x'^2/2"),
    "any friction, of another force": claim(GENERAL, "x'^2/2", "-x - x'^3", dissipation="-x*x' - x'^4/3"),
    "any friction without D": claim(GENERAL, "x'^2/2", "-x - x'^3"),
    "any friction of a singular L": claim(GENERAL, "x", "-x'^3", dissipation="-x'"),
    "any friction with t": claim(GENERAL, "x'^2/2", "-x'^3", dissipation="-x'^4/4 + 0*t"),
    "any friction that is no gradient": claim(GENERAL, "x'^2/2 + y'^2/2", "y'", "-x'", dissipation="x'*y'"),
    "friction by an integral": claim(
        "rayleigh", "x'^2/2", "-x'", dissipation="-x'^2/2*F(x)",
        integrals={"F": {"arguments": ["x"], "derivatives": {"x": "0"}}},
    ),
    "no natural one where there is": no("natural", rows_of(NATURAL, 4, 2), "-x", "-2*y"),
    "no riemannian one where there is": no("riemannian", rows_of(HOMOGENEOUS, 4, 2), "x*y'^2", "-2*x'*y'/x"),
    "no finsler one where there is": no("finsler", rows_of(FINSLER, 4, 2), "0", "0"),
    "no invariant one where there is": no(TURN, rows_of(FINSLER, 4, 2), "-x", "-y"),
    "none for a quadratic force": no("rayleigh", [["S0", 0, 0, [0, 0]]], "-x'^2"),
    "none with friction where there is": no("rayleigh", rows_of(RAYLEIGH, 4, 2), "-x - x'", "-2*y - 2*y'"),
    "none with friction and time where there is": no(
        "rayleigh", rows_of(ANY_DRAG | {"K0": 1, "K1": 1, "S0": 0}, 5, 2), *DRIVEN, question="time_dependent"
    ),
    "none with friction and time by rows without": no(
        "rayleigh", rows_of(NATURAL, 5, 2), *DRIVEN, question="time_dependent"
    ),
    "none with any friction for two coordinates": no(GENERAL, rows_of(ANY_DRAG, 4, 2), "x'*y'^2 - x", "x^2*x'^3"),
    "none with any friction for one": no(GENERAL, [], "x'^2 - x"),
    "none with any friction by a row of one": no(GENERAL, [["C0", 0, 0, [0, 0]]], "x'^2 - x"),
    "none with any friction by rows of H": no(GENERAL, rows_of(NATURAL, 4, 2), "x^2 + y^2", "-y'"),
    "none with any friction by rows of D off their places": no(GENERAL, [["D1", 0, 1, [0] * 4]], "x^2 + y^2", "-y'"),
    "no natural one near a special place": no(
        "natural", rows_of(NATURAL, 4, 2), "-x + exp(-x^2)*y'", "-2*y - exp(-x^2)*x'", near={"x": "30"}
    ),
    "rows of a kind that is not asked about": no("finsler", [["K1", 0, 0, [0] * 4]], "x'*y'", "y'^2"),
    "rows of symmetry for a natural one": no("natural", [["S0", 0, 0, [0] * 4]], "x'*y'", "y'^2"),
    "rows of symmetry off the diagonal": no("finsler", [["S0", 0, 1, [0] * 4]], "x'*y'", "y'^2"),
    "rows of a motion": no("natural", [["free", 0, 0, [0] * 4]], "x'*y'", "y'^2"),
    "existence of a natural one by invented numbers": claim("natural", "", "x'*y'", "y'^2", **DATA),
    "existence of a natural one with time by the rows of its kind alone": claim(
        "natural", "", "x'^3", kind="existence", question="time_dependent", order=1, degree=1, dimensions=[1, 3],
        symbol={"dimension": 2, "prolonged": 3, "characters": [1, 1]},
    ),
    "existence of one with friction": claim("rayleigh", "", "-x", "-y", **DATA),
    "existence of one with any friction": claim(GENERAL, "", "-x", "-y", **DATA),
    "existence of one with friction that is rational and not quadratic": claim(
        "rayleigh", "", "3*x'^2/y'", "-x'^3/y'^2", kind="existence", order=2, degree=1, dimensions=[1, 1],
        symbol={"dimension": 0, "prolonged": 0, "characters": []},
    ),
    "existence of one with friction and time": claim("rayleigh", "", *DRIVEN, question="time_dependent", **DATA),
    "existence of an invariant one": claim(SHIFT, "", "0", "0", **DATA),
    "a huge power": claim("natural", "x'^2/2 - (x*y + 1)^99999999", "-x", "-y"),
}  # fmt: skip

PLACE = {"t": "1", "a": "1", "x": "1", "y": "1", "x'": "1", "y'": "1"}
CYCLE: Any = [["H3", 0, 1, [0, 0, 0, 0]]]  # of g Phi = Phi^T g at the point


def definite(lagrangian: str, /, *forces: str, **more: object) -> Document:
    return claim("positive_definite", lagrangian, *forces, **{"near": PLACE, **more})


def none_definite(orthogonal: Any, /, *forces: str, **more: object) -> Document:
    return (
        definite("", *forces, claim="not_variational", kind="nonexistence", order=1, rows=CYCLE, orthogonal=orthogonal)
        | more
    )


ROUND, MIXED = [[1, 0], [0, 1]], [["1", "-1/2"], ["-1/2", "1"]]
# x'' = x y, y'' = -x^2/2 leaves g with x (g_11 + g_22) = y g_12.
BENT = ("x*y", "-x^2/2")
TRUE |= {
    "definite": definite("x'^2/2 + y'^2/2 - x^2/2", "-x", "0"),
    "negative definite": definite("-x'^2/2 - y'^2/2 + x^2/2", "-x", "0"),
    "definite there": definite("x'^3 + y'^3", "0", "0"),
    "none definite": none_definite(ROUND, "-y", "x"),
    "none definite there": none_definite(MIXED, *BENT),
}
FALSE |= {
    "an indefinite L": definite("x'^2/2 - y'^2/2 - x^2/2", "-x", "0"),
    "an L that is hardly indefinite": definite(f"x'^2/2 - y'^2/2/10^{60}", "0", "0"),
    "an L that is definite elsewhere": definite("x'^3 + y'^3", "0", "0", near=PLACE | {"y'": "-1"}),
    "an L that is definite on one side": definite("x'^3 + y'^3", "0", "0", near=PLACE | {"y'": f"-1e-{30}"}),
    "an L that is singular there": definite("x'^3 + y'^3", "0", "0", near=PLACE | {"x'": "0"}),
    "an L that is singular": definite("(x' + y')^2/2", "0", "0"),
    "a definite L of another system": definite("x'^2/2 + y'^2/2", "-x", "0"),
    "a definite L beyond its pole": definite(
        "x'^2/2 + y'^2/(2*x)", "y'^2/(2*x^2)*(-1)", "x'*y'/x", near=PLACE | {"x": "-1"}
    ),
    "a definite L at no place": definite("x'^2/2 + y'^2/2", "0", "0", near=None),
    "a definite L at a place that lacks a velocity": definite(
        "x'^3 + y'^3", "0", "0", near={k: v for k, v in PLACE.items() if k != "y'"}
    ),
    "a definite L at a place that lacks t": definite(
        "exp(t)*(x'^2 + y'^2)/2",
        "-x'",
        "-y'",
        question="time_dependent",
        near={k: v for k, v in PLACE.items() if k != "t"},
    ),
    "none definite where there is": none_definite(ROUND, "-x", "-2*y"),
    "none definite by an indefinite matrix": none_definite([[1, 0], [0, -1]], "y", "x"),
    "none definite by a matrix that no row gives": none_definite([[1, 0], [0, 2]], "-y", "x"),
    "none definite by zero": none_definite([[0, 0], [0, 0]], "-y", "x"),
    "none definite by a matrix that is not symmetric": none_definite([[1, 1], [0, 1]], "-y", "x"),
    "none definite by no rows": none_definite(ROUND, "-y", "x", rows=[]),
    "none definite by the matrix of another place": none_definite(MIXED, *BENT, near=PLACE | {"x": "-1"}),
    "none definite where the rows vanish": none_definite(MIXED, *BENT, near=PLACE | {"x": "0", "y": "0"}),
    "none definite near where the rows vanish": none_definite(MIXED, *BENT, near=PLACE | {"x": f"1e-{40}"}),
    "none definite beside the place": none_definite(MIXED, *BENT, near=PLACE | {"x": f"1.{'0' * 90}1"}),
    "none definite where f is not rational": none_definite(ROUND, "-y*exp(0)", "x"),
    "a definite matrix where none is left": definite("", "-y", "x", **DATA, multiplier=ROUND),
    "an indefinite matrix": definite("", "y", "x", **DATA, multiplier=[[1, 0], [0, -1]]),
    "a definite matrix by invented numbers": definite("", "x'*y'", "y'^2", **DATA, multiplier=ROUND),
}


@pytest.mark.parametrize("name", TRUE)
def test_true_claims_are_valid(name: str) -> None:
    found = check_certificate(TRUE[name], seed=1)
    assert found.verdict == "valid", found.reasons


@pytest.mark.slow
@pytest.mark.parametrize("name", FALSE)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_false_claim_about_a_kind_is_not_valid(name: str, seed: int) -> None:
    found = check_certificate(FALSE[name], seed=seed)
    assert found.verdict != "valid", found.reasons


def result_with(**parts: object) -> Document:
    proof = {key: part for key, part in claim(None, "x'^2/2 + y'^2/2", "0", "0").items() if key != "among"}
    return {
        "format": "inverse-service/result/1", "system": proof["system"], "verdict": "variational",
        "verdict_with_time": "variational", "certificate": proof, "lagrangian": {"text": "x'^2/2 + y'^2/2"}, **parts,
    }  # fmt: skip


FLAT = claim("riemannian", "x'^2/2 + y'^2/2", "0", "0")
NOT_SHIFTED = no(SHIFT, rows_of(FINSLER, 4, 2), "x", "-x*y")
SHOWN = {"verdict": "variational", "certificate": FLAT, "lagrangian": {"text": FLAT["lagrangian"]}}


def test_a_true_answer_about_a_kind_is_valid() -> None:
    assert check_result(result_with(kinds={"riemannian": SHOWN}), seed=1).verdict == "valid"


@pytest.mark.parametrize(
    ("kind", "part"),
    [
        ("natural", SHOWN),
        ("riemannian", SHOWN | {"verdict": "not_variational"}),
        ("riemannian", SHOWN | {"verdict": "undetermined"}),
        ("riemannian", SHOWN | {"certificate": None}),
        ("riemannian", SHOWN | {"lagrangian": {"text": "x'^2/2 - y'^2/2"}}),
        ("riemannian", SHOWN | {"dissipation": {"text": "x'^2"}}),
        ("riemannian", SHOWN | {"certificate": {**FLAT, "among": None}}),
        ("natural", SHOWN | {"certificate": FLAT | {"among": {"natural": 1} | SHIFT}}),
        ("natural", {"verdict": "not_variational", "certificate": NOT_SHIFTED | {"among": {"natural": 1} | SHIFT}}),
        ("invariant", {"verdict": "not_variational", "certificate": NOT_SHIFTED}),
    ],
)
def test_what_is_said_of_a_kind_is_what_its_certificate_proves(kind: str, part: Document) -> None:
    assert check_result(result_with(kinds={kind: part}), seed=1).verdict != "valid"


def test_a_claim_about_a_kind_proves_no_main_verdict() -> None:
    assert check_result(result_with(certificate=FLAT), seed=1).verdict != "valid"
