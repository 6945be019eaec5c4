"""Compute the cell of a claim: where its formulas are defined and the relations used in its proof
are true.

Formulas are parsed into quotients of polynomials in *generators*: names, and roots and functions of
quotients, all treated as independent. Denominators must be nonzero, and arguments of roots and
logarithms positive; both are factored. Most relations are true wherever their sides are real. The
branch of an arctangent is constant only while the arguments that it relates have no pole, so their
factors must keep the sign that they have at the point P.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

from flint import Ordering, fmpq, fmpq_mpoly_ctx

from .exceptions import has_real_zeros, polynomial_text, primitive
from .formulas import (
    SPECIAL,
    Ended,
    Incomplete,
    Order,
    is_real_everywhere,
    laws_of,
    read_formulas,
    read_tokens,
    value_of,
)
from .numbers import Entry
from .quotients import Quotient, added, multiplied, reduced

if TYPE_CHECKING:
    from .question import Question

T = TypeVar("T")
Polynomial = Any  # fmpq_mpoly
MAX_TERMS = 3000  # per polynomial; a longer formula becomes a generator of unknown sign
LONG = "..."  # prefix of the text of such a generator, which cannot occur in a formula
MAX_LETTERS = 512
SCALE = 10**40  # of the bounds of a square root
MAX_MULTIPLE = 8  # of an angle whose sine is written by that of the angle
SPARE = 24  # initial number of generators in addition to the names


class TooManyLetters(Exception):
    """The ring of polynomials must be rebuilt with more generators."""


@dataclass(frozen=True, slots=True)
class Need:
    """A polynomial that is positive (">") or not zero ("!=").

    Polynomials of flint are compared by their texts.
    """

    kind: str
    polynomial: Polynomial = field(compare=False)
    text: str = ""


def needs_in_order(needs: Iterable[Need]) -> dict[Need, None]:
    """The needs of a set, in an order that depends on nothing else."""
    return dict.fromkeys(sorted(needs, key=lambda one: (one.kind, one.text)))


def need_of(kind: str, polynomial: Polynomial) -> Need:
    return Need(kind, polynomial, str(polynomial))


class Factors(NamedTuple):
    """A number, and irreducible monic polynomials with their multiplicities."""

    content: fmpq
    listed: list[tuple[Polynomial, int]]

    def size(self) -> tuple[int, int, int]:
        """The number of factors with odd multiplicity, the number of factors, and the number of
        their terms.
        """
        odd = sum(k % 2 for _, k in self.listed)
        return odd, len(self.listed), sum(len(p) for p, _ in self.listed)


class Lesson(NamedTuple):
    """What is nonzero, by text, where a polynomial is; the generators of each of these; its factors
    of odd multiplicity, the sign of its content, and whether it has factors.
    """

    nonzero: dict[str, Polynomial]
    letters: list[set[int]]
    odd: dict[str, Polynomial]
    sign: int
    is_moving: bool


class Multiple(NamedTuple):
    """`factor` times the generator at `place`."""

    place: int
    factor: fmpq


@dataclass(frozen=True, slots=True)
class Cell:
    """Where a claim is valid: inequalities "x > 0", "x - 1 != 0", each between an expression and 0.

    `sides` are the inequalities on which relations used in the proof depend. `one_side`: only the
    connected component of P in the set where all `>` are true. `unknown`: a condition is too long
    to be written.
    """

    domain: tuple[str, ...] = ()
    sides: tuple[str, ...] = ()
    one_side: bool = False
    unknown: bool = False


class Letters:
    """A ring for `read_formulas`.

    `needs` collects the conditions of the formulas, `cut` those of related arctangents.
    """

    degree = 0

    def __init__(self, question: Question, size: int = SPARE) -> None:
        self.question, self.entries = question, iter(question.plan.entries)
        plain = ["pi", *sorted(question.names)]
        self.texts, self.size = [*plain], len(plain) + size
        self.context = fmpq_mpoly_ctx.get([f"z{k}" for k in range(self.size)], Ordering.degrevlex)
        self.generators = self.context.gens()
        self.one: Polynomial = self.context.constant(1)
        self.names: dict[str, Quotient] = {
            name: Quotient(z, self.one) for name, z in zip(plain, self.generators, strict=False)
        }
        self.places = dict[str, int]()
        self.positive = {0}  # generators that are positive
        self.bounded = set[int]()  # generators between -1 and 1
        self.logarithms = dict[int, Quotient]()  # log u
        self.odd = dict[int, Quotient]()  # atan u with the sign of u
        self.exponentials = dict[int, Quotient]()  # e^u
        self.squares = dict[int, Quotient]()  # sqrt(w)
        self.circular = dict[int, tuple[str, Quotient]]()  # sin u, cos u
        self.inner = dict[int, frozenset[Need]]()  # the conditions of a generator
        # The conditions of the logarithm of a pair of the plan.
        self.pairs = dict[int, frozenset[Need]]()
        self.arguments = dict[int, Quotient]()  # of the arctangents among them
        self.needs, self.cut = dict[Need, None](), dict[Need, None]()
        self.known = dict[str, Factors]()
        self.lessons = dict[tuple[str, int], Lesson]()  # by text and number of letters
        self.ties = list[Any]()
        self.apart = False  # expand sines and cosines of sums
        self.plain = Knowledge(self)

    # The operations of a ring.

    def constant(self, value: Fraction) -> Quotient:
        return Quotient(self.context.constant(fmpq(value.numerator, value.denominator)), self.one)

    def add(self, terms: list[Quotient], weights: Sequence[int] = ()) -> Quotient:
        (first, times), *rest = zip(terms, weights or [1] * len(terms), strict=True)
        total = Quotient(first.above * times, first.below)
        for term, weight in rest:
            self.question.check_time()
            total = added(total, term, weight)
            if max(map(len, total)) > MAX_TERMS:
                return self.long(*terms)
        return reduced(*total)

    def multiply(self, left: Quotient, right: Quotient, degree: int = 0) -> Quotient:
        if (
            len(left.above) * len(right.above) + len(left.below) * len(right.below)
            > 100 * MAX_TERMS
        ):
            return self.long(left, right)
        return self.without_squares(self.shortened(multiplied(left, right), left, right))

    def without_squares(self, u: Quotient) -> Quotient:
        """u with w substituted for sqrt(w)^2."""
        degrees = u.above.degrees(), u.below.degrees()
        for place, w in self.squares.items():
            if max(each[place] for each in degrees) > 1:
                above, below = (self.put_square(p, place, w) for p in (u.above, u.below))
                u = reduced(above.above * below.below, above.below * below.above)
                degrees = u.above.degrees(), u.below.degrees()
        return u

    def divided(self, p: Polynomial, q: Polynomial) -> Polynomial | None:
        """The s of lower degree with p = s q modulo r^2 = w, for q = a + b r with a root r =
        sqrt(w), or None.
        """
        degrees = q.degrees()
        for place in (k for k in self.holds(q) if k in self.squares and degrees[k] == 1):
            w = self.squares[place]
            a, b = self.parts_of(q, place, 1)
            conjugate = a - b * self.generators[place]
            above, norm = (self.put_square(each * conjugate, place, w) for each in (p, q))
            if norm.above == 0:  # x + |x| divides zero
                continue
            rest = reduced(above.above * norm.below, above.below * norm.above)
            if rest.below.is_constant() and rest.above.total_degree() < p.total_degree():
                product, same = (self.put_square(one, place, w) for one in (rest.above * q, p))
                return rest.above if product == same else None
        return None

    def put_square(self, polynomial: Polynomial, place: int, w: Quotient) -> Quotient:
        most = int(polynomial.degrees()[place]) // 2
        above = self.context.constant(0)
        for exponents, coefficient in polynomial.terms():
            half, rest = divmod(int(exponents[place]), 2)
            lower = tuple(rest if k == place else e for k, e in enumerate(exponents))
            term = self.context.term(coeff=coefficient, exp_vec=lower)
            above = above + term * w.above**half * w.below ** (most - half)
        return reduced(above, w.below**most)

    def power(self, u: Quotient, exponent: int) -> Quotient:
        if exponent < 0:
            self.need("!=", u)
            u = Quotient(u.below, u.above) if u.above != 0 else self.long(u)
        size, most = abs(exponent), max(len(u.above), len(u.below))
        if size > 4096 or (
            most > 1 and (size > 64 or math.comb(size + most - 1, size) > 40 * MAX_TERMS)
        ):
            return self.long(u)
        return self.without_squares(self.shortened(Quotient(u.above**size, u.below**size), u))

    def elementary(self, name: str, u: Quotient) -> Quotient:
        if self.apart and name in ("sin", "cos") and len(terms := self.angles(u)) > 1:
            next(self.entries, None)  # the plan has one for the sum, and none for its terms
            entries, self.entries = self.entries, iter(())
            sine, cosine = self.of_sum(terms)
            self.entries = entries
            return sine if name == "sin" else cosine
        if name == "atan" and self.question.halves:
            for _ in range(2):  # log(1 + u^2), and its half
                next(self.entries, None)
        entry = next(self.entries, Entry())
        pieces = list(self.pieces(">", u)) if name == "log" else []
        # Zeros matter where a root remains.
        self.needs |= {need: None for need in pieces if need.kind == ">"}
        here = self.needs_of(u) | frozenset(pieces)
        if entry.pair:
            self.pairs[entry.pair] = here
            if name == "atan":
                self.arguments[entry.pair] = u
        elif name == "atan" and self.is_related(entry, u):
            for needs in (here, *(self.pairs[j] for j, _ in entry.parts if j in self.pairs)):
                self.cut |= needs_in_order(needs)
        if name == "exp":
            return self.exponential(u)
        turned = name in ("sin", "cos", "atan") and self.is_negative(u)
        u = Quotient(-u.above, u.below) if turned else u
        place = self.letter(f"{name}({self.text(u)})", here)
        if name in ("sin", "cos"):
            self.bounded.add(place)
            self.circular[place] = name, u
            arctangent = self.single(u.above) if u.below.is_constant() else None
            if (
                name == "cos"
                and arctangent
                and arctangent.place in self.odd
                and abs(arctangent.factor) <= 1
            ):
                self.positive.add(place)
        if name in ("log", "atan"):
            (self.logarithms if name == "log" else self.odd)[place] = u
        value = Quotient(self.generators[place], self.one)
        return Quotient(-value.above, self.one) if turned and name != "cos" else value

    def is_related(self, entry: Entry, u: Quotient) -> bool:
        """Whether atan u is a combination of others, not one of them again."""
        again = len(entry.parts) == 1 and self.arguments.get(entry.parts[0][0]) == u
        return any(j in self.pairs for j, _ in entry.parts) and not again

    def angles(self, u: Quotient) -> list[Quotient]:
        """The terms of a sum, and k times the n-th part of one with k/n in it."""
        if not u.below.is_constant():
            return [u]
        found = list[Quotient]()
        for exponents, coefficient in u.above.terms():
            c = fmpq(coefficient) / u.below.leading_coefficient()
            times = abs(int(c.p)) if abs(c.p) <= MAX_MULTIPLE else 1
            term = self.context.term(coeff=c / times, exp_vec=exponents)
            found += [Quotient(term, self.one)] * times
        return found

    def of_sum(self, terms: Sequence[Quotient]) -> tuple[Quotient, Quotient]:
        """(sin u, cos u) by the addition theorems for the sum u of these terms."""
        sine, cosine = Quotient(self.context.constant(0), self.one), Quotient(self.one, self.one)
        for term in terms:
            s, c = self.elementary("sin", term), self.elementary("cos", term)
            pairs = ((sine, c), (cosine, s), (cosine, c), (sine, s))
            a, b, d, e = (self.multiply(left, right) for left, right in pairs)
            sine, cosine = self.add([a, b]), self.add([d, e], [1, -1])
        return sine, cosine

    def function(
        self,
        name: str,
        orders: Sequence[int],
        arguments: list[Quotient],
        within: Sequence[Quotient] = (),
    ) -> Quotient:
        """A derivative of a function, analytic where the arguments and the quotients in `within`
        are.
        """
        listed = ", ".join(map(self.text, arguments))
        primes = "'" * orders[0] if len(orders) == 1 else str([*orders]) if any(orders) else ""
        inner = frozenset().union(*map(self.needs_of, [*arguments, *within]))
        place = self.letter(f"{name}{primes.replace(' ', '')}({listed})", inner)
        return Quotient(self.generators[place], self.one)

    def special(self, name: str, arguments: list[Quotient], order: Order) -> Quotient:
        """A special function, which is analytic where it is real."""
        laws_of(self, name, arguments[-1])
        if not is_real_everywhere(name, order):
            text = read_tokens(SPECIAL[name].positive, name)
            self.need(">", value_of(self, text, u=arguments[-1]))
        return self.function(name, (), arguments)

    def integral(self, name: str, orders: list[int], arguments: list[Quotient]) -> Quotient:
        known = self.question.integrals[name]
        bound = known.bound(name, orders, arguments)
        slopes = read_formulas(self, known.slopes.values(), **bound)
        return self.function(name, (), arguments, slopes)

    # Helpers of the ring operations.

    def exponential(self, u: Quotient) -> Quotient:
        """e^(a log w + rest): w^a for each logarithm with a rational factor."""
        value, rest = Quotient(self.one, self.one), u
        if u.below.is_constant():
            scale, kept = fmpq(1) / u.below.leading_coefficient(), self.context.constant(0)
            for exponents, coefficient in u.above.terms():
                place = next((k for k, e in enumerate(exponents) if e), -1)
                if sum(map(int, exponents)) == 1 and place in self.logarithms:
                    a = coefficient * scale
                    power = self.root(self.logarithms[place], Fraction(int(a.p), int(a.q)))
                    value = self.multiply(value, power)
                else:
                    kept += self.context.term(coeff=coefficient, exp_vec=exponents)
            rest = Quotient(kept * scale, self.one)
        if rest.above == 0:
            return value
        turned = self.is_negative(rest)
        rest = Quotient(-rest.above, rest.below) if turned else rest
        coefficients = [c for _, c in rest.above.terms()]
        times = math.gcd(*(int(c.p) for c in coefficients)) if rest.below.is_constant() else 1
        times = times if times <= 64 else 1
        rest = Quotient(rest.above / times, rest.below)
        place = self.letter(f"exp({self.text(rest)})", self.needs_of(rest))
        self.positive.add(place)
        self.exponentials[place] = rest
        letter = self.generators[place] ** times
        power = Quotient(self.one, letter) if turned else Quotient(letter, self.one)
        return self.multiply(value, power)

    def root(self, w: Quotient, a: Fraction) -> Quotient:
        """w^a: p^(k a) for the factors p^k of w that need no root, an integer power of the product
        r of the others, and a power of r between 0 and 1.
        """
        above, below = self.factors(w.above), self.factors(w.below)
        factors = [*above.listed, *((p, -k) for p, k in below.listed)]
        all_even = all((k * a) % 2 == 0 for _, k in factors)
        value = Quotient(self.one, self.one)
        over, under = self.context.constant(above.content), self.context.constant(below.content)
        if all_even and above.content * below.content < 0:
            over = -over  # |c|^a times squares
        for p, k in factors:
            if self.needs_no_root(p, k, a, all_even):
                value = self.multiply(value, self.power(Quotient(p, self.one), int(k * a)))
            elif k > 0:
                over = over * p**k
            else:
                under = under * p**-k
        rest, whole = reduced(over, under), math.floor(a)
        value = self.multiply(value, self.power(rest, whole)) if whole else value
        if a == whole or (rest.above == 1 and rest.below == 1):
            return value
        return self.multiply(value, self.proper_power(rest, a - whole))

    def needs_no_root(self, p: Polynomial, k: int, a: Fraction, all_even: bool) -> bool:
        """Whether (p^k)^a is p^(k a): if this is an integer power, and p is positive, or k and k a
        are even; or if the factors of the whole radicand are `all_even` powers.
        """
        if (k * a).denominator > 1:
            return False
        simple = self.single(p)
        is_positive = simple is not None and simple.place in self.positive
        return is_positive or all_even or (k % 2 == 0 and (k * a) % 2 == 0)

    def proper_power(self, w: Quotient, a: Fraction) -> Quotient:
        """w^a for 0 < a < 1: a rational number, or a letter, which is positive."""
        inner = self.text(w)
        if w.above.is_constant() and w.below == 1:
            number, degree = w.above.leading_coefficient(), a.denominator
            over, under = number.p.root(degree), number.q.root(degree)
            if fmpq(over, under) ** degree == number:
                return self.constant(Fraction(int(over), int(under)) ** a.numerator)
        text = f"sqrt({inner})" if a == Fraction(1, 2) else f"({inner})^({a})"
        place = self.letter(text, self.needs_of(w) | frozenset(self.pieces(">", w)))
        self.positive.add(place)
        if a == Fraction(1, 2):
            self.squares[place] = w
        return Quotient(self.generators[place], self.one)

    def letter(self, text: str, inner: frozenset[Need]) -> int:
        if text not in self.places:
            if len(self.texts) == self.size:
                raise TooManyLetters
            self.places[text] = len(self.texts)
            self.inner[len(self.texts)] = inner
            self.texts.append(text)
        return self.places[text]

    def long(self, *parts: Quotient) -> Quotient:
        """A generator for a formula of these parts, analytic where the parts are."""
        inner = frozenset().union(*map(self.needs_of, parts))
        return Quotient(self.generators[self.letter(f"{LONG}{len(self.texts)}", inner)], self.one)

    def shortened(self, u: Quotient, *parts: Quotient) -> Quotient:
        return self.long(*parts) if max(map(len, u)) > MAX_TERMS else u

    def is_negative(self, u: Quotient) -> bool:
        return bool(u.above != 0) and bool(
            u.above.leading_coefficient() * u.below.leading_coefficient() < 0
        )

    def parts_of(self, polynomial: Polynomial, place: int, degree: int) -> list[Polynomial]:
        """The coefficients of the powers of the generator at `place`."""
        parts = [self.context.constant(0)] * (degree + 1)
        for exponents, coefficient in polynomial.terms():
            lower = tuple(0 if j == place else e for j, e in enumerate(exponents))
            parts[int(exponents[place])] += self.context.term(coeff=coefficient, exp_vec=lower)
        return parts

    def single(self, polynomial: Polynomial) -> Multiple | None:
        """The factor and place if the polynomial is a number times one generator, else None."""
        if len(polynomial) != 1 or polynomial.total_degree() != 1:
            return None
        (place,) = self.holds(polynomial)
        return Multiple(place, polynomial.leading_coefficient())

    def holds(self, polynomial: Polynomial) -> list[int]:
        """The generators that occur, by place."""
        return [k for k, e in enumerate(polynomial.degrees()) if e > 0]

    def needs_of(self, u: Quotient) -> frozenset[Need]:
        """Where u is analytic: its poles, and the conditions of its generators."""
        found = {need_of("!=", p) for p, _ in self.factors(u.below).listed}
        for polynomial in (u.above, u.below):
            found |= {need for k in self.holds(polynomial) for need in self.inner.get(k, ())}
        return frozenset(found)

    def need(self, kind: str, u: Quotient) -> frozenset[Need]:
        found = dict.fromkeys(self.pieces(kind, u))
        self.needs |= found
        return frozenset(found)

    def pieces(self, kind: str, u: Quotient) -> Iterator[Need]:
        """The needs, by factors, that u > 0 or u != 0.

        Factors of even multiplicity must be nonzero, and the product of the others positive. A
        condition that is never true gives 0 != 0, 0 > 0, or -1 > 0.
        """
        (content, above), (other, below) = map(self.plain_factors, (u.above, u.below))
        if content == 0:
            yield need_of(kind, self.context.constant(0))
            return
        if kind == "!=":
            yield from (need_of("!=", p) for p, _ in above)
            return
        odd = self.context.constant(1 if content * other > 0 else -1)
        for p, k in (*above, *below):
            if k % 2:
                odd = odd * p
            else:
                yield need_of("!=", p)
        if not odd.is_constant() or odd.leading_coefficient() < 0:
            yield need_of(">", odd)

    def plain_factors(self, polynomial: Polynomial) -> Factors:
        """The factors: sin^2 + cos^2 = 1 reduces those of odd multiplicity, and e^u - 1 gets a
        simple one.
        """
        forms = map(self.factors, [polynomial, *self.circled(polynomial)])
        content, found = min(forms, key=Factors.size)
        plain = list[tuple[Polynomial, int]]()
        for p, k in found:
            same = self.same_sign(p)
            own = Factors(fmpq(1), [(p, 1)]) if same is None else self.plain_factors(same)
            content *= own.content if k % 2 else abs(own.content)
            plain += [(q, k * j) for q, j in own.listed]
        return Factors(content, plain)

    def same_sign(self, p: Polynomial) -> Polynomial | None:
        """A polynomial with the same sign and fewer functions, or None."""
        letters = self.holds(p)
        if len(letters) != 1 or p.total_degree() != 1:
            return None
        (place,), (factor, *constant) = letters, (coefficient for _, coefficient in p.terms())
        sign = 1 if factor > 0 else -1
        if not constant and place in self.odd:
            return self.odd[place].above * self.odd[place].below * sign
        if not constant and place in self.logarithms:
            u = self.logarithms[place]
            return (u.above - u.below) * u.below * sign
        if constant == [-factor] and place in self.exponentials:
            return self.exponentials[place].above * self.exponentials[place].below * sign
        return None

    def circled(
        self, polynomial: Polynomial, partners: Literal["added", "known"] = "added"
    ) -> Iterator[Polynomial]:
        """The polynomial with 1 - cos(u)^2 for sin(u)^2, and vice versa.

        With known `partners`, only if both are already generators.
        """
        for here, there in (("sin", "cos"), ("cos", "sin")):
            form = polynomial
            for place, (name, u) in list(self.circular.items()):
                if name != here or form.degrees()[place] < 2:
                    continue
                text = f"{there}({self.text(u)})"
                if partners == "added" or text in self.places:
                    other = self.letter(text, self.inner[place])
                    self.bounded.add(other)
                    self.circular[other] = there, u
                    square = Quotient(1 - self.generators[other] ** 2, self.one)
                    form = self.put_square(form, place, square).above
            if form != polynomial:
                yield form

    def factors(self, polynomial: Polynomial) -> Factors:
        if (key := str(polynomial)) not in self.known:
            content, found = fmpq(0), list[tuple[Polynomial, int]]()
            if polynomial.is_constant():
                content = polynomial.leading_coefficient() if polynomial != 0 else fmpq(0)
            else:
                content, listed = factored(polynomial)
                for p, k in listed:
                    head = p.leading_coefficient()
                    content, found = content * head ** int(k), [*found, (p / head, int(k))]
            self.known[key] = Factors(content, found)
        return self.known[key]

    def text(self, u: Quotient | Polynomial) -> str:
        """The value in the grammar of certificates."""
        if isinstance(u, Quotient):
            above = self.text(u.above)
            return above if u.below == 1 else f"({above})/({self.text(u.below)})"
        return polynomial_text(u.terms(), self.texts)


def factored(polynomial: Polynomial) -> Factors:
    """flint's content and factors, found among the letters that occur: 0.1 ms for 6 of 600, of
    which all together take 0.1 s.
    """
    whole, used = polynomial.context(), [k for k, e in enumerate(polynomial.degrees()) if e]
    small = fmpq_mpoly_ctx.get([f"z{k}" for k in range(len(used))], whole.ordering())
    places = dict(enumerate(used))
    turned = {place: k for k, place in places.items()}
    content, listed = polynomial.project_to_context(small, turned).factor()
    return Factors(content, [(p.project_to_context(whole, places), int(k)) for p, k in listed])


class Knowledge:
    """The signs of irreducible polynomials and their products that follow from needs."""

    def __init__(self, ring: Letters, needs: Iterable[Need] = ()) -> None:
        self.ring = ring
        self.nonzero, self.signs = dict[str, Polynomial](), dict[str, int]()
        self.wholes, self.found = list[Polynomial](), dict[tuple[str, int], int]()
        self.products = list[tuple[int, dict[str, Polynomial]]]()  # by text
        self.letters = list[set[int]]()  # generators of each nonzero polynomial
        for need in needs:
            self.learn(need)

    def learn(self, need: Need) -> None:
        one = self.lesson(need)
        self.nonzero |= one.nonzero
        self.letters += one.letters
        if need.kind == ">" and one.is_moving:
            if len(one.odd) == 1:
                self.signs |= dict.fromkeys(one.odd, one.sign)
            self.products.append((one.sign, one.odd))
            self.wholes.append(need.polynomial)

    def lesson(self, need: Need) -> Lesson:
        """What a need says in this ring."""
        key, known = (need.text, len(self.ring.texts)), self.ring.lessons
        if key not in known:
            content, found = self.ring.factors(need.polynomial)
            forms = (form for p, _ in found for form in self.forms(p))
            nonzero = {str(q): q for form in forms for q in form}
            odd = {str(p): p for p, k in found if k % 2}
            letters = [{*self.ring.holds(q)} for q in nonzero.values()]
            known[key] = Lesson(nonzero, letters, odd, 1 if content > 0 else -1, bool(found))
        return known[key]

    def implies(self, need: Need) -> bool:
        content, found = self.ring.factors(need.polynomial)
        if need.kind == "!=":
            return content != 0 and all(self.never_zero(p) for p, _ in found)
        return self.sign(need.polynomial) > 0

    def never_zero(self, p: Polynomial) -> bool:
        """Whether all factors of one of its forms are nonzero wherever the needs are true."""
        return any(
            all(str(q) in self.nonzero or self.sign(q) or self.by_division(q) for q in form)
            for form in self.forms(p)
        )

    def by_division(self, p: Polynomial) -> bool:
        """Whether p is a product of nonzero polynomials modulo sqrt(w)^2 = w."""
        for q in self.nonzero.values():
            rest = self.ring.divided(p, q)
            if rest is not None:
                return rest.is_constant() or self.never_zero(rest)
        return False

    def forms(self, p: Polynomial) -> Iterator[list[Polynomial]]:
        """The factors of each distinct form of p by sin^2 + cos^2 = 1; they are nonzero where p is.

        For a sine, these are the factors of 1 - cos^2.
        """
        single = self.ring.single(p)
        same = p if single is None else p**2
        for form in (p, *self.ring.circled(same, partners="known")):
            yield [q for q, _ in self.ring.factors(form).listed]

    def sign(self, polynomial: Polynomial, depth: int = 3) -> int:
        """1 or -1 if the polynomial has this sign wherever the needs are true.

        0 if the sign is unknown.
        """
        content, found = self.ring.factors(polynomial)
        if content == 0:
            return 0
        sign, left = 1 if content > 0 else -1, list[Polynomial]()
        if own := self.beyond(polynomial):
            return own
        for p, k in found:
            if k % 2 == 0:
                if str(p) not in self.nonzero and not self.irreducible(p, depth):
                    return 0
            elif own := self.irreducible(p, depth):
                sign *= own
            else:
                left.append(p)
        if not left:
            return sign
        names = {str(p) for p in left}
        for own, odd in self.products:
            rest = [p for text, p in odd.items() if text not in names]
            if len(rest) + len(left) == len(odd):
                signs = [self.irreducible(p, depth) for p in rest]
                if all(signs):
                    return sign * own * math.prod(signs)
        return 0

    def beyond(self, p: Polynomial) -> int:
        """The sign of a multiple of what is positive, and of a constant with the same sign."""
        for q in self.wholes:  # q is positive, or negative if its coefficient is
            if abs(len(p) - len(q)) > 1:
                continue
            rest = p / p.leading_coefficient() - q / q.leading_coefficient()
            own = 1 if q.leading_coefficient() > 0 else -1
            if rest.is_constant() and (rest == 0 or rest.leading_coefficient() * own > 0):
                return own if p.leading_coefficient() > 0 else -own
        return 0

    def irreducible(self, p: Polynomial, depth: int) -> int:
        text = str(p)
        if (known := self.signs.get(text)) is not None:
            return known
        self.ring.question.check_time()
        if (key := (text, depth)) not in self.found:
            beside = self.letters and self.is_beside(p)
            way = self.ring.plain.irreducible if beside else self.sign_of
            self.found[key] = way(p, depth)
        return self.found[key]

    def is_beside(self, p: Polynomial) -> bool:
        """Whether no need restricts p: p has no functions, and each need has two other generators.

        Its sign can be derived only from needs with generators of p, and one more if a need is p
        plus terms in that generator.
        """
        own = {*self.ring.holds(p)}
        names = max(own, default=0) <= len(self.ring.question.names)
        return names and all(len(letters - own) > 1 for letters in self.letters)

    def sign_of(self, p: Polynomial, depth: int) -> int:
        same = self.ring.same_sign(p)
        if same is not None and depth > 0 and (sign := self.sign(same, depth - 1)):
            return sign
        if (sign := self.beyond(p) or self.by_terms(p)) or depth < 1:
            return sign
        ways = (self.by_numbers, self.by_roots, self.by_squares, self.by_larger, self.by_circle,
                self.by_quarter)  # fmt: skip
        return next(filter(None, (way(p, depth) for way in ways)), 0)

    def by_larger(self, p: Polynomial, depth: int) -> int:
        """a r + b with r = sqrt(w) has the sign of a if a^2 w > b^2, and that of b if a^2 w < b^2."""
        degrees = p.degrees()
        for k in (k for k in self.ring.holds(p) if k in self.ring.squares and degrees[k] == 1):
            (b, a), w = self.ring.parts_of(p, k, 1), self.ring.squares[k]
            larger = self.sign(w.below * (a * a * w.above - b * b * w.below), depth - 1)
            if larger and (sign := self.sign(a if larger > 0 else b, depth - 1)):
                return sign
        return 0

    def by_circle(self, p: Polynomial, depth: int) -> int:
        """The sign by sin^2 + cos^2 = 1."""
        signs = (self.sign(form, depth - 1) for form in self.ring.circled(p, partners="known"))
        return next(filter(None, signs), 0)

    def by_quarter(self, p: Polynomial, depth: int) -> int:
        """The signs of sin u and cos u between two of their zeros."""
        simple = self.ring.single(p)
        if simple is None or simple.place not in self.ring.circular:
            return 0
        name, u = self.ring.circular[simple.place]
        pi, half = self.ring.generators[0], fmpq(0 if name == "sin" else -1, 2)
        for k in range(-2, 3):
            low = u.above - (k + half) * pi * u.below
            high = (k + 1 + half) * pi * u.below - u.above
            if self.sign(low * u.below, depth - 1) > 0 and self.sign(high * u.below, depth - 1) > 0:
                return -1 if k % 2 else 1
        return 0

    def by_terms(self, p: Polynomial) -> int:
        """The common weak sign of all terms, if their bounds exclude 0."""
        terms = [([(k, int(e)) for k, e in enumerate(exponents) if e], coefficient)
                 for exponents, coefficient in p.terms()]  # fmt: skip
        for side in (1, -1):
            least, strict, weak = fmpq(0), False, True
            for held, coefficient in terms:
                c, strictly, free = coefficient * side, True, True
                for k, e in held:
                    known = 1 if k in self.ring.positive else self.signs.get(f"z{k}", 0)
                    if e % 2 and not known:
                        free = False
                    elif e % 2:
                        c *= known
                    strictly = strictly and (bool(known) or f"z{k}" in self.nonzero)
                if free and c > 0:
                    strict = strict or (strictly and bool(held))
                    least = least + (0 if held else c)
                elif all(k in self.ring.bounded for k, _ in held):
                    least -= abs(c)
                else:
                    weak = False
            if weak and (least > 0 or (least == 0 and strict)):
                return side
        return 0

    def by_numbers(self, p: Polynomial, depth: int) -> int:
        """The sign of a polynomial in square roots of numbers, by rational bounds for these."""
        bounds = dict[int, tuple[fmpq, fmpq]]()
        for k in self.ring.holds(p):
            w = self.ring.squares.get(k)
            if w is None or not (w.above.is_constant() and w.below.is_constant()):
                return 0
            square = fmpq(w.above.leading_coefficient()) / w.below.leading_coefficient()
            if square < 0:
                return 0
            least = math.isqrt(int((square * SCALE**2).floor()))
            bounds[k] = fmpq(least, SCALE), fmpq(least + 1, SCALE)
        low, high = fmpq(0), fmpq(0)
        for exponents, coefficient in p.terms():
            ends = [fmpq(coefficient)] * 2
            for k, e in enumerate(map(int, exponents)):
                ends = [end * bounds[k][side] ** e if e else end for side, end in enumerate(ends)]
            low, high = low + min(ends), high + max(ends)
        return 1 if low > 0 else -1 if high < 0 else 0

    def by_roots(self, p: Polynomial, depth: int) -> int:
        """The sign of a polynomial in one generator without real roots."""
        if len(self.ring.holds(p)) != 1 or p.total_degree() > 40 or has_real_zeros(p):
            return 0
        return 1 if p.leading_coefficient() > 0 else -1

    def by_squares(self, p: Polynomial, depth: int) -> int:
        """a z^2 + b z + c has the sign of a if 4 a c - b^2 > 0.

        For a number a and a name z that no need contains, p has a sign only if that is true, so one
        such z suffices.
        """
        degrees = p.degrees()
        for k in (k for k in self.ring.holds(p) if degrees[k] == 2):
            c, b, a = self.ring.parts_of(p, k, 2)
            if (sign := self.sign(a, depth - 1)) and self.sign(4 * a * c - b * b, depth - 1) > 0:
                return sign
            if a.is_constant() and self.is_free(k):
                break
        return 0

    def is_free(self, k: int) -> bool:
        """Whether the generator is a name that no need contains."""
        return 0 < k <= len(self.ring.question.names) and not any(k in one for one in self.letters)


def in_letters(question: Question, work: Callable[[Letters], T]) -> T:
    """The result of the work in a ring with enough generators."""
    size = SPARE + 2 * len(question.plan.pairs)  # a letter for a root, and one for its logarithm
    while True:
        try:
            return work(Letters(question, size))
        except TooManyLetters:
            size *= 2
            if size > MAX_LETTERS:
                raise Incomplete(
                    "The formulas contain too many functions to determine where they are defined."
                ) from None


def cells_of(question: Question, by_theorem: bool = False) -> tuple[Cell, Cell]:
    """Where the verdict of a confirmed claim is valid, and where its formulas are.

    Both are the same unless a theorem about f alone gives the verdict, which is then valid wherever
    f is analytic. The set keeps the sides on which the relations between the formulas are true,
    because other relations are true beyond them.
    """
    return in_letters(question, lambda ring: _cells_in(ring, question, by_theorem))


def _cells_in(ring: Letters, question: Question, by_theorem: bool) -> tuple[Cell, Cell]:
    collect_needs(ring, question.read_all(ring))
    forces, hints = [*ring.needs], list[Need]()
    collect_needs(ring, question.read(ring))
    ring.entries = iter(())
    for pair in question.conditions:
        value = ring.add([value_of(ring, one) for one in pair], [1, -1])
        hints += ring.pieces(">", value)
    for _, said in () if question.rational else question.roots:
        hints += [need for need in ring.pieces(">", value_of(ring, said)) if need.kind == ">"]
    cut = signed(question, ring, ring.needs if question.partly else ring.cut)
    sides = strongest(ring, [*hints, *cut])

    def cell(needs: Iterable[Need]) -> Cell:
        kept = strongest(ring, [*hints, *cut, *needs])
        # A nonzero condition may imply that a cut is positive, and have disconnected parts.
        inside = [need for need in (*hints, *cut, *needs) if need.kind == ">"] if cut else []
        one_side = not all(is_convex(ring, need.polynomial) for need in strongest(ring, inside))
        domain = need_texts(ring, kept)
        return Cell(domain, need_texts(ring, sides), one_side, any(LONG in text for text in domain))

    formulas = cell(ring.needs)
    return (cell(forces) if by_theorem else formulas), formulas


def collect_needs(ring: Letters, found: Any) -> None:
    """Add the conditions of all values in nested lists to the ring."""
    for value in values_in(found):
        ring.needs |= needs_in_order(ring.needs_of(value))


def values_in(found: Any) -> Iterator[Quotient]:
    """All values in nested lists."""
    if isinstance(found, Quotient):
        yield found
    elif isinstance(found, list | tuple | dict):
        for one in found.values() if isinstance(found, dict) else found:
            yield from values_in(one)


def need_texts(ring: Letters, needs: Iterable[Need]) -> tuple[str, ...]:
    return tuple(f"{ring.text(primitive(need.polynomial))} {need.kind} 0" for need in needs)


def signed(question: Question, ring: Letters, needs: Iterable[Need]) -> list[Need]:
    """The polynomials that must keep the sign that they have at P."""
    found, plain = list[Need](), Knowledge(ring)
    for need in needs:
        if plain.sign(need.polynomial):
            continue
        if need.kind == ">":
            found.append(need)
            continue
        text = ring.text(need.polynomial)
        if LONG in text:
            raise Incomplete("A formula is too long to determine on which side it holds.")
        tokens = read_tokens(text, "cell")

        def positive(expansion: Any, tokens: tuple[str, ...] = tokens) -> bool:
            value = value_of(expansion, tokens).get(0, 0)
            return bool(
                expansion.arithmetic.nonzero(expansion.arithmetic.number(Fraction(0)) + value) > 0
            )

        found.append(
            need_of(">", need.polynomial if question.in_balls(0, positive) else -need.polynomial)
        )
    return found


def strongest(ring: Letters, needs: Sequence[Need]) -> list[Need]:
    """The needs that do not follow from the others, without factors whose signs do."""
    plain = Knowledge(ring)
    kept = [need for need in dict.fromkeys(needs) if not plain.implies(need)]
    less = fewer(ring, kept)
    return less if less == kept else fewer(ring, less)


def fewer(ring: Letters, kept: list[Need]) -> list[Need]:
    for need in sorted(
        kept, key=lambda one: (len(one.polynomial), one.kind == ">", one.text), reverse=True
    ):
        rest = [one for one in kept if one is not need]
        known = Knowledge(ring, rest)
        kept = (
            rest
            if known.implies(need)
            else [smaller(known, one) if one is need else one for one in kept]
        )
    return kept


def smaller(known: Knowledge, need: Need) -> Need:
    """The need without factors of known signs; a + b sqrt(w) > 0 becomes a > 0 if a^2 > b^2 w."""
    ring = known.ring
    (content, found), left = ring.factors(need.polynomial), ring.one
    sign = 1 if content > 0 else -1
    for p, k in found:
        own = known.irreducible(p, 3) if k % 2 else 1
        sign *= own or 1
        left = left if own else left * p
    for place, w in ring.squares.items() if need.kind == ">" else ():
        if left.degrees()[place] == 1:
            a, b = ring.parts_of(left, place, 1)
            if known.sign(w.below * (a * a * w.below - b * b * w.above)) > 0:
                left = a
    return need_of(need.kind, left * sign) if not left.is_constant() else need


def is_convex(ring: Letters, polynomial: Polynomial) -> bool:
    """Whether the set where the polynomial is positive is convex by its form.

    The form is affine in the names, minus squares of names.
    """
    shapes = [([e for e in map(int, exponents) if e], c) for exponents, c in polynomial.terms()]
    plain = all(sum(shape) <= 1 or (shape == [2] and c < 0) for shape, c in shapes)
    return plain and all(k < len(ring.question.names) + 1 for k in ring.holds(polynomial))


def where_regular(
    question: Question, read_matrix: Callable[[Letters], list[list[Quotient]]]
) -> Cell:
    """The cell on which the entries of a square matrix are defined and the matrix is regular.

    Conditions on parameters alone are dropped, because parameters are generic.
    """
    moving = {"t", *question.coordinates, *(f"{name}'" for name in question.coordinates)}

    def work(ring: Letters) -> Cell:
        ring.entries = iter(())
        matrix = read_matrix(ring)
        found = [
            need for row in matrix for one in row for need in needs_in_order(ring.needs_of(one))
        ]
        factors = ring.plain_factors(determinant(ring, matrix).above).listed
        found += [need_of("!=", factor) for factor, _ in factors]
        if any(LONG in text for text in need_texts(ring, found)):
            return Cell(unknown=True)
        texts = [(need, read_tokens(ring.text(need.polynomial), "cell")) for need in found]
        kept = [need for need, tokens in texts if not moving.isdisjoint(tokens)]
        return Cell(need_texts(ring, strongest(ring, kept)))

    return in_letters(question, work)


def sides_of(question: Question, read: Callable[[Letters], Any]) -> Cell:
    """The sides of the poles of related arctangents on which P lies, where their relations are
    those used at P.

    `read` reads the formulas in the order in which the plan of the question was made.
    """
    if question.rational or not question.tape.met & {"atan", "integral"}:
        return Cell()

    def work(ring: Letters) -> Cell:
        read(ring)
        sides = need_texts(ring, strongest(ring, signed(question, ring, ring.cut)))
        return Cell(sides, sides, bool(sides), any(LONG in text for text in sides))

    return in_letters(question, work)


def determinant(ring: Letters, matrix: list[list[Quotient]]) -> Quotient:
    """The determinant by elimination in the field of quotients, with short pivots first."""
    rows, value = [[*row] for row in matrix], Quotient(ring.one, ring.one)
    while rows:
        sizes = [(len(entry.above) + len(entry.below), i, j) for i, row in enumerate(rows)
                 for j, entry in enumerate(row) if entry.above != 0]  # fmt: skip
        if not sizes:
            return ring.constant(Fraction(0))
        _, i, j = min(sizes)
        pivot_row = rows.pop(i)
        pivot = pivot_row.pop(j)
        value, inverse = ring.multiply(value, pivot), Quotient(pivot.below, pivot.above)
        for row in rows:
            factor = ring.multiply(row.pop(j), inverse)
            if factor.above != 0:
                products = [ring.multiply(factor, entry) for entry in pivot_row]
                pairs = zip(row, products, strict=True)
                row[:] = [ring.add([*pair], [1, -1]) for pair in pairs]
    return value


def lacking(question: Question, stated: Sequence[str], cell: Cell) -> tuple[list[str], list[int]]:
    """The conditions of the cell that do not follow from a stated domain.

    Also the indices of the stated conditions that do not follow from the cell. A condition that
    does not follow with the angles as written may follow after sines and cosines of sums are
    expanded.
    """

    def work(ring: Letters, apart: bool) -> tuple[list[str], list[int]]:
        ring.entries, ring.apart = iter(()), apart
        velocities = zip(question.bound, question.force_texts[len(question.free) :], strict=True)
        rates = {name + "'": value_of(ring, text) for name, text in velocities}
        own, said = ([[*needs_of_text(ring, text, rates)] for text in listed]
                     for listed in (cell.domain, stated))  # fmt: skip
        known, proven = (Knowledge(ring, chain.from_iterable(some)) for some in (said, own))
        pairs = zip(cell.domain, own, strict=True)
        missing = [text for text, needs in pairs if not all(map(known.implies, needs))]
        beyond = [k for k, needs in enumerate(said) if not all(map(proven.implies, needs))]
        return missing, beyond

    missing, beyond = in_letters(question, lambda ring: work(ring, apart=False))
    if not missing and not beyond:
        return missing, beyond
    left, further = in_letters(question, lambda ring: work(ring, apart=True))
    return [text for text in missing if text in left], [k for k in beyond if k in further]


def needs_of_text(
    ring: Letters, text: str, bound: dict[str, Quotient] | None = None
) -> Iterator[Need]:
    """The needs of A > B, A < B, A != B, or a chain of < or >; `bound` gives the values of other
    names.
    """
    for kind in ("!=", "<", ">"):
        sides = text.split(kind)
        if len(sides) > 1:
            tokens = [read_tokens(side, "domain") for side in sides]
            weights = [-1, 1] if kind == "<" else [1, -1]
            for pair in pairwise(read_formulas(ring, tokens, **(bound or {}))):
                difference = ring.add([*pair], weights)
                yield from ring.pieces("!=" if kind == "!=" else ">", difference)
            return
    raise Ended("invalid", "A domain is a list of inequalities A > B, A < B, A != B.")
