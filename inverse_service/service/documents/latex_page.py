"""A result as a LaTeX document that compiles by itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from inverse_service import __version__, errors
from inverse_service.expressions import notation, printing
from inverse_service.expressions.tree import Symbol
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import canonical, text_page

SIGNS = {"!=": r" \neq ", ">=": r" \geq ", "<=": r" \leq "}
IN_A_SENTENCE = 150.0  # points of a formula that stands in a line of text
_AFTER_A_DISPLAY = re.compile(r"((?: \\end\{aligned\})? \\\])([.,:;]+)")
_RELATION = re.compile(r" (!=|>=|<=|>|<) ")
SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}  # fmt: skip


def latex_page(result: dict[str, Any], explain: bool, address: str = "") -> str:
    """The whole document, ending with a newline; `address` is where the result stands, if it stands anywhere."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb,url}", r"\sloppy", r"\begin{document}"]
    end = [_source(result, address), r"\end{document}"]
    if text_page.is_forward_result(result):
        return "\n".join([*lines, *forward_latex(result), *end]) + "\n"
    names = names_of(result["system"])
    lines += [line for each in text_page.motions_of(result) for line in any_associated_latex(each, explain, names)]
    if result.get("nonholonomic") is not None:
        lines += nonholonomic_latex(result["nonholonomic"], names)
    if result["system"] is not None:
        lines += [escaped(result["system"]["name"]), *map(display, result["system"]["latex"].values())]
    lines += _cases(result)
    for branch in () if text_page.asks_motion_alone(result) else text_page.branches_of(result):
        for answer, with_time in text_page.answers_of(branch, result):
            lines += _answer(answer, with_time, explain, result["system"])
    if result.get("nonholonomic") is None:
        lines += first_integrals_latex(result.get("first_integrals") or ())
    if result.get("special_cases") is not None:
        lines += special_cases_latex(result["special_cases"])
    lines += _further(result)
    # The comma after a formula on lines of its own stands in its last line.
    return _AFTER_A_DISPLAY.sub(r"\2\1", "\n".join([*lines, *end])) + "\n"


def _source(result: Mapping[str, Any], address: str) -> str:
    """Which program in which version found it, and where it can be read again."""
    made = result.get("provenance") or {}
    program = escaped(f"{made.get('program', 'inverse-service')} {made.get('version', __version__)}")
    place = rf": \url{{{address}}}" if address else ""
    return rf"\paragraph{{}} Found by {program}{place}."


def _cases(result: dict[str, Any]) -> Iterator[str]:
    """All cases with their verdicts, before the answers, where there are several."""
    branches, left = text_page.branches_of(result), result.get("not_answered") or []
    if len(branches) > 1 or left:
        differ = ", which differ" * (text_page.common_verdict(branches) == "mixed")
        yield rf"{len(branches)} cases{differ}: \begin{{itemize}}"
        for branch in branches:
            where = conditions_latex(branch["domain"], result["system"])
            yield rf"\item {where}: {text_page.spaced(branch['verdict'])}"
        for one in left:
            where = conditions_latex(one["domain"], result["system"]) if one["domain"] else "elsewhere"
            yield rf"\item {where}: not answered"
        yield r"\end{itemize}"


def _answer(answer: Mapping[str, Any], with_time: bool, explain: bool, system: dict[str, Any] | None) -> Iterator[str]:
    """The verdict, L and H with the sets where they hold, the momenta and the constraints among them."""
    if answer.get("domain"):
        yield f"At generic points of the connected set where {conditions_latex(answer['domain'], system)}:"
    yield escaped(f"{text_page.verdict_sentence(answer['verdict'], with_time)} {answer['reason']}".strip())
    if answer.get("exceptions") and system:
        yield escaped(f"This holds {canonical.in_general(system['parameters'], answer['exceptions'])}.")
    if answer["checked"] is not None:
        yield f"Independent check: {answer['checked']}."
    if answer["lagrangian"] is None and answer["verdict"] == "variational":
        yield "No Lagrangian in closed form was found."
    hamiltonian = answer["hamiltonian"]
    momenta = hamiltonian["momenta"] if hamiltonian else {}
    for letter, part in (("L", answer["lagrangian"]), ("H", hamiltonian)):
        if part is not None:
            yield display(f"{letter} = {part['latex']}")
            yield from _where_regular(part, system, momenta)
    if hamiltonian and hamiltonian.get("reason"):
        yield escaped(f"{hamiltonian['reason'].rstrip('.')}.")
    if momenta and system:
        yield from (
            display(f"{printing.to_latex(Symbol(p))} = {_latex(text, system, momenta)}") for p, text in momenta.items()
        )
    if hamiltonian and hamiltonian["constraints"] and system:
        yield "The motion with constraints has in phase space the image"
        yield from (display(f"{_latex(text, system, momenta)} = 0") for text in hamiltonian["constraints"])
    if answer["solution_space"] is not None:
        yield escaped(answer["solution_space"]["statement"])
    if explain:
        yield from latex_proof(answer["explanation"], names_of(system))


