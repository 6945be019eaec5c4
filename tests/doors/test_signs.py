"""Rules about whole statements look at signs, whose spans are those of the text."""

import re
from pathlib import Path

import pytest

import inverse_service
from inverse_service.reading import own_functions, signs
from inverse_service.reading.rules import (
    actions,
    definitions,
    dependences,
    differential_forms,
    distributions,
    energies,
    lagrange_equations,
    lagrangians,
    lengths,
    line_ends,
    metrics,
    motion,
    sequences,
    vector_fields,
    vectors,
)
from inverse_service.reading.typed_text import Typed

ROOT = Path(inverse_service.__file__).parent
# A rule, a text, and what the rule finds first in it.
ROWS = {
    "letter": (lagrangians.LETTER_L, r"so \mathcal {L} = T", r"\mathcal {L}"),
    "number": (lagrangians.NUMBERED_L, "L2: m*diff(x, t)^2/2", "L2:"),
    "short": (lagrangians.ABBREVIATED, "K.E. = m*v^2/2", "K.E."),
    "velocity": (lagrangians.BY_VELOCITY, "D[D[la, s'[t]], t]", "D[la, s'"),
    "prime": (lagrangians.PRIMED_L, r"L' = m\dot{x}^2/2", "L'"),
    "energy": (energies.ENERGY, r"E_{kin} = m x'^2/2", "E_{kin} ="),
    "energies": (energies.ENERGIES, "T - V_{g} = m x'^2/2", "T - V_{g} ="),
    "metric": (metrics.METRIC, r"d\,s^{2} = dr^2", r"d\,s^{2}"),
    "differential": (metrics.DIFFERENTIAL, r"r^2 d\phi_1^2", r"d\phi_1"),
    "equation": (
        lagrange_equations.EQUATION,
        "L = x'^2; d/dt(dL/dx') - dL/dx = 0",
        "d/dt(dL/dx') - dL/dx = 0",
    ),
    "variation": (
        lagrange_equations.EQUATION,
        r"L = x'^2, \delta \int L\,dt = 0",
        r"\delta \int L\,dt = 0",
    ),
    "rate": (
        lagrange_equations.OF_RATE,
        r"\frac{d}{dt}\frac{\partial L}{\partial \dot{q}_1} = 0",
        r"\frac{d}{dt}\frac{\partial L}{\partial \dot{q}_1}",
    ),
    "zero": (definitions.ZERO, "f = x^2 + y^2 - 1 = 0", "f = x^2 + y^2 - 1"),
    "definition": (definitions.DEFINED, r"r_{\,0}^2 = x^2 + y^2", r"r_{\,0}^2 ="),
    "action": (actions.ACTION, r"S[q] = \int_{t_1}^{t_2} L\,dt", r"S[q] = \int_{t_1}^{t_2}"),
    "measure": (actions.MEASURE, "x'^2 dt", "dt"),
    "slope": (actions.SLOPE_BELOW, "u_{x}^2/2", "u_{x}"),
    "set": (distributions.SET, "in D_q = {v : z' = y x'}.", "D_q = {v : z' = y x'}"),
    "kernel": (
        distributions.KERNEL,
        r"\Delta = \ker\{dz - (y)dx\}. L",
        r"\Delta = \ker\{dz - (y)dx\}",
    ),
    "index": (distributions.NUMBERED, r"x; \omega^{1} = dz - y dx", r"\omega^{1}"),
    "vector": (
        vectors.VECTOR,
        r"\mathbf{r} = \left(x, y\right)",
        r"\mathbf{r} = \left(x, y\right)",
    ),
    "matrix": (vectors.MATRIX, "L = x', M = [[2, 0], [0, 1]]", "M = [[2, 0], [0, 1]]"),
    "square": (
        vectors.SQUARE,
        r"\dot{\mathbf r}^2 = \dot r^2; L = 1",
        r"\dot{\mathbf r}^2 = \dot r^2",
    ),
    "span": (vector_fields.SPAN, "D = span{∂_x + y ∂_z, ∂_y}", "D = span{∂_x + y ∂_z, ∂_y}"),
    "field": (
        vector_fields.FIELD,
        r"y \frac{\partial}{\partial z}",
        r"\frac{\partial}{\partial z}",
    ),
    "remark": (line_ends.REMARK, "m x'^2/2 (kinetic energy)", "(kinetic energy)"),
}


