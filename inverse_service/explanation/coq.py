"""The verdict of a result as a file that Coq compiles, or as identities, or a sentence that says why none is written.

In the file f, its derivatives, and the tensors are defined and computed.

Polynomials with rational coefficients are lists there, `derive` is the derivation with given values on the generators.
A generator is a coordinate, a velocity, an atom of the formulas (u3 for sin(x)), an entry of the multiplier, or 1/D
for a denominator D. Tensors of a system are polynomials in these generators, with the formulas of
`mechanics.conditions`; a condition at a point is the value of such a polynomial at given values of the generators. The
only unproved statements are the comments on the meaning of generators, for example that u3, which has the derivative
u4, is sin(x).
"""

from __future__ import annotations

import json
import random
import sys
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mpoly

from inverse_service import deadline, errors
from inverse_service.decision import deciding
from inverse_service.explanation import hierarchy, negative, theorems as th
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import reading, second_order_system
from inverse_service.mechanics.conditions import Motion
from inverse_service.reading import reader
from inverse_service.reading.names import Names

SAMPLES = [
    Fraction(*pair) for pair in ((1, 1), (2, 1), (3, 1), (-1, 1), (1, 2), (3, 5), (4, 5), (5, 13), (5, 1), (-2, 3))
]
ATTEMPTS = 400
TERM_LIMIT = 20_000
TIME_LIMIT = 10.0


class NoTheorem(Exception):
    """The verdict has no proof of this kind; its text says why."""


def proof_document(result: dict[str, Any], form: str, seed: int) -> str:
    """A file for "coq", or the "identities" as JSON; where there are none, the reason in their place."""
    theorems, reason = _theorems(result, seed)
    domain = result.get("domain") or []
    if form == "identities":
        found = {"theorems": th.identities(theorems), "domain": domain, "reason": reason}
        return json.dumps(found, ensure_ascii=False, indent=2) + "\n"
    lines = _about(result) if theorems else [reason]
    return (coq(theorems) if theorems else "") + "".join(f"(* {line} *)\n" for line in lines)


def _about(result: dict[str, Any]) -> list[str]:
    """Which system the theorems are about, and on which set its formulas are those."""
    equations = _certificate(result)["system"]["equations"]
    lines = [f"The system: {name}'' = {text}" for name, text in equations.items()]
    return [*lines, f"The formulas are those on {', '.join(result['domain'])}."] if result.get("domain") else lines


def _theorems(result: dict[str, Any], seed: int) -> tuple[Sequence[th.Theorem], str]:
    try:
        return _of_certificate(_certificate(result), seed), ""
    except (NoTheorem, exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError) as problem:
        return (), f"No proof by identities is written: {str(problem).rstrip('.')}."


def _certificate(result: dict[str, Any]) -> dict[str, Any]:
    found = result.get("certificate") or (result.get("with_time") or {}).get("certificate")
    if not isinstance(found, dict):
        raise NoTheorem("the answer has no certificate")
    if "velocities" in found["system"]:
        raise NoTheorem("the claim is about the motion on constraints, not about a single system of equations")
    return found


def _of_certificate(certificate: dict[str, Any], seed: int) -> Sequence[th.Theorem]:
    given = certificate["system"]
    functions = {name: tuple(arguments) for name, arguments in (given.get("functions") or {}).items()}
    if any(map(reader.has_acceleration, given["equations"].values())):
        raise NoTheorem("the equations are not solved for the accelerations")
    system = reading.read_system(given["coordinates"], given["equations"], given.get("parameters") or (), functions)
    budget = exact_field.Budget(TERM_LIMIT, deadline.now() + TIME_LIMIT)
    if certificate["kind"] == "nonexistence":
        return [_negative(system, seed, budget)]
    if certificate["kind"] == "existence":
        raise NoTheorem("no Lagrangian in closed form was found; its existence follows from involution")
    if certificate.get("integrals"):
        raise NoTheorem("the Lagrangian holds integrals")
    names = Names(system.coordinates, system.parameters, functions)
    lagrangian = reader.read_formula(certificate["lagrangian"], names)
    return th.euler_lagrange_hold(deciding.analyze(system).system, lagrangian, budget)


def _negative(system: second_order_system.SecondOrderSystem, seed: int, budget: exact_field.Budget) -> th.Theorem:
    analysis = deciding.analyze(system)
    chosen = hierarchy.smallest_sufficient_set(analysis, seed)
    if chosen is None:
        raise NoTheorem("the argument differentiates the conditions, so it does not consist of algebraic steps alone")
    if len(system.coordinates) > negative.LARGEST_N:
        raise NoTheorem(f"there are more than {negative.LARGEST_N} coordinates")
    return th.determinant_vanishes(analysis, chosen, seed, budget)


