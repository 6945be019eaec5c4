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
from itertools import combinations_with_replacement, pairwise, product
from typing import Any, Literal

import mpmath

FORMAT, RESULT_FORMAT = "inverse-service/certificate/1", "inverse-service/result/1"
MAX_TEXT, MAX_DEPTH, MAX_DIGITS, MAX_EXPONENT, MAX_MEMBERS = 60_000, 64, 400, 1000, 1000
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
VALUE = re.compile(r"-?[0-9]{1,400}((\.[0-9]{1,400})?(e[-+]?[0-9]{1,2})?|/0{0,9}[1-9][0-9]{0,399})\Z")

Component = dict[int, int]  # coefficients of monomials, packed as in Expansion
Series = list[Component]  # one component for each total degree
Row = tuple[str, int, int, int]  # H2 or H3, i, j, packed alpha
Jet = dict[tuple[int, ...], int]  # derivatives of a function at one argument
Node = tuple[str, Any, tuple[int, ...]]  # kind, content, parts


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
class Document:
    """A part of a JSON document and its place; its methods refuse what is not as they say."""

    value: Any
    where: str

    def keys(self) -> list[str]:
        good = isinstance(self.value, Mapping) and len(self.value) <= MAX_MEMBERS
        require(good and all(isinstance(key, str) for key in self.value), f"{self.where} has to be a moderate object.")
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
        good = all(isinstance(item.value, str) and NAME.match(item.value) for item in self.items(most))
        require(good, f"{self.where} has to hold names of letters, digits and _.")
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
        short = type(self.value) is int and self.value.bit_length() < 1300
        text = str(self.value) if short or isinstance(self.value, str) else ""
        require(VALUE.match(text), f"{self.where} has to be an integer or the text of a number such as -1.25 or 3/4.")
        return Fraction(text)


# Formulas


@dataclass(slots=True)
class Table:
    """All formulas of one check; equal nodes share a number, parts come first, a node has the tags of its parts."""

    nodes: list[Node] = field(default_factory=list)
    tags: list[frozenset[str]] = field(default_factory=list)
    known: dict[Node, int] = field(default_factory=dict)

    def add(self, kind: str, content: Any, *parts: int) -> int:
        """The number of a node; a sum or product of one part is that part, few numbers become one."""
        if kind in ("sum", "product") and len(parts) == 1:
            return parts[0]
        values = [self.nodes[part][1] for part in parts if self.nodes[part][0] == "number"]
        if parts and len(values) == len(parts) <= 8 and (folded := self.folded(kind, values)) is not None:
            kind, content, parts = "number", folded, ()
        node = (kind, content, parts)
        if node not in self.known:
            self.known[node] = len(self.nodes)
            self.nodes.append(node)
            real = kind == "elementary" or (kind == "power" and self.exponent(node) is None)
            own = {content} if kind == "name" else {"real"} if real else {kind}
            self.tags.append(frozenset(own).union(*(self.tags[part] for part in parts)))
        return self.known[node]

    def folded(self, kind: str, values: list[Fraction]) -> Fraction | None:
        if any(max(value.as_integer_ratio(), key=abs).bit_length() > 2000 for value in values):
            return None
        if kind == "power" and values[1].denominator == 1 and abs(values[1]) <= 64 and (values[0] or values[1] > 0):
            return Fraction(values[0] ** int(values[1]))
        if kind == "sum":
            return sum(values, Fraction(0))
        return math.prod(values, start=Fraction(1)) if kind == "product" else None

    def exponent(self, node: Node) -> Fraction | None:
        """The exponent of a power, where it is an integer."""
        kind, value, _ = self.nodes[node[2][1]]
        return value if kind == "number" and value.denominator == 1 else None

    def uses(self, tag: str, roots: Iterable[int]) -> bool:
        """Whether a name (x, x') or a kind of node occurs, "real" being what is not rational."""
        return any(tag in self.tags[root] for root in roots)


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
        here = self.tokens[self.position] if self.tokens[self.position] in operators else ""
        self.position += bool(here)
        return here

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
        return self.chain("product", self.signed, "*/", self.reciprocal)

    def negative(self, number: int) -> int:
        return self.table.add("product", None, self.table.add("number", Fraction(-1)), number)

    def reciprocal(self, number: int) -> int:
        return self.table.add("power", None, number, self.table.add("number", Fraction(-1)))

    def signed(self) -> int:
        """A power behind minus signs; its exponent is a chain of one, so that depth is counted."""
        minus = 0
        while self.take("-"):
            minus += 1
        number = self.atom()
        if self.take("^"):
            number = self.table.add("power", None, number, self.chain("product", self.signed, "^", int))
        return self.negative(number) if minus % 2 else number

    def atom(self) -> int:
        token = self.tokens[self.position]
        self.expect(token[:1].isalnum() or token == "(", "a number, a name or '(' is expected")
        self.position += 1
        if token == "(":
            return self.arguments("(")[0]
        if token[0].isdigit():
            return self.table.add("number", Fraction(token))
        name = token.rstrip("'")
        primes = len(token) - len(name)
        return self.call(name, primes, self.arguments(",")) if self.take("(") else self.name(name, primes)

    def arguments(self, comma: str) -> list[int]:
        parts = [self.sum()]
        while comma == "," and self.take(comma):
            parts.append(self.sum())
        self.expect(self.take(")"), "')' is expected")
        return parts

    def name(self, name: str, primes: int) -> int:
        if name in self.bound and not primes:
            return self.bound[name]
        constant = not primes and name in {"t", "pi"} | self.system.parameters
        self.expect(constant or (primes <= 1 and name in self.system.coordinates),
                    f"the name {name[:40]} (with {primes} primes) is not known")
        return self.table.add("name", name + "'" * primes)

    def call(self, name: str, primes: int, parts: list[int]) -> int:
        declared = len(self.system.functions.get(name, ()))
        if declared == len(parts) and primes <= (MAX_ORDER if declared == 1 else 0):
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
        names = {part for part in arguments if self.table.nodes[part][0] == "name" and arguments.count(part) == 1}
        good = kind == "function" and set(parts[1:]) <= names and len(parts) <= MAX_ORDER
        self.expect(good, "diff takes a declared function and some of its arguments, which are distinct names")
        orders = tuple(order + parts[1:].count(part) for order, part in zip(content[1], arguments, strict=True))
        return self.table.add("function", (content[0], orders), *arguments)


