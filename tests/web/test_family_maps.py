"""The map of a family: where members have another answer, and what a place on it says."""

from __future__ import annotations

import itertools
import json
import math
import random
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from inverse_service.service.documents import family_maps, printed_pages, sheets
from inverse_service.service.documents.family_tables import table_of
from inverse_service.service.documents.sheets import Member
from inverse_service.web.pages import result_tasks
from tests.doors import calls
from tests.doors.test_families import asked
from tests.serving import until

YES, NO = "variational", "not_variational"


def family_of(*leaves: tuple[str, list[str], str]) -> dict[str, Any]:
    """A result with these leaves: L, equations, verdict."""
    return {
        "system": {"coordinates": ["x", "y"], "equations": {}, "parameters": [*"abcd"], "functions": {}},
        "verdict": leaves[0][2], "verdict_with_time": leaves[0][2],
        "family": {
            "letters": [*"abcd"], "functions": {}, "covered": True, "checked": "valid", "open": [],
            "leaves": [
                {
                    "id": k, "inside": 0 if k else None, "nonzero": [], "solved": [], "verdict": verdict,
                    "verdict_with_time": verdict, "lagrangian": None, "proof": None,
                    "equations": [{"text": one, "latex": one} for one in equations],
                }
                for k, (_, equations, verdict) in enumerate(leaves)
            ],
        },
    }  # fmt: skip


# x'' = -a x' + b y, y'' = c x - d y' has an L iff d = a, d = -a, or b = c = 0.
DAMPED = family_of(
    ("", [], NO), ("", ["d = a"], YES), ("", ["d = -a"], YES), ("", ["b = 0", "c = 0"], YES)
)
CIRCLE = family_of(
    ("", [], YES), ("", ["a^2 + b^2 - 1 = 0"], NO), ("", ["a = 0", "a^2 + b^2 = 4"], NO)
)


@pytest.mark.parametrize(("value", "is_drawn"), [(0.0, False), (1.0, True), (-2.0, True)])
def test_a_set_is_drawn_where_its_inequation_holds(value: float, is_drawn: bool) -> None:
    """c != 0 is at other places of the slider of c, whether the set is all of the plane or a line."""
    for equations in ([], ["d = a"]):
        found = family_of(("", [], NO), ("", equations, YES))
        found["family"]["leaves"][1]["nonzero"] = ["c"]
        shown = family_maps.map_of(found, "a", "d", {"b": 1.0, "c": value})
        assert shown is not None
        assert any(one.member.leaf == 1 for one in shown.marks) is is_drawn


def test_one_line_says_what_is_not_decided() -> None:
    """Where, in how many sets, and why; sets without short equations are counted."""
    result = family_of(("", [], NO), ("", ["d = a"], YES))
    reasons = ["an equation has 552 terms", "each equation has more than 400 terms", "a minor has 9 terms"]  # fmt: skip
    places: list[list[dict[str, str]]] = [[], [{"text": "b = 0", "latex": "b = 0"}], []]
    result["family"] |= {
        "covered": False, "checked": "incomplete",
        "open": [{"inside": 0, "equations": one, "reason": why} for one, why in zip(places, reasons, strict=True)],
    }  # fmt: skip
    table = table_of(result)
    assert table is not None
    said = [printed_pages.plain_text(note) for note in table.notes]
    assert said == [
        "Not decided where b = 0, and in two more sets: "
        "an equation has 552 terms (other reasons are in the JSON)."
    ]


@pytest.mark.parametrize(
    ("checked", "where", "said"),
    [("valid", "d = a", "Only one"), ("incomplete", "d = a", "At least one"), ("valid", "b = 0", "At least one")],
)  # fmt: skip
def test_a_set_is_the_only_one_if_no_other_is_open(checked: str, where: str, said: str) -> None:
    result = family_of(("", [], NO), ("", ["d = a"], YES))
    equations = [{"text": where, "latex": where}]
    result["family"] |= {
        "covered": False, "checked": checked,
        "open": [{"inside": 1, "equations": equations, "reason": "special members"}],
    }  # fmt: skip
    table = table_of(result)
    assert table is not None
    assert printed_pages.plain_text(table.sentence).endswith(f"{said} set of members does.")


def test_a_family_with_constraints_is_said_to_be_of_one_associated_system() -> None:
    result = family_of(("", [], NO)) | {"nonholonomic": {"main": "second"}}
    table = table_of(result)
    assert table is not None
    assert printed_pages.plain_text(table.notes[0]).startswith(
        "About the second associated system alone"
    )


