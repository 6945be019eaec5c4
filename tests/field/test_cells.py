"""What inequalities imply: true at random points, and each of two programs states what it finds."""

from __future__ import annotations

import itertools
import random

import mpmath
import pytest
from flint import Ordering, fmpq_mpoly_ctx

from inverse_service.certificate import cell as of_checker, checker
from inverse_service.decision import certify, deciding
from inverse_service.expressions import calculus, printing, tree as ex
from inverse_service.expressions.polynomials import factor_polynomial
from inverse_service.field import cells, tower
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.statements.questions import PLAIN

NAMES = nm.Names(("x", "y"), ("a", "b"), {})


def read(*texts: str) -> list[ex.Expression]:
    return [reader.read_formula(text, NAMES) for text in texts]


# (what follows, from what is positive, from what is not zero)
IMPLIED = [
    ("x + 1", ["x"], []),
    ("x*y + 3", ["x", "y"], []),
    ("1 + x^2", [], []),
    ("x^2 + x*y + y^2 + 1", [], []),
    ("(x - y)^2 + (a - b)^2 + 1", [], []),
    ("(x - y)^2 + a", ["a"], []),
    ("x^2 + x + a", ["a - 1"], []),
    ("x^4 - x + 1", [], []),
    ("exp(x) + sin(y) + 1", [], []),
    ("2 + sin(x)*cos(y)", [], []),
    ("log(x)", ["x - 1"], []),
    ("exp(x) - 1", ["x"], []),
    ("pi - atan(x)", [], []),
    ("cos(atan(x))", [], []),
    ("cos(atan(x)/2)", [], []),
    ("sqrt(x^2 + y^2) - x", [], ["y"]),
    ("sin(x)", ["x", "pi - x"], []),
    ("1 - cos(x)^2", [], ["sin(x)"]),
    ("a/b", ["a*b"], []),
    ("x - y", ["x^2 - y^2", "x + y"], []),
    ("x*(1 + sqrt(y))", ["x"], []),
]


@pytest.mark.parametrize(("wanted", "positive", "nonzero"), IMPLIED)
def test_what_follows_is_found_and_is_true(
    wanted: str, positive: list[str], nonzero: list[str]
) -> None:
    (tree,), known, apart = read(wanted), read(*positive), read(*nonzero)
    assert cells.follows(tree, ">", apart, known)
    draw, met = random.Random(1), 0
    for _ in range(50):
        table = {leaf: mpmath.mpf(draw.uniform(-4, 4)) for leaf in read("x", "y", "a", "b")}
        try:
            holds = all(calculus.evaluate(one, table) > 0 for one in known)
            if holds and all(calculus.evaluate(one, table) != 0 for one in apart):
                value = calculus.evaluate(tree, table)
                met, good = met + 1, value > 0
                assert good, table
        except calculus.NoRealValue:
            continue
    assert met > 3


@pytest.mark.parametrize(
    ("wanted", "positive", "nonzero"),
    [
        ("x", ["x + 1"], []),
        ("x^2", [], []),
        ("x + y", ["x"], []),
        ("1 + sin(x)", [], []),
        ("x^2 - 2*x*y + y^2", [], ["x"]),
        ("(x - y)^2 + (a - b)^2", ["(x - a)^2 + (y - b)^2"], []),
        ("sqrt(x^2 + y^2) - x", [], []),
        ("x - y", ["x^2 - y^2"], []),
        ("2 - exp(x)", [], []),
        ("cos(2*atan(x))", [], []),
        ("cos(3*atan(x)/2)", [], []),
        ("cos(atan(x)^2)", [], []),  # atan(x)^2 comes up to 2.4
        ("sin(atan(x))", [], []),
        ("cosh(x) - 1", [], []),
        ("sqrt(1 + x^2) - 1", [], []),
        ("exp(x) - x^2", [], []),
        ("x^4 - x^2", [], ["x"]),
        ("log(x)", ["x"], []),
        ("sin(x)", ["x"], []),
        ("x*y", ["x"], ["y"]),
        ("a*b", ["a + b"], []),
        ("x^3", [], ["x"]),
        ("x - 1", ["x^2 - 1"], []),
        ("(x - 1)*(x - 2)", ["x"], ["x - 1", "x - 2"]),
    ],
)
def test_what_does_not_follow_is_not_found(
    wanted: str, positive: list[str], nonzero: list[str]
) -> None:
    (tree,), known, apart = read(wanted), read(*positive), read(*nonzero)
    assert not cells.follows(tree, ">", apart, known)


