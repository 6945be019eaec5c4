"""Implicit equations are solved exactly for the accelerations, or refused where they do not fix them."""

from __future__ import annotations

import random

import pytest
from mpmath import mp, mpf

from inverse_service.codegen.triangular_form import components, matching
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    Acceleration,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    substitute,
    subtract,
    walk,
)
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_equations

DOUBLE_PENDULUM = (
    "(m1 + m2)*l1^2*theta1'' + m2*l1*l2*cos(theta1 - theta2)*theta2'' + m2*l1*l2*sin(theta1 - theta2)*theta2'^2"
    " + (m1 + m2)*g*l1*sin(theta1) = 0;"
    "m2*l2^2*theta2'' + m2*l1*l2*cos(theta1 - theta2)*theta1'' - m2*l1*l2*sin(theta1 - theta2)*theta1'^2"
    " + m2*g*l2*sin(theta2) = 0"
)
SYSTEMS: list[tuple[str, list[str], dict[str, list[str]]]] = [
    ("x'' + x = 0", [], {}),
    ("3*x'' = 1/2", [], {}),
    ("m*l^2*x'' + m*g*l*sin(x) = 0", ["m", "g", "l"], {}),
    ("(1 + x^2)*x'' + x*x'^2 = 0", [], {}),
    ("x''/(1 + x^2) + x''*sqrt(x^2 + 1) = x' - x''", [], {}),
    ("x'' + y'' = -x; x'' - y'' = y", [], {}),
    ("y'' = x; x'' = y'' + z''; z'' + 2*y'' = x'", [], {}),
    ("2*(x'' + y)*m = (y'' - x'')/m; y'' = x''*x^(1/3) + exp(x)^2", ["m"], {}),
    ("A(x)*x'' + A'(x)*x'^2/2 = 0; B(x, y)*y'' + diff(B(x, y), x)*x'' = t", [], {"A": ["x"], "B": ["x", "y"]}),
    ("cos(x)*x'' + sin(x)*y'' = 1; -sin(x)*x'' + cos(x)*y'' = x", [], {}),
    (DOUBLE_PENDULUM, ["m1", "m2", "l1", "l2", "g"], {}),
    ("; ".join(f"q{k}'' + k*q{(k + 1) % 5}'' = -q{k}" for k in range(5)), ["k"], {}),
    ("; ".join("+".join(f"{(k - j) ** 2 + 1}*q{j}''" for j in range(3)) + f" = q{k}^2" for k in range(3)), [], {}),
]


def _value_at_random_point(tree: Expression) -> mpf:
    source = random.Random(7)
    leaves = sorted({node for node in walk(tree) if isinstance(node, Symbol | Velocity | Arbitrary)}, key=repr)
    return evaluate(tree, {leaf: mpf(source.uniform(0.3, 1.5)) for leaf in leaves})


@pytest.mark.parametrize(("text", "parameters", "functions"), SYSTEMS, ids=range(len(SYSTEMS)))
def test_solution_satisfies_every_equation(text: str, parameters: list[str], functions: dict[str, list[str]]) -> None:
    system = read_system(None, text, parameters, functions)
    names = Names(system.coordinates, system.parameters, dict(system.functions))
    solved: dict[Expression, Expression] = {
        Acceleration(name): f for name, f in zip(system.coordinates, system.accelerations, strict=True)
    }
    assert not any(isinstance(node, Acceleration) for f in system.accelerations for node in walk(f))
    with mp.workdps(40):
        for left, right in read_equations(text, names):
            residual = substitute(subtract(left, right), solved)
            assert abs(_value_at_random_point(residual)) < mpf(10) ** -35


def _solved(text: str, parameters: list[str] | None = None) -> list[str]:
    system: SecondOrderSystem = read_system(None, text, parameters or [])
    return [to_text(f) for f in system.accelerations]


def test_double_pendulum_is_solved_in_lowest_terms() -> None:
    first, second = _solved(DOUBLE_PENDULUM, ["m1", "m2", "l1", "l2", "g"])
    assert first.endswith("/(l1*(m1 - m2*cos(theta1 - theta2)^2 + m2))")
    assert second.endswith("/(l2*(m1 - m2*cos(theta1 - theta2)^2 + m2))")


def test_common_factors_cancel() -> None:
    assert _solved("m*l^2*x'' + m*g*l*sin(x) = 0", ["m", "g", "l"]) == ["-g*sin(x)/l"]


def test_sparse_equations_stay_sparse() -> None:
    chain = "q0'' = sin(q0); " + "; ".join(f"(1 + q{k}^2)*q{k}'' = q{k} - q{k}*q{k - 1}''*0" for k in range(1, 6))
    assert _solved(chain) == ["sin(q0)", *(f"q{k}/(q{k}^2 + 1)" for k in range(1, 6))]


REFUSED = [
    ("x'' + y'' = x; x'' + y'' = y", "singular"),
    ("x'' + y'' = x; 2*x'' + 2*y'' = 2*x", "singular"),
    ("x''*sin(x)^2 + x''*cos(x)^2 - x'' = 1", "singular"),
    ("x'' - x'' = 1", "no acceleration"),
    ("x'' = 1; y' = 2; y'' + x'' = 1", "3 equations are given for 2"),
    ("exp(x + y)*x'' + y'' = 0; exp(x)*exp(y)*x'' + y'' = 1", "singular"),
    ("sqrt(2)*x'' + 2*y'' = 0; x'' + sqrt(2)*y'' = 1", "singular"),
    ("x''*y'' = 1; y'' = 0", "linearly"),
    ("x''^2 = 1", "linearly"),
    ("sin(x'') = 1", "linearly"),
    ("1/x'' = x", "linearly"),
    ("x'' = 1; x'' = 2", "2 equations are given for 1"),
    ("x'' + y'' = 1", "1 equation is given for 2"),
    ("x''/(x - x) = 1", "divides by zero"),
    ("log(-1 - x^2)*x'' = 1", "real"),
]


@pytest.mark.parametrize(("text", "fragment"), REFUSED)
def test_equations_that_fix_no_motion_are_refused(text: str, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        read_system(None, text)
    assert caught.value.pointer == "/equations"
    assert fragment in caught.value.detail


def test_equation_without_acceleration_is_named() -> None:
    with pytest.raises(InputError, match="no acceleration") as caught:
        read_system(["x", "y"], ["x'' = 1", "y' = x"])
    assert caught.value.pointer == "/equations/1"


def test_dense_symbolic_matrix_is_refused_in_time() -> None:
    names = [f"a{i}b{j}" for i in range(8) for j in range(8)]
    text = ";".join("+".join(f"a{i}b{j}*q{j}''" for j in range(8)) for i in range(8))
    with pytest.raises(LimitError, match="terms"):
        read_system(None, text, names)


def test_blocks_come_in_the_order_of_their_dependence() -> None:
    pattern = [[0, 1], [0, 1], [1, 2], [3, 2]]
    row_of = matching(pattern)
    assert components({column: pattern[row_of[column]] for column in range(4)}) == [[0, 1], [2], [3]]


def test_matching_leaves_none_where_rows_run_out() -> None:
    assert matching([[0], [0]]) == {0: 0}
