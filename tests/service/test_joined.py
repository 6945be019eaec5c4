"""One formula for several cases: on each part it is L of the case, up to a constant."""

from __future__ import annotations

import json
import re
from typing import Any

import mpmath
import pytest

from inverse_service.expressions import calculus, tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import joined
from inverse_service.service.documents.checking import check_document

NAMES = nm.Names(("x", "y"), ("k",))


def branch(domain: str, text: str) -> dict[str, object]:
    return {"domain": [domain], "lagrangian": {"text": text, "domain": []}}


def value(text: str, x: str, y: str) -> mpmath.mpf:
    at: dict[ex.Expression, mpmath.mpf] = {
        ex.Symbol("x"): mpmath.mpf(x), ex.Symbol("y"): mpmath.mpf(y), ex.Symbol("k"): mpmath.mpf(3),
        ex.Velocity("x"): mpmath.mpf("0.7"), ex.Velocity("y"): mpmath.mpf("-1.1"),
    }  # fmt: skip
    return calculus.evaluate(reader.read_formula(text, NAMES), at)


@pytest.mark.parametrize(
    ("boundary", "below", "above", "joins"),
    [
        ("0", "x'^2/2 + x^2/2", "x'^2/2 - x^2/2", "x = 0"),
        ("0", "x'^2/2 + x", "x'^2/2 - x", ""),
        ("1", "x'^2/2 + x*(x - 2)/2", "x'^2/2 + x*(2 - x)/2", "x = 1"),
        ("0", "x'^2/2 + y'^2/2 + k*x^3*y", "x'^2/2 + y'^2/2 - x^2*sin(y)", "x = 0"),
        ("1/2", "x'^2/2 - x", "x'^2/2 - x", "x = 1/2"),
    ],
)
def test_the_formula_is_l_of_each_case_up_to_a_constant(
    boundary: str, below: str, above: str, joins: str
) -> None:
    found = joined.joined_of(
        [branch(f"x < {boundary}", below), branch(f"x > {boundary}", above)], NAMES, ()
    )
    assert found is not None
    assert found.where == ((joins,) if joins else ())
    for text, places in ((below, ("-1.3", "-0.4")), (above, ("1.2", "2.9"))):
        gaps = [
            value(found.lagrangian, x, y) - value(text, x, y) for x in places for y in ("0.3", "2")
        ]
        assert max(gaps) - min(gaps) < 1e-12


FOUR = (["x < -2"], ["x > -2", "x < 1"], ["x < 3", "x > 1"], ["x > 3"])


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 1, 0, 2), (2, 3, 1, 0)])
def test_parts_of_a_line_are_joined_in_whatever_order_they_come(order: tuple[int, ...]) -> None:
    texts = ["x'^2/2 + x^2/2 - x", "x'^2/2 - x^2/2", "x'^2/2 + k*x^3", "x'^2/2 + (x - 3)*y^2"]
    parts: list[dict[str, Any]] = [
        {"domain": domain, "lagrangian": {"text": text, "domain": []}}
        for domain, text in zip(FOUR, texts, strict=True)
    ]
    found = joined.joined_of([parts[k] for k in order], NAMES, ())
    assert found is not None
    assert found.where == ()
    assert joined.places_of([parts[k] for k in order], NAMES) == [*order]
    for text, places in zip(
        texts, (("-9", "-2.1"), ("-1.9", "0.9"), ("1.1", "2.9"), ("3.1", "8")), strict=True
    ):
        gaps = [
            value(found.lagrangian, x, y) - value(text, x, y) for x in places for y in ("0.3", "2")
        ]
        assert max(gaps) - min(gaps) < 1e-12
    parts[1]["lagrangian"] = {"text": "x'^2/2 - x^2/2 + x*y", "domain": []}
    assert joined.joined_of(parts, NAMES, ()) is None  # its jump at -2 depends on y


