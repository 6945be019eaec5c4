"""A system as stated in a certificate, and the checks of the three kinds of certificates.

Formulas have no trees: the parser computes Taylor series about a point while it reads. Numbers are
residues modulo a prime (`Residues`), which prove that a value is zero, or balls (`Balls`), which
prove that it is not.
"""

import math
import random
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import accumulate, chain, combinations
from typing import Any, Literal, NamedTuple

from flint import ctx, fmpz, fmpz_mat, nmod_mat

from . import formulas as fm, numbers as nb, series as sr
from .exceptions import Generic
from .formulas import NAME, NUMBER, TEXT, Incomplete, check_shape, read_tokens, require, value_of
from .numbers import Atom, Balls, Plan, Residues, Undefined, Unsettled
from .series import Elimination, Expansion, Row, Step, Symbol
from .tape import Replay, Tape

PRECISIONS = (192, 512, 2048, 8192)  # bits of balls
NOT_SHOWN = "Balls at the real point do not show that"
MAX_RARITY = 1 << 18  # one of about so many primes has all roots that are needed of it
MAX_VISITS = 64  # of a root that is none of a power, before it is taken for dependent
LOOKS = 64  # for points at which a formula is not defined
MAX_ATOMS = 80  # atoms among which all linear relations are searched
Tokens = tuple[str, ...]


class Tools(NamedTuple):
    """The source of all random choices, the end of the processor time, and the most work of one
    question, in products of numbers.
    """

    generator: random.Random
    deadline: float
    most_work: float = math.inf


class RowKind(NamedTuple):
    """The order of a condition on g, the order of the derivatives of f in it, and the places of its
    rows.
    """

    order: int
    depth: int
    places: Sequence[tuple[int, ...]]


KindsOfRows = dict[str, RowKind]


class Condition(NamedTuple):
    """more > less."""

    more: Tokens
    less: Tokens


class Root(NamedTuple):
    """A root, and the formula, positive at the point, that is claimed to equal it."""

    root: Tokens
    value: Tokens


class Integral(NamedTuple):
    """A function of the arguments, given by its derivatives by some of them.

    The `letter` is the name of the variable of a function of one, whose argument is any formula;
    empty for a function of t, q and q'.
    """

    arguments: list[str]
    slopes: dict[str, Tokens]
    letter: str

    def bound(self, name: str, orders: list[int], values: list[Any]) -> dict[str, Any]:
        """The values of names in the derivative of a function of one variable; Refused if it has
        not one argument.
        """
        if not self.letter:
            return {}
        require(len(values) == 1 and not any(orders), f"{name} must be written with one argument.")
        return {self.letter: values[0]}


class Found(NamedTuple):
    """The result of the elimination of an existence certificate at one point."""

    steps: list[Step]
    killing: list[Step]  # steps of the symbol
    dimensions: list[list[int]]  # D_0 ... D_degree at the claimed order and the next one
    regular: bool  # whether g(p) of a random solution is
    symbol: Symbol


class Zero(NamedTuple):
    """Values that must be zero in the ring, and the sentence for the case that they are not."""

    value: nb.Series
    sentence: str


class Regular(NamedTuple):
    """A matrix that must be regular at the point, and the sentence for the case that it is not."""

    matrix: list[list[nb.Number]]
    sentence: str


class Claims(NamedTuple):
    zeros: list[Zero]
    regular: list[Regular]


class Outcome(NamedTuple):
    """The outcome of the rows of a nonexistence certificate at one point."""

    steps: list[Step]
    regular: bool  # whether g(p) of a random solution is


def no_claims(ring: Expansion) -> Claims:
    ring.question.read(ring)
    return Claims([Zero(tie, "A root does not equal its stated value.") for tie in ring.ties], [])


