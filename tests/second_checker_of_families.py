"""A second checker of certificates about families of two coordinates, or of motions on constraints,
written from FAMILIES.md alone.

It needs the standard library and `second_checker` only, and shares no line with the solver or with
`certificate/`. It puts members in, numbers for constants and polynomials for functions, and decides
each at random points modulo random primes: which leaf holds it, which cells do, and whether a proof
of one of these shows the verdicts that the leaf has. That a member has no Lagrangian is proven by the
rows named, or by the conditions themselves, prolonged; that it has one by the multipliers given, by
`algebra`, `isotropic` or `one_coordinate`. A `direction`, and a `completion` that says yes, are only
compared with the prolonged conditions, which have to leave a regular g. Rows of bivectors are those
along one solution, by power series in the time.

    python tests/second_checker_of_families.py CERTIFICATE.json
"""

from __future__ import annotations

import itertools
import json
import random
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.second_checker import (
    Ended,
    Taylor,
    conditions,
    determinant,
    eliminated,
    random_prime,
    read,
    require,
    up,
)

FORMAT = "inverse-service/family/1"
NUMBERS = [Fraction(one) for one in ("0", "1", "-1", "2", "-2", "1/2", "3", "-3")]
ORDERS, EACH, TRIED = (1, 2, 3), 3, 400
DERIVATIVE = re.compile(r"diff\(([A-Za-z]\w*)\(([^()]*)\)((?:,\s*[A-Za-z]\w*'?)+)\)")
CALL = re.compile(r"([A-Za-z]\w*)('+|\[[\d, ]+\])?\(([^()]*)\)")
WORD = re.compile(r"[A-Za-z]\w*")
ANGLE = re.compile(r"(sin|cos|tan)\(([A-Za-z]\w*)\)")
Verdicts = tuple[str | None, str | None]
Matrix = list[list[Taylor]]
YES, NO = "variational", "not_variational"


@dataclass(frozen=True)
class Member:
    """Numbers for constants, and polynomials {exponents: coefficient} for functions."""

    constants: dict[str, Fraction]
    functions: dict[str, dict[tuple[int, ...], Fraction]]

    def put_in(self, text: str) -> str:
        """A formula, or A - B for `A = B`, without constants and functions."""
        if "=" in text:
            left, right = text.split("=")
            text = f"({left}) - ({right})"

        def of_names(found: re.Match[str]) -> str:
            name, inner, by = found.groups()
            arguments = [one.strip() for one in inner.split(",")]
            listed = [one.strip() for one in by.split(",")[1:]]
            return self.value(name, arguments, [listed.count(one) for one in arguments])

        def of_orders(found: re.Match[str]) -> str:
            name, orders, inner = found.groups()
            if name not in self.functions:
                return found[0]
            arguments = [one.strip() for one in inner.split(",")]
            counts = [0] * len(arguments)
            if orders is not None:
                counts = [len(orders)] if orders[0] == "'" else [*map(int, orders[1:-1].split(","))]
            return self.value(name, arguments, counts)

        def of_constants(found: re.Match[str]) -> str:
            return f"({self.constants[found[0]]})" if found[0] in self.constants else found[0]

        text = CALL.sub(of_orders, DERIVATIVE.sub(of_names, text))
        return WORD.sub(of_constants, text)

    def value(self, name: str, arguments: Sequence[str], orders: Sequence[int]) -> str:
        terms = dict[tuple[int, ...], Fraction]()
        for exponents, coefficient in self.functions[name].items():
            for exponent, order in zip(exponents, orders, strict=True):
                for step in range(order):
                    coefficient *= exponent - step
            terms[tuple(a - b for a, b in zip(exponents, orders, strict=True))] = coefficient
        products = (
            "*".join((f"({c})", *(f"{x}^{e}" for x, e in zip(arguments, key, strict=True) if e)))
            for key, c in terms.items()
            if c
        )
        return f"({' + '.join(products) or '0'})"

    def __str__(self) -> str:
        parts = [f"{name} = {value}" for name, value in self.constants.items()]
        return "; ".join((*parts, *(f"{name}: {terms}" for name, terms in self.functions.items())))


