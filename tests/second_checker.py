"""A second checker of `nonexistence` certificates whose equations are rational, written from
FORMAT.md alone.

It needs the standard library only and shares no line with the solver or with `certificate/`.
Formulas are evaluated in any type of number with `+ - * /`: Taylor series about a random point
modulo a random prime, which decide; exact fractions, for the conditions at the point `near`; and
degrees, which bound the probability of error. Claims that are not rational, or about constraints,
kinds of Lagrangians, or arbitrary functions, are `incomplete`.

    python tests/second_checker.py CERTIFICATE.json
"""

from __future__ import annotations

import itertools
import json
import math
import operator
import random
import re
import sys
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
TOKEN = re.compile(
    r"\s*(\d+(?:\.\d+)?|[A-Za-z]\w*'*|\^\s*(?:-?\d+|\(-?\d+\))(?![\d.]|\s*\^)|[-+*/^()]|\Z)",
    re.ASCII,
)
FORMAT, MAX_DEGREE, MAX_POWER, MAX_TEXT = "inverse-service/certificate/2", 1 << 20, 4096, 60_000
Index = tuple[int, ...]
Row = dict[Index, int]


class Ended(Exception):
    """The check ends with ("invalid" or "incomplete", a sentence)."""


def require(condition: object, sentence: str, verdict: str = "invalid") -> None:
    if not condition:
        raise Ended(verdict, sentence)


class Degrees:
    """A bound of the degrees of numerator and denominator, and of the bits of their
    coefficients.
    """

    def __init__(self, above: int, below: int) -> None:
        require(max(above, below) <= MAX_DEGREE, "A degree may be too high.", "incomplete")
        self.above, self.below = above, below

    def __add__(self, other: Degrees) -> Degrees:
        return Degrees(
            max(self.above + other.below, other.above + self.below) + 1, self.below + other.below
        )

    __sub__ = __add__

    def __mul__(self, other: Degrees) -> Degrees:
        return Degrees(self.above + other.above, self.below + other.below)

    def __truediv__(self, other: Degrees) -> Degrees:
        return Degrees(self.above + other.below, self.below + other.above)


class Taylor:
    """A power series {multi-index: residue} in `variables` variables, truncated beyond a total
    degree.
    """

    def __init__(self, terms: Row, ring: tuple[int, int, int]) -> None:
        self.terms, self.ring = {key: value for key, value in terms.items() if value}, ring

    def constant(self, value: int) -> Taylor:
        return Taylor({(0,) * self.ring[1]: value % self.ring[0]}, self.ring)

    def combined(self, other: Taylor, sign: int) -> Taylor:
        a, b = self.terms, other.terms
        return Taylor(
            {key: (a.get(key, 0) + sign * b.get(key, 0)) % self.ring[0] for key in {**a, **b}},
            self.ring,
        )

    def __add__(self, other: Taylor) -> Taylor:
        return self.combined(other, 1)

    def __sub__(self, other: Taylor) -> Taylor:
        return self.combined(other, -1)

    def __mul__(self, other: Taylor) -> Taylor:
        total: Row = {}
        for (one, x), (two, y) in itertools.product(self.terms.items(), other.terms.items()):
            if sum(one) + sum(two) <= self.ring[2]:
                key = (*map(operator.add, one, two),)
                total[key] = (total.get(key, 0) + x * y) % self.ring[0]
        return Taylor(total, self.ring)

    def __truediv__(self, other: Taylor) -> Taylor:
        zero = (0,) * self.ring[1]
        if zero not in other.terms:
            raise ZeroDivisionError  # another point will work
        first = self.constant(pow(other.terms[zero], -1, self.ring[0]))
        rest = self.constant(1) - first * other  # has no constant term, so 1/(1 - rest) ends
        total = self.constant(1)
        for _ in range(self.ring[2]):
            total = self.constant(1) + rest * total
        return self * first * total

    def by(self, k: int) -> Taylor:
        """The derivative by variable k."""
        return Taylor(
            {up(a, k, -1): x * a[k] % self.ring[0] for a, x in self.terms.items() if a[k]},
            self.ring,
        )


