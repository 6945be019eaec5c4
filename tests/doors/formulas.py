"""Parse and evaluate canonical formulas of results and of the corpus without the package.

The grammar is that of `system.equations` in a result: numbers, names, primes, + - * / ^, functions,
derivatives such as A'(x), diff(A(x, y), x, y) and A[1,0](x, y). A value is a `Jet`: a number to 30
digits with its first and second derivatives by the variables of a point, so Euler-Lagrange
expressions are exact up to rounding. Arbitrary functions are replaced by particular ones (what
fails for these fails in general). A formula that is not real raises `NotReal`.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mpmath

DIGITS = 30
Tree = tuple[Any, ...]
_EXTREMES: dict[str, Callable[..., Any]] = {"max": max, "min": min}
_TOKEN = re.compile(
    r"\s*(?:(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+)|([A-Za-z_]\w*'*)|(>=|<=|!=|==|\*\*|[-+*/^(),\[\]<>=&|~]))"
)


class NotReal(ValueError):
    """The formula has no real value at this point."""


@lru_cache(maxsize=20_000)
def read(text: str) -> Tree:
    """Parse a canonical formula to a tree. Raises ValueError if it is not canonical."""
    found = _Parser(text)
    tree = found.sum()
    if found.kind is not None:
        raise ValueError(f"{text!r} is not canonical")
    return tree


class _Parser:
    def __init__(self, text: str) -> None:
        self.text, self.place = text, 0
        self.kind: str | None = None
        self.value = ""
        self.advance()

    def advance(self) -> str:
        last = self.value
        if not self.text[self.place :].strip():
            self.kind, self.value = None, ""
            return last
        match = _TOKEN.match(self.text, self.place)
        if match is None:
            raise ValueError(f"{self.text!r} is not canonical")
        self.place = match.end()
        self.kind = ("number", "name", "sign")[match.lastindex - 1]  # type: ignore[operator]
        self.value = match[match.lastindex]  # type: ignore[index]
        return last

    def accept(self, sign: str) -> bool:
        if self.kind == "sign" and self.value == sign:
            self.advance()
            return True
        return False

    def expect(self, sign: str) -> None:
        if not self.accept(sign):
            raise ValueError(f"{self.text!r} is not canonical")

    def sum(self) -> Tree:
        tree = self.product()
        while self.kind == "sign" and self.value in "+-":
            sign = self.advance()
            tree = (sign, tree, self.product())
        return tree

    def product(self) -> Tree:
        tree = self.signed()
        while self.kind == "sign" and self.value in "*/":
            sign = self.advance()
            tree = (sign, tree, self.signed())
        return tree

    def signed(self) -> Tree:
        if self.accept("-"):
            return ("-", ("number", "0"), self.signed())
        if self.accept("+"):
            return self.signed()
        return self.power()

    def power(self) -> Tree:
        base = self.atom()
        return ("^", base, self.signed()) if self.accept("^") or self.accept("**") else base

    def pieces(self) -> Tree:
        """Parse piecewise((value, condition), ..., (value, true)) after its name and bracket."""
        found = []
        while not found or self.accept(","):
            self.expect("(")
            value = self.sum()
            self.expect(",")
            found.append((value, self.condition()))
            self.expect(")")
        self.expect(")")
        return ("pieces", tuple(found))

    def condition(self) -> Tree:
        """Parse comparisons joined by words or signs, from left to right."""
        tree = self.comparison()
        while self.value in ("and", "or", "&", "|"):
            word = self.advance()
            tree = ("and" if word in ("and", "&") else "or", tree, self.comparison())
        return tree

    def comparison(self) -> Tree:
        if self.value in ("not", "~"):
            self.advance()
            return ("not", self.comparison())
        if self.value in ("true", "True", "otherwise"):
            self.advance()
            return ("and",)
        start = self.place, self.kind, self.value
        if self.accept("("):
            inside = self.condition()
            if self.accept(")") and self.value not in (
                "+",
                "-",
                "*",
                "/",
                "^",
                "<",
                ">",
                "<=",
                ">=",
            ):
                return inside
            self.place, self.kind, self.value = start
        parts: list[Any] = [self.sum()]
        while self.value in ("<", ">", "<=", ">="):
            parts += [self.advance(), self.sum()]
        return ("compare", *parts)

    def atom(self) -> Tree:
        if self.accept("("):
            inside = self.sum()
            self.expect(")")
            return inside
        if self.kind == "number":
            return ("number", self.advance())
        if self.kind != "name":
            raise ValueError(f"{self.text!r} is not canonical")
        name = self.advance()
        orders: tuple[int, ...] | None = None
        if self.accept("["):
            found = [int(self.advance())]
            while self.accept(","):
                found.append(int(self.advance()))
            self.expect("]")
            orders = tuple(found)
        if not self.accept("("):
            return ("name", name)
        if name in ("piecewise", "Piecewise"):
            return self.pieces()
        arguments = [self.sum()]
        while self.accept(","):
            arguments.append(self.sum())
        self.expect(")")
        if name == "diff":
            return _derivative(arguments)
        bare = name.rstrip("'")
        return (
            "call",
            bare,
            tuple(arguments),
            orders or (len(name) - len(bare), *[0] * (len(arguments) - 1)),
        )


def _derivative(arguments: Sequence[Tree]) -> Tree:
    """diff(A(x, y), x, x) as A[2,0](x, y): the variables are arguments of A themselves."""
    _, name, inner, orders = arguments[0]
    counts = list(orders)
    last = None
    for variable in arguments[1:]:
        if variable[0] == "number":
            counts[last] += int(variable[1]) - 1
        else:
            last = inner.index(variable)
            counts[last] += 1
    return ("call", name, inner, tuple(counts))


@dataclass(slots=True)
class Jet:
    """value, slopes (n,), bends as {(i, j): number} for i <= j; dimensionless."""

    value: Any
    slopes: dict[int, Any]
    bends: dict[tuple[int, int], Any]


def _constant(value: Any) -> Jet:
    return Jet(value, {}, {})


def _added(left: Jet, right: Jet, sign: int) -> Jet:
    slopes, bends = dict(left.slopes), dict(left.bends)
    for i, x in right.slopes.items():
        slopes[i] = slopes.get(i, 0) + sign * x
    for k, x in right.bends.items():
        bends[k] = bends.get(k, 0) + sign * x
    return Jet(left.value + sign * right.value, slopes, bends)


def _times(left: Jet, right: Jet) -> Jet:
    if not left.slopes:
        left, right = right, left
    if not right.slopes:
        c = right.value
        return Jet(
            left.value * c,
            {i: x * c for i, x in left.slopes.items()},
            {k: x * c for k, x in left.bends.items()},
        )
    a, b = left.value, right.value
    slopes = {i: x * b for i, x in left.slopes.items()}
    for i, x in right.slopes.items():
        slopes[i] = slopes.get(i, 0) + x * a
    bends = {k: x * b for k, x in left.bends.items()}
    for k, x in right.bends.items():
        bends[k] = bends.get(k, 0) + x * a
    for i, x in left.slopes.items():
        for j, y in right.slopes.items():
            k = (i, j) if i <= j else (j, i)
            bends[k] = bends.get(k, 0) + (x * y if i != j else 2 * x * y)
    return Jet(a * b, slopes, bends)


def composed(inner: Jet, value: Any, first: Any, second: Any) -> Jet:
    """The jet of u(inner), where u, u', u'' have these values."""
    if not inner.slopes:
        return _constant(value)
    slopes = {i: x * first for i, x in inner.slopes.items()}
    bends = {k: x * first for k, x in inner.bends.items()}
    items = sorted(inner.slopes.items())
    for place, (i, x) in enumerate(items):
        for j, y in items[place:]:
            bends[i, j] = bends.get((i, j), 0) + second * x * y
    return Jet(value, slopes, bends)


