"""Decide a second-order system by the Helmholtz conditions, with the answer in terms of mechanics.

`Analysis` is a system with its atoms reduced to independent generators, the input of every later
stage.

`regular_series` makes existence concrete by computing the Taylor coefficients of one regular
Lagrangian at a point.

The prolonged Helmholtz conditions are linear in the Taylor coefficients of L of v-degree >= 2. In
their echelon form with columns in ascending degree, the pivot of each row is its last column, so
the coefficients follow one after another: those without a pivot are chosen, and the others are
determined by earlier ones. If the system is prolonged until its projection to the wanted order
contains no new conditions (Cartan, Kuranishi), the polynomial is the beginning of the series of an
actual solution.

Its rational coefficients are computed modulo several primes at a point with small integers,
combined by the Chinese remainder theorem, and reconstructed as fractions (Wang 1981); one more
prime confirms them.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import comb, isqrt
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from inverse_service import bounds, deadline, errors
from inverse_service.decision import helmholtz, solutions
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import dense_series as machine, modular, real_branch
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.real_branch import RealTable, find_real_point, first_real_point
from inverse_service.field.tower import Tower, draw_point, to_kernels
from inverse_service.linear_pde import equations as pde, involution
from inverse_service.mechanics import conditions, second_order_system
from inverse_service.statements import reasons
from inverse_service.statements.questions import Question
from inverse_service.statements.stages import Progress

if TYPE_CHECKING:
    from inverse_service.certificate import checker


# (kind, i, j, alpha): which Helmholtz equation, which Taylor coefficient of it.
RowName = tuple[str, int, int, tuple[int, ...]]

_VERDICTS: Mapping[bool | None, solutions.Verdict] = {
    True: "variational",
    False: "not_variational",
    None: "undetermined",
}

_MOST_PRIMES = 12

Index = tuple[int, ...]
Key = TypeVar("Key")


class Proof(NamedTuple):
    """A certificate, and what the checker says of it."""

    certificate: dict[str, Any]
    found: checker.CheckResult


@dataclass(frozen=True, slots=True)
class Analysis:
    """f in kernels and the tower of its atoms, built once for both questions.

    `towers` caches the `KnownTower`s of ansätze, with their random points, which lie on the
    constraints if velocities are `constrained` to be functions of the others. `proofs` caches the
    results of the checker, `proposals` what searches for L(q, v) and L(t, q, v), and explanations,
    share.
    """

    system: second_order_system.SecondOrderSystem
    accelerations: tuple[ex.Expression, ...]
    tower: Tower
    real_point: RealTable | None
    constrained: Mapping[ex.Velocity, ex.Expression] = field(default_factory=dict)
    towers: list[Any] = field(default_factory=list, compare=False, repr=False)
    proofs: dict[str, Proof] = field(default_factory=dict, compare=False, repr=False)
    proposals: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


def variables_of(system: second_order_system.SecondOrderSystem) -> tuple[modular.Variable, ...]:
    """t, q, v, the parameters, and accelerations that are symbols."""
    return (*system.variables, *map(ex.Symbol, system.parameters), *system.letters)


def moving_variables(
    system: second_order_system.SecondOrderSystem, question: Question
) -> tuple[modular.Variable, ...]:
    """(t?, q, v)."""
    return variables_of(system)[not question.timed : 1 + 2 * len(system.coordinates)]


def analyze(system: second_order_system.SecondOrderSystem) -> Analysis:
    """The analysis of the system's first branch; IrreducibleAtoms if relations among the atoms
    cannot be decided.
    """
    system = second_order_system.branches_of(system)[0]
    kernels = tuple(to_kernels(f) for f in system.accelerations)
    table = _real_point(system, kernels)
    return Analysis(
        system, kernels, real_branch.reduce_atoms(kernels, variables_of(system), table), table
    )


def _real_point(
    system: second_order_system.SecondOrderSystem, kernels: Sequence[ex.Expression]
) -> RealTable | None:
    """A real point of a branch; IrreducibleAtoms if its formula cannot be separated from other
    pieces without one.
    """
    variables, positive = variables_of(system), system.positive
    # The other pieces of a piecewise formula need not be defined on this piece.
    roots = system.branch.roots if system.branch else ()
    pieces = {node: one for node, one in roots if isinstance(node, ex.Apply)}
    if (
        pieces
        and find_real_point(tuple(map(to_kernels, system.given)), variables, 1, positive) is None
    ):
        raise errors.IrreducibleAtoms(_alone(system))
    given = [to_kernels(ex.substitute(f, pieces)) for f in system.given] if positive else []
    # First-order equations in which one unknown became the velocity: choose positive unknowns and
    # rates if possible, as for predators and prey.
    wanted = (
        [*map(ex.Symbol, system.parameters), *(tree for _, tree in system.others)]
        if system.others
        else []
    )
    return first_real_point([*kernels, *given], variables, ((*positive, *wanted), positive))


def _alone(system: second_order_system.SecondOrderSystem) -> str:
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    equations = ", ".join(f"{name}'' = {printing.to_text(f)}" for name, f in pairs)
    return f"other pieces of the formula seem to have no real value here; submit this piece alone, {equations}"


def verdict_of(exists: bool | None) -> solutions.Verdict:
    """The verdict on a question; undetermined where it is not known."""
    return _VERDICTS[exists]


def is_irrational(node: ex.Expression) -> bool:
    """Whether the topmost operation of a formula is not rational."""
    if isinstance(node, ex.Power):
        return not (isinstance(node.exponent, ex.Number) and node.exponent.value.denominator == 1)
    return isinstance(node, ex.Apply | ex.Arbitrary)


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict on one question with its proof.

    `rows` are the names of the prolonged equations used for a negative verdict, `space` and
    `symbol` (at `degree`) the involution data of a positive verdict, and `points` the primes and
    seeds used.
    """

    verdict: solutions.Verdict
    question: Question
    order: int
    open: reasons.Open | None = None
    rows: tuple[RowName, ...] = ()
    space: solutions.SolutionSpace | None = None
    symbol: involution.Symbol | None = None
    degree: int = 0
    history: tuple[tuple[int, ...], ...] = ()
    points: tuple[Mapping[str, int], ...] = ()
    seconds: float = 0.0


