"""Blocks that fall apart in other velocities y = M v, such as exp(x') + exp(x' + y').

p_v = M^T p_y, so a transform in y with p_y = M^-T p_v gives H and v = M^-1 y.

Blocks quadratic in some of their velocities w, with coefficients that depend on the others u.

L = L_0(u) + A(u) w + w^T G(u) w/2 gives w = G^-1 (p_w - A). Routh's function
R(u; p_w) = L - p_w w = L_0 - (p_w - A)^T G^-1 (p_w - A)/2 is a Lagrangian in u alone, and its
H = p_u u - R is that of L (Routh 1877).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

from inverse_service import bounds
from inverse_service.expressions import collecting, collecting_trees
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import blocks, short_forms
from inverse_service.mechanics.legendre.quadratic import Inverse, form_matrix, invert, quadratic_form

Form = tuple[ex.Expression, ...]
Table = dict[ex.Expression, ex.Expression]


def linear_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
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
    block: blocks.Block, forms: Sequence[Form], inverse: Inverse, solve: blocks.Solver, written: Table | None = None
) -> Iterator[blocks.Branch]:
    """The branches with the forms in the place of velocities; `written` replaces forms that stand there as they are."""
    velocities = [ex.Velocity(name) for name in block.names]
    symbols = [block.momenta[name] for name in block.names]
    rates = _table(velocities, [ex.dot(row, velocities) for row in inverse.entries])
    changed = ex.substitute(block.function, rates | (written or {}))
    columns = zip(*inverse.entries, strict=True)
    momenta = _table(symbols, [short_forms.simplified(ex.dot(column, symbols)) for column in columns])
    new = _table(velocities, [ex.dot(row, velocities) for row in forms])
    for branch in solve(changed, block.names, block.momenta):
        found = [ex.substitute(tree, momenta) for tree in branch.velocities]
        yield blocks.Branch(
            tuple(short_forms.simplified(ex.dot(row, found)) for row in inverse.entries),
            ex.substitute(branch.hamiltonian, momenta),
            tuple(ex.substitute(condition, {**new, **momenta}) for condition in branch.conditions),
        )


def _table(keys: Sequence[ex.Symbol | ex.Velocity], values: Sequence[ex.Expression]) -> Table:
    return dict(zip(keys, values, strict=True))


def _units(names: Sequence[str]) -> tuple[Form, ...]:
    return tuple(tuple(ex.number(int(a == b)) for b in names) for a in names)


def _forms(block: blocks.Block) -> tuple[Form, ...]:
    """The linear forms on which functions and powers depend; none where there are too many, or others."""
    found: dict[Form, None] = {}
    for monomial, _ in collecting.expand(block.function):
        forms = _forms_of(monomial, block.names)
        if forms is None:
            return ()
        found.update(dict.fromkeys(forms))
    return tuple(found) if len(found) <= len(block.names) else ()


def _forms_of(monomial: collecting_trees.Monomial, names: Sequence[str]) -> list[Form] | None:
    """The linear forms in the atoms of a term, bare velocities not counted; None where one is not linear."""
    exponent: dict[str, ex.Expression] = {}
    forms: list[Form | None] = []
    for base, power in monomial:
        if isinstance(base, ex.Velocity) or not short_forms.velocities_in(base, names):
            continue
        part = _inside(base, names)
        if ex.is_exponential(base) and part:
            for name, value in part.items():
                exponent[name] = exponent.get(name, ex.ZERO) + power * value
        else:
            forms.append(_monic(part, names))
    if exponent:
        forms.append(_monic(exponent, names))
    return None if None in forms else [form for form in forms if form]


def _inside(base: ex.Expression, names: Sequence[str]) -> Mapping[str, ex.Expression] | None:
    return linear_coefficients(collecting.expand(base.argument if isinstance(base, ex.Apply) else base), names)


def _monic(coefficients: Mapping[str, ex.Expression] | None, names: Sequence[str]) -> Form | None:
    if not coefficients:
        return None
    first = next(coefficients[name] for name in names if name in coefficients)
    return tuple(short_forms.simplified(coefficients.get(name, ex.ZERO) / first) for name in names)


def linear_coefficients(
    terms: Iterable[collecting_trees.Term], names: Sequence[str]
) -> Mapping[str, ex.Expression] | None:
    """The coefficients of the velocities in terms that are linear in them (free terms allowed), else None."""
    found: dict[str, ex.Expression] = {}
    for monomial, value in terms:
        inside = short_forms.velocities_in(collecting_trees.monomial_tree(monomial), names)
        if not inside:
            continue
        name = next(iter(inside))
        rest = tuple(pair for pair in monomial if pair != (ex.Velocity(name), Fraction(1)))
        if len(rest) != len(monomial) - 1 or short_forms.velocities_in(collecting_trees.monomial_tree(rest), names):
            return None
        term = value * (collecting_trees.monomial_tree(rest) if rest else ex.ONE)
        found[name] = found.get(name, ex.ZERO) + term
    return found


@dataclass(frozen=True, slots=True)
class _Parts:
    """rest + linear[i] w_i + w^T G w/2, with G^-1."""

    rest: ex.Expression
    linear: tuple[ex.Expression, ...]
    inverse: Inverse


def routh_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches for the largest sets of velocities that can be eliminated so."""
    for ignored in _choices(block):
        parts = _parts(block, ignored)
        if parts is None:
            continue
        left = [name for name in block.names if name not in ignored]
        shifted = _shifted([block.momenta[name] for name in ignored], parts)
        form = ex.substitute(quadratic_form(parts.inverse, [block.momenta[name] for name in ignored]), shifted)
        function = short_forms.simplified(parts.rest - ex.HALF * form)
        for inner in solve(function, left, block.momenta):
            yield _joined(block, ignored, left, parts, inner)


