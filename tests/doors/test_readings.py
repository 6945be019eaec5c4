"""Texts of the corpus: each is parsed as its author means it, or rejected with a location."""

import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import httpx
import pytest

import inverse_service
from inverse_service.errors import InputError
from inverse_service.reading import framing
from tests.doors import calls, choosing, parsing
from tests.doors.judge import same_formula
from tests.doors.rows import Row, rows

T = TypeVar("T")
AT_A_TIME = 100
READING = Path(inverse_service.__file__).with_name("reading")
READINGS = rows("readings")
TYPED = rows("typed")
REFUSALS = rows("refusals")
BODIES = rows("bodies")


def pasted() -> Iterator[Row]:
    """Text that people paste from books and programs; its constants are guessed."""
    for row in rows("spellings"):
        document = {"equations": row["given"], "parameters": "guess"}
        yield {**row, "document": document, "reads": row.get("read"), "id": row["given"]}


FILES = {"readings": READINGS, "typed": TYPED, "spellings": [*pasted()]}


def fault_of(row: Row, found: Any) -> str | None:
    """None if a document is parsed or rejected as its row says."""
    wanted = row.get("refused")
    if isinstance(found, calls.Refusal):
        return f"refused: {found.detail}" if wanted is None else fault_of_refusal(wanted, found)
    if wanted is not None:
        return f"read as {found['equations']}"
    texts = {name: part["text"] for name, part in found["equations"].items()}
    for name, text in row["reads"].items():
        if not same_formula(texts.get(name, "no such equation"), text, found["coordinates"]):
            return f"{name} is read as {texts.get(name)}, not {text}"
    lists = {
        "guessed": list(found["guessed"] or []),
        "noted": [part["text"] for part in found["readings"]],
    }
    for key in lists.keys() & row.keys():
        if lists[key] != row[key]:
            return f"{key} {lists[key]}"
    return None


def fault_of_refusal(wanted: dict[str, Any], found: calls.Refusal) -> str | None:
    """None if the error, its location, and the suggestions are those of the row."""
    detail = found.detail
    if not (detail.isprintable() and detail.replace("…", "").isascii() and 10 < len(detail) < 600):
        return f"not a sentence: {detail!r}"
    if "words" in wanted and wanted["words"] not in detail:
        return f"{wanted['words']!r} is missing in {detail!r}"
    for key in ("pointer", "column"):
        if key in wanted and getattr(found, key) not in (None, wanted[key]):
            return f"{key} {getattr(found, key)!r} instead of {wanted[key]!r}"
    if "instead" in wanted and wanted["instead"] not in found.instead:
        return f"{wanted['instead']!r} is not among {found.instead}"
    return None


def parsed(document: Any, service: str | None = None) -> Any:
    """The parsed system, from Python or from POST /v1/parse."""
    if service is None:
        found = parsing.parsed(document)
        if isinstance(found, InputError):
            return calls.Refusal(found.detail, found.pointer, found.column, found.instead)
        return found
    answer = httpx.post(
        f"{service}/v1/parse", content=json.dumps(document), headers=calls.JSON, timeout=60
    )
    return answer.json() if answer.status_code == 200 else calls.refusal(answer)


def assert_all(chosen: list[Row], service: str | None = None) -> None:
    faults = {
        row["id"]: fault
        for row in chosen
        if (fault := fault_of(row, parsed(row["document"], service)))
    }
    assert not faults, json.dumps(faults, indent=1)


def blocks(all_rows: list[Row], size: int = AT_A_TIME, marks: Any = ()) -> list[Any]:
    """All rows in blocks."""
    starts = range(0, len(all_rows), size)
    kind = "slow" if marks else "from"
    return [
        pytest.param(all_rows[start : start + size], id=f"{kind}-{start}", marks=marks)
        for start in starts
    ]


def chosen_blocks(name: str) -> list[Any]:
    """The rows of a file in blocks: those that `choosing` chose, and the others, which are slow."""
    placed = [(choosing.is_quick(name, place, row), row) for place, row in enumerate(FILES[name])]
    quick = [row for chosen, row in placed if chosen]
    others = [row for chosen, row in placed if not chosen]
    return [*blocks(quick), *blocks(others, marks=pytest.mark.slow)]