class Place:
    """f of a member as Taylor series about a random point, and the rows of the conditions there."""

    def __init__(self, system: dict[str, Any], order: int) -> None:
        names, self.prime = system["coordinates"], random_prime()
        self.variables = ["t", *names, *(name + "'" for name in names)]
        self.n, self.unit = len(names), Taylor({}, (self.prime, len(self.variables), order)).constant(1)  # fmt: skip
        self.each = range(self.n)
        self.values = {
            x: self.unit.constant(random.randrange(self.prime))
            for x in [*self.variables, *(system.get("parameters") or [])]
        }
        for k, name in enumerate(self.variables):
            self.values[name] += Taylor({up((0,) * len(self.variables), k): 1}, self.unit.ring)
        self.system = system

    @cached_property
    def forces(self) -> list[Taylor]:
        return [self.read(self.system["equations"][name]) for name in self.system["coordinates"]]

    def number(self, value: Fraction) -> Taylor:
        return self.unit.constant(value.numerator * pow(value.denominator, -1, self.prime))

    def read(self, text: str) -> Taylor:
        value: Taylor = read(text, self.values, self.number)
        return value

    def vanishes(self, text: str) -> bool:
        return not self.read(text).terms

    @cached_property
    def q(self) -> range:
        return range(1, 1 + self.n)

    @cached_property
    def v(self) -> range:
        return range(1 + self.n, 1 + 2 * self.n)

    def total(self, terms: Iterator[Taylor]) -> Taylor:
        return sum(terms, self.unit.constant(0))

    def along(self, value: Taylor) -> Taylor:
        """Gamma(value)."""
        speeds = [self.unit, *(self.values[x] for x in self.variables[1 + self.n :]), *self.forces]
        return self.total(rate * value.by(k) for k, rate in enumerate(speeds))

    def product(self, a: Matrix, b: Matrix) -> Matrix:
        return [[self.total(a[i][m] * b[m][j] for m in self.each) for j in self.each] for i in self.each]  # fmt: skip

    @cached_property
    def slopes(self) -> Matrix:
        return [[f.by(k) for k in self.v] for f in self.forces]

    @cached_property
    def connection(self) -> Matrix:
        half = self.number(Fraction(-1, 2))
        return [[half * one for one in row] for row in self.slopes]

    def tensor(self, k: int) -> Matrix:
        """nabla^k Phi."""
        if k == 0:
            half, square = self.number(Fraction(1, 2)), self.product(self.slopes, self.slopes)
            two = self.number(Fraction(2))
            return [
                [
                    self.along(self.slopes[i][j]) - two * self.forces[i].by(self.q[j]) - half * square[i][j]
                    for j in self.each
                ]
                for i in self.each
            ]  # fmt: skip
        last = self.tensor(k - 1)
        plus, minus = self.product(self.connection, last), self.product(last, self.connection)
        return [
            [self.along(last[i][j]) + plus[i][j] - minus[i][j] for j in self.each]
            for i in self.each
        ]

    def row(self, name: Sequence[str]) -> dict[tuple[int, ...], int]:
        """The numbers before g_ij, i <= j, in (g T)_ij = (g T)_ji."""
        require(name[0] == "Phi", "Rows of the curvature are not checked here.", "incomplete")
        tensor, (i, j) = self.tensor(int(name[1])), map(int, name[2:])
        found, zero = dict[tuple[int, ...], int](), (0,) * len(self.variables)
        for place, value in (
            *(((i, m), tensor[m][j]) for m in self.each),
            *(((j, m), self.number(Fraction(-1)) * tensor[m][i]) for m in self.each),
        ):
            key = (min(place), max(place))
            found[key] = (found.get(key, 0) + value.terms.get(zero, 0)) % self.prime
        return {key: value for key, value in found.items() if value}

    def leave_singular(self, rows: Sequence[Sequence[str]]) -> bool | None:
        """Whether det g = 0 for all g that satisfy the rows; None if these are dependent here."""
        echelon = eliminated(map(self.row, rows), self.prime)
        return None if len(echelon) < len(rows) else not any(self.some(echelon) for _ in range(3))

    def some(self, echelon: dict[Any, Any]) -> int:
        """det g of a random solution."""
        values = dict[tuple[int, ...], int]()
        for pivot in sorted(echelon, key=lambda key: (sum(key), key)):
            rest = {key: value for key, value in echelon[pivot].items() if key != pivot}
            for key in rest:
                values.setdefault(key, random.randrange(self.prime))
            values[pivot] = -sum(x * values[key] for key, x in rest.items())
        a, b, c = (
            values.setdefault(key, random.randrange(self.prime)) for key in ((0, 0), (0, 1), (1, 1))
        )
        return (a * c - b * b) % self.prime

    def is_multiplier(self, g: Matrix, u: Sequence[Taylor], timed: bool) -> bool:
        """Whether e^u g satisfies (H1), (H2), (H3), where u has these derivatives."""
        turned, phi = self.product(g, self.connection), self.product(g, self.tensor(0))
        speeds = [self.unit, *(self.values[x] for x in self.variables[1 + self.n :]), *self.forces]
        rate = self.total(speed * slope for speed, slope in zip(speeds, u, strict=True))
        zero = [phi[0][1] - phi[1][0]]
        zero += [
            self.along(g[i][j]) + rate * g[i][j] - turned[i][j] - turned[j][i]
            for i in self.each
            for j in range(i, self.n)
        ]
        up_v = [u[k] for k in self.v]
        zero += [
            g[i][0].by(self.v[1]) + up_v[1] * g[i][0] - g[i][1].by(self.v[0]) - up_v[0] * g[i][1]
            for i in self.each
        ]
        zero += [u[a].by(b) - u[b].by(a) for a, b in itertools.combinations(range(len(u)), 2)]
        if not timed:
            zero += [u[0], *(g[i][j].by(0) for i in self.each for j in self.each)]
        zero = [one for one in zero if any(sum(key) < 2 for key in one.terms)]
        return not zero


