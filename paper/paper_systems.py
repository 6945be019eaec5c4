"""The nonholonomic systems of the paper, and its formulas for them, built from the roles that were recognized."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from inverse_service import catalogue
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions.calculus import differentiate
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    add,
    divide,
    multiply,
    negate,
    power,
    subtract,
)
from inverse_service.field.real_branch import vanish
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.nonholonomic_documents import solve_nonholonomic

CLASSICAL = (
    "nonholonomic-particle",
    "knife-edge",
    "vertically-rolling-disk",
    "mobile-robot",
    "two-wheeled-carriage",
)
TIME_LIMIT = 60.0


@dataclass(frozen=True, slots=True)
class Member:
    """A solved system of the class: its document, its result, and the roles r1, r2, s of its
    coordinates.

    `slopes` are A_s, `masses` I_1, I_2, I_s as they stand in L; `density` is N = (I_2 + sum I_s
    A_s^2)^(-1/2).
    """

    title: str
    document: Mapping[str, Any]
    result: Mapping[str, Any]
    names: Names
    r1: str
    r2: str
    s: tuple[str, ...]
    slopes: tuple[Expression, ...]
    masses: Mapping[str, Expression]

    @property
    def coordinates(self) -> tuple[str, ...]:
        return self.names.coordinates

    @property
    def density(self) -> Expression:
        squares = [
            multiply(self.masses[s], power(A, 2)) for s, A in zip(self.s, self.slopes, strict=True)
        ]
        return power(add(self.masses[self.r2], *squares), -HALF.value)

    @property
    def coupling(self) -> Expression:
        """K = sum I_s A_s A_s'."""
        parts = zip(self.s, self.slopes, strict=True)
        return add(
            *(multiply(self.masses[s], A, differentiate(A, Symbol(self.r1))) for s, A in parts)
        )

    def tree(self, text: str) -> Expression:
        """A formula of the result as a tree."""
        return read_formula(text, self.names)

    def vanish(self, trees: Sequence[Expression], further: Sequence[str] = ()) -> bool:
        """Whether all trees are identically zero; `further` names constants such as C_2."""
        variables: list[Symbol | Velocity] = [Symbol(name) for name in self.coordinates]
        variables += [Velocity(name) for name in self.coordinates]
        variables += [Symbol(name) for name in (*self.names.parameters, *further)]
        return vanish(trees, variables) is True

    def associated(self, kind: str) -> Mapping[str, Any]:
        """The answer about one associated system."""
        found: Mapping[str, Any] = next(
            one for one in self.result["associated"] if one["kind"] == kind
        )
        return found

    def accelerations(self, kind: str) -> dict[str, Expression]:
        """f of an associated system, as derived."""
        return {name: self.tree(text) for name, text in self.associated(kind)["equations"].items()}


def member(name: str) -> Member:
    """A catalogue entry with bare Lagrangian and constraints, solved without naming an associated system."""
    document = {
        key: value for key, value in catalogue.document(name).items() if key != "associated"
    }
    result = solve_nonholonomic(document, SolveOptions(time_limit=TIME_LIMIT))["nonholonomic"]
    roles = result["paper_class"]
    names = Names(
        tuple(document["coordinates"]),
        tuple(document.get("parameters", ())),
        functions_of(document),
        time=False,
    )
    lagrangian = read_formula(document["lagrangian"], names)
    masses = {
        q: differentiate(differentiate(lagrangian, Velocity(q)), Velocity(q))
        for q in names.coordinates
    }
    slopes = tuple(read_formula(roles["A"][s]["text"], names) for s in roles["s"])
    title = catalogue.entry(name).get("title") or document.get("name") or name
    return Member(
        title, document, result, names, roles["r1"], roles["r2"], tuple(roles["s"]), slopes, masses
    )


