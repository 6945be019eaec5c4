"""Functions written for people: a term for each product of velocities, tan for sin/cos, joined sums, short angles.

Angles in which the parts of a system are short: a - b for a where functions of a - b occur. A polynomial in the sines
and cosines of angles u is a sum of waves exp(i (w, u)), w integers. In another basis of the angles a wave with the
coordinates w takes prod_k (|w_k| + 1) monomials. A wheel at the angle b behind a wheel at the angle a brings
sin(a) cos(b) - cos(a) sin(b): one monomial in a - b, and its powers many in a and b.
"""

import math
import random
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, permutations
from operator import add, sub

from inverse_service import bounds, errors
from inverse_service.expressions import collecting, inequalities, printing, tree as ex
from inverse_service.field import exact_field

_MOST_PRODUCTS = 64
# Terms of a quotient that is still made shorter, which takes 1 ms a term; a longer one is not read by people.
_MOST_TERMS = 200
# Terms met on the way (`Budget`) in one quotient.
_WORK = 150_000
_QUOTIENTS = {("sin", "cos"): "tan", ("cos", "sin"): "cot", ("sinh", "cosh"): "tanh", ("cosh", "sinh"): "coth"}
_CIRCULAR = {"sin": "cos", "cos": "sin"}
Wave = tuple[int, ...]
# Coefficients of waves are found modulo a prime, in which the imaginary unit is a residue; a wave that is lost to
# chance makes formulas longer at most.
_PRIME = 1_000_000_009
_IMAGINARY = pow(13, (_PRIME - 1) // 4, _PRIME)
_HALF = pow(2, -1, _PRIME)


def readable(ring: exact_field.ExactRing, element: exact_field.Quotient) -> ex.Expression:
    """The element as one quotient, or as a sum over the products of velocities, whichever is shorter."""
    if len(element.numerator) > _MOST_TERMS:
        return exact_field.quotient_tree(ring, element)
    whole = _in_order(joined(exact_field.quotient_tree(ring, element)))
    parts = velocity_parts(ring, element)
    if len(parts) < 2:
        return whole
    apart = ex.add(*(_in_order(joined(exact_field.quotient_tree(ring, part))) for part in parts))
    return min([apart, whole], key=ex.node_count)


def velocity_parts(ring: exact_field.ExactRing, element: exact_field.Quotient) -> list[exact_field.Quotient]:
    """The parts with the same powers of all velocities in the numerator, the highest powers first."""
    places = [index for index, tree in ring.trees.items() if isinstance(tree, ex.Velocity)]
    parts = element.parts(places)
    return [parts[powers] for powers in sorted(parts, key=lambda powers: (-sum(powers), powers))]


def joined(tree: ex.Expression) -> ex.Expression:
    """The tree with sin(u)^k cos(u)^-k as tan(u)^k, and u^k w^k as (u w)^k where the product of the sums is shorter.

    Roots are put together where both radicands are positive on the whole line: the domain stays what it is.
    """
    inner = ex.rebuild(tree, joined)
    if not isinstance(inner, ex.Product):
        return inner
    table: dict[ex.Expression, Fraction] = {}
    for base, exponent in map(_power_of, inner.factors):
        table[base] = table.get(base, Fraction(0)) + exponent
    while found := next(_replacements(table), None):
        left, right, both = found
        table = {both if base == left else base: value for base, value in table.items() if base != right}
    return ex.multiply(*(base**exponent for base, exponent in table.items()))


def _replacements(
    table: Mapping[ex.Expression, Fraction],
) -> Iterator[tuple[ex.Expression, ex.Expression, ex.Expression]]:
    bases = [base for base in table if isinstance(base, ex.Apply | ex.Sum)]
    for (k, one), (j, other) in permutations(enumerate(bases), 2):
        # The product of two sums is the same in both orders.
        both = _both(table, one, other) if k < j or not isinstance(one, ex.Sum) else None
        if both is not None:
            yield one, other, both


def _both(table: Mapping[ex.Expression, Fraction], one: ex.Expression, other: ex.Expression) -> ex.Expression | None:
    """A replacement of both bases, with the exponent of the first; None where no replacement is shorter."""
    match one, other:
        case [ex.Apply(above, argument), ex.Apply(below, same)] if argument == same and (above, below) in _QUOTIENTS:
            fits = table[one] == -table[other] and table[one] > 0
            found: ex.Expression = ex.Apply(_QUOTIENTS[above, below], argument)
        case [ex.Sum(left), ex.Sum(right)] if table[one] == table[other] and len(left) * len(right) <= _MOST_PRODUCTS:
            found = collecting.terms_tree(
                sorted(collecting.expand(one * other), key=lambda term: -sum(exponent for _, exponent in term[0]))
            )
            is_shorter = isinstance(found, ex.Sum) and len(found.terms) < len(left) + len(right) - 1
            fits = is_shorter and (table[one].denominator == 1 or all(map(inequalities.is_positive, (one, other))))
        case _:
            return None
    return found if fits and found not in table else None


def _in_order(tree: ex.Expression) -> ex.Expression:
    """Numbers and symbols of each product first, then functions, then velocities."""
    inner = ex.rebuild(tree, _in_order)
    return ex.multiply(*sorted(inner.factors, key=_place)) if isinstance(inner, ex.Product) else inner


def with_products_in_order(
    tree: ex.Expression,
    constants: Sequence[ex.Symbol],
    momenta: Collection[ex.Symbol] = (),
    kept: Container[ex.Expression] = (),
) -> ex.Expression:
    """Products as people write them: exp(c t), constants as given, coordinates, functions, brackets, velocities.

    Functions and brackets that hold velocities, or momenta, come last. Parts that are `kept` stay as they are.
    """
    places = {symbol: place for place, symbol in enumerate(constants)}

    def place(factor: ex.Expression) -> tuple[int, int]:
        base, _ = _power_of(factor)
        held = [node for node in ex.walk(base) if isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary)]
        moving = any(isinstance(node, ex.Velocity) or node in momenta for node in held)
        if not held:
            return 0, 0
        match base:
            case ex.Apply("exp") if ex.TIME in held:
                return 1, 0
            case ex.Symbol() | ex.Sum() | ex.Power() if all(node in places for node in held):
                return 2, min(places[node] for node in held if isinstance(node, ex.Symbol))
            case ex.Symbol() | ex.Velocity():
                return 6 if moving else 3, 0
        return 7 if moving else 5 if isinstance(base, ex.Sum) else 4, 0

    def ordered(part: ex.Expression) -> ex.Expression:
        inner = part if part in kept else ex.rebuild(part, ordered)
        return ex.multiply(*sorted(inner.factors, key=place)) if isinstance(inner, ex.Product) else inner

    return ordered(tree)


