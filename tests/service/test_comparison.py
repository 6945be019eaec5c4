"""A certificate is about the given system: the user's unsolved equations are compared with its
right sides.
"""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.expressions import printing
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import negate
from inverse_service.mechanics import linear_equations
from inverse_service.reading import names as nm, parser as grammar
from inverse_service.service.documents import accepting, translate
from inverse_service.service.documents.comparison import (
    Canonical,
    compared_claim,
    compared_with_document,
    same_formulas,
)

TWO = ["x", "y"]
DISK = {
    "coordinates": ["phi", "theta", "x", "y"],
    "lagrangian": "M/2*(x'^2 + y'^2) + I/2*theta'^2 + J/2*phi'^2",
    "constraints": ["x' - R*cos(phi)*theta'", "y' - R*sin(phi)*theta'"],
    "parameters": ["M", "I", "J", "R"],
}
MOTIONS = {
    "first": {
        "phi": "0",
        "theta": "0",
        "x": "-R*sin(phi)*phi'*theta'",
        "y": "R*cos(phi)*phi'*theta'",
    },
    "second": {"phi": "0", "theta": "0", "x": "-tan(phi)*phi'*x'", "y": "cot(phi)*phi'*y'"},
    "third": {"phi": "0", "theta": "0", "x": "-phi'*y'", "y": "phi'*x'"},
}
MASSES = "(2 + cos(y))*x'' + a*y'' + b*x = 0; y'' - x''/3 + sqrt(y) = 0"
SOLVED = {
    "x": "-3*(b*x - a*sqrt(y))/(a + 3*cos(y) + 6)",
    "y": "-(b*x + 3*sqrt(y)*cos(y) + 6*sqrt(y))/(a + 3*cos(y) + 6)",
}


def compared(document: Any, equations: dict[str, str], claim: Any = None, **names: Any) -> str:
    system = {"coordinates": list(equations), "equations": equations, **names}
    return compared_with_document(document, Canonical(system, claim or {})).verdict


