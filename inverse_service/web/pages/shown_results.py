"""Result documents as the page shows them: sentences, typeset formulas, the proof step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from markupsafe import Markup

from inverse_service.certificate.formulas import FORMAT
from inverse_service.errors import InputError
from inverse_service.reading.document_names import GUESS, Declared, known_names
from inverse_service.reading.names import Names
from inverse_service.reading.reader import equation_line
from inverse_service.service.documents.text_page import QUESTIONS as QUESTION
from inverse_service.service.documents.text_page import (
    answers_of,
    branches_of,
    common_verdict,
    motions_of,
    regular_where,
)
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.form_documents import right_side
from inverse_service.web.pages.rendering import duration
from inverse_service.web.pages.steps import Step, matrices_of, said_once, step_of

QUESTIONS = {"L(q, q')": "L(q, q\u2032)", "L(t, q, q')": "L(t, q, q\u2032)"}
VERDICTS = {"variational": "a Lagrangian", "not_variational": "no Lagrangian", "undetermined": "undetermined"}
VERDICTS["mixed"] = "cases that differ"
# A page shows so many steps; the whole is in the JSON.
MAX_STEPS = 200


@dataclass(frozen=True, slots=True)
class ShownFormula:
    """A formula with its letter, its text for a screen reader, and its domain or momenta."""

    math: Markup
    text: str
    domain: list[Markup] = field(default_factory=list)
    momenta: list[Markup] = field(default_factory=list)
    constraints: list[Markup] = field(default_factory=list)
    reason: str = ""
    family: str = ""
    regular: Sequence[str] = ()
    integrals: Sequence[Markup] = ()
    kept: Sequence[Markup] = ()


@dataclass(frozen=True, slots=True)
class ShownAnswer:
    """One answer: to L(q, q') or to L(t, q, q')."""

    question: str
    verdict: str
    headline: str
    reason: str
    lagrangian: ShownFormula | None
    others: list[ShownFormula]
    hamiltonian: ShownFormula | None
    multiplier: Markup | None
    space: Mapping[str, Any] | None
    steps: list[Step]
    left_out: int
    checked: str | None
    domain: list[Markup]


def answer_of(part: Mapping[str, Any], question: str, result: Mapping[str, Any]) -> ShownAnswer:
    """The main answer of a result, or its `with_time`."""
    integrals = part.get("integrals") or {}
    names = typesetting.names_of(result["system"], integrals)
    matrices = matrices_of(result["conditions"], names)
    steps = said_once([step_of(step, names, matrices) for step in part["explanation"][:MAX_STEPS]])
    return ShownAnswer(
        QUESTIONS[question],
        part["verdict"],
        headline(part, question, subject_of(result)),
        part["reason"],
        _lagrangian(part["lagrangian"], names, typesetting.integrals(integrals, names)),
        [_lagrangian_part(other, names) for other in part["other_lagrangians"]],
        _hamiltonian(part["hamiltonian"], names, typesetting.conserved(part, result["system"], names)),
        typesetting.matrix(part["multiplier"], names) if part["multiplier"] else None,
        part["solution_space"],
        steps,
        max(0, len(part["explanation"]) - MAX_STEPS),
        proof_of(part),
        typesetting.conditions(part.get("domain", ()), names),
    )


def glance_of(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """The verdicts with their Lagrangians alone; None where nothing was settled in the time that there was."""
    if "verdict" not in result:
        energy = typesetting.equation("H", result["hamiltonian"]["text"], typesetting.names_of(result["system"]))
        return {"answers": [], "motion": "", "forward": energy}
    lean: dict[str, Any] = {**result, "explanation": [], "conditions": None}
    parts = [one for branch in branches_of(lean) for one in answers_of(branch, lean)]
    shown = [answer_of({**part, "explanation": []}, QUESTION[timed], lean) for part, timed in parts]
    motion = " ".join(one["statement"] for one in motions_of(result))
    settled = sorted((one for one in shown if one.verdict != "undetermined"), key=lambda one: one.lagrangian is None)
    return {"answers": settled, "motion": motion, "forward": None} if settled or motion else None


def proof_of(part: Mapping[str, Any]) -> str | None:
    """What the checker said of a stored answer; "old" where its certificate has a format that proved too little."""
    certificate = part.get("certificate") or {}
    return "old" if certificate.get("format", FORMAT) != FORMAT else part.get("checked")


def shown_of(branch: Mapping[str, Any], result: Mapping[str, Any]) -> tuple[ShownAnswer, ShownAnswer | None]:
    """The answer that a reader sees first, and that to the other question."""
    first, *rest = [answer_of(part, QUESTION[timed], result) for part, timed in answers_of(branch, result)]
    return first, rest[0] if rest else None


def subject_of(result: Mapping[str, Any]) -> str:
    """What a verdict is about: the equations, or one associated system of a motion with constraints."""
    part = result.get("nonholonomic")
    return f"The equations of the {part['main']} associated system" if part else "These equations"


def headline(part: Mapping[str, Any], question: str, subject: str = "These equations") -> str:
    """The verdict in one sentence."""
    kind = QUESTIONS[question]
    if part["verdict"] == "not_variational":
        return f"{subject} do not come from any regular Lagrangian {kind}."
    if part["verdict"] == "undetermined":
        return f"Whether a regular Lagrangian {kind} exists was not settled."
    if part["lagrangian"] is None and "lagrangian" in {each["part"] for each in part.get("incomplete", ())}:
        return f"A regular Lagrangian {kind} exists."
    if part["lagrangian"] is None:
        return f"A regular Lagrangian {kind} exists; none was found in closed form."
    return f"{subject} come from a regular Lagrangian {kind}."


@dataclass(frozen=True, slots=True)
class OwnLagrangian:
    """What is said of a visitor's own L: a sentence, formulas, and reasons."""

    lagrangian: str
    headline: str
    lines: list[Markup]
    reasons: list[str]


