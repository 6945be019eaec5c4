"""Systems that are one equation, or several that share nothing, say why they have a Lagrangian."""

import mpmath
import pytest
import sympy

from inverse_service.decision import deciding
from inverse_service.explanation.explaining import of_single_equations
from inverse_service.expressions import notation, printing, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.search import linear_systems, material as mt, reductions
from inverse_service.statements.questions import PLAIN
from tests.values import present

VAN_DER_POL = "(1-x^2)*x'-x"
ROTATED = {"x": "x'-((x^2+y^2)*x'+2*x*y*y')-x", "y": "y'-((x^2+y^2)*y'+2*x*y*x')-y"}
COMPLEX = {"x": "x'-(x^2-y^2)*x'+2*x*y*y'-x", "y": "y'-(x^2-y^2)*y'-2*x*y*x'-y"}

WITH_ITS_VARIATION = {"x": VAN_DER_POL, "y": "(1-x^2)*y'-2*x*y*x'-y"}


def single(equations: dict[str, str]) -> reductions.Smaller | None:
    system = read_system(list(equations), equations)
    return reductions.single_equations(mt.gather_material(deciding.analyze(system), PLAIN), 1)


@pytest.mark.parametrize(
    ("equations", "said"),
    [
        ({"x": VAN_DER_POL, "y": "(1-y^2)*y'-2*y"}, "The system is x'' ="),
        (ROTATED, "With u_1 = x + y and u_2 = x - y the system is u_1'' ="),
        (COMPLEX, "With complex numbers the system is one equation"),
        (WITH_ITS_VARIATION, "With dual numbers the system is one equation"),
    ],
)
def test_single_equations_have_the_lagrangian_of_one_coordinate(
    equations: dict[str, str], said: str
) -> None:
    found = single(equations)
    assert found is not None
    step = of_single_equations(found.systems, found.numbers, found.forms, PLAIN)
    assert step.text.startswith(said)
    assert "v int I/v^2 dv" in step.text


def test_sums_of_the_rotated_pair_are_van_der_pol_oscillators() -> None:
    """By SymPy: (x + y)'' and (x - y)'' are functions of one sum and its velocity each."""
    x, y, u, v = sympy.symbols("x y u v")
    first, second = (
        u - ((x**2 + y**2) * u + 2 * x * y * v) - x,
        v - ((x**2 + y**2) * v + 2 * x * y * u) - y,
    )
    for sign in (1, -1):
        sum_, rate = x + sign * y, u + sign * v
        assert sympy.expand(first + sign * second - ((1 - sum_**2) * rate - sum_)) == 0


@pytest.mark.parametrize(
    ("force", "conserved"),
    [("-v**2", "v*exp(x)"), ("-x", "v**2 + x**2"), ("-x*v**2", "v*exp(x**2/2)")],
)
def test_a_conserved_function_gives_the_lagrangian_that_is_named(
    force: str, conserved: str
) -> None:
    """By SymPy: L = v int I/v^2 dv has the equation v' = f, and the energy I."""
    x, v = sympy.symbols("x v", positive=True)
    f, energy = (sympy.sympify(one, {"x": x, "v": v}) for one in (force, conserved))
    assert sympy.simplify(v * energy.diff(x) + f * energy.diff(v)) == 0
    lagrangian = v * sympy.integrate(sympy.expand(energy / v**2), v)
    slope = lagrangian.diff(v)
    left = v * slope.diff(x) + f * slope.diff(v) - lagrangian.diff(x)
    assert sympy.simplify(left) == 0
    assert sympy.simplify(v * slope - lagrangian - energy) == 0


def test_the_differential_of_an_integral_is_no_partial_derivative() -> None:
    assert notation.to_latex("v int I/v^2 dv").endswith(r"\, dv")
    assert notation.to_latex("v dI/dx").count(r"\partial") == 2


def test_a_coupled_pair_is_none() -> None:
    assert single({"x": "-x-x*y-x'", "y": "-y-x^2-2*y'"}) is None


def test_integrals_of_two_parts_have_names_of_their_own() -> None:
    """F with F' = exp(-x^2) and F with F' = sin(y^2) are two functions in the sum of both L."""
    system = read_system(["x", "y"], {"x": "-x", "y": "-y"})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    (smaller,) = reductions.into_blocks(material, 1)
    parts = [
        ex.Integral(name, (ex.Symbol(of),), (0,), (slope,))
        for name, of, slope in (
            ("F", "x", ex.Apply("exp", -(ex.Symbol("x") ** 2))),
            ("G", "x", ex.Apply("exp", ex.Symbol("x") ** 3)),
            ("F", "y", ex.Apply("sin", ex.Symbol("y") ** 2)),
            ("G", "y", ex.Apply("cos", ex.Symbol("y") ** 4)),
        )
    ]
    (whole,) = smaller.lift([[parts[0] + parts[1]], [parts[2] + parts[3]]])
    found = [node for node in ex.walk(whole) if isinstance(node, ex.Integral)]
    assert {node.slopes for node in found} == {part.slopes for part in parts}
    assert len({node.name for node in found}) == 4


def test_gyroscopic_forces_have_one_equation_for_each_root() -> None:
    """The sum of u' log u' + lambda u over the roots, by SymPy, has the equations q'' = C q'."""
    matrix = sympy.Matrix([[0, 1, -2], [3, 0, -1], [-1, 2, 0]])
    equations = {"x": "y' - 2*z'", "y": "3*x' - z'", "z": "2*y' - x'"}
    system = read_system(list(equations), equations)
    found = present(linear_systems.characteristic_of(system, ex.Symbol("lambda")))
    root = sympy.Symbol("lambda_")
    shown = sympy.sympify(printing.to_text(found).replace("lambda", "lambda_").replace("^", "**"))
    assert sympy.expand(shown - matrix.charpoly(root).as_expr()) == 0
    with mpmath.workdps(40):
        entries = mpmath.matrix(matrix.tolist())
        values, rows = mpmath.eig(entries.T)
        rates, left = mpmath.matrix([2, 3, 5]), mpmath.zeros(1, 3)
        for k, value in enumerate(values):
            w = rows[:, k].T
            # d/dt of w (log u' + 1) is w u''/u', and dL/dq is lambda w.
            left += w * ((w * entries * rates)[0] / (w * rates)[0] - value)
        assert mpmath.norm(left) < mpmath.mpf(10) ** -30


@pytest.mark.parametrize(
    "equations",
    [
        {"x": "y'", "y": "-x'", "z": "z'"},  # factors of degrees 1 and 2
        {"x": "y'", "y": "z'", "z": "0"},  # one multiple root
        {"x": "y' - 2*z' + x", "y": "3*x' - z'", "z": "2*y' - x'"},
        {"x": "x*y' - 2*z'", "y": "3*x' - z'", "z": "2*y' - x'"},
    ],
)
def test_other_systems_have_no_such_roots(equations: dict[str, str]) -> None:
    system = read_system(list(equations), equations)
    assert linear_systems.characteristic_of(system, ex.Symbol("lambda")) is None
