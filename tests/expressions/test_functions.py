"""The table of functions agrees with mpmath, and with the checker's and the browser's own
tables.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from flint import arb, ctx, fmpq
from mpmath import mp, mpf

import inverse_service
from inverse_service.certificate import formulas
from inverse_service.expressions import calculus, functions, jets, tree as ex
from inverse_service.expressions.calculus import differentiate
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

U, TINY = ex.Symbol("u"), mpf(10) ** -25
ROWS = functions.FUNCTION
FORMAT = (Path(formulas.__file__).parent / "FORMAT.md").read_text("utf-8")
SCRIPT = Path(inverse_service.__file__).parent / "web" / "static" / "system.js"


def points(name: str) -> Iterator[mpf]:
    """At most 50 points, on both sides of 0, at which a function is real and has a derivative."""
    row = ROWS[name]
    for place in range(50 if name not in functions.SPECIAL else 10):
        u = Fraction(2 * place - 49, 14 if row.wanted != "a number between -1 and 1" else 50)
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
