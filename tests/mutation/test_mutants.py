"""Mutants differ from the source in one place, and a trial tells a test that notices from one that does not."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutation.__main__ import TESTS, chosen_mutants
from tests.mutation.mutants import mutants, mutated
from tests.mutation.trial import ROOT, path_of

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


def test_every_mutant_is_another_program() -> None:
    plain = ast.unparse(ast.parse(SOURCE))
    sources = [mutated(SOURCE, mutant) for mutant in mutants(SOURCE)]
    assert plain not in sources
    assert len(set(sources)) == len(sources)


@pytest.mark.parametrize("module", TESTS)
def test_the_modules_and_their_tests_are_there(module: str) -> None:
    total, sample = chosen_mutants(module, 5, seed=1)
    assert total > 50
    assert len(sample) == 5
    assert all((ROOT / name).exists() for name in TESTS[module])
    assert path_of(module).name == module.split(".")[-1] + ".py"


def test_a_requirement_loses_its_condition() -> None:
    source = "require(a < b, 'a sentence')"
    first = mutants(source)[0]
    assert (first.rule, mutated(source, first)) == ("condition dropped", "require(True, 'a sentence')")


TRIAL = """
import sys
from tests.mutation.trial import is_noticed, path_of
module, test = "inverse_service.algebra.monomials", sys.argv[1]
source = path_of(module).read_text()
print(is_noticed(module, source, [test], 60), is_noticed(module, source + "\\nkeys_of = None", [test], 60),
      is_noticed(module, source + "\\nwhile True: pass", [test], 1))
"""


def test_a_trial_tells_what_was_noticed(tmp_path: Path) -> None:
    test = tmp_path / "test_keys.py"
    test.write_text("from inverse_service.algebra.monomials import keys_of\ndef test_it(): assert keys_of\n")
    command = [sys.executable, "-c", TRIAL, str(test)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.split() == ["survived", "killed", "stopped"]
