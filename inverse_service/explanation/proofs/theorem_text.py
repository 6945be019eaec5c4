"""Theorems as text: for Coq (the reals of its standard library), and as plain data."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from flint import fmpq_mpoly

from inverse_service.explanation.proofs.deriving import Theorem
from inverse_service.explanation.proofs.identities import Fact, Identity
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol, Velocity
from inverse_service.field.rational_functions import Quotient, factored

HEAD = """What is proven: the statements below, for all real numbers that fulfil the hypotheses. What is not: that the
hypotheses are what the comments say, that is the derivatives that were taken to form them."""
COQ_HEAD = f"""(* {HEAD} *)
Require Import Reals Lra.
Open Scope R_scope.

Lemma cancel (f a : R) : f <> 0 -> f * a = 0 -> a = 0.
Proof. intros H P; destruct (Rmult_integral _ _ P); [contradiction | assumption]. Qed.
Lemma plus_zero (a b : R) : a = 0 -> b = 0 -> a + b = 0.
Proof. intros -> ->; ring. Qed.
Lemma times_zero (a b : R) : b = 0 -> a * b = 0.
Proof. intros ->; ring. Qed.
Ltac nonzero := repeat split; repeat (assumption || apply Rmult_integral_contrapositive_currified ||
  apply pow_nonzero || lra).
Ltac zero := repeat (reflexivity || assumption || apply times_zero || apply plus_zero).
"""
# Words that name no variable in Coq, and the names that proofs use themselves.
_TAKEN = re.compile(
    r"(eq|rel|nz|val|ker)\d+|cancel|plus_zero|times_zero|nonzero|zero|det_g|residual|R|as|at|by|do|else|end|exists|fix|for|"
    r"forall|from|fun|have|if|in|let|match|mod|open|return|show|then|theorem|Type|Prop|Set|SProp|using|where|with|"
    r"axiom|def|example|instance|lemma|local|macro|namespace|private|section|structure|variable|universe|class|"
    r"cofix|import|export|inductive|syntax|infix|notation|prefix|deriving|mutual|calc|suffices|nomatch|try|catch|"
    r"finally|unless|matches|sorry|abbrev|opaque|attribute|partial|unsafe|protected|noncomputable|assume|obtain|set_option"
)


@dataclass(frozen=True, slots=True)
class Letters:
    """The names of the generators that a theorem uses, and what those mean that are not symbols."""

    names: dict[int, str]
    meanings: dict[str, str]


def letters_of(theorem: Theorem) -> Letters:
    """x as x, x' as v_x, every other atom as u1, u2, …; other words where these are taken."""
    used = sorted(
        {k for p in _polynomials(theorem) for k, degree in enumerate(p.degrees()) if degree > 0}, reverse=True
    )
    names, meanings = dict[int, str](), dict[str, str]()
    symbols = {tree.name for tree in theorem.ring.trees.values() if isinstance(tree, Symbol)}
    for index in used:
        tree = theorem.ring.trees[index]
        name = _letter(tree, len(meanings) + 1)
        while _TAKEN.fullmatch(name) or name in names.values() or (name in symbols and not isinstance(tree, Symbol)):
            name += "_"
        names[index] = name
        if tree != Symbol(name):
            meanings[name] = to_text(tree)
    return Letters(names, meanings)


def _letter(tree: Expression, number: int) -> str:
    match tree:
        case Symbol(name):
            return name
        case Velocity(name):
            return f"v_{name}"
    return f"u{number}"


def _polynomials(theorem: Theorem) -> Iterator[fmpq_mpoly]:
    for step in theorem.steps:
        yield from (step.factor, step.gives.polynomial)
        yield from (polynomial for c, fact in step.terms for polynomial in (c, fact.polynomial))
    yield from (below for below, _ in theorem.denominators)
    yield from (factor.numerator for _, factors in theorem.summands for factor in factors)


def polynomial_text(letters: Letters, polynomial: fmpq_mpoly) -> str:
    """3*x^2*y - 1; coefficients have to be integers, or are printed as p/q."""
    found = ""
    for exponents, value in polynomial.terms():
        powers = [f"{letters.names[k]}^{e}" if e > 1 else letters.names[k] for k, e in enumerate(exponents) if e]
        size = abs(value)
        product = "*".join(powers if powers and size == 1 else [str(size), *powers])
        found += f" {'-' if value < 0 else '+'} {product}" if found else f"{'-' if value < 0 else ''}{product}"
    return found or "0"


def _quotient_text(letters: Letters, quotient: Quotient) -> str:
    below = [(quotient.field.denominators[k], e) for k, e in quotient.exponents]
    above = polynomial_text(letters, quotient.numerator)
    return f"({above}) / ({_product(letters, below)})" if below else above


