"""PostgreSQL is killed while it writes, drops its connections, is slow, or does not respond."""

from __future__ import annotations

import contextlib
import itertools
import os
import random
import signal
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.serving import until

pytest.importorskip("psycopg")
from inverse_service.client import Client
from tests.attacks.harness import Attacked, Watch, attacked
from tests.store.server import Server, programs, server

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(programs() is None, reason="PostgreSQL is not installed here"),
]
COUNT = itertools.count()


class Wire:
    """The connection between the service and its database: it can be cut, slow, or silent."""

    def __init__(self, port: int) -> None:
        self._there = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._open: set[socket.socket] = set()
        self.delay = 0.0
        self.passes = threading.Event()
        self.passes.set()
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> int:
        """Reset all connections; return how many there were."""
        found = list(self._open)
        for each in found:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        return len(found)

    def close(self) -> None:
        self.passes.set()
        self._listener.close()
        self.cut()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                here = self._listener.accept()[0]
                try:
                    there = socket.create_connection(("127.0.0.1", self._there))
                except ConnectionRefusedError:
                    here.close()
                    continue
                for pair in ((here, there), (there, here)):
                    threading.Thread(target=self._carry, args=pair, daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        self._open.add(source)
        with contextlib.suppress(OSError):
            while data := source.recv(65_536):
                time.sleep(self.delay)
                self.passes.wait()
                target.sendall(data)
        for each in (source, target):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        self._open.discard(source)
        source.close()


@pytest.fixture(scope="module")
def postgres() -> Iterator[Server]:
    with server(durable=True) as started:
        yield started


@pytest.fixture
def wire(postgres: Server) -> Iterator[Wire]:
    found = Wire(postgres.port)
    yield found
    found.close()


@pytest.fixture
def service(postgres: Server, wire: Wire, tmp_path: Path) -> Iterator[Attacked]:
    name = postgres.database(f"attacked{next(COUNT)}").rpartition("/")[2]
    with attacked(
        tmp_path, database=f"postgresql://postgres@127.0.0.1:{wire.port}/{name}"
    ) as found:
        yield found


def system(k: int) -> dict[str, Any]:
    return {
        "id": k,
        "coordinates": ["x", "y"],
        "equations": {"x": f"-{k + 1}*x-y^3", "y": f"-{k + 2}*y-3*x*y^2"},
    }


def kill(postgres: Server) -> None:
    """Send SIGKILL to the server and all of its processes, and start it again."""
    first = int((postgres.folder / "data" / "postmaster.pid").read_text().split()[0])
    children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
    for pid in (first, *map(int, children)):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        time.sleep(0.01)
    postgres.start()


def answered_through(service: Attacked, lines: int, harm: Any, harms: int) -> None:
    """Assert that every line of a batch gets its verdict once, and that jobs acknowledged during
    the fault are done.
    """
    dice, kept, done = random.Random(harms), list[str](), 0
    with Client(service.address, patience=120) as client, service.client() as other:
        batch = client.submit_batch([system(k) for k in range(lines)])
        while done < harms:
            time.sleep(dice.uniform(0.0, 0.6))
            question = {"coordinates": ["x"], "equations": {"x": f"-x^{len(kept) + 2}"}}
            with contextlib.suppress(httpx.TransportError):
                answer = other.post("/v1/solve", json=question, headers={"Prefer": "respond-async"})
                assert answer.status_code in (200, 202, 503), answer.text
                kept += [answer.headers["location"]] if answer.status_code != 503 else []
            harm()
            done += 1
        answers = list(client.batch_results(batch))
        assert Counter(answer.id for answer in answers) == dict.fromkeys(range(lines), 1)
        assert client.call(f"/v1/batches/{batch.id}").counts == {"successful": lines}
        until(lambda: {other.get(place).json()["status"] for place in kept} == {"successful"})
    print(f"{harms} times, {lines} lines and {len(kept)} jobs: each answered once")


def test_a_server_that_is_killed_while_it_writes_loses_nothing_acknowledged(
    service: Attacked, postgres: Server
) -> None:
    with Watch(service) as watch:
        answered_through(service, 300, lambda: kill(postgres), 50)
    watch.hold()


def test_connections_that_are_cut_lose_nothing(service: Attacked, wire: Wire) -> None:
    cut = []
    with Watch(service) as watch:
        answered_through(service, 300, lambda: cut.append(wire.cut()), 50)
    print(f"{sum(cut)} connections")
    assert sum(cut) > 50
    watch.hold()


def test_a_slow_database_is_slow_and_nothing_else(service: Attacked, wire: Wire) -> None:
    wire.delay = 0.1
    with Watch(service) as watch, service.client() as client:
        answers = [client.post("/v1/solve", json=system(k)) for k in range(3)]
        assert client.get("/readyz").status_code == 200
        assert (
            client.post(
                "/v1/parse", json={"coordinates": ["x"], "equations": {"x": "-x"}}
            ).status_code
            == 200
        )
    assert {answer.status_code for answer in answers} <= {200, 202}
    watch.hold()


def test_a_silent_database_is_said_to_be_silent_and_found_again(
    service: Attacked, wire: Wire
) -> None:
    question = {"coordinates": ["x"], "equations": {"x": "-5*x"}}
    with Watch(service) as watch, service.client() as client:
        wire.passes.clear()
        began = time.monotonic()
        answer = client.post("/v1/solve", json=question)
        assert (answer.status_code, answer.json()["type"]) == (
            503,
            "urn:inverse-service:problem:store-unavailable",
        )
        assert time.monotonic() - began < 30
        assert client.get("/readyz").status_code == 503
        wire.passes.set()
        end = time.monotonic() + 60
        while (
            answer := client.post("/v1/solve", json=question)
        ).status_code != 200 and time.monotonic() < end:
            time.sleep(0.5)
        assert answer.json()["verdict"] == "variational"
        assert client.get("/readyz").status_code == 200
    watch.hold()


def test_the_service_ends_within_five_seconds_of_a_silent_database(
    service: Attacked, wire: Wire
) -> None:
    with service.client() as client:
        client.post("/v1/batches", json=[system(k) for k in range(50)])
    wire.passes.clear()
    time.sleep(1)
    assert service.seconds_to_end() < 5
