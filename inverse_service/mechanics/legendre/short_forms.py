"""Short forms of trees: collected, or as one factored quotient, whichever is smaller."""

from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from math import isqrt

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import implicit_equations, writing

# Terms met on the way (`Budget`) in exact work on one tree.
_WORK = 20_000
_INVERSE = {("atan", "tan"), ("log", "exp"), ("exp", "log"), ("asin", "sin"), ("acos", "cos"), ("atanh", "tanh")}


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
    if max(implicit_equations.expanded_terms(plain)) > implicit_equations.MOST_TERMS:
        return tree
    try:
        ring = implicit_equations.OpaqueRing([plain])
        return collecting.merge_powers(ring.tree(ring.fraction(plain)))
    except (ZeroDivisionError, errors.LimitError):
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
    inner = ex.rebuild(tree, with_cosines)
    match inner:
        case ex.Sum((ex.Power(ex.Apply("tan", argument), ex.Number(value)), rest)) | ex.Sum(
            (rest, ex.Power(ex.Apply("tan", argument), ex.Number(value)))
        ) if value == 2 and rest == ex.ONE:
            return ex.Apply("cos", argument) ** -2
        case _:
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
    inner = ex.rebuild(tree, _apart)
    match inner:
        case ex.Power(ex.Product(factors), exponent) if not _is_whole(exponent):
            return ex.multiply(*(_apart(factor**exponent) for factor in factors))
        case ex.Power(ex.Power(base, ex.Number(value)), ex.Number(exponent)):
            return base ** (value * exponent)
        case _:
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
            squares = [factor for factor in factors if _is_square(factor)]
            rest = ex.multiply(*(factor for factor in factors if not _is_square(factor)))
            whole = ex.multiply(ex.number(sign), *(_root_of_square(factor) for factor in squares))
            return whole**e.numerator * rest**e if squares else inner
        case ex.Power(ex.Power() as square, ex.Number(e)) if e.denominator == 2 and _is_square(square):
            return (sign * _root_of_square(square)) ** e.numerator
        case ex.Power(ex.Sum() as base, ex.Number(e)) if e.denominator == 2 and not isinstance(
            short := quotient(writing.one_square(base)), ex.Sum
        ):
            return _cancelled(short**e, sign)
        case _:
            return inner


def _is_square(factor: ex.Expression) -> bool:
    match factor:
        case ex.Power(_, ex.Number(value)):
            return value.denominator == 1 and value % 2 == 0
        case ex.Number(value):
            return (
                value > 0
                and isqrt(value.numerator) ** 2 == value.numerator
                and (isqrt(value.denominator) ** 2 == value.denominator)
            )
    return False


def _root_of_square(factor: ex.Expression) -> ex.Expression:
    match factor:
        case ex.Power(base, ex.Number(value)):
            return base ** (value / 2)
        case ex.Number(value):
            return ex.number(Fraction(isqrt(value.numerator), isqrt(value.denominator)))
    raise ValueError("the factor is not a square")


def _is_whole(exponent: ex.Expression) -> bool:
    return isinstance(exponent, ex.Number) and exponent.value.denominator == 1


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
