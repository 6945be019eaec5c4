"""Systems of the corpus have the known verdicts, correct Lagrangians and Hamiltonians, and valid
certificates. Expected values come from the literature, from the Lagrangian that defines a system,
or from an argument. The judge uses nothing from the package.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import pytest

from tests.doors import calls, judge, rows, shown
from tests.golden import printed

SYSTEMS = rows.systems()
QUICK = [row["id"] for row in SYSTEMS if not {"slow", "nightly", "open"} & set(row)]
SHOWN = {*QUICK[::10]}  # whose doors are compared by default; those of all slow rows are, too
LONGER = 1.3  # a pair of brackets and a number more than a person writes


def given_equations(row: rows.Row) -> judge.Equations | None:
    """f from the row alone, or None if the row needs a reader of its notation."""
    document = row["document"]
    equations = row.get("equations") or document.get("equations")
    if not isinstance(equations, dict):
        return None
    parameters = document.get("parameters")
    values = (
        {name: value for name, value in parameters.items() if value}
        if isinstance(parameters, dict)
        else {}
    )
    names = document.get("coordinates") or list(equations)
    return judge.equations_of(
        {"equations": equations, "coordinates": names, "time": document.get("time")}, values
    )


@pytest.mark.slow
def test_the_known_lagrangians_of_all_rows_hold() -> None:
    """The known Lagrangian of each row proves its yes."""
    known = [(row, text) for row in SYSTEMS for text in row.get("known", ())]
    assert known
    for row, text in known:
        given = given_equations(row)
        assert given is not None, row["id"]
        assert judge.faults_of_lagrangian(text, given) is None, row["id"]


def test_rows_agree_with_themselves() -> None:
    assert len({row["id"] for row in SYSTEMS}) == len(SYSTEMS)
    for row in SYSTEMS:
        verdict, with_time = row.get("verdict"), row.get("verdict_with_time")
        assert row["source"], row["id"]
        assert verdict != "variational" or with_time in ("variational", None), row["id"]
        assert not (row.get("known") and with_time == "not_variational"), row["id"]
        coordinates = (given_equations(row) or judge.Equations(("x", "y"), ())).coordinates
        assert len(coordinates) > 1 or with_time in ("variational", None), row["id"]


def test_no_row_has_a_key_that_the_readme_does_not_list() -> None:
    tables = (rows.CORPUS / "README.md").read_text(encoding="utf-8").split("| key | meaning |")
    files, keys = (re.findall(r"^\| (.+?) \| (.+) \|$", table, re.MULTILINE) for table in tables)
    common = set(re.findall(r"`(\w+)`", " ".join(key for key, _ in keys)))
    for names, meaning in files:
        for row in rows.rows(*re.findall(r"`(\w+)`", names)):
            assert row.keys() <= {*common, *re.findall(r"`(\w+)`", meaning)}, row


def is_printed(row: rows.Row) -> bool:
    """Whether the answer of Python is compared with what is known where all of it is printed."""
    is_one = row["id"].replace(" ", "-") in printed.ROWS and row["id"] not in SHOWN
    return is_one and rows.doors(row) == ("python",)


@pytest.mark.parametrize(
    ("row", "door"),
    rows.cases(row | ({"slow": "printed"} if is_printed(row) else {}) for row in SYSTEMS),
)
def test_a_system_is_answered_as_is_known(
    row: rows.Row, door: str, request: pytest.FixtureRequest
) -> None:
    service = request.getfixturevalue("service") if door == "http" else None
    is_shown = bool(request.node.get_closest_marker("slow")) or row["id"] in SHOWN
    result = calls.solve(document_of(row, is_shown), door, service)
    assert not isinstance(result, calls.Refusal), result
    assert_as_known(row, result)
    if is_shown:
        shown.assert_every_door_shows(result)
    assert_valid(result, door, service)


def document_of(row: rows.Row, is_shown: bool) -> Any:
    """The document; first integrals, of which no row says anything, are asked where they are shown."""
    document = row["document"]
    return {"first_integrals": is_shown, **document} if isinstance(document, dict) else document


def answered(row: rows.Row) -> None:
    """The same by Python alone, without its doors."""
    result = calls.solve(document_of(row, row["id"] in SHOWN), "python")
    assert_as_known(row, result)
    assert_valid(result, "python")


def assert_valid(result: dict[str, Any], door: str, service: str | None = None) -> None:
    if "undetermined" not in (result["verdict"], result["verdict_with_time"]):
        assert calls.check(result, door, service) == "valid"


def assert_as_known(row: rows.Row, result: Mapping[str, Any]) -> None:
    for key in ("verdict", "verdict_with_time"):
        assert row.get(key) in (None, result[key]), (key, result[key], result["reason"])
    answers = list(answers_of(result))
    given = given_equations(row) or judge.equations_of(result["system"])
    for answer in answers:
        assert_answer_holds(answer, given, result)
    if result["conditions"] and not result["branches"] and not result.get("nonholonomic"):
        shown = result["conditions"]["Phi"]
        assert (
            not shown or judge.faults_of_endomorphism(shown, given, domain=result["domain"]) is None
        )
    if result.get("nonholonomic") and not result["branches"] and not result["system"]["functions"]:
        assert (
            judge.faults_of_motion(result["nonholonomic"], result["system"]["coordinates"]) is None
        )
    found = [answer for answer in answers if answer["lagrangian"]]
    plain = [answer for answer in found if given.time not in _names(answer)]
    for wanted in row.get("found", ()):
        having = plain if wanted == "lagrangian" else found
        assert having, f"{wanted} is missing"
        assert wanted != "hamiltonian" or any(one["hamiltonian"] for one in having)
    for key in ("lagrangian", "lagrangian_with_time"):
        if key in row:
            assert any(_same(answer, row[key], given) for answer in found), [
                a["lagrangian"]["text"] for a in found
            ]
    for key in PARTS:
        if key in row:
            PARTS[key](row[key], result)
    if "textbook" in row:
        texts = [
            answer["lagrangian"]["text"]
            for answer in found
            if _same(answer, row["textbook"], given)
        ]
        assert texts, [answer["lagrangian"]["text"] for answer in found]
        assert min(map(len, texts)) <= LONGER * len(row["textbook"]) + 20, texts


def assert_kinds(wanted: Mapping[str, str], result: Mapping[str, Any]) -> None:
    assert {name: result["kinds"][name]["verdict"] for name in wanted} == wanted
    assert {result["kinds"][name]["checked"] for name in wanted} == {"valid"}


def assert_cases(wanted: Mapping[str, str], result: Mapping[str, Any]) -> None:
    """Assert the verdict on each connected set, which its conditions describe."""
    found = {
        frozenset(branch["domain"]): branch["verdict"] for branch in result["branches"] or [result]
    }
    assert found == {frozenset(domain.split(", ")): verdict for domain, verdict in wanted.items()}


def assert_domain(wanted: Sequence[str], result: Mapping[str, Any]) -> None:
    assert result["branches"] == []
    assert sorted(result["domain"]) == [
        condition for condition in wanted if condition != "everywhere"
    ]


def assert_clock(wanted: Mapping[str, Any], result: Mapping[str, Any]) -> None:
    """Assert the time change: the verdict, N in dtau = N dt, and equations."""
    found = result["with_clock"]
    assert found["verdict"] == wanted["verdict"], found["reason"]
    assert found["checked"] == "valid" or wanted["verdict"] == "undetermined"
    names = tuple(result["system"]["coordinates"])
    if "factor" in wanted:
        assert judge.same_formula(found["factor"], wanted["factor"], names)
    for name, text in wanted.get("equations", {}).items():
        assert judge.same_formula(found["equations"][name], text, names)
    if found["lagrangian"]:
        given = judge.equations_of({"equations": found["equations"]})
        assert (
            judge.faults_of_lagrangian(
                found["lagrangian"]["text"], given, found["lagrangian"]["domain"]
            )
            is None
        )


def assert_reduced(wanted: Mapping[str, Any], result: Mapping[str, Any]) -> None:
    """Assert the reduced system with and without Chaplygin's time change; None means there is no
    time change.
    """
    found = result["reduced"]
    with_clock = found["with_clock"]
    assert found["verdict"] == wanted["verdict"]
    assert (with_clock and with_clock["verdict"]) == wanted["with_clock"]
    for part in (found, with_clock):
        if part and part["lagrangian"]:
            given = judge.equations_of(part)
            assert (
                judge.faults_of_lagrangian(
                    part["lagrangian"]["text"], given, part["lagrangian"]["domain"]
                )
                is None
            )


def assert_associated(wanted: Mapping[str, str], result: Mapping[str, Any]) -> None:
    found = {part["kind"]: part for part in result["nonholonomic"]["associated"]}
    assert {kind: found[kind]["verdict"] for kind in wanted} == wanted
    for kind in wanted:
        assert found[kind]["checked"] == "valid"
        lagrangian = found[kind]["lagrangian"]
        if lagrangian:
            given = judge.equations_of(
                found[kind] | {"coordinates": result["system"]["coordinates"]}
            )
            assert (
                judge.faults_of_lagrangian(lagrangian["text"], given, lagrangian["domain"]) is None
            )


def assert_motion(wanted: str, result: Mapping[str, Any]) -> None:
    found = result["any_associated"]
    assert (found["verdict"], found["checked"]) == (wanted, "valid"), found["reason"]
    part = result["nonholonomic"]
    if found["lagrangian"] and part:
        motion, names = part["equations_of_motion"], result["system"]["coordinates"]
        assert judge.faults_of_lagrangian_on_constraints(found["lagrangian"], motion, names) is None


def assert_lagrangian_of_motion(wanted: bool, result: Mapping[str, Any]) -> None:
    assert bool(result["any_associated"]["lagrangian"]) == wanted


PARTS: dict[str, Callable[[Any, Mapping[str, Any]], None]] = {
    "kinds": assert_kinds,
    "cases": assert_cases,
    "domain": assert_domain,
    "branches": lambda wanted, result: (
        pytest.fail("branches") if len(result["branches"]) != wanted else None
    ),
    "reason": lambda wanted, result: (
        pytest.fail(result["reason"]) if wanted not in result["reason"] else None
    ),
    "clock": assert_clock,
    "reduced": assert_reduced,
    "associated": assert_associated,
    "any_associated": assert_motion,
    "lagrangian_of_motion": assert_lagrangian_of_motion,
}


def answers_of(result: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The answers for L(q, q') and L(t, q, q') on every branch."""
    for branch in result["branches"] or [result]:
        yield branch
        if branch.get("with_time"):
            yield branch["with_time"]


