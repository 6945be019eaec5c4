"""What the service understood of a form, and its refusals with their places: made in workers, which read forms."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup, escape

from inverse_service import catalogue, errors
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import letters, printing_mathml
from inverse_service.expressions.tree import Acceleration, Symbol
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.jobs import model, tasks
from inverse_service.web.pages import forms, preview, sheets, typesetting

FIELD_NAMES = {
    "equations": "Equations", "lagrangian": "Lagrangian", "constraints": "Constraints", "coordinates": "Coordinates",
    "parameters": "Parameters", "functions": "Arbitrary functions", "associated": "Associated system",
    "ansatz": "Terms to try first", "options": "Time limit", "initial": "Start", "step": "Step", "steps": "Steps",
}  # fmt: skip
# Fields with a box for each name.
NAMED = ("parameters", "initial")
# Characters of a long line that are shown on either side of the place.
AROUND = 40
LONGEST_LABEL = 60
# What may stand between a formula and the sign after it and belongs to neither.
_AFTER_FORMULA = re.compile(r"(?:[\s&~$]|\\[,;:! \]]|\\(?:end|tag|label)\{[^}]*\}|\\(?:nonumber|notag)(?![a-z]))*$")
_LETTER = re.compile(rf"(?<![A-Za-z\\])(?:{'|'.join(sorted(letters.LETTER_COMMANDS, reverse=True))})(?![A-Za-z])")


@dataclass(frozen=True, slots=True)
class Line:
    """A typeset formula and what a screen reader calls it."""

    label: str
    math: Markup


@dataclass(frozen=True, slots=True)
class Understood:
    """Groups of formulas under headings, and rows of names with what they stand for."""

    groups: list[tuple[str, list[Line]]]
    names: list[tuple[str, Markup, str]]


@dataclass(frozen=True, slots=True)
class ShownPlace:
    """One fault: the line it stands in cut around the marked character, where the place is known.

    `choices` are texts that may have been meant, each with what a button for it sends.
    """

    detail: str
    field: str = ""
    line: int | None = None
    column: int | None = None
    before: str = ""
    marked: str = ""
    after: str = ""
    choices: tuple[tuple[str, str], ...] = ()
    pointer: str = ""


@dataclass(frozen=True, slots=True)
class Problem:
    """A refusal with its places."""

    title: str
    places: list[ShownPlace]


def understood(answer: Mapping[str, Any]) -> Understood:
    """The answer of /v1/parse, typeset; what was guessed is said."""
    groups = [("", _equations(answer))] if answer.get("equations") else []
    for key, heading in (("lagrangian", "Lagrangian"), ("constraints", "Constraints")):
        lines = _formulas(answer.get(key), heading)
        if lines:
            groups.insert(len(groups) - 1 if key == "lagrangian" else len(groups), (heading, lines))
    return Understood(_ordered(groups), _names(answer))


def _ordered(groups: list[tuple[str, list[Line]]]) -> list[tuple[str, list[Line]]]:
    order = {"Lagrangian": 0, "Constraints": 1, "": 2}
    found = sorted(groups, key=lambda group: order[group[0]])
    return [("Motion" if not heading and len(found) > 1 else heading, lines) for heading, lines in found]


def _equations(answer: Mapping[str, Any]) -> list[Line]:
    lines = []
    for coordinate, found in answer["equations"].items():
        left = printing_mathml.to_mathml(Acceleration(coordinate)).partition(">")[2].removesuffix("</math>")
        right = str(typesetting.spaced(found["mathml"])).partition(">")[2].removesuffix("</math>")
        solved = not reader.has_acceleration(found["text"])
        line = f"{left}<mo>=</mo>{right}" if solved else f"{right}<mo>=</mo><mn>0</mn>"
        lines.append(Line(reader.equation_line(coordinate, found["text"]), typesetting.math(f"<mrow>{line}</mrow>")))
    return lines


def _formulas(found: Any, heading: str) -> list[Line]:
    """A parsed formula or a list of them; constraints are zero."""
    if not found:
        return []
    formulas = found if isinstance(found, list) else [found]
    zero = "<mo>=</mo><mn>0</mn>" if heading == "Constraints" else ""
    lines = []
    for formula in formulas:
        inner = str(typesetting.spaced(formula["mathml"])).partition(">")[2].removesuffix("</math>")
        ending = " = 0" if zero else ""
        lines.append(Line(formula["text"] + ending, typesetting.math(f"<mrow>{inner}{zero}</mrow>")))
    return lines


def _names(answer: Mapping[str, Any]) -> list[tuple[str, Markup, str]]:
    rows = [("Coordinates", _symbols(answer["coordinates"]), "")]
    if answer["parameters"]:
        guessed = [name for name in answer["parameters"] if name in answer["guessed"]]
        one = len(answer["parameters"]) == 1
        note = "\u2013 a constant" if one else "\u2013 constants"
        if guessed:
            which = "" if len(guessed) == len(answer["parameters"]) else f": {', '.join(guessed)}"
            note += f"; not declared, so treated as constant{which}"
        rows.append(("Parameters", _symbols(answer["parameters"]), note))
    if answer["functions"]:
        names = Names(tuple(answer["coordinates"]), (), {k: tuple(v) for k, v in answer["functions"].items()})
        texts = [f"{name}({', '.join(arguments)})" for name, arguments in answer["functions"].items()]
        rows.append(("Functions", Markup(", ").join(typesetting.formula(text, names) for text in texts), "arbitrary"))
    if read := [f"{note['text']} as {note['as']}" for note in answer.get("readings", ())]:
        rows.append(("Read", escape(", ".join(read)), ""))
    if answer.get("depends_on_time"):
        rows.append(("Time", _symbols(["t"]), "occurs in the equations"))
    return rows


def _symbols(names: list[str]) -> Markup:
    return Markup(", ").join(Markup(printing_mathml.to_mathml(Symbol(name))) for name in names)


def problem_of(body: Mapping[str, Any], fields: Mapping[str, str]) -> Problem:
    """A problem document of the service."""
    places = [_place(_fault(p), fields) for p in body.get("errors", [])]
    return Problem("There is a problem with your input", places or [ShownPlace(body["detail"])])


def problem_of_error(error: errors.InputError, fields: Mapping[str, str]) -> Problem:
    """A fault found while the form was read."""
    return Problem("There is a problem with your input", [_place(place, fields) for place in error.places])


def sentence(place: errors.Place, fields: Collection[str] = (), is_marked: bool = False) -> str:
    """What is wrong, for a form with these fields, which may be fewer than the members of a document.

    The column is said where it is not marked.
    """
    said = place.plain or place.detail
    if place.plain and place.column is not None and not is_marked:
        said = f"At column {place.column}: {said}"
    if place.declare and place.declare in fields:
        where = f"\u201c{FIELD_NAMES[place.declare]}\u201d, in \u201cAsk in detail\u201d"
        said += f" A name can be declared in {where}."
    return said[:1].upper() + said[1:] if said.startswith(("the ", "a ", "an ", "this ", "what ", "where ")) else said


def _fault(place: Mapping[str, Any]) -> errors.Place:
    span, instead = place.get("span"), tuple(place["instead"])
    parts = place.get("plain") or "", place.get("declare") or ""
    return errors.Place(
        place["detail"], place["pointer"], place["column"], "", instead, (span[0], span[1]) if span else None, *parts
    )


def _place(error: errors.Place, fields: Mapping[str, str]) -> ShownPlace:
    column = error.column
    steps = error.pointer.split("/")[1:]
    field = steps[0] if steps else ""
    name = ", ".join([FIELD_NAMES.get(field, field), *(steps[-1:] if field in NAMED and len(steps) > 1 else ())])
    text = _text_at(steps, fields)
    if column is None or text is None or column > len(text) + 1:
        return ShownPlace(sentence(error, fields), name, pointer=error.pointer)
    start = text.rfind("\n", 0, column - 1) + 1
    end = text.find("\n", start)
    line = text[start : end if end >= 0 else len(text)]
    place = column - 1 - start
    marked = line[place : place + 1] or " "
    before, after = line[:place], line[place + 1 :]
    if len(before) > AROUND:
        before = "\u2026" + before[-AROUND:]
    if len(after) > AROUND:
        after = after[:AROUND] + "\u2026"
    number = text.count("\n", 0, start) + 1 + _lines_before(steps)
    choices = _choices(error, text, start, line, f"{field}:{number}")
    detail = sentence(error, fields, is_marked=True)
    return ShownPlace(detail, name, number, place + 1, before, marked, after, choices)


def _choices(error: errors.Place, text: str, start: int, line: str, at: str) -> tuple[tuple[str, str], ...]:
    """The readings of what stands at the place of an error, each as the line that it makes and what a button sends.

    Those of a name end with one that declares it a constant. In LaTeX a reading is written as LaTeX.
    """
    first, last = (one - 1 for one in error.span) if error.span else ((error.column or 1) - 1,) * 2
    piece = _AFTER_FORMULA.sub("", text[first:last]) if error.span else _word_at(text, first)
    readings = dict.fromkeys(_as_latex(one) if "\\" in text else one for one in error.instead)
    if piece == "[":  # it is closed by its own kind
        readings = {f"{one.removesuffix('(')}[" if one.endswith("(") else one: None for one in readings}
    if text[:first][-1:].isalnum():
        readings = {f"{' ' * one[:1].isalnum()}{one}": None for one in readings}
    if not piece or "\n" in piece or piece.count("{") != piece.count("}"):
        return ()
    place = first - start
    until = f"+{len(piece)}" if error.span else ""
    whole = {one: f"{line[:place]}{one}{line[place + len(piece) :]}" for one in readings}
    found = [
        (made if len(made) <= LONGEST_LABEL else one, f"{at}:{place + 1}{until}:{one}") for one, made in whole.items()
    ]
    is_name = found and not error.span and text[first + len(piece) :][:1] not in letters.PRIMES and "\\" not in piece
    return (*found, *([(f"a constant {piece}", f"parameters:0:0:{piece}")] if is_name else []))


def _word_at(text: str, place: int) -> str:
    word = re.compile(r"\\?\w+").match(text, place)
    return word.group() if word else ""


def _as_latex(reading: str) -> str:
    return _LETTER.sub(r"\\\g<0>", reading)


def _text_at(steps: list[str], fields: Mapping[str, str]) -> str | None:
    """The typed text that a pointer means, None where it was not typed as such."""
    if steps == ["equations"] or steps == ["lagrangian"]:
        return fields.get(steps[0])
    if len(steps) == 2 and steps[0] == "constraints" and steps[1].isdigit():
        lines = [line.strip() for line in fields.get("constraints", "").replace(";", "\n").split("\n") if line.strip()]
        return lines[int(steps[1])] if int(steps[1]) < len(lines) else None
    return None


def _lines_before(steps: list[str]) -> int:
    return int(steps[1]) if len(steps) == 2 and steps[0] == "constraints" else 0


Fields = dict[str, str]
# How long a person waits for an answer next to a form that they are still filling in, s.
GLANCE = 1.5


@dataclass(frozen=True, slots=True)
class Sent:
    """The solve form as it was sent: its document, or why there is none. `shown` are the fields of that document."""

    fields: Fields
    shown: Fields
    document: dict[str, Any] | None = None
    problem: Problem | None = None


def glance_task(body: bytes, content_type: str) -> dict[str, Any] | None:
    """The sent solve form to a short answer, which nobody stores; None where it takes longer than a glance."""
    document = sent_task(body, content_type).document
    return None if document is None else glance_of(document)


def glance_of_fields(fields: Fields) -> dict[str, Any] | None:
    """The same of the fields of a link; None where they cannot be read, too."""
    try:
        return glance_of(forms.document_of_fields(fields))
    except errors.InputError:
        return None


def glance_of(document: Mapping[str, Any]) -> dict[str, Any] | None:
    """The sheet of a document without its proofs, and its motion; None where nothing was settled."""
    found = tasks.solve_task(model.split_options(document)[0], SolveOptions(time_limit=GLANCE))
    sheet = sheets.sheet_of(found, brief=True)
    return None if sheet.verdict == sheets.OPEN else {"sheet": sheet, "motion": preview.motion_of_result(found)}


def sent_task(body: bytes, content_type: str) -> Sent:
    """The sent solve form to what it says."""
    form = forms.form_of(body, content_type)
    fields, example = forms.fields_of(form), form.text("example")
    try:
        document = _example(example) if example else forms.document_of(form)
    except errors.InputError as error:
        return Sent(fields, fields, problem=problem_of_error(error, fields))
    is_shown = example or "document" in form.files
    return Sent(fields, forms.fields_from(document) if is_shown else fields, document)


def _example(name: str) -> dict[str, Any]:
    try:
        return catalogue.document(name)
    except errors.InputError:
        raise errors.InputError("The catalogue has no system of this name; /atlas shows them.") from None


def echo_sent_task(body: bytes, content_type: str) -> tuple[Fields, dict[str, Any]]:
    """The sent solve form to its fields and how it is understood."""
    sent = sent_task(body, content_type)
    if sent.document is None:
        return sent.fields, {"problem": sent.problem}
    return sent.fields, _understood(sent.fields, sent.document)


def echo_task(fields: Fields) -> dict[str, Any]:
    """The fields of the solve form to how they are understood."""
    try:
        document = forms.document_of(forms.Form({name: (value,) for name, value in fields.items()}))
    except errors.InputError as error:
        return {"problem": problem_of_error(error, fields)}
    return _understood(fields, document)


def _understood(fields: Fields, document: Mapping[str, Any]) -> dict[str, Any]:
    """What /v1/parse says of a document, for the template."""
    typed = any(fields[name] for name in ("equations", "lagrangian", "constraints"))
    if not (typed or document):
        return {}
    from inverse_service.service.documents.documents import parse_document

    try:
        answer = parse_document(model.split_options(document)[0])
    except errors.InputError as error:
        return {"problem": problem_of_error(error, fields)} if typed else {}
    return {"understood": understood(answer)}
