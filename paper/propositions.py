"""Section 2 of the paper: the motion of the class, its associated systems, Propositions 1 and 2."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from inverse_service.certificate.checker import check_certificate
from inverse_service.decision import certify
from inverse_service.decision.deciding import analyze
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    substitute,
    subtract,
)
from inverse_service.mechanics.euler_lagrange import momenta
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.statements.questions import PLAIN
from paper.paper_systems import (
    CLASSICAL,
    Member,
    constants,
    hamiltonian,
    images,
    lagrangian,
    member,
    motion,
    second_order,
)
from paper.statement import Progress, Section, Statement, Table, finding

GENERIC = ("generic-class-one", "generic-class-two", "generic-class-three")
CODE = "paper/propositions.py"
# The checker is given this long for each Lagrangian.
CHECK_SECONDS = 60.0


def section_two(progress: Progress) -> Section:
    """All statements of section 2 for the five classical systems and the generic class."""
    systems = []
    for name in (*CLASSICAL, *GENERIC):
        progress(f"solving {name}")
        systems.append(member(name))
    progress("comparing with the paper")
    return Section(
        "Section 2: a class of nonholonomic systems", tuple(make(systems) for make in STATEMENTS)
    )


def equations_of_motion(systems: Sequence[Member]) -> Statement:
    """Equation (3)."""
    rows, good = [], True
    for system in systems:
        table = system.result["equations_of_motion"]
        found = {name: system.tree(entry["text"]) for name, entry in table["accelerations"].items()}
        first = {name: system.tree(entry["text"]) for name, entry in table["first_order"].items()}
        expected = motion(system)
        same = system.vanish(
            [
                subtract(found[name], expected[name])
                for name in (system.r1, system.r2)
                if name in found
            ]
            + [subtract(first[s], expected[s]) for s in system.s if s in first]
        )
        good &= same and set(first) == set(system.s)
        rows.append(
            (
                system.title,
                f"{system.r1}, {system.r2}",
                ", ".join(map(to_text, system.slopes)),
                _yes(same),
            )
        )
    return Statement(
        "motion",
        "equation (3)",
        "In the class s' = -A(r1) r2' the nonholonomic motion is r1'' = 0, r2'' = -N^2 K r1' r2' with "
        "N = (I2 + sum I A^2)^(-1/2) and K = sum I A A'.",
        finding(good),
        "The multipliers were eliminated from the bare Lagrangian and constraints of each system, and the result "
        "compared with the formula (exactly, modulo two primes at random points).",
        CODE,
        (Table(("system", "r1, r2", "A", "same"), tuple(rows)),),
    )


def associated_systems(systems: Sequence[Member]) -> Statement:
    """Equations (4) and (5)."""
    rows, good = [], True
    for system in systems:
        cells = [system.title]
        for kind in ("first", "second"):
            expected, found = second_order(system, kind), system.accelerations(kind)
            same = system.vanish(
                [subtract(found[name], expected[name]) for name in system.coordinates]
            )
            good &= same
            cells.append(_yes(same))
        rows.append(tuple(cells))
    return Statement(
        "associated",
        "equations (4) and (5)",
        "The first associated system has s'' = -(A' - N^2 K A) r1' r2', the second s'' = (A' - N^2 K A) r1' s'/A.",
        finding(good),
        "Both were derived for each system without naming them, and compared with the formulas.",
        CODE,
        (Table(("system", "first", "second"), tuple(rows)),),
    )


def first_has_no_lagrangian(systems: Sequence[Member]) -> Statement:
    """Proposition 1, part 1."""
    rows, good = [], True
    for system in systems:
        answer = system.associated("first")
        proven = answer["verdict"] == "not_variational" and answer["checked"] == "valid"
        good &= proven
        rows.append((system.title, answer["verdict"].replace("_", " "), answer["verdict_with_time"].replace("_", " "),
                     answer["checked"] or "not checked"))  # fmt: skip
    return Statement(
        "proposition-1-1",
        "Proposition 1, part 1",
        "The first associated systems of the classical examples have no regular Lagrangian.",
        finding(good),
        "Each has a certificate that the independent checker confirms. The statement holds for one, two and three "
        "constraints with arbitrary A(r1) too, and for Lagrangians that may contain t.",
        CODE,
        (Table(("system", "L(q, q')", "L(t, q, q')", "checker"), tuple(rows)),),
    )


def second_has_lagrangians(systems: Sequence[Member]) -> Statement:
    """Proposition 1, part 2."""
    rows, good = [], True
    for system in systems:
        constant = system.vanish([system.coupling])
        verdicts = [_checked(system, 1), _checked(system, 2) if constant else "N is not constant"]
        good &= verdicts[0] == "valid" and verdicts[1] in ("valid", "N is not constant")
        rows.append((system.title, *verdicts, to_text(lagrangian(system, 1))))
    return Statement(
        "proposition-1-2",
        "Proposition 1, part 2",
        "L~1 = I1 r1'^2/2 + (C2 r2'^2/r1' + sum C s'^2/(A r1'))/(2 N) is a Lagrangian of the second system, and "
        "where N is constant so is L~2 = I1 r1'^2/2 + I2 r2'^2/2 + sum a s'^2/(A r1')/(2 N).",
        finding(good),
        "The paper's formulas, with free constants, were given to the independent checker as Lagrangians of the "
        "derived second systems: the Euler-Lagrange residual vanishes and the Hessian is regular.",
        CODE,
        (Table(("system", "L~1", "L~2", "L~1 in its coordinates"), tuple(rows)),),
    )


def _checked(system: Member, form: int) -> str:
    """What the checker says of the paper's Lagrangian for the derived second system."""
    return check_lagrangian(
        second_system(system, constants(system, form)), lagrangian(system, form)
    )


