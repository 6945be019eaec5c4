"""The recipes of CONTRIBUTING are complete: a test fails for each place that is left out."""

from __future__ import annotations

import functools
import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_args
from unittest import mock

import pytest

from api_schemas.scene import Observed, SceneDocument
from api_schemas.simulation import SimulatedMethod
from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service.certificate import kinds
from inverse_service.certificate.checker import check_certificate
from inverse_service.cli.solve_command import PROOFS, Format
from inverse_service.decision import certify, deciding, helmholtz
from inverse_service.expressions import collecting, functions, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading.names import FUNCTIONS, Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.printed_pages import PRINTERS, value_at
from inverse_service.service.scenes import views
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation import derivation, observing
from inverse_service.simulation.sentences import SENTENCES
from inverse_service.statements.questions import PLAIN
from inverse_service.sympy import code
from inverse_service.web.pages.result_tasks import EXPORTS
from inverse_service.web.pages.simulate import EFFECTS, OBSERVABLES
from tests.doors import parsing

ROOT = Path(__file__).parents[2]
FORMAT_OF_KINDS = (ROOT / "inverse_service" / "certificate" / "KINDS.md").read_text("utf-8")
PACKAGE = ROOT / "inverse_service"
READING = PACKAGE / "reading"
READ_WORDS = tomllib.loads((READING / "words.toml").read_text("utf-8"))
ROWS = "\n".join(
    (ROOT / "tests" / "corpus" / f"{name}.ndjson").read_text("utf-8")
    for name in ("spellings", "typed", "readings", "corrections", "refusals")
)
PAGE = (ROOT / "docs" / "how-to" / "enter-systems.md").read_text("utf-8")
SPECIAL_FUNCTIONS = PAGE.partition("## Special functions\n\n")[2].partition("\n\n")[0]
WORDS = {*re.findall(r"(?<![A-Za-z0-9_\\])[A-Za-z]\w*", ROWS + SPECIAL_FUNCTIONS, re.ASCII)}
MOST_FILES = 4
WHOLE = -1  # no file is left out
MADE_BY_THE_RUN = {"trajectory", "lyapunov", "period", "cost"}
# Examples of CONTRIBUTING whose result says nothing of a place that was left out: a key that stays
# empty, a family that is not searched.
UNTOLD = ("A key in a result", "A family of the ansatz")


# An observable is a word of the schema, and is made by a function or by the run itself.


def test_every_observable_is_a_word_of_scenes_and_is_made() -> None:
    assert {*get_args(Observed)} == {*observing.QUANTITIES} | MADE_BY_THE_RUN


# Scenes in one of which each observable has its numbers, and in another has none: on a line in a
# plane, on a circle by a method without momenta or velocities, with momenta, with impacts, and given
# by equations.
OBSERVED_SCENES: dict[str, dict[str, Any]] = {
    "line": {
        "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2", "constraints": ["y'"]},
        "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 1, "y": 0}}, "methods": ["adaptive"],
    },
    "circle": {
        "system": {
            "coordinates": ["phi", "x", "y"], "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
            "constraints": ["x'*sin(phi) - y'*cos(phi)"],
        },
        "initial": {"positions": {"phi": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "x": 1, "y": 0}},
        "methods": ["modified"], "record_every": 2,
    },
    "fall": {
        "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - y"},
        "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 1, "y": 0}}, "methods": ["stormer-verlet"],
    },
    "ball": {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - 10*x"},
        "initial": {"positions": {"x": 0.2}, "velocities": {"x": 0}}, "methods": ["adaptive"],
        "contacts": [{"name": "floor", "gap": "x", "restitution": "1/2"}],
    },
    "equations": {
        "system": {"coordinates": ["x"], "equations": {"x": "-x"}},
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "methods": ["adaptive"],
    },
}  # fmt: skip


# Observables whose columns have a figure of their own.
OWN_FIGURES = {"energy", "constraints", "error"}


class ObservedRun(NamedTuple):
    """The result of a scene, and what each of its observables gave: numbers and columns."""

    result: dict[str, Any]
    gave: dict[str, observing.Observations]

    @property
    def method(self) -> dict[str, Any]:
        (found,) = self.result["methods"]
        return dict(found)


@functools.cache
def observed_run(scene: str) -> ObservedRun:
    gave: dict[str, observing.Observations] = {}

    def watched(name: str, quantity: observing.Quantity) -> observing.Quantity:
        def observe(run: observing.Observed) -> observing.Observations:
            try:
                gave[name] = quantity.observe(run)
            except Exception as fault:
                gave[name] = {"fault": repr(fault)}, {}
                return {}, {}
            return gave[name]

        return replace(quantity, observe=observe)

    every = {name: watched(name, one) for name, one in observing.QUANTITIES.items()}
    asked = {"step": 0.1, "steps": 4, "observe": [*every]}
    with mock.patch.object(observing, "QUANTITIES", every):
        return ObservedRun(simulate(OBSERVED_SCENES[scene] | asked), gave)


