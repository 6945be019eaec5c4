"""Claims from brackets along one solution, and the series that the checker computes for them."""

from __future__ import annotations

import itertools
import math
import random
import time
from typing import Any

import pytest
import sympy
from flint import ctx, nmod_mat

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.constraints import Along, FlowExpansion
from inverse_service.certificate.numbers import Balls
from inverse_service.certificate.question import Tools
from inverse_service.constrained import existence
from inverse_service.constrained.existence import analyze_motion, decide_motion
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from inverse_service.statements.questions import PLAIN
from tests.certificate.documents import check_result
from tests.certificate.motions import disk, given, motion_of

Document = dict[str, Any]
CHAINED = {
    "coordinates": ["x", "y", "a", "b", "c", "d"],
    "lagrangian": "(x'^2+y'^2+a'^2+b'^2+c'^2+d'^2)/2 - x^2 - a*b",
    "constraints": ["a'-y*x'", "b'-a*x'", "c'-b*x'", "d'-c*x'"],
}
# The sleigh (m = 1): v' = a w^2, w' = -a v w/(J + a^2), here with a = J = 1.
SLEIGH = {
    "coordinates": ["phi", "x", "y"],
    "equations": {"phi": "-x'*phi'/(2*cos(phi))", "x": "cos(phi)*phi'^2 - tan(phi)*phi'*x'"},
    "velocities": {"y": "tan(phi)*x'"},
}
HEAD = {
    "format": "inverse-service/certificate/2",
    "question": "autonomous",
    "claim": "not_variational",
    "kind": "nonexistence",
}
# One motion for every kind of formula, one with time, and one with a parameter and more than eight
# variables.
MOTIONS = (
    SLEIGH,
    {
        "coordinates": ["x", "y", "z"],
        "equations": {"x": "sqrt(x)*y' + log(y)*z", "y": "atan(x*y')/x' + exp(-z)"},
        "velocities": {"z": "x*y' + sin(z)*x' + x'^2/y"},
    },
    {
        "coordinates": ["x", "y", "z"],
        "equations": {"x": "t*y'^2", "y": "x'/(t + z)"},
        "velocities": {"z": "y*x' + t*y'"},
    },
    {
        "coordinates": ["x", "y", "z", "u", "w"],
        "parameters": ["c"],
        "equations": {"x": "y'*z'/c", "y": "c*x'^2*t", "z": "x*u'*z", "u": "z'^2 + w"},
        "velocities": {"w": "u*x' + c*y'^2"},
    },
)
PARAMETER = "5/3"


def certificate_of(document: Document) -> Document:
    analyzed = analyze_motion(motion_of(document))
    return existence.of_finding(
        analyzed, decide_motion(analyzed, PLAIN, 1, float("inf"), lambda _: None), PLAIN
    )


@pytest.mark.parametrize(
    ("free", "dependent", "is_refused"),
    [
        ({"x": "y'*z", "y": "x'^2*u"}, {"z": "x*y'", "u": "z*x'"}, True),
        ({"x": "x*y'*x'", "y": "x'^2*y"}, {"z": "x*y'", "u": "y*x'"}, False),
        ({"x": "-x", "y": "-2*y"}, {"z": "x'", "u": "y' + x'"}, False),  # a Lagrangian exists
    ],
)
def test_the_checker_confirms_what_brackets_along_a_solution_refuse(
    free: dict[str, str], dependent: dict[str, str], is_refused: bool
) -> None:
    analyzed = analyze_motion(given(free, dependent))
    found = existence.refused_along_a_solution(analyzed, PLAIN, 1, float("inf"), lambda _: None)
    assert (found is not None) is is_refused
    if found is not None:
        certificate = existence.of_finding(analyzed, found, PLAIN)
        assert check_certificate(certificate, seed=1).verdict == "valid"


def verdict(system: Document, along: Any, **more: Any) -> str:
    return check_certificate(HEAD | {"system": system, "along": along} | more, seed=1).verdict


