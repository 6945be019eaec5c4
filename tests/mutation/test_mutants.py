"""Mutants differ from the source in one place, and a trial distinguishes tests that detect a mutant
from others.
"""

from __future__ import annotations

import ast
import functools
import json
import subprocess
import sys
from pathlib import Path

import pytest

from inverse_service.field import modular
from tests.certificate.documents import lagrangian
from tests.mutation import drawn
from tests.mutation.__main__ import TESTS, chosen_mutants
from tests.mutation.children import answers
from tests.mutation.mutants import mutants, mutated
from tests.mutation.record import Record, examined
from tests.mutation.replay import PACKAGE, Replay, document
from tests.mutation.reviewed import Reviewed, reviewed
from tests.mutation.trial import KILLED, QUICK, ROOT, SURVIVED, path_of
from tests.mutation.warm import plain

SOURCE = '''
"""A docstring with 1 in it."""
def between(low: int, value: int) -> bool:
    """From 0."""
    if not low <= value:
        return False
    return [k for k in (low, -value) if k > 0] != [] and f"{1 + 1}" == ""
'''


def test_each_rule_has_its_mutants() -> None:
    rules = [(mutant.before, mutant.rule) for mutant in mutants(SOURCE)]
    assert rules == [
        ("not low <= value", "condition never"),
        ("not low <= value", "condition always"),
        ("not low <= value", "dropped not"),
        ("low <= value", "LtE to Lt"),
        ("False", "True"),
        ("[k for k in (low, -value) if k > 0] != [] and f'{1 + 1}' == ''", "And to Or"),
        ("[k for k in (low, -value) if k > 0] != []", "NotEq to Eq"),
        ("k > 0", "condition dropped"),
        ("-value", "dropped minus"),
        ("k > 0", "Gt to GtE"),
        ("0", "1"),
        ("f'{1 + 1}' == ''", "Eq to NotEq"),
    ]


def test_changes_are_drawn_over_all_lines_and_are_other_programs() -> None:
    tree = 'def f(a, b):\n    return max(a, b + 2.0, key="size"), any([a or b, not a])\n'
    rules = {rule for _, rule, _ in drawn.all_sites(ast.parse(tree))}
    assert rules >= {
        "min", "all", "twice", "another text", "left operand only", "without the first operand",
        "last entry left out", "last keyword left out", "Add to Sub", "dropped not",
    }  # fmt: skip
    plain = ast.unparse(ast.parse(tree))
    texts = [drawn.changed(tree, k) for k in range(len(drawn.all_sites(ast.parse(tree))))]
    assert plain not in texts
    assert len({*texts}) == len(texts)


def test_every_mutant_is_another_program() -> None:
    plain = ast.unparse(ast.parse(SOURCE))
    sources = [ast.unparse(mutated(SOURCE, mutant)) for mutant in mutants(SOURCE)]
    assert plain not in sources
    assert len(set(sources)) == len(sources)


@pytest.mark.slow
@pytest.mark.parametrize("module", TESTS)
def test_the_modules_and_their_tests_are_there(module: str) -> None:
    total, sample = chosen_mutants(module, 5, seed=1)
    assert total > 30
    assert len(sample) == 5
    assert all((ROOT / name).exists() for name in TESTS[module])
    assert path_of(module).name == module.split(".")[-1] + ".py"


def test_a_requirement_loses_its_condition() -> None:
    source = "require(a < b, 'a sentence')"
    first = mutants(source)[0]
    assert (first.rule, ast.unparse(mutated(source, first))) == (
        "condition dropped",
        "require(True, 'a sentence')",
    )


PLACES = """
LIMIT = 1
class Box:
    side = 2
    def area(self, scale=3):
        def inner():
            return 4
        if (self.side
                > 5):
            return inner() * 6
        return scale
def alone(): return 7
"""


def test_a_mutant_knows_its_statement_and_its_function() -> None:
    found = {mutant.before: (mutant.lines, mutant.function) for mutant in mutants(PLACES)}
    assert found["1"] == ((2, 2), "")
    assert found["2"] == ((4, 4), "")
    assert found["3"] == ((5, 5), "")
    assert found["4"] == ((7, 7), "Box.area")
    assert found["5"] == ((8, 9), "Box.area")
    assert found["6"] == ((10, 10), "Box.area")
    assert found["7"] == ((12, 12), "alone")


