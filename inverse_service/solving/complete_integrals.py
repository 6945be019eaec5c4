"""Whether the first integrals found are all that are polynomials in the velocities up to a degree,
with a certificate.

Their number is known before they are: Gamma F = 0, prolonged at one point modulo a prime, bounds it
whatever the coefficients. The checker (`certificate.conserved`) proves that products of the known
integrals are so many, or says how many are possible; then those of this degree are sought until
the number is reached.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb
from typing import Any, NamedTuple

from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import AllIntegrals
from inverse_service.expressions import tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.mechanics.first_integrals import (
    FirstIntegral,
    independent_integrals,
    independent_products,
    more_integrals,
    unconstrained_motion,
)

# Orders beyond the degree, unknowns, and products of integrals that a proof may take; unknowns of a
# proof that is tried at once, some 0.01 s.
_MORE_ORDERS, _MOST_UNKNOWNS, _MOST_PRODUCTS, _FEW_UNKNOWNS = 8, 3_000, 200, 500
# The part of the time that no search for integrals takes: what is known to be complete is proven.
_FOR_PROOF = 0.2


class Completed(NamedTuple):
    """First integrals, and a proof that they are all up to a degree, if there is one."""

    integrals: tuple[FirstIntegral, ...]
    proof: AllIntegrals | None = None


class Products(NamedTuple):
    """Integrals, and products of them by their places."""

    trees: Sequence[ex.Expression]
    chosen: Sequence[tuple[int, ...]]


class Room(NamedTuple):
    """The order whose equations leave room for as many integrals as are known, or how many there
    seem to be; None where unknown.
    """

    order: int | None = None
    possible: int | None = None


def with_higher(
    analysis: deciding.Analysis, found: Sequence[FirstIntegral], seed: int, limit: float
) -> Completed:
    """The integrals, with others that there are, and the proof up to which degree these are all.

    `limit` is in seconds. Only systems without arbitrary functions whose f is a polynomial in the
    velocities have such a proof.
    """
    end, system = now() + limit, analysis.system
    # A result shows f as it was given, not as it is on one of its branches.
    is_given = tuple(system.given) == tuple(system.accelerations)
    if (
        system.functions
        or system.positive
        or not is_given
        or any(degree_of(f) is None for f in system.accelerations)
    ):
        return Completed(tuple(found))
    known = _Known(analysis, tuple(found), seed, end, limit * _FOR_PROOF)
    claim = known.highest()
    known.prefer_polynomials()
    if claim is None:
        return Completed(known.found)
    used = claim["integrals"]
    others = tuple(one for one in known.others if to_text(one.expression) in used)
    proof = AllIntegrals(claim["degree"], claim["number"], system.depends_on_time, claim, others)
    return Completed(known.found, proof)


class _Known:
    """The integrals of a system: those `found`, and `others` that depend on them as functions but
    are no combinations of their products.
    """

    def __init__(
        self,
        analysis: deciding.Analysis,
        found: tuple[FirstIntegral, ...],
        seed: int,
        end: float,
        for_proof: float,
    ) -> None:
        self.analysis, self.seed, self.end, self.for_proof = analysis, seed, end, for_proof
        self.found, self.others = found, tuple[FirstIntegral, ...]()
        self.timed = analysis.system.depends_on_time
        self.motion = unconstrained_motion(analysis.system)
        self.rooms = dict[tuple[int, int], int | None]()

    def highest(self) -> Mapping[str, Any] | None:
        """The claim of the highest degree that is proven.

        A claim of one degree is one of all lower ones, so that no other is checked. Where the known
        ones seem to be all of degree 1, often they are up to the highest one, and the degrees
        between are not looked at, while that is quick; else they say what is missing.
        """
        known, top = list[tuple[int, Products]](), checker.MAX_DEGREE
        for degree in range(1, top + 1):
            found = self.completed(degree)
            if found is None:  # complete to a degree only if it is to all lower ones
                break
            known.append((degree, found))
            if degree == 1 and self.unknowns(top, top + 2) <= _FEW_UNKNOWNS:
                whole = self.products(top)
                if len(whole.chosen) <= _MOST_PRODUCTS and (claim := self.proven(whole, top)):
                    return claim
        claims = (self.proven(found, degree) for degree, found in reversed(known))
        return next(filter(None, claims), None)

    def completed(self, degree: int) -> Products | None:
        """The products that seem to be all of a degree, after a search for those that there are;
        None if some are missing.
        """
        for _ in range(2):
            known = trees, products = self.products(degree)
            if len(products) > _MOST_PRODUCTS:
                return None
            order, possible = self.room_for(len(products), degree)
            if order is not None:
                return known
            if possible is None or self.timed:
                return None
            more = more_integrals(
                self.motion,
                self.found,
                trees,
                products,
                degree,
                possible - len(products),
                self.seed,
                self.end - self.for_proof - now(),
            )
            self.found += tuple(one for one, independent in more if independent)
            self.others += tuple(one for one, independent in more if not independent)
            if len(more) < possible - len(products):
                return None
        return None

    def products(self, degree: int) -> Products:
        """The integrals that are polynomials, and their independent products up to a degree; all
        of these where they are too many.
        """
        every = (one.expression for one in (*self.found, *self.others))
        trees = [
            tree
            for tree in every
            if (self.timed or not ex.holds(tree, ex.TIME)) and (degree_of(tree) or 0) > 0
        ]
        found = list(_products([degree_of(tree) or 0 for tree in trees], degree))
        if 1 < len(found) <= _MOST_PRODUCTS:
            found = independent_products(self.motion, trees, found, self.seed)
        return Products(trees, found)

    def prefer_polynomials(self) -> None:
        """Take polynomials for the independent integrals where others of the same functions were
        found first.
        """
        every = [*self.found, *self.others]
        degrees = [degree_of(one.expression) for one in every]
        if not self.others or None not in degrees[: len(self.found)]:
            return
        order = sorted(range(len(every)), key=lambda k: (degrees[k] is None, degrees[k] or 0, k))
        kept = independent_integrals(self.motion, [every[k] for k in order], self.seed)
        # As they are written in the claims, which the list of a result has to contain.
        taken = tuple(every[k] for k, one in zip(order, kept, strict=True) if one is not None)
        if len(taken) == len(self.found):
            left = (k for k, one in zip(order, kept, strict=True) if one is None)
            self.found = taken
            self.others = tuple(every[k] for k in left if degrees[k] is not None)

    def unknowns(self, degree: int, order: int) -> int:
        n = len(self.analysis.system.coordinates)
        return comb(n + degree, n) * comb(n + self.timed + order, order)

    def room_for(self, number: int, degree: int) -> Room:
        """The order that leaves room for so many; how many there are, if two orders agree about
        more.
        """
        last = None
        for order in range(degree + 1, degree + _MORE_ORDERS + 1):
            if self.unknowns(degree, order) > _MOST_UNKNOWNS:
                break
            if (degree, order) not in self.rooms:
                if now() > self.end:
                    break
                self.rooms[degree, order] = self.counted.up_to(degree, order, self.left())
            possible = self.rooms[degree, order]
            if possible == number:
                return Room(order)
            if possible is None or possible < number:
                break
            if possible == last:
                return Room(possible=possible)
            last = possible
        return Room()

    @cached_property
    def counted(self) -> checker.PossibleIntegrals:
        return checker.PossibleIntegrals(self.claim(Products((), ()), 1, 2))

    def left(self) -> float:
        return max(0.1, self.end - now())

    def proven(self, known: Products, degree: int) -> Mapping[str, Any] | None:
        """The claim that there are no others of a degree, if an order proves it."""
        order = self.room_for(len(known.chosen), degree).order
        if order is None:
            return None
        claim = self.claim(known, degree, order)
        left = max(self.for_proof, self.left())  # a search may end late
        return claim if checker.check_certificate(claim, left).verdict == "valid" else None

    def claim(self, known: Products, degree: int, order: int) -> dict[str, Any]:
        """The document of the claim."""
        system = self.analysis.system
        names: list[ex.Symbol | ex.Velocity] = [*map(ex.Symbol, system.coordinates), ex.TIME]
        names += map(ex.Velocity, system.coordinates)
        equations = zip(system.coordinates, map(to_text, system.accelerations), strict=True)
        used = sorted({place for one in known.chosen for place in one})
        return {
            "format": checker.FORMAT_OF_INTEGRALS,
            "system": {
                "coordinates": list(system.coordinates),
                "equations": dict(equations),
                "parameters": list(system.parameters),
                "functions": {},
            },
            "question": "time_dependent" if self.timed else "autonomous",
            "near": certify.near_of(
                self.analysis.real_point, [*names, *map(ex.Symbol, system.parameters)]
            ),
            "degree": degree,
            "order": order,
            "number": len(known.chosen),
            "integrals": [to_text(known.trees[place]) for place in used],
            "products": [[used.index(place) for place in chosen] for chosen in known.chosen],
        }


def degree_of(tree: ex.Expression) -> int | None:
    """The degree as a polynomial in the velocities as it is written; None if it is none."""
    match tree:
        case ex.Velocity():
            return 1
        case ex.Sum(terms):
            degrees = [degree_of(term) for term in terms]
            return None if None in degrees else max(d for d in degrees if d is not None)
        case ex.Product(factors):
            degrees = [degree_of(factor) for factor in factors]
            return None if None in degrees else sum(d for d in degrees if d is not None)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1 and exponent > 0:
            inside = degree_of(base)
            return None if inside is None else inside * int(exponent)
    return None if ex.has(tree, ex.Velocity) else 0


def _products(degrees: Sequence[int], most: int) -> Iterator[tuple[int, ...]]:
    """The products of integrals up to a degree, short ones first, by their places."""
    for count in range(most + 1):
        for chosen in combinations_with_replacement(range(len(degrees)), count):
            if sum(degrees[k] for k in chosen) <= most:
                yield chosen