def read_system(document: Document, table: Table) -> System:
    coordinates = document.get("coordinates").names(MAX_COORDINATES)
    parameters, declared = document.get("parameters", ()).names(MAX_NAMES), document.get("functions", {})
    called = Document(declared.keys(), declared.where).names(MAX_NAMES)
    functions = {name: declared.get(name).names(6) for name in called}
    everything, where = {*coordinates, *parameters, *functions}, document.where
    require(coordinates and all(functions.values()), f"{where} needs coordinates, and arguments of its functions.")
    good = len(everything) == len(coordinates) + len(parameters) + len(functions) and not RESERVED & everything
    require(good, f"{where} declares a name twice, or one that has a meaning of its own.")
    equations, system = document.get("equations"), System(coordinates, frozenset(parameters), functions)
    require(set(equations.keys()) == {*coordinates}, f"{where}.equations has to hold one formula for each coordinate.")
    return replace(system, forces=tuple(Reader(equations.get(name), table, system).formula() for name in coordinates))


# Numbers and power series


class Arithmetic:
    """Residues modulo `prime`, or (prime 0) reals as integers scaled by `one` = 2^bits; with the end of its time."""

    def __init__(self, task: Task, prime: int = 0, bits: int = 0, cut: int = 0, gap: int = 0) -> None:
        self.task, self.prime, self.bits, self.one = task, prime, bits, 1 << bits
        self.cut, self.gap, self.noise = self.one >> cut, self.one >> gap, 1 << bits // 4
        self.context = mpmath.mp.clone()
        self.context.prec = bits + 64

    def draw(self) -> int:
        return self.task.generator.randrange(*((self.prime,) if self.prime else (-self.one, self.one)))

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
        if self.cut * scale < abs(value) << self.bits < self.gap * scale:
            raise Unsettled("A number is too close to zero to judge.")
        return abs(value) << self.bits <= self.cut * scale

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


