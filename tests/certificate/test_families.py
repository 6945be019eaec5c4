"""Certificates about families: what they prove, and 40 false claims, none of which is valid.

The claims are conditions derived by hand (tests/doors/test_families.py has the derivations), changed
in one place: an inequation or equation dropped, a set too large, a verdict turned, a proof of
another cell, a minor or a cell left out.
"""

from __future__ import annotations

import copy
import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate, check_text
from inverse_service.certificate.family import Conditions
from inverse_service.certificate.formulas import Incomplete
from inverse_service.certificate.member_sets import Part, Ring, Rule, split_part
from inverse_service.service.documents import coverage

Certificate = dict[str, Any]
YES, NO = "variational", "not_variational"
T0, T1, T2 = ["Phi", "0", "0", "1"], ["Phi", "1", "0", "1"], ["Phi", "2", "0", "1"]
PAIRS = [[T0, T1], [T0, T2], [T1, T2]]


def cell(equations: list[str], nonzero: list[str], verdict: str, proof: Any) -> dict[str, Any]:
    return {
        "equations": equations, "nonzero": nonzero, "autonomous": verdict,
        "time_dependent": verdict, "proofs": [proof],
    }  # fmt: skip


def leaf(equations: list[str], verdict: str, nonzero: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        "equations": equations, "nonzero": [*nonzero], "autonomous": verdict, "time_dependent": verdict,
    }  # fmt: skip


def multiplier(*entries: str, **slopes: str) -> dict[str, Any]:
    return {
        "kind": "multiplier", "question": "autonomous", "terms": [{"entries": [*entries], "slopes": slopes}],
    }  # fmt: skip


def springs() -> Certificate:
    """x'' = -a x + b y, y'' = c x - d y always has an L: g = diag(c, b), and others where b c = 0."""
    return {
        "format": "inverse-service/family/1",
        "system": {
            "coordinates": ["x", "y"], "equations": {"x": "-a*x + b*y", "y": "c*x - d*y"},
            "parameters": ["a", "b", "c", "d"],
        },
        "letters": ["a", "b", "c", "d"], "functions": [],
        "cells": [
            cell([], [], YES, multiplier("c", "0", "b")),
            cell(["b*c"], [], YES, {"kind": "algebra"}),
        ],
        "leaves": [leaf([], YES)],
    }  # fmt: skip


def oscillators() -> Certificate:
    """x'' = -a x' + b y, y'' = c x - d y': an L iff d = a, d = -a, or b = c = 0."""
    return {
        "format": "inverse-service/family/1",
        "system": {
            "coordinates": ["x", "y"], "equations": {"x": "-a*x' + b*y", "y": "c*x - d*y'"},
            "parameters": ["a", "b", "c", "d"],
        },
        "letters": ["a", "b", "c", "d"], "functions": [],
        "cells": [
            cell([], [], NO, {"kind": "rank", "rows": [[T0, T1, T2]]}),
            cell(["d = a"], [], YES, {"kind": "algebra"}),
            cell(["d = -a"], [], YES, multiplier("0", "1", "0")),
            cell(["b"], ["a^2 - d^2"], NO, {"kind": "rank", "rows": PAIRS}),
            cell(["c"], ["a^2 - d^2"], NO, {"kind": "rank", "rows": PAIRS}),
            cell(["b", "c"], [], YES, {"kind": "algebra"}),
        ],
        "leaves": [leaf([], NO), leaf(["d = a"], YES), leaf(["d = -a"], YES), leaf(["b = 0", "c = 0"], YES)],
    }  # fmt: skip


