"""Difficult scenes and the required outcome of each method, for every interface. A card is a scene
with the outcome of each method, or the error message if the scene is rejected.
"""

from __future__ import annotations

from typing import Any, NamedTuple

Outcomes = dict[str, str | tuple[str, ...]]


class Card(NamedTuple):
    """`answer` is label → outcome, or a part of the error message; errors of completed methods are
    below `error`.
    """

    name: str
    scene: dict[str, Any]
    answer: Outcomes | str
    error: float | None = None


def _scene(
    system: dict[str, Any],
    positions: dict[str, float],
    velocities: dict[str, float],
    methods: list[Any],
    **more: Any,
) -> dict[str, Any]:
    given = {
        "system": system,
        "initial": {"positions": positions, "velocities": velocities},
        "methods": methods,
    }
    return given | {"step": 0.05, "steps": 40, "observe": ["error"]} | more


def _line(lagrangian: str, x: float, v: float, methods: list[Any], **more: Any) -> dict[str, Any]:
    return _scene(
        {"coordinates": ["x"], "lagrangian": lagrangian}, {"x": x}, {"x": v}, methods, **more
    )


def _plane(
    lagrangian: str, start: list[float], methods: list[Any], constraints: Any = None, **more: Any
) -> Any:
    system: dict[str, Any] = {"coordinates": ["x", "y"], "lagrangian": lagrangian}
    system |= {"constraints": constraints} if constraints else {}
    return _scene(system, dict(zip("xy", start[:2], strict=True)), dict(zip("xy", start[2:], strict=True)), methods,
                  **more)  # fmt: skip


OF_PAPER = ["variational", "nonholonomic", "modified", "exact"]
EXCLUDED: Outcomes = {
    "variational-0.5": "off_domain", "nonholonomic-0.5": "completed", "modified-0.5": "off_domain", "exact": "completed"
}  # fmt: skip
WHEEL = {"m": 1, "I": 1, "J": 1, "R": 1}


def _excluded(
    name: str, values: dict[str, Any], positions: dict[str, float], velocities: dict[str, float]
) -> Card:
    scene = _scene({"catalogue": name}, positions, velocities, OF_PAPER, parameters=values)
    return Card(f"{name} where r1' = 0", scene, EXCLUDED, 1e-12)


DISK = {"M": 1, "R": 1, "I": "1/2", "J": "1/4"}
AT_DISK = {"phi": 0.1, "theta": 0.0, "x": 0.0, "y": 0.0}
PAPER = [
    _excluded("vertically-rolling-disk", DISK, AT_DISK, {"phi": 0, "theta": 1}),
    _excluded("vertically-rolling-disk", DISK, AT_DISK, {"phi": 0, "theta": 0}),
    _excluded("knife-edge", {"m": 1, "J": 1}, {"phi": 0.3, "x": 0, "y": 0}, {"phi": 0, "x": 1}),
    _excluded("nonholonomic-particle", {}, {"x": 0.5, "y": 0, "z": 0}, {"x": 0, "y": 1}),
    _excluded(
        "mobile-robot", WHEEL, {"theta": 0.3, "psi": 0, "x": 0, "y": 0}, {"theta": 0, "psi": 1}
    ),
    _excluded(
        "two-wheeled-carriage",
        WHEEL,
        {"phi": 0.3, "sigma": 0, "x": 0, "y": 0},
        {"phi": 0, "sigma": 1},
    ),
]

DRAG = {
    "coordinates": ["x", "y"],
    "equations": ["x''=B*y'-c*x'", "y''=-B*x'-c*y'"],
    "parameters": ["B", "c"],
}
FOUR = {"coordinates": list("xyzw"), "lagrangian": "(x'^2+y'^2+z'^2+w'^2)/2"}
STEPPED = [
    "variational",
    {"method": "variational", "order": 4},
    "nonholonomic",
    "reference",
    "adaptive",
]
LOST: Outcomes = dict.fromkeys(
    ("variational-0.5", "variational-0.5-order4", "nonholonomic-0.5", "reference", "adaptive"),
    "singular",
)
TYPED = ("singular", "unresolved", "no_convergence", "not_finite", "off_domain", "guard")


def _rank(constraints: list[str], speeds: dict[str, float]) -> dict[str, Any]:
    return _scene(FOUR | {"constraints": constraints}, {"x": -1, "y": 0, "z": 0, "w": 0}, speeds, STEPPED, step=0.02,
                  steps=150, observe=["energy"])  # fmt: skip


