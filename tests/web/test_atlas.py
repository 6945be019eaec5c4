"""The atlas over HTTP: search by words, tag, and equations, one entry, the full list; and common
behavior of pages.
"""

from __future__ import annotations

import copy
import html
import json
import re
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest

from api_schemas import result as schemas
from benchmarks import atlas as builder
from inverse_service import catalogue
from inverse_service.service.documents import alike, family_tables, sheets, short_results
from inverse_service.web.pages import WORDS, library

LEAST = 600
QUICK = 12  # entries that the default tests solve again
TODA = "M. Toda, Vibration of a chain with nonlinear interaction, J. Phys. Soc. Japan 22 (1967) 431"
NOTES = ("own test", "random search", "(test only)", "regression")


def test_the_atlas_is_large_and_says_nothing_of_the_test_bench() -> None:
    found = catalogue.atlas()
    assert len(found) >= LEAST
    assert "tilting-disk" in found
    assert len({json.dumps(entry["document"], sort_keys=True) for entry in found.values()}) == len(
        found
    )
    text = json.dumps(list(found.values()))
    assert [note for note in NOTES if note in text] == []
    assert {entry["verdict"] for entry in found.values()} <= {"yes", "no", "open", "differs"}


def test_titles_are_no_working_names_and_sources_are_citations() -> None:
    found = catalogue.atlas()
    assert set(builder.TITLES) <= set(found)
    titles = [entry["title"].lower() for entry in found.values()]
    assert len(set(titles)) == len(titles)
    assert [
        one
        for one in titles
        if re.search(r"implicit|holonomic in disguise|-like|techqa|the same|\.se ", one)
    ] == []
    books = {builder.accented(builder.in_full(said)) for _, said in builder.WHOLE}
    for entry in found.values():
        for part in filter(None, entry["source"].split("; ")):
            assert part in books or builder.CITATION.search(part), entry["name"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            "Arnold, section 19",
            "V. I. Arnold, Mathematical Methods of Classical Mechanics, section 19",
        ),
        ("Landau, Mechanics, section 5", "L. D. Landau, E. M. Lifshitz, Mechanics, section 5"),
        ("Landau 1930", "L. Landau, Diamagnetismus der Metalle, Z. Phys. 64 (1930) 629"),
        ("open Toda lattice", TODA),
        ("three particles (Toda 1967)", TODA),
        ("variation of Toda 1967", f"variation of {TODA}"),
        (
            "variation of Arnold, section 19",
            "variation of V. I. Arnold, Mathematical Methods of Classical Mechanics, section 19",
        ),
        ("Arnold, Kozlov 1985", "Arnold, Kozlov 1985"),
    ],
)
def test_books_and_papers_have_their_titles(given: str, said: str) -> None:
    assert builder.citation(given) == said
    assert builder.citation(said) == said


def test_each_source_of_the_table_is_that_of_an_entry() -> None:
    found = catalogue.atlas()
    assert set(builder.SOURCES["entries"]) <= set(found)
    text = "\n".join(entry["source"] for entry in found.values())
    assert [name for name, work in builder.WORKS.items() if work not in text] == []


def entries_of_today(quick: bool) -> list[dict[str, Any]]:
    """The entries of this day that are solved quickly, or the others."""
    today = builder.of_day(datetime.now(tz=UTC).day)
    first = sorted(today, key=lambda entry: entry["seconds"])[:QUICK]
    return [entry for entry in today if (entry in first) is quick]


def assert_as_computed_now(entries: list[dict[str, Any]]) -> None:
    rows = {row["name"]: row for row in builder.documents()}
    found = {entry["name"]: builder.unlike(entry, rows[entry["name"]]) for entry in entries}
    assert {name: differences for name, differences in found.items() if differences} == {}


def test_the_quick_entries_of_the_day_say_what_the_program_says() -> None:
    assert_as_computed_now(entries_of_today(quick=True))


@pytest.mark.slow
def test_the_entries_of_the_day_say_what_the_program_says() -> None:
    assert_as_computed_now(entries_of_today(quick=False))


def test_an_entry_that_says_less_or_other_is_found() -> None:
    row = next(row for row in builder.documents() if row["name"] == "sho")
    now = builder.entry_of(row)
    assert builder.differences(now, builder.entry_of(row)) == []
    for key, value in (
        ("lagrangian", None),
        ("verdict", "not_variational"),
        ("domain", ["x > 0"]),
        ("exceptions", ["k = 0"]),
    ):
        other = copy.deepcopy(now)
        other["result"][key] = value
        assert builder.differences(other, now)
    assert builder.unlike(other, row)
    assert builder.unlike(now, row) == []


def smallest_of_each_shape() -> list[dict[str, Any]]:
    """Of the entries with the same verdict in words and the same parts of a result, the smallest."""
    found: dict[Any, dict[str, Any]] = {}
    for entry in sorted(catalogue.atlas().values(), key=lambda one: len(json.dumps(one["result"]))):
        parts = frozenset(key for key, value in entry["result"].items() if value)
        found.setdefault((entry["badge"], parts), entry)
    return list(found.values())


