"""The processor that machine code is made for."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm


@lru_cache(maxsize=1)
def processor_features() -> str:
    return str(llvm.get_host_cpu_features().flatten())


@lru_cache(maxsize=1)
def processor_name() -> str:
    """The processor, and LLVM with its binding: code for one is not code for another."""
    machine = (llvmlite.__version__, llvm.llvm_version_info, llvm.get_host_cpu_name(), processor_features())
    return repr(machine)


def target_machine(level: int = 2) -> Any:
    """A new one each time: an engine takes its target machine for its own and ends it with itself."""
    _initialize()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=processor_features(), opt=level, reloc="pic", codemodel="jitdefault"
    )


@lru_cache(maxsize=1)
def _initialize() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
