r"""Convert other notations for formulas to this package's grammar, tokens in, tokens out, without
evaluation.

SymPy's text (`x(t).diff(t, 2)`, `Eq(a, b)`, the calls of `srepr`), Mathematica (`x''[t] ==
-Sin[x[t]]`, `D[u, {t, 2}]`, `Derivative[2][x][t]`, Plus, Times, Power), Maple (`diff(x(t), t$2)`,
`(D@@2)(x)(t)`), Maxima (`'diff(x, t, 2)`), Modelica (`der(x)`); and derivatives written with d in
plain text and LaTeX: dx/dt, d^2x/dt^2, \frac{d}{dt}(m x'), (d/dt)^2 x, dV(x)/dx, (r^2 x')'. A LaTeX
fraction arrives as ((above)/(below)) with its first bracket marked FRACTION, so that one parser
handles all of them.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal, NamedTuple

from inverse_service.expressions.refusals import LIMITS, at_most, fault
from inverse_service.reading import entries as ar, labels, programs, tokens as tk
from inverse_service.reading.names import (
    DERIVATIVE_NAMES,
    FUNCTIONS,
    GREEK_NAMES,
    Names,
    meanings,
)
from inverse_service.reading.tokens import Line, Token, Tokens, at

_MODULES = frozenset(
    ("sp", "sm", "smp", "sympy", "sym", "np", "numpy", "math", "Math", "jnp", "hy", "heyoka")
)
_CAPITALS = meanings("mathematica")
_PIECES = "Piecewise[{"  # a head that cannot be a name
_HEADS = meanings("heads")
# Derivatives written with d.
_ABOVE = re.compile(r"d([2-9]?)([A-Za-z]\w*)?")
_BELOW = re.compile(r"d([A-Za-z]\w*?)([2-9]?)")
_FACTORS = re.compile("[A-Za-z][0-9]?")
_GLUED = re.compile(
    rf"([A-Za-z]\w{{0,7}}?)(d2?(?:[A-Za-z]_?[0-9]*|{'|'.join(sorted(GREEK_NAMES))}))"
)  # the bdx of bdx/dt
_DIGITS = tuple("123456789")
_MOST_ALIASES = 3  # in a row
_OF_NUMBERS = ("S", "Float", "sympify", "nsimplify", "RealNumber")  # S(9.81) of SymPy
_WITH_VARIABLE = ("df",)  # of REDUCE; df(x) is a function of this name
_RATES = ("D", "Dt", "D_t")  # of D(x), and of Julia's D\u209c(x)
_CLEAR = ("=", "+", "-", ",", ";", ")", "&", "<", ">")


def in_our_words(tokens: Tokens, names: Names) -> Tokens:
    """The same formulas in this package's notation; tokens that already have it are returned
    unchanged.
    """
    tokens = programs.with_primes_before_time(tokens)
    while at(tokens, 0).is_operator(";"):
        tokens = tokens[1:]
    tokens = _with_prefixes(tokens)
    mathematica = _is_mathematica(tokens)
    if not mathematica:
        tokens = programs.as_equations(_with_arrows(tokens), names)
    marks = {token.text for token in tk.walk(tokens)}
    if mathematica:
        tokens = _with_pairs(tokens)
    if marks & {"[", "{"}:
        indexed = _with_indices(tokens, names, "capitals" if not mathematica else "small")
        tokens = _with_round_brackets(indexed, names, mathematica)
    written = tokens
    if marks & {*_HEADS, *_OF_NUMBERS, ".", "@", "Piecewise", "diff", "D2"}:
        tokens = _with_aliases(_rewritten(tokens, names), names)
        if tokens != written:  # eom = m*qdd + k*q after qdd = q.diff(t, 2)
            tokens = labels.without_labels(tokens, names)
    if (
        "I" in marks
        and names.role("I") is None
        and not _defines(tokens, "I")
        and not _has_second_difference(written)
        and (mathematica or tokens != written or marks & DERIVATIVE_NAMES)
    ):
        raise fault(
            "imaginary unit", next(token.column for token in tk.walk(tokens) if token.text == "I")
        )
    last = len(tokens) - 1 - at(tokens, len(tokens) - 1).is_operator(";")
    given, whole = tokens[: max(last, 0)], at(tokens, last)  # [eq1, eq2] and sys := {eq1, eq2};
    labelled = len(given) == 2 and given[0].kind == "name" and given[1].is_operator("=")
    whole = _flattened(whole)
    alone = not given or (
        labelled and (given[1].value == tk.GIVEN or whole.is_bracket() or whole.is_bracket("["))
    )
    if alone and not whole.order and any(token.is_operator("=") for token in whole.inside):
        closed = Token("operator", ";", whole.end)  # where the last of the equations ends
        inside = _with_expressions_apart(whole.inside)
        tokens = [*(given if given and given[1].value else ()), *inside, closed]
        if given and not given[1].value:
            tk.note(f"{given[0].text} =")
    return with_derivatives(_without_lists(tokens), names)


def _flattened(whole: Token) -> Token:
    """{u = v, w = z} for {{u = v}, {w = z}}."""
    parts = tk.split_at(",", whole.inside)
    lists = [part[0].inside for part in parts if len(part) == 1 and part[0].is_bracket()]
    equal = all(any(token.is_operator("=") for token in one) for one in lists)
    if len(lists) < len(parts) or len(parts) < 2 or not equal:
        return whole
    return replace(whole, inside=tuple(_joined([[*one] for one in lists], ",", whole)))


def _with_arrows(tokens: Tokens) -> Tokens:
    """V(x) := x^4 for Maple's V := x -> x^4."""
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        name, equal, argument = (at(part, k) for k in range(3))
        arrow = at(part, 3).is_operator("-") and at(part, 4).is_operator(">")
        given = name.kind == "name" and equal.value == tk.GIVEN and arrow
        if given and sum(token.text == name.text for token in tk.walk(tokens)) == 1:
            tk.note(tk.source(part))
            continue
        if given and tk.spelled([argument]).strip("()") == "t":
            part = [name, replace(equal, column=part[4].column), *part[5:]]
        elif given:
            inside = argument.inside if argument.is_bracket() else (argument,)
            call = replace(tk.bracket(inside, argument, space=False), end=argument.span[1])
            part = [name, call, replace(equal, column=part[4].column), *part[5:]]
        found += [*part, *([end] if end else [])]
    return found