class Expansion:
    """Power series about a point in the displacements of the task's variables: t (if any), q_1 … q_n, v_1 … v_n.

    A monomial is an integer, eight bits for each exponent and the total degree on top of them.
    """

    def __init__(self, arithmetic: Arithmetic, values: dict[str, int], degree: int) -> None:
        self.task, self.arithmetic, self.values, self.degree = arithmetic.task, arithmetic, values, degree
        self.n, m = len(self.task.system.coordinates), len(self.task.variables)
        self.shift, self.units = 8 * m, [(1 << 8 * a) | (1 << 8 * m) for a in range(m)]
        self.q, self.v = range(m - 2 * self.n, m - self.n), range(m - self.n, m)
        self.jets: list[tuple[str, list[int], Jet]] = []
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
        return [self.convolve(left, right, [1] * (degree + 1)) for degree in range(self.degree + 1)]

    def convolve(self, left: Series, right: Series, weights: Iterable[int], factor: int | None = None) -> Component:
        """factor * sum_(j <= k) weights[j] left_j right_(k - j)."""
        total, weights = dict[int, int](), list(weights)
        for component, other, weight in zip(left, reversed(right[: len(weights)]), weights, strict=False):
            terms = list(other.items()) if weight else []
            for first, value in component.items() if terms else ():
                self.task.check_time()
                for second, coefficient in terms:
                    total[first + second] = total.get(first + second, 0) + value * weight * coefficient
        settled, settle = self.arithmetic.settle(total), self.arithmetic.settle
        return settled if factor is None else settle({key: value * factor for key, value in settled.items()})

    def derivative(self, series: Series, variable: int) -> Series:
        unit, exponent = self.units[variable], self.exponent
        lowered = [{key - unit: value * power for key, value in component.items() if (power := exponent(key, variable))}
                   for component in series[1:]]  # fmt: skip
        return self.add([[*lowered, {}]])

    def inverse(self, series: Series) -> Series:
        """y = 1/u: u_0 y_k = -sum_(j > 0) u_j y_(k-j)."""
        start = self.arithmetic.inverse(series[0].get(0, 0))
        result = self.constant(start)
        for k in range(1, self.degree + 1):
            result[k] = self.convolve(series, result, [0] + [-1] * k, start)
        return result

    def power(self, base: Series, exponent: Fraction | None, other: Series) -> Series:
        """An integral power by squaring; any other is exp(other log base)."""
        if exponent is None:
            return self.elementary("exp", self.multiply(other, self.elementary("log", base)))
        if abs(exponent) > MAX_EXPONENT:
            raise Undefined
        base, result = self.inverse(base) if exponent < 0 else base, self.constant(self.arithmetic.one)
        for bit in f"{abs(int(exponent)):b}":
            result = self.multiply(result, result)
            result = self.multiply(result, base) if bit == "1" else result
        return result

    def integrate(self, argument: Series, slope: Series, result: Series, sign: int = 1) -> Iterator[None]:
        """y with E(y) = w E(u), E the Euler operator: k y_k = sum_j j u_j w_(k-j); w may be y or grow beside it."""
        for k in range(1, self.degree + 1):
            result[k] = self.convolve(argument, slope, range(k + 1), self.arithmetic.number(Fraction(sign, k)))
            yield

    def elementary(self, name: str, u: Series) -> Series:
        start, sign = u[0].get(0, 0), -1 if name == "cos" else 1
        result = self.constant(self.arithmetic.real(name, start))
        if name in ("sin", "cos"):
            other = self.constant(self.arithmetic.real("cos" if name == "sin" else "sin", start))
            list(zip(self.integrate(u, other, result, sign), self.integrate(u, result, other, -sign), strict=True))
            return result
        inside = self.add([self.constant(self.arithmetic.one), self.multiply(u, u)]) if name == "atan" else u
        list(self.integrate(u, result if name == "exp" else self.inverse(inside), result))
        return result

    def series(self, roots: Iterable[int]) -> list[Series]:
        """The Taylor series of formulas."""
        wanted, nodes, values = set(roots), self.task.table.nodes, dict[int, Series]()
        needed, last = set(wanted), dict[int, int]()
        for number in range(max(wanted), -1, -1):
            for part in nodes[number][2] if number in needed else ():
                needed.add(part)
                last.setdefault(part, number)
        for number in sorted(needed):
            self.task.check_time()
            values[number] = self.node(nodes[number], [values[part] for part in nodes[number][2]])
            for part in set(nodes[number][2]) - wanted:
                if last[part] == number:
                    del values[part]  # its last use: memory stays small
        return [values[root] for root in roots]

    def node(self, node: Node, values: list[Series]) -> Series:
        match node[0]:
            case "number":
                return self.constant(self.arithmetic.number(node[1]))
            case "name":
                return self.variable(node[1])
            case "sum":
                return self.add(values)
            case "power":
                return self.power(values[0], self.task.table.exponent(node), values[1])
            case "elementary":
                return self.elementary(node[1], values[0])
            case "function":
                jet = self.jet(node[1][0], [one[0].get(0, 0) for one in values])
                return self.horner(jet, node[1][1], [], [[{}, *one[1:]] for one in values])
        result, *rest = values
        for series in rest:
            result = self.multiply(result, series)
        return result

    def variable(self, name: str) -> Series:
        series = self.constant(self.values[name])
        if name in self.task.variables and self.degree:
            series[1] = {self.units[self.task.variables.index(name)]: self.arithmetic.one}
        return series

    def jet(self, name: str, arguments: list[int]) -> Jet:
        """The derivatives drawn so far; equal arguments have the same."""
        near = 0 if self.arithmetic.prime else self.arithmetic.cut
        for known, values, jet in self.jets:
            if known == name and all(abs(a - b) <= near for a, b in zip(values, arguments, strict=True)):
                return jet
        self.jets.append((name, arguments, {}))
        return self.jets[-1][2]

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

    def __init__(self, arithmetic: Arithmetic, shift: int) -> None:
        self.arithmetic, self.shift = arithmetic, shift
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
            factor = self.arithmetic.reduce(raw.pop(self.pivots[number], 0))
            if not factor or self.arithmetic.vanishes(factor, self.arithmetic.one):
                continue
            self.arithmetic.task.check_time()
            for key, value in self.rows[number].items():
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


