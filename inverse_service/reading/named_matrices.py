r"""Matrices with names, M q'' + K q = 0 with M = [[2, 0], [0, 1]]: tokens in, tokens out.

A matrix is a list of rows of Python, [2 0; 0 1] of MATLAB, {{2, 0}, {0, 1}} of Mathematica, a
pmatrix of LaTeX, or diag(2, 1). The vector that it multiplies has the components q_1, q_2, ... unless the text
gives others, q = (x, y). `components` makes rows of what is found here.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

from inverse_service.reading import tokens as tk
from inverse_service.reading.names import FUNCTIONS, Names
from inverse_service.reading.tokens import MATRIX, Line, Token, Tokens, at

# Matrix([[2, 0], [0, 1]]) and np.array([[2, 0], [0, 1]])
_LISTS = frozenset(("Matrix", "ImmutableMatrix", "matrix", "array"))
# M q'' + K q = 0 where M = ... and K = ...
_JOINS = (*tk.JOINING, *tk.CONDITIONAL)
_DIAGONALS = frozenset(("diag", "diagonal", "diag_matrix", "DiagonalMatrix"))
_Rows = list[list[Tokens]]


def with_matrices(tokens: Tokens, names: Names) -> Tokens:
    """The statements with each named matrix in the place of its name, and q = (q_1, ..., q_n) for
    the vectors that it multiplies.
    """
    if not any(
        token.is_bracket("[") or token.is_bracket("{") or token.text in _DIAGONALS
        for token in tk.walk(tokens)
    ):
        return tokens
    parts = tk.split(
        tokens,
        lambda place, token: (
            token.is_operator(";", ",")
            or (token.text in _JOINS and bool(_given(_statement(tokens, place + 1))))
        ),
    )
    rows = [_given(part) for part, _ in parts]
    given = {part[0].text: one for (part, _), one in zip(parts, rows, strict=True) if one}
    square = {name: one for name, one in given.items() if len(one[0]) > 1}
    kept = [part for (part, _), one in zip(parts, rows, strict=True) if part and not one]
    sums = {part[0].text: part[2:] for part in kept if _is_sum(part, square)}
    whole = (_with_names_apart(part, {**square, **sums}) for part in kept)
    kept = [_with_sums(part, sums) for part in whole if at(part, 0).text not in sums]
    vectors = dict.fromkeys(name for part in kept for name in _multiplied(part, square))
    if not vectors or any(map(names.role, given)):
        return tokens
    sizes = {len(one[0]) for one in square.values()}
    columns = {name: [row[0] for row in one] for name, one in given.items() if name not in square}
    if len(sizes) > 1 and not {*vectors} <= {*columns}:
        return tokens
    for name in vectors:
        if name not in columns and not any(_is_list(part, name) for part in kept):
            columns[name] = _components(name, max(sizes), kept)
    used = {token.text for part in kept for token in tk.walk(part)}
    statements = [_with_rows(part, square) for part in kept]
    statements += [
        _list(name, column, kept[-1][-1]) for name, column in columns.items() if name in used
    ]
    return _joined(statements, ";")


def _statement(tokens: Tokens, start: int) -> Tokens:
    """The tokens from a place on to the end of a statement."""
    rest = tokens[start:]
    stop = next(
        (k for k, one in enumerate(rest) if one.is_operator(";", ",") or one.text in _JOINS),
        len(rest),
    )
    return rest[:stop]


def _given(part: Tokens) -> _Rows:
    """The rows of the matrix or column of a statement M = ...; none for another statement."""
    name, equal = at(part, 0), at(part, 1)
    if name.kind not in ("name", "vector") or name.order or not equal.is_operator("="):
        return []
    rest = part[2:]
    while (
        len(rest) > 1
        and rest[0].kind in ("name", "operator")
        and (rest[0].text in _LISTS or at(rest, 1).is_operator(".") or rest[0].is_operator("."))
    ):
        rest = rest[1:]
    whole, length = at(rest, len(rest) - 1), 1
    if at(rest, len(rest) - 2).text in _DIAGONALS and whole.kind == "bracket":
        whole, length = _diagonal(whole), 2
    if len(rest) == 1 and whole.is_bracket() and len(whole.inside) == 1:  # array([[...]])
        whole = whole.inside[0]
    listed = whole.is_bracket("[") or whole.is_bracket("{")
    scalar = rest[:-length]
    if not (listed and _is_scalar(scalar)) or whole.order:
        return []
    rows = [[_scaled(scalar, cell) for cell in _cells(row)] for row in _lines(whole)]
    if len(rows) == 1:
        rows = [[cell] for cell in rows[0]]  # F = [f1, f2]
    equal_lengths = len({len(row) for row in rows}) == 1 and len(rows) > 1
    plain = all(
        cell and not any(one.is_operator("=") for one in cell) for row in rows for cell in row
    )
    return rows if equal_lengths and plain else []


def _is_scalar(before: Tokens) -> bool:
    """Whether a matrix has a factor before it, k, k/m, or (k/m)*, or none."""
    signs = [one.text for one in before if one.kind == "operator"]
    if not before:
        return True
    factors = before[:-1] if before[-1].is_operator("*") else before
    return (
        bool(factors)
        and factors[-1].kind != "operator"
        and all(one.kind in ("name", "number", "operator") or one.is_bracket() for one in before)
        and {*signs} <= {"*", "/", "^"}
        and not any(one.text in FUNCTIONS or one.order for one in before)
    )


def _scaled(scalar: Tokens, cell: Tokens) -> Tokens:
    """A cell times the factor of its matrix."""
    if not scalar or tk.spelled(cell) == "0":
        return cell
    factor = scalar[:-1] if scalar[-1].is_operator("*") else scalar
    times = Token("operator", "*", cell[0].column) if cell else None
    return [tk.bracket(factor, factor[0]), times, tk.bracket(cell, cell[0])] if times else []


def _diagonal(given: Token) -> Token:
    """The matrix of diag(a, b), diag([a, b]), and DiagonalMatrix[{a, b}]."""
    entries = given.inside
    if len(entries) == 1 and entries[0].kind == "bracket":
        entries = entries[0].inside
    cells, zero = [*_cells(entries)], [tk.number_token("0", given.column, False)]
    rows = [
        _joined([cell if k == row else zero for k in range(len(cells))], "&")
        for row, cell in enumerate(cells)
    ]
    return replace(given, text="[", inside=tuple(_joined(rows, ";")))


def _lines(whole: Token) -> Iterator[Line]:
    """The rows of a matrix, each with its separators."""
    parts = tk.split_at(",", whole.inside)
    if all(len(part) == 1 and part[0].is_bracket(whole.text) for part in parts):
        yield from (part[0].inside for part in parts)
    else:
        yield from (row for row in tk.split_at(";", whole.inside) if row)


def _cells(row: Line) -> Iterator[Tokens]:
    """The entries of a row, between commas, between & of LaTeX, or between blanks."""
    for sign in ("&", ","):
        if any(token.is_operator(sign) for token in row):
            yield from tk.split_at(sign, row)
            return
    cell: Tokens = []
    for place, token in enumerate(row):
        signed = token.is_operator("+", "-") and not at(row, place + 1).space_before
        apart = token.space_before and (token.kind != "operator" or signed)
        if cell and apart and cell[-1].kind != "operator":
            yield cell
            cell = []
        cell.append(token)
    yield cell


def _with_names_apart(line: Line, matrices: Container[str]) -> Tokens:
    """The line with K x for Kx, and q^T K q for q^TKq, where K is a matrix."""
    found: Tokens = []
    for token in line:
        raised = token.text[:1] == "T" and at(found, len(found) - 1).is_operator("^")
        start = 1 if raised and token.text[1:2] in matrices else 0
        rest = token.text[start + 1 :]
        is_run = token.kind == "name" and token.text not in matrices and rest.isalpha()
        if not (is_run and token.text[start] in matrices):
            found.append(tk.within(token, lambda inside: _with_names_apart(inside, matrices)))
            continue
        parts = [*token.text[: start + 1], rest]
        column, places = token.column, list[int]()
        for part in parts:
            places.append(column)
            column += len(part)
        cut = [
            replace(
                token, text=part, column=place, order=0, primed=0, space_before=place > places[0]
            )
            for part, place in zip(parts, places, strict=True)
        ]
        found += [*cut[:-1], replace(cut[-1], order=token.order, primed=token.primed)]
    return found


def _multiplied(line: Line, matrices: Container[str]) -> Iterator[str]:
    """The vectors that these matrices multiply in a statement."""
    for inside, place, _ in tk.places(line):
        if inside[place].text not in matrices or inside[place].order:
            continue
        after = place + 1 + at(inside, place + 1).is_operator("*", ".")
        name = at(inside, after)
        if (
            name.kind in ("name", "vector")
            and name.text not in FUNCTIONS
            and name.text not in matrices
        ):
            yield name.text


def _is_sum(part: Line, matrices: Container[str]) -> bool:
    """Whether a statement gives a matrix by others: C = a M + b K."""
    name, equal = at(part, 0), at(part, 1)
    if name.kind not in ("name", "vector") or name.order or not equal.is_operator("="):
        return False
    right = [*tk.walk(part[2:])]
    return any(one.text in matrices for one in right) and not any(
        one.order or one.is_operator("=") or one.text == name.text for one in right
    )


def _with_sums(line: Line, sums: Mapping[str, Tokens]) -> Tokens:
    return [
        tk.bracket(sums[token.text], token)
        if token.kind in ("name", "vector") and token.text in sums and not token.order
        else tk.within(token, lambda inside: _with_sums(inside, sums))
        for token in line
    ]


def _is_list(part: Line, name: str) -> bool:
    """Whether a statement gives the components of a name: q = (x, y)."""
    return tk.spelled(part[:2]) == f"{name}=" and at(part, 2).is_bracket() and len(part) == 3


def _components(name: str, size: int, kept: Sequence[Line]) -> list[Tokens]:
    """q_1, q_2, ..., which are noted."""
    first = next(token for part in kept for token in tk.walk(part) if token.text == name)
    texts = [f"{name}_{k}" for k in range(1, size + 1)]
    tk.note(name, f"({', '.join(texts)})")
    return [[Token("name", text, first.column)] for text in texts]


def _with_rows(line: Line, matrices: Mapping[str, _Rows]) -> Tokens:
    """The line with each matrix in the place of its name, and without the dot of M.q."""
    return [
        _matrix(token, matrices[token.text])
        if token.kind in ("name", "vector") and token.text in matrices and not token.order
        else tk.within(token, lambda inside: _with_rows(inside, matrices))
        for place, token in enumerate(line)
        if not (token.is_operator(".") and at(line, place - 1).text in matrices)
    ]


def _matrix(name: Token, rows: _Rows) -> Token:
    inside = _joined([_joined(row, "&") for row in rows], ";")
    moved = [replace(token, column=name.column) for token in inside]
    return replace(
        name, kind="bracket", text="[", inside=tuple(moved), end=name.column, value=MATRIX
    )


def _list(name: str, column: Sequence[Line], last: Token) -> Tokens:
    """The statement q = (q_1, q_2), whose column is that of the last sign of the text."""
    sign = replace(last, kind="operator", text="=", inside=(), order=0, value=last.value * 0)
    whole = tk.bracket(_joined(column, ","), last)
    return [replace(sign, kind="name", text=name), sign, whole]


def _joined(parts: Sequence[Line], sign: str) -> Tokens:
    found: Tokens = []
    for part in parts:
        if found and part:
            found.append(Token("operator", sign, part[0].column))
        found += part
    return found
