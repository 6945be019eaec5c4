"""What `serve` says of itself."""

from __future__ import annotations

import asyncio
import socket
from types import SimpleNamespace

import pytest

from inverse_service.cli import serving


@pytest.mark.parametrize("begins", [True, False])
def test_the_address_is_told_once_the_server_answers_and_never_where_it_does_not_begin(
    begins: bool,
) -> None:
    told = list[str]()
    server = SimpleNamespace(started=False)

    async def startup(sockets: list[socket.socket] | None = None) -> None:
        assert not told
        await asyncio.sleep(0)
        server.started = begins

    server.startup = startup
    serving._once_it_answers(server, lambda: told.append("address"))
    asyncio.run(server.startup())
    assert told == ["address"] * begins
