"""What could be read in two ways is refused or asked back, never taken in silence (bug reports of readers)."""

from __future__ import annotations

import re
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import parse_document, solve_document
from inverse_service.service.scenes.simulating import run_document


def refused(document: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        parse_document(document)
    return caught.value


def guess(equations: str) -> dict[str, Any]:
    return {"equations": equations, "parameters": "guess"}


@pytest.mark.parametrize(
    "equations",
    [
        r"\ddot\varphi = -\phi",
        r"\ddot\theta = -\vartheta",
        "\u03b8'' = -\u03d1",
        "\u03c6'' = -\u03d5",
        r"\ddot x = -\epsilon x - \varepsilon x^3",
        r"\ddot x = -\ell x - l x^3",
    ],
)
def test_letters_that_look_alike_are_not_merged(equations: str) -> None:
    assert "look alike" in refused(guess(equations)).detail


def test_letters_that_look_alike_differ_where_both_are_declared() -> None:
    both = {"equations": r"\ddot x = -\epsilon x - \varepsilon x^3", "parameters": ["epsilon", "varepsilon"]}
    assert parse_document(both)["equations"]["x"]["text"] == "-epsilon*x - varepsilon*x^3"
    unicode_letters = {"equations": "\u03c6'' = -\u03d5", "coordinates": ["phi"], "parameters": ["varphi"]}
    assert parse_document(unicode_letters)["equations"]["phi"]["text"] == "-varphi"


def test_one_way_to_write_a_letter_is_the_declared_one() -> None:
    assert parse_document({"equations": r"\ddot\varphi = -\varphi"})["coordinates"] == ["phi"]
    assert parse_document({"coordinates": ["phi"], "equations": r"\ddot\varphi = -\varphi"})["coordinates"] == ["phi"]


@pytest.mark.parametrize(
    "equations",
    [
        r"\ddot{\mathbf r} = -\mathbf r/r^3",
        r"m\ddot{\mathbf{r}} = q\dot{\mathbf r}\times\mathbf B",
        r"\ddot x = -\boldsymbol k x",
        r"\ddot x = -\mathbf K\mathbf x",
        r"\ddot x = -\mathcal L L x",
        r"\ddot{\vec x} = -\vec x",
        r"\ddot x = -\mathbf B B x",
    ],
)
def test_vectors_and_script_letters_are_refused(equations: str) -> None:
    assert "not accepted" in (found := refused(guess(equations)).detail) or "occurs" in found


@pytest.mark.parametrize(
    "constraints",
    [["z' = 1,5*x'"], ["z' - 0,5*y*x' = 0"], ["z' - 0, 5*y*x' = 0"], "z' = 1,5*x'", "z' - 0,5*y*x' = 0"],
)
def test_a_decimal_comma_in_a_constraint_is_refused(constraints: Any) -> None:
    given = {"lagrangian": "(x'^2 + y'^2 + z'^2)/2", "coordinates": ["x", "y", "z"], "constraints": constraints}
    assert "comma" in refused(given).detail


@pytest.mark.parametrize(
    "equations",
    ["x'' = -9,81", ["x'' = -9,81"], {"x": "-9,81"}, "x'' = -0,5*x; y'' = 1", "x'' = log(1,5*x)", "x'' = -1,000*x"],
)
def test_a_decimal_comma_in_an_equation_is_refused(equations: Any) -> None:
    assert "comma" in refused({"equations": equations}).detail


@pytest.mark.parametrize(
    "equations", ["x'' = e*B*y'/m; y'' = 0", "x'' = -E*x", "x'' = -e^2/x^2", r"\ddot x = -e^{2} x"]
)
def test_euler_s_number_is_only_the_base_of_a_power(equations: str) -> None:
    assert "Euler" in refused({"equations": equations, "parameters": ["B", "m"]}).detail


def test_e_is_a_name_where_it_is_declared() -> None:
    found = parse_document({"equations": "x'' = -e^2/x^2 + exp(-x)", "parameters": ["e"]})
    assert found["equations"]["x"]["text"] == "-e^2/x^2 + exp(-x)"
    assert parse_document({"equations": "x'' = e^-x + e^x + E**(2*x)"})["parameters"] == []


@pytest.mark.parametrize(
    "formula", ["sqrt 2 x", "\u221a2x", "\u221a2 x", r"2\ln 2\, x", r"\sin 2\, x", "log 2 x", "sqrt 2x", "cbrt 3x"]
)
def test_where_a_bare_argument_ends_is_asked(formula: str) -> None:
    assert "not clear" in refused({"equations": {"x": formula}}).detail


@pytest.mark.parametrize(
    ("equations", "name", "meant"),
    [
        ("x'' = -kx", "kx", "k*x"),
        ("x'' = -x + cos(wt)", "wt", "w*t"),
        ("x'' = -sinx", "sinx", "sin(x)"),
        ("x'' = -sinkx", "sinkx", "sin(k*x)"),
        ("x'' = -dx", "dx", "x'"),
        ("x'' = -k*x - m*kmx", "kmx", "k*m*x"),
        ("x'' = -cost", "cost", "cos(t)"),
        ("x'' = -2*kt", "kt", "k*t"),
    ],
)
def test_a_name_that_may_be_a_product_is_asked_back(equations: str, name: str, meant: str) -> None:
    error = refused(guess(equations))
    assert name in error.detail
    assert meant in error.instead
    declared = parse_document({"equations": equations, "parameters": ["...", name, "k", "w"]})
    assert name in declared["parameters"]


@pytest.mark.parametrize(
    "equations",
    ["x'' = -mu*x/r^3; y'' = -mu*y/r^3", "y'' = 2y^3 + x*y", "y'' = -y + s", "x'' = -x + tau*k", "x'' = q_2"],
)
@pytest.mark.parametrize("parameters", ["guess", ["mu", "k"]])
def test_what_looks_like_a_variable_is_no_constant(equations: str, parameters: Any) -> None:
    error = refused({"equations": equations, "parameters": parameters})
    assert "independent variable" in error.detail
    assert error.instead == ("t",)


def test_what_was_guessed_is_listed() -> None:
    found = parse_document(guess("m x'' = -k x - mu x^3 + V'(x) - x_0"))
    assert (found["parameters"], found["functions"]) == (["m", "k", "mu", "x_0"], {"V": ["x"]})
    assert found["guessed"] == ["m", "k", "mu", "x_0", "V"]
    assert parse_document({"equations": "x'' = -k*x", "parameters": ["k"]})["guessed"] == []
    assert parse_document({"equations": "x'' = -k*x - c*x'", "parameters": {"k": "2", "...": None}})["guessed"] == ["c"]


def test_two_spellings_of_a_guessed_name_are_asked_back() -> None:
    assert "k1 occurs too" in refused(guess("x'' = -k1*x - k_1*x^3")).detail


def test_nothing_is_guessed_unless_asked() -> None:
    assert "not declared" in refused({"equations": "x'' = -k*x"}).detail


def test_coordinates_of_a_lagrangian_are_found_in_it() -> None:
    given = {"lagrangian": "m*(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' - y*x'"], "parameters": "guess"}
    found = parse_document(given)
    assert (found["coordinates"], found["guessed"]) == (["x", "y", "z"], ["m"])


