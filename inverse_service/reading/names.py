"""The names that a formula may use, and the names that can be declared."""

import difflib
import json
import re
import tomllib
import unicodedata
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions import printing
from inverse_service.expressions.functions import FUNCTION, STEP, Rule
from inverse_service.expressions.letters import (
    ALIKE,
    DOTS,
    GREEK,
    LETTER_COMMANDS,
    SCRIPT_L,
    SUBSCRIPTS,
)
from inverse_service.expressions.pieces import step
from inverse_service.expressions.refusals import LIMITS, fault, listed_names, refusal, shorten
from inverse_service.expressions.tree import (
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Ordered,
    Velocity,
    has,
    number,
    square_root,
    walk,
)

_ROOM = Path(__file__).parent
# The name that a sign stands for, and the dots that it puts over a letter.
_MEANT = {sign: (name, 0) for sign, name in (GREEK | SUBSCRIPTS | {SCRIPT_L: "ell"}).items()}
_MEANT |= {sign: ("", count) for sign, count in DOTS.items()}
_SLANTED = ("MATHEMATICAL ITALIC ", "PLANCK CONSTANT", "FULLWIDTH LATIN ")
_REASONS = (_ROOM / "refused.ndjson").read_text(encoding="utf-8")


class Rate(NamedTuple):
    """A time derivative: the name, and how often it is differentiated."""

    name: str
    order: int


class Reason(NamedTuple):
    """The problem with a word, what to write instead, the member that could declare it, and
    replacement texts.
    """

    problem: str = ""
    instead: str = ""
    declare: str = ""
    offers: Sequence[str] = ()


def reasons(kind: str) -> dict[str, Reason]:
    """The reasons by word, for words of one kind; WORD in a sentence is replaced by the word."""
    rows = [row for row in map(json.loads, _REASONS.splitlines()) if row.pop("of") == kind]
    pairs = [(word, row) for row in rows for word in row.pop("words")]
    return {
        word: Reason(**{**row, "instead": row["instead"].replace("WORD", word)})
        for word, row in pairs
    }


WORDS: dict[str, dict[str, list[str]]] = tomllib.loads(
    (_ROOM / "words.toml").read_text(encoding="utf-8")
)


def meanings(kind: str) -> dict[str, str]:
    """What each word or sign of a table of `words.toml` means."""
    return {word: meaning for meaning, words in WORDS[kind].items() for word in words}


_PATTERNS = tomllib.loads((_ROOM / "patterns.toml").read_text(encoding="utf-8"))


def pattern(of: str, name: str, frame: str = "{}", **parts: str) -> re.Pattern[str]:
    """The expression of this name in a table of `patterns.toml`, in the place of {} in the frame;
    <<part>> in it is one of the parts or another name.
    """

    def text_of(name: str) -> str:
        text = parts.get(name) or "".join(map(str.strip, _PATTERNS[of][name].splitlines()))
        return re.sub(r"<<(\w+)>>", lambda part: text_of(part[1]), text)

    return re.compile(frame.replace("{}", text_of(name)))