def test_lines_are_the_zeros_of_the_equations() -> None:
    shown = family_maps.map_of(DAMPED, "a", "d", {"b": 2})
    assert shown is not None
    assert [mark.member.leaf for mark in shown.marks] == [1, 2]
    for mark, sign in zip(shown.marks, (1, -1), strict=True):
        (line,) = mark.lines
        assert all(abs(d - sign * a) < 1e-6 for a, d in line)
        assert max(a for a, _ in line) - min(a for a, _ in line) > 5.9
    round_one = family_maps.map_of(CIRCLE, "a", "b", {})
    assert round_one is not None
    (line,) = round_one.marks[0].lines
    assert all(abs(math.hypot(*point) - 1) < 1e-5 for point in line)


def test_several_equations_are_points() -> None:
    shown = family_maps.map_of(DAMPED, "b", "c", {"a": 1, "d": 2})
    assert shown is not None
    assert [(mark.member.leaf, mark.lines) for mark in shown.marks] == [(3, ())]
    assert math.dist(shown.marks[0].points[0], (0, 0)) < 1e-6
    round_one = family_maps.map_of(CIRCLE, "a", "b", {})
    assert round_one is not None
    assert sorted(round(b, 2) for _, b in round_one.marks[1].points) == [-2, 2]  # of a drawing


@pytest.mark.parametrize(
    ("lagrangian", "is_positive", "area"),
    [
        ("c*x'^2/2 + b*y'^2/2 - b*c*x*y", lambda b, c: b * c > 0, 18),
        ("exp(a*t)*(x'^2 + (b + c)*y'^2)/2", lambda b, c: b + c > 0, 18),
        ("x'^2/2 + b*x'*y' + y'^2/2", lambda b, c: abs(b) < 1, 12),
        ("b*x'*y' - c*x*y", None, 0),  # never
        ("b*x'^2/2 + x*y'^2/2", None, 0),  # depends on x, too
        ("b*x'^2/2 + (y + exp(a*t))*y'^2/2", None, 0),  # and on t
        ("b*x'^2/2 + exp(a*t)*y'^2/2", lambda b, _: b > 0, 18),
        ("b*x'^2/2 + c*y'^2/2 + K(x, y)*y'", lambda b, c: b * c > 0, 18),  # K is an integral
        ("x*(b*x'^2/2 + c*y^2*y'^2/2)", lambda b, c: b * c > 0, 18),  # a radius
        ("x'^2/2 + b*y*x'*y' + y^2*y'^2/2", lambda b, _: abs(b) < 1, 12),
    ],
)
def test_dots_fill_where_the_kinetic_energy_is_positive(
    lagrangian: str, is_positive: Callable[[float, float], bool] | None, area: float
) -> None:
    """g or -g is positive; the area by the shoelace formula."""
    result = family_of(("", [], YES))
    known = {"K": {"arguments": ["x", "y"], "derivatives": {}}} if "K(" in lagrangian else {}
    found = {"text": lagrangian, "latex": "", "auxiliary": known}
    result["family"]["leaves"][0]["lagrangian"] = found
    shown = family_maps.map_of(result, "b", "c", {"a": 1})
    assert shown is not None
    total = 0.0
    for corners in shown.positive:
        middle = [sum(values) / len(corners) for values in zip(*corners, strict=True)]
        assert is_positive is not None
        assert is_positive(*middle)
        pairs = itertools.pairwise([*corners, corners[0]])
        total += sum(a * d - b * c for (a, b), (c, d) in pairs) / 2
    assert total == pytest.approx(area, abs=0.3)
    text = family_maps.svg_of(shown)
    assert text.count('class="dotted"') == text.count("T &gt; 0") == (area > 0)


@pytest.mark.parametrize(
    ("result", "wanted", "start", "nearest"),
    [
        (DAMPED, lambda one: one.leaf == 1, (1.5, 1, 1, 1), (1.25, 1, 1, 1.25)),
        (DAMPED, lambda one: one.verdict == YES, (1.5, 1, 1, -1.3), (1.4, 1, 1, -1.4)),
        (DAMPED, lambda one: one.leaf == 3, (1.5, 2, 1, 1), (1.5, 0, 0, 1)),
        (CIRCLE, lambda one: one.leaf == 1, (0.3, 0.4, 1, 1), (0.6, 0.8, 1, 1)),
        (DAMPED, lambda one: one.leaf == 9, (1, 1, 1, 1), None),
    ],
)
def test_the_nearest_member_of_a_set_is_found(
    result: dict[str, Any],
    wanted: Callable[[Any], bool],
    start: tuple[float, ...],
    nearest: tuple[float, ...] | None,
) -> None:
    """The foot of the perpendicular."""
    values = dict(zip("abcd", start, strict=True))
    found = family_maps.nearest_in(result, values, lambda one: wanted(_with_verdict(one)))
    assert (None if found is None else tuple(found.values())) == (
        nearest and pytest.approx(nearest, abs=1e-5)
    )


