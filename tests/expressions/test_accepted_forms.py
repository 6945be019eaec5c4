"""Every accepted way to write a formula means what the canonical text beside it says."""

from __future__ import annotations

import pytest

from inverse_service.expressions.printing import to_text
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_equations, read_formula

NAMES = Names(
    ("x", "y", "r1", "phi", "theta"),
    ("m", "g", "l", "R", "I", "m1", "s_alpha"),
    {"A": ("r1",), "B": ("x", "y"), "F": ("t",)},
)

TEXT = [
    ("0", "0"),
    ("0.1", "1/10"),
    ("1e-3 + 1.5e2", "150.001"),
    (".5x", "x/2"),
    ("x'", "x'"),
    ("x_dot", "x'"),
    ("xdot", "x'"),
    ("phidot^2", "phi'^2"),
    ("Derivative(x, t)", "x'"),
    ("Derivative(x(t), t)", "x'"),
    ("diff(x, t)", "x'"),
    ("x'(t) + x(t)", "x' + x"),
    ("x''", "x''"),
    ("x_ddot", "x''"),
    ("xddot", "x''"),
    ("Derivative(x, t, t)", "x''"),
    ("Derivative(x, (t, 2))", "x''"),
    ("Derivative(x(t), (t, 2))", "x''"),
    ("diff(x, t, 2)", "x''"),
    ("diff(x, t, t)", "x''"),
    ("diff(diff(x, t), t)", "x''"),
    ("diff(x', t)", "x''"),
    ("diff(x^2*t, t)", "2*x*x'*t + x^2"),
    ("diff(m*x'^2/2, x')", "m*x'"),
    ("diff(x^2*y, x, 2)", "2*y"),
    ("x'^2", "x'^2"),
    ("x\u2032\u2032 + x\u2033 + x\u2019", "x'' + x'' + x'"),
    ("\u1e8b + \u1e8d", "x' + x''"),
    ("-x^2", "-x^2"),
    ("(-x)^2", "(-x)^2"),
    ("x**2", "x^2"),
    ("2^x^2", "2^(x^2)"),
    ("2^3^2", "512"),
    ("x^-2", "1/x^2"),
    ("x^(1/2)", "sqrt(x)"),
    ("x^(-3/2)", "1/x^(3/2)"),
    ("x - -y", "x + y"),
    ("+x", "x"),
    ("x/-y", "-x/y"),
    ("x/y/m", "x/(y*m)"),
    ("x/(y/m)", "x*m/y"),
    ("x/y*m", "x*m/y"),
    ("2x", "2*x"),
    ("2x^2", "2*x^2"),
    ("2(x+y)", "2*(x + y)"),
    ("(x+1)(y+1)", "(x + 1)*(y + 1)"),
    ("2 sin x", "2*sin(x)"),
    ("m g x", "m*g*x"),
    ("m (x + 1)", "m*(x + 1)"),
    ("sin x", "sin(x)"),
    ("sin 2x", "sin(2*x)"),
    ("sin x^2", "sin(x^2)"),
    ("sin^2(x)", "sin(x)^2"),
    ("sin^2 x cos y", "sin(x)^2*cos(y)"),
    ("sin(x)^2", "sin(x)^2"),
    ("sin x * y", "sin(x)*y"),
    ("sin x + y", "sin(x) + y"),
    ("R cos phi theta'", "R*cos(phi)*theta'"),
    ("sin x'", "sin(x')"),
    ("sqrt(x)", "sqrt(x)"),
    ("\u221a(x)", "sqrt(x)"),
    ("cbrt(x)", "x^(1/3)"),
    ("ln x", "log(x)"),
    ("log(x)", "log(x)"),
    ("log10(x)", "log(x)/log(10)"),
    ("log(x, 2)", "log(x)/log(2)"),
    ("arcsin(x) + arctan(y)", "asin(x) + atan(y)"),
    ("arsinh(x) + asinh(x)", "asinh(x) + asinh(x)"),
    ("sec(x) csc(x) cot(x)", "sec(x)*csc(x)*cot(x)"),
    ("e^x", "exp(x)"),
    ("E^(-x)", "exp(-x)"),
    ("pi*x", "pi*x"),
    ("\u03c0 x", "pi*x"),
    ("t*x", "t*x"),
    ("\u03c6 + \u03b8", "phi + theta"),
    ("x\u00b7y \u00d7 m \u2212 g", "x*y*m - g"),
    ("x\u00b2y\u00b3", "x^2*y^3"),
    ("x\u207b\u00b9", "1/x"),
    ("r\u2081", "r1"),
    ("r_1", "r1"),
    ("salpha", "s_alpha"),
    ("I*x", "I*x"),
    ("A", "A(r1)"),
    ("A(r1)", "A(r1)"),
    ("A(x+y)", "A(x + y)"),
    ("A'", "A'(r1)"),
    ("A'(r1)", "A'(r1)"),
    ("A''(2x)", "A''(2*x)"),
    ("diff(A(r1), r1)", "A'(r1)"),
    ("Derivative(A(r1), (r1, 3))", "A'''(r1)"),
    ("diff(A, t)", "A'(r1)*r1'"),
    ("diff(A(x^2), x)", "2*A'(x^2)*x"),
    ("B", "B(x, y)"),
    ("diff(B(x, y), x, y)", "diff(B(x, y), x, y)"),
    ("B[1,1](x, y)", "diff(B(x, y), x, y)"),
    ("B[2,0](x + y, y)", "B[2,0](x + y, y)"),
    ("diff(F(t), t)", "F'(t)"),
    ("A^2(x + 1)*y + A^2", "A(x + 1)^2*y + A(r1)^2"),
    ("x\n + y", "x + y"),
    ("\u2113 x.", "l*x"),
    ("x (diff(y, t) + y(t))", "x*(y' + y)"),
    ("x + 2.", "x + 2"),
]

