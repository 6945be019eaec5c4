"""From a document as people write it to its schema and to the system that it describes.

`prepared` converts the looser notation of users: a text that gives L, or T and V, or equations with multipliers; and
another name of the time. Inside, the time is t: a document that calls it tau (`"time": "tau"`, or y''(tau) in every
equation) is renamed on the way in and its result on the way out; a coordinate called t then has a name that the
document does not use. `to_schema` and `to_system` take the prepared document; each fault is one sentence and its place.
"""

from __future__ import annotations

import difflib
import json
import re
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from math import perm
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from api_schemas import base
from api_schemas.system import (
    MAX_SERIES_ORDER,
    TAGS,
    MotionDocument,
    NamedDocument,
    NonholonomicDocument,
    SystemDocument,
)
from inverse_service import errors
from inverse_service.expressions import collecting, derivative, letters, notation, printing, refusals, tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import euler_lagrange, position_constraints, second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import components, document_names, names as nm, reader
from inverse_service.reading.tokens import at, spelled, walk
from inverse_service.service.documents import plain_data

Read = TypeVar("Read", bound=base.Document)
Asking = SystemDocument | NonholonomicDocument | MotionDocument
Steps = tuple[int | str, ...]
FORMULAS = ("equations", "lagrangian", "constraints", "ansatz", "multiples", "where", "clock", "motion", "kinds")
SCENE_FORMULAS = ("forces", "rayleigh", "observe", "events", "terms", "functions", "free_lagrangian")
NAMES = ("coordinates", "parameters", "functions")
# Not for people, or not ours to change.
KEPT = frozenset(("certificate", "provenance", "given", "format", "question", "id", "kind", "time", "verdict"))
_LETTERS = "wzkbcudhgnalsTYZWJKBUDGNCP"
_TIMED = re.compile(r"(?<![A-Za-z\\])d?t(?![A-Za-z])")
_PLAIN_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_\u2080-\u2089]*")
_LATEX_WORD = re.compile(r"(_\{?)?(\\?[A-Za-z]+)")
# A name at the beginning of a word, behind a number; one inside. No long word may take time that grows with its square.
_FIRST = r"\b\d*([A-Za-z\u0391-\u03c9]\w*)"
_MOVING = re.compile(rf"{_FIRST}(?:\s*['\u2032\u2033]|_?d?dot\b)")
_MOVES = re.compile(rf"{_MOVING.pattern}|\\dot|[\u0307\u1e8b\u1e8f\u017c]|d[A-Za-z]\w*\s*/\s*dt")
_BARE = re.compile(rf"{_FIRST}(?:''|\u2033)(?!\s*[\[(])|\\ddot\s*\{{?\\?([A-Za-z]+)|{_FIRST}_?ddot\b")
# Of documents of every kind.
KEYS = frozenset((
    *("name", "coordinates", "parameters", "functions", "where", "equations", "lagrangian", "constraints", "motion"),
    *("time_dependent_lagrangian", "ansatz", "series_order", "special_cases", "clock", "kinds", "near", "associated"),
    *("multiples", "time", "id", "options", "metadata", "search", "first_integrals", "catalogue", "format"),
))  # fmt: skip
_SCRIPT_L = r"\\(?:mathcal|mathscr|mathrm|cal)\s*(?:\{L\}|L)(?![A-Za-z])"
_LETTER_L = re.compile(
    rf"(?:\{{\s*{_SCRIPT_L}\s*\}}|{_SCRIPT_L}|[\u2112\U0001d4db])"
    r"|(?P<named>\bL(?:agrangian)?\s*:(?:\s*L\s*)?=?|\bLagrangian\s*=)"
)
# D = span{∂_x + y ∂_z, ∂_y}, the directions that are allowed, and each ∂_x in it
_SPAN = re.compile(
    r"(?:\\math[a-z]{1,5}\s{0,3}\{?\s{0,3})?[D\u0394]\w?\}?(?:_\{?\w\}?)?\s*=\s*\\?(?:mathrm|operatorname|text)?\s*\{?\s*span\s*\}?\s*"
    r"(?:\\left)?\\?[{(](?P<fields>(?:[^{}]|\{[^{}]*\})*?)(?:\\right)?\\?[})](?=\s*(?:[;,.\n\\]|$))"
)
_FIELD = re.compile(
    r"(?:\\[dt]?frac\s*\{\s*)?(?:\u2202|\\partial)[\s}{]*(?:/?[\s(]*(?:\u2202|\\partial)\s*|_\{?)(\\?\w+)[)}]?"
)
# L, T, and V with an argument perhaps, and =; half of 2 T = … is meant.
_ENERGY = re.compile(
    r"(?:\$+|\\\[|\s|\\begin\s*\{\w+\*?\})*(?P<twice>2\s*)?(?:(?P<whole>L)|(?P<kinetic>[TK]|KE|E_\{?k(?:in)?\}?)"
    r"|(?P<potential>[UV\u03a0]|PE|\\Pi|Pi|E_\{?p(?:ot)?\}?))(?P<arguments>\s*\([^()=]*\))?\s*&?\s*"
    r"(?:=(?!=)|\u2261|\\(?:equiv|triangleq|coloneqq)(?![A-Za-z])|\\(?:stackrel|overset)\s*\{[^{}]*\}\s*\{\s*=\s*\})"
)
# The T - V of L = T - V = …
_ENERGIES = re.compile(
    r"(?:[\s&]*[-+\u2212]?[\s&]*(?:\\(?:mathcal|mathrm)\s*)?\{?[TKUVE]\}?(?:_\{?\w+\}?)?\s*(?:\([^()=]*\))?)+\s*&?\s*="
)
# The components of a vector, \mathbf{r} = (x, y, z) and r = (x, y, z)
_VECTOR = re.compile(
    rf"(?:\\(?:{'|'.join(components.BOLD)})\s*(?:\{{\s*\\?\w+\s*\}}|\\?\w)|(?<![\w\\)'])\w+)\s*=\s*(?:\\left\s*)?\([^()=,]+,[^()=]*\)"
)
_GIVEN = re.compile(rf"(?:\b(?:for|with|where|and)\s+)?{_VECTOR.pattern}")
# d/dt ∂L/∂x' - ∂L/∂x = 0 and δ∫L dt = 0 beside L = …
_D = r"(?:d|\\(?:mathrm|text)\s*\{\s*d\s*\}|\\(?:rm|mathrm)\s+d)"
# A metric, ds^2 = dr^2 + r^2 dphi^2, whose geodesics are meant: 2 L = (ds/dt)^2
_METRIC = re.compile(rf"(?<![A-Za-z\\]){_D}\s?s\s*(?:\^2|\^\{{2\}}|\u00b2)\s*(?==|&\s*=)")
_DIFFERENTIAL = re.compile(rf"(?<![A-Za-z\\]){_D}\s?(\\[A-Za-z]+|[^\W\d_][^\W\u00b2\u00b3]*)(?:_\w|_\{{\w+\}})?")
# d/dt dL/dx', and dL/dx; the end of an equation.
_PARTIAL = r"(?:\u2202|\\partial|\bd)\s{0,9}"
_BY = r"((?:\\d?dot\s{0,9})?\{?[^\s+\-\u2212=(){}\[\],;*/]{1,30}\}?(?:_\{?\w{1,9}\}?)?)"
_SLOPE = rf"(?:\\[dt]?frac\s*\{{\s*{_PARTIAL}L\s*\}}\s*\{{\s*{_PARTIAL}{_BY}\s*\}}|{_PARTIAL}L\s*/\s*{_PARTIAL}{_BY})"
_BRACKET = r"\s{0,9}(?:\\(?:left|right|[bB]igg?[lr]?)\s{0,9})?"
_IN_TIME = rf"(?:\\[dt]?frac\s*\{{\s*{_D}\s*\}}\s*\{{\s*{_D}\s*t\s*\}}|{_D}\s*/\s*{_D}\s*t)"
_RATE = rf"{_IN_TIME}{_BRACKET}[(\[{{]?\s{{0,9}}{_SLOPE}(?:{_BRACKET}[)\]}}])?"
_ENDS = r"\s{0,99}(?:$|(?<!\\)[;,]|[\n$]|\.(?=\s|$)|\\q?quad|\\[\\\])]|\\end|\b(?:with|where|and|for)\b)"
# Terms before the d/dt of an equation of Lagrange, from the beginning of the equation.
_BEFORE = r"(?:(?<![^;,\n$\]])|(?<=quad)|(?<=\\\\))(?:(?!\\q?quad|\\\\)[^;,\n=$]){0,120}?[-+\u2212]\s*"
_OTHER_SIDE = r"[^;,\n=]{1,120}?"
_LAGRANGES_EQUATION = re.compile(
    rf"(?:\\delta|\u03b4)\s*(?:\\int|\u222b)[^;\n=LT]{{0,60}}L[^;\n=L]{{0,40}}{_D}\s*t\s*=\s*0(?={_ENDS})"
    rf"|(?:{_BEFORE})?{_RATE}[^;,\n=]{{0,120}}={_OTHER_SIDE}(?={_ENDS})"
    rf"|(?<![^;,\n$\]]){_OTHER_SIDE}=(?:{_OTHER_SIDE}[-+\u2212])?[\s&]*{_RATE}(?:\s*[-+\u2212]{_OTHER_SIDE})?(?={_ENDS})"
)
_OF_RATE, _OF_SLOPE = (re.compile(rf"([-+\u2212]?)[\s&]*{part}") for part in (_RATE, _SLOPE))
# dF/dx' of a function of Rayleigh
_DISSIPATED = re.compile(
    rf"(?:\\[dt]?frac\s*\{{\s*)?{_PARTIAL}([A-Z])(?![A-Za-z])\s*(?:/\s*{_PARTIAL}{_BY}|\}}\s*\{{\s*{_PARTIAL}{_BY}\s*\}})"
)
_MARKS = re.compile(r"\\d?dot|['\u2032\u0307\\{}\s]|_?dot$")
_WORDS_AT_THE_END = re.compile(r"\s\([A-Za-z -]{4,}\)\s*$")
_WRAPPER_ENDS = re.compile(r"(?:\$+|\\[\],;:! ]|\\end\s*\{\w+\*?\}|[\s;,.])*$")
# dx and d\theta, in dz = y dx and dz = ydx; \delta x is a virtual displacement, or asked about
_FORM = re.compile(r"(?<![A-Za-z\\][A-Za-z])(?<!\\)d(?:[A-Za-z]|\s*\\)|(?:\u03b4|\bdelta\s)\s*[\w\\]")
_OF_A_FORM = re.compile(r"\s*(?:d|\u03b4)")
_DEFINED = re.compile(
    r"\s*\\?([A-Za-z\u0391-\u03c9][^\W\u00b2]*(?:_\{\w+\})?)(?:(\([^()]*\))|(\^2|\^\{2\}|\u00b2))?\s*"
)
_IS_NUMBER = re.compile(r"[^=]*=[\s\d./-]*")
_LAMBDA = re.compile(r"lambda|Lambda|\bmu|\\mu|[\u03bb\u03bc\u039b]")
_STRUCTURE = frozenset(("text", "latex"))
# A letter with its derivatives and the digit above it: \ddot{q}^1, q\u0307\u00b9, x^{1}''
_HIGH = "\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
_ABOVE = re.compile(
    rf"(?P<dot>\\d?dot[\s{{]*)?(?P<letter>\\[A-Za-z]+|[^\W\d_{_HIGH}])(?P<dots>[\u0307\u0308]*)(?:[\s}}]{{0,9}}"
    rf"(?:\^\s?(?:\{{(?=\d\}}))?(?=\d)|(?=[{_HIGH}]))(?P<digit>\w)(?!\.?[\d{_HIGH}])\}}?(?P<primes>'*))?"
)
_LOWERED = str.maketrans(f"^{_HIGH}", "_\u2081\u2082\u2083\u2084\u2085\u2086\u2087\u2088\u2089")
# Equations of motion with multipliers as L and constraints: x'' = lambda sin(u), ..., x' sin(u) = y' cos(u). Without
# multipliers the lines are the Euler-Lagrange equations of a Lagrangian L, each times a factor. The force with each
# multiplier has to be a multiple of the form w_i v^i of one constraint (d'Alembert's principle): then the motion is
# that of L with the constraints.
_ZERO = re.compile(r"(?:^|(?<=[,;\n]))\s*([A-Za-z])\s*=([^=,;\n]+)(?==\s*0)")  # f = x^2 + y^2 - l^2 = 0
_MULTIPLIER = re.compile(r"(?:lambda|mu|Lambda)(?:_?\w+)?")
# Nodes of all accelerations, beyond which they are unreadable; on a cart two links have 1,748, three 14,834.
_MOST_NODES = 5_000
_MOST_PRODUCTS = 10_000  # of entries of vector fields
MAX_PLACES = 10
NOT_IN_THE_DOCUMENT = frozenset({*TAGS, "[key]"})
ALSO = ("time", "id", "options")
TITLES = {"NonholonomicDocument": "nonholonomic system", "LagrangianDocument": "Lagrangian"}
_IN_WORDS = (Path(base.__file__).parent / "expected.json").read_text(encoding="utf-8")
# The values allowed at these steps, in words; "*" is any key or place.
EXPECTED: dict[Steps, str] = {
    **{tuple(filter(None, place.split("/"))): words for place, words in json.loads(_IN_WORDS).items()},
    ("series_order",): f"an integer from 1 to {MAX_SERIES_ORDER}",
}

