"""What is asked of a run: method, start, grid and observed quantities, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from inverse_service.expressions.tree import Expression

TOLERANCES = {"heyoka": 1e-15, "adaptive": 1e-12, "stiff": 1e-8}
OWN_STEPS = frozenset(TOLERANCES)
SCIPY = {"scipy_dop853": "DOP853", "scipy_radau": "Radau", "scipy_lsoda": "LSODA"}  # peers in comparisons
POINT_METHODS = frozenset({"runge_kutta", "reference", "adaptive", "stiff"})  # kernels on positions and velocities


@dataclass(frozen=True, slots=True)
class MethodChoice:
    """A method and its settings.

    `method`: "variational", "nonholonomic", "modified", "runge_kutta", "reference" (Gauss-Legendre of order 12),
    "adaptive" (DOP853 with steps of its own), "stiff" (RODAS likewise) or "heyoka". `alpha` in [0, 1] is the place of
    the discrete Lagrangian, `symmetrised` takes the mean of its alpha and 1 - alpha forms. `order`: 2 (the plain step)
    or 4, 6, 8 by composition; for "runge_kutta" 4, 5 or 8.
    `form` of "variational": "hamiltonian", "raw" or "verlet". `guard`: stop where the implicit equations may have other
    roots, or steps do not resolve the motion. `tolerance` of "adaptive", "stiff" and "heyoka", for each of their steps,
    which they choose themselves.
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
    """Initial data, n numbers each, in the order of the coordinates; velocities or momenta.

    `convention` "momenta": p_0 = dL/dv at (q_0, v_0), or the momenta given. "discrete_constraint": the first step
    goes from q_0 to q_1 = q_0 + h v_0 with the dependent coordinates put on the discrete constraint.
    """

    positions: Sequence[float]
    velocities: Sequence[float] | None = None
    momenta: Sequence[float] | None = None
    convention: str = "momenta"


@dataclass(frozen=True, slots=True)
class Grid:
    """`steps` steps of size `step` from t = `begin`; the start and every `record_every`-th point are recorded."""

    step: float
    steps: int
    record_every: int = 1
    begin: float = 0.0


@dataclass(frozen=True, slots=True)
class Observable:
    """A quantity of (q, v) evaluated inside the kernel at every step, at the point and velocity of the discrete
    Lagrangian: q = (1 - alpha) q_k + alpha q_(k+1), v = (q_(k+1) - q_k)/h; at (q, v) for Runge-Kutta methods."""

    name: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Observation:
    """What is recorded; nothing else is computed."""

    momenta: bool = True
    velocities: bool = True
    observables: tuple[Observable, ...] = field(default=())