@pytest.mark.parametrize(
    ("document", "equations", "names"),
    [
        ({"equations": "x'' + 2*sin(x)*cos(x) = 0"}, {"x": "-sin(2*x)"}, {}),
        ({"equations": r"\ddot{x} + \frac{1}{2} \sqrt{x} = 0"}, {"x": "-x^(1/2)/2"}, {}),
        ({"equations": "0.1 x'' = t x'"}, {"x": "10*t*x'"}, {}),
        ({"equations": "x'' = -x + x'^2/x"}, {"x": "(x'^2 - x^2)/x"}, {}),
        ({"equations": "x'' = pi*log(e^x)"}, {"x": "pi*x"}, {}),
        ({"equations": {"x": "-w^2 x"}, "parameters": {"w": "sqrt(2)"}}, {"x": "-2*x"}, {}),
        ({"equations": "x'' = sin(x - sin(t)^2 - cos(t)^2 + 1 - x)"}, {"x": "0"}, {}),
        ({"equations": MASSES, "parameters": ["a", "b"]}, SOLVED, {"parameters": ["b", "a"]}),
        ({"equations": "x'' + x - y'' - y = 0; y'' + y = 0"}, {"x": "x'' + x", "y": "-y'' - y"}, {}),  # lines
        (
            {"coordinates": TWO, "equations": {"x": "A'(x)*y'", "y": "B[1,1](x, y)"},
             "functions": {"A": ["x"], "B": TWO}},
            {"x": "y'*diff(A(x), x)", "y": "diff(B(x, y), x, y)"},
            {"functions": {"A": ["x"], "B": TWO}},
        ),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_the_same_system_in_another_form_is_the_system_given(
    document: Any, equations: Any, names: Any
) -> None:
    assert compared(document, equations, **names) == "valid"


@pytest.mark.parametrize(
    ("document", "equations", "names"),
    [
        ({"equations": "x'' + sin(x) = 0"}, {"x": "sin(x)"}, {}),  # a sign
        ({"equations": "x'' + sin(x) = 0"}, {"x": "-sin(x)*(1 + 1/10^25)"}, {}),  # by very little
        ({"equations": "x'' + sin(x) = 0"}, {"x": "-sin(x) + 1/10^25"}, {}),
        ({"equations": "x'' + x = 0"}, {"x": "-x + x^999/10^300"}, {}),  # by a term that vanishes at 0
        ({"equations": "x'' + sin(x) = 0"}, {"x": "-sin(x) + x^999"}, {}),
        ({"equations": "x'' = a*x - b*x'", "parameters": ["a", "b"]}, {"x": "b*x - a*x'"}, {"parameters": ["a", "b"]}),
        ({"equations": "x'' = x; y'' = x'"}, {"y": "x'", "x": "x"}, {}),  # another order of coordinates
        ({"equations": "x'' = x; y'' = x'"}, {"x": "x'", "y": "x"}, {}),
        ({"equations": "x'' = tan(10^99*x + 10^99)"}, {"x": "0"}, {}),
        ({"equations": "0*(x'' + x) = 0"}, {"x": "-x"}, {}),
        ({"equations": "(sin(x)^2 + cos(x)^2 - 1)*(x'' + x) = 0"}, {"x": "-x"}, {}),
        ({"equations": "x'' + y'' = 0; 2*x'' + 2*y'' = 0"}, {"x": "-y", "y": "y"}, {}),  # does not determine them
        ({"equations": "x'' + x + y'' + y = 0; y'' + x'' + x + y = 0"}, {"x": "x'' + x", "y": "y'' + y"}, {}),
        ({"equations": "x'' + x + y'' - y = 0; y'' + y = 0"}, {"x": "x'' + x", "y": "y'' + y"}, {}),
        ({"equations": "x'' = 0"}, {"x": "0", "y": "0"}, {}),
        ({"equations": "x'' = a*x", "parameters": ["a"]}, {"x": "a*x"}, {"parameters": ["a", "b"]}),
        ({"equations": "x'' = a*x", "parameters": {"a": 2}}, {"x": "3*x"}, {}),
        (
            {"coordinates": ["x"], "equations": {"x": "A'(x)"}, "functions": {"A": ["x"]}},
            {"x": "A(x)"},
            {"functions": {"A": ["x"]}},
        ),
        ({"coordinates": ["x"], "equations": {"x": "A(2*x)"}, "functions": {"A": ["x"]}}, {"x": "A(x)"},
         {"functions": {"A": ["x"]}}),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_another_system_is_not_the_system_given(document: Any, equations: Any, names: Any) -> None:
    assert compared(document, equations, **names) == "invalid"


@pytest.mark.slow
def test_another_branch_of_a_root_is_another_system() -> None:
    document = {"equations": "x'' = sqrt(x^2)"}
    right, left = (
        {"near": {"x": value}, "conditions": [f"x {sign} 0"]}
        for value, sign in (("3/2", ">"), ("-3/2", "<"))
    )
    assert compared(document, {"x": "x"}, right) == "valid"
    assert compared(document, {"x": "x"}, left) == "invalid"
    assert compared(document, {"x": "-x"}, left) == "valid"
    assert compared(document, {"x": "x"}, {"near": right["near"]}) == "incomplete"
    assert compared(document, {"x": "-(x^2)^(1/2)"}) == "invalid"


def test_related_arctangents_are_another_system_beyond_their_poles() -> None:
    system = {"coordinates": ["x"], "equations": {"x": "-x"}}
    found = compared_with_document(
        {"equations": "x'' = -atan(tan(x))"}, Canonical(system, {"near": {"x": "1/3"}})
    )
    assert (found.verdict, found.cell and found.cell.domain) == ("valid", ("cos(x) > 0",))


def test_formulas_without_a_common_real_point_are_not_judged() -> None:
    assert compared({"equations": "x'' = log(-1 - x^2)"}, {"x": "0"}) == "incomplete"


@pytest.mark.slow
@pytest.mark.parametrize("f", ["exp(exp(exp(exp(x + 9))))", "(x + 3)^(x + 9)^(x + 9)^9"])
def test_numbers_beyond_all_measure_are_not_judged(f: str) -> None:
    assert compared({"equations": f"x'' = {f}"}, {"x": "0"}) == "incomplete"


@pytest.mark.parametrize(
    "document", [None, 3, {}, {"equations": "x'' ="}, {"lagrangian": 1}, {"equations": {"x": []}}]
)
def test_an_invalid_document_is_not_compared(document: Any) -> None:
    assert compared(document, {"x": "0"}) == "invalid"


@pytest.mark.parametrize("kind", MOTIONS)
def test_every_associated_system_is_the_motion_on_the_constraints(kind: str) -> None:
    assert compared(DISK, MOTIONS[kind], parameters=DISK["parameters"]) == "valid"


@pytest.mark.parametrize(
    "changed", [{"phi": "x'"}, {"theta": "1"}, {"x": "tan(phi)*phi'*x'"}, {"y": "phi'*y'"}]
)
def test_another_motion_is_not_that_of_the_lagrangian(changed: dict[str, str]) -> None:
    assert compared(DISK, MOTIONS["second"] | changed, parameters=DISK["parameters"]) == "invalid"


@pytest.mark.parametrize(
    ("free", "velocities", "verdict"),
    [
        (["x", "y"], {"z": "y'"}, "valid"),
        (["x", "z"], {"y": "z'"}, "valid"),
        (["x", "y"], {"z": "-y'"}, "invalid"),
        (["x"], {"y": "0", "z": "0"}, "invalid"),
    ],
)
def test_a_motion_with_more_constraints_is_another_motion(
    free: list[str], velocities: dict[str, str], verdict: str
) -> None:
    """Uniform motion with z' = y' is more than that with y' = z' = 0, whose velocities keep it."""
    document = {
        "coordinates": ["x", "y", "z"], "lagrangian": "(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' - y'"],
    }  # fmt: skip
    system = {
        "coordinates": [*free, *velocities], "equations": dict.fromkeys(free, "0"),
        "velocities": velocities, "parameters": [], "functions": {},
    }  # fmt: skip
    assert compared_claim(document, {"system": system}, 20.0).verdict == verdict


def test_a_lagrangian_that_determines_no_motion_is_not_agreed_with() -> None:
    document = DISK | {"lagrangian": "M/2*(x'^2 + y'^2) + I/2*theta'^2 + J*phi' + R"}
    assert compared(document, MOTIONS["first"], parameters=DISK["parameters"]) == "invalid"


@pytest.mark.slow
def test_a_result_is_compared_with_the_document_that_it_carries() -> None:
    result = solve({"equations": MASSES, "parameters": ["a", "b"]})
    found = check(result)
    assert (found["verdict"], "not compared" in " ".join(found["reasons"])) == ("valid", False)
    assert any("satisfy the equations as" in reason for reason in found["reasons"])
    result["system"]["given"]["equations"] = MASSES.replace("+ b", "- b")
    assert check(result)["verdict"] == check(json.dumps(result))["verdict"] == "invalid"


def test_a_certificate_alone_is_compared_with_a_document() -> None:
    certificate = solve({"equations": "x'' = -a*x", "parameters": ["a"]})["certificate"]
    for shown in (certificate, json.dumps(certificate)):
        assert check(shown)["verdict"] == "valid"
        assert (
            check(shown, {"equations": "x'' + a*x = 0", "parameters": ["a"]})["verdict"] == "valid"
        )
        assert (
            check(shown, {"equations": "x'' - a*x = 0", "parameters": ["a"]})["verdict"]
            == "invalid"
        )


@pytest.mark.slow
def test_the_associated_system_of_a_result_is_compared_and_the_others_named() -> None:
    result = solve({**DISK, "associated": "second"})
    assert check(result)["verdict"] == "valid"
    other = result["nonholonomic"]["associated"][0]["certificate"]["system"]["equations"]
    other["x"] = f"2*({other['x']})"
    assert "/nonholonomic" in check(result)["not_checked"]
    result["certificate"]["system"]["equations"]["x"] = other["x"]
    assert check(result)["verdict"] == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "is_read_twice"),
    [("x'' = -x + y; y'' = -x^2^3/2*a*-y", True), ({"x": "t*sin(x)^2", "y": "exp(y)/2/3"}, True),
     (["x'' - 2.50*y = -x^2", "y'' = a*-t"], True), ("x'' = -2x; y'' = y", False), ("x'' = -x, y'' = y", False),
     (r"\ddot{x} = -y; y'' = x", False)],
    ids=str,
)  # fmt: skip
def test_what_the_checker_can_read_is_read_twice(
    equations: Any, is_read_twice: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of our reader is detected: here it gives every product of a formula the opposite
    sign.
    """
    document = {"equations": equations, "parameters": {"a": "3/7"}}
    result = solve(document)
    assert check(result)["verdict"] == "valid"
    right = grammar.product
    monkeypatch.setattr(grammar, "product", lambda *given: negate(right(*given)))
    canonical = Canonical(solve_nothing(document))
    found = compared_with_document(document, canonical)
    assert (found.verdict, "Two readers" in " ".join(found.reasons)) == (
        ("invalid", True) if is_read_twice else ("valid", False)
    )


def solve_nothing(document: Any) -> dict[str, Any]:
    """The canonical system as the active reader parses the document."""
    system = accepting.to_system(accepting.to_schema(document))
    equations = {
        name: to_text(f) for name, f in zip(system.coordinates, system.accelerations, strict=True)
    }
    return {"coordinates": list(system.coordinates), "equations": equations}


@pytest.mark.slow
@pytest.mark.parametrize("broken", ["solving", "printing"])
def test_a_fault_between_reading_and_canonical_form_never_leaves(
    broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = {"equations": "x'' + y'' + sin(x) = 0; x'' - y'' = y"}
    assert solve(document)["verdict"] == "variational"
    if broken == "solving":
        right = linear_equations.solve_lines

        def wrong(*given: Any) -> linear_equations.Solved:
            return linear_equations.Solved(tuple(map(negate, right(*given).accelerations)))

        monkeypatch.setattr(linear_equations, "solve_lines", wrong)
    else:
        monkeypatch.setattr(
            translate, "printing", SimpleNamespace(**vars(printing) | {"to_text": lambda tree: "0"})
        )
    result = solve(document)
    assert (result["verdict"], result["lagrangian"]) == ("undetermined", None)
    assert result["provenance"]["fault"] == "CertificateRefused"


@pytest.mark.parametrize("times", [5, pytest.param(30, marks=pytest.mark.slow)])
def test_what_is_nothing_near_zero_is_seen_wherever_the_points_fall(times: int) -> None:
    wrong = {"x": "-sin(x) + x^999"}
    found = {compared({"equations": "x'' + sin(x) = 0"}, wrong) for _ in range(times)}
    assert found == {"invalid"}


def test_constants_with_values_are_put_in_the_same_way_at_all_points() -> None:
    """Each equation holds the angles again, and the constant."""
    equations = {"x": "-tan(x)*y' + G*cos(x)^2", "y": "cot(x)*x' + G*cos(x)*sin(x)"}
    given = {"coordinates": ["x", "y"], "equations": equations, "parameters": {"G": "2"}}
    plain = given | {
        "equations": {x: text.replace("G", "2") for x, text in equations.items()},
        "parameters": {},
    }
    verdicts = [solve(one).verdict for one in (given, plain)]
    assert verdicts == ["not_variational", "not_variational"]


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ({"x": "-sin(x)^2"}, {"x": "cos(x)^2-1"}, True),
        ({"x": "-x"}, {"x": "x"}, False),
        ({"x": "-x"}, {"x": "0"}, False),
        ({"x": "0"}, {"x": "-x"}, False),
        ({"x": "-x", "y": "-y"}, {"x": "-x", "y": "-2*y"}, False),
        ({"x": "-x"}, {"y": "-x"}, False),
    ],
)
def test_formulas_are_the_same_as_functions(
    one: dict[str, str], other: dict[str, str], same: bool
) -> None:
    assert same_formulas(one, other, nm.Names(("x", "y"), (), {})) is same
