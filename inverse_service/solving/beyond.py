"""Sets beyond the domain of an answer on which the equations are defined and real all the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TypeGuard

from inverse_service import errors
from inverse_service.decision import deciding
from inverse_service.decision.solutions import Left, Statement
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.field import exact_field, real_branch, sign_cases, tower
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.statements import reasons
from inverse_service.statements.domains import Domain

_SEED = 1
_MOST_BASES = 3  # odd roots of more expressions than these are taken of positive values alone
_MOST_SETS = 8
_MOST_NAMES = 12  # of a form whose squares are completed
_LEAVES = ex.Symbol | ex.Velocity
Signs = dict[ex.Expression, int]


def left_out(
    system: SecondOrderSystem,
    answer: Statement,
    sides: Sequence[ex.Expression],
    residuals: Sequence[ex.Expression],
) -> list[Left]:
    """The sets of a cell that the domain of its answer leaves out and on which the equations are
    real.

    All of `sides` are positive on the cell. Of the trees u_1, u_2, … that are positive on the
    domain alone, the first ones are positive and the next one is negative. Each set has a point at
    which f as given and the `residuals`, which are the lines as written, are real, where odd roots
    and gamma functions of negative values are real.
    """
    if system.is_unsolved or answer.certificate is None:
        return []
    lines = (ex.substitute(line, _accelerations(system)) for line in residuals)
    formulas, known = (*system.given, *lines), {*_variables(system), ex.PI, tower.RADIAN}
    leaves = ex.Symbol | ex.Velocity | ex.Acceleration
    if any(isinstance(node, leaves) and node not in known for node in ex.distinct_nodes(formulas)):
        return []
    trees = [
        one
        for one in answer.domain.positive
        if not _is_never_negative(one) and not _is_semidefinite(one)
    ]
    trees = [tree for tree in map(collecting.collect, trees) if tree not in sides]
    trees.sort(key=lambda tree: any(map(_two_sided, ex.walk(tree))))
    found = list[Left | None]()
    for k, tree in enumerate(trees[:_MOST_SETS]):
        wanted = [*sides, *trees[:k], collecting.collect(-tree)]
        sets = (
            _with_point(system, written, signs, wanted) for written, signs in _written(formulas)
        )
        found.append(next((one for one in sets if one is not None), None))
    return [one for one in found if one is not None]


def _is_never_negative(tree: ex.Expression) -> bool:
    """Whether the tree is written as a sum of products of squares and positive numbers."""
    match tree:
        case ex.Number(value):
            return value >= 0
        case ex.Sum(parts) | ex.Product(parts):
            return all(map(_is_never_negative, parts))
        case ex.Power(_, ex.Number(exponent)):
            return exponent.denominator == 1 and exponent.numerator % 2 == 0
    return False


def _is_semidefinite(tree: ex.Expression) -> bool:
    """Whether the tree is a quadratic form in all its names that is never negative: squares are
    completed exactly, with numbers such as sqrt(5) as coefficients.
    """
    nodes = list(ex.distinct_nodes([tree]))
    names = [one for one in nodes if isinstance(one, _LEAVES) and one != ex.PI]
    if len(names) > _MOST_NAMES or any(isinstance(one, ex.Apply | ex.Arbitrary) for one in nodes):
        return False
    try:
        budget = exact_field.Budget.short()
        ring = exact_field.exact_ring([tree], names, None, budget, unused="kept")
        places = [index for index, one in ring.trees.items() if one in names]
        form = ring.value(tree)
        parts = exact_field.coefficients_of(form.numerator, places)
    except (exact_field.TooLarge, ZeroDivisionError, KeyError, errors.IrreducibleAtoms):
        return False
    if any(sum(exponents) != 2 for exponents in parts):
        return False
    zero, span = ring.constant(0), range(len(places))
    rows = [[zero] * len(places) for _ in span]
    for exponents, value in parts.items():
        i, j = (k for k in span for _ in range(exponents[k]))
        number = ring.field.quotient(value, form.exponents)
        rows[i][j] = rows[j][i] = number.scaled(2 if i == j else 1)
    try:
        return _has_no_negative_square(ring, rows)
    except (exact_field.TooLarge, errors.IrreducibleAtoms, calculus.NoRealValue):
        return False


def _has_no_negative_square(
    ring: exact_field.ExactRing, rows: list[list[exact_field.Quotient]]
) -> bool:
    """Whether a form has none, by the symmetric matrix of its coefficients, which are numbers."""
    while rows:
        (pivot, *first), *rest = rows
        if pivot.is_zero:
            if not all(one.is_zero for one in first):
                return False
            rows = [row[1:] for row in rest]
            continue
        sign = real_branch.real_sign(exact_field.quotient_tree(ring, pivot), {})
        if sign < 0:
            return False
        rows = [
            [entry - row[0] * one / pivot for entry, one in zip(row[1:], first, strict=True)]
            for row in rest
        ]
    return True


def _accelerations(system: SecondOrderSystem) -> dict[ex.Acceleration, ex.Symbol]:
    """Symbols for the accelerations: the lines are linear in these, and real for all their values
    or for none.
    """
    return {ex.Acceleration(name): ex.Symbol(f"{name}''") for name in system.coordinates}


def _variables(system: SecondOrderSystem) -> list[ex.Symbol | ex.Velocity]:
    return [*deciding.variables_of(system), *_accelerations(system).values()]


def _written(
    formulas: Sequence[ex.Expression],
) -> Iterator[tuple[tuple[ex.Expression, ...], Signs]]:
    """The formulas for all signs of the bases b of odd roots and the arguments of gamma functions,
    and these signs: b^(p/q) is (-1)^p (-b)^(p/q).
    """
    bases = map(_two_sided, ex.distinct_nodes(formulas))
    number = len({base for base in bases if base is not None})
    for chosen in product((1, -1), repeat=min(number, _MOST_BASES)):
        signs, left = Signs(), iter(chosen)
        yield tuple(_with_signs(f, signs, left) for f in formulas), signs


def _with_signs(node: ex.Expression, signs: Signs, left: Iterator[int]) -> ex.Expression:
    inner = ex.rebuild(node, lambda part: _with_signs(part, signs, left))
    base = _two_sided(inner)
    if base is None:
        return inner
    if base not in signs:
        signs[base] = next(left, 1)
    sign = signs[base]
    if isinstance(inner, ex.Power) and isinstance(inner.exponent, ex.Number):
        root = ex.power(sign * base, inner.exponent)
        return sign * root if inner.exponent.value.numerator % 2 else root
    return inner if sign > 0 else _reflected(inner)


def _two_sided(node: ex.Expression) -> ex.Expression | None:
    """The base of an odd root or the argument of a gamma function: both are real, too, where it is
    negative, but elsewhere in the program they are functions of positive values alone.
    """
    match node:
        case ex.Power(base, _) if _is_odd_root(node):
            return base
        case ex.Apply(("gammafunction" | "polygamma"), u) if real_branch.varies(u):
            return u
    return None


def _reflected(node: ex.Expression) -> ex.Expression:
    """Gamma functions of u < 0 by those of 1 - u (DLMF 5.5.3, 5.15.6)."""
    match node:
        case ex.Ordered("polygamma", u, ex.Number(order)):
            place, turns = ex.Symbol("argument of polygamma"), int(order)
            slope: ex.Expression = ex.PI * ex.Apply("cot", ex.PI * place)
            for _ in range(turns):
                slope = calculus.differentiate(slope, place)
            mirrored = ex.multiply(
                ex.number((-1) ** turns), ex.Ordered("polygamma", 1 - u, ex.Number(order))
            )
            return ex.subtract(mirrored, ex.substitute(slope, {place: u}))
        case ex.Apply(name, u):
            return ex.PI / (ex.Apply("sin", ex.PI * u) * ex.Apply(name, 1 - u))
    raise TypeError(node)


def _is_odd_root(node: ex.Expression) -> TypeGuard[ex.Power]:
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator > 1:
            return exponent.denominator % 2 == 1 and real_branch.varies(base)
    return False


def _with_point(
    system: SecondOrderSystem,
    formulas: Sequence[ex.Expression],
    signs: Signs,
    wanted: Sequence[ex.Expression],
) -> Left | None:
    """The set where the wanted trees are positive and the formulas real, with a point; None if none
    was found.

    The signs of the bases of odd roots are no conditions, unless another condition is written for
    these signs.
    """
    bases = [collecting.collect(sign * base) for base, sign in signs.items()]
    needs = [
        tree
        for tree in map(collecting.collect, real_branch.own_requirements(formulas))
        if tree not in bases
    ]
    if any(_is_odd_root(node) for node in ex.distinct_nodes(needs)):
        needs += bases
    whole = tuple(dict.fromkeys((*needs, *wanted)))
    if sign_cases.is_empty([*whole, *bases]):
        return None
    kernels = tuple(map(tower.to_kernels, formulas))
    point = real_branch.find_real_point(kernels, _variables(system), _SEED, [*whole, *bases])
    if point is None:
        return None
    near = {
        name: value for name, value in point.items() if name not in _accelerations(system).values()
    }
    turned = {sign * base for base, sign in signs.items() if sign < 0}
    has_negative_roots = any(
        _is_odd_root(node) and node.base in turned for node in ex.distinct_nodes(formulas)
    )
    return Left(
        Domain(whole),
        near,
        reasons.OUTSIDE_ODD_ROOTS if has_negative_roots else reasons.OUTSIDE_DOMAIN,
    )
