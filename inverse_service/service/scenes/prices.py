"""What was measured of a scene as people read it: numbers, times, names of methods, and what an error costs."""

import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

DASH = "\u2013"
NAMES_OF_METHODS = {
    "runge-kutta": "Runge\u2013Kutta", "stormer-verlet": "St\u00f6rmer\u2013Verlet", "heyoka": "Taylor (heyoka)",
    "variational": "Variational", "nonholonomic": "Nonholonomic", "modified": "Modified", "adaptive": "Adaptive",
    "stiff": "Stiff", "reference": "Reference", "exact": "Exact",
}  # fmt: skip
LABEL = re.compile(rf"({'|'.join(NAMES_OF_METHODS)})(?:-(\d[\d._]*))?(?:-order(\d+))?((?:-[a-z]+)*)")


def short_number(value: Any, digits: int = 3) -> str:
    """So many digits, or a power of ten if it is shorter; a dash if the value is not a number."""
    if not isinstance(value, int | float):
        return DASH
    rounded = float(f"{value or 0:.{digits}g}")  # -0.0 is 0
    return f"{rounded:g}".replace("e-0", "e-").replace("e+0", "e")


def duration(seconds: Any) -> str:
    """Two digits of seconds, or of ms and microseconds where they are small: no time that is measured has more."""
    if not isinstance(seconds, int | float):
        return DASH
    for factor, unit in ((1e6, "\N{MICRO SIGN}s"), (1e3, "ms")):
        if seconds * factor < 999.5:
            return f"{short_number(seconds * factor, 2)} {unit}"
    return f"{short_number(seconds, 2)} s"


def power(error: float) -> str:
    """A power of ten: 1e-3."""
    return f"{error:.0e}".replace("e-0", "e-").replace("e+00", "")


def method_name(label: str) -> str:
    """A method in words: "Variational 4" for variational-0.5-order4; a label of the scene's own as it is."""
    found = LABEL.fullmatch(label)
    if found is None:
        return label
    method, alpha, order, more = found.groups()
    words = NAMES_OF_METHODS[method] + (f" {order}" if order else "") + more.replace("-", ", ")
    return words if alpha in (None, "0.5") else f"{words}, \u03b1 = {alpha.replace('_', '/')}"


@dataclass(frozen=True, slots=True)
class Price:
    """What an error costs by a method: the time, the ratio to the best, the step; a dash where it is not reached."""

    time: str = DASH
    ratio: str = "not reached"
    setting: str = ""
    is_best: bool = False


def price_of(target: Mapping[str, Any], label: str) -> Price:
    """The cost of a target error by a method."""
    row = next((row for row in target["rows"] if row["method"] == label and row["seconds"] is not None), None)
    if row is None:
        return Price()
    is_best = row["seconds"] == min(row["seconds"] for row in target["rows"] if row["seconds"] is not None)
    at_most = "\u2264 " if row["at_most"] else ""  # its coarsest setting is better than the error asked for
    setting = "step" if row["tolerance"] is None else "tolerance"
    ratio = "best" if is_best else f"{short_number(row['ratio'], 2)} \u00d7"
    return Price(f"{at_most}{duration(row['seconds'])}", ratio, f"{setting} {short_number(row[setting], 2)}", is_best)


def best_first(result: Mapping[str, Any]) -> list[str]:
    """The labels of the methods: those that reach most errors first, of these the cheapest at the smallest of them."""
    ranks: dict[str, tuple[int, float]] = {}
    for target in result["targets"]:
        for row in target["rows"]:
            reached, seconds = ranks.get(row["method"], (0, 0.0))
            known = row["seconds"] is not None
            ranks[row["method"]] = (reached - known, row["seconds"] if known else seconds)
    return sorted(ranks, key=ranks.__getitem__)


def price_sentences(targets: Iterable[Mapping[str, Any]], called: Callable[[str], str] = str) -> list[str]:
    """Which method is the fastest for which error, and what three more digits take with the best and the worst.

    `called` gives the names of the methods.
    """
    fastest: dict[str, list[str]] = {}
    known = []  # each error with the seconds of the methods that reach it and not more, the fastest first
    for target in targets:
        rows = [row for row in target["rows"] if row["seconds"] is not None]
        known.append((target["error"], {row["method"]: row["seconds"] for row in rows if not row["at_most"]}))
        # What is better at its coarsest setting might be faster still.
        first = [*rows[:1], *(row for row in rows[1:] if row["at_most"])][:2]
        if first:
            names = " or ".join(called(row["method"]) for row in first)
            fastest.setdefault(names, []).append(power(target["error"]))
    if not fastest:
        return ["No method reached a relative error of 1e-3. Take smaller steps."]
    cases = [f"{', '.join(errors)}: {names}" for names, errors in fastest.items()]
    found = [f"The fastest for an error of {'; for '.join(cases)}."]
    for (coarse, before), (fine, after) in itertools.pairwise(known):
        factors = {name: after[name] / before[name] for name in after if name in before}
        if coarse < 1e-3 and len(factors) > 1:
            best, worst = next(iter(factors)), max(factors, key=factors.__getitem__)
            each = [(short_number(factors[name], 2), called(name)) for name in dict.fromkeys((best, worst))]
            longer = [(f"{times} times " if times != "1" else "", name) for times, name in each]
            sentence = " and ".join(f"{times}as long with {name}" for times, name in longer)
            found.append(f"Three more digits, from {power(coarse)} to {power(fine)}, take {sentence}.")
            break
    return found
