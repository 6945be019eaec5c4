"""Settings of the service, read from the environment; every name has the prefix INVERSE_SERVICE_."""

import difflib
import hashlib
import ipaddress
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, NamedTuple

from inverse_service import errors

PREFIX = "INVERSE_SERVICE_"
# What the program does, for its help and for the description of its API.
PURPOSE = "Decide whether q'' = f(t, q, q') comes from a Lagrangian, with a proof that a second program checks."
LOG_LEVELS = ("debug", "info", "warning", "error")
# Read elsewhere: where compiled code is kept.
OTHERS = ("CACHE",)
_KEYS = "it is a list such as alice:HASH, bob:HASH with the SHA-256 of each key (printf %s KEY | sha256sum)"
_KEY_NAME = re.compile(r"[A-Za-z0-9._-]{1,40}")
_ORIGIN = re.compile(r"\*|https?://[^\s;,'\"/]+")
_DIGEST = re.compile(r"[0-9a-f]{64}")


class ReadKey(NamedTuple):
    """The name of a key and the digest of its secret."""

    name: str
    digest: str


def read_key(text: str) -> ReadKey:
    """(client, SHA-256 of the key) from `name:HASH`; raises InputError."""
    name, _, digest = text.lower().rpartition(":")
    name = name or digest[:8]
    if not _KEY_NAME.fullmatch(name) or not _DIGEST.fullmatch(digest):
        raise errors.InputError(
            f"The setting {PREFIX}API_KEYS has an entry that is not a key; {_KEYS}."
        )
    return ReadKey(name, digest)


def _whole(low: int, high: int, name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 12 and low <= int(text) <= high):
        raise errors.InputError(
            f"The setting {PREFIX}{name} must be an integer from {low} to {high}."
        )
    return int(text)


def _bound(high: int, name: str, text: str) -> int | None:
    """A number, of which 0 is none."""
    return _whole(0, high, name, text) or None


