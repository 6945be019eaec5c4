"""Trees to LaTeX; the reader of `latex.py` takes it back, partial derivatives excepted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.printing_layout import Ratio, has_plain_arguments, signed, variables
from inverse_service.expressions.tokens import greek_letter, written
from inverse_service.expressions.tree import (
    HALF,
    TIME,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Integral,
    Number,
    Power,
    Sum,
    Symbol,
    Velocity,
    walk,
)

_WITHOUT_COMMAND = ("omicron", "Alpha", "Beta", "Epsilon", "Zeta", "Eta", "Iota", "Kappa", "Mu", "Nu", "Omicron")
_NO_COMMAND = frozenset((*_WITHOUT_COMMAND, "Rho", "Tau", "Chi"))


def to_latex(expression: Expression) -> str:
    """The formula in LaTeX, without delimiters."""
    return signed(expression, _ratio)


def _ratio(term: Ratio) -> str:
    if term.under == 1 and not term.denominators:
        return _factors(term.over, term.numerators)
    over = _alone(term.over, term.numerators)
    return f"\\frac{{{over}}}{{{_alone(term.under, term.denominators)}}}"


def _alone(coefficient: int, factors: Sequence[Expression]) -> str:
    """Numerator or denominator: a single sum needs no brackets there."""
    if coefficient == 1 and len(factors) == 1:
        return to_latex(factors[0])
    return _factors(coefficient, factors)


def _factors(coefficient: int, factors: Sequence[Expression]) -> str:
    pieces = [str(coefficient)] if coefficient != 1 or not factors else []
    before: Expression | None = None
    for factor in factors:
        piece = _factor(factor)
        if pieces and (piece[0].isdigit() or _looks_like_a_call(before, piece, factor)):
            piece = "\\cdot " + piece
        pieces.append(piece)
        before = factor
    return " ".join(pieces)


def _looks_like_a_call(before: Expression | None, piece: str, factor: Expression) -> bool:
    """Whether x (t + 1) would stand there, which could be x at another time."""
    return piece.startswith("\\left(") and isinstance(before, Symbol | Velocity | Acceleration) and TIME in walk(factor)


def _factor(factor: Expression) -> str:
    match factor:
        case Power(Apply(function, argument), Number(value)) if function != "exp" and value > 0 and value != HALF.value:
            return f"{_command(function)}^{{{to_latex(Number(value))}}}{_brackets(argument)}"
        case Power(base, exponent) if exponent != HALF:
            return f"{_atom(base, raised=True)}^{{{to_latex(exponent)}}}"
        case _:
            return _atom(factor)


def _atom(expression: Expression, raised: bool = False) -> str:
    match expression:
        case Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case Symbol(name):
            return name_latex(name)
        case Velocity(name):
            return name_latex(name, "dot")
        case Acceleration(name):
            return name_latex(name, "ddot")
        case Apply("exp", argument) if not raised and not isinstance(argument, Number):
            return f"e^{{{to_latex(argument)}}}"
        case Apply(function, argument) if function != "exp" or isinstance(argument, Number):
            return f"{_command(function)}{_brackets(argument)}"
        case Power(base, exponent) if exponent == HALF:
            return f"\\sqrt{{{to_latex(base)}}}"
        case Integral() if (known := expression.integrand) is not None:
            slope, variable = known
            inside = to_latex(slope) if not isinstance(slope, Sum) else _brackets(slope)
            return f"\\left(\\int {inside} \\, d{to_latex(variable)}\\right)"
        case Arbitrary():
            return _arbitrary(expression)
        case _:
            return _brackets(expression)


def _brackets(expression: Expression) -> str:
    return f"\\left({to_latex(expression)}\\right)"


def _command(function: str) -> str:
    row = FUNCTION.get(function)
    return (row.command if row else "") or f"\\operatorname{{{function}}}"


def name_latex(name: str, accent: str = "") -> str:
    r"""r1 as r_{1}, phi as \phi, x_left as x_{\mathrm{left}}; `accent` goes over the body."""
    parts = written(name)
    body = _word(parts.body)
    if accent:
        body = f"\\{accent}{{{body}}}"
    subscript = ",".join(_word(word) for word in parts.subscript)
    return f"{body}_{{{subscript}}}" if subscript else body


def _word(word: str) -> str:
    if greek_letter(word) and word not in _NO_COMMAND:
        return f"\\{word}"
    return word if len(word) == 1 or word.isdigit() else f"\\mathrm{{{word}}}"


def _arbitrary(function: Arbitrary) -> str:
    arguments = ", ".join(to_latex(argument) for argument in function.arguments)
    name, orders = name_latex(function.name), function.orders
    if not any(orders):
        return f"{name}\\left({arguments}\\right)"
    if len(orders) == 1:
        mark = "'" * orders[0] if orders[0] <= 3 else f"^{{({orders[0]})}}"
    elif has_plain_arguments(function):
        return f"{_partial(name, function)}\\left({arguments}\\right)"
    else:
        mark = f"^{{({','.join(map(str, orders))})}}"
    return f"{name}{mark}\\left({arguments}\\right)"


def _partial(name: str, function: Arbitrary) -> str:
    counts = Counter(to_latex(variable) for variable in variables(function))
    total = sum(counts.values())
    order = f"^{{{total}}}" if total > 1 else ""
    below = " ".join(f"\\partial {u}" + (f"^{{{k}}}" if k > 1 else "") for u, k in counts.items())
    return f"\\frac{{\\partial{order} {name}}}{{{below}}}"
