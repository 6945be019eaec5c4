"""From the fields of a form to a document and back, how a document was understood, and the places of a refusal."""

import email
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple
from urllib.parse import parse_qs, parse_qsl, urlencode

from markupsafe import Markup

from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service import errors
from inverse_service.expressions import letters, notation
from inverse_service.reading import declarations, document_names, reader
from inverse_service.service.documents import plain_data, sheets, stated
from inverse_service.service.jobs import model, tasks
from inverse_service.web.pages import WORDS, typesetting
from inverse_service.web.problems import Refusal

MAX_FIELDS = 120
KINDS = ("equations", "nonholonomic")
ASSOCIATED = ("first", "second", "third", "any")
FIELDS = ("kind", "name", "equations", "lagrangian", "constraints", "coordinates", "parameters", "functions",
          "associated", "time", "family", "ansatz", "kinds", "clock", "nearest",
          "time_limit")  # fmt: skip
TYPED = ("equations", "lagrangian", "constraints")
# What a link may say; `kind` is the form's own.
LINKED = FIELDS[1:]
# What can only be chosen on the form, not typed.
CHOSEN: dict[str, tuple[str, ...]] = {
    "associated": ASSOCIATED, "time": ("no", "yes"), "family": ("yes",), "kinds": tuple(KINDS_OF_LAGRANGIANS),
}  # fmt: skip
LONGEST_LINK = 6_000
TIME = {"no": False, "yes": True}
_CHOICE = re.compile(
    r"(equations|lagrangian|constraints|parameters|functions):(\d{1,4}):(\d{1,5})(?:\+(\d{1,5}))?:(.{1,200})"
)
_CONSTRAINT = re.compile(r"[^\s;][^\n;]*")
_WORD = re.compile(r"(?:\\?\w+)?")
# Words of sentences, which are no names of a formula
_FIRST_WORDS = (
    "the",
    "a",
    "an",
    "this",
    "these",
    "what",
    "where",
    "there",
    "no",
    "every",
    "another",
)
_IDENTIFIER = re.compile(r"^\\?\w+")
_LEFT_SIDE = re.compile(r"\s*(?:L|\\mathcal ?(?:L|\{L\}))\s*=(?!=)")
FIELD_NAMES: dict[str, str] = WORDS["fields"]
# Fields with a box for each name.
NAMED = ("parameters", "initial")
# Characters of a long line that are shown on either side of the place.
AROUND = 40
LONGEST_LABEL = 60
# What may stand between a formula and the sign after it and belongs to neither.
_AFTER_FORMULA = re.compile(
    r"(?:[\s&~$]|\\[,;:! \]]|\\(?:end|tag|label)\{[^}]*\}|\\(?:nonumber|notag)(?![a-z]))*$"
)
_LETTER = re.compile(
    rf"(?<![A-Za-z\\])(?:{'|'.join(sorted(letters.LETTER_COMMANDS, reverse=True))})(?![A-Za-z])"
)
Fields = dict[str, str]


@dataclass(frozen=True, slots=True)
class Upload:
    """An uploaded file."""

    name: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Form:
    """Fields with all their values, and files that were chosen."""

    fields: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    files: Mapping[str, Upload] = field(default_factory=dict)

    def text(self, name: str) -> str:
        """The first value of a field with line ends as \\n, or nothing."""
        return self.typed(name).lstrip()

    def typed(self, name: str) -> str:
        """The same in the lines and columns in which it was typed."""
        values = self.fields.get(name, ())
        return values[0].replace("\r\n", "\n").rstrip() if values else ""

    def every(self, name: str) -> tuple[str, ...]:
        """All values of a field: the ticked boxes of one name."""
        return self.fields.get(name, ())


def form_of(body: bytes, content_type: str) -> Form:
    """The sent form; raises InputError for what no browser sends."""
    if content_type.lower().startswith("multipart/form-data"):
        return _multipart(body, content_type)
    return _urlencoded(body)


