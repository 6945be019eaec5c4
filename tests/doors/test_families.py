"""Families: which members have a Lagrangian. Members on and off each leaf, each solved alone, agree
with the leaves.

The conditions of FAMILIES of constants were derived by hand; those of functions are from separation
of variables, from Douglas (1941), and from the force k(r) across the velocity, r (k r)' = k r (1 +
k r)(2 + k r).
"""

from __future__ import annotations

import copy
import functools
import itertools
import json
import random
import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
import sympy

import inverse_service
from inverse_service.decision import deciding
from inverse_service.expressions import refusals
from inverse_service.field import exact_field
from inverse_service.linear_pde import involution
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.service.documents import family_parts, family_tables, printed_pages, stated
from inverse_service.service.documents.printed_pages import latex_page, text_page
from inverse_service.statements.questions import TIMED
from tests.doors import calls
from tests.serving import until
from tests.values import slow

Values = dict[str, int]
FAMILIES: dict[str, tuple[dict[str, str], bool, Callable[[Values], bool]]] = {
    "damped coupled oscillators": (
        {"x": "-a*x' + b*y", "y": "-c*y' + d*x"}, True,
        lambda p: p["a"] in (p["c"], -p["c"]) or p["b"] == p["d"] == 0,
    ),
    "potentials of degree three (Henon, Heiles)": (
        {"x": "-x - 2*a*x*y", "y": "-y - b*x^2 + c*y^2"}, False,
        lambda p: p["a"] * p["b"] != 0 or (p["a"] == 0 and p["b"] * p["c"] == 0) or (p["b"] == 0 and p["a"] == -p["c"]),
    ),
    "coupled van der Pol oscillators": (
        {"x": "-x + m*(1 - x^2)*x' + a*y", "y": "-y + m*(1 - y^2)*y' + b*x"}, False,
        lambda p: p["m"] == 0 or p["a"] == p["b"] == 0,
    ),
    "gyroscopic forces and a potential": (
        {"x": "w*y' - k*x", "y": "-u*x' - m*y"}, True,
        lambda p: p["w"] * p["u"] != 0 or p["k"] == p["m"] or p["w"] == p["u"] == 0,
    ),
    "a force quadratic in one velocity": (
        {"x": "-a*y", "y": "-b*x'^2"}, False, lambda p: p["a"] * p["b"] == 0,
    ),
    "springs": ({"x": "-a*x + b*y", "y": "c*x - d*y"}, True, lambda p: True),
}  # fmt: skip


def asked(equations: dict[str, str], timed: bool | None = None, **more: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"equations": equations, "parameters": "guess", "family": True}
    found |= {"first_integrals": False, **more}
    return found if timed is None else found | {"time_dependent_lagrangian": timed}


