"""Substeps that lift a symmetric method of order 2 to order 4, 6 or 8.

Order 4: M. Suzuki, Phys. Lett. A 146 (1990) 319, five substeps. Orders 6 and 8: W. Kahan and R.-C. Li, Math. Comp.
66 (1997) 1089, nine and seventeen substeps. Required: a step that is its own inverse with -h.
"""

from __future__ import annotations

_SUZUKI = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
_HALVES: dict[int, tuple[float, ...]] = {
    2: (),
    4: (_SUZUKI, _SUZUKI),
    6: (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.082213596293550800230),
    8: (
        0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641, 0.15884190655515560090,
        -0.39590389413323757734, 0.18453964097831570709, 0.25837438768632204729, 0.29501172360931029887,
    ),
}  # fmt: skip
ORDERS = tuple(_HALVES)


def composition(order: int) -> tuple[float, ...]:
    """Symmetric weights that add up to 1; KeyError for an order that is not in ORDERS."""
    half = _HALVES[order]
    middle = 1.0 - 2.0 * sum(half)
    return (*half, middle, *reversed(half))