def reduced_particle() -> Certificate:
    """x'' = -V'(x), y'' = -x x' y'/(1 + x^2): an L iff V' = 0 or x (1 + x^2) V'' = V'."""
    lagrangian = {
        "kind": "multiplier", "question": "autonomous",
        "terms": [{"entries": ["1/((x^2 + 1)*y')", "-x'/((x^2 + 1)*y'^2)", "x'^2/((x^2 + 1)*y'^3) + 2*V'(x)/(x*y'^3)"]}],
    }  # fmt: skip
    free = {
        "kind": "multiplier", "question": "autonomous",
        "terms": [
            {"entries": ["1", "0", "0"]},
            {"entries": ["y'^2/x'^3", "-y'/x'^2", "1/x'"], "slopes": {"x": "x/(x^2 + 1)"}},
        ],
    }  # fmt: skip
    return {
        "format": "inverse-service/family/1",
        "system": {
            "coordinates": ["x", "y"], "equations": {"x": "-V'(x)", "y": "-x*x'*y'/(1 + x^2)"},
            "functions": {"V": ["x"]},
        },
        "letters": [], "functions": ["V"],
        "cells": [
            cell([], [], NO, {"kind": "rank", "rows": [[T0, T1]]}),
            cell(["x*(1 + x^2)*V''(x) = V'(x)"], [], YES, lagrangian),
            cell(["V'(x)"], [], YES, free),
        ],
        "leaves": [leaf([], NO), leaf(["V'(x) = 0"], YES), leaf(["x*(1 + x^2)*V''(x) = V'(x)"], YES)],
    }  # fmt: skip


def coupled() -> Certificate:
    """x'' = -F(x) + a y, y'' = b x - y for a general F: an L iff a b != 0 or a = b = 0."""
    rank = {"kind": "rank", "rows": PAIRS}
    return {
        "format": "inverse-service/family/1",
        "system": {
            "coordinates": ["x", "y"], "equations": {"x": "a*y - F(x)", "y": "b*x - y"},
            "parameters": ["a", "b"], "functions": {"F": ["x"]},
        },
        "letters": ["a", "b"], "functions": [],
        "cells": [
            cell([], [], YES, multiplier("b", "0", "a")),
            cell(["a"], ["b"], NO, rank),
            cell(["b"], ["a"], NO, rank),
            cell(["a", "b"], [], YES, {"kind": "algebra"}),
        ],
        "leaves": [leaf([], YES), leaf(["a"], NO), leaf(["b"], NO), leaf(["a", "b"], YES)],
    }  # fmt: skip


def test_functions_that_are_not_free_are_general() -> None:
    """F = k x has an L for a = 0, k != 1: this is no member, and what is proven says so."""
    found = check_certificate(coupled())
    assert found.verdict == "valid", found.reasons
    assert found.reasons[0] == "What follows holds for general F(x)."
    free = coupled() | {"functions": ["F"]}
    assert check_certificate(free).verdict != "valid"
    missing = coupled()
    del missing["leaves"][1]
    assert check_certificate(missing).verdict != "valid"
    always = coupled() | {"leaves": [leaf([], YES)]}
    assert check_certificate(always).verdict != "valid"


@pytest.mark.parametrize("certificate", [springs(), oscillators(), reduced_particle()])
def test_the_conditions_derived_by_hand_are_proven(certificate: Certificate) -> None:
    found = check_certificate(certificate)
    assert found.verdict == "valid", found.reasons
    assert len(found.reasons) == len(certificate["leaves"])
    assert found == check_text(json.dumps(certificate))


def test_what_is_proven_is_said() -> None:
    assert check_certificate(oscillators()).reasons == (
        "For all members with b = 0, c = 0: a Lagrangian L(q, q').",
        "For all others with d = -a: a Lagrangian L(q, q').",
        "For all others with d = a: a Lagrangian L(q, q').",
        "For all other members: no regular Lagrangian.",
    )


def test_a_function_of_a_velocity_has_placeholders_for_names() -> None:
    """x'' = F(x, x'), y'' = -y are two equations of one coordinate each, so always have an L."""
    certificate = springs()
    certificate["system"] |= {
        "equations": {"x": "F(x, x')", "y": "-y"}, "parameters": [], "functions": {"F": ["x", "x_dot"]},
    }  # fmt: skip
    certificate |= {"letters": [], "functions": ["F"]}
    certificate["cells"] = [cell([], [], YES, {"kind": "algebra"})]
    assert check_certificate(certificate).verdict == "valid"
    certificate["system"]["equations"]["y"] = "-y + F(x, x')"
    assert check_certificate(certificate).verdict == "incomplete"


