r"""Matrices with names, M q'' + K q = 0 with M = [[2, 0], [0, 1]]: tokens in, tokens out.

A matrix is a list of rows of Python, [2 0; 0 1] of MATLAB, {{2, 0}, {0, 1}} of Mathematica, or a
pmatrix of LaTeX. The vector that it multiplies has the components q_1, q_2, ... unless the text
gives others, q = (x, y). `components` makes rows of what is found here.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

from inverse_service.reading import tokens as tk
from inverse_service.reading.names import FUNCTIONS, Names
from inverse_service.reading.tokens import MATRIX, Line, Token, Tokens, at

# Matrix([[2, 0], [0, 1]]) and np.array([[2, 0], [0, 1]])
_LISTS = frozenset(("Matrix", "ImmutableMatrix", "matrix", "array"))
_Rows = list[list[Tokens]]


def with_matrices(tokens: Tokens, names: Names) -> Tokens:
    """The statements with each named matrix in the place of its name, and q = (q_1, ..., q_n) for
    the vectors that it multiplies.
    """
    if not any(token.is_bracket("[") or token.is_bracket("{") for token in tk.walk(tokens)):
        return tokens
    parts = tk.split(tokens, lambda _, token: token.is_operator(";", ","))
    rows = [_given(part) for part, _ in parts]
    given = {part[0].text: one for (part, _), one in zip(parts, rows, strict=True) if one}
    square = {name: one for name, one in given.items() if len(one[0]) > 1}
    kept = [part for (part, _), one in zip(parts, rows, strict=True) if part and not one]
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
    whole = at(rest, 0)
    if len(rest) == 1 and whole.is_bracket() and len(whole.inside) == 1:  # array([[...]])
        whole = whole.inside[0]
    listed = whole.is_bracket("[") or whole.is_bracket("{")
    if len(rest) != 1 or not listed or whole.order:
        return []
    rows = [[*_cells(row)] for row in _lines(whole)]
    if len(rows) == 1:
        rows = [[cell] for cell in rows[0]]  # F = [f1, f2]
    equal_lengths = len({len(row) for row in rows}) == 1 and len(rows) > 1
    plain = all(
        cell and not any(one.is_operator("=") for one in cell) for row in rows for cell in row
    )
    return rows if equal_lengths and plain else []


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


def _multiplied(line: Line, matrices: Container[str]) -> Iterator[str]:
    """The vectors that these matrices multiply in a statement."""
    for inside, place, _ in tk.places(line):
        if inside[place].text not in matrices or inside[place].order:
            continue
        after = place + 1 + at(inside, place + 1).is_operator("*")
        name = at(inside, after)
        if (
            name.kind in ("name", "vector")
            and name.text not in FUNCTIONS
            and name.text not in matrices
        ):
            yield name.text


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
    """The line with each matrix in the place of its name."""
    return [
        _matrix(token, matrices[token.text])
        if token.kind in ("name", "vector") and token.text in matrices and not token.order
        else tk.within(token, lambda inside: _with_rows(inside, matrices))
        for token in line
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