# Questions about equations of second order, which a document with constraints does not have.
BESIDE = {
    "kinds": "Kinds of Lagrangians are asked about equations: give those of an associated or of the reduced system, "
    "which the result of this document without 'kinds' has.",
    "clock": "With constraints the clock is found, see 'reduced' of the result: leave 'clock' out, or give the "
    "equations of the reduced system.",
}


def near_key(key: str) -> str:
    """The key that was meant by one that is spelled nearly so; else nothing."""
    return "" if key in KEYS else next(iter(difflib.get_close_matches(key, sorted(KEYS), 1, 0.75)), "")


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
    """A document for the schemas, what its time and a coordinate t were called, its id, and whence formulas come.

    `places` are the pointers of the texts that formulas were taken from.
    """

    document: Any
    time: str = "t"
    other: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)
    readings: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)

    def outward(self, result: dict[str, Any]) -> dict[str, Any]:
        """The result in the words of the writer."""
        found = result
        if self.time != "t":
            found = _changed(result, {"t": self.time, self.other: "t"})
            if isinstance(found.get("system"), dict):
                found["system"] = {**found["system"], "time": self.time}
        return {**found, **self.extra}

    def error(self, error: errors.InputError) -> errors.InputError:
        """The refusal in the words of the writer, at its place in what was written."""
        if type(error) not in (errors.InputError, errors.LimitError):
            return error  # the shape of a document is refused in its own words
        error = error.placed(self.places[error.pointer]) if error.pointer in self.places else error
        if self.time == "t":
            return error
        names = {"t": self.time, self.other: "t"}
        texts = (error.detail, error.plain, *error.instead)
        detail, plain, *instead = (_in_plain_text(text, names, pad=False) for text in texts)
        return error.said(detail, plain, error.pointer, tuple(instead))


@dataclass(frozen=True, slots=True)
class _Energy:
    """L = …, T = …, or V = … of a text: the match up to the formula, the formula at its columns, and the pointer."""

    named: re.Match[str]
    formula: str
    pointer: str


@dataclass(frozen=True, slots=True)
class _Written:
    """What texts give: energies by kind, and all other equations, each with the pointer of its text.

    `forces` are the Q of d/dt dL/dx' - dL/dx = Q, by x, and by x' those of d/dt dL/dx' = Q; `fields` span the
    directions that are allowed.
    """

    energies: dict[str, _Energy] = field(default_factory=dict)
    others: list[tuple[str, str]] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    forces: dict[str, str] = field(default_factory=dict)
    fields: dict[str, str] = field(default_factory=dict)

    def gives_lagrangian(self) -> bool:
        """Whether there is an L, or a T and something that moves, and no equation of second order."""
        formulas = [*(line for _, line in self.others), *(energy.formula for energy in self.energies.values())]
        moves = "kinetic" in self.energies and any(map(_MOVES.search, formulas))
        return ("whole" in self.energies or moves) and not any(map(_BARE.search, formulas))

    def lagrangian(self) -> str:
        """L, or T - V, at the columns of its parts."""
        if "whole" in self.energies:
            named, formula = self.energies["whole"].named, self.energies["whole"].formula
            return f"{'.5*('.rjust(named.end())}{formula})" if named["twice"] else " " * named.end() + formula
        lagrangian = ""
        for energy in self.energies.values():
            sign = ("-" if energy.named["potential"] else "+") + (".5*(" if energy.named["twice"] else "(")
            lagrangian = lagrangian.ljust(energy.named.end() - len(sign)) + sign + energy.formula + ")"
        return lagrangian


