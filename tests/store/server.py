"""A PostgreSQL server for the tests: a new cluster in a temporary folder, on loopback, without a
password.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psycopg
import psycopg.sql

FOLDERS = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)


def programs() -> Path | None:
    """The folder of initdb and pg_ctl, or None if there is no server to start (or only root could
    start it).
    """
    on_path = shutil.which("initdb")
    found = (
        Path(on_path).resolve().parent
        if on_path
        else next((f for f in FOLDERS if (f / "initdb").exists()), None)
    )
    if os.name != "posix" or (os.geteuid() == 0 and shutil.which("runuser") is None):
        return None
    return found


@dataclass(frozen=True)
class Server:
    """A running server that can be killed and restarted."""

    programs: Path
    folder: Path
    port: int
    durable: bool

    @property
    def address(self) -> str:
        return f"postgresql://postgres@127.0.0.1:{self.port}/postgres"

    def start(self) -> None:
        options = (
            f"-p {self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={self.folder}"
        )
        if not self.durable:
            options += " -c fsync=off -c full_page_writes=off"
        run(
            self.programs / "pg_ctl",
            "-D",
            self.folder / "data",
            "-w",
            "-o",
            options,
            "-l",
            self.folder / "log",
            "start",
        )

    def stop(self, mode: str = "fast") -> None:
        run(self.programs / "pg_ctl", "-D", self.folder / "data", "-w", "-m", mode, "stop")

    def database(self, name: str) -> str:
        """The address of a new database."""
        with psycopg.connect(self.address, autocommit=True) as connection:
            connection.execute(
                psycopg.sql.SQL("CREATE DATABASE {}").format(psycopg.sql.Identifier(name))
            )
        return f"postgresql://postgres@127.0.0.1:{self.port}/{name}"


def run(*command: object) -> None:
    """Run as the user postgres if we are root, because the server rejects root."""
    words = [str(word) for word in command]
    if os.geteuid() == 0:
        words = ["runuser", "-u", "postgres", "--", *words]
    subprocess.run(
        words, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, timeout=60, cwd="/"
    )


@contextmanager
def server(durable: bool = False) -> Iterator[Server]:
    """A new server, removed completely at the end; the tests kill processes, not machines."""
    found = programs()
    assert found is not None
    folder = Path(tempfile.mkdtemp(prefix="inverse-service-postgres-"))
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    started = Server(found, folder, port, durable)
    try:
        run(
            found / "initdb",
            "-D",
            folder / "data",
            "-U",
            "postgres",
            "-A",
            "trust",
            "-E",
            "UTF8",
            "--locale=C",
            "--no-sync",
        )
        started.start()
        yield started
        started.stop("immediate")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
