"""What certificates prove is compared with a document as given, with stated domains, and with
Hamiltonians.

`check` asks for it, and the solver before a result leaves (`checked`), so that what it found says
the same.

Whether the right sides of a certificate satisfy equations as they were given, unsolved
(`equations_agree`): the given trees are evaluated, with q'' := f as the checker reads f, in the
checker's own rings: what has to vanish is zero by algebra, what has to be regular is so by balls at
the real point (certificate/FORMAT.md). Nothing of the way from the given equations to f is used: no
matrix inverted, no term collected. What the checker's reader understands too is read twice.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, reduce
from itertools import chain, pairwise, product
from typing import TYPE_CHECKING, Any, TypeVar

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.expressions import calculus, functions, printing, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import second_order_system
from inverse_service.reading import declarations, names as nm, reader
from inverse_service.service.documents import accepting, translate
from inverse_service.service.documents.older_keys import Told
from inverse_service.service.documents.stated import Stated
from inverse_service.solving.solving import point_of
from inverse_service.statements import reasons
from inverse_service.statements.questions import About

if TYPE_CHECKING:
    from api_schemas.system import SystemDocument
    from inverse_service.mechanics.constrained_motion import NonholonomicSystem
    from inverse_service.mechanics.second_order_system import ConstrainedMotion
# The same system leaves with each part of a growing result; what was found to agree is not compared
# again.
MOST_KEPT = 16
_COMPARED: dict[str, checker.CheckResult] = {}
# Nor is a document prepared or its motion read again for each of the certificates of an answer.
MOST_DOCUMENTS = 4
_PREPARED: dict[str, Any] = {}
_MOTIONS: dict[str, NonholonomicSystem] = {}
_SEEDS = range(2, 10)  # of points all over, at which an answer has to be found
# The solver stops by itself a little before its process is killed, so that it can say how far it
# came.
SHARE_OF_SOLVER = 0.8
# What an answer has no longer whose equations could not be compared with the document.
_OPENED: dict[str, Any] = {
    **dict.fromkeys(("certificate", "checked", "lagrangian", "hamiltonian", "multiplier")),
    **{key: [] for key in ("other_lagrangians", "exceptions", "explanation", "details")},
    "dissipation": None,
    "integrals": {},
}
OPEN_MOTION = "It is undecided whether any associated system gives this motion a Hamiltonian."
Ring = Any  # one of the checker's, and an element of it
Value = Any
Table = dict[ex.Expression, Value]
Matrix = Sequence[Sequence[ex.Expression]]
T = TypeVar("T")
# Elements of a ring that have to vanish, each with what is wrong otherwise, and the values of all
# leaves there.
_Vanishing = tuple[list[tuple[Value, str]], Table]


def compared_with_document(
    document: Any, canonical: Canonical, time_limit: float = 60.0
) -> checker.CheckResult:
    """The checker's kind of verdict on: these right sides are what the document asks about. Never
    raises.

    Names have to be the same, coordinates in the same order; then `equations_agree` decides. Of a
    Lagrangian with constraints the system may be any associated one: it is compared where the
    constraints hold.
    """
    question = repr((document, canonical))
    if question in _COMPARED:
        return _COMPARED[question]
    found = _compared(document, canonical, now() + time_limit)
    if found.verdict == "valid":
        _COMPARED[question] = found
        if len(_COMPARED) > MOST_KEPT:
            del _COMPARED[next(iter(_COMPARED))]
    return found


def _compared(document: Any, canonical: Canonical, end: float) -> checker.CheckResult:
    try:
        document = _prepared(document)
        if accepting.is_nonholonomic(document):
            motion = _motion_of(document)
            names = nm.Names(motion.coordinates, motion.parameters, dict(motion.functions))
            return _named(names, canonical) or motion_agrees(motion, canonical, end - now())
        schema = accepting.to_schema(document)
        given = accepting.to_given(schema)
    except errors.LimitError as error:
        return checker.CheckResult("incomplete", (f"The document as given is too large: {error}",))
    except errors.InputError as error:
        return checker.CheckResult("invalid", (f"The document as given cannot be read: {error}",))
    names, texts = given.names, _texts(schema, given.names)
    texts = texts if len(texts) == len(given.residuals) else []
    limit = end - now()
    return _named(names, canonical) or equations_agree(
        given.residuals, names.coordinates, canonical, limit, texts
    )


def _prepared(document: Any) -> Any:
    """The document as the schemas want it; raises InputError."""
    return _kept(_PREPARED, document, lambda: accepting.prepared(document).document)


def _motion_of(document: Any) -> NonholonomicSystem:
    """The system of a prepared document; raises InputError."""
    from inverse_service.service.documents import motion_documents

    return _kept(_MOTIONS, document, lambda: motion_documents.nonholonomic_of(document))


def _kept(table: dict[str, T], document: Any, make: Callable[[], T]) -> T:
    key = repr(document)
    found = table.get(key)  # other threads compare, too
    if found is None:
        table[key] = found = make()
        if len(table) > MOST_DOCUMENTS:
            table.pop(next(iter(table)), None)
    return found


def compared_claim(
    document: Any, certificate: Mapping[str, Any], time_limit: float = 60.0
) -> checker.CheckResult:
    """Whether a certificate about a motion on constraints is about that of the document. Never
    raises.

    The constraints hold with its velocities, and its accelerations are the motion, as of an
    associated system.
    """
    from inverse_service.constrained.lagrangian import first_system
    from inverse_service.service.documents import motion_documents

    try:
        document = _prepared(document)
        claimed = _claimed(_with_velocities(certificate["system"], document))
        if accepting.is_motion(document):
            given = motion_documents.motion_of_document(document)
            pairs = zip(given.free_accelerations, claimed.free_accelerations, strict=True)
            trees, differ = [ex.subtract(*pair) for pair in pairs], given.free != claimed.free
            constraints = [v - w for v, w in given.on_constraints.items()]
        else:
            made = _motion_of(document)
            constraints, trees = list(made.constraints), []
            differ = sorted(made.coordinates) != sorted(claimed.coordinates)
            differ = differ or len(constraints) != len(
                claimed.dependent
            )  # a smaller D is another motion
        trees += [ex.substitute(tree, claimed.on_constraints) for tree in constraints]
    except (errors.InputError, KeyError, ValueError):
        sentence = "The motion of a certificate cannot be compared with the document as given."
        return checker.CheckResult("invalid", (sentence,))
    positions = [ex.TIME, *map(ex.Symbol, claimed.coordinates)]
    variables: list[ex.Symbol | ex.Velocity] = [*positions, *map(ex.Velocity, claimed.free)]
    found = (
        None
        if differ
        else real_branch.vanish(trees, [*variables, *map(ex.Symbol, claimed.parameters)])
    )
    if differ or not found:
        sentence = "The motion of a certificate is not that of the document as given."
        return checker.CheckResult(
            "incomplete" if found is None and not differ else "invalid", (sentence,)
        )
    if accepting.is_motion(document):
        return checker.CheckResult("valid", ("The motion is that of the document as given.",))
    whole = first_system(claimed)
    texts = {
        name: printing.to_text(f)
        for name, f in zip(whole.coordinates, whole.accelerations, strict=True)
    }
    system = {key: certificate["system"].get(key) for key in ("parameters", "functions")}
    # A certificate names the free coordinates first.
    system |= {"coordinates": list(made.coordinates), "equations": texts}
    return compared_with_document(document, Canonical(system, dict(certificate)), time_limit)


def _with_velocities(system: Mapping[str, Any], document: Any) -> Mapping[str, Any]:
    """The system of a certificate; one about the free coordinates alone gets the others with their
    velocities.
    """
    if system.get("velocities") is not None:
        return system
    from inverse_service.constrained.nonholonomic_study import motion_report
    from inverse_service.service.documents import motion_documents as read

    given = accepting.is_motion(document)
    motion = (
        read.motion_of_document(document) if given else motion_report(_motion_of(document)).motion
    )
    rates = zip(motion.dependent, motion.dependent_velocities, strict=True)
    velocities = {
        name: printing.to_text(rate) for name, rate in rates if name not in system["coordinates"]
    }
    coordinates = [*system["coordinates"], *velocities]
    return {**system, "coordinates": coordinates, "velocities": velocities}


def _claimed(system: Mapping[str, Any]) -> ConstrainedMotion:
    from inverse_service.mechanics.constrained_motion import MOST_CONSTRAINED, read_motion

    constraints = [f"{name}' = {w}" for name, w in system["velocities"].items()]
    declared = declarations.Declared(
        system["coordinates"] or None,
        system["parameters"],
        system["functions"],
        most=MOST_CONSTRAINED,
    )
    return read_motion(declared, system["equations"], constraints)


def _texts(schema: SystemDocument, names: nm.Names) -> list[GivenText | None]:
    """The equations as texts for a second reader, in the order of their trees; None where that is
    not plain.
    """
    if schema.where:  # the second reader knows no formulas for names
        return []
    valued = schema.parameters.items() if isinstance(schema.parameters, Mapping) else ()
    values = {name: str(value) for name, value in valued if value is not None}
    if isinstance(schema.equations, Mapping):
        found = {
            key: GivenText(f"{key}''", str(text), values) for key, text in schema.equations.items()
        }
        return [found.get(name) for name in names.coordinates]
    texts = schema.equations.split(";") if isinstance(schema.equations, str) else schema.equations
    sides = [str(text).split("=") for text in texts if str(text).strip()]
    return [GivenText(pair[0], pair[1], values) if len(pair) == 2 else None for pair in sides]


def _named(names: nm.Names, canonical: Canonical) -> checker.CheckResult | None:
    """The difference in the declared names, None where there is none."""
    system = canonical.system if isinstance(canonical.system, Mapping) else {}
    pairs = {
        "coordinates": (list(names.coordinates), system.get("coordinates")),
        "parameters": (sorted(names.parameters), _sorted(system.get("parameters") or [])),
        "functions": (
            {key: list(of) for key, of in names.functions.items()},
            system.get("functions") or {},
        ),
    }
    for what, (given, found) in pairs.items():
        if given != found:
            return checker.CheckResult(
                "invalid", (f"The {what} are not those of the document as given.",)
            )
    return None


def _sorted(names: Any) -> Any:
    return (
        sorted(names)
        if isinstance(names, list) and all(isinstance(name, str) for name in names)
        else names
    )


@dataclass(frozen=True, slots=True)
class Canonical:
    """What a certificate says of its system, as plain data, and the set of its claim: near,
    conditions, roots.
    """

    system: Mapping[str, Any]
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
    """Whether E_k(t, q, q', f) = 0 for all k and dE/dq'' is regular there: then f is what E = 0
    determines.

    The `cell` of a valid answer says where it is regular: beyond it E = 0 is another system than
    q'' = f. `texts`, one for each equation or none, are read by the checker's reader as well, where
    it accepts them: the two have to agree about E_k.
    """
    if len(equations) != len(coordinates):
        return checker.CheckResult(
            "invalid", ("The numbers of given equations and of coordinates differ.",)
        )
    slopes = [
        [calculus.differentiate(equation, ex.Acceleration(name)) for name in coordinates]
        for equation in equations
    ]
    candidates: dict[int, list[Sequence[tuple[int, int]]]] = {}

    def vanishing(ring: Ring) -> _Vanishing:
        table, zeros = _table(ring, coordinates, ring.names), list[tuple[Value, str]]()
        for number, equation in enumerate(equations, 1):
            value = _value(equation, ring, table)
            left = checker.against_lines(value, ring, candidates.setdefault(number, []))
            zeros.append((left, f"The accelerations do not satisfy equation {number} as given."))
            second = _second_reading(texts[number - 1], ring, table) if texts else None
            if second is not None:
                difference = ring.add([second, value], [1, -1])
                zeros.append(
                    (difference, f"Two readers understand equation {number} as given differently.")
                )
        return zeros, table

    found = "The accelerations satisfy the equations as given, which determine them."
    wrong = "The equations as given do not determine the accelerations."
    plain = _is_rational(equations) and not any(
        checker.is_irrational((text.left, text.right, *text.values.values()))
        for text in texts
        if text is not None
    )
    return _examined(canonical, coordinates, vanishing, slopes, plain, (found, wrong), time_limit)


def motion_agrees(
    given: NonholonomicSystem, canonical: Canonical, time_limit: float = 60.0
) -> checker.CheckResult:
    """Whether f is the motion of L under the constraints w(t, q, v) = 0, where they hold.

    With v = B u + c by some free velocities u: w = 0 and dw/dv B = 0, so that these are all points
    with w = 0 and B has all directions there; dw/dt = 0, and B^T E = 0 for the Euler-Lagrange
    expressions E of L (d'Alembert). With M = d2L/dv2 the matrix (M, (dw/dv)^T; dw/dv, 0) is
    regular, so there is one such f. B and c are only verified. The `cell` of a valid answer says
    where it is. InputError where L or a constraint is not accepted.
    """
    names, made = given.coordinates, _on_constraints(given)

    def vanishing(ring: Ring) -> _Vanishing:
        leaves = _leaves(names, ring.names)
        moving = {f"{name}'": _value(tree, ring, leaves) for name, tree in made.velocities.items()}
        table = _table(ring, names, {**ring.names, **moving})
        leaving = "The accelerations leave the constraints as given."
        wrong = "On the constraints these are not the accelerations of the Lagrangian as given."
        zeros = [(_value(tree, ring, table), leaving) for tree in made.staying]
        return [*zeros, *((_value(tree, ring, table), wrong) for tree in made.works)], table

    found = "On the constraints the accelerations are the motion of the Lagrangian as given, which determines it."
    wrong = "The Lagrangian and the constraints as given do not determine the motion."
    plain = _is_rational((given.lagrangian, *given.constraints))
    return _examined(canonical, names, vanishing, made.bordered, plain, (found, wrong), time_limit)


@dataclass(frozen=True, slots=True)
class _OnConstraints:
    """What `motion_agrees` asks of a motion: v by the free velocities, what vanishes because the
    constraints last (`staying`) and by d'Alembert's principle (`works`), and the matrix that is
    regular.
    """

    velocities: Mapping[str, ex.Expression]
    staying: Sequence[ex.Expression]
    works: Sequence[ex.Expression]
    bordered: Matrix


@lru_cache(maxsize=4)  # each certificate of an answer is compared with the same motion
def _on_constraints(given: NonholonomicSystem) -> _OnConstraints:
    from inverse_service.mechanics import constrained_motion

    names, parts = given.coordinates, constrained_motion.geometry(given)
    frame = constrained_motion.frames(parts)[0]
    basis, drift = [list(map(parts.tree, row)) for row in frame.basis], map(parts.tree, frame.drift)
    free = [ex.Velocity(names[k]) for k in frame.free]
    slopes = [
        [calculus.differentiate(each, ex.Velocity(name)) for name in names]
        for each in given.constraints
    ]
    momenta = [calculus.differentiate(given.lagrangian, ex.Velocity(name)) for name in names]
    masses = [
        [calculus.differentiate(momentum, ex.Velocity(name)) for name in names]
        for momentum in momenta
    ]
    rates = [calculus.differentiate_in_time(each, names) for each in given.constraints]
    forces = [
        calculus.differentiate_in_time(momentum, names)
        - calculus.differentiate(given.lagrangian, ex.Symbol(name))
        for momentum, name in zip(momenta, names, strict=True)
    ]
    bordered = [[*masses[i], *(row[i] for row in slopes)] for i in range(len(names))]
    bordered += [[*row, *[ex.ZERO] * len(slopes)] for row in slopes]
    velocities = {
        name: _dot(row, free) + rest for name, row, rest in zip(names, basis, drift, strict=True)
    }
    columns = list(zip(*basis, strict=True))
    staying = [
        *given.constraints,
        *rates,
        *(_dot(row, column) for row in slopes for column in columns),
    ]
    works = [_dot(forces, column) for column in columns]
    return _OnConstraints(velocities, staying, works, bordered)


def _dot(row: Sequence[ex.Expression], column: Sequence[ex.Expression]) -> ex.Expression:
    return ex.add(*map(ex.multiply, row, column))


def _examined(
    canonical: Canonical,
    coordinates: Sequence[str],
    vanishing: Callable[[Ring], _Vanishing],
    regular: Matrix,
    rational: bool,
    sentences: tuple[str, str],
    time_limit: float,
) -> checker.CheckResult:
    """`checker.examined` for trees."""
    moving = {ex.TIME, *map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)}
    is_constant = moving.isdisjoint(ex.distinct_nodes(chain(*regular)))

    def matrix(ring: Ring, table: Table) -> list[list[Value]]:
        return [[_value(entry, ring, table) for entry in row] for row in regular]

    def parts(ring: Ring) -> tuple[list[tuple[Value, str]], list[list[Value]]]:
        zeros, table = vanishing(ring)
        return zeros, matrix(ring, table)

    def alone(ring: Ring) -> list[list[Value]]:
        return matrix(ring, _leaves(coordinates, ring.names))

    where = None if is_constant else alone
    return checker.examined(
        canonical.system, canonical.claim, parts, where, rational, sentences, time_limit
    )


def _second_reading(text: GivenText | None, ring: Ring, table: Table) -> Value | None:
    """left - right by the checker's reader; None where one of the texts is not in its grammar."""
    if text is None:
        return None
    known = {
        f"{node.coordinate}''": value
        for node, value in table.items()
        if isinstance(node, ex.Acceleration)
    }
    return checker.second_reading(ring, (text.left, text.right), text.values, known)


def _is_rational(trees: Iterable[ex.Expression]) -> bool:
    """Whether they are rational in everything, with moderate exponents."""
    nodes = [node for tree in trees for node in ex.walk(tree)]
    powers = [node.exponent for node in nodes if isinstance(node, ex.Power)]
    whole = [
        isinstance(each, ex.Number)
        and each.value.denominator == 1
        and abs(each.value) <= checker.MAX_POWER
        for each in powers
    ]
    return all(whole) and not any(isinstance(node, ex.Apply) for node in nodes)


def _leaves(coordinates: Iterable[str], values: dict[str, Value]) -> Table:
    velocities = {f"{name}'": name for name in coordinates}
    return {
        ex.Velocity(velocities[name]) if name in velocities else ex.Symbol(name): value
        for name, value in values.items()
    }


def _table(ring: Ring, coordinates: Sequence[str], values: dict[str, Value]) -> Table:
    """Values of all leaves, q'' := f."""
    pairs = zip(coordinates, checker.forces(ring, values), strict=True)
    return _leaves(coordinates, values) | {ex.Acceleration(name): force for name, force in pairs}


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
            return reduce(
                lambda a, b: ring.multiply(a, b, 0), [table[factor] for factor in factors]
            )
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return ring.power(table[base], value.numerator)
        case ex.Power(base, exponent):
            return checker.real_power(ring, table[base], table[exponent])
        case ex.Ordered(name, argument, order):
            rest, shift = functions.split_order(order)
            whole = table[order], shift, rest == ex.ZERO
            return checker.applied(ring, name, table[argument], whole)
        case ex.Apply(name, argument):
            return checker.applied(ring, name, table[argument])
        case ex.Arbitrary(name, arguments, orders):
            return ring.function(name, orders, [table[argument] for argument in arguments])
    raise checker.Undefined  # a leaf that the system does not know


_INVERSES = frozenset({"asin", "acos", "atan", "acot", "asec", "acsc", "acosh"})


def stays_one_formula(document: Any, branch: Mapping[str, Any]) -> bool:
    """Whether the equations of a branch are analytic on all of its cell: what is under a root, or
    under that of a square, has one sign there, and no function is turned back.
    """
    try:
        given = accepting.to_given(accepting.to_schema(accepting.prepared(document).document))
        known = tuple(trees_of(branch.get("domain") or (), given.names))
    except (errors.InputError, errors.LimitError, TypeError, ValueError):
        return False
    for node in (node for tree in given.residuals for node in ex.walk(tree)):
        if isinstance(node, ex.Apply) and node.function in _INVERSES:
            return False
        exponent = node.exponent if isinstance(node, ex.Power) else ex.ONE
        if not isinstance(node, ex.Power) or (
            isinstance(exponent, ex.Number) and exponent.value.denominator == 1
        ):
            continue
        under = node.base.base if isinstance(node.base, ex.Power) else node.base
        signs = (under, ex.negate(under)) if under is not node.base else (under,)
        if not any(real_branch.is_positive(one, known) for one in signs):
            return False
    return True


def divides_anew(document: Any, own: Any, branch: Mapping[str, Any]) -> bool:
    """Whether the equations of a branch divide, somewhere on its cell, by what may be 0 there and
    those of the own document do not divide by.
    """
    try:
        given, before = (
            accepting.to_given(accepting.to_schema(accepting.prepared(one).document))
            for one in (document, own)
        )
        domain = branch.get("domain") or ()
        known = [(reader.read_condition(one, given.names), "!=" in one) for one in domain]
    except (errors.InputError, errors.LimitError, TypeError, ValueError):
        return False
    nonzero, positive = (
        [one for one, unequal in known if unequal is kind] for kind in (True, False)
    )
    nonzero += [_on_cell(pole, positive) for pole in real_branch.poles(before.residuals)]
    return not all(
        real_branch.is_nonzero(one, nonzero, positive) for one in real_branch.poles(given.residuals)
    )


def _on_cell(tree: ex.Expression, positive: Sequence[ex.Expression]) -> ex.Expression:
    """A tree with u or -u for each |u|, the root of a square, whose sign is known."""
    sizes: dict[ex.Expression, ex.Expression] = {}
    half = ex.power(ex.number(2), ex.number(-1))
    for node in ex.walk(tree):
        if not (isinstance(node, ex.Power) and isinstance(node.base, ex.Power)):
            continue
        if (node.base.exponent, node.exponent) == (ex.number(2), half):
            for one in (node.base.base, ex.negate(node.base.base)):
                if real_branch.is_positive(one, positive):
                    sizes[node] = one
    return ex.substitute(tree, sizes)


def trees_of(domain: Sequence[str], names: nm.Names) -> list[ex.Expression]:
    """The expressions that a domain makes positive, as trees."""
    found = []
    for text in domain:
        for sign in "<>":
            sides = (
                [reader.read_formula(side, names) for side in text.split(sign)]
                if sign in text
                else []
            )
            pairs = pairwise(sides)
            found += [left - right if sign == ">" else right - left for left, right in pairs]
    return found


def gaps(
    system: second_order_system.SecondOrderSystem,
    result: Mapping[str, Any],
    sides: Sequence[Sequence[str]],
) -> str:
    """What is wrong where a point of the document lies in no cell: `sides` are those of the answers
    that are proven.
    """
    listed = [*sides, *(one.get("domain") or [] for one in result.get("not_answered") or [])]
    try:
        cells = [trees_of(domain, system.names) for domain in listed]
    except errors.InputError:
        return "A domain cannot be read."
    if any(
        isinstance(node, ex.Arbitrary) for cell in cells for tree in cell for node in ex.walk(tree)
    ):
        return ""
    branches = second_order_system.branches_of(system)
    points = [*map(point_of, branches), *(point_of(system, seed) for seed in _SEEDS)]
    for point in filter(None, points):
        if not any(real_branch.are_positive(cell, point) for cell in cells):
            place = ", ".join(
                f"{key} = {float(value):.4g}" for key, value in list(point.items())[:6]
            )
            return f"No cell contains the point {place}."
    return ""


def same_formulas(one: Mapping[str, str], other: Mapping[str, str], names: nm.Names) -> bool | None:
    """Whether formulas by name are equal as functions; None where that is undecided."""
    if one == other:
        return True
    if one.keys() != other.keys():
        return False
    trees = [
        reader.read_formula(one[key], names) - reader.read_formula(other[key], names) for key in one
    ]
    return _vanish(trees, names, names.coordinates)


def image_agrees(document: Any, shown: Mapping[str, Any], names: nm.Names) -> bool | None:
    """Whether the `constraints` of H vanish where the constraints of the document hold and p are
    its momenta.

    As many as those, and independent; None where the document has none or it is undecided.
    """
    from inverse_service.mechanics.constrained_motion import equations_of_motion
    from inverse_service.service.documents import motion_documents

    if not isinstance(document, dict) or "lagrangian" not in document:
        return None
    motion = equations_of_motion(motion_documents.nonholonomic_of(document))
    listed = [reader.read_formula(text, names) for text in shown["constraints"]]
    if len(listed) != len(motion.dependent):
        return False
    momenta = {
        ex.Symbol(name): reader.read_formula(text, names) for name, text in shown["momenta"].items()
    }
    held = [ex.substitute(ex.substitute(tree, momenta), motion.on_constraints) for tree in listed]
    good = _vanish(held, names, motion.free)
    slopes = [
        [calculus.differentiate(tree, ex.Symbol(p)) for p in shown["momenta"]] for tree in listed
    ]
    variables = [ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Symbol, names.parameters)]
    return good if not good else real_branch.rank_at_point(slopes, variables) == len(listed) or None


def _vanish(trees: Sequence[ex.Expression], names: nm.Names, moving: Sequence[str]) -> bool | None:
    constants = [ex.Symbol(name) for name in names.parameters]
    return real_branch.vanish(
        trees, [ex.TIME, *map(ex.Symbol, names.coordinates), *map(ex.Velocity, moving), *constants]
    )


# What a result goes through before it leaves.


def checked(told: Told, time_limit: float) -> Told:
    """What a result says, its system compared with the document as given; CertificateRefused where
    an answer is unchecked.

    The solver has its certificates checked itself: no definite verdict leaves that the checker did
    not call valid. A statement whose system could not be compared is left open. CertificateRefused
    where the system is found to be another one: that is a fault of ours.
    """
    if any(one.verdict != "undetermined" and not _is_proven(one) for one in told.statements):
        raise errors.CertificateRefused("an answer was left unchecked")
    end = now() + max(1.0, time_limit)
    told, given = _with_compared_motion(told, end), told.beside["system"]["given"]
    for each in _systems(told):
        found = compared_with_document(given, each, max(1.0, end - now()))
        if found.verdict == "invalid":
            why = "; ".join(found.reasons)
            raise errors.CertificateRefused(
                f"the solved system differs from the given one: {why}"[:500]
            )
        if found.verdict != "valid":
            return _left_open(told, reasons.other_system("system", "; ".join(found.reasons)))
    return told


def checked_so_far(told: Told, time_limit: float) -> Told | None:
    """The same of a result that still grows; None where a comparison did not end, since an answer
    that was told is never taken back.
    """
    found = checked(told, time_limit)
    return found if found.statements == told.statements else None


def _is_proven(one: Stated) -> bool:
    return one.part.get("checked") == "valid"


def _is_of_document(one: Stated) -> bool:
    """Whether the document has the equations that a statement is about, or is about its associated
    systems.
    """
    question = one.question
    return question.about not in (About.ANY, About.REDUCED) and not (
        question.clock or question.case
    )


def _left_open(told: Told, why: reasons.Open) -> Told:
    """What is left where the equations of the answers could not be compared with the document."""
    fields = {**_OPENED, "verdict": "undetermined", **translate.reason_fields(why)}

    def opened(one: Stated) -> Stated:
        if one.question.about is not told.main or not _is_of_document(one):
            return one
        known = {key: value for key, value in fields.items() if key in one.part}
        return replace(one, part={**one.part, **known})

    kept = tuple(opened(one) for one in told.statements if one.at != "/instead")
    return replace(told, statements=kept, instead="")


def _with_compared_motion(told: Told, end: float) -> Told:
    """The same for the answer about a motion on constraints, which takes no other answer with
    it.
    """
    problems = dict[str, str]()  # by place: the statements there have the same proofs
    given, seen = told.beside["system"]["given"], set[tuple[str, str]]()
    about = [one for one in told.statements if one.question.about is About.ANY]
    for one, key in product(about, ("certificate", "certificate_with_time")):
        if one.at in problems or (one.at, key) in seen or not one.part.get(key):
            continue
        seen.add((one.at, key))
        found = compared_claim(given, one.part[key], end - now())
        if found.verdict != "valid":
            problems[one.at] = found.reasons[0]
    opened = (
        _open_motion(one, problems[one.at]) if one.at in problems else one
        for one in told.statements
    )
    return replace(told, statements=tuple(opened))


def _open_motion(one: Stated, problem: str) -> Stated:
    """The statement about a motion that could not be compared."""
    lists = {key: list[Any]() for key in ("parts", "image", "explanation", "exceptions")}
    kept = {"statement": OPEN_MOTION, "freedom": "", "verdict": "undetermined", **lists}
    fields = kept | translate.reason_fields(reasons.other_system("motion", problem))
    return replace(one, part=dict.fromkeys(one.part, None) | fields)


def _systems(told: Told) -> Iterator[Canonical]:
    """The system that a result shows and those that its certificates are about, each once; none
    without one.
    """
    certificates = [
        one.part["certificate"]
        for one in told.statements
        if one.part.get("certificate") and _is_of_document(one)
    ]
    shown = [Canonical(system_fields(told.beside), each) for each in certificates[:1]]
    seen: list[str] = []
    for each in (*shown, *(Canonical(system_fields(found), found) for found in certificates)):
        key = json.dumps([each.system, each.claim.get("conditions"), each.claim.get("roots")])
        if key not in seen:
            seen.append(key)
            yield each


def system_fields(holder: Mapping[str, Any]) -> dict[str, Any]:
    """What says the same in a result and in a certificate."""
    system = as_object(holder.get("system"))
    empty: dict[str, Any] = {"coordinates": [], "equations": {}, "parameters": [], "functions": {}}
    return {key: system.get(key) or other for key, other in empty.items()}


def as_object(value: Any) -> dict[str, Any]:
    """The value where it is an object, else an empty one."""
    return value if isinstance(value, dict) else {}
