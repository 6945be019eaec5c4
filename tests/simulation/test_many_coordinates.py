"""Scenes with many coordinates, against programs that know nothing of this one."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from api_schemas import base
from benchmarks.scene_families import bodies, oscillators, pendulum
from inverse_service.errors import InputError
from inverse_service.expressions import refusals, tree as ex
from inverse_service.kernels.codegen import compiled
from inverse_service.reading import names as nm, reader
from inverse_service.service.scenes import scene_lagrangian, scene_reading
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation import (
    derivation,
    looping,
    numeric_formulas,
    scene_data as data,
    schemes,
)

Array = Any


def pendulum_rates(t: float, y: Array) -> Array:
    """n links of length and mass 1: M_ij = (n - max(i, j)) cos(q_i - q_j), from a textbook's torque
    balance.
    """
    q, v = np.split(y, 2)
    count = len(q)
    weights = count - np.maximum.outer(np.arange(count), np.arange(count)).astype(float)
    apart = np.subtract.outer(q, q)
    right = -(weights * np.sin(apart)) @ v**2 - 9.81 * np.diagonal(weights) * np.sin(q)
    return np.concatenate([v, np.linalg.solve(weights * np.cos(apart), right)])


def gravity_rates(t: float, y: Array) -> Array:
    """Masses 1/n, G = 1."""
    q, v = (half.reshape(-1, 3) for half in np.split(y, 2))
    apart = q[None] - q[:, None]
    cubes = (apart**2).sum(axis=2) ** 1.5 + np.eye(len(q))
    return np.concatenate([v.ravel(), ((apart / cubes[:, :, None]).sum(axis=1) / len(q)).ravel()])


def chain_rates(t: float, y: Array) -> Array:
    """x_k'' = F(x_(k+1) - x_k) - F(x_k - x_(k-1)) with F(d) = d + d^2/4."""
    q, v = np.split(y, 2)
    stretched = np.diff(np.concatenate([[0], q, [0]]))
    return np.concatenate([v, np.diff(stretched + stretched**2 / 4)])


CASES: dict[str, Any] = {
    "pendulum": (pendulum(10) | {"time": 2}, pendulum_rates),
    "bodies": (bodies(8) | {"time": 0.5}, gravity_rates),
    "chain": (oscillators(40) | {"time": 3}, chain_rates),
}


@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_an_independent_program(name: str) -> None:
    scene, rates = CASES[name]
    (found,) = simulate(scene | {"observe": ["trajectory"]})["methods"]
    begin = [
        scene["initial"][part][x]
        for part in ("positions", "velocities")
        for x in scene["system"]["coordinates"]
    ]
    true = solve_ivp(rates, (0, scene["time"]), begin, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    end = [
        found["final"][part][x]
        for part in ("positions", "velocities")
        for x in scene["system"]["coordinates"]
    ]
    assert found["outcome"] == "completed"
    assert np.abs(np.array(end) - true).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [{"method": "variational", "order": 8}, {"method": "runge-kutta", "order": 8}]
)
def test_other_methods_agree_for_a_chain_of_links(method: dict[str, Any]) -> None:
    scene = pendulum(10) | {"time": 1, "step": 0.005, "observe": ["trajectory"]}
    first, second = (
        simulate(scene | {"methods": [one]})["methods"][0] for one in (method, "adaptive")
    )
    for x, value in second["final"]["positions"].items():
        assert abs(first["final"]["positions"][x] - value) < 1e-9


@pytest.mark.slow
def test_links_at_rest_begin_to_move_from_the_other_end() -> None:
    """Only the last of seven links is pushed, by 1e-12 to 2: the others have forces that fall to
    round-off from link to link.
    """
    scene, begin = pendulum(7) | {"time": 0.5}, np.zeros(14)
    names = scene["system"]["coordinates"]
    for speed in (2.0, 1e-12):
        begin[-1] = speed
        start = {
            "positions": dict.fromkeys(names, 0),
            "velocities": {**dict.fromkeys(names, 0), names[-1]: speed},
        }
        (found,) = simulate(scene | {"initial": start, "methods": ["adaptive"]})["methods"]
        assert found["outcome"] == "completed"
        true = solve_ivp(
            pendulum_rates, (0, 0.5), begin, "DOP853", rtol=1e-12, atol=1e-13 * speed
        ).y[:7, -1]
        end = np.array([*found["final"]["positions"].values()])
        assert np.abs(end - true).max() < 1e-11 * speed


def test_what_is_hardly_out_of_balance_falls() -> None:
    """Six links stand upright, the last one 1e-13 from it: 400 times its last bit."""
    scene = pendulum(6) | {"time": 1.5, "observe": ["trajectory"], "methods": ["adaptive"]}
    names = scene["system"]["coordinates"]
    begin = np.array([*[np.pi] * 5, np.pi + 1e-13, *[0.0] * 6])
    start = {
        "positions": dict(zip(names, begin, strict=False)),
        "velocities": dict.fromkeys(names, 0),
    }
    (found,) = simulate(scene | {"initial": start})["methods"]
    fallen = np.array([*found["final"]["positions"].values()]) - np.pi

    def rates(t: float, y: Array) -> Array:
        shifted = pendulum_rates(t, y)  # sin(q - pi) = -sin(q), to all its digits
        still = pendulum_rates(t, np.concatenate([y[:6], 0 * y[6:]]))
        return shifted - 2 * np.concatenate([0 * y[:6], still[6:]])

    true = solve_ivp(
        rates, (0, 1.5), begin - [*[np.pi] * 6, *[0] * 6], "DOP853", rtol=1e-10, atol=1e-22
    ).y[:6, -1]
    assert np.abs(true).max() > 1e-11
    assert np.abs(fallen - true).max() < 0.1 * np.abs(true).max()


def test_a_force_acts_in_proportion_however_small_it_is() -> None:
    scene = pendulum(6) | {"time": 0.1, "observe": ["trajectory"], "methods": ["adaptive"]}
    names = scene["system"]["coordinates"]
    start = {"positions": dict.fromkeys(names, 0), "velocities": dict.fromkeys(names, 0)}
    pushed, ends = scene["system"]["lagrangian"] + " + f*(q1 - 3*q5)", []
    for size in (1e-6, 1e-25):
        values = {"system": scene["system"] | {"lagrangian": pushed}, "initial": start}
        values["parameters"] = {**scene["parameters"], "f": size}
        (found,) = simulate(scene | values)["methods"]
        assert found["outcome"] == "completed"
        assert "doubt" not in found
        ends.append(np.array([*found["final"]["positions"].values()]) / size)
    assert np.abs(ends[1] - ends[0]).max() < 1e-9 * np.abs(ends[0]).max()


def test_links_below_one_that_dry_friction_holds_are_a_shorter_pendulum() -> None:
    scene = pendulum(3) | {
        "time": 0.3,
        "step": 0.05,
        "methods": ["adaptive"],
        "observe": ["trajectory"],
    }
    (found,) = simulate(
        scene | {"effects": ["potential", "forces"], "forces": {"q1": "-1000*sign(q1')"}}
    )["methods"]
    begin = [0.3] * 2 + [0] * 2
    true = solve_ivp(pendulum_rates, (0, 0.3), begin, "DOP853", rtol=1e-12, atol=1e-12).y[:2, -1]
    end = np.array([*found["final"]["positions"].values()])
    assert abs(end[0] - 0.3) < 1e-14
    assert np.abs(end[1:] - true).max() < 1e-9


@pytest.mark.parametrize("method", ["reference", pytest.param("stiff", marks=pytest.mark.slow)])
def test_implicit_methods_solve_for_the_accelerations_of_many_links(method: str) -> None:
    scene = pendulum(5) | {"time": 0.5, "methods": [method], "observe": ["trajectory"]}
    (found,) = simulate(scene)["methods"]
    begin = [0.3] * 5 + [0] * 5
    true = solve_ivp(pendulum_rates, (0, 0.5), begin, "DOP853", rtol=1e-12, atol=1e-12).y[:5, -1]
    assert np.abs(np.array([*found["final"]["positions"].values()]) - true).max() < 1e-8


def gravity_slopes(q: Array) -> Array:
    """The derivatives of the forces between masses 1/n."""
    places, n = q.reshape(-1, 3), len(q) // 3
    found = np.zeros((n, 3, n, 3))
    for i, j in itertools.permutations(range(n), 2):
        apart = places[j] - places[i]
        far = np.linalg.norm(apart)
        slope = (np.eye(3) / far**3 - 3 * np.outer(apart, apart) / far**5) / n**2
        found[i, :, j] += slope
        found[i, :, i] -= slope
    return found.reshape(3 * n, 3 * n)


def midpoint_step(q: Array, p: Array, h: float, d: Array) -> tuple[Array, float]:
    """d with (d/h)/n - h/2 F(q + d/2) = p by Newton's method, and the determinant there, where it
    is 1 at h = 0; nan if there is no such d.
    """
    n, zero = len(q) // 3, np.zeros(len(q))

    def matrix() -> Array:
        return np.eye(len(q)) - n * h**2 / 4 * gravity_slopes(q + d / 2)

    for _ in range(50):
        force = gravity_rates(0, np.concatenate([q + d / 2, zero]))[len(q) :]
        change = np.linalg.solve(matrix(), n * p * h + h**2 / 2 * force - d)
        d = d + change
        if np.abs(change).max() <= 1e-14:
            return d, float(np.linalg.det(matrix()))
    return d * math.nan, math.nan


@pytest.mark.slow
def test_a_variational_run_ends_where_its_equations_have_no_solution_any_more() -> None:
    """Three bodies, two of which come close: the step that is not made has no solution that is one
    with growing steps from 0, as continuation by another program shows; the one before has.
    """
    scene, h = bodies(3) | {"methods": [{"method": "variational", "alpha": 0.5}]}, 0.01
    (found,) = simulate(scene | {"observe": ["trajectory"]})["methods"]
    assert found["outcome"] == "no_convergence"
    begin = scene["initial"]
    q = np.array([begin["positions"][name] for name in scene["system"]["coordinates"]])
    v = np.array([begin["velocities"][name] for name in scene["system"]["coordinates"]])
    p, last = v / 3, v * h
    for _ in range(found["steps"]):
        last, determinant = midpoint_step(q, p, h, last)
        assert determinant > 0
        p = p + (2 / 3 / h) * last - 2 * p  # the push is the same on both halves
        q = q + last
    end = [found["final"]["positions"][name] for name in scene["system"]["coordinates"]]
    assert np.abs(q - end).max() < 1e-9
    reached, step, d = 1e-6, h / 200, 3 * p * 1e-6
    while reached < h and step > 1e-8:
        longer = reached + step
        tried, determinant = midpoint_step(q, p, longer, d * longer / reached)
        if determinant > 0 and np.abs(tried - d).max() < 0.3 * np.abs(d).max():
            reached, d = longer, tried
        else:
            step /= 2
    assert reached < h / 2
    assert np.linalg.norm(d.reshape(3, 3), axis=1).max() < 1  # a fold, no escape


@pytest.mark.parametrize(
    "count", [40, *(pytest.param(n, marks=pytest.mark.slow) for n in (64, 256))]
)
def test_a_scene_takes_many_coordinates(count: int) -> None:
    scene = oscillators(count) | {"time": 0.02, "observe": ["trajectory"]}
    assert simulate(scene)["methods"][0]["outcome"] == "completed"


@pytest.mark.slow
def test_a_formula_of_a_scene_may_have_more_characters_than_one_to_solve() -> None:
    scene = oscillators(1) | {"time": 0.02, "observe": ["trajectory"]}
    long = scene["system"]["lagrangian"] + " + 0*x1" * 3_000
    assert len(long) > 20_000
    (found,) = simulate(scene | {"system": scene["system"] | {"lagrangian": long}})["methods"]
    assert found["final"] == simulate(scene)["methods"][0]["final"]


def test_more_coordinates_are_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match="256"):
        simulate(oscillators(257))


def test_formulas_of_scenes_are_limited_by_their_characters_alone() -> None:
    with refusals.longer_texts(base.LONGER_IN_SCENES, scene_reading.SHORT_PARTS):
        assert refusals.most_tokens() >= refusals.most_characters() == 200_000


@pytest.mark.nightly
def test_an_l_of_nearly_200_000_characters_runs() -> None:
    scene = bodies(83) | {"time": 0.02, "observe": ["trajectory"]}
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed"


def coupled(count: int) -> dict[str, Any]:
    """Masses each of which pulls at every other, so that the matrix of the accelerations is full."""
    names = [f"x{k}" for k in range(1, count + 1)]
    together = " + ".join(f"cos({name})*{name}'" for name in names)
    alone = " + ".join(f"({name}'^2 - {name}^2)/2" for name in names)
    system = {"coordinates": names, "lagrangian": f"({together})^2/2 + {alone}"}
    start = {"positions": dict.fromkeys(names, 0.3), "velocities": dict.fromkeys(names, 0)}
    return {"system": system, "initial": start, "step": 0.01, "time": 0.1}


@pytest.mark.parametrize("method", ["reference", "stiff"])
def test_a_step_too_long_to_compile_is_refused_before_it_is_written(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any) -> Any:
        raise AssertionError("nothing is written")

    monkeypatch.setattr(schemes, "program_of", never)
    (found,) = simulate(coupled(40) | {"methods": [method]})["methods"]
    assert found["outcome"] == "unavailable"
    assert "500,000 take over a minute and a gigabyte to compile. Take adaptive" in found["reason"]


def test_a_step_too_long_to_compile_is_refused_for_an_ensemble_too() -> None:
    members = {"initial": {"velocities": {"x1": [0.1, 0.2]}}}
    (found,) = simulate(coupled(40) | {"methods": ["reference"], "ensemble": members})["methods"]
    assert found["outcome"] == "unavailable"
    assert "500,000 take over a minute and a gigabyte to compile" in found["reason"]


@pytest.mark.parametrize("method", ["reference", "stiff"])
def test_the_length_of_a_step_is_known_before_it_is_written(method: str) -> None:
    schema = scene_reading.scene_schema(coupled(4) | {"methods": [method], "observe": []})
    scene, system = scene_reading.read_scene(schema)
    derived = derivation.Derived(scene, scene_lagrangian.finder(schema, system))
    (asked,) = scene.methods
    problem = derivation.problem_of(asked, derived)
    program = schemes.program_of(numeric_formulas.formulas_of(problem), asked.choice, ())
    written = compiled.kernel_text(program).count("\n")
    assert written / 4 < looping.code_length(problem, asked.choice) < 2 * written


def _terms(characters: int, text: str) -> str:
    """A sum of so many characters of terms that differ."""
    found, length = list[str](), 0
    while length < characters:
        found.append(text.format(len(found) + 1))
        length += len(found[-1]) + 3
    return " + ".join(found)


LONG_TEXT = _terms(21_000, "sin({0}*x)/{0}")


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys",
    [
        {"system": {"coordinates": ["x"], "equations": {"x": f"-x - ({LONG_TEXT})/100000"}}},
        {"system": {"coordinates": ["x"], "equations": [f"x'' + x + ({LONG_TEXT})/100000 = 0"]}},
        {"forces": {"x": f"-x - ({LONG_TEXT})/100000"}},
        {"observe": [{"u": LONG_TEXT}]},
        {"points": {"bob": [LONG_TEXT, "0"]}},
        {"events": [{"when": f"x - 3 + ({LONG_TEXT})/100000"}]},
    ],
    ids=["accelerations", "equations", "force", "observable", "point", "event"],
)
def test_every_formula_of_a_scene_may_be_as_long_as_its_lagrangian(keys: dict[str, Any]) -> None:
    """More than 20,000 characters, which is the limit for documents that are solved, in each."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01,
        "time": 0.02,
        "methods": ["adaptive"],
        "observe": [],
    }
    schema = scene_reading.scene_schema(scene | keys)
    read, _ = scene_reading.read_scene(schema)
    assert read.grid.steps == 2


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("x + " * 50_000 + "x", "at most 200000 characters"),
        pytest.param(
            "(" * 90_000 + "x" + ")" * 90_000, "nested too deeply", marks=pytest.mark.slow
        ),
        ("1" * 190_000, "too many digits"),
    ],
)
def test_an_acceleration_without_end_is_one_sentence(text: str, why: str) -> None:
    """Too long, too deep, or a number without end; texts of brackets in brackets fill no memory."""
    scene = {
        "system": {"coordinates": ["x"], "equations": {"x": text}},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01,
        "time": 1,
    }
    with pytest.raises(InputError, match=why):
        scene_reading.read_scene(scene_reading.scene_schema(scene))


