"""SymPy objects in and out: equations, LagrangesMethod and KanesMethod to results whose parts are SymPy expressions.

>>> from sympy import Eq, Function, Symbol
>>> from inverse_service.sympy import solve
>>> t, w, x = Symbol("t"), Symbol("omega"), Function("x")(Symbol("t"))
>>> solve(Eq(x.diff(t, 2), -(w**2) * x)).lagrangian
-omega**2*x(t)**2/2 + Derivative(x(t), t)**2/2

SymPy is imported by the first call. Nothing is guessed: applied functions of the time with second derivatives are
coordinates, other functions of it and functions of coordinates are arbitrary, the other symbols are parameters. No text
is evaluated: our own reader reads what SymPy prints. Installing python-flint, which this package needs, switches
SymPy's ground types; nothing here sets SYMPY_GROUND_TYPES, and the bridge works under all of them.
"""

from inverse_service.sympy.objects import (
    Result,
    document,
    from_result,
    helmholtz,
    nonholonomic,
    solve,
    solve_many,
    table,
)

__all__ = [
    "Result",
    "document",
    "from_result",
    "helmholtz",
    "nonholonomic",
    "solve",
    "solve_many",
    "table",
]
