"""The table of elementary functions: what any part of the program knows of a function by its name.

Two parts keep a table of their own on purpose: the checker (`certificate.formulas`), which trusts
nothing of this program, and the browser (`web/static/system.js`). A test compares both with this
table, and each column with mpmath.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from inverse_service.expressions import tree as ex

# Of the argument u or, for a function with an order, of u and the order.
Rule = Callable[..., ex.Expression]
Trees = Callable[..., tuple[ex.Expression, ...]]
Family = Literal["", "circular", "hyperbolic", "inverse"]
# The function that is 1 where its argument is positive and 0 where it is negative.
STEP = "Heaviside"


def _none(*_: ex.Expression) -> tuple[ex.Expression, ...]:
    return ()


@dataclass(frozen=True, slots=True)
class Function:
    """One function f of one real argument u.

    | column | meaning | | --- | --- | | `derivative` | u to the tree f'(u) | | `parity` | 1 if
    f(-u) = f(u), -1 if f(-u) = -f(u), else 0 | | `family` | that of sin, that of sinh, or the
    inverse functions | | `command`, `shown` | the LaTeX command and the printed name, if f has
    others than its own | | `kernel` | f(u) by exp, log, sin, cos, atan, and roots; None for these |
    | `powers` | exponents of (sin, cos) or (sinh, cosh) whose product is f | | `square` | g, a, b
    with f^2 = a + b g^2 | | `slope` | s, c, k, e with f' = s/(c + k u^2)^e | | `solved` | g with v
    = g(u) where f(v) = u, on the branch next to 0 | | `undoes` | g with f(g(u)) = u where g is real
    | | `root` | g, a, b with f(g(u)) = sqrt(a + b u^2) where g is real | | `needs` | f is real
    where these trees are positive | | `poles` | f has a pole where one of these trees is 0 | |
    `holds`, `wanted` | whether f has a real value at a number, and a description of such numbers |
    | `library` | whether the mathematical library of C has f and no intrinsic of LLVM does |
    | `special` | f is no formula of the kernels, its kernel is a function of its own | | `ordered` | f
    has an order: `derivative`, `kernel`, and `needs` take u and the order | |
    `jets`, `law` | of a special function, whose kernel is a function y of u and of its order: how
    many of y, y', … are independent, and the tree of the next one from u, (order), and these |
    | `primitive` | to a tree with the derivative f | | `partners` | functions of u whose derivatives
    hold f | | `mpmath`, `sympy` | the names there |
    """

    name: str
    derivative: Rule
    parity: int = 0
    family: Family = ""
    command: str = ""
    shown: str = ""
    kernel: Rule | None = None
    powers: tuple[int, int] | None = None
    square: tuple[str, int, int] | None = None
    slope: tuple[int, int, int, Fraction] | None = None
    solved: str = ""
    undoes: str = ""
    root: tuple[str, int, int] | None = None
    needs: Trees = _none
    poles: Trees = _none
    holds: Callable[[Fraction], bool] | None = None
    wanted: str = ""
    library: bool = False
    special: bool = False
    ordered: bool = False
    jets: int = 0
    law: Rule | None = None
    primitive: Rule | None = None
    partners: Trees = _none
    mpmath: str = ""
    sympy: str = ""

    @property
    def reciprocal(self) -> str:
        """g with f = 1/g, where g is one of sin, cos, tan, sinh, cosh, tanh."""
        return _RECIPROCAL.get((self.family, self.powers or (0, 0)), "")


def _applied(name: str) -> Rule:
    return lambda u: ex.Apply(name, u)


def _inverse(
    name: str, parity: int, slope: tuple[int, int, int, int], kernel: Rule | None, **columns: object
) -> Function:
    """The row of an inverse function, by its slope with the exponent in halves."""
    sign, constant, quadratic, halves = slope
    exponent = Fraction(halves, 2)
    rows: dict[str, object] = {
        "derivative": lambda u: ex.number(sign) * (constant + quadratic * u**2) ** -exponent,
        "slope": (sign, constant, quadratic, exponent),
        "kernel": kernel,
        "library": True,
    }
    return Function(name=name, parity=parity, family="inverse", **(rows | columns))  # type: ignore[arg-type]


def _quotient(name: str, powers: tuple[int, int], derivative: Rule, **columns: object) -> Function:
    """The row of a quotient of the two functions of its family."""
    family: Family = "hyperbolic" if name.endswith("h") else "circular"
    pair = _PAIRS[family]
    below = pair[0] if powers[0] < 0 else pair[1]

    def poles(u: ex.Expression) -> tuple[ex.Expression, ...]:
        if family == "circular":
            return (ex.Apply(below, u),)
        return (u,) if below == "sinh" else ()

    def kernel(u: ex.Expression) -> ex.Expression:
        factors = sorted(zip(powers, pair, strict=True), reverse=True)  # the numerator first
        return ex.multiply(
            *((FUNCTION[one].kernel or _applied(one))(u) ** e for e, one in factors if e)
        )

    rows: dict[str, object] = {"kernel": kernel, "powers": powers, "poles": poles}
    if below == pair[0]:
        rows |= {"holds": bool, "wanted": "a number other than 0"}
    parity = -1 if powers[0] % 2 else 1
    return Function(name, derivative, parity, family, **(rows | columns))  # type: ignore[arg-type]


def _one_plus_square(name: str, sign: int, factor: int = 1) -> Rule:
    return lambda u: factor * (1 + sign * ex.Apply(name, u) ** 2)


def _negative_product(first: str, second: str) -> Rule:
    return lambda u: -1 * ex.Apply(first, u) * ex.Apply(second, u)


def _atan_of_root(u: ex.Expression) -> ex.Expression:
    return ex.Apply("atan", u / ex.square_root(1 - u**2))


def _log_with_root(sign: int) -> Rule:
    return lambda u: ex.Apply("log", u + ex.square_root(u**2 + sign))


def _exponentials(sign: int) -> Rule:
    return lambda u: ex.HALF * (ex.Apply("exp", u) + sign * ex.Apply("exp", -u))


def _distances_from_one(u: ex.Expression) -> tuple[ex.Expression, ...]:
    return 1 - u, 1 + u


def special_kernel(name: str, *arguments: ex.Expression, derivative: int = 0) -> ex.Arbitrary:
    """The function that stands for a special function among the kernels, or a derivative of it."""
    return ex.Arbitrary(name, arguments, (*[0] * (len(arguments) - 1), derivative))


def _kernel_of(name: str) -> Rule:
    return lambda u: special_kernel(name, u)


def split_order(order: ex.Expression) -> tuple[ex.Expression, int]:
    """(n, k) with order = n + k, where n has no integer part: 5/2 is 1/2 + 2."""
    if isinstance(order, ex.Number):
        whole = math.floor(order.value)
        return order - whole, whole
    return ex.split_exponent(order)


def _bessel_slope(name: str) -> Rule:
    """J_n' = (n/u) J_n - J_(n+1), or J_(n-1) - (n/u) J_n where an integer in n is positive.

    So all derivatives hold two functions (DLMF 10.6.2).
    """

    def slope(u: ex.Expression, order: ex.Expression) -> ex.Expression:
        step = 1 if split_order(order)[1] > 0 else -1
        return step * (ex.Ordered(name, u, order - step) - order / u * ex.Ordered(name, u, order))

    return slope


def _bessel_kernel(name: str) -> Rule:
    """J_(n+k) from y = J_n and y' by J_(n+1) = (n/u) y - y' and the recurrence (DLMF 10.6.1)."""

    def kernel(u: ex.Expression, order: ex.Expression) -> ex.Expression:
        n, k = split_order(order)
        lower: ex.Expression = special_kernel(name, n, u)
        upper = n / u * lower - special_kernel(name, n, u, derivative=1)
        for j in range(min(abs(k), _LARGEST_SHIFT)):
            if k > 0:
                lower, upper = upper, 2 * (n + j + 1) / u * upper - lower
            else:
                lower, upper = 2 * (n - j) / u * lower - upper, lower
        return lower if abs(k) <= _LARGEST_SHIFT else special_kernel(name, order, u)

    return kernel


def _bessel_law(
    u: ex.Expression, n: ex.Expression, y: ex.Expression, slope: ex.Expression
) -> ex.Expression:
    """y'' = -y'/u - (1 - n^2/u^2) y (DLMF 10.2.1)."""
    return -slope / u - y + n**2 * u**-2 * y


