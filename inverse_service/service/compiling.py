"""The kernels of this installation: compiled once on a machine before any clock runs, or ahead of
time for a wheel.

`python -m inverse_service.service.compiling [FOLDER [MACHINE]]` solves SYSTEMS, which needs every
kernel, compiles each one for each target of `code_store.TARGETS`, and links all to one shared
library. MACHINE is x86_64 or aarch64, this one if it is not given. Needs numba, and a linker: `ld`,
for another machine its cross linker (`aarch64-linux-gnu-ld`), or the package ziglang.
"""

import json
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from inverse_service import catalogue
from inverse_service.kernels.machine_code import code_store

# Together these systems need all kernels.
SYSTEMS = ("sho", "douglas-iiib", "nonholonomic-particle-second", "van-der-pol")
# Far more than it takes on a slow machine that does other work, s.
PATIENCE = 900.0
# What numba says of the processor at hand: attributes of each function, two lines at the head of a
# module.
HOST = re.compile(
    r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"|^target (?:triple|datalayout) = .*$',
    re.MULTILINE,
)


def warm_up() -> None:
    """Solve the systems; each kernel is kept as soon as it is compiled."""
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.documents.documents import solve_document

    for name in SYSTEMS:
        solve_document(catalogue.document(name), SolveOptions(time_limit=PATIENCE))
    code_store.mark_warm()


def ship(folder: Path, machine: str) -> list[Path]:
    """Write index and libraries for the processors of a platform; the files."""
    import llvmlite.binding as llvm

    from inverse_service.kernels.machine_code import argument_kinds, building, kernels

    warm_up()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    texts, listed, sources = list[tuple[str, str]](), list[dict[str, Any]](), set[str]()
    for kernel in kernels.KERNELS:
        for kinds in kernel.entries:
            symbol = f"kernel_{len(listed)}"
            module, answer = building.module_of(kernel.made(), kinds, symbol)
            texts.append((symbol, HOST.sub("", str(module))))
            listed.append(
                {
                    "name": kernel.name,
                    "kinds": argument_kinds.told(kinds),
                    "answer": answer,
                    "symbol": symbol,
                }
            )
    for kernel in kernels.KERNELS:  # whichever calls which: all files that define one
        sources.add(
            Path(kernel.py_func.__code__.co_filename).relative_to(code_store.ROOT).as_posix()
        )
    folder.mkdir(parents=True, exist_ok=True)
    index = folder / "kernels.json"
    digests = {name: code_store.digest(name) for name in sorted(sources)}
    index.write_text(json.dumps({"kernels": listed, "sources": digests}), encoding="utf-8")
    return [
        index,
        *(
            linked(texts, machine, cpu, folder / f"kernels-{cpu}.so")
            for cpu, _ in code_store.TARGETS[machine]
        ),
    ]


def linked(texts: list[tuple[str, str]], machine: str, cpu: str, path: Path) -> Path:
    """The shared library of all kernels for a processor."""
    import llvmlite.binding as llvm

    from inverse_service.kernels.machine_code import building

    triple = f"{machine}-unknown-linux-gnu"
    target: Any = llvm.Target.from_triple(triple).create_target_machine(cpu=cpu, opt=3, reloc="pic")
    whole: Any = None
    for symbol, text in texts:
        module = llvm.parse_assembly(text)
        module.triple, module.data_layout = triple, str(target.target_data)
        building.reduce(module, target, symbol)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    with tempfile.TemporaryDirectory() as name:
        code = Path(name) / "kernels.o"
        code.write_bytes(target.emit_object(whole))
        found = shutil.which("ld" if machine == platform.machine() else f"{machine}-linux-gnu-ld")
        linker = (
            [found]
            if found
            else [sys.executable, "-m", "ziglang", "cc", "-target", f"{machine}-linux-gnu"]
        )
        subprocess.run([*linker, "-shared", "-s", "-o", str(path), str(code)], check=True)
    return path


if __name__ == "__main__":
    chosen = dict(enumerate(sys.argv))
    print(
        *ship(Path(chosen.get(1, code_store.FOLDER)), chosen.get(2, platform.machine())), sep="\n"
    )