def _number(low: float, high: float, unit: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise errors.InputError(
            f"The setting {PREFIX}{name} must be a number of {unit} from {low:g} to {high:g}."
        )
    return value


def _text(name: str, text: str) -> str:
    return text


def _list(name: str, text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _addresses(name: str, text: str) -> tuple[str, ...]:
    try:
        for each in _list(name, text):
            ipaddress.ip_network(each)
    except ValueError:
        raise errors.InputError(
            f"The setting {PREFIX}{name} must be a list of addresses or networks such as 127.0.0.1, 10.0.0.0/8."
        ) from None
    return _list(name, text)


def _origins(name: str, text: str) -> tuple[str, ...]:
    if not all(map(_ORIGIN.fullmatch, _list(name, text))):
        raise errors.InputError(
            f"The setting {PREFIX}{name} must be a list such as https://a.example, https://b.example, or *."
        )
    return _list(name, text)


def _api_keys(name: str, text: str) -> tuple[tuple[str, str], ...]:
    """`name:HASH, ...`; HASH is the SHA-256 of the key in hexadecimal digits; without a name it
    names the client.
    """
    found = tuple(map(read_key, _list(name, text)))
    if not found:
        raise errors.InputError(
            f"The setting {PREFIX}{name} has no key; {_KEYS}. Unset it to require none."
        )
    return found


def _log_level(name: str, text: str) -> str:
    if text.lower() not in LOG_LEVELS:
        raise errors.InputError(
            f"The setting {PREFIX}{name} must be one of {', '.join(LOG_LEVELS)}."
        )
    return text.lower()


def _setting(default: Any, read: Callable[..., Any], *bounds: Any) -> Any:
    """A field with its default, and how the text of the environment is read: `read(*bounds, name,
    text)`.
    """
    return field(default=default, metadata={"read": partial(read, *bounds)})


@dataclass(frozen=True, slots=True)
class Settings:
    """`time_limit` in seconds, `memory_limit` in MiB a worker, `max_body` in bytes.

    `database`: a path or an address, None for the user's own file. `queue` and `client_queue` jobs
    may be open, `client_running` jobs of one client run at a time, and its runs of a day may take
    `client_daily_seconds` of the processor (None: no bound); `waiting` requests may wait for a
    process without being jobs. `retention_days` and `store_size` (MiB) say how long answers are
    kept. `api_keys`: SHA-256 of each key by the name of its client, `api_keys_file`: a file with
    more of them, read again when it changes; with neither, no keys are asked for. `cluster`: the
    address of a Dask scheduler. `connections` may be open, `client_connections` from one address;
    `proxies` are addresses or networks whose forwarded client addresses are trusted, `hosts` the
    accepted host names (empty: any). Pages of `frame_origins` may show results in frames.
    """

    workers: int = _setting(2, _whole, 1, 256)
    time_limit: float = _setting(60.0, _number, 0.1, 86_400.0, "seconds")
    memory_limit: int = _setting(4096, _whole, 1024, 1_048_576)
    max_body: int = _setting(1_000_000, _whole, 1_000, 1_000_000_000)
    queue: int = _setting(100_000, _whole, 1, 10_000_000)
    client_queue: int = _setting(50_000, _whole, 1, 10_000_000)
    client_running: int | None = _setting(None, _bound, 100_000)
    client_daily_seconds: int | None = _setting(None, _bound, 100_000_000)
    waiting: int = _setting(1024, _whole, 1, 100_000)
    max_lines: int = _setting(10_000, _whole, 1, 1_000_000)
    database: str | None = _setting(None, _text)
    retention_days: float = _setting(365.0, _number, 0.001, 100_000.0, "days")
    store_size: int = _setting(10_240, _whole, 1, 100_000_000)
    api_keys: tuple[tuple[str, str], ...] = _setting((), _api_keys)
    api_keys_file: str | None = _setting(None, _text)
    cors_origins: tuple[str, ...] = _setting((), _origins)
    cluster: str | None = _setting(None, _text)
    connections: int = _setting(2000, _whole, 10, 1_000_000)
    client_connections: int = _setting(256, _whole, 1, 1_000_000)
    frame_origins: tuple[str, ...] = _setting((), _origins)
    proxies: tuple[str, ...] = _setting((), _addresses)
    hosts: tuple[str, ...] = _setting((), _list)
    log_level: str = _setting("info", _log_level)


def cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def default_workers() -> int:
    """One process for each core this process may use, at most eight."""
    return max(1, min(8, cores()))


def read_settings(environment: Mapping[str, str] = os.environ) -> Settings:
    """The settings of the environment, with defaults for missing ones.

    Raises InputError with one sentence that names the variable and its accepted values, or an
    unknown variable: a misspelled key or limit must not go unnoticed.
    """
    _refuse_unknown(environment)
    found: dict[str, Any] = {"workers": default_workers()}
    for each in fields(Settings):
        name = each.name.upper()
        text = environment.get(PREFIX + name, "").strip()
        if text or (name == "API_KEYS" and PREFIX + name in environment):
            found[each.name] = each.metadata["read"](name, text)
    return Settings(**found)


def hash_of_key(key: str) -> str:
    """The stored hash of an API key: 64 hexadecimal digits."""
    return hashlib.sha256(key.encode()).hexdigest()


def _refuse_unknown(environment: Mapping[str, str]) -> None:
    known = [field.name.upper() for field in fields(Settings)] + list(OTHERS)
    for name in environment:
        if name.startswith(PREFIX) and name.removeprefix(PREFIX) not in known:
            near = difflib.get_close_matches(name.removeprefix(PREFIX), known, 1)
            hint = (
                f"did you mean {PREFIX}{near[0]}?"
                if near
                else "docs/reference/settings.md lists all."
            )
            raise errors.InputError(f"There is no setting {name[:80]}; {hint}")