def test_dots_over_two_letters_are_not_one_name() -> None:
    assert "dot" in refused({"equations": "\u1e8b\u1e8f = 1"}).detail
    assert parse_document({"equations": "x\u0308 = -x; y\u0308\u2081 = x\u0307"})["coordinates"] == ["x", "y1"]


@pytest.mark.parametrize(
    ("document", "fragment"),
    [
        ({"equations": "x_1'' = -x_1", "parameters": ["x1"]}, "x1 is declared as a parameter"),
        ({"equations": r"\ddot\varphi = -\varphi", "parameters": ["phi"]}, "phi is declared as a parameter"),
        ({"equations": "x'' = -k", "parameters": ["x", "k"]}, "x is declared as a parameter"),
        ({"equations": "y_xx = -y"}, "write y''(x) for a second derivative"),
        ({"equations": "x'' = -x/r^3; y'' = -y/r^3; r = sqrt(x^2 + y^2)"}, '"where": {"r": "…"}'),
        ({"equations": ["x'' = -k*x", "k = 3"], "parameters": "guess"}, '"where": {"k": "…"}'),
        ({"equations": "L = x'^2/2 - x^2/2"}, '"lagrangian"'),
        ({"equations": "x'' = -V_x", "functions": {"V": ["x"]}}, "did you mean diff(V(x), x)?"),
        (
            {"equations": "x'' = -V_xy; y'' = 0", "functions": {"V": ["x", "y"]}, "parameters": "guess"},
            "diff(V(x, y), x, y)",
        ),
        ({"equations": r"\ddot x = -V_{,x}", "functions": {"V": ["x"]}}, "write diff(V(x), x)"),
        ({"equations": r"\ddot x = -\partial_x V", "functions": {"V": ["x"]}}, "write diff(A(x, y), x)"),
        (guess("x''[t] == -I x[t]"), "imaginary unit"),
        (guess("Eq(x(t).diff(t, 2), -I*x(t))"), "imaginary unit"),
        (guess(r"\ddot x = -x^T x"), "a raised T"),
        (guess(r"\ddot x = -x^{T} x"), "a raised T"),
        (guess(r"\ddot x = -\Delta x"), "write Delta*x"),
        ({"equations": "x'' = -x//2"}, "write /"),
        ({"equations": "x'' = -1_000*x"}, "write 1000"),
        ({"equations": "x'' = -diff(V, x)", "parameters": ["V"]}, "a derivative of the constant V"),
        ({"equations": r"\ddot x = -\frac{dV}{dx}", "parameters": ["V"]}, "a derivative of the constant V"),
        ({"equations": "x'' = diff(1/r, r)", "where": {"r": "1 + x^2"}}, "a derivative by r occurs"),
        ({"equations": "x'' = -w'", "where": {"w": "x^2"}}, "write diff(w, t)"),
        ({"equations": "x'' = F", "where": {"F": "G", "G": "U", "U": "G"}}, "G leads back to G"),
        ({"equations": {"x": "m*x'' + k*x"}, "parameters": "guess"}, "write whole equations"),
    ],
)
def test_a_habit_of_another_notation_gets_the_right_advice(document: dict[str, Any], fragment: str) -> None:
    assert fragment in refused(document).detail


