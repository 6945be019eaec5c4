"""A store of version 0.1.0 is migrated completely; one of a newer version is left unchanged."""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path

import psycopg
import pytest

from inverse_service.errors import InputError
from inverse_service.service.jobs import stores
from inverse_service.service.jobs.model import BatchLine, JobRequest, WrongVersion
from inverse_service.service.jobs.opening import open_store
from inverse_service.service.jobs.statements import VERSION
from inverse_service.service.jobs.stores import JobStore, SqliteStore
from inverse_service.service.jobs.tasks import Usage
from tests.values import present

OLD = Path(__file__).parent / "version_1"
COUNT = itertools.count()


@pytest.fixture(params=["sqlite", "postgres"])
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[[], JobStore]]:
    """Open a database of 0.1.0 with a running job, waiting jobs, and a half-finished batch."""
    opened: list[JobStore] = []
    script = (OLD / f"{request.param}.sql").read_text()
    if request.param == "sqlite":
        with sqlite3.connect(tmp_path / "jobs.sqlite") as connection:
            connection.executescript(script)
        connection.close()
    else:
        address = request.getfixturevalue("postgres").database(f"old{next(COUNT)}")
        with psycopg.connect(address, autocommit=True) as server:
            server.execute(script.encode())

    def open_old() -> JobStore:
        opened.append(
            open_store(str(tmp_path / "jobs.sqlite") if request.param == "sqlite" else address)
        )
        return opened[-1]

    yield open_old
    for store in opened:
        store.close()


@pytest.mark.slow
def test_everything_of_0_1_0_is_kept_and_continues(old: Callable[[], JobStore]) -> None:
    store = old()
    assert dict(store.counts()) == {
        "successful": 1,
        "failed": 1,
        "dismissed": 2,
        "running": 1,
        "accepted": 2,
    }
    answered = present(store.job("answered"))
    assert (answered.body, answered.client, answered.expires) == (
        b'{"verdict": "variational"}',
        "alice",
        None,
    )
    assert [event.number for event in store.events("answered")] == [1]
    batch = present(store.batch("batch"))
    assert batch.counts == {"successful": 1, "accepted": 1, "dismissed": 1, "failed": 1}
    assert sorted((a.number, a.status) for a in store.batch_answers("batch")) == [
        (1, "successful"), (3, "dismissed"), (4, "failed"),
    ]  # fmt: skip
    assert [job.id for job in store.recover(0.0)] == ["running"]
    assert not store.dismiss("waiting", "alice")[1], "bob, who asked in 0.1.0, still waits"
    for job in store.claim("o", 9):
        assert store.finish(job.id, job.attempt, b"{}", Usage())
    assert {a.number for a in store.batch_answers("batch")} == {1, 2, 3, 4}
    store.create_batch("new", "solve", "", [BatchLine(1, "1", JobRequest("x", "solve", "{}"))])
    assert store.dismiss_batch("new") == ["x"]


@pytest.mark.slow
def test_a_second_opening_changes_nothing(old: Callable[[], JobStore]) -> None:
    first = old()
    before = (dict(first.counts()), first.jobs())
    first.close()
    second = old()
    assert (dict(second.counts()), second.jobs()) == before


def test_a_newer_database_says_so_and_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite"
    SqliteStore(path).close()
    with sqlite3.connect(path) as connection:
        connection.execute(f"PRAGMA user_version = {VERSION + 1}")
    connection.close()
    before = path.read_bytes()
    with pytest.raises(WrongVersion):
        SqliteStore(path)
    with pytest.raises(InputError, match="a newer version of"):
        open_store(str(path))
    assert path.read_bytes() == before


def test_a_database_that_cannot_be_written_is_not_called_one_of_another_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(path: str) -> sqlite3.Connection:
        """Root can write everything, so permissions alone would test nothing."""
        return sqlite3.connect(f"file:{path}?mode=ro", uri=True, isolation_level=None)

    path = tmp_path / "jobs.sqlite"
    monkeypatch.setattr(stores, "connect", read_only)
    with pytest.raises(InputError, match=r"writable .attempt to write a readonly"):
        open_store(str(path))


@pytest.mark.parametrize("script", ["CREATE TABLE mine (x)", "PRAGMA user_version = 1"])
def test_a_database_of_another_program_is_left_as_it_is(tmp_path: Path, script: str) -> None:
    path = tmp_path / "jobs.sqlite"
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(script)
    connection.close()
    with pytest.raises(InputError, match="not a database of this"):
        open_store(str(path))
    with sqlite3.connect(path) as connection:
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_schema")}
    connection.close()
    assert tables <= {"mine"}
