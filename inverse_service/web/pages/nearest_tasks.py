"""The page of the systems with a Lagrangian that are nearest to a fitted one, and fits of uploaded tables; in workers."""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple
from urllib.parse import urlencode

from starlette.responses import HTMLResponse

from inverse_service import errors
from inverse_service.expressions import calculus, tree as ex
from inverse_service.service.documents import sheets, stated
from inverse_service.web.pages import WORDS, forms, preview, rendering, result_tasks

KINDS: dict[str, list[str]] = WORDS["nearest"]
LARGEST_DEGREE, LARGEST_WINDOW = 3, 501
MOST_BARS = 12
CUT, WIDEST_ERROR = 190, 24  # pixels: how far a distance reaches in a cut, and an error at most
BESIDE = ("The line is the nearest system; dashed, the fitted one from the same start.",)
NO_FITS = "This service has no PySINDy, which fits equations to tables: fit them yourself, and enter the equations above."
LATE = "The time was over before a nearest system was found."
RAISED, MINUS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"), "\N{MINUS SIGN}"
_COEFFICIENT = re.compile(r"\[([^\]]*)\]")


def fit_task(body: bytes, content_type: str) -> dict[str, Any]:
    """The document of a sent table: what PySINDy fits to it, with its covariance. Raises InputError."""
    form = forms.form_of(body, content_type)
    degree = _whole(form.text("degree") or "1", "The degree", LARGEST_DEGREE)
    window = _whole(form.text("window") or "11", "The number of points", LARGEST_WINDOW)
    if "table" not in form.files:
        raise errors.InputError("Choose a CSV file.")
    from inverse_service import data

    table = data.read_table(form.files["table"].data)
    if window % 2 == 0 or window < LARGEST_DEGREE + 2:
        raise errors.InputError("The number of points to smooth over is odd and at least 5.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = data.from_table(table, table.columns[0], degree=degree, window=window)
    except errors.MissingExtra:
        raise errors.InputError(NO_FITS) from None
    if not model.names:
        raise errors.InputError(
            "Nothing is left of the fit but q'' = 0: the motion in this table is at rest, or too short."
        )
    return {**model.document, "nearest": data.metric_of(model) or True}


def _whole(text: str, what: str, most: int) -> int:
    if not text.isdecimal() or not 1 <= int(text[:9]) <= most:
        raise errors.InputError(f"{what} must be an integer from 1 to {most}.")
    return int(text)


@dataclass(frozen=True, slots=True)
class Row:
    """A kind in the table: its address, name, form of L or equations, distance, and what is said of that."""

    address: str
    name: str
    form: str
    is_formula: bool
    distance: str
    verdict: str
    said: str


@dataclass(frozen=True, slots=True)
class Bar:
    """A coefficient that moved: its values, the fitted one with its error, the change as text, and
    from -45 to 45 as a bar.
    """

    name: str
    before: str
    after: str
    change: str
    length: float


@dataclass(frozen=True, slots=True)
class Cut:
    """A plane through the fitted point and the nearest one in units of the errors, in which the
    circles are round: `unit` is an error in pixels, `far` the distance. `is_set`: the linear set to
    which the nearest point belongs cuts this plane in a line. It is the plane of the way to that
    point, which is perpendicular to the set, and of a direction within the set.
    """

    unit: float
    far: float
    is_set: bool


def page_task(
    store: str, id: str, look: result_tasks.Look, query: Mapping[str, str]
) -> HTMLResponse | None:
    """The page; None if the question of the result was another one."""
    rendering.VISITOR.set(look.visitor)
    found = result_tasks.part_task(store, id, lambda result: result)
    if not (found["system"]["given"] or {}).get("nearest"):
        return None
    members = found.get("nearest") or []
    is_late = found.get("nearest") is None
    place = query.get("member", "0")
    chosen = int(place[:3]) if place.isdecimal() and int(place[:3]) < len(members) else 0
    member = members[chosen] if members else None
    return rendering.page(
        "nearest_result.html",
        active="/nearest",
        id=id,
        title=sheets.title_of(found),
        asked=sheets.sheet_of(found, length="brief").asked,
        change=address_of(found["system"]["given"]),
        sentences=(LATE,) if is_late else sheets.distance_said(members[0] if members else None),
        rows=[_row(one, id, k, k == chosen) for k, one in enumerate(members)],
        chosen=chosen,
        name=KINDS[member["kind"]][0] if member else "",
        bars=_bars(member) if member else [],
        cut=_cut(member) if member else None,
        more_bars=max(0, len(member["moved"]) - MOST_BARS) if member else 0,
        unit="errors" if member and member["chi2"] is not None else "%",
        sheet=sheets.sheet_of(member["result"], length="brief") if member else None,
        open_address=forms.question_address(member["result"]["system"]["given"]) if member else "",
        nice=_nice(member) if member else None,
        attained=member is None or member["attained"],
        motion=member_motion(found, member) if member else None,
        missing=[
            (KINDS[one["kind"]][0], one["reason"]) for one in found.get("nearest_not_reached") or ()
        ],
    )


def address_of(document: Mapping[str, Any]) -> str:
    """The link that fills the form with a question; empty where only a document can ask it, or it would be too long."""
    question = document.get("nearest")
    if isinstance(question, Mapping) and question.keys() & {
        "covariance",
        "weights",
        "coefficients",
    }:
        return ""
    asked = question if isinstance(question, Mapping) else {}
    library = asked.get("library") or ()
    if isinstance(library, Mapping) or isinstance(asked.get("errors"), list):
        return ""
    fields = forms.lean_fields(document)
    if fields["nearest"] == "relative":
        fields["nearest"] = ""
    kept = {name: fields[name] for name in ("equations", "parameters", "coordinates", "nearest")}
    more = {"library": ", ".join(library), "nice": "yes" if asked.get("nice") else ""}
    address = f"/nearest?{urlencode({name: text for name, text in (kept | more).items() if text})}"
    return address if len(address) <= forms.LONGEST_LINK else ""


def _row(part: Mapping[str, Any], id: str, place: int, is_chosen: bool) -> Row:
    name, form = KINDS[part["kind"]]
    if part["kind"] == "leaf":
        form = ", ".join(readable(one["text"]) for one in part["equations"])
    number = part["degrees"]
    said = f"{number} equation{'s' * (number != 1)}" if number else "no equation: all such systems"
    if part["chi2"] is None:
        distance = f"{100 * part['distance']:.3g} %"
    else:
        distance = f"{part['distance']:.3g} errors"
        if number:
            said += f"; by chance in {sheets.often_said(part['chance'])} fits"
    if part["distance"] < sheets.NO_DISTANCE:
        distance = "none"
    if part["projection"]:
        said += "; no nearer one exists"
    verdict = {None: "", True: "yes", False: "no"}[part["within"]]
    address = "" if is_chosen else f"/results/{id}/nearest?member={place}#member"
    return Row(address, name, form, part["kind"] != "leaf", distance, verdict, said)


def readable(text: str) -> str:
    """An equation between coefficients, "[x'': y] = 2*[y'': x]", as words: "(y in x'') = 2 (x in y'')"."""

    def words(match: re.Match[str]) -> str:
        equation, _, term = match[1].partition(": ")
        return f"({term.replace('*', ' ')} in {equation})"

    shown = _COEFFICIENT.sub(words, text).replace("*", " ")
    return re.sub(r"\^(\d+)", lambda match: match[1].translate(RAISED), shown).replace("-", MINUS)


def _bars(part: Mapping[str, Any]) -> list[Bar]:
    """The coefficients that moved, the farthest first."""
    moved = sorted(part["moved"].items(), key=lambda one: -abs(one[1]["sigmas"]))
    is_known = part["chi2"] is not None
    most = max((abs(one["sigmas"]) for _, one in moved), default=1.0)
    return [
        Bar(
            name,
            sheets.short_number(one["from"]) + (_error_of(one) if is_known else ""),
            sheets.short_number(one["to"]),
            _signed(one["sigmas"] if is_known else 100 * one["sigmas"]),
            round(45 * one["sigmas"] / most, 1),
        )
        for name, one in moved[:MOST_BARS]
    ]


def _cut(part: Mapping[str, Any]) -> Cut | None:
    """None where no errors are known, or nothing moved."""
    if part["chi2"] is None or part["distance"] < sheets.NO_DISTANCE:
        return None
    unit = min(WIDEST_ERROR, CUT / max(3.0, part["distance"]))
    linear = part.get("constraints")
    is_set = linear is not None and len(linear["coefficients"]) > len(linear["matrix"])
    return Cut(round(unit, 1), round(unit * part["distance"], 1), is_set)


def _error_of(moved: Mapping[str, Any]) -> str:
    """The standard error of a coefficient, as it is written behind the fitted number."""
    width = float(Fraction(moved["to"]) - Fraction(moved["from"])) / moved["sigmas"]
    return f" ± {width:.2g}"


def _signed(value: float) -> str:
    """A change: two decimals, or one digit of a smaller one."""
    return f"{value:+.2f}" if abs(value) >= 0.095 else f"{value:+.1g}"


class NiceMember(NamedTuple):
    """A member in simple fractions."""

    distance: str
    lines: list[sheets.Formula]
    address: str


def _nice(part: Mapping[str, Any]) -> NiceMember | None:
    """The distance, the equations, and the address of a member in simple fractions."""
    offered = part.get("nice")
    if not offered:
        return None
    is_known = part["chi2"] is not None
    far = f"{offered['distance']:.3g} errors" if is_known else f"{100 * offered['distance']:.3g} %"
    names = stated.names_of(part["result"]["system"])
    lines = [
        sheets.Formula(text, names, f"{name}''") for name, text in offered["equations"].items()
    ]
    given = {**part["result"]["system"]["given"], "equations": offered["equations"]}
    return NiceMember(far, lines, forms.question_address(given))


def member_motion(fitted: Mapping[str, Any], part: Mapping[str, Any]) -> preview.Shown | None:
    """The motion of a member, with that of the fitted system from the same start beside it."""
    found, moving = preview.motion_of_result(part["result"]), preview.moving_of(fitted)
    if found is None or moving is None or found.data["picture"] == "none":
        return None
    given = fitted["system"]["given"].get("parameters")
    values = given if isinstance(given, Mapping) else {}
    try:
        numbers: dict[ex.Expression, ex.Expression] = {
            ex.Symbol(name): ex.number(Fraction(str(value))) for name, value in values.items()
        }
    except ValueError:
        return None
    other = [preview.listed(ex.substitute(tree, numbers)) for tree in moving.accelerations]
    meters, rows = _energy(part["result"])
    told = {**found.data, "other": other, "meters": rows}
    return replace(found, data=told, caption=BESIDE, meters=meters)


def _energy(
    result: Mapping[str, Any],
) -> tuple[tuple[tuple[str, sheets.Formula | str], ...], list[Any]]:
    """v dL/dv - L of a member whose L is without the time, twice: along the member, and along the fitted system."""
    lagrangian, moving = result.get("lagrangian"), preview.moving_of(result)
    if not lagrangian or lagrangian["auxiliary"] or moving is None:
        return (), []
    try:
        tree = moving.read(lagrangian["text"])
    except errors.InputError:
        return (), []
    if ex.holds(tree, ex.Symbol(result["system"].get("time", "t"))):
        return (), []
    rates = [ex.Velocity(name) for name in moving.names.coordinates]
    kept = ex.subtract(ex.add(*(v * calculus.differentiate(tree, v) for v in rates)), tree)
    listed = preview.listed(kept)
    return (("conserved", ""), ("the same, fitted", "")), [listed, listed]
