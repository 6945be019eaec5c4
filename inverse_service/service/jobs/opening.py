"""Which store and which cluster the settings ask for; answers for worker processes."""

import atexit
import contextlib
import importlib
import logging
import os
import sqlite3
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.service.jobs import locks, model, statements, stores, workers

log = logging.getLogger(__name__)
POSTGRES = ("postgresql://", "postgres://")
POSTGRES_MODULE = "inverse_service.service.jobs.postgres_store"
SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")


def open_store(database: str | None) -> stores.JobStore:
    """The store at a path or an address; raises InputError where it cannot be used.

    None is the file of this user. Where another service has that one, or it cannot be written, the
    jobs go to a new file in the temporary folder, and the log says so.
    """
    return _default_store() if database is None else _opened(database, _store_at)


def open_as_guest(database: str | None) -> stores.JobStore:
    """The store of a service that may run; see `SqliteStore`. InputError where there is none."""
    return _opened(database or str(default_path()), _store_of_another)


def _store_of_another(path: Path) -> stores.JobStore:
    if not path.is_file():
        raise errors.InputError(
            f"There is no database {path}; INVERSE_SERVICE_DATABASE names the service's."
        )
    return stores.SqliteStore(path, guest=True)


def _opened(database: str, open_file: Callable[[Path], stores.JobStore]) -> stores.JobStore:
    if database.startswith(POSTGRES):
        return _postgres_store(database)
    try:
        return open_file(Path(database))
    except model.DatabaseTaken as error:
        raise errors.InputError(error.detail) from None
    except (OSError, sqlite3.Error, model.WrongVersion) as error:
        detail = (
            f"The file INVERSE_SERVICE_DATABASE cannot be used as a database: {_reason(error)}."
        )
        raise errors.InputError(detail) from None


def default_path() -> Path:
    """jobs.sqlite in the state folder of this user."""
    base = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    return Path(base) / "inverse-service" / locks.DATABASE


def _default_store() -> stores.JobStore:
    path = default_path()
    with contextlib.suppress(OSError, sqlite3.Error, model.DatabaseTaken, model.WrongVersion):
        return _store_at(path)
    kept = contextlib.ExitStack()
    atexit.register(kept.close)
    log.warning(
        "the database of this user cannot be used now (another service has it, or it cannot be written): jobs are "
        "kept in the temporary folder and forgotten at the end"
    )
    return _store_at(kept.enter_context(locks.temporary_folder()) / locks.DATABASE)


def _postgres_store(address: str) -> stores.JobStore:
    try:
        module = importlib.import_module(POSTGRES_MODULE)
    except ImportError:
        detail = "A PostgreSQL database needs the extra: pip install 'inverse-service[postgres]'."
        raise errors.InputError(detail) from None
    store: stores.JobStore = module.PostgresStore(address)
    return store


def _store_at(path: Path) -> stores.SqliteStore:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    # Documents of clients are in it; SQLite gives its other files the same rights.
    os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600))
    for each in (path, *(path.with_name(path.name + end) for end in ("-wal", "-shm"))):
        with contextlib.suppress(OSError):
            each.chmod(0o600)
    return stores.SqliteStore(path)


def _reason(error: Exception) -> str:
    if isinstance(error, model.WrongVersion | stores.Damaged):
        return str(error)
    match getattr(error, "sqlite_errorcode", 0) & 0xFF:  # extended codes have more above
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_CANTOPEN:
            return f"it and its folder have to be writable ({error})"
        case sqlite3.SQLITE_IOERR | sqlite3.SQLITE_FULL | sqlite3.SQLITE_BUSY:
            return str(error)
    return getattr(error, "strerror", None) or "it is not a database of this program"


class StoredAnswer(NamedTuple):
    """A document as it was stored, and the body of its answer."""

    document: str
    body: bytes


def stored_answer(address: str, id: str) -> StoredAnswer:
    """The document of a job and the body of its answer. KeyError: there is none any more.

    For worker processes, so that large answers do not pass through the service.
    """
    is_postgres = address.startswith(POSTGRES)
    module: Any = importlib.import_module(POSTGRES_MODULE) if is_postgres else stores
    dialect = statements.POSTGRES if is_postgres else statements.SQLITE
    with contextlib.closing(module.connect(address)) as connection:
        row = statements.Session(connection, [], dialect).first("stored_answer", id)
    if row is None:
        raise KeyError(id)
    return StoredAnswer(row["document"], bytes(row["body"]))


def executor(cluster: str | None, count: int, memory_limit: int) -> workers.Executor:
    """A pool of so many processes, or a cluster at an address, which connects when it is started;
    MiB a process.

    Raises InputError: the address is none, or the extra `dask` is not installed.
    """
    if cluster is None:
        return workers.Workers(count, memory_limit)
    if not cluster.startswith(SCHEMES):
        raise errors.InputError(
            "The address of a cluster must be that of a Dask scheduler, such as tcp://host:8786."
        )
    if find_spec("distributed") is None:
        raise errors.InputError("A cluster needs the extra: pip install 'inverse-service[dask]'.")
    from inverse_service.service.jobs.cluster import Cluster

    return Cluster(cluster, memory_limit)
