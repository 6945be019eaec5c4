"""Find the undeclared names of formulas: constants, functions of coordinates, or products.

An undeclared name before (t) or before coordinates in brackets is a function of them. Any other is
a constant, unless it may have another meaning: kx, dx, sinx, or an r without an equation. In that
case an error asks the writer what is meant.
"""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from inverse_service import errors
from inverse_service.expressions import collecting
from inverse_service.expressions.refusals import fault, shorten
from inverse_service.reading import labels, names as nm, reader, time_derivatives
from inverse_service.reading.declarations import Texts, Words
from inverse_service.reading.tokens import (
    WHOLE_NAMES,
    Line,
    Token,
    after_power,
    at,
    flat,
    places,
    source,
    spelled,
    split_at,
    walk,
)

ANY_SPEED = ("u", "v", "s", "V")  # of x' = v cos(theta), y' = v sin(theta)
# A weight, alone or times a length, the attraction of masses, and a charge times a field.
_WEIGHT = re.compile("[mM][0-9]?g[lLhHrRabd]?|G[mM][0-9]?[mM]?|[eq][BEH]")
_FIELD_LETTERS = ("E", "B", "F")  # of q/mE, which is usually (q/m) E
_LUMP = re.compile("[a-z][A-Z]")
_PAIR = re.compile("[a-z][abghkluvwA-Z]")  # not those with an index: w_n, k_t
_INDEXED = re.compile("[A-Z][a-z]")  # Ic, Tm, and Om; Mg and the Kx of a coordinate x are products
_STIFFNESS = re.compile("[kKJI]t")  # of torsion, of a tire, or in all
_FREQUENCY = re.compile("(w|omega)([cdnprs])")  # w with an index, as in w_n^2
_ENERGY = re.compile("[EFTUVW](?:pot|kin|eff|ext|tot|int)")  # Epot and Fext, with an index
# Names refused as functions or numbers; guessing does not make them parameters either.
_NEVER_GUESSED = (
    nm.RESERVED
    | nm.FUNCTIONS
    | nm.REFUSED.keys()
    | {"e", "E", "Pi"}
    | (nm.REFUSED_UNLESS_DECLARED.keys() - {"I", "gamma", "Gamma", "zeta", *nm.MAY_BE_CONSTANTS})
)
_CALLED_LETTERS = nm.FUNCTION_LETTERS | {"g", "G", "phi", "Phi", "psi", "Psi", "P", "Q"}
_PROGRAMS = re.compile(
    r"\b(?:Eq|diff|Derivative|Mul|Add)\s*\(|\["
)  # in these notations E is Euler's number
_OF_PROGRAMS = re.compile(
    r"\b(?:diff|Derivative|Eq|der|syms|symbols|def|function|return|end|begin)\b|:=|@|\w[\[(]\d[\])]|\w\["
)
# Of these, h(x - b) is taken as a function, and is often a product.
_FACTORS_OR_FUNCTIONS = frozenset("hHgGpPQuvwW")
# Letters of fields, whose u_xx is usually a second derivative; I_xx and k_xx are constants.
_FIELDS = frozenset(("u", "v", "w", "phi", "psi", "eta"))
# As functions of t, these usually denote impulses and steps.
_IMPULSES = frozenset(("delta", "theta", "Theta", "H"))
_Found = tuple[str, Token, int]  # pointer, token, and the column after the arguments
_ONE_UNIT = r"(?:k?[gmNJW]|[cm]m|m?s|V|Hz|rad|k?Pa)(?:\^\(?-?\d\)?)?"
_UNIT = re.compile(rf"{_ONE_UNIT}(?:[*/]{_ONE_UNIT})*")  # of k = 3 N/m
_MOST_ROUNDS = 4  # splitting one run may reveal a name that splits other runs
_COMPONENTS = frozenset("ABEFJPQVpv")  # Fx and Fy are usually two components
_CONTROLS = frozenset("fuT")  # of ur and utheta, the forces along r and theta
_WORDS_OF_MOTION = {"v": "'", "velocity": "'", "speed": "'", "position": "", "acceleration": "''"}


def with_undeclared(texts: Texts, declared: nm.Names, dummies: Collection[str]) -> nm.Names:
    """The names plus the undeclared ones that the texts use; InputError as in `_Guesser`."""
    for _ in range(_MOST_ROUNDS):
        found = _Guesser(texts, declared, dummies)
        parameters = found.parameters()
        if not found.splits:
            break
        declared = replace(declared, splits={**declared.splits, **found.splits})
    both = (*declared.parameters, *parameters)
    functions = {**declared.functions, **found.functions}
    return replace(declared, parameters=both, functions=functions, euler=found.euler)