def solved(document: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(_solved_once(json.dumps(document)))
    return found


@functools.cache
def _solved_once(document: str) -> str:
    return inverse_service.solve(document, time_limit=120).to_json()


def leaf_of(family: Mapping[str, Any], values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The last leaf whose equations and inequations these values of the constants satisfy."""
    fitting = [
        leaf
        for leaf in family["leaves"]
        if not any(
            value_of(one["text"].replace(" = ", " - (") + ")", values) for one in leaf["equations"]
        )
        and all(value_of(text, values) for text in leaf["nonzero"])
    ]
    return fitting[-1]


def value_of(text: str, values: Mapping[str, Any]) -> sympy.Expr:
    """A formula in constants with rational values, exactly."""
    table = {
        name: sympy.Rational(value.numerator, value.denominator) for name, value in values.items()
    }
    return sympy.sympify(text.replace("^", "**"), locals=table)


@pytest.mark.parametrize("name", [slow(name) if k else name for k, name in enumerate(FAMILIES)])
def test_the_leaves_are_the_conditions_derived_by_hand(name: str) -> None:
    equations, timed, exists = FAMILIES[name]
    result = solved(asked(equations, timed))
    family, names = result["family"], result["system"]["parameters"]
    assert family["covered"], family["open"]
    for numbers in itertools.product((-1, 0, 1, 2), repeat=len(names)):
        values = dict(zip(names, numbers, strict=True))
        leaf = leaf_of(family, {name: Fraction(value) for name, value in values.items()})
        assert (leaf["verdict_with_time" if timed else "verdict"] == "variational") == exists(
            values
        ), values


# Equations, constants; members on each leaf and members off all are drawn.
DRAWN = [
    ({"x": "-a*y", "y": "-b*x'^2"}, "ab"),
    slow({"x": "-a*x' + b*y", "y": "c*x - d*y'"}, "abcd"),
    slow({"x": "-a*x'^2 - b*x'*y' - c*y'^2", "y": "-k*y'^2"}, "abck"),
    slow({"x": "-x - a*y' + b*y", "y": "-c*y + d*x'"}, "abcd"),
    slow({"x": "a*x*y", "y": "b*x^2 + c*y^2"}, "abc"),
    slow({"x": "-a*x' - b*y' - p*x", "y": "-c*x' - d*y' - m*y"}, "abcdpm"),
    slow({"x": "-x - a*x' - b*y'", "y": "-2*y - c*x' - d*y'"}, "abcd"),
    slow({"x": "a*y' + b*y", "y": "c*x + d*x'"}, "abcd"),
    slow({"x": "-y + k*x + l*y'", "y": "-x + m*x'"}, "klm"),
    slow({"x": "-a*x - b*y + cos(t)", "y": "-c*x - d*y - k*x' + sin(t)"}, "abcdk"),
    slow({"x": "-x - 2*a*x*y", "y": "-y - b*x^2 + c*y^2"}, "abc"),
    slow({"x": "-x + e*(1 - x^2)*x' + a*y", "y": "-y + e*(1 - y^2)*y' + b*x"}, "abe"),
    slow({"x": "-a*x' + b*y", "y": "-c*y' + d*z", "z": "-e*z' + k*x"}, "abcdek"),
]


def members(
    result: Mapping[str, Any], source: random.Random, count: int
) -> list[dict[str, Fraction]]:
    """Random values of the constants, some on each leaf by its solved constants, some anywhere."""
    names, found = result["system"]["parameters"], list[dict[str, Fraction]]()
    symbols = {name: sympy.Symbol(name) for name in names}
    for leaf in result["family"]["leaves"]:
        lines = [part["text"].split(" = ") for part in leaf["solved"]]
        for _ in range(count):
            values = {
                name: sympy.Rational(source.randint(-6, 6), source.choice((1, 1, 2)))
                for name in names
            }
            for left, right in lines:
                value = sympy.sympify(right.replace("^", "**"), locals=symbols).subs(values)
                values[left] = value
            if all(value.is_Rational for value in values.values()):
                found.append(
                    {name: Fraction(int(value.p), int(value.q)) for name, value in values.items()}
                )
    return found


@pytest.mark.parametrize(("equations", "names"), DRAWN)
def test_members_solved_alone_agree_with_their_leaf(
    equations: dict[str, str], names: str, request: Any
) -> None:
    result = solved(asked(equations, parameters=[*names]))
    count = 30 if request.node.get_closest_marker("slow") else 1
    for values in members(result, random.Random(5), count):
        leaf = leaf_of(result["family"], values)
        plain = {name: str(value) for name, value in values.items()}
        alone = inverse_service.solve(
            {"equations": equations, "parameters": plain, "first_integrals": False}
        )
        assert (alone["verdict"], alone["verdict_with_time"]) == (
            leaf["verdict"],
            leaf["verdict_with_time"],
        ), values


OF_FUNCTIONS: list[tuple[dict[str, str], dict[str, list[str]], list[dict[str, str]], list[dict[str, str]]]] = [
    (
        {"x": "F(x, y)", "y": "-y"}, {"F": ["x", "y"]},
        [{"F": "x^3"}, {"F": "-x + (x + 2*y)^2"}, {"F": "-x + sin(y)"}, {"F": "-x"}, {"F": "3*x + 2*y"}],
        [{"F": "x*y"}, {"F": "x + y^2"}, {"F": "x^2 + y"}],
    ),
    (
        {"x": "-V'(x)", "y": "-x*x'*y'/(1 + x^2)"}, {"V": ["x"]},
        [{"V": "0"}, {"V": "3*sqrt(1 + x^2)"}, {"V": "5 - sqrt(1 + x^2)"}],
        [{"V": "x"}, {"V": "x^2"}, {"V": "1/(1 + x^2)"}],
    ),
    (
        {"r": "r*phi'^2 + k(r)*r^2*phi'^2", "phi": "-(2/r + k(r))*r'*phi'"}, {"k": ["r"]},
        [{"k": "0"}, {"k": "-1/r"}, {"k": "-2/r"}, {"k": "(1/sqrt(1 - r^2) - 1)/r"}],
        [{"k": "1/r"}, {"k": "2"}, {"k": "r"}],
    ),
    (
        {"x": "a(x)*y'", "y": "b(x)*x'"}, {"a": ["x"], "b": ["x"]},
        [{"a": "0", "b": "x"}, {"a": "x^2", "b": "3*x^2"}], [{"a": "x", "b": "x^2"}, {"a": "1", "b": "x"}],
    ),
]  # fmt: skip


def put_in(
    equations: dict[str, str], functions: dict[str, list[str]], member: dict[str, str]
) -> dict[str, str]:
    """The equations with formulas in the place of functions, and with their derivatives."""
    found = dict(equations)
    for name, text in member.items():
        (argument, *_) = functions[name]
        slope = sympy.diff(sympy.sympify(text.replace("^", "**")), sympy.Symbol(argument))
        whole = f"{name}({', '.join(functions[name])})"
        for key, formula in found.items():
            formula = formula.replace(f"{name}'({argument})", f"({str(slope).replace('**', '^')})")
            found[key] = formula.replace(whole, f"({text})")
    return found


@pytest.mark.parametrize(
    ("equations", "functions", "on", "off"),
    [
        (*OF_FUNCTIONS[1][:2], [{"V": "5 - sqrt(1 + x^2)"}], [{"V": "x"}]),
        *(slow(*row) for row in OF_FUNCTIONS),
    ],
)
def test_functions_on_a_leaf_have_a_lagrangian_and_others_have_none(
    equations: dict[str, str],
    functions: dict[str, list[str]],
    on: list[dict[str, str]],
    off: list[dict[str, str]],
) -> None:
    family = solved(asked(equations, functions=functions))["family"]
    assert family["covered"], family["open"]
    leaves = [leaf for leaf in family["leaves"] if leaf["verdict_with_time"] == "variational"]
    for member, exists in [*((one, True) for one in on), *((one, False) for one in off)]:
        fitting = [
            leaf
            for leaf in leaves
            if all(satisfied(one["text"], functions, member) for one in leaf["equations"])
        ]
        assert bool(fitting) is exists, member
        alone = inverse_service.solve(
            {"equations": put_in(equations, functions, member), "first_integrals": False}
        )
        assert (alone["verdict_with_time"] == "variational") is exists, member


def satisfied(text: str, functions: dict[str, list[str]], member: dict[str, str]) -> bool:
    """Whether an equation between functions holds for these formulas, by SymPy."""
    table = {name: sympy.sympify(formula.replace("^", "**")) for name, formula in member.items()}
    left, right = text.replace("^", "**").split(" = ")
    for name, arguments in functions.items():
        (argument, *_) = arguments
        for order in (4, 3, 2, 1):
            left = left.replace(
                f"{name}{chr(39) * order}({argument})",
                f"diff({name}({argument}), {', '.join([argument] * order)})",
            )
    places = {name: sympy.Symbol(name) for of in functions.values() for name in of}

    def function_of(name: str) -> Callable[..., sympy.Expr]:
        return lambda *_: table[name]

    scope = places | {name: function_of(name) for name in functions} | {"diff": sympy.diff}
    value = sympy.sympify(f"({left}) - ({right})", locals=scope)
    return bool(sympy.simplify(value) == 0)


@pytest.fixture(scope="module")
def oscillators() -> dict[str, Any]:
    return solved(asked({"x": "-a*x' + b*y", "y": "c*x - d*y'"}, parameters=["a", "b", "c", "d"]))


def test_a_family_is_checked_and_printed(oscillators: dict[str, Any]) -> None:
    report = inverse_service.check(oscillators)
    assert report["verdict"] == "valid", report["contradictions"]
    for place, leaf in enumerate(oscillators["family"]["leaves"]):
        for key in ("equations/0/text", "verdict", "lagrangian/text") if leaf["lagrangian"] else ():
            assert f"/family/leaves/{place}/{key}" not in report["not_checked"]
    text = text_page(oscillators, False)
    assert "regular Lagrangian. Three sets of members do, and no others." in text
    assert re.search(r"\n +d = -a +yes +L = ", text)
    assert "Not decided here" not in text
    assert r"\begin{tabular}" in latex_page(oscillators, False)


def test_the_call_and_the_page_have_the_family(service: str) -> None:
    """A spring and a force quadratic in one velocity: an L iff a = 0 or b = 0."""
    document = asked({"x": "-a*y", "y": "-b*x'^2"}, first_integrals=False)
    found = calls.solve(document, "http", service)["family"]
    assert found["covered"]
    assert found["checked"] == "valid"
    assert {one["text"] for leaf in found["leaves"] for one in leaf["equations"]} == {
        "a = 0",
        "b = 0",
    }
    begun = httpx.post(
        f"{service}/v1/solve", json=document, headers={"Prefer": "respond-async"}, timeout=60
    )
    job = begun.headers["Location"].rpartition("/")[2]

    def page() -> str:
        return httpx.get(f"{service}/results/{job}", timeout=60).text

    until(lambda: "data-leaf=" in page())
    assert page().count("<tr data-leaf=") == 3
    assert "Two sets of members do, and no others." in page()


@pytest.mark.slow
def test_lines_of_a_batch_have_families(tmp_path: Path) -> None:
    document = asked({"x": "-a*y", "y": "-b*x'^2"}, first_integrals=False)
    lines, answers = tmp_path / "lines", tmp_path / "answers"
    lines.write_text(json.dumps(document) + "\n")
    calls.command("batch", str(lines), "--output", str(answers), "--workers", "1")
    assert json.loads(answers.read_text())["family"]["covered"]


def forgeries(result: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Results with one false statement about a leaf."""
    found = list[tuple[str, dict[str, Any]]]()

    def forged(name: str, change: Callable[[list[dict[str, Any]]], object]) -> None:
        twin = copy.deepcopy(result)
        change(twin["family"]["leaves"])
        found.append((name, twin))

    for k, leaf in enumerate(result["family"]["leaves"]):
        forged(f"{k} other verdict", lambda one, k=k: one[k].update(verdict_with_time={
            "variational": "not_variational"}.get(one[k]["verdict_with_time"], "variational")))  # fmt: skip
        if not leaf["equations"]:
            continue
        forged(f"{k} too large", lambda one, k=k: one[k]["equations"].pop())
        forged(
            f"{k} other equation", lambda one, k=k: one[k]["equations"][0].update(text="a = 2*d")
        )
        forged(
            f"{k} product",
            lambda one, k=k: one[k]["equations"][0].update(text="(a - d)*(a + d)*b = 0"),
        )
        forged(f"{k} other values", lambda one, k=k: one[k]["solved"][0].update(text="d = 3*a"))
        forged(
            f"{k} other exceptions", lambda one, k=k: one[k]["proof"].update(exceptions=["a = 7"])
        )
        if leaf["lagrangian"]:
            forged(
                f"{k} other L", lambda one, k=k: one[k]["lagrangian"].update(text="x'^2/2 + y'^2/2")
            )
            forged(
                f"{k} L of another", lambda one, k=k: one[k].update(proof=one[k % 3 + 1]["proof"])
            )
            forged(f"{k} no proof", lambda one, k=k: one[k].update(proof=None))
    return found


@pytest.mark.parametrize(
    ("verdict", "with_time", "said"),
    [
        ("variational", "variational", "has a Lagrangian L(q, q')"),
        ("variational", None, "has a Lagrangian L(q, q')"),
        ("not_variational", "variational", "has a Lagrangian L(t, q, q'), and none without t"),
        ("not_variational", "not_variational", "has no regular Lagrangian"),
        ("not_variational", None, "has no regular Lagrangian L(q, q')"),
        (None, "variational", "has a Lagrangian L(t, q, q')"),
        (None, "not_variational", "has no regular Lagrangian"),
    ],
)
def test_what_is_said_of_a_set_is_its_two_verdicts(
    verdict: str | None, with_time: str | None, said: str
) -> None:
    leaf = SimpleNamespace(shown=(), nonzero=())
    found = SimpleNamespace(verdict=verdict, timed=with_time, inside=None, leaf=leaf, solved=())
    family: Any = SimpleNamespace(leaves=[found], unknowns=None)
    assert family_parts._set_fields(family, 0)["statement"] == f"the general member {said}"


def test_a_no_is_one_without_the_time_where_only_that_was_asked(
    oscillators: dict[str, Any],
) -> None:
    """x'' = -x y - a x', y'' = -x^2/2 - a y' has exp(a t) (...), and no L(q, q') but for a = 0."""
    plain = copy.deepcopy(oscillators)
    for leaf in plain["family"]["leaves"]:
        leaf["verdict_with_time"] = None
    both = (plain, oscillators)
    text = text_page(plain, False)
    assert "Almost no member comes from a regular Lagrangian without the time. Three sets" in text
    assert re.search(r"in general +none without the time\n", text)
    assert "without the time" not in text_page(oscillators, False)
    told = [table.members[0].statement for table in map(family_tables.table_of, both) if table]
    assert told == [
        f"This member has no Lagrangian{without}." for without in (" without the time", "")
    ]
    plain["family"]["leaves"] = plain["family"]["leaves"][:1]
    assert family_tables.badge_of(plain).words == "no member has a Lagrangian without the time"
    assert "No member comes from a regular Lagrangian without the time." in text_page(plain, False)


def test_no_false_statement_about_a_leaf_is_valid(oscillators: dict[str, Any]) -> None:
    assert len(forgeries(oscillators)) > 20
    refuse([one for one in forgeries(oscillators) if one[0].startswith("2 ")][:4])


@pytest.mark.slow
def test_none_of_the_other_false_statements_is_valid(oscillators: dict[str, Any]) -> None:
    refuse(forgeries(oscillators))


def refuse(kept: list[tuple[str, dict[str, Any]]]) -> None:
    for name, twin in kept:
        report = inverse_service.check(twin)
        product = "product" in name  # a larger set is not called the leaf
        unchecked = any(one.endswith("/equations") for one in report["not_checked"])
        assert report["verdict"] != "valid" or (product and unchecked), name


@pytest.mark.parametrize(
    ("family", "pointer"),
    [
        ({"letters": ["q"]}, "/family/letters"),
        ({"functions": {"F": ["x"]}}, "/family/functions"),
        ("yes", "/family"),
    ],
)
def test_a_family_in_names_that_are_not_declared_is_refused(family: Any, pointer: str) -> None:
    from inverse_service.errors import InputError

    document = {"equations": {"x": "-a*x"}, "parameters": ["a"], "family": family}
    with pytest.raises(InputError) as refusal:
        inverse_service.solve(document)
    assert refusal.value.places[0].pointer.startswith(pointer)


@pytest.mark.parametrize(
    ("arguments", "equation", "solved"),
    [
        (["x'"], "F'(x') = 0", {"text": "F(x') = F_0", "new_constants": ["F_0"], "new_functions": []}),
        (["x'"], "F''(x') = 0", {"text": "F(x') = F_0*x' + F_1", "new_constants": ["F_0", "F_1"], "new_functions": []}),
        (["x", "x_dot"], "diff(F(x, x'), x) = 0", {"text": "F(x, x') = F(x')", "new_constants": [], "new_functions": ["F"]}),
    ],
)  # fmt: skip
def test_solved_functions_of_velocities_are_read(
    arguments: list[str], equation: str, solved: dict[str, Any]
) -> None:
    """They were not, and `check` called a result with such a set invalid."""
    called = solved["text"].partition(" = ")[0]
    document = {"equations": {"x": f"-x + {called}"}, "functions": {"F": arguments}}
    leaf = {"equations": [{"text": equation}], "solved": [solved]}
    system = family_parts.system_of_leaf(document, leaf)
    assert system is not None
    value = solved["text"].partition(" = ")[2]
    assert family_parts.is_written_otherwise(system, {"x": f"-x + {value}"})
    assert family_parts.follows(document, leaf)


@pytest.mark.parametrize("argument", ["x'", "x_dot", "\\dot x"])
def test_a_velocity_is_named_in_a_family_as_in_the_functions(argument: str) -> None:
    """F(x') was refused: "F depends on x_dot"."""
    from inverse_service.errors import InputError
    from inverse_service.service.documents import accepting, family_parts

    asked = {"equations": {"x": "F(x')"}, "functions": {"F": ["x'"]}}
    schema = accepting.to_schema(
        accepting.prepared(asked | {"family": {"functions": {"F": [argument]}}}).document
    )
    system = accepting.to_system(schema)
    assert family_parts.names_of_family(schema, system).functions == {"F": ["x_dot"]}
    other = schema.model_copy(
        update={"family": schema.family.model_copy(update={"functions": {"F": ["x"]}})}
    )  # type: ignore[union-attr]
    with pytest.raises(InputError, match=r"`F` is declared as `F\(x'\)`"):
        family_parts.names_of_family(other, system)


def test_the_order_of_answers_is_the_same_for_long_lagrangians(oscillators: dict[str, Any]) -> None:
    """In a check longer texts are read than elsewhere; the simplest L comes first all the same."""
    long = copy.deepcopy({key: one for key, one in oscillators.items() if key != "answers"})
    shown = next(one for one in long["family"]["leaves"] if one["lagrangian"])
    shown["lagrangian"]["text"] = " + ".join(["x'^2"] * 2100)
    here = stated.answers_of(long)
    with refusals.longer_texts(stated.LONGER):
        assert stated.answers_of(long) == here


def linear_forces() -> dict[str, Any]:
    """x'' = F x', y'' = G y' with constants F, G, as a set of a family of functions: one L with t, and
    a proof that there is one without.
    """
    text = "(exp(-F_0*t)*x'^2 + exp(-G_0*t)*y'^2)/2"
    own: dict[str, Any] = {"parameters": ["F_0", "G_0"], "checked": "valid", "domain": []}
    timed = own | {"certificate": {"question": "time_dependent"}}
    plain = own | {"certificate": {"question": "autonomous"}, "exceptions": ["G_0 = 0"]}
    return {
        "id": 1, "inside": 0, "equations": [{"text": "F'(y) = 0"}, {"text": "G'(x) = 0"}], "nonzero": [], "solved": [],
        "verdict": "variational", "verdict_with_time": "variational", "exceptions": [], "near": {"t": "1"},
        "lagrangian": {"text": text}, "proof": timed, "proof_without_time": plain,
    }  # fmt: skip


def test_a_lagrangian_with_t_is_no_answer_about_one_without() -> None:
    general = {"inside": None, "verdict": "not_variational", "verdict_with_time": "not_variational"}
    family: dict[str, Any] = {"leaves": [general, linear_forces()]}
    plain, timed = stated.in_family(family, stated.About.MAIN, False)
    assert (plain.question.timed, timed.question.timed) == (False, True)
    assert plain.verdict == timed.verdict == "variational"
    assert "lagrangian" not in plain.part
    assert plain.part["exceptions"] == ["G_0 = 0"]
    assert timed.part["lagrangian"]["text"].startswith("(exp(")
    for one, key in ((plain, "proof_without_time"), (timed, "proof")):
        assert one.at == f"/family/leaves/1/{key}"
        assert one.part["certificate"] == family["leaves"][1][key]["certificate"]


def test_a_solved_function_has_all_its_arguments_in_the_table() -> None:
    """B_y = 0, then B_x = 0: B(x) = B_0 alone is no function of the family."""
    solved = [
        {"text": "B(x, y) = B(x)", "new_constants": [], "new_functions": ["B"]},
        {"text": "B(x) = B_0", "new_constants": ["B_0"], "new_functions": []},
    ]
    equations = [{"text": "diff(B(x, y), y) = 0"}, {"text": "diff(B(x, y), x) = 0"}]
    leaf = {"equations": equations, "nonzero": [], "solved": solved}
    names = stated.names_of({"coordinates": ["x", "y"], "functions": {"B": ["x", "y"]}})
    said = [getattr(one, "text", one) for one in family_tables.where_of(leaf, names)]
    assert said[-2:] == [", so ", "B(x, y) = B_0"]


@pytest.mark.slow
def test_equal_springs_that_change_with_the_time_have_all_lagrangians() -> None:
    """x'' = -w(t) x + a y', y'' = -w(t) y + b x': Phi is (w - a b/4) times 1, also for a b = 0, where
    the L of the general member is singular.
    """
    document = asked(
        {"x": "-w(t)*x + a*y'", "y": "-w(t)*y + b*x'"}, parameters=["a", "b"],
        functions={"w": ["t"]},
    )  # fmt: skip
    family = solved(document)["family"]
    assert (family["covered"], family["checked"], len(family["leaves"])) == (True, "valid", 1)


def test_the_lagrangian_of_a_set_is_read_with_its_new_constants() -> None:
    """Else the order of answers would be another one in a check."""
    *_, timed = stated.in_family(
        {"leaves": [{"inside": None}, linear_forces()]}, stated.About.MAIN, False
    )
    system = {"coordinates": ["x", "y"], "parameters": [], "functions": {"F": ["y"], "G": ["x"]}}
    assert stated._with_formula(timed, system).formula is not None


@pytest.mark.parametrize(
    ("solution", "expected"),
    [("V_0*sqrt(x^2 + 1) + V_1", True), ("V_0*x^2 + V_1", False)],
)
def test_a_function_of_fewer_arguments_is_solved_again(solution: str, expected: bool) -> None:
    """V_y = 0 and x (1 + x^2) V_xx = V_x: V = V(x) first, then V(x) in closed form."""
    document = {
        "equations": {"x": "-diff(V(x, y), x)", "y": "-x*x'*y'/(1 + x^2) - diff(V(x, y), y)"},
        "functions": {"V": ["x", "y"]},
    }
    texts = ["diff(V(x, y), y) = 0", "x*(1 + x^2)*diff(V(x, y), x, x) - diff(V(x, y), x) = 0"]
    parts = [
        {"text": "V(x, y) = V(x)", "new_constants": [], "new_functions": ["V"]},
        {"text": f"V(x) = {solution}", "new_constants": ["V_0", "V_1"], "new_functions": []},
    ]
    leaf = {"equations": [{"text": one} for one in texts], "solved": parts}
    assert family_parts.follows(document, leaf) is expected


@pytest.mark.parametrize(
    ("equation", "solution", "names", "expected"),
    [
        ("diff(V(x, y), x, y) = 0", "V_0(x) + V_1(y)", ["V_0", "V_1"], True),
        ("diff(V(x, y), x, x) = 0", "V_0(y) + x*V_1(y)", ["V_0", "V_1"], True),
        ("diff(V(x, y), x, x) = 0", "V_0(x) + V_1(y)", ["V_0", "V_1"], False),
        ("diff(V(x, y), x, y) = 0", "V_0(x) + V_0(y)", ["V_0", "V_0"], None),
    ],
)
def test_functions_of_one_coordinate_are_put_in_for_one_of_two(
    equation: str, solution: str, names: list[str], expected: bool | None
) -> None:
    """V_xy = 0 is V_0(x) + V_1(y), V_xx = 0 is V_0(y) + x V_1(y), and not the other way round."""
    document = {
        "equations": {"x": "-diff(V(x, y), x)", "y": "-2*diff(V(x, y), y)"},
        "functions": {"V": ["x", "y"]},
    }
    solved = {"text": f"V(x, y) = {solution}", "new_constants": [], "new_functions": names}
    leaf = {"equations": [{"text": equation}], "solved": [solved]}
    if expected is None:
        assert family_parts.system_of_leaf(document, leaf) is None
    else:
        assert family_parts.follows(document, leaf) is expected
        assert family_parts.system_of_leaf(document, leaf) is not None


@pytest.mark.slow
def test_a_potential_of_two_parts_has_its_lagrangian() -> None:
    """x'' = -V_x + B y', y'' = -a V_y - C x': where V_xy = 0, g = diag(C, B) does."""
    document = {
        "equations": {"x": "-diff(V(x, y), x) + B*y'", "y": "-a*diff(V(x, y), y) - C*x'"},
        "parameters": ["a", "B", "C"], "functions": {"V": ["x", "y"]},
    }  # fmt: skip
    found = solved(document | {"family": True, "first_integrals": False})
    family = found["family"]
    assert family["covered"]
    leaf = next(one for one in family["leaves"] if len(one["solved"]) == 1 and one["lagrangian"])
    assert leaf["solved"][0]["text"] == "V(x, y) = V_0(x) + V_1(y)"
    assert "V_0(x)" in leaf["lagrangian"]["text"]
    assert "V_1(y)" in leaf["lagrangian"]["text"]
    assert inverse_service.check(found)["verdict"] == "valid"


@pytest.mark.parametrize(("is_too_large", "expected"), [(True, None), (False, False)])
def test_what_is_too_large_to_be_decided_is_no_contradiction(
    is_too_large: bool, expected: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """b = c does not hold for b = 2 c, but whether it does may not be decided."""

    def too_large(*_: object, **__: object) -> None:
        raise exact_field.TooLarge("as a large formula is")

    if is_too_large:
        monkeypatch.setattr(family_parts.exact_field, "exact_ring", too_large)
    document = {"equations": {"x": "-b*y", "y": "-c*y"}, "parameters": ["b", "c"]}
    solved = [{"text": "b = 2*c", "new_constants": [], "new_functions": []}]
    leaf = {"equations": [{"text": "b = c"}], "solved": solved}
    assert family_parts.follows(document, leaf) is expected


@pytest.mark.slow
def test_only_the_constants_that_are_named_are_free() -> None:
    named = {"letters": ["a"]}
    found = solved(
        asked(
            {"x": "-a*x' + b*y", "y": "c*x - d*y'"}, parameters=["a", "b", "c", "d"], family=named
        )
    )
    texts = [[one["text"] for one in leaf["equations"]] for leaf in found["family"]["leaves"]]
    assert texts == [[], ["a = d"], ["a = -d"]]


def test_special_cases_means_a_family() -> None:
    document = asked({"x": "-a*x + b*y", "y": "c*x - d*y"}) | {"special_cases": True}
    del document["family"]
    assert solved(document)["family"]["covered"]


def test_members_at_which_an_inequation_fails_belong_to_another_leaf() -> None:
    """Three oscillators in a ring have an L for b = -a, here -1, but not where it is open, c = 0."""
    equations = {"x": "y + x'", "y": "z + b*y'", "z": "c*x"}
    family = solved(asked(equations, True, parameters=["b", "c"], first_integrals=False))["family"]
    for c, verdict in ((1, "variational"), (0, "not_variational")):
        values = {"b": Fraction(-1), "c": Fraction(c)}
        assert leaf_of(family, values)["verdict"] == verdict
        alone = read_system(["x", "y", "z"], equations, {"b": "-1", "c": str(c)})
        assert deciding.decide(alone, TIMED, limits=involution.Limits()).verdict == verdict


@pytest.mark.slow
def test_sparse_conditions_of_four_coordinates_have_their_leaf() -> None:
    """The first associated system of a two-wheeled carriage (Bloch, Fernandez, Mestdag 2009): free
    for R = 0 alone.
    """
    carriage = {"p": "0", "s": "0", "x": "R/2*sin(p)*p'*s'", "y": "-R/2*cos(p)*p'*s'"}
    result = solved(asked(carriage, False, first_integrals=False))
    for value, verdict in ((0, "variational"), (1, "not_variational")):
        assert leaf_of(result["family"], {"R": Fraction(value)})["verdict"] == verdict
    assert result["family"]["covered"]
    assert result["instead"]["conditions"] == ["R = 0"]
    assert result["instead"]["checked"] == "valid"


@pytest.mark.parametrize(
    ("force", "functions", "family"),
    [
        ({"x": "F(x)", "y": "a*x - y"}, {"F": ["x"]}, {"letters": ["a"]}),
        slow({"x": "F(x, y)", "y": "-y"}, {"F": ["x", "y"]}, True),
    ],
)
def test_a_function_in_the_lagrangian_of_a_leaf_is_defined(
    force: dict[str, str], functions: dict[str, list[str]], family: Any
) -> None:
    """L = T - V with V_x = -F(x), V_y = y where a = 0 or F_y = 0: text and LaTeX say what V is, as
    JSON.
    """
    document = asked(force, False, functions=functions, first_integrals=False)
    result = solved(document | {"family": family})
    leaf = next(one for one in result["family"]["leaves"] if one.get("lagrangian"))
    (name,) = leaf["lagrangian"]["auxiliary"]
    assert leaf["lagrangian"]["auxiliary"][name]["derivatives"] == {"x": "-F(x)", "y": "y"}
    said = f"L = {leaf['lagrangian']['text']} with "
    assert f"{said}d{name}(x, y)/dx = -F(x), d{name}(x, y)/dy = y" in text_page(result, False)
    lines = latex_page(result, False).partition("begin{tabular}")[2].splitlines()
    row = next(line for line in lines if " with " in line)
    assert row.count(f"\\partial {name}") == 2 or row.count(f"d{name}") == 2


@pytest.mark.slow
def test_a_set_comes_after_the_sets_around_it_whatever_their_number_of_equations() -> None:
    """x'' = -V_x, y'' = -V_y - a x: V = v(x) + w(y) + c x y has an L for c (c + a) != 0, and v, w of
    degree 3 none for c = 0: one equation V_xy = 0 inside the set of V_xxy = V_xyy = 0.
    """
    force = {"x": "-diff(V(x, y), x)", "y": "-diff(V(x, y), y) - a*x"}
    family = solved(asked(force, functions={"V": ["x", "y"]}, first_integrals=False))["family"]
    assert family["covered"], family["open"]
    texts = [[one["text"] for one in leaf["equations"]] for leaf in family["leaves"]]
    outer = texts.index(["diff(V(x, y), x, x, y) = 0", "diff(V(x, y), x, y, y) = 0"])
    inner = texts.index(["diff(V(x, y), x, y) = 0"])
    assert outer < inner
    assert family["leaves"][outer]["verdict_with_time"] == "variational"
    assert family["leaves"][inner]["verdict_with_time"] == "not_variational"
    alone = {"x": "-x^2", "y": "-y^2 - x"}
    assert inverse_service.solve({"equations": alone})["verdict_with_time"] == "not_variational"


@pytest.mark.parametrize(
    ("long", "short"),
    [
        ("diff(F(x, y), x, x)", "F_xx"),
        ("G[1,0](x, y')", "G_x"),
        ("G[0,2](x, y')*y' - G[1,1](x, y')", "G_y'y'*y' - G_xy'"),
        ("F(x, y) - F'(x)", "F(x, y) - F'(x)"),
    ],
)
def test_derivatives_of_functions_are_short_in_the_table(long: str, short: str) -> None:
    assert printed_pages._DERIVATIVE.sub(printed_pages._subscripted, long) == short


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "functions", "count"),
    [
        ("x'' = F(y'); y'' = G(x)", {"F": ["y'"], "G": ["x"]}, 4),
        ("x'' = F(x, y)*y'; y'' = G(x, y)*x'", {"F": ["x", "y"], "G": ["x", "y"]}, 5),
    ],
)
def test_families_that_bases_split_are_covered(
    equations: str, functions: dict[str, list[str]], count: int
) -> None:
    document = {"equations": equations, "functions": functions, "family": True}
    result = solved(document | {"first_integrals": False})
    family = result["family"]
    assert family["covered"], family["open"]
    assert len(family["leaves"]) == count
    assert not result["left_out"]  # the family says more
    assert inverse_service.check(result)["verdict"] == "valid"
