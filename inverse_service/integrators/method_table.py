"""The table of methods: what each needs, its order, whether its steps are implicit, and what a step costs.

An additional explicit method is a file of the folder `explicit`: the order of one of Runge and Kutta is then one of
`runge-kutta`. Of those with an estimate of the error `adaptive` takes the lowest order, or the highest one where forces
do not depend on velocities and a step of the grid is too long for the lowest: it then takes the fewest forces.
Its coefficients are those of one-step methods: explicit and implicit Runge-Kutta, Rosenbrock, and compositions.

Gauss-Legendre collocation, the implicit methods of order 2 s, our own reference: J. C. Butcher, Math. Comp. 18 (1964)
50. Nodes and weights are computed to forty digits and rounded once.

RODAS of order 4 (3), L-stable, for stiff equations; linear systems replace Newton's method. With J = df/dy and
increments u_i of y' = f(t, y), where u_6 is the estimate of the error (E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (1996), IV.7 and table IV.10):

    u_i/(h gamma) - J u_i = f(t + c_i h, y + sum_j a_ij u_j) + sum_j (c_ij/h) u_j + h d_i f_t
    y_new = y + sum_j a_6j u_j + u_6

Compositions: substeps that lift a symmetric method of order 2 to order 4 (five; M. Suzuki, Phys. Lett. A 146 (1990)
319), 6 or 8 (nine and seventeen; W. Kahan, R.-C. Li, Math. Comp. 66 (1997) 1089). Required: a step that is its own
inverse with -h.
"""

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp

from inverse_service.integrators.trajectory import Array

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
STAGES = 6
Rows = tuple[tuple[float, ...], ...]
Row = tuple[float, ...]
_FIFTH = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950)
_MOTION = "equations of motion"


