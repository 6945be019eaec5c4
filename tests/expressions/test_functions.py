"""The table of functions agrees with mpmath, and with the checker's and the browser's own
tables.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy
from flint import arb, ctx, fmpq
from mpmath import mp, mpf

import inverse_service
from inverse_service.certificate import formulas
from inverse_service.certificate.checker import check_certificate
from inverse_service.decision import certify, deciding
from inverse_service.expressions import arrays, calculus, functions, jets, printing, tree as ex
from inverse_service.expressions.calculus import differentiate
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.scenes.simulating import simulate
from inverse_service.statements.questions import PLAIN
from tests.doors import parsing

_WITHIN_ONE = "a number between -1 and 1"
U, TINY = ex.Symbol("u"), mpf(10) ** -25
ROWS = functions.FUNCTION
FORMAT = (Path(formulas.__file__).parent / "FORMAT.md").read_text("utf-8")
LANGUAGES = tomllib.loads(
    (Path(inverse_service.__file__).parent / "sympy" / "languages.toml").read_text("utf-8")
)["special"]
SCRIPT = Path(inverse_service.__file__).parent / "web" / "static" / "system.js"


def points(name: str) -> Iterator[mpf]:
    """At most 50 points, on both sides of 0, at which a function is real and has a derivative."""
    row = ROWS[name]
    for place in range(50 if name not in functions.SPECIAL else 10):
        u = Fraction(2 * place - 49, 14 if row.wanted != _WITHIN_ONE else 50)
        u = u if name not in functions.SPECIAL else Fraction(2 * place - 7, 6)
        value = mpf(u.numerator) / u.denominator
        needs = row.needs(*functions.arguments_of(applied(name))) if row.special else ()
        if (row.holds is None or row.holds(u)) and all(at(tree, value) > 0 for tree in needs):
            yield value


def applied(name: str, order: ex.Expression | None = None) -> ex.Apply:
    """The function of u; Bessel functions of the order 4/3, polygamma of 1, unless given."""
    if not ROWS[name].ordered:
        return ex.Apply(name, U)
    return ex.Ordered(name, U, order or ex.number(1 if name == "polygamma" else Fraction(4, 3)))


def at(tree: ex.Expression, u: mpf) -> mpf:
    return calculus.evaluate(tree, {U: u})


@pytest.mark.parametrize("name", ROWS)
def test_each_column_of_a_row_is_true_of_its_function(name: str) -> None:
    row, f = ROWS[name], applied(name)
    with mp.workdps(40):
        for u in points(name):
            value, slope = at(f, u), at(functions.slope_of(f), u)
            differences = [slope - mp.diff(lambda w: at(f, w), u)]
            differences += [at(f, -u) - row.parity * value] if row.parity else []
            differences += [at(functions.in_kernels(f), u) - value]
            differences += (
                [at(differentiate(row.primitive(U), U), u) - value] if row.primitive else []
            )
            differences += (
                [value * at(ex.Apply(row.reciprocal, U), u) - 1] if row.reciprocal else []
            )
            if row.powers:
                pair = ("sinh", "cosh") if row.family == "hyperbolic" else ("sin", "cos")
                factors = (ex.Apply(one, U) ** e for one, e in zip(pair, row.powers, strict=True))
                differences.append(at(ex.multiply(*factors), u) - value)
            if row.square:
                other, a, b = row.square
                differences.append(value**2 - a - b * at(ex.Apply(other, U), u) ** 2)
            if row.slope:
                sign, constant, quadratic, exponent = row.slope
                below = constant + quadratic * u**2
                differences.append(
                    sign / below ** (mpf(exponent.numerator) / exponent.denominator) - slope
                )
            assert all(abs(one) < TINY * (1 + abs(value)) for one in differences), (u, differences)
            inner = functions.arguments_of(f)
            assert all(at(tree, u) > 0 for tree in row.needs(*inner))
            assert all(at(tree, u) != 0 for tree in row.poles(*inner))


@pytest.mark.parametrize("name", ROWS)
def test_inverse_functions_undo_each_other_near_zero(name: str) -> None:
    row = ROWS[name]
    with mp.workdps(40):
        small = mpf(8) / 7 if name == "acosh" else mpf(3) / 7
        if row.solved:
            assert abs(at(ex.Apply(row.solved, ex.Apply(name, U)), small) - small) < TINY
            assert functions.solves(row.solved, name)
        for u in points(row.undoes) if row.undoes else ():
            assert abs(at(ex.Apply(name, ex.Apply(row.undoes, U)), u) - u) < TINY * (1 + abs(u))
        for u in points(row.root[0]) if row.root else ():
            inner, a, b = row.root or ("", 0, 0)
            assert abs(at(ex.Apply(name, ex.Apply(inner, U)), u) - mp.sqrt(a + b * u**2)) < TINY * (
                1 + abs(u)
            )


@pytest.mark.parametrize("name", [name for name, row in ROWS.items() if row.holds])
def test_a_function_without_a_value_somewhere_says_where_it_has_one(name: str) -> None:
    row = ROWS[name]
    assert row.wanted
    assert row.holds
    assert not all(map(row.holds, map(Fraction, (-2, 0))))


@pytest.mark.parametrize("name", sorted(functions.SPECIAL))
def test_derivatives_of_special_functions_follow_from_independent_ones(name: str) -> None:
    row, order = ROWS[name], ex.Symbol("n")
    arguments = (order, U) if row.ordered and row.jets else (U,)
    shown = calculus.special_function(functions.special_kernel(name, *arguments))
    table = {U: mpf("1.3"), order: mpf("0.4")}
    with mp.workdps(40):
        for k in range(4):
            node = functions.special_kernel(name, *arguments, derivative=k)
            law = jets.by_independent(node)
            assert (law is None) == (row.law is None or k < row.jets)
            slope = mp.diff(lambda u: calculus.evaluate(shown, {**table, U: u}), table[U], k)
            value = calculus.evaluate(law or node, table)
            assert abs(value - slope) < mpf(10) ** -15 * (1 + abs(slope))


@pytest.mark.parametrize("name", ["besselj", "bessely"])
@pytest.mark.parametrize("order", ["-3", "0", "1", "7", "-3/2", "5/2"])
def test_bessel_functions_of_all_orders_follow_from_two(name: str, order: str) -> None:
    f = applied(name, ex.number(Fraction(order)))
    with mp.workdps(40):
        assert abs(at(functions.in_kernels(f), mpf("1.3")) - at(f, mpf("1.3"))) < TINY * 10**6
        slope = mp.diff(lambda u: at(f, u), mpf("1.3"))
        assert abs(at(functions.slope_of(f), mpf("1.3")) - slope) < TINY * (1 + abs(slope))


@pytest.mark.parametrize("name", sorted({*ROWS} | {*formulas.SPECIAL}))
def test_the_checker_has_the_same_functions(name: str) -> None:
    assert name in formulas.IRRATIONAL
    assert re.search(rf"\b{name}\b", FORMAT)
    assert (name in formulas.SPECIAL) == ROWS[name].special
    assert (name in formulas.ORDERED) == ROWS[name].ordered
    if name not in formulas.DEFINED and not ROWS[name].special:
        assert ROWS[name].kernel is None
    if name not in formulas.DEFINED:
        return
    defined = read_formula(formulas.DEFINED[name], Names(("u",), (), {}))
    with mp.workdps(40):
        for u in points(name):
            assert abs(at(defined, u) - at(ex.Apply(name, U), u)) < TINY


@pytest.mark.parametrize("name", formulas.SPECIAL)
def test_the_checker_computes_and_differentiates_a_special_function(name: str) -> None:
    """Its value at a ball holds the one of mpmath, and its slope is that of mpmath's function."""
    row, law, u = ROWS[name], formulas.SPECIAL[name], Fraction(13, 8)
    order = ex.number(1) if name == "polygamma" else ex.number(Fraction(4, 3))
    f, place = applied(name, order), mpf(13) / 8
    with mp.workdps(40), ctx.workprec(130):
        orders = [] if not row.ordered else [1] if name == "polygamma" else [arb(fmpq(4, 3))]
        value = law.value(arb(fmpq(13, 8)), *orders)
        assert value.overlaps(arb(mp.nstr(at(f, place), 38), 1e-36))
        assert value.rad() < 1e-30
        known: dict[str, ex.Expression] = {"u": ex.number(u), "n": order, "y": f}
        known["z"] = ex.Ordered(name, U, order + 1) if row.ordered else ex.ZERO
        trees: dict[ex.Expression, ex.Expression]
        trees = {ex.Symbol(key): tree for key, tree in known.items()}
        for key, text in law.once.items():
            trees[ex.Symbol(key)] = ex.substitute(read_formula(text, Names(("u",), (), {})), trees)
        letters = Names((), (*known, *law.once), {})
        for text in law.slopes[:1]:
            slope = ex.substitute(read_formula(text, letters), trees)
            assert abs(at(slope, place) - at(functions.slope_of(f), place)) < TINY


