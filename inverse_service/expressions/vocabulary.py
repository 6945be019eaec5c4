"""The functions that formulas may use, and the reason for each one that they may not."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.pieces import STEP, step
from inverse_service.expressions.tokens import refusal
from inverse_service.expressions.tree import ELEMENTARY, Expression, Number, apply, number, square_root

ALIASES = {
    "ln": "log", "arcsin": "asin", "arccos": "acos", "arctan": "atan", "tg": "tan", "ctg": "cot", "sh": "sinh",
    "ch": "cosh", "th": "tanh", "arsinh": "asinh", "arcosh": "acosh", "artanh": "atanh", "arcsinh": "asinh",
    "arccosh": "acosh", "arctanh": "atanh", "cosec": "csc", "Abs": "abs", "sgn": "sign", "signum": "sign",
    "heaviside": STEP, "arctg": "atan", "tgh": "tanh", "cotg": "cot", "cotan": "cot", "arsh": "asinh", "arch": "acosh",
    "arth": "atanh",
}  # fmt: skip


def _magnitude(u: Expression) -> Expression:
    """|u|: sqrt(u^2), whose two sides are told apart where the equations are solved."""
    return number(abs(u.value)) if isinstance(u, Number) else square_root(u**2)


_COMPOSED: dict[str, Callable[[Expression], Expression]] = {
    "sqrt": square_root,
    "cbrt": lambda u: u ** Fraction(1, 3),
    "abs": _magnitude,
    "sign": lambda u: u / _magnitude(u),
    "log10": lambda u: apply("log", u) / apply("log", number(10)),
    "log2": lambda u: apply("log", u) / apply("log", number(2)),
}
DERIVATIVE_NAMES = frozenset(("diff", "Derivative"))
PIECEWISE = frozenset(("piecewise", "Piecewise"))
FUNCTIONS = ELEMENTARY | ALIASES.keys() | _COMPOSED.keys() | PIECEWISE | {STEP}

_KINK = "is not differentiable everywhere"
_SPECIAL = "is not an elementary function"
_COMMAND = ("is a command of another program", "write the equations alone")
_VECTORS = ("belongs to vectors", "write an equation for each component")
_WORDS = ("where", "if", "then", "else", "for", "all", "forall", "with", "let", "given", "equation", "equations",
          "model", "system", "when", "const", "constant", "begin", "end", "is", "the", "and", "or", "not", "xor",
          "double", "float", "Real", "None", "True", "False", "true", "false", "null", "Null", "nil")  # fmt: skip
_OTHER_TONGUES = (("sen", "sin"), ("seno", "sin"), ("sinus", "sin"), ("sine", "sin"), ("cosinus", "cos"),
                  ("cosine", "cos"), ("tangent", "tan"), ("senh", "sinh"))  # fmt: skip
_DEGREES, _RADIANS = ("deg", "degs", "degree", "degrees"), ("rad", "rads", "radian", "radians")
# What is wrong with a name, what to write, and where in a document it or another name could be declared.
Reason = tuple[str, str] | tuple[str, str, str]
REFUSED: dict[str, Reason] = {
    "floor": (_KINK, "write the integer for the interval that you study"),
    "ceil": (_KINK, "write the integer for the interval that you study"),
    "round": (_KINK, "write the integer for the interval that you study"),
    "mod": (_KINK, "write the formula of one interval"),
    "max": (_KINK, "write the larger one for the region that you study"),
    "min": (_KINK, "write the smaller one for the region that you study"),
    "Max": (_KINK, "write the larger one for the region that you study"),
    "Min": (_KINK, "write the smaller one for the region that you study"),
    "DiracDelta": ("is not a function", "leave it out and study the motion between the impulses"),
    "atan2": ("has a jump", "write atan(y/x) on the branch that you study"),
    "erf": (_SPECIAL, "", "functions"),
    "besselj": (_SPECIAL, "", "functions"),
    "factorial": (_SPECIAL, "write the number", "functions"),
    "integrate": ("is not carried out here", "write the integral itself", "functions"),
    "Integral": ("is not carried out here", "write the integral itself", "functions"),
    "sum": ("is not carried out here", "write the terms"),
    "limit": ("is not carried out here", "write its value"),
    "re": ("belongs to complex numbers", "write the equations of real and imaginary part"),
    "im": ("belongs to complex numbers", "write the equations of real and imaginary part"),
    "conjugate": ("belongs to complex numbers", "write the equations of real and imaginary part"),
}  # fmt: skip
# These may be declared as names of one's own; undeclared they are refused with a better reason than "unknown".
REFUSED_UNLESS_DECLARED: dict[str, Reason] = {
    "i": ("is not declared and complex numbers are not accepted", "write real equations", "parameters"),
    "I": ("is not declared and complex numbers are not accepted", "write real equations", "parameters"),
    "gamma": (_SPECIAL + " and not a declared name", "give a function of your own another name", "parameters"),
    "Gamma": (_SPECIAL + " and not a declared name", "give a function of your own another name", "parameters"),
    "zeta": (_SPECIAL + " and not a declared name", "give a function of your own another name", "parameters"),
    "j": ("is not declared and complex numbers are not accepted", "write real equations", "parameters"),
    "lg": ("is log10 to some and log2 to others", "write log10(x)", "parameters"),
    **dict.fromkeys(("lb", "ld"), ("is a logarithm to some", "write log2(x)", "parameters")),
    **dict.fromkeys(("PI", "M_PI"), ("is pi to many", "write pi", "parameters")),
    "sqr": ("is a square to some and a root to others", "write x^2 or sqrt(x)", "parameters"),
    **{word: (f"is {plain} to many", f"write {plain}(x)", "parameters") for word, plain in _OTHER_TONGUES},
    **dict.fromkeys(("acot", "arccot", "arcctg"), ("has two meanings", "write atan(1/x) or pi/2 - atan(x)")),
    **dict.fromkeys(("asec", "arcsec"), ("is not accepted", "write acos(1/x)")),
    **dict.fromkeys(("acsc", "arccsc"), ("is not accepted", "write asin(1/x)")),
    "inf": ("is not a number", "write a finite number"),
    "infinity": ("is not a number", "write a finite number"),
    "Infinity": ("is not a number", "write a finite number"),
    "oo": ("is not a number", "write a finite number"),
    "zoo": ("is not a number", "write a finite number"),
    **dict.fromkeys(("solve", "dsolve", "desolve", "ode2", "Solve", "DSolve", "NDSolve", "NDSolveValue"), _COMMAND),
    **dict.fromkeys(_WORDS, ("is a word", "write the equations alone, separated by ;")),
    **dict.fromkeys(("grad", "div", "curl", "rot", "nabla", "laplacian"), _VECTORS),
    **dict.fromkeys(_DEGREES, ("is a degree to most", "write 30*pi/180 for 30 degrees", "parameters")),
    **dict.fromkeys(_RADIANS, ("is the unit of angles to most", "leave it out", "parameters")),
    "nan": ("is not a number", "write a finite number"),
    "NaN": ("is not a number", "write a finite number"),
}
# Short names of functions that people also give to coordinates: th for theta.
MAY_BE_DECLARED = frozenset(("th", "ch", "sh", "tg", "tgh", "cotan", "cotg", "arch", "arsh", "arth", "arctg"))
RESERVED = (FUNCTIONS | DERIVATIVE_NAMES | REFUSED.keys() | {"t", "pi"}) - MAY_BE_DECLARED


def call(function: str, arguments: list[Expression], column: int) -> Expression:
    """The function of FUNCTIONS applied; InputError for a wrong number of arguments or outside its domain."""
    function = ALIASES.get(function, function)
    if function == "log" and len(arguments) == 2:
        return call("log", arguments[:1], column) / call("log", arguments[1:], column)
    if len(arguments) != 1:
        raise refusal(f"{function} has {len(arguments)} arguments", column, f"write one, as in {function}(u)")
    check_domain(function, arguments[0], column)
    if function == STEP:
        return step(arguments[0], column)
    composed = _COMPOSED.get(function)
    return composed(arguments[0]) if composed else apply(function, arguments[0])


_DOMAINS: dict[str, tuple[Callable[[Fraction], bool], str]] = {
    **{name: (row.holds, row.wanted) for name, row in FUNCTION.items() if row.holds is not None},
    "log10": (lambda u: u > 0, "a positive number"),
    "log2": (lambda u: u > 0, "a positive number"),
    "sqrt": (lambda u: u >= 0, "a number that is not negative"),
    "cbrt": (lambda u: u >= 0, "a number that is not negative, as in -cbrt(8)"),
    "sign": (bool, "a number other than 0"),
}


def check_domain(function: str, argument: Expression, column: int) -> None:
    """InputError where the argument is a number at which the function has no real value."""
    if function not in _DOMAINS or not isinstance(argument, Number):
        return
    holds, wanted = _DOMAINS[function]
    if not holds(argument.value):
        raise refusal(f"{function} of this number has no real value", column, f"give it {wanted}")


def reason_against(name: str, column: int) -> InputError | None:
    """The refusal of a well-known name that formulas cannot use, or None."""
    if name.startswith("log_"):
        return refusal("a base of a logarithm occurs", column, "write log(x)/log(2) or log(x, 2)")
    entry = REFUSED.get(name) or REFUSED_UNLESS_DECLARED.get(name)
    meant = ("(pi/180)",) if name in _DEGREES else ()
    return refused(f"{name} {entry[0]}", entry, column, meant) if entry else None


def refused(what: str, reason: Reason, column: int, meant: tuple[str, ...] = ()) -> InputError:
    """The refusal for this reason."""
    return refusal(f"{what}; it occurs", column, reason[1], meant, declare="".join(reason[2:]))