SIGNED = ["x^2*y", "(x - 1)^2*(y + 1)", "-x^2*y", "x^2", "x^3/y", "x/y^2", "log(x)", "-log(x)*y", "log(x)^2*y",
          "exp(x) - 1", "1 - exp(y)", "x*(exp(x) - 1)", "atan(x)*y", "sin(x)^2*y", "(1 - cos(y)^2)*x"]  # fmt: skip


@pytest.mark.parametrize("text", SIGNED)
def test_a_formula_is_positive_exactly_where_its_needs_are_met(text: str) -> None:
    """Also at zeros of factors with even multiplicity, and where a function has no simple zero."""
    (tree,) = map(tower.to_kernels, read(text))
    ring = cells.Letters.about([tree])
    needs = [*ring.pieces(">", ring.value(tree))]
    met = 0
    for x, y in itertools.product([-2, -1, 0, 0.5, 1, 2], repeat=2):
        table = dict(zip(read("x", "y"), map(mpmath.mpf, (x, y)), strict=True))
        try:
            wanted = calculus.evaluate(tree, table) > 0
        except calculus.NoRealValue:
            continue
        values = [calculus.evaluate(ring.tree_of_need(need), table) for need in needs]
        pairs = zip(needs, values, strict=True)
        assert all(v > 0 if need.kind == ">" else v != 0 for need, v in pairs) == wanted, (x, y)
        met += 1
    assert met >= 10


SAME = ["sqrt(cos(2*atan(x))^2)", "sqrt(cos(atan(x))^2)", "sqrt(cos(3*atan(x)/2)^2)", "sqrt(sin(x)^2)", "sqrt(exp(2*x))",
        "sqrt(x^2*exp(2*y))", "(x^2)^(3/2)", "sqrt(x^4)", "sqrt(log(3 + x^2)^2)", "sqrt(x^2*(1 + y^2))",
        "exp(2*log(3 + x))", "exp(log(x^2)/2)", "cos(-x)*sin(-y)", "sqrt((x - y)^2)/(x - y)"]  # fmt: skip


@pytest.mark.parametrize("text", SAME)
def test_an_element_has_the_values_of_its_formula(text: str) -> None:
    """The root of a square is the function itself only where that is nowhere negative."""
    (tree,) = map(tower.to_kernels, read(text))
    ring = cells.Letters.about([tree])
    found = ring.tree_of(ring.value(tree))
    for x, y in itertools.product([-2.9, -1.7, -0.3, 0.4, 1.3, 2.8], [-1.5, 0.7, 2.6]):
        table = dict(zip(read("x", "y"), map(mpmath.mpf, (x, y)), strict=True))
        wanted = calculus.evaluate(tree, table)
        assert abs(calculus.evaluate(found, table) - wanted) <= 1e-12 * (1 + abs(wanted)), (x, y)


def test_a_root_is_not_zero_where_its_radicand_is_positive() -> None:
    root, x = read("sqrt(x)", "x")
    assert cells.follows(root, "!=", (), (x,))
    assert not cells.follows(root, "!=", (), ())


def test_a_product_of_nonzero_roots_is_nonzero_in_both_programs() -> None:
    """x - y^2 = (sqrt(x) - y)(sqrt(x) + y), whose second factor is positive for x, y > 0."""
    product, factor, x, y = read("x - y^2", "sqrt(x) - y", "x", "y")
    assert cells.follows(product, "!=", (factor,), (x, y))
    assert not cells.follows(product, "!=", (factor,), (x,))
    certificate = {
        "format": checker.FORMAT,
        "system": {"coordinates": ["x", "y"], "equations": {"x": "sqrt(x)", "y": "-y"}},
        "question": "autonomous",
        "claim": "variational",
        "kind": "lagrangian",
        "lagrangian": "x'^2/2 + 2*x^(3/2)/3 + y'^2/2 - y^2/2",
    }
    proven = of_checker.Cell(("x - y^2 != 0", "x > 0", "y > 0"))
    stated = ["sqrt(x) - y != 0", "x > 0", "y > 0"]
    assert checker.lacking_members(certificate, stated, proven, 20.0)[0] == []
    assert "x - y^2 != 0" in checker.lacking_members(certificate, stated[:2], proven, 20.0)[0]


def texts(found: object) -> set[str]:
    assert isinstance(found, list | tuple)
    return {f"{printing.to_text(tree)} {kind} 0" for kind, tree in found}


