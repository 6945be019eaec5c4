"""Find independent generators of all atoms of a system, and evaluate the atoms at points.

`to_kernels` writes elementary functions by exp, log, sin, cos, atan and rational powers (real
domain): tan u = sin u / cos u and similar; cosh u = (e^u + e^-u)/2 and similar; asin u = atan(u /
sqrt(1 - u^2)), acos u = pi/2 - asin u, asinh u = log(u + sqrt(u^2 + 1)), acosh u = log(u + sqrt(u^2
- 1)), atanh u = log((1 + u)/(1 - u))/2; b^e = exp(e log b) for an exponent that is not a rational
number; (e^u)^r = e^(r u). Each identity is valid where the left side is real.

A rule computes the value of a transcendental atom from free generators. By the structure theorem
(Risch 1979; Ax 1971) exponentials and logarithms are algebraically independent over the functions
below them unless their arguments, or logarithms, are linearly dependent over Q; angles and
arctangents likewise (they are the imaginary part). A rule states the dependence found, or that
there is none, in which case the atom is a free generator.

A tower lists these rules, innermost first. Roots need no rule (`modular.py`) except for the branch:
`signs` lists the quantities whose residue symbol must equal their sign at a real point of the
domain (`real_branch.py` finds them).

`build_tower` finds the rules. Atoms are taken innermost first. For each transcendental one the
linear dependence over Q of its argument (exp, angles) or its logarithmic differential (log, atan)
on those before it is computed at random points modulo a prime; rational coefficients are
reconstructed.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

from flint import nmod_mat

from inverse_service import deadline, errors
from inverse_service.expressions import functions, tree as ex
from inverse_service.field import matrices, modular

# The angle of one radian, when constants such as cos(1) occur.
RADIAN = ex.Symbol("radian")
Combination = tuple[tuple[ex.Expression, Fraction], ...]
# The free generator of an angle is that angle divided by its scale.
Scale = Callable[[ex.Expression], int]

# In the search for relations an angle may be any of these fractions of a free one.
_SEARCH_SCALE = 2520
_DRAWS = 4_000
# A quantity and the sign of its residue symbol.
Requirement = tuple[ex.Expression, int]
# A residue of 61 bits equals a fraction below the bound by chance with probability 10^-6.
_COEFFICIENT_BOUND = 10**6

_CONSTANT_BOUND = 10**8
_MOST_PARTS = 5040
# (atom, sum a_j u_j, constants) -> atom - sum at a real point, in pi and the constants.
Turns = Callable[[ex.Expression, Combination, Sequence[ex.Expression]], Combination | None]


@lru_cache(maxsize=8192)
def to_kernels(expression: ex.Expression) -> ex.Expression:
    """The expression written with the six kernels only."""
    inner = ex.rebuild(expression, to_kernels)
    if isinstance(inner, ex.Apply):
        if inner.function == functions.STEP:
            return _step(inner.argument)
        return functions.in_kernels(inner)
    if isinstance(inner, ex.Power):
        return _rational_power(inner)
    return inner


def _rational_power(node: ex.Power) -> ex.Expression:
    if not isinstance(node.exponent, ex.Number):
        return ex.Apply("exp", node.exponent * ex.Apply("log", node.base))
    if isinstance(node.base, ex.Apply) and node.base.function == "exp":
        return ex.Apply("exp", node.exponent * node.base.argument)
    return node


def _step(u: ex.Expression) -> ex.Expression:
    return ex.HALF * (1 + u / ex.square_root(u**2))


def is_even_root(node: ex.Expression) -> bool:
    """Whether the node is a power with an even denominator."""
    return (
        isinstance(node, ex.Power)
        and isinstance(node.exponent, ex.Number)
        and node.exponent.value.denominator % 2 == 0
    )


def is_root(node: ex.Expression) -> bool:
    """Whether the node is a power with a fractional exponent."""
    return (
        isinstance(node, ex.Power)
        and isinstance(node.exponent, ex.Number)
        and node.exponent.value.denominator != 1
    )


@dataclass(frozen=True, slots=True)
class ExponentialRule:
    """exp(u) = e^constant prod exp_j^a_j prod w_k^c_k, or free (a random positive value)."""

    atom: ex.Apply
    free: bool
    exponentials: Combination = ()
    arguments_of_logarithms: Combination = ()
    prime_powers: tuple[tuple[int, Fraction], ...] = ()
    constant: Fraction = Fraction(0)

    def value(self, point: modular.Point, scale: Scale) -> int:
        if self.free:
            return pow(point.draw_free(self.atom), 2, point.prime)
        result = modular.constant_value("exp", self.constant, point)
        for atom, exponent in self.exponentials:
            result *= modular.positive_power(point.atoms[atom], exponent, point.prime)
        for argument, exponent in self.arguments_of_logarithms:
            result *= modular.positive_power(
                modular.evaluate(argument, point), exponent, point.prime
            )
        for ell, exponent in self.prime_powers:
            result *= modular.positive_power(ell, exponent, point.prime)
        return result % point.prime

    @property
    def tree(self) -> ex.Expression:
        """The product, if it is not free."""
        primes = (ex.number(ell) ** exponent for ell, exponent in self.prime_powers)
        atoms = (
            tree**exponent for tree, exponent in (*self.exponentials, *self.arguments_of_logarithms)
        )
        constant = [ex.Apply("exp", ex.number(self.constant))] if self.constant else []
        return ex.multiply(*constant, *primes, *atoms)


@dataclass(frozen=True, slots=True)
class LogarithmRule:
    """log(w) = sum a_j u_j + sum c_k log(w_k) + log(constant), or free."""

    atom: ex.Apply
    free: bool
    linear: Combination = ()
    constant: Fraction = Fraction(1)
    root: int = 1

    def value(self, point: modular.Point, scale: Scale) -> int:
        if self.free:
            return point.draw_free(self.atom)
        result = sum(
            modular.evaluate(u, point) * modular.number_value(a, point.prime)
            for u, a in self.linear
        )
        logarithm = modular.constant_value("log", self.constant, point) * pow(
            self.root, -1, point.prime
        )
        return (result + logarithm) % point.prime

    @property
    def tree(self) -> ex.Expression:
        """The sum, where it is not free."""
        logarithm = ex.ZERO if self.constant == 1 else ex.Apply("log", ex.number(self.constant))
        return _sum_tree(self.linear) + Fraction(1, self.root) * logarithm


@dataclass(frozen=True, slots=True)
class AngleRule:
    """phi = sum b_k phi_k + sum d_j atan(w_j) + radians + pi turns, or free."""

    angle: ex.Expression
    free: bool
    angles: Combination = ()
    arctangents: Combination = ()
    radians: Fraction = Fraction(0)
    turns: Fraction = Fraction(0)

    def value(self, point: modular.Point, scale: Scale) -> tuple[int, int]:
        """(cos phi, sin phi)."""
        prime = point.prime
        if self.free:
            return circle_power(_random_turn(point, self.angle), scale(self.angle), prime)
        total = circle_turn(self.turns, prime)
        for angle, factor in self.angles:
            total = circle_product(total, self._scaled(point, angle, factor, scale), prime)
        if self.radians:
            total = circle_product(total, self._scaled(point, RADIAN, self.radians, scale), prime)
        for atom, factor in self.arctangents:
            part = _circle_part(_arctangent_turn(atom, point), factor.denominator, prime)
            total = circle_product(total, circle_power(part, factor.numerator, prime), prime)
        return total

    @staticmethod
    def _scaled(
        point: modular.Point, angle: ex.Expression, factor: Fraction, scale: Scale
    ) -> tuple[int, int]:
        steps = factor * scale(angle)
        if steps.denominator != 1:
            raise errors.IrreducibleAtoms(
                f"two angles have the ratio {factor}, which is finer than can be reduced"
            )
        return circle_power(_random_turn(point, angle), steps.numerator, point.prime)


@dataclass(frozen=True, slots=True)
class ArctangentRule:
    """atan(w) = sum b_k phi_k + sum d_j atan(w_j) + pi turns, or free."""

    atom: ex.Apply
    free: bool
    linear: Combination = ()
    turns: Fraction = Fraction(0)

    def value(self, point: modular.Point, scale: Scale) -> int:
        if self.free:
            return point.draw_free(self.atom)
        result = sum(
            modular.evaluate(u, point) * modular.number_value(a, point.prime)
            for u, a in self.linear
        )
        return (
            result + point.variable(ex.PI) * modular.number_value(self.turns, point.prime)
        ) % point.prime

    @property
    def tree(self) -> ex.Expression:
        """The sum, where it is not free."""
        return _sum_tree(self.linear) + self.turns * ex.PI


def _sum_tree(linear: Combination) -> ex.Expression:
    return ex.add(*(a * u for u, a in linear))


Rule = ExponentialRule | LogarithmRule | AngleRule | ArctangentRule


def replay(rule: Rule, point: modular.Point, scale: Scale) -> None:
    """Set the value of the rule's atom at the point."""
    if isinstance(rule, AngleRule):
        cosine, sine = rule.value(point, scale)
        point.atoms[_function_of("cos", rule.angle)] = cosine
        point.atoms[_function_of("sin", rule.angle)] = sine
        if rule.free:
            point.atoms[half_angle(rule.angle, scale(rule.angle))] = _random_tangent(
                point, rule.angle
            )
        if rule.radians:
            point.atoms[half_angle(RADIAN, scale(RADIAN))] = _random_tangent(point, RADIAN)
    else:
        point.atoms[rule.atom] = rule.value(point, scale)