class HelmholtzAt:
    """The Helmholtz conditions of one system at random points, or at the points that `draw`
    returns.

    `involution.settle` asks for the `unknowns`, the `matrix` that must be regular, and the
    equations `at` each point.
    """

    others: tuple[involution.Matrix, ...] = ()

    __slots__ = ("_added", "_among", "_n", "_registers", "_series", "matrix", "unknowns")

    def __init__(
        self,
        analysis: Analysis,
        question: Question,
        among: helmholtz.Among = (),
        draw: Callable[[int], modular.Point] | None = None,
    ) -> None:
        variables = moving_variables(analysis.system, question)
        n, size, self._among = len(analysis.accelerations), len(variables), among
        self._n, self._added = n, tuple[helmholtz.Added, ...]()
        self.unknowns: pde.Unknowns = helmholtz.unknowns_of(n, size)
        self.matrix: involution.Matrix = helmholtz.multiplier_matrix(n, size)

        def write(order: int) -> tuple[machine.SeriesProgram, involution.Integers]:
            given = conditions.tensor_series(variables, analysis.accelerations, order)
            self._registers, self._added = given.registers, helmholtz.added_equations(among, given)
            return given.program, given.program.listed

        self._series = involution.Coefficients(
            write, draw or (lambda seed: draw_point(analysis.tower, seed))
        )

    def at(self, seed: int, order: int) -> pde.LocalEquations:
        """The local equations at a point, including those of the requested kind of L."""
        _, registers = self._series.at(seed, order)
        found = helmholtz.compiled_equations(self._registers, self._n, order, registers)
        if not self._among:
            return found
        more = [
            pde.Equations(
                one.kind,
                one.pairs,
                one.order,
                pde.term_table(self.unknowns, one.terms, len(one.pairs), registers, order),
            )
            for one in self._added
        ]
        own = () if helmholtz.ANY_FRICTION in self._among else found.equations
        return replace(found, equations=(*own, *more))


def decide(
    system: second_order_system.SecondOrderSystem,
    question: Question,
    seed: int = 1,
    limits: involution.Limits | None = None,
    progress: Progress | None = None,
    analysis: Analysis | None = None,
    among: helmholtz.Among = (),
) -> Decision:
    """Is there a regular L(q, v), or a regular L(t, q, v), as the question says?

    Two points over two primes must agree. The verdict is `undetermined`, with the reason, if they
    do not, if the atoms of f cannot be reduced, or if a limit is reached. If f contains t, the
    question is about L(t, q, v). `among` restricts it to a kind of Lagrangian.
    """
    began = deadline.now()
    question = question.widened(system.depends_on_time)
    try:
        analysis = analysis or analyze(system)
        found = None if among else _of_one_coordinate(analysis, question, seed)
        if found is None:
            card = HelmholtzAt(analysis, question, among)
            found = involution.settle(
                card, seed, limits or involution.Limits(), progress or (lambda _: None)
            )
    except errors.IrreducibleAtoms as problem:
        return Decision("undetermined", question, 0, reasons.irreducible(problem.detail))
    return replace(_decision(found, question), seconds=deadline.now() - began)