def up(index: Index, k: int, by: int = 1) -> Index:
    return (*index[:k], index[k] + by, *index[k + 1 :])


def read(text: str, names: dict[str, Any], number: Callable[[Fraction], Any]) -> Any:
    """Evaluate a formula; `^` binds tightest and -x^2 is -(x^2)."""
    require(
        isinstance(text, str) and len(text) <= MAX_TEXT,
        "A formula has to be a text of moderate length.",
    )
    tokens, at = list[str](), 0
    while at < len(text):
        found = TOKEN.match(text, at)
        require(found, f"Column {at + 1} is not part of a formula.")
        tokens, at = [*tokens, found[1]], found.end()  # type: ignore[index]
    tokens.reverse()

    def take(*wanted: str) -> str:
        return tokens.pop() if tokens and tokens[-1] in wanted else ""

    def total() -> Any:
        value = product()
        while sign := take("+", "-"):
            value = value + product() if sign == "+" else value - product()
        return value

    def product() -> Any:
        value = signed()
        while sign := take("*", "/"):
            value = value * signed() if sign == "*" else value / signed()
        return value

    def signed() -> Any:
        return number(Fraction(-1)) * signed() if take("-") else power()

    def power() -> Any:
        value = operand()
        while tokens and tokens[-1][:1] == "^":
            word = tokens.pop()[1:].strip("() \t\r\n")
            require(
                word and abs(int(word)) <= MAX_POWER,
                "A power is not a moderate integral one.",
                "incomplete",
            )
            base, value = (
                value if int(word) >= 0 else number(Fraction(1)) / value,
                number(Fraction(1)),
            )
            for digit in f"{abs(int(word)):b}":
                value = value * value * base if digit == "1" else value * value
        return value

    def operand() -> Any:
        if take("("):
            value = total()
            require(take(")"), "A bracket is not closed.")
            return value
        word = tokens.pop() if tokens else ""
        require(word[:1].isalnum(), "A formula lacks an operand.")
        require(word != "pi" and tokens[-1:] != ["("], f"{word} is not rational.", "incomplete")
        require(word[0].isdigit() or word in names, f"{word} is not declared.")
        return number(Fraction(word)) if word[0].isdigit() else names[word]

    value = total()
    require(not any(tokens), "Something follows a formula.")
    return value


def conditions(
    system: dict[str, Any], timed: bool, order: int, prime: int
) -> Callable[[list[Any]], Row]:
    """The row of a name ["H2" | "H3", i, j, alpha] about a random point, in the coefficients of
    L.
    """
    names, n = system["coordinates"], len(system["coordinates"])
    variables = ["t"] * timed + names + [name + "'" for name in names]
    unit = Taylor({}, (prime, len(variables), order + 2)).constant(1)
    values = {
        x: unit.constant(random.randrange(prime))
        for x in [*variables, *(system.get("parameters") or [])]
    }
    for k, name in enumerate(variables):
        values[name] += Taylor({up((0,) * len(variables), k): 1}, unit.ring)

    def number(value: Fraction) -> Taylor:
        return unit.constant(value.numerator * pow(value.denominator, -1, prime))

    f = [read(system["equations"][name], values, number) for name in names]
    q, v, each = range(timed, timed + n), range(timed + n, timed + 2 * n), range(n)
    field = [unit] * timed + [values[name + "'"] for name in names] + f
    slope = [[f[k].by(v[j]) for j in each] for k in each]
    half, none = number(Fraction(1, 2)), unit.constant(0)
    phi = [[sum((rate * slope[k][j].by(a) for a, rate in enumerate(field)), none) - f[k].by(q[j]) - f[k].by(q[j])
            - sum((half * slope[k][i] * slope[i][j] for i in each), none) for j in each] for k in each]  # fmt: skip

    def row(name: list[Any]) -> Row:
        kind, i, j, alpha = name  # terms: factor times the derivative of L by these variables
        terms = [(rate, [k, v[i], v[j]]) for k, rate in enumerate(field)] if kind == "H2" else []
        for k in each:  # -g_ik N^k_j is + 1/2 g_ik df^k/dv^j
            terms.append((half * slope[k][j] if kind == "H2" else phi[k][j], [v[i], v[k]]))
            terms.append((half * slope[k][i] if kind == "H2" else none - phi[k][i], [v[j], v[k]]))
        found: Row = {}
        for (factor, by), gamma in ((term, gamma) for term in terms for gamma in term[0].terms):
            index, value = (*map(operator.sub, alpha, gamma),), factor.terms[gamma]
            if min(index) >= 0:
                for k in by:  # the coefficient of x^index in dF/dx_k is index_k + 1 times that of x^(index + e_k) in F
                    index = up(index, k)
                    value = value * index[k] % prime
                found[index] = (found.get(index, 0) + value) % prime
        return {key: value for key, value in found.items() if value}

    return row


