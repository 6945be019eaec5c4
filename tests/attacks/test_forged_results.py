"""A result with an unproven claim is not valid, or the check lists the field as not compared."""

from __future__ import annotations

import copy
import functools
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.certificate import checker
from inverse_service.service.documents import canonical, comparison
from tests.values import slow

Document = dict[str, Any]
DOCUMENTS: dict[str, Document] = {
    "oscillator": {"equations": {"x": "-x"}},
    "pair": {"equations": {"x": "-x", "y": "-2*y"}},
    "coupled": {"equations": {"x": "-x+y", "y": "x/2-y"}},
    "van der Pol": {"equations": {"x": "-x-(x^2-1)*x'"}},
    "sides": {"equations": {"x": "abs(x)*y'-y^2", "y": "-x*x'-2*x*y"}},
    "none": {"equations": {"x": "-x-x'^2*y", "y": "-y+x'*y'"}},
    "damped": {"equations": {"x": "-x-c*x'"}, "parameters": ["c"]},
    "damped pair": {"equations": {"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"}},
    "Kepler": {"equations": {"x": "-x/sqrt(x^2+y^2)^3", "y": "-y/sqrt(x^2+y^2)^3"}},
    "kinds": {"equations": {"x": "-x", "y": "-y"}, "kinds": ["natural", "riemannian"]},
    "clock": {"equations": {"x": "-x*y'^2", "y": "-x'*y'"}, "clock": "exp(x)"},
    "particle": {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2)/2",
        "constraints": ["z'-y*x'"],
        "associated": "second",
    },
    "knife edge": {
        "coordinates": ["phi", "x", "y"],
        "lagrangian": "(phi'^2+x'^2+y'^2)/2",
        "constraints": ["y'-tan(phi)*x'"],
        "associated": "third",
    },
    "small set": {
        "equations": {"x": "sqrt((x^2-1/10^20)^2)*y'-y^2", "y": "-(x^2-1/10^20)*x'-2*x*y"}
    },
}
CHEAP = ("oscillator", "none")


@functools.cache
def answered(name: str) -> str:
    return json.dumps(dict(solve(DOCUMENTS[name])))


def result_of(name: str) -> Document:
    """Without the list of answers: a forger writes it as it follows from the fields that are
    changed.
    """
    found: Document = json.loads(answered(name))
    return {key: value for key, value in found.items() if key != "answers"}


def is_caught(found: Document, place: str) -> bool:
    """Whether the check rejects the result or lists the field as not compared."""
    named = any(
        f"{place}/".startswith(f"{one}/") or one.startswith(f"{place}/")
        for one in found["not_checked"]
    )
    return found["verdict"] != "valid" or named


@pytest.mark.parametrize("name", [name if name in CHEAP else slow(name)
                                  for name in DOCUMENTS])  # fmt: skip
def test_an_honest_result_is_valid_and_stated(name: str) -> None:
    result = result_of(name)
    found = check(result)
    assert found["verdict"] == "valid", found["reasons"]
    assert found["statement"]["verdict"] == result["verdict"]
    assert found["contradictions"] == []


def test_a_lagrangian_that_is_wrong_on_a_ball_holds_nowhere_without_that_border() -> None:
    """w > 0 everywhere except on a unit ball of the phase space."""
    result = result_of("pair")
    w = "((x-2)^2+(y-2)^2+(x'-2)^2+(y'-2)^2-1)"
    text = f"x'^2/2+y'^2/2-x^2/2-y^2+x^3*(sqrt({w}^2)-{w})"
    near = {"x": "1/2", "y": "1/3", "x'": "1/5", "y'": "1/7", "t": "0"}
    result["certificate"] |= {
        "lagrangian": text,
        "near": near,
        "roots": [{"root": f"sqrt({w}^2)", "is": w}],
    }
    result["lagrangian"] |= {"text": text, "domain": []}
    result |= {"hamiltonian": None, "domain": [], "near": near}
    found = check(result)
    assert found["verdict"] == "incomplete"
    assert any("lacks" in reason for reason in found["reasons"])