def functions_of(document: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The declared arbitrary functions."""
    return {name: tuple(arguments) for name, arguments in (document.get("functions") or {}).items()}


def motion(system: Member) -> dict[str, Expression]:
    """Equation (3) of the paper: r1'' = 0, r2'' = -N^2 K r1' r2', and s' = -A r2' under the names of s."""
    v1, v2 = Velocity(system.r1), Velocity(system.r2)
    table: dict[str, Expression] = {
        system.r1: ZERO,
        system.r2: negate(multiply(_drift(system), v1, v2)),
    }
    return table | {
        s: negate(multiply(A, v2)) for s, A in zip(system.s, system.slopes, strict=True)
    }


def _drift(system: Member) -> Expression:
    """N^2 K."""
    return multiply(power(system.density, 2), system.coupling)


def second_order(system: Member, kind: str) -> dict[str, Expression]:
    """Equations (4) and (5): s'' = -(A' - N^2 K A) r1' r2', or with r2' replaced by -s'/A."""
    v1, v2 = Velocity(system.r1), Velocity(system.r2)
    table = {name: f for name, f in motion(system).items() if name in (system.r1, system.r2)}
    for s, A in zip(system.s, system.slopes, strict=True):
        slope = subtract(differentiate(A, Symbol(system.r1)), multiply(_drift(system), A))
        last = negate(v2) if kind == "first" else divide(Velocity(s), A)
        table[s] = multiply(slope, v1, last)
    return table


def lagrangian(system: Member, form: int) -> Expression:
    """L~1 (form 1) or L~2 (form 2) of Proposition 1, with constants C_2, C_s or a_s."""
    v1, v2 = Velocity(system.r1), Velocity(system.r2)
    letter = "C" if form == 1 else "a"
    parts = [
        divide(multiply(Symbol(f"{letter}_{s}"), power(Velocity(s), 2)), multiply(A, v1))
        for s, A in zip(system.s, system.slopes, strict=True)
    ]
    kinetic = [multiply(HALF, system.masses[system.r1], power(v1, 2))]
    if form == 1:
        parts.append(divide(multiply(Symbol("C_2"), power(v2, 2)), v1))
    else:
        kinetic.append(multiply(HALF, system.masses[system.r2], power(v2, 2)))
    return add(*kinetic, multiply(HALF, power(system.density, -1), add(*parts)))


def hamiltonian(system: Member, form: int) -> Expression:
    """H~1 or H~2 of Proposition 2, the momentum of x being the symbol p_x."""
    letter = "C" if form == 1 else "a"
    parts = [
        divide(multiply(A, power(Symbol(f"p_{s}"), 2)), Symbol(f"{letter}_{s}"))
        for s, A in zip(system.s, system.slopes, strict=True)
    ]
    second = power(Symbol(f"p_{system.r2}"), 2)
    if form == 1:
        parts.append(divide(second, Symbol("C_2")))
    bracket = add(Symbol(f"p_{system.r1}"), multiply(HALF, system.density, add(*parts)))
    main = multiply(HALF, power(system.masses[system.r1], -1), power(bracket, 2))
    return (
        main
        if form == 1
        else add(main, multiply(HALF, power(system.masses[system.r2], -1), second))
    )


def images(system: Member, form: int) -> tuple[Expression, ...]:
    """The constraints in phase space: C_2 p_s + C_s p_2, or I_2 N r1' p_s + a_s p_2 with r1' from H~2."""
    p2 = Symbol(f"p_{system.r2}")
    if form == 1:
        return tuple(
            add(multiply(Symbol("C_2"), Symbol(f"p_{s}")), multiply(Symbol(f"C_{s}"), p2))
            for s in system.s
        )
    speed = differentiate(hamiltonian(system, 2), Symbol(f"p_{system.r1}"))
    factor = multiply(system.masses[system.r2], system.density, speed)
    return tuple(
        add(multiply(factor, Symbol(f"p_{s}")), multiply(Symbol(f"a_{s}"), p2)) for s in system.s
    )


def constants(system: Member, form: int) -> tuple[str, ...]:
    """The names of the free constants."""
    return (
        ("C_2", *(f"C_{s}" for s in system.s)) if form == 1 else tuple(f"a_{s}" for s in system.s)
    )