@pytest.mark.parametrize("scene", OBSERVED_SCENES)
def test_every_number_of_an_observable_is_a_key_of_the_schema(scene: str) -> None:
    found = observed_run(scene).method
    keys = {key for key in found if not key.endswith("_note")}
    assert keys <= {*SimulatedMethod.model_fields}
    notes = {key.removesuffix("_note") for key in found if key.endswith("_note")}
    assert notes <= {*SimulatedMethod.model_fields, *observing.QUANTITIES}


@pytest.mark.parametrize("scene", OBSERVED_SCENES)
def test_an_observable_without_a_number_says_why(scene: str) -> None:
    run = observed_run(scene)
    assert (run.method["outcome"], {*run.gave}) == ("completed", {*observing.QUANTITIES})
    for name, (numbers, _) in run.gave.items():
        assert "fault" not in numbers, name
        notes = [numbers[key] for key in numbers if key.endswith("_note")]
        assert all(isinstance(note, str) and note for note in notes), name
        assert notes or None not in numbers.values(), name


@pytest.mark.parametrize("name", observing.QUANTITIES)
def test_the_table_of_a_run_shows_an_observable(name: str) -> None:
    """Each number that it shows is one of a run, and where there are numbers it shows one."""
    shown = observing.QUANTITIES[name].numbers
    methods = [observed_run(scene).method for scene in OBSERVED_SCENES]
    given = [numbers for scene in OBSERVED_SCENES for numbers in observed_run(scene).gave[name][:1]]
    for key in shown:
        assert any(isinstance(value_at(method, key), float) for method in methods), key
    values = [value for numbers in given for value in numbers.values()]
    values += [inner for one in values if isinstance(one, dict) for inner in one.values()]
    assert shown or not any(isinstance(value, float) for value in values)


@pytest.mark.parametrize("name", observing.QUANTITIES)
def test_every_column_of_an_observable_is_drawn_with_its_unit(name: str) -> None:
    """In time in the figure of what is observed, or in some scene in one of its own."""
    has_own = False
    for scene in OBSERVED_SCENES:
        run = observed_run(scene)
        units = {column: f"unit of {column}" for column in run.gave[name][1]}
        figures = {
            one["name"]: one["views"] for one in views.figures_of(run.result | {"units": units})
        }
        has_own |= name in figures
        drawn = {view["y"].partition("[")[2][:-1] for view in figures.get("observed", ())}
        assert name in OWN_FIGURES or {*units.values()} <= drawn
    assert has_own is (name in OWN_FIGURES)


def test_every_sentence_of_an_observable_is_written() -> None:
    """And each that is written is said."""
    ours, scenes = (
        "".join(file.read_text("utf-8") for file in (PACKAGE / folder).glob("*.py"))
        for folder in ("simulation", "service/scenes")
    )
    assert {*re.findall(r"\bsay\(\s*\"(\w+)\"", ours)} - {*SENTENCES} == set()
    code = ours + scenes
    assert [key for key in SENTENCES if f'"{key}"' not in code] == []


def test_the_form_offers_observables_that_there_are() -> None:
    assert {name for name, *_ in OBSERVABLES} <= {*get_args(Observed)}


def test_every_observable_is_on_the_page_of_documents() -> None:
    page = (ROOT / "docs/reference/documents.md").read_text("utf-8")
    assert [
        name for name in get_args(Observed) if not re.search(rf"^\| .*`{name}`.* \|", page, re.M)
    ] == []


# A kind of Lagrangian is known to the schema, the solver, the checker, and the format.


def test_the_solver_has_the_kinds_that_may_be_asked_about() -> None:
    assert {*helmholtz.BUILDERS} == {*KINDS_OF_LAGRANGIANS}


@pytest.mark.parametrize("kind", KINDS_OF_LAGRANGIANS)
def test_the_format_describes_a_kind(kind: str) -> None:
    assert f"`{kind}`" in FORMAT_OF_KINDS.replace("**", "")


@pytest.mark.parametrize("kind", KINDS_OF_LAGRANGIANS)
def test_the_checker_knows_a_kind(kind: str) -> None:
    assert kinds.named(kind) == kind