def eliminated(rows: Iterable[Row], prime: int) -> dict[Index, Row]:
    """{pivot: its row, 1 there}; the pivot of a row is its last unknown of the highest degree."""
    echelon: dict[Index, Row] = {}
    for row in rows:
        while row:
            pivot = max(row, key=lambda index: (sum(index), index))
            if pivot not in echelon:
                inverse = pow(row[pivot], -1, prime)
                echelon[pivot] = {key: value * inverse % prime for key, value in row.items()}
                break
            factor, known = row[pivot], echelon[pivot]
            row = {
                key: (row.get(key, 0) - factor * known.get(key, 0)) % prime
                for key in {**row, **known}
            }
            row = {key: value for key, value in row.items() if value}
    return echelon


def determinant(echelon: dict[Index, Row], n: int, m: int, prime: int) -> int:
    """det g(p) of a random solution of the rows, modulo the prime."""
    solution: Row = {}
    for pivot in sorted(echelon, key=lambda index: (sum(index), index)):
        others = {key: value for key, value in echelon[pivot].items() if key != pivot}
        solution[pivot] = -sum(
            x * solution.setdefault(key, random.randrange(prime)) for key, x in others.items()
        )
    places = [[up(up((0,) * m, m - n + i), m - n + j) for j in range(n)] for i in range(n)]
    g = [
        [solution.setdefault(key, random.randrange(prime)) * max(key) % prime for key in line]
        for line in places
    ]
    det = 1
    for column in range(n):
        pivot = next((k for k in range(column, n) if g[k][column]), n)
        if pivot == n:
            return 0
        g[column], g[pivot] = g[pivot], g[column]
        det = det * g[column][column] % prime
        for line in g[column + 1 :]:
            factor = line[column] * pow(g[column][column], -1, prime)
            line[:] = [(a - factor * b) % prime for a, b in zip(line, g[column], strict=True)]
    return det


def random_prime() -> int:
    """A random prime between 2^60 and 2^61, by Miller and Rabin with 40 random bases."""
    while True:
        p = random.randrange(1 << 60, 1 << 61) | 1
        twos = (p - 1 & 1 - p).bit_length() - 1
        for base in (random.randrange(2, p - 1) for _ in range(40)):
            x = pow(base, p - 1 >> twos, p)
            if x != 1 and p - 1 not in (pow(x, 1 << s, p) for s in range(twos)):
                break
        else:
            return p


