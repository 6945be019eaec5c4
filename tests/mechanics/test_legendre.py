"""H = p v - L, against values of L alone: p is found here by numerical differentiation with mpmath."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from inverse_service.errors import InputError
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Arbitrary, Expression, Symbol, Velocity, node_count, walk
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.legendre.on_constraints import constraint_images
from inverse_service.mechanics.legendre.transform import LegendreTransform, legendre
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from inverse_service.service.documents.documents import solve_document

Point = dict[Expression, Any]
FUNCTIONS = {"A": ("r1",), "B": ("r1",), "K": ("r1",)}


def tree(text: str, coordinates: Sequence[str], parameters: str = "", momenta: bool = False) -> Expression:
    symbols = [f"p_{name}" for name in coordinates] if momenta else []
    functions = {name: arguments for name, arguments in FUNCTIONS.items() if arguments[0] in coordinates}
    return parse(text, Names(tuple(coordinates), (*parameters.split(), *symbols), functions))


def transform(text: str, coordinates: str, parameters: str = "") -> LegendreTransform:
    names = coordinates.split()
    return legendre(tree(text, names, parameters), names)


def random_point(trees: Sequence[Expression], source: random.Random, signed: bool) -> Point:
    """A value between 0.05 and 0.45 for every name and function, with a random sign if asked."""
    point: Point = {}
    for node in (node for expression in trees for node in walk(expression)):
        if isinstance(node, Symbol | Velocity | Arbitrary) and node != Symbol("pi"):
            drawn = mpf(source.randrange(10**17, 9 * 10**17)) / (2 * 10**18)
            point.setdefault(node, -drawn if signed and source.random() < 0.5 else drawn)
    return point


def momentum(lagrangian: Expression, name: str, point: Point) -> Any:
    """dL/dv by a central difference with so small a step that 40 digits are right."""
    step = mpf(10) ** -60
    values = [evaluate(lagrangian, {**point, Velocity(name): point[Velocity(name)] + s * step}) for s in (1, -1)]
    return (values[0] - values[1]) / (2 * step)


def defects(found: LegendreTransform, names: Sequence[str], point: Point) -> list[Any]:
    """|v(q, p) - v|, |p(q, v) - p| and |H(q, p) - (p v - L)| at a point."""
    known = {symbol: momentum(found.lagrangian, name, point) for symbol, name in zip(found.symbols, names, strict=True)}
    there = {**point, **known}
    rates = [point[Velocity(name)] for name in names]
    work = mp.fsum(p * v for p, v in zip(known.values(), rates, strict=True))
    energy = work - evaluate(found.lagrangian, point)
    pairs = [*zip(found.momenta, known.values(), strict=True), (found.hamiltonian, energy)]
    if found.velocities is not None:
        pairs += zip(found.velocities, rates, strict=True)
    return [abs(evaluate(a, there) - b) for a, b in pairs]


def determinant(lagrangian: Expression, names: Sequence[str]) -> Any:
    """det d2L/dv_i dv_j at a point, of a Lagrangian quadratic in v: by second differences, to 40 digits."""
    point = random_point([lagrangian, *map(Velocity, names)], random.Random(6), True)

    def value(shifts: Sequence[str]) -> Any:
        return evaluate(lagrangian, point | {Velocity(n): point[Velocity(n)] + shifts.count(n) for n in names})

    with mp.workdps(60):
        rows = [[value([a, b]) - value([a]) - value([b]) + value([]) for b in names] for a in names]
        found = mp.det(mp.matrix(rows))
        return 0 if abs(found) < mpf(10) ** -40 else found


def assert_right(found: LegendreTransform, names: Sequence[str], signed: bool = False, points: int = 3) -> None:
    """The defects vanish to 40 digits at some points at which L is real."""
    source = random.Random(4)
    left = points
    with mp.workdps(180):
        for _ in range(200):
            point = random_point([found.lagrangian, found.hamiltonian], source, signed)
            try:
                found_defects = defects(found, names, point)
            except NoRealValue:
                continue
            assert max(found_defects) < mpf(10) ** -40
            left -= 1
            if not left:
                return
    raise AssertionError("no real point was found")


def assert_equal_values(left: Expression, right: Expression) -> None:
    """The values agree to 40 digits at four points at which both are real, of signs as they come."""
    source, agreed = random.Random(5), 0
    with mp.workdps(60):
        for attempt in range(100):
            point = random_point([left, right], source, attempt % 2 == 1)
            try:
                values = [evaluate(left, point), evaluate(right, point)]
            except NoRealValue:
                continue
            assert abs(values[0] - values[1]) < mpf(10) ** -40
            agreed += 1
            if agreed == 4:
                return
    raise AssertionError("no real point was found")


CLOSED = {
    "free-particle": ("x'^2/2", "x", "", "p_x^2/2"),
    "oscillator": ("m*x'^2/2 - k*x^2/2", "x", "m k", "p_x^2/(2*m) + k*x^2/2"),
    "kepler": (
        "m/2*(r'^2 + r^2*th'^2) + k/r", "r th", "m k", "p_r^2/(2*m) + p_th^2/(2*m*r^2) - k/r",
    ),
    "double-pendulum": (
        "(m1+m2)*l1^2*a'^2/2 + m2*l2^2*b'^2/2 + m2*l1*l2*a'*b'*cos(a-b) + (m1+m2)*g*l1*cos(a) + m2*g*l2*cos(b)",
        "a b", "m1 m2 l1 l2 g",
        "(m2*l2^2*p_a^2 + (m1+m2)*l1^2*p_b^2 - 2*m2*l1*l2*p_a*p_b*cos(a-b))/(2*m2*l1^2*l2^2*(m1+m2*sin(a-b)^2))"
        "- (m1+m2)*g*l1*cos(a) - m2*g*l2*cos(b)",
    ),
    "magnetic": (
        "(x'^2+y'^2)/2 + B0/2*(x*y'-y*x')", "x y", "B0", "(p_x + B0*y/2)^2/2 + (p_y - B0*x/2)^2/2",
    ),
    "damped": ("exp(c*t)*(x'^2/2 - x^2/2)", "x", "c", "exp(-c*t)*p_x^2/2 + exp(c*t)*x^2/2"),
    "damped-kepler": (
        "exp(c*t)*((r'^2 + r^2*th'^2)/2 + 1/r)", "r th", "c",
        "exp(-c*t)*(p_r^2 + p_th^2/r^2)/2 - exp(c*t)/r",
    ),
    "hyperbolic": ("x'*y' - x*y", "x y", "", "p_x*p_y + x*y"),
    "relativistic": ("-m*sqrt(1 - x'^2 - y'^2) - x", "x y", "m", "sqrt(m^2 + p_x^2 + p_y^2) + x"),
    "relativistic-speed": (
        "-m*c^2*sqrt(1 - (x'^2+y'^2)/c^2) + x*y'", "x y", "m c", "sqrt(m^2*c^4 + c^2*(p_x^2 + (p_y-x)^2))",
    ),
    "shifted-root": ("-sqrt(1 - x'^2 - x*x')", "x", "", "sqrt((1 + x^2/4)*(1 + p_x^2)) + p_x*(-x/2)"),
    "logarithm": ("x'*log(x') - g*x", "x", "g", "exp(p_x - 1) + g*x"),
    "logarithms": ("x'*log(x') + x*y'*log(y')", "x y", "", "exp(p_x - 1) + x*exp(p_y/x - 1)"),
    "exponential": ("exp(x') + x*x' - x^2", "x", "", "(p_x-x)*log(p_x-x) - (p_x-x) + x^2"),
    "coupled-exponentials": (
        "exp(x') + 2*exp(x'+y')", "x y", "", "(p_x-p_y)*(log(p_x-p_y) - 1) + p_y*(log(p_y/2) - 1)",
    ),
    "modified-emden": ("1/(x' + x^2)", "x", "", ""),
    "quartic": ("x'^4/4 - x^2", "x", "", "3/4*(p_x^2)^(2/3) + x^2"),
    "shifted-quartic": ("(x' + x)^4", "x", "", "3*(p_x/4)^(4/3) - x*p_x"),
    "quartic-beside-quadratic": ("x'^2/2 + x'^4/4 - x^2", "x", "", ""),
    "radial-quartic": ("(x'^2+y'^2)/2 + (x'^2+y'^2)^2/4 - x*y", "x y", "", ""),
    "power-with-parameter": ("c*x'^k", "x", "c k", "(k-1)*c*(p_x/(c*k))^(k/(k-1))"),
    "log-of-velocity": ("log(x') + x", "x", "", "1 + log(p_x) - x"),
    "arctangent": ("(x'/x)*atan(x'/x) - log(x'^2+x^2)/2", "x", "", "log(x/cos(p_x*x))"),
    "cubic": ("x'^3/6 + x'^2/2", "x", "", "(2*p_x+1)^(3/2)/3 - p_x - 1/3"),
    "ratio-with-logarithm": ("w'^2/2 + w'*log(y'/w')", "w y", "", "(p_w + log(p_y) + 1)^2/2"),
    "routhian": (
        "w'*z' + exp(w)*(z*y'^2/w' + 2*x'*y'/w' - z'*y'^2/w'^2)/2", "w x y z", "", "",
    ),
    "complex-logarithm": ("x'*log(x'^2+y'^2)/2 - y'*atan(y'/x')", "x y", "", "exp(p_x - 1)*cos(p_y)"),
    "finsler-root": ("x'^2*sqrt(y'/x')", "x y", "", "4/9*sqrt(3*p_y*p_x^3)"),
    "cubic-in-a-root": ("x'^2/2 + x'^(3/2) + x", "x", "", ""),
    "product-of-squares": ("x*x'^2*y'^2/2", "x y", "", "3*x/(x^2)^(2/3)*(p_x^2*p_y^2)^(1/3)/2"),
    "root-beside-a-square": (
        "log(x' + sqrt(x'^2 + 1))/2 + sqrt(x'^2 + 1)*x'/2 + 3*x'^2/2 - x", "x", "", "",
    ),
    "cubic-of-a-quotient": ("log(1 + x'^2)/2 + x'^2", "x", "", ""),
    "nonholonomic-particle-third": (
        "x'^2/2 + (y'^2 - 2*x*y'*z' - z'^2)/(2*x'*sqrt(1+x^2))", "x y z", "",
        "(p_x + (p_y^2 - 2*x*p_y*p_z - p_z^2)/(2*sqrt(1+x^2)))^2/2",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOSED)
def test_the_hamiltonian_is_the_legendre_transform(name: str) -> None:
    text, coordinates, parameters, expected = CLOSED[name]
    names = coordinates.split()
    found = transform(text, coordinates, parameters)
    assert not found.implicit
    assert not any(isinstance(node, Velocity) for node in walk(found.hamiltonian))
    assert_right(found, names)
    if expected:
        assert_equal_values(found.hamiltonian, tree(expected, names, parameters, momenta=True))


@pytest.mark.parametrize(
    ("text", "coordinates", "parameters"),
    [
        ("t*log(x' + sqrt(x'^2 + 1))/2 + t*sqrt(x'^2 + 1)*x'/2 - a*x'^2/2", "x", "a"),
        ("x'^2/2 + x'*sqrt(x'^2 + y'^2)/2", "x y", ""),
        ("x*x'^2 + x*x'*sqrt(x'^2 + y'^2) + y^2*z'^2", "x y z", ""),
    ],
)
def test_a_square_root_beside_polynomials_has_an_inverse_where_its_conditions_hold(
    text: str, coordinates: str, parameters: str
) -> None:
    """p = A + B sqrt(S) leads to A^2 = B^2 S, of degree 2, or 3 for the quotient of velocities (degree 4 over u)."""
    names = coordinates.split()
    found = transform(text, coordinates, parameters)
    assert not found.implicit
    assert found.velocities is not None
    source, inside = random.Random(6), 0
    with mp.workdps(60):
        for _ in range(60):
            point = random_point([found.lagrangian, *map(Velocity, names)], source, signed=True)
            point.update({p: evaluate(tree, point) for p, tree in zip(found.symbols, found.momenta, strict=True)})
            try:
                holds = all(evaluate(condition, point) > 0 for condition in found.conditions)
            except NoRealValue:
                continue
            if holds:
                inside += 1
                for name, velocity in zip(names, found.velocities, strict=True):
                    assert abs(evaluate(velocity, point) - point[Velocity(name)]) < mpf(10) ** -40
    assert inside > 6


def test_a_function_known_by_its_derivative_may_stand_in_the_hamiltonian() -> None:
    """x'' = (x'^2/3 + 3) atan(x'/3): p = log(atan(x'/3))/3 has an inverse; H is F of that."""
    result = solve_document({"equations": {"x": "(x'^2/3 + 3)*atan(x'/3)"}}, SolveOptions())
    hamiltonian = result["hamiltonian"]
    assert not hamiltonian["implicit"]
    assert hamiltonian["text"] == "F(3*tan(exp(3*p_x))) - x/3"
    assert hamiltonian["momenta"] == {"p_x": "log(atan(x'/3))/3"}
    assert list(result["integrals"]) == ["F"]


SHORT = ["kepler", "magnetic", "relativistic", "logarithm", "quartic", "damped", "product-of-squares"]


@pytest.mark.parametrize("name", SHORT)
def test_the_hamiltonian_is_as_short_as_by_hand(name: str) -> None:
    text, coordinates, parameters, expected = CLOSED[name]
    by_hand = tree(expected, coordinates.split(), parameters, momenta=True)
    assert node_count(transform(text, coordinates, parameters).hamiltonian) <= node_count(by_hand) + 2


N_ROOT = "sqrt(I2 + I3*A(r1)^2 + I4*B(r1)^2)"
FIRST = f"I1*r1'^2/2 + {N_ROOT}/2*(C2*r2'^2/r1' + C3*s'^2/(A(r1)*r1') + C4*u'^2/(B(r1)*r1'))"
SECOND = "I1*r1'^2/2 + I2*r2'^2/2 + (a3*s'^2/(A(r1)*r1') + a4*u'^2/(B(r1)*r1'))/(2*N)"
PARAMETERS = "I1 I2 I3 I4 C2 C3 C4 a3 a4 N"
CONSTRAINTS = ("s' + A(r1)*r2'", "u' + B(r1)*r2'")


def generic_class(text: str) -> tuple[LegendreTransform, list[str], tuple[Expression, ...]]:
    names = ["r1", "r2", "s", "u"]
    found = transform(text, " ".join(names), PARAMETERS)
    constraints = [tree(constraint, names, PARAMETERS) for constraint in CONSTRAINTS]
    return found, names, constraint_images(constraints, found, names)


def test_the_first_lagrangian_of_the_generic_class_gives_the_papers_hamiltonian() -> None:
    found, names, images = generic_class(FIRST)
    by_hand = tree(
        f"(p_r1 + (p_r2^2/C2 + A(r1)*p_s^2/C3 + B(r1)*p_u^2/C4)/(2*{N_ROOT}))^2/(2*I1)", names, PARAMETERS, momenta=True
    )
    assert_equal_values(found.hamiltonian, by_hand)
    assert node_count(found.hamiltonian) < 2 * node_count(by_hand)
    assert found.note == ""
    assert_right(found, names, signed=True)
    assert [to_text(image) for image in images] == ["C2*p_s + C3*p_r2", "C2*p_u + C4*p_r2"]


def test_the_second_lagrangian_of_the_generic_class_gives_the_papers_hamiltonian() -> None:
    found, names, images = generic_class(SECOND)
    rate = "(p_r1 + N/2*(A(r1)*p_s^2/a3 + B(r1)*p_u^2/a4))/I1"
    by_hand = tree(f"p_r2^2/(2*I2) + I1/2*({rate})^2", names, PARAMETERS, momenta=True)
    assert_equal_values(found.hamiltonian, by_hand)
    assert node_count(found.hamiltonian) < 2 * node_count(by_hand)
    assert_right(found, names, signed=True)
    for image, (a, p) in zip(images, (("a3", "p_s"), ("a4", "p_u")), strict=True):
        expected = tree(f"I2*N*({rate})*{p} + {a}*p_r2", names, PARAMETERS, momenta=True)
        assert_equal_values(image, expected)
        assert node_count(image) < 2 * node_count(expected)


def test_the_third_associated_particle_keeps_a_momentum() -> None:
    names = ["x", "y", "z"]
    found = transform(CLOSED["nonholonomic-particle-third"][0], "x y z")
    images = constraint_images([tree("z' + x*y'", names)], found, names)
    assert images == (Symbol("p_z"),)


def test_constraints_of_an_implicit_transform_stay_in_the_velocities() -> None:
    found = transform("x'^2*sin(x') + y'^2", "x y")
    assert to_text(constraint_images([tree("y' - x*x'", ["x", "y"])], found, ["x", "y"])[0]).count("'") == 2


def test_an_identically_satisfied_constraint_has_a_zero_image() -> None:
    found = transform("x'^2 + y'^2", "x y")
    assert to_text(constraint_images([tree("x' - x'", ["x", "y"])], found, ["x", "y"])[0]) == "0"


@pytest.mark.parametrize("text", ["x'^2*sin(x')", "exp(sin(x'))", "x'^2*y'^4 + x'^4*log(y')"])
def test_what_cannot_be_solved_is_implicit_and_right(text: str) -> None:
    names = ["x", "y"] if "y" in text else ["x"]
    found = transform(text, " ".join(names))
    assert found.implicit
    assert found.velocities is None
    assert "could not be solved" in found.note
    assert_right(found, names)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y'^2/x'", "degree 1"),
        ("sqrt(x'^2 + y'^2)", "degree 1"),
        ("sqrt(x'^2 + y'^2) - x*y", "degenerate"),
        ("x'^2/2 + x*y' - y", "velocity of y"),
        ("(x' + y')^2", "degenerate"),
        ("x*y' - y*x'", "velocity of x, y"),
        ("x*y", "velocity of x, y"),
        ("0", "velocity of x, y"),
    ],
)
def test_a_degenerate_lagrangian_is_refused(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        transform(text, "x y")


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("x'^3/3", "x' > 0"),
        ("1/(x' + x^2)", "x^2 + x' > 0"),
        ("x'^2/2 - x'^4/12", "1 - x'^2 > 0"),
    ],
)
def test_a_multivalued_inverse_names_its_branch(text: str, condition: str) -> None:
    found = transform(text, "x")
    assert condition in found.note
    assert_right(found, ["x"])