def test_of_an_open_set_nothing_is_claimed() -> None:
    certificate = oscillators()
    del certificate["cells"][5], certificate["leaves"][3]
    assert check_certificate(certificate).verdict == "incomplete"
    certificate["open"] = [{"equations": ["b", "c"], "nonzero": ["a^2 - d^2"]}]
    assert check_certificate(certificate).reasons[0] == (
        "Nothing is claimed of members with b = 0, c = 0, a^2 - d^2 != 0."
    )


@pytest.mark.parametrize(
    ("equation", "verdict"),
    [
        ("A[1,0,0](x, y, y')*A[2,0,1](x, y, y') = A[1,0,1](x, y, y')*A[2,0,0](x, y, y')", "valid"),
        ("A[1,0,0](x, y, y')*A[2,0,1](x, y, y') = A[1,0,1](x, y, y')^2", "incomplete"),
        ("A[1,0,0](x, y, y')", "incomplete"),
    ],
)
def test_an_open_set_is_left_without_solving_its_equations(equation: str, verdict: str) -> None:
    """x'' = -x + A(x, y, y'), y'' = -y: the minors of two conditions vanish only if this one does."""
    certificate = springs()
    certificate["system"] |= {
        "equations": {"x": "-x + A(x, y, y')", "y": "-y"}, "parameters": [],
        "functions": {"A": ["x", "y", "y_dot"]},
    }  # fmt: skip
    certificate |= {"letters": [], "functions": ["A"], "leaves": [leaf([], NO)]}
    certificate["cells"] = [cell([], [], NO, {"kind": "rank", "rows": [[T0, T1]]})]
    certificate["open"] = [{"equations": [equation]}]
    assert check_certificate(certificate, time_limit=0.4).verdict == verdict


def test_the_verdict_of_the_general_member_is_proven_alone() -> None:
    """Where others are not: of these nothing is claimed, whatever their cells say."""
    certificate = oscillators()
    certificate["cells"][2]["proofs"] = [{"kind": "algebra"}]
    assert check_certificate(certificate).verdict == "incomplete"
    found = check_certificate(coverage.of_the_general_member(certificate))
    assert found.verdict == "valid"
    assert found.reasons == (
        "Nothing is claimed of members with d = a.",
        "Nothing is claimed of members with d = -a.",
        "Nothing is claimed of members with b = 0.",
        "Nothing is claimed of members with c = 0.",
        "For all other members: no regular Lagrangian.",
    )


def completed(claim: str, rows: list[Any], question: str = "autonomous") -> dict[str, Any]:
    return {
        "kind": "completion", "question": question, "claim": claim, "rows": rows, "order": [0, 1, 2],
    }  # fmt: skip


def test_differential_conditions_are_completed() -> None:
    """Where b = c = 0 or d = a several g satisfy the algebraic conditions, and some are regular."""
    certificate = oscillators()
    certificate["cells"][5]["proofs"] = [completed(YES, [])]
    assert check_certificate(certificate).verdict == "valid"
    certificate["cells"][2]["proofs"] = [completed(YES, [T0])]  # with the pivot c, or b where c = 0
    assert check_certificate(certificate).verdict == "valid"


def turned() -> Certificate:
    """u'' = -a v', v'' = -v for x = u, y = v - u: an L iff a = 0, else g = [[1, 1], [1, 1]] alone."""
    equations = {"x": "-a*(x' + y')", "y": "a*(x' + y') - (x + y)"}
    return {
        "format": "inverse-service/family/1",
        "system": {"coordinates": ["x", "y"], "equations": equations, "parameters": ["a"]},
        "letters": ["a"], "functions": [],
        "cells": [cell([], [], NO, {}), cell(["a"], [], YES, multiplier("2", "1", "1"))],
        "leaves": [leaf([], NO), leaf(["a = 0"], YES)],
    }  # fmt: skip