@lru_cache(maxsize=256)  # a new tree is hashed again at each point
def _function_of(name: str, angle: ex.Expression) -> ex.Expression:
    return ex.Apply(name, angle)


@lru_cache(maxsize=256)
def half_angle(angle: ex.Expression, scale: int) -> ex.Expression:
    """tan(angle / (2 scale)), in which cos and sin of angle/scale are rational."""
    return ex.Apply("tan", Fraction(1, 2 * scale) * angle)


def circle_product(left: tuple[int, int], right: tuple[int, int], prime: int) -> tuple[int, int]:
    return (left[0] * right[0] - left[1] * right[1]) % prime, (
        left[0] * right[1] + left[1] * right[0]
    ) % prime


def circle_power(turn: tuple[int, int], exponent: int, prime: int) -> tuple[int, int]:
    """(cos k phi, sin k phi)."""
    if exponent < 0:
        return circle_power((turn[0], -turn[1] % prime), -exponent, prime)
    result = (1, 0)
    for digit in bin(exponent)[2:]:
        result = circle_product(result, result, prime)
        if digit == "1":
            result = circle_product(result, turn, prime)
    return result


def _random_turn(point: modular.Point, angle: ex.Expression) -> tuple[int, int]:
    """A random point of the circle, by t -> ((1 - t^2)/(1 + t^2), 2t/(1 + t^2)); -1 is not a
    square.
    """
    return _circle_point(_random_tangent(point, angle), point.prime)


