"""deploy/backup.py copies a store under load; a client is erased completely."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

from inverse_service.service.jobs.model import BatchLine, JobRequest
from inverse_service.service.jobs.stores import SqliteStore
from inverse_service.service.jobs.tasks import Usage

DEPLOY = Path(__file__).parents[2] / "deploy"


def run(program: str, *arguments: object) -> str:
    command = [sys.executable, str(DEPLOY / program), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def asked(store: SqliteStore, id: str, client: str = "") -> None:
    store.submit([JobRequest(id, "solve", f'{{"secret of": "{client}"}}', client=client)])
    for job in store.claim("o", 9):
        store.finish(job.id, job.attempt, b'{"verdict": "variational"}', Usage())


def test_a_copy_that_is_made_while_jobs_are_stored_has_all_that_was_acknowledged_before(
    tmp_path: Path,
) -> None:
    store, stopping = SqliteStore(tmp_path / "jobs.sqlite"), threading.Event()
    for k in range(20):
        asked(store, f"before {k}")

    def go_on() -> None:
        for k in range(10_000):
            if stopping.is_set():
                return
            asked(store, f"during {k}")

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        assert run("backup.py", tmp_path / "jobs.sqlite", tmp_path / "copy.sqlite") == "ok\n"
    finally:
        stopping.set()
        thread.join()
        store.close()
    assert (tmp_path / "copy.sqlite").stat().st_mode & 0o777 == 0o600
    restored = SqliteStore(tmp_path / "copy.sqlite")
    try:
        assert {(restored.job(f"before {k}") or store).status for k in range(20)} == {"successful"}  # type: ignore[union-attr]
        restored.recover()
        asked(restored, "after")
    finally:
        restored.close()


def test_nothing_of_an_erased_client_is_left_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite"
    store = SqliteStore(path)
    for client in ("alice", "bob"):
        line = BatchLine(
            1,
            f'"line of {client}"',
            JobRequest(f"in batch of {client}", "solve", "{}", client=client),
        )
        store.create_batch(f"batch of {client}", "solve", client, [line])
        asked(store, f"of {client}", client)
    store.erase_client("alice")
    store.close()
    assert b"alice" not in b"".join(file.read_bytes() for file in tmp_path.iterdir())
    store = SqliteStore(path)
    assert (store.job("of alice"), store.batch("batch of alice")) == (None, None)
    assert [answer.identifier for answer in store.batch_answers("batch of bob")] == [
        '"line of bob"'
    ]
    store.close()