class _Guesser:
    """The undeclared names in the texts (formulas by pointer) that are not coordinates.

    `dummies` are the arguments of functions that the texts define. A text that cannot be tokenized
    adds nothing: its error is reported when it is parsed. InputError with suggestions for a
    suspicious name. Found are `functions` with their arguments, and `splits`, the runs of letters
    that are products.
    """

    def __init__(self, texts: Texts, declared: nm.Names, dummies: Collection[str]) -> None:
        self._declared, self._coordinates = declared, declared.coordinates
        self._texts, self._lines = texts, dict[str, Line]()
        for pointer, text in texts.items():
            kind = replace(declared, forms=pointer.startswith("/constraints"))
            self._lines[pointer] = reader.tokens_if_any(text, kind)
        everywhere = [place for line in self._lines.values() for place in places(line)]
        self._raised = {
            line[place].text: at(line, place + 2).kind == "number"
            for line, place, _ in everywhere
            if at(line, place + 1).is_operator("^") and not line[place].order
        }
        programmed = any(map(_PROGRAMS.search, texts.values()))
        field = {"E"} if not (programmed or "E" in self._raised or declared.role("E")) else set()
        maxima = "e" not in self._raised and any("'diff(" in text for text in texts.values())
        maxima = maxima and any(line[place].text == "e" for line, place, _ in everywhere)
        exponentials = [line[place] for line, place, _ in everywhere if is_exponential(line, place)]
        charged = declared.role("e") is None and (
            maxima or _is_charge(self._lines.values(), {*self._coordinates, "t"}, exponentials)
        )
        self.euler = charged and bool(exponentials)
        if charged:
            reader.note("e", "a constant", "Euler's number exp(1)")
            field.add("e")
        self._known = {*declared.declared(), *_NEVER_GUESSED, *dummies} - field
        pairs = [(line[place], at(line, place + 1)) for line, place, _ in everywhere]
        called = [
            (name.text, self._call(after, (*self._coordinates, "t")))
            for name, after in pairs
            if not _is_apart(name, after)
        ]
        self._calls = {(name, arguments) for name, arguments in called if arguments}
        self._factors = {
            line[place].text
            for line, place, outer in everywhere
            if _is_constant(line, place, outer)
        }
        self._defined = {
            declared.spelling(key.removeprefix("/where/"))
            for key in texts
            if key.startswith("/where/")
        }
        self._alone = reader.alone(self._lines.values())
        self._explicit = _has_explicit_products(everywhere)
        moving = {*self._coordinates}
        self._stiffnesses = {
            line[place].text
            for line, place, outer in everywhere
            if _STIFFNESS.fullmatch(line[place].text) and _is_stiffness(line, place, outer, moving)
        }
        plain = [text for text in texts.values() if not reader.is_latex(text)]
        of_programs = self._explicit and any(map(_OF_PROGRAMS.search, plain))
        self._whole_words = of_programs or any(map(WHOLE_NAMES.search, plain))
        self._slopes = _slopes(self._lines.values(), declared)
        self._constants = dict[str, _Found]()
        self._subscripted = dict[str, _Found]()  # U_x(x, y) may be a derivative
        self.functions, self.splits = dict[str, Words](), dict[str, Words]()

    def parameters(self) -> Words:
        """The names of constants, in order of appearance."""
        for pointer, tokens in self._lines.items():
            with reader.placed_at(pointer):
                for line, place, outer in places(tokens):
                    unknown = not self._is_known(line[place])
                    marked = unknown or (
                        line is tokens and not all(map(self._is_known, line[place].inside))
                    )
                    if marked and not nm.only_split(
                        line[place].text, self._declared
                    ):  # cosx sinx is not a remark
                        reader.refuse_remark(line, place, self._alone)
                    if unknown:
                        self._refuse_other_meanings(line, place, outer, pointer)
                        self._add(line, place, pointer)
        self.functions = {**self.functions, **self._slopes, **self.functions}
        names = replace(self._declared, functions={**self._declared.functions, **self.functions})
        _ask_back(self._subscripted, replace(names, parameters=()), {}, False)
        guessed = {
            name: found for name, found in self._constants.items() if name not in self.functions
        }
        asked = {
            name: found
            for name, found in guessed.items()
            if name != "r" or not (self._has_wheel() or self._has_radius())
        }
        asked = {
            name: found for name, found in asked.items() if not self._is_speed_of_another(name)
        }
        if self._whole_words:
            _ask_about_motion(asked, names)
        else:
            for name in self._stiffnesses & asked.keys():
                reader.note(name, "one constant", "*".join(name))
                del asked[name]
            self.splits |= _ask_back(asked, names, self._raised, self._explicit)
            if any(self._is_run_of_letters(parts) for parts in self.splits.values()):
                self.splits |= _split_alike([name for name in asked if name not in self.splits])
            if not self._explicit:
                _note_products(name for name in guessed if name not in self.splits)
        return _as_in_products(
            [name for name in guessed if name not in self.splits], self._lines.values()
        )

    def _has_wheel(self) -> bool:
        """Whether r is in a constraint next to an angle: then it is the radius of a wheel."""
        held = [
            token.text
            for pointer, line in self._lines.items()
            for part in split_at(";,", line)
            if pointer.startswith("/constraints")
            or (pointer.startswith("/equations") and not time_derivatives.moving_names(part, 2))
            for token in walk(part)
        ]
        return "r" in held and not nm.GREEK_NAMES.isdisjoint(
            name.rstrip("_0123456789") for name in self._coordinates
        )

    def _has_radius(self) -> bool:
        """Whether x^2 + y^2 is written out in each equation that has r: then r is a constant,
        which is noted.
        """
        written = _radius(self._coordinates)
        parts = [part for line in self._lines.values() for part in split_at(";,", line)]
        with_r = [
            part
            for part in parts
            if any(token.text == "r" for token in walk(part)) and not labels.is_at_a_number(part)
        ]
        out = written and all(
            any(written in spelled(token.inside).replace("(t)", "") for token in walk(part))
            for part in with_r
        )
        if out:
            reader.note("r", "one constant", *_may_be_motion("r", self._coordinates))
        return bool(out)

    def _is_run_of_letters(self, parts: Words) -> bool:
        """Whether these are the m and L of mL, whose writer leaves out the signs of products."""
        moving = {*self._coordinates, "t"}
        return len(parts) > 1 and all(len(part) == 1 and part not in moving for part in parts)

    def _is_speed_of_another(self, name: str) -> bool:
        """Whether this is the v of c (x' - v), which is no x'; the constant is noted."""
        if name != "v" or not self._coordinates:
            return False
        own = self._coordinates[0]
        terms = [
            {spelled(term) for term in split_at("+-", token.inside)}
            for line in self._lines.values()
            for token in walk(line)
            if token.is_bracket()
        ]
        found = any({f"{own}'", name} <= each for each in terms)
        if found:
            reader.note(name, "one constant", f"{own}'")
        return found

    def _is_known(self, token: Token) -> bool:
        if token.kind != "name" or _slope_of(token, self._declared)[0] in self._slopes:
            return True
        return not self._known.isdisjoint((token.text, self._declared.spelling(token.text)))

    def _call(self, bracket: Token, allowed: Words) -> Words:
        """The names in brackets after a name; empty if the brackets contain anything that is not
        allowed.
        """
        names = tuple(
            spelled(part).removesuffix("(t)") for part in split_at(",", bracket.inside)
        )  # x(t) is x
        distinct = len(names) == len({*names}) and {*allowed}.issuperset(names)
        return names if bracket.is_bracket() and distinct else ()

    def _arguments(self, line: Line, place: int) -> Words:
        """The arguments after an undeclared name: coordinates, or u1, u2 of any formulas; empty for
        a factor.
        """
        name, after = line[place].text, at(line, after_power(line, place + 1))
        bracket = after if spelled(after.inside) == "t" else at(line, place + 1)  # omega^2(t)
        time = ("t",) if _may_depend_on_time(name) else ()
        found = self._call(bracket, (*self._coordinates, *time))
        count = (
            0
            if found or name in self._factors
            else _called_with(line, place, self._declared, self._defined)
        )
        numbered = tuple(f"u{number}" for number in range(1, count + 1))
        return found or (numbered and self.functions.get(name, numbered))

    def _add(self, line: Line, place: int, pointer: str) -> None:
        """Add the undeclared name as a function, a product, or a constant."""
        token, after, arguments = line[place], at(line, place + 1), self._arguments(line, place)
        name = token.text
        factors, parts = (
            nm.only_split(name, self._declared),
            nm.split_at_function(name, self._declared),
        )
        of_function = (
            bool(arguments and factors) and self._declared.role(factors[-1]) == "function"
        )  # qA(x)
        if len(arguments) == 1 and _is_apart(token, after) and not of_function:
            raise _product_or_function(token, after, arguments[0], self._texts[pointer])
        ends = next(filter(name.endswith, nm.ENDINGS), "")
        takes = bool(ends) and _takes_argument(token, after)
        if ends and takes and not (parts or of_function or after.is_bracket()):
            raise nm.undeclared(name, token.column, (f"{name.removesuffix(ends)}*{ends}",))
        if of_function or (parts and (takes or not ends)):
            self.splits[name] = factors if of_function else parts
            return
        if arguments and "_" in name:
            self._subscripted.setdefault(name, (pointer, token, after.end + 1))
        if arguments and not _looks_like_a_function(name):
            self.functions.setdefault(name, arguments)
            _note_function(token, after)
        elif not arguments and token.order and factors:
            self.splits[name] = factors
        elif not (arguments or token.order or (name in nm.FUNCTION_LETTERS and after.is_bracket())):
            self._constants.setdefault(name, (pointer, token, 0))

    def _refuse_other_meanings(self, line: Line, place: int, outer: Token, pointer: str) -> None:
        """InputError for x^T, Delta x (usually a difference), diff(V, x) of a constant V, 2j,
        3mu^2, and cn(u, k).
        """
        token, before, after = line[place], at(line, place - 1), at(line, place + 1)
        name, column = token.text, token.column
        components = [f"{name}_{by}" for by in "xyz" if f"{name}_{by}" in self._coordinates]
        if len(components) > 1:  # r next to r_x and r_y
            raise fault(
                "length of a vector", column, token.span, name=name, sum=_length(components)
            )
        if name == "T" and (before.is_operator("^") or (outer.is_operator("^") and len(line) == 1)):
            raise fault("raised T", column)
        by = (
            at(line, place + 2).text
            if not place and outer.text in nm.DERIVATIVE_NAMES and after.text == ","
            else ""
        )
        if by in self._coordinates and name not in self._slopes:
            raise fault("derivative of a parameter", column, name=name, by=by)
        if name == "j" and not token.space_before and before.kind == "number":
            reason = nm.REFUSED_UNLESS_DECLARED["i"]
            raise nm.refused(f"j {reason.problem}", reason, column)
        head, _, below = name.partition("_")
        if head in _FIELDS and len(below) == 2 and below[0] == below[1] and below.isalpha():
            raise fault("second slope", column, token.span, shown=name, by=below[0])
        of_base = nm.reason_against(name, column) if name.startswith("log_") else None
        if error := of_base or _half_a_number(line, place):
            raise error
        alone = line is self._lines[pointer]  # 1/(2 m) has no unit
        if before.kind == "number" and (unit := _unit(line, place, alone, self._coordinates)):
            span = (before.column, column + len(unit))
            raise fault("unit", column, span, number=before.text, unit=unit)
        over = at(line, place - 2)
        if _LUMP.fullmatch(name) and before.is_operator("/") and over.kind == "name":  # q/mE
            words = {"over": over.text, "under": name[0], "rest": name[1]}
            moving = over.text.endswith(self._coordinates) and name[1] not in _FIELD_LETTERS
            if moving and not (token.space_before or self._whole_words):
                self.splits[name] = (name[0], name[1])  # k x/mL
            elif not (token.space_before or over.order or self._whole_words):
                raise fault("end of a quotient", column, (over.column, token.span[1]), **words)
        self._refuse_raised_call(*(at(line, place + k) for k in range(4)))
        if name == "d" and after.text == "t":
            raise fault("differential", column)
        if name == "Delta" and after.kind == "name":
            raise fault("difference", column, name=after.text)
        typed = self._texts[pointer][column - 1 : column + 1]
        if "u" in self._coordinates and typed == name and name in ("mu", "nu"):
            lines = [token for line in self._lines.values() for token in walk(line)]
            glued = before.kind == "number" and not token.space_before
            product = glued or after.is_operator("^")  # 3mu^2, not 3 mu u^2
            alone = any(one.text == name[0] for one in lines)
            if product or alone or self._declared.role(name[0]):
                raise nm.undeclared(name, column, (f"{name[0]}*u",))
            reader.note(name, "the Greek letter", f"{name[0]}*u")
        arguments = _elliptic_arguments(line, place)
        if arguments and (
            error := nm.reason_against(name, column, '["u", "k"]' if arguments > 1 else '["u"]')
        ):
            raise error
        if after.is_bracket() and not after.space_before and nm.misspelt(name):
            raise nm.unknown_name(name, self._declared, column, "(")

    def _refuse_raised_call(
        self, name: Token, caret: Token, exponent: Token, bracket: Token
    ) -> None:
        """InputError for k^2(x), which may be (k(x))^2 or a product, and for f^(2)(x), a
        derivative.

        k^2(x - y) is a product, k^2(t) the square of k(t), and k^2(x) that of k(x) if k(x) occurs
        in the texts.
        """
        if not caret.is_operator("^") or not bracket.is_bracket():
            return
        if any(each.order for each in walk(bracket.inside)):  # l^2 (d theta/dt)^2
            return
        raised = at(exponent.inside, 0)
        inside = [
            each.text
            for each in walk(bracket.inside)
            if each.kind != "bracket" and not each.is_operator(",")
        ]
        if (
            raised.kind == "number" and raised.column > exponent.column
        ):  # typed by the writer, not from LaTeX
            words = {"name": name.text, "power": raised.text, "of": spelled(bracket.inside[:1])}
            raise fault("power or derivative", name.column, **words)
        called = inside == ["t"] or (name.text, tuple(inside)) in self._calls
        if inside and not called and {"t", *self._coordinates}.issuperset(inside):
            power = spelled([exponent]).strip("()")
            raise fault(
                "power before a bracket", name.column, name=name.text, power=power, of=inside[0]
            )


