"""The grammar of certificates: shapes of documents, tokens, and a reader that computes in any ring as it reads."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import accumulate, pairwise
from typing import Any

FORMAT, RESULT_FORMAT = "inverse-service/certificate/2", "inverse-service/result/1"
OLD_FORMAT, OLD = "inverse-service/certificate/1", "Format 1 proves too little; solve again."
MAX_TEXT, MAX_DEPTH, MAX_MEMBERS, MAX_LISTED = 60_000, 200, 1000, 100
MAX_COORDINATES, MAX_NAMES, MAX_ORDER, MAX_ROWS = 16, 200, 20, 200_000
MAX_POWER = 4096  # of an integral power, beyond which it is an atom
DEFINED = {"sqrt": "u^(1/2)", "abs": "sqrt(u^2)", "sign": "u/sqrt(u^2)",
           "Heaviside": "(1 + u/sqrt(u^2))/2", "tan": "sin(u)/cos(u)", "cot": "cos(u)/sin(u)",
           "sec": "1/cos(u)", "csc": "1/sin(u)", "sinh": "(exp(u) - exp(-u))/2", "cosh": "(exp(u) + exp(-u))/2",
           "tanh": "sinh(u)/cosh(u)", "coth": "cosh(u)/sinh(u)", "sech": "1/cosh(u)", "csch": "1/sinh(u)",
           "asin": "atan(u/sqrt(1 - u^2))", "acos": "pi/2 - asin(u)", "asinh": "log(u + sqrt(u^2 + 1))",
           "acosh": "log(u + sqrt(u^2 - 1))", "atanh": "log((1 + u)/(1 - u))/2"}  # fmt: skip
DERIVATIVE = re.compile(r"\bdiff\s*\(\s*(\w+)\s*\(([^()]*)\)\s*,([^()]*)\)", re.ASCII)
IRRATIONAL = {"^", "exp", "log", "sin", "cos", "atan", *DEFINED}  # an integral power is a token of another form
RESERVED = {"t", "pi", "diff", *IRRATIONAL}
BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4}
FREE = ("", "+", "-", "*", "(")  # before an operand that may have any value
EXPONENT = r"\^[ \t\r\n]*(?:-?[0-9]{1,400}|\(-?[0-9]{1,400}\))(?![0-9.]|[ \t\r\n]*\^)"  # an integer: ^2, ^(-2)
OPERAND = r"(?![0-9.]{401})[0-9]+(?:\.[0-9]+)?|[A-Za-z][A-Za-z0-9_]*(?:\[[0-9]{1,2}(?:,[0-9]{1,2})*\]|'*)"  # 2.5, x'
TOKEN = re.compile(rf"[ \t\r\n]*({OPERAND}|{EXPONENT}|[-+*/^(),]|\Z|(.))", re.DOTALL)
NAME, TEXT = r"[A-Za-z][A-Za-z0-9_]{0,99}", rf"(?s:.{{0,{MAX_TEXT}}})"
NUMBER = r"-?[0-9]{1,400}((\.[0-9]{1,400})?(e[-+]?[0-9]{1,2})?|/0{0,9}[1-9][0-9]{0,399})"
SYSTEM = {"coordinates": [NAME, MAX_COORDINATES], "parameters?": [NAME, MAX_NAMES], "functions?": {}, "equations": {},
          "velocities?": {}}  # fmt: skip
VERDICTS = "variational|not_variational|undetermined"
CERTIFICATE = {"format": FORMAT, "system": {}, "question": "autonomous|time_dependent", "claim": VERDICTS,
               "near?": {}, "conditions?": [TEXT, MAX_LISTED], "kind": "lagrangian|existence|nonexistence"}  # fmt: skip
RESULT = {"format": RESULT_FORMAT, "system": {}, "question?": r"L\((t, )?q, q'\)", "verdict": VERDICTS,
          "lagrangian?": {}, "verdict_with_time?": VERDICTS, "branches?": [{}, 8], "kinds?": {},
          "with_time?": {"verdict?": VERDICTS, "lagrangian?": {}}}  # fmt: skip


class Ended(Exception):
    """The check ends, with a verdict and a sentence: "invalid" or, where nothing can be said, "incomplete"."""


def require(condition: object, sentence: str) -> None:
    if not condition:
        raise Ended("invalid", sentence)


def check_shape(value: Any, shape: Any, where: str) -> None:
    """Refuse what is not a text of a pattern (of NUMBER also an integer), in a range, or made of such parts."""
    parts: list[tuple[Any, Any, str]] = []
    value = str(value) if shape is NUMBER and type(value) is int and value.bit_length() < 1330 else value
    match shape:
        case str():
            good, what = isinstance(value, str) and bool(re.fullmatch(shape, value)), f"a text of the form {shape}"
        case range():
            good, what = type(value) is int and value in shape, f"an integer from {shape[0]} to {shape[-1]}"
        case [*_]:  # [shape of each, most], or a tuple: the shape of each in turn
            fixed, most = isinstance(shape, tuple), len(shape) if isinstance(shape, tuple) else shape[1]
            good = isinstance(value, list | tuple) and (len(value) == most if fixed else len(value) <= most)
            what, shapes = f"a list of {'' if fixed else 'at most '}{most} items", shape if fixed else [shape[0]] * most
            parts = [(*pair, f"an item of {where}") for pair in zip(value, shapes, strict=False)] if good else []
        case _:  # {key: shape}; behind a key that may be left out, or null, stands ?
            good = isinstance(value, dict) and len(value) <= MAX_MEMBERS and all(isinstance(key, str) for key in value)
            what, keys = "a moderate object", [(key, key.rstrip("?")) for key in shape] if good else []
            parts = [(value.get(key), shape[name], f"{where}.{ascii(key[:40])[1:-1]}")
                     for name, key in keys if key == name or value.get(key) is not None]  # fmt: skip
    require(good, f"{where} has to be {what}.")
    for part in parts:
        check_shape(*part)


def read_tokens(text: Any, where: str) -> tuple[str, ...]:
    """The tokens of a formula, the last one empty, with B[1,0](x, y) for diff(B(x, y), x)."""

    def rewritten(found: re.Match[str]) -> str:
        names, by = ([name.strip() for name in part.split(",")] for part in (found[2], found[3]))
        good = all(re.fullmatch(rf"{NAME}'?", name) for name in names) and {*by} <= {*names}
        require(good and len({*names}) == len(names), f"{where}: diff takes a function and some of its distinct names.")
        return f"{found[1]}[{','.join(str(by.count(name)) for name in names)}]({found[2]})"

    check_shape(text, TEXT, where)
    tokens = list(TOKEN.finditer(DERIVATIVE.sub(rewritten, text)))
    strange = next((token.start(2) + 1 for token in tokens if token[2]), 0)
    require(not strange, f"{where}: what stands at column {strange} is no part of a formula.")
    return tuple(token[1] for token in tokens)


def bounded(tokens: tuple[str, ...], letters: set[str]) -> bool:
    """Whether one of the letters stands in an argument, a power or a divisor, so that it may not have all values."""
    holding, unsafe, before = [False], [False], ""
    for token, after in pairwise((*tokens, "")):
        if token == "(":
            holding, unsafe = [*holding, False], [*unsafe, unsafe[-1] or before not in FREE]
        elif token == ")" and len(holding) > 1:
            unsafe.pop()
            inner = holding.pop()
            if inner and after[:1] == "^":
                return True
            holding[-1] |= inner
        elif token in letters:
            if unsafe[-1] or before not in FREE or after[:1] == "^":
                return True
            holding[-1] = True
        before = before if token in ("+", "-") and before in ("/", "^") else token  # a divisor may have a sign
    return False


class Reader:
    """Reads one formula by operator precedence, computing in a ring; names in `bound` have these values."""

    def __init__(self, ring: Any, formula: tuple[str, ...], **bound: Any) -> None:
        self.ring, self.tokens, self.names, self.position = ring, formula, ring.names | bound, 0
        self.value = self.expression(0, 0)
        self.expect(not self.tokens[self.position], "an operator is expected")

    def expect(self, condition: object, what: str) -> None:
        require(condition, f"Formula {''.join(self.tokens[:9])[:40]}…: {what}, at token {self.position + 1}.")

    def take(self, operator: str) -> bool:
        """Whether the next token is this one; then it is passed."""
        found = self.tokens[self.position] == operator
        self.position += found
        return found

    def expression(self, floor: int, depth: int) -> Any:
        """What stands before an operator that binds no tighter than `floor`; -x^2 is -(x^2), x^y^z is x^(y^z)."""
        self.expect(depth <= MAX_DEPTH, f"at most {MAX_DEPTH} brackets and exponents may be nested")
        minuses = 0
        while self.take("-"):
            minuses += 1
        value = self.expression(3, depth) if minuses else self.atom(depth)
        value = self.ring.add([value], [-1]) if minuses % 2 else value
        while BINDING.get((operator := self.tokens[self.position])[:1], 0) > floor:
            self.position += 1
            if operator[1:]:
                value = self.ring.power(value, int(operator[1:].strip("( \t\r\n)")))
            else:
                tower = operator == "^"
                value = joined(self.ring, operator, value, self.expression(BINDING[operator] - tower, depth + tower))
        return value

    def atom(self, depth: int) -> Any:
        token = self.tokens[self.position]
        self.expect(token == "(" or token[:1].isalnum(), "a number, a name or '(' is expected")
        self.position += token != "("
        if token[0].isdigit():
            return self.ring.constant(Fraction(token))
        if not self.take("("):
            self.expect(token in self.names, f"the name {token[:40]} is not known")
            return self.names[token]
        values = [self.expression(0, depth + 1)]
        while token != "(" and self.take(","):
            values.append(self.expression(0, depth + 1))
        self.expect(self.take(")"), "')' is expected")
        return values[0] if token == "(" else self.call(token, values)

    def call(self, token: str, values: list[Any]) -> Any:
        """A(u), A'(u), B(u, w), B[1,0](u, w) or an elementary function."""
        if token in IRRATIONAL and len(values) == 1:
            return applied(self.ring, token, values[0])
        name, _, listed = token.rstrip("]").partition("[")
        orders = [int(order) for order in listed.split(",")] if listed else [name.count("'")]
        name, orders = name.rstrip("'"), [0] * len(values) if orders == [0] else orders
        if name in self.ring.question.integrals:
            return self.ring.integral(name, orders, values)
        good = len(values) == len(orders) == len(self.ring.question.functions.get(name, ()))
        self.expect(good and sum(orders) <= MAX_ORDER, f"{token[:40]} is no function of {len(values)} arguments")
        return self.ring.function(name, tuple(orders), values)


