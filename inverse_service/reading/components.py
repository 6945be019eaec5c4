r"""Split matrices and vectors of LaTeX into components: pieces of LaTeX in, pieces out, one equation for each row.

\begin{pmatrix} a & b \\ c & d \end{pmatrix} times columns, and \mathbf{r} or \vec{r} where an equation gives its
components, \mathbf{r} = (x, y, z), with dots, |r|, r^2, \cdot and \times. A scalar before or after multiplies each row.
"""

import itertools
from collections.abc import Sequence

from inverse_service.errors import InputError
from inverse_service.expressions.refusals import refusal
from inverse_service.reading.tokens import Token, Tokens, TokenStream, closing, split, split_at_commas

MATRICES = ("matrix", "pmatrix", "bmatrix")
ROW, CELL, BEGIN, END = "\\", "&", "begin matrix", "end matrix"
BOLD = ("mathbf", "boldsymbol", "bm", "pmb", "textbf", "vec", "overrightarrow", "underline")
_SIDES = ("+", "-", "=", ",", ";", ")", "]", "}")
Value = list[list[Tokens]]  # rows of cells; a scalar is one cell


def by_components(pieces: Tokens) -> Tokens:
    """The pieces with each matrix or vector equation replaced by its rows; InputError if shapes differ."""
    if not any(piece.is_command(BEGIN, *BOLD) for piece in pieces):
        return pieces
    statements, vectors = _statements(pieces), dict[str, list[Tokens]]()
    for statement in tuple(statements):
        if given := _given(statement):
            vectors[given[0]] = given[1]
            statements.remove(statement)
    for given in vectors.items():
        defined = any([piece.text for piece in statement[:2]] == [given[0], "="] for statement in statements)
        statements = statements if defined else [_with_length(*given, statement) for statement in statements]
    found: Tokens = []
    for statement in statements:
        plain = not any(_is_vector(statement, k, vectors) or p.is_command(BEGIN) for k, p in enumerate(statement))
        rows = [statement] if plain else _Reader(statement, vectors).equations()
        for row in rows:
            found += ([Token("command", ROW, row[0].column)] if found and row else []) + row
    return found


def holds_vector(text: str) -> bool:
    """Whether a text may contain a vector."""
    return any(f"\\{command}" in text for command in BOLD)


def _statements(pieces: Tokens) -> list[Tokens]:
    """The pieces between separators outside brackets and matrices."""
    last = max((place for place, piece in enumerate(pieces) if piece.is_operator("=")), default=0)
    inside = list(itertools.accumulate(piece.is_command(BEGIN) - piece.is_command(END) for piece in pieces))

    def ends(place: int, piece: Token) -> bool:
        listed = piece.is_operator(",") and place < last
        return not inside[place] and (piece.is_command(ROW) or piece.is_operator(";") or listed)

    return [statement for statement, _ in split(pieces, ends) if statement]


def _name(pieces: Sequence[Token], place: int) -> tuple[str, int]:
    r"""The r of \mathbf{r} or \vec r there, and the number of its pieces; empty elsewhere."""
    after = [piece.text for piece in pieces[place + 1 : place + 4]]
    if not pieces[place].is_command(*BOLD) or not after:
        return "", 0
    braced = after[0] == "{" and after[2:] == ["}"]
    return (after[1], 4) if braced else (after[0], 2) if after[0] != "{" else ("", 0)


def _is_vector(pieces: Sequence[Token], place: int, vectors: dict[str, list[Tokens]]) -> bool:
    return _name(pieces, place)[0] in vectors


def _given(statement: Tokens) -> tuple[str, list[Tokens]] | None:
    r"""The name and the components in \mathbf{r} = (x, y, z), none of which holds a vector."""
    name, length = _name(statement, 0)
    rest = [piece for piece in statement[length:] if not piece.is_command("left", "right")]
    listed = (
        len(rest) > 4 and rest[0].is_operator("=") and rest[1].is_operator("(") and closing(rest, 1) == len(rest) - 1
    )
    parts = split_at_commas(rest[2:-1]) if listed and name else []
    plain = len(parts) > 1 and all(parts) and not any(piece.is_command(*BOLD) for piece in rest)
    return (name, parts) if plain else None


