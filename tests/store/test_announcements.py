"""Front ends over one PostgreSQL database hear what the others change."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import psycopg
import pytest

from inverse_service.service.jobs.announcements import MOST
from inverse_service.service.jobs.model import Change
from inverse_service.service.jobs.postgres_store import PostgresStore
from inverse_service.service.jobs.tasks import Usage
from tests.serving import until
from tests.store.server import Server
from tests.store.test_job_store import request

COUNT = itertools.count()
Heard = list[Change]


@pytest.fixture
def two(postgres: Server) -> Iterator[tuple[PostgresStore, PostgresStore, Heard]]:
    """Two stores of one database, and what the second one hears."""
    address = postgres.database(f"announced{next(COUNT)}")
    first, second, heard = PostgresStore(address), PostgresStore(address), Heard()
    for store in (first, second):
        store.listen()
    until(lambda: first.hears_others and second.hears_others)
    second.on_change(heard.append)
    yield first, second, heard
    first.close()
    second.close()


def test_a_front_end_hears_of_others_what_it_would_tell_itself(
    two: tuple[PostgresStore, PostgresStore, Heard],
) -> None:
    first, second, heard = two
    own = Heard()
    first.on_change(own.append)
    (job,) = first.submit([request("a")])
    until(lambda: Change("", "accepted") in heard)
    (claimed,) = second.claim("second", 1)
    until(lambda: Change("a", "running") in own)
    second.finish(job.id, claimed.attempt, b"{}", Usage())
    until(lambda: Change("a", "successful") in own)
    # Once each: the second is not told again by the database what it did itself.
    first.submit([request("b")])
    until(lambda: heard.count(Change("", "accepted")) == 2)
    assert [change.what for change in heard] == ["accepted", "running", "successful", "accepted"]


def test_many_changes_of_a_moment_take_few_notifications_and_all_are_heard(
    two: tuple[PostgresStore, PostgresStore, Heard],
) -> None:
    first, _, heard = two
    ids = [f"{number:040}" for number in range(2 * MOST + 1)]
    first.tell([Change(id, "successful") for id in ids])
    until(lambda: len(heard) == len(ids))
    assert [change.id for change in heard] == ids


def test_who_lost_the_server_hears_again_and_a_closed_store_has_told_all(
    two: tuple[PostgresStore, PostgresStore, Heard], postgres: Server
) -> None:
    first, second, heard = two
    with psycopg.connect(first.address, autocommit=True) as connection:
        kill = (
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
            " WHERE query = 'LISTEN inverse_service' AND datname = current_database()"
        )
        assert len(connection.execute(kill).fetchall()) >= 2
    until(lambda: not second.hears_others)
    until(lambda: second.hears_others)
    first.submit([request("c")])
    first.close()
    until(lambda: Change("", "accepted") in heard)
