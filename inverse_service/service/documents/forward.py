"""Use cases for a Lagrangian alone: its Euler-Lagrange equations, momenta, Hamiltonian and conserved quantities."""

from typing import Any

from api_schemas.base import MAX_FORWARD
from api_schemas.result import ConservedQuantity, ForwardParseAnswer, ForwardResult, LagrangianDocument
from inverse_service.decision.solutions import Hamiltonian, SolveOptions
from inverse_service.expressions import collecting, tree as trees
from inverse_service.mechanics import constrained_motion, euler_lagrange, implicit_equations
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.document_names import Declared, known_names
from inverse_service.service.documents import accepting, translate
from inverse_service.service.documents.growing import Growing


def look_forward(document: Any) -> LagrangianDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return accepting.validated(document, LagrangianDocument)


def solve_forward(document: Any, options: SolveOptions, grow: Growing) -> dict[str, Any]:
    """The forward result; raises InputError, also where the Hessian of L is singular."""
    schema = look_forward(document)
    lagrangian, system = _motion(schema)
    names = system.coordinates
    functions = dict(zip(names, euler_lagrange.momenta(lagrangian, names), strict=True))
    result = ForwardResult(
        system=translate.to_understood(system, schema),
        lagrangian=translate.formula(lagrangian),
        equations=translate.formulas(names, system.accelerations),
        momenta=translate.formulas(names, functions.values()),
        hamiltonian=translate.hamiltonian_part(Hamiltonian.of(legendre(lagrangian, names, options.time_limit / 2))),
        conserved=_conserved(lagrangian, functions),
        guessed=translate.guessed_names(schema, system),
    )
    return result.model_dump(mode="json")


def parse(schema: LagrangianDocument) -> ForwardParseAnswer:
    """The interpretation of the document; raises InputError."""
    lagrangian, system = _motion(schema)
    answer = translate.to_parse_answer(system, schema)
    return ForwardParseAnswer(**dict(answer), lagrangian=translate.parsed(lagrangian))


def system_of(schema: LagrangianDocument) -> SecondOrderSystem:
    """q'' = f of the Euler-Lagrange equations; raises InputError."""
    return _motion(schema)[1]


def _motion(schema: LagrangianDocument) -> tuple[trees.Expression, SecondOrderSystem]:
    """L with the system q'' = f of its Euler-Lagrange equations."""
    declared = Declared(schema.coordinates, schema.parameters, schema.functions, schema.where, most=MAX_FORWARD)
    known = known_names(declared, {"/lagrangian": schema.lagrangian}, order=1)
    lagrangian, names = (
        known.put_in(constrained_motion.read_lagrangian(schema.lagrangian, known.names)),
        known.remaining(),
    )
    sums = euler_lagrange.euler_lagrange_sums(
        lagrangian, names.coordinates, [trees.Acceleration(name) for name in names.coordinates]
    )
    equations = [implicit_equations.linear_equation(tree, "/lagrangian") for tree in sums]
    accelerations = tuple(map(collecting.collect, implicit_equations.solve_accelerations(equations, names.coordinates)))
    functions = tuple(names.functions.items())
    return lagrangian, SecondOrderSystem(names.coordinates, accelerations, names.parameters, functions, schema.name)


def _conserved(lagrangian: trees.Expression, functions: dict[str, trees.Expression]) -> list[ConservedQuantity]:
    """The momenta of the coordinates that are not in L, and the energy where t is not (Noether)."""
    letters = {node for node in trees.walk(lagrangian) if isinstance(node, trees.Symbol)}
    found = {f"momentum of {name}": tree for name, tree in functions.items() if trees.Symbol(name) not in letters}
    if trees.TIME not in letters:
        terms = [trees.multiply(trees.Velocity(name), tree) for name, tree in functions.items()]
        found["energy"] = collecting.collect(trees.add(*terms, trees.negate(lagrangian)))
    return [ConservedQuantity(name=name, **translate.formula_fields(tree)) for name, tree in found.items()]
