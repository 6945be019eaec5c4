"""What the docstrings of `reading` give as examples is read so: text, and x'' (or that of the first
name) or L.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import errors
from tests.doors import parsing
from tests.doors.judge import same_formula

# Constants are guessed; NAME'' = ... says which coordinate where it is not the first one.
EQUATIONS = {
    "(D^2 + 2 D + 3) x = 0": "-2*x' - 3*x",
    "m D^2 x + c D x + k x = 0": "-(c*x' + k*x)/m",
    "{{x'' == -3 x}, {y'' == x}}": "-3*x",
    "V := x -> x^4; x'' = -diff(V(x), x)": "-4*x^3",
    "x''[t] == -Sin@x[t]": "-sin(x)",
    "m := 2; {m*x'' = -x, y'' = -y}": "-x/2",
    "a = diff(x(t), t, 2); m*a = -k*x(t)": "-k*x/m",
    "x[1]'' = -3*x[2]; x[2]'' = x[1]": "-3*x_2",
    "dsolve({diff(x(t), t, 2) + 5*x(t), x(0) = 1})": "-5*x",
    "m x'' = -k x^2": "-k*x^2/m",
    "D(D(x))(t) = -3*x(t)": "-3*x",
    "Derivative[2][x][t] == -3 x[t]": "-3*x",
    "Subscript[phi, 1]''[t] == -3 Subscript[phi, 1][t]": "-3*phi_1",
    "{x''[t], y''[t]} == {-3 y[t], x[t]}": "-3*y",
    "md^2x/dt^2 = -kx": "-k*x/m",
    "d/dt (m x') = -3 x": "-3*x/m",
    "(d^2/dt^2) x = -3 x": "-3*x",
    "(d/dt)^2 x = -3 x": "-3*x",
    "x'' = -w^2x": "-w^2*x",
    "x'' = -e^(2x)": "-exp(2*x)",
    "x'' = -e^-2t x": "-exp(-2*t)*x",
    "x'' = -x (x^2 + y^2)^-3/2; y'' = 0": "-x/(x^2 + y^2)^(3/2)",
    "x'' = -g/l sin x": "-g*sin(x)/l",
    "x'' = -3/2 x^3": "-3*x^3/2",
    "x'' = -1/2sin x": "-sin(x)/2",
    "x'' = -k/m x": "-k*x/m",
    "x'' = -sin^2 x": "-sin(x)^2",
    "x'' = -sin^2 x a^2": "-sin(x)^2*a^2",
    "theta'' = -g sin theta/l": "-g*sin(theta)/l",
    "m l^2 theta'' = -m g l sin(theta)": "-g*sin(theta)/l",
    r"\ddot x = -\omega^2_0 x": "-omega_0^2*x",
    "x_tt = -3 x + x_t": "-3*x + x'",
    "ddot x = -3 x - dot x": "-3*x - x'",
    "x(t)'' = -3 x(t)": "-3*x",
    "D2x = -3*x - Dx": "-3*x - x'",
    "ddx = -3*x - dx": "-3*x - x'",
    "xdd = -3*x - xd": "-3*x - x'",
    "x_dd = -3*x - x_d": "-3*x - x'",
    "xDDot = -3*x - xDot": "-3*x - x'",
    "F = m x'' = -k x": "-k*x/m",
    "m x'' = F = -k x": "-k*x/m",
    "x'' = -w^2 x (w^2 = k/m)": "-k*x/m",
    "eq := x'' = -3 x": "-3*x",
    "ode := x'' + 3 x": "-3*x",
    "x'' = -3 x; x(0) = 1; x'(0) = 0": "-3*x",
    "dsolve('D2x = -3*x', 'x(0) = 1', 't')": "-3*x",
    "dsolve(x''(t) + 3*x(t), x(t))": "-3*x",
    "x'' = -a x + b y with a, b real constants; y'' = 0": "-a*x + b*y",
    "x'' = -|x|": "-sqrt(x^2)",
    "x''[t] == -\\[Omega]^2 x[t]": "-omega^2*x",
    "theta''[t] == -Sin[theta[t]]": "-sin(theta)",
    "g = 9.81; dydt = [y(2); -g*y(1)]": "-9.81*y_1",
    "du[1] = u[2]; du[2] = -3*u[1]": "-3*u_1",
    "du[1], du[2] = u[2], -3*u[1]": "-3*u_1",
    "x, v = u; du[1] = v; du[2] = -3*x": "-3*x",
    "x = u[1]; v = u[2]; du[1] = v; du[2] = -3*x": "-3*x",
    "x(1)' = x(2); x(2)' = -3*x(1)": "-3*x_1",
    "x(1)' = x(2), x(2)' = -3*x(1)": "-3*x_1",
    "dtheta = omega; domega = -3*sin(theta)": "-3*sin(theta)",
    "dx1 = x2; dx2 = -3*x1; dx = [dx1; dx2]": "-3*x1",
    "dx = [x2; -3*x1]": "-3*x1",
    "dxdt = v; dvdt = -3*x": "-3*x",
    "[t, y] = ode45(@(t, y) [y(2); -3*y(1)], [0 10], [1; 0])": "-3*y_1",
    "r = sqrt(x^2 + y^2); x'' = -x/r^3; y'' = -y/r^3": "-x/(x^2 + y^2)^(3/2)",
    "r = norm(y(1:2)); dy = [y(3:4); -y(1:2)/r^3]": "-y_1/(y_1^2 + y_2^2)^(3/2)",
    "ddu[1] = -3*u[1]": "-3*u_1",
    "y'' = x'; x' = y'": "y'",
    "a, b = 4, 2; x'' = -a*x + b": "-4*x + 2",
    "[a, b] = deal(4, 2); dydt = [y(2); -a*y(1) + b]": "-4*y_1 + 2",
    "x' = x_2; x_2' = -3*x": "-3*x",
    r"\dv[2]{x}{t} = -3x - \dv{x}{t}": "-3*x - x'",
    r"\ddot q_1 = -3 q_1": "-3*q_1",
    r"\ddot{x} + \omega_0^2 x = 0": "-omega_0^2*x",
    r"x^{(2)} = -3x": "-3*x",
    r"\ddot{x} = -\sin[2](x)": "-sin(x)^2",
    r"\ddot{x} = -\ln x": "-log(x)",
    r"\boxed{\ddot{x} = -3x}": "-3*x",
    r"\ddot{\vec r} = -3 \vec r; \vec r = (x, y)": "-3*x",
    "x\u00a8 = -3x": "-3*x",
    "\u00a8x = -3x": "-3*x",
    "x'' = sum([a, b])*x": "(a + b)*x",
}  # fmt: skip
LAGRANGIANS = {
    "L = m x'^2/2 - k x^2/2; p = diff(L, x')": "m*x'^2/2 - k*x^2/2",
    "L = p^2/2m; p = m x'": "m*x'^2/2",
    "L = 1/2m x'^2 - m g x": "m*x'^2/2 - m*g*x",
    "L = m/2x'^2 - V(x)": "m*x'^2/2 - V(x)",
    "L = x'^2/2m - x": "x'^2/(2*m) - x",
    "T = 1/2 m v^2; V = m g x; v = x'": "m*x'^2/2 - m*g*x",
    "x = l sin(theta); y = -l cos(theta); L = m(x'^2 + y'^2)/2 - m g y": "m*l^2*theta'^2/2 + m*g*l*cos(theta)",
    r"L = \sum_{i=1}^{2} \frac{m_i}{2}\dot x_i^2 - x_1 x_2": "m_1*x_1'^2/2 + m_2*x_2'^2/2 - x_1*x_2",
    "V[x_] := k x^2/2; L = m x'^2/2 - V[x]": "m*x'^2/2 - k*x^2/2",
}  # fmt: skip
REFUSED = [
    "x'' = -k (x)", "x'' = -1,5 x", "x'' = -e^-a x", "x'' = -e^-kt/m", "x'' = -1/1+x^2", "x'' = -x^T",
    "x_i'' = -x_i'x_i'", "x'' = -k^2(x)", r"\ddot q^{1} = -q^{23}", "- x'' = x\n- y'' = y",
    "dy = [y(3:4); -y(1:3)]", "dy = [y(3:4); -y(1:2) + y(3:5)]",
    "constraintz' = 0; z'' = 1", "x'' = -3 x (spring", "x'' = -3 x]", "x_tt = u_xx", "x'' = x(t - tau)",
]  # fmt: skip


def of(key: str, text: str) -> Any:
    return parsing.read({key: text, "parameters": "guess"})


@pytest.mark.parametrize("text", EQUATIONS)
def test_an_example_has_its_equation(text: str) -> None:
    found = of("equations", text)
    assert not isinstance(found, errors.InputError), found.detail
    first = found["coordinates"][0]
    names = found["coordinates"]
    assert same_formula(found["equations"][first]["text"], EQUATIONS[text], names), found[
        "equations"
    ]


@pytest.mark.parametrize("text", [text for text in EQUATIONS if "; " in text and "[" not in text])
def test_a_line_end_separates_equations_as_a_semicolon_does(text: str) -> None:
    found, other = (of("equations", one) for one in (text, text.replace("; ", "\n")))
    assert not isinstance(other, errors.InputError), other.detail
    for name, part in found["equations"].items():
        names = found["coordinates"]
        assert same_formula(part["text"], other["equations"][name]["text"], names)


@pytest.mark.parametrize("text", LAGRANGIANS)
def test_an_example_has_its_lagrangian(text: str) -> None:
    found = of("lagrangian", text)
    assert not isinstance(found, errors.InputError), found.detail
    lagrangian = found["lagrangian"]["text"]
    assert same_formula(lagrangian, LAGRANGIANS[text], found["coordinates"]), lagrangian


@pytest.mark.parametrize("text", REFUSED)
def test_an_example_that_has_no_one_meaning_is_refused_at_its_place(text: str) -> None:
    found = of("equations", text)
    assert isinstance(found, errors.InputError), found["equations"]
    assert found.pointer == "/equations"
    assert found.column is None or 1 <= found.column <= len(text) + 1
