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


def program_directory() -> Path:
    """A place beside the program: an installation that is filled once serves all its users."""
    return Path(__file__).parent / "__pycache__"


def read(digest: str, kind: str = "kernel", with_program: bool = False) -> tuple[dict[str, Any], bytes] | None:
    """(what was noted, object code) of an entry, None where there is none that is whole.

    It is sought in the cache, and `with_program` also beside the program.
    """
    name = f"{digest}.{kind}"
    beside = _entry(program_directory() / name, digest, _owner_of_program()) if with_program else None
    if beside is not None:
        return beside
    try:
        return _entry(cache_directory() / name, digest, _user())
    except RuntimeError:  # there is no home
        return None


def _entry(path: Path, digest: str, owner: int) -> tuple[dict[str, Any], bytes] | None:
    """Machine code is run only where nobody else could have put it: of the user, or of who owns the program."""
    try:
        return _unpacked(path.read_bytes(), digest) if owner in (-1, path.stat().st_uid) else None
    except (OSError, ValueError):
        return None


def _user() -> int:
    """The number of the user, -1 where there is none."""
    return os.getuid() if hasattr(os, "getuid") else -1


def _owner_of_program() -> int:
    return Path(__file__).stat().st_uid if hasattr(os, "getuid") else -1


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


def write(digest: str, noted: Mapping[str, Any], code: bytes, kind: str = "kernel", with_program: bool = False) -> None:
    """Keep an entry; a disk that is full or read-only costs time only. Kinds do not push each other out.

    `with_program` beside the program, where it is the user's own and no cache was named.
    """
    text = json.dumps(noted).encode()
    body = len(text).to_bytes(8, "little") + text + code
    content = _MAGIC + _seal(digest, body) + body
    own = with_program and not os.environ.get(_VARIABLE) and _owner_of_program() == _user()
    if not (own and _written(program_directory(), digest, content, kind, 0o755)):
        with contextlib.suppress(RuntimeError):  # there is no home
            _written(cache_directory(), digest, content, kind, 0o700)


def _written(directory: Path, digest: str, content: bytes, kind: str, mode: int) -> bool:
    try:
        directory.mkdir(parents=True, exist_ok=True, mode=mode)
        _prune(directory, kind)
        handle, name = tempfile.mkstemp(dir=directory)
    except OSError:
        return False
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        Path(name).chmod(mode & 0o666)
        os.replace(name, directory / f"{digest}.{kind}")
    except OSError:
        Path(name).unlink(missing_ok=True)
        return False
    return True


def _prune(directory: Path, kind: str) -> None:
    """The oldest half goes when there are too many."""
    entries = list(directory.glob(f"*.{kind}"))
    if len(entries) < _MOST_ENTRIES:
        return
    entries.sort(key=lambda path: path.stat().st_mtime)
    for path in entries[: len(entries) // 2]:
        path.unlink(missing_ok=True)
