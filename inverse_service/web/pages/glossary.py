"""The words of the theory, each in a sentence or two: opened in place where a step uses it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from markupsafe import Markup

from inverse_service.web.pages import typesetting


@dataclass(frozen=True, slots=True)
class Term:
    """A word, what it means, and its formula in the notation of the theory where it has one."""

    key: str
    name: str
    meaning: str
    text: str = ""

    @property
    def formula(self) -> Markup | None:
        """The formula typeset."""
        return typesetting.of_theory(self.text) if self.text else None


TERMS = (
    Term(
        "multiplier", "the multiplier",
        "The matrix of second derivatives of L in the velocities. The inverse problem looks for g first: if g "
        "satisfies the Helmholtz conditions, a Lagrangian follows by integration.",
        "g_ij = d(dL/dv^i)/dv^j",
    ),
    Term(
        "regular", "regular",
        "A Lagrangian is regular where det g is not zero. Only then do its Euler-Lagrange equations determine the "
        "accelerations.",
    ),
    Term(
        "helmholtz", "Helmholtz",
        "The Helmholtz conditions: a nonsingular g that satisfies them is the Hessian of a Lagrangian, and every "
        "Lagrangian has such a g.",
        "g_ij = g_ji, Gamma(g) = g N + (g N)^T, g Phi = (g Phi)^T",
    ),
    Term(
        "gamma", "Γ",
        "The derivative along the motion: of a function of time, positions and velocities, where accelerations are "
        "replaced by f.",
        "Gamma = d/dt + v^i d/dq^i + f^i d/dv^i",
    ),
    Term("n", "N", "The connection of the system: how f depends on the velocities.",
         "N = -1/2 df/dv"),
    Term(
        "phi", "Φ",
        "Twice the Jacobi endomorphism: a matrix made from f alone, which says how neighboring motions accelerate "
        "away from each other. g Φ must be symmetric.",
        "Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv) (df/dv)",
    ),
    Term("nabla", "∇Φ", "The derivative of Φ along the motion; g ∇Φ must be symmetric, too.",
         "nabla Phi = Gamma(Phi) + N Phi - Phi N"),
    Term(
        "r", "R",
        "The curvature: the derivatives of Φ in the velocities, antisymmetrized. Its cyclic sum with g must vanish.",
        "R^j_kl = dPhi^j_k/dv^l - dPhi^j_l/dv^k",
    ),
    Term(
        "prolonged", "prolonged",
        "Equations for functions are prolonged by all their derivatives up to some order. At a point these are linear "
        "equations on the Taylor coefficients of the functions, and may say more about the first of them than the "
        "equations themselves do.",
    ),
    Term(
        "involutive", "involutive",
        "The system of equations for g hides no further consequences: every value of g that is left at a point "
        "belongs to a solution near it. Cartan's test shows it by counting the Taylor coefficients of the highest "
        "degree (the symbol) that are still free; its characters are these numbers, one direction after the other.",
    ),
    Term(
        "associated", "associated system",
        "A system without constraints whose motions, started on the constraints, are those of the constrained system. "
        "There are infinitely many.",
    ),
    Term("domain", "domain", "The open set on which the answer holds: its formulas are defined, and L is regular."),
)  # fmt: skip
_KEYS = {"Phi": "phi", "nabla_Phi": "nabla", "R": "r", "Gamma": "gamma", "N": "n", "Helmholtz": "helmholtz"}


def terms_of(uses: Iterable[str]) -> tuple[Term, ...]:
    """The words of the theory that a step names."""
    keys = {_KEYS.get(use, use) for use in uses}
    return tuple(term for term in TERMS if term.key in keys)
