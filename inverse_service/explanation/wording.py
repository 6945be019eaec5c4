"""The sentences and formulas of an explanation.

Phi, nabla Phi and R of a solution, written out for people.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, cast

from inverse_service import bounds
from inverse_service.decision.solutions import Answer, Conditions, Part, Solution, Step
from inverse_service.expressions import notation, printing
from inverse_service.expressions.tree import Expression, Symbol, Velocity, node_count, walk
from inverse_service.field.exact_field import ExactRing, quotient_tree
from inverse_service.mechanics.conditions import Tensor11, Tensor12, conditions
from inverse_service.search import terms as tm

if TYPE_CHECKING:
    from inverse_service.explanation.hierarchy import ConditionName, Contradiction, EquationName, SufficientSet, Unknown
    from inverse_service.field.exact_field import Quotient
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

Piece = str | notation.Formula | Expression
_MEANING = {
    "g": "the multiplier (the velocity Hessian of L)",
    "L": "the Lagrangian",
    "H": "the Hamiltonian",
    "N": "the matrix -1/2 df/dv",
    "Phi": "the matrix of the first conditions",
    "R": "the curvature in the conditions",
    "Gamma": "the derivative along the motion",
    "f": "the right-hand sides",
    "p": "the momenta",
    "v": "the velocities",
    "u": "the exponent in g = e^u G",
    "G": "the matrix in g = e^u G",
    "T": "any of the matrices of the conditions",
    "L_0": "the Lagrangian without damping",
}
_SYMMETRIC = "g_ij T^j_k = g_kj T^j_i"
_CYCLIC = "g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0"
SINGULAR = "det g = 0"


def said(*pieces: Piece, shown: Sequence[Piece] = ()) -> Step:
    """A sentence of words and formulas, and the formulas that are `shown`: below it, unless they are in the sentence.

    In a text, grave accents enclose a formula in the notation of the theory.
    """
    sentence = [part for piece in pieces for part in _parts(piece)]
    texts = {part.text for part in sentence}
    below = [part for part in (_formula(piece, "display") for piece in shown) if part.text not in texts]
    return Step("".join(part.text for part in sentence), (*sentence, *below))


def _parts(piece: Piece) -> list[Part]:
    if not isinstance(piece, str):
        return [_formula(piece)]
    return [_formula(text) if k % 2 else Part("text", text) for k, text in enumerate(piece.split("`")) if text]


def _formula(piece: Piece, kind: str = "formula") -> Part:
    if isinstance(piece, Expression):
        return Part(kind, printing.to_text(piece))
    formula = notation.formula_of(piece)
    return Part(kind, formula.text, formula.letters)


def enumerated(formulas: Sequence[Piece]) -> list[Piece]:
    """a, b and c."""
    found: list[Piece] = []
    for k, formula in enumerate(formulas):
        found += [" and " if k == len(formulas) - 1 else ", ", formula] if k else [formula]
    return found


def separated(formulas: Sequence[Piece], between: str = ", ") -> list[Piece]:
    """The formulas with the same words between them."""
    return [piece for k, formula in enumerate(formulas) for piece in ([between, formula] if k else [formula])]


def with_shared_letters(answer: Answer, system: SecondOrderSystem) -> Answer:
    """The answer with a first sentence that defines each symbol that the theory and the system both use."""
    names = {*system.coordinates, *system.parameters, *dict(system.functions)}
    parts = [part for step in (*answer.explanation, *answer.details) for part in step.parts]
    words = {word for part in parts for word in part.letters}
    shared = [name for name in _MEANING if name in names & words]
    if not shared:
        return answer
    meanings = ", ".join(f"{name} is {_MEANING[name]}" for name in shared)
    also = "these names may also be those" if len(shared) > 1 else f"the name {shared[0]} may also be that"
    step = said(f"In the sentences below, {meanings}; inside their formulas {also} of the system.")
    return replace(answer, explanation=(step, *answer.explanation))


def indices(system: SecondOrderSystem) -> list[Piece]:
    """Which index belongs to which coordinate."""
    found: list[Piece] = []
    for k, name in enumerate(system.coordinates, 1):
        found += [f"{', ' * (k > 1)}{k} for ", Symbol(name)]
    return found


def opening(system: SecondOrderSystem, chosen: SufficientSet) -> Step:
    """The conditions that a multiplier must satisfy."""
    kinds = {condition.cyclic for condition in chosen.conditions}
    return said(
        "Suppose that a regular Lagrangian exists. Its velocity Hessian `g` is symmetric and nonsingular, and ",
        *_conditions(chosen), " (indices: ", *indices(system), ").",
        shown=[formula for kind, formula in ((False, _SYMMETRIC), (True, _CYCLIC)) if kind in kinds],
    )  # fmt: skip


def _conditions(chosen: SufficientSet) -> list[Piece]:
    plain = [notation.theory(condition.name) for condition in chosen.conditions if not condition.cyclic]
    cyclic = [condition.name for condition in chosen.conditions if condition.cyclic]
    found: list[Piece] = ["`g T` is symmetric for `T` = ", *enumerated(plain)] if plain else []
    if cyclic:
        found += [" and "] if found else []
        found.append(notation.theory(_CYCLIC))
        others: list[Piece] = [" for ", *enumerated([notation.theory(name) for name in cyclic]), " in the place of `R`"]
        found += [] if cyclic == ["R"] else others
    return found


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def tensor_step(ring: ExactRing, condition: ConditionName, tensor: Tensor11[Quotient] | Tensor12[Quotient]) -> Step:
    """The nonzero components of a tensor of the conditions, the first index above; k < l for T^j_kl."""
    span = range(len(tensor))
    found: list[tuple[tuple[int, ...], Quotient]]
    if condition.cyclic:
        bend = cast("Tensor12[Quotient]", tensor)
        found = [((i, k, m), bend[i][k][m]) for i in span for k, m in combinations(span, 2)]
    else:
        plain = cast("Tensor11[Quotient]", tensor)
        found = [((i, k), plain[i][k]) for i in span for k in span]
    shown = [
        notation.row(f"({condition.name})^{above + 1}_{_numbers(below)} = ", quotient_tree(ring, value))
        for (above, *below), value in found
        if not value.is_zero
    ]
    name = notation.theory(condition.name)
    if not shown:
        return said("All components of ", name, " are zero.")
    return said("The nonzero components of ", name, " are ", *separated(shown), ".", shown=shown)


def _numbers(indices: Sequence[int]) -> str:
    """The indices as a person counts them."""
    return "".join(str(index + 1) for index in indices)


def equation_name(name: EquationName) -> notation.Formula:
    """(nabla Phi)_12: entry 12 of g nabla Phi, which must equal entry 21."""
    return notation.theory(f"({name.condition.name})_{_numbers(name.indices)}")


def equation_step(
    name: EquationName,
    original: Expression,
    reduced: Expression,
    pivot: Symbol,
    result: Expression,
    divisors: Sequence[Expression],
    parameters: Collection[str] = (),
) -> Step:
    """One equation, its reduced form, the divisors used, and the result.

    Parameters are numbers, so the step says for which of their values it holds.
    """
    pieces: list[Piece] = [equation_name(name), ": ", notation.row(original, " = 0"), ". "]
    if reduced != original:
        pieces += ["Substituting the results above gives ", notation.row(reduced, " = 0"), ". "]
    return said(*pieces, *_divided_by(dict.fromkeys(divisors), parameters), notation.row(pivot, " = ", result), ".")


def _divided_by(divisors: Iterable[Expression], parameters: Collection[str]) -> list[Piece]:
    """For a != 0, since x is not identically zero, …"""
    numbers, others = list[notation.Formula](), list[notation.Formula]()
    for divisor in divisors:
        leaves = [node for node in walk(divisor) if isinstance(node, Symbol | Velocity)]
        constant = leaves and all(isinstance(leaf, Symbol) and leaf.name in parameters for leaf in leaves)
        (numbers if constant else others).append(notation.formula_of(divisor))
    if not numbers and not others:
        return ["Hence "]
    values: list[Piece] = (
        ["For ", *separated([notation.row(one, " != 0") for one in numbers], " and "), ", "] if numbers else []
    )
    verb = "is" if len(others) == 1 else "are"
    word = "since " if numbers else "Since "
    return [*values, *([word, *enumerated(others), f" {verb} not identically zero, "] if others else [])]


def block_sentence(symbols: Mapping[Unknown, Symbol], rows: tuple[int, ...], columns: tuple[int, ...], n: int) -> Step:
    """Explain that g is singular because the common entries of these rows and columns vanish."""
    names = sorted({symbols[min(r, c), max(r, c)].name for r in rows for c in columns})
    equal = notation.row(*separated([Symbol(name) for name in names], " = "), " = 0")
    if len(rows) == 1 and len(columns) == n:
        why = f"row {rows[0] + 1} of `g` is zero"
    else:
        left, top = (_listed([str(k + 1) for k in part]) for part in (rows, columns))
        why = f"the entries of rows {left} of `g` in columns {top} are zero, so these rows are linearly dependent"
    return said(equal, f": {why}, hence `{SINGULAR}`. This is a contradiction, so no regular Lagrangian exists.")


def summary_steps(system: SecondOrderSystem, chosen: SufficientSet) -> tuple[Step, ...]:
    """Conditions and ranks, for expressions too large to follow by hand."""
    n = len(system.coordinates)
    end = "so `g = 0`" if chosen.dimension == 0 else "in which every matrix is singular"
    closing = said(
        "The linear equations ", *enumerated([equation_name(name) for name in chosen.equations]),
        f" on the {n * (n + 1) // 2} entries of `g` have rank {chosen.rank} at a generic point; the symmetric matrices "
        f"that satisfy them form a space of dimension {chosen.dimension}, {end}. Hence no regular Lagrangian exists.",
        shown=[SINGULAR],
    )  # fmt: skip
    middle = said("For each `T` the equation is `g_11 T^1_2 + g_12 (T^2_2 - T^1_1) - g_22 T^2_1 = 0`.")
    return (opening(system, chosen), *([middle] if n == 2 else []), closing)


def differential_summary(system: SecondOrderSystem) -> tuple[Step, ...]:
    """The text used if only the prolonged equations decide and no short argument was found."""
    step = said(
        "A nonsingular `g` survives every algebraic condition (`Phi`, `nabla Phi`, ..., `R`) at a generic point; the "
        "Helmholtz conditions differentiated by ", *separated([Symbol(name) for name in system.coordinates]),
        " and the velocities leave only singular ones. The certificate lists the differentiated equations that were "
        "used.",
        shown=["Gamma(g) = g N + (g N)^T", "dg_ij/dv^k = dg_ik/dv^j"],
    )  # fmt: skip
    return (step,)


def factor_steps(ring: ExactRing, direction: Tensor11[Quotient], found: Contradiction) -> list[Step]:
    """g = e^u times a known matrix; the derivatives of u, and the two that contradict each other."""
    rows = [[quotient_tree(ring, entry) for entry in line] for line in direction]
    fixed = said(
        "The algebraic conditions therefore determine `g` up to a factor: `g = e^u G` or `g = -e^u G` with ",
        notation.row("G = ", notation.matrix(rows)), " and unknown `u`.",
    )  # fmt: skip
    steps = [fixed]
    steps += [
        said(f"{line.reason}: ", notation.row(line.formula, " = ", quotient_tree(ring, line.value)), ".")
        for line in found.lines
    ]
    tree = quotient_tree(ring, found.difference)
    steps.append(
        said("For such `u`, ", found.formula, f"{found.note} must vanish, but it is ", tree,
             ", which is not identically zero. Hence no regular Lagrangian exists.")
    )  # fmt: skip
    return steps


def printed_conditions(system: SecondOrderSystem) -> tuple[Conditions | None, str]:
    """The conditions, or None with the reason for omitting them."""
    tensors = conditions(system)
    if tensors.Phi is None or tensors.nabla_Phi is None or tensors.R is None:
        return None, tensors.reason

    def short(tree: Expression) -> Expression:
        return tm.with_sums_of_angles(tree) if node_count(tree) <= bounds.LARGE else tree  # a page of formulas

    Phi, nabla = (tuple(tuple(map(short, row)) for row in each) for each in (tensors.Phi, tensors.nabla_Phi))
    R = tuple(tuple(tuple(map(short, row)) for row in rows) for rows in tensors.R)
    return Conditions(Phi, nabla, R), tensors.reason


def with_conditions(solution: Solution) -> Solution:
    """The solution of `solve` without conditions, with them."""
    found, reason = printed_conditions(solution.system)
    return replace(solution, conditions=found, provenance={**solution.provenance, "conditions_left_out": reason})
