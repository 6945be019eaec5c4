"""The checker answers any input promptly with a verdict and a sentence."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from inverse_service.certificate.checker import CheckResult, check_certificate, check_text
from tests.certificate.documents import (
    Document,
    changed,
    check_result,
    existence,
    lagrangian,
    nonexistence,
    result,
)


def nested(depth: int) -> Any:
    value: Any = []
    for _ in range(depth):
        value = [value]
    return value


STRANGE: list[Any] = [
    None, True, 0, 10**5000, 1.5, float("nan"), "", "null", b"{}", [], [[]], {}, {1: 2}, {"": ""}, {"format": []},
    {"format": "inverse-service/certificate/2"},
    {"format": "inverse-service/result/1"}, nested(900), object(), {None: None},
    {"format": "inverse-service/certificate/2", "system": {"coordinates": ["x"], "equations": {"x": "0"}}},
]  # fmt: skip


@pytest.mark.parametrize("value", STRANGE, ids=lambda value: type(value).__name__)
def test_anything_is_answered(value: Any) -> None:
    for found in (check_certificate(value), check_result(value), check_text(value)):
        assert found.verdict == "invalid"
        assert len(found.reasons) == 1
        assert found.reasons[0].endswith(".")


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "nul", "[" * 100_000, '{"a":' * 100_000, "[" * 100_000 + "]" * 100_000, '{"a": 1, "a": 1}', "NaN",
        '{"format": NaN}', '{"format": -Infinity}', '{"a": 1e999}', "9" * 5000, '"\\ud800"', '{"\\ud800": 1}',
        '{"format": "\\ud800"}', "\x00", "\ufeff{}",
    ],
    ids=str.__len__,
)  # fmt: skip
def test_texts_that_are_no_document_are_invalid(text: str) -> None:
    found = check_text(text)
    assert found.verdict == "invalid"
    assert len(found.reasons[0]) < 300
    found.reasons[0].encode()


def test_every_truncation_of_a_text_is_invalid() -> None:
    text = json.dumps(nonexistence("douglas-IIIb", 1))
    for length in range(0, len(text), 7):
        assert check_text(text[:length]).verdict == "invalid"


def test_repeated_keys_are_rejected_anywhere() -> None:
    text = json.dumps(lagrangian("oscillator", "x'^2/2 - x^2/2"))
    assert check_text(text, seed=1).verdict == "valid"
    twice = text.replace('"claim": "variational"', '"claim": "variational", "claim": "variational"')
    assert check_text(twice, seed=1).verdict == "invalid"
    assert (
        check_text(text.replace('"x": "-x"', '"x": "-x", "x": "-x"'), seed=1).verdict == "invalid"
    )


def documents() -> list[Document]:
    return [
        lagrangian("oscillator", "x'^2/2 - x^2/2", near={"x": "1"}),
        nonexistence("douglas-IIIb", 2),
        existence("henon-heiles", 2, [1, 1], [0, 0]),
    ]


def paths(value: Any, path: str = "") -> list[str]:
    """The dotted paths of all members, with at most three of each list."""
    members: list[tuple[Any, Any]] = list(enumerate(value))[:3] if isinstance(value, list) else []
    members = list(value.items()) if isinstance(value, dict) else members
    found: list[str] = []
    for key, part in members:
        found += [f"{path}{key}", *paths(part, f"{path}{key}.")]
    return found


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize(
    "value", [None, True, -1, 10**6, 0.5, "", "\x00", "x y", [], [None], {}, {"x": 1}]
)
def test_no_member_may_be_anything_else(number: int, value: Any) -> None:
    """There is always a verdict, and never "valid" unless the replaced part is optional or
    unused.
    """
    document = documents()[number]
    free = {
        "near",
        "near.x",
        "system.parameters",
        "system.functions",
        "symbol.characters",
        "lagrangian",
    }
    for path in paths(document):
        found = check_certificate(changed(document, path, value), seed=1, time_limit=5)
        assert isinstance(found, CheckResult)
        if path not in free and not path.startswith("rows"):
            assert found.verdict != "valid", (path, value)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_missing_member_is_noticed(number: int) -> None:
    document = documents()[number]
    optional = {"near", "near.x", "system.parameters", "system.functions"}
    for path in paths(document):
        if path not in optional and not path.startswith(("rows.", "symbol.characters.")):
            assert check_certificate(changed(document, path, ...), seed=1).verdict == "invalid", (
                path
            )


BAD_SYSTEMS: list[tuple[str, Any]] = [
    ("coordinates", []), ("coordinates", ["x", "x"]), ("coordinates", ["t"]), ("coordinates", ["sin"]),
    ("coordinates", "x"),
    ("coordinates", ["x'"]), ("coordinates", ["1x"]), ("coordinates", ["\u0445"]), ("coordinates", ["x" * 101]),
    ("coordinates", [f"x{k}" for k in range(17)]), ("coordinates", [["x"]]), ("parameters", ["x"]),
    ("parameters", ["pi"]),
    ("parameters", ["a", "a"]), ("parameters", {"a": 1}), ("parameters", [0]), ("functions", ["A"]),
    ("functions", {"x": ["x"]}),
    ("functions", {"A": []}), ("functions", {"A": "x"}), ("functions", {"exp": ["x"]}), ("functions", {"A B": ["x"]}),
    ("equations", {}), ("equations", ["-x"]), ("equations", {"x": 0}), ("equations", {"x": None}),
    ("equations", {"x": "y"}),
    ("equations", {"x": "-x", "y": "0"}), ("equations", {"x": "-x", 1: "0"}), ("equations", {"x": "x''"}),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value"), BAD_SYSTEMS)
def test_an_invalid_system_is_rejected(key: str, value: Any) -> None:
    document = lagrangian("oscillator", "x'^2/2 - x^2/2")
    assert check_certificate(changed(document, f"system.{key}", value), seed=1).verdict == "invalid"


def test_large_work_ends_at_the_time_limit() -> None:
    """Many coordinates at a high order, and formulas with dense series."""
    names = [f"x{k}" for k in range(8)]
    system = {
        "coordinates": names,
        "equations": {name: f"1/({'+'.join(names)})^3" for name in names},
    }
    document = {**existence("henon-heiles", 3, [1, 1], [0, 0]), "system": system}
    start = time.process_time()
    assert check_certificate(document, time_limit=0.2).verdict == "incomplete"
    assert check_certificate({**document, "order": 20}, time_limit=0.2).verdict == "incomplete"
    hard = lagrangian("free", "*".join(["(1+x+x')^999"] * 500))
    assert check_certificate(hard, time_limit=0.2).verdict in ("incomplete", "invalid")
    assert time.process_time() - start < 3


@pytest.mark.parametrize(
    "text",
    [
        "((10^300)^1000)^1000*sin(x)",
        "x^999999999*x'^2", "x'^(10^400)*x", "sin(x)^1000^1000", "(" * 190 + "x" + ")^999" * 190,
        "diff(" * 5000, "diff(A(" * 5000, "x^2" + " " * 50_000 + "^2", "sqrt(" * 190 + "x" + ")" * 190,
        "+".join(["diff(A(x, y), x)"] * 3000),
    ],
    ids=lambda text: text[:20],
)  # fmt: skip
def test_formulas_made_to_take_long_are_answered_soon(text: str) -> None:
    start = time.process_time()
    assert check_certificate(lagrangian("free", text), seed=1, time_limit=0.3).verdict in (
        "invalid",
        "incomplete",
    )
    assert time.process_time() - start < 3


def test_a_huge_object_is_refused_at_once() -> None:
    start = time.process_time()
    big = {f"k{k}": "1" for k in range(200_000)}
    assert check_certificate(lagrangian("free", "x'^2", near=big)).verdict == "invalid"
    assert check_result({**result("free", "variational", None), **big}).verdict == "invalid"
    assert time.process_time() - start < 1


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=10,
)


@settings(max_examples=10, deadline=None)
@given(value=JSON, number=st.integers(0, 2), data=st.data())
def test_random_damage_is_answered(value: Any, number: int, data: st.DataObject) -> None:
    assert_answered(value, number, data)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(value=JSON, number=st.integers(0, 2), data=st.data())
def test_more_random_damage_is_answered(value: Any, number: int, data: st.DataObject) -> None:
    assert_answered(value, number, data)


def assert_answered(value: Any, number: int, data: st.DataObject) -> None:
    document = documents()[number]
    path = data.draw(st.sampled_from(paths(document)))
    found = check_certificate(changed(document, path, value), time_limit=5)
    assert found.verdict in ("valid", "incomplete", "invalid")
    assert check_result(value).verdict == "invalid"


@pytest.mark.parametrize("branches", [{"a": 1}, {"a": {}}, [1], "abc", 5, [[]]])
def test_branches_that_are_no_list_of_objects_are_invalid(branches: Any) -> None:
    assert (
        check_result(result("oscillator", "undetermined", None, branches=branches)).verdict
        == "invalid"
    )