def test_a_condition_on_parameters_is_named() -> None:
    assert transform("-m*sqrt(1 - x'^2)", "x", "m").note == "H is written for m > 0."
    assert transform("-2*sqrt(1 - x'^2)", "x").note == ""


def test_both_signs_of_an_odd_power_are_covered() -> None:
    found = transform("x'^4/4", "x")
    assert found.note == ""
    assert_right(found, ["x"], signed=True, points=8)


def test_momenta_whose_names_are_taken_get_others() -> None:
    found = transform("x'^2/2 + p_x'^2/2 + momentum_x*x", "x p_x", "momentum_x")
    assert found.symbols == (Symbol("momentum_x_2"), Symbol("p_p_x"))
    assert "momentum_x_2" in found.note
    assert_right(found, ["x", "p_x"], signed=True)


def test_no_real_point_is_said() -> None:
    found = transform("sqrt(-1 - x'^2)", "x")
    assert found.implicit
    assert "No real point" in found.note


def test_equal_calls_written_differently_are_the_same_function() -> None:
    names = ["r1", "r2"]
    found = transform("r1'^2*A(r1 + r2) + A(r2 + r1)*r2'^2", " ".join(names))
    assert not found.implicit


def test_a_wrong_claim_does_not_pass_the_self_check() -> None:
    from inverse_service.mechanics.legendre.points import Claim, judge, sample_points

    lagrangian, p = tree("x'^2/2", ["x"]), Symbol("p_x")
    points = sample_points([lagrangian])
    right: Mapping[str, Any] = {"names": ("x",), "momenta": {p: Velocity("x")}, "lagrangian": lagrangian}
    energy = tree("p_x^2/2", ["x"], momenta=True)
    assert judge(Claim(velocities=(p,), hamiltonian=energy, **right), [], points) is not None
    assert judge(Claim(velocities=(p,), hamiltonian=p, **right), [], points) is None
    wrong = tree("sqrt(p_x^2)", ["x"], momenta=True)
    assert judge(Claim(velocities=(wrong,), hamiltonian=energy, **right), [], points) is None
    judgment = judge(Claim(velocities=(wrong,), hamiltonian=energy, **right), [Velocity("x")], points)
    assert judgment is not None
    assert judgment.conditions == (Velocity("x"),)