def regular(matrix: list[list[int]], arithmetic: Arithmetic) -> bool:
    elimination, scale = Elimination(arithmetic, 64), max(abs(entry) for row in matrix for entry in row)
    for row in matrix if scale else ():
        elimination.insert(arithmetic.row({j: value << arithmetic.bits for j, value in enumerate(row)}, scale))
    return len(elimination.rows) == len(matrix)


def flat(series: Series) -> Component:
    return {key: value for component in series for key, value in component.items()}


class Prolongation(Expansion):
    """The Helmholtz conditions (times two) on the Taylor coefficients of L at a point."""

    def __init__(self, arithmetic: Arithmetic, values: dict[str, int], degree: int) -> None:
        super().__init__(arithmetic, values, degree)
        self.forces = self.series(self.task.system.forces)
        speeds = [self.variable(name + "'") for name in self.task.system.coordinates]
        self.field = [self.constant(arithmetic.one)] * self.task.timed + speeds + self.forces
        self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]
        self.scale = max(arithmetic.one, *(abs(value) for force in self.forces for value in flat(force).values()), 0)
        self.curvature: dict[tuple[int, int], Component] = {}
        self.divisors: dict[int, list[int]] = {}

    def phi(self, k: int, j: int) -> Component:
        """2 Phi^k_j = 2 Gamma(df^k/dv^j) - 4 df^k/dq^j - sum_l df^k/dv^l df^l/dv^j."""
        if (k, j) not in self.curvature:
            along = [self.multiply(rate, self.derivative(self.slopes[k][j], a)) for a, rate in enumerate(self.field)]
            squares = [self.multiply(self.slopes[k][m], self.slopes[m][j]) for m in range(self.n)]
            terms = [*along, self.derivative(self.forces[k], self.q[j]), *squares]
            self.curvature[k, j] = flat(self.add(terms, [2] * len(along) + [-4] + [-1] * self.n))
        return self.curvature[k, j]

    def below(self, key: int) -> list[int]:
        """All monomials that divide this one."""
        if key not in self.divisors:
            powers = [[unit * e for e in range(self.exponent(key, a) + 1)] for a, unit in enumerate(self.units)]
            self.divisors[key] = [sum(choice) for choice in product(*powers)]
        return self.divisors[key]

    def collect(self, row: Component, factor: Component, i: int, j: int, alpha: int, weight: int, a: int = -1) -> None:
        """row += weight times the coefficient alpha of factor * g_ij, or of factor * d_a g_ij."""
        i, j, exponent = self.v[i], self.v[j], self.exponent
        raised = self.units[i] + self.units[j] + (self.units[a] if a >= 0 else 0)
        for part in self.below(alpha):
            if value := factor.get(part):
                key = alpha - part + raised
                times = weight * exponent(key, i) * (exponent(key, j) - (i == j))
                times *= exponent(alpha - part, a) + 1 if a >= 0 else 1
                row[key] = row.get(key, 0) + ((value * times) << self.arithmetic.bits)

    def row(self, kind: str, i: int, j: int, alpha: int) -> Component:
        row: Component = {}
        for a, rate in enumerate(self.field if kind == "H2" else ()):
            self.collect(row, flat(rate), i, j, alpha, 2, a)
        for k in range(self.n):
            first, second = (self.phi(k, c) if kind == "H3" else flat(self.slopes[k][c]) for c in (j, i))
            self.collect(row, first, i, k, alpha, 1)
            self.collect(row, second, j, k, alpha, -1 if kind == "H3" else 1)
        return self.arithmetic.row(row, self.scale)

    def rows(self, degree: int) -> Iterator[Row]:
        """All rows whose unknowns have just this highest degree."""
        for i, j in combinations_with_replacement(range(self.n), 2):
            yield from (("H3", i, j, alpha) for alpha in self.monomials(degree) if i < j)
            yield from (("H2", i, j, alpha) for alpha in self.monomials(degree - 1))

    def value(self, terms: Component) -> list[list[int]]:
        """g(p) of a solution."""
        units = [self.units[v] for v in self.v]
        return [[terms.get(a + b, 0) * (2 if a == b else 1) for a in units] for b in units]

    def leaves_regular(self, elimination: Elimination) -> bool:
        """Whether g(p) may be regular: two random ones are tried."""
        found = [self.value(elimination.solution(self.unknowns(0))) for _ in range(2)]
        return any(regular(g, self.arithmetic) for g in found)


