"""The material of a search: f as terms for one question, its generators, and what they suggest."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

from inverse_service import bounds, errors
from inverse_service.decision.deciding import Analysis
from inverse_service.expressions import calculus, functions, terms as tm, tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import conditions
from inverse_service.statements.questions import Question

# What an attempt at another form may raise; the caller continues without it.
FAILED = (
    errors.InputError, errors.IrreducibleAtoms, exact_field.TooLarge, tm.TooManyTerms, ZeroDivisionError, ValueError,
    KeyError,
)  # fmt: skip


def over_one_denominator(
    trees: Sequence[ex.Expression],
    variables: Sequence[ex.Symbol | ex.Velocity],
    budget: exact_field.Budget,
) -> list[tm.Terms]:
    """The trees as terms, each over one denominator with common factors cancelled; TooLarge beyond
    the budget.
    """
    return list(map(tm.terms_of, exact_field.factored(trees, variables, budget)))


def divided(
    tops: Sequence[tm.Terms],
    below: tm.Terms,
    variables: Sequence[ex.Symbol | ex.Velocity],
    budget: exact_field.Budget,
) -> list[tm.Terms]:
    """The quotients of sums by one sum, with common factors cancelled."""
    if len(below) == 1:
        ((key, value),) = below.items()
        return [tm.multiply_by(terms, key, -1, 1 / value) for terms in tops]
    found = [tm.monomial_factor(terms, below) if terms else {} for terms in tops]
    if None in found:
        return over_one_denominator(
            [tm.tree_of(terms) / tm.tree_of(below) for terms in tops], variables, budget
        )
    return [terms for terms in found if terms is not None]


# The motion, and terms by their dependence on the velocities.


@dataclass(frozen=True, slots=True)
class MotionTerms:
    """q'' = f with f expanded, and the question whether it has an L."""

    coordinates: tuple[ex.Symbol, ...]
    velocities: tuple[ex.Velocity, ...]
    forces: tuple[tm.Terms, ...]
    question: Question

    @property
    def size(self) -> int:
        return len(self.coordinates)


def rate_of_terms(motion: MotionTerms, terms: Mapping[tm.Monomial, Fraction]) -> tm.Terms:
    """Gamma(terms)."""
    pairs = zip(motion.velocities, motion.forces, strict=True)
    parts = (tm.multiply_terms(tm.derivative_of_terms(terms, v), f) for v, f in pairs)
    return tm.sum_of((rate_at_constant_velocity(terms, motion.coordinates), *parts))


def rate_at_constant_velocity(
    terms: Mapping[tm.Monomial, Fraction], coordinates: Iterable[ex.Symbol]
) -> tm.Terms:
    """D = d_t + v_k d_k of the terms, which is Gamma without its part f_k d_vk."""
    parts = (
        tm.multiply_by(tm.derivative_of_terms(terms, q), tm.monomial(ex.Velocity(q.name)))
        for q in coordinates
    )
    return tm.sum_of((tm.derivative_of_terms(terms, ex.TIME), *parts))


@dataclass(frozen=True, slots=True)
class Material:
    """f as terms for one question (`motion.question`), with its generators of position and with
    velocities.

    `shared` caches results that depend on the question.
    """

    analysis: Analysis
    motion: MotionTerms
    position_letters: tuple[ex.Expression, ...]
    velocity_letters: tuple[ex.Expression, ...]
    shared: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


def for_question(material: Material, question: Question) -> Material:
    """The material for the other question, L(q, v) or L(t, q, v)."""
    return replace(material, motion=replace(material.motion, question=question), shared={})


def gather_material(analysis: Analysis, question: Question) -> Material:
    """The material of a system; TooManyTerms if f cannot be written as a moderate sum."""
    system = analysis.system
    trees = _factored(analysis)
    pairs = zip(trees, system.accelerations, strict=True)
    forces = tuple(
        with_positive_sums(_shorter_expansion(*pair), analysis.real_point) for pair in pairs
    )
    motion = MotionTerms(
        tuple(ex.Symbol(name) for name in system.coordinates),
        tuple(ex.Velocity(name) for name in system.coordinates),
        forces,
        question,
    )
    letters = _letters(forces)
    position = [
        p for p in letters if not tm.has_velocity(p) and ex.holds(p, ex.TIME, *motion.coordinates)
    ]
    moving = [p for p in letters if tm.has_velocity(p) and not isinstance(p, ex.Velocity)]
    return Material(analysis, motion, tuple(position), tuple(moving))


def _factored(analysis: Analysis) -> list[ex.Expression]:
    """f with factored numerators and denominators, simplified by known relations among atoms."""
    system = analysis.system
    with suppress(exact_field.TooLarge, ZeroDivisionError):
        exact = conditions.motion_in_ring(system, 0, exact_field.Budget.long())
        return [
            exact_field.quotient_tree(exact.ring, value) for value in exact.motion.accelerations
        ]
    return list(system.accelerations)


def _shorter_expansion(factored: ex.Expression, given: ex.Expression) -> tm.Terms:
    """The expansion with fewer terms, because a common denominator can turn a few terms into
    many.
    """
    with suppress(tm.TooManyTerms):
        short = tm.terms_of(factored)
        with suppress(tm.TooManyTerms):
            return min(short, tm.terms_of(given), key=len)
        return short
    return tm.terms_of(given)


def simplified(material: Material, terms: tm.Terms) -> tm.Terms:
    """The sum over its common denominator with common factors cancelled, if that is shorter."""
    tree, symbols = tm.tree_of(terms), material.analysis.system.variables
    with suppress(exact_field.TooLarge, ZeroDivisionError, tm.TooManyTerms):
        return min(
            terms, *over_one_denominator([tree], symbols, exact_field.Budget.long()), key=len
        )
    return terms


def with_positive_sums(terms: tm.Terms, table: real_branch.RealTable | None) -> tm.Terms:
    """The terms with sums that are negative at the real point replaced by their opposites, which
    have roots.
    """
    result: tm.Terms = {}
    for key, value in terms.items():
        product = tm.EMPTY
        for letter, e in key:
            turned = (
                positive_form(letter, table)
                if isinstance(letter, ex.Sum) and e.denominator == 1
                else letter
            )
            value = -value if turned != letter and e % 2 else value
            product = tm.times(product, frozenset([(turned, e)]))
        result = tm.add_terms(result, {product: value})
    return result


def _letters(forces: Iterable[tm.Terms]) -> list[ex.Expression]:
    """The generators of f, the symbols inside its sums, the partner of each sine and cosine, and A
    for A'.
    """
    found: dict[ex.Expression, None] = {}
    for terms in forces:
        for key in terms:
            for letter, _ in key:
                if not isinstance(letter, ex.Number):
                    found[letter] = None
                if isinstance(letter, ex.Sum):
                    found.update(
                        dict.fromkeys(
                            node for node in ex.walk(letter) if isinstance(node, ex.Symbol)
                        )
                    )
    for letter in list(found):
        for other in companions(letter):
            found[other] = None
    return list(found)


def companions(letter: ex.Expression) -> list[ex.Expression]:
    """cos for sin, sin for cos, cosh for sinh, sinh for cosh, and A for A' or A''."""
    match letter:
        case ex.Apply(function, argument) if function in functions.SQUARES:
            return [ex.Apply(functions.SQUARES[function][0], argument)]
        case ex.Apply(function) if function in functions.FUNCTION:
            return [*functions.FUNCTION[function].partners(*functions.arguments_of(letter))]
        case ex.Arbitrary(name, arguments, orders) if any(orders):
            place = next(k for k, order in enumerate(orders) if order)
            lower = tuple(order - (k == place) for k, order in enumerate(orders))
            below = ex.Arbitrary(name, arguments, lower)
            return [below, *companions(below)]
    return []


