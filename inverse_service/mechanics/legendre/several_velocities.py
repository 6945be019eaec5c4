"""Blocks that fall apart in other velocities y = M v, such as exp(x') + exp(x' + y').

p_v = M^T p_y, so a transform in y with p_y = M^-T p_v gives H and v = M^-1 y.

Blocks L = F(S), S a quadratic form: relativistic, Finsler, radial quartic; and L = g(v_k) + v_k phi(w / v_k).

For F(S), S = u^T G u/2 with u = v + h a shifted velocity, p = F'(S) G u. Let R = p^T G^-1 p. For F = k sqrt(b + s S),
H_u^2 = b (k^2 - 2 R/s); else, with signs e, d and w = sqrt(2 e S), f(w) = F(e w^2/2) is a problem in one velocity with
momentum e d sqrt(e R), and u = d w G^-1 p/sqrt(e R). Last, H = H_u - p h.

For ratios, w the other velocities (the rational family of the paper), with u = w/v_k: p_w = phi'(u) and
p_k = g'(v_k) + phi - u phi'(u). If phi* and g* are the Legendre transforms, then u = phi*'(p_w),
v_k = g*'(p_k + phi*(p_w)) and H = g*(p_k + phi*(p_w)). For g = a v_k^2/2 and phi = u^T S u/2:
H = (p_k + p_w^T S^-1 p_w/2)^2 / (2 a).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, product

from inverse_service.expressions import collecting, derivative, tree as ex
from inverse_service.mechanics import quadratic_forms
from inverse_service.mechanics.legendre import blocks, short_forms

Form = tuple[ex.Expression, ...]
Table = dict[ex.Expression, ex.Expression]
# A space is in no name that a user can declare.
_S, _W, _PI_W = ex.Symbol("S of v"), ex.Velocity("w of v"), ex.Symbol("momentum of w")


def linear_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches after a change to the linear forms under functions and powers, completed by velocities."""
    found = _forms(block) if len(block.names) > 1 else ()
    units = tuple(tuple(ex.number(int(a == b)) for b in block.names) for a in block.names)
    if not found or set(found) <= set(units):
        return
    for chosen in combinations(units, len(block.names) - len(found)):
        inverse = blocks.invert((*found, *chosen))
        if inverse is not None:
            yield from _after_change(block, (*found, *chosen), inverse, solve)


def _after_change(
    block: blocks.Block, forms: Sequence[Form], inverse: blocks.Inverse, solve: blocks.Solver
) -> Iterator[blocks.Branch]:
    """The branches with the forms in the place of velocities."""
    velocities = [ex.Velocity(name) for name in block.names]
    symbols = [block.momenta[name] for name in block.names]
    rates = _table(velocities, [ex.dot(row, velocities) for row in inverse.entries])
    changed = ex.substitute(block.function, rates)
    columns = zip(*inverse.entries, strict=True)
    momenta = _table(symbols, [short_forms.simplified(ex.dot(column, symbols)) for column in columns])
    new = _table(velocities, [ex.dot(row, velocities) for row in forms])
    for branch in solve(changed, block.names, block.momenta):
        found = [ex.substitute(tree, momenta) for tree in branch.velocities]
        yield blocks.Branch(
            tuple(short_forms.simplified(ex.dot(row, found)) for row in inverse.entries),
            ex.substitute(branch.hamiltonian, momenta),
            tuple(ex.substitute(condition, {**new, **momenta}) for condition in branch.conditions),
        )


def _table(keys: Sequence[ex.Symbol | ex.Velocity], values: Sequence[ex.Expression]) -> Table:
    return dict(zip(keys, values, strict=True))


def _forms(block: blocks.Block) -> tuple[Form, ...]:
    """The linear forms on which functions and powers depend; none where there are too many, or others."""
    found: dict[Form, None] = {}
    for monomial, _ in collecting.expand(block.function):
        forms = _forms_of(monomial, block.names)
        if forms is None:
            return ()
        found.update(dict.fromkeys(forms))
    return tuple(found) if len(found) <= len(block.names) else ()


