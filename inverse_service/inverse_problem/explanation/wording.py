"""The sentences and formulas of an explanation."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.inverse_problem.explanation.differential_obstruction import Contradiction
from inverse_service.inverse_problem.explanation.elimination import Unknown
from inverse_service.inverse_problem.explanation.hierarchy import ConditionName, EquationName, SufficientSet
from inverse_service.inverse_problem.outcome import Step
from inverse_service.mechanics.curvature import Tensor11, Tensor12
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_SYMMETRIC = r"g_{ij} T^j_k = g_{kj} T^j_i"
_CYCLIC = r"g_{ij} R^j_{kl} + g_{lj} R^j_{ik} + g_{kj} R^j_{li} = 0"


@dataclass(frozen=True, slots=True)
class Explanation:
    """The steps, and the functions that were divided by and so must not vanish.

    `complete` says whether the steps carry the whole argument; where not, they state conditions and
    ranks.
    """

    steps: tuple[Step, ...]
    side_conditions: tuple[Expression, ...] = ()
    complete: bool = True


def opening(system: SecondOrderSystem, chosen: SufficientSet) -> Step:
    """What a multiplier has to fulfil."""
    numbering = ", ".join(f"{k + 1} for {name}" for k, name in enumerate(system.coordinates))
    text = (
        f"Suppose that there is a Lagrangian. Its Hessian g in the velocities is symmetric and nonsingular, and "
        f"{_conditions_sentence(chosen)} (indices: {numbering})."
    )
    return Step(text, _conditions_latex(chosen))


def _conditions_sentence(chosen: SufficientSet) -> str:
    plain = [c.name for c in chosen.conditions if not c.cyclic]
    cyclic = [c.name for c in chosen.conditions if c.cyclic]
    parts = []
    if plain:
        parts.append(f"g T is symmetric for T = {_listed(plain)}")
    if cyclic:
        others = "" if cyclic == ["R"] else f" for {_listed(cyclic)} in the place of R"
        parts.append(f"g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0{others}")
    return " and ".join(parts)


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _conditions_latex(chosen: SufficientSet) -> str:
    kinds = {c.cyclic for c in chosen.conditions}
    return r",\qquad ".join(formula for kind, formula in ((False, _SYMMETRIC), (True, _CYCLIC)) if kind in kinds)


def condition_latex(condition: ConditionName) -> str:
    """ "nabla^2 Phi" as LaTeX."""
    name = re.sub(r"nabla(\^(\d))?", lambda m: r"\nabla" + (f"^{{{m[2]}}}" if m[2] else ""), condition.name)
    return re.sub(r"\s*Phi", lambda _: r"\Phi", name)


def tensor_steps(
    ring: ExactRing, tensors: Sequence[tuple[ConditionName, Tensor11[Quotient] | Tensor12[Quotient]]]
) -> list[Step]:
    """The tensors of the chosen conditions, the nonzero components of curvatures only."""
    steps = []
    for condition, tensor in tensors:
        entries = _components(ring, condition, tensor)
        listed = ", ".join(f"{name} = {to_text(tree)}" for name, tree in entries) or "all zero"
        text = f"The components of {condition.name} that are not zero (row, column): {listed}."
        latex = r",\quad ".join(
            f"({condition_latex(condition)})^{{{name[0]}}}{{}}_{{{name[1:]}}} = {to_latex(tree)}"
            for name, tree in entries
        )
        steps.append(Step(text, latex))
    return steps


def _components(
    ring: ExactRing, condition: ConditionName, tensor: Tensor11[Quotient] | Tensor12[Quotient]
) -> list[tuple[str, Expression]]:
    """Index strings such as "12" or "213" with the nonzero components; k < l for T^j_kl."""
    found: list[tuple[str, Quotient]] = []
    span = range(len(tensor))
    if condition.cyclic:
        bend = cast("Tensor12[Quotient]", tensor)
        triples = [(i, k, m) for i in span for k in span for m in span if k < m]
        found = [(f"{i + 1}{k + 1}{m + 1}", bend[i][k][m]) for i, k, m in triples]
    else:
        plain = cast("Tensor11[Quotient]", tensor)
        found = [(f"{i + 1}{k + 1}", plain[i][k]) for i in span for k in span]
    return [(name, quotient_tree(ring, value)) for name, value in found if not value.is_zero]


def equation_name(name: EquationName) -> str:
    """ "(nabla Phi)_12"."""
    return f"({name.condition.name})_{''.join(str(i + 1) for i in name.indices)}"


def equation_step(
    name: EquationName,
    original: Expression,
    reduced: Expression,
    pivot: Symbol,
    result: Expression,
    divisors: Sequence[Expression],
) -> Step:
    """One equation, what is left of it, what may be divided by and what it gives."""
    sentences = [f"{equation_name(name)}: {to_text(original)} = 0."]
    if reduced != original:
        sentences.append(f"With what is known already: {to_text(reduced)} = 0.")
    reason = "Hence "
    if divisors:
        factors = list(dict.fromkeys(to_text(divisor) for divisor in divisors))
        reason = f"As {_listed(factors)} {'is' if len(factors) == 1 else 'are'} not zero identically, "
    sentences.append(f"{reason}{pivot.name} = {to_text(result)}.")
    latex = f"{to_latex(original)} = 0 \\;\\Longrightarrow\\; {to_latex(pivot)} = {to_latex(result)}"
    return Step(" ".join(sentences), latex)


def block_sentence(symbols: Mapping[Unknown, Symbol], rows: tuple[int, ...], columns: tuple[int, ...], n: int) -> Step:
    """Rows and columns whose common entries vanish: why g is singular."""
    names = sorted({symbols[min(r, c), max(r, c)].name for r in rows for c in columns})
    equal = " = ".join([*names, "0"])
    if len(rows) == 1 and len(columns) == n:
        why = f"row {rows[0] + 1} of g is zero"
    else:
        left, top = (_listed([str(k + 1) for k in part]) for part in (rows, columns))
        why = f"rows {left} of g have entries outside columns {top} only, too few for them to be independent"
    return Step(f"{equal}: {why}, hence det g = 0. There is no Lagrangian.", r"\det g = 0")


def summary_steps(system: SecondOrderSystem, chosen: SufficientSet) -> tuple[Step, ...]:
    """Conditions and ranks, for expressions too large to be followed by hand."""
    equations = _listed([equation_name(name) for name in chosen.equations])
    n = len(system.coordinates)
    text = (
        f"The linear equations {equations} on the {n * (n + 1) // 2} entries of g have rank {chosen.rank} at a generic "
        f"point; the symmetric matrices that fulfil them form a space of dimension {chosen.dimension}"
    )
    end = "so g = 0" if chosen.dimension == 0 else "in which every matrix is singular"
    closing = f"{text}, {end}: there is no Lagrangian."
    steps = [opening(system, chosen), Step(closing, r"\det g = 0")]
    if n == 2:
        text = "For each T the equation is g_11 T^1_2 + g_12 (T^2_2 - T^1_1) - g_22 T^2_1 = 0."
        steps.insert(1, Step(text, r"g_{11} T^1_2 + g_{12} (T^2_2 - T^1_1) - g_{22} T^2_1 = 0"))
    return tuple(steps)


def differential_summary(system: SecondOrderSystem) -> tuple[Step, ...]:
    """What is said where only the prolonged equations decide and no short argument was found."""
    names = ", ".join(system.coordinates)
    text = (
        "A nonsingular g survives every algebraic condition (Phi, nabla Phi, ..., R) at a generic point; the "
        f"Helmholtz conditions differentiated by {names} and the velocities leave only singular ones. The "
        "certificate lists the differentiated equations that were used."
    )
    return (Step(text, r"\Gamma(g) = gN + (gN)^{\mathsf T},\quad \partial_{v^k} g_{ij} = \partial_{v^j} g_{ik}"),)


def factor_steps(
    ring: ExactRing, system: SecondOrderSystem, direction: Tensor11[Quotient], found: Contradiction
) -> list[Step]:
    """g = e^u times a known matrix; the derivatives of u, and the two that contradict each other."""
    rows = [[quotient_tree(ring, entry) for entry in row] for row in direction]
    text = "[" + ", ".join("[" + ", ".join(map(to_text, row)) + "]" for row in rows) + "]"
    body = r" \\ ".join(" & ".join(map(to_latex, row)) for row in rows)
    steps = [
        Step(
            f"So the algebraic conditions fix g up to a factor, which must be found: g = e^u G with G = {text}.",
            rf"g = e^{{u}} \begin{{pmatrix}} {body} \end{{pmatrix}}",
        )
    ]
    for line in found.lines:
        tree = quotient_tree(ring, line.value)
        steps.append(Step(f"{line.reason}: {line.text} = {to_text(tree)}.", f"{line.latex} = {to_latex(tree)}"))
    tree = quotient_tree(ring, found.difference)
    steps.append(
        Step(
            f"But {found.text} would have to vanish and is {to_text(tree)}, which is not zero identically. "
            "There is no Lagrangian.",
            rf"{found.latex} = {to_latex(tree)} \neq 0",
        )
    )
    return steps
