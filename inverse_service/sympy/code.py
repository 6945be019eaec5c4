"""Programs in other languages by SymPy's printers, common parts computed once.

Each quantity is a function of t, the coordinates, the velocities (the momenta, where H is over
them) and parameters.

Three languages are whole programs: SymPy; JAX and diffrax, the motion as a vector field f(t, y,
args) with L, H and momenta of the same arguments; ModelingToolkit.jl, the motion as second-order
equations with L and H as expressions.
"""

from __future__ import annotations

import keyword
import textwrap
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import sympy
from jinja2 import Template
from sympy.core.function import AppliedUndef
from sympy.printing import c, cxx, rust
from sympy.printing.codeprinter import CodePrinter, ccode, cxxcode
from sympy.printing.fortran import FCodePrinter
from sympy.printing.numpy import JaxPrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.rust import RustCodePrinter
from sympy.printing.str import StrPrinter

from inverse_service.errors import InputError
from inverse_service.expressions.functions import FUNCTION
from inverse_service.service.documents import stated
from inverse_service.sympy.from_sympy import Solved, expression, with_letters, with_symbols

_SPECIAL_OF_SYMPY = tuple(
    getattr(sympy, row.sympy or row.name) for row in FUNCTION.values() if row.special
)
QUANTITIES = ("accelerations", "lagrangian", "momenta", "hamiltonian", "multiplier")
_TABLES = tomllib.loads((Path(__file__).parent / "languages.toml").read_text(encoding="utf-8"))
_NAMES, _SPECIAL = _TABLES.pop("names"), _TABLES.pop("special")
# Names that no variable of a program may have.
_WORDS = {
    *keyword.kwlist,
    *c.reserved_words,
    *cxx.reserved["C++11"],
    *rust.reserved_words,
    *QUANTITIES,
}
_WORDS |= {*_NAMES["words"].split(), *_NAMES["called"].split()}
_RESERVED = {*_NAMES["reserved"].split()}
_JAX_FUNCTIONS = ("lagrangian", "momenta", "hamiltonian")
_MODELINGTOOLKIT_WORDS = frozenset(["D", "equations", "motion", "System"])


@dataclass(frozen=True)
class Language:
    """How a function is written: a row of languages.toml, which says what each key is."""

    printed: Callable[[Any], str]
    printer: str  # the name of `printed`
    opening: str
    assignment: str
    scalar: str
    several: str
    comment: str
    start: str = ""
    closing: str = ""
    argument: str = "{}"
    words: str = ""


class _RustPrinter(RustCodePrinter):  # type: ignore[misc]
    """All numbers are f64. SymPy 1.14 loses brackets: k*(x + y) of real symbols is k*x + y, exp(-2)
    is -2.exp().
    """

    _print_Add, _print_Mul = CodePrinter._print_Add, CodePrinter._print_Mul

    def _print_caller_var(self, expr: Any) -> str:
        return str(self.parenthesize(expr, PRECEDENCE["Func"]))

    def _print_Pow(self, expr: Any) -> str:
        if expr.exp.is_Integer and expr.exp != -1:
            return f"{self._print_caller_var(expr.base)}.powi({expr.exp})"
        return str(self._print_Function(expr))

    def _print_Integer(self, expr: Any) -> str:
        return f"{expr}_f64"

    def _print_Pi(self, expr: Any) -> str:
        return "std::f64::consts::PI"

    def _print_Exp1(self, expr: Any) -> str:
        return "std::f64::consts::E"


def _rust(expression: Any) -> str:
    printer = _RustPrinter()
    return str(printer.doprint(printer._rewrite_known_functions(expression)))


class _MaximaPrinter(StrPrinter):  # type: ignore[misc]
    """SymPy's own text, in which |x| has Maxima's name."""

    def _print_Abs(self, expr: Any) -> str:
        return f"abs({self._print(expr.args[0])})"


def _maxima(expression: Any) -> str:
    named = {sympy.pi: sympy.Symbol("%pi"), sympy.E: sympy.Symbol("%e")}
    return str(_MaximaPrinter().doprint(expression.subs(named))).replace("**", "^")


