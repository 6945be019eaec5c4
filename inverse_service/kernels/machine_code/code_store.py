"""Compiled kernels on disk, by digest. A damaged or foreign entry is ignored."""

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

_MAGIC = b"inverse-service/kernel/2\n"
_VARIABLE = "INVERSE_SERVICE_CACHE"
_MOST_ENTRIES = 2000
# Write permissions for group and others, which a folder of compiled code must not have.
_WRITABLE = 0o022


def cache_directory(environment: Mapping[str, str] = os.environ, platform: str = sys.platform) -> Path:
    """INVERSE_SERVICE_CACHE, else the cache folder of the platform."""
    if environment.get(_VARIABLE):
        return Path(environment[_VARIABLE]).expanduser()
    if platform == "win32":
        return Path(environment.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "inverse-service" / "Cache"
    if platform == "darwin":
        return Path.home() / "Library" / "Caches" / "inverse-service"
    return Path(environment.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "inverse-service"


def cache_directory_name() -> str:
    """The name of the folder for messages, also if there is no home directory."""
    try:
        return str(cache_directory())
    except RuntimeError:
        return "the user's cache folder"


def read(digest: str, kind: str = "kernel") -> tuple[dict[str, Any], bytes] | None:
    """(notes, object code) of an entry, or None if there is no undamaged one."""
    try:
        return _unpacked(_content(cache_directory(), f"{digest}.{kind}"), digest)
    except RuntimeError:  # there is no home
        return None


def _content(directory: Path, name: str) -> bytes | None:
    """The bytes of an entry. Machine code is run only if no other user could have written it.

    Folder and file are opened once, not through links, and the open files are examined: the user owns both, and only
    the user can write to the folder.
    """
    try:
        if not hasattr(os, "getuid"):
            return (directory / name).read_bytes()
        folder = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            found = os.fstat(folder)
            if found.st_uid != os.getuid() or found.st_mode & _WRITABLE:
                return None
            entry = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
            with os.fdopen(entry, "rb") as stream:
                return stream.read() if os.fstat(entry).st_uid == os.getuid() else None
        finally:
            os.close(folder)
    except OSError:
        return None


def _unpacked(content: bytes | None, digest: str) -> tuple[dict[str, Any], bytes] | None:
    """The parts of an entry, or None if it is damaged or belongs to another digest."""
    head = len(_MAGIC)
    if content is None:
        return None
    seal, body = content[head : head + 64], content[head + 64 :]
    if content[:head] != _MAGIC or _seal(digest, body) != seal:
        return None
    text, _, code = body.partition(b"\n")
    return json.loads(text), code


def digest_of_files(paths: Iterable[Path], *others: bytes) -> str:
    """SHA-256 of names and contents, and of the additional texts."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    for other in others:
        digest.update(other)
    return digest.hexdigest()


def _seal(digest: str, body: bytes) -> bytes:
    return hashlib.sha256(digest.encode() + body).hexdigest().encode()


def write(digest: str, noted: Mapping[str, Any], code: bytes, kind: str = "kernel") -> None:
    """Store an entry.

    A full or read-only disk costs only time. Entries of one kind do not displace those of another.
    """
    body = json.dumps(noted).encode() + b"\n" + code
    with contextlib.suppress(OSError, RuntimeError):  # RuntimeError: there is no home
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
    """Delete the oldest half if there are too many."""
    entries = list(directory.glob(f"*.{kind}"))
    if len(entries) < _MOST_ENTRIES:
        return
    entries.sort(key=lambda path: path.stat().st_mtime)
    for path in entries[: len(entries) // 2]:
        path.unlink(missing_ok=True)
