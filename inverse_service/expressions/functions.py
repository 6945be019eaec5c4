"""The table of elementary functions: derivative, parity, relation to others, real arguments, notation."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions import tree as ex

Rule = Callable[[ex.Expression], ex.Expression]
_NOT_ZERO = (bool, "a number other than 0")


@dataclass(frozen=True, slots=True)
class Function:
    """One function f of one real argument u.

    `derivative` is f' as a tree of u. `parity` is 1 where f(-u) = f(u), -1 where f(-u) = -f(u), else 0. `reciprocal`
    names g with f = 1/g, `undoes` g with f(g(u)) = u wherever g is real, `root` g with f(g(u)) = sqrt(a + b u^2) there,
    and a, b. `holds` says whether f has a real value at a number, and `wanted` which numbers these are.
    `command` is its LaTeX, `shown` its name in print.
    """

    name: str
    derivative: Rule
    parity: int = 0
    reciprocal: str = ""
    holds: Callable[[Fraction], bool] | None = None
    wanted: str = ""
    command: str = ""
    shown: str = ""
    undoes: str = ""
    root: tuple[str, int, int] | None = None


def _square(u: ex.Expression) -> ex.Expression:
    return u**2


def _inverse_root(u: ex.Expression) -> ex.Expression:
    return u ** Fraction(-1, 2)


def _other(function: str) -> Rule:
    return lambda u: ex.apply(function, u)


def _negative_product(first: str, second: str) -> Rule:
    return lambda u: -1 * ex.apply(first, u) * ex.apply(second, u)


_ROWS = (
    Function("exp", _other("exp"), command="\\exp"),
    Function("log", lambda u: u**-1, 0, "", lambda u: u > 0, "a positive number", "\\ln", "ln"),
    Function("sin", _other("cos"), -1, command="\\sin", undoes="asin", root=("acos", 1, -1)),
    Function("cos", lambda u: -ex.apply("sin", u), 1, command="\\cos", undoes="acos", root=("asin", 1, -1)),
    Function("tan", lambda u: 1 + _square(ex.apply("tan", u)), -1, command="\\tan", undoes="atan"),
    Function("cot", lambda u: -(1 + _square(ex.apply("cot", u))), -1, "tan", *_NOT_ZERO, "\\cot"),
    Function("sec", lambda u: ex.apply("sec", u) * ex.apply("tan", u), 1, "cos", command="\\sec"),
    Function("csc", _negative_product("csc", "cot"), -1, "sin", *_NOT_ZERO, "\\csc"),
    Function("sinh", _other("cosh"), -1, command="\\sinh", undoes="asinh", root=("acosh", -1, 1)),
    Function("cosh", _other("sinh"), 1, command="\\cosh", undoes="acosh", root=("asinh", 1, 1)),
    Function("tanh", lambda u: 1 - _square(ex.apply("tanh", u)), -1, command="\\tanh", undoes="atanh"),
    Function("coth", lambda u: 1 - _square(ex.apply("coth", u)), -1, "tanh", *_NOT_ZERO, "\\coth"),
    Function("sech", _negative_product("sech", "tanh"), 1, "cosh"),
    Function("csch", _negative_product("csch", "coth"), -1, "sinh", *_NOT_ZERO),
    Function("asin", lambda u: _inverse_root(1 - _square(u)), -1, "", lambda u: abs(u) <= 1,
             "a number between -1 and 1", "\\arcsin", "arcsin"),
    Function("acos", lambda u: -_inverse_root(1 - _square(u)), 0, "", lambda u: abs(u) <= 1,
             "a number between -1 and 1", "\\arccos", "arccos"),
    Function("atan", lambda u: (1 + _square(u))**-1, -1, command="\\arctan", shown="arctan"),
    Function("asinh", lambda u: _inverse_root(1 + _square(u)), -1, undoes="sinh"),
    # Two roots, because sqrt(u^2 - 1) would also be real for u < -1, where acosh is not.
    Function("acosh", lambda u: _inverse_root(u - 1) * _inverse_root(u + 1), 0, "",
             lambda u: u >= 1, "a number not less than 1"),
    Function("atanh", lambda u: (1 - _square(u))**-1, -1, "", lambda u: abs(u) < 1,
             "a number between -1 and 1", undoes="tanh"),
)  # fmt: skip
FUNCTION: dict[str, Function] = {row.name: row for row in _ROWS}
RECIPROCALS: dict[str, str] = {row.name: row.reciprocal for row in _ROWS if row.reciprocal}