def with_sums_as_in(tree: ex.Expression, models: Sequence[ex.Expression]) -> ex.Expression:
    """The tree with each sum that a model has as the model has it: (u - 1)^2 for (-u + 1)^2 beside u - 1 too."""

    def key_of(node: ex.Sum) -> frozenset[tuple[ex.Expression, int]]:
        return frozenset(Counter(node.terms).items())  # u + u is not u

    sums = {key_of(node): node for node in ex.distinct_nodes(models) if isinstance(node, ex.Sum)}

    def ordered(part: ex.Expression) -> ex.Expression:
        part = ex.rebuild(part, ordered)
        match part:
            case ex.Sum():
                return sums.get(key_of(part), part)
            case ex.Power(ex.Sum(terms) as base, ex.Number(value)) if value % 2 == 0:
                turned = ex.add(*map(ex.negated, terms))
                return ex.Power(sums.get(key_of(turned), base) if isinstance(turned, ex.Sum) else base, part.exponent)
            case _:
                return part

    return ordered(tree) if sums else tree


def with_one_coefficient(tree: ex.Expression, letters: Collection[ex.Expression]) -> ex.Expression:
    """(p^2 + q^2)/(2 m) for p^2/(2 m) + q^2/(2 m): squares with letters in one bracket.

    Beside a sum, other factors of a square go into the bracket too: (A + C) (p^2 + sin(u)^2 q^2).
    """
    groups = dict[ex.Expression, list[ex.Expression]]()
    for term in ex.summands(tree):
        factors = ex.factors_of(term)
        squares = [f for f in factors if isinstance(f, ex.Power) and f.exponent == ex.TWO and ex.holds(f, *letters)]
        sums = [f for f in factors if isinstance(f, ex.Sum)]
        outside = [f for f in factors if f in sums or isinstance(f, ex.Number) or not (sums or f in squares)]
        coefficient = ex.multiply(*outside)
        plain = len(squares) != 1 or isinstance(coefficient, ex.Number) or ex.holds(coefficient, *letters)
        inside = term if plain else ex.multiply(*(f for f in factors if f not in outside))
        groups.setdefault(ex.ONE if plain else coefficient, []).append(inside)
    return ex.add(*(coefficient * ex.add(*parts) for coefficient, parts in groups.items()))


