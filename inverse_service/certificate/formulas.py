"""The grammar of certificates: document shapes, tokens, and a parser that computes in any ring."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

from flint import acb, arb

FORMAT, RESULT_FORMAT = "inverse-service/certificate/2", "inverse-service/result/1"
OLD_FORMAT, OLD = "inverse-service/certificate/1", "Format 1 proves too little; solve again."
MAX_TEXT, MAX_DEPTH, MAX_MEMBERS, MAX_LISTED = 60_000, 200, 1000, 100
MAX_COORDINATES, MAX_NAMES, MAX_ORDER, MAX_ROWS = 64, 200, 20, 200_000
MAX_POWER = 4096  # of an integral power, beyond which it is an atom
DEFINED = {
    "sqrt": "u^(1/2)",
    "abs": "sqrt(u^2)",
    "sign": "u/sqrt(u^2)",
    "Heaviside": "(1 + u/sqrt(u^2))/2",
    "tan": "sin(u)/cos(u)",
    "cot": "cos(u)/sin(u)",
    "sec": "1/cos(u)",
    "csc": "1/sin(u)",
    "sinh": "(exp(u) - exp(-u))/2",
    "cosh": "(exp(u) + exp(-u))/2",
    "tanh": "sinh(u)/cosh(u)",
    "coth": "cosh(u)/sinh(u)",
    "sech": "1/cosh(u)",
    "csch": "1/sinh(u)",
    "asin": "atan(u/sqrt(1 - u^2))",
    "acos": "pi/2 - asin(u)",
    "asinh": "log(u + sqrt(u^2 + 1))",
    "acosh": "log(u + sqrt(u^2 - 1))",
    "atanh": "log((1 + u)/(1 - u))/2",
}


class Law(NamedTuple):
    """What is known of a function y = f(u) that is no formula of others.

    | column | meaning |
    | --- | --- |
    | `value` | f at a ball; a function with an order takes it, polygamma the number of a derivative |
    | `slopes` | dy/du and, with an order n, dz/du of z, which is f of the order n + 1; without
    slopes the derivatives are independent |
    | `once` | formulas in u, which are computed before the slopes |
    | `positive`, `least` | f is real where this formula in u is positive, which is where u is above
    this number; everywhere without them |
    """

    value: Callable[..., arb]
    slopes: tuple[str, ...] = ()
    once: Mapping[str, str] = {}
    positive: str = ""
    least: Callable[[], arb] | None = None


_BESSEL = ("n*y/u - z", "y - (n + 1)*z/u")  # DLMF 10.6.2
SPECIAL = {
    "erf": Law(arb.erf, ("g",), {"g": "2*exp(-u^2)/sqrt(pi)"}),
    "erfi": Law(arb.erfi, ("g",), {"g": "2*exp(u^2)/sqrt(pi)"}),
    "lambertw": Law(
        arb.lambertw, ("y/(u*(1 + y))",), positive="u + exp(-1)", least=lambda: -arb(-1).exp()
    ),
    "expintegral": Law(arb.ei, ("g",), {"g": "exp(u)/u"}, "u", arb),
    "gammafunction": Law(arb.gamma, ("y*p",), {"p": "polygamma(0, u)"}, "u", arb),
    "polygamma": Law(lambda u, k: acb(u).polygamma(k).real, positive="u", least=arb),
    "besselj": Law(arb.bessel_j, _BESSEL, positive="u", least=arb),
    "bessely": Law(arb.bessel_y, _BESSEL, positive="u", least=arb),
}
ORDERED = ("polygamma", "besselj", "bessely")  # they take an order and an argument
MAX_SHIFT = 64  # of an order
DERIVATIVE = re.compile(r"\bdiff\s*\(\s*(\w+)\s*\(([^()]*)\)\s*,([^()]*)\)", re.ASCII)
# An integer power is a token of another form.
IRRATIONAL = {"^", "exp", "log", "sin", "cos", "atan", *DEFINED, *SPECIAL}
RESERVED = {"t", "pi", "diff", *IRRATIONAL}
BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4}
FREE = ("", "+", "-", "*", "(")  # tokens before an operand whose value is unrestricted
# An integer: ^2, ^(-2).
EXPONENT = r"\^[ \t\r\n]*(?:-?[0-9]{1,400}|\(-?[0-9]{1,400}\))(?![0-9.]|[ \t\r\n]*\^)"
# 2.5, x', B[1,0].
OPERAND = (
    r"(?![0-9.]{401})[0-9]+(?:\.[0-9]+)?|[A-Za-z][A-Za-z0-9_]*(?:\[[0-9]{1,2}(?:,[0-9]{1,2})*\]|'*)"
)
TOKEN = re.compile(rf"[ \t\r\n]*({OPERAND}|{EXPONENT}|[-+*/^(),]|\Z|(.))", re.DOTALL)
NAME, TEXT = r"[A-Za-z][A-Za-z0-9_]{0,99}", rf"(?s:.{{0,{MAX_TEXT}}})"
NUMBER = r"-?[0-9]{1,400}((\.[0-9]{1,400})?(e[-+]?[0-9]{1,2})?|/0{0,9}[1-9][0-9]{0,399})"
SYSTEM = {
    "coordinates": [NAME, MAX_COORDINATES],
    "parameters?": [NAME, MAX_NAMES],
    "functions?": {},
    "equations": {},
    "velocities?": {},
}
VERDICTS = "variational|not_variational|undetermined"
CERTIFICATE = {
    "format": FORMAT,
    "system": {},
    "question": "autonomous|time_dependent",
    "claim": VERDICTS,
    "near?": {},
    "conditions?": [TEXT, MAX_LISTED],
    "kind": "lagrangian|existence|nonexistence",
}


class Ended(Exception):
    """The check ends with a verdict and a sentence.

    The verdict is "invalid" or, if nothing can be concluded, "incomplete".
    """

    def __init__(self, verdict: Any, *reasons: str) -> None:
        super().__init__(verdict, *reasons)
        self.verdict, self.reasons = verdict, reasons


class Incomplete(Ended):
    """The check ends without a conclusion."""

    def __init__(self, reason: str) -> None:
        super().__init__("incomplete", reason)


class OutOfTime(Incomplete):
    """The time or the amount of work of the check is used up."""


def require(condition: object, sentence: str) -> None:
    if not condition:
        raise Ended("invalid", sentence)


def check_shape(value: Any, shape: Any, where: str) -> None:
    """End as invalid unless the value is a text of a pattern, a number in a range, or nested such
    parts.

    For NUMBER, an integer is accepted too.
    """
    parts: list[tuple[Any, Any, str]] = []
    if shape is NUMBER and type(value) is int and value.bit_length() < 1330:
        value = str(value)
    match shape:
        case str():
            good = isinstance(value, str) and bool(re.fullmatch(shape, value))
            what = f"a text of the form {shape}"
        case range():
            good = type(value) is int and value in shape
            what = f"an integer from {shape[0]} to {shape[-1]}"
        case [*_]:  # [shape of each, most], or a tuple of the shapes
            fixed = isinstance(shape, tuple)
            most = len(shape) if isinstance(shape, tuple) else shape[1]
            good = isinstance(value, list | tuple) and (
                len(value) == most if fixed else len(value) <= most
            )
            what = f"a list of {'' if fixed else 'at most '}{most} items"
            shapes = shape if fixed else [shape[0]] * most
            parts = (
                [(*pair, f"an item of {where}") for pair in zip(value, shapes, strict=False)]
                if good
                else []
            )
        case _:  # {key: shape}; a key that ends in ? may be left out, or null
            good = isinstance(value, dict) and len(value) <= MAX_MEMBERS
            good = good and all(isinstance(key, str) for key in value)
            what = "a moderate object"
            keys = [(key, key.rstrip("?")) for key in shape] if good else []
            parts = [
                (value.get(key), shape[name], f"{where}.{ascii(key[:40])[1:-1]}")
                for name, key in keys
                if key == name or value.get(key) is not None
            ]
    require(good, f"{where} has to be {what}.")
    for part in parts:
        check_shape(*part)


def read_tokens(text: Any, where: str) -> tuple[str, ...]:
    """The tokens of a formula, ending with an empty one, with B[1,0](x, y) for diff(B(x, y), x)."""

    def rewritten(found: re.Match[str]) -> str:
        names, by = ([name.strip() for name in part.split(",")] for part in (found[2], found[3]))
        good = all(re.fullmatch(rf"{NAME}'?", name) for name in names) and {*by} <= {*names}
        require(
            good and len({*names}) == len(names),
            f"{where}: diff takes a function and some of its distinct names.",
        )
        return f"{found[1]}[{','.join(str(by.count(name)) for name in names)}]({found[2]})"

    check_shape(text, TEXT, where)
    tokens = list(TOKEN.finditer(DERIVATIVE.sub(rewritten, text)))
    strange = next((token.start(2) + 1 for token in tokens if token[2]), 0)
    require(not strange, f"{where}: the text at column {strange} is not part of a formula.")
    return tuple(token[1] for token in tokens)


def bounded(tokens: tuple[str, ...], letters: set[str]) -> bool:
    """Whether one of the names occurs in an argument, a power, or a divisor.

    If so, its values may be restricted.
    """
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
        # A divisor may have a sign.
        before = before if token in ("+", "-") and before in ("/", "^") else token
    return False


class Order(NamedTuple):
    """The integer in an order n + k, and whether n is 0."""

    shift: int = 0
    whole: bool = False


# The orders of polygamma.
NUMBERS_OF_DERIVATIVES = tuple(Order(k, True) for k in range(MAX_ORDER + 1))


class Nodes:
    """The distinct parts of all formulas read, each after its own parts.

    A node is (operator, parts): a number, a name, "+" with pairs of a part and its weight, "*",
    "/", "^" of two parts, ("power", part, integer) or (function, parts).
    """

    def __init__(self) -> None:
        self.table, self.listed = dict[tuple[Any, ...], int](), list[tuple[Any, ...]]()
        self.formulas = dict[tuple[str, ...], list[int]]()

    def node(self, *key: Any) -> int:
        number = self.table.setdefault(key, len(self.listed))
        if number == len(self.listed):
            self.listed.append(key)
        return number

    def parts(self, number: int) -> tuple[int, ...]:
        match self.listed[number]:
            case "number" | "name", _:
                return ()
            case "+", terms:
                return tuple(part for part, _ in terms)
            case "power", part, _:
                return (part,)
            case _, *parts:
                return tuple(parts)
        raise AssertionError

    def rational(self, number: int) -> Fraction | None:
        """The value of a node that is a sum, product, or quotient of numbers."""
        match self.listed[number]:
            case "number", value:
                return Fraction(value)
            case "+", terms:
                parts = [self.rational(part) for part, _ in terms]
                weighted = zip(parts, terms, strict=True)
                return None if None in parts else sum((a or 0) * w for a, (_, w) in weighted)
            case ("*" | "/") as operator, left, right:
                a, b = self.rational(left), self.rational(right)
                if a is None or b is None or (operator == "/" and not b):
                    return None
                return a * b if operator == "*" else a / b
        return None

    def order_of(self, number: int) -> Order | None:
        """The integer in the order of a function, None if it is too large."""
        value, whole = self.rational(number), False
        if value is not None:
            whole = value.denominator == 1
        elif self.listed[number][0] == "+":
            terms = [(self.rational(part), w) for part, w in self.listed[number][1]]
            value = sum((a * w for a, w in terms if a is not None), start=Fraction(0))
        shift = math.floor(value or 0)
        return Order(shift, whole) if abs(shift) <= MAX_SHIFT else None

    def order(self, formula: tuple[str, ...]) -> list[int]:
        """The nodes of a formula in an order of evaluation.

        The last node is the formula itself.
        """
        if formula not in self.formulas:
            needed, waiting = set[int](), [_Parser(self, formula).root]
            while waiting:
                number = waiting.pop()
                if number not in needed:
                    needed.add(number)
                    waiting += self.parts(number)
            self.formulas[formula] = sorted(needed)
        return self.formulas[formula]


class Memory(NamedTuple):
    """Values of nodes in a ring, for given values of the names and a given degree."""

    names: Mapping[str, Any]
    degree: int
    values: dict[int, Any]


def read_formulas(ring: Any, formulas: Iterable[tuple[str, ...]], **bound: Any) -> list[Any]:
    """The values of formulas in a ring.

    Every distinct part is computed once for all formulas that the ring reads. `bound` gives values
    of names; parts that contain bound names are computed for this call only.
    """
    nodes: Nodes = ring.question.nodes
    if bound:
        names, known = ring.names | bound, dict[int, Any]()
    else:
        memory = getattr(ring, "memory", None)
        if memory is None or memory.names is not ring.names or memory.degree != ring.degree:
            memory = ring.memory = Memory(ring.names, ring.degree, {})
        names, known = ring.names, memory.values
    found = list[Any]()
    for formula in formulas:
        order = nodes.order(formula)
        for number in order:
            if number not in known:
                known[number] = computed(ring, nodes, nodes.listed[number], names, known)
        found.append(known[order[-1]])
    return found


def value_of(ring: Any, formula: tuple[str, ...], **bound: Any) -> Any:
    """The value of one formula in a ring."""
    return read_formulas(ring, [formula], **bound)[0]


def computed(
    ring: Any,
    nodes: Nodes,
    node: tuple[Any, ...],
    names: Mapping[str, Any],
    known: Mapping[int, Any],
) -> Any:
    match node:
        case "number", value:
            return ring.constant(value)
        case "name", name:
            require(name in names, f"The name {name[:40]} is not known.")
            return names[name]
        case "+", terms:
            ring.question.check_time()
            return ring.add([known[part] for part, _ in terms], [weight for _, weight in terms])
        case "power", part, exponent:
            return ring.power(known[part], exponent)
        case ("*" | "/" | "^") as operator, left, right:
            return combined(ring, operator, known[left], known[right])
        case token, *parts if token in SPECIAL:
            require(len(parts) == 1 + (token in ORDERED), f"{token} has other arguments.")
            order = nodes.order_of(parts[0]) if token in ORDERED else Order()
            good = order is not None and (token != "polygamma" or order in NUMBERS_OF_DERIVATIVES)
            require(good, f"The order of {token} is not a constant of moderate size.")
            return ring.special(token, [known[part] for part in parts], order)
        case token, *parts:
            return _called(ring, token, [known[part] for part in parts])


def _called(ring: Any, token: str, values: list[Any]) -> Any:
    """A(u), A'(u), B(u, w), B[1,0](u, w) or an elementary function."""
    if token in IRRATIONAL and len(values) == 1:
        return applied(ring, token, values[0])
    name, _, listed = token.rstrip("]").partition("[")
    orders = [int(order) for order in listed.split(",")] if listed else [name.count("'")]
    name, orders = name.rstrip("'"), [0] * len(values) if orders == [0] else orders
    if name in ring.question.integrals:
        return ring.integral(name, orders, values)
    good = len(values) == len(orders) == len(ring.question.functions.get(name, ()))
    require(
        good and sum(orders) <= MAX_ORDER,
        f"{token[:40]} is not a function of {len(values)} arguments.",
    )
    return ring.function(name, tuple(orders), values)