def _urlencoded(body: bytes) -> Form:
    try:
        found = parse_qs(
            body.decode("ascii"), max_num_fields=MAX_FIELDS, errors="strict", keep_blank_values=True
        )
    except ValueError:
        raise unreadable() from None
    return Form({name: tuple(values) for name, values in found.items()})


def _multipart(body: bytes, content_type: str) -> Form:
    message = email.message_from_bytes(
        b"Content-Type: " + content_type.encode("latin-1") + b"\r\n\r\n" + body
    )
    parts: Any = message.get_payload()
    if not isinstance(parts, list) or len(parts) > MAX_FIELDS or message.defects:
        raise unreadable()
    fields: dict[str, tuple[str, ...]] = {}
    files: dict[str, Upload] = {}
    for part in parts:
        key = part.get_param("name", None, "content-disposition")
        data = part.get_payload(decode=True)
        if not isinstance(key, str) or not isinstance(data, bytes):
            raise unreadable()
        file_name = part.get_filename()
        try:
            if file_name is None:
                fields[key] = (*fields.get(key, ()), data.decode())
            elif file_name or data:
                files[key] = Upload(file_name, data)
        except UnicodeDecodeError:
            raise unreadable() from None
    return Form(fields, files)


def unreadable() -> errors.InputError:
    """The body is no form."""
    detail = "The form was not sent as a browser sends it."
    return errors.DocumentRefused((errors.Place(detail, code=tasks.UNREADABLE),))


def fields_of(form: Form) -> dict[str, str]:
    """The fields of the solve form as texts."""
    found = {name: form.text(name) for name in FIELDS} | {"kinds": " ".join(form.every("kinds"))}
    found |= {name: form.typed(name) for name in TYPED}
    if found["kind"] not in KINDS:
        found["kind"] = (
            "nonholonomic" if found["lagrangian"] and not found["equations"] else "equations"
        )
    return _with_choice(found, form.text("instead"))


def _with_choice(fields: dict[str, str], choice: str) -> dict[str, str]:
    """The fields with the reading that was chosen: "equations:2:9:k*x" puts k*x for the name at
    line 2, column 9; "equations:2:9+4:k/(m*x)" puts it for the four characters there.

    "parameters:0:0:kx" declares kx, and "functions:0:0:k(u)" a function k.
    """
    match = _CHOICE.fullmatch(choice)
    if match is None:
        return fields
    name, line, column, text = match[1], int(match[2]), int(match[3]), match[5]
    if name in ("parameters", "functions"):
        return fields | {name: ", ".join(part for part in (fields[name], text) if part)}
    lines = fields[name].split("\n")
    if not 0 < line <= len(lines):
        return fields
    before, rest = lines[line - 1][: column - 1], lines[line - 1][column - 1 :]
    lines[line - 1] = (
        before + text + (rest[int(match[4]) :] if match[4] else _IDENTIFIER.sub("", rest, count=1))
    )
    return fields | {name: "\n".join(lines)}


def document_of(form: Form) -> dict[str, Any]:
    """The document that a form describes: an uploaded one, a pasted one, or its fields.

    Raises InputError where a document or a list of names cannot be read.
    """
    upload = form.files.get("document")
    if upload is not None:
        return _as_object(plain_data.read_document(upload.data, upload.name))
    fields = fields_of(form)
    equations = fields["equations"].lstrip()
    if fields["kind"] == "equations" and equations.startswith("{") and '"' in equations:
        return _as_object(plain_data.read_json(equations))
    return document_of_fields(fields)


def _as_object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise errors.InputError(
            "The document is not an object; it must have coordinates and equations."
        )
    return value


