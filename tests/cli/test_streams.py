"""A closed or full stream gives one sentence and exit code 2; kernels are compiled before any time
limit starts.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = f"{sys.executable} -m inverse_service"


def shell(line: str, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, timeout=300, env=os.environ | more
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("catalogue > /dev/full", "The output cannot be written: no space left on device."),
        ("catalogue >&-", "Standard output is closed; send it to a file."),
        ("solve sho > /dev/full", "The output cannot be written: no space left on device."),
        ("solve - <&-", "Standard input is closed; name a file."),
        ("check - <&-", "Standard input is closed; name a file."),
    ],
)
def test_a_closed_or_full_stream_is_exit_2(line: str, words: str) -> None:
    run = shell(f"{COMMAND} {line}")
    assert (run.returncode, run.stderr.strip()) == (2, words)


@pytest.mark.slow
def test_a_reader_that_disconnects_is_not_an_error() -> None:
    run = shell(
        f"set -o pipefail; for k in 1 2 3; do {COMMAND} catalogue | head -1 || exit 9; done"
    )
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.slow
def test_short_options_of_help_and_version_are_there() -> None:
    for line in ("-h", "solve -h", "-V", "--version", "help", "version"):
        assert shell(f"{COMMAND} {line}").returncode == 0


@pytest.mark.slow
def test_the_shell_completes_names_of_the_catalogue() -> None:
    environment = {
        "_INVERSE_SERVICE_COMPLETE": "complete_bash",
        "COMP_WORDS": "inverse-service catalogue sh",
    }
    code = (
        "import sys; sys.argv[0] = 'inverse-service'; from inverse_service.cli import main; main()"
    )
    run = shell(f'{sys.executable} -c "{code}"', **environment, COMP_CWORD="2")
    assert "sho" in run.stdout.split()


@pytest.mark.slow
def test_a_new_machine_compiles_before_the_clock_starts_and_says_so(tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    first = shell(f"{COMMAND} solve sho --time-limit 2 --format text", INVERSE_SERVICE_CACHE=cache)
    assert first.stderr.startswith("Compiling for this machine, once") or first.stderr == "", (
        "a kernel is stored there"
    )
    assert (first.returncode, "Lagrangian" in first.stdout) == (0, True), first.stdout
    second = shell(f"{COMMAND} solve sho --time-limit 2 --format text", INVERSE_SERVICE_CACHE=cache)
    assert (second.returncode, second.stderr) == (0, "")


@pytest.mark.slow
def test_a_terminal_shows_each_part_of_a_slow_answer_as_it_comes() -> None:
    spawn = f'{sys.executable} -c "import pty, sys; pty.spawn(sys.argv[1:])"'
    run = shell(
        f"{spawn} {COMMAND} solve {Path(__file__).parents[2]}/docs/questions/robot-second.json --format text"
    )
    shown = (
        run.stdout.index("motion: found"),
        run.stdout.index("any associated: variational"),
        run.stdout.index("this motion can be given a Hamiltonian."),
    )
    assert sorted(shown) == list(shown)
