"""Each option of a command with a small document: what is asserted follows from the mathematics, or
from the same answer in another form.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import inverse_service
from inverse_service.service.jobs import tasks

DAMPED = "x'' = -x - c*x'"
PLANE = {"equations": {"x": "-a*x-y", "y": "-b*y-x"}, "parameters": ["a", "b"]}


@pytest.fixture(scope="module", autouse=True)
def engine() -> None:
    """Load the engine once, and what an answer loads, because all worker processes are forked from
    this one.
    """
    tasks.load_engine()
    inverse_service.solve(DAMPED)


def also_slow(quick: str, *others: str) -> Iterator[Any]:
    """One form by default; `tests.golden.printed` has what the others write of other documents."""
    yield quick
    yield from (pytest.param(form, marks=pytest.mark.slow) for form in others)


def result(call: Any, *arguments: str) -> dict[str, Any]:
    found = call("solve", *arguments)
    assert found.code == 0, found.err
    read: dict[str, Any] = json.loads(found.out)
    return read


def test_names_are_declared_by_options(call: Any) -> None:
    """A value of the document comes before that of an option."""
    options = ("--parameters", "k=2,m", "--functions", "V(x)", "--coordinates", "x,y")
    system = result(call, "x'' = -k*V(x)/m; y'' = -y", *options)["system"]
    assert (system["coordinates"], system["parameters"]) == (["x", "y"], ["m"])
    assert system["functions"] == {"V": ["x"]}
    given = json.dumps({"equations": {"x": "-k*x"}, "parameters": {"k": "3"}})
    assert result(call, given, "--parameters", "k=2")["system"]["equations"] == {"x": "-3*x"}


def test_kinds_a_clock_and_another_time_are_asked_by_options(call: Any) -> None:
    found = result(call, "x'' = -x; y'' = -2*y", "--kind", "natural", "--kind", "invariant:x")
    assert found["kinds"]["natural"]["verdict"] == "variational"
    assert len(found["kinds"]) == 2
    clock = result(call, "x'' = -x*x'^2; y'' = -x*x'*y'", "--clock", "search")
    assert clock["with_clock"]["verdict"] == "variational"
    assert result(call, "y'' = -y/x", "--time", "x")["system"]["time"] == "x"


def test_a_family_has_its_letters_a_map_and_a_text(call: Any, tmp_path: Path) -> None:
    document, picture = tmp_path / "plane.json", tmp_path / "map.svg"
    document.write_text(json.dumps(PLANE))
    found = result(call, str(document), "--letters", "a,b", "--figure", str(picture))
    assert found["family"]["leaves"]
    assert picture.read_text().startswith("<svg")


def test_a_map_needs_two_constants(call: Any) -> None:
    found = call("solve", "x'' = -c", "--letters", "c", "--figure", "map.svg")
    assert found.code == 2
    assert "two constants" in found.err


@pytest.mark.parametrize("form", [*also_slow("identities", "text", "latex", "sympy", "coq")])
def test_every_form_is_that_of_the_answer(call: Any, form: str, tmp_path: Path) -> None:
    file = tmp_path / "answer"
    asked = ("solve", "x'' = -c*x", "--parameters", "c", "--format", form)
    assert call(*asked, "--output", str(file)).code == 0
    written = file.read_text()
    assert written.strip() == call(*asked).out.strip()
    if form == "identities":
        assert inverse_service.check(written)["verdict"] == "valid"


def test_exceptions_of_a_result_are_decided(call: Any, tmp_path: Path) -> None:
    """x'' = a x'^n has another L at n = 1 and at n = 2, and at a = 0 it is free."""
    file = tmp_path / "result.json"
    answer = inverse_service.solve({"equations": {"x": "a*x'^n"}, "parameters": ["a", "n"]})
    file.write_text(json.dumps(dict(answer)))
    shown = call("check", str(file), "--exceptions", "--format", "json")
    decided = json.loads(shown.out)["exceptions"]
    assert decided
    assert {one["checked"] for one in decided if one.get("lagrangian")} <= {"valid"}
    text = call("check", str(file), "--exceptions", "--format", "text")
    assert all(one["where"] in text.out for one in decided)


