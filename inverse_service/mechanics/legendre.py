"""The Legendre transform: p = dL/dv solved for v in closed form where that is possible, H = p v -
L.

Every closed form is checked at random real points with 40 digits before it is returned (`judge`);
what does not pass is never returned. Where p = dL/dv has several inverses, `note` says on which one
H holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product
from typing import NamedTuple

from mpmath import mp, mpf

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import (
    book_forms,
    euler_lagrange,
    inverses,
    moves,
    square_forms,
    writing,
)

_MANY, _FEW = 16, 4
_ROUGH_DIGITS, _MOST_DIGITS = 2, 300
_FEWEST_POINTS = 3
TIME_LIMIT = 3.0
_ANY = ex.Velocity("the velocity of a block")
Table = dict[ex.Expression, ex.Expression]


Matrix = tuple[tuple[ex.Expression, ...], ...]


@dataclass(frozen=True, slots=True)
class LegendreTransform:
    """H over (t, q, p); over (t, q, v) where `implicit`, and then `velocities` is None.

    `symbols[i]` is the momentum of coordinate i, as a rule Symbol("p_x") for x; `momenta[i]` is
    p_i(t, q, v), `velocities[i]` is v_i(t, q, p). `note` is empty where p = dL/dv has one inverse.
    `chained` are the velocities before those of a pivot were put in: its Velocity may occur. Where
    there are several inverses, this one holds where every tree of `conditions`, over (t, q, v, p),
    is positive, those included that hold at all points it was checked at.
    """

    lagrangian: ex.Expression
    symbols: tuple[ex.Symbol, ...]
    hamiltonian: ex.Expression
    momenta: tuple[ex.Expression, ...]
    velocities: tuple[ex.Expression, ...] | None
    implicit: bool
    note: str = ""
    chained: tuple[ex.Expression, ...] = ()
    conditions: tuple[ex.Expression, ...] = ()

    @property
    def positive(self) -> tuple[ex.Expression, ...]:
        """What is > 0, over (t, q, v, p), where H belongs to L: the conditions and what the formula
        of H needs.
        """
        return (
            ()
            if self.implicit
            else tuple(
                dict.fromkeys((*self.conditions, *real_branch.own_requirements([self.hamiltonian])))
            )
        )


@dataclass(frozen=True, slots=True)
class Claim:
    """v(p) and H(p) for L(v); `momenta` gives each momentum symbol as a function of v."""

    lagrangian: ex.Expression
    names: tuple[str, ...]
    momenta: Mapping[ex.Symbol, ex.Expression]
    velocities: tuple[ex.Expression, ...]
    hamiltonian: ex.Expression


@dataclass(frozen=True, slots=True)
class Judgment:
    """At how many points a claim holds; where it does not hold everywhere, on which conditions it
    does.
    """

    holding: int
    conditions: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class _Chosen:
    """A checked branch of a block."""

    branch: inverses.InverseBranch
    judgment: Judgment


class ByMassMatrix(NamedTuple):
    """M and V of H = p^T M^-1 p/2 + V."""

    masses: Matrix
    potential: ex.Expression


def by_mass_matrix(transform: LegendreTransform) -> ByMassMatrix | None:
    """M(t, q), (n, n), and V(t, q) with p = M v and H = p^T M^-1 p/2 + V; None for an H of another
    form.

    The momenta are linear in the velocities without further terms, so L = v^T M v/2 - V with V =
    -L(v = 0).
    """
    velocities = tuple(ex.Velocity(symbol.name.removeprefix("p_")) for symbol in transform.symbols)
    moving = {
        node for p in transform.momenta for node in ex.walk(p) if isinstance(node, ex.Velocity)
    }
    if transform.implicit or not moving <= {*velocities}:
        return None
    pairs = [*enumerate(transform.momenta)]
    constants = _constants_of(transform.lagrangian, [v.coordinate for v in velocities])

    def entry(i: int, j: int) -> ex.Expression:
        plain = _coefficient(transform.momenta[min(i, j)], velocities[max(i, j)])
        short = writing.shortest([plain, writing.one_square(writing.opaque_quotient(plain))])
        return _as_in(transform.lagrangian, short, constants)

    rows = tuple(tuple(entry(i, j) for j, _ in pairs) for i, _ in pairs)
    at_rest = dict.fromkeys(velocities, ex.ZERO)
    further = [collecting.collect(ex.substitute(p, at_rest)) for p in transform.momenta]
    if any(tree != ex.ZERO for tree in further) or any(
        ex.has(entry, ex.Velocity) for row in rows for entry in row
    ):
        return None
    terms = ex.summands(transform.lagrangian)
    fixed = [ex.negated(term) for term in terms if not ex.has(term, ex.Velocity)]
    moved = ex.add(*(term for term in terms if ex.has(term, ex.Velocity)))
    return ByMassMatrix(
        rows, ex.add(*fixed, ex.negated(collecting.collect(ex.substitute(moved, at_rest))))
    )


def _as_in(
    lagrangian: ex.Expression, tree: ex.Expression, constants: Sequence[ex.Symbol]
) -> ex.Expression:
    """The tree with sums, and with the constants of products, in the order of L."""
    return writing.with_products_in_order(writing.with_sums_as_in(tree, (lagrangian,)), constants)


def _by_velocities(tree: ex.Expression, velocities: Sequence[ex.Velocity]) -> ex.Expression:
    """A function that is linear in the velocities with one coefficient for each, the rest last."""
    rates = [v for v in velocities if ex.holds(tree, v)]
    slopes = [_coefficient(tree, v) for v in rates]
    if not rates or any(ex.holds(slope, *velocities) for slope in slopes):
        return tree
    short = [writing.shortest([slope, writing.opaque_quotient(slope)]) for slope in slopes]
    rest = collecting.collect(ex.substitute(tree, dict.fromkeys(velocities, ex.ZERO)))
    found = ex.add(*(slope * v for slope, v in zip(short, rates, strict=True)), rest)
    is_same = collecting.collect(found - tree) == ex.ZERO  # not of m x' + a sign(x')
    return found if is_same else tree


def _coefficient(tree: ex.Expression, velocity: ex.Velocity) -> ex.Expression:
    """The coefficient of a velocity in a linear function, whose factors stay as they are."""
    if tree == velocity:
        return ex.ONE
    terms = list[ex.Expression]()
    for term in ex.summands(tree):
        factors = ex.factors_of(term)
        holding = [factor for factor in factors if ex.holds(factor, velocity)]
        if len(holding) == 1 and (holding[0] == velocity or isinstance(holding[0], ex.Sum)):
            others = (factor for factor in factors if factor != holding[0])
            terms.append(ex.multiply(*others, _coefficient(holding[0], velocity)))
        elif holding:
            return collecting.collect(calculus.differentiate(tree, velocity))
    return ex.add(*terms)


def legendre(
    lagrangian: ex.Expression,
    coordinates: Sequence[str],
    time_limit: float = TIME_LIMIT,
    positive: Sequence[ex.Expression] = (),
) -> LegendreTransform:
    """The Legendre transform of L(t, q, v) where all trees of `positive` are > 0.

    InputError where d2L/dv_i dv_j is singular everywhere. The search for an inverse of p = dL/dv
    starts nothing new after `time_limit` seconds of processor time, and what has begun has as long
    again.
    """
    began = deadline.now()
    reach = Reach(end=began + time_limit, last=began + 2 * time_limit)
    names = tuple(coordinates)
    symbols, renamed = momentum_symbols(lagrangian, names)
    constants = _constants_of(lagrangian, names)
    # What is found is the same in whatever order the constants were typed.
    plain = writing.with_products_in_order(
        lagrangian, sorted(constants, key=lambda symbol: symbol.name)
    )
    functions = _momentum_functions(plain, names, constants)
    momenta = dict(zip(names, symbols, strict=True))
    parts = inverses.parts_in_velocities(plain, names, momenta)
    implicit = LegendreTransform(
        lagrangian,
        symbols,
        _as_in(lagrangian, _energy(parts), constants),
        functions,
        None,
        True,
        renamed,
    )
    points = real_branch.sample_points([plain, *functions], positive)
    if not points:
        return _noted(
            implicit,
            "No real point of L was found to check a closed form at; H is given in the velocities.",
        )
    if any(
        real_branch.is_singular(euler_lagrange.hessian(block.function, block.names), points)
        for block in parts.blocks
    ):
        raise _degenerate(implicit, parts, names, points)
    # Of many blocks each is judged at few points before the whole is judged at all.
    few = points[-_FEW:] if len(parts.blocks) > _MANY else []

    def best(block: inverses.Block) -> _Chosen | None:
        with suppress(deadline.OutOfTime), deadline.until(reach.last):
            return _best(block, points, positive, reach, few)
        return None

    found = _of_blocks(parts.blocks, best)
    missing = [group for group, chosen in found.items() if chosen is None]
    if missing:
        return _without_closed_form(implicit, missing)
    branches, table = (
        [chosen for chosen in found.values() if chosen],
        momentum_shifts(parts.linear, momenta),
    )
    closed = _closed(implicit, names, parts, branches, table)
    claim = Claim(
        lagrangian,
        names,
        dict(zip(symbols, functions, strict=True)),
        closed.velocities or (),
        closed.hamiltonian,
    )
    conditions = [
        ex.substitute(condition, table)
        for chosen in branches
        for condition in chosen.judgment.conditions
    ]
    if judge(claim, conditions, points) is None:
        return _without_closed_form(implicit, list(found))
    # Each block needs its own; few points would not show that of one in the presence of another.
    every = [
        ex.substitute(condition, table)
        for chosen in branches
        for condition in chosen.branch.conditions
    ]
    every += signs_of_momenta(claim, table, positive, points)
    return replace(
        _noted(closed, _branch_note(tuple(dict.fromkeys(conditions)), names)),
        conditions=tuple(every),
    )


class Momenta(NamedTuple):
    """The symbols of momenta, and a note on those that have another name than p_x."""

    symbols: tuple[ex.Symbol, ...]
    note: str


def momentum_symbols(lagrangian: ex.Expression, names: Sequence[str]) -> Momenta:
    """p_x for each coordinate x, and a note; where that name is taken, momentum_x, momentum_x_2,
    …
    """
    taken = {
        node.name for node in ex.walk(lagrangian) if isinstance(node, ex.Symbol | ex.Arbitrary)
    } | set(names)
    symbols, notes = [], []
    for name in names:
        choices = [
            f"p_{name}",
            f"momentum_{name}",
            *(f"momentum_{name}_{k}" for k in range(2, len(taken) + 3)),
        ]
        chosen = next(choice for choice in choices if choice not in taken)
        taken.add(chosen)
        symbols.append(ex.Symbol(chosen))
        if chosen != choices[0]:
            notes.append(
                f"The momentum of {name} is called {chosen}, because {choices[0]} is in use."
            )
    return Momenta(tuple(symbols), " ".join(notes))


def _momentum_functions(
    lagrangian: ex.Expression, names: Sequence[str], constants: Sequence[ex.Symbol]
) -> tuple[ex.Expression, ...]:
    """p_i(t, q, v) in short forms, with the constants in products in the order given."""
    # u log u has log u + 1 for a slope, if it is not expanded
    velocities = [ex.Velocity(name) for name in names]
    slopes = euler_lagrange.gradient(lagrangian, velocities)
    found = []
    for given in (slopes.get(v, ex.ZERO) for v in velocities):
        shorter = writing.inside(writing.related(writing.simplified(given)))
        plain = writing.shortest([shorter, given])
        apart = _by_velocities(plain, velocities)
        at_rest = ex.substitute(apart, dict.fromkeys(velocities, ex.ZERO))
        best = (
            writing.shortest([apart, plain])
            if at_rest == ex.ZERO
            else min(plain, apart, key=lambda form: len(printing.to_text(form)))
        )
        best = _moving_first(book_forms.upright(book_forms.in_one_logarithm(best)))
        found.append(_as_in(lagrangian, best, constants))
    return tuple(found)


def _moving_first(tree: ex.Expression) -> ex.Expression:
    """m y' + q A for q A + m y', and a first term without a minus sign if there is one."""
    return ex.add(
        *sorted(
            ex.summands(tree),
            key=lambda term: (not ex.has(term, ex.Velocity), writing.is_negative(term)),
        )
    )


def _energy(parts: inverses.Parts) -> ex.Expression:
    """sum v dL/dv - L block by block, in the velocities; linear terms drop out."""
    terms = [-parts.free]
    for block in parts.blocks:
        slopes = euler_lagrange.gradient(block.function, block.velocities)
        works = [rate * slope for rate, slope in slopes.items()]
        terms.append(
            writing.inside(writing.related(writing.simplified(ex.add(*works) - block.function)))
        )
    return ex.add(*terms[1:], terms[0])


def _of_blocks(
    given: Sequence[inverses.Block], best: Callable[[inverses.Block], _Chosen | None]
) -> dict[tuple[str, ...], _Chosen | None]:
    """That of each block; those of one velocity that are the same function of theirs share one."""
    known: dict[ex.Expression, tuple[inverses.Block, _Chosen | None]] = {}
    found: dict[tuple[str, ...], _Chosen | None] = {}
    for block in given:
        alone = len(block.names) == 1
        key = (
            ex.substitute(block.function, {block.velocities[0]: _ANY}) if alone else block.function
        )
        if not alone or key not in known:
            known[key] = block, best(block)
        first, chosen = known[key]
        found[block.names] = chosen and _renamed(chosen, first, block)
    return found


def _renamed(chosen: _Chosen, first: inverses.Block, block: inverses.Block) -> _Chosen:
    """The branch of the first block for another that is the same function of its velocity."""
    if first is block:
        return chosen
    table: Table = dict(
        zip((*first.velocities, *first.symbols), (*block.velocities, *block.symbols), strict=True)
    )
    conditions = tuple(ex.substitute(tree, table) for tree in chosen.judgment.conditions)
    moved = chosen.branch.changed(lambda tree: ex.substitute(tree, table))
    return _Chosen(moved, replace(chosen.judgment, conditions=conditions))


def _best(
    block: inverses.Block,
    points: Sequence[real_branch.RealTable],
    positive: Sequence[ex.Expression],
    reach: Reach,
    few: Sequence[real_branch.RealTable],
) -> _Chosen | None:
    """A branch with conditions on constants and coordinates alone, then one that holds at most
    points, then short.
    """
    functions = euler_lagrange.momenta(block.function, block.names)
    known = dict(zip(block.symbols, functions, strict=True))
    found: list[_Chosen] = []
    for branch in _with_variants(islice(block_branches(block, reach), bounds.CANDIDATES)):
        velocities = inverses.resolved(branch.velocities, block.names)
        claim = Claim(block.function, block.names, known, velocities, branch.hamiltonian)
        quick = judge(claim, (), few) if few and not branch.conditions else None
        judgment = quick or judge(claim, branch.conditions, points)
        if judgment is None:
            continue
        if not judgment.conditions:
            return _Chosen(branch, judgment)
        # Of the points few may lie where the conditions hold: more are drawn there.
        inside = [
            *positive,
            *(ex.substitute(condition, known) for condition in judgment.conditions),
        ]
        if (
            judge(claim, (), real_branch.sample_points([block.function, *functions], inside))
            is not None
        ):
            found.append(_Chosen(branch, judgment))

    def preference(one: _Chosen) -> tuple[bool, int, int]:
        moving = any(writing.velocities_in(tree, block.names) for tree in one.judgment.conditions)
        return not moving, one.judgment.holding, -ex.node_count(one.branch.hamiltonian)

    return max(found, key=preference, default=None)


def _with_variants(branches: Iterator[inverses.InverseBranch]) -> Iterator[inverses.InverseBranch]:
    """Each branch after shorter forms of it that hold on parts of its domain only; all are
    checked.
    """
    for branch in branches:
        forms: list[Callable[[ex.Expression], ex.Expression]] = [
            writing.roots_apart,
            partial(writing.cancelled, 1),
            partial(writing.cancelled, -1),
        ]
        for form in forms:
            other = inverses.InverseBranch(
                tuple(map(form, branch.velocities)), form(branch.hamiltonian), branch.conditions
            )
            if ex.node_count(other.hamiltonian) < ex.node_count(branch.hamiltonian):
                yield other
        yield branch


def _closed(
    implicit: LegendreTransform,
    names: Sequence[str],
    parts: inverses.Parts,
    chosen: Sequence[_Chosen],
    table: Table,
) -> LegendreTransform:
    """The blocks put together, each momentum less its linear term A_i by the table."""
    rates: dict[str, ex.Expression] = {}
    for block, found in zip(parts.blocks, chosen, strict=True):
        rates.update(
            zip(block.names, (_placed(v, table) for v in found.branch.velocities), strict=True)
        )
    chained = tuple(rates[name] for name in names)
    energies = [
        writing.exponentials_above(_placed(found.branch.hamiltonian, table)) for found in chosen
    ]
    plain = ex.add(*energies, ex.negated(parts.free))
    apart = ex.add(collecting.collect(ex.add(*energies)), ex.negated(parts.free))
    mixed = ex.add(
        collecting.collect(ex.add(*energies, parts.written, ex.negated(parts.free))),
        ex.negated(parts.written),
    )
    short = writing.shortest([plain, apart, mixed, collecting.collect(plain)])
    whole = moves.write(
        ENERGY, _Setting(implicit.lagrangian, implicit.symbols, tuple(names)), short
    )
    return replace(
        implicit,
        hamiltonian=whole,
        velocities=tuple(
            writing.joined(collecting.merge_powers(velocity))
            for velocity in inverses.resolved(chained, names)
        ),
        implicit=False,
        chained=chained,
    )


@dataclass(frozen=True, slots=True)
class _Setting:
    """What the form of H depends on: L, the momenta, and the coordinates."""

    lagrangian: ex.Expression
    momenta: tuple[ex.Symbol, ...]
    names: tuple[str, ...]

    @property
    def letters(self) -> list[ex.Symbol]:
        return [*map(ex.Symbol, self.names)]


def _plain(
    function: Callable[[ex.Expression], ex.Expression],
) -> Callable[[_Setting, ex.Expression], ex.Expression]:
    """A function of the tree as one of setting and tree."""
    return lambda setting, tree: function(tree)


def _potential_of(setting: _Setting, tree: ex.Expression) -> ex.Expression:
    """The terms without momenta as L has them, with the other sign, where that costs no more."""
    velocities = [ex.Velocity(name) for name in setting.names]
    terms = ex.summands(tree)
    moving = [term for term in terms if ex.holds(term, *setting.momenta)]
    still = ex.add(*(term for term in terms if term not in moving))
    given = ex.add(
        *(
            ex.negate(term)
            for term in ex.summands(setting.lagrangian)
            if not ex.holds(term, *velocities)
        )
    )
    if moves.cost(given) > moves.cost(still) or collecting.collect(still - given) != ex.ZERO:
        return tree
    return ex.add(*moving, given)


def _in_order(setting: _Setting, tree: ex.Expression) -> ex.Expression:
    """Sums as in L, the constants of products in its order, and `_place` for the terms; a kinetic
    energy does not begin with a minus sign.
    """
    whole = writing.with_sums_as_in(tree, (setting.lagrangian,))
    constants = _constants_of(setting.lagrangian, setting.names)
    whole = writing.with_products_in_order(whole, constants, setting.momenta)
    terms = sorted(ex.summands(whole), key=partial(_place, setting.momenta))
    if writing.is_negative(terms[0]):
        first = _place(setting.momenta, terms[0])
        terms.sort(
            key=lambda term: (
                _place(setting.momenta, term),
                first < 2 and writing.is_negative(term),
            )
        )
    return ex.add(*terms)


_SAME = moves.Holds.WHERE_DEFINED
ENERGY = tuple(
    moves.Move(name, _SAME, apply)
    for name, apply in (
        ("arguments of functions as one quotient", _plain(writing.inside)),
        ("one logarithm of a quotient", _plain(book_forms.in_one_logarithm)),
        ("tan(u) for sin(u)/cos(u)", _plain(writing.joined)),
        ("no quotient under a root in a denominator", _plain(writing.roots_upright)),
        ("a sin(u)^2 for a - a cos(u)^2", _plain(writing.one_square)),
        (
            "squares of linear forms of momenta",
            lambda setting, tree: square_forms.shortest_form(
                tree, setting.momenta, setting.letters
            ),
        ),
        ("plain numbers above and below a line", _plain(writing.plain_quotients)),
        ("(b - a) c for -(a - b) c", _plain(writing.minus_inside)),
        (
            "(p^2 + q^2)/(2 m) for two quotients",
            lambda setting, tree: writing.with_one_coefficient(tree, setting.momenta),
        ),
        (
            "(p^2 + q^2/r^2)/(2 m) for two quotients",
            lambda setting, tree: book_forms.with_common_constants(
                tree, setting.momenta, _constants_of(setting.lagrangian, setting.names)
            ),
        ),
        ("log(b/a) for -log(a/b)", _plain(book_forms.upright)),
        ("the potential of L", _potential_of),
        ("abs(u)^3 for (u^2)^(3/2)", _plain(writing.with_sizes)),
        ("decimal numbers in their terms", _plain(writing.decimals_inside)),
        ("the order of L", _in_order),
    )
)


def _place(momenta: Sequence[ex.Symbol], term: ex.Expression) -> int:
    """Powers and products of momenta come first, as p^2/(2 m), and terms without momenta last."""
    held = [node for node in ex.walk(term) if ex.holds(node, *momenta)]
    several = sum(base in momenta for base, _ in ex.powers_of(term)) > 1
    if not held:
        return 2
    return int(not several and not any(isinstance(node, ex.Power | ex.Apply) for node in held))


def _constants_of(lagrangian: ex.Expression, names: Sequence[str]) -> tuple[ex.Symbol, ...]:
    """The constants in the order in which L and its products have them."""
    terms = lagrangian.terms if isinstance(lagrangian, ex.Sum) else (lagrangian,)
    products = [[node for node in ex.walk(term) if isinstance(node, ex.Symbol)] for term in terms]
    symbols = dict.fromkeys(node for product in products for node in product)
    constants = [node for node in symbols if node != ex.TIME and node.name not in names]
    return collecting.in_order_of_products(constants, products)


def _placed(tree: ex.Expression, table: dict[ex.Expression, ex.Expression]) -> ex.Expression:
    """The tree with p - A for p; collected where that is shorter."""
    placed = ex.substitute(tree, table)
    forms = [placed, writing.simplified(placed), writing.collected_inside(placed)]
    return placed if placed == tree else writing.shortest(forms)


def _noted(transform: LegendreTransform, note: str) -> LegendreTransform:
    return replace(transform, note=" ".join(part for part in (transform.note, note) if part))


def _without_closed_form(
    implicit: LegendreTransform, groups: Sequence[Sequence[str]]
) -> LegendreTransform:
    what = f"No closed form of p = dL/dv was found for the velocities of {'; '.join(map(', '.join, groups))}."
    return _noted(
        implicit, f"{what} H is given in the velocities, with the momenta as functions of them."
    )


def _branch_note(conditions: Sequence[ex.Expression], names: Sequence[str]) -> str:
    if not conditions:
        return ""
    named = " and ".join(
        dict.fromkeys(
            f"{printing.to_text(writing.sign_part(condition))} > 0" for condition in conditions
        )
    )
    if not any(writing.velocities_in(condition, names) for condition in conditions):
        return f"H is written for {named}."
    return f"p = dL/dv has more than one inverse; this H belongs to the branch on which {named}."


def _degenerate(
    implicit: LegendreTransform,
    parts: inverses.Parts,
    names: Sequence[str],
    points: Sequence[real_branch.RealTable],
) -> errors.InputError:
    """The refusal of a Lagrangian whose momenta do not determine the velocities."""
    detail = "the Lagrangian is degenerate, its matrix d2L/dv_i dv_j is singular everywhere"
    lost = [
        name
        for name in names
        if not any(writing.velocities_in(p, [name]) for p in implicit.momenta)
    ]
    if lost:
        detail += f" (no momentum depends on the velocity of {', '.join(lost)})"
    elif real_branch.vanishes_at(implicit.hamiltonian + parts.free, points):
        detail += " (up to a potential L is homogeneous of degree 1 in the velocities)"
    return errors.InputError(f"{detail}: give one whose momenta determine the velocities.")


def judge(
    claim: Claim, conditions: Sequence[ex.Expression], points: Sequence[real_branch.RealTable]
) -> Judgment | None:
    """Where the claim holds; None unless it holds at three points at least and wherever the
    conditions do.
    """
    nodes = ex.distinct_nodes((*claim.velocities, claim.hamiltonian))
    calls = [node for node in nodes if isinstance(node, ex.Arbitrary)]
    holds, signs, needed = list[bool](), list[list[bool]](), list(range(len(conditions)))
    with mp.workdps(bounds.DIGITS):
        for point in points:
            known = _with_momenta(claim, point, calls)
            signs.append(
                [known is not None and real_branch.is_positive_at(c, known) for c in conditions]
            )
            holds.append(
                known is not None and (_holds(claim, known) or _holds_closer(claim, known, calls))
            )
            if all(signs[-1]) and not holds[-1]:
                return None
    if not _is_right(holds, signs, needed):
        return None
    for place in list(needed):
        fewer = [other for other in needed if other != place]
        if _is_right(holds, signs, fewer):
            needed = fewer
    return Judgment(sum(holds), tuple(conditions[place] for place in needed))


def _is_right(
    holds: Sequence[bool], signs: Sequence[Sequence[bool]], needed: Sequence[int]
) -> bool:
    """Whether the claim holds at all points, three at least, at which the needed conditions
    hold.
    """
    inside = [
        held for held, row in zip(holds, signs, strict=True) if all(row[place] for place in needed)
    ]
    return len(inside) >= _FEWEST_POINTS and all(inside)


def _with_momenta(
    claim: Claim, point: real_branch.RealTable, calls: Sequence[ex.Arbitrary]
) -> real_branch.RealTable | None:
    momenta: dict[ex.Expression, calculus.Real] = {
        symbol: real_branch.value_at(tree, point) for symbol, tree in claim.momenta.items()
    }
    if any(p is None for p in momenta.values()):
        return None
    return _with_equal_calls(calls, {**point, **momenta})


def _with_equal_calls(
    calls: Sequence[ex.Arbitrary], point: real_branch.RealTable
) -> real_branch.RealTable:
    """The point with those calls valued whose arguments have the values of those of a call that is
    drawn.
    """
    fresh = [call for call in calls if call not in point]
    drawn = [call for call in point if isinstance(call, ex.Arbitrary)] if fresh else []
    for call in fresh:
        same = [other for other in drawn if (other.name, other.orders) == (call.name, call.orders)]
        equal = next(
            (other for other in same if _are_equal(other.arguments, call.arguments, point)), None
        )
        if equal is not None:
            point[call] = point[equal]
    return point


def _are_equal(
    left: Sequence[ex.Expression], right: Sequence[ex.Expression], point: real_branch.RealTable
) -> bool:
    """Whether the values agree to 40 digits, each pair."""
    pairs = [
        (real_branch.value_at(a, point), real_branch.value_at(b, point))
        for a, b in zip(left, right, strict=True)
    ]
    near = mpf(10) ** -bounds.AGREEING
    return all(
        a is not None and b is not None and abs(a - b) <= near * (1 + abs(a)) for a, b in pairs
    )


def _holds_closer(
    claim: Claim, point: real_branch.RealTable, calls: Sequence[ex.Arbitrary]
) -> bool:
    """The same with more digits, where digits seem to have been lost in differences of large
    numbers.
    """
    if not _holds(claim, point, _ROUGH_DIGITS):
        return False
    with mp.workdps(_MOST_DIGITS):
        leaves = [
            leaf for leaf in point if isinstance(leaf, ex.Symbol | ex.Velocity | ex.Arbitrary)
        ]
        fresh: real_branch.RealTable = {leaf: point[leaf] for leaf in leaves}
        closer = _with_momenta(claim, fresh, calls)
        return closer is not None and _holds(claim, closer)


def _holds(claim: Claim, point: real_branch.RealTable, digits: int = bounds.AGREEING) -> bool:
    """v(q, p(q, v)) = v and H(q, p(q, v)) = p v - L at a point, to so many digits."""
    lagrangian = real_branch.value_at(claim.lagrangian, point)
    if lagrangian is None:
        return False
    rates = [point[ex.Velocity(name)] for name in claim.names]
    works = [point[symbol] * v for symbol, v in zip(claim.momenta, rates, strict=True)]
    expected = [*rates, mp.fsum([*works, -lagrangian])]
    found = [real_branch.value_at(tree, point) for tree in (*claim.velocities, claim.hamiltonian)]
    scales = [abs(rate) for rate in rates] + [abs(lagrangian) + mp.fsum(map(abs, works))]
    return all(
        a is not None and abs(a - b) <= mpf(10) ** -digits * scale
        for a, b, scale in zip(found, expected, scales, strict=True)
    )


def signs_of_momenta(
    claim: Claim,
    shifts: Mapping[ex.Expression, ex.Expression],
    positive: Sequence[ex.Expression],
    points: Sequence[real_branch.RealTable],
) -> tuple[ex.Expression, ...]:
    """s (p - A) > 0, s = 1 or -1, for momenta p that have this sign where L is defined, if H has
    values beyond it.

    x' = 4 p^2/9 of p = 3 sqrt(x')/2 has values for p < 0 as well, which belong to another motion.
    """
    is_restricted = any(ex.has(tree, ex.Velocity) for tree in positive)
    allows_all = not is_restricted and _is_polynomial_in_velocities(claim.lagrangian)
    bounded = {
        p: tree for p, tree in claim.momenta.items() if not (allows_all and _is_affine(tree))
    }
    if not bounded:
        return ()
    with mp.workdps(bounds.DIGITS):
        known = [
            point
            for point in (_with_momenta(claim, point, []) for point in points)
            if point is not None
        ]
        return tuple(
            tree if sign > 0 else -tree
            for symbol in bounded
            if (sign := _sign_at(tree := shifts.get(symbol, symbol), known))
            and _leaves_the_image(claim, symbol, tree, positive, known)
        )


def _is_polynomial_in_velocities(tree: ex.Expression) -> bool:
    """Whether velocities occur in no functions and only in positive integer powers: all their
    values are allowed.
    """
    for node in ex.distinct_nodes((tree,)):
        match node:
            case ex.Power(_, ex.Number(exponent)) if exponent > 0 and exponent.denominator == 1:
                continue
            case ex.Power() | ex.Apply() | ex.Arbitrary() if ex.has(node, ex.Velocity):
                return False
    return True


def _is_affine(tree: ex.Expression) -> bool:
    """Whether a polynomial in the velocities is of degree 1, so that it takes all values."""
    for node in ex.distinct_nodes((tree,)):
        factors = (
            node.factors
            if isinstance(node, ex.Product)
            else (node, node)
            if isinstance(node, ex.Power)
            else ()
        )
        if sum(ex.has(factor, ex.Velocity) for factor in factors) > 1:
            return False
    return ex.has(tree, ex.Velocity)


def _sign_at(tree: ex.Expression, points: Sequence[real_branch.RealTable]) -> int:
    """1 or -1 where it has this sign at all points, else 0."""
    signs = {
        int(mp.sign(number)) if (number := real_branch.value_at(tree, point)) is not None else 0
        for point in points
    }
    return signs.pop() if len(signs) == 1 else 0


def _leaves_the_image(
    claim: Claim,
    symbol: ex.Symbol,
    tree: ex.Expression,
    positive: Sequence[ex.Expression],
    points: Sequence[real_branch.RealTable],
) -> bool:
    """Whether H and v(p) have values with the other sign of p - A, and p(v(p)) is never p where L
    is defined.
    """
    wrong, near = False, mpf(10) ** -bounds.AGREEING
    for point in points:
        mirrored: real_branch.RealTable = {
            leaf: point[leaf] for leaf in point if isinstance(leaf, ex.Symbol | ex.Arbitrary)
        }
        mirrored[symbol] -= 2 * point[tree]
        rates = [real_branch.value_at(rate, dict(mirrored)) for rate in claim.velocities]
        if None in rates or real_branch.value_at(claim.hamiltonian, dict(mirrored)) is None:
            continue
        there: real_branch.RealTable = {
            **mirrored,
            **dict(zip(map(ex.Velocity, claim.names), rates, strict=True)),
        }
        found = [
            (real_branch.value_at(p, there), mirrored[name]) for name, p in claim.momenta.items()
        ]
        is_image = all(a is not None and abs(a - b) <= near * (1 + abs(b)) for a, b in found)
        if is_image and all(real_branch.is_positive_at(condition, there) for condition in positive):
            return False
        wrong = True
    return wrong


@dataclass(frozen=True, slots=True)
class Reach:
    """How deep blocks may be split into smaller problems, and when (`now`) nothing new begins and
    all ends.
    """

    depth: int = 4
    end: float = float("inf")
    last: float = float("inf")

    @property
    def exhausted(self) -> bool:
        return self.depth <= 0 or deadline.now() > self.end


def block_branches(block: inverses.Block, reach: Reach) -> Iterator[inverses.InverseBranch]:
    """Candidates for one block without linear terms; none of them is checked here."""
    yield from inverses.quadratic_branches(block)
    if inverses.form_matrix(collecting.expand(block.function), block.names) is not None:
        return
    inner = partial(momentum_branches, reach=Reach(reach.depth - 1, reach.end))
    for family in (
        inverses.radial_branches,
        inverses.ratio_branches,
        inverses.linear_branches,
        inverses.scalar_branches,
    ):
        if reach.exhausted:
            return
        yield from family(block, inner)
    if not reach.exhausted:
        yield from inverses.elimination_branches(block)


def momentum_branches(
    function: ex.Expression, names: Sequence[str], momenta: Mapping[str, ex.Symbol], reach: Reach
) -> Iterator[inverses.InverseBranch]:
    """Candidates for any function of the velocities: products of those of its blocks."""
    parts = inverses.parts_in_velocities(function, names, momenta)
    found = [_up_to_certain(block, reach) for block in parts.blocks]
    table = momentum_shifts(parts.linear, momenta)
    for choice in islice(product(*found), bounds.CANDIDATES):
        rates = {
            name: ex.substitute(tree, table)
            for block, branch in zip(parts.blocks, choice, strict=True)
            for name, tree in zip(
                block.names, inverses.resolved(branch.velocities, block.names), strict=True
            )
        }
        energies = [ex.substitute(branch.hamiltonian, table) for branch in choice]
        conditions = tuple(
            ex.substitute(condition, table) for branch in choice for condition in branch.conditions
        )
        velocities = tuple(rates[name] for name in names)
        yield inverses.InverseBranch(velocities, ex.add(*energies, -parts.free), conditions)


def _up_to_certain(block: inverses.Block, reach: Reach) -> list[inverses.InverseBranch]:
    """The candidates up to the first that claims to hold everywhere."""
    found = []
    for branch in islice(block_branches(block, reach), bounds.CANDIDATES):
        found.append(branch)
        if not branch.conditions:
            break
    return found


def momentum_shifts(
    linear: Mapping[str, ex.Expression], momenta: Mapping[str, ex.Symbol]
) -> dict[ex.Expression, ex.Expression]:
    """p -> p - A for the terms A v of a Lagrangian."""
    return {momenta[name]: momenta[name] - a for name, a in linear.items()}


@dataclass(frozen=True, slots=True)
class _PhaseSpace:
    """Velocities of pivots stay in `first` and are replaced by `last`; `harmless` trees vanish
    nowhere.
    """

    first: Table
    last: Table
    variables: frozenset[ex.Expression]
    harmless: frozenset[ex.Expression]


def constraint_images(
    constraints: Sequence[ex.Expression], transform: LegendreTransform, coordinates: Sequence[str]
) -> tuple[ex.Expression, ...]:
    """The constraints w(t, q, v) = 0 as functions of (t, q, p) that vanish at the same points.

    Denominators are cleared, and factors dropped that vanish nowhere on the domain of L:
    parameters, exponentials, denominators of L and radicands of its roots. Where the transform is
    implicit the constraints stay in the velocities. Values: one tree for each constraint.
    """
    if transform.velocities is None:
        return tuple(map(writing.simplified, constraints))
    place = _phase_space(transform, transform.velocities, coordinates)
    return tuple(_image(constraint, place) for constraint in constraints)


def _phase_space(
    transform: LegendreTransform, velocities: Sequence[ex.Expression], coordinates: Sequence[str]
) -> _PhaseSpace:
    rates = [ex.Velocity(name) for name in coordinates]
    pivots = {
        node
        for rate in transform.chained
        for node in ex.walk(rate)
        if isinstance(node, ex.Velocity)
    }
    chained = zip(rates, transform.chained, strict=True)
    first: Table = {leaf: rate for leaf, rate in chained if leaf not in pivots}
    last: Table = dict(zip(rates, velocities, strict=True))
    variables: frozenset[ex.Expression] = frozenset(
        [*map(ex.Symbol, coordinates), *transform.symbols, *rates, ex.TIME]
    )
    held = [
        rule([transform.lagrangian]) for rule in (real_branch.poles, real_branch.own_requirements)
    ]
    divisors = [ex.substitute(tree, first) for trees in held for tree in trees]
    harmless = frozenset(
        _key(factor)
        for tree in divisors
        for factor, _ in ex.powers_of(writing.opaque_quotient(tree))
    )
    return _PhaseSpace(first, last, variables, harmless)


def _image(constraint: ex.Expression, place: _PhaseSpace) -> ex.Expression:
    """The numerator without its harmless factors; the pivots' velocities are substituted at the
    end.
    """
    kept = []
    for factor, exponent in ex.powers_of(
        writing.opaque_quotient(ex.substitute(constraint, place.first))
    ):
        if factor == ex.ZERO:
            return ex.ZERO
        if exponent > 0 and not _is_harmless(factor, place):
            kept.append(collecting.collect(factor))
    return collecting.merge_powers(ex.substitute(ex.multiply(*kept), place.last))


def _is_harmless(factor: ex.Expression, place: _PhaseSpace) -> bool:
    """Whether a factor is constant, an exponential, or known not to vanish."""
    if ex.is_exponential(factor):
        return True
    nodes = set(ex.walk(factor))
    moves = bool(nodes & place.variables) or any(isinstance(node, ex.Arbitrary) for node in nodes)
    return not moves or _key(factor) in place.harmless


def _key(factor: ex.Expression) -> ex.Expression:
    """The tree in a form that is the same for trees that differ by a number."""
    terms = collecting.expand(factor)
    if not terms:
        return ex.ZERO
    return collecting.terms_tree([(monomial, value / terms[0][1]) for monomial, value in terms])
