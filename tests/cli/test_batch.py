"""A batch answers every line exactly once, for any lines, even if it is killed at any time."""

from __future__ import annotations

import csv
import gzip
import io
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.serving import until

SYSTEM = {"coordinates": ["x"], "equations": {"x": "-x"}}
COMMAND = [sys.executable, "-m", "inverse_service", "batch"]


def batch(
    source: object, output: object, *more: str, **options: Any
) -> subprocess.CompletedProcess[str]:
    command = [
        *COMMAND,
        str(source),
        "--output",
        str(output),
        "--workers",
        "2",
        "--time-limit",
        "20",
        *more,
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def written(*documents: dict[str, Any]) -> str:
    return "".join(json.dumps(document) + "\n" for document in documents)


def answers(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    return tmp_path / "in.ndjson", tmp_path / "out.ndjson"


@pytest.mark.slow
def test_bad_lines_become_error_lines_and_the_others_continue(files: tuple[Path, Path]) -> None:
    source, output = files
    lines = [
        json.dumps({"id": "good", **SYSTEM}),
        "",
        "{not json",
        json.dumps({"id": "unknown", **SYSTEM, "color": "red"}),
        json.dumps({"id": "good", **SYSTEM}),
        json.dumps(SYSTEM),
        json.dumps({"id": "name", "coordinates": ["x"], "equations": {"x": "-k*x"}}),
        '{"id": "nan", "coordinates": NaN}',
    ]
    source.write_text("\n".join(lines))
    run = batch(source, output)
    assert run.returncode == 1, run.stderr
    found = {answer["line"]: answer for answer in answers(output)}
    assert sorted(found) == [1, 3, 4, 5, 6, 7, 8]
    assert {found[k]["verdict"] for k in (1, 4, 6)} == {"variational"}
    assert found[4]["ignored"] == ["color"]
    assert [found[k]["id"] for k in (1, 3, 4, 5, 6, 7, 8)] == [
        "good",
        None,
        "unknown",
        "good",
        6,
        "name",
        None,
    ]
    for k in (3, 5, 7, 8):
        assert found[k]["error"]["detail"].startswith(f"Line {k}: ")
    assert found[5]["duplicate_of"] == 1
    assert found[7]["error"]["errors"][0]["pointer"] == "/equations/x"
    assert found[7]["error"]["errors"][0]["column"] == 2
    assert "3 variational, 4 error lines" in run.stderr
    assert "The first error line" in run.stderr
    assert " a second." in run.stderr
    assert "Traceback" not in run.stderr
    before = output.read_bytes()
    again = batch(source, output)
    assert "3 variational, 4 error" in again.stderr
    assert again.returncode == 1
    assert output.read_bytes() == before


@pytest.mark.slow
def test_a_batch_that_is_killed_half_way_and_started_again_answers_every_line_once(
    files: tuple[Path, Path],
) -> None:
    source, output = files
    count = 60
    source.write_text(
        "".join(json.dumps({"id": f"s{k}", **SYSTEM, "name": f"{k}"}) + "\n" for k in range(count))
    )
    command = [*COMMAND, str(source), "--output", str(output), "--workers", "2"]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        until(lambda: output.exists() and output.read_bytes().count(b"\n") >= 10)
        process.send_signal(signal.SIGKILL)
    done = output.read_bytes().count(b"\n")
    assert 10 <= done < count
    with output.open("ab") as stream:
        stream.write(b'{"id": "s149", "line"')  # as if killed during a write
    run = batch(source, output)
    assert run.returncode == 0, run.stderr
    assert sorted(answer["id"] for answer in answers(output)) == sorted(
        f"s{k}" for k in range(count)
    )
    assert {answer["verdict"] for answer in answers(output)} == {"variational"}


@pytest.mark.slow
@pytest.mark.parametrize("content", ["", "\n\n  \n"])
def test_an_empty_batch_has_an_empty_output(files: tuple[Path, Path], content: str) -> None:
    source, output = files
    source.write_text(content)
    assert batch(source, output).returncode == 0
    assert output.read_bytes() == b""


@pytest.mark.slow
def test_files_that_cannot_be_used_are_exit_2(files: tuple[Path, Path]) -> None:
    source, output = files
    missing = batch(source, output)
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)
    source.write_text(json.dumps(SYSTEM) + "\n")
    for bad in (source, source.parent / "no" / "out", source.parent):
        run = batch(source, bad)
        assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert source.read_text() == json.dumps(SYSTEM) + "\n"
    output.write_text("my thesis\n")
    assert batch(source, output).returncode == 2
    assert output.read_text() == "my thesis\n"


SPRING = {"equations": "x'' = -x"}
SWIRL = {"equations": ["x'' = x^2+y^2", "y'' = 0"]}


@pytest.mark.slow
def test_an_inserted_or_changed_line_is_never_given_the_answer_of_another(
    files: tuple[Path, Path],
) -> None:
    source, output = files
    source.write_text(
        written(SPRING, SWIRL, {"id": "a", **SPRING}, {"id": "typo", "equations": "x'' = -k*x"})
    )
    assert batch(source, output).returncode == 1
    mended = {"id": "typo", "equations": "x'' = -k*x", "parameters": ["k"]}
    source.write_text(
        written({"equations": "z'' = -z^5"}, SPRING, SWIRL, {"id": "a", **SWIRL}, mended)
    )
    run = batch(source, output)
    assert (run.returncode, "answered by an earlier" in run.stderr) == (0, False), run.stderr
    assert f"Answers that were replaced are in {output}.replaced." in run.stderr
    found = {answer["id"]: answer for answer in answers(output)}
    assert len(found) == len(answers(output)) == 5
    assert [found[k]["verdict"] for k in (1, 2, 3, "a", "typo")] == [
        "variational", "variational", "not_variational", "not_variational", "variational",
    ]  # fmt: skip
    assert list(found[1]["system"]["equations"]) == ["z"]
    assert batch(source, output).stderr.endswith("5 answered by an earlier run.\n")


@pytest.mark.slow
def test_errors_and_undetermined_lines_are_asked_again_where_it_is_wished(
    files: tuple[Path, Path],
) -> None:
    source, output = files
    source.write_text(written({"id": "good", **SPRING}, {"id": "bad", "equations": "x'' = -k*x"}))
    batch(source, output)
    good, bad = ([a for a in answers(output) if a["id"] == id] for id in ("good", "bad"))
    undetermined = {
        "id": "good",
        "line": 1,
        "digest": good[0]["digest"],
        "verdict": "undetermined",
        "reason": "so",
    }
    output.write_text(written(undetermined, *bad))
    kept = batch(source, output)
    assert "1 undetermined, 1 error" in kept.stderr
    assert "The first undetermined: so" in kept.stderr
    run = batch(source, output, "--again", "errors,undetermined")
    assert "1 variational, 1 error" in run.stderr
    assert sorted((a["id"], a.get("verdict")) for a in answers(output)) == [
        ("bad", None),
        ("good", "variational"),
    ]
    assert batch(source, output, "--again", "everything").returncode == 2


@pytest.mark.slow
def test_a_batch_goes_from_standard_input_to_standard_output_and_through_gzip(
    files: tuple[Path, Path],
) -> None:
    source, output = files
    piped = batch("-", "-", input=written({"id": "a", **SPRING}, {"id": "b", **SWIRL}))
    assert {json.loads(line)["id"]: json.loads(line)["verdict"] for line in piped.stdout.splitlines()} == {
        "a": "variational", "b": "not_variational",
    }  # fmt: skip
    packed = source.with_suffix(".ndjson.gz")
    packed.write_bytes(gzip.compress(written({"id": "a", **SPRING}).encode()))
    assert batch(packed, output.with_suffix(".gz")).returncode == 0
    assert (
        json.loads(gzip.decompress(output.with_suffix(".gz").read_bytes()))["verdict"]
        == "variational"
    )


@pytest.mark.slow
def test_a_file_of_another_kind_is_exit_2_at_once(files: tuple[Path, Path]) -> None:
    source, output = files
    for text, words in (
        (json.dumps([SPRING, SWIRL]), "a JSON array"),
        (json.dumps(SPRING, indent=2), "several lines"),
        ("id,equations\n" * 12, "All 12 lines are error lines"),
    ):
        output.unlink(missing_ok=True)
        source.write_text(text)
        for _ in range(2):  # the second time the ten answers exist
            run = batch(source, output)
            assert (run.returncode, words in run.stderr, run.stderr.count("\n")) == (2, True, 1), (
                run.stderr
            )
    nine = "nonsense\n" * 9 + json.dumps(SPRING) + "\n" + "nonsense\n" * 9
    source.write_text(nine)
    output.unlink()
    assert batch(source, output).returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_batch_says_how_far_it_came(
    files: tuple[Path, Path], number: signal.Signals
) -> None:
    source, output = files
    hard = [
        {
            "equations": {
                f"x{k}": "+".join(f"x{j}'^2*sin({m}*x{k}*x{j})" for j in range(8)) for k in range(8)
            }
        }
        for m in range(2, 42)
    ]
    source.write_text(written(SPRING, *hard))
    command = [*COMMAND, str(source), "--output", str(output), "--workers", "2"]
    # A shell starts background commands with Ctrl-C ignored, and children inherit that.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        signal.signal(signal.SIGINT, before)
        until(lambda: output.exists() and output.read_bytes())
        process.send_signal(number)
        said = process.communicate(timeout=30)[1]
    # On a busy machine one more answer may arrive before the signal.
    count = len(answers(output))
    assert 1 <= count < 41
    # The signal may come between a line and its count.
    said_of = [
        f"{k} of 41 lines answered; run the same command again to resume."
        for k in (count, count - 1)
    ]
    assert process.returncode == 130
    assert said.splitlines()[-1] in said_of


@pytest.mark.slow
def test_a_full_output_is_exit_2(files: tuple[Path, Path]) -> None:
    source, _ = files
    source.write_text(written(SPRING))
    with open("/dev/full", "wb") as full:
        run = subprocess.run(
            [*COMMAND, source, "--output", "-"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (run.returncode, run.stderr) == (
        2,
        "The output cannot be written: no space left on device.\n",
    )


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    asked = [sys.executable, "-m", "inverse_service", *arguments]
    return subprocess.run(asked, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["ndjson", "ndjson.gz"])
def test_a_batch_is_checked_and_tabulated_line_by_line(tmp_path: Path, ending: str) -> None:
    source, output = tmp_path / "in.ndjson", tmp_path / f"out.{ending}"
    oscillator, forward = {"id": "a", **SYSTEM}, {"id": "b", "lagrangian": "x'^2/2"}
    source.write_text(written(oscillator, forward))
    assert batch(source, output).returncode == 0
    checked = command("check", str(output))
    assert (checked.returncode, checked.stdout) == (0, "1 valid, 1 without a verdict to check.\n")
    if ending == "ndjson":
        renamed = output.rename(tmp_path / "night.out")
        assert command("check", str(renamed)).stdout == checked.stdout
        renamed.rename(output)
    rows = list(csv.DictReader(io.StringIO(command("table", str(output)).stdout)))
    assert {row["id"]: (row["verdict"], row["L"]) for row in rows} == {
        "a": ("variational", "x'^2/2 - x^2/2"),
        "b": ("", "x'^2/2"),
    }


@pytest.mark.slow
def test_the_check_of_a_batch_finds_a_forged_line_and_counts_error_lines(
    files: tuple[Path, Path],
) -> None:
    source, output = files
    unknown = {"coordinates": ["x"], "equations": {"x": "-k*x"}}
    lines = written(
        {"id": "true", **SYSTEM}, {"id": "forged", **SYSTEM}, {"id": "error", **unknown}
    )
    source.write_text(lines + "[1]\n")  # its answer has the id null
    assert batch(source, output).returncode == 1
    forged = [
        {**answer, "verdict": "not_variational"} if answer["id"] == "forged" else answer
        for answer in answers(output)
    ]
    output.write_text(written(*forged))
    checked = command("check", str(output))
    assert checked.returncode == 1
    assert 'id "forged": invalid' in checked.stdout
    assert checked.stdout.splitlines()[-1] == "1 invalid, 1 valid, 2 error lines."
    rows = list(csv.DictReader(io.StringIO(command("table", str(output)).stdout)))
    assert ["k" in row["reason"] for row in rows if row["verdict"] == "error" and row["id"]] == [
        True
    ]


@pytest.mark.slow
@pytest.mark.parametrize("content", ["{}\n", "[1]\n", "not JSON\n", json.dumps(SYSTEM) + "\n"])
def test_a_file_that_is_not_batch_output_is_exit_2(files: tuple[Path, Path], content: str) -> None:
    _, output = files
    output.write_text(content)
    assert command("check", str(output)).returncode == 2
