"""The special parameter values that a verdict excludes: in the result, the statement, and every
interface.
"""

import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import flint
import httpx
import pytest

import inverse_service
from inverse_service.certificate.exceptions import has_real_zeros
from inverse_service.service.documents.derived import documents_of_exceptions
from inverse_service.service.documents.printed_pages import latex_page, text_page
from tests.values import slow

COUPLED = {"equations": {"x": "a*y", "y": "b*x*y'"}, "parameters": ["a", "b"]}
FRICTION: dict[str, Any] = {
    "equations": {"x": "-x + k*y - c*x'", "y": "-y + k*x"},
    "parameters": ["c", "k"],
    "first_integrals": False,
}


@pytest.fixture(scope="module")
def no() -> dict[str, Any]:
    return json.loads(inverse_service.solve(FRICTION).to_json())


@pytest.mark.slow
def test_a_no_names_the_values_at_which_its_proof_divides_by_zero(no: dict[str, Any]) -> None:
    assert no["verdict"] == "not_variational"
    assert {*no["exceptions"]} == {"c = 0", "k = 0"}


@pytest.mark.slow
def test_at_each_exception_there_is_a_lagrangian(no: dict[str, Any]) -> None:
    for text, document in documents_of_exceptions(no):
        assert document is not None, text
        assert inverse_service.solve(document)["verdict"] == "variational", text


def test_the_hessian_of_a_yes_vanishes_at_its_exceptions() -> None:
    assert inverse_service.solve(COUPLED)["exceptions"] == ["a = 0", "b = 0"]


def test_letters_that_have_to_vanish_together_are_one_exception() -> None:
    """With either of a and b alone the equations are coupled, with none of them they are not."""
    equations = "x'' = (a*y + b*y^2)*x'; y'' = -y + x'*(a + b*x)"
    asked = {"equations": equations, "parameters": ["a", "b"], "first_integrals": False}
    asked["time_dependent_lagrangian"] = True
    found = inverse_service.solve(asked)
    assert (found["verdict"], found["exceptions"]) == ("not_variational", ["a = b = 0"])


@pytest.mark.slow
def test_neither_a_product_with_exp_nor_the_directions_of_an_existence_proof_have_exceptions() -> (
    None
):
    particles = {"equations": {"x": "F(x - y)/m", "y": "-F(x - y)/k"}, "functions": {"F": ["s"]}}
    damped = {"equations": {"x": "-k*x/m - c*x'"}, "time_dependent_lagrangian": True}
    documents: tuple[dict[str, Any], ...] = (damped, particles)
    for asked in documents:
        asked["parameters"] = ["k", "m", "c"]
        assert inverse_service.solve(asked, time_limit=10)["exceptions"] == []


@pytest.mark.slow
def test_the_statement_of_a_check_has_the_exceptions(no: dict[str, Any]) -> None:
    found = inverse_service.check(no)
    assert {*found["statement"]["exceptions"]} == {"c = 0", "k = 0"}
    assert "for all c, k, except c = 0" in found["statement"]["text"]
    assert "/exceptions" not in found["not_checked"]


@pytest.mark.parametrize("stated", [slow([]), ["c = 0"], slow(["c = 0", "k = 0", "c = k"])])
def test_other_exceptions_than_proven_contradict(no: dict[str, Any], stated: list[str]) -> None:
    forged = copy.deepcopy(no)
    forged["exceptions"] = stated
    found = {one["field"] for one in inverse_service.check(forged)["contradictions"]}
    assert {"/exceptions", "/answers/0/exceptions"} <= found
    assert all(field.endswith("/exceptions") for field in found)


