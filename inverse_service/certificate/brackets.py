"""Families of motions on constraints: which members have no Lagrangian of any associated system.

A Lagrangian of a motion gives a 2-form that Gamma keeps and that vanishes on pairs of vertical
vectors, so on all Lie derivatives of such pairs along Gamma. Each is a row of linear equations for
the components of the form. Rows are values in the ring of the family; determinants of them are
taken where some variables have values, which keeps them short. See FAMILIES.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq

from .formulas import NAME, NUMBER, Incomplete, check_shape, require
from .member_sets import Part, Polynomial, Ring, determinant
from .quotients import Quotient

ROW_OF_BRACKETS = [r"[0-9]{1,2}", 3]
MOST_ROWS, MOST_POINTS = 20, 12
VARIABLE = rf"{NAME}'?|tan\({NAME}/2\)"
POINT = dict[str, Any](values={})
Bivector = dict[tuple[int, int], Quotient]


class Motion:
    """Gamma = u d/dr + w d/ds + F d/du over the ring, and the rows of its bivectors.

    The components of vectors are those along r (the free coordinates), s, and u = r'.
    """

    def __init__(
        self, ring: Ring, free: Sequence[str], velocities: dict[str, str], equations: dict[str, str]
    ) -> None:
        self.ring, names = ring, ring.variables
        places = [names.index(one) for one in (*free, *velocities)]
        speeds = [names.index(one + "'") for one in free]
        self.axes, self.names = [*places, *speeds], names
        forces = [ring.read(equations[one]) for one in free]
        slopes = [ring.read(text) for text in velocities.values()]
        self.field = [
            *(Quotient(ring.gens[k], ring.one) for k in speeds),
            *slopes,
            *forces,
        ]
        held = {*names[1 + ring.size :]} - {names[k] for k in speeds}
        seen = {name for of in ring.functions.values() for name in of}
        seen |= {
            name
            for part in (*slopes, *forces)
            for one in part
            for name in held
            if one and one.degrees()[names.index(name)] > 0
        }
        require(not seen & held, "A motion is written in the velocities of its free coordinates.")
        self.vertical = range(len(places), len(self.axes))
        self.bends = [[ring.by(part, axis) for axis in self.axes] for part in self.field]
        self.known = dict[tuple[int, int], list[Bivector]]()

    def along(self, value: Quotient) -> Quotient:
        """The derivative along solutions."""
        ring = self.ring
        slopes = [
            (part, ring.by(value, axis)) for part, axis in zip(self.field, self.axes, strict=True)
        ]
        terms = [ring.times(part, slope) for part, slope in slopes if slope.above]
        return ring.total([ring.by(value, 0), *terms])

    def bivector(self, j: int, first: int, second: int) -> Bivector:
        """(L_Gamma)^j of the bivector of two vertical directions, without its vertical part.

        A form that vanishes on vertical pairs and on the derivatives of those before this one
        vanishes on the derivatives of the vertical part, too.
        """
        pair = self.vertical[first], self.vertical[second]
        known = self.known.setdefault((first, second), [{pair: self.ring.constant(1)}])
        while len(known) <= j:
            known.append(self.derived(known[-1]))
        return known[j]

    def derived(self, bivector: Bivector) -> Bivector:
        ring, parts = self.ring, dict[tuple[int, int], list[Quotient]]()

        def put(a: int, b: int, value: Quotient) -> None:
            if a == b or not value.above or (a in self.vertical and b in self.vertical):
                return
            if a > b:
                a, b, value = b, a, Quotient(-value.above, value.below)
            parts.setdefault((a, b), []).append(value)

        for (a, b), value in bivector.items():
            put(a, b, self.along(value))
            minus = Quotient(-value.above, value.below)
            for axis, bends in enumerate(self.bends):
                if bends[a].above:
                    put(axis, b, ring.times(minus, bends[a]))
                if bends[b].above:
                    put(a, axis, ring.times(minus, bends[b]))
        found = {pair: ring.total(values) for pair, values in parts.items()}
        return {pair: value for pair, value in found.items() if value.above}

    def missed(self, proof: dict[str, Any], part: Part) -> list[Polynomial] | None:
        """The coefficients of determinants of rows at points: where one of them is not zero, each
        form has a vertical direction in its kernel. None if the rows do not show this.
        """
        check_shape(proof.get("rows"), [ROW_OF_BRACKETS, MOST_ROWS], "rows")
        check_shape(proof.get("points"), [POINT, MOST_POINTS], "points")
        rows = [tuple(map(int, row)) for row in proof["rows"]]
        require(
            all(len(row) == 3 and row[0] < MOST_ROWS and row[1] < row[2] < len(self.vertical)
                for row in rows),
            "A row names an order and two velocities.",
        )  # fmt: skip
        found = list[Polynomial]()
        for point in proof["points"]:
            more = self.at_point(rows, point, part)
            if more is None:
                return None
            found += more
        return found

    def at_point(
        self, rows: Sequence[tuple[int, ...]], point: dict[str, Any], part: Part
    ) -> list[Polynomial] | None:
        """At one point; of the forms that satisfy the rows, those left free where the determinant
        is not zero have to have a vertical direction in their kernel.
        """
        values = self.values(point["values"])
        placed = [self.placed(self.bivector(*row), values) for row in rows]
        pairs = [
            pair
            for pair in itertools.combinations(range(len(self.axes)), 2)
            if not {*pair} <= {*self.vertical}
        ]
        matrix = [part.scaled([row.get(pair, self.ring.none) for pair in pairs]) for row in placed]
        used = [k for k in range(len(pairs)) if not all(part.vanishes([row[k]]) for row in matrix)]
        free = [pair for k, pair in enumerate(pairs) if k not in used]
        if len(used) != len(rows) or all(any(u in pair for pair in free) for u in self.vertical):
            return None
        square = [[row[k] for k in used] for row in matrix]
        square.sort(key=lambda row: sum(map(bool, row)))
        return self.ring.coefficients(determinant(self.ring, square))

    def values(self, given: dict[str, Any]) -> dict[int, Any]:
        """Values of variables on which no function depends, by generator; of tan(x/2) for a
        coordinate x written `tan(x/2)`.
        """
        check_shape([*given], [VARIABLE, 20], "variables")
        check_shape([*given.values()], [NUMBER, 20], "values")
        found = dict[int, Any]()
        for name, text in given.items():
            number = Fraction(text)
            found[self.outer(name)] = fmpq(number.numerator, number.denominator)
        return found

    def outer(self, name: str) -> int:
        """The generator of a variable on which no function depends."""
        plain = name[4:-3] if name.startswith("tan(") else name
        require(plain in self.names, f"{plain} is no variable.")
        place = self.names.index(plain)
        require(place in self.ring.outer, f"A function depends on {plain}.")
        if plain == name:
            return place
        require(place in self.ring.tangents, f"tan({plain}/2) does not occur.")
        return self.ring.tangents[place]

    def placed(self, row: Bivector, values: dict[int, Any]) -> dict[tuple[int, int], Polynomial]:
        """The row at these values, times what makes it free of divisors."""
        put = {f"g{k}": value for k, value in values.items()}
        found = {
            pair: Quotient(one.above.subs(put), one.below.subs(put)) for pair, one in row.items()
        }
        common = self.ring.one
        for one in found.values():
            if not one.below:
                raise Incomplete("A divisor of a motion vanishes at a point.")
            common = common * (one.below / common.gcd(one.below))
        return {pair: one.above * (common / one.below) for pair, one in found.items()}


def most_brackets(document: dict[str, Any]) -> int:
    """The highest order of a bivector in the proofs of a family."""
    rows = [row for cell in document["cells"] for proof in cell["proofs"]
            if proof["kind"] == "brackets" for row in proof.get("rows") or ()]  # fmt: skip
    check_shape(rows, [ROW_OF_BRACKETS, 40 * MOST_ROWS], "rows")
    return max((int(row[0]) for row in rows), default=0)