def _power_of(factor: ex.Expression) -> tuple[ex.Expression, Fraction]:
    match factor:
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 or isinstance(base, ex.Sum):
            return base, value
        case _:
            return factor, Fraction(1)


def _place(factor: ex.Expression) -> int:
    base, _ = _power_of(factor)
    return 2 if isinstance(base, ex.Velocity) else 1 if isinstance(base, ex.Apply) else 0


def quotient(
    tree: ex.Expression, budget: exact_field.Budget, symbols: Sequence[ex.Symbol | ex.Velocity] | None = None
) -> ex.Expression:
    """The tree over one denominator, both factored, all relations used; as it is where that is too large.

    `symbols` are its variables in the order used for polynomials; by default those that occur in it.
    """
    try:
        return exact_field.shortest_tree(*_in_ring(tree, budget, symbols))
    except (exact_field.TooLarge, ZeroDivisionError, KeyError, errors.IrreducibleAtoms):
        return tree


def _in_ring(
    tree: ex.Expression, budget: exact_field.Budget, symbols: Sequence[ex.Symbol | ex.Velocity] | None = None
) -> tuple[exact_field.ExactRing, exact_field.Quotient]:
    """The tree as an element of the ring of its formulas."""
    held = dict.fromkeys(node for node in ex.walk(tree) if isinstance(node, ex.Symbol | ex.Velocity))
    symbols = list(held) if symbols is None else symbols
    ring = exact_field.exact_ring([tree], symbols, 0, budget, spare=True, slopes=False)
    return ring, ring.value(tree)


def shorten(
    tree: ex.Expression,
    budget: exact_field.Budget,
    symbols: Sequence[ex.Symbol | ex.Velocity] | None = None,
    cost: Callable[[ex.Expression], int] = ex.node_count,
) -> ex.Expression:
    """The cheapest of the tree as it is, multiplied out, and as one factored quotient."""
    return min((tree, collecting.collect(tree), quotient(tree, budget, symbols)), key=cost)


def collected_inside(tree: ex.Expression, cost: Callable[[ex.Expression], int] = ex.node_count) -> ex.Expression:
    """Every sum collected by itself where that makes it cheaper."""
    tree = ex.rebuild(tree, lambda part: collected_inside(part, cost))
    return min(tree, collecting.collect(tree), key=cost) if isinstance(tree, ex.Sum) else tree


@lru_cache(maxsize=1024)
def tidied(tree: ex.Expression) -> ex.Expression:
    """The tree as one exact quotient, roots and trigonometric functions reduced; as it is where that is too large."""
    try:
        return readable(*_in_ring(tree, exact_field.Budget(work=_WORK)))
    except (exact_field.TooLarge, ZeroDivisionError):
        return tree


def much_shorter(tree: ex.Expression) -> ex.Expression:
    """A long tree, as one that was multiplied out, in the form of `tidied` where that has at most half of the nodes."""
    size = ex.node_count(tree)
    return other if size > bounds.NODES and 2 * ex.node_count(other := tidied(tree)) <= size else tree


# Signs and numbers of a finished formula.


def one_square(tree: ex.Expression) -> ex.Expression:
    """a sin(u)^2 for a - a cos(u)^2 in each sum, a cos(u)^2 for a - a sin(u)^2."""
    tree = ex.rebuild(tree, one_square)
    while (joined := _with_squares_joined(tree)) != tree:
        tree = joined
    return tree


