"""The Lagrangians that the search returns, written for people: shortened, described, and compared.

Terms of the same velocities and parameters are over one denominator. f is simplified in the same
way before the search.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from itertools import combinations, product
from math import prod

import mpmath

from inverse_service import bounds, deadline, errors
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import Lagrangian
from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.field import exact_field, modular, real_branch, tower as towers
from inverse_service.mechanics import book_forms, euler_lagrange, moves, square_forms, writing
from inverse_service.mechanics.moves import Form, Move
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import antiderivatives, material as mt

_HALF = Fraction(1, 2)
_LONGEST_CHECK = 60.0  # seconds per described Lagrangian
# Two Hessians are compared at a point and where its coordinates and velocities are larger by this
# factor.
_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128
# The terms of a potential keep their familiar separate form unless one bracket is this much
# shorter.
_MUCH = 2


@dataclass(frozen=True, slots=True)
class Found:
    """Regular Lagrangians of one family, simplest first; `parts` are the Lagrangians whose sum is
    the first one.
    """

    lagrangians: tuple[ex.Expression, ...]
    family: str
    parts: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """The Lagrangians found, and each family tried with its number of candidates."""

    found: Found | None
    tried: tuple[tuple[str, int], ...]


def shorten_lagrangian(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """A tree with fewer nodes that is equivalent up to a constant factor, or the same tree; the
    caller must verify it.

    Sums of velocities with powers higher than 2 or inside functions are kept, because the momenta
    are solved for them.

    1. GAUGES: what changes L comes first, because the length of a form depends on it.
    2. `_shortened` finds the shortest of FORMS. Most are written from the expanded terms
       (`tm.terms_of`), in which the products, squares, and signs of STYLE would be undone.
    3. STYLE: every step makes new sums and products, so the order of terms and of factors comes
       last.

    Within a kind of step the order is free: of the 213 trees of 166 rows of the corpus, none
    changes if two gauges, two functions, two signs, or two orders are exchanged. Seven change if a
    move of STYLE comes before FORMS.
    """
    moving = [place(name) for name in system.coordinates for place in (ex.Symbol, ex.Velocity)]
    tree = ex.add(
        *(term for term in ex.summands(collecting.merge_powers(tree)) if ex.holds(term, *moving))
    )
    tree = moves.write(GAUGES, system, tree, mt.FAILED)
    if ex.node_count(tree) > bounds.TERMS:
        return tree
    joined = writing.joined(tree) if _has_symbolic_powers(tree) else tree
    written = [moves.write(STYLE, system, _shortened(one, system)) for one in {joined: 0, tree: 0}]
    return min(written, key=moves.cost)


def _has_symbolic_powers(tree: ex.Expression) -> bool:
    return any(
        isinstance(node, ex.Power) and not isinstance(node.exponent, ex.Number)
        for node in ex.walk(tree)
    )


def _without_constant_rates(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree without terms c x', c a constant: total derivatives."""
    if ex.node_count(tree) > bounds.TERMS:
        return tree
    terms, constants = _terms_of(tree), _parameters(system)
    velocities = {*map(ex.Velocity, system.coordinates)}
    kept = {
        key: value
        for key, value in terms.items()
        if not _is_constant_rate(key, velocities, constants)
    }
    return tm.tree_of(kept) if len(kept) < len(terms) else tree