@pytest.mark.parametrize(
    "domains",
    [
        (["x < 0"], ["x > 0", "x < 2"], ["x > 3"]),  # a gap
        (["x < 0"], ["x > 0", "x < 2"], ["x > 0"]),
        (["x < 0"], ["x > 0", "y < 2"], ["x > 2"]),
        (["x < 0"], ["x > 0", "x > 1"], ["x > 1"]),
        (["x < 0"], ["x > 0", "x < 2"]),
        (["x < 0"], ["x < 0"], ["x > 0"]),
        ([], ["x > 0"]),
        (["x > 0", "x < 0"], ["x > 0"], ["x < 0"]),
    ],
)
def test_what_does_not_cover_a_line_has_no_formula(domains: tuple[list[str], ...]) -> None:
    parts = [{"domain": one, "lagrangian": {"text": "x'^2/2", "domain": []}} for one in domains]
    assert joined.joined_of(parts, NAMES, ()) is None
    assert set(joined.places_of(parts, NAMES)) == {0}


def test_the_checker_confirms_the_formula_of_three_cases_which_hold_for_every_x() -> None:
    names, f = nm.Names(("x",)), "-x - abs(x - 1) - abs(x + 2)"
    parts = [
        {"domain": ["x > 1"], "lagrangian": {"text": "x'^2/2 - x^2*3/2 - x", "domain": []}},
        {"domain": ["x < -2"], "lagrangian": {"text": "x'^2/2 + x^2/2 + x", "domain": []}},
        {
            "domain": ["x < 1", "x > -2"],
            "lagrangian": {"text": "x'^2/2 - x^2/2 - 3*x", "domain": []},
        },
    ]
    found = joined.joined_of(parts, names, [f])
    assert found is not None
    assert set(found.where) == {"x = -2", "x = 1"}
    assert found.of_every == "x"
    system = {"coordinates": ["x"], "equations": {"x": f}}
    asked = json.dumps({"system": system, "lagrangian": found.lagrangian})
    assert check_document(asked)["verdict"] == "valid"


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (branch("x > 0", "x'^2/2 - log(x)"), branch("x < 0", "x'^2/2 - log(-x)")),
        (branch("x > 0", "x'^2/2 - 1/(x + 1)"), branch("x < 0", "x'^2/2")),
        (branch("x > 0", "x'^2/2 - y"), branch("x < 0", "x'^2/2 + y")),  # they do not meet
        (branch("x' > 0", "exp(2*x)*x'^2/2"), branch("x' < 0", "exp(-2*x)*x'^2/2")),
        (branch("x > y", "x'^2/2"), branch("x < y", "x'^2/2 + x - y")),
        (branch("x > 0", "x'^2/2"), branch("x < 1", "x'^2/2")),
        (branch("x > 0", "x'^2/2"), {"domain": ["x < 0"], "lagrangian": None}),
    ],
)
def test_what_does_not_hold_on_both_sides_has_no_formula(
    first: dict[str, object], second: dict[str, object]
) -> None:
    assert joined.joined_of([first, second], NAMES, ()) is None
    assert joined.joined_of([first], NAMES, ()) is None


def test_the_checker_confirms_the_formula_of_a_bent_spring() -> None:
    names = nm.Names(("x",))
    both = [branch("x > 0", "x'^2/2 - x^2/2"), branch("x < 0", "x'^2/2 + x^2/2")]
    found = joined.joined_of(both, names, ())
    assert found is not None
    system = {"coordinates": ["x"], "equations": {"x": "-abs(x)"}}
    asked = json.dumps({"system": system, "lagrangian": found.lagrangian})
    assert check_document(asked)["verdict"] == "valid"


def with_energy(domain: str, lagrangian: str, energy: str, momentum: str = "x'") -> dict[str, Any]:
    hamiltonian = {"text": energy, "domain": [domain], "momenta": {"p_x": momentum}}
    return {**branch(domain, lagrangian), "hamiltonian": hamiltonian}


