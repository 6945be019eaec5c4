"""Which steps run in the loops of `kernels.codegen.loops`, and their programs from the graph of a
scene.

A step that is written out for its scene is faster where it is short. Compiled code grows with it,
by the number of stages and by eliminations, while loops call the formulas of the scene, which are
compiled once.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from inverse_service.expressions import printing, tree as ex
from inverse_service.expressions.graphs import components
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Outcome
from inverse_service.kernels.codegen import graph as graphs, looped
from inverse_service.kernels.codegen.kernel import ROUND_OFF_AT_START
from inverse_service.simulation import numeric_formulas as nf, resting, scene_data as data
from inverse_service.simulation.scene_graph import (
    MOMENT,
    PARAMETER,
    PLACE,
    SETTING,
    SPEED,
    STEP,
    SceneGraph,
    graph_of,
    uses_own_lagrangian,
)
from inverse_service.simulation.sentences import say

SMALL, SHORT = 2, 300  # coordinates, and nodes of formulas, up to which no step is long
MOST_CONSTRAINTS, MOST_OPERATIONS = 4, 400_000
# Of steps that are written out, as measured for dense masses, links, bodies, and chains: lines of
# code for an operation of the formulas and of an elimination, and lines that take a minute and a
# gigabyte to compile.
LINES_OF_FORMULAS, LINES_OF_ELIMINATION, MOST_LINES = 3.3, 4.7, 500_000
LONG, COUPLED = (
    4000,
    6,
)  # operations of a step; unknowns of one block, whose elimination is written out
MOVING = MOMENT | PLACE | SPEED
EXPLICIT, OWN = ("adaptive", "runge_kutta"), ("hamiltonian", "raw")
WRITTEN_OUT = ("reference", "stiff")  # whose stages are solved, and which have no loops


@lru_cache(maxsize=64)
def is_looped(problem: data.Problem, choice: data.MethodChoice) -> bool:
    """Whether the steps of a method run in loops: those that are long, of methods that have
    loops.
    """
    is_short = sum(map(ex.node_count, problem.formulas)) <= SHORT
    if (len(problem.coordinates) <= SMALL and is_short) or not _has_loops(problem, choice):
        return False
    if nf.switching_functions(problem.formulas, problem.coordinates):
        return False
    try:
        program = program_of(problem, choice, ())
    except graphs.NotInGraph:
        return False
    if not all(map(program.graph.is_compilable, program.outputs.values())):
        return False
    plan = looped.plan_of(program)
    if (
        len(problem.constraints) > MOST_CONSTRAINTS
    ):  # the rank of fewer is watched in steps that are written out
        return True
    sizes = _blocks(len(program.right), program.entries)
    size = len(program.graph.operations(program.outputs["evaluate"])) + sum(
        count**3 for count in sizes
    )
    return max(sizes) > COUPLED or size * plan.numbers.get("stages", 1) > LONG


def _blocks(size: int, pairs: Iterable[tuple[int, int]]) -> list[int]:
    """The sizes of the blocks of a matrix with entries at these (row, column)."""
    coupled: dict[int, set[int]] = {k: set() for k in range(size)}
    for i, j in pairs:
        coupled[i].add(j)
        coupled[j].add(i)
    return [len(block) for block in components({k: sorted(coupled[k]) for k in coupled})]


def _has_loops(problem: data.Problem, choice: data.MethodChoice) -> bool:
    if choice.method in EXPLICIT:
        return problem.lagrangian is not None or problem.accelerations is not None
    if choice.symmetrised and choice.alpha != 0.5:
        return False
    own = choice.method == "variational" and choice.form in OWN and uses_own_lagrangian(problem)
    return own or choice.method == "nonholonomic"


def program_of(
    problem: data.Problem, choice: data.MethodChoice, observation: data.Observation
) -> looped.LoopProgram:
    """The program of a method; raises NotInGraph where a formula is none of numbers."""
    scene = graph_of(problem)
    g, n, watches = scene.graph, scene.size, list[tuple[str, int, str, str]]()
    observed = []
    for one in observation:
        node = g.node(one.expression)
        observed.append((one.name, g.add(scene.energy, node) if one.with_energy else node))
    explicit, tableau = choice.method in EXPLICIT, 0
    if explicit:
        orders = (*method_table.TABLEAUX,)
        tableau = choice.order if choice.order in orders else orders[0]
        if choice.method == "adaptive":
            tableau = method_table.order_of_pair(choice.order)
    if choice.guard and choice.method != "adaptive":
        watches = [
            ("sign", g.node(wall), printing.to_text(wall), say("regular_motion"))
            for wall in walls_of(problem)
        ]
    parts: dict[str, Any]
    if not explicit:
        right, entries, pushes = scene.discrete
        parts = {"right": right, "entries": entries, "pushes": pushes}
    elif problem.accelerations is not None:
        parts = {"right": scene.accelerations}
    else:
        parts = dict(zip(("right", "entries"), scene.linear, strict=True))
    is_adaptive = choice.method == "adaptive"
    if is_adaptive and problem.depends_on_time:
        parts["noise"] = scene.terms()
    count = len(g.operations(node for part in parts.values() for node in _nodes(part)))
    if count > MOST_OPERATIONS:
        raise data.Unavailable(say("too_many_operations", f"{count:,}", f"{MOST_OPERATIONS:,}"))
    moving = MOVING | (0 if explicit or choice.order <= 2 else STEP | SETTING)
    return looped.LoopProgram(
        g, n, len(problem.parameters), watches=watches, observed=observed, tableau=tableau, adaptive=is_adaptive,
        moving=moving, **parts,
    )  # fmt: skip


def _nodes(part: Any) -> Iterator[int]:
    yield from part.values() if isinstance(part, dict) else part


def evaluated(
    problem: data.Problem, choice: data.MethodChoice, observation: data.Observation
) -> tuple[SceneGraph, list[int]]:  # fmt: skip
    """The graph of a problem and the nodes that a step evaluates, whether it runs in loops or is
    written out.
    """
    if _has_loops(problem, choice):
        outputs = program_of(problem, choice, observation).outputs.values()
        return graph_of(problem), [node for part in outputs for node in part]
    names, tree = problem.coordinates, problem.free_hamiltonian
    if choice.method == "variational" and choice.form != "raw" and tree is not None:
        momenta = [f"p_{name}" for name in names]
        problem = replace(problem, parameters=(*problem.parameters, *momenta))
        scene = graph_of(problem)
        moving = {scene.graph.read[name] for name in map(ex.Symbol, (*names, *momenta))}
        slopes = scene.graph.gradient(scene.graph.node(tree), PLACE | PARAMETER)
        nodes = [
            node
            for place, node in slopes.items()
            if scene.graph.known[graphs.LEAF, place, None] in moving
        ]
    else:
        scene = graph_of(problem)
        free = problem.free_lagrangian
        if free is not None:
            sums, nodes = [scene.graph.node(free)], list[int]()
        elif problem.accelerations is not None:
            sums = nodes = scene.accelerations
        else:
            sums = nodes = [*scene.linear[0], *scene.linear[1].values()]
        if choice.method != "reference":
            rows = (scene.graph.gradient(node, PLACE | SPEED).values() for node in sums)
            nodes = [*nodes, *(slope for row in rows for slope in row)]
    energies = [scene.energy for one in observation if one.with_energy]
    others = [scene.graph.node(one.expression) for one in observation]
    return scene, [*nodes, *scene.constraints, *scene.forces, *energies, *others]


def refuse_long(problem: data.Problem, choice: data.MethodChoice) -> None:
    """Unavailable where the step of a method that is written out, with an elimination at each of
    its stages, would take too long to compile: told before anything is written.
    """
    if choice.method not in WRITTEN_OUT:
        return
    try:
        lines = code_length(problem, choice)
    except graphs.NotInGraph:
        return
    if lines > MOST_LINES:
        raise data.Unavailable(say("too_long_to_compile", f"{lines:,.0f}", f"{MOST_LINES:,}"))


def code_length(problem: data.Problem, choice: data.MethodChoice) -> float:
    """About how many lines of code a step of `reference` or `stiff` is; of those that are far too
    many, at least how many.
    """
    scene = graph_of(problem)
    is_stiff, n = choice.method == "stiff", scene.size
    stages = len((method_table.RODAS if is_stiff else method_table.GAUSS_LEGENDRE).nodes)
    right, entries = scene.accelerations, dict[tuple[int, int], int]()
    if problem.accelerations is None:
        right, entries = scene.linear
    one = LINES_OF_ELIMINATION * _elimination(len(right), [*entries])
    solved = stages + (2 * n + 2 if is_stiff else 0)  # the slopes by each q and v
    lines = solved * one
    if lines > MOST_LINES:
        return lines
    nodes = [*right, *entries.values()]
    lines += stages * LINES_OF_FORMULAS * len(scene.graph.operations(nodes))
    if is_stiff:
        pairs = [*entries, *_dependences(scene, right, entries)]
        blocks = _blocks(len(right), pairs)  # each is eliminated as a full one
        lines += stages * LINES_OF_ELIMINATION * sum(count**3 for count in blocks) / 3
    return lines


def _elimination(size: int, pairs: list[tuple[int, int]]) -> int:
    """The operations of an elimination whose rows are in an order that keeps its entries near the
    diagonal.
    """
    order, reach = graphs.ordering(size, pairs), [0] * size
    for i, j in pairs:
        first, last = sorted((order[i], order[j]))
        reach[first] = max(reach[first], last - first)
    for k in range(1, size):  # what an elimination fills in
        reach[k] = max(reach[k], reach[k - 1] - 1)
    return sum(one * one for one in reach)


def _dependences(
    scene: SceneGraph, right: Sequence[int], entries: Mapping[tuple[int, int], int]
) -> Iterator[tuple[int, int]]:
    """Which row changes with the place or the velocity of which coordinate."""
    g, n, held = scene.graph, scene.size, dict[int, int]()
    for k in g.below([*right, *entries.values()]):
        operation, place, _ = g.keys[k]
        own = 0
        if operation == graphs.LEAF and 0 < place <= 2 * n:
            own = 1 << (place - 1) % n
        for part in g.parts(k):
            own |= held[part]
        held[k] = own
    rows = [*enumerate(right), *((i, node) for (i, _), node in entries.items())]
    masks = [0] * len(right)
    for i, node in rows:
        masks[i] |= held[node]
    for i, mask in enumerate(masks):
        yield from ((i, j) for j in range(n) if mask >> j & 1)


def walls_of(problem: data.Problem) -> Iterator[ex.Expression]:
    """Poles, ends and kinks of the formulas of a motion, whose signs stay."""
    names = (*problem.coordinates, ex.TIME.name)
    trees = (
        problem.lagrangian,
        *(problem.accelerations or ()),
        *problem.constraints,
        *problem.forces,
    )
    yield from dict.fromkeys(
        wall for tree in trees if tree is not None for wall in nf.walls(tree, names)
    )


def depends_on_velocities(problem: data.Problem) -> bool:
    """Whether an acceleration does."""
    scene = graph_of(problem)
    right, entries = scene.linear
    return any(scene.graph.masks[node] & SPEED for node in (*right, *entries.values()))


def momenta_at(problem: data.Problem, columns: Mapping[str, Any]) -> Any:
    """L_v at the numbers of a kernel by name, (..., n)."""
    scene = graph_of(problem)
    found = scene.graph.values(scene.momenta, _inputs(scene, columns))
    return np.stack(np.broadcast_arrays(*found), axis=-1)


def without_force(problem: data.Problem, columns: Mapping[str, Any]) -> Outcome | None:
    """The outcome if a force of the scene has no value at the start: it is not finite, or divides
    by 0, or takes the logarithm of 0, even if the value seems to be one, as atan(v/x) at x = 0.
    """
    scene = graph_of(problem)
    g, inputs = scene.graph, _inputs(scene, columns)
    forces = scene.linear[0][: scene.size]
    values = np.array(g.values(forces, inputs), dtype=float)
    lost = ~np.isfinite(values)
    below = g.below(forces)
    divisors = {
        k: g.keys[k][1] for k in below if g.keys[k][0] == graphs.RECIPROCAL or g.keys[k][2] == "log"
    }
    zeros = np.array(g.values([*divisors.values()], inputs), dtype=float) == 0.0
    at_zero = {k for k, zero in zip(divisors, zeros, strict=True) if zero}
    for k, name in enumerate(problem.coordinates):
        if lost[k] or (at_zero and at_zero.intersection(g.below([forces[k]]))):
            begin = float(columns["t"])
            quantity = say("force_without_value", name, begin)
            return Outcome("off_domain", 0, begin, quantity, None, say("begin_elsewhere_or_later"))
    return None


def kept_at_start(
    problem: data.Problem, choice: data.MethodChoice, columns: Mapping[str, Any]
) -> dict[str, Any]:
    """What the memory of the loops has besides the state: signs of walls, and what stays at rest."""
    signs = first_signs(problem, choice, columns)
    if choice.method not in EXPLICIT or not is_looped(problem, choice):
        return signs
    return signs | resting.held(problem, columns)


def first_signs(
    problem: data.Problem, choice: data.MethodChoice, columns: Mapping[str, Any]
) -> dict[str, Any]:
    """The signs that walls have at the start, where they are more than round-off: the first step
    may pass a zero.
    """
    if not choice.guard or choice.method == "adaptive" or not is_looped(problem, choice):
        return {}
    scene, found = graph_of(problem), {}
    g, inputs = scene.graph, _inputs(scene, columns)
    with np.errstate(all="ignore"):
        for place, wall in enumerate(map(g.node, walls_of(problem))):
            slopes = g.gradient(wall, MOVING)
            value, *rates = g.values([wall, *slopes.values()], inputs)
            noise = sum(abs(rate * inputs[k]) for k, rate in zip(slopes, rates, strict=True))
            found[f"watch_{place}"] = np.where(
                np.abs(value) > ROUND_OFF_AT_START * noise, np.sign(value), 0.0
            )
    return found


def _inputs(scene: SceneGraph, columns: Mapping[str, Any]) -> dict[int, Any]:
    """The inputs of a graph from the numbers of a kernel by name."""
    n, found = scene.size, {0: columns.get("t", 0.0)}
    found |= {1 + k: columns[f"q{k}"] for k in range(n)} | {
        1 + n + k: columns[f"v{k}"] for k in range(n)
    }
    return found | {3 + 2 * n + k: columns[f"c{k}"] for k in range(len(scene.problem.parameters))}
