"""A result as a LaTeX document that compiles by itself."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from inverse_service import __version__, errors
from inverse_service.expressions import notation, printing
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import latex_lines, text_page

SIGNS = {"!=": r" \neq ", ">=": r" \geq ", "<=": r" \leq "}
IN_A_SENTENCE = 150.0  # points of a formula in a line of text
_AFTER_A_DISPLAY = re.compile(r"((?: \\end\{aligned\})? \\\])([.,:;]+)")
SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}  # fmt: skip


def latex_page(result: dict[str, Any], explain: bool, address: str = "") -> str:
    """The whole document, ending with a newline; `address` is that of the result, if it has one."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb,url}", r"\sloppy", r"\begin{document}"]
    names, part = names_of(result["system"]), result.get("nonholonomic")
    if part:
        found = [display(f"{one['latex']} = 0") for one in part["constraints"]]
        lines += ["The Lagrangian and the constraints are", display(f"L = {part['lagrangian']['latex']}"), *found]
    lines += [_line(line, names) for line in text_page.outline(result, explain)]
    # The comma after a displayed formula belongs in its last line.
    whole = "\n".join([*lines, _source(result, address), r"\end{document}"])
    return _AFTER_A_DISPLAY.sub(r"\2\1", whole) + "\n"


def _source(result: Mapping[str, Any], address: str) -> str:
    """Which program in which version found it, and where it can be read again."""
    made = result.get("provenance") or {}
    program = escaped(f"{made.get('program', 'inverse-service')} {made.get('version', __version__)}")
    place = rf": \url{{{address}}}" if address else ""
    return rf"\paragraph{{}} Found by {program}{place}."


def _line(line: text_page.Line, names: Names) -> str:
    """A paragraph of words and formulas, or a displayed formula, and where it holds."""
    found, parts = [], line.parts
    for place, part in enumerate(parts):
        if place % 2 == 0:
            assert isinstance(part, str)
            ended = part.rstrip(")")[-1:] in ".:;?"
            alone = part and len(parts) == 1
            found.append(escaped(part[:1].upper() + part[1:] + "." * (not ended) if alone else part))
        else:
            before = str(parts[place - 1]).rstrip()
            is_below = before[-1:] in (".", "") and place == len(parts) - 1
            found.append((display if is_below else _formula)(_equation(part, names)))
    paragraph = (r"\par " + rf"\hspace*{{{line.depth - 1}em}}" * (line.depth > 1)) if parts and parts[0] else ""
    where = f"where {', '.join(_formula(latex_of(one, names)) for one in line.conditions)}." if line.conditions else ""
    return "\n".join(filter(None, (paragraph + "".join(found), where)))


def _equation(formula: text_page.Formula, names: Names) -> str:
    sides = formula if isinstance(formula, tuple) else (formula,)
    return " = ".join(
        latex_of(side, names) if isinstance(side, str) else side.get("latex") or latex_of(side["whole"], names)
        for side in sides
    )


def sentence(parts: Sequence[str], names: Names) -> str:
    """Words and formulas alternately, the formulas between dollar signs, one after the end of the sentence apart."""
    found = [f"${latex_of(part, names)}$" if place % 2 else part for place, part in enumerate(parts)]
    return "".join(f" {part}" if place and found[place - 1].endswith(".") else part for place, part in enumerate(found))


def conditions_latex(conditions: Sequence[str], system: Mapping[str, Any] | None) -> str:
    """Conditions such as "x != 0" as formulas in a sentence."""
    names = names_of(system)
    return ", ".join(_formula(latex_of(condition, names)) for condition in conditions)


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def display(formula: str) -> str:
    """A displayed formula; a long one is on several lines."""
    lines = latex_lines.lines_of_latex(formula)
    if len(lines) == 1:
        return f"\\[ {formula} \\]"
    broken = r" \\ & \quad ".join(lines)
    return f"\\[ \\begin{{aligned}} & {broken} \\end{{aligned}} \\]"


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
    if text.startswith("∫ "):
        integrand, _, variable = text[2:].rpartition(" d")
        return rf"\int {latex_of(integrand, names)} \, d{latex_of(variable, names)}"
    try:
        return printing.to_latex(reader.read_formula(text, names))
    except errors.InputError:
        return _theory(text).strip()


def _theory(text: str) -> str:
    """The notation of the theory; dL/dx' is a fraction."""
    found, place = "", 0
    for match in notation.SLOPE.finditer(text):
        above, name, index, primes = match.groups()
        below = printing.name_latex(name, ("", "dot", "ddot")[len(primes)]) + (f"^{{{index}}}" if index else "")
        found += notation.to_latex(text[place : match.start()]) + rf"\frac{{\partial {above}}}{{\partial {below}}}"
        place = match.end()
    return found + notation.to_latex(text[place:])


def names_of(system: Mapping[str, Any] | None) -> Names:
    """The names that formulas about a system have, its momenta and the entries of g among them."""
    if system is None:
        return Names()
    n = len(system["coordinates"])
    entries = [f"{letter}_{i}{j}" for letter in "gh" for i in range(1, n + 1) for j in range(i, n + 1)]
    return text_page.names_in(system, [*(f"p_{name}" for name in system["coordinates"]), *entries, "L", "H"])


def _formula(formula: str) -> str:
    """A formula in a sentence; one that is wider than a line is displayed."""
    return f"${formula}$" if len(latex_lines.lines_of_latex(formula, IN_A_SENTENCE)) == 1 else display(formula)