ENDS = [
    "runge-kutta",
    {"method": "runge-kutta", "order": 8},
    "reference",
    "adaptive",
    "stiff",
    "variational",
]
NOWHERE: Outcomes = dict.fromkeys(
    (
        "runge-kutta-order4",
        "runge-kutta-order8",
        "reference",
        "adaptive",
        "stiff",
        "variational-0.5",
    ),
    TYPED,
)
KEPLER = "(x'^2+y'^2)/2 + 1/sqrt(x^2+y^2)"
WRONG = [
    Card("a charged particle with drag, by its equations",
         _scene(DRAG, {"x": 0, "y": 0}, {"x": 1, "y": 0}, ["variational", {"method": "variational", "order": 8}],
                parameters={"B": 1, "c": 0.05}, step=0.02, steps=500),
         {"variational-0.5": "completed", "variational-0.5-order8": "completed"}, 1e-3),
    Card("two constraints that are parallel at x = 0", _rank(["y'-x*z'", "y'+x*z'"], {"x": 1, "w": 0.5}), LOST),
    Card("two constraints of which one dies out", _rank(["y'-z'", "y'-(1+x)*z'+x*w'"], {"x": 1, "y": 0.5}), LOST),
    Card("a Hessian x'^2 that vanishes", _line("x'^4/4-x^2/2", 1, 0.5, ENDS, step=0.02, steps=250, observe=[]),
         NOWHERE),
    Card("a Hessian x' that vanishes", _line("x'^3/6-x^2/2", 1, 0.5, ENDS, step=0.02, steps=250, observe=[]), NOWHERE),
    Card("a radial collision", _plane(KEPLER, [1, 0, 0, 0], ENDS, step=0.01, steps=300, observe=[]), NOWHERE),
    Card("steps of half a turn", _line("x'^2/2-x^2/2", 1, 0, [{"method": "variational", "alpha": 0}, "stormer-verlet",
                                                               "runge-kutta"], step=3, steps=500),
         {"variational-0": "not_finite", "stormer-verlet": "not_finite", "runge-kutta": "unresolved"}),
    Card("a kink of the potential", _line("x'^2/2-sqrt(x^2)", 1, 0, ["reference", "runge-kutta", "variational"],
                                          step=0.01, steps=300),
         dict.fromkeys(("reference", "runge-kutta", "variational-0.5"), "completed"), 1e-12),
    Card("a degenerate Lagrangian", _plane("x'^2/2-x^2/2-x*y", [1, 1, 0, 0],
                                          ["nonholonomic", "variational", "adaptive"]),
         dict.fromkeys(("nonholonomic-0.5", "variational-0.5", "adaptive"), "unavailable")),
    Card("a constraint with a part free of velocities",
         _plane("(x'^2+y'^2)/2", [0, 0, 1, 0.5], ["nonholonomic", "runge-kutta", "reference"], ["x'-y-1"]),
         dict.fromkeys(("nonholonomic-0.5", "runge-kutta", "reference"), "completed"), 1e-12),
]  # fmt: skip

ALONE = ["variational"]
SPACE = {"coordinates": ["x", "y", "z"], "lagrangian": "(x'^2+y'^2+z'^2)/2"}
SMALL = [
    Card("friction as a term", _line("x'^2/2-x^2/2", 1, 0, ALONE, terms={"friction": "-c*x'^2"}, parameters={"c": 0.1}),
         "dissipates no energy"),
    Card("redundant constraints",
         _scene(SPACE | {"constraints": ["z'-x*y'", "2*z'-2*x*y'"]}, {"x": 0.5, "y": 0, "z": 0},
                {"x": 1, "y": 1, "z": 0.5}, OF_PAPER), "only 1 of the 2 constraints are independent"),
    Card("a constraint that is not linear", _plane("(x'^2+y'^2)/2", [0.5, 0, 1, 0], ALONE, ["x'^2+y'^2-1"]),
         "not linear in the velocities"),
    Card("as many constraints as coordinates", _plane("(x'^2+y'^2)/2", [0.5, 0, 0, 0], ALONE, ["x'-y'", "x'+y'"]),
         "leave no motion"),
    Card("backwards in time", _line("x'^2/2-x^2/2", 1, 0, ALONE, step=-0.1), "write -t for t"),
    Card("noise", _line("x'^2/2-x^2/2", 1, 0, ALONE, noise={"x": "1"}), "Noise is not simulated"),
    Card("contact", _line("x'^2/2-x^2/2", 1, 0, ALONE, contact={"x": "1"}), "Write what touches as contacts"),
    Card("first order", _scene({"coordinates": ["x", "y"], "equations": ["x'=x-x*y", "y'=x*y-y"]}, {"x": 1, "y": 1},
                               {"x": 0, "y": 0}, ["adaptive"]), "first-order equations"),
    Card("a coordinate called th", _scene({"coordinates": ["th"], "lagrangian": "th'^2/2+cos(th)"}, {"th": 1},
                                          {"th": 0}, ALONE), {"variational-0.5": "completed"}, 1e-3),
    Card("an amplitude of 1e-300", _line("x'^2/2-x^2/2", 1e-300, 0, ALONE), {"variational-0.5": "completed"}, 1e-303),
    Card("an amplitude of 1e-30", _line("x'^2/2+cos(x)", 1e-30, 0, ["adaptive", "variational", "stormer-verlet"]),
         dict.fromkeys(("adaptive", "variational-0.5", "stormer-verlet"), "completed"), 1e-33),
    Card("a stiff van der Pol", _scene({"coordinates": ["x"], "equations": ["x''=1000*(1-x^2)*x'-x"]}, {"x": 2},
                                       {"x": 0}, ["stiff", "runge-kutta", "reference"], step=0.01, steps=200),
         {"stiff": "completed", "runge-kutta": "not_finite", "reference": "not_finite"}, 1e-6),
]  # fmt: skip