def _choices(block: blocks.Block) -> Iterator[tuple[str, ...]]:
    """Sets of velocities in which every term has degree 2 at most, not all, the largest first."""
    tables = [(blocks.degrees(monomial, [name]), name) for name in block.names for monomial, _ in _terms(block)]
    unfit = {name for found, name in tables if found is None or found.get(name, 0) not in (0, 1, 2)}
    fit = [name for name in block.names if name not in unfit]
    count = 0
    for size in range(min(len(fit), len(block.names) - 1), 0, -1):
        for chosen in combinations(fit, size):
            if count < bounds.CANDIDATES and all(_degree(monomial, chosen) <= 2 for monomial, _ in _terms(block)):
                count += 1
                yield chosen


def _terms(block: blocks.Block) -> tuple[collecting_trees.Term, ...]:
    return collecting.expand(block.function)


def _degree(monomial: collecting_trees.Monomial, names: Sequence[str]) -> Fraction:
    found = blocks.degrees(monomial, names) or {}
    return sum(found.values(), Fraction(0))


def _parts(block: blocks.Block, ignored: Sequence[str]) -> _Parts | None:
    groups: tuple[list[collecting_trees.Term], list[collecting_trees.Term], list[collecting_trees.Term]] = ([], [], [])
    for monomial, value in _terms(block):
        groups[int(_degree(monomial, ignored))].append((monomial, value))
    rest, linear, quadratic = groups
    matrix = form_matrix(quadratic, ignored) if quadratic else None
    inverse = invert(matrix) if matrix else None
    slopes = linear_coefficients(linear, ignored)
    if inverse is None or slopes is None:
        return None
    return _Parts(collecting_trees.terms_tree(rest), tuple(slopes.get(name, ex.ZERO) for name in ignored), inverse)


def _shifted(momenta: Sequence[ex.Symbol], parts: _Parts) -> dict[ex.Expression, ex.Expression]:
    return {p: p - a for p, a in zip(momenta, parts.linear, strict=True) if a != ex.ZERO}


def _joined(
    block: blocks.Block, ignored: Sequence[str], left: Sequence[str], parts: _Parts, inner: blocks.Branch
) -> blocks.Branch:
    shifted = [block.momenta[name] - a for name, a in zip(ignored, parts.linear, strict=True)]
    velocities = dict(zip(left, inner.velocities, strict=True))
    for name, row in zip(ignored, parts.inverse.entries, strict=True):
        velocities[name] = short_forms.simplified(ex.dot(row, shifted))
    return blocks.Branch(
        tuple(velocities[name] for name in block.names),
        inner.hamiltonian,
        inner.conditions,
    )
