"""Steps in loops are the steps that are written out for a scene; their graph has the derivatives of
its formulas.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import inverse_service
from benchmarks.scene_families import bodies, oscillators, pendulum
from inverse_service.expressions import arrays, calculus, tree as ex
from inverse_service.kernels.codegen import compiled
from inverse_service.kernels.codegen.graph import Graph, ordering
from inverse_service.reading import names as nm, reader
from inverse_service.service.scenes import scene_reading
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation import derivation, looping, schemes
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.scene_data import Problem
from tests.values import slow

NAMES = nm.Names(("x", "y"), ("k",))
FORMULAS = [
    "sin(x*y)^3*exp(-y)/(2 + cos(x))", "sqrt(x^2 + y^2)*log(y) - x^(1/3)", "(x*y' - y*x')^2/(1 + k*x'^2)^(3/2)",
    "tan(x) + atan(y/x) + x^y", "cosh(x)*tanh(y') + asinh(x' - y)", "k", "x - x", "x*x'*k - y/(x*y)",
    "sec(x)*cot(y) + csc(x)*coth(y)",
]  # fmt: skip
LEAVES = {
    name: place
    for place, name in enumerate(
        (*map(ex.Symbol, ("x", "y", "k")), ex.Velocity("x"), ex.Velocity("y"))
    )
}


@pytest.mark.parametrize("text", FORMULAS)
def test_a_graph_has_the_values_and_derivatives_of_a_tree(text: str) -> None:
    tree, graph = reader.read_formula(text, NAMES), Graph()
    for name, place in LEAVES.items():
        graph.leaf(place, 1 << place, name)
    values = np.random.default_rng(1).uniform(0.3, 1.2, (len(LEAVES), 5))
    table, inputs = dict(zip(LEAVES, values, strict=True)), dict(enumerate(values))
    node, every = graph.node(tree), (1 << len(LEAVES)) - 1
    gradient = graph.gradient(node, every)
    along = {place: graph.constant(place + 1.0) for place in LEAVES.values()}
    (rate,) = graph.rate([node], along)
    slopes = [calculus.differentiate(tree, name) for name in LEAVES]
    true = np.array(arrays.array_values([tree, *slopes], table))
    zero = graph.constant(0.0)
    found = graph.values(
        [node, *(gradient.get(place, zero) for place in LEAVES.values()), rate], inputs
    )
    shown = np.array([np.broadcast_to(one, 5) for one in found])
    whole = np.array([*true, np.arange(1, len(LEAVES) + 1) @ true[1:]])
    assert np.abs(shown - whole).max() <= 1e-12 * (1 + np.abs(whole).max())


def test_rows_that_couple_neighbours_of_a_shuffled_chain_come_side_by_side() -> None:
    shuffled = np.random.default_rng(2).permutation(40)
    pairs = {(int(a), int(b)) for a, b in itertools.pairwise(shuffled)}
    places = ordering(40, pairs)
    assert sorted(places) == list(range(40))
    assert max(abs(places[i] - places[j]) for i, j in pairs) == 1


@pytest.fixture
def limits() -> Iterator[Any]:
    """A way to choose loops (0) or written-out steps (1000 coordinates)."""
    before = looping.SMALL, looping.LONG

    def choose(small: int) -> None:
        looping.is_looped.cache_clear()
        looping.SMALL, looping.LONG = small, -1

    yield choose
    looping.is_looped.cache_clear()
    looping.SMALL, looping.LONG = before


KNIFE = {"r": 1, "phi": 0, "x": 1, "z": 0}
SCENES: dict[str, dict[str, Any]] = {
    "pendulum": pendulum(3) | {"time": 1},
    "chain": oscillators(5) | {"time": 1},
    "springs": {
        "system": {
            "coordinates": ["x", "y", "z"],
            "lagrangian": "(x'^2 + y'^2 + z'^2)/2 - (x^2 + (y - x)^2 + 3*(z - y)^2)/2",
        },
        "initial": {"positions": {"x": 1, "y": 0, "z": 0.2}, "velocities": {"x": 0, "y": 1, "z": 0}},
        "step": 0.1, "time": 1,
    },
    "bodies": bodies(3) | {"time": 0.2},
    "pushed": pendulum(2)
    | {"forces": {"q1": "-q1'/5", "q2": "sin(t)"}, "time": 1, "effects": ["kinetic", "potential", "forces"]},
    "constrained": {
        "system": {
            "coordinates": [*KNIFE], "constraints": ["phi' = x*z'"],
            "lagrangian": "(r'^2 + r^2*phi'^2 + z'^2 + x'^2)/2 - 2*r^2 - x^2/2 - z",
        },
        "initial": {"positions": KNIFE, "velocities": {"r": 0, "x": 0.5, "z": 0.5}}, "step": 0.01, "time": 1,
    },
}  # fmt: skip
RK4, VARIATIONAL = {"method": "runge-kutta", "order": 4}, {"method": "variational"}
FAST = [
    ("constrained", RK4),
    ("constrained", "nonholonomic"),
    ("pushed", VARIATIONAL | {"order": 4}),
    ("springs", VARIATIONAL | {"order": 4}),  # its matrix changes with the length of substeps alone
]
SLOW = [
    ("chain", VARIATIONAL), ("pendulum", "adaptive"), ("bodies", "adaptive"), ("pushed", "adaptive"), ("pendulum", RK4),
    ("pendulum", VARIATIONAL | {"order": 4}), ("bodies", VARIATIONAL), ("pendulum", VARIATIONAL | {"alpha": "0.3"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "method"), [*FAST, *(pytest.param(*one, marks=pytest.mark.slow) for one in SLOW)]
)
def test_loops_make_the_steps_of_a_written_kernel(name: str, method: Any, limits: Any) -> None:
    found = []
    for small in (0, 1000):
        limits(small)
        scene = SCENES[name] | {"methods": [method], "observe": ["trajectory", "constraints"]}
        found.append(simulate(scene)["methods"][0])
    first, second = found
    assert (first["outcome"], first["steps"]) == (second["outcome"], second["steps"])
    for part in ("positions", "velocities"):
        for coordinate, value in second["final"][part].items():
            assert abs(first["final"][part][coordinate] - value) <= 1e-12 * (1 + abs(value))


@pytest.mark.parametrize("method", [RK4, "variational"])
@pytest.mark.parametrize(
    ("position", "velocity", "outcome"),
    [(0.03, -1, "singular"), (-0.03, 1, "singular"), (0.03, 1, "completed"), (-1, -1, "completed")],
)
def test_no_step_passes_a_pole_and_the_first_one_neither(
    position: float, velocity: float, outcome: str, method: Any, limits: Any
) -> None:
    """A wall of 1e-5/x turns a body back before x = 0, from either side, in its first step."""
    scene = {
        "system": {
            "coordinates": ["x", "y", "z"],
            "lagrangian": "(x'^2 + y'^2 + z'^2)/2 - 1/(100000*x)^2 - y*z",
        },
        "initial": {
            "positions": {"x": position, "y": 1, "z": 0},
            "velocities": {"x": velocity, "y": 0, "z": 0},
        },
        "step": 0.1,
        "time": 1,
        "methods": [method],
        "observe": ["trajectory"],
    }
    for small in (0, 1000):
        limits(small)
        (found,) = simulate(scene)["methods"]
        assert (found["outcome"], found["steps"]) == (outcome, 0 if outcome == "singular" else 10)


@pytest.mark.parametrize("links", [2, 7])
@pytest.mark.parametrize("method", ["adaptive", "variational"])
def test_a_run_and_its_run_with_half_the_step_have_one_kernel(links: int, method: str) -> None:
    """Written out or in loops."""
    compiled.loaded_kernels.clear()
    scene = pendulum(links) | {"time": 0.05, "methods": [method], "observe": ["trajectory"]}
    (found,) = simulate(scene)["methods"]
    assert found["estimated_error"] is not None
    assert len(compiled.loaded_kernels) == 1


def test_steps_of_three_links_are_optimized() -> None:
    """Without LLVM's passes they take five times as long; that text grows with what a step does."""
    document = pendulum(3) | {"methods": ["adaptive"], "observe": ["trajectory"]}
    scene, _ = scene_reading.read_scene(scene_reading.scene_schema(document))
    (method,) = scene.methods
    problem = derivation.problem_of(method, derivation.Derived(scene, None))
    assert isinstance(problem, Problem)
    program = schemes.program_of(Formulas(problem), method.choice, ())
    assert compiled.kernel_text(program).count("\n") < compiled.LARGE


