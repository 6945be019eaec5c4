"""Locks that the kernel gives back however their holder dies: of a database, and of a folder for
temporary files.
"""

import contextlib
import functools
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from inverse_service.service.jobs.model import DatabaseTaken

PREFIX = "inverse-service-"
# multiprocessing makes such a folder for its sockets, and leaves it where the process is killed.
SOCKETS = "pymp-"
DATABASE = "jobs.sqlite"
HOLDER = "holder"
# What a temporary folder of ours has in it.
CONTENTS = (HOLDER, DATABASE, "listener-")
# A new folder has its lock within a moment; s.
YOUNG = 60.0


def take(path: Path) -> int:
    """Be the one supervisor of a database, by a flock on `path` + ".lock"; its descriptor, or
    DatabaseTaken.

    The kernel gives it back however its holder dies. The file stays, as removing it would let two
    in.
    """
    descriptor = os.open(f"{path}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        lock(descriptor)
    except OSError:
        os.close(descriptor)
        detail = "Another service works on this database; stop it, or set INVERSE_SERVICE_DATABASE to another file."
        raise DatabaseTaken(detail) from None
    return descriptor


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """Be the one supervisor to the end of the context."""
    descriptor = take(path)
    try:
        yield
    finally:
        os.close(descriptor)


def lock(descriptor: int) -> None:
    """Have an open file for this process alone; raises OSError where another one has it."""
    try:
        import fcntl
    except ImportError:  # no flock on this system: the address of the service is the only guard
        return
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """A new folder that is removed at the end; so is what killed processes left."""
    remove_abandoned()
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    with alone(folder / HOLDER):
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


@functools.cache
def hold(folder: Path) -> int:
    """Have a folder that somebody else made and removes: it is abandoned when this process is
    gone.
    """
    remove_abandoned()
    return take(folder / HOLDER)


def remove_abandoned() -> None:
    """Remove this user's temporary folders whose process is gone: the kernel has given their locks
    back.
    """
    with contextlib.suppress(OSError):
        place = Path(tempfile.gettempdir())
        for folder in (*place.glob(f"{PREFIX}*"), *place.glob(f"{SOCKETS}*")):
            if _is_ours(folder) and _is_abandoned(folder / HOLDER):
                shutil.rmtree(folder, ignore_errors=True)


def _is_ours(folder: Path) -> bool:
    """A folder, not a link to one, of this user, that is no other program's."""
    with contextlib.suppress(OSError):
        found = folder.lstat()
        names = {path.name for path in folder.iterdir()} if stat.S_ISDIR(found.st_mode) else set()
        is_known = all(name.startswith(CONTENTS) for name in names)
        is_own = not hasattr(os, "getuid") or found.st_uid == os.getuid()
        return is_known and is_own and time.time() - found.st_mtime > YOUNG
    return False


def _is_abandoned(held: Path) -> bool:
    if os.name != "posix" or not held.with_name(f"{held.name}.lock").exists():
        return False  # without flock nobody can tell
    with contextlib.suppress(OSError, DatabaseTaken), alone(held):
        return True
    return False