def moving_letters(material: Material) -> list[ex.Expression]:
    """The factors and radicands of f that are sums with velocities, and the nonexponential
    functions of velocities.
    """
    if "moving letters" not in material.shared:
        table, found = material.analysis.real_point, _moving_letters(material)
        shown = (
            positive_form(letter, table) if isinstance(letter, ex.Sum) else letter
            for letter in found
        )
        material.shared["moving letters"] = list(dict.fromkeys(shown))
    return list(material.shared["moving letters"])


def _moving_letters(material: Material) -> Iterator[ex.Expression]:
    """Generators of f are kept whole, such as 1 - v^2 under a root; other sums, as in an expanded
    f, are factored.
    """
    known = [p for p in material.velocity_letters if not ex.is_exponential(p)]
    yield from (p for p in known if not isinstance(p, ex.Sum) or _is_plain(p))
    for node in dict.fromkeys(
        node for f in material.analysis.system.accelerations for node in ex.walk(f)
    ):
        if isinstance(node, ex.Sum) and tm.has_velocity(node):
            with suppress(tm.TooManyTerms, exact_field.TooLarge):
                whole = (
                    tm.split_content(terms)[2] if (terms := tm.terms_of(node)) else node
                )  # a sum may be 0
                parts = (
                    ()
                    if whole in known or ex.negated(whole) in known
                    else tm.irreducible_factors(node)
                )
                yield from (p for p in parts if tm.has_velocity(p) and _is_plain(p))


def positive_form(tree: ex.Expression, table: real_branch.RealTable | None) -> ex.Expression:
    """The tree, or its opposite if that is positive at the real point, so that its roots exist."""
    with suppress(errors.IrreducibleAtoms, calculus.NoRealValue):
        if table is not None and real_branch.real_sign(tree, table) < 0:
            return ex.negated(tree)
    return tree