@dataclass(frozen=True, slots=True)
class Further:
    """A further answer: a sentence, formulas, and what the checker said of it."""

    headline: str
    lines: list[Markup]
    checked: str


KINDS = {
    "rayleigh": "With friction: the Euler-Lagrange expressions of this L are the derivatives of D in the velocities.",
    "parameters": "A Lagrangian where",
    "reduced": "A Lagrangian of the reduced system",
}
SAID = {"variational": "yes", "not_variational": "no", "undetermined": "not settled"}


def further_of(result: Mapping[str, Any]) -> list[Further]:
    """What holds instead of a no, the kinds of Lagrangian that were asked for, and the answer with another clock."""
    names = typesetting.names_of(result["system"])
    found = []
    part = result.get("instead")
    if part and part["kind"] != "time":  # that with time has a section of its own
        clock = part.get("clock")
        words, texts = ("with the clock ", [clock]) if clock else ("", part.get("conditions") or [])
        told = Markup("Instead: {} {}{}").format(KINDS[part["kind"]], words, _listed(texts, names))
        found.append(Further(told, _formulas_of(part, names), part["checked"]))
    for name, part in (result.get("kinds") or {}).items():
        headline = Markup("A Lagrangian of the kind \u201c{}\u201d: {}{}")
        said = headline.format(name, SAID[part["verdict"]], _on_branch(result, names))
        found.append(Further(said, _formulas_of(part, names), part["checked"] or ""))
    reduced = result.get("reduced") or {}
    if reduced:
        over = Markup(", ").join(typesetting.formula(name, names) for name in reduced["coordinates"])
        said = Markup("The reduced system in {}: {}{}").format(
            over, SAID[reduced["verdict"]], _on_branch(reduced, names)
        )
        found.append(Further(said, _formulas_of(reduced, names), reduced["checked"] or ""))
    clock = result.get("with_clock") or reduced.get("with_clock")
    if clock:
        factor = typesetting.formula(clock["factor"], names)
        said = Markup("With the clock d\u03c4 = {} dt: {}{}").format(
            factor, SAID[clock["verdict"]], _on_branch(clock, names)
        )
        found.append(Further(said, _formulas_of(clock, names), clock["checked"] or ""))
    return found


def _on_branch(part: Mapping[str, Any], names: Names) -> Markup:
    return Markup(", where {}").format(_listed(part["domain"], names)) if part.get("domain") else Markup("")


def _listed(texts: Sequence[str], names: Names) -> Markup:
    return Markup(", ").join(typesetting.formula(text, names) for text in texts)


def _formulas_of(part: Mapping[str, Any], names: Names) -> list[Markup]:
    """L, D and H, where they are there."""
    letters = (("L", "lagrangian"), ("D", "dissipation"), ("H", "hamiltonian"))
    return [typesetting.equation(letter, part[key]["text"], names) for letter, key in letters if part.get(key)]


OWN = {
    "valid": "Yes: the Euler-Lagrange equations of this L are these equations.",
    "invalid": "No: this L has other equations.",
    "incomplete": "This could not be settled.",
    "unread": "This L cannot be read.",
}