def _forms_of(monomial: collecting.Monomial, names: Sequence[str]) -> list[Form] | None:
    """The linear forms in the atoms of a term, bare velocities not counted; None where one is not linear."""
    exponent: dict[str, ex.Expression] = {}
    forms: list[Form | None] = []
    for base, power in monomial:
        if isinstance(base, ex.Velocity) or not short_forms.velocities_in(base, names):
            continue
        part = linear_coefficients(collecting.expand(base.argument if isinstance(base, ex.Apply) else base), names)
        if ex.is_exponential(base) and part:
            for name, value in part.items():
                exponent[name] = exponent.get(name, ex.ZERO) + power * value
        else:
            forms.append(_monic(part, names))
    if exponent:
        forms.append(_monic(exponent, names))
    return None if None in forms else [form for form in forms if form]


def _monic(coefficients: Mapping[str, ex.Expression] | None, names: Sequence[str]) -> Form | None:
    if not coefficients:
        return None
    first = next(coefficients[name] for name in names if name in coefficients)
    return tuple(short_forms.simplified(coefficients.get(name, ex.ZERO) / first) for name in names)


def linear_coefficients(terms: Iterable[collecting.Term], names: Sequence[str]) -> Mapping[str, ex.Expression] | None:
    """The coefficients of the velocities in terms that are linear in them (free terms allowed), else None."""
    found: dict[str, ex.Expression] = {}
    for monomial, value in terms:
        inside = short_forms.velocities_in(collecting.monomial_tree(monomial), names)
        if not inside:
            continue
        name = next(iter(inside))
        rest = tuple(pair for pair in monomial if pair != (ex.Velocity(name), Fraction(1)))
        if len(rest) != len(monomial) - 1 or short_forms.velocities_in(collecting.monomial_tree(rest), names):
            return None
        term = value * (collecting.monomial_tree(rest) if rest else ex.ONE)
        found[name] = found.get(name, ex.ZERO) + term
    return found


@dataclass(frozen=True, slots=True)
class _Radial:
    """L = function(_S) with _S = u^T matrix u/2 and u_i = v_i + shift_i."""

    function: ex.Expression
    matrix: blocks.Matrix
    inverse: blocks.Inverse
    shift: tuple[ex.Expression, ...]


def radial_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches of a block that depends on one quadratic form of its velocities."""
    for form in _candidates(block):
        radial = _recognized(block, form)
        if radial is not None:
            root = _root_parts(radial.function)
            yield from _of_root(block, radial, *root) if root else _of_length(block, radial, solve)
            return


def _candidates(block: blocks.Block) -> Iterator[ex.Expression]:
    """Trees quadratic in the velocities: the bases of powers, and the part of degree 2."""
    power = quadratic_forms.power_of_form(block.function)
    if power is not None:
        yield power[0]
    terms = collecting.expand(block.function)
    second = []
    seen: set[ex.Expression] = set()
    for monomial, value in terms:
        found = blocks.degrees(monomial, block.names)
        if found is not None and sum(found.values()) == 2:
            second.append((monomial, value))
        for base, _ in monomial:
            if isinstance(base, ex.Sum) and base not in seen and short_forms.velocities_in(base, block.names):
                seen.add(base)
                yield base
    if second and len(second) < len(terms):
        yield collecting.terms_tree(second)


def _recognized(block: blocks.Block, form: ex.Expression) -> _Radial | None:
    """The block as a function of the quadratic form's quadratic part about its center."""
    parts = _quadratic_parts(form, block.names)
    inverse = blocks.invert(parts[0]) if parts else None
    if parts is None or inverse is None:
        return None
    matrix, slopes = parts
    shift = tuple(short_forms.simplified(ex.dot(row, slopes)) for row in inverse.entries)
    centered = _centered(block, shift)
    along = _along_a_ray(centered, block.names, matrix)
    if along is None:
        return None
    whole = ex.HALF * _form_of_velocities(matrix, block.names)
    if collecting.expand(ex.substitute(along, {_S: whole})) != collecting.expand(centered):
        return None
    return _Radial(along, matrix, inverse, shift)


def _quadratic_parts(form: ex.Expression, names: Sequence[str]) -> tuple[blocks.Matrix, list[ex.Expression]] | None:
    """(G, b) of c + b v + v^T G v/2."""
    quadratic: list[collecting.Term] = []
    linear: list[collecting.Term] = []
    for monomial, value in collecting.expand(form):
        found = blocks.degrees(monomial, names)
        if found is None or sum(found.values()) not in (0, 1, 2):
            return None
        if sum(found.values()):
            (linear if sum(found.values()) == 1 else quadratic).append((monomial, value))
    matrix = blocks.form_matrix(quadratic, names) if quadratic else None
    slopes = linear_coefficients(linear, names)
    if matrix is None or slopes is None:
        return None
    return matrix, [slopes.get(name, ex.ZERO) for name in names]