class System:
    """The formulas of theorems over one ring, as Coq has them: generators, their slopes, f, and L if there is one.

    `formal` are the polynomials in these generators and those 1/D, with no relation between them used.
    """

    def __init__(self, theorems: Sequence[th.Theorem]) -> None:
        self.theorems, first = theorems, theorems[0]
        origin = first.origin
        if origin is None:
            raise exact_field.TooLarge("long factors are separate generators")
        self.ring, self.field, self.size = origin.exact.ring, origin.exact.ring.field, origin.exact.motion.size
        self.entries = {pair: self.place(symbol) for pair, symbol in origin.symbols.items()}
        self.lagrangian = origin.lagrangian
        motion = origin.exact.motion
        given = [*motion.accelerations, *([self.lagrangian] if self.lagrangian is not None else [])]
        images = [image for table in self.ring.images for image in table.values()]
        self.below = sorted({k for value in (*given, *images) for k, _ in value.exponents})
        self.count = len(self.field.context.names())
        unbounded = exact_field.Budget(sys.maxsize, self.field.budget.deadline)
        field = exact_field.QuotientField.with_generators(self.count + len(self.below), unbounded)
        self.formal = exact_field.ExactRing(field, self.ring.variables, 0, undefined=self.ring.undefined)
        for table in self.ring.images:
            found = {k: self.element(image) for k, image in table.items()}
            by = exact_field.Derivation(found)
            for place, k in enumerate(self.below, self.count):  # d(1/D) = -(1/D)^2 dD
                found[place] = -(self.formal.generator(place) ** 2) * by(self.denominator(k))
            self.formal.images.append(found)
        self.accelerations = [self.element(f) for f in motion.accelerations]
        self.used = self._used(given)
        self.names = th.letters_of(first, self.used)
        self.numbers = {k: number for number, k in enumerate(sorted(self.used, reverse=True))}

    def place(self, tree: ex.Symbol) -> int:
        return next(k for k, known in self.ring.trees.items() if known == tree)

    def _used(self, given: Sequence[exact_field.Quotient]) -> set[int]:
        """The generators that occur in the formulas, in their slopes, and in the theorems."""
        variables = {k for k, tree in self.ring.trees.items() if tree in self.ring.variables and tree != ex.TIME}
        polynomials = [value.numerator for value in given]
        polynomials += [self.field.denominators[k] for k in self.below]
        polynomials += [p for theorem in self.theorems for p in th.polynomials_of(theorem)]
        used = variables | {*self.entries.values()}
        waiting = {k for p in polynomials for k, degree in enumerate(p.degrees()) if degree > 0} | used
        used = set()
        while waiting:
            used |= waiting
            slopes = (table[k] for table in self.ring.images for k in waiting if k in table)
            found = {k for s in slopes for k, degree in enumerate(s.numerator.degrees()) if degree > 0}
            waiting = found - used
        return used

    def denominator(self, k: int) -> exact_field.Quotient:
        """D in terms of the generators."""
        return self.element(exact_field.Quotient(self.field, self.field.denominators[k], ()))

    def element(self, value: exact_field.Quotient) -> exact_field.Quotient:
        """N / (D_1^e_1 ...) as N times powers of the generators 1/D."""
        powers = [0] * len(self.below)
        for k, e in value.exponents:
            if k not in self.below:
                raise exact_field.TooLarge("a denominator that f does not have")
            powers[self.below.index(k)] = e
        table = {(*exponents, *powers): c for exponents, c in value.numerator.to_dict().items()}
        return exact_field.Quotient(self.formal.field, self.formal.field.context.from_dict(table), ())

    def motion(self) -> Motion[exact_field.Quotient]:
        ring, n = self.formal, self.size
        velocities = [ring.generator(self.place(v)) for v in ring.variables[1 + n :]]  # type: ignore[arg-type]
        partials = [ring.partial(k) for k in range(1, 2 * n + 1)]
        along = ring.along([ring.constant(1), *velocities, *self.accelerations])
        return Motion(tuple(self.accelerations), tuple(partials[:n]), tuple(partials[n:]), along, ring.constant(0))

    def cleared(self, formal: exact_field.Quotient, least: Mapping[int, int]) -> tuple[fmpq_mpoly, dict[int, int]]:
        """(the product with D^m, m): a polynomial in the generators, m at least `least`."""
        tables = [exponents[self.count :] for exponents in formal.numerator.to_dict()]
        most = {k: max([least.get(k, 0), *(table[place] for table in tables)]) for place, k in enumerate(self.below)}
        whole = self.field.context.constant(0)
        for exponents, c in formal.numerator.to_dict().items():
            term = self.field.context.from_dict({exponents[: self.count]: c})
            for place, k in enumerate(self.below):
                term = term * self.field.denominators[k] ** (most[k] - exponents[self.count + place])
            self.field.budget.charge(len(term))
            whole = whole + term
        return whole, {k: m for k, m in most.items() if m}

    # What is written

    def definitions(self) -> Iterator[str]:
        """The generators, the slopes of those that have any, f, the velocities, and the values of the generators."""
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
        yield "Definition denominator (k : nat) : poly :=\n  match k with"
        for place, k in enumerate(self.below):
            yield f"  | {len(self.numbers) + place}%nat => {self.polynomial(self.denominator(k))}"
        yield "  | _ => []\n  end."
        yield "(* d(1/D) = -(1/D)^2 dD *)"
        yield "Definition slope (v k : nat) : poly :="
        yield f"  if Nat.ltb k {len(self.numbers)} then slope_of_letter v k"
        yield "  else (num (-1) * var k ^ 2 * derive (slope_of_letter v) (denominator k))%poly."
        yield "Definition velocity (i : nat) : poly :=\n  match i with"
        for i, rate in enumerate(self.ring.variables[1 + n :]):
            yield f"  | {i}%nat => _{name[self.place(rate)]}"  # type: ignore[arg-type]
        yield "  | _ => []\n  end."
        yield "Definition f (i : nat) : poly :=\n  match i with"
        for i, acceleration in enumerate(self.accelerations):
            yield f"  | {i}%nat => {self.polynomial(acceleration)}"
        yield "  | _ => []\n  end."
        yield th.prelude("tensors")
        values = [f"  | {number}%nat => {name[k]}" for k, number in self.numbers.items()]
        values += [f"  | {len(self.numbers) + place}%nat => / ({self.text(k)})" for place, k in enumerate(self.below)]
        binders = f"({' '.join(name[k] for k in self.numbers)} : R) "
        yield f"Definition point {binders}(which : nat) : R :=\n  match which with"
        yield from values
        yield "  | _ => 0\n  end."

    def text(self, k: int) -> str:
        """A denominator as real numbers."""
        return th.polynomial_text(self.names, self.field.denominators[k])

    def polynomial(self, value: exact_field.Quotient) -> str:
        """The polynomial in the generators of the file."""
        letters = {k: f"_{name}" for k, name in self.names.names.items()}
        letters |= {self.count + place: f"inverse_{place + 1}" for place in range(len(self.below))}
        terms = []
        for exponents, c in value.numerator.to_dict().items():
            powers = [f"{letters[k]} ^ {e}" if e > 1 else letters[k] for k, e in enumerate(exponents) if e]
            number = exact_field.as_fraction(c)
            written = f"num ({number.numerator} # {number.denominator})"
            terms.append(" * ".join(powers if number == 1 and powers else [written, *powers]))
        return f"({' + '.join(terms) or 'num 0'})%poly"

    def at_point(self, polynomial: str) -> str:
        return f"Motion.value (Motion.point {' '.join(self.names.names[k] for k in self.numbers)}) ({polynomial})"


