"""The reduced system of constraints, as it is and with Chaplygin's clock; each yes against equations by SymPy alone."""

from __future__ import annotations

import json
from typing import Any, ClassVar

import pytest
import sympy

from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import motion_report
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.reduced_documents import decided_reduced, reduced_part
from inverse_service.service.documents.translate_nonholonomic import to_nonholonomic, to_nonholonomic_schema

YES, NO, NONE = "variational", "not_variational", None
BODY = (
    "(A*(phi'*sin(theta)*sin(psi)+theta'*cos(psi))^2+B*(phi'*sin(theta)*cos(psi)-theta'*sin(psi))^2"
    "+C*(phi'*cos(theta)+psi')^2)/2"
)
EULER = {"coordinates": ["phi", "theta", "psi"], "parameters": ["A", "B", "C"]}
SNAKEBOARD = "m/2*(x'^2+y'^2)+m*R^2/2*theta'^2+J0*theta'*psi'+J0/2*psi'^2+J1*phi'^2"
SLEIGH = "m/2*((x'-a*sin(phi)*phi')^2+(y'+a*cos(phi)*phi')^2)+J/2*phi'^2"


def document(lagrangian: str, *constraints: str, **more: Any) -> dict[str, Any]:
    return {"lagrangian": lagrangian, "constraints": list(constraints), **more}


def generic(potential: str) -> dict[str, Any]:
    names, functions = ["r1", "r2", "s"], {"A": ["r1"], "V": ["r1", "r2"]}
    text = f"I1/2*r1'^2+I2/2*r2'^2+I3/2*s'^2-{potential}"
    return document(text, "s'+A(r1)*r2'", coordinates=names, functions=functions, parameters=["I1", "I2", "I3"])


# source, document, verdict as it is, verdict with the clock (None: there is no other clock)
KNOWN: list[tuple[str, dict[str, Any], str, str | None]] = [
    ("generic class, one constraint, any V (Fernandez, Mestdag, Bloch 2009)", generic("V(r1,r2)"), NO, YES),
    ("generic class, two constraints, any A, B, V (Fernandez, Mestdag, Bloch 2009)", document(
        "I1/2*r1'^2+I2/2*r2'^2+I3/2*s'^2+I4/2*w'^2-V(r1,r2)", "s'+A(r1)*r2'", "w'+B(r1)*r2'",
        coordinates=["r1", "r2", "s", "w"], parameters=["I1", "I2", "I3", "I4"],
        functions={"A": ["r1"], "B": ["r1"], "V": ["r1", "r2"]}), NO, YES),
    ("nonholonomic particle, any V(x, y) (Rosenberg 1977)", document(
        "(x'^2+y'^2+z'^2)/2-V(x,y)", "z'-y*x'", coordinates=["x", "y", "z"], functions={"V": ["x", "y"]}), NO, YES),
    ("two shape variables and a measure: particle in a harmonic potential (Chaplygin 1911)", document(
        "(x'^2+y'^2+z'^2)/2-x^2/2-y^2", "z'-y*x'", coordinates=["x", "y", "z"]), NO, YES),
    ("Suslov's problem (Suslov 1902)", document(
        BODY, "phi'*sin(theta)*sin(psi)+theta'*cos(psi)", **EULER), NO, YES),
    ("Veselova's problem, A, B, C free (Veselov, Veselova 1986)", document(
        BODY, "phi'+psi'*cos(theta)", **EULER), NO, YES),
    ("snakeboard (Bloch, Krishnaprasad, Marsden, Murray 1996)", document(
        SNAKEBOARD, "x'+R*cot(phi)*cos(theta)*theta'", "y'+R*cot(phi)*sin(theta)*theta'",
        coordinates=["x", "y", "theta", "psi", "phi"], parameters=["m", "R", "J0", "J1"]), YES, YES),
    ("vertical rolling disk (Bloch 2003, ch. 1)", document(
        "m/2*(x'^2+y'^2)+I/2*theta'^2+J/2*phi'^2", "x'-R*cos(phi)*theta'", "y'-R*sin(phi)*theta'",
        coordinates=["phi", "theta", "x", "y"], parameters=["m", "I", "J", "R"]), YES, NONE),
    ("knife edge on a plane (Bloch 2003, ch. 1)", document(
        "(x'^2+y'^2)/2+phi'^2/2", "sin(phi)*x'-cos(phi)*y'", coordinates=["phi", "x", "y"]), YES, YES),
    ("Chaplygin's sleigh: no measure (Neimark, Fufaev 1972)", document(
        SLEIGH, "sin(phi)*x'-cos(phi)*y'", coordinates=["phi", "x", "y"], parameters=["m", "J", "a"]), NO, NONE),
]  # fmt: skip
# Where the reduced system contains what it should be free of, there is none.
UNREDUCED = [
    ("a potential in x and z", document("(x'^2+y'^2+z'^2)/2-z^2/2-x^2", "z'-y*x'", coordinates=["x", "y", "z"])),
]


