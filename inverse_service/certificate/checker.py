"""The independent checker of certificates; FORMAT.md beside this file says what it checks.

It imports nothing of the project, reads the formulas itself, draws its own points, primes and
directions, never searches and never repairs. All numbers are Python integers: residues modulo a
random prime where the formulas are rational, else fixed-point reals whose constants come from mpmath.
"""

from __future__ import annotations

import json
import math
import random
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from heapq import heapify, heappop, heappush
from itertools import combinations_with_replacement, product
from typing import Any, Literal

import mpmath

FORMAT, RESULT_FORMAT = "inverse-service/certificate/1", "inverse-service/result/1"
MAX_TEXT, MAX_DEPTH, MAX_DIGITS, MAX_EXPONENT = 60_000, 64, 400, 1000
MAX_COORDINATES, MAX_NAMES, MAX_ORDER, MAX_ROWS, MAX_MONOMIALS = 16, 200, 20, 200_000, 400_000
PRECISIONS = ((480, 200, 90), (1440, 900, 400))  # bits; what is below 2^-200 is zero, above 2^-90 is not
PRIMITIVE = ("exp", "log", "sin", "cos", "atan")
DEFINED = {
    "sqrt": "u^(1/2)", "tan": "sin(u)/cos(u)", "cot": "cos(u)/sin(u)", "sec": "1/cos(u)", "csc": "1/sin(u)",
    "sinh": "(exp(u) - exp(-u))/2", "cosh": "(exp(u) + exp(-u))/2", "sech": "2/(exp(u) + exp(-u))",
    "csch": "2/(exp(u) - exp(-u))", "tanh": "(exp(u) - exp(-u))/(exp(u) + exp(-u))",
    "coth": "(exp(u) + exp(-u))/(exp(u) - exp(-u))", "asin": "atan(u/sqrt(1 - u^2))",
    "acos": "pi/2 - atan(u/sqrt(1 - u^2))", "asinh": "log(u + sqrt(u^2 + 1))", "acosh": "log(u + sqrt(u^2 - 1))",
    "atanh": "log((1 + u)/(1 - u))/2",
}  # fmt: skip
RESERVED = {"t", "pi", "diff", *PRIMITIVE, *DEFINED}
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}\Z")
TOKEN = re.compile(r"[ \t\r\n]*([0-9]+(?:\.[0-9]+)?|[A-Za-z][A-Za-z0-9_]*'*|[-+*/^(),])")
VALUE = re.compile(r"-?[0-9]{1,400}(?:\.[0-9]{1,400}|/0{0,9}[1-9][0-9]{0,399})?\Z")

Component = dict[int, int]  # coefficients of monomials, packed as in Expansion
Series = list[Component]  # one component for each total degree
Row = tuple[str, int, int, int]  # H2 or H3, i, j, packed alpha
Jet = dict[tuple[int, ...], int]  # derivatives of a function at one argument


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The checker's verdict, and sentences that give its reasons."""

    verdict: Literal["valid", "incomplete", "invalid"]
    reasons: tuple[str, ...] = ()


class Refused(Exception):
    """The document is malformed or its claim was found wrong."""


class Unsettled(Exception):
    """Nothing can be said."""


class Undefined(Exception):
    """A formula is not defined, or nearly not, at the point in hand."""


def require(condition: object, sentence: str) -> None:
    if not condition:
        raise Refused(sentence)


@dataclass(frozen=True, slots=True)
class Clock:
    """Ends the check when its time is over."""

    limit: float
    start: float = field(default_factory=time.monotonic)

    def check(self) -> None:
        if not time.monotonic() - self.start < self.limit:
            raise Unsettled(f"The time limit of {self.limit:g} s ended the check.")


@dataclass(frozen=True, slots=True)
class Document:
    """A part of a JSON document and its place; its methods refuse what is not as they say."""

    value: Any
    where: str

    def keys(self) -> list[str]:
        good = isinstance(self.value, Mapping) and len(self.value) <= 1000 and all(isinstance(key, str) for key in self.value)
        require(good, f"{self.where} has to be an object of at most 1000 members.")
        return list(self.value)

    def get(self, key: str, default: object = None) -> Document:
        """A member; null is as good as left out."""
        found = self.value[key] if key in self.keys() else None
        return Document(default if found is None else found, f"{self.where}.{ascii(key[:40])[1:-1]}")

    def items(self, most: int) -> list[Document]:
        good = isinstance(self.value, list | tuple) and len(self.value) <= most
        require(good, f"{self.where} has to be a list of at most {most} items.")
        return [Document(item, f"an item of {self.where}") for item in self.value]

    def names(self, most: int) -> tuple[str, ...]:
        for item in self.items(most):
            good = isinstance(item.value, str) and NAME.match(item.value)
            require(good, f"{item.where} has to be a name of letters, digits and _.")
        return tuple(self.value)

    def whole(self, low: int, high: int) -> int:
        good = type(self.value) is int and low <= self.value <= high
        require(good, f"{self.where} has to be a whole number from {low} to {high}.")
        return int(self.value)

    def choice(self, *allowed: str) -> str:
        good = isinstance(self.value, str) and self.value in allowed
        require(good, f"{self.where} has to be one of: {', '.join(allowed)}.")
        return str(self.value)

    def number(self) -> Fraction:
        whole = type(self.value) is int and self.value.bit_length() < 1300
        text = str(self.value) if whole or isinstance(self.value, str) else ""
        require(VALUE.match(text), f"{self.where} has to be an integer or the text of a number such as -1.25 or 3/4.")
        return Fraction(text)


# Formulas


