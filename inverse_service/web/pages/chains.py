"""Chains of equal bodies as documents, for the form of a scene."""

import itertools
from collections.abc import Callable
from typing import Any

from inverse_service.web.pages import WORDS

LONGEST, LONGEST_OF_RODS = 32, 12
NAMES: dict[str, str] = {key: name for key, name, _ in WORDS["chains"]}


def chain_of(text: str) -> tuple[str, int] | None:
    """The kind and the number of bodies of "chain:springs:8"; None for another text. The number is kept in bounds."""
    kind, _, number = text.removeprefix("chain:").partition(":")
    if not text.startswith("chain:") or kind not in NAMES:
        return None
    most = LONGEST_OF_RODS if kind == "rods" else LONGEST
    return kind, min(most, max(2, int(number[:4]) if number.isdecimal() else 8))


def document_of(kind: str, number: int) -> dict[str, Any]:
    """L of a chain of so many bodies."""
    return {"name": f"{NAMES[kind]}, {number}", **_MAKERS[kind](number)}


def _springs(number: int, energy: Callable[[str], str]) -> str:
    """m x_k'^2 / 2 less the energy of each spring; the first and the last one end at walls."""
    names = [f"x{k}" for k in range(1, number + 1)]
    stretched = [
        names[0],
        *(f"({right} - {left})" for left, right in itertools.pairwise(names)),
        names[-1],
    ]
    return " + ".join(f"m/2*{name}'^2" for name in names) + "".join(
        f" - {energy(one)}" for one in stretched
    )


def _of_springs(number: int) -> dict[str, Any]:
    return _line(number, _springs(number, lambda d: f"k/2*{d}^2"), ("m", "k"))


def _fpu(number: int) -> dict[str, Any]:
    """Fermi, Pasta and Ulam, 1955: the beta model."""
    lagrangian = _springs(number, lambda d: f"k/2*{d}^2 - b/4*{d}^4")
    return _line(number, lagrangian, ("m", "k", "b"))


def _toda(number: int) -> dict[str, Any]:
    """Toda, 1967, with open ends: e^(x_k - x_(k + 1)) between neighbors."""
    names = [f"x{k}" for k in range(1, number + 1)]
    pairs = itertools.pairwise(names)
    kinetic = " + ".join(f"m/2*{name}'^2" for name in names)
    return _line(number, kinetic + "".join(f" - exp({a} - {b})" for a, b in pairs), ("m",))


def _rods(number: int) -> dict[str, Any]:
    """Rods without mass, a mass at the end of each, angles from the vertical."""
    names = [f"theta{k}" for k in range(1, number + 1)]
    terms = list[str]()
    for i, one in enumerate(names):
        terms.append(f"{number - i}*m*l^2/2*{one}'^2 + {number - i}*m*g*l*cos({one})")
        terms += [
            f"{number - j}*m*l^2*cos({one} - {names[j]})*{one}'*{names[j]}'"
            for j in range(i + 1, number)
        ]
    return {
        "coordinates": names,
        "lagrangian": " + ".join(terms),
        "parameters": ["m", "l", "g"],
    }


def _line(number: int, lagrangian: str, parameters: tuple[str, ...]) -> dict[str, Any]:
    return {
        "coordinates": [f"x{k}" for k in range(1, number + 1)],
        "lagrangian": lagrangian,
        "parameters": list(parameters),
    }


_MAKERS: dict[str, Callable[[int], dict[str, Any]]] = {
    "springs": _of_springs, "fpu": _fpu, "toda": _toda, "rods": _rods,
}  # fmt: skip
