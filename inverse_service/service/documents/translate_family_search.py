"""The search among associated systems as the part of a result document."""

from __future__ import annotations

from api_schemas.family_search import FamilyPart, FamilySearchOptions, FoundFormula, FoundMember, SearchPart
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.tree import Acceleration, Expression
from inverse_service.inverse_problem.families.family_search import (
    FAMILY_NAMES,
    FamilyCount,
    FamilyOptions,
    FamilySearch,
    VariationalMember,
    covered,
)


def to_family_options(
    asked: FamilySearchOptions | None, with_time: bool, seed: int, time_limit: float
) -> FamilyOptions:
    """The options of the engine; what the document leaves out has the values of the schema."""
    chosen = asked or FamilySearchOptions()
    names = tuple(chosen.families or FAMILY_NAMES)
    return FamilyOptions(names, chosen.depth, chosen.members, with_time, seed, time_limit)


def to_search(found: FamilySearch, options: FamilyOptions) -> SearchPart:
    """The part of the document."""
    return SearchPart(
        question="L(t, q, q')" if options.with_time else "L(q, q')",
        families=[_family(count) for count in found.families],
        different=found.different,
        variational=[_member(member) for member in found.variational],
        covered=covered(found, options),
        seconds=round(found.seconds, 3),
    )


def _family(count: FamilyCount) -> FamilyPart:
    return FamilyPart(
        name=count.name,
        description=count.description,
        size=count.size,
        members=count.members,
        decided=count.decided,
        variational=count.variational,
        not_variational=count.not_variational,
        undetermined=count.undetermined,
    )


def _member(member: VariationalMember) -> FoundMember:
    pairs = list(zip(member.system.coordinates, member.system.accelerations, strict=True))
    answer, report = member.answer, member.hamiltonisation
    lagrangian = None if answer is None or answer.lagrangian is None else answer.lagrangian.expression
    transform = None if report is None else report.transform
    return FoundMember(
        families=list(member.families),
        kinds=list(member.kinds),
        equations={name: to_text(f) for name, f in pairs},
        latex={name: f"{to_latex(Acceleration(name))} = {to_latex(f)}" for name, f in pairs},
        checked=None if answer is None else answer.checked,
        statement="" if answer is None or answer.space is None else answer.space.statement,
        lagrangian=None if lagrangian is None else _formula(lagrangian),
        hamiltonian=None if transform is None or transform.implicit else _formula(transform.hamiltonian),
        constraints=[] if report is None else [_formula(image) for image in report.images],
        holds=None if report is None or not report.statements else report.holds,
    )


def _formula(tree: Expression) -> FoundFormula:
    return FoundFormula(text=to_text(tree), latex=to_latex(tree))
