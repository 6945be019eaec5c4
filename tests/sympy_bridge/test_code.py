"""Code in other languages agrees numerically with SymPy; it is run if its tool is installed."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

import inverse_service
from inverse_service import catalogue
from inverse_service.cli.solve_command import PROOFS, Format
from inverse_service.errors import InputError
from inverse_service.sympy import Result, from_result, solve
from inverse_service.sympy.code import LANGUAGES, QUANTITIES, WHOLE, program
from inverse_service.web.pages.result_tasks import EXPORTS
from tests.values import slow

t, k = sp.symbols("t k")
r, phi = sp.Function("r")(t), sp.Function("phi")(t)
VALUES = (0.3, 1.2, 0.4, 0.1, 0.7, 1.5)  # t, r, phi, and their velocities or momenta, k


@pytest.fixture(scope="module")
def kepler() -> Result:
    force = r * sp.exp(-(r**2)) + sp.sin(r) * sp.cos(r)
    return solve(
        [
            r.diff(t, 2) - r * phi.diff(t) ** 2 + k * force,
            phi.diff(t, 2) + 2 * r.diff(t) * phi.diff(t) / r,
        ]
    )


def expected(found: Result) -> list[float]:
    numbers: list[float] = []
    for what in QUANTITIES:
        value = found.lambdify(what, "math")(*VALUES) if what != "multiplier" else None
        matrix = [] if value is not None else [found.multiplier.subs(r, VALUES[1])]
        numbers += [float(each) for part in matrix for each in part]
        numbers += (
            []
            if value is None
            else [float(each) for each in (value if isinstance(value, list) else [value])]
        )
    return numbers


def run(command: list[str], folder: Path) -> list[float]:
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=folder, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return [float(word) for word in done.stdout.split()]


def sizes(found: Result) -> dict[str, int]:
    return {"accelerations": 2, "lagrangian": 1, "momenta": 2, "hamiltonian": 1, "multiplier": 4}


def test_a_hamiltonian_without_momenta_takes_the_velocities() -> None:
    """p = log(x') + x' + 1 has no inverse in closed form: H(t, x, x') is x' p - L."""
    found = solve("x'' = -x/(1 + 1/x')")
    assert found.hamiltonian is not None
    assert found.hamiltonian.implicit
    at = (0.0, 0.3, 0.5)
    (momentum,) = found.lambdify("momenta")(*at)
    energy = at[2] * momentum - found.lambdify("lagrangian")(*at)
    assert found.lambdify("hamiltonian")(*at) == pytest.approx(energy)


ARGUMENTS = ", ".join(map(str, VALUES))


@pytest.mark.slow
def test_python_code_gives_the_numbers(kepler: Result, tmp_path: Path) -> None:
    show = "print(*(value if isinstance(value, list) else [value]))"
    lines = [f"value = {what}({ARGUMENTS})\n{show}" for what in QUANTITIES]
    (tmp_path / "system.py").write_text(kepler.to_code("python") + "\n" + "\n".join(lines))
    assert run([sys.executable, "system.py"], tmp_path) == pytest.approx(expected(kepler))


@pytest.mark.slow
@pytest.mark.parametrize(("language", "ending"), [("c", "c"), ("cpp", "cpp")])
def test_c_code_gives_the_numbers(
    kepler: Result, tmp_path: Path, language: str, ending: str
) -> None:
    compiler = shutil.which("gcc" if language == "c" else "g++")
    if compiler is None:
        pytest.skip("no compiler")
    calls = [
        f'{what}(out, {ARGUMENTS}); for (int i = 0; i < {size}; i++) printf("%.17g ", out[i]);'
        for what, size in sizes(kepler).items()
    ]
    start = "int main(void) { double out[4]; "
    main = (
        "#include <stdio.h>\n" + kepler.to_code(language) + start + " ".join(calls) + " return 0; }"
    )
    (tmp_path / f"system.{ending}").write_text(main)
    subprocess.run([compiler, f"system.{ending}", "-o", "system", "-lm"], cwd=tmp_path, check=True)
    assert run(["./system"], tmp_path) == pytest.approx(expected(kepler))


def test_javascript_gives_the_numbers(kepler: Result, tmp_path: Path) -> None:
    if shutil.which("node") is None:
        pytest.skip("no node")
    calls = [f"console.log([{what}({ARGUMENTS})].flat().join(' '));" for what in QUANTITIES]
    (tmp_path / "system.js").write_text(kepler.to_code("javascript") + "\n".join(calls))
    assert run(["node", "system.js"], tmp_path) == pytest.approx(expected(kepler))


@pytest.mark.slow
def test_rust_gives_the_numbers(kepler: Result, tmp_path: Path) -> None:
    if shutil.which("rustc") is None:
        pytest.skip("no rustc")
    arguments = ", ".join(f"{value}f64" for value in VALUES)
    calls = [f'for v in {what}({arguments}) {{ println!("{{}}", v); }}' for what in QUANTITIES]
    (tmp_path / "system.rs").write_text(
        kepler.to_code("rust") + "fn main() { " + " ".join(calls) + " }"
    )
    subprocess.run(["rustc", "-A", "warnings", "system.rs"], cwd=tmp_path, check=True)
    assert run(["./system"], tmp_path) == pytest.approx(expected(kepler))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["sho", "knife-edge-second", "free-particle-linear-drag", "generic-class-one-second"]
)
def test_the_sympy_program_shows_that_the_euler_lagrange_equations_hold(
    name: str, tmp_path: Path
) -> None:
    import inverse_service

    program = inverse_service.solve(catalogue.document(name)).to_code("sympy")
    assert "L = " in program
    (tmp_path / "system.py").write_text(program)
    done = subprocess.run(
        [sys.executable, "system.py"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.stderr == ""
    assert set(done.stdout) <= set("[0, ]\n")


@pytest.mark.parametrize("language", sorted(LANGUAGES))
def test_every_language_has_every_quantity(kepler: Result, language: str) -> None:
    text = kepler.to_code(language)
    assert all(what in text for what in QUANTITIES)
    assert "Not supported" not in text


def test_every_language_is_on_the_command_line_and_on_the_page() -> None:
    assert {*Format} - {"json", "text", "latex", *PROOFS} == {*LANGUAGES, *WHOLE}
    assert {*EXPORTS} - {"latex", "client", "curl", "embed"} == {*LANGUAGES, *WHOLE}


def test_names_that_a_language_keeps_for_itself_are_changed() -> None:
    x, word = sp.Function("x")(t), sp.Symbol("lambda")
    found = solve({x: -word * x})
    assert "lambda_" in found.to_code("python")
    compile(found.to_code("python"), "code", "exec")
    compile(found.to_code("sympy"), "code", "exec")
    assert "xdot" in solve({x: -x.diff(t)}).to_code("mathematica")


def test_words_of_c_are_no_variables_of_its_programs() -> None:
    """`double double` does not compile, and pow(x, 2) is not a call if pow is a number."""
    found = solve("double'' = -int*double - pow*double^3", parameters=["int", "pow"])
    program = found.to_code("c")
    assert "double t, double double_, double double_dot, double int_, double pow_)" in program
    assert "pow(double_, 3)*pow_" in program


@pytest.fixture(scope="module")
def named_like_words() -> Result:
    words = ["out", "Math", "math", "lagrangian", "function", "end"]
    return solve(
        "x'' = -out*x - Math*math*sin(x); y'' = -out*y - lagrangian*function*end", parameters=words
    )


@pytest.mark.parametrize("language", ["python", "c", "fortran", "javascript", "julia", "octave"])
def test_words_of_a_language_and_of_the_program_itself_are_no_variables(
    language: str, named_like_words: Result
) -> None:
    """out(1) = -out*x changes the out of out(2) = -out*y; `end` and `function` are keywords."""
    program = named_like_words.to_code(language)
    assert re.search(
        r"out_, (double )?Math_, (double )?math__, (double )?lagrangian_, (double )?function_,",
        program,
    )
    assert "end_*function_" in program.replace(" .* ", "*").replace(".*", "*")


def test_a_word_is_changed_without_an_underscore_where_that_is_a_pattern() -> None:
    assert "int0_" in solve("x'' = -int*x", parameters=["int"]).to_code("mathematica")


def test_maxima_reads_what_is_written_for_it() -> None:
    """x'' = -pi e^x/3: powers with ^, constants with %, statements of a block with commas."""
    x = sp.Function("x")(t)
    text = solve({x: -sp.pi * sp.exp(x) * x.diff(t) ** 2 / 3}).to_code("maxima")
    assert "accelerations(t, x, x_dot) := block([dummy],\n  -%e^x*%pi*x_dot^2/3\n)$" in text


@pytest.mark.slow
def test_fortran_has_short_lines_and_pi_is_a_number_in_it() -> None:
    equations = [
        f"spring_number_{k}'' = -9^30*pi*stiffness_number_{k}*spring_number_{k}" for k in range(8)
    ]
    text = inverse_service.solve({"equations": equations, "parameters": "guess"}).to_code("fortran")
    assert max(map(len, text.splitlines())) <= 132
    assert "parameter" not in text
    assert "3.14159" in text
    assert "4.2391158275216204d+28" in text, "Fortran has no integers of more than 32 bits"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "comment"), [("octave", "% "), ("jax", "# "), ("modelingtoolkit", "# ")]
)
def test_an_integral_without_a_formula_leaves_its_quantity_out_and_says_so(
    language: str, comment: str
) -> None:
    found = inverse_service.solve("x'' = -exp(-x^2)*x^x")
    text = found.to_code(language)
    for what in ("lagrangian", "hamiltonian"):
        assert f"{comment}{what} is left out: F is an integral" in text
    assert "F(" not in text
    assert found.to_code("sympy").count("F(x(t))") > 0


def test_an_expression_without_code_is_rejected() -> None:
    x, V = sp.Function("x")(t), sp.Function("V")
    with pytest.raises(InputError, match="arbitrary functions"):
        solve({x: -V(x)}).to_code("c")
    with pytest.raises(InputError, match="languages are"):
        from_result(solve({x: -x})).to_code("cobol")


def formulas(count: int, seed: int) -> list[sp.Expr]:
    """Random formulas of a and b that are real in each part and of moderate size at the point."""
    maker = random.Random(seed)
    a, b = sp.symbols("a b", real=True)
    functions = [
        sp.sin,
        sp.cos,
        sp.tan,
        sp.exp,
        sp.log,
        sp.sqrt,
        sp.atan,
        sp.asin,
        sp.sinh,
        sp.cosh,
        sp.tanh,
        sp.sign,
    ]
    exponents = [2, 3, -1, -2, sp.Rational(1, 2), sp.Rational(-3, 2), sp.Rational(1, 3), a, -b]

    def tree(depth: int) -> sp.Expr:
        kind = maker.random()
        if depth == 0 or kind < 0.1:
            return maker.choice(
                [a, b, sp.pi, sp.E, sp.Rational(maker.randint(-9, 9), maker.choice((1, 2, 3, 7)))]
            )
        if kind < 0.65:
            return maker.choice([sp.Add, sp.Mul])(
                *(tree(depth - 1) for _ in range(maker.randint(2, 3)))
            )
        if kind < 0.8:
            return tree(depth - 1) ** maker.choice(exponents)
        return maker.choice([*functions, sp.Abs])(tree(depth - 1))

    found: list[sp.Expr] = []
    while len(found) < count:
        formula = tree(4)
        values = [
            each.subs({a: POINT[0], b: POINT[1]}).evalf(12)
            for each in sp.preorder_traversal(formula)
        ]
        if (
            formula.free_symbols
            and all(value.is_real for value in values)
            and 1e-6 < abs(values[0]) < 1e6
        ):
            found.append(formula)
    return found


POINT = (sp.Rational(5, 16), sp.Rational(11, 8))
FEW, MANY = 20, 1000


def languages_agree(language: str, found: list[sp.Expr], folder: Path) -> None:
    """Run the formulas in this language and compare with SymPy's numbers."""
    printed = [LANGUAGES[language].printed(each) for each in found]
    a, b = (float(each) for each in POINT)
    match language:
        case "python":
            text = f"import math\na, b = {a}, {b}\n" + "\n".join(
                f"print({each})" for each in printed
            )
            (folder / "all.py").write_text(text)
            command = [sys.executable, "all.py"]
        case "javascript":
            text = f"const a = {a}, b = {b};\n" + "\n".join(
                f"console.log({each});" for each in printed
            )
            (folder / "all.js").write_text(text)
            command = ["node", "all.js"]
        case "c" | "cpp":
            body = "\n".join(f'printf("%.17g\\n", (double)({each}));' for each in printed)
            text = f"{LANGUAGES[language].start}#include <stdio.h>\nint main(void) {{ double a = {a}, b = {b};\n{body} }}"
            (folder / f"all.{language}").write_text(text)
            compiler = ["gcc"] if language == "c" else ["g++", "-std=c++17"]
            subprocess.run(
                [*compiler, f"all.{language}", "-o", "all", "-lm"], cwd=folder, check=True
            )
            command = ["./all"]
        case "fortran":
            body = "\n".join(f"print *, {each}" for each in printed)
            text = f"program all\ndouble precision :: a = {a}d0, b = {b}d0\n{body}\nend program\n"
            (folder / "all.f90").write_text(text)
            subprocess.run(["gfortran", "all.f90", "-o", "all"], cwd=folder, check=True)
            command = ["./all"]
        case "octave":
            text = f"a = {a}; b = {b};\n" + "\n".join(
                f"printf('%.17g\\n', real({each}));" for each in printed
            )
            (folder / "all.m").write_text(text)
            command = ["octave", "--no-gui", "--quiet", "all.m"]
        case _:
            body = "\n".join(f'println!("{{}}", {each});' for each in printed)
            (folder / "all.rs").write_text(
                f"fn main() {{ let a: f64 = {a}_f64; let b: f64 = {b}_f64;\n{body} }}"
            )
            subprocess.run(
                ["rustc", "-A", "warnings", "all.rs", "-o", "all"], cwd=folder, check=True
            )
            command = ["./all"]
    values = dict(zip(sp.symbols("a b", real=True), POINT, strict=True))
    assert run(command, folder) == pytest.approx(
        [float(each.subs(values).evalf(25)) for each in found], rel=1e-7
    )


TOOLS = {"python": sys.executable, "javascript": "node", "c": "gcc", "cpp": "g++", "rust": "rustc",
         "fortran": "gfortran", "octave": "octave"}  # fmt: skip
SLOW = [slow(each) for each in ("rust", "fortran", "octave")]


@pytest.mark.parametrize(
    "language",
    [
        "c",
        *(slow(each) for each in ("python", "javascript", "rust", "fortran", "octave")),
    ],
)
def test_random_formulas_have_the_value_that_sympy_gives(language: str, tmp_path: Path) -> None:
    if shutil.which(TOOLS[language]) is None:
        pytest.skip(f"no {language}")
    languages_agree(language, formulas(FEW, 1), tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("language", sorted(TOOLS))
def test_a_thousand_random_formulas_have_the_value_that_sympy_gives(
    language: str, tmp_path: Path
) -> None:
    if shutil.which(TOOLS[language]) is None:
        pytest.skip(f"no {language}")
    languages_agree(language, formulas(MANY, 2), tmp_path)


@pytest.fixture(scope="module")
def one_sided() -> inverse_service.Result:
    return inverse_service.solve("x'' = -x*Heaviside(x)")


@pytest.mark.parametrize("language", [*LANGUAGES, "sympy"])
def test_a_program_says_where_its_lagrangian_is_one(
    language: str, one_sided: inverse_service.Result
) -> None:
    text = one_sided.to_code(language)
    assert text.count("where x > 0") == (2 if language == "sympy" else 4)
    assert language == "sympy" or "eaviside" not in text
    assert "Abs(" not in text


def test_a_program_says_where_its_energy_is_one() -> None:
    """L = 1/x' + 2 x of x'' = x'^3 has p = -1/x'^2 and H = -2 sqrt(-p) - 2 x where x' > 0."""
    found = inverse_service.solve({"equations": "x'' = x'^3", "time_dependent_lagrangian": False})
    assert found["hamiltonian"]["domain"] == ["x' > 0", "p_x < 0"]
    for language in LANGUAGES:
        text = program(found, language)
        assert text.count("where x' > 0") == text.count("where p_x < 0") == 1, language


def test_a_step_is_computed_as_what_it_is_on_either_side() -> None:
    space: dict[str, Any] = {}
    exec(inverse_service.solve("x'' = -3*x*Heaviside(x)").to_code("python"), space)
    assert [space["accelerations"](0, x, 0) for x in (-2.0, 2.0)] == [0.0, -6.0]


def test_branches_are_answers_of_their_own() -> None:
    mixed = inverse_service.solve({"equations": "x'' = Heaviside(x)*(x^2 + y^2); y'' = 0"})
    verdicts = {str(branch.domain): branch.is_variational for branch in mixed.branches}
    assert verdicts == {"(x(t) > 0,)": False, "(x(t) < 0,)": True}
    assert mixed.is_variational is None
    assert repr(mixed).endswith("; 1 more in branches, which differ)")
    both = inverse_service.solve("x'' = -Heaviside(x)")
    assert both.is_variational is True
    x = sp.Function("x")(t)
    assert [sp.expand(branch.lagrangian - x.diff(t) ** 2 / 2) for branch in both.branches] == [
        -x,
        0,
    ]
    assert both.to_latex().count(r"\text{where") == 2
    assert "where x &lt; 0" in both._repr_html_()
    (only,) = inverse_service.solve("x'' = -x").branches
    assert only.is_variational is True