def _with_prefixes(line: Line) -> Tokens:
    """Sin[x[t]] for Mathematica's Sin@x[t], and D@@2 for Maple's D@D."""
    found: Tokens = []
    place = 0
    while place < len(line):
        token, operand = line[place], at(line, place + 1)
        name = at(found, len(found) - 1)
        if not token.is_operator("@") or name.kind != "name" or operand.is_operator("@"):
            found.append(tk.within(token, _with_prefixes))
            place += 1
            continue
        if name.text == operand.text == "D":
            found += tk.tokens_in_place("@@2", token)
            place += 2
            continue
        stop = place + 2 + at(line, place + 2).is_bracket("[") * (operand.kind == "name")
        while at(line, stop).is_operator("@"):  # Sin@Cos@x[t]
            stop += 2 + at(line, stop + 2).is_bracket("[")
        whole = operand.is_bracket() and stop == place + 2
        inside = [*operand.inside] if whole else [*line[place + 1 : stop]]
        found.append(replace(tk.bracket(_with_prefixes(inside), token, space=False), text="["))
        place = stop
    return found


def _without_lists(tokens: Tokens) -> Tokens:
    """m = 1; x'' = -x; y'' = -y for m = 1; {x'' = -x, y'' = -y}."""
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    if len(parts) < 2:
        return tokens
    found: Tokens = []
    for part, end in parts:
        whole = at(part, len(part) - 1)
        named = len(part) == 3 and part[0].kind == "name" and part[1].is_operator("=")
        listed = (len(part) == 1 or named) and whole.is_bracket() and not whole.order
        if listed and any(token.is_operator("=") for token in whole.inside):
            if named:
                tk.note(f"{part[0].text} =")
            part = [*whole.inside, Token("operator", ";", whole.end)]
        found += [*part, *([end] if end else [])]
    return found


def _with_aliases(tokens: Tokens, names: Names) -> Tokens:
    """The tokens with diff(x(t), t, 2) for the a of a = diff(x(t), t, 2), whose own derivative does
    not occur.
    """
    if names.forms:  # xDot = diff(x, t) next to L is a definition
        return tokens
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    named = [_names_derivative(part, names) for part, _ in parts]
    others = [
        token
        for (part, _), is_named in zip(parts, named, strict=True)
        if not is_named
        for token in part
    ]
    moved = {
        at(operand, 0).text
        for line, place, _ in tk.places(others)
        if line[place].text in DERIVATIVE_NAMES
        for operand in tk.split_at(",", at(line, place + 1).inside)[:1]
    } | {token.text for token in tk.walk(others) if token.order}
    aliases: dict[str, Tokens] = {}
    kept: list[tuple[Tokens, Token | None]] = []
    for (part, end), is_named in zip(parts, named, strict=True):
        name = at(part, 0).text
        again = sum(token.text == name for token in tk.walk(tokens)) > 1
        if is_named and again and name not in moved:
            tk.note(tk.source(part), "a name of a derivative")
            aliases[name] = part[2:]
        else:
            kept.append((part, end))
    line = [token for part, end in kept for token in [*part, *([end] if end else [])]]
    for _ in range(min(len(aliases), _MOST_ALIASES)):  # a = diff(v, t); v = diff(x, t)
        line = _with_meant(line, aliases)
    return line if aliases else tokens


def _names_derivative(part: Line, names: Names) -> bool:
    """Whether a statement is a = diff(x(t), t, 2)."""
    name = at(part, 0)
    given = name.kind == "name" and not name.order and at(part, 1).is_operator("=")
    return given and labels.derivative_called(part[2:]) is not None and not names.role(name.text)


def _with_meant(line: Line, aliases: Mapping[str, Tokens]) -> Tokens:
    """The tokens with what each name of a derivative means, at the place of the name."""
    found: Tokens = []
    for place, token in enumerate(line):
        called = at(line, place + 1).is_bracket() and not at(line, place + 1).space_before
        if token.kind == "name" and token.text in aliases and not called:
            found += [replace(one, column=token.column) for one in aliases[token.text]]
        else:
            found.append(tk.within(token, lambda inside: _with_meant(inside, aliases)))
    return found


def _defines(tokens: Line, name: str) -> bool:
    """Whether a statement gives the value of a name."""
    return any(
        tk.spelled(part[:2]) == f"{name}=" for part in tk.split_at(";,", tokens) if len(part) > 2
    )


def _has_second_difference(tokens: Line) -> bool:
    """Whether the diff(x, 2) of MATLAB occurs, whose imaginary unit is 1i."""
    return any(
        line[place].text == "diff"
        and not at(line, place - 1).is_operator(".")  # x.diff(t, 2)
        and [token.kind for token in at(line, place + 1).inside] == ["name", "operator", "number"]
        for line, place, _ in tk.places(tokens)
    )


