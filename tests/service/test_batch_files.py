"""Lines of a batch are distinguished, and an interrupted output is read back exactly."""

from __future__ import annotations

import gzip
import io
import json
import os
from pathlib import Path

import pytest

from inverse_service import errors
from inverse_service.service.jobs import batch, model, tasks


def lines(*texts: str) -> list[tuple[object, ...]]:
    stream = io.BytesIO("\n".join(texts).encode())
    return [
        (line.number, line.identifier, line.fault is not None, line.duplicate_of)
        for line in batch.read_lines(stream)
    ]


def test_empty_lines_are_skipped_but_counted() -> None:
    assert lines("", '{"id": "a"}', "  ", '{"id": 7}') == [
        (2, "a", False, None),
        (4, 7, False, None),
    ]
    with pytest.raises(errors.InputError, match="1,000,000 blank lines"):
        lines(*[""] * 1_000_002)


@pytest.mark.parametrize(
    ("body", "is_array"), [(b"{}\n\n{}\n{}\n", False), (b"[{}, {}, {}]", True)]
)
def test_of_too_many_lines_none_is_read(
    monkeypatch: pytest.MonkeyPatch, body: bytes, is_array: bool
) -> None:
    monkeypatch.setattr(batch, "batch_line", lambda *_: pytest.fail("a line is read"))
    terms = tasks.Terms("solve", model.JobOptions(), most=2)
    with pytest.raises(errors.LimitError, match="more than 2 lines"):
        batch.batch_task(body, is_array, terms)


def test_a_missing_id_is_the_line_number() -> None:
    assert lines("{}", "{}") == [(1, 1, False, None), (2, 2, False, None)]


def test_a_second_use_of_an_id_is_a_fault_that_names_the_first() -> None:
    assert lines('{"id": "a"}', '{"id": "a"}') == [(1, "a", False, None), (2, "a", True, 1)]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "3",
        '{"id": null}',
        '{"id": 1.5}',
        '{"id": true}',
        '{"id": [1]}',
        '{"a": NaN}',
        '{"id": "\\ud800"}',
    ],
)
def test_an_unreadable_line_is_an_error_and_the_others_continue(text: str) -> None:
    assert lines(text, '{"id": "b"}') == [(1, None, True, None), (2, "b", False, None)]


def test_a_line_that_is_too_long_is_an_error_and_the_others_continue(tmp_path: Path) -> None:
    long = '{"id": "' + "a" * (2 * batch.MAX_LINE_BYTES) + '"}'
    assert lines(long, '{"id": "b"}') == [(1, None, True, None), (2, "b", False, None)]
    path = tmp_path / "in.ndjson"
    path.write_text(long + "\n{}\n")
    assert batch.count_lines(path) == 2


def test_every_line_has_an_answer_of_its_own_that_is_found_again() -> None:
    """A line with the id of another one, or with none, is known by its number."""
    text = b'{"id": "a"}\n{"id": "a"}\n[]\n{"id": "b"}\n3'
    given = list(batch.read_lines(io.BytesIO(text)))
    stream = io.BytesIO()
    output = batch.Output(stream)
    for line in given:
        name, problem = json.dumps(line.identifier), b'{"status": 422, "detail": ""}'
        answer = model.BatchAnswer(line.number, name, "failed", problem)
        output.add(batch.answer_line(answer, line.digest, line.duplicate_of))
    assert len(output.known) == len(given)
    assert [output.known[batch.key_of(line)].digest for line in given] == [
        line.digest for line in given
    ]
    assert not output.superseded


@pytest.mark.parametrize(("status", "label"), [(422, "error"), (500, "fault"), (503, "fault")])
def test_a_fault_of_the_program_is_not_counted_as_one_of_the_line(status: int, label: str) -> None:
    problem = json.dumps({"status": status, "detail": ""}).encode()
    answer = model.BatchAnswer(1, "1", "failed", problem)
    assert batch.Output(io.BytesIO()).add(batch.answer_line(answer)).label == label


def test_ids_one_and_text_one_are_two_ids() -> None:
    found = list(batch.read_lines(io.BytesIO(b'{"id": 1}\n{"id": "1"}')))
    assert len({batch.key_of(line) for line in found}) == 2


def answer(id: object, line: int = 1, **more: object) -> bytes:
    return (
        json.dumps(
            {"id": id, "line": line, "verdict": "variational", "digest": "d", **more}
        ).encode()
        + b"\n"
    )


