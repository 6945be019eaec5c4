"""Random documents: random tokens, broken formulas, odd shapes, and some valid ones."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

TOKENS = (
    *"+-*/^()=,;'!|<>[]{}&$#@%~`\\\"?:._ ", "**", "''", "x", "y", "t", "k", "x'", "y'", "x''", "x_dot", "2", "0", "1/3",
    "1e9", "0.1", "sin", "cos", "exp", "log", "sqrt", "tan", "atan", "sin(", "\\frac{", "}{", "\\dot{x}", "\\sin",
    "\\sqrt[3]{", "diff(x, t)", "Derivative(", "A(x)", "A'(x)", "pi", "e", "I", "lambda", "import", "\u00b2", "\u2212",
    "\u03b8", "\u221a", "\u200b", "9" * 40, "x" * 60,
)  # fmt: skip
GOOD = ("-x", "-k*x", "x*y'", "sin(x)", "x'^2/(1+y^2)", "-x^3+t", "y'/x", "exp(-x)*y'", "k/x^2", "0", "A(x)*x'",
        "sqrt(1+x'^2)")  # fmt: skip
ODD: tuple[Any, ...] = (None, True, 0, -1, 1.5, "", "x", [], {}, [[]], {"x": {}}, "\u0000", ["x", "x"], 10**30,
                        "a" * 5000)  # fmt: skip
KEYS = ("name", "coordinates", "equations", "parameters", "functions", "time_dependent_lagrangian", "ansatz", "options",
        "lagrangian", "constraints", "associated", "color", "")  # fmt: skip


def formula(dice: random.Random) -> str:
    """Random tokens, a valid formula, or a valid one with some characters changed."""
    kind = dice.random()
    if kind < 0.45:
        return "".join(dice.choice(TOKENS) for _ in range(dice.randint(1, 12)))
    good = dice.choice(GOOD)
    if kind < 0.5:
        return good
    text = list(good + dice.choice(("", "+" + dice.choice(GOOD), "*" + dice.choice(GOOD))))
    for _ in range(dice.randint(1, 3)):
        place = dice.randrange(len(text) + 1)
        text[place : place + dice.randint(0, 2)] = dice.choice(TOKENS)
    return "".join(text)


def document(dice: random.Random) -> Any:
    """A system of two coordinates, sometimes with a key of the wrong shape."""
    found: dict[str, Any] = {
        "coordinates": ["x", "y"],
        "equations": {"x": formula(dice), "y": formula(dice) if dice.random() < 0.5 else "0"},
        "parameters": ["k"],
        "functions": {"A": ["x"]},
    }
    if dice.random() < 0.1:
        found["equations"] = "; ".join(formula(dice) for _ in range(2))
    if dice.random() < 0.2:
        found[dice.choice(KEYS)] = dice.choice(ODD)
    return found if dice.random() < 0.98 else dice.choice(ODD)


NUMBERS = (
    "1e-39",
    "1e300",
    "100000000000000000001",
    "10^40",
    "1/10^30",
    "3.7e-8",
    "2^64",
    "1/61",
    "200",
    "0.1",
    "-7",
    "1",
)
SHAPES = (
    "exp({n}*x)", "exp(x/{n})", "x^({m})", "y^{m}", "sin({n}*x')", "cosh({n}*y)", "atan({n}*x')", "log({n}+x^2)",
    "{n}*y",     "sqrt({n}+y'^2)", "{n}*x'*y'", "x/({n}+y)", "y'^{m}", "tan({n}*x)", "(x+{n}*y)^(1/{m})",
)  # fmt: skip
METHODS = (
    "variational",
    "nonholonomic",
    "modified",
    "exact",
    "reference",
    "stormer-verlet",
    "adaptive",
    "stiff",
    "nothing",
)
EXTREMES = (0, 1, -1, 0.1, 0.5, "1/3", 2, 1e-300, 1e300, 1e8, -1e8, 1e-8)


def with_extreme_numbers(dice: random.Random) -> dict[str, Any]:
    """A system of two coordinates whose formulas contain very large and very small numbers."""

    def one() -> str:
        shape = dice.choice(SHAPES)
        return dice.choice(("", "-")) + shape.format(
            n=dice.choice(NUMBERS), m=dice.choice((2, 3, 61, 200, 300, 10**6))
        )

    found: dict[str, Any] = {
        "coordinates": ["x", "y"],
        "equations": {name: "+".join(one() for _ in range(dice.randint(1, 2))) for name in "xy"},
    }
    if dice.random() < 0.15:
        found = {"coordinates": ["x", "y", "z"], "lagrangian": f"x'^2/2+y'^2/2+z'^2/2+{one()}"}
        found["constraints"] = [f"z'=({one()})*x'"]
    return found


def scene(dice: random.Random) -> dict[str, Any]:
    """A scene with numbers of all sizes, suitable or unsuitable methods, and sometimes a key of the
    wrong shape.
    """
    system: dict[str, Any] = {
        "coordinates": ["x", "y"],
        "equations": with_extreme_numbers(dice).get("equations", "x"),
    }
    potential = dice.choice(SHAPES).format(n=dice.choice(NUMBERS), m=2).replace("'", "")
    free = {"coordinates": ["x", "y"], "lagrangian": f"x'^2/2+y'^2/2-({potential})"}
    number = dice.choice
    disk, particle = (
        {"catalogue": "vertically-rolling-disk"},
        {"catalogue": "nonholonomic-particle"},
    )
    whole, names = number(
        (
            (system, "x y"),
            (system, "x y"),
            (free, "x y"),
            (free, "x y"),
            (disk, "theta phi x y"),
            (particle, "x y z"),
        )
    )
    found: dict[str, Any] = {
        "system": whole,
        "initial": {
            key: {name: number(EXTREMES) for name in names.split() if dice.random() < 0.98}
            for key in ("positions", "velocities")
        },
        "step": number((0.1, 0.1, 0.1, 0.01, 1, 1e-12, 1e12, number((-0.1, 0)))),
        "steps": number((1, 10, 10, 100, 1000, number((1, 1, 0)))),
        "methods": [
            {"method": number((*METHODS[:-1] * 3, METHODS[-1]))} for _ in range(dice.randint(1, 2))
        ],
        "observe": dice.sample(
            ["trajectory", "energy", "constraints", "error", "matching_circle"], 2
        ),
    }
    if whole is disk:
        found["parameters"] = dict.fromkeys("MIJR", number((1, 2, 1e-8, 1e8)))
    if dice.random() < 0.1:
        found[number(("step", "observe", "methods", "initial", "effects", "color"))] = number(ODD)
    return found


def lines(count: int, seed: int) -> Iterator[bytes]:
    """Lines of a batch; some are truncated or contain an invalid byte."""
    dice = random.Random(seed)
    for _ in range(count):
        line = json.dumps(document(dice)).encode()
        if dice.random() < 0.03:
            line = line[: dice.randrange(1, len(line) + 1)]
        if dice.random() < 0.02:
            line = line.replace(b"x", bytes([dice.randrange(128, 256)]), 1)
        yield line
