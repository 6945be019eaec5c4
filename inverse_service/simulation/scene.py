"""A scene as data: what is to be simulated, with everything that was not named already left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions.tree import Expression
from inverse_service.simulation.choices import Grid, MethodChoice, Observable

Array = NDArray[np.float64]

EXACT = "exact"
# What each observed quantity is called in the scene, in the order in which a person reads them.
OBSERVED = (
    "trajectory", "velocities", "energy", "constraints", "momenta", "matching_circle", "phase", "error", "cost",
    "lyapunov",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FreeLagrangian:
    """L~ (and H~ in Symbol("p_x"), where there is one) of a free system with the motion of the scene.

    `constants` are names of parameters that L~ may choose freely, with the values used; `source` says where L~ comes
    from. `start_momenta` gives p_0 from q_0 and v_0 where dL~/dv is 0/0 at the start. `forced`: the forces of the scene
    act beside it.
    """

    lagrangian: Expression
    hamiltonian: Expression | None
    constants: Mapping[str, float]
    source: str
    start_momenta: Callable[[Array, Array, Mapping[str, float]], Array] | None = None
    forced: bool = False


@dataclass(frozen=True, slots=True)
class Unavailable:
    """Something a method needs does not exist or was not found; `reason` is a sentence."""

    reason: str


@dataclass(frozen=True, slots=True)
class Requested:
    """A method of a scene: `choice` is None for the exact solution; `alpha` as a person writes it.

    `free` names the L~ of this method (None: that of the scene), `constants` overrule those of the scene.
    """

    label: str
    method: str
    alpha: str | None
    choice: MethodChoice | None
    convention: str = "momenta"
    free: str | None = None
    constants: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """Zeros of `formula`, rising (direction 1), falling (-1) or both (0); `stops`: the run ends at the first."""

    formula: Expression
    direction: int
    stops: bool


@dataclass(frozen=True, slots=True)
class Members:
    """The members of an ensemble: positions and velocities (N, n), and (N,) values of the parameters that differ."""

    positions: Array
    velocities: Array
    values: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Scene:
    """`lagrangian` holds the effects named and no other; None for a system given by `accelerations`.

    `values` gives every parameter a number. `positions` and `velocities` (n,) are on the constraints.
    `forces` (n,) act beside L and the constraints, empty where there are none; `own` are observables by formula.
    `circle` are the places of the two coordinates whose path is matched by circles. `without` gives (Lagrangian,
    constraints) without each effect, where the cost of parts is observed, and is empty elsewhere.
    """

    name: str
    coordinates: tuple[str, ...]
    values: Mapping[str, float]
    lagrangian: Expression | None
    constraints: tuple[Expression, ...]
    accelerations: tuple[Expression, ...] | None
    effects: tuple[str, ...]
    positions: Array
    velocities: Array
    grid: Grid
    methods: tuple[Requested, ...]
    observe: tuple[str, ...]
    circle: tuple[int, int] | None
    notes: tuple[str, ...] = ()
    forces: tuple[Expression, ...] = ()
    own: tuple[Observable, ...] = ()
    events: tuple[Event, ...] = ()
    ensemble: Members | None = None
    without: Mapping[str, tuple[Expression | None, tuple[Expression, ...]]] = field(default_factory=dict)
