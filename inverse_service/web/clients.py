"""Who asks, and how much of the service a client may have: bytes under way, places among those who wait, connections.

A client is the name of an API key, of the settings or of a file, or the address where no keys are asked for.
Connections have two counts (in all, and of one address) and two times (for a head, for a body). What a proxy does
better, which is to take slow heads, bodies in tiny pieces, and unread answers, is left to the proxy that a port for
strangers needs; see docs/how-to/operate.md.
"""

from __future__ import annotations

import asyncio
import datetime
import functools
import hmac
import ipaddress
import logging
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import httptools
from starlette.requests import Request
from starlette.responses import Response
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from inverse_service import errors
from inverse_service.service.jobs.model import Viewer
from inverse_service.settings import Settings, hash_of_key, read_key
from inverse_service.web import middleware
from inverse_service.web.problems import Refusal

log = logging.getLogger(__name__)
LARGEST_KEY = 200
LARGEST_FILE = 1_000_000
PLACE = "The file INVERSE_SERVICE_API_KEYS_FILE"
# Holds the key after a person logged in on the page; scripts cannot read it, and other sites never send it.
COOKIE = "inverse-service-key"
OWN_PAGES = ("same-origin", "none")
QUICK_PROCESSES = 3
# Of one client so many run at the same time, and one is always left for the others.
QUICK_SHARE = QUICK_PROCESSES - 1
# Answers next to forms that are computed at the same time.
GLANCES = QUICK_PROCESSES - 1
# The first request line and its headers have so long; the next ones as long as a silent connection is kept; s.
HEADERS, KEEP_ALIVE = 10.0, 30.0
# A body may come this slowly after its first seconds.
BODY_GRACE, BYTES_A_SECOND = 15.0, 10_000
LOOK_EVERY = 1.0
# What comes is parsed in pieces: that in which a head begins may have the end of a body before it, and is not counted.
PIECE = 8192
# So long what comes after a refused head is dropped before the connection is closed, s.
LINGER = 2.0
# What says how long a body is.
LENGTHS = (b"content-length", b"transfer-encoding")


@dataclass(frozen=True, slots=True)
class Key:
    """SHA-256 of a key, the client who has it, and the last day on which it counts (UTC)."""

    client: str
    digest: str
    last_day: datetime.date | None = None

    def counts(self) -> bool:
        """Whether it has not expired."""
        return self.last_day is None or datetime.datetime.now(datetime.UTC).date() <= self.last_day


class Keys:
    """The keys of the clients. Raises InputError at the start if the file cannot be used."""

    def __init__(self, settings: Settings) -> None:
        self._fixed = tuple(Key(client, digest) for client, digest in settings.api_keys)
        self._file = None if settings.api_keys_file is None else Path(settings.api_keys_file)
        self._mark = self._marked()
        self._keys = self._fixed + self._of_file()

    @property
    def are_asked(self) -> bool:
        """Whether clients need a key. They do even while the file is empty; then no one has access."""
        return bool(self._fixed) or self._file is not None

    def client_of(self, key: str) -> str | None:
        """The client whose key this is, or None; takes equally long for wrong and for valid keys."""
        self._look()
        digest = hash_of_key(key[:LARGEST_KEY])
        found = [each for each in self._keys if hmac.compare_digest(digest, each.digest)]
        return found[0].client if found and key and found[0].counts() else None

    def _look(self) -> None:
        """Read the file again if it changed; if it is unreadable, keep the present keys and log a warning."""
        if (mark := self._marked()) == self._mark:
            return
        self._mark = mark
        try:
            self._keys = self._fixed + self._of_file()
            log.info("keys read again", extra={"keys": len(self._keys)})
        except errors.InputError as error:
            log.error("the keys stay as they were: %s", error.detail)

    def _marked(self) -> tuple[int, int, int] | None:
        """A mark that changes with the file."""
        try:
            found = os.stat(self._file or "")
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino

    def _of_file(self) -> tuple[Key, ...]:
        if self._file is None:
            return ()
        try:
            with self._file.open("rb") as stream:
                lines = stream.read(LARGEST_FILE).decode().splitlines()
        except (OSError, ValueError) as error:
            detail = f"{PLACE} cannot be read: {getattr(error, 'strerror', None) or 'not UTF-8'}."
            raise errors.InputError(detail) from None
        return tuple(_key(number, line) for number, line in enumerate(lines, 1) if line.partition("#")[0].strip())


def _key(number: int, line: str) -> Key:
    """`name:HASH`, and the last day after it, as 2030-12-31, where the key expires."""
    text, _, day = line.partition("#")[0].strip().partition(" ")
    try:
        client, digest = read_key(text)
        return Key(client, digest, datetime.date.fromisoformat(day.strip()) if day.strip() else None)
    except (ValueError, errors.InputError):
        detail = f"{PLACE} is wrong in line {number}; a line is 'alice:HASH' or 'alice:HASH 2030-12-31'."
        raise errors.InputError(detail) from None


