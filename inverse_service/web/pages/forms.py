"""Forms as browsers send them, and the way from their fields to a document and back: a document can be changed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs, parse_qsl, urlencode

from inverse_service import errors
from inverse_service.reading.document_names import AND_GUESS, GUESS, Declared, document_names
from inverse_service.service.documents import plain_data
from inverse_service.service.jobs import tasks

MAX_FIELDS = 120
_BOUNDARY = re.compile(r'boundary="?([^";]{1,70})"?', re.IGNORECASE)
_NAME = re.compile(rb'[ ;]name="([^"]{0,80})"')
_FILE_NAME = re.compile(rb'filename="([^"]{0,300})"')


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
        values = self.fields.get(name, ())
        return values[0].replace("\r\n", "\n").strip() if values else ""

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
        found = parse_qs(body.decode("ascii"), max_num_fields=MAX_FIELDS, errors="strict", keep_blank_values=True)
    except ValueError:
        raise unreadable() from None
    return Form({name: tuple(values) for name, values in found.items()})


def _multipart(body: bytes, content_type: str) -> Form:
    boundary = _BOUNDARY.search(content_type)
    if boundary is None:
        raise unreadable()
    parts = (b"\r\n" + body).split(b"\r\n--" + boundary.group(1).encode())
    if not 2 <= len(parts) <= MAX_FIELDS + 2 or not parts[-1].startswith(b"--"):
        raise unreadable()
    fields: dict[str, tuple[str, ...]] = {}
    files: dict[str, Upload] = {}
    for part in parts[1:-1]:
        _take(part, fields, files)
    return Form(fields, files)


def _take(part: bytes, fields: dict[str, tuple[str, ...]], files: dict[str, Upload]) -> None:
    head, separator, data = part.partition(b"\r\n\r\n")
    name = _NAME.search(head)
    if not separator or name is None:
        raise unreadable()
    try:
        key = name.group(1).decode()
        file_name = _FILE_NAME.search(head)
        if file_name is None:
            fields[key] = (*fields.get(key, ()), data.decode())
        elif file_name.group(1) or data:
            files[key] = Upload(file_name.group(1).decode(), data)
    except UnicodeDecodeError:
        raise unreadable() from None


def unreadable() -> errors.InputError:
    """The body is no form."""
    detail = "The form was not sent as a browser sends it."
    return errors.DocumentRefused((errors.Place(detail, code=tasks.UNREADABLE),))


KINDS = ("equations", "nonholonomic")
ASSOCIATED = ("first", "second", "third", "any")
FIELDS = ("kind", "name", "equations", "lagrangian", "constraints", "coordinates", "parameters", "functions",
          "associated", "time", "special_cases", "ansatz", "kinds", "clock", "time_limit")  # fmt: skip
# What a link may say; `kind` is the form's own.
LINKED = FIELDS[1:]
LAGRANGIANS = ("natural", "riemannian", "finsler", "positive_definite", "rayleigh")
# What can only be chosen on the form, not typed.
CHOSEN: dict[str, tuple[str, ...]] = {
    "associated": ASSOCIATED, "time": ("no", "yes"), "special_cases": ("yes",), "kinds": LAGRANGIANS,
}  # fmt: skip
LONGEST_LINK = 6_000
TIME = {"no": False, "yes": True}
_CHOICE = re.compile(r"(equations|lagrangian|constraints|parameters):(\d{1,4}):(\d{1,5})(?:\+(\d{1,5}))?:(.{1,200})")
_IDENTIFIER = re.compile(r"^\\?\w+")
_LEFT_SIDE = re.compile(r"\s*(?:L|\\mathcal ?(?:L|\{L\}))\s*=(?!=)")
_FUNCTION = re.compile(r"\s*([^\s(),]+)\s*\(([^()]*)\)\s*,?")


def fields_of(form: Form) -> dict[str, str]:
    """The fields of the solve form as texts."""
    found = {name: form.text(name) for name in FIELDS} | {"kinds": " ".join(form.every("kinds"))}
    if found["kind"] not in KINDS:
        found["kind"] = "nonholonomic" if found["lagrangian"] and not found["equations"] else "equations"
    return _with_choice(found, form.text("instead"))


def _with_choice(fields: dict[str, str], choice: str) -> dict[str, str]:
    """The fields with the reading that was chosen: "equations:2:9:k*x" puts k*x for the name at line 2, column 9;
    "equations:2:9+4:k/(m*x)" puts it for the four characters there.

    "parameters:0:0:kx" declares kx.
    """
    match = _CHOICE.fullmatch(choice)
    if match is None:
        return fields
    name, line, column, text = match[1], int(match[2]), int(match[3]), match[5]
    if name == "parameters":
        return fields | {name: ", ".join(part for part in (fields[name], text) if part)}
    lines = fields[name].split("\n")
    if not 0 < line <= len(lines):
        return fields
    before, rest = lines[line - 1][: column - 1], lines[line - 1][column - 1 :]
    lines[line - 1] = before + text + (rest[int(match[4]) :] if match[4] else _IDENTIFIER.sub("", rest, count=1))
    return fields | {name: "\n".join(lines)}


def document_of(form: Form) -> dict[str, Any]:
    """The document that a form describes: an uploaded one, a pasted one, or its fields.

    Raises InputError where a document or a list of names cannot be read.
    """
    upload = form.files.get("document")
    if upload is not None:
        return _as_object(plain_data.read_document(upload.data, upload.name))
    fields = fields_of(form)
    if fields["kind"] == "equations" and fields["equations"].startswith("{") and '"' in fields["equations"]:
        return _as_object(plain_data.read_json(fields["equations"]))
    return document_of_fields(fields)


def _as_object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise errors.InputError("The document is not an object; it must have coordinates and equations.")
    return value


def document_of_fields(fields: Mapping[str, str]) -> dict[str, Any]:
    """The document; names that were not declared are guessed where it is read."""
    plain_data.refuse_surrogates(dict(fields))
    nonholonomic = fields["kind"] == "nonholonomic"
    constraints = [line.strip() for line in re.split(r"[\n;]", fields["constraints"]) if line.strip()]
    document: dict[str, Any] = {"name": fields["name"]} if fields["name"] else {}
    if coordinates := _names(fields["coordinates"]):
        document["coordinates"] = coordinates
    if nonholonomic:
        document["lagrangian"] = right_side(fields["lagrangian"])
        # Without constraints there are no associated systems, though one of them is always ticked on the form.
        if constraints:
            document["constraints"] = constraints
            document |= {"associated": fields["associated"]} if fields["associated"] in ASSOCIATED else {}
    else:
        document["equations"] = fields["equations"]
        document |= {"kinds": kinds} if (kinds := _names(fields["kinds"])) else {}
        document |= {"clock": fields["clock"]} if fields["clock"] else {}
    return document | _declared(fields) | _questions(fields)


def right_side(lagrangian: str) -> str:
    """What `L = ...` says L is, with blanks for the left side so that places stay."""
    found = _LEFT_SIDE.match(lagrangian)
    return " " * found.end() + lagrangian[found.end() :] if found else lagrangian


def _declared(fields: Mapping[str, str]) -> dict[str, Any]:
    parameters = parameters_of(fields["parameters"])
    functions = {name: list(arguments) for name, arguments in functions_of(fields["functions"]).items()}
    valued = any(value is not None for value in parameters.values())
    rest: Any = {**parameters, AND_GUESS: None} if valued else [*parameters, AND_GUESS]
    return {"parameters": rest if parameters else GUESS} | ({"functions": functions} if functions else {})


def _questions(fields: Mapping[str, str]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if fields["time"] in TIME:
        found["time_dependent_lagrangian"] = TIME[fields["time"]]
    if fields["special_cases"]:
        found["special_cases"] = True
    terms = _terms(fields["ansatz"])
    if terms:
        found["ansatz"] = terms
    if fields["time_limit"]:
        found["options"] = {"time_limit": _seconds(fields["time_limit"])}
    return found


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise errors.InputError("The time limit must be a number of seconds such as 30.", "/options/time_limit")
    return seconds


def _terms(text: str) -> list[str]:
    """The parts between commas and line ends that stand in no bracket."""
    found, depth = [""], 0
    for character in text:
        depth += (character in "([{") - (character in ")]}")
        if character in ",;\n" and depth == 0:
            found.append("")
        else:
            found[-1] += character
    return [part.strip() for part in found if part.strip()]


def _names(text: str) -> list[str]:
    return [part.strip() for part in re.split(r"[,\s;]+", text) if part.strip()]


def parameters_of(text: str) -> dict[str, str | None]:
    """ "m, k = 1/2" as names with their values, None for a generic one."""
    found: dict[str, str | None] = {}
    for part in re.split(r"[,;\n]", text):
        name, _, value = part.partition("=")
        if name.strip():
            found[name.strip()] = value.strip() or None
    return found


def functions_of(text: str) -> dict[str, tuple[str, ...]]:
    """ "A(r1), V(x, y)" as names with their arguments; raises InputError for anything else."""
    found: dict[str, tuple[str, ...]] = {}
    rest = text
    while rest.strip(" ,;\n"):
        match = _FUNCTION.match(rest.lstrip(" ,;\n"))
        if match is None:
            detail = "The functions must be written as A(r1), V(x, y): a name and its coordinates."
            raise errors.InputError(detail, "/functions")
        found[match.group(1)] = tuple(_names(match.group(2)))
        rest = rest.lstrip(" ,;\n")[match.end() :]
    return found


def fields_from(document: Mapping[str, Any]) -> dict[str, str]:
    """The form filled with a document."""
    fields = dict.fromkeys(FIELDS, "")
    fields |= {"kind": "equations", "name": str(document.get("name", ""))}
    fields["coordinates"] = ", ".join(document.get("coordinates") or ())
    parameters = Declared(parameters=document.get("parameters") or ()).named_parameters()
    pairs = parameters.items() if isinstance(parameters, Mapping) else ((name, None) for name in parameters)
    fields["parameters"] = ", ".join(name if value is None else f"{name} = {value}" for name, value in pairs)
    functions = document.get("functions") or {}
    fields["functions"] = ", ".join(f"{name}({', '.join(arguments)})" for name, arguments in functions.items())
    fields["time"] = {False: "no", True: "yes"}.get(document.get("time_dependent_lagrangian"), "")  # type: ignore[arg-type]
    fields["special_cases"] = "yes" if document.get("special_cases") else ""
    fields["ansatz"] = ", ".join(document.get("ansatz") or ())
    fields["kinds"] = " ".join(kind for kind in document.get("kinds") or () if kind in LAGRANGIANS)
    fields["clock"] = str(document.get("clock") or "")
    limit = (document.get("options") or {}).get("time_limit")
    fields["time_limit"] = "" if limit is None else f"{limit:g}" if isinstance(limit, int | float) else str(limit)
    if "lagrangian" in document:
        constraints = document.get("constraints", [])
        fields |= {"kind": "nonholonomic", "lagrangian": str(document["lagrangian"])}
        fields["constraints"] = constraints if isinstance(constraints, str) else "\n".join(constraints)
        fields["associated"] = str(document.get("associated") or "")
    else:
        fields["equations"] = equations_text(document.get("equations", ""))
    return fields


def question_address(document: Mapping[str, Any]) -> str:
    """The link that fills the form with this question, and does not ask it; nothing where it would be too long."""
    address = link_of_fields(lean_fields(document))
    return address if len(address) <= LONGEST_LINK else ""


def link_of_fields(fields: Mapping[str, str], **further: str) -> str:
    """The link that fills the form with these fields."""
    wanted = {name: value for name, value in fields.items() if value and name in LINKED}
    return f"/?{urlencode(wanted | further)}"


def is_whole(fields: Mapping[str, str]) -> bool:
    """Whether a link fills the form with all that these fields say."""
    link = link_of_fields(fields)
    return len(link) <= LONGEST_LINK and fields_of_link(dict(parse_qsl(link.partition("?")[2]))) == fields


def fields_of_link(query: Mapping[str, str]) -> dict[str, str] | None:
    """The fields of a link with a question, None where it has none."""
    if not (query.get("equations") or query.get("lagrangian")):
        return None
    fields = dict.fromkeys(FIELDS, "") | {name: query.get(name, "") for name in LINKED}
    for name, allowed in CHOSEN.items():
        fields[name] = " ".join(value for value in _names(fields[name]) if value in allowed)
    return fields | {"kind": "equations" if fields["equations"] else "nonholonomic"}


def left_out_of_link(query: Mapping[str, str]) -> list[str]:
    """A sentence for each value in a link that the form has no choice for."""
    return [
        f"The link sets {name}={value}, which is not valid and was ignored. Valid values: {', '.join(allowed)}."
        for name, allowed in CHOSEN.items()
        for value in _names(query.get(name, ""))
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
    parts = [document.get("equations") or document.get("lagrangian") or "", document.get("constraints") or ()]
    texts = [text for part in parts for text in _texts_in(part)]
    keys = tuple(parts[0]) if isinstance(parts[0], dict) else ()
    declared = Declared(document.get("coordinates"), document.get("parameters") or (), document.get("functions") or {})
    by_pointer = {f"/{place}": text for place, text in enumerate(texts)}
    names = document_names(declared, by_pointer, 1 if "lagrangian" in document else 2, keys)
    values = declared.named_parameters()
    return (
        names.coordinates,
        sorted(names.parameters),
        dict(names.functions),
        dict(values) if isinstance(values, Mapping) else {},
    )


def _texts_in(part: Any) -> list[str]:
    return (
        [part] if isinstance(part, str) else [str(text) for text in (part.values() if isinstance(part, dict) else part)]
    )


def equations_text(equations: Any) -> str:
    """Equations of any form as the lines of the text box."""
    if isinstance(equations, dict):
        return "\n".join(f"{coordinate}'' = {f}" for coordinate, f in equations.items())
    if isinstance(equations, Sequence) and not isinstance(equations, str):
        return "\n".join(str(line) for line in equations)
    return str(equations)
