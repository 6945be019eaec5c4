"""A program for ModelingToolkit.jl: the motion as a system of second-order equations, with L and H as expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from inverse_service.sympy import code

if TYPE_CHECKING:
    from inverse_service.sympy.result_objects import Answer

HEAD = """using ModelingToolkit
using ModelingToolkit: t_nounits as t, D_nounits as D
"""


def written(answer: Answer) -> str:
    """`mtkcompile(motion)` reduces it to first order; momenta are the variables p_x."""
    table = answer._table
    given = code.arguments_of(answer, "accelerations")
    plain = code.plain_symbols(given, answer, code.LANGUAGES["julia"])
    names = {name: str(plain[each]) for name, each in table.coordinates.items()}
    # D(x) is written where the printer of Julia would write the symbol of the velocity.
    speeds = {plain[table.velocity(name)]: sympy.Symbol(f"D({names[name]})") for name in names}

    def text(expression: Any) -> str:
        shown = code.with_plain(expression, plain)
        code.refuse_functions([shown], answer)
        return str(sympy.julia_code(shown.subs(speeds)))

    parameters = [str(plain[each]) for each in table.parameters.values()]
    lines = [HEAD] + ([f"@parameters {' '.join(parameters)}"] if parameters else [])
    lines.append(f"@variables {' '.join(f'{name}(t)' for name in names.values())}")
    pairs = zip(names.values(), answer.accelerations, strict=True)
    lines += ["equations = [", *(f"    D(D({name})) ~ {text(f)}," for name, f in pairs), "]"]
    lines.append("@named motion = System(equations, t)")
    if answer.lagrangian is not None:
        lines += [f"# where {one}" for one in code.conditions_of(answer, "lagrangian")]
        lines.append(f"L = {text(answer.lagrangian)}")
    hamiltonian = answer.hamiltonian
    if hamiltonian is not None:
        if not hamiltonian.implicit:
            lines.append(f"@variables {' '.join(map(str, hamiltonian.momenta))}")
        lines += [f"# where {one}" for one in code.conditions_of(answer, "hamiltonian")]
        lines.append(f"H = {text(hamiltonian.expr)}")
    return "\n".join(lines) + "\n"