@dataclass(slots=True)
class Table:
    """All formulas of one check as nodes (kind, content, parts); equal nodes share a number, parts come first."""

    nodes: list[tuple[str, Any, tuple[int, ...]]] = field(default_factory=list)
    known: dict[tuple[str, Any, tuple[int, ...]], int] = field(default_factory=dict)

    def add(self, kind: str, content: Any, *parts: int) -> int:
        """The number of a node; a sum or product of one part is that part, few numbers become one."""
        values = [self.nodes[part][1] for part in parts if self.nodes[part][0] == "number"]
        if kind in ("sum", "product") and len(parts) == 1:
            return parts[0]
        if parts and len(values) == len(parts) <= 8 and all(len(f"{value:x}") < 200 for v in values for value in v.as_integer_ratio()):
            folded = self.fold(kind, values)
            kind, content, parts = (kind, content, parts) if folded is None else ("number", folded, ())
        node = (kind, content, parts)
        if node not in self.known:
            self.known[node] = len(self.nodes)
            self.nodes.append(node)
        return self.known[node]

    def fold(self, kind: str, values: list[Fraction]) -> Fraction | None:
        if kind == "power" and values[1].denominator == 1 and abs(values[1]) <= 64 and (values[0] or values[1] > 0):
            return Fraction(values[0] ** int(values[1]))
        return sum(values, Fraction(0)) if kind == "sum" else math.prod(values) if kind == "product" else None

    def below(self, roots: Iterable[int]) -> list[int]:
        """All nodes of the formulas, parts first."""
        stack, seen = list(roots), set[int]()
        while stack:
            number = stack.pop()
            if number not in seen:
                seen.add(number)
                stack.extend(self.nodes[number][2])
        return sorted(seen)

    def has(self, kind: str, content: str, roots: Iterable[int]) -> bool:
        return any(self.nodes[number][:2] == (kind, content) for number in self.below(roots))

    def exponent(self, number: int) -> Fraction | None:
        """The value of an exponent that is an integer."""
        kind, value, _ = self.nodes[number]
        return value if kind == "number" and value.denominator == 1 else None

    def rational(self, roots: Iterable[int]) -> bool:
        """Whether the formulas are rational in all names and arbitrary functions."""
        nodes = [self.nodes[number] for number in self.below(roots)]
        roots_taken = any(kind == "power" and self.exponent(parts[1]) is None for kind, _, parts in nodes)
        return not roots_taken and not any(kind == "elementary" for kind, _, _ in nodes)


@dataclass(frozen=True, slots=True)
class System:
    """q'' = f as read; `forces` are numbers of nodes in the table."""

    coordinates: tuple[str, ...]
    parameters: frozenset[str]
    functions: Mapping[str, tuple[str, ...]]
    forces: tuple[int, ...] = ()


class Reader:
    """A recursive descent reader of one formula; names in `bound` stand for nodes of the table."""

    def __init__(self, text: Document, table: Table, system: System, **bound: int) -> None:
        good = isinstance(text.value, str) and len(text.value) <= MAX_TEXT
        require(good, f"{text.where} has to be a formula of at most {MAX_TEXT} characters.")
        self.table, self.system, self.where, self.bound = table, system, text.where, bound
        self.tokens, self.position, self.depth, at, formula = list[str](), 0, 0, 0, text.value.rstrip(" \t\r\n")
        while at < len(formula):
            match = TOKEN.match(formula, at)
            if not match or (match[1][0].isdigit() and len(match[1]) > MAX_DIGITS):
                raise Refused(f"{self.where}: what stands at column {at + 1} is no part of a formula.")
            self.tokens.append(match[1])
            at = match.end()
        self.tokens.append("")

    def expect(self, condition: object, what: str) -> None:
        require(condition, f"{self.where}: {what}, at token {self.position + 1}.")

    def formula(self) -> int:
        number = self.sum()
        self.expect(self.position == len(self.tokens) - 1, "an operator is expected")
        return number

    def take(self, operators: str) -> str:
        """The next token if it is one of the operators, else nothing."""
        here = self.tokens[self.position]
        self.position += bool(here) and here in operators
        return here if here in operators else ""

    def chain(self, kind: str, part: Callable[[], int], operators: str, turn: Callable[[int], int]) -> int:
        """part op part …; `turn` is applied behind the second operator."""
        self.depth += 1
        self.expect(self.depth <= 2 * MAX_DEPTH, f"at most {MAX_DEPTH} levels of nesting are allowed")
        parts = [part()]
        while operator := self.take(operators):
            parts.append(part() if operator == operators[0] else turn(part()))
        self.depth -= 1
        return self.table.add(kind, None, *parts)

    def sum(self) -> int:
        return self.chain("sum", self.product, "+-", self.negative)

    def product(self) -> int:
        return self.chain("product", self.signed, "*/", lambda part: self.table.add("power", None, part, self.integer(-1)))

    def integer(self, value: int) -> int:
        return self.table.add("number", Fraction(value))

    def negative(self, number: int) -> int:
        return self.table.add("product", None, self.integer(-1), number)

    def signed(self) -> int:
        """A power, its exponent a chain of one so that depth is counted, behind any number of minus signs."""
        minus = 0
        while self.take("-"):
            minus += 1
        number = self.atom()
        if self.take("^"):
            number = self.table.add("power", None, number, self.chain("product", self.signed, "^", self.negative))
        return self.negative(number) if minus % 2 else number

    def atom(self) -> int:
        token = self.tokens[self.position]
        self.expect(token[:1].isalnum() or token == "(", "a number, a name or '(' is expected")
        self.position += 1
        if token == "(":
            return self.arguments()[0]
        if token[0].isdigit():
            return self.table.add("number", Fraction(token))
        name = token.rstrip("'")
        primes = len(token) - len(name)
        return self.call(name, primes, self.arguments(",")) if self.take("(") else self.name(name, primes)

    def arguments(self, comma: str = "") -> list[int]:
        parts = [self.sum()]
        while comma and self.take(comma):
            parts.append(self.sum())
        self.expect(self.take(")"), "')' is expected")
        return parts

    def name(self, name: str, primes: int) -> int:
        if name in self.bound and not primes:
            return self.bound[name]
        known = primes <= 1 if name in self.system.coordinates else (name in {"t", "pi"} | self.system.parameters) > primes
        self.expect(known, f"the name {name[:40]} (with {primes} primes) is not known")
        return self.table.add("name", name + "'" * primes)

    def call(self, name: str, primes: int, parts: list[int]) -> int:
        declared = len(self.system.functions.get(name, ()))
        good = declared == len(parts) and primes <= (MAX_ORDER if declared == 1 else 0)
        if good and declared:
            return self.table.add("function", (name, (primes,) + (0,) * (declared - 1)), *parts)
        if name == "diff":
            return self.derivative(parts)
        good = not primes and len(parts) == 1 and (name in PRIMITIVE or name in DEFINED)
        self.expect(good, f"{name[:40]} (with {primes} primes) is not known as a function of {len(parts)} arguments")
        if name in PRIMITIVE:
            return self.table.add("elementary", name, *parts)
        return Reader(Document(DEFINED[name], self.where), self.table, self.system, u=parts[0]).formula()

    def derivative(self, parts: list[int]) -> int:
        """diff(A(x, y), x, …), by arguments that are names."""
        kind, content, arguments = self.table.nodes[parts[0]]
        names = [part for part in arguments if self.table.nodes[part][0] == "name" and arguments.count(part) == 1]
        good = kind == "function" and set(parts[1:]) <= set(names) and len(parts) <= MAX_ORDER
        self.expect(good, "diff takes a declared function and some of its arguments, which are distinct names")
        orders = tuple(order + parts[1:].count(part) for order, part in zip(content[1], arguments, strict=True))
        return self.table.add("function", (content[0], orders), *arguments)


