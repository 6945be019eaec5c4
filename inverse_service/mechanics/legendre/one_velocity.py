"""Blocks of one velocity, and small blocks solved equation by equation.

F(v) = dL/dv = p is solved from the outside to the inside where v occurs in F once; else F may be a short polynomial in
z, a power of v or exp(v). With z^d = y the equation is c_2 y^2 + c_1 y + c_0 = 0, or a cubic; its depressed form
y^3 + a y = b is solved by y = 2 sqrt(a/3) sinh(asinh(3 sqrt(3/a) b/(2 a))/3) for a > 0 and, on the branch through
y = 0, by y = 2 sqrt(-a/3) sin(asin(3 sqrt(-3/a) b/(2 a))/3) for a < 0 (Viete; Holmes, Math. Gazette 86 (2002) 473).

In a small block one velocity is isolated in one momentum and put into the others: for L = Re(z log z) with
z = x' + i y', p_y = -atan(y'/x') gives y', and then p_x = log|z| + 1 gives x'.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from inverse_service import bounds
from inverse_service.expressions import collecting, derivative, tree as ex
from inverse_service.mechanics.legendre import blocks, sampling, short_forms

Rule = Callable[[ex.Expression], ex.Expression]
_INVERSES: dict[str, str] = {
    "exp": "log", "log": "exp", "tan": "atan", "sinh": "asinh", "tanh": "atanh", "asin": "sin", "acos": "cos",
    "atan": "tan", "asinh": "sinh", "acosh": "cosh", "atanh": "tanh",
}  # fmt: skip
_NAME = "the cubic's unknown"
_LARGEST_BLOCK = 3
Equation = tuple[ex.Symbol, ex.Expression]
Solved = tuple[dict[str, ex.Expression], tuple[ex.Expression, ...]]


@dataclass(frozen=True, slots=True)
class Root:
    """A solution v, right where every tree of `conditions` (in q, v, p) is positive."""

    value: ex.Expression
    conditions: tuple[ex.Expression, ...] = ()


def occurrences(tree: ex.Expression, leaf: ex.Velocity) -> int:
    return sum(1 for node in ex.walk(tree) if node == leaf)


def isolate(tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression) -> Iterator[Root]:
    """All solutions of tree = target for the leaf; none where it does not occur exactly once."""
    if occurrences(tree, leaf) == 1:
        yield from _inverted(tree, leaf, Root(target))


def _inverted(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[Root]:
    if tree == leaf:
        yield known
        return
    for inner, root in peeled(tree, leaf, known):
        yield from _inverted(inner, leaf, root)


def peeled(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[tuple[ex.Expression, Root]]:
    """The part that holds the leaf, with what it must be equal to."""
    target = known.value
    match tree:
        case ex.Sum(terms):
            holder = next(term for term in terms if occurrences(term, leaf))
            rest = ex.add(*(term for term in terms if term is not holder))
            yield holder, Root(target - rest, known.conditions)
        case ex.Product(factors):
            holder = next(factor for factor in factors if occurrences(factor, leaf))
            rest = ex.multiply(*(factor for factor in factors if factor is not holder))
            yield holder, Root(target / rest, known.conditions)
        case ex.Power(base, exponent) if occurrences(base, leaf):
            for root in roots_of_power(base, exponent, target):
                yield base, Root(root.value, (*known.conditions, *root.conditions))
        case ex.Power(base, exponent):
            yield exponent, Root(ex.apply("log", target) / ex.apply("log", base), known.conditions)
        case ex.Apply(function, argument):
            for root in _roots_of_function(function, argument, target):
                yield argument, Root(root.value, (*known.conditions, *root.conditions))


def roots_of_power(base: ex.Expression, exponent: ex.Expression, target: ex.Expression) -> Iterator[Root]:
    """base with base^exponent = target; for odd exponents a form that is right for both signs."""
    if not isinstance(exponent, ex.Number) or exponent.value.denominator != 1:
        yield Root(target**exponent**-1)
        return
    whole = int(exponent.value)
    if whole in (1, -1):
        yield Root(target**whole)
    elif whole % 2:
        yield Root(target * (target**2) ** Fraction(1 - whole, 2 * whole))
    else:
        root = target ** Fraction(1, whole)
        yield Root(root, (base,))
        yield Root(-root, (-base,))


def _roots_of_function(function: str, argument: ex.Expression, target: ex.Expression) -> Iterator[Root]:
    """argument with function(argument) = target, on the branches next to zero."""
    inverse = _INVERSES.get(function)
    if inverse:
        yield Root(ex.apply(inverse, target), _branch_conditions(function, argument))
    elif function == "sin":
        yield Root(ex.apply("asin", target), _branch_conditions("tan", argument))
    elif function in ("cos", "cosh"):
        root = ex.apply("a" + function, target)
        yield Root(root, (argument,))
        yield Root(-root, (-argument,))


def _branch_conditions(function: str, argument: ex.Expression) -> tuple[ex.Expression, ...]:
    """tan and sin are undone by atan and asin only for |argument| < pi/2."""
    quarter_turn = ex.HALF * ex.PI
    return (quarter_turn - argument, quarter_turn + argument) if function == "tan" else ()


@dataclass(frozen=True, slots=True)
class Laurent:
    """sum of coefficients[e] generator^e; the generator is the velocity, exp of a multiple of it, or such
    as log v with the velocity in it once."""

    generator: ex.Expression
    coefficients: Mapping[Fraction, ex.Expression]


def polynomial_roots(tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression) -> Iterator[Root]:
    """The solutions of tree = target for the leaf, where the tree is such a polynomial."""
    laurent = laurent_polynomial(tree, leaf)
    if laurent is None:
        return
    table = dict(laurent.coefficients)
    table[Fraction(0)] = table.get(Fraction(0), ex.ZERO) - target
    table = {exponent: value for exponent, value in table.items() if value != ex.ZERO}
    lowest = min(table)
    step = _common_step([exponent - lowest for exponent in table])
    if not step or max(table) - lowest > 3 * step:
        return
    unknown = laurent.generator**step
    c = [table.get(lowest + k * step, ex.ZERO) for k in range(int((max(table) - lowest) / step) + 1)]
    if len(c) == 2:
        yield from _unwound(unknown, leaf, Root(-c[0] / c[1]))
    elif len(c) == 3:
        for root in _quadratic(c[2], c[1], c[0], unknown):
            yield from _unwound(unknown, leaf, root)
    elif len(c) == 4:
        for root in _cubic(c, unknown):
            yield from _unwound(unknown, leaf, root)


def _common_step(exponents: Sequence[Fraction]) -> Fraction:
    """The largest number of which all are multiples."""
    below = math.lcm(*(e.denominator for e in exponents))
    return Fraction(math.gcd(*(int(e * below) for e in exponents)), below)


def laurent_polynomial(tree: ex.Expression, leaf: ex.Velocity) -> Laurent | None:
    """The tree in powers of one generator; None where the leaf occurs in another way."""
    generators: set[ex.Expression] = set()
    table: dict[Fraction, list[collecting.Term]] = {}
    for monomial, value in collecting.expand(tree):
        moving = [(base, e) for base, e in monomial if short_forms.velocities_in(base, [leaf.coordinate])]
        rest = tuple(pair for pair in monomial if pair not in moving)
        if len(moving) > 1 or (moving and not _is_generator(moving[0][0], leaf)):
            return None
        generators.update(base for base, _ in moving)
        table.setdefault(moving[0][1] if moving else Fraction(0), []).append((rest, value))
    if len(generators) != 1:
        return None
    coefficients = {e: collecting.terms_tree(terms) for e, terms in table.items()}
    return Laurent(generators.pop(), coefficients)


def _is_generator(base: ex.Expression, leaf: ex.Velocity) -> bool:
    match base:
        case ex.Apply("exp", argument):
            terms = collecting.expand(argument)
            return (
                len(terms) == 1 and collecting.monomial_tree(terms[0][0]) == argument and _is_linear(terms[0][0], leaf)
            )
        case ex.Apply("log" | "atan" | "asinh" | "atanh"):
            return occurrences(base, leaf) == 1
        case _:
            return base == leaf


def _is_linear(monomial: collecting.Monomial, leaf: ex.Velocity) -> bool:
    rest = tuple(pair for pair in monomial if pair != (leaf, Fraction(1)))
    return len(rest) < len(monomial) and not short_forms.velocities_in(
        collecting.monomial_tree(rest), [leaf.coordinate]
    )


def _unwound(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[Root]:
    for root in isolate(tree, leaf, known.value):
        yield Root(root.value, (*known.conditions, *root.conditions))


def _quadratic(a: ex.Expression, b: ex.Expression, c: ex.Expression, y: ex.Expression) -> Iterator[Root]:
    """Both roots of a y^2 + b y + c; `y` as a tree in v says which one it is."""
    discriminant = short_forms.simplified(b**2 - 4 * a * c)
    slope = 2 * a * y + b
    for sign in (1, -1):
        over = -b + sign * ex.square_root(discriminant)
        yield Root(over / (2 * a), (sign * slope,))


def _cubic(c: list[ex.Expression], y: ex.Expression) -> Iterator[Root]:
    """The roots of c_3 y^3 + c_2 y^2 + c_1 y + c_0: with y = z - h those of z^3 + 3 k z = b."""
    h, slope, start = (short_forms.simplified(c[j] / (d * c[3])) for j, d in ((2, 3), (1, 1), (0, 1)))
    k = short_forms.simplified(Fraction(1, 3) * slope - h**2)
    b = short_forms.simplified(h * (slope - 2 * h**2) - start)
    z, unknown = y + h, ex.Velocity(_NAME)
    if k == ex.ZERO:
        for root in isolate(ex.Power(unknown, ex.number(3)), unknown, b):
            yield Root(root.value - h)
        return
    yield Root(_tripled(k, b, "asinh", "sinh") - h, (k,))
    size = short_forms.simplified(-k)
    outside = z**2 - size
    yield Root(_tripled(size, -b, "asin", "sin") - h, (size, -outside))
    ratio = b / (2 * size ** Fraction(3, 2))
    for inverse, function, side in (("acosh", "cosh", 1), ("acos", "cos", -1)):
        for sign in map(ex.number, (1, -1)):
            value = sign * _tripled(size, sign * b, inverse, function)
            alone = side * (sign * ratio - 1)
            yield Root(value - h, (size, outside, sign * z, alone))


def _tripled(k: ex.Expression, b: ex.Expression, inverse: str, function: str) -> ex.Expression:
    """2 sqrt(k) sinh(asinh(b/(2 k^(3/2)))/3), for other functions likewise: z^3 + 3 k z = b by the triple angle."""
    angle = ex.apply(inverse, short_forms.simplified(b / (2 * k ** Fraction(3, 2))))
    third = ex.apply(function, Fraction(1, 3) * angle)
    return 2 * ex.square_root(short_forms.simplified(k)) * third


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
    laurent = laurent_polynomial(block.function, ex.Velocity(block.names[0]))
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


def roots_for(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """The solutions of slope = momentum for the velocity that are found in closed form."""
    collected = collecting.collect(slope)
    once = [form for form in (collected, slope, short_forms.quotient(collected)) if occurrences(form, rate) == 1]
    if once:
        yield from isolate(short_forms.shortest(once), rate, momentum)
        return
    yield from polynomial_roots(collected, rate, momentum)
    yield from _cleared(short_forms.quotient(collected), rate, momentum)
    yield from _balanced(collected, rate, momentum)
    yield from _of_two_logarithms(collected, rate, momentum)
    yield from _of_one_arctangent(collected, rate, momentum)
    yield from _with_a_root(short_forms.simplified(slope), rate, Root(momentum))


def _cleared(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """A - p B = 0 for F = A/B."""
    above: list[ex.Expression] = []
    below: list[ex.Expression] = []
    for f in ex.factors_of(slope):
        (below if _is_below(f) and occurrences(f, rate) else above).append(f)
    if below:
        inverse = ex.multiply(*(f**-1 for f in below))
        yield from polynomial_roots(ex.multiply(*above) - momentum * inverse, rate, ex.ZERO)


def _of_two_logarithms(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """F = c (log A - log B) + r = p for A, B linear in v: A/B = exp((p - r)/c)."""
    found = _log_of_quotient(slope, rate, momentum)
    if found is not None:
        ratio = ex.apply("exp", found[2])
        (a, b), (e, f) = (_linear_parts(node.argument, rate) for node in found[:2])
        yield Root((ratio * f - b) / (a - ratio * e))


def _log_of_quotient(
    slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression
) -> tuple[ex.Apply, ex.Apply, ex.Expression] | None:
    """log A, log B and (p - r)/c for p = c (log A - log B) + r with c and r free of v."""
    parts: dict[ex.Apply | None, list[ex.Expression]] = {}
    for term in slope.terms if isinstance(slope, ex.Sum) else ():
        logs = [node for node in ex.walk(term) if isinstance(node, ex.Apply) and node.function == "log"]
        held = [node for node in logs if occurrences(node, rate) == occurrences(term, rate) > 0]
        parts.setdefault(held[0] if held else None, []).append(term)
    rest = ex.add(*parts.pop(None, ()))
    if len(parts) != 2:
        return None
    (over, c), (under, d) = (
        (node, short_forms.simplified(ex.add(*terms) / node)) for node, terms in parts.items() if node
    )
    if short_forms.simplified(c + d) != ex.ZERO:
        return None
    if sampling.vanishes_at(rest, sampling.sample_points([rest])):
        return over, under, momentum / c
    return over, under, (momentum - short_forms.simplified(ex.substitute(rest, {rate: ex.ZERO}))) / c


def _of_one_arctangent(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """F = c atan A + r = p, where r is constant as one quotient of polynomials: A has roots of symbols."""
    terms = slope.terms if isinstance(slope, ex.Sum) else ()
    arcs = {
        node
        for node in ex.walk(slope)
        if isinstance(node, ex.Apply) and node.function == "atan" and occurrences(node, rate)
    }
    held = [term for term in terms if any(node in set(ex.walk(term)) for node in arcs)]
    if len(arcs) != 1 or len(held) == len(terms):
        return
    rest = short_forms.exact_quotient(ex.add(*(term for term in terms if term not in held)))
    if not occurrences(rest, rate):
        (arc,) = arcs
        factor, (a, b) = short_forms.simplified(ex.add(*held) / arc), _linear_parts(arc.argument, rate)
        if not occurrences(factor, rate) and not occurrences(a, rate):
            angle = (momentum - rest) / factor
            yield Root((ex.apply("tan", angle) - b) / a)


def _linear_parts(tree: ex.Expression, rate: ex.Velocity) -> tuple[ex.Expression, ex.Expression]:
    return short_forms.simplified(derivative.differentiate(tree, rate)), short_forms.simplified(
        ex.substitute(tree, {rate: ex.ZERO})
    )


def _with_a_root(tree: ex.Expression, rate: ex.Velocity, known: Root) -> Iterator[Root]:
    """F(u) = p for u that holds v in one square root besides: A + B sqrt(S) = 0 for the numerator of u - p'."""
    if sum(1 for part in ex.children(tree) if occurrences(part, rate)) == 1:
        for inner, root in peeled(tree, rate, known):
            yield from _with_a_root(inner, rate, root)
        return
    squared = _without_root(ex.multiply(*_numerator(tree - known.value, rate)), rate)
    for factor in _numerator(squared, rate):
        for root in polynomial_roots(factor, rate, ex.ZERO):
            yield Root(root.value, known.conditions + root.conditions)


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
        factor = collecting.terms_tree([term])
        roots = [node for node in ex.walk(factor) if _is_root(node) and occurrences(node, rate)]
        (rooted.setdefault(roots[0], []) if roots else plain).append(factor / roots[0] if roots else factor)
    if len(rooted) != 1:
        return ex.ZERO
    ((root, terms),) = rooted.items()
    return ex.add(*plain) ** 2 - ex.add(*terms) ** 2 * root**2


def _is_root(node: ex.Expression) -> bool:
    return isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number) and node.exponent.value == ex.HALF.value


def _balanced(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """F = p where the factored F - c has v once, c being the part of F without v."""
    terms = slope.terms if isinstance(slope, ex.Sum) else (slope,)
    fixed = [term for term in terms if not occurrences(term, rate)]
    rest = short_forms.quotient(ex.add(*(term for term in terms if occurrences(term, rate))))
    if fixed and occurrences(rest, rate) == 1:
        yield from isolate(rest, rate, momentum - ex.add(*fixed))


def elimination_branches(block: blocks.Block) -> Iterator[blocks.Branch]:
    """The branches of a block of two or three velocities; H is the energy p v - L at v(p)."""
    if not 1 < len(block.names) <= _LARGEST_BLOCK:
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


def _isolated(
    equations: Sequence[Equation], names: Sequence[str]
) -> Iterator[tuple[str, Root, list[Equation], list[str]]]:
    """One velocity isolated in one equation, the other equations after substituting it, and the other velocities."""
    for momentum, function in equations:
        others = [equation for equation in equations if equation[0] != momentum]
        for name in names:
            for root in isolate(function, ex.Velocity(name), momentum):
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