def _with_indices(tokens: Tokens, names: Names, letters: Literal["small", "capitals"]) -> Tokens:
    """x[1]'' as x_1'' if x always has a numeric index: in a text with x[t], x[0] is a value.

    F[1] of Mathematica is the value of a function; F[0] of Maple is F_0, and omega[0] is omega_0
    beside a constant omega.
    """
    constant = _constants(tokens) if letters == "capitals" else frozenset[str]()
    alone = {
        line[k].text
        for line, k, _ in tk.places(tokens)
        if line[k].kind == "name" and not _is_indexed(line, k)
    } - constant
    known = FUNCTIONS | {word for word in _HEADS if word.isalpha()} | set(names.functions) | alone

    def with_indices(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            before = at(line, place - 1)
            if (
                _is_indexed(line, place - 1)
                and (letters == "capitals" or not before.text[:1].isupper())
                and before.text not in known
            ):
                text = f"{before.text}_{token.inside[0].text}"
                found[-1] = replace(before, text=text, order=token.order, primed=token.primed)
            else:
                found.append(tk.within(token, with_indices))
        return found

    return with_indices(tokens)


def _constants(tokens: Line) -> frozenset[str]:
    """The names that are neither called, nor differentiated, nor given in a statement of their
    own.
    """
    changing = {
        line[k].text
        for line, k, _ in tk.places(tokens)
        if line[k].order or (at(line, k + 1).is_bracket() and not _is_indexed(line, k))
    }
    for line, k, _ in tk.places(tokens):
        if line[k].text in DERIVATIVE_NAMES or line[k].text in _RATES:
            operand = tk.split_at(",", at(line, k + 1).inside)[0]
            changing |= {token.text for token in tk.walk(operand)}
    changing |= {at(part, 0).text for part in tk.split_at(";,", tokens)}
    return frozenset({token.text for token in tk.walk(tokens)} - changing)


def _is_indexed(line: Line, place: int) -> bool:
    """Whether x[1] is here, not followed by arguments as in x[1](...)."""
    name, index, after = (at(line, place + k) for k in range(3))
    called = after.is_bracket() and tk.spelled(after.inside) != "t"
    named = name.kind == "name" and not name.order
    return named and index.is_bracket("[") and tk.spelled(index.inside).isdigit() and not called


def with_subscripts(line: Line, names: Names) -> Tokens:
    """V[1,0] for the V_x, and V[1,1] for the V_xy, of a declared function V of x and y, and diff(V,
    x) for the V_x of a V that the text gives, V = x^2 y; each is noted.
    """
    return _with_subscripts(line, names, _given_with_slopes(line))


def _given_with_slopes(line: Line) -> frozenset[str]:
    """The V of V = x^2 y, beside V_x and x''."""
    moving = {token.text for token in tk.walk(line) if token.order > 1}
    parts = tk.split(line, lambda _, token: token.is_operator(";", ",") or token.text in tk.JOINING)
    given = {
        part[0].text
        for part, _ in parts
        if part
        and part[0].kind == "name"
        and not part[0].order
        and at(part, 1).is_operator("=")
        and moving & {token.text for token in tk.walk(part[2:])}
    }
    return frozenset(f"{name}_{by}" for name in given for by in moving)


def _with_subscripts(line: Line, names: Names, slopes: frozenset[str]) -> Tokens:
    found: Tokens = []
    for token in line:
        head, _, below = token.text.partition("_") if token.kind == "name" else ("", "", "")
        if below[:1] == ",":  # the V_{,x} of a defined V
            found += _slope_of_definition(token, head, below[1:], names)
            continue
        if token.text in slopes and not names.role_meant(token.text) and not token.order:
            tk.note(token.text, f"diff({head}, {below})")
            inside = tk.tokens_in_place(f"{head},{below}", token)
            found += [replace(token, text="diff"), tk.bracket(inside, token, space=False)]
            continue
        arguments = names.functions.get(head, ())
        by = [below] if below in arguments else list(below)
        if not by or names.role_meant(token.text) or not {*by} <= {*arguments}:
            found.append(tk.within(token, lambda inside: _with_subscripts(inside, names, slopes)))
            continue
        tk.note(token.text, f"diff({head}({', '.join(arguments)}), {', '.join(by)})")
        orders = ",".join(str(by.count(argument)) for argument in arguments)
        if len(arguments) == 1:
            found.append(replace(token, text=head, order=len(by), primed=token.column))
        else:
            brackets = tk.nested(tk.tokens_in_place(f"[{orders}]", token))
            found += [replace(token, text=head), *brackets]
    return found


def _slope_of_definition(token: Token, head: str, below: str, names: Names) -> Tokens:
    """diff(V, x) for V_{,x}, with the coordinates of `below`; the token itself for other names."""
    by = [below] if below in names.coordinates else list(below)
    if not {*by} <= {*names.coordinates}:
        return [replace(token, text=f"{head}_{below}")]
    tk.note(f"{head}_{{,{below}}}", f"diff({head}, {', '.join(by)})")
    inside = tk.tokens_in_place(",".join((head, *by)), token)
    return [replace(token, text="diff"), tk.bracket(inside, token, space=False)]


def _with_expressions_apart(line: Line) -> Tokens:
    """x'' + x for the {x'' + x, x(0) = 1} of a list with an expression that is zero; initial values
    beside it are left out.
    """
    parts = tk.split_at(",", line)
    bare = [part for part in parts if not any(token.is_operator("=") for token in part)]
    moving = [
        any(one.order > 1 or one.text in labels.DERIVATIVES for one in tk.walk(part))
        for part in bare
    ]
    if not bare or not all(moving):
        return [*line]
    held = [part for part in parts if labels.is_at_a_number(part)]
    for part in held:
        tk.note(tk.source(part))
    return _joined([part for part in parts if part not in held], ";")


def _is_mathematica(tokens: Tokens) -> bool:
    """Whether x[t] or Sin[u] occurs."""
    brackets = [
        (at(line, k - 1).text, line[k])
        for line, k, _ in tk.places(tokens)
        if line[k].is_bracket("[")
    ]
    return any(
        head != _small(head) or (head.isalnum() and at(bracket.inside, 0).text == "t")
        for head, bracket in brackets
    )


def _with_round_brackets(line: Line, names: Names, mathematica: bool) -> Tokens:
    """Mathematica's f[x] and {x, 2} with round brackets; the orders in B[1,0](x, y) are kept.

    If nothing else indicates Mathematica, k[x] is as ambiguous as k (x).
    """
    found: Tokens = []
    for place, token in enumerate(line):
        before = at(line, place - 1)
        named = token.text == "[" and before.kind == "name" and not before.order
        if token.kind != "bracket" or (named and _holds_orders(line, place)):
            found.append(token)
            continue
        if named:
            listed = before.text == "Piecewise" and at(token.inside, 0).is_bracket("{")
            found[-1] = replace(before, text=_PIECES if listed else _small(before.text))
        unclear = named and not mathematica and names.role(found[-1].text) is None
        inside = tuple(_with_round_brackets(token.inside, names, mathematica))
        space = unclear or (token.space_before and not named)
        found.append(replace(token, text="(", inside=inside, space_before=space))
    return found


def _holds_orders(line: Line, place: int) -> bool:
    """Whether [1,0]( is here, rather than Derivative[1][x] or f[2]."""
    plain = all(token.kind == "number" or token.is_operator(",") for token in line[place].inside)
    return plain and line[place - 1].text != "Derivative" and at(line, place + 1).is_bracket()


def _small(name: str) -> str:
    """Mathematica's Sin as sin."""
    if name == "Log":
        return name  # Log[b, x] is log(x, b)
    known = _CAPITALS.get(name) or name.lower()
    return (
        known
        if name in _CAPITALS or (known in FUNCTIONS and name != known and name.istitle())
        else name
    )


def _rewritten(line: Line, names: Names) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(line):
        token, after = line[place], at(line, place + 1)
        square = not at(line, place + 2).is_bracket()  # Maple's (D^2)(x)(t) is a square
        sign = r"@@|\^" if square else "@@"
        power = re.fullmatch(rf"D(?:{sign})(\d+)", tk.spelled(token.inside))
        called = (
            token.kind == "name"
            and token.text in _HEADS
            and not names.role(token.text)
            and after.is_bracket()
            and (token.text not in _WITH_VARIABLE or len(tk.split_at(",", after.inside)) > 1)
        )
        if token.is_operator("."):
            place = _after_dot(line, place, found, names)
        elif power:
            place = _derivative_of(line, place + 1, int(power[1]), found)
        elif token.text == "D" and not names.role("D") and (order := _positions(after)):
            place = _derivative_of(line, place + 2, order, found)
        elif _is_power_of_rate(line, place) and not names.role("D"):
            place = _derivative_of(line, place + 3, int(line[place + 2].text), found)
        elif (
            token.text == "D2"
            and _begins(found)
            and not names.role("D2")
            and len(after.inside) == 1
        ):
            place = _derivative_of(line, place + 1, 2, found)  # Julia's D2 = Differential(t)^2
        elif (whole := _whole_derivative(token, after, names)) is not None:
            found.append(whole)
            place += 1
        elif token.text in _OF_NUMBERS and _is_number(after) and not names.role(token.text):
            found += [replace(after.inside[-1], space_before=token.space_before)]
            place += 2
        elif called and not (token.text in _RATES and _is_factor(after)):
            place = _called(line, place, found, names)
        else:
            found.append(tk.within(token, lambda inside: _rewritten(inside, names)))
            place += 1
    return found


def _is_power_of_rate(line: Line, place: int) -> bool:
    """Whether this is Julia's D^2(x)."""
    sign, power, operand = (at(line, place + k) for k in (1, 2, 3))
    named = [token.kind for token in operand.inside[:1]] == ["name"] and operand.is_bracket()
    named = named and tk.spelled(operand.inside[1:]) in ("", "(t)") and not operand.space_before
    counted = sign.is_operator("^") and power.text in _DIGITS
    return line[place].text == "D" and line[place].kind == "name" and counted and named


def _is_number(bracket: Token) -> bool:
    """Whether this is the (9.81) of S(9.81)."""
    kinds = [token.kind for token in bracket.inside]
    return bracket.is_bracket() and kinds == ["number"] and not bracket.space_before


def _whole_derivative(token: Token, after: Token, names: Names) -> Token | None:
    """x' for the (D(x)) of Maple's (D(x))(t), and x'' for ((D@@2)(x)); None for other tokens."""
    inside = token.inside
    operator = tk.spelled(inside[:1]) == "D" or re.fullmatch(r"\(D@@\d+\)", tk.spelled(inside[:1]))
    timed = after.is_bracket() and tk.spelled(after.inside) in ("t", "x", "0")
    if not (token.is_bracket() and len(inside) == 2 and operator and timed and not token.order):
        return None
    if names.role("D"):
        return None
    found = _rewritten(inside, names)
    return found[0] if len(found) == 1 and found[0].order else None


def _begins(found: Line) -> bool:
    """Whether an equation begins after these tokens."""
    last = at(found, len(found) - 1)
    return last.kind == "end" or last.is_operator(",", ";")


def _positions(bracket: Token) -> int:
    """How many positions the [1, 1] of Maple's D[1, 1](x) lists, or the [0, 0] of Sage's; 0 for
    anything else.
    """
    places = [token.text for token in bracket.inside if not token.is_operator(",")]
    first = {*places} in ({"0"}, {"1"})
    return len(places) if first and bracket.is_bracket("[") else 0


def _after_dot(line: Line, place: int, found: Tokens, names: Names) -> int:
    """sp.sin is sin; u.diff(t, 2) is diff(u, t, 2)."""
    method, variables = at(line, place + 1), at(line, place + 2)
    if found and found[-1].text in ar.PARAMETERS and not found[-1].order and method.text != "diff":
        found[-1] = replace(method, space_before=found[-1].space_before)  # p.g of Julia
        return place + 2
    if found and found[-1].text in _MODULES:
        heyoka = found.pop().text in ("hy", "heyoka")
        if heyoka and method.text == "time":
            found.append(replace(method, text="t"))
            return place + 2
        return place + 1
    if method.text not in ("diff", "derivative") or not variables.is_bracket():
        raise fault("dot", line[place].column)
    called = at(found, len(found) - 1).is_bracket() and at(found, len(found) - 2).kind == "name"
    start = max(0, len(found) - 1 - called)
    method = replace(method, text="diff")
    by = _rewritten(variables.inside, names) or [Token("name", "t", method.column)]
    inside = _joined([found[start:], by], ",", method)
    method = replace(method, column=at(found, start).column or method.column)
    found[start:] = [
        replace(method, space_before=True),
        tk.bracket(inside, method, space=False),
        *_primes(variables),
    ]
    return place + 3


def _primes(token: Token) -> Tokens:
    """The primes after a replaced bracket; they are refused later."""
    return [Token("prime", "'", token.primed)] * (token.order > 0)


def _sign(text: str, at: Token) -> Token:
    return Token("operator", text, at.column)


def _derivative_of(line: Line, place: int, order: int, found: Tokens) -> int:
    """(x) after D or Derivative[2] as x with primes; the following (t) is converted separately."""
    operand = at(line, place)
    order += operand.order
    while (
        len(operand.inside) == 2
        and operand.inside[0].text in _RATES
        and operand.inside[1].is_bracket()
    ):  # D(D(x))
        operand, order = operand.inside[1], order + 1
    timed = tk.spelled(operand.inside[1:]) == "(t)"  # D(x(t))
    whole = operand.is_bracket() and (len(operand.inside) == 1 or timed)
    name = operand.inside[0] if whole else operand
    if name.kind != "name" or name is operand:
        raise fault("derivative of a name", line[place - 1].end or line[place - 1].column)
    found.append(replace(name, order=name.order + order, primed=name.column))
    return place + 1


def _is_factor(bracket: Token) -> bool:
    """Whether the bracket after a D is a factor, as in D (1 - exp(-x))^2, rather than the operand
    of a derivative.
    """
    inside = bracket.inside
    return len(inside) > 1 and len(tk.split_at(",", inside)) == 1 and inside[0].text not in _RATES


def _called(line: Line, place: int, found: Tokens, names: Names) -> int:
    """Convert the call that begins here to this package's notation; return the place after it.

    D(x)(t) is x'(t), Derivative[2][x][t] is x''(t), and ModelingToolkit's Differential(t)(u) is
    diff(u, t).
    """
    head, given = line[place : place + 2]
    arguments, after = [part for part in tk.split_at(",", given.inside) if part], place + 2
    if head.text in _RATES and len(arguments) < 2:
        return _derivative_of(line, place + 1, 1, found)
    if head.text == "Derivative" and [token.kind for token in given.inside] == ["number"]:
        return _derivative_of(line, after, int(given.inside[0].value), found)
    if head.text == "Differential":
        operand = at(line, after)
        times = [token.kind for token in arguments[1]] == ["number"] if arguments[1:] else True
        if len(arguments) not in (1, 2) or not times or not operand.is_bracket():
            raise fault("Differential", head.column)
        arguments, after = [[*operand.inside], *arguments], after + 1
    if _HEADS[head.text] == "indexed" and [len(argument) for argument in arguments] == [1, 1]:
        found.append(replace(_with_index(head, *arguments), order=given.order, primed=given.primed))
        return after
    try:
        found += _converted(head, [_rewritten(argument, names) for argument in arguments])
    except (ValueError, IndexError):
        raise fault(f"{_HEADS[head.text]} of another program", head.column) from None
    found += _primes(given)
    return after


def _with_index(head: Token, name: Tokens, index: Tokens) -> Token:
    """phi_1 for Subscript[phi, 1]."""
    if name[0].kind != "name" or name[0].order or index[0].kind not in ("name", "number"):
        raise fault("indexed of another program", head.column)
    return replace(head, text=f"{name[0].text}_{index[0].text}")


def _with_pairs(tokens: Tokens) -> Tokens:
    """x' = v, v' = -x for Mathematica's {x', v'} == {v, -x}."""
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        listed = len(part) == 3 and part[0].is_bracket("{") and part[2].is_bracket("{")
        if listed and part[1].is_operator("="):
            sides = [tk.split_at(",", side.inside) for side in (part[0], part[2])]
            if len(sides[0]) == len(sides[1]):
                part = _pairs(part)
        found += [*part, *([end] if end else [])]
    return found


def _pairs(whole: Tokens) -> Tokens:
    """x = a, y = b for {x, y} = {a, b}; ValueError if these are not lists of one length."""
    equal = next((token for token in whole if token.is_operator("=")), None)
    if equal is None:
        return [*whole]
    left, right = (tk.split_at(",", side.inside) for [side] in tk.split_at("=", whole))
    return _joined([_joined(pair, "=", equal) for pair in zip(left, right, strict=True)], ",")


def _joined(parts: Sequence[Tokens], sign: str, at: Token | None = None) -> Tokens:
    """The parts with the sign between them."""
    return [
        token
        for k, part in enumerate(parts)
        if part
        for token in [_sign(sign, at or part[0])] * bool(k) + part
    ]


def _converted(head: Token, parts: Sequence[Tokens]) -> Tokens:
    """The call in this package's notation, by its kind in `words.toml`; ValueError or IndexError if
    it does not fit.
    """
    match kind := _HEADS[head.text]:
        case "name":  # Symbol('x', positive=True) and Function('x') are x
            quote, name = parts[0]
            if quote.kind != "prime" or name.order != 1:
                raise ValueError
            return [replace(name, space_before=head.space_before, order=0, primed=0)]
        case "entries":  # Matrix([[u], [v]]) is u, v
            [[column]] = parts
            if not column.is_bracket():
                raise ValueError
            return [*column.inside]
        case "pieces":  # Piecewise[{{a, x > 0}, …}, b] is piecewise((a, x > 0), …, (b, true)); b is 0 if omitted
            [listed], *rest = parts
            otherwise = rest[0] if rest else [Token("number", "0", head.column)]
            last = tk.bracket([*otherwise, _sign(",", head), _sign("true", head)], head)
            return [
                replace(head, text="piecewise"),
                tk.bracket([*listed.inside, _sign(",", head), last], head),
            ]
        case "=":
            if len(parts) == 1:  # Eq(x'' + x)
                parts = [*parts, [Token("number", "0", head.column)]]
            left, right = parts
            return _joined([left, right], "=")
        case (
            "+" | "*" | "^" | "/" | ","
        ):  # Add(a, b) as (a + b), Rational(1, 2) as (1/2), List(a, b) as (a, b)
            if head.text == "Integer" and [len(part) for part in parts] == [1]:
                return parts[0]
            if kind in "+*^":
                parts = [p if len(p) == 1 else [tk.bracket(p, p[0], space=False)] for p in parts]
            return [tk.bracket(_joined(parts, kind), head, tk.FACTOR)]
        case "decimal":
            raise ValueError
        case "joined":  # Join[{u, v}, {w}]
            lists = [one[0] for one in parts if len(one) == 1 and one[0].kind == "bracket"]
            if len(lists) != len(parts):
                raise ValueError
            inside = [[*one.inside] for one in lists]
            return [tk.bracket(_joined(inside, ",", head), head, tk.FACTOR)]
        case "equations":  # Thread[{u, v} == {a, b}]
            [whole] = parts
            return [tk.bracket(_pairs(whole), head, tk.FACTOR)]
        case "solver":  # DSolve[{equations}, x, t]
            first, *more = parts
            equations = [part for part in more if _is_equation_of_motion(part)]
            for part in more:
                if part not in equations:
                    tk.note(tk.source(part))
            first = _joined([first, *equations], ",")  # dsolve(diff(f, t, 2) == g, ...)
            return [tk.bracket(first, head, tk.FACTOR)] if len(first) > 1 else first
        case "diff" if len(parts) == 2 and [token.kind for token in parts[1]] == [
            "number"
        ]:  # diff(x, 2)
            parts = [parts[0], [Token("name", "t", head.column)], parts[1]]
        case "rate":  # Modelica's der(u) is diff(u, t)
            [operand] = parts
            kind, parts = "diff", [operand, [Token("name", "t", head.column)]]
        case "log":  # Log[b, x] is log(x, b)
            parts = parts[::-1]
    return [replace(head, text=kind), tk.bracket(_joined(parts, ","), head, space=False)]


def _is_equation_of_motion(line: Line) -> bool:
    """Whether this is an equation with a derivative, or a sum that is zero, and no initial value."""
    summed = len([part for part in tk.split_at("+-", line) if part]) > 1  # x'' + x
    equal = summed or any(token.is_operator("=") for token in line)
    starts = at(line, 0).text == "subs"  # subs(diff(x), t, 0) == 1
    moves = any(token.order or token.text in labels.DERIVATIVES for token in tk.walk(line))
    return equal and moves and not starts and not labels.is_at_a_number(line)


@dataclass(frozen=True, slots=True)
class _Quotient:
    """d^k u/dx…: the tokens of u (none for an operator), one variable per order, and the place
    after the quotient.
    """

    operand: Tokens
    variables: tuple[Token, ...]
    after: int
    partial: bool
    fraction: bool


def with_derivatives(line: Line, names: Names, beyond: Token | None = None) -> Tokens:
    """The tokens with each derivative as primes on its name or as diff( ); ambiguous ones are
    refused later.

    `beyond` is the token after the bracket that holds the line.
    """
    line = _with_differentials_apart(line, names)
    found: Tokens = []
    place = 0
    while place < len(line):
        token = line[place]
        after_slash = at(line, place - 1).is_operator("/") and not token.is_fraction()
        begins = token.inside or token.text[:1] in ("d", tk.PARTIAL, tk.TOTAL, tk.NABLA)
        if begins and not after_slash and (read := _derivative(line, place, names, beyond)):
            found, place = found + read[0], read[1]
            continue
        place += 1
        if token.inside:
            token = replace(
                token, inside=tuple(with_derivatives(token.inside, names, at(line, place)))
            )
        found.append(token)
    return found


def _with_differentials_apart(line: Line, names: Names) -> Tokens:
    """m d^2 x/dt^2 for md^2x/dt^2, r dtheta/dt for rdtheta/dt, and c d2x/dt2 for cd2x/dt2."""
    found: Tokens = []
    for place, token in enumerate(line):
        known = token.kind != "name" or token.order or names.role(token.text)
        factor, rest = ("", "") if known else _before_differential(line, place)
        if not factor:
            found.append(token)
            continue
        column = token.column + len(factor)
        factors = [factor] if factor in GREEK_NAMES else _FACTORS.findall(factor)
        found += [replace(token, text=one, space_before=True) for one in factors]
        found.append(Token("name", rest, column, True))
    return found


def _before_differential(line: Line, place: int) -> tuple[str, str]:
    """The c of cd^2x/dt^2, cdx/dt, and of cdtheta/dt in one word or two, and what of the derivative is
    in the same word; empty for others.
    """
    word, operand = line[place].text, at(line, place + 1)
    order, after = _power(line, place + 1)
    single = _GLUED.fullmatch(word)
    if word[-1:] == "d" and order > 1:  # md^2 x
        factor, rest, over = word[:-1], "d", after + 1
        whole = at(line, after).kind == "name"
    elif word[-1:] == "d":  # rd theta
        factor, rest, over = word[:-1], "d", place + 2
        whole = operand.kind == "name" and not (operand.space_before or operand.order)
    else:
        factor, rest, over = *(single.groups() if single else ("", "")), place + 1
        whole = single is not None
    below = at(line, over + 1)
    in_time = below.text in ("d", "dt", "dt2") and at(line, over).is_operator("/")
    plain = factor in GREEK_NAMES or "".join(_FACTORS.findall(factor)) == factor
    return (factor, rest) if whole and in_time and plain and factor[-1:] != "d" else ("", "")


def _derivative(
    line: Line, place: int, names: Names, beyond: Token | None = None, depth: int = 0
) -> tuple[Tokens, int] | None:
    """The derivative that begins here, in this package's grammar, and the place after it; None if
    there is none.
    """
    token = line[place]
    if token.is_operator(tk.NABLA):
        return _gradient(line, place, names)
    if token.is_bracket():
        if power := _power_of_operator(line, place, names, depth):
            return power
        if token.order and (at(line, place - 1).kind != "name" or token.space_before):
            inner = with_derivatives([replace(token, order=0)], names)
            return _carried_out(
                inner, [Token("name", "t", token.end)] * token.order, token
            ), place + 1
    quotient = _quotient(line, place, names)
    if quotient is None:
        _refuse_fraction(token, names)
        return None
    if at(line, quotient.after).is_operator("^") and not quotient.fraction:
        if not quotient.operand or names.role(token.text) or at(quotient.operand, 0).order:
            return None
        written, span = (
            tk.source(line[place : quotient.after]),
            (token.column, line[quotient.after - 1].span[1]),
        )
        raise fault("power of a quotient", token.column, span, written=written)
    if not quotient.operand:
        moving = any(variable.order for variable in quotient.variables)
        return None if moving else _applied(line, quotient, place, names, depth)
    return _of_operand(line, quotient, place, names, beyond)


def _gradient(line: Line, place: int, names: Names) -> tuple[Tokens, int]:
    """The gradient of V as diff(V, x) if there is one coordinate; V itself if no coordinate is
    known yet.
    """
    sign, name = line[place], at(line, place + 1)
    if name.kind != "name" or len(names.coordinates) > 1:
        raise fault("gradient", sign.column)
    after = place + 2 + _are_arguments(at(line, place + 2), name, names)
    moving = [Token("name", coordinate, sign.column) for coordinate in names.coordinates]
    operand = [*line[place + 1 : after]]
    return (_carried_out(operand, moving, sign) if moving else operand), after


def _of_operand(
    line: Line, quotient: _Quotient, place: int, names: Names, beyond: Token | None
) -> tuple[Tokens, int] | None:
    """dx/dt as x', dV/dx as diff(V, x)."""
    variables, first, after = quotient.variables, line[place], quotient.after
    name, *called = quotient.operand
    if variables[0].order:  # ∂F/∂x' of a function of Rayleigh
        plain = not called and name.kind == "name" and name.text.isupper() and name.text != "L"
        return (_carried_out([name], variables, first), after) if plain else None
    by = [names.spelling(variable.text) for variable in variables]
    if name.kind == "bracket":
        return _carried_out(with_derivatives(name.inside, names), variables, first), after
    role = names.role_meant(name.text)
    if tk.spelled(called) == "(t)" and role != "function":
        called = []
    in_time, declared = {*by} == {"t"}, role in ("function", "parameter")
    if quotient.partial and "t" in by and quotient.fraction:
        return None
    if called and not name.order:
        arguments = {token.text for token in tk.walk(called[0].inside)}
        if quotient.fraction and not {variable.text for variable in variables} <= arguments - {"t"}:
            _refuse_fraction(first, names)
            return None
        return _carried_out([name, *called], variables, first), after
    if names.forms and len(by) == 1 and not (name.order or called or declared or in_time):
        known = {names.role_meant(name.text), names.role(by[0])} == {"coordinate"}
        return (_slope(name, variables[0], first), after) if known else None
    if in_time and not declared:
        primed = replace(
            first, kind="name", text=name.text, inside=(), value=Fraction(0), primed=first.column
        )
        return [replace(primed, order=len(by) + name.order)], after
    if name.order:
        return None
    guessed = role is None and names.guesses and "t" not in by
    outside = beyond if after == len(line) else None  # (dV/dx)(x)
    follows = outside or at(line, after)
    at_point = _is_point(follows, variables)
    unclear = (
        declared and quotient.fraction and (outside or not at_point) and not follows.is_fraction()
    )
    if follows.is_bracket() and (unclear or (guessed and outside and at_point)):
        raise fault(
            "bracket after a derivative", follows.column, name=name.text, by=variables[0].text
        )
    if declared or guessed:
        point = [follows] if at_point and not outside else []
        operand = [name, *(point if role != "parameter" else [])]
        return _carried_out(operand, variables, first, not quotient.partial), after + len(point)
    if (role is None and {*by} <= {*names.coordinates}) or (quotient.fraction and not in_time):
        if not quotient.partial and names.role("d") is not None:
            return None
        slope = f"diff({name.text}({', '.join(names.coordinates) or by[0]}), {', '.join(by)})"
        typed = None if quotient.fraction else (first.column, line[after - 1].span[1])
        raise fault(
            "slope of a name",
            first.column,
            typed,
            name=name.text,
            by=by[0],
            slope=slope,
            typed=typed,
        )
    return None


def _is_point(follows: Token, variables: Line) -> bool:
    """Whether the bracket after a derivative by these variables is the point (x, y) at which it is
    evaluated.
    """
    listed = tk.spelled(follows.inside).split(",")
    named = follows.is_bracket() and all(map(str.isidentifier, listed))
    return named and {variable.text for variable in variables} <= {*listed}


def _slope(name: Token, by: Token, at: Token) -> Tokens:
    """(y'/x') for the dy/dx of a constraint."""
    primed = [
        replace(word, column=at.column, space_before=False, order=1, primed=at.column)
        for word in (name, by)
    ]
    return [tk.bracket([primed[0], _sign("/", at), primed[1]], at, tk.FACTOR)]


def _applied(
    line: Line, quotient: _Quotient, place: int, names: Names, depth: int
) -> tuple[Tokens, int] | None:
    """d/dt ( u ) as diff(u, t); also d/dt x' if no following factor could belong to the operand."""
    ends = quotient.after >= len(line) and (not quotient.fraction or names.role("d"))
    operand = None if ends else _differentiated(line, quotient, names, depth)
    if operand is None:
        return None
    inner, after = operand
    in_time = "t" in [variable.text for variable in quotient.variables]
    if quotient.partial and in_time and "(t)" not in tk.spelled(line[quotient.after : after]):
        raise fault("partial derivative by the time", line[place].column)
    return _carried_out(inner, quotient.variables, line[place]), after


def _differentiated(
    line: Line, quotient: _Quotient, names: Names, depth: int
) -> tuple[Tokens, int] | None:
    """The operand of an operator: a bracket, a derivative, or a name without a following factor."""
    place = quotient.after
    if place == len(line):
        raise fault("derivative of nothing", line[place - 1].column)
    first, variable = line[place], quotient.variables[0].text
    at_most(depth + 1, LIMITS.depth, "the formula is nested too deeply", first.column)
    if nested := _derivative(line, place, names, None, depth + 1):
        return nested
    whole = first.is_bracket() and not first.is_fraction()
    if not whole and first.kind != "name" and not quotient.fraction and first.kind != "number":
        return None
    called = (
        not whole and first.kind == "name" and _are_arguments(at(line, place + 1), first, names)
    )
    after = place + 1 + called
    following = at(line, after)
    ends = following.kind == "end" or following.is_operator(*_CLEAR)
    multiplied = following.is_operator("*", "/") or (
        following.is_fraction() and _quotient(line, after, names)
    )
    clear = (whole and not first.order) or (
        first.kind == "name" and (ends or (called and multiplied))
    )
    if following.is_operator("^") or not clear:
        raise fault("end of a derivative", following.column or first.column, by=variable)
    return with_derivatives(first.inside if whole else line[place:after], names), after


def _are_arguments(after: Token, name: Token, names: Names) -> bool:
    """Whether the bracket has the arguments of a function, or the (t) of a name."""
    if not after.is_bracket() or after.is_fraction() or after.order:
        return False
    role = names.role_meant(name.text)
    plain = all(
        token.kind in ("name", "bracket") or token.is_operator(",")
        for token in tk.walk(after.inside)
    )
    called = role == "function" or (role is None and plain and not after.space_before)
    return called or tk.spelled(after.inside) == "t"


def _quotient(line: Line, place: int, names: Names) -> _Quotient | None:
    """The quotient of differentials that begins here."""
    fraction, after = line[place].is_fraction(), place + 1
    if fraction:
        upper, slash, lower = line[place].inside
        line, place = [*upper.inside, slash, *lower.inside], 0
    above = _above(line, place, names, fraction)
    if above is None or not at(line, above[3]).is_operator("/"):
        return None
    order, partial, operand, slash_place = above
    below = _below(line, slash_place + 1, order, fraction)
    if below is None or (fraction and (slash_place != len(upper.inside) or below[1] != len(line))):
        return None
    return _Quotient(operand, below[0], after if fraction else below[1], partial, fraction)


class Above(NamedTuple):
    """The upper half of d^k u/dt^k."""

    order: int
    is_partial: bool
    operand: Tokens
    after: int


def _above(line: Line, place: int, names: Names, fraction: bool) -> Above | None:
    """The order of d^k u, whether it is partial, the tokens of u, and the place after it."""
    first = at(line, place)
    known = names.role(first.text) is not None and not (fraction and first.text == "d")
    known |= first.text in DERIVATIVE_NAMES  # diff(g, t, t)/diff(g, t)
    match = _ABOVE.fullmatch(first.text) if first.kind == "name" and not known else None
    if match is None and not first.is_operator(tk.PARTIAL, tk.TOTAL):
        return None
    digit, word = match.groups("") if match else ("", "")
    order, after = (int(digit or 1), place + 1) if digit or word else _power(line, place + 1)
    operand = [replace(first, text=word)] if word else [*line[after : after + 1]]
    if (first.order and not word) or (at(operand, 0).is_bracket() and operand[0].order):
        return None
    if at(operand, 0).kind != "name" and not at(operand, 0).is_bracket():
        return Above(order, first.text == tk.PARTIAL, [], after)
    after += not word
    follows = at(line, after)
    if (
        operand[0].kind == "name"
        and follows.is_bracket()
        and not (follows.is_fraction() or follows.order)
    ):
        operand, after = [*operand, follows], after + 1
    return Above(order, first.text == tk.PARTIAL, operand, after)


def _power(line: Line, place: int) -> tuple[int, int]:
    """The k of ^k or ^(k) here, 1 if there is no exponent, and the place after it."""
    raised = at(line, place + 1)
    while len(raised.inside) == 1:
        raised = raised.inside[0]
    found = at(line, place).is_operator("^") and raised.text in _DIGITS
    return (int(raised.text), place + 2) if found else (1, place)


def _below(
    line: Line, place: int, order: int, fraction: bool
) -> tuple[tuple[Token, ...], int] | None:
    """The variables of dt^2, dt2, d t, dx dy, whose orders add up to `order`, and the place after
    them.
    """
    found: Tokens = []
    while len(found) < order and place < len(line):
        first, digit = line[place], ""
        if first.is_operator(tk.PARTIAL, tk.TOTAL) or first.text == "d":
            place += 1
            name = at(line, place)
        elif first.kind == "name" and (match := _BELOW.fullmatch(first.text)):
            name, digit = replace(first, text=match[1]), match[2]
        else:
            return None
        if name.kind != "name" or (name.order and (name.order, order) != (1, 1)):
            return None
        place += 1
        place += fraction and tk.spelled(line[place : place + 1]) == "(t)"
        times, after = _power(line, place)
        if digit and int(digit) != order and order > 1:
            return None
        if digit and order == 1:
            name = replace(name, text=name.text + digit)
        elif digit:
            times, after = int(digit), place
        if not fraction and order == 1:
            times, after = 1, place
        found += [name] * times
        place = after
    return (tuple(found), place) if len(found) == order else None


def _power_of_operator(
    line: Line, place: int, names: Names, depth: int
) -> tuple[Tokens, int] | None:
    """(d/dt)^2 u and (d^2/dt^2) u as diff(u, t, t)."""
    inside = line[place].inside
    operator = _quotient(inside, 0, names) if inside else None
    power, after = _power(line, place + 1)
    if (
        operator is None
        or operator.operand
        or operator.after != len(inside)
        or names.role("d")
        or (after == place + 1 and line[place].is_fraction())
    ):
        return None
    raised = _Quotient([], operator.variables * power, after, operator.partial, operator.fraction)
    return _applied(line, raised, place, names, depth)


def _refuse_fraction(token: Token, names: Names) -> None:
    r"""InputError for a fraction such as \frac{d V k}{dx}, in which d would be read as a common
    factor.
    """
    if not token.is_fraction() or names.role("d"):
        return
    above, below = token.inside[0].inside, token.inside[2].inside
    differential = len(above) > 1 and (above[0].text == "d" or above[0].is_operator(tk.TOTAL))
    variable = next(
        (k for order in range(1, 4) if (k := _below(below, 0, order, True)) and k[1] == len(below)),
        None,
    )
    if differential and variable:
        by, column = variable[0][0].text, token.column
        if any(token.is_operator("^") for token in above[2:]) and by == "t":
            raise fault("power in a derivative", above[1].column)
        raise fault("derivative of a product", column, by=by)


def _carried_out(inner: Line, variables: Line, at: Token, total: bool = False) -> Tokens:
    """diff(u, x, …) with all tokens at column `at`; `total` marks dV/dr of a V that depends on r
    alone.
    """
    if not inner:
        raise tk.unexpected(at, "what is differentiated")
    by = [
        [Token("name", variable.text, at.column, order=variable.order, primed=variable.primed)]
        for variable in variables
    ]
    call = Token("name", "diff", at.column, True, Fraction(total))
    return [call, tk.bracket(_joined([[*inner], *by], ",", at), at, space=False)]
