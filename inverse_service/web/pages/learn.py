"""The inverse problem in six short screens, each with something to try."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from fastapi import APIRouter
from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service.web.pages import typesetting
from inverse_service.web.pages.rendering import can_simulate, page

router = APIRouter()


@dataclass(frozen=True, slots=True)
class Screen:
    """A heading, paragraphs, formulas in LaTeX, an example to try, and the name of a motion to watch."""

    title: str
    paragraphs: tuple[str, ...]
    formulas: tuple[str, ...]
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
            r"\frac{d}{dt} \frac{\partial L}{\partial v^i} - \frac{\partial L}{\partial q^i} = 0",
            r"L = \frac{\dot{x}^{2}}{2} - \frac{x^{2}}{2} \quad \Longrightarrow \ddot{x} = -x",
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
            r"\ddot{q}^i = f^i(q, v) , \qquad g_{ij} = \frac{\partial^{2} L}{\partial v^i \partial v^j}",
            r"\Gamma(g) = g N + (g N)^{\mathsf T} , \qquad g \Phi = (g \Phi)^{\mathsf T} , \qquad "
            r"\frac{\partial g_{ij}}{\partial v^k} = \frac{\partial g_{ik}}{\partial v^j}",
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
        (r"L = \frac{\dot{\varphi}^{2}}{2} + \frac{\dot{x}^{2}}{2 \dot{\varphi} \cos\left(\varphi\right)}",),
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
        (r"g \Phi = (g \Phi)^{\mathsf T} , \qquad g \nabla\Phi = (g \nabla\Phi)^{\mathsf T} , \qquad \det g \neq 0",),
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
        (
            r"\dot{x} = R \cos\left(\varphi\right) \dot{\theta} , \qquad "
            r"\dot{y} = R \sin\left(\varphi\right) \dot{\theta}",
        ),
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
        (r"L_d(q_1, q_2) = L\left(\left(1 - \alpha\right) q_1 + \alpha q_2 , \frac{q_2 - q_1}{h}\right)",),
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
    return page("learn.html", active="/learn", screens=_shown(), can_simulate=can_simulate())


@lru_cache(maxsize=1)
def _shown() -> list[Shown]:
    return [Shown(screen, [typesetting.latex(source) for source in screen.formulas]) for screen in SCREENS]