@pytest.mark.parametrize("family", [turned, oscillators, reduced_particle])
@pytest.mark.parametrize("rows", [[], [T0], [T0, T1]], ids=len)
def test_only_singular_multipliers_that_evolve_prove_a_no(
    family: Callable[[], Certificate], rows: list[Any]
) -> None:
    """Of the multipliers that satisfy the conditions at one instant some may be regular."""
    for claim, verdicts in ((NO, {"valid"}), (YES, {"incomplete", "invalid"})):
        certificate = family()
        certificate["cells"][0] = cell([], [], claim, completed(claim, rows, "time_dependent"))
        certificate["leaves"][0] = leaf([], claim)
        if family is not reduced_particle or rows:  # else a condition becomes too large
            assert check_certificate(certificate).verdict in verdicts


def test_a_cell_proves_its_own_special_members_only_if_its_proof_holds_there() -> None:
    """g = diag(c, b) is singular where b c = 0, so this cell cannot prove these."""
    certificate = springs()
    certificate["cells"][1] = cell([], [], YES, multiplier("c", "0", "b"))
    assert check_certificate(certificate).reasons == ("The cells refer to each other in a circle.",)


def driven() -> Certificate:
    """x'' = a x' + b x + c y, y'' = d y' + e y: no L exactly if c != 0, a != d, and
    b + a^2/4 != e + d^2/4 (then g_xx = 0 by T1, and g_xy = 0 by T0).

    With u(y, y') and h(y, y') so that Gamma(u) = -(a + d)/2 u, Gamma(h) + d h = -c y u_y', the
    third has g = [[0, u], [u, x' u_y' + x (u_y + (d - a)/2 u_y') + h]].
    """
    system = {
        "coordinates": ["x", "y"], "equations": {"x": "a*x' + b*x + c*y", "y": "d*y' + e*y"},
        "parameters": [*"abcde"],
    }  # fmt: skip
    special = ["c = 0", "a = d", "b + a^2/4 = e + d^2/4"]
    return {
        "format": "inverse-service/family/1", "system": system, "letters": [*"abcde"],
        "functions": [],
        "cells": [
            cell([], [], NO, {"kind": "rank", "rows": [[T0, T1]]}),
            *(cell([one], [], YES, {"kind": "algebra"}) for one in special),
        ],
        "leaves": [leaf([], NO), *(leaf([one], YES) for one in special)],
    }  # fmt: skip


def test_two_linear_equations_with_one_condition_have_a_lagrangian() -> None:
    assert check_certificate(driven()).verdict == "valid"
    for equations in (["e = 0"], ["b = 2*e"]):
        false = driven()
        false["cells"][3]["equations"] = false["leaves"][3]["equations"] = equations
        assert check_certificate(false).verdict != "valid"


def test_a_pivot_is_freed_of_the_roots_of_equations() -> None:
    """s (a + b) without a, where a^2 = b: (a + b)(b - a) = b^2 - b."""
    ring = Ring(["x"], ["a", "b"], [], {}, 0, float("inf"))
    a, b = (ring.read(name).above for name in "ab")
    k = next(k for k, name in ring.letters.items() if name == "a")
    part = Part(ring, (Rule(a * a - b, k),))
    by = part.cofactor(a + b)
    assert by is not None
    assert part.reduced(by * (a + b)).degrees()[k] == 0
    assert part.cofactor(b + 1) is None


def test_an_equation_is_reduced_again_by_one_of_lower_order() -> None:
    """Where C = 0, B' - B is not 0, and B is not 0, B (B' - B)^2 + C B' is not 0 either."""
    ring = Ring(["x"], [], [], {"B": ["x"], "C": ["x"]}, 3, float("inf"))

    def read(text: str) -> Any:
        return ring.read(text).above

    apart = tuple(map(read, ("B(x)", "B'(x) - B(x)")))
    (part,) = split_part(Part(ring, (), apart), [read("B(x)*(B'(x) - B(x))^2 + C(x)*B'(x)")])[-1:]
    assert split_part(part, [read("C(x)")]) == []


