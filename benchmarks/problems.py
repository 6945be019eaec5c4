"""The motions on which the integrators are measured and tested, written by hand.

Systems and free Lagrangians: T. Mestdag, A. M. Bloch, O. E. Fernandez, Hamiltonization and
geometric integration of nonholonomic mechanical systems (2009); those of the third type are our
own. `c` are the free constants.
"""

from __future__ import annotations

from inverse_service.expressions.tree import Expression
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.simulation.scene_data import Observable, Problem


def read(text: str, coordinates: tuple[str, ...], parameters: tuple[str, ...] = ()) -> Expression:
    return read_formula(text, Names(coordinates, parameters))


def problem(
    coordinates: str,
    lagrangian: str = "",
    constraints: tuple[str, ...] = (),
    free: str = "",
    hamiltonian: str = "",
    accelerations: tuple[str, ...] = (),
    parameters: str = "",
) -> Problem:
    """A problem from texts; H is over the coordinates and p_x, p_y, ..."""
    names, constants = tuple(coordinates.split()), tuple(parameters.split())
    momenta = tuple(f"p_{name}" for name in names)

    def tree(text: str) -> Expression | None:
        return read(text, names, constants) if text else None

    return Problem(
        coordinates=names,
        parameters=constants,
        lagrangian=tree(lagrangian),
        constraints=tuple(read(text, names, constants) for text in constraints),
        free_lagrangian=tree(free),
        free_hamiltonian=read(hamiltonian, names, (*constants, *momenta)) if hamiltonian else None,
        accelerations=tuple(read(text, names, constants) for text in accelerations) or None,
    )