@pytest.mark.slow
def test_the_command_decides_them(no: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(no))
    command = [sys.executable, "-m", "inverse_service", "check", str(file), "--exceptions"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    found = json.loads(done.stdout)["exceptions"]
    assert done.returncode == 0
    assert {one["where"]: one["verdict"] for one in found} == {
        "c = 0": "variational",
        "k = 0": "variational",
    }


@pytest.mark.parametrize(
    "force",
    [
        "abs(x)*x'",
        slow("abs(x' - abs(x))"),
        slow("sign(x') + x^2*x'^4"),
        slow(" + ".join(f"abs(x - {k})*x'" for k in range(10))),
        slow(" + ".join(f"sin({k}*x + x')*x'^{k}" for k in range(2, 20))),
    ],
)
def test_one_coordinate_is_never_undetermined(force: str) -> None:
    result = inverse_service.solve({"equations": {"x": force}}, time_limit=1)
    assert "undetermined" not in (result["verdict"], result["verdict_with_time"])


def test_van_der_pol_is_two_sentences() -> None:
    step, form = inverse_service.solve({"equations": {"x": "-x + (1 - x^2)*x'"}}, time_limit=1)[
        "explanation"
    ]
    assert "Sonin" in step["text"]
    assert "whose energy is I" in form["text"]


@pytest.fixture(scope="module")
def kinds() -> dict[str, Any]:
    """The damped oscillator has a natural Lagrangian only without damping."""
    asked = {"equations": {"x": "-k*x - c*x'"}, "parameters": ["k", "c"], "kinds": ["natural"],
             "first_integrals": False}  # fmt: skip
    found: dict[str, Any] = json.loads(inverse_service.solve(asked).to_json())
    return found


@pytest.fixture(scope="module")
def motion() -> dict[str, Any]:
    asked = {"coordinates": ["x", "y", "z"], "motion": {"x": "-x + k*y - c*x'", "y": "-y + k*x"},
             "constraints": ["z' = y*x'"], "parameters": ["c", "k"], "first_integrals": False}  # fmt: skip
    found: dict[str, Any] = json.loads(inverse_service.solve(asked).to_json())
    return found


@pytest.mark.slow
def test_kinds_and_motions_on_constraints_name_what_their_proofs_leave_out(
    kinds: dict[str, Any], motion: dict[str, Any]
) -> None:
    for result, part, place, left in (
        (kinds, kinds["kinds"]["natural"], "/kinds/natural/exceptions", {"c = 0"}),
        (motion, motion["any_associated"], "/any_associated/exceptions", {"c = 0", "k = 0"}),
    ):
        assert part["verdict"] == "not_variational"
        assert {*part["exceptions"]} == left
        report = inverse_service.check(result)
        assert report["verdict"] == "valid"
        assert place not in report["not_checked"]
    forged = copy.deepcopy(kinds)
    forged["kinds"]["natural"]["exceptions"] = ["k = 17"]
    assert [one["field"] for one in inverse_service.check(forged)["contradictions"]] == [
        "/kinds/natural/exceptions"
    ]


@pytest.mark.parametrize("form", [slow("text"), "latex"])
def test_the_exceptions_of_kinds_and_motions_are_written(
    kinds: dict[str, Any], motion: dict[str, Any], form: str
) -> None:
    for result in (kinds, motion):
        written = text_page(result, False) if form == "text" else latex_page(result, False)
        assert "except c = 0" in written.replace("$", "")


def test_over_http_a_result_its_page_and_its_check_have_the_exceptions(service: str) -> None:
    found = httpx.post(
        f"{service}/v1/solve", json=FRICTION, headers={"Prefer": "wait=20"}, timeout=60
    )
    result = found.json()
    assert {*result["exceptions"]} == {"c = 0", "k = 0"}
    text = httpx.post(
        f"{service}/v1/solve", json=FRICTION, headers={"Accept": "text/plain"}, timeout=60
    ).text
    assert "Not decided here: c = 0, k = 0" in text
    checked = httpx.post(
        f"{service}/v1/check", json={"document": FRICTION, "result": result}, timeout=60
    ).json()
    assert {*checked["statement"]["exceptions"]} == {"c = 0", "k = 0"}
    result["exceptions"] = ["c = 0"]
    checked = httpx.post(
        f"{service}/v1/check", json={"document": FRICTION, "result": result}, timeout=60
    ).json()
    assert "/exceptions" in [one["field"] for one in checked["contradictions"]]
    page = httpx.get(service + found.links["canonical"]["url"], timeout=60)
    assert "ot decided here" in page.text


@pytest.mark.parametrize(
    ("powers", "real"),
    [((1, 0, 1), False), ((-2, 0, 0, 1), True), ((-1, 1, -1, 1), True), ((3, 2, 1), False)],
)
def test_only_a_factor_without_real_zeros_excludes_nothing(
    powers: tuple[int, ...], real: bool
) -> None:
    """c^2 + 1, c^3 - 2, (c - 1) (c^2 + 1), and c^2 + 2 c + 3, alone and with another letter."""
    context = flint.fmpq_mpoly_ctx.get(["c", "k"], flint.Ordering.degrevlex)
    polynomial = context.from_dict({(k, 0): value for k, value in enumerate(powers) if value})
    assert has_real_zeros(polynomial) is real
    assert has_real_zeros(polynomial + context.gens()[1])


def test_the_answer_at_a_special_value_says_where_its_own_equations_are_defined() -> None:
    found = inverse_service.solve(
        {"equations": {"x": "x'^r/t"}, "parameters": ["r"], "first_integrals": False}
    )
    assert {part["where"]["text"]: part["domain"] for part in found["left_out"]} == {
        "r = 2": ["t != 0"],
        "r = 1": ["t != 0"],
    }
    assert [answer["domain"] for answer in found["answers"]][1:] == [["t != 0"]] * 2


@pytest.mark.parametrize(
    ("force", "names", "seeds", "expected"),
    [
        # sqrt(t) is in L alone; the Hessian exp(b t/(2 a)) sqrt(t) has no zero.
        ("(-c*x-x'*(a+b*t))/(2*a*t)", "abc", (1, 2, 3), set()),
        # L has log(x')/a and atan(sqrt(b)*x'/sqrt(a))/(sqrt(a)*sqrt(b)), which is not real at a = -b.
        ("a*x'+b*x'^3", "ab", (1,), {"a = 0", "b = 0", "a = -b"}),
    ],
)
def test_exceptions_are_no_matter_of_luck(
    force: str, names: str, seeds: tuple[int, ...], expected: set[str]
) -> None:
    """Roots in L exist at half of all points modulo a prime; roots of letters are letters."""
    document = {"equations": {"x": force}, "parameters": [*names], "first_integrals": False}
    for seed in seeds:
        assert {*inverse_service.solve(document, seed=seed)["exceptions"]} == expected


@pytest.mark.parametrize("plain", ["", "-w^2*x"])
def test_of_two_lagrangians_that_without_exceptions_is_shown(plain: str) -> None:
    """b x'^2 + a y'^2 - 2 a b x y is one of x'' = -a y; y'' = -b x as well, but not for a b = 0."""
    equations = {"x": f"-a*y {plain}", "y": f"-b*x {plain.replace('x', 'y')}"}
    names = [name for name in "abw" if any(name in text for text in equations.values())]
    found = inverse_service.solve({"equations": equations, "parameters": names})
    assert (found["verdict"], found["exceptions"]) == ("variational", [])