def _with_lagrangian(plain: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str], dict[str, str]]:
    """A text that gives L, or T and V, as the document of that Lagrangian; its other lines define names or hold it.

    With it, by the pointer of each of these formulas, that of the text that contains it at the same columns; and what
    is read differently.
    """
    key = "lagrangian" if "lagrangian" in plain else "equations"
    given, declared = plain.get(key), _declared(plain)
    texts = {f"/{key}": given} if isinstance(given, str) else {}
    if isinstance(given, list) and all(isinstance(text, str) for text in given):
        texts = {f"/{key}/{place}": text for place, text in enumerate(given)}
    found = _written(texts, declared)
    if any("L" in document_names.moving_names(reader.tokens_if_any(line, nm.Names()), 1) for _, line in found.others):
        return plain, {}, {}  # dL/dt = 0 is about a momentum L
    if not found.gives_lagrangian():
        if key == "lagrangian" or "constraints" in plain:
            return plain, {}, {}
        if any(map(_LAMBDA.search, texts.values())):
            return _with_multipliers(plain, texts)
        return (plain, {}, {}) if found.energies else _as_motion(plain, texts, found.others)
    is_whole, lagrangian, others, notes = "whole" in found.energies, found.lagrangian(), [*found.others], found.notes
    if is_whole:
        beside = (energy for kind, energy in found.energies.items() if kind != "whole")
        others += [(energy.pointer, energy.named[0] + energy.formula) for energy in beside]
    velocities = document_names.moving_names(reader.tokens_if_any(lagrangian, nm.Names()), 1)
    places = {"/lagrangian": next(iter(found.energies.values())).pointer}
    held = plain.get("constraints") or []
    constraints = [held] if isinstance(held, str) else list(held)
    for pointer, text in found.fields.items():
        with reader.placed_at(pointer):
            constraints += _held_by_fields(text, velocities)
    definitions, where = _definitions(others, {*velocities}), dict[str, str]()
    forces = [_DISSIPATED.sub(r"\1", force) for force in found.forces.values()]
    for pointer, line in others:
        name, squared = _defined(line, {*velocities})
        if name and definitions[name] is line and not (squared and name in velocities):  # y^2 = l^2 - x^2 has two roots
            left, _, right = line.partition("=")
            if name in velocities and document_names.moving_names(reader.tokens_if_any(right, nm.Names()), 1):
                raise refusals.fault("definition by velocities", pointer, name=name)
            root = ("(", ")^{1/2}" if reader.is_latex(right) else ")^(1/2)") if squared else ("", "")
            where[name] = root[0].rjust(len(left) + 1) + right + root[1]
            places[f"/where/{name}"] = pointer
        else:
            places[f"/constraints/{len(constraints)}"] = pointer
            constraints.append(line)
    for place, (pointer, line) in enumerate(others):
        _ask_about_rate(line, pointer, lagrangian, {"t", *declared})
        if line in definitions.values():
            energy = _ENERGY.match(line)
            rest = [text for k, (_, text) in enumerate(others) if k != place]
            whole = lagrangian if is_whole and energy and energy["potential"] else ""
            if _is_unused(line, pointer, [lagrangian, *rest, *forces], {*velocities}, whole):
                notes[line.strip()] = reader.LEFT_OUT
    vectors = [f", {vector[0]}" for text in texts.values() for vector in _VECTOR.finditer(text)]
    lagrangian, *constraints = (
        "".join([text, *(vector for vector in vectors if _has_vector(text, vector))])
        for text in (lagrangian, *constraints)
    )
    rates = [(pointer, line) for pointer, line in others if line in constraints]
    _ask_about_speed(rates, lagrangian, {*declared, *definitions})
    with reader.placed_at(places["/lagrangian"]):
        _check_multipliers(found.forces, lagrangian, constraints, declared if is_whole else None)
    made = {**{name: value for name, value in plain.items() if name != key}, "lagrangian": lagrangian}
    if where:
        made["where"] = {**plain.get("where", {}), **where}
    if len(others) > len(where) or found.fields:
        made["constraints"] = constraints
    elif any(force.strip() != "0" or name[-1] == "'" for name, force in found.forces.items()):
        try:
            read = {line: "an equation of motion" if _OF_RATE.search(line) else words for line, words in notes.items()}
            return _with_forces(made, found.forces), {}, read
        except errors.InputError as error:
            raise error.placed(places["/lagrangian"]) from None
    return made, places, notes


def _with_forces(plain: dict[str, Any], forces: Mapping[str, str]) -> dict[str, Any]:
    """The equations d/dt(dL/dq') - dL/dq = Q of L with generalized forces Q, by q; InputError where one is missing."""
    texts = {f"/forces/{name}": _DISSIPATED.sub(r"\1", text) for name, text in forces.items()}
    try:
        declared = document_names.Declared(**{key: plain[key] for key in (*NAMES, "where") if plain.get(key)})
        known = document_names.known_names(declared, {"/lagrangian": plain["lagrangian"], **texts}, 1)
        names = known.names
        lagrangian = known.put_in(reader.read_formula(plain["lagrangian"], replace(names, energy=True)))
        given = dict(_read_force(name, text, lagrangian, known) for name, text in forces.items())
    except (TypeError, AttributeError):  # the shapes of declarations are refused by the schemas
        return plain
    names = known.remaining()
    if missing := [name for name in names.coordinates if name not in given]:
        what = f"d/dt(dL/dq') - dL/dq = Q is not given for q = {', '.join(missing)}"
        raise errors.InputError(f"{what}: write it for each coordinate, with 0 where there is no force.")
    accelerations = [ex.Acceleration(name) for name in names.coordinates]
    sums = euler_lagrange.euler_lagrange_sums(lagrangian, names.coordinates, accelerations)
    sides = [(collecting.collect(tree), given[name]) for name, tree in zip(names.coordinates, sums, strict=True)]
    kept = {key: part for key, part in plain.items() if key not in ("lagrangian", "where")}
    equations = [f"{printing.to_text(left)} = {printing.to_text(right)}" for left, right in sides]
    return {**kept, "coordinates": list(names.coordinates), "equations": equations}


def _read_force(
    name: str, text: str, lagrangian: ex.Expression, known: document_names.Known
) -> tuple[str, ex.Expression]:
    """(x, Q) of a force by x, and of one by x', to which dL/dx does not belong; with dF/dx' of a defined F."""
    names, latex = known.names, reader.is_latex(text)

    def slope(match: re.Match[str]) -> str:
        dissipated = known.definitions.get(ex.Symbol(names.spelling(match[1])))
        if dissipated is None:
            raise errors.InputError(f"{match[1]} is differentiated here and is not given: write {match[1]} = … too.")
        by = unicodedata.normalize("NFD", match[2] or match[3])
        kind = ex.Velocity if re.search("dot|['\u2032\u0307]", by) else ex.Symbol
        found = derivative.differentiate(dissipated, kind(names.spelling(_plain_name(by))))
        return f"({printing.to_latex(found) if latex else printing.to_text(found)})"

    force = known.put_in(reader.read_formula(_DISSIPATED.sub(slope, text), names))
    coordinate = names.spelling(name.rstrip("'"))
    literal = derivative.differentiate(lagrangian, ex.Symbol(coordinate)) if name.endswith("'") else ex.ZERO
    return coordinate, force - literal


def _plain_name(written: str) -> str:
    r"""q of \dot{q}, q', and q with a dot."""
    return _MARKS.sub("", unicodedata.normalize("NFD", written))


def _written(texts: Mapping[str, str], declared: Container[str]) -> _Written:
    """The parts of the texts, each at the columns that it has there; a metric ds^2 = … gives 2 L = … ."""
    found = _Written()
    for pointer, text in texts.items():
        text = _LETTER_L.sub(_letter_l, text)
        if metric := _METRIC.search(text):
            text = _METRIC.sub(lambda metric: "2L".ljust(len(metric[0])), text)
            with reader.placed_at(pointer):
                text = _DIFFERENTIAL.sub(_velocity, text)
            found.notes[metric[0].strip()] = "a metric, whose geodesics are meant"
        omitted = [match[0].strip() for match in _LAGRANGES_EQUATION.finditer(text)]
        found.notes.update(dict.fromkeys(omitted, reader.LEFT_OUT))
        with reader.placed_at(pointer):
            found.forces.update(force for line in omitted if (force := _force(line)) is not None)
        if span := _SPAN.search(text):
            found.fields[pointer] = span["fields"]
            text = text[: span.start()] + " " * len(span[0]) + text[span.end() :]
        with reader.noted() as noted:
            lines = _lines(_LAGRANGES_EQUATION.sub(lambda match: " " * len(match[0]), text))
        found.notes.update(noted)
        for line in lines:
            named = _ENERGY.match(line)
            kind = next((kind for kind in ("whole", "kinetic", "potential") if named and named[kind]), "")
            if named is None or kind in found.energies or named[kind] in declared:
                found.others.append((pointer, line))
            else:
                formula = line[named.end() :]
                summed = _ENERGIES.match(formula)
                formula = formula[summed.end() :].rjust(len(formula)) if summed else formula
                found.energies[kind] = _Energy(named, formula, pointer)
    return found


