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

import mpmath  # type: ignore[import-untyped]

FORMAT, RESULT_FORMAT = "inverse-service/certificate/1", "inverse-service/result/1"
MAX_TEXT, MAX_DEPTH, MAX_DIGITS, MAX_EXPONENT = 60_000, 64, 400, 10**6
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

Component = dict[int, int]  # coefficients of monomials, packed as in Monomials
Series = list[Component]  # one component for each total degree


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The checker's verdict, and sentences that give its reasons."""

    verdict: Literal["valid", "incomplete", "invalid"]
    reasons: tuple[str, ...] = ()


class Refused(Exception):
    """The document is malformed or its claim was found wrong."""


class Unsettled(Exception):
    """Nothing can be said."""


class Doubtful(Unsettled):
    """A number lies in the gap between zero and nonzero."""


class Undefined(Exception):
    """A formula is not defined, or nearly not, at the point in hand."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Ends the check when its time is over."""

    limit: float
    start: float = field(default_factory=time.monotonic)

    def check(self) -> None:
        if not time.monotonic() - self.start < self.limit:
            raise Unsettled(f"The time limit of {self.limit:g} s ended the check.")


# Documents


def require(condition: bool, sentence: str) -> None:
    if not condition:
        raise Refused(sentence)


def mapping(value: object, where: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise Refused(f"{where} has to be an object.")
    return value


def items(value: object, where: str, most: int) -> list[object]:
    if not isinstance(value, list | tuple) or len(value) > most:
        raise Refused(f"{where} has to be a list of at most {most} items.")
    return list(value)


def names(value: object, where: str, most: int) -> tuple[str, ...]:
    found = items(value, where, most)
    words = tuple(word for word in found if isinstance(word, str) and NAME.match(word))
    require(len(words) == len(found), f"{where} has to consist of names made of letters, digits and _.")
    return words


def whole(value: object, where: str, low: int, high: int) -> int:
    if type(value) is not int or not low <= value <= high:
        raise Refused(f"{where} has to be a whole number from {low} to {high}.")
    return value


def choice(value: object, where: str, *allowed: str | None) -> str | None:
    if not (value is None or isinstance(value, str)) or value not in allowed:
        raise Refused(f"{where} has to be one of: {', '.join(map(str, allowed))}.")
    return value


def exact(value: object, where: str) -> Fraction:
    """An integer, or the text of an integer, a decimal or a quotient."""
    text = str(value) if type(value) is int and value.bit_length() < 1300 else value
    if not isinstance(text, str) or not VALUE.match(text):
        raise Refused(f"{where} has to be an integer or the text of a number such as -1.25 or 3/4.")
    return Fraction(text)


# Formulas


@dataclass(slots=True)
class Table:
    """All formulas of one check: equal nodes (kind, content …) share one number, parts come before wholes."""

    nodes: list[tuple[Any, ...]] = field(default_factory=list)
    known: dict[tuple[Any, ...], int] = field(default_factory=dict)
    constants: dict[int, Fraction] = field(default_factory=dict)

    def add(self, *node: Any) -> int:
        """The number of a node; a sum or product of one part is that part."""
        if node[0] in ("sum", "product") and len(node[1]) == 1:
            return int(node[1][0])
        if node not in self.known:
            self.known[node] = len(self.nodes)
            self.nodes.append(node)
            value = self.constant(node)
            if value is not None and value.numerator.bit_length() + value.denominator.bit_length() < 4000:
                self.constants[len(self.nodes) - 1] = value
        return self.known[node]

    def constant(self, node: tuple[Any, ...]) -> Fraction | None:
        """The value of a node made of few rational constants; only exponents need it."""
        parts = self.parts(node)
        values = [self.constants[part] for part in parts if part in self.constants]
        if node[0] == "number":
            return Fraction(node[1])
        if node[0] not in ("sum", "product", "power") or len(values) < len(parts) or len(parts) > 100:
            return None
        if node[0] == "power":
            small = values[1].denominator == 1 and abs(values[1]) <= 64 and (values[0] != 0 or values[1] > 0)
            return Fraction(values[0] ** int(values[1])) if small else None
        return sum(values, Fraction(0)) if node[0] == "sum" else math.prod(values, start=Fraction(1))

    @staticmethod
    def parts(node: tuple[Any, ...]) -> tuple[int, ...]:
        if node[0] == "power":
            return node[1:]
        return node[-1] if node[0] in ("sum", "product", "elementary", "function") else ()

    def below(self, roots: Iterable[int]) -> list[int]:
        """All nodes of the formulas, parts first."""
        stack, seen = list(roots), set()
        while stack:
            number = stack.pop()
            if number not in seen:
                seen.add(number)
                stack.extend(self.parts(self.nodes[number]))
        return sorted(seen)

    def has_time(self, roots: Iterable[int]) -> bool:
        return any(self.nodes[number] == ("symbol", "t") for number in self.below(roots))

    def rational(self, roots: Iterable[int]) -> bool:
        """Whether the formulas are rational in all names and arbitrary functions."""
        nodes = [self.nodes[number] for number in self.below(roots)]
        return not any(node[0] == "elementary" or (
            node[0] == "power" and self.constants.get(node[2], Fraction(1, 2)).denominator > 1) for node in nodes)


@dataclass(frozen=True, slots=True)
class System:
    """q'' = f as read; `forces` are numbers of nodes in the table."""

    coordinates: tuple[str, ...]
    parameters: frozenset[str]
    functions: Mapping[str, tuple[str, ...]]
    forces: tuple[int, ...] = ()


class Reader:
    """A recursive descent reader of one formula; names in `bound` stand for nodes of the table."""

    def __init__(self, text: object, table: Table, system: System, where: str, **bound: int) -> None:
        if not isinstance(text, str) or len(text) > MAX_TEXT:
            raise Refused(f"{where} has to be a formula of at most {MAX_TEXT} characters.")
        self.table, self.system, self.where, self.bound = table, system, where, bound
        self.tokens, self.position, self.depth, at, text = list[str](), 0, 0, 0, text.rstrip(" \t\r\n")
        while at < len(text):
            match = TOKEN.match(text, at)
            if not match or (match[1][0].isdigit() and len(match[1]) > MAX_DIGITS):
                raise Refused(f"{where}: what stands at column {at + 1} is no part of a formula.")
            self.tokens.append(match[1])
            at = match.end()

    def formula(self) -> int:
        number = self.sum()
        require(self.position == len(self.tokens), f"{self.where}: an operator is expected at token {self.position + 1}.")
        return number

    def take(self, operators: str) -> str:
        """The next token if it is one of the operators, else nothing."""
        here = self.tokens[self.position] if self.position < len(self.tokens) else ""
        self.position += bool(here) and here in operators
        return here if here in operators else ""

    def close(self) -> None:
        require(bool(self.take(")")), f"{self.where}: ')' is expected at token {self.position + 1}.")

    def chain(self, kind: str, part: Callable[[], int], operators: str, turn: Callable[[int], int]) -> int:
        """part op part …; `turn` is applied behind the second operator."""
        self.depth += 1
        require(self.depth <= 2 * MAX_DEPTH, f"{self.where} is nested more than {MAX_DEPTH} levels deep.")
        parts = [part()]
        while operator := self.take(operators):
            parts.append(part() if operator == operators[0] else turn(part()))
        self.depth -= 1
        return self.table.add(kind, tuple(parts))

    def sum(self) -> int:
        return self.chain("sum", self.product, "+-", self.negative)

    def product(self) -> int:
        return self.chain("product", self.signed, "*/", self.reciprocal)

    def negative(self, number: int) -> int:
        return self.table.add("product", (self.table.add("number", Fraction(-1)), number))

    def reciprocal(self, number: int) -> int:
        return self.table.add("power", number, self.table.add("number", Fraction(-1)))

    def signed(self) -> int:
        negative = False
        while self.take("-"):
            negative = not negative
        number = self.atom()
        if self.take("^"):
            number = self.table.add("power", number, self.chain("product", self.signed, "^", self.negative))  # one part
        return self.negative(number) if negative else number

    def atom(self) -> int:
        if self.take("("):
            number = self.sum()
            self.close()
            return number
        token = self.tokens[self.position] if self.position < len(self.tokens) else ")"
        require(token[0].isalnum(), f"{self.where}: a number, a name or '(' is expected at token {self.position + 1}.")
        self.position += 1
        if token[0].isdigit():
            return self.table.add("number", Fraction(token))
        name = token.rstrip("'")
        return self.call(name, len(token) - len(name)) if self.take("(") else self.name(name, len(token) - len(name))

    def name(self, name: str, primes: int) -> int:
        if name in self.bound and not primes:
            return self.bound[name]
        if name in self.system.coordinates and primes <= 1:
            return self.table.add("velocity" if primes else "symbol", name)
        known = not primes and (name in ("t", "pi") or name in self.system.parameters)
        require(known, f"{self.where}: the name {name[:40]} (with {primes} primes) is not known.")
        return self.table.add("symbol", name)

    def call(self, name: str, primes: int) -> int:
        parts = [self.sum()]
        while self.take(","):
            parts.append(self.sum())
        self.close()
        if name == "diff" and not primes:
            return self.derivative(parts)
        declared = len(self.system.functions.get(name, ()))
        allowed = declared == len(parts) if declared else name in RESERVED and len(parts) == 1
        require(allowed and primes <= (MAX_ORDER if declared == 1 else 0),
                f"{self.where}: {name[:40]} (with {primes} primes) is not known as a function of {len(parts)} arguments.")
        if declared:
            return self.table.add("function", name, (primes,) + (0,) * (declared - 1), tuple(parts))
        if name in PRIMITIVE:
            return self.table.add("elementary", name, tuple(parts))
        require(name in DEFINED, f"{self.where}: {name} is not a function.")
        return Reader(DEFINED[name], self.table, self.system, self.where, u=parts[0]).formula()

    def derivative(self, parts: list[int]) -> int:
        """diff(A(x, y), x, …), by arguments that are names."""
        node, sentence = self.table.nodes[parts[0]], "diff takes a declared function and some of its distinct arguments."
        require(node[0] == "function", f"{self.where}: {sentence}")
        _, name, orders, arguments = node
        for part in parts[1:]:
            fits = arguments.count(part) == 1 and self.table.nodes[part][0] == "symbol" and sum(orders) < MAX_ORDER
            require(fits, f"{self.where}: {sentence}")
            orders = tuple(order + (argument == part) for order, argument in zip(orders, arguments, strict=True))
        return self.table.add("function", name, orders, arguments)


def read_system(value: object, table: Table, where: str) -> System:
    document = mapping(value, where)
    coordinates = names(document.get("coordinates"), f"{where}.coordinates", MAX_COORDINATES)
    parameters = names(document.get("parameters", ()), f"{where}.parameters", MAX_NAMES)
    declared = mapping(document.get("functions", {}), f"{where}.functions")
    functions = {name: names(declared[name], f"{where}.functions", 6) for name in declared}
    everything = [*coordinates, *parameters, *names(list(declared), f"{where}.functions", MAX_NAMES)]
    require(len(coordinates) > 0 and all(functions.values()), f"{where} needs coordinates, and arguments of functions.")
    require(len(set(everything)) == len(everything) and not RESERVED & set(everything),
            f"{where} declares a name twice, or one that has a meaning of its own.")
    equations = mapping(document.get("equations"), f"{where}.equations")
    require(set(equations) == set(coordinates), f"{where}.equations has to hold one formula for each coordinate.")
    system = System(coordinates, frozenset(parameters), functions)
    forces = [Reader(equations[name], table, system, f"{where}.equations.{name}").formula() for name in coordinates]
    return replace(system, forces=tuple(forces))


# Numbers


class Arithmetic:
    """Residues modulo `prime`, or (prime 0) reals as integers scaled by `one` = 2^bits."""

    def __init__(self, generator: random.Random, prime: int = 0, bits: int = 0, cut: int = 0, gap: int = 0) -> None:
        self.generator, self.prime, self.bits, self.one = generator, prime, bits, 1 << bits
        self.cut, self.gap, self.noise = self.one >> cut, self.one >> gap, 1 << bits // 4
        self.context = mpmath.mp.clone()
        self.context.prec = bits + 64

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
        if scale:
            largest = max(map(abs, row.values()))
            if self.vanishes(largest, scale):
                return {}
            row = {key: (value << self.bits) // largest for key, value in row.items()}
        return {key: value for key, value in row.items() if not self.vanishes(value, self.one)}

    def vanishes(self, value: int, scale: int) -> bool:
        """Whether the number is zero; reals: beside numbers of the size of `scale`."""
        if self.prime:
            return value % self.prime == 0
        if abs(value) << self.bits <= self.cut * scale:
            return True
        if abs(value) << self.bits < self.gap * scale:
            raise Doubtful("A number is too close to zero to judge.")
        return False

    def same(self, left: int, right: int) -> bool:
        return abs(left - right) <= (0 if self.prime else self.cut)

    def number(self, value: Fraction) -> int:
        if self.prime:
            return value.numerator * self.inverse(value.denominator) % self.prime
        return (value.numerator << self.bits) // value.denominator

    def inverse(self, value: int) -> int:
        if abs(value) << 30 < self.one or (self.prime and value % self.prime == 0):
            raise Undefined
        return pow(value, -1, self.prime) if self.prime else (self.one << self.bits) // value

    def power(self, base: int, exponent: Fraction) -> int:
        if self.prime:
            return pow(base, int(exponent), self.prime)
        if base <= 0 and exponent.denominator > 1:
            raise Undefined
        value = self.context.mpf(exponent.numerator) / exponent.denominator
        return self.real(lambda context: context.power(context.ldexp(base, -self.bits), value))

    def elementary(self, name: str, argument: int) -> int:
        if self.prime or abs(argument) >> 10 > self.one:
            raise Undefined
        return self.real(lambda context: getattr(context, name)(context.ldexp(argument, -self.bits)))

    def real(self, compute: Callable[[Any], Any]) -> int:
        """A value of mpmath as a scaled integer, if it is real and of moderate size."""
        try:
            value = compute(self.context)
        except (ValueError, ArithmeticError) as error:
            raise Undefined from error
        if not isinstance(value, self.context.mpf) or not abs(value) < 1 << 64:
            raise Undefined
        return int(self.context.ldexp(value, self.bits))


def random_prime(generator: random.Random) -> int:
    while not mpmath.libmp.isprime(candidate := generator.randrange(1 << 60, 1 << 61)):
        pass
    return candidate


# Power series


class Monomials:
    """Exponents of the variables t (if any), q_1 … q_n, v_1 … v_n packed into an integer, the degree on top."""

    def __init__(self, variables: int, coordinates: int) -> None:
        self.variables, self.coordinates, self.shift = variables, coordinates, 8 * variables
        self.units = [(1 << 8 * a) | (1 << self.shift) for a in range(variables)]
        self.q, self.v = range(variables - 2 * coordinates, variables - coordinates), range(variables - coordinates, variables)
        self.divisors: dict[int, list[int]] = {}

    def exponent(self, key: int, variable: int) -> int:
        return (key >> 8 * variable) & 255

    def of_degree(self, degree: int) -> Iterator[int]:
        return (sum(units) for units in combinations_with_replacement(self.units, degree)) if degree >= 0 else iter(())

    def columns(self, degree: int) -> list[int]:
        """The unknowns of a degree: total degree two more, v-degree at least two."""
        return [key for key in self.of_degree(degree + 2) if sum(self.exponent(key, v) for v in self.v) >= 2]

    def below(self, key: int) -> list[int]:
        """All monomials that divide this one."""
        if key not in self.divisors:
            powers = [[unit * power for power in range(self.exponent(key, a) + 1)] for a, unit in enumerate(self.units)]
            self.divisors[key] = [sum(choice) for choice in product(*powers)]
        return self.divisors[key]

    def hessian(self, key: int, i: int, j: int) -> int:
        """The factor of the coefficient `key` of L in d^2 L/dv_i dv_j."""
        return self.exponent(key, self.v[i]) * (self.exponent(key, self.v[j]) - (i == j))


class Ring:
    """Power series in the displacements, truncated at a total degree."""

    def __init__(self, arithmetic: Arithmetic, monomials: Monomials, degree: int, clock: Clock) -> None:
        self.arithmetic, self.monomials, self.degree, self.clock = arithmetic, monomials, degree, clock
        if math.comb(monomials.variables + degree, degree) > MAX_MONOMIALS:
            raise Unsettled(f"Series of more than {MAX_MONOMIALS} terms would be needed.")

    def constant(self, value: int) -> Series:
        return [{0: value} if value else {}, *({} for _ in range(self.degree))]

    def add(self, *terms: Series, weights: Iterable[int] = ()) -> Series:
        """The sum of the series, each times a small integer."""
        total: Series = [{} for _ in range(self.degree + 1)]
        for term, weight in zip(terms, weights or [1] * len(terms), strict=True):
            for sums, component in zip(total, term, strict=True):
                for key, value in component.items():
                    sums[key] = sums.get(key, 0) + ((value * weight) << self.arithmetic.bits)
        return [self.arithmetic.settle(sums) for sums in total]

    def multiply(self, left: Series, right: Series) -> Series:
        return [self.convolve(left, right, degree, [1] * (degree + 1)) for degree in range(self.degree + 1)]

    def convolve(self, left: Series, right: Series, degree: int, weights: list[int], factor: int | None = None) -> Component:
        """factor * sum_j weights[j] left_j right_(degree - j)."""
        total: Component = {}
        for j, weight in enumerate(weights):
            terms = list(right[degree - j].items()) if weight else []
            for first, value in left[j].items() if terms else ():
                self.clock.check()
                for second, other in terms:
                    total[first + second] = total.get(first + second, 0) + value * weight * other
        settled = self.arithmetic.settle(total)
        return settled if factor is None else self.arithmetic.settle({k: value * factor for k, value in settled.items()})

    def derivative(self, series: Series, variable: int) -> Series:
        unit, exponent = self.monomials.units[variable], self.monomials.exponent
        lowered = [{key - unit: value * power for key, value in component.items() if (power := exponent(key, variable))}
                   for component in series[1:]]
        return self.add([*lowered, {}])

    def power(self, base: Series, exponent: Fraction) -> Series:
        """y = u^a, from u E(y) = a y E(u) with the Euler operator E: k u_0 y_k = sum_j (a j - k + j) u_j y_(k-j)."""
        top, bottom, start = exponent.numerator, exponent.denominator, base[0].get(0, 0)
        if abs(top) > MAX_EXPONENT or bottom > MAX_EXPONENT:
            raise Undefined
        if bottom == 1 and (0 <= top <= 8 or (top > 0 and not start)):
            result = self.constant(self.arithmetic.one if start or top <= self.degree else 0)
            for _ in range(top if start or top <= self.degree else 0):
                result = self.multiply(result, base)
            return result
        inverse, result = self.arithmetic.inverse(start), self.constant(self.arithmetic.power(start, exponent))
        for k in range(1, self.degree + 1):
            factor = self.arithmetic.reduce(inverse * self.arithmetic.number(Fraction(1, bottom * k)))
            result[k] = self.convolve(base, result, k, [top * j - bottom * (k - j) for j in range(k + 1)], factor)
        return result

    def integrate(self, argument: Series, slope: Series, result: Series, sign: int = 1) -> Iterator[None]:
        """y with E(y) = w E(u), degree by degree, so that w may depend on y: k y_k = sum_j j u_j w_(k-j)."""
        for k in range(1, self.degree + 1):
            factor = self.arithmetic.number(Fraction(sign, k))
            result[k] = self.convolve(argument, slope, k, list(range(k + 1)), factor)
            yield

    def elementary(self, name: str, u: Series) -> Series:
        start, one = u[0].get(0, 0), self.constant(self.arithmetic.one)
        result = self.constant(self.arithmetic.elementary(name, start))
        if name in ("sin", "cos"):
            partner = self.constant(self.arithmetic.elementary("cos" if name == "sin" else "sin", start))
            sign = 1 if name == "sin" else -1
            list(zip(self.integrate(u, partner, result, sign), self.integrate(u, result, partner, -sign), strict=True))
            return result
        inside = u if name == "log" else self.add(one, self.multiply(u, u)) if name == "atan" else None
        list(self.integrate(u, self.power(inside, Fraction(-1)) if inside else result, result))
        return result


@dataclass(frozen=True, slots=True)
class Point:
    """Values of all names, and of the derivatives of functions at the arguments met so far."""

    arithmetic: Arithmetic
    values: dict[str, int]
    jets: list[tuple[str, list[int], dict[tuple[int, ...], int]]] = field(default_factory=list)

    def jet(self, name: str, arguments: list[int]) -> dict[tuple[int, ...], int]:
        """The derivatives drawn so far; equal arguments have the same."""
        for known, values, jet in self.jets:
            if known == name and all(map(self.arithmetic.same, values, arguments)):
                return jet
        self.jets.append((name, arguments, {}))
        return self.jets[-1][2]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Taylor series of formulas about a point; `variables` get a displacement."""

    ring: Ring
    table: Table
    point: Point
    variables: list[str]
    values: dict[int, Series] = field(default_factory=dict)

    def series(self, roots: Iterable[int]) -> list[Series]:
        order, wanted = self.table.below(roots), list(roots)
        last = {part: number for number in order for part in self.table.parts(self.table.nodes[number])}
        for number in order:
            node = self.table.nodes[number]
            self.values[number] = self.node(*node)
            for part in set(self.table.parts(node)):
                if last[part] == number and part not in wanted:
                    del self.values[part]  # its last use: memory stays small
        return [self.values[root] for root in wanted]

    def node(self, kind: str, *content: Any) -> Series:
        ring = self.ring
        if kind == "number":
            return ring.constant(ring.arithmetic.number(content[0]))
        if kind in ("symbol", "velocity"):
            return self.variable(content[0] + "'" * (kind == "velocity"))
        if kind == "function":
            return self.function(*content)
        if kind == "power":
            return self.power(*content)
        if kind == "elementary":
            return ring.elementary(content[0], self.values[content[1][0]])
        result, *rest = (self.values[part] for part in content[0])
        if kind == "sum":
            return ring.add(result, *rest)
        for series in rest:
            result = ring.multiply(result, series)
        return result

    def variable(self, name: str) -> Series:
        series = self.ring.constant(self.point.values[name])
        if name in self.variables and self.ring.degree:
            series[1] = {self.ring.monomials.units[self.variables.index(name)]: self.ring.arithmetic.one}
        return series

    def power(self, base: int, exponent: int) -> Series:
        if exponent in self.table.constants:
            return self.ring.power(self.values[base], self.table.constants[exponent])
        logarithm = self.ring.elementary("log", self.values[base])
        return self.ring.elementary("exp", self.ring.multiply(self.values[exponent], logarithm))

    def function(self, name: str, orders: tuple[int, ...], arguments: tuple[int, ...]) -> Series:
        """sum over beta of A_(orders + beta) (u - u_0)^beta / beta! with random A_…, by Horner's rule."""
        series = [self.values[argument] for argument in arguments]
        jet = self.point.jet(name, [one[0].get(0, 0) for one in series])
        return self.horner(jet, orders, [], [[{}, *one[1:]] for one in series])

    def horner(self, jet: dict[tuple[int, ...], int], orders: tuple[int, ...], beta: list[int], rest: list[Series]) -> Series:
        ring = self.ring
        if not rest:
            place = tuple(map(sum, zip(beta, orders, strict=True)))
            factor = ring.arithmetic.number(Fraction(1, math.prod(map(math.factorial, beta))))
            return ring.constant(ring.arithmetic.reduce(jet.setdefault(place, ring.arithmetic.draw()) * factor))
        result = ring.constant(0)
        for power in range(ring.degree - sum(beta), -1, -1):
            result = ring.add(ring.multiply(result, rest[0]), self.horner(jet, orders, [*beta, power], rest[1:]))
        return result


# The linear system for a multiplier


class Elimination:
    """Rows in echelon form, columns (keys of monomials) in the order of falling degree."""

    def __init__(self, arithmetic: Arithmetic, shift: int, clock: Clock) -> None:
        self.arithmetic, self.shift, self.clock = arithmetic, shift, clock
        self.rows: list[Component] = []  # without their pivots, which are 1
        self.pivots: list[int] = []
        self.order: dict[int, int] = {}

    def insert(self, row: Component) -> None:
        """Reduce the row degree by degree until its part of the highest degree is new, then keep it."""
        while row:
            top = max(row) >> self.shift
            row = self.reduced(row, top)
            block = [key for key in row if key >> self.shift == top]
            if block:
                return self.keep(row, max(block, key=lambda key: key if self.arithmetic.prime else abs(row[key])))
        return None

    def keep(self, row: Component, pivot: int) -> None:
        inverse = self.arithmetic.inverse(row.pop(pivot))
        self.rows.append(self.arithmetic.settle({key: value * inverse for key, value in row.items()}))
        self.order[pivot] = len(self.pivots)
        self.pivots.append(pivot)

    def reduced(self, row: Component, top: int) -> Component:
        """Without the pivots of one degree; a kept row holds no pivot of its degree older than itself."""
        raw = {key: value << self.arithmetic.bits for key, value in row.items()}
        queue = [self.order[key] for key in raw if key in self.order and key >> self.shift == top]
        heapify(queue)
        while queue:
            number = heappop(queue)
            factor = self.arithmetic.row({0: raw.pop(self.pivots[number], 0)}).get(0)
            if factor:
                self.clock.check()
                for key, value in self.rows[number].items():
                    if key in raw:
                        raw[key] -= factor * value
                    else:
                        raw[key] = -factor * value
                        if key in self.order and key >> self.shift == top:
                            heappush(queue, self.order[key])
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
    """One certificate's question, and what its check works with."""

    table: Table
    system: System
    timed: bool
    near: Mapping[str, Fraction]
    generator: random.Random
    clock: Clock

    @property
    def variables(self) -> list[str]:
        q = self.system.coordinates
        return ["t"] * self.timed + [*q] + [name + "'" for name in q]

    def ring(self, point: Point, degree: int) -> Ring:
        return Ring(point.arithmetic, Monomials(len(self.variables), len(self.system.coordinates)), degree, self.clock)

    def series(self, point: Point, degree: int, roots: Iterable[int]) -> list[Series]:
        return Evaluation(self.ring(point, degree), self.table, point, self.variables).series(roots)

    def draw(self, arithmetic: Arithmetic, attempt: int) -> Point:
        """A random point; a real one lies near what the certificate names, or anywhere."""
        values = {}
        for name in {"t", *self.variables, *self.system.parameters}:
            values[name] = arithmetic.draw()
            if not arithmetic.prime and name in self.near:
                values[name] = arithmetic.number(self.near[name]) + (values[name] >> (3, 6, 10, 1)[attempt % 4])
            elif not arithmetic.prime:
                values[name] = (abs(values[name]) if attempt % 2 else values[name]) * 3 // 2
        pi = arithmetic.draw() if arithmetic.prime else arithmetic.real(lambda context: +context.pi)
        return Point(arithmetic, {**values, "pi": pi})

    def at_point(self, arithmetic: Arithmetic, roots: Iterable[int], work: Callable[[Point], None]) -> None:
        """Do the work at a random point where the formulas are defined."""
        for attempt in range(60):
            try:
                point = self.draw(arithmetic, attempt)
                self.series(point, 0, roots)
                return work(point)
            except Undefined:
                self.clock.check()
        raise Unsettled("No point was found at which every formula is defined.")

    def settle(self, roots: tuple[int, ...], work: Callable[[Point], None], thorough: bool = False) -> None:
        """The work modulo two or three primes, or in real arithmetic: precise, and more so if thorough or doubtful."""
        if self.table.rational(roots):
            for _ in range(2 + thorough):
                self.at_point(Arithmetic(self.generator, random_prime(self.generator)), roots, work)
            return
        coarse, fine = (Arithmetic(self.generator, 0, *precision) for precision in PRECISIONS)
        try:
            self.at_point(coarse, roots, work)
        except Doubtful:
            thorough = True
        if thorough:
            self.at_point(fine, roots, work)


Row = tuple[str, int, int, int]  # H2 or H3, i, j, packed alpha


class Prolongation:
    """The Helmholtz conditions (times two) on the Taylor coefficients of L at a point."""

    def __init__(self, task: Task, point: Point, degree: int) -> None:
        self.ring, self.arithmetic, self.n = task.ring(point, degree), point.arithmetic, len(task.system.coordinates)
        self.monomials, ring = self.ring.monomials, self.ring
        self.forces = task.series(point, degree, task.system.forces)
        velocities = Evaluation(ring, task.table, point, task.variables)
        speeds = [velocities.variable(name + "'") for name in task.system.coordinates]
        self.field = [ring.constant(self.arithmetic.one)] * task.timed + speeds + self.forces
        self.slopes = [[ring.derivative(force, v) for v in self.monomials.v] for force in self.forces]
        self.scale = max(self.arithmetic.one, *(abs(c) for f in self.forces for part in f for c in part.values()), 0)
        self.curvature: dict[tuple[int, int], Component] = {}

    def gamma(self, series: Series) -> list[Series]:
        """The terms of Gamma(series)."""
        return [self.ring.multiply(rate, self.ring.derivative(series, a)) for a, rate in enumerate(self.field)]

    def phi(self, k: int, j: int) -> Component:
        """2 Phi^k_j = 2 Gamma(df^k/dv^j) - 4 df^k/dq^j - sum_l df^k/dv^l df^l/dv^j."""
        if (k, j) not in self.curvature:
            ring, total = self.ring, self.gamma(self.slopes[k][j])
            squares = [ring.multiply(self.slopes[k][m], self.slopes[m][j]) for m in range(self.n)]
            weights = [2] * len(total) + [-4] + [-1] * self.n
            slope = ring.derivative(self.forces[k], self.monomials.q[j])
            self.curvature[k, j] = flat(ring.add(*total, slope, *squares, weights=weights))
        return self.curvature[k, j]

    def collect(self, row: Component, factor: Component, term: tuple[int, int], alpha: int, weight: int, a: int = -1) -> None:
        """row += weight times the coefficient alpha of factor * g_term, or of factor * d_a g_term."""
        i, k = term
        units, hessian = self.monomials.units, self.monomials.hessian
        shift = units[self.monomials.v[i]] + units[self.monomials.v[k]] + (units[a] if a >= 0 else 0)
        for part in self.monomials.below(alpha):
            if value := factor.get(part):
                key = alpha - part + shift
                times = weight * hessian(key, i, k) * (self.monomials.exponent(alpha - part, a) + 1 if a >= 0 else 1)
                row[key] = row.get(key, 0) + ((value * times) << self.arithmetic.bits)

    def row(self, kind: str, i: int, j: int, alpha: int) -> Component:
        row: Component = {}
        if kind == "H2":
            for a, rate in enumerate(self.field):
                self.collect(row, flat(rate), (i, j), alpha, 2, a)
        for k in range(self.n):
            first, second = (self.phi(k, j), self.phi(k, i)) if kind == "H3" else map(flat, (self.slopes[k][j], self.slopes[k][i]))
            self.collect(row, first, (i, k), alpha, 1)
            self.collect(row, second, (j, k), alpha, -1 if kind == "H3" else 1)
        return self.arithmetic.row(row, self.scale)

    def rows(self, degree: int) -> Iterator[Row]:
        """All rows whose unknowns have just this highest degree."""
        for i, j in combinations_with_replacement(range(self.n), 2):
            yield from (("H3", i, j, alpha) for alpha in self.monomials.of_degree(degree) if i < j)
            yield from (("H2", i, j, alpha) for alpha in self.monomials.of_degree(degree - 1))

    def leaves_regular(self, elimination: Elimination) -> bool:
        """Whether g(p) may be regular: two random ones are tried."""
        units = [self.monomials.units[v] for v in self.monomials.v]
        for _ in range(2):
            values = elimination.solution(self.monomials.columns(0))
            g = [[values[a + b] * (2 if a == b else 1) for a in units] for b in units]
            if regular(g, self.arithmetic, self.ring.clock):
                return True
        return False


def flat(series: Series) -> Component:
    return {key: value for component in series for key, value in component.items()}


# The three kinds of certificates


def check_lagrangian(task: Task, document: Mapping[str, object]) -> str:
    root = Reader(document.get("lagrangian"), task.table, task.system, "lagrangian").formula()
    require(task.timed or not task.table.has_time([root]), "The Lagrangian contains t, which the question excludes.")

    def work(point: Point) -> None:
        lagrangian, *forces = task.series(point, 2, (root, *task.system.forces))
        test_lagrangian(lagrangian, [force[0].get(0, 0) for force in forces], task, point)

    task.settle((root, *task.system.forces), work, thorough=True)
    return "The Euler-Lagrange equations of the Lagrangian hold and its Hessian is regular."


def test_lagrangian(lagrangian: Series, forces: list[int], task: Task, point: Point) -> None:
    ring, arithmetic = task.ring(point, 2), point.arithmetic
    units, q, v = ring.monomials.units, ring.monomials.q, ring.monomials.v

    def second(a: int, b: int) -> int:
        return lagrangian[2].get(units[a] + units[b], 0) * (2 if a == b else 1)

    for i, name in enumerate(task.system.coordinates):
        terms = [arithmetic.reduce(second(v[i], b) * force) for b, force in zip(v, forces, strict=True)]
        speeds = [point.values[other + "'"] for other in task.system.coordinates]
        terms += [arithmetic.reduce(second(v[i], b) * speed) for b, speed in zip(q, speeds, strict=True)]
        terms += [second(v[i], 0)] * task.timed + [-lagrangian[1].get(units[q[i]], 0)]
        require(arithmetic.vanishes(sum(terms), max(arithmetic.one >> 60, *map(abs, terms))),
                f"The Euler-Lagrange equation of {name} does not hold.")
    hessian = [[second(a, b) for b in v] for a in v]
    require(regular(hessian, arithmetic, task.clock), "The Hessian of the Lagrangian is singular.")


def multi_index(value: object, where: str, task: Task, most: int) -> int:
    exponents = items(value, where, len(task.variables))
    units = Monomials(len(task.variables), len(task.system.coordinates)).units
    require(len(exponents) == len(units), f"{where} has to hold {len(units)} exponents.")
    key = sum(whole(e, where, 0, most) * unit for e, unit in zip(exponents, units, strict=True))
    require(key >> 8 * len(units) <= most, f"{where} has a total of more than {most}.")
    return key


def read_rows(value: object, order: int, task: Task) -> list[Row]:
    rows, n = [], len(task.system.coordinates)
    for row in items(value, "rows", MAX_ROWS):
        task.clock.check()
        kind, first, second, alpha = [*items(row, "A row", 4), *[None] * 4][:4]
        name = choice(kind, "The kind of a row", "H2", "H3") or ""
        i, j = whole(first, "i of a row", 0, n - 1), whole(second, "j of a row", 0, n - 1)
        require(i < j or (name == "H2" and i == j), "A row of H2 needs i <= j, a row of H3 i < j.")
        rows.append((name, i, j, multi_index(alpha, "alpha of a row", task, order - (name == "H2"))))
    require(len(set(rows)) == len(rows), "A row is named twice.")
    shift = 8 * len(task.variables)
    return sorted(rows, key=lambda row: ((row[3] >> shift) + (row[0] == "H2"), row))


def check_nonexistence(task: Task, document: Mapping[str, object]) -> str:
    rows = read_rows(document.get("rows"), whole(document.get("order"), "order", 0, MAX_ORDER), task)
    shift = 8 * len(task.variables)
    degree = max((row[3] >> shift) + (2 if row[0] == "H3" else 1) for row in rows) if rows else 0

    def work(point: Point) -> None:
        prolongation = Prolongation(task, point, degree)
        elimination = Elimination(point.arithmetic, shift, task.clock)
        for row in rows:
            elimination.insert(prolongation.row(*row))
        require(not prolongation.leaves_regular(elimination), "The rows leave a regular multiplier g(p).")

    task.settle(task.system.forces, work)
    return f"{len(rows)} rows leave no regular multiplier g(p)."


def check_existence(task: Task, document: Mapping[str, object]) -> str:
    order = whole(document.get("order"), "order", 1, MAX_ORDER)
    degree = whole(document.get("degree"), "degree", 1, order)
    claimed = [whole(one, "dimensions", 0, 10**9) for one in items(document.get("dimensions"), "dimensions", degree + 1)]
    symbol = mapping(document.get("symbol"), "symbol")
    characters = [whole(one, "symbol.characters", 0, 10**9)
                  for one in items(symbol.get("characters"), "symbol.characters", len(task.variables))]
    numbers = [whole(symbol.get(name), f"symbol.{name}", 0, 10**9) for name in ("dimension", "prolonged")]

    def work(point: Point) -> None:
        prolongation = Prolongation(task, point, order + 3)
        elimination, found = Elimination(point.arithmetic, prolongation.monomials.shift, task.clock), []
        for step in range(order + 2):
            for row in prolongation.rows(step):
                elimination.insert(prolongation.row(*row))
            if step >= order:
                found.append(dimensions(prolongation.monomials, elimination, degree))
        require(found[0] == claimed, "The dimensions are not those of the system.")
        require(found[0][-1] == found[1][-1], "The dimension of the projection still falls at the next order.")
        require(prolongation.leaves_regular(elimination), "No multiplier g(p) that is left is regular.")
        check_symbol(elimination, prolongation.monomials, degree, [*numbers, *characters])

    task.settle(task.system.forces, work)
    if "series" in document:
        return check_series(task, mapping(document["series"], "series"))
    return "The projected system is involutive and leaves a regular multiplier g(p)."


def dimensions(monomials: Monomials, elimination: Elimination, degree: int) -> list[int]:
    counts = [len(monomials.columns(k)) for k in range(degree + 1)]
    return [sum(counts[: k + 1]) - elimination.rank(k) for k in range(degree + 1)]


def check_symbol(system: Elimination, monomials: Monomials, degree: int, claimed: list[int]) -> None:
    """Cartan's test: dim of the prolongation = sum_k dim of what k random derivatives kill."""
    arithmetic, shift, units = system.arithmetic, monomials.shift, monomials.units
    tops = [{pivot: arithmetic.one, **{key: value for key, value in row.items() if key >> shift == degree + 2}}
            for pivot, row in zip(system.pivots, system.rows, strict=True) if pivot >> shift == degree + 2]
    above, killed = (Elimination(arithmetic, shift, system.clock) for _ in range(2))
    for top in tops:
        killed.insert(dict(top))
        for a, unit in enumerate(units):
            lifted = {key + unit: (value * (monomials.exponent(key, a) + 1)) << arithmetic.bits for key, value in top.items()}
            above.insert(arithmetic.row(lifted, arithmetic.one))
    width = len(monomials.columns(degree))
    left = [width - len(killed.rows)]
    for _ in units:
        direction = [arithmetic.draw() for _ in units]
        for key in monomials.columns(degree - 1) if left[-1] else ():
            row = {key + unit: (factor * (monomials.exponent(key, a) + 1)) << arithmetic.bits
                   for a, (unit, factor) in enumerate(zip(units, direction, strict=True))}
            killed.insert(arithmetic.row(row, arithmetic.one))
        left.append(width - len(killed.rows))
    prolonged = len(monomials.columns(degree + 1)) - len(above.rows)
    characters = [before - after for before, after in zip(left, left[1:], strict=False)]
    padded = claimed + [0] * (len(units) + 2 - len(claimed))
    require(padded == [left[0], prolonged, *characters], "The dimensions of the symbol are not those of the system.")
    require(prolonged == sum(left[:-1]), "The symbol is not involutive.")


def check_series(task: Task, series: Mapping[str, object]) -> str:
    """The rows of the order that it claims vanish on the given coefficients, and g(p) is regular."""
    if any(task.table.nodes[number][0] == "function" for number in task.table.below(task.system.forces)):
        return "The multiplier exists; its series was not compared, since functions are arbitrary."
    order, prime = whole(series.get("order"), "series.order", 0, MAX_ORDER), series.get("prime")
    if prime is not None:
        require(bool(mpmath.libmp.isprime(whole(prime, "series.prime", 1 << 30, 1 << 127))), "series.prime is no prime.")
        require(task.table.rational(task.system.forces), "series.prime has to be null: f is not rational.")
    arithmetic = Arithmetic(task.generator, prime) if isinstance(prime, int) else Arithmetic(task.generator, 0, 480, 80, 79)
    given, terms = mapping(series.get("point"), "series.point"), items(series.get("terms"), "series.terms", MAX_ROWS)
    try:
        values = {name: arithmetic.number(exact(given[name], "series.point")) for name in given}
        values.setdefault("pi", 0 if prime else arithmetic.real(lambda context: +context.pi))
        pairs = [items(term, "A term of the series", 2) for term in terms]
        keys = [multi_index(pair[0] if pair else None, "A term of the series", task, order + 2) for pair in pairs]
        numbers = [arithmetic.number(exact(pair[-1], "A value of the series")) for pair in pairs]
        missing = {*task.variables, *task.system.parameters} - set(values)
        require(not missing and len(set(keys)) == len(keys), "The series lacks a value of its point, or repeats a term.")
        test_series(task, Point(arithmetic, values), order, dict(zip(keys, numbers, strict=True)))
    except Undefined:
        raise Refused("The series stands at a point where f is not defined.") from None
    return "The projected system is involutive and leaves a regular multiplier g(p), whose series was compared."


def test_series(task: Task, point: Point, order: int, terms: Component) -> None:
    prolongation, arithmetic = Prolongation(task, point, order + 2), point.arithmetic
    for step in range(order + 1):
        for name in prolongation.rows(step):
            products = [arithmetic.reduce(value * terms.get(key, 0)) for key, value in prolongation.row(*name).items()]
            require(arithmetic.vanishes(sum(products), max(1, *map(abs, products), 1)), "The series does not solve the rows.")
    units = [prolongation.monomials.units[v] for v in prolongation.monomials.v]
    g = [[terms.get(a + b, 0) * (2 if a == b else 1) for a in units] for b in units]
    require(regular(g, arithmetic, task.clock), "The series has a singular g(p).")


KINDS = {"lagrangian": (check_lagrangian, "variational"), "existence": (check_existence, "variational"),
         "nonexistence": (check_nonexistence, "not_variational")}


def certified(document: Mapping[str, object], table: Table, generator: random.Random, clock: Clock) -> str:
    """Check a certificate; the sentence that says what was found."""
    choice(document.get("format"), "format", FORMAT)
    question = choice(document.get("question"), "question", "autonomous", "time_dependent")
    claim = choice(document.get("claim"), "claim", "variational", "not_variational")
    kind = choice(document.get("kind"), "kind", *KINDS)
    check, proves = KINDS[kind or ""]
    require(proves == claim, f"A certificate of kind {kind} does not claim {claim}.")
    system = read_system(document.get("system"), table, "system")
    require(question == "time_dependent" or not table.has_time(system.forces), "f contains t: the question is time_dependent.")
    near = {name: exact(value, f"near.{name[:40]}") for name, value in mapping(document.get("near", {}), "near").items()}
    task = Task(table, system, question == "time_dependent", near, generator, clock)
    require(set(near) <= {"t", *task.variables, *system.parameters}, "near holds a name that the system does not know.")
    return check(task, document)


def compare_given(system: Mapping[str, object], table: Table, generator: random.Random, clock: Clock) -> str:
    """Whether the equations as given are the canonical ones; the sentence that says so."""
    read, given = read_system(system, table, "system"), system.get("given")
    equations = given.get("equations", given) if isinstance(given, Mapping) else given
    if not isinstance(equations, Mapping):
        return "" if given is None else "The equations as given were not compared: they are no object of formulas."
    try:
        values = given.get("parameters") if isinstance(given, Mapping) else None
        bound = {name: table.add("number", exact(value, "given")) for name, value in
                 (values if isinstance(values, Mapping) else {}).items() if value is not None}
        require(set(equations) == set(read.coordinates), "It lacks a coordinate.")
        roots = tuple(Reader(equations[q], table, read, "system.given", **bound).formula() for q in read.coordinates)
    except Refused:
        return "The equations as given were not compared: they are not written in the grammar of certificates."
    task = Task(table, read, True, {}, generator, clock)

    def work(point: Point) -> None:
        values = [series[0].get(0, 0) for series in task.series(point, 0, (*roots, *read.forces))]
        for left, right in zip(values, values[len(roots):], strict=False):
            require(point.arithmetic.vanishes(left - right, max(point.arithmetic.one, abs(left), abs(right))),
                    "The canonical equations are not those given.")

    task.settle((*roots, *read.forces), work)
    return "The equations as given are the canonical ones."


def same_formula(part: object, certificate: Mapping[str, object], table: Table, where: str) -> None:
    """The Lagrangian shown is the certified one."""
    if certificate.get("kind") != "lagrangian":
        return require(part is None, f"{where}lagrangian is not certified.")
    system = read_system(certificate.get("system"), table, "system")
    shown = Reader(mapping(part, f"{where}lagrangian").get("text"), table, system, f"{where}lagrangian.text").formula()
    own = Reader(certificate.get("lagrangian"), table, system, "lagrangian").formula()
    return require(shown == own, f"{where}lagrangian.text is not the certified Lagrangian.")


def proves(certificate: Mapping[str, object], question: str, verdict: object) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate.get("claim") == verdict and certificate.get("question") in (question, wider)


def judged(work: Callable[[random.Random, Clock], Iterable[str]], time_limit: float, seed: int | None) -> CheckResult:
    generator = random.SystemRandom() if seed is None else random.Random(seed)
    try:
        return CheckResult("valid", tuple(work(generator, Clock(time_limit))))
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except Unsettled as problem:
        return CheckResult("incomplete", (str(problem),))
    except (RecursionError, MemoryError):
        return CheckResult("incomplete", ("The document is beyond the memory of the checker.",))


def check_certificate(certificate: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a certificate by itself; never raises."""
    return judged(lambda generator, clock: [certified(mapping(certificate, "The certificate"), Table(), generator, clock)],
                  time_limit, seed)


def check_result(result: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a result document, its certificates and their agreement with it; never raises."""
    return judged(lambda generator, clock: check_parts(mapping(result, "The result"), generator, clock), time_limit, seed)


def check_text(text: str, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on the JSON text of a result or of a certificate; never raises."""
    try:
        document = json.loads(text, object_pairs_hook=without_repetition, parse_constant=refuse_constant)
    except Refused as problem:
        return CheckResult("invalid", (str(problem),))
    except (ValueError, TypeError, RecursionError):
        return CheckResult("invalid", ("The text is no JSON document, or nested too deeply.",))
    kind = document.get("format") if isinstance(document, dict) else None
    return (check_certificate if kind == FORMAT else check_result)(document, time_limit, seed)


def without_repetition(pairs: list[tuple[str, object]]) -> dict[str, object]:
    require(len(dict(pairs)) == len(pairs), "A key stands twice in one object.")
    return dict(pairs)


def refuse_constant(name: str) -> object:
    raise Refused(f"{name} is not a JSON number.")


def check_parts(result: Mapping[str, object], generator: random.Random, clock: Clock) -> list[str]:
    choice(result.get("format"), "format", RESULT_FORMAT)
    table, verdicts = Table(), ("variational", "not_variational", "undetermined")
    system = mapping(result.get("system"), "system")
    read = read_system(system, table, "system")
    asked = choice(result.get("question"), "question", "L(q, q')", "L(t, q, q')", None)
    timed = asked == "L(t, q, q')" or (asked is None and table.has_time(read.forces))
    verdict = choice(result.get("verdict"), "verdict", *verdicts)
    later = choice(result.get("verdict_with_time"), "verdict_with_time", *verdicts, None)
    require(not timed or later in (None, verdict), "verdict and verdict_with_time answer one question differently.")
    require((verdict, later) != ("variational", "not_variational"), "An L(q, q') is an L(t, q, q') too.")
    other = mapping(result.get("with_time") or {}, "with_time")
    require(other.get("verdict", later) == later, "with_time.verdict is not verdict_with_time.")
    main = answer(result, "", verdict, "time_dependent" if timed else "autonomous")
    answers = [main, *([answer(other, "with_time.", later, "time_dependent")] if other else [])]
    for part, where, certificate in (one for one in answers if one[2]):
        require(read_system(certificate.get("system"), table, "certificate.system") == read, "certificate.system is another system.")
        same_formula(part.get("lagrangian"), certificate, table, where)
    notes = [certified(one[2], table, generator, clock) for one in answers if one[2]]
    covered = not later or any(proves(one[2], "time_dependent", later) for one in answers)
    if len(notes) < len(answers) or not covered or "undetermined" in (verdict, later):
        raise Unsettled("A verdict is undetermined or has no certificate that proves it.")
    return [*notes, *filter(None, [compare_given(system, table, generator, clock)])]


def answer(part: Mapping[str, object], where: str, verdict: str | None, question: str) -> tuple[Any, str, Any]:
    """(answer, place, certificate) once the certificate agrees with the verdict; None as certificate: {}."""
    certificate = mapping(part.get("certificate") or {}, f"{where}certificate")
    if not certificate:
        require(part.get("lagrangian") is None or verdict == "undetermined", f"{where}lagrangian is not certified.")
        return part, where, certificate
    require(proves(certificate, question, verdict), f"{where}certificate does not claim the verdict that it goes with.")
    return part, where, certificate
