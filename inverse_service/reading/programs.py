"""Right-hand sides and shorthand of numerical programs, rewritten as equations: tokens in, tokens
out.

| program | text | equations | | --- | --- | --- | | MATLAB, Octave | `@(t, q) [q(2); -sin(q(1))]` |
q_1' = q_2; q_2' = -sin(q_1) | | MATLAB, Octave | `dydt(1) = y(2); dydt(2) = -y(1)`, `dydt = [y(2);
-y(1)]` | y_1' = y_2; y_2' = -y_1 | | MATLAB `dsolve` | `D2x + 2*Dx + x = 0` | x'' + 2 x' + x = 0 |
| Julia, Python | `du[1] = u[2]; du[2] = -u[1]`, `dydt[0] = y[1]` | u_1' = u_2; u_2' = -u_1 | |
heyoka | `[(x, v), (v, -sin(x))]` | x' = v; v' = -sin(x) | | SymPy | `(x.diff(t, 2) + x, y.diff(t,
2) + y)` | x'' + x; y'' + y | | any with `==` | `eqn = diff(x, t, 2) == -x` | x'' = -x |
"""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

from inverse_service.reading import tokens as tk
from inverse_service.reading.names import DERIVATIVE_NAMES, FUNCTIONS, Names, meanings
from inverse_service.reading.tokens import Line, Token, Tokens, at

_EQUATIONS = ("Eq", "Equal", "Equality")
# D2x and Dx, ddx and dx, xdd and x_d.
_SHORT = (
    re.compile(r"(?P<mark>D[2-9]?)(?P<name>[A-Za-z]\w*)"),
    re.compile(r"(?P<mark>dd?)(?P<name>[A-Za-z]\w*)"),
    re.compile(r"(?P<name>[A-Za-z]\w*?)_?(?P<mark>dd?)"),
)
# dydt, dy, ydot, and y_dot, the array of rates of the array y.
_RATES = re.compile(r"d([A-Za-z]\w*?)(?:_?d(?P<by>[a-z]))?|([A-Za-z]\w*?)_?dot")
_SHORT_RATE = re.compile(r"d([A-Za-z]\w*?)")
_SINGLE = re.compile(r"d([A-Za-z]\w*?)_?dt")
# Names of equations, and words by which a derivative is recognized before it is read.
_LABEL = re.compile(
    r"(?:e?om|eqn?s?|equations?|d?ode|des?|deqs?|dgl|expr|residual|sys(?:tem)?)_?\d*"
    r"|(?!freq)(?:\w*_)?(?:diff|my|the)?_?(?:eq|eqn|ode|eom|equation)(?:_\w+|s?\d*)",
    re.IGNORECASE,
)
_DERIVATIVES = DERIVATIVE_NAMES | {"D", "Dt", "D_t", "D2", "Differential", "der"}
_COMMANDS = frozenset(word for word, meaning in meanings("heads").items() if meaning == "solver")
_DOTS = {"dot": 1, "ddot": 2}
_TAYLOR = "taylor_adaptive"
_SOLVERS = frozenset(
    (_TAYLOR, f"{_TAYLOR}_batch", "ode45", "ode23", "ode113", "ode15s", "ode23s", "ode78", "ode89")
)
_ARRAYS = ("array", "SVector", "zeros", "ones")
_LAGRANGIANS = ("L", "Lag", "lag", "Lagr", "lagr", "Lagrange", "Lagrangian", "lagrangian")
_SECOND_ORDER = "second_order"
_LISTS = ("array", "asarray", "vstack", "hstack", "concatenate", "stack")
_PARAMETERS = ("p", "par", "pars", "params", "args")
_STEPPING = ("rk", "desolve_system_rk4", "desolve_odeint")
# ddu, the array of accelerations of u
_SECOND_RATES = re.compile(r"dd([A-Za-z]\w*)")


def as_equations(tokens: Tokens, names: Names) -> Tokens:
    """The same statements as equations; tokens that no rule fits are returned unchanged.

    Values beside the rates, as in g = 9.81; dydt = [y(2); -g*y(1)], remain beside the equations.
    """
    tokens = _with_second_rates(_with_plain_lists(_with_glued_rates(tokens)))
    tokens = _with_values_apart(_without_repeated(tokens))
    tokens = _without_named_sides(_without_arrays(tokens))
    tokens, entries = _with_entries(_with_time(tokens, names))
    found = _of_statements(tokens, names)
    if not entries:
        return found
    arrays = {name: _Array.of(name, tokens) for name, _ in entries.values()}
    given = {arrays[array].entry(k): name for name, (array, k) in entries.items()}
    return _with_given_names(found, given)


def _with_glued_rates(tokens: Tokens) -> Tokens:
    """dtheta for the d\u03b8 of d\u03b8 = \u03c9 and d\u03b8 = u[2]."""
    starts = [part[:3] for part, _ in tk.split(tokens, lambda _, token: token.is_operator(";"))]
    glued = {
        start[1].text
        for start in starts
        if at(start, 0).text == "d" and at(start, 2).is_operator("=") and _touches(at(start, 1))
    }

    def joined(line: Line) -> Tokens:
        found: Tokens = []
        for token in line:
            last = at(found, len(found) - 1)
            if last.text == "d" and token.text in glued and _touches(token) and not last.order:
                found[-1] = replace(last, text=f"d{token.text}", order=token.order)
            else:
                found.append(tk.within(token, joined))
        return found

    return joined(tokens) if glued else tokens


def _touches(token: Token) -> bool:
    """Whether this is a name without a blank before it."""
    return token.kind == "name" and not token.space_before