def _logarithm(u: Any) -> tuple[Any, Any, Any]:
    return mpmath.log(u), 1 / u, -1 / u**2


def _circle(u: Any, root: Any, value: Any, sign: int, power: int) -> tuple[Any, Any, Any]:
    return value, sign / root, sign * power * u / root**3


_ROOTS: dict[str, Callable[[Any], tuple[Any, Any, Any]]] = {
    "exp": lambda u: (mpmath.exp(u),) * 3,
    "log": _logarithm,
    "sqrt": lambda u: (mpmath.sqrt(u), 1 / (2 * mpmath.sqrt(u)), -1 / (4 * mpmath.sqrt(u) ** 3)),
    "sin": lambda u: (mpmath.sin(u), mpmath.cos(u), -mpmath.sin(u)),
    "cos": lambda u: (mpmath.cos(u), -mpmath.sin(u), -mpmath.cos(u)),
    "tan": lambda u: (mpmath.tan(u), mpmath.sec(u) ** 2, 2 * mpmath.tan(u) * mpmath.sec(u) ** 2),
    "cot": lambda u: (mpmath.cot(u), -(mpmath.csc(u) ** 2), 2 * mpmath.cot(u) * mpmath.csc(u) ** 2),
    "sec": lambda u: (
        mpmath.sec(u),
        mpmath.sec(u) * mpmath.tan(u),
        mpmath.sec(u) * (mpmath.tan(u) ** 2 + mpmath.sec(u) ** 2),
    ),
    "csc": lambda u: (
        mpmath.csc(u),
        -mpmath.csc(u) * mpmath.cot(u),
        mpmath.csc(u) * (mpmath.cot(u) ** 2 + mpmath.csc(u) ** 2),
    ),
    "sinh": lambda u: (mpmath.sinh(u), mpmath.cosh(u), mpmath.sinh(u)),
    "cosh": lambda u: (mpmath.cosh(u), mpmath.sinh(u), mpmath.cosh(u)),
    "sech": lambda u: (
        mpmath.sech(u),
        -mpmath.sech(u) * mpmath.tanh(u),
        mpmath.sech(u) * (1 - 2 * mpmath.sech(u) ** 2),
    ),
    "csch": lambda u: (
        mpmath.csch(u),
        -mpmath.csch(u) * mpmath.coth(u),
        mpmath.csch(u) * (1 + 2 * mpmath.csch(u) ** 2),
    ),
    "tanh": lambda u: (
        mpmath.tanh(u),
        mpmath.sech(u) ** 2,
        -2 * mpmath.tanh(u) * mpmath.sech(u) ** 2,
    ),
    "coth": lambda u: (
        mpmath.coth(u),
        -(mpmath.csch(u) ** 2),
        2 * mpmath.coth(u) * mpmath.csch(u) ** 2,
    ),
    "atan": lambda u: (mpmath.atan(u), 1 / (1 + u**2), -2 * u / (1 + u**2) ** 2),
    "acot": lambda u: (mpmath.acot(u), -1 / (1 + u**2), 2 * u / (1 + u**2) ** 2),
    "asin": lambda u: _circle(u, mpmath.sqrt(1 - u**2), mpmath.asin(u), 1, 1),
    "acos": lambda u: _circle(u, mpmath.sqrt(1 - u**2), mpmath.acos(u), -1, 1),
    "asinh": lambda u: _circle(u, mpmath.sqrt(1 + u**2), mpmath.asinh(u), 1, -1),
    "acosh": lambda u: _circle(u, mpmath.sqrt(u**2 - 1), mpmath.acosh(u), 1, -1),
    "atanh": lambda u: (mpmath.atanh(u), 1 / (1 - u**2), 2 * u / (1 - u**2) ** 2),
    "acoth": lambda u: (mpmath.acoth(u), 1 / (1 - u**2), 2 * u / (1 - u**2) ** 2),
    "abs": lambda u: (abs(u), mpmath.sign(u), 0),
    "sign": lambda u: (mpmath.sign(u), 0, 0),
    "Heaviside": lambda u: ((1 + mpmath.sign(u)) / 2, 0, 0),
}


