"""Connections: two counts (in all, and of one address) and two times (for a head, for a body).

What a proxy does better, which is to take slow heads, bodies in tiny pieces, and unread answers, is
left to the proxy that a port for strangers needs; see docs/how-to/operate.md.
"""

from __future__ import annotations

import asyncio
import ipaddress
import time
from collections import Counter
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

import httptools
from starlette.responses import Response
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from inverse_service.web import clients, middleware

# The first request line and its headers have so long; the next ones as long as a silent connection
# is kept; s.
HEADERS, KEEP_ALIVE = 10.0, 30.0
# A body may come this slowly after its first seconds.
BODY_GRACE, BYTES_A_SECOND = 15.0, 10_000
LOOK_EVERY = 1.0
# What comes is parsed in pieces: that in which a head begins may have the end of a body before it,
# and is not counted.
PIECE = 8192
# So long what comes after a refused head is dropped before the connection is closed, s.
LINGER = 2.0
# What says how long a body is.
LENGTHS = (b"content-length", b"transfer-encoding")


@dataclass(slots=True)
class Connections:
    """The open connections of a server; used on its loop only. Those of `proxies` (networks) have
    no bound.
    """

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
        is_many = self._addresses[connection.address] >= self.of_an_address and not self.is_proxy(
            connection.address
        )
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

    def is_proxy(self, address: str) -> bool:
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
        # Whether a head has not come to its end; bytes of it, or of the body, after the piece in
        # which it began.
        self._is_in_head = False
        self._received = 0
        self._is_refused = self._is_repeated = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.address = clients.place_of(self.client[0]) if self.client else ""
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

        It stops after the head of a request that offers another protocol (h2c, as Java's client
        does with each first request), which is not taken. Another parser goes on, and is told how
        long the body is that follows.
        """
        try:
            self.parser.feed_data(data)
        except httptools.HttpParserUpgrade as stopped:
            lengths = [
                b": ".join(pair) for pair in self.cycle.scope["headers"] if pair[0] in LENGTHS
            ]
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
        """Take nothing more of this connection, as what follows may be meant as a part; whole
        requests are answered.

        What the client still sends is read and dropped: to close before would reset the connection
        and lose the answer.
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
        return (
            self.cycle.more_body and now - self.since > BODY_GRACE + self._received / BYTES_A_SECOND
        )
