r"""Split matrices and vectors of LaTeX into components: tokens in, tokens out, one equation for each row.

\begin{pmatrix} a & b \\ c & d \end{pmatrix} comes as [a & b; c & d], times columns; \mathbf{r} or \vec{r} as a token of
the kind "vector", where an equation gives its components, \mathbf{r} = (x, y, z), with dots, |r|, r^2, \cdot and
\times. A scalar before or after multiplies each row.
"""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.refusals import refusal
from inverse_service.reading import tokens as tk
from inverse_service.reading.tokens import Token, Tokens, bracket

MATRICES = ("matrix", "pmatrix", "bmatrix")
BOLD = ("mathbf", "boldsymbol", "bm", "pmb", "textbf", "vec", "overrightarrow", "underline")
_SIDES = ("+", "-", "=", ",", ";", "&")
Value = list[list[Tokens]]  # rows of cells; a scalar is one cell


def by_components(tokens: Tokens) -> Tokens:
    """The tokens with each matrix or vector equation replaced by its rows; InputError if shapes differ."""
    if not _holds_many(tokens):
        return tokens
    last = max((place for place, token in enumerate(tokens) if token.is_operator("=")), default=0)
    parts = tk.split(tokens, lambda at, token: token.is_operator(";") or (token.is_operator(",") and at < last))
    statements, vectors = [part for part, _ in parts if part], dict[str, list[Tokens]]()
    for statement in tuple(statements):
        if given := _given(statement):
            vectors[statement[0].text] = given
            statements.remove(statement)
    for name, given in vectors.items():
        if not any(tk.spelled(statement[:2]) == f"{name}=" for statement in statements):
            statements = [_with_length(name, given, statement) for statement in statements]
    found: Tokens = []
    for statement in statements:
        rows = _Reader(statement, vectors, statement[0]).equations() if _holds_many(statement) else [statement]
        for row in rows:
            found += ([Token("operator", ";", row[0].column)] if found and row else []) + row
    return found


def holds_vector(text: str) -> bool:
    """Whether a text may contain a vector."""
    return any(f"\\{command}" in text for command in BOLD)


def _holds_many(tokens: Sequence[Token]) -> bool:
    return any(token.kind == "vector" or token.is_bracket("[") for token in tk.walk(tokens))


def _given(statement: Tokens) -> list[Tokens]:
    r"""The components in \mathbf{r} = (x, y, z), none of which holds a vector; else nothing."""
    kinds = [(token.kind, token.text) for token in statement[1:]]
    whole = statement[0].kind == "vector" and kinds == [("operator", "="), ("bracket", "(")]
    parts = tk.split_at(",", statement[2].inside) if whole and not _holds_many(statement[1:]) else []
    return parts if len(parts) > 1 and all(parts) else []


def _with_length(name: str, parts: list[Tokens], line: Sequence[Token]) -> Tokens:
    """The line with (x^2 + y^2)^(1/2) for a plain r used together with the bold vector r."""
    found: Tokens = []
    for token in line:
        if token.kind != "name" or token.text != name:
            found.append(replace(token, inside=tuple(_with_length(name, parts, token.inside))))
            continue
        root, plus, *power = tk.written("sqrt+^2", token)
        squares = [one for part in parts for one in (plus, *_bracketed(part), *power)][1:]
        length = bracket([root, bracket(squares, token)], token)
        found.append(replace(length, order=token.order, primed=token.primed))
    return found


def _bracketed(cell: Tokens) -> Tokens:
    """The cell as a factor."""
    return cell if len(cell) < 2 else [replace(bracket(cell, cell[0]), end=cell[-1].column)]


def _product_sign(scalar: Tokens) -> Fraction:
    """DOT or CROSS where a sign of LaTeX ends the tokens, else 0."""
    return scalar[-1].value if scalar and scalar[-1].is_operator("*") else Fraction(0)