LATEX = [
    (r"\frac{1}{2} m \dot{x}^2", "m*x'^2/2"),
    (r"\tfrac12 m \dot x^2", "m*x'^2/2"),
    (r"\dfrac{x}{y}", "x/y"),
    (r"\frac{\frac{x}{y}}{m}", "x/(y*m)"),
    (r"\sqrt{x}y", "sqrt(x)*y"),
    (r"\sqrt[3]{x + y}", "(x + y)^(1/3)"),
    (r"\ddot{x} + \ddot\theta", "x'' + theta''"),
    (r"\dot{r}_1 + \dot{r_1} + \dot r_{1}", "r1' + r1' + r1'"),
    (r"x'^{2} \cdot 2", "2*x'^2"),
    (r"x^{\prime} + x^{\prime\prime} + x^{\prime 2}", "x' + x'' + x'^2"),
    (r"\sin x \cos\theta", "sin(x)*cos(theta)"),
    (r"\sin^2 x", "sin(x)^2"),
    (r"\sin^{2}\left(x\right)", "sin(x)^2"),
    (r"R\cos\varphi\,\dot\theta", "R*cos(phi)*theta'"),
    (r"\left( x + y \right)^2", "(x + y)^2"),
    (r"m\left(x + 1\right)", "m*(x + 1)"),
    (r"\left[x\right] \times \{y\}", "x*y"),
    (r"s_{\alpha} + r_{1} + m_1", "s_alpha + r1 + m1"),
    (r"mgl\,\dot x", "m*g*l*x'"),
    (r"\mathrm{e}^{-x} + e^{x y} + e^x y", "exp(-x) + exp(x*y) + exp(x)*y"),
    (r"\operatorname{asinh}(x) + \arctan x", "asinh(x) + atan(x)"),
    (r"\frac{d x}{d t} + \frac{dx}{dt}", "x' + x'"),
    (r"\frac{d^2 x}{dt^2}", "x''"),
    (r"\frac{\mathrm{d}x}{\mathrm{d}t}", "x'"),
    (r"\frac{d^{2} \theta}{d t^{2}}", "theta''"),
    (r"\exp(x) + \ln y + \log(m)", "exp(x) + log(y) + log(m)"),
    (r"2 \pi \; x \quad y \!", "2*pi*x*y"),
    (r"$x^{10}$", "x^10"),
    (r"$$ \frac{x}{2} $$", "x/2"),
    (r"\[ \dot{x} \]", "x'"),
    (r"A'(r_1) + A^{\prime}(r_{1})", "A'(r1) + A'(r1)"),
    (r"{x} {y}", "x*y"),
    (r"A^{2}{\left(x{\left(t \right)} \right)} + \frac{1}{A^{3}{\left(x \right)}}", "A(x)^2 + 1/A(x)^3"),
    (r"m\frac{x}{y} - x\frac{2}{t} + \dot x\frac{1}{t}", "m*x/y - 2*x/t + x'/t"),
    (
        r"A\frac{r_1}{2} + A\sqrt[3]{x} + m\sqrt[3]{x} + A\sqrt{x}",
        "A(r1)*r1/2 + A(r1)*x^(1/3) + m*x^(1/3) + A(r1)*sqrt(x)",
    ),
    (r"\sin\frac{x}{2} + \exp\frac x2", "sin(x/2) + exp(x/2)"),
    (r"\frac{d}{d t} x{\left(t \right)} + \frac{d^{2}}{d t^{2}} \phi{\left(t \right)}", "x' + phi''"),
    (r"\left(\frac{d}{d t} x\right)^{2} \sin^{2}{\left(\phi{\left(t \right)} \right)}", "x'^2*sin(phi)^2"),
    (r"\frac{\partial B}{\partial x} + \frac{\partial^2 B}{\partial y^{2}}", "diff(B(x, y), x) + diff(B(x, y), y, y)"),
    (r"\frac{dA}{dr_1} + \frac{\mathrm dA}{\mathrm d t} + \frac{dF}{dt}", "A'(r1) + A'(r1)*r1' + F'(t)"),
    (r"\sin^{-2} x + \tan(x)^{-1}", "1/sin(x)^2 + 1/tan(x)"),
    (r"x^{''} + y^{'}", "x'' + y'"),
    (r"x \label{eq:1} \tag{1} \notag + y \nonumber", "x + y"),
    (r"x{\left(t \right)} \left(\frac{d}{d t} y{\left(t \right)} + 1\right)", "x*(y' + 1)"),
    (r"x^{2}{\left(t \right)} F{\left(t \right)} \dot y", "x^2*F(t)*y'"),
    (r"\frac{\mathrm{d}}{\mathrm{d}t}\left(t^2\dot x\right) + \frac{d}{dt} (m \dot{y})", "2*t*x' + t^2*x'' + m*y''"),
    (r"x(x - 2m) + m(\dot x - y)", "x*(x - 2*m) + m*(x' - y)"),
    (r"\frac{x(y + 1)}{m} + \dot x(x - y)", "x*(y + 1)/m + x'*(x - y)"),
    (r"\ell \dot\varphi.", "l*phi'"),
    ("\\frac{\u2113}{2}", "l/2"),
    (r"\bigl( x + y \bigr) x_{dot}", "(x + y)*x'"),
    ("\\frac{\u03c6}{2}", "phi/2"),
]