def _with_verdict(member: Member) -> Any:
    return SimpleNamespace(leaf=member.leaf, verdict=YES if member.verdict == sheets.YES else NO)


def test_a_member_has_numbers_in_its_lagrangian() -> None:
    result = family_of(("", [], NO), ("", ["d = a"], YES))
    result["system"]["equations"] = {"x": "-a*x' + b*y", "y": "c*x - d*y'"}
    leaf = result["family"]["leaves"][1]
    leaf["lagrangian"] = {"text": "exp(a*t)*(b*y'^2 + c*x'^2 + 2*b*c*x*y)/2", "latex": ""}
    leaf["proof"] = {"exceptions": ["b = 0", "c = 0"]}

    def said(values: str) -> list[str]:
        given = dict(zip("abcd", map(float, values.split()), strict=True))
        member = family_maps.member_at(result, given)
        assert member is not None
        return [one.whole for one in family_maps.with_numbers(result, member, given)]

    assert said("0 2 3 0") == ["L = (2*y'^2 + 3*x'^2 + 12*x*y)/2"]
    assert said("1 0 3 1") == ["x'' = -x'", "y'' = 3*x - y'"]  # L is singular
    assert said("1 2 3 4") == ["x'' = -x' + 2*y", "y'' = 3*x - 4*y'"]


def test_a_set_that_holds_by_the_other_constants_is_the_whole_plane() -> None:
    shown = family_maps.map_of(DAMPED, "b", "c", {"a": 1, "d": 1})
    assert shown is not None
    assert shown.general.leaf == 1
    assert family_maps.map_of(DAMPED, "a", "a", {}) is None


@pytest.mark.parametrize(
    ("values", "leaf"),
    [
        ((1, 1, 1, 1), 1),
        ((1, 1, 1, -1), 2),
        ((1, 0, 0, 2), 3),
        ((1, 0, 1, 2), 0),
        ((0, 1, 1, 0), 2),
    ],
)
def test_a_member_belongs_to_the_last_set_that_holds_it(
    values: tuple[float, ...], leaf: int
) -> None:
    found = family_maps.member_at(DAMPED, dict(zip("abcd", values, strict=True)))
    assert found is not None
    assert found.leaf == leaf


def with_inequations(*texts: str) -> dict[str, Any]:
    """An L iff c = b a where none of these vanishes."""
    result = family_of(("", [], NO), ("", ["c = b*a"], YES))
    result["family"]["leaves"][1]["nonzero"] = [*texts]
    return result


@pytest.mark.parametrize(
    ("texts", "values", "leaf"),
    [
        ("", (0, 1, 0, 1), 1),
        ("a", (0, 1, 0, 1), 0),
        ("a", (1, 0, 0, 1), 1),
        ("a b", (1, 0, 0, 1), 0),
        ("a-b", (2, 2, 4, 1), 0),
        ("F(x)", (0, 1, 0, 1), 1),
    ],
)
def test_a_member_where_an_inequation_fails_belongs_to_the_set_around(
    texts: str, values: tuple[float, ...], leaf: int
) -> None:
    result, given = (
        with_inequations(*texts.split()),
        dict(zip("abcd", map(float, values), strict=True)),
    )
    found = family_maps.member_at(result, given)
    assert found is not None
    assert found.leaf == leaf
    there = family_maps.nearest_in(result, given, lambda one: one.verdict == sheets.YES)
    at = None if there is None else family_maps.member_at(result, there)
    assert at is None or at.leaf == 1


def test_a_line_along_which_an_inequation_fails_is_not_drawn() -> None:
    """a b = 0 is two lines, with a != 0 one, and with b != 0, too, none; a b = 1 is a hyperbola."""

    def drawn(c: float, *texts: str) -> list[tuple[float, float]]:
        shown = family_maps.map_of(with_inequations(*texts), "a", "b", {"c": c})
        assert shown is not None
        return [point for mark in shown.marks for line in mark.lines for point in line]

    both, one = drawn(0), drawn(0, "a")
    assert any(abs(a) < 1e-3 < abs(b) for a, b in both)
    assert all(abs(b) < 1e-3 < abs(a) for a, b in one)
    assert len(one) > len(both) / 3
    assert drawn(0, "a", "b") == []
    assert drawn(1, "a", "b") == drawn(1) != []


