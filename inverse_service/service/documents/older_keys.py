"""A result of its statements: `answers`, and the older keys, which are a view of the same.

`result_of` alone writes the keys that are older than `answers`: the main fields, `with_time`,
`branches`, `any_associated`, `reduced`, `with_clock`, `kinds`, `instead`, `left_out`. It puts each
statement at the place of its question, and makes nothing but the verdicts that a place repeats.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, Final

from api_schemas import result as schemas
from inverse_service.service.documents import stated
from inverse_service.service.documents.stated import Stated
from inverse_service.statements.questions import About

# The order in which a result is read, but for the statements about its cells, which come first.
_PLACES: Final = ("nonholonomic", "reduced", "with_clock", "kinds", "instead", "left_out")
_FIRST_KEYS: Final = (
    "format",
    "system",
    "question",
    *stated.VERDICTS,
    "reason",
    "checked",
    "answers",
)
# What `instead` repeats of another statement.
SHOWN_INSTEAD: Final = (
    "domain",
    "lagrangian",
    "hamiltonian",
    "certificate",
    "checked",
    "exceptions",
)


@dataclass(frozen=True, slots=True)
class Told:
    """All that a result says: its statements, and `beside` them the keys that are no statements.

    Each statement has the fields and the place of its question; `main` are the equations of the
    main fields. `members` are statements about sets of a family, whose fields are in the key
    `family` beside them. `instead` is the kind of a statement that is repeated there: "time" or
    "reduced".
    """

    statements: tuple[Stated, ...]
    beside: Mapping[str, Any]
    members: tuple[Stated, ...] = field(default=(), kw_only=True)
    main: About = About.MAIN
    instead: str = ""
    schema: type[schemas.ResultDocument] = field(default=schemas.ResultDocument)

    def also(self, *statements: Stated, **beside: Any) -> Told:
        """With more statements, and other keys beside them."""
        return replace(
            self, statements=(*self.statements, *statements), beside={**self.beside, **beside}
        )

    def about_equations(self) -> list[Stated]:
        """The statements about the equations themselves on the main cell: the one that was asked
        for first.
        """
        return [
            one
            for one in self.statements
            if one.question.about is self.main
            and not one.question.is_about_others
            and one.cell == 0
        ]

    @property
    def first(self) -> Stated:
        """The statement of the main fields."""
        return self.about_equations()[0]

    @property
    def timed(self) -> Stated | None:
        """The statement on L(t, q, q') of the main cell, if that was asked."""
        return next((one for one in self.about_equations() if one.question.timed), None)

    @property
    def has_cells(self) -> bool:
        return bool(self.beside.get("branches"))


def result_of(told: Told) -> dict[str, Any]:
    """The document of a result, its keys in the order in which a person reads them."""
    fields = {**told.beside, "question": told.first.question.form}
    for at, group in groupby(_in_places(told), key=lambda one: one.at):
        fields = _with(fields, at.split("/")[1:], _at_place(list(group), told))
    if told.has_cells:
        first = fields["branches"][0]
        fields = {key: value for key, value in first.items() if key != "equations"} | fields
        for key in stated.VERDICTS:
            if len({branch[key] for branch in fields["branches"]}) > 1:
                fields[key] = "differs"
    if told.instead:
        fields["instead"] = _repeated(told)
    found: dict[str, Any] = told.schema.model_validate(fields).model_dump(mode="json")
    listed = stated.in_reading_order([*_listed(told), *told.members], found)
    found["answers"] = stated.entries(listed, found)
    return {key: found[key] for key in _FIRST_KEYS} | found


def _in_places(told: Told) -> Iterator[Stated]:
    """The statements in the order of their places."""

    def place(one: Stated) -> int:
        key = one.at.split("/")[1] if one.at else ""
        return _PLACES.index(key) + 1 if key in _PLACES else 0

    yield from sorted(told.statements, key=place)


def _listed(told: Told) -> Iterator[Stated]:
    """Each statement once: what `instead` has of a kind is repeated where that kind is asked
    about.
    """
    kinds = {one.question.kind for one in told.statements if one.at != "/instead"}
    for one in _in_places(told):
        if one.at != "/instead" or one.question.kind not in kinds - {""}:
            yield one


def _at_place(group: Sequence[Stated], told: Told) -> dict[str, Any]:
    """The fields of a place of one statement, or of two with one proof: then what only the second
    one has is its own.
    """
    one = group[0]
    fields = {**group[-1].part, **one.part}
    if one.at == "/instead":  # it is a yes
        return {key: value for key, value in fields.items() if key != "verdict"}
    if one.question.is_about_others or one.at.endswith("/with_time"):
        return fields
    timed = (
        other.verdict
        for other in told.statements
        if other.question.timed and other.at in (one.at, f"{one.at}/with_time")
    )
    return fields | {"verdict_with_time": next(timed, None)}


def _with(holder: Any, way: Sequence[str], fields: Mapping[str, Any]) -> Any:
    """The holder with these fields at a place in it."""
    if not way:
        return {**(holder or {}), **fields}
    key, *rest = way
    if isinstance(holder, list):
        place = int(key)
        return [*holder[:place], _with(holder[place], rest, fields), *holder[place + 1 :]]
    return {**(holder or {}), key: _with((holder or {}).get(key), rest, fields)}


def _repeated(told: Told) -> dict[str, Any] | None:
    """An L(t, q, q'), or the L of the reduced equations, in the place of the L(q, q') that is not
    there.
    """
    if told.instead == "time" and told.timed is not None:
        return {"kind": "time"} | _shown(told.timed.part)
    for one in told.statements:
        if one.question.about is About.REDUCED and has_valid_lagrangian(one):
            clock = {"clock": one.question.clock, "equations": one.part["equations"]}
            return {"kind": "reduced"} | clock | _shown(one.part)
    return None


def has_valid_lagrangian(one: Stated) -> bool:
    """Whether a statement has an L that the checker agrees with."""
    return bool(one.part.get("lagrangian")) and one.part.get("checked") == "valid"


def _shown(part: Mapping[str, Any]) -> dict[str, Any]:
    return {key: part[key] for key in SHOWN_INSTEAD}