def read_system(document: Document, table: Table) -> System:
    declared = document.get("functions", {})
    functions = {name: declared.get(name).names(6) for name in declared.keys()}  # noqa: SIM118
    coordinates, parameters = document.get("coordinates").names(MAX_COORDINATES), document.get("parameters", ()).names(MAX_NAMES)
    everything = [*coordinates, *parameters, *Document(list(functions), "functions").names(MAX_NAMES)]
    require(coordinates and all(functions.values()), f"{document.where} needs coordinates, and arguments of its functions.")
    good = len(set(everything)) == len(everything) and not RESERVED & set(everything)
    require(good, f"{document.where} declares a name twice, or one that has a meaning of its own.")
    equations, system = document.get("equations"), System(coordinates, frozenset(parameters), functions)
    require(set(equations.keys()) == set(coordinates), "equations has to hold one formula for each coordinate.")
    return replace(system, forces=tuple(Reader(equations.get(name), table, system).formula() for name in coordinates))


# Numbers and power series


class Arithmetic:
    """Residues modulo `prime`, or (prime 0) reals as integers scaled by `one` = 2^bits."""

    def __init__(self, generator: random.Random, prime: int = 0, bits: int = 0, cut: int = 0, gap: int = 0) -> None:
        self.generator, self.prime, self.bits, self.one = generator, prime, bits, 1 << bits
        self.cut, self.gap, self.noise = self.one >> cut, self.one >> gap, 1 << bits // 4
        self.context = mpmath.mp.clone()
        self.context.prec = bits + 64

    @classmethod
    def modular(cls, generator: random.Random) -> Arithmetic:
        while not mpmath.libmp.isprime(prime := generator.randrange(1 << 60, 1 << 61)):
            pass
        return cls(generator, prime)

    def draw(self) -> int:
        return self.generator.randrange(self.prime) if self.prime else self.generator.randrange(-self.one, self.one)

    def reduce(self, value: int) -> int:
        """The number that a product of two numbers stands for."""
        return value % self.prime if self.prime else value >> self.bits

    def settle(self, raw: Component) -> Component:
        """`reduce` for each coefficient, zeros dropped (of reals: what is far below every threshold)."""
        if prime := self.prime:
            return {key: rest for key, value in raw.items() if (rest := value % prime)}
        bits, noise = self.bits, self.noise
        return {key: rest for key, value in raw.items() if abs(rest := value >> bits) > noise}

    def row(self, raw: Component, scale: int = 0) -> Component:
        """`settle` for a row of an elimination; with a `scale` the largest entry is made 1, or all are zero."""
        row = self.settle(raw)
        if self.prime or not row:
            return row
        largest = max(map(abs, row.values())) if scale else self.one
        if self.vanishes(largest, scale):
            return {}
        scaled = {key: (value << self.bits) // largest for key, value in row.items()} if scale else row
        return {key: value for key, value in scaled.items() if not self.vanishes(value, self.one)}

    def vanishes(self, value: int, scale: int) -> bool:
        """Whether the number is zero; reals: beside numbers of the size of `scale`."""
        if self.prime:
            return value % self.prime == 0
        if abs(value) << self.bits <= self.cut * scale:
            return True
        if abs(value) << self.bits < self.gap * scale:
            raise Unsettled("A number is too close to zero to judge.")
        return False

    def number(self, value: Fraction) -> int:
        if self.prime:
            return value.numerator * self.inverse(value.denominator) % self.prime
        return (value.numerator << self.bits) // value.denominator

    def inverse(self, value: int, least: int = 30) -> int:
        if abs(value) << least < self.one or (self.prime and value % self.prime == 0):
            raise Undefined
        return pow(value, -1, self.prime) if self.prime else (self.one << self.bits) // value

    def real(self, name: str, argument: int = 0) -> int:
        """An elementary function, or pi, as mpmath computes it; refused unless real and of moderate size."""
        if self.prime or abs(argument) >> 10 > self.one:
            raise Undefined
        try:
            content = getattr(self.context, name)
            value = +content if name == "pi" else content(self.context.ldexp(argument, -self.bits))
        except (ValueError, ArithmeticError) as error:
            raise Undefined from error
        if not isinstance(value, self.context.mpf) or not abs(value) < 1 << 64:
            raise Undefined
        return int(self.context.ldexp(value, self.bits))


@dataclass(frozen=True, slots=True)
class Point:
    """Values of all names, and of the derivatives of functions at the arguments met so far."""

    arithmetic: Arithmetic
    values: dict[str, int]
    jets: list[tuple[str, list[int], Jet]] = field(default_factory=list)

    def jet(self, name: str, arguments: list[int]) -> Jet:
        """The derivatives drawn so far; equal arguments have the same."""
        near = 0 if self.arithmetic.prime else self.arithmetic.cut
        for known, values, jet in self.jets:
            if known == name and all(abs(a - b) <= near for a, b in zip(values, arguments, strict=True)):
                return jet
        self.jets.append((name, arguments, {}))
        return self.jets[-1][2]


class Expansion:
    """Power series about a point in the displacements of `variables`: t (if any), q_1 … q_n, v_1 … v_n.

    A monomial is an integer, eight bits for each exponent and the total degree on top of them.
    """

    def __init__(self, table: Table, point: Point, variables: list[str], n: int, degree: int, clock: Clock) -> None:
        self.table, self.point, self.arithmetic, self.variables, self.clock = table, point, point.arithmetic, variables, clock
        self.degree, self.n, m = degree, n, len(variables)
        self.shift, self.units = 8 * m, [(1 << 8 * a) | (1 << 8 * m) for a in range(m)]
        self.q, self.v = range(m - 2 * n, m - n), range(m - n, m)
        if math.comb(m + degree, degree) > MAX_MONOMIALS:
            raise Unsettled(f"Series of more than {MAX_MONOMIALS} terms would be needed.")

    def exponent(self, key: int, variable: int) -> int:
        return (key >> 8 * variable) & 255

    def monomials(self, degree: int) -> Iterator[int]:
        return (sum(units) for units in combinations_with_replacement(self.units, degree)) if degree >= 0 else iter(())

    def unknowns(self, degree: int) -> list[int]:
        """The unknowns of a degree: total degree two more, v-degree at least two."""
        return [key for key in self.monomials(degree + 2) if sum(self.exponent(key, v) for v in self.v) >= 2]

    def constant(self, value: int) -> Series:
        return [{0: value} if value else {}, *({} for _ in range(self.degree))]

    def add(self, terms: list[Series], weights: Iterable[int] = ()) -> Series:
        """The sum of the series, each times a small integer."""
        total: Series = [{} for _ in range(self.degree + 1)]
        for term, weight in zip(terms, weights or [1] * len(terms), strict=True):
            for sums, component in zip(total, term, strict=True):
                for key, value in component.items():
                    sums[key] = sums.get(key, 0) + ((value * weight) << self.arithmetic.bits)
        return [self.arithmetic.settle(sums) for sums in total]

    def multiply(self, left: Series, right: Series) -> Series:
        return [self.convolve(left, right, degree, [1] * (degree + 1)) for degree in range(self.degree + 1)]

    def convolve(self, left: Series, right: Series, degree: int, weights: list[int]) -> Component:
        """sum_j weights[j] left_j right_(degree - j)."""
        total: Component = {}
        for j, weight in enumerate(weights):
            terms = list(right[degree - j].items()) if weight else []
            for first, value in left[j].items() if terms else ():
                self.clock.check()
                for second, other in terms:
                    total[first + second] = total.get(first + second, 0) + value * weight * other
        return self.arithmetic.settle(total)

    def times(self, component: Component, factor: int) -> Component:
        return self.arithmetic.settle({key: value * factor for key, value in component.items()})

    def derivative(self, series: Series, variable: int) -> Series:
        unit, exponent = self.units[variable], self.exponent
        lowered = [{key - unit: value * power for key, value in component.items() if (power := exponent(key, variable))}
                   for component in series[1:]]
        return self.add([[*lowered, {}]])

    def inverse(self, series: Series) -> Series:
        """y = 1/u: u_0 y_k = -sum_(j > 0) u_j y_(k-j)."""
        start = self.arithmetic.inverse(series[0].get(0, 0))
        result = self.constant(start)
        for k in range(1, self.degree + 1):
            result[k] = self.times(self.convolve(series, result, k, [0] + [-1] * k), start)
        return result

    def power(self, base: Series, exponent: Fraction | None, other: Series) -> Series:
        """An integral power by squaring; any other is exp(other log base)."""
        if exponent is None:
            return self.elementary("exp", self.multiply(other, self.elementary("log", base)))
        if abs(exponent) > MAX_EXPONENT:
            raise Undefined
        base = self.inverse(base) if exponent < 0 else base
        result = self.constant(self.arithmetic.one)
        for bit in f"{abs(int(exponent)):b}":
            result = self.multiply(result, result)
            result = self.multiply(result, base) if bit == "1" else result
        return result

    def integrate(self, argument: Series, slope: Series, result: Series, sign: int = 1) -> Iterator[None]:
        """y with E(y) = w E(u), E the Euler operator: k y_k = sum_j j u_j w_(k-j); w may be y or grow beside it."""
        for k in range(1, self.degree + 1):
            factor = self.arithmetic.number(Fraction(sign, k))
            result[k] = self.times(self.convolve(argument, slope, k, list(range(k + 1))), factor)
            yield

    def elementary(self, name: str, u: Series) -> Series:
        start = u[0].get(0, 0)
        result = self.constant(self.arithmetic.real(name, start))
        if name in ("sin", "cos"):
            other, sign = self.constant(self.arithmetic.real("cos" if name == "sin" else "sin", start)), 2 * (name == "sin") - 1
            list(zip(self.integrate(u, other, result, sign), self.integrate(u, result, other, -sign), strict=True))
            return result
        inside = self.add([self.constant(self.arithmetic.one), self.multiply(u, u)]) if name == "atan" else u
        list(self.integrate(u, result if name == "exp" else self.inverse(inside), result))
        return result

    def series(self, roots: Iterable[int]) -> list[Series]:
        """The Taylor series of formulas."""
        order, wanted, values = self.table.below(roots), list(roots), dict[int, Series]()
        last = {part: number for number in order for part in self.table.nodes[number][2]}
        for number in order:
            self.clock.check()
            kind, content, parts = self.table.nodes[number]
            values[number] = self.node(kind, content, parts, [values[part] for part in parts])
            for part in set(parts):
                if last[part] == number and part not in wanted:
                    del values[part]  # its last use: memory stays small
        return [values[root] for root in wanted]

    def node(self, kind: str, content: Any, parts: tuple[int, ...], values: list[Series]) -> Series:
        match kind:
            case "number":
                return self.constant(self.arithmetic.number(content))
            case "name":
                return self.variable(content)
            case "sum":
                return self.add(values)
            case "power":
                return self.power(values[0], self.table.exponent(parts[1]), values[1])
            case "elementary":
                return self.elementary(content, values[0])
            case "function":
                jet = self.point.jet(content[0], [one[0].get(0, 0) for one in values])
                return self.horner(jet, content[1], [], [[{}, *one[1:]] for one in values])
        result, *rest = values
        for series in rest:
            result = self.multiply(result, series)
        return result

    def variable(self, name: str) -> Series:
        series = self.constant(self.point.values[name])
        if name in self.variables and self.degree:
            series[1] = {self.units[self.variables.index(name)]: self.arithmetic.one}
        return series

    def horner(self, jet: Jet, orders: tuple[int, ...], beta: list[int], rest: list[Series]) -> Series:
        """sum over beta of A_(orders + beta) (u - u_0)^beta / beta! with random A_…."""
        if not rest:
            place = tuple(map(sum, zip(beta, orders, strict=True)))
            factor = self.arithmetic.number(Fraction(1, math.prod(map(math.factorial, beta))))
            return self.constant(self.arithmetic.reduce(jet.setdefault(place, self.arithmetic.draw()) * factor))
        result = self.constant(0)
        for power in range(self.degree - sum(beta), -1, -1):
            result = self.add([self.multiply(result, rest[0]), self.horner(jet, orders, [*beta, power], rest[1:])])
        return result


# The linear system for a multiplier


class Elimination:
    """Rows in echelon form, columns (keys of monomials) in the order of falling degree."""

    def __init__(self, arithmetic: Arithmetic, shift: int, clock: Clock) -> None:
        self.arithmetic, self.shift, self.clock = arithmetic, shift, clock
        self.rows: list[Component] = []  # without their pivots, which are 1
        self.pivots: list[int] = []
        self.order: dict[int, int] = {}  # pivot: number of its row

    def insert(self, row: Component) -> None:
        """Reduce the row degree by degree until its part of the highest degree is new, then keep it."""
        while row:
            top = max(row) >> self.shift
            row = self.reduced(row, top)
            block = [key for key in row if key >> self.shift == top]
            if block:
                pivot = max(block, key=lambda key: key if self.arithmetic.prime else abs(row[key]))
                inverse, self.order[pivot] = self.arithmetic.inverse(row.pop(pivot), 400), len(self.rows)
                self.pivots.append(pivot)
                self.rows.append(self.arithmetic.settle({key: value * inverse for key, value in row.items()}))
                return

    def reduced(self, row: Component, top: int) -> Component:
        """Without the pivots of one degree; a kept row holds no pivot of its degree older than itself."""
        raw = {key: value << self.arithmetic.bits for key, value in row.items()}
        queue = [self.order[key] for key in raw if key in self.order and key >> self.shift == top]
        heapify(queue)
        while queue:
            number = heappop(queue)
            factor = self.arithmetic.row({0: raw.pop(self.pivots[number], 0)}).get(0, 0)
            self.clock.check()
            for key, value in self.rows[number].items() if factor else ():
                if key not in raw and key in self.order and key >> self.shift == top:
                    heappush(queue, self.order[key])
                raw[key] = raw.get(key, 0) - factor * value
        return self.arithmetic.row(raw)

    def rank(self, degree: int) -> int:
        """The number of independent rows on unknowns of at most this degree of g."""
        return sum((pivot >> self.shift) - 2 <= degree for pivot in self.pivots)

    def solution(self, columns: list[int]) -> Component:
        """A random solution in the columns of the lowest degree."""
        values = {column: self.arithmetic.draw() for column in columns if column not in self.order}
        for pivot, row in zip(reversed(self.pivots), reversed(self.rows), strict=True):
            if pivot in columns:
                values[pivot] = -self.arithmetic.reduce(sum(value * values[key] for key, value in row.items()))
        return values


def regular(matrix: list[list[int]], arithmetic: Arithmetic, clock: Clock) -> bool:
    elimination, scale = Elimination(arithmetic, 64, clock), max(abs(entry) for row in matrix for entry in row)
    for row in matrix if scale else ():
        elimination.insert(arithmetic.row({j: value << arithmetic.bits for j, value in enumerate(row)}, scale))
    return len(elimination.rows) == len(matrix)


@dataclass(frozen=True, slots=True)
class Task:
    """One question about one system, and what its check works with."""

    table: Table
    system: System
    timed: bool
    generator: random.Random
    clock: Clock
    near: Mapping[str, Fraction] = field(default_factory=dict)

    @property
    def variables(self) -> list[str]:
        q = self.system.coordinates
        return ["t"] * self.timed + [*q] + [name + "'" for name in q]

    def expansion(self, point: Point, degree: int) -> Expansion:
        return Expansion(self.table, point, self.variables, len(self.system.coordinates), degree, self.clock)

    def draw(self, arithmetic: Arithmetic, attempt: int) -> Point:
        """A random point; a real one lies near what the certificate names, else anywhere."""
        values = {}
        for name in ["t", *self.variables, *sorted(self.system.parameters)]:
            values[name] = arithmetic.draw()
            if not arithmetic.prime and name in self.near:
                values[name] = arithmetic.number(self.near[name]) + (values[name] >> (3, 6, 10, 1)[attempt % 4])
            elif not arithmetic.prime:
                values[name] = (abs(values[name]) if attempt % 2 else values[name]) * 3 // 2
        return Point(arithmetic, {**values, "pi": arithmetic.draw() if arithmetic.prime else arithmetic.real("pi")})

    def at_point(self, arithmetic: Arithmetic, roots: Iterable[int], work: Callable[[Point], None]) -> None:
        """Do the work at a random point where the formulas are defined."""
        for attempt in range(60):
            try:
                point = self.draw(arithmetic, attempt)
                self.expansion(point, 0).series(roots)
                return work(point)
            except Undefined:
                self.clock.check()
        raise Unsettled("No point was found at which every formula is defined.")

    def settle(self, roots: tuple[int, ...], work: Callable[[Point], None], thorough: bool = False) -> None:
        """The work modulo two or three primes; or in real numbers, with more digits too if thorough or unsettled."""
        if self.table.rational(roots):
            for _ in range(2 + thorough):
                self.at_point(Arithmetic.modular(self.generator), roots, work)
            return
        coarse, fine = (Arithmetic(self.generator, 0, *precision) for precision in PRECISIONS)
        try:
            self.at_point(coarse, roots, work)
        except Unsettled:
            thorough = True
        if thorough:
            self.at_point(fine, roots, work)


def flat(series: Series) -> Component:
    return {key: value for component in series for key, value in component.items()}


class Prolongation:
    """The Helmholtz conditions (times two) on the Taylor coefficients of L at a point."""

    def __init__(self, task: Task, point: Point, degree: int) -> None:
        self.ring, self.arithmetic, self.n = task.expansion(point, degree), point.arithmetic, len(task.system.coordinates)
        self.forces = self.ring.series(task.system.forces)
        speeds = [self.ring.variable(name + "'") for name in task.system.coordinates]
        self.field = [self.ring.constant(self.arithmetic.one)] * task.timed + speeds + self.forces
        self.slopes = [[self.ring.derivative(force, v) for v in self.ring.v] for force in self.forces]
        self.scale = max(self.arithmetic.one, *(abs(value) for force in self.forces for value in flat(force).values()), 0)
        self.curvature: dict[tuple[int, int], Component] = {}
        self.divisors: dict[int, list[int]] = {}

    def phi(self, k: int, j: int) -> Component:
        """2 Phi^k_j = 2 Gamma(df^k/dv^j) - 4 df^k/dq^j - sum_l df^k/dv^l df^l/dv^j."""
        if (k, j) not in self.curvature:
            ring, slope = self.ring, self.slopes[k][j]
            along = [ring.multiply(rate, ring.derivative(slope, a)) for a, rate in enumerate(self.field)]
            squares = [ring.multiply(self.slopes[k][m], self.slopes[m][j]) for m in range(self.n)]
            terms = [*along, ring.derivative(self.forces[k], ring.q[j]), *squares]
            self.curvature[k, j] = flat(ring.add(terms, [2] * len(along) + [-4] + [-1] * self.n))
        return self.curvature[k, j]

    def below(self, key: int) -> list[int]:
        """All monomials that divide this one."""
        if key not in self.divisors:
            powers = [[unit * power for power in range(self.ring.exponent(key, a) + 1)] for a, unit in enumerate(self.ring.units)]
            self.divisors[key] = [sum(choice) for choice in product(*powers)]
        return self.divisors[key]

    def collect(self, row: Component, factor: Component, pair: tuple[int, int], alpha: int, weight: int, a: int = -1) -> None:
        """row += weight times the coefficient alpha of factor * g_pair, or of factor * d_a g_pair."""
        i, j = self.ring.v[pair[0]], self.ring.v[pair[1]]
        units, exponent = self.ring.units, self.ring.exponent
        raised = units[i] + units[j] + (units[a] if a >= 0 else 0)
        for part in self.below(alpha):
            if value := factor.get(part):
                key = alpha - part + raised
                times = exponent(key, i) * (exponent(key, j) - (i == j)) * (exponent(alpha - part, a) + 1 if a >= 0 else 1)
                row[key] = row.get(key, 0) + ((value * times * weight) << self.arithmetic.bits)

    def row(self, kind: str, i: int, j: int, alpha: int) -> Component:
        row: Component = {}
        for a, rate in enumerate(self.field if kind == "H2" else ()):
            self.collect(row, flat(rate), (i, j), alpha, 2, a)
        for k in range(self.n):
            pair = (self.phi(k, j), self.phi(k, i)) if kind == "H3" else (flat(self.slopes[k][j]), flat(self.slopes[k][i]))
            self.collect(row, pair[0], (i, k), alpha, 1)
            self.collect(row, pair[1], (j, k), alpha, -1 if kind == "H3" else 1)
        return self.arithmetic.row(row, self.scale)

    def rows(self, degree: int) -> Iterator[Row]:
        """All rows whose unknowns have just this highest degree."""
        for i, j in combinations_with_replacement(range(self.n), 2):
            yield from (("H3", i, j, alpha) for alpha in self.ring.monomials(degree) if i < j)
            yield from (("H2", i, j, alpha) for alpha in self.ring.monomials(degree - 1))

    def value(self, terms: Component) -> list[list[int]]:
        """g(p) of a solution."""
        units = [self.ring.units[v] for v in self.ring.v]
        return [[terms.get(a + b, 0) * (2 if a == b else 1) for a in units] for b in units]

    def leaves_regular(self, elimination: Elimination) -> bool:
        """Whether g(p) may be regular: two random ones are tried."""
        found = [self.value(elimination.solution(self.ring.unknowns(0))) for _ in range(2)]
        return any(regular(g, self.arithmetic, self.ring.clock) for g in found)


# The three kinds of certificates


def check_lagrangian(task: Task, document: Document) -> str:
    root = Reader(document.get("lagrangian"), task.table, task.system).formula()
    require(task.timed or not task.table.has("name", "t", [root]), "The Lagrangian contains t, which the question excludes.")
    task.settle((root, *task.system.forces), lambda point: test_lagrangian(root, task, point), thorough=True)
    return "The Euler-Lagrange equations of the Lagrangian hold and its Hessian is regular."


def test_lagrangian(root: int, task: Task, point: Point) -> None:
    ring, arithmetic = task.expansion(point, 2), point.arithmetic
    lagrangian, *forces = ring.series((root, *task.system.forces))
    speeds = [point.values[name + "'"] for name in task.system.coordinates]

    def second(a: int, b: int) -> int:
        return lagrangian[2].get(ring.units[a] + ring.units[b], 0) * (2 if a == b else 1)

    for i, name in zip(range(len(forces)), task.system.coordinates, strict=True):
        terms = [arithmetic.reduce(second(ring.v[i], b) * force[0].get(0, 0)) for b, force in zip(ring.v, forces, strict=True)]
        terms += [arithmetic.reduce(second(ring.v[i], b) * speed) for b, speed in zip(ring.q, speeds, strict=True)]
        terms += [second(ring.v[i], 0)] * task.timed + [-lagrangian[1].get(ring.units[ring.q[i]], 0)]
        zero = arithmetic.vanishes(sum(terms), max(arithmetic.one >> 60, *map(abs, terms)))
        require(zero, f"The Euler-Lagrange equation of {name} does not hold.")
    hessian = [[second(a, b) for b in ring.v] for a in ring.v]
    require(regular(hessian, arithmetic, task.clock), "The Hessian of the Lagrangian is singular.")


def multi_index(document: Document, variables: int, most: int) -> int:
    exponents = [item.whole(0, most) for item in document.items(variables)]
    require(len(exponents) == variables and sum(exponents) <= most, f"A multi-index needs {variables} exponents of total <= {most}.")
    return sum(exponent << 8 * a for a, exponent in enumerate(exponents)) | sum(exponents) << 8 * variables


def read_row(document: Document, order: int, task: Task) -> Row:
    parts, n = document.items(4), len(task.system.coordinates)
    require(len(parts) == 4, "A row has four parts: kind, i, j, multi-index.")
    kind, i, j = parts[0].choice("H2", "H3"), parts[1].whole(0, n - 1), parts[2].whole(0, n - 1)
    require(i < j or (kind == "H2" and i == j), "A row of H2 needs i <= j, a row of H3 i < j.")
    return kind, i, j, multi_index(parts[3], len(task.variables), order - (kind == "H2"))


def check_nonexistence(task: Task, document: Document) -> str:
    order, shift = document.get("order").whole(0, MAX_ORDER), 8 * len(task.variables)
    rows = [read_row(item, order, task) for item in document.get("rows").items(MAX_ROWS)]
    require(len(set(rows)) == len(rows), "A row is named twice.")
    rows.sort(key=lambda row: ((row[3] >> shift) + (row[0] == "H2"), row))  # low degrees first fill in least
    degree = max(((row[3] >> shift) + (2 if row[0] == "H3" else 1) for row in rows), default=0)

    def work(point: Point) -> None:
        prolongation, elimination = Prolongation(task, point, degree), Elimination(point.arithmetic, shift, task.clock)
        for row in rows:
            elimination.insert(prolongation.row(*row))
        require(not prolongation.leaves_regular(elimination), "The rows leave a regular multiplier g(p).")

    task.settle(task.system.forces, work)
    return f"{len(rows)} rows leave no regular multiplier g(p)."


def check_existence(task: Task, document: Document) -> str:
    order = document.get("order").whole(1, MAX_ORDER)
    degree, symbol = document.get("degree").whole(1, order), document.get("symbol")
    claimed = [item.whole(0, 10**9) for item in document.get("dimensions").items(degree + 1)]
    numbers = [symbol.get(name).whole(0, 10**9) for name in ("dimension", "prolonged")]
    numbers += [item.whole(0, 10**9) for item in symbol.get("characters").items(len(task.variables))]

    def work(point: Point) -> None:
        prolongation, found = Prolongation(task, point, order + 3), list[list[int]]()
        elimination, ring = Elimination(point.arithmetic, prolongation.ring.shift, task.clock), prolongation.ring
        counts = [sum(len(ring.unknowns(low)) for low in range(k + 1)) for k in range(degree + 1)]
        for step in range(order + 2):
            for row in prolongation.rows(step):
                elimination.insert(prolongation.row(*row))
            found.append([count - elimination.rank(k) for k, count in enumerate(counts)])
        require(found[order] == claimed, "The dimensions are not those of the system.")
        require(found[order] == found[order + 1], "The dimension of the projection still falls at the next order.")
        require(prolongation.leaves_regular(elimination), "No multiplier g(p) that is left is regular.")
        test_symbol(elimination, ring, degree, numbers)

    task.settle(task.system.forces, work)
    found = "The projected system is involutive and leaves a regular multiplier g(p)."
    return found if document.get("series").value is None else found + check_series(task, document.get("series"))


def test_symbol(system: Elimination, ring: Expansion, degree: int, claimed: list[int]) -> None:
    """Cartan's test: dim of the prolongation = sum_k dim of what k random derivatives kill."""
    arithmetic, bits = system.arithmetic, system.arithmetic.bits
    above, killed = (Elimination(arithmetic, ring.shift, system.clock) for _ in range(2))
    for pivot, row in zip(system.pivots, system.rows, strict=True):
        if pivot >> ring.shift == degree + 2:
            top = {pivot: arithmetic.one, **{key: value for key, value in row.items() if key >> ring.shift == degree + 2}}
            killed.insert(top)
            for a, unit in enumerate(ring.units):
                raised = {key + unit: (value * (ring.exponent(key, a) + 1)) << bits for key, value in top.items()}
                above.insert(arithmetic.row(raised, arithmetic.one))
    left = [len(ring.unknowns(degree)) - len(killed.rows)]
    for _ in ring.units:
        direction = list(zip(ring.units, [arithmetic.draw() for _ in ring.units], strict=True))
        for key in ring.unknowns(degree - 1) if left[-1] else ():
            row = {key + unit: (u * (ring.exponent(key, a) + 1)) << bits for a, (unit, u) in enumerate(direction)}
            killed.insert(arithmetic.row(row, arithmetic.one))
        left.append(len(ring.unknowns(degree)) - len(killed.rows))
    prolonged = len(ring.unknowns(degree + 1)) - len(above.rows)
    found = [left[0], prolonged, *(before - after for before, after in zip(left, left[1:], strict=False))]
    require(claimed + [0] * (len(found) - len(claimed)) == found, "The dimensions of the symbol are not those of the system.")
    require(prolonged == sum(left[:-1]), "The symbol is not involutive.")


def check_series(task: Task, series: Document) -> str:
    """The rows of the order that it claims vanish on the given coefficients, and g(p) is regular."""
    if any(task.table.nodes[number][0] == "function" for number in task.table.below(task.system.forces)):
        return " The series was not compared: functions are arbitrary."
    order, prime = series.get("order").whole(0, MAX_ORDER), series.get("prime", 0).whole(0, 1 << 127)
    require(not prime or (prime >> 30 and mpmath.libmp.isprime(prime)), "series.prime has to be a prime above 2^30.")
    require(not prime or task.table.rational(task.system.forces), "series.prime has to be null: f is not rational.")
    arithmetic = Arithmetic(task.generator, prime) if prime else Arithmetic(task.generator, 0, 480, 80, 79)
    given, terms = series.get("point"), [item.items(2) for item in series.get("terms").items(MAX_ROWS)]
    try:
        values = {"pi": 0 if prime else arithmetic.real("pi"), **{q: arithmetic.number(given.get(q).number()) for q in given.keys()}}
        require({*task.variables, *task.system.parameters} <= set(values), "series.point lacks a value.")
        require(all(len(term) == 2 for term in terms), "A term of the series is a multi-index and a value.")
        pairs = [(multi_index(a, len(task.variables), order + 2), arithmetic.number(b.number())) for a, b in terms]
        test_series(Prolongation(task, Point(arithmetic, values), order + 2), order, dict(pairs))
    except Undefined:
        raise Refused("The series stands at a point where f is not defined.") from None
    return " The series solves the rows."


def test_series(prolongation: Prolongation, order: int, terms: Component) -> None:
    arithmetic = prolongation.arithmetic
    for step in range(order + 1):
        for name in prolongation.rows(step):
            products = [arithmetic.reduce(value * terms.get(key, 0)) for key, value in prolongation.row(*name).items()]
            zero = arithmetic.vanishes(sum(products), max(1, *map(abs, products), 1))
            require(zero, "The series does not solve the rows.")
    require(regular(prolongation.value(terms), arithmetic, prolongation.ring.clock), "The series has a singular g(p).")


# Documents


KINDS = {
    "lagrangian": (check_lagrangian, "variational"),
    "existence": (check_existence, "variational"),
    "nonexistence": (check_nonexistence, "not_variational"),
}
WORK = Callable[[Table, random.Random, Clock], list[str]]


def judged(work: WORK, time_limit: float, seed: int | None) -> CheckResult:
    generator = random.SystemRandom() if seed is None else random.Random(seed)
    try:
        return CheckResult("valid", tuple(work(Table(), generator, Clock(time_limit))))
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except Unsettled as problem:
        return CheckResult("incomplete", (str(problem),))
    except (RecursionError, MemoryError):
        return CheckResult("incomplete", ("The document is beyond the memory of the checker.",))


def check_certificate(certificate: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a certificate by itself; never raises. `seed` makes the checker's choices repeatable."""
    document = Document(certificate, "certificate")
    return judged(lambda *tools: [certified(document, *tools)], time_limit, seed)


def check_result(result: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a result document, its certificates and their agreement with it; never raises."""
    return judged(lambda *tools: compared(Document(result, "result"), *tools), time_limit, seed)


def check_text(text: str, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on the JSON text of a result or of a certificate; never raises."""
    try:
        document = json.loads(text, object_pairs_hook=without_repetition, parse_constant=refuse_constant)
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except (ValueError, TypeError, RecursionError):
        return CheckResult("invalid", ("The text is no JSON document, or is nested too deeply.",))
    kind = document.get("format") if isinstance(document, dict) else None
    return (check_certificate if kind == FORMAT else check_result)(document, time_limit, seed)


def without_repetition(pairs: list[tuple[str, object]]) -> dict[str, object]:
    require(len(dict(pairs)) == len(pairs), "A key stands twice in one object.")
    return dict(pairs)


def refuse_constant(name: str) -> object:
    raise Refused(f"{name} is not a JSON number.")


def certified(document: Document, table: Table, generator: random.Random, clock: Clock) -> str:
    """Check a certificate; the sentence that says what was found."""
    document.get("format").choice(FORMAT)
    timed = document.get("question").choice("autonomous", "time_dependent") == "time_dependent"
    check, claim = KINDS[document.get("kind").choice(*KINDS)]
    document.get("claim").choice(claim)
    system, near = read_system(document.get("system"), table), document.get("near", {})
    require(timed or not table.has("name", "t", system.forces), "f contains t: the question has to be time_dependent.")
    task = Task(table, system, timed, generator, clock, {name: near.get(name).number() for name in near.keys()})
    require(set(task.near) <= {"t", *task.variables, *system.parameters}, "near holds a name that the system does not know.")
    return check(task, document)


def compared(result: Document, table: Table, generator: random.Random, clock: Clock) -> list[str]:
    """Check a result: first that its parts agree, then its certificates."""
    result.get("format").choice(RESULT_FORMAT)
    system = read_system(result.get("system"), table)
    asked = result.get("question", "").choice("L(q, q')", "L(t, q, q')", "")
    timed = asked == "L(t, q, q')" or (not asked and table.has("name", "t", system.forces))
    verdict = result.get("verdict").choice("variational", "not_variational", "undetermined")
    later = result.get("verdict_with_time", "").choice("variational", "not_variational", "undetermined", "")
    require(not timed or later in ("", verdict), "verdict and verdict_with_time answer one question differently.")
    require((verdict, later) != ("variational", "not_variational"), "An L(q, q') is an L(t, q, q') too.")
    answers = [(result, verdict, "time_dependent" if timed else "autonomous")]
    if result.get("with_time").value is not None:
        require(result.get("with_time").get("verdict", later).value == later, "with_time.verdict is not verdict_with_time.")
        answers.append((result.get("with_time"), later, "time_dependent"))
    certificates = [agreed(*answer, system, table) for answer in answers]
    found = [certified(one, table, generator, clock) for one in certificates if one]
    proven = not later or any(one and proves(one, "time_dependent", later) for one in certificates)
    if not proven or None in certificates or "undetermined" in (verdict, later):
        raise Unsettled("A verdict is undetermined, or no certificate proves it.")
    return [*found, *compare_given(result.get("system").get("given"), Task(table, system, True, generator, clock))]


def proves(certificate: Document, question: str, verdict: str) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate.get("claim").value == verdict and certificate.get("question").value in (question, wider)


def agreed(answer: Document, verdict: str, question: str, system: System, table: Table) -> Document | None:
    """The certificate of an answer, if it has one, once it is seen to speak of the same things."""
    certificate, shown = answer.get("certificate"), answer.get("lagrangian")
    if certificate.value is None:
        return None
    require(proves(certificate, question, verdict), f"{certificate.where} does not claim the verdict that it goes with.")
    require(read_system(certificate.get("system"), table) == system, f"{certificate.where} is about another system.")
    if certificate.get("kind").value != "lagrangian":
        require(shown.value is None, f"{shown.where} is not certified.")
        return certificate
    texts = (shown.get("text"), certificate.get("lagrangian"))
    require(len({Reader(text, table, system).formula() for text in texts}) == 1, f"{shown.where} is not the certified one.")
    return certificate


def compare_given(given: Document, task: Task) -> list[str]:
    """Whether the equations as given, where readable, are the canonical ones; the sentence that says so."""
    if given.value is None:
        return []
    try:
        equations, values = given.get("equations", given.value), given.get("parameters", {})
        bound = {name: values.get(name).number() for name in values.keys()} if isinstance(values.value, Mapping) else {}
        nodes = {name: task.table.add("number", value) for name, value in bound.items()}
        roots = [Reader(equations.get(q), task.table, task.system, **nodes).formula() for q in task.system.coordinates]
    except Refused as problem:
        return [f"The equations as given were not compared: {problem}"]

    def work(point: Point) -> None:
        values = [series[0].get(0, 0) for series in task.expansion(point, 0).series((*roots, *task.system.forces))]
        for a, b in zip(values, values[len(roots) :], strict=False):
            same = point.arithmetic.vanishes(a - b, max(point.arithmetic.one, abs(a), abs(b)))
            require(same, "The canonical equations are not those given.")

    task.settle((*roots, *task.system.forces), work)
    return ["The equations as given are the canonical ones."]
