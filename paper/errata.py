"""What is wrong in print, each shown by a computation in which the right form passes and the printed one fails."""

from __future__ import annotations

import math
from collections.abc import Callable

from inverse_service import catalogue
from inverse_service.decision.deciding import analyze, decide
from inverse_service.explanation.hierarchy import smallest_sufficient_set
from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    subtract,
)
from inverse_service.field.real_branch import vanish
from inverse_service.mechanics.conditions import Matrix, conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.statements.questions import PLAIN
from paper.statement import Progress, Section, Statement, finding

CODE = "paper/errata.py"


def section_errata(progress: Progress) -> Section:
    """All errata of the symbolic part."""
    progress("errata")
    return Section("Errata of the printed formulas", tuple(make() for make in STATEMENTS))


def _system(name: str) -> SecondOrderSystem:
    document = catalogue.document(name)
    return read_system(
        document["coordinates"],
        document["equations"],
        document.get("parameters", ()),
        document.get("functions"),
    )


def _vanish(system: SecondOrderSystem, *trees: Expression) -> bool:
    variables: list[Symbol | Velocity] = [
        Symbol(name) for name in (*system.coordinates, *system.parameters)
    ]
    return vanish(trees, [*variables, *map(Velocity, system.coordinates)]) is True


def _product(left: Matrix, right: Matrix) -> Matrix:
    size = range(len(left))
    return tuple(
        tuple(add(*(multiply(left[i][k], right[k][j]) for k in size)) for j in size) for i in size
    )


def covariant_derivative() -> Statement:
    """The sign in nabla Phi."""
    system = _system("hill-lunar")
    tensors = conditions(system)
    assert tensors.N is not None
    assert tensors.Phi is not None
    assert tensors.nabla_Phi is not None
    # The printed formula is Gamma(Phi) - N Phi - Phi N, the right one Gamma(Phi) + N Phi - Phi N.
    twice = _product(tensors.N, tensors.Phi)
    printed = subtract(tensors.nabla_Phi[0][1], multiply(number(2), twice[0][1]))
    printed_below = subtract(tensors.nabla_Phi[1][0], multiply(number(2), twice[1][0]))
    right = _vanish(system, subtract(tensors.nabla_Phi[0][1], tensors.nabla_Phi[1][0]))
    wrong = not _vanish(system, subtract(printed, printed_below))
    verdict = decide(system, PLAIN).verdict
    return Statement(
        "nabla-phi",
        "section 2, the formula for nabla Phi",
        "(nabla Phi) = Gamma(Phi) - N Phi - Phi N.",
        finding(right and wrong and verdict == "variational", "erratum"),
        "The second sign is wrong: nabla Phi = Gamma(Phi) + N Phi - Phi N. Hill's lunar problem has a "
        "Lagrangian with g = identity. With the right sign nabla Phi is symmetric, as it must be; with the printed "
        "sign it is not, so the printed condition rejects a system that has a Lagrangian.",
        CODE,
    )


def curvature_indices() -> Statement:
    """The indices of R."""
    document = {"x": "-y*x'*y' - y'*z'", "y": "y*x'^2 + x'*z'", "z": "(y^2 - 1)*x'*y' + y*y'*z'"}
    system = read_system(list(document), document)
    names = Names(system.coordinates, (), {}, time=False)
    rows = (("1+y^2", "0", "y"), ("0", "1", "0"), ("y", "0", "1"))
    metric = [[read_formula(text, names) for text in row] for row in rows]
    R = conditions(system).R
    assert R is not None
    sums = [
        add(
            *(
                multiply(metric[a][j], R[j][b][c])
                for j in range(3)
                for a, b, c in ((0, 1, 2), (2, 0, 1), (1, 2, 0))
            )
        )
    ]
    nonzero = any(not _vanish(system, entry) for block in R for row in block for entry in row)
    return Statement(
        "curvature",
        "section 2, the definition of R",
        "R^j_kl is given by derivatives of Phi^k_i and Phi^k_j; the indices on the two sides do not match.",
        finding(_vanish(system, *sums) and nonzero, "erratum"),
        "R^j_kl = d Phi^j_k/dv^l - d Phi^j_l/dv^k. With it the cyclic condition "
        "g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0 holds for the geodesics of a metric in three dimensions with g "
        "the metric, where R is not zero.",
        CODE,
    )


def singular_matrices() -> Statement:
    """A word in the proof of Proposition 1."""
    good = True
    for name in (
        "nonholonomic-particle-first",
        "knife-edge-first",
        "vertically-rolling-disk-first",
    ):
        chosen = smallest_sufficient_set(analyze(_system(name)))
        good &= chosen is not None
    return Statement(
        "singular",
        "proof of Proposition 1",
        "The only matrices that satisfy the algebraic conditions of the first systems must be non-singular.",
        finding(good, "erratum"),
        "It should read singular. For particle, knife edge and disk all symmetric matrices that satisfy Phi, nabla Phi "
        "and R conditions at a generic point were found, and every one has determinant zero.",
        CODE,
    )


def missing_dot() -> Statement:
    """The definition of H."""
    names = Names(("x",), (), {}, time=False)
    L, p = read_formula("x'^2/2 - x^2/2", names), Velocity("x")
    energy = read_formula("x'^2/2 + x^2/2", names)
    system = read_system(["x"], {"x": "-x"})
    right = _vanish(system, subtract(subtract(multiply(p, Velocity("x")), L), energy))
    wrong = not _vanish(system, subtract(subtract(multiply(p, Symbol("x")), L), energy))
    return Statement(
        "hamiltonian",
        "section 2, the definition of the Hamiltonian",
        "H~ = p_i q^i - L~.",
        finding(right and wrong, "erratum"),
        "A dot is missing: H~ = p_i q'^i - L~. The printed form is not the energy of the harmonic oscillator; the "
        "right form is, and it gives Proposition 2.",
        CODE,
    )


def matching_circle() -> Statement:
    """The equation of the circle."""
    points = [(1 + 2 * math.cos(t), 3 + 2 * math.sin(t)) for t in (0.1, 1.3, 2.9)]
    right = {round((x - 1) ** 2 + (y - 3) ** 2, 9) for x, y in points}
    wrong = {round((x - 1) ** 2 + (x - 3) ** 2, 9) for x, y in points}
    return Statement(
        "circle",
        "section 3.2, the matching circle",
        "(x - A)^2 + (x - B)^2 = C^2.",
        finding(len(right) == 1 and len(wrong) == 3, "erratum"),
        "The second x is y: (x - A)^2 + (y - B)^2 = C^2. Three points of a circle satisfy this, and not the "
        "printed form.",
        CODE,
    )


STATEMENTS: tuple[Callable[[], Statement], ...] = (
    covariant_derivative,
    curvature_indices,
    singular_matrices,
    missing_dot,
    matching_circle,
)