@pytest.mark.parametrize(
    ("equations", "apart", "follows"),
    [
        (["a^2 - 2", "b^2 - 2"], "a - b", "a + b"),
        (["a^2 - 2", "b^2 - 2"], "(a - b)*(b - 3)", "a + b"),
        (["a^2 - 2", "b^2 + 2*a*b + 2"], "a + b + 1", "a + b"),
        (["a^2 - 2", "a*b^2 - 2*b"], "(a + 1)*b - a - 2", "b"),
        (["a^2 - 2", "b^3 - a*b^2 - b + a - b^2 + a*b"], "a - b", "b^2 - b - 1"),
    ],
)
def test_what_does_not_vanish_is_no_factor_of_an_equation(
    equations: list[str], apart: str, follows: str
) -> None:
    ring = Ring(["x"], ["a", "b"], [], {}, 0, float("inf"))

    def read(text: str) -> Any:
        return ring.read(text).above

    parts = split_part(Part(ring, (), (read(apart),)), [*map(read, equations)])
    assert parts
    assert all(part.vanishes([read(follows)]) for part in parts)
    assert not any(part.vanishes([read(apart)]) for part in parts)


@pytest.mark.parametrize(
    "text",
    [
        "exp(x - 2*y)*exp(2*y) = exp(x)",
        "sin(x + 2*y) = sin(x)*cos(2*y) + cos(x)*sin(2*y)",
        "cos(x - y/1) = cos(x)*cos(y) + sin(x)*sin(y)",
        "sin(x - 3*y) = -sin(3*y - x)",
    ],
)
def test_functions_of_sums_are_taken_apart(text: str) -> None:
    ring = Ring(["x", "y"], [], [], {}, 0, float("inf"), with_atoms=True)
    assert not ring.read(text).above


def test_functions_of_products_are_not_taken_apart() -> None:
    ring = Ring(["x", "y"], ["a"], [], {}, 0, float("inf"), with_atoms=True)
    for text in ("exp(a*x)", "sin(x*y)", "exp(x/y)", "exp(x + 1)"):
        with pytest.raises(Incomplete):
            ring.read(text)


def test_functions_are_real_too() -> None:
    """x'' = F(x, y), y'' = -y has an L for F_y = 0; F_x^2 + F_y^2 = 0 leaves constants alone."""
    certificate = springs()
    certificate["system"] |= {
        "equations": {"x": "F(x, y)", "y": "-y"}, "parameters": [], "functions": {"F": ["x", "y"]},
    }  # fmt: skip
    squares = "diff(F(x, y), x)^2 + %s diff(F(x, y), y)^2"
    certificate |= {"letters": [], "functions": ["F"], "leaves": [leaf([], YES)]}
    for sign, verdict in (("", "valid"), ("-", "incomplete")):
        one = squares % sign
        certificate["open"] = [{"equations": [], "nonzero": [one]}]
        certificate["cells"] = [
            cell([], [], YES, {"kind": "algebra"}),
            cell([one], [], YES, {"kind": "algebra"}),
        ]
        assert check_certificate(certificate).verdict == verdict


def changed(certificate: Certificate, change: Callable[[Certificate], object]) -> Certificate:
    twin = copy.deepcopy(certificate)
    change(twin)
    return twin


