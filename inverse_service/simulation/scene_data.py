"""The data of a simulation: the problem of a method, the settings of a run, and the scene they
belong to.

In a scene, all effects that were not named have already been left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.expressions import tree as ex
from inverse_service.integrators.trajectory import Array, Row

Stop = Callable[[], bool]
Progress = Callable[[str], None]
Point = tuple[float, Array, Array]  # a time, position and velocity (n,)
Measure = Callable[
    [Array, Array, Array], Array
]  # of times (m,), positions and velocities (m, n): (m,)
EXACT = "exact"


@dataclass(frozen=True, slots=True)
class Problem:
    """One motion, described in the forms that the methods need; unknown parts are None.

    `lagrangian` L of the constrained system with its effects applied, `constraints` omega(q) . v,
    linear in the velocities, `free_lagrangian` the L~ of an associated second-order system or the L
    of a free one, `free_hamiltonian` its H~(q, p) in Symbol("p_x") for each coordinate x,
    `free_constants` names among the parameters that L~ may choose freely (C2, a_x, ...),
    `accelerations` all n accelerations of the true motion, `forces` Q_i(t, q, q') that act with
    `lagrangian` or `free_lagrangian`, `domain` what is positive where L~ has the motion. `pulls`
    are the directions of the forces of the constraints, (n,) each, where these are not their
    slopes.
    """

    coordinates: tuple[str, ...]
    parameters: tuple[str, ...] = ()
    lagrangian: ex.Expression | None = None
    constraints: tuple[ex.Expression, ...] = ()
    free_lagrangian: ex.Expression | None = None
    free_hamiltonian: ex.Expression | None = None
    free_constants: tuple[str, ...] = ()
    accelerations: tuple[ex.Expression, ...] | None = None
    forces: tuple[ex.Expression, ...] = ()
    domain: tuple[ex.Expression, ...] = ()
    pulls: tuple[tuple[ex.Expression, ...], ...] = ()

    @property
    def formulas(self) -> tuple[ex.Expression, ...]:
        """All that are known."""
        known: tuple[ex.Expression | None, ...] = (
            self.lagrangian,
            self.free_lagrangian,
            self.free_hamiltonian,
        )
        known = (
            *known,
            *(self.accelerations or ()),
            *(part for pull in self.pulls for part in pull),
        )
        return tuple(
            tree
            for tree in (*known, *self.forces, *self.constraints, *self.domain)
            if tree is not None
        )

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in any of the formulas."""
        return any(ex.holds(tree, ex.TIME) for tree in self.formulas)

    def with_used_parameters(self, observed: Sequence[ex.Expression] = ()) -> Problem:
        """The problem with only those parameters that its formulas, or those `observed`,
        contain.
        """
        nodes = ex.distinct_nodes([*self.formulas, *observed])
        used = {node.name for node in nodes if isinstance(node, ex.Symbol)}
        return replace(self, parameters=tuple(name for name in self.parameters if name in used))


@dataclass(frozen=True, slots=True)
class MethodChoice:
    """A method and its settings.

    `method` is a key of `integrators.method_table`. `alpha` in [0, 1] is the place of the discrete
    L, `symmetrised` takes the mean of its alpha and 1 - alpha forms. `order`: 2 (the plain step) or
    4, 6, 8 by composition; that of the tableau for "runge_kutta". `form` of "variational":
    "hamiltonian", "raw" or "verlet". `guard`: stop where the implicit equations may have other
    roots, or steps do not resolve the motion. `tolerance` of "adaptive", "stiff" and "heyoka", for
    each of their steps, which they choose themselves.
    """

    method: str
    alpha: float = 0.5
    symmetrised: bool = False
    order: int = 2
    form: str = "hamiltonian"
    guard: bool = True
    tolerance: float = 1e-15


@dataclass(frozen=True, slots=True)
class Start:
    """Initial data, n numbers each, in the order of the coordinates.

    `convention` "momenta": p_0 = dL/dv at (q_0, v_0), or the `momenta` given.
    "discrete_constraint": the first step goes from q_0 to q_1 = q_0 + h v_0 with the dependent
    coordinates put on the discrete constraint.
    """

    positions: Row
    velocities: Row
    momenta: Row | None = None
    convention: str = "momenta"


@dataclass(frozen=True, slots=True)
class Grid:
    """`steps` steps of size `step` from t = `begin`; the start and every `record_every`-th point
    are recorded.
    """

    step: float
    steps: int
    record_every: int = 1
    begin: float = 0.0

    @property
    def recorded(self) -> NDArray[np.int64]:
        """The steps that are recorded, the last one always."""
        steps = np.arange(0, self.steps + 1, self.record_every)
        return steps if steps[-1] == self.steps else np.append(steps, self.steps)

    @property
    def times(self) -> Array:
        """t at the recorded steps."""
        return np.asarray(self.begin + self.step * self.recorded, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Observable:
    """A quantity of (q, v) evaluated inside the kernel at every step, at the point and velocity of
    the discrete Lagrangian: q = (1 - alpha) q_k + alpha q_(k+1), v = (q_(k+1) - q_k)/h; at (q, v)
    for Runge-Kutta methods. `with_energy`: the energy v L_v - L of the scene's Lagrangian is added
    to the formula.
    """

    name: str
    expression: ex.Expression
    with_energy: bool = False


Observation = tuple[
    Observable, ...
]  # recorded in addition to the state; no other quantity is computed


@dataclass(frozen=True, slots=True)
class FreeLagrangian:
    """L~ (and H~ in Symbol("p_x"), where there is one) of a free system with the motion of the
    scene.

    `constants` are names of parameters that L~ may choose freely, with the values used; `source`
    says where L~ comes from. `start_momenta` gives p_0 from q_0 and v_0 where dL~/dv is 0/0 at the
    start. `forced`: the forces of the scene act with it. `lost` says why an H~ in closed form is
    not used here. `domain` is positive at the start and as long as L~ has the motion of the scene.
    """

    lagrangian: ex.Expression
    hamiltonian: ex.Expression | None
    constants: Mapping[str, float]
    source: str
    start_momenta: Callable[[Array, Array, Mapping[str, Any]], Array] | None = None
    forced: bool = False
    lost: str = ""
    domain: tuple[ex.Expression, ...] = ()


class Unavailable(InputError):
    """A part that a method needs does not exist or was not found; `detail` is a sentence."""


@dataclass(frozen=True, slots=True)
class Requested:
    """A method of a scene, `alpha` as written by the user; None where there is none.

    `free` names the L~ of this method (None: that of the scene), `constants` overrule those of the
    scene.
    """

    label: str
    choice: MethodChoice
    alpha: str | None = None
    convention: str = "momenta"
    free: str | None = None
    constants: tuple[tuple[str, float], ...] = ()

    @property
    def method(self) -> str:
        """The key of its table."""
        return self.choice.method


@dataclass(frozen=True, slots=True)
class Event:
    """Zeros of `formula`, rising (direction 1), falling (-1) or both (0); `stops`: the run ends
    there.

    `sets`: there each Symbol(x) or Velocity(x) gets the value of its formula. With the `most`-th
    time the run ends. `measure` gives the values where no formula does.
    """

    formula: ex.Expression
    direction: int
    stops: bool
    sets: tuple[tuple[ex.Expression, ex.Expression], ...] = ()
    most: int = 1
    measure: Measure | None = None

    @property
    def acts(self) -> bool:
        """Whether it changes the motion."""
        return bool(self.sets)


@dataclass(frozen=True, slots=True)
class Contact:
    """A gap g(t, q) >= 0 with 0 <= restitution <= 1; with friction, `slides` is the velocity of
    sliding, linear in the velocities. `weight` is the friction as an exact number.
    """

    name: str
    gap: ex.Expression
    restitution: float = 0.0
    friction: float = 0.0
    slides: ex.Expression = ex.ZERO

    @property
    def weight(self) -> ex.Expression:
        return ex.number(Fraction(self.friction))


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect of the system, and the scene with it reversed: without it if it `acts`, else with
    it.
    """

    name: str
    acts: bool
    lagrangian: ex.Expression
    constraints: tuple[ex.Expression, ...]
    forces: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class Members:
    """The members of an ensemble: positions and velocities (N, n), and (N,) values of the
    parameters that differ.
    """

    positions: Array
    velocities: Array
    values: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Scene:
    """`lagrangian` holds the effects named and no other; None for a system given by
    `accelerations`.

    `values` gives every parameter a number. `positions` and `velocities` (n,) are on the
    constraints. `forces` (n,) act with L and the constraints, empty where there are none; `own` are
    observables by formula. `found` is a Lagrangian of given accelerations, where their energy is
    observed. `units` are names of units, of which nothing is computed. `circle` are the places of
    the two coordinates whose path is matched by circles. `parts` are the effects that the system
    has, those that act and those that are left out. `conserved` are constants of the motion where
    the energy is none. `bodies` are points that move: names with those of the observables of their
    places in a plane.
    """

    name: str
    coordinates: tuple[str, ...]
    values: Mapping[str, float]
    lagrangian: ex.Expression | None
    constraints: tuple[ex.Expression, ...]
    accelerations: tuple[ex.Expression, ...] | None
    effects: tuple[str, ...]
    positions: Array
    velocities: Array
    grid: Grid
    methods: tuple[Requested, ...]
    observe: tuple[str, ...]
    circle: tuple[int, int] | None
    notes: tuple[str, ...] = ()
    forces: tuple[ex.Expression, ...] = ()
    own: tuple[Observable, ...] = ()
    events: tuple[Event, ...] = ()
    contacts: tuple[Contact, ...] = ()
    ensemble: Members | None = None
    found: FreeLagrangian | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    parts: tuple[Effect, ...] = ()
    conserved: tuple[Observable, ...] = ()
    bodies: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    @property
    def formulas(self) -> tuple[ex.Expression, ...]:
        """Those of its motion: L, constraints, accelerations and forces, as far as it has them."""
        lagrangian = () if self.lagrangian is None else (self.lagrangian,)
        return (*lagrangian, *self.constraints, *(self.accelerations or ()), *self.forces)


@dataclass(frozen=True, slots=True)
class Truth:
    """Positions and velocities (m, n) at the recorded times, nan from where they are not known;
    `reason` says why.

    `against` is "exact" or "reference"; `bounds` (m,) bound the error of the positions up to each
    time, in the unit of the errors; `by` names the reference and its check.
    """

    times: Array
    positions: Array
    velocities: Array
    against: str
    bounds: Array
    seconds: float
    reason: str = ""
    by: str = ""

    @property
    def uncertainty(self) -> float:
        """The bound at the last known time."""
        known = self.bounds[np.isfinite(self.bounds)]
        return float(known[-1]) if len(known) else np.inf