@pytest.mark.parametrize("kind", KINDS_OF_LAGRANGIANS)
def test_the_checker_refuses_a_lagrangian_that_is_not_of_a_kind(kind: str) -> None:
    """L = x'^4/12 - y'^2/2 - x^2/2 with x'' = -x/x'^2, y'' = 0 is regular, quartic, inhomogeneous,
    indefinite, and contains x.
    """
    system = read_system(["x", "y"], {"x": "-x/x'^2", "y": "0"})
    tree = read_formula("x'^4/12 - y'^2/2 - x^2/2", Names(("x", "y")))
    analysis = deciding.analyze(system)
    plain = certify.of_lagrangian(analysis, tree, PLAIN)
    assert check_certificate(plain).verdict == "valid"
    of_kind = certify.of_lagrangian(analysis, tree, PLAIN, helmholtz.kind_named(kind, ("x", "y")))
    found = check_certificate({**of_kind, "dissipation": "0"} if "ray" in kind else of_kind)
    assert found.verdict == "invalid"


# An effect is made by the solver, offered by the form, and named in the schema and the page.


def test_the_effects_of_a_lagrangian_are_those_that_may_be_named() -> None:
    tree = read_formula("x'^2/2 + y*x' - x^2/2 + x*cos(t)", Names(("x", "y")))
    parts = derivation.lagrangian_parts(tree, ("x", "y"))
    assert {*parts, derivation.CONSTRAINTS} == {*derivation.BUILT_IN}
    assert collecting.collect(ex.add(*parts.values()) - tree) == ex.ZERO


def test_the_form_offers_effects_that_are_made() -> None:
    assert {name for name, _ in EFFECTS} <= {*derivation.BUILT_IN}


@pytest.mark.parametrize(
    "effect", [one for one in derivation.BUILT_IN if one != derivation.KINETIC]
)
def test_an_effect_is_offered_and_described(effect: str) -> None:
    assert effect in {name for name, _ in EFFECTS}
    assert f'"{effect}"' in str(SceneDocument.__doc__)
    assert f"`{effect}`" in (ROOT / "docs" / "how-to" / "simulate.md").read_text("utf-8")


# A printer is a format of the command line and of HTTP; tests/doors/shown.py has what it prints.


def test_every_format_is_written_by_something() -> None:
    assert {*Format} == {"json", *PROOFS, *PRINTERS, *code.LANGUAGES, *code.WHOLE}


@pytest.mark.parametrize("form", PRINTERS)
def test_a_printer_is_a_format_of_every_door(form: str) -> None:
    assert form in [*Format]
    assert f"`{PRINTERS[form].media_type}`" in (ROOT / "docs/how-to/http.md").read_text("utf-8")


def test_every_language_is_offered_by_the_page() -> None:
    assert {*code.LANGUAGES, *code.WHOLE} <= {*EXPORTS}


# What is read has a row of the corpus that says how.


def test_every_function_has_a_row_that_says_how_it_is_read() -> None:
    assert [one for one in sorted(FUNCTIONS) if not has_row(one)] == []


def test_every_special_function_has_a_row_in_the_page_whose_formulas_are_read_as_it() -> None:
    calls = re.findall(r"`([^`]*[(\[].*?)`", SPECIAL_FUNCTIONS)
    assert {*functions.SPECIAL} == {name for one in calls for name in _special_functions(one)}


def _special_functions(formula: str) -> set[str]:
    """Those in a formula of x and orders n and k, of which there is at least one."""
    tree = read_formula(formula.replace("k", "2"), Names(("x",), ("n",)))
    found = {each.function for each in ex.walk(tree) if isinstance(each, ex.Apply)}
    assert found & functions.SPECIAL, formula
    return found & functions.SPECIAL


def test_every_word_of_another_program_has_a_row_that_says_how_it_is_read() -> None:
    """In which it is called."""
    tables = (READ_WORDS["heads"], READ_WORDS["functions"], READ_WORDS["mathematica"])
    listed = {word for table in tables for some in table.values() for word in some}
    assert [one for one in sorted(listed) if not is_called_in(one, ROWS)] == []


def test_every_word_of_another_program_for_a_derivative_is_on_the_page() -> None:
    derivatives = (word for kind in ("diff", "rate") for word in READ_WORDS["heads"][kind])
    assert [one for one in derivatives if not is_called_in(one, PAGE)] == []


def is_called_in(word: str, texts: str) -> bool:
    called = rf"(?<![A-Za-z0-9_]){re.escape(word)}\s*[\(\[{{@$^_]"
    return bool(re.search(called, texts, re.ASCII))


@pytest.mark.parametrize(
    "word",
    sorted(
        word for kind, some in READ_WORDS["heads"].items() for word in some if word.isidentifier()
        if word != kind and kind != "pieces"
    ),
)  # fmt: skip
def test_a_constant_may_still_have_the_name_of_a_call_of_another_program(word: str) -> None:
    read = parsing.read({"equations": f"x'' = -{word}*x", "parameters": [word]})
    assert read["equations"]["x"]["text"] == f"-{word}*x"


