"""Claims about all members of a family: which of them have a Lagrangian.

The claim is a list of sets of members, the leaves; a member belongs to the last one that holds it.
The proof is a list of *cells*, sets of members too, each with proofs of its verdicts. A proof holds
for all members of its cell but those at which some of its *divisors* vanish, for all values of the
variables, and these members have to lie in other cells. See FAMILIES.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from .brackets import Motion, most_brackets
from .formulas import (
    MAX_ORDER,
    NAME,
    SYSTEM,
    TEXT,
    Incomplete,
    check_shape,
    is_irrational,
    read_tokens,
    require,
)
from .member_sets import Part, Polynomial, Ring, TooHigh, determinant, split_part
from .passive import Passive
from .quotients import Quotient

FORMAT = "inverse-service/family/1"
MAX_CELLS, MAX_EQUATIONS, MAX_COORDINATES, MAX_PARTS, MAX_DEPTH = 200, 200, 6, 400, 6
FURTHER_ORDERS = (3, 7)  # derivatives of functions beyond those in the document, tried in turn
VERDICT = "variational|not_variational"
ROW = [r"Phi|R|S|[0-9]{1,2}", 5]
TERMS = [{"entries": [TEXT, 40], "slopes?": {}}, 8]
SET = {"equations": [TEXT, MAX_EQUATIONS], "nonzero?": [TEXT, MAX_EQUATIONS]}
VERDICTS = {"autonomous?": VERDICT, "time_dependent?": VERDICT}
PROOF = {
    "kind": "rank|factor|direction|multiplier|completion|one_coordinate|algebra|isotropic|brackets",
    "claim?": VERDICT,
    "question?": "autonomous|time_dependent",
}
DOCUMENT = {
    "format": FORMAT,
    "system": {},
    "letters": [NAME, 200],
    "functions": [NAME, 20],
    "cells": [SET | VERDICTS | {"proofs": [PROOF, 8]}, MAX_CELLS],
    "leaves": [SET | VERDICTS, MAX_CELLS],
    "open?": [SET, MAX_CELLS],
}
Matrix = list[list[Quotient]]
Sets = list[list[Polynomial]]  # the polynomials of one of these vanish
Placed = tuple[Part, int]  # members, and the cell that holds them


class Failed(Exception):
    """A proof does not hold on a part."""


class Conditions:
    """f over the ring, and the conditions on a multiplier g of q'' = f: see FAMILIES.md."""

    def __init__(self, ring: Ring, forces: list[Quotient]) -> None:
        self.ring, self.forces = ring, forces
        self.n, self.span = ring.size, range(ring.size)
        self.places = [(i, j) for i in self.span for j in range(i, self.n)]
        self.q = [1 + i for i in self.span]
        self.v = [1 + self.n + i for i in self.span]
        self.known = dict[tuple[str, ...], list[Polynomial]]()
        self.curvatures = list[list[Matrix]]()

    def along(self, value: Quotient) -> Quotient:
        """The derivative along solutions."""
        ring = self.ring
        terms = [ring.by(value, 0)]
        for i in self.span:
            speed = Quotient(ring.gens[self.v[i]], ring.one)
            terms.append(ring.times(speed, ring.by(value, self.q[i])))
            terms.append(ring.times(self.forces[i], ring.by(value, self.v[i])))
        return ring.total(terms)

    def product(self, left: Matrix, right: Matrix) -> Matrix:
        ring, span = self.ring, range(len(left))
        return [
            [ring.total(ring.times(left[i][m], right[m][j]) for m in span) for j in span]
            for i in span
        ]

    def scaled(self, value: Quotient, number: Any) -> Quotient:
        return self.ring.times(value, self.ring.constant(number))

    @cached_property
    def slopes(self) -> Matrix:
        """df^i/dv^j."""
        return [[self.ring.by(f, v) for v in self.v] for f in self.forces]

    @cached_property
    def connection(self) -> Matrix:
        half = self.ring.power(self.ring.constant(-2), -1)
        return [[self.ring.times(one, half) for one in row] for row in self.slopes]

    @cached_property
    def tensors(self) -> list[Matrix]:
        """Phi, to which `tensor` adds its derivatives."""
        ring, square = self.ring, self.product(self.slopes, self.slopes)
        half = ring.power(ring.constant(2), -1)

        def entry(i: int, j: int) -> Quotient:
            rest = self.scaled(ring.by(self.forces[i], self.q[j]), 2)
            return ring.minus(
                self.along(self.slopes[i][j]), ring.plus(rest, ring.times(square[i][j], half))
            )

        return [[[entry(i, j) for j in self.span] for i in self.span]]

    def tensor(self, k: int) -> Matrix:
        """nabla^k Phi, nabla T = Gamma(T) + N T - T N."""
        while len(self.tensors) <= k:
            last, ring = self.tensors[-1], self.ring
            plus, minus = self.product(self.connection, last), self.product(last, self.connection)
            self.tensors.append(
                [
                    [
                        ring.plus(self.along(last[i][j]), ring.minus(plus[i][j], minus[i][j]))
                        for j in self.span
                    ]
                    for i in self.span
                ]
            )
        return self.tensors[k]

    def bent(self, tensor: Matrix) -> list[Matrix]:
        """dT^j_b/dv^c - dT^j_c/dv^b."""
        ring, v = self.ring, self.v
        return [
            [
                [ring.minus(ring.by(tensor[j][b], v[c]), ring.by(tensor[j][c], v[b])) for c in self.span]
                for b in self.span
            ]
            for j in self.span
        ]  # fmt: skip

    def curvature(self, k: int) -> list[Matrix]:
        """nabla^k R, nabla R^i_bc = Gamma(R^i_bc) + N^i_j R^j_bc - R^i_jc N^j_b - R^i_bj N^j_c."""
        if not self.curvatures:
            self.curvatures.append(self.bent(self.tensor(0)))
        ring, half = self.ring, self.connection
        while len(self.curvatures) <= k:
            last = self.curvatures[-1]

            def entry(i: int, b: int, c: int, last: list[Matrix] = last) -> Quotient:
                plus = [ring.times(half[i][j], last[j][b][c]) for j in self.span]
                minus = [ring.times(last[i][j][c], half[j][b]) for j in self.span]
                minus += [ring.times(last[i][b][j], half[j][c]) for j in self.span]
                return ring.minus(ring.total([self.along(last[i][b][c]), *plus]), ring.total(minus))

            self.curvatures.append(
                [[[entry(i, b, c) for c in self.span] for b in self.span] for i in self.span]
            )
        return self.curvatures[k]

    def row(self, name: Sequence[str]) -> list[Polynomial]:
        """The coefficients of g_ij, i <= j, in a condition, times what vanishes nowhere.

        ["Phi", k, i, j]: g T is symmetric at i, j for T = nabla^k Phi. ["S", k, a, b, c]: the
        cyclic sum of g_aj R^j_bc is zero for R = dT^j_b/dv^c - dT^j_c/dv^b; ["R", k, a, b, c]: for
        nabla^k of this R with T = Phi.
        """
        key = tuple(name)
        if key not in self.known:
            known = key and key[0] in ("Phi", "R", "S") and all(map(str.isdigit, key[1:]))
            require(known and len(key) > 1, "A row has another form.")
            kind, numbers = name[0], [int(one) for one in name[1:]]
            good = len(numbers) == (3 if kind == "Phi" else 4) and numbers[0] <= 4
            indices = numbers[1:]
            good = good and all(a < b for a, b in itertools.pairwise(indices))
            require(good and indices[-1] < self.n, "A row has another form.")
            table = {place: self.ring.constant(0) for place in self.places}
            if kind == "Phi":
                tensor = self.tensor(numbers[0])
                i, j = indices
                for m in self.span:
                    self.into(table, (i, m), tensor[m][j])
                    self.into(table, (j, m), self.scaled(tensor[m][i], -1))
            else:
                bend = (
                    self.curvature(numbers[0])
                    if kind == "R"
                    else self.bent(self.tensor(numbers[0]))
                )
                for turn in range(3):
                    a, b, c = (indices[(turn + step) % 3] for step in range(3))
                    for m in self.span:
                        self.into(table, (a, m), bend[m][b][c])
            self.known[key] = self.numerators([table[place] for place in self.places])
        return self.known[key]

    def into(self, table: dict[tuple[int, int], Quotient], at: Sequence[int], value: Quotient) -> None:  # fmt: skip
        place = min(at), max(at)
        table[place] = self.ring.plus(table[place], value)

    def numerators(self, values: Sequence[Quotient]) -> list[Polynomial]:
        """The values times their common divisor, without a common factor that vanishes for no
        member.
        """
        ring, below = self.ring, self.ring.one
        for value in values:
            below = below * (value.below / below.gcd(value.below))
        found = [value.above * (below / value.below) for value in values]
        common = ring.none
        for one in found:
            common = common.gcd(one) if common else one
        if not common:
            return found
        unit = ring.one
        for factor, times in common.factor()[1]:
            if not ring.unknowns(factor):
                unit = unit * factor**times
        return [one / unit for one in found]

    def matrix(self, entries: Sequence[Any]) -> list[list[Any]]:
        """The symmetric matrix with these entries, in the order of `places`."""
        table = dict(zip(self.places, entries, strict=True))
        return [[table[min(i, j), max(i, j)] for j in self.span] for i in self.span]

    def defects(self, g: Matrix, given: list[Quotient] | None, timed: bool) -> list[Quotient]:
        """What vanishes exactly if e^u g is a multiplier for a function u; u_t = 0 where L must not
        contain t.

        `given` are the derivatives of u by t, q, v; else those that follow from the conditions.
        """
        ring, found = self.ring, list[Quotient]()
        u = self.factor_slopes(g) if given is None else given
        u_v = u[1 + self.n :]
        turned = self.product(g, self.connection)
        phi = self.product(g, self.tensor(0))
        rate = ring.total([u[0]])
        for i in self.span:
            speed = Quotient(ring.gens[self.v[i]], ring.one)
            rate = ring.total([rate, ring.times(speed, u[1 + i]), ring.times(self.forces[i], u_v[i])])  # fmt: skip
        for i, j in self.places:
            found.append(ring.total([self.along(g[i][j]), ring.times(rate, g[i][j]),
                                     self.scaled(turned[i][j], -1), self.scaled(turned[j][i], -1)]))  # fmt: skip
            found.append(ring.minus(phi[i][j], phi[j][i]))
            for k in range(j):
                left = ring.plus(ring.by(g[i][j], self.v[k]), ring.times(u_v[k], g[i][j]))
                right = ring.plus(ring.by(g[i][k], self.v[j]), ring.times(u_v[j], g[i][k]))
                found.append(ring.minus(left, right))
        for a, b in itertools.combinations(range(1 + 2 * self.n), 2):
            found.append(ring.minus(ring.by(u[a], b), ring.by(u[b], a)))
        if not timed:
            found += [u[0], *(ring.by(g[i][j], 0) for i, j in self.places)]
        return [one for one in found if one.above]

    def factor_slopes(self, g: Matrix) -> list[Quotient]:
        """The derivatives of u by t, q, v that (H1) and (H2) give, for n > 1 and det g not 0."""
        ring = self.ring
        whole = self.determinant(g)
        if not whole.above:
            raise Failed
        unit = ring.power(whole, -1)
        inverse = [[ring.times(self.cofactor(g, j, i), unit) for j in self.span] for i in self.span]
        u_v = list[Quotient]()
        for k in self.span:
            j = 0 if k else 1
            u_v.append(
                ring.total(
                    ring.times(
                        inverse[i][j],
                        ring.minus(ring.by(g[i][k], self.v[j]), ring.by(g[i][j], self.v[k])),
                    )
                    for i in self.span
                )
            )
        turned = self.product(g, self.connection)
        trace = ring.total(
            ring.times(
                inverse[i][j],
                ring.minus(ring.plus(turned[i][j], turned[j][i]), self.along(g[i][j])),
            )
            for i in self.span
            for j in self.span
        )
        rate = ring.times(trace, ring.power(ring.constant(self.n), -1))
        u_q = list[Quotient]()
        for k in self.span:
            minus = [ring.times(self.slopes[m][k], u_v[m]) for m in self.span]
            u_q.append(
                ring.minus(ring.by(rate, self.v[k]), ring.total([self.along(u_v[k]), *minus]))
            )
        u_t = rate
        for k in self.span:
            speed = Quotient(ring.gens[self.v[k]], ring.one)
            u_t = ring.minus(
                u_t, ring.plus(ring.times(speed, u_q[k]), ring.times(self.forces[k], u_v[k]))
            )
        return [u_t, *u_q, *u_v]

    def determinant(self, g: Matrix) -> Quotient:
        ring = self.ring
        if len(g) == 1:
            return g[0][0]
        return ring.total(
            ring.times(
                self.scaled(g[0][j], (-1) ** j), self.determinant([[*row[:j], *row[j + 1 :]] for row in g[1:]])
            )
            for j in range(len(g))
        )  # fmt: skip

    def cofactor(self, g: Matrix, i: int, j: int) -> Quotient:
        left = [[*row[:j], *row[j + 1 :]] for k, row in enumerate(g) if k != i]
        return self.scaled(self.determinant(left), (-1) ** (i + j))


@dataclass(frozen=True)
class Cell:
    """Members with their verdicts by question, and proofs; a leaf has none."""

    equations: tuple[Polynomial, ...]
    nonzero: tuple[Polynomial, ...]
    verdicts: tuple[str | None, str | None]
    proofs: tuple[dict[str, Any], ...] = ()
    text: str = ""


@dataclass
class Family:
    """The check of one claim."""

    ring: Ring
    conditions: Conditions
    cells: list[Cell]
    leaves: list[Cell]
    open: list[Cell]  # members of which nothing is claimed
    start: Part
    motion: Motion | None = None  # on constraints: Lagrangians of any associated system count
    used: dict[int, list[Placed]] = field(default_factory=dict)

    def prove(self) -> list[str]:
        """The statements that are proven, or Ended."""
        require(
            any(not one.equations and not one.nonzero for one in self.cells),
            "No cell holds the general member.",
        )
        first = self.leaves[0] if self.leaves else None
        require(
            first is not None and not first.equations and not first.nonzero,
            "The first leaf has to hold all members.",
        )
        plain = any(one.verdicts[0] for one in (*self.cells, *self.leaves))
        require(not (plain and self.depends_on_time), "f depends on t, so L does, too.")
        for number, cell in enumerate(self.cells):
            self.used[number] = [
                placed
                for part in self.parts_of(self.start, cell)
                for placed in self.part(number, part)
            ]
        self.check_order()
        return self.statements()

    def parts_of(self, start: Part, cell: Cell) -> list[Part]:
        whole = replace(start, nonzero=(*start.nonzero, *self.units(cell.nonzero)))
        return split_part(whole, cell.equations)

    def units(self, polynomials: Iterable[Polynomial]) -> list[Polynomial]:
        return [factor for one in polynomials for factor in self.ring.factors(one)]

    def part(self, number: int, part: Part) -> list[Placed]:
        """All members of a part of a cell have its verdicts, or lie in the cells that are
        returned.
        """
        cell = self.cells[number]
        try:
            missed = [sets for proof in cell.proofs for sets in self.proof(cell, proof, part)]
            self.check_verdicts(cell)
        except Failed:
            return self.place(number, part)
        found = list[Placed]()
        for sets in missed:
            if not self.is_left_open(part, sets):
                for inner in split_part(part, sets):
                    found += self.place(number, inner)
        self.compare(cell, part, missed)
        return found

    def check_verdicts(self, cell: Cell) -> None:
        """Each verdict of a cell follows from one of its proofs."""
        proven = [self.proven(proof) for proof in cell.proofs]
        for timed, verdict in enumerate(cell.verdicts):
            covers = any(
                claim == verdict and (bool(timed) is about or (timed if verdict == "variational" else about))
                for claim, about in proven
            )  # fmt: skip
            require(verdict is None or covers, f"A verdict is not proven where {cell.text}.")

    def proven(self, proof: dict[str, Any]) -> tuple[str, bool]:
        """(verdict, whether about L(t, q, q')) of a proof."""
        kind, timed = proof["kind"], proof.get("question") == "time_dependent"
        if kind in ("rank", "brackets"):
            return "not_variational", True
        if kind == "factor" or (kind == "completion" and proof.get("claim") != "variational"):
            return "not_variational", timed
        if kind == "isotropic" or kind in ("one_coordinate", "algebra"):
            return "variational", kind == "isotropic" or self.depends_on_time
        return "variational", timed

    @cached_property
    def depends_on_time(self) -> bool:
        return any(one.degrees()[0] > 0 for f in self.conditions.forces for one in f)

    def place(self, number: int, part: Part) -> list[Placed]:
        """The other cells that hold the members of a part, which may lie in open sets, too."""
        count = len(self.cells)
        others = [k for k in range(count + len(self.open)) if k != number]
        used = self.covered(part, others, [*self.cells, *self.open], "the cells")
        return [(inner, k) for inner, k in used if k < count]

    def is_left_open(self, part: Part, system: Sequence[Polynomial]) -> bool:
        """Whether all members of a part for which a system vanishes are in one open set, as its
        equations have the factors of some of the system; this is seen without solving it.
        """
        ring, opened = self.ring, [one for one in self.open if not one.nonzero]
        if not opened:
            return False
        given = [coefficient for one in system for coefficient in ring.coefficients(one)]

        def vanishes(equation: Polynomial) -> bool:
            left = part.reduced(equation)
            if not left:
                return True
            known, most = {*map(str, ring.factors(left))}, len(left)
            return any({*map(str, ring.factors(one))} <= known
                       for one in given if len(one) <= most and ring.unknowns(one))  # fmt: skip

        return any(
            all(vanishes(whole) for one in each.equations for whole in ring.coefficients(one))
            for each in opened
        )

    def covered(
        self,
        part: Part,
        numbers: Sequence[int],
        sets: list[Cell],
        what: str,
        missed: Sets = (),  # type: ignore[assignment]
    ) -> list[Placed]:
        """Pieces that hold the members of a part together, each with one of these sets that it lies
        in; Incomplete if they do not. Pieces where one of the missed systems vanishes are left out.
        """
        order = sorted(numbers, key=lambda k: (-len(sets[k].equations), self.height(sets[k])))
        waiting, used = [part], list[Placed]()
        for _ in range(MAX_PARTS):
            if not waiting:
                return used
            here = waiting.pop()
            if any(map(here.vanishes, missed)):
                continue
            for k in order:
                if not here.vanishes(sets[k].equations):
                    continue
                left = [here.reduced(one) for one in sets[k].nonzero]
                if not all(left):
                    continue
                unsure = next((one for one in self.units(left) if one not in here.nonzero), None)
                if unsure is None:
                    used.append((here, k))
                    break
                waiting += [
                    *split_part(here, [unsure]),
                    *split_part(replace(here, nonzero=(*here.nonzero, unsure)), []),
                ]
                break
            else:
                raise Incomplete(f"Members of the family are not shown to be in {what}.")
        raise Incomplete("The sets of members have too many parts.")

    def height(self, cell: Cell) -> int:
        """The number of derivatives in the equations: fewer make a smaller set."""
        ring = self.ring
        return sum(
            sum(ring.jets[k][1])
            for one in cell.equations
            for k in ring.unknowns(one)[:1]
            if k in ring.jets
        )

    def compare(self, cell: Cell, part: Part, missed: Sets) -> None:
        """The last leaf that holds a member of the part has the same verdicts; others are missed by
        the proof.
        """
        for place, leaf in enumerate(self.leaves):
            if leaf.verdicts == cell.verdicts or self.is_left_open(part, leaf.equations):
                continue
            later = range(place + 1, len(self.leaves))
            for inner in self.parts_of(part, leaf):
                if not any(inner.vanishes(one) for one in missed):
                    sets = [*self.leaves, *self.open]
                    opened = range(len(self.leaves), len(sets))
                    try:
                        self.covered(inner, [*later, *opened], sets, "", missed)
                        continue
                    except TooHigh:
                        raise
                    except Incomplete:
                        pass
                    raise Incomplete(
                        f"Where {leaf.text or 'the member is general'}, some members have other verdicts."
                    )

    def check_order(self) -> None:
        """Of no member the cells lead back to themselves."""
        left, done = dict(self.used), set[int]()
        while left:
            ready = [k for k, used in left.items() if {m for _, m in used} <= done]
            ready = ready or [
                next((k for k, used in left.items() if self.end(used, done, MAX_DEPTH)), -1)
            ]
            if ready == [-1]:
                raise Incomplete("The cells refer to each other in a circle.")
            done |= {*ready}
            left = {k: used for k, used in left.items() if k not in done}

    def end(self, placed: Sequence[Placed], done: set[int], depth: int) -> bool:
        """Whether the members of these parts, each taken to be in its cell, end in cells that are
        done, by the proofs of the cells on the parts alone.
        """
        try:
            return all(
                k in done or (depth > 0 and self.end(self.part(k, part), done, depth - 1))
                for part, k in placed
            )
        except TooHigh:
            raise
        except Incomplete:
            self.ring.check_time()
            return False

    # The proofs: what vanishes for the members for which they do not hold.

    def proof(self, cell: Cell, proof: dict[str, Any], part: Part) -> Sets:
        kind = proof["kind"]
        if (kind == "brackets") != (self.motion is not None):
            raise Failed
        if self.motion is not None:
            return self.by_brackets(self.motion, proof, part)
        if kind == "rank":
            return self.by_rank(proof, part)
        if kind == "factor":
            return self.by_factor(proof, part)
        if kind in ("direction", "multiplier"):
            return self.by_multiplier(proof, part)
        if kind == "completion":
            return self.by_completion(proof, part)
        good = {
            "one_coordinate": lambda: self.conditions.n == 1,
            "algebra": lambda: self.is_over_an_algebra(part),
            "isotropic": lambda: self.is_isotropic(part),
        }[kind]()
        if not good:
            raise Failed
        return []

    def rows(self, names: Any) -> list[list[Polynomial]]:
        check_shape(names, [ROW, 40], "rows")
        return [self.conditions.row(name) for name in names]

    def by_brackets(self, motion: Motion, proof: dict[str, Any], part: Part) -> Sets:
        """Where a determinant is not zero, every L of the motion is singular."""
        missed = motion.missed(proof, part)
        if missed is None:
            raise Failed
        if any(map(part.is_unit, missed)):
            return []
        left = [one for one in map(part.reduced, missed) if one]
        if not left:
            raise Failed
        return [sorted(left, key=len)]

    def by_rank(self, proof: dict[str, Any], part: Part) -> Sets:
        """Where these rows are independent, all g that satisfy them are singular."""
        check_shape(proof.get("rows"), [[ROW, 40], 40], "rows")
        minors = list[Polynomial]()
        for names in proof["rows"]:
            rows = [part.scaled(row) for row in self.rows(names)]
            width = len(self.conditions.places)
            require(0 < len(rows) <= width, "A set of rows has too many or none.")
            for columns in itertools.combinations(range(width), len(rows)):
                self.ring.check_time()
                minor = self.minor(rows, columns)
                if not part.vanishes([minor]):
                    if not self.are_singular(rows, columns, minor, part):
                        raise Failed
                    if any(map(part.is_unit, self.ring.coefficients(minor))):
                        return []  # it vanishes for no member
                    minors.append(minor)
        if not minors:
            raise Failed
        return [minors]

    def minor(self, rows: Sequence[Sequence[Polynomial]], columns: Sequence[int]) -> Polynomial:
        return determinant(self.ring, [[row[k] for k in columns] for row in rows])

    def are_singular(
        self,
        rows: Sequence[Sequence[Polynomial]],
        columns: Sequence[int],
        minor: Polynomial,
        part: Part,
    ) -> bool:
        """Whether det g vanishes for each solution of the rows, by Cramer's rule for these
        columns.

        det g is a form of degree n in the free entries: it is zero if it vanishes at all of them in
        a grid of n + 1 values each.
        """
        n, width = self.conditions.n, len(self.conditions.places)
        free = [k for k in range(width) if k not in columns]
        if not free:
            return True
        grid: Iterable[tuple[int, ...]] = (
            [(1,)] if len(free) == 1 else itertools.product(range(n + 1), repeat=len(free))
        )
        for values in grid:
            entries = [self.ring.none] * width
            for k, value in zip(free, values, strict=True):
                entries[k] = minor * value
            right = [
                -sum(
                    (row[k] * value for k, value in zip(free, values, strict=True)), self.ring.none
                )
                for row in rows
            ]
            for place, column in enumerate(columns):
                replaced = [
                    [right[r] if c == place else row[k] for c, k in enumerate(columns)]
                    for r, row in enumerate(rows)
                ]
                entries[column] = determinant(self.ring, replaced)
            if not part.vanishes([determinant(self.ring, self.conditions.matrix(entries))]):
                return False
        return True

    def direction(self, names: Any, part: Part) -> list[Polynomial]:
        """The g that satisfies one row less than it has entries, up to a factor, by minors."""
        rows = [part.scaled(row) for row in self.rows(names)]
        width = len(self.conditions.places)
        require(len(rows) == width - 1, "One row less than entries is needed.")
        found = list[Polynomial]()
        for k in range(width):
            columns = [c for c in range(width) if c != k]
            minor = self.minor(rows, columns) if rows else self.ring.one
            found.append(minor if k % 2 == 0 else -minor)
        return found

    def matrix_on(self, part: Part, entries: Sequence[Polynomial]) -> Matrix:
        """The symmetric matrix on the part, up to a factor."""
        found = part.proportional(entries)
        return self.conditions.matrix([Quotient(one, self.ring.one) for one in found])

    def by_factor(self, proof: dict[str, Any], part: Part) -> Sets:
        """g is e^u times the one that satisfies the rows, and no such u exists, or det g = 0."""
        check_shape(proof.get("rows"), [[ROW, 40], 40], "rows")
        timed, choices = proof.get("question") == "time_dependent", list[Sets]()
        require(proof["rows"], "No rows are named.")
        for names in proof["rows"]:
            entries = self.direction(names, part)
            if part.vanishes(entries):
                continue
            g = self.matrix_on(part, entries)
            if part.vanishes([self.conditions.determinant(g).above]):
                choices.append([entries])
                continue
            numerators = [one.above for one in self.conditions.defects(g, None, timed)]
            if part.vanishes(numerators):
                raise Failed
            choices.append([entries, numerators])
        if not choices:
            raise Failed
        return [
            [one for chosen in chosen_sets for one in chosen]
            for chosen_sets in itertools.product(*choices)
        ]

    def by_multiplier(self, proof: dict[str, Any], part: Part) -> Sets:
        """The e^u g are multipliers, regular or not, so each sum of multiples is one, and some sum
        is regular.
        """
        ring, timed = self.ring, proof.get("question") == "time_dependent"
        terms = list[tuple[list[Quotient], list[Quotient] | None]]()
        if proof["kind"] == "direction":
            check_shape(proof.get("rows"), [ROW, 40], "rows")
            found = part.proportional(self.direction(proof["rows"], part))
            terms.append(([Quotient(one, ring.one) for one in found], None))
        else:
            count = len(self.conditions.places)
            check_shape(proof.get("terms"), TERMS, "terms")
            for term in proof["terms"]:
                require(len(term["entries"]) == count, "An entry of g is missing.")
                texts = term.get("slopes") or {}
                require({*texts} <= {*ring.variables}, "A slope is by an unknown name.")
                given = [ring.read(texts.get(name) or "0") for name in ring.variables]
                terms.append(([ring.read(one) for one in term["entries"]], given))
        matrices = [self.conditions.matrix(entries) for entries, _ in terms]
        determinants = [one.above for one in self.mixed_determinants(matrices)]
        if part.vanishes(determinants):
            raise Failed
        for g, (_, slopes) in zip(matrices, terms, strict=True):
            defects = self.conditions.defects(g, slopes, timed)
            if not part.vanishes([one.above for one in defects]):
                raise Failed
        divisors = {
            str(one.below): one.below
            for entries, slopes in terms
            for one in (*entries, *(slopes or ()))
        }
        missed = [determinants]
        for below in divisors.values():
            missed += [[factor] for factor in ring.factors(below)]
        return [sets for sets in missed if not any(part.is_unit(one) for one in sets)]

    def by_completion(self, proof: dict[str, Any], part: Part) -> Sets:
        """The completed differential conditions leave a regular g, or singular ones alone."""
        check_shape(proof.get("rows"), [ROW, 40], "rows")
        width, order = len(self.conditions.places), proof.get("order") or []
        check_shape(order, [range(width), width], "order")
        require(sorted(order) == [*range(width)], "The order names each entry of g once.")
        timed, exists = proof.get("question") == "time_dependent", proof.get("claim") == "variational"  # fmt: skip
        require(self.conditions.n > 1, "For one coordinate there is a theorem.")
        found = Passive(self.conditions, part, self.rows(proof["rows"]), order, timed)
        if found.is_singular() is exists:
            raise Failed
        return found.missed(exists)

    def mixed_determinants(self, matrices: list[Matrix]) -> list[Quotient]:
        """The coefficients of det(sum of c_k e^(u_k) g_k) in the numbers c_k, without the
        exponentials.
        """
        found = dict[tuple[int, ...], Quotient]()
        n, count = self.conditions.n, len(matrices)
        for chosen in itertools.product(range(count), repeat=n):
            whole = self.conditions.determinant([matrices[k][i] for i, k in enumerate(chosen)])
            key = tuple(sorted(chosen))
            found[key] = self.ring.plus(found[key], whole) if key in found else whole
        return list(found.values())

    def is_isotropic(self, part: Part) -> bool:
        """Phi is a multiple of 1, for two coordinates (Douglas 1941, case I)."""
        phi = self.conditions.tensor(0)
        ring = self.ring
        return self.conditions.n == 2 and part.vanishes(
            [phi[0][1].above, phi[1][0].above, ring.minus(phi[0][0], phi[1][1]).above]
        )

    def is_over_an_algebra(self, part: Part) -> bool:
        """Blocks of one coordinate, or linear ones whose A and B are polynomials in one matrix."""
        if self.depends_on_time:
            return False
        ring, c, n = self.ring, self.conditions, self.conditions.n
        by = {
            (i, j): [ring.by(c.forces[i], k[j]) for k in (c.q, c.v)]
            for i in range(n)
            for j in range(n)
        }
        linked = {pair for pair, slopes in by.items() if not part.vanishes([one.above for one in slopes])}  # fmt: skip
        blocks = list[set[int]]()
        for i in range(n):
            joined = {i}
            for block in [one for one in blocks if any((a, i) in linked or (i, a) in linked for a in one)]:  # fmt: skip
                joined |= block
                blocks.remove(block)
            blocks.append(joined)
        return all(len(one) == 1 or self.is_linear(sorted(one), by, part) for one in blocks)

    def is_linear(self, block: list[int], by: dict[tuple[int, int], Any], part: Part) -> bool:
        ring = self.ring
        stiffness = [[by[i, j][0] for j in block] for i in block]
        damping = [[by[i, j][1] for j in block] for i in block]
        entries = [one for matrix in (stiffness, damping) for row in matrix for one in row]
        variables = range(len(ring.variables))
        if not part.vanishes([ring.by(one, k).above for one in entries for k in variables]):
            return False

        def is_scalar(matrix: Matrix) -> bool:
            wrong = [
                ring.minus(one, matrix[0][0]) if i == j else one
                for i, row in enumerate(matrix)
                for j, one in enumerate(row)
            ]
            return part.vanishes([one.above for one in wrong])

        if is_scalar(stiffness) or is_scalar(damping):
            return True
        if len(block) > 2:
            return False
        # Minors of the conditions for -Phi = B + A^2/4 and its commutator with A.
        quarter = ring.power(ring.constant(4), -1)
        square = self.conditions.product(damping, damping)
        tensor = [[ring.plus(one, ring.times(quarter, two)) for one, two in zip(*rows, strict=True)]
                  for rows in zip(stiffness, square, strict=True)]  # fmt: skip
        left, right = (
            self.conditions.product(damping, tensor),
            self.conditions.product(tensor, damping),
        )
        turned = [[ring.minus(one, two) for one, two in zip(*rows, strict=True)]
                  for rows in zip(left, right, strict=True)]  # fmt: skip
        first, second = ((m[0][1], ring.minus(m[0][0], m[1][1]), m[1][0]) for m in (tensor, turned))
        minors = [
            ring.minus(ring.times(first[i], second[j]), ring.times(first[j], second[i]))
            for i, j in itertools.combinations(range(3), 2)
        ]
        return part.vanishes([one.above for one in minors])

    def statements(self) -> list[str]:
        """One sentence for each leaf, the most special first, after the sets that are open."""
        found = [f"Nothing is claimed of members with {one.text}." for one in self.open]
        if self.ring.general:
            found.insert(0, f"What follows holds for general {', '.join(self.ring.general)}.")
        before, about = bool(self.open), "" if self.motion is None else " of any associated system"
        shown = [one for one in self.leaves[1:] if not self.is_open(one)]
        for leaf in reversed(shown):
            what = "For all members with" if not before else "For all others with"
            found.append(f"{what} {leaf.text}: {_said(leaf.verdicts)}{about}.")
            before = True
        rest = "For all other members" if before else "For all members"
        return [*found, f"{rest}: {_said(self.leaves[0].verdicts)}{about}."]

    def is_open(self, leaf: Cell) -> bool:
        """Whether nothing is claimed of any member of a leaf."""
        if self.is_left_open(self.start, leaf.equations):
            return True
        try:
            for part in self.parts_of(self.start, leaf):
                self.covered(part, range(len(self.open)), self.open, "")
        except Incomplete:
            return False
        return True


def _said(verdicts: tuple[str | None, str | None]) -> str:
    plain, timed = verdicts
    if plain == "variational":
        return "a Lagrangian L(q, q')"
    if timed == "variational":
        return "a Lagrangian L(t, q, q')" + (", none without t" if plain else "")
    return "no regular Lagrangian" if timed else "no regular Lagrangian L(q, q')"


def orders_in(texts: Iterable[str]) -> int:
    """A bound of the orders of derivatives in formulas."""
    most = 0
    for text in texts:
        for side in tokens_of(text):
            for token in side:
                name, _, listed = token.rstrip("]").partition("[")
                order = sum(map(int, listed.split(","))) if listed else name.count("'")
                most = max(most, order)
    return most


def tokens_of(text: str) -> list[tuple[str, ...]]:
    """The tokens of the sides of an equation."""
    check_shape(text, TEXT, "a formula")
    return [read_tokens(side, "a formula") for side in text.split("=")]


def arguments_of(document: dict[str, Any], functions: dict[str, list[str]]) -> dict[str, list[str]]:
    """What each function is a function of: the names in its place in the formulas."""
    found = dict[str, list[str]]()
    for text in texts_of(document):
        for tokens in tokens_of(text):
            for k, token in enumerate(tokens):
                name = token.rstrip("'").partition("[")[0]
                if name in functions and name not in found and tokens[k + 1 : k + 2] == ("(",):
                    end = tokens.index(")", k)
                    found[name] = [one for one in tokens[k + 2 : end] if one != ","]
    require(
        all(len(of) == len(functions[name]) for name, of in found.items()),
        "A function has another number of arguments.",
    )
    return functions | found


def texts_of(document: dict[str, Any]) -> Iterator[str]:
    yield from document["system"]["equations"].values()
    yield from (document["system"].get("velocities") or {}).values()
    for part in document["cells"]:
        for proof in part["proofs"]:
            if proof.get("terms") is not None:
                check_shape(proof["terms"], TERMS, "terms")
                for term in proof["terms"]:
                    yield from (*term["entries"], *(term.get("slopes") or {}).values())
    for part in (*document["cells"], *document["leaves"], *(document.get("open") or ())):
        yield from (*part["equations"], *(part.get("nonzero") or ()))


def complete_family(document: Any, deadline: float) -> list[str]:
    """The statements that a document proves, or Ended."""
    check_shape(document, DOCUMENT, "certificate")
    system = document["system"]
    check_shape(system, SYSTEM, "system")
    coordinates, functions = system["coordinates"], system.get("functions") or {}
    parameters, equations = system.get("parameters") or [], system["equations"]
    velocities = system.get("velocities") or {}
    require(
        sorted((*equations, *velocities)) == sorted(coordinates),
        "The system has to be solved for q'', and for the velocities of dependent coordinates.",
    )
    check_shape(functions, {name: [rf"{NAME}'?", 6] for name in functions}, "functions")
    check_shape([*functions], [NAME, 20], "functions")
    names = [*coordinates, *parameters, *functions]
    require(
        len({*names}) == len(names) and "t" not in names and "pi" not in names,
        "Each name has to be declared once.",
    )
    letters = document["letters"]
    require(
        {*letters} <= {*parameters} and {*document["functions"]} <= {*functions},
        "A free constant or function is not declared.",
    )
    if len(coordinates) > MAX_COORDINATES:
        raise Incomplete("Families are proven for few coordinates.")
    variables = {"t", *coordinates, *(name + "'" for name in coordinates)}
    functions = arguments_of(document, functions)
    for of in functions.values():
        if not of or not {*of} <= variables or len({*of}) != len(of):
            raise Incomplete("Families are proven for functions of t, coordinates and velocities.")
    order = orders_in(texts_of(document)) + most_brackets(document)
    if order > MAX_ORDER:
        raise Incomplete("A derivative of a function has too high an order.")
    fixed = [name for name in parameters if name not in letters]
    general = [name for name in functions if name not in document["functions"]]
    irrational = any(is_irrational(one) for text in texts_of(document) for one in tokens_of(text))
    least = order + (FURTHER_ORDERS[0] if functions else 0)
    for most in (least, order + FURTHER_ORDERS[1]):
        ring = Ring(coordinates, letters, fixed, functions, most, deadline, irrational, general)
        try:
            return _proven(ring, document)
        except TooHigh:  # fewer generators make the arithmetic faster
            if most > least:
                raise
        except (ZeroDivisionError, RecursionError, MemoryError) as problem:
            raise Incomplete("A formula of the family could not be computed.") from problem
    raise AssertionError


def _proven(ring: Ring, document: dict[str, Any]) -> list[str]:
    system, motion = document["system"], None
    if system.get("velocities"):
        free = [name for name in system["coordinates"] if name in system["equations"]]
        motion = Motion(ring, free, system["velocities"], system["equations"])
        forces = motion.field[len(free) :]
    else:
        forces = [ring.read(system["equations"][name]) for name in system["coordinates"]]
    # Members at which f has no value are none.
    defined = [
        factor
        for f in forces
        for factor in ring.factors(f.below)
        if len(ring.coefficients(factor)) == 1
    ]
    units = [one for factor in defined for whole in ring.coefficients(factor) for one in ring.factors(whole)]  # fmt: skip
    start = Part(ring, (), tuple({str(one): one for one in units}.values()))
    cells, leaves, opened = (
        [_set(ring, one) for one in document.get(key) or []] for key in ("cells", "leaves", "open")
    )
    about = Conditions(ring, forces)
    return Family(ring, about, cells, leaves, opened, start, motion).prove()


def _set(ring: Ring, part: dict[str, Any]) -> Cell:
    return Cell(
        tuple(ring.read(one).above for one in part["equations"]),
        tuple(ring.read(one).above for one in part.get("nonzero") or ()),
        (part.get("autonomous"), part.get("time_dependent")),
        tuple(part.get("proofs") or ()),
        text_of(part),
    )


def text_of(part: dict[str, Any]) -> str:
    """The equations and inequations of a set, as statements name it."""
    equal = [one if "=" in one else f"{one} = 0" for one in part["equations"]]
    return ", ".join((*equal, *(f"{one} != 0" for one in part.get("nonzero") or ())))
