"""Compiles the modular kernels of this installation before any clock runs, once for a machine and a version."""

import hashlib
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path

from inverse_service import __version__, catalogue
from inverse_service.kernels.machine_code import code_store, shipped

# Together these systems need all kernels.
SYSTEMS = ("sho", "douglas-iiib", "nonholonomic-particle-second", "van-der-pol")
# Where kernels are defined.
FOLDERS = ("field", "search", "linear_pde")
SENTENCE = "Compiling for this machine, once; this takes some 20 seconds of processor time."
NOTHING_KEPT = (
    f"Compiling takes some 20 seconds at every start: {code_store.cache_directory_name()} cannot be written. "
    "Set INVERSE_SERVICE_CACHE to a folder of yours that can, or install the wheel of this platform."
)
# Far more than it takes on a slow machine that does other work, s.
PATIENCE = 900.0
KIND = "warm"


def is_warm() -> bool:
    """Whether the kernels came with the program, or were compiled here."""
    found = None if shipped.is_available() else code_store.read(_stamp(), KIND)
    return shipped.is_available() or (found is not None and bool(found[0].get("done")))


def can_keep() -> bool:
    """Whether this user's store takes what is compiled; elsewhere every process compiles again."""
    stamp = _stamp()
    code_store.write(stamp, {"done": False}, b"", KIND)
    return code_store.read(stamp, KIND) is not None


def warm_up() -> None:
    """Solve the systems; each kernel is kept as soon as it is compiled."""
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.documents.documents import solve_document

    for name in SYSTEMS:
        solve_document(catalogue.document(name), SolveOptions(time_limit=PATIENCE))
    code_store.write(_stamp(), {"done": True}, b"", KIND)


def warm_first(say: Callable[[str], None], work: Callable[[], object]) -> None:
    """Compile what is missing before the clock of a question starts, and say so."""
    if not is_warm():
        if can_keep():
            say(SENTENCE)
            work()
        else:
            say(NOTHING_KEPT)


def _stamp() -> str:
    """Other code, another Python or another processor need other kernels."""
    root = Path(code_store.__file__).parents[2]
    files = [entry for folder in FOLDERS for entry in os.scandir(root / folder) if entry.name.endswith(".py")]
    newest = max(entry.stat().st_mtime_ns for entry in files)
    processor = platform.machine(), platform.processor(), *sorted(shipped.processor_flags())
    about = (__version__, str(newest), sys.implementation.cache_tag or "", *processor)
    return hashlib.sha256("\x00".join(about).encode()).hexdigest()
