"""The independent checker of certificates; FORMAT.md beside this file says what it checks.

It imports nothing of the project, draws its own points, primes and directions, never searches and never
repairs. Formulas have no trees: the reader computes Taylor series about a point as it reads. All numbers are
integers: residues modulo a prime where formulas are rational, else fixed-point reals, constants from mpmath.
"""

from __future__ import annotations

import json
import math
import random
import re
import time
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from itertools import accumulate, combinations_with_replacement, pairwise, product
from typing import Any, Literal

import mpmath

FORMAT, RESULT_FORMAT = "inverse-service/certificate/1", "inverse-service/result/1"
MAX_TEXT, MAX_DEPTH, MAX_EXPONENT, MAX_MEMBERS = 60_000, 200, 1000, 1000
MAX_COORDINATES, MAX_NAMES, MAX_ORDER, MAX_ROWS, MAX_MONOMIALS = 16, 200, 20, 200_000, 400_000
PRECISIONS = ((480, 200, 90), (1440, 900, 400))  # bits; what is below 2^-200 is zero, above 2^-90 is not
DEFINED = {"cos": "sin(u + pi/2)", "sqrt": "u^(1/2)", "tan": "sin(u)/cos(u)", "cot": "cos(u)/sin(u)", "sec": "1/cos(u)",
           "csc": "1/sin(u)", "sinh": "(exp(u) - exp(-u))/2", "cosh": "(exp(u) + exp(-u))/2", "tanh": "sinh(u)/cosh(u)",
           "coth": "cosh(u)/sinh(u)", "sech": "1/cosh(u)", "csch": "1/sinh(u)", "asin": "atan(u/sqrt(1 - u^2))",
           "acos": "pi/2 - asin(u)", "asinh": "log(u + sqrt(u^2 + 1))", "acosh": "log(u + sqrt(u^2 - 1))",
           "atanh": "log((1 + u)/(1 - u))/2"}  # fmt: skip
DERIVATIVE = re.compile(r"\bdiff\s*\(\s*(\w+)\s*\(([^()]*)\)\s*,([^()]*)\)", re.ASCII)
IRRATIONAL = {"^", "exp", "log", "sin", "atan", *DEFINED}  # tokens; an integral power is a token of another form
RESERVED = {"t", "pi", "diff", *IRRATIONAL}
BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4}
EXPONENT = r"\^[ \t\r\n]*(?:-?[0-9]{1,9}|\(-?[0-9]{1,9}\))(?![0-9.]|[ \t\r\n]*\^)"  # an integer: ^2, ^(-2)
OPERAND = r"(?![0-9.]{401})[0-9]+(?:\.[0-9]+)?|[A-Za-z][A-Za-z0-9_]*(?:\[[0-9]{1,2}(?:,[0-9]{1,2})*\]|'*)"  # 2.5, x'
TOKEN = re.compile(rf"[ \t\r\n]*({OPERAND}|{EXPONENT}|[-+*/^(),]|\Z|(.))", re.DOTALL)
NAME, TEXT = r"[A-Za-z][A-Za-z0-9_]{0,99}", rf"(?s:.{{0,{MAX_TEXT}}})"
NUMBER = r"-?[0-9]{1,400}((\.[0-9]{1,400})?(e[-+]?[0-9]{1,2})?|/0{0,9}[1-9][0-9]{0,399})"
SYSTEM = {"coordinates": [NAME, MAX_COORDINATES], "parameters?": [NAME, MAX_NAMES], "functions?": {}, "equations": {}}
VERDICTS = "variational|not_variational|undetermined"
CERTIFICATE = {"format": FORMAT, "system": {}, "question": "autonomous|time_dependent", "near?": {},
               "claim": VERDICTS, "kind": "lagrangian|existence|nonexistence"}  # fmt: skip
RESULT = {"format": RESULT_FORMAT, "system": {}, "question?": r"L\((t, )?q, q'\)", "verdict": VERDICTS,
          "lagrangian?": {}, "verdict_with_time?": VERDICTS,
          "with_time?": {"verdict?": VERDICTS, "lagrangian?": {}}}  # fmt: skip

Series = dict[int, int]  # coefficients of monomials: eight bits for each exponent, the total degree on top of them
Table = dict[int, list[tuple[int, int, int, int, int, int]]]  # of a condition: see Expansion.condition
Row = tuple[str, int, int, int]  # the name of a row: kind, i, j, alpha
Tools = tuple[random.Random, float]  # and the end of the time, by time.monotonic


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The checker's verdict, and sentences that give its reasons."""

    verdict: Literal["valid", "incomplete", "invalid"]
    reasons: tuple[str, ...] = ()


class Ended(Exception):
    """The check ends, with a verdict and a sentence: "invalid" or, where nothing can be said, "incomplete"."""


class Undefined(Exception):
    """A formula is not defined, or nearly not, at the point in hand."""


def require(condition: object, sentence: str) -> None:
    if not condition:
        raise Ended("invalid", sentence)