def test_the_conditions_of_formulas_have_one_order() -> None:
    """Not that of a set of Python, which differs from process to process."""
    (tree,) = read("1/((1 - x^2)*(4 - x^2)*(x - 5)*(9 - x^2))")
    shown = [printing.to_text(one) for _, one in cells.needed_beyond((tree,), (), ())]
    assert shown == [
        f"x {sign} {k}" for sign, k in zip("+++----", (1, 2, 3, 1, 2, 3, 5), strict=True)
    ]


def test_the_poles_that_the_checker_finds_have_one_order() -> None:
    analysis = deciding.analyze(read_system(["x"], {"x": "0"}))
    (tree,) = read("x'^2/2 + x'/((1 - x^2)*(4 - x^2)*(x - 5)*(9 - x^2))")
    found = checker.check_certificate(certify.of_lagrangian(analysis, tree, PLAIN))
    poles = [f"x {sign} {k} != 0" for sign, k in zip("----+++", (5, 3, 2, 1, 1, 2, 3), strict=True)]
    assert found.formulas.domain == tuple(poles)


def test_a_stated_set_without_what_follows() -> None:
    positive, nonzero = read("x", "x + 1", "x*y"), read("x", "1 + x^2")
    assert texts(cells.shortest(positive, nonzero)) == {"x > 0", "y > 0"}


def test_what_formulas_need_besides() -> None:
    formulas, known = tuple(read("1/(x - y)", "log(x)*a", "sqrt(x + 1)")), tuple(read("y"))
    assert texts(cells.needed_beyond(formulas, known, ())) == {"x - y != 0", "x > 0"}
    assert texts(cells.needed_beyond(formulas, tuple(read("x")), tuple(read("y - x")))) == set()


def test_what_a_long_sum_needs_is_what_its_terms_need() -> None:
    """Over one denominator, the sum would have more terms than a deduction takes."""
    names = nm.Names(tuple(f"x{k}" for k in range(6)), (), {})
    terms = (f"1/(x{k} - x{(k + 1) % 6})^2 - sqrt(x{k})" for k in range(6))
    tree = reader.read_formula(" + ".join(terms), names)
    assert len(cells.needed_beyond((tree,), (), ())) == 12


@pytest.mark.parametrize("engine", [of_checker, cells], ids=["checker", "solver"])
def test_a_condition_that_one_program_loses_is_stated(
    engine: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """x'' = -1/x^2 by a program that finds that everything follows, and by one that does not."""
    cells.needed_beyond.cache_clear()
    names = nm.Names(("x",), (), {})
    force = reader.read_formula("-1/x^2", names)

    def faulty(self: object, need: object) -> bool:
        return True

    monkeypatch.setattr(engine.Knowledge, "implies", faulty)  # type: ignore[attr-defined]
    proof = checker.check_certificate(
        {
            "format": checker.FORMAT,
            "system": {"coordinates": ["x"], "equations": {"x": "-1/x^2"}},
            "question": "autonomous",
            "claim": "variational",
            "kind": "lagrangian",
            "lagrangian": "x'^2/2 + 1/x",
        }
    )
    assert proof.verdict == "valid"
    where = certify.where_of(proof.formulas, names, [force])
    cells.needed_beyond.cache_clear()
    assert where.nonzero == (ex.Symbol("x"),)


@pytest.mark.parametrize("size", [4, 300])
def test_factors_are_the_same_among_many_letters(size: int) -> None:
    """flint takes a thousand times longer where a context has some hundred letters."""
    context = fmpq_mpoly_ctx.get([f"g{k}" for k in range(size)], Ordering.lex)
    x, y, *_, z = context.gens()
    product = -6 * z**2 * (x - y) ** 3 * (x**2 + z)
    for content, powers in (factor_polynomial(product), of_checker.factored(product)):
        assert content == -6
        assert sorted(powers, key=str) == sorted([(z, 2), (x**2 + z, 1), (x - y, 3)], key=str)
    assert factor_polynomial(context.constant(5)) == (5, [])


def test_factors_that_a_caller_changes_are_found_again_whole() -> None:
    x, y = fmpq_mpoly_ctx.get(["x", "y"], Ordering.lex).gens()
    a, b = fmpq_mpoly_ctx.get(["a", "b"], Ordering.lex).gens()
    factor_polynomial(x**2 - y**2).powers.clear()
    for square, factors in (
        (x**2 - y**2, ["x + y", "x - y"]),
        (a**2 - b**2, ["a + b", "a - b"]),
    ):
        assert sorted(str(one) for one, _ in factor_polynomial(square).powers) == factors
