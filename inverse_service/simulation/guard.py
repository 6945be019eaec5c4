"""The guard before a run: are the implicit equations safely solvable along the whole way?

Where one coordinate r alone is not cyclic, h |d2H/dr dp_r| = h |G'(r)| depends on r only, and r moves at a nearly
constant rate: its greatest value on the way is known beforehand. At 1 and beyond Newton finds a wrong root and nothing
tells. Other systems are guarded inside the kernel, step by step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, walk
from inverse_service.integrators.trajectory import Outcome
from inverse_service.simulation.array_values import array_value
from inverse_service.simulation.choices import Grid, MethodChoice
from inverse_service.simulation.formulas import Formulas
from inverse_service.simulation.schemes import GUARD_REMEDY
from inverse_service.simulation.starting import Initial

LIMIT = 1.0
_SAMPLES = 4096


def refusal(
    f: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, values: Mapping[str, float]
) -> Outcome | None:
    """A "guard" outcome at step 0 where h max|G'| reaches 1 on the way, else None."""
    hamiltonian, names = f.problem.free_hamiltonian, f.problem.coordinates
    if choice.method != "variational" or hamiltonian is None:
        return None
    moving = [k for k, name in enumerate(names) if Symbol(name) in set(walk(hamiltonian))]
    if len(moving) != 1 or f"d{moving[0]}" not in begin.rates:
        return None
    place = moving[0]
    mixed = differentiate(differentiate(hamiltonian, Symbol(names[place])), Symbol(f"p_{names[place]}"))
    leaves = set(walk(mixed))
    if Symbol(f"p_{names[place]}") in leaves or Symbol(names[place]) not in leaves:
        return None
    first, rate = begin.state[f"q{place}"], begin.rates[f"d{place}"]
    table: dict[Expression, Any] = {Symbol(name): value for name, value in values.items()}
    table |= {Symbol(f"p_{name}"): begin.state[f"p{k}"] for k, name in enumerate(names)}
    table[Symbol(names[place])] = np.linspace(first, first + rate * grid.step * grid.steps, _SAMPLES)
    with np.errstate(all="ignore"):
        slopes = np.abs(array_value(mixed, table))
    slopes = slopes[np.isfinite(slopes)]
    worst = float(slopes.max(initial=0.0))
    if abs(grid.step) * worst < LIMIT:
        return None
    text = f"h*max|d2H/d{names[place]} dp_{names[place]}|"
    remedy = f"{GUARD_REMEDY}; |step| must be well below {1.0 / worst:.3g}"
    return Outcome("guard", 0, 0.0, text, abs(grid.step) * worst, remedy)