def _with_squares_joined(tree: ex.Expression) -> ex.Expression:
    """One pass of `one_square` over the terms."""
    terms = list(ex.summands(tree))
    places = {term: k for k, term in enumerate(terms)} if len(terms) > 1 else {}
    for term, k in list(places.items()):
        for base, exponent in ex.powers_of(term) if term in places else ():
            if isinstance(base, ex.Apply) and base.function in _CIRCULAR and exponent == 2:
                partner = ex.negated(ex.multiply(*(factor for factor in ex.factors_of(term) if factor != base**2)))
                if partner in places:
                    terms[k] = partner * ex.Apply(_CIRCULAR[base.function], base.argument) ** 2
                    terms[places.pop(partner)] = ex.ZERO
                    del places[term]
                    break
    return ex.add(*terms) if len(places) < len(terms) else tree


def turned(tree: ex.Expression) -> ex.Expression:
    """-(a - b) c as (b - a) c."""
    match tree:
        case ex.Product((ex.Number(value), *rest)) if value < 0:
            place = next((k for k, factor in enumerate(rest) if isinstance(factor, ex.Sum)), None)
            if place is not None:
                return ex.multiply(ex.number(-value), *rest[:place], ex.negated(rest[place]), *rest[place + 1 :])
    return tree


def minus_inside(tree: ex.Expression, others: Sequence[ex.Expression] = ()) -> ex.Expression:
    """Each term -(a - b) c of a sum as (b - a) c, -c/(a - b) as c/(b - a); likewise where more terms are negative.

    Not where a - b is in a term that is not negative, too.
    """
    if isinstance(tree, ex.Sum):
        return ex.add(*(minus_inside(term, [one for one in tree.terms if not is_negative(one)]) for term in tree.terms))
    match tree:
        case ex.Product((ex.Number(value), *factors)) if value < 0:
            for place, factor in enumerate(factors):
                base, exponent = (factor.base, factor.exponent) if isinstance(factor, ex.Power) else (factor, ex.ONE)
                is_kept = any(ex.holds(other, base) for other in others)
                if not isinstance(base, ex.Sum) or is_kept or not _is_half_negative(base):
                    continue
                if isinstance(exponent, ex.Number) and exponent.value % 2 == 1:
                    turned = ex.add(*sorted(map(ex.negate, base.terms), key=is_negative)) ** exponent
                    return ex.multiply(ex.number(-value), *factors[:place], turned, *factors[place + 1 :])
    return tree


def roots_upright(tree: ex.Expression) -> ex.Expression:
    """1/sqrt(-a/(b - c)) as sqrt((c - b)/a): no quotient whose denominator is a sum under a root in a denominator."""
    tree = ex.rebuild(tree, roots_upright)
    match tree:
        case ex.Power(base, ex.Number(e)) if e < 0 and e.denominator > 1:
            powers = ex.powers_of(base)
            if any(isinstance(part, ex.Sum) and k == -1 for part, k in powers):
                negative = any(isinstance(part, ex.Number) and part.value < 0 for part, _ in powers)
                parts = [part if k == -1 else part**-k for part, k in powers]
                if negative:
                    place = next(n for n, (part, k) in enumerate(powers) if isinstance(part, ex.Sum) and k == -1)
                    parts = [ex.negated(part) if n == place else part for n, part in enumerate(parts)]
                    parts.append(ex.number(-1))
                return ex.multiply(*parts) ** -e
    return tree


def numbers_outside(tree: ex.Expression) -> ex.Expression:
    """(x^2/2 + 3 y^2/2)/z as (x^2 + 3 y^2)/(2 z): no denominator in a bracket, no minus that all of its terms have.

    Under an exponent, only a denominator that all terms have is taken out.
    """
    tree = ex.rebuild(tree, numbers_outside)
    if not isinstance(tree, ex.Product):
        return tree
    number, factors = Fraction(1), []
    for base, e in ex.powers_of(tree):
        if isinstance(base, ex.Sum) and e.denominator == 1:
            share = _content(base, is_whole=e == 1)
            base = ex.add(*(share * term for term in base.terms))
            number /= share**e.numerator
        factors.append(base**e)
    return ex.multiply(ex.number(number), *factors)