ALIASES = meanings("functions")
# Maximum and minimum: (a + b + |a - b|)/2, (a + b - |a - b|)/2.
EXTREMES = {"max": 1, "min": -1}
DERIVATIVE_NAMES = frozenset(("diff", "Derivative"))
PIECEWISE = frozenset(("piecewise", "Piecewise"))
ELLIPTIC = ("sn", "cn", "dn")
# Names of special functions that denote constants if no argument follows.
MAY_BE_CONSTANTS = frozenset(
    ("J0", "J1", "Y0", "Y1", "Ai", "Bi", "Si", "Ci", "Ei", "Li", *ELLIPTIC)
)
REFUSED = reasons("names")
# Documents may declare these names. If undeclared, they are refused with a better reason than
# "unknown".
REFUSED_UNLESS_DECLARED = reasons("undeclared names")
# Short function names that also serve as coordinates: th for theta.
MAY_BE_DECLARED = frozenset(
    ("th", "ch", "sh", "tg", "tgh", "cotan", "cotg", "arch", "arsh", "arth", "arctg")
)
Role = Literal["coordinate", "parameter", "function"]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
_LATEX_NAME = re.compile(r"\\?([A-Za-z]+[0-9]*)(?:_\{?\\?([A-Za-z0-9]+)\}?)?")
# Suffixes that denote time derivatives, longer ones first.
DOTTED = {
    "_dot_dot": 2,
    "_dotdot": 2,
    "_ddot": 2,
    "dotdot": 2,
    "_dot": 1,
    "ddot": 2,
    "dot": 1,
    "DotDot": 2,  # xDot of MATLAB
    "DDot": 2,
    "Dot": 1,
}
_LONGEST_PRODUCT = 20
_COORDINATE_LETTERS = frozenset(("x", "y", "z", "r", "s", "q", "tau"))
_LETTER = re.compile("[A-Za-z](?:_?[0-9]+)?")
ENDINGS = ("sinh", "cosh", "tanh", "sqrt", "sin", "cos", "tan", "cot", "exp", "log", "ln")
_CALLED_INSIDE = re.compile(
    rf"((?:{_LETTER.pattern}){{1,5}}?)({'|'.join(ENDINGS)})([0-9]*)([A-Za-z]\w*)?"
)
_OF_NUMBERS = ("sqrt", "cbrt", "ln", "log")
GREEK_NAMES = frozenset(GREEK.values())
FUNCTION_LETTERS = frozenset("fFhHUVW")  # functions if a bracket follows without a space
# Letters after which a bracket is usually an argument: f(x - y), V(x + 1).
MAY_BE_FUNCTIONS = frozenset("fFgGhHpPuUvVwW") | {"phi", "Phi", "psi", "Psi", "chi"}
POTENTIALS = frozenset(("U", "V", "Omega"))
_CALLED_WITH_A_NUMBER = re.compile(r"(ln|[A-Za-z]{3,}?)([0-9]+)([A-Za-z]*)")  # sqrt2, sin2x
_NUMBERED = re.compile(r"([A-Za-z]+)_?([0-9]+)")
# Greek names within a run of letters. Capitals count only if they differ from Latin letters: Mu in
# GMu is M and u.
_GREEK_IN_RUNS = {name for name in GREEK_NAMES if name.islower()} | {
    *("Gamma", "Delta", "Theta", "Lambda", "Sigma", "Phi", "Psi", "Omega")
}
# Letters; those of \begin{align*} are one word.
_WORD = re.compile(r"\\(?:begin|end)\s*\{[^{}]*\}|\\?[A-Za-z]+|[^\x00-\x7f]")


def _magnitude(u: Expression) -> Expression:
    """|u| as sqrt(u^2); the solver distinguishes its two branches."""
    return number(abs(u.value)) if isinstance(u, Number) else square_root(u**2)


# Functions that are formulas of others, with the numbers at which they have a value.
_COMPOSED: dict[str, tuple[Rule, Callable[[Fraction], bool], str]] = {
    "sqrt": (square_root, lambda u: u >= 0, "a number that is not negative"),
    "cbrt": (
        lambda u: u ** Fraction(1, 3),
        lambda u: u >= 0,
        "a number that is not negative, as in -cbrt(8)",
    ),
    "abs": (_magnitude, lambda u: True, ""),
    "sign": (lambda u: u / _magnitude(u), bool, "a number other than 0"),
    "erfc": (lambda u: 1 - Apply("erf", u), lambda u: True, ""),
    "log10": (
        lambda u: Apply("log", u) / Apply("log", number(10)),
        lambda u: u > 0,
        "a positive number",
    ),
    "log2": (
        lambda u: Apply("log", u) / Apply("log", number(2)),
        lambda u: u > 0,
        "a positive number",
    ),
}
# Names of functions of a given order.
_OF_ORDER = {"digamma": ("polygamma", 0), "trigamma": ("polygamma", 1)}
_LARGEST_POLYGAMMA = 12
# Functions whose names in answers and in what is typed are the same.
OWN_FUNCTIONS = FUNCTION.keys() | _COMPOSED.keys()
_DOMAINS = {name: (holds, wanted) for name, (_, holds, wanted) in _COMPOSED.items()}
_DOMAINS |= {
    name: (row.holds, row.wanted) for name, row in FUNCTION.items() if row.holds is not None
}
_ORDERED = {name for name, row in FUNCTION.items() if row.ordered}
OF_AN_ORDER = frozenset((*_ORDERED, *(word for word, name in ALIASES.items() if name in _ORDERED)))
# Functions of two arguments, whose one comma separates them.
OF_TWO = OF_AN_ORDER | EXTREMES.keys() | {word for word in ALIASES if ALIASES[word] in EXTREMES}
FUNCTIONS = (
    FUNCTION.keys()
    | ALIASES.keys()
    | _COMPOSED.keys()
    | _OF_ORDER.keys()
    | EXTREMES.keys()
    | PIECEWISE
    | {STEP}
)