def document_of_fields(fields: Mapping[str, str]) -> dict[str, Any]:
    """The document; names that were not declared are guessed where it is read."""
    plain_data.refuse_surrogates(dict(fields))
    nonholonomic = fields["kind"] == "nonholonomic"
    constraints = [text.rstrip() for text in _CONSTRAINT.findall(fields["constraints"])]
    document: dict[str, Any] = {"name": fields["name"]} if fields["name"] else {}
    if coordinates := declarations.words_of(fields["coordinates"]):
        document["coordinates"] = coordinates
    if nonholonomic:
        document["lagrangian"] = right_side(fields["lagrangian"].lstrip())
        # Without constraints there are no associated systems, though one of them is always ticked
        # on the form.
        if constraints:
            document["constraints"] = constraints
            document |= (
                {"associated": fields["associated"]} if fields["associated"] in ASSOCIATED else {}
            )
    else:
        document["equations"] = fields["equations"].lstrip()
        document |= {"kinds": kinds} if (kinds := declarations.words_of(fields["kinds"])) else {}
        document |= {"clock": fields["clock"]} if fields["clock"] else {}
        document |= {"nearest": _nearest(fields["nearest"])} if fields["nearest"] else {}
    return document | _declared(fields) | _questions(fields)


def right_side(lagrangian: str) -> str:
    """What `L = ...` says L is, with blanks for the left side so that places stay."""
    found = _LEFT_SIDE.match(lagrangian)
    return " " * found.end() + lagrangian[found.end() :] if found else lagrangian


def _declared(fields: Mapping[str, str]) -> dict[str, Any]:
    parameters = declarations.parameters_of(fields["parameters"])
    functions = declarations.functions_of(fields["functions"])
    named = parameters if any(parameters.values()) else [*parameters]
    return declarations.with_guess({"parameters": named}) | (
        {"functions": functions} if functions else {}
    )


