"""Logarithms as their authors write them: one of a quotient, upright, without exponentials in both
of its halves.

Each step holds wherever the tree before it is defined; the tree after it may be defined on more.
"""

from fractions import Fraction

from inverse_service.expressions import collecting, tree as ex


def in_one_logarithm(tree: ex.Expression) -> ex.Expression:
    """c log(a^2/b)/2 for c log a - c log b/2: logarithms in a sum with opposite coefficients.

    Coefficients are products of one factor and numbers; the smaller number stays outside.
    """
    tree = ex.rebuild(tree, in_one_logarithm)
    if not isinstance(tree, ex.Sum):
        return tree
    groups: dict[object, tuple[ex.Expression, list[tuple[Fraction, ex.Expression]]]] = {}
    others = list[ex.Expression]()
    for term in map(collecting.merge_powers, tree.terms):
        factors = ex.factors_of(term)
        logs = [f for f in factors if isinstance(f, ex.Apply) and f.function == "log"]
        if len(logs) == 1:
            rest = [f for f in factors if f is not logs[0] and not isinstance(f, ex.Number)]
            _, alike = groups.setdefault(frozenset(rest), (ex.multiply(*rest), []))
            alike.append((ex.coefficient(term), logs[0].argument))
        else:
            others.append(term)
    found = list[ex.Expression]()
    for outside, parts in groups.values():
        signs = {number > 0 for number, _ in parts}
        share = min(abs(number) for number, _ in parts)
        powers = [(argument, number / share) for number, argument in parts]
        if len(signs) == 2 and all(power.denominator == 1 for _, power in powers):
            whole = ex.multiply(*(argument**power for argument, power in powers))
            found.append(ex.number(share) * outside * ex.Apply("log", whole))
        else:
            found += [number * outside * ex.Apply("log", argument) for number, argument in parts]
    return ex.add(*found, *others) if len(found) + len(others) < len(tree.terms) else tree


def with_inverse_sines(tree: ex.Expression) -> ex.Expression:
    """asinh(u) for log(u + sqrt(u^2 + 1)), which is equal for every real u."""
    tree = ex.rebuild(tree, with_inverse_sines)
    match tree:
        case ex.Apply("log", ex.Sum((_, _) as both)):
            for u, root in (both, both[::-1]):
                match root:
                    case ex.Power(square, ex.Number(half)) if half == Fraction(1, 2) and (
                        collecting.collect(square - u**2 - ex.ONE) == ex.ZERO
                    ):
                        return ex.Apply("asinh", u)
    return tree


def upright(tree: ex.Expression) -> ex.Expression:
    """log(b/a) for -log(a/b), and c for exp(-u) c/(p - exp(-u) q) times exp(u) above and below."""
    tree = ex.rebuild(tree, upright)
    match tree:
        case ex.Apply("log", argument):
            return ex.Apply("log", _without_exponentials(argument))
        case ex.Product() if ex.coefficient(tree) < 0:
            for factor in ex.factors_of(tree):
                match factor:
                    case ex.Apply("log", ex.Product() | ex.Power() as quotient) if _is_divided(
                        quotient
                    ):
                        rest = ex.multiply(*(f for f in ex.factors_of(tree) if f is not factor))
                        return ex.negated(rest) * ex.Apply("log", _inverted(quotient))
    return tree


def _is_divided(quotient: ex.Expression) -> bool:
    return any(exponent < 0 for _, exponent in ex.powers_of(quotient))


def _inverted(quotient: ex.Expression) -> ex.Expression:
    return ex.multiply(*(_power(base, -e) for base, e in ex.powers_of(quotient)))


def _power(base: ex.Expression, exponent: Fraction) -> ex.Expression:
    match base:
        case ex.Apply("exp", argument):
            return ex.Apply("exp", exponent * argument)
        case _:
            return base**exponent


def _without_exponentials(quotient: ex.Expression) -> ex.Expression:
    """a/(exp(u) p - b) for exp(-u) a/(p - exp(-u) b)."""
    factors = ex.factors_of(quotient)
    for factor in factors:
        match factor:
            case ex.Apply("exp", argument):
                rest = [f for f in factors if f is not factor]
                for place, other in enumerate(rest):
                    match other:
                        case ex.Power(ex.Sum(terms), ex.Number(value)) if value == -1 and any(
                            factor in ex.factors_of(term) for term in terms
                        ):
                            grown = ex.add(
                                *(
                                    ex.multiply(*(f for f in ex.factors_of(term) if f != factor))
                                    if factor in ex.factors_of(term)
                                    else ex.Apply("exp", -argument) * term
                                    for term in terms
                                )
                            )
                            rest[place] = grown**-1
                            return ex.multiply(*rest)
    return quotient
