"""Settings of the service, read from the environment; every name has the prefix INVERSE_SERVICE_."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

from inverse_service.errors import InputError

PREFIX = "INVERSE_SERVICE_"


@dataclass(frozen=True, slots=True)
class Settings:
    """`time_limit` and `wait` in seconds, `memory_limit` in MiB a worker, `max_body` in bytes.

    `workers` processes solve; `queue` requests may wait for them, one more is told to come back.
    """

    workers: int = 2
    time_limit: float = 60.0
    memory_limit: int = 4096
    max_body: int = 1_000_000
    queue: int = 64
    cors_origins: tuple[str, ...] = ()


def default_workers() -> int:
    """One process for each core this process may use, at most eight."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(8, cores))


def read_settings(environment: Mapping[str, str] = os.environ) -> Settings:
    """The settings of the environment, defaults for what is not set.

    Raises InputError with one sentence that names the variable and the values it takes.
    """
    return Settings(
        workers=_whole(environment, "WORKERS", default_workers(), 1, 256),
        time_limit=_seconds(environment, "TIME_LIMIT", 60.0, 0.1, 86_400.0),
        memory_limit=_whole(environment, "MEMORY_LIMIT", 4096, 1024, 1_048_576),
        max_body=_whole(environment, "MAX_BODY", 1_000_000, 1_000, 1_000_000_000),
        queue=_whole(environment, "QUEUE", 64, 1, 100_000),
        cors_origins=_origins(environment),
    )


def _whole(environment: Mapping[str, str], name: str, default: int, low: int, high: int) -> int:
    text = environment.get(PREFIX + name, "").strip()
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) < 12 and low <= int(text) <= high):
        raise InputError(f"The setting {PREFIX}{name} must be a whole number from {low} to {high}.")
    return int(text)


def _seconds(environment: Mapping[str, str], name: str, default: float, low: float, high: float) -> float:
    text = environment.get(PREFIX + name, "").strip()
    if not text:
        return default
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise InputError(f"The setting {PREFIX}{name} must be a number of seconds from {low:g} to {high:g}.")
    return value


def _origins(environment: Mapping[str, str]) -> tuple[str, ...]:
    text = environment.get(PREFIX + "CORS_ORIGINS", "")
    origins = tuple(part.strip() for part in text.split(",") if part.strip())
    for origin in origins:
        if origin != "*" and not origin.startswith(("http://", "https://")):
            raise InputError(
                f"The setting {PREFIX}CORS_ORIGINS must be a list such as https://a.example, https://b.example, or *."
            )
    return origins