class _Parser:
    """Parse one formula by operator precedence into nodes."""

    def __init__(self, nodes: Nodes, formula: tuple[str, ...]) -> None:
        self.nodes, self.tokens, self.position = nodes, formula, 0
        self.root = self.expression(0, 0)
        self.expect(not self.tokens[self.position], "an operator is expected")

    def expect(self, condition: object, what: str) -> None:
        require(
            condition,
            f"Formula {''.join(self.tokens[:9])[:40]}…: {what}, at token {self.position + 1}.",
        )

    def take(self, operator: str) -> bool:
        """Whether the next token is this operator, which is then consumed."""
        found = self.tokens[self.position] == operator
        self.position += found
        return found

    def expression(self, floor: int, depth: int) -> int:
        """The operand before an operator that binds no tighter than `floor`.

        -x^2 is -(x^2), x^y^z is x^(y^z).
        """
        self.expect(depth <= MAX_DEPTH, f"at most {MAX_DEPTH} brackets and exponents may be nested")
        minuses = 0
        while self.take("-"):
            minuses += 1
        value = self.expression(3, depth) if minuses else self.atom(depth)
        terms = [(value, -1 if minuses % 2 else 1)]  # their sum is the value parsed so far
        while BINDING.get((operator := self.tokens[self.position])[:1], 0) > floor:
            self.position += 1
            if operator in ("+", "-"):
                terms.append((self.expression(1, depth), 1 if operator == "+" else -1))
                continue
            value = self.added(terms)
            if operator[1:]:
                value = self.nodes.node("power", value, int(operator[1:].strip("( \t\r\n)")))
            else:
                tower = operator == "^"
                right = self.expression(BINDING[operator] - tower, depth + tower)
                value = self.nodes.node(operator, value, right)
            terms = [(value, 1)]
        return self.added(terms)

    def added(self, terms: list[tuple[int, int]]) -> int:
        (first, weight), *more = terms
        return first if weight == 1 and not more else self.nodes.node("+", tuple(terms))

    def atom(self, depth: int) -> int:
        token = self.tokens[self.position]
        self.expect(token == "(" or token[:1].isalnum(), "a number, a name or '(' is expected")
        self.position += token != "("
        if token[0].isdigit():
            return self.nodes.node("number", Fraction(token))
        if not self.take("("):
            return self.nodes.node("name", token)
        values = [self.expression(0, depth + 1)]
        while token != "(" and self.take(","):
            values.append(self.expression(0, depth + 1))
        self.expect(self.take(")"), "')' is expected")
        return values[0] if token == "(" else self.nodes.node(token, *values)


