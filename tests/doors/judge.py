"""Test Lagrangians, Hamiltonians, and interpretations numerically at random points of the
domain.
"""

import itertools
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mpmath

from tests.doors.formulas import DIGITS, Jet, NotReal, Point

TRIES = 4_000
NEAR_ZERO = mpmath.mpf(10) ** -18


@dataclass(frozen=True)
class Equations:
    """q'' = f in canonical texts, and the roles of its names."""

    coordinates: tuple[str, ...]
    accelerations: tuple[str, ...]
    values: Mapping[str, Any] = field(default_factory=dict)
    time: str = "t"

    @property
    def velocities(self) -> tuple[str, ...]:
        return tuple(name + "'" for name in self.coordinates)

    @property
    def variables(self) -> tuple[str, ...]:
        return (self.time, *self.coordinates, *self.velocities)


def equations_of(system: Mapping[str, Any], values: Mapping[str, Any] | None = None) -> Equations:
    """The equations of `system.equations` in a result, or of a document with explicit
    accelerations.
    """
    names = tuple(system.get("coordinates") or system["equations"])
    texts = tuple(system["equations"][name] for name in names)
    return Equations(names, texts, values or {}, system.get("time") or "t")


class _Anything(dict[str, Any]):
    """A parameter gets a value on first use, determined by name and seed, and positive unless
    `signs`.
    """

    def __init__(self, given: Mapping[str, Any], seed: int, high: int, signs: bool) -> None:
        super().__init__(given)
        self.seed, self.high, self.signs = seed, high, (-1, 1) if signs else (1,)

    def __contains__(self, name: object) -> bool:
        return name != "pi" or super().__contains__(name)

    def __missing__(self, name: str) -> Any:
        draw = random.Random(f"{name} {self.seed}")
        self[name] = (
            mpmath.mpf(draw.randint(10**6, self.high * 10**6))
            / (5 * 10**6)
            * draw.choice(self.signs)
        )
        return self[name]