class _FortranPrinter(FCodePrinter):  # type: ignore[misc]
    """SymPy's, with pi in its place and not as a PARAMETER statement before it, and with the sign
    of a real number.
    """

    def _print_Pi(self, expr: Any) -> str:
        return "3.1415926535897932d0"

    def _print_Exp1(self, expr: Any) -> str:
        return "2.7182818284590452d0"

    def _print_Function(self, expr: Any) -> str:
        text = str(super()._print_Function(expr))
        return (
            f"({text})" if text.startswith("-") else text
        )  # a number, which may be the base of a power

    def _print_sign(self, expr: Any) -> str:
        argument = self._print(expr.args[0])
        return f"merge(0d0, sign(1d0, {argument}), {argument} == 0d0)"


def _fortran(expression: Any) -> str:
    return str(
        _FortranPrinter({"source_format": "free", "standard": 95}).doprint(
            _within_integers(expression)
        )
    )


def _within_integers(expression: Any) -> Any:
    """The expression with integers of more than 32 bits as real numbers: C cuts a longer literal
    off.
    """
    return expression.xreplace(
        {n: sympy.Float(n, 17) for n in expression.atoms(sympy.Integer) if abs(n) >= 1 << 31}
    )


def _c(expression: Any) -> str:
    return str(ccode(_within_integers(expression)))


def _cpp(expression: Any) -> str:
    return str(cxxcode(_within_integers(expression)))


_PRINTERS: dict[str, Callable[[Any], str]] = {
    "rust": _rust, "maxima": _maxima, "fortran": _fortran, "c": _c, "cpp": _cpp,
}  # fmt: skip


def with_special(expression: Any, language: str, printed: Callable[[Any], str]) -> Any:
    """The expression with symbols that are the text of the special functions in it; InputError for
    one that the language does not have.
    """
    words = _SPECIAL[language]

    def called(function: Any) -> Any:
        name = type(function).__name__
        text, order = words.get(name), function.args[0]
        if text is None or (name in words.get("whole", "").split() and not order.is_Integer):
            have = [one for one, known in _SPECIAL.items() if name in known and one != language]
            raise InputError(
                f"{language} has no function {name} of these arguments: choose "
                f"{' or '.join(['sympy', *have])}."
            )
        return sympy.Symbol(text.format(*map(printed, function.args)))

    return expression.replace(lambda part: isinstance(part, _SPECIAL_OF_SYMPY), called)


LANGUAGES = {
    name: Language(_PRINTERS.get(row["printer"]) or getattr(sympy, row["printer"]), **row)
    for name, row in _TABLES.items()
}


def program(answer: Solved, language: str) -> str:
    """The whole text; InputError for a language that is not there, and for arbitrary functions in
    compiled code.

    A quantity with an integral that has no formula is left out, and a comment says so.
    """
    if language in WHOLE:
        return WHOLE[language](answer)
    if language not in LANGUAGES:
        listed = ", ".join([*WHOLE, *LANGUAGES])
        raise InputError(f"There is no code in '{language[:20]}': the languages are {listed}.")
    chosen = LANGUAGES[language]
    parts = [
        chosen.comment.format(left_out) if left_out else _function(answer, what, chosen)
        for what, left_out in known_quantities(answer)
    ]
    return chosen.start + "\n\n".join(parts) + "\n"


def known_quantities(
    answer: Solved, wanted: Sequence[str] = QUANTITIES
) -> Iterator[tuple[str, str]]:
    """What the answer has of these, each with why it is left out of a program, which is empty where
    it is not.

    That is an integral in it, for which only SymPy's program has a class.
    """
    integrals = stated.auxiliary_of(answer._shown).keys()
    for what in wanted:
        quantity = quantity_of(answer, what)
        if quantity is not None:
            functions = sympy.Tuple(*sympy.flatten([quantity])).atoms(sympy.Function)
            found = sorted({call.func.__name__ for call in functions} & integrals)
            without = next(
                (
                    f"{name} is an integral without a formula. The format sympy has it."
                    for name in found
                ),
                "",
            )
            yield what, f"{what} is left out: {without}" if without else ""


