"""What goes over the connection between a Dask worker and its host."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from inverse_service.service.jobs.outcome import Call

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