def test_every_program_with_statements_that_are_left_out_is_in_the_table_of_notations() -> None:
    table = PAGE.partition("| from | derivatives |")[2].partition("\n\n")[0]
    listed = {line.split("|")[1].strip() for line in table.splitlines()[2:]}
    named = {
        row["of"].partition(",")[0]
        for row in tomllib.loads((READING / "statements.toml").read_text("utf-8"))["statement"]
    }
    firsts = {one.partition(" ")[0].strip(",") for one in listed}
    assert {one for one in named if one.partition(" ")[0] not in firsts} == {"all"}


def test_every_sign_has_a_row_that_says_how_it_is_read() -> None:
    listed = {sign for some in READ_WORDS["signs"].values() for sign in some}
    assert [one for one in sorted(listed) if not _has_sign(one)] == []


def _has_sign(sign: str) -> bool:
    return sign in ROWS or json.dumps(sign)[1:-1] in ROWS


def has_row(word: str) -> bool:
    """Whether a formula or a text of a row has the word."""
    if re.fullmatch(r"[A-Za-z]\w*", word, re.ASCII):
        return word in WORDS
    return word in ROWS


# The recipes themselves.


class Recipe(NamedTuple):
    """An example of CONTRIBUTING: its change, file by file, and what `pytest` takes to tell a file
    that was forgotten.
    """

    files: tuple[str, ...]
    quick: tuple[str, ...]


def recipes() -> dict[str, Recipe]:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    found = {}
    for part in re.split(r"^### \d+\. ", text, flags=re.MULTILINE)[1:]:
        blocks = re.findall(r"^```diff\n(.*?)^```", part, re.MULTILINE | re.DOTALL)
        files = re.split(r"^(?=--- )", "".join(blocks), flags=re.MULTILINE)
        (quick,) = re.findall(
            r"^Quick tests: `.venv/bin/python -m pytest (.*?)`", part, re.MULTILINE
        )
        name = part.partition("\n")[0]
        found[name] = Recipe(tuple(file for file in files if file), (*shlex.split(quick),))
    return found


RECIPES = recipes()


def test_a_recipe_touches_few_files() -> None:
    assert max(len(one.files) for one in RECIPES.values()) <= MOST_FILES


def test_quick_tests_are_there() -> None:
    paths = [word for one in RECIPES.values() for word in one.quick if word.startswith("tests/")]
    assert [path for path in paths if not (ROOT / path).exists()] == []


def places() -> Iterator[object]:
    """Each recipe whole, and with each of its files left out."""
    for name in RECIPES:
        if name not in UNTOLD:
            yield pytest.param(name, WHOLE, marks=pytest.mark.slow)
            for place in range(len(RECIPES[name].files)):
                yield pytest.param(name, place, marks=pytest.mark.nightly)


@pytest.mark.parametrize(("name", "left_out"), [*places()])
def test_a_forgotten_place_is_told(name: str, left_out: int, tmp_path: Path) -> None:
    for folder in ("inverse_service", "api_schemas", "tests", "docs", "benchmarks"):
        ignored = shutil.ignore_patterns("__pycache__", "atlas.ndjson.gz", "build")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=ignored)
    for file in (
        "CONTRIBUTING.md",
        "README.md",
        "CHANGELOG.md",
        "pyproject.toml",
        "hatch_build.py",
    ):
        shutil.copy(ROOT / file, tmp_path / file)
    change = "".join(one for place, one in enumerate(RECIPES[name].files) if place != left_out)
    command = ["git", "apply", "-C1", "-"]
    subprocess.run(command, cwd=tmp_path, input=change, text=True, check=True)
    assert passes(tmp_path, RECIPES[name].quick) is (left_out == WHOLE)


def passes(tree: Path, tests: Sequence[str]) -> bool:
    """Whether the tests that are not slow pass in this copy, its generated pages written."""
    run = [sys.executable, "-P", "-m"]
    paths = f"import sys; sys.path[:0] = [{str(tree)!r}]; import runpy; "
    for module in ("tests.docs.manual", "tests.docs.reference"):
        subprocess.run(
            [sys.executable, "-c", f"{paths}runpy.run_module({module!r}, run_name='__main__')"],
            cwd=tree,
            check=False,
            capture_output=True,
        )
    own = [*run, "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(
        own, cwd=tree, env={"PYTHONPATH": str(tree)}, capture_output=True, text=True, check=False
    )
    return done.returncode == 0
