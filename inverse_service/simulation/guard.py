"""The guard before a run: are the implicit equations safely solvable along the whole way?

Where one coordinate r alone is not cyclic, h |d2H/dr dp_r| = h |G'(r)| depends on r only, and r moves at a nearly
constant rate: its greatest value on the way is known beforehand. At 1 and beyond Newton finds a wrong root and nothing
tells. Other systems are guarded inside the kernel, step by step.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inverse_service.integrators.trajectory import Outcome
from inverse_service.simulation.choices import Grid, MethodChoice
from inverse_service.simulation.formulas import Formulas
from inverse_service.simulation.starting import Initial
from inverse_service.simulation.watches import GUARD_REMEDY

LIMIT = 1.0
_SAMPLES, _NEAR = 256, 20.0


def refusal(
    f: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]
) -> Outcome | None:
    """A "guard" outcome at step 0 where h max|G'| reaches 1 on the way, else None. `parameters` by kernel name."""
    if not choice.guard or choice.method != "variational" or f.problem.free_hamiltonian is None or not grid.steps:
        return None
    if f.depends_on_time:  # what it is on the way is not known beforehand
        return None
    place = f.moving_alone
    if place is None or f"d{place}" not in begin.rates:
        return None
    name = f.problem.coordinates[place]
    first, rate = begin.state[f"q{place}"], begin.rates[f"d{place}"]
    whole = rate * grid.step * grid.steps
    near = np.sign(whole) * min(abs(whole), _NEAR)
    way = np.concatenate([np.linspace(first, first + reach, _SAMPLES) for reach in (near, whole)])
    with np.errstate(all="ignore"):
        slopes = np.abs(f.slope_on_way({**parameters, **begin.state}, way))
    worst = float(slopes[np.isfinite(slopes)].max(initial=0.0))
    if abs(grid.step) * worst < LIMIT:
        return None
    remedy = f"{GUARD_REMEDY}; |step| must be well below {1.0 / worst:.3g}"
    return Outcome("guard", 0, 0.0, f"h*max|d2H/d{name} dp_{name}|", abs(grid.step) * worst, remedy)
