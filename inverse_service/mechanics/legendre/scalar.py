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
from inverse_service.expressions import collecting, collecting_trees, derivative
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import blocks, isolation, points, short_forms


def scalar_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """All branches found of a block of one velocity."""
    if len(block.names) != 1:
        return
    shift = _center(block)
    if shift != ex.ZERO:
        yield from _about(block, shift, solve)
    rate, momentum = ex.Velocity(block.names[0]), block.momenta[block.names[0]]
    energies = list(_energies(block, rate))
    for root in roots_for(derivative.differentiate(block.function, rate), rate, momentum):
        velocity = short_forms.simplified(root.value)
        trees = [ex.substitute(energy, {rate: velocity}) for energy in energies]
        short = [tree for tree in trees if ex.node_count(tree) <= bounds.LARGE]
        forms = [short_forms.simplified(tree) for tree in short] + [
            short_forms.simplified(factored_inside(tree)) for tree in short[2:3]
        ]
        forms += [short_forms.with_cosines(factored_inside(form)) for form in forms]
        yield blocks.Branch((velocity,), short_forms.shortest(forms or trees), root.conditions)


def _center(block: blocks.Block) -> ex.Expression:
    """h = c_(m-1)/(m c_m) of a polynomial of degree m > 2: in v + h it has no term of degree m - 1."""
    laurent = isolation.laurent_polynomial(block.function, ex.Velocity(block.names[0]))
    if laurent is None or laurent.generator != ex.Velocity(block.names[0]):
        return ex.ZERO
    exponents = sorted(laurent.coefficients)
    if exponents[0] < 0 or exponents[-1] < 3 or any(exponent.denominator != 1 for exponent in exponents):
        return ex.ZERO
    top = exponents[-1]
    next_coefficient = laurent.coefficients.get(top - 1, ex.ZERO)
    return short_forms.simplified(next_coefficient / (top * laurent.coefficients[top]))