PAIR = "(x'^2 + y'^2)/2 - (x - y)^2/2 - (x - y)^4"
POLES: dict[
    str, tuple[str, Any, float, int]
] = {  # force, method, step, limit of what is written out
    "a power of a sine of t": ("1/sin(2*t)^2", "adaptive", 0.01, 1000),
    "a cosine of a place, in loops": ("1/cos(x)", "adaptive", 0.003, 0),
    "a tangent of t, variational": ("tan(t)", "variational", 0.01, 1000),
}
MORE_POLES: dict[str, tuple[str, Any, float, int]] = {
    "a tangent of t": ("tan(t)", "adaptive", 0.013, 1000),
    "a tangent of t, in loops": ("tan(t)", "adaptive", 0.013, 0),
    "a tangent of t, stiff": ("tan(t)", "stiff", 0.05, 1000),
    "a cosine of a place": ("1/cos(x)", "adaptive", 0.003, 1000),
    "a pole of t, variational": (
        "1/(t - 1)",
        {"method": "variational", "alpha": "0.3"},
        0.013,
        1000,
    ),
}


@pytest.mark.parametrize("name", [*POLES, *map(slow, MORE_POLES)])
def test_no_pole_is_passed_between_two_numbers(name: str, limits: Any) -> None:
    """No number is the pole of tan(t): a step shorter than the round-off of t has the same force at
    all of its stages, and would be accepted. Written out and in loops.
    """
    force, method, step, size = (POLES | MORE_POLES)[name]
    limits(size)
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": PAIR}, "forces": {"x": force},
        "initial": {"positions": {"x": 0.4, "y": 0.4}, "velocities": {"x": 0.5, "y": 0.5}},
        "start_time": 0.3, "step": step, "time": 2, "methods": [method],
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "singular"