def check_shape(value: Any, shape: Any, where: str) -> None:
    """Refuse what is not a text of a pattern (of NUMBER also an integer), in a range, or made of such parts."""
    parts: list[tuple[Any, Any, str]] = []
    value = str(value) if shape is NUMBER and type(value) is int and value.bit_length() < 1330 else value
    match shape:
        case str():
            good, what = isinstance(value, str) and bool(re.fullmatch(shape, value)), f"a text of the form {shape}"
        case range():
            good, what = type(value) is int and value in shape, f"a whole number from {shape[0]} to {shape[-1]}"
        case [*_]:  # [shape of each, most], or a tuple: the shape of each in turn
            fixed, most = isinstance(shape, tuple), len(shape) if isinstance(shape, tuple) else shape[1]
            good = isinstance(value, list | tuple) and (len(value) == most if fixed else len(value) <= most)
            what, shapes = f"a list of {'' if fixed else 'at most '}{most} items", shape if fixed else [shape[0]] * most
            parts = [(*pair, f"an item of {where}") for pair in zip(value, shapes, strict=False)] if good else []
        case _:  # {key: shape}; behind a key that may be left out, or null, stands ?
            good = isinstance(value, dict) and len(value) <= MAX_MEMBERS and all(isinstance(key, str) for key in value)
            what, keys = "a moderate object", [(key, key.rstrip("?")) for key in shape] if good else []
            parts = [(value.get(key), shape[name], f"{where}.{ascii(key[:40])[1:-1]}")
                     for name, key in keys if key == name or value.get(key) is not None]  # fmt: skip
    require(good, f"{where} has to be {what}.")
    for part in parts:
        check_shape(*part)


def read_tokens(text: Any, where: str) -> tuple[str, ...]:
    """The tokens of a formula, the last one empty, with B[1,0](x, y) for diff(B(x, y), x)."""

    def rewritten(found: re.Match[str]) -> str:
        names, by = ([name.strip() for name in part.split(",")] for part in (found[2], found[3]))
        good = all(re.fullmatch(rf"{NAME}'?", name) for name in names) and {*by} <= {*names}
        require(good and len({*names}) == len(names), f"{where}: diff takes a function and some of its distinct names.")
        return f"{found[1]}[{','.join(str(by.count(name)) for name in names)}]({found[2]})"

    check_shape(text, TEXT, where)
    tokens = list(TOKEN.finditer(DERIVATIVE.sub(rewritten, text)))
    strange = next((token.start(2) + 1 for token in tokens if token[2]), 0)
    require(not strange, f"{where}: what stands at column {strange} is no part of a formula.")
    return tuple(token[1] for token in tokens)


class Reader:
    """Reads one formula by operator precedence, computing in a ring; names in `bound` have these values."""

    def __init__(self, ring: Expansion, formula: tuple[str, ...], **bound: Series) -> None:
        self.ring, self.tokens, self.names, self.position = ring, formula, ring.names | bound, 0
        self.value = self.expression(0, 0)
        self.expect(not self.tokens[self.position], "an operator is expected")

    def expect(self, condition: object, what: str) -> None:
        require(condition, f"Formula {''.join(self.tokens[:9])[:40]}…: {what}, at token {self.position + 1}.")

    def take(self, operator: str) -> bool:
        """Whether the next token is this one; then it is passed."""
        found = self.tokens[self.position] == operator
        self.position += found
        return found

    def expression(self, floor: int, depth: int) -> Series:
        """What stands before an operator that binds no tighter than `floor`; -x^2 is -(x^2), x^y^z is x^(y^z)."""
        self.expect(depth <= MAX_DEPTH, f"at most {MAX_DEPTH} brackets and exponents may be nested")
        minuses = 0
        while self.take("-"):
            minuses += 1
        value = self.expression(3, depth) if minuses else self.atom(depth)
        value = self.ring.add([value], [-1]) if minuses % 2 else value
        while BINDING.get((operator := self.tokens[self.position])[:1], 0) > floor:
            self.position += 1
            if operator[1:]:
                value = self.ring.power(value, int(operator[1:].strip("( \t\r\n)")))
            else:
                tower = operator == "^"
                value = self.ring.joined(operator, value, self.expression(BINDING[operator] - tower, depth + tower))
        return value

    def atom(self, depth: int) -> Series:
        token = self.tokens[self.position]
        self.expect(token == "(" or token[:1].isalnum(), "a number, a name or '(' is expected")
        self.position += token != "("
        if token[0].isdigit():
            return self.ring.arithmetic.settle({0: self.ring.arithmetic.number(Fraction(token))})
        if not self.take("("):
            self.expect(token in self.names, f"the name {token[:40]} is not known")
            return self.names[token]
        values = [self.expression(0, depth + 1)]
        while token != "(" and self.take(","):
            values.append(self.expression(0, depth + 1))
        self.expect(self.take(")"), "')' is expected")
        return values[0] if token == "(" else self.call(token, values)

    def call(self, token: str, values: list[Series]) -> Series:
        """A(u), A'(u), B(u, w), B[1,0](u, w) or an elementary function."""
        if token in IRRATIONAL and len(values) == 1:
            return self.ring.elementary(token, values[0])
        name, _, listed = token.rstrip("]").partition("[")
        orders = [int(order) for order in listed.split(",")] if listed else [name.count("'")]
        name, orders = name.rstrip("'"), [0] * len(values) if orders == [0] else orders
        if name in self.ring.question.integrals:
            return self.ring.integral(name, orders, values)
        good = len(values) == len(orders) == len(self.ring.question.functions.get(name, ()))
        self.expect(good and sum(orders) <= MAX_ORDER, f"{token[:40]} is no function of {len(values)} arguments")
        return self.ring.function(name, tuple(orders), values)


