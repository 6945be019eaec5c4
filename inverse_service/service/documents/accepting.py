"""From a document as people write it to its schema and to the system that it describes.

`prepared` converts the looser notation of users: a text that gives L, or T and V, or equations with
multipliers; and another name of the time. Inside, the time is t: a document that calls it tau
(`"time": "tau"`, or y''(tau) in every equation) is renamed on the way in and its result on the way
out; a coordinate called t then has a name that the document does not use. `to_schema` and
`to_system` take the prepared document; each fault is one sentence and its place.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Callable, Collection, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from api_schemas import base
from api_schemas.system import (
    KINDS_OF_LAGRANGIANS,
    MAX_SERIES_ORDER,
    TAGS,
    LagrangianDocument,
    MotionDocument,
    NamedDocument,
    NonholonomicDocument,
    SystemDocument,
)
from inverse_service import errors
from inverse_service.expressions import collecting, refusals, tree as ex
from inverse_service.reading import (
    declarations,
    names as nm,
    newtons_law,
    reader,
    signs,
    spelled_dependences,
    time_derivatives,
)
from inverse_service.reading.rules import dependences, motion, vectors
from inverse_service.reading.tokens import LEFT_OUT, Line, Meaning, spelled, split_at, walk
from inverse_service.reading.typed_text import Typed
from inverse_service.service.documents import (
    lagrangian_texts,
    pasted_programs,
    plain_data,
    renaming,
)

# A scene needs neither, and they load the exact field.
if TYPE_CHECKING:
    from inverse_service.mechanics import second_order_system
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

Read = TypeVar("Read", bound=base.Document)
Asking = SystemDocument | NonholonomicDocument | MotionDocument
Steps = tuple[int | str, ...]
FORMULAS = (
    "equations",
    "lagrangian",
    "constraints",
    "ansatz",
    "multiples",
    "where",
    "clock",
    "motion",
    "kinds",
)
SCENE_FORMULAS = (
    "forces",
    "rayleigh",
    "observe",
    "events",
    "terms",
    "functions",
    "free_lagrangian",
)
NAMES = declarations.DECLARING
_LETTERS = "wzkbcudhgnalsTYZWJKBUDGNCP"
# Names of a parameter of a curve.
_PARAMETERS = ("s", "tau", "lambda", "sigma")
_TIMED = re.compile(r"(?<![A-Za-z\\])d?t(?![A-Za-z])")
# x'' = f without words: no Lagrangian, no constraint, and no multiplier of one.
_ACCELERATION = re.compile(
    r"\s*[a-z]\d?''\s*=(?:[-+*/^().'\d ]|\b[a-z]\d?\b|\b(?:sin|cos|tan|exp|log|sqrt)\b)*", re.ASCII
)
# Of documents of every kind.
KEYS = frozenset(("time", "id", "options", "metadata", "search", "catalogue", "format")).union(
    *(one.model_fields for one in (SystemDocument, NonholonomicDocument, MotionDocument))
)
_DECIMAL = re.compile(
    r"(?<![\w.])(?:(?:\d{1,12}\.\d{1,12}|\.\d{1,12})(?:[eE][-+]?[1-6](?!\d))?"
    r"|\d{1,12}[eE]-[1-6](?!\d))(?![\d.])"
)
_HALF = re.compile(r"/\s*\(?\s*[24](?![\d.])")  # over 2 or 4
MOST_TEXTS = 200
# Nodes of all accelerations, beyond which they are unreadable; on a cart two links have 1,748,
# three 14,834.
_MOST_NODES = 5_000
# Equations that were read last, with their notes: a result is compared with its document.
_GIVEN: dict[str, tuple[second_order_system.GivenEquations, dict[str, Meaning]]] = {}
_MOST_GIVEN = 2
MAX_PLACES = 10
NOT_IN_THE_DOCUMENT = frozenset({*TAGS, "[key]"})
ALSO = ("time", "id", "options")
TITLES = {"NonholonomicDocument": "nonholonomic system", "LagrangianDocument": "Lagrangian"}
_IN_WORDS = (Path(base.__file__).parent / "expected.json").read_text(encoding="utf-8")
# The values allowed at these steps, in words; "*" is any key or place.
EXPECTED: dict[Steps, str] = {
    **{
        tuple(filter(None, place.split("/"))): words.replace(
            "KINDS", ", ".join(KINDS_OF_LAGRANGIANS)
        )
        for place, words in json.loads(_IN_WORDS).items()
    },
    ("series_order",): f"an integer from 1 to {MAX_SERIES_ORDER}",
}

# Questions about equations of second order, which a document with constraints does not have.
BESIDE = {
    "kinds": "Kinds of Lagrangians are asked about equations: give those of an associated or of the reduced system, "
    "which the result of this document without 'kinds' has.",
    "clock": "With constraints the clock is found, see 'reduced' of the result: leave 'clock' out, or give the "
    "equations of the reduced system.",
}


# Keys of a scene without which a motion is another one: no answer may be given as if they were
# absent.
OF_SCENES = frozenset(
    ("forces", "rayleigh", "effects", "terms", "as_lagrangian", "events", "contacts")
)


def near_key(key: str) -> str:
    """The key that was meant by one that is spelled nearly so; else nothing."""
    return (
        "" if key in KEYS else next(iter(difflib.get_close_matches(key, sorted(KEYS), 1, 0.75)), "")
    )


def is_motion(document: Any) -> bool:
    """Whether a document gives a motion on constraints as it is."""
    return isinstance(document, dict) and "motion" in document


def is_nonholonomic(document: Any) -> bool:
    """Whether a document is meant as a Lagrangian with constraints."""
    return isinstance(document, dict) and ("lagrangian" in document or "constraints" in document)


def is_forward(document: Any) -> bool:
    """Whether a document is a Lagrangian and nothing else that says what moves."""
    if not isinstance(document, dict) or "equations" in document:
        return False
    return "lagrangian" in document and document.get("constraints") in (None, [], "")


@dataclass(frozen=True, slots=True)
class Prepared:
    """A document for the schemas, what its time and a coordinate t were called, its id, and whence
    formulas come.

    `places` say of formulas, by their pointers, where they were typed. `is_unread`: a text in it
    is too long to be read.
    """

    document: Any
    time: str = "t"
    other: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)
    readings: Mapping[str, Meaning] = field(default_factory=dict)
    places: Mapping[str, Typed] = field(default_factory=dict)
    is_unread: bool = False

    def outward(self, result: dict[str, Any]) -> dict[str, Any]:
        """The result in the words of the writer."""
        found = result
        if self.time != "t":
            table = {"t": self.time, self.other: "t"}
            found = renaming.with_names(result, table)
            if "readings" in found and any(map(reader.is_latex, typed_texts(self.document))):
                found["readings"] = [
                    {
                        **new,
                        **_run_with_names({**new, **old, "meaning": new.get("meaning", "")}, table),
                    }
                    for old, new in zip(result["readings"], found["readings"], strict=True)
                ]
            if isinstance(found.get("system"), dict):
                found["system"] = {**found["system"], "time": self.time}
        return {**found, **self.extra}

    def error(self, error: errors.InputError) -> errors.InputError:
        """The refusal in the words of the writer, at its place in what was written."""
        if type(error) not in (errors.InputError, errors.LimitError):
            return error  # the shape of a document is refused in its own words
        error = self.places[error.pointer].error(error) if error.pointer in self.places else error
        if self.time == "t":
            return error
        names = {"t": self.time, self.other: "t"}
        texts = (error.detail, error.plain, *error.instead)
        detail, plain, *instead = (renaming.in_plain_text(text, names) for text in texts)
        return error.said(detail, plain, error.pointer, tuple(instead))


def _run_with_names(reading: Mapping[str, str], table: Mapping[str, str]) -> dict[str, str]:
    """What changes of a note about a run of letters of LaTeX, each of which is a name: ax, not
    at.
    """
    run = reading["text"]
    found = renaming.with_names({"latex": run}, table)["latex"] if run.isalpha() else run
    if reading.get("constant") != run:
        return {"text": found}
    return {"text": found, "constant": found, "as": f"{reading['meaning']}, not a constant {found}"}


def typed_decimals(document: Any) -> frozenset[Fraction]:
    """The decimal numbers in the formulas and values of a document, but for 2.0, 0.5, 0.25, and
    0.75.
    """
    found = _decimals_of(typed_texts(document))
    return frozenset(one for one in found if one.denominator > (1 if one > 1 else 4))


def decimals_of_lines(document: Any) -> frozenset[Fraction]:
    """The same for the lines as they were typed: also 0.5, 0.25, and 0.75, where none of them is
    typed as a fraction.
    """
    texts = typed_texts(document)
    if any(map(_HALF.search, texts)):
        return typed_decimals(document)
    return frozenset(one for one in _decimals_of(texts) if one.denominator > 1)


def typed_texts(document: Any) -> list[str]:
    """The formulas and values of a document or of a scene, as many as are looked at."""
    if not isinstance(document, Mapping):
        return []
    values = document.get("parameters")
    numbers = [str(value) for value in values.values()] if isinstance(values, Mapping) else []
    formulas = (*FORMULAS, *SCENE_FORMULAS)
    texts = [*_texts([document[key] for key in formulas if key in document]), *numbers]
    return texts[:MOST_TEXTS]


def _decimals_of(texts: Sequence[str]) -> list[Fraction]:
    return [Fraction(number) for text in texts for number in _DECIMAL.findall(text)]


def prepared(document: Any) -> Prepared:
    """The document as the schemas want it; InputError for a result in its place, and for a bad name
    of the time.

    A pasted program is run where its lines are not read as equations, where they are read as
    others, and where it calls functions of its own.
    """
    pasted_programs.refuse_more_than_equations(document)
    text = pasted_programs.text_of(document) if isinstance(document, Mapping) else ""
    try:
        found = _step_by_step(document)
        if text:
            _read_once(found.document)
    except errors.InputError:
        run = _of_program(document, text) if text else None
        if run is None:
            pasted_programs.refuse_a_trap(text)
            raise
        return run
    if not text:
        return found
    pasted_programs.refuse_a_trap(text)
    run = _of_program(document, text)
    wins = run is not None and (
        pasted_programs.is_more_than_lines(text)
        or _says_otherwise(run.document, found.document, text)
    )
    return run if run is not None and wins else found


def _says_otherwise(run: Any, lines: Any, text: str) -> bool:
    """Whether the lines of a program say something else than it does when it is run: a constraint,
    L without the forces beside it, other equations in the same coordinates, a name of an expression
    as a constant, or L in which more or fewer names move.
    """
    from inverse_service.field import real_branch
    from inverse_service.mechanics import euler_lagrange

    if is_nonholonomic(lines) and not is_forward(lines):
        return True
    if is_forward(run):
        return is_forward(lines) and len(_moving(run)) != len(_moving(lines))
    found = to_solvable(to_schema(run))
    motion = found.coordinates, found.accelerations
    if is_forward(lines):
        lagrangian = lagrangian_texts.read_lagrangian(lines)
        apart = euler_lagrange.euler_lagrange_residual(lagrangian, *motion)
    else:
        other = to_solvable(to_schema(lines))
        set_by_program = ({*other.parameters} - {*found.parameters}) & pasted_programs.names_set(
            text
        )
        if motion[0] == other.coordinates and set_by_program:
            return True  # eqn of eqn = m*ddq + k*q
        if motion[0] != other.coordinates or {*found.parameters} != {*other.parameters}:
            return False
        pairs = zip(found.accelerations, other.accelerations, strict=True)
        apart = tuple(one - another for one, another in pairs)
    left = [one for one in apart if collecting.collect(one) != ex.ZERO]
    try:
        return any(not real_branch.vanishes(one) for one in left)
    except errors.InputError:  # at no point found are they real
        return False


def _moving(document: Any) -> set[str]:
    """The names whose velocities are in the Lagrangian of a document."""
    nodes = ex.walk(lagrangian_texts.read_lagrangian(document))
    return {node.coordinate for node in nodes if isinstance(node, ex.Velocity)}


def _step_by_step(document: Any) -> Prepared:
    return [Prepared(document), *(ready for _, ready in steps_of(document))][-1]


def _of_program(document: Mapping[str, Any], text: str) -> Prepared | None:
    """The document with the system that a program comes to; None where that is not read."""
    made = pasted_programs.with_system(document, text)
    if made is None:
        return None
    try:
        found = _step_by_step(made)
        _read_once(found.document)
    except errors.InputError:
        return None
    whole = Typed.of(text, "/equations")
    lines = made["equations"] if "equations" in made else [f"L = {made['lagrangian']}"]
    keys = (
        [f"/equations/{k}" for k in range(len(lines))] if "equations" in made else ["/lagrangian"]
    )
    places = {key: whole.made(line) for key, line in zip(keys, lines, strict=True)}
    meant = Meaning("; ".join(lines), "")
    aside = {value: Meaning(LEFT_OUT, "") for value in pasted_programs.set_aside(text)}
    readings = {**found.readings, pasted_programs.shown(text): meant, **aside}
    return replace(found, places=places, readings=readings)


def _read_once(document: Any) -> None:
    """InputError for equations, or a Lagrangian, that are not read."""
    if is_forward(document):
        lagrangian_texts.read_lagrangian(document)
    elif not (is_motion(document) or is_nonholonomic(document)):
        to_solvable(to_schema(document))


def steps_of(document: Any) -> Iterator[tuple[str, Prepared]]:
    """Each step of the preparation by its name, with the document after it: the chain that
    `prepared` runs to its end.
    """
    ready = Prepared(document)
    if not isinstance(document, Mapping):
        return
    for step in STEPS:
        ready = step(ready)
        yield step.__name__.strip("_").replace("_", " "), ready
        if ready.is_unread:
            return


def _refuse_a_result(ready: Prepared) -> Prepared:
    if str(ready.document.get("format", "")).startswith("inverse-service/"):
        raise errors.InputError(
            "This is a result, not a document: its document is in system.given.", "/format"
        )
    return ready


def _keep_the_id(ready: Prepared) -> Prepared:
    """Set apart what the result repeats; leave out notes of the writer (`_...`)."""
    extra = {key: ready.document[key] for key in ("id", "metadata") if key in ready.document}
    if "id" in extra:  # the name of its own; "id", which jobs have too, is the older one
        extra["document_id"] = extra["id"]
    plain = {
        key: value
        for key, value in ready.document.items()
        if key not in ("id", "$schema") and key[:1] != "_"
    }
    return replace(ready, document=plain, extra=extra)


def _guess_names(ready: Prepared) -> Prepared:
    """A document that declares no names is read as the command line reads a text."""
    if any(ready.document.get(key) is not None for key in NAMES):
        return ready
    return replace(ready, document={**ready.document, "parameters": declarations.GUESS})


def _leave_long_texts(ready: Prepared) -> Prepared:
    """A text with too many characters or parts is refused before it is read."""
    texts = [*_texts([ready.document[key] for key in FORMULAS if key in ready.document])]
    is_long = any(len(text) > refusals.most_characters() for text in texts) or any(
        len(text) > refusals.most_tokens() and reader.has_too_many_parts(text) for text in texts
    )
    return replace(ready, is_unread=True) if is_long else ready


def _find_the_lagrangian(ready: Prepared) -> Prepared:
    """Take L and its constraints out of texts; a Lagrangian alone has no constraints."""
    plain = ready.document
    if "lagrangian" in plain or not _gives_accelerations(plain.get("equations")):
        plain, places, read = lagrangian_texts.with_lagrangian(plain, _declared(plain))
        ready = replace(ready, document=plain, places=places, readings=read)
    if is_forward(plain):
        plain = {key: value for key, value in plain.items() if key != "constraints"}
    return replace(ready, document=plain)


def _write_vectors_out(ready: Prepared) -> Prepared:
    """The components of vectors that unit vectors give, and those of r_1 next to r_i = (x_i, y_i)."""
    text = ready.document.get("equations")
    if not isinstance(text, str) or "\\" not in text:
        return ready
    typed = ready.places.get("/equations", Typed.of(text, "/equations"))
    found = vectors.written_out(typed)
    if found.text == typed.text:
        return ready
    places = {**ready.places, "/equations": found}
    return replace(ready, document={**ready.document, "equations": found.text}, places=places)


def _spell_out_dependences(ready: Prepared) -> Prepared:
    """V(x, y) for V in equations beside V = V(x, y)."""
    given = ready.document.get("equations")
    texts = [given] if isinstance(given, str) else given
    if "lagrangian" in ready.document or not isinstance(texts, list):
        return ready
    if not all(isinstance(text, str) for text in texts):
        return ready
    pointers = (
        ["/equations"] if isinstance(given, str) else [f"/equations/{k}" for k in range(len(texts))]
    )
    typed = [
        ready.places.get(at, Typed.of(one, at)) for at, one in zip(pointers, texts, strict=True)
    ]
    found = spelled_dependences.spelled_out(typed, _declared(ready.document))
    if found is None:
        return ready
    written = [one.text for one in found.typed]
    equations = written[0] if isinstance(given, str) else written
    functions = found.functions if not ready.document.get("functions") else {}
    declared = {"functions": functions} if functions else {}
    return replace(
        ready,
        document={**ready.document, **declared, "equations": equations},
        places={**ready.places, **dict(zip(pointers, found.typed, strict=True))},
        readings={**ready.readings, **{said: Meaning(name) for said, name in found.meant.items()}},
    )


def _read_newtons_law(ready: Prepared) -> Prepared:
    """m a = -k x of a text that declares nothing, with x'' for a."""
    plain = ready.document
    text = plain.get("equations")
    others = ("coordinates", "functions", "where", "lagrangian", "time")
    if not isinstance(text, str) or any(plain.get(key) for key in others):
        return ready
    typed = ready.places.get("/equations", Typed.of(text, "/equations"))
    found = newtons_law.with_derivatives(typed)
    if found is None:
        return ready
    read = {name: Meaning(meant) for name, meant in found.meant.items()}
    readings = {**ready.readings, **read}
    places = {**ready.places, "/equations": found.typed}
    return replace(
        ready, document={**plain, "equations": found.typed.text}, readings=readings, places=places
    )


def _leave_out_unknown_keys(ready: Prepared) -> Prepared:
    """Unknown keys are reported as `ignored`; nearly known ones and those of scenes stay, for the
    schema to refuse.
    """
    plain = {key: value for key, value in ready.document.items() if key != "metadata"}
    ignored = [
        key
        for key in plain
        if isinstance(key, str) and key not in KEYS | OF_SCENES and not near_key(key)
    ]
    kept = {key: value for key, value in plain.items() if key not in ignored}
    extra = {**ready.extra, "ignored": ignored} if ignored else ready.extra
    return replace(ready, document=kept, extra=extra)


def _read_loose_values(ready: Prepared) -> Prepared:
    """Lists of names as one text, numbers as texts, and the like."""
    plain = {
        key: _LOOSE[key](value) if key in _LOOSE else value for key, value in ready.document.items()
    }
    return replace(ready, document=plain)


def _eliminate_position_constraints(ready: Prepared) -> Prepared:
    if "lagrangian" not in ready.document or "constraints" not in ready.document:
        return ready
    plain, eliminated = lagrangian_texts.on_positions(ready.document)
    held, places = ready.document["constraints"], ready.places
    if eliminated and isinstance(held, list):
        places = _of_kept(places, [text.strip() in eliminated for text in held])
    readings = {**ready.readings, **eliminated}
    return replace(ready, document=plain, readings=readings, places=places)


def _name_the_time(ready: Prepared) -> Prepared:
    """The time becomes t, and a coordinate t another letter."""
    plain = dict(ready.document)
    curve = "" if "time" in plain else _parameter_of_curve(plain)
    time = _time_name(plain)
    free = "" if time != "t" or curve else _free_variable(plain)
    notes = {**ready.readings} | ({free: Meaning("the independent variable")} if free else {})
    ready = replace(ready, document=plain, readings=notes)
    time = free or (curve if time == "t" else "") or time
    if time == "t":
        return ready
    plain, places, products = _set_time_apart(ready, time)
    ready = replace(ready, places=places)
    read = {name: Meaning(product) for name, product in products.items()}
    if (
        isinstance(text := plain.get("equations"), str) and "$" not in text
    ):  # whose words hold the letters of names
        with reader.noted() as omitted:
            kept = reader.without_words(
                ready.places.get("/equations", Typed.of(text, "/equations"))
            )
        plain["equations"], notes = kept.text, notes | omitted
        ready = replace(ready, places={**ready.places, "/equations": kept})
    other = next(letter for letter in _LETTERS if letter not in "".join(_texts(plain)))
    if time == curve:
        notes[other] = Meaning(f"a coordinate; the parameter of the curve is {curve}")
    document, places = _with_names(
        plain, ready.places, {time: "t", "t": other}, (*FORMULAS, *NAMES)
    )
    return replace(
        ready,
        document=document,
        time=time,
        other=other,
        readings=notes | read,
        places=places,
    )


def _with_names(
    plain: Mapping[str, Any],
    places: Mapping[str, Typed],
    table: Mapping[str, str],
    keys: Sequence[str],
) -> tuple[dict[str, Any], dict[str, Typed]]:
    """The document with the names of the table exchanged under these keys, and where each of its
    formulas was typed.
    """
    document, found = dict(plain), dict(places)
    for key in keys:
        if key in plain:
            document[key] = renaming.typed_with_names(plain[key], f"/{key}", table, found)
    return document, found


# The preparation, step by step; each takes the document that the former left.
STEPS: tuple[Callable[[Prepared], Prepared], ...] = (
    _refuse_a_result,
    _keep_the_id,
    _guess_names,
    _leave_long_texts,
    _find_the_lagrangian,
    _write_vectors_out,
    _spell_out_dependences,
    _read_newtons_law,
    _leave_out_unknown_keys,
    _read_loose_values,
    _eliminate_position_constraints,
    _name_the_time,
)


def _of_kept(places: Mapping[str, Typed], gone: Sequence[bool]) -> dict[str, Typed]:
    """The same places after the constraints that are gone no longer count."""
    kept = [k for k, is_gone in enumerate(gone) if not is_gone]
    found = {key: typed for key, typed in places.items() if not key.startswith("/constraints/")}
    numbered = ((f"/constraints/{k}", place) for place, k in enumerate(kept))
    found |= {f"/constraints/{place}": places[key] for key, place in numbered if key in places}
    return found


def _gives_accelerations(equations: Any) -> bool:
    """Whether equations are surely nothing else than x'' = f, one for each acceleration."""
    lines = re.split("[;,\n]", equations) if isinstance(equations, str) else equations
    if isinstance(lines, list):
        return all(isinstance(line, str) and _ACCELERATION.fullmatch(line) for line in lines)
    return isinstance(lines, Mapping)


@dataclass(frozen=True, slots=True)
class PreparedScene:
    """A scene for its schema, and where its formulas were typed, by their pointers."""

    document: Any
    places: Mapping[str, Typed] = field(default_factory=dict)

    def error(self, error: errors.InputError) -> errors.InputError:
        """The refusal at its place in what was typed."""
        is_typed = type(error) is errors.InputError and error.pointer in self.places
        return self.places[error.pointer].error(error) if is_typed else error


def prepared_scene(scene: Any) -> PreparedScene:
    """A scene with its own formulas in the words of its prepared system: the name of the time is t
    in both.
    """
    system = scene.get("system") if isinstance(scene, Mapping) else None
    if not isinstance(system, Mapping) or "catalogue" in system:
        return PreparedScene(scene)
    result = system.get("result")
    part = result.get("system") if isinstance(result, Mapping) else system.get("document", system)
    given = (
        part.get("time", "t") if isinstance(part, Mapping) and isinstance(result, Mapping) else None
    )
    try:
        time = prepared(part).time if given is None else given
    except errors.InputError:
        return PreparedScene(scene)  # reported with its place when the system is read
    if time == "t":
        return PreparedScene(scene)

    places: dict[str, Typed] = {}

    def renamed(part: Any, pointer: str) -> Any:
        if not isinstance(part, Mapping):
            return part
        return {
            key: renaming.typed_with_names(one, f"{pointer}/{key}", {time: "t"}, places)
            if key in SCENE_FORMULAS
            else one
            for key, one in part.items()
        }

    found, methods = renamed(scene, ""), scene.get("methods")
    if isinstance(methods, list):
        found["methods"] = [renamed(one, f"/methods/{k}") for k, one in enumerate(methods)]
    return PreparedScene(found, places)


def uses_the_letter_t(ready: Prepared) -> bool:
    """Whether t is a name of the document's own, while its time has another name."""
    return ready.time != "t" and any(ready.other in text for text in _texts(ready.document))


