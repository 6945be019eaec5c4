"""The SymPy objects of users are accepted as they are, and results display in a notebook."""

from __future__ import annotations

import inspect
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import sympy as sp
import sympy.physics.mechanics as me

import inverse_service
from inverse_service.errors import InputError
from inverse_service.sympy import document, from_sympy, solve, solve_many

T = sp.Symbol("t")
C, K, M = sp.symbols("c k m")
X = sp.Function("x")(T)
OSCILLATOR = sp.Eq(M * X.diff(T, 2), -K * X - C * X.diff(T))
Y, U, W = (sp.Function(name)(T) for name in "yuw")
BOOK = sp.exp(C * T / M) * (M * X.diff(T) ** 2 - K * X**2) / 2


@pytest.mark.slow
def test_the_simple_lagrangian_comes_first_as_on_the_command_line() -> None:
    result = solve(OSCILLATOR)
    assert sp.simplify(result.lagrangian - BOOK) == 0
    assert (
        sp.simplify(result.hamiltonian.expr.subs(result.hamiltonian.momenta) - BOOK.subs(K, -K))
        == 0
    )
    assert result.main.lagrangian.has(sp.atan)
    assert result.with_time
    assert result.with_time.lagrangian == result.lagrangian
    for language in ("sympy", "python", "jax", "modelingtoolkit", "julia"):
        assert "atan" not in result.to_code(language)


def test_first_integrals_are_constant_along_the_motion() -> None:
    r, phi, k = sp.Function("r")(T), sp.Function("phi")(T), sp.Symbol("k")
    result = solve({r: r * phi.diff(T) ** 2 - k / r**2, phi: -2 * r.diff(T) * phi.diff(T) / r})
    assert [each.name for each in result.first_integrals][:2] == ["energy", "momentum of phi"]
    for each in result.first_integrals:
        assert sp.simplify(each.expr.diff(T).subs(result.equations)) == 0
        assert each._repr_latex_().startswith("$")
    assert result.first_integrals[0].domain == (sp.Ne(r, 0),)


@pytest.mark.parametrize(
    "system",
    [
        {X.diff(T, 2): -X},
        {X: -X},
        {sp.Eq(X.diff(T, 2), -X)},
        (equation for equation in [X.diff(T, 2) + X]),
        np.array([X.diff(T, 2) + X]),
    ],
    ids=["accelerations", "coordinates", "set", "generator", "array"],
)
def test_equations_are_taken_in_any_shape(system: Any) -> None:
    assert solve(system).lagrangian == X.diff(T) ** 2 / 2 - X**2 / 2


def test_names_may_be_symbols() -> None:
    assert document(sp.Eq(X.diff(T, 2), -K * X), parameters={K: 2})["parameters"] == {"k": 2}
    for several in ([K], (K,), ["k"], ("k",)):
        assert document(sp.Eq(X.diff(T, 2), -K * X), parameters=several)["parameters"] == ["k"]
    assert document({"equations": "x'' = -k*x", "parameters": {K: 2}})["parameters"] == {"k": 2}


def test_a_system_of_bodies_needs_no_equations_formed_before() -> None:
    wall, bead, (q, u) = me.RigidBody("W"), me.Particle("P", mass=M), me.dynamicsymbols("q u")
    system = me.System.from_newtonian(wall)
    system.add_joints(me.PrismaticJoint("J", wall, bead, coordinates=q, speeds=u))
    system.add_loads(me.Force(bead, -K * q * wall.frame.x))
    assert sp.simplify(solve(system).lagrangian - (M * q.diff(T) ** 2 - K * q**2) / 2) == 0


def test_an_expression_with_velocities_alone_is_a_lagrangian() -> None:
    assert solve(X.diff(T) ** 2 / 2 - X**2 / 2)["equations"]
    frame, (q,) = me.ReferenceFrame("N"), me.dynamicsymbols("q:1")
    place = me.Point("O")
    place.set_vel(frame, q.diff(T) * frame.x)
    bead = me.Particle("P", place, M)
    bead.potential_energy = K * q**2 / 2
    assert "lagrangian" in document(me.Lagrangian(frame, bead))


@pytest.mark.slow
def test_numerical_functions_take_their_arguments_by_name() -> None:
    function = solve(OSCILLATOR).lambdify()
    assert list(inspect.signature(function).parameters) == ["t", "x", "x_dot", "c", "k", "m"]
    assert function(t=0, x=1, x_dot=2, c=0, k=1, m=1) == 1.5


