"""A scene of links (standard input) by SymPy's Kane's method and PyDy's function of its equations,
stepped by SciPy's DOP853.
"""

import json
import sys
import time

import numpy as np
from pydy.codegen.ode_function_generators import generate_ode_function
from scipy.integrate import solve_ivp
from sympy.physics import mechanics

if __name__ == "__main__":
    document = json.load(sys.stdin)
    names, start = document["system"]["coordinates"], document["initial"]
    if names[0] != "q1":
        raise SystemExit("this program has links only.")
    gravity = float(document["parameters"]["g"])
    q = mechanics.dynamicsymbols(f"q1:{len(names) + 1}")
    u = mechanics.dynamicsymbols(f"u1:{len(names) + 1}")
    inertial, joint = mechanics.ReferenceFrame("N"), mechanics.Point("O")
    joint.set_vel(inertial, 0)
    masses, loads = [], []
    for k, (angle, rate) in enumerate(zip(q, u, strict=True)):
        frame = inertial.orientnew(f"A{k}", "Axis", (angle, inertial.z))
        frame.set_ang_vel(inertial, rate * inertial.z)
        end = joint.locatenew(f"P{k}", frame.x)
        end.v2pt_theory(joint, inertial, frame)
        masses.append(mechanics.Particle(f"M{k}", end, 1))
        loads.append((end, gravity * inertial.x))
        joint = end
    rates = [angle.diff() - rate for angle, rate in zip(q, u, strict=True)]
    method = mechanics.KanesMethod(inertial, q_ind=q, u_ind=u, kd_eqs=rates)
    method.kanes_equations(masses, loads)
    function = generate_ode_function(
        method.forcing_full, q, u, mass_matrix=method.mass_matrix_full, generator="lambdify"
    )
    begin = [float(start[part][name]) for part in ("positions", "velocities") for name in names]
    begun = time.process_time()
    found = solve_ivp(
        lambda t, y: function(y, t), (0, document["time"]), np.array(begin), "DOP853", rtol=1e-12, atol=1e-12
    )  # fmt: skip
    run, end = time.process_time() - begun, found.y[: len(names), -1].tolist()
    print(json.dumps({"seconds": time.process_time(), "run": run, "end": end}))