@pytest.mark.parametrize("name", ROWS)
def test_what_a_rule_finds_is_where_it_was_typed(name: str) -> None:
    rule, text, found = ROWS[name]
    first = sequences.first(rule, text)
    assert first is not None
    start, stop = first.span
    assert (first.text, text[start:stop]) == (found, found)


@pytest.mark.parametrize(("text", "begun"), [("dphi^2", 1), (r"d \phi^2", 2), ("2 dr dt", 3)])
def test_a_part_may_begin_inside_a_sign(text: str, begun: int) -> None:
    found = sequences.first(metrics.DIFFERENTIAL, text)
    assert found is not None
    assert found.parts["name"].span.start == begun


def test_what_is_put_in_knows_where_the_rest_was_typed() -> None:
    given = Typed.of(r"\mathcal{L} = x'^2", "/equations")
    text = sequences.changed(given, lagrangians.LETTER_L, lambda _: "L")
    assert text.text == "L = x'^2"
    assert [column for _, column in text.places[:3]] == [1, 12, 13]


@pytest.mark.parametrize("text", ["", " ", "\\", "{{{", "¶", "\\boxed", "\u0308\u0308"])
def test_no_text_is_too_wrong_to_have_signs(text: str) -> None:
    for rule, _, _ in ROWS.values():
        assert [*sequences.find(rule, text)] == []
    assert signs.frames(text, "\\boxed") == []
    assert [*own_functions.changes(text)] == []
    asked = (motion.moves, motion.accelerates, differential_forms.has_form, lengths.is_value)
    assert not any(is_so(text) for is_so in asked)


def test_what_does_not_hold_leaves_no_part() -> None:
    """A part of a choice that fails later is forgotten."""
    rule = sequences.either(
        sequences.then(sequences.part("one", sequences.one("x")), "y"),
        sequences.then(sequences.part("other", sequences.one("x")), "z"),
    )
    found = sequences.first(rule, "a x z")
    assert found is not None
    assert {*found.parts} == {"other"}


