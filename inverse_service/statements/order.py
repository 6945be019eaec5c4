"""The order in which people meet what was found: the same at every door."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

from inverse_service.statements.questions import About, Question

T = TypeVar("T")
_PLACES = {about: place for place, about in enumerate(About)}


@dataclass(frozen=True, slots=True)
class Standing:
    """What the order looks at: the question, its verdict, the cell of the system, and of which form
    L is.

    `form` is that of `tree.reading_class`, None where there is no L.
    """

    question: Question
    verdict: str
    cell: int
    form: int | None


def in_order(found: Iterable[T], timed: bool, standing: Callable[[T], Standing]) -> list[T]:
    """What was found, the statement that a person is shown first; `timed` says which question was
    asked.

    The cell of the main point comes first; on a cell, what is about the equations themselves comes
    before what is about other equations, kinds of L, and special cases. Then: a yes with L, the
    simplest form of L first; a yes without L; a no; an open question. Of two that are alike the
    question that was asked comes first, then the order of `About`.
    """

    def place(one: T) -> tuple[int, ...]:
        seen = standing(one)
        return (
            seen.cell,
            seen.question.is_about_others,
            seen.verdict == "undetermined",
            seen.verdict != "variational",
            seen.form is None,
            seen.form or 0,
            seen.question.timed is not timed,
            _PLACES[seen.question.about],
        )

    return sorted(found, key=place)