def quantity_of(answer: Solved, what: str) -> Any:
    """An expression, a list of them, a matrix, or None where the answer has no such thing."""
    hamiltonian = answer.hamiltonian if what in ("momenta", "hamiltonian") else None
    match what:
        case "accelerations":
            return list(answer.accelerations)
        case "lagrangian":
            return answer.lagrangian
        case "multiplier":
            return answer.multiplier
        case "momenta":
            return None if hamiltonian is None else list(hamiltonian.momenta.values())
        case "hamiltonian":
            return None if hamiltonian is None else hamiltonian.expr
    raise InputError(
        f"There is no '{what[:20]}' in an answer: choose one of {', '.join(QUANTITIES)}."
    )


def program_arguments(answer: Solved, what: str) -> list[Any]:
    """t, the coordinates, the velocities (the momenta, for H over them), the parameters."""
    table, hamiltonian = answer._table, answer.hamiltonian if what == "hamiltonian" else None
    speeds = [table.velocity(name) for name in table.coordinates]
    if hamiltonian is not None and not hamiltonian.implicit:
        speeds = list(hamiltonian.momenta)
    return [table.time, *table.coordinates.values(), *speeds, *table.parameters.values()]


def where_defined(answer: Solved, what: str) -> tuple[str, ...]:
    """Where this quantity is what its name says; the accelerations are everywhere."""
    further = (
        (answer._shown.get("hamiltonian") or {}).get("domain", ()) if what == "hamiltonian" else ()
    )
    return () if what == "accelerations" else tuple(dict.fromkeys((*answer._where, *further)))


def lambdified(answer: Solved, what: str, modules: Any) -> Callable[..., Any]:
    """A numerical function of t, x, x_dot (p_x for H), k, each also by this name; InputError where
    there is none.
    """
    quantity = quantity_of(answer, what)
    if quantity is None:
        raise InputError(f"The answer has no {what}: see its verdict.")
    given = program_arguments(answer, what)
    plain = plain_symbols(given, answer, LANGUAGES["python"])
    many = isinstance(quantity, list | tuple)
    written = (
        [with_plain(each, plain) for each in quantity] if many else with_plain(quantity, plain)
    )
    found: Callable[..., Any] = sympy.lambdify([plain[each] for each in given], written, modules)
    return found


def _function(answer: Solved, what: str, language: Language) -> str:
    """One quantity as a function of plain numbers."""
    given = program_arguments(answer, what)
    plain = plain_symbols(given, answer, language)
    value = quantity_of(answer, what)
    values = list(value) if isinstance(value, list | sympy.MatrixBase) else [value]
    shared, written = sympy.cse(
        [with_plain(each, plain) for each in values], sympy.numbered_symbols("c_")
    )
    refuse_functions([*written, *(part for _, part in shared)])
    name = next(name for name, one in LANGUAGES.items() if one is language)
    written = [with_special(each, name, language.printed) for each in written]
    shared = [(symbol, with_special(part, name, language.printed)) for symbol, part in shared]
    names = [str(plain[each]) for each in given]
    local = [str(symbol) for symbol, _ in shared]
    opening = language.opening.format(
        name=what,
        arguments=", ".join(language.argument.format(name) for name in names),
        locals=", ".join(local) or "dummy",
        size=len(values),
        declared=f"  double precision :: {', '.join(local)}" if local else "",
    ).rstrip("\n")
    lines = [
        language.comment.format(f"where {condition}") for condition in where_defined(answer, what)
    ]
    lines += [_continued(opening) if language.printed is _fortran else opening]
    lines += [language.assignment.format(symbol, language.printed(part)) for symbol, part in shared]
    return "\n".join(
        [
            *lines,
            *_returned([language.printed(each) for each in written], language),
            language.closing,
        ]
    ).rstrip()


def _continued(text: str) -> str:
    """Lines of at most 100 characters; Fortran ends at 132."""
    return "\n".join(
        " &\n      ".join(textwrap.wrap(line, 100, drop_whitespace=False))
        for line in text.split("\n")
    )


def refuse_functions(expressions: Sequence[Any]) -> None:
    """InputError for arbitrary functions, which no language knows."""
    if any(each.atoms(AppliedUndef, sympy.Subs) for each in expressions):
        raise InputError(
            "The system has arbitrary functions, and code needs formulas for them: give them by 'where'."
        )


