"""What a document says, as every door shows it: in the order, the names, and the numbers of its
author.

A line is an equation as written, or L and a constraint, read and printed again; below them are the
definitions and values of the names that occur in them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from api_schemas import result as schemas
from api_schemas.system import (
    LagrangianDocument,
    MotionDocument,
    NonholonomicDocument,
    SystemDocument,
)
from inverse_service import errors
from inverse_service.expressions import printing, tree as ex
from inverse_service.mechanics import second_order_system
from inverse_service.reading import document_names, reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting
from inverse_service.service.documents.accepting import Asking

LONGEST = 4_000  # characters of a document whose lines are shown as they were written
_Line = tuple[ex.Expression, ex.Expression]


def lines_of(schema: Asking | LagrangianDocument) -> list[schemas.Formula]:
    """The lines of a document; none for first-order pairs, which are joined, for long documents,
    and for what cannot be shown so.
    """
    plain = schema.model_dump(mode="json", exclude_unset=True)
    if sum(map(len, accepting.typed_texts(plain))) > LONGEST:
        return []
    try:
        lines, known = _read(schema)
    except errors.InputError:
        return []
    if known is None:
        return []
    lines += _meanings(lines, known)
    with _as_typed(plain):
        return [_shown(*line) for line in lines]


def lines_of_stored(system: Mapping[str, Any], names: Names) -> list[str]:
    """The texts of these lines for the system of an older result, which has no `written`."""
    given = (system.get("given") or {}).get("equations")
    solved = [reader.equation_line(*pair) for pair in system["equations"].items()]
    if not isinstance(given, str) or len(given) > LONGEST or "t" not in (system.get("time") or "t"):
        return solved
    try:
        pairs = reader.read_equations(given, names)
        with _as_typed(system["given"]):
            return [_shown(*pair).text for pair in pairs] or solved
    except errors.InputError:
        return solved


@contextmanager
def _as_typed(document: Mapping[str, Any]) -> Iterator[None]:
    """Numbers and sums printed as in the document."""
    with (
        printing.with_decimals(accepting.decimals_of_lines(document)),
        printing.in_given_order(),
    ):
        yield


def _read(
    schema: Asking | LagrangianDocument,
) -> tuple[list[_Line], document_names.Known | None]:
    from inverse_service.mechanics import constrained_motion

    declared = accepting.declared(schema)
    match schema:
        case SystemDocument(equations=equations):
            given = second_order_system.read_given(declared, equations)
            return [(left, right) for left, right, _ in given.typed], given.known
        case NonholonomicDocument(lagrangian=lagrangian, constraints=held):
            known, pairs = constrained_motion.read_typed(lagrangian, held, declared)
        case LagrangianDocument(lagrangian=lagrangian):
            known, pairs = constrained_motion.read_typed(lagrangian, [], declared)
        case MotionDocument():
            return [], None
    return [(ex.Symbol("L"), pairs[0][0]), *pairs[1:]], known


def _meanings(lines: Sequence[_Line], known: document_names.Known) -> list[_Line]:
    """The definitions and values of names that occur in the lines and in one another."""
    meanings = {
        name: tree for name, tree in known.definitions.items() if isinstance(name, ex.Symbol)
    } | {ex.Symbol(name): tree for name, tree in known.values.items()}
    found, new = list[_Line](), list(lines)
    while new:
        occurring = {node for line in new for side in line for node in ex.walk(side)}
        new = [(name, meanings.pop(name)) for name in [*meanings] if name in occurring]
        found += new
    return found


def _shown(left: ex.Expression, right: ex.Expression) -> schemas.Formula:
    text = f"{printing.to_text(left)} = {printing.to_text(right)}"
    return schemas.Formula(
        text=text, latex=f"{printing.to_latex(left)} = {printing.to_latex(right)}"
    )
