"""Where compiled kernels are: in a library that came with the installation, or in the user's store
on disk, and whether they are all there.

The library for this processor was built with the wheel, and its index lists the kernels:

    kernels.json     {"kernels": [{"name", "kinds", "answer", "symbol"}], "sources": {file:
    SHA-256}} kernels-TARGET.so   TARGET is one of `TARGETS`; the best one that this processor runs
    is loaded

A checkout has no library; numba compiles its kernels at their first use. The store has them by
digest, and a damaged or foreign entry is ignored.
"""

import contextlib
import ctypes
import hashlib
import json
import os
import platform
import sys
import tempfile
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from inverse_service import __version__

# Machine code: maps the words of the arguments to the result.
Entry = Callable[[list[int]], Any]
FOLDER, CPUINFO = Path(__file__).parent / "compiled", Path("/proc/cpuinfo")
# Names of processors for LLVM with the flags of /proc/cpuinfo that they need, best first.
# Elimination takes half the time with 512-bit vectors; v2 and v3 do not speed it up.
_WIDE = frozenset({"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"})
TARGETS: dict[str, tuple[tuple[str, frozenset[str]], ...]] = {
    "x86_64": (("x86-64-v4", _WIDE), ("x86-64", frozenset())),
    "aarch64": (("generic", frozenset()),),
}
ANSWERS: dict[str, Callable[[int], Any]] = {
    "none": lambda answer: None,
    "int64": int,
    "uint64": int,
    "bool": bool,
}
_MAGIC = b"inverse-service/kernel/2\n"
_VARIABLE = "INVERSE_SERVICE_CACHE"
MOST_ENTRIES = 2000
# Write permissions for group and others, which a folder of compiled code must not have.
_WRITABLE = 0o022
# The package, and the folders in it where kernels are defined.
ROOT = Path(__file__).parents[2]
_FOLDERS = ("field", "search", "linear_pde")
# The kind of the entry that says whether all kernels are compiled.
_WARM = "warm"
SENTENCE = "Compiling for this machine, once; this takes about 20 seconds of processor time."
_NOTHING_KEPT = (
    "Compiling takes about 20 seconds at every start: {} cannot be written. "
    "Set INVERSE_SERVICE_CACHE to a folder of yours that can, or install the wheel of this platform."
)


def has_library() -> bool:
    return bool(library(FOLDER))


def library_entry(name: str, kinds: Sequence[Any]) -> Entry | None:
    """The kernel of this name for arguments of these kinds (`kernels.told`), or None if the library
    has none.
    """
    return library(FOLDER).get((name, json.dumps(kinds)))


def called(where: Any, answer: str) -> Entry:
    """The machine code at an address, or of (a name, its library), as a function of the words of
    its arguments.
    """
    result = ctypes.c_uint64 if answer == "uint64" else ctypes.c_int64
    function = ctypes.PYFUNCTYPE(result, ctypes.c_void_p)(where)
    finished = ANSWERS[answer]

    def entry(words: list[int]) -> Any:
        block = array("Q", words)
        return finished(function(block.buffer_info()[0]))

    return entry


@lru_cache(maxsize=1)
def library(folder: Path) -> dict[tuple[str, str], Entry]:
    """The kernels in the index; empty if there is no library for this processor or it was built
    from other sources.
    """
    try:
        index = json.loads((folder / "kernels.json").read_text(encoding="utf-8"))
        if index["sources"] != {
            name: digest(name) for name in index["sources"]
        } or not sys.platform.startswith("linux"):
            return {}
        flags = processor_flags()
        target = next(name for name, needed in TARGETS[platform.machine()] if needed <= flags)
        library = ctypes.PyDLL(str(folder / f"kernels-{target}.so"))
    except (OSError, ValueError, KeyError, StopIteration):
        return {}
    return {
        (one["name"], json.dumps(one["kinds"])): called((one["symbol"], library), one["answer"])
        for one in index["kernels"]
    }


def digest(name: str) -> str:
    """SHA-256 of a file of the package, named from its root."""
    return hashlib.sha256((ROOT / name).read_bytes()).hexdigest()


def processor_flags() -> frozenset[str]:
    """The features of the processor as Linux names them; empty if Linux lists none."""
    try:
        lines = CPUINFO.read_text().splitlines()
    except OSError:
        return frozenset()
    flags = (line for line in lines if line.startswith(("flags", "Features")))
    return frozenset(next(flags, "").partition(":")[2].split())


def cache_directory(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> Path:
    """INVERSE_SERVICE_CACHE, else the cache folder of the platform."""
    if environment.get(_VARIABLE):
        return Path(environment[_VARIABLE]).expanduser()
    if platform == "win32":
        return (
            Path(environment.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
            / "inverse-service"
            / "Cache"
        )
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

    Folder and file are opened once, not through links, and the open files are examined: the user
    owns both, and only the user can write to the folder.
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


def store_entry(digest: str, noted: Mapping[str, Any], code: bytes, kind: str = "kernel") -> None:
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
    if len(entries) < MOST_ENTRIES:
        return
    entries.sort(key=lambda path: path.stat().st_mtime)
    for path in entries[: len(entries) // 2]:
        path.unlink(missing_ok=True)


def is_warm() -> bool:
    """Whether the kernels came with the program, or were compiled here."""
    found = None if has_library() else read(_stamp(), _WARM)
    return has_library() or (found is not None and bool(found[0].get("done")))


def can_keep() -> bool:
    """Whether this user's store takes what is compiled; elsewhere every process compiles again."""
    stamp = _stamp()
    store_entry(stamp, {"done": False}, b"", _WARM)
    return read(stamp, _WARM) is not None


def mark_warm() -> None:
    """All kernels are compiled."""
    store_entry(_stamp(), {"done": True}, b"", _WARM)


def warm_first(say: Callable[[str], None], work: Callable[[], object]) -> None:
    """Compile what is missing before the clock of a question starts, and say so."""
    if not is_warm():
        if can_keep():
            say(SENTENCE)
            work()
        else:
            say(_NOTHING_KEPT.format(cache_directory_name()))


def _stamp() -> str:
    """Other code, another Python or another processor need other kernels."""
    files = [
        entry
        for folder in _FOLDERS
        for entry in os.scandir(ROOT / folder)
        if entry.name.endswith(".py")
    ]
    newest = max(entry.stat().st_mtime_ns for entry in files)
    processor = platform.machine(), platform.processor(), *sorted(processor_flags())
    about = (__version__, str(newest), sys.implementation.cache_tag or "", *processor)
    return hashlib.sha256("\x00".join(about).encode()).hexdigest()
