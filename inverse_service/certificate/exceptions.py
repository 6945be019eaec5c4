"""Find the special parameter values that a proof excludes.

A certificate is checked at random points and random parameters, so its claim is valid for generic
values. A value c is excluded if a divisor of the proof (a pivot, the determinant of the multiplier,
a divisor of L) vanishes at every point (t, q, q'), that is, if the *content* of this function, its
largest factor with parameters only, is 0.

The content is computed on lines c = a + s b through one random a: each divisor is a rational
function of s, which the beginning of its power series determines, and the divisors at two points
(t, q, q') have only the content in common. The contents on several lines are combined into a
polynomial in the parameters, which is factored. A factor is dropped if f is not defined there, or
if other pivots prove the claim. Sets given by two or more equations are found only if these set parameters to 0.

Where a parameter occurs in an exponent or in the argument of a function, independent functions may
become dependent for single values of it: x^a - x^2 is 0 for a = 2 and for no factor of a content.
There the whole check is repeated with the value in the place of the parameter: with -3 ... 3 and
1/2 in an exponent, with 0 in another argument, with 1 in a logarithm or as the base of a power, and
for two such parameters with one equal to the other or to its negative. If the divisors are not
powers of these functions times a factor without them, other values, such as a = 7 for x^a - x^7,
are "single values of a". A function of parameters
alone, such as log(a) or cos(a), is a number that a content may contain like a parameter: log(a) - 2
is 0 for one a. Whether it does is found on a line in the space of these numbers; the values are
then "single values of a", unless they are among those found before.

A claim about arbitrary functions is proven for all of them if the divisors of its proof do not
depend on them, and otherwise for general functions, which "special functions F(x, y)" says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import combinations, combinations_with_replacement
from typing import TYPE_CHECKING, Any, NamedTuple

from flint import Ordering, fmpq, fmpq_mpoly_ctx, fmpz_poly, nmod_mat, nmod_mpoly_ctx, nmod_poly

from .formulas import ORDERED, SPECIAL, Ended
from .lines import Displaced, OnAtoms, OnLine, Special
from .numbers import CONSTANTS, Undefined, Unsettled

if TYPE_CHECKING:
    from .question import Question
    from .series import Expansion

Polynomial = Any  # fmpq_mpoly, in the parameters
MAX_PARAMETERS = 40
MAX_VALUES = 228  # of parameters in functions, each with a check: those of 12 in exponents
MAX_TERMS = 512  # of a series along a line
SPARE = 4  # additional terms beyond those required by the degrees
MAX_SHAPES = 60  # monomials of one degree
MAX_TOGETHER, MAX_ZEROS = 12, 4  # parameters of which all sets of so many are tried
MAX_EXPONENT = 80  # of the denominators of the formulas in a divisor
# The work for the exceptions, in products of numbers, beyond that of the proof; some 2 s.
LEAST_WORK = 3_000_000
_OF_FUNCTIONS, _NOT_FOUND = "special functions ", "single values of "
EXPONENTS = (*map(Fraction, range(-3, 4)), Fraction(1, 2))  # tried for a parameter in an exponent
_ALGEBRAIC = ("number", "name", "+", "*", "/", "power")
Values = dict[str, str]  # formulas in the place of parameters
# The direction of a line in the space of the parameters; or, of pairs (l, e), start and slope of a
# line by the place of the pair.
Line = Sequence[int] | Mapping[int, tuple[int, int]]
# The ways in which a computation ends without a value: by a limit, or at its point.
NO_VALUE = (
    Ended,
    Undefined,
    Unsettled,
    StopIteration,
    ArithmeticError,
    ValueError,
    RecursionError,
    MemoryError,
)


@dataclass(frozen=True, slots=True)
class Generic:
    """The computation whose outcome at random points is the proof.

    Its divisors determine where the proof is valid. `degree` is the degree of the series; `holds`
    says whether the claim follows from an outcome. `telescopes`: each divisor is the quotient of
    consecutive minors of one matrix, so that only their product matters. `persists`: a claim that
    holds for special parameters holds for general ones, as it says that a number is not 0. `unit`
    is the work of one evaluation, 0 where it is not known. `is_full`: whether as many rows are
    independent in an outcome as for general parameters; then the claim holds there, since what
    satisfies these rows is a limit of what does for general ones.
    """

    work: Callable[[Expansion], Any]
    degree: int
    holds: Callable[[Any], bool]
    telescopes: bool = False
    persists: bool = False
    unit: int = 0
    is_full: Callable[[Any], bool] | None = None


class Exceptions(Sequence[str]):
    """The excluded values, computed on first access because that takes as long as the proof."""

    def __init__(self, find: Callable[[], tuple[str, ...]]) -> None:
        self.find = cache(find)

    def __getitem__(self, place: Any) -> Any:
        return self.find()[place]

    def __len__(self) -> int:
        return len(self.find())


def not_found(names: Sequence[str]) -> tuple[str, ...]:
    """The placeholder for excluded values that could not be found."""
    return (f"{_NOT_FOUND}{', '.join(names)}",) if names else ()


def of_functions(functions: Mapping[str, Sequence[str]]) -> str:
    """The exception that stands for functions which the proof does not cover."""
    written = [f"{name}({', '.join(arguments)})" for name, arguments in functions.items()]
    return f"{_OF_FUNCTIONS}{', '.join(written)}"


def in_general(system: Mapping[str, Any]) -> tuple[str, ...]:
    """What a claim excepts that is proven for general parameters and functions of a system."""
    functions = system.get("functions") or {}
    said = (of_functions(functions),) if functions else ()
    return (*said, *not_found(list(system.get("parameters") or ())))


class Excepted(NamedTuple):
    """The entries of a list of exceptions: equations of parameters, functions, and the parameters
    whose excluded values could not be found.
    """

    values: list[str]
    functions: list[str]
    not_found: list[str]


def read_exceptions(listed: Iterable[str]) -> Excepted:
    """The entries of a stored list by what they exclude."""
    found = Excepted([], [], [])
    for one in listed:
        if one.startswith(_OF_FUNCTIONS):
            found.functions.append(one.removeprefix(_OF_FUNCTIONS))
        elif one.startswith(_NOT_FOUND):
            found.not_found.append(one.removeprefix(_NOT_FOUND))
        else:
            found.values.append(one)
    return found


def divisors_of(generic: Generic, ring: Expansion) -> list[Any]:
    """The divisors of the computation, which follows the expansion.

    The expansion may have read the formulas several times, each time with new numbers.
    """
    ring.arithmetic.divisors = found = list[Any]()
    generic.work(ring)
    return found


def depends_on(question: Question, generic: Generic, functions: frozenset[str]) -> bool:
    """Whether a divisor of the proof changes with the values of the functions, at the same point.

    True, too, if the time is over before it is known: then the proof is of general functions.
    """
    if not functions:
        return False
    for _ in range(32):
        seed, found = question.generator.getrandbits(64), list[list[int]]()
        try:
            prime = question.prime("narrow")
            for salt in (0, question.generator.randrange(1, prime)):
                arithmetic = Special(question, prime, seed, {})
                arithmetic.salt, arithmetic.salted = salt, functions
                found.append(divisors_of(generic, question.expansion(arithmetic, generic.degree)))
            return found[0] != found[1]
        except NO_VALUE:
            if time.thread_time() > question.deadline:
                break
    return True


def exceptions_of(
    question: Question,
    generic: Generic | None,
    fails_at: Callable[[Values, float], bool],
) -> tuple[str, ...]:
    """Equations between parameters, such as "c1 = c2" and "k = 0".

    It takes about as long as the check, and as long again for each value of a parameter in a
    function. `fails_at` says, with so much work at most, whether f is defined and the claim not
    proven with formulas in the place of parameters. "single values of k" stands for values that
    could not be found. The work is counted, not timed, so that they are the same on any machine
    unless the time of the whole check ends.
    """
    names = question.own_parameters
    if generic is None or not (names or question.functions):
        return ()
    most = question.work + LEAST_WORK
    general = depends_on(question, generic, frozenset(question.functions))
    found = [of_functions(question.functions)] if general else []
    if not names:
        return tuple(found)
    (unknown,) = not_found(names)
    orders, ordered = parameters_of_orders(question)
    if depends_on(question, generic, ordered):
        found += not_found([name for name in names if name in orders])
    try:
        # Where the numbers are wide, points with roots modulo the prime itself are not met.
        if len(names) > MAX_PARAMETERS or question.plan.wide:
            return (*found, unknown)
        finding = Finding(question, generic, names, most)
        for text in finding.texts():
            found.append(text)
        tried = [*special_values(question)]
        if len(tried) > MAX_VALUES:
            return (*found, unknown)
        for text, values in tried:
            if text not in found and fails_at(values, most):
                found.append(text)
        inside = parameters_inside(question)
        if inside and finding.in_functions():
            found += not_found([name for name in names if name in inside])
        lettered, special = lettered_parameters(question)
        if lettered and (depends_on(question, generic, special) or finding.in_atoms(found)):
            found += not_found([name for name in names if name in lettered])
        return _once(found, names)
    except NO_VALUE:
        return (*found, unknown)


def _once(found: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """The exceptions, the last of which names all parameters whose single values are not known."""
    read = read_exceptions(found)
    unknown = {name for one in read.not_found for name in one.split(", ")}
    said = [one for one in found if not one.startswith(_NOT_FOUND)]
    return (*said, *not_found([name for name in names if name in unknown]))


def parameters_inside(question: Question) -> set[str]:
    """The parameters in functions, among whose arguments are others than parameters."""
    nodes, found, below = question.nodes, set[str](), list[frozenset[str]]()
    parameters = {*question.own_parameters}
    for number, node in enumerate(nodes.listed):
        names = frozenset[str]().union(*(below[part] for part in nodes.parts(number)))
        below.append(names | ({node[1]} if node[0] == "name" else set()))
        if node[0] not in _ALGEBRAIC and not names <= parameters:
            found |= names & parameters
    return found


def parameters_of_orders(question: Question) -> tuple[set[str], frozenset[str]]:
    """The parameters in orders of functions, and these functions: for single orders they satisfy
    relations that their derivatives do not show.
    """
    nodes, names, functions = question.nodes, set[str](), set[str]()
    for node in nodes.listed:
        if node[0] in ORDERED:
            waiting = [node[1]]
            while waiting:
                number = waiting.pop()
                waiting += nodes.parts(number)
                if nodes.listed[number][0] == "name":
                    names.add(nodes.listed[number][1])
                    functions.add(node[0])
    return names, frozenset(functions)


def rooted_parameters(question: Question) -> frozenset[str]:
    """The parameters in roots that hold nothing else, as in sqrt(a) and (a*b)^(3/2)."""
    nodes, parameters = question.nodes, {*question.own_parameters}
    below, found = list[frozenset[str]](), set[str]()
    for number, node in enumerate(nodes.listed):
        names = frozenset[str]().union(*(below[part] for part in nodes.parts(number)))
        below.append(names | ({node[1]} if node[0] == "name" else set()))
        if node[0] in ("^", "sqrt") and below[node[1]] <= parameters:
            exponent = nodes.rational(node[2]) if node[0] == "^" else Fraction(1, 2)
            if exponent is not None and exponent.denominator == 2:
                found |= below[node[1]]
    return frozenset(found)


def lettered_parameters(question: Question) -> tuple[frozenset[str], frozenset[str]]:
    """The parameters in functions of parameters alone, as a and b in log(a) and 2^b; and these
    functions where their values are not atoms, such as erf.
    """
    nodes, parameters = question.nodes, {*question.own_parameters}
    below, found, special = list[frozenset[str]](), set[str](), set[str]()
    for number, node in enumerate(nodes.listed):
        names = frozenset[str]().union(*(below[part] for part in nodes.parts(number)))
        below.append(names | ({node[1]} if node[0] == "name" else set()))
        plain = node[0] in ("number", "name", "+", "*", "/", "power", "sqrt")
        plain |= node[0] == "^" and nodes.rational(node[2]) is not None
        if not plain:
            # Of a^x', too, whose derivatives have the factor log(a).
            found |= {*below[node[1]]} if node[0] == "^" and below[node[1]] <= parameters else set()
            found |= below[-1] if below[-1] <= parameters else set()
            special |= {node[0]} if below[-1] <= parameters and node[0] in SPECIAL else set()
    return frozenset(found), frozenset(special)


def special_values(question: Question) -> Iterator[tuple[str, Values]]:
    """The values of parameters inside functions that are tried: (equation, formulas in the place of
    parameters).
    """
    inside, exponents, ones = set[str](), set[str](), set[str]()
    nodes, below = question.nodes, list[frozenset[str]]()
    for number, node in enumerate(nodes.listed):
        held = frozenset[str]().union(*(below[part] for part in nodes.parts(number)))
        below.append(held | ({node[1]} if node[0] == "name" else set()))
        if node[0] not in _ALGEBRAIC:
            inside |= held
        if node[0] == "^":
            exponents |= below[node[2]]
        if node[0] == "log" or (node[0] == "^" and nodes.rational(node[2]) is None):
            ones |= below[node[1]]
    names = [name for name in question.own_parameters if name in inside]
    for name in names:
        least = (Fraction(0), Fraction(1)) if name in ones else (Fraction(0),)
        for value in EXPONENTS if name in exponents else least:
            yield f"{name} = {value}", {name: str(value)}
    for first, second in combinations(names, 2):
        yield f"{first} = {second}", {first: second}
        yield f"{first} = -{second}", {first: f"-{second}"}


class Rank(NamedTuple):
    """Whether as many rows of a proof are independent as for general parameters, and whether its
    claim holds; neither where f is not defined.
    """

    is_full: bool
    holds: bool


class Finding:
    """The search for the exceptions of one proof, modulo one prime."""

    def __init__(self, question: Question, generic: Generic, names: list[str], most: float) -> None:
        self.question, self.generic, self.names, self.most = question, generic, names, most
        self.prime, draw = question.prime("narrow"), question.generator
        self.base = [draw.randrange(1, self.prime) for _ in names]
        self.rooted = rooted_parameters(question)
        self.largest = 0  # sum of the degrees of a numerator and its denominator
        self.enough = 16  # terms of a series along a line, current estimate
        # Evaluations of the computation so far, and needed before sufficiency is known; the work
        # of one.
        self.done = self.needed = 0
        self.unit = generic.unit if question.rational else 0
        self.ranks = dict[frozenset[int], Rank]()  # where sets of parameters are 0
        self.seeds = list[int]()  # of points at which the required roots exist, those of L too
        if self.unit:  # no roots are required
            self.seeds += [draw.getrandbits(64), draw.getrandbits(64)]
        values = dict(zip(names, self.base, strict=True))
        # As many draws as `Question.modulo` makes: few points have the roots of many distances.
        for _ in range(64 + 30 * question.plan.draws if not self.seeds else 0):
            seed = draw.getrandbits(64)
            arithmetic = Special(question, self.prime, seed, values, self.rooted)
            before = question.work
            try:
                # First test whether these roots exist.
                if generic.degree and question.plan.draws > 1:
                    question.read(question.expansion(arithmetic.again(), 0))
                divisors_of(generic, question.expansion(arithmetic, generic.degree))
                self.seeds.append(seed)
                self.unit = max(self.unit, question.work - before)
            except Undefined:
                question.check_time()
            if len(self.seeds) == 2:
                break
        # Twice as many terms take less than twice the time. There has to be work for more of them,
        # where each term counts as one evaluation.
        self.first = 32 if 256 * self.unit <= most else self.enough
        self.context = fmpq_mpoly_ctx.get([f"c{k}" for k in range(len(names))], Ordering.degrevlex)
        self.gens = self.context.gens()

    def texts(self) -> Iterator[str]:
        found, said = list[Polynomial](), set[str]()
        for one in self.factors():
            if self.is_left_out(one):
                found.append(one)
                text = self.text(self.in_parameters(one))
                if text not in said:
                    said.add(text)
                    yield text
        single = {k for k, z in enumerate(self.gens) if any(one == z for one in found)}
        others = [k for k in range(len(self.names)) if k not in single]
        if self.question.rational:
            yield from self.zeros(found, [k for k in others if self.is_defined({k: 0})])

    def zeros(self, found: Sequence[Polynomial], others: Sequence[int]) -> Iterator[str]:
        """The sets of parameters that are left out where they are 0 together, of those with f
        defined where one of them is 0.
        """
        sets = self.least_failing if self.generic.persists else self.small_failing
        for chosen in sorted(sets(found, others), key=lambda one: (len(one), one)):
            yield " = ".join([*(self.names[k] for k in chosen), "0"])

    def small_failing(
        self, found: Sequence[Polynomial], others: Sequence[int]
    ) -> list[tuple[int, ...]]:
        """The small sets that fail, of those in which none does."""
        if len(others) > MAX_TOGETHER:
            raise Undefined
        known = list[tuple[int, ...]]()
        full = self.sets_of_full_rank(found, others)
        for size in range(2, min(len(others), MAX_ZEROS) + 1):
            for chosen in combinations(others, size):
                seen = any({*one} <= {*chosen} for one in known)
                seen = seen or any(vanishes(one, {*chosen}) for one in found)
                seen = seen or any({*chosen} <= one for one in full)
                zeros = dict.fromkeys(chosen, 0)
                if not seen and self.is_defined(zeros) and not self.at_zeros(chosen).holds:
                    known.append(chosen)
        return known

    def sets_of_full_rank(
        self, found: Sequence[Polynomial], others: Sequence[int]
    ) -> list[frozenset[int]]:
        """Large sets of parameters such that the rank in the proof is the general one where they
        are 0, so that it is where some of them are: a minor is not 0 there. Most sets are in one.
        """
        small = sum(math.comb(len(others), size) for size in range(2, MAX_ZEROS + 1))
        count = self.done + small + len(others)
        if self.generic.is_full is None or len(others) < 4 or count * self.unit > self.most:
            return []
        without = [frozenset(others) - {k} for k in others]
        return [
            chosen
            for chosen in without
            if not any(vanishes(one, chosen) for one in found) and self.at_zeros(chosen).is_full
        ]

    def at_zeros(self, chosen: Iterable[int]) -> Rank:
        """What is known of the proof where these parameters are 0, computed once."""
        key = frozenset(chosen)
        if key not in self.ranks:
            outcome = self.outcome(dict.fromkeys(sorted(key), 0))
            generic, known = self.generic, outcome is not None
            is_full = known and generic.is_full is not None and generic.is_full(outcome)
            self.ranks[key] = Rank(is_full, known and generic.holds(outcome))
        return self.ranks[key]

    def least_failing(
        self, found: Sequence[Polynomial], others: Sequence[int]
    ) -> list[tuple[int, ...]]:
        """All sets that fail and in which none does, where each set around one that fails does.

        What a set other than those found leaves out is a letter of each of them, and a monomial of
        each polynomial.
        """
        known, done, waiting = list[set[int]](), set[frozenset[int]](), [frozenset(others)]
        while waiting:
            chosen = waiting.pop()
            if chosen in done:
                continue
            done.add(chosen)
            zero = next((one for one in found if vanishes(one, chosen)), None)
            if zero is not None:
                waiting += [chosen.difference(letters) for letters in letters_of(zero)]
                continue
            least = next((one for one in known if one <= chosen), None)
            if least is None:
                if self.holds(dict.fromkeys(chosen, 0)):
                    continue
                least = {*chosen}
                for k in sorted(chosen):
                    if not self.holds(dict.fromkeys(least - {k}, 0)):
                        least.remove(k)
                known.append(least)
            waiting += [chosen - {k} for k in least]
        return [tuple(sorted(one)) for one in known if self.is_defined(dict.fromkeys(one, 0))]

    # The content.

    def factors(self) -> Iterator[Polynomial]:
        """The irreducible factors of the content."""
        direction = self.direction()
        first = self.content(direction)
        if first.degree() < 1:
            return
        found = [one for one in self.likely() if self.divides(one, direction, first)]
        rest = self.without(found, direction, first)
        yield from found
        if rest.degree() > 0:
            _, factors = self.put_together(found, direction, rest).factor()
            yield from (one for one, _ in factors)

    def direction(self) -> list[int]:
        return [self.question.generator.randrange(1, self.prime) for _ in self.names]

    def likely(self) -> Iterator[Polynomial]:
        yield from self.gens
        for left, right in combinations(self.gens, 2):
            yield left - right
            yield left + right

    def on_line(self, polynomial: Polynomial, direction: Sequence[int]) -> Any:
        """The restriction of a polynomial to a line, in s."""
        places = [nmod_poly([a, b], self.prime) for a, b in zip(self.base, direction, strict=True)]
        total = nmod_poly([0], self.prime)
        for exponents, coefficient in polynomial.terms():
            value = int(coefficient.p) * pow(int(coefficient.q), -1, self.prime) % self.prime
            term = nmod_poly([value], self.prime)
            for place, exponent in zip(places, exponents, strict=True):
                term *= place ** int(exponent)
            total += term
        return total

    def divides(self, polynomial: Polynomial, direction: Sequence[int], content: Any) -> bool:
        return bool((content % self.on_line(polynomial, direction)).degree() < 0)

    def without(self, found: Sequence[Polynomial], direction: Sequence[int], content: Any) -> Any:
        for one in found:
            content //= self.on_line(one, direction)
        return content

    def content(self, direction: Line) -> Any:
        """The common factor, without multiplicities, of the divisors at two points (t, q, q') on a
        line.
        """
        return self.contents([direction])[0]

    def contents(self, directions: Sequence[Line]) -> list[Any]:
        """The contents on several lines."""
        begun, self.largest = self.done, 0
        count = max(self.enough, self.first if len(directions) == 1 else 0)
        above = list[list[list[Any]]]()
        # Any regular minor shows the rank; other pivots remove the factors due to the first choice.
        for last, seed in enumerate(self.seeds):
            other, known = bool(last) and self.generic.telescopes, 0
            while len(above) == last:
                if known == MAX_TERMS:
                    raise Undefined
                # Those at the second point are as many.
                self.needed = max(
                    begun + 2 * count * len(directions),
                    self.done + (count - known) * len(directions),
                )
                self.check_work(self.needed)
                lines = self.all_numerators(seed, directions, count, other)
                self.done, known = self.done + (count - known) * len(directions), count
                if lines is None:
                    count = self.more_than(count, begun, len(directions))
                else:
                    above.append(lines)
            count = min(count, self.largest + SPARE)
        if len({len(line) for lines in above for line in lines}) != 1:
            raise Undefined
        self.enough = max(self.enough, count)
        return [self.common(*line) for line in zip(*above, strict=True)]

    def all_numerators(
        self, seed: int, directions: Sequence[Line], count: int, last: bool
    ) -> list[list[Any]] | None:
        """The numerators of the divisors on each line; None where so many terms do not determine
        them.
        """
        found = list[list[Any]]()
        for direction in directions:
            found.append(self.numerators(count, *self.divisors(seed, direction, count, last)))
            if None in found[-1]:
                return None
        return found

    def more_than(self, count: int, begun: int, lines: int) -> int:
        """More terms on each line, if possible twice as many."""
        allowed = (self.most / max(self.unit, 1) - begun) / (2 * lines)
        return min(max(count + count // 2, int(min(2 * count, allowed))), MAX_TERMS)

    def common(self, one: Sequence[Any], other: Sequence[Any]) -> Any:
        """The product of the common factors of two lists of polynomials, each factor once."""
        whole = nmod_poly([1], self.prime)
        for left, right in zip(one, other, strict=True):
            shared = left.gcd(right)
            whole *= shared // whole.gcd(shared)
        return whole // whole.gcd(whole.derivative())

    def numbers_on(self, seed: int, direction: Line, count: int, last: bool) -> OnLine:
        """The numbers along a line, of atoms or of parameters, with so many terms."""

        def along(start: int, slope: int) -> Displaced:
            return Displaced(nmod_poly([start, slope], self.prime), count)

        if isinstance(direction, Mapping):
            fixed = dict(zip(self.names, self.base, strict=True))
            moved = {place: along(*line) for place, line in direction.items()}
            return OnAtoms(self.question, self.prime, seed, fixed, self.rooted, last, moved)
        lines = zip(self.names, self.base, direction, strict=True)
        values = {name: along(start, slope) for name, start, slope in lines}
        return OnLine(self.question, self.prime, seed, values, self.rooted, last)

    def divisors(
        self, seed: int, direction: Line, count: int, last: bool
    ) -> tuple[list[Any], list[Any]]:
        """The divisors of the computation along a line, and denominators of the formulas, as
        series with so many terms.
        """
        self.question.check_time()
        arithmetic = self.numbers_on(seed, direction, count, last)
        ring = self.question.expansion(arithmetic, self.generic.degree)
        found = divisors_of(self.generic, ring)
        if self.generic.telescopes:
            found = [math.prod(found)]
        series = [
            one.part if isinstance(one, Displaced) else nmod_poly([one], self.prime)
            for one in found
        ]
        return series, [one.part for one in arithmetic.denominators]

    def check_work(self, needed: int) -> None:
        """Undefined where so many evaluations in all are more work than is allowed."""
        if needed * self.unit > self.most:
            raise Undefined
        self.question.check_time()

    def numerators(self, count: int, found: list[Any], below: list[Any]) -> list[Any | None]:
        """The numerators of the rational functions that have these series, to so many terms.

        None where the series do not determine one. The product of all divisors has high powers of
        the denominators of the formulas, `below`, which are cleared.
        """
        modulus = nmod_poly([1], self.prime).left_shift(count)
        if self.generic.telescopes and below:
            found = [self.cleared(modulus, one, below) for one in found]
        return [self.numerator(modulus, one) for one in found]

    def cleared(self, modulus: Any, polynomial: Any, below: Sequence[Any]) -> Any:
        """The polynomial modulo `modulus` times powers of the denominators, if that is of low
        degree and thus a numerator; the powers that are too many are divided out.
        """
        most = modulus.degree() - SPARE
        short = [one for one in below if 0 < one.degree() <= most // 4]
        whole, raised = math.prod(short), polynomial
        if not short or self.simplest(modulus, polynomial)[1] <= most:
            return polynomial
        for _ in range(MAX_EXPONENT):
            raised = raised * whole % modulus
            if raised.degree() < most:
                for one in short:
                    while (raised % one).degree() < 0:
                        raised //= one
                return raised
        return polynomial

    def numerator(self, modulus: Any, polynomial: Any) -> Any | None:
        """The numerator of the simple rational function congruent to the polynomial modulo
        `modulus`, or None.
        """
        best, size = self.simplest(modulus, polynomial)
        self.largest = max(self.largest, size)
        return best if size <= modulus.degree() - SPARE else None

    def simplest(self, modulus: Any, polynomial: Any) -> tuple[Any, int]:
        """The numerator of the simplest rational function congruent to the polynomial, and the sum
        of the degrees of both its parts.
        """
        older, newer = modulus, polynomial
        before, after = nmod_poly([0], self.prime), nmod_poly([1], self.prime)
        best, size = newer, newer.degree()
        while newer.degree() >= 0:  # the remainders are numerators, their cofactors denominators
            if newer.degree() + after.degree() < size:
                best, size = newer, newer.degree() + after.degree()
            quotient = older // newer
            older, newer = newer, older - quotient * newer
            before, after = after, before - quotient * after
        return best, size

    def put_together(
        self, found: Sequence[Polynomial], direction: Sequence[int], rest: Any
    ) -> Polynomial:
        """The polynomial with these restrictions to lines through the base."""
        degree, m, prime = rest.degree(), len(self.names), self.prime
        letters: Sequence[int] = range(m)
        if math.comb(m - 1 + degree, degree) > MAX_SHAPES:
            letters = self.occurring(found)
            if math.comb(len(letters) - 1 + degree, degree) > MAX_SHAPES:
                raise Undefined
        shapes = [list(combinations_with_replacement(letters, k)) for k in range(degree + 1)]
        self.check_work(self.done + 2 * self.enough * (len(shapes[-1]) - 1))
        others = [self.direction() for _ in shapes[-1][1:]]
        lines = [(direction, rest)]
        contents = zip(others, self.contents(others) if others else (), strict=True)
        lines += [(other, self.without(found, other, content)) for other, content in contents]
        if any(one.degree() != degree for _, one in lines):
            raise Undefined
        ring = nmod_mpoly_ctx.get([f"c{k}" for k in range(m)], modulus=prime, ordering=Ordering.lex)
        one, whole = ring.constant(1), ring.constant(0)
        moved = [z - a for z, a in zip(ring.gens(), self.base, strict=True)]  # c - a
        for k, shape in enumerate(shapes):  # the forms of degree k in c - a; that of degree 0 is 1
            used = lines[: len(shape)]
            rows = [[math.prod(b[j] for j in places) % prime for places in shape] for b, _ in used]
            right = [[int(on[k]) * pow(int(on[0]), -1, prime) % prime] for _, on in used]
            solved = nmod_mat(rows, prime).solve(nmod_mat(right, prime))
            for number, places in enumerate(shape):
                monomial = math.prod([moved[j] for j in places], start=one)
                whole += monomial * int(solved[number, 0])
        lead = pow(int(whole.leading_coefficient()), -1, prime)
        table = {key: self.fraction(int(c) * lead % prime) for key, c in whole.terms()}
        return self.context.from_dict(table)

    def occurring(self, found: Sequence[Polynomial]) -> Sequence[int]:
        """The parameters on which the content, without the factors found, depends."""
        lines = [[int(j == k) for j in range(len(self.names))] for k in range(len(self.names))]
        self.check_work(self.done + 2 * self.enough * len(lines))
        contents = zip(lines, self.contents(lines), strict=True)
        degrees = [self.without(found, line, content).degree() for line, content in contents]
        return [k for k, degree in enumerate(degrees) if degree > 0]

    def fraction(self, value: int) -> fmpq:
        """The simple fraction with this residue; Undefined if there is none."""
        older, newer, before, after = self.prime, value, 0, 1
        while newer * newer > self.prime >> 20:
            quotient = older // newer
            older, newer = newer, older - quotient * newer
            before, after = after, before - quotient * after
        if abs(after) > 1 << 24:
            raise Undefined
        return fmpq(newer, after)

    # Functions of parameters alone.

    def in_atoms(self, found: Sequence[str]) -> bool:
        """Whether the proof may fail where functions of parameters alone have certain values, other
        than those at the values of parameters that were found.
        """
        self.done, draw = 0, self.question.generator.randrange
        try:
            line = {place: (draw(self.prime), draw(1, self.prime)) for place in self.atoms()}
            if not line or (whole := self.without_powers(self.content(line), line)).degree() < 1:
                return False
            degree = 0
            for place, (start, slope) in line.items():
                one = {other: (begin, 0) for other, (begin, _) in line.items()}
                one[place] = start, slope
                part = whole if len(line) == 1 else self.without_powers(self.content(one), one)
                degree += max(0, part.degree())
                if self.may_vanish(part, place, start, slope, found):
                    return True
            return degree < int(whole.degree())  # else each factor holds one of them alone
        except NO_VALUE:
            self.question.check_time()
            return True

    def in_functions(self) -> bool:
        """Whether a divisor depends on a function that holds parameters beside others, in another
        way than as a factor: then it may be 0 at single values of these, as x^a - x^7 at a = 7.

        Where each divisor is a product of powers of these functions and of a factor without them,
        it is 0 where the content of this factor is.
        """
        listed = self.question.nodes.listed
        special = frozenset(node[0] for node in listed if node[0] in SPECIAL)
        if depends_on(self.question, self.generic, special):
            return True
        places = self.places_in_functions()
        choices = (False, True) if self.generic.telescopes else (False,)
        return bool(places) and not any(self.are_powers(places, last) for last in choices)

    def places_in_functions(self) -> list[int]:
        """The places of the pairs (l, e) that change with parameters and with other variables."""
        free = [name for name in self.names if name not in self.rooted]
        variables = sorted(self.question.names - {*self.names})
        for _ in range(64):
            try:
                found = [self.changing(names) for names in (free, variables)]
            except Undefined:
                self.question.check_time()
                continue
            return sorted(found[0] & found[1])
        raise Undefined

    def changing(self, names: Sequence[str]) -> set[int]:
        """The places of the pairs that change with these names.

        The value of a logarithm is drawn whatever its argument is, so that it is drawn again where
        the argument changes: that changes x^a, which is exp(a log x).
        """
        draw, plan = self.question.generator.randrange, self.question.plan.pairs
        values = dict(zip(self.names, self.base, strict=True))
        others = values | {name: draw(1, self.prime) for name in names}
        pairs = self.numbers_where(values, {}).pairs
        moved, changed = dict[int, int](), set[int]()
        for _ in range(len(pairs)):
            now = self.numbers_where(others, moved).pairs
            changed = {k for k, pair in enumerate(pairs) if pair != now[k] and k >= len(CONSTANTS)}
            more = [k for k in changed if plan[k].logarithm and k not in moved]
            if not more:
                break
            moved |= {k: draw(1, self.prime) for k in more}
        return changed

    def are_powers(self, places: Sequence[int], last: bool) -> bool:
        """Whether the divisors are powers of the free values at these places times what does not
        change with them.
        """
        values = dict(zip(self.names, self.base, strict=True))
        start = self.numbers_where(values, {}, last)
        for k in places:
            factor = self.question.generator.randrange(2, self.prime)
            known = start.pairs[k][0 if self.question.plan.pairs[k].logarithm else 1]
            moved = self.numbers_where(values, {k: known * factor % self.prime}, last)
            pairs = zip(self.whole(moved), self.whole(start), strict=True)
            quotients = (one * pow(other, -1, self.prime) for one, other in pairs)
            if not all(self.is_power(one % self.prime, factor) for one in quotients):
                return False
        return True

    def whole(self, numbers: OnAtoms) -> list[int]:
        """The divisors; their product, if only that matters."""
        found = numbers.divisors or []
        return [math.prod(found) % self.prime] if self.generic.telescopes else found

    def is_power(self, value: int, factor: int) -> bool:
        """Whether a number is a small power of the factor."""
        back = pow(factor, -1, self.prime)
        up = down = value
        for _ in range(2 * MAX_EXPONENT):
            if 1 in (up, down):
                return True
            up, down = up * factor % self.prime, down * back % self.prime
        return False

    def numbers_where(
        self, values: Mapping[str, int], moved: Mapping[int, int], last: bool = False
    ) -> OnAtoms:
        """The divisors and the pairs at the first point, for these values of names and pairs."""
        point = OnAtoms(
            self.question, self.prime, self.seeds[0], {**values}, self.rooted, last, moved
        )
        ring = self.question.expansion(point, self.generic.degree)
        divisors_of(self.generic, ring)
        found: OnAtoms = ring.arithmetic
        return found

    def atoms(self) -> list[int]:
        """The places of the pairs (l, e) that are the same at all points (t, q, q')."""
        values = dict(zip(self.names, self.base, strict=True))
        for _ in range(64):
            variables = sorted(self.question.names - {*self.names})
            other = {name: self.question.generator.randrange(1, self.prime) for name in variables}
            found = list[Any]()
            try:
                for point in (values, values | other):
                    numbers = Special(self.question, self.prime, self.seeds[0], point, self.rooted)
                    ring = self.question.expansion(numbers, self.generic.degree)
                    divisors_of(self.generic, ring)
                    found.append(ring.arithmetic.pairs)
            except Undefined:
                self.question.check_time()
                continue
            pairs = enumerate(zip(*found, self.question.plan.pairs, strict=True))
            return [
                k
                for k, (one, same, pair) in pairs
                if k >= len(CONSTANTS) and not pair.number and one == same
            ]
        raise Undefined

    def without_powers(self, content: Any, line: Mapping[int, tuple[int, int]]) -> Any:
        """The content without factors e, as no exponential is 0."""
        for place, (start, slope) in line.items():
            power = nmod_poly([start, slope], self.prime)
            while (
                not self.question.plan.pairs[place].logarithm
                and power.degree() == 1 <= (content.degree())
                and (content % power).degree() < 0
            ):
                content //= power
        return content

    def may_vanish(
        self, content: Any, place: int, start: int, slope: int, found: Sequence[str]
    ) -> bool:
        """Whether the content in one atom may be 0 for real values other than those found."""
        pair = self.question.plan.pairs[place]
        if content.degree() < 1:
            return False
        if pair.imaginary:
            return True
        share = pow(slope, -1, self.prime)
        moved = content(nmod_poly([-start * share % self.prime, share], self.prime))
        scale = pow(int(moved[moved.degree()]), -1, self.prime)
        fractions = [self.fraction(int(c) * scale % self.prime) for c in moved.coeffs()]
        size = math.lcm(*(int(c.q) for c in fractions))
        roots: list[Any] = fmpz_poly([int(c * size) for c in fractions]).complex_roots()
        known = 0 if pair.logarithm else 1
        said = any(f"{name} = {1 - known}" in found for name in self.names)
        return any(
            root.imag.contains(0)
            and (pair.logarithm or not root.real < 0)
            and not (said and root.real.contains(known))
            for root, _ in roots
        )

    # The excluded values.

    def is_left_out(self, factor: Polynomial) -> bool:
        """Whether f is defined where the factor is 0, and the claim is not proven there.

        The factor must have real zeros.
        """
        if not has_real_zeros(self.in_parameters(factor)):
            return False
        degrees = [int(e) for e in factor.degrees()]
        place = min((k for k, e in enumerate(degrees) if e), key=lambda k: degrees[k])
        base, direction = self.base, [int(k == place) for k in range(len(self.names))]
        try:
            for _ in range(8):
                self.base = self.direction()
                self.base[place] = 0
                for root, _ in self.on_line(factor, direction).roots():
                    values = {k: a for k, a in enumerate(self.base) if k != place}
                    return self.fails(values | {place: int(root)})
        finally:
            self.base = base
        return True

    def fails(self, fixed: dict[int, int]) -> bool:
        """Whether f is defined and the claim is not proven for these parameter values."""
        if not self.is_defined(fixed):
            return False
        if not self.question.rational:  # the functions may satisfy more relations there
            return True
        return not self.holds(fixed)

    def is_defined(self, fixed: dict[int, int]) -> bool:
        """Whether f is, for these parameter values."""
        try:
            self.question.expansion(self.special(fixed), 0)
        except Undefined:
            return False
        return True

    def holds(self, fixed: dict[int, int]) -> bool:
        """Whether f is defined, and the claim proven, for these parameter values."""
        outcome = self.outcome(fixed)
        return outcome is not None and self.generic.holds(outcome)

    def outcome(self, fixed: dict[int, int]) -> Any:
        """The outcome of the proof for these parameter values; None where f is not defined."""
        self.done += 1
        self.check_work(self.done)
        try:
            ring = self.question.expansion(self.special(fixed), self.generic.degree)
            return self.generic.work(ring)
        except Undefined:
            return None

    def special(self, fixed: dict[int, int]) -> Special:
        values = {self.names[k]: value for k, value in fixed.items()}
        return Special(self.question, self.prime, self.seeds[0], values, self.rooted)

    def in_parameters(self, factor: Polynomial) -> Polynomial:
        """The polynomial in the parameters that is zero where the factor is, of which some letters
        are roots of parameters, for one choice of their signs: the product over both signs.
        """
        places = [k for k, name in enumerate(self.names) if name in self.rooted]
        for k in places:
            terms = [(tuple(map(int, key)), c) for key, c in factor.terms()]
            if any(key[k] % 2 for key, _ in terms):
                factor *= self.context.from_dict({key: -c if key[k] % 2 else c for key, c in terms})
        return self.context.from_dict(
            {
                tuple(int(e) // 2 if k in places else int(e) for k, e in enumerate(key)): c
                for key, c in factor.terms()
            }
        )

    def text(self, factor: Polynomial) -> str:
        """The equation with positive coefficients on both sides; c1 = -c2 for c1 + c2 = 0."""
        sign = 1 if factor.leading_coefficient() > 0 else -1
        whole = [(tuple(map(int, key)), int(c.p)) for key, c in primitive(factor * sign).terms()]
        plain = len(whole) == 2 and all(sum(key) <= 1 and c > 0 for key, c in whole)
        left = whole[:1] if plain else [one for one in whole if one[1] > 0]
        right = [one for one in whole if one not in left]
        turned = "-" if plain else ""
        opposite = [(key, abs(c)) for key, c in right]
        return (
            f"{polynomial_text(left, self.names)} = {turned}{polynomial_text(opposite, self.names)}"
        )


def polynomial_text(terms: Iterable[tuple[Sequence[int], Any]], names: Sequence[str]) -> str:
    """The text, such as 3*x^2*y - 1, of a polynomial with these exponents and coefficients."""
    found = ""
    for exponents, coefficient in terms:
        pairs = zip(names, exponents, strict=False)
        powers = [f"{name}^{e}" if e > 1 else name for name, e in pairs if e]
        size, sign = abs(coefficient), "-" if coefficient < 0 else "+"
        word = "*".join(powers if powers and size == 1 else [str(size), *powers])
        found += f" {sign} {word}" if found else f"{sign.strip('+')}{word}"
    return found or "0"


def letters_of(polynomial: Polynomial) -> list[set[int]]:
    """The numbers of the generators in each monomial."""
    return [{k for k, e in enumerate(exponents) if e} for exponents in polynomial.monoms()]


def vanishes(polynomial: Polynomial, chosen: Set[int]) -> bool:
    """Whether it does where these generators are 0."""
    return not any(letters.isdisjoint(chosen) for letters in letters_of(polynomial))


def primitive(polynomial: Polynomial) -> Polynomial:
    """The positive multiple whose coefficients are integers without a common factor."""
    values = [coefficient for _, coefficient in polynomial.terms()]
    scale = fmpq(math.lcm(*(int(c.q) for c in values)), math.gcd(*(int(c.p) for c in values)))
    return polynomial * scale


def has_real_zeros(polynomial: Polynomial) -> bool:
    """False only for a polynomial in one generator without real roots."""
    letters = [k for k, e in enumerate(polynomial.degrees()) if e]
    if len(letters) != 1:
        return True
    coefficients = [0] * (int(polynomial.total_degree()) + 1)
    for exponents, coefficient in primitive(polynomial).terms():
        coefficients[int(exponents[letters[0]])] = int(coefficient.p)
    roots: list[Any] = fmpz_poly(coefficients).complex_roots()  # pairs (root, multiplicity)
    return any(root.imag.contains(0) for root, _ in roots)
