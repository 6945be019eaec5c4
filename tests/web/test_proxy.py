"""deploy/nginx.conf in front of a real service: TLS, client addresses, streams, and rejected
requests.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import socket
import ssl
import subprocess
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from tests.attacks.harness import Attacked, Watch, attacked, is_open

NGINX = shutil.which("nginx") or ("/usr/sbin/nginx" if Path("/usr/sbin/nginx").exists() else "")
OPENSSL = shutil.which("openssl")
pytestmark = pytest.mark.skipif(not (NGINX and OPENSSL), reason="needs nginx and openssl")
NAME = "lagrangians.example"
CONFIGURATION = Path(__file__).parents[2] / "deploy" / "nginx.conf"
EASY = {"coordinates": ["x"], "equations": {"x": "-x"}}


@dataclass(frozen=True)
class Proxied:
    """The service, and the address of its proxy."""

    service: Attacked
    port: int

    def client(self, source: str = "127.0.0.1") -> httpx.Client:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        transport = httpx.HTTPTransport(verify=context, local_address=source)
        address = f"https://127.0.0.1:{self.port}"
        return httpx.Client(
            base_url=address, headers={"Host": NAME}, transport=transport, timeout=30
        )


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def configured(folder: Path, service: int, plain: int, secure: int) -> Path:
    """The file of deploy/ with other ports and paths, within a complete nginx configuration."""
    text = CONFIGURATION.read_text()
    for before, after in (
        ("127.0.0.1:8000", f"127.0.0.1:{service}"),
        ("listen 80;", f"listen 127.0.0.1:{plain};"),
        ("listen 443 ssl", f"listen 127.0.0.1:{secure} ssl"),
        ("/etc/ssl/lagrangians.example/", f"{folder}/"),
    ):
        assert before in text
        text = text.replace(before, after)
    places = "".join(
        f"{name}_temp_path {folder}/{name};\n"
        for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    around = f"daemon off;\nmaster_process off;\npid {folder}/pid;\nerror_log {folder}/error.log;\nevents {{}}\n"
    found = folder / "nginx.conf"
    found.write_text(f"{around}http {{\naccess_log off;\n{places}{text}\n}}\n")
    return found


@pytest.fixture(scope="module")
def proxied(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Proxied]:
    folder = tmp_path_factory.mktemp("proxy")
    command = [
        str(OPENSSL),
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-days",
        "1",
        "-subj",
        f"/CN={NAME}",
    ]
    keys = ["-keyout", str(folder / "privkey.pem"), "-out", str(folder / "fullchain.pem")]
    subprocess.run([*command, *keys], check=True, capture_output=True)
    with attacked(folder, proxies="127.0.0.1", hosts=f"{NAME}, 127.0.0.1") as service:
        port = free_port()
        file = configured(folder, service.port, free_port(), port)
        with subprocess.Popen(
            [NGINX, "-p", str(folder), "-c", str(file)], stderr=subprocess.DEVNULL
        ) as proxy:
            found = Proxied(service, port)
            end = time.monotonic() + 20
            while time.monotonic() < end:
                with socket.socket() as connection:
                    if connection.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.05)
            yield found
            proxy.terminate()


@pytest.mark.slow
def test_a_question_is_answered_through_the_proxy(proxied: Proxied) -> None:
    with proxied.client() as client:
        answer = client.post("/v1/solve", json=EASY, headers={"Prefer": "wait=20"})
        assert answer.json()["verdict"] == "variational"
        page = client.get(answer.headers["location"].replace("/v1/jobs", "/results"))
        assert f"https://{NAME}/v1/solve" in page.text
        batch = client.post("/v1/batches", json=[EASY | {"id": k} for k in range(3)]).headers[
            "location"
        ]
        with client.stream("GET", batch + "/results") as stream:
            assert len([line for line in stream.iter_lines() if line]) == 3


@pytest.mark.slow
def test_the_service_identifies_clients_and_none_can_impersonate_another(proxied: Proxied) -> None:
    with proxied.client("127.0.0.7") as client:
        sent = {"X-Forwarded-For": "8.8.8.8", "X-Request-Id": "made-up"}
        answer = client.get("/v1/limits", headers=sent)
    id = answer.headers["x-request-id"]
    assert id == "made-up", "the client's own id, which is in the log lines"
    end, found = time.monotonic() + 30, list[str]()
    while not found and time.monotonic() < end:  # the line is written after the response
        lines = [json.loads(line) for line in proxied.service.log.read_text().splitlines()]
        found = [line["client"] for line in lines if line.get("request") == id]
        time.sleep(0.05)
    assert found == ["127.0.0.7"]


@pytest.mark.slow
def test_the_proxy_rejects_large_bodies_and_many_requests(proxied: Proxied) -> None:
    with proxied.client("127.0.0.8") as client:
        assert client.get("/metrics").status_code == 403
        large = client.post(
            "/v1/batches",
            content=b" " * (16 * 2**20 + 1),
            headers={"Content-Type": "application/json"},
        )
        assert large.status_code == 413
        statuses = [client.get("/livez").status_code for _ in range(300)]
        assert set(statuses) <= {200, 429}


@pytest.mark.nightly
def test_plain_http_and_old_or_broken_tls_are_refused(proxied: Proxied) -> None:
    with socket.create_connection(("127.0.0.1", proxied.port), timeout=30) as plain:
        plain.sendall(f"GET / HTTP/1.1\r\nHost: {NAME}\r\n\r\n".encode())
        assert b" 400 " in plain.recv(65_536).partition(b"\r\n")[0]
    with socket.create_connection(("127.0.0.1", proxied.port), timeout=30) as broken:
        broken.sendall(b"\x16\x03\x01\x02\x00\x01" + bytes(range(200)) * 3)
        assert b"HTTP" not in broken.recv(65_536)
    old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
    old.set_ciphers("ALL:@SECLEVEL=0")
    with (
        socket.create_connection(("127.0.0.1", proxied.port), timeout=30) as connection,
        pytest.raises(ssl.SSLError),
    ):
        old.wrap_socket(connection)
    with proxied.client() as client:
        assert client.get("/livez").status_code == 200


@pytest.mark.nightly
def test_endless_handshakes_are_cut_and_delay_no_other_client(proxied: Proxied) -> None:
    began, seconds = time.monotonic(), list[float]()
    hello = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"
    waiting = [socket.create_connection(("127.0.0.1", proxied.port)) for _ in range(200)]
    for k, connection in enumerate(waiting):
        connection.sendall(hello[: k % 12])
    dripping, answered = waiting.pop(), 0
    while waiting and time.monotonic() - began < 60:
        with contextlib.suppress(OSError):
            dripping.send(b"\x00")
        looked = time.monotonic()
        with proxied.client("127.0.0.9") as client:
            assert client.get("/livez").status_code == 200
        seconds.append(time.monotonic() - looked)
        waiting = [connection for connection in waiting if is_open(connection)]
        answered += bool(waiting)
        time.sleep(0.5)
    print(
        f"closed after {time.monotonic() - began:.0f} s; /livez with a handshake at the longest {max(seconds):.2f} s"
    )
    assert not waiting
    assert answered, "the other client was not answered before the handshakes were cut"
    assert not is_open(dripping), "a handshake of one byte at a time continues"


@pytest.mark.nightly
def test_two_hundred_handshakes_leave_the_service_alone(proxied: Proxied) -> None:
    statuses = []
    with Watch(proxied.service) as watch:
        for k in range(200):
            with proxied.client(f"127.0.1.{k % 40 + 1}") as client:
                statuses.append(client.get("/livez").status_code)
    assert set(statuses) == {200}
    watch.hold()