# The three kinds of certificates


Work = Callable[[Arithmetic, dict[str, int]], None]


@dataclass(frozen=True, slots=True)
class Task:
    """One question about one system, what its check works with, and the checks themselves."""

    generator: random.Random
    limit: float
    start: float = field(default_factory=time.monotonic)
    table: Table = field(default_factory=Table)
    system: System = System((), frozenset(), {})
    timed: bool = False
    near: Mapping[str, Fraction] = field(default_factory=dict)
    variables: list[str] = field(default_factory=list)

    def about(self, system: System, timed: bool, near: Mapping[str, Fraction]) -> Task:
        """The same tools for another question."""
        variables = ["t"] * timed + [*system.coordinates] + [name + "'" for name in system.coordinates]
        good = set(near) <= {"t", *variables, *system.parameters}
        require(good, "near holds a name that the system does not know.")
        return replace(self, system=system, timed=timed, near=near, variables=variables)

    def check_time(self) -> None:
        if not time.monotonic() - self.start < self.limit:
            raise Unsettled(f"The time limit of {self.limit:g} s ended the check.")

    def draw(self, arithmetic: Arithmetic, attempt: int) -> dict[str, int]:
        """Random values of all names; a real point lies near what the certificate names, else anywhere."""
        values = {"pi": arithmetic.draw() if arithmetic.prime else arithmetic.real("pi")}
        for name in ["t", *self.variables, *sorted(self.system.parameters)]:
            values[name] = arithmetic.draw()
            if not arithmetic.prime and name in self.near:
                values[name] = arithmetic.number(self.near[name]) + (values[name] >> (3, 6, 10, 1)[attempt % 4])
            elif not arithmetic.prime:
                values[name] = (abs(values[name]) if attempt % 2 else values[name]) * 3 // 2
        return values

    def at_point(self, arithmetic: Arithmetic, work: Work) -> None:
        """Do the work at a random point where the formulas are defined."""
        for attempt in range(60):
            try:
                return work(arithmetic, self.draw(arithmetic, attempt))
            except Undefined:
                self.check_time()
        raise Unsettled("No point was found at which every formula is defined.")

    def settle(self, roots: tuple[int, ...], work: Work, thorough: bool = False) -> None:
        """The work modulo two or three primes; or in real numbers, with more digits too if thorough or unsettled."""
        for _ in range(0 if self.table.uses("real", roots) else 2 + thorough):
            while not mpmath.libmp.isprime(prime := self.generator.randrange(1 << 60, 1 << 61)):
                pass
            self.at_point(Arithmetic(self, prime), work)
        for precision in PRECISIONS if self.table.uses("real", roots) else ():
            try:
                self.at_point(Arithmetic(self, 0, *precision), work)
            except Unsettled:
                if precision == PRECISIONS[-1]:
                    raise
            else:
                if not thorough:
                    return

    def lagrangian(self, document: Document) -> str:
        root = Reader(document.get("lagrangian"), self.table, self.system).formula()
        require(self.timed or not self.table.uses("t", [root]), "The Lagrangian contains t, but the question does not.")
        roots = (root, *self.system.forces)

        def work(arithmetic: Arithmetic, values: dict[str, int]) -> None:
            self.test_lagrangian(roots, Expansion(arithmetic, values, 2))

        self.settle(roots, work, thorough=True)
        return "The Euler-Lagrange equations of the Lagrangian hold and its Hessian is regular."

    def test_lagrangian(self, roots: tuple[int, ...], ring: Expansion) -> None:
        arithmetic, v, (lagrangian, *forces) = ring.arithmetic, ring.v, ring.series(roots)
        speeds = [ring.values[name + "'"] for name in self.system.coordinates]
        rates = [*speeds, *(force[0].get(0, 0) for force in forces)]

        def second(a: int, b: int) -> int:
            return lagrangian[2].get(ring.units[a] + ring.units[b], 0) * (2 if a == b else 1)

        for i, name in enumerate(self.system.coordinates):
            terms = [arithmetic.reduce(second(v[i], a) * rate) for a, rate in zip((*ring.q, *v), rates, strict=True)]
            terms += [second(v[i], 0)] * self.timed + [-lagrangian[1].get(ring.units[ring.q[i]], 0)]
            zero = arithmetic.vanishes(sum(terms), max(arithmetic.one >> 60, *map(abs, terms)))
            require(zero, f"The Euler-Lagrange equation of {name} does not hold.")
        hessian = [[second(a, b) for b in v] for a in v]
        require(regular(hessian, arithmetic), "The Hessian of the Lagrangian is singular.")

    def multi_index(self, document: Document, most: int) -> int:
        m, exponents = len(self.variables), [item.whole(0, most) for item in document.items(len(self.variables))]
        good = len(exponents) == m and sum(exponents) <= most
        require(good, f"A multi-index needs {m} exponents of total <= {most}.")
        return sum(exponent << 8 * a for a, exponent in enumerate([*exponents, sum(exponents)]))

    def row(self, document: Document, order: int) -> Row:
        parts, n = document.items(4), len(self.system.coordinates)
        require(len(parts) == 4, "A row has four parts: kind, i, j, multi-index.")
        kind, i, j = parts[0].choice("H2", "H3"), parts[1].whole(0, n - 1), parts[2].whole(0, n - 1)
        require(i < j or (kind == "H2" and i == j), "A row of H2 needs i <= j, a row of H3 i < j.")
        return kind, i, j, self.multi_index(parts[3], order - (kind == "H2"))

    def nonexistence(self, document: Document) -> str:
        order, shift = document.get("order").whole(0, MAX_ORDER), 8 * len(self.variables)
        rows = [self.row(item, order) for item in document.get("rows").items(MAX_ROWS)]
        require(len(set(rows)) == len(rows), "A row is named twice.")
        rows.sort(key=lambda row: ((row[3] >> shift) + (row[0] == "H2"), row))  # low degrees first fill in least
        degree = max(((row[3] >> shift) + (2 if row[0] == "H3" else 1) for row in rows), default=0)

        def work(arithmetic: Arithmetic, values: dict[str, int]) -> None:
            prolongation, elimination = Prolongation(arithmetic, values, degree), Elimination(arithmetic, shift)
            for row in rows:
                elimination.insert(prolongation.row(*row))
            require(not prolongation.leaves_regular(elimination), "The rows leave a regular multiplier g(p).")

        self.settle(self.system.forces, work)
        return f"{len(rows)} rows leave no regular multiplier g(p)."

    def existence(self, document: Document) -> str:
        order, symbol = document.get("order").whole(1, MAX_ORDER), document.get("symbol")
        degree = document.get("degree").whole(1, order)
        claimed = [item.whole(0, 10**9) for item in document.get("dimensions").items(degree + 1)]
        numbers = [symbol.get(name) for name in ("dimension", "prolonged")]
        numbers += symbol.get("characters").items(len(self.variables))
        claimed_symbol = [number.whole(0, 10**9) for number in numbers]

        def work(arithmetic: Arithmetic, values: dict[str, int]) -> None:
            prolongation, found = Prolongation(arithmetic, values, order + 3), list[list[int]]()
            elimination, widths = Elimination(arithmetic, prolongation.shift), [0]
            for step in range(order + 2):
                for row in prolongation.rows(step):
                    elimination.insert(prolongation.row(*row))
                widths.append(widths[-1] + len(prolongation.unknowns(step)))
                found.append([width - elimination.rank(k) for k, width in enumerate(widths[1 : degree + 2])])
            require(found[order] == claimed, "The dimensions are not those of the system.")
            require(found[order] == found[order + 1], "The dimension of the projection still falls at the next order.")
            require(prolongation.leaves_regular(elimination), "No multiplier g(p) that is left is regular.")
            test_symbol(elimination, prolongation, degree, claimed_symbol)

        self.settle(self.system.forces, work)
        found = "The projected system is involutive and leaves a regular multiplier g(p)."
        return found if document.get("series").value is None else found + self.series(document.get("series"))

    def series(self, series: Document) -> str:
        """The rows of the order that it claims vanish on the given coefficients, and g(p) is regular."""
        if self.table.uses("function", self.system.forces):
            return " The series was not compared: functions are arbitrary."
        order, prime = series.get("order").whole(0, MAX_ORDER), series.get("prime", 0).whole(0, 1 << 127)
        good = prime >> 30 and mpmath.libmp.isprime(prime) and not self.table.uses("real", self.system.forces)
        require(good or not prime, "series.prime has to be null, or, if f is rational, a prime above 2^30.")
        arithmetic = Arithmetic(self, prime) if prime else Arithmetic(self, 0, 480, 80, 79)
        given, terms = series.get("point"), [item.items(2) for item in series.get("terms").items(MAX_ROWS)]
        try:
            values = {name: arithmetic.number(given.get(name).number()) for name in list(given.keys())}
            values = {"pi": 0 if prime else arithmetic.real("pi"), **values}
            require({*self.variables, *self.system.parameters} <= set(values), "series.point lacks a value.")
            require(all(len(term) == 2 for term in terms), "A term of the series is a multi-index and a value.")
            known = {self.multi_index(a, order + 2): arithmetic.number(b.number()) for a, b in terms}
            test_series(Prolongation(arithmetic, values, order + 2), order, known)
        except Undefined:
            raise Refused("The series stands at a point where f is not defined.") from None
        return " The series solves the rows."