def combined(ring: Any, operator: str, left: Any, right: Any) -> Any:
    """left operator right; left ^ right is exp(right log(left))."""
    ring.question.check_time()
    if operator == "^":
        return ring.elementary(
            "exp", ring.multiply(right, ring.elementary("log", left), ring.degree)
        )
    return ring.multiply(left, ring.power(right, -1) if operator == "/" else right, ring.degree)


def applied(ring: Any, name: str, u: Any) -> Any:
    """An elementary function, computed by its definition in terms of others if it has one."""
    if name in DEFINED:
        return value_of(ring, read_tokens(DEFINED[name], name), u=u)
    return ring.elementary(name, u)


def laws_of(ring: Any, name: str, u: Any) -> dict[str, Any]:
    """The values of the formulas of a special function that are computed once."""
    return {
        key: value_of(ring, read_tokens(text, name), u=u)
        for key, text in SPECIAL[name].once.items()
    }


def slopes_of(ring: Any, name: str, **bound: Any) -> list[Any]:
    """The derivatives of a special function, and of that of the next order, by u."""
    return [value_of(ring, read_tokens(text, name), **bound) for text in SPECIAL[name].slopes]


def is_real_everywhere(name: str, order: Order) -> bool:
    """Whether a special function of this order has a real value at all u (DLMF 10.2.2)."""
    return not SPECIAL[name].positive or (name == "besselj" and order.whole)


