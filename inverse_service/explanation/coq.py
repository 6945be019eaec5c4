"""Theorems behind a verdict as a file that Coq compiles (the reals of its library).

In the file f, its derivatives, and the tensors are defined and computed. Polynomials with rational
coefficients are lists there, `derive` is the derivation with given values on the generators. A
generator is a coordinate, a velocity, an atom of the formulas (u3 for sin(x)), an entry of the
multiplier, or 1/D for a denominator D. Tensors of a system are polynomials in these generators,
with the formulas of `mechanics.conditions`; a condition at a point is the value of such a
polynomial at given values of the generators. The only unproved statements are the comments on the
meaning of generators, for example that u3, which has the derivative u4, is sin(x).
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from flint import fmpq, fmpq_mpoly

from inverse_service.explanation import hierarchy
from inverse_service.explanation.identities import (
    Fact,
    FormalSystem,
    GeneratorNames,
    Identity,
    Theorem,
    combination,
    distinct,
    factored_text,
    factors_divided_by,
    generator_names,
    identity,
    polynomial_text,
    polynomials_of,
    product_text,
    relations_of,
    without_remainder,
)
from inverse_service.expressions import polynomials, tree as ex
from inverse_service.field import exact_field

HEAD = """What is proven: the statements below, for all real numbers that fulfil the hypotheses. What is not: that the
hypotheses are what the comments say, that is the derivatives that were taken to form them."""
# Among the values of free generators in the example are legs of right triangles, which make sqrt(1
# - u^2) rational.
SAMPLES = [
    Fraction(*pair)
    for pair in ((1, 1), (2, 1), (3, 1), (-1, 1), (1, 2), (3, 5), (4, 5), (5, 13), (5, 1), (-2, 3))
]
ATTEMPTS = 400  # points tried for the example


def hypotheses(
    letters: GeneratorNames, facts: Iterable[Fact], nonzero: Iterable[fmpq_mpoly]
) -> Iterator[str]:
    """What is zero, and what is not."""
    yield from (
        f"  ({fact.name} : {polynomial_text(letters, fact.polynomial)} = 0)" for fact in facts
    )
    yield from (
        f"  (nz{k} : {polynomial_text(letters, one)} <> 0)" for k, one in enumerate(nonzero, 1)
    )


def coq_of_identities(theorem: Theorem) -> str:
    """A file for Coq whose hypotheses are the equations, not where they come from."""
    letters = generator_names(theorem)
    binders = f" ({' '.join(letters.names.values())} : R)" if letters.names else ""
    opening = [
        f"(* {HEAD} *)",
        "Require Import Reals Lra.",
        "Open Scope R_scope.",
        "",
        prelude("lemmas"),
    ]
    lines = [*opening, *(f"(* {name} is {text} *)" for name, text in letters.meanings.items())]
    for fact, text in theorem.equations:
        lines.append(f"(* {fact.name} is {text}, without denominators and common factors *)")
    facts = (*theorem.relations, *(fact for fact, _ in theorem.equations))
    lines += [f"Theorem {theorem.name}{binders}", *hypotheses(letters, facts, theorem.nonzero)]
    lines += [f"  : {polynomial_text(letters, theorem.steps[-1].gives.polynomial)} = 0.", "Proof."]
    return "\n".join([*lines, *coq_steps(theorem, letters), "Qed.", ""])


def prelude(name: str) -> str:
    """A part of Coq's own text that every file with such theorems has, of the folder `prelude`."""
    return (Path(__file__).parent / "prelude" / f"{name}.v").read_text(encoding="utf-8")


def coq_steps(theorem: Theorem, letters: GeneratorNames) -> Iterator[str]:
    """The steps from the equations to the end."""
    for step in theorem.steps[:-1]:
        yield f"  assert ({step.gives.name} : {polynomial_text(letters, step.gives.polynomial)} = 0)."
        yield f"  {{ {_coq_step(letters, step)} }}"
    yield f"  {_coq_step(letters, theorem.steps[-1])}"


def _coq_step(letters: GeneratorNames, step: Identity) -> str:
    factor, total = factored_text(letters, step.factor), combination(letters, step.terms)
    return f"apply (cancel ({factor})); [nonzero |].\n    transitivity ({total}); [ring | zero]."