async def require_client(request: Request) -> None:
    """A dependency of every call under /v1, `note_client`: on the loop, as the framework runs plain ones in threads."""
    note_client(request)


def note_client(request: Request) -> None:
    """Note the client; 401 without a valid key if keys are set."""
    keys = request.app.state.engine.keys
    name = _client(request, keys)
    request.scope["state"] |= {"client_name": name, "viewer": Viewer(name, not keys.are_asked)}


def viewer_of(request: Request) -> Viewer:
    """Who asks, as `note_client` found: all that is read, listed and cancelled is checked against it."""
    viewer: Viewer = request.scope["state"]["viewer"]
    return viewer


def client_of(request: Request) -> str:
    """The client that `note_client` found, or the address if no key was required."""
    name: str = request.scope["state"].get("client_name") or address_of(request)
    return name


def address_of(request: Request) -> str:
    """The address that the request comes from."""
    return place_of(request.client.host) if request.client else ""


@functools.lru_cache(maxsize=4096)
def place_of(address: str) -> str:
    """An IPv4 address, or the network /64 of an IPv6 address: all of it is one host's, who may take any in it."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    return str(ipaddress.ip_network((found, 64), strict=False))


def cookie_of_key(key: str) -> str:
    """A key as the value of a cookie, which takes no spaces, commas or umlauts."""
    return quote(key, safe="")


def is_of_own_page(request: Request) -> bool:
    """Whether a page of ours sends it, or no browser. Older ones, and all without TLS, tell the page's origin only."""
    site, origin = (middleware.said(request.scope, name) for name in (b"sec-fetch-site", b"origin"))
    if site or not origin:
        return not site or site in OWN_PAGES
    return middleware.name_of(origin.rpartition("//")[2]) == middleware.host_of(request.scope)


def key_of_cookie(request: Request) -> str:
    """The key that a page of ours put into the cookie; nothing where another site sends the request."""
    is_taken = request.method in ("GET", "HEAD") or is_of_own_page(request)
    return unquote(request.cookies.get(COOKIE, "")) if is_taken else ""


def _client(request: Request, keys: Keys) -> str:
    if not keys.are_asked:
        return address_of(request)
    scheme, _, token = middleware.said(request.scope, b"authorization").partition(" ")
    key = token.strip() if scheme.lower() == "bearer" else middleware.said(request.scope, b"x-api-key")
    name = keys.client_of(key or key_of_cookie(request))
    if name is None:
        detail = "This service asks for a key: send 'Authorization: Bearer KEY' or 'X-API-Key: KEY'; people use /login."
        raise Refusal(401, "key", detail, headers={"WWW-Authenticate": 'Bearer realm="inverse-service"'})
    return name


@dataclass(slots=True)
class Shares:
    """What clients hold of something: at most `total` in all, and `of_a_client` of one; used on the loop only.

    `much` is what a client hears who has enough, `full` what everybody hears where there is no more.
    """

    total: int
    of_a_client: int
    much: str
    full: str = "Too many requests are under way to this service; try again in some seconds."
    _held: Counter[str] = field(default_factory=Counter)

    def __len__(self) -> int:
        return self._held.total()

    @contextmanager
    def hold(self, client: str, size: int = 0) -> Iterator[Callable[[int], int]]:
        """Hold so much to the end of the context, and more by what it gives, which says how much it is then.

        Raises Refusal where there is no room.
        """
        held = 0

        def take(more: int) -> int:
            nonlocal held
            held += more
            self._held[client] += more
            status = 429 if self._held[client] > self.of_a_client else 503 if len(self) > self.total else 0
            if status:
                raise Refusal(status, "busy", self.much if status == 429 else self.full, headers={"Retry-After": "2"})
            return held

        try:
            take(size)
            yield take
        finally:
            self._held[client] -= held
            if not self._held[client]:
                del self._held[client]


@dataclass(slots=True)
class Connections:
    """The open connections of a server; used on its loop only. Those of `proxies` (networks) have no bound."""

    total: int
    of_an_address: int
    proxies: tuple[str, ...] = ()
    _open: set[Connection] = field(default_factory=set)
    _addresses: Counter[str] = field(default_factory=Counter)

    def __len__(self) -> int:
        return len(self._open)

    def protocol(self, **settings: Any) -> asyncio.Protocol:
        """A connection to be, as uvicorn asks for it."""
        return Connection(self, **settings)

    def admit(self, connection: Connection) -> bool:
        """Accept a new connection; if all places are taken, close the one that was silent longest."""
        is_many = self._addresses[connection.address] >= self.of_an_address and not self._is_proxy(connection.address)
        if is_many or (len(self._open) >= self.total and not self._make_room()):
            return False
        if not self._open:
            connection.loop.call_later(LOOK_EVERY, self._look, connection.loop)
        self._open.add(connection)
        self._addresses[connection.address] += 1
        return True

    def forget(self, connection: Connection) -> None:
        """A connection is gone."""
        if connection in self._open:
            self._open.discard(connection)
            self._addresses -= Counter({connection.address: 1})

    def _is_proxy(self, address: str) -> bool:
        try:
            found = ipaddress.ip_network(address)
        except ValueError:
            return False
        proxies = map(ipaddress.ip_network, self.proxies)
        return any(found.version == proxy.version and found.overlaps(proxy) for proxy in proxies)

    def _make_room(self) -> bool:
        silent = [connection for connection in self._open if connection.is_waiting]
        if silent:
            longest = min(silent, key=lambda connection: connection.since)
            self.forget(longest)
            longest.transport.abort()
        return bool(silent)

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        """Close the connections that took too long; repeat in a second."""
        now = time.monotonic()
        for connection in [connection for connection in self._open if connection.is_late(now)]:
            connection.transport.abort()
        if self._open:
            loop.call_later(LOOK_EVERY, self._look, loop)