class Question:
    """A parsed system q'' = f, whether L may depend on t, and the checks of certificates.

    `claim` contains the set of the claim: `near`, `conditions`, `roots`.
    """

    jet, where = 2, ""  # the derivatives of L that are needed

    def __init__(self, tools: Tools, document: Any, timed: bool = True, claim: Any = None) -> None:
        self.generator, self.deadline, self.most_work = tools
        self.work = self.last_work = 0  # so far, and that of the last point of `modulo`
        self.timed, self.nodes = timed, fm.Nodes()
        self.read_system(document)
        contains_time = any("t" in force for force in self.motion)
        require(timed or not contains_time, "f contains t: the question has to be time_dependent.")
        self.variables = ["t"] * timed + self.coordinates + [name + "'" for name in self.free]
        self.names = {"t", *self.variables, *self.parameters}
        self.set_of_claim(claim or {})
        self.integrals = dict[str, Integral]()
        self.kinds_of_rows = self.listed_rows()
        self.largest = dict[str, int]()  # by kind, the largest degree of an alpha that is needed
        self.held = (
            False  # whether everything that must be true at a point of `look_around` is read
        )
        self.partly = False  # whether a matrix is regular only for some choices of the roots
        self.claimed: tuple[Callable[[Expansion], Claims], int] = (no_claims, 0)
        self.generic: Generic | None = None  # the proof, once confirmed
        self.number_roots = dict[tuple[Any, ...], list[nb.Number]]()  # by prime, number, degree
        self.halves, self.plan, self.place = False, Plan([], 0), nb.Place(self.generator, {})

    def read_system(self, document: Any) -> None:
        check_shape(document, fm.SYSTEM, "system")
        self.coordinates = document["coordinates"]
        self.parameters = document.get("parameters") or []
        self.own_parameters = [*self.parameters]
        self.functions, forces, rates = (
            document.get(key) or {} for key in ("functions", "equations", "velocities")
        )
        check_shape(
            list(self.functions.items()), [(NAME, [NAME, 6]), fm.MAX_NAMES], "system.functions"
        )
        names = [*self.coordinates, *self.parameters, *self.functions]
        self.free, self.bound = self.coordinates[: len(forces)], self.coordinates[len(forces) :]
        good = self.free and all(self.functions.values())
        good = good and len({*names} - fm.RESERVED) == len(names)
        good = good and ({*forces}, {*rates}) == ({*self.free}, {*self.bound})
        once = "declare each name once, none of them reserved, and an equation for each"
        require(good, f"system must {once}.")
        given = [(f"system.equations.{name}", forces[name]) for name in self.free]
        given += [(f"system.velocities.{name}", rates[name]) for name in self.bound]
        self.force_texts = [read_tokens(text, where) for where, text in given]
        self.letters = {name + "''" for name in self.coordinates}
        self.unsolved = list[tuple[str, ...]]()
        if not all(map(self.letters.isdisjoint, self.force_texts)):  # E(t, q, q', q'') = 0
            require(not self.bound, "The equations of a motion on constraints have to be solved.")
            free = not any(fm.bounded(text, self.letters) for text in self.force_texts)
            require(free, "Accelerations may occur in sums and products only.")
            self.parameters = [*self.parameters, *sorted(self.letters)]
            self.unsolved = self.force_texts
            self.force_texts = [(name + "''", "") for name in self.coordinates]
        self.motion = [*self.force_texts, *self.unsolved]

    def listed_rows(self) -> KindsOfRows:
        """The rows that a certificate may have."""
        pairs: list[tuple[int, ...]] = [(i, j) for j in range(len(self.free)) for i in range(j + 1)]
        distinct = [pair for pair in pairs if pair[0] < pair[1]]
        return {"H2": RowKind(1, 1, pairs), "H3": RowKind(0, 2, distinct)}

    def expansion(self, arithmetic: Balls | Residues, degree: int) -> Expansion:
        """Series about a point, and the conditions in them."""
        return Expansion(arithmetic, degree)

    def set_of_claim(self, claim: dict[str, Any]) -> None:
        near = claim.get("near") or {}
        shape = {
            "conditions?": [TEXT, fm.MAX_LISTED],
            "roots?": [{"root": TEXT, "is": TEXT}, fm.MAX_LISTED],
        }
        check_shape(near, dict.fromkeys(near, NUMBER), "near")
        require({*near} <= self.names, "near contains a name that the system does not declare.")
        self.near = {name: Fraction(value) for name, value in near.items()}
        check_shape(claim, shape, "certificate")
        self.conditions = [read_condition(text) for text in claim.get("conditions") or []]
        self.roots = list[Root]()
        for entry in claim.get("roots") or []:
            root = read_tokens(entry["root"], "roots.root")
            self.roots.append(Root(root, read_tokens(entry["is"], "roots.is")))
            require(fm.is_root(root), "A root has to be sqrt(w) or (w)^(a/k).")
        sides = (side for pair in (*self.conditions, *self.roots) for side in pair)
        good = all(map(self.letters.isdisjoint, sides))
        require(good, "The set may involve only t, q, q' and parameters.")

    def texts(self) -> list[tuple[str, ...]]:
        """The formulas of the system and of the set of the claim."""
        return [*self.motion, *(side for pair in (*self.conditions, *self.roots) for side in pair)]

    def check_time(self, work: int = 1) -> None:
        """Count so much work, and end the check where the work or the time is used up."""
        self.work += work
        if self.work > self.most_work or not time.thread_time() < self.deadline:
            raise fm.OutOfTime("The time limit ended the check.")

    def read_all(self, ring: Any) -> list[Any]:
        """Read the conditions and roots, as logarithms of the expressions that they make positive.

        Then the right sides f.
        """
        hinted = not self.rational or isinstance(getattr(ring, "arithmetic", None), Balls)
        degree, ring.degree = ring.degree, 0
        for more, less in self.conditions if hinted else ():
            ring.elementary("log", ring.add([value_of(ring, more), value_of(ring, less)], [1, -1]))
        for root, said in self.roots if hinted else ():
            value = value_of(ring, said)
            ring.elementary("log", value)
            tie = ring.add([value_of(ring, root), value], [1, -1])
            ring.ties.append(ring.multiply(tie, ring.constant(Fraction(1)), 0))
        # The conditions are not remembered, so that rings of all degrees meet the same atoms in the
        # same order.
        ring.degree, ring.memory = degree, None
        found = fm.read_formulas(ring, self.force_texts)
        if self.bound:
            rates = zip(self.bound, found[len(self.free) :], strict=True)
            ring.names = ring.names | {name + "'": rate for name, rate in rates}
        return found

    def prepare(
        self,
        read: Callable[[Any], object],
        formulas: Iterable[tuple[str, ...]] = (),
        rational: bool = True,
    ) -> None:
        """Bound the degrees by a count; unless everything is rational, first find a point and a
        plan.

        `read` is called with rings of all kinds and reads all formulas of the certificate except f.
        On return, there is a point where everything is defined and the conditions are true (in
        balls, or modulo a prime if everything is rational), the plan relates the atoms there,
        degrees are bounded, and each named root has its stated value.
        """
        self.rational = rational and not any(map(fm.is_irrational, [*self.texts(), *formulas]))
        self.read = read
        if self.conditions or self.near or not self.rational:
            trace = self.locate()
        if not self.rational:
            self.tape = Tape(self)
            self.make_plan(trace)
        else:
            self.modulo(0, read, 1)
        self.read(sr.Count(self))
        if self.plan.draws > nb.MAX_SPLIT:
            raise Incomplete("There are too many roots of roots, or that are not square.")
        if self.plan.roots and not self.independent():
            self.plan.choices = self.plan.every_choice()
        if self.roots:
            self.settle(0, no_claims)

    def locate(self) -> list[Atom]:
        """Find a real point where everything is defined and the conditions are true, completing
        `near`.
        """
        free = self.names - {*self.near} or self.functions
        for attempt in range(60 if free else 1):
            values = {
                name: Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 30) + attempt % 2
                for name in sorted(self.names)
            }
            self.place = nb.Place(self.generator, values | self.near)
            try:
                trace: list[Atom] = self.in_balls(0, self.traced)
                return trace
            except (Undefined, Unsettled):
                self.check_time()
        raise Incomplete(
            "No point was found at which every formula is defined and every condition holds."
        )

    def look_around(self) -> int:
        """Try random points where the conditions hold, near and far.

        There, every formula read after the conditions are `held` must be defined, and all zeros
        must be zero.
        """
        everywhere = "at all points where the conditions hold"
        (claims, degree), seen = self.claimed, 0
        for values in chain(self._far_points(), self._random_points()):
            self.check_time()
            with ctx.workprec(PRECISIONS[0]):
                try:
                    self.held = False
                    arithmetic = Balls(self, nb.Place(self.generator, values), None)
                    zeros = claims(self.expansion(arithmetic, degree)).zeros
                    numbers = chain.from_iterable(zero.value.values() for zero in zeros)
                    good = all(number.contains(0) for number in numbers)
                    require(good, f"The claim does not hold {everywhere}.")
                    seen += 1
                except Undefined:
                    require(not self.held, f"The formulas are not defined {everywhere}.")
                except Unsettled:
                    pass
        return seen

    def _far_points(self) -> Iterator[dict[str, Fraction]]:
        """The place with one name at a time moved by about 1, 30, 1,000, 30,000, up and down.

        A term that is zero on the side of the place alone, such as sqrt((x - 700)^2) + x - 700, is
        met by each check, where random points meet it in most.
        """
        names, draw = sorted(self.names), self.generator.randrange
        moves = [(distance, sign) for distance in (1, 30, 1000, 30000) for sign in (1, -1)]
        for index in range(min(LOOKS, len(names) * len(moves))):
            distance, sign = moves[index // len(names)]
            name = names[index % len(names)]
            far = sign * distance * Fraction(draw(7000, 9999), 7000)
            yield {**self.place.values, name: self.place.values[name] + far}

    def _random_points(self) -> Iterator[dict[str, Fraction]]:
        names, draw = sorted(self.names), self.generator.randrange
        for attempt in range(LOOKS):
            start = self.place.values if attempt % 2 else dict.fromkeys(names, Fraction(0))
            most = 16 if attempt % 4 else 115
            scales = [attempt % 16 if attempt % 2 else 15 - draw(most) for _ in names]
            yield {
                name: start[name] + Fraction(draw(-9999, 9999), 7) / Fraction(2) ** scale
                for name, scale in zip(names, scales, strict=True)
            }

    def traced(self, ring: Expansion) -> list[Atom]:
        self.read(ring)
        trace: list[Atom] = ring.arithmetic.trace
        return trace

    def met_at(self, place: nb.Place) -> Balls:
        """The balls at a place, after everything was read that meets an atom or a function."""
        balls = Balls(self, place, None)
        Replay(balls, self.tape)
        return balls

    def make_plan(self, trace: list[Atom]) -> None:
        """The plan of the atoms, guessed from their values at the place and near it."""
        center, whole = self.place, trace
        with ctx.workprec(PRECISIONS[0]), suppress(Undefined, Unsettled):
            trace = self.met_at(center.neighbor(20)).trace
        distinct = min(MAX_ATOMS, nb.count_distinct(trace))
        bits = min(600 + 60 * distinct, 4000)
        with ctx.workprec(bits):
            first = self.met_at(center)
            if not (self.halves or nb.are_alike(whole, first.trace)):
                raise Incomplete("The formulas meet other atoms when they are read again.")
            traces = [first.trace]
            missed = 0
            while len(traces) <= distinct + nb.SPARE and missed < 400:
                try:
                    near = center.neighbor(missed // 16)
                    traces.append(self.met_at(near).trace)
                except (Undefined, Unsettled):
                    self.check_time()
                    missed += 1
            self.plan = Plan(traces, bits, self.check_time)
            self.plan.classes = first.met  # for which the plan is valid
        if self.plan.halved and not self.halves:
            self.halves = True
            self.make_plan(trace)

    def independent(self) -> bool:
        """Whether the roots r^N = w of functions all have full degree.

        Then one choice of roots represents all choices. A sufficient condition is that, for each
        depth and each prime q, no product of powers of the w with q | N is a q-th power in the
        field of the roots of smaller depth (Kummer), that is, that the logarithms of these w modulo
        q, at points modulo primes where all roots of smaller depth exist, have full rank.
        """
        roots = self.plan.roots
        for depth in sorted({root.depth for root in roots}):
            degrees = [root.degree for root in roots if root.depth == depth]
            below = math.prod([root.degree for root in roots if root.depth < depth])
            rows = {int(q): list[list[int]]() for n in {*degrees} for q, _ in fmpz(n).factor()}
            prime = self.prime()
            for _ in range(16 * min(below, nb.MAX_SPLIT) * (len(degrees) + nb.SPARE)):
                if not rows or max(map(len, rows.values())) > len(degrees) + MAX_VISITS:
                    break
                ring = nb.Witnesses(self, prime, self.generator.getrandbits(64), depth)
                try:
                    with suppress(nb.Met):
                        Replay(ring, self.tape)
                    for q in [*rows]:
                        rows[q].append(ring.logarithms(q))
                        if nmod_mat(rows[q], q).rank() == len(rows[q][0]):
                            del rows[q]
                except Undefined:
                    self.check_time()
            if rows:
                return False
        return True

    def in_balls(
        self, degree: int, work: Callable[[Expansion], Any], classes: list[int] | None = None
    ) -> Any:
        """The result of the work in balls at the point, with more digits until they suffice.

        On return, no comparison in the computation was left open by the balls.
        """
        for bits in PRECISIONS:
            self.check_time()
            with ctx.workprec(bits):
                try:
                    return work(self.expansion(Balls(self, self.place, classes), degree))
                except Unsettled:
                    pass
        raise Unsettled

    def proven_in_balls(self, degree: int, work: Callable[[Expansion], Any], sentence: str) -> Any:
        try:
            return self.in_balls(degree, work, self.plan.classes)
        except (Undefined, Unsettled):
            raise Incomplete(sentence) from None

    def modulo(self, degree: int, work: Callable[[Expansion], Any], count: int = 2) -> list[Any]:
        """The results of the work at random points modulo random primes.

        There is one result for each choice of the roots there. On return, there are `count` times
        as many outcomes as choices, and the same arguments of functions were equal at all points.
        """
        found, prime, choices = list[Any](), 0, self.plan.choices
        for attempt in range(2000 + 30 * self.plan.draws):
            prime = prime if attempt % 8 else self.prime()
            seed, here, classes = self.generator.getrandbits(64), list[Any](), list[list[int]]()
            try:
                # First test whether these roots exist.
                for choice in choices if degree and self.plan.draws > 1 else ():
                    self.read(self.expansion(Residues(self, prime, seed, choice), 0))
                for choice in choices:
                    before = self.work
                    ring = self.expansion(Residues(self, prime, seed, choice), degree)
                    here.append(work(ring))
                    self.last_work = self.work - before
                    classes.append(ring.arithmetic.classes)
            except Undefined:
                self.check_time()
                continue
            for met in classes:
                known = self.plan.classes or []  # one computation may read more than another
                if any(one != other for one, other in zip(known, met, strict=False)):
                    raise Incomplete(
                        "Arguments of a function agree at one point and not at another."
                    )
                self.plan.classes = max(known, met, key=len)
            found, prime = [*found, *here], self.prime()
            if len(found) == count * len(choices):
                return found
        raise Incomplete("No point was found at which every formula is defined.")

    def prime(self, width: Literal["of_plan", "narrow"] = "of_plan") -> int:
        """A random prime modulo which all numbers have the roots that the plan uses.

        It has 61 bits or, if the plan is wide and the prime not to be narrow, as many more as
        Lemma 2 of RING.md requires. It is drawn after the text is read, so that no text can be
        constructed to vanish modulo the prime.
        """
        bits = 60 + (
            2 * self.plan.split.bit_length() if self.plan.wide and width == "of_plan" else 0
        )
        fine = [2 * pair.scale for pair in self.plan.pairs if pair.number < 0]
        step = math.lcm(
            24 * math.lcm(*[2 * pair.scale for pair in self.plan.pairs if pair.logarithm]), *fine
        )
        roots = [(pair.number, pair.scale) for pair in self.plan.pairs if pair.number > 1]
        # A text could contain all such primes.
        if step * math.prod([scale for _, scale in roots]) > MAX_RARITY:
            raise Incomplete("There are too many roots of numbers: too few primes have them all.")
        for _ in range(1_000_000):
            prime = self.generator.randrange((1 << bits) // step, (2 << bits) // step) * step + 1
            if fmpz(prime).is_probable_prime() and all(
                pow(q, (prime - 1) // n, prime) == 1 for q, n in roots
            ):
                return prime
            self.check_time()
        raise Incomplete("No prime was found modulo which all numbers have their roots.")

    def settle(self, degree: int, claims: Callable[[Expansion], Claims], count: int = 2) -> None:
        """Prove zeros by algebra and regular matrices by balls.

        Balls may refute a value that is not zero in the ring. On return, every zero is zero at all
        points drawn and for all roots there, and every matrix is regular. Otherwise the certificate
        is invalid if a ball excludes 0 or everything is rational, and incomplete if not.
        """
        doubts, self.claimed = dict[int, str](), (claims, degree)
        needed = dict[int, str]()  # all matrices, and those regular for some choice of the roots
        regular = set[int]()

        def exact(ring: Expansion) -> None:
            found = claims(ring)
            open_ones = (
                k for k, zero in enumerate(found.zeros) if ring.arithmetic.settle(zero.value)
            )
            doubts.update({k: found.zeros[k].sentence for k in open_ones})
            needed.update({k: one.sentence for k, one in enumerate(found.regular)})
            here = [ring.arithmetic.regular(one.matrix) for one in found.regular]
            regular.update(k for k, good in enumerate(here) if good)
            self.partly |= not all(here)

        def real(ring: Expansion) -> None:
            found = claims(ring)
            for k, sentence in doubts.items():
                numbers = found.zeros[k].value.values()
                require(all(number.contains(0) for number in numbers), sentence)
            if doubts or not all(ring.arithmetic.regular(one.matrix) for one in found.regular):
                raise Unsettled

        self.modulo(degree, exact, count)
        for k, sentence in needed.items():
            require(k in regular, sentence)
        require(not (doubts and self.rational), next(iter(doubts.values()), ""))
        if not self.rational:
            told = f"{NOT_SHOWN} a matrix is regular."
            if doubt := next(iter(doubts.values()), ""):
                told = f"It is undecided whether the following holds: {doubt}"
            self.proven_in_balls(degree, real, told)

    def lagrangian(self, document: dict[str, Any]) -> str:
        """Check that L satisfies all conditions and that the matrix L_(v_i v_j) is regular.

        On return, each residual is zero in the ring for every choice of its roots, and the matrix
        is regular modulo a prime for one choice and, unless everything is rational, in balls at P.
        """
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")
        tokens = formula + self.read_integrals(document.get("integrals") or {})
        self.check_names("The Lagrangian", tokens)

        def claims(ring: Expansion) -> Claims:
            lagrangian = value_of(ring, formula)
            found = self.residuals(ring, lagrangian)
            found = self.against(ring, found, factors) if self.unsolved else found
            listed = chain(self.turns(ring), found)
            zeros = [Zero(ring.settle(one.value), one.sentence) for one in listed]
            singular = f"The Hessian of the Lagrangian is singular{self.where}."
            return Claims(zeros, [Regular(ring.hessian(lagrangian), singular)])

        factors = self.read_factors(document)
        lines = [text for pair in zip(factors, self.unsolved, strict=True) for text in pair]
        texts = [formula, *lines]
        self.prepare(lambda ring: fm.read_formulas(ring, texts), [tokens, *factors])
        self.settle(self.jet, claims, 3 if self.rational else 2)

        def regular(ring: Expansion) -> bool:
            return bool(ring.arithmetic.regular(ring.hessian(value_of(ring, formula))))

        self.generic = Generic(regular, self.jet, bool, persists=True)
        there = self.where and " there"
        hold = f"The Euler-Lagrange equations of the Lagrangian hold{self.where}"
        return f"{hold} and its Hessian is regular{there}."

    def residuals(self, ring: Expansion, lagrangian: nb.Series) -> Iterator[Zero]:
        """The values that must be zero at the point, each with the error if it is not."""
        for kind, names in (("free", self.free), ("dependent", self.bound)):
            for i, name in enumerate(names):
                sentence = f"The Euler-Lagrange equation of {name} does not hold{self.where}."
                yield Zero(ring.value(ring.terms(kind, i), lagrangian), sentence)

    def turns(self, ring: Expansion) -> Iterator[Zero]:
        """The differences of the mixed derivatives of each integral."""
        for name, integral in self.integrals.items():
            if integral.letter:
                continue
            sentence = f"The mixed derivatives of integrals.{name} do not agree."
            known = [
                (self.variables.index(by), value_of(ring, slope))
                for by, slope in integral.slopes.items()
            ]
            for (a, one), (b, other) in combinations(known, 2):
                turn = ring.add([ring.derivative(one, b), ring.derivative(other, a)], [1, -1])
                yield Zero({0: turn.get(0, 0)}, sentence)

    def read_factors(self, document: dict[str, Any]) -> list[tuple[str, ...]]:
        """c_i(t, q, q') for each unsolved equation; 1 if none are given."""
        listed = document.get("factors", ["1"] * len(self.unsolved))
        check_shape(listed, [TEXT, len(self.unsolved)], "certificate.factors")
        good = len(listed) == len(self.unsolved)
        require(good, "Each equation that is not solved must have a factor.")
        found = [read_tokens(text, "certificate.factors") for text in listed]
        for tokens in found:
            self.check_names("A factor", tokens)
        return found

    def check_names(self, what: str, tokens: Tokens) -> None:
        require(self.letters.isdisjoint(tokens), f"{what} contains accelerations.")
        good = self.timed or "t" not in tokens
        require(good, f"{what} contains t, but the question does not.")

    def against(
        self, ring: Expansion, residuals: Iterable[Zero], factors: list[tuple[str, ...]]
    ) -> Iterator[Zero]:
        """For unsolved equations, values that are zero if the residual is c E or -c E for all
        q''.
        """
        for (residual, sentence), factor, equation in zip(
            residuals, factors, self.unsolved, strict=True
        ):
            value = {0: value_of(ring, factor).get(0, 0)}
            own = ring.multiply(value, {0: value_of(ring, equation).get(0, 0)}, 0)
            either = ring.multiply(ring.add([residual, own], [1, -1]), ring.add([residual, own]), 0)
            yield Zero(either, sentence)

    def read_integrals(self, listed: dict[str, Any]) -> tuple[str, ...]:
        """Read the functions given by derivatives, which may contain earlier ones.

        Returns the tokens of all of them.
        """
        check_shape(listed, {}, "integrals")
        shape = {"arguments": [NAME + "'?", 6], "derivatives": {}}
        check_shape(listed, dict.fromkeys(listed, shape), "integrals")
        check_shape(list(listed), [NAME, fm.MAX_NAMES], "integrals")
        taken = {*self.names, *self.functions} | fm.RESERVED
        require(taken.isdisjoint(listed), "An integral has a name that is already in use.")
        good = all(map({*listed}.isdisjoint, self.texts()))
        require(good, "Only the Lagrangian may contain integrals.")
        tokens: tuple[str, ...] = ()
        for name, one in listed.items():
            arguments, slopes = one["arguments"], one["derivatives"]
            read = {by: read_tokens(text, f"integrals.{name}") for by, text in slopes.items()}
            held = [*chain.from_iterable(read.values())]
            moving = {"t", *self.coordinates, *(name + "'" for name in self.coordinates)}
            alien = "a name that is not an argument"
            variables = {"t", *self.variables}
            fresh = len(arguments) == 1 and taken.isdisjoint({*arguments, arguments[0].rstrip("'")})
            letter = arguments[0] if fresh and arguments[0] not in {*listed, "pi"} else ""
            for good, what in (
                (0 < len(arguments) == len({*arguments}), "has to name its arguments once"),
                (letter != "" or {*arguments} <= variables, "may contain only t, q and q'"),
                ({*slopes} <= {*arguments}, f"has a derivative by {alien}"),
                (slopes, "has to have a derivative"),
                ({*held} & {*listed} <= {*self.integrals},
                 "may contain only the integrals listed before it"),
                ({*held} & moving <= {*arguments}, f"has a derivative that contains {alien}"),
            ):  # fmt: skip
                require(good, f"integrals.{name} {what}.")
            tokens += tuple(token for token in (*arguments, *held) if token != letter)
            self.integrals[name] = Integral(arguments, read, letter)
        return tokens

    def multi_index(self, exponents: list[int], most: int) -> int:
        require(sum(exponents) <= most, f"A multi-index has to have a total of at most {most}.")
        shift = 8 * (len(self.variables) + len(self.bound))
        packed = sum(exponent << 8 * a for a, exponent in enumerate(exponents))
        return packed | sum(exponents) << shift

    def agreed(self, scripts: Iterable[list[Step]]) -> list[Step]:
        """The rows and pivots of eliminations at several points, which must agree."""
        first, *others = scripts
        for other in others:
            if [(step.row, step.pivot) for step in other] != [
                (step.row, step.pivot) for step in first
            ]:
                raise Incomplete("The elimination takes different pivots at different points.")
            pairs = zip(first, other, strict=True)
            first = [one._replace(columns=one.columns | more.columns) for one, more in pairs]
        return first

    def listed(self, document: dict[str, Any]) -> tuple[list[Row], int]:
        """The rows of a document in the order of elimination, and the required degree of f."""
        index = range(len(self.coordinates))
        exponents = range(fm.MAX_ORDER + 1)
        m = len(self.variables)
        kinds = "|".join(self.kinds_of_rows)
        arity = len(next(iter(self.kinds_of_rows.values())).places[0])
        shape = (kinds, *[index] * arity, (exponents,) * m)
        check_shape(document, {"order": exponents, "rows": [shape, fm.MAX_ROWS]}, "certificate")
        rows, degrees, depths = list[Row](), dict[Row, int](), [0]
        places = {key: {*one.places} for key, one in self.kinds_of_rows.items()}
        for kind, *place, alpha in document["rows"]:
            order, depth, _ = self.kinds_of_rows[kind]
            good = (*place,) in places[kind]
            require(good, f"A row of {kind} does not belong at {place}: see FORMAT.md.")
            row = Row(kind, (*place,), self.multi_index(alpha, document["order"] - order))
            rows.append(row)
            degrees[row] = sum(alpha) + order
            self.largest[kind] = max(self.largest.get(kind, 0), sum(alpha))
            depths.append(sum(alpha) + depth)
        rows.sort(  # this fills in least
            key=lambda row: (degrees[row], row.kind, *(-i for i in row.place), -row.alpha)
        )
        return rows, max(depths)

    def nonexistence(self, document: dict[str, Any]) -> str:
        """Check that the named rows allow no regular g(p).

        On return, the same rows are independent with the same pivots at all points (also in balls
        unless everything is rational), and det g(p) is zero on the solutions of these rows.
        """
        rows, most = self.listed(document)
        require(len(set(rows)) == len(rows), "A row is named twice.")

        def work(ring: Expansion) -> Outcome:
            echelon = Elimination(ring.arithmetic, ring.shift)
            for row in rows:
                echelon.insert(ring.row(*row), row)
            return Outcome(echelon.script(), ring.arithmetic.regular(ring.matrix(echelon)))

        def real(ring: Expansion) -> None:
            echelon = sr.followed(ring, steps)
            if regular and not ring.arithmetic.regular(ring.matrix(echelon)):
                raise Unsettled

        self.prepare(lambda ring: None)
        outcomes: list[Outcome] = self.modulo(most, work)
        unit = self.last_work
        steps = self.agreed(outcome.steps for outcome in outcomes)
        regular = any(outcome.regular for outcome in outcomes)
        if not self.rational:
            self.proven_in_balls(most, real, f"{NOT_SHOWN} the rows are independent.")
        require(not regular, "The rows leave a regular multiplier g(p).")
        self.generic = Generic(
            work,
            most,
            lambda outcome: not outcome.regular,
            telescopes=True,
            unit=unit,
            is_full=lambda outcome: len(outcome.steps) == len(steps),
        )
        listed = f"{len(rows)} linear conditions, recomputed from the equations"
        return f"{listed}, leave only singular Hessians."

    def existence(self, document: dict[str, Any]) -> str:
        """Check that the prolonged system is involutive in the named degree and allows a regular
        g(p).

        On return, the dimensions are those named, at the named order and the next one, at all
        points and in balls; the symbol passes Cartan's test with them; and g(p) of a random
        solution is regular.
        """
        count, orders = range(10**9), range(1, fm.MAX_ORDER + 1)
        symbol = {
            "dimension": count,
            "prolonged": count,
            "characters": [count, len(self.variables)],
        }
        shape = {
            "order": orders,
            "degree": orders,
            "dimensions": [count, fm.MAX_ORDER + 1],
            "symbol": symbol,
        }
        check_shape(document, shape, "certificate")
        order = document["order"]
        degree = document["degree"]
        dimensions = list(document["dimensions"])
        require(degree <= order, "degree has to be at most order.")
        if self.is_one_coordinate(document):
            self.prepare(lambda ring: None)
            return "Every equation in one coordinate has a Lagrangian (Sonin 1886, Darboux 1894)."
        idle, degrees = set[Row](), range(degree + 1)
        self.largest = {key: order + 1 - one.order for key, one in self.kinds_of_rows.items()}
        most = order + 1 + max(depth - own for own, depth, _ in self.kinds_of_rows.values())
        flag = self.flag(self.generator)

        def work(ring: Expansion, directions: list[list[int]] = flag) -> Found:
            elimination, found = Elimination(ring.arithmetic, ring.shift), list[list[int]]()
            for step in range(order + 2):
                ring.extend(elimination, step, idle)
                kept = [pivot >> ring.shift for pivot in elimination.pivots]
                free = (len(ring.unknowns(k)) - kept.count(k + ring.offset) for k in degrees)
                found.append([*accumulate(free)])
            regular = ring.arithmetic.regular(ring.matrix(elimination))
            symbol, killed = sr.symbol_of(elimination, ring, degree, directions)
            return Found(elimination.script(), killed.script(), found[order:], regular, symbol)

        def real(ring: Expansion) -> None:
            echelon = sr.followed(ring, steps)
            killed = Elimination(ring.arithmetic, ring.shift)
            names = dict(sr.symbol_rows(echelon, ring, degree, flag))
            for step in killing:
                killed.follow(names[step.row], step)
            if first.regular and not ring.arithmetic.regular(ring.matrix(echelon)):
                raise Unsettled

        self.prepare(lambda ring: None)
        results: list[Found] = self.modulo(most, work)
        first, unit = results[0], self.last_work
        steps = self.agreed(result.steps for result in results)
        killing = self.agreed(result.killing for result in results)
        if any(sizes(result) != sizes(first) for result in results):
            raise Incomplete("The dimensions are different at different points.")
        if not self.rational:
            self.proven_in_balls(most, real, f"{NOT_SHOWN} the ranks are the generic ones.")
        same = first.dimensions == [dimensions] * 2
        require(same, "The dimensions are not those of this order and the next.")
        require(first.regular, "Every remaining multiplier g(p) is singular.")
        found, claimed = first.symbol, claimed_symbol(document, len(first.symbol.characters))
        require(claimed == found, "The symbol has other dimensions.")
        prolonged = sum(k * a for k, a in enumerate(found.characters, 1))
        require(found.prolonged == prolonged, "The symbol is not involutive.")
        # A separate flag for each point, because divisors that belong to a flag are not exceptions.
        self.generic = Generic(
            lambda ring: work(ring, self.flag(random.Random(ring.arithmetic.seed))),
            most,
            lambda outcome: bool(sizes(outcome) == sizes(first)),
            unit=unit,
        )
        told = "The projected system is involutive and leaves a regular multiplier g(p)."
        return told if document.get("series") is None else told + self.series(document["series"])

    def flag(self, draw: random.Random) -> list[list[int]]:
        """A random basis of directions, for Cartan's test."""
        while True:
            found = [[draw.randrange(1, 1 << 20) for _ in self.variables] for _ in self.variables]
            if fmpz_mat(found).det() != 0:
                return found

    def is_one_coordinate(self, document: dict[str, Any]) -> bool:
        """Whether it is x'' = f(t, x, x') with the dimensions of Gamma(g) + g df/dv = 0.

        This equation always has solutions.
        """
        dimensions, symbol = [1, 2], Symbol(1, 1, (1, 0, 0))
        if self.timed:
            dimensions, symbol = [1, 3], Symbol(2, 3, (1, 1, 0))
        alone = len(self.coordinates) == 1 and type(self) is Question
        same = document["dimensions"] == dimensions and claimed_symbol(document, 3) == symbol
        return alone and same and document.get("series") is None

    def series(self, series: Any) -> str:
        """Check that the rows of the claimed order vanish on the given coefficients and g(p) is
        regular.
        """
        point = dict.fromkeys({*self.variables, *self.parameters}, NUMBER)
        shape = {
            "order": range(fm.MAX_ORDER + 1),
            "prime?": range(1 << 127),
            "point": {**point, "pi?": NUMBER},
            "terms": [((range(fm.MAX_ORDER + 3),) * len(self.variables), NUMBER), fm.MAX_ROWS],
        }
        check_shape(series, shape, "certificate.series")
        self.largest = {}
        order, prime, given = series["order"], series.get("prime") or self.prime(), series["point"]
        good = prime >> 30 and prime < 1 << 63 and fmpz(prime).is_probable_prime()
        require(good, "series.prime has to be null, or a prime between 2^30 and 2^63.")
        circular = any("pi" in force for force in self.force_texts)
        if (
            self.where
            or self.functions
            or not self.rational
            or (circular and not series.get("prime"))
        ):
            return (
                " The series was not compared: f is of a motion, has functions, or is not rational."
            )
        require(
            not circular or given.get("pi") is not None, "series.point has to give a value of pi."
        )
        field = Residues(self, prime, 0, {})
        try:
            known = {
                name: Fraction(x) for name in (*point, "pi") if (x := given.get(name)) is not None
            }
            field.values |= {name: field.number(x) for name, x in known.items()}
            terms = {
                self.multi_index(a, order + 2): field.number(Fraction(b))
                for a, b in series["terms"]
            }
            ring = self.expansion(field, order + 2)
        except Undefined:
            raise fm.Ended(
                "invalid", "The point of the series is one where f is not defined."
            ) from None
        for name in (name for degree in range(order + 1) for name in ring.rows(degree)):
            require(ring.solved(ring.row(*name), terms), "The series does not solve the rows.")
        require(field.regular(ring.hessian(terms)), "The series has a singular g(p).")
        return " The series solves the rows."


def sizes(found: Found) -> tuple[Any, ...]:
    """The values that must be the same at every point."""
    return found.dimensions, found.regular, found.symbol


def claimed_symbol(document: dict[str, Any], count: int) -> Symbol:
    """The symbol of a certificate with `count` characters; omitted ones are 0."""
    claimed = document["symbol"]
    listed = [*claimed["characters"], *[0] * (count - len(claimed["characters"]))]
    return Symbol(claimed["dimension"], claimed["prolonged"], tuple(listed))


def read_condition(text: str) -> Condition:
    """The condition of A > B, or of B < A."""
    sides = re.split("[<>]", text)
    require(len(sides) == 2, "A condition has to be of the form A > B or A < B.")
    more, less = (read_tokens(side, "conditions") for side in sides[:: 1 if ">" in text else -1])
    return Condition(more, less)
