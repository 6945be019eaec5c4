"""The addresses that count as one client, and the host names that the service accepts."""

from __future__ import annotations

import asyncio
from typing import Any, cast
from unittest.mock import Mock

import httpx
import pytest

from inverse_service.settings import Settings
from inverse_service.web.application import create_application
from inverse_service.web.clients import place_of
from inverse_service.web.connections import Connections
from inverse_service.web.middleware import name_of


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("2001:db8:1:2:aaaa::1", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff:ffff:ffff:ffff", "2001:db8:1:2::/64"),
        ("2001:db8:1:3::1", "2001:db8:1:3::/64"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("fe80::1%eth0", "fe80::/64"),
        ("testclient", "testclient"),
        ("", ""),
    ],
)
def test_all_addresses_of_a_network_of_one_host_are_one_client(address: str, place: str) -> None:
    assert place_of(address) == place


def test_a_proxy_is_known_by_its_network() -> None:
    connections = Connections(10, 1, ("127.0.0.1/32", "2001:db8::/32"))
    assert connections.is_proxy(place_of("127.0.0.1"))
    assert connections.is_proxy(place_of("2001:db8:1::5"))
    assert not connections.is_proxy(place_of("192.0.2.1"))
    assert not connections.is_proxy(place_of("2001:db9::1"))


class Silent:
    """A connection that has been silent since then, as a server knows it."""

    def __init__(self, address: str, since: float, is_waiting: bool = True) -> None:
        self.address, self.since, self.is_waiting = address, since, is_waiting
        self.loop, self.transport = Mock(), Mock()

    @property
    def is_closed(self) -> bool:
        return bool(self.transport.abort.called)


def test_a_full_server_closes_the_connection_that_was_silent_longest() -> None:
    connections = Connections(3, 3)
    first, second = Silent("192.0.2.1", 1.0, is_waiting=False), Silent("192.0.2.2", 2.0)
    third, fourth = Silent("192.0.2.3", 3.0), Silent("192.0.2.4", 4.0)
    assert all(connections.admit(cast("Any", one)) for one in (first, second, third, fourth))
    assert [one.is_closed for one in (first, second, third, fourth)] == [False, True, False, False]
    assert len(connections) == 3
    for one in (first, third, fourth):
        one.is_waiting = False
    assert not connections.admit(cast("Any", Silent("192.0.2.5", 5.0)))


def test_an_address_has_its_bound_and_a_proxy_has_none() -> None:
    connections = Connections(9, 1, ("192.0.2.9/32",))
    known = Silent("192.0.2.1", 1.0)
    assert connections.admit(cast("Any", known))
    assert not connections.admit(cast("Any", Silent("192.0.2.1", 2.0)))
    connections.forget(cast("Any", known))
    assert connections.admit(cast("Any", Silent("192.0.2.1", 3.0)))
    assert all(connections.admit(cast("Any", Silent("192.0.2.9", k))) for k in range(3))


def test_a_name_with_the_dot_of_the_root_is_the_same_host() -> None:
    assert [name_of(host) for host in ("Localhost:8000", "localhost.", "localhost.:80")] == [
        "localhost"
    ] * 3


@pytest.mark.parametrize(
    ("hosts", "host", "status"),
    [
        ((), "b.example", 200),
        (("a.example",), "a.example", 200),
        (("a.example",), "b.example", 421),
        (("*",), "b.example", 200),
    ],
)
def test_a_host_name_is_answered_to_where_it_is_listed(
    hosts: tuple[str, ...], host: str, status: int
) -> None:
    async def asked() -> httpx.Response:
        transport = httpx.ASGITransport(app=create_application(Settings(hosts=hosts)))
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{host}") as browser:
            return await browser.get("/livez")

    assert asyncio.run(asked()).status_code == status