def _force(line: str) -> tuple[str, str] | None:
    """(x, Q) of d/dt dL/dx' - dL/dx = Q, with all other terms of the equation in Q, or (x', Q) without dL/dx."""
    rate = _OF_RATE.search(line)
    if rate is None:  # a variation of the action
        return None
    sides, name = line.replace(rate[0], " ", 1).split("="), ""
    is_positive = (rate[1] in ("", "+")) is not ("=" in line[: rate.start()])
    for place, plus in enumerate((not is_positive, is_positive)):
        if slope := _OF_SLOPE.search(sides[place]):
            if name or (slope[1] in ("", "+")) is not plus:
                raise errors.InputError("dL/dx has the other sign here: write d/dt(dL/dx') - dL/dx = Q, Q the force.")
            name = slope[2] or slope[3]
            sides[place] = sides[place].replace(slope[0], " ", 1)
    sides = [f"0 {side}" if side[:1] in ("", *"+-\u2212") else side for side in (side.strip(" &") for side in sides)]
    left, right = sides if is_positive else reversed(sides)
    force = f"{right} - ({left})" if left.strip() != "0" else right
    name, velocity = _plain_name(name), _plain_name(rate[2] or rate[3])
    return name or f"{velocity}'", force


def _definitions(lines: Sequence[tuple[str, str]], moving: Collection[str]) -> dict[str, str]:
    """The line that defines each name: of omega = psi' cos(theta) + phi', omega = 0 the second is a constraint."""
    found: dict[str, str] = {}
    for _, line in lines:
        if (name := _defined(line, moving)[0]) and _IS_NUMBER.fullmatch(found.get(name, "=")):
            found[name] = line
    return found


def _held_by_fields(text: str, moving: Sequence[str]) -> list[str]:
    """The constraints of a distribution that vector fields span: det(v, X_1, …, X_r) = 0 in r + 1 coordinates."""
    velocity = r" \\dot{\1} " if reader.is_latex(text) else r" \1' "
    fields = [_FIELD.sub(velocity, field) for _, field in notation.split_outside(text, ",")]
    tokens = [token for field in fields for token in walk(reader.read_tokens(field))]
    coordinates = tuple(dict.fromkeys([*moving, *document_names.moving_names(tokens, 1)]))
    words = {token.text for token in tokens if token.kind == "name"}
    names = nm.Names(coordinates, tuple(words - nm.FUNCTIONS - {*coordinates}))
    parts = [euler_lagrange.linear_parts(reader.read_formula(field, names), ex.Velocity) for field in fields]
    rows = [part[0] for part in parts if isinstance(part, tuple) and part[1] == ex.ZERO]
    columns = [(v, *(row.get(v, ex.ZERO) for row in rows)) for v in map(ex.Velocity, coordinates)]
    minors: dict[tuple[tuple[ex.Expression, ...], ...], ex.Expression] = {}
    if len(rows) == len(fields) and perm(len(columns), len(rows)) <= _MOST_PRODUCTS:
        choices = combinations(columns, len(rows))
        minors = {chosen: collecting.determinant([each[1:] for each in chosen]) for chosen in choices}
    chosen = min(
        (each for each in minors if minors[each] != ex.ZERO), key=lambda each: ex.node_count(minors[each]), default=None
    )
    if chosen is None:
        what = "the vector fields of D are not independent sums of functions times d/dx"
        raise errors.InputError(f"{what}: write the constraints instead.")
    found = [printing.to_text(collecting.determinant([*chosen, one])) + " = 0" for one in columns if one not in chosen]
    letter = {plain: variant for variant, plain in letters.ALIKE.items() if f"\\{variant}" in text}
    return [_in_plain_text(line, letter, pad=False) for line in found] if letter else found


def _check_multipliers(
    forces: Mapping[str, str], lagrangian: str, constraints: Sequence[str], known: Collection[str] | None
) -> None:
    """InputError where the lambda y of d/dt dL/dx' - dL/dx = lambda y, by x, is no reaction of a constraint.

    So it is where a lambda that is not known multiplies a constraint in L.
    """
    texts = {"/lagrangian": lagrangian, **{f"/constraints/{k}": text for k, text in enumerate(constraints)}}
    texts |= {f"/forces/{name}": text for name, text in forces.items()}
    try:
        names = document_names.known_names(document_names.Declared(parameters="guess"), texts, 1).names
        pairs = [pair for text in constraints for pair in reader.read_equations(text, replace(names, forms=True))]
        given = {names.spelling(name.rstrip("'")): reader.read_formula(text, names) for name, text in forces.items()}
        whole = reader.read_formula(lagrangian, replace(names, energy=True))
    except errors.InputError:
        return  # reported where it is read
    multipliers = [ex.Symbol(name) for name in names.parameters if _MULTIPLIER.fullmatch(name)]
    free = dict.fromkeys(multipliers, ex.ZERO)
    if constraints and any(ex.substitute(force, free) != ex.ZERO for force in given.values()):
        raise errors.InputError("A force next to a constraint is not accepted here: give the equations of motion.")
    places = [place for place, name in enumerate(names.coordinates) if name in given]
    forms = [[row[k] for k in places] for row in _rows([left - right for left, right in pairs], names.coordinates)]
    for multiplier in multipliers:
        force = [derivative.differentiate(given[names.coordinates[k]], multiplier) for k in places]
        if any(entry != ex.ZERO for entry in force) and not any(_are_parallel(force, form) for form in forms):
            what = f"the right sides with {multiplier.name} are no reaction of a constraint"
            raise errors.InputError(f"{what}: write those of d'Alembert, or leave these equations out.")
        if known is not None and multiplier.name not in known:
            _ask_about_multiplied(whole, multiplier, [left - right for left, right in pairs], lagrangian, names)


def _ask_about_multiplied(
    whole: ex.Expression, multiplier: ex.Symbol, held: Sequence[ex.Expression], text: str, names: nm.Names
) -> None:
    """InputError for the lambda of L + lambda (x^2 + y^2 - l^2): of this constraint, or a constant.

    A constant would not multiply a term in which nothing moves.
    """
    slope = derivative.differentiate(whole, multiplier)
    parts = slope.factors if isinstance(slope, ex.Product) else (slope,)
    terms = [term for part in parts if isinstance(part, ex.Sum) for term in part.terms]
    moving = {ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Velocity, names.coordinates)}
    still = [term for term in terms if not moving & {*ex.walk(term)} and ex.has(term, ex.Symbol)]
    is_held = any(_is_zero(slope - tree) or _is_zero(slope + tree) for tree in held)
    if not is_held and not (still and all(isinstance(part, ex.Number | ex.Sum) for part in parts)):
        return
    rest = printing.to_text(ex.substitute(whole, {multiplier: ex.ZERO}))
    meant = rest if is_held else f"{rest}; {printing.to_text(slope)} = 0"
    found = _LAMBDA.search(text)
    column, span = found.start() + 1 if found else 1, (len(text) - len(text.lstrip()) + 1, len(text.rstrip()) + 1)
    what = f"{multiplier.name} could be a multiplier of a constraint, or a constant; it occurs"
    instead = f"write the constraint beside L, and L without {multiplier.name}"
    raise refusals.refusal(what, column, instead, (meant,), span, "parameters")


def _defined(line: str, moving: Collection[str]) -> tuple[str, bool]:
    """The name, with its argument, that a line defines, and whether it gives its square; no name for a constraint."""
    left, equal, right = line.partition("=")
    displaced = _OF_A_FORM.match(left) and _FORM.search(right)
    form = displaced or reader.names_in_forms(left) or {*moving} & reader.names_in_forms(right)
    found = _DEFINED.fullmatch(left.removesuffix(":")) if equal and not form else None
    if found is None or found[1] in nm.FUNCTIONS or nm.Names().derivative(found[1], known=False):
        return "", False
    return found[1] + (found[2] or ""), found[3] is not None


