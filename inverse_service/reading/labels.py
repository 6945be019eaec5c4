"""Statements of programs that name equations, derivatives, and solvers: tokens in, tokens out."""

import re
from collections.abc import Collection, Mapping
from dataclasses import replace

from inverse_service.expressions.refusals import fault
from inverse_service.reading import tokens as tk
from inverse_service.reading.names import DERIVATIVE_NAMES, Names, meanings
from inverse_service.reading.tokens import Line, Token, Tokens, at

_EQUATIONS = ("Eq", "Equal", "Equality")
# Names of equations, and words by which a derivative is recognized before it is read.
_LABEL = re.compile(
    r"(?:e?om|eqn?s?|equations?|d?ode|des?|deqs?|dgl|expr|residual|sys(?:tem)?)_?\d*"
    r"|(?!freq)(?:\w*_)?(?:diff|my|the)?_?(?:eq|eqn|ode|eom|equation)(?:_\w+|s?\d*)",
    re.IGNORECASE,
)
_SIDE = re.compile(r"(?:\w*_)?(?:lhs|rhs|left|right)_?\d*", re.IGNORECASE)  # eom_lhs = m x''
DERIVATIVES = DERIVATIVE_NAMES.union(
    ["D2"], (word for word, meaning in meanings("heads").items() if meaning in ("diff", "rate"))
)
_COMMANDS = frozenset(word for word, meaning in meanings("heads").items() if meaning == "solver")
_ENERGIES = ("T", "V", "U", "K", "KE", "PE")
_LAGRANGIANS = ("L", "Lag", "lag", "Lagr", "lagr", "Lagrange", "Lagrangian", "lagrangian")


def without_repeated(tokens: Tokens) -> Tokens:
    """The tokens without phi_dot = der(phi), der(phi) = phi_dot, and D2x = diff(x, t, 2), which
    only say what a name of a derivative means.
    """
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        sides = tk.split_at("=", part)
        sides = [side[:1] if tk.spelled(side[1:]) == "(t)" else side for side in sides]
        if len(sides) == 2 and _is_identity(*sides):
            continue  # Dy = diff(y) of MATLAB, as y' = y'
        if len(sides) == 2 and any(
            len(name) == 1
            and name[0].order
            and derivative_called(rate) == (name[0].text, name[0].order)
            for name, rate in (sides, sides[::-1])
        ):
            continue
        found += [*part, *([end] if end else [])]
    return found


def _is_identity(left: Line, right: Line) -> bool:
    """Whether both sides are the same derivative, x' = x'."""
    one, other = at(left, 0), at(right, 0)
    return (
        len(left) == len(right) == 1
        and one.kind == other.kind == "name"
        and one.order > 0
        and (one.text, one.order) == (other.text, other.order)
    )


def derivative_called(line: Line) -> tuple[str, int] | None:
    """(x, 2) for diff(x, t, 2), diff(x(t), t, t), and (x, 1) for der(x); None for anything else."""
    dot = len(line) - 3
    dotted = dot > 0 and line[dot].is_operator(".") and line[dot + 1].text == "diff"
    by = tk.split_at(",", line[-1].inside) if dotted and line[-1].kind == "bracket" else []
    if by == [[]]:  # x.diff()
        by = [[Token("name", "t", line[dot].column)]]
    if by and tk.spelled(by[0]) == "t":  # x(t).diff(t)
        comma = Token("operator", ",", line[dot].column)
        after = [one for part in by for one in (comma, *part)]
        call_of_all = tk.bracket([*line[:dot], *after], line[-1], space=False)
        line = [line[dot + 1], call_of_all]
    if at(line, 1).is_operator("."):  # sp.diff(x, t)
        line = line[2:]
    call, inside = at(line, 0), at(line, 1).inside
    if len(line) != 2 or call.text not in ("der", *DERIVATIVE_NAMES) or not inside:
        return None
    operand, *by = tk.split_at(",", inside)
    named = [token.kind for token in operand[:1]] == ["name"]
    if not named or tk.spelled(operand[1:]) not in ("", "(t)"):
        return None
    times = [tk.spelled(part) for part in by]
    if call.text == "der":
        return (operand[0].text, operand[0].order + 1) if not by else None
    if len(times) == 1 and times[0].isdigit():  # diff(y, 2) of MATLAB
        return operand[0].text, operand[0].order + int(times[0])
    if times[:1] == ["t"] and times[1:2] and times[1].isdigit() and len(times) == 2:
        return operand[0].text, operand[0].order + int(times[1])
    return (operand[0].text, operand[0].order + len(times)) if {*times} == {"t"} else None