def reduced(asked: dict[str, Any]) -> dict[str, Any] | None:
    report = motion_report(to_nonholonomic(to_nonholonomic_schema(asked)))
    lagrangian = report.motion.system.lagrangian
    plain = decided_reduced(report.motion, lagrangian, 1, 200)
    found = reduced_part(report, plain, 1, 200)
    return None if found is None else found.model_dump(mode="json")


class Numbers:
    """Formulas of a document at one point, by SymPy; arbitrary functions are replaced by chosen ones."""

    chosen: ClassVar[dict[str, Any]] = {
        "A": lambda u: u**2 + 2,
        "B": lambda u: u**3 - u,
        "V": lambda u, w: u**2 * w + w**3,
    }

    def __init__(self, asked: dict[str, Any]) -> None:
        self.names: list[str] = asked["coordinates"]
        letters = [*self.names, *asked.get("parameters", ())]
        self.table = {name: sympy.Symbol(name) for name in letters}
        self.table |= {name + "_v": sympy.Symbol(name + "_v") for name in self.names}
        self.functions = {name: sympy.Function(name) for name in asked.get("functions", {})}

    def read(self, text: str) -> sympy.Expr:
        """In letters; A'(r1) is written out before."""
        for name in self.functions:
            text = text.replace(f"{name}'(r1)", f"diff({name}(r1), r1)")
        found = sympy.sympify(text.replace("'", "_v").replace("^", "**"), locals={**self.table, **self.functions})
        for name, function in self.functions.items():
            found = found.replace(function, self.chosen[name])
        return found.doit()

    def letter(self, name: str, velocity: bool = False) -> sympy.Symbol:
        return self.table[name + "_v" if velocity else name]

    def value(self, formula: sympy.Expr) -> sympy.Expr:
        point = {letter: sympy.Rational(3 + 2 * k, 10 + k) for k, letter in enumerate(self.table.values())}
        return sympy.N(formula.subs(point), 30)

    def along(self, formula: sympy.Expr, forces: dict[str, sympy.Expr]) -> sympy.Expr:
        """The derivative along the motion with these accelerations."""
        total = sympy.Integer(0)
        for name, force in forces.items():
            total += formula.diff(self.letter(name)) * self.letter(name, True)
            total += formula.diff(self.letter(name, True)) * force
        return total

    def residuals(self, lagrangian: sympy.Expr, forces: dict[str, sympy.Expr]) -> list[sympy.Expr]:
        slopes = [self.along(lagrangian.diff(self.letter(name, True)), forces) for name in forces]
        return [
            self.value(slope - lagrangian.diff(self.letter(name))) for name, slope in zip(forces, slopes, strict=True)
        ]


