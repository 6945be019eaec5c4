r"""Convert other notations for formulas to our own grammar, tokens in, tokens out. Nothing is evaluated.

SymPy's text (`x(t).diff(t, 2)`, `Eq(a, b)`, the calls of `srepr`), Mathematica (`x''[t] == -Sin[x[t]]`,
`D[u, {t, 2}]`, `Derivative[2][x][t]`, Plus, Times, Power), Maple (`diff(x(t), t$2)`, `(D@@2)(x)(t)`), Maxima
(`'diff(x, t, 2)`), Modelica (`der(x)`); and derivatives written with d, in plain text and LaTeX: dx/dt, d^2x/dt^2,
\frac{d}{dt}(m x'), (d/dt)^2 x, dV(x)/dx, (r^2 x')'. A fraction of LaTeX comes as ((above)/(below)), its first bracket
marked FRACTION, so that one reader knows them all.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

from inverse_service import errors
from inverse_service.expressions.refusals import LIMITS, at_most, refusal
from inverse_service.reading.names import DERIVATIVE_NAMES, FUNCTIONS, Names
from inverse_service.reading.tokens import (
    FACTOR,
    FRACTION,
    PARTIAL,
    TOTAL,
    Token,
    Tokens,
    after_primes,
    at,
    closing,
    never_closed,
    opening,
    split_at_commas,
    unexpected,
)

_MODULES = frozenset(("sp", "sympy", "sym", "np", "numpy", "math", "Math", "jnp"))
_CAPITALS = {
    "Ln": "log", "ArcSin": "asin", "ArcCos": "acos", "ArcTan": "atan", "ArcSinh": "asinh", "ArcCosh": "acosh",
    "ArcTanh": "atanh", "Abs": "abs", "Sign": "sign", "HeavisideTheta": "Heaviside", "UnitStep": "Heaviside",
}  # fmt: skip
_PIECES = "Piecewise[{"  # a head that differs from every name
_WORD = re.compile(r"[A-Z]")


def in_our_words(tokens: Tokens, names: Names) -> Tokens:
    """The same formulas in our notation; tokens in our notation are returned unchanged."""
    marks = {token.text for token in tokens}
    mathematica = _is_mathematica(tokens)
    if marks & {"[", "{"}:
        tokens = _with_round_brackets(_with_indices(tokens, names), names, mathematica)
    written = tokens
    if marks & {*_HEADS, ".", "@", "Piecewise"} or _is_primed_call(tokens):
        tokens = _rewritten(tokens, names)
    if "I" in marks and names.role("I") is None and (mathematica or tokens != written or marks & DERIVATIVE_NAMES):
        column = next(token.column for token in tokens if token.text == "I")
        raise refusal(
            "I is the imaginary unit in this notation; it occurs", column, "write real equations", declare="parameters"
        )
    return with_derivatives(_without_list(tokens), names)


def _with_indices(tokens: Tokens, names: Names) -> Tokens:
    """x[1]'' as x_1'' if x never occurs without an index: in a text with x[t], x[0] is a value."""
    indexed = {place for place in range(len(tokens) - 3) if _is_indexed(tokens, place)}
    alone = {token.text for place, token in enumerate(tokens) if token.kind == "name" and place not in indexed}
    known = FUNCTIONS | {word for word in _HEADS if word.isalpha()} | set(names.functions) | alone
    found: Tokens = []
    place = 0
    while place < len(tokens):
        token = tokens[place]
        if place in indexed and not token.text[:1].isupper() and token.text not in known:
            token, place = replace(token, text=f"{token.text}_{tokens[place + 2].text}"), place + 3
        found.append(token)
        place += 1
    return found


def _is_indexed(tokens: Tokens, place: int) -> bool:
    """Whether x[1] begins here, which is not a call x[1](...) of a function."""
    name, opening, index, end = tokens[place : place + 4]
    whole = name.kind == "name" and opening.is_operator("[") and index.text.isdigit() and end.is_operator("]")
    after = [token.text for token in tokens[place + 4 : place + 7]]
    return whole and (after[:1] != ["("] or after == ["(", "t", ")"])


def _is_mathematica(tokens: Tokens) -> bool:
    """Whether x[t] or Sin[u] occurs."""
    pairs = [(a.text, b.text) for a, b in itertools.pairwise(tokens) if "[" in (a.text, b.text)]
    return any(a != _small(a) or (a == "[" and b == "t") for a, b in pairs)


def _with_round_brackets(tokens: Tokens, names: Names, mathematica: bool) -> Tokens:
    """Mathematica's f[x] and {x, 2}; the orders in our own B[1,0](x, y) are kept.

    Without another sign of Mathematica, k[x] is as ambiguous as k (x).
    """
    found: Tokens = []
    ends: list[str] = []
    opened: list[Token] = []
    for place, token in enumerate(tokens):
        if token.is_operator("[", "{"):
            opened.append(token)
            orders = (
                token.text == "[" and place > 0 and tokens[place - 1].kind == "name" and _holds_orders(tokens, place)
            )
            ends.append("]" if orders else ")")
            called = token.text == "[" and place > 0 and tokens[place - 1].kind == "name" and not orders
            if called:
                listed = [each.text for each in tokens[place - 1 : place + 2]] == ["Piecewise", "[", "{"]
                found[-1] = replace(found[-1], text=_PIECES if listed else _small(found[-1].text))
            unclear = called and not mathematica and names.role(found[-1].text) is None
            space = unclear or (token.space_before and not called)
            found.append(token if orders else replace(token, text="(", space_before=space))
        elif token.is_operator("]", "}") and ends:
            opened.pop()
            found.append(replace(token, text=ends.pop()))
        else:
            found.append(token)
    if opened:
        raise never_closed(opened[-1])
    return found


def _holds_orders(tokens: Tokens, place: int) -> bool:
    """Whether [1,0]( begins here, and not Derivative[1][x] or f[2]."""
    end = place + 1
    while at(tokens, end).kind == "number" or at(tokens, end).is_operator(","):
        end += 1
    return tokens[place - 1].text != "Derivative" and _opens(tokens, end + 1) and tokens[end].text == "]"


def _small(name: str) -> str:
    """Mathematica's Sin as sin."""
    if name == "Log":
        return name  # Log[b, x] is log(x, b)
    known = _CAPITALS.get(name) or name.lower()
    return known if name in _CAPITALS or (known in FUNCTIONS and name != known and name.istitle()) else name


def _is_primed_call(tokens: Tokens) -> bool:
    return any(a.kind == "prime" and b.text == "diff" for a, b in itertools.pairwise(tokens))


def _rewritten(tokens: Sequence[Token], names: Names) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(tokens):
        token = tokens[place]
        if token.is_operator("."):
            place = _after_dot(tokens, place, found, names)
        elif token.kind == "prime" and at(tokens, place + 1).text == "diff":
            place += 1  # Maxima's quote
        elif token.is_operator("(") and _is_maple_power(tokens, place):
            place = _derivative_of(tokens, place + 6, int(tokens[place + 4].value), found)
        elif (
            token.text in _HEADS and token.kind == "name" and not names.role(token.text) and _opens(tokens, place + 1)
        ) and not (token.text == "D" and _is_factor(tokens, place + 1)):
            place = _called(tokens, place, found, names)
        else:
            found.append(token)
            place += 1
    return found


def _opens(tokens: Sequence[Token], place: int) -> bool:
    return at(tokens, place).is_operator("(")


def _arguments(tokens: Sequence[Token], opening: int) -> tuple[list[Sequence[Token]], int]:
    """The arguments in the bracket at `opening`, and the place after it."""
    end = closing(tokens, opening)
    if end == len(tokens):
        raise never_closed(tokens[opening])
    return [part for part in split_at_commas(tokens[opening + 1 : end]) if part], end + 1


def _after_dot(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """sp.sin is sin; u.diff(t, 2) is diff(u, t, 2)."""
    method = at(tokens, place + 1)
    if found and found[-1].text in _MODULES:
        found.pop()
        return place + 1
    if method.text != "diff" or not _opens(tokens, place + 2):
        raise refusal("a dot occurs", tokens[place].column, "a dot belongs to a number such as 0.5, or to u.diff(t)")
    arguments, after = _arguments(tokens, place + 2)
    start = _operand(found)
    operand = found[start:]
    found[start:] = [replace(method, space_before=True), _sign("(", method), *operand]
    for argument in arguments:
        found += [_sign(",", method), *_rewritten(argument, names)]
    found.append(_sign(")", method))
    return after


def _operand(found: Tokens) -> int:
    """The beginning of the last name, call or bracket."""
    place = len(found) - 1
    if place >= 0 and found[place].is_operator(")"):
        place = opening(found, place)
        place -= place > 0 and found[place - 1].kind in ("name", "prime")
    while place > 0 and found[place].kind == "prime":
        place -= 1
    return max(place, 0)


def _sign(text: str, at: Token) -> Token:
    return Token("operator", text, at.column)


def _is_maple_power(tokens: Sequence[Token], place: int) -> bool:
    """Whether (D@@2) begins here."""
    words = [token.text for token in tokens[place : place + 6]]
    return words[:4] == ["(", "D", "@", "@"] and len(words) == 6 and words[4].isdigit() and words[5] == ")"


def _derivative_of(tokens: Sequence[Token], place: int, order: int, found: Tokens) -> int:
    """(x) after D or Derivative[2], as x with primes; the (t) after it follows by itself."""
    start, inner = place, 0
    while [token.text for token in tokens[place + 1 : place + 3]] == ["D", "("]:  # D(D(x))
        place, inner = place + 2, inner + 1
    name, *ends = (*tokens[place + 1 : place + 3 + inner], tokens[start - 1])[: 2 + inner]
    closed = len(ends) == 1 + inner and all(token.is_operator(")") for token in ends)
    if not _opens(tokens, start) or name.kind != "name" or not closed:
        raise refusal("a derivative of a name occurs", tokens[start - 1].column, "write x'' or diff(x, t, 2)")
    found += [name, Token("prime", "'" * (order + inner), name.column, False, Fraction(order + inner))]
    return place + 3 + inner


def _is_factor(tokens: Sequence[Token], opening: int) -> bool:
    """Whether the bracket after a D is a factor, as in D (1 - exp(-x))^2, rather than the operand of a derivative."""
    inside = tokens[opening + 1 : closing(tokens, opening)]
    return inside[:1] != [] and len(split_at_commas(inside)) == 1 and len(inside) > 1 and inside[0].text != "D"


def _called(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """The call of a head that begins here in our words; the place after it.

    D(x)(t) is x'(t), Derivative[2][x][t] is x''(t), and ModelingToolkit's Differential(t)(u) is diff(u, t).
    """
    head = tokens[place]
    arguments, after = _arguments(tokens, place + 1)
    alone = len(arguments) == 1 and len(arguments[0]) == 1
    if head.text == "D" and len(arguments) < 2:
        return _derivative_of(tokens, place + 1, 1, found)
    if head.text == "Derivative" and alone and arguments[0][0].kind == "number":
        return _derivative_of(tokens, after, int(arguments[0][0].value), found)
    if head.text == "Differential":
        if len(arguments) != 1 or not _opens(tokens, after):
            raise refusal("Differential has no operand", head.column, "write Differential(t)(x), or x'")
        operand, after = _arguments(tokens, after)
        arguments = [*operand[:1], *arguments]
    found += _HEADS[head.text](head, [_rewritten(argument, names) for argument in arguments])
    return after


def _joined(parts: Sequence[Tokens], sign: str) -> Tokens:
    """The parts with the sign between them."""
    return [token for k, part in enumerate(parts) for token in ([_sign(sign, part[0])] * bool(k) + part)]


def _call(head: Token, parts: Sequence[Tokens], name: str) -> Tokens:
    return [replace(head, text=name), _sign("(", head), *_joined(parts, ","), _sign(")", head)]


def _quoted(head: Token, parts: Sequence[Tokens]) -> Tokens:
    """Symbol('x', positive=True) and Function('x') are x."""
    word = [token for token in parts[0] if token.kind == "name"] if parts else []
    if len(word) != 1 or len(parts[0]) != 3:
        raise refusal("a name in quotation marks is missing", head.column, "write Symbol('x')")
    return [replace(word[0], space_before=head.space_before)]


def _operation(head: Token, parts: Sequence[Tokens], sign: str) -> Tokens:
    """Add(a, b) as (a + b), Rational(1, 2) as (1/2), Integer(2) as 2, List(a, b) as (a, b)."""
    if head.text == "Integer" and [len(part) for part in parts] == [1]:
        return parts[0]
    if sign in "+*^":
        parts = [p if len(p) == 1 else [_sign("(", p[0]), *p, _sign(")", p[0])] for p in parts]
    return [Token("operator", "(", head.column, True, FACTOR), *_joined(parts, sign), _sign(")", head)]


def _equality(head: Token, parts: Sequence[Tokens]) -> Tokens:
    if len(parts) != 2:
        raise unexpected(head, "an equation with two sides, Eq(a, b),")
    return _joined(parts, "=")


def _pieces(head: Token, parts: Sequence[Tokens]) -> Tokens:
    """Mathematica's Piecewise[{{a, x > 0}, …}, b] is piecewise((a, x > 0), …, (b, true)); b is 0 if left out."""
    listed, *rest = parts
    last = rest[0] if rest else [Token("number", "0", head.column)]
    before, after = ([_sign(text, head) for text in texts] for texts in (",(", (",", "true", ")", ")")))
    return [replace(head, text="piecewise"), *listed[:-1], *before, *last, *after]


def _float(head: Token, parts: Sequence[Tokens]) -> Tokens:
    raise refusal("a Float occurs", head.column, "write the exact number, such as Rational(1, 3)")


def _der(head: Token, parts: Sequence[Tokens]) -> Tokens:
    """Modelica's der(u) is diff(u, t)."""
    if len(parts) != 1:
        raise refusal("der has one argument", head.column, "write der(x)")
    return _call(head, [*parts, [Token("name", "t", head.column)]], "diff")


def _column(head: Token, parts: Sequence[Tokens]) -> Tokens:
    """SymPy's Matrix([[u], [v]]) is u, v: its entries without the brackets of the rows' list."""
    if len(parts) != 1 or not _opens(parts[0], 0) or closing(parts[0], 0) != len(parts[0]) - 1:
        raise refusal("a matrix occurs", head.column, "write its entries, separated by ;")
    return parts[0][1:-1]


_HEADS: dict[str, Callable[[Token, list[Tokens]], Tokens]] = {
    **dict.fromkeys(("Symbol", "Dummy", "Function"), _quoted),
    **{
        head: partial(_operation, sign=sign)
        for sign, heads in (
            ("+", "Add Plus"),
            ("*", "Mul Times"),
            ("^", "Pow Power pow"),
            ("/", "Integer Rational"),
            (",", "Tuple List Hold"),
        )
        for head in heads.split()
    },
    **dict.fromkeys(("Eq", "Equal", "Equality"), _equality),
    **dict.fromkeys(("Float", "RealNumber"), _float),
    **dict.fromkeys(("Diff", "Dt", "D", "Differential"), partial(_call, name="diff")),  # Maple's and Mathematica's
    **dict.fromkeys(("Matrix", "ImmutableMatrix", "ImmutableDenseMatrix", "MutableDenseMatrix"), _column),
    "der": _der,
    "Log": lambda head, parts: _call(head, parts[::-1], "log"),
    _PIECES: _pieces,
    "Derivative": partial(_call, name="Derivative"),
}


def _without_list(tokens: Tokens) -> Tokens:
    """[eq1, eq2] and {eq1, eq2} without the outer brackets; a Matrix of equations is not one of them."""
    if len(tokens) < 3 or not tokens[0].is_operator("[", "(") or not any(token.is_operator("=") for token in tokens):
        return tokens
    return tokens[1:-1] if closing(tokens, 0) == len(tokens) - 1 else tokens


# Derivatives written with d.
_ABOVE = re.compile(r"d([2-9]?)([A-Za-z]\w*)?")
_BELOW = re.compile(r"d([A-Za-z]\w*?)([2-9]?)")
_DIGITS = tuple("123456789")
_CLEAR = ("=", "+", "-", ",", ";", ")", "&", "<", ">")


@dataclass(frozen=True, slots=True)
class _Quotient:
    """d^k u/dx…: the tokens of u (none for an operator), the variables, one for each order, and the place after it."""

    operand: Tokens
    variables: tuple[Token, ...]
    after: int
    partial: bool
    fraction: bool

    @property
    def order(self) -> int:
        return len(self.variables)


def with_derivatives(tokens: Tokens, names: Names, depth: int = 0) -> Tokens:
    """The tokens with each derivative as primes on its name or as diff( ); ambiguous ones are refused later."""
    marks = {token.text[:1] for token in tokens}
    primed = any(a.is_operator(")") and b.kind == "prime" for a, b in itertools.pairwise(tokens))
    if not primed and not marks & {"d", PARTIAL, TOTAL}:
        return tokens
    if depth > LIMITS.depth:
        at_most(depth, LIMITS.depth, "the formula is nested too deeply", tokens[0].column)
    found: Tokens = []
    place = 0
    while place < len(tokens):
        after_slash = bool(found) and found[-1].is_operator("/") and not _is_fraction(tokens, place)
        read = None if after_slash else _derivative(tokens, place, names, depth)
        written, place = read if read else ([tokens[place]], place + 1)
        found += written
    return found


def _derivative(tokens: Tokens, place: int, names: Names, depth: int) -> tuple[Tokens, int] | None:
    """The derivative that begins here in our grammar, and the place after it; None if there is none."""
    if tokens[place].is_operator("("):
        if power := _power_of_operator(tokens, place, names, depth):
            return power
        end = closing(tokens, place)
        after = after_primes(tokens, end + 1)
        called = place > 0 and tokens[place - 1].kind in ("name", "prime") and not tokens[place].space_before
        if after > end + 1 and not called:
            order = sum(int(prime.value) for prime in tokens[end + 1 : after])
            inner = with_derivatives(tokens[place + 1 : end], names, depth + 1)
            return _carried_out(inner, [Token("name", "t", tokens[end].column)] * order, tokens[place]), after
    quotient = _quotient(tokens, place, names)
    if quotient is None:
        _refuse_fraction(tokens, place, names)
        return None
    following = at(tokens, quotient.after)
    if following.is_operator("^") and not quotient.fraction:
        return None  # dx/dt^2: of the quotient, or of t?
    if not quotient.operand:
        return _applied(tokens, quotient, place, names, depth)
    return _of_operand(tokens, quotient, place, names, depth)


def _of_operand(tokens: Tokens, quotient: _Quotient, place: int, names: Names, depth: int) -> tuple[Tokens, int] | None:
    """dx/dt as x', dV/dx as diff(V, x)."""
    operand, variables, first = quotient.operand, quotient.variables, tokens[place]
    by = [names.spelling(variable.text) for variable in variables]
    if operand[0].is_operator("("):
        return _carried_out(with_derivatives(operand[1:-1], names, depth + 1), variables, first), quotient.after
    primes = [token for token in operand if token.kind == "prime"]
    called, name = operand[-1].is_operator(")"), operand[0]
    role = names.role(names.spelling(name.text))
    if called and [token.text for token in operand[1 + len(primes) :]] == ["(", "t", ")"] and role != "function":
        called, operand = False, operand[: 1 + len(primes)]
    in_time, declared = {*by} == {"t"}, role in ("function", "parameter")
    if quotient.partial and "t" in by and quotient.fraction:
        return None
    if called and not primes:
        arguments = {token.text for token in operand[2:-1] if not token.is_operator(",")}
        if quotient.fraction and not {variable.text for variable in variables} <= arguments - {"t"}:
            _refuse_fraction(tokens, place, names)
            return None
        return _carried_out(operand, variables, first), quotient.after
    if names.forms and len(by) == 1 and not (primes or called or declared or in_time):
        known = {names.role(names.spelling(name.text)), names.role(by[0])} == {"coordinate"}
        return (_slope(name, variables[0], first), quotient.after) if known else None
    if in_time and not declared:
        order = len(by) + sum(int(prime.value) for prime in primes)
        prime = Token("prime", "'" * order, first.column, False, Fraction(order))
        return [Token("name", name.text, first.column, first.space_before), prime], quotient.after
    if primes:
        return None
    guessed = role is None and names.guesses and "t" not in by
    after = _after_arguments(tokens, quotient.after, {variable.text for variable in variables})
    closed = quotient.after + at(tokens, quotient.after).is_operator(")")  # (dV/dx)(x)
    follows = at(tokens, closed)
    inside = closed > quotient.after and _after_arguments(tokens, closed, {*by}) > closed
    if (
        (declared and quotient.fraction and after == quotient.after and follows.value != FRACTION)
        or (guessed and inside)
    ) and follows.is_operator("("):
        instead = f"write {name.text}'({variables[0].text}), or * before a factor"
        raise refusal("a bracket follows a derivative", follows.column, instead)
    if declared or guessed:
        return _carried_out(operand, variables, first, not quotient.partial), after
    if (role is None and {*by} <= {*names.coordinates}) or (quotient.fraction and not in_time):
        if not quotient.partial and names.role("d") is not None:
            return None
        raise _of_what(name, by, names.coordinates, (first, tokens[quotient.after - 1]), quotient.fraction)
    return None


def _after_arguments(tokens: Tokens, place: int, variables: set[str]) -> int:
    """The place after the (x, y) that says where a derivative by these is taken; `place` where there is none."""
    if not at(tokens, place).is_operator("(") or at(tokens, place).space_before:
        return place
    inside = list(itertools.takewhile(lambda token: not token.is_operator(")"), tokens[place + 1 :]))
    names = [token.text for token in inside[::2]]
    listed = all(token.kind == "name" for token in inside[::2]) and all(one.is_operator(",") for one in inside[1::2])
    return place + len(inside) + 2 if listed and variables <= {*names} else place


def _slope(name: Token, by: Token, at: Token) -> Tokens:
    """(y'/x') for the dy/dx of a constraint."""
    prime = Token("prime", "'", at.column, False, Fraction(1))
    above, below = (replace(word, column=at.column, space_before=False) for word in (name, by))
    return [Token("operator", "(", at.column, True, FACTOR), above, prime, _sign("/", at), below, prime, _sign(")", at)]


def _of_what(
    name: Token, by: Sequence[str], coordinates: Sequence[str], ends: tuple[Token, Token], fraction: bool
) -> errors.InputError:
    """The refusal of dV/dx, from its first to its last token, if the arguments of V are unknown."""
    slope = f"diff({name.text}({', '.join(coordinates)}), {', '.join(by)})"
    primed = f"{name.text}{len(by) * chr(39)}({by[0]}) or " if len(coordinates) == 1 and len(by) < 3 else ""
    span = None if fraction else (ends[0].column, ends[1].column + len(ends[1].text))
    what, column = f"a derivative of {name.text} by {by[0]} occurs", name.column
    if fraction:
        return refusal(what, ends[0].column, f"write {name.text}'({by[0]})", declare="functions")
    return refusal(what, column, f"write {primed}{slope}", (slope,), span)


def _applied(tokens: Tokens, quotient: _Quotient, place: int, names: Names, depth: int) -> tuple[Tokens, int] | None:
    """d/dt ( u ) as diff(u, t); also d/dt x' if no factor follows that may belong to the operand."""
    if quotient.after >= len(tokens):
        return None
    operand = _differentiated(tokens, quotient, names, depth)
    if operand is None:
        return None
    inner, after = operand
    in_time = "t" in [variable.text for variable in quotient.variables]
    texts = [token.text for token in tokens[quotient.after : after]]
    timed = any(texts[k : k + 3] == ["(", "t", ")"] for k in range(len(texts)))
    if quotient.partial and in_time and not timed:
        instead = "write d/dt( and ) for the derivative along the motion"
        raise refusal("a partial derivative by the time occurs", tokens[place].column, instead)
    return _carried_out(inner, quotient.variables, tokens[place]), after


def _differentiated(tokens: Tokens, quotient: _Quotient, names: Names, depth: int) -> tuple[Tokens, int] | None:
    """The operand of an operator: a bracket, a derivative, or a name without a following factor."""
    place = quotient.after
    first, variable = tokens[place], quotient.variables[0].text
    at_most(depth + 1, LIMITS.depth, "the formula is nested too deeply", first.column)
    if nested := _derivative(tokens, place, names, depth + 1):
        return nested
    bracket = first.is_operator("(") and first.value != FRACTION
    end = place
    if bracket:
        end = closing(tokens, place)
        if end == len(tokens):
            return None
    elif first.kind == "name":
        end = after_primes(tokens, end + 1) - 1
    elif not quotient.fraction and first.kind != "number":
        return None
    arguments = 0 if bracket or first.kind != "name" else _length_of_arguments(tokens, end + 1, first, names)
    end += arguments
    following = at(tokens, end + 1)
    ends = following.kind == "end" or following.is_operator(*_CLEAR)
    multiplied = following.is_operator("*", "/") or (
        _is_fraction(tokens, end + 1) and _quotient(tokens, end + 1, names)
    )
    raised = following.is_operator("^")
    if raised or not (bracket or (first.kind == "name" and (ends or (arguments and multiplied)))):
        what = f"it is not clear where the derivative ends, because d/d{variable} precedes a product"
        column = following.column or first.column
        raise refusal(what, column, f"write what it differentiates in brackets, d/d{variable}(...)")
    inner = with_derivatives(tokens[place + bracket : end + 1 - bracket], names, depth + 1)
    return inner, end + 1


def _length_of_arguments(tokens: Tokens, place: int, name: Token, names: Names) -> int:
    """The number of tokens in the arguments of a function, or in the (t) of a name."""
    if not _opens(tokens, place) or tokens[place].value == FRACTION:
        return 0
    end = closing(tokens, place)
    inside = tokens[place + 1 : end]
    timed = [token.text for token in inside] == ["t"]
    role = names.role(names.spelling(name.text))
    plain = all(token.kind == "name" or token.is_operator(",", "(", ")") for token in inside)
    called = role == "function" or (role is None and plain and not tokens[place].space_before)
    return end + 1 - place if timed or called else 0


def _is_fraction(tokens: Sequence[Token], place: int) -> bool:
    return at(tokens, place).is_operator("(") and tokens[place].value == FRACTION


def _quotient(tokens: Tokens, place: int, names: Names) -> _Quotient | None:
    """The quotient of differentials that begins here."""
    if _is_fraction(tokens, place):
        slash = closing(tokens, place + 1) + 1
        end = closing(tokens, place)
        above = _above(tokens[place + 2 : slash - 1], 0, names, True)
        if above is None or above[3] != slash - place - 3:
            return None
        order, partial, operand, _ = above
        below = _below(tokens[slash + 2 : end - 1], 0, order, True)
        if below is None or below[1] != end - 1 - (slash + 2):
            return None
        return _Quotient(operand, below[0], end + 1, partial, True)
    above = _above(tokens, place, names, False)
    if above is None:
        return None
    order, partial, operand, slash = above
    if not at(tokens, slash).is_operator("/"):
        return None
    below = _below(tokens, slash + 1, order, False)
    return None if below is None else _Quotient(operand, below[0], below[1], partial, False)


def _above(tokens: Sequence[Token], place: int, names: Names, fraction: bool) -> tuple[int, bool, Tokens, int] | None:
    """The order, whether it is partial, the tokens of u, and the place after d^k u."""
    if place >= len(tokens):
        return None
    first = tokens[place]
    sign = first.is_operator(PARTIAL, TOTAL)
    known = names.role(first.text) is not None and not (fraction and first.text == "d")
    match = _ABOVE.fullmatch(first.text) if first.kind == "name" and not known else None
    if not sign and match is None:
        return None
    digit, word = (match[1], match[2]) if match else ("", None)
    order, after = (int(digit), place + 1) if digit else _power(tokens, place + 1)
    if word and not digit:
        order, after = 1, place + 1
    operand: Tokens = []
    if word:
        operand = [Token("name", word, first.column, first.space_before)]
    elif at(tokens, after).kind == "name":
        operand, after = [tokens[after]], after + 1
    elif at(tokens, after).is_operator("("):
        end = closing(tokens, after)
        return (order, first.text == PARTIAL, list(tokens[after : end + 1]), end + 1) if end < len(tokens) else None
    if operand:
        start, after = after, after_primes(tokens, after)
        operand += tokens[start:after]
    if operand and at(tokens, after).is_operator("(") and tokens[after].value != FRACTION:
        end = closing(tokens, after)
        operand, after = [*operand, *tokens[after : end + 1]], end + 1
    return (order, first.text == PARTIAL, operand, after) if order else None


def _power(tokens: Sequence[Token], place: int) -> tuple[int, int]:
    """The k of ^k or ^(k) here, or 1 if there is none, and the place after it."""
    texts = [token.text for token in tokens[place : place + 6]]
    for opened in range(3):
        raised = texts[1 + opened : 2 + opened]
        if texts[: 1 + opened] != ["^", *"(("[:opened]]:
            break
        if raised and raised[0] in _DIGITS and texts[2 + opened : 2 + 2 * opened] == [")"] * opened:
            return int(raised[0]), place + 2 + 2 * opened
    return 1, place


def _below(tokens: Sequence[Token], place: int, order: int, fraction: bool) -> tuple[tuple[Token, ...], int] | None:
    """The variables of dt^2, dt2, d t, dx dy, together of this order, and the place after them."""
    found: Tokens = []
    while len(found) < order and place < len(tokens):
        first = tokens[place]
        if first.is_operator(PARTIAL, TOTAL) or first.text == "d":
            place, digit = place + 1, ""
            name = at(tokens, place)
            if name.kind != "name":
                return None
        elif first.kind == "name" and (match := _BELOW.fullmatch(first.text)):
            name, digit = Token("name", match[1], first.column), match[2]
        else:
            return None
        place += 1
        if [token.text for token in tokens[place : place + 3]] == ["(", "t", ")"] and fraction:
            place += 3
        times, after = _power(tokens, place)
        if digit and int(digit) != order and order > 1:
            return None
        if digit and order == 1:
            name = Token("name", name.text + digit, name.column)
        elif digit:
            times, after = int(digit), place
        if not fraction and order == 1:
            times, after = 1, place
        found += [name] * times
        place = after
    return (tuple(found), place) if len(found) == order else None


def _power_of_operator(tokens: Tokens, place: int, names: Names, depth: int) -> tuple[Tokens, int] | None:
    """(d/dt)^2 u as diff(u, t, t)."""
    end = closing(tokens, place)
    operator = _quotient(tokens, place + 1, names) if end < len(tokens) else None
    if operator is None or operator.operand or operator.after != end or names.role("d"):
        return None
    power, after = _power(tokens, end + 1)
    if after == end + 1:
        return None
    raised = _Quotient([], operator.variables * power, after, operator.partial, operator.fraction)
    return _applied(tokens, raised, place, names, depth)


def _refuse_fraction(tokens: Tokens, place: int, names: Names) -> None:
    r"""InputError for a fraction such as \frac{d V k}{dx}, in which d would be read as a common factor."""
    if not _is_fraction(tokens, place) or names.role("d"):
        return
    slash = closing(tokens, place + 1) + 1
    above, below = tokens[place + 2 : slash - 1], tokens[slash + 2 : closing(tokens, place) - 1]
    differential = bool(above) and (above[0].text == "d" or above[0].is_operator(TOTAL)) and len(above) > 1
    variable = next((k for order in range(1, 4) if (k := _below(below, 0, order, True)) and k[1] == len(below)), None)
    if differential and variable:
        by, column = variable[0][0].text, tokens[place].column
        if any(token.is_operator("^") for token in above[2:]) and by == "t":
            instead = "write the power around the whole derivative, \\left(\\frac{dx}{dt}\\right)^2"
            raise refusal("the exponent in a derivative is not clear", above[1].column, instead)
        instead = f"write \\frac{{d}}{{d{by}}}\\left( and \\right)"
        raise refusal(f"a derivative by {by} occurs", column, instead)


def _carried_out(inner: Sequence[Token], variables: Sequence[Token], at: Token, total: bool = False) -> Tokens:
    """diff(u, x, …), all at the place of the derivative; the diff of dV/dr, where V depends on r alone, has a value."""
    if not inner:
        raise unexpected(at, "what is differentiated")
    call = Token("name", "diff", at.column, True, Fraction(total))
    found = [call, Token("operator", "(", at.column), *inner]
    for variable in variables:
        found += [Token("operator", ",", at.column), Token("name", variable.text, at.column)]
    return [*found, Token("operator", ")", at.column)]