def test_what_an_answer_lacks_is_an_input_error_of_one_line() -> None:
    with pytest.raises(InputError) as end:
        solve("x'' = -x - x'^2*y; y'' = -y + x'*y'").lambdify()
    (line,) = end.value._render_traceback_()
    assert "\n" not in line


def test_every_object_has_latex_and_a_result_a_picture() -> None:
    result = solve(OSCILLATOR)
    bundle = result._repr_mimebundle_()
    assert {*bundle} == {"text/plain", "text/latex", "text/html"}
    assert "data:image/png" in bundle["text/html"]
    named = (
        getattr(result, name)
        for name in ("main", "with_time", "equations", "conditions", "hamiltonian")
    )
    for part in (result, result.verify(), *named):
        assert part._repr_latex_().startswith("$")
    for part in (result, result.to_latex(), bundle["text/html"], sp.latex(result)):
        assert "arctan" not in str(part)
    assert result.first_integrals._repr_html_().count("<li>energy") == 1
    assert result.proof[0]._repr_html_() == r"These statements hold where $m \neq 0$."
    assert r"$\frac{\partial L}{\partial \dot{x}} = " in result.proof[1].latex
    assert result.domain._repr_html_() == r"<ol><li>$\displaystyle m \neq 0$</li></ol>"


@pytest.mark.slow
def test_a_motion_is_drawn_from_its_start() -> None:
    axes = solve(sp.Eq(X.diff(T, 2), -X)).plot(start=[1, 0], time=3)
    x, v = axes.lines[0].get_data()
    assert (x[0], v[0]) == (1, 0)
    assert np.allclose([x[-1], v[-1]], [np.cos(3), -np.sin(3)], atol=1e-9)
    with pytest.raises(InputError):
        solve(OSCILLATOR).plot(parameters={"z": 1})


@pytest.mark.slow
def test_many_results_and_a_run_are_tables() -> None:
    pytest.importorskip("pandas")
    assert list(solve_many(["x'' = -x", "x'' = x"]).to_pandas()["verdict"]) == ["variational"] * 2
    scene = {"system": {"equations": {"x": "-x"}}, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
             "step": 0.1, "steps": 5, "methods": [{"method": "reference"}]}  # fmt: skip
    assert len(inverse_service.simulate(scene).to_pandas()) == 1


@pytest.mark.slow
def test_the_program_for_jax_is_python_and_has_the_motion() -> None:
    text = solve(OSCILLATOR).to_code("jax")
    compile(text, "program", "exec")
    if subprocess.run(
        [sys.executable, "-c", "import jax"], capture_output=True, check=False
    ).returncode:
        text = text.replace("import jax\n", "").replace(
            "import jax.numpy as jnp", "import numpy as jnp"
        )
        text = text.replace('jax.config.update("jax_enable_x64", True)', "")
    space: dict[str, Any] = {}
    exec(text, space)
    assert space["vector_field"](0.0, [1.0, 2.0], [0.5, 3.0, 2.0]).tolist() == [2.0, -2.0]
    assert space["lagrangian"](0.0, [1.0, 2.0], [0.5, 3.0, 2.0]) == 2.5


@pytest.mark.slow
def test_the_program_for_modelingtoolkit_declares_all_that_it_uses() -> None:
    text = solve(OSCILLATOR).to_code("modelingtoolkit")
    assert "@parameters c k m" in text
    assert "@variables x(t)" in text
    pendulum = solve("theta'' = -g/L*sin(theta)").to_code("modelingtoolkit")
    assert "hamiltonian = p_theta .^ 2 / 2 - g .* cos(theta) ./ L" in pendulum
    assert "\nL = " not in pendulum
    assert "D(D(D_)) ~" in solve("D'' = -D").to_code("modelingtoolkit")


def test_where_a_lagrangian_holds_is_part_of_the_answer() -> None:
    """L = 1/x' - 2 x for x'' = -x'^3, which itself has values everywhere."""
    solution = solve(sp.Eq(X.diff(T, 2), -(X.diff(T) ** 3)))
    assert solution.lagrangian.subs(X.diff(T), 0).has(sp.zoo)
    assert solution.domain == (sp.Ne(X.diff(T), 0),)


def test_a_potential_that_is_differentiated_twice_is_no_function_of_time() -> None:
    """V''(x(t)) is a derivative by x(t), the time is that of x''(t)."""
    potential = sp.Function("V")(X)
    assert from_sympy._found_time([X.diff(T, 2) + potential.diff(X, 2)]) == T


