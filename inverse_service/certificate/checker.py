"""The independent checker of certificates; FORMAT.md beside this file says what it checks, and why that is enough.

It imports nothing of the project, draws its own points, primes and directions, never searches and never
repairs. Formulas have no trees: the reader computes Taylor series about a point as it reads. Numbers are residues
modulo a prime (`Residues`), which decide what is zero, or balls (`Balls`), which decide what is not.
"""

from __future__ import annotations

import json
import math
import random
import re
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from typing import Any, Literal

from flint import arb, ctx, fmpz, fmpz_mat

from .formulas import (
    CERTIFICATE,
    FORMAT,
    MAX_LISTED,
    MAX_NAMES,
    MAX_ORDER,
    MAX_ROWS,
    NAME,
    NUMBER,
    OLD,
    OLD_FORMAT,
    RESERVED,
    RESULT,
    SYSTEM,
    TEXT,
    VERDICTS,
    Ended,
    Reader,
    check_shape,
    is_irrational,
    read_tokens,
    require,
)  # fmt: skip
from .numbers import Arithmetic, Balls, Number, Place, Residues, Series, Undefined, Unsettled
from .plan import SPARE, Plan
from .series import Count, Elimination, Expansion, Row, Step, followed, symbol_of, symbol_rows

PRECISIONS = (192, 512, 2048, 8192)  # bits of balls
MAX_RARITY = 1 << 18  # one of about so many primes has all roots that are needed of it
MAX_ATOMS = 40  # between which all linear relations are looked for
Tools = tuple[random.Random, float]  # and the end of its processor time


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The checker's verdict, and sentences that give its reasons."""

    verdict: Literal["valid", "incomplete", "invalid"]
    reasons: tuple[str, ...] = ()


@dataclass(slots=True)
class Claims:
    """What has to be zero in the ring, and which matrices regular at the point; a sentence says what else is wrong."""

    zeros: list[tuple[Series, str]]
    regular: list[tuple[list[list[Number]], str]]


