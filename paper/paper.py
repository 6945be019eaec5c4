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


# Where the errata belong among the statements of section 2; that of the matching circle follows its
# figures.
SECTION_TWO = (
    "motion", "associated", "proposition-1-1", "proposition-1-2", "nabla-phi", "curvature", "singular", "hamiltonian",
    "proposition-2",
)  # fmt: skip


def sections(folder: Path, progress: Progress) -> tuple[Section, ...]:
    """All sections, statements in the order of the paper; figures are written to the folder, which must exist."""
    found = (*section_two(progress).statements, *section_errata(progress).statements)
    symbolic = {statement.key: statement for statement in found}
    exact, spiral, *disk = disk_statements(folder, progress)
    integrators = (exact, spiral, symbolic["circle"], *disk, *other_statements(folder, progress))
    return (
        Section(
            "Section 2: a class of nonholonomic systems",
            tuple(symbolic[key] for key in SECTION_TWO),
        ),
        Section("Section 3: geometric integrators", integrators),
        section_four(progress),
        Section("Beyond the paper", beyond(folder, progress)),
    )
