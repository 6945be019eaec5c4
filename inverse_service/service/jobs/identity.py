"""The id of a job: a hash of the engine, the canonical document and the options; a batch's, of its jobs.

The same question has the same id, so it is answered from the store, and its link is permanent.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

from inverse_service import __version__
from inverse_service.service.jobs.model import BatchLine

DIGITS = 40
# A new page or command does not make an answer another one.
NOT_THE_ENGINE = frozenset({"web", "cli", "client", "benchmark", "service/jobs"})


def canonical(value: Any) -> str:
    """JSON with sorted keys and without spaces."""
    return write_json(value, sort=True)


def write_json(value: Any, sort: bool = False) -> str:
    """Plain data as JSON in ASCII; a Decimal is written as the number it was read from."""
    if isinstance(value, Mapping):
        keys = sorted(value) if sort else list(value)
        return "{" + ",".join(f"{json.dumps(key)}:{write_json(value[key], sort)}" for key in keys) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(write_json(part, sort) for part in value) + "]"
    return str(value) if isinstance(value, Decimal) else json.dumps(value, allow_nan=False)


def job_id(kind: str, document: Any, options: str) -> str:
    """The id: 40 hexadecimal digits. `options` are canonical JSON already."""
    parts = (engine_version(), kind, canonical(document), canonical(_order(document)), options)
    return hashlib.sha256("\x00".join(parts).encode()).hexdigest()[:DIGITS]


def document_digest(document: Any) -> str:
    """A hash of what is asked, whoever answers it: 64 hexadecimal digits."""
    return hashlib.sha256(f"{canonical(document)}\x00{canonical(_order(document))}".encode()).hexdigest()


def batch_id(kind: str, client: str, lines: Sequence[BatchLine], key: str, generation: int) -> str:
    """The id of a client's batch, so that one that is sent again after a lost answer is not stored twice.

    `key` tells batches of the same lines apart; `generation` counts those with cancelled lines before it.
    """
    digest = hashlib.sha256("\x00".join(("batch", kind, client, key, str(generation))).encode())
    for line in lines:
        question = line.problem or b"" if line.request is None else line.request.id.encode()
        digest.update(f"\n{line.number}\x00{line.identifier}\x00".encode() + question)
    return digest.hexdigest()[:DIGITS]


@functools.cache
def engine_version() -> str:
    """The version and a digest of the program's text, so that a changed engine answers anew."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if not any(name.startswith(part + "/") for part in NOT_THE_ENGINE):
            digest.update(name.encode() + b"\x00" + path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:12]}"


def _order(document: Any) -> list[str]:
    """Keys whose order means something: equations by coordinate where no coordinates are given."""
    if not isinstance(document, Mapping) or document.get("coordinates") is not None:
        return []
    equations = document.get("equations")
    return list(equations) if isinstance(equations, Mapping) else []