def _with_second_rates(tokens: Tokens) -> Tokens:
    """x'' = f for the a[1] = f of Julia's function h!(a, v, u, p, t) with x, y = u and dx, dy = v;
    without names for the entries, u_1'' = f.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    heads = [k for k, (part, _) in enumerate(parts) if at(part, 0).text == _SECOND_ORDER]
    if len(heads) != 1:
        return tokens
    second, first, array = (
        part[0].text for part in tk.split_at(",", parts.pop(heads[0])[0][1].inside)
    )
    names: dict[str, list[str]] = {}
    rest: list[tuple[Tokens, Token | None]] = []
    for part, end in parts:
        left, *right = tk.split_at("=", part)
        listed = [tk.spelled(name) for name in tk.split_at(",", left)]
        if len(right) == 1 and tk.spelled(right[0]) in (second, first, array):
            names[tk.spelled(right[0])] = listed
        else:
            rest.append((part, end))
    orders = {second: 2, first: 1, array: 0}
    moving = names.get(array, [])
    known = {name: (moving[k], 1) for k, name in enumerate(names.get(first, [])[: len(moving)])}

    def entry(k: int) -> str:
        return moving[k - 1] if 0 < k <= len(moving) else f"{array}_{k}"

    def with_entries(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            index, named = _index(line, place), at(line, place - 1)
            if token.kind == "name" and token.text in orders:
                name = token.text if index is None else entry(index)
                name = array if index is None else name
                found.append(_with_order(token, name, orders[token.text]))
            elif token.kind == "name" and token.text in known:
                found.append(_with_order(token, *known[token.text]))
            elif not (named.text in orders and _index(line, place - 1) is not None):
                found.append(tk.within(token, with_entries))
        return found

    kept = [token for part, end in rest for token in [*part, *([end] if end else [])]]
    return with_entries(kept)


def _with_order(token: Token, name: str, order: int) -> Token:
    return replace(token, text=name, order=order, primed=token.column * (order > 0))


def _with_plain_lists(line: Line) -> Tokens:
    """[dx, dv] for np.array([dx, dv]) and SVector([...])."""
    found: Tokens = []
    for token in line:
        token = tk.within(token, _with_plain_lists)
        first = tk.split_at(",", token.inside)[0]  # array([dx, dv], float)
        whole = first[0] if len(first) == 1 else token
        if (
            token.is_bracket()
            and whole.is_bracket("[")
            and at(found, len(found) - 1).text in _LISTS
        ):
            found.pop()
            if at(found, len(found) - 1).is_operator("."):
                del found[-2:]
            token = whole
        found.append(token)
    return found


def _of_statements(tokens: Tokens, names: Names) -> Tokens:
    tokens = _without_solver(_with_operators(tokens))
    tokens = _with_first_differences(tokens)
    tokens = _without_repeated(_with_primes(tokens, names))
    while at(tokens, len(tokens) - 1).is_operator(";"):
        tokens = tokens[:-1]
    while at(tokens, 0).is_operator(";"):
        tokens = tokens[1:]
    if (found := _by_rule(tokens, names)) is not None:
        return found
    parts = [part for part in tk.split_at(";", tokens) if part]
    values = [part for part in parts if _is_value(part)]
    others = [part for part in parts if not _is_value(part)]
    if others and all(
        [one.kind for one in part] == ["name"] for part in tk.split_at(",", others[-1])
    ):
        whole = tk.bracket(others[-1], others[-1][0])  # return dx, dv
        others[-1] = [replace(whole, text="[")]
    others, values = _with_named_components(others, values)
    rates = _joined(others)
    found = _by_rule(rates, names) if len(others) < len(parts) and rates else None
    if found is None:
        return tokens
    entered = [any(True for _ in _entries(part)) for part in values]
    for name in dict.fromkeys(name for name, _, _ in _entries(rates)):
        array = _Array.of(name, tokens)
        values = [array.with_names(part) for part in values]
    for place, is_entered in enumerate(entered):
        if is_entered:  # r = sqrt(y(1)^2 + y(2)^2), whose text alone says nothing of y_1
            found = _with_value(found, values[place])
            values = [_with_value(part, values[place]) for part in values]
    values = [part for part, is_entered in zip(values, entered, strict=True) if not is_entered]
    before = [part for part in values if part[0].column < found[0].column]
    after = [part for part in values if part[0].column >= found[0].column]
    return _joined([*before, found, *after])


def _with_value(line: Line, value: Tokens) -> Tokens:
    """The tokens with (formula) for the name of a value, but for that before its =."""
    name, formula = value[0].text, value[2:]
    tk.note(tk.source(value), "a definition")

    def with_value(line: Line) -> Tokens:
        return [
            tk.bracket([replace(one, column=token.column) for one in formula], token, space=True)
            if token.kind == "name" and token.text == name and not token.order
            else tk.within(token, with_value)
            for token in line
        ]

    given = at(line, 1).is_operator("=") and at(line, 0).text == name
    return [*line] if given else with_value(line)


def _without_named_sides(tokens: Tokens) -> Tokens:
    """du[1] = v for the du[1] = dx = v of Julia."""
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        sides = tk.split_at("=", part)
        entry = len(sides) == 3 and _index(part, 0) is not None and len(sides[0]) == 2
        if entry and [token.kind for token in sides[1]] == ["name"]:
            part = [*sides[0], next(one for one in part if one.is_operator("=")), *sides[2]]
        found += [*part, *([end] if end else [])]
    return found


def _without_arrays(tokens: Tokens) -> Tokens:
    """The tokens without x = u(1), xdot = u(3), and dudt = [xdot; xdotdot] where xdot and xdotdot,
    or xdot alone, have their own equations.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    given = {
        (line[0].text, line[0].order)
        for line, _ in parts
        if at(line, 0).order and at(line, 1).is_operator("=")
    }

    def is_list(line: Line) -> bool:
        whole = at(line, len(line) - 1)
        called = at(line, len(line) - 2)
        plain = len(line) == 1 or called.is_operator("=") or called.text in _ARRAYS
        listed = _components(whole) if plain and whole.is_bracket("[") else []
        listed = listed or tk.split_at(",", line)  # return x_dot, v_dot
        return len(listed) > 1 and all(
            len(one) == 1 and {(one[0].text, one[0].order + k) for k in (0, one[0].order)} & given
            for one in listed
        )

    if not any(is_list(line) for line, _ in parts):
        return tokens
    found: Tokens = []
    for line, end in parts:
        name, sides = at(line, 0), tk.split_at("=", line)
        entry = len(sides) == 2 and len(sides[1]) == 2 and _index(sides[1], 0) is not None
        again = not name.order or (name.text, name.order + 1) in given
        unpacked = len(sides) == 2 and len(tk.split_at(",", sides[0])) > 1 and len(sides[1]) == 1
        if is_list(line) or unpacked or (entry and again and len(sides[0]) == 1):
            continue
        found += [*line, *([end] if end else [])]
    return found