ENTRIES = st.sampled_from(["0", "1", "-2", "x", "1 + y^2", "exp(x)", "cos(y)", "1/x", "m"])


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.lists(ENTRIES, min_size=6, max_size=6), st.lists(ENTRIES, min_size=3, max_size=3), st.integers(1, 3))
def test_the_hamiltonian_of_a_quadratic_lagrangian_is_p_v_minus_l(
    entries: list[str], linear: list[str], n: int
) -> None:
    names = ["x", "y", "z"][:n]
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i:]]
    terms = [f"({g})*{a}'*{b}'" for g, (a, b) in zip(entries, pairs, strict=False)]
    terms += [f"({g})*{a}'" for g, a in zip(linear, names, strict=False)]
    text = " + ".join([*terms, "x^2"]).replace("y^2", "x^4" if n == 1 else "y^2")
    text = text.replace("cos(y)", "cos(x)") if n == 1 else text
    try:
        found = transform(text, " ".join(names), "m")
    except InputError:
        assert determinant(tree(text, names, "m"), names) == 0
        return
    assert not found.implicit
    assert_right(found, names, signed=True, points=2)


def test_eight_coupled_coordinates_are_inverted() -> None:
    names = [f"q{k}" for k in range(8)]
    text = " + ".join(f"{k + 2}*q{k}'^2" for k in range(8)) + " + " + " + ".join(f"q{k}'*q{k + 1}'" for k in range(7))
    found = transform(text, " ".join(names))
    assert not found.implicit
    assert_right(found, names, signed=True, points=1)


