"""Find the names with time derivatives in formulas: x'', x_ddot, diff(x, t, 2), and the m x'' of
mx''. Such a name is a coordinate.
"""

import re
from collections.abc import Mapping, Sequence

from inverse_service.expressions.refusals import fault, listed_names, shorten
from inverse_service.reading import names as nm, prose, reader
from inverse_service.reading.declarations import Texts, Words
from inverse_service.reading.tokens import (
    Line,
    Token,
    at,
    spelled,
    split_at,
    walk,
)

# Factors before an acceleration without a sign: m, ml, I, r.
MECHANICAL_FACTOR = re.compile("([mMIJLCRlrabckghqGQ][0-9]?){1,4}")


def moving_products(texts: Texts, declared: nm.Names, order: int = 2) -> dict[str, Words]:
    """The products among the runs of letters with primes: mx'' is m x''; likewise yy'' and LI''."""
    lines = [line for text in texts.values() if (line := reader.tokens_if_any(text, declared))]
    words = [
        (token.text, token.order > 0)
        for line in lines
        for token in walk(line)
        if token.kind == "name"
    ]
    alone, primed = ({word for word, moves in words if moves is which} for which in (False, True))
    found: dict[str, Words] = {}
    for line in lines:
        for name in moving_names(line, order):
            if (
                name in nm.GREEK_NAMES
                or declared.role_meant(name)
                or not name.replace("_", "").isalnum()
            ):
                continue
            for cut in range(1, len(name)):
                factor, moving = name[:cut], name[cut:]
                single = (
                    len(moving) == 1
                    or moving in nm.GREEK_NAMES
                    or re.fullmatch("[A-Za-z]_?[0-9]", moving)
                )
                elsewhere = moving in alone | primed
                if name in alone and (moving not in primed or nm.is_momentum(name, (moving,))):
                    continue
                mechanical = MECHANICAL_FACTOR.fullmatch(factor) or factor in nm.GREEK_NAMES
                named = (
                    nm.looks_like_a_coordinate(moving) or moving in nm.GREEK_NAMES
                ) and mechanical
                plain = mechanical or (
                    len(factor) < 3 and factor.isalpha() and not {*factor} & {*"dDeij"}
                )
                bending = (
                    len(factor) == 2 and factor.isupper() and nm.looks_like_a_coordinate(moving)
                )  # E I y
                if single and moving != "t" and plain and (bending or elsewhere or named):
                    factors = (
                        [factor]
                        if factor in nm.GREEK_NAMES
                        else re.findall("[A-Za-z][0-9]?", factor)
                    )
                    found.setdefault(name, (*factors, moving))
    return found


def _refuse_products(tokens: Line, products: Mapping[str, Words]) -> None:
    """InputError for mx'', which means m*x''."""
    for token in walk(tokens):
        if token.text in products and token.order:
            meant, primes = "*".join(products[token.text]), "'" * token.order
            raise fault(
                "product with primes",
                token.column,
                name=token.text,
                meant_name=meant,
                primes=primes,
            )


def inferred_coordinates(texts: Texts, declared: nm.Names, order: int = 2) -> Words:
    """The names with this many time derivatives (x'', x_ddot, diff(x, t, 2), …), each once, in
    order.

    `texts` maps pointers to formulas; `declared` holds parameters and functions, which are not
    coordinates.
    """
    found: dict[str, None] = {}
    for pointer, text in texts.items():
        with reader.placed_at(pointer):
            tokens = reader.read_tokens(text, declared)
            if not declared.guesses:
                _refuse_products(tokens, moving_products({pointer: text}, declared, order))
            moving = moving_names(tokens, order)
            moving += (
                reader.moving_in_forms(tokens, declared)
                if pointer.startswith("/constraints")
                else []
            )
            names = [name for name in moving if declared.role_meant(name) is None]
            _refuse_sums(tokens, names, order)
            _refuse_glued_words(tokens, [*found, *names])
        found.update(dict.fromkeys(nm.declared_name(name, pointer, "coordinate") for name in names))
    return tuple(found)


def _refuse_sums(tokens: Line, moving: Sequence[str], order: int) -> None:
    """InputError for x_i'x_i', which may be a sum over i, as may each term of a Lagrangian with
    x_i.
    """
    words = [*walk(tokens)]
    for place, token in enumerate(words):
        summed = token.text in moving and re.search("_[ijk]$", token.text) and token.order < 2
        if summed and (order == 1 or at(words, place + 1).text == token.text):
            raise fault("summed index", token.column, name=token.text, stem=token.text[:-1])