def test_a_force_that_jumps_is_passed() -> None:
    """x'' = atan(1/(t - 1)) from rest: x(T) is the integral of (T - 1 - u) atan(1/u) from u = -1."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2"}, "forces": {"x": "atan(1/(t - 1))"},
        "initial": {"positions": {"x": 0}, "velocities": {"x": 0}}, "step": 0.013, "steps": 154,
        "methods": ["adaptive"],
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed"
    last = 0.013 * 154 - 1
    true = sum(
        quad(lambda u: (last - u) * np.arctan(1 / u), *ends, epsabs=1e-13)[0]
        for ends in ((-1, 0), (0, last))
    )
    assert found["final"]["positions"]["x"] == pytest.approx(true, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.15, 0.07])
def test_a_pole_in_time_is_not_passed_by_a_large_scene(step: float) -> None:
    """x_0'' = ... + 1/(t - 1) has no motion beyond t = 1, in a chain of 60 springs as alone."""
    names = [f"x{k}" for k in range(60)]
    equations = {name: f"-2*{name}" for name in names}
    for one, other in itertools.pairwise(names):
        equations[one] += f" + {other}"
        equations[other] += f" + {one}"
    equations["x0"] += " + 1/(t - 1)"
    scene = {
        "system": {"coordinates": names, "equations": equations},
        "initial": {
            "positions": dict.fromkeys(names, 0.1),
            "velocities": dict.fromkeys(names, 0),
        },
        "step": step,
        "time": 3,
        "methods": ["adaptive"],
    }
    assert inverse_service.simulate(scene)["methods"][0]["outcome"] == "singular"


@pytest.mark.parametrize("begin", [np.pi, 3000 * np.pi])
def test_what_is_driven_from_rest_at_a_late_time_takes_no_tiny_steps(begin: float) -> None:
    """x'' = sin(t) - (x - y), y'' = x - y, where sin(t) = 0 but for the round-off of t: s = x + y
    has s'' = sin(t), and d = x - y has d'' = sin(t) - 2 d.
    """
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - (x - y)^2/2"},
        "forces": {"x": "sin(t)"}, "start_time": begin,
        "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0, "y": 0}},
        "step": 0.05, "time": 5, "methods": ["adaptive", "stiff"],
    }  # fmt: skip
    w, tau = np.sqrt(2), 5
    s, d = np.sin(tau) - tau, np.sin(w * tau) / w - np.sin(tau)
    sign = np.cos(begin)
    ends = {"x": -sign * (s + d) / 2, "y": -sign * (s - d) / 2}
    for found in simulate(scene)["methods"]:
        assert found["outcome"] == "completed"
        assert found["force_evaluations"] < 10_000
        assert found["final"]["positions"] == pytest.approx(ends, abs=1e-8)


def test_the_third_of_three_springs_is_driven_late_by_the_stiff_method_too() -> None:
    """What moves by t^8 only, the third of a chain, has an error of its own size in every step."""
    names = ["x", "y", "z"]
    scene = {
        "system": {"coordinates": names, "lagrangian": "(x'^2 + y'^2 + z'^2 - (x - y)^2 - (y - z)^2)/2"},
        "forces": {"x": "sin(t)"}, "start_time": (begin := 1e5 * np.pi),
        "initial": {"positions": dict.fromkeys(names, 0), "velocities": dict.fromkeys(names, 0)},
        "step": 0.05, "time": 5, "methods": ["stiff"],
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed"
    whole = sum(found["final"]["positions"].values())
    assert whole == pytest.approx(np.cos(begin) * (5 - np.sin(5)), abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("begin", [100 * np.pi, 3000 * np.pi])
def test_many_that_are_driven_from_rest_at_a_late_time_take_no_tiny_steps(begin: float) -> None:
    names = [f"x{k}" for k in range(40)]
    springs = " - ".join(f"({a} - {b})^2/2" for a, b in itertools.pairwise(names))
    kinetic = " + ".join(f"{name}'^2/2" for name in names)
    scene = {
        "system": {"coordinates": names, "lagrangian": f"{kinetic} - {springs}"},
        "forces": {"x0": "sin(t)"}, "start_time": begin,
        "initial": {"positions": dict.fromkeys(names, 0), "velocities": dict.fromkeys(names, 0)},
        "step": 0.05, "time": 5, "methods": ["adaptive"],
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed"
    assert found["force_evaluations"] < 10_000
    # The whole is moved by the force alone.
    whole = sum(found["final"]["positions"].values())
    assert whole == pytest.approx(np.cos(begin) * (5 - np.sin(5)), abs=1e-9)
