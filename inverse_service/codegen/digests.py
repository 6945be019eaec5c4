"""Digests of what a kernel is made from, so that a cached one is never the wrong one."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from inverse_service.machine_code.processor import processor_name

_ROOMS = ("codegen", "machine_code", "integrators", "simulation", "expressions")


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Of our own sources that take part, of LLVM and of the processor."""
    digest = hashlib.sha256()
    root = Path(__file__).parent.parent
    for room in _ROOMS:
        for path in sorted((root / room).rglob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    digest.update(processor_name().encode())
    return digest.hexdigest()


def digest_of(*parts: object) -> str:
    """SHA-256 of the parts' texts and of the code."""
    digest = hashlib.sha256(code_digest().encode())
    for part in parts:
        digest.update(repr(part).encode() + b"\0")
    return digest.hexdigest()