def texts(system: Document) -> list[str]:
    """Formulas in the order of the components of the motion; the velocity of x is named Dx."""
    found = [*system["velocities"].values(), *system["equations"].values()]
    for name in system["equations"]:
        found = [text.replace(f"{name}'", f"D{name}") for text in found]
    return [text.replace("^", "**") for text in found]


def brackets(system: Document, last: int) -> tuple[list[sympy.Symbol], list[list[sympy.Matrix]]]:
    """Compute with SymPy the variables and t, and (ad Gamma)^j d/du^i for each i and j."""
    names = [*system["coordinates"], *(f"D{name}" for name in system["equations"])]
    *own, clock = (sympy.Symbol(name) for name in (*names, "t"))
    table = dict(zip((*names, "t"), (*own, clock), strict=True)) | {"c": sympy.Rational(PARAMETER)}
    first = len(system["coordinates"])
    motion = sympy.Matrix(
        [*own[first:], *(sympy.sympify(text, locals=table) for text in texts(system))]
    )

    def bracket(field: sympy.Matrix) -> sympy.Matrix:
        return field.jacobian(own) * motion + field.diff(clock) - motion.jacobian(own) * field

    found = []
    for place in range(first, len(own)):
        fields = [sympy.Matrix([int(k == place) for k in range(len(own))])]
        for _ in range(last):
            fields.append(bracket(fields[-1]))
        found.append(fields)
    return [*own, clock], found


@pytest.mark.slow
@pytest.mark.parametrize(
    "system", MOTIONS, ids=["sleigh", "every-kind-of-formula", "with-time", "large"]
)
def test_the_series_of_the_flow_are_the_iterated_brackets_that_sympy_finds(
    system: Document,
) -> None:
    """Phi(t)^-1 d/du = sum_j t^j/j! (ad Gamma)^j d/du."""
    last, generator = 3, random.Random(5)
    variables, fields = brackets(system, last)
    values = [sympy.Rational(generator.randint(3, 9), 7) for _ in variables]
    given = dict(zip(map(str, variables), map(str, values), strict=True))
    near = {f"{name[1:]}'" if name[0] == "D" else name: value for name, value in given.items()}
    near |= dict.fromkeys(system.get("parameters", ()), PARAMETER)
    asked = Along(
        Tools(random.Random(1), time.thread_time() + 60),
        system,
        True,
        HEAD | {"along": last, "near": near},
    )
    asked.prepare(lambda ring: None)
    with ctx.workprec(192):
        ring = asked.expansion(Balls(asked, asked.place, None), last)
        assert isinstance(ring, FlowExpansion)
        for v, expected in zip(ring.v, fields, strict=True):
            for j, field in enumerate(expected):
                exact = field.subs(dict(zip(variables, values, strict=True))).evalf(40)
                have = [
                    ring.vertical[v][j].get(x, 0) * math.factorial(j) for x in (*ring.q, *ring.v)
                ]
                assert all(
                    abs(float(a) - b) < 1e-10 * (1 + abs(b))
                    for a, b in zip(have, exact, strict=True)
                ), (v, j)


@pytest.mark.slow
def test_the_chained_form_with_a_potential_has_a_valid_proof_of_nonexistence() -> None:
    """Eight coordinates on the constraints, undecided at prolongation order 10."""
    result = solve_document(CHAINED | {"associated": "any"}, SolveOptions(time_limit=100))
    answer = result["any_associated"]
    assert (answer["verdict"], answer["verdict_with_time"]) == (
        "not_variational",
        "not_variational",
    )
    assert answer["certificate"]["along"] == 26
    assert check_result(result, time_limit=100).verdict == "valid"


@pytest.mark.slow
def test_the_disk_with_a_potential_has_a_valid_proof_of_nonexistence() -> None:
    result = solve_document(disk("x^2") | {"associated": "any"}, SolveOptions(time_limit=60))
    answer = result["any_associated"]
    assert (answer["verdict"], answer["certificate"]["along"]) == ("not_variational", 13)
    assert "contradiction" in str(answer["explanation"])
    assert check_result(result, time_limit=60).verdict == "valid"