def _as_in_products(names: Sequence[str], lines: Iterable[Line]) -> Words:
    """The names ordered as in the products: m, g, l for m l^2 theta'' = -m g l sin(theta);
    otherwise as they appear.
    """
    products = list[list[str]]()
    for line in lines:
        products.append([])
        for token in flat(line):
            if token.kind == "operator" and token.text not in ("*", "^", "/"):
                products.append([])
            products[-1].append(token.text)
    return collecting.in_order_of_products(names, products)


def _product_or_function(
    name: Token, bracket: Token, argument: str, text: str
) -> errors.InputError:
    """The error for k (x) and k [x], with both ways to write it."""
    plain = text[bracket.end - 1 : bracket.end] in (")", "]")  # not \\right)
    span = (name.column, bracket.end + 1) if plain else None
    return fault(
        "product or function", name.column, span, name=name.text, argument=argument, span=span
    )


def _slopes(lines: Iterable[Line], declared: nm.Names) -> dict[str, Words]:
    """Each undeclared V as a function of the coordinates that its derivatives use: all, or r alone
    for dV/dr.

    A potential U or V depends on no momenta.
    """
    found: dict[str, set[str]] = {}
    partial: set[str] = set()
    for line, place, _ in (each for tokens in lines for each in places(tokens)):
        called, inside = line[place], at(line, place + 1).inside
        head, letters = _slope_of(called, declared)
        if head:
            found.setdefault(head, set()).update(letters)
            partial.add(head)
            continue
        name, comma = at(inside, 0), at(inside, 1)
        if called.text not in nm.DERIVATIVE_NAMES or name.kind != "name" or name.order:
            continue
        by = [token.text for token in inside[2:] if not token.is_operator(",")]
        if not called.value and any(each.endswith(("_i", "_j")) for each in by):
            continue  # \partial V/\partial x_i means all x_1, x_2, …
        if (
            comma.is_operator(",")
            and by
            and {*by} <= {*declared.coordinates}
            and not declared.role(name.text)
        ):
            found.setdefault(name.text, set()).update(by)
            partial |= set() if called.value else {name.text}
    every = {*declared.coordinates}
    positions = {name for name in every if not nm.is_momentum(name, declared.coordinates)}
    known = {
        name: by
        for name, by in found.items()
        if by == (positions if name in nm.POTENTIALS else every)
        or (len(by) == 1 and name not in partial)
    }
    return {name: tuple(x for x in declared.coordinates if x in by) for name, by in known.items()}


