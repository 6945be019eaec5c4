"""One Lagrangian as books, programs, and sentences write it, and one force with the derivatives of
all notations, are one system.
"""

from __future__ import annotations

import pytest

from inverse_service.service.documents.documents import parse_document
from tests.doors.judge import same_formula

# 2 x'' + x y'' = -2 x y and x x'' + 3 y'' = 7 - x^2 - x'^2.
MOTION = {
    "x": "x*(x^2 + x'^2 - 6*y - 7)/(6 - x^2)",
    "y": "2*(7 - x^2 - x'^2 + x^2*y)/(6 - x^2)",
}
FORMS = [
    "L = x'^2 + 3/2*y'^2 + x*x'*y' - x^2*y + 7*y",
    "L = T - V; T = x'^2 + 3/2 y'^2 + x x' y'; V = x^2 y - 7y",
    "T = x'^2 + 3/2 y'^2 + x x' y', V = x^2 y - 7y",
    "L = T - U where T = x'^2 + 3/2 y'^2 + x x' y' and U = x^2 y - 7y",
    r"L(x, y, \dot{x}, \dot{y}) = \dot{x}^{2} + \tfrac32 \dot{y}^{2} + x \dot{x} \dot{y} - x^{2} y + 7 y",
    r"$$\mathcal{L} = \dot{x}^2 + \frac32\dot{y}^2 + x\dot{x}\dot{y} - x^2y + 7y$$",
    r"S = \int dt \left( \dot x^2 + \frac{3}{2}\dot y^2 + x\dot x\dot y - x^2 y + 7y \right)",
    r"L = \left(\frac{dx}{dt}\right)^2 + \frac{3}{2}\left(\frac{dy}{dt}\right)^2 + x\frac{dx}{dt}\frac{dy}{dt} - x^2 y + 7 y",
    "L = \u1e8b\u00b2 + 3/2 \u1e8f\u00b2 + x \u1e8b \u1e8f - x\u00b2 y + 7 y",
    "L = x_dot^2 + 1.5*y_dot^2 + x*x_dot*y_dot - x^2*y + 7*y",
    "L = xdot**2 + 3*ydot**2/2 + x*xdot*ydot - x**2*y + 7*y",
    "L = diff(x(t),t)^2 + 3/2*diff(y(t),t)^2 + x(t)*diff(x(t),t)*diff(y(t),t) - x(t)^2*y(t) + 7*y(t)",
    "L = D[x[t],t]^2 + 3/2 y'[t]^2 + x[t] D[x[t],t] D[y[t],t] - x[t]^2 y[t] + 7 y[t]",
    "L = 1/2 (2 x'^2 + 3 y'^2 + 2x x' y') - y (x^2 - 7)",
    "The Lagrangian is L = x'^2 + 3/2 y'^2 + x x' y' - x^2 y + 7 y.",
    r"The kinetic energy is $T = \dot{x}^2 + \frac{3}{2}\dot{y}^2 + x\dot{x}\dot{y}$ and the "
    "potential energy is $V = x^2 y - 7y$.",
    r"L = \frac12 \begin{pmatrix}\dot x & \dot y\end{pmatrix}\begin{pmatrix}2 & x\\ x & 3\end{pmatrix}"
    r"\begin{pmatrix}\dot x\\ \dot y\end{pmatrix} - x^2y + 7y",
]  # fmt: skip


@pytest.mark.parametrize("text", FORMS)
def test_a_lagrangian_has_its_equations_in_each_form(text: str) -> None:
    assert_moves(parse_document({"lagrangian": text}), MOTION)


# Of x, of order two and one: x'' = -3 x' + 2 y^2 x and y'' = x' y' - y^3.
DERIVATIVES = {
    "primes": ("{}''", "{}'"),
    "dots of TeX": (r"\ddot {}", r"\dot {}"),
    "dots in braces": (r"\ddot{{{}}}", r"\dot{{{}}}"),
    "names with dots": ("{}_ddot", "{}_dot"),
    "quotients": ("d^2{}/dt^2", "d{}/dt"),
    "quotients of TeX": (r"\frac{{d^2 {0}}}{{dt^2}}", r"\frac{{d {0}}}{{dt}}"),
    "operators of TeX": (r"\frac{{d^2}}{{dt^2}} {0}", r"\frac{{d {0}}}{{dt}}"),
    "diff": ("diff({}, t, 2)", "diff({}, t)"),
    "diff of functions": ("diff({}(t), t, t)", "diff({}(t), t)"),
    "a dollar of Maple": ("diff({}(t), t$2)", "diff({}(t), t)"),
    "D of Maple": ("(D@@2)({})(t)", "D({})(t)"),
    "Mathematica": ("{}''[t]", "{}'[t]"),
    "D of Mathematica": ("D[{}[t], {{t, 2}}]", "D[{}[t], t]"),
    "Derivative of SymPy": ("Derivative({}(t), (t, 2))", "Derivative({}(t), t)"),
    "methods of SymPy": ("{}(t).diff(t, 2)", "{}(t).diff(t)"),
}  # fmt: skip
SEPARATORS = ("; ", "\n", ", ")


@pytest.mark.parametrize("notation", DERIVATIVES)
def test_a_derivative_is_the_same_in_each_notation_and_the_equations_in_each_order(
    notation: str,
) -> None:
    second, first = DERIVATIVES[notation]
    name = (
        "{}[t]" if "[t]" in second else "{}(t)" if "(t)" in second else "{}"
    )  # as the values are written
    (x2, x1, x), (y2, y1, y) = (
        [form.format(letter) for form in (second, first, name)] for letter in "xy"
    )
    equal = " == " if "[t]" in second else " = "
    lines = [
        f"{x2}{equal}-3 {x1} + 2 {y}^2 {x}",
        f"{y2} - {x1} {y1}{equal}- {y}^3",
    ]
    motion = {"x": "-3*x' + 2*y^2*x", "y": "x'*y' - y^3"}
    between = SEPARATORS[[*DERIVATIVES].index(notation) % len(SEPARATORS)]
    for order in (lines, lines[::-1]):
        assert_moves(parse_document({"equations": between.join(order)}), motion)


def assert_moves(found: dict[str, object], motion: dict[str, str]) -> None:
    equations = found["equations"]
    assert isinstance(equations, dict)
    assert equations.keys() == motion.keys()
    for name, meant in motion.items():
        text = equations[name]["text"]
        assert same_formula(text, meant, ("x", "y")), (name, text, meant)