def points(
    given: Equations,
    domain: Sequence[str] = (),
    near: Mapping[str, Any] | None = None,
    integrals: Mapping[str, Any] | None = None,
    seed: int = 1,
    tries: int = TRIES,
) -> Iterator[Point]:
    """Random points of a domain with values of the parameters, starting close to `near` if it is
    given.
    """
    draw = random.Random(seed)
    for attempt in range(tries):
        numbers: dict[str, Any] = {}
        close = near if attempt % 2 == 0 else None
        span = (0.02, 0.1, 0.3)[attempt // 2 % 3]
        signs = attempt > 40
        high = 2 + 2 * (attempt // 2 % 4)
        for name in given.variables:
            numbers[name] = mpmath.mpf(draw.uniform(0.1, 0.3 * high)) * (
                draw.choice((-1, 1)) if signs else 1
            )
        for name, value in (close or {}).items():
            numbers[name] = _number(value) * (1 + mpmath.mpf(draw.uniform(-span, span)))
        numbers |= {
            name: _number(value) for name, value in given.values.items() if value is not None
        }
        point = Point({}, given.variables, integrals)
        point.numbers = _Anything(numbers, draw.randint(0, 10**6), high, attempt > tries // 2)
        try:
            if all(map(point.holds, domain)) and all(
                point.jet(text) for text in given.accelerations
            ):
                yield point
        except NotReal:
            continue


def _number(value: Any) -> Any:
    above, _, below = str(value).partition("/")
    return mpmath.mpf(above) / mpmath.mpf(below or 1)


def faults_of_lagrangian(
    text: str,
    given: Equations,
    domain: Sequence[str] = (),
    near: Mapping[str, Any] | None = None,
    integrals: Mapping[str, Any] | None = None,
    count: int = 2,
    tries: int = TRIES,
) -> str | None:
    """None if L is regular and its Euler-Lagrange expressions vanish along f at `count` points,
    else the failure.
    """
    with mpmath.workdps(DIGITS):
        seen = 0
        for point in points(given, domain, near, integrals, tries=tries):
            try:
                jet = point.jet(text)
                forces = [point.value(f) for f in given.accelerations]
            except NotReal:
                continue
            g, rest = euler_lagrange(jet, given, point)
            scaled = [[x / (max(map(abs, row)) or 1) for x in row] for row in g]
            if forces and abs(mpmath.det(mpmath.matrix(scaled))) <= mpmath.mpf(10) ** -24:
                return f"singular Hessian of {text}"
            for row, b in zip(g, rest, strict=True):
                parts = [x * f for x, f in zip(row, forces, strict=True)]
                if abs(mpmath.fsum([*parts, b])) > NEAR_ZERO * (1 + max(map(abs, [*parts, b]))):
                    return f"{text} has other equations"
            seen += 1
            if seen == count:
                return None
        return f"no point of the domain of {text} was found"


def euler_lagrange(jet: Jet, given: Equations, point: Point) -> tuple[list[list[Any]], list[Any]]:
    """(g, b) of the expressions g q'' + b: g = L_vv, b = L_vt + L_vq v - L_q."""
    n, at = len(given.coordinates), jet.bends
    speeds = [point.numbers[v] for v in given.velocities]
    zero = mpmath.mpf(0)

    def second(i: int, j: int) -> Any:
        return at.get((i, j) if i <= j else (j, i), zero)

    g = [[second(1 + n + i, 1 + n + j) for j in range(n)] for i in range(n)]
    drift = [
        second(0, 1 + n + i)
        + mpmath.fsum(second(1 + k, 1 + n + i) * v for k, v in enumerate(speeds))
        for i in range(n)
    ]
    return g, [d - jet.slopes.get(1 + i, zero) for i, d in enumerate(drift)]


def same_lagrangian(
    left: str, right: str, given: Equations, domain: Sequence[str] = (), **more: Any
) -> bool:
    """Whether one is a constant times the other plus a total derivative, by Euler-Lagrange
    expressions for any q''.
    """
    with mpmath.workdps(DIGITS):
        ratio, seen = None, 0
        # A constant may depend on parameters, so they have the same values at all points.
        fixed = dict(given.values)
        for point in points(given, domain, **more):
            for name, value in fixed.items():
                point.numbers[name] = _number(value)
            try:
                pairs = [euler_lagrange(point.jet(text), given, point) for text in (left, right)]
            except NotReal:
                continue
            moving = {*given.variables}
            fixed |= {name: value for name, value in point.numbers.items() if name not in moving}
            (g, b), (h, c) = pairs
            found = [*(x for row in g for x in row), *b]
            wanted = [*(x for row in h for x in row), *c]
            size = max(map(abs, wanted))
            for x, y in zip(found, wanted, strict=True):
                if abs(y) < NEAR_ZERO * size:
                    if abs(x) > NEAR_ZERO * (1 + max(map(abs, found))):
                        return False
                    continue
                ratio = ratio if ratio is not None else x / y
                if ratio == 0 or abs(x / y / ratio - 1) > NEAR_ZERO:
                    return False
            seen += 1
            if seen == 3:
                return True
        raise AssertionError(f"no point where both {left} and {right} are real")


def faults_of_hamiltonian(
    hamiltonian: Mapping[str, Any], lagrangian: str, given: Equations, **more: Any
) -> str | None:
    """None if the momenta are L_v and H is p v - L at two points; `implicit` formulas contain
    velocities.
    """
    domain = [*more.pop("domain", ()), *hamiltonian.get("domain", ())]
    momenta = dict(hamiltonian["momenta"])
    on_velocities = [
        condition for condition in domain if not any(name in condition for name in momenta)
    ]
    with mpmath.workdps(DIGITS):
        seen = 0
        for point in points(given, on_velocities, **more):
            try:
                jet = point.jet(lagrangian)
                n = len(given.coordinates)
                slopes = [jet.slopes.get(1 + n + i, mpmath.mpf(0)) for i in range(n)]
                speeds = [point.numbers[v] for v in given.velocities]
                shown = [point.value(text) for text in momenta.values()]
                if not hamiltonian["implicit"]:
                    point.numbers.update(zip(momenta, slopes, strict=True))
                if not all(point.holds(condition) for condition in domain):
                    continue
                energy = point.value(hamiltonian["text"])
            except NotReal:
                continue
            wanted = mpmath.fdot(slopes, speeds) - jet.value
            pairs = [*zip(shown, slopes, strict=True), (energy, wanted)]
            if any(abs(a - b) > mpmath.mpf(10) ** -14 * (1 + abs(a) + abs(b)) for a, b in pairs):
                return f"{hamiltonian['text']} is not the energy of {lagrangian}"
            seen += 1
            if seen == 2:
                return None
        return f"no point of the domain of {hamiltonian['text']} was found"


def faults_of_endomorphism(
    printed: Sequence[Sequence[str]], given: Equations, **more: Any
) -> str | None:
    """None if the printed Phi is d/dt(df_i/dv_j) - 2 df_i/dq_j - (1/2) df_i/dv_k df_k/dv_j."""
    n = len(given.coordinates)
    span, zero = range(n), mpmath.mpf(0)
    with mpmath.workdps(DIGITS):
        for point in points(given, **more):
            try:
                jets = [point.jet(f) for f in given.accelerations]
                shown = [[point.value(text) for text in row] for row in printed]
            except NotReal:
                continue
            rates = {0: mpmath.mpf(1)}
            rates |= {1 + k: point.numbers[v] for k, v in enumerate(given.velocities)}
            rates |= {1 + n + k: jet.value for k, jet in enumerate(jets)}
            for i, j in itertools.product(span, span):
                along = (
                    rate * jets[i].bends.get((min(k, 1 + n + j), max(k, 1 + n + j)), zero)
                    for k, rate in rates.items()
                )
                squares = (
                    jets[i].slopes.get(1 + n + k, zero) * jets[k].slopes.get(1 + n + j, zero)
                    for k in span
                )
                wanted = (
                    mpmath.fsum(along)
                    - 2 * jets[i].slopes.get(1 + j, zero)
                    - mpmath.fsum(squares) / 2
                )
                if abs(shown[i][j] - wanted) > mpmath.mpf(10) ** -14 * (
                    1 + abs(wanted) + abs(jets[i].value)
                ):
                    return f"Phi_{i + 1}{j + 1} is not {printed[i][j]}"
            return None
    return "no point was found"


def faults_of_motion(part: Mapping[str, Any], coordinates: Sequence[str]) -> str | None:
    """None if the motion on constraints is d'Alembert's: E_i = lambda_a dw^a/dv_i, w^a = 0 and its
    rate is 0. The rates of first integrals along it must vanish too. `part` is `nonholonomic` of a
    result.
    """
    given, motion = Equations(tuple(coordinates), ()), part["equations_of_motion"]
    n, zero = len(coordinates), mpmath.mpf(0)
    with mpmath.workdps(DIGITS):
        for point in points(given):
            try:
                for name, rate in motion["first_order"].items():
                    point.numbers[name + "'"] = point.value(rate["text"])
                q_tt = [point.value(motion["accelerations"][name]["text"]) for name in coordinates]
                g, b = euler_lagrange(point.jet(part["lagrangian"]["text"]), given, point)
                constraints = [point.jet(each["text"]) for each in part["constraints"]]
                kept = [point.jet(each["text"]) for each in part["first_integrals"]]
                multipliers = [point.value(each["text"]) for each in motion["multipliers"]]
            except NotReal:
                continue
            rates = {0: mpmath.mpf(1)} | {
                1 + k: point.numbers[v] for k, v in enumerate(given.velocities)
            }
            rates |= {1 + n + k: a for k, a in enumerate(q_tt)}
            left = [mpmath.fdot(row, q_tt) + rest for row, rest in zip(g, b, strict=True)]
            for i in range(n):
                left[i] -= mpmath.fdot(
                    multipliers, [w.slopes.get(1 + n + i, zero) for w in constraints]
                )
            along = [
                mpmath.fsum(rate * jet.slopes.get(k, zero) for k, rate in rates.items())
                for jet in constraints + kept
            ]
            found = [*left, *(w.value for w in constraints), *along]
            size = 1 + max(map(abs, [*q_tt, *b, *multipliers]))
            return (
                None
                if max(map(abs, found)) < NEAR_ZERO * size**2
                else "the motion is not d'Alembert's"
            )
    return "no point of the motion was found"


def faults_of_lagrangian_on_constraints(
    found: Mapping[str, Any], motion: Mapping[str, Any], coordinates: Sequence[str]
) -> str | None:
    """None if a Lagrangian is regular and its Euler-Lagrange expressions vanish along a motion on
    constraints.

    `found` is `lagrangian` of `any_associated`, `motion` is `equations_of_motion`, which
    `faults_of_motion` judges. The free velocities have both signs where the domain of L allows it.
    """
    given, seen = Equations(tuple(coordinates), ()), set[tuple[bool, ...]]()
    with mpmath.workdps(DIGITS):
        for point in itertools.islice(points(given, near=found.get("near")), 200):
            try:
                for name, rate in motion["first_order"].items():
                    point.numbers[name + "'"] = point.value(rate["text"])
                if not all(map(point.holds, found["domain"])):
                    continue
                q_tt = [point.value(motion["accelerations"][name]["text"]) for name in coordinates]
                g, b = euler_lagrange(point.jet(found["text"]), given, point)
            except NotReal:
                continue
            scaled = [[x / (max(map(abs, row)) or 1) for x in row] for row in g]
            if abs(mpmath.det(mpmath.matrix(scaled))) <= mpmath.mpf(10) ** -24:
                return f"singular Hessian of {found['text']}"
            for row, rest in zip(g, b, strict=True):
                parts = [*(x * f for x, f in zip(row, q_tt, strict=True)), rest]
                if abs(mpmath.fsum(parts)) > NEAR_ZERO * (1 + max(map(abs, parts))):
                    return f"{found['text']} has another motion"
            seen.add(tuple(point.numbers[v] > 0 for v in given.velocities))
    return None if seen else f"no point of the domain of {found['text']} was found"


def same_formula(left: str, right: str, names: Sequence[str] = ()) -> bool:
    """Whether two canonical formulas have the same values at random points."""
    if left == right:
        return True
    with mpmath.workdps(DIGITS):
        seen = 0
        for point in points(Equations(tuple(names), ())):
            try:
                a, b = point.value(left), point.value(right)
            except NotReal:
                continue
            if abs(a - b) > NEAR_ZERO * (1 + abs(a) + abs(b)):
                return False
            seen += 1
            if seen == 2:
                return True
        return False