def test_lines_are_left_out_of_a_set_that_is_the_whole_plane() -> None:
    """c = a b holds where b = 0 and c = 0, without a = 0 then."""
    shown = family_maps.map_of(with_inequations("a"), "a", "d", {"b": 0, "c": 0})
    assert shown is not None
    assert shown.general.leaf == 1
    (line,) = [mark for mark in shown.marks if mark.lines]
    assert (line.member.verdict, line.member.where) == (sheets.NO, ("a = 0",))
    assert all(abs(a) < 1e-6 for part in line.lines for a, _ in part)


def test_what_is_left_out_of_the_last_such_set_belongs_to_one_that_holds_it() -> None:
    """Where a b = 0, one more set with an L is around; it has no line of its own."""
    result = family_of(("", [], NO), ("", ["c = 0"], YES), ("", ["c = 0", "d = 0"], NO))
    for leaf, text in zip(result["family"]["leaves"][1:], ("a", "b"), strict=True):
        leaf["nonzero"] = [text]
    shown = family_maps.map_of(result, "a", "b", {"c": 0, "d": 0})
    assert shown is not None
    assert shown.general.leaf == 2
    (line,) = [mark for mark in shown.marks if mark.lines]
    assert (line.member.leaf, line.member.where) == (1, ("b = 0",))


def test_points_where_an_inequation_fails_are_not_drawn() -> None:
    result = family_of(("", [], YES), ("", ["a = 0", "a^2 + b^2 = 4"], NO))
    result["family"]["leaves"][1]["nonzero"] = ["b - 2"]
    shown = family_maps.map_of(result, "a", "b", {})
    assert shown is not None
    ((point,),) = [mark.points for mark in shown.marks]
    assert point == pytest.approx((0, -2), abs=0.01)


def test_a_place_beside_a_line_is_moved_onto_it() -> None:
    shown = family_maps.map_of(DAMPED, "a", "d", {"b": 2})
    assert shown is not None
    a, d = family_maps.snapped(shown, (1.5, 1.46))
    assert abs(a - d) < 1e-5
    assert family_maps.snapped(shown, (1.5, 1.0)) == (1.5, 1.0)


def test_no_label_lies_on_another_or_on_a_line() -> None:
    for shown in (
        family_maps.map_of(DAMPED, "a", "d", {}),
        family_maps.map_of(CIRCLE, "a", "b", {}),
    ):
        assert shown is not None
        text = family_maps.svg_of(shown)
        boxes = [
            (float(x), float(y) - 22, len(said) * family_maps.CHARACTER, family_maps.LINE)
            for x, y, said in re.findall(
                r'class="label[^"]*" x="([\d.]+)" y="([\d.]+)">([^<]*)<', text
            )
        ]
        assert len(boxes) == 3
        for k, (x, y, width, height) in enumerate(boxes):
            for a, b, c, d in boxes[:k]:
                assert x + width < a or a + c < x or y + height < b or b + d < y


@pytest.mark.parametrize("seed", range(4))
def test_a_text_lies_within_the_map_and_on_nothing_else(seed: int) -> None:
    """Wherever its places are, at a side or a corner, too."""
    draw, taken = random.Random(seed), list[tuple[float, float, float, float]]()
    left, top, side = family_maps.LEFT, family_maps.TOP, family_maps.SIDE
    drawn = [
        (left + side * draw.choice((0, 1, draw.random())), top + side * draw.random())
        for _ in range(60)
    ]
    held, places = drawn[:10], drawn[10:]
    for k, place in enumerate(places):
        family_maps._free([place], "a = b + c" * (1 + k % 4), taken, held)
    assert len(taken) > 5
    for k, (x, y, width, height) in enumerate(taken):
        assert left < x < x + width < left + side
        assert top < y < y + height < top + side
        assert not any(x < a < x + width and y < b < y + height for a, b in held)
        for a, b, c, d in taken[:k]:
            assert x + width < a or a + c < x or y + height < b or b + d < y


@pytest.mark.slow
def test_the_command_writes_the_map_or_says_what_it_needs(tmp_path: Path) -> None:
    document = {
        "equations": {"x": "-a*y", "y": "-b*x'^2"},
        "parameters": ["a", "b"],
        "first_integrals": False,
    }
    figure = tmp_path / "map.svg"
    code, out, _ = calls.command("solve", "-", "--figure", str(figure), given=json.dumps(document))
    assert (code, json.loads(out)["family"]["covered"]) == (0, True)
    assert figure.read_text().count('class="curve yes"') == 2
    code, _, err = calls.command(
        "solve", "-", "--figure", str(figure), given='{"equations": {"x": "-x"}}'
    )
    assert code == 2
    assert "two constants" in err