def _neighbors(name: str) -> Trees:
    """The Bessel functions of the orders n - 1 and n + 1; the first contains u^-n J_n."""
    return lambda u, order: (ex.Ordered(name, u, order - 1), ex.Ordered(name, u, order + 1))


def _polygamma_before(u: ex.Expression, order: ex.Expression) -> tuple[ex.Expression, ...]:
    return () if order == ex.ZERO else (ex.Ordered("polygamma", u, order - 1),)


def _bessel_needs(u: ex.Expression, order: ex.Expression) -> tuple[ex.Expression, ...]:
    """J_n of an integer order is real everywhere."""
    whole = isinstance(order, ex.Number) and order.value.denominator == 1
    return () if whole else (u,)


def _polygamma_kernel(u: ex.Expression, order: ex.Expression) -> ex.Expression:
    """The derivative of digamma."""
    assert isinstance(order, ex.Number)
    return special_kernel("polygamma", u, derivative=int(order.value))


def _gamma_law(u: ex.Expression, y: ex.Expression) -> ex.Expression:
    return y * special_kernel("polygamma", u)


def _gaussian(u: ex.Expression) -> ex.Expression:
    return 2 * ex.PI ** Fraction(-1, 2) * ex.Apply("exp", -(u**2))


def _growing_gaussian(u: ex.Expression) -> ex.Expression:
    return 2 * ex.PI ** Fraction(-1, 2) * ex.Apply("exp", u**2)