def test_a_matrix_too_large_to_invert_is_implicit_and_soon_said() -> None:
    names = [f"q{k}" for k in range(6)]
    pairs = [(i, j) for i in range(6) for j in range(i, 6)]
    text = " + ".join(f"g{i}{j}*q{i}'*q{j}'" for i, j in pairs)
    found = transform(text, " ".join(names), " ".join(f"g{i}{j}" for i, j in pairs))
    assert found.implicit
    assert_right(found, names, points=1)


@pytest.mark.parametrize(
    ("lagrangian", "hamiltonian"),
    [
        (
            "((3*x+2*x'-sqrt(5)*x)*log(3*x+2*x'-sqrt(5)*x)-(3*x+2*x'+sqrt(5)*x)*log(3*x+2*x'+sqrt(5)*x))/(2*sqrt(5)*x)",
            "sqrt(5)*p_x*x/2 - 3*p_x*x/2 + log(2*sqrt(5)*x/(1 - exp(sqrt(5)*p_x*x)))",
        ),
        ("x'*log(x' + sqrt(x'^2 + 1)) - sqrt(x'^2 + 1)", "exp(-p_x)/2 + exp(p_x)/2"),
    ],
)
def test_logarithms_of_quotients_and_of_sums_with_a_root_are_undone(lagrangian: str, hamiltonian: str) -> None:
    found = legendre(parse(lagrangian, Names(("x",), (), {})), ("x",))
    assert not found.implicit
    assert to_text(found.hamiltonian) == hamiltonian


