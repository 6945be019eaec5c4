"""What is answered to tests is noticed when it changes, and nothing else is."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
import pytest

from inverse_service.errors import InputError
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from tests.golden import answers


@dataclass(frozen=True)
class Part:
    value: float
    seconds: float = 0.0


def said(value: object) -> str:
    return "\n".join(answers.parts_of(value, "", set()))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("x is missing", "y is missing"),
        ({"a": 1}, {"b": 1}),
        ([1, 2], [2, 1]),
        ([1, 2], [1]),
        (0.1234, 0.1235),
        (1e-3, -1e-3),
        (Part(1.0), Part(2.0)),
        (np.arange(4.0), np.arange(5.0)),
        (np.linspace(0, 1, 900), np.linspace(0, 2, 900)),
        ({1, 2}, {1, 3}),
        (ValueError("no"), ValueError("yes")),
        (True, False),
        (None, "None of them"),
    ],
)
def test_another_answer_is_said_otherwise(one: object, other: object) -> None:
    assert said(one) != said(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (0.25 * (1 + 1e-12), 0.25),
        (1.00005, 1.00005 * (1 - 1e-14)),
        (3e-14, -2e-15),
        (Part(1.0, 0.3), Part(1.0, 0.4)),
        ({"seconds": 1, "L": "x"}, {"seconds": 2, "L": "x"}),
        ("took 0.31 s at http://127.0.0.1:8123", "took 12 s at http://127.0.0.1:9001"),
        ("<a at 0x7f12>", "<a at 0x7e99>"),
        ("job 0123456789abcdef0123456789abcdef", "job ffffffffffffffff0000000000000000"),
        ({"a", "b", "c"}, {"c", "b", "a"}),
    ],
)
def test_round_off_clocks_and_drawn_names_do_not_count(one: object, other: object) -> None:
    assert said(one) == said(other)


def test_a_text_counts_without_its_clocks() -> None:
    one, other = (json.dumps({"L": "x", "seconds": k}) for k in (1, 2))
    assert answers.read(one) == {"L": "x", "seconds": 1}
    for text in ("{}", "{}\nend", "{0}\n{0}\n"):
        assert said(answers.read(text.format(one))) == said(answers.read(text.format(other)))
    assert answers.read("a\n7") == ["a", "7"]


def test_a_large_answer_costs_little_and_one_that_contains_itself_ends() -> None:
    own: list[Any] = [1]
    own.append(own)
    assert said(own).endswith("...")
    heard = answers.Heard()
    heard.begin()
    heard.add("many", [[str(k)] for k in range(10**6)])
    assert len(heard.end()[0].split("\n")) <= answers.PARTS + 1


@pytest.fixture
def room(monkeypatch: pytest.MonkeyPatch) -> tuple[ModuleType, answers.Heard]:
    """A module of tests that has the reader, and what it hears."""
    heard = answers.Heard()
    monkeypatch.setattr(answers, "HEARD", heard)
    module: Any = ModuleType("tests.made_up")
    module.reader, module.read_formula = reader, reader.read_formula
    answers.listen([module])
    heard.begin()
    return module, heard


@pytest.mark.parametrize("how", [lambda m: m.reader.read_formula, lambda m: m.read_formula])
def test_values_and_errors_of_the_package_are_heard(
    how: Callable[[Any], Callable[..., Any]], room: tuple[Any, answers.Heard]
) -> None:
    module, heard = room
    names = Names(("x",), ())
    assert ex.has(how(module)("x+1", names), ex.Symbol)
    with pytest.raises(InputError):
        how(module)("x+", names)
    texts = heard.end()
    assert {text.split("\n")[0] for text in texts} == {f"{reader.__name__}.read_formula"}
    assert [text for text in texts if "InputError" in text.split("\n")[1]] != texts
    assert len(texts) == 2


def test_what_a_test_replaces_is_replaced_in_the_package(room: tuple[Any, answers.Heard]) -> None:
    module, _ = room
    real = reader.read_formula
    with mock.patch.object(module.reader, "read_formula", return_value=7):
        assert reader.read_formula() == 7  # type: ignore[call-arg]
    assert reader.read_formula is real


def test_a_test_that_is_answered_otherwise_is_at_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    known = {
        "tests/a.py": {
            answers.mark("test_b"): answers.digest(["L = x"]),
            answers.mark("test_c"): None,
        }
    }
    monkeypatch.setattr(answers, "stored", lambda: known)
    assert answers.fault("tests/a.py::test_b", ["L = x"]) is None
    assert answers.fault("tests/a.py::test_d", ["L = z"]) is None
    wrong = answers.fault("tests/a.py::test_b", ["L = y"])
    assert wrong is not None
    assert "L = y" in wrong