EQUATIONS = [
    ("x'' = -y'; y'' + y = 0", [("x''", "-y'"), ("y'' + y", "0")]),
    ("x'' = -y'\ny'' = 0\n", [("x''", "-y'"), ("y''", "0")]),
    ("x'' = -y', y'' = B(x, y)", [("x''", "-y'"), ("y''", "B(x, y)")]),
    ("x'' = x\n + y\n-m\n-y'' = x", [("x''", "x + y - m"), ("-y''", "x")]),
    ("x'' + x", [("x'' + x", "0")]),
    (r"\begin{aligned} \ddot{x} &= -y \\ \ddot y &= x \end{aligned}", [("x''", "-y"), ("y''", "x")]),
    (r"\left\{\begin{array}{l} \ddot{x} = 1,\\ \ddot y = x \end{array}\right.", [("x''", "1"), ("y''", "x")]),
    (r"\begin{cases} \ddot x = y \\ \ddot y = 0 \end{cases}", [("x''", "y"), ("y''", "0")]),
    (r"\frac{d^{2}}{d t^{2}} x{\left(t \right)} = y; \ddot y = x{\left(t \right)}", [("x''", "y"), ("y''", "x")]),
    ("\\ddot x = \\dot y^2 - y\n\\ddot y = x\n", [("x''", "y'^2 - y"), ("y''", "x")]),
    ("\\ddot x =\n - y\n + x\n\n-\\ddot y = \\frac{x}\n{2}\n", [("x''", "-y + x"), ("-y''", "x/2")]),
    ("\\begin{cases}\n\\ddot x = (x\n + y) \\\\\n\\ddot y &= x\n\\end{cases}", [("x''", "x + y"), ("y''", "x")]),
    ("\\left\\{\\begin{array}{l}\n\\ddot x = y\n\\ddot y = x;\n\\end{array}\\right.", [("x''", "y"), ("y''", "x")]),
    (r"\begin{cases} \ddot x = y,\\[4pt] \ddot y = x \\ [-.5 em] \end{cases}", [("x''", "y"), ("y''", "x")]),
    ("x'' = -x, y'' = -y.", [("x''", "-x"), ("y''", "-y")]),
]


