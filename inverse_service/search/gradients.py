"""Find functions with a given gradient, and A_i(t, q) v_i - V(t, q) with given Euler-Lagrange expressions.

    E_i = (d_j A_i - d_i A_j) v_j + d_t A_i + d_i V

A gradient is integrated one variable at a time: the derivatives of an integral over one variable are subtracted from
the other slopes, and the differences no longer depend on that variable (Poincare's lemma). Terms are grouped by their
factors that are not powers of the variable: the integral of c u^e du/dx is c u^(e+1)/(e+1), never expanded, so that a
potential is finite wherever the force is. A constant field becomes W (x y' - y x')/2 if the forces are invariant under
rotations or couple its coordinates. Any other field is integrated along a coordinate on which it depends, so that
cyclic coordinates stay cyclic.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations, combinations_with_replacement

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field, real_point
from inverse_service.field.point import Variable
from inverse_service.mechanics import implicit_equations, writing
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import quadratures, terms as tm
from inverse_service.search.material import positive

ONE_TERM: tm.Terms = {tm.EMPTY: Fraction(1)}


@dataclass(slots=True)
class Integrator:
    """Integrate over the coordinates of one system; with `signs`, nonelementary integrals keep their integral sign.

    `table` is a real point at which the results must be real.
    """

    system: SecondOrderSystem
    table: real_point.RealTable | None = None
    signs: bool = False
    names: Iterator[str] = field(init=False)

    def __post_init__(self) -> None:
        self.names = quadratures.fresh_names(self.system)

    def function_of(self, variables: Sequence[Variable], slopes: Sequence[tm.Terms]) -> tm.Terms | None:
        """phi with d phi/d variables[i] = slopes[i]; None if there is none, or none is found."""
        if not _is_closed(variables, slopes):
            return None
        rest, total = [dict(slope) for slope in slopes], tm.Terms()
        for k, variable in enumerate(variables):
            if not rest[k]:
                continue
            part, left = self.integral(rest[k], variable)
            if left and not self.signs:
                return None
            total = tm.add_terms(total, part)
            for j, q in enumerate(variables):
                if j != k and (slope := tm.derivative_of_terms(part, q)):
                    rest[j] = tm.add_terms(rest[j], slope, -1)
                    if any(_holds(rest[j], earlier) for earlier in variables[: k + 1]):
                        rest[j] = self.in_normal_form(rest[j])
            rest[k] = left
            if left:
                return tm.add_terms(total, self._under_signs(variables, rest, k))
        return None if any(rest) and not all(is_zero(terms) for terms in rest) else total

    def with_hessian(self, entries: Sequence[tm.Terms]) -> tm.Terms | None:
        """An elementary function with these second derivatives by the velocities, in the order 11, 12, … 1n, 22, …."""
        plain, velocities = Integrator(self.system, self.table), list(map(ex.Velocity, self.system.coordinates))
        places = range(len(velocities))
        entry = dict(zip(combinations_with_replacement(places, 2), entries, strict=True))
        momenta = list[tm.Terms]()
        for i in places:
            momentum = plain.function_of(velocities, [entry[min(i, j), max(i, j)] for j in places])
            if momentum is None:
                return None
            momenta.append(momentum)
        return plain.function_of(velocities, momenta)

    def _under_signs(self, variables: Sequence[Variable], slopes: Sequence[tm.Terms], k: int) -> tm.Terms:
        """Integrals with these closed slopes, with constant factors outside the integral sign."""
        rest = [self.in_normal_form(terms) for terms in slopes]
        moving = {q: terms for q, terms in zip(variables, rest, strict=True) if terms}
        if len(moving) > 1:  # one function of all of them, such as G(x - y) with the force F(x - y)
            parameters = set(map(ex.Symbol, self.system.parameters))
            common = frozenset.intersection(*(key for terms in moving.values() for key in terms))
            constants: tm.Monomial = frozenset(item for item in common if item[0] in parameters)
            inside = {
                q: tm.tree_of({tm.times(key, constants, -1): a for key, a in u.items()}) for q, u in moving.items()
            }
            return tm.multiply_terms({constants: Fraction(1)}, self.under_a_sign(inside))
        return tm.sum_of(
            tm.multiply_terms(beside, self.under_a_sign({variables[k]: tm.tree_of(inner)}))
            for beside, inner in _outside(rest[k], variables[k])
        )

    def in_normal_form(self, terms: tm.Terms) -> tm.Terms:
        """The sum over one denominator, simplified by relations among its generators; 0 if it vanishes."""
        if not terms:
            return terms
        if is_zero(terms):
            return {}
        with suppress(tm.TooManyTerms):
            return tm.terms_of(writing.quotient(tm.tree_of(terms), exact_field.Budget.short(), self.system.variables))
        return terms

    def integral(self, slope: tm.Terms, variable: Variable, is_cancelled: bool = False) -> tuple[tm.Terms, tm.Terms]:
        """(an integral of a part of the slope over one variable, the remaining slope)."""
        groups = tm.grouped(slope, lambda letter: letter != variable and ex.holds(letter, variable))
        total, other = tm.Terms(), tm.Terms()
        for own, beside in groups.items():
            part = power_rule(own, beside, variable)
            if part is None:
                other = tm.add_terms(other, tm.multiply_terms({own: Fraction(1)}, beside))
            else:
                total = tm.add_terms(total, part)
        if not other:
            return total, other
        # Many terms may become few over their own denominators; few are first integrated unchanged.
        for cancels in (True, False) if len(other) > bounds.CANDIDATES else (False, True):
            if not cancels:
                known = quadratures.primitive(variable, other, self.table)
                if known is not None:
                    return tm.add_terms(total, tm.terms_of(known)), {}
            elif not is_cancelled and (cancelled := self._cancelled(other)) != other:
                part, left = self.integral(cancelled, variable, is_cancelled=True)
                return tm.add_terms(total, part), left
        left = tm.Terms()
        for beside, inner in _outside(other, variable):
            found = quadratures.antiderivative(self.system, tm.tree_of(inner), variable, self.table)
            if found is None:
                left = tm.add_terms(left, tm.multiply_terms(beside, inner))
            else:
                total = tm.add_terms(total, tm.multiply_terms(beside, tm.terms_of(found)))
        return total, left

    def _cancelled(self, terms: tm.Terms) -> tm.Terms:
        """The terms with the coefficient of each product of constants and functions over its own denominator.

        a x (x - 1)/(x^2 (x - 1)) is a/x. If there are roots, the products are those of roots.
        """
        groups: dict[tm.Monomial, tm.Terms] = {}
        for key, value in terms.items():
            roots = frozenset((p, e % 1) for p, e in key if isinstance(p, ex.Sum) and e.denominator > 1)
            groups.setdefault(roots, {})[tm.times(key, roots, -1)] = value
        if not any(groups):
            parameters = set(map(ex.Symbol, self.system.parameters))
            groups = tm.grouped(terms, lambda letter: letter in parameters or isinstance(letter, ex.Apply))
        parts = [tm.multiply_terms({key: Fraction(1)}, self.in_normal_form(inner)) for key, inner in groups.items()]
        return tm.sum_of(parts)

    def under_a_sign(self, known: Mapping[Variable, ex.Expression]) -> tm.Terms:
        """F with these slopes, a function of all variables in them; its other slopes remain unspecified."""
        names = (ex.TIME, *map(ex.Symbol, self.system.coordinates))
        others = [name for name in names if any(ex.holds(slope, name) for slope in known.values())]
        arguments = tuple(dict.fromkeys([*others, *known]))
        slopes = tuple(map(known.get, arguments))
        return tm.terms_of(ex.Integral(next(self.names), arguments, (0,) * len(arguments), slopes))

    def exponential(self, logarithm: tm.Terms) -> tm.Terms:
        """exp of a sum: c log(u) with constant c gives u^c, or (-u)^c if u is negative at the real point."""
        product: tm.Terms = dict(ONE_TERM)
        varying = [ex.TIME, *map(ex.Symbol, self.system.coordinates)]
        coefficients: dict[ex.Apply, tm.Terms] = {}
        rest = tm.Terms()
        for key, value in logarithm.items():
            log = next((p for p, e in key if isinstance(p, ex.Apply) and p.function == "log" and e == 1), None)
            if log is None:
                rest[key] = value
            else:
                coefficients.setdefault(log, {})[key - {(log, Fraction(1))}] = value
        exponents: dict[ex.Expression, tm.Terms] = {}
        for log, coefficient in coefficients.items():
            if any(_holds(coefficient, name) for name in varying):  # x^2/(x^2 + 1) + 1/(x^2 + 1) is 1
                coefficient = self.in_normal_form(coefficient)
            if any(_holds(coefficient, name) for name in varying):
                rest = tm.add_terms(rest, tm.multiply_terms(coefficient, {tm.monomial(log): Fraction(1)}))
            else:
                exponents[log.argument] = coefficient
        for base, exponent in exponents.items():
            product = tm.multiply_terms(product, tm.terms_of(positive(base, self.table) ** tm.tree_of(exponent)))
        return tm.multiply_terms(product, tm.terms_of(ex.Apply("exp", tm.tree_of(rest)))) if rest else product

    def linear_terms(self, wanted: Sequence[tm.Terms]) -> tm.Terms | None:
        """A_i v_i - V with these Euler-Lagrange expressions, one for each coordinate; None if none is found."""
        names = self.system.coordinates
        symbols = [ex.Symbol(name) for name in names]
        # An expression may be affine in the velocities only after simplification by relations among generators.
        velocities = list(map(ex.Velocity, names))
        rest = [self.in_normal_form(w) if tm.affine_parts(w, velocities) is None else w for w in wanted]
        total = tm.Terms()
        for i, j in combinations(range(len(names)), 2):
            magnetic = _round_potential(names, rest, i, j)
            if magnetic is not None:
                total = tm.add_terms(total, tm.terms_of(magnetic))
                own = expressions_without_acceleration(names, tm.terms_of(magnetic))
                rest = [self.in_normal_form(tm.add_terms(w, part, -1)) for w, part in zip(rest, own, strict=True)]
        fields: dict[tuple[int, int], tm.Terms] = {}
        slopes = list[tm.Terms]()
        for i, terms in enumerate(rest):
            parts = tm.affine_parts(terms, velocities)
            if parts is None:
                return None
            slopes.append(parts[0])
            fields |= {(i, j): part for j, part in enumerate(parts[1]) if part}
        if not all(is_zero(tm.add_terms(field, fields.get((j, i), {}))) for (i, j), field in fields.items()):
            return None
        # Keep one of two forms of the same field, such as (2 + sqrt(5))^(1/3) and (1 + sqrt(5))/2.
        fields = {
            (i, j): tm.scaled(fields[j, i], -1) if (j, i) in fields and i > j else f for (i, j), f in fields.items()
        }
        potential = self._vector_potential(fields, slopes)
        if potential is None:
            return None
        for i, a in potential.items():
            total = tm.add_terms(total, tm.multiply_terms(a, {tm.monomial(ex.Velocity(names[i])): Fraction(1)}))
            if _holds(a, ex.TIME):
                slopes[i] = tm.add_terms(slopes[i], tm.derivative_of_terms(a, ex.TIME), -1)
        scalar = self.function_of(symbols, slopes)
        return None if scalar is None else tm.add_terms(total, scalar, -1)

    def _vector_potential(
        self, fields: dict[tuple[int, int], tm.Terms], slopes: Sequence[tm.Terms]
    ) -> dict[int, tm.Terms] | None:
        """A_i with d_j A_i - d_i A_j = fields[i, j] and the symmetries of `slopes`, the other terms."""
        symbols = [ex.Symbol(name) for name in self.system.coordinates]
        ordered = sorted(pair for pair in fields if pair[0] < pair[1])
        coupled = bool(ordered) and all(_holds(slopes[i], symbols[j]) for i, j in ordered)
        turned = all(_is_turned(symbols, slopes, [pair]) for pair in ordered)
        if coupled or turned or _is_turned(symbols, slopes, ordered):
            radial = _along_rays(fields, symbols)
            if radial is not None:
                return radial
        found, done = dict[int, tm.Terms](), set[int]()
        rest = {pair: dict(terms) for pair, terms in fields.items()}
        while rest := {pair: terms for pair, terms in rest.items() if terms and not is_zero(terms)}:
            held = {k: sum(_holds(terms, q) for terms in rest.values()) for k, q in enumerate(symbols)}
            order = sorted({j for pair in rest for j in pair}, key=lambda k: (-held[k], k))
            for k in (*order, order[0]):  # the first one under an integral sign if all leave something
                parts = {i: self.integral(rest[i, k], symbols[k]) for i, j in rest if j == k}
                if not any(left for _, left in parts.values()):
                    break
            if not self.signs and any(left for _, left in parts.values()):
                return None
            for i, (part, left) in parts.items():
                if left:
                    part = tm.add_terms(part, self.under_a_sign({symbols[k]: tm.tree_of(left)}))
                found[i] = tm.add_terms(found.get(i, {}), part)
                for m in range(len(symbols)):
                    if m == k:
                        rest[i, k], rest[k, i] = {}, {}
                    elif m != i and (slope := tm.derivative_of_terms(part, symbols[m])):
                        rest[i, m] = tm.add_terms(rest.get((i, m), {}), slope, -1)
                        rest[m, i] = tm.add_terms(rest.get((m, i), {}), slope)
            done.add(k)
            # A field with sources (d_i F_jk + d_j F_ki + d_k F_ij != 0) depends on finished coordinates.
            if any(done & {*pair} and not is_zero(terms) for pair, terms in rest.items()):
                return None
            rest = {pair: terms for pair, terms in rest.items() if not done & {*pair}}
        return found


def expressions_without_acceleration(names: Sequence[str], terms: tm.Terms) -> list[tm.Terms]:
    """v_j L_(v_i q_j) + L_(v_i t) - L_(q_i) for each i."""
    found = []
    for name in names:
        deadline.check()
        momentum = tm.derivative_of_terms(terms, ex.Velocity(name))
        rate = tm.at_constant_velocity(momentum, map(ex.Symbol, names))
        total = tm.add_terms(rate, tm.derivative_of_terms(terms, ex.Symbol(name)), -1)
        found.append(quadratures.in_one_square(total))
    return found


def _round_potential(names: Sequence[str], wanted: Sequence[tm.Terms], i: int, j: int) -> ex.Expression | None:
    """A(s) (x y' - y x') for the terms B y' of E_x, -B x' of E_y if B depends on x and y only through s = x^2 + y^2.

    It is regular where B is: B = -2 (s A)', and s A is the integral of -x B over x at y = 0, from the axis if possible.
    """
    x, y, v, w = ex.Symbol(names[i]), ex.Symbol(names[j]), ex.Velocity(names[i]), ex.Velocity(names[j])
    field = tm.coefficient(wanted[i], tm.monomial(w))
    if not field or not _is_round(field, x, y) or tm.add_terms(field, tm.coefficient(wanted[j], tm.monomial(v))):
        return None
    square, s = x**2 + y**2, ex.Symbol("a square")
    turn, beside = y * v - x * w, ex.substitute(tm.tree_of(field), {y: ex.ZERO})
    even = ex.substitute(beside, {x**2: s})
    is_even = not ex.holds(even, x)
    letter, slope = (s, ex.HALF * even) if is_even else (x, x * beside)
    flux = quadratures.primitive(letter, tm.terms_of(slope))
    if flux is None:
        return None
    if is_even:
        from_axis = writing.quotient((flux - ex.substitute(flux, {s: ex.ZERO})) / s, exact_field.Budget.short())
        if ex.ZERO not in ex.walk(ex.substitute(from_axis, {s: ex.ZERO})):
            return ex.substitute(from_axis, {s: square}) * turn
    table = {x**2: square, ex.Apply("log", x): ex.HALF * ex.Apply("log", square), x: ex.square_root(square), s: square}
    return ex.substitute(flux, table) * square**-1 * turn


def _is_round(field: tm.Terms, x: ex.Symbol, y: ex.Symbol) -> bool:
    """Whether the field depends on x^2 + y^2, and on x and y only through it: x B_y = y B_x."""
    slopes = [tm.derivative_of_terms(field, variable) for variable in (x, y)]
    turned = [tm.multiply_terms(slope, {tm.monomial(q): Fraction(1)}) for slope, q in zip(slopes, (y, x), strict=True)]
    return bool(slopes[0]) and turned[0] == turned[1]


def _outside(slope: tm.Terms, variable: Variable) -> list[tuple[tm.Terms, tm.Terms]]:
    """(c, g) with slope = sum of c g; c is free of the variable, g has no other factors, no two c are multiples."""
    pairs: list[tuple[tm.Terms, tm.Terms]] = []
    for key, beside in tm.grouped(slope, lambda letter: ex.holds(letter, variable)).items():
        for known, inner in pairs:
            ratios = {beside[one] / known[one] for one in known} if known.keys() == beside.keys() else set()
            if len(ratios) == 1:
                inner[key] = ratios.pop()
                break
        else:
            pairs.append((beside, {key: Fraction(1)}))
    return pairs


def _is_closed(variables: Sequence[Variable], slopes: Sequence[tm.Terms]) -> bool:
    """Whether the mixed derivatives agree."""
    for (p, one), (q, other) in combinations(zip(variables, slopes, strict=True), 2):
        turning = tm.add_terms(tm.derivative_of_terms(one, q), tm.derivative_of_terms(other, p), -1)
        if not is_zero(turning):
            return False
    return True


def _holds(terms: tm.Terms, variable: Variable) -> bool:
    return any(ex.holds(letter, variable) for key in terms for letter, _ in key)


def is_zero(terms: tm.Terms) -> bool:
    """Whether the sum vanishes, possibly by relations among its generators: tested at random points."""
    if not terms:
        return True
    if len(terms) == 1:
        return False
    try:
        return implicit_equations.vanishes(tm.tree_of(terms))
    except errors.InputError:
        return False


def power_rule(own: tm.Monomial, beside: tm.Terms, x: Variable) -> tm.Terms | None:
    """The integral of own * beside over x if the integrand is a power of x, or c u^e du/dx with u^e = own."""
    if not own:
        total, logarithm = tm.Terms(), tm.monomial(ex.Apply("log", x))
        for key, value in beside.items():
            e, raised = dict(key).get(x, Fraction(0)), tm.times(key, tm.monomial(x))
            total[tm.times(raised, logarithm) if e == -1 else raised] = value if e == -1 else value / (e + 1)
        return total
    if len(own) != 1:
        return None
    ((u, e),) = own
    if isinstance(u, ex.Sum) and (whole := tm.monomial_factor(beside, tm.terms_of(u))) is not None:
        beside, e = whole, e + 1  # x/(x - y)^3 - y/(x - y)^3
    factor = tm.monomial_factor(beside, tm.letter_derivative(u, x))
    if factor is None or _holds(factor, x) or ex.is_exponential(u):
        return None
    power: tm.Terms = (
        {frozenset([(u, e + 1)]): 1 / (e + 1)} if e != -1 else {tm.monomial(ex.Apply("log", u)): Fraction(1)}
    )
    return tm.multiply_terms(factor, power)


def _is_turned(symbols: Sequence[ex.Symbol], slopes: Sequence[tm.Terms], pairs: Sequence[tuple[int, int]]) -> bool:
    """Whether the potential is invariant when these pairs of coordinates are rotated, or scaled one up, one down."""

    def moment(slope: int, arm: int) -> tm.Terms:
        return tm.multiply_terms(slopes[slope], {tm.monomial(symbols[arm]): Fraction(1)})

    turning = tm.weighted_sum(part for i, j in pairs for part in ((moment(j, i), 1), (moment(i, j), -1)))
    scaling = tm.weighted_sum(part for i, j in pairs for part in ((moment(i, i), 1), (moment(j, j), -1)))
    return is_zero(turning) or is_zero(scaling)


def _along_rays(fields: dict[tuple[int, int], tm.Terms], symbols: Sequence[ex.Symbol]) -> dict[int, tm.Terms] | None:
    """A_i = q_j int_0^1 s F_ij(s q) ds of constant fields (Poincare's homotopy); None for other fields."""
    if any(_holds(terms, symbol) for terms in fields.values() for symbol in symbols):
        return None
    found: dict[int, tm.Terms] = {}
    for (i, j), terms in fields.items():
        arm: tm.Terms = {tm.monomial(symbols[j]): Fraction(1, 2)}
        found[i] = tm.add_terms(found.get(i, {}), tm.multiply_terms(terms, arm))
    return found