def coq(theorems: Sequence[th.Theorem]) -> str:
    """A file that Coq 8.16 compiles; without the definition of f if its long factors are separate generators."""
    try:
        system = System(theorems)
        further = th.prelude("conditions" if system.entries else "euler_lagrange")
        tactics = th.prelude("tactics") + th.prelude("lemmas")
        if system.lagrangian is None:
            given, proofs = [*_entries(system)], [_of_conditions(system)]
        else:
            given = [f"Definition L : poly := {system.polynomial(system.element(system.lagrangian))}."]
            proofs = [_of_lagrangian(system, k) for k in range(len(theorems))]
        return "\n".join([th.prelude("polynomials"), *system.definitions(), *given, further, tactics, *proofs])
    except exact_field.TooLarge as error:
        return f"(* f is not defined in this file: {error}. *)\n" + th.coq_of_identities(theorems[0])


def _entries(system: System) -> Iterator[str]:
    yield "(* The multiplier, a symmetric matrix of real numbers. *)"
    yield "Definition g (i j : nat) : poly :=\n  match i, j with"
    for (i, j), k in system.entries.items():
        yield from (f"  | {a}%nat, {b}%nat => _{system.names.names[k]}" for a, b in sorted({(i, j), (j, i)}))
    yield "  | _, _ => []\n  end."


