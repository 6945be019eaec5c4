"""Random deceptive certificates: false claims with terms that only look like zero, or are zero
without looking like it.

`right` is the valid certificate of a system with a Lagrangian, `other` one that there is none of a
second system in as many coordinates. Each forgery is false: a regular Lagrangian determines its
equations, and a system that has one has no proof of the contrary, in any form of the claim.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from typing import Any

from tests.certificate.tricks import HIDDEN, TINY
from tests.generator import GeneratedSystem
from tests.soundness.corruption import Certificate, Spoilt

PLACES = ("1e-90", "1e90", "1" + "0" * 300, "0", "-20", "30", "900", "1/1000")


def forgeries(
    right: Certificate, other: Certificate, system: GeneratedSystem, rng: random.Random
) -> Iterator[Spoilt]:
    names, other = system.coordinates, _renamed(other, system.coordinates)
    yes, no = right["system"]["equations"], other["system"]["equations"]
    for _ in range(4):
        trick, (term, near) = _drawn(TINY, names, rng)
        mixed = {name: f"{yes[name]}+({term})*(1+({no[name]})^2)" for name in names}
        good = {"claim": "variational", "kind": "lagrangian", "lagrangian": system.lagrangian}
        yield f"a force times {trick}", _dressed(right, mixed, near, names, rng) | good
        scaled = good | {"lagrangian": f"({term})*({system.lagrangian})"}
        yield f"a Lagrangian times {trick}", _dressed(other, no, near, names, rng) | scaled
        yield (
            f"a proof of existence beside {trick}",
            _existence(right, _added(no, term), near, names, rng),
        )
        trick, (term, near) = _drawn(HIDDEN, names, rng)
        same = {name: f"{yes[name]}+({term})*({no[name]})" for name in names}
        rows = {key: other[key] for key in ("claim", "kind", "order", "rows") if key in other}
        yield f"rows that need {trick} not to be 0", _dressed(right, same, near, names, rng) | rows
        yield (
            f"a proof of existence beside {trick}",
            _existence(right, _added(no, term), near, names, rng),
        )
    yield from _with_integrals(other, system)


def _renamed(of: Certificate, names: tuple[str, ...]) -> Certificate:
    """The system with these names of coordinates; rows refer to coordinates by index."""
    new = dict(zip(of["system"]["coordinates"], names, strict=True))
    texts = of["system"]["equations"]
    equations = {new[key]: _with_names(text, new) for key, text in texts.items()}
    return of | {"system": of["system"] | {"coordinates": list(names), "equations": equations}}


def _with_names(text: str, new: dict[str, str]) -> str:
    return re.sub(r"[A-Za-z]\w*", lambda found: new.get(found[0], found[0]), text)


def _drawn(tricks: dict[str, Any], names: tuple[str, ...], rng: random.Random) -> tuple[str, Any]:
    """A trick in the coordinates of the system, and its point."""
    trick = rng.choice(list(tricks))
    text, near = tricks[trick]
    new = dict(zip(("x", "y"), names, strict=False))
    return trick, (
        _with_names(text, new),
        {new.get(key, key): value for key, value in near.items()},
    )


def _added(equations: dict[str, str], term: str) -> dict[str, str]:
    return {name: f"{text}+0*({term})" for name, text in equations.items()}


def _dressed(
    of: Certificate,
    equations: dict[str, str],
    near: dict[str, str],
    names: tuple[str, ...],
    rng: random.Random,
) -> Certificate:
    """The head of a certificate, with a point, conditions, and roots chosen by the forger."""
    parameters, functions = [*of["system"].get("parameters", ()), "a"], {"A": [names[0]]}
    system = of["system"] | {
        "equations": equations,
        "parameters": parameters,
        "functions": functions,
    }
    place = {f"{rng.choice(names)}'": rng.choice(PLACES)} if rng.random() < 0.5 else {}
    more: dict[str, Any] = {}
    if rng.random() < 0.3:
        more["conditions"] = [
            rng.choice(
                ("a+2 > -a^2", f"{names[0]}' < 10^300", f"exp({names[1]}) > 0", "1/10^300 > 0")
            )
        ]
    if rng.random() < 0.3:
        sign = rng.choice(("", "-"))
        more["roots"] = [{"root": f"sqrt({names[1]}'^2)", "is": f"{sign}{names[1]}'"}]
    return {
        "format": of["format"],
        "system": system,
        "question": of["question"],
        "near": near | place,
        **more,
    }


def _existence(
    right: Certificate,
    equations: dict[str, str],
    near: dict[str, str],
    names: tuple[str, ...],
    rng: random.Random,
) -> Certificate:
    """The numbers of the system with a Lagrangian, claimed for the other system: always false."""
    keys = ("claim", "kind", "order", "degree", "dimensions", "symbol", "lagrangian")
    return _dressed(right, equations, near, names, rng) | {
        key: right[key] for key in keys if key in right
    }


def _with_integrals(other: Certificate, system: GeneratedSystem) -> Iterator[Spoilt]:
    """The missing part of L becomes the derivative of a function of t or of a coordinate alone."""
    names, equations = system.coordinates, other["system"]["equations"]
    head = {key: other[key] for key in ("format", "system")} | {
        "claim": "variational",
        "kind": "lagrangian",
    }
    kinetic = "+".join(f"{name}'^2/2" for name in names)
    missing = "+".join(f"(-({equations[name]}))*{name}'" for name in names)
    for by in ("t", names[0]):
        one = {"F": {"arguments": [by], "derivatives": {by: missing}}}
        yield (
            f"an integral by {by}",
            head
            | {"question": "time_dependent", "lagrangian": f"{kinetic}+F({by})", "integrals": one},
        )
