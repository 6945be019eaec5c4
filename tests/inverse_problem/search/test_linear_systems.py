"""Linear systems get Lagrangians that hold to 40 digits, and only where there are any."""

from __future__ import annotations

import random
import time
from collections.abc import Sequence

import mpmath
import pytest

from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.ladder import holds_numerically
from inverse_service.inverse_problem.search.linear_systems.linear_terms import linear_system
from inverse_service.inverse_problem.search.linear_systems.modes import invariant_multipliers
from inverse_service.inverse_problem.search.linear_systems.time_dependent import is_linear
from inverse_service.inverse_problem.search.material import gather
from inverse_service.inverse_problem.search.one_coordinate.algebra import even_root
from inverse_service.inverse_problem.search.reductions import is_damped
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, hessian
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import proposed

LINEAR, DAMPING = "linear systems, multipliers in t alone", "uniform damping, e^(ct) L_0"

DAMPED = {
    "isotropic": ({"x": "-g*x'-x", "y": "-g*y'-y"}, "g"),
    "proportional": ({"x": "-(2*x'-y') - (2*x-y)", "y": "-(2*y'-x') - (2*y-x)"}, ""),
    "charged": ({"x": "-x'+y'-x", "y": "-x'-y'-y"}, ""),
    "golden exponents": ({"x": "-2*x+y-2*x'+y'", "y": "x-y+x'-y'"}, ""),
    "relative damping": ({"x": "-(x-y)-(x'-y')", "y": "-(y-x)-(y'-x')"}, ""),
    "rotor": ({"x": "-x-x'-y", "y": "-4*y-y'+x"}, ""),
    "two rates": ({"x": "-x'-x", "y": "-2*y'-3*y"}, ""),
    "a Jordan block": ({"x": "-x'-y'-x", "y": "-y'-y"}, ""),
    "a Jordan block of size 3": ({"x": "-x'-y'", "y": "-y'-z'", "z": "-z'"}, ""),
    "symbolic symmetric": ({"x": "-(a+b)*x'+b*y'-(k+h)*x+h*y", "y": "-(a+b)*y'+b*x'-(k+h)*y+h*x"}, "abkh"),
    "symbolic rotation": ({"x": "a*x'+b*y'-x", "y": "-b*x'+a*y'-y"}, "ab"),
    "symbolic golden": ({"x": "-2*c*x+c*y-2*d*x'+d*y'", "y": "c*x-c*y+d*x'-d*y'"}, "cd"),
    "forced": ({"x": "-(k*x+h*(x-y))/m-c*x'", "y": "-h*(y-x)/n-c*y'+cos(w*t)/n"}, "khmncw"),
    "parametric": ({"x": "-x'-t*x+y", "y": "-y'-t*y+x"}, ""),
    "one coordinate": ({"x": "-c*x'-k*x/m+F*cos(w*t)"}, "ckmFw"),
}
UNDAMPED = {
    "free": ({"x": "0", "y": "0"}, ""),
    "circulatory": ({"x": "-y", "y": "x"}, ""),
    "gyroscopic": ({"x": "2*W*y'-x", "y": "-2*W*x'-y"}, "W"),
    "coupled": ({"x": "-(k*x+h*(x-y))/m", "y": "-h*(y-x)/n"}, "khmn"),
}
WITHOUT = {
    "non-proportional": {"x": "-x'-3*x", "y": "-x'-2*y'-x-5*y"},
    "anisotropic gyroscopic": {"x": "y'-x'-x", "y": "-x'-y'-4*y"},
}


def proposals(equations: dict[str, str], parameters: Sequence[str], with_time: bool) -> Sequence[Expression]:
    system = read_system(list(equations), equations, tuple(parameters))
    return proposed(gather(analyze(system), with_time), LINEAR)


def assert_is_lagrangian(system: SecondOrderSystem, tree: Expression) -> None:
    """Residuals vanish to 40 digits at a random point where all names are positive, det g does not."""
    generator = random.Random(to_text(tree))
    names: list[Expression] = [
        *map(Symbol, (*system.coordinates, *system.parameters)),
        *map(Velocity, system.coordinates),
        TIME,
    ]
    with mpmath.workdps(60):
        table = {name: mpmath.mpf(generator.randrange(100, 999)) / 500 for name in names}
        for residual in euler_lagrange_residual(tree, system.coordinates, system.accelerations):
            assert abs(evaluate(residual, table)) < mpmath.mpf(10) ** -40
        form = hessian(tree, system.coordinates)
        matrix = mpmath.matrix([[evaluate(entry, table) for entry in row] for row in form])
        assert abs(mpmath.det(matrix)) > mpmath.mpf(10) ** -15


@pytest.mark.parametrize("name", DAMPED)
def test_damped_and_forced_systems_have_lagrangians_with_time(name: str) -> None:
    equations, parameters = DAMPED[name]
    found = proposals(equations, parameters, with_time=True)
    assert found
    for tree in found:
        assert_is_lagrangian(read_system(list(equations), equations, tuple(parameters)), tree)


@pytest.mark.parametrize("name", UNDAMPED)
def test_undamped_systems_have_lagrangians_without_time(name: str) -> None:
    equations, parameters = UNDAMPED[name]
    found = proposals(equations, parameters, with_time=False)
    assert found
    for tree in found:
        assert all(node != TIME for node in walk(tree))
        assert_is_lagrangian(read_system(list(equations), equations, tuple(parameters)), tree)