RESERVED = (FUNCTIONS | DERIVATIVE_NAMES | REFUSED.keys() | {"t", "pi"}) - MAY_BE_DECLARED


def call(function: str, arguments: list[Expression], column: int) -> Expression:
    """Apply a function of FUNCTIONS; InputError for a wrong number of arguments or a number outside
    its domain.
    """
    function = ALIASES.get(function, function)
    if function == "log" and len(arguments) == 2:
        return call("log", arguments[:1], column) / call("log", arguments[1:], column)
    if function in EXTREMES:
        if len(arguments) < 2:
            raise fault("one argument", column, name=function)
        if printing.keeps_order():  # it is read to be printed again
            return Arbitrary(function, tuple(arguments), (0,) * len(arguments))
        return reduce(lambda a, b: (a + b + EXTREMES[function] * _magnitude(a - b)) / 2, arguments)
    if function in _OF_ORDER and len(arguments) == 1:
        return call(_OF_ORDER[function][0], [number(_OF_ORDER[function][1]), *arguments], column)
    ordered = function in FUNCTION and FUNCTION[function].ordered
    if len(arguments) != 1 + ordered:
        kind = "order missing" if ordered else "several arguments"
        raise fault(kind, column, name=function, count=len(arguments))
    *orders, argument = arguments
    if orders and not _is_order(function, orders[0]):
        raise fault("order that moves", column, name=function)
    arguments = [argument]
    if not is_defined(function, arguments[0]):
        raise fault(
            "number outside the domain", column, name=function, wanted=_DOMAINS[function][1]
        )
    if function == STEP:
        return step(arguments[0], column)
    if function in _COMPOSED:
        return _COMPOSED[function][0](argument)
    return Ordered(function, argument, orders[0]) if orders else Apply(function, argument)


def _is_order(function: str, order: Expression) -> bool:
    """Whether the order is constant; of polygamma it has to be a small integer."""
    if function == "polygamma":
        return isinstance(order, Number) and order.value in range(_LARGEST_POLYGAMMA + 1)
    return not has(order, Velocity | Apply | Arbitrary) and TIME not in walk(order)


def is_defined(function: str, argument: Expression) -> bool:
    """False if the argument is a number at which the function has no real value."""
    return (
        function not in _DOMAINS
        or not isinstance(argument, Number)
        or _DOMAINS[function][0](argument.value)
    )


def reason_against(name: str, column: int, arguments: str = '["u"]') -> InputError | None:
    """The error for a well-known name that formulas cannot use, or None; sn(u, k) has two
    `arguments`.
    """
    if name.startswith("log_"):
        return fault("base of log", column)
    plain = name.replace("_", "")  # J_0
    reason = REFUSED.get(name) or REFUSED_UNLESS_DECLARED.get(
        plain if plain in MAY_BE_CONSTANTS else name
    )
    if not reason:
        return None
    instead = reason.instead.replace('["u"]', arguments)
    return refused(f"{name} {reason.problem}", reason._replace(instead=instead), column)


def refused(what: str, reason: Reason, column: int) -> InputError:
    """The error for this reason."""
    return refusal(
        f"{what}; it occurs", column, reason.instead, tuple(reason.offers), declare=reason.declare
    )


