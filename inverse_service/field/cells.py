"""What inequalities between trees imply, and the shortest list of inequalities for one set.

A tree becomes an element of the exact field whose generators are names, and roots and functions of
elements, all treated as independent. It is analytic where its denominators are nonzero, and where
what is under its roots and logarithms is positive (`Need`); all of these are factored. The signs of
polynomials follow from needs by rules (`Knowledge`), most of which are true for any values of the
generators; the others use sin^2 + cos^2 = 1, the ranges of sin, cos and atan, and e^u > 0.

The checker (`certificate.cell`) finds by itself, from the text of a certificate, where a claim
holds: no set of this file is its set.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from flint import fmpq, fmpq_mpoly, fmpz_poly

from inverse_service.deadline import end, now
from inverse_service.expressions import functions, polynomials, printing, terms, tree as ex
from inverse_service.field import exact_field, tower as towers
from inverse_service.field.exact_field import Quotient

# Terms of one polynomial, and of all polynomials met in one deduction.
_MOST_TERMS, _MOST_WORK = 3_000, 300_000
# Seconds of one deduction; generators besides names, functions and their partners, and of all.
_LONGEST, _SPARE, _MOST_LETTERS = 1.0, 16, 600
# The largest common multiple of the exponents of an exponential that is its generator, the largest
# degree whose real roots are counted, and the steps of a deduction that lead to others.
_LARGEST_MULTIPLE, _LARGEST_DEGREE, _DEPTH = 64, 40, 3


@dataclass(frozen=True, slots=True)
class Need:
    """A polynomial in the generators that is positive (">") or not zero ("!=")."""

    kind: str
    polynomial: fmpq_mpoly = field(compare=False)
    text: str = ""  # polynomials of flint are compared by their texts


class Factors(NamedTuple):
    """A number, and irreducible monic polynomials with their multiplicities."""

    content: Fraction
    listed: list[tuple[fmpq_mpoly, int]]

    def size(self) -> tuple[int, int, int]:
        """The number of factors with odd multiplicity, of all, and of their terms."""
        odd = sum(k % 2 for _, k in self.listed)
        return odd, len(self.listed), sum(len(p) for p, _ in self.listed)


def need_of(kind: str, polynomial: fmpq_mpoly) -> Need:
    return Need(kind, polynomial, str(polynomial))


def _is_whole(exponent: ex.Expression) -> bool:
    return isinstance(exponent, ex.Number) and exponent.value.denominator == 1


@dataclass(slots=True)
class Letters(exact_field.ExactRing):
    """A ring that adjoins functions and roots on demand, with what is known of each.

    `needs` collects what the trees read so far need at their poles and logarithms. The tables are
    keyed by generators.
    """

    needs: dict[Need, None] = field(default_factory=dict)
    inner: dict[int, frozenset[Need]] = field(default_factory=dict)  # where it is analytic
    positive: set[int] = field(default_factory=set)
    bounded: set[int] = field(default_factory=set)  # between -1 and 1
    logarithms: dict[int, Quotient] = field(default_factory=dict)  # log u
    arctangents: dict[int, Quotient] = field(default_factory=dict)  # atan u, with the sign of u
    exponentials: dict[int, Quotient] = field(default_factory=dict)  # e^u
    squares: dict[int, Quotient] = field(default_factory=dict)  # sqrt(u)
    circular: dict[int, tuple[str, Quotient]] = field(default_factory=dict)  # sin u, cos u
    factored: dict[str, Factors] = field(default_factory=dict)
    plain: set[int] = field(default_factory=set)  # names, of which nothing is known by themselves
    lessons: dict[tuple[str, int], Lesson] = field(default_factory=dict)  # by text, and size
    nothing: list[Knowledge] = field(default_factory=list)  # see nothing_known

    @classmethod
    def about(cls, trees: Iterable[ex.Expression]) -> Letters:
        """A ring that has room for these trees, in kernels; TooLarge for too many functions."""
        nodes = [*ex.distinct_nodes(trees)]
        names = sum(isinstance(node, ex.Symbol | ex.Velocity | ex.Acceleration) for node in nodes)
        made = sum(
            isinstance(node, ex.Apply | ex.Arbitrary)
            or (isinstance(node, ex.Power) and not _is_whole(node.exponent))
            for node in nodes
        )
        # Each function may bring a root, and its partner sin or cos.
        size = _SPARE + names + 2 * made
        if size > _MOST_LETTERS:
            raise exact_field.TooLarge("the formulas hold too many functions")
        latest = min(end(), now() + _LONGEST)
        budget = exact_field.Budget(_MOST_TERMS, latest, _MOST_WORK)
        ring = cls(exact_field.QuotientField.with_generators(size, budget), (), size, slopes=False)
        ring.positive.add(ring.letter(ex.PI))
        return ring

    def letter(self, tree: ex.Expression, inner: frozenset[Need] = frozenset()) -> int:
        """The index of the generator for a tree whose arguments are in their normal form."""
        if tree not in self.atoms:
            index = self.new_generator(tree)
            self.atoms[tree], self.inner[index] = self.generator(index), inner
            if isinstance(tree, ex.Symbol | ex.Velocity | ex.Acceleration) and tree != ex.PI:
                self.plain.add(index)
        return self.holds(self.atoms[tree].numerator)[0]

    def nothing_known(self) -> Knowledge:
        """The knowledge of no need, which is kept."""
        if not self.nothing:
            self.nothing.append(Knowledge(self))
        return self.nothing[0]

    def value(self, tree: ex.Expression) -> Quotient:
        """The element of a tree in kernels; ZeroDivisionError or TooLarge where there is none."""
        match tree:
            case ex.Symbol() | ex.Velocity() | ex.Acceleration():
                return self.generator(self.letter(tree))
            case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
                return self.power(self.value(base), int(exponent))
            case ex.Power(base, ex.Number(exponent)):
                u = self.value(base)
                self.needs |= dict.fromkeys(n for n in self.pieces(">", u) if n.kind == ">")
                return self.root(u, exponent)
            case ex.Apply("exp", argument):
                return self.exponential(self.value(argument))
            case ex.Apply(name, argument) if name in ("log", "sin", "cos", "atan"):
                return self.elementary(name, self.value(argument))
            case ex.Arbitrary():
                return self.arbitrary(tree)
            case ex.Number() | ex.Sum() | ex.Product():
                return exact_field.ExactRing.value(self, tree)
        raise exact_field.TooLarge(f"{type(tree).__name__} is no function of the exact field")

    def power(self, u: Quotient, exponent: int) -> Quotient:
        if abs(exponent) > exact_field.LARGEST_EXPONENT:
            raise exact_field.TooLarge("the exponent of a power is too large")
        if exponent < 0:
            self.needs |= dict.fromkeys(self.pieces("!=", u))
        return u**exponent

    def arbitrary(self, node: ex.Arbitrary) -> Quotient:
        """A function that is analytic where its arguments are, with its derivatives."""
        slopes = node.derivatives if isinstance(node, ex.Integral) else ()
        arguments = [self.value(one) for one in node.arguments]
        within = [self.value(towers.to_kernels(one)) for one in slopes if one is not None]
        row = functions.FUNCTION.get(node.name) if node.name in functions.SPECIAL else None
        for tree in () if row is None else row.needs(*reversed(node.arguments)):
            needed = self.pieces(">", self.value(towers.to_kernels(tree)))
            self.needs |= dict.fromkeys(needed)
        inner = frozenset[Need]().union(*map(self.needs_of, (*arguments, *within)))
        plain = ex.Arbitrary(node.name, tuple(map(self.tree_of, arguments)), node.orders)
        return self.generator(self.letter(plain, inner))

    def elementary(self, name: str, u: Quotient) -> Quotient:
        """log u, sin u, cos u or atan u, with one generator for both signs of u."""
        pieces = [*self.pieces(">", u)] if name == "log" else []
        # Zeros matter where a root remains.
        self.needs |= dict.fromkeys(need for need in pieces if need.kind == ">")
        turned = name != "log" and self.is_negative(u)
        u = -u if turned else u
        inner = self.needs_of(u) | frozenset(pieces)
        index = self.letter(ex.Apply(name, self.tree_of(u)), inner)
        if name in ("sin", "cos"):
            self.bounded.add(index)
            self.circular[index] = name, u
            single = None if u.exponents else self.single(u.numerator)
            if name == "cos" and single and single[0] in self.arctangents and abs(single[1]) <= 1:
                self.positive.add(index)
        elif name == "log":
            self.logarithms[index] = u
        else:
            self.arctangents[index] = u
        found = self.generator(index)
        return -found if turned and name != "cos" else found

    def exponential(self, u: Quotient) -> Quotient:
        """e^(a log w + rest): w^a for each logarithm with a rational factor."""
        value, rest = self.constant(1), u
        for exponents, c in [] if u.exponents else [*u.numerator.terms()]:
            index = next((k for k, e in enumerate(exponents) if e), -1)
            if sum(map(int, exponents)) == 1 and index in self.logarithms:
                a = polynomials.as_fraction(c)
                value = value * self.root(self.logarithms[index], a)
                rest = rest - self.generator(index).scaled(a)
        if rest.is_zero:
            return value
        turned = self.is_negative(rest)
        rest = -rest if turned else rest
        numbers = map(polynomials.as_fraction, rest.numerator.coeffs())
        times = 1 if rest.exponents else math.gcd(*(c.numerator for c in numbers))
        times = times if times <= _LARGEST_MULTIPLE else 1
        rest = rest.scaled(Fraction(1, times))
        index = self.letter(ex.Apply("exp", self.tree_of(rest)), self.needs_of(rest))
        self.positive.add(index)
        self.exponentials[index] = rest
        power = self.generator(index) ** times
        return value / power if turned else value * power

    def root(self, w: Quotient, a: Fraction) -> Quotient:
        """w^a: p^(k a) for the factors p^k of w with k and k a even; the others give an integer
        power times a root.
        """
        content, found = self.factors_of(w)
        value, left = self.constant(1), self.constant(content)
        every_one = all((k * a) % 2 == 0 for _, k in found)
        if every_one and content < 0:  # then the result is |c|^a times squares
            left = -left
        for p, k in found:
            single, factor = self.single(p), Quotient(self.field, p, ())
            positive = single is not None and single[0] in self.positive
            if (k * a).denominator == 1 and (positive or every_one or (k % 2 == (k * a) % 2 == 0)):
                value = value * self.power(factor, int(k * a))
            else:
                left = left * factor**k
        whole = math.floor(a)
        part = a - whole
        value = value * self.power(left, whole) if whole else value
        number = left.constant_value
        if not part or number == 1:
            return value
        if number is not None and number > 0:
            outside, inside = terms.root_of_number(number**part.numerator, part.denominator)
            if inside == 1:
                return value.scaled(outside)
        inner = self.needs_of(left) | frozenset(self.pieces(">", left))
        index = self.letter(self.tree_of(left) ** ex.number(part), inner)
        self.positive.add(index)
        if part == Fraction(1, 2):
            self.squares[index] = left
            if not left.exponents and index not in self.field.relations:
                self.field.relate(index, 2, left.numerator)
        return value * self.generator(index)

    # What an element needs.

    def needs_of(self, u: Quotient) -> frozenset[Need]:
        """Where u is analytic: its poles, and the needs of its generators."""
        below = [self.field.denominators[place] for place, _ in u.exponents]
        found = {need_of("!=", self.monic(p)) for p in below}
        for p in (u.numerator, *below):
            found |= {need for k in self.holds(p) for need in self.inner.get(k, ())}
        return frozenset(found)

    def pieces(self, kind: str, u: Quotient) -> Iterator[Need]:
        """The needs, by factors, that u > 0 or u != 0.

        Factors of even multiplicity must be nonzero, and the product of the others positive. A need
        that is never met gives 0 != 0, 0 > 0, or -1 > 0.
        """
        content, found = self._factors_by(self.plain_factors, u)
        if not content or kind == "!=":
            yield from (need_of("!=", p) for p, k in found if k > 0)
            if not content:
                yield need_of(kind, u.numerator)
            return
        odd = self.field.context.constant(1 if content > 0 else -1)
        for p, k in found:
            if k % 2:
                odd = odd * p
            else:
                yield need_of("!=", p)
        if not odd.is_constant() or odd.leading_coefficient() < 0:
            yield need_of(">", odd)

    def factors_of(self, u: Quotient) -> Factors:
        """The factors of an element, those of the denominator with negative multiplicity."""
        return self._factors_by(self.factors, u)

    def _factors_by(self, of: Callable[[fmpq_mpoly], Factors], u: Quotient) -> Factors:
        content, found = of(u.numerator)
        for place, power in u.exponents:
            below, listed = of(self.field.denominators[place])
            content /= below**power
            found = [*found, *((p, -k * power) for p, k in listed)]
        return Factors(content, found)

    def plain_factors(self, polynomial: fmpq_mpoly) -> Factors:
        """The factors: sin^2 + cos^2 = 1 reduces those of odd multiplicity, and e^u - 1 gets a
        simple one.
        """
        forms = map(self.factors, [polynomial, *self.circled(polynomial)])
        content, found = min(forms, key=Factors.size)
        plain = list[tuple[fmpq_mpoly, int]]()
        for p, k in found:
            same = self.same_sign(p)
            own = Factors(Fraction(1), [(p, 1)]) if same is None else self.plain_factors(same)
            content *= own.content if k % 2 else abs(own.content)
            plain += [(q, k * j) for q, j in own.listed]
        return Factors(content, plain)

    def factors(self, polynomial: fmpq_mpoly) -> Factors:
        """A number, and the irreducible monic factors."""
        if (key := str(polynomial)) not in self.factored:
            self.field.budget.charge(len(polynomial))
            content, found = Fraction(0), list[tuple[fmpq_mpoly, int]]()
            if polynomial:
                content, listed = polynomials.factor_polynomial(polynomial)
                for p, k in listed:
                    content *= polynomials.as_fraction(p.leading_coefficient()) ** k
                    found.append((self.monic(p), k))
            self.factored[key] = Factors(content, found)
        return self.factored[key]

    def same_sign(self, p: fmpq_mpoly) -> fmpq_mpoly | None:
        """A polynomial with the same sign and fewer functions, or None."""
        letters = self.holds(p)
        if len(letters) != 1 or p.total_degree() != 1:
            return None
        (index,), (factor, *constant) = letters, (c for _, c in p.terms())
        sign = 1 if factor > 0 else -1
        if not constant and index in self.arctangents:
            return self.sign_form(self.arctangents[index]) * sign
        if not constant and index in self.logarithms:
            return self.sign_form(self.logarithms[index] - self.constant(1)) * sign
        if constant == [-factor] and index in self.exponentials:
            return self.sign_form(self.exponentials[index]) * sign
        return None

    def sign_form(self, u: Quotient) -> fmpq_mpoly:
        """A polynomial with the sign of u where u is defined."""
        odd = tuple((place, 1) for place, power in u.exponents if power % 2)
        return u.numerator * self.field.expand(odd)

    def circled(
        self, polynomial: fmpq_mpoly, partners: Literal["added", "known"] = "added"
    ) -> Iterator[fmpq_mpoly]:
        """The polynomial with 1 - cos(u)^2 for sin(u)^2, and vice versa; with known `partners`
        only where both are generators already.
        """
        for here, there in (("sin", "cos"), ("cos", "sin")):
            form = polynomial
            for index, (name, u) in [*self.circular.items()]:
                if name != here or form.degrees()[index] < 2:
                    continue
                partner = ex.Apply(there, self.tree_of(u))
                if partners == "known" and partner not in self.atoms:
                    continue
                other = self.letter(partner, self.inner[index])
                self.bounded.add(other)
                self.circular[other] = there, u
                z, w = self.field.context.gen(index), self.field.context.gen(other)
                form = (
                    form % (z**2 + w**2 - 1) if index < other else _lowered(form, index, 1 - w**2)
                )
            if form != polynomial:
                yield form

    # Polynomials.

    def holds(self, polynomial: fmpq_mpoly) -> list[int]:
        """The generators that occur."""
        return [k for k, e in enumerate(polynomial.degrees()) if e > 0]

    def single(self, polynomial: fmpq_mpoly) -> tuple[int, Fraction] | None:
        """(index, factor) if the polynomial is a number times one generator, else None."""
        if len(polynomial) != 1 or polynomial.total_degree() != 1:
            return None
        return self.holds(polynomial)[0], polynomials.as_fraction(polynomial.leading_coefficient())

    def parts_of(self, polynomial: fmpq_mpoly, index: int, degree: int) -> list[fmpq_mpoly]:
        """The coefficients of the powers of a generator up to a degree."""
        found = exact_field.coefficients_of(polynomial, [index])
        return [found.get((k,), polynomial * 0) for k in range(degree + 1)]

    def monic(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        return polynomial / polynomial.leading_coefficient()

    def is_negative(self, u: Quotient) -> bool:
        return not u.is_zero and bool(u.numerator.leading_coefficient() < 0)

    def tree_of(self, u: Quotient) -> ex.Expression:
        """The tree of an element, the same for the same element."""
        below = (
            exact_field.polynomial_tree(self, self.field.denominators[place]) ** -power
            for place, power in u.exponents
        )
        return ex.multiply(exact_field.polynomial_tree(self, u.numerator), *below)

    def tree_of_need(self, need: Need) -> ex.Expression:
        """The polynomial with coprime integers as coefficients."""
        p = need.polynomial
        scale = 1 / terms.content_of(
            map(polynomials.as_fraction, p.coeffs()) if p else [Fraction(1)]
        )
        return exact_field.polynomial_tree(
            self, Quotient(self.field, p, ()).scaled(scale).numerator
        )


def _lowered(polynomial: fmpq_mpoly, index: int, square: fmpq_mpoly) -> fmpq_mpoly:
    """The polynomial with a polynomial for the square of a generator."""
    generator = polynomial.context().gen(index)
    total = polynomial * 0
    for (power,), part in exact_field.coefficients_of(polynomial, [index]).items():
        total = total + part * square ** (power // 2) * generator ** (power % 2)
    return total


class Lesson(NamedTuple):
    """What is nonzero, by text, where a polynomial is; the generators of each of these; its factors
    of odd multiplicity, the sign of its content, and whether it has factors.
    """

    nonzero: dict[str, fmpq_mpoly]
    letters: list[set[int]]
    odd: dict[str, fmpq_mpoly]
    sign: int
    is_moving: bool


class Knowledge:
    """The signs of polynomials that follow from needs."""

    def __init__(self, ring: Letters, needs: Iterable[Need] = ()) -> None:
        self.ring = ring
        self.nonzero, self.signs = dict[str, fmpq_mpoly](), dict[str, int]()
        self.wholes, self.found = list[fmpq_mpoly](), dict[tuple[str, int], int]()
        self.products = list[tuple[int, dict[str, fmpq_mpoly]]]()  # of this sign, by text
        self.letters = list[set[int]]()  # generators of each nonzero polynomial
        self.listed = list[tuple[fmpq_mpoly, int, set[int]]]()
        for need in needs:
            self.learn(need)

    def learn(self, need: Need) -> None:
        one = self.lesson(need)
        self.nonzero |= one.nonzero
        self.letters += one.letters
        if need.kind == ">" and one.is_moving:
            if len(one.odd) == 1:
                ((text, p),) = one.odd.items()
                self.signs[text] = one.sign
                self.listed.append((p, one.sign, {*self.ring.holds(p)}))
            self.products.append((one.sign, one.odd))
            self.wholes.append(need.polynomial)

    def lesson(self, need: Need) -> Lesson:
        """What a need says in this ring."""
        key, known = (need.text, len(self.ring.atoms)), self.ring.lessons
        if key not in known:
            content, found = self.ring.factors(need.polynomial)
            nonzero = {str(q): q for p, _ in found for form in self.forms(p) for q in form}
            letters = [{*self.ring.holds(q)} for q in nonzero.values()]
            odd = {str(p): p for p, k in found if k % 2}
            known[key] = Lesson(nonzero, letters, odd, 1 if content > 0 else -1, bool(found))
        return known[key]

    def implies(self, need: Need) -> bool:
        content, found = self.ring.factors(need.polynomial)
        if need.kind == "!=":
            return content != 0 and all(self.never_zero(p) for p, _ in found)
        return self.sign(need.polynomial) > 0

    def never_zero(self, p: fmpq_mpoly) -> bool:
        """Whether all factors of one of its forms are nonzero wherever the needs are met."""
        return any(
            all(str(q) in self.nonzero or self.sign(q) or self.by_division(q) for q in form)
            for form in self.forms(p)
        )

    def by_division(self, p: fmpq_mpoly) -> bool:
        """Whether p is a product of nonzero polynomials modulo sqrt(w)^2 = w.

        For q = a + b r with a root r, p = s q where s = p (a - b r)/(a^2 - b^2 w).
        """
        for q in self.nonzero.values():
            degrees = q.degrees()
            for index in (k for k in self.ring.field.relations if degrees[k] == 1):
                a, b = self.ring.parts_of(q, index, 1)
                conjugate = a - b * self.ring.field.context.gen(index)
                norm = self.ring.field.reduce(q * conjugate)
                if not norm:  # x + |x| divides zero
                    continue
                rest, remainder = divmod(self.ring.field.reduce(p * conjugate), norm)
                if remainder:
                    continue
                if rest.total_degree() < p.total_degree():
                    return bool(rest.is_constant()) or self.never_zero(rest)
        return False

    def forms(self, p: fmpq_mpoly) -> Iterator[list[fmpq_mpoly]]:
        """The factors of each distinct form of p by sin^2 + cos^2 = 1; they are nonzero where p is.

        For a sine, these are the factors of 1 - cos^2.
        """
        same = p if self.ring.single(p) is None else p**2
        for form in (p, *self.ring.circled(same, partners="known")):
            yield [q for q, _ in self.ring.factors(form).listed]

    def sign(self, polynomial: fmpq_mpoly, depth: int = _DEPTH) -> int:
        """1 or -1 if the polynomial has this sign wherever the needs are met, else 0."""
        content, found = self.ring.factors(polynomial)
        if content == 0:
            return 0
        for q in self.wholes:
            if abs(len(polynomial) - len(q)) > 1:
                continue
            # q is positive, or negative if its leading coefficient is.
            rest = self.ring.monic(polynomial) - self.ring.monic(q)
            own = 1 if q.leading_coefficient() > 0 else -1
            if rest.is_constant() and (not rest or rest.leading_coefficient() * own > 0):
                return own if polynomial.leading_coefficient() > 0 else -own
        sign, left = 1 if content > 0 else -1, list[fmpq_mpoly]()
        for p, k in found:
            if k % 2 == 0:
                if str(p) not in self.nonzero and not self.irreducible(p, depth):
                    return 0
            elif own := self.irreducible(p, depth):
                sign *= own
            else:
                left.append(p)
        return self.by_products(sign, left, depth) if left else sign

    def by_products(self, sign: int, left: list[fmpq_mpoly], depth: int) -> int:
        """The sign of `sign` times these factors, if a product of known sign holds them."""
        names = {str(p) for p in left}
        for own, odd in self.products:
            rest = [p for text, p in odd.items() if text not in names]
            if len(rest) + len(left) == len(odd):
                signs = [self.irreducible(p, depth) for p in rest]
                if all(signs):
                    return sign * own * math.prod(signs)
        return 0

    def irreducible(self, p: fmpq_mpoly, depth: int) -> int:
        text = str(p)
        if (known := self.signs.get(text)) is not None:
            return known
        if (key := (text, depth)) not in self.found:
            self.ring.field.budget.charge(len(p))
            if self.letters and self.is_beside(p):
                self.found[key] = self.ring.nothing_known().irreducible(p, depth)
            else:
                self.found[key] = self.sign_of(p, depth)
        return self.found[key]

    def is_beside(self, p: fmpq_mpoly) -> bool:
        """Whether no need says anything of p: p holds names only, and each nonzero polynomial has
        two other generators.

        A sign follows only from needs with generators of p, and one more if p and terms in that
        generator are a need.
        """
        own = {*self.ring.holds(p)}
        return own <= self.ring.plain and all(len(letters - own) > 1 for letters in self.letters)

    def sign_of(self, p: fmpq_mpoly, depth: int) -> int:
        same = self.ring.same_sign(p)
        if same is not None and depth > 0 and (sign := self.sign(same, depth - 1)):
            return sign
        if (sign := self.by_facts(p) or self.by_terms(p)) or depth < 1:
            return sign
        ways: tuple[Callable[[fmpq_mpoly, int], int], ...] = (
            self.by_roots, self.by_squares, self.by_arctangents,
            self.by_norm, self.by_circle, self.by_quarter,
        )  # fmt: skip
        return next(filter(None, (way(p, depth) for way in ways)), 0)

    def by_facts(self, p: fmpq_mpoly) -> int:
        """The sign of p if p - r q is 0 or has the sign of r q, for a q of known sign and a number
        r.
        """
        own_letters = {*self.ring.holds(p)}
        circle = self.ring.letter(ex.PI)
        for q, sign, letters in self.listed:
            if len(letters ^ own_letters) > 1:  # p - r q has what only one of them has
                continue
            # If possible, r cancels more than a term in pi.
            shapes = (
                (shape, c)
                for shape, c in q.terms()
                if any(e for k, e in enumerate(shape) if k != circle)
            )
            shape, below = next(shapes, (None, fmpq(1)))
            above = fmpq(1) if shape is None else p[shape]
            if not above:
                continue
            rest, own = p - q * (above / below), sign if above * below > 0 else -sign
            if not rest or (len(self.ring.holds(rest)) < 2 and self.by_terms(rest) == own):
                return own
        return 0

    def by_terms(self, p: fmpq_mpoly) -> int:
        """The common weak sign of all terms, if their bounds exclude 0."""
        gens = p.context().names()
        for side in (1, -1):
            least, strict, weak = Fraction(0), False, True
            for exponents, coefficient in p.terms():
                c, strictly, free = polynomials.as_fraction(coefficient) * side, True, True
                held = [(k, int(e)) for k, e in enumerate(exponents) if e]
                for k, e in held:
                    known = 1 if k in self.ring.positive else self.signs.get(gens[k], 0)
                    if e % 2:
                        c, free = (c * known, free) if known else (c, False)
                    strictly = strictly and (bool(known) or gens[k] in self.nonzero)
                if free and c > 0:
                    strict = strict or (strictly and bool(held))
                    least += c if not held else 0
                elif not held or all(k in self.ring.bounded for k, _ in held):
                    least -= abs(c)
                else:
                    weak = False
            if weak and (least > 0 or (least == 0 and strict)):
                return side
        return 0

    def by_roots(self, p: fmpq_mpoly, depth: int) -> int:
        """The sign of a polynomial in one generator without real roots."""
        letters = self.ring.holds(p)
        if len(letters) != 1 or p.total_degree() > _LARGEST_DEGREE:
            return 0
        parts = self.ring.parts_of(p, letters[0], int(p.total_degree()))
        numbers = [
            polynomials.as_fraction(c.leading_coefficient()) if c else Fraction(0) for c in parts
        ]
        scale = terms.content_of(numbers)
        roots: Any = fmpz_poly([int(c / scale) for c in numbers]).complex_roots()
        if any(root.imag.contains(0) for root, _ in roots):
            return 0
        return 1 if p.leading_coefficient() > 0 else -1

    def by_squares(self, p: fmpq_mpoly, depth: int) -> int:
        """a z^2 + b z + c has the sign of a if 4 a c - b^2 > 0.

        For a number a and a free z, p has a sign only if that is true, so that one z suffices.
        """
        degrees = p.degrees()
        for k in (k for k in self.ring.holds(p) if degrees[k] == 2):
            c, b, a = self.ring.parts_of(p, k, 2)
            if (sign := self.sign(a, depth - 1)) and self.sign(4 * a * c - b * b, depth - 1) > 0:
                return sign
            if a.is_constant() and self.is_free(k):
                break
        return 0

    def is_free(self, index: int) -> bool:
        """Whether nothing is known of this generator alone."""
        name = str(self.ring.field.context.gen(index))
        known = name in self.signs or name in self.nonzero
        return not (known or index in self.ring.positive or index in self.ring.bounded)

    def by_arctangents(self, p: fmpq_mpoly, depth: int) -> int:
        """b + c atan u has the sign of b + c pi/2 and b - c pi/2, one of which may be 0."""
        half = self.ring.field.context.gen(self.ring.letter(ex.PI)) / 2
        for index in self.ring.arctangents:
            if p.degrees()[index] == 1:
                b, c = self.ring.parts_of(p, index, 1)
                both = (b + c * half, b - c * half)
                ends = {self.sign(end, depth - 1) for end in both if end}
                if len(ends) == 1:
                    return ends.pop()
        return 0

    def by_norm(self, p: fmpq_mpoly, depth: int) -> int:
        """a + b sqrt(w) has the sign of b if b^2 w > a^2, and the sign of a if a^2 > b^2 w."""
        for index, w in self.ring.squares.items():
            if p.degrees()[index] == 1:
                a, b = self.ring.parts_of(p, index, 1)
                if sign := self.sign(norm_of(self.ring, a, b, w), depth - 1):
                    return self.sign(a if sign > 0 else b, depth - 1)
        return 0

    def by_circle(self, p: fmpq_mpoly, depth: int) -> int:
        """The sign by sin^2 + cos^2 = 1."""
        signs = (self.sign(form, depth - 1) for form in self.ring.circled(p, partners="known"))
        return next(filter(None, signs), 0)

    def by_quarter(self, p: fmpq_mpoly, depth: int) -> int:
        """The signs of sin u and cos u between two of their zeros."""
        single = self.ring.single(p)
        if single is None or single[0] not in self.ring.circular:
            return 0
        name, u = self.ring.circular[single[0]]
        pi, half = self.ring.value(ex.PI), Fraction(0 if name == "sin" else -1, 2)
        for k in range(-2, 3):
            low, high = (
                self.ring.sign_form(difference)
                for difference in (u - pi.scaled(k + half), pi.scaled(k + 1 + half) - u)
            )
            if self.sign(low, depth - 1) > 0 and self.sign(high, depth - 1) > 0:
                return -1 if k % 2 else 1
        return 0


def norm_of(ring: Letters, a: fmpq_mpoly, b: fmpq_mpoly, w: Quotient) -> fmpq_mpoly:
    """A polynomial with the sign of a^2 - b^2 w."""
    one, other = (Quotient(ring.field, p, ()) for p in (a, b))
    return ring.sign_form(one * one - other * other * w)


# Questions about trees.


def follows(
    tree: ex.Expression,
    kind: str,
    nonzero: Iterable[ex.Expression],
    positive: Iterable[ex.Expression],
) -> bool:
    """Whether the tree is > 0 wherever it is defined (">"), or is defined and not 0 ("!="), where
    none of `nonzero` is 0 and all of `positive` are > 0; False where that is not found.
    """
    asked = towers.to_kernels(tree)
    stated = [*((towers.to_kernels(one), "!=") for one in nonzero)]
    stated += [(towers.to_kernels(one), ">") for one in positive]
    try:
        ring = Letters.about([asked, *(one for one, _ in stated)])
        known = [need for one, by in stated for need in ring.pieces(by, ring.value(one))]
        known += ring.needs
        ring.needs = {}
        wanted = [*ring.pieces(kind, ring.value(asked))]
        (known if kind == ">" else wanted).extend(ring.needs)
        return all(map(Knowledge(ring, known).implies, wanted))
    except (ArithmeticError, ValueError):
        return False


def shortest(
    positive: Sequence[ex.Expression], nonzero: Sequence[ex.Expression]
) -> list[tuple[str, ex.Expression]] | None:
    """The inequalities (">" or "!=", tree) without those that follow from the others, as they are
    stated where that is short; None where that is not found.
    """
    stated = [*((tree, "!=") for tree in nonzero), *((tree, ">") for tree in positive)]
    kernels = [(towers.to_kernels(tree), kind) for tree, kind in stated]
    try:
        ring, said = Letters.about([tree for tree, _ in kernels]), dict[Need, ex.Expression]()
        for (tree, kind), (given, _) in zip(kernels, stated, strict=True):
            needs = [*ring.pieces(kind, ring.value(tree))]
            for need in needs:
                known = said.get(need) or ring.tree_of_need(need)
                said[need] = min(given, known, key=_length) if len(needs) == 1 else known
        kept = strongest(ring, [*said])
        return [(need.kind, said.get(need) or ring.tree_of_need(need)) for need in kept]
    except (ArithmeticError, ValueError):
        return None


@lru_cache(maxsize=1024)
def needed_beyond(
    formulas: tuple[ex.Expression, ...],
    positive: tuple[ex.Expression, ...],
    nonzero: tuple[ex.Expression, ...],
) -> Sequence[tuple[str, ex.Expression]]:
    """What the formulas need to be analytic (">" or "!=", tree) and does not follow where all of
    `positive` are > 0 and none of `nonzero` is 0; none where it is not found.
    """
    asked = [towers.to_kernels(tree) for tree in formulas]
    stated = [*((towers.to_kernels(one), "!=") for one in nonzero)]
    stated += [(towers.to_kernels(one), ">") for one in positive]
    try:
        ring = Letters.about([*asked, *(one for one, _ in stated)])
        known = [need for one, by in stated for need in ring.pieces(by, ring.value(one))]
        known += ring.needs
        ring.needs = {}
        needed = {
            need: None
            for tree in asked
            for need in sorted(_needs_of_tree(ring, tree), key=lambda one: (one.kind, one.text))
        }
        held = Knowledge(ring, known)
        missing = [need for need in dict.fromkeys([*needed, *ring.needs]) if not held.implies(need)]
        return [(need.kind, ring.tree_of_need(need)) for need in strongest(ring, missing)]
    except (ArithmeticError, ValueError):
        return []


def _needs_of_tree(ring: Letters, tree: ex.Expression) -> frozenset[Need]:
    """Where the tree is analytic: for a long sum, where all its terms are."""
    try:
        return ring.needs_of(ring.value(tree))
    except exact_field.TooLarge:
        if not isinstance(tree, ex.Sum):
            raise
        return frozenset[Need]().union(*(_needs_of_tree(ring, term) for term in tree.terms))


def _length(tree: ex.Expression) -> int:
    return len(printing.to_text(tree))


def strongest(ring: Letters, needs: Sequence[Need]) -> list[Need]:
    """The needs that do not follow from the others, without factors whose signs do."""
    plain = Knowledge(ring)
    kept = [need for need in dict.fromkeys(needs) if not plain.implies(need)]
    less = _fewer(ring, kept)
    return less if less == kept else _fewer(ring, less)


def _fewer(ring: Letters, kept: list[Need]) -> list[Need]:
    def size(need: Need) -> tuple[int, bool, str]:
        return len(need.polynomial), need.kind == ">", need.text

    for need in sorted(kept, key=size, reverse=True):
        known = Knowledge(ring, rest := [one for one in kept if one is not need])
        kept = (
            rest
            if known.implies(need)
            else [_smaller(known, one) if one is need else one for one in kept]
        )
    return kept


def _smaller(known: Knowledge, need: Need) -> Need:
    """The need without factors of known signs; a + b sqrt(w) > 0 becomes a > 0 if a^2 > b^2 w."""
    ring = known.ring
    (content, found), left = ring.factors(need.polynomial), ring.field.context.constant(1)
    sign = 1 if content > 0 else -1
    for p, k in found:
        own = known.irreducible(p, _DEPTH) if k % 2 else 1
        sign *= own or 1
        left = left if own else left * p
    for index, w in ring.squares.items() if need.kind == ">" else ():
        if left.degrees()[index] == 1:
            a, b = ring.parts_of(left, index, 1)
            if known.sign(norm_of(ring, a, b, w)) > 0:
                left = a
    return need if left.is_constant() else need_of(need.kind, left * sign)
