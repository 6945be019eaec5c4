"""Which associated systems of a nonholonomic motion are variational: named families, every member decided."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from inverse_service.algebra import series as ps
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import evaluate
from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import draw_point
from inverse_service.errors import CertificateRefused, InputError
from inverse_service.inverse_problem.families.forked import forked_map
from inverse_service.inverse_problem.families.shared import SharedLetters
from inverse_service.inverse_problem.hamiltonisation.hamiltonise import Hamiltonisation, hamiltonise
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.inverse_problem.outcome import Answer, Verdict
from inverse_service.inverse_problem.solving import solve
from inverse_service.linear_pde.deciding import Limits
from inverse_service.mechanics.nonholonomic.associated_families import (
    Family,
    Member,
    Source,
    forces,
    members,
    mixtures,
    multiples,
    products,
    ratios,
)
from inverse_service.mechanics.nonholonomic.geometry import too_large
from inverse_service.mechanics.nonholonomic.motion import ExactMotion, written
from inverse_service.mechanics.nonholonomic.writing import tidied
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Progress = Callable[[str], None]
BUILDERS: dict[str, Callable[[Source, int], Family]] = {
    "products": lambda source, depth: products(source),
    "forces": forces,
    "ratios": ratios,
    "mixtures": lambda source, depth: mixtures(source),
    "multiples": multiples,
}
FAMILY_NAMES = tuple(BUILDERS)
# The part of the time that decisions may take; the rest is for Lagrangians and Hamiltonians.
_DECIDING = 0.6
_SECONDS_EACH = 20.0
# Writing the letters down takes a second; it is given this many, whatever the time limit.
_WRITING = 10.0


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """Which families, the highest power or multiple, the most members of each, the question, the time in s.

    For the first `carried` variational systems a Lagrangian and a Hamiltonian are sought.
    """

    names: tuple[str, ...] = FAMILY_NAMES
    depth: int = 2
    most: int = 1_000
    with_time: bool = False
    seed: int = 1
    time_limit: float = 60.0
    processes: int | None = None
    carried: int = 24


@dataclass(frozen=True, slots=True)
class FamilyCount:
    """What became of one family: `size` choices, `members` distinct ones taken, `decided` of them by verdict."""

    name: str
    description: str
    size: int
    members: int
    variational: int
    not_variational: int
    undetermined: int

    @property
    def decided(self) -> int:
        return self.variational + self.not_variational + self.undetermined


@dataclass(frozen=True, slots=True)
class VariationalMember:
    """A variational system with what was found for it; `kinds` are those of the paper that it equals."""

    families: tuple[str, ...]
    kinds: tuple[str, ...]
    system: SecondOrderSystem
    answer: Answer | None = None
    hamiltonisation: Hamiltonisation | None = None


@dataclass(frozen=True, slots=True)
class FamilySearch:
    """The counts, the variational members, how many different systems there were, and the time in s."""

    families: tuple[FamilyCount, ...]
    variational: tuple[VariationalMember, ...]
    different: int
    left_out: int
    seconds: float


@dataclass(slots=True)
class _Work:
    shared: SharedLetters
    options: FamilyOptions
    progress: Progress
    deadline: float
    verdicts: dict[tuple[int, ...], Verdict] = field(default_factory=dict)


def search_families(
    motion: ExactMotion,
    options: FamilyOptions,
    known: Sequence[tuple[str, SecondOrderSystem]] = (),
    progress: Progress | None = None,
) -> FamilySearch:
    """Decide the members of the families in turn; `known` are systems to be recognised among them.

    Raises InputError for a family of no such name or too large formulas, IrreducibleAtoms where the letters
    cannot be reduced.
    """
    began = time.monotonic()
    report = progress or (lambda _: None)
    _refuse_unknown(options.names)
    families, source = _families(motion, options, began + max(options.time_limit, _WRITING))
    given = motion.geometry.system
    empty = SecondOrderSystem(given.coordinates, (), given.parameters, given.functions)
    shared = SharedLetters.of(empty, source.letters.trees)
    work = _Work(shared, options, report, began + _DECIDING * options.time_limit)
    taken = [list(members(family, options.most)) for family in families]
    for family, found in zip(families, taken, strict=True):
        _decide_all(work, family.name, found)
    counts = tuple(_count(work, family, found) for family, found in zip(families, taken, strict=True))
    variational = list(_variational(work, families, taken, known))
    end = began + options.time_limit
    carried = _carried_on(work, motion, variational[: options.carried], end)
    return FamilySearch(
        counts,
        (*carried, *variational[options.carried :]),
        len(work.verdicts),
        max(0, len(variational) - options.carried),
        time.monotonic() - began,
    )


def _families(motion: ExactMotion, options: FamilyOptions, deadline: float) -> tuple[list[Family], Source]:
    try:
        source = Source.of(motion, deadline)
        return [BUILDERS[name](source, options.depth) for name in options.names], source
    except TooLarge as error:
        raise too_large(error) from None


def _refuse_unknown(names: Sequence[str]) -> None:
    for name in names:
        if name not in BUILDERS:
            raise InputError(f"there is no family of that name: choose among {', '.join(FAMILY_NAMES)}.", "/families")


def fingerprint(shared: SharedLetters, member: Member, seed: int) -> tuple[int, ...]:
    """The values of f at a random point modulo a prime of 61 bits: equal systems have equal ones."""
    found = shared.expanded(False, 2 * seed, 3)
    return tuple(ps.value_at_point(found.force(part)) for part in member)


def _decide_all(work: _Work, name: str, found: Sequence[Member]) -> None:
    """Add the verdicts of the systems not yet seen."""
    seed = work.options.seed
    fresh = {fingerprint(work.shared, member, seed): member for member in found}
    waiting = [(print_, member) for print_, member in fresh.items() if print_ not in work.verdicts]
    limits = Limits(deadline=work.deadline)

    def verdict(pair: tuple[tuple[int, ...], Member]) -> Verdict | None:
        found = work.shared.verdict(pair[1], work.options.with_time, seed, limits)
        # A member that the deadline interrupted is not decided.
        return None if found == "undetermined" and time.monotonic() > work.deadline else found

    def report(done: int) -> None:
        work.progress(f"family {name}: {done} of {len(waiting)} members decided")

    for seed_ in (2 * seed, 2 * seed + 1):  # before the fork, so that the children share them
        _expand(work.shared, work.options.with_time, seed_)
    results = forked_map(verdict, waiting, work.deadline, report, work.options.processes)
    for (print_, _), result in zip(waiting, results, strict=True):
        if result is not None:
            work.verdicts[print_] = result


def _expand(shared: SharedLetters, with_time: bool, seed: int) -> None:
    for order in (3, 4, 5):
        try:
            shared.expanded(with_time, seed, order)
        except SingularPoint:
            return


def _count(work: _Work, family: Family, found: Sequence[Member]) -> FamilyCount:
    verdicts = [work.verdicts.get(fingerprint(work.shared, member, work.options.seed)) for member in found]
    return FamilyCount(
        family.name,
        family.description,
        family.size,
        len(found),
        verdicts.count("variational"),
        verdicts.count("not_variational"),
        verdicts.count("undetermined"),
    )


def _variational(
    work: _Work,
    families: Sequence[Family],
    taken: Sequence[Sequence[Member]],
    known: Sequence[tuple[str, SecondOrderSystem]],
) -> Iterator[VariationalMember]:
    """Each variational system once, with the families that hold it."""
    seed = work.options.seed
    kinds = {_fingerprint_of(work.shared, system, seed): kind for kind, system in known}
    where: dict[tuple[int, ...], tuple[Member, list[str]]] = {}
    for family, found in zip(families, taken, strict=True):
        for member in found:
            print_ = fingerprint(work.shared, member, seed)
            if work.verdicts.get(print_) == "variational":
                names = where.setdefault(print_, (member, []))[1]
                if family.name not in names:
                    names.append(family.name)
    for print_, (member, names) in where.items():
        system = work.shared.member_system(member)
        tidy = replace(system, accelerations=tuple(map(tidied, system.accelerations)))
        yield VariationalMember(tuple(names), (kinds[print_],) if print_ in kinds else (), tidy)


def _fingerprint_of(shared: SharedLetters, system: SecondOrderSystem, seed: int) -> tuple[int, ...]:
    """The fingerprint of a system that is given as trees; () where it holds other atoms."""
    point = draw_point(shared.tower, 2 * seed)
    try:
        return tuple(evaluate(to_kernels(f), point) for f in system.accelerations)
    except (KeyError, ValueError, SingularPoint):
        return ()


def _carried_on(
    work: _Work, motion: ExactMotion, found: Sequence[VariationalMember], end: float
) -> list[VariationalMember]:
    """A Lagrangian and a Hamiltonian for each, as far as the time allows."""
    reduced = written(motion)

    def carry(member: VariationalMember) -> VariationalMember:
        limit = min(_SECONDS_EACH, max(1.0, end - time.monotonic()))
        options = SolveOptions(time_dependent=work.options.with_time, seed=work.options.seed, time_limit=limit)
        try:
            solution = solve(member.system, options)
        except CertificateRefused:
            return member
        answer = solution.with_time if work.options.with_time else solution.autonomous
        if answer is None or answer.lagrangian is None:
            return replace(member, answer=answer)
        report = hamiltonise(reduced, member.system, answer.lagrangian.expression, work.options.seed)
        return replace(member, answer=answer, hamiltonisation=report)

    def report(done: int) -> None:
        work.progress(f"Lagrangians and Hamiltonians: {done} of {len(found)} variational systems")

    results = forked_map(carry, found, end, report, work.options.processes)
    return [member if result is None else result for member, result in zip(found, results, strict=True)]


def covered(found: FamilySearch, options: FamilyOptions) -> str:
    """What the search covered, in a sentence."""
    parts = [
        f"{count.name}: {count.decided} of {count.members} members decided"
        + ("" if count.members < options.most else f", the first {count.members} of {count.size} choices")
        for count in found.families
    ]
    return f"{'; '.join(parts)}; {found.different} different systems in all."