@pytest.mark.parametrize("chosen", chosen_blocks("readings"))
def test_a_notation_means_what_its_writer_means(chosen: list[Row]) -> None:
    assert_all(chosen)


@pytest.mark.parametrize("chosen", chosen_blocks("typed"))
def test_what_strangers_type_and_paste_is_read_as_they_mean_it(chosen: list[Row]) -> None:
    assert_all(chosen)


@pytest.mark.parametrize("chosen", chosen_blocks("spellings"))
def test_what_people_paste_is_read_as_they_mean_it_or_asked_back(chosen: list[Row]) -> None:
    assert_all(chosen)


def test_chosen_rows_run_each_line_as_often_as_can_be() -> None:
    rows = {"a": (1.0, frozenset("xy")), "b": (0.1, frozenset("x")), "c": (0.1, frozenset("x"))}
    assert {*choosing.covering(rows, 1)} == {"a", "b"} or {*choosing.covering(rows, 1)} == {
        "a",
        "c",
    }
    assert {*choosing.covering(rows, 2)} == {"a", "b", "c"}


@pytest.mark.parametrize("chosen", blocks(REFUSALS))
def test_what_is_wrong_or_has_two_meanings_is_refused_at_its_place(chosen: list[Row]) -> None:
    assert_all(chosen)


def test_the_service_reads_and_refuses_the_same(service: str) -> None:
    assert_all([*READINGS[::96], *TYPED[::40], *REFUSALS[::48]], service)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("r'' = -mu r/r^3", True),
        ("r'' = r phi'^2 - mu r/r^3, phi'' = -2 r' phi'/r", False),  # polar coordinates
        ("x'' = -mu x/x^3", False),
    ],
)
def test_a_radius_over_a_power_of_itself_is_said_to_be_one_number(text: str, said: bool) -> None:
    notes = {part["text"]: part["as"] for part in parsed({"equations": text})["readings"]}
    assert ("components of a vector" in notes.get("r", "")) is said


def examples_of_programs() -> list[tuple[str, str]]:
    """The program or package of each line of the table of notations in the documentation, and its
    example.
    """
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "enter-systems.md").read_text(
        encoding="utf-8"
    )
    table = page.partition("| from | derivatives |")[2].partition("\n\n")[0]
    return [
        (line.split("|")[1].strip(), "".join(re.findall(r"\| `([^`]+)` \|$", line)))
        for line in table.splitlines()[2:]
    ]


def test_each_example_of_the_table_of_notations_is_an_oscillator() -> None:
    examples = examples_of_programs()
    assert len(examples) > 20
    for program, text in examples:
        assert text, program
        found = parsed({"equations": text})
        assert not isinstance(found, calls.Refusal), (text, found)
        ((name, force),) = found["equations"].items()
        assert same_formula(force["text"], f"-k*{name}", [name]), text


def test_each_example_of_a_statement_is_left_out_by_its_row() -> None:
    table = tomllib.loads((READING / "statements.toml").read_text(encoding="utf-8"))
    for row, given in zip(framing.rows(), table["statement"], strict=True):
        for statement in given["such_as"]:
            text = f"{statement}{' ' if row.part == 'begins' else chr(10)}x'' = -x"
            stop = len(text if row.part == "begins" else statement)
            assert row.form.match(text, 0, stop), statement
            found = parsed({"equations": text})
            assert not isinstance(found, calls.Refusal), (statement, found)
            assert list(found["equations"]) == ["x"], statement


def test_each_example_of_a_trap_is_refused_at_its_place() -> None:
    table = tomllib.loads((READING / "statements.toml").read_text(encoding="utf-8"))
    for row in table["trap"]:
        for statement in row["such_as"]:
            found = parsed({"equations": f"x'' = -x;\n{statement}"})
            assert isinstance(found, calls.Refusal), statement
            assert found.detail.startswith(f"{row['what']} decides"), statement


@pytest.mark.parametrize("argument", ["q_1'", "q_{1}'", "\\dot{q}_1", "\\dot q_{1}"])
def test_an_argument_of_a_function_is_typed_as_in_a_formula(argument: str) -> None:
    found = parsed({"equations": {"q_1": "A"}, "functions": {"A": [argument]}})
    assert found["equations"]["q_1"]["text"] == "A(q_1')"


