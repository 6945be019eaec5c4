"""The generators of f from which the search builds its ansätze, their antiderivatives, and integrating factors."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import Any

from inverse_service import bounds, errors
from inverse_service.decision.deciding import Analysis
from inverse_service.expressions import evaluation, tree as ex
from inverse_service.field import exact_field, real_point
from inverse_service.mechanics import conditions
from inverse_service.search import angles, terms as tm


@dataclass(frozen=True, slots=True)
class Material:
    """f as terms, with generators sorted by the variables they depend on; `shared` caches results that rungs share."""

    analysis: Analysis
    motion: tm.MotionTerms
    position_letters: tuple[ex.Expression, ...]
    velocity_letters: tuple[ex.Expression, ...]
    shared: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


def gather(analysis: Analysis, with_time: bool) -> Material:
    """The material of a system; TooManyTerms if f cannot be written as a moderate sum."""
    system = analysis.system
    trees = _factored(analysis)
    pairs = zip(trees, system.accelerations, strict=True)
    forces = tuple(oriented(_shorter(*pair), analysis.real_point) for pair in pairs)
    motion = tm.MotionTerms(
        tuple(ex.Symbol(name) for name in system.coordinates),
        tuple(ex.Velocity(name) for name in system.coordinates),
        forces,
        with_time,
    )
    letters = _letters(forces)
    position = [p for p in letters if not tm.has_velocity(p) and ex.holds(p, ex.TIME, *motion.coordinates)]
    moving = [p for p in letters if tm.has_velocity(p) and not isinstance(p, ex.Velocity)]
    return Material(analysis, motion, tuple(position), tuple(moving))


def _factored(analysis: Analysis) -> list[ex.Expression]:
    """f with factored numerators and denominators, simplified by known relations among atoms."""
    system = analysis.system
    with suppress(exact_field.TooLarge, ZeroDivisionError):
        exact = conditions.motion_in_ring(system, 0, exact_field.Budget.long())
        return [exact_field.quotient_tree(exact.ring, value) for value in exact.motion.accelerations]
    return list(system.accelerations)


def _shorter(factored: ex.Expression, given: ex.Expression) -> tm.Terms:
    """The expansion with fewer terms, because a common denominator can turn a few terms into many."""
    found = []
    for tree in (factored, given):
        with suppress(tm.TooManyTerms):
            found.append(tm.terms_of(tree))
    if not found:
        raise tm.TooManyTerms
    return min(found, key=len)


def simplified(material: Material, terms: tm.Terms) -> tm.Terms:
    """The sum over its common denominator with common factors cancelled, if that is shorter."""
    tree, symbols = tm.tree_of(terms), material.analysis.system.variables
    with suppress(exact_field.TooLarge, ZeroDivisionError, tm.TooManyTerms):
        other = tm.terms_of(exact_field.factored([tree], symbols, exact_field.Budget.long())[0])
        return min(terms, other, key=len)
    return terms


def oriented(terms: tm.Terms, table: real_point.RealTable | None) -> tm.Terms:
    """The terms with sums that are negative at the real point replaced by their opposites, which have roots."""
    result: tm.Terms = {}
    for key, value in terms.items():
        product = tm.EMPTY
        for letter, e in key:
            turned = positive(letter, table) if isinstance(letter, ex.Sum) and e.denominator == 1 else letter
            value = -value if turned != letter and e % 2 else value
            product = tm.times(product, frozenset([(turned, e)]))
        result = tm.add_terms(result, {product: value})
    return result


def _letters(forces: Iterable[tm.Terms]) -> list[ex.Expression]:
    """The generators of f, the symbols inside its sums, the partner of each sine and cosine, and A for A'."""
    found: dict[ex.Expression, None] = {}
    for terms in forces:
        for key in terms:
            for letter, _ in key:
                if not isinstance(letter, ex.Number):
                    found[letter] = None
                if isinstance(letter, ex.Sum):
                    found.update(dict.fromkeys(node for node in ex.walk(letter) if isinstance(node, ex.Symbol)))
    for letter in list(found):
        for other in companions(letter):
            found[other] = None
    return list(found)


def companions(letter: ex.Expression) -> list[ex.Expression]:
    """cos for sin, sin for cos, cosh for sinh, sinh for cosh, and A for A' or A''."""
    match letter:
        case ex.Apply(function, argument) if function in angles.SQUARES:
            return [ex.Apply(angles.SQUARES[function][0], argument)]
        case ex.Arbitrary(name, arguments, orders) if any(orders):
            place = next(k for k, order in enumerate(orders) if order)
            lower = tuple(order - (k == place) for k, order in enumerate(orders))
            below = ex.Arbitrary(name, arguments, lower)
            return [below, *companions(below)]
    return []


