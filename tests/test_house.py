"""docs/explanation/architecture.md is accurate: the files and the calls of its table exist."""

from __future__ import annotations

import ast
import importlib
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from inverse_service.expressions import refusals
from inverse_service.simulation import sentences
from tests import test_layering
from tests.test_layering import imported, parsed

ROOT = Path(__file__).parent.parent
ARCHITECTURE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
SOURCES = [
    path
    for part in ("inverse_service", "api_schemas")
    for path in sorted((ROOT / part).rglob("*.py"))
]
ENTRIES = {
    "inverse_service.__main__",
    "inverse_service.cli.__main__",
    "inverse_service.service.compiling",
}
SENTENCE = re.compile(r"[A-Z]\S*(?: \S+){4,}[.!?]")
BY_NAME = re.compile(r"\"(inverse_service(?:\.\w+)+)\"")
AGREEMENT = re.compile(r"^\| `([a-z_.]+)\.(\w+)(?:\(|`)", re.MULTILINE)


def nodes(path: Path) -> tuple[ast.AST, ...]:
    return test_layering.nodes(path.read_text(encoding="utf-8"))


def test_every_module_of_the_package_is_used_by_the_package() -> None:
    used = set().union(*(mentioned(path) for path in SOURCES))
    modules = {module_of(path) for path in SOURCES if path.name != "__init__.py"}
    assert modules - used - ENTRIES == set()


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def mentioned(path: Path) -> set[str]:
    """The modules that a file imports, lazily or not, or names in a string to run them in separate
    processes.
    """
    source = path.read_text(encoding="utf-8")
    package = module_of(path) if path.name == "__init__.py" else module_of(path).rpartition(".")[0]
    found = {*BY_NAME.findall(source), *imported(source, package)}
    return found | {name.rpartition(".")[0] for name in found}


def test_every_agreement_of_the_architecture_page_names_something_that_exists() -> None:
    rows = AGREEMENT.findall(ARCHITECTURE)
    assert rows
    missing = [f"{module}.{name}" for module, name in rows if not exists(module, name)]
    assert missing == []


def exists(module: str, name: str) -> bool:
    return hasattr(importlib.import_module(f"inverse_service.{module}"), name)


def test_every_file_that_the_architecture_page_names_exists() -> None:
    places = sorted(set(re.findall(r"`((?:\w+/)+\w+\.py)`", ARCHITECTURE)))
    missing = [
        place
        for place in places
        if not (ROOT / place).is_file() and not any(p.match(place) for p in SOURCES)
    ]
    assert missing == []


def test_no_two_modules_have_the_same_name() -> None:
    """A file name such as `ansatz.py` identifies one file."""
    names = [path.stem for path in SOURCES if path.name not in ("__init__.py", "__main__.py")]
    assert [name for name, times in Counter(names).items() if times > 1] == []


def called(call: ast.Call) -> str:
    """The function as it is written: a name, or a name of a module."""
    match call.func:
        case ast.Name(name):
            return name
        case ast.Attribute(ast.Name(module), name):
            return f"{module}.{name}"
    return ""


def test_every_sentence_of_a_run_exists_and_is_said() -> None:
    every = (node for path in SOURCES for node in nodes(path))
    calls = [(called(node), node) for node in every if isinstance(node, ast.Call)]
    keys = [ast.walk(call.args[0]) for name, call in calls if name == "say"]
    said = {node.value for key in keys for node in key if isinstance(node, ast.Constant)}
    assert {key for key in said if isinstance(key, str)} == set(sentences.SENTENCES)
    refused = [call.args[0] for name, call in calls if name in ("fault", "refusals.fault")]
    assert {key.value for key in refused if isinstance(key, ast.Constant)} <= set(
        refusals.sentences()
    )


def test_no_function_of_the_solver_takes_a_question_as_true_or_false() -> None:
    """Which Lagrangians count is a `Question`, which says more than whether L may contain t."""
    rooms = ("decision", "search", "solving", "constrained", "explanation")
    files = [file for room in rooms for file in (ROOT / "inverse_service" / room).rglob("*.py")]
    assert files
    taken = re.compile(r"\b(?:timed|with_time|time_dependent): bool(?! \| None)\b")
    assert [file.name for file in files if taken.search(file.read_text(encoding="utf-8"))] == [
        "solutions.py"  # the field of a result about first integrals
    ]


def test_no_text_of_a_user_is_rewritten_before_it_is_read() -> None:
    """What is no formula is a cut with its place; a notation is a row, or a rule on tokens."""
    room = ROOT / "inverse_service" / "reading"
    sources = {path.stem: path.read_text(encoding="utf-8") for path in sorted(room.glob("*.py"))}
    assert [name for name, text in sources.items() if re.search(r"\.[lr]just\(", text)] == []
    rules = ("reader", "programs", "right_sides", "notations", "labels", "components", "indices")
    rules = (
        *rules,
        "slices",
        "cuts",
        "typed_text",
        "own_functions",
        "signs",
        "latex",
        "declarations",
        "framing",
        "prose",
        "guessed_names",
    )
    for name in ("lagrangian_texts", "accepting", "renaming"):
        texts = ROOT / "inverse_service" / "service" / "documents" / f"{name}.py"
        sources[name] = texts.read_text(encoding="utf-8")
        rules = (*rules, name)
    assert [name for name in rules if re.search(r"\.sub\(|\.translate\(", sources[name])] == []