def test_numbers_alone_tell_a_wrong_lagrangian() -> None:
    analysis = analyze(read_system(["x"], {"x": "-x"}))
    right, wrong, singular = (parse(text, Names(("x",))) for text in ("x'^2/2-x^2/2", "x'^2/2-x^2/2+x^3/10^20", "x*x'"))
    assert holds_numerically(analysis, right, 1)
    assert not holds_numerically(analysis, wrong, 1)
    assert not holds_numerically(analysis, singular, 1)


UNIFORMLY_DAMPED = {
    "Henon-Heiles": ({"x": "-x-2*x*y-2*g*x'/m", "y": "-y-x^2+y^2-2*g*y'/m"}, "gm"),
    "Kepler": ({"r": "r*p'^2-1/r^2-c*r'", "p": "-2*r'*p'/r-c*p'"}, "c"),
    "sphere": ({"a": "sin(a)*cos(a)*b'^2-(c+d)*a'-sin(a)", "b": "-2*a'*b'*cos(a)/sin(a)-(c+d)*b'"}, "cd"),
    "damping that fades": ({"x": "-sin(x)-k*sin(x-y)-c*x'/t", "y": "-sin(y)-k*sin(y-x)-c*y'/t"}, "ck"),
    "driven": ({"x": "-sin(x)-y-c*x'+cos(t)", "y": "-x-c*y'"}, "c"),
}


@pytest.mark.parametrize("name", UNIFORMLY_DAMPED)
def test_uniform_damping_multiplies_the_lagrangian_by_an_exponential(name: str) -> None:
    equations, parameters = UNIFORMLY_DAMPED[name]
    system = read_system(list(equations), equations, tuple(parameters))
    material = gather(analyze(system), True)
    assert is_damped(material)
    found = proposed(material, DAMPING)
    assert found
    for tree in found:
        assert_is_lagrangian(system, tree)


def test_a_magnetic_term_forbids_uniform_damping() -> None:
    equations = {"x": "2*y'-x^3-x'", "y": "-2*x'-y^3-y'"}
    assert not proposed(gather(analyze(read_system(list(equations), equations)), True), DAMPING)


@pytest.mark.parametrize("name", WITHOUT)
@pytest.mark.parametrize("with_time", [False, True])
def test_nothing_is_proposed_where_every_multiplier_is_singular(name: str, with_time: bool) -> None:
    assert not proposals(WITHOUT[name], (), with_time)


def test_a_damped_system_has_no_constant_multiplier() -> None:
    assert not proposals(DAMPED["isotropic"][0], "g", with_time=False)


def test_the_masses_of_coupled_oscillators_are_found() -> None:
    equations, parameters = DAMPED["forced"]
    text = "exp(c*t)*(m*x'^2/2 + n*y'^2/2 - (k+h)*x^2/2 - h*y^2/2 + h*x*y + y*cos(w*t))"
    expected = parse(text, Names(tuple(equations), tuple(parameters)))
    assert same_value(proposals(equations, parameters, with_time=True)[0], expected)


def test_proportional_damping_gets_a_positive_kinetic_term() -> None:
    equations, _ = DAMPED["proportional"]
    form = hessian(proposals(equations, (), with_time=True)[0], ("x", "y"))
    for moment in (0, 1, 3):
        matrix = mpmath.matrix([[evaluate(entry, {TIME: mpmath.mpf(moment)}) for entry in row] for row in form])
        assert min(mpmath.eigsy(matrix, eigvals_only=True)) > 0


@pytest.mark.parametrize(
    ("equations", "dimension"),
    [
        ({"x": "-x'-x", "y": "-y'-y"}, 3),
        ({"x": "-x'+y'-x", "y": "-x'-y'-y"}, 2),
        ({"x": "-x", "y": "-4*y"}, 2),
        ({"x": "-x'-3*x", "y": "-x'-2*y'-x-5*y"}, 1),
        ({"x": "y'", "y": "x'"}, 3),
    ],
)
def test_the_space_of_multipliers_in_time_has_its_dimension(equations: dict[str, str], dimension: int) -> None:
    system = linear_system(gather(analyze(read_system(list(equations), equations)), True))
    assert system is not None
    assert len(invariant_multipliers(system).basis) == dimension


@pytest.mark.parametrize("force", ["-x^2", "-x*x'", "-t*x'", "-sin(x)", "1/x"])
def test_what_is_not_linear_is_left_to_others(force: str) -> None:
    assert not is_linear(gather(analyze(read_system(["x"], {"x": force})), True))


def test_six_coordinates_take_less_than_three_seconds() -> None:
    names = [f"x{k}" for k in range(6)]
    chain = {}
    for k, name in enumerate(names):
        neighbors = names[max(0, k - 1) : k] + names[k + 1 : k + 2]
        chain[name] = f"-2*{name}-2*{name}'" + "".join(f"+{other}+{other}'" for other in neighbors)
    symbolic = {name: f"-c{k}*{name}'-k{k}*{name}" for k, name in enumerate(names)}
    parameters = [f"{letter}{k}" for letter in "ck" for k in range(6)]
    for equations, constants in ((chain, ()), (symbolic, tuple(parameters))):
        material = gather(analyze(read_system(names, equations, constants)), True)
        began = time.process_time()
        assert proposed(material, LINEAR)
        assert time.process_time() - began < 3


@pytest.mark.parametrize(
    ("radicand", "outside", "inside"),
    [("45/4", "3/2", "5"), ("5*d^2/4", "d/2", "5"), ("8", "2", "2"), ("d^3", "d", "d"), ("a+b", "1", "a+b")],
)
def test_whole_squares_leave_the_radicand(radicand: str, outside: str, inside: str) -> None:
    trees = [parse(text, Names(parameters=("a", "b", "d"))) for text in (radicand, outside, inside)]
    assert [to_text(part) for part in even_root(trees[0])] == [to_text(part) for part in trees[1:]]