def _error_function(u: Any) -> tuple[Any, Any, Any]:
    slope = 2 / mpmath.sqrt(mpmath.pi) * mpmath.exp(-(u**2))
    return mpmath.erf(u), slope, -2 * u * slope


def _imaginary_error_function(u: Any) -> tuple[Any, Any, Any]:
    slope = 2 / mpmath.sqrt(mpmath.pi) * mpmath.exp(u**2)
    return mpmath.erfi(u), slope, 2 * u * slope


def _gamma(u: Any) -> tuple[Any, Any, Any]:
    if u <= 0:
        raise NotReal("gamma")
    value, first = mpmath.gamma(u), mpmath.psi(0, u)
    return value, value * first, value * (first**2 + mpmath.psi(1, u))


def _lambert(u: Any) -> tuple[Any, Any, Any]:
    w = mpmath.lambertw(u)
    slope = mpmath.exp(-w) / (1 + w)
    return w, slope, -(slope**2) * (2 + w) / (1 + w)


def _exponential_integral(u: Any) -> tuple[Any, Any, Any]:
    if u <= 0:
        raise NotReal("Ei")
    slope = mpmath.exp(u) / u
    return mpmath.ei(u), slope, slope * (1 - 1 / u)


# From mpmath alone; of an order (constant) and an argument.
_SPECIAL: dict[str, Callable[..., tuple[Any, Any, Any]]] = {
    "erf": _error_function,
    "erfi": _imaginary_error_function,
    "gammafunction": _gamma,
    "expintegral": _exponential_integral,
    "lambertw": _lambert,
    "besselj": lambda n, u: tuple(mpmath.besselj(n, u, derivative=k) for k in range(3)),
    "bessely": lambda n, u: tuple(mpmath.bessely(n, u, derivative=k) for k in range(3)),
    "polygamma": lambda n, u: tuple(mpmath.psi(int(n) + k, u) for k in range(3)),
}


