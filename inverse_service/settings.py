"""Settings of the service, read from the environment; every name has the prefix INVERSE_SERVICE_."""

import difflib
import hashlib
import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields

from inverse_service import errors

PREFIX = "INVERSE_SERVICE_"
LOG_LEVELS = ("debug", "info", "warning", "error")
# Read elsewhere: where compiled code is kept.
OTHERS = ("CACHE",)
_KEYS = "it is a list such as alice:HASH, bob:HASH with the SHA-256 of each key (printf %s KEY | sha256sum)"
_KEY_NAME = re.compile(r"[A-Za-z0-9._-]{1,40}")
_ORIGIN = re.compile(r"\*|https?://[^\s;,'\"/]+")
_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class Settings:
    """`time_limit` in seconds, `memory_limit` in MiB a worker, `max_body` in bytes.

    `database`: a path or an address, None for the user's own file. `queue` and `client_queue` jobs
    may be open, `client_running` jobs of one client run at a time, and its runs of a day may
    take `client_daily_seconds` of the processor (None: no bound); `waiting` requests may
    wait for a process without being jobs. `retention_days` and `store_size` (MiB) say how long answers
    are kept. `api_keys`: SHA-256 of each key by the name of its client, `api_keys_file`: a file with more of them,
    read again when it changes; with neither, no keys are asked for.
    `cluster`: the address of a Dask scheduler. `connections` may be open, `client_connections` from one address;
    `proxies` are addresses or networks whose forwarded client addresses are trusted, `hosts` the accepted host names
    (empty: any). Pages of `frame_origins` may show results in frames.
    """

    workers: int = 2
    time_limit: float = 60.0
    memory_limit: int = 4096
    max_body: int = 1_000_000
    queue: int = 100_000
    client_queue: int = 50_000
    client_running: int | None = None
    client_daily_seconds: int | None = None
    waiting: int = 1024
    max_lines: int = 10_000
    database: str | None = None
    retention_days: float = 365.0
    store_size: int = 10_240
    api_keys: tuple[tuple[str, str], ...] = ()
    api_keys_file: str | None = None
    cors_origins: tuple[str, ...] = ()
    cluster: str | None = None
    connections: int = 2000
    client_connections: int = 256
    frame_origins: tuple[str, ...] = ()
    proxies: tuple[str, ...] = ()
    hosts: tuple[str, ...] = ()
    log_level: str = "info"


def cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def default_workers() -> int:
    """One process for each core this process may use, at most eight."""
    return max(1, min(8, cores()))


def read_settings(environment: Mapping[str, str] = os.environ) -> Settings:
    """The settings of the environment, with defaults for missing ones.

    Raises InputError with one sentence that names the variable and its accepted values, or an unknown variable:
    a misspelled key or limit must not go unnoticed.
    """
    _refuse_unknown(environment)
    return Settings(
        workers=_whole(environment, "WORKERS", default_workers(), 1, 256),
        time_limit=_seconds(environment, "TIME_LIMIT", 60.0, 0.1, 86_400.0),
        memory_limit=_whole(environment, "MEMORY_LIMIT", 4096, 1024, 1_048_576),
        max_body=_whole(environment, "MAX_BODY", 1_000_000, 1_000, 1_000_000_000),
        queue=_whole(environment, "QUEUE", 100_000, 1, 10_000_000),
        client_queue=_whole(environment, "CLIENT_QUEUE", 50_000, 1, 10_000_000),
        client_running=_whole(environment, "CLIENT_RUNNING", 0, 0, 100_000) or None,
        client_daily_seconds=_whole(environment, "CLIENT_DAILY_SECONDS", 0, 0, 100_000_000) or None,
        waiting=_whole(environment, "WAITING", 1024, 1, 100_000),
        max_lines=_whole(environment, "MAX_LINES", 10_000, 1, 1_000_000),
        database=environment.get(PREFIX + "DATABASE", "").strip() or None,
        retention_days=_seconds(environment, "RETENTION_DAYS", 365.0, 0.001, 100_000.0, "days"),
        store_size=_whole(environment, "STORE_SIZE", 10_240, 1, 100_000_000),
        api_keys=_api_keys(environment),
        api_keys_file=environment.get(PREFIX + "API_KEYS_FILE", "").strip() or None,
        cors_origins=_origins(environment, "CORS_ORIGINS"),
        frame_origins=_origins(environment, "FRAME_ORIGINS"),
        cluster=environment.get(PREFIX + "CLUSTER", "").strip() or None,
        connections=_whole(environment, "CONNECTIONS", 2000, 10, 1_000_000),
        client_connections=_whole(environment, "CLIENT_CONNECTIONS", 256, 1, 1_000_000),
        proxies=_addresses(environment),
        hosts=tuple(_listed(environment, "HOSTS")),
        log_level=_log_level(environment),
    )


