"""Rates in lists, pairs and numbered lines: as whose rates they are read, and what is no such list."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from tests.doors import parsing
from tests.doors.judge import same_formula

READ: dict[str, dict[str, str]] = {
    "(x, v), (v, -x*time)": {"x": "-x*t"},
    "[(x, v), (v, -sin(x)),]": {"x": "-sin(x)"},
    "[u[1], -a[0]*u[0]]": {"u_1": "-a_0*u_1"},
    "[u[2], -a[3]*u[1]]": {"u_1": "-a_3*u_1"},  # of u there are as many entries as rates
    "[q[3], q[4], -2*q[1], -q[2]]": {"q_1": "-2*q_1", "q_2": "-q_2"},
    "dydx(1) = x(2); dydx(2) = -3*x(1)": {"x_1": "-3*x_1"},
    "dydx(0) = x(1); dydx(1) = -3*x(0)": {"x_1": "-3*x_1"},
    "dydt(1) = y(2); dydt(2) = -3*y(1)": {"y_1": "-3*y_1"},
    "dydt = zeros(2, 1); dydt(1) = y(2); dydt(2) = -y(1)": {"y_1": "-y_1"},
    "dydt = [y(2); -y(1)]": {"y_1": "-y_1"},
    "dxdt = v; dvdt = -x; dzdt = w; dwdt = -2*z": {"x": "-x", "z": "-2*z"},
    "dx1 = x2; dx2 = -x1": {"x1": "-x1"},
    "dx = [x3; x4; -x1; -5*x2]": {"x1": "-x1", "x2": "-5*x2"},
    "@(t, y) [y(2); -9*y(1)]": {"y_1": "-9*y_1"},
    "@(x, t) [x(2); -t*x(1)]": {"x_1": "-t*x_1"},  # Octave's lsode has the time behind
    "@(s, y) [y(2); -s*y(1)]": {"y_1": "-t*y_1"},
    "ddu[1] = -k*u[1] - c*du[1]; ddu[2] = -u[2]": {"u_1": "-k*u_1 - c*u_1'", "u_2": "-u_2"},
    "rk([v, -x], [x, v], [1, 0], [t, 0, 10, 0.1])": {"x": "-x"},
    "{{prime(x) = v, prime(v) = -x}, {0.05, 0.025}}": {"x": "-x"},
    "(x'' + x, y'' + 4*y)": {"x": "-x", "y": "-4*y"},
    "x, v = y; [v, -x]": {"x": "-x"},
}
# A pair of three, an entry below or above the rates, rates from two or with a gap, one rate alone,
# two arrays of one size, fewer names than rates.
ASKED_BACK = [
    "[(x, v), (v, -x, 1)]",
    "dydx(1) = x(2); dydx(2) = -x(0)",
    "dydx(1) = x(2); dydx(2) = -x(3)",
    "dydx(2) = x(3); dydx(3) = -x(2)",
    "dydx(1) = x(2); dydx(3) = -x(1)",
    "dxdt = v",
    "[u[2], -a[1]*u[1]]",
    "x, v = y; [v, -x, 1]",
    "rk([v, -x, 0], [x, v], [1, 0], [t, 0, 10, 0.1])",
]


def read(text: str) -> Any:
    return parsing.parsed({"equations": text, "parameters": "guess"})


@pytest.mark.parametrize("text", READ)
def test_rates_are_those_of_what_is_listed(text: str) -> None:
    found = read(text)
    assert not isinstance(found, InputError), found.detail
    equations, names = found["equations"], found["coordinates"]
    assert [*equations] == [*READ[text]]
    for name, force in READ[text].items():
        assert same_formula(equations[name]["text"], force, names), equations[name]["text"]


@pytest.mark.parametrize("text", ASKED_BACK)
def test_what_is_no_such_list_is_asked_back(text: str) -> None:
    assert isinstance(read(text), InputError)