def _slope_of(token: Token, declared: nm.Names) -> tuple[str, Sequence[str]]:
    """(V, coordinates) for the V_x of an undeclared potential V; ("", ()) for other tokens."""
    head, _, below = token.text.partition("_") if token.kind == "name" else ("", "", "")
    letters, moving = [below], below in declared.coordinates
    free = not (token.order or declared.role(head) or declared.role_meant(token.text))
    return (head, letters) if head in nm.POTENTIALS and moving and free else ("", ())


def _is_one_of_many(name: str, coordinates: Sequence[str]) -> bool:
    """Whether it is x_1 or x2 and a coordinate is x or x with another number; x_0 is usually a
    constant.
    """
    numbered = re.fullmatch("([A-Za-z]+)_?([1-9][0-9]*)", name)
    stems = {each.rstrip("0123456789").removesuffix("_") for each in coordinates}
    if numbered is None or numbered[1] not in stems:
        return False
    return nm.looks_like_a_coordinate(numbered[1]) or numbered[1] in nm.GREEK_NAMES


def _takes_argument(name: Token, after: Token) -> bool:
    """Whether an argument follows the cos of Rcos: a bracket, a name, or a number; after ln, one
    without a space.
    """
    touches = not after.space_before or (after.kind == "name" and not name.text.endswith("ln"))
    return after.is_bracket() or (after.kind in ("name", "number") and touches)


