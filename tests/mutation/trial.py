"""The tests of a module against one mutant of it, in a process of its own with a limit of processor time."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import os
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parent.parent.parent
# Loaded once, before the processes part.
LIBRARIES = ("flint", "hypothesis", "llvmlite", "mpmath", "numba", "numpy", "pytest", "sympy")


def prepare() -> None:
    for name in LIBRARIES:
        importlib.import_module(name)


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Puts a source in the place of that of a module."""

    def __init__(self, module: str, source: str) -> None:
        self.module, self.source = module, source

    def find_spec(self, name: str, path: object, target: object = None) -> importlib.machinery.ModuleSpec | None:
        if name != self.module:
            return None
        return importlib.machinery.ModuleSpec(name, self, origin=str(path_of(name)))

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = str(path_of(self.module))
        exec(compile(self.source, module.__file__, "exec"), module.__dict__)


def path_of(module: str) -> Path:
    return ROOT / (module.replace(".", "/") + ".py")


def is_noticed(module: str, source: str, tests: Sequence[str], limit: int) -> str:
    """"killed" by a test, "stopped" by the limit of processor time in s, or "survived"."""
    child = os.fork()
    if not child:
        _run(module, source, tests, limit)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return "stopped"
    return "survived" if os.WEXITSTATUS(status) == 0 else "killed"


def _run(module: str, source: str, tests: Sequence[str], limit: int) -> None:
    """In the child: the end of this function is the end of the process."""
    code = 3
    try:
        spent = int(sum(os.times()[:2]))
        resource.setrlimit(resource.RLIMIT_CPU, (spent + limit, spent + limit + 2))
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        for name in [name for name in sys.modules if name.split(".")[0] in ("inverse_service", "api_schemas")]:
            del sys.modules[name]
        sys.meta_path.insert(0, Changed(module, source))
        os.chdir(ROOT)
        import pytest

        code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestWarning", *tests]))
    finally:
        os._exit(code)