def by_hand(asked: dict[str, Any], found: dict[str, Any], numbers: Numbers) -> list[sympy.Expr]:
    """The accelerations of d'Alembert's principle, with multipliers, less those of the reduced system."""
    names = numbers.names
    speeds = [numbers.letter(name, True) for name in names]
    lagrangian = numbers.read(asked["lagrangian"])
    rows = [[numbers.read(w).diff(v) for v in speeds] for w in asked["constraints"]]
    on = {numbers.letter(name, True): numbers.read(text) for name, text in found["reconstruction"].items()}
    nothing = dict.fromkeys(names, sympy.Integer(0))
    mass = [[lagrangian.diff(a, b) for b in speeds] for a in speeds]
    force = [lagrangian.diff(numbers.letter(q)) - numbers.along(lagrangian.diff(v), nothing)
             for q, v in zip(names, speeds, strict=True)]  # fmt: skip
    drift = [-numbers.along(sum(w * v for w, v in zip(row, speeds, strict=True)), nothing) for row in rows]
    k = len(rows)
    matrix = [[*mass[i], *(-row[i] for row in rows)] for i in range(len(names))] + [[*row, *[0] * k] for row in rows]
    there = sympy.Matrix([[numbers.value(sympy.sympify(entry).subs(on)) for entry in row] for row in matrix])
    right = sympy.Matrix([numbers.value(sympy.sympify(entry).subs(on)) for entry in [*force, *drift]])
    accelerations = there.LUsolve(right)
    return [accelerations[names.index(r)] - numbers.value(numbers.read(f)) for r, f in found["equations"].items()]


@pytest.mark.parametrize(
    ("source", "asked", "plain", "clocked"),
    [
        pytest.param(*known, id=known[0][:40], marks=pytest.mark.slow if len(known[1]["coordinates"]) > 4 else ())
        for known in KNOWN
    ],
)
def test_known_reduced_systems(source: str, asked: dict[str, Any], plain: str, clocked: str | None) -> None:
    found = reduced(asked)
    assert found is not None
    assert (found["verdict"], found["checked"]) == (plain, "valid"), source
    numbers = Numbers(asked)
    assert max(map(abs, by_hand(asked, found, numbers))) < 1e-20
    if plain == YES:
        forces = {name: numbers.read(text) for name, text in found["equations"].items()}
        assert max(map(abs, numbers.residuals(numbers.read(found["lagrangian"]["text"]), forces))) < 1e-20
    clock = found["with_clock"]
    assert (clock and clock["verdict"]) == clocked, source
    if clock is None:
        assert found["without_clock"]
        return
    assert clock["checked"] == "valid"
    factor = numbers.read(clock["factor"])
    faster = {numbers.letter(r, True): factor * numbers.letter(r, True) for r in found["equations"]}
    rate = sum(factor.diff(numbers.letter(r)) * numbers.letter(r, True) for r in found["equations"]) / factor
    forces = {}
    for name, text in found["equations"].items():
        mine = numbers.read(text).subs(faster, simultaneous=True) / factor**2 - rate * numbers.letter(name, True)
        forces[name] = numbers.read(clock["equations"][name])
        assert abs(numbers.value(mine - forces[name])) < 1e-20
    assert max(map(abs, numbers.residuals(numbers.read(clock["lagrangian"]["text"]), forces))) < 1e-20


@pytest.mark.parametrize(("why", "asked"), UNREDUCED, ids=[why for why, _ in UNREDUCED])
def test_what_contains_the_others_does_not_reduce(why: str, asked: dict[str, Any]) -> None:
    assert reduced(asked) is None, why


@pytest.mark.slow
def test_a_result_holds_the_reduced_system_and_no_forged_one() -> None:
    asked = {**KNOWN[-2][1], "associated": "first"}
    result = solve_document(asked, SolveOptions(time_limit=20))
    assert result["reduced"]["with_clock"]["factor"] == "cos(phi)"
    assert result["reduced"]["reconstruction"] == {"y": "tan(phi)*x'"}
    clock = result["reduced"]["with_clock"]
    forgeries = [
        {"with_clock": {**clock, "factor": "1"}},
        {"with_clock": {**clock, "verdict": NO}},
        {"equations": clock["equations"]},
        {"certificate": clock["certificate"], "lagrangian": clock["lagrangian"]},
    ]
    assert check_document(json.dumps(result))["verdict"] == "valid"
    for forged in forgeries:
        other = {**result, "reduced": {**result["reduced"], **forged}}
        assert check_document(json.dumps(other))["verdict"] == "invalid"


@pytest.mark.parametrize("key", ["kinds", "clock"])
def test_a_document_with_constraints_says_where_to_ask(key: str) -> None:
    with pytest.raises(Exception, match="reduced") as refused:
        solve_document({**KNOWN[3][1], key: ["natural"] if key == "kinds" else "y"}, SolveOptions(time_limit=5))
    assert refused.value.pointer == f"/{key}"  # type: ignore[attr-defined]
