"""What a program defines beside its Lagrangian: functions of Mathematica, as V[x_] := k x^2/2, and
rates of MATLAB by their names in syms. Rules over its signs, in which x_1 is one name.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from inverse_service.reading import signs
from inverse_service.reading.signs import Line
from inverse_service.reading.typed_text import Change

_MOST = 20  # definitions that are read, and names of one syms
_MOST_ARGUMENTS = 9
_LONGEST = 41  # characters of a name


class _Defined(NamedTuple):
    """V[x_] := of Mathematica: the name, the arguments, and the places from the [ to after the =."""

    name: str
    arguments: Sequence[str]
    start: int
    stop: int


def changes(text: str) -> Iterator[Change]:
    """V(x) = k x^2/2 for V[x_] := k x^2/2, and x = l Sin[a[t]] for x[t_] := l Sin[a[t]], with x
    and x' for the x[t] and x'[t] of the text; x' for the dx of syms x dx ddx.
    """
    line = signs.with_whole_names(text)
    yield from _rates_by_name(line)
    found = [place for place in range(len(line)) if line.says(place + 1, "[")]
    defined = [one for place in found if (one := _defined_at(line, place)) is not None][:_MOST]
    for one in defined:
        arguments = "" if one.arguments == ["t"] else f"({', '.join(one.arguments)})"
        yield Change(line[one.start].start, line[one.stop - 1].stop, f"{arguments} =")
    called = {one.name for one in defined if one.arguments == ["t"]}
    for place, sign in enumerate(line):
        if sign.text not in called or _is_entry(line, place):
            continue
        after = place + 1 + (line.at(place + 1).glued and line.at(place + 1).text in ("'", "''"))
        time = line[after : after + 3]
        is_glued = all(each.glued for each in time)
        if line.says(after, "[", "t", "]") and is_glued and not _is_equal(line, after + 3):
            yield Change(time[0].start, time[2].stop, "")


def _rates_by_name(line: Line) -> Iterator[Change]:
    """x' for each dx behind a syms x dx ddx."""
    declared = [k for k, sign in enumerate(line) if sign.text == "syms" and _begins(line, k)]
    for place in declared[:_MOST]:
        stop = place + 1
        while line.at(stop).text[:1].isalnum() or line.at(stop).text[:1] == "_":
            stop += 1
        words = [sign.text for sign in line[place + 1 : stop]]
        moving = [word for word in words if f"d{word}" in words and f"dd{word}" in words]
        rates = {f"d{word}": word for word in moving[:_MOST]}
        for sign in line[stop:]:
            if sign.text in rates:
                yield Change(sign.start, sign.stop, f"{rates[sign.text]}'")


def _begins(line: Line, place: int) -> bool:
    return place == 0 or line[place - 1].text == signs.LINE_END


def _is_entry(line: Line, place: int) -> bool:
    """Whether the name here is glued to a bracket that ends before it."""
    return line[place].glued and line.at(place - 1).text == "]"


def _defined_at(line: Line, place: int) -> _Defined | None:
    """The definition whose name is here."""
    if not _is_argument(line, place) or _is_entry(line, place) or not line[place + 1].glued:
        return None
    arguments = list[str]()
    after = place + 2
    while _is_argument(line, after) and line[after].text.endswith("_"):
        arguments.append(line[after].text.removesuffix("_"))
        if not line.says(after + 1, ","):
            break
        after += 2
    after += 1
    if not 0 < len(arguments) <= _MOST_ARGUMENTS or not line.says(after, "]"):
        return None
    stop = _defines(line, after + 1)
    return _Defined(line[place].text, arguments, place + 1, stop) if stop else None


def _is_argument(line: Line, place: int) -> bool:
    name = line.at(place)
    return name.is_name() and len(name.text.removesuffix("_")) <= _LONGEST


def _defines(line: Line, place: int) -> int:
    """The place after the := or = here, which is no ==; 0 without it."""
    colon = line.says(place, ":")
    stop = place + colon + 1
    is_given = line.says(stop - 1, "=") and (not colon or line[stop - 1].glued)
    return stop if is_given and not (line.says(stop, "=") and line[stop].glued) else 0


def _is_equal(line: Line, place: int) -> bool:
    """Whether =, :=, or == is here, perhaps on a line below."""
    while line.says(place, signs.LINE_END):
        place += 1
    return line.says(place, "=") or line.says(place, ":", "=")
