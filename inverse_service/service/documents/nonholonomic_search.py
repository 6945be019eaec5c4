"""The use case `"associated": "search"`: families decided, one member for the main fields of the result."""

from __future__ import annotations

from collections.abc import Callable

from api_schemas.family_search import SearchPart
from api_schemas.nonholonomic import NonholonomicDocument
from inverse_service.errors import InputError, IrreducibleAtoms
from inverse_service.inverse_problem.families.family_search import (
    FamilyOptions,
    FamilySearch,
    VariationalMember,
    search_families,
)
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import MotionReport
from inverse_service.mechanics.nonholonomic.associated_systems import KINDS, AssociatedSystem, associated
from inverse_service.service.documents.translate_family_search import to_family_options, to_search


def searched(
    report: MotionReport,
    schema: NonholonomicDocument,
    seed: int,
    time_limit: float,
    progress: Callable[[str], None] | None,
) -> tuple[AssociatedSystem, SearchPart]:
    """The system for the main fields and the part `search`; InputError where the families cannot be formed."""
    defined = [associated(report.exact, report.member, report.reason, kind) for kind in KINDS]
    known = [(one.kind, one.system) for one in defined if one.system is not None]
    with_time = schema.time_dependent_lagrangian is True or any(system.depends_on_time for _, system in known)
    options = to_family_options(schema.search, with_time, seed, time_limit)
    try:
        found = search_families(report.exact, options, known, progress)
    except IrreducibleAtoms as problem:
        raise InputError(f"the families cannot be decided together: {problem.detail}", "/associated") from None
    return _main(found, defined, options), to_search(found, options)


def _main(found: FamilySearch, defined: list[AssociatedSystem], options: FamilyOptions) -> AssociatedSystem:
    """The simplest variational system found, one with a Lagrangian first; the first system where there is none."""
    if not found.variational:
        text = f"None of the {found.different} systems searched is known to be variational; this is the first one."
        return AssociatedSystem("first", defined[0].system, text)
    chosen = min(found.variational, key=_rank)
    kind = chosen.kinds[0] if chosen.kinds else "search"
    system = next((one.system for one in defined if one.kind == kind), chosen.system)
    names = ", ".join(options.names)
    return AssociatedSystem(kind, system, f"Found by a search of the families {names}: {', '.join(chosen.families)}.")


def _rank(member: VariationalMember) -> tuple[bool, bool]:
    has_lagrangian = member.answer is not None and member.answer.lagrangian is not None
    holds = member.hamiltonisation is not None and member.hamiltonisation.holds
    return not holds, not has_lagrangian