def test_long_formulas_of_one_coordinate_run_in_loops() -> None:
    """A force of 4,000 characters is not written out for each of twelve stages."""
    force = reader.read_formula(_terms(4_000, "sin({0}*x)/{0}"), nm.Names(("x",)))
    problem = data.Problem(("x",), accelerations=(force,))
    assert looping.is_looped(problem, data.MethodChoice("adaptive"))
    short = data.Problem(("x",), accelerations=(ex.Symbol("x"),))
    assert not looping.is_looped(short, data.MethodChoice("adaptive"))


@pytest.mark.slow
def test_a_scene_by_equations_has_as_many_coordinates_as_one_by_a_lagrangian() -> None:
    """200 springs by their accelerations; 64 is the limit for documents that are solved."""
    names = [f"x{k}" for k in range(200)]
    scene = {
        "system": {"coordinates": names, "equations": {name: f"-{name}" for name in names}},
        "initial": {
            "positions": dict.fromkeys(names, 1),
            "velocities": dict.fromkeys(names, 0),
        },
        "step": 0.1,
        "time": 1,
        "methods": [{"method": "runge-kutta", "order": 8}],
    }
    (run,) = simulate(scene)["methods"]
    assert run["final"]["positions"]["x199"] == pytest.approx(math.cos(1), abs=1e-9)
