"""One case of the campaign: generated from its kind, seed, and number, decided, and judged; never
raises.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import now
from inverse_service.decision import certify
from inverse_service.decision.deciding import Analysis, Decision, analyze, decide
from inverse_service.errors import IrreducibleAtoms
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import narrowest
from inverse_service.statements.reasons import irreducible
from tests.generator import disguised, random_right_side, random_system
from tests.generator.systems import GeneratedSystem
from tests.soundness.corruption import corruptions, found_valid, spoilt_lagrangians
from tests.soundness.forgery import forgeries
from tests.soundness.rewriting import rewritten

DECISION_LIMIT = 60.0
CHECK_LIMIT = 60.0
# By n: existence certificates are checked for one in this many generated systems.
CHECKED_SHARE = {1: 1, 2: 1, 3: 25, 4: 250}


@dataclass(slots=True)
class Outcome:
    """The outcome of a case. `wrong` has a sentence for each wrong verdict, with the evidence."""

    kind: str
    index: int
    id: str = ""
    n: int = 0
    verdicts: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    checked: dict[str, int] = field(default_factory=dict)
    corrupted: dict[str, int] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def document(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(slots=True)
class Decided:
    """A system with its analysis and decision; without analysis if its atoms are not reduced."""

    analysis: Analysis | None
    decision: Decision


def run_case(kind: str, seed: int, index: int) -> Outcome:
    """The outcome of case `index`; an exception is an internal error and counts as wrong."""
    outcome, began = Outcome(kind, index), time.process_time()
    try:
        KINDS[kind](outcome, seed, index)
    except Exception as fault:  # the campaign reports any exception and continues
        outcome.wrong.append(f"{type(fault).__name__}: {fault}")
    outcome.seconds = round(time.process_time() - began, 4)
    return outcome


def decided(equations: dict[str, str], with_time: bool) -> Decided:
    system = read_system(list(equations), equations)
    limits = Limits(deadline=now() + DECISION_LIMIT)
    try:
        analysis = analyze(system)
    except IrreducibleAtoms as problem:
        return Decided(
            None, Decision("undetermined", narrowest(with_time), 0, irreducible(problem.detail))
        )
    return Decided(analysis, decide(system, narrowest(with_time), limits=limits, analysis=analysis))


def note(outcome: Outcome, found: Decided) -> str:
    """Record the verdict."""
    outcome.verdicts.append(found.decision.verdict)
    if found.decision.verdict == "undetermined":
        outcome.reasons.append("" if found.decision.open is None else found.decision.open.words)
    return found.decision.verdict


def confirm(outcome: Outcome, found: Decided) -> dict[str, Any] | None:
    """Return the certificate, if there is one; if the checker rejects it, the verdict or the proof
    is wrong.
    """
    if found.analysis is None or found.decision.verdict == "undetermined":
        return None
    certificate = certify.of_decision(found.analysis, found.decision)
    checked = check_certificate(certificate, time_limit=CHECK_LIMIT)
    outcome.checked[checked.verdict] = outcome.checked.get(checked.verdict, 0) + 1
    if checked.verdict == "invalid":
        outcome.wrong.append(
            f"the checker refused {certificate['system']['equations']}: {'; '.join(checked.reasons)}"
        )
    return certificate if checked.verdict == "valid" else None


def expect_variational(outcome: Outcome, found: Decided) -> None:
    if note(outcome, found) == "not_variational":
        assert found.analysis is not None
        shown = certify.of_decision(found.analysis, found.decision)["system"]["equations"]
        outcome.wrong.append(f"found not variational, has a Lagrangian: {shown}")


def generated(outcome: Outcome, seed: int, index: int) -> None:
    """A system with a Lagrangian: L(t, q, v), and L(q, v) if it does not contain t."""
    _known(outcome, random_system(index, seed), index // 32)


def disguise(outcome: Outcome, seed: int, index: int) -> None:
    """The same in other coordinates."""
    plain = random_system(index, seed)
    other = disguised(plain, index)
    found = _known(outcome, other, index // 32)
    before = decided(plain.equations, True).decision
    _expect_equal(outcome, before, found, f"{plain.equations} and {other.equations}")


def _known(outcome: Outcome, system: GeneratedSystem, turn: int) -> Decision:
    outcome.id, outcome.n = system.id, system.n
    if not system.time_dependent:
        expect_variational(outcome, decided(system.equations, False))
    found = decided(system.equations, True)
    expect_variational(outcome, found)
    if turn % CHECKED_SHARE[system.n] == 0:
        confirm(outcome, found)
    return found.decision


def right_side(outcome: Outcome, seed: int, index: int) -> None:
    """A random right-hand side: both questions are decided, every certificate is checked."""
    system = random_right_side(index, seed)
    outcome.id, outcome.n = system.id, system.n
    answers = [decided(system.equations, with_time) for with_time in (False, True)]
    verdicts = [note(outcome, found) for found in answers]
    for found in answers:
        confirm(outcome, found)
    if verdicts == ["variational", "not_variational"]:
        outcome.wrong.append(f"an L(q, v) and no L(t, q, v): {system.equations}")


def rewriting(outcome: Outcome, seed: int, index: int) -> None:
    """A rewritten system has the verdict, the order, and the dimensions of the original."""
    known = random_system(index, seed) if index % 2 else None
    given = known or random_right_side(index, seed)
    outcome.id, outcome.n = given.id, given.n
    other = rewritten(read_system(given.coordinates, given.equations), index)
    first, second = (decided(equations, True) for equations in (given.equations, other))
    (expect_variational if known else note)(outcome, second)
    if given.n <= 2:
        confirm(outcome, second)
    _expect_equal(outcome, first.decision, second.decision, f"{given.equations} and {other}")


def _expect_equal(outcome: Outcome, first: Decision, second: Decision, shown: str) -> None:
    """Compare verdict, order, and all dimensions, which do not depend on coordinates and
    notation.
    """
    if "undetermined" in (first.verdict, second.verdict):
        return
    if (first.verdict, first.history) != (second.verdict, second.history):
        outcome.wrong.append(
            f"{first.verdict} {first.history} and {second.verdict} {second.history}: {shown}"
        )


def corruption(outcome: Outcome, seed: int, index: int) -> None:
    """Corrupted certificates of a variational and of another system are never valid."""
    n = 3 if index % 8 == 7 else 2
    yes = random_system(32 * (index // 8) + 8 * (n - 1) + index % 8, seed)
    no = random_right_side(9 * (index // 3) + 3 * (n - 2) + index % 3, seed)
    outcome.id, outcome.n = f"{yes.id} and {no.id}", n
    positive, negative = (confirm(outcome, decided(system.equations, True)) for system in (yes, no))
    if positive is None or negative is None or negative["claim"] == "variational":
        return
    rng = random.Random(f"corruption/{seed}/{index}")
    for spoilt in (
        corruptions(positive, negative, rng),
        corruptions(negative, positive, rng),
        spoilt_lagrangians(positive, yes, rng),
        forgeries(positive, negative, yes, rng),
    ):
        counts, wrong = found_valid(spoilt)
        for verdict, count in counts.items():
            outcome.corrupted[verdict] = outcome.corrupted.get(verdict, 0) + count
        outcome.wrong += [f"valid in spite of {name}: {certificate}" for name, certificate in wrong]


KINDS: dict[str, Callable[[Outcome, int, int], None]] = {
    "generated": generated,
    "random": right_side,
    "disguised": disguise,
    "rewritten": rewriting,
    "corrupted": corruption,
}