def _random_tangent(point: modular.Point, angle: ex.Expression) -> int:
    """The tangent of half the angle in its scale; never the number drawn for an angle such as e^x
    or log x itself.
    """
    return point.draw_free(_function_of("tan", angle))


def _circle_point(t: int, prime: int) -> tuple[int, int]:
    factor = pow(1 + t * t, -1, prime)
    return (1 - t * t) * factor % prime, 2 * t * factor % prime


def _arctangent_turn(atom: ex.Expression, point: modular.Point) -> tuple[int, int]:
    """(cos, sin) of atan(w) = (1, w)/sqrt(1 + w^2)."""
    assert isinstance(atom, ex.Apply)
    w = modular.evaluate(atom.argument, point)
    factor = modular.positive_power((1 + w * w) % point.prime, Fraction(-1, 2), point.prime)
    return factor, w * factor % point.prime


def _circle_part(turn: tuple[int, int], number: int, prime: int) -> tuple[int, int]:
    """(cos, sin) of phi/number, |phi| < pi/2: halves by cos(phi/2) = sqrt((1 + cos phi)/2).

    Odd parts are unique in the group of the circle's elements whose order is coprime to the number.
    Raises ValueError if there is none.
    """
    while number % 2 == 0:
        square = (1 + turn[0]) * pow(2, -1, prime) % prime
        if not modular.is_positive(square, prime):
            return 1, 0  # the point is rejected because of its radicands
        cosine = modular.positive_power(square, Fraction(1, 2), prime)
        turn, number = (cosine, turn[1] * pow(2 * cosine, -1, prime) % prime), number // 2
    order = prime + 1
    while (common := math.gcd(order, number)) > 1:
        order //= common
    if number > 1 and circle_power(turn, order, prime) != (1, 0):
        raise ValueError("no part of this angle")
    return circle_power(turn, pow(number, -1, order), prime)


@lru_cache(maxsize=1024)
def circle_turn(turns: Fraction, prime: int) -> tuple[int, int]:
    """(cos, sin) of pi turns; twice the denominator must divide prime + 1, the order of the
    circle.
    """
    whole, total = 2 * turns.denominator, (1, 0)
    if (prime + 1) % whole:
        raise errors.IrreducibleAtoms(
            f"the angle {turns} pi is too fine a part of pi: use parameters for its sine and cosine"
        )
    for ell, k in modular.prime_factors(whole):
        rest = whole // ell**k
        total = circle_product(
            total,
            circle_power(_unit(ell, k, prime), turns.numerator * pow(rest, -1, ell**k), prime),
            prime,
        )
    return total