class System(FormalSystem):
    """The formulas of theorems over one ring, as Coq has them: generators, their slopes, f, and L
    if there is one.
    """

    def __init__(self, theorems: Sequence[Theorem]) -> None:
        self.theorems, first = theorems, theorems[0]
        origin = first.origin
        if origin is None:
            raise exact_field.TooLarge("long factors are separate generators")
        super().__init__(origin)
        self.lagrangian = origin.lagrangian
        self.entries = {pair: self.place(symbol) for pair, symbol in origin.symbols.items()}
        self.used = self._generators_used()
        self.names = generator_names(first, self.used)
        self.numbers = {k: number for number, k in enumerate(sorted(self.used, reverse=True))}

    @property
    def binders(self) -> str:
        """The names of the generators, in order."""
        return " ".join(self.names.names[k] for k in self.numbers)

    def _generators_used(self) -> set[int]:
        """The generators that occur in the formulas, in their slopes, and in the theorems."""
        variables = {
            k
            for k, tree in self.ring.trees.items()
            if tree in self.ring.variables and tree != ex.TIME
        }
        polynomials = [value.numerator for value in self.given]
        polynomials += [self.field.denominators[k] for k in self.below]
        polynomials += [p for theorem in self.theorems for p in polynomials_of(theorem)]
        used = variables | {*self.entries.values()}
        waiting = {
            k for p in polynomials for k, degree in enumerate(p.degrees()) if degree > 0
        } | used
        used = set()
        while waiting:
            used |= waiting
            slopes = (table[k] for table in self.ring.images for k in waiting if k in table)
            found = {
                k for s in slopes for k, degree in enumerate(s.numerator.degrees()) if degree > 0
            }
            waiting = found - used
        return used

    # What is written

    def definitions(self) -> Iterator[str]:
        """The generators, the slopes of those that have any, f, the velocities, and the values of
        the generators.
        """
        n, name = self.size, self.names.names
        for letter, meaning in self.names.meanings.items():
            yield f"(* {letter} is {meaning} *)"
        for k, number in self.numbers.items():
            yield f"Definition _{name[k]} := var {number}."
        for place, k in enumerate(self.below):
            yield f"Definition inverse_{place + 1} := var {len(self.numbers) + place}.  (* 1/({self.text(k)}) *)"
        yield f"Definition size := {n}%nat."
        yield "(* dD/d(variable) for the generators other than 1/D; variable 0 is the time. *)"
        yield "Definition slope_of_letter (v k : nat) : poly :=\n  match v, k with"
        for v, table in enumerate(self.formal.images):
            for k, image in table.items():
                if k in self.numbers:
                    yield f"  | {v}%nat, {self.numbers[k]}%nat => {self.polynomial(image)}"
        yield "  | _, _ => []\n  end."
        denominators = [self.polynomial(self.denominator(k)) for k in self.below]
        yield from _by_cases("denominator (k : nat) : poly", "k", denominators, len(self.numbers))
        yield "(* d(1/D) = -(1/D)^2 dD *)"
        yield "Definition slope (v k : nat) : poly :="
        yield f"  if Nat.ltb k {len(self.numbers)} then slope_of_letter v k"
        yield "  else (num (-1) * var k ^ 2 * derive (slope_of_letter v) (denominator k))%poly."
        rates = [f"_{name[self.place(rate)]}" for rate in self.ring.variables[1 + n :]]
        yield from _by_cases("velocity (i : nat) : poly", "i", rates)
        yield from _by_cases("f (i : nat) : poly", "i", map(self.polynomial, self.accelerations))
        yield prelude("tensors")
        values = [*(name[k] for k in self.numbers), *(f"/ ({self.text(k)})" for k in self.below)]
        yield from _by_cases(
            f"point ({self.binders} : R) (which : nat) : R", "which", values, otherwise="0"
        )

    def text(self, k: int) -> str:
        """A denominator as real numbers."""
        return polynomial_text(self.names, self.field.denominators[k])

    def polynomial(self, value: exact_field.Quotient) -> str:
        """The polynomial in the generators of the file."""
        letters = {k: f"_{name}" for k, name in self.names.names.items()}
        letters |= {self.count + place: f"inverse_{place + 1}" for place in range(len(self.below))}
        terms = []
        for exponents, c in value.numerator.to_dict().items():
            powers = [
                f"{letters[k]} ^ {e}" if e > 1 else letters[k] for k, e in enumerate(exponents) if e
            ]
            number = polynomials.as_fraction(c)
            written = f"num ({number.numerator} # {number.denominator})"
            terms.append(" * ".join(powers if number == 1 and powers else [written, *powers]))
        return f"({' + '.join(terms) or 'num 0'})%poly"

    def at_point(self, polynomial: str) -> str:
        return f"Motion.value (Motion.point {self.binders}) ({polynomial})"


def _by_cases(
    head: str, of: str, values: Iterable[str], first: int = 0, otherwise: str = "[]"
) -> Iterator[str]:
    """The definition of a function of the number `of`, with the values from the number `first`
    on.
    """
    yield f"Definition {head} :=\n  match {of} with"
    yield from (f"  | {k}%nat => {value}" for k, value in enumerate(values, first))
    yield f"  | _ => {otherwise}\n  end."


