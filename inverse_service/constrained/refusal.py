"""Why no Lagrangian has a motion on constraints, in steps that can be followed with pencil and
paper.

A Lagrangian of the motion makes a 2-form on the constraints, which the motion keeps and which is
zero on each pair of directions of free velocities (`existence.refused_along_a_solution`). The Lie
brackets of these directions with the motion give linear equations for its values at one point; here
they are written with small rational numbers, and solved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import nmod_mat

from inverse_service.constrained import existence
from inverse_service.decision.solutions import Step
from inverse_service.errors import IrreducibleAtoms
from inverse_service.explanation import negative
from inverse_service.explanation.explaining import Piece, enumerated, said, separated
from inverse_service.expressions import notation, tree as ex
from inverse_service.field import matrices, modular
from inverse_service.linear_pde.involution import Finding
from inverse_service.statements.questions import Question

# Points that are tried, and the most directions whose pairs have one digit each.
POINTS, MOST_DIRECTIONS = 12, 9
PRIMES = 3  # whose product has the digits of the numbers that are shown
FEW_PRIMES = 2  # enough to tell which point is short
FEW_BRACKETS = 8  # up to this j all of them are found at once
Row = tuple[Fraction, ...]


@dataclass(frozen=True, slots=True)
class AtPoint:
    """A point with the brackets V_0, V_1, … of each free velocity, and the equations that they
    give.

    `brackets[alpha][j]` has an entry for each direction, and an equation, named (j, alpha, beta),
    has one for each pair of directions.
    """

    values: Mapping[ex.Expression, Fraction]
    brackets: tuple[tuple[Row, ...], ...]
    equations: Mapping[tuple[int, int, int], Row]

    @property
    def length(self) -> int:
        """The digits of the equations."""
        return sum(len(str(entry)) for row in self.equations.values() for entry in row)


def refusal_steps(
    analyzed: existence.AnalyzedMotion, found: Finding, question: Question
) -> tuple[Step, ...]:
    """The steps from a supposed Lagrangian to its contradiction, for a no along one solution.

    With numbers at one point. Where those of the equations fill pages, they are shown reduced to
    the values that they determine, and where these are long, too, only what they leave is said.
    """
    assert found.along is not None
    begin = _opening(analyzed, question), _flow(analyzed)
    size = len(_directions(analyzed))
    points = SmallPoints(analyzed, found.along)
    point = _shortest_point(points) if size <= MOST_DIRECTIONS else None
    if point is not None:
        steps = (
            *begin,
            *_point_steps(analyzed, point),
            *_equation_steps(analyzed, point),
            *_closing(analyzed, point, question),
        )
        if max(len(step.text) for step in steps) <= negative.LONGEST_SHOWN:
            return steps
    reduced = _reduced_point(points)
    if reduced is not None:
        free = len(analyzed.motion.free)
        count = (found.along + 1) * free * (free - 1) // 2
        together = said(
            f"There the numbers of the {count} equations up to `j = {found.along}` fill pages. What they say together is "
            "short; it was computed modulo large primes, and confirmed modulo another one.",
        )  # fmt: skip
        values = _values_step(analyzed, reduced)
        steps = (*begin, values, together, *_closing(analyzed, reduced, question))
        if max(len(step.text) for step in steps) <= negative.LONGEST_SHOWN:
            return steps
    summary = said(
        f"The numbers of these equations are too long to print. At a random point, modulo a large prime, the "
        f"{len(found.rows)} equations up to `j = {found.along}` leave in every solution a combination `w` of the free "
        f"directions, not zero, with `Omega(w, e_i) = 0` for all `i`.",
    )  # fmt: skip
    return (*begin, summary, said(_contradiction(question)))


def _contradiction(question: Question) -> str:
    none = "is variational" if question.timed else f"has a regular {question.form}"
    return (
        "So the momenta `p_i = dL/dv^i` of any such `L` do not change along one direction of the free velocities, and "
        f"`L` is not regular. This is a contradiction, so no associated system {none}."
    )


def _directions(analyzed: existence.AnalyzedMotion) -> list[ex.Expression]:
    """The coordinates and the free velocities."""
    own: list[ex.Expression] = [*map(ex.Symbol, analyzed.names)]
    return [*own, *map(ex.Velocity, analyzed.motion.free)]


def _free(analyzed: existence.AnalyzedMotion) -> range:
    """The places of the free velocities among the directions."""
    return range(len(analyzed.names), len(analyzed.names) + len(analyzed.motion.free))


def _e(place: int) -> str:
    return f"e_{place + 1}"


def _value(i: int, j: int) -> ex.Symbol:
    """Omega(e_i, e_j)."""
    return ex.Symbol(f"Omega_{i + 1}{j + 1}")


def _opening(analyzed: existence.AnalyzedMotion, question: Question) -> Step:
    indices: list[Piece] = []
    for k, direction in enumerate(_directions(analyzed)):
        indices += [f"{', ' * (k > 0)}`{_e(k)}` of ", direction]
    free: list[Piece] = [*enumerated([notation.theory(_e(k)) for k in _free(analyzed)])]
    return said(
        f"Suppose that a regular {question.form} has this motion on the constraints. There its momenta "
        "`p_i = dL/dv^i` give, for two directions `a` and `b` at one time, the 2-form "
        "`Omega(a, b) = a(p_i) b(q^i) - b(p_i) a(q^i)`, summed over `i`, in which `a(p_i)` is the derivative along "
        "`a`. The motion keeps it. Let `Omega_ij = Omega(e_i, e_j)` for the directions ", *indices, ". Along ", *free,
        " no coordinate changes, so `Omega` is zero on each pair of these; and `Omega(w, e_i) = w(p_i)` for a "
        "combination `w != 0` of them, which is not zero for all coordinates, as `L` is regular.",
    )  # fmt: skip


def _flow(analyzed: existence.AnalyzedMotion) -> Step:
    motion = analyzed.motion
    free = zip(motion.free, motion.free_accelerations, strict=True)
    dependent = zip(motion.dependent, motion.dependent_velocities, strict=True)
    shown = [notation.row(ex.Acceleration(name), " = ", tree) for name, tree in free]
    shown += [notation.row(ex.Velocity(name), " = ", tree) for name, tree in dependent]
    short = sum(len(formula.text) for formula in shown) <= negative.LONGEST_SHOWN // 2
    motion_shown: list[Piece] = [", ", *separated(shown)] if short else []
    pairs = " and each pair" if len(motion.free) > 2 else ""
    return said(
        "Let `Gamma` be the derivative along the motion", *motion_shown, ". With the brackets ",
        "`V_(j+1) = [Gamma, V_j]` of `V_0 = e_a` and `W_j` of `W_0 = e_b`, differentiating `Omega(e_a, e_b) = 0` along the "
        f"motion gives for each `j`{pairs} a linear equation for the values of `Omega` at one point.",
        shown=["Omega(V_j, W_0) + j Omega(V_(j-1), W_1) + … + Omega(V_0, W_j) = 0"],
    )  # fmt: skip


def _values_step(analyzed: existence.AnalyzedMotion, point: AtPoint) -> Step:
    listed = separated(
        [notation.row(name, " = ", ex.number(value)) for name, value in point.values.items()]
    )
    where = "the point " if negative.is_real(analyzed) else "the values "
    why = (
        ""
        if negative.is_real(analyzed)
        else ", which need not be those of a real point, but satisfy every algebraic relation"
    )
    return said(f"Take {where}", *listed, f"{why}.") if listed else said("Take any point.")


def _point_steps(analyzed: existence.AnalyzedMotion, point: AtPoint) -> list[Step]:
    steps = [_values_step(analyzed, point)]
    for k, brackets in zip(_free(analyzed), point.brackets, strict=True):
        entries = notation.matrix([[ex.number(entry) for entry in row] for row in brackets])
        steps.append(
            said(
                f"There the brackets `V_0`, …, `V_{len(brackets) - 1}` of `{_e(k)}` are the rows of ",
                entries,
                ".",
            )
        )
    return steps


def _equation_steps(analyzed: existence.AnalyzedMotion, point: AtPoint) -> list[Step]:
    steps = []
    several = len(analyzed.motion.free) > 2
    for (j, alpha, beta), row in point.equations.items():
        pair = f" for `{_e(_free(analyzed)[alpha])}` and `{_e(_free(analyzed)[beta])}`" * several
        steps.append(
            said(
                f"`j = {j}`{pair}, up to a constant factor: ",
                notation.row(_combination(row, _pairs(analyzed)), " = 0"),
                ".",
            )
        )
    return steps


def _pairs(analyzed: existence.AnalyzedMotion) -> list[ex.Symbol]:
    places = itertools.combinations(range(len(_directions(analyzed))), 2)
    return [_value(i, j) for i, j in places]


def _combination(row: Sequence[Fraction], names: Sequence[ex.Symbol]) -> ex.Expression:
    return ex.add(*(a * name for a, name in zip(row, names, strict=True) if a))


def _closing(analyzed: existence.AnalyzedMotion, point: AtPoint, question: Question) -> list[Step]:
    """The solution of the equations, a combination of free velocities that it sends to zero, and
    the contradiction.
    """
    names = _pairs(analyzed)
    solution = negative.echelon(list(point.equations.values()))
    pivots = dict(solution)
    zero = [names[k] for k, row in solution if sum(map(bool, row)) == 1]
    others = [
        notation.row(
            names[k], " = ", _combination([-a * (i != k) for i, a in enumerate(row)], names)
        )
        for k, row in solution
        if sum(map(bool, row)) > 1
    ]
    solved: list[Piece] = [*others]
    if zero:
        solved.append(notation.row(*separated(zero, " = "), " = 0"))
    steps = [said("These linear equations have the solution ", *separated(solved), ".")]
    generic = (
        "because a minor that is nonzero for these numbers vanishes at most on a set without interior points"
        if len(pivots) == len(names)
        else "because at random points, modulo large primes, the equations leave such a combination, too"
    )
    combination = _kernel(analyzed, solution)
    if combination is None:
        free = [notation.theory(_e(k)) for k in _free(analyzed)]
        hence: list[Piece] = [
            "Hence the rows `Omega_ij` of ", *[f"`i = {k + 1}`{', ' * (k != _free(analyzed)[-1])}" for k in _free(analyzed)],
            " are linearly dependent for all values that remain: a combination `w` of ", *enumerated(free),
            " has `Omega(w, e_i) = 0`",
        ]  # fmt: skip
    else:
        hence = ["Hence ", notation.row("Omega(", combination, ", e_i) = 0"), " for all `i`"]
    steps.append(said(*hence, f". The same is true at every generic point, {generic}."))
    return [*steps, said(_contradiction(question))]


def _kernel(
    analyzed: existence.AnalyzedMotion, solution: Sequence[tuple[int, Row]]
) -> notation.Formula | None:
    """A combination w of the free directions with Omega(w, e_i) = 0 in every solution; None where
    it differs from one to another.
    """
    size, free = len(_directions(analyzed)), _free(analyzed)
    places = {pair: k for k, pair in enumerate(itertools.combinations(range(size), 2))}
    pivots = dict(solution)
    rows = []
    for column in range(len(places)):  # the solution in which only this free value is 1
        if column in pivots:
            continue
        form = {
            pair: -pivots[k][column] if k in pivots else Fraction(k == column)
            for pair, k in places.items()
        }
        rows += [
            [form.get((u, x), Fraction(0)) - form.get((x, u), Fraction(0)) for u in free]
            for x in range(size)
        ]
    vectors = (
        matrices.kernel(rows, len(free))
        if rows
        else [[Fraction(1), *[Fraction(0)] * (len(free) - 1)]]
    )
    if not vectors:
        return None
    parts = negative.coprime(tuple(vectors[0]))
    return notation.formula_of(
        ex.add(*(a * ex.Symbol(_e(k)) for a, k in zip(parts, free, strict=True) if a))
    )


class SmallPoints:
    """The residues of everything at points with small numbers, each computed once."""

    __slots__ = ("_known", "analyzed", "last", "primes", "shown")

    def __init__(self, analyzed: existence.AnalyzedMotion, last: int) -> None:
        self.analyzed, self.last = analyzed, last
        self.primes = [
            modular.safe_prime(7_001 + k, analyzed.tower.residues) for k in range(PRIMES + 1)
        ]
        self.shown = _shown(analyzed, last)
        self._known = dict[tuple[int, int], list[dict[object, int] | None]]()

    def fractions(self, attempt: int, last: int) -> dict[object, Fraction] | None:
        """The values shown and the brackets up to `last`; None where something has no value, or a
        number has too many digits.
        """
        known = self.residues(attempt, last, PRIMES)
        found = None if known is None else _reconstructed(known, self.primes)
        if found is None:  # before the prime that confirms it
            return None
        whole = self.residues(attempt, last)
        return None if whole is None else _confirmed(found, whole[-1], self.primes[-1])

    def guesses(self, attempt: int, last: int) -> dict[object, Fraction] | None:
        """The same from few primes, not confirmed: numbers with more digits become others, which
        are shorter.
        """
        known = self.residues(attempt, last, FEW_PRIMES)
        found = None if known is None else _reconstructed(known, self.primes)
        return self.fractions(attempt, last) if found is None else found

    def residues(
        self, attempt: int, last: int, count: int = PRIMES + 1
    ) -> list[dict[object, int]] | None:
        """The same modulo each of so many primes, brackets with the keys (alpha, j, direction)."""
        known = self._known.setdefault((attempt, last), [])
        for prime in self.primes[len(known) : count]:
            if None not in known:
                known.append(self._modulo(attempt, last, prime))
        found = [one for one in known[:count] if one is not None]
        return found if len(found) == count else None

    def _modulo(self, attempt: int, last: int, prime: int) -> dict[object, int] | None:
        point = negative.small_point(self.analyzed.tower, attempt, prime)
        if point is None:
            return None
        try:
            vectors = self.analyzed.along(last).at(point)
            found: dict[object, int] = {name: modular.evaluate(name, point) for name in self.shown}
        except (modular.SingularPoint, ValueError, ZeroDivisionError, IrreducibleAtoms):
            return None
        for alpha, series in enumerate(vectors):
            for j, coefficients in enumerate(series):
                for x, coefficient in enumerate(coefficients):
                    found[alpha, j, x] = coefficient * math.factorial(j) % prime
        return found


def _shortest_point(points: SmallPoints) -> AtPoint | None:
    """That of the first points whose equations are short, and leave a vertical kernel."""
    if not negative.has_points(points.analyzed):
        return None
    lengths = {
        attempt: guess.length
        for attempt in range(POINTS)
        if (guess := at_point(points, attempt, points.guesses)) is not None
    }
    best: tuple[int, int, AtPoint] | None = None
    for attempt in sorted(lengths, key=lambda one: (lengths[one], one)):
        if best is not None and best[:2] < (lengths[attempt], attempt):
            break
        point = at_point(points, attempt)
        if point is not None and _is_refused(points.analyzed, point):
            found = point.length, attempt, point
            best = found if best is None else min(best, found, key=lambda one: one[:2])
    return None if best is None else best[2]


def _reduced_point(points: SmallPoints) -> AtPoint | None:
    """The first point whose equations, reduced, have numbers that can be found, and leave a
    vertical kernel.
    """
    if not negative.has_points(points.analyzed):
        return None
    for attempt in range(POINTS):
        point = reduced_at_point(points, attempt)
        if point is not None and _is_refused(points.analyzed, point):
            return point
    return None


def reduced_at_point(points: SmallPoints, attempt: int) -> AtPoint | None:
    """The point without brackets, its equations reduced; None if their numbers are not found."""
    known, analyzed, last = [], points.analyzed, points.last
    for prime, residues in zip(
        points.primes, points.residues(attempt, points.last) or (), strict=False
    ):
        shown = {name: residues[name] for name in points.shown}
        known.append(shown | _reduced_residues(analyzed, residues, last, prime))
    if len({frozenset(each) for each in known}) != 1:  # none, or other pivots: an unlucky prime
        return None
    found = _fractions(known, points.primes)
    if found is None:
        return None
    count = 1 + max((key[0] for key in found if isinstance(key, tuple)), default=-1)
    width = len(_pairs(analyzed))
    equations = {
        (j, 0, 0): negative.coprime(tuple(found[j, x] for x in range(width))) for j in range(count)
    }
    return AtPoint({name: found[name] for name in points.shown}, (), equations)


def _reduced_residues(
    analyzed: existence.AnalyzedMotion, residues: Mapping[object, int], last: int, prime: int
) -> dict[object, int]:
    """The reduced echelon form of the equations modulo the prime, its pivots the last entries of
    the rows, with keys (row, pair of directions).
    """
    size = len(_directions(analyzed))
    brackets = [
        [[residues[alpha, j, x] for x in range(size)] for j in range(last + 1)]
        for alpha in range(len(analyzed.motion.free))
    ]
    rows = [
        [entry % prime for entry in _equation(left, right, j)][::-1]
        for left, right in itertools.combinations(brackets, 2)
        for j in range(last + 1)
    ]
    echelon, rank = nmod_mat(rows, prime).rref()
    width = len(rows[0])
    return {(k, width - 1 - x): int(echelon[k, x]) for k in range(rank) for x in range(width)}


def _fractions(
    known: Sequence[Mapping[object, int]], primes: Sequence[int]
) -> dict[object, Fraction] | None:
    """The fractions with these residues modulo all primes but the last one, which confirms them;
    None if one does not.
    """
    found = _reconstructed(known[:-1], primes)
    return None if found is None else _confirmed(found, known[-1], primes[-1])


def _confirmed(
    found: dict[object, Fraction], known: Mapping[object, int], prime: int
) -> dict[object, Fraction] | None:
    """The fractions if they have these residues modulo the prime."""
    pairs = found.items()
    agree = all((a.numerator - known[key] * a.denominator) % prime == 0 for key, a in pairs)
    return found if agree else None


def _reconstructed(
    known: Sequence[Mapping[object, int]], primes: Sequence[int]
) -> dict[object, Fraction] | None:
    """The fractions with these residues modulo the first primes; None if one is not found."""
    product, steps = 1, list[tuple[Mapping[object, int], int]]()
    for each, prime in zip(known, primes, strict=False):
        steps.append((each, product * pow(product, -1, prime)))
        product *= prime
    found, most = dict[object, Fraction](), math.isqrt(product // 2) - 1
    for key in known[0]:
        value = 0
        for each, one in steps:
            value += one * (each[key] - value)
        number = modular.reconstruct(value % product, product, most)
        if number is None:
            return None
        found[key] = number
    return found


def at_point(
    points: SmallPoints,
    attempt: int,
    fractions: Callable[[int, int], dict[object, Fraction] | None] | None = None,
) -> AtPoint | None:
    """Everything at this point as fractions, from some primes and confirmed by another one, or
    guessed.
    """
    analyzed, last = points.analyzed, points.last
    # Digits grow with j, so that where there are too many, the first half mostly shows it.
    if last > FEW_BRACKETS and points.fractions(attempt, last // 2) is None:
        return None
    found = (fractions or points.fractions)(attempt, last)
    if found is None:
        return None
    k, size = len(analyzed.motion.free), len(_directions(analyzed))
    brackets = tuple(
        tuple(tuple(found[alpha, j, x] for x in range(size)) for j in range(last + 1))
        for alpha in range(k)
    )
    equations, whole = dict[tuple[int, int, int], Row](), list(map(_over_one_denominator, brackets))
    for j, (alpha, beta) in itertools.product(range(last + 1), itertools.combinations(range(k), 2)):
        row = _equation(whole[alpha], whole[beta], j)
        if any(row):
            equations[j, alpha, beta] = negative.coprime(tuple(map(Fraction, row)))
    values = {name: found[name] for name in points.shown}
    return AtPoint(values, brackets, equations)


def _over_one_denominator(rows: Sequence[Row]) -> list[list[int]]:
    """The integers that are the entries times their common denominator."""
    common = math.lcm(*(entry.denominator for row in rows for entry in row))
    return [[entry.numerator * (common // entry.denominator) for entry in row] for row in rows]


def _equation(left: Sequence[Sequence[int]], right: Sequence[Sequence[int]], j: int) -> list[int]:
    """sum_i C(j, i) Omega(V_i, W_(j - i)), by pairs of directions."""
    parts = [(math.comb(j, i), left[i], right[j - i]) for i in range(j + 1)]
    return [
        sum(times * (one[x] * other[y] - one[y] * other[x]) for times, one, other in parts)
        for x, y in itertools.combinations(range(len(left[0])), 2)
    ]


def _is_refused(analyzed: existence.AnalyzedMotion, point: AtPoint) -> bool:
    """Whether every solution of the equations sends a combination of free directions to zero."""
    prime = negative.CHOSEN
    rows = [
        [modular.number_value(entry, prime) for entry in row] for row in point.equations.values()
    ]
    matrix = nmod_mat(rows, prime)
    size, free = len(_directions(analyzed)), len(analyzed.motion.free)
    return existence.leaves_a_vertical_kernel(matrix, size, free)


def _shown(analyzed: existence.AnalyzedMotion, last: int) -> list[ex.Expression]:
    """The variables and atoms that occur in the motion, and the derivatives of functions that occur
    in the brackets.
    """
    trees = analyzed.accelerations
    bare = negative.bare_variables(trees)
    variables = [name for name in existence.variables_of(analyzed.motion) if name in bare]
    lowest: dict[str, int] = {}
    for node in ex.distinct_nodes(trees):
        if isinstance(node, ex.Arbitrary):
            order = sum(node.orders)
            lowest[node.name] = min(lowest.get(node.name, order), order)
    jets = negative.atoms_and_jets(analyzed, last if lowest else 0)
    return [
        *variables,
        *(
            each
            for each in jets
            if not isinstance(each, ex.Arbitrary) or sum(each.orders) >= lowest[each.name]
        ),
    ]