@lru_cache(maxsize=1024)
def _unit(ell: int, k: int, prime: int) -> tuple[int, int]:
    """(cos, sin) of 2 pi/ell^k, the ones for which the roots of 2, 3, 5, … that they give are the
    positive ones.
    """
    most = next(m for m in range(k, 64) if (prime + 1) % ell ** (m + 1))
    order = ell**most
    t = next(t for t in range(2, 999) if _order_is_multiple(t, ell, prime))
    start = circle_power(_circle_point(t, prime), (prime + 1) // order, prime)
    found = next(
        z
        for a in range(1, order)
        if a % ell and _is_principal(z := circle_power(start, a, prime), ell, order, prime)
    )
    return circle_power(found, ell ** (most - k), prime)


def _order_is_multiple(t: int, ell: int, prime: int) -> bool:
    return circle_power(_circle_point(t, prime), (prime + 1) // ell, prime) != (1, 0)


def _is_principal(turn: tuple[int, int], ell: int, order: int, prime: int) -> bool:
    """Whether sqrt(2)/2, sqrt(3)/2, or by Gauss the root of a larger prime, follows from a turn by
    2 pi/order.
    """
    if ell == 2:
        half = modular.positive_power(2, Fraction(-1, 2), prime)
        return circle_power(turn, order // 8, prime) == (half, half)
    powers = [circle_power(turn, order // ell * a, prime)[ell // 2 % 2] for a in range(1, ell)]
    total = sum(
        value * (1 if modular.is_positive(a, ell) else -1) for a, value in enumerate(powers, 1)
    )
    return total % prime == modular.positive_power(ell, Fraction(1, 2), prime)


@dataclass(slots=True)
class Tower:
    """Rules in order, radicands that must be positive, further signs, scales of the free angles."""

    variables: tuple[modular.Variable, ...]
    real_signs: Mapping[modular.Variable, int] = field(default_factory=dict)
    rules: list[Rule] = field(default_factory=list)
    radicands: list[ex.Expression] = field(default_factory=list)
    signs: list[Requirement] = field(default_factory=list)
    scales: dict[ex.Expression, int] = field(default_factory=dict)
    default_scale: int = _SEARCH_SCALE
    residues: frozenset[int] = frozenset()
    parts_of_pi: int = 1

    def scale(self, angle: ex.Expression) -> int:
        """The denominator of a free angle's generator."""
        return self.scales.get(angle, self.default_scale)

    def values_all(self, expression: ex.Expression) -> bool:
        """Whether the rules give values to all atoms in a tree."""
        return all(self._values(node) for node in ex.walk(expression) if isinstance(node, ex.Apply))

    def _values(self, atom: ex.Apply) -> bool:
        if isinstance(atom.argument, ex.Number) and atom.function in ("exp", "log"):
            return True
        for rule in self.rules:
            if isinstance(rule, AngleRule):
                halves = [rule.angle] * rule.free + [RADIAN] * bool(rule.radians)
                if any(atom == half_angle(angle, self.scale(angle)) for angle in halves):
                    return True
                if atom.argument == rule.angle and atom.function in ("sin", "cos"):
                    return True
            elif rule.atom == atom:
                return True
        return False


def atoms_in_order(expressions: Iterable[ex.Expression]) -> list[ex.Expression]:
    """Transcendental atoms and roots of trees in kernels, each once, inner ones first."""
    found, seen = list[ex.Expression](), set[ex.Expression]()
    for expression in expressions:
        if expression not in seen:
            _collect(expression, found, seen)
    return found


def _collect(
    expression: ex.Expression, found: list[ex.Expression], seen: set[ex.Expression]
) -> None:
    seen.add(expression)
    for child in ex.children(expression):
        if child not in seen:
            _collect(child, found, seen)
    if isinstance(expression, ex.Apply) or is_root(expression):
        found.append(expression)


def draw_point(
    tower: Tower, seed: int, prime: int | None = None, flipped: frozenset[int] = frozenset()
) -> modular.Point:
    """A random point at which every atom has a value and every sign is as in the tower.

    The prime is chosen again with each seed unless given. IrreducibleAtoms when no point is found.
    """
    stages = _stages(tower, tower.variables)
    for attempt in range(_DRAWS // 64):
        modulus = prime or modular.safe_prime(
            seed * 1009 + attempt, tower.residues, 2 * tower.parts_of_pi
        )
        point = _meet(tower, stages, modulus, seed * _DRAWS + attempt, {}, 0, flipped)
        if point is not None:
            return point
    raise errors.IrreducibleAtoms("no point was found at which all roots exist together")


@dataclass(frozen=True, slots=True)
class _Stage:
    """Variables that are drawn together until some requirements on them and on earlier variables
    hold.

    The rules are not needed to see whether those `without_atoms` hold.
    """

    names: frozenset[modular.Variable]
    without_atoms: tuple[Requirement, ...]
    with_atoms: tuple[Requirement, ...]

    @property
    def draws(self) -> range:
        """A requirement holds at every other draw; without variables there is one."""
        return (
            range(16 << min(len(self.without_atoms) + len(self.with_atoms), 8))
            if self.names
            else range(1)
        )


def _stages(tower: Tower, moving: Iterable[modular.Variable]) -> list[_Stage]:
    """The requirements in an order in which each adds few of the moving variables to those before.

    k requirements of one variable each cost 2 k draws and not 2^k, and so do 1 - u^2, 1 - u^2 -
    v^2.
    """
    free = frozenset(moving)
    wanted = [*((w, 1) for w in tower.radicands), *tower.signs]
    open_ones = [
        (free.intersection(modular.variables_in(requirement[0])), requirement)
        for requirement in wanted
    ]
    drawn: frozenset[modular.Variable] = frozenset()
    stages = []
    while open_ones:
        added = min((names - drawn for names, _ in open_ones), key=len)
        drawn |= added
        met = [requirement for names, requirement in open_ones if names <= drawn]
        parts = (
            tuple(one for one in met if _has_no_atoms(one[0]) is without)
            for without in (True, False)
        )
        stages.append(_Stage(added, *parts))
        open_ones = [one for one in open_ones if not one[0] <= drawn]
    return stages


def _meet(
    tower: Tower,
    stages: Sequence[_Stage],
    prime: int,
    seed: int,
    given: Mapping[modular.Variable, int],
    first: int,
    flipped: frozenset[int] = frozenset(),
) -> modular.Point | None:
    """A point with these numbers, the variables of each stage drawn, from one salt on, until its
    requirements hold.
    """
    salts, open_names = dict(given), frozenset().union(*(stage.names for stage in stages))
    point, missing = modular.Point(prime, seed, tower.real_signs, dict(salts), flipped), None
    for stage in stages:
        open_names -= stage.names
        for salt in stage.draws:
            if salt:
                salts.update(dict.fromkeys(stage.names, first + salt))
                point, missing = (
                    modular.Point(prime, seed, tower.real_signs, dict(salts), flipped),
                    None,
                )
            known: dict[ex.Expression, int] = {}
            if not _hold(stage.without_atoms, point, known):
                continue
            missing = _replayed(tower, point) if missing is None else missing
            valued = not any(open_names.isdisjoint(names) for names in missing)
            if valued and _hold(stage.with_atoms, point, known):
                break
        else:
            return None
    missing = _replayed(tower, point) if missing is None else missing
    return None if missing else point


def moved_point(
    tower: Tower, place: modular.Point, moving: Sequence[modular.Variable], number: int
) -> modular.Point:
    """A point at which all but the moving variables, and the atoms that hold these, are as at
    `place`.

    IrreducibleAtoms when no point is found.
    """
    stages = _stages(tower, moving)
    for attempt in range(_DRAWS // 64):
        first = 1 + (number * _DRAWS + attempt) * _DRAWS
        salts = {**place.salts, **dict.fromkeys(moving, first)}
        point = _meet(tower, stages, place.prime, place.seed, salts, first)
        if point is not None:
            return point
    raise errors.IrreducibleAtoms("no other point was found at which all roots exist together")


def _replayed(tower: Tower, point: modular.Point) -> list[tuple[modular.Variable, ...]]:
    """Give values to the atoms that have one at the point; the variables of each rule that gives
    none.
    """
    missing = []
    for rule in tower.rules:
        try:
            replay(rule, point, tower.scale)
        except (modular.SingularPoint, ValueError, ZeroDivisionError, KeyError):
            missing.append(
                modular.variables_in(rule.angle if isinstance(rule, AngleRule) else rule.atom)
            )
    return missing


@lru_cache(maxsize=1024)
def _has_no_atoms(expression: ex.Expression) -> bool:
    return not ex.has(expression, ex.Apply)


def _hold(
    requirements: Iterable[Requirement], point: modular.Point, known: dict[ex.Expression, int]
) -> bool:
    try:
        return all(
            modular.is_positive(modular.evaluate(p, point, known), point.prime) == (sign > 0)
            for p, sign in requirements
        )
    except (modular.SingularPoint, ValueError, ZeroDivisionError, KeyError):
        return False


class IrrationalRatio(errors.IrreducibleAtoms):
    """Some arguments have constant ratios modulo the prime."""


@dataclass(slots=True)
class Samples:
    """Points of one prime at which all rules of a tower hold, used to find linear relations.

    `pending` are signs of quantities some of whose atoms have no rule yet. Points have by turns
    conjugates of the square roots of the primes in `flips`: a relation with rational coefficients
    holds for all conjugates.
    """

    tower: Tower
    points: list[modular.Point] = field(default_factory=list)
    pending: list[Requirement] = field(default_factory=list)
    flips: tuple[int, ...] = ()

    def values(self, expression: ex.Expression) -> list[int]:
        return [modular.evaluate(expression, point) for point in self.points]

    def gradients(self, expression: ex.Expression) -> list[list[int]]:
        """Per point the partial derivatives with respect to all variables and parameters."""
        return [modular.gradient(expression, self.tower.variables, point) for point in self.points]

    @property
    def prime(self) -> int:
        return self.points[0].prime

    def solve(
        self, columns: Sequence[Sequence[int]], target: Sequence[int]
    ) -> list[Fraction] | None:
        """Rational a with sum a_j columns_j = target, or None; refuses what is not unique."""
        if not columns:
            return None if any(target) else []
        rows = [
            [*entries, b] for entries, b in zip(zip(*columns, strict=True), target, strict=True)
        ]
        reduced, rank = nmod_mat(
            len(rows), len(rows[0]), [x for row in rows for x in row], self.prime
        ).rref()
        if len(columns) in matrices.leading_columns(reduced, rank):
            return None
        if rank < len(columns):
            raise IrrationalRatio(
                "arguments of exponentials, logarithms or angles have irrational ratios"
            )
        solution = [
            modular.reconstruct(int(reduced[i, len(columns)]), self.prime, _COEFFICIENT_BOUND)
            for i in range(rank)
        ]
        return None if any(a is None for a in solution) else [a for a in solution if a is not None]

    def ensure(self, columns: int) -> None:
        """Enough points for a linear system of so many unknowns, with all rules so far replayed."""
        prime = self.points[0].prime if self.points else draw_point(self.tower, 7).prime
        while len(self.points) < columns + 6:
            count = len(self.points)
            flipped = frozenset(ell for k, ell in enumerate(self.flips) if (count >> k) % 2)
            self.points.append(draw_point(self.tower, 1000 + count, prime, flipped))

    def admit_pending(self) -> None:
        """From now on the signs hold of those pending quantities that have a value by now."""
        ready = [
            requirement for requirement in self.pending if self.tower.values_all(requirement[0])
        ]
        if ready:
            self.pending = [requirement for requirement in self.pending if requirement not in ready]
            self.tower.signs += [
                requirement for requirement in ready if requirement not in self.tower.signs
            ]
            self.points.clear()

    def require_positive(self, radicand: ex.Expression) -> None:
        """From now on only points at which the radicand has a root."""
        if radicand not in self.tower.radicands:
            self.tower.radicands.append(radicand)
            self.points[:] = [
                p
                for p in self.points
                if modular.is_positive(modular.evaluate(radicand, p), p.prime)
            ]


def build_tower(
    expressions: Sequence[ex.Expression],
    variables: Sequence[modular.Variable],
    real_signs: Mapping[modular.Variable, int],
    turns: Turns,
    known: Tower | None = None,
) -> Tower:
    """The tower of all atoms in `expressions` (in kernels); IrreducibleAtoms if it cannot be
    determined.

    `known` is an earlier tower of the same expressions whose branches are fixed: its signs hold
    from the first point on at which they have a meaning.
    """
    nodes = tuple(ex.distinct_nodes(expressions))
    names = (*variables, ex.PI) if _needs_pi(nodes) else tuple(variables)
    tower = Tower(names, real_signs, residues=_root_primes(nodes), parts_of_pi=_parts_of_pi(nodes))
    samples = Samples(tower)
    if known is not None:
        tower.scales, tower.default_scale = dict(known.scales), 1
        samples.pending = [*known.signs, *((radicand, 1) for radicand in known.radicands)]
    try:
        for atom in atoms_in_order(expressions):
            deadline.check(0)
            samples.admit_pending()
            if is_root(atom):
                _admit_root(atom, tower, samples)
            else:
                _admit(atom, tower, samples, turns)
    except modular.SingularPoint as problem:
        raise errors.IrreducibleAtoms(
            "a denominator inside a function vanishes at the points tried"
        ) from problem
    _finish_scales(tower)
    samples.admit_pending()
    if samples.pending or not all(tower.values_all(p) for p, _ in tower.signs):
        raise errors.IrreducibleAtoms(
            "the branches of roots and the relations among angles could not be fixed together"
        )
    return tower


def _needs_pi(nodes: Iterable[ex.Expression]) -> bool:
    """Whether pi occurs, or may: two arctangents often differ by a part of pi."""
    return any(
        (isinstance(node, ex.Apply) and node.function == "atan") or node == ex.PI for node in nodes
    )


def _parts_of_pi(nodes: Iterable[ex.Expression]) -> int:
    """The common denominator of the fractions of pi that are written."""
    found = [f.value.denominator for node in nodes if isinstance(node, ex.Product)
             and ex.PI in node.factors for f in node.factors if isinstance(f, ex.Number)]  # fmt: skip
    whole = math.lcm(*found)
    return whole if whole <= _MOST_PARTS else 1


def _root_primes(nodes: Iterable[ex.Expression]) -> frozenset[int]:
    """The primes that occur in numbers under even roots."""
    found: set[int] = set()
    for node in nodes:
        if is_even_root(node) and isinstance(node, ex.Power) and isinstance(node.base, ex.Number):
            value = node.base.value
            if value > 0:
                found.update(
                    ell
                    for k in (value.numerator, value.denominator)
                    for ell, _ in modular.prime_factors(k)
                )
    return frozenset(ell for ell in found if ell > 13)


def _admit_root(atom: ex.Expression, tower: Tower, samples: Samples) -> None:
    assert isinstance(atom, ex.Power)
    if not is_even_root(atom):
        return
    if isinstance(atom.base, ex.Number) and atom.base.value <= 0:
        raise errors.IrreducibleAtoms("an even root of a negative number is not real")
    if atom.base not in tower.radicands and not isinstance(atom.base, ex.Number):
        tower.radicands.append(atom.base)
        samples.points.clear()


def _admit(atom: ex.Expression, tower: Tower, samples: Samples, turns: Turns) -> None:
    assert isinstance(atom, ex.Apply)
    if atom.function in ("sin", "cos") and any(
        isinstance(rule, AngleRule) and rule.angle == atom.argument for rule in tower.rules
    ):
        return
    samples.ensure(len(tower.rules) + 4)
    work = {"exp": _exponential_rule, "log": _logarithm_rule, "atan": _arctangent_rule}.get(
        atom.function, _angle_rule
    )
    try:
        rule = work(atom, tower, samples, turns)
    except IrrationalRatio:
        samples.flips = _square_roots(
            atom.argument, *(u for kind in _KINDS for u in _free(tower, kind))
        )
        if not samples.flips:
            raise
        samples.points.clear()
        samples.ensure(len(tower.rules) + 4)
        rule = work(atom, tower, samples, turns)
        samples.flips = ()
        samples.points.clear()
    samples.ensure(len(tower.rules) + 4)
    tower.rules.append(rule)
    if isinstance(rule, AngleRule) and any(a.denominator > 1 for _, a in rule.arctangents):
        samples.points.clear()  # not every angle has such a part
    for point in samples.points:
        replay(rule, point, tower.scale)


_KINDS: tuple[type[Rule], ...] = (ExponentialRule, LogarithmRule, AngleRule, ArctangentRule)


def _square_roots(*trees: ex.Expression) -> tuple[int, ...]:
    """The primes under square roots of numbers, where no other roots of constants occur."""
    found: dict[int, None] = {}
    for node in ex.distinct_nodes(trees):
        if not is_root(node) or not isinstance(node, ex.Power) or modular.variables_in(node):
            continue
        base, exponent = node.base, node.exponent
        if not (
            isinstance(base, ex.Number)
            and isinstance(exponent, ex.Number)
            and exponent.value.denominator == 2
        ):
            return ()
        found |= {
            ell: None for k in base.value.as_integer_ratio() for ell, _ in modular.prime_factors(k)
        }
    return tuple(found)[:3]


def _free(tower: Tower, kind: type[Rule]) -> list[ex.Expression]:
    """The free atoms (for angles: the angles) of a kind."""
    return [
        rule.angle if isinstance(rule, AngleRule) else rule.atom
        for rule in tower.rules
        if isinstance(rule, kind) and rule.free
    ]


def _logarithm_primes(tower: Tower) -> list[int]:
    constants = [rule.constant for rule in tower.rules if isinstance(rule, LogarithmRule)]
    return sorted(
        {
            ell
            for c in constants
            for k in (c.numerator, c.denominator)
            for ell, _ in modular.prime_factors(k)
        }
    )


def _exponential_rule(atom: ex.Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    exponentials = _free(tower, ExponentialRule)
    logarithms = _free(tower, LogarithmRule)
    primes = _logarithm_primes(tower)
    samples.ensure(len(exponentials) + len(logarithms) + len(primes) + 1)
    columns = [samples.values(_argument(e)) for e in exponentials]
    columns += [samples.values(log) for log in logarithms]
    columns += [[point.draw(("log", ell)) for point in samples.points] for ell in primes]
    columns.append([1] * len(samples.points))
    solution = samples.solve(columns, samples.values(atom.argument))
    if solution is None:
        return ExponentialRule(atom, True)
    first, second = len(exponentials), len(exponentials) + len(logarithms)
    of_logs = tuple(
        (_argument(log), c) for log, c in zip(logarithms, solution[first:second], strict=True) if c
    )
    for argument, c in of_logs:
        if c.denominator % 2 == 0:
            samples.require_positive(argument)
    return ExponentialRule(
        atom,
        False,
        tuple((e, a) for e, a in zip(exponentials, solution, strict=False) if a),
        of_logs,
        tuple((ell, a) for ell, a in zip(primes, solution[second:], strict=False) if a),
        solution[-1],
    )


def _logarithm_rule(atom: ex.Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    if isinstance(atom.argument, ex.Number):
        if atom.argument.value <= 0:
            raise errors.IrreducibleAtoms(
                "the logarithm of a number that is not positive is not real"
            )
        return LogarithmRule(atom, False, (), atom.argument.value)
    basis = [_argument(e) for e in _free(tower, ExponentialRule)] + _free(tower, LogarithmRule)
    columns = [_flat(samples.gradients(u)) for u in basis]
    if not all(samples.values(atom.argument)):
        raise errors.IrreducibleAtoms("the argument of a logarithm vanishes at the points tried")
    inverse = [pow(w, -1, samples.prime) for w in samples.values(atom.argument)]
    gradient = samples.gradients(atom.argument)
    target = [x * w % samples.prime for row, w in zip(gradient, inverse, strict=True) for x in row]
    solution = samples.solve(columns, target) if any(target) else [Fraction(0)] * len(columns)
    if solution is None:
        return LogarithmRule(atom, True)
    linear = tuple((u, a) for u, a in zip(basis, solution, strict=True) if a)
    constant, root = _constant_factor(atom, linear, samples)
    return LogarithmRule(atom, False, linear, constant, root)


def _constant_factor(
    atom: ex.Apply, linear: Sequence[tuple[ex.Expression, Fraction]], samples: Samples
) -> tuple[Fraction, int]:
    """kappa^root = w^root / prod (e^u_j)^(a_j root), a positive rational; else IrreducibleAtoms."""
    root = 2
    for _, a in linear:
        root *= a.denominator
    found = {
        modular.reconstruct(
            _constant_power(atom, linear, root, point), point.prime, _CONSTANT_BOUND
        )
        for point in samples.points
    }
    constant = found.pop()
    # A second prime distinguishes a rational number from one that only looks like it modulo the
    # first.
    other = draw_point(samples.tower, 11)
    if found or constant is None or constant <= 0 or other.prime == samples.prime:
        raise errors.IrreducibleAtoms(
            "a logarithm of a constant that is not a rational number cannot be reduced"
        )
    if modular.number_value(constant, other.prime) != _constant_power(atom, linear, root, other):
        raise errors.IrreducibleAtoms(
            "a logarithm of a constant that is not a rational number cannot be reduced"
        )
    return constant, root


def _constant_power(
    atom: ex.Apply,
    linear: Sequence[tuple[ex.Expression, Fraction]],
    root: int,
    point: modular.Point,
) -> int:
    """w^root / prod (e^u_j)^(a_j root) at a point."""
    value = pow(modular.evaluate(atom.argument, point), root, point.prime)
    for u, a in linear:
        base = (
            point.atoms[ex.Apply("exp", u)]
            if ex.Apply("exp", u) in point.atoms
            else modular.evaluate(_argument(u), point)
        )
        value = value * pow(base, -int(a * root), point.prime) % point.prime
    return value


def _angle_rule(atom: ex.Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    angles, arctangents = _free(tower, AngleRule), _free(tower, ArctangentRule)
    columns = [samples.values(u) for u in (*angles, *arctangents)]
    columns.append([1] * len(samples.points))
    if ex.PI in tower.variables:
        columns.append(samples.values(ex.PI))
    solution = samples.solve(columns, samples.values(atom.argument))
    if solution is None:
        return AngleRule(atom.argument, True)
    by_angle = tuple((u, a) for u, a in zip(angles, solution, strict=False) if a)
    rest = solution[len(angles) :]
    by_atan = tuple((u, a) for u, a in zip(arctangents, rest, strict=False) if a)
    for u, a in by_atan:
        for radicand in _radicands(_argument(u), a.denominator):
            samples.require_positive(radicand)
    turns_of_pi = rest[-1] if ex.PI in tower.variables else Fraction(0)
    _refine_scales(tower, samples, (*by_angle, (RADIAN, rest[len(arctangents)])))
    return AngleRule(atom.argument, False, by_angle, by_atan, rest[len(arctangents)], turns_of_pi)


def _radicands(w: ex.Expression, number: int) -> Iterator[ex.Expression]:
    """What has a root where the number-th part of atan w is an angle: 1 + w^2, and for each half 1
    + cos.
    """
    yield (square := 1 + w**2)
    cosine = square ** Fraction(-1, 2)
    while number % 2 == 0:
        yield (half := ex.HALF * (1 + cosine))
        cosine, number = half ** Fraction(1, 2), number // 2


def _refine_scales(
    tower: Tower, samples: Samples, parts: Sequence[tuple[ex.Expression, Fraction]]
) -> None:
    """Free angles become fine enough to have these multiples; points with coarser ones are
    dropped.
    """
    for angle, factor in parts:
        scale = tower.scale(angle)
        if scale % factor.denominator:
            tower.scales[angle] = math.lcm(scale, factor.denominator)
            samples.points.clear()


def _arctangent_rule(atom: ex.Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    columns = {
        u: _flat(samples.gradients(u))
        for u in _free(tower, AngleRule) + _free(tower, ArctangentRule)
    }
    basis = [u for u, column in columns.items() if any(column)]
    constants = [u for u in _free(tower, ArctangentRule) if u not in basis]
    w = samples.values(atom.argument)
    factor = [pow(1 + x * x, -1, samples.prime) for x in w]
    gradient = samples.gradients(atom.argument)
    target = [x * k % samples.prime for row, k in zip(gradient, factor, strict=True) for x in row]
    solution = (
        samples.solve([columns[u] for u in basis], target)
        if any(target)
        else [Fraction(0)] * len(basis)
    )
    if solution is None:
        return ArctangentRule(atom, True)
    linear = tuple((u, a) for u, a in zip(basis, solution, strict=True) if a)
    rest = turns(atom, linear, constants)
    if rest is None and linear:
        raise errors.IrreducibleAtoms(
            "an arctangent differs from others by an unknown constant: use a parameter for it"
        )
    if rest is None:
        return ArctangentRule(atom, True)  # a constant independent of the others
    found = dict(rest)
    return ArctangentRule(
        atom, False, linear + tuple(p for p in rest if p[0] != ex.PI), found.get(ex.PI, Fraction(0))
    )


def _finish_scales(tower: Tower) -> None:
    """The coarsest free angles of which all others are whole multiples."""
    if tower.default_scale > 1:
        tower.scales.clear()
    for rule in tower.rules:
        if isinstance(rule, AngleRule):
            for angle, factor in rule.angles:
                tower.scales[angle] = math.lcm(tower.scales.get(angle, 1), factor.denominator)
            if rule.radians:
                tower.scales[RADIAN] = math.lcm(
                    tower.scales.get(RADIAN, 1), rule.radians.denominator
                )
    tower.default_scale = 1


def _argument(atom: ex.Expression) -> ex.Expression:
    assert isinstance(atom, ex.Apply)
    return atom.argument


def _flat(rows: Sequence[Sequence[int]]) -> list[int]:
    return [x for row in rows for x in row]