def check_lagrangian(system: SecondOrderSystem, tree: Expression) -> str:
    """The independent checker's verdict on a Lagrangian."""
    certificate = certify.of_lagrangian(analyze(system), tree, question=PLAIN)
    return check_certificate(certificate, time_limit=CHECK_SECONDS).verdict


def second_system(system: Member, further: Sequence[str] = ()) -> SecondOrderSystem:
    """The second associated system as derived; `further` parameters may stand in a Lagrangian."""
    equations = dict(system.associated("second")["equations"])
    functions = {name: list(arguments) for name, arguments in system.names.functions.items()}
    return read_system(
        system.coordinates, equations, (*system.names.parameters, *further), functions
    )


def hamiltonians(systems: Sequence[Member]) -> Statement:
    """Proposition 2."""
    rows, good = [], True
    for system in systems:
        cells = [system.title]
        for form in (1, 2) if system.vanish([system.coupling]) else (1,):
            same, kept = _same_hamiltonian(system, form), _kept(system, form)
            good &= same and kept
            cells.append("same" if same and kept else "not the same")
        rows.append((*cells, "N is not constant")[:3])
    return Statement(
        "proposition-2",
        "Proposition 2",
        "H~1 = (p1 + N (p2^2/C2 + sum A p^2/C)/2)^2/(2 I1) with constraints C2 p = -C p2, and "
        "H~2 = p2^2/(2 I2) + (p1 + N sum A p^2/a/2)^2/(2 I1) with constraints I2 N r1' p + a p2 = 0.",
        finding(good),
        "The Legendre transform of each Lagrangian was computed and compared with the formula, and the momenta of "
        "states on the constraints put into the formulas for their image.",
        CODE,
        (Table(("system", "H~1 and constraints", "H~2 and constraints"), tuple(rows)),),
    )


def _same_hamiltonian(system: Member, form: int) -> bool:
    """H~ of the paper at p = dL/dv is v dL/dv - L."""
    L = lagrangian(system, form)
    speeds = [Velocity(name) for name in system.coordinates]
    p = _momenta(system, L)
    energy = subtract(
        add(*(multiply(v, value) for v, value in zip(speeds, p.values(), strict=True))), L
    )
    ours = substitute(hamiltonian(system, form), p)
    also = substitute(legendre(L, system.coordinates).hamiltonian, p)
    return system.vanish([subtract(ours, energy), subtract(also, energy)], constants(system, form))


def _kept(system: Member, form: int) -> bool:
    """The images vanish at the momenta of every state on the constraints."""
    L = lagrangian(system, form)
    p = _momenta(system, L)
    speeds: dict[Expression, Expression] = {
        Velocity(s): negate(multiply(A, Velocity(system.r2)))
        for s, A in zip(system.s, system.slopes, strict=True)
    }
    trees = [substitute(substitute(image, p), speeds) for image in images(system, form)]
    return system.vanish(trees, constants(system, form))


def _momenta(system: Member, L: Expression) -> dict[Expression, Expression]:
    """{p_x: dL/dx'}."""
    symbols = [Symbol(f"p_{name}") for name in system.coordinates]
    return dict(zip(symbols, momenta(L, system.coordinates), strict=True))


def _yes(same: bool) -> str:
    return "yes" if same else "no"


STATEMENTS: tuple[Callable[[Sequence[Member]], Statement], ...] = (
    equations_of_motion,
    associated_systems,
    first_has_no_lagrangian,
    second_has_lagrangians,
    hamiltonians,
)