def _with_length(name: str, parts: list[Tokens], statement: Tokens) -> Tokens:
    """The statement with (x^2 + y^2)^(1/2) for a plain r used together with the bold vector r."""
    found: Tokens = []
    for place, piece in enumerate(statement):
        before = [one.text for one in statement[max(place - 2, 0) : place]]
        bold = any(_name(statement, place - back)[1] for back in (1, 2) if place >= back)
        if piece.kind != "letter" or piece.text != name or bold or before[-1:] == ["_"] or before == ["_", "{"]:
            found.append(piece)
            continue

        def sign(text: str, column: int = piece.column) -> Token:
            return Token("operator", text, column, True)

        squares = [one for part in parts for one in (sign("+"), *_bracketed(part), sign("^"), _digit("2", piece))][1:]
        found += [sign("("), Token("command", "sqrt", piece.column), sign("{"), *squares, sign("}"), sign(")")]
    return found


def _digit(text: str, at: Token) -> Token:
    return Token("digit", text, at.column)


def _bracketed(cell: Tokens) -> Tokens:
    """The cell as a factor."""
    if len(cell) == 1 or all(piece.is_command("dot", "ddot") for piece in cell[:-1]):
        return cell
    return [Token("operator", "(", cell[0].column, True), *cell, Token("operator", ")", cell[-1].column, True)]