def test_a_sentence_that_people_read_is_in_one_file() -> None:
    """The certificate's checker, which imports nothing of the project, says its own."""
    found: dict[str, set[str]] = {}
    for path in SOURCES:
        alone = {id(node.value) for node in nodes(path) if isinstance(node, ast.Expr)}  # docstrings
        texts = {
            node.value
            for node in nodes(path)
            if isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in alone
        }
        for text in texts:
            found.setdefault(" ".join(text.split()), set()).add(str(path.relative_to(ROOT)))
    for path in sorted((ROOT / "inverse_service").rglob("*.toml")):
        for text in leaves(tomllib.loads(path.read_text(encoding="utf-8"))):
            found.setdefault(" ".join(text.split()), set()).add(str(path.relative_to(ROOT)))
    twice = {
        text: sorted(places)
        for text, places in found.items()
        if SENTENCE.fullmatch(text)
        and len([place for place in places if "/certificate/" not in place]) > 1
    }
    assert twice == {}


def leaves(value: object) -> Iterator[str]:
    match value:
        case str():
            yield value
        case dict() | list():
            for one in value.values() if isinstance(value, dict) else value:
                yield from leaves(one)


# The verb of each rung of the search, and those of the doors (package, commands, client, SymPy).
OWN_VERBS = {"propose", "solve", "check"}


def test_no_public_function_has_a_name_of_many_meanings() -> None:
    homes: dict[str, set[str]] = {}
    for path in SOURCES:
        for node in parsed(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, set()).add(path.stem)
    many = {name: sorted(found) for name, found in homes.items() if len(found) > 4}
    assert {name: found for name, found in many.items() if name not in OWN_VERBS} == {}


# What is compared or drawn as a whole: keys of an order, entries of a table, arrays of one kind.
WHOLE_TUPLES = {
    "size", "rank", "place_for", "preference", "_order", "_traits", "slope", "spread", "crossing", "_marked",
    "_rates", "_of_columns", "parts", "_solved", "step",
}  # fmt: skip
STILL_UNNAMED, STILL_PAIRS = 9, 144  # at most


def test_three_results_of_a_function_have_names() -> None:
    """A function that gives back several things gives them back in a class that names them."""
    found = {name for name, number in tuples() if number > 2}
    assert len(found - WHOLE_TUPLES) <= STILL_UNNAMED, found - WHOLE_TUPLES


def test_pairs_that_leave_a_file_get_names() -> None:
    found = [name for name, number in tuples() if number == 2 and not name.startswith("_")]
    assert len(found) <= STILL_PAIRS, found


@cache
def tuples() -> tuple[tuple[str, int], ...]:
    """Each function that gives back a tuple, with its length."""
    functions = (
        node for path in SOURCES for node in nodes(path) if isinstance(node, ast.FunctionDef)
    )
    return tuple(
        (node.name, number)
        for node in functions
        if node.returns and (number := results(node.returns))
    )


def results(annotation: ast.expr) -> int:
    """The length of the tuple that an annotation is or may be, 0 without one of a fixed length."""
    match annotation:
        case ast.BinOp(left, ast.BitOr(), right):
            return max(results(left), results(right))
        case ast.Subscript(ast.Name("tuple"), ast.Tuple(entries)):
            open_end = isinstance(entries[-1], ast.Constant) and entries[-1].value is Ellipsis
            return 0 if open_end else len(entries)
    return 0


STILL_FLAGS = 35  # at most


def test_a_call_names_what_it_chooses() -> None:
    """A parameter that calls give as a bare True or False chooses what a function does, so it has
    named values; one that calls only pass on is data.
    """
    taken: dict[str, list[tuple[str, list[str], set[str]]]] = {}
    for path in SOURCES:
        for node in nodes(path):
            if isinstance(node, ast.ClassDef):
                for own in node.body:
                    if isinstance(own, ast.FunctionDef) and own.name == "__init__":
                        note_flags(taken, path.stem, node.name, own)
            elif isinstance(node, ast.FunctionDef):
                note_flags(taken, path.stem, node.name, node)
    found = {
        f"{home}.{called(call)}({name})"
        for path in SOURCES
        for call in nodes(path)
        if isinstance(call, ast.Call)
        for home, places, flags in taken.get(called(call).rpartition(".")[2], [])
        for name, value in given(call, places)
        if name in flags and isinstance(value, ast.Constant) and isinstance(value.value, bool)
    }
    assert len(found) <= STILL_FLAGS, sorted(found)


def note_flags(
    taken: dict[str, list[tuple[str, list[str], set[str]]]],
    home: str,
    name: str,
    node: ast.FunctionDef,
) -> None:
    """The places of the parameters of a function, and those that are true or false."""
    named = [*node.args.posonlyargs, *node.args.args]
    flags = {
        one.arg
        for one in [*named, *node.args.kwonlyargs]
        if isinstance(one.annotation, ast.Name) and one.annotation.id == "bool"
    }
    if flags:
        places = [one.arg for one in named if one.arg not in ("self", "cls")]
        taken.setdefault(name, []).append((home, places, flags))


def given(call: ast.Call, places: list[str]) -> Iterator[tuple[str, ast.expr]]:
    """What a call gives, by the names of the parameters."""
    yield from zip(places, call.args, strict=False)
    yield from ((one.arg, one.value) for one in call.keywords if one.arg)
