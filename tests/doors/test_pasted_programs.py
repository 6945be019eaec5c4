"""Programs that are run in symbols: bounded in time and size, and strict about what is not evaluated."""

import time
from pathlib import Path

import pytest

from inverse_service.errors import InputError
from inverse_service.reading.scripts import languages, nodes
from inverse_service.service.documents.documents import parse_document

MOVING = "from sympy import *\nt = symbols('t')\nx = Function('x')(t)\nm, k = symbols('m k')\n"
# Each would take for ever, or much of the memory, if it were only evaluated.
HOSTILE = (
    MOVING + "y = x\n" + "y = y + sin(y)\n" * 40 + "L = m*x.diff(t)**2/2 - y\n",
    MOVING + "n = (10**60)**60\nn = n**60\nn = n**60\nL = m*x.diff(t)**2/2 - n*x\n",
    MOVING + "def f(a):\n    return f(f(a))\nL = m*x.diff(t)**2/2 - f(x)\n",
    MOVING + "L = m*x.diff(t)**2/2 - 1e999999999*x\n",
    "let a = 1e999999999;\nfunction f(t, y) { return [y[1], -a*y[0]]; }",
    MOVING + "L = m*x.diff(t)**2/2 - k*sum([1]*10**9)\n",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_a_program_that_grows_without_end_is_given_up(text: str) -> None:
    begin = time.process_time()
    with pytest.raises(nodes.NotRead):
        languages.what_it_comes_to(text)
    assert time.process_time() - begin < 2


@pytest.mark.parametrize(
    "line",
    [
        "L = m*x.diff(t)**2/2 - V(x) if k else 0",
        "for i in range(3):\n    L = m*x.diff(t)**2/2 - i*x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nif k:\n    L = L - x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\ncon = Eq(x.diff(t), k)",
        "L = m*x.diff(t)**2/2 - unknown(x, k, t)",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nif k:\n    pass\nelse:\n    L = L - x",
        "L = m*x.diff(t)**2/2 - k*x**2/2\nL //= 2",
        "L = m*x.diff(t)**2/2 - k*x**2/2\ntry:\n    L = L - x\nexcept ValueError:\n    pass",
        "def f(t, y):\n    if y[0] > 1:\n        return [y[1], 0]\n    return [y[1], -y[0]]",
        "eq1 = Eq(m*x.diff(t, 2), -unknown(x))\ny = Function('y')(t)\neq2 = Eq(y.diff(t, 2), -y)",
    ],
)
def test_a_system_that_depends_on_what_is_not_evaluated_is_not_taken(line: str) -> None:
    with pytest.raises(nodes.NotRead):
        languages.what_it_comes_to(MOVING + line)


def test_forces_beside_a_lagrangian_are_kept() -> None:
    text = (
        MOVING
        + "c = symbols('c')\nL = m*x.diff(t)**2/2 - k*x**2/2\n"
        + "eq = Eq(diff(diff(L, x.diff(t)), t) - diff(L, x), -c*x.diff(t))\nsol = dsolve(eq, x)\n"
        + "v = Matrix([x.diff(t)]).dot(Matrix([1]))\n"
    )
    found = languages.what_it_comes_to(text).document
    assert found["equations"] == ["m*x'' + k*x = -c*x'"]


def test_nothing_of_a_program_is_executed(tmp_path: Path) -> None:
    text = f"import os\nos.mkdir({str(tmp_path) + '/made'!r})\nL = open('x').read()\n"
    with pytest.raises(InputError):
        parse_document({"equations": text})
    assert not (tmp_path / "made").exists()


def test_a_value_that_c_defines_is_put_in() -> None:
    text = "#define G 9.81\nvoid f(double t, double y[], double dydt[]) { dydt[0] = y[1]; dydt[1] = -G*sin(y[0]); }"
    assert languages.what_it_comes_to(text).document["parameters"] == []
