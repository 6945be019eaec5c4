"""Run the tests of a module against one mutant of it, in a process that loads the package
itself.
"""

from __future__ import annotations

import ast
import importlib
import importlib.abc
import importlib.machinery
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parent.parent.parent
# The modules of the checker.
CHECKER = tuple(
    sorted(
        {file.stem for file in (ROOT / "inverse_service/certificate").glob("*.py")} - {"__init__"}
    )
)
# Loaded once, before the fork.
LIBRARIES = ("flint", "hypothesis", "llvmlite", "mpmath", "numba", "numpy", "pytest", "sympy")
SURVIVED, KILLED, QUICK = "survived", "killed", "survived the quick trial"
OPTIONS = ("-x", "-q", "-s", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestWarning")


def prepare() -> None:
    """Load the libraries; Hypothesis neither shrinks nor stores examples."""
    for name in LIBRARIES:
        importlib.import_module(name)
    from hypothesis import Phase, settings

    settings.register_profile(
        "trial", database=None, deadline=None, phases=[Phase.explicit, Phase.generate]
    )
    settings.load_profile("trial")
    os.chdir(ROOT)


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Replaces the source of a module."""

    def __init__(self, module: str, source: ast.Module) -> None:
        self.module, self.source = module, source

    def find_spec(
        self, name: str, path: object, target: object = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name != self.module:
            return None
        return importlib.machinery.ModuleSpec(name, self, origin=str(path_of(name)))

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = str(path_of(self.module))
        # Under a name that is not a file, so numba neither finds nor stores machine code of the
        # plain source.
        exec(
            compile(self.source, f"<mutant of {self.module}>", "exec", dont_inherit=True),
            module.__dict__,
        )


def path_of(module: str) -> Path:
    return ROOT / (module.replace(".", "/") + ".py")


class FirstFailure:
    """Records the first failed test."""

    name = ""

    def pytest_runtest_logreport(self, report: object) -> None:
        if getattr(report, "failed", False) and not self.name:
            self.name = str(getattr(report, "nodeid", ""))


def anew(module: str, source: ast.Module, tests: Sequence[str]) -> str:
    """In a child, return SURVIVED, or KILLED and the test that detected the mutant."""
    for name in [
        name for name in sys.modules if name.split(".")[0] in ("inverse_service", "api_schemas")
    ]:
        del sys.modules[name]
    sys.meta_path.insert(0, Changed(module, source))
    import pytest

    failure = FirstFailure()
    code = pytest.main([*OPTIONS, *tests], plugins=[failure])
    return SURVIVED if code == 0 else f"{KILLED} {failure.name}"
