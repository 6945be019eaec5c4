"""Two hundred spellings of one formula: every way to write a velocity with every way to write a sine and a product."""

from __future__ import annotations

import itertools

import pytest

from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x",), ("k",))
VELOCITIES = [
    "x'", "x'(t)", "x_dot", "xdot", "diff(x, t)", "diff(x(t), t)", "Derivative(x(t), t)", "x.diff(t)", "x(t).diff(t)",
    "der(x)", "dx/dt", "d/dt(x)", "D(x)(t)", "'diff(x, t)", "\u1e8b", "x\u0307", "x\u2032", "diff(x(t), (t, 1))",
]  # fmt: skip
SINES = ["sin(x)", "sin(x(t))", "sin x", "sp.sin(x)", "np.sin(x)", "sin (x)"]
PRODUCTS = [("", " ", " "), ("", "*", "*"), ("", "\u00b7", "\u00d7")]
LATEX_VELOCITIES = [
    r"\dot x", r"\dot{x}", r"x'", r"x^{\prime}", r"\frac{dx}{dt}", r"\frac{d x}{d t}",
    r"\frac{\mathrm{d}x}{\mathrm{d}t}", r"\frac{d}{d t} x{\left(t \right)}", r"\dot{x}(t)",
]  # fmt: skip
LATEX_SINES = [r"\sin(x)", r"\sin x", r"\sin{\left(x \right)}", r"\sin\left(x\right)", r"\operatorname{sin}(x)"]
LATEX_PRODUCTS = [" ", r" \cdot ", r" \, ", r" \times "]


@pytest.mark.parametrize(("velocity", "sine", "product"), list(itertools.product(VELOCITIES, SINES, PRODUCTS)))
def test_a_spelling_in_plain_text_is_read(velocity: str, sine: str, product: tuple[str, str, str]) -> None:
    _, first, second = product
    if first == " " and velocity[:1] == "'":
        pytest.skip("k 'diff( ... ) is k' to a reader")
    text = f"-k{first}{sine}{second}{velocity}"
    quotient = "/" in velocity
    if sine == "sin x" and (second == " " or quotient):
        text = f"-k{first}({sine}){second}{velocity}"
    assert to_text(read_formula(text, NAMES)) == "-k*sin(x)*x'"


@pytest.mark.parametrize(
    ("velocity", "sine", "product"), list(itertools.product(LATEX_VELOCITIES, LATEX_SINES, LATEX_PRODUCTS))
)
def test_a_spelling_in_latex_is_read(velocity: str, sine: str, product: str) -> None:
    if velocity.startswith(r"\frac{d}") and product in (" ", r" \, "):  # d/dt x(t) sin(x) is refused
        sine = r"\sin(x)" if sine == r"\sin x" else sine
        assert to_text(read_formula(f"-k{product}{sine}{product}{velocity}", NAMES)) == "-k*sin(x)*x'"
    else:
        assert to_text(read_formula(f"-k{product}{velocity}{product}{sine}", NAMES)) == "-k*x'*sin(x)"


WITH_FUNCTIONS = Names(("x", "y"), ("k",), {"A": ("x",), "B": ("x", "y")})
DERIVATIVES = [
    (r"\frac{d}{d x{\left(t \right)}} A{\left(x{\left(t \right)} \right)}", "A'(x)"),
    (r"\frac{d^{2}}{d x{\left(t \right)}^{2}} A{\left(x{\left(t \right)} \right)}", "A''(x)"),
    (r"\frac{d}{dx} A(x)", "A'(x)"),
    (r"B{\left(x{\left(t \right)},y{\left(t \right)} \right)}", "B(x, y)"),
    (r"\frac{d^{2}}{d y{\left(t \right)}d x{\left(t \right)}} B{\left(x{\left(t \right)},y{\left(t \right)} \right)}",
     "diff(B(x, y), x, y)"),
    (r"\frac{\partial}{\partial x} B(x, y)", "diff(B(x, y), x)"),
    (r"\frac{\partial^2 B}{\partial x \partial y} \dot x", "diff(B(x, y), x, y)*x'"),
    (r"\frac{d}{d x} A{\left(x \right)} \frac{d}{d t} x{\left(t \right)}", "A'(x)*x'"),
    (r"\frac{\mathrm{d}}{\mathrm{d}x} \left(x^2\right)", "2*x"),
    (r"\frac{\partial}{\partial t} \left(k + x{\left(t \right)}\right)", "x'"),
]  # fmt: skip


@pytest.mark.parametrize(("latex", "text"), DERIVATIVES)
def test_derivatives_as_sympy_and_textbooks_print_them_are_read(latex: str, text: str) -> None:
    assert to_text(read_formula(latex, WITH_FUNCTIONS)) == text


@pytest.mark.parametrize(
    "latex",
    [
        r"\frac{d}{d t} x{\left(t \right)} \sin{\left(x{\left(t \right)} \right)}",
        r"\frac{d}{d x} A{\left(x \right)} k",
        r"\frac{\partial}{\partial t} k x{\left(t \right)}",
        r"\frac{\partial}{\partial t} \left(k + x t\right)",
        r"\frac{d}{dt} x^2",
    ],
)
def test_a_derivative_whose_end_or_kind_is_not_clear_is_refused(latex: str) -> None:
    with pytest.raises(InputError, match="derivative"):
        read_formula(latex, WITH_FUNCTIONS)
