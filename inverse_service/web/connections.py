"""Connections, limited in number (in all, and of one address) and in time, served in turn."""

from __future__ import annotations

import asyncio
import ipaddress
import sys
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

import h11
from starlette.responses import Response
from uvicorn.protocols.http.h11_impl import H11Protocol

from inverse_service.web.clients import place_of
from inverse_service.web.middleware import MOST_HEADERS, headers_too_large, not_http, too_many_connections

# The first request line and its headers have so long; the next ones as long as a silent connection is kept; s.
HEADERS = 10.0
KEEP_ALIVE = 30.0
# A body may come this slowly after its first seconds.
BODY_GRACE = 15.0
BYTES_A_SECOND = 10_000
# An answer of which the client takes nothing for so long is given up, s.
STALL = 120.0
LOOK_EVERY = 1.0
# So long what comes after a refused head is dropped before the connection is closed, s.
LINGER = 2.0
# In one turn of the loop so many connections are heard, and of what waits one of each address after the other.
HEARD_AT_ONCE = 8
# Data with a line end in so many bytes, as chunks of a byte or thousands of headers are, cost the loop far more than
# their length: of them so much is taken in a turn, of others so much.
CRUMB, FEW_BYTES, MANY_BYTES = 16, 2048, 262_144


@dataclass(slots=True)
class Connections:
    """The open connections of a server; used on its loop only. Those of `proxies` (networks) have no bound."""

    total: int
    of_an_address: int
    proxies: tuple[str, ...] = ()
    refused: int = 0
    timed_out: int = 0
    _open: set[Connection] = field(default_factory=set)
    _addresses: Counter[str] = field(default_factory=Counter)
    _turns: dict[str, deque[Connection]] = field(default_factory=dict)
    _heard: int = 0

    def __len__(self) -> int:
        return len(self._open)

    def protocol(self, **settings: Any) -> asyncio.Protocol:
        """A connection to be, as uvicorn asks for it."""
        return Connection(self, **settings)

    def admit(self, connection: Connection) -> bool:
        """Take a new connection in, at the cost of the one that was silent longest where all places are taken."""
        if self._addresses[connection.address] >= self.of_an_address and not self._is_proxy(connection.address):
            self.refused += 1
            return False
        if len(self._open) >= self.total and not self._make_room():
            self.refused += 1
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
            self._addresses[connection.address] -= 1
            if not self._addresses[connection.address]:
                del self._addresses[connection.address]

    def hears(self, connection: Connection) -> bool:
        """Whether a connection may take what came at once, or waits for its turn: nobody's burst delays others."""
        if self._heard == 0 and not self._turns:
            connection.loop.call_soon(self._give_turns, connection.loop)
        self._heard += 1
        return self._heard <= HEARD_AT_ONCE and connection.address not in self._turns

    def wait_for_turn(self, connection: Connection) -> None:
        """Let a connection take what came when it is its turn."""
        self._turns.setdefault(connection.address, deque()).append(connection)

    def _give_turns(self, loop: asyncio.AbstractEventLoop) -> None:
        addresses = list(self._turns)[:HEARD_AT_ONCE]
        self._heard = len(addresses)
        if addresses:
            loop.call_soon(self._give_turns, loop)
        for address in addresses:
            waiting = self._turns.pop(address)
            connection = waiting.popleft()
            if waiting:
                self._turns[address] = waiting  # behind all others
            if connection.take_some():
                self.wait_for_turn(connection)

    def _is_proxy(self, address: str) -> bool:
        try:
            found = ipaddress.ip_network(address)
        except ValueError:
            return False
        proxies = map(ipaddress.ip_network, self.proxies)
        return any(found.version == proxy.version and found.overlaps(proxy) for proxy in proxies)

    def _make_room(self) -> bool:
        silent = [connection for connection in self._open if connection.is_waiting]
        if not silent:
            return False
        longest = min(silent, key=lambda connection: connection.since)
        self.forget(longest)
        longest.transport.abort()
        return True

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        """Close what took too long; again in a second."""
        now = time.monotonic()
        for connection in [connection for connection in self._open if connection.is_late(now)]:
            self.timed_out += 1
            connection.transport.abort()
        if self._open:
            loop.call_later(LOOK_EVERY, self._look, loop)


