"""Short forms of trees: collected, or as one factored quotient, whichever is smaller."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from math import isqrt

from inverse_service import bounds, deadline
from inverse_service.deadline import end
from inverse_service.errors import IrreducibleAtoms, LimitError
from inverse_service.expressions.collecting import collect, expand
from inverse_service.expressions.collecting_trees import merge_powers, separate_tree
from inverse_service.expressions.tree import (
    MINUS_ONE,
    ONE,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    children,
    factors_of,
    multiply,
    negate,
    negated,
    node_count,
    number,
    rebuild,
    substitute,
    walk,
)
from inverse_service.field.exact_field import Budget, TooLarge, factored
from inverse_service.mechanics.implicit_equations import MOST_TERMS, OpaqueRing, expanded_terms

# Terms met on the way (`Budget`) in exact work on one tree.
_WORK = 20_000


def velocities_in(tree: Expression, names: Collection[str]) -> set[str]:
    """The coordinates among `names` whose velocities occur."""
    return {node.coordinate for node in walk(tree) if isinstance(node, Velocity) and node.coordinate in names}


def separated(tree: Expression) -> Expression:
    """The tree expanded, exponentials as powers of atoms so that quotients of them cancel."""
    return add(*(value * separate_tree(monomial) for monomial, value in expand(tree)))


@lru_cache(maxsize=512)
def quotient(tree: Expression) -> Expression:
    """The tree as one factored quotient of polynomials in atoms; as it is where that is too large."""
    plain = separated(tree)
    if max(expanded_terms(plain)) > MOST_TERMS:
        return tree
    try:
        ring = OpaqueRing([plain])
        return merge_powers(ring.tree(ring.fraction(plain)))
    except (ZeroDivisionError, LimitError):
        return tree


def shortest(forms: Sequence[Expression]) -> Expression:
    """The smallest of some equal trees; of those of the same size the first with the fewest terms."""
    return min(forms, key=lambda form: (node_count(form), len(form.terms) if isinstance(form, Sum) else 1))


@lru_cache(maxsize=512)
def simplified(tree: Expression) -> Expression:
    """The shortest of: the tree as it is, collected, as one quotient; with sin^2 = 1 - cos^2 where both occur."""
    collected, merged = collect(tree), merge_powers(tree)
    forms = [collected, merged]
    if _is_monomial(collected):  # as momenta and energies of many masses are
        return shortest(forms)
    forms += [quotient(collected), *([quotient(merged)] if node_count(merged) < node_count(collected) else [])]
    for other in _without_squares(collected):
        forms += [collect(other), quotient(other)]
    return shortest(forms)


def without_cancelling(tree: Expression) -> Expression:
    """The tree without functions whose factors cancel, what is inside the others as it is; else the tree itself."""
    letters: dict[Expression, Expression] = {node: Symbol(f"function {k}") for k, node in enumerate(_outermost(tree))}
    plain = simplified(substitute(tree, letters)) if letters else tree
    if {*letters.values()} <= {*walk(plain)}:
        return tree
    return substitute(plain, {letter: node for node, letter in letters.items()})


def _outermost(tree: Expression) -> dict[Expression, None]:
    if isinstance(tree, Apply):
        return {tree: None}
    return dict.fromkeys(node for child in children(tree) for node in _outermost(child))


def related(tree: Expression) -> Expression:
    """A long tree as one quotient, with the relations among its roots and functions used, where that is shorter."""
    return tree if node_count(tree) <= bounds.NODES else shortest([tree, exact_quotient(tree)])


def exact_quotient(tree: Expression) -> Expression:
    """The tree as one factored quotient in which all relations are used; as it is where that is too large."""
    letters = dict.fromkeys(node for node in walk(tree) if isinstance(node, Symbol | Velocity))
    try:
        return factored([tree], list(letters), Budget(bounds.EXPANSION, end(), _WORK))[0]
    except (TooLarge, ZeroDivisionError, KeyError, IrreducibleAtoms):
        return tree


def exponentials_above(tree: Expression) -> Expression:
    """exp(-u) for 1/exp(u)."""
    match rebuild(tree, exponentials_above):
        case Power(Apply("exp", argument), Number(value)) if value < 0:
            return Apply("exp", value * argument)
        case Power(Product(factors), Number(value)) if value.denominator == 1:
            return multiply(*(exponentials_above(factor**value) for factor in factors))
        case other:
            return other


def inside(tree: Expression) -> Expression:
    """The tree with each sum that a function is taken of as one quotient, where that is shorter."""
    match rebuild(tree, inside):
        case Apply(function, Sum() as argument):
            return Apply(function, shortest([argument, _turned(quotient(argument))]))
        case other:
            return other


def _turned(tree: Expression) -> Expression:
    """-(a - b) c as (b - a) c."""
    match tree:
        case Product((Number(value), *rest)) if value < 0:
            place = next((k for k, factor in enumerate(rest) if isinstance(factor, Sum)), None)
            if place is not None:
                return multiply(number(-value), *rest[:place], negated(rest[place]), *rest[place + 1 :])
    return tree


def _is_monomial(tree: Expression) -> bool:
    factors = factors_of(tree)
    bases = (factor.base if isinstance(factor, Power) else factor for factor in factors)
    return all(isinstance(base, Number | Symbol | Velocity) for base in bases)


def trigonometric(tree: Expression) -> Expression:
    """The tree, or the shortest form of it with sin^2 = 1 - cos^2 where both occur."""
    return shortest([tree, *(quotient(other) for other in _without_squares(tree))])


def with_cosines(tree: Expression) -> Expression:
    """The tree with 1/cos^2 for 1 + tan^2."""
    inner = rebuild(tree, with_cosines)
    match inner:
        case Sum((Power(Apply("tan", argument), Number(value)), rest)) | Sum(
            (rest, Power(Apply("tan", argument), Number(value)))
        ) if value == 2 and rest == ONE:
            return Apply("cos", argument) ** -2
        case _:
            return inner


def _without_squares(tree: Expression) -> Iterator[Expression]:
    """The tree with the squares of sines, and with those of cosines, written by the other function."""
    nodes = {node for node in walk(tree) if isinstance(node, Apply)}
    for function, other in (("sin", "cos"), ("cos", "sin")):
        both = {n.argument for n in nodes if n.function == function and Apply(other, n.argument) in nodes}
        if both:
            yield _squares_replaced(tree, function, other, both, {})


def _squares_replaced(
    tree: Expression, function: str, other: str, both: Collection[Expression], known: dict[Expression, Expression]
) -> Expression:
    """`known`: parts that occur often are replaced once."""
    if tree not in known:
        deadline.check(0)
        known[tree] = _square_replaced(
            rebuild(tree, lambda part: _squares_replaced(part, function, other, both, known)), function, other, both
        )
    return known[tree]


def _square_replaced(inner: Expression, function: str, other: str, both: Collection[Expression]) -> Expression:
    match inner:
        case Power(Apply(name, argument), Number(value)) if name == function and argument in both:
            whole = value.numerator // 2 if value.denominator == 1 and value > 1 else 0
            square = 1 - Apply(other, argument) ** 2
            return square**whole * Apply(name, argument) ** (value - 2 * whole)
        case _:
            return inner


def roots_apart(tree: Expression) -> Expression:
    """The tree with (u w)^r = u^r w^r and (u^a)^r = u^(a r), which is wrong where a factor is negative."""
    apart = _apart(tree)
    return tree if apart == tree else simplified(apart)


def _apart(tree: Expression) -> Expression:
    inner = rebuild(tree, _apart)
    match inner:
        case Power(Product(factors), exponent) if not _is_whole(exponent):
            return multiply(*(_apart(factor**exponent) for factor in factors))
        case Power(Power(base, Number(value)), Number(exponent)):
            return base ** (value * exponent)
        case _:
            return inner


def squares_together(tree: Expression) -> Expression:
    """The tree with (u^4/w^2)^(2/3) w^2/u^2 as (u^2)^(1/3) (w^2)^(1/3): even powers under roots and beside them."""
    inner = rebuild(tree, squares_together)
    factors = factors_of(inner)
    table: dict[Expression, Fraction] = {}
    rest: list[Expression] = []
    for factor in factors:
        squares = _squares_under_root(factor)
        for base, e in squares.items():
            table[base] = table.get(base, Fraction(0)) + e
        rest += [] if squares else [factor]
    if not table:
        return inner
    for k, factor in enumerate(rest):
        match factor:
            case Power(base, Number(e)) if base in table and _is_square(factor):
                table[base] += e / 2
                rest[k] = ONE
    together = {e: multiply(*(base**2 for base in table if table[base] == e)) for e in table.values()}
    return multiply(*rest, *(product**e for e, product in together.items()))


def _squares_under_root(factor: Expression) -> dict[Expression, Fraction]:
    """{u: m e} for a root (product of u^(2 m))^e; empty for all else."""
    match factor:
        case Power(base, Number(e)) if e.denominator > 1:
            known: dict[Expression, Fraction] = {}
            for part in factors_of(base):
                match part:
                    case Power(u, Number(whole)) if _is_square(part):
                        known[u] = whole * e / 2
                    case _:
                        return {}
            return known
    return {}


def cancelled(sign: int, tree: Expression) -> Expression:
    """The tree with sqrt(u^2) = sign u, atan(tan u) = u and log(exp u) = u, which hold on one branch only; shorter."""
    found = _cancelled(tree, sign)
    return tree if found == tree else simplified(found)


_INVERSE = {("atan", "tan"), ("log", "exp"), ("exp", "log"), ("asin", "sin"), ("acos", "cos"), ("atanh", "tanh")}


def _cancelled(tree: Expression, sign: int) -> Expression:
    inner = rebuild(tree, lambda part: _cancelled(part, sign))
    match inner:
        case Apply(outer, Apply(function, argument)) if (outer, function) in _INVERSE:
            return argument
        case Power(Product(factors), Number(e)) if e.denominator == 1:
            return multiply(*(factor**e for factor in factors))
        case Power(Product(factors), Number(e)) if e.denominator == 2:
            squares = [factor for factor in factors if _is_square(factor)]
            rest = multiply(*(factor for factor in factors if not _is_square(factor)))
            whole = multiply(number(sign), *(_root_of_square(factor) for factor in squares))
            return whole**e.numerator * rest**e if squares else inner
        case Power(Power() as square, Number(e)) if e.denominator == 2 and _is_square(square):
            return (sign * _root_of_square(square)) ** e.numerator
        case Power(Sum() as base, Number(e)) if e.denominator == 2 and not isinstance(short := quotient(base), Sum):
            return _cancelled(short**e, sign)
        case _:
            return inner


def _is_square(factor: Expression) -> bool:
    match factor:
        case Power(_, Number(value)):
            return value.denominator == 1 and value % 2 == 0
        case Number(value):
            return (
                value > 0
                and isqrt(value.numerator) ** 2 == value.numerator
                and (isqrt(value.denominator) ** 2 == value.denominator)
            )
    return False


def _root_of_square(factor: Expression) -> Expression:
    match factor:
        case Power(base, Number(value)):
            return base ** (value / 2)
        case Number(value):
            return number(Fraction(isqrt(value.numerator), isqrt(value.denominator)))
    raise ValueError("the factor is no square")


def _is_whole(exponent: Expression) -> bool:
    return isinstance(exponent, Number) and exponent.value.denominator == 1


def sign_part(tree: Expression) -> Expression:
    """A short tree with the sign of this one, wherever it is not zero."""
    short = quotient(collect(tree))
    signs = [_sign_factor(factor) for factor in factors_of(short)]
    product = multiply(*signs)
    match product:
        case Product((Number(value), Sum(terms))) if value < 0:
            return add(*map(negate, terms))
        case _:
            return shortest([collect(product), product])


def _sign_factor(factor: Expression) -> Expression:
    match factor:
        case Number(value) if value:
            return ONE if value > 0 else MINUS_ONE
        case Power(base, Number(value)) if value.denominator == 1:
            return base if value % 2 else ONE
        case Power(_, Number()) | Apply("exp", _):
            return ONE
        case _:
            return factor
