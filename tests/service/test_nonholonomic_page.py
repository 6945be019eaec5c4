"""docs/how-to/constrained-systems.md shows the output of the program."""

from __future__ import annotations

import functools
import json
import re
from pathlib import Path
from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.constrained import nonholonomic_study
from inverse_service.decision.solutions import SolveOptions
from inverse_service.mechanics import constrained_motion
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import nonholonomic_documents as documents
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.printed_pages import text_page

PAGE = (
    Path(__file__).parent.parent.parent / "docs" / "how-to" / "constrained-systems.md"
).read_text(encoding="utf-8")
ROWS = re.findall(r"^\| ([a-z-]+) \| (n?v) \| (n?v) \| (n?v) \| `(.+)` \|$", PAGE, re.MULTILINE)
LONG = ("generic-class-two", "generic-class-three")
WORDS = {"v": "variational", "nv": "not_variational"}


@functools.cache
def solved(name: str) -> dict[str, Any]:
    return solve_document(catalogue.document(name), SolveOptions(time_limit=600))


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows() -> None:
    (document,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    (shown,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    printed = text_page(
        solve_document(json.loads(document), SolveOptions(time_limit=120)), explain=False
    ).splitlines()
    places = [printed.index(line) for line in shown.splitlines()]
    assert places == sorted(places)


@pytest.mark.slow
@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, id=row[0], marks=[pytest.mark.slow] if row[0] in LONG else [])
        for row in ROWS
    ],
)
def test_the_table_is_what_the_solver_finds(row: tuple[str, str, str, str, str]) -> None:
    name, *verdicts, density = row
    part = solved(name)["nonholonomic"]
    found = {one["kind"]: (one["verdict"], one["checked"]) for one in part["associated"]}
    kinds = ("first", "second", "third")
    assert found == {
        kind: (WORDS[word], "valid") for kind, word in zip(kinds, verdicts, strict=True)
    }
    assert part["measure_density"]["density"]["text"] == density


def test_the_table_has_every_system_of_the_catalogue() -> None:
    assert sorted(row[0] for row in ROWS) == sorted(catalogue.names("nonholonomic"))


def test_what_a_motion_does_not_have_is_said_for_general_letters() -> None:
    """z' = (a y + b x) x' + c x y' restricts positions for a = c."""

    def said(constraint: str, *letters: str) -> Any:
        variables = ("x", "y", "z")
        names = nm.Names(variables, letters, {})
        formulas = (reader.read_formula(one, names) for one in ("(x'^2+y'^2+z'^2)/2", constraint))
        lagrangian, tree = formulas
        system = constrained_motion.NonholonomicSystem(variables, lagrangian, (tree,), letters)
        study = nonholonomic_study.Study(nonholonomic_study.motion_report(system), (), 0)
        parts = (documents._integrability, documents._measure, documents._class)
        return [part(study.report).statement for part in parts]

    for one in said("z'-(a*y+b*x)*x'-c*x*y'", "a", "b", "c"):
        assert one.startswith("For general a, b, c, ")
    assert said("z'-(y+x)*x'-x*y'")[0].startswith("The constraints are integrable")
    assert said("z'-y*x'")[0] == "No combination of the constraints is integrable."
