"""Lagrangians come out as a textbook has them (each right-hand column verified by hand or in the source named)."""

from __future__ import annotations

import pytest

from inverse_service.deadline import now, until
from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.material import gather
from inverse_service.inverse_problem.search.scalar_multiplier import propose
from inverse_service.inverse_problem.solutions import Answer, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_given, read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from inverse_service.service.documents.translate import lagrangian_part
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import tree


def _answered(equations: dict[str, str], parameters: str = "") -> Answer:
    names, declared = list(equations), parameters.split()
    system = read_system(names, equations, declared)
    given = read_given(names, equations, declared).residuals
    solution = solve(system, SolveOptions(given=given))
    answer = solution.with_time if solution.autonomous is None else solution.autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    return answer


# Sturm-Liouville forms: Abramowitz and Stegun, 22.6 and 13.1, 15.5.
SYMBOLIC_POWERS = [
    ("((2*m+1)*t*y' - n*(n+2*m)*y)/(1-t^2)", "m n",
     "y'^2*(1 - t^2)^(m + 1/2)/2 - n*(2*m + n)*y^2*(1 - t^2)^(m - 1/2)/2"),
    ("-((c-(a+b+1)*t)*y' - a*b*y)/(t*(1-t))", "a b c",
     "t^c*(1 - t)^(a + b - c + 1)*y'^2/2 + a*b*y^2*(1 - t)^(a + b - c)*t^(c - 1)/2"),
    ("-((b-a-(a+b+2)*t)*y' + n*(n+a+b+1)*y)/(1-t^2)", "a b n",
     "y'^2*(1 - t)^(a + 1)*(t + 1)^(b + 1)/2 - n*(a + b + n + 1)*y^2*(1 - t)^a*(t + 1)^b/2"),
    ("-((b-t)*y' - a*y)/t", "a b", "exp(-t)*(y'^2*t^b + a*y^2*t^(b - 1))/2"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("f", "parameters", "wanted"), SYMBOLIC_POWERS, ids=["Gegenbauer", "Gauss", "Jacobi", "Kummer"]
)
def test_powers_with_letters_are_put_together(f: str, parameters: str, wanted: str) -> None:
    answer = _answered({"y": f}, parameters)
    assert answer.lagrangian is not None
    assert to_text(answer.lagrangian.expression) == wanted


# A magnetic field that depends on the distance from a line: its vector potential in the round gauge has no place
# where it is not defined but those of the field (Landau and Lifshitz, The Classical Theory of Fields, section 19).
ROUND_FIELDS = [
    ("1/(x^2+y^2)", "x'^2/2 + y'^2/2 - log(x^2 + y^2)*(x*y' - y*x')/(2*(x^2 + y^2))"),
    ("B/(x^2+y^2)", "x'^2/2 + y'^2/2 - B*log(x^2 + y^2)*(x*y' - y*x')/(2*(x^2 + y^2))"),
    ("exp(-x^2-y^2)", "x'^2/2 + y'^2/2 + exp(-(x^2 + y^2))*(x*y' - y*x')/(2*(x^2 + y^2))"),
    ("1/(x^2+y^2)^2", "x'^2/2 + y'^2/2 + x*y'/(2*(x^2 + y^2)^2) - y*x'/(2*(x^2 + y^2)^2)"),
    ("B", "x'^2/2 + y'^2/2 - B*x*y'/2 + B*y*x'/2"),
]


@pytest.mark.parametrize(("field", "wanted"), ROUND_FIELDS, ids=[field for field, _ in ROUND_FIELDS])
def test_a_round_field_has_a_round_potential(field: str, wanted: str) -> None:
    answer = _answered({"x": f"-({field})*y'", "y": f"({field})*x'"}, "B")
    assert answer.lagrangian is not None
    assert to_text(answer.lagrangian.expression) == wanted
    assert answer.hamiltonian is not None
    assert not answer.hamiltonian.implicit


# Dirac's monopole and a magnetic dipole: Jackson, Classical Electrodynamics, 6.11 and 5.6; a bottle: Northrop (1963).
FIELDS_IN_SPACE = [
    ("c*x/(x^2+y^2+z^2)^(3/2)", "c*y/(x^2+y^2+z^2)^(3/2)", "c*z/(x^2+y^2+z^2)^(3/2)",
     "- c*z*(x*y' - y*x')/(sqrt(x^2 + y^2 + z^2)*(x^2 + y^2))"),
    ("3*c*x*z/(x^2+y^2+z^2)^(5/2)", "3*c*y*z/(x^2+y^2+z^2)^(5/2)", "c*(2*z^2-x^2-y^2)/(x^2+y^2+z^2)^(5/2)",
     "+ c*x*y'/(x^2 + y^2 + z^2)^(3/2) - c*y*x'/(x^2 + y^2 + z^2)^(3/2)"),
    ("-c*x*z", "-c*y*z", "c*(z^2-(x^2+y^2)/2)", "- c*(x^2 + y^2 - 4*z^2)*x*y'/8 + c*(x^2 + y^2 - 4*z^2)*y*x'/8"),
]  # fmt: skip


@pytest.mark.parametrize(("bx", "by", "bz", "wanted"), FIELDS_IN_SPACE, ids=["monopole", "dipole", "bottle"])
def test_a_field_round_about_an_axis_has_a_round_potential(bx: str, by: str, bz: str, wanted: str) -> None:
    forces = {"x": f"y'*({bz})-z'*({by})", "y": f"z'*({bx})-x'*({bz})", "z": f"x'*({by})-y'*({bx})"}
    answer = _answered(forces, "c")
    assert answer.lagrangian is not None
    assert same_value(answer.lagrangian.expression, tree(f"x'^2/2 + y'^2/2 + z'^2/2 {wanted}"))


def test_distances_stay_as_they_are_written() -> None:
    """The restricted problem of three bodies (Szebehely, Theory of Orbits, 1.5)."""
    attraction = "-(1-m)*({0})/((x+m)^2+y^2)^(3/2) - m*({1})/((x-1+m)^2+y^2)^(3/2)"
    answer = _answered(
        {"x": "2*y' + x" + attraction.format("x+m", "x-1+m"), "y": "-2*x' + y" + attraction.format("y", "y")}, "m"
    )
    assert answer.lagrangian is not None
    assert answer.hamiltonian is not None
    for formula in (answer.lagrangian.expression, answer.hamiltonian.expression):
        assert "sqrt((x + m)^2 + y^2)" in to_text(formula)
        assert "sqrt((x + m - 1)^2 + y^2)" in to_text(formula)


def _bodies(masses: dict[str, str], drag: str) -> tuple[dict[str, str], str]:
    """Newton's bodies in a plane with masses in general and those given, and their L without its factor of time."""
    equations, potential = {}, "0"
    for one in masses:
        for q in "xy":
            parts = [
                f"-{masses[k]}*({q}{one}-{q}{k})/((x{one}-x{k})^2+(y{one}-y{k})^2)^(3/2)" for k in masses if k != one
            ]
            equations[q + one] = "".join(parts) + f"-{drag}*{q}{one}'"
        others = [k for k in masses if k < one]
        potential += "".join(f"+{masses[one]}*{masses[k]}/sqrt((x{one}-x{k})^2+(y{one}-y{k})^2)" for k in others)
    return equations, potential + "".join(f"+{m}*(x{k}'^2+y{k}'^2)/2" for k, m in masses.items())


CONSTANTS = ["m1", "m2", "m3", "k"]
BODIES = [
    ({"1": "m1", "2": "m2", "3": "m3"}, "0", "1"),
    ({"1": "m1", "2": "m2", "3": "m3"}, "k", "exp(k*t)"),
    ({"1": "1", "2": "m2", "3": "3/7"}, "0", "1"),
    ({"1": "m1", "2": "m2", "3": "m3", "4": "m1*k"}, "0", "1"),
]


@pytest.mark.parametrize(("masses", "drag", "factor"), BODIES)
def test_bodies_that_attract_each_other_have_their_masses_in_the_lagrangian(
    masses: dict[str, str], drag: str, factor: str
) -> None:
    """Whittaker, Analytical Dynamics, section 155; with drag Bateman's factor."""
    equations, wanted = _bodies(masses, drag)
    system = read_system(list(equations), equations, CONSTANTS)
    with until(now() + 60):
        found, *_ = propose(gather(analyze(system), factor != "1"), 1)
    assert same_value(found, parse(f"({factor})*({wanted})", Names(system.coordinates, tuple(CONSTANTS))))


@pytest.mark.slow
@pytest.mark.parametrize("drag", ["0", "k"])
def test_three_bodies_in_a_plane_are_answered_with_their_lagrangian(drag: str) -> None:
    equations, _ = _bodies({"1": "m1", "2": "m2", "3": "m3"}, drag)
    answer = solve(read_system(list(equations), equations, CONSTANTS), SolveOptions()).with_time
    assert answer is not None
    assert answer.checked == "valid"
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == "one function times a constant matrix"


# Each made from the Lagrangian on the right, by SymPy; its terms are products of velocities, powers of the velocity of
# a cyclic coordinate, or functions whose denominators show as factors of f alone.
MADE_FROM_LAGRANGIANS = [
    ({"x": "2*w'^2*y^2/(3*x'*y'*sqrt(y^2 + 1)) - y*exp(-y)/(3*x'*y')",
      "y": "-w'^2*y^2/(3*x'^2*sqrt(y^2 + 1)) + y'^2/(2*y) + y*exp(-y)/(6*x'^2)",
      "z": "-3*sin(w - 2*z)/2", "w": "-w'*y*y'/(y^2 + 1) + sin(w - 2*z)/(4*sqrt(y^2 + 1))"},
     "2*w'^2*sqrt(y^2 + 1) + x'^2*y'^2/y + 2*z'^2/3 - cos(w - 2*z) + exp(-y)"),
    ({"r": "a'*b'*r'/(a*(8*a*b'^(3/2)*s'^2 - 8*a*b'^(3/2) + 3*a*r'^2 - 3*b'))",
      "a": "(3*a*a'^2*b'^(3/2)*r'^2 + 8*a*a'^2*b'^3*s'^2 - 8*a*a'^2*b'^3 - 8*a*b'^(11/2)*s'^2 + 8*a*b'^(11/2)"
           " - 3*a*b'^4*r'^2 - 7*a'^2*b'^(5/2) + 3*b'^5)"
           "/(2*a*b'^(3/2)*(8*a*b'^(3/2)*s'^2 - 8*a*b'^(3/2) + 3*a*r'^2 - 3*b'))",
      "s": "4*a'*b'*s'/(a*(8*a*b'^(3/2)*s'^2 - 8*a*b'^(3/2) + 3*a*r'^2 - 3*b'))",
      "b": "-2*a'*b'^2/(a*(8*a*b'^(3/2)*s'^2 - 8*a*b'^(3/2) + 3*a*r'^2 - 3*b'))"},
     "sqrt(b')*r'^2 + b'^2*s'^2/3 + b'^2 + a'^2/(a*b') + b'^(3/2)/a"),
    ({"r": "r*(2*r'^2 + r'^2/(3*sqrt(a^2 + r^2 + 1)) + 18 + 3/sqrt(a^2 + r^2 + 1))",
      "a": "a*exp(-a')/(3*sqrt(a^2 + r^2 + 1))"},
     "r^2 + r'*atan(r'/3)/3 + sqrt(a^2 + r^2 + 1)/3 + exp(a') - log(r'^2/9 + 1)/2"),
    ({"z": "w*w'*z'/(w^2 + 1)",
      "w": "w*w'^2*(3*w/(2*sqrt(w^2 + 1)) - log(w')/(w^2 + 1) + log(z')/(w^2 + 1) + 1/(w^2 + 1))"},
     "-w^3/2 + sqrt(w^2 + 1)*log(w') - sqrt(w^2 + 1)*log(z')"),
    ({"r": "(-16*a'^(5/2)*r'^2*exp(7*r/3) - 24*a'^(5/2)*exp(r) + 12*a'*r'^4*exp(8*r/3) - 4*a'*r'^2*exp(4*r/3) + 3*a')"
           "*exp(-4*r/3)/(12*a'*(8*a'^(3/2)*exp(r) - 6*r'^2*exp(4*r/3) - 1))",
      "a": "4*a'*r'/(8*a'^(3/2)*exp(r) - 6*r'^2*exp(4*r/3) - 1)"},
     "2*sqrt(a')*r'^2*exp(r/3) + sqrt(a')*exp(-r) + a'^2"),
    ({"r": "(a'^2*b'^2*r'^2 + b'^2*r'^2 + 3*a'^2*exp(r) + 3*exp(r))/(2*b'^2*(a'^2 + 1))",
      "s": "-s'^2*(r + a')/(2*(s + 3)*(r + a'))", "a": "0", "b": "0"},
     "r/b' + b'*r'^2*exp(-r)/3 + (s + 3)*s'^2/2 + a'^2/2"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("equations", "known"),
    MADE_FROM_LAGRANGIANS,
    ids=[
        "products",
        "a cyclic coordinate",
        "factors of f",
        "a root of a sum",
        "parts of exponentials",
        "hidden blocks",
    ],
)
def test_other_functions_of_the_velocities_are_found(equations: dict[str, str], known: str) -> None:
    answer = _answered(equations)
    assert answer.lagrangian is not None
    assert len(to_text(answer.lagrangian.expression)) < 2 * len(known)


def test_nested_roots_that_are_short_sums_are_one_constant() -> None:
    """(2 + sqrt 5)^(1/3) = (1 + sqrt 5)/2."""
    answer = _answered({"x": "(2+sqrt(5))^(1/3)*y' - y^2", "y": "-(1+sqrt(5))/2*x' - 2*x*y"})
    assert answer.lagrangian is not None
    assert same_value(answer.lagrangian.expression, tree("x'^2/2 + y'^2/2 + (1+sqrt(5))/2*x*y' - x*y^2"))


def test_conditions_that_follow_from_others_are_left_out() -> None:
    answer = _answered({"x": "-x - c*x'"}, "c")
    assert answer.lagrangian is not None
    part = lagrangian_part(answer.lagrangian)
    assert part.domain == ["c < 2", "c > 0", "x > 0", "x' > 0"]


def test_the_momentum_of_a_strongly_damped_oscillator_is_one_quotient() -> None:
    """log((a x + 2 v)/(b x + 2 v))/(sqrt(5) x), a and b = 3 -+ sqrt 5."""
    answer = _answered({"x": "-x - 3*x'"})
    assert answer.hamiltonian is not None
    (p,) = answer.hamiltonian.momenta
    assert to_text(p) == "sqrt(5)*(log(3*x - sqrt(5)*x + 2*x') - log(sqrt(5)*x + 3*x + 2*x'))/(5*x)"


# Pairs whose multipliers c1 (dx dy + dy dx) + c2 dy dy are all indefinite: the term with c2 adds nothing but letters.
PAIRS = [
    ({"x": "-sin(y)", "y": "0"}, "x'*y' + cos(y)"),
    ({"x": "-x*y", "y": "-y^2/2"}, "x'*y' - x*y^2/2"),
    ({"x": "-a*y^3", "y": "b"}, "x'*y' + b*x - a*y^4/4"),
]


@pytest.mark.parametrize(("equations", "wanted"), PAIRS)
def test_an_indefinite_form_has_no_term_to_spare(equations: dict[str, str], wanted: str) -> None:
    answer = _answered(equations, "a b")
    assert answer.lagrangian is not None
    assert to_text(answer.lagrangian.expression) == wanted


@pytest.mark.parametrize(
    ("one", "other"),
    [("cos(pi/5)", "(1+sqrt(5))/4"), ("tan(pi/8)", "sqrt(2)-1"), ("sin(pi/12)", "(sqrt(6)-sqrt(2))/4")],
)
def test_constants_that_are_sums_of_roots_are_these(one: str, other: str) -> None:
    answer = _answered({"x": f"{one}*y' - y^2", "y": f"-({other})*x' - 2*x*y"})
    assert answer.lagrangian is not None
    assert same_value(answer.lagrangian.expression, tree(f"x'^2/2 + y'^2/2 + {one}*x*y' - x*y^2"))


# T before the terms linear in velocities, these before the potential: Kepler; a field and a well; a bead on a parabola;
# the relativistic oscillator; a damped one, whose factor stays outside. Quotients of sin and cos are tangents.
ORDERED = [
    ({"r": "r*th'^2 - 1/r^2", "th": "-2*r'*th'/r"}, "r'^2/2 + r^2*th'^2/2 + 1/r"),
    ({"x": "y' - x", "y": "-x' - y"}, "x'^2/2 + y'^2/2 + x*y' - x^2/2 - y^2/2"),
    ({"x": "-(x + 4*x*x'^2)/(1 + 4*x^2)"}, "(4*x^2 + 1)*x'^2/2 - x^2/2"),
    ({"x": "-x*(1 - x'^2)^(3/2)"}, "-sqrt(1 - x'^2) - x^2/2"),
    ({"x": "-x - x'/3"}, "exp(t/3)*(x'^2 - x^2)/2"),
    ({"x": "-a*(1 + tan(x)^2)"}, "x'^2/2 - a*tan(x)"),
    ({"x": "b/cosh(x)^2"}, "x'^2/2 + b*tanh(x)"),
    ({"x": "b*x/cos(x)^2"}, "x'^2/2 + b*(log(cos(x)) + x*tan(x))"),
    ({"x": "b*log(a*x + 1)"}, "x'^2/2 - b*x + b*log(a*x + 1)*(a*x + 1)/a"),
    ({"x": "b/cosh(a*x)^2"}, "x'^2/2 + b*tanh(a*x)/a"),
]


@pytest.mark.parametrize(("equations", "wanted"), ORDERED)
def test_the_kinetic_energy_comes_first(equations: dict[str, str], wanted: str) -> None:
    system = read_system(list(equations), equations, ["a", "b"])
    solution = solve(system, SolveOptions(given=read_given(list(equations), equations, ["a", "b"]).residuals))
    shown = [to_text(a.lagrangian.expression) for a in (solution.autonomous, solution.with_time) if a and a.lagrangian]
    assert wanted in shown
