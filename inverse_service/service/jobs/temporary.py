"""Stores in the temporary folder, which live as long as their process, and what killed ones left behind."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from inverse_service.service.jobs.model import DatabaseTaken
from inverse_service.service.jobs.sqlite_store import SupervisorLock

PREFIX = "inverse-service-"
NAME = "jobs.sqlite"
# A new folder has its lock within a moment; s.
YOUNG = 60.0


@contextlib.contextmanager
def temporary_database() -> Iterator[Path]:
    """The path of a database in a new folder, which is removed at the end; so is what killed processes left."""
    remove_abandoned()
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    try:
        yield folder / NAME
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_abandoned() -> None:
    """Remove this user's temporary stores whose process is gone: the kernel has given their locks back."""
    with contextlib.suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            if _is_ours(folder) and _is_abandoned(folder / NAME):
                shutil.rmtree(folder, ignore_errors=True)


def _is_ours(folder: Path) -> bool:
    """A folder, not a link to one, of this user, that is no other program's."""
    with contextlib.suppress(OSError):
        found = folder.lstat()
        names = {path.name for path in folder.iterdir()} if stat.S_ISDIR(found.st_mode) else set()
        is_store = all(name.startswith(NAME) for name in names)
        return is_store and _user_has(found) and time.time() - found.st_mtime > YOUNG
    return False


def _user_has(found: os.stat_result) -> bool:
    return not hasattr(os, "getuid") or found.st_uid == os.getuid()


def _is_abandoned(database: Path) -> bool:
    if os.name != "posix" or not database.exists():
        return False  # without flock nobody can tell
    try:
        SupervisorLock(database).release()
    except (OSError, DatabaseTaken):
        return False
    return True