@pytest.mark.parametrize(("formula", "canonical"), TEXT + LATEX)
def test_formula_means_its_canonical_text(formula: str, canonical: str) -> None:
    assert to_text(read_formula(formula, NAMES)) == canonical


@pytest.mark.parametrize("canonical", sorted({canonical for _, canonical in TEXT + LATEX}))
def test_canonical_text_reads_back_to_itself(canonical: str) -> None:
    assert to_text(read_formula(canonical, NAMES)) == canonical


@pytest.mark.parametrize(("text", "sides"), EQUATIONS)
def test_equations_are_cut_where_they_end(text: str, sides: list[tuple[str, str]]) -> None:
    assert [(to_text(left), to_text(right)) for left, right in read_equations(text, NAMES)] == sides


def test_declared_names_win_over_constants_and_derivatives() -> None:
    names = Names(("x",), ("e", "i", "xdot", "gamma"))
    assert to_text(read_formula("e^x + i + xdot + gamma*x'", names)) == "e^x + i + xdot + gamma*x'"


@pytest.mark.parametrize("declared", ["varphi", "varphi_1", "ell", "epsilon_1"])
@pytest.mark.parametrize("command", ["", "\\"])
def test_a_letter_is_known_by_its_command_and_by_its_sound(declared: str, command: str) -> None:
    written = command + {"epsilon_1": "varepsilon_1"}.get(declared, declared) if command else declared
    assert to_text(read_formula(f"2*{written}", Names(("x",), (declared,)))) == f"2*{declared}"


def test_phi_and_varphi_differ_where_both_are_declared() -> None:
    names = Names(("phi", "varphi"))
    assert to_text(read_formula(r"\varphi - \dot\varphi \dot{\phi}", names)) == "varphi - varphi'*phi'"


def test_long_formulas_without_numbers_pass_no_limit_of_digits() -> None:
    assert to_text(read_formula("x(t)" * 1_000, NAMES)) == "x^1000"
    assert to_text(read_formula("-x y " * 600, NAMES)).startswith("-x*y")


def test_numbers_of_200_digits_are_read_back() -> None:
    longest = "9" * 200
    assert to_text(read_formula(f"{longest}*x", NAMES)) == f"{longest}*x"
