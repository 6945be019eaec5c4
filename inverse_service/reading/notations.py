"""Other programs' ways to write a formula, put into the words of our own grammar; tokens in, tokens out.

SymPy's text (`x(t).diff(t, 2)`, `Eq(a, b)`, the calls of `srepr`), Mathematica (`x''[t] == -Sin[x[t]]`,
`D[u, {t, 2}]`, `Derivative[2][x][t]`, Plus, Times, Power), Maple (`diff(x(t), t$2)`, `(D@@2)(x)(t)`), Maxima
(`'diff(x, t, 2)`), Modelica (`der(x)`), and quotients of differentials (dx/dt, d^2x/dt^2). Nothing is evaluated.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial

from inverse_service.expressions import refusals
from inverse_service.reading import differentials
from inverse_service.reading.names import DERIVATIVE_NAMES, FUNCTIONS, Names
from inverse_service.reading.tokens import FACTOR, Token, closing, never_closed, split_at_commas, unexpected

Tokens = list[Token]
_MODULES = frozenset(("sp", "sympy", "sym", "np", "numpy", "math", "Math", "jnp"))
_CAPITALS = {
    "Ln": "log", "ArcSin": "asin", "ArcCos": "acos", "ArcTan": "atan", "ArcSinh": "asinh", "ArcCosh": "acosh",
    "ArcTanh": "atanh", "Abs": "abs", "Sign": "sign", "HeavisideTheta": "Heaviside", "UnitStep": "Heaviside",
}  # fmt: skip
_HEADS = {"Plus": "Add", "Times": "Mul", "Power": "Pow", "pow": "Pow", "Equal": "Eq", "Equality": "Eq", "List": "Tuple"}
_JOINED = {"Add": "+", "Mul": "*", "Pow": "^", "Eq": "=", "Tuple": ",", "Hold": ","}
_PIECES = "Piecewise[{"  # a head that no name is
_WORD = re.compile(r"[A-Z]")


def in_our_words(tokens: Tokens, names: Names) -> Tokens:
    """The same formulas in our notation; tokens that need nothing come back as they are."""
    marks = {token.text for token in tokens}
    written = tokens
    if marks & {"[", "{"}:
        tokens = _with_round_brackets(_with_indices(tokens, names), names)
    if marks & {*_STARTS, ".", "@", "Piecewise"} or _is_primed_call(tokens):
        tokens = _rewritten(tokens, names)
    if "I" in marks and names.role("I") is None and (tokens != written or marks & DERIVATIVE_NAMES):
        column = next(token.column for token in tokens if token.text == "I")
        raise refusals.refusal(
            "I is the imaginary unit in this notation; it occurs", column, "write real equations", declare="parameters"
        )
    return differentials.with_derivatives(_without_list(tokens), names)


def _with_indices(tokens: Tokens, names: Names) -> Tokens:
    """x[1]'' as x_1'', where x stands nowhere without an index: x[0] beside x[t] is a value."""
    indexed = {place for place in range(len(tokens) - 3) if _is_indexed(tokens, place)}
    alone = {token.text for place, token in enumerate(tokens) if token.kind == "name" and place not in indexed}
    known = FUNCTIONS | {word for word in _STARTS if word.isalpha()} | set(names.functions) | alone
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
    """Whether x[1] begins here, which is no call x[1](...) of a function."""
    name, opening, index, end = tokens[place : place + 4]
    whole = name.kind == "name" and opening.is_operator("[") and index.text.isdigit() and end.is_operator("]")
    after = [token.text for token in tokens[place + 4 : place + 7]]
    return whole and (after[:1] != ["("] or after == ["(", "t", ")"])


def _with_round_brackets(tokens: Tokens, names: Names) -> Tokens:
    """Mathematica's f[x] and {x, 2}; the orders in our own B[1,0](x, y) stay.

    Without another sign of Mathematica k[x] is as unclear as k (x).
    """
    found: Tokens = []
    calls = {(a.text, b.text) for a, b in itertools.pairwise(tokens) if b.is_operator("[") or a.is_operator("[")}
    mathematica = any((first == "[" and second == "t") or first != _small(first) for first, second in calls)
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
    while end < len(tokens) and (tokens[end].kind == "number" or tokens[end].is_operator(",")):
        end += 1
    after = tokens[end + 1 : end + 2]
    return (
        tokens[place - 1].text != "Derivative" and bool(after) and after[0].is_operator("(") and tokens[end].text == "]"
    )


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
        elif token.kind == "prime" and place + 1 < len(tokens) and tokens[place + 1].text == "diff":
            place += 1  # Maxima's quote
        elif token.is_operator("(") and _is_maple_power(tokens, place):
            place = _derivative_of(tokens, place + 6, int(tokens[place + 4].value), found)
        elif (
            token.text in _STARTS and token.kind == "name" and not names.role(token.text) and _opens(tokens, place + 1)
        ):
            place = _STARTS[token.text](tokens, place, found, names)
        else:
            found.append(token)
            place += 1
    return found


def _opens(tokens: Sequence[Token], place: int) -> bool:
    return place < len(tokens) and tokens[place].is_operator("(")


def _arguments(tokens: Sequence[Token], opening: int) -> tuple[list[Sequence[Token]], int]:
    """The arguments in the bracket at `opening`, and the place after it."""
    end = closing(tokens, opening)
    if end == len(tokens):
        raise never_closed(tokens[opening])
    return [part for part in split_at_commas(tokens[opening + 1 : end]) if part], end + 1


def _after_dot(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """sp.sin is sin; u.diff(t, 2) is diff(u, t, 2)."""
    method = tokens[place + 1] if place + 1 < len(tokens) else tokens[place]
    if found and found[-1].text in _MODULES:
        found.pop()
        return place + 1
    if method.text != "diff" or not _opens(tokens, place + 2):
        raise refusals.refusal(
            "a dot occurs", tokens[place].column, "a dot belongs to a number such as 0.5, or to u.diff(t)"
        )
    arguments, after = _arguments(tokens, place + 2)
    start = _operand(found)
    operand = found[start:]
    found[start:] = [replace(method, space_before=True), _sign("(", method), *operand]
    for argument in arguments:
        found += [_sign(",", method), *_rewritten(argument, names)]
    found.append(_sign(")", method))
    return after


def _operand(found: Tokens) -> int:
    """Where the name, the call or the bracket that came last begins."""
    place = len(found) - 1
    if place >= 0 and found[place].is_operator(")"):
        depth = 0
        while place >= 0:
            depth += found[place].is_operator(")") - found[place].is_operator("(")
            if depth == 0:
                break
            place -= 1
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
        raise refusals.refusal("a derivative of a name occurs", tokens[start - 1].column, "write x'' or diff(x, t, 2)")
    found += [name, Token("prime", "'" * (order + inner), name.column, False, Fraction(order + inner))]
    return place + 3 + inner


def _maple_d(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """D(x)(t) is x'(t); Mathematica's D[u, t] is diff(u, t)."""
    arguments, _ = _arguments(tokens, place + 1)
    if len(arguments) > 1:
        return _call(tokens, place, found, names, "diff")
    return _derivative_of(tokens, place + 1, 1, found)


def _mathematica_derivative(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Derivative[2][x][t] is x''(t); SymPy's Derivative(x(t), t) is a call."""
    arguments, after = _arguments(tokens, place + 1)
    if len(arguments) == 1 and len(arguments[0]) == 1 and arguments[0][0].kind == "number":
        return _derivative_of(tokens, after, int(arguments[0][0].value), found)
    return _call(tokens, place, found, names, "Derivative")


