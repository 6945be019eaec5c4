"""Reductions: a system as blocks that share no coordinates, with a coordinate as time, and in other coordinates.

A regular Lagrangian stays one under a change of coordinates new = W(old), old = psi(new), one or two at a time:
shear        X = x + g(y, …) where x + g, or its rate x' + g_y y' + …, occurs in f as a sum
rotation     X = a x + b y, Y = a y - b x where a x + b y occurs in f
polar        X = r cos u, Y = r sin u where u occurs in f only under sine and cosine
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial

from inverse_service import bounds, deadline
from inverse_service.decision import certify
from inverse_service.expressions import collecting, derivative, tree as ex
from inverse_service.field import exact_field, tower
from inverse_service.mechanics import writing
from inverse_service.mechanics.second_order_system import SecondOrderSystem, connected
from inverse_service.search import quadratures, tidy
from inverse_service.search.material import Material
from inverse_service.search.protocol import Smaller
from inverse_service.search.terms import Monomial, Terms, TooManyTerms, collected, terms_of, tree_of


def decoupled_blocks(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The system as blocks: within one, coordinates occur in each other's equations, directly or by others."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    links = ({name} | _coordinates_in(f, system.coordinates) for name, f in pairs)
    return [_block(system, group) for group in connected(system.coordinates, links)]


def _coordinates_in(tree: ex.Expression, names: Sequence[str]) -> set[str]:
    found = set()
    for node in ex.walk(tree):
        if isinstance(node, ex.Velocity):
            found.add(node.coordinate)
        elif isinstance(node, ex.Symbol) and node.name in names:
            found.add(node.name)
    return found


def _block(system: SecondOrderSystem, group: Collection[str]) -> SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept))


def _cancelled(material: Material) -> SecondOrderSystem:
    """The system, with f_i as it was factored where fewer coordinates occur in it: (u x - v x)/(u - v) is x."""
    system = material.analysis.system
    pairs = zip(system.accelerations, map(tree_of, material.motion.forces), strict=True)
    forces = tuple(min(pair, key=lambda tree: len(_coordinates_in(tree, system.coordinates))) for pair in pairs)
    return replace(system, accelerations=forces)


def is_decoupled(material: Material) -> bool:
    return len(decoupled_blocks(_cancelled(material))) > 1


def into_blocks(material: Material, seed: int) -> Iterator[Smaller]:
    """The blocks; the sum of their Lagrangians is one of the whole system."""
    blocks = tuple(decoupled_blocks(_cancelled(material)))
    system = material.analysis.system
    timed = (material.motion.with_time,) * len(blocks)
    yield Smaller(blocks, timed, lambda found: [_sum_of(system, [trees[0] for trees in found])])


def _sum_of(system: SecondOrderSystem, trees: Sequence[ex.Expression]) -> ex.Expression:
    """The sum of Lagrangians of blocks, each of which may have named its own integral F."""
    fresh, used, found = quadratures.fresh_names(system, *trees), set[str](), []
    for tree in trees:
        own = {node.name for node in certify.walk_integrals(tree)}
        names = {name: next(fresh) for name in sorted(own & used)}
        used |= own
        found.append(_renamed(tree, names) if names else tree)
    return ex.add(*found)


def _renamed(tree: ex.Expression, names: Mapping[str, str]) -> ex.Expression:
    named = replace(tree, name=names.get(tree.name, tree.name)) if isinstance(tree, ex.Integral) else tree
    return ex.rebuild(named, lambda part: _renamed(part, names))


def has_own_time(material: Material) -> bool:
    """Whether the paths of the motion are solutions of a system with one of the coordinates as time."""
    return any(True for _ in _along(material))


def along_a_coordinate(material: Material, seed: int) -> Iterator[Smaller]:
    """With u as time, x'' = F(u, x, dx/du): L = u' M(u, x, x'/u') + S(u, u').

    M, homogeneous of degree 1, has the equations of the paths alone (Noether's second theorem: that of u follows from
    those of x), and S is a Lagrangian of u, whose equation no other coordinate enters. L is regular if M and S are.
    """
    for u, paths, own in sorted(_along(material), key=lambda found: size(found[1].accelerations)):
        yield Smaller((paths, own), (True, material.motion.with_time), partial(_homogeneous, u))


def _along(material: Material) -> Iterator[tuple[str, SecondOrderSystem, SecondOrderSystem]]:
    """(u, the system of dx/du, that of u) for each coordinate u with u'' = f_u(u, u') such that paths have no u'."""
    system = material.analysis.system
    names = system.coordinates
    if len(names) == 1 or system.depends_on_time or is_decoupled(material):
        return
    for u, f in zip(names, system.accelerations, strict=True):
        rate, others = ex.Velocity(u), tuple(name for name in names if name != u)
        if not _coordinates_in(f, names) <= {u}:
            continue
        table: dict[ex.Expression, ex.Expression] = {ex.Velocity(x): ex.Velocity(x) * rate for x in others}
        forces = []
        for x, force in zip(names, system.accelerations, strict=True):
            if x != u:
                along = collecting.collect((ex.substitute(force, table) - ex.Velocity(x) * f) / rate**2)
                is_free = not ex.holds(along, rate)
                forces.append(along if is_free else writing.quotient(along, exact_field.Budget.short()))
        if not any(ex.holds(force, rate) for force in forces):
            timed = tuple(ex.substitute(force, {ex.Symbol(u): ex.TIME}) for force in forces)
            functions = tuple((name, tuple("t" if x == u else x for x in held)) for name, held in system.functions)
            plain = replace(system, branch=None, nonzero=(), functions=functions)
            paths = replace(plain, coordinates=others, accelerations=timed)
            yield u, paths, replace(plain, coordinates=(u,), accelerations=(f,))


def _homogeneous(u: str, found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
    """u' M(u, x, x'/u') + S for each M."""
    rate, lagrangians = ex.Velocity(u), []
    for tree in found[0]:
        velocities = [node for node in ex.walk(tree) if isinstance(node, ex.Velocity)]
        table: dict[ex.Expression, ex.Expression] = {v: v / rate for v in velocities}
        lagrangians.append(collected(rate * ex.substitute(tree, {**table, ex.TIME: ex.Symbol(u)})))
    return [one + found[1][0] for one in lagrangians]


# The terms of a function of position, a set so that equal ones can be counted.
Form = frozenset[tuple[Monomial, Fraction]]


@dataclass(frozen=True, slots=True)
class Change:
    """New coordinates named as the old ones: `new` is W, `old` is psi, for those that change.

    `functions` gives functions of the old coordinates in the new ones, where putting psi into them
    would leave them nested.
    """

    name: str
    new: Mapping[str, ex.Expression]
    old: Mapping[str, ex.Expression]
    functions: Mapping[ex.Expression, ex.Expression] = field(default_factory=dict)


def suggested(material: Material) -> list[Change]:
    """Changes worth a try, the most conspicuous first."""
    names = material.analysis.system.coordinates
    forms = [form for form, _ in _forms(material).most_common()]
    shears = list(dict.fromkeys(shear for form in forms for shear in _shears(form, names)))[: bounds.FEW]
    rotations = dict.fromkeys(pair for form in forms for pair in _directions(form, names))
    return [
        *(_rotation(*pair) for pair in rotations),
        *(_shear(x, rest) for x, rest in shears if not _is_multiple(rest)),
        *_polar_changes(material),
        *(_shear(x, rest) for x, rest in shears if _is_multiple(rest)),
    ]


def _forms(material: Material) -> Counter[Form]:
    """Functions of position w with w or w' a sum in f, each as a set of terms, with its number of occurrences."""
    names = material.analysis.system.coordinates
    found: Counter[Form] = Counter()
    trees = [*material.analysis.system.accelerations, *material.position_letters]
    for tree in trees:
        for node in ex.walk(tree):
            if isinstance(node, ex.Sum):
                found.update(_primitives(node, names))
    return found


def _primitives(node: ex.Sum, names: Iterable[str]) -> Iterator[Form]:
    """The sum itself without its constant, or the function of which it is the rate."""
    try:
        terms = terms_of(node)
    except TooManyTerms:
        return
    if all(
        isinstance(p, ex.Symbol) and p.name in names for key in terms for p, _ in key if not isinstance(p, ex.Number)
    ):
        yield frozenset((key, value) for key, value in terms.items() if key)
    elif all(sum(isinstance(p, ex.Velocity) for p, _ in key) == 1 for key in terms):
        whole = _integrated(terms)
        if whole is not None:
            yield frozenset(whole.items())


def _integrated(terms: Terms) -> Terms | None:
    """w with w' = sum c y^k y', or None where a term is of another kind."""
    found: Terms = {}
    for key, value in terms.items():
        ((velocity, degree),) = [(p, e) for p, e in key if isinstance(p, ex.Velocity)]
        assert isinstance(velocity, ex.Velocity)
        rest = dict(item for item in key if item[0] != velocity)
        y = ex.Symbol(velocity.coordinate)
        exponent = rest.pop(y, Fraction(0))
        if rest or degree != 1 or exponent == -1:
            return None
        found[frozenset([(y, exponent + 1)])] = value / (exponent + 1)
    return found


def _shears(form: Form, names: Iterable[str]) -> Iterator[tuple[str, ex.Expression]]:
    """(x, g) with the form a multiple of x + g, g without x."""
    table = dict(form)
    for name in names:
        single = frozenset([(ex.Symbol(name), Fraction(1))])
        if single in table and len(table) > 1:
            rest = {key: value / table[single] for key, value in table.items() if key != single}
            if not ex.holds(tree_of(rest), ex.Symbol(name)):
                yield name, tree_of(rest)


def _is_multiple(rest: ex.Expression) -> bool:
    """Whether g is c y: such forms are taken as directions of a rotation first."""
    terms = terms_of(rest)
    return len(terms) == 1 and all(e == 1 for key in terms for _, e in key) and len(next(iter(terms))) == 1


def _shear(x: str, rest: ex.Expression) -> Change:
    return Change("shear", {x: ex.Symbol(x) + rest}, {x: ex.Symbol(x) - rest})


def _directions(form: Form, names: tuple[str, ...]) -> Iterator[tuple[str, str, Fraction]]:
    """(x, y, c) for the part x + c y of a linear form, 0 < c up to a turn by a right angle."""
    single = {ex.Symbol(name): name for name in names}
    linear = {single[p]: value for key, value in form for p, e in key if len(key) == 1 and e == 1 and p in single}
    chosen = sorted(linear, key=names.index)
    for k, x in enumerate(chosen):
        for y in chosen[k + 1 :]:
            c = linear[y] / linear[x]
            yield x, y, c if c > 0 else -1 / c


def _rotation(x: str, y: str, c: Fraction) -> Change:
    """X = a x + b y, Y = a y - b x with b/a = c, a and b whole."""
    a, b = ex.number(c.denominator), ex.number(c.numerator)
    length = ex.number(c.denominator**2 + c.numerator**2)
    first, second = ex.Symbol(x), ex.Symbol(y)
    new = {x: a * first + b * second, y: a * second - b * first}
    old = {
        x: (a * first - b * second) / length,
        y: (b * first + a * second) / length,
    }
    return Change("rotation", new, old)


def _polar_changes(material: Material) -> Iterator[Change]:
    """For each angle all other coordinates as radius, those first that its acceleration is divided by."""
    names = material.analysis.system.coordinates
    trees = [tower.to_kernels(f) for f in material.analysis.system.accelerations]
    for angle in names:
        circular: dict[ex.Expression, ex.Expression] = {
            ex.Apply("sin", ex.Symbol(angle)): ex.Number(Fraction(3, 5)),
            ex.Apply("cos", ex.Symbol(angle)): ex.Number(Fraction(4, 5)),
        }
        occurs = {node for tree in trees for node in ex.walk(tree)} & set(circular)
        bare = any(ex.holds(ex.substitute(tree, circular), ex.Symbol(angle)) for tree in trees)
        divisors = {node.base for node in ex.walk(trees[names.index(angle)]) if isinstance(node, ex.Power)}
        for radius in sorted(names, key=lambda name: ex.Symbol(name) not in divisors) if occurs and not bare else ():
            if radius != angle:
                yield _polar(radius, angle)


def _polar(radius: str, angle: str) -> Change:
    x, y = ex.Symbol(radius), ex.Symbol(angle)
    sine, cosine = ex.Apply("sin", y), ex.Apply("cos", y)
    length = ex.square_root(x**2 + y**2)
    return Change(
        "polar",
        {radius: x * cosine, angle: x * sine},
        {radius: length, angle: ex.Apply("atan", y / x)},
        {sine: y / length, cosine: x / length},
    )


def applies(material: Material) -> bool:
    """Whether f suggests other coordinates."""
    return bool(suggested(material))


def in_shorter_coordinates(material: Material, seed: int) -> Iterator[Smaller]:
    """The system in the shortest of the suggested coordinates; its Lagrangians in the given ones again."""
    for change, system in shorter(material)[: bounds.FEW]:
        lift = partial(_carried_back, _table(change.new, system.coordinates))
        yield Smaller((system,), (material.motion.with_time,), lift)


def _carried_back(
    table: dict[ex.Expression, ex.Expression], found: Sequence[Sequence[ex.Expression]]
) -> list[ex.Expression]:
    return [collecting.merge_powers(_plain_arguments(ex.substitute(tree, table))) for tree in found[0]]


def _plain_arguments(tree: ex.Expression) -> ex.Expression:
    """log(w' - v' + v') as log(w')."""
    tree = ex.rebuild(tree, _plain_arguments)
    return ex.rebuild(tree, tidy.collected_inside) if isinstance(tree, ex.Apply) else tree


def shorter(material: Material) -> list[tuple[Change, SecondOrderSystem]]:
    """The changes that make f shorter, the best first, with the system in the new coordinates."""
    system = material.analysis.system
    own = size(system.accelerations)
    found: list[tuple[Change, SecondOrderSystem]] = []
    known: dict[ex.Expression, ex.Expression] = {}
    with suppress(deadline.OutOfTime), deadline.within(bounds.WORK):
        own = min(own, size([_settled(f, system.coordinates, known) for f in system.accelerations]))
        for pair in _transformed(material, own, known):
            found.append(pair)
            if 2 * size(pair[1].accelerations) < own:
                break
    return sorted(found, key=lambda pair: size(pair[1].accelerations))


def size(trees: Sequence[ex.Expression]) -> int:
    return sum(map(ex.node_count, trees))


def _transformed(
    material: Material, most: int, known: dict[ex.Expression, ex.Expression]
) -> Iterator[tuple[Change, SecondOrderSystem]]:
    """The changes that make f smaller than that."""
    for change in suggested(material):
        deadline.check()
        try:
            other = transformed(material.analysis.system, change, most, known)
        except (ArithmeticError, ValueError):
            continue
        if other is not None:
            yield change, other


def transformed(
    system: SecondOrderSystem,
    change: Change,
    most: float = math.inf,
    known: dict[ex.Expression, ex.Expression] | None = None,
) -> SecondOrderSystem | None:
    """The system in the new coordinates: Q'' = W_q f + (W_qq v) v with q = psi(Q); None where f gets that large.

    `known` keeps the short forms of parts, which changes have in common.
    """
    known = {} if known is None else known
    names = system.coordinates
    forces = dict(zip(names, system.accelerations, strict=True))
    table: dict[ex.Expression, ex.Expression] = {**_table(change.old, names), **change.functions}
    accelerations = []
    for name in names:
        rate = _rate(change.new[name], names) if name in change.new else ex.Velocity(name)
        along = [derivative.differentiate(rate, ex.Velocity(other)) * forces[other] for other in names]
        whole = ex.add(_rate(rate, names), *along)
        placed = ex.substitute(tower.to_kernels(whole) if change.functions else whole, table)
        accelerations.append(_settled(placed, names, known))
        if size(accelerations) >= most:
            return None
    return replace(system, accelerations=tuple(accelerations))


def _rate(tree: ex.Expression, names: Sequence[str]) -> ex.Expression:
    """sum v dF/dq."""
    return ex.add(ex.ZERO, *(derivative.differentiate(tree, ex.Symbol(name)) * ex.Velocity(name) for name in names))


def _table(functions: Mapping[str, ex.Expression], names: Sequence[str]) -> dict[ex.Expression, ex.Expression]:
    """Each coordinate that changes, and its velocity, as functions of the others."""
    table: dict[ex.Expression, ex.Expression] = {}
    for name, tree in functions.items():
        table[ex.Symbol(name)] = tree
        table[ex.Velocity(name)] = _rate(tree, names)
    return table


def _settled(tree: ex.Expression, names: Sequence[str], known: dict[ex.Expression, ex.Expression]) -> ex.Expression:
    """Each sum and product, the innermost first, as it is, multiplied out or as a factored quotient: the shortest."""
    if tree not in known:
        whole = ex.rebuild(tree, lambda part: _settled(part, names, known))
        known[tree] = _shortest(whole, names) if isinstance(whole, ex.Sum | ex.Product) else whole
    return known[tree]


def _shortest(tree: ex.Expression, names: Sequence[str]) -> ex.Expression:
    deadline.check(size([tree]))  # about what it costs to multiply out
    if isinstance(tree, ex.Number | ex.Symbol | ex.Velocity):
        return tree
    symbols: list[ex.Symbol | ex.Velocity] = [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, names)]
    budget = exact_field.Budget.short()
    try:
        return writing.shorten(tree, budget, symbols)
    finally:
        deadline.check(1 + budget.done)
