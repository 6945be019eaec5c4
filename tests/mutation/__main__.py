"""Mutation testing of the mathematics: `python -m tests.mutation --sample N --output DIR`.

Each mutant has a quick trial; if that is inconclusive, it has a slow one that reloads the package
and runs all tests. survivors.md in the folder lists the survivors. An interrupted run resumes.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections import Counter
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path

from tests.mutation.children import answers
from tests.mutation.mutants import Mutant, mutants, mutated
from tests.mutation.record import Record
from tests.mutation.trial import QUICK, ROOT, SURVIVED, anew, path_of, prepare
from tests.mutation.warm import Ready, run

DECISION_TESTS = tuple(
    f"tests/inverse_problem/test_{name}.py"
    for name in (
        "safeguards_of_the_decision",
        "points_of_the_decision",
        "involution",
        "prolongation",
        "local_program",
        "decision",
        "certify",
    )
)
# Files of the package below inverse_service (patterns), and the tests that are responsible for
# them.
ROOMS: dict[str, tuple[str, ...]] = {
    "certificate/*.py": ("tests/certificate",),
    "linear_pde/*.py": DECISION_TESTS,
    "constrained/*.py": ("tests/doors", "tests/paper", "tests/service"),
    "search/*.py": ("tests/doors", "tests/inverse_problem"),
    "solving/*.py": ("tests/doors", "tests/inverse_problem", "tests/service"),
    "simulation/accuracy.py": ("tests/simulation", "tests/service"),
    "simulation/switching.py": ("tests/simulation", "tests/service"),
    "simulation/piecewise.py": ("tests/simulation", "tests/service"),
    "simulation/events.py": ("tests/simulation", "tests/service"),
    "simulation/contacts.py": ("tests/simulation", "tests/service"),
}
TESTS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): tests
    for pattern, tests in ROOMS.items()
    for path in sorted((ROOT / "inverse_service").glob(pattern))
    if path.name != "__init__.py"
}


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument(
        "--module", choices=[name.split(".")[-1] for name in TESTS], action="append"
    )
    parser.add_argument("--sample", type=int, help="so many mutants of each module (default all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--limit", type=int, default=60, help="processor seconds for the tests of one mutant"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--budget", type=float, default=math.inf, help="of these, seconds of tests that are chosen"
    )
    parser.add_argument(
        "--again", action="store_true", help="try survivors of an earlier run once more"
    )
    parser.add_argument("--tests", nargs="+", help="these tests only, such as new ones for --again")
    parser.add_argument("--output", type=Path, default=Path("build/mutation"))
    return parser.parse_args(arguments)


def chosen_mutants(module: str, sample: int | None, seed: int) -> tuple[int, list[Mutant]]:
    """The number of mutants, and the sample in random order."""
    every = mutants(path_of(module).read_text(encoding="utf-8"))
    order = random.Random(f"{module}/{seed}").sample(every, len(every))
    return len(every), order[:sample]


def tried(module: str, asked: argparse.Namespace) -> list[str]:
    """The lines of the report on one module."""
    _, sample = chosen_mutants(module, asked.sample, asked.seed)
    again = (SURVIVED,) if asked.again else ()
    said = recorded(module, asked).said
    wanted = [one for one in sample if said.get(one, "") in ("", QUICK, *again)]
    # In a separate process: this one never loads the package, so its children load it themselves.
    first = get_context("fork").Process(target=quickly, args=(module, wanted, asked))
    first.start()
    first.join()
    if first.exitcode:
        raise SystemExit(f"The tests of {module} fail or cannot be run.")
    said = recorded(module, asked).said
    slowly(module, [one for one in wanted if not one.function or said.get(one) == QUICK], asked)
    return report(module, sample, recorded(module, asked))


def recorded(module: str, asked: argparse.Namespace) -> Record:
    source = path_of(module).read_text(encoding="utf-8")
    return Record(
        asked.output.absolute() / f"{module.split('.')[-1]}.jsonl", source, mutants(source)
    )


def quickly(module: str, wanted: Sequence[Mutant], asked: argparse.Namespace) -> None:
    record = recorded(module, asked)
    inside = [one for one in wanted if one.function and record.said.get(one) != QUICK]
    if inside:
        ready = Ready(module, inside, asked.limit, asked.processes, asked.budget)
        run(ready, asked.tests or TESTS[module], lambda mutant, said: add(record, mutant, said))


def slowly(module: str, wanted: Sequence[Mutant], asked: argparse.Namespace) -> None:
    record, source = recorded(module, asked), path_of(module).read_text(encoding="utf-8")
    tests = asked.tests or TESTS[module]
    jobs = (
        (one, lambda one=one: anew(module, mutated(source, one), tests), asked.limit)
        for one in wanted
    )
    for mutant, said in answers(jobs, asked.processes):
        add(record, mutant, said)


def add(record: Record, mutant: Mutant, said: str) -> None:
    record.add(mutant, said)
    print(
        f"{said[:70]:70} {mutant.line}: {mutant.before[:60]}: {mutant.rule}",
        file=sys.stderr,
        flush=True,
    )


def report(module: str, sample: Sequence[Mutant], record: Record) -> list[str]:
    ends = Counter(record.said[mutant].split()[0] for mutant in sample)
    survivors = sorted(
        (one for one in sample if record.said[one] == SURVIVED), key=lambda one: one.number
    )
    lines = [
        f"- line {one.line}, {one.function or 'module'}: `{one.before}`: {one.rule}"
        for one in survivors
    ]
    tried = f"{len(record.keys)} mutants, {len(sample)} tried"
    ended = f"{ends['killed']} killed, {ends['stopped']} stopped by the limit, {ends[SURVIVED]} survived"
    return [f"## {module}", "", f"{tried}: {ended}.", "", *lines, ""]


def main(arguments: Sequence[str] | None = None) -> None:
    asked, began = options(arguments), time.monotonic()
    prepare()
    lines = [line for module in TESTS if not asked.module or module.split(".")[-1] in asked.module
             for line in tried(module, asked)]  # fmt: skip
    (asked.output / "survivors.md").write_text(
        "\n".join(["# Mutants", "", *lines]), encoding="utf-8"
    )
    print("\n".join(lines), f"\n{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