@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """Stages at `nodes`, with `rows` and `weights` for y' = f(t, y); a method of Nystrom has no rows, only zeros.

    For q'' = f(t, q): `places` and `ends` are those of positions, times h^2, `weights` of velocities, times h. `errors`
    and `end_errors` are the weights of estimates of the error, which fall as h^`falls`.
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


def _read(given: dict[str, Any]) -> Tableau:
    """One file, with the `rows` of a Runge-Kutta method, whose square is its `places`, or with `nodes` and `places`."""
    size, weights = len(given["weights"]), np.array(given["weights"])
    rows, places, errors, end_errors = (
        np.array([[*row, *[0.0] * (size - len(row))] for row in given.get(key, ())]).reshape(-1, size)
        for key in ("rows", "places", "errors", "end_errors")
    )
    nodes, ends = np.array(given.get("nodes")), np.array(given.get("ends"))
    if len(rows):
        nodes, places, ends, end_errors = rows.sum(axis=1), rows @ rows, weights @ rows, errors @ rows
    else:
        rows = np.zeros_like(places)
    return Tableau(given["name"], nodes, rows, places, weights, ends, errors, end_errors, given.get("falls", 0))


def _explicit() -> dict[int, Tableau]:
    """By order: each file of `explicit/` is a method. ValueError where two have one order."""
    found = dict[int, Tableau]()
    for path in sorted((Path(__file__).parent / "explicit").glob("*.toml")):
        given = tomllib.loads(path.read_text(encoding="utf-8"))
        if given["order"] in found:
            raise ValueError(f"{path.name} has the order of {found[given['order']].name}: keep one of them.")
        found[given["order"]] = _read(given)
    return dict(sorted(found.items()))


TABLEAUX = _explicit()
RUNGE_KUTTA = tuple(order for order, one in TABLEAUX.items() if one.rows.any())
PAIRS = tuple(order for order, one in TABLEAUX.items() if len(one.errors))  # with an estimate of the error


def composition(order: int) -> tuple[float, ...]:
    """Symmetric weights that add up to 1; KeyError for an order that is not in ORDERS."""
    half = _HALVES[order]
    middle = 1.0 - 2.0 * sum(half)
    return (*half, middle, *reversed(half))


@lru_cache(maxsize=8)
def collocation(stages: int = STAGES) -> tuple[Rows, Rows, tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """(A, A A, b, b A, c): the last forms serve q'' = f(q, q') without a detour."""
    with mp.workdps(40):
        legendre = np.polynomial.legendre.leg2poly([0] * stages + [1])  # exact: its coefficients are dyadic
        nodes = sorted((1 + zero) / 2 for zero in mp.polyroots([mp.mpf(float(c)) for c in legendre[::-1]], 200))
        powers = mp.matrix(stages, stages)
        integrals = mp.matrix(stages, stages)
        for i, node in enumerate(nodes):
            for k in range(stages):
                powers[i, k] = node**k
                integrals[i, k] = node ** (k + 1) / (k + 1)
        inverse = powers**-1
        matrix = integrals * inverse
        weights = mp.matrix([[mp.mpf(1) / (k + 1) for k in range(stages)]]) * inverse
        return (
            _rounded(matrix), _rounded(matrix * matrix), _rounded(weights)[0], _rounded(weights * matrix)[0],
            tuple(float(node) for node in nodes),
        )  # fmt: skip


def _rounded(matrix: Any) -> Rows:
    return tuple(tuple(float(matrix[i, j]) for j in range(matrix.cols)) for i in range(matrix.rows))


@dataclass(frozen=True, slots=True)
class Rosenbrock:
    """`rows` a_ij, `mixed` c_ij, `nodes` c_i, `slopes` d_i, stage by stage; the last stage ends the step."""

    gamma: float
    rows: tuple[Row, ...]
    mixed: tuple[Row, ...]
    nodes: Row
    slopes: Row
    order: int


RODAS = Rosenbrock(
    gamma=0.25,
    rows=(
        (),
        (1.544,),
        (0.9466785280815826, 0.2557011698983284),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817),
        _FIFTH,
        (*_FIFTH, 1.0),
    ),
    mixed=(
        (),
        (-5.6688,),
        (-2.430093356833875, -0.2063599157091915),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
        (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
    ),
    nodes=(0.0, 0.386, 0.21, 0.63, 1.0, 1.0),
    slopes=(0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0),
    order=4,
)


@dataclass(frozen=True, slots=True)
class Method:
    """`family`: "geometric", "explicit", "implicit", "taylor" or "exact"; figures have a color for each.

    `needs` and `cost` are for people. `orders` are those to choose from, the default first, empty where there is no
    choice; then `order` is the one there is, None where it varies. `uses`: "lagrangian" (of the constrained system),
    "free" (L~, or L where there are no constraints), "accelerations" or "quadrature". `tolerance` is the default of
    methods with steps of their own. `scipy` is the name of a peer in SciPy.
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
        return ", ".join(
            f"{order} (default)" if order == self.orders[0] else str(order) for order in sorted(self.orders)
        )

    @property
    def own_steps(self) -> bool:
        """Whether it chooses its step size."""
        return self.tolerance is not None

    @property
    def has_kernel(self) -> bool:
        """Whether it steps with a compiled kernel."""
        return self.uses != "quadrature" and self.family != "taylor" and not self.scipy


_EXPLICIT = tuple(sorted(RUNGE_KUTTA, key=lambda order: (order != 4, order)))
METHODS = {
    "variational": Method(
        "geometric",
        "free",
        "L~, or L where there are no constraints",
        "Newton's method",
        ORDERS,
        implicit=True,
        alpha=True,
    ),
    "stormer-verlet": Method(
        "geometric", "free", "L with constant masses and without magnetic terms", "1 force", ORDERS, alpha=True
    ),
    "nonholonomic": Method(
        "geometric", "lagrangian", "L and constraints", "Newton's method", ORDERS, implicit=True, alpha=True
    ),
    "modified": Method("geometric", "free", "L~ and constraints", "Newton's method", ORDERS, implicit=True, alpha=True),
    "runge_kutta": Method("explicit", "accelerations", _MOTION, "a force for each stage", _EXPLICIT),
    "adaptive": Method("explicit", "accelerations", _MOTION, "12 forces at order 8, 17 at order 12", tolerance=1e-12),
    "stiff": Method(
        "implicit", "accelerations", _MOTION, "6 forces, linear equations", order=4, implicit=True, tolerance=1e-8
    ),
    "reference": Method("implicit", "accelerations", _MOTION, "some 6 times 8 forces", order=12, implicit=True),
    "heyoka": Method("taylor", "accelerations", f"{_MOTION}, the extra heyoka", "a Taylor series", tolerance=1e-15),
    "exact": Method("exact", "quadrature", "constant coefficients, constraints of one coordinate, one direction", "-"),
    "scipy_dop853": Method("explicit", "accelerations", _MOTION, "12 forces", order=8, tolerance=1e-15, scipy="DOP853"),
    "scipy_radau": Method(
        "implicit", "accelerations", _MOTION, "Newton's method", order=5, implicit=True, tolerance=1e-15, scipy="Radau"
    ),
    "scipy_lsoda": Method(
        "implicit", "accelerations", _MOTION, "1 force or Newton's method", tolerance=1e-15, scipy="LSODA"
    ),
}
# In scenes; "stormer-verlet" is a form of the variational method inside.
NAMES = tuple(name.replace("_", "-") for name, method in METHODS.items() if not method.scipy)
OWN_STEPS = frozenset(name for name, method in METHODS.items() if method.own_steps and not method.scipy)
SCIPY = {name: method.scipy for name, method in METHODS.items() if method.scipy}
GEOMETRIC = frozenset(name for name, method in METHODS.items() if method.alpha)
USES_FREE = frozenset(name for name, method in METHODS.items() if method.uses == "free")
USES_ACCELERATIONS = frozenset(name for name, method in METHODS.items() if method.uses == "accelerations")
POINT_METHODS = USES_ACCELERATIONS - {"heyoka", *SCIPY}  # kernels on positions and velocities