def coq(theorems: Sequence[Theorem]) -> str:
    """A file that Coq 8.16 compiles; without the definition of f if its long factors are separate
    generators.
    """
    try:
        system = System(theorems)
        further = prelude("conditions" if system.entries else "euler_lagrange")
        tactics = prelude("tactics") + prelude("lemmas")
        if system.lagrangian is None:
            given, proofs = [*_entries(system)], [_of_conditions(system)]
        else:
            given = [
                f"Definition L : poly := {system.polynomial(system.element(system.lagrangian))}."
            ]
            proofs = [_of_lagrangian(system, k) for k in range(len(theorems))]
        return "\n".join(
            [prelude("polynomials"), *system.definitions(), *given, further, tactics, *proofs]
        )
    except exact_field.TooLarge as error:
        return f"(* f is not defined in this file: {error}. *)\n" + coq_of_identities(theorems[0])


def _entries(system: System) -> Iterator[str]:
    yield "(* The multiplier, a symmetric matrix of real numbers. *)"
    yield "Definition g (i j : nat) : poly :=\n  match i, j with"
    for (i, j), k in system.entries.items():
        yield from (
            f"  | {a}%nat, {b}%nat => _{system.names.names[k]}" for a, b in sorted({(i, j), (j, i)})
        )
    yield "  | _, _ => []\n  end."


def _tensor(name: hierarchy.ConditionName) -> str:
    """nabla (nabla Phi) for nabla^2 Phi, curvature (nabla Phi) for R[nabla Phi]."""
    of_curvature = name.kind is hierarchy.Kind.CURVATURE
    found = "(Motion.curvature Motion.Phi)" if of_curvature else "Motion.Phi"
    for _ in range(name.power):
        found = f"(Motion.{'nabla_R' if of_curvature else 'nabla'} {found})"
    if name.kind is hierarchy.Kind.CURVATURE_OF:
        return f"(Motion.curvature {found})"
    return found


def _condition(name: hierarchy.EquationName) -> str:
    indices = " ".join(f"{i}%nat" for i in name.indices)
    return f"Motion.{'cyclic' if name.condition.cyclic else 'symmetric'} {_tensor(name.condition)} {indices}"


def _of_conditions(system: System) -> str:
    """det g = 0 for every g with the conditions of this f at this point."""
    (theorem,) = system.theorems
    origin = theorem.origin
    assert origin is not None
    depth = hierarchy.depth_of(name for name, _ in origin.rows)
    tensors = hierarchy.tensors_to_depth(system.motion(), depth)
    steps, proofs = list[Identity](), list[str]()
    relations = relations_of(system.ring)
    for (fact, _), (name, row) in zip(theorem.equations, origin.rows, strict=True):
        terms = hierarchy.equation_terms(name.condition, tensors[name.condition], system.size)[name]
        ring = system.formal
        summands = [
            (coefficient * ring.generator(system.entries[pair])).scaled(sign)
            for pair, sign, coefficient in terms
        ]
        formal = exact_field.sum_of(ring.constant(0), summands)
        whole, most = system.cleared(formal, dict(row.exponents))
        number = row.numerator.leading_coefficient() / fact.polynomial.leading_coefficient()
        factor = system.field.context.constant(number)
        for k, m in most.items():
            factor = factor * system.field.denominators[k] ** (m - dict(row.exponents).get(k, 0))
        difference = whole - factor * fact.polynomial
        found = without_remainder(
            difference, relations, system.field.budget, "the difference of two equal conditions"
        )
        given = Fact(f"row{fact.name[2:]}", whole)
        back = [(-c, relation) for c, relation in found.terms]
        step = identity(fact, factor * found.multiplier, [(found.multiplier, given), *back])
        steps.append(step)
        proofs.append(_from_row(system, step, given, most))
    relation_facts = {
        fact.name: fact
        for step in (*steps, *theorem.steps)
        for _, fact in step.terms
        if fact.name.startswith("rel")
    }
    nonzero = _nonzero(system, [*steps, *theorem.steps])
    rows = [
        f"  (row{fact.name[2:]} : {system.at_point(_condition(name))} = 0)"
        for (fact, _), (name, _) in zip(theorem.equations, origin.rows, strict=True)
    ]
    rows = ["  (* " + ", ".join(text for _, text in theorem.equations) + " *)", *rows]
    return _theorem(system, theorem, [*relation_facts.values()], nonzero, rows, proofs)