def hash_of_key(key: str) -> str:
    """The stored hash of an API key: 64 hexadecimal digits."""
    return hashlib.sha256(key.encode()).hexdigest()


def _whole(environment: Mapping[str, str], name: str, default: int, low: int, high: int) -> int:
    text = environment.get(PREFIX + name, "").strip()
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) < 12 and low <= int(text) <= high):
        raise errors.InputError(f"The setting {PREFIX}{name} must be an integer from {low} to {high}.")
    return int(text)


def _seconds(
    environment: Mapping[str, str], name: str, default: float, low: float, high: float, unit: str = "seconds"
) -> float:
    text = environment.get(PREFIX + name, "").strip()
    if not text:
        return default
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise errors.InputError(f"The setting {PREFIX}{name} must be a number of {unit} from {low:g} to {high:g}.")
    return value


def _listed(environment: Mapping[str, str], name: str) -> list[str]:
    return [part.strip() for part in environment.get(PREFIX + name, "").split(",") if part.strip()]


def _addresses(environment: Mapping[str, str]) -> tuple[str, ...]:
    found = tuple(_listed(environment, "PROXIES"))
    for text in found:
        try:
            ipaddress.ip_network(text)
        except ValueError:
            raise errors.InputError(
                f"The setting {PREFIX}PROXIES must be a list of addresses or networks such as 127.0.0.1, 10.0.0.0/8."
            ) from None
    return found


def _origins(environment: Mapping[str, str], name: str) -> tuple[str, ...]:
    origins = tuple(_listed(environment, name))
    for origin in origins:
        if not _ORIGIN.fullmatch(origin):
            raise errors.InputError(
                f"The setting {PREFIX}{name} must be a list such as https://a.example, https://b.example, or *."
            )
    return origins


def _api_keys(environment: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """`name:HASH, ...`; HASH is the SHA-256 of the key in hexadecimal digits; without a name it names the client."""
    text = environment.get(PREFIX + "API_KEYS")
    found = tuple(read_key(part.strip()) for part in (text or "").split(",") if part.strip())
    if text is not None and not found:
        raise errors.InputError(f"The setting {PREFIX}API_KEYS has no key; {_KEYS}. Unset it to require none.")
    return found


def read_key(text: str) -> tuple[str, str]:
    """(client, SHA-256 of the key) from `name:HASH`; raises InputError."""
    name, _, digest = text.lower().rpartition(":")
    name = name or digest[:8]
    if not _KEY_NAME.fullmatch(name) or not _DIGEST.fullmatch(digest):
        raise errors.InputError(f"The setting {PREFIX}API_KEYS has an entry that is not a key; {_KEYS}.")
    return name, digest


def _refuse_unknown(environment: Mapping[str, str]) -> None:
    known = [field.name.upper() for field in fields(Settings)] + list(OTHERS)
    for name in environment:
        if name.startswith(PREFIX) and name.removeprefix(PREFIX) not in known:
            near = difflib.get_close_matches(name.removeprefix(PREFIX), known, 1)
            hint = f"did you mean {PREFIX}{near[0]}?" if near else "docs/reference/settings.md lists all."
            raise errors.InputError(f"There is no setting {name[:80]}; {hint}")


def _log_level(environment: Mapping[str, str]) -> str:
    text = environment.get(PREFIX + "LOG_LEVEL", "").strip().lower() or "info"
    if text not in LOG_LEVELS:
        raise errors.InputError(f"The setting {PREFIX}LOG_LEVEL must be one of {', '.join(LOG_LEVELS)}.")
    return text
