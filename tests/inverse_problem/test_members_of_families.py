"""Steps by which the members of a family are examined."""

from __future__ import annotations

import itertools
import json
import random
import types
from typing import Any

import pytest
from flint import Ordering, fmpq_mpoly, fmpq_mpoly_ctx

import inverse_service
from benchmarks import random_members
from benchmarks.members_of_families import FAMILIES
from inverse_service import bounds, deadline
from inverse_service.decision import deciding
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.field import exact_field, tower
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.solving import closed_members, completion, leaves, members, regularity


@pytest.mark.parametrize(
    ("equations", "letters"),
    [
        ({"x": "-a*x' + b*y", "y": "c*x - b*y'"}, "abc"),
        ({"x": "-a*x'^2 - b*x'*y'", "y": "-c*y'^2 - x'*y"}, "abc"),
    ],
)
def test_the_direction_satisfies_the_conditions_by_whose_minors_it_is_written(
    equations: dict[str, str], letters: str
) -> None:
    """A cross product is orthogonal to its factors."""
    system = read_system(["x", "y"], equations, [*letters])
    work = members._prepared(system, [*letters], [], SolveOptions(), float("inf"))
    _, chosen, _ = members._rank(work, leaves.Leaf(work.unknowns))
    rows = [work.rows[k] for k in chosen[:2]]
    assert len(rows) == 2
    found = members._direction(work, rows)
    entries = [found[0][0].numerator, found[0][1].numerator, found[1][1].numerator]
    assert any(not entry.is_zero() for entry in entries)
    field = work.unknowns.ring.field
    for row in rows:
        total = sum((field.reduce(a * g) for a, g in zip(row, entries, strict=True)), row[0] * 0)
        assert field.reduce(total).is_zero()


def test_a_set_inside_another_of_as_many_equations_is_not_the_same() -> None:
    """F' = 0 is a part of F'' = 0."""
    names = nm.Names(("x",), (), {"F": ("x",)})
    slope, bend = (reader.read_formula(f"diff(F(x), x, {k})", names) for k in (1, 2))
    ring = exact_field.exact_ring([slope, bend], [ex.Symbol("x")], 3, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, (), {"F": ("x",)})
    small, large = (
        leaves.split_leaf(leaves.Leaf(unknowns), [ring.value(tree).numerator], float("inf"))[0]
        for tree in (slope, bend)
    )
    system = read_system(["x"], {"x": "F(x)"}, (), {"F": ["x"]})
    analysis = deciding.analyze(system)

    def is_known(known: leaves.Leaf, leaf: leaves.Leaf) -> bool:
        work = types.SimpleNamespace(
            found=[members.Found(known, None, "variational", None)],
            draw=lambda seed: tower.draw_point(analysis.tower, seed),
        )
        return members._is_known(work, leaf)  # type: ignore[arg-type]

    assert is_known(small, small)
    assert not is_known(large, small)
    assert not is_known(small, large)


@pytest.mark.parametrize("degree", [2, 3])
def test_a_factor_frees_a_polynomial_of_a_root(degree: int) -> None:
    """s p = r + t (a^n - b) with r(b): the resultant of p and a^n - b, up to a factor."""
    context = fmpq_mpoly_ctx.get(["a", "b"], Ordering.lex)
    a, b = context.gens()
    polynomial, rule = (b + 1) * a ** (degree - 1) + a + b, a**degree - b
    found = completion._cofactor(polynomial, rule, 0)
    assert found is not None
    rest = divmod(found * polynomial, rule)[1]
    assert rest.degrees()[0] == 0
    assert not rest.is_zero()


@pytest.mark.parametrize("other", ["0", pytest.param("G(x)", marks=pytest.mark.slow)])
def test_leaves_are_right_where_sets_cross(other: str) -> None:
    """x'' = F(x) y', y'' = 0 has an L, though x'' = F(x) y' - a x, y'' = -b y has none."""
    functions = {"F": ["x"], "G": ["x"]} if other == "G(x)" else {"F": ["x"]}
    document = {
        "equations": {"x": "-a*x + F(x)*y'", "y": f"-b*y - {other}*x'"},
        "parameters": ["a", "b"], "functions": functions,
    }  # fmt: skip
    result = inverse_service.solve(document | {"family": True, "first_integrals": False})
    family = json.loads(result.to_json())["family"]
    system = random_members.system_of(document)
    names = nm.Names(("x", "y"), ("a", "b"), dict.fromkeys(functions, ("x",)))
    values = {"a": "0", "b": "0", "F(x)": "x^2"} | ({"G(x)": "0"} if other == "G(x)" else {})
    parts = (reader.read_formula(text, names) for pair in values.items() for text in pair)
    drawn = random_members.Drawn(tuple(map(closed_members.Solved, parts, parts)))
    *_, last = random_members.holders(system, family, drawn)
    assert family["leaves"][last]["verdict"] == "variational"
    assert family["covered"]