class _Reader:
    """Reads an equation of matrices and vectors; a value is its rows of cells."""

    def __init__(self, statement: Tokens, vectors: dict[str, list[Tokens]]) -> None:
        sized = itertools.pairwise([*statement, statement[-1]])  # \left( as (
        plain = [
            one for one, after in sized if not (one.is_command("left", "right") and after.is_operator("(", ")", "|"))
        ]
        self._stream = TokenStream(plain, statement[-1].column)
        self._vectors = vectors
        self._at = statement[0]
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
        left, right = sides if len(sides) == 2 else (sides[0], [[[_digit("0", self._at)]]])
        zero = [[piece.text for piece in cell] for row in right for cell in row] == [["0"]]
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
                scalar += self._stream.take_group()
            elif value is None:
                before = scalar[: len(scalar) - bool(scalar and scalar[-1].is_command("cdot"))]
                value, scalar = self._scaled(before, factor), []
            else:
                sign = scalar.pop().text if scalar and scalar[-1].is_command("times", "cdot") else ""
                value, scalar = self._product(self._scaled(scalar, value), factor, sign), []
        if value is None and not scalar:
            raise self._refused()
        if value is None:
            return [[scalar]]
        return [[_bracketed(cell) + scalar for cell in row] for row in value] if scalar else value

    def _power(self, base: Value) -> Value:
        """A power of a scalar, or v . v for v^2; InputError for other powers of vectors."""
        power = [self._stream.take(), *self._stream.take_group()]
        if len(base) == len(base[0]) == 1:
            return [[[*_bracketed(base[0][0]), *power]]]
        if [piece.text for piece in power if piece.text not in ("^", "{", "}")] != ["2"]:
            raise self._refused()
        return self._product(base, base, "cdot")

    def _sign(self, text: str) -> Token:
        return Token("operator", text, self._at.column, True)

    def _scaled(self, scalar: Tokens, value: Value) -> Value:
        if not scalar:
            return value
        texts = [piece.text for piece in scalar if piece.text not in ("mathrm", "{", "}")]
        sign = [] if texts[:1] == ["d"] and texts[1:2] in ([], ["^"]) else [self._sign("*")]  # d^2 r
        return [[[*scalar, *sign, *_bracketed(cell)] for cell in row] for row in value]

    def _product(self, left: Value, right: Value, sign: str) -> Value:
        """The matrix product; \\cdot gives the scalar product, \\times the vector product."""
        minus, times = map(self._sign, "-*")
        if sign == "times" and len(left) == len(right) == 3:
            pairs = [(1, 2), (2, 0), (0, 1)]
            a, b = ([_bracketed(row[0]) for row in side] for side in (left, right))
            return [[[*a[i], times, *b[j], minus, *a[j], times, *b[i]]] for i, j in pairs]
        if sign == "cdot" and len(left) == len(right) > 1 and len(left[0]) == len(right[0]) == 1:
            left = [[row[0] for row in left]]
        if len(left) == len(left[0]) == 1 and len(right) > 1:
            return self._scaled(_bracketed(left[0][0]), right)
        if len(left[0]) != len(right):
            raise self._refused()
        return [[self._scalar_product(row, column) for column in zip(*right, strict=True)] for row in left]

    def _scalar_product(self, left: Sequence[Tokens], right: Sequence[Tokens]) -> Tokens:
        plus, times = map(self._sign, "+*")
        pairs = zip(left, right, strict=True)
        return [piece for a, b in pairs for piece in (plus, *_bracketed(a), times, *_bracketed(b))]

    def _factor(self) -> Value | None:
        """A matrix, a vector with its dots, or a bracket that contains one; None before any other piece."""
        stream = self._stream
        if stream.ahead.is_command(BEGIN):
            stream.take()
            rows: Value = [[[]]]
            while not (piece := stream.take()).is_command(END):
                if piece.kind == "end":
                    raise self._refused()
                if piece.is_command(ROW):
                    rows.append([[]])
                elif piece.is_command(CELL):
                    rows[-1].append([])
                else:
                    rows[-1][-1].append(piece)
            found = [row for row in rows if row != [[]]]
            if len({len(row) for row in found}) != 1:
                raise self._refused()
            return found
        if stream.ahead.is_operator("|") and self._holds_vector():
            opening, self._barred = stream.take(), True
            value = self._sum()
            stream.close(opening, "|")
            self._barred = False
            (square,) = self._product(value, value, "cdot")[0]
            return [[[Token("command", "sqrt", opening.column), self._sign("{"), *square, self._sign("}")]]]
        if stream.ahead.is_operator("(") and self._holds_vector():
            opening = stream.take()
            value = self._sum()
            stream.close(opening)
            return value
        if stream.ahead.is_command("frac", "tfrac", "dfrac") and self._holds_vector(1):
            fraction, (above, below) = stream.take(), (self._braced(), self._braced())
            if len(below) != 1 or len(below[0]) != 1:
                raise self._refused()
            opened, closed = self._sign("{"), self._sign("}")
            under = [opened, *below[0][0], closed]
            return [[[fraction, opened, *cell, closed, *under] for cell in row] for row in above]
        dotted = stream.ahead.is_command("dot", "ddot")
        braced = dotted and stream.look(1).is_operator("{")
        name, length = _name(stream.rest(7), dotted + braced)
        if name == "0":
            stream.position += length
            return [[[_digit("0", self._at)]]]
        if name not in self._vectors:
            return None
        order = 1 + stream.take().is_command("ddot") if dotted else 0
        stream.position += length + 2 * braced
        if stream.ahead.is_operator("_"):
            raise self._refused()  # r_1 is not r
        return [[self._moving(part, order)] for part in self._vectors[name]]

    def _moving(self, part: Tokens, order: int) -> Tokens:
        """The component with this number of time derivatives; InputError for a component that is a formula."""
        if not order:
            return part
        if len(part) > 1 and any(piece.kind != "digit" for piece in part):
            raise self._refused()
        return (
            [_digit("0", self._at)]
            if part[0].kind == "digit"
            else [Token("command", "d" * order + "ot", self._at.column), *part]
        )

    def _braced(self) -> Value:
        """A group in braces, or a single piece in its place."""
        if not (opening := self._stream.take_operator("{")):
            return [[[self._stream.take()]]]
        value = self._sum()
        self._stream.close(opening, "}")
        return value

    def _holds_vector(self, groups: int = 0) -> bool:
        """Whether the bracket ahead, or a group after the piece ahead, contains a vector or a matrix."""
        pieces, depth, end = self._stream.rest()[bool(groups) :], 0, 0
        left = groups + 1
        for end, piece in enumerate(pieces):
            depth += piece.is_operator("(", "{") - piece.is_operator(")", "}")
            left -= depth < 1 and not (pieces[0].text == "|" and (end == 0 or piece.text != "|"))
            if not left:
                break
        group = pieces[: end + 1]
        return any(_is_vector(group, k, self._vectors) or piece.is_command(BEGIN) for k, piece in enumerate(group))