def test_the_root_of_a_quotient_of_squares_is_taken() -> None:
    lagrangian = parse("sin(b)*sqrt(a') + 25*cos(b)*b'^2/sqrt(a')", Names(("a", "b"), (), {}))
    found = legendre(lagrangian, ("a", "b"))
    assert to_text(found.hamiltonian) == "-(p_b^2 - 100*cos(b)*sin(b))^2/(40000*p_a*cos(b)^2)"


def test_a_small_box_has_points_to_check_h_at() -> None:
    names, box = Names(("x", "y"), ("E",), {}), ("x+27/20", "-x-21/20", "x'-1", "-x'+21/20", "y'+1/2", "-y'-2/5")
    lagrangian = parse("E*exp(x)-sqrt(1-exp(2*x)*x'^2-y'^2)", names)
    found = legendre(lagrangian, ("x", "y"), positive=[parse(text, names) for text in box])
    assert not found.implicit


SYMBOLIC = [
    # The damped oscillator with letters: its momentum is an arctangent once a root is put in (Musielak 2008).
    ("(l*x + 2*x')*atan((l*x + 2*x')/(x*sqrt(4*w^2-l^2)))/(x*sqrt(4*w^2-l^2)) - log(x'^2 + l*x*x' + w^2*x^2)/2", "cos"),
    ("(t*x' - x)^(-r + 2)/((-r + 1)*(-r + 2)*t^2) + w*x", "p_x"),
]