def _exponential_over(u: ex.Expression) -> ex.Expression:
    """Ei'(u) (DLMF 6.2.5)."""
    return ex.Apply("exp", u) / u


def _lambert_slope(u: ex.Expression, w: ex.Expression) -> ex.Expression:
    """W' = W/(u (1 + W)) (DLMF 4.13.4)."""
    return w / (u * (1 + w))


def _special(
    name: str, derivative: Rule, kernel: Rule, jets: int, law: Rule | None,
    shown: str = "", letter: str = "", **columns: object,
) -> Function:  # fmt: skip
    """The row of a special function, which is printed as an upright letter if it has one."""
    rows: dict[str, object] = {"special": True, "shown": shown, "kernel": kernel}
    rows |= {"jets": jets, "law": law}
    if shown:
        rows["command"] = f"\\operatorname{{{letter or shown}}}"
    return Function(name=name, derivative=derivative, **(rows | columns))  # type: ignore[arg-type]


_LARGEST_SHIFT = 24
_ABOVE_ZERO: dict[str, Any] = {
    "needs": lambda u, *order: (u,), "holds": lambda u: u > 0, "wanted": "a positive number",
}  # fmt: skip
_PAIRS = {"circular": ("sin", "cos"), "hyperbolic": ("sinh", "cosh")}
_WITHIN_ONE = {"needs": _distances_from_one, "wanted": "a number between -1 and 1"}
_ROWS = (
    Function("exp", _applied("exp"), command="\\exp", solved="log"),
    Function("log", lambda u: u**-1, mpmath="ln", command="\\ln", shown="ln", solved="exp", needs=lambda u: (u,),
             holds=lambda u: u > 0, wanted="a positive number"),
    Function("sin", _applied("cos"), -1, "circular", "\\sin", powers=(1, 0), square=("cos", 1, -1),
             solved="asin", undoes="asin", root=("acos", 1, -1)),
    Function("cos", lambda u: -ex.Apply("sin", u), 1, "circular", "\\cos", powers=(0, 1), square=("sin", 1, -1),
             solved="acos", undoes="acos", root=("asin", 1, -1)),
    _quotient("tan", (1, -1), _one_plus_square("tan", 1), command="\\tan", solved="atan", undoes="atan"),
    _quotient("sec", (0, -1), lambda u: ex.Apply("sec", u) * ex.Apply("tan", u), command="\\sec"),
    _quotient("csc", (-1, 0), _negative_product("csc", "cot"), command="\\csc"),
    _quotient("cot", (-1, 1), _one_plus_square("cot", 1, -1), command="\\cot"),
    Function("sinh", _applied("cosh"), -1, "hyperbolic", "\\sinh", kernel=_exponentials(-1), powers=(1, 0),
             square=("cosh", -1, 1), solved="asinh", undoes="asinh", root=("acosh", -1, 1), library=True),
    Function("cosh", _applied("sinh"), 1, "hyperbolic", "\\cosh", kernel=_exponentials(1), powers=(0, 1),
             square=("sinh", 1, 1), solved="acosh", undoes="acosh", root=("asinh", 1, 1), library=True),
    _quotient("tanh", (1, -1), _one_plus_square("tanh", -1), command="\\tanh", solved="atanh", undoes="atanh",
              library=True),
    _quotient("sech", (0, -1), _negative_product("sech", "tanh")),
    _quotient("csch", (-1, 0), _negative_product("csch", "coth")),
    _quotient("coth", (-1, 1), _one_plus_square("coth", -1), command="\\coth"),
    _inverse("asin", -1, (1, 1, -1, 1), _atan_of_root, command="\\arcsin", shown="arcsin", solved="sin",
             holds=lambda u: abs(u) <= 1, **_WITHIN_ONE),
    _inverse("acos", 0, (-1, 1, -1, 1), lambda u: ex.HALF * ex.PI - _atan_of_root(u), command="\\arccos",
             shown="arccos", solved="cos", holds=lambda u: abs(u) <= 1, **_WITHIN_ONE),
    _inverse("atan", -1, (1, 1, 1, 2), None, command="\\arctan", shown="arctan", solved="tan"),
    _inverse("asinh", -1, (1, 1, 1, 1), _log_with_root(1), solved="sinh", undoes="sinh"),
    # Two roots, because sqrt(u^2 - 1) would also be real for u < -1, where acosh is not.
    _inverse("acosh", 0, (1, -1, 1, 1), _log_with_root(-1), solved="cosh", needs=lambda u: (u - 1,),
             derivative=lambda u: (u - 1) ** Fraction(-1, 2) * (u + 1) ** Fraction(-1, 2),
             holds=lambda u: u >= 1, wanted="a number not less than 1"),
    _inverse("atanh", -1, (1, 1, -1, 2), lambda u: ex.HALF * ex.Apply("log", (1 + u) / (1 - u)), solved="tanh",
             undoes="tanh", holds=lambda u: abs(u) < 1, **_WITHIN_ONE),
    _special("erf", _gaussian, _kernel_of("erf"), 1, lambda u, y: _gaussian(u), parity=-1, library=True,
             primitive=lambda u: u * ex.Apply("erf", u) + ex.PI ** Fraction(-1, 2) * ex.Apply("exp", -(u**2))),
    _special("erfi", _growing_gaussian, _kernel_of("erfi"), 1, lambda u, y: _growing_gaussian(u), parity=-1,
             primitive=lambda u: u * ex.Apply("erfi", u) - ex.PI ** Fraction(-1, 2) * ex.Apply("exp", u**2)),
    # The branch W >= -1, not at its end -1/e.
    _special("lambertw", lambda u: _lambert_slope(u, ex.Apply("lambertw", u)), _kernel_of("lambertw"), 1,
             _lambert_slope, "W", needs=lambda u: (u + ex.Apply("exp", ex.MINUS_ONE),), sympy="LambertW",
             holds=lambda u: u > Fraction(-36787944117144232, 10**17), wanted="a number above -1/e",
             primitive=lambda u: u * (ex.Apply("lambertw", u) - 1 + ex.Apply("lambertw", u) ** -1)),
    # For u > 0; it is real for u < 0 as well, and has a logarithmic pole at 0.
    _special("expintegral", _exponential_over, _kernel_of("expintegral"), 1, lambda u, y: _exponential_over(u), "Ei",
             mpmath="ei", sympy="Ei", primitive=lambda u: u * ex.Apply("expintegral", u) - ex.Apply("exp", u),
             **_ABOVE_ZERO),
    # For u > 0, where it has no poles; its derivatives satisfy no algebraic equation (Hölder 1887).
    _special("gammafunction", lambda u: ex.Apply("gammafunction", u) * ex.Ordered("polygamma", u, ex.ZERO),
             _kernel_of("gammafunction"), 1, _gamma_law, "Γ", "\\Gamma", mpmath="gamma", sympy="gamma", **_ABOVE_ZERO),
    _special("polygamma", lambda u, order: ex.Ordered("polygamma", u, order + 1), _polygamma_kernel, 0, None, "ψ",
             "\\psi", ordered=True, partners=_polygamma_before, mpmath="psi", **_ABOVE_ZERO),
    _special("besselj", _bessel_slope("besselj"), _bessel_kernel("besselj"), 2, _bessel_law, "J", ordered=True,
             partners=_neighbors("besselj"), needs=_bessel_needs),
    _special("bessely", _bessel_slope("bessely"), _bessel_kernel("bessely"), 2, _bessel_law, "Y", ordered=True,
             partners=_neighbors("bessely"), **_ABOVE_ZERO),
)  # fmt: skip
FUNCTION: dict[str, Function] = {row.name: row for row in _ROWS}
CIRCULAR, HYPERBOLIC, INVERSE = (
    tuple(row.name for row in _ROWS if row.family == family)
    for family in ("circular", "hyperbolic", "inverse")
)
_RECIPROCAL = {
    (row.family, (-row.powers[0], -row.powers[1])): row.name
    for row in _ROWS
    if row.powers and sum(row.powers) >= 0 and row.powers[0] >= 0
}
# Functions that are no formulas of exp, log, sin, cos, atan, and roots.
SPECIAL = frozenset(row.name for row in _ROWS if row.special)
RECIPROCALS: dict[str, str] = {row.name: row.reciprocal for row in _ROWS if row.reciprocal}
SQUARES = {row.name: row.square for row in _ROWS if row.square}
# f to (g, h) and the exponents of g and h, for the quotients: tan to ("sin", "cos") and (1, -1).
FRACTIONS = {
    row.name: (_PAIRS[row.family], row.powers)
    for row in _ROWS
    if row.powers and min(row.powers) < 0
}
# (g, h) to the name of g/h: ("sin", "cos") to "tan".
QUOTIENTS = {
    pair[:: powers[0]]: name for name, (pair, powers) in FRACTIONS.items() if sum(map(abs, powers)) == 2
}  # fmt: skip


