"""Maxima for the algebraic part: Phi, nabla Phi, R, the linear conditions on g, and det of the
remaining g.

It stops at algebraic conditions, so its "variational" only says "not excluded".

    apt-get install maxima
    python -m benchmarks.peers.maxima < system.json
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from typing import Any

import sympy

from benchmarks.decision_benchmark import read
from benchmarks.sympy_form import to_sympy
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_SCRIPT = """
display2d: false$ linsolvewarn: false$ solveradcan: false$
n: {n}$ q: [{positions}]$ v: [{velocities}]$ f: [{forces}]$
along(e) := sum(v[k]*diff(e, q[k]) + f[k]*diff(e, v[k]), k, 1, n)$
slope: genmatrix(lambda([i, j], diff(f[i], v[j])), n, n)$
place: genmatrix(lambda([i, j], diff(f[i], q[j])), n, n)$
bend(phi, j, k, m) := diff(phi[j, k], v[m]) - diff(phi[j, m], v[k])$
g: genmatrix(lambda([i, j], concat(g, min(i, j), "_", max(i, j))), n, n)$
skew(a) := block([p: g . a], create_list(p[i, j] - p[j, i], i, 1, n, j, i + 1, n))$
cycle(phi, i, k, m) := sum(
  g[i, j]*bend(phi, j, k, m) + g[m, j]*bend(phi, j, i, k) + g[k, j]*bend(phi, j, m, i), j, 1, n)$
unknowns: listofvars(create_list(g[i, j], i, 1, n, j, i, n))$
verdict() := block([phi, nabla, conditions, left],
  phi: fullratsimp(matrixmap(along, slope) - 2*place - slope . slope / 2),
  nabla: fullratsimp(matrixmap(along, phi) - slope . phi / 2 + phi . slope / 2),
  conditions: append(skew(phi), skew(nabla)),
  for i: 1 thru n do for k: i + 1 thru n do for m: k + 1 thru n do
    conditions: endcons(cycle(phi, i, k, m), conditions),
  conditions: delete(0, map(fullratsimp, conditions)),
  left: if conditions = [] then g else subst(linsolve(conditions, unknowns), g),
  is(fullratsimp(determinant(left)) = 0))$
began: elapsed_run_time()$
runs: 0$
while runs < 2000 and elapsed_run_time() - began < 0.3 do (singular: verdict(), runs: runs + 1)$
spent: (elapsed_run_time() - began)/runs$
print("VERDICT", if singular then "not_variational" else "variational")$
print("SECONDS", float(spent))$
"""


def measured(document: dict[str, Any]) -> dict[str, Any]:
    """Verdict and seconds of the computation alone, the mean of enough runs.

    {"missing": True} if Maxima is not installed, {"stopped": True} past the limit.
    """
    if shutil.which("maxima") is None:
        return {"missing": True}
    command = ["maxima", "--very-quiet", f"--batch-string={_script(read(document))}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode < 0:  # stopped by the limit on processor time
        return {"stopped": True}
    verdict = re.search(r"VERDICT (\w+)\s*$", done.stdout, re.MULTILINE)
    seconds = re.search(r"SECONDS ([\d.eE+-]+)\s*$", done.stdout, re.MULTILINE)
    if verdict is None or seconds is None:
        raise RuntimeError(f"Maxima said {done.stdout[-500:]}")
    return {"verdict": verdict[1], "seconds": float(seconds[1])}


def _script(system: SecondOrderSystem) -> str:
    n = len(system.coordinates)
    positions, velocities = [f"q{k + 1}" for k in range(n)], [f"v{k + 1}" for k in range(n)]
    names = {
        sympy.Symbol(name): sympy.Symbol(positions[k]) for k, name in enumerate(system.coordinates)
    }
    names |= {
        sympy.Symbol(f"{name}'"): sympy.Symbol(velocities[k])
        for k, name in enumerate(system.coordinates)
    }
    forces = [
        str(to_sympy(f).subs(names, simultaneous=True)).replace("**", "^")
        for f in system.accelerations
    ]
    return _SCRIPT.format(
        n=n, positions=",".join(positions), velocities=",".join(velocities), forces=",".join(forces)
    )


if __name__ == "__main__":
    print(json.dumps(measured(json.load(sys.stdin))))
