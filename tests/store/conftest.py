"""Both stores: every test with the argument `stores` or `store` runs for each."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from inverse_service.service.jobs.stores import JobStore, SqliteStore
from tests.store.server import Server, programs, server

COUNT = itertools.count()
Stores = Callable[[], JobStore]


@pytest.fixture(scope="session")
def postgres() -> Iterator[Server]:
    if programs() is None:
        pytest.skip("PostgreSQL is not installed here")
    with server() as started:
        yield started


@pytest.fixture(params=["sqlite", "postgres"])
def stores(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Stores]:
    """Open the same store repeatedly; all are closed at the end."""
    opened: list[JobStore] = []
    if request.param == "postgres":
        from inverse_service.service.jobs.postgres_store import PostgresStore

        address = request.getfixturevalue("postgres").database(f"test{next(COUNT)}")

    def open_store() -> JobStore:
        store: JobStore = (
            SqliteStore(tmp_path / "jobs.sqlite")
            if request.param == "sqlite"
            else PostgresStore(address)
        )
        opened.append(store)
        return store

    yield open_store
    for store in opened:
        store.close()


@pytest.fixture
def store(stores: Stores) -> JobStore:
    return stores()