def _returned(texts: list[str], language: Language) -> list[str]:
    if len(texts) == 1:
        return [language.scalar.format(texts[0])]
    if "{values}" in language.several:
        return [language.several.format(values=", ".join(texts))]
    pairs = enumerate(texts)
    return [
        language.several.format(place=place, place1=place + 1, value=text) for place, text in pairs
    ]


def plain_symbols(
    given: Sequence[Any], answer: Solved, language: Language, defined: frozenset[str] = frozenset()
) -> dict[Any, Any]:
    """x, x_dot, p_x as symbols whose names every language takes and the program does not have
    `defined`.
    """
    table = answer._table
    words = {
        table.time: "t",
        **{each: name for name, each in (*table.coordinates.items(), *table.parameters.items())},
    }
    words |= {table.velocity(name): f"{name}_dot" for name in table.coordinates}
    words |= {each: name for name, each in table.momenta.items()}
    used: set[str] = set()
    found = {}
    bare = language.printed in (sympy.mathematica_code, sympy.maple_code)
    own = defined.union(language.words.split())
    for each in given:
        name = words.get(each, str(each))
        name, end, taken = (
            (name.replace("_", ""), "0", _WORDS | _RESERVED) if bare else (name, "_", _WORDS | own)
        )
        while {name, name.lower()} & taken or name.lower() in used:
            name += end
        used.add(name.lower())
        found[each] = sympy.Symbol(name, real=True)
    return found


def with_plain(expression: Any, plain: dict[Any, Any]) -> Any:
    # Printers write integers into the cases of a step, or do not know it; at 0 it has no value here
    # either.
    return with_symbols(expression, plain).replace(
        sympy.Heaviside, lambda u, *_: (1 + u / sympy.Abs(u)) / 2
    )


class _ExactPrinter(StrPrinter):  # type: ignore[misc]
    """SymPy's own text, in which 1/3 stays exact."""

    def _print_Rational(self, expr: Any) -> str:
        return str(expr.p) if expr.q == 1 else f"Rational({expr.p}, {expr.q})"

    def _print_Half(self, expr: Any) -> str:
        return "Rational(1, 2)"


def _sympy_program(answer: Solved) -> str:
    """Symbols, the motion, L with its Euler-Lagrange residuals, and H, as a program that imports
    SymPy alone.
    """
    table, words = answer._table, _python_words(answer)
    renamed = {
        each: sympy.Symbol(word)
        for each, word in words.items()
        if not isinstance(each, AppliedUndef)
    }
    time = renamed[table.time]
    calls = {
        each: sympy.Function(word)(time)
        for each, word in words.items()
        if isinstance(each, AppliedUndef)
    }

    def text(found: Any) -> str:
        return str(_ExactPrinter().doprint(found.subs(calls).subs(renamed)))

    def of(known: Mapping[str, Any]) -> tuple[list[str], list[tuple[int, str]]]:
        """The arguments of an integral, and its derivatives by their places."""
        slopes = enumerate(map(known["derivatives"].get, known["arguments"]), 1)
        formal = [text(expression(argument, inside)) for argument in known["arguments"]]
        return formal, [
            (place, text(expression(slope, inside))) for place, slope in slopes if slope is not None
        ]

    integrals, hamiltonian = stated.auxiliary_of(answer._shown), answer.hamiltonian
    inside = with_letters(table, integrals)
    functions = [(words[each], each.func) for each in calls]
    functions += [(name, found) for name, found in table.functions.items() if name not in integrals]
    pairs = zip(answer.equations, answer.accelerations, strict=True)
    return _filled(
        "sympy",
        symbols=[(symbol, each) for each, symbol in renamed.items()]
        + [(name, name) for name in inside.parameters if name not in table.parameters],
        functions=functions,
        integrals=[(name, *of(known)) for name, known in integrals.items()],
        motion=[(text(left), text(right)) for left, right in pairs],
        lagrangian=None if answer.lagrangian is None or not calls else text(answer.lagrangian),
        lagrangian_where=where_defined(answer, "lagrangian"),
        coordinates=map(text, calls),
        time=time,
        hamiltonian=None if hamiltonian is None else text(hamiltonian.expr),
        hamiltonian_where=where_defined(answer, "hamiltonian"),
        momenta=[] if hamiltonian is None else hamiltonian.momenta,
    )