def assert_answer_holds(
    answer: Mapping[str, Any], given: judge.Equations, result: Mapping[str, Any]
) -> None:
    """Assert that an answer is checked and explained, and that its formulas agree with each
    other.
    """
    if answer["verdict"] == "undetermined":
        return
    assert answer["checked"] == "valid"
    assert answer["explanation"]
    lagrangian, hamiltonian = answer["lagrangian"], answer["hamiltonian"]
    assert answer["verdict"] == "variational" or lagrangian is None
    if lagrangian is None:
        return
    near = (answer["certificate"] or {}).get("near")
    place = {
        "domain": [*answer.get("domain", ()), *lagrangian["domain"]],
        "near": near,
        "integrals": answer.get("integrals") or result.get("integrals"),
    }
    assert judge.faults_of_lagrangian(lagrangian["text"], given, **place) is None
    if hamiltonian is not None:
        assert judge.faults_of_hamiltonian(hamiltonian, lagrangian["text"], given, **place) is None


def _names(answer: Mapping[str, Any]) -> set[str]:
    return set(re.findall(r"\w+", answer["lagrangian"]["text"]))


def _same(answer: Mapping[str, Any], wanted: str, given: judge.Equations) -> bool:
    near = (answer["certificate"] or {}).get("near")
    return judge.same_lagrangian(
        answer["lagrangian"]["text"], wanted, given, answer["lagrangian"]["domain"], near=near
    )