def _is_constant(line: Line, place: int, outer: Token) -> bool:
    """Whether the g here precedes no bracket and is not differentiated; if so, g( is a product
    everywhere.
    """
    after = at(line, after_power(line, place + 1))
    differentiated = not place and outer.text in nm.DERIVATIVE_NAMES
    return line[place].text in ("g", "G") and not differentiated and after.kind != "bracket"


def _is_charge(
    lines: Collection[Line], moving: Collection[str], exponentials: Collection[Token]
) -> bool:
    """Whether every e is that of e E, e B/(m c), or e^2/r, next to a field or over a distance, or
    that of e g/c, e x^3, and 1 + e cos t; not that of e^(-t), of the A e-kt whose exponent lost its place,
    nor of e x, which may be e^x. Next to the e of e/c, the `exponentials` are no charges, and nothing
    is said of them.
    """
    light = [token for tokens in lines for token in _over_light(tokens)]
    if exponentials and not light:
        return False
    every = [each for tokens in lines for each in places(tokens)]
    words = {line[place].text.partition("_")[0] for line, place, _ in every}
    potential = any(
        line[place].text in ("phi", "varphi", "V", "U") and at(line, place + 1).is_bracket()
        for line, place, _ in every
    )
    found = False
    carets = any(token.is_operator("^") for tokens in lines for token in walk(tokens))
    for line, place, _ in every:
        token, before, after = (at(line, place + k) for k in (0, -1, 1))
        if token.text != "e" or token.kind != "name" or token in exponentials:
            continue
        behind = after_power(line, place + 1)
        power, end = [*walk(line[place + 2 : behind])], at(line, behind)
        glued = end.is_operator("+", "-") and not (end.space_before and line[behind + 1 :][:1])
        squared = spelled(power[-1:]) == "2" and not _is_factor(end)
        alone = len(line) == 1  # e/(2 c) in LaTeX
        field = (potential or not words.isdisjoint(("E", "B", "A", "Phi", "epsilon"))) and (
            bool(power)
            or alone
            or any(_is_factor(one) or one.is_operator(*"*/") for one in (before, after))
        )
        numeric = all(each.kind in ("number", "bracket") for each in power)
        known = squared or field or token in light or _is_constant_factor(line, place, moving)
        known |= not power and _is_factor(after) and (carets or after.order > 0)  # e x^3
        if token.order or glued or not numeric or not known:
            return False
        found = True
    return found


def is_exponential(line: Line, place: int) -> bool:
    """Whether the e here is raised to what has letters: e^(-r/a), not e^2."""
    caret, power = at(line, place + 1), at(line, place + 2)
    power = at(line, place + 3) if power.is_operator("+", "-") else power
    letters = any(token.kind == "name" for token in walk([power]))
    return line[place].text == "e" and caret.is_operator("^") and letters