def _tensor(name: str) -> str:
    """nabla (nabla Phi) for "nabla^2 Phi", curvature (nabla Phi) for "R[nabla Phi]"."""
    if name.startswith("R["):
        return f"(Motion.curvature {_tensor(name[2:-1])})"
    operator, _, rest = name.rpartition(" ")
    found = "Motion.Phi" if rest == "Phi" else "(Motion.curvature Motion.Phi)"
    for _ in range(int(operator.partition("^")[2] or 1) if operator else 0):
        found = f"(Motion.{'nabla' if rest == 'Phi' else 'nabla_R'} {found})"
    return found


def _condition(name: hierarchy.EquationName) -> str:
    indices = " ".join(f"{i}%nat" for i in name.indices)
    return f"Motion.{'cyclic' if name.condition.cyclic else 'symmetric'} {_tensor(name.condition.name)} {indices}"


def _of_conditions(system: System) -> str:
    """det g = 0 for every g with the conditions of this f at this point."""
    (theorem,) = system.theorems
    origin = theorem.origin
    assert origin is not None
    depth = max(name.condition.order for name, _ in origin.rows) - 2
    tensors = hierarchy.tensors_to_depth(system.motion(), depth)
    steps, proofs = list[th.Identity](), list[str]()
    relations = th.relations_of(system.ring)
    for (fact, _), (name, row) in zip(theorem.equations, origin.rows, strict=True):
        terms = hierarchy.equation_terms(name.condition, tensors[name.condition], system.size)[name]
        ring = system.formal
        summands = [
            (coefficient * ring.generator(system.entries[pair])).scaled(sign) for pair, sign, coefficient in terms
        ]
        formal = exact_field.sum_of(ring.constant(0), summands)
        whole, most = system.cleared(formal, dict(row.exponents))
        number = row.numerator.leading_coefficient() / fact.polynomial.leading_coefficient()
        factor = system.field.context.constant(number)
        for k, m in most.items():
            factor = factor * system.field.denominators[k] ** (m - dict(row.exponents).get(k, 0))
        found = th.divided(whole - factor * fact.polynomial, relations, system.field.budget)
        if not found.rest.is_zero():
            raise exact_field.TooLarge("a condition was not recognized")
        given = th.Fact(f"row{fact.name[2:]}", whole)
        back = [(-c, relation) for c, relation in found.terms]
        step = th.identity(fact, factor * found.multiplier, [(found.multiplier, given), *back])
        steps.append(step)
        proofs.append(_from_row(system, step, given, most))
    relation_facts = {
        fact.name: fact for step in (*steps, *theorem.steps) for _, fact in step.terms if fact.name.startswith("rel")
    }
    nonzero = _nonzero(system, theorem, steps)
    rows = [
        f"  (row{fact.name[2:]} : {system.at_point(_condition(name))} = 0)"
        for (fact, _), (name, _) in zip(theorem.equations, origin.rows, strict=True)
    ]
    rows = ["  (* " + ", ".join(text for _, text in theorem.equations) + " *)", *rows]
    return _theorem(system, theorem, [*relation_facts.values()], nonzero, rows, proofs)


def _from_row(system: System, step: th.Identity, given: th.Fact, most: Mapping[int, int]) -> str:
    """The equation of the elimination, from the original condition."""
    letters, (number, powers) = system.names, exact_field.factor_polynomial(step.factor)
    factor = th.product_text(letters, powers, str(number))
    scale = next(c for c, fact in step.terms if fact.name == given.name)
    below = th.product_text(letters, [(system.field.denominators[k], m) for k, m in most.items()])
    others = [(c, fact) for c, fact in step.terms if fact.name != given.name]
    total = f"(({th.polynomial_text(letters, scale)}) * {below}) * whole"
    total += f" + {th.combination(letters, others)}" if others else ""
    return (
        f"  assert ({step.gives.name} : {th.polynomial_text(letters, step.gives.polynomial)} = 0).\n"
        f"  {{ Motion.computed {given.name}. apply (cancel ({factor})); [nonzero |].\n"
        f"    match type of {given.name} with ?whole = 0 => transitivity ({total}) end; [field; nonzero | zero]. }}"
    )