def shifted(ring: Any, pair: tuple[Any, Any], n: Any, u: Any, shift: int) -> Any:
    """The Bessel function of the order n + shift from those of n and n + 1 (DLMF 10.6.1)."""
    lower, upper = pair
    for k in range(abs(shift)):
        j = k + 1 if shift > 0 else -k
        order = ring.add([n, ring.constant(Fraction(j))])
        twice = combined(ring, "/", ring.add([order, order]), u)
        if shift > 0:
            next_one = ring.multiply(twice, upper, ring.degree)
            lower, upper = upper, ring.add([next_one, lower], [1, -1])
        else:
            next_one = ring.multiply(twice, lower, ring.degree)
            lower, upper = ring.add([next_one, upper], [1, -1]), lower
    return lower


def is_root(formula: tuple[str, ...]) -> bool:
    """Whether the whole formula is sqrt(w) or (w)^(e), which is defined only where w is
    positive.
    """
    depths = [*accumulate((token == "(") - (token == ")") for token in formula)]
    closed = [k for k, depth in enumerate(depths) if formula[k] == ")" and not depth]
    between = ("^", "(") if formula[0] == "(" else ()
    good = formula[0] in ("(", "sqrt") and len(closed) == 1 + bool(between)
    good = good and closed[-1] == len(formula) - 2
    return good and (not between or formula[closed[0] + 1 : closed[0] + 3] == between)


def is_irrational(formula: tuple[str, ...]) -> bool:
    """Whether the formula contains more than rational operations and moderate integer powers."""
    exponents = (token[1:].strip("( \t\r\n)") for token in formula if token[:1] == "^")
    large = any(abs(int(exponent)) > MAX_POWER for exponent in exponents if exponent)
    return not IRRATIONAL.isdisjoint(formula) or large