def _over_light(tokens: Line) -> Iterator[Token]:
    """The e of each e/c, e/(2 m c), or \\frac{e}{c}, a charge over the speed of light."""
    for place, token in enumerate(tokens):
        yield from _over_light(token.inside)
        over = token.inside[0] if token.is_bracket() and len(token.inside) == 1 else token
        below = at(tokens, place + 2)
        letters = [one.text for one in walk([below]) if one.kind == "name"]
        if over.text == "e" and at(tokens, place + 1).is_operator("/") and letters[-1:] == ["c"]:
            yield over


def _is_constant_factor(line: Line, place: int, moving: Collection[str]) -> bool:
    """Whether the e here is that of e cos t, e g/c, or e Q: a product with nothing that could have
    been raised.
    """
    factors = [*itertools.takewhile(_is_factor, line[place + 1 :])]
    names = {token.text for token in factors if token.kind == "name"}
    if at(factors, 0).text in nm.FUNCTIONS:
        return True
    return bool(factors) and {token.kind for token in factors} == {"name"} and not names & {*moving}


def _is_factor(token: Token) -> bool:
    return token.kind in ("name", "number", "bracket")


def _called_with(line: Line, place: int, declared: nm.Names, defined: Collection[str]) -> int:
    """The number of arguments of an undeclared F in F(x*y), F(x, x') or f(y/x); 0 if it may be a
    factor.

    V(r) also counts for a `defined` r, as in r = sqrt(x^2 + y^2).
    """
    bracket, name = at(line, place + 1), line[place].text
    count = len(split_at(",", bracket.inside))
    called = name in _CALLED_LETTERS or _ENERGY.fullmatch(name)
    if not bracket.is_bracket() or (not called and (count == 1 or len(name) > 1)):
        return 0
    names = [declared.spelling(token.text) for token in walk(bracket.inside)]
    moves = any(each in ("t", *defined) or declared.role(each) == "coordinate" for each in names)
    heavy = at(line, place - 1).text in ("m", "M")
    weight = heavy or any(
        [each.kind for each in term] == ["number"] for term in split_at("+-", bracket.inside)
    )
    product = weight and name in ("g", "G")  # g(1 - x/l), mg(l - x)
    return 0 if bracket.space_before or not moves or product else count


def _has_explicit_products(found: Iterable[tuple[Line, int, Token]]) -> bool:
    """Whether every product has its sign, as in programs."""
    signs = False
    for line, place, _ in found:
        token, after = line[place], at(line, place + 1)
        signs |= token.is_operator("*")
        factor = token.kind in ("name", "number", "bracket")
        called = token.kind == "name" and after.is_bracket()
        if factor and not called and after.kind in ("name", "number", "bracket"):
            return False
    return signs


def _ask_back(
    guessed: Mapping[str, _Found], names: nm.Names, raised: Mapping[str, bool], explicit: bool
) -> dict[str, Words]:
    """The runs of letters that are clearly products; InputError for the first name that may not be
    a constant.
    """
    words = [name for name in guessed if 1 < len(name) < 4 and name.isalpha() and name[0] != "d"]
    if explicit and not any(name[:2].lower() == "mg" for name in words):
        words = []  # wn and wf, Mc and Mp
    shared = {
        letter
        for first, second in itertools.combinations(
            [name for name in words if not _INDEXED.fullmatch(name)], 2
        )
        for letter in {*first} & {*second}
    }
    plain = [name for name in guessed if re.fullmatch("[A-Za-z][0-9]*", name)]
    letters = (*plain, *shared)  # ml and mgl are products
    together = nm.Names(names.coordinates, (*names.parameters, *letters), names.functions)
    seen: dict[str, str] = {}
    splits: dict[str, Words] = {}
    ends = [name for name in guessed if name[0] in _COMPONENTS and name[1:] in names.coordinates]
    heads = [name[0] for name in ends]
    components = {name for name in ends if heads.count(name[0]) > 1}  # Fx and Fy
    known = {*names.declared(), *plain, "t", "g"}
    indexed = {name for name in guessed if _INDEXED.fullmatch(name) and name[1] not in known}
    below = _indices_of(names.coordinates) - known
    indexed |= {name for name in words if len(name) == 2 and name[1] in below}
    controls = [name for name in guessed if name[:1] in _CONTROLS and name[0] not in known]
    acting = [name for name in controls if name[1:] in names.coordinates]  # ur and uth
    indexed |= {name for name in acting if len(acting) > 1}
    for name, (pointer, token, end) in guessed.items():
        column = token.column
        frequency = _FREQUENCY.fullmatch(name)
        if frequency and frequency[2] not in plain:  # next to wt, too
            reader.note(name, "one constant", "*".join(frequency.groups()))
            _refuse_another_spelling(name, seen, token, pointer)
            continue
        whole = name in components or name in indexed
        if not whole and (parts := nm.only_split(name, together)):
            splits[name] = parts
            continue
        parts = nm.letters_of_run(name)
        mechanical = name.removesuffix("e" * (not raised.get(name, True)))  # k e^(-x)
        of_motion = time_derivatives.MECHANICAL_FACTOR.fullmatch(mechanical) is not None
        squared = name in raised and name not in plain and parts  # ml^2 is m*l^2
        mixed = name[:2] == "mg" or not (name.islower() or name.istitle() or name.isupper())
        weighs = _WEIGHT.fullmatch(name) and not (explicit and name.startswith("GM"))
        if weighs or (
            of_motion and (squared or (mixed and {*parts} & {*plain}))
        ):  # ml^2, mgl, and GMm
            splits[name] = parts
            continue
        if squared and not (explicit and {*parts}.isdisjoint(plain)):  # wn^2 of a program
            raise nm.undeclared(name, column, ("*".join(parts),)).at(pointer)
        if name in components and explicit:  # Qx and Qtheta of x_ddot = (Qx - k*x)/m
            _note_products([name])
            continue
        meant = nm.readings(name, together) or lost_power(name, names.coordinates)
        if meant and name not in indexed:
            raise nm.undeclared(name, column, meant, (column, end) if end else None).at(pointer)
        _ask_about_motion({name: (pointer, token, end)}, names)
        _refuse_another_spelling(name, seen, token, pointer)
    return splits