class Arithmetic:
    """Residues modulo `prime`, or (prime 0) reals as integers scaled by `one` = 2^bits."""

    def __init__(self, question: Question, prime: int = 0, bits: int = 0, cut: int = 0, gap: int = 0) -> None:
        self.question, self.prime, self.bits, self.one = question, prime, bits, 1 << bits
        self.cut, self.gap, self.noise = self.one >> cut, self.one >> gap, 1 << bits // 4

    def draw(self) -> int:
        return self.question.generator.randrange(*((self.prime,) if self.prime else (-self.one, self.one)))

    def reduce(self, value: int) -> int:
        """The number that a product of two numbers stands for."""
        return value % self.prime if self.prime else value >> self.bits

    def settle(self, raw: Series, shift: int = 0) -> Series:
        """The numbers without zeros (reals: what is far below every threshold); `shift` is `bits` for products."""
        if prime := self.prime:
            return {key: rest for key, value in raw.items() if (rest := value % prime)}
        return {key: rest for key, value in raw.items() if abs(rest := value >> shift) > self.noise}

    def row(self, raw: Series, shift: int = 0, scale: int = 0) -> Series:
        """`settle` for a row of an elimination; with a `scale` the largest entry is made 1, or all are zero."""
        row = self.settle(raw, shift)
        if row and scale and not self.prime:
            largest = max(map(abs, row.values()))
            row = {} if self.vanishes(largest, scale) else {key: (row[key] << self.bits) // largest for key in row}
        return row if self.prime else {key: value for key, value in row.items() if not self.vanishes(value, self.one)}

    def vanishes(self, value: int, scale: int) -> bool:
        """Whether the number is zero; reals: beside numbers of the size of `scale`."""
        if self.prime:
            return value % self.prime == 0
        if self.cut * scale < abs(value) << self.bits < self.gap * scale:
            raise Ended("incomplete", "A number is too close to zero to judge.")
        return abs(value) << self.bits <= self.cut * scale

    def number(self, value: Fraction) -> int:
        above, below = value.numerator, value.denominator
        return above * self.inverse(below) % self.prime if self.prime else (above << self.bits) // below

    def inverse(self, value: int, least: int = 30) -> int:
        if abs(value) << least < self.one or (self.prime and value % self.prime == 0):
            raise Undefined
        return pow(value, -1, self.prime) if self.prime else (self.one << self.bits) // value

    def power(self, value: int, exponent: int) -> int:
        return pow(value, exponent, self.prime or None) << self.bits >> self.bits * exponent  # not for exponent < 0

    def real(self, name: str, argument: int = 0) -> int:
        """An elementary function, or pi, as mpmath computes it; refused unless real and of moderate size."""
        if self.prime or abs(argument) >> 10 > self.one:
            raise Undefined
        given = [] if name == "pi" else [mpmath.ldexp(argument, -self.bits)]
        value = getattr(mpmath, "ln" if name == "log" else name)(*given, prec=self.bits + 64)
        if not isinstance(value, mpmath.mpf) or not -1 << 64 < value < 1 << 64:
            raise Undefined
        return int(mpmath.ldexp(value, self.bits))


class Expansion:
    """Power series about a point in the displacements of t (if any), q_1 … q_n, v_1 … v_n, and conditions."""

    def __init__(self, arithmetic: Arithmetic, values: dict[str, int], degree: int) -> None:
        self.question, self.arithmetic, self.degree = arithmetic.question, arithmetic, degree
        self.n, m = len(self.question.coordinates), len(self.question.variables)
        self.shift, self.units = 8 * m, [(1 << 8 * a) | (1 << 8 * m) for a in range(m)]
        self.q, self.v = range(m - 2 * self.n, m - self.n), range(m - self.n, m)
        self.jets = dict[tuple[str, tuple[int, ...], tuple[int, ...]], int]()
        self.phi, self.table, self.unknowns = cache(self.curvature), cache(self.condition), cache(self.coefficients)
        if math.comb(m + degree, degree) > MAX_MONOMIALS:
            raise Ended("incomplete", f"Series of more than {MAX_MONOMIALS} terms would be needed.")
        self.names = {name: {0: value} for name, value in values.items()}
        self.names |= {} if arithmetic.prime else {"pi": {0: arithmetic.real("pi")}}
        for name, unit in zip(self.question.variables, self.units, strict=True):
            self.names[name][unit] = arithmetic.one
        self.forces = [Reader(self, force).value for force in self.question.forces]
        self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]
        speeds = (self.names[name + "'"] for name in self.question.coordinates)
        self.field = [*[{0: arithmetic.one}] * self.question.timed, *speeds, *self.forces]
        self.scale = max([arithmetic.one, *(abs(value) for force in self.forces for value in force.values())])

    def exponent(self, key: int, variable: int) -> int:
        return (key >> 8 * variable) & 255

    def monomials(self, degree: int) -> Iterator[int]:
        return (sum(units) for units in combinations_with_replacement(self.units, degree)) if degree >= 0 else iter(())

    def joined(self, operator: str, left: Series, right: Series) -> Series:
        """left operator right, for ^ exp(right log(left))."""
        self.question.check_time()
        if operator in "+-":
            return self.add([left, right], [1, 1 if operator == "+" else -1])
        if operator == "^":
            return self.elementary("exp", self.multiply(right, self.elementary("log", left), self.degree))
        return self.multiply(left, self.power(right, -1) if operator == "/" else right, self.degree)

    def add(self, terms: list[Series], weights: Iterable[int] = ()) -> Series:
        """The sum of the series, each times a small integer."""
        total: Series = {}
        for term, weight in zip(terms, weights or [1] * len(terms), strict=True):
            for key, value in term.items():
                total[key] = total.get(key, 0) + value * weight
        return self.arithmetic.settle(total)

    def multiply(self, left: Series, right: Series, degree: int) -> Series:
        """The product up to a total degree: the order of monomials is that of degrees first."""
        total: Series = {}
        terms, above = sorted(right.items()), (degree + 1) << self.shift
        for first, value in left.items():
            self.question.check_time()
            for second, coefficient in terms[: bisect_left(terms, (above - first,))]:
                total[first + second] = total.get(first + second, 0) + value * coefficient
        return self.arithmetic.settle(total, self.arithmetic.bits)

    def derivative(self, series: Series, variable: int) -> Series:
        unit = self.units[variable]
        return {key - unit: part * power for key, part in series.items() if (power := self.exponent(key, variable))}

    def compose(self, arguments: list[Series], coefficient: Callable[..., int], *beta: int) -> Series:
        """sum over beta of coefficient(beta) (u - u_0)^beta by Horner's rule, for arguments u with values u_0."""
        if len(beta) == len(arguments):
            return self.arithmetic.settle({0: coefficient(*beta)})
        result, step = Series(), {key: value for key, value in arguments[len(beta)].items() if key}
        for power in range(self.degree - sum(beta), -1, -1):
            raised = self.multiply(result, step, self.degree - sum(beta) - power)
            result = self.add([raised, self.compose(arguments, coefficient, *beta, power)])
        return result

    def power(self, u: Series, exponent: int) -> Series:
        field, start = self.arithmetic, u.get(0, 0)
        if abs(exponent) > MAX_EXPONENT or start.bit_length() * abs(exponent) > 1 << 21:
            raise Undefined
        start = start if exponent >= 0 else field.inverse(start)
        binomial = [*accumulate(range(self.degree), lambda last, k: last * (exponent - k) // (k + 1), initial=1)]
        return self.compose([u], lambda k: binomial[k] and binomial[k] * field.power(start, abs(exponent - k)))

    def elementary(self, name: str, u: Series) -> Series:
        if name in DEFINED:
            return Reader(self, read_tokens(DEFINED[name], name), u=u).value
        value = (field := self.arithmetic).real(name, start := u.get(0, 0))
        if name in ("log", "atan"):  # y with E(y) = w E(u), where E multiplies by the degree and w is the derivative
            below = u if name == "log" else self.add([{0: field.one}, self.multiply(u, u, self.degree)])
            growth = {key: part * (key >> self.shift) for key, part in u.items()}
            growth = self.multiply(self.power(below, -1), growth, self.degree)
            return {0: value} | {key: part // (key >> self.shift) for key, part in growth.items()}
        cycle = [value] * 4 if name == "exp" else [value, cosine := field.real("cos", start), -value, -cosine]
        return self.compose([u], lambda k: cycle[k % 4] // math.factorial(k))

    def function(self, name: str, orders: tuple[int, ...], arguments: list[Series]) -> Series:
        """A derivative of a declared function: its Taylor coefficients are random, but the same at equal arguments."""
        field = self.arithmetic
        near = tuple((argument.get(0, 0) + field.cut // 2) // field.cut for argument in arguments)

        def coefficient(*beta: int) -> int:
            value = self.jets.setdefault((name, near, tuple(map(sum, zip(beta, orders, strict=True)))), field.draw())
            return field.reduce(value * field.number(Fraction(1, math.prod(map(math.factorial, beta)))))

        return self.compose(arguments, coefficient)

    def integral(self, name: str, orders: list[int], arguments: list[Series]) -> Series:
        """A function with one given derivative: at equal arguments the same, random where nothing is given."""
        (names, (known, slope)), field = self.question.integrals[name], self.arithmetic
        good = arguments == [self.names.get(argument) for argument in names] and not any(orders)
        require(good, f"{name} is to be written with its own arguments.")
        axes = {self.question.variables.index(argument) for argument in names}
        axis = self.question.variables.index(known)
        free = [key for d in range(self.degree + 1) for key in self.monomials(d) if not self.exponent(key, axis)]
        free = [key for key in free if all(a in axes or not self.exponent(key, a) for a in range(len(self.units)))]
        series = {key: self.jets.setdefault((name, (), (key,)), field.draw()) for key in free}
        for key, part in Reader(self, slope).value.items():
            share = field.number(Fraction(1, self.exponent(key, axis) + 1))
            series[key + self.units[axis]] = field.reduce(part * share)
        return series

    def coefficients(self, degree: int) -> list[int]:
        """The unknowns of a degree: total degree two more, v-degree at least two."""
        return [key for key in self.monomials(degree + 2) if sum(self.exponent(key, v) for v in self.v) >= 2]

    def curvature(self, k: int, j: int) -> Series:
        """2 Phi^k_j = 2 Gamma(df^k/dv^j) - 4 df^k/dq^j - sum_l df^k/dv^l df^l/dv^j."""
        pairs = [(rate, self.derivative(self.slopes[k][j], a)) for a, rate in enumerate(self.field)]
        pairs += [(self.slopes[k][m], self.slopes[m][j]) for m in range(self.n)]
        terms = [self.derivative(self.forces[k], self.q[j]), *(self.multiply(*pair, self.degree) for pair in pairs)]
        return self.add(terms, [-4] + [2] * len(self.field) + [-1] * self.n)

    def condition(self, kind: str, i: int, j: int) -> Table:
        """A condition as a sum of terms value x^part g_ab and value x^part d_c g_ab, by their parts; see row()."""
        table, sign, nothing = Table(), -1 if kind == "H3" else 1, self.shift + 8  # no exponent stands there
        terms = [(rate, i, j, 2, 8 * a, self.units[a]) for a, rate in enumerate(self.field) if kind == "H2"]
        for k in range(self.n):
            left, right = (self.phi(k, c) if kind == "H3" else self.slopes[k][c] for c in (j, i))
            terms += [(left, i, k, 1, nothing, 0), (right, j, k, sign, nothing, 0)]
        for factor, b, k, weight, along, unit in terms:
            first, second, lift = self.v[b], self.v[k], self.units[self.v[b]] + self.units[self.v[k]] + unit
            for part, value in factor.items():
                table.setdefault(part, []).append((value * weight, lift, 8 * first, 8 * second, first == second, along))
        return table

    def row(self, kind: str, i: int, j: int, alpha: int) -> Series:
        """The coefficient alpha of a condition, in the coefficients of L."""
        table, row, exponents = self.table(kind, i, j), Series(), [alpha >> 8 * a & 255 for a in range(len(self.units))]
        powers = [[unit * e for e in range(most + 1)] for unit, most in zip(self.units, exponents, strict=True) if most]
        for rest in (alpha - sum(choice) for choice in product(*powers)):
            for value, lift, first, second, less, along in table.get(alpha - rest, ()):
                key = rest + lift
                times = (key >> first & 255) * ((key >> second & 255) - less) * ((rest >> along & 255) + 1)
                row[key] = row.get(key, 0) + value * times
        return self.arithmetic.row(row, scale=self.scale)

    def rows(self, degree: int) -> Iterator[Row]:
        """All rows whose unknowns have just this highest degree, in an order that fills in little."""
        for kind, (j, i) in product(("H2", "H3"), combinations_with_replacement(range(self.n)[::-1], 2)):
            if kind == "H2" or i < j:
                yield from ((kind, i, j, alpha) for alpha in reversed([*self.monomials(degree - (kind == "H2"))]))

    def extend(self, elimination: Elimination, degree: int, idle: set[Row]) -> None:
        """Insert all rows of a degree but those that vanish on a random solution of the others.

        A row that does not follow from the others does so with a chance of one in the prime. `idle`, the rows that
        followed, only says which to try: they themselves at another point, and their derivatives.
        """
        likely = list[Row]()
        for kind, i, j, alpha in self.rows(degree):
            if not idle.isdisjoint((kind, i, j, alpha - unit) for unit in (0, *self.units)):
                likely.append((kind, i, j, alpha))
            elif not elimination.insert([self.row(kind, i, j, alpha)]):
                idle.add((kind, i, j, alpha))
        solution = elimination.solution([key for k in range(degree + 1) for key in self.unknowns(k)])
        for name in likely:
            self.question.check_time()
            if self.solved(row := self.row(*name), solution, self.arithmetic.one) or not elimination.insert([row]):
                idle.add(name)

    def solved(self, row: Series, values: Series, least: int) -> bool:
        """Whether the row vanishes on the values; reals: beside its largest term, or `least`."""
        terms = [self.arithmetic.reduce(value * values.get(key, 0)) for key, value in row.items()]
        return self.arithmetic.vanishes(sum(terms), max([least, *map(abs, terms)]))

    def regular(self, series: Series) -> bool:
        """Whether the matrix of the second v-derivatives at the point is regular."""
        matrix = [{b: series.get(self.units[a] + self.units[b], 0) * (1 + (a == b)) for b in self.v} for a in self.v]
        scale = max(abs(entry) for row in matrix for entry in row.values())
        elimination = Elimination(self.arithmetic, 64, (self.arithmetic.row(row, scale=scale) for row in matrix))
        return len(elimination.rows) == self.n


class Elimination:
    """Rows in echelon form without their pivots, which are 1; `order` numbers the rows by their pivots (monomials)."""

    def __init__(self, arithmetic: Arithmetic, shift: int, rows: Iterable[Series] = ()) -> None:
        self.arithmetic, self.shift = arithmetic, shift
        self.rows, self.pivots, self.order = list[Series](), list[int](), dict[int, int]()
        self.insert(rows)

    def insert(self, rows: Iterable[Series]) -> bool:
        """Reduce each row degree by degree until its part of the highest degree is new, then keep it; if any was."""
        field, before = self.arithmetic, len(self.rows)
        for row in rows:
            field.question.check_time()
            block: list[int] = []
            while row and not block:
                first = max(row) >> self.shift << self.shift  # keys of the highest degree are not below
                queue = sorted([self.order[key] for key in row if key >= first and key in self.order])  # a heap
                row = self.reduced(row, first, queue) if queue else row
                block = [key for key in row if key >= first]
            if block:
                least = 0 if field.prime else max(abs(row[key]) for key in block) >> 20
                pivot = min(key for key in block if abs(row[key]) >= least)
                inverse, self.order[pivot] = field.inverse(row[pivot], 400), len(self.rows)
                self.pivots.append(pivot)
                rest = {key: value * inverse for key, value in row.items() if key != pivot}
                self.rows.append(field.settle(rest, field.bits))
        return len(self.rows) > before

    def reduced(self, row: Series, first: int, queue: list[int]) -> Series:
        """Without the pivots of one degree; a kept row holds no pivot of its degree older than itself."""
        field, order = self.arithmetic, self.order
        raw = {key: value << field.bits for key, value in row.items()}
        while queue:
            number = heappop(queue)
            factor = field.reduce(raw.pop(self.pivots[number]))
            if factor and not field.vanishes(factor, field.one):
                field.question.check_time()
                for key, value in self.rows[number].items():
                    if key >= first and key not in raw and key in order:
                        heappush(queue, order[key])
                    raw[key] = raw.get(key, 0) - factor * value
        return field.row(raw, field.bits)

    def solution(self, columns: list[int]) -> Series:
        """A random solution in the columns, which are all up to some degree."""
        field, values = self.arithmetic, {column: self.arithmetic.draw() for column in columns}
        kept = [pair for pair in zip(reversed(self.pivots), reversed(self.rows), strict=True) if pair[0] in values]
        for pivot, row in sorted(kept, key=lambda pair: pair[0] >> self.shift):
            values[pivot] = -field.reduce(sum([value * values[key] for key, value in row.items()]))
        return field.settle(values)


class Question:
    """A system q'' = f as read, whether L may depend on t, and the checks of certificates that answer this."""

    def __init__(self, tools: Tools, document: Any, timed: bool = True, near: Any = None) -> None:
        (self.generator, self.deadline), self.timed, near = tools, timed, near or {}
        check_shape(document, SYSTEM, "system")
        self.coordinates, self.parameters = document["coordinates"], document.get("parameters") or []
        self.functions, equations = document.get("functions") or {}, document["equations"]
        check_shape(list(self.functions.items()), [(NAME, [NAME, 6]), MAX_NAMES], "system.functions")
        names = [*self.coordinates, *self.parameters, *self.functions]
        good = self.coordinates and all(self.functions.values()) and {*equations} == {*self.coordinates}
        good = good and len({*names} - RESERVED) == len(names)
        require(good, "system has to declare names once, none with a meaning of its own, and an equation for each.")
        self.forces = [read_tokens(equations[name], f"system.equations.{name}") for name in self.coordinates]
        self.content = (self.coordinates, {*self.parameters}, self.functions, self.forces)
        self.rational = all(IRRATIONAL.isdisjoint(force) for force in self.forces)
        self.contains_time = any("t" in force for force in self.forces)
        require(timed or not self.contains_time, "f contains t: the question has to be time_dependent.")
        self.variables = ["t"] * timed + [*self.coordinates] + [name + "'" for name in self.coordinates]
        self.names = {"t", *self.variables, *self.parameters}
        check_shape(near, dict.fromkeys(near, NUMBER), "near")
        require({*near} <= self.names, "near holds a name that the system does not know.")
        self.near = {name: Fraction(value) for name, value in near.items()}
        self.integrals = dict[str, tuple[list[str], tuple[str, tuple[str, ...]]]]()

    def check_time(self) -> None:
        if not time.monotonic() < self.deadline:
            raise Ended("incomplete", "The time limit ended the check.")

    def at_point(self, arithmetic: Arithmetic, degree: int, work: Callable[[Expansion], None]) -> None:
        """Do the work at a random point where f is defined; a real one lies near what the certificate names."""
        for attempt in range(60):
            values = {name: arithmetic.draw() for name in ("pi", *sorted(self.names))}
            for name, value in values.items() if not arithmetic.prime else ():
                spread = (3, 6, 10, 1)[attempt % 4] if name in self.near else 0
                values[name] = arithmetic.number(self.near.get(name, Fraction(attempt % 2))) + (value >> spread)
            try:
                return work(Expansion(arithmetic, values, degree))
            except Undefined:
                self.check_time()
        raise Ended("incomplete", "No point was found at which every formula is defined.")

    def settle(self, degree: int, work: Callable[[Expansion], None], lagrangian: tuple[str, ...] = ()) -> None:
        """The work modulo two primes or in reals, with more digits where unsettled; of a Lagrangian three, both."""
        if self.rational and IRRATIONAL.isdisjoint(lagrangian):
            for _ in range(3 if lagrangian else 2):
                prime = next(filter(mpmath.libmp.isprime, iter(lambda: self.generator.randrange(1 << 60, 1 << 61), 0)))
                self.at_point(Arithmetic(self, prime), degree, work)
            return
        for precision in PRECISIONS:
            try:
                self.at_point(Arithmetic(self, 0, *precision), degree, work)
                if not lagrangian:
                    return
            except Ended as end:
                if end.args[0] == "invalid" or precision == PRECISIONS[-1]:
                    raise

    def lagrangian(self, document: dict[str, Any]) -> str:
        """L_(v_i v_j) f^j + L_(v_i q_j) v^j + L_(v_i t) = L_(q_i), and the matrix L_(v_i v_j) is regular."""
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")
        tokens = formula + self.read_integrals(document.get("integrals") or {})
        require(self.timed or "t" not in tokens, "The Lagrangian contains t, but the question does not.")

        def work(ring: Expansion) -> None:
            lagrangian, one = Reader(ring, formula).value, ring.arithmetic.one
            rates = {unit: rate.get(0, 0) for unit, rate in zip(ring.units, ring.field, strict=True)} | {0: one}
            for v, q, name in zip(ring.v, ring.q, self.coordinates, strict=True):
                terms = ring.derivative(lagrangian, v) | {0: -lagrangian.get(ring.units[q], 0)}
                require(ring.solved(terms, rates, one >> 60), f"The Euler-Lagrange equation of {name} does not hold.")
            require(ring.regular(lagrangian), "The Hessian of the Lagrangian is singular.")

        self.settle(2, work, tokens)
        return "The Euler-Lagrange equations of the Lagrangian hold and its Hessian is regular."

    def read_integrals(self, listed: dict[str, Any]) -> tuple[str, ...]:
        """The functions that are known by one derivative, which may hold those before them; the tokens of all."""
        check_shape(listed, {key: {"arguments": [NAME, 6], "derivatives": {}} for key in listed}, "integrals")
        check_shape(list(listed), [NAME, MAX_NAMES], "integrals")
        require(
            not {*listed} & ({*self.names, *self.functions} | RESERVED), "An integral has the name of another thing."
        )
        tokens: tuple[str, ...] = ()
        for name, one in listed.items():
            arguments, slopes = one["arguments"], one["derivatives"]
            require(0 < len(arguments) == len({*arguments}), f"integrals.{name} has to name its arguments once.")
            require({*arguments} <= {"t", *self.coordinates}, f"integrals.{name} may hold t and coordinates only.")
            require({*slopes} <= {*arguments}, f"integrals.{name} has a derivative by what is no argument.")
            if len(slopes) != 1:
                raise Ended("incomplete", f"integrals.{name} has to have one derivative.")
            (pair,) = ((by, read_tokens(text, f"integrals.{name}")) for by, text in slopes.items())
            known = {t for t in pair[1] if t in listed}
            require(known <= {*self.integrals}, f"integrals.{name} may hold integrals before it only.")
            self.integrals[name] = (arguments, pair)
            tokens += (*arguments, *pair[1])
        return tokens

    def multi_index(self, exponents: list[int], most: int) -> int:
        require(sum(exponents) <= most, f"A multi-index has to have a total of at most {most}.")
        return sum(exponent << 8 * a for a, exponent in enumerate([*exponents, sum(exponents)]))

    def nonexistence(self, document: dict[str, Any]) -> str:
        index, exponents, m = range(len(self.coordinates)), range(MAX_ORDER + 1), len(self.variables)
        shape = {"order": exponents, "rows": [("H2|H3", index, index, (exponents,) * m), MAX_ROWS]}
        check_shape(document, shape, "certificate")
        order, listed = document["order"], document["rows"]
        require(all(i < j + (kind == "H2") for kind, i, j, _ in listed), "A row of H2 needs i <= j, a row of H3 i < j.")
        rows = [(kind, i, j, self.multi_index(alpha, order - (kind == "H2"))) for kind, i, j, alpha in listed]
        require(len(set(rows)) == len(rows), "A row is named twice.")
        degree = {row: (row[3] >> 8 * m) + (row[0] == "H2") for row in rows}
        rows.sort(key=lambda row: (degree[row], row[0], *(-index for index in row[1:])))  # this fills in least

        def work(ring: Expansion) -> None:
            echelon = Elimination(ring.arithmetic, ring.shift, (ring.row(*row) for row in rows))
            require(not ring.regular(echelon.solution(ring.unknowns(0))), "The rows leave a regular multiplier g(p).")

        self.settle(max((degree[row] + 2 * (row[0] == "H3") for row in rows), default=0), work)
        return f"{len(rows)} rows leave no regular multiplier g(p)."

    def existence(self, document: dict[str, Any]) -> str:
        count, orders = range(10**9), range(1, MAX_ORDER + 1)
        symbol = {"dimension": count, "prolonged": count, "characters": [count, len(self.variables)]}
        shape = {"order": orders, "degree": orders, "dimensions": [count, MAX_ORDER + 1], "symbol": symbol}
        check_shape(document, shape, "certificate")
        order, degree, dimensions = document["order"], document["degree"], list(document["dimensions"])
        require(degree <= order, "degree has to be at most order.")
        idle = set[Row]()

        def work(ring: Expansion) -> None:
            elimination, degrees = Elimination(ring.arithmetic, ring.shift), range(degree + 1)
            for step in range(order + 2):
                ring.extend(elimination, step, idle)
                kept = [pivot >> ring.shift for pivot in elimination.pivots]
                found = list(accumulate(len(ring.unknowns(k)) - kept.count(k + 2) for k in degrees))
                require(step < order or found == dimensions, "The dimensions are not those of this and the next order.")
            require(ring.regular(elimination.solution(ring.unknowns(0))), "No multiplier g(p) that is left is regular.")
            test_symbol(elimination, ring, degree, document["symbol"])

        self.settle(order + 3, work)
        found = "The projected system is involutive and leaves a regular multiplier g(p)."
        return found if document.get("series") is None else found + self.series(document["series"])

    def series(self, series: Any) -> str:
        """The rows of the order that it claims vanish on the given coefficients, and g(p) is regular."""
        point = dict.fromkeys({*self.variables, *self.parameters}, NUMBER)
        shape = {"order": range(MAX_ORDER + 1), "prime?": range(1 << 127), "point": {**point, "pi?": NUMBER},
                 "terms": [((range(MAX_ORDER + 3),) * len(self.variables), NUMBER), MAX_ROWS]}  # fmt: skip
        check_shape(series, shape, "certificate.series")
        order, prime, given = series["order"], series.get("prime") or 0, series["point"]
        good = not prime or (prime >> 30 and mpmath.libmp.isprime(prime) and self.rational)
        require(good, "series.prime has to be null, or, if f is rational, a prime above 2^30.")
        field = Arithmetic(self, prime) if prime else Arithmetic(self, 0, 480, 80, 79)
        try:
            values = {name: field.number(Fraction(x)) for name in (*point, "pi") if (x := given.get(name)) is not None}
            terms = {self.multi_index(a, order + 2): field.number(Fraction(b)) for a, b in series["terms"]}
            ring = Expansion(field, values, order + 2)
        except Undefined:
            raise Ended("invalid", "The series stands at a point where f is not defined.") from None
        if ring.jets:
            return " The series was not compared: functions are arbitrary."
        for name in (name for degree in range(order + 1) for name in ring.rows(degree)):
            require(ring.solved(ring.row(*name), terms, 1), "The series does not solve the rows.")
        require(ring.regular(terms), "The series has a singular g(p).")
        return " The series solves the rows."


def test_symbol(system: Elimination, ring: Expansion, degree: int, claimed: dict[str, Any]) -> None:
    """Cartan's test: dim of the prolongation = sum_k dim of what k random derivatives kill."""
    field, top = system.arithmetic, degree + 2
    tops = [{pivot: field.one} | {key: value for key, value in row.items() if key >> ring.shift == top}
            for pivot, row in zip(system.pivots, system.rows, strict=True) if pivot >> ring.shift == top]  # fmt: skip
    killed, above = Elimination(field, ring.shift, tops), Elimination(field, ring.shift)
    above.insert(field.row({key + unit: row[key] * (ring.exponent(key, a) + 1) for key in row}, scale=field.one)
                 for row in tops for a, unit in enumerate(ring.units))  # fmt: skip
    left = [len(ring.unknowns(degree)) - len(killed.rows)]
    for _ in ring.units:
        direction = [(a, unit, field.draw()) for a, unit in enumerate(ring.units)]
        killed.insert(field.row({key + unit: part * (ring.exponent(key, a) + 1) for a, unit, part in direction},
                                scale=field.one) for key in ring.unknowns(degree - 1) if left[-1])  # fmt: skip
        left.append(len(ring.unknowns(degree)) - len(killed.rows))
    found = [left[0], len(ring.unknowns(degree + 1)) - len(above.rows), *(a - b for a, b in pairwise(left))]
    given = [claimed["dimension"], claimed["prolonged"], *claimed["characters"]]
    require([*given, *[0] * (len(found) - len(given))] == found, "The symbol has other dimensions.")
    require(found[1] == sum(left[:-1]), "The symbol is not involutive.")


def judged(work: Callable[[Tools], list[str]], time_limit: float, seed: int | None) -> CheckResult:
    try:
        return CheckResult("valid", tuple(work((random.Random(seed), time.monotonic() + time_limit))))
    except Ended as end:
        return CheckResult(end.args[0], end.args[1:])
    except (RecursionError, MemoryError):
        return CheckResult("incomplete", ("The document is beyond the memory of the checker.",))


def check_certificate(certificate: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a certificate by itself; never raises. `seed` makes the checker's choices repeatable."""
    return judged(lambda tools: [certified(certificate, tools)], time_limit, seed)


def check_result(result: object, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on a result document, its certificates and their agreement with it; never raises."""
    return judged(lambda tools: compared(result, tools), time_limit, seed)


def check_text(text: str, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on the JSON text of a result or of a certificate; never raises."""

    def members(pairs: list[tuple[str, object]]) -> dict[str, object]:
        if len(dict(pairs)) < len(pairs):
            raise ValueError
        return dict(pairs)

    try:
        document = json.loads(text, object_pairs_hook=members, parse_constant=int)  # int("NaN") is a ValueError
    except (ValueError, TypeError, RecursionError):
        return CheckResult("invalid", ("The text is no JSON document, repeats a key, or is nested too deeply.",))
    kind = document.get("format") if isinstance(document, dict) else None
    return (check_certificate if kind == FORMAT else check_result)(document, time_limit, seed)


def certified(document: Any, tools: Tools) -> str:
    """Check a certificate; the sentence that says what was found."""
    check_shape(document, CERTIFICATE, "certificate")
    kind, proven = document["kind"], "not_variational" if document["kind"] == "nonexistence" else "variational"
    require(document["claim"] == proven, f"A certificate of kind {kind} has to claim {proven}.")
    asked = Question(tools, document["system"], document["question"] == "time_dependent", document.get("near"))
    checks = {"lagrangian": asked.lagrangian, "existence": asked.existence, "nonexistence": asked.nonexistence}
    return checks[kind](document)


def compared(result: Any, tools: Tools) -> list[str]:
    """Check a result: first that its parts agree, then its certificates."""
    check_shape(result, RESULT, "result")
    system, asked = Question(tools, result["system"]), result.get("question")
    timed = asked == "L(t, q, q')" or (asked is None and system.contains_time)
    verdict, later, other = result["verdict"], result.get("verdict_with_time"), result.get("with_time")
    require(not timed or later in (None, verdict), "verdict and verdict_with_time answer one question differently.")
    require((verdict, later) != ("variational", "not_variational"), "An L(q, q') is an L(t, q, q') too.")
    certificates = [agreed(result, verdict, "time_dependent" if timed else "autonomous", system, tools)]
    if other is not None:
        require(other.get("verdict") in (None, later), "with_time.verdict is not verdict_with_time.")
        certificates.append(agreed(other, later, "time_dependent", system, tools))
    found = [certified(one, tools) for one in certificates if one]
    proven = later is None or any(one and proves(one, "time_dependent", later) for one in certificates)
    if not proven or None in certificates or "undetermined" in (verdict, later):
        raise Ended("incomplete", "A verdict is undetermined, or no certificate proves it.")
    return found if result["system"].get("given") is None else [*found, "The equations as given were not compared."]


def proves(certificate: dict[str, Any], question: str, verdict: str | None) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate["claim"] == verdict and certificate["question"] in (question, wider)


def agreed(answer: dict[str, Any], verdict: str | None, question: str, system: Question, tools: Tools) -> Any:
    """The certificate of an answer, if it has one, once it is seen to speak of the same things."""
    certificate, shown = answer.get("certificate"), answer.get("lagrangian")
    if certificate is None:
        return None
    check_shape(certificate, CERTIFICATE, "certificate")
    require(proves(certificate, question, verdict), "A certificate does not claim the verdict that it stands beside.")
    require(system.content == Question(tools, certificate["system"]).content, "A certificate is about another system.")
    formula = None if shown is None else read_tokens(shown.get("text"), "lagrangian.text")
    certain = read_tokens(certificate.get("lagrangian"), "lagrangian") if certificate["kind"] == "lagrangian" else None
    require(formula == certain, "The Lagrangian of an answer is not the one that its certificate proves.")
    return certificate
