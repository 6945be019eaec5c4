"""Documents are parsed strictly and exactly, or rejected with one sentence and the location."""

from __future__ import annotations

from decimal import Decimal

import pytest
from yaml._yaml import CParser

from inverse_service.errors import InputError, LimitError
from inverse_service.service.documents import plain_data
from inverse_service.service.documents.documents import parse_document
from inverse_service.service.documents.plain_data import (
    read_document,
    read_json,
    read_toml,
    read_yaml,
)
from tests.values import slow


def test_decimal_numbers_of_json_stay_exact() -> None:
    assert read_json('{"a": 0.1}') == {"a": Decimal("0.1")}


def test_a_byte_order_mark_is_accepted() -> None:
    assert read_json(b"\xef\xbb\xbf[1]") == [1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "empty"),
        (b"  \n", "empty"),
        (b"{", "not JSON"),
        (b'{"a": 1,}', "line 1"),
        (b'{"a": 1, "a": 2}', "twice"),
        (b'{"b": {"a": 1, "a": 1}}', "twice"),
        (b"NaN", "NaN"),
        (b'{"a": [Infinity]}', "Infinity"),
        (b"-Infinity", "Infinity"),
        (b"1e999", "10^300"),
        (b"1e99999999999999999999", "10^300"),
        (b"9" * 5000, "characters"),
        (b'"\\ud800"', "surrogate"),
        (b'{"\\udfff": 1}', "surrogate"),
        (b'{"a": ["\\ud83d"]}', "surrogate"),
        (b"\xff\xfe", "UTF-8"),
        (b'"\xed\xa0\x80"', "UTF-8"),
        (b"[" * 100_000, "deep"),
        (b'{"a":' * 5_000, "deep"),
        (b'["a"] x', "not JSON"),
    ],
)
def test_bad_json_gets_one_sentence(text: bytes, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_json(text)
    assert words in caught.value.detail
    assert len(caught.value.detail) < 300
    assert "\n" not in caught.value.detail


def test_a_surrogate_pair_written_whole_is_a_character() -> None:
    assert read_json('"\\ud83d\\ude00"') == "\U0001f600"


def test_the_place_of_a_surrogate_is_reported() -> None:
    with pytest.raises(InputError, match="surrogate") as caught:
        read_json('{"a/b": ["x", "\\ud800"]}')
    assert caught.value.pointer == "/a~1b/1"


def test_brackets_inside_texts_do_not_count_as_depth() -> None:
    assert read_json('["' + "[" * 1000 + '\\""]') == ["[" * 1000 + '"']


def test_yaml_scalars_stay_text_so_that_numbers_are_exact() -> None:
    text = "coordinates: [x, y]\nequations: {x: 0.10, y: 1e3}\ntime_dependent_lagrangian: false\nname: ~\n"
    expected = {"coordinates": ["x", "y"], "equations": {"x": "0.10", "y": "1e3"}}
    assert read_yaml(text) == {**expected, "time_dependent_lagrangian": False, "name": None}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\na: 2", "twice"),
        ("a: &b [1]\nc: *b", "alias"),
        ("!!python/object/apply:os.system ['true']", "could not determine a constructor"),
        ("{[1]: 2}", "key must be text"),
        ("a: [", "line"),
        slow("[" * 3000, "deep"),
        ("a: \x00", "not YAML"),
    ],
)
def test_bad_yaml_gets_one_sentence(text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_yaml(text)
    assert words in caught.value.detail


def test_yaml_is_scanned_by_libyaml_and_its_aliases_are_refused_all_the_same() -> None:
    """In Python a megabyte takes 11 s of the processor, with it 3 s."""
    assert issubclass(plain_data._plain_loader(), CParser)
    with pytest.raises(InputError, match="aliases"):
        read_yaml("a: &b [1]\nc: [*b, *b]")


def test_toml_numbers_stay_exact() -> None:
    assert read_toml("[parameters]\ng = 9.81") == {"parameters": {"g": Decimal("9.81")}}


@pytest.mark.parametrize(
    "text", ["a = 1\na = 2", "a = nan", "a = inf", "a = ", "a = 1e999", "a = " + "[" * 3000]
)
def test_bad_toml_gets_one_sentence(text: str) -> None:
    with pytest.raises(InputError):
        read_toml(text)


def test_the_ending_of_the_name_tells_the_form() -> None:
    assert read_document("a: 1", "system.YML") == {"a": "1"}
    assert read_document("a = 1", "system.toml") == {"a": 1}
    assert read_document('{"a": 1}', "-") == {"a": 1}


def test_a_limit_is_a_limit_error() -> None:
    with pytest.raises(LimitError):
        read_json("[" * 100)


def test_rates_that_are_glued_to_their_names_may_be_in_one_line() -> None:
    found = parse_document({"equations": "d\u03b8 = \u03c9; d\u03c9 = -sin(\u03b8)"})
    assert {name: part["text"] for name, part in found["equations"].items()} == {
        "theta": "-sin(theta)"
    }


@pytest.mark.parametrize("drag", ["c x' |x'|", "c x' sqrt(x'^2)", "c |x'| x'"])
def test_drag_beside_a_mass_slows_down_in_both_directions(drag: str) -> None:
    found = parse_document({"equations": f"m x'' + {drag} + k x = 0", "parameters": "guess"})
    assert found["equations"]["x"]["text"] in ("-(c*x'*abs(x') + k*x)/m", "-(c*abs(x')*x' + k*x)/m")