@pytest.mark.parametrize("name", ["system.json", "SYSTEM.JSON", "system.txt", "typed", "-"])
def test_a_lagrangian_is_tested_with_a_system_in_any_form(
    call: Any, tmp_path: Path, name: str
) -> None:
    """A document in a file or on standard input, equations in a file, or as they are typed."""
    document, text = json.dumps({"equations": {"x": "-4*x"}}), "x'' = -4*x"
    file = tmp_path / name
    if name not in ("typed", "-"):
        file.write_text(text if name.endswith(".txt") else document)
    place = {"typed": text, "-": "-"}.get(name, str(file))
    given = {"given": document.encode()} if name == "-" else {}
    for lagrangian, code in (("x'^2/2 - 2*x^2", 0), ("x'^2/2 - x^2", 1)):
        found = call("check", place, "--lagrangian", lagrangian, "--format", "json", **given)
        assert found.code == code, found.err
        assert (json.loads(found.out)["verdict"] == "valid") == (code == 0)


def test_a_result_is_checked_against_a_document(call: Any, tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(dict(inverse_service.solve("x'' = -x"))))
    given = tmp_path / "system.txt"
    for equation, code in (("x'' + x = 0", 0), ("x'' = x", 1)):
        given.write_text(equation)
        for form in ("text", "json"):
            asked = ("--document", str(given), "--format", form)
            assert call("check", str(file), *asked).code == code


def test_a_batch_is_a_table_and_is_checked(call: Any, tmp_path: Path) -> None:
    lines = [
        {"id": "a", "equations": {"x": "-x"}}, {"id": "b", "equations": {"x": "-x-x'"}},
        {"id": "c", "equations": {"x": "-y", "y": "-x+x'*y'"}}, {"id": "d", "equations": {"x": "(("}},
    ]  # fmt: skip
    systems, answers = tmp_path / "systems.ndjson", tmp_path / "answers.ndjson"
    systems.write_text("".join(json.dumps(line) + "\n" for line in lines))
    ran = call("batch", str(systems), "--output", str(answers), "--workers", "1")
    assert ran.code == 1
    for option in ((), ("--all",)):
        shown = call("table", str(answers), *option)
        rows = [*csv.DictReader(io.StringIO(shown.out))]
        assert {row["id"] for row in rows} == {"a", "b", "c", "d"}
    checked = call("check", str(answers))
    assert checked.code == 1
    assert "3 valid" in checked.out
    answers.write_text(answers.read_text().replace("x'^2/2 - x^2/2", "x'^2/2 + x^2/2"))
    assert 'id "a": invalid' in call("check", str(answers)).out


def test_the_catalogue_is_a_list_and_a_document(call: Any) -> None:
    names = {line.split()[0] for line in call("catalogue").out.splitlines() if line}
    assert {*inverse_service.catalogue.names()} <= names
    shown = call("catalogue", "vertically-rolling-disk")
    assert json.loads(shown.out) == inverse_service.catalogue.document("vertically-rolling-disk")
    first = call("catalogue", "painleve-i")
    assert inverse_service.solve(json.loads(first.out))["verdict"] == "variational"


@pytest.mark.parametrize("form", [*also_slow("json", "text", "latex")])
def test_the_nearest_system_is_found(call: Any, form: str) -> None:
    options = ("--errors", "0.02", "--nice", "--format", form)
    asked = {"equations": "x'' = -1.02*x + 0.01*x'", "first_integrals": False}
    found = call("nearest", json.dumps(asked), *options)
    assert found.code == 0, found.err
    if form == "json":
        assert json.loads(found.out)["nearest"][0]["kind"] == "natural"
