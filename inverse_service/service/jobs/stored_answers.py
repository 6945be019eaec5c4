"""What a worker process reads of the store by itself, so that large answers do not pass through the service."""

from __future__ import annotations

import contextlib
import importlib
from typing import Any

from inverse_service.service.jobs.sqlite_schema import connect

POSTGRES = ("postgresql://", "postgres://")
QUERY = "SELECT jobs.document, bodies.body FROM jobs JOIN bodies ON bodies.id = jobs.id WHERE jobs.id = {}"


def stored_answer(address: str, id: str) -> tuple[str, bytes]:
    """The document of a job and the body of its answer. KeyError: there is none any more."""
    row = _postgres_row(address, id) if address.startswith(POSTGRES) else _sqlite_row(address, id)
    if row is None:
        raise KeyError(id)
    return row[0], bytes(row[1])


def _sqlite_row(path: str, id: str) -> Any:
    with contextlib.closing(connect(path, read_only=True)) as connection:
        return connection.execute(QUERY.format("?"), (id,)).fetchone()


def _postgres_row(address: str, id: str) -> Any:
    module = importlib.import_module("inverse_service.service.jobs.postgres_connections")
    with contextlib.closing(module.connect(address)) as connection:
        row = connection.execute(QUERY.format("%s"), (id,)).fetchone()
    return None if row is None else (row["document"], row["body"])