def is_refused_at_a_point(
    analysis: Analysis, question: Question, seed: int, limits: involution.Limits
) -> bool:
    """Whether no regular L is left at the first of the two points of `decide`: half of a no, which
    proves nothing.
    """
    if len(analysis.system.coordinates) == 1:
        return False
    question = question.widened(analysis.system.depends_on_time)
    run = involution.Run(HelmholtzAt(analysis, question), 2 * seed, limits, lambda _: None)
    try:
        return involution.settle_once(run).exists is False
    except (errors.IrreducibleAtoms, TooLarge):
        return False


def _of_one_coordinate(
    analysis: Analysis, question: Question, seed: int
) -> involution.Finding | None:
    """Always yes where f has values: g only has to satisfy Gamma(g) + g df/dv = 0 (Darboux 1894,
    no. 604).

    No displacement is characteristic, so g on t = 0, or on q = 0, is arbitrary. None for more
    coordinates.
    """
    if len(analysis.system.coordinates) > 1:
        return None
    point = draw_point(analysis.tower, seed)
    try:
        modular.evaluate(analysis.accelerations[0], point, {})
    except modular.SingularPoint:
        return None
    symbol = (
        involution.Symbol(2, 3, (1, 1, 0)) if question.timed else involution.Symbol(1, 1, (1, 0))
    )
    history = ((1,), (1, 3), (1, 3, 6)) if question.timed else ((1,), (1, 2), (1, 2, 3))
    points = ({"prime": point.prime, "seed": seed},)
    return involution.Finding(True, 2, symbol=symbol, degree=1, history=history, points=points)


def _decision(found: involution.Finding, question: Question) -> Decision:
    space, symbol = None, found.symbol
    if symbol is not None:
        dimensions = found.history[found.order]
        words = statement(dimensions[found.degree], symbol.characters)
        space = solutions.SolutionSpace(found.order, dimensions, symbol.characters, True, words)
    rows = cast(tuple[RowName, ...], found.rows)
    return Decision(
        _VERDICTS[found.exists], question, found.order, found.open, rows, space, symbol, found.degree,
        found.history, found.points,
    )  # fmt: skip


def statement(dimension: int, characters: tuple[int, ...]) -> str:
    """A sentence: on how many constants, or functions of how many variables, the multiplier
    depends.
    """
    highest = max((k for k, a in enumerate(characters, start=1) if a), default=0)
    if highest == 0:
        return f"the multiplier depends on {_count(dimension, 'constant')}"
    functions = _count(characters[highest - 1], "function")
    return f"the multiplier depends on {functions} of {_count(highest, 'variable')}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def is_rational(analysis: Analysis) -> bool:
    """Whether f is a rational function of t, q, v, the parameters and pi."""
    return not any(is_irrational(node) for f in analysis.accelerations for node in ex.walk(f))


def count_coefficients(n: int, question: Question, order: int) -> int:
    """The number of unknowns: monomials of v-degree >= 2 and total degree <= order + 2."""
    rest, degree = n + question.timed, order + 2
    return (
        comb(rest + n + degree, degree)
        - comb(rest + degree, degree)
        - n * comb(rest + degree - 1, degree - 1)
    )


def regular_series(
    analysis: Analysis, question: Question, order: int, seed: int, spare: int = 0
) -> dict[str, Any]:
    """One regular solution of the Helmholtz conditions to order `order` at a random point modulo a
    prime.

    The `series` of an existence certificate: {"order", "point", "prime", "terms"}, the terms being
    [multi-index, value] for v-degree >= 2 and total degree <= order + 2. The system is prolonged to
    `order + spare` and projected. ValueError if f is not rational, or no regular solution is found.
    """
    if not is_rational(analysis):
        raise ValueError("a series modulo a prime needs a rational f")
    for attempt in range(bounds.ATTEMPTS):
        point = draw_point(analysis.tower, seed + attempt)
        try:
            found = regular_at(
                analysis, point, question, (order, spare), _at_random(f"series {seed} {attempt}")
            )
        except modular.SingularPoint:
            continue
        if found is not None:
            return {
                "order": order,
                "point": {
                    printing.to_text(s): str(point.variable(s)) for s in symbols_of(analysis)
                },
                "prime": point.prime,
                "terms": [[list(index), str(value)] for index, value in found.items() if value],
            }
    raise ValueError("no regular solution was met at any point tried")


def _at_random(seed: str) -> involution.Choice:
    generator = random.Random(seed)
    return lambda _, prime: generator.randrange(prime)


def regular_at(
    analysis: Analysis,
    point: modular.Point,
    question: Question,
    orders: tuple[int, int],
    choose: involution.Choice,
) -> dict[tuple[int, ...], int] | None:
    """{multi-index: coefficient} of a solution at the point to the first order, prolonged by the
    second.

    `choose` supplies the free coefficients. None if the solution is singular.
    """
    card = HelmholtzAt(analysis, question, draw=lambda _: point)
    found = involution.solution_of(
        card, involution.prolonged(card, 0, sum(orders)), orders[0], choose
    )
    return None if found is None else {index: value for (_, index), value in found.items()}


