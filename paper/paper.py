"""The whole report: every statement of the paper recomputed."""

from __future__ import annotations

from pathlib import Path

from paper.beyond import beyond
from paper.disk_statements import disk_statements
from paper.errata import section_errata
from paper.further_systems import section_four
from paper.other_statements import other_statements
from paper.propositions import section_two
from paper.statement import Progress, Section

FIGURES = "paper"


def sections(folder: Path, progress: Progress) -> tuple[Section, ...]:
    """All sections; figures are written to the folder, which must exist."""
    symbolic = (section_two(progress), section_errata(progress))
    integrators = Section(
        "Section 3: geometric integrators",
        (*disk_statements(folder, progress), *other_statements(folder, progress)),
    )
    further = section_four(progress)
    return (*symbolic, integrators, further, Section("Beyond the paper", beyond(folder, progress)))