def _further(result: dict[str, Any]) -> Iterator[str]:
    """What there is instead of L(q, q'), and the answers about kinds and with another clock."""
    system, instead, clock = result["system"], result.get("instead"), result.get("with_clock")
    found = [(text_page.instead_answered(instead), instead)] if instead else []
    for told, part in (*found, *text_page.kinds_answered(result)) if system is not None else ():
        if told:
            yield rf"\paragraph{{}} {escaped(told)}"
            yield from (display(f"{sign} = {part[key]['latex']}") for sign, key in text_page.FORMULAS if part[key])
            yield from _where_regular(part["lagrangian"] or {}, system)
    if clock:
        told = f"With the clock dtau = ({clock['factor']}) dt:"
        yield rf"\paragraph{{}} {escaped(told)}"
        yield from _answer({"solution_space": None, "explanation": [], **clock}, False, False, system)


def _where_regular(
    part: Mapping[str, Any], system: dict[str, Any] | None, letters: Iterable[str] = ()
) -> Iterator[str]:
    if part.get("domain"):
        yield f"where {conditions_latex(part['domain'], system, letters)}."
    yield from (f"Regular {escaped(part['regular'])}." for _ in text_page.regular_where(part))


def conditions_latex(conditions: Sequence[str], system: Mapping[str, Any] | None, letters: Iterable[str] = ()) -> str:
    """Conditions such as "x != 0" as formulas in a sentence."""
    if system is None:
        return escaped(", ".join(conditions))
    return ", ".join(_formula(_condition(condition, system, letters)) for condition in conditions)


def _condition(condition: str, system: Mapping[str, Any], letters: Iterable[str]) -> str:
    pieces = enumerate(_RELATION.split(condition))
    return "".join(SIGNS.get(one, f" {one} ") if k % 2 else _latex(one, system, letters) for k, one in pieces)


def _latex(text: str, system: Mapping[str, Any], letters: Iterable[str] = ()) -> str:
    return printing.to_latex(reader.read_formula(text, text_page.names_in(system, letters)))


def forward_latex(result: dict[str, Any]) -> Iterator[str]:
    """The same as displayed formulas."""
    part = result["hamiltonian"]
    for left, right in text_page.forward_rows(result, "latex"):
        yield display(f"{left} = {right}")
        yield from _where_regular(part, result["system"], part["momenta"]) if left == "H" else ()


def special_cases_latex(part: dict[str, Any]) -> Iterator[str]:
    """The same as lines of LaTeX; conditions are formulas."""
    yield r"\paragraph{For which parameters?}"
    yield from text_page.cases_answered(part["variational_when"], "A Lagrangian exists", "latex")
    if part["variational_when_with_time"] not in (None, part["variational_when"]):
        yield from text_page.cases_answered(
            part["variational_when_with_time"], "A Lagrangian $L(t, q, q')$ exists", "latex"
        )
    yield f"Cases examined: {part['examined']}. " + (
        "The tree is complete." if part["complete"] else "The tree may not be complete:"
    )
    yield from (escaped(reason) for reason in part["reasons"])
    yield from _items(part["tree"])


def _items(node: dict[str, Any]) -> Iterator[str]:
    yield r"\begin{itemize}"
    found = f", $L = {node['lagrangian']['latex']}$" if node.get("lagrangian") else ""
    yield f"\\item {text_page.where(node['conditions'], 'latex')}: {text_page.spaced(node['verdict'])}{found}"
    for child in node["children"]:
        yield from _items(child)
    yield r"\end{itemize}"


def any_associated_latex(part: Mapping[str, Any], explain: bool, names: Names) -> Iterator[str]:
    """The answer about the motion itself: L, its restriction and transverse momenta, H and the image."""
    yield f"{_sentence(part, 'statement', names)} {escaped(part['reason'])}".strip()
    if part.get("exceptions"):
        yield escaped(f"This holds {canonical.in_general(names.parameters, part['exceptions'])}.")
    if part["checked"]:
        yield f"Independent check: {part['checked']}."
    found = part["lagrangian"]
    if found is not None:
        yield from _rows(("L", found), (r"\ell", found["on_constraints"]))
        yield from _rows(*((rf"\lambda_{{{k}}}", one) for k, one in enumerate(found["transverse_momenta"], 1)))
    elif part["verdict_with_time"] == "variational":
        yield "No Lagrangian in closed form was found."
    yield from _rows(("H", part["hamiltonian"]))
    yield from _rows(*((one, "0") for one in part["image"]))
    if part["freedom"]:
        yield escaped(f"Up to total derivatives, L along the constraints depends on {part['freedom']}.")
    if explain:
        yield from latex_proof(part["explanation"], names)