@pytest.mark.parametrize(
    ("document", "f"),
    [
        (guess("I*theta'' = -k*theta"), "-k*theta/I"),
        ({"equations": "x''[t] == -I x[t]", "parameters": ["I"]}, "-I*x"),
        (guess(r"\ddot x + \delta \dot x + x = 0"), "-delta*x' - x"),
        ({"equations": r"\ddot x = -\Delta x", "parameters": ["Delta"]}, "-Delta*x"),
        ({"equations": "x_ddot = -x"}, "-x"),
        ({"equations": "x'' +\n x = 0"}, "-x"),
        ({"equations": "th'' = -sin(th)*sh", "parameters": ["sh"]}, "-sin(th)*sh"),
        ({"equations": "x'' = -th(x)"}, "-tanh(x)"),
    ],
)
def test_the_advice_stops_nobody_who_means_it(document: dict[str, Any], f: str) -> None:
    assert [formula["text"] for formula in parse_document(document)["equations"].values()] == [f]


@pytest.mark.parametrize(
    ("equations", "meant"),
    [
        ("x'' = -diff(V, x)", "diff(V(x), x)"),
        ("x''[t] == -D[V, x]", "diff(V(x), x)"),
        ("x'' = -dV/dx; y'' = -dV/dy", "diff(V(x, y), x)"),
        ("x'' = -\u2202V/\u2202x", "V'(x) or diff(V(x), x)"),
        ("x'' = -V_x", "diff(V(x), x)"),
        (r"\ddot x = -\frac{dV(2x)}{dx}", r"\frac{d}{dx}\left("),
        ("x'' = -|v| v", "did you mean x'?"),
        ("\u0398'' = -\u03b8", "did you mean Theta?"),
        ("x'' = 0x10*x", "decimal digits"),
        ("x'' = 2j*x", "complex numbers"),
    ],
)
def test_what_no_writer_means_as_a_constant_is_asked_back(equations: str, meant: str) -> None:
    assert meant in refused(guess(equations)).detail