def is_of_lagrangian(line: Line, derived: set[tuple[str, int]]) -> bool:
    """Whether this is p = diff(L, x') or diff(p, t) - diff(L, x) = 0, which follow from the L that
    is given, or diff(diff(L, x'), t) = diff(L, x). The names that such lines give are added to
    `derived`.
    """
    if sorted(map(_times_differentiated, tk.split_at("=", line))) == [1, 2]:
        return True
    name, rest = at(line, 0), line
    named = name.kind == "name" and at(line, 1).is_operator("=")
    if named:
        rest = line[2:]
    if tk.spelled(rest[-2:]) == "=0":
        rest = rest[:-2]
    elif tk.spelled(rest[:2]) == "0=":
        rest = rest[2:]
    elif tk.spelled(rest) == "0":  # EL = 0 for Eq(EL, 0)
        rest = line[:1]
    while len(rest) == 1 and rest[0].is_bracket():
        rest = rest[0].inside
    parts = [part for part in tk.split_at("+-", rest) if part]
    if not parts or not all(_follows_from_lagrangian(part, derived) for part in parts):
        return False
    if named:
        derived.add((name.text, name.order))
    return True


def _times_differentiated(line: Line) -> int:
    """2 for diff(diff(L, x'), t), 1 for diff(L, x), and 0 for what is no derivative of L."""
    times = 0
    while len(line) == 2 and line[0].text in DERIVATIVE_NAMES and line[1].is_bracket():
        line, times = tk.split_at(",", line[1].inside)[0], times + 1
    return times * (at(line, 0).text in _LAGRANGIANS and tk.spelled(line[1:]) in ("", "(t)"))


def _follows_from_lagrangian(line: Line, derived: Collection[tuple[str, int]]) -> bool:
    """Whether this is diff(L, x'), one of the derived names, or a derivative of these by t."""
    while len(line) == 2 and line[0].text in DERIVATIVE_NAMES and line[1].is_bracket():
        line = tk.split_at(",", line[1].inside)[0]
        if at(line, 0).text in _LAGRANGIANS and tk.spelled(line[1:]) in ("", "(t)"):
            return True
    return [token.kind for token in line] == ["name"] and (line[0].text, line[0].order) in derived


