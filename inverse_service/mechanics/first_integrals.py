"""First integrals of a motion, with or without constraints: F = sum c_a m_a with Gamma(F) = 0,
which is linear in c.

The m_a are products of at most two momenta (or velocities, or linear forms that L holds squared)
times functions of the coordinates: monomials, the sines and cosines of f and L, roots of the sums
that they divide by, terms of the potential. At random points modulo a prime the c are the kernel of
a matrix; where they hold parameters they are found again exactly, for the few terms of one
integral, over the ring of the motion, and this is the proof that Gamma(F) = 0. Of all integrals
those are given that are independent: the rank of their differentials at a point grows with each.

Noether: for L the integral F = eta_i p_i - K belongs to the symmetry q_i -> q_i + s eta_i, eta_i =
dF/dp_i.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, reduce
from typing import Literal

import numpy as np

from inverse_service import errors
from inverse_service.deadline import OutOfTime, check, now
from inverse_service.expressions import (
    calculus,
    collecting,
    polynomials,
    printing,
    terms as tm,
    tree as ex,
)
from inverse_service.field import exact_field, flow, matrices, modular, tower
from inverse_service.mechanics import (
    euler_lagrange,
    grading,
    moves,
    second_order_system,
    writing,
)

Expression = ex.Expression
# Terms of one ansatz, without and with constraints: 400 take 0.3 to 1 s; with more the degree of
# the functions of position is lowered. The angular momentum in spherical coordinates needs 192
# linear ones, found in 0.2 s.
_MOST_TERMS, _MOST_LINEAR, _MOST_WITH_CONSTRAINTS = 130, 200, 400
# So many samples more than unknowns; points for one without roots that do not exist; doublings of
# their number.
_SPARE, _DRAWN, _DOUBLED = 6, 64, 5
# Terms that are solved for at once: fewer do not take longer than the degrees.
_FEW_TERMS = 60
# Coordinates beyond which only the energy and momenta are looked for.
_MOST_COORDINATES = 12
# Functions of several coordinates with more nodes are no factors.
_LONGEST_UNIT = 40
# A symmetry that is longer says nothing to a reader.
_LONGEST_SYMMETRY = 160
_WORDS = {1: "linear", 2: "quadratic", 3: "cubic", 4: "quartic"}
# The highest total degree of the coefficients of linear integrals and of others, and the most terms.
_HIGHEST, _MOST_HIGHER = (4, 8), 1_500
_NO_RING = (exact_field.TooLarge, ZeroDivisionError, KeyError, errors.IrreducibleAtoms)


@dataclass(frozen=True, slots=True)
class FirstIntegral:
    """A function of (t, q, v) that is constant along the motion; `symmetry` is what Noether's
    theorem makes it from, and `number` counts those of a kind.
    """

    kind: str
    expression: Expression
    symmetry: str = ""
    number: int = 1

    @property
    def name(self) -> str:
        """Energy, then energy (2), and so on."""
        return self.kind if self.number == 1 else f"{self.kind} ({self.number})"


@dataclass(frozen=True, slots=True)
class _Ansatz:
    """Forms (linear in the velocities), functions of t and q, and terms: the places of their forms
    and function.

    The `degree` is that of the terms in the forms; `timed`: powers of t are among the functions.
    """

    forms: tuple[Expression, ...]
    factors: tuple[Expression, ...]
    terms: tuple[tuple[tuple[int, ...], int], ...]
    degree: int = 1
    timed: bool = False

    def tree(self, place: int) -> Expression:
        forms, factor = self.terms[place]
        return ex.multiply(*(self.forms[k] for k in forms), self.factors[factor])


def energy_of(
    lagrangian: Expression,
    velocities: Sequence[ex.Velocity],
    shorten: Callable[[Expression], Expression],
) -> Expression:
    """sum v p - L: the terms of L as they are where each is homogeneous in the velocities; of the
    others what multiplies each logarithm or arctangent together, and what is left.
    """
    moving = [
        a
        for a in ex.distinct_nodes((lagrangian,))
        if isinstance(a, ex.Apply) and ex.holds(a, *velocities)
    ]
    letters = {a: ex.Symbol(f"_{place}") for place, a in enumerate(moving)}
    found: list[Expression] = []
    others: dict[Expression, list[Expression]] = {}
    for term in ex.summands(lagrangian):
        work = ex.add(
            *(v * calculus.differentiate(term, v) for v in velocities if ex.holds(term, v))
        )
        degree = next(
            (d for d in (0, 1, 2, 3, 4) if collecting.collect(work - d * term) == ex.ZERO), None
        )
        if degree is not None:
            found.append((degree - 1) * term)
            continue
        rest = collecting.collect(ex.substitute(work - term, letters))
        for part in ex.summands(rest):
            atoms = ex.multiply(*(f for f in ex.factors_of(part) if f in letters.values()))
            others.setdefault(atoms, []).append(part / atoms)
    back = {letter: a for a, letter in letters.items()}
    whole = (
        shorten(ex.substitute(ex.add(*parts), back)) * ex.substitute(atoms, back)
        for atoms, parts in others.items()
    )
    return ex.add(*whole, *found)


def unconstrained_motion(
    system: second_order_system.SecondOrderSystem,
) -> second_order_system.ConstrainedMotion:
    """A system without constraints as a motion."""
    names = system.coordinates
    return second_order_system.ConstrainedMotion(
        names, names, (), (), system.accelerations, system.parameters, system.functions
    )


def first_integrals(
    motion: second_order_system.ConstrainedMotion,
    lagrangian: Expression | None,
    seed: int = 1,
    time_limit: float = 2.0,
    proposed: Sequence[FirstIntegral] = (),
) -> tuple[FirstIntegral, ...]:
    """Independent first integrals, the energy first, then momenta, linear ones, quadratic ones.

    `lagrangian` is that of the motion, or of the system with constraints; those `proposed` come
    after the linear ones, and are taken if they are conserved.
    """
    work = _Integrals(motion, lagrangian, seed, now() + time_limit)
    with suppress(*_NO_RING, OutOfTime, ValueError):
        work.find(proposed)
    return tuple(work.kept)


def more_integrals(
    motion: second_order_system.ConstrainedMotion,
    known: Sequence[FirstIntegral],
    trees: Sequence[Expression],
    products: Sequence[Sequence[int]],
    degree: int,
    count: int,
    seed: int = 1,
    time_limit: float = 2.0,
) -> tuple[tuple[FirstIntegral, bool], ...]:
    """Integrals of a degree in the velocities that are no combinations of products of `trees`, and
    whether each is independent, as a function, of those before and of the known ones.

    The coefficients are products of letters of growing total degree, until there are `count`: in
    turn letters of f, these and functions of the coordinates that f does not hold, and of half the
    angles.
    For systems of which it is known that there are so many: others are searched without success.
    """
    work = _Integrals(motion, None, seed, now() + time_limit)
    found = list[tuple[FirstIntegral, bool]]()
    with suppress(*_NO_RING, OutOfTime, ValueError):
        for one in known:
            work._keep(one, one.expression)
        choices = [
            work.units.of_degree(work.velocities, degree, letters)
            for letters in work.units.alphabets()
        ]
        timed = [one.expression for one in known if ex.holds(one.expression, ex.TIME)]
        in_turn = itertools.chain.from_iterable(itertools.zip_longest(*choices))
        rest = filter(None, in_turn)
        of_known: _Ansatz | None = work.from_others([*timed, *trees], degree)
        terms = of_known
        while terms is not None:
            fresh = 0
            for part in [terms] if terms is of_known else work.by_weight(terms):
                for one in work.outside(part, trees, products, degree):
                    before = len(work.kept)
                    independent = work._keep(one, one.expression)
                    found.append((work.kept[before] if independent else one, independent))
                    trees, products = [*trees, one.expression], [*products, (len(trees),)]
                    fresh += 1
                    if len(found) == count:
                        return tuple(found)
            again = fresh and terms is not of_known
            terms = of_known = work.from_others([*timed, *trees], degree) if again else None
            terms = terms or next(rest, None)
    return tuple(found)


def independent_integrals(
    motion: second_order_system.ConstrainedMotion, integrals: Sequence[FirstIntegral], seed: int
) -> tuple[FirstIntegral | None, ...]:
    """Each that is independent, as a function, of those before, and None for the others."""
    work, found = _Integrals(motion, None, seed, float("inf")), list[FirstIntegral | None]()
    for one in integrals:
        found.append(work.kept[-1] if work._keep(one, one.expression) else None)
    return tuple(found)


def independent_products(
    motion: second_order_system.ConstrainedMotion,
    trees: Sequence[Expression],
    products: Sequence[tuple[int, ...]],
    seed: int = 1,
) -> list[tuple[int, ...]]:
    """The products of functions that are no combinations of those before, by values modulo a
    prime.
    """
    work = _Integrals(motion, None, seed, float("inf"))
    values = work.values_of(trees, products)
    return [()] if values is None else [products[k] for k in matrices.pivots(values.T, flow.PRIME)]


class _Integrals:
    """The work for one motion; its results are in `kept`, on the constraints in `functions`."""

    def __init__(
        self,
        motion: second_order_system.ConstrainedMotion,
        lagrangian: Expression | None,
        seed: int,
        deadline: float,
    ) -> None:
        self.motion, self.lagrangian, self.deadline = motion, lagrangian, deadline
        self.names = motion.coordinates
        self.constraints = dict(motion.on_constraints)
        self.free = tuple(map(ex.Velocity, motion.free))
        self.positions, self.velocities = (
            tuple(map(ex.Symbol, self.names)),
            tuple(map(ex.Velocity, self.names)),
        )
        self.momenta = (
            ()
            if lagrangian is None
            else tuple(self._momentum(lagrangian, name) for name in motion.free)
        )
        # What varies along the motion; values of what does not, for which all roots of constants
        # exist.
        self.moving: tuple[modular.Variable, ...] = (ex.TIME, *self.positions, *self.velocities)
        self.constants: dict[flow.Generator, int] = {}
        self.drawn: flow.Evaluation | None = None
        self.kept: list[FirstIntegral] = []
        self.functions: list[Expression] = []
        # By forms: whether an integral without t, or t plus a function without t, is linear in
        # them. The derivatives by t of an integral of an autonomous motion are integrals; the last
        # one that is not constant is such a one.
        self.rises: dict[tuple[Expression, ...], bool] = {}
        held = [
            *motion.free_accelerations,
            *motion.dependent_velocities,
            *([] if lagrangian is None else [lagrangian]),
        ]
        self.moves = any(ex.holds(tree, ex.TIME) for tree in held)
        self.trees = held
        self.in_kernels: dict[Expression, Expression] = {}
        self.random = np.random.default_rng(seed)

    @cached_property
    def units(self) -> "_Units":
        """The functions of position, which are not asked for where there are many coordinates."""
        return _Units(self)

    def find(self, proposed: Sequence[FirstIntegral]) -> None:
        """All of them, into `kept`."""
        self._evident()
        if len(self.names) <= _MOST_COORDINATES:
            frames = list(self._frames())
            for forms in frames:
                if forms != self.momenta and any(
                    not isinstance(form, ex.Velocity) for form in forms
                ):
                    for degree in (1, 2):
                        self._search(self.units.ansatz(forms, degree, False, "constants"))
            frames = [
                one for one in frames if self.constraints or one in (self.momenta, self.velocities)
            ]
            for degree, timed in ((1, False), (2, False), (1, True)):
                if degree == 2 and not timed:
                    self._propose(proposed)
                for forms in frames:
                    if self._is_complete(timed) or (
                        timed and (self.moves or len(forms) > 4 - degree)
                    ):
                        break
                    if timed and not self.rises.get(forms, True):
                        continue
                    self._search(self.units.ansatz(forms, degree, timed))
            self._scale()

    def _is_complete(self, timed: bool) -> bool:
        """Whether there are as many as there can be: all solutions are known then."""
        return len(self.kept) >= len(self.names) + len(self.free) - (not timed and not self.moves)

    def _evident(self) -> None:
        """The energy, and the momenta of coordinates that L does not hold."""
        if self.lagrangian is None:
            return
        if not ex.holds(self.lagrangian, ex.TIME):
            self._propose([FirstIntegral("energy", self.energy, "t -> t + s")])
        for name in self.names:
            if not ex.holds(self.lagrangian, ex.Symbol(name)):
                p = self._shortest(calculus.differentiate(self.lagrangian, ex.Velocity(name)))
                self._propose([FirstIntegral(f"momentum of {name}", p, f"{name} -> {name} + s")])

    @cached_property
    def energy(self) -> Expression:
        """sum v p - L; 0 without L."""
        if self.lagrangian is None:
            return ex.ZERO
        return energy_of(self.lagrangian, self.velocities, self._shortest)

    def _scale(self) -> None:
        """Integrals tau H - eta_i p_i + K that belong to scalings of time and place, K
        quadratic.
        """
        if self.constraints or self.lagrangian is None:
            return
        q, n = self.positions, len(self.positions)
        nodes = ex.distinct_nodes(self.trees)
        powers = {e for node in nodes for base, e in ex.powers_of(node) if base == ex.TIME}
        times = [
            ex.TIME**e for e in sorted({Fraction(0), *(e + k for e in powers for k in (-1, 0))})
        ]
        squares = [a * b for a, b in itertools.combinations_with_replacement(q, 2)]
        functions = [time * square for time in times for square in squares]
        factors = (ex.TIME, ex.TIME**2, *q, *(ex.TIME * a for a in q), *functions)
        terms: list[tuple[tuple[int, ...], int]] = [((n,), 0), ((n,), 1)]
        terms += [((i,), 2 + i + k * n) for k in (0, 1) for i in range(n)]
        terms += [((), 2 + 2 * n + k) for k in range(len(functions))]
        forms = (*self.momenta, self.energy)
        self._search(_Ansatz(forms, factors, tuple(terms), timed=True))

    def _momentum(self, lagrangian: Expression, name: str) -> Expression:
        """That of a free coordinate: dL/du, the dependent velocities being functions of the free
        ones.
        """
        slopes: list[tuple[Expression, Expression]] = [(ex.Velocity(name), ex.ONE)]
        slopes += [
            (v, calculus.differentiate(w, ex.Velocity(name))) for v, w in self.constraints.items()
        ]
        parts = (
            self._short(calculus.differentiate(lagrangian, v)) * slope
            for v, slope in slopes
            if slope != ex.ZERO
        )
        return ex.add(*parts)

    def _propose(self, candidates: Iterable[FirstIntegral]) -> None:
        for one in candidates:
            tree = self._on_constraints(one.expression)
            # Integral signs have derivatives as trees only.
            rate = self.motion.rate(tree)
            try:
                ring, _ = self._ring([rate])
                conserved = ring.value(rate).is_zero
            except _NO_RING:
                continue
            if conserved:
                self._keep(one, tree)

    def _on_constraints(self, tree: Expression) -> Expression:
        return (
            collecting.collect(ex.substitute(tree, self.constraints)) if self.constraints else tree
        )

    def _keep(self, one: FirstIntegral, tree: Expression) -> bool:
        """Take it if it is independent of those before, by the gradients in q and v: d_t F follows
        from these.
        """
        rows = self._gradient_rows([*self.functions, tree])
        if rows is not None:
            if not _are_independent(rows):
                return False
        elif self.functions or not self._moves(
            tree
        ):  # a root of a number that has none modulo the prime
            return False
        self.functions.append(tree)
        number = 1 + sum(each.kind == one.kind for each in self.kept)
        constants = tuple(map(ex.Symbol, self.motion.parameters))
        written = moves.write(STYLE, constants, one.expression)
        self.kept.append(FirstIntegral(one.kind, written, one.symmetry, number))
        return True

    def _gradient_rows(
        self, trees: Sequence[Expression], fixed: Mapping[flow.Generator, int] | None = None
    ) -> list[flow.Numbers] | None:
        """The gradients in q and v at one point of the motion; None where the prime has none for
        all.
        """
        points, jets = self._along(
            list(map(tower.to_kernels, trees)), _DRAWN, fixed, wanted="gradients"
        )
        if not points.good.any():
            return None
        first = int(np.argmax(points.good))
        return [jet.data[1:, 0, first] for jet in jets]

    def _moves(self, tree: Expression) -> bool:
        """Whether a function depends on a velocity."""
        slopes = [calculus.differentiate(tree, v) for v in self.free]
        ring, _ = self._ring(slopes)
        return any(not ring.value(slope).is_zero for slope in slopes)

    # Points modulo a prime.

    def _along(
        self,
        kernels: Sequence[Expression],
        count: int,
        fixed: Mapping[flow.Generator, int] | None = None,
        moving: tuple[modular.Variable, ...] = (),
        wanted: Literal["rates", "gradients"] = "rates",
    ) -> tuple[flow.Points, list[flow.Jet]]:
        """Points of the motion, and for each tree its value and rate, or its gradients in q and v,
        at them.

        Those of the search before serve again where they are enough, and with them what was
        evaluated there.
        """
        rates = {v: tower.to_kernels(w) for v, w in self.constraints.items()}
        forces = dict(
            zip(self.free, map(tower.to_kernels, self.motion.free_accelerations), strict=True)
        )
        units = flow.Units.of([*kernels, *rates.values(), *forces.values()])
        if wanted == "rates" and (last := self.drawn) is not None and last.points.count >= count:
            points = last.points
            if (points.units, points.fixed, points.moving) == (units, fixed or {}, moving):
                return points, [last.jet(tree) for tree in kernels]
        points = flow.Points(self.names, units, count, self.random, fixed or {}, moving=moving)
        velocities, width = list(map(ex.Velocity, self.names)), len(self.names)
        q, v = (np.zeros((width, 2, count), np.int64) for _ in range(2))
        q[:, 0] = [points.value(("variable", x)) for x in self.positions]
        v[:, 0] = [points.value(("variable", w)) if w in forces else q[0, 1] for w in velocities]

        def evaluation(order: int, size: int) -> flow.Evaluation:
            found = flow.Evaluation(points, self.names, q[:, :order], v[:, :order], size)
            for dependent in rates:
                found.known.pop(dependent)
            found.known.update({dependent: found.jet(w) for dependent, w in rates.items()})
            return found

        if wanted == "gradients":
            at_once = evaluation(1, 1 + 2 * width)
            return points, [at_once.jet(tree) for tree in kernels]
        start = evaluation(1, 1)
        q[:, 1] = [start.jet(w).data[0, 0] for w in velocities]
        v[:, 1] = [start.jet(forces[w]).data[0, 0] if w in forces else v[0, 1] for w in velocities]
        self.drawn = evaluation(2, 1)
        return points, [self.drawn.jet(tree) for tree in kernels]

    def _search(self, ansatz: _Ansatz) -> None:
        """Integrals of the form."""
        candidates = self._candidates(ansatz) if ansatz.terms else []
        if ansatz.degree == 1 and not ansatz.timed and not self.moves:
            self.rises[ansatz.forms] = bool(candidates)
            candidates = [
                one for one in candidates if ansatz.factors[ansatz.terms[max(one)][1]] != ex.TIME
            ]
        known, gradients = self._gradients(ansatz, candidates) or ([], [])
        for number, candidate in enumerate(candidates):
            if self._is_complete(ansatz.timed):
                return
            check()
            if now() > self.deadline:
                return
            # Left out before it is found exactly; nothing is claimed of it.
            if gradients and not _are_independent([*known, gradients[number]]):
                continue
            try:
                vector = self._exact(ansatz, list(candidate))
            except _NO_RING:
                continue
            if (
                vector is not None
                and self._keep(*self._written(ansatz, vector, ansatz.degree))
                and gradients
            ):
                known.append(gradients[number])

    def _gradients(
        self, ansatz: _Ansatz, candidates: Sequence[Mapping[int, int]]
    ) -> tuple[list[flow.Numbers], list[flow.Numbers]] | None:
        """The gradients in q and v of the functions found, and of the candidates, at one point;
        None without a point.

        The constants have the values for which the candidates are conserved.
        """
        if len(self.functions) + len(candidates) < 2 or not candidates or self.drawn is None:
            return None
        drawn = self.drawn.points.values.items()
        constants = {key: int(x[0]) for key, x in drawn if not ex.holds(key[1], *self.moving)}
        places = list(dict.fromkeys(place for candidate in candidates for place in candidate))
        rows = self._gradient_rows([*self.functions, *map(ansatz.tree, places)], constants)
        if rows is None:
            return None
        known, terms = (
            rows[: len(self.functions)],
            dict(zip(places, rows[len(self.functions) :], strict=True)),
        )
        found = []
        for candidate in candidates:
            total = np.zeros_like(rows[0])
            for place, c in candidate.items():
                total = (total + c * terms[place]) % flow.PRIME
            found.append(total)
        return known, found

    def _sampled(self, kernels: Sequence[Expression], wanted: int) -> list[flow.Numbers] | None:
        """(value, rate) of trees at so many points with the same constants, each (2, wanted)."""
        count = max(_DRAWN, wanted + wanted // 4)
        for _ in range(_DOUBLED):
            points, jets = self._along(kernels, count, self.constants, self.moving)
            good = np.flatnonzero(points.good)[:wanted]
            if len(good) == wanted:
                check(1 + wanted * wanted // 100)
                return [jet.data[0][:, good] for jet in jets]
            if len(good):
                count *= 2
            else:  # a root of a constant, which exists for others
                points, _ = self._along(kernels, _DRAWN)
                if not points.good.any():
                    return None
            first = int(np.argmax(points.good))
            drawn = points.values.items()
            self.constants = {
                key: int(x[first]) for key, x in drawn if not ex.holds(key[1], *self.moving)
            }
        return None

    def values_of(
        self,
        trees: Sequence[Expression],
        products: Sequence[Sequence[int]],
        more: Sequence[Expression] = (),
    ) -> flow.Numbers | None:
        """The values of products of trees, and of more trees, at points, (products, points)."""
        wanted = len(products) + len(more) + _SPARE
        pairs = self._sampled([*map(tower.to_kernels, (*trees, *more))], wanted)
        if pairs is None:
            return None
        rows = [pair[0] for pair in pairs]

        def product(chosen: Sequence[int]) -> flow.Numbers:
            one = np.ones(wanted, np.int64)
            return reduce(lambda total, k: total * rows[k] % flow.PRIME, chosen, one)

        return np.stack([*map(product, products), *rows[len(trees) :]])

    def from_others(self, trees: Sequence[Expression], degree: int) -> _Ansatz:
        """What is conserved because others are: Poisson brackets, derivatives, and what is left of
        functions of t.
        """
        still = [tree for tree in trees if not ex.holds(tree, ex.TIME)]
        every = dict.fromkeys(
            itertools.chain(
                self._brackets(still), self._derivatives(still), self._without_time(trees)
            )
        )
        fitting = tuple(tree for tree in every if tree not in trees and _degree(tree) == degree)
        return _Ansatz(fitting, (ex.ONE,), tuple(((k,), 0) for k in range(len(fitting))))

    def _brackets(self, trees: Sequence[Expression]) -> Iterator[Expression]:
        """The Poisson brackets of two of the integrals, with the first quadratic one of a regular
        Hessian g(q) as the energy, preferably a constant one.

        With p = g v, dF/dq at constant p is F_q - F_v g^-1 (g_q v). Brackets that are not
        conserved, because it is not the energy, drop out later.
        """
        hessians = [euler_lagrange.hessian(tree, self.names) for tree in trees]
        constant = [all(isinstance(x, ex.Number) for row in g for x in row) for g in hessians]
        order = sorted(range(len(trees)), key=lambda k: not constant[k])
        pairs = ((hessians[k], self._inverse_of(hessians[k])) for k in order)
        metric, inverse = next(((g, inv) for g, inv in pairs if inv is not None), (None, None))
        if metric is None or inverse is None:
            return
        places = range(len(self.names))
        turned = {
            q: [
                ex.dot(
                    row,
                    [calculus.differentiate(ex.dot(line, self.velocities), q) for line in metric],
                )
                for row in inverse
            ]
            for q in self.positions
        }
        slopes = []
        for tree in trees:
            by_v = [calculus.differentiate(tree, v) for v in self.velocities]
            by_q = [
                calculus.differentiate(tree, q) - ex.dot(by_v, turned[q]) for q in self.positions
            ]
            slopes.append((by_q, by_v))
        for (q, v), (other_q, other_v) in itertools.combinations(slopes, 2):
            terms = (
                inverse[i][j] * (q[i] * other_v[j] - v[j] * other_q[i])
                for i in places
                for j in places
            )
            with suppress(*_NO_RING):
                yield self._short(_without_content(ex.add(*terms)))

    def _derivatives(self, trees: Sequence[Expression]) -> Iterator[Expression]:
        """Those by coordinates that f does not hold."""
        free = [q for q in self.positions if not ex.holds(ex.add(*self.trees), q)]
        slopes = (calculus.differentiate(tree, q) for tree in trees for q in free)
        return (tree for tree in slopes if tree != ex.ZERO)

    def _without_time(self, trees: Sequence[Expression]) -> Iterator[Expression]:
        """The resultants and discriminants in t of integrals that are polynomials of degree 1 and 2
        in t, for a motion without t.

        Along a motion their roots in t move together with t, so that differences of roots are
        conserved, as are leading coefficients.
        """
        if any(ex.holds(tree, ex.TIME) for tree in self.trees):
            return
        parts = [one for one in map(_in_powers_of_time, trees) if len(one) > 1]
        lines, squares = ([one for one in parts if len(one) == size] for size in (2, 3))
        pairs = itertools.combinations(lines, 2)
        sums: list[tuple[Expression, ...]] = [(a * d, -b * c) for (b, a), (d, c) in pairs]
        sums += [(b**2, -4 * a * c) for c, b, a in squares]
        sums += [(a * e**2, -b * e * d, c * d**2) for c, b, a in squares for e, d in lines]
        for terms in sums:
            with suppress(*_NO_RING):
                yield self._short(_without_content(ex.add(*terms)))

    def _inverse_of(self, form: euler_lagrange.Matrix) -> list[list[Expression]] | None:
        """The inverse of a Hessian in the velocities that does not hold them; None without one."""
        places = range(len(form))
        if any(ex.has(entry, ex.Velocity) for row in form for entry in row):
            return None
        whole = collecting.determinant(form)
        if whole == ex.ZERO:
            return None

        def minor(i: int, j: int) -> Expression:
            rows = [[form[k][m] for m in places if m != j] for k in places if k != i]
            return collecting.collect((-1) ** (i + j) * collecting.determinant(rows) / whole)

        return [[minor(j, i) for j in places] for i in places]

    def outside(
        self,
        ansatz: _Ansatz,
        trees: Sequence[Expression],
        products: Sequence[Sequence[int]],
        degree: int,
    ) -> Iterator[FirstIntegral]:
        """The integrals of an ansatz that are no combinations of products of trees and of those
        before.
        """
        candidates = self._candidates(ansatz)
        places = list(dict.fromkeys(place for one in candidates for place in one))
        if not candidates:
            return
        values = self.values_of(trees, products, [ansatz.tree(place) for place in places])
        if values is None:
            return
        terms = dict(zip(places, values[len(products) :], strict=True))
        own = [
            reduce(lambda total, item: (total + item) % flow.PRIME, rows)
            for rows in (
                [c * terms[place] % flow.PRIME for place, c in one.items()] for one in candidates
            )
        ]
        table = np.stack([*values[: len(products)], *own]).T
        for place in matrices.pivots(table, flow.PRIME):
            if place >= len(products):
                vector = self._exact(ansatz, list(candidates[place - len(products)]))
                if vector is not None:
                    yield self._written(ansatz, vector, degree)[0]

    def _candidates(self, ansatz: _Ansatz) -> list[dict[int, int]]:
        """The coefficients of the terms of each integral of a basis, at one value of the
        parameters.
        """
        kernels = self._kernels_of((*ansatz.forms, *ansatz.factors))
        places = [*range(len(ansatz.terms))]
        parts = self._parts(ansatz, kernels) if len(places) > _FEW_TERMS else [places]
        pairs = self._sampled(kernels, max(map(len, parts)) + _SPARE)
        if pairs is None:
            return []
        values = _along_motion(ansatz, pairs)
        found = [one for part in parts for one in _conserved(values, part)]
        return sorted(found, key=lambda one: max(one))

    def by_weight(self, ansatz: _Ansatz) -> list[_Ansatz]:
        """The terms of each weight in the scalings and reflections of the motion apart."""
        kernels = self._kernels_of((*ansatz.forms, *ansatz.factors))
        parts = self._parts(ansatz, kernels)
        return [replace(ansatz, terms=tuple(ansatz.terms[k] for k in part)) for part in parts]

    def _parts(self, ansatz: _Ansatz, kernels: Sequence[Expression]) -> list[list[int]]:
        """The places of the terms of each degree in the scalings and reflections of the motion for
        which all `kernels`, of forms and factors, are homogeneous: the homogeneous parts of an
        integral are integrals.
        """
        forms, parts = len(ansatz.forms), dict[bytes, list[int]]()
        products = [[*key, forms + factor] for key, factor in ansatz.terms]
        try:
            degrees = self._degrees.of_products(kernels, products)
        except tm.TooManyTerms:
            return [[*range(len(products))]]
        for place, degree in enumerate(degrees):
            parts.setdefault(degree.tobytes(), []).append(place)
        return list(parts.values())

    @cached_property
    def _degrees(self) -> grading.Degrees:
        """Those in the scalings and reflections of the motion for fixed parameters; TooManyTerms
        where it has too many terms.
        """
        motion, kernels = self.motion, self._kernels_of
        second = zip(motion.free, kernels(motion.free_accelerations), strict=True)
        first = zip(motion.dependent, kernels(motion.dependent_velocities), strict=True)
        equations = [
            *(grading.second_order(name, tm.terms_of(tree)) for name, tree in second),
            *(grading.first_order(name, tm.terms_of(tree)) for name, tree in first),
        ]
        fixed = map(ex.Symbol, motion.parameters)
        return grading.Degrees(grading.gradings_of(equations, fixed))

    def _kernels_of(self, trees: Iterable[Expression]) -> list[Expression]:
        """The trees in kernels, each converted once."""
        for tree in (trees := list(trees)):
            if tree not in self.in_kernels:
                self.in_kernels[tree] = tower.to_kernels(tree)
        return [self.in_kernels[tree] for tree in trees]

    # Exact.

    def _ring(
        self, trees: Sequence[Expression]
    ) -> tuple[exact_field.ExactRing, exact_field.Derivation]:
        """A ring that holds the motion and the trees, and the derivation along the motion."""
        variables: list[ex.Symbol | ex.Velocity] = [ex.TIME, *self.positions, *self.free]
        motion = [*self.motion.free_accelerations, *self.motion.dependent_velocities]
        ring = exact_field.exact_ring(
            [*motion, *trees], variables, 1, exact_field.Budget(4_000, self.deadline)
        )
        speeds = [self.constraints.get(ex.Velocity(name), ex.Velocity(name)) for name in self.names]
        drift = [ring.value(tree) for tree in (ex.ONE, *speeds, *self.motion.free_accelerations)]
        return ring, ring.along(drift)

    def _exact(
        self, ansatz: _Ansatz, support: Sequence[int]
    ) -> list[tuple[Expression, int]] | None:
        """Constants c_a, which may hold parameters, with Gamma(sum c_a m_a) = 0."""
        trees = [self._on_constraints(ansatz.tree(place)) for place in support]
        ring, along = self._ring(trees)
        rates = [[along(ring.value(tree))] for tree in trees]
        vectors = matrices.null_vectors(ring, rates)
        if not vectors:
            return None
        with_forms = [bool(ansatz.terms[place][0]) for place in support]
        pairs = zip(_cleared(ring, vectors[0], with_forms), support, strict=True)
        return [(exact_field.quotient_tree(ring, c), place) for c, place in pairs if not c.is_zero]

    # For a reader.

    def _frames(self) -> Iterator[tuple[Expression, ...]]:
        """What the integrals are polynomials in: momenta, velocities where these are not theirs,
        forms that L squares.

        In the field of a magnetic pole the momenta have a string where they are singular, the
        velocities have none.
        """
        forms = () if self.lagrangian is None else _squared_forms(self.lagrangian)
        at_rest = (ex.substitute(p, dict.fromkeys(self.velocities, ex.ZERO)) for p in self.momenta)
        shifted = not self.constraints and any(p != ex.ZERO for p in at_rest)
        slopes = (calculus.differentiate(p, v) for p in self.momenta for v in self.velocities)
        fixed = not any(ex.holds(slope, *self.moving) for slope in slopes)
        if (
            fixed
            and not shifted
            and not self.constraints
            and all(form in self.velocities for form in forms)
        ):
            forms = ()  # combinations of the momenta
        frames = [self.momenta, self.velocities if shifted or not self.momenta else (), forms]
        seen: set[frozenset[Expression]] = set()
        for frame in frames:
            kept = tuple(dict.fromkeys(form for form in frame if form != ex.ZERO))
            if kept and frozenset(kept) not in seen:
                seen.add(frozenset(kept))
                yield kept

    def _written(
        self, ansatz: _Ansatz, vector: Sequence[tuple[Expression, int]], degree: int
    ) -> tuple[FirstIntegral, Expression]:
        """The integral with its name and symmetry, and on the constraints."""
        tree = self._shortest(ex.add(*(c * ansatz.tree(place) for c, place in vector)))
        if _is_negative(tree):
            tree, vector = ex.negated(tree), [(ex.negate(c), place) for c, place in vector]
        canonical = bool(self.momenta) and ansatz.forms[: len(self.momenta)] == self.momenta
        in_what = "momenta" if canonical else "velocities"
        name, symmetry = f"{_WORDS[degree]} in the {in_what}", ""
        if not any(ansatz.terms[place][0] for _, place in vector):
            name = "function of position"
        elif canonical and not self.constraints:
            fields = [self._field(ansatz, vector, i) for i in range(len(ansatz.forms))]
            if len(fields) > len(self.free):
                name, fields = "scaling", [*map(ex.negated, fields[:-1]), fields[-1]]
            elif degree == 1:
                name = self._name(fields, name)
            symmetry = self._symmetry(fields)
        return FirstIntegral(name, tree, symmetry), self._on_constraints(tree)

    def _short(
        self, tree: Expression, cost: Callable[[Expression], int] = ex.node_count
    ) -> Expression:
        return writing.shorten(tree, exact_field.Budget(4_000, self.deadline), cost=cost)

    def _shortest(self, tree: Expression) -> Expression:
        """The function written as it was made, collected, or factored, in all velocities or in the
        free ones.
        """
        return moves.cheapest(INTEGRALS, self, self._short(collecting.merge_powers(tree), _length))

    def in_free_velocities(self, tree: Expression) -> list[Expression]:
        """The function on the constraints; none where there are none."""
        return [self._short(self._on_constraints(tree), _length)] if self.constraints else []

    def _field(
        self, ansatz: _Ansatz, vector: Sequence[tuple[Expression, int]], i: int
    ) -> Expression:
        """eta_i = dF/dp_i."""
        total = []
        for c, place in vector:
            forms, factor = ansatz.terms[place]
            for k in range(len(forms)):
                if forms[k] == i:
                    rest = [ansatz.forms[j] for j in (*forms[:k], *forms[k + 1 :])]
                    total.append(ex.multiply(c, *rest, ansatz.factors[factor]))
        return collecting.collect(ex.add(*total)) if total else ex.ZERO

    def _symmetry(self, fields: Sequence[Expression]) -> str:
        moved = [
            f"{name} -> {printing.to_text(ex.Symbol(name) + ex.Symbol('s') * eta)}"
            for name, eta in zip((*self.names, "t"), fields, strict=False)
            if eta != ex.ZERO
        ]
        found = ", ".join(moved)
        return (
            found
            if len(found) <= _LONGEST_SYMMETRY and "s" not in (*self.names, *self.motion.parameters)
            else ""
        )

    def _name(self, fields: Sequence[Expression], otherwise: str) -> str:
        moved = [
            (name, eta) for name, eta in zip(self.names, fields, strict=True) if eta != ex.ZERO
        ]
        listed = ", ".join(name for name, _ in moved)
        if all(not ex.holds(eta, ex.TIME, *self.positions, *self.free) for _, eta in moved):
            return f"momentum of {listed}" if len(moved) == 1 else f"momentum along {listed}"
        if len(moved) == 2:
            (one, first), (other, second) = moved
            if collecting.collect(first * ex.Symbol(one) + second * ex.Symbol(other)) == ex.ZERO:
                return f"angular momentum in {listed}"
        return otherwise


def _product(one: flow.Numbers, other: flow.Numbers) -> flow.Numbers:
    """(u w, u' w + u w') of functions along the motion."""
    rate = (one[0] * other[1] % flow.PRIME + one[1] * other[0]) % flow.PRIME
    return np.stack([one[0] * other[0] % flow.PRIME, rate])


def _along_motion(ansatz: _Ansatz, pairs: Sequence[flow.Numbers]) -> flow.Numbers:
    """1 and the terms at points, and their rates, (2, 1 + terms, points), from those of the forms
    and factors.
    """
    one = np.zeros_like(pairs[0])
    one[0] = 1
    powers = {
        key: reduce(_product, (pairs[k] for k in key), one)
        for key in {key for key, _ in ansatz.terms}
    }
    of_forms = [one, *(powers[key] for key, _ in ansatz.terms)]
    of_factors = [one, *(pairs[len(ansatz.forms) + k] for _, k in ansatz.terms)]
    return _product(np.stack(of_forms, 1), np.stack(of_factors, 1))


def _conserved(values: flow.Numbers, places: Sequence[int]) -> list[dict[int, int]]:
    """The coefficients of these terms in each integral of a basis."""
    columns, count = [0, *(place + 1 for place in places)], len(places) + _SPARE
    values = values[:, columns, :count]
    found = matrices.kernel_modulo(values[1, 1:].T, flow.PRIME).basis
    used = np.flatnonzero(found.any(0)).tolist()
    if not used:
        return []
    # Terms that are combinations of 1 and of those before them add nothing.
    values = values[:, [0, *(k + 1 for k in used)], : len(used) + _SPARE]
    own = [k for k in matrices.pivots(values[0].T, flow.PRIME) if k]
    vectors = matrices.null_rows(values[1, own].T.tolist(), len(own), flow.PRIME)
    return [{places[used[own[k] - 1]]: c for k, c in enumerate(vector) if c} for vector in vectors]


def _length(tree: Expression) -> int:
    return len(printing.to_text(tree))


def _with_plus_inside(constants: tuple[ex.Symbol, ...], tree: Expression) -> Expression:
    lead, *rest = ex.summands(tree)
    return ex.add(writing.minus_inside(lead), *rest)


INTEGRALS: tuple[moves.Form[_Integrals], ...] = (
    moves.Form(
        "in the free velocities",
        moves.Holds.WHERE_DEFINED,
        lambda search, tree: search.in_free_velocities(tree),
    ),
)
STYLE: tuple[moves.Move[tuple[ex.Symbol, ...]], ...] = (
    moves.Move(
        "the order of the document",
        moves.Holds.WHERE_DEFINED,
        lambda constants, tree: writing.with_products_in_order(tree, constants),
    ),
    moves.Move("(b - a) c for -(a - b) c", moves.Holds.WHERE_DEFINED, _with_plus_inside),
)


def _cleared(
    ring: exact_field.ExactRing, vector: Sequence[exact_field.Quotient], counted: Sequence[bool]
) -> list[exact_field.Quotient]:
    """The vector times its common denominator, the numbers of its entries that are `counted` whole
    and coprime.
    """
    whole = matrices.numerators(ring, vector)
    numbers = [
        polynomials.as_fraction(c)
        for one in itertools.compress(whole, counted)
        for c in one.coeffs()
    ]
    scale = 1 / (tm.content_of(numbers) or Fraction(1))
    return [exact_field.Quotient(ring.field, one, ()).scaled(scale) for one in whole]


def _without_content(tree: Expression) -> Expression:
    """The expanded sum over the common factor of its numbers."""
    numbers = [value for _, value in collecting.expand(tree)]
    return collecting.collect(tree / ex.number(tm.content_of(numbers) or 1))


def _in_powers_of_time(tree: Expression) -> tuple[Expression, ...]:
    """The coefficients of 1, t, and t^2; () for other functions of t."""
    slopes = [tree]
    while slopes[-1] != ex.ZERO and len(slopes) < 4:
        slopes.append(calculus.differentiate(slopes[-1], ex.TIME))
    if slopes.pop() != ex.ZERO:
        return ()
    at_zero = [ex.substitute(slope, {ex.TIME: ex.ZERO}) for slope in slopes]
    return tuple(one / math.factorial(k) for k, one in enumerate(at_zero))


def _degree(tree: Expression) -> int:
    """The degree in the velocities of a polynomial."""
    terms = (monomial for monomial, _ in collecting.expand(tree))
    degrees = (int(sum(e for atom, e in one if isinstance(atom, ex.Velocity))) for one in terms)
    return max(degrees, default=0)


def _are_independent(rows: Sequence[flow.Numbers]) -> bool:
    return len(matrices.pivots(np.array(rows).T, flow.PRIME)) == len(rows)


def _walk_outside(tree: Expression) -> Iterator[Expression]:
    """The nodes that are in no function, root or denominator that is a sum."""
    yield tree
    match tree:
        case ex.Sum() | ex.Product():
            for part in ex.children(tree):
                yield from _walk_outside(part)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
            if exponent > 0 or not isinstance(base, ex.Sum):
                yield from _walk_outside(base)


def _products_of(
    letters: Sequence[tuple[Expression, bool]], total: int
) -> Iterator[list[Expression]]:
    """The products of powers of letters, negative ones where allowed, whose exponents have this
    total size.
    """
    if not letters:
        if not total:
            yield []
        return
    (first, inverted), *others = letters
    for size in range(total + 1):
        for rest in _products_of(others, total - size):
            yield [first**size, *rest]
            if inverted and size:
                yield [first**-size, *rest]


def _is_negative(tree: Expression) -> bool:
    """Whether most of its terms are, or half of them with the first."""
    negative = [writing.is_negative(term) for term in ex.summands(tree)]
    return (2 * sum(negative), negative[0]) > (len(negative), False)


def _squared_forms(lagrangian: Expression) -> tuple[Expression, ...]:
    """The sums of velocities that L holds squared."""
    found: dict[Expression, None] = {}
    for node in ex.walk(lagrangian):
        match node:
            case ex.Power(base, ex.Number(exponent)) if exponent == 2:
                for factor in ex.factors_of(base):
                    parts = euler_lagrange.linear_parts(factor, ex.Velocity)
                    if isinstance(parts, tuple) and parts[0]:
                        found[factor] = None
    return tuple(found)


class _Units:
    """The functions of t and q that are factors of terms, each with its degree."""

    def __init__(self, work: _Integrals) -> None:
        self.names, self.positions, self.work = work.names, work.positions, work
        self.most = _MOST_WITH_CONSTRAINTS if work.constraints else _MOST_TERMS
        self.back = {v: ex.negate(v) for v in work.velocities}
        nodes = list(dict.fromkeys(node for tree in work.trees for node in ex.walk(tree)))
        self.single: dict[Expression, dict[Expression, int]] = {q: {} for q in self.positions}
        self.mixed: dict[Expression, int] = {}
        circular = {
            q
            for node in nodes
            if isinstance(node, ex.Apply)
            for q in self.positions
            if node.function in ("sin", "cos", "tan", "cot") and ex.holds(node, q)
        }
        inner = (
            part
            for node in nodes
            if isinstance(node, ex.Sum | ex.Product | ex.Power)
            for part in ex.children(node)
        )
        plain = {part for part in inner if part in self.single}
        for name, q in zip(self.names, self.positions, strict=True):
            if q not in circular or q in plain:
                self.single[q] |= {q: 1, q**2: 2}
            if q not in nodes and work.lagrangian is not None:
                # An angle that is cyclic, about an axis that turns or tilts.
                momentum = calculus.differentiate(work.lagrangian, ex.Velocity(name))
                if any(ex.holds(momentum, other) for other in self.positions):
                    self.single[q] |= {ex.Apply("sin", q): 1, ex.Apply("cos", q): 1}
        for node in nodes:
            self._add(node)
        for one, table in self.single.items():
            angle = ex.Apply("sin", one), ex.Apply("cos", one)
            if (
                all(unit in table for unit in angle)
                and work.lagrangian is not None
                and ex.holds(work.lagrangian, one)
            ):
                table.update({angle[0] ** -1: 1, angle[1] / angle[0]: 1})

    def _add(self, node: Expression) -> None:
        """What a node of f or L brings in: its functions, and roots of sums that f divides by."""
        if ex.has(node, ex.Velocity):
            return
        held = [q for q in self.positions if ex.holds(node, q)]
        if not held:
            return
        table = self.single[held[0]] if len(held) == 1 else self.mixed
        if len(held) > 1 and ex.node_count(node) > _LONGEST_UNIT:
            return
        match node:
            case ex.Apply("sin" | "cos" | "tan" | "cot", argument):
                sine, cosine = ex.Apply("sin", argument), ex.Apply("cos", argument)
                table.update({sine: 1, cosine: 1})
                if node.function in ("tan", "cot"):
                    table[sine / cosine if node.function == "tan" else cosine / sine] = 1
            case ex.Apply("sinh" | "cosh" | "tanh", argument):
                table.update({ex.Apply("sinh", argument): 1, ex.Apply("cosh", argument): 1})
            case ex.Apply("exp" | "log" | "atan") | ex.Arbitrary():
                table[node] = 1
            case ex.Power(base, ex.Number(exponent)) if isinstance(base, ex.Sum):
                # 1/2 is added only where the base has a square root: sqrt(x - y) and sqrt(y - x)
                # share no point.
                halves = {Fraction(1, 2)} if exponent.denominator == 2 else set()
                for e in halves | {exponent, exponent + 1, abs(exponent)} - {Fraction(0)}:
                    table[base**e] = 1 if abs(e) <= 1 else 2
            case ex.Power(ex.Apply("sin" | "cos" as function, argument), ex.Number(exponent)) if (
                exponent < 0
            ):
                other = ex.Apply("cos" if function == "sin" else "sin", argument)
                table.update(
                    {ex.Apply(function, argument) ** -1: 1, other / ex.Apply(function, argument): 1}
                )
            case ex.Power(ex.Symbol() as q, ex.Number(exponent)) if (
                exponent < 0 or exponent.denominator > 1
            ):
                for e in {exponent, exponent + 1} - {Fraction(0)}:
                    table[q**e] = 1 if abs(e) <= 1 else 2

    def _factors(self, degree: int, timed: bool) -> list[tuple[Expression, int]]:
        """Products of units of different coordinates up to a total degree, simple ones first."""
        tables = [*self.single.values(), *({unit: d} for unit, d in self.mixed.items())]
        if timed or self.work.moves:
            times = {ex.TIME: 1, ex.TIME**2: 2}
            times |= {
                node: 1
                for tree in self.work.trees
                for node in ex.walk(tree)
                if isinstance(node, ex.Apply)
                and ex.holds(node, ex.TIME)
                and not ex.holds(node, *self.positions)
                and not ex.has(node, ex.Velocity)
            }
            tables.append(times)
        found: list[tuple[Expression, int]] = [(ex.ONE, 0)]
        for table in tables:
            more = [
                (tree * unit, d + e)
                for (tree, d), (unit, e) in itertools.product(found, table.items())
                if d + e <= degree
            ]
            found += more
        return sorted(dict.fromkeys(found), key=lambda item: (item[1], ex.node_count(item[0])))

    def _potentials(self, degree: int, timed: bool) -> list[Expression]:
        """The terms of L without velocities, times polynomials."""
        lagrangian = self.work.lagrangian
        if lagrangian is None:
            return []
        rest = collecting.collect(
            ex.substitute(lagrangian, dict.fromkeys(self.work.velocities, ex.ZERO))
        )
        parameters = {*map(ex.Symbol, self.work.motion.parameters)}
        plain = [
            ex.multiply(
                *(
                    f
                    for f in ex.factors_of(term)
                    if not isinstance(f, ex.Number) and f not in parameters
                )
            )
            for term in ex.summands(rest)
            if ex.holds(term, *self.positions)
        ]
        small = [tree for tree, d in self._factors(min(degree, 2), timed) if d <= degree]
        return [tree * factor for tree in plain for factor in small]

    def _inner(
        self, forms: tuple[Expression, ...], degree: int, timed: bool
    ) -> Iterator[list[Expression]]:
        """The functions that products of forms are multiplied by: fewer ones where the first make
        too many terms.
        """
        if forms == self.work.momenta or any(isinstance(form, ex.Velocity) for form in forms):
            yield from ([tree for tree, _ in self._factors(width, timed)] for width in (2, 1, 0))
            return
        velocities = map(ex.Velocity, self.names)
        slopes = (
            collecting.collect(calculus.differentiate(form, v))
            for v, form in itertools.product(velocities, forms)
        )
        letters = list(dict.fromkeys(slope for slope in slopes if ex.holds(slope, *self.positions)))
        for width in range(degree, -1, -1):
            choices = (
                itertools.combinations_with_replacement(letters, k) for k in range(width + 1)
            )
            yield [ex.multiply(*letters) for chosen in choices for letters in chosen]

    def ansatz(
        self,
        forms: tuple[Expression, ...],
        degree: int,
        timed: bool,
        coefficients: Literal["functions", "constants"] = "functions",
    ) -> _Ansatz:
        """All terms of the degree, functions of position alone and, where f is not even in v,
        linear terms.

        `timed`: powers of t are among the factors. `coefficients`: of the forms and their
        products, functions of position or constants.
        """
        keys: list[tuple[int, ...]] = list(
            itertools.combinations_with_replacement(range(len(forms)), degree)
        )
        keys += [(k,) for k in range(len(forms))] if degree == 2 and not self._is_even else []
        inners: Iterator[list[Expression]] = (
            iter([[ex.ONE]]) if coefficients == "constants" else self._inner(forms, degree, timed)
        )
        inner: list[Expression] = []
        for width in (2, 1, 0):
            inner = next(inners, inner)
            rest = [*self._polynomials(), *self._potentials(width, timed)]
            outer = [tree for tree in dict.fromkeys([*inner, *rest]) if tree != ex.ONE]
            factors = list(dict.fromkeys([*inner, *outer]))
            place = {tree: k for k, tree in enumerate(factors)}
            terms = [(key, place[tree]) for tree in inner for key in keys]
            terms += [((), place[tree]) for tree in outer]
            if len(terms) <= (max(self.most, _MOST_LINEAR) if degree == 1 else self.most):
                if degree == 1 and not timed and self._are_odd(forms):
                    terms = [(key, k) for key, k in terms if key]
                order = sorted(
                    terms, key=lambda term: (ex.node_count(factors[term[1]]), len(term[0]))
                )
                if degree == 1 and not timed and not self.work.moves:
                    order.append(((), len(factors)))
                    factors.append(ex.TIME)
                return _Ansatz(forms, tuple(factors), tuple(order), degree, timed)
        return _Ansatz(forms, (), (), degree, timed)

    def alphabets(self) -> Iterator[list[tuple[Expression, bool]]]:
        """The letters of f; these and functions of the coordinates that f does not hold,
        exponentials where f has their damping; those of f with half the angles.
        """
        letters = self._letters()
        yield letters
        trees = self.work.motion.free_accelerations
        cyclic = [q for q in self.positions if not any(ex.holds(f, q) for f in trees)]
        circular = any(isinstance(p, ex.Apply) and p.function in ("sin", "cos") for p, _ in letters)
        others = [ex.Apply(name, q) for q in cyclic for name in ("sin", "cos") if circular]
        growing: dict[Expression, dict[Expression, None]] = {
            q: dict.fromkeys(self._growths(q)) for q in cyclic
        }
        kept = [one for one in letters if not growing.get(one[0])]
        grown = [growth for q in cyclic for growth in growing[q] or ([] if others else [q])]
        more = [(p, False) for p in (*others, *grown) if (p, False) not in kept]
        if more:
            yield [*kept, *more]
        angles = [q for q in self.positions if any(p == ex.Apply("cos", q) for p, _ in letters)]
        if angles:
            whole = {ex.Apply(name, q) for q in angles for name in ("sin", "cos")}
            half = (ex.Apply(name, q / 2) for q in angles for name in ("sin", "cos"))
            yield [*((p, False) for p in half), *(one for one in letters if one[0] not in whole)]

    def _growths(self, q: ex.Symbol) -> Iterator[Expression]:
        """exp(-c q) for terms c q' v of the acceleration of v: what keeps v times it constant."""
        rate = ex.Velocity(q.name)
        pairs = zip(self.names, self.work.motion.free_accelerations, strict=False)
        for name, force in pairs:
            v = ex.Velocity(name)
            slope = calculus.differentiate(calculus.differentiate(force, v), rate)
            share = collecting.collect(slope / (2 if v == rate else 1))
            if share != ex.ZERO and not ex.holds(share, *self.work.moving):
                yield ex.Apply("exp", collecting.collect(-share * q))

    def of_degree(
        self,
        velocities: tuple[Expression, ...],
        degree: int,
        letters: Sequence[tuple[Expression, bool]],
    ) -> Iterator[_Ansatz]:
        """Products of velocities, to a degree, times products of letters of growing total
        degree.
        """
        steps = 2 if self._is_even else 1
        keys = [
            key
            for d in range(degree % steps, degree + 1, steps)
            for key in itertools.combinations_with_replacement(range(len(velocities)), d)
        ]
        factors: list[Expression] = [ex.ONE]
        for total in range(1, _HIGHEST[degree > 1] + 1):
            factors += [ex.multiply(*chosen) for chosen in _products_of(letters, total)]
            if len(factors) * len(keys) > _MOST_HIGHER:
                return
            if total > 1:
                terms = tuple((key, k) for k in range(len(factors)) for key in keys if key or k)
                yield _Ansatz(velocities, tuple(factors), terms)

    def _letters(self) -> list[tuple[Expression, bool]]:
        """Coordinates and functions in f, each with whether its inverse is a letter, too."""
        forces = self.work.motion.free_accelerations
        roots, inverted, functions = (
            dict[Expression, int](),
            set[Expression](),
            dict[Expression, None](),
        )
        for node in ex.distinct_nodes(forces):
            match node:
                case ex.Power(base, ex.Number(exponent)) if not ex.has(node, ex.Velocity):
                    if exponent.denominator > 1:
                        roots[base] = math.lcm(roots.get(base, 1), exponent.denominator)
                    if exponent < 0:  # 1/(u^2 w^(3/2)) has a product of powers as its base
                        inverted.update(factor for factor, _ in ex.powers_of(base))
                case ex.Apply("exp" | "sin" | "cos") if not ex.has(node, ex.Velocity):
                    functions[node] = None
                    if node.function == "exp":
                        inverted.add(node)
        outside = {node for f in forces for node in _walk_outside(f)}
        plain = [q for q in self.positions if q in outside and q not in roots]
        sums = dict[Expression, Expression]()  # each with one sign only
        for base in inverted:
            if isinstance(base, ex.Sum) and base not in roots:
                both = collecting.collect(base), collecting.collect(-base)
                sums.setdefault(max(both, key=repr), base)
        inner = {node for one in sums.values() for node in _walk_outside(one)}
        plain += [q for q in self.positions if q in inner and q not in (*plain, *roots)]
        if not (plain or functions or roots):  # f holds no coordinate: charges in a constant field
            plain = [*self.positions]
        found = [*plain, *functions, *(base ** Fraction(1, k) for base, k in roots.items())]
        letters = [(p, (p.base if isinstance(p, ex.Power) else p) in inverted) for p in found]
        # Powers of a sum of these are sums of others.
        return letters + [(one**-1, False) for one in sums.values()]

    def _polynomials(self) -> list[Expression]:
        """Monomials in the coordinates to the degree of a polynomial potential and one, where they
        are few.
        """
        plain = [q for q, table in self.single.items() if q in table]
        degree = 3
        for tree in self.work.trees:
            for term in ex.summands(tree):
                powers = dict(ex.powers_of(term))
                degree = max(degree, *(int(sum(powers.get(q, 0) for q in plain)) + 1, 0))
        while math.comb(len(plain) + degree, degree) > self.most // 4:
            degree -= 1
        return [
            ex.multiply(*chosen)
            for k in range(1, degree + 1)
            for chosen in itertools.combinations_with_replacement(plain, k)
        ]

    def _are_odd(self, forms: Sequence[Expression]) -> bool:
        """Whether integrals linear in the forms have no other terms, because those change their
        sign backwards.
        """
        both = (collecting.collect(ex.substitute(form, self.back) + form) for form in forms)
        return not self.work.constraints and self._is_even and all(tree == ex.ZERO for tree in both)

    @cached_property
    def _is_even(self) -> bool:
        """Whether the motion is the same backwards."""
        turned = [
            collecting.collect(ex.substitute(f, self.back) - f)
            for f in self.work.motion.free_accelerations
        ]
        return not self.work.moves and all(tree == ex.ZERO for tree in turned)