@dataclass(frozen=True, slots=True)
class Names:
    """Declared names; `functions` maps each arbitrary function to the names that it depends on.

    `time` says whether `t` may occur. `pi` is always available; `e` and `E` mean exp(1) unless
    declared. `definitions` maps parameters defined by a formula to that formula, which is used to
    differentiate them. `guesses`: undeclared names are allowed. `splits`: runs of letters that are
    products, such as kx. `forms`: dz is the velocity of z, as in dz - y dx = 0. `energy`: 1/2m x'^2
    is a kinetic energy. `raised`: letters whose raised digits are indices, as each text alone has
    them for None. `euler`: e is a charge and, where it is raised to what has letters, exp(1).
    """

    coordinates: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    functions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    time: bool = True
    definitions: Mapping[Expression, Expression] = field(default_factory=dict)
    guesses: bool = False
    splits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    forms: bool = False
    energy: bool = False
    raised: frozenset[str] | None = None
    euler: bool = False

    def __hash__(self) -> int:
        return hash(
            (
                self.coordinates,
                self.parameters,
                *self.functions,
                *self.splits,
                self.forms,
                self.energy,
            )
        )

    def role(self, name: str) -> Role | None:
        """The role in which the name is declared, or None."""
        if name in self.coordinates:
            return "coordinate"
        if name in self.parameters:
            return "parameter"
        return "function" if name in self.functions else None

    def role_meant(self, name: str) -> Role | None:
        """The role of the declared name meant."""
        return self.role(self.spelling(name))

    def declared(self) -> tuple[str, ...]:
        return (*self.coordinates, *self.parameters, *self.functions)

    def spelling(self, name: str) -> str:
        """The declared name meant: `r_1` is r1, and phi is varphi, if only the latter is
        declared.
        """
        if self.role(name):
            return name
        plain = _plain(_ascii(name))
        alike = [known for known in self.declared() if _plain(known) == plain]
        return alike[0] if len(alike) == 1 else name

    def derivative(self, name: str) -> Rate | None:
        """x and the order for x_dot, xdot, x_ddot, x_dot_dot of a coordinate x.

        None for other names, and for one that is itself declared.
        """
        if self.role(self.spelling(name)) is not None:
            return None
        found = (Rate(self.spelling(stem), order) for stem, order in _undotted(name))
        return next((rate for rate in found if rate.name in self.coordinates), None)

    def derivative_of_any(self, name: str) -> Rate | None:
        """The same; if no coordinate is meant, of any x."""
        if self.role(self.spelling(name)) is not None:
            return None
        return self.derivative(name) or next(iter(_undotted(name)), None)


def _undotted(name: str) -> list[Rate]:
    """x and the order for x_dot and the like, for each ending that it may have."""
    ends = DOTTED.items()
    return [
        Rate(name.removesuffix(end), order)
        for end, order in ends
        if name.endswith(end) and name != end
    ]


def _plain(name: str) -> str:
    """The name without underscores, each part spelled like the LaTeX command of that name."""
    if "_" not in name:
        return LETTER_COMMANDS.get(name, name)
    return "".join(LETTER_COMMANDS.get(word, word) for word in name.split("_"))


