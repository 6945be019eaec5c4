"""What a report is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

Finding = Literal["agrees", "erratum", "correction", "differs"]
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure: its file name without suffix, its caption, and what it shows for a reader who cannot see it."""

    name: str
    caption: str
    description: str


@dataclass(frozen=True, slots=True)
class Statement:
    """One statement of the paper, what was computed, and whether the two agree.

    `finding`: "agrees"; "erratum", the paper is wrong in print and the computation shows what is
    right; "correction", what the paper concludes does not follow from what it shows; "differs", the
    computation gives what neither the paper nor its known errata say, so that one of the programs
    is wrong.
    """

    key: str
    where: str
    claim: str
    finding: Finding
    computed: str
    code: str
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """Statements under one heading."""

    heading: str
    statements: tuple[Statement, ...] = field(default=())


def finding(agrees: bool, expected: Finding = "agrees") -> Finding:
    """`expected` where the computation came out as expected, else "differs"."""
    return expected if agrees else "differs"
