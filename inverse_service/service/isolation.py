"""What a worker process does to itself before it works: memory bound, no core file, no orphans."""

from __future__ import annotations

import contextlib
import ctypes
import signal
import sys

PR_SET_PDEATHSIG = 1


def isolate(memory_limit: int) -> None:
    """Bound the address space to `memory_limit` MiB, write no core file, die with the parent.

    Where the system has no such limits (Windows, partly macOS) a step is left out.
    """
    _limit_memory(memory_limit)
    die_with_parent()


def die_with_parent() -> None:
    """Have the kernel kill this process when the thread that started it ends (Linux only).

    Without it a worker that spins in C outlives a service that was killed with SIGKILL.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _limit_memory(memory_limit: int) -> None:
    try:
        import resource
    except ImportError:
        return
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (memory_limit * 2**20, memory_limit * 2**20))
