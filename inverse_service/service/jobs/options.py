"""What a caller may ask for in addition to the document: bounds within the server's, and the seed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from inverse_service.errors import InputError, LimitError

SMALLEST_MEMORY = 512
LARGEST_SEED = 2**31 - 1
KEYS = "time_limit, memory_limit, seed"


@dataclass(frozen=True, slots=True)
class JobOptions:
    """`time_limit` in seconds, `memory_limit` in MiB; both at most the server's."""

    time_limit: float = 60.0
    memory_limit: int = 4096
    seed: int = 1

    def canonical(self) -> str:
        """JSON with sorted keys: part of the identity of a job."""
        values = {"memory_limit": self.memory_limit, "seed": self.seed, "time_limit": float(self.time_limit)}
        return json.dumps(values, sort_keys=True, separators=(",", ":"))


def stored_options(text: str) -> JobOptions:
    """The options of a stored job."""
    return JobOptions(**json.loads(text))


def split_options(document: Any) -> tuple[Any, Any]:
    """The document without its key `options`, and what that key holds (None where it is not there)."""
    if not isinstance(document, Mapping) or "options" not in document:
        return document, None
    return {key: value for key, value in document.items() if key != "options"}, document["options"]


def read_options(given: Any, server: JobOptions) -> JobOptions:
    """The options asked for, the server's where nothing is said. Raises InputError with the pointer."""
    if given is None:
        return server
    if not isinstance(given, Mapping):
        raise InputError(f"'options' must be an object with some of the keys {KEYS}.", "/options")
    unknown = set(given) - {"time_limit", "memory_limit", "seed"}
    if unknown:
        raise InputError(f"'options' has a key that is not known here; the keys are {KEYS}.", "/options")
    return JobOptions(
        time_limit=read_time_limit(given.get("time_limit"), server.time_limit),
        memory_limit=_whole(given, "memory_limit", server.memory_limit, SMALLEST_MEMORY, server.memory_limit),
        seed=_whole(given, "seed", server.seed, 0, LARGEST_SEED),
    )


def read_time_limit(value: Any, largest: float, pointer: str = "/options/time_limit") -> float:
    """A number of seconds, `largest` where nothing is given."""
    if value is None:
        return largest
    is_number = isinstance(value, int | float | Decimal) and not isinstance(value, bool)
    seconds = float(value) if is_number else math.nan
    if not 0 < seconds <= largest:
        raise LimitError(f"time_limit must be a number of seconds above 0 and at most {largest:g}.", pointer)
    return seconds


def _whole(given: Mapping[str, Any], key: str, default: int, low: int, high: int) -> int:
    value = given.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise LimitError(f"{key} must be an integer from {low} to {high}.", f"/options/{key}")
    return value
