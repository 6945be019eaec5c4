"""Blocks that fall apart in other velocities y = M v, such as exp(x') + exp(x' + y').

p_v = M^T p_y, so a transform in y with p_y = M^-T p_v gives H and v = M^-1 y.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Monomial, Term, monomial_tree
from inverse_service.expressions.tree import ONE, ZERO, Apply, Expression, Symbol, Velocity, add, number, substitute
from inverse_service.mechanics.legendre.blocks import Block, Branch, Solver
from inverse_service.mechanics.legendre.forms import simplified, velocities_in
from inverse_service.mechanics.legendre.quadratic import Inverse, invert

Form = tuple[Expression, ...]
Table = dict[Expression, Expression]


def linear_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches after a change to the linear forms under functions and powers, completed by velocities."""
    found = _forms(block) if len(block.names) > 1 else ()
    units = _units(block.names)
    if not found or set(found) <= set(units):
        return
    for chosen in combinations(units, len(block.names) - len(found)):
        inverse = invert((*found, *chosen))
        if inverse is not None:
            yield from after_change(block, (*found, *chosen), inverse, solve)


def after_change(
    block: Block, forms: Sequence[Form], inverse: Inverse, solve: Solver, written: Table | None = None
) -> Iterator[Branch]:
    """The branches with the forms in the place of velocities; `written` replaces forms that stand there as they are."""
    velocities = [Velocity(name) for name in block.names]
    symbols = [block.momenta[name] for name in block.names]
    rates = _table(velocities, [_product(row, velocities) for row in inverse.entries])
    changed = substitute(block.function, rates | (written or {}))
    columns = zip(*inverse.entries, strict=True)
    momenta = _table(symbols, [simplified(_product(column, symbols)) for column in columns])
    new = _table(velocities, [_product(row, velocities) for row in forms])
    for branch in solve(changed, block.names, block.momenta):
        found = [substitute(tree, momenta) for tree in branch.velocities]
        yield Branch(
            tuple(simplified(_product(row, found)) for row in inverse.entries),
            substitute(branch.hamiltonian, momenta),
            tuple(substitute(condition, {**new, **momenta}) for condition in branch.conditions),
        )


def _table(keys: Sequence[Symbol | Velocity], values: Sequence[Expression]) -> Table:
    return dict(zip(keys, values, strict=True))


def _product(row: Sequence[Expression], column: Sequence[Expression]) -> Expression:
    return add(*(a * b for a, b in zip(row, column, strict=True)))


def _units(names: Sequence[str]) -> tuple[Form, ...]:
    return tuple(tuple(number(int(a == b)) for b in names) for a in names)


def _forms(block: Block) -> tuple[Form, ...]:
    """The linear forms on which functions and powers depend; none where there are too many, or others."""
    found: dict[Form, None] = {}
    for monomial, _ in expand(block.function):
        forms = _forms_of(monomial, block.names)
        if forms is None:
            return ()
        found.update(dict.fromkeys(forms))
    return tuple(found) if len(found) <= len(block.names) else ()


def _forms_of(monomial: Monomial, names: Sequence[str]) -> list[Form] | None:
    """The linear forms in the atoms of a term, bare velocities not counted; None where one is not linear."""
    exponent: dict[str, Expression] = {}
    forms: list[Form | None] = []
    for base, power in monomial:
        if isinstance(base, Velocity) or not velocities_in(base, names):
            continue
        part = _inside(base, names)
        if isinstance(base, Apply) and base.function == "exp" and part:
            for name, value in part.items():
                exponent[name] = exponent.get(name, ZERO) + power * value
        else:
            forms.append(_monic(part, names))
    if exponent:
        forms.append(_monic(exponent, names))
    return None if None in forms else [form for form in forms if form]


def _inside(base: Expression, names: Sequence[str]) -> Mapping[str, Expression] | None:
    return linear_coefficients(expand(base.argument if isinstance(base, Apply) else base), names)


def _monic(coefficients: Mapping[str, Expression] | None, names: Sequence[str]) -> Form | None:
    if not coefficients:
        return None
    first = next(coefficients[name] for name in names if name in coefficients)
    return tuple(simplified(coefficients.get(name, ZERO) / first) for name in names)


def linear_coefficients(terms: Iterable[Term], names: Sequence[str]) -> Mapping[str, Expression] | None:
    """The coefficients of the velocities in terms that are linear in them (free terms allowed), else None."""
    found: dict[str, Expression] = {}
    for monomial, value in terms:
        inside = velocities_in(monomial_tree(monomial), names)
        if not inside:
            continue
        name = next(iter(inside))
        rest = tuple(pair for pair in monomial if pair != (Velocity(name), Fraction(1)))
        if len(rest) != len(monomial) - 1 or velocities_in(monomial_tree(rest), names):
            return None
        term = value * (monomial_tree(rest) if rest else ONE)
        found[name] = found.get(name, ZERO) + term
    return found