@pytest.mark.parametrize("name", formulas.SPECIAL)
def test_the_checker_confirms_a_lagrangian_with_a_special_function(name: str) -> None:
    """L = f(x) x'^2/2 of x'' = -f'(x) x'^2/(2 f(x)), and no other one."""
    x, v = ex.Symbol("x"), ex.Velocity("x")
    f = ex.substitute(applied(name, ex.ONE if name == "besselj" else None), {U: x})
    assert isinstance(f, ex.Apply)
    force = printing.to_text(-functions.slope_of(f) * v**2 / (2 * f))
    analysis = deciding.analyze(read_system(["x"], {"x": force}))
    for potential, verdict in ((ex.ZERO, "valid"), (x, "invalid")):
        document = certify.of_lagrangian(analysis, f * v**2 / 2 - potential, PLAIN)
        assert check_certificate(document, seed=1).verdict == verdict


@pytest.mark.parametrize("name", formulas.SPECIAL)
def test_a_special_function_is_real_at_the_same_places_everywhere(name: str) -> None:
    """In the table, in the checker's two columns, and in the format of certificates."""
    row, law, (real, _) = ROWS[name], formulas.SPECIAL[name], format_of(name)
    first, *rest = real.partition(",")[0].split(">")
    least = (
        at(read_formula(re.sub(r"\be\b", "exp(1)", rest[0]), Names(())), mpf(0))
        if rest
        else mpf("-inf")
    )
    assert first == ("u " if rest else "all u")
    assert (law.least is not None) == bool(law.positive) == (least > mpf("-inf"))
    if law.least is not None:
        assert law.least().overlaps(arb(mp.nstr(least, 30), 1e-20))
    assert bool(row.holds) == bool(row.needs(*functions.arguments_of(applied(name, ex.ONE))))
    for u in map(Fraction, (-2, "-3/8", "-1/4", "1/4", 2)):
        place = mpf(u.numerator) / u.denominator
        is_real = place > least
        needs = row.needs(*functions.arguments_of(applied(name)))
        assert all(at(tree, place) > 0 for tree in needs) == is_real
        if row.holds:
            assert row.holds(u) == is_real
        if law.positive:
            positive = read_formula(law.positive, Names(("u",)))
            assert (at(positive, place) > 0) == is_real


