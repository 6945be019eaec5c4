"""From equations F(u) = 0 to statements: eliminate, take apart into blocks, solve what is left.

Unknowns whose equation has a constant pivot are eliminated symbolically; the rest is put into block triangular
form (matching, then strongly connected components, Tarjan 1972), so that only what is truly coupled is iterated.

The block triangular form of a square pattern: which unknowns must be solved for together.

A matching gives each unknown an equation of its own; the blocks are the strongly connected components of "the
equation of u contains v" (R. Tarjan, SIAM J. Comput. 1 (1972) 146), each after all that it depends on.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import symengine

from inverse_service.errors import InputError
from inverse_service.expressions.graphs import components, matching
from inverse_service.kernels.codegen.program import Assign, Solve, Statement
from inverse_service.kernels.codegen.symengine_trees import STEP, ZERO, Formula, contains, free_names, slope, symbol

_LARGEST_GUARDED = 4
_PARAMETER = re.compile(r"h|c\d+")


def plan(
    equations: Sequence[Formula],
    unknowns: Sequence[str],
    scales: Mapping[str, str],
    guarded: bool = False,
    poles: bool = False,
) -> tuple[Statement, ...]:
    """Statements that compute the unknowns; `scales` names the state variable of which each is the increment.

    `guarded` blocks are compared with their determinant at h -> 0. With `poles` an unknown whose factor is a
    reciprocal, as in u/cos(q) = p, is eliminated too: u = p cos(q) is smooth where the equation has a pole.
    """
    left, rest, assigned = _eliminate(list(equations), list(unknowns), poles)
    statements: list[Statement] = []
    for rows, names in _blocks(left, rest):
        statements.append(_block([left[row] for row in rows], names, scales, guarded))
    return (*statements, *reversed(assigned))


def _eliminate(
    equations: list[Formula], unknowns: list[str], poles: bool
) -> tuple[list[Formula], list[str], list[Assign]]:
    """Equations with a pivot that never vanishes are solved for it and put into the others."""
    assigned: list[Assign] = []
    while (pivot := _best_pivot(equations, unknowns, poles)) is not None:
        row, name = pivot
        variable = symbol(name)
        equation = equations.pop(row)
        factor = equation.diff(variable)
        value = -equation.subs({variable: ZERO}) / factor
        if not _is_number(factor):
            value = value.expand()
        equations[:] = [e.subs({variable: value}) if contains(e, variable) else e for e in equations]
        unknowns.remove(name)
        assigned.append(Assign(name, value))
    return equations, unknowns, assigned


def _best_pivot(equations: Sequence[Formula], unknowns: Sequence[str], poles: bool) -> tuple[int, str] | None:
    """The pivot whose elimination spreads least: (equations touched, other unknowns brought in)."""
    names = set(unknowns)
    present = [free_names(equation) & names for equation in equations]
    best: tuple[tuple[int, int, int], tuple[int, str]] | None = None
    for row, equation in enumerate(equations):
        for place, name in enumerate(unknowns):
            if name not in present[row]:
                continue
            factor = equation.diff(symbol(name))
            if not (_is_number(factor) or (poles and _is_reciprocal(factor, name))):
                continue
            touched = sum(name in other for k, other in enumerate(present) if k != row)
            others = len(present[row]) - 1
            rank = (touched * others, others, place)
            if best is None or rank < best[0]:
                best = (rank, (row, name))
    return best[1] if best else None


def _is_number(factor: Formula) -> bool:
    """A number other than zero: it vanishes nowhere, and no power of h makes a difference of increments large."""
    return factor != ZERO and not factor.free_symbols


def _is_reciprocal(whole: Formula, name: str) -> bool:
    """A number over powers of something without the unknown: it has poles but no zeros. Parameters may stand above."""
    if contains(whole, symbol(name)) or not whole.free_symbols:
        return False
    factors = whole.args if isinstance(whole, symengine.Mul) else (whole,)
    return all(
        not (names := free_names(factor))
        or all(_PARAMETER.fullmatch(one) for one in names)
        or (isinstance(factor, symengine.Pow) and factor.args[1].is_Number and factor.args[1] < 0)
        for factor in factors
    )


def _blocks(equations: Sequence[Formula], unknowns: Sequence[str]) -> list[tuple[list[int], list[str]]]:
    """Rows and unknowns of the diagonal blocks, in the order in which they can be solved."""
    if not unknowns:
        return []
    present = [free_names(equation) for equation in equations]
    owners = matching([[row for row, names in enumerate(present) if name in names] for name in unknowns])
    row_of = {unknowns[place]: row for row, place in owners.items()}
    if len(row_of) < len(unknowns):
        raise InputError("The equations of a step do not determine it: the Lagrangian is degenerate.")
    graph = {
        name: [other for other in unknowns if other != name and other in present[row_of[name]]] for name in unknowns
    }
    return [([row_of[name] for name in names], names) for names in components(graph)]


def _block(equations: Sequence[Formula], names: Sequence[str], scales: Mapping[str, str], guarded: bool) -> Solve:
    variables = [symbol(name) for name in names]
    jacobian = tuple(tuple(slope(equation, variable) for variable in variables) for equation in equations)
    compared = guarded and len(names) <= _LARGEST_GUARDED
    affine = not any(contains(entry, variable) for row in jacobian for entry in row for variable in variables)
    return Solve(
        unknowns=tuple(names),
        residuals=tuple(equations),
        jacobian=jacobian,
        affine=affine,
        scales=tuple(scales.get(name, "") for name in names),
        limit=limit_at_zero_step(jacobian, variables) if compared and not affine else None,
    )


def limit_at_zero_step(jacobian: Sequence[Sequence[Formula]], variables: Sequence[Formula]) -> Formula | None:
    """The determinant for h -> 0 at fixed rates u/h; None where the form does not show it."""
    rates = {variable: STEP * symbol(f"{variable}_w") for variable in variables}
    back = {symbol(f"{variable}_w"): variable / STEP for variable in variables}
    try:
        rows = [[_at_zero_step(entry.subs(rates)) for entry in row] for row in jacobian]
        value = determinant(rows).subs(back)
    except (RuntimeError, ZeroDivisionError):
        return None
    known = all(word not in str(value) for word in ("zoo", "nan", "oo"))
    return value if known and value != ZERO else None


def _at_zero_step(entry: Formula) -> Formula:
    """The entry at h = 0. Expanded only where it is divided by h: a power of a sum has thousands of terms."""
    return (entry.expand() if _is_divided_by_step(entry) else entry).subs({STEP: ZERO})


def _is_divided_by_step(formula: Formula) -> bool:
    if not contains(formula, STEP):
        return False
    if isinstance(formula, symengine.Pow) and formula.args[0] == STEP:
        return not (formula.args[1].is_Number and formula.args[1] > 0)
    return any(map(_is_divided_by_step, formula.args))


def determinant(rows: Sequence[Sequence[Formula]]) -> Formula:
    """By expansion along the first row."""
    if len(rows) == 1:
        return rows[0][0]
    terms = [
        (-1) ** place * entry * determinant([[*row[:place], *row[place + 1 :]] for row in rows[1:]])
        for place, entry in enumerate(rows[0])
        if entry != ZERO
    ]
    return sum(terms, ZERO)


def used_only(statements: Sequence[Statement], formulas: Sequence[Formula]) -> tuple[Statement, ...]:
    """The statements without assignments that nothing after them needs."""
    needed = {name for formula in formulas for name in free_names(formula)}
    kept: list[Statement] = []
    for statement in reversed(statements):
        if isinstance(statement, Assign):
            if statement.name not in needed:
                continue
            needed |= free_names(statement.formula)
        elif isinstance(statement, Solve):
            entries = [entry for row in statement.jacobian for entry in row]
            limits = [statement.limit] if statement.limit is not None else []
            needed |= {name for part in (*statement.residuals, *entries, *limits) for name in free_names(part)}
        else:
            needed |= {name for part in statement.formulas for name in free_names(part)}
        kept.append(statement)
    return tuple(reversed(kept))