def _refuse_glued_words(tokens: Line, moving: Sequence[str]) -> None:
    """InputError for constraintz' next to z', which is the word and the coordinate."""
    known = {*moving}
    for token in walk(tokens):
        name = token.text if token.text in known else ""
        heads = [(name[:k], name[k:]) for k in range(1, len(name)) if name[k:] in known]
        if meant := next(
            (f"{head} {q}" for head, q in heads if head.lower() in prose.BEGINNINGS), None
        ):
            raise nm.undeclared(token.text, token.column, (meant,))


def key_coordinate(key: str, names: nm.Names, pointer: str) -> str:
    """The coordinate that a key x, x'', x_ddot or \\ddot{x} of `equations` means; InputError if
    there is none.
    """
    name = names.spelling(key_name(key, names))
    if name not in names.coordinates:
        raise fault(
            "equation for another name",
            pointer,
            name=shorten(key),
            coordinates=listed_names(names.coordinates),
        )
    return name


def key_name(key: str, names: nm.Names) -> str:
    """The name in a key of `equations`, with or without two derivatives."""
    pointer = f"/equations/{nm.escaped(key)}"
    if names.role(key):
        return key
    tokens = reader.tokens_if_any(key[:200], names)
    accelerated = moving_names(tokens, 2)
    if len(accelerated) == len(tokens) == 1:
        return accelerated[0]
    return nm.declared_name(key, pointer, "coordinate")


def moving_names(tokens: Line, order: int) -> list[str]:
    """The names with at least this many time derivatives, in order of appearance; V''(x) does not
    count.
    """
    return [name for name, by, times in derivatives(tokens) if by == "t" and times >= order]


def derivatives(line: Line) -> list[tuple[str, str, int]]:
    """(y, x, k) for each y differentiated k times by x, including nested ones, diff(x diff(y, x),
    x); y'' is by t.
    """
    found: list[tuple[str, str, int]] = []
    for place, token in enumerate(line):
        name, after = token.text if token.kind == "name" else "", at(line, place + 1)
        if name in nm.DERIVATIVE_NAMES:
            operand, *variables = split_at(",", after.inside)
            found += _differentiated(
                operand, [word.text for part in variables for word in walk(part)]
            )
        elif name and token.order:
            by = _variable(after)
            found += (
                [(name, by or "t", token.order)] if by or _multiplies_a_sum(token, after) else []
            )
        elif token.inside and at(line, place - 1).text not in nm.DERIVATIVE_NAMES:
            found += derivatives(token.inside)
    return found


def _differentiated(operand: Line, words: Sequence[str]) -> list[tuple[str, str, int]]:
    """The derivatives in diff(operand, x, x), (x, 2) or ((x, 2)); primes in the operand also
    differentiate by x.
    """
    variable, *more = [word for word in words if word not in ("(", ",")] or [""]
    if {*more} - {variable} and not (len(more) == 1 and more[0].isdigit()):
        return []
    times = int(more[0]) if more and more[0] != variable else 1 + len(more)
    first = at(operand, 0)
    if (
        first.kind == "name"
        and not first.order
        and spelled(operand[1:]) in ("", f"({variable})", "(t)")
    ):
        return [(first.text, variable, times)]
    by = (variable, "t")[
        : 1 + (not first.order)
    ]  # the prime of diff(x y', x) is by x, that of diff(y', x) is not
    return [
        (name, variable, order + times)
        for name, inner, order in derivatives(operand)
        if inner in by
    ]


def _variable(after: Token) -> str:
    """x if the token is (x), t if it is not a bracket, and "" for any other bracket."""
    if not after.is_bracket():
        return "t"
    return (
        after.inside[0].text
        if [(each.kind, each.order) for each in after.inside] == [("name", 0)]
        else ""
    )


def _multiplies_a_sum(name: Token, bracket: Token) -> bool:
    """Whether the brackets after the primes are a factor: x''(1 + x^2), r'' (M + m); V''(x - y) is
    a function.
    """
    plain = nm.looks_like_a_coordinate(name.text) or name.text in nm.GREEK_NAMES
    return plain and any(token.is_operator("+", "-") for token in [*walk(bracket.inside)][1:])