class Connection(HttpToolsProtocol):
    """uvicorn's connection, which has no time for heads and bodies and no bounds."""

    def __init__(self, all_of_them: Connections, **settings: Any) -> None:
        super().__init__(**settings)
        self._all = all_of_them
        self.address = ""
        self.since = time.monotonic()
        # Whether a head has not come to its end; bytes of it, or of the body, after the piece in which it began.
        self._is_in_head = False
        self._received = 0
        self._is_refused = self._is_repeated = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.address = place_of(self.client[0]) if self.client else ""
        if not self._all.admit(self):
            self._write(middleware.TOO_MANY_CONNECTIONS)
            transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.forget(self)
        scope: Any = {} if self.is_waiting else self.cycle.scope
        super().connection_lost(exc)
        if work := scope.get("work"):  # nobody waits for it
            scope["left"] = True
            work.cancel()

    def data_received(self, data: bytes) -> None:
        self._unset_keepalive_if_required()
        for begin in range(0, len(data), PIECE):
            if self._is_refused:
                return
            rest = memoryview(data)[begin : begin + PIECE]
            self._received += len(rest)
            try:
                while rest:
                    rest = self._read(rest)
            except httptools.HttpParserError:
                self._refuse(middleware.NOT_HTTP)
            else:
                if self._is_in_head and self._received > middleware.LARGEST_HEADERS:
                    self._refuse(middleware.HEADERS_TOO_LARGE)

    def _read(self, data: memoryview) -> memoryview:
        """Have the parser read this; what it left.

        It stops after the head of a request that offers another protocol (h2c, as Java's client does with each first
        request), which is not taken. Another parser goes on, and is told how long the body is that follows.
        """
        try:
            self.parser.feed_data(data)
        except httptools.HttpParserUpgrade as stopped:
            lengths = [b": ".join(pair) for pair in self.cycle.scope["headers"] if pair[0] in LENGTHS]
            self.cycle.more_body = True
            self.parser, self._is_repeated = httptools.HttpRequestParser(self), True
            self.parser.feed_data(b"\r\n".join([b"POST / HTTP/1.1", *lengths, b"", b""]))
            self._is_repeated = False
            return data[stopped.args[0] :]
        return data[:0]

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._is_in_head, self._received = True, 0

    def on_header(self, name: bytes, value: bytes) -> None:
        """A header of the head; what comes after a body in chunks is none."""
        if self._is_in_head:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        self._is_in_head, self._received, self.since = False, 0, time.monotonic()
        if not self._is_repeated:
            super().on_headers_complete()

    def _refuse(self, answer: Response) -> None:
        """Take nothing more of this connection, as what follows may be meant as a part; whole requests are answered.

        What the client still sends is read and dropped: to close before would reset the connection and lose the answer.
        """
        self._is_refused = True
        if not self.is_waiting and not self.cycle.more_body:
            self.cycle.keep_alive = False
            return
        if self.is_waiting or not (self.pipeline or self.cycle.response_started):
            self._write(answer)
            self.transport.write_eof()
        if not self.is_waiting:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.loop.call_later(LINGER, self.transport.close)

    def _write(self, answer: Response) -> None:
        """An answer to what the application does not see."""
        first = f"HTTP/1.1 {answer.status_code} {HTTPStatus(answer.status_code).phrase}".encode()
        lines = [first, *(b": ".join(pair) for pair in answer.raw_headers)]
        self.transport.write(b"\r\n".join([*lines, b"", bytes(answer.body)]))

    def on_response_complete(self) -> None:
        self.since = time.monotonic()
        super().on_response_complete()

    @property
    def is_waiting(self) -> bool:
        """Whether the next request has not come, or not to the end of its headers."""
        return self.cycle is None or self.cycle.response_complete

    def is_late(self, now: float) -> bool:
        """Whether the client takes longer than it may for its next head, or for its body."""
        if self.is_waiting:
            return now - self.since > (HEADERS if self.cycle is None else KEEP_ALIVE)
        return self.cycle.more_body and now - self.since > BODY_GRACE + self._received / BYTES_A_SECOND