def joined(ring: Any, operator: str, left: Any, right: Any) -> Any:
    """left operator right, for ^ exp(right log(left))."""
    ring.question.check_time()
    if operator in "+-":
        return ring.add([left, right], [1, 1 if operator == "+" else -1])
    if operator == "^":
        return ring.elementary("exp", ring.multiply(right, ring.elementary("log", left), ring.degree))
    return ring.multiply(left, ring.power(right, -1) if operator == "/" else right, ring.degree)


def applied(ring: Any, name: str, u: Any) -> Any:
    """An elementary function, by its definition in others where it has one."""
    if name in DEFINED:
        return Reader(ring, read_tokens(DEFINED[name], name), u=u).value
    return ring.elementary(name, u)


def is_root(formula: tuple[str, ...]) -> bool:
    """Whether it is sqrt(w) or (w)^(e) as a whole, which has a value only where w is positive."""
    depths = [*accumulate((token == "(") - (token == ")") for token in formula)]
    closed = [k for k, depth in enumerate(depths) if formula[k] == ")" and not depth]
    between = ("^", "(") if formula[0] == "(" else ()
    good = formula[0] in ("(", "sqrt") and len(closed) == 1 + bool(between) and closed[-1] == len(formula) - 2
    return good and (not between or formula[closed[0] + 1 : closed[0] + 3] == between)


def is_irrational(formula: tuple[str, ...]) -> bool:
    """Whether there is more in it than rational operations and moderate integral powers."""
    exponents = (int(token[1:].strip("( \t\r\n)")) for token in formula if token[:1] == "^" and token[1:])
    return not IRRATIONAL.isdisjoint(formula) or any(abs(exponent) > MAX_POWER for exponent in exponents)