def check_shape(c: Any) -> None:
    """A certificate of the documented form that this checker can judge."""
    require(
        isinstance(c, dict) and c.get("format") == FORMAT, "This is not a certificate of version 2."
    )
    require(
        c.get("kind") == "nonexistence" and not c.get("among"), "Of another kind.", "incomplete"
    )
    require(
        c.get("claim") == "not_variational",
        "A certificate of kind nonexistence claims not_variational.",
    )
    require(c.get("question") in ("autonomous", "time_dependent"), "The question is not known.")
    system, order, rows = c["system"], c["order"], c["rows"]
    strange = system.get("functions") or system.get("velocities") or c.get("roots")
    require(
        not strange,
        "Arbitrary functions, constraints and roots are not checked here.",
        "incomplete",
    )
    names, listed = (
        system["coordinates"],
        [*system["coordinates"], *(system.get("parameters") or [])],
    )
    require(names and {*system["equations"]} == {*names}, "Each coordinate needs its equation.")
    require(
        all(isinstance(name, str) and NAME.fullmatch(name) for name in listed),
        "A name is malformed.",
    )
    require(len({*listed, "t", "pi"}) == len(listed) + 2, "Names have to be distinct.")
    require(
        type(order) is int and 0 <= order <= 20 and isinstance(rows, list),
        "order or rows are malformed.",
    )
    n, m = len(names), 2 * len(names) + (c["question"] == "time_dependent")
    for kind, i, j, alpha in rows:
        require(type(i) is type(j) is int and 0 <= i <= j < n, "A row names no entry of g.")
        require(kind == "H2" or (kind == "H3" and i < j), "A row is not one of H2 or H3.")
        require(
            len(alpha) == m and all(type(a) is int and a >= 0 for a in alpha),
            "A multi-index is malformed.",
        )
        require(sum(alpha) <= order - (kind == "H2"), "A row is of a higher order.")
    require(len({json.dumps(row) for row in rows}) == len(rows), "A row is named twice.")
    require(math.comb(m + order + 2, m) <= 100_000, "The series would be too long.", "incomplete")


def compare(c: Any) -> None:
    """Raise Ended unless the certificate proves its claim."""
    check_shape(c)
    system, timed, near, n = (
        c["system"],
        c["question"] == "time_dependent",
        c.get("near") or {},
        len(c["system"]["coordinates"]),
    )
    known = [
        "t",
        *system["coordinates"],
        *(x + "'" for x in system["coordinates"]),
        *(system.get("parameters") or []),
    ]
    require({*near} <= {*known}, "near contains a name that the system does not declare.")
    for text in system["equations"].values():
        unknown = dict.fromkeys(known[1 - timed :], Degrees(1, 0))
        read(text, unknown, lambda x: Degrees(x.numerator.bit_length(), x.denominator.bit_length()))
    if near or c.get("conditions"):
        point = {
            x: Fraction(near[x]) if x in near else Fraction(random.getrandbits(30), 1 << 30)
            for x in known
        }
        for text in c.get("conditions") or []:
            more, less = (
                read(side, point, Fraction)
                for side in re.split("[<>]", text)[:: 1 if ">" in text else -1]
            )
            require(
                more > less,
                "A condition does not hold.",
                "invalid" if {*near} == {*known} else "incomplete",
            )
        for text in system["equations"].values():
            read(text, point, Fraction)
    pivots = list[set[Index]]()
    while len(pivots) < 2:  # random points modulo random primes
        prime = random_prime()
        try:
            echelon = eliminated(
                map(conditions(system, timed, c["order"], prime), c["rows"]), prime
            )
        except ZeroDivisionError:
            continue
        require(
            not determinant(echelon, n, 2 * n + timed, prime),
            "The rows leave a regular multiplier g(p).",
        )
        pivots.append({*echelon})
    require(pivots[0] == pivots[1], "The pivots differ from point to point.", "incomplete")


def check(certificate: Any) -> tuple[str, str]:
    """("valid" | "invalid" | "incomplete", a sentence). Never raises."""
    try:
        compare(certificate)
    except Ended as end:
        return end.args[0], end.args[1]
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        return "invalid", "The certificate is malformed, or not defined at the point that it names."
    return "valid", "The rows, recomputed from the equations, leave only singular Hessians."


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        verdict, sentence = check(json.load(file))
    print(f"{verdict}: {sentence}")
    sys.exit(verdict != "valid")
