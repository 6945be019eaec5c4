"""Compiled kernels on disk, by digest; a damaged or foreign entry is as good as none."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_MAGIC = b"inverse-service/kernel/1\n"
_VARIABLE = "INVERSE_SERVICE_CACHE"
_MOST_ENTRIES = 2000


def cache_directory(environment: Mapping[str, str] = os.environ, platform: str = sys.platform) -> Path:
    """INVERSE_SERVICE_CACHE, else the platform's place for what can be made again."""
    if environment.get(_VARIABLE):
        return Path(environment[_VARIABLE]).expanduser()
    if platform == "win32":
        return Path(environment.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "inverse-service" / "Cache"
    if platform == "darwin":
        return Path.home() / "Library" / "Caches" / "inverse-service"
    return Path(environment.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "inverse-service"


def read(digest: str, kind: str = "kernel") -> tuple[dict[str, Any], bytes] | None:
    """(what was noted, object code) of an entry, None where there is none that is whole."""
    try:
        path = cache_directory() / f"{digest}.{kind}"
        return _unpacked(path.read_bytes(), digest) if _is_ours(path) else None
    except (OSError, ValueError, RuntimeError):
        return None


def _is_ours(path: Path) -> bool:
    """Machine code is run only where nobody else could have put it."""
    return not hasattr(os, "getuid") or path.stat().st_uid == os.getuid()


def _unpacked(content: bytes, digest: str) -> tuple[dict[str, Any], bytes] | None:
    head = len(_MAGIC)
    seal, body = content[head : head + 64], content[head + 64 :]
    if content[:head] != _MAGIC or _seal(digest, body) != seal:
        return None
    length = int.from_bytes(body[:8], "little")
    noted = json.loads(body[8 : 8 + length])
    return (noted, body[8 + length :]) if isinstance(noted, dict) else None


def _seal(digest: str, body: bytes) -> bytes:
    return hashlib.sha256(digest.encode() + body).hexdigest().encode()


def write(digest: str, noted: Mapping[str, Any], code: bytes, kind: str = "kernel") -> None:
    """Keep an entry; a disk that is full or read-only costs time only. Kinds do not push each other out."""
    text = json.dumps(noted).encode()
    body = len(text).to_bytes(8, "little") + text + code
    with contextlib.suppress(OSError, RuntimeError):
        directory = cache_directory()
        directory.mkdir(parents=True, exist_ok=True, mode=0o700)
        _prune(directory, kind)
        handle, name = tempfile.mkstemp(dir=directory)
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(_MAGIC + _seal(digest, body) + body)
            os.replace(name, directory / f"{digest}.{kind}")
        except OSError:
            Path(name).unlink(missing_ok=True)


def _prune(directory: Path, kind: str) -> None:
    """The oldest half goes when there are too many."""
    entries = list(directory.glob(f"*.{kind}"))
    if len(entries) < _MOST_ENTRIES:
        return
    entries.sort(key=lambda path: path.stat().st_mtime)
    for path in entries[: len(entries) // 2]:
        path.unlink(missing_ok=True)
