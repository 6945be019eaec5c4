"""Blocks of one velocity, and small blocks solved equation by equation.

F(v) = dL/dv = p is solved where v occurs in F once, or as a short polynomial: c v^m, c (v + u)^r, v log v, log v,
exponentials, quadratics and cubics in powers of v or exp(v). In a small block one velocity is isolated in one momentum
and put into the others: for L = Re(z log z) with z = x' + i y', p_y = -atan(y'/x') gives y', and then
p_x = log|z| + 1 gives x'.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from inverse_service import bounds
from inverse_service.expressions.collecting import collect, expand
from inverse_service.expressions.collecting_trees import terms_tree
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Sum,
    Symbol,
    Velocity,
    add,
    apply,
    children,
    factors_of,
    multiply,
    node_count,
    rebuild,
    substitute,
    walk,
)
from inverse_service.mechanics.legendre.blocks import Block, Branch, Solver
from inverse_service.mechanics.legendre.isolation import (
    Root,
    isolate,
    laurent_polynomial,
    occurrences,
    peeled,
    polynomial_roots,
)
from inverse_service.mechanics.legendre.points import sample_points, vanishes_at
from inverse_service.mechanics.legendre.short_forms import (
    exact_quotient,
    quotient,
    shortest,
    simplified,
    velocities_in,
    with_cosines,
)


def scalar_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """All branches found of a block of one velocity."""
    if len(block.names) != 1:
        return
    shift = _center(block)
    if shift != ZERO:
        yield from _about(block, shift, solve)
    rate, momentum = Velocity(block.names[0]), block.momenta[block.names[0]]
    energies = list(_energies(block, rate))
    for root in roots_for(differentiate(block.function, rate), rate, momentum):
        velocity = simplified(root.value)
        trees = [substitute(energy, {rate: velocity}) for energy in energies]
        short = [tree for tree in trees if node_count(tree) <= bounds.LARGE]
        forms = [simplified(tree) for tree in short] + [simplified(factored_inside(tree)) for tree in short[2:3]]
        forms += [with_cosines(factored_inside(form)) for form in forms]
        yield Branch((velocity,), shortest(forms or trees), root.conditions)


def _center(block: Block) -> Expression:
    """h = c_(m-1)/(m c_m) of a polynomial of degree m > 2: in v + h it has no term of degree m - 1."""
    laurent = laurent_polynomial(block.function, Velocity(block.names[0]))
    if laurent is None or laurent.generator != Velocity(block.names[0]):
        return ZERO
    exponents = sorted(laurent.coefficients)
    if exponents[0] < 0 or exponents[-1] < 3 or any(exponent.denominator != 1 for exponent in exponents):
        return ZERO
    top = exponents[-1]
    next_coefficient = laurent.coefficients.get(top - 1, ZERO)
    return simplified(next_coefficient / (top * laurent.coefficients[top]))


def _about(block: Block, shift: Expression, solve: Solver) -> Iterator[Branch]:
    """The branches in u = v + h: v = u - h and H = H_u - p h."""
    name = block.names[0]
    moved = substitute(block.function, {Velocity(name): Velocity(name) - shift})
    back: dict[Expression, Expression] = {Velocity(name): Velocity(name) + shift}
    for branch in solve(collect(moved), block.names, block.momenta):
        yield Branch(
            (simplified(branch.velocities[0] - shift),),
            simplified(branch.hamiltonian - block.momenta[name] * shift),
            tuple(substitute(condition, back) for condition in branch.conditions),
        )


def _energies(block: Block, rate: Velocity) -> Iterator[Expression]:
    """H in v, then p v - L with one term T of L written by p: T = (p - (L - T)') T/T'."""
    function, momentum = block.function, block.momenta[block.names[0]]
    yield simplified(rate * differentiate(function, rate) - function)
    yield momentum * rate - function
    logs = _log_of_quotient(collect(differentiate(function, rate)), rate, momentum)
    if logs is not None:
        over, under, value = logs
        yield simplified(momentum * rate - substitute(function, {over: under + value}))
    terms = function.terms if isinstance(function, Sum) else (function,)
    for place, term in enumerate(terms[: bounds.FEW]):
        others = add(*terms[:place], *terms[place + 1 :])
        ratio = quotient(term / differentiate(term, rate))
        rest = (momentum - differentiate(others, rate)) * ratio
        yield momentum * rate - (others + rest)


def roots_for(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """The solutions of slope = momentum for the velocity that are found in closed form."""
    collected = collect(slope)
    once = [form for form in (collected, slope, quotient(collected)) if occurrences(form, rate) == 1]
    if once:
        yield from isolate(shortest(once), rate, momentum)
        return
    yield from polynomial_roots(collected, rate, momentum)
    yield from _cleared(quotient(collected), rate, momentum)
    yield from _balanced(collected, rate, momentum)
    yield from _of_two_logarithms(collected, rate, momentum)
    yield from _of_one_arctangent(collected, rate, momentum)
    yield from _with_a_root(simplified(slope), rate, Root(momentum))


def _cleared(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """A - p B = 0 for F = A/B."""
    above: list[Expression] = []
    below: list[Expression] = []
    for f in factors_of(slope):
        (below if _is_below(f) and occurrences(f, rate) else above).append(f)
    if below:
        inverse = multiply(*(f**-1 for f in below))
        yield from polynomial_roots(multiply(*above) - momentum * inverse, rate, ZERO)


def _of_two_logarithms(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """F = c (log A - log B) + r = p for A, B linear in v: A/B = exp((p - r)/c)."""
    found = _log_of_quotient(slope, rate, momentum)
    if found is not None:
        ratio = apply("exp", found[2])
        (a, b), (e, f) = (_linear_parts(node.argument, rate) for node in found[:2])
        yield Root((ratio * f - b) / (a - ratio * e))


def _log_of_quotient(slope: Expression, rate: Velocity, momentum: Expression) -> tuple[Apply, Apply, Expression] | None:
    """log A, log B and (p - r)/c for p = c (log A - log B) + r with c and r free of v."""
    parts: dict[Apply | None, list[Expression]] = {}
    for term in slope.terms if isinstance(slope, Sum) else ():
        logs = [node for node in walk(term) if isinstance(node, Apply) and node.function == "log"]
        held = [node for node in logs if occurrences(node, rate) == occurrences(term, rate) > 0]
        parts.setdefault(held[0] if held else None, []).append(term)
    rest = add(*parts.pop(None, ()))
    if len(parts) != 2:
        return None
    (over, c), (under, d) = ((node, simplified(add(*terms) / node)) for node, terms in parts.items() if node)
    if simplified(c + d) != ZERO:
        return None
    if vanishes_at(rest, sample_points([rest])):
        return over, under, momentum / c
    return over, under, (momentum - simplified(substitute(rest, {rate: ZERO}))) / c


def _of_one_arctangent(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """F = c atan A + r = p, where r is constant as one quotient of polynomials: A has roots of letters."""
    terms = slope.terms if isinstance(slope, Sum) else ()
    arcs = {
        node for node in walk(slope) if isinstance(node, Apply) and node.function == "atan" and occurrences(node, rate)
    }
    held = [term for term in terms if any(node in set(walk(term)) for node in arcs)]
    if len(arcs) != 1 or len(held) == len(terms):
        return
    rest = exact_quotient(add(*(term for term in terms if term not in held)))
    if not occurrences(rest, rate):
        (arc,) = arcs
        factor, (a, b) = simplified(add(*held) / arc), _linear_parts(arc.argument, rate)
        if not occurrences(factor, rate) and not occurrences(a, rate):
            angle = (momentum - rest) / factor
            yield Root((apply("tan", angle) - b) / a)


def _linear_parts(tree: Expression, rate: Velocity) -> tuple[Expression, Expression]:
    return simplified(differentiate(tree, rate)), simplified(substitute(tree, {rate: ZERO}))


def _with_a_root(tree: Expression, rate: Velocity, known: Root) -> Iterator[Root]:
    """F(u) = p for u that holds v in one square root besides: A + B sqrt(S) = 0 for the numerator of u - p'."""
    if sum(1 for part in children(tree) if occurrences(part, rate)) == 1:
        for inner, root in peeled(tree, rate, known):
            yield from _with_a_root(inner, rate, root)
        return
    squared = _without_root(multiply(*_numerator(tree - known.value, rate)), rate)
    for factor in _numerator(squared, rate):
        for root in polynomial_roots(factor, rate, ZERO):
            yield Root(root.value, known.conditions + root.conditions)


def _numerator(tree: Expression, rate: Velocity) -> list[Expression]:
    """The bases of its factors that hold the velocity and something else, those under the line left out."""
    whole = quotient(tree)
    factors = [f for f in factors_of(whole) if not _is_below(f)]
    bases = [f.base if isinstance(f, Power) else f for f in factors]
    leaves = [{node for node in walk(base) if isinstance(node, Symbol | Velocity)} for base in bases]
    return [base for base, held in zip(bases, leaves, strict=True) if rate in held and held != {rate}]


def _is_below(factor: Expression) -> bool:
    return isinstance(factor, Power) and isinstance(factor.exponent, Number) and factor.exponent.value < 0


def _without_root(tree: Expression, rate: Velocity) -> Expression:
    """A^2 - B^2 S for A + B sqrt(S), A, B and S polynomials in v; 0 where the tree is not of this kind."""
    plain: list[Expression] = []
    rooted: dict[Expression, list[Expression]] = {}
    for term in expand(tree):
        factor = terms_tree([term])
        roots = [node for node in walk(factor) if _is_root(node) and occurrences(node, rate)]
        (rooted.setdefault(roots[0], []) if roots else plain).append(factor / roots[0] if roots else factor)
    if len(rooted) != 1:
        return ZERO
    ((root, terms),) = rooted.items()
    return add(*plain) ** 2 - add(*terms) ** 2 * root**2


def _is_root(node: Expression) -> bool:
    return isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value == HALF.value


def _balanced(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """F = p where the factored F - c has v once, c being the part of F without v."""
    terms = slope.terms if isinstance(slope, Sum) else (slope,)
    fixed = [term for term in terms if not occurrences(term, rate)]
    rest = quotient(add(*(term for term in terms if occurrences(term, rate))))
    if fixed and occurrences(rest, rate) == 1:
        yield from isolate(rest, rate, momentum - add(*fixed))


LARGEST_BLOCK = 3
Equation = tuple[Symbol, Expression]
Solved = tuple[dict[str, Expression], tuple[Expression, ...]]


def elimination_branches(block: Block) -> Iterator[Branch]:
    """The branches of a block of two or three velocities; H is the energy p v - L at v(p)."""
    if not 1 < len(block.names) <= LARGEST_BLOCK:
        return
    functions = [simplified(differentiate(block.function, Velocity(name))) for name in block.names]
    works = [Velocity(name) * p for name, p in zip(block.names, functions, strict=True)]
    energy = simplified(add(*works) - block.function)
    equations = [(block.momenta[name], p) for name, p in zip(block.names, functions, strict=True)]
    for rates, conditions in _solutions(equations, block.names):
        table: dict[Expression, Expression] = {Velocity(name): tree for name, tree in rates.items()}
        velocities = tuple(simplified(rates[name]) for name in block.names)
        yield Branch(velocities, simplified(substitute(energy, table)), conditions)


def _solutions(equations: Sequence[Equation], names: Sequence[str]) -> Iterator[Solved]:
    """Every way to solve the equations one after the other, each by one of the unknowns."""
    if len(names) == 1:
        momentum, function = equations[0]
        for root in roots_for(factored_inside(function), Velocity(names[0]), momentum):
            yield {names[0]: root.value}, root.conditions
        return
    for name, root, reduced, left in _isolated(equations, names):
        yield from _completed(name, root.value, root.conditions, _solutions(reduced, left))


def last_equations(equations: Sequence[Equation], names: Sequence[str]) -> Iterator[tuple[Expression, Velocity]]:
    """F and y of each equation F(y) = p of one velocity to which isolating the others leads."""
    if len(names) == 1:
        yield equations[0][1], Velocity(names[0])
        return
    for _, _, reduced, left in _isolated(equations, names):
        yield from last_equations(reduced, left)


def _isolated(
    equations: Sequence[Equation], names: Sequence[str]
) -> Iterator[tuple[str, Root, list[Equation], list[str]]]:
    """One velocity isolated in one equation, the other equations with it put in, and the velocities left."""
    for momentum, function in equations:
        others = [equation for equation in equations if equation[0] != momentum]
        for name in names:
            for root in isolate(function, Velocity(name), momentum):
                table: dict[Expression, Expression] = {Velocity(name): root.value}
                left = [other for other in names if other != name]
                reduced = [(p, simplified(substitute(f, table))) for p, f in others]
                if all(velocities_in(f, left) for _, f in reduced):
                    yield name, root, reduced, left


def _completed(
    name: str, value: Expression, conditions: tuple[Expression, ...], rest: Iterator[Solved]
) -> Iterator[Solved]:
    for rates, others in rest:
        table: dict[Expression, Expression] = {Velocity(other): tree for other, tree in rates.items()}
        yield {**rates, name: substitute(value, table)}, conditions + others


@lru_cache(maxsize=512)
def factored_inside(tree: Expression) -> Expression:
    """The tree with every sum in it as one factored quotient, the outer ones first."""
    outer = quotient(tree) if isinstance(tree, Sum) else tree
    return rebuild(outer, factored_inside)
