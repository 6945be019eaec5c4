"""One scene (standard input) by SymPy and SciPy: derived, lambdified, its mass matrix solved at
each step of DOP853.
"""

import json
import sys
import time

import numpy as np
import sympy
from scipy.integrate import solve_ivp

if __name__ == "__main__":
    document = json.load(sys.stdin)
    names, start = document["system"]["coordinates"], document["initial"]
    q, v = (sympy.symbols([prefix + name for name in names]) for prefix in ("", "v_"))
    text = document["system"]["lagrangian"].replace("^", "**")
    for name in sorted(names, key=len, reverse=True):
        text = text.replace(f"{name}'", f"v_{name}")
    lagrangian = sympy.sympify(text, locals={str(x): x for x in (*q, *v)}).subs(
        document["parameters"]
    )
    momenta = [lagrangian.diff(x) for x in v]
    right = [
        lagrangian.diff(x) - sum(p.diff(y) * speed for y, speed in zip(q, v, strict=True))
        for x, p in zip(q, momenta, strict=True)
    ]
    function = sympy.lambdify([q, v], [[[p.diff(x) for x in v] for p in momenta], right], cse=True)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        masses, forces = function(*np.split(y, 2))
        return np.concatenate(
            [y[len(q) :], np.linalg.solve(np.array(masses, float), np.array(forces, float))]
        )

    begin = [float(start[part][name]) for part in ("positions", "velocities") for name in names]
    begun = time.process_time()
    found = solve_ivp(rates, (0, document["time"]), begin, "DOP853", rtol=1e-12, atol=1e-12)
    run, end = time.process_time() - begun, found.y[: len(names), -1].tolist()
    print(json.dumps({"seconds": time.process_time(), "run": run, "end": end}))
