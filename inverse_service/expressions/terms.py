"""The calculus of terms: sums of Laurent monomials in generators, with rational coefficients.

A generator (`letter` in the code) is any tree (x, x', sin(x), x^2 + y^2, A(r1), exp(x)); a monomial
is a product of generators with rational exponents; terms map monomials to rational coefficients. No
relations among generators are assumed: an identity found here is true, but one not found may be
true as well.

The candidates for the shortest form of a polynomial in cos u, sin u, cos w, … are the polynomial
itself, sin^2 in place of 1 - cos^2 in one of the angles, and a sum of sines and cosines of sums of
angles (cos(u - w) for cos u cos w + sin u sin w).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from math import gcd, lcm, prod
from typing import TYPE_CHECKING, NamedTuple

from inverse_service import bounds
from inverse_service.expressions import functions, polynomials, printing, tree as ex
from inverse_service.expressions.calculus import differentiate

if TYPE_CHECKING:
    from flint import fmpq_mpoly

Monomial = frozenset[tuple[ex.Expression, Fraction]]
Terms = dict[Monomial, Fraction]

EMPTY: Monomial = frozenset()
LARGEST_FACTORED = 10**15
# The largest power of one function that is expanded in multiple angles, and the largest number of
# waves per product.
_POWERS, _WAVES = 4, 256


class TooManyTerms(ArithmeticError):
    """An expansion exceeded its bound; the caller continues without it."""


@lru_cache(maxsize=4096)
def monomial(*letters: ex.Expression) -> Monomial:
    """The product of generators."""
    product = EMPTY
    for letter in letters:
        product = times(product, frozenset([(letter, Fraction(1))]))
    return product


def times(left: Monomial, right: Monomial, exponent: Fraction | int = 1) -> Monomial:
    """left * right^exponent."""
    if not right:
        return left
    if not left and exponent == 1:
        return right
    # Most calls have small monomials, and fractions are slow, so known values are not recomputed.
    table = dict(left)
    for letter, e in right:
        more = e if exponent == 1 else -e if exponent == -1 else e * exponent
        before = table.get(letter)
        total = more if before is None else before + more
        if total:
            table[letter] = total
        else:
            table.pop(letter, None)
    return frozenset(table.items())


def exponent_of(key: Monomial, letter: ex.Expression) -> Fraction:
    """The exponent of a generator; 0 if it does not occur."""
    return next((e for other, e in key if other == letter), Fraction(0))


def depends_on(keys: Iterable[Monomial], *variables: ex.Expression) -> bool:
    """Whether one of these variables occurs in a generator of the monomials."""
    return any(ex.holds(letter, *variables) for key in keys for letter, _ in key)


def multiply_by(
    terms: Mapping[Monomial, Fraction],
    key: Monomial,
    exponent: Fraction | int = 1,
    factor: Fraction | int = 1,
) -> Terms:
    """The terms times key^exponent and a number."""
    return {times(other, key, exponent): value * factor for other, value in terms.items()}


def multiply_terms(left: Mapping[Monomial, Fraction], right: Mapping[Monomial, Fraction]) -> Terms:
    """The product; TooManyTerms if it has many terms, also before like terms are added."""
    if len(left) * len(right) > 20 * bounds.EXPANSION:
        raise TooManyTerms
    result: Terms = {}
    for a, x in left.items():
        for b, y in right.items():
            key = times(a, b)
            before = result.get(key)
            result[key] = x * y if before is None else before + x * y
    result = _without_whole_powers(result) if _have_number(left) and _have_number(right) else result
    return _bounded({key: value for key, value in result.items() if value})


def _have_number(terms: Iterable[Monomial]) -> bool:
    return any(isinstance(letter, ex.Number) for key in terms for letter, _ in key)


def _without_whole_powers(terms: Terms) -> Terms:
    """The terms with 3 sqrt(3) for sqrt(3)^3, so that roots of numbers have no integer powers."""
    parts = list[Terms]()
    for key, value in terms.items():
        wholes = [
            (letter, Fraction(int(e)))
            for letter, e in key
            if isinstance(letter, ex.Number) and abs(e) >= 1
        ]
        for number, e in wholes:
            value *= number.value ** int(e)
        parts.append({times(key, frozenset(wholes), -1) if wholes else key: value})
    return sum_of(parts)


def add_terms(left: Terms, right: Mapping[Monomial, Fraction], factor: Fraction | int = 1) -> Terms:
    """left + factor right."""
    return weighted_sum(((left, 1), (right, factor)))


def sum_of(parts: Iterable[Mapping[Monomial, Fraction]]) -> Terms:
    """The sum of the parts."""
    return weighted_sum((part, 1) for part in parts)


def weighted_sum(parts: Iterable[tuple[Mapping[Monomial, Fraction], Fraction | int]]) -> Terms:
    """The sum of the parts, each times its factor."""
    total: Terms = {}
    for terms, factor in parts:
        if not total and factor == 1:
            total = dict(terms)
            continue
        for key, value in terms.items():
            more = value if factor == 1 else factor * value
            before = total.get(key)
            if before is None:
                total[key] = more
            elif before + more:
                total[key] = before + more
            else:
                del total[key]
    return total


def _bounded(terms: Terms) -> Terms:
    if len(terms) > bounds.EXPANSION:
        raise TooManyTerms
    return terms


def terms_of(expression: ex.Expression) -> Terms:
    """The expanded tree; TooManyTerms if the expansion is large.

    Sums under negative or fractional powers are generators; for 1/(x^2 + 2 x y + y^2) the generator
    is x + y.
    """
    match expression:
        case ex.Number(value):
            return {EMPTY: value} if value else {}
        case ex.Sum(parts):
            return _bounded(sum_of(map(terms_of, parts)))
        case ex.Product(factors):
            return _product(list(map(terms_of, factors)))
        case ex.Power(base, ex.Number(exponent)):
            return dict(_power_of_tree(base, exponent))
        case ex.Power(base, exponent) if ex.split_exponent(exponent)[1]:
            rest, whole = ex.split_exponent(exponent)
            if not (inside := terms_of(base)):
                return {}
            content, common, primitive = split_content(inside)
            beside = times(
                common, monomial(_generator(primitive)) if primitive != ex.ONE else EMPTY
            )
            return {times(monomial(ex.Power(base, rest)), beside, whole): content**whole}
        case ex.Apply("exp", argument):
            return _exponential(argument)
        case ex.Apply() if (simple := functions.of_inverse(expression)) is not None:
            return terms_of(simple)
        case ex.Apply(function, argument) if function in functions.FRACTIONS:
            pairs = zip(*functions.FRACTIONS[function], strict=True)
            return terms_of(ex.multiply(*(ex.Apply(name, argument) ** e for name, e in pairs if e)))
        case ex.Apply(function, ex.Sum() as argument) if functions.parity(function):
            return dict(_of_sum(function, argument))
        case ex.Apply(function, ex.Product((ex.Number(factor), *_)) as argument) if (
            factor < 0 and functions.parity(function)
        ):
            return {
                key: c * functions.parity(function)
                for key, c in terms_of(ex.Apply(function, -argument)).items()
            }
        case _:
            return {monomial(expression): Fraction(1)}


def _product(factors: Sequence[Terms]) -> Terms:
    """The product of sums; monomials, the most frequent factors, are multiplied in one table."""
    if not all(factors):
        return {}
    value, table = Fraction(1), dict[ex.Expression, Fraction]()
    for key, one in (item for terms in factors if len(terms) == 1 for item in terms.items()):
        value = value if one == 1 else one if value == 1 else value * one
        for letter, e in key:
            table[letter] = table[letter] + e if letter in table else e
    product: Terms = {frozenset(item for item in table.items() if item[1]): value}
    product = _without_whole_powers(product) if _have_number(product) else product
    for terms in factors:
        product = multiply_terms(product, terms) if len(terms) > 1 else product
    return product


def _with_leading_plus(function: str, argument: Terms) -> Terms:
    """f(argument) with one generator for both signs: sin(y - x) = -sin(x - y), cos(y - x) = cos(x -
    y).
    """
    if not argument:
        return {} if functions.parity(function) < 0 else {EMPTY: Fraction(1)}
    negative = argument[min(argument, key=rank)] < 0
    turned = {key: -value for key, value in argument.items()} if negative else argument
    sign = functions.parity(function) if negative else 1
    return {monomial(ex.Apply(function, _generator(tree_of(turned)))): Fraction(sign)}


@lru_cache(maxsize=4096)
def _of_sum(function: str, argument: ex.Sum) -> Terms:
    """An odd or even function of a sum, cached: its argument is expanded once, however often and
    however deep it occurs. It must not be changed.
    """
    return _with_leading_plus(function, terms_of(argument))


@lru_cache(maxsize=4096)
def _power_of_tree(base: ex.Expression, exponent: Fraction) -> Terms:
    """The power, cached because roots and denominators occur in many terms; it must not be
    changed.
    """
    return _power(terms_of(base), exponent)


def _power(base: Terms, exponent: Fraction) -> Terms:
    """base^exponent: expanded if it is a small power, else content^e (common monomial)^e (primitive
    sum)^e.

    An integer power is taken of each square-free factor of the sum, so that (x + y)^2 and x + y
    have one generator. `power_of_factors` takes it of each irreducible factor.
    """
    if not base:
        return {}
    if _is_small_power(len(base), exponent):
        result: Terms = {EMPTY: Fraction(1)}
        for _ in range(int(exponent)):
            result = multiply_terms(result, base)
        return result
    if exponent < 0 and exponent.denominator == 1 and len(base) > 1:
        # 1/(1 + x/y) is y/(y + x).
        tables = list(map(dict, base))
        lowest = frozenset(
            (p, e)
            for key in base
            for p, e in key
            if e < 0 and e == min(t.get(p, e) for t in tables) and not _is_negative(p)
        )
        if lowest:
            base = terms_of(tree_of(multiply_by(base, lowest, -1)))
            return multiply_terms(
                {times(EMPTY, lowest, exponent): Fraction(1)}, power_of_factors(base, exponent)
            )
    content, common, rest = split_content(base)
    rest = _generator(rest)
    if content < 0 and exponent.denominator > 1 and common:
        # -x is kept whole under a root, because the root of -1 has no real value.
        return {frozenset([(tree_of(base), exponent)]): Fraction(1)}
    factor, root = _numeric_power(content, exponent)
    whole = times(root, common, exponent)
    if rest != ex.ONE and exponent.denominator == 1:
        unit, parts = _without_squares(rest)
        factor *= unit ** int(exponent)
        for part, e in parts:
            whole = times(whole, monomial(part), e * exponent)
    elif rest != ex.ONE:
        whole = times(whole, monomial(rest), exponent)
    return {whole: factor}


def _generator(tree: ex.Expression) -> ex.Expression:
    """The tree of an expansion; TooManyTerms if it is large, because that of nested squares is
    written out again and again and grows with the power of their number.
    """
    if ex.node_count(tree) > bounds.TERMS:
        raise TooManyTerms
    return tree


def _is_negative(generator: ex.Expression) -> bool:
    """The root of a negative number has no value; it would go from one term to the other and back."""
    return isinstance(generator, ex.Number) and generator.value < 0


def power_of_factors(base: Terms, exponent: Fraction) -> Terms:
    """As `_power` for integers, but each irreducible factor is a generator: 2 + a and v^2 + 1 in
    their product. A base of a degree that is too large to be factored is a generator as it is.
    """
    if any(e.denominator > 1 or e < 0 for key in base for _, e in key):
        return _power(base, exponent)
    polynomial, letters = polynomial_of(base)
    unit, factors = polynomials.factors_if_small(polynomial)
    parts = [_power(terms_of_polynomial(factor, letters), e * exponent) for factor, e in factors]
    return _product([{EMPTY: unit ** int(exponent)}, *parts])


@lru_cache(maxsize=1024)
def _without_squares(tree: ex.Expression) -> tuple[Fraction, tuple[tuple[ex.Expression, int], ...]]:
    """(c, ((p_k, e_k), …)) with tree = c prod p_k^e_k for a sum of products of generators; usually
    ((tree, 1),).
    """
    terms = terms_of(tree)
    if any(e < 0 or e.denominator > 1 for key in terms for _, e in key):
        return Fraction(1), ((tree, 1),)
    polynomial, letters = polynomial_of(terms)
    unit, factors = polynomial.factor_squarefree()
    if all(int(e) == 1 for _, e in factors):
        return Fraction(1), ((tree, 1),)
    parts = tuple((tree_of(terms_of_polynomial(factor, letters)), int(e)) for factor, e in factors)
    return Fraction(int(unit.p), int(unit.q)), parts


def polynomial_of(terms: Mapping[Monomial, Fraction]) -> tuple[fmpq_mpoly, list[ex.Expression]]:
    """A sum of products of generators with nonnegative integer exponents, and the generators.

    Their order decides the signs of the factors of the polynomial, so it is not that of a set.
    """
    from flint import fmpq, fmpq_mpoly_ctx  # which the formulas of a scene seldom need

    letters = sorted(
        {letter for key in terms for letter, _ in key}, key=lambda letter: _traits(letter)[2]
    )
    context = fmpq_mpoly_ctx.get(tuple(f"a{k}" for k in range(len(letters))))
    table = {
        tuple(int(exponent_of(key, letter)) for letter in letters): fmpq(
            value.numerator, value.denominator
        )
        for key, value in terms.items()
    }
    return context.from_dict(table), letters


def terms_of_polynomial(polynomial: fmpq_mpoly, letters: Sequence[ex.Expression]) -> Terms:
    return {
        frozenset(
            (letter, Fraction(int(e))) for letter, e in zip(letters, exponents, strict=True) if e
        ): Fraction(int(value.p), int(value.q))
        for exponents, value in polynomial.to_dict().items()
    }


def in_powers(
    terms: Mapping[Monomial, Fraction], divisor: Mapping[Monomial, Fraction], letter: ex.Expression
) -> list[Terms]:
    """r_0, r_1, ... with terms = r_0 + r_1 D + r_2 D^2 + ..., each of lower degree than D in the
    letter; none where the terms are no polynomials in it, or D begins with no number.
    """
    exponents = [exponent_of(key, letter) for key in (*terms, *divisor)]
    degree = max((exponent_of(key, letter) for key in divisor), default=Fraction(0))
    leading = [(key, value) for key, value in divisor.items() if exponent_of(key, letter) == degree]
    if degree < 1 or len(leading) != 1 or len(leading[0][0]) != 1:
        return []
    if any(e < 0 or e.denominator > 1 for e in exponents):
        return []
    digits, rest = list[Terms](), dict(terms)
    while rest:
        quotient = Terms()
        while high := {key: c for key, c in rest.items() if exponent_of(key, letter) >= degree}:
            key, value = max(high.items(), key=lambda item: exponent_of(item[0], letter))
            part = {times(key, leading[0][0], -1): value / leading[0][1]}
            quotient = add_terms(quotient, part)
            rest = add_terms(rest, multiply_terms(part, divisor), -1)
        digits.append(rest)
        rest = quotient
    return digits


def _is_small_power(count: int, exponent: Fraction) -> bool:
    return (
        exponent.denominator == 1
        and 0 < exponent <= bounds.POWER
        and count**exponent <= bounds.EXPANSION
    )


def _numeric_power(value: Fraction, exponent: Fraction) -> tuple[Fraction, Monomial]:
    """(rational, generators) with product value^exponent; the root of an integer without such
    powers is a generator.
    """
    if exponent.denominator == 1:
        return value ** int(exponent), EMPTY
    outside, inside = (
        root_of_number(value, exponent.denominator) if value > 0 else (Fraction(1), value)
    )
    root = frozenset([(ex.number(inside), exponent - int(exponent))]) if inside != 1 else EMPTY
    return outside**exponent.numerator * inside ** int(exponent), root


def root_of_number(value: Fraction, degree: int) -> tuple[Fraction, Fraction]:
    """(a, b) with value = a^degree b for a positive value, where b is an integer without such
    factors.
    """
    outside, inside = Fraction(1, value.denominator), Fraction(1)
    whole = value.numerator * value.denominator ** (degree - 1)
    for prime, e in factored(whole):
        outside *= prime ** (e // degree)
        inside *= prime ** (e % degree)
    return outside, inside


def factored(whole: int) -> list[tuple[int, int]]:
    """The primes of a positive integer with their exponents; a large one counts as prime."""
    if whole >= LARGEST_FACTORED:
        return [(whole, 1)]
    from flint import fmpz  # which the formulas of a scene seldom need

    return [(int(prime), int(exponent)) for prime, exponent in fmpz(whole).factor()]


def content_of(numbers: Iterable[Fraction]) -> Fraction:
    """The largest number of which all are integer multiples; 0 if all are 0."""
    values = tuple(numbers)
    return Fraction(gcd(*(v.numerator for v in values)), lcm(*(v.denominator for v in values)))


def common_factor(terms: Iterable[Monomial]) -> Monomial:
    """The generators that all terms have, with their lowest exponents."""
    first, *others = map(dict, terms)
    for table in others:
        first = {letter: min(e, table[letter]) for letter, e in first.items() if letter in table}
    return frozenset(first.items())


class Content(NamedTuple):
    """A sum as a number times the common monomial times the rest."""

    number: Fraction
    common: Monomial
    rest: ex.Expression


def split_content(terms: Mapping[Monomial, Fraction]) -> Content:
    """(rational content, common monomial, primitive part) of a nonzero sum; the primitive part is
    ONE for one term.

    For more than one term the content is positive, so that even roots of the primitive part remain
    real.
    """
    if len(terms) == 1:
        ((key, value),) = terms.items()
        return Content(value, key, ex.ONE)
    content, common = content_of(terms.values()), common_factor(terms)
    return Content(content, common, tree_of(multiply_by(terms, common, -1, 1 / content)))


def _exponential(argument: ex.Expression) -> Terms:
    """exp(c u + …) = exp(u)^c … with one generator for each monomial u of the argument."""
    product = EMPTY
    for key, coefficient in terms_of(argument).items():
        letter = ex.Apply("exp", monomial_tree(key))
        product = times(product, frozenset([(letter, coefficient)]))
    return {product: Fraction(1)}


def tree_of(terms: Mapping[Monomial, Fraction]) -> ex.Expression:
    """The sum as a tree, in a fixed order."""
    ordered = sorted(terms.items(), key=lambda item: rank(item[0]))
    return ex.add(*(_term_tree(key, value) for key, value in ordered))


def _term_tree(key: Monomial, value: Fraction) -> ex.Expression:
    """The term as a tree, with 1/sqrt(3) for sqrt(3)/3."""
    for letter, e in key:
        if (
            isinstance(letter, ex.Number)
            and e == Fraction(1, 2)
            and value.denominator % letter.value == 0
        ):
            return (
                value
                * letter.value
                * monomial_tree(times(key, frozenset([(letter, Fraction(1))]), -1))
            )
    return value * monomial_tree(key)


def collected(tree: ex.Expression) -> ex.Expression:
    """The tree as a sum of monomials with canceled common factors; unchanged if there are too
    many.
    """
    try:
        return tree_of(terms_of(tree))
    except TooManyTerms:
        return tree


@lru_cache(maxsize=8192)  # forms of one formula write the same monomials again
def monomial_tree(key: Monomial) -> ex.Expression:
    """The monomial as a tree, with exponentials merged into exp(c u)."""
    parts, exponents = [], []
    symbolic: dict[ex.Expression, list[ex.Expression]] = {}
    for letter, exponent in key:
        if isinstance(letter, ex.Power):
            symbolic.setdefault(letter.base, []).append(exponent * letter.exponent)
    for letter, exponent in sorted(key, key=_letter_rank):
        if isinstance(letter, ex.Power) or letter in symbolic:
            continue
        if ex.is_exponential(letter):
            exponents.append(exponent * letter.argument)
        else:
            parts.append(letter**exponent)
    table = dict(key)
    for base, together in sorted(symbolic.items(), key=lambda item: repr(item[0])):
        parts.append(
            base ** tree_of(terms_of(ex.add(*together, ex.number(table.get(base, Fraction(0))))))
        )
    if exponents:
        parts.append(ex.Apply("exp", ex.add(*exponents)))
    return ex.multiply(*parts)


def _letter_rank(item: tuple[ex.Expression, Fraction]) -> tuple[int, str]:
    letter = item[0]
    kind = (
        0
        if isinstance(letter, ex.Number) or letter == ex.PI
        else 1
        if isinstance(letter, ex.Symbol)
        else 3
    )
    return (4 if isinstance(letter, ex.Velocity) else kind, _traits(letter)[2])


@lru_cache(maxsize=16384)
def rank(key: Monomial) -> tuple[Fraction | int, int, str]:
    """Simple monomials first: small exponents, few generators, then by name.

    Logarithms, roots and inverses of a polynomial in the velocities come after its square.
    """
    # In integers if possible, because a search ranks tens of thousands of monomials.
    weight: Fraction | int = 0
    texts = []
    for letter, exponent in key:
        n, d = exponent.as_integer_ratio()
        factor, moving, name = _traits(letter)
        size = abs(n) if d == 1 else Fraction(abs(n), d)
        if moving:
            size += 2 if d > 1 else 1 if n < 0 else 0
        weight += size * factor + (n < 0 or d > 1)
        texts.append((name, f"({name!r}, Fraction({n}, {d}))"))
    return weight, len(key), f"[{', '.join(text for _, text in sorted(texts))}]"


@lru_cache(maxsize=4096)
def _traits(letter: ex.Expression) -> tuple[int, bool, str]:
    """Its weight, whether it is a sum with velocities, and its sort key; cached because printing a
    tree is slow.
    """
    return _letter_weight(letter), _is_moving_sum(letter), printing.natural(repr(letter))


def _letter_weight(letter: ex.Expression) -> int:
    if isinstance(letter, ex.Symbol | ex.Velocity | ex.Number):
        return 1
    if isinstance(letter, ex.Apply) and _is_moving_sum(letter.argument):
        return 3 + 2 * _letter_weight(letter.argument)
    return 1 + len(letter.terms) if isinstance(letter, ex.Sum) else 2


def _is_moving_sum(tree: ex.Expression) -> bool:
    return isinstance(tree, ex.Sum) and has_velocity(tree)


def holds_only(key: Monomial, letters: Container[ex.Expression]) -> bool:
    """Whether a monomial is a product of powers of these letters alone."""
    return all(letter in letters for letter, _ in key)


def without_constants(
    terms: Mapping[Monomial, Fraction], constants: Container[ex.Expression]
) -> Terms:
    """The terms that hold more than these constants."""
    return {key: c for key, c in terms.items() if not holds_only(key, constants)}


def power_coefficient(
    terms: Mapping[Monomial, Fraction], letter: ex.Expression, exponent: Fraction | int
) -> Terms:
    """The coefficient of this power of a letter."""
    power = (letter, Fraction(exponent))
    return {key - {power}: value for key, value in terms.items() if power in key}


class Square(NamedTuple):
    """c (v + s)^2."""

    factor: Terms
    shift: Terms


def complete_square(terms: Mapping[Monomial, Fraction], letter: ex.Expression) -> Square:
    """The square whose terms with the letter v are c v^2 + 2 c s v, as the terms have them.

    s is empty if c has several terms and is not the linear term up to a monomial; with c = 0, 2 s
    is the factor of v.
    """
    factor, linear = (power_coefficient(terms, letter, exponent) for exponent in (2, 1))
    if len(factor) > 1:
        ratio = monomial_factor(linear, factor) or {}
    else:
        ((key, value),) = factor.items() or [(EMPTY, Fraction(1))]
        ratio = multiply_by(linear, key, -1, 1 / value)
    return Square(factor, scaled(ratio, Fraction(1, 2)))


def monomial_derivative(key: Monomial, variable: ex.Expression) -> Terms:
    """The partial derivative of a monomial."""
    slopes = ((letter, e, letter_derivative(letter, variable)) for letter, e in key)
    return sum_of(
        multiply_terms({times(key, frozenset([(letter, Fraction(1))]), -1): e}, slope)
        for letter, e, slope in slopes
        if slope
    )


@lru_cache(maxsize=4096)
def letter_derivative(letter: ex.Expression, variable: ex.Expression) -> Terms:
    """The partial derivative of a generator, expanded."""
    if letter == variable:
        return {EMPTY: Fraction(1)}
    if isinstance(letter, ex.Symbol | ex.Velocity | ex.Number):
        return {}
    if isinstance(letter, ex.Apply) and letter.function == "log":
        # The derivative of y + sqrt(y^2 + 1) is 1/sqrt(y^2 + 1) times itself.
        inside = terms_of(letter.argument)
        factor = monomial_factor(derivative_of_terms(inside, variable), inside)
        if factor is not None:
            return factor
    return terms_of(differentiate(letter, variable))


def monomial_factor(
    left: Mapping[Monomial, Fraction], right: Mapping[Monomial, Fraction]
) -> Terms | None:
    """The monomial c with left = c right; None if the quotient is not a monomial."""
    if not left or len(left) != len(right):
        return None
    first, value = next(iter(right.items()))
    for key, c in left.items():
        quotient, ratio = times(key, first, -1), c / value
        if all(left.get(times(other, quotient)) == ratio * a for other, a in right.items()):
            return {quotient: ratio}
    return None


def derivative_of_terms(terms: Mapping[Monomial, Fraction], variable: ex.Expression) -> Terms:
    return _bounded(
        weighted_sum(
            (monomial_derivative(key, variable), value)
            for key, value in terms.items()
            if any(variable in _parts_of(letter) for letter, _ in key)
        )
    )


@lru_cache(maxsize=4096)
def _parts_of(letter: ex.Expression) -> frozenset[ex.Expression]:
    return frozenset(ex.distinct_nodes([letter]))


@lru_cache(maxsize=4096)
def has_velocity(letter: ex.Expression) -> bool:
    return ex.has(letter, ex.Velocity)


def grouped(
    terms: Mapping[Monomial, Fraction], is_outside: Callable[[ex.Expression], bool]
) -> dict[Monomial, Terms]:
    """The sum grouped by products of the generators that satisfy `is_outside`: the coefficient of
    each product.
    """
    groups: dict[Monomial, Terms] = {}
    for key, value in terms.items():
        outer: Monomial = frozenset(item for item in key if is_outside(item[0]))
        groups.setdefault(outer, {})[key - outer] = value
    return groups


def split_velocities(key: Monomial) -> tuple[Monomial, Monomial]:
    """(generators without velocities, generators with velocities)."""
    moving = frozenset(item for item in key if has_velocity(item[0]))
    return key - moving, moving


def coefficient(terms: Mapping[Monomial, Fraction], moving: Monomial) -> Terms:
    """The coefficient of `moving`, the product of all generators with velocities; the terms at rest
    if it is empty.
    """
    return {
        key - moving: value for key, value in terms.items() if split_velocities(key)[1] == moving
    }


def affine_parts(
    terms: Mapping[Monomial, Fraction], velocities: Sequence[ex.Expression]
) -> tuple[Terms, list[Terms]] | None:
    """(a, [b_i]) with terms = a + b_i v_i; None if they are not affine in the velocities."""
    groups = grouped(terms, has_velocity)
    parts = [groups.pop(moving, {}) for moving in (EMPTY, *map(monomial, velocities))]
    return None if groups else (parts[0], parts[1:])


def scaled(terms: Mapping[Monomial, Fraction], factor: Fraction | int) -> Terms:
    return {key: value * factor for key, value in terms.items()}


def is_constant(letter: ex.Expression, constants: Container[ex.Expression]) -> bool:
    """Whether a generator is a function of these constants only; False for a number."""
    leaves = [
        node for node in ex.walk(letter) if isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary)
    ]
    return bool(leaves) and all(leaf in constants for leaf in leaves)


def velocity_degree(key: Monomial) -> int | None:
    """The degree of a product of velocities and a function of position; None for other functions of
    the velocities.
    """
    _, moving = split_velocities(key)
    plain = all(
        isinstance(letter, ex.Velocity) and e.denominator == 1 and e > 0 for letter, e in moving
    )
    return int(sum(e for _, e in moving)) if plain else None


def is_affine(key: Monomial) -> bool:
    """Whether a term is a function of position times at most one velocity."""
    return velocity_degree(key) in (0, 1)


@lru_cache(maxsize=1024)
def irreducible_factors(tree: ex.Expression) -> tuple[ex.Expression, ...]:
    """The factors that are sums, for a tree that is a polynomial in roots of generators over a
    monomial.
    """
    terms, exponents = terms_of(tree), dict[ex.Expression, list[Fraction]]()
    for letter, e in (item for key in terms for item in key):
        exponents.setdefault(letter, [Fraction(0)]).append(e)
    root = {letter: lcm(*(e.denominator for e in found)) for letter, found in exponents.items()}
    lowest = frozenset((letter, min(found)) for letter, found in exponents.items())
    whole = {
        frozenset((p, e * root[p]) for p, e in times(key, lowest, -1)): value
        for key, value in terms.items()
    }
    polynomial, letters = polynomial_of(whole)
    found = [
        terms_of_polynomial(factor, letters)
        for factor, _ in polynomials.factors_if_small(polynomial).powers
    ]
    sums = [
        {frozenset((p, e / root[p]) for p, e in key): c for key, c in one.items()}
        for one in found
        if len(one) > 1
    ]
    return tuple(split_content(one)[2] for one in sums)


# Short polynomials in sines and cosines.


def shortest_in_angles(terms: Terms) -> Terms:
    """The form with the fewest terms; the given form if it has as few.

    Sums of waves (cos(u - w) for cos u cos w + sin u sin w) that halve the number of terms are
    taken at once. Else sin^2 and cos^2 are exchanged, one function at a time while that helps, and
    the shorter of the two is taken.
    """
    best = terms
    try:
        waves = _halved(by_multiple_angles(terms))
    except TooManyTerms:
        waves = terms
    if 2 * len(waves) <= len(terms):
        return waves
    try:
        letters = sorted({p for key in terms for p, _ in key if isinstance(p, ex.Apply)}, key=repr)
        squares = [p for p in letters if p.function in functions.SQUARES]
        for letter in dict.fromkeys(
            q for p in squares for q in (p, ex.Apply(functions.SQUARES[p.function][0], p.argument))
        ):
            other = _exchanged(best, letter)
            best = other if _length(other) < _length(best) else best
    except TooManyTerms:
        return best
    return waves if _length(waves) < _length(best) else best


def _length(terms: Terms) -> tuple[int, int]:
    return len(terms), sum(len(key) for key in terms)


def _exchanged(terms: Terms, letter: ex.Apply) -> Terms:
    """The terms with 1 - sin^2 for cos^2 in one angle, 1 - cos^2 for sin^2, or likewise for
    hyperbolic functions.
    """
    new, constant, factor = functions.SQUARES[letter.function]
    square = times(EMPTY, monomial(ex.Apply(new, letter.argument)), 2)
    parts = list[Terms]()
    for key, value in terms.items():
        e = exponent_of(key, letter)
        half = int(e) // 2 if e.denominator == 1 and e >= 2 else 0
        part: Terms = {times(key, monomial(letter), -2 * half) if half else key: value}
        for _ in range(half):
            part = multiply_terms(part, {EMPTY: Fraction(constant), square: Fraction(factor)})
        parts.append(part)
    return sum_of(parts)


def _halved(waves: Terms) -> Terms:
    """The terms with 1 - 2 sin^2 u or 2 cos^2 u - 1 for cos 2u wherever that gives fewer terms."""
    for double in dict.fromkeys(
        p for key in waves for p, _ in key if isinstance(p, ex.Apply) and p.function == "cos"
    ):
        halves = {key: value / 2 for key, value in terms_of(double.argument).items()}
        if any(value.denominator > 1 for value in halves.values()):
            continue
        for name, unit in (("sin", 1), ("cos", -1)):
            square, whole = (
                times(EMPTY, monomial(ex.Apply(name, tree_of(halves))), 2),
                monomial(double),
            )
            held = {key: value for key, value in waves.items() if whole <= key}
            short = multiply_terms(
                multiply_by(held, whole, -1), {EMPTY: Fraction(unit), square: Fraction(-2 * unit)}
            )
            other = add_terms(add_terms(waves, held, -1), short)
            waves = other if _length(other) < _length(waves) else waves
    return waves


def by_multiple_angles(terms: Terms) -> Terms:
    """The terms with products of sines and cosines expanded into sines and cosines of sums of
    angles.
    """
    parts = list[tuple[Terms, Fraction]]()
    for key, value in terms.items():
        circular: Monomial = frozenset(
            (p, e)
            for p, e in key
            if isinstance(p, ex.Apply)
            and p.function in ("sin", "cos")
            and e.denominator == 1
            and 0 < e <= _POWERS
        )
        parts += [
            ({times(key - circular, letter): factor}, value)
            for letter, factor in _in_waves(circular)
        ]
    return weighted_sum(parts)


@lru_cache(maxsize=1024)
def _in_waves(circular: Monomial) -> tuple[tuple[Monomial, Fraction], ...]:
    """The expansion of a product of sines and cosines: cos u cos w = (cos(u - w) + cos(u + w))/2,
    and so on.

    Raises TooManyTerms for more than _WAVES; n angles, each squared, have about 3^n.
    """
    functions = sorted(((p, int(e)) for p, e in circular if isinstance(p, ex.Apply)), key=repr)
    angles = list(dict.fromkeys(p.argument for p, _ in functions))
    if prod(1 + sum(e for p, e in functions if p.argument == angle) for angle in angles) > _WAVES:
        raise TooManyTerms
    # cos(sum_k n_k angles_k - m pi/2) by n and m, 0 or 1; sin u is cos(u - pi/2).
    waves = {((0,) * len(angles), 0): Fraction(1)}
    for p in (p for p, e in functions for _ in range(e)):
        place, quarter = angles.index(p.argument), int(p.function == "sin")
        turned = defaultdict[tuple[tuple[int, ...], int], Fraction](Fraction)
        for ((turns, quarters), factor), sign in product(waves.items(), (1, -1)):
            more, whole = (
                (*turns[:place], turns[place] + sign, *turns[place + 1 :]),
                quarters + sign * quarter,
            )
            turned[more, whole % 2] += (-factor if whole in (-1, 2) else factor) / 2
        waves = turned
    sums, parts = [terms_of(angle) for angle in angles], list[tuple[Terms, Fraction]]()
    for (turns, quarters), factor in waves.items():
        argument = weighted_sum(
            (angle, turn) for turn, angle in zip(turns, sums, strict=True) if turn
        )
        name = "sin" if quarters else "cos"
        shown = ex.Apply(name, tree_of(argument)) if argument else ex.number(int(name == "cos"))
        parts.append((terms_of(shown), factor))
    return tuple(weighted_sum(parts).items())


def distinct(parts: Sequence[Monomial]) -> list[Monomial]:
    """The monomials without duplicates, simple ones first."""
    return sorted(dict.fromkeys(parts), key=rank)