@pytest.mark.parametrize(
    ("equations", "chosen"),
    [
        ("x'' = -dV/dx - x", "x'' = -diff(V(x), x) - x"),
        ("x'' = -(dV / dx)/m", "x'' = -(diff(V(x), x))/m"),
        ("x'' = -d^2V/dx^2*3", "x'' = -diff(V(x), x, x)*3"),
        ("x'' = -\u2202V/\u2202x", "x'' = -diff(V(x), x)"),
        ("x'' = -diff(V, x)", "x'' = -diff(V(x), x)"),
        ("x''[t] == -D[V, x]", "x''[t] == -D[V(x), x]"),
        ("x'' = -V_x", "x'' = -diff(V(x), x)"),
    ],
)
def test_the_slope_that_is_offered_stands_in_the_place_of_the_whole_quotient(equations: str, chosen: str) -> None:
    error = refused(guess(equations))
    assert error.column is not None
    name = re.match(r"\w+", equations[error.column - 1 :])
    start, end = error.span or (error.column, error.column + len(name[0] if name else ""))
    assert equations[: start - 1] + error.instead[0] + equations[end - 1 :] == chosen
    assert parse_document(guess(chosen))["equations"]["x"]["text"]


@pytest.mark.parametrize(
    "equations", ["x'' = -dV(x)/dx", "x''[t] == -V'[x[t]]", "Eq(x(t).diff(t, 2), -Derivative(V(x(t)), x(t)))"]
)
def test_a_potential_with_its_argument_is_guessed(equations: str) -> None:
    found = parse_document(guess(equations))
    assert (found["equations"]["x"]["text"], found["guessed"]) == ("-V'(x)", ["V"])


def test_names_that_are_declared_are_not_asked_back() -> None:
    found = parse_document({"equations": "x'' = -v*dV/dx - V_x*x", "parameters": ["v", "dV", "dx", "V_x"]})
    assert found["equations"]["x"]["text"] == "-v*dV/dx - V_x*x"


@pytest.mark.parametrize(
    ("equations", "parameters", "f"),
    [
        ("x'' = -arch*x - tgh", ["arch", "tgh"], "-arch*x - tgh"),
        ("x'' = -sqr*x - velocity*time", ["sqr", "velocity", "time"], "-sqr*x - velocity*time"),
        ("x'' = -x (a)", ["a"], "-x*a"),
        ("x'' = -x10*j", ["x10", "j"], "-x10*j"),
        ("x'' = -k (x)", ["k"], "-k*x"),
        ("(2)*x'' = -x", [], "-x/2"),
    ],
)
def test_what_is_declared_is_no_word_no_label_and_no_remark(equations: str, parameters: list[str], f: str) -> None:
    found = parse_document({"equations": equations, "parameters": parameters})
    assert found["equations"]["x"]["text"] == f


@pytest.mark.parametrize(
    ("equations", "where", "f"),
    [
        ("x'' = -diff(V, x)", {"V": "x^4/4"}, "-x^3"),
        ("x'' = -dV/dx", {"V": "x^4/4"}, "-x^3"),
        ("x'' = -\u2202V/\u2202x", {"V": "x^4/4"}, "-x^3"),
        (r"\ddot x = -\frac{\partial V}{\partial x}", {"V": "x^4/4"}, "-x^3"),
        ("x'' = -diff(w, t)", {"w": "x^2"}, "-2*x*x'"),
        ("x'' = -dw/dt", {"w": "x^2"}, "-2*x*x'"),
        (r"\ddot x = -\frac{dw}{dt}", {"w": "x^2"}, "-2*x*x'"),
        ("d/dt(m*x') = 0", {"m": "exp(2*x)"}, "-2*x'^2"),
        ("x'' = F", {"F": "-diff(V, x)", "V": "a^2", "a": "x^2/2"}, "-x^3"),
        ("x' = p; p' = -diff(V, x)", {"V": "x^4/4"}, "-x^3"),
    ],
)
def test_the_derivative_of_a_name_is_that_of_its_formula(equations: str, where: dict[str, str], f: str) -> None:
    """A name of "where" is no constant, in whatever order the formulas stand."""
    assert parse_document({"equations": equations, "where": where})["equations"]["x"]["text"] == f


def test_the_rate_of_a_name_stands_in_lagrangian_and_constraint() -> None:
    given = {"coordinates": ["x", "y"], "where": {"V": "x^4", "w": "y - x^2"}}
    forward = solve_document({"lagrangian": "x'^2/2 + y'^2/2 - V + diff(V, t)", **given}, SolveOptions())
    assert forward["equations"]["x"]["text"] == "-4*x^3"
    speed = {"coordinates": ["x"], "where": {"v": "x'", "V": "x^4"}}
    rate = solve_document({"lagrangian": "v^2/2 - V", **speed}, SolveOptions())
    assert rate["equations"]["x"]["text"] == "-4*x^3"
    second = {"lagrangian": "x'^2/2 + a", "coordinates": ["x"], "where": {"a": "x''"}}
    assert "the acceleration x''" in refused(second).detail
    rolling = {"lagrangian": "x'^2/2 + y'^2/2", "constraints": ["dw/dt = 0"], "associated": "first", **given}
    assert "y' - 2*x*x'" in str(parse_document(rolling))