def inward(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result as it was before `Prepared.outward`, so that it can be compared with its
    certificate.
    """
    system = result.get("system")
    time = system.get("time", "t") if isinstance(system, Mapping) else "t"
    if time == "t" or not isinstance(system, Mapping) or not isinstance(time, str):
        return result
    other = prepared(system.get("given")).other
    changed = renaming.with_names(dict(result), {time: "t", "t": other})
    return {**changed, "system": {**changed["system"], "time": time}}


def _time_name(plain: dict[str, Any]) -> str:
    """The name in the key `time`, which is taken out, or the one that every equation gives the
    time; else t.
    """
    given = plain.pop("time", None)
    if given is None:
        return _found_time(plain)
    if not isinstance(given, str):
        raise refusals.fault("time that is no text", "/time")
    name = "t" if given == "t" else nm.declared_name(given, "/time", "time")
    if name in _declared(plain):
        raise refusals.fault("time declared twice", "/time", name=name)
    return name


def _parameter_of_curve(plain: Mapping[str, Any]) -> str:
    r"""A name for the parameter of a curve in spacetime, whose t has dots: \dot t^2 in L, or t''."""
    texts = [text for _, text in _placed({key: plain[key] for key in FORMULAS if key in plain}, "")]
    if not _guesses(plain) or not any(dependences.may_move(text, "t") for text in texts):
        return ""
    least = 2 - ("lagrangian" in plain)
    lines = [reader.tokens_if_any(text, nm.Names(guesses=True)) for text in texts]
    tokens = [token for line in lines for token in walk(line)]
    moving = {token.text for token in tokens if token.order >= least}
    moves = len(moving) > 1 and "t" in moving
    words = {token.text for token in tokens}
    return next((name for name in _PARAMETERS if moves and name not in words), "")


def _guesses(plain: Mapping[str, Any]) -> bool:
    named = plain.get("parameters")
    return named == declarations.GUESS or (
        isinstance(named, list | dict) and declarations.AND_GUESS in named
    )


_RADII = ("r", "rho", "xi")
# 2/R U and U/R with or without brackets, where U is u': never with another factor than a number.
_OVER_RADIUS = r"\(?[0-9]+\)?/(?:R|\(R\)|\([0-9]+R\))"
_RADIAL = re.compile(
    rf"(?:{_OVER_RADIUS}|\({_OVER_RADIUS}\))U|U\({_OVER_RADIUS}\)"
    r"|(?:[0-9]*U|\([0-9]*U\))/(?:R|\(R\)|\([0-9]+R\))"
)


def _radius(tokens: Line, moving: Collection[str]) -> str:
    """The r of u'' + (1/r) u' = ... and u'' + 2 u'/r = ..., of a function of a radius."""

    def shape(line: Line, radius: str) -> str:
        return "".join(
            f"({shape(token.inside, radius)})"
            if token.inside
            else "U"
            if token.text in moving and token.order == 1
            else "R"
            if token.text == radius
            else ""
            if token.is_operator("*")
            else f"{token.text}{token.order or ''}"
            for token in line
        )

    terms = split_at("+-=,;\n", tokens)
    found = (
        radius
        for radius in _RADII
        if radius not in moving and any(_RADIAL.fullmatch(shape(term, radius)) for term in terms)
    )
    return next(found, "")


def _free_variable(plain: Mapping[str, Any]) -> str:
    """The x of y'' = 6 y^2 + x, where names are guessed, one name moves, by primes, and neither t
    nor dots occur.

    So is the z of w'' = 2 w^3 + z w, a function of a complex variable, and the x of
    L = n(x) sqrt(1 + y'^2), where only y moves.
    """
    texts = [text for _, text in _placed({key: plain[key] for key in FORMULAS if key in plain}, "")]
    keys = {"equations", "lagrangian", "parameters", "name", "functions"}
    if not _guesses(plain) or not {*plain} <= keys:
        return ""
    equations = plain.get("equations")
    keyed = [str(key).rstrip("'") for key in equations] if isinstance(equations, Mapping) else []
    if len(keyed) > 1 or any("dot" in text for text in texts):
        return ""
    try:
        known = nm.Names(guesses=True)
        known = replace(
            known,
            splits=time_derivatives.moving_products(
                {str(k): text for k, text in enumerate(texts)}, known, 1
            ),
        )
        tokens = [token for text in texts for token in reader.read_tokens(text, known)]
    except errors.InputError:
        return ""
    moving = {*time_derivatives.moving_names(tokens, 1)}
    words = {token.text for token in walk(tokens) if token.kind == "name"}
    if "lagrangian" in plain and moving != {"y"}:
        return ""
    free = "z" if moving == {"w"} and "x" not in words else "x"
    free = ("x" not in words and _radius(tokens, moving)) or free
    if free in _declared(plain) or free in keyed:
        return ""
    names = nm.Names((), (free, *moving))
    starts = (k for k in range(len(tokens)) if not k or tokens[k - 1].text in (";", ",", "\n"))
    if any(spelled(tokens[k : k + 2]) == f"{free}=" for k in starts):
        return ""  # x = l sin(theta) is a definition
    occurs = any(free == word or free in nm.only_split(word, names) for word in words)
    timed = any(map(_TIMED.search, texts))
    alone = len(moving) == 1 and not moving & {"x", "X", "z"} and not timed
    siblings = {"z"} & words - {free} or any(
        re.fullmatch(r"x_?\d+", name) for name in moving
    )  # x may be a coordinate too
    return free if occurs and alone and not siblings and "\u0307" not in "".join(texts) else ""


class TimeApart(NamedTuple):
    """A document with x*y for xy, where its formulas were typed, and the products by name."""

    document: dict[str, Any]
    places: Mapping[str, Typed]
    products: dict[str, str]


def _set_time_apart(ready: Prepared, time: str) -> TimeApart:
    """The document with x*y for xy, where names are guessed and x is the time; InputError where xy
    may be a name.
    """
    plain = dict(ready.document)
    if not _guesses(plain):
        return TimeApart(plain, ready.places, {})
    texts = dict(_placed({key: plain[key] for key in FORMULAS if key in plain}, ""))
    moving = {name for text in texts.values() for name in motion.moving(text)}
    products = time_derivatives.moving_products(texts, nm.Names(guesses=True), 1)
    moving = (moving - products.keys()) | {parts[-1] for parts in products.values()}
    known = nm.Names(
        (),
        tuple({time, *_declared(plain, (*NAMES, "equations", "where")), *moving}),
    )
    found = {name: "*".join(parts) for name, parts in products.items() if time in parts}
    for pointer, text in texts.items():
        for word in renaming.plain_names("" if reader.is_latex(text) else text):
            name, column = word.text, word.start + 1
            index = name == 2 * time and text[: word.start].endswith("''")  # y''xx
            known_name = (
                name in nm.FUNCTIONS
                or name in found
                or known.role(name)
                or name[0] == "d"
                or time not in name
            )
            if known_name or index:
                continue
            if parts := nm.only_split(name, known):
                found[name] = nm.written_product(parts, known)
            elif meant := nm.readings(name, known):
                raise nm.undeclared(name, column, meant).at(pointer)
    if not found:
        return TimeApart(plain, ready.places, found)
    return TimeApart(*_with_names(plain, ready.places, found, FORMULAS), found)


def _placed(value: Any, pointer: str) -> Iterator[tuple[str, str]]:
    """Every text in a value with its pointer."""
    if isinstance(value, str):
        yield pointer, value
    elif isinstance(value, Mapping | list):
        parts = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, part in parts:
            yield from _placed(part, f"{pointer}/{key}")


# Names without a d or a prime, numbers, and the signs between them.
_WITHOUT_DERIVATIVES = re.compile(r"[A-CE-Zabce-z0-9 .,+\-*/^()]*")


def _found_time(plain: Mapping[str, Any]) -> str:
    """The x of y''(x), d^2y/dx^2, diff(y(x), x, 2), where all second derivatives are by the same
    name, and of syms y(x).
    """
    found, moving = set[str](), set[str]()
    least = 2 - ("lagrangian" in plain)  # y'(x) of a Lagrangian
    for text in _texts([plain[key] for key in FORMULAS if key in plain]):
        if _WITHOUT_DERIVATIVES.fullmatch(text):
            continue
        own = [one for one in dependences.said(text) if dependences.has_primes(text, one.name, 2)]
        found |= {one.argument for one in own}  # u = u(r)
        tokens = reader.tokens_if_any(text, nm.Names(guesses=True))
        orders = time_derivatives.derivatives(tokens)
        rated = {name for name, _, order in orders if order >= least}
        declared = {one.argument for one in dependences.declared(text) if one.name in rated}
        if len(declared) == 1 and not (declared & rated or dependences.are_called_with(text, "t")):
            found |= declared  # syms y(x); diff(y, 2) == x*y
            continue
        found |= {
            by
            for name, by, order in orders
            if order >= least and name not in _declared(plain, ("functions",))
        }
        moving |= {name for name, by, order in orders if order >= least or by == "t"}
    name = found.pop() if len(found) == 1 else "t"
    if name in _declared(plain) | moving or name in nm.FUNCTIONS | nm.DERIVATIVE_NAMES:
        return "t"
    written = frozenset().union(*(signs.of(text).texts for text in _texts(plain)))
    is_variant = f"\\var{name}" in written and f"\\{name}" not in written
    return f"var{name}" if is_variant else name  # \varphi is read as phi


def _declared(plain: Mapping[str, Any], keys: tuple[str, ...] = NAMES) -> set[str]:
    """The names that a document declares under these keys; nothing where it holds something
    else.
    """
    lists = (plain.get(key) for key in keys)
    return {
        word
        for words in lists
        if isinstance(words, list | dict)
        for word in words
        if isinstance(word, str)
    }


def _texts(value: Any) -> Iterator[str]:
    """Every text in a document, keys included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from (str(key), *_texts(part))
    elif isinstance(value, list | tuple):
        for part in value:
            yield from _texts(part)


def _words(value: Any) -> Any:
    return declarations.words_of(value) if isinstance(value, str) else value


def _parameters(value: Any) -> Any:
    if isinstance(value, str) and "=" in value:
        return declarations.parameters_of(value)
    return value if value == declarations.GUESS else _words(value)


def _functions(value: Any) -> Any:
    """ "V(x, y)", ["V(x, y)"] and {"V": "x, y"} as {"V": ["x", "y"]}."""
    if isinstance(value, list) and all(isinstance(entry, str) for entry in value):
        value = ", ".join(value)
    if isinstance(value, str):
        return declarations.functions_of(value)
    return {key: _words(part) for key, part in value.items()} if isinstance(value, dict) else value


_LOOSE: dict[str, Callable[[Any], Any]] = {
    "coordinates": _words,
    "parameters": _parameters,
    "functions": _functions,
}


# The prepared document to its schema and its system.


def to_schema(document: Any) -> SystemDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return validated(document, SystemDocument)


def to_system(schema: SystemDocument) -> SecondOrderSystem:
    """The system that a document describes; raises InputError with pointer and column."""
    from inverse_service.mechanics import second_order_system

    return second_order_system.solved_system(to_given(schema), schema.name)


def to_solvable(
    schema: SystemDocument, given: second_order_system.GivenEquations | None = None
) -> SecondOrderSystem:
    """The system of a document to be solved; its equations as given where these are Euler-Lagrange
    equations already.

    That is where the accelerations, solved for, are too long to be written, or fill pages.
    InputError as `to_system`. `given` is `to_given` of the document where it is known.
    """
    from inverse_service.field import sign_cases
    from inverse_service.mechanics import second_order_system

    given, system = given or to_given(schema), None
    asks_more = (
        schema.family
        or schema.special_cases
        or schema.kinds
        or schema.clock
        or schema.near
        or schema.nearest
    )
    is_solved = bool(asks_more) or isinstance(schema.equations, Mapping)
    try:
        system = second_order_system.solved_system(given, schema.name)
    except errors.LimitError:
        if is_solved:
            raise
    if system and (is_solved or sum(map(ex.node_count, system.accelerations)) <= _MOST_NODES):
        return system
    from inverse_service.search import row_factors  # a simulation needs no solver

    lines = second_order_system.unsolved_system(given.names, given.residuals, schema.name)
    found = (
        None
        if next(sign_cases.sign_cases(given.residuals)).roots
        else row_factors.in_own_order(lines)
    )
    if found and all(
        ex.holds(f, ex.Acceleration(q)) for q, f in zip(found.coordinates, found.given, strict=True)
    ):
        return found
    return system or second_order_system.solved_system(given, schema.name)


def to_given(schema: SystemDocument) -> second_order_system.GivenEquations:
    """The equations of the document as written; raises InputError as `to_system`."""
    from inverse_service.mechanics import second_order_system

    named = declared(schema)
    key = repr((named, schema.equations, refusals.most_characters(), refusals.most_tokens()))
    known = _GIVEN.get(key)
    if known is None:
        with reader.noted() as notes:
            found = second_order_system.read_given(named, schema.equations)
        known = _GIVEN[key] = found, notes
        for older in [*_GIVEN][:-_MOST_GIVEN]:
            _GIVEN.pop(older, None)
    reader.note_again(known[1])
    return known[0]


def declared(
    schema: Asking | LagrangianDocument, most: int = refusals.LIMITS.coordinates
) -> declarations.Declared:
    """What the document says of its names."""
    return declarations.Declared(
        schema.coordinates, schema.parameters, schema.functions, schema.where, most
    )


def to_ansatz(schema: Asking, system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    """The user's own terms of a Lagrangian as trees; raises InputError with pointer and column."""
    places = {f"/ansatz/{place}": text for place, text in enumerate(schema.ansatz)}
    terms = (
        (formula_about(text, system.names, schema, pointer), pointer)
        for pointer, text in places.items()
    )
    return tuple(
        reader.without_accelerations(term, "a term of a Lagrangian", pointer)
        for term, pointer in terms
    )


def formula_about(
    text: str, names: nm.Names, schema: NamedDocument | None, pointer: str
) -> ex.Expression:
    """A formula about the system of a document, whose parameters with values are put in; InputError
    with pointer.
    """
    named = (
        ()
        if schema is None
        else declarations.Declared(parameters=schema.parameters).named_parameters()
    )
    known = replace(names, parameters=tuple(dict.fromkeys((*names.parameters, *named))))
    with reader.placed_at(pointer):
        return declarations.with_values(
            reader.read_formula(text, known), declarations.parameter_values(named)
        )


@dataclass(frozen=True, slots=True)
class Wording:
    """The words in errors of a schema: the name of the whole, the allowed values, the sentence for
    an unknown key.

    `keys` takes from pydantic's way to a fault the steps that are no keys of the document.
    """

    whole: str
    expected: Mapping[Steps, str]
    unknown: Callable[[Steps, str], str]
    keys: Callable[[Steps], Steps]


def validated(document: Any, schema: type[Read], wording: Wording | None = None) -> Read:
    """The document in its schema; raises DocumentRefused with every fault found, at most MAX_PLACES
    in its order.
    """
    try:
        return schema.model_validate(document)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        found.sort(
            key=lambda fault: (
                fault["type"] != "extra_forbidden" or not near_key(str(fault["loc"][0]))
            )
        )
        found = found[:MAX_PLACES]
        raise errors.DocumentRefused(
            tuple(_place(fault, wording or _of_systems(schema)) for fault in found)
        ) from None


def _place(fault: ErrorDetails, wording: Wording) -> errors.Place:
    """The fault in a sentence, which never holds a value of the input."""
    kind, steps = fault["type"], wording.keys(fault["loc"])
    where = f"'{'/'.join(plain_data.escape(step) for step in steps)}'" if steps else wording.whole
    code, expected = "bad-input", f"it must be {_expected(steps, wording.expected)}."
    if kind == "missing":
        sentence = f"The key {where} is missing; {expected}"
    elif kind == "extra_forbidden":
        sentence = wording.unknown(steps, where)
    elif kind.endswith("too_long"):
        code, counted = "limit", "characters" if kind.startswith("string") else "entries"
        sentence = (
            f"{where} is too long: at most {fault['ctx']['max_length']} {counted} are accepted."
        )
    elif kind.endswith("too_short"):
        sentence = f"{where} must not be empty; {expected}"
    else:
        sentence = f"{where} has the wrong type or value; {expected}"
    return errors.Place(
        sentence, "".join(f"/{plain_data.escape(step)}" for step in steps), None, code
    )


def _of_systems(schema: type[base.Document]) -> Wording:
    def unknown(steps: Steps, where: str) -> str:
        if steps[0] in BESIDE and "constraints" in schema.model_fields:
            return BESIDE[str(steps[0])]
        if steps[0] in OF_SCENES:
            return (
                f"The key {where} belongs to a scene, which 'simulate' runs. To solve the equations of this motion, "
                "write its forces into 'equations'."
            )
        if len(steps) == 1 and (meant := near_key(str(steps[0]))):
            return f"The key {where} is not known here: did you mean '{meant}'?"
        keys = ", ".join((*schema.model_fields, *ALSO))
        return f"The key {where} is not known here; a {TITLES.get(schema.__name__, 'system')} has the keys {keys}."

    return Wording(
        "The document", EXPECTED, unknown, lambda steps: without(steps, NOT_IN_THE_DOCUMENT)
    )


def without(steps: Steps, hidden: Container[Any]) -> Steps:
    """The steps that are keys of the document."""
    return tuple(step for step in steps if step not in hidden)


def _expected(steps: Steps, table: Mapping[Steps, str]) -> str:
    """The entry of the last of the steps that the table contains."""
    path: Steps = ()
    for step in steps:
        further = (*path, "*" if (*path, "*") in table else step)
        if further not in table:
            break
        path = further
    return table[path]