def test_h_of_both_cases_has_one_formula_where_the_momenta_are_the_same() -> None:
    names = nm.Names(("x",))
    above = with_energy("x > 0", "x'^2/2 - x^4", "p_x^2/2 + x^4")
    below = with_energy("x < 0", "x'^2/2 + x^2", "p_x^2/2 - x^2")
    found = joined.joined_of([above, below], names, ())
    assert found is not None
    own = nm.Names(("x",), ("p_x",))
    for text, x in (("p_x^2/2 + x^4", "1.7"), ("p_x^2/2 - x^2", "-0.6")):
        at = {ex.Symbol("x"): mpmath.mpf(x), ex.Symbol("p_x"): mpmath.mpf("0.3")}
        values = [
            calculus.evaluate(reader.read_formula(each, own), at)
            for each in (text, found.hamiltonian)
        ]
        assert abs(values[0] - values[1]) < 1e-12
    slower = with_energy("x < 0", "2*x'^2 + x^2", "p_x^2/8 - x^2", "4*x'")
    joint = joined.joined_of([above, slower], names, ())
    assert joint is None or joint.hamiltonian == ""


@pytest.mark.parametrize(
    ("given", "above", "every"),
    [
        ("-abs(x)", "x'^2/2 - x^2/2", "x"),
        ("-x^2*abs(x)^3", "x'^2/2 - x^6/6", "x"),
        ("-x^2/abs(x)", "x'^2/2 - x^2/2", ""),  # no value at 0
        ("-sign(x)*abs(x)*sqrt(abs(x))^2", "x'^2/2 - x^2/2", ""),  # not seen
    ],
)
def test_for_every_x_is_said_where_the_equation_has_a_value_at_the_boundary(
    given: str, above: str, every: str
) -> None:
    below = above.replace("-", "+")
    both = [branch("x > 0", above), branch("x < 0", below)]
    found = joined.joined_of(both, nm.Names(("x",)), [given])
    assert found is not None
    assert found.where == ("x = 0",)
    assert found.of_every == every


def moved(f: str, x: float, v: float, time: float, steps: int = 400) -> list[tuple[float, float]]:
    """States of x'' = f(x), by Runge and Kutta."""
    tree, h = reader.read_formula(f, nm.Names(("x",))), time / steps

    def force(at: float) -> float:
        return float(calculus.evaluate(tree, {ex.Symbol("x"): mpmath.mpf(at)}))

    found = [(x, v)]
    for _ in range(steps):
        a = force(x)
        b = force(x + h * v / 2)
        c = force(x + h * v / 2 + h * h * a / 4)
        d = force(x + h * v + h * h * b / 2)
        x, v = x + h * v + h * h * (a + b + c) / 6, v + h * (a + 2 * b + 2 * c + d) / 6
        found.append((x, v))
    return found


@pytest.mark.parametrize(
    ("domain", "f"), [("x > 0", "-x"), ("x < 0", "-9*x"), ("x > 2", "4*(2 - x)")]
)
def test_a_visit_lasts_as_long_as_is_said(domain: str, f: str) -> None:
    said = joined.motion_of({"domain": [domain], "equations": {"x": f}}, nm.Names(("x",)))
    assert said[0].startswith("half a swing")
    lasts = float(calculus.evaluate(reader.read_formula(said[-1], nm.Names()), {}))
    c, out = float(domain.split()[-1]), 1.0 if ">" in domain else -1.0
    states = moved(f, c, 0.3 * out, lasts)
    assert all((x - c) * out > 0 for x, _ in states[1:-1])
    assert abs(states[-1][0] - c) < 1e-6


@pytest.mark.parametrize(("domain", "f"), [("x < 0", "x"), ("x > 1", "x^2"), ("x > 0", "exp(-x)")])
def test_what_is_pushed_away_does_not_return(domain: str, f: str) -> None:
    said = joined.motion_of({"domain": [domain], "equations": {"x": f}}, nm.Names(("x",)))
    assert said[0] == "pushed away from "
    c, out = float(domain.split()[-1]), 1.0 if ">" in domain else -1.0
    states = moved(f, c + 0.1 * out, 0.01 * out, 1.5, 60)
    assert all(v * out > 0 for _, v in states)