@pytest.mark.parametrize(("lagrangian", "holds"), SYMBOLIC, ids=["damped oscillator", "Clairaut"])
def test_letters_in_roots_and_exponents_do_not_hide_an_inverse(lagrangian: str, holds: str) -> None:
    found = legendre(parse(lagrangian, Names(("x",), ("l", "w", "r"), {})), ("x",))
    assert not found.implicit
    assert holds in to_text(found.hamiltonian)


def test_the_sign_of_one_velocity_says_nothing_about_another() -> None:
    """A metric of fourth roots (Matsumoto 1991): each momentum is a cube, of either sign."""
    found = legendre(parse("x'^4*exp(4*x) + y'^4*exp(4*x)", Names(("x", "y"), (), {})), ("x", "y"))
    assert not found.implicit
    assert found.note == ""


def test_a_sum_that_a_function_is_taken_of_is_one_quotient() -> None:
    """atan(1/a + 2 v/(a x)) is atan((x + 2 v)/(a x)), and a difference of squares keeps its sign."""
    found = transform("(l*x + 2*x')*atan((l*x + 2*x')/(a*x))/(a*x) - log(a^2*x^2 + (l*x + 2*x')^2)/2", "x", "l a")
    assert to_text(found.momenta[0]) == "2*atan((l*x + 2*x')/(a*x))/(a*x)"
    assert not found.implicit
    assert_right(found, ["x"])