def nonholonomic_latex(part: dict[str, Any], names: Names) -> Iterator[str]:
    """The equations of motion, what they keep, the associated systems, and each Hamiltonisation."""
    motion = part["equations_of_motion"]
    yield "The Lagrangian and the constraints are"
    yield from _rows(("L", part["lagrangian"]), *((found, "0") for found in part["constraints"]))
    yield "and the nonholonomic motion is"
    yield from _rows(*((rf"\ddot{{{name}}}", found) for name, found in _lettered(motion["second_order"])))
    yield from _rows(*((rf"\dot{{{name}}}", found) for name, found in _lettered(motion["first_order"])))
    yield from _rows(*((rf"\lambda_{{{k}}}", found) for k, found in enumerate(motion["multipliers"], 1)))
    yield from (_sentence(part[name], "statement", names) for name in ("paper_class", "integrable"))
    yield from _rows(*((found, r"\text{constant}") for found in part["integrable"]["integrals"]))
    yield _sentence(part["measure_density"], "statement", names)
    yield from _rows(("N", part["measure_density"]["density"]))
    yield from first_integrals_latex(part["first_integrals"])
    for one in part["associated"]:
        yield rf"The {one['kind']} associated system: {text_page.spaced(one['verdict'] or 'not defined')}. \\"
    for one in part["hamiltonisation"]:
        yield f"By the {one['associated']} associated system:"
        yield from _rows(("L", one["lagrangian"]), ("H", one["hamiltonian"]))
        yield from _rows(*((found, "0") for found in one["constraints"]))


def first_integrals_latex(found: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """What is constant along the motion."""
    if found:
        yield "Constant along the motion:"
    yield from _rows(*((rf"\text{{{escaped(one['name'])}}}", one) for one in found))


Side = str | Mapping[str, Any] | None


def _rows(*equations: tuple[Side, Side]) -> Iterator[str]:
    """Displayed equations between formulas; one with a side that is missing is left out."""
    for sides in equations:
        if None not in sides:
            yield display(" = ".join(side if isinstance(side, str) else side["latex"] for side in sides if side))


def _lettered(table: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Each coordinate in LaTeX."""
    for name, found in table.items():
        yield printing.to_latex(Symbol(name)), found


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def display(formula: str) -> str:
    """A formula on a line of its own; a long one on several."""
    lines = printing.lines_of_latex(formula)
    if len(lines) == 1:
        return f"\\[ {formula} \\]"
    broken = r" \\ & \quad ".join(lines)
    return f"\\[ \\begin{{aligned}} & {broken} \\end{{aligned}} \\]"


def latex_proof(steps: Sequence[Mapping[str, Any]], names: Names) -> Iterator[str]:
    """The lines of an enumeration; formulas of the sentences are set as formulas."""
    if not steps:
        return
    yield r"\begin{enumerate}"
    yield from (f"\\item {_sentence(step, 'text', names)}" for step in steps)
    yield r"\end{enumerate}"


def _sentence(said: Mapping[str, Any], key: str, names: Names) -> str:
    """Its words and formulas, those that follow the sentence on lines of their own."""
    parts = said.get("parts") or [said[key]]
    if isinstance(parts[0], Mapping):  # of an older version
        parts = [said[key]]
    found = []
    for place, part in enumerate(parts):
        is_below = place % 2 and parts[place - 1].rstrip()[-1:] in (".", "") and place == len(parts) - 1
        found.append((display if is_below else _formula)(latex_of(part, names)) if place % 2 else escaped(part))
    return "".join(found)


_SIDES = re.compile(r"[()\[\]]|, | (?:!=|>=|<=|=|>|<) ")


def latex_of(text: str, names: Names) -> str:
    """The LaTeX of a formula of a sentence: relations between formulas of the system and terms of the theory."""
    found, depth, start = "", 0, 0
    for match in _SIDES.finditer(text):
        sign = match.group()
        depth += (sign in "([") - (sign in ")]")
        if depth == 0 and sign not in ")]":
            found += _side(text[start : match.start()], names) + SIGNS.get(sign.strip(), sign)
            start = match.end()
    return found + _side(text[start:], names)


def _side(text: str, names: Names) -> str:
    try:
        return printing.to_latex(reader.read_formula(text, names))
    except errors.InputError:
        return notation.theory(text).latex.strip()


def names_of(system: Mapping[str, Any] | None) -> Names:
    """The names that formulas about a system have, its momenta and the entries of g among them."""
    if system is None:
        return Names()
    n, coordinates = len(system["coordinates"]), tuple(system["coordinates"])
    entries = [f"{letter}_{i}{j}" for letter in "gh" for i in range(1, n + 1) for j in range(i, n + 1)]
    functions = {name: tuple(arguments) for name, arguments in (system.get("functions") or {}).items()}
    words = [*system["parameters"], *(f"p_{name}" for name in coordinates), *entries, "L", "H"]
    taken = {*coordinates, *functions, "t"}
    return Names(coordinates, tuple(dict.fromkeys(word for word in words if word not in taken)), functions)


def _formula(formula: str) -> str:
    """A formula in a sentence; one that is wider than a line gets lines of its own."""
    return f"${formula}$" if len(printing.lines_of_latex(formula, IN_A_SENTENCE)) == 1 else display(formula)