def _of_lagrangian(system: System, k: int) -> str:
    """One Euler-Lagrange expression of L along the motion, by the derivatives of L that Coq takes."""
    theorem = system.theorems[k]
    motion = system.motion()
    assert system.lagrangian is not None
    value = system.element(system.lagrangian)
    formal = motion.along(motion.by_velocity[k](value)) - motion.by_coordinate[k](value)
    whole, most = system.cleared(formal, {})
    found = th.divided(whole, th.relations_of(system.ring), system.field.budget)
    if not found.rest.is_zero():
        raise exact_field.TooLarge("an Euler-Lagrange expression was not recognized as zero")
    step = th.identity(th.Fact("residual", whole), found.multiplier, found.terms)
    letters = system.names
    number, powers = exact_field.factor_polynomial(step.factor)
    factor = th.product_text(
        letters, [*powers, *((system.field.denominators[i], m) for i, m in most.items())], str(number)
    )
    total = th.combination(letters, step.terms)
    lines = [f"  Motion.compute_goal. apply (cancel ({factor})); [nonzero |]."]
    lines += [f"  transitivity ({total}); [field; nonzero | zero]."]
    facts = [fact for _, fact in step.terms]
    return _theorem(
        system, theorem, facts, _nonzero(system, theorem, [step]), [], lines, f"Motion.euler_lagrange {k}%nat"
    )


def _nonzero(system: System, theorem: th.Theorem, steps: Sequence[th.Identity]) -> list[fmpq_mpoly]:
    """The polynomials that must not vanish: denominators, and the factors by which steps are divided."""
    own = theorem.steps if system.lagrangian is None else ()
    divisors = [factor for step in (*steps, *own) for factor, _ in exact_field.factor_polynomial(step.factor)[1]]
    listed = [*(system.field.denominators[k] for k in system.below), *divisors]
    return list({str(one): one for one in listed if not one.is_constant()}.values())


def _theorem(
    system: System,
    theorem: th.Theorem,
    relations: Sequence[th.Fact],
    nonzero: Sequence[fmpq_mpoly],
    rows: Sequence[str],
    proofs: Sequence[str],
    expression: str = "",
) -> str:
    letters = system.names
    binders = " ".join(letters.names[k] for k in system.numbers)
    given = th.hypotheses(letters, relations, nonzero)
    last = theorem.steps[-1]
    said = system.at_point(expression) if expression else th.polynomial_text(letters, last.gives.polynomial)
    lines = [f"Theorem {theorem.name} ({binders} : R)", *given, *rows, f"  : {said} = 0.", "Proof.", *proofs]
    if not expression:
        lines += th.coq_steps(theorem, letters)
    return "\n".join([*lines, "Qed.", _example(system, theorem, relations, nonzero), ""])


def _example(system: System, theorem: th.Theorem, relations: Sequence[th.Fact], nonzero: Sequence[fmpq_mpoly]) -> str:
    """A rational point where the hypotheses on denominators and relations hold."""
    letters, source = system.names, random.Random(1)
    for _ in range(ATTEMPTS):
        values = [Fraction(0)] * system.count
        for k in sorted(system.used, reverse=True):
            relation = system.field.relations.get(k)
            found = source.choice(SAMPLES) if relation is None else _root(_at(relation.right, values), relation.degree)
            if found is None:
                break
            values[k] = found
        else:
            if all(_at(one, values) for one in nonzero):
                break
    else:
        return "(* No rational point was found where the hypotheses hold. *)"
    said = [f"{th.polynomial_text(letters, fact.polynomial)} = 0" for fact in relations]
    said += [f"{th.polynomial_text(letters, one)} <> 0" for one in nonzero]
    if not said:
        return ""
    chosen = ", ".join(f"({values[k].numerator} / {values[k].denominator})" for k in system.numbers)
    binders = " ".join(letters.names[k] for k in system.numbers)
    return (
        f"(* Such numbers exist. *)\nExample somewhere_{theorem.name} : exists {binders} : R,\n  "
        + " /\\\n  ".join(said)
        + f".\nProof. exists {chosen}; repeat split; lra. Qed."
    )


def _at(polynomial: fmpq_mpoly, values: Sequence[Fraction]) -> Fraction:
    return exact_field.as_fraction(polynomial(*(fmpq(value.numerator, value.denominator) for value in values)))


def _root(value: Fraction, degree: int) -> Fraction | None:
    """The positive rational root of this degree."""
    if value <= 0:
        return None
    found = [round(part ** (1 / degree)) for part in (value.numerator, value.denominator)]
    candidate = Fraction(found[0], found[1]) if found[1] else Fraction(0)
    return candidate if candidate**degree == value else None