def test_series(prolongation: Prolongation, order: int, terms: Component) -> None:
    arithmetic = prolongation.arithmetic
    for name in (name for degree in range(order + 1) for name in prolongation.rows(degree)):
        products = [arithmetic.reduce(value * terms.get(key, 0)) for key, value in prolongation.row(*name).items()]
        zero = arithmetic.vanishes(sum(products), max(1, 1, *map(abs, products)))
        require(zero, "The series does not solve the rows.")
    require(regular(prolongation.value(terms), arithmetic), "The series has a singular g(p).")


def test_symbol(system: Elimination, ring: Expansion, degree: int, claimed: list[int]) -> None:
    """Cartan's test: dim of the prolongation = sum_k dim of what k random derivatives kill."""
    arithmetic, bits = system.arithmetic, system.arithmetic.bits
    above, killed = Elimination(arithmetic, ring.shift), Elimination(arithmetic, ring.shift)
    for pivot, row in zip(system.pivots, system.rows, strict=True):
        if pivot >> ring.shift == degree + 2:
            top = {key: value for key, value in row.items() if key >> ring.shift == degree + 2}
            top[pivot] = arithmetic.one
            killed.insert(top)
            for a, unit in enumerate(ring.units):
                raised = {key + unit: (value * (ring.exponent(key, a) + 1)) << bits for key, value in top.items()}
                above.insert(arithmetic.row(raised, arithmetic.one))
    left = [len(ring.unknowns(degree)) - len(killed.rows)]
    for _ in ring.units:
        direction = [(a, unit, arithmetic.draw()) for a, unit in enumerate(ring.units)]
        for key in ring.unknowns(degree - 1) if left[-1] else ():
            row = {key + unit: (u * (ring.exponent(key, a) + 1)) << bits for a, unit, u in direction}
            killed.insert(arithmetic.row(row, arithmetic.one))
        left.append(len(ring.unknowns(degree)) - len(killed.rows))
    prolonged = len(ring.unknowns(degree + 1)) - len(above.rows)
    found = [left[0], prolonged, *(before - after for before, after in pairwise(left))]
    padded = claimed + [0] * (len(found) - len(claimed))
    require(padded == found, "The dimensions of the symbol are not those of the system.")
    require(prolonged == sum(left[:-1]), "The symbol is not involutive.")