def _product(letters: Letters, powers: Sequence[tuple[fmpq_mpoly, int]], constant: str = "1") -> str:
    parts = [f"({polynomial_text(letters, p)})" + (f"^{e}" if e > 1 else "") for p, e in powers]
    return " * ".join([constant] * (constant != "1" or not parts) + parts)


def _factors(theorem: Theorem, step: Identity) -> tuple[str, list[tuple[fmpq_mpoly, int]]]:
    """The number and the powers by which the statement of a step is multiplied."""
    number, powers = factored(step.factor)
    below = theorem.denominators if step is theorem.steps[-1] else ()
    return str(number), [*powers, *below]


def _combination(letters: Letters, step: Identity) -> str:
    parts = (
        f"({polynomial_text(letters, c)}) * ({polynomial_text(letters, fact.polynomial)})" for c, fact in step.terms
    )
    return " + ".join(parts) or "0"


def _statement(theorem: Theorem, letters: Letters, step: Identity) -> str:
    if step is not theorem.steps[-1] or not theorem.summands:
        return polynomial_text(letters, step.gives.polynomial)
    text = ""
    for sign, factors in theorem.summands:
        texts = [_quotient_text(letters, factor) for factor in factors if factor.constant_value != 1]
        product = " * ".join(f"({one})" for one in texts) or "1"
        text += f" {'+' if sign > 0 else '-'} {product}" if text else f"{'' if sign > 0 else '0 - '}{product}"
    return text


def _hypotheses(theorem: Theorem, letters: Letters, unequal: str) -> Iterator[str]:
    for fact in (*theorem.relations, *(fact for fact, _ in theorem.equations)):
        yield f"  ({fact.name} : {polynomial_text(letters, fact.polynomial)} = 0)"
    for k, one in enumerate(theorem.nonzero, 1):
        yield f"  (nz{k} : {polynomial_text(letters, one)} {unequal} 0)"


def _comments(theorem: Theorem, letters: Letters) -> list[str]:
    means = [f"{name} is {text}" for name, text in letters.meanings.items()]
    return means + [
        f"{fact.name} is {text}, without denominators and common factors" for fact, text in theorem.equations
    ]


def coq(theorems: Sequence[Theorem]) -> str:
    """A file that Coq 8.16 compiles."""
    return "\n".join([COQ_HEAD, *map(_coq_theorem, theorems)])


def _coq_theorem(theorem: Theorem) -> str:
    letters = letters_of(theorem)
    binders = f" ({' '.join(letters.names.values())} : R)" if letters.names else ""
    lines = [f"(* {text} *)" for text in _comments(theorem, letters)]
    lines += [f"Theorem {theorem.name}{binders}", *_hypotheses(theorem, letters, "<>")]
    lines += [f"  : {_statement(theorem, letters, theorem.steps[-1])} = 0.", "Proof."]
    for step in theorem.steps[:-1]:
        lines.append(f"  assert ({step.gives.name} : {_statement(theorem, letters, step)} = 0).")
        lines += [f"  {{ {_coq_step(theorem, letters, step, 'ring')} }}"]
    by = "field; nonzero" if theorem.summands else "ring"
    return "\n".join([*lines, f"  {_coq_step(theorem, letters, theorem.steps[-1], by)}", "Qed.", ""])


def _coq_step(theorem: Theorem, letters: Letters, step: Identity, by: str) -> str:
    number, powers = _factors(theorem, step)
    factor = _product(letters, powers, number)
    total = _combination(letters, step)
    return f"apply (cancel ({factor})); [nonzero |].\n    transitivity ({total}); [{by} | zero]."


def identities(theorems: Sequence[Theorem]) -> list[dict[str, Any]]:
    """The theorems as data: each step factor * gives = sum of cofactor * (relation, equation or earlier step)."""
    return [_plain(theorem, letters_of(theorem)) for theorem in theorems]


def _plain(theorem: Theorem, letters: Letters) -> dict[str, Any]:
    text: Callable[[fmpq_mpoly], str] = lambda polynomial: polynomial_text(letters, polynomial)  # noqa: E731

    def listed(facts: Sequence[Fact]) -> dict[str, str]:
        return {fact.name: text(fact.polynomial) for fact in facts}

    return {
        "theorem": theorem.name,
        "meanings": letters.meanings,
        "relations": listed(theorem.relations),
        "equations": listed([fact for fact, _ in theorem.equations]),
        "nonzero": [text(one) for one in theorem.nonzero],
        "steps": [
            {
                "name": step.gives.name,
                "gives": text(step.gives.polynomial),
                "factor": text(step.factor),
                "cofactors": {fact.name: text(c) for c, fact in step.terms},
            }
            for step in theorem.steps
        ],
    }