def emptied(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            key: [] if key in ("domain", "conditions") else emptied(part)
            for key, part in value.items()
        }
    return [emptied(part) for part in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_a_small_set_without_a_lagrangian_is_not_everywhere() -> None:
    result = result_of("small set")
    assert result["verdict"] == "differs"
    assert (
        check({**emptied(result), "verdict": "variational", "branches": []})["verdict"] != "valid"
    )


@pytest.mark.parametrize("name", [slow("van der Pol"), "none"])
def test_a_hamiltonian_needs_a_proven_lagrangian(name: str) -> None:
    result = result_of(name)
    energy = {"text": "p_x^2/2 + x^2/2", "latex": "", "momenta": {"p_x": "x'"}, "implicit": False}
    if result["lagrangian"] is None:
        assert check(result | {"hamiltonian": energy})["verdict"] == "invalid"


def test_the_image_of_the_constraints_is_compared() -> None:
    result = result_of("particle")
    assert result["hamiltonian"]["constraints"]
    assert "/hamiltonian/constraints" not in check(result)["not_checked"]
    result["hamiltonian"]["constraints"] = ["p_x = 17"]
    assert check(result)["verdict"] == "invalid"


def test_a_repeated_case_hides_no_other_case() -> None:
    result = result_of("sides")
    first = next(one for one in result["branches"] if one["verdict"] == "variational")
    other = json.loads(json.dumps(first).replace("x > 0", "x > 1"))
    for one in (other, other["certificate"]):
        one.pop("near", None)
    assert check(result | first | {"branches": [first, other]})["verdict"] != "valid"
    assert check(result | first | {"branches": [first]})["verdict"] != "valid"


@pytest.mark.parametrize("kind", ["parameters", "reduced", "time", "rayleigh"])
def test_the_alternative_is_never_trusted(kind: str) -> None:
    result = result_of("none")
    del result["system"]["given"]
    instead = {"kind": kind, "conditions": ["k = 1"], "equations": {"x": "0", "y": "0"}, "certificate": {},
               "lagrangian": {"text": "x'^2/2+y'^2/2", "domain": []}, "checked": "valid"}  # fmt: skip
    assert check(result | {"instead": instead})["verdict"] != "valid"


@pytest.mark.slow
def test_the_kind_of_what_is_there_instead_is_one_of_four() -> None:
    result = json.loads(json.dumps(dict(solve("x'' = -g*x*y; y'' = -x'^2"))))
    assert result["instead"]["kind"] == "parameters"
    assert check(result)["verdict"] == "valid"
    twins = [
        ("instead", result["instead"] | {"kind": kind}) for kind in ("time1", "reduced", "rayleigh")
    ]
    twins += [
        (key, dict.fromkeys(result[key], "false")) for key in ("guessed", "exceptions")
    ]  # no lists
    for key, part in twins:
        assert is_caught(check(result | {key: part}), f"/{key}"), (key, part)


FRICTION = {"text": "x'^2", "latex": "\\dot{x}^{2}"}
# False claims by their places; the first place is that of the statement.
STATEMENTS: dict[str, tuple[str, Document]] = {
    "momenta that are exchanged": ("coupled", {"/hamiltonian/momenta": {"p_y": "x'/2", "p_x": "y'"},
                                               "/hamiltonian/text": "p_y^2+p_x^2/2+x^2/4+y^2/2-x*y/2"}),
    "velocities in an energy": ("oscillator", {"/hamiltonian/text": "p_x^2/2+x^2/2+(p_x-x')*x^7"}),
    "velocities for momenta": ("oscillator", {"/hamiltonian/text": "p_x^2+x^2/2-x'^2/2"}),
    "an energy with time": ("oscillator", {"/hamiltonian/text": "p_x^2/2+x^2/2+t"}),
    "an energy on a half": ("oscillator", {"/hamiltonian/text": "p_x^2/2+x^2/2+asin(sin(p_x))-p_x"}),
    "an energy of a kind": ("kinds", {"/kinds/natural/hamiltonian": {"text": "17", "momenta": {"p_x": "x'"}}}),
    "friction that is not proven": ("oscillator", {"/dissipation": FRICTION, "/certificate/dissipation": "x'^2"}),
    "friction of a kind without": ("kinds", {"/kinds/natural/dissipation": FRICTION,
                                             "/kinds/natural/certificate/dissipation": "x'^2"}),
    "a Lagrangian beside rows": ("none", {"/certificate/lagrangian": "x'^2"}),
    "a name that nobody reads": ("oscillator", {"/certificate/system/proof": "by hand"}),
    "a reduced system without one": ("none", {"/instead": {"kind": "reduced"}}),
    "a reduced system for itself": ("none", {"/instead": {"kind": "reduced", "lagrangian": FRICTION},
                                             "/reduced": {"lagrangian": FRICTION}, "/system/given": None}),
    "a motion without a border": ("particle", {"/any_associated/lagrangian/domain": []}),
    "another constraint": ("particle", {"/system/given/constraints": ["z'-2*y*x'"]}),
    "other masses": ("particle", {"/system/given/lagrangian": "(x'^2+y'^2+2*z'^2)/2"}),
    "another associated system": ("knife edge", {"/system/given/associated": "first"}),
    "a value of a parameter": ("damped", {"/system/given/parameters": {"c": "3"}}),
    "a tiny force": ("oscillator", {"/system/given/equations/x": "-x+x^3/10^40"}),
    "another clock": ("clock", {"/with_clock/factor": "exp(2*x)"}),
    "another clock that was asked for": ("clock", {"/system/given/clock": "exp(2*x)"}),
    "one verdict of two": ("sides", {"/verdict": "variational", "/verdict_with_time": "variational"}),
    "no cells": ("sides", {"/branches": [], "/verdict": "variational", "/verdict_with_time": "variational"}),
    "a cell with a gap": ("sides", {"/branches/1/domain": ["x < -1"]}),
}  # fmt: skip


@pytest.mark.parametrize("what", [what if name in CHEAP else slow(what)
                                  for what, (name, _) in STATEMENTS.items()])  # fmt: skip
def test_a_false_statement_is_found_or_named(what: str) -> None:
    name, changes = STATEMENTS[what]
    twin = result_of(name)
    for place, value in changes.items():
        *way, last = (int(step) if step.isdigit() else step for step in place.split("/")[1:])
        functools.reduce(lambda holder, step: holder[step], way, twin)[last] = value
    assert is_caught(check(twin), next(iter(changes)))


@pytest.mark.parametrize(
    "key", ["domain", "lagrangian", "hamiltonian", "with_time", "clock", "kind"]
)
def test_an_answer_without_a_key_or_with_another_one_is_found(key: str) -> None:
    """What people are shown first has the domain, and is about the question, of its field."""
    whole = json.loads(answered("oscillator"))
    first = whole["answers"][0]
    if key in first:
        del first[key]
    else:
        first[key] = "natural"
    assert check(whole)["verdict"] == "invalid"


def test_an_energy_is_stated_where_it_was_proven() -> None:
    result = result_of("oscillator")
    assert check(result)["statement"]["hamiltonian_domain"] == []
    result["hamiltonian"]["text"] += "+x^3*(atan(p_x)+atan(1/p_x)-pi/2)"
    found = check(result)
    assert "/hamiltonian/domain" in found["not_checked"]
    assert "hamiltonian_domain" not in found["statement"]
    assert "at least on an open part" in found["statement"]["text"]


@pytest.mark.parametrize("name", ["damped", slow("coupled"), slow("Kepler")])
def test_a_multiplier_that_is_not_the_second_derivative_of_l_is_refused(name: str) -> None:
    result = result_of(name)
    assert not [place for place in check(result)["not_checked"] if "multiplier" in place]
    answer = result["with_time"] or result
    answer["multiplier"] = [[f"2*({entry})" for entry in row] for row in answer["multiplier"]]
    (found,) = check(result)["contradictions"]
    assert found["field"].endswith("/multiplier")


@pytest.mark.parametrize(
    ("name", "lacks"), [slow("damped", "x != 0"), ("Kepler", "lacks x^2 + y^2 > 0")]
)
def test_an_energy_that_is_said_to_hold_everywhere_lacks_its_domain(name: str, lacks: str) -> None:
    result = result_of(name)
    assert "/hamiltonian/domain" not in check(result)["not_checked"]
    result["hamiltonian"]["domain"] = []
    found = check(result)
    assert (found["verdict"], lacks in found["reasons"][0]) == ("incomplete", True)


# --- forgeries of twenty kinds: each changes the places of its key
Forgery = Callable[[Any], Any]


def longer(text: Any) -> Any:
    return f"{text} + 1" if isinstance(text, str) else text


def in_text(part: Any, pattern: str) -> Any:
    """A formula inserted into another one, with or without its LaTeX."""
    if isinstance(part, dict):
        return {**part, "text": pattern.format(part["text"])}
    return part and pattern.format(part)


FORGERIES: dict[str, tuple[str, Forgery]] = {
    "another verdict": ("verdict", lambda v: {"variational": "not_variational"}.get(v, "variational")),
    "another verdict with time": ("verdict_with_time", lambda v: "not_variational" if v != "not_variational" else 0),
    "a longer Lagrangian": ("lagrangian", lambda v: in_text(v, "({}) + x^3")),
    "no Lagrangian": ("lagrangian", lambda v: None if v else {"text": "x'^2", "latex": "", "domain": []}),
    "half the energy": ("hamiltonian", lambda v: in_text(v, "({})/2")),
    "an implicit energy": ("hamiltonian", lambda v: v and {**v, "implicit": not v["implicit"]}),
    "momenta of another": ("momenta", lambda v: {k: longer(t) for k, t in v.items()}),
    "an energy everywhere": ("hamiltonian", lambda v: v and {**v, "domain": ["p_x > 10^9"]}),
    "a wider domain": ("domain", lambda v: [f"{t} - 10^9" if ">" in t else t for t in v][:-1]),
    "another domain": ("domain", lambda v: ["x > 7"]),
    "another point": ("near", lambda v: dict.fromkeys(v, "12345")),
    "an unchecked proof": ("checked", lambda v: "incomplete" if v else v),
    "no proof": ("certificate", lambda v: None),
    "another claim": ("claim", lambda v: "variational" if v == "not_variational" else "not_variational"),
    "another question": ("question", lambda v: {"L(q, q')": "L(t, q, q')", "autonomous": "both"}.get(v, "L(q, q')")),
    "other equations": ("equations", lambda v: {k: longer(t) for k, t in v.items()}),
    "another order": ("coordinates", lambda v: [*reversed(v), "w"]),
    "a parameter more": ("parameters", lambda v: [*v, "k"] if isinstance(v, list) else v),
    "another format": ("format", lambda v: f"{v}0"),
    "fewer rows": ("rows", lambda v: v[:1]),
    "other dimensions": ("dimensions", lambda v: [k + 1 for k in v]),
    "another matrix": ("multiplier", lambda v: v and [["0"] * len(row) for row in v]),
    "invented integrals": ("integrals", lambda v: {"F": {"arguments": ["t"], "derivatives": {"t": "t"}}}),
    "another LaTeX": ("latex", lambda v: "0" if isinstance(v, str) else dict.fromkeys(v, "0")),
    "a note": ("reason", lambda v: f"{v} It was proven by hand."),
}  # fmt: skip


def places(value: Any, key: str, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, dict):
        for name, part in value.items():
            if name == key:
                yield (*at, name)
            yield from places(part, key, (*at, name))
    elif isinstance(value, list):
        for k, part in enumerate(value):
            yield from places(part, key, (*at, k))


def put(result: Document, way: tuple[Any, ...], change: Forgery) -> tuple[Document, bool]:
    twin = copy.deepcopy(result)
    holder: Any = twin
    for step in way[:-1]:
        holder = holder[step]
    before = copy.deepcopy(holder[way[-1]])
    holder[way[-1]] = change(before)
    return twin, holder[way[-1]] != before


HIDDEN = (
    "explanation",
    "conditions",
    "provenance",
    "advice",
    "other_lagrangians",
    "steps",
    "solution_space",
)


def forged(name: str, kind: str) -> Iterator[tuple[str, Document]]:
    key, change = FORGERIES[kind]
    result = result_of(name)
    for way in places(result, key):
        # A proof is also valid at other points of its cell.
        if not {*way} & {*HIDDEN} and not (key == "near" and "certificate" in way):
            twin, changed = put(result, way, change)
            if changed:
                yield "/" + "/".join(map(str, way)), twin


@pytest.mark.parametrize("kind", [slow(kind) if number % 3 else kind
                                  for number, kind in enumerate(FORGERIES)])  # fmt: skip
@pytest.mark.parametrize("name", ["sides", slow("none"),
                                  *(slow(name) for name in DOCUMENTS
                                    if name not in ("sides", "none"))])  # fmt: skip
def test_a_forged_field_is_found_or_named(name: str, kind: str) -> None:
    for place, twin in forged(name, kind):
        assert is_caught(check(twin), place), place


BENT = {
    "bent": "x'' = -x - abs(x - 1) - abs(x + 2)",  # its first cell is -2 < x < 1
    "under a root": "x'' = -sqrt(x)*abs(y); y'' = -y*sqrt(x)",
    "to a power": "x'' = -abs(x)^(3/2)",
    "with poles": "x'' = 1/(x^2 - abs(x) - 2) + abs(x)",
}


@functools.cache
def bent(name: str) -> str:
    return json.dumps(dict(solve(BENT[name])))


@pytest.mark.slow
@pytest.mark.parametrize("name", BENT)
def test_equations_of_a_case_are_those_of_its_proof_on_all_of_it(name: str) -> None:
    honest = json.loads(bent(name))
    assert check(honest)["verdict"] == "valid"
    assert not is_caught(check(honest), "/branches/0/equations")
    first, other = (one["equations"] for one in honest["branches"][:2])
    f = first["x"]
    forged = [other, [f], {**first, "z": "0"}, {"z": f}] + [
        {**first, "x": text}
        for text in (
            f"2*({f})", f"{f} + 1/1000", f"-({f})", f"{f}*k", "", "1/0", "sqrt(-x^2 - 1)", -1,
            f"{f} + sqrt((y - 9)^2) - 9 + y" if "y" in first else f"{f} + sqrt((x - 1/2)^2) - x + 1/2",
            f"{f} + sqrt(x^2 + 2*x*x' + x'^2) - x - x'", f"{f} + asin(sin(x)) - x",
            f"({f})*(x - 1/7)/(x - 1/7)", f"{f} + 1/(x' - 5) - 1/(x' - 5)", f"({f})*(x^2 - x/3)^2/(x^2 - x/3)^2",
        )
    ]  # fmt: skip
    for equations in forged:
        edited = copy.deepcopy(honest)
        edited["branches"][0]["equations"] = equations
        assert is_caught(check(edited), "/branches/0/equations"), equations


@pytest.mark.parametrize(
    ("f", "domain", "holds"),
    [
        ("-x - sqrt(x^2)", ["x > 0"], True),
        ("-x - sqrt(x^2)", ["x < 0"], True),
        ("-x - sqrt(x^2)", ["x' > 0"], False),
        ("-x - sqrt((x - 1)^2)", ["x > 0"], False),
        ("-sqrt(x)*x'", ["x > 0"], True),
        ("-sqrt(-x)*x'", ["x > 0"], False),
        ("-sqrt(1 + x^2)", [], True),
        ("-sqrt(x^2 + 2*x*x' + x'^2)", ["x > 0"], False),
        ("asin(sin(x))", ["x > 0"], False),
        ("-x)", ["x > 0"], False),
    ],
)
def test_what_is_under_a_root_has_one_sign_where_equations_hold(
    f: str, domain: list[str], holds: bool
) -> None:
    document = {"coordinates": ["x"], "equations": {"x": f}}
    assert comparison.stays_one_formula(document, {"domain": domain}) is holds


def test_a_family_that_is_whole_has_no_open_members() -> None:
    """Whatever is said of a member that its certificate decides."""
    found = json.loads(
        solve({"equations": {"x": "-a*x"}, "parameters": ["a"], "family": True}).to_json()
    )
    family = found["family"]
    assert family["covered"]
    assert not family["open"]
    assert check(found)["verdict"] == "valid"
    leaf = family["leaves"][0]
    for stated in ([leaf], ["a = 1"], [{**leaf, "verdict": "undetermined"}]):
        family["open"] = stated
        assert check(copy.deepcopy(found))["verdict"] != "valid"


def test_a_domain_of_h_is_stated_only_where_h_holds_on_all_of_it() -> None:
    found = dict(solve({"equations": {"x": "-1/x^2"}}))
    proof = checker.check_certificate(found["certificate"])
    energy = found["hamiltonian"]
    for everywhere in (True, False):
        cell = canonical.cell(
            found["system"], "variational", found["certificate"], proof, energy, everywhere
        )
        assert cell["hamiltonian_domain"] == ([*energy["domain"]] if everywhere else None)
        assert cell["hamiltonian"] == energy["text"]
