"""The table of methods: what each needs, its order, whether its steps are implicit, and what a step costs.

A further explicit Runge-Kutta method is a file of the folder `explicit`: its order is then one of `runge-kutta`.
"""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.integrators.tableaux import ORDERS, TABLEAUX


@dataclass(frozen=True, slots=True)
class Method:
    """`family`: "geometric", "explicit", "implicit", "taylor" or "exact"; figures have a color for each.

    `needs` and `cost` are for people. `orders` are those to choose from, empty where there is no choice; then `order`
    is the one there is, None where it varies. `uses`: "lagrangian" (of the constrained system), "free" (L~, or L where
    there are no constraints), "accelerations" or "quadrature". `tolerance` is the default of methods with steps of
    their own. `scipy` is the name of a peer in SciPy.
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
    def own_steps(self) -> bool:
        """Whether it chooses its steps."""
        return self.tolerance is not None

    @property
    def has_kernel(self) -> bool:
        """Whether it steps with a kernel of ours."""
        return self.uses != "quadrature" and self.family != "taylor" and not self.scipy


_MOTION = "equations of motion"
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
    "runge_kutta": Method("explicit", "accelerations", _MOTION, "4, 6 or 12 forces", tuple(TABLEAUX)),
    "adaptive": Method("explicit", "accelerations", _MOTION, "12 forces", order=8, tolerance=1e-12),
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