def _filled(program: str, **values: Any) -> str:
    """The text of a program, whose parts are in programs/."""
    text = (Path(__file__).parent / "programs" / f"{program}.j2").read_text(encoding="utf-8")
    return str(
        Template(text, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True).render(
            values
        )
    )


def _python_words(answer: Solved) -> dict[Any, str]:
    """A Python name for each symbol and coordinate that no name of SymPy hides."""
    table = answer._table
    taken = {*dir(sympy), "motion", "L", "H", "q", "x_", "residual", "time", "each", "print"}
    named = [(table.time_name, table.time), *table.coordinates.items(), *table.parameters.items()]
    return {
        each: f"{name}_" if name in taken or keyword.iskeyword(name) else name
        for name, each in named
    }


def jax_program(answer: Solved) -> str:
    """With `diffrax.ODETerm(vector_field)` the motion of y = (q, v); args are the parameters in
    their order.

    H over the momenta has y = (q, p).
    """
    table = answer._table
    field = [*(table.velocity(name) for name in table.coordinates), *answer.accelerations]
    found = [("vector_field", "", (), *_jax_function(answer, "accelerations", field))]
    for what, left_out in known_quantities(answer, _JAX_FUNCTIONS):
        parts = () if left_out else _jax_function(answer, what, quantity_of(answer, what))
        found.append((what, left_out, where_defined(answer, what), *parts))
    return _filled("jax", functions=[(*each, *[""] * (6 - len(each))) for each in found])


class JaxFunction(NamedTuple):
    """The parts of a function for JAX."""

    state: list[str]
    parameters: list[str]
    returned: str


def _jax_function(answer: Solved, what: str, value: Any) -> JaxFunction:
    """The names of the state and of the parameters, and what is given back."""
    given = program_arguments(answer, what)
    plain = plain_symbols(given, answer, LANGUAGES["python"])
    shown = [with_plain(each, plain) for each in (value if isinstance(value, list) else [value])]
    refuse_functions(shown)

    def printed(each: Any) -> str:
        return str(JaxPrinter().doprint(each)).replace("jax.numpy.", "jnp.")

    texts = [printed(with_special(each, "jax", printed)) for each in shown]
    names, size = [str(plain[each]) for each in given[1:]], 2 * len(answer._table.coordinates)
    return JaxFunction(
        names[:size],
        names[size:],
        f"jnp.array([{', '.join(texts)}])" if isinstance(value, list) else texts[0],
    )


def modelingtoolkit_program(answer: Solved) -> str:
    """`mtkcompile(motion)` reduces it to first order; momenta are the variables p_x."""
    table = answer._table
    given = program_arguments(answer, "accelerations")
    plain = plain_symbols(given, answer, LANGUAGES["julia"], _MODELINGTOOLKIT_WORDS)
    names = {name: str(plain[each]) for name, each in table.coordinates.items()}
    # D(x) is written where the printer of Julia would write the symbol of the velocity.
    speeds = {plain[table.velocity(name)]: sympy.Symbol(f"D({names[name]})") for name in names}

    def text(expression: Any) -> str:
        shown = with_plain(expression, plain)
        refuse_functions([shown])
        return str(sympy.julia_code(with_special(shown.subs(speeds), "julia", sympy.julia_code)))

    def quantity(what: str, left_out: str) -> tuple[str, str, list[Any], Sequence[str], str]:
        hamiltonian = answer.hamiltonian if what == "hamiltonian" else None
        momenta = [] if hamiltonian is None or hamiltonian.implicit else list(hamiltonian.momenta)
        formula = "" if left_out else text(quantity_of(answer, what))
        return what, left_out, momenta, where_defined(answer, what), formula

    pairs = zip(names.values(), answer.accelerations, strict=True)
    return _filled(
        "modelingtoolkit",
        parameters=[plain[each] for each in table.parameters.values()],
        names=list(names.values()),
        equations=[(name, text(f)) for name, f in pairs],
        quantities=[
            quantity(*each) for each in known_quantities(answer, ("lagrangian", "hamiltonian"))
        ],
    )


# Programs that are more than one function for each quantity.
WHOLE: dict[str, Callable[[Solved], str]] = {
    "sympy": _sympy_program,
    "jax": jax_program,
    "modelingtoolkit": modelingtoolkit_program,
}