def test_no_names_declared_means_guessed_at_the_service_too(service: str) -> None:
    found = parsed({"equations": "m x'' + c x' + k x = 0"}, service)
    assert found["guessed"] == ["m", "c", "k"]


LONG = {
    "huge integer": (
        '{"coordinates": ["x"], "equations": {"x": ' + "9" * 5000 + "}}",
        "characters",
    ),
    "long word": ('{"equations": "' + "x" * 19_000 + "''=-1\"}", "too many characters"),
    "long word of digits": ('{"equations": "' + "d2" * 9_500 + "''=-1\"}", "too many characters"),
    "empty lines": ('{"equations": "x\'\'=-x' + "\\n" * 19_000 + '"}', "too many parts"),
    "many Lagrange's equations": (
        '{"equations": "L = x\'^2; ' + "d/dt \u2202L " * 2_000 + '"}',
        "too many parts",
    ),
    "many dots": ('{"equations": "x\'\'=-x' + "\u0307" * 9_000 + '"}', "third derivative"),
    "sums of sums": (
        '{"equations": "\\\\ddot{x} = ' + "\\\\sum_{i=1}^{60} " * 18 + 'x"}',
        "too many parts",
    ),
    "prompts of a session": ('{"equations": "' + ">>>" * 6_000 + '"}', "too many parts"),
    "deep lists": ("[" * 100_000 + "]" * 100_000, "deep"),
    "deep objects": ('{"a":' * 3_000 + "1" + "}" * 3_000, "deep"),
    "no UTF-8": ('{"coordinates": ["\ud800"]}', "UTF-8"),
    "million characters": ('{"equations": {"x": "' + "x+" * 250_000 + 'x"}}', "characters"),
    "parentheses": ('{"equations": {"x": "' + "(" * 2_000 + "x" + ")" * 2_000 + '"}}', "nested"),
}


# Each takes a second; a shorter text has too many parts as well, and what reading costs grows like the text.
SLOW = {"empty lines", "prompts of a session"}


def by_turns(bodies: Sequence[T], names: Sequence[str]) -> list[Any]:
    """Each body by both doors, of which the default tests take one, by turns."""
    every = [(place, door) for place in range(len(bodies)) for door in (0, 1)]
    return [
        pytest.param(
            bodies[place],
            ("command line", "http")[door],
            id=f"{names[place]}-{('command-line', 'http')[door]}",
            marks=() if place % 2 != door and names[place] not in SLOW else pytest.mark.slow,
        )
        for place, door in every
    ]


@pytest.mark.parametrize(("name", "door"), by_turns([*LONG], [*LONG]))
def test_a_long_body_is_refused(name: str, door: str, request: pytest.FixtureRequest) -> None:
    body, words = LONG[name]
    service = request.getfixturevalue("service") if door == "http" else None
    found = calls.solve(body, door, service)
    assert isinstance(found, calls.Refusal), found
    assert fault_of_refusal({"words": words}, found) is None


@pytest.mark.parametrize(("row", "door"), by_turns(BODIES, [row["id"] for row in BODIES]))
def test_a_hostile_body_is_refused(row: Row, door: str, request: pytest.FixtureRequest) -> None:
    service = request.getfixturevalue("service") if door == "http" else None
    found = calls.solve(row["body"], door, service)
    assert isinstance(found, calls.Refusal), found
    assert fault_of_refusal(row.get("refused", {}), found) is None


@pytest.mark.parametrize(
    ("row", "changes"),
    [
        ({"reads": {"x": "-x"}}, "x'' = -2*x"),
        ({"reads": {"x": "-x"}}, "x'' = foo bar"),
        ({"refused": {}}, "x'' = -x"),
        ({"refused": {"column": 1}}, "x'' = -x + !"),
        ({"refused": {"words": "comma"}}, "x'' = -x + !"),
    ],
)
def test_the_runner_sees_what_is_wrong(row: Row, changes: str) -> None:
    assert fault_of(row, parsed({"equations": changes})) is not None
