"""Claims about a motion on constraints, s' = w(t, q, u) with q = (r, s), r' = u, u' = F(t, q, u): see FORMAT.md."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import product
from typing import Any

from .checker import Claims, Question, Tools
from .formulas import MAX_ORDER, MAX_ROWS, NAME, RESERVED, SYSTEM, Ended, Reader, check_shape, read_tokens, require
from .numbers import Arithmetic, Number, Series
from .series import MAX_MONOMIALS, Elimination, Expansion, Row, Table


class MotionExpansion(Expansion):
    """Power series in x = (t?, q, u), and the conditions on L = l + lambda_a mu^a, mu^a = s^a' - w^a.

    An unknown is a coefficient of L of mu-degree at most 1; its degree is one less than that of its monomial in x and
    mu. Its key has a degree that is two more, like that of the unknowns of g.
    """

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        question = arithmetic.question
        self.question, self.arithmetic, self.degree, self.settle = question, arithmetic, degree, arithmetic.settle
        size, free, bound = len(question.variables), len(question.free), len(question.bound)
        self.shift, self.n = 8 * (size + bound), len(question.coordinates)
        self.all_units = [(1 << 8 * a) | (1 << self.shift) for a in range(size + bound)]
        self.units, self.mu, self.lift = self.all_units[:size], range(size, size + bound), 1 << self.shift
        self.v, self.q = range(size - free, size), range(size - free - self.n, size - free)
        self.table, self.unknowns = cache(self.condition), cache(self.coefficients)
        if math.comb(size + bound + degree, degree) > MAX_MONOMIALS:
            raise Ended("incomplete", f"Series of more than {MAX_MONOMIALS} terms would be needed.")
        self.names = {name: {0: value} for name, value in arithmetic.values.items()}
        for name, unit in zip(question.variables, self.units, strict=True) if degree else ():
            self.names[name][unit] = arithmetic.number(Fraction(1))
        self.ties = list[Series]()
        read = question.read_all(self)
        self.forces, self.rates = read[:free], read[free:]
        one = self.constant(Fraction(1))
        for name, a in zip(question.bound, self.mu, strict=True) if degree else ():
            self.names[name + "'"] = self.add([self.names[name + "'"], {self.all_units[a]: one[0]}])
        self.field = [
            *[one] * question.timed, *(self.names[name + "'"] for name in question.free), *self.rates, *self.forces
        ]  # fmt: skip
        self.slopes = [[self.derivative(rate, v) for v in self.v] for rate in self.rates]

    def coefficients(self, degree: int) -> list[int]:
        transverse = (key + self.all_units[a] for a in self.mu for key in self.monomials(degree))
        return [key + self.lift for key in (*self.monomials(degree + 1), *transverse)]

    def condition(self, kind: str, i: int, j: int) -> Table:
        """Terms value x^part d_a d_b L or value x^part d_a L, by their parts; see row()."""
        table, minus, slopes = Table(), self.constant(Fraction(-1)), self.slopes
        s = self.q[len(self.v) :]
        if kind == "free":  # Gamma(d_u L) - d_r L - w^a_u d_s L + (X(w^b) - Gamma(w^b_u)) d_mu L
            terms = [(rate, (self.v[i], a)) for a, rate in enumerate(self.field)] + [(minus, (self.q[i],))]
            terms += [(self.add([slope[i]], [-1]), (a,)) for slope, a in zip(slopes, s, strict=True)]
            terms += [(self.curving(i, b), (self.mu[b],)) for b in range(len(s))]
        else:  # Gamma(d_mu L) - d_s L + (d_s w^b) d_mu L
            terms = [(rate, (self.mu[i], a)) for a, rate in enumerate(self.field)] + [(minus, (s[i],))]
            terms += [(self.derivative(rate, s[i]), (a,)) for rate, a in zip(self.rates, self.mu, strict=True)]
        for factor, by in terms:
            raised = self.lift + sum(self.all_units[a] for a in by)
            for part, value in factor.items():
                found = (value, raised, 8 * by[0], 8 * by[-1], len(by), by[0] == by[-1])
                table.setdefault(part, []).append(found)
        return table

    def curving(self, i: int, b: int) -> Series:
        """X_i(w^b) - Gamma(dw^b/du^i), X_i = d/dr^i + w^a_i d/ds^a."""
        s, rate = self.q[len(self.v) :], self.rates[b]
        across = [(slope[i], self.derivative(rate, a)) for slope, a in zip(self.slopes, s, strict=True)]
        along = [(x, self.derivative(self.slopes[b][i], a)) for a, x in enumerate(self.field)]
        found = [self.multiply(*pair, self.degree) for pair in (*across, *along)]
        return self.add([self.derivative(rate, self.q[i]), *found], [1] + [1] * len(across) + [-1] * len(along))

    def row(self, kind: str, i: int, j: int, alpha: int) -> Series:
        """The coefficient alpha of a condition, in the coefficients of L."""
        table, row, exponents = self.table(kind, i, j), Series(), [alpha >> 8 * a & 255 for a in range(len(self.units))]
        powers = [[unit * e for e in range(most + 1)] for unit, most in zip(self.units, exponents, strict=True) if most]
        for rest in (alpha - sum(choice) for choice in product(*powers)):
            for value, raised, first, second, count, same in table.get(alpha - rest, ()):
                key = rest + raised
                times = (key >> first & 255) * ((key >> second & 255) - same if count == 2 else 1)
                row[key] = row.get(key, 0) + value * times
        return self.settle(row)

    def rows(self, degree: int) -> Iterator[Row]:
        for kind, count in (("free", len(self.v)), ("dependent", len(self.mu))):
            for i in reversed(range(count)):
                yield from ((kind, i, 0, alpha) for alpha in reversed([*self.monomials(degree - 1)]))

    def matrix(self, elimination: Elimination) -> list[list[Number]]:
        """Random combinations of the rows of [d2l/du du; dlambda/du] of a random solution: regular for full rank."""
        solution = elimination.solution([key for degree in (0, 1) for key in self.unknowns(degree)])
        rows = [[solution.get(key + self.lift, 0) * times for key, times in row] for row in self.second()]
        return [
            [sum([x * row[b] for x, row in zip(weights, rows, strict=True)]) for b in range(len(self.v))]
            for weights in self.question.mixing
        ]

    def second(self) -> list[list[tuple[int, int]]]:
        """Of each d2L/dv dv with v in u, mu: its monomial and factor."""
        places, units = (*self.v, *self.mu), self.all_units
        return [[(units[a] + units[b], 1 + (a == b)) for b in places] for a in places]


class Motion(Question):
    """A motion on constraints, and the checks of certificates about its Lagrangians."""

    def __init__(self, tools: Tools, document: Any, timed: bool = True, claim: Any = None) -> None:
        super().__init__(tools, document, timed, claim)
        generator = self.generator
        self.mixing = [[generator.randrange(1, 1 << 20) for _ in self.coordinates] for _ in self.free]

    def read_system(self, document: Any) -> None:
        check_shape(document, SYSTEM | {"velocities": {}}, "system")
        self.coordinates, self.parameters = document["coordinates"], document.get("parameters") or []
        self.functions, equations, rates = (
            document.get("functions") or {},
            document["equations"],
            document["velocities"],
        )
        check_shape(list(self.functions.items()), [(NAME, [NAME, 6]), 1000], "system.functions")
        self.free, self.bound = list(equations), list(rates)
        names = [*self.coordinates, *self.parameters, *self.functions]
        good = self.free and all(self.functions.values()) and sorted(names) == sorted({*names} - RESERVED)
        good = good and {*self.coordinates[: len(self.free)]} == {*equations}
        good = good and sorted(self.coordinates) == sorted([*self.free, *self.bound])
        require(good, "system has to name the coordinates with equations first, then those with velocities.")
        self.free, self.bound = self.coordinates[: len(self.free)], self.coordinates[len(self.free) :]
        self.force_texts = [read_tokens(equations[name], f"system.equations.{name}") for name in self.free]
        self.force_texts += [read_tokens(rates[name], f"system.velocities.{name}") for name in self.bound]

    def read_all(self, ring: Any) -> list[Any]:
        """As of other systems; then the velocities of the dependent coordinates have names too."""
        found = super().read_all(ring)
        for name, rate in zip(self.bound, found[len(self.free) :], strict=True):
            ring.names[name + "'"] = dict(rate) if isinstance(rate, dict) else rate
        return found

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return MotionExpansion(arithmetic, degree)

    def listed(self, document: dict[str, Any]) -> tuple[list[Row], int]:
        kinds, exponents, m = {"free": self.free, "dependent": self.bound}, range(MAX_ORDER + 1), len(self.variables)
        index = range(len(self.coordinates))
        shape = {"order": exponents, "rows": [("free|dependent", index, (exponents,) * m), MAX_ROWS]}
        check_shape(document, shape, "certificate")
        require(
            all(i < len(kinds[kind]) for kind, i, _ in document["rows"]), "A row names an equation that is not there."
        )
        shift, rows = 8 * (m + len(self.bound)), list[Row]()
        for kind, i, alpha in document["rows"]:
            require(sum(alpha) < document["order"], "A multi-index has to have a total below the order.")
            rows.append((kind, i, 0, sum(e << 8 * a for a, e in enumerate(alpha)) | sum(alpha) << shift))
        rows.sort(key=lambda row: (row[3] >> shift, row[0], *(-index for index in row[1:])))  # this fills in least
        return rows, max((row[3] >> shift for row in rows), default=0) + 2

    def lagrangian(self, document: dict[str, Any]) -> str:
        """The conditions hold for the 1-jet of L along the constraints, and its Hessian there is regular."""
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")
        require(self.timed or "t" not in formula, "The Lagrangian contains t, but the question does not.")
        named = [
            *(("free", i, name) for i, name in enumerate(self.free)),
            *(("dependent", i, name) for i, name in enumerate(self.bound)),
        ]

        def claims(ring: Any) -> Claims:
            lagrangian, zeros = Reader(ring, formula).value, []
            for kind, i, name in named:
                terms = [value * lagrangian.get(key - ring.lift, 0) for key, value in ring.row(kind, i, 0, 0).items()]
                residual = ring.settle({0: sum(terms, ring.arithmetic.number(Fraction(0)))})
                zeros.append((residual, f"The Euler-Lagrange equation of {name} does not hold on the constraints."))
            hessian = [[lagrangian.get(key, 0) * times for key, times in row] for row in ring.second()]
            return Claims(zeros, [(hessian, "The Hessian of the Lagrangian is singular on the constraints.")])

        self.prepare(lambda ring: Reader(ring, formula).value, [formula])
        self.settle(2, claims, 3 if self.rational else 2)
        return (
            "The Euler-Lagrange equations of the Lagrangian hold on the constraints and its Hessian is regular there."
        )