def _questions(fields: Mapping[str, str]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if fields["time"] in TIME:
        found["time_dependent_lagrangian"] = TIME[fields["time"]]
    if fields["family"]:
        found["family"] = True
    if terms := [
        term.strip()
        for _, term in notation.split_outside(fields["ansatz"], "[,;\n]")
        if term.strip()
    ]:
        found["ansatz"] = terms
    if fields["time_limit"]:
        found["options"] = {"time_limit": _seconds(fields["time_limit"])}
    return found


def _nearest(text: str) -> bool | dict[str, Any]:
    """How far it is to the nearest system with a Lagrangian: "relative", one error, or a = 0.02, b = 0.01."""
    if text.lower() in ("relative", "yes"):
        return True
    if "=" not in text:
        return {"errors": text}
    pairs = (part.rpartition("=") for part in re.split(r"[,;\n]", text) if part.strip())
    return {"errors": {name.strip(): value.strip() for name, _, value in pairs}}


def _nearest_text(question: Any) -> str:
    """The field of the form; what only a document can ask is left out."""
    if not question:
        return ""
    measure = question.get("errors") if isinstance(question, Mapping) else None
    if isinstance(measure, Mapping):
        return ", ".join(f"{name} = {value}" for name, value in measure.items())
    return "relative" if measure is None or isinstance(measure, list) else str(measure)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise errors.InputError(
            "The time limit must be a number of seconds such as 30.", "/options/time_limit"
        )
    return seconds


def fields_from(document: Mapping[str, Any]) -> dict[str, str]:
    """The form filled with a document."""
    fields = dict.fromkeys(FIELDS, "")
    fields |= {"kind": "equations", "name": str(document.get("name", ""))}
    fields["coordinates"] = ", ".join(document.get("coordinates") or ())
    parameters = declarations.Declared(
        parameters=document.get("parameters") or ()
    ).named_parameters()
    pairs = (
        parameters.items()
        if isinstance(parameters, Mapping)
        else ((name, None) for name in parameters)
    )
    fields["parameters"] = ", ".join(
        name if value is None else f"{name} = {value}" for name, value in pairs
    )
    functions = document.get("functions") or {}
    fields["functions"] = ", ".join(
        f"{name}({', '.join(arguments)})" for name, arguments in functions.items()
    )
    fields["time"] = {False: "no", True: "yes"}.get(document.get("time_dependent_lagrangian"), "")  # type: ignore[arg-type]
    fields["family"] = "yes" if document.get("family") else ""
    fields["ansatz"] = ", ".join(document.get("ansatz") or ())
    # The form has no choice for a kind with names, such as {"invariant": ["x"]}.
    kinds = [kind for kind in document.get("kinds") or () if isinstance(kind, str)]
    fields["kinds"] = " ".join(kind for kind in kinds if kind in KINDS_OF_LAGRANGIANS)
    fields["clock"] = str(document.get("clock") or "")
    fields["nearest"] = _nearest_text(document.get("nearest"))
    limit = (document.get("options") or {}).get("time_limit")
    fields["time_limit"] = (
        "" if limit is None else f"{limit:g}" if isinstance(limit, int | float) else str(limit)
    )
    if "lagrangian" in document:
        constraints = document.get("constraints", [])
        fields |= {"kind": "nonholonomic", "lagrangian": str(document["lagrangian"])}
        fields["constraints"] = (
            constraints if isinstance(constraints, str) else "\n".join(constraints)
        )
        fields["associated"] = str(document.get("associated") or "")
    else:
        fields["equations"] = equations_text(document.get("equations", ""))
    return fields


def question_address(document: Mapping[str, Any]) -> str:
    """The link that fills the form with this question without asking it; empty if it would be too long."""
    address = link_of_fields(lean_fields(document))
    return address if len(address) <= LONGEST_LINK else ""


def link_of_fields(fields: Mapping[str, str], **further: str) -> str:
    """The link that fills the form with these fields."""
    wanted = {name: value for name, value in fields.items() if value and name in LINKED}
    return f"/?{urlencode(wanted | further)}"


def is_whole(fields: Mapping[str, str]) -> bool:
    """Whether a link fills the form with all that these fields say."""
    link = link_of_fields(fields)
    return (
        len(link) <= LONGEST_LINK
        and fields_of_link(dict(parse_qsl(link.partition("?")[2]))) == fields
    )


def fields_of_link(query: Mapping[str, str]) -> dict[str, str] | None:
    """The fields of a link with a question; None if it has no question."""
    if not (query.get("equations") or query.get("lagrangian")):
        return None
    fields = dict.fromkeys(FIELDS, "") | {name: query.get(name, "") for name in LINKED}
    for name, allowed in CHOSEN.items():
        fields[name] = " ".join(
            value for value in declarations.words_of(fields[name]) if value in allowed
        )
    return fields | {"kind": "equations" if fields["equations"] else "nonholonomic"}


def left_out_of_link(query: Mapping[str, str]) -> list[str]:
    """A sentence for each value in a link that the form has no choice for."""
    return [
        f"The link sets {name}={value}, which is not valid and was ignored. Valid values: {', '.join(allowed)}."
        for name, allowed in CHOSEN.items()
        for value in declarations.words_of(query.get(name, ""))
        if value not in allowed
    ]


def lean_fields(document: Mapping[str, Any]) -> dict[str, str]:
    """The form filled with a document, names left out where they would be guessed: then the text can be changed."""
    fields = fields_from(document)
    lean = fields | dict.fromkeys(("coordinates", "parameters", "functions"), "")
    try:
        same = _names_of(document_of_fields(lean)) == _names_of(document)
    except errors.InputError:
        return fields
    return lean if same else fields


def _names_of(document: Mapping[str, Any]) -> tuple[Any, ...]:
    """The coordinates in their order, the parameters in any, and the functions of a document."""
    parts = [
        document.get("equations") or document.get("lagrangian") or "",
        document.get("constraints") or (),
    ]
    texts = [text for part in parts for text in _texts_in(part)]
    keys = tuple(parts[0]) if isinstance(parts[0], dict) else ()
    parameters, functions = document.get("parameters") or (), document.get("functions") or {}
    declared = declarations.Declared(document.get("coordinates"), parameters, functions)
    by_pointer = {f"/{place}": text for place, text in enumerate(texts)}
    names = document_names.document_names(
        declared, by_pointer, 1 if "lagrangian" in document else 2, keys
    )
    values = declared.named_parameters()
    return (
        names.coordinates,
        sorted(names.parameters),
        dict(names.functions),
        dict(values) if isinstance(values, Mapping) else {},
    )


def _texts_in(part: Any) -> list[str]:
    return (
        [part]
        if isinstance(part, str)
        else [str(text) for text in (part.values() if isinstance(part, dict) else part)]
    )


def equations_text(equations: Any) -> str:
    """Equations of any form as the lines of the text box."""
    if isinstance(equations, dict):
        return "\n".join(f"{coordinate}'' = {f}" for coordinate, f in equations.items())
    if isinstance(equations, Sequence) and not isinstance(equations, str):
        return "\n".join(str(line) for line in equations)
    return str(equations)


# What was understood, and what was not.


@dataclass(frozen=True, slots=True)
class Understood:
    """Groups of formulas under headings, each with the text that a screen reader says, and the
    meaning of the names.

    `readings` are what was read otherwise than it was typed: the text, its meaning, and words and
    value of a button.
    """

    groups: list[tuple[str, list[tuple[str, Markup]]]]
    names: list[Markup]
    readings: list[tuple[str, str, str, str]]


@dataclass(frozen=True, slots=True)
class ShownPlace:
    """One error; if its place is known, the line that contains it, cut around the marked character,
    `at` a field.

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
    at: str = ""


# A refusal with its places.
Problem = list[ShownPlace]


def understood(answer: Mapping[str, Any], fields: Mapping[str, str], time: str = "t") -> Understood:
    """The answer of /v1/parse about the document of a form with this time, typeset, with the guessed names."""
    names = stated.names_of({**answer, "time": time})
    lagrangian, equations = answer.get("lagrangian"), (answer.get("equations") or {}).items()
    groups = (
        ("Lagrangian", [lagrangian["text"]] if lagrangian else []),
        ("Constraints", [f"{one['text']} = 0" for one in answer.get("constraints") or ()]),
        (
            "Motion" if lagrangian else "",
            [reader.equation_line(name, found["text"]) for name, found in equations],
        ),
    )
    timed = (
        [Markup("containing {}").format(typesetting.formula(time, names))]
        if answer.get("depends_on_time")
        else []
    )
    return Understood(
        [
            (words, [(one, typesetting.formula(one, names)) for one in lines])
            for words, lines in groups
            if lines
        ],
        [*map(typesetting.said, sheets.meanings(answer)), *timed],
        [(one["text"], *_offered(one, fields)) for one in answer.get("readings", ())],
    )


class Offered(NamedTuple):
    """What a text was taken to mean, and a button for the other meaning."""

    meaning: str
    words: str
    sent: str


_GREEK = {
    name: [sign for sign, of in letters.GREEK.items() if of == name]
    for name in sorted({*letters.GREEK.values()}, key=len, reverse=True)
}
_PARTS = re.compile(rf"{'|'.join(_GREEK)}|\^[0-9]|\S")
_RAISED = {"^2": "\u00b2", "^3": "\u00b3", "^4": "\u2074"}


def _as_typed(text: str) -> re.Pattern[str]:
    """The text in any of the ways of typing it: with blanks, theta as a letter or a command, and ^2 as a sign."""
    found = []
    for part in _PARTS.findall(text):
        others = _GREEK.get(part, [_RAISED[part]] if part in _RAISED else [])
        ways = [re.escape(one) for one in (part, *others)]
        ways += [re.escape(f"\\{part}")] if part in _GREEK else []
        found.append(f"(?:{'|'.join(ways)})" if others else ways[0])
    return re.compile(r"\s*".join(found))


def _offered(reading: Mapping[str, str], fields: Mapping[str, str]) -> Offered:
    """What a text was taken to mean, and a button for the other meaning: its words and what it sends, empty without."""
    text, meant, other = reading["text"], reading["as"], reading.get("not", "")
    meaning = reading.get("meaning", meant)
    if function := reading.get("function"):
        return Offered(meaning, f"{function} is a function", f"functions:0:0:{function}(u)")
    if constant := reading.get("constant"):
        return Offered(meaning, f"{text} is one name", f"parameters:0:0:{constant}")
    written = _as_typed(text)
    for name in TYPED if other else ():
        for number, line in enumerate(fields.get(name, "").split("\n"), 1):
            if found := written.search(line):
                span = f"{found.start() + 1}+{found.end() - found.start()}"
                return Offered(meaning, f"{text} is {other}", f"{name}:{number}:{span}:{other}")
    return Offered(meant, f"{text} is one name", _as_a_name(text, meant))


def _as_a_name(text: str, meant: str) -> str:
    """What a button sends to declare the kx that was read as k*x; nothing for what was left out."""
    return (
        f"parameters:0:0:{text}" if text.isidentifier() and re.fullmatch(r"[\w*()]+", meant) else ""
    )


def problem_of(error: errors.InputError | Refusal, fields: Mapping[str, str]) -> Problem:
    """The places of a fault that was found while the form was read, or of a refusal of the service."""
    return [_place(place, fields) for place in error.places] or [ShownPlace(error.detail)]


def stored_refusal(document: Mapping[str, Any]) -> Refusal:
    """The refusal that the problem document of a job says."""
    kind, places = document["type"].rpartition(":")[2], tuple(map(_fault, document["errors"]))
    return Refusal(document["status"], kind, document["detail"], places)


def sentence(place: errors.Place, fields: Collection[str] = (), is_marked: bool = False) -> str:
    """What is wrong, for a form with these fields, which may be fewer than the members of a
    document.

    The column is said where it is not marked.
    """
    said = place.plain or place.detail
    if place.plain and place.column is not None and not is_marked:
        said = f"At column {place.column}: {said}"
    if place.declare and place.declare in fields:
        where = f"\u201c{FIELD_NAMES[place.declare]}\u201d, in \u201cAsk in detail\u201d"
        said += f" A name can be declared in {where}."
    return (
        sheets.capitalized(said)
        if said.startswith(tuple(f"{word} " for word in _FIRST_WORDS))
        else said
    )


def _fault(place: Mapping[str, Any]) -> errors.Place:
    span, instead = place.get("span"), tuple(place["instead"])
    parts = place.get("plain") or "", place.get("declare") or ""
    return errors.Place(
        place["detail"],
        place["pointer"],
        place["column"],
        "",
        instead,
        (span[0], span[1]) if span else None,
        *parts,
    )


def _place(error: errors.Place, fields: Mapping[str, str]) -> ShownPlace:
    steps = error.pointer.split("/")[1:]
    field = steps[0] if steps else ""
    name = ", ".join(
        [FIELD_NAMES.get(field, field), *(steps[-1:] if field in NAMED and len(steps) > 1 else ())]
    )
    text, begin = _text_at(steps, fields)
    if error.column is None or text is None or begin + error.column > len(text) + 1:
        return ShownPlace(sentence(error, fields), name, pointer=error.pointer)
    column = begin + error.column
    span = error.span and (begin + error.span[0], begin + error.span[1])
    error = replace(error, column=column, span=span)
    start = text.rfind("\n", 0, column - 1) + 1
    end = text.find("\n", start)
    line = text[start : end if end >= 0 else len(text)]
    place = column - 1 - start
    first, last = error.span or (0, 0)
    length = last - first if first == column else len(_WORD.match(line, place)[0])  # type: ignore[index]
    marked = line[place : place + max(length, 1)] or " "
    before, after = line[:place], line[place + len(marked) :]
    if len(before) > AROUND:
        before = "\u2026" + before[-AROUND:]
    if len(after) > AROUND:
        after = after[:AROUND] + "\u2026"
    number = text.count("\n", 0, start) + 1
    choices = _choices(error, text, start, line, f"{field}:{number}")
    detail = sentence(error, fields, is_marked=True)
    return ShownPlace(detail, name, number, place + 1, before, marked, after, choices, at=field)


def _choices(
    error: errors.Place, text: str, start: int, line: str, at: str
) -> tuple[tuple[str, str], ...]:
    """The interpretations of the text at an error, each as the resulting line and what a button
    sends.

    Those of a name end with one that declares it a constant. In LaTeX an interpretation is written
    as LaTeX.
    """
    first, last = (one - 1 for one in error.span) if error.span else ((error.column or 1) - 1,) * 2
    piece = _AFTER_FORMULA.sub("", text[first:last]) if error.span else _WORD.match(text, first)[0]  # type: ignore[index]
    readings = dict.fromkeys(
        _LETTER.sub(r"\\\g<0>", one) if "\\" in text else one for one in error.instead
    )
    if piece == "[":  # it is closed by its own kind
        readings = {
            f"{one.removesuffix('(')}[" if one.endswith("(") else one: None for one in readings
        }
    if text[:first][-1:].isalnum():
        readings = {f"{' ' * one[:1].isalnum()}{one}": None for one in readings}
    if not piece or "\n" in piece or piece.count("{") != piece.count("}"):
        return ()
    place = first - start
    until = f"+{len(piece)}" if error.span else ""
    whole = {one: f"{line[:place]}{one}{line[place + len(piece) :]}" for one in readings}
    found = [
        (made if len(made) <= LONGEST_LABEL else one, f"{at}:{place + 1}{until}:{one}")
        for one, made in whole.items()
    ]
    is_name = (
        found
        and not error.span
        and text[first + len(piece) :][:1] not in letters.PRIMES
        and "\\" not in piece
    )
    return (*found, *([(f"a constant {piece}", f"parameters:0:0:{piece}")] if is_name else []))


def _text_at(steps: list[str], fields: Mapping[str, str]) -> tuple[str | None, int]:
    """The typed text of the field that a pointer refers to, None if it was not typed, and where in it that part begins."""
    match steps:
        case ["equations" | "lagrangian" as name]:
            given = fields.get(name, "")
            return given, len(given) - len(given.lstrip())
        case ["constraints", number] if number.isdigit():
            given = fields.get("constraints", "")
            starts = dict(enumerate(found.start() for found in _CONSTRAINT.finditer(given)))
            return (given, starts[int(number)]) if int(number) in starts else (None, 0)
    return None, 0


@dataclass(frozen=True, slots=True)
class Sent:
    """The solve form as it was sent: its document, or why there is none. `shown` are the fields of that document."""

    fields: Fields
    shown: Fields
    document: dict[str, Any] | None = None
    problem: Problem | None = None


def sent_task(body: bytes, content_type: str) -> Sent:
    """The sent solve form to what it says."""
    return _sent(form_of(body, content_type))


def _sent(form: Form) -> Sent:
    fields = fields_of(form)
    try:
        document = document_of(form)
    except errors.InputError as error:
        return Sent(fields, fields, problem=problem_of(error, fields))
    return Sent(fields, fields_from(document) if "document" in form.files else fields, document)


def echo_sent_task(body: bytes, content_type: str) -> tuple[Fields, dict[str, Any]]:
    """The sent solve form to its fields and how it is understood."""
    sent = sent_task(body, content_type)
    return sent.fields, _understood(sent)


def echo_task(fields: Fields) -> dict[str, Any]:
    """The fields of the solve form to how they are understood."""
    return _understood(_sent(Form({name: (value,) for name, value in fields.items()})))


def _understood(sent: Sent) -> dict[str, Any]:
    """The answer of /v1/parse about a form, for the template; empty where nothing was typed."""
    if sent.document is None:
        return {"problem": sent.problem}
    typed = any(sent.fields[name] for name in ("equations", "lagrangian", "constraints"))
    if not (typed or sent.document):
        return {}
    from inverse_service.service.documents.documents import parse_document

    try:
        answer = parse_document(model.split_options(sent.document)[0])
    except errors.InputError as error:
        return {"problem": problem_of(error, sent.fields)} if typed else {}
    return {"understood": understood(answer, sent.fields, sent.document.get("time", "t"))}
