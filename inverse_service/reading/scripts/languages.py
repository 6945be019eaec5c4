"""Which language a program is written in, and the document of the system that it comes to."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from inverse_service.reading.scripts import (
    c_like,
    fortran,
    golang,
    julia,
    maple,
    mathematica,
    matlab,
    maxima,
    modelica,
    nodes as nd,
    python,
    r_language,
    systems,
)
from inverse_service.reading.scripts.machine import Dialect


@dataclass(frozen=True, slots=True)
class Language:
    """A language by the words that its programs have: one of `needs`, and none of `lacks`; or by a
    form that no program of another language has, which is then not tried.
    """

    dialect: Dialect
    read: Callable[[str], tuple[nd.Node, ...]]
    needs: Sequence[str] = ()
    lacks: Sequence[str] = ()
    form: re.Pattern[str] | None = None
    with_one_of: Sequence[str] = ()  # signs one of which its programs have, too
    remarks: re.Pattern[str] | None = None  # in which the words of another language may stand

    def is_that_of(self, text: str) -> bool:
        """Whether a text has the words of this language, if it has not the form of another one."""
        known = any(word in text for word in self.needs)
        plain = "\n".join(self.remarks.split(text)) if self.remarks else text
        besides = not self.with_one_of or any(sign in plain for sign in self.with_one_of)
        return known and besides and not any(word in plain for word in self.lacks)


_OF_JULIA = ("using ", "Problem(", "const \u03c9", "du[", "ddu", " in 1:", "global x")
LANGUAGES = (
    Language(
        Dialect("Julia", 1), julia.read_julia, _OF_JULIA,
        ("def ", "syms ", "double ", "{\n", "import numpy", "@(", "model ", "@variables", "@mtkmodel"),
        # a function without braces whose entries have square brackets
        re.compile(r"\A(?!.*(?:\{|@(?!inbounds\b|views\b|fastmath\b|simd\b|\.)))(?=.*\w\[\d)"
                   r".*^[ \t]*(?:@\w+[ \t]+)?function[ \t]+\w+!?\([^()\n]*\)[ \t]*\n.*^[ \t]*end\b",
                   re.DOTALL | re.MULTILINE),
    ),
    Language(
        Dialect("Julia", 1), julia.read_julia, ("@variables", "@parameters", "Differential(", "D_nounits"),
        ("def ", "{\n", "import numpy", "@mtkmodel", "@connector", "connect(", "@reaction", "@component", "model "),
    ),
    Language(
        Dialect("Mathematica", 1, free_functions=True),
        mathematica.read_mathematica,
        ("[t]", "[\u03c4]", "[t_]", "[tau]", "DSolve[", "DSolveValue[", "Derivative["),
        ("def ", "import "),
    ),
    Language(
        Dialect("Sage", from_end=True), partial(python.program, is_sage=True), ("var(", "function(", "sage:"),
        ("syms ", ":="),
    ),
    Language(
        Dialect("Python", from_end=True), partial(python.program, is_sage=False),
        ("import ", "def ", "symbols(", "dynamicsymbols(", "Function(", "while ", "Symbol(", "range(", "make_vars(",
         ".hamiltonian("),
        ("{\n", "^", ":="), remarks=re.compile(r"#[^\n]*"),
    ),
    Language(
        Dialect("MATLAB", 1, function_names=True, time_first=True, functions_first=True),
        matlab.read_matlab, ("syms ", "@(", "function ", "ode45", "\nend", "dsolve('", "dsolve(\u2018", "inline('"),
        (":=", "{\n", ") {", "import ", "def ", "equation", *_OF_JULIA), remarks=re.compile(r"[%#][^\n]*"),
    ),
    Language(
        Dialect("Maple", 1, free_functions=True), maple.read_maple,
        (":=", "dsolve("), ("depends(", "block(", "$\n", "_]", "%i", "import ", "gradef("),
    ),
    Language(
        Dialect("Maxima", 1, free_functions=True), maxima.read_maxima,
        ("$", "%i", "depends(", "gradef(", "'diff("), ("\\", "_]", "import "),
    ),
    Language(
        Dialect("JavaScript"), c_like.read_javascript,
        ("let ", "var ", "const ", "function ", "=>", "Math."),
        ("double ", "float ", "#include", "std::", "syms ", *_OF_JULIA), with_one_of=("{", "=>", "+=", "-="),
    ),
    Language(
        Dialect("C", whole_quotients=True), c_like.read_c,
        ("double ", "float ", "#include", "std::", "void "), ("syms ",),
    ),
    Language(Dialect("R", 1, time_first=True), r_language.read_r, form=r_language.FORM),
    Language(Dialect("Fortran", 1, whole_quotients=True, time_before=True), fortran.read_fortran, form=fortran.FORM),
    Language(
        Dialect("JavaScript"), c_like.read_typescript,
        form=re.compile(r":\s*(?:readonly\s+)?(?:number|Float64Array)\b"),
    ),
    Language(Dialect("Modelica", 1), modelica.read_modelica, form=modelica.FORM),
    Language(Dialect("Go", whole_quotients=True), golang.read_go, form=golang.FORM),
)  # fmt: skip


_WORDS = frozenset(word for language in LANGUAGES for word in language.needs)


def is_program(text: str) -> bool:
    """Whether a text has the form of a program, or its words and more than one statement."""
    several = any(sign in text for sign in ("\n", ";", ":=", "DSolve[", "plotdf("))
    return (several and any(map(text.__contains__, _WORDS))) or bool(_of_form(text))


def _of_form(text: str) -> list[Language]:
    return [language for language in LANGUAGES if language.form and language.form.search(text)]


def what_it_comes_to(text: str) -> systems.Run:
    """What a program comes to; NotRead where it is none that can be run with certainty, and Trap
    where this is so in each language that it may be written in.
    """
    found: list[systems.Run] = []
    reasons: list[nd.NotRead] = []
    for language in _of_form(text) or [one for one in LANGUAGES if one.is_that_of(text)]:
        try:
            made = systems.run_program(language.read(text), language.dialect)
        except nd.NotRead as error:
            reasons.append(error)
            continue
        if made not in found:
            found.append(made)
    if len(found) != 1:
        others = [reason for reason in reasons if not isinstance(reason, nd.Trap)]
        places = (others or reasons) if not found else []
        raise max(places, key=lambda reason: reason.at, default=nd.NotRead(""))
    return found[0]