def own_of(check: Mapping[str, Any], names: Names) -> OwnLagrangian:
    """The verdict on a visitor's L, with what is left of the Euler-Lagrange equations and what L gives instead."""
    lines: list[Markup] = []
    reasons = list(check["reasons"])
    if check["verdict"] != "valid":
        names, alone = _with_those_of(right_side(check["lagrangian"]), names)
        reasons += (
            [f"{', '.join(alone)}: not in the equations, so of any value."] if alone and check["residual"] else []
        )
        left = {name: f["text"] for name, f in (check["residual"] or {}).items() if f["text"] != "0"}
        own = {name: f["text"] for name, f in (check["equations"] or {}).items()}
        lines += [
            typesetting.of_theory(f"d/dt dL/d{name}' - dL/d{name} = ") + typesetting.formula(text, names)
            for name, text in left.items()
        ]
        lines += [Markup("it gives ") + typesetting.formula(f"{name}'' = {text}", names) for name, text in own.items()]
    return OwnLagrangian(check["lagrangian"], OWN[check["verdict"]], lines, reasons)


def _with_those_of(lagrangian: str, names: Names) -> tuple[Names, list[str]]:
    """The names with the constants and functions that occur in a visitor's L alone, and these."""
    try:
        found = known_names(Declared(names.coordinates, GUESS, names.functions), {"": lagrangian}, order=1).names
    except InputError:
        return names, []
    alone = [name for name in (*found.parameters, *found.functions) if name not in names.declared()]
    return replace(names, parameters=(*names.parameters, *found.parameters), functions=found.functions), alone


def equations_of(system: Mapping[str, Any]) -> list[Markup]:
    """The equations of motion, as a rule solved for the accelerations."""
    names = typesetting.names_of(system)
    return [typesetting.formula(equation_line(*pair), names) for pair in system["equations"].items()]


def title_of(result: Mapping[str, Any]) -> str:
    """What tells this result from others in tabs and bookmarks: its name or first equation, and the verdict."""
    system = result["system"] or {}
    lines = list((system.get("equations") or {}).items())
    first = equation_line(*lines[0]) if lines else "A system"
    given = (system.get("given") or {}).get("lagrangian")
    constrained = f"L = {given} with constraints" if given else ""
    named = constrained or system.get("name") or (first if len(lines) < 2 else f"{first}, \u2026")
    return f"{named[:60]}: {VERDICTS[common_verdict(branches_of(result))]}"


def other_question(result: Mapping[str, Any], main: ShownAnswer) -> str:
    """A sentence on the question that the main answer does not answer."""
    verdict = result["verdict_with_time"]
    if main.question != QUESTIONS[result["question"]]:
        return "There is one without the time, too: see below."
    if verdict is None or result["question"] != "L(q, q')":
        return ""
    if verdict == result["verdict"] and not result["with_time"]:
        same = {
            "variational": "The same holds if L may contain the time.",
            "not_variational": "There is none that contains the time either.",
            "undetermined": "The question with time in L was not settled either.",
        }
        return same[verdict]
    return {
        "variational": "If L may contain the time, there is one: see below.",
        "not_variational": "There is none that contains the time either: see below.",
        "undetermined": "Whether one that contains the time exists was not settled.",
    }[verdict]


def _lagrangian(part: Mapping[str, Any] | None, names: Names, integrals: Sequence[Markup]) -> ShownFormula | None:
    return None if part is None else replace(_lagrangian_part(part, names), integrals=integrals)


def _lagrangian_part(part: Mapping[str, Any], names: Names) -> ShownFormula:
    domain = typesetting.conditions(part.get("domain", ()), names)
    shown = typesetting.equation("L", part["text"], names)
    return ShownFormula(
        shown, f"L = {part['text']}", domain, family=part.get("family", ""), regular=regular_where(part)
    )


def _hamiltonian(part: Mapping[str, Any] | None, names: Names, kept: Sequence[Markup]) -> ShownFormula | None:
    if part is None:
        return None
    momenta = [typesetting.formula(f"{name} = {text}", names) for name, text in part["momenta"].items()]
    constraints = [typesetting.formula(f"{text} = 0", names) for text in part["constraints"]]
    shown = typesetting.equation("H", part["text"], names)
    domain = typesetting.conditions(part.get("domain", ()), names)
    return ShownFormula(shown, f"H = {part['text']}", domain, momenta, constraints, _reason(part), kept=kept)


def _reason(part: Mapping[str, Any]) -> str:
    """Why H is written in the velocities; that of a result from before it had one is short."""
    plain = "Written in coordinates and velocities: no closed form of the velocities in the momenta was found."
    return part.get("reason") or plain if part["implicit"] else ""


def timing(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The stages with their seconds, and the sum."""
    seconds = provenance.get("seconds")
    if not isinstance(seconds, dict) or not seconds:
        return []
    rows = [(str(stage), duration(value)) for stage, value in seconds.items() if isinstance(value, int | float)]
    if "all" in seconds:
        return [("all together" if stage == "all" else stage, shown) for stage, shown in rows]
    total = sum(value for value in seconds.values() if isinstance(value, int | float))
    return [*rows, ("all together", duration(total))]