def has_no_machine_code(name: str) -> bool:
    """Whether the function is special, and not one that the library of C has."""
    return name in SPECIAL and not FUNCTION[name].library


def parity(name: str) -> int:
    """1 for an even, -1 for an odd function, 0 for others."""
    return FUNCTION[name].parity if name in FUNCTION else 0


def slope(name: str) -> tuple[int, int, int, Fraction] | None:
    """The slope of an inverse function; None for others."""
    return FUNCTION[name].slope if name in FUNCTION else None


def solves(outer: str, inner: str) -> bool:
    """Whether outer(inner(u)) = u on the branch next to 0."""
    return inner in FUNCTION and FUNCTION[inner].solved == outer


def arguments_of(node: ex.Apply) -> tuple[ex.Expression, ...]:
    """What the rules of the function take: u, and the order if it has one."""
    return (node.argument, node.order) if isinstance(node, ex.Ordered) else (node.argument,)


def slope_of(node: ex.Apply) -> ex.Expression:
    """f'(u)."""
    return FUNCTION[node.function].derivative(*arguments_of(node))


def in_kernels(node: ex.Apply) -> ex.Expression:
    """The function by the kernels; the node itself if it is one of them."""
    row = FUNCTION.get(node.function)
    return row.kernel(*arguments_of(node)) if row and row.kernel else node


def with_argument(node: ex.Apply, argument: ex.Expression) -> ex.Apply:
    """The function, of the same order, of another argument."""
    if isinstance(node, ex.Ordered):
        return ex.Ordered(node.function, argument, node.order)
    return ex.Apply(node.function, argument)


def of_inverse(tree: ex.Apply) -> ex.Expression | None:
    """sin(asin(u)) = u, cos(asin(u)) = sqrt(1 - u^2), and similar rules if asin(u) is real; None
    for any other tree.
    """
    inner, row = tree.argument, FUNCTION.get(tree.function)
    if isinstance(inner, ex.Apply) and row is not None:
        if row.undoes == inner.function:
            return inner.argument
        if row.root is not None and row.root[0] == inner.function:
            return ex.square_root(row.root[1] + row.root[2] * inner.argument**2)
    return None
