"""Explain why a system is not variational, in steps that can be followed with pencil and paper.

Conditions that are too long to write out are shown with numbers at one point. A minor that is
nonzero there is nonzero on an open dense set (f is analytic), so g = 0 at the point implies g = 0
at every generic point. The same is true for values that belong to no real point but satisfy all
algebraic relations among the functions, because the minor is then a nonzero element of their field.
If only singular g remain, the numbers show why; `hierarchy` has checked at random points that this
is generic.

`numbers_at_a_point` finds a point at which variables and atoms of f have small rational values that
respect all relations among them. Coordinates, velocities, parameters and the free generators of f
(tan of a half angle, the root of an exponential, an arbitrary function and its derivatives) get
small integers. If a root is not rational, the next point is tried. Values are found modulo a prime
and reconstructed as fractions (Wang 1981); a second prime confirms them.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, Protocol, cast

from inverse_service import bounds, errors
from inverse_service.deadline import now
from inverse_service.decision.deciding import Analysis
from inverse_service.decision.solutions import Step
from inverse_service.explanation import hierarchy
from inverse_service.explanation.explaining import Piece, enumerated, said, separated
from inverse_service.expressions import collecting, notation, printing, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, tower
from inverse_service.field.dense_series import Series
from inverse_service.mechanics.conditions import Tensor11, Tensor12
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.statements.questions import Question

# Seconds for the exact elimination, and for the search for a point with rational values.
TIME_LIMIT, NUMBERS_LIMIT = 1.0, 5.0
# The number of coordinates up to which equations are solved step by step; 6 coordinates have 21
# entries of g.
MOST_COORDINATES = 5
_SYMMETRIC = "g_ij T^j_k = g_kj T^j_i"
_CYCLIC = "g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0"
SINGULAR = "det g = 0"
# Every argument begins with `opening`, which supposes that there is a regular Lagrangian, and ends
# with this.
NO_LAGRANGIAN = "This is a contradiction, so no regular Lagrangian exists."
# Derivations of G for its factor e^u: one for u_v, two for u_q, one more to compare mixed
# derivatives.
_ORDERS_OF_FACTOR = 3
# The number of characters of one step beyond which numbers at one point are easier to follow.
LONGEST_SHOWN = 2_000

Row = tuple[Fraction, ...]
Values = Mapping[Any, Fraction]

# Small numbers come first; larger ones, needed for rational roots, come later.
_SMALL, _LARGER, _PATIENCE = 5, 12, 20
_PLAIN = tuple(
    tuple(map(Fraction, values.split())) for values in ("0 0 1 2", "0 0 1 2", "0 0 1 -1", "0 0 1 2")
)
_SPEEDS = tuple(map(Fraction, ("0", "3/5", "4/5", "-3/5")))
CHOSEN = modular.safe_prime(7_003)


class Trees(Protocol):
    """What a motion is given by, and the tower of its atoms."""

    @property
    def accelerations(self) -> tuple[ex.Expression, ...]: ...
    @property
    def tower(self) -> tower.Tower: ...


def explain_negative(
    analysis: Analysis, chosen: hierarchy.ChosenEquations | None, question: Question, seed: int
) -> tuple[Step, ...]:
    """From the chosen equations of the hierarchy to det g = 0; for None, the differential
    consequence.

    The exact steps, unless one of them is longer than `LONGEST_SHOWN` and the steps with numbers at
    one point are shorter; where neither exist (too large, or more than one direction remains), the
    ranks. `timed` says that the question was for L(t, q, v).
    """
    system = analysis.system
    budget = exact_field.Budget(bounds.TERMS, now() + TIME_LIMIT)
    few = len(system.coordinates) <= MOST_COORDINATES
    found = list[tuple[Step, ...]]()
    numbers = list[tuple[Step, ...]]()

    def compare(step: Step) -> None:
        """TooLarge where the steps with numbers are shown whatever follows this step."""
        if chosen is None or len(step.text) <= LONGEST_SHOWN:
            return
        if not numbers:
            begun = now()
            numbers.extend(_in_numbers(analysis, chosen) or [()])
            budget.deadline += now() - begun
        if numbers[0] and _longest(numbers[0]) < len(step.text):
            raise exact_field.TooLarge("numbers at one point are easier to follow")

    with suppress(exact_field.TooLarge, ZeroDivisionError):
        if chosen is None:
            found.append(
                _by_differentiation(
                    analysis, question.widened(system.depends_on_time), seed, budget
                )
            )
        elif few:
            found.append(_by_elimination(analysis, chosen, seed, budget, compare))
    if chosen is not None and few and not any(_longest(steps) <= LONGEST_SHOWN for steps in found):
        found += [one for one in numbers or _in_numbers(analysis, chosen) if one]
    summary = differential_summary(system) if chosen is None else summary_steps(system, chosen)
    return min(found, key=_longest, default=summary)


def _longest(steps: Sequence[Step]) -> int:
    """The number of characters of the longest step; steps of thousands of characters are useless to
    readers.
    """
    return max(len(step.text) for step in steps)


def _by_elimination(
    analysis: Analysis,
    chosen: hierarchy.ChosenEquations,
    seed: int,
    budget: exact_field.Budget,
    compare: Callable[[Step], None],
) -> tuple[Step, ...]:
    solved = solve_conditions(analysis, chosen, seed, budget, compare=compare)
    return (opening(analysis.system, chosen), *solved.steps, _closing_step(solved))


@dataclass(frozen=True, slots=True)
class SolvedConditions:
    """The exact elimination of chosen equations, with its steps."""

    rows: hierarchy.ExactRows
    result: hierarchy.Elimination
    steps: tuple[Step, ...]


def solve_conditions(
    analysis: Analysis,
    chosen: hierarchy.ChosenEquations,
    seed: int,
    budget: exact_field.Budget,
    further_orders: int = 0,
    compare: Callable[[Step], None] | None = None,
) -> SolvedConditions:
    """Eliminate exactly; see `hierarchy.exact_rows`. `compare` sees each step as it is written."""
    rows = hierarchy.exact_rows(analysis, chosen.equations, seed, budget, further_orders)
    result, steps = hierarchy.eliminate(rows.equations, rows.table), list[Step]()

    def write(step: Step) -> None:
        if compare is not None:
            compare(step)
        steps.append(step)

    for condition in chosen.conditions:
        write(tensor_step(rows.ring, condition, rows.tensors[condition]))
    for solved in result.solved:
        write(_solved_step(rows, solved, analysis.system.parameters))
    return SolvedConditions(rows, result, tuple(steps))


def _by_differentiation(
    analysis: Analysis, question: Question, seed: int, budget: exact_field.Budget
) -> tuple[Step, ...]:
    """The steps that determine the multiplier up to a factor, and contradictory equations for the
    factor.
    """
    chosen = (
        hierarchy.equations_of_one_direction(analysis, seed)
        if len(analysis.system.coordinates) > 1
        else None
    )
    if chosen is None:
        raise exact_field.TooLarge("the algebraic conditions leave more than one direction")
    solved = solve_conditions(analysis, chosen, seed, budget, _ORDERS_OF_FACTOR)
    exact, ring = solved.rows.exact, solved.rows.ring
    direction = hierarchy.direction_matrix(solved.result, exact.motion.size, ring.constant(1))
    found = hierarchy.contradiction(analysis, exact, direction, question, seed)
    steps = (*solved.steps, *factor_steps(ring, direction, found))
    return (opening(analysis.system, chosen), *steps)


def _solved_step(
    rows: hierarchy.ExactRows, step: hierarchy.Solved, parameters: Collection[str]
) -> Step:
    ring = rows.ring
    original, reduced, result = (
        linear_tree(rows, row) for row in (step.original, step.reduced, step.value)
    )
    divisors = [
        *exact_field.factor_trees(ring, step.content),
        *exact_field.factor_trees(ring, step.divisor),
    ]
    return equation_step(
        step.name, original, reduced, rows.symbols[step.pivot], result, divisors, parameters
    )


def linear_tree(rows: hierarchy.ExactRows, row: hierarchy.Linear) -> ex.Expression:
    """The combination of the entries of g as a tree."""
    return ex.add(
        *(
            exact_field.quotient_tree(rows.ring, row[unknown]) * rows.symbols[unknown]
            for unknown in sorted(row)
        )
    )


def _closing_step(solved: SolvedConditions) -> Step:
    """Why the remaining g are singular, with g written out if it is short; TooLarge if this was not
    recognized.
    """
    rows, n = solved.rows, solved.rows.exact.motion.size
    block = hierarchy.vanishing_block(solved.result.values, n)
    if block is not None:
        return block_sentence(rows.symbols, *block, n)
    one = rows.ring.constant(1)
    elements = {unknown: rows.ring.atoms[symbol] for unknown, symbol in rows.symbols.items()}
    if not hierarchy.remaining_determinant(solved.result, n, elements, one).is_zero:
        raise exact_field.TooLarge("the determinant of what remains was not recognized as zero")
    end = f"`det g` is zero for all values of the remaining entries. {NO_LAGRANGIAN}"
    entries = [[linear_tree(rows, row) for row in line] for line in solved.result.matrix(n, one)]
    if sum(ex.node_count(entry) for line in entries for entry in line) > bounds.SHOWN:
        return said(f"With these values {end}", shown=[SINGULAR])
    return said(
        "With these values ",
        notation.row("g = ", notation.matrix(entries)),
        f", and {end}",
        shown=[SINGULAR],
    )


def _in_numbers(analysis: Analysis, chosen: hierarchy.ChosenEquations) -> list[tuple[Step, ...]]:
    """The argument at one point: tensors, equations, their solution, and why it is singular; []
    without a point.
    """
    values = numbers_at_a_point(analysis, chosen, now() + NUMBERS_LIMIT)
    if values is None:
        return []
    names, span = (
        list(hierarchy.entry_symbols(analysis.system).values()),
        range(len(analysis.system.coordinates)),
    )
    rows = {name: coprime(row) for name, row in _rows(values, chosen, len(names)).items()}
    tensors = {
        condition: notation.matrix(
            [[ex.number(values[condition, i, k]) for k in span] for i in span]
        )
        for condition in chosen.conditions
        if not condition.cyclic
    }
    solution = echelon(list(rows.values()))
    steps = [opening(analysis.system, chosen), _point_step(analysis, chosen, values)]
    for condition, entries in tensors.items():
        shown = notation.row(notation.theory(f"{condition.name} = "), entries)
        steps.append(said("At this point ", shown, "."))
    for name, row in rows.items():
        shown = notation.row(_combination(row, names), " = 0")
        steps.append(said(equation_name(name), ", up to a constant factor: ", shown, "."))
    values_of_g = []
    for pivot, row in solution:
        others = [-a * (k != pivot) for k, a in enumerate(row)]
        values_of_g.append(notation.row(names[pivot], " = ", _combination(others, names)))
    steps.append(said("These linear equations have the solution ", *separated(values_of_g), "."))
    free = [name for k, name in enumerate(names) if k not in dict(solution)]
    return [(*steps, _closing_step_at_point(free))]


def echelon(rows: Sequence[Row]) -> list[tuple[int, Row]]:
    """The reduced echelon form, its pivots the last entries of the rows: (pivot column, row with 1
    in the pivot).
    """
    width = len(rows[0]) if rows else 0
    turned = matrices.echelon_of([line[::-1] for line in rows], width)
    return sorted((width - 1 - pivot, tuple(line[::-1])) for pivot, line in turned)


def coprime(row: Row) -> Row:
    """The multiple of the row with integer entries without a common divisor."""
    content = tm.content_of(row) or 1
    return tuple(value / content for value in row)


def _combination(row: Sequence[Fraction], names: Sequence[ex.Symbol]) -> ex.Expression:
    return ex.add(*(a * name for a, name in zip(row, names, strict=True) if a))


def _point_step(analysis: Analysis, chosen: hierarchy.ChosenEquations, values: Values) -> Step:
    """The substituted values, and why they are admissible."""
    bare = bare_variables(analysis.accelerations)
    variables = [
        each for each in values if isinstance(each, ex.Symbol | ex.Velocity) and each in bare
    ]
    shown = (*sorted(variables, key=printing.to_text), *_atoms(analysis, chosen))
    listed = separated([notation.row(each, " = ", ex.number(values[each])) for each in shown])
    if not listed:
        return said("Take any point.")
    why = "The conditions are too long to print"
    if is_real(analysis):
        return said(f"{why}, so evaluate them at one point: ", *listed, ".")
    return said(
        f"{why}, so substitute numbers for the functions: ", *listed, ". No real point need have these values, but "
        "they satisfy every algebraic relation among these functions and the variables.",
    )  # fmt: skip


def _closing_step_at_point(free: Sequence[ex.Symbol]) -> Step:
    """The conclusion: a full rank is generic, but a vanishing determinant might be special to one
    point.

    `free` are the entries of g that the solution leaves free.
    """
    if not free:
        return said(
            "Hence `g = 0`. The same argument applies at every generic point, because a minor that is nonzero for "
            f"these numbers vanishes at most on a set without interior points. {NO_LAGRANGIAN}",
            shown=[SINGULAR],
        )
    return said(
        "Hence `det g = 0` for all values of ",
        *enumerated(free),
        ". The choice of point does not matter: at random points, modulo large primes, the same equations also admit "
        f"only singular `g`, so `det g = 0` at every generic point. {NO_LAGRANGIAN}",
        shown=[SINGULAR],
    )


def indices(system: SecondOrderSystem) -> list[Piece]:
    """Which index belongs to which coordinate."""
    found: list[Piece] = []
    for k, name in enumerate(system.coordinates, 1):
        found += [f"{', ' * (k > 1)}{k} for ", ex.Symbol(name)]
    return found


def opening(system: SecondOrderSystem, chosen: hierarchy.ChosenEquations) -> Step:
    """The conditions that a multiplier must satisfy."""
    kinds = {condition.cyclic for condition in chosen.conditions}
    return said(
        "Suppose that a regular Lagrangian exists. Its velocity Hessian `g` is symmetric and nonsingular, and ",
        *_listed_conditions(chosen), " (indices: ", *indices(system), ").",
        shown=[formula for kind, formula in ((False, _SYMMETRIC), (True, _CYCLIC)) if kind in kinds],
    )  # fmt: skip


def _listed_conditions(chosen: hierarchy.ChosenEquations) -> list[Piece]:
    plain = [
        notation.theory(condition.name) for condition in chosen.conditions if not condition.cyclic
    ]
    cyclic = [condition.name for condition in chosen.conditions if condition.cyclic]
    found: list[Piece] = ["`g T` is symmetric for `T` = ", *enumerated(plain)] if plain else []
    if cyclic:
        found += [" and "] if found else []
        found.append(notation.theory(_CYCLIC))
        others: list[Piece] = [
            " for ",
            *enumerated([notation.theory(name) for name in cyclic]),
            " in place of `R`",
        ]
        found += [] if cyclic == ["R"] else others
    return found


def tensor_step(
    ring: exact_field.ExactRing,
    condition: hierarchy.ConditionName,
    tensor: Tensor11[exact_field.Quotient] | Tensor12[exact_field.Quotient],
) -> Step:
    """The nonzero components of a tensor of the conditions, the first index above; k < l for
    T^j_kl.
    """
    span = range(len(tensor))
    found: list[tuple[tuple[int, ...], exact_field.Quotient]]
    if condition.cyclic:
        bend = cast("Tensor12[exact_field.Quotient]", tensor)
        found = [
            ((i, k, m), bend[i][k][m]) for i in span for k, m in itertools.combinations(span, 2)
        ]
    else:
        plain = cast("Tensor11[exact_field.Quotient]", tensor)
        found = [((i, k), plain[i][k]) for i in span for k in span]
    shown = [
        notation.row(
            f"({condition.name})^{above + 1}_{_counted(below)} = ",
            exact_field.quotient_tree(ring, value),
        )
        for (above, *below), value in found
        if not value.is_zero
    ]
    name = notation.theory(condition.name)
    if not shown:
        return said("All components of ", name, " are zero.")
    return said("The nonzero components of ", name, " are ", *separated(shown), ".", shown=shown)


def _counted(indices: Sequence[int]) -> str:
    """The indices as a person counts them."""
    return "".join(str(index + 1) for index in indices)


def equation_name(name: hierarchy.EquationName) -> notation.Formula:
    """(nabla Phi)_12: entry 12 of g nabla Phi, which must equal entry 21."""
    return notation.theory(f"({name.condition.name})_{_counted(name.indices)}")


def equation_step(
    name: hierarchy.EquationName,
    original: ex.Expression,
    reduced: ex.Expression,
    pivot: ex.Symbol,
    result: ex.Expression,
    divisors: Sequence[ex.Expression],
    parameters: Collection[str] = (),
) -> Step:
    """One equation, its reduced form, the divisors used, and the result.

    Parameters are numbers, so the step says for which of their values it holds.
    """
    pieces: list[Piece] = [equation_name(name), ": ", notation.row(original, " = 0"), ". "]
    if reduced != original:
        pieces += ["Substituting the results above gives ", notation.row(reduced, " = 0"), ". "]
    return said(
        *pieces,
        *_divided_by(dict.fromkeys(divisors), parameters),
        notation.row(pivot, " = ", result),
        ".",
    )


def _divided_by(divisors: Iterable[ex.Expression], parameters: Collection[str]) -> list[Piece]:
    """For a != 0, since x is not identically zero, …"""
    numbers, others = list[notation.Formula](), list[notation.Formula]()
    for divisor in divisors:
        leaves = [node for node in ex.walk(divisor) if isinstance(node, ex.Symbol | ex.Velocity)]
        constant = leaves and all(
            isinstance(leaf, ex.Symbol) and leaf.name in parameters for leaf in leaves
        )
        (numbers if constant else others).append(notation.formula_of(divisor))
    if not numbers and not others:
        return ["Hence "]
    values: list[Piece] = (
        ["For ", *separated([notation.row(one, " != 0") for one in numbers], " and "), ", "]
        if numbers
        else []
    )
    verb = "is" if len(others) == 1 else "are"
    word = "since " if numbers else "Since "
    return [
        *values,
        *([word, *enumerated(others), f" {verb} not identically zero, "] if others else []),
    ]


def block_sentence(
    symbols: Mapping[hierarchy.Unknown, ex.Symbol],
    rows: tuple[int, ...],
    columns: tuple[int, ...],
    n: int,
) -> Step:
    """Explain that g is singular because the common entries of these rows and columns vanish."""
    names = sorted({symbols[min(r, c), max(r, c)].name for r in rows for c in columns})
    equal = notation.row(*separated([ex.Symbol(name) for name in names], " = "), " = 0")
    if len(rows) == 1 and len(columns) == n:
        why = f"row {rows[0] + 1} of `g` is zero"
    else:
        left, top = ("".join(enumerated([str(k + 1) for k in part])) for part in (rows, columns))
        why = f"the entries of rows {left} of `g` in columns {top} are zero, so these rows are linearly dependent"
    return said(equal, f": {why}, hence `{SINGULAR}`. {NO_LAGRANGIAN}")


def summary_steps(system: SecondOrderSystem, chosen: hierarchy.ChosenEquations) -> tuple[Step, ...]:
    """Conditions and ranks, for expressions too large to follow by hand."""
    entries = len(hierarchy.unknowns(len(system.coordinates)))
    end = "so `g = 0`" if chosen.dimension == 0 else "in which every matrix is singular"
    closing = said(
        "The linear equations ", *enumerated([equation_name(name) for name in chosen.equations]),
        f" on the {entries} entries of `g` have rank {entries - chosen.dimension} at a generic point; the symmetric "
        f"matrices that satisfy them form a space of dimension {chosen.dimension}, {end}. {NO_LAGRANGIAN}",
        shown=[SINGULAR],
    )  # fmt: skip
    middle = said(
        "For each `T` the equation is `g_11 T^1_2 + g_12 (T^2_2 - T^1_1) - g_22 T^2_1 = 0`."
    )
    return (opening(system, chosen), *([middle] if entries == 3 else []), closing)


def differential_summary(system: SecondOrderSystem) -> tuple[Step, ...]:
    """The text used if only the prolonged equations decide and no short argument was found."""
    step = said(
        "A nonsingular `g` survives every algebraic condition (`Phi`, `nabla Phi`, ..., `R`) at a generic point; the "
        "Helmholtz conditions differentiated with respect to ", *separated([*map(ex.Symbol, system.coordinates)]),
        " and the velocities leave only singular ones. The certificate lists the differentiated equations that were "
        "used.",
        shown=["Gamma(g) = g N + (g N)^T", "dg_ij/dv^k = dg_ik/dv^j"],
    )  # fmt: skip
    return (step,)


def factor_steps(
    ring: exact_field.ExactRing,
    direction: Tensor11[exact_field.Quotient],
    found: hierarchy.Contradiction,
) -> list[Step]:
    """g = e^u times a known matrix; the derivatives of u, and the two that contradict each
    other.
    """
    rows = [[exact_field.quotient_tree(ring, entry) for entry in line] for line in direction]
    fixed = said(
        "The algebraic conditions therefore determine `g` up to a factor: `g = e^u G` or `g = -e^u G` with ",
        notation.row("G = ", notation.matrix(rows)), " and unknown `u`.",
    )  # fmt: skip
    steps = [fixed]
    steps += [
        said(
            f"{line.reason}: ",
            notation.row(line.formula, " = ", exact_field.quotient_tree(ring, line.value)),
            ".",
        )
        for line in found.lines
    ]
    tree = exact_field.quotient_tree(ring, found.difference)
    steps.append(
        said("For such `u`, ", found.formula, f"{found.note} must vanish, but it is ", tree,
             f", which is not identically zero. {NO_LAGRANGIAN}")
    )  # fmt: skip
    return steps


@dataclass(slots=True)
class SmallPoint(modular.Point):
    """A point whose free values are small integers, the same modulo every prime; for `key` see
    `modular.Point`.
    """

    def draw(self, key: Hashable) -> int:
        return _small_number(self.seed, key)


@dataclass(slots=True)
class PlainPoint(modular.Point):
    """A point where variables are often 0, so that fewer terms remain; free generators are 1 or 2.

    Every fourth point has velocities such as 3/5, at which roots like (1 - v^2)^(1/2) are rational.
    """

    def draw(self, key: Hashable) -> int:
        return modular.number_value(_plain_number(self.seed, key), self.prime)


# Numbers are drawn again modulo each prime, and to draw one takes as long as to evaluate a formula.
_MOST_DRAWN = 4096


@lru_cache(maxsize=_MOST_DRAWN)
def _small_number(seed: int, key: Hashable) -> int:
    largest = _SMALL if seed < _PATIENCE else _LARGER
    return random.Random(f"{seed}|{key!r}").randint(1, largest)


@lru_cache(maxsize=_MOST_DRAWN)
def _plain_number(seed: int, key: Hashable) -> Fraction:
    source = random.Random(f"{seed}|{key!r}")
    if not (isinstance(key, tuple) and isinstance(key[0], ex.Symbol | ex.Velocity)):
        return Fraction(source.randint(1, 2))
    fractions = isinstance(key[0], ex.Velocity) and seed % 4 == 3
    return source.choice(_SPEEDS if fractions else _PLAIN[seed % 4])


def has_points(analysis: Trees) -> bool:
    """Whether all atoms can have rational values; False if numbers such as pi, sin(1), or exp(2)
    occur.
    """
    radians = any(
        isinstance(rule, tower.AngleRule) and rule.radians for rule in analysis.tower.rules
    )
    bare = bare_variables(analysis.accelerations)
    numbers = any(
        isinstance(atom, ex.Apply) and not modular.variables_in(atom)
        for atom in tower.atoms_in_order(analysis.accelerations)
    )
    return not radians and ex.PI not in bare and not numbers


def is_real(analysis: Trees) -> bool:
    """Whether the values drawn for variables and free generators are those of one real point.

    They are if each free generator is the exponential, sine, or cosine of a rational combination of
    variables that occur nowhere else, and these combinations are independent, because the variables
    can then be chosen accordingly. Otherwise they are values allowed by the same algebraic
    relations.
    """
    bare = bare_variables(analysis.accelerations)
    arguments: list[Mapping[modular.Variable, Fraction]] = []
    for rule in analysis.tower.rules:
        if isinstance(rule, tower.ExponentialRule) and rule.constant:
            return False  # e has its own value
        if not rule.free:
            continue
        found = _of_variables(
            rule.angle if isinstance(rule, tower.AngleRule) else rule.atom.argument
        )
        if (
            found is None
            or not isinstance(rule, tower.AngleRule | tower.ExponentialRule)
            or bare & set(found)
        ):
            return False
        arguments.append(found)
    names = sorted({name for found in arguments for name in found}, key=repr)
    rows = [[found.get(name, Fraction(0)) for name in names] for found in arguments]
    return not names or len(matrices.echelon_of(rows, len(names))) == len(arguments)


def _of_variables(tree: ex.Expression) -> dict[modular.Variable, Fraction] | None:
    """The coefficients of a rational combination of variables; None for another expression."""
    found: dict[modular.Variable, Fraction] = {}
    for monomial, value in collecting.expand(tree):
        match tuple(monomial):
            case ((ex.Symbol() | ex.Velocity() as name, 1),):
                found[name] = value
            case _:
                return None
    return found


def bare_variables(expressions: Iterable[ex.Expression]) -> set[modular.Variable]:
    """Variables that occur outside transcendental atoms."""
    found: set[modular.Variable] = set()
    for each in expressions:
        if isinstance(each, ex.Symbol | ex.Velocity):
            found.add(each)
        elif not isinstance(each, ex.Apply):
            found |= bare_variables(ex.children(each))
    return found


def atoms_and_jets(analysis: Trees, further: int) -> list[ex.Expression]:
    """Transcendental atoms and roots in f, and arbitrary functions with `further` more derivatives
    than in f.
    """
    nodes = {
        node for node in ex.distinct_nodes(analysis.accelerations) if isinstance(node, ex.Arbitrary)
    }
    functions: dict[tuple[str, tuple[ex.Expression, ...]], int] = {}
    for node in sorted(nodes, key=printing.to_text):
        place = (node.name, node.arguments)
        functions[place] = max(functions.get(place, 0), sum(node.orders) + further)
    derivatives = [
        ex.Arbitrary(name, arguments, orders)
        for (name, arguments), highest in functions.items()
        for orders in itertools.product(range(highest + 1), repeat=len(arguments))
        if sum(orders) <= highest
    ]
    return [*_with_partners(tower.atoms_in_order(analysis.accelerations)), *derivatives]


def _with_partners(atoms: Iterable[ex.Expression]) -> Iterator[ex.Expression]:
    """The atoms, and with the sine of an angle also its cosine, which derivatives of f contain."""
    seen: set[ex.Expression] = set()
    for atom in atoms:
        both: list[ex.Expression] = [atom]
        if isinstance(atom, ex.Apply) and atom.function in ("sin", "cos"):
            both = [ex.Apply(name, atom.argument) for name in ("sin", "cos")]
        yield from (each for each in both if each not in seen)
        seen.update(both)


def numbers_at_a_point(
    analysis: Analysis, chosen: hierarchy.ChosenEquations, deadline: float
) -> Values | None:
    """Values at a point where the chosen equations allow only singular g.

    The keys are the variables, the atoms, (condition, i, k) of the tensors (n, n), and (name,
    column) of the equations. None if no point is found before the deadline (`now`), or numbers such
    as pi have no value.
    """
    if not has_points(analysis):
        return None
    size = len(analysis.system.coordinates)
    width = len(hierarchy.unknowns(size))
    tensors = hierarchy.local_tensors(analysis, hierarchy.depth_of(chosen.equations))
    atoms = _atoms(analysis, chosen)
    for attempt in range(bounds.TRIES):
        if now() > deadline:
            break
        values = _in_fractions(analysis, chosen, tensors, atoms, attempt)
        if values is None:
            continue
        rows = _rows(values, chosen, width).values()
        residues = [tuple(modular.number_value(entry, CHOSEN) for entry in row) for row in rows]
        if hierarchy.all_singular(matrices.null_rows(residues, width, CHOSEN), size, CHOSEN):
            return values
    return None


def _rows(
    values: Values, chosen: hierarchy.ChosenEquations, width: int
) -> dict[hierarchy.EquationName, Row]:
    return {name: tuple(values[name, k] for k in range(width)) for name in chosen.equations}


def _in_fractions(
    analysis: Analysis,
    chosen: hierarchy.ChosenEquations,
    tensors: hierarchy.LocalTensors,
    atoms: Sequence[ex.Expression],
    attempt: int,
) -> Values | None:
    """All values at point number `attempt` as fractions of small numbers, from one prime and
    confirmed by another.
    """
    prime, second = (modular.safe_prime(k, analysis.tower.residues) for k in (7_001, 7_002))
    found: dict[Any, Fraction] = {}

    def are_small(residues: Mapping[Any, int]) -> bool:
        for key, residue in residues.items():
            value = found.get(key) or modular.reconstruct(residue, prime, bounds.NUMBER)
            if value is None:
                return False
            found[key] = value
        return True

    whole = _residues(analysis, chosen, tensors, atoms, attempt, prime, are_small)
    if not whole or not are_small(whole):
        return None
    known = _residues(analysis, chosen, tensors, atoms, attempt, second)
    if known is None or any(
        (x.numerator - known.get(key, 0) * x.denominator) % second for key, x in found.items()
    ):
        return None
    return found


def small_point(atoms: tower.Tower, attempt: int, prime: int) -> modular.Point | None:
    """Point number `attempt` modulo the prime; None if a root or a function has no value there."""
    kind = PlainPoint if attempt % 2 else SmallPoint
    point = kind(prime, attempt // 2, dict(atoms.real_signs))
    try:
        for rule in atoms.rules:
            tower.replay(rule, point, atoms.scale)
        for tree, sign in (*((radicand, 1) for radicand in atoms.radicands), *atoms.signs):
            if modular.is_positive(modular.evaluate(tree, point), prime) != (sign > 0):
                return None
    except (modular.SingularPoint, ValueError, ZeroDivisionError, errors.IrreducibleAtoms):
        return None
    return point


def _residues(
    analysis: Analysis,
    chosen: hierarchy.ChosenEquations,
    tensors: hierarchy.LocalTensors,
    atoms: Sequence[ex.Expression],
    attempt: int,
    prime: int,
    are_good: Callable[[Mapping[Any, int]], bool] = lambda _: True,
) -> dict[Any, int] | None:
    """All values at point number `attempt` modulo the prime; None if f or its roots have no value
    there, or those of the atoms, which take less time, are not good.
    """
    point = small_point(analysis.tower, attempt, prime)
    if point is None:
        return None
    try:
        found: dict[Any, int] = {atom: modular.evaluate(atom, point) for atom in atoms}
        if not are_good(found):
            return None
        return {**found, **_tensors_and_rows(tensors, chosen, point), **point.variables}
    except (modular.SingularPoint, ValueError, ZeroDivisionError, errors.IrreducibleAtoms):
        return None


def _atoms(analysis: Analysis, chosen: hierarchy.ChosenEquations) -> list[ex.Expression]:
    """The atoms that are shown, with derivatives of functions: one more by the coordinates in Phi
    and in each nabla.
    """
    return atoms_and_jets(analysis, hierarchy.depth_of(chosen.equations) + 1)


def _tensors_and_rows(
    tensors: hierarchy.LocalTensors, chosen: hierarchy.ChosenEquations, point: modular.Point
) -> dict[object, int]:
    """The tensors' components and the rows of the equations at the point."""
    registers, pointwise = tensors.at(point)
    found: dict[object, int] = {}
    for condition in chosen.conditions:
        if not condition.cyclic:
            plain = cast("Tensor11[Series]", tensors.tensors[condition])
            for (i, row), k in itertools.product(enumerate(plain), range(len(plain))):
                found[condition, i, k] = registers.value(row[k].register)
    for name in chosen.equations:
        found |= {(name, column): entry for column, entry in enumerate(pointwise.rows[name])}
    return found
