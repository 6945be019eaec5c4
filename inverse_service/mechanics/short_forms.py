"""Short forms of trees: collected, as one factored quotient, or as sums of squares, whichever is smaller.

Sums in some variables (velocities, momenta) are written with squares of linear forms and powers of quadratic forms.
v^T G v/2 = sum c_a (linear form)_a^2, one variable after another: with a v^2 + b v + r, b linear in the others,
a (v + b/(2 a))^2 + r - b^2/(4 a). Where a = c s^2 with a monomial s, c (s v + b/(2 c s))^2 needs no division by s.
A part that is homogeneous of a degree above two is factored: (x'^2 + y'^2)^2.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import islice, permutations, product
from math import isqrt
from operator import itemgetter

from flint import fmpq, fmpq_mpoly_ctx

from inverse_service import bounds, deadline
from inverse_service.expressions import collecting, tree as ex
from inverse_service.expressions.collecting import Monomial, Term, expand, terms_tree
from inverse_service.field import exact_field
from inverse_service.mechanics import writing

# Terms met on the way (`Budget`) in exact work on one tree.
_WORK = 20_000
_INVERSE = {("atan", "tan"), ("log", "exp"), ("exp", "log"), ("asin", "sin"), ("acos", "cos"), ("atanh", "tanh")}
Expression = ex.Expression
Terms = dict[Monomial, Fraction]
Power = tuple[Expression, Fraction]
# A 1 that makes a polynomial homogeneous, by a name that no formula can hold.
_UNIT = ex.Symbol("a unit")
# Orders of the variables that are tried, and terms of a part that is factored.
_MOST_ORDERS, _MOST_TERMS = 24, 60


def velocities_in(tree: ex.Expression, names: Collection[str]) -> set[str]:
    """The coordinates among `names` whose velocities occur."""
    return {node.coordinate for node in ex.walk(tree) if isinstance(node, ex.Velocity) and node.coordinate in names}


def separated(tree: ex.Expression) -> ex.Expression:
    """The tree expanded, exponentials as powers of atoms so that quotients of them cancel."""
    return ex.add(*(value * collecting.separate_tree(monomial) for monomial, value in collecting.expand(tree)))


@lru_cache(maxsize=512)
def quotient(tree: ex.Expression) -> ex.Expression:
    """The tree as one factored quotient of polynomials in atoms; as it is where that is too large."""
    plain = separated(tree)
    if ex.node_count(plain) > bounds.TERMS:
        return tree
    try:
        ring = exact_field.opaque_ring([plain], exact_field.Budget(bounds.TERMS))
        return collecting.merge_powers(exact_field.quotient_tree(ring, ring.value(plain)))
    except (ZeroDivisionError, exact_field.TooLarge):
        return tree


def shortest(forms: Sequence[ex.Expression]) -> ex.Expression:
    """The smallest of some equal trees; of those of the same size the first with the fewest terms."""
    return min(forms, key=lambda form: (ex.node_count(form), len(form.terms) if isinstance(form, ex.Sum) else 1))


@lru_cache(maxsize=512)
def simplified(tree: ex.Expression) -> ex.Expression:
    """The shortest of: the tree as it is, collected, as one quotient; with sin^2 = 1 - cos^2 where both occur."""
    collected, merged = collecting.collect(tree), collecting.merge_powers(tree)
    forms = [collected, merged]
    if _is_monomial(collected):  # as momenta and energies of many masses are
        return shortest(forms)
    forms += [quotient(collected), *([quotient(merged)] if ex.node_count(merged) < ex.node_count(collected) else [])]
    for other in _without_squares(collected):
        forms += [collecting.collect(other), quotient(other)]
    return shortest(forms)


def related(tree: ex.Expression) -> ex.Expression:
    """A long tree as one quotient, with the relations among its roots and functions used, where that is shorter."""
    return tree if ex.node_count(tree) <= bounds.NODES else shortest([tree, exact_quotient(tree)])


def exact_quotient(tree: ex.Expression) -> ex.Expression:
    """The tree as one factored quotient in which all relations are used; as it is where that is too large."""
    return writing.quotient(tree, exact_field.Budget(bounds.EXPANSION, deadline.end(), _WORK))


def exponentials_above(tree: ex.Expression) -> ex.Expression:
    """exp(-u) for 1/exp(u)."""
    match ex.rebuild(tree, exponentials_above):
        case ex.Power(ex.Apply("exp", argument), ex.Number(value)) if value < 0:
            return ex.Apply("exp", value * argument)
        case ex.Power(ex.Product(factors), ex.Number(value)) if value.denominator == 1:
            return ex.multiply(*(exponentials_above(factor**value) for factor in factors))
        case other:
            return other


def inside(tree: ex.Expression) -> ex.Expression:
    """The tree with each sum that a function is taken of as one quotient, where that is shorter."""
    match ex.rebuild(tree, inside):
        case ex.Apply(function, ex.Sum() as argument):
            return ex.Apply(function, shortest([argument, writing.turned(quotient(argument))]))
        case other:
            return other


def _is_monomial(tree: ex.Expression) -> bool:
    factors = ex.factors_of(tree)
    bases = (factor.base if isinstance(factor, ex.Power) else factor for factor in factors)
    return all(isinstance(base, ex.Number | ex.Symbol | ex.Velocity) for base in bases)


def trigonometric(tree: ex.Expression) -> ex.Expression:
    """The tree, or the shortest form of it with sin^2 = 1 - cos^2 where both occur."""
    return shortest([tree, *(quotient(other) for other in _without_squares(tree))])


def with_cosines(tree: ex.Expression) -> ex.Expression:
    """The tree with 1/cos^2 for 1 + tan^2."""
    match ex.rebuild(tree, with_cosines):
        case ex.Sum((ex.Power(ex.Apply("tan", u), ex.TWO), ex.ONE) | (ex.ONE, ex.Power(ex.Apply("tan", u), ex.TWO))):
            return ex.Apply("cos", u) ** -2
        case inner:
            return inner


def _without_squares(tree: ex.Expression) -> Iterator[ex.Expression]:
    """The tree with the squares of sines, and with those of cosines, written by the other function."""
    nodes = {node for node in ex.walk(tree) if isinstance(node, ex.Apply)}
    for function, other in (("sin", "cos"), ("cos", "sin")):
        both = {n.argument for n in nodes if n.function == function and ex.Apply(other, n.argument) in nodes}
        if both:
            yield _squares_replaced(tree, function, other, both)


def _squares_replaced(tree: ex.Expression, function: str, other: str, both: Collection[ex.Expression]) -> ex.Expression:
    known: dict[ex.Expression, ex.Expression] = {}  # parts that occur often are replaced once

    def replaced(part: ex.Expression) -> ex.Expression:
        if part not in known:
            deadline.check(0)
            known[part] = ex.rebuild(part, replaced)
            match known[part]:
                case ex.Power(ex.Apply(name, argument), ex.Number(value)) if name == function and argument in both:
                    whole = value.numerator // 2 if value.denominator == 1 and value > 1 else 0
                    square = 1 - ex.Apply(other, argument) ** 2
                    known[part] = square**whole * ex.Apply(name, argument) ** (value - 2 * whole)
        return known[part]

    return replaced(tree)


def roots_apart(tree: ex.Expression) -> ex.Expression:
    """The tree with (u w)^r = u^r w^r and (u^a)^r = u^(a r), which is wrong where a factor is negative."""
    apart = _apart(tree)
    return tree if apart == tree else simplified(apart)


def _apart(tree: ex.Expression) -> ex.Expression:
    match ex.rebuild(tree, _apart):
        case ex.Power(ex.Product(factors), exponent) as inner if not exact_field.is_integer_power(inner):
            return ex.multiply(*(_apart(factor**exponent) for factor in factors))
        case ex.Power(ex.Power(base, ex.Number(value)), ex.Number(exponent)):
            return base ** (value * exponent)
        case inner:
            return inner


def cancelled(sign: int, tree: ex.Expression) -> ex.Expression:
    """The tree with sqrt(u^2) = sign u, atan(tan u) = u and log(exp u) = u, which hold on one branch only; shorter."""
    found = _cancelled(tree, sign)
    return tree if found == tree else simplified(found)


def _cancelled(tree: ex.Expression, sign: int) -> ex.Expression:
    inner = ex.rebuild(tree, lambda part: _cancelled(part, sign))
    match inner:
        case ex.Apply(outer, ex.Apply(function, argument)) if (outer, function) in _INVERSE:
            return argument
        case ex.Power(ex.Product(factors), ex.Number(e)) if e.denominator == 1:
            return ex.multiply(*(factor**e for factor in factors))
        case ex.Power(ex.Product(factors), ex.Number(e)) if e.denominator == 2:
            roots = [_root_of_square(factor) for factor in factors]
            rest = ex.multiply(*(factor for factor, root in zip(factors, roots, strict=True) if root is None))
            whole = ex.multiply(ex.number(sign), *(root for root in roots if root is not None))
            return whole**e.numerator * rest**e if any(roots) else inner
        case ex.Power(ex.Power() as square, ex.Number(e)) if e.denominator == 2 and (root := _root_of_square(square)):
            return (sign * root) ** e.numerator
        case ex.Power(ex.Sum() as base, ex.Number(e)) if e.denominator == 2 and not isinstance(
            short := quotient(writing.one_square(base)), ex.Sum
        ):
            return _cancelled(short**e, sign)
        case _:
            return inner


def _root_of_square(factor: ex.Expression) -> ex.Expression | None:
    """u^k for u^(2 k), and the root of the square of a rational number; else None."""
    match factor:
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 and value % 2 == 0:
            return base ** (value / 2)
        case ex.Number(value) if value > 0:
            root = Fraction(isqrt(value.numerator), isqrt(value.denominator))
            return ex.number(root) if root**2 == value else None
    return None


def sign_part(tree: ex.Expression) -> ex.Expression:
    """A short tree with the sign of this one, wherever it is not zero."""
    short = quotient(collecting.collect(tree))
    signs = [_sign_factor(factor) for factor in ex.factors_of(short)]
    product = ex.multiply(*signs)
    match product:
        case ex.Product((ex.Number(value), ex.Sum(terms))) if value < 0:
            return ex.add(*map(ex.negate, terms))
        case _:
            return shortest([collecting.collect(product), product])


def _sign_factor(factor: ex.Expression) -> ex.Expression:
    match factor:
        case ex.Number(value) if value:
            return ex.ONE if value > 0 else ex.MINUS_ONE
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return base if value % 2 else ex.ONE
        case ex.Power(_, ex.Number()) | ex.Apply("exp", _):
            return ex.ONE
        case _:
            return factor


def short_forms(tree: Expression, letters: Collection[Expression]) -> Iterator[Expression]:
    """The tree with its quadratic part in `letters` as sums of squares, or its parts of higher degree as powers.

    Terms that are not polynomial in `letters` are unchanged. A long quadratic part has no squares.
    """
    yield _over_shared_sums(tree, letters)
    parts: dict[int, Terms] = {}
    rest: list[Expression] = []
    for term in ex.summands(tree):
        found = {_degree(monomial, letters) for monomial, _ in expand(term)}
        if None in found or found <= {0, 1}:
            rest.append(term)
            continue
        for monomial, value in expand(term):
            table = parts.setdefault(_degree(monomial, letters) or 0, {})
            table[monomial] = table.get(monomial, Fraction(0)) + value
    quadratic = {key: value for key, value in parts.pop(2, {}).items() if value}
    if len(quadratic) > bounds.SMALL:
        return
    higher = [
        min(as_power([*part.items()]), ex.add(*_by_pairs(part, list(letters), d)), key=ex.node_count)
        for d, some in parts.items()
        if (part := {key: value for key, value in some.items() if value})
    ]
    own = [v for v in letters if any(v in dict(key) for key in quadratic)]
    mixed = [v for v in own if any(dict(key).get(v) == 1 for key in quadratic)]
    whole, apart = ([*_grouped(quadratic, with_divisors).values()] for with_divisors in (False, True))
    for groups in [whole, *([apart] if len(whole) < len(apart) else [])]:
        yield ex.add(*(part for group in groups for part in _by_pairs(group, own, 2)), *higher, *rest)
        for order in islice(permutations(mixed), _MOST_ORDERS if mixed else 0):
            squares = [square for group in groups for square in _squares(group, order)]
            yield ex.add(*squares, *higher, *rest)


@lru_cache(maxsize=1024)
def sums_of_squares(tree: Expression, letters: tuple[Expression, ...]) -> tuple[Expression, ...]:
    """Those forms in which what takes the place of terms of the tree has one sign: -k (a - b)^2/2, as of springs.

    x^2 + 4 x y + y^2 has no such form: (x + 2 y)^2 - 3 y^2 is a difference. x^2 - 2 x + 1 is (x - 1)^2.
    """
    kept, terms = ex.summands(tree), expand(tree)
    found, degrees = [*short_forms(tree, letters)], [_degree(monomial, letters) for monomial, _ in terms]
    if set(degrees) == {0, 1, 2}:
        parts = (terms_tree([term]) * _UNIT ** (2 - (d or 0)) for term, d in zip(terms, degrees, strict=True))
        found += [ex.substitute(form, {_UNIT: ex.ONE}) for form in short_forms(ex.add(*parts), [*letters, _UNIT])]

    def has_one_sign(form: Expression) -> bool:
        new = [term for term in ex.summands(form) if term not in kept]
        even = [term for term in new if all(e % 2 == 0 for p, e in ex.powers_of(term) if isinstance(p, ex.Sum))]
        return len({ex.coefficient(term) < 0 for term in even}) <= 1

    return tuple(filter(has_one_sign, found))


def _over_shared_sums(tree: Expression, letters: Collection[Expression]) -> Expression:
    """Terms with `letters`, and sums that they share taken out where these vary: (x^2 + y^2) (x'^2 + y'^2)/2."""
    groups: dict[frozenset[Power], list[list[Power]]] = {}
    for term in ex.summands(tree):
        powers = ex.powers_of(term)
        shared: list[Power] = [
            (p, e) for p, e in powers if isinstance(p, ex.Sum | ex.Apply) and not ex.holds(p, *letters)
        ]
        # Sums of masses have no functions and no powers, and stay with their velocities.
        varies = any(isinstance(node, ex.Apply | ex.Power) for p, _ in shared for node in ex.walk(p))
        key = frozenset(shared) if varies and ex.holds(term, *letters) else frozenset()
        groups.setdefault(key, []).append(powers)
    found = []
    for key, terms in groups.items():
        common = [power for power in terms[0] if key and all(power in term for term in terms)]
        rest = [ex.multiply(*(p**e for p, e in term if (p, e) not in common)) for term in terms]
        found.append(ex.multiply(*(p**e for p, e in common), ex.add(*rest)))
    return ex.add(*found)


def power_of_form(tree: Expression) -> tuple[Expression, int] | None:
    """(P, k) with tree a constant times P^k, k > 1; None where it is no such power."""
    found = _factors(expand(tree))
    several = [(factor, k) for factor, k in found if k > 1] if found else []
    return several[0] if len(several) == 1 else None


def _degree(monomial: Monomial, letters: Collection[Expression]) -> int | None:
    """The degree in `letters`; None where one of them occurs other than as a factor."""
    total = Fraction(0)
    for base, exponent in monomial:
        if base in letters:
            total += exponent
        elif ex.holds(base, *letters):
            return None
    return int(total) if total.denominator == 1 and total >= 0 else None


def _grouped(terms: Terms, with_divisors: bool) -> dict[Monomial, Terms]:
    """The terms by their exponentials, which no form divides or multiplies, and by their divisors."""
    groups: dict[Monomial, Terms] = {}
    for monomial, value in terms.items():
        outer = tuple((p, e) for p, e in monomial
                      if ex.is_exponential(p) or (with_divisors and e < 0 and isinstance(p, ex.Sum)))  # fmt: skip
        groups.setdefault(outer, {})[monomial] = value
    return groups


def _times(left: Monomial, right: Monomial, power: int = 1) -> Monomial:
    table = dict(left)
    for base, exponent in right:
        table[base] = table.get(base, Fraction(0)) + power * exponent
    return tuple(sorted(((b, e) for b, e in table.items() if e), key=lambda item: repr(item[0])))


def _squares(terms: Terms, order: Sequence[Expression]) -> list[Expression]:
    """The quadratic form as a sum of squares as far as the coefficients of squares are single monomials."""
    left, found = dict(terms), list[Expression]()
    for v in order:
        square = {key: value for key, value in left.items() if dict(key).get(v) == 2}
        cross = {key: value for key, value in left.items() if dict(key).get(v) == 1}
        if len(square) != 1 or not cross:
            continue
        ((key, value),) = square.items()
        outside = _times(key, ((v, Fraction(2)),), -1)
        half = {_times(k, ((v, Fraction(1)),), -1): c / (2 * value) for k, c in cross.items()}
        # value rest (root v + half/(rest root))^2, else with the root 1
        root, rest = _split_square(outside)
        if any(e < 0 for k in half for _, e in _times(k, _times(rest, root), -1)):
            root, rest = (), outside
        form = {_times(root, ((v, Fraction(1)),)): Fraction(1)}
        form |= {_times(k, _times(rest, root), -1): c for k, c in half.items()}
        found.append(ex.multiply(ex.number(value), terms_tree([(rest, Fraction(1))]), terms_tree(form.items()) ** 2))
        remaining = dict(expand(terms_tree(left.items()) - found[-1]))
        left = {k: remaining[k] for k in dict.fromkeys([*left, *remaining]) if k in remaining}  # in their order
    return [*found, terms_tree(left.items())]


def _by_pairs(terms: Terms, letters: Sequence[Expression], degree: int) -> list[Expression]:
    """All mixed terms in two of the letters as a power of their sum or difference: k ((x - y)^4 + (y - z)^4)/4."""
    left = {_times(key, ()): value for key, value in terms.items()}
    powers = dict[tuple[Monomial, Fraction], list[Expression]]()
    for key, value in list(left.items()):
        pair = [v for v in letters if v in dict(key)]
        if not 2 <= degree <= bounds.POWER or len(pair) != 2 or dict(key)[pair[1]] != 1 or key not in left:
            continue
        v, w = pair
        outside = tuple(item for item in key if item[0] not in pair)
        for sign in (1, -1):
            c = sign * value / degree
            binomial = {
                _times(outside, ((v, Fraction(degree - k)), (w, Fraction(k)))): c * math.comb(degree, k) * sign**k
                for k in range(degree + 1)
            }
            own = left.get(_times(outside, ((v, Fraction(degree)),)), Fraction(0))
            if (degree > 2 or own * c > 0) and all(left.get(one) == binomial[one] for one in [*binomial][1:-1]):
                powers.setdefault((outside, c), []).append((v + sign * w) ** degree)
                left = {k: left.get(k, Fraction(0)) - binomial.get(k, Fraction(0)) for k in {**left, **binomial}}
                left = {k: value for k, value in left.items() if value}
                break
    for (outside, c), some in powers.items():
        for v in letters:
            if left.get(key := _times(outside, ((v, Fraction(degree)),))) == c:
                some.append(v**degree)
                del left[key]
    found = [c * terms_tree([(outside, Fraction(1))]) * ex.add(*some) for (outside, c), some in powers.items()]
    return [*found, terms_tree(left.items())]


def _split_square(monomial: Monomial) -> tuple[Monomial, Monomial]:
    """(s, r) with monomial = s^2 r, s with integer exponents."""
    root = tuple((base, Fraction(int(e) // 2)) for base, e in monomial if e.denominator == 1 and e >= 2)
    return root, _times(monomial, root, -2)


def as_power(terms: Sequence[Term]) -> Expression:
    """The sum with factors as powers, where one that is a sum is repeated: (1 + k/sqrt(u))^4."""
    found = _factors(terms) if len(terms) <= _MOST_TERMS else None
    plain = terms_tree(terms)
    if not found or not any(k > 1 and isinstance(factor, ex.Sum) for factor, k in found):
        return plain
    product = ex.multiply(*(factor**k for factor, k in found))
    first = expand(product)
    ratio = dict(terms).get(first[0][0], Fraction(0)) / first[0][1]
    return ratio * product if dict(expand(ratio * product)) == dict(terms) else plain


def _factors(terms: Sequence[Term]) -> list[tuple[Expression, int]] | None:
    """The squarefree factors of a polynomial in powers of its letters, 1/sqrt(u) of u, each with its multiplicity."""
    exponents: dict[Expression, list[Fraction]] = {}
    for place, (monomial, _) in enumerate(terms):
        for base, e in monomial:
            exponents.setdefault(base, [Fraction(0)] * len(terms))[place] = e
    if not exponents:
        return None
    steps = [Fraction(1, math.lcm(*(e.denominator for e in own))) for own in exponents.values()]
    turns = [-1 if max(own) <= 0 else 1 for own in exponents.values()]
    if any(turn * e < 0 for own, turn in zip(exponents.values(), turns, strict=True) for e in own):
        return None
    units = [(base, turn * step) for base, turn, step in zip(exponents, turns, steps, strict=True)]
    context = fmpq_mpoly_ctx.get(tuple(f"a{k}" for k in range(len(units))))
    rows = zip(*exponents.values(), strict=True)
    table = {
        tuple(int(e / unit) for e, (_, unit) in zip(row, units, strict=True)): fmpq(c.numerator, c.denominator)
        for row, (_, c) in zip(rows, terms, strict=True)
    }
    _, factors = context.from_dict(table).factor_squarefree()
    found = []
    for factor, k in factors:
        parts = [
            (
                tuple((base, int(e) * unit) for (base, unit), e in zip(units, powers, strict=True) if e),
                exact_field.as_fraction(value),
            )
            for powers, value in factor.to_dict().items()
        ]
        found.append((terms_tree(parts), int(k)))
    return found


def _by_constants(tree: Expression, letters: Collection[Expression], others: Collection[Expression]) -> Expression:
    groups, rest = dict[Monomial, Terms](), [term for term in ex.summands(tree) if not ex.holds(term, *letters)]
    for monomial, value in expand(ex.add(*(term for term in ex.summands(tree) if term not in rest))):
        constants = tuple((p, e) for p, e in monomial if isinstance(p, ex.Symbol) and p not in (*letters, *others))
        groups.setdefault(constants, {})[_times(monomial, constants, -1)] = value
    found = list[Expression]()
    for key, terms in groups.items():
        outside = terms_tree([(key, Fraction(1))])
        inner = terms_tree(expand(writing.one_square(terms_tree(terms.items()))))
        short = min([inner, *short_forms(inner, letters)], key=ex.node_count)
        found += [outside * term for term in ex.summands(short)]
    return ex.add(*found, *rest)


def proper_quotients(tree: Expression, letters: Collection[Expression], others: Collection[Expression]) -> Expression:
    """c v w + r v w/D for (c D + r) v w/D where r has fewer terms; v and w are letters, c holds none and no others."""
    groups, found = dict[Monomial, list[Term]](), list[Expression]()
    for monomial, value in expand(tree):
        outer = tuple(item for item in monomial if item[0] in letters or isinstance(item[0], ex.Sum))
        groups.setdefault(outer, []).append((_times(monomial, outer, -1), value))
    for outer, inner in groups.items():
        divisors = [p for p, e in outer if e == -1 and isinstance(p, ex.Sum)] if _degree(outer, letters) == 2 else []
        forms: list[tuple[int, Expression, Monomial, Sequence[Term]]] = [(len(inner), ex.ZERO, outer, inner)]
        for divisor in divisors:
            ratios = [(_times(key, other, -1), a / b) for (key, a), (other, b) in product(inner, expand(divisor))]
            fixed = [(key, c) for key, c in ratios if not any(ex.holds(p, *letters, *others) for p, _ in key)]
            for c in dict.fromkeys(terms_tree([one]) for one in fixed):
                rest = expand(terms_tree(inner) - c * divisor)
                forms.append((len(rest), c, _times(outer, ((divisor, Fraction(1)),)), rest))
        _, c, proper, left = min(forms, key=itemgetter(0))
        found += [c * terms_tree([(proper, Fraction(1))]), terms_tree(left) * terms_tree([(outer, Fraction(1))])]
    return ex.add(*found)


def shortest_form(tree: Expression, letters: Collection[Expression], others: Collection[Expression] = ()) -> Expression:
    """The tree itself, or the shortest of its forms where one is shorter.

    One of them has outside what all terms with `letters` share, and inside squares of sums in `others`:
    (x^2 + y^2 + 1) (p^2 + q^2 + (x p + y q)^2)/2. In another, the terms with one product of constants are squares:
    (cos(u) p + sin(u) q)^2/(2 A) + (cos(u) q - sin(u) p)^2/(2 B).
    """
    forms = [tree, *short_forms(tree, letters), _by_constants(tree, letters, others)]
    forms += short_forms(proper_quotients(tree, letters, others), letters)
    terms = [term for term in ex.summands(tree) if ex.holds(term, *letters)]
    powers = [ex.powers_of(term) for term in terms]
    sums = dict.fromkeys((p, e) for term in powers for p, e in term if isinstance(p, ex.Sum))
    common = [power for power in sums if len(terms) > 1 and all(power in term for term in powers)]
    if common:
        parts = (ex.multiply(*(p**e for p, e in term if (p, e) not in common)) for term in powers)
        inner = terms_tree(expand(ex.add(*parts)))
        short = min([inner, *short_forms(inner, letters), *sums_of_squares(inner, tuple(others))], key=ex.node_count)
        rest = (term for term in ex.summands(tree) if term not in terms)
        whole = writing.numbers_outside(ex.multiply(*(p**e for p, e in common), short))
        forms.append(ex.add(whole, *rest))
    return min(forms, key=ex.node_count)