@pytest.mark.slow
def test_fewer_brackets_than_the_proof_has_are_refused() -> None:
    certificate = certificate_of(disk("x^2"))
    assert check_certificate(certificate, seed=1).verdict == "valid"
    less = check_certificate(certificate | {"along": certificate["along"] - 1}, seed=1)
    assert (less.verdict, less.reasons) == (
        "invalid",
        ("The rows leave a regular multiplier g(p).",),
    )
    assert (
        check_certificate(certificate | {"along": certificate["along"] + 3}, seed=2).verdict
        == "valid"
    )


@pytest.mark.slow
def test_no_number_of_brackets_refuses_a_motion_that_has_a_lagrangian() -> None:
    system = certificate_of(disk("0"))["system"]
    for along, question in itertools.product((1, 5, 12), ("autonomous", "time_dependent")):
        assert verdict(system, along, question=question) == "invalid"


@pytest.mark.parametrize("along", [0, -1, 80, 10**30, 2.0, True, "6", [6], {"j": 6}])
def test_an_invalid_number_of_brackets_is_rejected(along: Any) -> None:
    assert verdict(SLEIGH, along) == "invalid"


def test_brackets_prove_nothing_about_systems_without_constraints_or_another_claim() -> None:
    free = {"coordinates": ["x", "y"], "equations": {"x": "y", "y": "-x*y'"}}
    assert verdict(free, 6) == "invalid"
    assert verdict(SLEIGH, 6, claim="variational", kind="existence") == "invalid"
    assert verdict(SLEIGH, 6, claim="variational") == "invalid"
    assert verdict(SLEIGH, 6, among="natural") == "invalid"


def test_one_free_velocity_has_no_brackets_and_no_refusal() -> None:
    line = {"coordinates": ["x", "y"], "equations": {"x": "-x"}, "velocities": {"y": "x*x'"}}
    assert verdict(line, 5) == "invalid"


def test_the_sleigh_is_refused_with_and_without_time_and_near_any_point() -> None:
    assert verdict(SLEIGH, 6) == verdict(SLEIGH, 6, question="time_dependent") == "valid"
    assert verdict(SLEIGH, 6, near={"phi": "2.5", "x'": "-3", "phi'": "1e-3"}) == "valid"


@pytest.mark.parametrize("free", [2, 3, 4])
@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_vertical_vector_in_the_kernel_is_seen(free: int, lost: int) -> None:
    """The 2-forms of dimension 6 that vanish with each of the last `lost` vectors: these span the
    vertical part of the kernel, or all of it where nothing else is asked.
    """
    size, prime = 6, 2**61 - 1
    pairs = [*itertools.combinations(range(size), 2)]
    rows = [
        [int(pair == chosen) for pair in pairs]
        for chosen in pairs
        if not {*range(size - lost, size)}.isdisjoint(chosen)
    ]
    matrix = nmod_mat(rows or [[0] * len(pairs)], prime)
    assert existence.leaves_a_vertical_kernel(matrix, size, free) is (lost > 0)


def test_the_exceptions_of_brackets_are_the_sleighs_and_particles_that_have_a_lagrangian() -> None:
    """A sleigh with a = 0 is a knife edge; with J = 0 no force of constraint acts along the motion.
    A particle with V = 0 is free.
    """
    sleigh = SLEIGH | {
        "parameters": ["a", "J"],
        "equations": {
            "phi": "-a*x'*phi'/((J + a^2)*cos(phi))",
            "x": "a*cos(phi)*phi'^2 - tan(phi)*phi'*x'",
        },
    }
    particle = {
        "coordinates": ["x", "y", "z"],
        "equations": {"x": "-V'(x)", "y": "-x*x'*y'/(1 + x^2)"},
        "velocities": {"z": "-x*y'"},
        "functions": {"V": ["x"]},
    }
    excluded = {"a = 0", "J = 0"}
    assert {
        *check_certificate(HEAD | {"system": sleigh, "along": 6}, seed=1).exceptions
    } == excluded
    found = check_certificate(HEAD | {"system": particle, "along": 8}, seed=1)
    assert (found.verdict, [*found.exceptions]) == ("valid", ["special functions V(x)"])
