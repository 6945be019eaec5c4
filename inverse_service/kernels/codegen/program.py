"""One step of a method as a program: what the kernel writer turns into a compiled loop.

Where a kernel keeps its numbers: one array of doubles, handed in and out, so that a run can go on in pieces.

Codes that a kernel leaves in its status where it stops.
"""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.kernels.codegen.symengine_trees import Formula

NOT_FINITE = 1
NO_CONVERGENCE, SINGULAR, GUARDED, WATCHED = 100, 200, 300, 400
TOO_SHORT, UNRESOLVED, NO_START, TOO_MANY = 2, 3, 4, 6
UNOBSERVABLE = 1000


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


@dataclass(frozen=True, slots=True)
class Assign:
    """name := formula."""

    name: str
    formula: Formula


@dataclass(frozen=True, slots=True)
class Solve:
    """residuals(unknowns) = 0 by Newton with the given Jacobian; one linear solve where `affine`.

    `scales` names the state variable of which each unknown is the increment ("" where there is none): convergence
    is judged against its round-off. `limit` is the determinant as h -> 0: where the actual one differs from it by
    its own size, there may be other solutions, and the run stops. Where `tested` is False the determinant may be
    anything: an estimate of the error judges the step.
    """

    unknowns: tuple[str, ...]
    residuals: tuple[Formula, ...]
    jacobian: tuple[tuple[Formula, ...], ...]
    affine: bool
    scales: tuple[str, ...]
    limit: Formula | None = None
    tested: bool = True


@dataclass(frozen=True, slots=True)
class Iterate:
    """unknowns := formulas(unknowns) until nothing changes any more beyond round-off (a contraction)."""

    unknowns: tuple[str, ...]
    formulas: tuple[Formula, ...]
    scales: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Watch:
    """A quantity tested after each step.

    "sign" must keep its sign, "positive" and "domain" must be above 0, "bound" and "resolution" must stay below
    `limit` in size and have a value, "map" must stay below it where it has one.
    """

    kind: str
    formula: Formula
    quantity: str
    remedy: str
    limit: float = 1.0


Statement = Assign | Solve | Iterate


def size_name(block: int, unknown: str) -> str:
    """Where the greatest size of the unknowns with this letter is kept; `block` counts those that are iterated."""
    return f"size_{block}_{unknown[0]}"


@dataclass(frozen=True, slots=True)
class Program:
    """`statements` compute the increments, `updates[k]` is the increment of `state[k]` (None: it never changes).

    `arguments` are read-only and given at run time; "h" is the (sub)step. `displacement` are the position
    increments where discrete velocities are recorded, `observed` formulas of old state and increments. `way` are
    position increments whose third differences are watched: steps must resolve the motion. `error` is the
    squared norm of the error of a step that chooses its own length, which falls with its power `order`.
    """

    state: tuple[str, ...]
    arguments: tuple[str, ...]
    statements: tuple[Statement, ...]
    updates: tuple[Formula | None, ...]
    watches: tuple[Watch, ...] = ()
    displacement: tuple[Formula, ...] = ()
    observed: tuple[tuple[str, Formula], ...] = ()
    way: tuple[Formula, ...] = ()
    forces: int = 0
    error: Formula | None = None
    order: int = 0

    @property
    def blocks(self) -> tuple[Solve | Iterate, ...]:
        return tuple(statement for statement in self.statements if not isinstance(statement, Assign))

    @property
    def unknowns(self) -> tuple[str, ...]:
        """All unknowns of implicit blocks; their rates (unknown / h) are kept as the next guess."""
        return tuple(name for block in self.blocks for name in block.unknowns)

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the greatest increments so far: one for each letter in each block that is iterated."""
        blocks = (block for block in self.blocks if not (isinstance(block, Solve) and block.affine))
        return tuple(dict.fromkeys(size_name(k, name) for k, block in enumerate(blocks) for name in block.unknowns))