def _is_unused(line: str, pointer: str, others: Sequence[str], moving: Collection[str], whole: str) -> bool:
    """Whether no other line uses a definition, which changes nothing, as omega = sqrt(k/m) and omega = theta'.

    InputError for F = -c x' or F = cos(t), and for V = … beside an L, perhaps meant without V. `whole` is that L.
    """
    tokens = reader.tokens_if_any(line, nm.Names())
    first, formula = at(tokens, 0), [token for token in walk(tokens[2:]) if token.kind == "name"]
    words = [token.text for text in others for token in walk(reader.tokens_if_any(text, nm.Names()))]
    used = any(word == first.text or (first.text in word and word.isalpha()) for word in words)
    names = [token.text for token in formula if token.text not in nm.FUNCTIONS]
    moves = any(token.order for token in formula) or any(word[-1] == "t" for word in names)
    moves = moves or any(name in word for word in names for name in moving)
    if used or not moves or (len(tokens) == 3 and tokens[2].order):
        return not used
    what, written = f"{first.text} = … is given and nothing uses {first.text}", whole.rstrip(" \t\n.,;")
    if not written.strip():
        instead = "put it into L, or leave it out; a force belongs into equations of motion"
        raise refusals.refusal(what, first.column, instead).at(pointer)
    span = (len(written) - len(written.lstrip()) + 1, len(written) + 1)
    meant, instead = f"{written.strip()} - {first.text}", f"write {first.text} into L, or leave it out"
    raise refusals.refusal(what, first.column, instead, (meant,), span).at(pointer)


def _has_vector(text: str, given: str) -> bool:
    """Whether the text contains the name that r = (x, y) gives, and a bold letter if that name is bold."""
    *_, name = re.findall(r"\w+", given.partition("=")[0])
    bold = components.holds_vector
    return re.search(rf"(?<![A-Za-z]){name}(?![A-Za-z])", text) is not None and (bold(text) or not bold(given))


def _ask_about_rate(line: str, pointer: str, lagrangian: str, known: Collection[str]) -> None:
    """InputError for phi' = omega where L has omega and no phi': it defines omega, or holds phi' constant.

    Names that are known, or move in L, have one meaning.
    """
    try:
        line_tokens, inside = reader.read_tokens(line), reader.read_tokens(lagrangian)
    except errors.InputError:
        return  # reported where it is read
    if [(token.kind, token.order) for token in line_tokens] != [("name", 1), ("operator", 0), ("name", 0)]:
        return
    moving, rate = line_tokens[0].text, line_tokens[2].text
    occurs = rate in {token.text for token in walk(inside)} - {*known}
    if occurs and not {moving, rate} & {*document_names.moving_names(inside, 1)}:
        left, _, right = (part.strip() for part in line.partition("="))
        meant, column = (f"{right} = {left}", f"{left} - {right} = 0"), line_tokens[0].column
        what = f"{moving}' = {rate} could define {rate}, or hold {moving}' constant; it occurs"
        instead = f"write {rate} = {moving}' or {moving}' - {rate} = 0"
        raise refusals.refusal(what, column, instead, meant, (column, len(line.rstrip()) + 1)).at(pointer)


def _ask_about_speed(lines: Sequence[tuple[str, str]], lagrangian: str, known: Collection[str]) -> None:
    """InputError for the v of x' = v cos(theta), y' = v sin(theta) if L has none: any speed, or a constant."""
    for name in {*document_names.ANY_SPEED} - {*known}:
        alone = re.compile(rf"(?<![\w\\]){name}(?!\w)")
        held = [(pointer, line, found) for pointer, line in lines if (found := alone.search(line))]
        if len(held) != 2 or alone.search(lagrangian):
            continue
        (pointer, first, found), (_, last, _) = held
        declared = document_names.Declared(parameters=[name, document_names.AND_GUESS])
        try:
            names = document_names.known_names(declared, {"/lagrangian": lagrangian, "/1": first, "/2": last}, 1).names
            pairs = [pair for line in (first, last) for pair in reader.read_equations(line, names)]
        except errors.InputError:
            return  # reported where it is read
        trees = [left - right for left, right in pairs]
        slopes = [derivative.differentiate(tree, ex.Symbol(name)) for tree in trees]
        free = printing.to_text(collecting.collect(trees[0] * slopes[1] - trees[1] * slopes[0]))
        span = (len(first) - len(first.lstrip()) + 1, len(last.rstrip()) + 1)
        what, meant = f"{name} could be any speed, or a constant; it occurs", (f"{free} = 0",)
        error = refusals.refusal(what, found.start() + 1, document_names.ELIMINATED, meant, span, "parameters")
        raise error.at(pointer)


def _with_multipliers(
    plain: dict[str, Any], texts: Mapping[str, str]
) -> tuple[dict[str, Any], dict[str, str], dict[str, str]]:
    """The same for m x'' = lambda sin(theta), … with x' sin(theta) = y' cos(theta) or sin(theta) dx = cos(theta) dy."""

    given = {key: plain[key] for key in ("coordinates", "parameters", "functions", "where") if plain.get(key)}
    named = {zero[1]: zero[2] for text in texts.values() for zero in _ZERO.finditer(text)}
    given["where"] = {**given.get("where", {}), **named}
    texts = {pointer: _ZERO.sub(lambda zero: zero[2].rjust(len(zero[0])), text) for pointer, text in texts.items()}
    lines = [(pointer, line) for pointer, text in texts.items() for line in _lines(text)]
    # dz = y dx, without a derivative dx/dt
    forms = [_FORM.search(line) is not None and not re.search(r"d\s*t|''", line) for _, line in lines]
    pointers = [f"/{'constraints' if form else 'equations'}/{k}" for k, form in enumerate(forms)]
    origins = dict(zip(pointers, (pointer for pointer, _ in lines), strict=True))
    texts = dict(zip(pointers, (line for _, line in lines), strict=True))
    try:
        found = _constrained(texts, document_names.Declared(**given))
    except (TypeError, AttributeError):  # the shapes of declarations are refused by the schemas
        found = None
    if found is None:
        return plain, {}, {}
    made, held, multipliers = found
    kept = {key: part for key, part in plain.items() if key != "equations"}
    places = {f"/constraints/{k}": origins[pointer] for k, pointer in enumerate(held)}
    return {**kept, **made}, places, dict.fromkeys(multipliers, "a multiplier of the constraints")


def _as_motion(
    plain: dict[str, Any], texts: Mapping[str, str], lines: Sequence[tuple[str, str]]
) -> tuple[dict[str, Any], dict[str, str], dict[str, str]]:
    """The same for x'' = 0, y'' = -x*x'*y'/(1 + x^2), z' = -x*y': the line of first order is a constraint."""
    motion: dict[str, str] = {}
    held: dict[str, str] = {}
    places: dict[str, str] = {}
    moving: dict[str, None] = {}
    accelerated: set[str] = set()
    for pointer, line in lines:
        tokens, equal = reader.tokens_if_any(line, nm.Names()), line.find("=") + 1
        velocities = dict.fromkeys(document_names.moving_names(tokens, 1))
        accelerations = document_names.moving_names(tokens, 2)
        moving |= velocities
        accelerated.update(accelerations)
        if not accelerations and len(velocities) > 1:
            places[f"/constraints/{len(held)}"] = pointer
            held[line] = "a constraint"
        elif accelerations == [at(tokens, 0).text] and at(tokens, 1).is_operator("="):
            places[f"/motion/{tokens[0].text}"] = pointer
            motion[tokens[0].text] = line[equal:].rjust(len(line))
    if held and len(accelerated) == len(moving) == len(lines) - len(held):
        return _with_multipliers(plain, texts)
    if not motion or not held or not len(motion) + len(held) == len(moving) == len(lines):
        return plain, {}, {}
    kept = {"coordinates": list(moving)} | {key: part for key, part in plain.items() if key != "equations"}
    notes = {line.strip(): words for line, words in held.items()}
    return {**kept, "motion": motion, "constraints": list(held)}, places, notes


