"""Programs of a SymPy user from the API description; SymPy itself tests each answer."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys

import pytest
import sympy as sp
from sympy.calculus.euler import euler_equations
from sympy.physics.mechanics import (
    KanesMethod,
    LagrangesMethod,
    Particle,
    Point,
    ReferenceFrame,
    dynamicsymbols,
)
from sympy.physics.mechanics.models import n_link_pendulum_on_cart

import inverse_service
from inverse_service.errors import InputError
from inverse_service.sympy import (
    document,
    from_result,
    helmholtz,
    nonholonomic,
    solve,
    solve_many,
    table,
)

t = sp.Symbol("t")
x, y, r, phi, theta = (sp.Function(name)(t) for name in ("x", "y", "r", "phi", "theta"))
omega, k, m, g, length, c = sp.symbols("omega k m g l c")


def test_2_expressions_that_are_zero() -> None:
    found = solve([x.diff(t, 2) + k * x - k * y, y.diff(t, 2) + k * y - k * x])
    assert found.is_variational is True
    assert found.verify().holds is True


def test_4_plain_symbols_with_their_velocities() -> None:
    X, Y, vx, vy = sp.symbols("x y v_x v_y")
    found = solve({X: -X * vy, Y: X * vx}, velocities={X: vx, Y: vy}).lagrangian
    assert found.free_symbols <= {X, Y, vx, vy}
    assert found.diff(vx, 2) != 0


def double_pendulum() -> tuple[sp.Expr, list[sp.Expr]]:
    q1, q2 = dynamicsymbols("q1 q2")
    v1, v2 = q1.diff(dynamicsymbols._t), q2.diff(dynamicsymbols._t)
    kinetic = m * length**2 * (2 * v1**2 + v2**2 + 2 * v1 * v2 * sp.cos(q1 - q2)) / 2
    return kinetic + m * g * length * (2 * sp.cos(q1) + sp.cos(q2)), [q1, q2]


@pytest.mark.slow
def test_5_lagranges_method_gives_its_lagrangian_back_up_to_a_factor() -> None:
    lagrangian, q = double_pendulum()
    ratio = sp.simplify(solve(LagrangesMethod(lagrangian, q)).lagrangian / lagrangian)
    assert ratio.is_constant()
    assert ratio != 0


@pytest.mark.slow
def test_6_kanes_method_of_a_damped_mass() -> None:
    q, u = dynamicsymbols("q u")
    frame, point = ReferenceFrame("N"), Point("P")
    point.set_vel(frame, u * frame.x)
    method = KanesMethod(frame, q_ind=[q], u_ind=[u], kd_eqs=[q.diff() - u])
    method.kanes_equations([Particle("p", point, m)], [(point, (-k * q - c * u) * frame.x)])
    found = solve(method)
    assert found.lagrangian.free_symbols >= {m, k, c}
    assert sp.simplify(next(iter(found.equations.values())) - (-k * q - c * q.diff()) / m) == 0


@pytest.mark.slow
def test_the_pendulum_on_a_cart_that_sympy_builds_has_the_lagrangian_of_its_mass_matrix() -> None:
    method = n_link_pendulum_on_cart(3, cart_force=False)
    speeds = [q.diff() for q in method.q]
    hessian = sp.hessian(solve(method).lagrangian, speeds)
    assert (hessian - method.mass_matrix).expand(trig=True) == sp.zeros(4)


@pytest.mark.slow
def test_a_lagranges_method_with_constraints_is_asked_as_its_lagrangian_and_they_are() -> None:
    kinetic, skate = (
        (x.diff(t) ** 2 + y.diff(t) ** 2 + theta.diff(t) ** 2) / 2,
        x.diff(t) * sp.sin(theta) - y.diff(t),
    )
    asked = document(LagrangesMethod(kinetic, [x, y, theta], nonhol_coneqs=[skate]))
    found = nonholonomic(kinetic, [skate], associated="any")
    assert found["system"]["given"]["constraints"] == asked["constraints"]
    assert asked["coordinates"] == ["x", "y", "theta"]
    damped = LagrangesMethod(
        kinetic, [x, y, theta], nonhol_coneqs=[skate], forcelist=[(Point("P"), 0)]
    )
    with pytest.raises(InputError, match="forces and constraints"):
        document(damped)


@pytest.mark.slow
def test_a_damped_pendulum_shows_the_lagrangian_that_there_is_though_it_contains_the_time() -> None:
    found = solve(theta.diff(t, 2) + c * theta.diff(t) + k * sp.sin(theta))
    assert found.main.lagrangian is None
    assert (
        sp.simplify(found.lagrangian - sp.exp(c * t) * (theta.diff(t) ** 2 / 2 + k * sp.cos(theta)))
        == 0
    )
    assert found.verify().holds


def test_7_euler_equations_of_the_answer() -> None:
    found = solve({x: -(x**3)})
    equation = euler_equations(found.lagrangian, [x], [t])[0]
    assert sp.simplify(equation.lhs.subs(x.diff(t, 2), -(x**3))) == 0


def test_8_an_arbitrary_potential() -> None:
    V = sp.Function("V")
    found = solve({x: -V(x, y).diff(x), y: -V(x, y).diff(y)})
    p_x, p_y = sp.symbols("p_x p_y")
    assert sp.simplify(found.hamiltonian.expr - p_x**2 / 2 - p_y**2 / 2 - V(x, y)) == 0
    assert len(found.hamiltonian.equations()) == 4


def test_a_potential_may_depend_on_the_time() -> None:
    V = sp.Function("V")
    for potential in (V(x, t), V(t, x), V(x, 2 * t)):
        found = solve({x: -potential.diff(x)})
        assert sp.simplify(found.lagrangian - x.diff(t) ** 2 / 2 + potential) == 0
        assert found.verify().euler_lagrange == (0,)
    with pytest.raises(InputError, match="more arguments"):
        document({x: V(x, t, x**2)})


def test_9_numbers_from_the_answer() -> None:
    found = solve(
        [
            r.diff(t, 2) - r * phi.diff(t) ** 2 + k / r**2,
            phi.diff(t, 2) + 2 * r.diff(t) * phi.diff(t) / r,
        ]
    )
    f = sp.lambdify([r, phi, r.diff(t), phi.diff(t), k], found.lagrangian)
    assert f(1, 0, 0.1, 1, 1) == pytest.approx(1.505)
    assert found.lambdify()(0, 1, 0, 0.1, 1, 1) == pytest.approx(1.505)
    assert found.multiplier == sp.ImmutableMatrix([[1, 0], [0, r**2]])


@pytest.mark.slow
def test_10_a_proof_that_there_is_none_in_a_notebook() -> None:
    found = solve([sp.Eq(x.diff(t, 2), x**2 + y**2), sp.Eq(y.diff(t, 2), 0)])
    assert found.is_variational is False
    assert found.lagrangian is None
    assert "<summary>Proof</summary>" in found._repr_html_()
    assert len(found.proof) >= 2
    with pytest.raises(ValueError, match="no Lagrangian"):
        found.verify()


@pytest.mark.slow
def test_11_a_rolling_disk() -> None:
    R, inertia, other = sp.symbols("R I J")
    kinetic = (
        m / 2 * (x.diff(t) ** 2 + y.diff(t) ** 2)
        + inertia / 2 * theta.diff(t) ** 2
        + other / 2 * phi.diff(t) ** 2
    )
    constraints = [
        x.diff(t) - R * sp.cos(phi) * theta.diff(t),
        sp.Eq(y.diff(t), R * sp.sin(phi) * theta.diff(t)),
    ]
    found = nonholonomic(kinetic, constraints, [phi, theta, x, y], associated="second")
    assert found.is_variational is True
    assert found.lagrangian.has(x.diff(t))
    assert list(found.associated) == ["second"]


def test_matrices_and_tuples_are_lists_of_equations() -> None:
    zeros = [x.diff(t, 2) + y, y.diff(t, 2) + x]
    assert (
        solve(sp.Matrix(zeros)).lagrangian
        == solve(tuple(zeros)).lagrangian
        == inverse_service.solve(zeros).lagrangian
    )


def test_time_and_names_may_be_anything() -> None:
    tau, odd = sp.Symbol("tau"), sp.Symbol(r"\lambda_{0}")
    z = sp.Function("t")(tau)
    found = solve(sp.Eq(z.diff(tau, 2), -odd * z * tau))
    assert sp.simplify(found.lagrangian - (z.diff(tau) ** 2 / 2 - odd * tau * z**2 / 2)) == 0
    S, E = sp.symbols("S E")
    assert solve({x: -S * E * x}).lagrangian.free_symbols >= {S, E}


def test_the_tensors_alone() -> None:
    found = helmholtz([x.diff(t, 2) + y.diff(t), y.diff(t, 2) - x])
    assert (found.Phi.shape, found.R.shape) == ((2, 2), (2, 2, 2))
    assert sp.ImmutableMatrix([[0, sp.Rational(1, 2)], [0, 0]]) == found.N
    assert [
        helmholtz(x.diff(t, 2) + x * sp.Heaviside(x)).Phi[0].subs(x, place) for place in (-3, 3)
    ] == [0, 2]


@pytest.mark.slow
def test_many_systems_and_their_table() -> None:
    systems = [
        sp.Eq(x.diff(t, 2), -x),
        "x'' = -x - x'",
        "x'' = 1/2x",
        {"equations": {"x": "x^2 + y^2", "y": "0"}},
    ]
    systems += ["x'' = -Heaviside(x)"]
    found = list(solve_many(systems))
    assert found[0].lagrangian is not None
    assert found[2]["error"]["status"] == 422
    rows = table([found[0], found[1], found[3], found[4]])
    rows = rows if isinstance(rows, list) else rows.to_dict("records")
    assert [row["verdict"] for row in rows] == [
        "variational",
        "variational",
        "not_variational",
        "variational",
    ]
    assert [(row["domain"], row["cells"]) for row in rows] == [
        ("", 1),
        ("", 1),
        ("", 1),
        ("x > 0", 2),
    ]
    assert rows[1]["L"] == "exp(t)*(x'^2 - x^2)/2"


def test_first_order_pairs_are_read_as_their_text_is() -> None:
    """x' = y, y' = -x is x'' = -x, or y'' = -y on request."""
    pair = [sp.Eq(x.diff(t), y), sp.Eq(y.diff(t), -k * x)]
    for found, moving in ((solve(pair), x), (solve(pair, coordinates=[y]), y)):
        assert found.accelerations == (-k * moving,)
        assert sp.expand(found.lagrangian - moving.diff(t) ** 2 / 2 + k * moving**2 / 2) == 0
        assert found.verify().holds is True
    assert helmholtz(pair).Phi == helmholtz([sp.Eq(x.diff(t, 2), -k * x)]).Phi
    assert document(pair)["equations"] == ["-y + x' = 0", "k*x + y' = 0"]


REFUSED = [
    ([sp.Eq(x.diff(t, 2), -x / 3.0)], "rounded"),
    ([sp.Eq(x.diff(t, 2), -sp.I * x)], "complex"),
    ([x.diff(t, 2) + sp.Piecewise((x, sp.sin(x) > 0), (0, True))], "polynomials"),
    ([x.diff(t, 2) + y.diff(t)], "first derivative only"),
    ([x.diff(t) + x], "second order"),
    ([x.diff(t, 3) + x], "third derivative"),
    ([sp.Derivative(x, (t, sp.Symbol("n"))) + x], "order"),
    ([x.diff(t, 2) + sp.Function("x")(t - 1)], "without a delay"),
    ([x.diff(t, 2) + sp.Function("x")(0)], "x(0) occurs together"),
    ([x.diff(t, 2) + sp.Function("x", positive=True)(t)], "two functions are called x"),
    ([x.diff(t, 2) + sp.Symbol("x") * x], "the symbol x occurs together"),
    ([x.diff(t, 2) + sp.Symbol("a", imaginary=True) * x], "not real"),
    ([x.diff(t, 2) + sp.Symbol("a", commutative=False) * x], "not real"),
    ([x.diff(t, 2) + sp.Symbol("GoldenRatio") * sp.GoldenRatio * x], "GoldenRatio occurs"),
    ([sp.Ne(x.diff(t, 2), -x)], "comparison"),
    (None, "not a SymPy expression"),
    ([x.diff(t, 2) + sp.Symbol("a") * x + sp.Symbol("a", positive=True)], "other assumptions"),
    ([x.diff(t, 2) + sp.zeta(x)], "zeta"),
    ([sp.true], "True or False"),
    ({sp.Symbol("x"): -sp.Symbol("x")}, "plain symbol"),
]


@pytest.mark.parametrize(("system", "fragment"), REFUSED)
def test_ambiguous_input_is_rejected(system: object, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        solve(system)
    assert fragment in caught.value.detail


def test_equations_of_matrices_and_derivatives_of_products_are_carried_out() -> None:
    found = solve(sp.Eq(sp.Matrix([x, y]).diff(t, 2), sp.Matrix([-y, -x])))
    assert list(found.equations.values()) == [-y, -x]
    held = sp.Derivative(m * x.diff(t), t) + sp.UnevaluatedExpr(-x - k * x)
    assert list(solve(sp.Eq(held, -x - 2 * k * x)).equations.values()) == [-k * x / m]


@pytest.mark.slow
@pytest.mark.parametrize("force", [sp.exp(-(x**2)), x**x, sp.Function("f")(x), sp.sin(x) / x])
def test_a_lagrangian_with_an_integral_is_an_expression_that_sympy_differentiates(
    force: sp.Expr,
) -> None:
    found = solve(sp.Eq(x.diff(t, 2), -force))
    (name,) = found["integrals"]
    assert str(found.lagrangian.diff(x)) == str(-force)
    assert name in str(found.lagrangian)
    assert found.verify().holds is True
    assert found["system"]["functions"] == ({"f": ["x"]} if "f(" in str(force) else {})
    assert printed(found.to_code("sympy")) == "[0]\n"


def test_the_potential_of_any_central_force_is_a_function_that_sympy_differentiates() -> None:
    F, square = sp.Function("F"), x**2 + y**2
    found = solve({x: -x * F(square), y: -y * F(square)})
    assert found.lagrangian.diff(x) == -x * F(square)
    assert found.lagrangian.diff(y) == -y * F(square)
    assert found.verify().holds is True
    assert printed(found.to_code("sympy")) == "[0, 0]\n"


def printed(program: str) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(program, {})
    return said.getvalue()


def test_texts_among_objects_are_not_evaluated() -> None:
    with pytest.raises(InputError, match="text"):
        solve({x: "__import__('os').system('true')"})


def test_a_result_is_a_mapping() -> None:
    found = inverse_service.solve("x'' = -x")
    assert found["verdict"] == found.verdict == "variational"
    assert json.loads(found.to_json()) == found.to_dict()
    assert dict(from_result(found.to_dict())) == found.to_dict()
    assert found.check()["verdict"] == "valid"
    assert "\\begin{aligned}" in found._repr_latex_()
    assert bool(found)


@pytest.mark.parametrize(
    "given", ["x'' = -x", ["x'' = -x"], {"x": "-x"}, "sho", '{"equations": {"x": "-x"}}']
)
def test_solve_takes_texts_lists_and_accelerations(given: object) -> None:
    assert inverse_service.solve(given)["system"]["equations"] == {"x": "-x"}


def test_names_of_a_result_may_be_given() -> None:
    position = sp.Symbol("x", positive=True)
    found = from_result(
        inverse_service.solve({"equations": "x'' = -k*x", "parameters": ["k"]}), {"k": k, "x": x}
    )
    assert found.lagrangian.free_symbols == {t, k}
    assert position not in found.lagrangian.free_symbols
    assert document(sp.Eq(x.diff(t, 2), -k * x))["parameters"] == ["k"]


GROUND = """
import sympy
from sympy.external.gmpy import GROUND_TYPES
from inverse_service.sympy import solve
t = sympy.Symbol("t"); x, y = sympy.Function("x")(t), sympy.Function("y")(t); a = sympy.Symbol("a")
found = solve([x.diff(t, 2) + a*x - y/3, y.diff(t, 2) + y - x/3])
assert found.verify().holds is True
assert "accelerations" in found.to_code("python")
print(GROUND_TYPES)
"""


@pytest.mark.slow
@pytest.mark.parametrize("types", ["python", "flint"])
def test_the_bridge_works_under_both_ground_types(types: str) -> None:
    environment = {**os.environ, "SYMPY_GROUND_TYPES": types}
    run = subprocess.run(
        [sys.executable, "-c", GROUND], capture_output=True, text=True, check=False, env=environment
    )
    assert (run.returncode, run.stdout.strip()) == (0, types), run.stderr


LAZY = """
import sys, inverse_service
from inverse_service import sympy, InputError, Client, catalogue
found = inverse_service.solve("x'' = -x")
assert found.verdict == "variational" and "sympy" not in sys.modules
found.lagrangian
assert "sympy" in sys.modules
"""


@pytest.mark.slow
def test_sympy_is_imported_by_the_first_expression_only() -> None:
    run = subprocess.run([sys.executable, "-c", LAZY], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_nothing_sets_the_ground_types_of_the_user() -> None:
    before = os.environ.get("SYMPY_GROUND_TYPES")
    solve(sp.Eq(x.diff(t, 2), -x)).verify()
    assert os.environ.get("SYMPY_GROUND_TYPES") == before


def test_the_second_derivative_of_a_function_is_not_an_acceleration() -> None:
    result = inverse_service.solve({"equations": "x'' = -V''(x)", "functions": ["V(x)"]})
    assert list(result.equations.values()) == list(result.accelerations)
    assert result.verify().holds


def test_helmholtz_is_a_function_after_its_first_call() -> None:
    first, second = (inverse_service.sympy.helmholtz(sp.Eq(x.diff(t, 2), -x)) for _ in range(2))
    assert first == second


def test_keys_next_to_a_text_are_used() -> None:
    assert (
        solve("y'' = -x*y", time="x").lagrangian
        == inverse_service.solve("y'' = -x*y", time="x").lagrangian
    )
    assert document(["x'' = -x"], family=True) == {"equations": ["x'' = -x"], "family": True}
    assert solve(["x'' = -k*x"], parameters=["k"]).is_variational is True
    assert solve("x'' = -x", foo=1)["ignored"] == ["foo"]
    position, speed = sp.symbols("x v_x")
    assert inverse_service.solve(
        {position: -position}, velocities={position: speed}
    ).lagrangian.has(speed)


@pytest.mark.parametrize(
    ("coordinates", "reason"),
    [(["x"], "not a SymPy object"), ([y], "has no acceleration"), (y, "has no acceleration")],
)
def test_invalid_coordinates_are_rejected(coordinates: list[object], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        solve({x: -x}, coordinates)


def test_helmholtz_takes_what_solve_takes() -> None:
    tau = sp.Symbol("tau")
    clock = sp.Function("t")(tau)
    assert (
        helmholtz({clock: clock**2 - tau * clock.diff(tau)}).Phi[0] == -(tau**2) / 2 - 4 * clock - 1
    )
    assert helmholtz("y'' = -x*y", time="x").Phi[0] == 2 * sp.Symbol("x")
    assert helmholtz({"equations": "t'' = t^2", "time": "tau"}).Phi[0] == -4 * clock


@pytest.mark.slow
def test_many_systems_keep_errors_in_their_places() -> None:
    first, second, third = solve_many(
        ["sho", {x: -sp.Float(1) / 3 * x}, {"equations": "x'' = -k*x", "parameters": ["k"]}]
    )
    assert first["verdict"] == third["verdict"] == "variational"
    assert second["detail"] == second["error"]["detail"]
    assert "0.333333333333333 is a rounded number" in second["detail"]