class Question:
    """A system q'' = f as read, whether L may depend on t, and the checks of certificates that answer this.

    `claim` gives the set of the claim: `near`, `conditions`, `roots`.
    """

    jet = 2  # the derivatives of L that are needed
    kind: Any = None  # of the Lagrangians asked about

    def __init__(self, tools: Tools, document: Any, timed: bool = True, claim: Any = None) -> None:
        (self.generator, self.deadline), self.timed, claim = tools, timed, claim or {}
        self.read_system(document)
        self.content = (self.coordinates, {*self.parameters}, self.functions, self.force_texts)
        self.contains_time = any("t" in force for force in self.force_texts)
        require(timed or not self.contains_time, "f contains t: the question has to be time_dependent.")
        self.variables = ["t"] * timed + self.coordinates + [name + "'" for name in self.free]
        self.names = {"t", *self.variables, *self.parameters}
        self.set_of_claim(claim)
        self.integrals = dict[str, tuple[list[str], tuple[str, tuple[str, ...]]]]()
        self.orders = {"H2": 1, "H3": 0}  # of the conditions
        self.halves, self.plan, self.place = False, Plan([], 0), Place(self.generator, {})

    def read_system(self, document: Any) -> None:
        check_shape(document, SYSTEM, "system")
        self.coordinates, self.parameters = document["coordinates"], document.get("parameters") or []
        self.functions, equations = document.get("functions") or {}, document["equations"]
        check_shape(list(self.functions.items()), [(NAME, [NAME, 6]), MAX_NAMES], "system.functions")
        names = [*self.coordinates, *self.parameters, *self.functions]
        good = self.coordinates and all(self.functions.values()) and {*equations} == {*self.coordinates}
        good = good and len({*names} - RESERVED) == len(names)
        require(good, "system has to declare names once, none with a meaning of its own, and an equation for each.")
        self.free = self.coordinates
        self.force_texts = [read_tokens(equations[name], f"system.equations.{name}") for name in self.coordinates]

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        """Series about a point, and the conditions in them."""
        return Expansion(arithmetic, degree)

    def set_of_claim(self, claim: dict[str, Any]) -> None:
        near, shape = claim.get("near") or {}, {"conditions?": [TEXT, MAX_LISTED], "roots?": [{}, MAX_LISTED]}
        check_shape(near, dict.fromkeys(near, NUMBER), "near")
        require({*near} <= self.names, "near holds a name that the system does not know.")
        self.near = {name: Fraction(value) for name, value in near.items()}
        check_shape(claim, shape, "certificate")
        self.conditions, self.roots = list[tuple[tuple[str, ...], ...]](), list[tuple[tuple[str, ...], ...]]()
        for text in claim.get("conditions") or []:
            sides = re.split("[<>]", text)
            require(len(sides) == 2, "A condition has to be of the form A > B or A < B.")
            self.conditions.append(
                tuple(read_tokens(side, "conditions") for side in sides[:: 1 if ">" in text else -1])
            )
        for entry in claim.get("roots") or []:
            check_shape(entry, {"root": TEXT, "is": TEXT}, "roots")
            self.roots.append((read_tokens(entry["root"], "roots.root"), read_tokens(entry["is"], "roots.is")))

    def texts(self) -> list[tuple[str, ...]]:
        """The formulas of the system and of the set of the claim."""
        return [*self.force_texts, *(side for pair in (*self.conditions, *self.roots) for side in pair)]

    def check_time(self) -> None:
        if not time.thread_time() < self.deadline:
            raise Ended("incomplete", "The time limit ended the check.")

    def read_all(self, ring: Any) -> list[Any]:
        """The conditions and roots, as logarithms of what they say is positive; then the right sides f."""
        hinted = not self.rational or isinstance(getattr(ring, "arithmetic", None), Balls)
        degree, ring.degree = ring.degree, 0
        for more, less in self.conditions if hinted else ():
            ring.elementary("log", ring.add([Reader(ring, more).value, Reader(ring, less).value], [1, -1]))
        for root, found in self.roots if hinted else ():
            ring.elementary("log", value := Reader(ring, found).value)
            ring.ties.append(
                ring.multiply(ring.add([Reader(ring, root).value, value], [1, -1]), ring.constant(Fraction(1)), 0)
            )
        ring.degree = degree
        return [Reader(ring, force).value for force in self.force_texts]

    def prepare(
        self, read: Callable[[Any], object], formulas: Iterable[tuple[str, ...]] = (), rational: bool = True
    ) -> None:
        """Bounds by a count; where not all is rational in everything, a point and a plan of the atoms first.

        `read` reads what the certificate has beside f, and is called with rings of all kinds.
        """
        self.rational, self.read = rational and not any(map(is_irrational, [*self.texts(), *formulas])), read
        if self.conditions or self.near or not self.rational:
            trace = self.locate()
        if not self.rational:
            self.make_plan(trace)
        else:
            self.modulo(0, read, 1)
        self.read(Count(self))
        if self.roots:
            self.settle(
                0, lambda ring: Claims([(tie, "A root is not what it is said to be.") for tie in ring.ties], [])
            )

    def locate(self) -> list[tuple[bool, bool, arb]]:
        """A real point where all is defined and the conditions hold: the one named, as far as it is named."""
        free = self.names - {*self.near} or self.functions
        for attempt in range(60 if free else 1):
            values = {name: Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 30) + attempt % 2
                      for name in sorted(self.names)}  # fmt: skip
            self.place = Place(self.generator, values | self.near)
            try:
                trace: list[tuple[bool, bool, arb]] = self.in_balls(0, self.traced)
                return trace
            except (Undefined, Unsettled):
                self.check_time()
        raise Ended("incomplete", "No point was found at which every formula is defined and every condition holds.")

    def traced(self, ring: Expansion) -> list[tuple[bool, bool, arb]]:
        self.read(ring)
        trace: list[tuple[bool, bool, arb]] = ring.arithmetic.trace
        return trace

    def make_plan(self, trace: list[tuple[bool, bool, arb]]) -> None:
        distinct = min(MAX_ATOMS, len({(imaginary, value.str(20, radius=False)) for _, imaginary, value in trace}))
        bits, center = min(600 + 60 * distinct, 4000), self.place
        with ctx.workprec(bits):
            first = self.expansion(Balls(self, center, None), 0)
            traces = [self.traced(first)]
            for _ in range(20 * distinct + 200):
                if len(traces) > distinct + SPARE:
                    break
                try:
                    traces.append(self.traced(self.expansion(Balls(self, center.neighbour(), None), 0)))
                except (Undefined, Unsettled):
                    self.check_time()
            self.plan = Plan(traces, bits, self.check_time)
            self.plan.classes = first.arithmetic.met  # for which the plan holds
        if self.plan.halved and not self.halves:
            self.halves = True
            self.make_plan(trace)

    def in_balls(self, degree: int, work: Callable[[Expansion], Any], classes: list[int] | None = None) -> Any:
        """The work in balls at the point, with more digits until they suffice."""
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
            raise Ended("incomplete", sentence) from None

    def modulo(self, degree: int, work: Callable[[Expansion], Any], count: int = 2) -> list[Any]:
        """What the work gives at random points modulo so many random primes, where f is defined and all roots split."""
        found, prime = list[Any](), 0
        for attempt in range(2000):
            prime = prime if attempt % 8 else self.prime()
            try:
                seed = self.generator.getrandbits(64)
                if degree and self.plan.choices > 1:
                    self.read(self.expansion(Residues(self, prime, seed), 0))
                ring = self.expansion(Residues(self, prime, seed), degree)
                found.append(work(ring))
            except Undefined:
                self.check_time()
                continue
            known, met = self.plan.classes or [], ring.arithmetic.classes  # one work reads further than another
            if any(one != other for one, other in zip(known, met, strict=False)):
                raise Ended("incomplete", "Arguments of a function agree at one point and not at another.")
            self.plan.classes, prime = max(known, met, key=len), self.prime()
            if len(found) == count:
                return found
        raise Ended("incomplete", "No point was found at which every formula is defined.")

    def prime(self) -> int:
        """A random prime of 61 bits modulo which all numbers have the roots that the plan takes of them."""
        step = 24 * math.lcm(*[2 * pair.scale for pair in self.plan.pairs if pair.logarithm])
        roots = [(pair.number, pair.scale) for pair in self.plan.pairs if pair.number > 1]
        if step * math.prod([scale for _, scale in roots]) > MAX_RARITY:  # a text could hold all such primes
            raise Ended("incomplete", "Roots of numbers are too many: too few primes have them all.")
        for _ in range(1_000_000):
            prime = self.generator.randrange((1 << 60) // step, (1 << 61) // step) * step + 1
            if fmpz(prime).is_probable_prime() and all(pow(q, (prime - 1) // n, prime) == 1 for q, n in roots):
                return prime
            self.check_time()
        raise Ended("incomplete", "No prime was found modulo which all numbers have their roots.")

    def settle(self, degree: int, claims: Callable[[Expansion], Claims], count: int = 2) -> None:
        """Zeros by algebra, regular matrices by balls; what is not zero in the ring may be refuted by balls."""
        doubts = dict[int, str]()

        def exact(ring: Expansion) -> None:
            found = claims(ring)
            doubts.update({k: text for k, (value, text) in enumerate(found.zeros) if ring.arithmetic.settle(value)})
            for matrix, sentence in found.regular:
                require(ring.arithmetic.regular(matrix), sentence)

        def real(ring: Expansion) -> None:
            found = claims(ring)
            for k, sentence in doubts.items():
                require(all(value.contains(0) for value in found.zeros[k][0].values()), sentence)
            if doubts or not all(ring.arithmetic.regular(matrix) for matrix, _ in found.regular):
                raise Unsettled

        self.modulo(degree, exact, count)
        require(not (doubts and self.rational), next(iter(doubts.values()), ""))
        if not self.rational:
            told = f"It could not be settled whether this is so: {next(iter(doubts.values()))}" if doubts else (
                "Balls at the real point do not show that a matrix is regular.")  # fmt: skip
            self.proven_in_balls(degree, real, told)

    def lagrangian(self, document: dict[str, Any]) -> str:
        """L_(v_i v_j) f^j + L_(v_i q_j) v^j + L_(v_i t) = L_(q_i), and the matrix L_(v_i v_j) is regular."""
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")
        tokens = formula + self.read_integrals(document.get("integrals") or {})
        require(self.timed or "t" not in tokens, "The Lagrangian contains t, but the question does not.")

        def claims(ring: Expansion) -> Claims:
            lagrangian, zeros = Reader(ring, formula).value, list[tuple[Series, str]]()
            drag = self.dissipation(ring)
            rates = {unit: rate.get(0, 0) for unit, rate in zip(ring.units, ring.field, strict=True)}
            for v, q, name in zip(ring.v, ring.q, self.coordinates, strict=True):
                slope = ring.derivative(lagrangian, v)
                terms = [value * rates[key] for key, value in slope.items() if key in rates]
                terms += [-drag.get(ring.units[v], 0)]
                residual = ring.arithmetic.settle({0: sum(terms, -lagrangian.get(ring.units[q], 0))})
                zeros.append((residual, f"The Euler-Lagrange equation of {name} does not hold."))
            zeros += self.further(ring, lagrangian, drag)
            return Claims(zeros, [(ring.hessian(lagrangian), "The Hessian of the Lagrangian is singular.")])

        self.prepare(lambda ring: Reader(ring, formula).value, [tokens])
        self.settle(self.jet, claims, 3 if self.rational else 2)
        return "The Euler-Lagrange equations of the Lagrangian hold and its Hessian is regular."

    def dissipation(self, ring: Any) -> Series:
        """What stands on the right of the Euler-Lagrange equations, by its v-derivatives; only a kind has it."""
        return {}

    def further(self, ring: Any, lagrangian: Series, drag: Series) -> list[tuple[Series, str]]:
        """What else has to be zero for a Lagrangian of the kind."""
        return []

    def read_integrals(self, listed: dict[str, Any]) -> tuple[str, ...]:
        """The functions that are known by one derivative, which may hold those before them; the tokens of all."""
        check_shape(listed, {}, "integrals")
        check_shape(listed, {key: {"arguments": [NAME, 6], "derivatives": {}} for key in listed}, "integrals")
        check_shape(list(listed), [NAME, MAX_NAMES], "integrals")
        require(
            not {*listed} & ({*self.names, *self.functions} | RESERVED), "An integral has the name of another thing."
        )
        require(all(map({*listed}.isdisjoint, self.texts())), "Only the Lagrangian may hold integrals.")
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
            strange = {*pair[1]} & {"t", *self.variables} - {*arguments}
            require(not strange, f"integrals.{name} has a derivative that holds what is no argument.")
            self.integrals[name] = (arguments, pair)
            tokens += (*arguments, *pair[1])
        return tokens

    def multi_index(self, exponents: list[int], most: int) -> int:
        require(sum(exponents) <= most, f"A multi-index has to have a total of at most {most}.")
        return sum(exponent << 8 * a for a, exponent in enumerate([*exponents, sum(exponents)]))

    def agreed(self, scripts: Iterable[list[Step]]) -> list[Step]:
        """The rows and pivots of eliminations at several points, which have to be the same."""
        first, *others = scripts
        for other in others:
            if [step[:2] for step in other] != [step[:2] for step in first]:
                raise Ended("incomplete", "The elimination takes different pivots at different points.")
            first = [(*step[:2], step[2] | more[2]) for step, more in zip(first, other, strict=True)]
        return first

    def listed(self, document: dict[str, Any]) -> tuple[list[Row], int]:
        """The rows of a document in the order of their elimination, and the degree to which f is needed."""
        index, exponents, m = range(len(self.coordinates)), range(MAX_ORDER + 1), len(self.variables)
        shape = {"order": exponents, "rows": [("|".join(self.orders), index, index, (exponents,) * m), MAX_ROWS]}
        check_shape(document, shape, "certificate")
        order, listed = document["order"], document["rows"]
        good = all(i < j if kind == "H3" else i == j if kind[0] == "S" else i <= j for kind, i, j, _ in listed)
        require(good, "A row of H2 or K needs i <= j, a row of H3 i < j, a row of S i = j.")
        rows = [(kind, i, j, self.multi_index(alpha, order - self.orders[kind])) for kind, i, j, alpha in listed]
        degree = {row: (row[3] >> 8 * m) + self.orders[row[0]] for row in rows}
        rows.sort(key=lambda row: (degree[row], row[0], *(-index for index in row[1:])))  # this fills in least
        spare = 2 * (self.kind == "rayleigh")  # for the even part of f
        return rows, max((degree[row] + 2 * (row[0] != "H2") for row in rows), default=0) + spare

    def nonexistence(self, document: dict[str, Any]) -> str:
        rows, most = self.listed(document)
        require(len(set(rows)) == len(rows), "A row is named twice.")

        def work(ring: Expansion) -> tuple[list[Step], bool]:
            echelon = Elimination(ring.arithmetic, ring.shift)
            for row in rows:
                echelon.insert(ring.row(*row), row)
            return echelon.script(), ring.arithmetic.regular(ring.matrix(echelon))

        def real(ring: Expansion) -> None:
            echelon = followed(ring, steps)
            regular and ring.arithmetic.regular(ring.matrix(echelon))

        self.prepare(lambda ring: None)
        scripts, singular = zip(*self.modulo(most, work), strict=True)
        steps, regular = self.agreed(scripts), any(singular)
        if not self.rational:
            self.proven_in_balls(most, real, "Balls at the real point do not show that the rows are independent.")
        require(not regular, "The rows leave a regular multiplier g(p).")
        return f"{len(rows)} rows leave no regular multiplier g(p)."

    def existence(self, document: dict[str, Any]) -> str:
        count, orders = range(10**9), range(1, MAX_ORDER + 1)
        symbol = {"dimension": count, "prolonged": count, "characters": [count, len(self.variables)]}
        shape = {"order": orders, "degree": orders, "dimensions": [count, MAX_ORDER + 1], "symbol": symbol}
        check_shape(document, shape, "certificate")
        order, degree, dimensions = document["order"], document["degree"], list(document["dimensions"])
        require(degree <= order, "degree has to be at most order.")
        idle, degrees = set[Row](), range(degree + 1)
        directions: list[list[int]] = []
        while not directions or fmpz_mat(directions).det() == 0:
            directions = [[self.generator.randrange(1, 1 << 20) for _ in self.variables] for _ in self.variables]

        def work(ring: Expansion) -> tuple[Any, ...]:
            elimination, found = Elimination(ring.arithmetic, ring.shift), list[list[int]]()
            for step in range(order + 2):
                ring.extend(elimination, step, idle)
                kept = [pivot >> ring.shift for pivot in elimination.pivots]
                found.append([*accumulate(len(ring.unknowns(k)) - kept.count(k + 2) for k in degrees)])
            regular = ring.arithmetic.regular(ring.matrix(elimination))
            sizes, killed = symbol_of(elimination, ring, degree, directions)
            return elimination.script(), killed.script(), found[order:], regular, sizes

        def real(ring: Expansion) -> None:
            echelon = followed(ring, steps)
            killed = Elimination(ring.arithmetic, ring.shift)
            names = dict(symbol_rows(echelon, ring, degree, directions))
            for step in killing:
                killed.follow(names[step[0]], step)
            regular and ring.arithmetic.regular(ring.matrix(echelon))

        self.prepare(lambda ring: None)
        results = self.modulo(order + 3, work)
        steps, killing = (self.agreed(result[k] for result in results) for k in (0, 1))
        found, regular, sizes = results[0][2:]
        if any(result[2:] != results[0][2:] for result in results):
            raise Ended("incomplete", "The dimensions are different at different points.")
        if not self.rational:
            self.proven_in_balls(
                order + 3, real, "Balls at the real point do not show that the ranks are the generic ones."
            )
        require(found == [dimensions] * 2, "The dimensions are not those of this and the next order.")
        require(regular, "No multiplier g(p) that is left is regular.")
        claimed = document["symbol"]
        given = [claimed["dimension"], claimed["prolonged"], *claimed["characters"]]
        require([*given, *[0] * (len(sizes) - len(given))] == sizes, "The symbol has other dimensions.")
        require(sizes[1] == sum(k * a for k, a in enumerate(sizes[2:], 1)), "The symbol is not involutive.")
        told = "The projected system is involutive and leaves a regular multiplier g(p)."
        return told if document.get("series") is None else told + self.series(document["series"])

    def series(self, series: Any) -> str:
        """The rows of the order that it claims vanish on the given coefficients, and g(p) is regular."""
        point = dict.fromkeys({*self.variables, *self.parameters}, NUMBER)
        shape = {"order": range(MAX_ORDER + 1), "prime?": range(1 << 127), "point": {**point, "pi?": NUMBER},
                 "terms": [((range(MAX_ORDER + 3),) * len(self.variables), NUMBER), MAX_ROWS]}  # fmt: skip
        check_shape(series, shape, "certificate.series")
        order, prime, given = series["order"], series.get("prime") or self.prime(), series["point"]
        good = prime >> 30 and prime < 1 << 63 and fmpz(prime).is_probable_prime()
        require(good, "series.prime has to be null, or a prime between 2^30 and 2^63.")
        circular = any("pi" in force for force in self.force_texts)
        if self.functions or not self.rational or (circular and not series.get("prime")):
            return " The series was not compared: not all in it is rational, or functions are arbitrary."
        require(not circular or given.get("pi") is not None, "series.point has to give a value of pi.")
        field = Residues(self, prime, 0)
        try:
            field.values |= {
                name: field.number(Fraction(x)) for name in (*point, "pi") if (x := given.get(name)) is not None
            }
            terms = {self.multi_index(a, order + 2): field.number(Fraction(b)) for a, b in series["terms"]}
            ring = Expansion(field, order + 2)
        except Undefined:
            raise Ended("invalid", "The series stands at a point where f is not defined.") from None
        for name in (name for degree in range(order + 1) for name in ring.rows(degree)):
            require(ring.solved(ring.row(*name), terms), "The series does not solve the rows.")
        require(field.regular(ring.hessian(terms)), "The series has a singular g(p).")
        return " The series solves the rows."


def judged(work: Callable[[Tools], list[str]], time_limit: float, seed: int | None) -> CheckResult:
    try:
        return CheckResult("valid", tuple(work((random.Random(seed), time.thread_time() + time_limit))))
    except Ended as end:
        return CheckResult(end.args[0], end.args[1:])
    except (Undefined, Unsettled, StopIteration):
        return CheckResult("incomplete", ("A number in the document could not be computed.",))
    except (RecursionError, MemoryError, OverflowError):
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
    return (check_certificate if kind in (FORMAT, OLD_FORMAT) else check_result)(document, time_limit, seed)


def check_certificate_shape(document: Any) -> None:
    if isinstance(document, dict) and document.get("format") == OLD_FORMAT:
        raise Ended("incomplete", OLD)
    check_shape(document, CERTIFICATE, "certificate")


def certified(document: Any, tools: Tools) -> str:
    """Check a certificate; the sentence that says what was found."""
    check_certificate_shape(document)
    kind, proven = document["kind"], "not_variational" if document["kind"] == "nonexistence" else "variational"
    require(document["claim"] == proven, f"A certificate of kind {kind} has to claim {proven}.")
    from .constraints import Motion  # which is a Question
    from .kinds import OfKind

    moving, among = isinstance(document["system"].get("velocities"), dict), document.get("among")
    require(not moving or among is None, "A motion on constraints is asked about with all Lagrangians.")
    kind_of = Motion if moving else Question if among is None else OfKind
    asked = kind_of(tools, document["system"], document["question"] == "time_dependent", document)
    checks = {"lagrangian": asked.lagrangian, "existence": asked.existence, "nonexistence": asked.nonexistence}
    return checks[kind](document) + (f" Only Lagrangians of a kind are meant: {among}." if among is not None else "")


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
    others = list(motions(result.get("any_associated")))
    if result.get("kinds") is not None or result.get("instead") is not None:
        from .kinds import certificates_of

        for among, one, always in certificates_of(result.get("kinds") or {}, result.get("instead")):
            timed = not always or system.contains_time
            asked = "time_dependent" if timed else "autonomous"
            others.append(agreed(one, one["verdict"], asked, system, tools, among))
    found = [certified(one, tools) for one in (*certificates, *others) if one]
    proven = later is None or any(one and proves(one, "time_dependent", later) for one in certificates)
    if not proven or None in certificates or "undetermined" in (verdict, later):
        raise Ended("incomplete", "A verdict is undetermined, or no certificate proves it.")
    return found if result["system"].get("given") is None else [*found, "The equations as given were not compared."]


def motions(answer: Any) -> list[Any]:
    """The certificates of what a result says about a motion on constraints, each for one of its verdicts."""
    if answer is None:
        return []
    check_shape(answer, {"verdict": VERDICTS, "verdict_with_time": VERDICTS}, "any_associated")
    verdicts = {answer["verdict"], answer["verdict_with_time"]}
    found = [one for key in ("certificate", "certificate_with_time") if (one := answer.get(key)) is not None]
    for one in found:
        check_certificate_shape(one)
        good = one["claim"] in verdicts and one.get("among") is None
        require(good, "A certificate does not claim the verdict that it stands beside.")
    require(
        {one["claim"] for one in found} == verdicts - {"undetermined"}, "A verdict on the motion has no certificate."
    )
    return found


def proves(certificate: dict[str, Any], question: str, verdict: str | None) -> bool:
    """Whether the certificate's claim, if right, makes the verdict right."""
    wider = "time_dependent" if verdict == "not_variational" else "autonomous"
    return certificate["claim"] == verdict and certificate["question"] in (question, wider)


def agreed(
    answer: dict[str, Any], verdict: str | None, question: str, system: Question, tools: Tools, among: Any = None
) -> Any:
    """The certificate of an answer, if it has one, once it is seen to speak of the same things."""
    certificate, shown = answer.get("certificate"), answer.get("lagrangian")
    if certificate is None:
        return None
    check_certificate_shape(certificate)
    good = proves(certificate, question, verdict) and certificate.get("among") == among
    require(good, "A certificate does not claim the verdict that it stands beside.")
    require(system.content == Question(tools, certificate["system"]).content, "A certificate is about another system.")
    formula = None if shown is None else read_tokens(shown.get("text"), "lagrangian.text")
    certain = read_tokens(certificate.get("lagrangian"), "lagrangian") if certificate["kind"] == "lagrangian" else None
    require(formula == certain, "The Lagrangian of an answer is not the one that its certificate proves.")
    return certificate
