"""What the service understood, and its refusals with their places, as a page shows them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.printing_mathml import to_mathml
from inverse_service.expressions.reader import equation_line
from inverse_service.expressions.tokens import LETTER_COMMANDS, PRIMES
from inverse_service.expressions.tree import Acceleration, Symbol
from inverse_service.web.pages import typesetting

FIELD_NAMES = {
    "equations": "Equations", "lagrangian": "Lagrangian", "constraints": "Constraints", "coordinates": "Coordinates",
    "parameters": "Parameters", "functions": "Arbitrary functions", "associated": "Associated system",
    "ansatz": "Terms to try first", "options": "Time limit", "initial": "Start", "step": "Step", "steps": "Steps",
}  # fmt: skip
# Fields with a box for each name.
NAMED = ("parameters", "initial")
MOTION = "Motion, the same for every associated system"
# Characters of a long line that are shown on either side of the place.
AROUND = 40
LONGEST_LABEL = 60
FORM_NAMES = {"coordinates": "Coordinates", "parameters": "Parameters", "functions": "Arbitrary functions"}
_KEY = re.compile(f'"({"|".join(FORM_NAMES)})"')
_DECLARING = re.compile(
    r"(?:a (?:constant|coordinate)(?: of this name)?\? |else |, or |or )?(?:add it to|declare it in) "
    r'"(?:coordinates|parameters|functions)"(?: with its arguments)?(?:[,;] )?'
)
_COLUMN = re.compile(r"(; it occurs)? at column \d+")
# What may stand between a formula and the sign after it and belongs to neither.
_AFTER_FORMULA = re.compile(r"(?:[\s&~$]|\\[,;:! \]]|\\(?:end|tag|label)\{[^}]*\}|\\(?:nonumber|notag)(?![a-z]))*$")
_LETTER = re.compile(rf"(?<![A-Za-z\\])(?:{'|'.join(sorted(LETTER_COMMANDS, reverse=True))})(?![A-Za-z])")


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


@dataclass(frozen=True, slots=True)
class Problem:
    """A refusal with its places."""

    title: str
    places: list[ShownPlace]


def understood(answer: Mapping[str, Any], associated: Mapping[str, Any] | None = None) -> Understood:
    """The answer of /v1/parse, typeset, with the associated system that is asked about; what was guessed is said."""
    groups = [("", _equations(answer))] if answer.get("equations") else []
    for key, heading in (("lagrangian", "Lagrangian"), ("constraints", "Constraints")):
        lines = _formulas(answer.get(key), heading)
        if lines:
            groups.insert(len(groups) - 1 if key == "lagrangian" else len(groups), (heading, lines))
    shown, names = _ordered(groups), _names(answer)
    if associated and associated["equations"]:
        shown.append((f"The {associated['kind']} associated system, which is decided", _equations(associated)))
    elif associated:
        names.append((f"The {associated['kind']} associated system", Markup(), associated["explanation"]))
    return Understood(shown, names)


def _ordered(groups: list[tuple[str, list[Line]]]) -> list[tuple[str, list[Line]]]:
    order = {"Lagrangian": 0, "Constraints": 1, "": 2}
    found = sorted(groups, key=lambda group: order[group[0]])
    return [(MOTION if not heading and len(found) > 1 else heading, lines) for heading, lines in found]


def _equations(answer: Mapping[str, Any]) -> list[Line]:
    lines = []
    for coordinate, found in answer["equations"].items():
        left = to_mathml(Acceleration(coordinate)).partition(">")[2].removesuffix("</math>")
        right = str(typesetting.parsed(found["mathml"])).partition(">")[2].removesuffix("</math>")
        solved = "''" not in found["text"]
        line = f"{left}<mo>=</mo>{right}" if solved else f"{right}<mo>=</mo><mn>0</mn>"
        lines.append(Line(equation_line(coordinate, found["text"]), typesetting.math(f"<mrow>{line}</mrow>")))
    return lines


def _formulas(found: Any, heading: str) -> list[Line]:
    """A parsed formula or a list of them; constraints are zero."""
    if not found:
        return []
    formulas = found if isinstance(found, list) else [found]
    zero = "<mo>=</mo><mn>0</mn>" if heading == "Constraints" else ""
    lines = []
    for formula in formulas:
        inner = str(typesetting.parsed(formula["mathml"])).partition(">")[2].removesuffix("</math>")
        ending = " = 0" if zero else ""
        lines.append(Line(formula["text"] + ending, typesetting.math(f"<mrow>{inner}{zero}</mrow>")))
    return lines


def _names(answer: Mapping[str, Any]) -> list[tuple[str, Markup, str]]:
    rows = [("Coordinates", _symbols(answer["coordinates"]), "")]
    if answer["parameters"]:
        guessed = [name for name in answer["parameters"] if name in answer["guessed"]]
        one = len(answer["parameters"]) == 1
        note = "\u2013 a constant of any value" if one else "\u2013 constants of any value"
        if guessed:
            which = "" if len(guessed) == len(answer["parameters"]) else f": {', '.join(guessed)}"
            note += f"; not declared, taken as constant{which}"
        rows.append(("Parameters", _symbols(answer["parameters"]), note))
    if answer["functions"]:
        names = Names(tuple(answer["coordinates"]), (), {k: tuple(v) for k, v in answer["functions"].items()})
        texts = [f"{name}({', '.join(arguments)})" for name, arguments in answer["functions"].items()]
        rows.append(("Functions", Markup(", ").join(typesetting.formula(text, names) for text in texts), "arbitrary"))
    if answer.get("depends_on_time"):
        rows.append(("Time", _symbols(["t"]), "occurs in the equations"))
    return rows


def _symbols(names: list[str]) -> Markup:
    return Markup(", ").join(Markup(to_mathml(Symbol(name))) for name in names)


def problem_of(body: Mapping[str, Any], fields: Mapping[str, str]) -> Problem:
    """A problem document of the service."""
    places = [_place(_error(p), fields) for p in body.get("errors", [])]
    return Problem("Please change this:", places or [ShownPlace(body["detail"])])


def problem_of_error(error: InputError, fields: Mapping[str, str]) -> Problem:
    """A fault found while the form was read."""
    found = (InputError(p.detail, p.pointer, p.column, p.instead, p.span) for p in error.places)
    return Problem("Please change this:", [_place(fault, fields) for fault in found])


def _error(place: Mapping[str, Any]) -> InputError:
    span = place.get("span")
    return InputError(
        place["detail"],
        place["pointer"],
        place["column"],
        tuple(place["instead"]),
        (span[0], span[1]) if span else None,
    )


def _place(error: InputError, fields: Mapping[str, str]) -> ShownPlace:
    detail, pointer, column = error.detail, error.pointer, error.column
    steps = pointer.split("/")[1:]
    field = steps[0] if steps else ""
    name = ", ".join([FIELD_NAMES.get(field, field), *(steps[-1:] if field in NAMED and len(steps) > 1 else ())])
    text = _text_at(steps, fields)
    detail = re.sub("^time_limit", "It", detail)  # the box before the sentence names it
    detail = _KEY.sub(_field_of_the_form, detail) if fields else without_keys(detail)
    if detail.startswith(("the ", "a ", "an ", "this ", "what ", "where ")):
        detail = detail[:1].upper() + detail[1:]
    if column is None or text is None or column > len(text) + 1:
        return ShownPlace(detail, name)
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
    # The column in the sentence counts from the start of the whole text; the place is shown by its line.
    detail = _COLUMN.sub("", detail, count=1)
    choices = _choices(error, text, start, line, f"{field}:{number}")
    return ShownPlace(detail, name, number, place + 1, before, marked, after, choices)


def _field_of_the_form(key: re.Match[str]) -> str:
    return f"\u201c{FORM_NAMES[key[1]]}\u201d under \u201cNames and questions\u201d"


def without_keys(detail: str) -> str:
    """The sentence for a form that declares nothing."""
    found = re.sub(r"[\s;:,]+\.$", ".", _DECLARING.sub("", detail))
    return found.replace("?.", "?")


def _choices(error: InputError, text: str, start: int, line: str, at: str) -> tuple[tuple[str, str], ...]:
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
    is_name = found and not error.span and text[first + len(piece) :][:1] not in PRIMES and "\\" not in piece
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
