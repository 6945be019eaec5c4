"""What each door shows of a result: the formulas of its first statement, `answers[0]`."""

from __future__ import annotations

import html
import importlib.util
import re
from typing import Any

import mpmath

from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.reading import reader
from inverse_service.service.documents import (
    answer_rows,
    matrices_beside,
    printed_pages,
    readable_energies,
    sheets,
    short_results,
    stated,
)
from inverse_service.sympy import code, from_result
from inverse_service.web.pages import rendering, result_tasks

Document = dict[str, Any]
SHORT = 20  # characters of an L that LaTeX has on one line
LOOK = result_tasks.Look(rendering.Visitor(), "https://example.org", 60.0)
JOB = {"id": "a" * 32, "kind": "solve", "status": "successful"}


def assert_every_door_shows(result: Document) -> None:
    """L and H of the first statement come first in text, LaTeX, the page, SymPy, programs, CSV, the
    atlas, and in what assistants get.
    """
    first, answer, sheet = result["answers"][0], from_result(result), sheets.sheet_of(result)
    lagrangian, energy = texts = [(first[key] or {}).get("text") for _, key in sheets.FORMULAS]
    row = answer_rows.first_row(result)
    assert [row["L"], row["H"] or row["E"]] == texts
    assert str(answer.lagrangian) == str(answer.answers[0].lagrangian)
    assert [answer.lagrangian is None, answer.hamiltonian is None] == [
        text is None for text in texts
    ]
    known = [what for what, _ in code.known_quantities(answer, ("lagrangian", "hamiltonian"))]
    assert known == ["lagrangian"] * bool(lagrangian) + ["hamiltonian"] * bool(energy)
    assert_shows(sheet, result)
    assert_cases_have_their_equations(result)
    # Above L there are the equations, and one formula for what all cells have.
    given = [formula.whole for formula in (*sheet.asked, *sheet.joined)]
    given += [formula.whole for case in sheet.cases for formula in case.equations]
    lines = [line.strip() for line in printed_pages.text_page(result, False).splitlines()]
    if lagrangian and len(lagrangian) <= printed_pages.LONGEST:
        assert first_of("L", lines, given) == lagrangian
    if lagrangian and len(lagrangian) < SHORT:
        for printer in printed_pages.PRINTERS.values():
            page = printer.write(result, False, "")
            assert any(first["lagrangian"][form] in page for form in ("text", "latex"))
    if lagrangian:
        page = bytes(result_tasks.solve_result(LOOK, {**JOB, "result": result}, None).body)
        # Cases stand as on a line, from left to right; the first answer is about case 0.
        _, _, own = page.decode().rpartition('data-case="0"')
        labels = re.findall(r'aria-label="([^"]*)"', own)
        assert first_of("L", map(html.unescape, labels), given) == lagrangian
    assert_atlas_shows(result, texts)
    assert_assistants_get(result, texts)


def assert_cases_have_their_equations(result: dict[str, Any]) -> None:
    """The equations of each branch have the values of those of the system at its point."""
    if stated.is_constrained(result):
        return
    names = stated.names_of(result["system"])
    for one in result.get("branches") or ():
        assert list(one["equations"]) == result["system"]["coordinates"]
        if names.functions or not one["near"]:
            continue
        at = {
            reader.read_formula(name, names): mpmath.mpf(value)
            for name, value in one["near"].items()
        }
        for name, text in one["equations"].items():
            given = result["system"]["equations"][name]
            here, there = (
                calculus.evaluate(reader.read_formula(each, names), at) for each in (text, given)
            )
            assert abs(here - there) <= 1e-6 * (1 + abs(there)), (text, given)


def assert_shows(sheet: sheets.Sheet, result: Document) -> None:
    """L and H of a sheet are those of the first statement; H may be written with the length p of
    the momenta, with short names of them, which are put in again, or by the matrix of the masses.
    """
    first = result["answers"][0]
    lagrangian, energy = (first[key] for _, key in sheets.FORMULAS)
    shown_lagrangian, shown_energy = first_formulas(sheet)
    assert shown_lagrangian == (lagrangian or {}).get("text")
    if shown_energy is None or energy is None or shown_energy == energy["text"]:
        assert shown_energy == (energy or {}).get("text")
        return
    names = stated.names_of(result["system"], stated.auxiliary_of(first))
    if shown_energy == sheets.BY_MASS_MATRIX:
        assert lagrangian is not None
        near = first["near"] or {}
        found = matrices_beside.mass_matrix(energy, lagrangian["text"], names, near)
        assert found == "holds"
        return
    made = readable_energies.readable(energy, names)
    tree = reader.read_formula(shown_energy, made.names)
    for name, _, text in (one.partition(" = ") for one in made.definitions):
        tree = ex.substitute(tree, {ex.Symbol(name): reader.read_formula(text, made.names)})
    back = {ex.Symbol(short): ex.Symbol(long) for long, short in made.renamed.items()}
    given = reader.read_formula(energy["text"], names)
    assert collecting.collect(ex.subtract(ex.substitute(tree, back), given)) == ex.ZERO


def first_formulas(sheet: sheets.Sheet) -> list[str | None]:
    """L and H, or E, of a sheet."""
    assert sheet.first is not None
    shown = {one.letter: one.text for one in sheet.first.formulas}
    return [shown.get("L"), shown.get("H") or shown.get("E")]


def first_of(letter: str, lines: Any, given: list[str]) -> str | None:
    """The first formula of this letter that the document did not give."""
    own = (line for line in lines if line.startswith(f"{letter} = ") and line not in given)
    return next((line.removeprefix(f"{letter} = ") for line in own), None)


def assert_atlas_shows(result: Document, texts: list[str | None]) -> None:
    """The page of an entry and what programs get of it, from the result as the atlas keeps it."""
    short = short_results.shortened(result)
    whole = short_results.unfolded(short, result["system"]["given"])
    assert_shows(sheets.sheet_of(whole, length="brief"), result)
    first = short_results.for_programs(short)["answers"][0]
    assert [(first[key] or {}).get("text") for _, key in sheets.FORMULAS] == texts


def assert_assistants_get(result: Document, texts: list[str | None]) -> None:
    """What the tool `solve` of `mcp` returns, where that package is installed."""
    if importlib.util.find_spec("mcp") is None:
        return
    from inverse_service.cli import mcp_command

    found, first = mcp_command.in_short(result, "result://a"), result["answers"][0]
    # An L without its set would be said to hold everywhere.
    assert {*first["domain"], *(first["lagrangian"] or {}).get("domain", ())} <= {*found.domain}
    for text, shown in zip(texts, (found.lagrangian, found.hamiltonian), strict=True):
        assert shown == text or (text and shown and text.startswith(shown.partition("... (")[0]))