def test_an_entry_of_g_may_vanish_on_a_leaf(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies with drag: where m = k + (b^2 - a^2)/4, g_xx = 0, and Gamma(u) follows from the
    other entries: it is (a + b)/2, so L does not contain t where b = -a, and m = k, too.
    """
    monkeypatch.setattr(members, "SEARCH_SECONDS", 0.0)
    equations = {"x": "-a*x' - x + y", "y": "-b*y' - m*y + m*x"}
    system = read_system(["x", "y"], equations, ["a", "b", "m"])
    found = members.explore(system, ["a", "b", "m"], [], SolveOptions(), float("inf"))
    tree = found.unknowns.tree
    held = {
        frozenset(collecting.collect(tree(one)) for one in leaf.leaf.equations): leaf.verdicts
        for leaf in found.leaves
    }
    a, b, m = map(ex.Symbol, "abm")
    opposite = frozenset({collecting.collect(b + a), collecting.collect(m - 1)})
    assert held[opposite] == ("variational", "variational")
    assert found.covered


@pytest.mark.slow
@pytest.mark.parametrize("key", ["7 constant connections", "12w Weyl connection"])
def test_differential_conditions_are_completed_where_a_constant_is_a_root(key: str) -> None:
    """One quartic in six letters, or two equations between functions: the rest has no Lagrangian."""
    result = inverse_service.solve(FAMILIES[key] | {"family": True, "first_integrals": False})
    family = json.loads(result.to_json())["family"]
    assert family["covered"]
    assert family["leaves"][0]["verdict_with_time"] == "not_variational"
    assert all(leaf["verdict"] == "variational" for leaf in family["leaves"][1:])


def test_a_function_of_fewer_arguments_keeps_the_names_of_velocities() -> None:
    """A(x, y, y') that is A(y, y') is declared with y_dot, as certificates are."""
    y, slope = ex.Symbol("y"), ex.Velocity("y")
    whole = ex.Arbitrary("A", (ex.Symbol("x"), y, slope), (0, 0, 0))
    fewer = ex.Arbitrary("A", (y, slope), (0, 0))
    system = read_system(
        ["x", "y"], {"x": "-x + A(x, y, y')", "y": "-y"}, (), {"A": ["x", "y", "y'"]}
    )
    solved = closed_members.Solved(whole, fewer, new_functions=("A",))
    assert closed_members.with_function(system, solved).functions == (("A", ("y", "y_dot")),)


@pytest.mark.parametrize("orders", [(1, 0), (0, 1), (1, 1), (2, 0), (0, 3), (2, 1)])
def test_the_general_solution_has_the_derivative_zero(orders: tuple[int, int]) -> None:
    """Of as many functions as the order says; the third derivative F_xxy is left alone."""
    x, y = ex.Symbol("x"), ex.Symbol("y")
    names = [f"F_{k}" for k in range(sum(orders))]
    found = closed_members.general_solution(ex.Arbitrary("F", (x, y), (0, 0)), orders, names)
    if orders == (2, 1):
        assert found is None
        return
    assert found is not None
    assert {node.name for node in ex.walk(found) if isinstance(node, ex.Arbitrary)} == {*names}
    for one, times in zip((x, y), orders, strict=True):
        for _ in range(times):
            found = calculus.differentiate(found, one)
    assert collecting.collect(found) == ex.ZERO


@pytest.mark.parametrize("equations", [{"x": "-x - c*x'"}, {"x": "y - x", "y": "2*x - y"}])
def test_a_member_alone_is_solved_without_its_family(
    equations: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("no family is asked for")

    monkeypatch.setattr(members, "explore", refused)
    document = {"equations": equations, "parameters": "guess", "first_integrals": False}
    result = inverse_service.solve(document)
    assert result.verdict == "variational" or result.verdict_with_time == "variational"


def test_a_product_vanishes_nowhere_if_none_of_its_factors_does() -> None:
    system = read_system(["x", "y"], {"x": "a*x + b*y", "y": "c*x"}, [*"abc"])
    work = members._prepared(system, [*"abc"], [], SolveOptions(), float("inf"))
    a, b = (work.exact.ring.value(ex.Symbol(name)).numerator for name in "ab")
    for nonzero, known in (((a,), False), ((b,), False), ((a, b), True)):
        leaf = leaves.Leaf(work.unknowns, nonzero=nonzero)
        assert completion._vanishes_nowhere(leaf, 2 * a * b) is known


def _three_letters() -> tuple[members._Work, list[fmpq_mpoly]]:
    system = read_system(["x", "y"], {"x": "a*x + b*y", "y": "c*x"}, [*"abc"])
    work = members._prepared(system, [*"abc"], [], SolveOptions(), float("inf"))
    return work, [work.exact.ring.value(ex.Symbol(name)).numerator for name in "abc"]


def test_a_minor_ends_with_its_time() -> None:
    work, (a, b, c) = _three_letters()
    matrix = [[a, b], [c, a]]
    assert members._polynomial_determinant(work, matrix, float("inf")) == a * a - b * c
    with pytest.raises(leaves.NotSplit, match="time"):
        members._polynomial_determinant(work, matrix, float("-inf"))


def test_equations_that_grow_too_long_leave_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    work, (a, b, c) = _three_letters()
    (leaf,) = leaves.split_leaf(leaves.Leaf(work.unknowns), [a - b], float("inf"))
    monkeypatch.setattr(leaves, "MOST_TERMS", 0.1)  # ten times this are one term
    assert members._reduced(leaf, [a * c + b + c, a - b + c]) == [c]
    with pytest.raises(leaves.NotSplit, match="terms"):
        members._reduced(leaf, [a * c + b + c])


def test_a_member_in_closed_form_has_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    work, (a, b, c) = _three_letters()
    (leaf,) = leaves.split_leaf(leaves.Leaf(work.unknowns), [a - b * c - 1], float("inf"))
    assert closed_members.member_of(work.system, leaf) is not None
    with monkeypatch.context() as patched:
        patched.setattr(bounds, "TERMS", 2)
        assert closed_members.member_of(work.system, leaf) is None
    monkeypatch.setattr(closed_members, "SECONDS", -1.0)
    assert closed_members.member_of(work.system, leaf) is None


def test_two_letters_vanish_together_in_a_simple_set() -> None:
    work, letters = _three_letters()
    found = members._simple_sets(work, leaves.Leaf(work.unknowns))
    sets = [{*map(str, one.equations)} for one in found]
    assert all({str(one)} in sets for one in letters)
    assert all({*map(str, pair)} in sets for pair in itertools.combinations(letters, 2))


def test_what_lies_in_a_leaf_that_was_asked_for_is_not_asked_again() -> None:
    """Its own next leaves hold what differs inside, unless some of them are open."""
    work, (a, b, c) = _three_letters()
    one, other, both, apart = (
        leaves.split_leaf(leaves.Leaf(work.unknowns), equations, float("inf"))[0]
        for equations in ([a], [b], [a, c], [b, c])
    )
    work.simple += [one, other, both, apart]
    work.found += [members.Found(leaves.Leaf(work.unknowns), None, "not_variational", None)]
    work.found += [members.Found(one, 0, "variational", None)]
    assert members._is_inside_another(work, both)
    assert not members._is_inside_another(work, apart)
    work.open += [members.Open(1, (), "not split")]
    assert not members._is_inside_another(work, both)


def test_the_time_for_splitting_ends_within_an_equation(monkeypatch: pytest.MonkeyPatch) -> None:
    """That it is long is seen by the products alone, not only between two equations."""
    work, (a, b, c) = _three_letters()
    (leaf,) = leaves.split_leaf(leaves.Leaf(work.unknowns), [a**2 - b], float("inf"))
    ends = list[float]()
    plain = leaves.Leaf.reduced_once

    def seen(self: leaves.Leaf, polynomial: fmpq_mpoly) -> Any:
        ends.append(deadline.end())
        return plain(self, polynomial)

    monkeypatch.setattr(leaves.Leaf, "reduced_once", seen)
    end = deadline.now() + 5.0
    leaves.split_leaf(leaf, [a**3 - c], end)
    assert ends
    assert set(ends) == {end}
    assert deadline.end() > end


@pytest.mark.slow
def test_pairs_of_springs_with_one_condition_left_are_one_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """q'' = A q' + B q with [A, P] a multiple of P = B + A^2/4 without its trace, or P = 0."""
    monkeypatch.setattr(members, "SEARCH_SECONDS", 0.0)
    document = FAMILIES["8 gain matrix of two oscillators"] | {"family": True}
    family = json.loads(inverse_service.solve(document).to_json())["family"]
    assert family["covered"]
    assert len(family["leaves"]) == 5
    rng = random.Random(2)
    *_, plane, whole = family["leaves"]
    assert [one["text"] for one in plane["equations"]] == ["c = b", "d = a - b"]
    names = nm.Names((), tuple("abcd"), {})
    for _ in range(5):
        a, b = (ex.number(rng.randint(-9, 9)) for _ in range(2))
        values = dict(zip(map(ex.Symbol, "abcd"), (a, b, b, a - b), strict=True))
        for one in whole["equations"]:
            tree = reader.read_formula(
                "-".join(f"({side})" for side in one["text"].split(" = ")), names
            )
            assert collecting.collect(ex.substitute(tree, values)) == ex.ZERO


@pytest.mark.slow
def test_a_planet_without_drag_is_a_member(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drag f(r) and g(r) of Kepler's problem: not all sets are split, but f = g = 0 is seen."""
    monkeypatch.setattr(members, "SEARCH_SECONDS", 0.0)
    equations = {"r": "r*phi'^2 - 1/r^2 - f(r)*r'", "phi": "-2*r'*phi'/r - g(r)*phi'"}
    document = {"equations": equations, "functions": {"f": ["r"], "g": ["r"]}, "family": True}
    result = inverse_service.solve(document | {"first_integrals": False})
    family = json.loads(result.to_json())["family"]
    assert ["f(r) = 0", "g(r) = 0"] in [
        [one["text"] for one in leaf["equations"]]
        for leaf in family["leaves"]
        if leaf["verdict"] == "variational"
    ]
    assert family["checked"] == "valid"


def test_an_open_set_is_named_by_all_factors_of_its_equation() -> None:
    """The checker looks for the equation of its own computation in it."""
    work, (a, b, c) = _three_letters()
    named = members._in_factors(work, (a - b) ** 2 * (a * b + c) * 3)
    assert printing.to_text(named) == "(a*b + c)*(b - a)^2"
    x = work.exact.ring.value(ex.Symbol("x")).numerator
    shown = members._in_factors(work, x**8 * (x + 1) * (a - b))
    assert printing.to_text(shown) == "(x + 1)*(b - a)"


@pytest.mark.slow
def test_what_is_outside_an_open_set_with_long_factors_is_checked() -> None:
    forces = {"x": "-diff(V(x, y), x)", "y": "-(x*x'*y' + diff(V(x, y), y))/(1 + x^2)"}
    document = {"equations": forces, "functions": {"V": ["x", "y"]}, "family": True}
    result = inverse_service.solve(document | {"first_integrals": False})
    family = json.loads(result.to_json())["family"]
    assert (family["checked"], family["covered"]) == ("valid", False)


@pytest.mark.parametrize("exponent", [-2, -1, 0, 1, 2, 3])
def test_small_exponents_are_sets_of_members_that_are_looked_at(exponent: int) -> None:
    """At these x^a may be made of other powers of x, as x^3 next to x^a at a = 3."""
    system = read_system(["x", "y"], {"x": "x^a*y", "y": "x^3"}, ["a"])
    options = SolveOptions(None, 1, 60.0)
    work = members._prepared(system, ("a",), (), options, float("inf"))
    places = {name: k for k, name in work.unknowns.letters.items()}
    found = list(members._special_arguments(work))
    point = [7] * len(work.exact.ring.field.context.gens())
    point[places["a"]] = exponent
    assert any(not any(part(*point) for part in parts) for parts in found)


@pytest.mark.parametrize(
    ("lagrangian", "fails"),
    [
        ("x'^2/(2*a) + y'^2/2 - x^2/2 - y^2/2", True),  # L has no value
        ("a*x'^2/2 + y'^2/2 - a^2*x^2/2 - y^2/2", True),  # det g = a
        ("x'^2/2 + y'^2/2 - a*x^2/2 - y^2/2", False),
    ],
)
def test_members_without_this_lagrangian_are_those_where_it_is_singular_or_has_no_value(
    lagrangian: str, fails: bool
) -> None:
    """Of x'' = -a x, y'' = -y these are x'' = 0, y'' = -y, if any."""
    system = read_system(["x", "y"], {"x": "-a*x", "y": "-y"}, ["a"])
    work = members._prepared(system, ["a"], [], SolveOptions(), float("inf"))
    tree = reader.read_formula(lagrangian, nm.Names(("x", "y"), ("a",), {}))
    found = regularity.where_it_fails(work.unknowns, system, tree, (), float("inf"))
    (letter,) = work.unknowns.letters
    gone = work.unknowns.context.gen(letter)
    assert found == ([[gone]] if fails else [])