def _about(block: blocks.Block, shift: ex.Expression, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches in u = v + h: v = u - h and H = H_u - p h."""
    name = block.names[0]
    moved = ex.substitute(block.function, {ex.Velocity(name): ex.Velocity(name) - shift})
    back: dict[ex.Expression, ex.Expression] = {ex.Velocity(name): ex.Velocity(name) + shift}
    for branch in solve(collecting.collect(moved), block.names, block.momenta):
        yield blocks.Branch(
            (short_forms.simplified(branch.velocities[0] - shift),),
            short_forms.simplified(branch.hamiltonian - block.momenta[name] * shift),
            tuple(ex.substitute(condition, back) for condition in branch.conditions),
        )


def _energies(block: blocks.Block, rate: ex.Velocity) -> Iterator[ex.Expression]:
    """H in v, then p v - L with one term T of L written by p: T = (p - (L - T)') T/T'."""
    function, momentum = block.function, block.momenta[block.names[0]]
    yield short_forms.simplified(rate * derivative.differentiate(function, rate) - function)
    yield momentum * rate - function
    logs = _log_of_quotient(collecting.collect(derivative.differentiate(function, rate)), rate, momentum)
    if logs is not None:
        over, under, value = logs
        yield short_forms.simplified(momentum * rate - ex.substitute(function, {over: under + value}))
    terms = function.terms if isinstance(function, ex.Sum) else (function,)
    for place, term in enumerate(terms[: bounds.FEW]):
        others = ex.add(*terms[:place], *terms[place + 1 :])
        ratio = short_forms.quotient(term / derivative.differentiate(term, rate))
        rest = (momentum - derivative.differentiate(others, rate)) * ratio
        yield momentum * rate - (others + rest)


def roots_for(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[isolation.Root]:
    """The solutions of slope = momentum for the velocity that are found in closed form."""
    collected = collecting.collect(slope)
    once = [
        form for form in (collected, slope, short_forms.quotient(collected)) if isolation.occurrences(form, rate) == 1
    ]
    if once:
        yield from isolation.isolate(short_forms.shortest(once), rate, momentum)
        return
    yield from isolation.polynomial_roots(collected, rate, momentum)
    yield from _cleared(short_forms.quotient(collected), rate, momentum)
    yield from _balanced(collected, rate, momentum)
    yield from _of_two_logarithms(collected, rate, momentum)
    yield from _of_one_arctangent(collected, rate, momentum)
    yield from _with_a_root(short_forms.simplified(slope), rate, isolation.Root(momentum))


def _cleared(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[isolation.Root]:
    """A - p B = 0 for F = A/B."""
    above: list[ex.Expression] = []
    below: list[ex.Expression] = []
    for f in ex.factors_of(slope):
        (below if _is_below(f) and isolation.occurrences(f, rate) else above).append(f)
    if below:
        inverse = ex.multiply(*(f**-1 for f in below))
        yield from isolation.polynomial_roots(ex.multiply(*above) - momentum * inverse, rate, ex.ZERO)


def _of_two_logarithms(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[isolation.Root]:
    """F = c (log A - log B) + r = p for A, B linear in v: A/B = exp((p - r)/c)."""
    found = _log_of_quotient(slope, rate, momentum)
    if found is not None:
        ratio = ex.apply("exp", found[2])
        (a, b), (e, f) = (_linear_parts(node.argument, rate) for node in found[:2])
        yield isolation.Root((ratio * f - b) / (a - ratio * e))


def _log_of_quotient(
    slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression
) -> tuple[ex.Apply, ex.Apply, ex.Expression] | None:
    """log A, log B and (p - r)/c for p = c (log A - log B) + r with c and r free of v."""
    parts: dict[ex.Apply | None, list[ex.Expression]] = {}
    for term in slope.terms if isinstance(slope, ex.Sum) else ():
        logs = [node for node in ex.walk(term) if isinstance(node, ex.Apply) and node.function == "log"]
        held = [node for node in logs if isolation.occurrences(node, rate) == isolation.occurrences(term, rate) > 0]
        parts.setdefault(held[0] if held else None, []).append(term)
    rest = ex.add(*parts.pop(None, ()))
    if len(parts) != 2:
        return None
    (over, c), (under, d) = (
        (node, short_forms.simplified(ex.add(*terms) / node)) for node, terms in parts.items() if node
    )
    if short_forms.simplified(c + d) != ex.ZERO:
        return None
    if points.vanishes_at(rest, points.sample_points([rest])):
        return over, under, momentum / c
    return over, under, (momentum - short_forms.simplified(ex.substitute(rest, {rate: ex.ZERO}))) / c


def _of_one_arctangent(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[isolation.Root]:
    """F = c atan A + r = p, where r is constant as one quotient of polynomials: A has roots of letters."""
    terms = slope.terms if isinstance(slope, ex.Sum) else ()
    arcs = {
        node
        for node in ex.walk(slope)
        if isinstance(node, ex.Apply) and node.function == "atan" and isolation.occurrences(node, rate)
    }
    held = [term for term in terms if any(node in set(ex.walk(term)) for node in arcs)]
    if len(arcs) != 1 or len(held) == len(terms):
        return
    rest = short_forms.exact_quotient(ex.add(*(term for term in terms if term not in held)))
    if not isolation.occurrences(rest, rate):
        (arc,) = arcs
        factor, (a, b) = short_forms.simplified(ex.add(*held) / arc), _linear_parts(arc.argument, rate)
        if not isolation.occurrences(factor, rate) and not isolation.occurrences(a, rate):
            angle = (momentum - rest) / factor
            yield isolation.Root((ex.apply("tan", angle) - b) / a)


def _linear_parts(tree: ex.Expression, rate: ex.Velocity) -> tuple[ex.Expression, ex.Expression]:
    return short_forms.simplified(derivative.differentiate(tree, rate)), short_forms.simplified(
        ex.substitute(tree, {rate: ex.ZERO})
    )


def _with_a_root(tree: ex.Expression, rate: ex.Velocity, known: isolation.Root) -> Iterator[isolation.Root]:
    """F(u) = p for u that holds v in one square root besides: A + B sqrt(S) = 0 for the numerator of u - p'."""
    if sum(1 for part in ex.children(tree) if isolation.occurrences(part, rate)) == 1:
        for inner, root in isolation.peeled(tree, rate, known):
            yield from _with_a_root(inner, rate, root)
        return
    squared = _without_root(ex.multiply(*_numerator(tree - known.value, rate)), rate)
    for factor in _numerator(squared, rate):
        for root in isolation.polynomial_roots(factor, rate, ex.ZERO):
            yield isolation.Root(root.value, known.conditions + root.conditions)


def _numerator(tree: ex.Expression, rate: ex.Velocity) -> list[ex.Expression]:
    """The bases of its factors that hold the velocity and something else, those under the line left out."""
    whole = short_forms.quotient(tree)
    factors = [f for f in ex.factors_of(whole) if not _is_below(f)]
    bases = [f.base if isinstance(f, ex.Power) else f for f in factors]
    leaves = [{node for node in ex.walk(base) if isinstance(node, ex.Symbol | ex.Velocity)} for base in bases]
    return [base for base, held in zip(bases, leaves, strict=True) if rate in held and held != {rate}]


def _is_below(factor: ex.Expression) -> bool:
    return isinstance(factor, ex.Power) and isinstance(factor.exponent, ex.Number) and factor.exponent.value < 0


def _without_root(tree: ex.Expression, rate: ex.Velocity) -> ex.Expression:
    """A^2 - B^2 S for A + B sqrt(S), A, B and S polynomials in v; 0 where the tree is not of this kind."""
    plain: list[ex.Expression] = []
    rooted: dict[ex.Expression, list[ex.Expression]] = {}
    for term in collecting.expand(tree):
        factor = collecting_trees.terms_tree([term])
        roots = [node for node in ex.walk(factor) if _is_root(node) and isolation.occurrences(node, rate)]
        (rooted.setdefault(roots[0], []) if roots else plain).append(factor / roots[0] if roots else factor)
    if len(rooted) != 1:
        return ex.ZERO
    ((root, terms),) = rooted.items()
    return ex.add(*plain) ** 2 - ex.add(*terms) ** 2 * root**2


def _is_root(node: ex.Expression) -> bool:
    return isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number) and node.exponent.value == ex.HALF.value


def _balanced(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[isolation.Root]:
    """F = p where the factored F - c has v once, c being the part of F without v."""
    terms = slope.terms if isinstance(slope, ex.Sum) else (slope,)
    fixed = [term for term in terms if not isolation.occurrences(term, rate)]
    rest = short_forms.quotient(ex.add(*(term for term in terms if isolation.occurrences(term, rate))))
    if fixed and isolation.occurrences(rest, rate) == 1:
        yield from isolation.isolate(rest, rate, momentum - ex.add(*fixed))


LARGEST_BLOCK = 3
Equation = tuple[ex.Symbol, ex.Expression]
Solved = tuple[dict[str, ex.Expression], tuple[ex.Expression, ...]]


def elimination_branches(block: blocks.Block) -> Iterator[blocks.Branch]:
    """The branches of a block of two or three velocities; H is the energy p v - L at v(p)."""
    if not 1 < len(block.names) <= LARGEST_BLOCK:
        return
    functions = [
        short_forms.simplified(derivative.differentiate(block.function, ex.Velocity(name))) for name in block.names
    ]
    works = [ex.Velocity(name) * p for name, p in zip(block.names, functions, strict=True)]
    energy = short_forms.simplified(ex.add(*works) - block.function)
    equations = [(block.momenta[name], p) for name, p in zip(block.names, functions, strict=True)]
    for rates, conditions in _solutions(equations, block.names):
        table: dict[ex.Expression, ex.Expression] = {ex.Velocity(name): tree for name, tree in rates.items()}
        velocities = tuple(short_forms.simplified(rates[name]) for name in block.names)
        yield blocks.Branch(velocities, short_forms.simplified(ex.substitute(energy, table)), conditions)


def _solutions(equations: Sequence[Equation], names: Sequence[str]) -> Iterator[Solved]:
    """Every way to solve the equations one after the other, each by one of the unknowns."""
    if len(names) == 1:
        momentum, function = equations[0]
        for root in roots_for(factored_inside(function), ex.Velocity(names[0]), momentum):
            yield {names[0]: root.value}, root.conditions
        return
    for name, root, reduced, left in _isolated(equations, names):
        yield from _completed(name, root.value, root.conditions, _solutions(reduced, left))


def last_equations(equations: Sequence[Equation], names: Sequence[str]) -> Iterator[tuple[ex.Expression, ex.Velocity]]:
    """F and y of each equation F(y) = p of one velocity to which isolating the others leads."""
    if len(names) == 1:
        yield equations[0][1], ex.Velocity(names[0])
        return
    for _, _, reduced, left in _isolated(equations, names):
        yield from last_equations(reduced, left)


def _isolated(
    equations: Sequence[Equation], names: Sequence[str]
) -> Iterator[tuple[str, isolation.Root, list[Equation], list[str]]]:
    """One velocity isolated in one equation, the other equations with it put in, and the velocities left."""
    for momentum, function in equations:
        others = [equation for equation in equations if equation[0] != momentum]
        for name in names:
            for root in isolation.isolate(function, ex.Velocity(name), momentum):
                table: dict[ex.Expression, ex.Expression] = {ex.Velocity(name): root.value}
                left = [other for other in names if other != name]
                reduced = [(p, short_forms.simplified(ex.substitute(f, table))) for p, f in others]
                if all(short_forms.velocities_in(f, left) for _, f in reduced):
                    yield name, root, reduced, left


def _completed(
    name: str, value: ex.Expression, conditions: tuple[ex.Expression, ...], rest: Iterator[Solved]
) -> Iterator[Solved]:
    for rates, others in rest:
        table: dict[ex.Expression, ex.Expression] = {ex.Velocity(other): tree for other, tree in rates.items()}
        yield {**rates, name: ex.substitute(value, table)}, conditions + others


@lru_cache(maxsize=512)
def factored_inside(tree: ex.Expression) -> ex.Expression:
    """The tree with every sum in it as one factored quotient, the outer ones first."""
    outer = short_forms.quotient(tree) if isinstance(tree, ex.Sum) else tree
    return ex.rebuild(outer, factored_inside)