def _with_values_apart(tokens: Tokens) -> Tokens:
    """a = 4; b = 1 for [a, b] = deal(4, 1) and a, b = 4, 1, values of names that do not move and
    have no other equation.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    moving = {token.text for token in tk.walk(tokens) if token.order}
    sides = [tk.split_at("=", part) for part, _ in parts]
    lefts = [line[0] for line in sides if len(line) > 1]
    times = Counter(name for left in lefts for name in {token.text for token in tk.walk(left)})
    found: Tokens = []
    for part, end in parts:
        left, *right = tk.split_at("=", part)
        left = [*left[0].inside] if len(left) == 1 and left[0].is_bracket("[") else left
        if len(right) == 1 and at(right[0], 0).text == "deal" and len(right[0]) == 2:
            right = [[*right[0][1].inside]]
        names, values = tk.split_at(",", left), tk.split_at(",", right[0]) if right else []
        plain = all([token.kind for token in name] == ["name"] for name in names)
        fixed = not {token.text for token in left} & moving and not any(map(tk.moves, values))
        fixed = fixed and all(times[token.text] == 1 for token in left if token.kind == "name")
        if len(names) == len(values) > 1 and plain and fixed and all(values):
            equal = next(token for token in part if token.is_operator("="))
            part = _joined(
                [
                    [
                        *(replace(one, column=value[0].column - 1) for one in (name[0], equal)),
                        *value,
                    ]
                    for name, value in zip(names, values, strict=True)
                ]
            )
        found += [*part, *([end] if end else [])]
    return found


def _by_rule(tokens: Tokens, names: Names) -> Tokens | None:
    rules = (
        _of_handle,
        _of_pairs,
        _of_second_rates,
        _of_rates,
        _of_single_rates,
        _of_short_rates,
        _of_lists,
        _of_list,
        _of_other_array,
        _of_first,
        _of_expressions,
    )
    return next((found for rule in rules if (found := rule(tokens, names)) is not None), None)


def _is_value(statement: Tokens) -> bool:
    """Whether this is g = 9.81 or r = sqrt(x^2 + y^2), the value of a name."""
    name, equal, rest = at(statement, 0), at(statement, 1), statement[2:]
    named = name.kind == "name" and not name.order and equal.is_operator("=")
    listed = at(rest, 0).is_bracket("[") or at(rest, 0).is_bracket("{")
    calls = any(token.text in _ARRAYS or token.is_operator("@", "=") for token in tk.walk(rest))
    return named and bool(rest) and not (listed or calls or tk.moves(rest))


def _without_repeated(tokens: Tokens) -> Tokens:
    """The tokens without phi_dot = der(phi), der(phi) = phi_dot, and D2x = diff(x, t, 2), which only say what a name of
    a derivative means.
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
    is given. The names that such lines give are added to `derived`.
    """
    name, rest = at(line, 0), line
    named = name.kind == "name" and at(line, 1).is_operator("=")
    if named:
        rest = line[2:]
    if tk.spelled(rest[-2:]) == "=0":
        rest = rest[:-2]
    while len(rest) == 1 and rest[0].is_bracket():
        rest = rest[0].inside
    parts = [part for part in tk.split_at("+-", rest) if part]
    if not parts or not all(_follows_from_lagrangian(part, derived) for part in parts):
        return False
    if named:
        derived.add((name.text, name.order))
    return True


def _follows_from_lagrangian(line: Line, derived: Collection[tuple[str, int]]) -> bool:
    """Whether this is diff(L, x'), one of the derived names, or a derivative of these by t."""
    while len(line) == 2 and line[0].text in DERIVATIVE_NAMES and line[1].is_bracket():
        line = tk.split_at(",", line[1].inside)[0]
        if at(line, 0).text in _LAGRANGIANS and tk.spelled(line[1:]) in ("", "(t)"):
            return True
    return [token.kind for token in line] == ["name"] and (line[0].text, line[0].order) in derived


def without_identities(tokens: Tokens) -> Tokens:
    """The tokens without the theta' = theta' of d theta/dt = theta', d theta'/dt = f."""
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
    sides = _rates_on_sides(line)
    if sides is None:
        return False
    (name, order), (other, again) = sides
    if (name, order) == (other, again):
        return order == 1
    return {order, again} == {1, 2} and ((other, name) if again == 2 else (name, other)) in rates


def _rates_on_sides(line: Line) -> tuple[tuple[str, int], tuple[str, int]] | None:
    """(x, 1) and (y, 0) of x' = y; None for anything else."""
    sides = tk.split_at("=", line)
    if len(sides) != 2 or any([one.kind for one in side] != ["name"] for side in sides):
        return None
    left, right = sides[0][0], sides[1][0]
    return (left.text, left.order), (right.text, right.order)


def _with_entries(tokens: Tokens) -> tuple[Tokens, dict[str, tuple[str, int]]]:
    """The tokens with u[1] and u[2] for the x and v of x, v = u, beside du[1] = ..., and of
    x = u[1]; v = u[2]; with them (u, 1) by x.
    """
    arrays = {match[1] for name, _, _ in _entries(tokens) if (match := _RATES.fullmatch(name))}
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    called = [_entry_called(part) for part, _ in parts]
    named = [entry[1] for entry in called if entry is not None]
    entries: dict[str, tuple[str, int]] = {}
    found: Tokens = []
    for (part, end), entry in zip(parts, called, strict=True):
        left, *right = tk.split_at("=", part)
        names = tk.split_at(",", left)
        plain = len(names) > 1 and all([t.kind for t in name] == ["name"] for name in names)
        if plain and len(right) == 1 and tk.spelled(right[0]) in arrays:
            array = right[0][0].text
            entries |= {name[0].text: (array, k) for k, name in enumerate(names, 1)}
        elif entry is not None and entry[1] in _PARAMETERS and entry[1] not in arrays:
            continue  # d = p[1] names a parameter
        elif entry is not None and named.count(entry[1]) > 1:
            entries[entry[0]] = entry[1:]
        else:
            found += [*part, *([end] if end else [])]

    def with_entries(line: Line) -> Tokens:
        changed: Tokens = []
        for token in line:
            if token.kind == "name" and not token.order and token.text in entries:
                array, k = entries[token.text]
                index = tk.nested(tk.tokens_in_place(f"[{k}]", token))
                changed += [replace(token, text=array), *index]
            else:
                changed.append(tk.within(token, with_entries))
        return changed

    return with_entries(found) if len(found) < len(tokens) else tokens, entries


class NamedEntry(NamedTuple):
    """name = array[place]."""

    name: str
    array: str
    place: int


def _entry_called(statement: Tokens) -> NamedEntry | None:
    """(x, u, 1) for x = u[1]."""
    name, sign, array = (at(statement, place) for place in range(3))
    index = _index(statement, 2)
    plain = name.kind == array.kind == "name" and not name.order and len(statement) == 4
    if not plain or index is None or not sign.is_operator("=") or array.text in FUNCTIONS:
        return None
    return NamedEntry(name.text, array.text, index)


def _with_given_names(tokens: Tokens, given: Mapping[str, str]) -> Tokens:
    """The equations with the writer's x for the entry u_1 of an array, if x has no other meaning."""
    if {*given.values()} & {token.text for token in tk.walk(tokens)}:
        return tokens

    def with_names(line: Line) -> Tokens:
        return [
            replace(token, text=given[token.text])
            if token.kind == "name" and token.text in given
            else tk.within(token, with_names)
            for token in line
        ]

    return with_names(tokens)


def _with_named_components(
    others: list[Tokens], values: list[Tokens]
) -> tuple[list[Tokens], list[Tokens]]:
    """[omega, -sin(theta)] for the [dtheta, domega] of dtheta = omega; domega = -sin(theta), and
    the values that no list has.
    """
    given = {part[0].text: part[2:] for part in values}
    put = set[str]()

    def with_values(line: Line) -> Tokens:
        found: Tokens = []
        for part, end in tk.split(line, lambda _, token: token.is_operator(",", ";")):
            name = part[0].text if [token.kind for token in part] == ["name"] else ""
            put.update([name] * (name in given))
            found += [*given.get(name, part), *([end] if end else [])]
        return found

    found = []
    for part in others:
        whole = at(part, len(part) - 1)
        listed = whole.is_bracket("[") and len(part) in (1, 3)
        found.append([*part[:-1], tk.within(whole, with_values)] if listed else part)
    return found, [part for part in values if part[0].text not in put]


def _with_time(tokens: Tokens, names: Names) -> Tokens:
    """The tokens with t for the time of Modelica."""
    words = {token.text for token in tk.walk(tokens)}
    if "der" not in words or "time" not in words or names.role("time"):
        return tokens

    def with_time(line: Line) -> Tokens:
        return [
            replace(token, text="t")
            if token.kind == "name" and token.text == "time"
            else tk.within(token, with_time)
            for token in line
        ]

    return with_time(tokens)


def _with_operators(tokens: Tokens) -> Tokens:
    """The tokens with Differential(s)(u) for the D(u) of a text with D = Differential(s)."""
    kept: list[tuple[Tokens, Token | None]] = []
    operators: dict[str, Token] = {}
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        given = len(part) == 4 and part[1].is_operator("=") and part[2].text == "Differential"
        if given and part[3].is_bracket() and len(part[3].inside) == 1:
            tk.note(tk.source(part))
            operators[part[0].text] = part[3]
        else:
            kept.append((part, end))
    if not operators:
        return tokens

    def with_operators(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            by = operators.get(token.text) if at(line, place + 1).is_bracket() else None
            if by is None or token.kind == "bracket":
                found.append(tk.within(token, with_operators))
                continue
            name = replace(token, kind="name", text="Differential", value=Fraction(0))
            found += [name, replace(by, column=token.column, end=token.column)]
        return found

    line = [token for part, end in kept for token in [*part, *([end] if end else [])]]
    return with_operators(line)


def _without_solver(tokens: Tokens) -> Tokens:
    """The handle in [t, y] = ode45(@(t, y) [...], [0 10], [1; 0]), and the pairs in
    taylor_adaptive(sys, [...]).
    """
    place = next((k for k, token in enumerate(tokens) if token.text in _SOLVERS), None)
    call = at(tokens, len(tokens) if place is None else place + 1)
    handle = at(call.inside, 0).is_operator("@") or at(tokens, place or 0).text == _TAYLOR
    if place is None or not call.is_bracket() or not handle:
        return tokens
    first, *more = tk.split_at(",", call.inside)
    for part in (tokens[: place + 1], *more):
        tk.note(tk.source(part))
    return first


def _with_first_differences(tokens: Tokens) -> Tokens:
    """x' for MATLAB's diff(x) in a text that has its diff(x, 2)."""
    shapes = {
        (line[place].text, *(token.kind for token in at(line, place + 1).inside))
        for line, place, _ in tk.places(tokens)
        if not at(line, place - 1).is_operator(".")  # x.diff(t, 2)
    }
    if ("diff", "name", "operator", "number") not in shapes:
        return tokens

    def with_primes(line: Line) -> Tokens:
        found: Tokens = []
        for token in line:
            name = at(token.inside, 0)
            single = token.is_bracket() and len(token.inside) == 1 and name.kind == "name"
            if single and found and found[-1].text == "diff" and not token.order:
                found[-1] = replace(name, order=1, primed=name.column, space_before=True)
            else:
                found.append(tk.within(token, with_primes))
        return found

    return with_primes(tokens)


def with_primes_before_time(tokens: Line) -> Tokens:
    """x''(t) for x(t)'' and x[t]''."""
    found: Tokens = []
    for token in tokens:
        timed = token.kind == "bracket" and token.order and tk.spelled(token.inside) == "t"
        if timed and found and found[-1].kind == "name" and not found[-1].order:
            name = found.pop()
            found.append(replace(name, order=token.order, primed=token.primed))
            token = replace(token, order=0, primed=0)
        found.append(tk.within(token, with_primes_before_time))
    return found


def with_dots(tokens: Line, names: Names) -> Tokens:
    """x'' for AsciiMath's ddot x and for ddot(x)."""
    found: Tokens = []
    mark: Token | None = None
    for place, token in enumerate(tokens):
        following = at(tokens, place + 1)
        whole = following.inside[0] if len(following.inside) == 1 else following
        if (
            token.text in _DOTS
            and whole.kind == "name"
            and not (whole.order or names.role(token.text))
        ):
            mark = token
        elif mark is not None:
            name = token.inside[0] if token.inside else token
            order = _DOTS[mark.text]
            found.append(replace(name, order=order, primed=mark.column, space_before=True))
            mark = None
        else:
            found.append(tk.within(token, lambda inside: with_dots(inside, names)))
    return found


def _of_second_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """ddu[1] = -k*u[1], with du[1] for its rate."""
    statements = _statements(tokens)
    found: list[Tokens] = []
    for statement in statements:
        match = _SECOND_RATES.fullmatch(at(statement, 0).text)
        index = _index(statement, 0)
        if match is None or index is None or not at(statement, 2).is_operator("="):
            return None
        array = _Array.of(match[1], tokens)
        head = Token("name", array.entry(index), statement[0].column, True)
        head = replace(head, order=2, primed=head.column)
        body = _with_rates(array.with_names(statement[3:]), array)
        found.append([head, statement[2], *body])
    return _joined(found) if found else None


def _with_rates(line: Line, array: "_Array") -> Tokens:
    """The tokens with u_1' for du[1]."""
    found: Tokens = []
    for place, token in enumerate(line):
        index = _index(line, place - 1)
        if index is not None and found and line[place - 1].text == f"d{array.name}":
            name = replace(line[place - 1], text=array.entry(index), order=1)
            found[-1] = replace(name, primed=name.column)
        else:
            found.append(tk.within(token, lambda inside: _with_rates(inside, array)))
    return found


def _of_single_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dxdt = v; dvdt = -x, a rate for each name."""
    statements = _statements(tokens)
    rates = [_SINGLE.fullmatch(at(one, 0).text) for one in statements]
    held = {token.text for token in tk.walk(tokens)}
    if len(statements) < 2 or not all(rate and rate[1] in held for rate in rates):
        return None
    if any(names.role(one[0].text) or not at(one, 1).is_operator("=") for one in statements):
        return None
    pairs = zip(statements, rates, strict=True)
    return _joined([[*_rate(one[0], rate[1]), *one[2:]] for one, rate in pairs if rate])


def _of_short_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dx1 = x2; dx2 = -x1, and dx = [x2; -x1] of x1 and x2: rates without a dt."""
    statements = _statements(tokens)
    held = {token.text for token in tk.walk(tokens)}
    if names.forms or any(not at(one, 1).is_operator("=") for one in statements):
        return None
    if len(statements) == 1:
        statements = _of_numbered(statements[0], held)
    rates = [_SHORT_RATE.fullmatch(one[0].text) for one in statements]
    moving = [rate[1] for rate in rates if rate]
    inside = [token.text for one in statements for token in tk.walk(one[2:])]
    given = all(name in inside and f"d{name}" not in inside for name in moving)
    plain = not any(names.role(one[0].text) for one in statements) and not tk.moves(tokens)
    if len(statements) < 2 or len(moving) < len(statements) or not given or not plain:
        return None
    pairs = zip(statements, moving, strict=True)
    return _joined([[*_rate(one[0], name), *one[2:]] for one, name in pairs])


def _of_numbered(statement: Tokens, held: Collection[str]) -> list[Tokens]:
    """dx1 = x2; dx2 = -x1 for dx = [x2; -x1] and for xdot = [x2; -x1], where x1 and x2 occur."""
    name, equal, whole = statement[0], statement[1], at(statement, 2)
    rate = _RATES.fullmatch(name.text) if len(statement) == 3 and name.kind == "name" else None
    letter = next(filter(None, (rate[1], rate[3])), "") if rate else ""
    parts = _components(whole) if whole.is_bracket("[") else []
    for mark in ("", "_"):
        if parts and all(f"{letter}{mark}{k + 1}" in held for k in range(len(parts))):
            heads = [replace(name, text=f"d{letter}{mark}{k + 1}") for k in range(len(parts))]
            return [[head, equal, *part] for head, part in zip(heads, parts, strict=True)]
    return []


def with_time_below(tokens: Tokens, names: Names) -> Tokens:
    """u'' and u' for u_tt and u_t, where u_tt occurs and no u_xx of a partial equation."""
    words = {token.text for token in tk.walk(tokens) if token.kind == "name"}
    below = {
        word: word.rpartition("_") for word in words if "_" in word[1:] and not names.role(word)
    }
    moving = {head for head, _, by in below.values() if by == "tt"}
    others = {head for head, _, by in below.values() if len({*by}) == 1 < len(by) and by != "tt"}
    others |= {token.text for token in tk.walk(tokens) if token.order}
    orders = {
        word: (head, len(by))
        for word, (head, _, by) in below.items()
        if head in moving - others and {*by} == {"t"}
    }

    def with_orders(line: Line) -> Tokens:
        return [
            replace(
                token, text=orders[token.text][0], order=orders[token.text][1], primed=token.column
            )
            if token.kind == "name" and token.text in orders and not token.order
            else tk.within(token, with_orders)
            for token in line
        ]

    return with_orders(tokens) if orders and moving - others else tokens


def without_labels(tokens: Tokens, names: Names) -> Tokens:
    """The tokens without the eqn = of eqn = diff(x, t, 2) == -x, the ode := of ode := x'' + x, and
    the a, b = of a, b = Eq(...), Eq(...).
    """
    found: Tokens = []
    first = next((place for place, token in enumerate(tokens) if token.is_operator("=")), 0)
    labels, calls = tk.split_at(",", tokens[:first]), tk.split_at(",", tokens[first + 1 :])
    if len(labels) > 1 and len(labels) == len(calls) and all(map(_is_equation_call, calls)):
        tk.note(f"{tk.source(tokens[:first])} =")
        return tokens[first + 1 :]
    for line, end in tk.split(tokens, lambda _, token: token.is_operator(";", ",")):
        label, equal, rest = at(line, 0), at(line, 1), line[2:]
        plain = label.kind == "name" and not label.order and equal.is_operator("=")
        second = any(token.is_operator("=") and token.value == tk.EQUALITY for token in rest)
        second = second or _is_equation_call(rest) or _is_solver_call(rest)
        if plain and second and not equal.value:
            tk.note(f"{label.text} =")
            line = rest
        elif plain and _labels_expression(label, equal, rest, tokens, names):
            tk.note(f"{label.text} {'=' if equal.value != tk.GIVEN else ':='}")
            line = rest
        found += [*line, *([end] if end else [])]
    return found


def _labels_expression(label: Token, equal: Token, rest: Line, text: Line, names: Names) -> bool:
    """Whether a name is the label of an expression that is zero: ode := x'' + x and eom = m x'' +
    k x, but not F = m x''.
    """
    if equal.value != tk.GIVEN and not _LABEL.fullmatch(label.text):
        return False
    whole = rest[0].inside if len(rest) == 1 and rest[0].kind == "bracket" else rest
    parts = tk.split_at(",", whole)  # {x'' + x, x(0) = 1} has an initial value
    inside = [token for part in parts if not _is_at_a_number(part) for token in tk.walk(part)]
    moves = any(token.order > 1 or token.text in _DERIVATIVES for token in inside)
    equals = any(token.is_operator("=", *tk.COMPARED) for token in inside)
    if not moves or equals or names.role(label.text):
        return False
    return sum(token.text == label.text for token in tk.walk(text)) == 1


def _is_at_a_number(line: Line) -> bool:
    """Whether this is x(0) = 1, D(x)(0) = 1, or x'(0) = 1."""
    place = next((k for k, token in enumerate(line) if token.is_operator("=")), 0)
    point = at(line, place - 1)
    return point.is_bracket() and [one.kind for one in point.inside] == ["number"]


def without_commands(tokens: Tokens) -> Tokens:
    """The tokens without statements such as dsolve(ode, x(t)) and sol = ode2(eq1, y, x), which only
    name the equations that are given before them, and without Dx = diff(x, t).
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    moving = [
        any(token.order or token.text in _DERIVATIVES for token in tk.walk(line))
        for line, _ in parts
    ]
    found: Tokens = []
    for (line, end), moves in zip(parts, moving, strict=True):
        place = next((k + 1 for k, token in enumerate(line[:3]) if token.is_operator("=")), 0)
        called = line[place + 2 * at(line, place + 1).is_operator(".") :]  # sp.dsolve
        command = at(called, 0).text in _COMMANDS and len(called) == 2
        names_rate = place == 2 and at(called, 0).text == "diff" and len(called) == 2
        names_rate = names_rate and at(line, 0).text == f"D{at(called[1].inside, 0).text}"
        if any(moving) and (names_rate or (command and not moves and called[1].is_bracket())):
            tk.note(tk.source(line))
            line = []
        found += [*line, *([end] if end else [])]
    return found


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


def _with_primes(tokens: Tokens, names: Names) -> Tokens:
    """x'' for MATLAB's D2x and for the ddx, xdd, and x_dd of code, and in a text that has one of
    them x' for Dx, dx, xd, and x_d.
    """
    inside = [*tk.walk(tokens)]
    moves = any(token.order > 1 or token.text in _DERIVATIVES for token in inside)
    words = {token.text for token in inside if token.kind == "name"}
    rates = dict[str, tuple[str, int]]()
    for shape in _SHORT[: 1 if moves else None]:
        read = _rates_of_shape(shape, words)
        rates |= {word: rate for word, rate in read.items() if not names.role(word)}

    def with_primes(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            name, order = rates.get(token.text, ("", 0)) if token.kind == "name" else ("", 0)
            if order and not token.order and _index(line, place) is None:
                found.append(replace(token, text=name, order=order, primed=token.column))
            else:
                found.append(tk.within(token, with_primes))
        return found

    return with_primes(tokens) if rates else tokens


def _rates_of_shape(shape: re.Pattern[str], words: Collection[str]) -> dict[str, tuple[str, int]]:
    """The name and the order of each word that denotes a derivative; none without a second one."""
    marked = {word: match for word in words if (match := shape.fullmatch(word))}
    orders = {
        word: (
            match["name"],
            int(match["mark"][1:]) if match["mark"][1:].isdigit() else len(match["mark"]),
        )
        for word, match in marked.items()
    }
    first = {name for name, order in orders.values() if order == 1}
    plain = shape is not _SHORT[0]  # ddx only next to x or dx
    second = {
        name
        for name, order in orders.values()
        if order > 1 and (not plain or name in first | {*words})
    }
    known = second | ({*words} if second else set())
    return {
        word: rate for word, rate in orders.items() if rate[0] in (second if rate[1] > 1 else known)
    }


def _statements(tokens: Tokens) -> list[Tokens]:
    return [part for part in tk.split_at(";,", tokens) if part]


def _joined(statements: Sequence[Tokens]) -> Tokens:
    found: Tokens = []
    for statement in statements:
        if found:
            last = found[-1]
            end = last.end + 1 if last.kind == "bracket" else last.span[1]
            found.append(Token("operator", ";", end))
        found += statement
    return found


def _rate(name: Token, text: str, order: int = 0) -> Tokens:
    """text' = at the place of a token, or text'' = for the rate of text'."""
    primed = Token(
        "name", text, name.column, name.space_before, order=order + 1, primed=name.column
    )
    return [primed, Token("operator", "=", name.column, True)]


@dataclass(frozen=True, slots=True)
class _Array:
    """The name of an array of unknowns and its first index, 0 or 1."""

    name: str
    first: int

    @classmethod
    def of(cls, name: str, tokens: Line) -> "_Array":
        """The array of this name in the tokens: y[0] occurs only where indices begin at 0."""
        indices = {index for other, index, _ in _entries(tokens) if other == name}
        return cls(name, 0 if 0 in indices else 1)

    def entry(self, place: int) -> str:
        return f"{self.name}_{place - self.first + 1}"

    def with_names(self, line: Line) -> Tokens:
        """The tokens with the name y_1 for the entry y(1) or y[1]."""
        found: Tokens = []
        for place, token in enumerate(line):
            if (
                found
                and (index := _index(line, place - 1)) is not None
                and line[place - 1].text == self.name
            ):
                found[-1] = replace(
                    line[place - 1], text=self.entry(index), order=token.order, primed=token.primed
                )
            else:
                found.append(tk.within(token, self.with_names))
        return found


def _index(line: Line, place: int) -> int | None:
    """The k of the y(k), y[k], or y(k, 1) here; else None."""
    name, bracket = at(line, place), at(line, place + 1)
    inside = [part for part in tk.split_at(",", bracket.inside) if part]
    if name.kind != "name" or name.order or bracket.kind != "bracket" or not inside:
        return None
    column = [tk.spelled(part) for part in inside[1:]] in ([], ["1"])
    plain = column and len(inside[0]) == 1 and inside[0][0].kind == "number"
    return int(inside[0][0].text) if plain and inside[0][0].text.isdigit() else None


def _entries(tokens: Line) -> Iterator[tuple[str, int, Token]]:
    """(y, k, token) for every y(k) and y[k]."""
    for line, place, _ in tk.places(tokens):
        if (index := _index(line, place)) is not None:
            yield line[place].text, index, line[place]


def _components(bracket: Token) -> list[Tokens]:
    """The entries of [a; b], [a, b], and [a b;...]; none where they are not clear."""
    signs = {token.text for token in bracket.inside if token.is_operator(";", ",")}
    return [part for part in tk.split_at(";,", bracket.inside) if part] if len(signs) == 1 else []


def _of_array(array: _Array, components: list[Tokens]) -> Tokens:
    """y_1' = first; y_2' = second; ..."""
    return _joined(
        [
            [*_rate(part[0], array.entry(place)), *array.with_names(part)]
            for place, part in enumerate(components, array.first)
        ]
    )


def _of_handle(tokens: Tokens, names: Names) -> Tokens | None:
    """@(t, y) [y(2); -y(1)], perhaps after f = ."""
    place = next((k for k, token in enumerate(tokens) if token.is_operator("@")), len(tokens))
    arguments, body = at(tokens, place + 1), at(tokens, place + 2)
    before = tk.spelled(tokens[:place])
    given = [token.text for token in arguments.inside if not token.is_operator(",")]
    after = tk.spelled(tokens[place + 3 :]).strip(";")
    timed = len(given) > 1 and (
        given[0] == "t" or given[0] not in {token.text for token in tk.walk([body])}
    )
    if not timed or not body.is_bracket("[") or after or not re.fullmatch(r"(\w+'*=)?", before):
        return None
    components = _components(body)
    array = _Array.of(given[1], body.inside)
    if len(components) < 2:
        return None
    tk.note(tk.source(tokens[: place + 2]))
    return _of_array(array, components)


def _of_pairs(tokens: Tokens, names: Names) -> Tokens | None:
    """[(x, v), (v, -sin(x))], perhaps after sys = ."""
    labelled = at(tokens, 0).kind == "name" and at(tokens, 1).is_operator("=")
    whole = at(tokens, 2 * labelled)
    listed = whole.inside if whole.is_bracket("[") and len(tokens) == 2 * labelled + 1 else ()
    pairs = [
        part[0].inside
        for part in tk.split_at(",", listed)
        if len(part) == 1 and part[0].is_bracket()
    ]
    halves = [[half for half in tk.split_at(",", pair) if half] for pair in pairs]
    if (
        len(halves) < 2
        or len(halves) != len(tk.split_at(",", listed))
        or any(len(half) != 2 for half in halves)
    ):
        return None
    if any(len(first) != 1 or first[0].kind != "name" or first[0].order for first, _ in halves):
        return None
    return _joined([[*_rate(first[0], first[0].text), *rate] for first, rate in halves])


def _of_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dydt(1) = y(2); dydt(2) = ..., and dydt = [y(2); ...]."""
    statements = _statements(tokens)
    arrays = {name for name, _, _ in _entries(tokens)}
    found: list[Tokens] = []
    for statement in statements:
        match = _RATES.fullmatch(statement[0].text) if statement[0].kind == "name" else None
        name = next(filter(None, (match[1], match[3])), "") if match else ""
        by = match["by"] if match else None
        if by not in (None, "t") and by in {token.text for token in tk.walk(tokens)}:
            return None  # dydx(1) = x*y(2), where x is the time
        index = _index(statement, 0)
        sign, body = at(statement, 1 + (index is not None)), statement[2 + (index is not None) :]
        if at(body, 0).text in _ARRAYS[2:] and len(body) == 2:
            continue  # dydt = zeros(2, 1)
        if (
            name not in arrays
            or names.role(statement[0].text)
            or not sign.is_operator("=")
            or not body
        ):
            return None
        array = _Array.of(name, tokens)
        if index is not None:
            first = (
                array
                if any(other == name and k == 0 for other, k, _ in _entries(tokens))
                else _Array(name, 1)
            )
            rates = {k for other, k, _ in _entries(tokens) if other == statement[0].text}
            first = _Array(name, 0) if 0 in rates else first
            found.append([*_rate(statement[0], first.entry(index)), *first.with_names(body)])
        elif len(body) == 1 and body[0].kind == "bracket" and (components := _components(body[0])):
            found.append(_of_array(array, components))
        else:
            return None
    return _joined(found) if found else None


def _of_list(tokens: Tokens, names: Names) -> Tokens | None:
    """[y[1], -y[0]] alone, the rates of y; with x, v = y before it, those of x and v."""
    statements = [part for part in tk.split_at(";", tokens) if part]
    if len(statements) > 2:
        return None
    last, unpacked = statements[-1] if statements else [], list[tuple[str, int]]()
    if len(statements) == 2:
        left, *right = tk.split_at("=", statements[0])
        listed = left[0].inside if len(left) == 1 and left[0].is_bracket() else left
        parts = tk.split_at(",", listed)
        if (
            len(right) != 1
            or [token.kind for token in right[0]] != ["name"]
            or any(len(part) != 1 for part in parts)
        ):
            return None
        unpacked = [(part[0].text, part[0].order) for part in parts]
    whole = last[-1] if last else at(last, 0)
    if len(tk.split_at(",", last)) > 1 and not any(token.is_operator("=") for token in last):
        last = [tk.bracket(last, last[0])]  # return y[1], -y[0]
        whole = last[0]
    if (
        [token.text for token in last[:-1]][-1:] == ["array"]
        and whole.is_bracket()
        and len(whole.inside) == 1
    ):
        whole = whole.inside[0]  # np.array([...])
    elif [token.text for token in last[:-1]] == ["SVector"] and whole.is_bracket():
        pass
    elif len(last) != 1 and not (
        len(last) == 3 and last[0].kind == "name" and last[1].is_operator("=")
    ):
        return None
    components = _components(whole) if whole.kind == "bracket" else []
    if len(components) < 2 or any(
        token.is_operator("=") or (token.order and (token.text, token.order) not in unpacked)
        for token in tk.walk([whole])
    ):
        return None
    if unpacked:
        if len(unpacked) != len(components):
            return None
        pairs = zip(unpacked, components, strict=True)
        rates = [(name, part) for name, part in pairs if tk.spelled(part) != f"{name[0]}'"]
        return _joined([[*_rate(part[0], *name), *part] for name, part in rates]) or None
    arrays = {_Array.of(name, whole.inside) for name, _, _ in _entries(whole.inside)}
    sizes = {
        array: max(k for name, k, _ in _entries(whole.inside) if name == array.name)
        for array in arrays
    }
    fitting = [array for array in arrays if sizes[array] - array.first + 1 == len(components)] or [
        *arrays
    ]
    return _of_array(fitting[0], components) if len(fitting) == 1 else None


def _of_lists(tokens: Tokens, names: Names) -> Tokens | None:
    """Maxima's rk([v, -x], [x, v], [1, 0], [t, 0, 10, 0.1])."""
    call = at(tokens, len(tokens) - 1)
    if at(tokens, len(tokens) - 2).text not in _STEPPING or not call.is_bracket():
        return None
    lists = [part[0].inside for part in tk.split_at(",", call.inside)[:2] if len(part) == 1]
    if len(lists) != 2:
        return None
    rates, unknowns = (tk.split_at(",", listed) for listed in lists)
    plain = all(len(name) == 1 and name[0].kind == "name" for name in unknowns)
    if not plain or len(rates) != len(unknowns):
        return None
    for part in tk.split_at(",", call.inside)[2:]:
        tk.note(tk.source(part))
    pairs = zip(unknowns, rates, strict=True)
    return _joined([[*_rate(name[0], name[0].text), *rate] for name, rate in pairs])


def _of_other_array(tokens: Tokens, names: Names) -> Tokens | None:
    """dydx(1) = x(2); dydx(2) = -x(1), the rates of the only other array."""
    statements = _statements(tokens)
    indices = [_index(statement, 0) for statement in statements]
    heads = {at(statement, 0).text for statement in statements}
    equal = all(at(statement, 2).is_operator("=") for statement in statements)
    others = [*dict.fromkeys(name for name, _, _ in _entries(tokens) if name not in heads)]
    others = [name for name in others if not _is_function(name, names)]
    if len(statements) < 2 or None in indices or len(heads) != 1 or not equal or len(others) != 1:
        return None
    inside = {name for statement in statements for name, _, _ in _entries(statement[3:])}
    used = [index for name, index, _ in _entries(tokens) if name == others[0]]
    counted = sorted(index for index in indices if index is not None)
    if heads & inside or counted != [*range(counted[0], counted[0] + len(counted))]:
        return None
    if max(used) > counted[-1] or min(used) < counted[0] or counted[0] > 1:
        return None
    array = _Array(others[0], counted[0])
    return _joined(
        [
            [*_rate(statement[0], array.entry(index)), *array.with_names(statement[3:])]
            for statement, index in zip(statements, indices, strict=True)
            if index is not None
        ]
    )


def _is_function(name: str, names: Names) -> bool:
    return name in FUNCTIONS or names.role(name) == "function"


def _of_first(tokens: Tokens, names: Names) -> Tokens | None:
    """The equations in {{prime(x) = v, prime(v) = -x}, {0.05, 0.025}}, beside numbers."""
    whole = at(tokens, 0)
    parts = tk.split_at(",", whole.inside) if len(tokens) == 1 and whole.is_bracket("{") else []
    if len(parts) < 2 or any(len(part) != 1 or not part[0].inside for part in parts):
        return None
    equal = [any(token.is_operator("=") for token in part[0].inside) for part in parts]
    if equal != [True] + [False] * (len(parts) - 1):
        return None
    for part in parts[1:]:
        tk.note(tk.source(part))
    return [*parts[0][0].inside]


def _of_expressions(tokens: Tokens, names: Names) -> Tokens | None:
    """(x'' + x, y'' + y) and [x'' + x, y'' + y], lists of expressions that are zero; initial values
    beside them are left out.
    """
    whole = at(tokens, 0)
    if len(tokens) != 1 or whole.kind != "bracket" or whole.order:
        return None
    every = tk.split_at(",", whole.inside)
    parts = [part for part in every if not _is_at_a_number(part)]
    second = [
        any(token.order > 1 or token.text in DERIVATIVE_NAMES for token in tk.walk(part))
        for part in parts
    ]
    equal = any(token.is_operator("=") for part in parts for token in tk.walk(part))
    if equal or len(every) < 2 or not (parts and all(second)):
        return None
    for part in every:
        if part not in parts:
            tk.note(tk.source(part))
    return _joined(parts)