def without_identities(tokens: Tokens) -> Tokens:
    """The tokens without the theta' = theta' of d theta/dt = theta', d theta'/dt = f, and without
    x'' = x''.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";", ","))
    named = [sides for part, _ in parts if (sides := _rates_on_sides(part)) is not None]
    rates = {(left[0], right[0]) for left, right in named if (left[1], right[1]) == (1, 0)}
    rates |= {(right[0], left[0]) for left, right in named if (left[1], right[1]) == (0, 1)}
    same = [_is_rate_of_itself(part, rates) for part, _ in parts]
    if not any(same) or all(same):
        return tokens
    kept = [pair for pair, is_same in zip(parts, same, strict=True) if not is_same]
    return [token for part, end in kept for token in [*part, *([end] if end else [])]]


def _is_rate_of_itself(line: Line, rates: Collection[tuple[str, str]]) -> bool:
    """Whether this is x' = x', or y' = x'' next to the x' = y of `rates`."""
    sides = _rates_on_sides(line[at(line, 0).text == "where" :])
    if sides is None:
        return False
    (name, order), (other, again) = sides
    if (name, order) == (other, again):  # \ddot{x} = \frac{d^2 x}{dt^2}
        return order > 0
    return {order, again} == {1, 2} and ((other, name) if again == 2 else (name, other)) in rates


def with_named_derivatives(tokens: Tokens, names: Names) -> Tokens:
    """The tokens with x'' for the a of a = x'', and with X' for the W of X' = W, W' = -X beside an
    equation with a second derivative, which are no first-order pairs.
    """
    highest = max((token.order for token in tk.walk(tokens)), default=0)
    if highest < 2:
        return tokens
    parts = tk.split(tokens, lambda _, token: token.is_operator(";", ","))
    meant: dict[str, Token] = {}
    kept: list[tuple[Tokens, Token | None]] = []
    for part, end in parts:
        sides = _rates_on_sides(part)
        meaning = None if sides is None else _derivative_named(sides, part, tokens)
        if meaning is None or names.role(meaning[0]):
            kept.append((part, end))
        else:
            meant |= dict([meaning])
    if not meant or not kept:
        return tokens
    for name, rate in meant.items():
        tk.note(name, f"{rate.text}{chr(39) * rate.order}")
    line = [token for part, end in kept for token in [*part, *([end] if end else [])]]
    return _with_derivatives(line, meant)


def _derivative_named(
    sides: tuple[tuple[str, int], tuple[str, int]], part: Line, tokens: Line
) -> tuple[str, Token] | None:
    """(a, x'') for a = x'', (v, x') for v = x' where v occurs again, and (W, X') for X' = W with a W'
    in another statement; else None.
    """
    (left, first), (right, second) = sides
    columns = {token.column for token in part}
    others = [token for token in tk.walk(tokens) if token.column not in columns]
    named = [token.order for token in others if token.text == left]
    rates = {token.order for token in others if token.text == right}
    if (first, second) == (0, 2) and named and not any(named) and 2 not in rates:
        return left, part[2]
    if (first, second) == (0, 1) and named and {*named} == {0}:
        return left, part[2]
    return (right, part[0]) if (first, second) == (1, 0) and 1 in rates else None


def _with_derivatives(line: Line, meant: Mapping[str, Token]) -> Tokens:
    return [
        replace(
            token,
            text=meant[token.text].text,
            order=meant[token.text].order + token.order,
            primed=token.primed or token.column + _width(token, meant[token.text]),
        )
        if token.kind == "name" and token.text in meant
        else tk.within(token, lambda inside: _with_derivatives(inside, meant))
        for token in line
    ]


def _width(name: Token, rate: Token) -> int:
    """Where the mark of a rate is: above the name, as the dot of a rate, or behind it."""
    return 0 if rate.primed == rate.column else len(name.text)


def _rates_on_sides(line: Line) -> tuple[tuple[str, int], tuple[str, int]] | None:
    """(x, 1) and (y, 0) of x' = y; None for anything else."""
    sides = tk.split_at("=", line)
    if len(sides) != 2 or any([one.kind for one in side] != ["name"] for side in sides):
        return None
    left, right = sides[0][0], sides[1][0]
    return (left.text, left.order), (right.text, right.order)


def without_labels(tokens: Tokens, names: Names) -> Tokens:
    """The tokens without the eqn = of eqn = diff(x, t, 2) == -x, the ode := of ode := x'' + x, and
    the a, b = of a, b = Eq(...), Eq(...).
    """
    tokens = _without_several(tokens)
    found: Tokens = []
    for line, end in tk.split(tokens, lambda _, token: token.is_operator(";", ",")):
        label, equal, rest = at(line, 0), at(line, 1), line[2:]
        plain = label.kind == "name" and not label.order and equal.is_operator("=")
        second = any(token.is_operator("=") and token.value == tk.EQUALITY for token in rest)
        listed = tk.split_at(",", rest[0].inside) if len(rest) == 1 else [rest]
        second = second or all(map(_is_equation_call, listed)) or _is_solver_call(rest)
        if plain and second and not equal.value:
            tk.note(f"{label.text} =")
            line = rest
        elif plain and _labels_expression(label, equal, rest, tokens, names):
            if _SIDE.fullmatch(label.text):
                raise fault("side of an equation", label.column, name=label.text)
            tk.note(f"{label.text} {'=' if equal.value != tk.GIVEN else ':='}")
            line = rest
        found += [*line, *([end] if end else [])]
    return found


def _without_several(tokens: Tokens) -> Tokens:
    """The tokens without the a, b = of each a, b = Eq(...), Eq(...)."""
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        first = next((place for place, token in enumerate(part) if token.is_operator("=")), 0)
        names, calls = tk.split_at(",", part[:first]), tk.split_at(",", part[first + 1 :])
        if len(names) > 1 and len(names) == len(calls) and all(map(_is_equation_call, calls)):
            tk.note(f"{tk.source(part[:first])} =")
            part = part[first + 1 :]
        found += [*part, *([end] if end else [])]
    return found


def _labels_expression(label: Token, equal: Token, rest: Line, text: Line, names: Names) -> bool:
    """Whether a name is the label of an expression that is zero: ode := x'' + x and eom = m x'' +
    k x, but not F = m x''.
    """
    named = equal.value == tk.GIVEN or _LABEL.fullmatch(label.text) or _calls_method(rest)
    if label.text in _ENERGIES or not named:
        return False  # T := m/2*diff(x, t)^2
    whole = rest[0].inside if len(rest) == 1 and rest[0].kind == "bracket" else rest
    parts = tk.split_at(",", whole)  # {x'' + x, x(0) = 1} has an initial value
    inside = [token for part in parts if not is_at_a_number(part) for token in tk.walk(part)]
    moves = any(token.order > 1 or token.text in DERIVATIVES for token in inside)
    equals = any(token.is_operator("=", *tk.COMPARED) for token in inside)
    if not moves or equals or names.role(label.text):
        return False
    return sum(token.text == label.text for token in tk.walk(text)) == 1


def _calls_method(line: Line) -> bool:
    """Whether this is a sum with x(t).diff(t, 2), which Python gives a name but no equation."""
    calls = any(
        at(line, place).is_operator(".")
        and at(line, place + 1).text == "diff"
        and tk.spelled(at(line, place + 2).inside) in ("t,2", "t,t")
        for place in range(len(line))
    )
    return calls and len(tk.split_at("+-", line)) > 1


def is_at_a_number(line: Line) -> bool:
    """Whether this is x(0) = 1, D(x)(0) = 1, or x'(0) = 1."""
    place = next((k for k, token in enumerate(line) if token.is_operator("=")), 0)
    point = at(line, place - 1)
    return point.is_bracket() and [one.kind for one in point.inside] == ["number"]


def without_commands(tokens: Tokens) -> Tokens:
    """The tokens without statements such as dsolve(ode, x(t)) and sol = ode2(eq1, y, x), which only
    name the equations that are given before them, and without a Dx = diff(x, t) that only Dx(0)
    uses.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    moving = [
        any(token.order or token.text in DERIVATIVES for token in tk.walk(line))
        for line, _ in parts
    ]
    found: Tokens = []
    for (line, end), moves in zip(parts, moving, strict=True):
        place = next((k + 1 for k, token in enumerate(line[:3]) if token.is_operator("=")), 0)
        called = line[place + 2 * at(line, place + 1).is_operator(".") :]  # sp.dsolve
        command = at(called, 0).text in _COMMANDS and len(called) == 2
        names_rate = place == 2 and at(called, 0).text == "diff" and len(called) == 2
        names_rate = names_rate and at(line, 0).text == f"D{at(called[1].inside, 0).text}"
        names_rate = names_rate and not _occurs_again(line[0], tokens)
        if any(moving) and (names_rate or (command and not moves and called[1].is_bracket())):
            tk.note(tk.source(line))
            line = []
        found += [*line, *([end] if end else [])]
    return found


def _occurs_again(name: Token, tokens: Line) -> bool:
    """Whether a name occurs elsewhere, but in Dx(0), an initial value."""
    return any(
        line[place].text == name.text
        and line[place].column != name.column
        and not at(line, place + 1).is_bracket()
        for line, place, _ in tk.places(tokens)
    )


def _is_equation_call(line: Line) -> bool:
    """Whether this is Eq(...), perhaps with the name of a module before it."""
    place = 2 * at(line, 1).is_operator(".")
    return at(line, place).text in _EQUATIONS and at(line, place + 1).is_bracket()


def _is_solver_call(line: Line) -> bool:
    """Whether this is dsolve(x'' + x, x), which names no function x but the solution."""
    place = 2 * at(line, 1).is_operator(".")
    call = at(line, place + 1)
    return (
        at(line, place).text in _COMMANDS
        and (call.is_bracket() or call.is_bracket("["))
        and len(line) == place + 2
    )
