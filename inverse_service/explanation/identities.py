"""Theorems behind a verdict, as identities in plain data.

The identities are of the form factor * P = sum of cofactor * fact between polynomials over Q: P = 0
where the factor is not 0, where P and the facts are polynomials in generators of any meaning;
relations of the generators are facts like any other. They state det g = 0 from the algebraic
conditions, or the Euler-Lagrange equations of L.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.certificate import checker
from inverse_service.decision import deciding
from inverse_service.explanation import hierarchy, negative
from inverse_service.expressions import polynomials, printing, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import conditions, second_order_system
from inverse_service.mechanics.conditions import Motion

TEXT, WORD = r"(?s:.*)", r"[A-Za-z_][A-Za-z0-9_]*"
POWER = rf"(?:[0-9]+|{WORD}(?:\^[0-9]{{1,4}})?)"
MONOMIAL = re.compile(rf"\s*([+-]?)\s*({POWER}(?:\*{POWER})*)\s*")
STEP = {"name": WORD, "gives": TEXT, "factor": TEXT, "cofactors": {}}
THEOREM = {
    "theorem": WORD,
    "relations": {},
    "equations": {},
    "nonzero": [TEXT, checker.MAX_MEMBERS],
    "steps": [STEP, checker.MAX_MEMBERS],
}
MAX_PRODUCTS = 50_000_000  # of terms in an identity

# Where an identity is too long, each factor of more terms than this is replaced by a new generator.
TERMS_OF_A_FACTOR = 4
Row = Mapping[hierarchy.Unknown, tuple[fmpq_mpoly, list[tuple[fmpq_mpoly, int]]]]
# Words that name no variable in Coq, and the names that proofs use themselves.
_TAKEN = re.compile(
    r"(eq|row|rel|nz|val|ker)\d+|Motion|whole|which|cancel|plus_zero|times_zero|nonzero|zero|det_g|residual|R|as|at|by|"
    r"cofix|do|else|end|exists|fix|for|forall|from|fun|if|in|let|match|mod|return|then|Type|Prop|Set|SProp|using|where|with"
)


@dataclass(frozen=True, slots=True)
class Fact:
    """`polynomial` = 0, under a name."""

    name: str
    polynomial: fmpq_mpoly


@dataclass(frozen=True, slots=True)
class Identity:
    """factor * gives = sum of cofactor * fact, all with integer coefficients."""

    gives: Fact
    factor: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]

    @property
    def holds(self) -> bool:
        """Whether both sides are the same polynomial: exact, without any point."""
        left = self.factor * self.gives.polynomial
        return bool(
            (left - sum((c * fact.polynomial for c, fact in self.terms), left * 0)).is_zero()
        )


@dataclass(frozen=True, slots=True)
class Divisor:
    """A fact that replaces powers of generator `index` from its own on; its leading coefficient is
    not zero.
    """

    fact: Fact
    index: int


@dataclass(frozen=True, slots=True)
class Remainder:
    """multiplier * P = sum of cofactor * fact + rest."""

    multiplier: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]
    rest: fmpq_mpoly


def divided(
    polynomial: fmpq_mpoly, divisors: Sequence[Divisor], budget: exact_field.Budget
) -> Remainder:
    """Pseudo-division by one divisor after the other."""
    multiplier, rest, cofactors = (
        polynomial * 0 + 1,
        polynomial,
        dict[str, tuple[fmpq_mpoly, Fact]](),
    )
    for divisor in divisors:
        scale, quotient, rest = exact_field.pseudo_division(
            rest, divisor.fact.polynomial, divisor.index, budget
        )
        if not scale.is_one():
            multiplier, cofactors = (
                multiplier * scale,
                {k: (c * scale, f) for k, (c, f) in cofactors.items()},
            )
        known = cofactors.get(divisor.fact.name, (polynomial * 0, divisor.fact))[0]
        cofactors[divisor.fact.name] = known + quotient, divisor.fact
    return Remainder(
        multiplier, tuple(term for term in cofactors.values() if not term[0].is_zero()), rest
    )


def without_remainder(
    polynomial: fmpq_mpoly, divisors: Sequence[Divisor], budget: exact_field.Budget, what: str
) -> Remainder:
    """`divided` with the rest 0; TooLarge, with the name of `what` is zero, if a rest is left."""
    found = divided(polynomial, divisors, budget)
    if not found.rest.is_zero():
        raise exact_field.TooLarge(f"{what} was not recognized as zero")
    return found


def coprime_multiple(polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """A multiple by a rational number with coprime integer coefficients, the first one positive."""
    content = tm.content_of(map(polynomials.as_fraction, polynomial.coeffs())) or 1
    scale = fmpq(*content.as_integer_ratio())
    return polynomial / (-scale if polynomial.leading_coefficient() < 0 else scale)


def distinct(polynomials: Iterable[fmpq_mpoly]) -> list[fmpq_mpoly]:
    """Each polynomial once, without numbers."""
    return list({str(one): one for one in polynomials if not one.is_constant()}.values())


def factors_divided_by(steps: Iterable[Identity]) -> list[fmpq_mpoly]:
    """The irreducible factors by which the steps divide."""
    return [factor for step in steps for factor, _ in polynomials.factor_polynomial(step.factor)[1]]


def identity(gives: Fact, factor: fmpq_mpoly, terms: Sequence[tuple[fmpq_mpoly, Fact]]) -> Identity:
    """The identity, multiplied by a number so that no fraction is left; ArithmeticError where it
    does not hold.
    """
    listed = [(c, fact) for c, fact in terms if not c.is_zero()]
    below = math.lcm(
        *(int(value.q) for c in (factor, *(c for c, _ in listed)) for value in c.coeffs())
    )
    found = Identity(gives, factor * below, tuple((c * below, fact) for c, fact in listed))
    if not found.holds:
        raise ArithmeticError("an identity of a proof does not hold")
    return found


def checked_identities(document: Any) -> list[str]:
    """One sentence for each theorem: relations and equations zero, its factors not, so the last
    `gives` is zero.

    Each step is factor * gives = sum of cofactor * (relation, equation or earlier step).
    """
    checker.check_shape(document, {"theorems": [THEOREM, checker.MAX_MEMBERS]}, "identities")
    if not document["theorems"]:
        raise checker.Incomplete("There are no identities.")
    return [_checked(theorem) for theorem in document["theorems"]]


def _checked(theorem: dict[str, Any]) -> str:
    facts, steps = theorem["relations"] | theorem["equations"], theorem["steps"]
    texts = [
        *facts.values(),
        *theorem["nonzero"],
        *(step[key] for step in steps for key in ("gives", "factor")),
    ]
    texts += [cofactor for step in steps for cofactor in step["cofactors"].values()]
    checker.require(
        steps and all(isinstance(text, str) for text in texts),
        "A theorem needs texts and at least one step.",
    )
    names = sorted({word for text in texts for word in re.findall(WORD, text)}) or ["x"]
    ring = fmpq_mpoly_ctx.get(names, "degrevlex")
    known = {name: _polynomial(text, ring) for name, text in facts.items()}
    nonzero = [_polynomial(text, ring) for text in theorem["nonzero"]]
    for step in steps:
        checker.require(
            {*step["cofactors"]} <= {*known}, f"Step {step['name']} uses a fact not shown before."
        )
        pairs = [(_polynomial(text, ring), known[name]) for name, text in step["cofactors"].items()]
        gives, factor = (_polynomial(step[key], ring) for key in ("gives", "factor"))
        if sum(len(a) * len(b) for a, b in [*pairs, (gives, factor)]) > MAX_PRODUCTS:
            raise checker.Incomplete(f"Step {step['name']} is too long.")
        checker.require(_splits(factor, nonzero), f"The factor of step {step['name']} may be zero.")
        rest = sum((a * b for a, b in pairs), gives * 0) - factor * gives
        checker.require(rest.is_zero(), f"The identity of step {step['name']} does not hold.")
        checker.require(step["name"] not in known, "A name is used twice.")
        known[step["name"]] = gives
    return f"{theorem['theorem']}: the identities hold over the rationals, so {steps[-1]['gives'][:200]} = 0."


def _splits(factor: fmpq_mpoly, nonzero: list[fmpq_mpoly]) -> bool:
    """Whether it is a number times powers of nonzero polynomials."""
    for one in nonzero:
        factor, _ = exact_field.divided_out(factor, one)
    return bool(factor.is_constant() and not factor.is_zero())


def _polynomial(text: str, ring: fmpq_mpoly_ctx) -> fmpq_mpoly:
    """3*x^2*y - 1: a sum of monomials with integer coefficients."""
    table, position, names = dict[tuple[int, ...], int](), 0, ring.names()
    while position < len(text) or not position:
        found = MONOMIAL.match(text, position)
        good = found and (found[1] or not position)
        checker.require(
            good, f"The text at column {position + 1} of {text[:40]}… is not a monomial."
        )
        exponents, value = [0] * len(names), -1 if found and found[1] == "-" else 1
        for power in found[2].split("*") if found else ():
            name, _, exponent = power.partition("^")
            if name.isdigit():
                value *= int(name)
            else:
                exponents[names.index(name)] += int(exponent or 1)
        key, position = tuple(exponents), found.end() if found else len(text)
        table[key] = table.get(key, 0) + value
    return ring.from_dict({key: value for key, value in table.items() if value})


def with_generators_for_factors(
    ring: exact_field.ExactRing,
    symbols: Mapping[hierarchy.Unknown, ex.Symbol],
    equations: Mapping[hierarchy.EquationName, hierarchy.Linear],
    budget: exact_field.Budget,
) -> tuple[exact_field.ExactRing, dict[hierarchy.EquationName, hierarchy.Linear]]:
    """The rows over a ring with an additional generator for each long factor, which prints as that
    factor.

    Denominators and factors that all coefficients of a row share are left out.
    """
    rows = {name: _factored(ring, symbols, row) for name, row in equations.items()}
    factors = (factor for row in rows.values() for _, parts in row.values() for factor, _ in parts)
    long = distinct(factor for factor in factors if len(factor) > TERMS_OF_A_FACTOR)
    wider = _widened(ring, long, budget)
    letters = {str(factor): len(ring.field.context.names()) + k for k, factor in enumerate(long)}
    return wider, {
        name: {
            unknown: _product_of_factors(wider, letters, *parts) for unknown, parts in row.items()
        }
        for name, row in rows.items()
    }


def _factored(
    ring: exact_field.ExactRing,
    symbols: Mapping[hierarchy.Unknown, ex.Symbol],
    row: hierarchy.Linear,
) -> Row:
    """The coefficients, put over one denominator, as a number and irreducible factors that they do
    not all share.
    """
    places = {tree: index for index, tree in ring.trees.items()}
    whole = exact_field.sum_of(
        ring.constant(0), [c * ring.atoms[symbols[unknown]] for unknown, c in row.items()]
    ).numerator
    parts = {
        unknown: exact_field.coefficient(whole, places[symbols[unknown]], 1) for unknown in row
    }
    shared = exact_field.common_divisor(parts.values())
    split = {
        unknown: polynomials.factor_polynomial(part / shared) for unknown, part in parts.items()
    }
    return {
        unknown: (shared * 0 + fmpq(*n.as_integer_ratio()), found)
        for unknown, (n, found) in split.items()
    }


def _widened(
    ring: exact_field.ExactRing, long: list[fmpq_mpoly], budget: exact_field.Budget
) -> exact_field.ExactRing:
    """The same generators and relations, and one generator more for each long factor."""
    size = len(ring.field.context.names())
    field = exact_field.QuotientField.with_generators(size + len(long), budget)
    wider = exact_field.ExactRing(field, (), 0, slopes=False)
    for index, relation in ring.field.relations.items():
        field.relate(index, relation.degree, _with_more_generators(field, relation.right))
    wider.trees = ring.trees | {
        size + k: exact_field.polynomial_tree(ring, factor) for k, factor in enumerate(long)
    }
    wider.atoms = {tree: wider.generator(index) for index, tree in wider.trees.items()}
    return wider


def _with_more_generators(field: exact_field.QuotientField, polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """The polynomial among more generators."""
    more = (0,) * (len(field.context.names()) - len(polynomial.context().names()))
    return field.context.from_dict(
        {(*exponents, *more): value for exponents, value in polynomial.to_dict().items()}
    )


def _product_of_factors(
    ring: exact_field.ExactRing,
    letters: Mapping[str, int],
    number: fmpq_mpoly,
    factors: list[tuple[fmpq_mpoly, int]],
) -> exact_field.Quotient:
    value = exact_field.Quotient(ring.field, _with_more_generators(ring.field, number), ())
    for factor, exponent in factors:
        index = letters.get(str(factor))
        part = (
            exact_field.Quotient(ring.field, _with_more_generators(ring.field, factor), ())
            if index is None
            else ring.generator(index)
        )
        value = value * part**exponent
    return value


Combination = tuple[fmpq_mpoly, Sequence[tuple[fmpq_mpoly, Fact]]]


@dataclass(frozen=True, slots=True)
class Origin:
    """Where the equations of a theorem come from: f, the generators of the multiplier, the
    condition of each row, L.
    """

    exact: conditions.MotionInRing
    symbols: Mapping[hierarchy.Unknown, ex.Symbol]
    rows: tuple[tuple[hierarchy.EquationName, exact_field.Quotient], ...] = ()
    lagrangian: exact_field.Quotient | None = None


@dataclass(frozen=True, slots=True)
class Theorem:
    """`steps` lead from relations and equations to the last one's `gives`, where no factor of
    theirs is zero.

    `equations` are rows of the algebraic conditions, without denominators and common factors, with
    what they are. `origin` is None if long factors became generators. An Euler-Lagrange expression
    is what the last step gives over the product of `denominators`, as polynomials (one may be a
    number) and exponents.
    """

    name: str
    ring: exact_field.ExactRing
    relations: tuple[Fact, ...]
    equations: tuple[tuple[Fact, str], ...]
    steps: tuple[Identity, ...]
    origin: Origin | None = None
    denominators: tuple[tuple[fmpq_mpoly, int], ...] = ()

    @property
    def nonzero(self) -> tuple[fmpq_mpoly, ...]:
        """The polynomials that must not vanish: the irreducible factors of all factors and
        denominators.
        """
        return tuple(
            distinct([*factors_divided_by(self.steps), *(below for below, _ in self.denominators)])
        )


def determinant_vanishes(
    analysis: deciding.Analysis,
    chosen: hierarchy.ChosenEquations,
    seed: int,
    budget: exact_field.Budget,
) -> Theorem:
    """det g = 0 from the rows of the chosen conditions; TooLarge where the budget ends or it was
    not recognized.

    If the formulas are long, their long factors become generators.
    """
    rows = hierarchy.exact_rows(analysis, chosen.equations, seed, budget)
    try:
        proof = _SingularityProof(rows.ring, rows.symbols, rows.equations, rows.table, budget)
        return replace(
            proof.theorem(), origin=Origin(rows.exact, rows.symbols, tuple(proof.origins))
        )
    except exact_field.TooLarge:
        ring, equations = with_generators_for_factors(
            rows.ring, rows.symbols, rows.equations, budget
        )
        return _SingularityProof(ring, rows.symbols, equations, rows.table, budget).theorem()


class _SingularityProof:
    """det g = 0 as identities, in `steps`, from the rows of an elimination as polynomials.

    Each row is reduced by the entries solved before it (`val1`, `val2`, …: pivot * g_ij + … = 0),
    then each of these by those solved after it, so that only free entries remain. Substitution of
    them makes det g zero.
    """

    def __init__(
        self,
        ring: exact_field.ExactRing,
        symbols: Mapping[hierarchy.Unknown, ex.Symbol],
        equations: Mapping[hierarchy.EquationName, hierarchy.Linear],
        table: hierarchy.PointwiseConditions,
        budget: exact_field.Budget,
    ) -> None:
        self.ring, self.symbols, self.size, self.budget = ring, symbols, table.size, budget
        self.result = hierarchy.eliminate(equations, table)
        places = {tree: index for index, tree in ring.trees.items()}
        self.places = {unknown: places[symbol] for unknown, symbol in symbols.items()}
        self.relations = relations_of(ring)
        self.steps = list[Identity]()
        self.origins = list[tuple[hierarchy.EquationName, exact_field.Quotient]]()

    def theorem(self) -> Theorem:
        equations, values = list[tuple[Fact, str]](), list[Divisor]()
        for step in self.result.solved:
            row = exact_field.sum_of(
                self.ring.constant(0), [c * self._entry(*u) for u, c in step.original.items()]
            )
            fact = Fact(f"eq{len(equations) + 1}", coprime_multiple(row.numerator))
            equations.append((fact, negative.equation_name(step.name).text))
            self.origins.append((step.name, row))
            values.append(self._reduced(Divisor(fact, self.places[step.pivot]), values))
        for k in reversed(range(len(values))):
            values[k] = self._reduced(values[k], values[k + 1 :])
        values.sort(key=lambda value: len(value.fact.polynomial))
        self._close(values)
        steps = tuple(self.steps)
        return Theorem(
            "det_g_is_zero", self.ring, _used(self.relations, steps), tuple(equations), steps
        )

    def _entry(self, i: int, j: int) -> exact_field.Quotient:
        return self.ring.atoms[self.symbols[min(i, j), max(i, j)]]

    def _interleaved(self, values: Sequence[Divisor]) -> list[Divisor]:
        """The values, each followed by the relations: substitution of a value may make a power that
        they reduce.
        """
        return [divisor for value in values for divisor in (value, *self.relations)] or [
            *self.relations
        ]

    def _reduced(self, row: Divisor, values: Sequence[Divisor]) -> Divisor:
        """The row after substitution of the values, divided by the common content of its
        coefficients.
        """
        fact = row.fact
        found = divided(fact.polynomial, self._interleaved(values), self.budget)
        content = exact_field.common_divisor(
            exact_field.coefficient(found.rest, place, 1) for place in self.places.values()
        )
        left = coprime_multiple(found.rest / content)
        if left == fact.polynomial:
            return row
        factor = found.rest / left
        given = Fact(f"val{len(self.steps) + 1}", left)
        self.steps.append(
            identity(given, factor, [(found.multiplier, fact), *((-c, f) for c, f in found.terms)])
        )
        return Divisor(given, row.index)

    def _close(self, values: Sequence[Divisor]) -> None:
        """Add the last step: by a vector that every remaining g maps to 0, else by substitution in
        the expanded det.
        """
        vector = self._null_vector()
        terms = None if vector is None else self._by_kernel(vector, values)
        goal = self._minor(range(self.size), range(self.size))
        if terms is None:
            found = self._from_values(goal, values)
            terms = found.multiplier, found.terms
        self.steps.append(identity(Fact("det_g", goal), *terms))

    def _null_vector(self) -> list[exact_field.Quotient] | None:
        """k, free of entries of g, with g k = 0 for every remaining g: it makes det g = 0 a short
        identity.
        """
        one = self.ring.constant(1)
        entries = self.result.matrix(self.size, one)
        free = sorted({unknown for line in entries for row in line for unknown in row})
        rows = [
            [row.get(unknown, one - one) for row in line] for unknown in free for line in entries
        ]
        return next(reversed(matrices.null_space(rows, self.size, one).values()), None)

    def _by_kernel(
        self, vector: Sequence[exact_field.Quotient], values: Sequence[Divisor]
    ) -> Combination:
        """g k = 0, and k_m det g = sum over j of the cofactor (j, m) times (g k)_j."""
        span, places = range(self.size), [self.places[0, j] for j in range(self.size)]
        row = exact_field.sum_of(
            self.ring.constant(0), [k * self._entry(0, j) for j, k in enumerate(vector)]
        ).numerator
        k = [exact_field.coefficient(row, place, 1) for place in places]
        m = min((j for j in span if not k[j].is_zero()), key=lambda j: len(k[j]))
        terms = []
        for j in span:
            image = sum((k[i] * self._entry(i, j).numerator for i in span), row * 0)
            found = self._from_values(image, values)
            fact = Fact(f"ker{j + 1}", image)
            self.steps.append(identity(fact, found.multiplier, found.terms))
            cofactor = self._minor([i for i in span if i != j], [i for i in span if i != m])
            terms.append((-cofactor if (j + m) % 2 else cofactor, fact))
        return k[m], terms

    def _minor(self, rows: Sequence[int], columns: Sequence[int]) -> fmpq_mpoly:
        matrix = [[self._entry(i, j) for j in columns] for i in rows]
        return matrices.determinant(matrix, self.ring.constant(1)).numerator

    def _from_values(self, polynomial: fmpq_mpoly, values: Sequence[Divisor]) -> Remainder:
        """The polynomial as a combination of values and relations; TooLarge if a remainder is
        left.
        """
        return without_remainder(
            polynomial, self._interleaved(values), self.budget, "the determinant of what remains"
        )


def euler_lagrange_hold(
    system: second_order_system.SecondOrderSystem,
    lagrangian: ex.Expression,
    budget: exact_field.Budget,
) -> tuple[Theorem, ...]:
    """One theorem for each coordinate; TooLarge where the budget ends or an identity was not
    recognized.

    Gamma(dL/dv^k) - dL/dq^k, formed without the relations between generators, is a combination of
    these relations.
    """
    exact = conditions.motion_in_ring(system, 2, budget, trees=[lagrangian])
    value = exact.ring.value(lagrangian)
    origin, relations = Origin(exact, {}, (), value), relations_of(exact.ring)
    formal = FormalSystem(origin)
    motion, action = formal.motion(), formal.element(value)
    theorems = list[Theorem]()
    for k, name in enumerate(system.coordinates):
        residual = motion.along(motion.by_velocity[k](action)) - motion.by_coordinate[k](action)
        whole, powers = formal.cleared(residual, {})
        given = Fact("residual", coprime_multiple(whole))
        found = without_remainder(
            given.polynomial, relations, budget, "an Euler-Lagrange expression"
        )
        step = identity(given, found.multiplier, found.terms)
        below = [(formal.field.denominators[index], power) for index, power in powers.items()]
        if given.polynomial != whole:
            below.append((given.polynomial / whole, 1))
        used = _used(relations, [step])
        theorems.append(
            Theorem(f"euler_lagrange_{name}", exact.ring, used, (), (step,), origin, tuple(below))
        )
    return tuple(theorems)


def relations_of(ring: exact_field.ExactRing) -> list[Divisor]:
    """The relations of the generators, sin^2 + cos^2 = 1 and w^k = u, the greatest generator
    first.
    """
    gen = ring.field.context.gen
    listed = [ring.field.relations[index] for index in sorted(ring.field.relations)]
    return [
        Divisor(
            Fact(f"rel{k}", coprime_multiple(gen(one.generator) ** one.degree - one.right)),
            one.generator,
        )
        for k, one in enumerate(listed, 1)
    ]


def _used(relations: Sequence[Divisor], steps: Sequence[Identity]) -> tuple[Fact, ...]:
    names = {fact.name for step in steps for _, fact in step.terms}
    return tuple(relation.fact for relation in relations if relation.fact.name in names)


@dataclass(frozen=True, slots=True)
class GeneratorNames:
    """The names of the generators that a theorem uses, and the meanings of those that are not
    symbols.
    """

    names: dict[int, str]
    meanings: dict[str, str]


def generator_names(theorem: Theorem, further: Iterable[int] = ()) -> GeneratorNames:
    """x as x, x' as v_x, every other atom as u1, u2, …; other words where these are taken."""
    occurring = {
        k for p in polynomials_of(theorem) for k, degree in enumerate(p.degrees()) if degree > 0
    }
    used = sorted(occurring | {*further}, reverse=True)
    names, meanings = dict[int, str](), dict[str, str]()
    symbols = {tree.name for tree in theorem.ring.trees.values() if isinstance(tree, ex.Symbol)}
    for index in used:
        tree = theorem.ring.trees[index]
        name = _letter(tree, len(meanings) + 1)
        while (
            _TAKEN.fullmatch(name)
            or name in names.values()
            or (name in symbols and not isinstance(tree, ex.Symbol))
        ):
            name += "_"
        names[index] = name
        if tree != ex.Symbol(name):
            meanings[name] = printing.to_text(tree)
    return GeneratorNames(names, meanings)


