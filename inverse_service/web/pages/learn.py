"""The inverse problem in six short screens, each with something to try."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from fastapi import APIRouter
from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service.expressions.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.manual import PAGES
from inverse_service.web.pages.rendering import can_simulate, page

router = APIRouter()


@dataclass(frozen=True, slots=True)
class Written:
    """A formula in the notation of a system of the lessons."""

    text: str


@dataclass(frozen=True, slots=True)
class Screen:
    """A heading, paragraphs, formulas of the theory or of a system, an example to try, and a motion to watch."""

    title: str
    paragraphs: tuple[str, ...]
    formulas: tuple[str | Written, ...]
    example: str = ""
    question: str = ""
    motion: str = ""


SCREENS = (
    Screen(
        "From a Lagrangian to equations",
        (
            "A Lagrangian L(q, v) is one function of positions and velocities. Its Euler-Lagrange equations are the "
            "equations of motion: one function says everything.",
            "For kinetic minus potential energy of a spring they are the oscillator.",
        ),
        (
            "d/dt dL/dv^i - dL/dq^i = 0",
            Written("L = x'^2/2 - x^2/2"),
            Written("x'' = -x"),
        ),
        "x'' = -x",
        "Find L from the equation",
    ),
    Screen(
        "The way back",
        (
            "The inverse problem starts from the equations. Is there an L at all? It need not be kinetic minus "
            "potential energy, and there may be many.",
            "Look for g, the matrix of second derivatives of L in the velocities. It must be symmetric, invertible, "
            "and fulfil the Helmholtz conditions. They are linear in g.",
        ),
        (
            "g_ij = d(dL/dv^i)/dv^j, dg_ij/dv^k = dg_ik/dv^j",
            "Gamma(g) = g N + (g N)^T",
            "g Phi = (g Phi)^T",
        ),
        "x'' = -x'",
        "Friction: is there an L?",
    ),
    Screen(
        "A yes that surprises",
        (
            "Friction does have a Lagrangian in one coordinate. In several coordinates unusual ones appear, with "
            "velocities in the denominator. The answer says where it is regular.",
        ),
        (Written("L = phi'^2/2 + x'^2/(2*phi'*cos(phi))"),),
        "phi'' = 0\nx'' = -tan(phi)*phi'*x'",
        "Find this L",
    ),
    Screen(
        "A no, with a proof",
        (
            "From the equations one matrix follows, Φ, then its derivative ∇Φ along the motion, and so on. Each gives "
            "linear conditions on g. When only singular g are left, there is no Lagrangian, whatever its form.",
            "The answer lists the few conditions that suffice, and each step can be followed by hand.",
        ),
        ("g Phi = (g Phi)^T", "g nabla Phi = (g nabla Phi)^T", "det g = 0"),
        "phi'' = 0\ntheta'' = 0\nx'' = -sin(phi)*phi'*theta'\ny'' = cos(phi)*phi'*theta'",
        "Prove that there is none",
    ),
    Screen(
        "Constraints on velocities",
        (
            "A disk that rolls without slipping has constraints on its velocities that no function of the positions "
            "replaces. Its motion is not that of any Lagrangian in the usual sense: it is nonholonomic.",
            "But other equations, without constraints, have the same motions among theirs: associated systems. The "
            "one on the previous screen is the first of the disk. The second has a Lagrangian.",
        ),
        (Written("x' = R*cos(phi)*theta'"), Written("y' = R*sin(phi)*theta'")),
        "phi'' = 0\ntheta'' = 0\nx'' = -tan(phi)*phi'*x'\ny'' = cot(phi)*phi'*y'",
        "Solve the second one",
        "disk",
    ),
    Screen(
        "What a Lagrangian is good for",
        (
            "With L comes a Hamiltonian, conserved quantities, and numerical methods that keep the geometry: a "
            "variational integrator makes the motion stationary for a discrete action. Its energy does not drift.",
            "For the rolling disk it can be compared with methods that keep the constraint instead.",
        ),
        ("L_d(q_1, q_2) = L((1 - alpha) q_1 + alpha q_2, (q_2 - q_1)/h)",),
        "",
        "",
        "knife-edge",
    ),
)


@dataclass(frozen=True, slots=True)
class Shown:
    """A screen with its formulas typeset."""

    screen: Screen
    formulas: list[Markup]


@router.get("/learn")
async def learn() -> HTMLResponse:
    """The six screens."""
    return page("learn.html", active="/learn", screens=_shown(), manual=PAGES, can_simulate=can_simulate())


def _typeset(formula: str | Written) -> Markup:
    if isinstance(formula, Written):
        return typesetting.formula(formula.text, Names(("x", "y", "phi", "theta"), ("R", "L")))
    return typesetting.of_theory(formula)


@lru_cache(maxsize=1)
def _shown() -> list[Shown]:
    return [Shown(screen, [_typeset(formula) for formula in screen.formulas]) for screen in SCREENS]