def _on_positions(plain: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """L with constraints on positions as L in coordinates that fulfil them; what was put in for each constraint.

    The document as it is if there are none, or if one of them has no usual coordinates.
    """
    held = plain.get("constraints")
    texts = [held] if isinstance(held, str) else held
    given = {key: plain[key] for key in ("coordinates", "parameters", "functions", "where") if plain.get(key)}
    if not isinstance(plain.get("lagrangian"), str) or not isinstance(texts, list):
        return plain, {}
    try:
        by_pointer = {f"/constraints/{place}": text for place, text in enumerate(texts)}
        declared = document_names.Declared(**given)
        known = document_names.known_names(declared, {"/lagrangian": plain["lagrangian"], **by_pointer}, 1)
        pairs = [(text, reader.read_equations(text, replace(known.names, forms=True))) for text in texts]
        lagrangian = known.put_in(reader.read_formula(plain["lagrangian"], replace(known.names, energy=True)))
    except (TypeError, AttributeError, errors.InputError):
        return plain, {}  # refused where it is read
    trees = {text: known.put_in(left - right) for text, ((left, right), *more) in pairs if not more}
    still = [text for text in trees if not ex.has(trees[text], ex.Velocity | ex.Acceleration)]
    names = known.remaining()
    found = position_constraints.definitions_on(
        [trees[text] for text in still], lagrangian, names.coordinates, {*known.names.declared()}
    )
    if not still or found is None:
        return plain, {}
    where = [{name: printing.to_text(formula) for name, formula in each.items()} for each in found[0]]
    made = {**plain, "coordinates": list(found[1]), "constraints": [text for text in texts if text not in still]}
    made["where"] = dict(chain(plain.get("where", {}).items(), *(each.items() for each in where)))
    if is_forward(made):
        del made["constraints"]
    shown = [", ".join(f"{name} = {formula}" for name, formula in each.items()) for each in where]
    return made, dict(zip((text.strip() for text in still), shown, strict=True))


def _velocity(differential: re.Match[str]) -> str:
    """x' for dx, at the end of its place; InputError for dOmega, which is usually the metric of a sphere."""
    if differential[1] in ("\\Omega", "Omega", "\u03a9"):
        instead = "write d theta^2 + sin(theta)^2 d phi^2 for that of a sphere"
        raise refusals.refusal("d Omega could be a metric", differential.start() + 1, instead)
    return f"{differential[0][differential.start(1) - differential.start() :]}'".rjust(len(differential[0]))


def _letter_l(match: re.Match[str]) -> str:
    """L at the same columns, and L = for Lagrangian: and L := ."""
    return f"{'L'.ljust(len(match[0]) - 1)}=" if match["named"] else "L".ljust(len(match[0]))


def _lines(text: str) -> list[str]:
    """The equations of a text, each after as many spaces that its columns hold."""
    text = reader.without_words(text)
    try:
        groups = reader.split_equations(text, nm.Names(forms=True))
    except errors.InputError:
        return [text]
    places = [(_start(text, group), _end(text, group)) for group in groups]
    lines = [" " * start + _GIVEN.sub(lambda match: " " * len(match[0]), text[start:end]) for start, end in places]
    return [shown for line in lines if (shown := _WRAPPER_ENDS.sub("", line)).strip()]


def _start(text: str, group: reader.EquationTokens) -> int:
    r"""The place where an equation begins, with the { of a {\dot x} there."""
    start = group.tokens[0].column - 1
    written = text[start : group.end_column - 1]
    return max(text.rfind("{", 0, start), 0) if written.count("}") > written.count("{") else start


def _end(text: str, group: reader.EquationTokens) -> int:
    """The place where an equation ends, before the words that are left out, as in (kinetic energy)."""
    last, end = group.tokens[-1], group.end_column - 1
    words = _WORDS_AT_THE_END.search(text, max(last.column, last.end), end)
    return words.start() if words else end


def prepared(document: Any) -> Prepared:
    """The document as the schemas want it; InputError for a result in its place, and for a bad name of the time."""
    if not isinstance(document, Mapping):
        return Prepared(document)
    if str(document.get("format", "")).startswith("inverse-service/"):
        raise errors.InputError("This is a result, not a document: its document is in system.given.", "/format")
    plain = {key: value for key, value in document.items() if key not in ("id", "$schema") and key[:1] != "_"}
    formulas = [plain[key] for key in FORMULAS if key in plain]
    if any(len(text) > refusals.most_characters() for text in _texts(formulas)):
        return Prepared(plain)  # too long a text is refused before it is read
    plain, places, read = _with_lagrangian(_with_indices_below(plain))
    if is_forward(plain):
        plain.pop("constraints", None)
    extra = {key: document[key] for key in ("id", "metadata") if key in document}
    if "id" in extra:  # the name of its own; "id", which jobs have too, is the older one
        extra["document_id"] = extra["id"]
    plain.pop("metadata", None)
    if ignored := [key for key in plain if isinstance(key, str) and key not in KEYS and not near_key(key)]:
        extra["ignored"] = ignored
        plain = {key: value for key, value in plain.items() if key not in ignored}
    plain = {key: _LOOSE[key](value) if key in _LOOSE else value for key, value in plain.items()}
    plain, eliminated = _on_positions(plain)
    read = read | eliminated
    time = _time_name(plain)
    free = "" if time != "t" else _free_variable(plain)
    notes = read | ({free: "the independent variable"} if free else {})
    if time == free == "t" or not (time := free or time) or time == "t":
        return Prepared(plain, extra=extra, readings=notes, places=places)
    plain, products = _with_time_apart(plain, time)
    if isinstance(text := plain.get("equations"), str) and "$" not in text:  # whose words hold the letters of names
        with reader.noted() as omitted:
            plain["equations"] = reader.without_words(text)
        notes = notes | omitted
    other = next(letter for letter in _LETTERS if letter not in "".join(_texts(plain)))
    inside = {key: _changed(plain[key], {time: "t", "t": other}, True) for key in (*FORMULAS, *NAMES) if key in plain}
    return Prepared({**plain, **inside}, time, other, extra, notes | products, places)


def _with_indices_below(plain: dict[str, Any]) -> dict[str, Any]:
    """The document with q_1 and q_2, at the same columns, for the coordinates q^1 and q^2 of its texts.

    These are letters that always have a digit above them, with a 1 among the digits, each of which moves somewhere.
    """
    texts = {key: plain[key] for key in FORMULAS if isinstance(plain.get(key), str)}
    every, moving = defaultdict[str, set[str]](set), defaultdict[str, set[str]](set)
    for found in _ABOVE.finditer(unicodedata.normalize("NFD", " ; ".join(texts.values()))):
        every[found["letter"]].add(found["digit"] or "")
        if found["dot"] or found["dots"] or found["primes"]:
            moving[found["letter"]].add(found["digit"] or "")
    indexed = {one for one in moving if moving[one] == every[one] and "" not in every[one] and every[one] & {*"1¹"}}

    def lowered(found: re.Match[str]) -> str:
        letter = found["letter"] if found["letter"][0] == "\\" else unicodedata.normalize("NFD", found["letter"])[0]
        return found[0].translate(_LOWERED) if letter in indexed else found[0]

    return plain | {key: _ABOVE.sub(lowered, text) for key, text in texts.items()} if indexed else plain


def prepared_scene(scene: Any) -> Any:
    """A scene with its own formulas in the words of its prepared system: the name of the time is t in both."""
    system = scene.get("system") if isinstance(scene, Mapping) else None
    if not isinstance(system, Mapping) or "catalogue" in system:
        return scene
    result = system.get("result")
    part = result.get("system") if isinstance(result, Mapping) else system.get("document", system)
    given = part.get("time", "t") if isinstance(part, Mapping) and isinstance(result, Mapping) else None
    try:
        time = prepared(part).time if given is None else given
    except errors.InputError:
        return scene  # reported with its place when the system is read
    if time == "t":
        return scene
    table = {time: "t"}
    changed = {key: _changed(scene[key], table, True) for key in SCENE_FORMULAS if key in scene}
    if isinstance(scene.get("methods"), list):
        changed["methods"] = [
            {**one, "free_lagrangian": _changed(one["free_lagrangian"], table, True)}
            if isinstance(one, Mapping) and "free_lagrangian" in one
            else one
            for one in scene["methods"]
        ]
    return {**scene, **changed}


def uses_the_letter_t(ready: Prepared) -> bool:
    """Whether t is a name of the document's own, while its time has another name."""
    return ready.time != "t" and any(ready.other in text for text in _texts(ready.document))


def inward(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result as it was before `Prepared.outward`, so that it can be compared with its certificate."""
    system = result.get("system")
    time = system.get("time", "t") if isinstance(system, Mapping) else "t"
    if time == "t" or not isinstance(system, Mapping) or not isinstance(time, str):
        return result
    other = prepared(system.get("given")).other
    changed = _changed(dict(result), {time: "t", "t": other})
    return {**changed, "system": {**changed["system"], "time": time}}


def _time_name(plain: dict[str, Any]) -> str:
    """The name in the key `time`, which is taken out, or the one that every equation gives the time; else t."""
    given = plain.pop("time", None)
    if given is None:
        return _found_time(plain)
    if not isinstance(given, str):
        raise errors.InputError("'time' is not a text: write the name of the time, such as \"tau\".", "/time")
    name = "t" if given == "t" else nm.declared_name(given, "/time", "time")
    if name in _declared(plain):
        raise errors.InputError(
            f"{name} is the time here and is declared too: give one of the two another name.", "/time"
        )
    return name


def _guesses(plain: Mapping[str, Any]) -> bool:
    named = plain.get("parameters")
    return named == document_names.GUESS or (isinstance(named, list | dict) and document_names.AND_GUESS in named)


def _free_variable(plain: Mapping[str, Any]) -> str:
    """The x of y'' = 6 y^2 + x, where names are guessed, one name moves, by primes, and neither t nor dots occur.

    So is the z of w'' = 2 w^3 + z w, a function of a complex variable.
    """
    texts = [text for _, text in _placed({key: plain[key] for key in FORMULAS if key in plain}, "")]
    if not _guesses(plain) or not {*plain} <= {"equations", "parameters", "name", "functions"}:
        return ""
    equations = plain.get("equations")
    keyed = [str(key).rstrip("'") for key in equations] if isinstance(equations, Mapping) else []
    if len(keyed) > 1 or any("dot" in text for text in texts):
        return ""
    try:
        known = nm.Names(guesses=True)
        known = replace(
            known, splits=document_names.moving_products({str(k): text for k, text in enumerate(texts)}, known, 1)
        )
        tokens = [token for text in texts for token in reader.read_tokens(text, known)]
    except errors.InputError:
        return ""
    moving = {*document_names.moving_names(tokens, 1)}
    words = {token.text for token in walk(tokens) if token.kind == "name"}
    free = "z" if moving == {"w"} and "x" not in words else "x"
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


def _with_time_apart(plain: Mapping[str, Any], time: str) -> tuple[dict[str, Any], dict[str, str]]:
    """The document with x*y for xy, where names are guessed and x is the time; InputError where xy may be a name."""
    if not _guesses(plain):
        return dict(plain), {}
    texts = dict(_placed({key: plain[key] for key in FORMULAS if key in plain}, ""))
    moving = {match[1] for text in texts.values() for match in _MOVING.finditer(text)}
    products = document_names.moving_products(texts, nm.Names(guesses=True), 1)
    moving = (moving - products.keys()) | {parts[-1] for parts in products.values()}
    known = nm.Names((), tuple({time, *_declared(plain, (*NAMES, "equations", "where")), *moving}))
    found = {name: "*".join(parts) for name, parts in products.items() if time in parts}
    for pointer, text in texts.items():
        for word in _PLAIN_WORD.finditer("" if reader.is_latex(text) else text):
            name, column = word[0], word.start() + 1
            index = name == 2 * time and text[: word.start()].endswith("''")  # y''xx
            known_name = name in nm.FUNCTIONS or name in found or known.role(name) or name[0] == "d" or time not in name
            if known_name or index:
                continue
            if parts := nm.only_split(name, known):
                found[name] = nm.written_product(parts, known)
            elif meant := nm.readings(name, known):
                raise nm.undeclared(name, column, meant).at(pointer)
    changed = {key: _changed(plain[key], found) if key in FORMULAS and found else part for key, part in plain.items()}
    return changed, found


def _placed(value: Any, pointer: str) -> Iterator[tuple[str, str]]:
    """Every text in a value with its pointer."""
    if isinstance(value, str):
        yield pointer, value
    elif isinstance(value, Mapping | list):
        parts = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, part in parts:
            yield from _placed(part, f"{pointer}/{key}")


def _found_time(plain: Mapping[str, Any]) -> str:
    """The x of y''(x), d^2y/dx^2, diff(y(x), x, 2), where all second derivatives are by the same name."""
    found, moving = set(), set()
    for text in _texts({key: plain[key] for key in FORMULAS if key in plain}):
        tokens = reader.tokens_if_any(text, nm.Names(guesses=True))
        orders = document_names.derivatives(tokens)
        found |= {by for name, by, order in orders if order == 2 and name not in _declared(plain, ("functions",))}
        moving |= {name for name, by, order in orders if order == 2 or by == "t"}
    name = found.pop() if len(found) == 1 else "t"
    if name in _declared(plain) | moving or name in nm.FUNCTIONS | nm.DERIVATIVE_NAMES:
        return "t"
    letters = {match[1] for text in _texts(plain) for match in re.finditer(r"\\([A-Za-z]+)", text)}
    return f"var{name}" if f"var{name}" in letters and name not in letters else name  # \varphi is read as phi


def _declared(plain: Mapping[str, Any], keys: tuple[str, ...] = NAMES) -> set[str]:
    """The names that a document declares under these keys; nothing where it holds something else."""
    lists = (plain.get(key) for key in keys)
    return {word for words in lists if isinstance(words, list | dict) for word in words if isinstance(word, str)}


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


def _changed(value: Any, table: Mapping[str, str], pad: bool = False, latex: bool = False) -> Any:
    """The value with the names of the table replaced in every text; `pad` keeps columns where they are."""
    if isinstance(value, str):
        if value.startswith("<math"):
            return _in_mathml(value, table)
        return (_in_latex if latex or reader.is_latex(value) else _in_plain_text)(value, table, pad)
    if isinstance(value, Mapping):
        return {
            _in_plain_text(key, table, False) if key not in _STRUCTURE else key: part
            if key in KEPT
            else ""  # s is that of the symmetry x -> x + s
            if key == "symmetry" and "s" in table.values()
            else _changed(part, table, pad, latex or key == "latex")
            for key, part in value.items()
        }
    return [_changed(part, table, pad, latex) for part in value] if isinstance(value, list | tuple) else value


def _in_plain_text(text: str, table: Mapping[str, str], pad: bool) -> str:
    names = "|".join(re.escape(name) for name in table if name)
    forms = re.compile(rf"(d[2-9]?|[A-Za-z]\w*_)?({names})([2-9]|(?:_?dot){{1,2}}|_?ddot)?")

    def replaced(match: re.Match[str]) -> str:
        form = forms.fullmatch(match.group())
        if form is None:
            return match.group()
        new = f"{form[1] or ''}{table[form[2]]}{form[3] or ''}"
        return new.ljust(len(match.group())) if pad else new

    found = _PLAIN_WORD.sub(replaced, text)
    for character in {*text} & letters.GREEK.keys():
        if pad and letters.GREEK[character] in table:
            found = found.replace(character, table[letters.GREEK[character]])
    return found


def _in_latex(text: str, table: Mapping[str, str], pad: bool) -> str:
    def replaced(match: re.Match[str]) -> str:
        below, word = match[1] or "", match[2]
        if below and word.lstrip("\\") not in table:
            return match.group()
        if word.startswith("\\"):
            new = table.get(word[1:])
            return match.group() if new is None else below + _spelled(new).rjust(len(word) if pad else 0)
        if word in nm.FUNCTIONS or (len(word) > 2 and word in letters.LETTER_COMMANDS):
            return below + _spelled(table[word]) if word in table else match.group()
        return below + "".join(_spelled(table[letter]) if letter in table else letter for letter in word)

    return _LATEX_WORD.sub(replaced, text)


def _spelled(name: str) -> str:
    """The name in LaTeX, kept apart from letters after a command."""
    found = printing.name_latex(name)
    return found + " " if found.startswith("\\") else found


def _in_mathml(text: str, table: Mapping[str, str]) -> str:
    names = {letters.shown(name): letters.shown(new) for name, new in table.items() if name}
    return re.sub(r"<mi>([^<]+)</mi>", lambda match: f"<mi>{names.get(match[1], match[1])}</mi>", text)


def _words(value: Any) -> Any:
    return document_names.words_of(value) if isinstance(value, str) else value


def _parameters(value: Any) -> Any:
    if isinstance(value, str) and "=" in value:
        return document_names.parameters_of(value)
    return value if value == document_names.GUESS else _words(value)


def _functions(value: Any) -> Any:
    """ "V(x, y)", ["V(x, y)"] and {"V": "x, y"} as {"V": ["x", "y"]}."""
    if isinstance(value, list) and all(isinstance(entry, str) for entry in value):
        value = ", ".join(value)
    if isinstance(value, str):
        return document_names.functions_of(value)
    return {key: _words(part) for key, part in value.items()} if isinstance(value, dict) else value


_LOOSE: dict[str, Callable[[Any], Any]] = {"coordinates": _words, "parameters": _parameters, "functions": _functions}


def _constrained(
    texts: Mapping[str, str], declared: document_names.Declared
) -> tuple[dict[str, Any], list[str], list[str]] | None:
    """L and the constraints of equations with multipliers as keys of a document; None where they are no such equations.

    With them the pointers of the texts that have the constraints, and the multipliers.
    """
    try:
        names = document_names.known_names(declared, texts).names
        kinds = {pointer: replace(names, forms=pointer.startswith("/constraints")) for pointer in texts}
        lines = [(at, *pair) for at, text in texts.items() for pair in reader.read_equations(text, kinds[at])]
    except errors.InputError:
        return None
    trees = [(pointer, left - right) for pointer, left, right in lines]
    moving = [tree for _, tree in trees if ex.has(tree, ex.Acceleration)]
    held = [(pointer, tree) for pointer, tree in trees if not ex.has(tree, ex.Acceleration)]
    of_positions = [not ex.has(tree, ex.Velocity) for _, tree in held]
    rates = [
        derivative.differentiate_in_time(tree, names.coordinates) if still else tree
        for (_, tree), still in zip(held, of_positions, strict=True)
    ]
    rows = _rows(rates, names.coordinates)
    forces = {
        name: [derivative.differentiate(line, ex.Symbol(name)) for line in moving]
        for name in names.parameters
        if any(ex.holds(line, ex.Symbol(name)) for line in moving)
    }
    named = [name for name in forces if _MULTIPLIER.fullmatch(name)]
    reactions = [name for name, force in forces.items() if any(_are_parallel(force, row) for row in rows)]
    multipliers = [ex.Symbol(name) for name in named or reactions]
    if len(moving) != len(names.coordinates) or not held or not len(multipliers) == len(held) == len(rows):
        return None
    lagrangian = _lagrangian(names, moving, multipliers, rows)
    if lagrangian is None:
        return None
    made = {
        "coordinates": list(names.coordinates),
        "lagrangian": printing.to_text(lagrangian),
        # x^2 + y^2 = l^2 is refused, with its derivative, where it was written
        "constraints": [
            texts[pointer] if still else f"{printing.to_text(tree)} = 0"
            for (pointer, tree), still in zip(held, of_positions, strict=True)
        ],
    }
    return made, [pointer for pointer, _ in held], [multiplier.name for multiplier in multipliers]


def _rows(trees: Iterable[ex.Expression], coordinates: Sequence[str]) -> list[list[ex.Expression]]:
    """w of each w_i v^i + c = 0; none for a tree without velocities, or with others."""
    forms = [euler_lagrange.linear_parts(tree, ex.Velocity) for tree in trees]
    linear = [form[0] for form in forms if isinstance(form, tuple) and form[0]]
    return [[row.get(ex.Velocity(name), ex.ZERO) for name in coordinates] for row in linear]


def _lagrangian(
    names: nm.Names,
    lines: Sequence[ex.Expression],
    multipliers: Sequence[ex.Symbol],
    forms: Sequence[Sequence[ex.Expression]],
) -> ex.Expression | None:
    from inverse_service.search.row_factors import lagrangian_as_given

    none = dict(dict.fromkeys(multipliers, ex.ZERO))
    free = [ex.substitute(line, none) for line in lines]
    found = lagrangian_as_given(second_order_system.unsolved_system(names, free), free)
    if found is None:
        return None
    accelerations = [ex.Acceleration(name) for name in names.coordinates]
    equations = euler_lagrange.euler_lagrange_residual(found, names.coordinates, accelerations)
    forces = [[derivative.differentiate(line, multiplier) for line in lines] for multiplier in multipliers]
    if any(ex.holds(entry, *multipliers) for force in forces for entry in force):
        return None
    left = list(forms)
    for force in forces:
        scaled = [_scaled(*part) for part in zip(equations, free, accelerations, force, strict=True)]
        if None in scaled:
            return None
        same = next((form for form in left if _are_parallel([one for one in scaled if one is not None], form)), None)
        if same is None:
            return None
        left.remove(same)
    return found


def _scaled(
    equation: ex.Expression, line: ex.Expression, acceleration: ex.Acceleration, force: ex.Expression
) -> ex.Expression | None:
    """The force times c where the equation of L is c times the line; None where it is no such multiple."""
    over, under = (derivative.differentiate(tree, acceleration) for tree in (equation, line))
    same = under != ex.ZERO and _is_zero(equation * under - line * over)
    return force * over / under if same else None


def _are_parallel(force: Sequence[ex.Expression], form: Sequence[ex.Expression]) -> bool:
    pairs = combinations(range(len(form)), 2)
    return any(not _is_zero(one) for one in force) and all(
        _is_zero(force[i] * form[j] - force[j] * form[i]) for i, j in pairs
    )


def _is_zero(tree: ex.Expression) -> bool:
    if collecting.collect(tree) == ex.ZERO:
        return True
    with suppress(exact_field.TooLarge, ZeroDivisionError, KeyError):  # sin(x) = cos(x)*tan(x)
        return exact_field.exact_ring([tree], [], 0, exact_field.Budget.short(), slopes=False).value(tree).is_zero
    return False


# The prepared document to its schema and its system.


def to_schema(document: Any) -> SystemDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return validated(document, SystemDocument)


def to_system(schema: SystemDocument) -> SecondOrderSystem:
    """The system that a document describes; raises InputError with pointer and column."""
    return second_order_system.solved_system(to_given(schema), schema.name)


def to_solvable(schema: SystemDocument, given: second_order_system.GivenEquations | None = None) -> SecondOrderSystem:
    """The system of a document to be solved; its equations as given where these are Euler-Lagrange equations already.

    That is where the accelerations, solved for, are too long to be written, or fill pages. InputError as `to_system`.
    `given` is `to_given` of the document where it is known.
    """
    given, system = given or to_given(schema), None
    asks_more = schema.special_cases or schema.kinds or schema.clock or schema.near
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
    found = None if next(real_branch.sign_cases(given.residuals)).roots else row_factors.in_own_order(lines)
    if found and all(ex.holds(f, ex.Acceleration(q)) for q, f in zip(found.coordinates, found.given, strict=True)):
        return found
    return system or second_order_system.solved_system(given, schema.name)


def to_given(schema: SystemDocument) -> second_order_system.GivenEquations:
    """The equations of the document as written; raises InputError as `to_system`."""
    return second_order_system.read_given(declared(schema), schema.equations)


def declared(schema: Asking, most: int = refusals.LIMITS.coordinates) -> document_names.Declared:
    """What the document says of its names."""
    return document_names.Declared(schema.coordinates, schema.parameters, schema.functions, schema.where, most)


def to_ansatz(schema: Asking, system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    """The user's own terms of a Lagrangian as trees; raises InputError with pointer and column."""
    places = {f"/ansatz/{place}": text for place, text in enumerate(schema.ansatz)}
    terms = ((formula_about(text, system.names, schema, pointer), pointer) for pointer, text in places.items())
    return tuple(reader.without_accelerations(term, "a term of a Lagrangian", pointer) for term, pointer in terms)


def formula_about(text: str, names: nm.Names, schema: NamedDocument | None, pointer: str) -> ex.Expression:
    """A formula about the system of a document, whose parameters with values are put in; InputError with pointer."""
    named = () if schema is None else document_names.Declared(parameters=schema.parameters).named_parameters()
    known = replace(names, parameters=tuple(dict.fromkeys((*names.parameters, *named))))
    with reader.placed_at(pointer):
        return document_names.with_values(reader.read_formula(text, known), document_names.parameter_values(named))


@dataclass(frozen=True, slots=True)
class Wording:
    """The words in errors of a schema: the name of the whole, the allowed values, the sentence for an unknown key.

    `keys` takes from pydantic's way to a fault the steps that are no keys of the document.
    """

    whole: str
    expected: Mapping[Steps, str]
    unknown: Callable[[Steps, str], str]
    keys: Callable[[Steps], Steps]


def validated(document: Any, schema: type[Read], wording: Wording | None = None) -> Read:
    """The document in its schema; raises DocumentRefused with every fault found, at most MAX_PLACES in its order."""
    try:
        return schema.model_validate(document)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        found.sort(key=lambda fault: fault["type"] != "extra_forbidden" or not near_key(str(fault["loc"][0])))
        found = found[:MAX_PLACES]
        raise errors.DocumentRefused(tuple(_place(fault, wording or _of_systems(schema)) for fault in found)) from None


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
        sentence = f"{where} is too long: at most {fault['ctx']['max_length']} {counted} are accepted."
    elif kind.endswith("too_short"):
        sentence = f"{where} must not be empty; {expected}"
    else:
        sentence = f"{where} has the wrong type or value; {expected}"
    return errors.Place(sentence, "".join(f"/{plain_data.escape(step)}" for step in steps), None, code)


def _of_systems(schema: type[base.Document]) -> Wording:
    def unknown(steps: Steps, where: str) -> str:
        if steps[0] in BESIDE and "constraints" in schema.model_fields:
            return BESIDE[str(steps[0])]
        if len(steps) == 1 and (meant := near_key(str(steps[0]))):
            return f"The key {where} is not known here: did you mean '{meant}'?"
        keys = ", ".join((*schema.model_fields, *ALSO))
        return f"The key {where} is not known here; a {TITLES.get(schema.__name__, 'system')} has the keys {keys}."

    return Wording("The document", EXPECTED, unknown, lambda steps: without(steps, NOT_IN_THE_DOCUMENT))


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