def unknown_name(name: str, names: Names, column: int, follows: str = "") -> InputError:
    """The error for an undeclared name: how to declare it, and what may have been meant.

    `follows` is the text of the next token: "(" after a function, or a prime, which a suggested
    replacement keeps.
    """
    known = reason_against(name, column)
    if known is not None and (follows == "(" or name.replace("_", "") not in MAY_BE_CONSTANTS):
        return known
    words = {"shown": shorten(name), "name": name, "coordinates": listed_names(names.coordinates)}
    if name == "d":
        return fault("unknown d", column, **words)
    if follows[:1] == "'" and (meant := readings(name, names)):
        return fault("unknown product with a prime", column, factors=meant[-1], **words)
    if follows[:1] == "'" and follows != "'(" and name in FUNCTION_LETTERS and names.coordinates:
        return fault(
            "prime of an unknown function",
            column,
            (column, column + len(name) + 1),
            by=names.coordinates[0],
            **words,
        )
    if follows[:1] == "'":
        return fault("unknown name with a prime", column, **words)
    if follows == "(":
        known_functions = sorted(FUNCTIONS | set(names.functions))
        close = misspelt(name) or difflib.get_close_matches(name.lower(), known_functions, 1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        return fault(
            "unknown function",
            column,
            (column, column + len(name)),
            tuple(close),
            hint=hint,
            **words,
        )
    alike = [*names.declared(), *(FUNCTIONS if len(name) > 2 else ())]
    meant = (*difflib.get_close_matches(name, alike, 1, 0.7), *readings(name, names))
    if meant:
        return undeclared(name, column, meant)
    if looks_like_a_coordinate(name):
        return ask_for_the_time(name, column, names.coordinates)
    return fault("unknown name", column, **words)


def undeclared(
    name: str, column: int, meant: tuple[str, ...], span: tuple[int, int] | None = None
) -> InputError:
    """The error for a name, with possible meanings of the name or of the text in the span: omega0
    for omga0 too.
    """
    stem = name.rstrip("0123456789")
    greek = (
        []
        if stem in GREEK_NAMES or len(stem) < 4
        else difflib.get_close_matches(stem, GREEK_NAMES, 1, 0.85)
    )
    meant = (*(letter + name[len(stem) :] for letter in greek), *meant)
    return fault(
        "name with other meanings",
        column,
        span,
        meant,
        shown=shorten(name),
        hint=" or ".join(dict.fromkeys(meant)),
    )


def ask_for_the_time(name: str, column: int, coordinates: Sequence[str]) -> InputError:
    """The error for a name such as x without an equation: it may be the independent variable or a
    coordinate.
    """
    named = f"t, or {coordinates[0]}''({name})" if coordinates else "t"
    return fault("variable without an equation", column, shown=shorten(name), named=named)


def looks_like_a_coordinate(name: str) -> bool:
    """Whether the name usually denotes a variable: x, r_2, tau; x_0 usually denotes a constant."""
    numbered = _NUMBERED.fullmatch(name)
    return (numbered[1] if numbered and numbered[2][0] != "0" else name) in _COORDINATE_LETTERS


def is_momentum(name: str, names: Sequence[str]) -> bool:
    """Whether the name is usually a momentum or velocity: p, p_x, v_x or vx."""
    return name in ("p", "v") or any(
        name in (f"{letter}_{q}", f"{letter}{q}") for letter in "pv" for q in names
    )


def readings(name: str, names: Names) -> tuple[str, ...]:
    """Interpretations of an undeclared name as known names and a letter: kx as k*x, sinx as sin(x),
    omegat as omega*t.

    A letter may have a number (k1x); next to a coordinate there may be two letters (mgx). dx is
    usually x', and both interpretations are returned; x_t is x'; V_x is a derivative if V is or may
    be a function of x; a Greek letter is a name.
    """
    head, _, below = name.partition("_")
    if head in names.coordinates and below in ("t", "tt"):
        return (head + "'" * len(below),)
    arguments = names.functions.get(head, names.coordinates if head in POTENTIALS else ())
    by = [below] if below in arguments else list(below)
    if by and set(by) <= set(arguments):
        return (f"diff({head}({', '.join(arguments)}), {', '.join(by)})",)
    called = _CALLED_WITH_A_NUMBER.fullmatch(name)
    if called and called[1] in FUNCTIONS:
        return (f"{called[1]}({called[2]}{called[3] and '*' + called[3]})",)
    if not (cut := _parts(name, names)):
        return ()
    motion = (f"{name[1:]}'",) if name[0] == "d" and name[1:] in names.coordinates else ()
    inverse = cut[0][:1] == "a" and cut[0] in FUNCTIONS and len(cut) > 1  # asinx may be a*sin(x)
    separate = (f"a*{written_product([cut[0][1:], *cut[1:]], names)}",) if inverse else ()
    return (*motion, written_product(cut, names), *separate)


def misspelt(name: str) -> list[str]:
    """Functions whose letters are in another order or that have one letter more: sin for isn, cos
    for cs.
    """
    return [
        known
        for known in ENDINGS
        if len(known) > 2
        and (
            sorted(name) == sorted(known)
            or name in [known[:k] + known[k + 1 :] for k in range(len(known))]
        )
    ][:1]


def power_of_call(function: str, argument: str) -> str:
    """sin(x)^2 for the sin and x^2 of sin x^2."""
    base, caret, exponent = argument.partition("^")
    return f"{function}({base}){caret}{exponent}"


def plainly(text: str) -> str:
    """x^2 for the x^(2) of LaTeX."""
    return re.sub(r"\^\((\w+)\)", r"^\1", text)


def split_at_function(name: str, names: Names) -> tuple[str, ...]:
    """m, g and cos for mgcos if an argument follows; q, cos, 2 and t for qcos2t; empty without a
    function.

    Also empty for asin or dsin, and if the argument of the function is not a known name.
    """
    match = _CALLED_INSIDE.fullmatch(name)
    if (
        match is None
        or match[1] in ("a", "d", "D")
        or match[1].lower() in ("ar", "arc")
        or names.role(name)
    ):
        return ()
    before, function, digits, rest = match.groups("")
    if any(name.startswith(word) and len(before) < len(word) for word in GREEK_NAMES):
        return ()  # the tan of thetan
    known = names.role(rest) or rest in (*GREEK_NAMES, "t", "")
    inner = (rest,) if known else only_split(rest, names)
    if not inner or (digits and not rest):
        return ()
    factors = only_split(before, names) or _LETTER.findall(before)
    return (*factors, function, *([digits] * bool(digits)), *filter(None, inner))


def letters_of_run(name: str) -> tuple[str, ...]:
    """The letters, with their numbers, of a short run such as ml or m2l1; empty for other names."""
    found = tuple(_LETTER.findall(name))
    named = name in GREEK_NAMES or name == "ell" or name[0] == "d"
    return found if 1 < len(found) < 5 and "".join(found) == name and not named else ()


def _parts(name: str, names: Names) -> list[str]:
    """The known names and letters that form an undeclared name; empty if it may be a single
    name.
    """
    if name in GREEK_NAMES or len(name) > _LONGEST_PRODUCT:
        return []
    known = {*names.declared(), "t", "pi", "ln"} | {word for word in FUNCTIONS if len(word) > 2}
    letters, cut = _cut(name, known)
    moves = any(part in names.coordinates for part in cut)
    if len(cut) < 2 or letters > 1 + moves or (cut[-1] in FUNCTIONS and not names.role(cut[-1])):
        return []
    return cut


def only_split(name: str, names: Names) -> tuple[str, ...]:
    """The factors of a run of letters that is clearly a product, kx, omegat, mgx, sinx; otherwise
    empty.

    Not clear: dx and Dx may be derivatives, xm and rs names with an index; asinx contains two
    functions, and sinc is one.
    """
    if "_" in name:
        ends = (known for known in names.coordinates if "_" in known and name[1:] == known)
        return next(((name[0], known) for known in ends if name[0] not in "dDeEij"), ())
    called = _CALLED_WITH_A_NUMBER.fullmatch(name)
    if called and called[1] in FUNCTIONS:
        rest = called[3]
        if called[1] == "exp" or (called[1] in _OF_NUMBERS) == bool(rest):
            return ()  # sqrt2 and ln2 are numbers; sqrt2x and cos3 x are not clear
        inner = (rest,) if not rest or names.role(rest) or rest == "t" else only_split(rest, names)
        return (called[1], called[2], *(part for part in inner if part)) if inner else ()
    cut = _parts(name, names)
    known = {*names.declared(), "t", "pi"}
    letters = [
        part
        for part in cut
        if part not in known and part not in FUNCTIONS and part not in GREEK_NAMES
    ]
    moving = {*names.coordinates, "t"}
    doubtful = (
        name[0] == "d"
        or {*letters} & {"e", "i", "j", "d", "D"}
        or (len(cut) > 1 and cut[-1:] == letters[-1:] and cut[-2] in FUNCTIONS | moving)
        or any(part[:1] == "a" and part[1:] in FUNCTIONS for part in cut)
        or any(len(part) == 2 and part in GREEK_NAMES and {*part} & moving for part in cut)
    )
    return () if not cut or doubtful else tuple(cut)


def _cut(word: str, known: Collection[str]) -> tuple[int, list[str]]:
    """The minimum number of single letters, and the shortest split with that number; no parts if
    there is no split.
    """
    best: dict[int, tuple[int, list[str]]] = {0: (0, [])}
    for end in range(1, len(word) + 1):
        cuts = []
        for start in best:
            part = word[start:end]
            match = _NUMBERED.fullmatch(part)
            stem = match[1] if match else part
            is_letter = len(stem) == 1 and stem.isalpha()
            if part in known or stem in _GREEK_IN_RUNS or is_letter:
                letters, parts = best[start]
                alone = part not in known and stem not in _GREEK_IN_RUNS
                cuts.append((letters + alone, [*parts, part]))
        if cuts:
            best[end] = min(cuts, key=lambda cut: (cut[0], len(cut[1])))
    return best.get(len(word), (0, []))


def written_product(parts: Sequence[str], names: Names) -> str:
    """The parts as a product, in which a function takes the following parts as its argument."""
    for place, part in enumerate(parts):
        if part in FUNCTIONS and names.role(part) is None:
            inner = written_product(parts[place + 1 :], names)
            return "*".join([*parts[:place], f"{part}{f'({inner})' if inner else ''}"])
    return "*".join(parts)


def escaped(key: str) -> str:
    """A key as a part of a JSON pointer (RFC 6901)."""
    return key.replace("~", "~0").replace("/", "~1")


def declared_name(text: str, pointer: str, what: str = "name") -> str:
    r"""The name in ASCII (Greek letters and \theta, r_{1} as words); InputError if it cannot be
    declared.
    """
    name = _ascii(text)
    if len(text) > LIMITS.name_characters or len(name) > LIMITS.name_characters:
        raise LimitError(
            f"a {what} has more than {LIMITS.name_characters} characters: choose a shorter one.",
            pointer,
        )
    if not _NAME.fullmatch(name):
        raise fault("not a name", pointer, text=shorten(text), what=what)
    if name in RESERVED:
        meaning = {"t": "the time", "pi": "the number pi"}.get(name, "a function")
        raise fault("reserved name", pointer, name=name, what=what, meaning=meaning)
    return name


def _ascii(text: str) -> str:
    text = text[: LIMITS.name_characters + 1].strip()
    if text.isascii() and text.isalnum():
        return text
    pairs = [letter(character) for character in text]
    if pairs and all(pair is not None and pair[1] == 0 for pair in pairs):
        return "".join(pair[0] for pair in pairs if pair)
    match = _LATEX_NAME.fullmatch(text)
    if match is None:
        return text
    return "_".join(word for word in match.groups() if word)


def check_clashes(names: Names, keyed_parameters: bool = False) -> None:
    """InputError for a name that is declared twice or denotes the derivative or momentum of
    another.
    """
    seen: dict[str, str] = {}
    members = {
        "coordinates": names.coordinates,
        "parameters": names.parameters,
        "functions": tuple(names.functions),
    }
    keyed = ("functions", "parameters")[: 1 + keyed_parameters]
    for member, place, name in (
        (key, *pair) for key, found in members.items() for pair in enumerate(found)
    ):
        pointer = f"/{member}/{name if member in keyed else place}"
        if name in seen:
            raise fault("name declared twice", pointer, name=name)
        seen[name] = pointer
    for coordinate in names.coordinates:
        for taken in (f"{coordinate}_dot", f"{coordinate}_ddot", f"p_{coordinate}"):
            if taken in seen:
                meaning = "momentum" if taken.startswith("p_") else "derivative"
                raise fault(
                    "name of a derivative",
                    seen[taken],
                    name=taken,
                    meaning=meaning,
                    coordinate=coordinate,
                )


def refuse_two_spellings(
    texts: Mapping[str, str],
    declared: tuple[str, ...],
    parts: Callable[[str], Iterable[tuple[int, int]]],
) -> None:
    """InputError if the texts (formulas by pointer) use two letters that denote the same name; of
    each text only the `parts` that are read count.
    """
    seen: dict[str, str] = {}
    for pointer, text in texts.items():
        words = (_WORD.finditer(text, start, stop) for start, stop in parts(text))
        for found in chain.from_iterable(words):
            spelling = _spelling(found.group(), "\\" in text)
            name = ALIKE.get(spelling, spelling)
            both = {variant for variant, plain in ALIKE.items() if plain == name} & set(
                declared
            ) and name in declared
            if name not in ALIKE.values() or both:
                continue
            if seen.setdefault(name, spelling) != spelling:
                first, second = sorted((seen[name], spelling), key=len)
                raise fault(
                    "letters that look alike", found.start() + 1, first=first, second=second
                ).at(pointer)


def _spelling(word: str, latex: bool) -> str:
    """The name of a command or letter; a script l in a run of LaTeX letters is an l."""
    if word == SCRIPT_L:
        return "ell"
    if latex and not word.startswith("\\"):
        return "l" if "l" in word else word
    return GREEK.get(word, word.removeprefix("\\"))


def letter(character: str) -> tuple[str, int] | None:
    """The ASCII name of a character and the number of dots over it (x with two dots: ("x", 2)), or
    None.
    """
    if character.isascii():
        return (character, 0) if character.isalnum() or character == "_" else None
    if character in _MEANT:
        return _MEANT[character]
    if unicodedata.name(character, "").startswith(_SLANTED):  # produced by word processors
        return letter(unicodedata.normalize("NFKC", character))
    body, marks = (parts := unicodedata.normalize("NFD", character))[:1], parts[1:]
    return (body, DOTS[marks]) if marks in DOTS and body.isascii() else None
