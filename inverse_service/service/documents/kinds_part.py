"""The key `kinds` of a System document: which kinds of Lagrangians are asked about, and what is answered."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

from api_schemas.result import KindPart, ResultDocument
from api_schemas.system import InvariantKind, SystemDocument
from inverse_service.deadline import left, now
from inverse_service.decision.deciding import analyze
from inverse_service.decision.kinds.helmholtz import LagrangianKind, invariant, kind_named
from inverse_service.decision.solutions import Solution, SolveOptions
from inverse_service.errors import InputError, IrreducibleAtoms
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Number, Power, Product, Sum, Symbol, Velocity, walk
from inverse_service.mechanics.second_order_system import SecondOrderSystem, on_branch
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting, translate
from inverse_service.solving import definite, solving
from inverse_service.solving.kind_answers import KindAnswer, answer_kind, answer_rayleigh

# Of the time for a Lagrangian with friction, what the search for one without may take.
_SHARE_OF_SEARCH = 0.7
_RATIONAL = (Number, Power, Product, Sum, Symbol)


def to_kinds(schema: SystemDocument, system: SecondOrderSystem) -> tuple[LagrangianKind, ...]:
    """The kinds of a document; raises InputError with the place of what cannot be read."""
    found = []
    if to_near(schema, system) and "positive_definite" not in schema.kinds:
        raise InputError("'near' is the point of the kind positive_definite, which is not asked about.", "/near")
    for place, kind in enumerate(schema.kinds):
        pointer = f"/kinds/{place}"
        if isinstance(kind, InvariantKind):
            fields = [
                _field(field, schema, system, f"{pointer}/invariant/{k}") for k, field in enumerate(kind.invariant)
            ]
            found.append(invariant(fields, system.coordinates))
        else:
            found.append(kind_named(kind, system.coordinates))
    if len({kind.name for kind in found}) < len(found):
        raise InputError("a kind is named twice: name each once, all vector fields in one 'invariant'.", "/kinds")
    return tuple(found)


def _field(
    field: str | Mapping[str, str], schema: SystemDocument, system: SecondOrderSystem, pointer: str
) -> dict[str, tuple[str, Expression]]:
    """{coordinate: (text, tree)}; a name is the translation along this coordinate."""
    texts = {field: "1"} if isinstance(field, str) else field
    names, found = Names(system.coordinates, system.parameters), {}
    for name, text in texts.items():
        if name not in system.coordinates:
            raise InputError(f"a vector field has components along {', '.join(system.coordinates)}.", pointer)
        place = f"{pointer}/{name}"
        tree = accepting.formula_about(text, names, schema, place)
        if not all(_is_rational(node) for node in walk(tree)):
            raise InputError("a component is a rational formula in coordinates and parameters.", place)
        found[name] = (to_text(tree), tree)
    return found


def _is_rational(node: Expression) -> bool:
    known = isinstance(node, _RATIONAL) and node != Symbol("t")
    power = not isinstance(node, Power) or (isinstance(node.exponent, Number) and node.exponent.value.denominator == 1)
    return known and power


def with_kinds(
    result: ResultDocument,
    solution: Solution,
    schema: SystemDocument,
    kinds: Sequence[LagrangianKind],
    asked: SolveOptions,
    end: float,
) -> ResultDocument:
    """The result with an answer for each kind, which share the time that is left."""
    parts = {}
    for place, kind in enumerate(kinds):
        share = (end - now()) / (len(kinds) - place)
        deadline = now() + share
        if kind.name == "positive_definite":
            found = definite.answer_definite(solution, kind, to_near(schema, solution.system), asked.seed, deadline)
        else:
            answer = _rayleigh if kind.name == "rayleigh" else answer_kind
            found = answer(solution, kind, asked, deadline)
        parts[kind.name] = kind_part(found)
    return result.model_copy(update={"kinds": parts})


def to_near(schema: SystemDocument, system: SecondOrderSystem) -> dict[Symbol | Velocity, Fraction]:
    """The point that a document names; InputError for a name that has no value there, or no number."""
    names: dict[str, Symbol | Velocity] = {
        name: Symbol(name) for name in (*system.coordinates, *system.parameters, "t")
    }
    names |= {f"{name}'": Velocity(name) for name in system.coordinates}
    if not {*schema.near} <= {*names}:
        raise InputError(f"a point has values of {', '.join(names)}.", "/near")
    try:
        return {names[name]: Fraction(text) for name, text in schema.near.items()}
    except (ValueError, ZeroDivisionError):
        raise InputError('the values at a point must be rational numbers such as "1/2" or 0.3.', "/near") from None


def _rayleigh(solution: Solution, _: LagrangianKind, asked: SolveOptions, deadline: float) -> KindAnswer:
    def natural(system: SecondOrderSystem) -> list[Expression]:
        limit = _SHARE_OF_SEARCH * left(deadline)
        options = SolveOptions(time_dependent=False, seed=asked.seed, time_limit=limit, conditions=False)
        found = solving.solve(system, options).autonomous
        known = None if found is None else found.lagrangian
        return [] if found is None or known is None else [one.expression for one in (known, *found.other_lagrangians)]

    try:
        analysis = analyze(solution.system)
        given = tuple(on_branch(equation, solution.system) for equation in asked.given)
        return answer_rayleigh(analysis, given, natural, asked.seed, deadline)
    except IrreducibleAtoms as problem:
        return KindAnswer("undetermined", problem.detail)


def kind_part(found: KindAnswer) -> KindPart:
    return translate.part_of(
        KindPart,
        found,
        checked=None if found.certificate is None else "valid",
        lagrangian=None if found.lagrangian is None else translate.lagrangian_part(found.lagrangian),
        near=(found.certificate or {}).get("near") or {},
        exceptions=list(found.exceptions),
    )