def _letter(tree: ex.Expression, number: int) -> str:
    match tree:
        case ex.Symbol(name):
            return name
        case ex.Velocity(name):
            return f"v_{name}"
    return f"u{number}"


def polynomials_of(theorem: Theorem) -> Iterator[fmpq_mpoly]:
    for step in theorem.steps:
        yield from (step.factor, step.gives.polynomial)
        yield from (polynomial for c, fact in step.terms for polynomial in (c, fact.polynomial))
    yield from (below for below, _ in theorem.denominators)


def polynomial_text(letters: GeneratorNames, polynomial: fmpq_mpoly) -> str:
    """3*x^2*y - 1; coefficients have to be integers, or are printed as p/q."""
    found = ""
    for exponents, value in polynomial.terms():
        powers = [
            f"{letters.names[k]}^{e}" if e > 1 else letters.names[k]
            for k, e in enumerate(exponents)
            if e
        ]
        size = abs(value)
        product = "*".join(powers if powers and size == 1 else [str(size), *powers])
        found += (
            f" {'-' if value < 0 else '+'} {product}"
            if found
            else f"{'-' if value < 0 else ''}{product}"
        )
    return found or "0"


def product_text(
    letters: GeneratorNames, powers: Sequence[tuple[fmpq_mpoly, int]], constant: str = "1"
) -> str:
    """2 * (x - 1)^2 * (y)."""
    parts = [f"({polynomial_text(letters, p)})" + (f"^{e}" if e > 1 else "") for p, e in powers]
    return " * ".join([constant] * (constant != "1" or not parts) + parts)