class Flow:
    """The flow of a motion about the solution from a random point: series in the time, and of first
    order in displacements of the start. Sines, cosines and tangents of coordinates are further unknowns.
    """

    def __init__(self, system: dict[str, Any], order: int) -> None:
        self.order, self.prime, free = order, random_prime(), [*system["equations"]]
        self.displaced = (0, order + 1)  # of a weight so high that its square is left out
        self.unit = Taylor({}, (self.prime, 2, 2 * order + 1)).constant(1)
        self.axes = [*free, *system["velocities"], *(name + "'" for name in free)]
        self.vertical = range(len(self.axes) - len(free), len(self.axes))
        rates = {name: name + "'" for name in free} | system["velocities"]
        rates |= {name + "'": system["equations"][name] for name in free}
        angles = sorted({found for text in rates.values() for found in ANGLE.findall(text)})
        rates = {name: ANGLE.sub(r"\1Of\2", text) for name, text in rates.items()}
        for x in {of for _, of in angles}:
            turned = {"sin": f"cosOf{x}", "cos": f"-sinOf{x}", "tan": f"(1 + tanOf{x}^2)"}
            rates |= {f"{kind}Of{x}": f"({slope})*({rates[x]})" for kind, slope in turned.items()}
        self.rates = rates
        self.still = {x: self.random() for x in ("t", *(system.get("parameters") or ()))}
        start = {name: self.random() for name in self.axes}
        slopes = {name: {name: self.unit} for name in self.axes}
        for x in {of for _, of in angles}:
            half = self.random()
            below = self.unit + half * half
            sine, cosine = (half + half) / below, (self.unit - half * half) / below
            start |= {f"sinOf{x}": sine, f"cosOf{x}": cosine, f"tanOf{x}": sine / cosine}
            slopes[x] |= {f"sinOf{x}": cosine, f"cosOf{x}": self.number(Fraction(-1)) * sine,
                          f"tanOf{x}": self.unit / cosine / cosine}  # fmt: skip
        e = Taylor({self.displaced: 1}, self.unit.ring)
        ends = []
        for name in self.axes:
            moved = {x: e * slope for x, slope in slopes[name].items()}
            ends.append(self.solved({x: one + moved.get(x, e - e) for x, one in start.items()}))
        # The coefficients of t^k of the derivative of the flow, [k][row][column].
        self.flow = [[[end[x].terms.get((k, self.displaced[1]), 0) for end in ends] for x in self.axes]
                     for k in range(order + 1)]  # fmt: skip

    def random(self) -> Taylor:
        return self.unit.constant(random.randrange(self.prime))

    def number(self, value: Fraction) -> Taylor:
        return self.unit.constant(value.numerator * pow(value.denominator, -1, self.prime))

    def solved(self, start: dict[str, Taylor]) -> dict[str, Taylor]:
        found = start
        for _ in range(self.order):
            names = found | self.still
            found = {x: start[x] + self.integral(read(rate, names, self.number))
                     for x, rate in self.rates.items()}  # fmt: skip
        return found

    def integral(self, value: Taylor) -> Taylor:
        p = self.prime
        terms = {(a + 1, b): x * pow(a + 1, -1, p) % p for (a, b), x in value.terms.items()}
        most = value.ring[2]
        return Taylor({key: x for key, x in terms.items() if sum(key) <= most}, value.ring)

    @cached_property
    def back(self) -> list[list[list[int]]]:
        """The inverse of the flow's derivative, by powers of the time."""
        p, each = self.prime, range(len(self.axes))
        found = [[[int(i == j) for j in each] for i in each]]
        for k in range(1, self.order + 1):
            found.append([[-sum(self.flow[m][i][z] * found[k - m][z][j]
                                for m in range(1, k + 1) for z in each) % p
                           for j in each] for i in each])  # fmt: skip
        return found

    def row(self, j: int, first: int, second: int) -> dict[tuple[int, ...], int]:
        """The coefficient of t^j of the transported pair of directions."""
        found, p = dict[tuple[int, ...], int](), self.prime
        u, v = self.vertical[first], self.vertical[second]
        for x, y in itertools.combinations(range(len(self.axes)), 2):
            pairs = ((self.back[i], self.back[j - i]) for i in range(j + 1))
            found[x, y] = sum(a[x][u] * b[y][v] - a[y][u] * b[x][v] for a, b in pairs) % p
        return {key: value for key, value in found.items() if value}

    def leave_vertical(self, rows: Sequence[Sequence[str]]) -> bool:
        """Whether a random form that solves the rows, and is zero on pairs of directions, has such a
        direction in its kernel.
        """
        pairs = [*itertools.combinations(range(len(self.vertical)), 2)]
        lists = [self.row(*map(int, one)) for one in rows]
        echelon = eliminated([*(self.row(0, *pair) for pair in pairs), *lists], self.prime)
        form = dict[tuple[int, ...], int]()
        for pivot in sorted(echelon, key=lambda key: (sum(key), key)):
            rest = {key: x for key, x in echelon[pivot].items() if key != pivot}
            for key in rest:
                form.setdefault(key, random.randrange(self.prime))
            form[pivot] = -sum(x * form[key] for key, x in rest.items()) % self.prime
        places = range(len(self.axes))
        for key in itertools.combinations(places, 2):
            form.setdefault(key, random.randrange(self.prime))
        matrix = [
            {(x,): (form.get((u, x), 0) - form.get((x, u), 0)) % self.prime for x in places}
            for u in self.vertical
        ]
        kept = [{key: x for key, x in row.items() if x} for row in matrix]
        return len(eliminated(kept, self.prime)) < len(self.vertical)