# Documents


def judged(work: Callable[[Task], list[str]], time_limit: float, seed: int | None) -> CheckResult:
    task = Task(random.SystemRandom() if seed is None else random.Random(seed), time_limit)
    try:
        return CheckResult("valid", tuple(work(task)))
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except Unsettled as problem:
        return CheckResult("incomplete", (str(problem),))
    except (RecursionError, MemoryError):
        return CheckResult("incomplete", ("The document is beyond the memory of the checker.",))


def check_certificate(certificate: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a certificate by itself; never raises. `seed` makes the checker's choices repeatable."""
    return judged(lambda task: [certified(Document(certificate, "certificate"), task)], time_limit, seed)


def check_result(result: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a result document, its certificates and their agreement with it; never raises."""
    return judged(lambda task: compared(Document(result, "result"), task), time_limit, seed)


def check_text(text: str, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on the JSON text of a result or of a certificate; never raises."""

    def members(pairs: list[tuple[str, object]]) -> dict[str, object]:
        require(len(dict(pairs)) == len(pairs), "A key stands twice in one object.")
        return dict(pairs)

    def constant(name: str) -> None:
        raise Refused(f"{name} is not a number in JSON.")

    try:
        document = json.loads(text, object_pairs_hook=members, parse_constant=constant)
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except (ValueError, TypeError, RecursionError):
        return CheckResult("invalid", ("The text is no JSON document, or is nested too deeply.",))
    kind = document.get("format") if isinstance(document, dict) else None
    return (check_certificate if kind == FORMAT else check_result)(document, time_limit, seed)


def certified(document: Document, task: Task) -> str:
    """Check a certificate; the sentence that says what was found."""
    document.get("format").choice(FORMAT)
    timed = document.get("question").choice("autonomous", "time_dependent") == "time_dependent"
    kind = document.get("kind").choice("lagrangian", "existence", "nonexistence")
    document.get("claim").choice("not_variational" if kind == "nonexistence" else "variational")
    system, near = read_system(document.get("system"), task.table), document.get("near", {})
    require(timed or not task.table.uses("t", system.forces), "f contains t: the question has to be time_dependent.")
    asked = task.about(system, timed, {name: near.get(name).number() for name in list(near.keys())})
    checks = {"lagrangian": asked.lagrangian, "existence": asked.existence, "nonexistence": asked.nonexistence}
    return checks[kind](document)


def compared(result: Document, task: Task) -> list[str]:
    """Check a result: first that its parts agree, then its certificates."""
    result.get("format").choice(RESULT_FORMAT)
    verdicts, other = ("variational", "not_variational", "undetermined"), result.get("with_time")
    system = read_system(result.get("system"), task.table)
    asked = result.get("question", "").choice("L(q, q')", "L(t, q, q')", "")
    timed = asked == "L(t, q, q')" or (not asked and task.table.uses("t", system.forces))
    verdict, later = result.get("verdict").choice(*verdicts), result.get("verdict_with_time", "").choice(*verdicts, "")
    require(not timed or later in ("", verdict), "verdict and verdict_with_time answer one question differently.")
    require((verdict, later) != ("variational", "not_variational"), "An L(q, q') is an L(t, q, q') too.")
    certificates = [agreed(result, verdict, "time_dependent" if timed else "autonomous", system, task.table)]
    if other.value is not None:
        require(other.get("verdict", later).value == later, "with_time.verdict is not verdict_with_time.")
        certificates.append(agreed(other, later, "time_dependent", system, task.table))
    found = [certified(one, task) for one in certificates if one]
    proven = not later or any(one and proves(one, "time_dependent", later) for one in certificates)
    if not proven or None in certificates or "undetermined" in (verdict, later):
        raise Unsettled("A verdict is undetermined, or no certificate proves it.")
    return [*found, *compare_given(result.get("system").get("given"), task.about(system, True, {}))]


def proves(certificate: Document, question: str, verdict: str) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate.get("claim").value == verdict and certificate.get("question").value in (question, wider)


def agreed(answer: Document, verdict: str, question: str, system: System, table: Table) -> Document | None:
    """The certificate of an answer, if it has one, once it is seen to speak of the same things."""
    certificate, shown = answer.get("certificate"), answer.get("lagrangian")
    if certificate.value is None:
        return None
    require(proves(certificate, question, verdict), f"{certificate.where} does not claim the verdict.")
    require(read_system(certificate.get("system"), table) == system, f"{certificate.where} is about another system.")
    if certificate.get("kind").value != "lagrangian":
        require(shown.value is None, f"{shown.where} is not certified.")
        return certificate
    numbers = {Reader(text, table, system).formula() for text in (shown.get("text"), certificate.get("lagrangian"))}
    require(len(numbers) == 1, f"{shown.where} is not the certified one.")
    return certificate


def compare_given(given: Document, task: Task) -> list[str]:
    """Whether the equations as given, where readable, are the canonical ones; the sentence that says so."""
    if given.value is None:
        return []
    try:
        equations, values = given.get("equations", given.value), given.get("parameters", {})
        names = values.keys() if isinstance(values.value, Mapping) else []
        nodes = {name: task.table.add("number", values.get(name).number()) for name in names}
        forces = [Reader(equations.get(q), task.table, task.system, **nodes).formula() for q in task.system.coordinates]
    except Refused as problem:
        return [f"The equations as given were not compared: {problem}"]
    roots = (*forces, *task.system.forces)

    def work(arithmetic: Arithmetic, values: dict[str, int]) -> None:
        numbers = [series[0].get(0, 0) for series in Expansion(arithmetic, values, 0).series(roots)]
        for a, b in zip(numbers, numbers[len(forces) :], strict=False):
            same = arithmetic.vanishes(a - b, max(arithmetic.one, abs(a), abs(b)))
            require(same, "The canonical equations are not those given.")

    task.settle(roots, work)
    return ["The equations as given are the canonical ones."]