def _centered(block: blocks.Block, shift: Sequence[ex.Expression]) -> ex.Expression:
    """The function of u, written with the velocities of v."""
    pairs = zip(block.names, shift, strict=True)
    table: dict[ex.Expression, ex.Expression] = {ex.Velocity(n): ex.Velocity(n) - h for n, h in pairs}
    return ex.substitute(block.function, table)


def _along_a_ray(function: ex.Expression, names: Sequence[str], matrix: blocks.Matrix) -> ex.Expression | None:
    """The function of S on the ray through e_i, or e_i + e_j, on which S is not zero; None where v is left."""
    for i, j in product(range(len(names)), repeat=2):
        entry = matrix[i][i] if i == j else 2 * matrix[i][j] if i < j else ex.ZERO
        if entry == ex.ZERO or (i != j and matrix[i][i] != ex.ZERO):
            continue
        length = ex.square_root(2 * _S / entry)
        table: dict[ex.Expression, ex.Expression] = {
            ex.Velocity(name): length if place in (i, j) else ex.ZERO for place, name in enumerate(names)
        }
        return short_forms.simplified(ex.substitute(function, table))
    return None


def _form_of_velocities(matrix: blocks.Matrix, names: Sequence[str]) -> ex.Expression:
    pairs = product(enumerate(names), repeat=2)
    return ex.add(*(matrix[i][j] * ex.Velocity(a) * ex.Velocity(b) for (i, a), (j, b) in pairs))


def _root_parts(function: ex.Expression) -> tuple[ex.Expression, ex.Expression, ex.Expression] | None:
    """(k, b, s) of k sqrt(b + s S), else None."""
    terms = collecting.expand(function)
    roots = {pair for monomial, _ in terms for pair in monomial if pair[1] == ex.HALF.value and _holds_s(pair[0])}
    if len(roots) != 1 or not all(roots <= {*monomial} for monomial, _ in terms):
        return None
    ((root, _),) = roots
    factor = collecting.terms_tree([(tuple(p for p in monomial if p not in roots), c) for monomial, c in terms])
    slope, start = derivative.differentiate(root, _S), ex.substitute(root, {_S: ex.ZERO})
    if _holds_s(factor) or _holds_s(slope) or start == ex.ZERO:
        return None
    return factor, start, short_forms.simplified(slope)


def _holds_s(tree: ex.Expression) -> bool:
    return derivative.differentiate(tree, _S) != ex.ZERO


def _of_root(
    block: blocks.Block, radial: _Radial, k: ex.Expression, b: ex.Expression, s: ex.Expression
) -> Iterator[blocks.Branch]:
    """F = k sqrt(b + s S): H_u^2 = b (k^2 - 2 R/s), sign(H_u) = -sign(k b), u = -2 b G^-1 p/(s H_u)."""
    momenta = [block.momenta[name] for name in block.names]
    form = blocks.quadratic_form(radial.inverse, momenta)
    apart = b * k**2 + collecting.collect(-2 * b * form / s)
    square = short_forms.shortest([short_forms.simplified(apart), apart])
    lead = short_forms.simplified(k * b)
    for sign in (1, -1):
        energy = sign * ex.square_root(square)
        scale = short_forms.simplified(-2 * b / s)
        rates = [scale * ex.dot(row, momenta) * energy**-1 for row in radial.inverse.entries]
        condition = -sign * lead
        if not (isinstance(condition, ex.Number) and condition.value < 0):
            yield _shifted(radial, rates, energy, momenta, (condition,))


def _shifted(
    radial: _Radial,
    rates: Sequence[ex.Expression],
    energy: ex.Expression,
    momenta: Sequence[ex.Symbol],
    conditions: tuple[ex.Expression, ...],
) -> blocks.Branch:
    velocities = tuple(short_forms.simplified(u - h) for u, h in zip(rates, radial.shift, strict=True))
    drift = ex.dot(momenta, radial.shift)
    plain = energy - drift
    return blocks.Branch(velocities, short_forms.shortest([plain, short_forms.simplified(plain)]), conditions)