def chosen(every: bool) -> list[dict[str, Any]]:
    return [*catalogue.atlas().values()] if every else smallest_of_each_shape()


# By default the smallest entry of each shape.
EVERY = pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)])


@EVERY
def test_every_yes_of_the_atlas_has_a_lagrangian_or_says_what_would_give_one(every: bool) -> None:
    for entry in chosen(every):
        answers = short_results.for_programs(entry["result"])["answers"]
        if entry["verdict"] == "yes" and not any(one["lagrangian"] for one in answers):
            known = entry["result"]
            assert {**known, **known.get("any_associated", {})}["construction"], entry["name"]


@EVERY
def test_every_formula_of_the_atlas_has_what_it_needs(every: bool) -> None:
    """No H without its momenta, no energy in velocities as H, no F without its derivatives, another
    clock is said.
    """
    for entry in chosen(every):
        result = short_results.unfolded(entry["result"], entry["document"])
        answers = short_results.for_programs(entry["result"])["answers"]
        for one in answers:
            schemas.AnswerPart.model_validate(one)
            lagrangian, energy = one["lagrangian"], one["hamiltonian"]
            if lagrangian:
                known = {*lagrangian["auxiliary"], *result["system"]["functions"]}
                # Parts of a function, V(x, y) = V_0(x) + V_1(y), are defined in a condition.
                conditions = " ".join(one.get("conditions", ()))
                known |= {*re.findall(r"\b([A-Z]\w*)\(", conditions.partition(" = ")[2])}
                named = set(re.findall(r"\b([A-Z]\w*)\(", lagrangian["text"]))
                assert named <= known, entry["name"]
            if energy:
                assert energy["momenta"], entry["name"]
                moving = "|".join(one.get("equations") or result["system"]["coordinates"])
                assert energy["implicit"] is bool(re.search(rf"\b({moving})'", energy["text"])), (
                    entry["name"]
                )
        sheet = sheets.sheet_of(result, length="brief")
        is_family = builder.FAMILY in entry["tags"]
        badge = family_tables.badge_of(result) if is_family else (sheet.verdict, sheet.badge)
        said = (*badge, [formula.whole for formula in sheet.asked])
        assert said == (entry["verdict"], entry["badge"], entry["equations"]), entry["name"]
        first = answers[0]
        if "clock" not in first and first["about"] != "reduced" and sheet.first:
            shown = {formula.letter: formula.text for formula in sheet.first.formulas}
            assert shown.get("L") == (first["lagrangian"] or {}).get("text"), entry["name"]


@pytest.mark.parametrize(
    ("query", "name"),
    [
        ({"q": "kepler polar"}, "kepler-polar"),
        ({"tag": "constraints", "q": "tilt"}, "tilting-disk"),
        ({"equations": "m*u'' + c*u' + k*u = 0"}, "textbook-damped-3"),
        ({"q": "Poincar\u00e9"}, "disk-of-poincare"),
        # Other names, another order, other constants.
        ({"equations": "b'' = -2*R'*b'/R; R'' = R*b'^2 - 7/R^2"}, "kepler-polar"),
    ],
)
def test_a_search_finds_it(service: str, query: dict[str, str], name: str) -> None:
    found = httpx.get(f"{service}/v1/atlas", params=query, timeout=60).json()
    assert name in [entry["name"] for entry in found["systems"]]
    assert found["count"] < LEAST
    whole = httpx.get(f"{service}/v1/atlas/{name}", timeout=60).json()
    assert whole["document"]
    assert whole["badge"]


def test_friction_is_what_a_neighbor_may_have_besides() -> None:
    """x'' = -x/r^3, y'' = -y/r^3 with drag: the same at rest."""
    found = catalogue.atlas()
    names = [one["name"] for one in library.moved(found["kepler-cartesian"])]
    assert "kepler-linear-drag" in names
    for one in names:
        assert found[one]["form"] != found["kepler-cartesian"]["form"]
    free = {"coordinates": ["x"], "parameters": ["c"], "equations": {"x": "-c*x'"}}
    assert alike.form_of(free)
    assert alike.form_of(free, at_rest=True) == ""


@pytest.mark.parametrize(
    ("name", "other"),
    [("emden-fowler-5", "emden-coupled"), ("half-plane", "half-plane-drag"), ("toda-four", "toda-closed-wrong-sign")],
)  # fmt: skip
def test_systems_of_a_person_or_of_a_source_are_near(name: str, other: str) -> None:
    found = catalogue.atlas()
    names = [one["name"] for one in library.near(found[name])]
    assert other in names[:6]
    assert name not in names
    assert len(names) == len(set(names))