@pytest.mark.parametrize(
    ("text", "left"),
    [
        (r"\boxed{L = x'^2}", "L = x'^2"),
        (r"\boxed{\boxed{L} = \frac{1}{2}}; 1", r"L = \frac{1}{2}; 1"),
        (r"\boxed{L = 1", r"\boxed{L = 1"),
        (r"\boxed L}", r"\boxed L}"),
    ],
)
def test_a_frame_is_taken_off(text: str, left: str) -> None:
    assert lagrangians.unframed(Typed.of(text, "")).text == left


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("V[x_] := k x^2/2; V[y]", "V(x) = k x^2/2; V[y]"),
        ("U[x_, y_1_] = x; U[1, 2]", "U(x, y_1) = x; U[1, 2]"),
        ("x[t_] := l Sin[a[t]]; x'[t] x[t] ax[t]", "x = l Sin[a[t]]; x' x ax[t]"),
        ("syms x dx ddx m\nL = m*dx^2 - dxx", "syms x x' ddx m\nL = m*x'^2 - dxx"),
        ("f[x_] == 3; 2V[x_] = 1", "f[x_] == 3; 2V[x_] = 1"),
    ],
)
def test_own_functions_of_programs_are_read_as_usual_ones(text: str, found: str) -> None:
    """The signs of syms stay: what moves is found behind them."""
    given = Typed.of(text, "")
    expected = found.replace("syms x x' ddx", "syms x dx ddx")
    assert given.put(own_functions.changes(text)).text == expected


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("u'' + 2/r u' = 0, where u_1 = u_1(r)", [("where u_1 = u_1(r)", "r", True)]),
        ("u'' = -u\nu = u(x) + 1", [("u = u(x)", "x", False)]),
        ("u'' = -u; u = u (x)", []),  # a product
        ("u'' = u(x); v = u(x)", []),
    ],
)
def test_a_function_is_said_to_depend_on_its_argument(
    text: str, found: list[tuple[str, str, bool]]
) -> None:
    said = dependences.said(text)
    assert [(text[slice(*one.span)], one.argument, one.is_whole) for one in said] == found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("syms y(x) m; z(t)", {"y": "x"}),
        ("@variables y_1(x) y_2( x )\nf(t)", {"y_1": "x", "y_2": "x"}),
        ("y = sp.Function('y')(x)", {"y": "x"}),
        ('y = function("y", x)', {"y": "x"}),
        ("Function('y', real=True)", {}),
        ("y = Function('y'", {}),
    ],
)
def test_programs_declare_functions_with_their_arguments(text: str, found: dict[str, str]) -> None:
    assert {one.name: one.argument for one in dependences.declared(text)} == found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (r"\omega^1 = dz - y dx, \omega^2 = dy - dx", ["1", "2"]),
        ("\u03c9\u00b9 := cos(a) dx", ["\u00b9"]),
        (r"\omega^2 = k/m, \ddot x = -\omega^2 x", []),
        (r"\omega^2 = k/m \\ \frac{d^2 x}{dt^2} = -\omega^2 x", []),
        ("omega^2 = k/m and dx = 3", []),
        ("x\u00b2 = y dx", []),
    ],
)
def test_a_power_is_no_index_of_a_form(text: str, found: list[str]) -> None:
    indices = [text[slice(*span)].lstrip("^") for span in distributions.indices(text)]
    assert indices == found


def test_a_rule_is_no_expression_over_characters() -> None:
    """One kind of statement is one file, whose rules are made of signs."""
    files = [*(ROOT / "reading" / "rules").glob("*.py"), ROOT / "reading" / "own_functions.py"]
    documents = ROOT / "service" / "documents"
    files += [documents / "lagrangian_texts.py", documents / "renaming.py"]
    assert len(files) > len(ROWS) // 2
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"^import re$|\bpattern\(", text, re.MULTILINE), file.name


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a = b", ["a ", " b"]),
        (r"\sum_{i=1}^{2} x_i = 0", [r"\sum_{i=1}^{2} x_i ", " 0"]),
        ("V(x = 1) = k = 2", ["V(x = 1) ", " k ", " 2"]),
        (") = 1", [") ", " 1"]),
        ("=", ["", ""]),
        ("", [""]),
    ],
)
def test_sides_are_what_stands_between_the_equals_signs_outside_brackets(
    text: str, parts: list[str]
) -> None:
    typed = Typed.of(text, "/equations")
    assert [side.text for side in signs.sides(typed)] == parts
    left, right = signs.halves(typed)
    assert (left.text, right.text) == (parts[0], "=".join(parts[1:]))
    assert all(text[side.places[0][1] - 1 :].startswith(side.text) for side in signs.sides(typed))


@pytest.mark.parametrize(
    ("text", "after", "first", "begun"),
    [
        (r"{\dot x} = v", 0, "x}", "{"),
        (r"a = 1; {\dot x} = v", 6, "x}", "{"),
        ("a = 1; Eq(x', v)", 6, "x'", " Eq"),
        ("x' = (v)", 0, "x'", "x'"),
        ("} = {", 0, "=", "="),
    ],
)
def test_an_equation_begins_where_the_brackets_open_that_it_closes(
    text: str, after: int, first: str, begun: str
) -> None:
    place = signs.beginning(Typed.of(text, ""), after, text.index(first), len(text))
    assert text[place:].startswith(begun)
