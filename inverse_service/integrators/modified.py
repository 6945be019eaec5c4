"""The modified integrator of the paper: discrete Euler-Lagrange equations of a free Lagrangian for the base
coordinates, discrete constraints for the others.

It keeps the discrete constraints and, at alpha other than 1/2, is not symplectic. Its own singular set is where the
determinant of the reduced discrete Hessian vanishes (for the disk 1 + (theta'^2/phi'^3)(cos phi + sin phi) = 0 as
h -> 0); the kernel tests that determinant at every step.
"""

from __future__ import annotations

from inverse_service.integrators.card import MethodCard

CARD = MethodCard(
    name="modified",
    order="2 at alpha = 1/2 or symmetrised, else 1; 4, 6, 8 by composition of alpha = 1/2",
    requires="a free Lagrangian of an associated system, and constraints that give the dependent velocities",
    source="T. Mestdag, A. M. Bloch, O. E. Fernandez, Hamiltonization and geometric integration of nonholonomic "
    "mechanical systems (2009), section 3",
)
