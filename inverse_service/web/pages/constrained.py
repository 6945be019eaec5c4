"""The nonholonomic part of a result as the page shows it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup, escape

from inverse_service.expressions.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.answers import Step, step_of


@dataclass(frozen=True, slots=True)
class Associated:
    """One associated system with its verdict and Lagrangian."""

    kind: str
    verdict: str
    explanation: str
    equations: list[Markup]
    lagrangian: Markup | None
    hamiltonian: Markup | None


@dataclass(frozen=True, slots=True)
class Confirmed:
    """That the flow of H holds the motion: its statements with what their tests said."""

    label: str
    hamiltonian: Markup | None
    constraints: list[Markup]
    statements: list[tuple[Markup, str]]
    holds: bool


@dataclass(frozen=True, slots=True)
class Constrained:
    """Everything about the constrained system itself."""

    lagrangian: Markup
    constraints: list[Markup]
    motion: list[Markup]
    statements: list[Markup]
    facts: list[tuple[str, Markup]]
    associated: list[Associated]
    confirmed: list[Confirmed]


@dataclass(frozen=True, slots=True)
class Motion:
    """The answer about the motion itself: a sentence, L with its 1-jet along the constraints, H, and the proof."""

    statement: str
    verdict: str
    reason: str
    checked: str
    formulas: list[Markup]
    freedom: str
    steps: list[Step]


def motion_of(result: Mapping[str, Any]) -> Motion | None:
    """The answer about the motion, None where it was not asked for."""
    part = result.get("any_associated")
    if not part:
        return None
    names, found, lines = typesetting.names_of(result["system"]), part["lagrangian"], list[tuple[str, str]]()
    if found:
        lines += [("L", found["text"]), ("l", found["on_constraints"]["text"])]
        lines += [(f"\u03bb{chr(0x2080 + k)}", one["text"]) for k, one in enumerate(found["transverse_momenta"], 1)]
    if part["hamiltonian"]:
        lines.append(("H", part["hamiltonian"]["text"]))
    return Motion(
        part["statement"],
        part["verdict"],
        part["reason"],
        part["checked"] or "",
        [typesetting.equation(name, text, names) for name, text in lines],
        part["freedom"],
        [step_of(step, names, []) for step in part["explanation"]],
    )


def constrained_of(result: Mapping[str, Any]) -> Constrained | None:
    """The part of a result that answers a nonholonomic document, None where there is none."""
    part = result.get("nonholonomic")
    if not part:
        return None
    names = typesetting.names_of(result["system"])
    motion = part["equations_of_motion"]
    lines = [_line(f"{name}''", f["text"], names) for name, f in motion["second_order"].items()]
    lines += [_line(f"{name}'", f["text"], names) for name, f in motion["first_order"].items()]
    constraints = [typesetting.formula(f"{w['text']} = 0", names) for w in part["constraints"]]
    statements = [
        part["integrable"]["statement"],
        part["paper_class"]["statement"],
        part["measure_density"]["statement"],
    ]
    return Constrained(
        typesetting.equation("L", part["lagrangian"]["text"], names),
        constraints,
        lines,
        [typeset(statement, names) for statement in statements if statement],
        _facts(part, names),
        [_associated(entry["kind"], entry, names) for entry in part["associated"]],
        [_confirmed(entry, names) for entry in part["hamiltonisation"]],
    )


# The paper's form of constraints, and its letters, as a statement spells them; the name after "=" is the system's.
_LETTERS = re.compile(
    r"(?P<form>s' = -A\(r1\) r2')|\b(?P<letter>r[12])\b(?P<is> = (?P<name>\w+))?|\bN\(q\)|\bp = dL/dv\b"
)


def typeset(statement: str, names: Names) -> Markup:
    """A sentence with its formulas set as formulas."""
    parts, last = [], 0
    for found in _LETTERS.finditer(statement):
        letters = re.sub(r"r([12])", r"r_\1", found["letter"] or found.group())
        formula = typesetting.of_theory(f"{letters} =" if found["is"] else letters)
        named = typesetting.formula(found["name"], names) if found["is"] else Markup()
        parts += [escape(statement[last : found.start()]), formula, named]
        last = found.end()
    return Markup("").join([*parts, escape(statement[last:])])


def _facts(part: Mapping[str, Any], names: Names) -> list[tuple[str, Markup]]:
    density = part["measure_density"]["density"]
    found = [("invariant measure N", typesetting.formula(density["text"], names))] if density else []
    return found + [(f["name"], typesetting.formula(f["text"], names)) for f in part["first_integrals"]]


def _line(left: str, right: str, names: Names) -> Markup:
    return typesetting.formula(f"{left} = {right}", names)


def _associated(kind: str, entry: Mapping[str, Any], names: Names) -> Associated:
    lagrangian, hamiltonian = entry.get("lagrangian"), entry.get("hamiltonian")
    return Associated(
        kind,
        entry.get("verdict") or "",
        entry.get("explanation") or entry.get("statement") or "",
        [_line(f"{name}''", text, names) for name, text in entry["equations"].items()],
        typesetting.equation("L", lagrangian["text"], names) if lagrangian else None,
        typesetting.equation("H", hamiltonian["text"], names) if hamiltonian else None,
    )


def _confirmed(entry: Mapping[str, Any], names: Names) -> Confirmed:
    hamiltonian = entry["hamiltonian"]
    return Confirmed(
        f"{entry['associated']}: {entry['label']}",
        typesetting.equation("H", hamiltonian["text"], names) if hamiltonian else None,
        [typesetting.formula(f"{w['text']} = 0", names) for w in entry["constraints"]],
        [(typeset(s["text"], names), s["verdict"]) for s in entry["statements"]],
        entry["holds"],
    )
