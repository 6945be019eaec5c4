"""The general member of a leaf in closed form, where its equations can be solved.

Constants are solved for where an equation is linear or quadratic in its leader. A function F with
F_y = 0 depends on its other arguments alone, one with F' = 0 is a new constant, F = ... is put in,
and F^(m) = a(x) F^(m-1) for a function of one coordinate is integrated m times. F_xy = 0 gives
F_0(x) + F_1(y), and F_xx = 0 gives F_0(y) + x F_1(y).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from flint import fmpq_mpoly

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import calculus, collecting, polynomials, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.solving.leaves import Leaf

SECONDS = 3.0  # of processor time for a member


@dataclass(frozen=True)
class Solved:
    """left = right, with the names that are new in it."""

    left: ex.Expression
    right: ex.Expression
    new_constants: tuple[str, ...] = ()
    new_functions: tuple[str, ...] = ()
    # A new constant that is 0 exactly if this derivative of the function is.
    scale: tuple[str, ex.Arbitrary] | None = None


@dataclass(frozen=True)
class Member:
    """The system of the general member, and what was put in."""

    system: SecondOrderSystem
    solved: tuple[Solved, ...]


def member_of(system: SecondOrderSystem, leaf: Leaf) -> Member | None:
    """The general member; None where an equation is not solved, or its formulas are too long."""
    if leaf.whole:
        return None  # the rules are those of a part of the set
    try:
        with deadline.until(deadline.now() + SECONDS):
            return _solved_member(system, leaf)
    except deadline.OutOfTime:
        return None


def _solved_member(system: SecondOrderSystem, leaf: Leaf) -> Member | None:
    unknowns = leaf.unknowns
    constants = dict[ex.Expression, ex.Expression]()
    functions = [rule for rule in leaf.rules if rule.leader in unknowns.jets]
    for rule in leaf.rules:
        deadline.check(0)
        if rule.leader in unknowns.letters:
            value = _root(leaf, rule.equation, rule.leader)
            if value is None:
                return None
            constants[ex.Symbol(unknowns.letters[rule.leader])] = value
    put_in = _put_in_each_other(constants)
    if put_in is None:
        return None
    constants = put_in
    found = tuple(Solved(left, right) for left, right in constants.items())
    try:
        if constants:
            system = second_order_system.with_values(system, constants)
    except (ZeroDivisionError, errors.InputError):
        return None
    left = [ex.substitute(unknowns.tree(rule.equation), constants) for rule in functions]
    while left:
        deadline.check(0)
        solved, used = next(_solutions(system, left), (None, ex.ZERO))
        if solved is None:
            return None
        system, found = with_function(system, solved), (*found, solved)
        others = [collecting.collect(put_function(one, solved)) for one in left if one is not used]
        left = [_numerator(one) for one in others if one != ex.ZERO]
        if any(isinstance(one, ex.Number) for one in left):
            return None
    return Member(system, found)


def _solutions(
    system: SecondOrderSystem, equations: Sequence[ex.Expression]
) -> Iterator[tuple[Solved, ex.Expression]]:
    """Each equation that is solved for a function, with the solution."""
    # V_xy = 0 comes before V_yyy = 0: each part of V_0(x) + V_1(y) has its own equations.
    for equation in sorted(equations, key=lambda one: (_order(one), ex.node_count(one))):
        nodes = dict.fromkeys(node for node in ex.walk(equation) if isinstance(node, ex.Arbitrary))
        for node in sorted(nodes, key=lambda one: -sum(one.orders)):
            solved = _function(system, node.name, node.orders, equation, node.arguments)
            if solved is not None:
                yield solved, equation


def _order(tree: ex.Expression) -> int:
    return max(
        (sum(one.orders) for one in ex.walk(tree) if isinstance(one, ex.Arbitrary)), default=0
    )


def _numerator(tree: ex.Expression) -> ex.Expression:
    """What has to vanish for the tree to vanish, without factors that are numbers or powers."""
    parts = tree.factors if isinstance(tree, ex.Product) else (tree,)
    kept = [one.base if isinstance(one, ex.Power) else one for one in parts
            if not isinstance(one, ex.Number) and ex.has(one, ex.Arbitrary | ex.Symbol)]  # fmt: skip
    functional = [one for one in kept if ex.has(one, ex.Arbitrary)]
    return functional[0] if len(functional) == 1 else tree


def _root(leaf: Leaf, equation: fmpq_mpoly, leader: int) -> ex.Expression | None:
    """The leader of an equation that is linear or quadratic in it; the other root is the
    conjugate.
    """
    unknowns, degree = leaf.unknowns, int(equation.degrees()[leader])
    parts = [exact_field.coefficient(equation, leader, k) for k in range(degree + 1)]
    if degree == 1:
        return collecting.collect(-unknowns.tree(parts[0]) / unknowns.tree(parts[1]))
    if degree == 2:
        low, middle, high = parts
        root = _square_root(leaf, middle * middle - high * low * 4)
        return collecting.collect((root - unknowns.tree(middle)) / unknowns.tree(2 * high))
    return None


def _square_root(leaf: Leaf, square: fmpq_mpoly) -> ex.Expression:
    """One of the two roots, of whatever sign: sqrt(5) b for 5 b^2."""
    constant, factors = polynomials.factor_polynomial(square)
    one = square * 0 + 1
    outside = math.prod((factor ** (power // 2) for factor, power in factors), start=one)
    under = math.prod((factor for factor, power in factors if power % 2), start=one)
    root = ex.square_root(collecting.collect(ex.number(constant) * leaf.unknowns.tree(under)))
    return leaf.unknowns.tree(outside) * root


def _put_in_each_other(
    values: Mapping[ex.Expression, ex.Expression],
) -> dict[ex.Expression, ex.Expression] | None:
    """The values without each other's names; None where one grows too long."""
    found = dict(values)
    for _ in range(len(found)):
        whole = {left: ex.substitute(right, found) for left, right in found.items()}
        if any(ex.node_count(right) > bounds.TERMS for right in whole.values()):
            return None
        found = {left: collecting.collect(right) for left, right in whole.items()}
    return found