def test_a_record_keeps_what_is_known_of_functions_that_did_not_change(tmp_path: Path) -> None:
    source = "def one(): return 1\n\ndef two(): return 2 + 3\n"
    every = mutants(source)
    record = Record(tmp_path / "record.jsonl", source, every)
    for mutant in every:
        record.add(mutant, SURVIVED)
    record.add(every[0], KILLED)
    assert Record(record.path, source, every).said[every[0]] == KILLED
    other = source.replace("3", "4")
    again = Record(record.path, other, mutants(other))
    assert [mutant.function for mutant in again.said] == ["one"]


TRIAL = """
import sys
from tests.mutation.children import answers
from tests.mutation.mutants import mutants, mutated
from tests.mutation.trial import anew, path_of, prepare
from tests.mutation.warm import Ready, run
prepare()
module, test = "inverse_service.field.dense_series", sys.argv[1]
source = path_of(module).read_text()
wanted = [one for one in mutants(source) if one.function == "MonomialKeys.bits"]
unmet = [one for one in mutants(source) if one.function == "keys_of"][:1]
jobs = [(one.rule, lambda one=one: anew(module, mutated(source, one), [test]), 60) for one in wanted]
jobs += [("loop", lambda: next(one for one in iter(int, 1) if one), 1)]
for rule, said in answers(iter(jobs), 1):
    print(rule, said.split("::")[-1], sep=": ")
run(Ready(module, [*wanted, *unmet], 60, 1), [test], lambda one, said: print(one.rule, said.split("::")[-1], sep=": "))
"""


@pytest.mark.slow
def test_a_trial_tells_what_was_noticed_and_by_which_test(tmp_path: Path) -> None:
    """First with a newly loaded package, then with one function changed in a collected session."""
    test = tmp_path / "test_keys.py"
    test.write_text(
        "from inverse_service.field.dense_series import MonomialKeys, keys_of\n"
        "def test_key(): assert MonomialKeys(3).key((1, 0, 0)) == 1\n"
        "def test_bits(): assert MonomialKeys(3).bits == 21\n"
    )
    command = [sys.executable, "-c", TRIAL, str(test)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    trial = ["FloorDiv to Mult: test_bits", "64: survived"]
    found = [line.lstrip(".") for line in done.stdout.splitlines() if ": " in line]
    assert found == [*trial, "loop: stopped", *trial, "LShift to RShift: survived"]


def test_a_failed_job_is_not_an_answer() -> None:
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        list(answers(iter([("fault", lambda: str(1 / 0), 9.0)]), 1))


def test_a_function_behind_a_cache_or_a_property_is_changed_where_it_is() -> None:
    @functools.cache
    def cached() -> int:
        return 1

    assert plain(cached)() == plain(property(plain(cached)))() == 1
    with pytest.raises(TypeError, match="no code"):
        plain(len)
    with pytest.raises(TypeError, match="compiled"):
        plain(modular.multiply)


def test_what_was_examined_by_hand_has_its_reason() -> None:
    found = examined()
    assert {*found.values()} <= {"same", "stricter", "sound", "chance", "effort", "words"}
    for file in (Path(__file__).parent / "examined").glob("*.ndjson"):
        assert all(
            len(json.loads(line)["why"]) > 10
            for line in file.read_text(encoding="utf-8").splitlines()
        )


@pytest.mark.slow
def test_a_document_notices_a_mutant_that_gives_it_another_verdict() -> None:
    """A false claim detects a mutant that never rejects; no document detects a mutant of an unused
    function.
    """
    false = json.dumps(lagrangian("oscillator", "x'^2/2"))
    known = document("check_certificate", false)
    assert known is not None
    assert known.verdict == "invalid"
    every = mutants(path_of(f"{PACKAGE}formulas").read_text(encoding="utf-8"))
    wanted = [one for one in every if one.function == "require"]
    said = dict(Replay("formulas", [known], 60.0).said(wanted, 1))
    assert {one.rule: said[one].split(" by ")[0] for one in wanted}["condition never"] == KILLED
    unmet = [one for one in every if one.function == "is_root"][:2]
    assert {said for _, said in Replay("formulas", [known], 60.0).said(unmet, 1)} == {QUICK}


@pytest.mark.parametrize("one", reviewed(), ids=lambda one: one.change)
def test_each_change_of_a_review_has_its_place_and_its_test(one: Reviewed) -> None:
    assert one.source() != path_of(one.module).read_text(encoding="utf-8")
    file, _, name = one.test.partition("::")
    assert f"def {name.partition('[')[0]}(" in (ROOT / "tests" / file).read_text(encoding="utf-8")