def _of_length(block: blocks.Block, radial: _Radial, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """Any other F, through w = sqrt(2 e S), for both signs e of S and d of F'."""
    if len(block.names) == 1:
        return
    momenta = [block.momenta[name] for name in block.names]
    form = blocks.quadratic_form(radial.inverse, momenta)
    center = dict(zip(block.names, radial.shift, strict=True))
    whole = _form_of_velocities(radial.matrix, block.names)
    place: dict[ex.Expression, ex.Expression] = {ex.Velocity(n): ex.Velocity(n) + h for n, h in center.items()}
    for e, d in product((1, -1), repeat=2):
        length = ex.square_root(short_forms.simplified(e * form))
        squared = Fraction(e, 2) * ex.Power(_W, ex.number(2))
        for inner in solve(ex.substitute(radial.function, {_S: squared}), [_W.coordinate], {_W.coordinate: _PI_W}):
            known: dict[ex.Expression, ex.Expression] = {_PI_W: e * d * length}
            w, energy = (ex.substitute(tree, known) for tree in (inner.velocities[0], inner.hamiltonian))
            rates = [d * w * length**-1 * ex.dot(row, momenta) for row in radial.inverse.entries]
            size = ex.square_root(e * whole)
            slope = ex.substitute(derivative.differentiate(radial.function, _S), {_S: ex.HALF * whole})
            conditions = [*(ex.substitute(c, {_W: size, **known}) for c in inner.conditions), d * slope]
            conditions.append(e * whole)
            placed = tuple(short_forms.simplified(ex.substitute(condition, place)) for condition in conditions)
            yield _shifted(radial, rates, energy, momenta, placed)


def ratio_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches for each velocity that can play the part of v_k."""
    for pivot in block.names if len(block.names) > 1 else ():
        parts = _ratio_parts(block, pivot)
        if parts is None:
            continue
        alone, homogeneous = parts
        others = [name for name in block.names if name != pivot]
        for inner in solve(homogeneous, others, block.momenta):
            for outer in solve(alone, [pivot], block.momenta):
                yield _with_ratios(block, pivot, inner, outer)


def _ratio_parts(block: blocks.Block, pivot: str) -> tuple[ex.Expression, ex.Expression] | None:
    """(g, phi(u)), u_j being written as the velocity of w_j; None where the block is not of the form."""
    rate = ex.Velocity(pivot)
    others = [name for name in block.names if name != pivot]
    table: dict[ex.Expression, ex.Expression] = {ex.Velocity(name): rate * ex.Velocity(name) for name in others}
    alone: list[collecting.Term] = []
    homogeneous: list[collecting.Term] = []
    for monomial, value in collecting.expand(ex.substitute(block.function, table)):
        rest = blocks.without(monomial, [pivot])
        if not short_forms.velocities_in(collecting.monomial_tree(monomial), others):
            alone.append((monomial, value))
        elif (rate, Fraction(1)) in monomial and not short_forms.velocities_in(collecting.monomial_tree(rest), [pivot]):
            homogeneous.append((rest, value))
        else:
            return None
    if not alone or not homogeneous:
        return None
    return collecting.terms_tree(alone), collecting.terms_tree(homogeneous)


def _with_ratios(block: blocks.Block, pivot: str, inner: blocks.Branch, outer: blocks.Branch) -> blocks.Branch:
    others = [name for name in block.names if name != pivot]
    momentum = block.momenta[pivot]
    shifted: dict[ex.Expression, ex.Expression] = {momentum: momentum + inner.hamiltonian}
    velocities = {name: rate * ex.Velocity(pivot) for name, rate in zip(others, inner.velocities, strict=True)}
    velocities[pivot] = ex.substitute(outer.velocities[0], shifted)
    ratios: dict[ex.Expression, ex.Expression] = {ex.Velocity(n): ex.Velocity(n) / ex.Velocity(pivot) for n in others}
    conditions = [ex.substitute(condition, ratios) for condition in inner.conditions]
    conditions += [ex.substitute(condition, shifted) for condition in outer.conditions]
    rates = tuple(velocities[name] for name in block.names)
    return blocks.Branch(rates, ex.substitute(outer.hamiltonian, shifted), tuple(conditions))