def factored_text(
    letters: GeneratorNames, polynomial: fmpq_mpoly, more: Sequence[tuple[fmpq_mpoly, int]] = ()
) -> str:
    """The product of the polynomial, factored, and of more powers."""
    number, powers = polynomials.factor_polynomial(polynomial)
    return product_text(letters, [*powers, *more], str(number))


def combination(letters: GeneratorNames, terms: Iterable[tuple[fmpq_mpoly, Fact]]) -> str:
    """The sum of cofactor * fact."""
    parts = (
        f"({polynomial_text(letters, c)}) * ({polynomial_text(letters, fact.polynomial)})"
        for c, fact in terms
    )
    return " + ".join(parts) or "0"


def identities(theorems: Sequence[Theorem]) -> list[dict[str, Any]]:
    """The theorems as data: each step factor * gives = sum of cofactor * (relation, equation or
    earlier step).
    """
    return [_plain(theorem, generator_names(theorem)) for theorem in theorems]


def _plain(theorem: Theorem, letters: GeneratorNames) -> dict[str, Any]:
    text = functools.partial(polynomial_text, letters)

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


class FormalSystem:
    """f and L as polynomials in the generators and in 1/D for each of their denominators D, in the
    ring `formal`.

    That ring has no relations, so what vanishes by them is still there to be proven. `below` lists
    the indices of the denominators in `field`; the generator of 1/D for the one at place p of
    `below` has the index `count` + p.
    """

    def __init__(self, origin: Origin) -> None:
        self.exact = origin.exact
        self.ring, self.field, self.size = (
            origin.exact.ring,
            origin.exact.ring.field,
            origin.exact.motion.size,
        )
        self.given = [
            *origin.exact.motion.accelerations,
            *([] if origin.lagrangian is None else [origin.lagrangian]),
        ]
        images = [image for table in self.ring.images for image in table.values()]
        self.below = sorted({k for value in (*self.given, *images) for k, _ in value.exponents})
        self.count = len(self.field.context.names())
        unbounded = exact_field.Budget(sys.maxsize, self.field.budget.deadline)
        field = exact_field.QuotientField.with_generators(self.count + len(self.below), unbounded)
        self.formal = exact_field.ExactRing(
            field, self.ring.variables, 0, undefined=self.ring.undefined
        )
        for table in self.ring.images:
            found = {k: self.element(image) for k, image in table.items()}
            by = exact_field.Derivation(found)
            for place, k in enumerate(self.below, self.count):  # d(1/D) = -(1/D)^2 dD
                found[place] = -(self.formal.generator(place) ** 2) * by(self.denominator(k))
            self.formal.images.append(found)
        self.accelerations = [self.element(f) for f in origin.exact.motion.accelerations]

    def place(self, tree: ex.Expression) -> int:
        """The index of the generator that is this symbol or velocity."""
        return next(k for k, known in self.ring.trees.items() if known == tree)

    def denominator(self, k: int) -> exact_field.Quotient:
        """D in terms of the generators."""
        return self.element(exact_field.Quotient(self.field, self.field.denominators[k], ()))

    def element(self, value: exact_field.Quotient) -> exact_field.Quotient:
        """N / (D_1^e_1 ...) as N times powers of the generators 1/D."""
        found = _with_more_generators(self.formal.field, value.numerator)
        for k, e in value.exponents:
            if k not in self.below:
                raise exact_field.TooLarge("a denominator that f does not have")
            found = found * self.formal.field.context.gen(self.count + self.below.index(k)) ** e
        return exact_field.Quotient(self.formal.field, found, ())

    def motion(self) -> Motion[exact_field.Quotient]:
        """The derivations of the formal ring."""
        ring, n = self.formal, self.size
        velocities = [ring.generator(self.place(v)) for v in ring.variables[1 + n :]]
        partials = [ring.partial(k) for k in range(1, 2 * n + 1)]
        along = ring.along([ring.constant(1), *velocities, *self.accelerations])
        return Motion(
            tuple(self.accelerations),
            tuple(partials[:n]),
            tuple(partials[n:]),
            along,
            ring.constant(0),
        )

    def cleared(
        self, formal: exact_field.Quotient, least: Mapping[int, int]
    ) -> tuple[fmpq_mpoly, dict[int, int]]:
        """(the product with D^m, m): a polynomial in the generators, m at least `least`."""
        tables = [exponents[self.count :] for exponents in formal.numerator.to_dict()]
        most = {
            k: max([least.get(k, 0), *(table[place] for table in tables)])
            for place, k in enumerate(self.below)
        }
        whole = self.field.context.constant(0)
        for exponents, c in formal.numerator.to_dict().items():
            term = self.field.context.from_dict({exponents[: self.count]: c})
            for place, k in enumerate(self.below):
                term = term * self.field.denominators[k] ** (
                    most[k] - exponents[self.count + place]
                )
            self.field.budget.charge(len(term))
            whole = whole + term
        return whole, {k: m for k, m in most.items() if m}
