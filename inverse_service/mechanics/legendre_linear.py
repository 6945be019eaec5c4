"""Blocks that fall apart in other velocities y = M v, such as exp(x') + exp(x' + y').

p_v = M^T p_y, so a transform in y with p_y = M^-T p_v gives H and v = M^-1 y.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Monomial, monomial_tree
from inverse_service.expressions.tree import (
    ONE,
    ZERO,
    Apply,
    Expression,
    Symbol,
    Velocity,
    add,
    divide,
    multiply,
    number,
    substitute,
)
from inverse_service.mechanics.legendre_blocks import Block, split
from inverse_service.mechanics.legendre_branch import Branch, Solver, resolved
from inverse_service.mechanics.legendre_forms import simplified, velocities_in
from inverse_service.mechanics.legendre_quadratic import invert

Form = tuple[Expression, ...]


def linear_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches after the change to the linear forms that occur, where these are as many as velocities."""
    forms = _forms(block) if len(block.names) > 1 else None
    inverse = invert(forms) if forms is not None else None
    if forms is None or inverse is None:
        return
    velocities = [Velocity(name) for name in block.names]
    old = _table(velocities, [_product(row, velocities) for row in inverse.entries])
    changed = substitute(block.function, old)
    if len(split(changed, block.names, block.momenta).blocks) < 2:
        return
    columns = list(zip(*inverse.entries, strict=True))
    momenta = _table(
        [block.momenta[name] for name in block.names],
        [_product(column, [block.momenta[name] for name in block.names]) for column in columns],
    )
    new = _table(velocities, [_product(row, velocities) for row in forms])
    for branch in solve(changed, block.names, block.momenta):
        rates = [substitute(tree, momenta) for tree in resolved(branch.velocities, block.names)]
        yield Branch(
            tuple(simplified(_product(row, rates)) for row in inverse.entries),
            substitute(branch.hamiltonian, momenta),
            tuple(substitute(condition, new) for condition in branch.conditions),
        )


def _table(keys: Sequence[Symbol | Velocity], values: Sequence[Expression]) -> dict[Expression, Expression]:
    return dict(zip(keys, values, strict=True))


def _product(row: Sequence[Expression], column: Sequence[Expression]) -> Expression:
    return add(*(multiply(a, b) for a, b in zip(row, column, strict=True)))


def _forms(block: Block) -> tuple[Form, ...] | None:
    """The linear forms of the terms, one for each term; None unless there are as many as velocities."""
    found: dict[Form, None] = {}
    for monomial, _ in expand(block.function).terms:
        form = _form_of(monomial, block.names)
        if form is None:
            return None
        found[form] = None
    return tuple(found) if len(found) == len(block.names) else None


def _form_of(monomial: Monomial, names: Sequence[str]) -> Form | None:
    """The one linear form on which a term depends, its first coefficient being 1."""
    exponent: dict[str, Expression] = {}
    forms = set()
    for base, power in monomial:
        if isinstance(base, Apply) and base.function == "exp" and velocities_in(base, names):
            part = linear_coefficients(base.argument, names)
            if part is None:
                return None
            for name, value in part.items():
                exponent[name] = add(exponent.get(name, ZERO), multiply(number(power), value))
        elif velocities_in(base, names):
            forms.add(_monic(_inside(base, names), names))
    if exponent:
        forms.add(_monic(exponent, names))
    return forms.pop() if len(forms) == 1 else None


def _inside(base: Expression, names: Sequence[str]) -> Mapping[str, Expression] | None:
    return linear_coefficients(base.argument if isinstance(base, Apply) else base, names)


def _monic(coefficients: Mapping[str, Expression] | None, names: Sequence[str]) -> Form | None:
    if not coefficients:
        return None
    first = next(coefficients[name] for name in names if name in coefficients)
    return tuple(simplified(divide(coefficients.get(name, ZERO), first)) for name in names)


def linear_coefficients(tree: Expression, names: Sequence[str]) -> Mapping[str, Expression] | None:
    """The coefficients of the velocities in a tree that is linear in them (free terms allowed), else None."""
    found: dict[str, Expression] = {}
    for monomial, value in expand(tree).terms:
        inside = velocities_in(monomial_tree(monomial), names)
        if not inside:
            continue
        name = next(iter(inside))
        rest = tuple(pair for pair in monomial if pair != (Velocity(name), Fraction(1)))
        if len(rest) != len(monomial) - 1 or velocities_in(monomial_tree(rest), names):
            return None
        term = multiply(number(value), monomial_tree(rest) if rest else ONE)
        found[name] = add(found.get(name, ZERO), term)
    return found