def moving_letters(material: Material) -> list[ex.Expression]:
    """The factors and radicands of f that are sums with velocities, and the nonexponential functions of velocities."""
    if "moving letters" not in material.shared:
        table, found = material.analysis.real_point, _moving_letters(material)
        shown = (positive(letter, table) if isinstance(letter, ex.Sum) else letter for letter in found)
        material.shared["moving letters"] = list(dict.fromkeys(shown))
    return list(material.shared["moving letters"])


def _moving_letters(material: Material) -> Iterator[ex.Expression]:
    """Generators of f are kept whole, such as 1 - v^2 under a root; other sums, as in an expanded f, are factored."""
    known = [p for p in material.velocity_letters if not ex.is_exponential(p)]
    yield from (p for p in known if not isinstance(p, ex.Sum) or _is_plain(p))
    for node in dict.fromkeys(node for f in material.analysis.system.accelerations for node in ex.walk(f)):
        if isinstance(node, ex.Sum) and tm.has_velocity(node):
            with suppress(tm.TooManyTerms, exact_field.TooLarge):
                whole = tm.split_content(terms)[2] if (terms := tm.terms_of(node)) else node  # a sum may be 0
                parts = () if whole in known or ex.negated(whole) in known else tm.irreducible_factors(node)
                yield from (p for p in parts if tm.has_velocity(p) and _is_plain(p))


def positive(tree: ex.Expression, table: real_point.RealTable | None) -> ex.Expression:
    """The tree, or its opposite if that is positive at the real point, so that its roots exist."""
    with suppress(errors.IrreducibleAtoms, evaluation.NoRealValue):
        if table is not None and real_point.real_sign(tree, table) < 0:
            return ex.negated(tree)
    return tree


def _is_plain(node: ex.Expression) -> bool:
    """Whether this is a short sum without roots."""
    exponents = [part.exponent for part in ex.walk(node) if isinstance(part, ex.Power)]
    whole = all(isinstance(e, ex.Number) and e.value.denominator == 1 for e in exponents)
    return whole and ex.node_count(node) <= bounds.NODES


@lru_cache(maxsize=8192)
def antiderivatives(key: tm.Monomial, variable: ex.Expression) -> tuple[tm.Monomial, ...]:
    """Monomials whose derivative by the variable may contain `key`, found by raising one generator at a time."""
    letters = dict.fromkeys([variable, *(letter for letter, _ in key)])
    for letter in list(letters):
        letters.update(dict.fromkeys(companions(letter)))
        if isinstance(letter, ex.Apply) and isinstance(letter.argument, ex.Sum):
            letters[letter.argument] = None  # (x + 1) log(x + 1)
    found: dict[tm.Monomial, None] = dict.fromkeys(
        tm.times(key, tm.monomial(p, q)) for p, _ in key for q in companions(p) if isinstance(p, ex.Apply)
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
    found.pop(tm.EMPTY, None)
    return tuple(found)


def _raised_powers(key: tm.Monomial, variable: ex.Expression) -> list[tm.Monomial]:
    """p^(e+1) / ((e+1) dp) for p^e with a symbolic exponent, combined with an adjacent numeric power of p."""
    found = []
    for letter, times_over in key:
        if not isinstance(letter, ex.Power) or isinstance(letter.exponent, ex.Number):
            continue
        base, beside = letter.base, dict(key).get(letter.base, Fraction(0))
        raised_exponent = times_over * letter.exponent + beside + 1
        if isinstance(raised_exponent, ex.Sum):
            whole = tm.times(tm.times(key, tm.monomial(base)), tm.monomial(raised_exponent), -1)
            found += [tm.times(whole, unit, -1) for unit in tm.letter_derivative(base, variable)]
    return found


def integrating_candidates(material: Material) -> list[tuple[int, tm.Terms, ex.Symbol]]:
    """(i, c, variable) for each desired factor exp(-int c d variable), from c v_i v_l, c v_i^2, c v_i in f_i."""
    motion = material.motion
    found: list[tuple[int, tm.Terms, ex.Symbol]] = []
    for i, (v, f) in enumerate(zip(motion.velocities, motion.forces, strict=True)):
        for q, w in zip(motion.coordinates, motion.velocities, strict=True):
            c = simplified(material, tm.coefficient(f, tm.monomial(v, w)))
            if c:
                found.append((i, c, q))
        drag = simplified(material, tm.coefficient(f, tm.monomial(v))) if motion.with_time else {}
        still = {key: c for key, c in drag.items() if not any(ex.holds(p, *motion.coordinates) for p, _ in key)}
        if still and (len(still) == len(drag) or motion.size == 1):
            found.append((i, still, ex.TIME))
    return found


def distinct(parts: Sequence[tm.Monomial]) -> list[tm.Monomial]:
    """The monomials without duplicates, simple ones first."""
    return sorted(dict.fromkeys(parts), key=tm.rank)
