"""Whether the right sides of a certificate satisfy equations as they were given, unsolved.

The given trees are evaluated, with q'' := f as the checker reads f, in the checker's own rings: what has to vanish is
zero by algebra, what has to be regular is so by balls at the real point (certificate/FORMAT.md).
Nothing of the way from the given equations to f is used: no matrix inverted, no term collected. What the
checker's reader understands too is read twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import chain
from time import thread_time
from typing import TYPE_CHECKING, Any

from inverse_service.certificate import cell, checker, formulas as fm, numbers, question as checks
from inverse_service.expressions import derivative, tree as ex

if TYPE_CHECKING:
    from inverse_service.mechanics.constrained_motion import NonholonomicSystem

Ring = Any  # one of the checker's, and an element of it
Value = Any
Table = dict[ex.Expression, Value]
Matrix = Sequence[Sequence[ex.Expression]]
# Elements of a ring that have to vanish, each with what is wrong otherwise, and the values of all leaves there.
_Vanishing = tuple[list[tuple[Value, str]], Table]


@dataclass(frozen=True, slots=True)
class Canonical:
    """What a certificate says of its system, as plain data, and the set of its claim: near, conditions, roots."""

    system: object
    claim: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GivenText:
    """An equation as it was typed, left and right, and the texts of parameters that have values."""

    left: str
    right: str
    values: Mapping[str, str]


def equations_agree(
    equations: Sequence[ex.Expression],
    coordinates: Sequence[str],
    canonical: Canonical,
    time_limit: float = 60.0,
    texts: Sequence[GivenText | None] = (),
) -> checker.CheckResult:
    """Whether E_k(t, q, q', f) = 0 for all k and dE/dq'' is regular there: then f is what E = 0 determines.

    The `cell` of a valid answer says where it is regular: beyond it E = 0 is another system than q'' = f.
    `texts`, one for each equation or none, are read by the checker's reader as well, where it accepts them: the
    two have to agree about E_k.
    """
    if len(equations) != len(coordinates):
        return checker.CheckResult("invalid", ("The numbers of given equations and of coordinates differ.",))
    slopes = [
        [derivative.differentiate(equation, ex.Acceleration(name)) for name in coordinates] for equation in equations
    ]
    candidates: dict[int, list[tuple[int, int]]] = {}

    def vanishing(ring: Ring) -> _Vanishing:
        table, zeros = _table(ring, coordinates, ring.names), list[tuple[Value, str]]()
        for number, equation in enumerate(equations, 1):
            value = _value(equation, ring, table)
            left = _against(value, ring, candidates.setdefault(number, []))
            zeros.append((left, f"The accelerations do not satisfy equation {number} as given."))
            second = _second_reading(texts[number - 1], ring, table) if texts else None
            if second is not None:
                difference = ring.add([second, value], [1, -1])
                zeros.append((difference, f"Two readers understand equation {number} as given differently."))
        return zeros, table

    found = "The accelerations satisfy the equations as given, which determine them."
    wrong = "The equations as given do not determine the accelerations."
    plain = _is_rational(equations) and not any(_is_irrational(text) for text in texts if text is not None)
    return _examined(canonical, coordinates, vanishing, slopes, plain, (found, wrong), time_limit)


def _against(value: Value, ring: Ring, candidates: list[tuple[int, int]]) -> Value:
    """A value that vanishes where E is plus or minus a line of the certificate, if these lines are not solved for q''.

    As the matrix dE/dq'' is regular, two equations cannot be the same line. The first call finds the candidates, lines
    with their signs: a difference that is not 0 at one point is not 0.
    """
    texts = ring.question.unsolved
    if not texts:
        return value
    lines = [fm.value_of(ring, text) for text in texts]
    every = [(k, sign) for k in range(len(lines)) for sign in (1, -1)]
    differences = {(k, sign): ring.add([value, lines[k]], [1, sign]) for k, sign in candidates or every}
    if not candidates:
        candidates += [one for one in every if _may_vanish(differences[one], ring)] or every
    return reduce(lambda left, right: ring.multiply(left, right, 0), [differences[one] for one in candidates])


def _may_vanish(value: Value, ring: Ring) -> bool:
    """Whether a value read at one point is 0 there, or in balls perhaps."""
    return all(
        number.contains(0) if isinstance(ring.arithmetic, numbers.Balls) else number == 0 for number in value.values()
    )


def motion_agrees(given: NonholonomicSystem, canonical: Canonical, time_limit: float = 60.0) -> checker.CheckResult:
    """Whether f is the motion of L under the constraints w(t, q, v) = 0, where they hold.

    At points with w = 0: dw/dt = 0, and the Euler-Lagrange expressions of L are a combination of the
    rows of dw/dv; with M = d2L/dv2 the matrix (M, (dw/dv)^T; dw/dv, 0) is regular, so there is one such f.
    The `cell` of a valid answer says where it is.
    """
    names = given.coordinates
    slopes = [[derivative.differentiate(each, ex.Velocity(name)) for name in names] for each in given.constraints]
    momenta = [derivative.differentiate(given.lagrangian, ex.Velocity(name)) for name in names]
    masses = [[derivative.differentiate(momentum, ex.Velocity(name)) for name in names] for momentum in momenta]
    rates = [derivative.differentiate_in_time(each, names) for each in given.constraints]
    forces = [
        derivative.differentiate_in_time(momentum, names) - derivative.differentiate(given.lagrangian, ex.Symbol(name))
        for momentum, name in zip(momenta, names, strict=True)
    ]
    bordered = [[*masses[i], *(row[i] for row in slopes)] for i in range(len(names))]
    bordered += [[*row, *[ex.ZERO] * len(slopes)] for row in slopes]
    pivots: list[int] = []

    def vanishing(ring: Ring) -> _Vanishing:
        table = _table(ring, names, _on_constraints(given, slopes, ring, pivots))
        leaving = "The accelerations leave the constraints as given."
        zeros = [(_value(each, ring, table), leaving) for each in (*given.constraints, *rates)]
        rows = [[_value(entry, ring, table) for entry in row] for row in slopes]
        reduced = _reduced(rows, ring, pivots)
        left = [_value(force, ring, table) for force in forces]
        for pivot, row in zip(pivots, reduced, strict=True):
            left = [ring.add([a, ring.multiply(left[pivot], b, 0)], [1, -1]) for a, b in zip(left, row, strict=True)]
        wrong = "On the constraints these are not the accelerations of the Lagrangian as given."
        zeros += [(entry, wrong) for entry in left]
        return zeros, table

    found = "On the constraints the accelerations are the motion of the Lagrangian as given, which determines it."
    wrong = "The Lagrangian and the constraints as given do not determine the motion."
    plain = _is_rational((given.lagrangian, *given.constraints))
    return _examined(canonical, names, vanishing, bordered, plain, (found, wrong), time_limit)


def _examined(
    canonical: Canonical,
    coordinates: Sequence[str],
    vanishing: Callable[[Ring], _Vanishing],
    regular: Matrix,
    rational: bool,
    sentences: tuple[str, str],
    time_limit: float,
) -> checker.CheckResult:
    """The verdict by the checker's two rules on what has to vanish, and on the matrix to be regular; never raises.

    `sentences` say what a valid claim means, and what is wrong where the matrix is singular.
    """
    moving = {ex.TIME, *map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)}
    is_constant = moving.isdisjoint(ex.distinct_nodes(chain(*regular)))

    def matrix(ring: Ring, table: Table) -> list[list[Value]]:
        return [[_value(entry, ring, table) for entry in row] for row in regular]

    def parts(ring: Ring) -> tuple[list[tuple[Value, str]], list[list[Value]]]:
        zeros, table = vanishing(ring)
        return zeros, matrix(ring, table)

    def claims(ring: Ring) -> checks.Claims:
        zeros, rows = parts(ring)
        numbers_of_rows = [[entry.get(0, 0) for entry in row] for row in rows]
        return checks.Claims([checks.Zero(*pair) for pair in zeros], [checks.Regular(numbers_of_rows, sentences[1])])

    def where(question: checks.Question) -> cell.Cell:
        if question.unsolved or is_constant:
            return cell.Cell()
        return cell.where_regular(question, lambda ring: matrix(ring, _leaves(coordinates, ring.names)))

    def work(tools: Any) -> list[str]:
        question = checks.Question(tools, canonical.system, True, canonical.claim)
        question.prepare(parts, (), rational)
        question.settle(0, claims)
        try:
            cells.append(where(question))
        except fm.Ended:
            cells.append(cell.Cell(unknown=True))
        return [sentences[0]]

    cells, begun = list[cell.Cell](), thread_time()
    found = checker.judged(work, time_limit, None)
    left = time_limit - (thread_time() - begun)
    # The points are drawn at random: other points may decide what these did not.
    if found.verdict == "incomplete" and left > time_limit / 2:
        found = checker.judged(work, left, None)
    return replace(found, cell=cells[-1]) if found.verdict == "valid" else found


def _on_constraints(
    given: NonholonomicSystem, slopes: list[list[ex.Expression]], ring: Ring, pivots: list[int]
) -> dict[str, Value]:
    """The point with some velocities moved to where the constraints hold; they are affine in the velocities."""
    values = dict(ring.names)
    table = _leaves(given.coordinates, values)
    rows = [
        [_value(entry, ring, table) for entry in (*row, each)]
        for row, each in zip(slopes, given.constraints, strict=True)
    ]
    reduced = _reduced(rows, ring, pivots)
    for k, row in zip(pivots, reduced, strict=True):
        name = f"{given.coordinates[k]}'"
        values[name] = ring.add([values[name], row[-1]], [1, -1])
    return values


def _reduced(rows: list[list[Value]], ring: Ring, pivots: list[int]) -> list[list[Value]]:
    """The rows with 1 at their own pivot and 0 at those of the others; the first call chooses the pivots."""
    found = list(rows)
    for number in range(len(rows)):
        if number == len(pivots):
            pivots.append(_pivot(found[number], ring, pivots))
        scale = ring.power(found[number][pivots[number]], -1)
        row = [ring.multiply(entry, scale, 0) for entry in found[number]]
        for other, line in enumerate(found):
            factor = line[pivots[number]]
            if other != number:
                pairs = zip(line, row, strict=True)
                found[other] = [ring.add([a, ring.multiply(factor, b, 0)], [1, -1]) for a, b in pairs]
        found[number] = row
    return found


def _pivot(row: list[Value], ring: Ring, taken: list[int]) -> int:
    """A column with an entry that is not zero, in balls the largest."""
    entries = [(k, row[k][0]) for k in range(len(ring.question.coordinates)) if k not in taken and row[k]]
    if isinstance(ring.arithmetic, numbers.Balls):
        entries = sorted((pair for pair in entries if not pair[1].contains(0)), key=lambda pair: -abs(float(pair[1])))
    if not entries:
        raise numbers.Undefined
    return entries[0][0]


def _second_reading(text: GivenText | None, ring: Ring, table: Table) -> Value | None:
    """left - right by the checker's reader; None where one of the texts is not in its grammar."""
    if text is None:
        return None
    given = {f"{node.coordinate}''": value for node, value in table.items() if isinstance(node, ex.Acceleration)}
    try:
        given |= {name: fm.value_of(ring, fm.read_tokens(written, "formula")) for name, written in text.values.items()}
        if any(ring.names.get(name) is not value for name, value in given.items()):
            ring.names = ring.names | given  # for all equations, so that they share their parts
        sides = [fm.value_of(ring, fm.read_tokens(side, "formula")) for side in (text.left, text.right)]
    except fm.Ended as end:
        if end.args[0] == "incomplete":
            raise
        return None
    return ring.add(sides, [1, -1])


def _is_rational(formulas: Iterable[ex.Expression]) -> bool:
    """Whether they are rational in everything, with moderate exponents."""
    nodes = [node for formula in formulas for node in ex.walk(formula)]
    powers = [node.exponent for node in nodes if isinstance(node, ex.Power)]
    whole = [
        isinstance(each, ex.Number) and each.value.denominator == 1 and abs(each.value) <= fm.MAX_POWER
        for each in powers
    ]
    return all(whole) and not any(isinstance(node, ex.Apply) for node in nodes)


def _is_irrational(text: GivenText) -> bool:
    """Whether the checker's reader meets more than rational operations in it; what it cannot read is not compared."""
    try:
        return any(
            fm.is_irrational(fm.read_tokens(part, "formula")) for part in (text.left, text.right, *text.values.values())
        )
    except fm.Ended:
        return False


def _leaves(coordinates: Iterable[str], values: dict[str, Value]) -> Table:
    velocities = {f"{name}'": name for name in coordinates}
    return {
        ex.Velocity(velocities[name]) if name in velocities else ex.Symbol(name): value
        for name, value in values.items()
    }


def _table(ring: Ring, coordinates: Sequence[str], values: dict[str, Value]) -> Table:
    """Values of all leaves, q'' := f."""
    bound = {name: value for name, value in values.items() if name.endswith("'")}
    forces = fm.read_formulas(ring, ring.question.force_texts, **bound)
    return _leaves(coordinates, values) | {
        ex.Acceleration(name): force for name, force in zip(coordinates, forces, strict=True)
    }


def _value(tree: ex.Expression, ring: Ring, table: Table) -> Value:
    unknown, stack = list[ex.Expression](), [tree]
    while stack:
        node = stack.pop()
        if node not in table:
            unknown.append(node)
            stack.extend(ex.children(node))
    for node in reversed(unknown):  # parts before what they are parts of
        if node not in table:
            table[node] = _evaluated(node, ring, table)
    return table[tree]


def _evaluated(node: ex.Expression, ring: Ring, table: Table) -> Value:
    match node:
        case ex.Number(value):
            return ring.constant(value)
        case ex.Sum(terms):
            return ring.add([table[term] for term in terms])
        case ex.Product(factors):
            return reduce(lambda a, b: ring.multiply(a, b, 0), [table[factor] for factor in factors])
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return ring.power(table[base], value.numerator)
        case ex.Power(base, exponent):
            return fm.joined(ring, "^", table[base], table[exponent])
        case ex.Apply(name, argument):
            return fm.applied(ring, name, table[argument])
        case ex.Arbitrary(name, arguments, orders):
            return ring.function(name, orders, [table[argument] for argument in arguments])
    raise numbers.Undefined  # a leaf that the system does not know
