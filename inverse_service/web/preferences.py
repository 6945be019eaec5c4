"""What the headers and the query of a request ask for: waiting, freshness, limits."""

from __future__ import annotations

import re
import uuid
from dataclasses import dataclass

from starlette.requests import Request

from inverse_service.errors import InputError
from inverse_service.service.jobs.options import JobOptions, read_time_limit
from inverse_service.web.problems import Refusal

DEFAULT_WAIT = 2.0
MAX_WAIT = 20.0
LARGEST_KEY = 255
WAIT = re.compile(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,15})", re.IGNORECASE)
NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")
ASYNC = re.compile(r"(?:^|[,;\s])respond-async(?:$|[,;\s])", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Preference:
    """How long to wait for an answer, in seconds, and what of `Prefer` was applied."""

    wait: float
    applied: str


def preference_of(request: Request) -> Preference:
    """`Prefer: respond-async` and `wait=S`, of which at most 20 s are applied. Others are ignored (RFC 7240)."""
    text = ", ".join(request.headers.getlist("prefer"))
    found = WAIT.search(text)
    seconds = min(float(found[1]), MAX_WAIT) if found else 0.0
    applied = f"wait={seconds:g}" if found else ""
    if ASYNC.search(text):
        # RFC 7240: with both, the answer may come within the time.
        return Preference(seconds, ", ".join(part for part in ("respond-async", applied) if part))
    return Preference(seconds, applied) if found else Preference(DEFAULT_WAIT, "")


def wants_fresh(request: Request) -> bool:
    """`Cache-Control: no-cache`: the question is to be computed again."""
    directives = {part.strip().lower() for part in request.headers.get("cache-control", "").split(",")}
    return bool(directives & {"no-cache", "no-store"})


def batch_key_of(request: Request) -> str:
    """`Idempotency-Key`: batches of the same lines are told apart by it; asked again without one, all are."""
    given = request.headers.get("idempotency-key", "")
    if len(given) > LARGEST_KEY:
        raise Refusal(422, "limit", f"The header 'Idempotency-Key' takes at most {LARGEST_KEY} characters.")
    return given or (uuid.uuid4().hex if wants_fresh(request) else "")


def time_limit_of(request: Request, server: JobOptions) -> float | None:
    """What the query `time_limit` asks for, which goes before the document's; None where it says nothing."""
    text = request.query_params.get("time_limit")
    if text is None:
        return None
    try:
        return read_time_limit(_number(text), server.time_limit)
    except InputError as error:
        raise Refusal(422, "limit", error.detail) from None


def _number(text: str) -> float:
    """A number as JSON writes it; NaN for what Python alone would read, such as 1_0 and foreign digits."""
    return float(text) if len(text) < 30 and NUMBER.fullmatch(text) else float("nan")
