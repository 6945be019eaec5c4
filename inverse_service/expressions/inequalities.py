"""Print conditions on trees (x > 1, x^2 + y^2 < 1, y > x, u != 0), and deduce conditions from others.

The checker's cells make all deductions; this module passes trees to them.
"""

import random
from collections.abc import Iterable
from functools import lru_cache
from time import thread_time

from inverse_service.certificate import cell, formulas, question
from inverse_service.expressions import collecting, notation, printing, tree as ex

Trees = Iterable[ex.Expression]
_LONGEST = 1.0  # seconds per deduction


def inequality(tree: ex.Expression) -> notation.Formula:
    """The condition that the tree is positive, with like terms collected if that is shorter."""
    return notation.row(*_relation(tree))


def inequality_latex(tree: ex.Expression) -> str:
    """The same in LaTeX."""
    left, sign, right = _relation(tree)
    return f"{printing.to_latex(left)}{notation.to_latex(sign)}{printing.to_latex(right)}"


def _relation(tree: ex.Expression) -> tuple[ex.Expression, str, ex.Expression]:
    if isinstance(tree, ex.Power) and isinstance(tree.exponent, ex.Number) and tree.exponent.value % 2 == 0:
        return tree.base, " != ", ex.ZERO
    left, right, is_greater = _sides(min(collecting.collect(tree), tree, key=ex.node_count))
    return left, " > " if is_greater else " < ", right


def inequality_text(tree: ex.Expression) -> str:
    """The same in plain text."""
    return inequality(tree).text


def is_positive(tree: ex.Expression, known: Trees = ()) -> bool:
    """Whether the tree provably is > 0 wherever it is defined and all of `known` are > 0: 1 + x^2, exp(u)."""
    return _follows(tree, " > 0", (), tuple(known))


def is_nonzero(tree: ex.Expression, nonzero: Trees = (), positive: Trees = ()) -> bool:
    """Whether the tree provably is defined and not 0 where none of `nonzero` is 0 and all of `positive` are > 0.

    sqrt(x) requires x > 0, because it vanishes at the boundary of its domain.
    """
    return _follows(tree, " != 0", tuple(nonzero), tuple(positive))


@lru_cache(maxsize=4096)
def _follows(tree: ex.Expression, ending: str, nonzero: Trees, positive: Trees) -> bool:
    def follows(ring: cell.Letters) -> bool:
        stated = [*texts(nonzero, " != 0"), *texts(positive, " > 0")]
        known = [*(need for text in stated for need in cell.needs_of_text(ring, text)), *ring.needs]
        ring.needs = {}
        wanted = [need for text in texts([tree], ending) for need in cell.needs_of_text(ring, text)]
        (known if ending == " > 0" else wanted).extend(ring.needs)
        return all(map(cell.Knowledge(ring, known).implies, wanted))

    try:
        return cell.in_letters(question_about([tree, *nonzero, *positive]), follows)
    except formulas.Ended:
        return False


def texts(trees: Trees, ending: str) -> list[str]:
    return [f"{printing.to_text(tree)}{ending}" for tree in trees]


def question_about(trees: Trees) -> question.Question:
    """A question to the checker that declares all names in the trees; formulas.Ended if the checker rejects a name."""
    nodes = [*ex.distinct_nodes(trees)]
    moving = [*dict.fromkeys(node.coordinate for node in nodes if isinstance(node, ex.Velocity))]
    symbols = [*dict.fromkeys(node.name for node in nodes if isinstance(node, ex.Symbol))]
    others = [name for name in symbols if name not in ("t", "pi", *moving)]
    coordinates = moving or others[:1] or ["x"]
    system = {
        "coordinates": coordinates,
        "equations": dict.fromkeys(coordinates, "0"),
        "parameters": [name for name in others if name not in coordinates],
        "functions": {node.name: ["t"] * len(node.arguments) for node in nodes if isinstance(node, ex.Arbitrary)},
    }
    return question.Question(question.Tools(random.Random(0), thread_time() + _LONGEST), system)


def _sides(tree: ex.Expression) -> tuple[ex.Expression, ex.Expression, bool]:
    """(a, b, True) for a > b, (a, b, False) for a < b; one side is a single term, and a number is on the right."""
    terms = ex.summands(tree)
    varying = [term for term in terms if not _is_number(term)]
    if len(varying) == 1:
        return _bound(varying[0], ex.add(*(term for term in terms if _is_number(term))))
    above = [term for term in terms if ex.coefficient(term) > 0]
    below = [-term for term in terms if ex.coefficient(term) < 0]
    if not above or all(map(_is_number, above)):
        return ex.add(*below), ex.add(*above), False
    return (ex.add(*above), ex.add(*below), True) if min(len(above), len(below)) < 2 else (tree, ex.ZERO, True)


def _bound(term: ex.Expression, rest: ex.Expression) -> tuple[ex.Expression, ex.Expression, bool]:
    """c u + rest > 0 solved for u."""
    coefficient = ex.coefficient(term)
    bound = ex.add(*(-1 / coefficient * part for part in ex.summands(rest)))
    return 1 / coefficient * term, bound, coefficient > 0


def _is_number(term: ex.Expression) -> bool:
    """Whether the term contains no coordinate, velocity, parameter, or function."""
    return not any(isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary) and node != ex.PI for node in ex.walk(term))