GEOMETRIC = [{"method": "nonholonomic", "order": 4}, "adaptive"]
WENT: Outcomes = {"nonholonomic-0.5-order4": "completed", "adaptive": "completed"}
SLEIGH = {
    "coordinates": ["phi", "x", "y"], "constraints": ["sin(phi)*x'-cos(phi)*y'"], "parameters": ["a", "c"],
    "lagrangian": "(x'^2+y'^2+phi'^2)/2 + a*phi'*(y'*cos(phi)-x'*sin(phi)) + a^2*phi'^2/2",
}  # fmt: skip
SNAKE = {
    "coordinates": ["x", "y", "th", "psi", "phi"], "parameters": ["k"],
    "lagrangian": "(x'^2+y'^2+th'^2)/2 + psi'^2/8 + psi'*th'/4 + phi'^2/4",
    "constraints": ["-sin(th+phi)*x'+cos(th+phi)*y'-cos(phi)*th'", "-sin(th-phi)*x'+cos(th-phi)*y'+cos(phi)*th'"],
}  # fmt: skip
AT_SNAKE = (
    {"x": 0.0, "y": 0.0, "th": 0.0, "psi": 0.0, "phi": 0.5},
    {"psi": 0.0, "phi": 0.0, "th": 0.1},
)
SAID = [
    Card("a sleigh with friction", _scene(SLEIGH, {"phi": 0.1, "x": 0, "y": 0}, {"phi": 1, "x": 0.5}, GEOMETRIC,
                                          parameters={"a": 0.3, "c": 0.2}, rayleigh="c*(x'^2+y'^2)/2"), WENT, 1e-7),
    Card("a snakeboard with feedback",
         _scene(SNAKE, *AT_SNAKE, GEOMETRIC, parameters={"k": 0.5},
                forces={"psi": "-k*th - k*psi'", "phi": "sin(t) - k*phi"}), WENT, 1e-6),
    Card("a coin with rolling resistance",
         _scene({"catalogue": "vertically-rolling-disk"}, AT_DISK, {"phi": 1, "theta": 1}, GEOMETRIC, parameters=DISK,
                forces={"theta": "-theta'/10"}), WENT, 1e-6),
    Card("a top", _scene({"coordinates": ["theta", "phi", "psi"],
                          "lagrangian": "(theta'^2+sin(theta)^2*phi'^2)/2+(psi'+cos(theta)*phi')^2/4-cos(theta)"},
                         {"theta": 0.5, "phi": 0, "psi": 0}, {"theta": 0, "phi": 0, "psi": 5},
                         ["variational", "adaptive"]),
         {"variational-0.5": "completed", "adaptive": "completed"}, 1e-3),
    Card("a sleeping top", _scene({"coordinates": ["theta", "phi"],
                                   "lagrangian": "(theta'^2+sin(theta)^2*phi'^2)/2-cos(theta)"},
                                  {"theta": 0, "phi": 0}, {"theta": 0, "phi": 1}, ["adaptive", "runge-kutta"]),
         dict.fromkeys(("adaptive", "runge-kutta"), "unavailable")),
]  # fmt: skip
CARDS = PAPER + WRONG + SMALL + SAID


def judge(card: Card, methods: list[dict[str, Any]]) -> None:
    """Assert that the methods of a result end as the card says."""
    assert not isinstance(card.answer, str), "the scene should be rejected"
    assert len(methods) == len(card.answer)
    for method, expected in zip(methods, card.answer.values(), strict=True):
        assert method["outcome"] in (expected if isinstance(expected, tuple) else (expected,)), (
            method["label"]
        )
        if method["outcome"] == "completed" and card.error is not None:
            assert method["max_error"] <= card.error, method["label"]
        if method["outcome"] in TYPED:
            assert method["stopped"]["quantity"], method["label"]
