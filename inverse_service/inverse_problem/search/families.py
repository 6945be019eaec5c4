"""The ansatz, deepened by weight: functions of the velocities times functions of position.

Which functions of the velocities can occur is seen at one place (`velocity_shapes`); only these get factors, which are
short products of what f is made of, more of them in a second round. Potentials and linear terms come later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.inverse_problem.search import shapes
from inverse_service.inverse_problem.search.closure import closed, is_admissible, potentials
from inverse_service.inverse_problem.search.factors import Factors, position_monomials, products
from inverse_service.inverse_problem.search.material import Material, distinct
from inverse_service.inverse_problem.search.motion import has_velocity
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, monomial
from inverse_service.inverse_problem.search.velocity_shapes import possible_shapes

# Plain functions of position that are offered as potentials beside what the residuals ask for.
_MOST_FUNCTIONS = 60
# Terms beyond the chosen ones that potentials and linear terms may add, and closures.
_MOST_POTENTIALS, _MOST_CLOSED = 150, 300


@dataclass(frozen=True, slots=True)
class Family:
    """An ansatz: functions of the velocities that a multiplier may be made of, and how many terms it may have.

    `own` are terms of the caller in the place of these; those without a Hessian go with every choice of the others.
    """

    name: str
    cost: float
    shapes: Callable[[Material], list[Monomial]]
    terms: int
    own: tuple[Monomial, ...] = ()


FAMILIES = (
    Family("quadratic in the velocities, short factors", 2, shapes.quadratic, 240),
    Family("ratios of velocities, short factors", 3.7, shapes.ratios, 240),
    Family("quadratic in the velocities and in a root", 3.9, shapes.with_roots, 900),
    Family("functions of velocities, short factors", 4, shapes.functions, 240),
    Family("quadratic in the velocities", 5, shapes.quadratic, 900),
    Family("ratios of velocities", 6, shapes.ratios, 900),
    Family("functions of velocities", 7, shapes.functions, 900),
    Family("products, roots and logarithms of velocities", 8, shapes.products_and_roots, 900),
)


def kinetic_terms(material: Material, family: Family, factors: Factors, seed: int) -> list[Monomial]:
    """The terms of an ansatz that have a Hessian, simple ones first; none where these make no regular multiplier."""
    if family.own:
        return [key for key in family.own if is_admissible(material, key) and not is_linear(key)]
    chosen = possible_shapes(material, [s for s in family.shapes(material) if not is_linear(s)], seed)
    if not chosen:
        return []
    room = max(_FEWEST, family.terms // (len(chosen) * len(factors.in_time)))
    found = products(factors.in_time, products(_functions(material, factors, room), chosen))
    found += [m for shape in chosen for m in products(_fitted(material, factors, shape), [shape])]
    if material.motion.with_time and not material.position_letters:
        # Where f holds no position, first integrals can be linear in t: x'' = x'^2 keeps 1/x' + t.
        found += products([monomial(TIME)], chosen)
    return [key for key in distinct(found) if is_admissible(material, key) and not is_linear(key)]


# Functions of position that every function of the velocities gets at least.
_FEWEST = 12


def _functions(material: Material, factors: Factors, room: int) -> list[Monomial]:
    """1, parameters, integrating factors and products of letters of position, the simplest of them."""
    degree = next((d for d in (4, 3) if len(position_monomials(material, d)) <= 2 * room), 2)
    fitted = list(dict.fromkeys([EMPTY, *factors.plain[: room // 3]]))
    others = distinct([*material.parameter_monomials[: room // 3], *position_monomials(material, degree)])
    return list(dict.fromkeys([*fitted, *others]))[: max(room, len(fitted))]


def _fitted(material: Material, factors: Factors, shape: Monomial) -> Iterator[Monomial]:
    """What the coefficients of v_i v_l in f_i ask for beside a power of v_i."""
    for i, v in enumerate(material.motion.velocities):
        exponent = dict(shape).get(v, Fraction(0))
        if exponent and len(shape) <= 2:
            for degree in {exponent - 2, Fraction(-1), Fraction(-2)}:
                yield from factors.of_degree(i, degree)


def all_terms(material: Material, family: Family, chosen: Sequence[Monomial]) -> list[Monomial]:
    """Chosen kinetic terms with the potentials and linear terms that can go with them."""
    depth = 3 if is_polynomial(material) else 1
    every = [*closed(material, chosen, depth, _MOST_CLOSED), *(key for key in family.own if is_linear(key))]
    every += _fitting(material, _MOST_FUNCTIONS)[1:_MOST_FUNCTIONS]
    every += potentials(material, chosen, _MOST_POTENTIALS)
    return [key for key in distinct(every) if is_admissible(material, key)]


def _fitting(material: Material, room: int) -> list[Monomial]:
    """Products of up to three letters where there is room for all of them, else of two."""
    units = len(position_monomials(material, 1)) - 1
    return position_monomials(material, 3 if math.comb(units + 3, 3) <= room else 2)


def is_polynomial(material: Material) -> bool:
    """Whether f is a polynomial in positions, velocities and parameters: only then are deep closures finite."""
    return all(
        isinstance(letter, Symbol | Velocity) and e > 0
        for terms in material.motion.forces
        for key in terms
        for letter, e in key
    )


def is_linear(key: Monomial) -> bool:
    """Whether a term is a function of position times at most one velocity."""
    moving = [(letter, e) for letter, e in key if has_velocity(letter)]
    return not moving or (len(moving) == 1 and isinstance(moving[0][0], Velocity) and moving[0][1] == 1)


def label(family: Family, terms: Sequence[Monomial]) -> str:
    """What a reader calls the ansatz in which these kinetic terms were found."""
    moving = [[(p, e) for p, e in key if has_velocity(p)] for key in terms if not is_linear(key)]
    if family.own or not all(isinstance(p, Velocity) for part in moving for p, _ in part):
        return family.name if family.own else "functions of the velocities"
    if all(e.denominator == 1 for part in moving for _, e in part):
        if all(e > 0 for part in moving for _, e in part):
            degrees = {sum((e for _, e in part), Fraction(0)) for part in moving}
            return "quadratic in the velocities" if degrees == {2} else "polynomial in the velocities"
        return "Laurent monomials in the velocities"
    return "powers of the velocities"
