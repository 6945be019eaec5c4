"""A temporary store is removed after its process ends, at the latest when the next one starts."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from inverse_service.service.jobs.locks import (
    DATABASE,
    HOLDER,
    PREFIX,
    YOUNG,
    remove_abandoned,
    temporary_folder,
)
from inverse_service.service.jobs.stores import Durability, SqliteStore

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs flock")
HOLD = """
import sys
from inverse_service.service.jobs.stores import Durability, SqliteStore
from inverse_service.service.jobs.locks import DATABASE, temporary_folder
with temporary_folder() as folder:
    store = SqliteStore(folder / DATABASE, Durability.LATER)
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A temporary folder for the test and the processes it starts."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def aged(path: Path) -> Path:
    os.utime(path, (path.stat().st_atime, path.stat().st_mtime - 2 * YOUNG))
    return path


def left(folder: Path) -> set[Path]:
    return set(folder.iterdir())


def test_the_folder_is_gone_at_the_end(folder: Path) -> None:
    with temporary_folder() as used:
        SqliteStore(used / DATABASE, Durability.LATER).close()
        assert (used / DATABASE).exists()
    assert left(folder) == set()


@pytest.mark.slow
def test_what_a_killed_process_left_is_removed_at_the_next_start_and_what_is_in_use_is_not(
    folder: Path,
) -> None:
    command = [sys.executable, "-c", HOLD]
    with (
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as killed,
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as living,
    ):
        assert killed.stdout is not None
        assert living.stdout is not None
        first, second = (
            aged(Path(process.stdout.readline().strip())) for process in (killed, living)
        )  # type: ignore[union-attr]
        killed.kill()
        killed.wait()
        with temporary_folder() as used:
            assert left(folder) == {second, used}
        assert not first.exists()
        assert living.stdin is not None
        living.stdin.close()
    assert left(folder) == set()


def test_only_old_folders_that_hold_a_store_and_nothing_else_are_removed(folder: Path) -> None:
    young, empty, other, linked = (
        folder / f"inverse-service-{name}" for name in ("young", "empty", "other", "linked")
    )
    target = folder / "target"
    for path in (young, empty, other, target):
        path.mkdir()
    for path in (young, other, target):
        SqliteStore(path / "jobs.sqlite").close()
    (other / "thesis.tex").write_text("years of work")
    linked.symlink_to(target)
    before = left(folder)
    for path in (empty, other, target):
        aged(path)
    with temporary_folder():
        pass
    assert left(folder) == before


def test_a_new_folder_is_left_until_its_process_has_locked_it(folder: Path) -> None:
    """Between the making of a folder and its lock nobody holds it."""
    made = Path(tempfile.mkdtemp(prefix=PREFIX))
    (made / f"{HOLDER}.lock").touch()
    remove_abandoned()
    assert left(folder) == {made}
    aged(made)
    remove_abandoned()
    assert left(folder) == set()
