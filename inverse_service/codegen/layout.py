"""Where a kernel keeps its numbers: one array of doubles, handed in and out, so that a run can go on in pieces."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.codegen.program import Program, Solve

STATUS, CLOCK, STOPPED_AT, STOPPED_VALUE = "status", "clock", "stopped_at", "stopped_value"
PACE = "pace"  # the square of recent steps
TRIAL = "trial"  # the length of the next step where a kernel chooses it


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of the changing numbers (`persistent`) and, after them, of the arguments."""

    persistent: tuple[str, ...]
    arguments: tuple[str, ...]
    columns: tuple[str, ...]

    def place(self, name: str) -> int:
        return self.persistent.index(name)

    def argument_place(self, name: str) -> int:
        return len(self.persistent) + self.arguments.index(name)

    @property
    def size(self) -> int:
        return len(self.persistent) + len(self.arguments)


def changing(program: Program) -> tuple[str, ...]:
    """State variables that a step changes."""
    return tuple(name for name, update in zip(program.state, program.updates, strict=True) if update is not None)


def layout_of(program: Program) -> Layout:
    """Status first; then state, compensations, rates of unknowns, determinants, signs, greatest values."""
    solves = [block for block in program.blocks if isinstance(block, Solve)]
    persistent = [
        *(STATUS, CLOCK, STOPPED_AT, STOPPED_VALUE),
        *((TRIAL,) if program.error is not None else ()),
        *program.state,
        *(f"{name}_low" for name in changing(program)),
        *(f"{name}_rate" for name in program.unknowns),
        *program.sizes,
        *(f"{which}_{k}" for k in range(len(solves)) for which in ("first", "last")),
        *(f"watch_{k}" for k, watch in enumerate(program.watches) if watch.kind == "sign"),
        *(f"{which}_{k}" for k in range(len(program.way)) for which in ("later", "before")),
        *((PACE,) if program.way else ()),
        *(f"maximum_{k}" for k in range(len(program.observed))),
    ]
    columns = (
        *changing(program),
        *(f"velocity_{k}" for k in range(len(program.displacement))),
        *(f"observed_{k}" for k in range(len(program.observed))),
    )
    return Layout(tuple(persistent), program.arguments, columns)