def _without_turns(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with 2 x y' for x y' - y x', which differ by the total derivative of x y; not if a
    letter multiplies both, which people write in a symmetric gauge.
    """
    if ex.node_count(tree) > bounds.TERMS:
        return tree
    terms = dict(_terms_of(tree))
    places = [(ex.Symbol(name), ex.Velocity(name)) for name in system.coordinates]
    for (x, v), (y, w) in combinations(places, 2):
        one, other = tm.monomial(x, w), tm.monomial(y, v)
        for factor in [key - one for key in terms if one <= key]:
            value = terms[factor | one]
            if terms.get(factor | other) == -value and not any(
                modular.variables_in(p) for p, _ in factor
            ):
                kept, gone = (one, other) if value > 0 else (other, one)
                terms[factor | kept] = 2 * abs(value)
                del terms[factor | gone]
    return tree if terms == _terms_of(tree) else tm.tree_of(terms)


def _is_constant_rate(
    key: tm.Monomial, velocities: Collection[ex.Expression], constants: frozenset[ex.Symbol]
) -> bool:
    rates = [item for item in key if item[0] in velocities]
    return (
        len(rates) == 1
        and rates[0][1] == 1
        and all(constants.issuperset(modular.variables_in(p)) for p, _ in key - {*rates})
    )


def _times_divisors(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The multiple of the tree in which no term is divided by a sum of parameters, unless it is
    longer.
    """
    terms = _terms_of(tree)
    plain = tm.tree_of(terms)
    below = _divisor(
        terms,
        {p for p in _constant_divisors([plain], _parameters(system)) if isinstance(p, ex.Sum)},
    )
    whole = tm.tree_of(tm.multiply_by(terms, below))
    return whole if below and moves.size(whole) <= moves.size(plain) else tree


def _shortened(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The fixed point of `_shortest`; forms of the terms are not repeated for the same terms."""
    shorter, terms = _shortest(tree, system), _terms_if_few(tree)
    while shorter != tree:
        before, tree, terms = terms, shorter, _terms_if_few(shorter)
        shorter = _shortest(tree, system, terms != before)
    return tree


def _in_document_order(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with constants in the order of the document, and with sums and roots of f as they
    are in f.
    """
    given = tuple(system.given)
    written = writing.with_sums_as_in(tree, given)
    return writing.with_products_in_order(
        written, tuple(map(ex.Symbol, system.parameters)), kept=_nodes_but_products(given)
    )


@lru_cache(maxsize=8)
def _nodes_but_products(trees: tuple[ex.Expression, ...]) -> frozenset[ex.Expression]:
    """Kept, since a document orders hundreds of formulas."""
    return frozenset(n for n in ex.distinct_nodes(trees) if not isinstance(n, ex.Product))


def _turns_together(tree: ex.Expression, constants: frozenset[ex.Symbol]) -> ex.Expression:
    """The tree with B (x y' - y x')/2 for B x y'/2 - B y x'/2 (a symmetric gauge), B with only
    these constants.
    """
    terms = [*ex.summands(tree)]
    for one, other in combinations(terms, 2):
        if _degree(one) == _degree(other) == 1:
            parts = [
                [
                    f
                    for f in ex.factors_of(term)
                    if not constants.issuperset(modular.variables_in(f))
                ]
                for term in (one, other)
            ]
            outside = ex.multiply(*(f for f in ex.factors_of(one) if f not in parts[0]))
            left, right = (ex.multiply(*part) for part in parts)
            alike = _names_in(left) == _names_in(right) and not isinstance(outside, ex.Number)
            if alike and not tm.terms_of(other + outside * right):
                terms[terms.index(one)] = outside * (left - right)
                terms.remove(other)
                return _turns_together(ex.add(*terms), constants)
    return tree


def _names_in(tree: ex.Expression) -> set[str]:
    return {
        node.coordinate if isinstance(node, ex.Velocity) else node.name
        for node in modular.variables_in(tree)
    }


def _grouped_alike(tree: ex.Expression) -> ex.Expression:
    """The tree with squares of velocities grouped like squares of coordinates: (x'^2 + y'^2)/2 and
    k (x^2 + y^2)/2.
    """
    terms = [*ex.summands(tree)]
    for group in (
        factor for term in terms for factor in ex.factors_of(term) if isinstance(factor, ex.Sum)
    ):
        bases = [
            part.base
            for part in group.terms
            if isinstance(part, ex.Power) and part.exponent == ex.TWO
        ]
        names = [base.name for base in bases if isinstance(base, ex.Symbol)]
        squares = [ex.HALF * ex.Velocity(name) ** 2 for name in names]
        if len(names) == len(group.terms) and all(square in terms for square in squares):
            together = ex.HALF * ex.add(*(ex.Velocity(name) ** 2 for name in names))
            return ex.add(together, *(term for term in terms if term not in squares))
    return tree


def _finite(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with another constant in the potential if, like f, it then has fewer constant
    denominators.

    a^2/(2 k (1 + k x^2)) - a^2/(2 k) is -a^2 x^2/(2 (1 + k x^2)), which is defined for k = 0.
    """
    terms = ex.summands(tree)
    rest = [term for term in terms if not tm.has_velocity(term)]
    parameters = _parameters(system)
    divisors = _constant_divisors(rest, parameters) - _constant_divisors(
        system.accelerations, parameters
    )
    if not divisors or any(ex.holds(term, ex.TIME) for term in rest):
        return tree
    potential = ex.add(*rest)
    start = collecting.collect(
        ex.substitute(potential, {ex.Symbol(name): ex.ZERO for name in system.coordinates})
    )
    if ex.has(start, ex.Apply):
        return tree
    symbols: list[ex.Symbol | ex.Velocity] = [
        *map(ex.Symbol, (*system.parameters, *system.coordinates))
    ]
    (moved,) = exact_field.factored([potential - start], symbols, exact_field.Budget.short())
    left = _constant_divisors([moved], parameters) - _constant_divisors(
        system.accelerations, parameters
    )
    return (
        tree if len(left) >= len(divisors) else ex.add(*(t for t in terms if t not in rest), moved)
    )


def _regular_gauge(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with c sin(u)^2 q' for -c cos(u)^2 q', constant c, if q'^2 has the factor sin(u)^2:
    both vanish together.

    The difference is the total derivative of c q.
    """
    terms = [*ex.summands(tree)]
    constants = _parameters(system)
    for velocity in map(ex.Velocity, system.coordinates):
        powers = [dict(ex.powers_of(term)) for term in terms]
        squares = [{*table.items()} for table in powers if table.get(velocity) == 2]
        for k, table in enumerate(powers):
            for letter, e in list(table.items()) if table.get(velocity) == 1 else ():
                if isinstance(letter, ex.Apply) and letter.function == "cos" and e == 2:
                    sine: ex.Expression = ex.Apply("sin", letter.argument)
                    others = {base for base in table if base not in (letter, velocity)}
                    plain = all(constants.issuperset(modular.variables_in(base)) for base in others)
                    if (
                        plain
                        and squares
                        and all((sine, Fraction(2)) in square for square in squares)
                    ):
                        terms[k] = ex.substitute(terms[k], {letter**2: ex.negated(sine**2)})
    return ex.add(*terms)


def _cyclic_gauge(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with F(x) y', F' = B, for -y B(x) x' with an arbitrary function in B if y then is
    cyclic.
    """
    if ex.has(tree, ex.Integral) or not ex.has(tree, ex.Arbitrary):
        return tree
    integrator, terms = (
        antiderivatives.Integrator(system, integral_signs=True),
        [*ex.summands(tree)],
    )
    moving = {*map(ex.Symbol, system.coordinates), *map(ex.Velocity, system.coordinates), ex.TIME}
    for y in map(ex.Symbol, system.coordinates):
        held = [term for term in terms if ex.holds(term, y)]
        if len(held) != 1 or not ex.has(held[0], ex.Arbitrary):
            continue
        for x in system.coordinates:
            slope = collecting.collect(-held[0] / (y * ex.Velocity(x)))
            if x != y.name and moving & {*ex.walk(slope)} == {ex.Symbol(x)}:
                found = integrator.function_of([ex.Symbol(x)], [tm.terms_of(slope)])
                others = [term for term in terms if term != held[0]]
                return ex.add(*others, tm.tree_of(found) * ex.Velocity(y.name)) if found else tree
    return tree


def _constant_divisors(
    trees: Iterable[ex.Expression], parameters: frozenset[ex.Symbol]
) -> set[ex.Expression]:
    """The denominators of trees that contain only parameters."""
    powers = (
        node
        for node in ex.distinct_nodes(trees)
        if isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number)
    )
    bases = (node.base for node in powers if node.exponent.value < 0)  # type: ignore[union-attr]
    return {
        base
        for base in bases
        if (held := modular.variables_in(base)) and parameters.issuperset(held)
    }


def with_written_roots(
    tree: ex.Expression, system: SecondOrderSystem, point: real_branch.RealTable
) -> ex.Expression | None:
    """A multiple of L with the roots of sums that f has as written, and without constant divisors.

    -m c^2 sqrt(1 - v^2/c^2) - V for -sqrt(c^2 - v^2) - V/(m c) if f contains 1 - v^2/c^2. None if f
    has no such root.
    """
    constants = _parameters(system)
    written: dict[ex.Expression, tuple[ex.Expression, tm.Monomial, Fraction]] = {}
    for node in ex.distinct_nodes(system.given):
        match node:
            case ex.Power(ex.Sum() as radicand, ex.Number(e)) if (
                e.denominator > 1 and tm.has_velocity(radicand)
            ):
                with suppress(tm.TooManyTerms):
                    terms = tm.terms_of(radicand)
                    below = _divisor(terms, constants)
                    content, _, rest = tm.split_content(tm.multiply_by(terms, below))
                    written[rest] = (radicand, below, content)
    if not any(below for _, below, _ in written.values()):
        return None

    found: dict[tm.Monomial, Fraction] = {}
    for key, value in tm.terms_of(tree).items():
        for letter, e in key:
            entry: tuple[ex.Expression, tm.Monomial, Fraction] = (letter, tm.EMPTY, Fraction(1))
            base, below, content = written.get(letter, entry)
            if content != 1:
                return None
            key = (
                tm.times(tm.times(key, frozenset([(letter, -e)])), frozenset([(base, e)]))
                if below
                else key
            )
            for constant, power in below:
                value = value * (
                    1 if real_branch.real_sign(constant, point) > 0 or not (power * e) % 2 else -1
                )
            key = tm.times(key, below, e)
        found[key] = found.get(key, Fraction(0)) + value
    rooted = {letter for _, below, _ in written.values() for letter, _ in below}
    below = _divisor(found, constants)
    sign = prod(
        real_branch.real_sign(letter, point) for letter, e in below if letter in rooted and e % 2
    )
    tree = kinetic_first(tm.tree_of(tm.multiply_by(found, below, factor=sign)))
    return _in_document_order(tree, system)


def _divisor(terms: tm.Terms, constants: Collection[ex.Expression]) -> tm.Monomial:
    """The lowest product of constants by which the terms must be multiplied to become polynomials
    in the constants.
    """
    powers = [(letter, e) for key in terms for letter, e in key if letter in constants and e < 0]
    return frozenset(
        (letter, -min(e for other, e in powers if other == letter)) for letter, _ in powers
    )


@lru_cache(maxsize=256)
def _shortest(
    tree: ex.Expression, system: SecondOrderSystem, of_terms: bool = True
) -> ex.Expression:
    """The shortest of all forms, or of those that depend on how the tree is written; the tree if
    none is shorter.
    """
    kept = _velocity_sums(tree)
    tried = (form for form in FORMS if of_terms or not form.of_terms)
    return moves.cheapest(
        tried,
        system,
        tree,
        lambda one: kept <= _velocity_sums(one),
        mt.FAILED,
        partial(_with_common_constants, system),
    )


@lru_cache(maxsize=64)
def _terms_of(tree: ex.Expression) -> tm.Terms:
    """The terms of a tree, cached because several forms use them; callers must not change them."""
    return tm.terms_of(tree)


def _terms_if_few(tree: ex.Expression) -> tm.Terms:
    """The terms; empty if there are too many."""
    with suppress(*mt.FAILED):
        return _terms_of(tree)
    return {}


def kinetic_first(tree: ex.Expression) -> ex.Expression:
    """The tree with T before the terms linear in velocities, and these before the potential: T + A
    v - V.
    """
    if isinstance(tree, ex.Product):
        return ex.multiply(*map(kinetic_first, tree.factors))
    return ex.add(*sorted(ex.summands(tree), key=_place))


def _place(term: ex.Expression) -> tuple[int, bool]:
    """A sort key: the degree in the velocities (at most 2); a kinetic energy does not begin with a
    minus sign.
    """
    degree = min(_degree(term), 2)
    return -degree, degree == 2 and isinstance(term, ex.Product) and writing.is_negative(term)


def _is_upside_down(tree: ex.Expression, system: SecondOrderSystem) -> bool:
    """Whether the coefficients of all squared velocities have negative constants, and no positive
    ones: k v^2/r - m v^2.

    Parameters are positive. Where one velocity has terms of one sign alone, all terms of one sign
    count as constants do: k v^2/r - m v^2 - m r^2 w^2.
    """
    terms, constants = _terms_if_few(tree) if _degree(tree) == 2 else {}, _parameters(system)
    masses = [tm.power_coefficient(terms, ex.Velocity(name), 2) for name in system.coordinates]

    def has_one_sign(key: tm.Monomial) -> bool:
        return all(
            (exponent.denominator == 1 and exponent % 2 == 0)
            or ex.is_exponential(base)
            or tm.holds_only(frozenset([(base, exponent)]), constants)
            for base, exponent in key
        )

    def are_negative(counts: Callable[[tm.Monomial], bool]) -> bool:
        found = ([c for key, c in mass.items() if counts(key)] for mass in masses)
        return all(one and max(one) < 0 for one in found)

    is_plain = any(mass and all(map(has_one_sign, mass)) for mass in masses)
    return are_negative(has_one_sign if is_plain else lambda key: tm.holds_only(key, constants))


def _degree(tree: ex.Expression) -> int:
    """The degree in the velocities, 2 for a tree that is not polynomial in them."""
    match tree:
        case ex.Velocity():
            return 1
        case ex.Sum(terms):
            return max(map(_degree, terms))
        case ex.Product(factors):
            return sum(map(_degree, factors))
        case _:
            return 2 if tm.has_velocity(tree) else 0


def _velocity_sums(tree: ex.Expression) -> int:
    """The number of different sums of velocities under powers other than squares, or in functions.

    3 (w' + 2 u'/3) - 2 u' does not count, because it is 3 w'.
    """
    found = set()
    for node in ex.walk(tree):
        match node:
            case ex.Power(ex.Sum() as inner, exponent) if exponent != ex.TWO:
                found.add(inner)
            case ex.Apply(_, ex.Sum() as inner):
                found.add(inner)
    moving = [inner for inner in found if ex.has(inner, ex.Velocity)]
    return sum(isinstance(collecting.collect(inner), ex.Sum) for inner in moving)


# The forms: each takes a system and a tree, and the caller keeps the shortest.


def _with_common_factor(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with the common factor of all terms before a bracket: e^(ct) (x'^2 - x^2)/2.

    The factor consists of exponentials of t and common denominators. What is in the bracket may
    change by a constant only if no coordinate is in the factor.
    """
    terms = _terms_of(tree)
    content, shared, _ = tm.split_content(terms) if terms else (Fraction(0), tm.EMPTY, tree)
    below = frozenset.intersection(*terms) if terms else tm.EMPTY  # each term is divided by this
    common: tm.Monomial = frozenset(
        (p, e)
        for p, e in shared
        if (ex.is_exponential(p) and ex.holds(p, ex.TIME)) or (e < 0 and (p, e) in below)
    )
    if not common:
        return tree
    content = content if content == Fraction(1, 2) else Fraction(1)
    rest = tm.multiply_by(terms, common, -1, 1 / content)
    if len(rest) == 2 and any(
        ex.is_exponential(p) and ex.holds(p, ex.TIME) for key in rest for p, _ in key
    ):
        return tree  # (e^t x'^2 - e^-t x^2)/2 is no e^-t (e^(2 t) x'^2 - x^2)/2
    whole = tm.tree_of(rest)
    inside = _shortened(whole, system)
    if ex.holds(tm.monomial_tree(common), *map(ex.Symbol, system.coordinates)):
        is_equal = collecting.collect(inside - whole) == ex.ZERO
        inside = inside if is_equal else _shortest_equal(system, rest)
    return content * tm.monomial_tree(common) * kinetic_first(inside)


def _by_functions_of_time(
    system: SecondOrderSystem, tree: ex.Expression
) -> Iterator[ex.Expression]:
    """The sum of a bracket without t for each product of functions of t: e^(ct) cos(t) (x'^2 -
    x^2)/2 + e^(ct) sin(t) x' y'; of cosh(ct) and sinh(ct) for exp(ct) beside these, too.
    """
    moving = [place(name) for name in system.coordinates for place in (ex.Symbol, ex.Velocity)]
    table = dict[ex.Expression, ex.Expression]()
    for node in ex.distinct_nodes([tree]):
        if isinstance(node, ex.Apply) and node.function in ("cosh", "sinh"):
            u = node.argument
            even, odd = ex.Apply("cosh", u), ex.Apply("sinh", u)
            table |= {ex.Apply("exp", u): even + odd, ex.Apply("exp", ex.negated(u)): even - odd}
    for one in dict.fromkeys((tree, ex.substitute(tree, table))):
        terms = tm.terms_of(one)
        groups = tm.grouped(terms, lambda p: ex.holds(p, ex.TIME) and not ex.holds(p, *moving))
        if 1 < len(groups) < len(terms) and not any(
            ex.holds(p, ex.TIME) for inner in groups.values() for key in inner for p, _ in key
        ):
            yield ex.add(
                *(
                    tm.monomial_tree(outer) * kinetic_first(_shortest_equal(system, inner))
                    for outer, inner in groups.items()
                )
            )


def _shortest_equal(system: SecondOrderSystem, terms: tm.Terms) -> ex.Expression:
    """The cheapest form that is equal: of a part of L, no factor and no derivative may go."""
    tree = tm.tree_of(terms)
    forms = [tree, _by_parameters(system, tree), _grouped_by_rates(system, terms)]
    forms += [*_short_forms(system, tree), *_squares_of_positions(system, tree)]
    return min(forms, key=moves.cost)


def _with_whole_squares(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with the quadratic terms of each factor m/(a^2 - x^2) as one square: m (x x' + y
    y')^2/(2 (a^2 - x^2)).

    Squares of single velocities with the same coefficient share it: m (x'^2 + y'^2)/2.
    """
    quadratic, parts, plain = tm.Terms(), list[ex.Expression](), list[ex.Expression]()
    velocities = [ex.Velocity(name) for name in system.coordinates]
    for part in ex.summands(tree):
        terms = tm.terms_of(part)
        if all(tm.velocity_degree(key) == 2 for key in terms):
            quadratic = tm.add_terms(quadratic, terms)
        else:
            parts.append(part)
    held = _parameters(system)
    groups = tm.grouped(
        quadratic, lambda p: p in held or (isinstance(p, ex.Sum) and not tm.has_velocity(p))
    )
    for key, inner in groups.items():
        constants, rates = tm.monomial_tree(key), tm.grouped(inner, tm.has_velocity)
        short = {v: tm.tree_of(tm.shortest_in_angles(c)) for v, c in rates.items()}
        # One term stays as it is: the square has 2 sin(u) cos(u), not sin(2 u).
        whole = ex.add(
            *(
                (tm.tree_of(c) if len(c) == 1 else short[v]) * tm.monomial_tree(v)
                for v, c in rates.items()
            )
        )
        squares = filter(
            _is_square, square_forms.short_forms(whole, velocities) if len(rates) > 1 else ()
        )
        square = next(squares, None)
        parts += [] if square is None else [constants * square]
        plain += [constants * c * tm.monomial_tree(v) for v, c in short.items() if square is None]
    rest = ex.add(*plain)
    forms = [writing.with_one_coefficient(rest, velocities)]
    if parts:
        forms.append(_grouped_by_rates(system, _terms_of(rest)))
    return ex.add(*parts, min(forms, key=moves.cost))


def _with_proper_quotients(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with proper quotients, and what is above their lines as squares if possible."""
    symbols, velocities = (
        [kind(name) for name in system.coordinates] for kind in (ex.Symbol, ex.Velocity)
    )
    return _with_whole_squares(
        system, square_forms.proper_quotients(tree, velocities, [*symbols, ex.TIME])
    )


def _by_powers_of_divisors(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """n (n + 1) y^2/2 - m^2 y^2/(2 (t^2 + 1)): what stands over a divisor with t is written in its
    powers, with factored coefficients.
    """
    parameters, parts = _parameters(system), list[ex.Expression]()
    for outer, inner in tm.grouped(
        _terms_of(tree), lambda p: p not in parameters and p != ex.TIME
    ).items():
        below = [p for p, e in outer if isinstance(p, ex.Sum) and e == -1 and ex.holds(p, ex.TIME)]
        divisor = tm.terms_of(ex.multiply(*below))
        for k, digit in enumerate(tm.in_powers(inner, divisor, ex.TIME) or (inner,)):
            coefficient = tm.tree_of(digit)
            if isinstance(coefficient, ex.Sum):
                names = [ex.TIME, *sorted(parameters, key=repr)]
                budget = exact_field.Budget.short()
                (coefficient,) = exact_field.factored([coefficient], names, budget)
            powers = (p**k for p in below) if k else ()
            parts.append(ex.multiply(coefficient, tm.monomial_tree(outer), *powers))
    return ex.add(*parts)


def _is_square(tree: ex.Expression) -> bool:
    return any(
        isinstance(factor, ex.Power) and isinstance(factor.base, ex.Sum)
        for factor in ex.factors_of(tree)
    )


def _with_squares_inside(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with sums of squares in roots, denominators, and functions if possible: (x - a)^2 +
    y^2.
    """
    tree = ex.rebuild(tree, partial(_with_squares_inside, system))
    letters = tuple(map(ex.Symbol, (*system.coordinates, *system.parameters)))
    match tree:
        case ex.Power(ex.Sum() as inner, ex.Number(e)) if tm.has_velocity(inner):
            if e < 0 and e.denominator == 1:
                velocities = [*map(ex.Velocity, system.coordinates)]
                return (
                    min([inner, *square_forms.short_forms(inner, velocities)], key=moves.cost) ** e
                )
        case ex.Power(ex.Sum() as inner, ex.Number(e)) if e < 0 or e.denominator > 1:
            return min([inner, *square_forms.sums_of_squares(inner, letters)], key=moves.cost) ** e
    return tree


def _by_parameters(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The sum grouped by its varying factors, with factored coefficients: n^2 + 2 m n is n (n + 2
    m).
    """
    parameters = _parameters(system)
    groups = tm.grouped(_terms_of(tree), lambda letter: letter not in parameters)
    coefficients: Sequence[ex.Expression] = [tm.tree_of(inner) for inner in groups.values()]
    if any(isinstance(c, ex.Sum) for c in coefficients):
        coefficients = exact_field.factored(
            coefficients, sorted(parameters, key=repr), exact_field.Budget.short()
        )
    return ex.add(*(c * tm.monomial_tree(key) for c, key in zip(coefficients, groups, strict=True)))


def _by_rates(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The sum grouped by products of velocities, each with one coefficient in its shortest form.

    The terms without velocities remain separate unless one bracket is much shorter, or two brackets
    are shorter.
    """
    return _grouped_by_rates(system, _without_common_squares(_terms_of(tree), _parameters(system)))


def _grouped_by_rates(system: SecondOrderSystem, every: tm.Terms) -> ex.Expression:
    """The terms as in `_by_rates`."""
    parts = []
    for rates, inner in tm.grouped(every, tm.has_velocity).items():
        terms = {key | rates: value for key, value in inner.items()}
        forms = [tm.tree_of(terms), *([_by_both(system, terms)] if len(terms) > 1 else [])]
        shared = tm.grouped(terms, lambda letter: isinstance(letter, ex.Sum))
        inside = {node for key in shared for p, _ in key for node in ex.walk(p)}
        forms += [_by_letters(system, terms, _parameters(system) - inside)] if inside else []
        forms += [
            ex.add(*(tm.monomial_tree(outer) * tm.tree_of(part) for outer, part in shared.items()))
        ]
        whole = _part(rates, inner, system)
        if not rates:
            forms.append(_by_positions(system, terms))
        brackets = sum(
            isinstance(factor, ex.Sum) for factor in ex.factors_of(writing.joined(whole))
        )
        if rates or (_MUCH if brackets < 2 else 1) * moves.size(whole) < min(
            map(moves.size, forms)
        ):
            forms.append(whole)
        parts.append(min(forms, key=moves.cost))
    tree = ex.add(*parts)
    return min(
        tree,
        writing.with_one_coefficient(tree, [*map(ex.Velocity, system.coordinates)]),
        key=moves.cost,
    )


def _by_positions(system: SecondOrderSystem, terms: tm.Terms) -> ex.Expression:
    """The sum with one coefficient that depends on t for each product of functions of position:
    (a t + b) x^2 for a t x^2 + b x^2.
    """
    positions = [*map(ex.Symbol, system.coordinates)]
    parts = []
    for outer, inner in tm.grouped(terms, lambda p: ex.holds(p, *positions)).items():
        forms = [tm.tree_of({key | outer: value for key, value in inner.items()})]
        if outer and len(inner) > 1 and any(ex.holds(p, ex.TIME) for key in inner for p, _ in key):
            forms.append(_part(outer, inner, system))
        parts.append(min(forms, key=moves.cost))
    return ex.add(*parts)


def _by_both(system: SecondOrderSystem, terms: tm.Terms) -> ex.Expression:
    """The sum by parameters if several multiply the same product of other generators; otherwise by
    these generators.
    """
    parameters = _parameters(system)
    groups = tm.grouped(terms, lambda letter: letter not in parameters)
    several = {
        key | c: value
        for key, inner in groups.items()
        for c, value in inner.items()
        if len(inner) > 1
    }
    rest = {key: value for key, value in terms.items() if key not in several}
    return _by_parameters(system, tm.tree_of(several)) + _by_letters(system, rest, parameters)


def _by_letters(
    system: SecondOrderSystem, terms: tm.Terms, parameters: frozenset[ex.Symbol]
) -> ex.Expression:
    """The sum grouped by velocities and these parameters, with each coefficient in its shortest
    form.
    """
    groups = tm.grouped(terms, lambda letter: letter in parameters or tm.has_velocity(letter))
    return ex.add(*(_part(outer, inner, system) for outer, inner in groups.items()))


def _is_symbolic(node: ex.Expression) -> bool:
    return (
        isinstance(node, ex.Power)
        and not isinstance(node.exponent, ex.Number)
        and tm.has_velocity(node)
    )


def _with_shifted_rates(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with c ((x' - w y)^2 + (y' + w x)^2)/2 for c (x'^2 + y'^2)/2 + 2 c w x y' (rotating
    frames).

    Also c (v + w)^2/2 for c v^2/2 + c w v with a constant w. The changed terms of the potential
    must vanish.
    """
    below = [node for node in ex.walk(tree) if moves.is_divisor(node) and not tm.has_velocity(node)]
    aside = [
        term for term in ex.summands(tree) if not tm.has_velocity(term) and ex.holds(term, *below)
    ]
    terms, constants = tm.terms_of(tree - ex.add(*aside)), _parameters(system)
    symbols, velocities = (
        [kind(name) for name in system.coordinates] for kind in (ex.Symbol, ex.Velocity)
    )
    # 2 c w x y' is c w (x y' - y x'), up to c w d(x y)/dt.
    for (x, v), (y, w) in combinations(zip(symbols, velocities, strict=True), 2):
        pair = tm.monomial(x, w), tm.monomial(y, v)
        for other in {key - one for key in terms for one in pair if one <= key}:
            if tm.holds_only(other, constants):
                mean = sum((terms.get(other | one, Fraction(0)) for one in pair), Fraction(0)) / 2
                terms = tm.add_terms(terms, {other | one: -mean for one in pair if mean})
    # With c v^2/2 and c s v, s without velocities, c (v + s)^2/2 takes -c s^2/2 from the potential.
    groups = dict[ex.Expression, list[ex.Expression]]()
    for v in velocities:
        factor, shift = tm.complete_square(terms, v)
        square = (v + tm.tree_of(shift)) ** 2
        whole = tm.terms_of(tm.tree_of(factor) * square)
        rest = tm.add_terms(terms, whole, -1)
        letters = {p for part in shift for p, _ in part}
        fixed = (
            constants.issuperset(letters)
            or not tm.coefficient(whole, tm.EMPTY).keys() & rest.keys()
        )
        if shift and fixed and not any(map(tm.has_velocity, letters)):
            groups.setdefault(tm.tree_of(factor), []).append(square)
            terms = rest
    potential = tm.shortest_in_angles(tm.coefficient(terms, tm.EMPTY))
    kept = {key: c for key, c in terms.items() if any(tm.has_velocity(p) for p, _ in key)}
    kept |= tm.without_constants(potential, constants)
    return (
        ex.add(*(c * ex.add(*some) for c, some in groups.items()), tm.tree_of(kept), *aside)
        if groups
        else tree
    )


def _with_springs(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The tree with c (u - l)^2 for c u^2 - 2 c l u, constants c and l, which changes the constant
    in the potential.

    u is a coordinate, its sine or cosine, or a root, as for a spring with natural length l, which t
    may change.
    """
    constants = _parameters(system) | {ex.TIME}
    parts = [term for term in ex.summands(tree) if not tm.has_velocity(term)]
    for p in dict.fromkeys(
        p for term in parts for key in tm.terms_of(term) for p, _ in key if p not in constants
    ):
        held = [
            term for term in parts if ex.holds(term, *(set(modular.variables_in(p)) - constants))
        ]
        terms, u = (
            tm.terms_of(ex.add(*held)),
            frozenset([(p, _HALF if isinstance(p, ex.Sum) else Fraction(1))]),
        )
        squares = [tm.terms_of(p) if isinstance(p, ex.Sum) else {tm.times(u, u): Fraction(1)}]
        if isinstance(p, ex.Apply) and p.function in ("sin", "cos"):
            (other,) = mt.companions(p)
            squares.append({tm.times(tm.EMPTY, tm.monomial(other), 2): Fraction(-1)})
        squares = [tm.without_constants(one, constants) for one in squares]
        linear = {
            key: c for key, c in terms.items() if u <= key and tm.holds_only(key - u, constants)
        }
        for square, key in product(squares, terms if len(linear) == 1 else ()):
            found = _spring(terms, u, linear, square, key, constants)
            if found is not None:
                return ex.add(*(term for term in ex.summands(tree) if term not in held), found)
    return tree


def _spring(
    terms: tm.Terms,
    u: tm.Monomial,
    linear: tm.Terms,
    square: tm.Terms,
    first: tm.Monomial,
    constants: frozenset[ex.Symbol],
) -> ex.Expression | None:
    """The terms with c (u - l)^2 for c square + linear, `first` being the first term of c square;
    without c l^2.
    """
    ((part, unit), *_), ((key, value),) = square.items(), linear.items()
    stiffness, c = tm.times(first, part, -1), terms[first] / unit
    whole = tm.multiply_by(square, stiffness, factor=c)
    length = tm.times(key - u, stiffness, -1)
    below = frozenset(
        (q, -e) for q, e in length if e < 0
    )  # m (R + l sin u)^2 for m l^2 (R/l + sin u)^2
    held = modular.variables_in(tm.monomial_tree(length) * tm.monomial_tree(stiffness))
    is_plain = (
        held
        and constants.issuperset(held)
        and all(tm.exponent_of(stiffness, q) >= 2 * e for q, e in below)
    )
    if not is_plain or any(terms.get(other) != a for other, a in whole.items()):
        return None
    rest = tm.add_terms(tm.add_terms(terms, whole, -1), linear, -1)
    side = tm.tree_of({tm.times(u, below): Fraction(1), tm.times(length, below): value / (2 * c)})
    return tm.tree_of(rest) + c * tm.monomial_tree(tm.times(stiffness, below, -2)) * side**2


def _by_squares_of(
    name: str, other: str, system: SecondOrderSystem, tree: ex.Expression
) -> ex.Expression:
    """k (sin(a) - sin(b))^2 for -k (cos(a)^2 + cos(b)^2 + 2 sin(a) sin(b)), which changes the
    constant in V.
    """
    terms, constants = _terms_of(tree), _parameters(system)
    plain = tm.Terms()
    for key, value in terms.items():
        square = next(
            (p for p, e in key if isinstance(p, ex.Apply) and p.function == other and e == 2), None
        )
        if square is not None and tm.holds_only(key - {(square, Fraction(2))}, constants):
            key, value = (
                key - {(square, Fraction(2))} | {(ex.Apply(name, square.argument), Fraction(2))},
                -value,
            )
        plain[key] = plain.get(key, Fraction(0)) + value
    letters = tuple(
        p for p in dict.fromkeys(p for key in plain for p, _ in key) if isinstance(p, ex.Apply)
    )
    if name == "cos" and not letters:
        return tree  # the form with sines is the same
    groups = tm.grouped(plain, lambda letter: letter in constants or tm.has_velocity(letter))
    found = list[ex.Expression]()
    for outer, inner in groups.items():
        whole = tm.tree_of(inner)
        squares = square_forms.sums_of_squares(whole, letters) if letters else ()
        found.append(tm.monomial_tree(outer) * min([whole, *squares], key=moves.cost))
    return ex.add(*found)


def _by_functions(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """The sum grouped by functions of the velocities, with factored coefficients: (x + 2 x')
    atan(x'/x).
    """
    if not any(
        (isinstance(node, ex.Apply) and tm.has_velocity(node)) or _is_symbolic(node)
        for node in ex.walk(tree)
    ):
        return tree
    groups = tm.grouped(
        _terms_of(tree), lambda p: tm.has_velocity(p) and isinstance(p, ex.Apply | ex.Power)
    )
    parts = []
    for outer, inner in groups.items():
        if not outer:
            parts.append(min([tm.tree_of(inner), _by_both(system, inner)], key=moves.cost))
        elif len(inner) == 1:
            parts.append(tm.tree_of(inner) * tm.monomial_tree(outer))
        else:
            exponents = [dict(key) for key in inner]
            lowest = frozenset(
                (p, min(e.get(p, Fraction(0)) for e in exponents)) for e in exponents for p in e
            )
            rest = tm.tree_of(tm.multiply_by(inner, lowest, -1))
            whole = _quotient(rest, system.parameters, system.coordinates) * tm.monomial_tree(
                lowest
            )
            parts.append(whole * tm.monomial_tree(outer))
    return ex.add(*parts)


def _parameters(system: SecondOrderSystem) -> frozenset[ex.Symbol]:
    return frozenset(ex.Symbol(name) for name in system.parameters)


def _without_common_squares(terms: tm.Terms, parameters: frozenset[ex.Symbol]) -> tm.Terms:
    """The terms without common even powers of parameters: a positive multiple of L, with the same
    inertia.
    """
    shared = frozenset.intersection(*terms) if terms else tm.EMPTY
    common = frozenset((letter, e) for letter, e in shared if letter in parameters and e % 2 == 0)
    return tm.multiply_by(terms, common, -1)


def _part(outer: tm.Monomial, inner: tm.Terms, system: SecondOrderSystem) -> ex.Expression:
    """outer * inner, the sum in its shortest form: as it is, its primitive part, one quotient, or
    one power.
    """
    inner = tm.shortest_in_angles(inner)
    if not inner:  # sin^2 + cos^2 - 1
        return ex.ZERO
    plain = tm.tree_of(inner)
    moving: tm.Monomial = frozenset(item for item in outer if tm.has_velocity(item[0]))
    constant, rates = tm.monomial_tree(outer - moving), tm.monomial_tree(moving)
    content, common, rest = tm.split_content(inner) if moving else (Fraction(1), tm.EMPTY, plain)
    whole = content * constant * tm.monomial_tree(common) * rest * rates
    if len(inner) == 1:
        return whole
    if writing.has_many_divisors(plain):
        return whole
    quotient = _quotient(plain, system.parameters, system.coordinates)
    if _is_sum_of(quotient, len(inner)) and moves.size(quotient) >= moves.size(plain):
        return whole
    power = square_forms.as_power(collecting.expand(plain))
    return min(
        whole,
        *(constant * _constants_first(one, system) * rates for one in (quotient, power)),
        key=moves.size,
    )


@lru_cache(maxsize=256)
def _quotient(
    tree: ex.Expression, parameters: tuple[str, ...], names: tuple[str, ...]
) -> ex.Expression:
    """The sum as one factored quotient, or unchanged if it is too large; cached for the several
    forms.
    """
    velocities: list[modular.Variable] = [*map(ex.Velocity, names)]
    fixed = [*map(ex.Symbol, parameters), ex.TIME, *map(ex.Symbol, names)]
    return writing.quotient(tree, exact_field.Budget.short(), fixed + velocities)


def _constants_first(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The product with its constant factors first."""
    varying = {ex.TIME, *map(ex.Symbol, system.coordinates)}
    factors = ex.factors_of(tree)
    return ex.multiply(*sorted(factors, key=lambda factor: ex.holds(factor, *varying)))


def _is_sum_of(tree: ex.Expression, count: int) -> bool:
    """Whether the tree is a number times a sum of `count` terms, so that nothing was gained."""
    if isinstance(tree, ex.Product) and isinstance(tree.factors[0], ex.Number):
        tree = ex.multiply(*tree.factors[1:])
    return isinstance(tree, ex.Sum) and len(tree.terms) >= count


def _short_forms(system: SecondOrderSystem, tree: ex.Expression) -> Iterator[ex.Expression]:
    """Squares of linear forms of the velocities, and powers of quadratic forms."""
    constants = _parameters(system)
    for form in square_forms.short_forms(tree, [ex.Velocity(name) for name in system.coordinates]):
        yield book_forms.with_joined_coefficients(form, constants)


def _squares_of_positions(
    system: SecondOrderSystem, tree: ex.Expression
) -> Sequence[ex.Expression]:
    """k (x - y)^2/2 in the potential."""
    return square_forms.sums_of_squares(tree, tuple(map(ex.Symbol, system.coordinates)))


def _upright(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    """-L for an L whose squares of velocities are all negative."""
    return ex.negated(tree) if _is_upside_down(tree, system) else tree


def _with_common_constants(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    velocities = [ex.Velocity(name) for name in system.coordinates]
    return book_forms.with_common_constants(tree, velocities, _parameters(system))


def _numbers_outside(tree: ex.Expression) -> ex.Expression:
    """(a + 3 b) x'^2/(2 m) for (a/2 + 3 b/2) x'^2/m; brackets with velocities, such as T - V,
    unless that costs more.
    """

    def admits(before: ex.Product, after: ex.Expression) -> bool:
        brackets_before = (factor for factor in before.factors if isinstance(factor, ex.Sum))
        moving = any(map(tm.has_velocity, brackets_before))
        return not moving or moves.cost(after) <= moves.cost(before)

    return writing.numbers_outside(tree, admits)


def _symmetric(system: SecondOrderSystem, tree: ex.Expression) -> ex.Expression:
    return _turns_together(tree, _parameters(system) | {ex.TIME})


def _plain(
    function: Callable[[ex.Expression], ex.Expression],
) -> Callable[[SecondOrderSystem, ex.Expression], ex.Expression]:
    """A function of the tree as one of system and tree."""
    return lambda system, tree: function(tree)


def _one(
    function: Callable[[SecondOrderSystem, ex.Expression], ex.Expression],
) -> Callable[[SecondOrderSystem, ex.Expression], Iterator[ex.Expression]]:
    """A form without variants."""
    return lambda system, tree: iter((function(system, tree),))


_SAME, _CONSTANT, _FACTOR, _DERIVATIVE = (
    moves.Holds.WHERE_DEFINED, moves.Holds.CONSTANT, moves.Holds.FACTOR, moves.Holds.DERIVATIVE,
)  # fmt: skip
# Divisors may go with the constant of the potential, so the constant factor comes after it.
GAUGES: tuple[Move[SecondOrderSystem], ...] = (
    Move(
        "F(x) y' for -y B(x) x', F' = B",
        _DERIVATIVE,
        lambda system, tree: _cyclic_gauge(tree, system),
    ),
    Move(
        "c sin(u)^2 q' for -c cos(u)^2 q'",
        _DERIVATIVE,
        lambda system, tree: _regular_gauge(tree, system),
    ),
    Move(
        "no total derivative c x'",
        _DERIVATIVE,
        lambda system, tree: _without_constant_rates(tree, system),
    ),
    Move("2 x y' for x y' - y x'", _DERIVATIVE, lambda system, tree: _without_turns(tree, system)),
    Move("constant of the potential", _CONSTANT, lambda system, tree: _finite(tree, system)),
    Move("no divisor of constants", _FACTOR, lambda system, tree: _times_divisors(tree, system)),
)
# The first of two forms of one length is kept.
FORMS: tuple[Form[SecondOrderSystem], ...] = (
    Form("coefficients factored in the parameters", _SAME, _one(_by_parameters)),
    Form("common factor of all terms", _DERIVATIVE, _one(_with_common_factor)),
    Form("a bracket for each function of t", _SAME, _by_functions_of_time, of_terms=False),
    Form("grouped by products of velocities", _FACTOR, _one(_by_rates)),
    Form("whole squares over a divisor", _SAME, _one(_with_whole_squares), of_terms=False),
    Form("proper quotients", _SAME, _one(_with_proper_quotients)),
    Form("powers of a divisor with t", _SAME, _one(_by_powers_of_divisors)),
    Form("grouped by functions of velocities", _SAME, _one(_by_functions)),
    Form("rotating frames: (x' - w y)^2", _DERIVATIVE, _one(_with_shifted_rates), of_terms=False),
    Form("springs: (u - l)^2", _CONSTANT, _one(_with_springs), of_terms=False),
    Form("squares of sines", _CONSTANT, _one(partial(_by_squares_of, "sin", "cos"))),
    Form("squares of cosines", _CONSTANT, _one(partial(_by_squares_of, "cos", "sin"))),
    Form("squares of linear forms of velocities", _SAME, _short_forms, of_terms=False),
    Form("squares of linear forms of coordinates", _SAME, _squares_of_positions, of_terms=False),
)
STYLE: tuple[Move[SecondOrderSystem], ...] = (
    Move("tan(u) for sin(u)/cos(u), 1 - t^2 for (1 - t) (1 + t)", _SAME, _plain(writing.joined)),
    Move("asinh(u) for log(u + sqrt(u^2 + 1))", _SAME, _plain(book_forms.with_inverse_sines)),
    Move("a sin(u)^2 for a - a cos(u)^2", _SAME, _plain(writing.one_square)),
    Move("squares inside roots and denominators", _SAME, _with_squares_inside),
    Move(
        "(1 - mu)/s for 1/s - mu/s",
        _SAME,
        lambda system, tree: book_forms.with_joined_coefficients(tree, _parameters(system)),
    ),
    Move("positive kinetic energy", _FACTOR, _upright),
    Move("m (r'^2 + r^2 phi'^2)/2 for two terms", _SAME, _with_common_constants),
    Move("(b - a) c for -(a - b) c", _SAME, _plain(writing.minus_inside)),
    Move("no denominators inside brackets", _SAME, _plain(_numbers_outside)),
    Move("squares of velocities like those of coordinates", _SAME, _plain(_grouped_alike)),
    Move("B (x y' - y x')/2 for two terms", _SAME, _symmetric),
    Move("decimal numbers in their terms", _SAME, _plain(writing.decimals_inside)),
    Move("the order of the document", _SAME, lambda system, tree: _in_document_order(tree, system)),
    Move("kinetic energy first", _SAME, _plain(kinetic_first)),
)


# f before the search, and what is said about a Lagrangian after it.


def with_plain_forces(analysis: deciding.Analysis) -> deciding.Analysis:
    """The system with f in its simplest form.

    Its Lagrangians are verified with f as given.
    """
    forces = tuple(map(partial(_plainer, analysis.tower), _without_hidden_zeros(analysis)))
    if forces != analysis.system.accelerations:
        with suppress(errors.IrreducibleAtoms):
            return deciding.analyze(replace(analysis.system, accelerations=forces))
    return analysis


def _without_hidden_zeros(analysis: deciding.Analysis) -> tuple[ex.Expression, ...]:
    """f without the coefficients of velocities that vanish by relations among atoms, such as
    tan(pi/8) + 1 - sqrt(2).

    They are small at the real point and zero modulo a prime at a point of the tower, which has all
    relations.
    """
    given = analysis.system.accelerations
    table = analysis.real_point
    if table is None or not any(
        isinstance(node, ex.Apply | ex.Power) for node in ex.distinct_nodes(given)
    ):
        return given
    point = towers.draw_point(analysis.tower, 1)

    def is_zero(coefficient: tm.Terms) -> bool:
        tree = tm.tree_of(coefficient)
        return (
            real_branch.is_small(tree, table)
            and modular.evaluate(towers.to_kernels(tree), point) == 0
        )

    shown = []
    for f in given:
        with (
            suppress(*mt.FAILED, modular.SingularPoint, calculus.NoRealValue),
            mpmath.workdps(bounds.DIGITS),
        ):
            groups = tm.grouped(tm.terms_of(f), tm.has_velocity)
            kept = {
                moving: part
                for moving, part in groups.items()
                if len(part) == 1 or not is_zero(part)
            }
            if len(kept) < len(groups):
                f = ex.add(
                    *(tm.tree_of(part) * tm.monomial_tree(moving) for moving, part in kept.items())
                )
        shown.append(f)
    return tuple(shown)


def _plainer(tower: towers.Tower, force: ex.Expression) -> ex.Expression:
    """The force with dependent atoms, such as e^(log x), expressed by other atoms if that is
    shorter.
    """
    plain = towers.to_kernels(force)
    for rule in reversed(tower.rules):
        if not isinstance(rule, towers.AngleRule) and not rule.free:
            plain = ex.substitute(plain, {rule.atom: rule.tree})
    with suppress(errors.InputError):
        plain = plain if plain == force else writing.collected_inside(plain, moves.size)
    return min(writing.much_shorter(force), plain, key=ex.node_count)


def describe(analysis: deciding.Analysis, lagrangian: ex.Expression, family: str) -> Lagrangian:
    """Describe L: g = d2L/dv dv, the functions that must not vanish, and those that are positive on
    its domain.
    """
    names = analysis.system.coordinates
    rates = euler_lagrange.hessian(lagrangian, names)
    entries = dict.fromkeys(entry for row in rates for entry in row)  # g is symmetric
    short = {entry: _compact(analysis, entry) for entry in entries}
    multiplier = tuple(tuple(short[entry] for entry in row) for row in rates)
    where = certify.where_proved(
        analysis, lagrangian, min(deadline.left(deadline.end(), 1.0), _LONGEST_CHECK)
    )
    return Lagrangian(lagrangian, multiplier, family, where)


def _compact(analysis: deciding.Analysis, entry: ex.Expression) -> ex.Expression:
    """The entry as a sum of products or, if that is shorter, as one quotient; sums and products
    in the order of the document.
    """
    held, count = set(ex.walk(entry)), 1 + 2 * len(analysis.system.coordinates)
    moving = [
        variable for variable in deciding.variables_of(analysis.system)[:count] if variable in held
    ]
    short = writing.shorten(tm.collected(entry), exact_field.Budget.short(), moving)
    return _in_document_order(short, analysis.system)


def is_multiple(
    first: ex.Expression,
    second: ex.Expression,
    names: Sequence[str],
    table: real_branch.RealTable | None,
) -> bool:
    """Whether the Hessians are constant multiples of each other at the real point and at a point
    near it.
    """
    if table is None:
        return first == second
    moving = {*map(ex.Symbol, names), *map(ex.Velocity, names)}
    with mpmath.workdps(30):
        beside = {leaf: value * _STEP if leaf in moving else value for leaf, value in table.items()}
        forms = [
            [euler_lagrange.hessian_at(tree, names, at) for tree in (first, second)]
            for at in (table, beside)
        ]
        if any(form is None for pair in forms for form in pair):
            return False
        pairs = [entries for pair in forms for entries in zip(*pair, strict=True)]
        a, b = max(pairs, key=lambda pair: abs(pair[0]))
        return all(abs(x * b - y * a) < _TINY * (1 + abs(a * b)) for x, y in pairs)


def why_shown(
    shown: ex.Expression,
    other: ex.Expression,
    names: Sequence[str],
    table: real_branch.RealTable | None,
) -> str:
    """The advantage of another Lagrangian over the shown one; "" if it has none."""
    if len(printing.to_text(other)) < len(printing.to_text(shown)):
        return "shorter"
    if is_definite(other, names, table) and not is_definite(shown, names, table):
        return "positive definite"
    return "of another kind" if _kind(other, names) < _kind(shown, names) else ""


def is_definite(
    lagrangian: ex.Expression, names: Sequence[str], table: real_branch.RealTable | None
) -> bool:
    """Whether the Hessian is positive definite at the real point."""
    return euler_lagrange.inertia(euler_lagrange.hessian_at(lagrangian, names, table)) == (
        len(names),
        0,
    )


def _kind(lagrangian: ex.Expression, names: Sequence[str]) -> tuple[int, bool]:
    """Its `reading_class`, and whether its degree in the velocities exceeds 2."""
    moving = {*map(ex.Velocity, names)}
    is_higher = any(
        node in moving
        for row in euler_lagrange.hessian(lagrangian, names)
        for entry in row
        for node in ex.walk(entry)
    )
    return ex.reading_class(lagrangian, ex.TIME), is_higher
