"""Other ways to run the same equations: numba, and lambdify with fsolve."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import symengine

from benchmarks.simulation_cases import SpeedCase, lane, program
from inverse_service.kernels.codegen.compiled import (
    Compiled,
    card_of,
    kernel_text,
    load,
    object_code,
)
from inverse_service.kernels.codegen.program import Assign, Program, Solve, changing
from inverse_service.simulation.execution import Prepared
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.scene_data import Grid

Runner = Callable[[int], float]  # steps -> seconds


def ours(case: SpeedCase) -> Runner:
    """LLVM IR compiled in this process."""
    made = program(case)
    return _kernel_runner(case, Compiled(card_of(made), load(object_code(kernel_text(made))), {}))


def _kernel_runner(case: SpeedCase, kernel: Compiled) -> Runner:
    def go(steps: int) -> float:
        found = Prepared(Formulas(case.problem), case.choice, kernel, lane(case)).go(
            Grid(0.01, steps, steps)
        )
        assert found.completed.all()
        return found.seconds

    return go


def with_numba(case: SpeedCase, folder: Path) -> Runner:
    """The same step as Python text for numba.njit, common parts found by symengine."""
    made = program(case)
    name = f"numba_{abs(hash(case.label))}"
    path = folder / f"{name}.py"
    path.write_text(python_text(made), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    numbers = lane(case)
    values = [
        numbers.get(name, 0.0) for name in (*made.state, *(f"{u}_rate" for u in made.unknowns))
    ]
    given = [numbers[name] for name in made.arguments]

    def go(steps: int) -> float:
        begin = time.perf_counter()
        module.run(steps, *values, *given)
        return time.perf_counter() - begin

    go(1)
    return go


def python_text(made: Program) -> str:
    """A function run(steps, state, rates, arguments) with Newton by Cramer's rule and compensated
    sums.
    """
    rates = [f"{name}_rate" for name in made.unknowns]
    names = changing(made)
    lines = ["from math import *", "import numba", "", "@numba.njit(fastmath=False)"]
    lines += [f"def run(steps, {', '.join([*made.state, *rates, *made.arguments])}):"]
    lines += [f"    {name}_low = 0.0" for name in names]
    lines += ["    for step in range(steps):"]
    for statement in made.statements:
        if isinstance(statement, Assign):
            lines += _assigned([statement.name], [statement.formula], 8)
        elif isinstance(statement, Solve):
            lines += _solve_text(statement)
    updates = [update for update in made.updates if update is not None]
    lines += _assigned([f"add_{name}" for name in names], updates, 8)
    for name in names:
        lines += [f"        part = add_{name} - {name}_low", f"        total = {name} + part"]
        lines += [f"        {name}_low = (total - {name}) - part", f"        {name} = total"]
    return "\n".join([*lines, f"    return {', '.join(made.state)}", ""])


def _assigned(names: list[str], formulas: list[Any], indent: int) -> list[str]:
    replaced, reduced = symengine.cse(formulas)
    pairs = [*((f"_{name}", part) for name, part in replaced), *zip(names, reduced, strict=True)]
    table = {name: symengine.Symbol(f"_{name}") for name, _ in replaced}
    return [" " * indent + f"{name} = {part.subs(table)}" for name, part in pairs]


def _solve_text(block: Solve) -> list[str]:
    size = len(block.unknowns)
    start = "0.0" if block.affine else "{0}_rate * h"
    lines = [f"        {name} = {start.format(name)}" for name in block.unknowns]
    lines += [f"        for sweep in range({1 if block.affine else 16}):"]
    entries = [entry for row in block.jacobian for entry in row]
    names = [*(f"F{k}" for k in range(size)), *(f"J{k}" for k in range(size * size))]
    lines += _assigned(names, [*block.residuals, *entries], 12)
    if size == 1:
        lines += ["            D0 = F0 / J0"]
    elif size == 2:
        lines += ["            det = J0 * J3 - J1 * J2"]
        lines += [
            "            D0 = (F0 * J3 - J1 * F1) / det",
            "            D1 = (J0 * F1 - F0 * J2) / det",
        ]
    else:
        raise NotImplementedError("blocks of more than two unknowns")
    lines += [f"            {name} -= D{k}" for k, name in enumerate(block.unknowns)]
    small = " and ".join(
        f"abs(D{k}) <= 1e-9 * abs({name})" for k, name in enumerate(block.unknowns)
    )
    lines += [f"            if {small}:", "                break"]
    return [*lines, *(f"        {name}_rate = {name} / h" for name in block.unknowns)]


def lambdify_and_fsolve(case: SpeedCase) -> Runner:
    """Integrate as a user would: residuals of all unknowns by SymPy's lambdify, SciPy's fsolve at
    each step.
    """
    import numpy as np
    import sympy
    from scipy.optimize import fsolve

    residuals, unknowns, state, steps_of = _sympy_equations(case, sympy)
    arguments = [sympy.Symbol(name) for name in ("h", "a", "c0")]
    function = sympy.lambdify([unknowns, state, arguments], residuals, "numpy")
    update = sympy.lambdify([unknowns, state, arguments], steps_of, "numpy")
    given = lane(case)
    first = np.array([given.get(str(name), 0.0) for name in state])
    values = [given[str(name)] for name in arguments]

    def go(steps: int) -> float:
        start = time.perf_counter()
        now, guess = first.copy(), np.full(len(unknowns), 1e-3)
        for _ in range(steps):
            guess = fsolve(lambda u, now=now: function(u, now, values), guess, xtol=1e-12)
            now = now + np.array(update(guess, now, values))
        return time.perf_counter() - start

    return go


def _sympy_equations(
    case: SpeedCase, sympy: Any
) -> tuple[list[Any], list[Any], list[Any], list[Any]]:
    """(residuals, unknowns, state, increments) of the whole step before anything is eliminated."""
    from inverse_service.integrators.variational import hamiltonian_step, lagrange_dalembert_step
    from inverse_service.kernels.codegen.symengine_trees import STEP
    from inverse_service.simulation.schemes import alpha_of, parts_of

    f = Formulas(case.problem)
    q, p, d, e = (f.symbols(letter) for letter in "qpde")
    if case.choice.method == "variational":
        by_q, by_p = (f.gradient(f.hamiltonian, letter, "p") for letter in "qp")
        equations, pushes = hamiltonian_step(q, p, d, e, STEP, alpha_of(case.choice), by_q, by_p)
        unknowns = [*d, *e]
    else:
        m = np.array([symengine.Symbol(f"m{k}") for k in range(len(f.forms))])
        by_q, by_v = (f.gradient(f.lagrangian, letter) for letter in "qv")
        parts = parts_of(case.choice)
        equations, pushes = lagrange_dalembert_step(
            q, p, d, m, STEP, parts, by_q, by_v, f.forms_at, f.drifts_at
        )
        unknowns = [*d, *m]
    groups = (equations, unknowns, [*q, *p], [*d, *pushes])
    return tuple([sympy.sympify(item) for item in group] for group in groups)  # type: ignore[return-value]
