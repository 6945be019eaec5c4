"""Sums in some letters (velocities, momenta), written with squares of linear forms and powers of
forms: every function returns an equal tree, a shorter one where it finds one.

v^T G v/2 = sum c_a (linear form)_a^2, one variable after another: with a v^2 + b v + r, b linear in
the others, a (v + b/(2 a))^2 + r - b^2/(4 a). Where a = c s^2 with a monomial s,
c (s v + b/(2 c s))^2 needs no division by s. A part that is homogeneous of a degree above two is
factored: (x'^2 + y'^2)^2.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import islice, permutations, product
from operator import itemgetter

from flint import fmpq, fmpq_mpoly_ctx

from inverse_service import bounds
from inverse_service.expressions import collecting, polynomials, terms as tm, tree as ex
from inverse_service.mechanics import writing

Power = tuple[ex.Expression, Fraction]
# Orders of the variables that are tried, and terms of a part that is factored.
_MOST_ORDERS, _MOST_FACTORED = 24, 60
# A 1 that makes a polynomial homogeneous, by a name that no formula can hold.
_UNIT = ex.Symbol("a unit")


def short_forms(tree: ex.Expression, letters: Collection[ex.Expression]) -> Iterator[ex.Expression]:
    """The tree with its quadratic part in `letters` as sums of squares, or its parts of higher
    degree as powers.

    Terms that are not polynomial in `letters` are unchanged. A long quadratic part has no squares.
    """
    yield _over_shared_sums(tree, letters)
    parts: dict[int, tm.Terms] = {}
    rest: list[ex.Expression] = []
    for term in ex.summands(tree):
        found = {_degree(monomial, letters) for monomial, _ in collecting.expand(term)}
        if None in found or found <= {0, 1}:
            rest.append(term)
            continue
        for monomial, value in collecting.expand(term):
            table = parts.setdefault(_degree(monomial, letters) or 0, {})
            table[monomial] = table.get(monomial, Fraction(0)) + value
    quadratic = {key: value for key, value in parts.pop(2, {}).items() if value}
    if len(quadratic) > bounds.SMALL:
        return
    higher = [
        min(
            as_power([*part.items()]), ex.add(*_by_pairs(part, list(letters), d)), key=ex.node_count
        )
        for d, some in parts.items()
        if (part := {key: value for key, value in some.items() if value})
    ]
    own = [v for v in letters if any(v in dict(key) for key in quadratic)]
    mixed = [v for v in own if any(dict(key).get(v) == 1 for key in quadratic)]
    whole, apart = (
        [*_grouped(quadratic, with_divisors).values()] for with_divisors in (False, True)
    )
    for groups in [whole, *([apart] if len(whole) < len(apart) else [])]:
        yield ex.add(
            *(part for group in groups for part in _by_pairs(group, own, 2)), *higher, *rest
        )
        for order in islice(permutations(mixed), _MOST_ORDERS if mixed else 0):
            squares = [square for group in groups for square in _squares(group, order)]
            yield ex.add(*squares, *higher, *rest)
            if _are_apart(squares, order):
                break


def _are_apart(squares: Sequence[ex.Expression], letters: Sequence[ex.Expression]) -> bool:
    """Whether these are squares of sums of letters with the factors 1 and -1, each letter in one:
    then another order of the letters only changes signs.
    """
    met = set[ex.Expression]()
    for square in (one for one in squares if one != ex.ZERO):
        powers = ex.powers_of(square)
        sums = [base for base, e in powers if isinstance(base, ex.Sum) and e == 2]
        if len(sums) != 1 or ex.holds(
            ex.multiply(*(b for b, _ in powers if b != sums[0])), *letters
        ):
            return False
        own = {one for term in ex.summands(sums[0]) for one in (term, ex.negate(term))}
        if len(own.intersection(letters)) < len(ex.summands(sums[0])) or not met.isdisjoint(own):
            return False
        met |= own
    return True


def sums_of_squares(
    tree: ex.Expression, letters: tuple[ex.Expression, ...]
) -> tuple[ex.Expression, ...]:
    """Those forms in which what takes the place of terms of the tree has one sign: -k (a - b)^2/2,
    as of springs.

    x^2 + 4 x y + y^2 has no such form: (x + 2 y)^2 - 3 y^2 is a difference. x^2 - 2 x + 1 is (x -
    1)^2.
    """
    held = set(ex.distinct_nodes([tree]))
    return _sums_of_squares(tree, tuple(letter for letter in letters if letter in held))


@lru_cache(maxsize=1024)
def _sums_of_squares(
    tree: ex.Expression, letters: tuple[ex.Expression, ...]
) -> tuple[ex.Expression, ...]:
    """The same for letters that occur in the tree."""
    kept, terms = ex.summands(tree), collecting.expand(tree)
    found, degrees = (
        [*short_forms(tree, letters)],
        [_degree(monomial, letters) for monomial, _ in terms],
    )
    if set(degrees) == {0, 1, 2}:
        parts = (
            collecting.terms_tree([term]) * _UNIT ** (2 - (d or 0))
            for term, d in zip(terms, degrees, strict=True)
        )
        found += [
            ex.substitute(form, {_UNIT: ex.ONE})
            for form in short_forms(ex.add(*parts), [*letters, _UNIT])
        ]

    def has_one_sign(form: ex.Expression) -> bool:
        new = [term for term in ex.summands(form) if term not in kept]
        even = [
            term
            for term in new
            if all(e % 2 == 0 for p, e in ex.powers_of(term) if isinstance(p, ex.Sum))
        ]
        return len({ex.coefficient(term) < 0 for term in even}) <= 1

    return tuple(filter(has_one_sign, found))


def _over_shared_sums(tree: ex.Expression, letters: Collection[ex.Expression]) -> ex.Expression:
    """Terms with `letters`, and sums that they share taken out where these vary: (x^2 + y^2) (x'^2
    + y'^2)/2.
    """
    groups: dict[frozenset[Power], list[list[Power]]] = {}
    for term in ex.summands(tree):
        powers = ex.powers_of(term)
        shared: list[Power] = [
            (p, e)
            for p, e in powers
            if isinstance(p, ex.Sum | ex.Apply) and not ex.holds(p, *letters)
        ]
        # Sums of masses have no functions and no powers, and stay with their velocities.
        varies = any(
            isinstance(node, ex.Apply | ex.Power) for p, _ in shared for node in ex.walk(p)
        )
        key = frozenset(shared) if varies and ex.holds(term, *letters) else frozenset()
        groups.setdefault(key, []).append(powers)
    found = []
    for key, terms in groups.items():
        common = [power for power in terms[0] if key and all(power in term for term in terms)]
        rest = [ex.multiply(*(p**e for p, e in term if (p, e) not in common)) for term in terms]
        found.append(ex.multiply(*(p**e for p, e in common), ex.add(*rest)))
    return ex.add(*found)


def power_of_form(tree: ex.Expression) -> tuple[ex.Expression, int] | None:
    """(P, k) with tree a constant times P^k, k > 1; None where it is no such power."""
    found = _factors(collecting.expand(tree))
    several = [(factor, k) for factor, k in found if k > 1] if found else []
    return several[0] if len(several) == 1 else None


def _degree(monomial: tm.Monomial, letters: Collection[ex.Expression]) -> int | None:
    """The degree in `letters`; None where one of them occurs other than as a factor."""
    total = Fraction(0)
    for base, exponent in monomial:
        if base in letters:
            total += exponent
        elif ex.holds(base, *letters):
            return None
    return int(total) if total.denominator == 1 and total >= 0 else None


def _grouped(terms: tm.Terms, with_divisors: bool) -> dict[tm.Monomial, tm.Terms]:
    """The terms by their exponentials, which no form divides or multiplies, and by their
    divisors.
    """
    groups: dict[tm.Monomial, tm.Terms] = {}
    for monomial, value in terms.items():
        outer = frozenset((p, e) for p, e in monomial
                          if ex.is_exponential(p) or (with_divisors and e < 0 and isinstance(p, ex.Sum)))  # fmt: skip
        groups.setdefault(outer, {})[monomial] = value
    return groups


def _squares(terms: tm.Terms, order: Sequence[ex.Expression]) -> list[ex.Expression]:
    """The quadratic form as a sum of squares as far as the coefficients of squares are single
    monomials.
    """
    left, found = dict(terms), list[ex.Expression]()
    for v in order:
        square = {key: value for key, value in left.items() if dict(key).get(v) == 2}
        cross = {key: value for key, value in left.items() if dict(key).get(v) == 1}
        if len(square) != 1 or not cross:
            continue
        ((key, value),) = square.items()
        outside = tm.times(key, tm.monomial(v), -2)
        half = {tm.times(k, tm.monomial(v), -1): c / (2 * value) for k, c in cross.items()}
        # value rest (root v + half/(rest root))^2, else with the root 1
        root, rest = _split_square(outside)
        if any(e < 0 for k in half for _, e in tm.times(k, tm.times(rest, root), -1)):
            root, rest = tm.EMPTY, outside
        form = {tm.times(root, tm.monomial(v)): Fraction(1)}
        form |= {tm.times(k, tm.times(rest, root), -1): c for k, c in half.items()}
        found.append(
            ex.multiply(
                ex.number(value),
                collecting.terms_tree([(rest, Fraction(1))]),
                collecting.terms_tree(form.items()) ** 2,
            )
        )
        remaining = dict(collecting.expand(collecting.terms_tree(left.items()) - found[-1]))
        left = {
            k: remaining[k] for k in dict.fromkeys([*left, *remaining]) if k in remaining
        }  # in their order
    return [*found, collecting.terms_tree(left.items())]


def _by_pairs(
    terms: tm.Terms, letters: Sequence[ex.Expression], degree: int
) -> list[ex.Expression]:
    """All mixed terms in two of the letters as a power of their sum or difference: k ((x - y)^4 +
    (y - z)^4)/4.
    """
    left = dict(terms)
    powers = dict[tuple[tm.Monomial, Fraction], list[ex.Expression]]()
    for key, value in list(left.items()):
        pair = [v for v in letters if v in dict(key)]
        if (
            not 2 <= degree <= bounds.POWER
            or len(pair) != 2
            or dict(key)[pair[1]] != 1
            or key not in left
        ):
            continue
        v, w = pair
        outside = frozenset(item for item in key if item[0] not in pair)
        for sign in (1, -1):
            c = sign * value / degree
            binomial = {
                tm.times(tm.times(outside, tm.monomial(v), degree - k), tm.monomial(w), k): c
                * math.comb(degree, k)
                * sign**k
                for k in range(degree + 1)
            }
            own = left.get(tm.times(outside, tm.monomial(v), degree), Fraction(0))
            if (degree > 2 or own * c > 0) and all(
                left.get(one) == binomial[one] for one in [*binomial][1:-1]
            ):
                powers.setdefault((outside, c), []).append((v + sign * w) ** degree)
                left = {
                    k: left.get(k, Fraction(0)) - binomial.get(k, Fraction(0))
                    for k in {**left, **binomial}
                }
                left = {k: value for k, value in left.items() if value}
                break
    for (outside, c), some in powers.items():
        for v in letters:
            if left.get(key := tm.times(outside, tm.monomial(v), degree)) == c:
                some.append(v**degree)
                del left[key]
    found = [
        c * collecting.terms_tree([(outside, Fraction(1))]) * ex.add(*some)
        for (outside, c), some in powers.items()
    ]
    return [*found, collecting.terms_tree(left.items())]


def _split_square(monomial: tm.Monomial) -> tuple[tm.Monomial, tm.Monomial]:
    """(s, r) with monomial = s^2 r, s with integer exponents."""
    root = frozenset(
        (base, Fraction(int(e) // 2)) for base, e in monomial if e.denominator == 1 and e >= 2
    )
    return root, tm.times(monomial, root, -2)


def as_power(terms: Sequence[collecting.Term]) -> ex.Expression:
    """The sum with factors as powers, where one that is a sum is repeated: (1 + k/sqrt(u))^4."""
    found = _factors(terms) if len(terms) <= _MOST_FACTORED else None
    plain = collecting.terms_tree(terms)
    if not found or not any(k > 1 and isinstance(factor, ex.Sum) for factor, k in found):
        return plain
    product = ex.multiply(*(factor**k for factor, k in found))
    first = collecting.expand(product)
    ratio = dict(terms).get(first[0][0], Fraction(0)) / first[0][1]
    return ratio * product if dict(collecting.expand(ratio * product)) == dict(terms) else plain


def _factors(terms: Sequence[collecting.Term]) -> list[tuple[ex.Expression, int]] | None:
    """The squarefree factors of a polynomial in powers of its letters, 1/sqrt(u) of u, each with
    its multiplicity.
    """
    exponents: dict[ex.Expression, list[Fraction]] = {}
    for place, (monomial, _) in enumerate(terms):
        for base, e in collecting.powers_in_order(monomial):
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
        tuple(int(e / unit) for e, (_, unit) in zip(row, units, strict=True)): fmpq(
            c.numerator, c.denominator
        )
        for row, (_, c) in zip(rows, terms, strict=True)
    }
    _, factors = context.from_dict(table).factor_squarefree()
    found = []
    for factor, k in factors:
        parts = [
            (
                frozenset(
                    (base, int(e) * unit)
                    for (base, unit), e in zip(units, powers, strict=True)
                    if e
                ),
                polynomials.as_fraction(value),
            )
            for powers, value in factor.to_dict().items()
        ]
        found.append((collecting.terms_tree(parts), int(k)))
    return found


def _by_constants(
    tree: ex.Expression, letters: Collection[ex.Expression], others: Collection[ex.Expression]
) -> ex.Expression:
    groups, rest = (
        dict[tm.Monomial, tm.Terms](),
        [term for term in ex.summands(tree) if not ex.holds(term, *letters)],
    )
    for monomial, value in collecting.expand(
        ex.add(*(term for term in ex.summands(tree) if term not in rest))
    ):
        constants = frozenset(
            (p, e) for p, e in monomial if isinstance(p, ex.Symbol) and p not in (*letters, *others)
        )
        groups.setdefault(constants, {})[tm.times(monomial, constants, -1)] = value
    found = list[ex.Expression]()
    for key, terms in groups.items():
        outside = collecting.terms_tree([(key, Fraction(1))])
        inner = collecting.terms_tree(
            collecting.expand(writing.one_square(collecting.terms_tree(terms.items())))
        )
        short = min([inner, *short_forms(inner, letters)], key=ex.node_count)
        found += [outside * term for term in ex.summands(short)]
    return ex.add(*found, *rest)


def proper_quotients(
    tree: ex.Expression, letters: Collection[ex.Expression], others: Collection[ex.Expression]
) -> ex.Expression:
    """c v w + r v w/D for (c D + r) v w/D where r has fewer terms; v and w are letters, c holds
    none and no others.
    """
    groups, found = dict[tm.Monomial, list[collecting.Term]](), list[ex.Expression]()
    for monomial, value in collecting.expand(tree):
        outer = frozenset(
            item for item in monomial if item[0] in letters or isinstance(item[0], ex.Sum)
        )
        groups.setdefault(outer, []).append((tm.times(monomial, outer, -1), value))
    for outer, inner in groups.items():
        divisors = (
            [p for p, e in collecting.powers_in_order(outer) if e == -1 and isinstance(p, ex.Sum)]
            if _degree(outer, letters) == 2
            else []
        )
        forms: list[tuple[int, ex.Expression, tm.Monomial, Sequence[collecting.Term]]] = [
            (len(inner), ex.ZERO, outer, inner)
        ]
        for divisor in divisors:
            ratios = [
                (tm.times(key, other, -1), a / b)
                for (key, a), (other, b) in product(inner, collecting.expand(divisor))
            ]
            fixed = [
                (key, c)
                for key, c in ratios
                if not any(ex.holds(p, *letters, *others) for p, _ in key)
            ]
            for c in dict.fromkeys(collecting.terms_tree([one]) for one in fixed):
                rest = collecting.expand(collecting.terms_tree(inner) - c * divisor)
                forms.append((len(rest), c, tm.times(outer, tm.monomial(divisor)), rest))
        _, c, proper, left = min(forms, key=itemgetter(0))
        found += [
            c * collecting.terms_tree([(proper, Fraction(1))]),
            collecting.terms_tree(left) * collecting.terms_tree([(outer, Fraction(1))]),
        ]
    return ex.add(*found)


def shortest_form(
    tree: ex.Expression, letters: Collection[ex.Expression], others: Collection[ex.Expression] = ()
) -> ex.Expression:
    """The tree itself, or the shortest of its forms where one is shorter.

    One of them has outside what all terms with `letters` share, and inside squares of sums in
    `others`: (x^2 + y^2 + 1) (p^2 + q^2 + (x p + y q)^2)/2. In another, the terms with one product
    of constants are squares: (cos(u) p + sin(u) q)^2/(2 A) + (cos(u) q - sin(u) p)^2/(2 B).
    """
    forms = [tree, *short_forms(tree, letters), _by_constants(tree, letters, others)]
    forms += short_forms(proper_quotients(tree, letters, others), letters)
    terms = [term for term in ex.summands(tree) if ex.holds(term, *letters)]
    powers = [ex.powers_of(term) for term in terms]
    sums = dict.fromkeys((p, e) for term in powers for p, e in term if isinstance(p, ex.Sum))
    common = [power for power in sums if len(terms) > 1 and all(power in term for term in powers)]
    if common:
        parts = (ex.multiply(*(p**e for p, e in term if (p, e) not in common)) for term in powers)
        inner = collecting.terms_tree(collecting.expand(ex.add(*parts)))
        short = min(
            [inner, *short_forms(inner, letters), *sums_of_squares(inner, tuple(others))],
            key=ex.node_count,
        )
        rest = (term for term in ex.summands(tree) if term not in terms)
        whole = writing.numbers_outside(ex.multiply(*(p**e for p, e in common), short))
        forms.append(ex.add(whole, *rest))
    return min(forms, key=ex.node_count)