def _is_plain(node: ex.Expression) -> bool:
    """Whether this is a short sum without roots."""
    exponents = [part.exponent for part in ex.walk(node) if isinstance(part, ex.Power)]
    whole = all(isinstance(e, ex.Number) and e.value.denominator == 1 for e in exponents)
    return whole and ex.node_count(node) <= bounds.NODES


@lru_cache(maxsize=8192)
def antiderivative_candidates(key: tm.Monomial, variable: ex.Expression) -> tuple[tm.Monomial, ...]:
    """Monomials whose derivative by the variable may contain `key`, found by raising one generator
    at a time.
    """
    letters = dict.fromkeys([variable, *(letter for letter, _ in key)])
    for letter in list(letters):
        letters.update(dict.fromkeys(companions(letter)))
        if isinstance(letter, ex.Apply) and isinstance(letter.argument, ex.Sum):
            letters[letter.argument] = None  # (x + 1) log(x + 1)
    found: dict[tm.Monomial, None] = dict.fromkeys(
        tm.times(key, tm.monomial(p, q))
        for p, _ in key
        for q in companions(p)
        if isinstance(p, ex.Apply)
    )  # sin(x)/cos(x) for 1/cos(x)^2
    for letter in letters:
        try:
            slope = tm.letter_derivative(letter, variable)
        except tm.TooManyTerms:
            continue
        for unit in slope:
            raised = tm.times(tm.times(key, tm.monomial(letter)), unit, -1)
            if any(p == letter for p, _ in raised) or letter == variable:
                found[raised] = None
            if not any(p == letter for p, _ in raised):
                found[tm.times(raised, tm.monomial(ex.Apply("log", letter)))] = None
    roots = [letter for letter, e in key if isinstance(letter, ex.Sum) and e == Fraction(-1, 2)]
    if len(roots) == 2:  # sqrt(x - 1) sqrt(x + 1), whose slope is x over it
        found[tm.times(tm.times(key, tm.monomial(*roots)), tm.monomial(variable), -1)] = None
    found.update(dict.fromkeys(_raised_powers(key, variable)))
    found.update(dict.fromkeys(_listed_primitives(key, variable)))
    found.pop(tm.EMPTY, None)
    return tuple(found)


def _listed_primitives(key: tm.Monomial, variable: ex.Expression) -> list[tm.Monomial]:
    """The terms of the primitive of f over u' for a function f(u) with one in the table."""
    found = []
    for letter, _ in key:
        row = functions.FUNCTION.get(letter.function) if isinstance(letter, ex.Apply) else None
        if row is None or row.primitive is None or not isinstance(letter, ex.Apply):
            continue
        for unit in tm.terms_of(calculus.differentiate(letter.argument, variable)):
            below = tm.times(tm.times(key, tm.monomial(letter), -1), unit, -1)
            found += [tm.times(below, part) for part in tm.terms_of(row.primitive(letter.argument))]
    return found


def _raised_powers(key: tm.Monomial, variable: ex.Expression) -> list[tm.Monomial]:
    """p^(e+1) / ((e+1) dp) for p^e with a symbolic exponent, combined with an adjacent numeric
    power of p.
    """
    found = []
    for letter, times_over in key:
        if not isinstance(letter, ex.Power) or isinstance(letter.exponent, ex.Number):
            continue
        base, beside = letter.base, tm.exponent_of(key, letter.base)
        raised_exponent = times_over * letter.exponent + beside + 1
        if isinstance(raised_exponent, ex.Sum):
            whole = tm.times(tm.times(key, tm.monomial(base)), tm.monomial(raised_exponent), -1)
            found += [tm.times(whole, unit, -1) for unit in tm.letter_derivative(base, variable)]
    return found


def integrating_candidates(material: Material) -> list[tuple[int, tm.Terms, ex.Symbol]]:
    """(i, c, variable) for each factor exp(-int c d variable) to try, from c v_i v_l, c v_i^2, c
    v_i in f_i.

    The part c(t) of a drag c v_i gives a function of t if it is the whole drag or, for one
    coordinate, in any case.
    """
    motion = material.motion
    found: list[tuple[int, tm.Terms, ex.Symbol]] = []
    for i, (v, f) in enumerate(zip(motion.velocities, motion.forces, strict=True)):
        for q, w in zip(motion.coordinates, motion.velocities, strict=True):
            c = simplified(material, tm.coefficient(f, tm.monomial(v, w)))
            if c:
                found.append((i, c, q))
        drag = (
            simplified(material, tm.coefficient(f, tm.monomial(v))) if motion.question.timed else {}
        )
        still = {key: c for key, c in drag.items() if not tm.depends_on([key], *motion.coordinates)}
        if still and (len(still) == len(drag) or motion.size == 1):
            found.append((i, still, ex.TIME))
    return found
