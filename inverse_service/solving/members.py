"""Which members of a family have a Lagrangian: a family is a system with constants and unknown
functions.

At a fixed point of phase space the algebraic conditions (g T symmetric for T = Phi, nabla Phi, ...,
and those of the curvature for n >= 3) are linear in the entries of g, with coefficients in the
constants, functions, and velocities. Sets of members are *leaves* (`leaves`). The general member of
a leaf is decided as any system is, at random points of the leaf.

- If the conditions of rank r leave only singular g there, no member of the leaf has an L unless all
  minors of size r vanish. These minors, for all values of velocities and coordinates, are the
  equations of the next leaves.
- If one g remains, up to a factor e^u, and u does not exist, the mixed derivatives of u differ;
  their differences are the equations of the next leaves.
- If there is an L, the members where the rank falls, and those where the one g that remains is
  singular, are the next leaves: elsewhere the same proof holds. If a Lagrangian in closed form is
  known, its members are those where it is regular and defined.

So the leaves cover the family, except for the `open` sets, whose equations were not split or whose
members were not decided. Douglas (1941) has the conditions for n = 2; the stratification is that of
his cases.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from flint import fmpq_mpoly, nmod_mat

from inverse_service import bounds, deadline, errors
from inverse_service.decision import deciding
from inverse_service.decision.solutions import SolveOptions, Statement, Verdict
from inverse_service.explanation import hierarchy
from inverse_service.expressions import collecting, minors, polynomials, tree as ex
from inverse_service.field import exact_field, matrices, modular, tower
from inverse_service.linear_pde import involution
from inverse_service.mechanics import conditions as cd
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.solving import (
    closed_members,
    completion,
    leaves,
    regularity,
    shorter_leaves,
    solving,
)
from inverse_service.solving.leaves import Leaf, NotSplit, Unknowns
from inverse_service.statements import questions
from inverse_service.statements.questions import PLAIN, TIMED, Question
from inverse_service.statements.stages import Progress, Stage

# How many tensors nabla^k Phi are needed: the rows are stable at the latest for k = n (n + 1)/2 -
# 1.
DEPTHS = {1: 0, 2: 2, 3: 3}
FURTHER_ORDERS = 5  # derivatives of functions for splitting, beyond those in the conditions
MOST_LEAVES = 150
MOST_PAIRS = 30  # of what vanishes together in sets that are asked for
MOST_EQUATIONS = 60  # that are split together
MOST_POINTS = 24  # at which conditions are evaluated in turn, until they have values
MOST_NAMED = 100  # terms of the equation by which an open set is named
MOST_MINORS, MOST_TRIED = (
    24,
    4000,
)  # of one size: computed, and tried at a point for one that is not zero
LEAST_JOINED = 3  # sets of a linear pair that are told as one
YES_YES: tuple[Verdict, Verdict] = ("variational", "variational")
SPLITTING_SECONDS, DECIDING_SECONDS, SEARCH_SECONDS = 8.0, 15.0, 5.0
SEVERAL = (
    "several g satisfy the algebraic conditions, and their differential ones were not completed"
)


@dataclass(frozen=True)
class Found:
    """A leaf with its verdicts for L(q, q') and L(t, q, q') (None where not asked), and the place
    of the one it is in.

    `system` is the general member in closed form, None if the equations are not solved; `answer` is
    its checked answer.
    """

    leaf: Leaf
    inside: int | None
    verdict: Verdict | None
    timed: Verdict | None
    statement: str = ""
    system: SecondOrderSystem | None = None
    solved: tuple[closed_members.Solved, ...] = ()
    answer: Statement | None = None
    without_time: Statement | None = (
        None  # if the answer that is shown has an L with t, and there is one without t
    )
    rows: tuple[tuple[int, ...], ...] = ()  # sets of rows of conditions by whose minors it is split
    order: tuple[int, ...] = ()  # of the entries of g, where differential conditions were completed
    kernel: str = ""  # whether these leave a regular g; "" where a Lagrangian decides

    @property
    def verdicts(self) -> tuple[Verdict | None, Verdict | None]:
        return self.verdict, self.timed


@dataclass(frozen=True)
class Open:
    """A set that is not decided: the equations that define it inside a leaf, if they are known, and
    why.
    """

    inside: int
    equations: tuple[ex.Expression, ...]
    reason: str


@dataclass(frozen=True)
class Family:
    """The leaves, each after the one it is in, and the sets that are not decided; `covered`: there
    are none of these.
    """

    unknowns: Unknowns
    leaves: tuple[Found, ...]
    open: tuple[Open, ...]
    # All sets that were decided, whose verdicts the leaves sum up, and the names of the conditions.
    cells: tuple[Found, ...] = ()
    undecided: tuple[Open, ...] = ()  # inside these cells
    names: tuple[hierarchy.EquationName, ...] = ()

    @property
    def covered(self) -> bool:
        return not self.open


@dataclass
class _Work:
    """What all leaves of one exploration share."""

    system: SecondOrderSystem
    analysis: deciding.Analysis
    exact: cd.MotionInRing
    unknowns: Unknowns
    rows: list[list[fmpq_mpoly]]
    names: list[hierarchy.EquationName]
    time_dependent: bool | None
    seed: int
    end: float
    is_movable: bool
    found: list[Found] = field(default_factory=list)
    open: list[Open] = field(default_factory=list)
    # Sets that are kept only if their verdicts are others than those around them.
    simple: list[Leaf] = field(default_factory=list)

    def draw(self, seed: int) -> modular.Point:
        return tower.draw_point(self.analysis.tower, seed)

    @property
    def size(self) -> int:
        return len(self.system.coordinates)


def explore(
    system: SecondOrderSystem,
    letters: Sequence[str],
    functions: Sequence[str],
    options: SolveOptions,
    end: float,
    progress: Progress = lambda _: None,
) -> Family:
    """The leaves of the family of a system in these constants and functions, until the time `end`.

    Raises NotSplit if a function has other arguments than coordinates or the general member is not
    decided, TooLarge or IrreducibleAtoms if the conditions cannot be computed.
    """
    work = _prepared(system, letters, functions, options, end)
    waiting: list[tuple[Leaf, int | None]] = [(Leaf(work.unknowns), None)]
    for special in _special_arguments(work):
        with suppress(NotSplit):
            waiting += [
                (one, 0)
                for one in leaves.split_leaf(Leaf(work.unknowns), special, _until(work), work.draw)
            ]
    while waiting:
        leaf, inside = waiting.pop(0)
        if deadline.now() > end or len(work.found) >= MOST_LEAVES:
            reason = (
                f"more than {MOST_LEAVES} leaves"
                if len(work.found) >= MOST_LEAVES
                else "the time was over"
            )
            if inside is None:
                raise NotSplit(reason)
            work.open += [
                Open(around or 0, _trees(one), reason) for one, around in [(leaf, inside), *waiting]
            ]
            break
        progress(Stage("family", f"leaf {len(work.found) + 1}"))
        if _is_known(work, leaf) or (leaf in work.simple and _is_inside_another(work, leaf)):
            continue
        try:
            found = _decided(work, leaf, inside)
        except NotSplit as problem:
            if inside is None:
                raise
            work.open.append(Open(inside, _trees(leaf), str(problem)))
            continue
        if leaf in work.simple and found.verdicts == work.found[inside or 0].verdicts:
            continue
        place = len(work.found)
        work.found.append(found)
        waiting += [(one, place) for one in _next_leaves(work, found, place)]
    _join(work)
    return _summary(work)


def first_equations(
    system: SecondOrderSystem, options: SolveOptions, end: float
) -> list[tuple[ex.Expression, ...]]:
    """The equations between functions of the leaves next to the general member; () where they are
    not split in time.
    """
    try:
        work = _prepared(
            system, system.parameters, [name for name, _ in system.functions], options, end
        )
        root = Found(Leaf(work.unknowns), None, None, "not_variational")
        work.found.append(root)
        next_ones = list(_next_leaves(work, root, 0))
    except (NotSplit, exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError):
        return []
    found = dict.fromkeys(tuple(map(collecting.collect, _trees(one))) for one in next_ones)
    functional = [trees for trees in found if any(ex.has(tree, ex.Arbitrary) for tree in trees)]
    return sorted(functional, key=lambda trees: sum(map(ex.node_count, trees)))


def _prepared(
    system: SecondOrderSystem,
    letters: Sequence[str],
    functions: Sequence[str],
    options: SolveOptions,
    end: float,
) -> _Work:
    analysis = deciding.analyze(system)
    system = analysis.system
    n = len(system.coordinates)
    depth = DEPTHS.get(n, 1)
    budget = exact_field.Budget(20 * bounds.TERMS, end)
    names = [] if n == 1 else _row_names(analysis, depth, options.seed)
    exact = (
        hierarchy.exact_rows(analysis, names, options.seed, budget, FURTHER_ORDERS)
        if names
        else None
    )
    motion = (
        exact.exact if exact is not None else cd.motion_in_ring(system, 2 + FURTHER_ORDERS, budget)
    )
    ring = motion.ring
    known = {name: of for name, of in system.functions if name in functions}
    unknowns = Unknowns.of(ring, letters, known)
    places, named = hierarchy.unknowns(n), list[tuple[hierarchy.EquationName, list[fmpq_mpoly]]]()
    zero = ring.constant(0)
    for name, equation in exact.equations.items() if exact is not None else ():
        whole = matrices.numerators(ring, [equation.get(place, zero) for place in places])
        common = exact_field.common_divisor([one for one in whole if not one.is_zero()])
        moving = [
            f for f, _ in polynomials.factor_polynomial(common)[1] if not unknowns.unknowns_in(f)
        ]
        scale = math.prod(moving, start=common * 0 + 1)
        named.append((name, [one / scale for one in whole]))
    named.sort(key=lambda pair: sum(map(len, pair[1])))
    atoms = [tree for tree in ring.trees.values() if isinstance(tree, ex.Apply | ex.Power)]
    wanted = {ex.Symbol(name) for name in letters}
    is_movable = not any(
        node in wanted or (isinstance(node, ex.Arbitrary) and node.name in known)
        for tree in atoms
        for node in ex.walk(tree)
    )
    return _Work(
        system,
        analysis,
        motion,
        unknowns,
        [row for _, row in named],
        [name for name, _ in named],
        options.time_dependent,
        options.seed,
        end,
        is_movable,
    )


def _row_names(analysis: deciding.Analysis, depth: int, seed: int) -> list[hierarchy.EquationName]:
    table = hierarchy.equations_at(analysis, seed, depth)
    return [name for name, row in table.rows.items() if any(row)]


def _until(work: _Work) -> float:
    return min(work.end, deadline.now() + SPLITTING_SECONDS)


def _trees(leaf: Leaf) -> tuple[ex.Expression, ...]:
    return tuple(map(leaf.unknowns.tree, leaf.equations))


def _special_arguments(work: _Work) -> Iterator[list[fmpq_mpoly]]:
    """Where functions of constants may become dependent: arguments that are 0 or constant, small
    integer exponents.
    """
    ring, unknowns = work.exact.ring, work.unknowns
    names = {ex.Symbol(name) for name in unknowns.letters.values()}
    for tree in ring.trees.values():
        if not isinstance(tree, ex.Apply | ex.Power) or names.isdisjoint(ex.walk(tree)):
            continue
        for part in ex.children(tree):
            if isinstance(part, ex.Number):
                continue
            with suppress(KeyError, ZeroDivisionError, exact_field.TooLarge):
                value = ring.value(part)
                shifts = (
                    range(-3, 3)
                    if isinstance(tree, ex.Power) and part == ex.children(tree)[1]
                    else (0,)
                )
                for shift in shifts:
                    whole = unknowns.coefficients((value + ring.constant(shift)).numerator)
                    if not any(one.is_constant() for one in whole):
                        yield whole
                moving = {
                    e: c
                    for e, c in exact_field.coefficients_of(value.numerator, unknowns.outer).items()
                    if any(e)
                }
                if moving and not any(one.is_constant() for one in moving.values()):
                    yield list(moving.values())


def _is_known(work: _Work, leaf: Leaf) -> bool:
    """Whether a leaf that was decided has the same equations; it then gets the members of both."""
    for place, known in enumerate(work.found):
        same = {*map(str, known.leaf.equations)} == {*map(str, leaf.equations)}
        with suppress(NotSplit, errors.IrreducibleAtoms):
            if not same and len(known.leaf.rules) == len(leaf.rules):
                there, back = (
                    leaves.holds(*pair, work.draw)
                    for pair in ((known.leaf, leaf), (leaf, known.leaf))
                )
                same = there and back
        if same:
            kept = tuple(one for one in known.leaf.nonzero if one in leaf.nonzero)
            work.found[place] = replace(known, leaf=replace(known.leaf, nonzero=kept))
            return True
    return False


def _is_inside_another(work: _Work, leaf: Leaf) -> bool:
    """Whether a set that is asked for lies in one with another verdict than the general member,
    whose own next leaves hold its special members.
    """
    undecided = {one.inside for one in work.open}
    with suppress(NotSplit, errors.IrreducibleAtoms):
        places = list(leaves.points(leaf, work.draw, 7, 2))
        return any(
            leaves.contains(known.leaf, places)
            for place, known in enumerate(work.found)
            if known.leaf in work.simple and place not in undecided
        )
    return False


# The general member of a leaf.


def _decided(work: _Work, leaf: Leaf, inside: int | None) -> Found:
    """The leaf with the verdicts on its general member; NotSplit if it has none that can be
    decided.
    """
    # Points of the leaf decide as well as a closed form, which takes longer if functions are
    # solved.
    at_points = work.is_movable and any(rule.leader in work.unknowns.jets for rule in leaf.rules)
    member = None
    if not leaf.rules:
        member = closed_members.Member(work.system, ())
    elif not at_points:
        member = closed_members.member_of(work.system, leaf)
    asked = questions.asked(work.time_dependent, work.system.depends_on_time)
    limits = involution.Limits(deadline=min(work.end, deadline.now() + DECIDING_SECONDS))
    analysis, draw = work.analysis, None
    if member is not None:
        try:
            analysis = deciding.analyze(member.system) if leaf.rules else work.analysis
        except (errors.IrreducibleAtoms, ZeroDivisionError) as problem:
            raise NotSplit(f"the equations have no value there: {problem}") from problem
    elif not work.is_movable:
        raise NotSplit("functions hold constants that are not solved for")
    else:
        next(leaves.points(leaf, work.draw, work.seed, 1))
        draw = lambda seed: next(leaves.points(leaf, work.draw, seed, 1))  # noqa: E731
    verdicts = dict[Question, Verdict]()
    statement = ""
    for question in asked:
        if verdicts.get(PLAIN) == "variational":
            verdicts[question] = "variational"
            continue
        card = deciding.HelmholtzAt(analysis, question, (), draw)
        found = involution.settle(card, work.seed, limits, lambda _: None)
        verdicts[question] = deciding.verdict_of(found.exists)
        if found.exists is None:
            raise NotSplit(f"the general member is undetermined: {found.open and found.open.words}")
    system, solved = (None, ()) if member is None else (member.system, member.solved)
    return Found(leaf, inside, verdicts.get(PLAIN), verdicts.get(TIMED), statement, system, solved)


# The next leaves.


def _next_leaves(work: _Work, found: Found, place: int) -> Iterator[Leaf]:
    """The leaves inside this one where the verdicts may differ; what cannot be split is noted as
    open.
    """
    asked = [one for one in found.verdicts if one is not None]
    if work.size == 1 and "not_variational" not in asked:
        return  # each equation of one coordinate has a Lagrangian
    if (
        found.inside is None
        and "not_variational" not in asked
        and _by_lagrangian(work, found) == []
    ):
        return  # that is regular and defined for every member
    found = work.found[place]
    rank, chosen, kernel = _rank(work, found.leaf)
    total = len(hierarchy.unknowns(work.size))
    work.found[place] = found = replace(
        work.found[place], rows=(tuple(chosen), *_row_sets(work, rank)), kernel=kernel
    )
    for smaller in range(rank, 0, -1):
        known = len(work.open)
        yield from _split(work, found.leaf, _minors(work, found.leaf, chosen[:smaller]), place)
        if len(work.open) == known:
            break  # the sets of lower rank are among the leaves
    if kernel == "singular":
        return
    try:
        if total - rank == 1:
            direction = _direction(work, [work.rows[k] for k in chosen])
            singular = matrices.determinant(direction, work.unknowns.ring.constant(1)).numerator
            yield from _split(work, found.leaf, work.unknowns.coefficients(singular), place)
            if "not_variational" in asked:
                yield from _differential(work, found, direction, place)
            return
    except (exact_field.TooLarge, ZeroDivisionError, NotSplit):
        pass
    try:
        yield from list(_completed(work, found, place, chosen))
    except (NotSplit, exact_field.TooLarge, ZeroDivisionError) as problem:
        exact = None if "not_variational" in asked else _by_lagrangian(work, found)
        if exact is None:
            work.open.append(Open(place, (), f"{SEVERAL}: {problem}"))
        for equations in exact or ():
            yield from _split(work, found.leaf, equations, place)


def _completed(work: _Work, found: Found, place: int, chosen: Sequence[int]) -> Iterator[Leaf]:
    """The next leaves by completed differential conditions, from independent algebraic ones."""
    plain, timed = found.verdict, found.timed
    system = found.system or work.system
    isotropic = work.size == 2 and not chosen and plain is None  # Douglas' case I
    # Where one condition is left, two linear equations with constant coefficients have an L(q, q').
    linear = len(chosen) < 2 and regularity.is_linear_pair(work.system)
    if "not_variational" not in (plain, timed) and (
        isotropic or linear or regularity.has_one_everywhere(system)
    ):
        return
    # If there is an L(q, q'), it answers both questions; if there is no L(t, q, q'), none.
    asked = [PLAIN] if plain == "variational" or timed is None else [TIMED]
    if plain == "not_variational" and timed == "variational":
        asked.append(PLAIN)
    systems = dict[frozenset[str], tuple[fmpq_mpoly, ...]]()
    for question in asked:
        rows = [work.rows[k] for k in chosen]
        done = completion.complete(found.leaf, work.exact, rows, question, _until(work))
        if done.is_regular != ((timed if question.timed else plain) == "variational"):
            raise NotSplit("the differential conditions have another answer")
        systems |= {frozenset(map(str, parts)): parts for parts in done.special}
        work.found[place] = replace(work.found[place], order=done.order)
    for parts in systems.values():
        yield from _split(work, found.leaf, parts, place)


def _split(work: _Work, leaf: Leaf, equations: Iterable[fmpq_mpoly], place: int) -> list[Leaf]:
    listed = list[fmpq_mpoly]()
    try:
        listed.extend(equations)
        reduced = _reduced(leaf, listed)
        if not reduced:
            raise NotSplit("no equation was found that parts it")
        # A part of the equations gives a larger set, which is sound.
        short = [one for one in sorted(reduced, key=len) if len(one) <= leaves.MOST_TERMS]
        if not short:
            raise NotSplit(f"each equation has more than {leaves.MOST_TERMS} terms")
        return leaves.split_leaf(leaf, short[:MOST_EQUATIONS], _until(work), work.draw)
    except NotSplit as problem:
        shown = min(listed, key=len, default=None)
        trees = () if shown is None or len(shown) > MOST_NAMED else (_in_factors(work, shown),)
        work.open.append(Open(place, trees, str(problem)))
        if leaf.rules or work.simple:
            return []
        work.simple += _simple_sets(work, leaf)
        return work.simple


def _in_factors(work: _Work, equation: fmpq_mpoly) -> ex.Expression:
    """The equation as the product of its factors, without powers of coordinates: another part of
    them would not be recognized by the checker.
    """
    factors = polynomials.factor_polynomial(equation)[1]
    kept = [pair for pair in factors if len(pair[0]) > 1 or work.unknowns.unknowns_in(pair[0])]
    trees = [collecting.collect(work.unknowns.tree(one)) ** power for one, power in kept]
    return ex.multiply(*sorted(trees, key=ex.node_count))


def _reduced(leaf: Leaf, equations: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly]:
    """The equations on the leaf, each once, without those that grow too long; NotSplit if these are
    all.
    """
    found, late = dict[str, fmpq_mpoly](), list[NotSplit]()
    for equation in equations:
        try:
            one = leaf.reduced(equation)
        except NotSplit as problem:
            late.append(problem)
        else:
            if not one.is_zero():
                found[str(one)] = one
    if late and not found:
        raise late[0]
    return [*found.values()]


def _simple_sets(work: _Work, leaf: Leaf) -> Iterator[Leaf]:
    """Sets that are asked for even if longer equations are not split: where a function or constant,
    or a first derivative of a function, vanishes, two functions are equal up to the sign, or two of
    what vanishes do together.
    """
    unknowns, gen = work.unknowns, work.unknowns.context.gen
    of = unknowns.arguments
    jets = unknowns.generators
    plain = {
        name: gen(jets[name, (0,) * len(of[name])])
        for name in of
        if (name, (0,) * len(of[name])) in jets
    }
    slopes = [gen(k) for k, (_, orders) in unknowns.jets.items() if sum(orders) == 1]
    pairs = [(plain[a], plain[b]) for a, b in itertools.combinations(plain, 2) if of[a] == of[b]]
    simple = [*plain.values(), *map(gen, unknowns.letters), *slopes]
    alone = [*simple, *(a - b for a, b in pairs), *(a + b for a, b in pairs)]
    both = itertools.islice(itertools.combinations(simple, 2), MOST_PAIRS)
    for some in (*([one] for one in alone), *map(list, both)):
        with suppress(NotSplit):
            yield from leaves.split_leaf(leaf, some, min(work.end, deadline.now() + 1.0), work.draw)


def _values(work: _Work, leaf: Leaf) -> tuple[list[list[int]], int]:
    """The rows of the conditions at a random point of the leaf, modulo the prime that is returned,
    too.

    Roots that the equations of the leaf do not hold, such as sqrt(a), exist at some points only,
    and a power with a letter that the leaf fixes has no atom of its own; NotSplit if at none.
    """
    for point in leaves.points(leaf, work.draw, work.seed + 1, MOST_POINTS):
        with suppress(modular.SingularPoint, ValueError, KeyError):
            return [[point.value(entry) for entry in row] for row in work.rows], point.prime
    raise NotSplit("at no point of the set that was tried the conditions have values")


class RankOnLeaf(NamedTuple):
    """The rank of conditions, independent rows, and whether a regular g satisfies them."""

    rank: int
    rows: list[int]
    regularity: str


def _rank(work: _Work, leaf: Leaf) -> RankOnLeaf:
    """The rank of the conditions on the leaf, independent rows of them, and whether a regular g
    satisfies them.
    """
    values, prime = _values(work, leaf)
    chosen, width = list[int](), len(hierarchy.unknowns(work.size))
    for k in range(len(values)):
        picked = [values[j] for j in (*chosen, k)]
        if nmod_mat(picked, prime).rank() == len(picked):
            chosen.append(k)
    kernel = matrices.null_rows([values[k] for k in chosen], width, prime)
    singular = not kernel or hierarchy.all_singular(kernel, work.size, prime)
    return RankOnLeaf(len(chosen), chosen, "singular" if singular else "regular")


def _minors(work: _Work, leaf: Leaf, chosen: Sequence[int]) -> Iterator[fmpq_mpoly]:
    """The coefficients of minors with as many rows as are chosen, those of these independent rows
    first.

    Only minors that are not zero at a point of the leaf part it; most are zero if the conditions
    are sparse. A part of them gives a larger set, which is sound.
    """
    values, prime = _values(work, leaf)
    width, rank, until = len(work.rows[0]), len(chosen), _until(work)
    echelon, _ = nmod_mat([values[k] for k in chosen], prime).rref()
    pivots = tuple(next(j for j in range(width) if echelon[i, j]) for i in range(rank))
    pairs = ((rows, columns) for rows in dict.fromkeys((tuple(chosen), *_row_sets(work, rank)))
             for columns in itertools.chain((pivots,), itertools.combinations(range(width), rank)))  # fmt: skip
    wanted = (pair for pair in itertools.islice(pairs, MOST_TRIED)
              if nmod_mat([[values[r][c] for c in pair[1]] for r in pair[0]], prime).det())  # fmt: skip
    late: NotSplit | None = None
    found = 0
    for rows, columns in itertools.islice(wanted, MOST_MINORS):
        matrix = [[work.rows[r][c] for c in columns] for r in rows]
        try:
            minor = _polynomial_determinant(work, matrix, until)
        except NotSplit as problem:
            late = late or problem
        else:
            yield from work.unknowns.coefficients(minor)
            found += 1
        if deadline.now() > until:
            break
    if late is not None and not found:
        raise late


def _row_sets(work: _Work, rank: int) -> tuple[tuple[int, ...], ...]:
    sets = itertools.combinations(range(len(work.rows)), rank)
    return tuple(itertools.islice(sets, MOST_MINORS))


def _polynomial_determinant(
    work: _Work, matrix: Sequence[Sequence[fmpq_mpoly]], until: float
) -> fmpq_mpoly:
    """By minors; NotSplit if one is too long, or the time is over."""
    owner = work.unknowns.ring.field
    zero: fmpq_mpoly = work.unknowns.context.constant(0)

    def total(terms: minors.Terms[fmpq_mpoly]) -> fmpq_mpoly:
        found = zero
        for sign, left, right in terms:
            found = found + owner.product(left, right) * sign
            if len(found) > 50 * leaves.MOST_TERMS:
                raise NotSplit(f"a minor has {len(found)} terms")
            if deadline.now() > until:
                raise NotSplit("the time for splitting was over")
        return found

    return minors.by_minors(matrix, zero + 1, lambda one: one.is_zero(), total)


def _direction(
    work: _Work, rows: Sequence[Sequence[fmpq_mpoly]]
) -> list[list[exact_field.Quotient]]:
    """The one g that satisfies as many rows as entries but one, by minors."""
    owner, n, until = work.unknowns.ring.field, work.size, _until(work)
    entries = dict[tuple[int, int], exact_field.Quotient]()
    for column, pair in enumerate(hierarchy.unknowns(n)):
        others = [[*row[:column], *row[column + 1 :]] for row in rows]
        value = exact_field.Quotient(owner, _polynomial_determinant(work, others, until), ())
        entries[pair] = value if column % 2 == 0 else -value
    return [[entries[min(i, j), max(i, j)] for j in range(n)] for i in range(n)]


def _differential(
    work: _Work, found: Found, direction: list[list[exact_field.Quotient]], place: int
) -> Iterator[Leaf]:
    """Where the factor e^u of the one g exists: all mixed derivatives of u agree, and u_t = 0 if L
    must not contain t.
    """
    matrix = tuple(map(tuple, direction))
    slopes = cd.factor_slopes(work.exact, matrix, cd.rate_by_trace(work.exact, matrix))
    asked = {TIMED: found.timed, PLAIN: found.verdict}
    for question, verdict in asked.items():
        if verdict != "not_variational" or (
            question is PLAIN and asked[TIMED] == "not_variational"
        ):
            continue
        names = work.system.coordinates
        listed = hierarchy.integrability_conditions(work.exact, slopes, question, names)
        values = [value for _, _, value, _ in listed if not value.is_zero]
        equations = [one for value in values for one in work.unknowns.coefficients(value.numerator)]
        if all(found.leaf.reduced(one).is_zero() for one in equations):
            raise NotSplit("a divisor of the slopes of u vanishes on the leaf")
        yield from _split(work, found.leaf, equations, place)


def _by_lagrangian(work: _Work, found: Found) -> list[list[fmpq_mpoly]] | None:
    """Where a Lagrangian of the general member is singular or not defined; None if no Lagrangian in
    closed form is known.
    """
    place = work.found.index(found)
    work.found[place] = solved = _with_answer(work, found)
    if solved.system is None:
        return None
    answer = solved.without_time or solved.answer
    if answer is None or answer.lagrangian is None or answer.checked != "valid":
        return None
    tree = answer.lagrangian.expression
    if found.verdict == "variational" and ex.holds(tree, ex.TIME):
        return None  # it proves nothing about L(q, q')
    try:
        return regularity.where_it_fails(
            work.unknowns, solved.system, tree, solved.solved, work.end
        )
    except (exact_field.TooLarge, ZeroDivisionError, KeyError, NotSplit):
        return None


# What is told.


def _join(work: _Work) -> None:
    """The sets of a linear pair on which at most one condition is left as one set, if they are many
    and long: where all minors of two conditions vanish. Each of its members has an L(q, q').
    """
    first_rows = [
        row for name, row in zip(work.names, work.rows, strict=True) if name.condition.power < 2
    ]
    if not regularity.is_linear_pair(work.system) or len(first_rows) != 2:
        return
    alike = [
        k
        for k, one in enumerate(work.found)
        if k and one.rows and len(one.rows[0]) < 2 and not _is_solved(one.leaf)
    ]
    if len(alike) < LEAST_JOINED or {work.found[k].verdicts for k in alike} != {YES_YES}:
        return
    first, second = first_rows
    products = (
        first[i] * second[j] - first[j] * second[i]
        for i, j in itertools.combinations(range(len(first)), 2)
    )
    whole = tuple(part for one in products for part in work.unknowns.coefficients(one))
    longest = max(len(one) for k in alike for one in work.found[k].leaf.equations)
    if longest <= max(map(len, whole)):
        return  # they read better one by one
    kept = min(alike, key=lambda k: work.found[k].leaf.size)
    one = work.found[kept]
    leaf = Leaf(work.unknowns, one.leaf.rules, (), whole)
    work.found[kept] = replace(one, leaf=leaf, system=None, solved=(), answer=None)
    left = [k for k in range(len(work.found)) if k == kept or k not in alike]
    places = {k: left.index(kept if k in alike else k) for k in range(len(work.found))}

    def moved(inside: int | None) -> int | None:
        return None if inside is None else places[inside]

    work.found[:] = [replace(work.found[k], inside=moved(work.found[k].inside)) for k in left]
    work.open[:] = [replace(one, inside=places[one.inside]) for one in work.open]


def _is_solved(leaf: Leaf) -> bool:
    """Whether each equation is linear in its leader, with a number before it."""
    return all(rule.degree == 1 and rule.initial.is_constant() for rule in leaf.rules)


def _summary(work: _Work) -> Family:
    """The leaves whose verdicts differ from those of the smallest told leaf around them, the
    general one first.
    """
    places = list[list[leaves.PointOnLeaf]]()
    for one in work.found:
        try:
            places.append(list(leaves.points(one.leaf, work.draw, 7, 2)))
        except (NotSplit, errors.IrreducibleAtoms, KeyError):
            places.append([])
    cells = tuple(work.found)
    # A set comes after all whose equations hold on it: these are more than for any set around it.
    bare = [replace(one.leaf, nonzero=()) for one in work.found]
    depths = [sum(leaves.contains(large, points) for large in bare) for points in places]
    allowance = shorter_leaves.Allowance(work.end)
    _drop_inequations(work, depths, places, allowance)
    told, numbers, keys = list[Found](), dict[int, int](), list[tuple[int, tuple[int, int]]]()
    order = sorted(range(len(bare)), key=lambda k: (depths[k], bare[k].size))
    for number in order:
        one = work.found[number]
        around = [k for k, other in enumerate(told) if leaves.contains(other.leaf, places[number])]
        told_places = {place: number for number, place in numbers.items()}
        own = {k: places[told_places[k]] for k in around}
        smallest = [
            k
            for k in around
            if not any(
                k != m
                and leaves.contains(told[k].leaf, own[m])
                and not leaves.contains(told[m].leaf, own[k])
                for m in around
            )
        ]
        differs = [k for k in smallest if told[k].verdicts != one.verdicts]
        # Functions with fewer equations, at which an inequation fails, are solutions of another
        # kind.
        count = len(one.leaf.rules)
        apart = _is_functional(one.leaf) and all(
            (count == 1 or len(told[k].leaf.rules) > count)
            and not leaves.contains(cells[told_places[k]].leaf, places[number])
            for k in smallest
        )
        if not told or differs or apart or not around:
            depth = depths[number] if differs or not smallest else min(keys[k][0] for k in smallest)
            keys.append((depth, bare[number].size))
            numbers[number] = len(told)
            told.append(
                replace(one, inside=differs[0] if told and differs else None if not told else 0)
            )
    # Of sets with one verdict, those with fewer equations come first.
    sequence = sorted(range(len(told)), key=keys.__getitem__)
    place = {old: new for new, old in enumerate(sequence)}
    numbers = {number: place[old] for number, old in numbers.items()}
    told = [
        replace(told[old], inside=None if (inside := told[old].inside) is None else place[inside])
        for old in sequence
    ]
    told, numbers = _without_repeats(work, Told(told, numbers), places, allowance)
    final = [_with_answer(work, one) for one in told]
    opened = [_told_as_open(work, one, told, numbers, places) for one in work.open]
    return Family(
        work.unknowns,
        tuple(final),
        tuple(dict.fromkeys(opened)),
        cells,
        tuple(work.open),
        tuple(work.names),
    )


def _is_functional(leaf: Leaf) -> bool:
    return bool(leaf.rules) and all(rule.leader in leaf.unknowns.jets for rule in leaf.rules)


def _drop_inequations(
    work: _Work,
    depths: Sequence[int],
    places: Sequence[Sequence[leaves.PointOnLeaf]],
    allowance: shorter_leaves.Allowance,
) -> None:
    """Keep only inequations that part a leaf from members with other verdicts; all where an open
    set is beside it.
    """
    beside = {one.inside for one in work.open}
    before = tuple(work.found)
    for number, one in enumerate(before):
        if one.leaf.nonzero and one.inside not in beside:
            whole = replace(one.leaf, nonzero=())
            # Sets inside the leaf become leaves after it.
            is_right = [
                other.verdicts == one.verdicts or leaves.contains(whole, points)
                for other, points in zip(before, places, strict=True)
            ]
            order = sorted(range(len(before)), key=lambda k: (depths[k], not is_right[k]))
            asked = shorter_leaves.Asked(
                [before[k].leaf for k in order],
                [is_right[k] for k in order],
                work.draw,
                allowance,
            )
            kept = tuple(g for g in one.leaf.nonzero if not asked.holds(whole, g))
            work.found[number] = replace(one, leaf=replace(one.leaf, nonzero=kept))


class Told(NamedTuple):
    """The leaves of the table, and their places in it by the numbers of the sets."""

    leaves: list[Found]
    places: dict[int, int]


def _without_repeats(
    work: _Work,
    before: Told,
    places: Sequence[Sequence[leaves.PointOnLeaf]],
    allowance: shorter_leaves.Allowance,
) -> Told:
    """The leaves that do not repeat others."""
    told, numbers = before
    own = {place: places[number] for number, place in numbers.items()}
    rows = [shorter_leaves.Row(one.leaf, one.verdicts) for one in told]
    asked = [
        k
        for k, one in enumerate(told)
        if k and not _is_functional(one.leaf) and k not in _beside_long(told, own)
    ]
    kept = shorter_leaves.shorter(rows, asked, work.draw, allowance)
    new = {old: place for place, old in enumerate(kept)}

    def inside(old: int) -> int | None:
        around = told[old].inside
        stays = around in new and (not own[old] or leaves.contains(kept[around], own[old]))
        if around is None or stays:
            return None if around is None else new[around]
        others = [
            k
            for k, leaf in kept.items()
            if k < old
            and told[k].verdicts != told[old].verdicts
            and leaves.contains(leaf, own[old])
        ]
        return new[max(others, default=0)]

    found = [replace(told[old], leaf=leaf, inside=inside(old)) for old, leaf in kept.items()]
    return Told(found, {number: new[old] for number, old in numbers.items() if old in new})


def _beside_long(
    told: Sequence[Found], own: Mapping[int, Sequence[leaves.PointOnLeaf]]
) -> set[int]:
    """The widest leaves of solved constants, if there is a set whose equations are not solved: they
    stay beside it, as functions do that are solutions of another kind.
    """
    if not any(one.leaf.whole for one in told):
        return set()
    solved = [k for k, one in enumerate(told) if one.leaf.rules and _is_solved(one.leaf)]
    return {
        k
        for k in solved
        if not any(m != k and leaves.contains(told[m].leaf, own[k]) for m in solved)
    }


def _told_as_open(
    work: _Work,
    one: Open,
    told: Sequence[Found],
    numbers: dict[int, int],
    places: Sequence[Sequence[leaves.PointOnLeaf]],
) -> Open:
    """The open set inside the smallest told leaf around it, with the equations of its own leaf if
    that is not told.
    """
    if one.inside in numbers:
        return replace(one, inside=numbers[one.inside])
    around = [k for k, other in enumerate(told) if leaves.contains(other.leaf, places[one.inside])]
    own = _trees(work.found[one.inside].leaf)
    return replace(one, inside=max(around, default=0), equations=(*own, *one.equations))


def _with_answer(work: _Work, found: Found) -> Found:
    """The leaf with checked answers about its general member, one with a Lagrangian first."""
    if found.answer is not None or deadline.now() > work.end:
        return found
    if found.system is None and found.leaf.rules:
        member = closed_members.member_of(work.system, found.leaf)
        if member is not None:
            found = replace(found, system=member.system, solved=member.solved)
    if found.system is None:
        return found
    asked = SolveOptions(
        time_dependent=work.time_dependent,
        seed=work.seed,
        time_limit=min(SEARCH_SECONDS, deadline.left(work.end)),
        conditions=False,
        reasons=False,
    )
    with suppress(errors.IrreducibleAtoms, ZeroDivisionError, exact_field.TooLarge):
        solution = solving.solve(found.system, asked)
        answers = [one for one in solution.statements if one.certificate]
        if not answers:
            return found
        shown = min(answers, key=lambda one: (one.verdict != "variational", one.lagrangian is None))
        timed = shown.question.timed and shown.verdict == "variational"
        plain = solution.answer_to(PLAIN) if timed and found.verdict == "variational" else None
        return replace(found, answer=shown, without_time=plain)
    return found