def forgeries() -> Iterator[tuple[str, Certificate]]:
    """False claims, and true ones without their proofs."""
    whole, drawn, particle = oscillators(), springs(), reduced_particle()

    def of(base: Certificate, name: str, change: Callable[[Certificate], object]) -> Any:
        return name, changed(base, change)

    def turned(one: dict[str, Any]) -> None:
        for key in ("autonomous", "time_dependent"):
            one[key] = NO if one[key] == YES else YES

    for k in range(4):
        yield of(whole, f"verdict of leaf {k}", lambda one, k=k: turned(one["leaves"][k]))
        yield of(whole, f"L(q, q') of leaf {k}", lambda one, k=k: one["leaves"][k].update(
            autonomous=NO if k else YES))  # fmt: skip
    for k in range(6):
        yield of(whole, f"no cell {k}", lambda one, k=k: one["cells"].pop(k))
        yield of(whole, f"verdict of cell {k}", lambda one, k=k: turned(one["cells"][k]))
    for k in (1, 2, 3):
        yield of(whole, f"no leaf {k}", lambda one, k=k: one["leaves"].pop(k))
        yield of(whole, f"leaf {k} too large", lambda one, k=k: one["leaves"][k].update(
            equations=one["leaves"][k]["equations"][1:]))  # fmt: skip
        yield of(
            whole,
            f"leaf {k} too small",
            lambda one, k=k: one["leaves"][k].update(nonzero=["a" if k == 3 else "b"]),
        )
    yield of(
        whole,
        "a product for an equation",
        lambda one: one["leaves"][1].update(equations=["(a - d)*b = 0"]),
    )
    yield of(whole, "another equation", lambda one: one["leaves"][1].update(equations=["d = 2*a"]))
    yield of(
        whole,
        "a leaf of no member with an L",
        lambda one: one["leaves"].append(leaf(["a = 1"], YES)),
    )
    yield of(whole, "leaves in another order", lambda one: one["leaves"].reverse())
    yield of(whole, "a row less", lambda one: one["cells"][0]["proofs"][0].update(rows=[[T0, T1]]))
    yield of(whole, "a minor less", lambda one: one["cells"][3]["proofs"][0].update(rows=[[T0]]))
    yield of(
        whole, "a row twice", lambda one: one["cells"][0]["proofs"][0].update(rows=[[T0, T1, T1]])
    )
    yield of(whole, "no rows", lambda one: one["cells"][0]["proofs"][0].update(rows=[]))
    yield of(whole, "no proof", lambda one: one["cells"][0].update(proofs=[]))
    yield of(
        whole,
        "the proof of another cell",
        lambda one: one["cells"][2].update(proofs=one["cells"][1]["proofs"]),
    )
    yield of(whole, "a theorem that does not apply", lambda one: one["cells"][0].update(
        cell([], [], YES, {"kind": "algebra"})))  # fmt: skip
    yield of(
        whole,
        "isotropic, but is not",
        lambda one: one["cells"][1].update(proofs=[{"kind": "isotropic"}]),
    )
    yield of(
        whole,
        "g of another cell",
        lambda one: one["cells"][2].update(proofs=[multiplier("c", "0", "b")]),
    )
    yield of(
        whole,
        "a singular g",
        lambda one: one["cells"][2].update(proofs=[multiplier("0", "0", "0")]),
    )
    yield of(whole, "g with the time for L(q, q')", lambda one: one["cells"][1].update(
        proofs=[multiplier("c", "0", "b", t="a")]))  # fmt: skip
    yield of(whole, "a slope that is wrong", lambda one: one["cells"][2].update(
        proofs=[multiplier("0", "1", "0", x="1")]))  # fmt: skip
    yield of(
        whole, "another system", lambda one: one["system"]["equations"].update(y="c*x - d*y' - y'")
    )
    yield of(whole, "an open set that is not all", lambda one: (
        one["cells"].pop(5), one["leaves"].pop(3), one.update(open=[{"equations": ["b", "c", "a = 2*d"]}])))  # fmt: skip
    yield of(drawn, "no cell where g is singular", lambda one: one["cells"].pop())
    yield of(
        drawn,
        "g singular in the next cell",
        lambda one: one["cells"][1].update(proofs=[multiplier("c", "0", "b")]),
    )
    yield of(drawn, "cells in a circle", lambda one: (one["cells"][1].update(
        equations=[], proofs=[multiplier("c", "0", "b")])))  # fmt: skip
    yield of(drawn, "a divisor that vanishes", lambda one: one["cells"][0].update(
        proofs=[multiplier("1/b", "0", "1/c")]) or one["cells"].pop())  # fmt: skip
    yield of(particle, "no leaf of V", lambda one: one["leaves"].pop())
    yield of(particle, "all V", lambda one: one["leaves"][2].update(equations=[]))
    yield of(particle, "a sign in the equation", lambda one: one["leaves"][2].update(
        equations=["x*(1 + x^2)*V''(x) = -V'(x)"]))  # fmt: skip
    yield of(particle, "V'' = 0 for V' = 0", lambda one: (
        one["leaves"][1].update(equations=["V''(x) = 0"]), one["cells"][2].update(equations=["V''(x)"])))  # fmt: skip
    yield of(particle, "no cell where V' = 0", lambda one: one["cells"].pop())
    yield of(
        particle,
        "a function that depends on y, too",
        lambda one: one["system"].update(functions={"V": ["x", "y"]}),
    )


