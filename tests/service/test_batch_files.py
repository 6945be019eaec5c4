"""Lines of a batch are told apart, and an interrupted output is read back exactly."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from inverse_service.errors import InputError
from inverse_service.service.jobs.batch_files import MAX_LINE_BYTES, count_lines, finished_keys, read_lines


def lines(*texts: str) -> list[tuple[object, ...]]:
    stream = io.BytesIO("\n".join(texts).encode())
    return [(line.number, line.identifier, line.fault is not None, line.duplicate_of) for line in read_lines(stream)]


def test_empty_lines_are_skipped_but_counted() -> None:
    assert lines("", '{"id": "a"}', "  ", '{"id": 7}') == [(2, "a", False, None), (4, 7, False, None)]


def test_a_missing_id_is_the_line_number() -> None:
    assert lines("{}", "{}") == [(1, 1, False, None), (2, 2, False, None)]


def test_a_second_use_of_an_id_is_a_fault_that_names_the_first() -> None:
    assert lines('{"id": "a"}', '{"id": "a"}') == [(1, "a", False, None), (2, "a", True, 1)]


@pytest.mark.parametrize(
    "text",
    ["{", "[]", "3", '{"id": null}', '{"id": 1.5}', '{"id": true}', '{"id": [1]}', '{"a": NaN}', '{"id": "\\ud800"}'],
)
def test_an_unreadable_line_is_a_fault_and_the_rest_goes_on(text: str) -> None:
    assert lines(text, '{"id": "b"}') == [(1, None, True, None), (2, "b", False, None)]


def test_a_line_that_is_too_long_is_a_fault_and_the_rest_goes_on(tmp_path: Path) -> None:
    long = '{"id": "' + "a" * (2 * MAX_LINE_BYTES) + '"}'
    assert lines(long, '{"id": "b"}') == [(1, None, True, None), (2, "b", False, None)]
    path = tmp_path / "in.ndjson"
    path.write_text(long + "\n{}\n")
    assert count_lines(path) == 2


def test_ids_one_and_text_one_are_two_ids() -> None:
    found = list(read_lines(io.BytesIO(b'{"id": 1}\n{"id": "1"}')))
    assert len({line.key for line in found}) == 2


def test_a_half_written_last_line_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "out.ndjson"
    whole = json.dumps({"id": "a", "line": 1}) + "\n" + json.dumps({"id": None, "line": 2}) + "\n"
    path.write_text(whole + '{"id": "b", "li')
    assert finished_keys(path) == {'id "a"', "line 2"}
    assert path.read_text() == whole


def test_a_missing_output_has_no_answers(tmp_path: Path) -> None:
    assert finished_keys(tmp_path / "none") == set()


@pytest.mark.parametrize("content", ["hello\n", "[1]\n", "{}\n", "\x00\n"])
def test_a_file_that_is_no_output_is_left_as_it_is(tmp_path: Path, content: str) -> None:
    path = tmp_path / "out.ndjson"
    path.write_text(content + "rest")
    with pytest.raises(InputError, match="not an answer"):
        finished_keys(path)
    assert path.read_text() == content + "rest"