def test_the_page_answers_what_its_address_asks(service: str) -> None:
    """Also without scripts; an address with other values is another page."""
    document = asked({"x": "-a*y", "y": "-b*x'^2"}, first_integrals=False)
    begun = httpx.post(
        f"{service}/v1/solve", json=document, headers={"Prefer": "respond-async"}, timeout=60
    )
    address = f"{service}/results/{begun.headers['Location'].rpartition('/')[2]}"
    assert httpx.get(f"{address}/family", timeout=60).status_code == 200  # or how far it is
    until(lambda: "<tr data-leaf=" in httpx.get(address, timeout=60).text, pause=0.2)
    for values, said in (
        ("at.a=1&at.b=1", "has no Lagrangian"),
        ("at.a=0&at.b=2", "has a Lagrangian"),
    ):
        page = httpx.get(f"{address}/family?across=a&up=b&{values}", timeout=60).text
        assert f"This member {said}." in page
        assert '<svg xmlns="http://www.w3.org/2000/svg"' in page
        assert "<script>" not in page
    assert "a = 1, b = 1" in httpx.get(f"{address}/family?across=<b>&at.a=x", timeout=60).text


def test_the_page_shows_another_lagrangian_where_the_first_is_none(service: str) -> None:
    """c x'^2/2 + b y'^2/2 - ... is singular at b = 0, where the members have another one."""
    document = asked({"x": "-x + b*y", "y": "c*x - 2*y"}, first_integrals=False)
    found = httpx.post(
        f"{service}/v1/solve", json=document, headers={"Prefer": "wait=60"}, timeout=90
    )
    assert found.status_code == 200
    place = found.headers["location"].rpartition("/")[2]
    (leaf,) = found.json()["family"]["leaves"]
    assert leaf["proof"]["exceptions"] == ["b = 0", "c = 0"]
    address = f"{service}/results/{place}"
    assert "/where?leaf=0&amp;k=0" in httpx.get(address, timeout=60).text
    part = httpx.get(f"{address}/where?leaf=0&k=0", timeout=60).text
    assert 'class="yes"' in part
    assert "<math" in part
    for query in ("leaf=0&k=2", "leaf=7&k=0", "leaf=x&k=0", "leaf=0", "leaf=0&k=" + "9" * 40):
        assert httpx.get(f"{address}/where?{query}", timeout=60).status_code == 404


@pytest.mark.parametrize(
    ("text", "members"),
    [
        ("", []),
        ("1,2;0.5,-3", [("1", "2"), ("0.5", "-3")]),
        ("1,2;1.0,2.00", [("1", "2")]),
        ("1;2,3,4;x,2", [("1", "2")]),  # one of another family is left out, as on the map x is 1
        ("1,2;" * 50, [("1", "2")]),
        (";".join(f"{k},0" for k in range(9)), [(str(k), "0") for k in range(4)]),
    ],
)
def test_an_address_has_at_most_four_members_side_by_side(
    text: str, members: list[tuple[str, ...]]
) -> None:
    found = result_tasks._numbers_beside(text, 2)
    assert found == members
    assert result_tasks._numbers_beside(result_tasks._beside(found), 2) == found


def test_a_line_ends_at_the_side_of_the_map_that_it_crosses() -> None:
    """q = -2 p + p^3/8 is above the square for -2.6 < p < -2, and below it for 2 < p < 2.6."""
    lines = list(family_maps._zero_set(lambda x, y: y + 2 * x - x**3 / 8))
    assert len(lines) == 3
    for x, y in itertools.chain(*lines):
        assert max(abs(x), abs(y)) <= family_maps.SPAN + 1e-9
        assert abs(y + 2 * x - x**3 / 8) < 2e-3
    ends = sorted(x for line in lines for x, _ in (line[0], line[-1]))
    # p^3/8 - 2 p = 3 for p = -2 and p = 1 - sqrt(13).
    expected = [-3, 1 - math.sqrt(13), -2, 2, math.sqrt(13) - 1, 3]
    assert all(abs(one - other) < 0.02 for one, other in zip(ends, expected, strict=True))


def test_a_line_along_the_side_of_the_map_stays() -> None:
    side = [(-4.0, family_maps.SPAN), (0.0, family_maps.SPAN), (4.0, family_maps.SPAN)]
    assert [*family_maps._within(side)] == [((-3.0, 3.0), (0.0, 3.0), (3.0, 3.0))]
    assert not [*family_maps._within([(-4.0, 4.0), (4.0, 4.0)])]