def _call(tokens: Sequence[Token], place: int, found: Tokens, names: Names, name: str) -> int:
    """The same call under our name, its arguments rewritten."""
    arguments, after = _arguments(tokens, place + 1)
    found += [replace(tokens[place], text=name), tokens[place + 1], *_listed(arguments, names), tokens[after - 1]]
    return after


def _listed(arguments: Sequence[Sequence[Token]], names: Names) -> Tokens:
    """The arguments rewritten, with commas between them."""
    found: Tokens = []
    for position, argument in enumerate(arguments):
        found += ([_sign(",", argument[0])] if position else []) + _rewritten(argument, names)
    return found


def _quoted(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Symbol('x', positive=True) and Function('x') are x."""
    arguments, after = _arguments(tokens, place + 1)
    word = [token for token in arguments[0] if token.kind == "name"] if arguments else []
    if len(word) != 1 or len(arguments[0]) != 3:
        raise refusals.refusal("a name in quotation marks is missing", tokens[place].column, "write Symbol('x')")
    found.append(replace(word[0], space_before=tokens[place].space_before))
    return after


def _number(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Integer(-1) is -1 in brackets, Integer(2) is 2, Rational(1, 2) is 1/2 in brackets."""
    arguments, after = _arguments(tokens, place + 1)
    if [len(argument) for argument in arguments] == [1] and tokens[place].text == "Integer":
        found.append(arguments[0][0])
        return after
    parts = [token for position, part in enumerate(arguments) for token in ([_sign("/", part[0])] * position + [*part])]
    found += [Token("operator", "(", tokens[place].column, True, FACTOR), *parts, tokens[after - 1]]
    return after


def _joined(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Add(a, b) as (a + b), Eq(a, b) as a = b where it is the whole equation."""
    head = _HEADS.get(tokens[place].text, tokens[place].text)
    arguments, after = _arguments(tokens, place + 1)
    inner: Tokens = []
    for position, argument in enumerate(arguments):
        inner += [_sign(_JOINED[head], argument[0])] if position else []
        part = _rewritten(argument, names)
        inner += (
            part if head in ("Tuple", "Eq") or len(part) == 1 else [_sign("(", part[0]), *part, _sign(")", part[0])]
        )
    if head == "Eq":
        if len(arguments) != 2:
            raise unexpected(tokens[place], "an equation with two sides, Eq(a, b),")
        found += inner
    else:
        found += [Token("operator", "(", tokens[place].column, True, FACTOR), *inner, tokens[after - 1]]
    return after


def _pieces(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Mathematica's Piecewise[{{a, x > 0}, …}, b] is piecewise((a, x > 0), …, (b, true)); b is 0 if left out."""
    (listed, *rest), after = _arguments(tokens, place + 1)
    found += [replace(tokens[place], text="piecewise"), *_rewritten(listed[:-1], names)]
    found += [_sign(text, tokens[place]) for text in (",", "(")]
    found += _rewritten(rest[0], names) if rest else [Token("number", "0", tokens[place].column, False, Fraction(0))]
    found += [*(_sign(text, tokens[place]) for text in (",", "true", ")")), tokens[after - 1]]
    return after


def _logarithm(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Mathematica's Log[x] is log(x), and Log[b, x] is log(x, b)."""
    arguments, after = _arguments(tokens, place + 1)
    found += [replace(tokens[place], text="log"), tokens[place + 1]]
    found += [*_listed(arguments[::-1], names), tokens[after - 1]]
    return after


def _float(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    raise refusals.refusal("a Float occurs", tokens[place].column, "write the exact number, such as Rational(1, 3)")


def _der(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """Modelica's der(u) is diff(u, t)."""
    arguments, after = _arguments(tokens, place + 1)
    if len(arguments) != 1:
        raise refusals.refusal("der has one argument", tokens[place].column, "write der(x)")
    time = Token("name", "t", tokens[place].column)
    found += [replace(tokens[place], text="diff"), tokens[place + 1], *_rewritten(arguments[0], names)]
    found += [_sign(",", time), time, tokens[after - 1]]
    return after


def _differential(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """ModelingToolkit's Differential(t)(u) is diff(u, t)."""
    by, after = _arguments(tokens, place + 1)
    if len(by) != 1 or not _opens(tokens, after):
        raise refusals.refusal("Differential has no operand", tokens[place].column, "write Differential(t)(x), or x'")
    operand, end = _arguments(tokens, after)
    found += [replace(tokens[place], text="diff"), tokens[after], *_rewritten(operand[0], names)]
    found += [_sign(",", tokens[after]), *by[0], tokens[end - 1]]
    return end


def _column(tokens: Sequence[Token], place: int, found: Tokens, names: Names) -> int:
    """SymPy's Matrix([[u], [v]]) is u, v: its entries without the brackets of the rows' list."""
    arguments, after = _arguments(tokens, place + 1)
    if len(arguments) != 1 or not _opens(arguments[0], 0) or closing(arguments[0], 0) != len(arguments[0]) - 1:
        raise refusals.refusal("a matrix occurs", tokens[place].column, "write its entries, separated by ;")
    found += _rewritten(arguments[0][1:-1], names)
    return after


_Rewrite = Callable[[Sequence[Token], int, Tokens, Names], int]
_STARTS: dict[str, _Rewrite] = {
    **dict.fromkeys(("Symbol", "Dummy", "Function"), _quoted),
    **dict.fromkeys(("Integer", "Rational"), _number),
    **dict.fromkeys((*_JOINED, *_HEADS), _joined),
    **dict.fromkeys(("Float", "RealNumber"), _float),
    **dict.fromkeys(("Diff", "Dt"), partial(_call, name="diff")),  # Maple's and Mathematica's
    **dict.fromkeys(("Matrix", "ImmutableMatrix", "ImmutableDenseMatrix", "MutableDenseMatrix"), _column),
    "der": _der,
    "Differential": _differential,
    "D": _maple_d,
    "Log": _logarithm,
    _PIECES: _pieces,
    "Derivative": _mathematica_derivative,
}


def _without_list(tokens: Tokens) -> Tokens:
    """[eq1, eq2] and {eq1, eq2} without the outer brackets; a Matrix of equations is not one of them."""
    plain = [token for token in tokens if token.kind != "newline"]
    if len(plain) < 3 or not plain[0].is_operator("[", "(") or not any(token.is_operator("=") for token in plain):
        return tokens
    return plain[1:-1] if closing(plain, 0) == len(plain) - 1 else tokens