def _indices_of(coordinates: Sequence[str]) -> set[str]:
    """The s and u of zs and zu, the indices of one letter: ks and cs are no products next to them."""
    found = [name.replace("_", "") for name in coordinates]
    stems = [name[0] for name in found if len(name) == 2 and name.isalpha() and name.isascii()]
    return {
        name[1] for name in found if len(name) == 2 and name.isalpha() and stems.count(name[0]) > 1
    }


def _refuse_another_spelling(name: str, seen: dict[str, str], token: Token, pointer: str) -> None:
    """InputError for wn next to w_n; notes the name among those that are seen."""
    other = seen.setdefault(name.replace("_", ""), name)
    if other != name:
        raise fault("two spellings", token.column, name=shorten(name), other=other).at(pointer)


def _length(components: Sequence[str]) -> str:
    return f"sqrt({' + '.join(f'{name}^2' for name in components)})"


def _is_stiffness(line: Line, place: int, outer: Token, moving: Collection[str]) -> bool:
    """Whether the kt of kt (phi1 - phi2) is here, the constant of a spring; that of -2 kt, e^-kt,
    and sin kt is k t.
    """
    before, after = at(line, place - 1), at(line, place + 1)
    after = at(line, place + 2) if after.is_operator("*") else after
    inside = [after.text, *(token.text for token in walk(after.inside))]
    argument = outer.is_operator("^") or outer.text in nm.FUNCTIONS or before.text in nm.FUNCTIONS
    number = before.kind == "number"  # of e^-2kt
    raised = any(at(line, place - k).is_operator("^") for k in range(1, 3 + number))
    return bool({*inside} & {*moving}) and not argument and not raised


def _split_alike(names: Iterable[str]) -> dict[str, Words]:
    """a and k of the ak in m L theta'' = -mg theta + ak theta, in which mg is a product."""
    return {
        name: (name[0], name[1])
        for name in names
        if _PAIR.fullmatch(name) and name not in nm.GREEK_NAMES
    }


def _note_function(name: Token, bracket: Token) -> None:
    """Note that h(x - b) and k(x) are values of functions, and could be products; f(x) and k(t)
    could not.
    """
    inside, words = source([bracket]), [token.text for token in bracket.inside]
    sums = any(token.is_operator("+", "-") for token in bracket.inside[1:])
    sums = sums and len(split_at(",", bracket.inside)) == 1 and name.text in _FACTORS_OR_FUNCTIONS
    usual = name.text in nm.FUNCTION_LETTERS | nm.MAY_BE_FUNCTIONS | _CALLED_LETTERS
    factor = (
        len(words) == 1 and words != ["t"] and not (name.order or usual) and bracket.is_bracket()
    )
    if sums or (factor and len(name.text.rstrip("_0123456789")) == 1):
        note = f"a function {name.text}", f"{name.text}*{inside}"
        reader.note(f"{name.text}{inside}", *note)


def _note_products(names: Iterable[str]) -> None:
    """Note that EI is one constant, and could be E I."""
    for name in names:
        parts = nm.letters_of_run(name)
        if [len(part) for part in parts] == [1, 1] and name.isascii():
            reader.note(name, "one constant", "*".join(parts))


def _ask_about_motion(guessed: Mapping[str, _Found], names: nm.Names) -> None:
    """InputError for the first name that may move, or be the time; no more is asked about the names
    of a program, which has no products without a sign: Mc and mut are names.
    """
    for name, (pointer, token, _) in guessed.items():
        column = token.column
        if name == "x" or _is_one_of_many(name, names.coordinates):
            raise nm.ask_for_the_time(name, column, names.coordinates).at(pointer)
        if name in ANY_SPEED and pointer.startswith("/constraints"):
            raise fault("any speed", column, name=name).at(pointer)
        if alike := _may_be_motion(name, names.coordinates):
            raise nm.undeclared(name, column, alike).at(pointer)