@pytest.mark.parametrize(
    "words", [("k_{1}", "k_1"), (r"\omega", "omega", "{omega}"), ("s", "~", "#"), ("a b", "ab")]
)
def test_objects_that_are_written_alike_stay_apart(words: tuple[str, ...]) -> None:
    """Each keeps a name of its own in the document, and its place in the equation."""
    letters = [sp.Symbol(word) for word in words]
    force = -sum((n + 2) * letter * X ** (n + 1) for n, letter in enumerate(letters))
    asked = document(sp.Eq(X.diff(T, 2), force))
    assert len(asked["parameters"]) == len({*asked["parameters"]}) == len(letters)
    (equation,) = asked["equations"]
    left, right = equation.replace("^", "**").replace("x''", "0").split("=")
    x = sp.Symbol("x")
    names = {name: sp.Symbol(name) for name in asked["parameters"]}
    powers = sp.Poly(sp.sympify(f"({left}) - ({right})", locals={**names, "x": x}), x)
    held = [abs(powers.coeff_monomial(x ** (n + 1)) / (n + 2)) for n in range(len(letters))]
    assert {one.args[0] for one in held} == {*names.values()}


@pytest.mark.parametrize(
    ("rate", "meant", "exact"),
    [
        (-9.81 * sp.sin(X) / 0.5, "-19.62*sin(x)", -sp.Rational(1962, 100) * sp.sin(X)),
        (0.1 * X + 0.2 * X, "0.3*x", sp.Rational(3, 10) * X),
        (-(X**2.0), "-x^2", -(X**2)),
        (X**0.5, "sqrt(x)", sp.sqrt(X)),
        ((X - 0.5) ** -3.0, "1/(x - 1/2)^3", (X - sp.Rational(1, 2)) ** -3),
        (6.674e-11 * X, "3337*x/50000000000000", sp.Rational(6674, 10**14) * X),
    ],
)
def test_a_float_is_the_decimal_number_that_it_shows(rate: Any, meant: str, exact: Any) -> None:
    answer = solve([sp.Eq(X.diff(T, 2), rate)])
    assert answer["system"]["equations"]["x"] == meant
    found = answer.lagrangian
    euler_lagrange = (found.diff(X.diff(T)).diff(T) - found.diff(X)).subs(X.diff(T, 2), exact)
    assert not found.atoms(sp.Float)
    assert sp.simplify(euler_lagrange) == 0


@pytest.mark.parametrize(
    ("rate", "shown"),
    [(-X / 3.0, "0.333333333333333"), (sp.sqrt(2.0) * X, "1.4142135623731"), (sp.pi.n() * X, "3.14159265358979"),
     (sp.Float("0.1234567890123") * X, "0.1234567890123")],
)  # fmt: skip
def test_a_float_that_is_rounded_is_refused(rate: Any, shown: str) -> None:
    with pytest.raises(InputError, match="is a rounded number: write the exact one") as caught:
        solve([sp.Eq(X.diff(T, 2), rate)])
    assert shown in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "further", "meant"),
    [
        (([X, U], [U, -sp.sin(X)]), {}, {"x": "-sin(x)"}),
        (([X, U], [U, -K * X]), {"mass_matrix": sp.diag(1, M)}, {"x": "-k*x/m"}),
        (([X, U], [-K * X]), {"mass_matrix": sp.Matrix([M]), "coordinate_derivatives": sp.Matrix([U])}, {"x": "-k*x/m"}),
        (([X, Y, U, W], [U, W, -X * Y**2, -Y * X**2]), {"coord_idxs": [0, 1], "speed_idxs": [2, 3]},
         {"x": "-y^2*x", "y": "-x^2*y"}),
    ],
)  # fmt: skip
def test_a_symbolic_system_of_sympy_is_read(arguments: Any, further: Any, meant: Any) -> None:
    states, rates = arguments
    answer = solve(me.system.SymbolicSystem(states, sp.Matrix(rates), **further))
    assert answer["system"]["equations"] == meant
    assert answer["verdict"] == "variational"


def test_a_symbolic_system_with_constraints_is_sent_to_nonholonomic() -> None:
    system = me.system.SymbolicSystem(
        [X, U], sp.Matrix([U, -X]), mass_matrix=sp.eye(2), alg_con=[1]
    )
    with pytest.raises(InputError, match=r"give L, see nonholonomic\(\)"):
        solve(system)
