"""Compile the kernels of the solver ahead of time: `python -m inverse_service.service.jobs.shipping [FOLDER]`.

The systems of `warming` are solved, which needs every kernel; each kernel is compiled for each target of
`shipped.TARGETS`, and all are linked to one shared library. Needs numba, and `ld` or the package ziglang.
"""

from __future__ import annotations

import json
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from inverse_service.kernels.machine_code import building, kernels, loading, shipped
from inverse_service.service.jobs import warming

# What numba says of the processor at hand stands in attributes of each function.
HOST = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
ROOT = Path(shipped.__file__).parents[2]


def ship(folder: Path) -> list[Path]:
    """Write index and libraries for the processors of this platform; the files."""
    warming.warm_up()
    loading.target_machine()  # initializes LLVM
    texts, listed, sources = list[tuple[str, str]](), list[dict[str, Any]](), set[str]()
    for kernel in kernels.KERNELS:
        for kinds in kernel.entries:
            symbol = f"kernel_{len(listed)}"
            module, answer = building.module_of(kernel.made(), kinds, symbol)
            texts.append((symbol, HOST.sub("", str(module))))
            listed.append({"name": kernel.name, "kinds": kernels.told(kinds), "answer": answer, "symbol": symbol})
    for kernel in kernels.KERNELS:  # whichever calls which: all files that define one
        sources.add(Path(kernel.py_func.__code__.co_filename).relative_to(ROOT).as_posix())
    folder.mkdir(parents=True, exist_ok=True)
    index = folder / "kernels.json"
    digests = {name: shipped.digest(name) for name in sorted(sources)}
    index.write_text(json.dumps({"kernels": listed, "sources": digests}), encoding="utf-8")
    targets = shipped.TARGETS[platform.machine()]
    return [index, *(linked(texts, target, folder / f"kernels-{target}.so") for target, _ in targets)]


def linked(texts: list[tuple[str, str]], target: str, path: Path) -> Path:
    """The shared library of all kernels for a processor."""
    machine: Any = llvm.Target.from_default_triple().create_target_machine(cpu=target, opt=3, reloc="pic")
    whole: Any = None
    for symbol, text in texts:
        module = llvm.parse_assembly(text)
        building.reduce(module, machine, symbol)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    with tempfile.TemporaryDirectory() as name:
        code = Path(name) / "kernels.o"
        code.write_bytes(machine.emit_object(whole))
        linker = [shutil.which("ld")] if shutil.which("ld") else [sys.executable, "-m", "ziglang", "cc"]
        subprocess.run([*map(str, linker), "-shared", "-s", "-o", str(path), str(code)], check=True)
    return path


if __name__ == "__main__":
    print(*ship(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped.FOLDER), sep="\n")