@dataclass
class Shown:
    """What is proven of one member: that there is an L(q, q'), an L(t, q, q'), or none."""

    facts: set[tuple[str, bool]]  # (verdict, whether about L(t, q, q'))
    weaker: bool = False  # a proof holds that is only compared with necessary conditions

    def settles(self, verdicts: Verdicts) -> bool:
        """Whether the verdicts follow; Ended if another one does."""
        plain, timed = verdicts
        yes = {timed for verdict, timed in self.facts if verdict == YES}
        no = {timed for verdict, timed in self.facts if verdict == NO}
        require(not (plain == YES and no), "A member has no such Lagrangian.")
        require(not (plain == NO and False in yes), "A member has a Lagrangian.")
        require(not (timed == YES and True in no), "A member has no such Lagrangian.")
        require(not (timed == NO and yes), "A member has a Lagrangian.")
        good = {None: True, YES: False in yes, NO: bool(no)}[plain]
        return good and {None: True, YES: bool(yes), NO: True in no}[timed]


class Claim:
    """A certificate, and what is found of its members."""

    def __init__(self, document: dict[str, Any]) -> None:
        require(document.get("format") == FORMAT, "This is no certificate about a family.")
        self.document, self.system = document, document["system"]
        moving = self.system.get("velocities") is not None
        require(moving or len(self.system["coordinates"]) == 2, "There are not two coordinates.", "incomplete")  # fmt: skip
        names = self.system.get("functions") or {}
        self.functions = {name: len(names[name]) for name in document["functions"]}
        self.settled, self.left = dict[int, int](), dict[int, int]()
        self.seen = dict[tuple[int, ...], int]()  # members by the leaf and the cells that hold them

    def members(self, count: int) -> Iterator[Member]:
        letters = self.document["letters"]
        for _ in range(count):
            values = {name: random.choice(NUMBERS) for name in letters}
            if random.random() < 0.5:  # more often equal, opposite or zero
                few = [random.choice(NUMBERS), Fraction(0)]
                values = {name: random.choice(few) * random.choice((1, 1, -1)) for name in letters}
            yield Member(values, {name: self.polynomial(k) for name, k in self.functions.items()})

    def polynomial(self, count: int) -> dict[tuple[int, ...], Fraction]:
        kept = [random.random() < 0.6 for _ in range(count)]
        keys = [key for key in itertools.product(range(4), repeat=count) if sum(key) < 4]
        keys = [key for key in keys if not any(k and not one for k, one in zip(key, kept, strict=True))]  # fmt: skip
        return {key: random.choice(NUMBERS) for key in random.sample(keys, min(3, len(keys)))}

    def holds(self, part: dict[str, Any], member: Member, place: Place) -> bool:
        def vanishes(text: str) -> bool:
            return place.vanishes(member.put_in(text))

        return all(map(vanishes, part["equations"])) and not any(
            map(vanishes, part.get("nonzero") or ())
        )

    def look_at(self, member: Member) -> None:
        """Count whether the verdicts of its leaf are shown; Ended if others are."""
        sides = {
            key: {name: member.put_in(text) for name, text in self.system[key].items()}
            for key in ("equations", "velocities")
            if self.system.get(key) is not None
        }
        fixed = [one for one in self.system.get("parameters") or () if one not in member.constants]
        system = self.system | sides | {"parameters": fixed, "functions": {}}
        place = Place(system, 2)
        if any(self.holds(one, member, place) for one in self.document.get("open") or ()):
            return
        held = [k for k, one in enumerate(self.document["leaves"]) if self.holds(one, member, place)]  # fmt: skip
        require(held, "The first leaf does not hold all members.")
        cells = self.document["cells"]
        around = [k for k, one in enumerate(cells) if self.holds(one, member, place)]
        number, key = held[-1], (held[-1], *around)
        self.seen[key] = self.seen.get(key, 0) + 1
        if self.seen[key] > EACH:
            return
        leaf, shown = self.document["leaves"][number], Shown(set())
        for k in around:
            own = Shown(set())
            for proof in filter(None, cells[k]["proofs"]):
                self.prove(proof, member, system, own)
            own.settles(verdicts_of(cells[k]))
            shown.facts |= own.facts
            shown.weaker |= own.weaker
        good = shown.settles(verdicts_of(leaf))
        require(good or shown.weaker, f"No cell shows the verdict where {member}.", "incomplete")
        table = self.settled if good else self.left
        table[number] = table.get(number, 0) + 1

    def prove(
        self, proof: dict[str, Any], member: Member, system: dict[str, Any], shown: Shown
    ) -> None:
        kind, timed = proof["kind"], proof.get("question") == "time_dependent"
        moving = system.get("velocities") is not None
        require(moving == (kind == "brackets"), "A proof is not about such systems.")
        if kind == "brackets":
            highest = max((int(row[0]) for row in proof["rows"]), default=0)
            if Flow(system, highest).leave_vertical(proof["rows"]):
                shown.facts.add((NO, True))
        elif kind == "rank":
            rows = proof["rows"]
            highest = max((int(name[1]) for one in rows for name in one), default=0)
            if any(map(Place(system, 2 + highest).leave_singular, rows)):
                shown.facts.add((NO, True))
        elif kind == "factor" or (kind == "completion" and proof["claim"] == NO):
            if any(not leaves_regular(system, timed, order) for order in ORDERS):
                shown.facts.add((NO, timed))
        elif kind in ("direction", "completion"):
            require(leaves_regular(system, timed, ORDERS[1]), "A member has no such Lagrangian.")
            shown.weaker = True
        elif kind == "multiplier":
            if self.has_multiplier(proof, member, Place(system, 4), timed):
                shown.facts.add((YES, timed))
        elif self.is_simple(kind, Place(system, 4)):
            shown.facts.add((YES, kind == "isotropic"))

    def has_multiplier(
        self, proof: dict[str, Any], member: Member, place: Place, timed: bool
    ) -> bool:
        total, zero = [[place.unit.constant(0)] * 2 for _ in range(2)], (0,) * 5
        for term in proof["terms"]:
            try:
                a, b, c = (place.read(member.put_in(text)) for text in term["entries"])
                slopes = term.get("slopes") or {}
                u = [place.read(member.put_in(slopes.get(name) or "0")) for name in place.variables]
            except ZeroDivisionError:
                return False
            g = [[a, b], [b, c]]
            require(place.is_multiplier(g, u, timed), f"A multiplier is none where {member}.")
            weight = place.number(Fraction(random.randrange(1, 1 << 30)))
            total = [[x + weight * y for x, y in zip(*rows, strict=True)] for rows in zip(total, g, strict=True)]  # fmt: skip
        return zero in (total[0][0] * total[1][1] - total[0][1] * total[1][0]).terms

    def is_simple(self, kind: str, place: Place) -> bool:
        """What `isotropic` and `algebra` say of two coordinates."""
        if kind == "isotropic":
            tensor = place.tensor(0)
            wrong = [tensor[0][1], tensor[1][0], tensor[0][0] - tensor[1][1]]
            return not any(sum(key) <= 2 for one in wrong for key in one.terms)
        by = [[f.by(k) for k in range(1, 5)] for f in place.forces]
        if any(f.by(0).terms for f in place.forces):
            return False
        if not any(by[i][k].terms for i, k in ((0, 1), (0, 3), (1, 0), (1, 2))):
            return True
        zero = (0,) * 5
        if any({*one.terms} - {zero} for row in by for one in row):
            return False
        b, a = (
            [[row[k].terms.get(zero, 0) for k in pair] for row in by] for pair in ((0, 1), (2, 3))
        )
        p, quarter = place.prime, pow(4, -1, place.prime)

        def times(x: list[list[int]], y: list[list[int]]) -> list[list[int]]:
            return [[sum(x[i][m] * y[m][j] for m in (0, 1)) % p for j in (0, 1)] for i in (0, 1)]

        def parts(x: list[list[int]]) -> tuple[int, ...]:
            return x[0][1] % p, (x[0][0] - x[1][1]) % p, x[1][0] % p

        square = times(a, a)
        whole = [[(b[i][j] + quarter * square[i][j]) % p for j in (0, 1)] for i in (0, 1)]
        left, right = times(a, whole), times(whole, a)
        one, two = parts(whole), parts([[left[i][j] - right[i][j] for j in (0, 1)] for i in (0, 1)])
        minors = [(one[i] * two[j] - one[j] * two[i]) % p for i, j in ((0, 1), (0, 2), (1, 2))]
        return not any(parts(a)) or not any(parts(b)) or not any(minors)