CUBIC = [
    ("x'^2 + y'^3/x'", "x y"),
    ("x*x'^2 + y'^3/x'", "x y"),
    ("y'^2/2 + x'^2*y'/2", "x y"),
    ("x^2*log(x') + x'^3", "x"),
    ("x'^4/4 - x'^2/2", "x"),
    ("x'^4/4 - 3*x'^2/2 + x'^3/3", "x"),
    ("x'^(5/2) - x'^2*exp(x)", "x"),
    ("x'*log(x')^2", "x"),
]


@pytest.mark.parametrize(("text", "coordinates"), CUBIC)
def test_a_cubic_is_solved_on_the_branch_that_is_named(text: str, coordinates: str) -> None:
    names, source, left = coordinates.split(), random.Random(8), 4
    found = transform(text, coordinates)
    assert not found.implicit
    with mp.workdps(180):
        for _ in range(400):
            point = random_point([found.lagrangian, found.hamiltonian], source, True)
            try:
                there = point | {p: evaluate(tree, point) for p, tree in zip(found.symbols, found.momenta, strict=True)}
                inside = all(evaluate(condition, there) > 0 for condition in found.conditions)
                wrong = max(defects(found, names, point)) if inside else None
            except NoRealValue:
                continue
            assert wrong is None or wrong < mpf(10) ** -40
            left -= wrong is not None
    assert left <= 0


@pytest.mark.slow
def test_a_cubic_with_sums_for_coefficients_is_solved() -> None:
    """Its roots have thousands of nodes, which would take minutes to write shorter."""
    assert not transform("(1 - exp(-y)*y')*x'^2 + y'^2*(y^2 + 3)", "x y").implicit


def test_an_arctangent_beside_rational_parts_that_cancel_is_solved() -> None:
    """dp/dx' is a multiple of 1/(2 x'^2 + a x'^2 + b x' + c): the rest of p vanishes, and no collecting shows it."""
    root, inner = "sqrt(8*c + 4*a*c - b^2)", "(b*x^2 + 2*a*x' + 4*x')"
    text = f"{inner}*atan({inner}/(x^2*{root}))/(x^2*{root}) - log(2*x'^2 + a*x'^2 + b*x^2*x' + c*x^4)/2"
    assert not transform(text, "x", "a b c").implicit