class Connection(H11Protocol):
    """uvicorn's connection, which has no time for heads and bodies and no bounds."""

    def __init__(self, all_of_them: Connections, **settings: Any) -> None:
        super().__init__(**settings)
        self._all = all_of_them
        self.address = ""
        self.since = time.monotonic()
        self._is_first = True
        self._request: object = None
        self._received = 0
        self._unread = 0
        self._rest = bytearray()
        self._is_refused = False
        self._lines = 0
        self._tail = b""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.address = place_of(self.client[0]) if self.client else ""
        if not self._all.admit(self):
            self._write(too_many_connections())
            transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.forget(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._is_refused:
            return
        if not self._rest and self._all.hears(self) and len(data) <= _most_of(data):
            self._take(data)
            return
        if not self._rest:
            self._all.wait_for_turn(self)
        self._rest += data
        self.transport.pause_reading()

    def take_some(self) -> bool:
        """Take some of what came and waits; whether there is more."""
        if self._is_refused or self.transport.is_closing():
            self._rest.clear()
            return False
        most = _most_of(self._rest)
        some, self._rest = bytes(self._rest[:most]), self._rest[most:]
        self._take(some)
        if not self._rest and not self.flow.read_paused:
            self.transport.resume_reading()
        return bool(self._rest)

    def _take(self, data: bytes) -> None:
        if self.is_waiting and self._lines_of_head(data) > MOST_HEADERS:
            self._refuse_head(headers_too_large())
            return
        super().data_received(data)
        if not self.is_waiting:
            self._lines, self._tail = 0, b""
        if self.cycle is not self._request:
            self._request, self._is_first = self.cycle, False
            self.since, self._received = time.monotonic(), 0
        self._received += len(data)

    def send_400_response(self, msg: str) -> None:
        """431 where the head is larger than h11 keeps, as for one that comes at once; else 400. A head that cannot be
        read is refused; where a body cannot be, the connection ends, with this answer if there is none yet."""
        is_large = getattr(sys.exc_info()[1], "error_status_hint", 400) == 431
        answer = headers_too_large() if is_large else not_http()
        if self.conn.our_state is h11.IDLE:
            self._refuse_head(answer)
            return
        if self.conn.our_state is h11.SEND_RESPONSE:
            self.cycle.disconnected = True
            self._write(answer)
        self.transport.close()

    def _lines_of_head(self, data: bytes) -> int:
        """The lines of the head so far; what follows it is not counted."""
        head, end, _ = (self._tail + data).partition(b"\r\n\r\n")
        self._lines += head.count(b"\n") - self._tail.count(b"\n")
        self._tail = b"" if end else data[-3:]
        return self._lines

    def _refuse_head(self, answer: Response) -> None:
        """Answer and end. What the client still sends is read and dropped: to close before it is read would reset the
        connection and take the answer with it."""
        self._write(answer)
        self._is_refused = True
        self.transport.write_eof()
        self.loop.call_later(LINGER, self.transport.close)

    def _write(self, answer: Response) -> None:
        """An answer past h11, which takes no more of this connection."""
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
        """Whether the client takes longer than it may for what it does now."""
        if self.transport.is_closing():
            return False
        if self.is_waiting:
            return now - self.since > (HEADERS if self._is_first else KEEP_ALIVE)
        if self.cycle.more_body:
            return now - self.since > BODY_GRACE + self._received / BYTES_A_SECOND
        return self._is_stalled(now)

    def _is_stalled(self, now: float) -> bool:
        unread = self.transport.get_write_buffer_size()
        if unread == 0 or unread != self._unread:
            self._unread, self.since = unread, now
        return now - self.since > STALL


def _most_of(data: bytes | bytearray) -> int:
    """How much of it may be taken in a turn."""
    return FEW_BYTES if CRUMB * data.count(b"\n") > len(data) else MANY_BYTES