@pytest.mark.parametrize(
    ("domain", "f", "words"),
    [
        ("x > 0", "-x^3", "pushed toward "),
        ("x > 0", "0", "constant speed"),
        ("x > 0", "1 - x", ""),  # no sign
        ("x > 0", "-k*x", ""),  # k may be negative
        ("x > 0", "-x - x'", ""),
        ("x > 0", "-t*x", ""),
        ("x' > 0", "-x", ""),
    ],
)
def test_only_what_is_certain_is_said_of_a_motion(domain: str, f: str, words: str) -> None:
    said = joined.motion_of({"domain": [domain], "equations": {"x": f}}, nm.Names(("x",), ("k",)))
    assert "".join(said[:1]) == words
    kept = [{"text": "x'^2 + x"}]
    known = {"domain": [domain], "equations": {"x": f}, "first_integrals": kept}
    if not words:
        assert joined.motion_of(known, nm.Names(("x",), ("k",)))[1:] == [
            "x'^2 + x",
            " is constant",
        ]


def test_a_constant_is_left_out_of_l_and_of_h_alike() -> None:
    """x'' = -x - 8 max(x - 1, 0): energy p q' - L of the joined L is the joined H."""
    names = nm.Names(("x",))
    below = {"lagrangian": "x'^2/2 - x^2/2", "hamiltonian": "p_x^2/2 + x^2/2"}
    above = {"lagrangian": "x'^2/2 - 9*x^2/2 + 8*x", "hamiltonian": "p_x^2/2 + 9*x^2/2 - 8*x"}
    parts = [
        {
            "domain": [domain],
            "lagrangian": {"text": one["lagrangian"], "domain": []},
            "hamiltonian": {"text": one["hamiltonian"], "momenta": {"p_x": "x'"}, "domain": []},
        }
        for domain, one in (("x < 1", below), ("x > 1", above))
    ]
    found = joined.joined_of(parts, names, ["-x - 4*(x + abs(x - 1) - 1)"])
    assert found is not None
    assert all(
        re.search(r" [-+] [\d/]+$", text) is None for text in (found.lagrangian, found.hamiltonian)
    )
    energetic = nm.Names(("x",), ("p_x",))
    for x, v in (("-2", "1"), ("0.3", "-0.5"), ("1.4", "2"), ("5", "0")):
        at: dict[ex.Expression, mpmath.mpf] = {
            ex.Symbol("x"): mpmath.mpf(x), ex.Velocity("x"): mpmath.mpf(v), ex.Symbol("p_x"): mpmath.mpf(v),
        }  # fmt: skip
        lagrangian, energy = (
            calculus.evaluate(reader.read_formula(text, energetic), at)
            for text in (found.lagrangian, found.hamiltonian)
        )
        assert abs(lagrangian + energy - mpmath.mpf(v) ** 2) < 1e-12


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        (["x > 0", "x < 1"], ["0 < x < 1"]),
        (["x < 0", "y != 0", "x > -1"], ["-1 < x < 0", "y != 0"]),
        (["x' > a", "k != 0", "x' < a + b"], ["k != 0", "a < x' < a + b"]),
        (["x > 0", "x > 1", "x < 2"], ["x > 0", "x > 1", "x < 2"]),
        (["x > 0", "y < 1"], ["x > 0", "y < 1"]),
        (["x^2 + y^2 > 0", "x^2 + y^2 < 1"], ["x^2 + y^2 > 0", "x^2 + y^2 < 1"]),
        ([], []),
    ],
)
def test_two_bounds_of_one_name_are_shown_as_a_range(given: list[str], shown: list[str]) -> None:
    assert sorted(joined.in_ranges(given)) == sorted(shown)


@pytest.mark.parametrize("domain", ["x > 2", "x < 2", "y > -k", "y < k^2 + 1", "x > 0"])
def test_a_half_is_where_its_condition_holds(domain: str) -> None:
    found = joined.half_of([domain], NAMES)
    assert found is not None
    name, at, sign = found
    condition = reader.read_condition(domain, NAMES)
    for distance in (-1, 1):
        place = {ex.Symbol("k"): mpmath.mpf(3)}
        place[ex.Symbol(name)] = calculus.evaluate(at, dict(place)) + distance
        assert (sign * distance > 0) == (calculus.evaluate(condition, dict(place)) > 0)