DISK = problem(
    "phi theta x y",
    lagrangian="1/2*(x'^2 + y'^2) + 1/4*theta'^2 + 1/8*phi'^2",
    constraints=("x' - cos(phi)*theta'", "y' - sin(phi)*theta'"),
    free="1/2*(phi'^2 + theta'^2 + c*x'^2/(cos(phi)*phi') + c*y'^2/(sin(phi)*phi'))",
    hamiltonian="1/2*p_theta^2 + 1/2*(p_phi + 1/2/c*(cos(phi)*p_x^2 + sin(phi)*p_y^2))^2",
    accelerations=("0", "0", "-sin(phi)*phi'*theta'", "cos(phi)*phi'*theta'"),
    parameters="c",
)
DISK_ENERGY = Observable(
    "energy", read("1/2*(x'^2 + y'^2) + 1/4*theta'^2 + 1/8*phi'^2", DISK.coordinates)
)
DISK_CONSTRAINTS = tuple(
    Observable(f"constraint {k}", tree) for k, tree in enumerate(DISK.constraints)
)
# With the third associated system: regular everywhere, the constraint is a conserved momentum.
DISK_THIRD = problem(
    "phi theta x y",
    free="1/2*(phi'^2 + theta'^2) + c*(y'^2*cos(phi) - x'^2*cos(phi) - 2*x'*y'*sin(phi))/(2*phi')",
    hamiltonian="1/2*p_theta^2 + 1/2*(p_phi + (cos(phi)*(p_y^2 - p_x^2) - 2*sin(phi)*p_x*p_y)/(2*c))^2",
    constraints=("x' - cos(phi)*theta'", "y' - sin(phi)*theta'"),
    accelerations=("0", "0", "-sin(phi)*phi'*theta'", "cos(phi)*phi'*theta'"),
    parameters="c",
)
PARTICLE = problem(
    "x y z",
    lagrangian="1/2*(x'^2 + y'^2 + z'^2)",
    constraints=("z' + x*y'",),
    free="1/2*x'^2 + c*sqrt(1 + x^2)/2*(y'^2/x' + z'^2/(x*x'))",
    hamiltonian="1/2*(p_x + (p_y^2 + x*p_z^2)/(2*c*sqrt(1 + x^2)))^2",
    accelerations=("0", "-x*x'*y'/(1 + x^2)", "-x'*y'/(1 + x^2)"),
    parameters="c",
)
PARTICLE_THIRD = problem(
    "x y z",
    free="1/2*x'^2 + c*(y'^2 - 2*x*y'*z' - z'^2)/(2*x'*sqrt(1 + x^2))",
    hamiltonian="1/2*(p_x + (p_y^2 - 2*x*p_y*p_z - p_z^2)/(2*c*sqrt(1 + x^2)))^2",
    constraints=("z' + x*y'",),
    accelerations=("0", "-x*x'*y'/(1 + x^2)", "-x'*y'/(1 + x^2)"),
    parameters="c",
)
KNIFE = problem(
    "phi x y",
    lagrangian="1/2*(phi'^2 + x'^2 + y'^2)",
    constraints=("x'*sin(phi) - y'*cos(phi)",),
    free="1/2*phi'^2 + c*(x'^2/cos(phi) + y'^2/sin(phi))/(2*phi')",
    hamiltonian="1/2*(p_phi + (cos(phi)*p_x^2 + sin(phi)*p_y^2)/(2*c))^2",
    accelerations=("0", "-phi'*y'", "phi'*x'"),
    parameters="c",
)
PENDULUM = problem(
    "u",
    lagrangian="1/2*u'^2 + k*cos(u)",
    free="1/2*u'^2 + k*cos(u)",
    hamiltonian="1/2*p_u^2 - k*cos(u)",
    accelerations=("-k*sin(u)",),
    parameters="k",
)
# A rolling robot with a potential k (1 - cos psi); stiff for large k.
ROBOT = problem(
    "theta psi x y",
    lagrangian="1/2*(x'^2 + y'^2 + theta'^2 + psi'^2) + k*cos(psi)",
    constraints=("x' - cos(theta)*psi'", "y' - sin(theta)*psi'"),
    accelerations=(
        "0",
        "-k*sin(psi)/2",
        "-sin(theta)*theta'*psi' - cos(theta)*k*sin(psi)/2",
        "cos(theta)*theta'*psi' - sin(theta)*k*sin(psi)/2",
    ),
    parameters="k",
)
# Contact oscillators x' = -y z' in an asymmetric potential. K. Modin, O. Verdier, What makes
# nonholonomic integrators work?, Numer. Math. 145 (2020) 405: long-time behavior is good because
# motions are reversible, so an irreversible one must be tested too. The systems are our own.
# Without terms linear in the velocities, (q, v) -> (q, -v) reverses time for any potential: the
# first is reversible. The magnetic term k z y' of the second changes its sign then; of the
# reflections that keep the constraint, (x, z) -> -(x, z) and (x, y) -> -(x, y) would undo that, but
# x^3 breaks them.
_CONTACT_POTENTIAL = "1/2*(x^2 + y^2 + z^2) + k*x^3/3"
_CONTACT_KINETIC = "1/2*(x'^2 + y'^2 + z'^2)"
_PUSH = "(x + k*x^2 - y'*z' + y*z)/(1 + y^2)"
_PUSH_MAGNETIC = "(x + k*x^2 - y'*z' + y*z - k*y*y')/(1 + y^2)"
CONTACT_REVERSIBLE = problem(
    "x y z",
    lagrangian=f"{_CONTACT_KINETIC} - ({_CONTACT_POTENTIAL})",
    constraints=("x' + y*z'",),
    accelerations=(f"-x - k*x^2 + {_PUSH}", "-y", f"-z + y*{_PUSH}"),
    parameters="k",
)
CONTACT = problem(
    "x y z",
    lagrangian=f"{_CONTACT_KINETIC} - ({_CONTACT_POTENTIAL}) + k*z*y'",
    constraints=("x' + y*z'",),
    accelerations=(
        f"-x - k*x^2 + {_PUSH_MAGNETIC}",
        "-y - k*z'",
        f"-z + k*y' + y*{_PUSH_MAGNETIC}",
    ),
    parameters="k",
)
# The magnetic term does no work: both conserve the same energy.
CONTACT_ENERGY = Observable(
    "energy", read(f"{_CONTACT_KINETIC} + {_CONTACT_POTENTIAL}", CONTACT.coordinates, ("k",))
)
HENON_HEILES = problem(
    "x y",
    lagrangian="(x'^2 + y'^2)/2 - (x^2 + y^2)/2 - x^2*y + y^3/3",
    free="(x'^2 + y'^2)/2 - (x^2 + y^2)/2 - x^2*y + y^3/3",
    hamiltonian="(p_x^2 + p_y^2)/2 + (x^2 + y^2)/2 + x^2*y - y^3/3",
    accelerations=("-x - 2*x*y", "-y - x^2 + y^2"),
)
# A system whose mass matrix depends on the place, and a chain of four with cubic forces: L has no
# constraints.
DOUBLE_PENDULUM = problem(
    "a b",
    lagrangian="a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)",
    free="a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)",
    hamiltonian="(p_a^2 - 2*p_a*p_b*cos(a - b) + 2*p_b^2)/(2*(2 - cos(a - b)^2)) - 2*cos(a) - cos(b)",
)
_SPRINGS = " + ".join(f"(x{k + 1} - x{k})^2/2 + (x{k + 1} - x{k})^4/4" for k in (1, 2, 3))
_KINETIC, _MOMENTA = (
    " + ".join(f"{text.format(k)}^2/2" for k in (1, 2, 3, 4)) for text in ("x{}'", "p_x{}")
)
CHAIN = problem(
    "x1 x2 x3 x4",
    lagrangian=f"{_KINETIC} - ({_SPRINGS})",
    free=f"{_KINETIC} - ({_SPRINGS})",
    hamiltonian=f"{_MOMENTA} + {_SPRINGS}",
)