@pytest.mark.parametrize("name", formulas.SPECIAL)
def test_the_format_has_the_derivative_of_a_special_function(name: str) -> None:
    _, slope = format_of(name)
    text = re.sub(r"\bk\b", "2", slope.partition(", z of")[0])
    written = read_formula(text, Names(("u",), ("n", "y", "z")))
    f = applied(name, ex.number(2))
    values: dict[ex.Expression, ex.Expression] = {ex.Symbol("y"): f}
    values[ex.Symbol("n")] = ex.number(2)
    if ROWS[name].ordered:
        values[ex.Symbol("z")] = ex.Ordered(name, U, ex.number(3))
    with mp.workdps(40):
        found = at(ex.substitute(written, values), mpf("1.3"))
        assert abs(found - at(functions.slope_of(f), mpf("1.3"))) < TINY * (1 + abs(found))


def format_of(name: str) -> tuple[str, str]:
    """Where a function is real, and its derivative, as the format of certificates says them."""
    (row,) = re.findall(rf"^\| `{name}\(.*", FORMAT, re.MULTILINE)
    _, _, real, slope, _ = (cell.strip() for cell in row.split("|"))
    return real, slope


@pytest.mark.parametrize("name", sorted(functions.SPECIAL))
def test_a_call_of_mathematica_is_read_as_the_special_function(name: str) -> None:
    """Languages list calls by SymPy's name."""
    called = ROWS[name].sympy or name
    assert hasattr(sympy, called)
    if called not in LANGUAGES["mathematica"]:
        return
    orders = ("0",) if ROWS[name].ordered else ()
    equation = f"x''[t] == {LANGUAGES['mathematica'][called].format(*orders, 'x[t]')}"
    read = parsing.read({"equations": equation})
    assert read["equations"]["x"]["text"] == f"{name}({', '.join((*orders, 'x'))})"