def plain_quotients(tree: ex.Expression) -> ex.Expression:
    """18 (c u v - u^2/3 - v^2/3)/(c^2 - 16) as 6 (u^2 + v^2 - 3 c u v)/(16 - c^2), and (2 u - 4 v)/6 as (u - 2 v)/3.

    Fractions in a bracket above a line, or that the number in front takes away; minus signs of two brackets at once.
    """
    tree = ex.rebuild(tree, plain_quotients)
    if not isinstance(tree, ex.Product):
        return tree
    number = ex.coefficient(tree)
    powers = ex.powers_of(ex.multiply(*tree.factors[isinstance(tree.factors[0], ex.Number) :]))
    sums = {k: base.terms for k, (base, e) in enumerate(powers) if isinstance(base, ex.Sum) and e % 2 == 1}
    surplus = {k: 2 * sum(map(is_negative, terms)) - len(terms) for k, terms in sums.items()}
    ordered = iter(sorted(sums, key=lambda k: -surplus[k]))
    for one, other in zip(ordered, ordered, strict=False):
        if surplus[one] + surplus[other] > 0:
            sums |= {k: tuple(map(ex.negate, sums[k][::-1])) for k in (one, other)}
    for k, terms in sums.items():
        share = Fraction(math.lcm(*(ex.coefficient(term).denominator for term in terms)) if powers[k][1] == 1 else 1)
        share = share if number.numerator % share == 0 or min(e for _, e in powers) < 0 else Fraction(1)
        below = number.denominator if powers[k][1] == 1 else 1
        share /= math.gcd(below, *((share * ex.coefficient(term)).numerator for term in terms))
        number /= share
        powers[k] = ex.add(*(share * term for term in terms)), powers[k][1]
    return ex.multiply(ex.number(number), *(base**e for base, e in powers))


def _content(tree: ex.Sum, is_whole: bool) -> Fraction:
    """What makes the coefficients integers without a common factor, if they are not; -1 if all are negative."""
    found = [ex.coefficient(term) for term in tree.terms]
    below = math.lcm(*(value.denominator for value in found))
    sign = -1 if all(value < 0 for value in found) else 1
    if below == 1 or not (is_whole or all(value.denominator == below for value in found)):
        return Fraction(sign)
    return Fraction(sign * below, math.gcd(*(value.numerator for value in found)) if is_whole else 1)


def _is_half_negative(tree: ex.Sum) -> bool:
    """Whether most of its terms have a minus sign, or half of them and no number is without one, as it is in 1 - mu."""
    surplus = 2 * sum(map(is_negative, tree.terms)) - len(tree.terms)
    return surplus > 0 or (surplus == 0 and not any(isinstance(t, ex.Number) and t.value > 0 for t in tree.terms))


def is_negative(term: ex.Expression) -> bool:
    return ex.coefficient(term) < 0


def by_short_angles(
    trees: Sequence[ex.Expression], ring: exact_field.ExactRing, elements: Iterable[exact_field.Quotient]
) -> list[ex.Expression] | None:
    """The trees in the angles that make the elements short; None where the angles of the ring do.

    `ring` holds the trees.
    """
    found = (_angle_of(tree, ("cos",)) for tree in ring.trees.values())
    angles = [angle for angle in found if angle is not None]
    units = [tuple(int(k == j) for j in range(len(angles))) for k in range(len(angles))]
    sums = [tuple(map(of, *pair)) for pair in combinations(units, 2) for of in (add, sub)]
    basis, old, waves = list(angles), units, list(_waves_of(ring, angles, elements))
    while (best := _shorter(waves, waves) or _shorter(waves, sums)) is not None:
        place, wave = best
        turned = [(one, _sum(one, basis)) for one in (wave, _opposite(wave))]
        wave, basis[place] = min(turned, key=lambda one: printing.to_text(one[1]).count("-"))
        waves, old = _exchanged(waves, place, wave), _exchanged(old, place, wave)
    if basis == angles:
        return None
    table = {
        ex.Apply(name, angle): value
        for angle, turns in zip(angles, old, strict=True)
        for name, value in zip(("sin", "cos"), _sine_and_cosine(turns, basis), strict=True)
    }
    held = {
        node: ex.substitute(exact_field.quotient_tree(ring, value), table)
        for node, value in ring.atoms.items()
        if _angle_of(node, exact_field.TRIGONOMETRIC) is not None
    }
    return [ex.substitute(tree, held) for tree in trees]


def _angle_of(tree: ex.Expression, functions: Container[str]) -> ex.Expression | None:
    """The argument of one of the functions, if it is an angle without functions."""
    match tree:
        case ex.Apply(name, angle) if name in functions and not ex.has(angle, ex.Apply | ex.Arbitrary | ex.Power):
            return angle
    return None


