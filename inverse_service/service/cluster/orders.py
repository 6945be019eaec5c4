"""What goes over the connection between a Dask worker and its host, and what both must have in common."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from inverse_service.service.jobs.identity import engine_version
from inverse_service.service.jobs.outcome import Call


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """Versions: of this program with a digest of its text, of Python, and of the packages that matter."""

    engine: str
    python: str
    distributed: str
    flint: str


def fingerprint() -> Fingerprint:
    """That of this process."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return Fingerprint(engine_version(), python, _version("distributed"), _version("python-flint"))


def difference(ours: Fingerprint, theirs: Fingerprint) -> str:
    """What differs, in words; empty where nothing does."""
    mine, yours = asdict(ours), asdict(theirs)
    return ", ".join(f"{name} {yours[name]} instead of {mine[name]}" for name in mine if mine[name] != yours[name])


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


REPORT: Final = "report"
DONE: Final = "done"


@dataclass(frozen=True, slots=True)
class Order:
    """Do what `call` says; `key` names it in what comes back."""

    key: str
    call: Call


@dataclass(frozen=True, slots=True)
class Cancel:
    """Kill the process that works on this order, or forget the order."""

    key: str