def test_languages_call_no_function_by_another_name() -> None:
    names = {row.sympy or row.name for row in ROWS.values() if row.special}
    assert {key for calls in LANGUAGES.values() for key in calls} - {"whole"} <= names


def test_the_browser_has_the_same_functions() -> None:
    script = SCRIPT.read_text().partition("};")[0]
    names = {*re.findall(r'"(\w+)"', script), *re.findall(r"(\w+): \(", script)}
    assert names == {*ROWS} - functions.SPECIAL
    if shutil.which("node") is None:
        return
    asked = {name: [float(u) for u in points(name)] for name in names}
    program = (
        script
        + f"""}};
        const found = {{}};
        for (const [name, values] of Object.entries({json.dumps(asked)})) found[name] = values.map(FUNCTIONS[name]);
        console.log(JSON.stringify(found));"""
    )
    done = subprocess.run(
        ["node", "-e", program], capture_output=True, text=True, check=True, timeout=60
    )
    for name, values in json.loads(done.stdout).items():
        with mp.workdps(30):
            expected = [float(at(ex.Apply(name, U), mpf(u))) for u in asked[name]]
        assert values == pytest.approx(expected, rel=1e-12, abs=1e-14), name


def test_a_simulation_computes_each_function_that_has_machine_code() -> None:
    """x'' = f(u) at a constant u, from rest: x = f(u)/2 after the time 1."""
    names = [name for name in ROWS if not functions.has_no_machine_code(name)]
    values = {name: float([*points(name)][-1]) for name in names}
    equations = {f"x_{k}": f"{name}(u_{k})" for k, name in enumerate(names)}
    parameters = {f"u_{k}": u for k, u in enumerate(values.values())}
    rest = dict.fromkeys(equations, 0)
    (found,) = simulate({
        "system": {"coordinates": [*rest], "equations": equations, "parameters": [*parameters]},
        "parameters": parameters, "initial": {"positions": rest, "velocities": rest},
        "step": 0.5, "steps": 2, "methods": ["runge-kutta"],
    })["methods"]  # fmt: skip
    for x, (name, u) in zip(found["final"]["positions"].values(), values.items(), strict=True):
        value = float(at(ex.Apply(name, U), mpf(u)))
        assert x == pytest.approx(value / 2, rel=1e-14), name


@pytest.mark.parametrize("name", ROWS)
def test_a_formula_at_many_points_has_the_values_of_mpmath(name: str) -> None:
    """Bessel functions also of whole orders, at which those of mpmath.fp are wrong."""
    places = [*map(float, points(name)), *[20.0] * (ROWS[name].wanted != _WITHIN_ONE)]
    orders = [ex.number(k) for k in range(3)] if ROWS[name].ordered else [None]
    for f in (applied(name, order) for order in orders):
        found = arrays.array_value(f, {U: np.array(places)})
        expected = [float(at(f, mpf(u))) for u in places]
        assert found == pytest.approx(expected, rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("name", [*filter(functions.has_no_machine_code, ROWS)])
def test_a_simulation_refuses_a_motion_without_machine_code_by_its_function(name: str) -> None:
    call = f"{name}(1, x)" if ROWS[name].ordered else f"{name}(x)"
    start = {"positions": {"x": 1.5}, "velocities": {"x": 0}}
    system = {"coordinates": ["x"], "equations": {"x": call}}
    scene = {"system": system, "initial": start, "step": 0.5, "steps": 2}
    (refused,) = simulate(scene | {"methods": ["runge-kutta"]})["methods"]
    assert f"cannot compute the function {name}" in refused["reason"]


@pytest.mark.parametrize("name", ROWS)
def test_the_latex_of_a_function_is_read_as_the_function(name: str) -> None:
    f = ex.substitute(applied(name, ex.ONE), {U: ex.Symbol("x")})
    read = parsing.read({"equations": f"\\ddot{{x}} = {printing.to_latex(f)}"})
    assert read["equations"]["x"]["text"] == printing.to_text(f)
    if ROWS[name].special:
        assert len(ROWS[name].shown or name) <= len("erfi")  # as people write it
