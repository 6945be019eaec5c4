"""Who asks, and how much of the service a client may have: bytes under way, and places among those
who wait.

A client is the name of an API key, of the settings or of a file, or the address where no keys are
asked for.
"""

import datetime
import functools
import hmac
import ipaddress
import logging
import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from starlette.requests import Request

from inverse_service import errors
from inverse_service.service.jobs.model import Viewer
from inverse_service.settings import Settings, hash_of_key, read_key
from inverse_service.web import middleware
from inverse_service.web.problems import Refusal

log = logging.getLogger(__name__)
LARGEST_KEY = 200
LARGEST_FILE = 1_000_000
PLACE = "The file INVERSE_SERVICE_API_KEYS_FILE"
# Holds the key after a person logged in on the page; scripts cannot read it, and other sites never
# send it.
COOKIE = "inverse-service-key"
OWN_PAGES = ("same-origin", "none")
QUICK_PROCESSES = 3
# Of one client so many run at the same time, and one is always left for the others.
QUICK_SHARE = QUICK_PROCESSES - 1
# Answers next to forms that are computed at the same time.
GLANCES = QUICK_PROCESSES - 1


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
        """Read the file again if it changed; if it is unreadable, keep the present keys and log a
        warning.
        """
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
        return tuple(
            _key(number, line)
            for number, line in enumerate(lines, 1)
            if line.partition("#")[0].strip()
        )


def _key(number: int, line: str) -> Key:
    """`name:HASH`, and the last day after it, as 2030-12-31, where the key expires."""
    text, _, day = line.partition("#")[0].strip().partition(" ")
    try:
        client, digest = read_key(text)
        return Key(
            client, digest, datetime.date.fromisoformat(day.strip()) if day.strip() else None
        )
    except (ValueError, errors.InputError):
        detail = (
            f"{PLACE} is wrong in line {number}; a line is 'alice:HASH' or 'alice:HASH 2030-12-31'."
        )
        raise errors.InputError(detail) from None


async def require_client(request: Request) -> None:
    """A dependency of every call under /v1, `note_client`: on the loop, as the framework runs plain
    ones in threads.
    """
    note_client(request)


def note_client(request: Request) -> None:
    """Note the client; 401 without a valid key if keys are set."""
    keys = request.app.state.engine.keys
    name = _client(request, keys)
    request.scope["state"] |= {"client_name": name, "viewer": Viewer(name, not keys.are_asked)}


def viewer_of(request: Request) -> Viewer:
    """Who asks, as `note_client` found: all that is read, listed and cancelled is checked against
    it.
    """
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
    """An IPv4 address, or the network /64 of an IPv6 address: all of it is one host's, who may take
    any in it.
    """
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    return str(ipaddress.ip_network((found, 64), strict=False))


def is_of_own_page(request: Request) -> bool:
    """Whether a page of ours sends it, or no browser. Older ones, and all without TLS, tell the
    page's origin only.
    """
    site, origin = (
        middleware.header_of(request.scope, name) for name in (b"sec-fetch-site", b"origin")
    )
    if site or not origin:
        return not site or site in OWN_PAGES
    return middleware.name_of(origin.rpartition("//")[2]) == middleware.host_of(request.scope)


def key_of_cookie(request: Request) -> str:
    """The key that a page of ours put into the cookie; nothing where another site sends the
    request.
    """
    is_taken = request.method in ("GET", "HEAD") or is_of_own_page(request)
    return unquote(request.cookies.get(COOKIE, "")) if is_taken else ""


def _client(request: Request, keys: Keys) -> str:
    if not keys.are_asked:
        return address_of(request)
    scheme, _, token = middleware.header_of(request.scope, b"authorization").partition(" ")
    key = (
        token.strip()
        if scheme.lower() == "bearer"
        else middleware.header_of(request.scope, b"x-api-key")
    )
    name = keys.client_of(key or key_of_cookie(request))
    if name is None:
        detail = "This service asks for a key: send 'Authorization: Bearer KEY' or 'X-API-Key: KEY'; people use /login."
        raise Refusal(
            401, "key", detail, headers={"WWW-Authenticate": 'Bearer realm="inverse-service"'}
        )
    return name


@dataclass(slots=True)
class Shares:
    """What clients hold of something: at most `total` in all, and `of_a_client` of one; used on the
    loop only.

    `much` is what a client hears who has enough, `full` what everybody hears where there is no
    more.
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
        """Hold so much to the end of the context, and more by what it gives, which says how much it
        is then.

        Raises Refusal where there is no room.
        """
        held = 0

        def take(more: int) -> int:
            nonlocal held
            held += more
            self._held[client] += more
            status = (
                429
                if self._held[client] > self.of_a_client
                else 503
                if len(self) > self.total
                else 0
            )
            if status:
                raise Refusal(
                    status,
                    "busy",
                    self.much if status == 429 else self.full,
                    headers={"Retry-After": "2"},
                )
            return held

        try:
            take(size)
            yield take
        finally:
            self._held[client] -= held
            if not self._held[client]:
                del self._held[client]