def _size(waves: Iterable[Wave]) -> tuple[int, int]:
    """How many monomials the waves take, and how many the product of each with itself."""
    sizes = [math.prod(abs(turns) + 1 for turns in wave) for wave in waves]
    return sum(sizes), sum(size**2 for size in sizes)


def _shorter(waves: Sequence[Wave], choices: Iterable[Wave]) -> tuple[int, Wave] | None:
    """The best of the choices in the place of a vector of the basis; None where no exchange makes the waves shorter."""
    sizes = {
        (place, wave): _size(_exchanged(waves, place, wave))
        for wave in choices
        for place, turns in enumerate(wave)
        if abs(turns) == 1
    }
    best = min(sizes, key=lambda one: sizes[one], default=None)
    return best if best is not None and sizes[best] < _size(waves) else None


def _sum(wave: Wave, angles: Sequence[ex.Expression]) -> ex.Expression:
    return collecting.collect(ex.add(*(turns * angle for turns, angle in zip(wave, angles, strict=True))))


def _opposite(wave: Wave) -> Wave:
    return tuple(-turns for turns in wave)


def _exchanged(waves: Sequence[Wave], place: int, new: Wave) -> list[Wave]:
    """The waves with `new`, which has +-1 there, in the place of a vector of the basis."""
    found = []
    for wave in waves:
        of_new = wave[place] * new[place]
        rest = [turns - of_new * other for turns, other in zip(wave, new, strict=True)]
        found.append((*rest[:place], of_new, *rest[place + 1 :]))
    return found


def _waves_of(
    ring: exact_field.ExactRing, angles: Sequence[ex.Expression], elements: Iterable[exact_field.Quotient]
) -> set[Wave]:
    """The waves of the numerators, each of a pair of opposite ones, at random values of all other generators."""
    places = {tree: index for index, tree in ring.trees.items()}
    pairs = [(places[ex.Apply("sin", angle)], places[ex.Apply("cos", angle)]) for angle in angles]
    circular, drawn = {index for pair in pairs for index in pair}, random.Random(1)
    values = {index: drawn.randrange(1, _PRIME) for index in ring.trees if index not in circular}
    found = set[Wave]()
    for element in elements:
        total = dict[Wave, int]()
        for exponents, coefficient in element.numerator.terms():
            value = int(coefficient.p) * pow(int(coefficient.q), -1, _PRIME)
            for index, drawn_value in values.items():
                value = value * pow(drawn_value, int(exponents[index]), _PRIME) % _PRIME
            waves: dict[Wave, int] = {(): value}
            for sine, cosine in pairs:
                waves = {
                    (*wave, turns): a * b % _PRIME
                    for wave, a in waves.items()
                    for turns, b in _powers(int(exponents[sine]), int(exponents[cosine])).items()
                }
            for wave, a in waves.items():
                total[wave] = (total.get(wave, 0) + a) % _PRIME
        found |= {max(wave, _opposite(wave)) for wave, a in total.items() if a and any(wave)}
    return found


def _powers(sine: int, cosine: int) -> dict[int, int]:
    """The waves of sin^sine cos^cosine of one angle."""
    found = {0: 1}
    for sign, scale in [(-1, _HALF * -_IMAGINARY)] * sine + [(1, _HALF)] * cosine:
        more = dict[int, int]()
        for turns, a in found.items():
            more[turns + 1] = (more.get(turns + 1, 0) + a * scale) % _PRIME
            more[turns - 1] = (more.get(turns - 1, 0) + sign * a * scale) % _PRIME
        found = more
    return found


def _sine_and_cosine(turns: Wave, angles: Sequence[ex.Expression]) -> tuple[ex.Expression, ex.Expression]:
    """Of a sum of angles, by the addition theorems."""
    sine: ex.Expression = ex.ZERO
    cosine: ex.Expression = ex.ONE
    for count, angle in zip(turns, angles, strict=True):
        s, c = ex.Apply("sin", angle), ex.Apply("cos", angle)
        for _ in range(abs(count)):
            step = s if count > 0 else ex.negated(s)
            sine, cosine = sine * c + cosine * step, cosine * c - sine * step
    return sine, cosine
