"""Whether the first integrals found are all that are polynomials in the velocities up to a degree,
with a certificate.

Their number is known before they are: Gamma F = 0, prolonged at one point modulo a prime, bounds it
whatever the coefficients. Products of the known integrals are counted; where there is room for
more, those of this degree are sought until the number is reached. The checker
(`certificate.conserved`) proves that it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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

# Orders beyond the degree, unknowns, and products of integrals that a proof may take.
_MORE_ORDERS, _MOST_UNKNOWNS, _MOST_PRODUCTS = 8, 3_000, 200


class Completed(NamedTuple):
    """First integrals, and a proof that they are all up to a degree, if there is one."""

    integrals: tuple[FirstIntegral, ...]
    proof: AllIntegrals | None = None


class Counted(NamedTuple):
    """The order at which the number of integrals is known, and this number; 0 and None if not."""

    order: int
    number: int | None


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
    known = _Known(analysis, tuple(found), seed, end)
    claims = list[Mapping[str, Any]]()
    for degree in range(1, checker.MAX_DEGREE + 1):
        claim = known.completed(degree)
        if claim is None:  # complete to a degree only if it is to all lower ones
            break
        claims.append(claim)
    known.prefer_polynomials()
    for claim in reversed(claims):
        if checker.check_certificate(claim, max(0.1, end - now())).verdict == "valid":
            used = {claim["integrals"][place] for one in claim["products"] for place in one}
            others = tuple(one for one in known.others if to_text(one.expression) in used)
            proof = AllIntegrals(
                claim["degree"], claim["number"], system.depends_on_time, claim, others
            )
            return Completed(known.found, proof)
    return Completed(known.found)


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
    ) -> None:
        self.analysis, self.seed, self.end = analysis, seed, end
        self.found, self.others = found, tuple[FirstIntegral, ...]()
        self.timed = analysis.system.depends_on_time
        self.motion = unconstrained_motion(analysis.system)

    def completed(self, degree: int) -> Mapping[str, Any] | None:
        """The claim that there are no others of a degree, after a search for those that there are;
        None if some are missing.
        """
        for _ in range(2):
            every = (one.expression for one in (*self.found, *self.others))
            trees = [
                tree
                for tree in every
                if (self.timed or not ex.holds(tree, ex.TIME)) and (degree_of(tree) or 0) > 0
            ]
            products = list(_products([degree_of(tree) or 0 for tree in trees], degree))
            if len(products) > _MOST_PRODUCTS:
                return None
            products = independent_products(self.motion, trees, products, self.seed)
            order, count = self.number(degree, len(products))
            if count == len(products):
                return self.claim(trees, products, degree, order)
            if count is None or count < len(products) or self.timed:
                return None
            more = more_integrals(
                self.motion,
                self.found,
                trees,
                products,
                degree,
                count - len(products),
                self.seed,
                self.end - now(),
            )
            self.found += tuple(one for one, independent in more if independent)
            self.others += tuple(one for one, independent in more if not independent)
            if not more:
                return None
        return None

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

    def number(self, degree: int, known: int) -> Counted:
        """It is known if it is that of the known ones, and taken to be if two orders agree."""
        n, last = len(self.analysis.system.coordinates), None
        for order in range(degree + 1, degree + _MORE_ORDERS + 1):
            unknowns = comb(n + degree, n) * comb(n + self.timed + order, order)
            if unknowns > _MOST_UNKNOWNS or now() > self.end:
                break
            claim = self.claim([], [()], degree, order)
            count = checker.most_integrals(claim, max(0.1, self.end - now()))
            if count is None or count <= known or count == last:
                return Counted(order, count)
            last = count
        return Counted(0, None)

    def claim(
        self,
        trees: Sequence[ex.Expression],
        products: Sequence[tuple[int, ...]],
        degree: int,
        order: int,
    ) -> Mapping[str, Any]:
        """The document of the claim."""
        system = self.analysis.system
        names: list[ex.Symbol | ex.Velocity] = [*map(ex.Symbol, system.coordinates), ex.TIME]
        names += map(ex.Velocity, system.coordinates)
        equations = zip(system.coordinates, map(to_text, system.accelerations), strict=True)
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
            "number": len(products),
            "integrals": [to_text(tree) for tree in trees],
            "products": [list(chosen) for chosen in products],
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