def verdicts_of(part: dict[str, Any]) -> Verdicts:
    return part.get("autonomous"), part.get("time_dependent")


def leaves_regular(system: dict[str, Any], timed: bool, order: int) -> bool:
    """Whether the conditions on g = d2L/dv2 and their derivatives to this order leave a regular g at
    a random point.
    """
    size, prime = 4 + timed, random_prime()
    names = [
        [kind, i, j, list(alpha)]
        for kind, i, j in (("H2", 0, 0), ("H2", 0, 1), ("H2", 1, 1), ("H3", 0, 1))
        for alpha in itertools.product(range(order + 1), repeat=size)
        if sum(alpha) <= order - (kind == "H2")
    ]
    echelon = eliminated(map(conditions(system, timed, order, prime), names), prime)
    return determinant(echelon, 2, size, prime) != 0


def check(document: Any, count: int = TRIED) -> tuple[str, str]:
    """("agrees" | "invalid" | "incomplete", a sentence): of the members that were drawn. Never raises."""
    try:
        claim = Claim(document)
        for member in claim.members(count):
            try:
                claim.look_at(member)
            except ZeroDivisionError:
                continue  # f has no value, or another point would have to be drawn
    except Ended as end:
        return end.args[0], end.args[1]
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        return "invalid", "The certificate is malformed."
    every = range(len(document["leaves"]))
    said = ", ".join(f"leaf {k}: {claim.settled.get(k, 0)} + {claim.left.get(k, 0)}" for k in every)
    return "agrees", f"Members shown + compared: {said}."


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        verdict, sentence = check(json.load(file))
    print(f"{verdict}: {sentence}")
    sys.exit(verdict != "agrees")
