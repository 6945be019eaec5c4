"""Result documents as the page shows them: sentences, typeset formulas, the proof step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from markupsafe import Markup

from inverse_service.expressions.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.glossary import Term, terms_in
from inverse_service.web.pages.rendering import duration

TENSORS = (("Phi", "Φ", "\\Phi"), ("nabla_Phi", "∇Φ", "\\nabla\\Phi"))
QUESTIONS = {"L(q, q')": "L(q, q\u2032)", "L(t, q, q')": "L(t, q, q\u2032)"}
VERDICTS = {"variational": "a Lagrangian", "not_variational": "no Lagrangian", "undetermined": "undetermined"}
# What no line can be broken in.
UNBREAKABLE = ("<mtable", "<mfrac", "<msqrt")
# A page shows so many steps; the whole is in the JSON.
MAX_STEPS = 200


@dataclass(frozen=True, slots=True)
class Matrix:
    """A tensor by name, a curvature as one matrix for each upper index; shown once on the page, at `anchor`."""

    name: str
    math: Markup
    anchor: str = ""


@dataclass(frozen=True, slots=True)
class Step:
    """A sentence, its formula where the sentence does not say it already, and the matrices that it uses."""

    text: Markup
    formula: Markup | None
    matrices: list[Matrix]
    is_wide: bool
    terms: tuple[Term, ...] = ()


@dataclass(frozen=True, slots=True)
class ShownFormula:
    """A formula with its letter, its text for a screen reader, and its domain or momenta."""

    math: Markup
    text: str
    domain: list[Markup] = field(default_factory=list)
    momenta: list[Markup] = field(default_factory=list)
    constraints: list[Markup] = field(default_factory=list)
    implicit: bool = False
    family: str = ""


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


def answer_of(part: Mapping[str, Any], question: str, result: Mapping[str, Any]) -> ShownAnswer:
    """The main answer of a result, or its `with_time`."""
    names = typesetting.names_of(result["system"])
    matrices = matrices_of(result["conditions"], names)
    steps = _said_once([_step(step, names, matrices) for step in part["explanation"][:MAX_STEPS]])
    return ShownAnswer(
        QUESTIONS[question],
        part["verdict"],
        headline(part, question),
        part["reason"],
        _lagrangian(part["lagrangian"], names),
        [_lagrangian_part(other, names) for other in part["other_lagrangians"]],
        _hamiltonian(part["hamiltonian"], names),
        typesetting.matrix(part["multiplier"], names) if part["multiplier"] else None,
        part["solution_space"],
        steps,
        max(0, len(part["explanation"]) - MAX_STEPS),
        part["checked"],
    )


def headline(part: Mapping[str, Any], question: str) -> str:
    """The verdict in one sentence."""
    kind = QUESTIONS[question]
    if part["verdict"] == "not_variational":
        return f"These equations do not come from any regular Lagrangian {kind}."
    if part["verdict"] == "undetermined":
        return f"Whether a regular Lagrangian {kind} exists was not settled."
    if part["lagrangian"] is None:
        return f"A regular Lagrangian {kind} exists; none was found in closed form."
    return f"These equations come from a regular Lagrangian {kind}."


def title_of(result: Mapping[str, Any]) -> str:
    """What tells this result from others in tabs and bookmarks: its name or first equation, and the verdict."""
    system = result["system"] or {}
    lines = list((system.get("equations") or {}).items())
    first = f"{lines[0][0]}'' = {lines[0][1]}" if lines else "A system"
    named = system.get("name") or (first if len(lines) < 2 else f"{first}, \u2026")
    return f"{named[:60]}: {VERDICTS[result['verdict']]}"


def other_question(result: Mapping[str, Any]) -> str:
    """A sentence on L(t, q, q') where the main answer is on L(q, q')."""
    verdict = result["verdict_with_time"]
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


def _lagrangian(part: Mapping[str, Any] | None, names: Names) -> ShownFormula | None:
    return None if part is None else _lagrangian_part(part, names)


def _lagrangian_part(part: Mapping[str, Any], names: Names) -> ShownFormula:
    domain = [typesetting.formula(condition, names) for condition in part["domain"]]
    shown = typesetting.equation("L", part["text"], names)
    return ShownFormula(shown, f"L = {part['text']}", domain, family=part.get("family", ""))


def _hamiltonian(part: Mapping[str, Any] | None, names: Names) -> ShownFormula | None:
    if part is None:
        return None
    momenta = [typesetting.formula(f"{name} = {text}", names) for name, text in part["momenta"].items()]
    constraints = [typesetting.formula(f"{text} = 0", names) for text in part["constraints"]]
    shown = typesetting.equation("H", part["text"], names)
    return ShownFormula(shown, f"H = {part['text']}", [], momenta, constraints, part["implicit"])


def matrices_of(conditions: Mapping[str, Any] | None, names: Names) -> list[Matrix]:
    """Phi, nabla Phi, and each nonzero block of R."""
    if conditions is None:
        return []
    found = [
        Matrix(symbol, _named_matrix(latex, conditions[key], names), f"matrix-{key}")
        for key, symbol, latex in TENSORS
        if conditions.get(key)
    ]
    for index, block in enumerate(conditions.get("R") or [], start=1):
        if any(entry != "0" for row in block for entry in row):
            found.append(Matrix(f"R{index}", _named_matrix(f"R^{{{index}}}", block, names), f"matrix-R{index}"))
    return found


def _named_matrix(latex: str, rows: Sequence[Sequence[str]], names: Names) -> Markup:
    left = typesetting.latex_inner(latex)
    inner = typesetting.matrix_inner(rows, names)
    if inner is None:
        return typesetting.matrix(rows, names)
    return typesetting.math(f"<mrow>{left}<mo>=</mo>{inner}</mrow>", display=True)


def _step(step: Mapping[str, str], names: Names, matrices: list[Matrix]) -> Step:
    text, says_formula = typesetting.sentence(step["text"], names)
    shown = None if says_formula or not step["latex"] else typesetting.latex(step["latex"])
    plain = step["text"].replace("nabla Phi", "∇Φ").replace("Phi", "Φ")
    used = [m for m in matrices if _uses(plain, m.name)]
    return Step(text, shown, used, any(tag in text for tag in UNBREAKABLE), terms_in(plain))


def _said_once(steps: Sequence[Step]) -> list[Step]:
    """Links to matrices and words stand at the first step that uses them."""
    seen: set[str] = set()
    found = []
    for step in steps:
        matrices = [matrix for matrix in step.matrices if matrix.anchor not in seen]
        terms = tuple(term for term in step.terms if term.key not in seen)
        seen |= {matrix.anchor for matrix in matrices} | {term.key for term in terms}
        found.append(replace(step, matrices=matrices, terms=terms))
    return found


def _uses(text: str, name: str) -> bool:
    if name == "Φ":
        return "Φ" in text.replace("∇Φ", "")
    if name.startswith("R"):
        return "R^j_kl" in text or "(R)_" in text or "components of R" in text
    return name in text


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
