"""Documents instead of tests: `python -m tests.mutation.replay --output DIR` tries mutants of the
checker. Every document that the tests give to the checker is recorded with its verdict; a mutant
that gives one of them another verdict is killed. A test takes seconds but its documents take
milliseconds, so all mutants can be tried. The remaining mutants have survived only the quick trial;
`python -m tests.mutation --output DIR` continues with that record.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import itertools
import json
import math
import pickle
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import coverage
import pytest

from tests.mutation.children import Job, answers
from tests.mutation.mutants import Mutant, mutants, mutated
from tests.mutation.record import Record, examined
from tests.mutation.trial import CHECKER, KILLED, OPTIONS, QUICK, path_of, prepare
from tests.mutation.warm import lines_met, put

PACKAGE = "inverse_service.certificate."
FOLDERS = ("tests/certificate", "tests/service/test_edited_results.py")
LONGEST = 0.5  # most seconds of a document that is tried on every mutant
LARGEST = 100_000  # characters
SEEDS = (1, 2, 3)  # the verdict is the same for all of these, or the document tells nothing


@dataclass(frozen=True, slots=True)
class Document:
    """A document as text, its check, its verdict, its seconds, and the (module, line)s that it
    runs.
    """

    check: str
    content: str
    verdict: str
    seconds: float
    lines: frozenset[tuple[str, int]]


def checker() -> Any:
    return importlib.import_module(f"{PACKAGE}checker")


class Listener:
    """A pytest plugin that records the input of the checker."""

    def __init__(self) -> None:
        self.met: dict[tuple[str, str], None] = {}
        for name in ("check_certificate", "check_result"):
            setattr(checker(), name, self.listening(name, getattr(checker(), name)))

    def listening(self, name: str, check: Callable[..., Any]) -> Callable[..., Any]:
        def listening(document: Any, *more: Any, **named: Any) -> Any:
            with contextlib.suppress(
                TypeError, ValueError, RecursionError
            ):  # an attack on the reader
                self.met.setdefault((name, json.dumps(document, sort_keys=True)))
            return check(document, *more, **named)

        return listening


def recorded(path: Path) -> None:
    """In a child, run the tests, then each of their documents once per seed and once with line
    tracing.
    """
    listener = Listener()
    # A test of time limits may fail here; its input to the checker is recorded anyway.
    code = pytest.main([*OPTIONS[1:], "-n", "0", *FOLDERS], plugins=[listener])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise SystemExit(int(code))
    found = [
        one
        for name, content in listener.met
        if len(content) < LARGEST and (one := document(name, content))
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(found))


def document(name: str, content: str) -> Document | None:
    """None if it takes long or its verdict depends on chance."""
    verdicts, longest = set(), 0.0
    for seed in SEEDS:
        began = time.thread_time()
        verdicts.add(verdict(name, content, seed))
        longest = max(longest, time.thread_time() - began)
        if longest > LONGEST or len(verdicts) > 1:
            return None
    files = [str(path_of(PACKAGE + module)) for module in CHECKER]
    tracer = coverage.Coverage(data_file=None, include=files, config_file=False)
    with tracer.collect():
        tracer.switch_context("document")
        verdict(name, content, SEEDS[0])
    lines = {
        module: lines_met(tracer, PACKAGE + module).get("document", frozenset())
        for module in CHECKER
    }
    pairs = frozenset((module, line) for module, met in lines.items() for line in met)
    return Document(name, content, verdicts.pop(), longest, pairs)


def verdict(name: str, content: str, seed: int) -> str:
    check = getattr(checker(), name)
    return str(check(json.loads(content), 20.0, seed).verdict)


class Replay:
    """Run the mutants of one module on the documents that run their statements, within the
    budget.
    """

    def __init__(self, module: str, documents: Sequence[Document], budget: float) -> None:
        self.module, self.budget, self.kills = module, budget, Counter[tuple[str, int]]()
        self.documents = documents

    def said(self, wanted: Sequence[Mutant], processes: int) -> Iterator[tuple[Mutant, str]]:
        for mutant, said in answers(self.jobs(wanted), processes):
            if said.startswith(KILLED):
                self.kills.update(
                    (place, int(said.split()[3].rstrip(":"))) for place in {mutant.function, ""}
                )
            yield mutant, said

    def jobs(self, wanted: Sequence[Mutant]) -> Iterator[tuple[Mutant, Job, float]]:
        source = path_of(PACKAGE + self.module).read_text(encoding="utf-8")
        for mutant in wanted:
            chosen = self.chosen(mutant)
            limit = 3 + 3 * sum(self.documents[k].seconds for k in chosen)
            yield mutant, self.job(mutated(source, mutant), mutant.function, chosen), limit

    def chosen(self, mutant: Mutant) -> list[int]:
        """The documents that run the statement, in descending order of detections per time."""
        statement = {(self.module, line) for line in range(mutant.lines[0], mutant.lines[1] + 1)}
        met = [k for k, one in enumerate(self.documents) if not one.lines.isdisjoint(statement)]
        met.sort(key=lambda k: (self.documents[k].seconds + 0.001)
                 / (1 + self.kills["", k] + 10 * self.kills[mutant.function, k]))  # fmt: skip
        spent = itertools.accumulate(self.documents[k].seconds for k in met)
        return [k for k, seconds in zip(met, spent, strict=True) if seconds <= self.budget]

    def job(self, source: Any, function: str, chosen: Sequence[int]) -> Job:
        def work() -> str:
            try:
                put(PACKAGE + self.module, source, function)
            except (KeyError, StopIteration, TypeError, ValueError):
                return QUICK
            return next(
                (f"{KILLED} by document {k}: {said}" for k in chosen if (said := self.noticed(k))),
                QUICK,
            )

        return work

    def noticed(self, k: int) -> str:
        """The new verdict of the document, empty if it is unchanged."""
        one = self.documents[k]
        try:
            now = verdict(one.check, one.content, 7)
        except Exception as error:
            now = f"raised {type(error).__name__}"
        return "" if now == one.verdict else f"{one.verdict}, now {now}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation.replay", description=__doc__)
    parser.add_argument("--module", choices=CHECKER, action="append")
    parser.add_argument(
        "--budget", type=float, default=math.inf, help="seconds of documents for a mutant"
    )
    parser.add_argument(
        "--again", action="store_true", help="try once more what survived the quick trial"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--output", type=Path, default=Path("build/mutation"))
    asked = parser.parse_args(arguments)
    prepare()
    documents = asked.output.absolute() / "documents.pickle"
    if not documents.exists():
        child = get_context("fork").Process(target=recorded, args=(documents,))
        child.start()
        child.join()
    known = pickle.loads(documents.read_bytes())
    print(
        f"{len(known)} documents, {sum(one.seconds for one in known):.0f} s",
        Counter(one.verdict for one in known),
    )
    for module in asked.module or CHECKER:
        print(module, tried(module, known, asked))


def tried(module: str, documents: Sequence[Document], asked: argparse.Namespace) -> Counter[str]:
    """The numbers of mutants killed, stopped, and surviving, and the manual findings about
    survivors.
    """
    source = path_of(PACKAGE + module).read_text(encoding="utf-8")
    every = mutants(source)
    record = Record(asked.output.absolute() / f"{module}.jsonl", source, every)
    open_ends = ("", QUICK) if asked.again else ("",)
    wanted = [one for one in every if one.function and record.said.get(one, "") in open_ends]
    checker()
    for mutant, said in Replay(module, documents, asked.budget).said(wanted, asked.processes):
        record.add(mutant, said)
        print(
            f"{said[:70]:70} {mutant.line}: {mutant.before[:60]}: {mutant.rule}",
            file=sys.stderr,
            flush=True,
        )
    harmless = examined()
    ends = {one: record.said.get(one, "not tried").split(" by ")[0] for one in every}
    return Counter(
        harmless.get(record.keys[one], end) if end == QUICK else end for one, end in ends.items()
    )


if __name__ == "__main__":
    main()