@pytest.mark.parametrize(
    ("equations", "time", "name", "meant"),
    [
        ("x'' = -x_t", None, "x_t", "x'"),
        (r"\ddot x = -k x_{t}", None, "x_t", "x'"),
        ("x'' = -x_tt", None, "x_tt", "x''"),
        ("y'' = -kx", "x", "kx", "k*x"),
        ("y''(x) = -wxy(x)", None, "wxy", "w*x*y"),
        ({"y": "-omegax"}, "x", "omegax", "omega*x"),
        ("y'' = -y_x", "x", "y_x", "y'"),
        (r"\ddot y = -k y_x", "x", "y_x", "y'"),
        (r"\ddot\theta = -\theta_\tau", "tau", "theta_tau", "theta'"),
    ],
)
def test_a_name_with_the_time_in_it_is_asked_back(equations: Any, time: str | None, name: str, meant: str) -> None:
    document = {"equations": equations, "parameters": "guess"} | ({"time": time} if time else {})
    error = refused(document)
    assert f"'{name}' is not declared" in error.detail
    assert error.instead == (meant,)
    assert error.pointer.startswith("/equations")


def test_a_scene_asks_back_in_the_words_of_its_system() -> None:
    scene = {"system": {"equations": "x''(s) = -x - x_s"}, "step": 0.1, "steps": 9, "methods": [{"method": "adaptive"}]}
    with pytest.raises(InputError) as caught:
        run_document({**scene, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}}, None, 60)
    assert "'x_s' is not declared" in caught.value.detail


def test_declared_names_with_the_time_in_them_come_back_as_they_were() -> None:
    document = {"equations": "y'' = -k_x*y - k_t*kx", "parameters": ["k_x", "k_t", "kx"], "time": "x"}
    result = solve_document(document, SolveOptions())
    assert result["system"]["equations"] == {"y": "-k_x*y - k_t*kx"}
    assert result["lagrangian"]["text"] == "y'^2/2 - k_x*y^2/2 - k_t*kx*y"
    assert check_plain(result)["verdict"] == "valid"


@pytest.mark.parametrize("asked", ["k [x]", "k[x]", "k (x)", "k (x(t))"])
def test_a_bracket_that_may_hold_an_argument_is_asked_back_with_both_readings(asked: str) -> None:
    error = refused(guess(f"x'' = -{asked} - x^3"))
    assert error.instead == ("k*(x)", "k(x)")
    assert error.span == (8, 8 + len(asked))


@pytest.mark.parametrize("bullet", ["- ", "\u2013 "])
def test_a_list_of_equations_with_dashes_before_them_is_asked_back(bullet: str) -> None:
    """-x'' = -x would be x'' = x."""
    assert "may be a bullet" in refused(guess(f"{bullet}x'' = -x\n{bullet}y'' = -y")).detail
    meant = parse_document(guess(f"{bullet}x'' = -x;\ny'' = -y"))["equations"]
    assert {name: formula["text"] for name, formula in meant.items()} == {"x": "x", "y": "-y"}


@pytest.mark.parametrize("force", ["-diff(V(t, y), t)*y", "-diff(V(t, y), y, t)", "-diff(V(y, t), t)"])
def test_a_derivative_by_t_of_a_function_of_t_and_more_is_asked_back(force: str) -> None:
    """It is V_t to some and V_t + V_y y' to others; of a function of t alone it is both."""
    arguments = ["y", "t"] if "(y, t)" in force else ["t", "y"]
    with pytest.raises(InputError, match=r"write V\[(1,0\]\(t, y|0,1\]\(y, t)\) for the partial one"):
        solve_document({"equations": {"y": force}, "functions": {"V": arguments}}, SolveOptions())
    plain = solve_document({"equations": {"y": "-diff(f(t), t)*y"}, "functions": {"f": ["t"]}}, SolveOptions())
    assert plain["system"]["equations"] == {"y": "-f'(t)*y"}