def test_the_whole_is_one_file_that_a_browser_keeps(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        answer = client.get("/v1/atlas.ndjson")
        assert len(answer.text.splitlines()) == len(catalogue.atlas())
        again = client.get("/v1/atlas.ndjson", headers={"If-None-Match": answer.headers["etag"]})
        assert again.status_code == 304
        assert client.get("/v1/atlas/none").status_code == 404
        assert client.get("/v1/atlas", params={"equations": "x'' = @"}).status_code == 422


def test_pages_have_marks_descriptions_and_what_browsers_ask_for(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        page = client.get("/teach")
        assert (
            client.get("/teach", headers={"If-None-Match": page.headers["etag"]}).status_code == 304
        )
        assert 'name="description"' in page.text
        assert client.get("/robots.txt").text.startswith("User-agent")
        assert (
            client.get("/favicon.ico", follow_redirects=True).headers["content-type"]
            == "image/svg+xml"
        )
        found = client.post(
            "/v1/solve", json={"equations": "x'' = -x"}, headers={"Prefer": "wait=20"}
        )
        place = (found.headers.get("location") or found.headers["content-location"]).rpartition(
            "/"
        )[2]
        page = client.get(f"/results/{place}")
        assert f'property="og:image" content="{service}/results/{place}/picture.png"' in page.text
        for ending in ("png", "svg"):
            picture = client.get(f"/results/{place}/picture.{ending}")
            assert picture.headers["content-type"].startswith("image/")


def answer_of(client: httpx.Client, name: str) -> str:
    """The part of an entry's page with its answer, whatever time it takes."""
    while (answer := client.get(f"/atlas/{name}/answer")).status_code == 503:
        pass  # it is being computed
    assert answer.status_code == 200
    return html.unescape(answer.text)


def test_an_entry_shows_the_answer_of_this_program_with_its_proof_and_picture(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        part = answer_of(client, "sho")
        for text in (
            "Yes,",
            "aria-label=\"x'' = -x\"",
            'aria-label="L = ',
            'aria-label="H = ',
            'id="why"',
            "data-motion",
        ):
            assert text in part
        page = html.unescape(client.get("/atlas/sho").text)
        assert part in page
        assert "oscillator" in page
        assert "has a Lagrangian</span></h1>" not in page  # the answer alone says it
        assert (
            client.get("/atlas/none").status_code
            == client.get("/atlas/none/answer").status_code
            == 404
        )


def test_an_entry_whose_proof_takes_long_has_no_button_for_it(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        part = answer_of(client, "tilting-disk")
    assert "Its proof takes longer" in part
    assert "An independent checker verified that the conditions" not in part
    assert "data-toggle" not in part


@pytest.mark.slow
def test_an_entry_says_the_clock_of_its_formulas(service: str) -> None:
    """The inclined knife edge: its reduced motion has an L in a new time, which is named beside
    that L.
    """
    with httpx.Client(base_url=service, timeout=60) as client:
        part = answer_of(client, "inclined-knife-edge")
        assert "Another clock" in part
        assert "the equations become" in part
        assert "aria-label=\"x'*sin(phi) - y'*cos(phi) = 0\"" in part


def test_filters_leave_the_systems_that_have_what_they_say(service: str) -> None:
    with httpx.Client(base_url=service, timeout=60) as client:
        page = client.get("/atlas", params={"verdict": "no", "size": "2", "q": "pendul"}).text
    rows = page[page.index("<tbody>") : page.index("</tbody>")]
    assert "no Lagrangian" in rows
    assert "has a Lagrangian" not in rows
    names = [row.partition('"')[0] for row in rows.split('<a href="/atlas/')[1:]]
    assert names
    assert all("2 coordinates" in catalogue.atlas()[name]["tags"] for name in names)


def test_families_are_entries_with_the_table_of_their_members(client: httpx.Client) -> None:
    """Springs and friction: a member has an L with the time only for some letters."""
    families = [one for one in catalogue.atlas().values() if "family" in one["tags"]]
    assert len(families) >= 10
    assert all(one["result"]["family"]["covered"] for one in families)
    assert all(len(json.dumps(one["result"])) < 50_000 for one in families)
    name = "family-springs-and-damping"
    answer = client.get(f"/v1/atlas/{name}").json()
    verdicts = {one["verdict_with_time"] for one in answer["result"]["family"]["leaves"]}
    assert verdicts == {"variational", "not_variational"}
    text = answer_of(client, name)
    assert "Which members have a Lagrangian" in text
    assert text.count("data-leaf=") == len(answer["result"]["family"]["leaves"])


def test_the_kinds_of_systems_filter_the_search(client: httpx.Client) -> None:
    kinds = dict(WORDS["kinds_of_entries"])
    found = {
        kind: {one["name"] for one in catalogue.atlas().values() if library.is_of_kind(one, kind)}
        for kind in (*kinds, "", "unheard-of")
    }
    assert all(found.values())
    assert found[""] == found["unheard-of"] == set(catalogue.atlas())
    assert not found["plain"] & (found["family"] | found["constraints"] | found["functions"])
    page = client.get("/atlas", params={"kind": "cases", "all": "yes"}).text
    names = set(re.findall(r'<th scope="row"><a href="/atlas/([^"]+)"', page))
    assert names == found["cases"]
    assert 'value="cases" selected' in page
