"""Which members of a family of motions on constraints have a Lagrangian: any associated system
counts.

The conditions on a Lagrangian of a motion (`existence`) take brackets to an order of eight and
more, so their minors have up to millions of terms and are not split into leaves. Instead the
general member is decided, and sets of members that are named beforehand: where a constant, or a
derivative of first, second or third order of a function vanishes, or second derivatives agree, and
the leaves of other families about the same motion, as of its reduced equations. Each is decided at
random points of the set; a set whose equations are solved in closed form has a checked proof about
its general member. Other sets stay open.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from flint import fmpq_mpoly

from inverse_service import deadline, errors
from inverse_service.constrained import answering, existence
from inverse_service.decision.solutions import SolveOptions, Statement, Verdict
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field, modular, tower
from inverse_service.mechanics.second_order_system import ConstrainedMotion, SecondOrderSystem
from inverse_service.solving import closed_members, leaves
from inverse_service.solving.leaves import Leaf, NotSplit, Unknowns
from inverse_service.statements import questions
from inverse_service.statements.questions import PLAIN, TIMED, Question
from inverse_service.statements.stages import Progress, Stage

FURTHER_ORDERS = 4  # derivatives of functions in the ring
MOST_COMBINED, MOST_SETS = 3, 80  # constants any of which vanish together; sets that are decided
SPLITTING_SECONDS, DECIDING_SECONDS, PROVING_SECONDS = 1.0, 4.0, 8.0
OTHER_SETS = (
    "for any associated system the general member and simple sets are decided, "
    "other sets of members are not"
)
BY_BRACKETS = (
    f"{OTHER_SETS}: their equations are minors of brackets to order {{}}, which are not split"
)


@dataclass(frozen=True, slots=True)
class FoundMotions:
    """A set of motions with its verdicts on L(q, q') and L(t, q, q') (None where not asked), the
    place of the set it is in, and its general member in closed form with the checked answers.
    """

    leaf: Leaf
    inside: int | None
    verdict: Verdict | None
    timed: Verdict | None
    motion: ConstrainedMotion | None = None
    solved: tuple[closed_members.Solved, ...] = ()
    answers: tuple[Statement, ...] = ()

    @property
    def verdicts(self) -> tuple[Verdict | None, Verdict | None]:
        return self.verdict, self.timed


@dataclass(frozen=True, slots=True)
class FamilyOfMotions:
    """The sets, each after the one it is in; a member has the verdicts of the last that holds it,
    if it is general in it.
    """

    unknowns: Unknowns
    leaves: tuple[FoundMotions, ...]
    undecided: tuple[tuple[int, tuple[ex.Expression, ...]], ...]  # inside a leaf, and its equations
    last_bracket: int | None = None  # the order of brackets that refuse the general member

    @property
    def reason_of_others(self) -> str:
        """Why members in none of the sets are not decided."""
        return OTHER_SETS if self.last_bracket is None else BY_BRACKETS.format(self.last_bracket)


@dataclass(slots=True)
class _Work:
    motion: ConstrainedMotion
    analyzed: existence.AnalyzedMotion
    unknowns: Unknowns
    asked: tuple[Question, ...]
    options: SolveOptions
    end: float

    def draw(self, seed: int) -> modular.Point:
        return tower.draw_point(self.analyzed.tower, seed)


def as_system(motion: ConstrainedMotion) -> SecondOrderSystem:
    """The right sides of the motion, F and then w, in the place of accelerations: what is put in
    for constants and functions of a system is put in here.
    """
    return SecondOrderSystem(
        (*motion.free, *motion.dependent),
        (*motion.free_accelerations, *motion.dependent_velocities),
        motion.parameters,
        motion.functions,
    )


def with_sides(motion: ConstrainedMotion, system: SecondOrderSystem) -> ConstrainedMotion:
    """The motion with the right sides, constants, and functions of `as_system`."""
    count = len(motion.free)
    return ConstrainedMotion(
        motion.coordinates,
        motion.free,
        motion.dependent,
        system.accelerations[count:],
        system.accelerations[:count],
        system.parameters,
        system.functions,
    )


def explore(
    motion: ConstrainedMotion,
    letters: Sequence[str],
    functions: Sequence[str],
    options: SolveOptions,
    end: float,
    known: Sequence[Sequence[ex.Expression]] = (),
    answers: Sequence[Statement] = (),
    progress: Progress = lambda _: None,
) -> FamilyOfMotions:
    """The sets of members with other verdicts than those around them, until the time `end`.

    `known` are equations of sets to be decided, too; `answers` are the checked answers about the
    general member. Raises NotSplit if the general member is not decided or a function has other
    arguments than coordinates, TooLarge or IrreducibleAtoms if the motion cannot be computed with.
    """
    work = _prepared(motion, letters, functions, options, end)
    root = Leaf(work.unknowns)
    verdicts = _verdicts(work, root)
    if verdicts is None:
        raise NotSplit("the general member is not decided")
    order = None
    if "not_variational" in verdicts:
        order = existence.last_bracket(work.analyzed, work.draw(options.seed), end)
    proven = tuple(one for one in answers if one.certificate is not None)
    found = [FoundMotions(root, None, *verdicts, motion, (), proven)]
    undecided = list[tuple[int, tuple[ex.Expression, ...]]]()
    candidates = _candidates(work, known)
    places = [list(leaves.points(one, work.draw, 7, 2)) for one in candidates]
    depths = [sum(leaves.contains(large, points) for large in candidates) for points in places]
    for k in sorted(range(len(candidates)), key=lambda k: (depths[k], candidates[k].size)):
        leaf = candidates[k]
        around = max(j for j, one in enumerate(found) if leaves.contains(one.leaf, places[k]))
        progress(Stage("family", f"leaf {len(found) + 1}"))
        own = _verdicts(work, leaf)
        if own is None:
            undecided.append((around, tuple(map(work.unknowns.tree, leaf.equations))))
        elif own != found[around].verdicts:
            found.append(FoundMotions(leaf, around, *own))
    told = [found[0], *(_with_answers(work, one) for one in found[1:])]
    return FamilyOfMotions(work.unknowns, tuple(told), tuple(undecided), order)


def _prepared(
    motion: ConstrainedMotion,
    letters: Sequence[str],
    functions: Sequence[str],
    options: SolveOptions,
    end: float,
) -> _Work:
    analyzed = existence.analyze_motion(motion)
    trees = [*motion.free_accelerations, *motion.dependent_velocities]
    names: list[ex.Symbol | ex.Velocity] = [ex.TIME, *map(ex.Symbol, motion.coordinates)]
    names += map(ex.Velocity, motion.free)
    ring = exact_field.exact_ring(trees, names, FURTHER_ORDERS, exact_field.Budget.long())
    known = {name: of for name, of in motion.functions if name in functions}
    unknowns = Unknowns.of(ring, letters, known)
    asked = questions.asked(options.time_dependent, motion.depends_on_time)
    return _Work(motion, analyzed, unknowns, asked, options, end)


def _candidates(work: _Work, known: Iterable[Sequence[ex.Expression]]) -> list[Leaf]:
    """The sets that are decided, each once."""
    found = dict[frozenset[str], Leaf]()
    for equations in (*_read(work, known), *_simple(work.unknowns)):
        with suppress(NotSplit, errors.IrreducibleAtoms):
            until = min(work.end, deadline.now() + SPLITTING_SECONDS)
            for one in leaves.split_leaf(Leaf(work.unknowns), equations, until, work.draw):
                whole = replace(one, nonzero=())
                next(leaves.points(whole, work.draw, 7, 1))  # NotSplit if there is none
                found.setdefault(frozenset(map(str, whole.equations)), whole)
            if len(found) >= MOST_SETS:
                break
    return [one for one in found.values() if one.rules]


def _simple(unknowns: Unknowns) -> Iterator[list[fmpq_mpoly]]:
    """Sets of constants that vanish or agree, of functions, and both together, the largest first."""
    letters, functions = list(_of_letters(unknowns)), list(_of_functions(unknowns))
    yield from letters
    yield from functions
    yield from ([*some, *more] for some in letters for more in functions)


def _of_letters(unknowns: Unknowns) -> Iterator[list[fmpq_mpoly]]:
    letters = [unknowns.context.gen(k) for k in unknowns.letters]
    most = len(letters) if len(letters) <= MOST_COMBINED else 1
    for count in range(1, most + 1):
        yield from map(list, itertools.combinations(letters, count))
    yield letters
    yield from ([a - b] for a, b in itertools.combinations(letters, 2))


def _of_functions(unknowns: Unknowns) -> Iterator[list[fmpq_mpoly]]:
    for name, of in unknowns.arguments.items():
        jets = {
            orders: unknowns.context.gen(k)
            for k, (own, orders) in unknowns.jets.items()
            if own == name
        }
        first, second, third = (
            [jet for orders, jet in jets.items() if sum(orders) == total] for total in (1, 2, 3)
        )
        yield from ([one] for one in second if len(of) > 1)
        yield from ([one] for one in first if len(of) > 1)
        yield third
        yield from map(list, itertools.combinations(second, 2))
        yield second
        for x, y in itertools.combinations(range(len(of)), 2):
            mixed, of_x, of_y = (
                jets.get(tuple((k == a) + (k == b) for k in range(len(of))))
                for a, b in ((x, y), (x, x), (y, y))
            )
            if mixed is not None and of_x is not None and of_y is not None:
                yield from ([of_x - of_y], [of_x + of_y], [of_x - of_y, mixed])
        yield from ([one, other] for one in first for other in second if len(of) > 1)
        yield first


def _read(work: _Work, known: Iterable[Sequence[ex.Expression]]) -> Iterator[list[fmpq_mpoly]]:
    for trees in known:
        with suppress(KeyError, ZeroDivisionError, exact_field.TooLarge):
            yield [work.unknowns.ring.value(tree).numerator for tree in trees]


def _verdicts(work: _Work, leaf: Leaf) -> tuple[Verdict | None, Verdict | None] | None:
    """The verdicts on the general member of a set, at points of it; None if one is not decided."""

    def draw(seed: int) -> modular.Point:
        return next(leaves.points(leaf, work.draw, seed, 1)) if leaf.rules else work.draw(seed)

    found = dict[Question, Verdict]()
    for question in sorted(work.asked, key=lambda one: not one.timed):
        if found.get(TIMED) == "not_variational":  # without L(t, q, q') there is no L(q, q')
            found[question] = "not_variational"
            continue
        limit = min(work.end, deadline.now() + DECIDING_SECONDS)
        with suppress(NotSplit, modular.SingularPoint, ValueError):
            seed = work.options.seed
            done = existence.decide_motion(
                work.analyzed, question, seed, limit, lambda _: None, draw
            )
            if done.exists is not None:
                found[question] = "variational" if done.exists else "not_variational"
        if question not in found:
            return None
    return found.get(PLAIN), found.get(TIMED)


def _with_answers(work: _Work, one: FoundMotions) -> FoundMotions:
    """The set with checked answers about its general member, where this has a closed form."""
    member = closed_members.member_of(as_system(work.motion), one.leaf)
    if member is None:
        return one
    motion = with_sides(work.motion, member.system)
    one = replace(one, motion=motion, solved=member.solved)
    limit = min(work.end, deadline.now() + PROVING_SECONDS)
    try:
        answers = answering.answer_motion(
            motion, (), work.options.time_dependent, work.options.seed, limit
        )
    except (errors.IrreducibleAtoms, ZeroDivisionError, exact_field.TooLarge):
        return one
    proven = tuple(
        each
        for each in answers
        if each.certificate is not None
        and each.verdict == (one.timed if each.question.timed else one.verdict)
    )
    return replace(one, answers=proven)