def arbitrary(name: str, orders: Sequence[int], place: Sequence[Any]) -> Any:
    """A derivative of the particular function that replaces an arbitrary one: c + exp(a.u)/2 +
    sin(b.u + d).
    """
    draw = random.Random(name)
    a, b = ([mpmath.mpf(draw.randint(20, 90)) / 100 for _ in place] for _ in range(2))
    shift = mpmath.mpf(draw.randint(10, 90)) / 100
    total = sum(orders)
    up = mpmath.exp(mpmath.fdot(a, place)) / 2
    turn = mpmath.sin(mpmath.fdot(b, place) + shift + total * mpmath.pi / 2)
    for x, y, order in zip(a, b, orders, strict=True):
        up, turn = up * x**order, turn * y**order
    return up + turn + (0 if total else 2)


class Point:
    """A real point: numbers for names, jets for the variables among them; integrals have the given
    slopes.
    """

    def __init__(
        self,
        numbers: Mapping[str, Any],
        variables: Sequence[str] = (),
        integrals: Mapping[str, Any] | None = None,
    ) -> None:
        self.numbers, self.integrals = dict(numbers), dict(integrals or {})
        self.index = {name: k for k, name in enumerate(variables)}
        self.letters = dict[str, Jet]()  # the argument of a function of one variable

    def jet(self, text: str) -> Jet:
        """The jet of a formula. Raises NotReal if it has no real value."""
        try:
            found = self._of(read(text))
        except (ZeroDivisionError, OverflowError) as error:
            raise NotReal(text) from error
        if not all(map(_is_real, (found.value, *found.slopes.values(), *found.bends.values()))):
            raise NotReal(text)
        return found

    def value(self, text: str) -> Any:
        return self.jet(text).value

    def holds(self, condition: str) -> bool:
        """Whether a strict inequality such as "x' != 0" holds here."""
        parts = re.split(r"(!=|==|>=|<=|>|<)", condition)
        values = [self.value(part) for part in parts[::2]]
        compare = {
            "==": lambda a, b: a == b,
            ">": lambda a, b: a > b,
            "<": lambda a, b: a < b,
            "!=": lambda a, b: abs(a - b) > 1e-12,
            ">=": lambda a, b: a >= b,
            "<=": lambda a, b: a <= b,
        }
        return all(
            compare[sign](a, b) for sign, a, b in zip(parts[1::2], values, values[1:], strict=False)
        )

    def _is_true(self, tree: Tree) -> bool:
        if tree[0] == "compare":
            values = [self._of(part).value for part in tree[1::2]]
            pairs = zip(tree[2::2], values, values[1:], strict=False)
            return all(
                left < right if sign[0] == "<" else left > right for sign, left, right in pairs
            )
        found = [self._is_true(part) for part in tree[1:]]
        return not found[0] if tree[0] == "not" else any(found) if tree[0] == "or" else all(found)

    def _of(self, tree: Tree) -> Jet:
        kind = tree[0]
        if kind == "pieces":
            return self._of(next(value for value, condition in tree[1] if self._is_true(condition)))
        if kind == "number":
            return _constant(mpmath.mpf(tree[1]))
        if kind == "name" and tree[1] in self.letters:
            return self.letters[tree[1]]
        if kind == "name":
            return self._name(tree[1])
        if kind == "call":
            return self._call(*tree[1:])
        left = self._of(tree[1])
        if kind == "^":
            return self._power(left, tree[2])
        right = self._of(tree[2])
        if kind in "+-":
            return _added(left, right, 1 if kind == "+" else -1)
        if kind == "/":
            u = right.value
            right = composed(right, 1 / u, -1 / u**2, 2 / u**3)
        return _times(left, right)

    def _name(self, name: str) -> Jet:
        if name in self.numbers:
            slopes = {self.index[name]: mpmath.mpf(1)} if name in self.index else {}
            return Jet(self.numbers[name], slopes, {})
        if name == "pi":
            return _constant(+mpmath.pi)
        raise ValueError(f"{name} has no value")

    def _power(self, base: Jet, exponent: Tree) -> Jet:
        upper = self._of(exponent)
        e, u = upper.value, base.value
        if upper.slopes:
            if u <= 0:
                raise NotReal("a power")
            return _exponential(_times(upper, composed(base, *_logarithm(u))))
        if e == int(e):
            e = int(e)
            if e in (0, 1):
                return base if e else _constant(mpmath.mpf(1))
            return composed(
                base,
                u**e,
                e * u ** (e - 1),
                e * (e - 1) * u ** (e - 2) if e != 2 else mpmath.mpf(2),
            )
        if u <= 0:
            raise NotReal("a power")
        return composed(base, u**e, e * u ** (e - 1), e * (e - 1) * u ** (e - 2))

    def _call(self, name: str, arguments: tuple[Tree, ...], orders: tuple[int, ...]) -> Jet:
        if name in self.integrals:
            names = self.integrals[name]["arguments"]
            is_of_one = len(names) == 1 and arguments != tuple(map(read, names))
            return self._of_one(name, *arguments) if is_of_one else self._integral(name)
        inner = [self._of(argument) for argument in arguments]
        if name in _EXTREMES and len(inner) > 1:
            return _EXTREMES[name](inner, key=lambda jet: jet.value)
        if name in _ROOTS and not any(orders):
            u = inner[0].value
            if (name == "log" and u <= 0) or (name == "sqrt" and u <= 0):
                raise NotReal(name)
            try:
                return composed(inner[0], *_ROOTS[name](u))
            except TypeError as error:  # the sign of a complex number
                raise NotReal(name) from error
        if name in _SPECIAL and not any(orders):
            return composed(inner[-1], *_SPECIAL[name](*(one.value for one in inner)))
        return _applied(name, orders, inner)

    def _of_one(self, name: str, argument: Tree) -> Jet:
        """G(w) with a given G'(u): an arbitrary value, and the slopes G'(w) w_i."""
        inner, kept = self._of(argument), self.letters
        [(letter, slope)] = self.integrals[name]["derivatives"].items()
        self.letters = {letter: inner}
        rate = self._of(read(slope))
        self.letters = kept
        found = Jet(mpmath.mpf(7) / 5, {}, {})
        found.slopes.update({i: rate.value * x for i, x in inner.slopes.items()})
        for i in range(len(self.index)):
            for j in range(i, len(self.index)):
                product = inner.slopes.get(i, 0) * rate.slopes.get(j, 0)
                found.bends[i, j] = product + rate.value * inner.bends.get((i, j), 0)
        return found

    def _integral(self, name: str) -> Jet:
        """A function with an integral sign: an arbitrary value, and the given slopes along its
        arguments.
        """
        found = Jet(mpmath.mpf(7) / 5, {}, {})
        for by, slope in self.integrals[name]["derivatives"].items():
            if by not in self.index:
                continue
            jet, i = self._of(read(slope)), self.index[by]
            found.slopes[i] = jet.value
            for j, x in jet.slopes.items():
                if i <= j:
                    found.bends[i, j] = x
        return found


def _exponential(inner: Jet) -> Jet:
    return composed(inner, *[mpmath.exp(inner.value)] * 3)


def _applied(name: str, orders: Sequence[int], inner: Sequence[Jet]) -> Jet:
    """A derivative of an arbitrary function of some jets."""
    place = [jet.value for jet in inner]

    def slope(*by: int) -> Any:
        return arbitrary(name, [order + by.count(k) for k, order in enumerate(orders)], place)

    found = _constant(slope())
    for k, jet in enumerate(inner):
        first = slope(k)
        scaled = Jet(
            0,
            {i: x * first for i, x in jet.slopes.items()},
            {i: x * first for i, x in jet.bends.items()},
        )
        found = _added(found, scaled, 1)
        for m, other in enumerate(inner):
            second = slope(k, m)
            for i, x in jet.slopes.items():
                for j, y in other.slopes.items():
                    if i <= j:
                        found.bends[i, j] = found.bends.get((i, j), 0) + second * x * y
    return found


def _is_real(number: Any) -> bool:
    return not isinstance(number, mpmath.mpc) and bool(mpmath.isfinite(number))
