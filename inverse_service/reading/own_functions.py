"""What a program defines beside its Lagrangian: functions of Mathematica, as V[x_] := k x^2/2, and
rates of MATLAB by their names in syms.
"""

import re
from collections.abc import Iterator

from inverse_service.reading.typed_text import Change

_DEFINED = re.compile(
    r"(?<![\w\]])(?P<name>[A-Za-z]\w{0,40})(?P<call>\[[ \t]*(?P<arguments>[A-Za-z]\w{0,40}_"
    r"(?:[ \t]*,[ \t]*[A-Za-z]\w{0,40}_){0,8})[ \t]*\][ \t]*:?=)(?!=)"
)
_SYMBOLS = re.compile(r"(?m)^[ \t]*syms[ \t]+([\w \t]+)")
_MOST = 20  # each is searched for in the text


def changes(text: str) -> Iterator[Change]:
    """V(x) = k x^2/2 for V[x_] := k x^2/2, and x = l Sin[a[t]] for x[t_] := l Sin[a[t]], with x
    and x' for the x[t] and x'[t] of the text; x' for the dx of syms x dx ddx.
    """
    for declared in [*_SYMBOLS.finditer(text)][:_MOST]:
        words = declared[1].split()
        moving = [word for word in words if f"d{word}" in words and f"dd{word}" in words]
        for word in moving[:_MOST]:
            for used in re.finditer(rf"(?<!\w)d{word}(?!\w)", text[declared.end() :]):
                start, stop = (declared.end() + place for place in used.span())
                yield Change(start, stop, f"{word}'")
    defined = [*_DEFINED.finditer(text)][:_MOST]
    for found in defined:
        arguments = [part.strip().removesuffix("_") for part in found["arguments"].split(",")]
        name = re.escape(found["name"])
        if arguments == ["t"]:
            yield Change(*found.span("call"), " =")
            for used in re.finditer(rf"(?<![\w\]]){name}'{{0,2}}(\[t\])(?!\s*:?=)", text):
                yield Change(*used.span(1), "")
        else:
            yield Change(*found.span("call"), f"({', '.join(arguments)}) =")