def prolonged(
    analysis: Analysis, point: modular.Point, question: Question, order: int
) -> pde.Prolongation:
    """All rows up to the order at the point; SingularPoint if f has no value there."""
    return involution.prolonged(HelmholtzAt(analysis, question, draw=lambda _: point), 0, order)


def symbols_of(analysis: Analysis) -> list[ex.Symbol | ex.Velocity]:
    """t, q, v, the parameters, and pi if f contains it."""
    has_pi = any(node == ex.PI for f in analysis.accelerations for node in ex.walk(f))
    return [*variables_of(analysis.system), *([ex.PI] if has_pi else [])]


@dataclass(frozen=True, slots=True)
class RationalSeries:
    """The coefficients of (x - x_0)^alpha, x = (t?, q, v), v-degree >= 2, of one regular L; the
    others are free.

    `point` contains the values of t, q, v, and the parameters; `variables` are the components of x.
    """

    order: int
    variables: tuple[ex.Symbol | ex.Velocity, ...]
    point: Mapping[ex.Symbol | ex.Velocity, int]
    coefficients: Mapping[Index, Fraction]


def rational_series(
    analysis: Analysis, question: Question, order: int, spare: int = 0
) -> RationalSeries | None:
    """One regular solution to the order, prolonged by `spare` and projected; None if none is found.

    The squares of the velocities get the coefficient 1/2, all other free coefficients are zero.
    """
    symbols = symbols_of(analysis)
    if ex.PI in symbols or not is_rational(analysis):
        return None
    variables = moving_variables(analysis.system, question)
    generic = _dimension(analysis, draw_point(analysis.tower, 1), question, (order, spare))
    for first in range(1, 1 + bounds.ATTEMPTS):
        point = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            if _dimension(analysis, _at(point, 0), question, (order, spare)) != generic:
                continue
            found = _reconstructed(analysis, point, question, (order, spare))
        except modular.SingularPoint:
            continue
        if found is not None:
            return RationalSeries(
                order, variables, point, {index: a for index, a in found.items() if a}
            )
    return None


def _at(values: Mapping[ex.Symbol | ex.Velocity, int], seed: int) -> modular.Point:
    return modular.Point(modular.safe_prime(seed), seed, variables=dict(values))


def _dimension(
    analysis: Analysis, point: modular.Point, question: Question, orders: tuple[int, int]
) -> int:
    """The number of free coefficients; more than at a random point means that this point is
    singular.
    """
    return prolonged(analysis, point, question, sum(orders)).dimension(orders[0])


def _reconstructed(
    analysis: Analysis,
    values: Mapping[ex.Symbol | ex.Velocity, int],
    question: Question,
    orders: tuple[int, int],
) -> dict[Index, Fraction] | None:
    """The coefficients as fractions, once the reconstruction from some primes agrees with one more
    prime.
    """

    def residues(k: int) -> tuple[int, dict[Index, int] | None]:
        here = _at(values, k)
        return here.prime, regular_at(analysis, here, question, orders, involution.halved_squares)

    return reconstructed(residues)


def reconstructed(
    residues_of: Callable[[int], tuple[int, Mapping[Key, int] | None]],
) -> dict[Key, Fraction] | None:
    """Fractions from (prime, residues) for k = 0, 1, …, once the reconstruction agrees with one
    more prime.
    """
    modulus, residues = 1, dict[Key, int]()
    fractions: dict[Key, Fraction] | None = None
    for k in range(_MOST_PRIMES):
        prime, fresh = residues_of(k)
        if fresh is None:
            return None
        if fractions is not None and not any(
            (a.numerator - fresh.get(key, 0) * a.denominator) % prime
            for key, a in fractions.items()
        ):
            return fractions
        # The number modulo modulus * prime that has both residues.
        inverse, known = pow(modulus, -1, prime), residues
        residues = {
            key: known.get(key, 0) + modulus * ((value - known.get(key, 0)) * inverse % prime)
            for key, value in fresh.items()
        }
        modulus *= prime
        found = {
            key: modular.reconstruct(value, modulus, isqrt(modulus // 2))
            for key, value in residues.items()
        }
        fractions = {key: value for key, value in found.items() if value is not None}
        if len(fractions) < len(found):
            fractions = None
    return None


def as_tree(series: RationalSeries) -> ex.Expression:
    """The polynomial in the displacements, low degrees first."""
    steps = [x - series.point[x] for x in series.variables]
    ordered = sorted(series.coefficients.items(), key=lambda item: (sum(item[0]), item[0]))
    return ex.add(
        *(
            ex.multiply(ex.number(a), *(d**e for d, e in zip(steps, index, strict=True) if e))
            for index, a in ordered
        )
    )
