"""Section 4 of the paper: potentials V(r2), Proposition 3 and its counterexample, two constraints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from inverse_service import catalogue
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_system
from inverse_service.service.documents.nonholonomic_documents import solve_nonholonomic
from paper.statement import Progress, Section, Statement, Table, finding

CODE = "paper/further_systems.py"
TIME_LIMIT = 60.0
WITH_POTENTIAL = (
    "mobile-robot-with-potential",
    "inclined-knife-edge",
    "generic-class-with-potential",
)
TWO_CONSTRAINTS: Mapping[str, Any] = {
    "name": "generic class, two constraints, potential V(r2)",
    "coordinates": ["r1", "r2", "s1", "s2"],
    "lagrangian": "I_1*r1'^2/2 + I_2*r2'^2/2 + I_a*s1'^2/2 + I_b*s2'^2/2 - V(r2)",
    "constraints": ["s1' + A(r1)*r2'", "s2' + B(r1)*r2'"],
    "parameters": ["I_1", "I_2", "I_a", "I_b"],
    "functions": {"A": ["r1"], "B": ["r1"], "V": ["r2"]},
}


def section_four(progress: Progress) -> Section:
    """All statements of section 4."""
    progress("systems with a potential")
    return Section("Section 4: further systems", tuple(make() for make in STATEMENTS))


def systems_with_potential() -> Statement:
    """Robot with potential and inclined knife edge."""
    rows, good = [], True
    for document in [catalogue.document(name) for name in WITH_POTENTIAL]:
        found = _verdicts(document, ("first", "second"))
        good &= found["second"] == ("not_variational", "valid") and found["first"] == (
            "not_variational",
            "valid",
        )
        rows.append((document["name"], *(_words(found[kind]) for kind in ("first", "second"))))
    return Statement(
        "potential",
        "section 4, the examples",
        "For the mobile robot with potential and the knife edge on an inclined plane the paper looks for a free "
        "Lagrangian.",
        finding(good),
        "Neither the first nor the second associated system has one; each verdict has a certificate.",
        CODE,
        (Table(("system", "first", "second"), tuple(rows)),),
    )


def _verdicts(document: Mapping[str, Any], kinds: Sequence[str]) -> dict[str, tuple[str, str]]:
    """{kind: (verdict, what the checker says)}."""
    found = {}
    for kind in kinds:
        plain = {key: value for key, value in document.items() if key != "associated"}
        result = solve_nonholonomic(
            {**plain, "associated": kind}, SolveOptions(time_limit=TIME_LIMIT)
        )
        found[kind] = (result["verdict"], result["checked"] or "")
    return found


def _words(found: tuple[str, str]) -> str:
    return f"{found[0].replace('_', ' ')} ({found[1]})"


def proposition_three() -> Statement:
    """Proposition 3 for generic functions, and where it fails."""
    names = ("extension", "extension-without-potential", "extension-counterexample")
    results = {
        name: solve_system(catalogue.document(name), SolveOptions(time_limit=TIME_LIMIT))
        for name in names
    }
    generic = results["extension"]["verdict"] == "not_variational"
    special = results["extension-counterexample"]["verdict"] == "variational"
    rows = tuple((result["system"].get("name") or name, _words((result["verdict"], result["checked"])),
                  (result["lagrangian"] or {}).get("text", "")) for name, result in results.items())  # fmt: skip
    return Statement(
        "proposition-3",
        "Proposition 3",
        "The extension r1'' = 0, r2'' = Gamma2(r1) r1' r2' + t2(r1, r2), s'' = Gamma3(r1) r1' s' + t3(r1, r2) has no "
        "regular Lagrangian.",
        finding(generic and special, "correction"),
        "True for generic t2, t3, with a certificate for arbitrary functions; false as stated. "
        "Gamma2 = Gamma3 = 0, t2 = t3 = -r2 is allowed and has a Lagrangian, and t2 = t3 = 0 is Proposition 1.",
        CODE,
        (Table(("system", "verdict", "Lagrangian"), rows),),
    )


def two_constraints() -> Statement:
    """The question left open for more than one constraint."""
    generic = _verdicts(TWO_CONSTRAINTS, ("first", "second"))
    robot = _verdicts(catalogue.document("mobile-robot-with-potential"), ("second",))
    good = all(
        found == ("not_variational", "valid") for found in (*generic.values(), *robot.values())
    )
    rows = [("generic, A, B, V arbitrary", *map(_words, generic.values()))]
    rows.append(("mobile robot, V = 10 sin(psi)", "see above", _words(robot["second"])))
    return Statement(
        "two-constraints",
        "section 4, the open question",
        "For systems with more than one constraint and a potential V(r2) the result is open.",
        finding(good, "correction"),
        "It can be decided: the first and the second system have no regular Lagrangian for arbitrary A, B and V, "
        "nor do those of the mobile robot. Whether another associated system has one is decided too: "
        "docs/reference/open-questions.md.",
        CODE,
        (Table(("system", "first", "second"), tuple(rows)),),
    )


STATEMENTS: tuple[Callable[[], Statement], ...] = (
    systems_with_potential,
    proposition_three,
    two_constraints,
)