def lost_power(name: str, coordinates: Sequence[str]) -> Words:
    """x^2 for x2 next to x, a*x^2 for ax2, xdot^2 for xdot2, and dx/dt for dxdt, which lost a sign
    when pasted.

    Also a*q2 for aq2 next to q1; Fx1 is usually a component.
    """
    if dotted := re.fullmatch("([A-Za-z]+dot)([2-9])|d([A-Za-z]+)dt", name):
        return (f"d{dotted[3]}/dt" if dotted[3] else f"{dotted[1]}^{dotted[2]}",)
    cut = re.fullmatch("((?:[A-Za-z][0-9]?){0,3}?)([A-Za-z])([1-9])", name)
    if cut is None or cut[1] in _COMPONENTS:
        return ()
    if cut[2] in coordinates and cut[3] != "1":
        return (f"{cut[1]}{'*' * bool(cut[1])}{cut[2]}^{cut[3]}",)
    return (
        (f"{cut[1]}*{cut[2]}{cut[3]}",)
        if cut[1] and _is_one_of_many(cut[2] + cut[3], coordinates)
        else ()
    )


def _radius(coordinates: Sequence[str]) -> str:
    """x^2+y^2+z^2, or what of it moves; empty without x and y."""
    moving = [name for name in ("x", "y", "z") if name in coordinates]
    return "+".join(f"{name}^2" for name in moving) if moving[:2] == ["x", "y"] else ""


def _may_be_motion(name: str, coordinates: Sequence[str]) -> Words:
    """What a name may mean: t for time, a length for r, x' for v, Theta for theta, x for X; R and r
    may coexist.
    """
    if name == "time":
        return ("t",)
    if name == "r" and (written := _radius(coordinates)):
        return (f"sqrt({written.replace('+', ' + ')})",)
    if name in _WORDS_OF_MOTION:
        return tuple(f"{each}{_WORDS_OF_MOTION[name]}" for each in coordinates[:1])
    meant = name.lower() if name in ("X", "Y", "Z") else name
    return tuple(other for other in coordinates if other != name and other.lower() == meant)


def _unit(line: Line, place: int, alone: bool, coordinates: Sequence[str]) -> str:
    """The N/m of k = 3 N/m and of 3 N/m `alone`, the m/s of 2 m/s; empty for other names after a
    number.
    """
    rest = list(itertools.takewhile(lambda token: not token.is_operator(",", ";"), line[place:]))
    given = line[place].space_before and (
        at(line, place - 2).is_operator("=") or (alone and place < 2)
    )
    if (
        given
        and _UNIT.fullmatch(source(rest))
        and not {token.text for token in rest} & {*coordinates}
    ):
        return source(rest)
    return "m/s" * (spelled(line[place : place + 3]) == "m/s" and "s" not in coordinates)


def _half_a_number(line: Line, place: int) -> errors.InputError | None:
    """The error for 1.0d-3 and 2D0 (Fortran), 0.5f (C), 1f0 (Julia), 0o7, whose letters are not
    factors.
    """
    token, before = line[place], at(line, place - 1)
    if before.kind != "number" or token.space_before:
        return None
    text, after = (
        token.text,
        [other.text for other in line[place + 1 : place + 3] if not other.space_before],
    )
    power = text in ("d", "D") and len(after) == 2 and after[0] in "+-" and after[1].isdigit()
    suffix = re.fullmatch("[dDfF][0-9]{1,3}", text) is not None or (
        text in ("f", "F") and "." in before.text
    )
    if not (power or suffix or before.text == "0"):
        return None
    shown = before.text + text + "".join(after) * power
    return fault("half a number", before.column, shown=shown, letters=text)


def _is_apart(name: Token, after: Token) -> bool:
    """Whether this is k (x), which may be k*x; f (x) and V (x) are usually functions."""
    return name.text not in nm.FUNCTION_LETTERS and after.is_bracket() and after.space_before


def _looks_like_a_function(name: str) -> bool:
    """Whether the name may be a known function, such as a mistyped sqrt or acot; then it is not
    guessed.

    gamma(t) and zeta(x) are usually coefficients; Gamma is the function. Epot(x) is a potential.
    """
    is_word = re.match("[A-Za-z]{3}", name) is not None and name not in nm.GREEK_NAMES
    is_word = is_word and not _ENERGY.fullmatch(name)
    known = nm.REFUSED_UNLESS_DECLARED.keys() - {"gamma", "zeta"}
    return is_word or not known.isdisjoint((name, name.replace("_", "")))


def _elliptic_arguments(line: Line, place: int) -> int:
    """The number of arguments of sn u, cn(u, k) and dn^2(u, k); 0 for a constant, as in cn*x."""
    after = at(line, after_power(line, place + 1))
    if line[place].text not in nm.ELLIPTIC:
        return 0
    return len(split_at(",", after.inside)) if after.is_bracket() else int(after.kind == "name")


def _may_depend_on_time(name: str) -> bool:
    """Whether name(t) may be a function of time: not x(t), a coordinate without an equation,
    delta(t), or a word.
    """
    moves = nm.looks_like_a_coordinate(name) and name not in ("q", "r", "s", "tau")
    return not (moves or name in _IMPULSES or _looks_like_a_function(name))
