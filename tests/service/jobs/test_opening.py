"""The database that a service opens, and the message if it cannot open one."""

from __future__ import annotations

import contextlib
import sqlite3
from pathlib import Path

import pytest

from inverse_service.errors import InputError
from inverse_service.service.jobs.model import JobRequest
from inverse_service.service.jobs.opening import default_path, open_store
from inverse_service.service.jobs.stores import SqliteStore
from tests.logs import Logged


def test_a_path_is_made_with_its_folders(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "jobs.sqlite"
    open_store(str(path)).close()
    assert path.exists()


def test_a_named_database_in_use_is_refused_with_a_sentence(tmp_path: Path) -> None:
    store = open_store(str(tmp_path / "jobs.sqlite"))
    with pytest.raises(InputError, match="INVERSE_SERVICE_DATABASE"):
        open_store(str(tmp_path / "jobs.sqlite"))
    store.close()


@pytest.mark.parametrize(
    "content", [b"my thesis, which is long enough to be no database at all" * 20, None]
)
def test_a_file_that_is_not_a_database_is_rejected_and_unchanged(
    tmp_path: Path, content: bytes | None
) -> None:
    path = tmp_path / "thesis"
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match="cannot be used as"):
        open_store(str(path))
    assert path.is_dir() if content is None else path.read_bytes() == content


def test_without_a_name_it_is_the_file_of_the_user_or_else_a_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, logged: Logged
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    first = open_store(None)
    assert default_path().is_file()
    assert default_path().is_relative_to(tmp_path)
    second = open_store(None)
    assert "temporary folder" in logged.text
    second.close()
    first.close()


def test_a_damaged_database_is_refused_at_the_start_with_what_to_do(tmp_path: Path) -> None:
    lacking, flipped = tmp_path / "lacking.sqlite", tmp_path / "flipped.sqlite"
    for path in (lacking, flipped):
        store = SqliteStore(path)
        store.submit([JobRequest(f"{k}", "solve", "x" * 1000) for k in range(200)])
        store.close()
    with contextlib.closing(sqlite3.connect(lacking)) as connection:
        connection.execute("ALTER TABLE jobs DROP COLUMN wall")
    data = bytearray(flipped.read_bytes())
    for place in range(4096 * 4, len(data), 3 * 4096):
        data[place : place + 4096] = bytes(4096)
    flipped.write_bytes(data)
    with pytest.raises(InputError, match="it lacks jobs wall"):
        open_store(str(lacking))
    with pytest.raises(InputError, match="it is damaged; put"):
        open_store(str(flipped))
