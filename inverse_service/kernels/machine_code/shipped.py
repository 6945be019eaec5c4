"""The kernels that were compiled when the wheel was built: a shared library for this processor, and its index.

    kernels.json     {"kernels": [{"name", "kinds", "answer", "symbol"}], "sources": {file: SHA-256}}
    kernels-TARGET.so   TARGET is one of `TARGETS`; the best one that this processor runs is loaded

A checkout has no library; numba compiles its kernels at their first use.
"""

import ctypes
import hashlib
import json
import platform
import sys
from array import array
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from inverse_service.kernels.machine_code import kernels

FOLDER, CPUINFO = Path(__file__).parent / "compiled", Path("/proc/cpuinfo")
# Names of processors for LLVM with the flags of /proc/cpuinfo that they need, best first. Elimination takes half the
# time with 512-bit vectors; v2 and v3 do not speed it up.
_WIDE = frozenset({"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"})
TARGETS: dict[str, tuple[tuple[str, frozenset[str]], ...]] = {
    "x86_64": (("x86-64-v4", _WIDE), ("x86-64", frozenset())),
    "aarch64": (("generic", frozenset()),),
}
ANSWERS: dict[str, Callable[[int], Any]] = {"none": lambda answer: None, "int64": int, "uint64": int, "bool": bool}


def is_available() -> bool:
    return bool(library(FOLDER))


def entry(name: str, kinds: kernels.Kinds) -> kernels.Entry | None:
    """The kernel of this name for arguments of these kinds, or None if the library has none."""
    return library(FOLDER).get((name, json.dumps(kernels.told(kinds))))


def called(where: Any, answer: str) -> kernels.Entry:
    """The machine code at an address, or of (a name, its library), as a function of the words of its arguments."""
    result = ctypes.c_uint64 if answer == "uint64" else ctypes.c_int64
    function = ctypes.PYFUNCTYPE(result, ctypes.c_void_p)(where)
    finished = ANSWERS[answer]

    def entry(words: list[int]) -> Any:
        block = array("Q", words)
        return finished(function(block.buffer_info()[0]))

    return entry


@lru_cache(maxsize=1)
def library(folder: Path) -> dict[tuple[str, str], kernels.Entry]:
    """The kernels in the index; empty if there is no library for this processor or it was built from other sources."""
    try:
        index = json.loads((folder / "kernels.json").read_text(encoding="utf-8"))
        if index["sources"] != {name: digest(name) for name in index["sources"]} or not sys.platform.startswith(
            "linux"
        ):
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
    return hashlib.sha256((Path(__file__).parents[2] / name).read_bytes()).hexdigest()


def processor_flags() -> frozenset[str]:
    """The features of the processor as Linux names them; empty if Linux lists none."""
    try:
        lines = CPUINFO.read_text().splitlines()
    except OSError:
        return frozenset()
    flags = (line for line in lines if line.startswith(("flags", "Features")))
    return frozenset(next(flags, "").partition(":")[2].split())
