"""The words of the theory, each in a sentence or two: opened in place where a step uses it."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from inverse_service.web.pages import typesetting


@dataclass(frozen=True, slots=True)
class Term:
    """A word, its formula in LaTeX where it has one, and what it means."""

    key: str
    name: str
    meaning: str
    latex: str = ""

    @property
    def formula(self) -> Markup | None:
        """The formula typeset."""
        return typesetting.latex(self.latex) if self.latex else None


TERMS = (
    Term(
        "multiplier", "the multiplier",
        "The matrix of second derivatives of L in the velocities. The inverse problem looks for g first: if g "
        "satisfies the Helmholtz conditions, a Lagrangian follows by integration.",
        r"g_{ij} = \frac{\partial^{2} L}{\partial v^i \partial v^j}",
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
        r"g_{ij} = g_{ji} , \quad \Gamma(g) = g N + (g N)^{\mathsf T} , \quad g \Phi = (g \Phi)^{\mathsf T}",
    ),
    Term(
        "gamma", "Γ",
        "The derivative along the motion: of a function of time, positions and velocities, where accelerations are "
        "replaced by f.",
        r"\Gamma = \frac{\partial}{\partial t} + v^i \frac{\partial}{\partial q^i} + f^i \frac{\partial}{\partial v^i}",
    ),
    Term("n", "N", "The connection of the system: how f depends on the velocities.",
         r"N = - \frac{1}{2} \frac{\partial f}{\partial v}"),
    Term(
        "phi", "Φ",
        "Twice the Jacobi endomorphism: a matrix made from f alone, which says how neighboring motions accelerate "
        "away from each other. g Φ must be symmetric.",
        r"\Phi = \Gamma\left(\frac{\partial f}{\partial v}\right) - 2 \frac{\partial f}{\partial q} - "
        r"\frac{1}{2} \frac{\partial f}{\partial v} \frac{\partial f}{\partial v}",
    ),
    Term("nabla", "∇Φ", "The derivative of Φ along the motion; g ∇Φ must be symmetric, too.",
         r"\nabla\Phi = \Gamma(\Phi) + N \Phi - \Phi N"),
    Term(
        "r", "R",
        "The curvature: the derivatives of Φ in the velocities, antisymmetrized. Its cyclic sum with g must vanish.",
        r"R^j_{kl} = \frac{\partial \Phi^j_k}{\partial v^l} - \frac{\partial \Phi^j_l}{\partial v^k}",
    ),
    Term(
        "involutive", "involutive",
        "The system of equations for g hides no further consequences: every value of g that is left at a point "
        "belongs to a solution near it (Cartan's test).",
    ),
    Term(
        "associated", "associated system",
        "A system without constraints whose motions, started on the constraints, are those of the constrained system. "
        "There are infinitely many.",
    ),
    Term("domain", "domain", "The open set on which the answer holds: its formulas are defined, and L is regular."),
)  # fmt: skip
_WORDS = {
    "multiplier": ("multiplier",), "regular": ("regular",), "helmholtz": ("Helmholtz",), "gamma": ("Gamma",),
    "n": (" N ", "N^"), "phi": ("Φ",), "nabla": ("∇Φ",), "r": ("R^j", "(R)_"), "involutive": ("involutive",),
    "associated": ("associated",),
}  # fmt: skip


def terms_in(text: str) -> tuple[Term, ...]:
    """The words of the theory that a text uses."""
    return tuple(term for term in TERMS if any(word in text for word in _WORDS.get(term.key, ())))