def _function(
    system: SecondOrderSystem,
    name: str,
    orders: tuple[int, ...],
    equation: ex.Expression,
    arguments: tuple[ex.Expression, ...],
) -> Solved | None:
    """F = ..., from one equation with the leader F[orders]."""
    whole = ex.Arbitrary(name, arguments, (0,) * len(arguments))
    leader = ex.Arbitrary(name, arguments, orders)
    taken = {*system.coordinates, *system.parameters, *(one for one, _ in system.functions), "t"}
    if equation == leader:
        if len(arguments) == 1 and sum(orders) == 1:
            constant = _new(f"{name}_0", taken)
            return Solved(whole, ex.Symbol(constant), (constant,))
        fresh = [name]
        if sum(orders) > 1:
            fresh = [_new(f"{name}_{k}", taken) for k in range(sum(orders))]
        general = general_solution(whole, orders, fresh)
        if general is not None:
            return Solved(whole, general, (), tuple(fresh))
    letter = ex.Symbol(_new("leader", taken))
    linear = collecting.collect(ex.substitute(equation, {leader: letter}))
    slope = collecting.collect(calculus.differentiate(linear, letter))
    if ex.holds(slope, letter) or slope == ex.ZERO:
        return None
    rest = collecting.collect(-ex.substitute(linear, {letter: ex.ZERO}) / slope)
    own = [node for node in ex.walk(rest) if isinstance(node, ex.Arbitrary) and node.name == name]
    if ex.holds(rest, *(one for one in _variables(system) if one not in arguments)):
        return None  # it is not a function of these alone
    if not any(orders):
        return None if own else Solved(whole, rest)
    if len(arguments) != 1:
        return None
    return _integrated(system, whole, rest, orders[0], taken)


def _variables(system: SecondOrderSystem) -> list[ex.Expression]:
    names = system.coordinates
    return [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, names)]


def general_solution(
    whole: ex.Arbitrary, orders: Sequence[int], names: Sequence[str]
) -> ex.Expression | None:
    """The F with the derivative of these orders 0, in functions of fewer arguments with these
    names.

    One of first order leaves a function of the others; F_xy = 0, of two, the sum of two functions;
    the m-th by x the polynomials of degree m - 1 in x. None for others.
    """
    arguments, held = whole.arguments, [k for k, order in enumerate(orders) if order]
    if len(arguments) < 2 or len(names) != sum(orders):
        return None

    def of(name: str, left: Sequence[ex.Expression]) -> ex.Expression:
        return ex.Arbitrary(name, tuple(left), (0,) * len(left))

    if len(held) == 1:
        by = arguments[held[0]]
        others = [one for one in arguments if one != by]
        return ex.add(*(by**k * of(name, others) for k, name in enumerate(names)))
    if len(arguments) == 2 and tuple(orders) == (1, 1):
        return ex.add(*(of(name, [one]) for name, one in zip(names, arguments, strict=True)))
    return None