class _Reader:
    """Reads an equation of matrices and vectors; a value is its rows of cells."""

    def __init__(self, line: Sequence[Token], vectors: dict[str, list[Tokens]], first: Token) -> None:
        self._stream = tk.TokenStream(line, Token("end", "", line[-1].column if line else first.column))
        self._vectors = vectors
        self._at = first
        self._barred = False

    def equations(self) -> list[Tokens]:
        """One equation for each row; a single 0 is zero in each."""
        sides = [self._sum()]
        while self._stream.take_operator("="):
            sides.append(self._sum())
        if self._stream.ahead.kind != "end" or len(sides) > 2:
            raise self._refused()
        if len(sides) == 1 and len(sides[0]) == len(sides[0][0]) == 1:
            return sides[0][0]  # a formula
        left, right = sides if len(sides) == 2 else (sides[0], [[[self._zero()]]])
        zero = [[token.text for token in cell] for row in right for cell in row] == [["0"]]
        right = [right[0]] * len(left) if zero else right
        if len(left) != len(right) or {len(row) for row in (*left, *right)} != {1}:
            raise self._refused()
        sign = Token("operator", "=", self._at.column)
        return [[*a, sign, *b] for [a], [b] in zip(left, right, strict=True)]

    def _refused(self) -> InputError:
        instead = "write sums and products that fit, or an equation for each component"
        return refusal("the rows and columns of vectors or matrices do not fit", self._at.column, instead)

    def _sum(self) -> Value:
        total: Value | None = None
        while total is None or self._stream.ahead.is_operator("+", "-"):
            sign = self._stream.take_operator("+", "-")
            value = [[[sign, *_bracketed(cell)] if sign else cell for cell in row] for row in self._term()]
            if total is not None and [len(row) for row in value] != [len(row) for row in total]:
                raise self._refused()
            total = value if total is None else [
                [a + b for a, b in zip(one, other, strict=True)] for one, other in zip(total, value, strict=True)
            ]  # fmt: skip
        return total

    def _term(self) -> Value:
        value: Value | None = None
        scalar: Tokens = []
        ends = (*_SIDES, "|") if self._barred else _SIDES
        while self._stream.ahead.kind != "end" and not self._stream.ahead.is_operator(*ends):
            factor = self._factor()
            if factor is not None and self._stream.ahead.is_operator("^"):
                factor = self._power(factor)
            if factor is None:
                scalar.append(self._stream.take())
            elif value is None:
                before = scalar[: len(scalar) - (_product_sign(scalar) == tk.DOT)]
                value, scalar = self._scaled(before, factor), []
            else:
                sign = _product_sign(scalar)
                before = scalar[: len(scalar) - bool(sign)]
                value, scalar = self._product(self._scaled(before, value), factor, sign), []
        if value is None and not scalar:
            raise self._refused()
        if value is None:
            return [[scalar]]
        return [[_bracketed(cell) + scalar for cell in row] for row in value] if scalar else value

    def _power(self, base: Value) -> Value:
        """A power of a scalar, or v . v for v^2; InputError for other powers of vectors."""
        power = [self._stream.take(), self._stream.take()]
        if len(base) == len(base[0]) == 1:
            return [[[*_bracketed(base[0][0]), *power]]]
        if tk.spelled(power).strip("^()") != "2":
            raise self._refused()
        return self._product(base, base, tk.DOT)

    def _sign(self, text: str) -> Token:
        return Token("operator", text, self._at.column, True)

    def _zero(self) -> Token:
        return Token("number", "0", self._at.column)

    def _scaled(self, scalar: Tokens, value: Value) -> Value:
        if not scalar:
            return value
        differential = scalar[0].text in ("d", tk.TOTAL) and (len(scalar) == 1 or scalar[1].text == "^")  # d^2 r
        sign = [] if differential else [self._sign("*")]
        return [[[*scalar, *sign, *_bracketed(cell)] for cell in row] for row in value]

    def _product(self, left: Value, right: Value, sign: Fraction) -> Value:
        """The matrix product; \\cdot gives the scalar product, \\times the vector product."""
        minus, times = map(self._sign, "-*")
        if sign == tk.CROSS and len(left) == len(right) == 3:
            pairs = [(1, 2), (2, 0), (0, 1)]
            a, b = ([_bracketed(row[0]) for row in side] for side in (left, right))
            return [[[*a[i], times, *b[j], minus, *a[j], times, *b[i]]] for i, j in pairs]
        if sign == tk.DOT and len(left) == len(right) > 1 and len(left[0]) == len(right[0]) == 1:
            left = [[row[0] for row in left]]
        if len(left) == len(left[0]) == 1 and len(right) > 1:
            return self._scaled(_bracketed(left[0][0]), right)
        if len(left[0]) != len(right):
            raise self._refused()
        return [[self._scalar_product(row, column) for column in zip(*right, strict=True)] for row in left]

    def _scalar_product(self, left: Sequence[Tokens], right: Sequence[Tokens]) -> Tokens:
        plus, times = map(self._sign, "+*")
        pairs = zip(left, right, strict=True)
        return [token for a, b in pairs for token in (plus, *_bracketed(a), times, *_bracketed(b))]

    def _factor(self) -> Value | None:
        """A matrix, a vector with its dots, or a bracket that contains one; None before any other token."""
        stream, ahead = self._stream, self._stream.ahead
        if ahead.kind == "bracket" and ahead.order:
            raise self._refused()
        if ahead.is_bracket("["):
            rows = [tk.split_at("&", row) for row in tk.split_at(";", stream.take().inside) if row]
            if len({len(row) for row in rows}) != 1:
                raise self._refused()
            return rows
        if ahead.is_operator("|") and _holds_many(tk.split_at("|", stream.part(stream.position + 1, -1))[0]):
            return self._length(stream.take())
        if ahead.is_bracket() and _holds_many(ahead.inside):
            return self._of_bracket(stream.take())
        if ahead.kind != "vector":
            return None
        stream.take()
        if ahead.text == "0":
            return [[[self._zero()]]]
        if ahead.text not in self._vectors:
            raise refusal("a vector occurs", ahead.column, "write an equation for each component")
        return [[self._moving(part, ahead)] for part in self._vectors[ahead.text]]

    def _inside(self, bracket: Token) -> Value:
        """What is in a bracket."""
        reader = _Reader(bracket.inside, self._vectors, bracket)
        found = reader._sum()
        if reader._stream.ahead.kind != "end":
            raise tk.unexpected(reader._stream.ahead, "')'")
        return found

    def _of_bracket(self, bracket: Token) -> Value:
        """(a + b), or a fraction ((a)/(b)) of LaTeX."""
        if bracket.value != tk.FRACTION:
            return self._inside(bracket)
        upper, slash, lower = bracket.inside
        value, below = self._inside(upper), self._inside(lower)
        if len(below) != 1 or len(below[0]) != 1:
            raise self._refused()
        under = replace(lower, inside=tuple(below[0][0]))
        return [
            [[replace(bracket, inside=(replace(upper, inside=tuple(cell)), slash, under))] for cell in row]
            for row in value
        ]

    def _length(self, bar: Token) -> Value:
        """The length |a|."""
        self._barred, outer = True, self._barred
        value = self._sum()
        self._barred = outer
        if not self._stream.take_operator("|"):
            raise tk.never_closed(bar)
        (square,) = self._product(value, value, tk.DOT)[0]
        return [[[Token("name", "sqrt", bar.column), bracket(square, bar)]]]

    def _moving(self, part: Tokens, vector: Token) -> Tokens:
        """The component with the dots of the vector; InputError for a component that is a formula."""
        if not vector.order:
            return part
        if len(part) > 1:
            raise self._refused()
        if part[0].kind == "number":
            return [self._zero()]
        return [replace(part[0], order=part[0].order + vector.order, primed=vector.primed)]
