"""One supervisor for a database: a lock that the kernel gives back when its holder dies, however it dies."""

from __future__ import annotations

import os
from pathlib import Path

from inverse_service.service.jobs.model import DatabaseTaken


class SupervisorLock:
    """An exclusive flock on `path` + ".lock", held until `release` or the end of the process."""

    def __init__(self, path: Path) -> None:
        self._descriptor: int | None = os.open(f"{path}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            _lock(self._descriptor)
        except OSError:
            self.release()
            raise DatabaseTaken(
                "Another service works on this database; stop it, or set INVERSE_SERVICE_DATABASE to another file."
            ) from None

    def release(self) -> None:
        """Let the next one in; the file stays, as removing it would let two in."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _lock(descriptor: int) -> None:
    try:
        import fcntl
    except ImportError:  # no flock on this system: the address of the service is the only guard
        return
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