@pytest.mark.parametrize(("name", "certificate"), [*forgeries()])
def test_no_false_claim_is_valid(name: str, certificate: Certificate) -> None:
    found = check_certificate(certificate)
    assert found.verdict != "valid", (name, found.reasons)


def test_there_are_forty_of_them() -> None:
    assert len(list(forgeries())) >= 40


# What a proof by multipliers has to satisfy.


def free_particles(question: str, term: dict[str, Any], x: str = "0") -> Certificate:
    """x'' = x, y'' = 0 with one multiplier as a proof for one question."""
    proof = {"kind": "multiplier", "question": question, "terms": [term]}
    verdicts = {"autonomous": None, "time_dependent": None, question: YES}
    whole = {"equations": [], "nonzero": [], **verdicts}
    return {
        "format": "inverse-service/family/1",
        "system": {"coordinates": ["x", "y"], "equations": {"x": x, "y": "a*y"}, "parameters": ["a"]},
        "letters": ["a"], "functions": [], "cells": [whole | {"proofs": [proof]}], "leaves": [whole],
    }  # fmt: skip


@pytest.mark.parametrize("name", ["x", "y"])
def test_the_slopes_of_a_factor_are_those_of_a_function(name: str) -> None:
    """du = q' (dq - q' dt) satisfies all other conditions, and is the differential of no u."""
    assert check_certificate(
        free_particles("time_dependent", {"entries": ["1", "0", "1"]})
    ).verdict == "valid"  # fmt: skip
    slopes = {name: f"{name}'", "t": f"-{name}'^2"}
    forged = free_particles("time_dependent", {"entries": ["1", "0", "1"], "slopes": slopes})
    forged["system"]["equations"] = {"x": "0", "y": "0"}
    assert check_certificate(forged).verdict != "valid"


@pytest.mark.parametrize(
    ("question", "valid"), [("time_dependent", True), ("autonomous", False)]
)  # fmt: skip
def test_a_multiplier_with_t_is_none_of_a_lagrangian_without(question: str, valid: bool) -> None:
    """x - t x' is conserved, so its square is a multiplier of x'' = 0, and one with t."""
    found = check_certificate(free_particles(question, {"entries": ["(x - t*x')^2", "0", "1"]}))
    assert (found.verdict == "valid") is valid


@pytest.mark.parametrize(
    ("question", "valid"), [("time_dependent", True), ("autonomous", False)]
)  # fmt: skip
def test_equations_with_t_have_no_lagrangian_without(question: str, valid: bool) -> None:
    found = check_certificate(free_particles(question, {"entries": ["1", "0", "1"]}, x="t - x"))
    assert (found.verdict == "valid") is valid


def test_each_row_vanishes_on_the_hessian_of_a_lagrangian() -> None:
    """L = ((1 + y^2) x'^2 + y'^2 + z'^2)/2 + x y z' + z x' - x^2 z, by hand:

    (1 + y^2) x'' = -2 y x' y' + y z' - z' - 2 x z, y'' = y x'^2 + x z', z'' = x' - y x' - x y' - x^2.
    """
    ring = Ring(["x", "y", "z"], [], [], {}, 0, time.monotonic() + 60)
    forces = (
        "(y*z' - z' - 2*x*z - 2*y*x'*y')/(1 + y^2)", "y*x'^2 + x*z'", "x' - y*x' - x*y' - x^2",
    )  # fmt: skip
    conditions = Conditions(ring, [ring.read(text) for text in forces])
    hessian = [ring.read(text).above for text in ("1 + y^2", "0", "0", "1", "0", "1")]
    pairs = [(str(i), str(j)) for i in range(3) for j in range(i + 1, 3)]
    names = [("Phi", str(k), i, j) for k in (0, 1, 2) for i, j in pairs]
    names += [(kind, k, "0", "1", "2") for kind in "RS" for k in ("0", "1")]
    for name in names:
        row = conditions.row(name)
        assert not sum((a * g for a, g in zip(row, hessian, strict=True)), start=ring.none), name
    assert any(map(bool, conditions.row(("R", "1", "0", "1", "2"))))
