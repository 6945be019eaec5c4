r"""Split matrices and vectors of LaTeX into components: tokens in, tokens out, one equation for
each row.

\begin{pmatrix} a & b \\ c & d \end{pmatrix} arrives as [a & b; c & d] and multiplies columns;
\mathbf{r} or \vec{r} is a token of the kind "vector" whose components an equation gives, \mathbf{r}
= (x, y, z). Dots, |r|, r^2, \cdot, and \times are accepted. A scalar before or after a matrix
multiplies each row. In plain text, r = (x, y, z) makes every r a vector.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from fractions import Fraction

from inverse_service.expressions.refusals import fault
from inverse_service.reading import names as nm, tokens as tk
from inverse_service.reading.tokens import Line, Token, Tokens, bracket, note

_POTENTIALS = frozenset(("U", "V", "phi", "Phi"))
_CALLED = _POTENTIALS | nm.FUNCTION_LETTERS
_RATES = ("v", "a")  # of a place r
MATRICES = ("matrix", "pmatrix", "bmatrix")
BOLD = (
    "mathbf",
    "boldsymbol",
    "bm",
    "pmb",
    "textbf",
    "vec",
    "overrightarrow",
    "underline",
    "vb",
    "va",
    "vectorbold",
    "vectorarrow",
)
UNUSED = "a vector that is not used"
_JOINS = (*tk.JOINING, *tk.CONDITIONAL, ",")  # r'' = -k r for r = (x, y), k > 0
_LENGTHS = ("abs", "norm")
Value = list[list[Tokens]]  # rows of cells; a scalar is one cell


def by_components(tokens: Tokens, latex: bool, formula: str) -> Tokens:
    """The tokens of a formula with each matrix or vector equation replaced by its rows; InputError
    if shapes differ.
    """
    for place, token in enumerate(tokens):
        beside = tokens[place + 1 : place + 4], tokens[max(place - 3, 0) : place]
        if token.text in _JOINS and any(map(_is_given, beside)):
            tokens = [
                *tokens[:place],
                replace(token, kind="operator", text=";"),
                *tokens[place + 1 :],
            ]
    statements = tk.split_at(";,", tokens)
    if latex and (alone := _only_vector(tokens)):
        note(alone, "each component of the vector")
        return _without_arrows(tokens)
    named = {line[0].text for line in statements if _is_given(line) and line[0].kind == "name"}
    if not named and not (latex and _holds_many(tokens)):
        return tokens
    tokens = _with_points(_with_vectors(tokens, named))
    last = max((place for place, token in enumerate(tokens) if token.is_operator("=")), default=0)
    parts = tk.split(
        tokens, lambda at, token: token.is_operator(";") or (token.is_operator(",") and at < last)
    )
    statements, vectors = [part for part, _ in parts if part], dict[str, list[Tokens]]()
    defined = {part[0].text for part in statements if tk.at(part, 1).is_operator("=")}
    statements = [_without_arguments(part, defined) for part in statements]
    statements = [part for part in statements if not _is_length(part)] or statements
    for statement in tuple(statements):
        if _is_given(statement):
            vectors[statement[0].text] = tk.split_at(",", statement[2].inside)
            statements.remove(statement)
    statements = _with_sums(statements, vectors)
    used = {token.text for statement in statements for token in tk.walk(statement)}
    for name, given in vectors.items():
        if used and name not in used:
            note(f"{name} = ({', '.join(map(tk.source, given))})", UNUSED)
        own = any(token.text == name for part in given for token in part)  # x of (x, y)
        if not own and not any(tk.spelled(part[:2]) == f"{name}=" for part in statements):
            statements = [_with_length(name, given, statement) for statement in statements]
    found: Tokens = []
    end = len(formula.rstrip("$ \n\t.,;").removesuffix("\\]").rstrip()) + 1
    for statement in statements:
        try:
            rows = (
                _Reader(vectors, statement, end).equations(statement)
                if _holds_many(statement)
                else [statement]
            )
        except (ValueError, IndexError):
            raise fault("shapes", statement[0].column) from None
        for row in rows:
            found += ([Token("operator", ";", row[0].column)] if found and row else []) + row
    return found


def _with_points(line: Line) -> Tokens:
    """The tokens with a scalar product for the point of r'.r' in plain text."""
    found: Tokens = []
    for place, token in enumerate(line):
        beside = tk.at(line, place - 1), tk.at(line, place + 1)
        if token.is_operator(".") and all(one.kind == "vector" for one in beside):
            found.append(replace(token, text="*", value=tk.DOT))
        else:
            found.append(tk.within(token, _with_points))
    return found


def _without_arguments(line: Line, defined: Collection[str]) -> Tokens:
    """The line with \u2207U for the \u2207U(r) of a U that the text gives."""
    found: Tokens = []
    for place, token in enumerate(line):
        name, nabla = tk.at(line, place - 1), tk.at(line, place - 2)
        if nabla.text == tk.NABLA and name.text in defined and token.is_bracket("("):
            continue
        found.append(tk.within(token, lambda inside: _without_arguments(inside, defined)))
    return found


def _is_length(statement: Line) -> bool:
    r"""Whether it is r = |\mathbf r|, as each plain r next to a bold one is."""
    name, right = tk.at(statement, 0), statement[2:]
    bars = [right[0], right[-1]] if len(right) == 3 else []
    return (
        name.kind == "name"
        and tk.at(statement, 1).is_operator("=")
        and bool(bars)
        and all(one.is_operator("|") for one in bars)
        and right[1].kind == "vector"
        and right[1].text == name.text
        and not right[1].order
    )


def _with_sums(statements: list[Tokens], vectors: Collection[str]) -> list[Tokens]:
    r"""The statements with -k \vec r for the \vec F of \vec F = -k \vec r, where F occurs again."""
    for place, statement in enumerate(statements):
        name, right = tk.at(statement, 0), statement[2:]
        inside = [*tk.walk(right)]
        rest = [*statements[:place], *statements[place + 1 :]]
        if (
            name.kind == "vector"
            and not name.order
            and name.text not in vectors
            and tk.at(statement, 1).is_operator("=")
            and any(one.kind == "vector" or one.is_bracket("[") for one in inside)
            and not any(
                one.text == name.text or one.order > 1 or one.is_operator("=") for one in inside
            )
            and any(one.text == name.text for line in rest for one in tk.walk(line))
        ):
            return _with_sums([_with_sum(line, name.text, right) for line in rest], vectors)
    return statements


def _with_sum(line: Line, name: str, right: Tokens) -> Tokens:
    return [
        bracket(right, token)
        if token.kind == "vector" and token.text == name and not token.order
        else tk.within(token, lambda inside: _with_sum(inside, name, right))
        for token in line
    ]


def _only_vector(tokens: Tokens) -> str:
    """The r of \\ddot{\\vec r} = -k \\vec r, a vector whose components obey one equation each; else
    nothing.

    Each term is a scalar times this vector or one of its derivatives, so the components do not mix.
    """
    vectors = {
        token.text for token in tk.walk(tokens) if token.kind == "vector" and token.text != "0"
    }
    if len(vectors) != 1 or any(
        token.is_bracket("[") or token.text == "|" for token in tk.walk(tokens)
    ):
        return ""
    name = next(iter(vectors))
    rates = [_without_rates(term) for term in tk.split_at("+-=;,", tokens)]
    terms = [term for term in rates if term and tk.spelled(term) != "0"]
    linear = all(
        sum(token.kind == "vector" for token in term)
        == 1
        == sum(token.kind == "vector" for token in tk.walk(term))
        and not any(token.kind == "name" and token.text == name for token in tk.walk(term))
        and not _is_raised(term)
        for term in terms
    )
    return name if linear and len(terms) > 1 else ""


def _without_rates(term: Tokens) -> Tokens:
    r"""The term with the vector x for its derivative \frac{d^2 x}{dt^2}."""
    found: Tokens = []
    for token in term:
        upper, lower = (token.inside[k].inside if token.is_fraction() else () for k in (0, -1))
        in_time = tk.spelled(lower).replace(tk.TOTAL, "d") in ("dt", "dt^2", "dt^(2)")
        of_one = in_time and sum(one.kind == "vector" for one in upper) == 1
        found.append(upper[-1] if of_one and upper[-1].kind == "vector" else token)
    return found


def _is_raised(term: Tokens) -> bool:
    """Whether the vector of the term is raised to a power or divides."""
    place = next(place for place, token in enumerate(term) if token.kind == "vector")
    return tk.at(term, place + 1).is_operator("^") or tk.at(term, place - 1).is_operator("/", "^")


def _without_arrows(line: Line) -> Tokens:
    found = [replace(token, kind="name") if token.kind == "vector" else token for token in line]
    return [tk.within(token, _without_arrows) for token in found]


def holds_vector(text: str) -> bool:
    """Whether a text may contain a vector in bold type or with an arrow."""
    return any(f"\\{command}" in text for command in BOLD)


def _with_vectors(line: Line, names: Collection[str]) -> Tokens:
    """The tokens with these names as vectors."""
    found = [replace(token, kind="vector") if token.text in names else token for token in line]
    return [tk.within(token, lambda inside: _with_vectors(inside, names)) for token in found]


def _holds_many(tokens: Line) -> bool:
    return any(token.kind == "vector" or token.is_bracket("[") for token in tk.walk(tokens))


def _is_given(statement: Tokens) -> bool:
    r"""Whether this is \mathbf{r} = (x, y, z) with scalar components that do not contain r."""
    name = tk.at(statement, 0)
    shape = [(token.kind, token.text) for token in statement[1:]] == [
        ("operator", "="),
        ("bracket", "("),
    ]
    parts = (
        tk.split_at(",", statement[2].inside) if shape and not _holds_many(statement[1:]) else []
    )
    own = name.kind == "name" and name.text in {token.text for part in parts for token in part}
    return len(parts) > 1 and all(parts) and name.kind in ("name", "vector") and not own


def _with_length(name: str, parts: list[Tokens], line: Line) -> Tokens:
    """The line with (x^2 + y^2)^(1/2) for a plain r used together with the bold vector r."""
    found: Tokens = []
    for token in line:
        if token.kind != "name" or token.text != name:
            found.append(tk.within(token, lambda inside: _with_length(name, parts, inside)))
            continue
        root, plus, *power = tk.tokens_in_place("sqrt+^2", token)
        squares = [one for part in parts for one in (plus, *_bracketed(part), *power)][1:]
        length = bracket([root, bracket(squares, token)], token)
        found.append(replace(length, order=token.order, primed=token.primed))
    return found


def _bracketed(cell: Tokens) -> Tokens:
    """The cell as a factor."""
    return cell if len(cell) < 2 else [replace(bracket(cell, cell[0]), end=cell[-1].column)]


class _Reader:
    """Parse an equation of matrices and vectors; a value is a list of rows of cells.

    ValueError or IndexError if rows and columns do not fit, which the lists notice themselves.
    """

    def __init__(self, vectors: dict[str, list[Tokens]], statement: Tokens, end: int) -> None:
        self._vectors = vectors
        self._first = statement[0]
        each = [token for token in tk.walk(statement) if token.kind == "vector"]
        self._moving = {token.text for token in each if token.order}
        self._end = end

    def equations(self, line: Tokens) -> list[Tokens]:
        """One equation for each row; a side that is just 0 is zero in each row."""
        sides = [self._sum(side) for side in tk.split_at("=", line)]
        if len(sides) == 1 and len(sides[0]) == len(sides[0][0]) == 1:
            return sides[0][0]  # a formula
        left, right = sides if len(sides) > 1 else (sides[0], [[[self._zero()]]])
        zero = [tk.spelled(cell) for row in right for cell in row] == ["0"]
        right = [right[0]] * len(left) if zero else right
        return [[*a, self._sign("="), *b] for [a], [b] in zip(left, right, strict=True)]

    def _sum(self, line: Line) -> Value:
        line = _with_lengths(line)
        inner = ("*", "/", "^")  # a sign after them belongs to a factor or an exponent
        parts = tk.split(
            line,
            lambda k, one: one.is_operator("+", "-") and not tk.at(line, k - 1).is_operator(*inner),
        )
        total: Value | None = None
        for (part, _), sign in zip(parts, [None, *(sign for _, sign in parts)], strict=False):
            if not part and sign is None and len(parts) > 1:
                continue  # -v
            value = [
                [[sign, *_bracketed(cell)] if sign else cell for cell in row]
                for row in self._term(part)
            ]
            pairs = zip(total or value, value, strict=True)
            total = (
                [[a + b for a, b in zip(*rows, strict=True)] for rows in pairs] if total else value
            )
        return total or []

    def _term(self, line: Line) -> Value:
        value: Value | None = None
        scalar: Tokens = []
        place = 0
        while place < len(line):
            token = self._with_components(tk.at(scalar, len(scalar) - 1), line[place])
            factor, count = self._factor(token), 1
            if token.text == "\u2207":
                factor, count = self._gradient(line[place + 1 : place + 4])
            place += count
            if factor is None:
                scalar.append(token)
                continue
            if tk.at(line, place).is_operator("^"):
                factor, place = self._power(factor, line[place : place + 2]), place + 2
            if len(factor) == len(factor[0]) == 1:
                cell = factor[0][0]  # V(|r|) stays a call
                called = tk.at(scalar, len(scalar) - 1).text in _CALLED and token.is_bracket("(")
                scalar += [replace(token, inside=tuple(cell))] if called else _bracketed(cell)
                continue
            last = tk.at(scalar, len(scalar) - 1)
            if last.is_operator("/"):
                raise ValueError
            before = scalar[:-1] if last.is_operator("*") else scalar
            if value is None:
                value, scalar = self._scaled(before, factor), []
            else:
                value, scalar = self._product(self._scaled(before, value), factor, last.value), []
        if not line or any(token.is_operator(",", ";", "&") for token in scalar):
            raise ValueError
        if value is None:
            return [[scalar]]
        return [[_bracketed(cell) + scalar for cell in row] for row in value] if scalar else value

    def _gradient(self, following: Line) -> tuple[Value | None, int]:
        """The slopes of the V of \\nabla V, or of V(r), by the components of the only vector, and how
        many tokens they take; None for another formula.
        """
        name, bracket_after = tk.at(following, 0), tk.at(following, 1)
        given = [parts for vector, parts in self._vectors.items() if vector in self._moving]
        given = given or [*self._vectors.values()]
        plain = len(given) == 1 and all([one.kind for one in part] == ["name"] for part in given[0])
        if name.kind != "name" or name.order or not plain:
            return None, 1
        called = [name]
        if bracket_after.is_bracket("(") and not bracket_after.space_before:
            called.append(self._with_components(name, bracket_after))
        if tk.at(following, len(called)).is_operator("^"):  # the slope of a square, or its square
            return None, 1
        comma = Token("operator", ",", name.column)
        rows: Value = []
        for part in given[0]:
            inside = bracket([*called, comma, *part], name)
            rows.append([[replace(name, text="diff"), replace(inside, space_before=False)]])
        return rows, 1 + len(called)

    def _with_components(self, name: Token, token: Token) -> Token:
        """The (x, y, t) of a potential V(r, t), whose r is the vector alone; other tokens as they are."""
        called = name.kind == "name" and name.text in _POTENTIALS and not token.space_before
        if not (called and token.is_bracket("(")):
            return token
        parts = tk.split_at(",", token.inside)
        if not any(
            [one.kind for one in part] == ["vector"] and not part[0].order for part in parts
        ):
            return token
        given: list[Tokens] = []
        for part in parts:
            is_vector = [one.kind for one in part] == ["vector"]
            given += [row[0] for row in self._components(part[0])] if is_vector else [part]
        comma = Token("operator", ",", token.column)
        inside = [one for part in given for one in (comma, *part)][1:]
        return replace(token, inside=tuple(inside))

    def _power(self, base: Value, power: Line) -> Value:
        """A power of a scalar, v . v for v^2, or the row v^T; InputError for other powers of
        vectors.
        """
        if len(base) == len(base[0]) == 1:
            return [[[*_bracketed(base[0][0]), *power]]]
        if tk.spelled(power).strip("^()") == "T":
            return [list(row) for row in zip(*base, strict=True)]
        if tk.spelled(power).strip("^()") != "2":
            raise ValueError
        return self._product(base, base, tk.DOT)

    def _sign(self, text: str) -> Token:
        return Token("operator", text, self._first.column, True)

    def _zero(self) -> Token:
        return Token("number", "0", self._first.column)

    def _scaled(self, scalar: Tokens, value: Value) -> Value:
        if not scalar:
            return value
        differential = scalar[0].text in ("d", tk.TOTAL) and (
            len(scalar) == 1 or scalar[1].text == "^"
        )  # d^2 r
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
        return [
            [self._scalar_product(row, column) for column in zip(*right, strict=True)]
            for row in left
        ]

    def _scalar_product(self, left: Sequence[Tokens], right: Sequence[Tokens]) -> Tokens:
        plus, times = map(self._sign, "+*")
        pairs = zip(left, right, strict=True)
        return [token for a, b in pairs for token in (plus, *_bracketed(a), times, *_bracketed(b))]

    def _factor(self, token: Token) -> Value | None:
        """A matrix, a vector with its dots, or a bracket or length that contains one; None for any
        other token.
        """
        if token.kind == "vector":
            return self._components(token)
        if not _holds_many([token]):
            return None
        if token.order:
            raise ValueError
        if token.text == "[":
            return [tk.split_at("&", row) for row in tk.split_at(";", token.inside) if row]
        if token.is_fraction():
            upper, slash, lower = token.inside
            [[below]] = self._sum(lower.inside)
            under = replace(lower, inside=tuple(below))
            over = [
                [replace(upper, inside=tuple(cell)) for cell in row]
                for row in self._sum(upper.inside)
            ]
            return [[[replace(token, inside=(cell, slash, under))] for cell in row] for row in over]
        value = self._sum(token.inside)
        if token.text == "|":
            (square,) = self._product(value, value, tk.DOT)[0]
            return [[[Token("name", "sqrt", token.column), bracket(square, token)]]]
        return value

    def _components(self, vector: Token) -> Value:
        """The components of a vector, each with the vector's dots; InputError if a dotted component
        is a formula.
        """
        parts = [[self._zero()]] if vector.text == "0" else self._vectors.get(vector.text)
        if parts is None:
            is_rate = vector.text in _RATES and "r" not in self._vectors
            of_place = "r" if is_rate else vector.text
            given = (f", \\mathbf{{{of_place}}} = ({names})" for names in ("x, y, z", "x, y"))
            raise fault("vector", vector.column, (self._end, self._end), (*given,))
        if vector.order and any(len(part) > 1 for part in parts):
            raise ValueError
        if vector.order:
            dotted = vector.primed == vector.column  # by \\dot, not by a prime
            moving = [
                replace(
                    part[0],
                    column=vector.column if dotted else part[0].column,
                    order=vector.order,
                    primed=vector.primed,
                )
                for part in parts
            ]
            parts = [[self._zero() if part.kind == "number" else part] for part in moving]
        return [[part] for part in parts]


def _with_called_lengths(line: Line) -> Tokens:
    found: Tokens = []
    for token in line:
        called = tk.at(found, len(found) - 1).text in _LENGTHS
        if called and token.is_bracket() and _holds_many(token.inside):
            token = replace(found.pop(), kind="bracket", text="|", inside=token.inside)
        found.append(token)
    return found


def _with_lengths(line: Line) -> Tokens:
    """The line with each length |r| or abs(r) of a vector as one bracket."""
    line = _with_called_lengths(line)
    parts = tk.split(line, lambda _, token: token.is_operator("|"))
    found: Tokens = []
    for place, (part, bar) in enumerate(parts):
        before = parts[place - 1][1] if place % 2 else None
        if before and bar and _holds_many(part):
            found[-1:] = [
                Token("bracket", "|", before.column, before.space_before, inside=tuple(part))
            ]
        else:
            found += [*part, bar] if bar else part
    return found
