"""The table of methods, and the coefficients of one-step methods: explicit and implicit
Runge-Kutta, Rosenbrock, compositions.

All of them are data in files beside this one: `methods.toml` says for each method what it needs,
its order, whether it is implicit, and its cost. A new explicit method is a file of the folder
`explicit`; its order is then one of `runge-kutta`. Of those with an estimate of the error
`adaptive` takes the lowest order, or the highest one where forces do not depend on velocities and a
step of the grid is too long for the lowest: it then takes the fewest forces.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inverse_service.integrators.trajectory import Array

Row = list[float]


@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """Stages at `nodes`, with `rows` and `weights` for y' = f(t, y); a method of Nystrom has no
    rows, only zeros.

    For q'' = f(t, q): `places` and `ends` are those of positions, times h^2, `weights` of
    velocities, times h. `errors` and `end_errors` are the weights of estimates of the error, which
    fall as h^`falls`.
    """

    name: str
    nodes: Array
    rows: Array
    places: Array
    weights: Array
    ends: Array
    errors: Array
    end_errors: Array
    falls: int = 0


@dataclass(frozen=True, slots=True)
class Rosenbrock:
    """An L-stable method for stiff equations; linear systems replace Newton's method. Stage by
    stage `rows` a_ij, `mixed` c_ij, `nodes` c_i, `slopes` d_i; with J = df/dy, increments u_i of y'
    = f(t, y), the last of which, s, is the estimate of the error:

        u_i/(h gamma) - J u_i = f(t + c_i h, y + sum_j a_ij u_j) + sum_j (c_ij/h) u_j + h d_i f_t
        y_new = y + sum_j a_sj u_j + u_s
    """

    name: str
    order: int
    source: str
    gamma: float
    rows: list[Row]
    mixed: list[Row]
    nodes: Row
    slopes: Row


@dataclass(frozen=True, slots=True)
class Method:
    """`family`: "geometric", "explicit", "implicit", "taylor" or "exact"; figures have a color for
    each.

    `needs` and `cost` are for people. `orders` are those to choose from, the default first, empty
    where there is no choice; then `order` is the one there is, None where it varies. `uses`:
    "lagrangian" (of the constrained system), "free" (L~, or L where there are no constraints),
    "accelerations" or "quadrature". `tolerance` is the default of methods with steps of their own.
    `scipy` is the name of a peer in SciPy.
    """

    family: str
    uses: str
    needs: str
    cost: str
    orders: tuple[int, ...] = ()
    order: int | None = None
    implicit: bool = False
    alpha: bool = False
    tolerance: float | None = None
    scipy: str = ""

    @property
    def listed_orders(self) -> str:
        """`orders` in words."""
        names = (
            f"{order} (default)" if order == self.orders[0] else str(order)
            for order in sorted(self.orders)
        )
        return ", ".join(names)

    @property
    def own_steps(self) -> bool:
        """Whether it chooses its step size."""
        return self.tolerance is not None

    @property
    def has_kernel(self) -> bool:
        """Whether it steps with a compiled kernel."""
        return self.uses != "quadrature" and self.family != "taylor" and not self.scipy


def _data(name: str) -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / name).read_text(encoding="utf-8"))


def _tableau(given: dict[str, Any]) -> Tableau:
    """One file. What it leaves out follows from its `rows`: those of q'' = f are their square,
    nodes their sums.
    """
    size, weights = len(given["weights"]), np.array(given["weights"])
    rows, places, errors, end_errors = (
        np.array([[*row, *[0.0] * (size - len(row))] for row in given.get(key, ())]).reshape(
            -1, size
        )
        for key in ("rows", "places", "errors", "end_errors")
    )
    nodes, ends = np.array(given.get("nodes")), np.array(given.get("ends"))
    if not len(rows):
        rows = np.zeros_like(places)
    elif not len(places):
        nodes, places, ends, end_errors = (
            rows.sum(axis=1),
            rows @ rows,
            weights @ rows,
            errors @ rows,
        )
    return Tableau(
        given["name"], nodes, rows, places, weights, ends, errors, end_errors, given.get("falls", 0)
    )


def _explicit() -> dict[int, Tableau]:
    """By order: each file of `explicit/` is a method. ValueError where two have one order."""
    found = dict[int, Tableau]()
    for path in sorted((Path(__file__).parent / "explicit").glob("*.toml")):
        given = _data(f"explicit/{path.name}")
        if given["order"] in found:
            raise ValueError(
                f"{path.name} has the order of {found[given['order']].name}: keep one of them."
            )
        found[given["order"]] = _tableau(given)
    return dict(sorted(found.items()))


TABLEAUX = _explicit()
RUNGE_KUTTA = tuple(order for order, one in TABLEAUX.items() if one.rows.any())
PAIRS = tuple(
    order for order, one in TABLEAUX.items() if len(one.errors)
)  # with an estimate of the error
GAUSS_LEGENDRE = _tableau(
    _data("implicit/gauss-legendre12.toml")
)  # of order twice its stages: our own reference
RODAS = Rosenbrock(**_data("implicit/rodas4.toml"))
HALVES: dict[int, list[float]] = {
    2: [],
    **{int(k): one["half"] for k, one in _data("compositions.toml").items()},
}
ORDERS = tuple(HALVES)
_FAMILIES = {
    "compositions": ORDERS,
    "explicit": tuple(sorted(RUNGE_KUTTA, key=lambda order: (order != 4, order))),
}
METHODS = {
    name: Method(**given | {"orders": _FAMILIES.get(given.get("orders", ""), ())})
    for name, given in _data("methods.toml").items()
}
# In scenes; "stormer-verlet" is a form of the variational method inside.
OWN_STEPS = frozenset(
    name for name, method in METHODS.items() if method.own_steps and not method.scipy
)
SCIPY = {name: method.scipy for name, method in METHODS.items() if method.scipy}
GEOMETRIC = frozenset(name for name, method in METHODS.items() if method.alpha)
USES_FREE = frozenset(name for name, method in METHODS.items() if method.uses == "free")
USES_ACCELERATIONS = frozenset(
    name for name, method in METHODS.items() if method.uses == "accelerations"
)
EXPLICIT = frozenset(
    name for name, method in METHODS.items() if method.family == "explicit" and not method.scipy
)
POINT_METHODS = USES_ACCELERATIONS - {"heyoka", *SCIPY}  # kernels on positions and velocities


def order_of_pair(order: int) -> int:
    """The order of `adaptive` with this setting: the usual one, but where the setting is that of
    another pair.
    """
    return order if order in PAIRS else PAIRS[0]


def composition(order: int) -> tuple[float, ...]:
    """Symmetric weights, which add up to 1, of substeps that lift a symmetric method of order 2,
    whose step is its own inverse with -h, to `order`; KeyError for one that is not in ORDERS.
    """
    half = HALVES[order]
    middle = 1.0 - 2.0 * sum(half)
    return (*half, middle, *reversed(half))