def _integrated(
    system: SecondOrderSystem, whole: ex.Arbitrary, rest: ex.Expression, order: int, taken: set[str]
) -> Solved | None:
    """F with F^(order) = a(x) F^(order - 1), or = a(x)."""
    (argument,) = whole.arguments
    assert isinstance(argument, ex.Symbol | ex.Velocity)
    below = ex.Arbitrary(whole.name, whole.arguments, (order - 1,))
    if any(
        isinstance(node, ex.Arbitrary) and node.name == whole.name and node != below
        for node in ex.walk(rest)
    ):
        return None
    constants, scale = list[str](), None

    def constant() -> ex.Symbol:
        constants.append(_new(f"{whole.name}_{len(constants)}", {*taken, *constants}))
        return ex.Symbol(constants[-1])

    if ex.holds(rest, below):
        factor = collecting.collect(rest / below)
        if ex.holds(factor, below):
            return None
        power = _antiderivative(system, factor, argument)
        if power is None:
            return None
        value = constant() * _exponential(power)
        scale = constants[0], below
    else:
        known = _antiderivative(system, rest, argument)
        if known is None:
            return None
        value = known + constant()
    for _ in range(order - 1):
        known = _antiderivative(system, collecting.collect(value), argument)
        if known is None:
            return None
        value = known + constant()
    return Solved(whole, collecting.collect(value), tuple(constants), (), scale)


def _exponential(power: ex.Expression) -> ex.Expression:
    """e^u, a product of powers where u is a sum of logarithms."""
    terms = power.terms if isinstance(power, ex.Sum) else (power,)
    factors = list[ex.Expression]()
    for term in terms:
        parts = term.factors if isinstance(term, ex.Product) else (term,)
        logs = [one for one in parts if isinstance(one, ex.Apply) and one.function == "log"]
        rest = ex.multiply(*(one for one in parts if one not in logs))
        factors.append(
            logs[0].argument ** rest
            if len(logs) == 1 and isinstance(rest, ex.Number)
            else ex.Apply("exp", term)
        )
    return ex.multiply(*factors)


def _antiderivative(
    system: SecondOrderSystem, tree: ex.Expression, by: ex.Symbol | ex.Velocity
) -> ex.Expression | None:
    """One without an integral sign; None if none is found."""
    from inverse_service.search import antiderivatives

    with suppress(
        errors.IrreducibleAtoms, ZeroDivisionError, exact_field.TooLarge, deadline.OutOfTime
    ):
        found = antiderivatives.antiderivative(system, tree, by, None)
        if found is not None and not ex.has(found, ex.Integral):
            return found
    return None


def _new(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "0"
    return name


def put_function(tree: ex.Expression, solved: Solved) -> ex.Expression:
    """The tree with the function put in."""
    whole = solved.left
    assert isinstance(whole, ex.Arbitrary)
    if isinstance(tree, ex.Arbitrary) and tree.name == whole.name:
        value = solved.right
        for argument, times in zip(whole.arguments, tree.orders, strict=True):
            for _ in range(times):
                value = calculus.differentiate(value, argument)
        return value
    return ex.rebuild(tree, lambda part: put_function(part, solved))


def with_function(system: SecondOrderSystem, solved: Solved) -> SecondOrderSystem:
    """The system with the function put in, whose name stays taken: nothing else is called so."""
    whole = solved.left
    assert isinstance(whole, ex.Arbitrary)
    kept = dict(system.functions)
    declared = dict(zip(whole.arguments, kept[whole.name], strict=True))  # x' as x_dot
    for node in ex.walk(solved.right) if solved.new_functions else ():
        if isinstance(node, ex.Arbitrary) and node.name in solved.new_functions:
            kept[node.name] = tuple(map(declared.__getitem__, node.arguments))
    parameters = (*system.parameters, *solved.new_constants)
    forces = tuple(collecting.collect(put_function(f, solved)) for f in system.accelerations)
    return replace(
        system,
        accelerations=forces,
        parameters=parameters,
        functions=tuple(kept.items()),
        branch=None,
    )