def test_a_digest_is_of_document_and_options_and_not_of_the_id() -> None:
    texts = (
        '{"id": 1, "a": "x", "b": 1}', '{"b": 1, "a": "x"}', '{"a": "y", "b": 1}', '{"a": "x", "b": 1.0}',
        '{"a": "x", "b": 1, "options": {"seed": 2}}', '{"id": [], "a": "x", "b": 1}', "[", "[[",
    )  # fmt: skip
    digests = [line.digest for line in batch.read_lines(io.BytesIO("\n".join(texts).encode()))]
    assert digests[0] == digests[1]
    assert len(set(digests[1:])) == len(texts) - 1


@pytest.mark.parametrize("name", ["out.ndjson", "out.ndjson.gz"])
def test_what_was_half_written_is_cut_off_and_the_rest_kept(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with batch.open_output(path) as output:
        assert output.known == {}
        output.add(answer("a"))
    whole = path.read_bytes()
    half = gzip.compress(answer("b"))[:-3] if name.endswith("gz") else b'{"id": "b", "li'
    path.write_bytes(whole + half)
    with batch.open_output(path) as output:
        assert set(output.known) == {'id "a"'}
        output.add(answer(None, 2))
    assert path.read_bytes().startswith(whole)
    with batch.open_output(path) as output:
        assert set(output.known) == {'id "a"', "line 2"}


@pytest.mark.parametrize("name", ["out.ndjson", "out.ndjson.gz"])
def test_an_answer_to_another_question_is_replaced_and_kept_elsewhere(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    with batch.open_output(path) as output:
        for line in (answer("a", 1, digest="old"), answer("b", 2)):
            output.add(line)
    path.chmod(0o640)
    with batch.open_output(path) as output:
        output.add(answer("a", 1, digest="new"))
    opened = gzip.open if name.endswith("gz") else open
    with opened(path, "rb") as kept, opened(batch.replaced_path(path), "rb") as replaced:
        assert kept.readlines() == [answer("b", 2), answer("a", 1, digest="new")]
        assert replaced.readlines() == [answer("a", 1, digest="old")]
    assert path.stat().st_mode & 0o777 == 0o640
    assert {p.name for p in tmp_path.iterdir()} == {name, f"{name}.replaced"}


@pytest.mark.parametrize("content", ["hello\n", "[1]\n", "{}\n", "\x00\n"])
@pytest.mark.parametrize("name", ["out.ndjson", "out.gz"])
def test_a_file_that_is_not_output_is_unchanged(tmp_path: Path, content: str, name: str) -> None:
    path = tmp_path / name
    path.write_text(content + "rest")
    with pytest.raises(errors.InputError, match="choose another file"), batch.open_output(path):
        raise AssertionError
    assert path.read_text() == content + "rest"


def test_a_device_a_pipe_and_a_folder_are_no_output(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("/dev/full"), Path("/dev/null"), tmp_path / "pipe", tmp_path):
        with pytest.raises(errors.InputError, match="regular file"), batch.open_output(path):
            raise AssertionError


@pytest.mark.parametrize("damage", ["plain", "cut", "foreign"])
def test_a_damaged_compressed_input_is_one_sentence(tmp_path: Path, damage: str) -> None:
    good = gzip.compress(b"{}\n" * 9)
    path = tmp_path / "in.ndjson.gz"
    path.write_bytes(
        {"plain": b"{}\n", "cut": good[:-9], "foreign": good[:20] + b"abc" * 9}[damage]
    )
    with (
        pytest.raises(errors.InputError, match="damaged or end too"),
        batch.open_source(path) as stream,
    ):
        list(batch.read_lines(stream))


def test_an_error_at_the_end_of_a_line_is_reported_on_that_line() -> None:
    [line] = batch.read_lines(io.BytesIO(b'{"broken"\n'))
    assert line.fault is not None
    assert "line 1, column 10" in line.fault.detail


@pytest.mark.parametrize(("longer", "is_fault"), [(0, False), (1, True)])
def test_a_line_of_the_greatest_length_is_read(longer: int, is_fault: bool) -> None:
    """The line feed at its end does not count."""
    start = b'{"id": "long", "equations": "'
    line = start + b"x" * (batch.MAX_LINE_BYTES + longer - len(start) - 2) + b'"}'
    found = list(batch.read_lines(io.BytesIO(line + b"\n" + b'{"id": 7}\n')))
    assert [one.fault is not None for one in found] == [is_fault, False]