def _from_row(system: System, step: Identity, given: Fact, most: Mapping[int, int]) -> str:
    """The equation of the elimination, from the original condition."""
    letters = system.names
    factor = factored_text(letters, step.factor)
    scale = next(c for c, fact in step.terms if fact.name == given.name)
    below = product_text(letters, [(system.field.denominators[k], m) for k, m in most.items()])
    others = [(c, fact) for c, fact in step.terms if fact.name != given.name]
    total = f"(({polynomial_text(letters, scale)}) * {below}) * whole"
    total += f" + {combination(letters, others)}" if others else ""
    return (
        f"  assert ({step.gives.name} : {polynomial_text(letters, step.gives.polynomial)} = 0).\n"
        f"  {{ Motion.computed {given.name}. apply (cancel ({factor})); [nonzero |].\n"
        f"    match type of {given.name} with ?whole = 0 => transitivity ({total}) end; [field; nonzero | zero]. }}"
    )


def _of_lagrangian(system: System, k: int) -> str:
    """One Euler-Lagrange expression of L along the motion, by the derivatives of L that Coq
    takes.
    """
    theorem = system.theorems[k]
    (step,) = theorem.steps
    factor = factored_text(system.names, step.factor, theorem.denominators)
    lines = [f"  Motion.compute_goal. apply (cancel ({factor})); [nonzero |]."]
    lines += [f"  transitivity ({combination(system.names, step.terms)}); [field; nonzero | zero]."]
    facts = [fact for _, fact in step.terms]
    nonzero = _nonzero(system, [step])
    return _theorem(system, theorem, facts, nonzero, [], lines, f"Motion.euler_lagrange {k}%nat")


def _nonzero(system: System, steps: Iterable[Identity]) -> list[fmpq_mpoly]:
    """The polynomials that must not vanish: denominators, and the factors by which the steps
    divide.
    """
    return distinct(
        [*(system.field.denominators[k] for k in system.below), *factors_divided_by(steps)]
    )


def _theorem(
    system: System,
    theorem: Theorem,
    relations: Sequence[Fact],
    nonzero: Sequence[fmpq_mpoly],
    rows: Sequence[str],
    proofs: Sequence[str],
    expression: str = "",
) -> str:
    letters = system.names
    given = hypotheses(letters, relations, nonzero)
    last = theorem.steps[-1]
    said = (
        system.at_point(expression)
        if expression
        else polynomial_text(letters, last.gives.polynomial)
    )
    lines = [
        f"Theorem {theorem.name} ({system.binders} : R)",
        *given,
        *rows,
        f"  : {said} = 0.",
        "Proof.",
        *proofs,
    ]
    if not expression:
        lines += coq_steps(theorem, letters)
    return "\n".join([*lines, "Qed.", _example(system, theorem, relations, nonzero), ""])


def _example(
    system: System, theorem: Theorem, relations: Sequence[Fact], nonzero: Sequence[fmpq_mpoly]
) -> str:
    """A rational point where the hypotheses on denominators and relations hold."""
    letters, source = system.names, random.Random(1)
    for _ in range(ATTEMPTS):
        values = [Fraction(0)] * system.count
        for k in sorted(system.used, reverse=True):
            relation = system.field.relations.get(k)
            found = (
                source.choice(SAMPLES)
                if relation is None
                else _root(_at(relation.right, values), relation.degree)
            )
            if found is None:
                break
            values[k] = found
        else:
            if all(_at(one, values) for one in nonzero):
                break
    else:
        return "(* No rational point was found where the hypotheses hold. *)"
    said = [f"{polynomial_text(letters, fact.polynomial)} = 0" for fact in relations]
    said += [f"{polynomial_text(letters, one)} <> 0" for one in nonzero]
    if not said:
        return ""
    chosen = ", ".join(f"({values[k].numerator} / {values[k].denominator})" for k in system.numbers)
    return (
        f"(* Such numbers exist. *)\nExample somewhere_{theorem.name} : exists {system.binders} : R,\n  "
        + " /\\\n  ".join(said)
        + f".\nProof. exists {chosen}; repeat split; lra. Qed."
    )


def _at(polynomial: fmpq_mpoly, values: Sequence[Fraction]) -> Fraction:
    return polynomials.as_fraction(
        polynomial(*(fmpq(value.numerator, value.denominator) for value in values))
    )


def _root(value: Fraction, degree: int) -> Fraction | None:
    """The positive rational root of this degree."""
    if value <= 0:
        return None
    found = [round(part ** (1 / degree)) for part in (value.numerator, value.denominator)]
    candidate = Fraction(found[0], found[1]) if found[1] else Fraction(0)
    return candidate if candidate**degree == value else None
