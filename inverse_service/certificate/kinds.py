"""Claims about Lagrangians of one kind: see FORMAT.md.

A kind consists of the Lagrangians that derivations Y multiply by a number, or of those whose
Hessian is definite at a real point.
"""

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from functools import cached_property
from itertools import combinations, combinations_with_replacement, product
from typing import Any, Literal

from . import formulas as fm
from .formulas import NUMBER, TEXT, Incomplete, check_shape, read_tokens, require, value_of
from .numbers import Arithmetic, Series, Unsettled
from .question import NOT_SHOWN, KindsOfRows, Question, RowKind, Tools, Zero
from .series import Elimination, Expansion, Term

KINDS = "natural|riemannian|finsler|positive_definite|rayleigh|rayleigh_general"
NATURAL, HOMOGENEOUS = ("natural", "riemannian", "rayleigh"), ("riemannian", "finsler")
Rationals = list[list[Fraction]]
# The components of Y, the c of Y(L) = c L, and whether this is exact.
Derivation = tuple[dict[int, Series], int, bool]


class KindExpansion(Expansion):
    """Series as for any Lagrangian, with the conditions on Lagrangians of a kind."""

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        super().__init__(arithmetic, degree)
        self.pushed = self.slopes  # slopes of f with its friction
        self.speeds = dict(zip(self.v, self.field[-2 * len(self.v) : -len(self.v)], strict=True))
        if self.question.without_drag:
            odd = {v: self.constant(Fraction(2 * k + 1)) for k, v in enumerate(self.v)}
            self.cubic = self.forces
            scaled = [self.along(self.speeds, force, degree) for force in self.forces]
            for _ in range(3):
                self.cubic = [self.along(odd, force, degree) for force in self.cubic]
            twice = [self.along(self.speeds, once, degree) for once in scaled]
            self.forces = [
                self.add([*parts], [1, -2, 1])
                for parts in zip(self.forces, scaled, twice, strict=True)
            ]
            self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]
            self.field[-len(self.v) :] = self.forces

    @cached_property
    def derivations(self) -> list[Derivation]:
        found: list[Derivation] = [
            ({v: self.one}, 0, False) for v in self.v if self.question.kind in NATURAL
        ]
        found += [(self.speeds, 2, True)] * (self.question.kind in HOMOGENEOUS)
        for move in self.question.moves:
            parts = {
                a: value_of(self, move[name])
                for a, name in zip(self.q, self.question.coordinates, strict=True)
                if name in move
            }
            along = dict(zip(self.q, self.speeds.values(), strict=True))
            rates = {
                a + len(self.v): self.along(along, part, self.degree) for a, part in parts.items()
            }
            found.append((parts | rates, 0, True))
        return found

    def terms(self, kind: str, *place: int, degree: int = 0) -> list[Term]:
        if kind[0] in "CD":
            return [*self.curl(kind[0], int(kind[1:]), *place)]
        if kind[0] not in "KS":
            return super().terms(kind, *place, degree=degree)
        (parts, weight, _), by = self.derivations[int(kind[1:])], tuple(self.v[a] for a in place)
        if kind[0] == "S":  # g_ik s^k
            shifts = (
                self.cubic if self.question.without_drag else self.shifts(parts, weight, degree)
            )
            return [Term(1, shift, (by[0], v)) for v, shift in zip(self.v, shifts, strict=True)]
        terms = self.multiplied(parts, weight, by)
        for v, (b, c) in product(self.v, (by, by[::-1])):
            terms.append(Term(1, self.derivative(parts.get(v, {}), c), (b, v)))
        return terms

    def shifts(self, parts: dict[int, Series], weight: int, degree: int) -> Iterator[Series]:
        """s = Y(f) - Gamma(Y_v) - c f/2 by components, to a degree."""
        flow, signs = dict(enumerate(self.field)), [1, -1, -(weight // 2)]
        for v, f in zip(self.v, self.forces, strict=True):
            turned = self.along(flow, parts.get(v, {}), degree)
            yield self.add([self.along(parts, f, degree), turned, f], signs)

    def curl(self, kind: str, k: int, i: int, j: int) -> Iterator[Term]:
        """d_w (g_il df^l/dv^j - g_jl df^l/dv^i): w = v^k, with 2 (d_(q^j) g_ik - d_(q^i) g_jk).

        Or w = q^k, cyclic.
        """
        cycle = [(i, j, k), (j, k, i), (k, i, j)][: 1 if kind == "C" else 3]
        for (a, b, c), sign in product(cycle, (1, -1)):
            (i, j), w = (a, b)[::sign], (self.v if kind == "C" else self.q)[c]
            for v, slope in zip(self.v, self.pushed, strict=True):
                yield Term(sign, slope[j], (self.v[i], v, w))
                yield Term(sign, self.derivative(slope[j], w), (self.v[i], v))
            if kind == "C":
                yield Term(2 * sign, self.one, (self.v[i], self.v[c], self.q[j]))

    def multiplied(
        self, parts: dict[int, Series], weight: int, by: tuple[int, ...] = ()
    ) -> list[Term]:
        """Y(L) - c L for the derivative of L by some variables."""
        terms = [Term(1, part, (*by, a)) for a, part in parts.items()]
        return [*terms, Term(-weight, self.one, by)]


class OfKind(Question):
    """A system, and the checks of certificates about its Lagrangians of one kind."""

    jet = 3

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        self.kind = claim["among"]
        self.moves = list[dict[str, tuple[str, ...]]]()
        self.drag = tuple[str, ...]()
        invariant = named(self.kind) == "invariant"
        for move in self.kind["invariant"] if invariant else ():
            check_shape(move, dict.fromkeys(move, TEXT), "among.invariant")
            self.moves.append(
                {name: read_tokens(text, "among.invariant") for name, text in move.items()}
            )
        require(
            not timed or self.kind not in HOMOGENEOUS, "A homogeneous Lagrangian is one without t."
        )
        if "rayleigh" in self.kind and claim["kind"] == "lagrangian":
            self.drag = read_tokens(claim.get("dissipation"), "certificate.dissipation")
            good = timed or "t" not in self.drag
            require(good, "The dissipation contains t, but the question does not.")
        self.without_drag = self.kind == "rayleigh" and not self.drag
        super().__init__(tools, document, timed, claim)
        good = all(move and {*move} <= {*self.coordinates} for move in self.moves)
        good = good and bool(self.moves) == invariant
        require(good, "A vector field has components along coordinates.")
        words = {token for text in self.fields() for token in text if token[:1].isalpha()}
        good = words <= {*self.coordinates, *self.parameters}
        require(good, "A field may contain only coordinates and parameters.")
        require(not any(map(fm.is_irrational, self.fields())), "It is irrational.")

    def fields(self) -> list[tuple[str, ...]]:
        """The components of all vector fields."""
        return [text for move in self.moves for text in move.values()]

    def listed_rows(self) -> KindsOfRows:
        n = len(self.coordinates)
        natural = len(self.coordinates) * (self.kind in NATURAL)
        even = 2 * self.without_drag
        plain = self.kind != "rayleigh_general" and not (even and self.timed)
        found = super().listed_rows() if plain else {}
        count = natural + (self.kind in HOMOGENEOUS) + len(self.moves)
        # The row of (0, 0) is zero.
        for kind, k in product("CD" if "rayleigh" in self.kind else "", range(n)):
            pairs = list(combinations(range(n if kind == "C" else k), 2))
            found[kind + str(k)] = RowKind(1, 2, pairs or [(0, 0)])
        pairs = list(combinations_with_replacement(range(n), 2))
        found |= {f"K{s}": RowKind(1, 2, pairs) for s in range(count)}
        singles = [(i, i) for i in range(n)]
        found |= {f"S{s}": RowKind(0, 2, singles) for s in even * [0] or range(natural, count)}
        return {kind: one._replace(depth=one.depth + even) for kind, one in found.items()}

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return KindExpansion(arithmetic, degree)

    def texts(self) -> list[tuple[str, ...]]:
        return [*super().texts(), *self.fields(), self.drag]

    def prepare(
        self,
        read: Callable[[Any], object],
        formulas: Iterable[tuple[str, ...]] = (),
        rational: bool = True,
    ) -> None:
        more = [*filter(None, [*self.fields(), self.drag])]
        super().prepare(lambda ring: (read(ring), fm.read_formulas(ring, more)), formulas, rational)

    def residuals(self, ring: Any, lagrangian: Series) -> Iterator[Zero]:
        """E_i - dD/dv^i of L.

        Then all terms that must vanish for the kind, and for D to be quadratic and homogeneous.
        """
        drag = value_of(ring, self.drag) if self.drag else {}
        for v, (value, sentence) in zip(ring.v, super().residuals(ring, lagrangian), strict=True):
            yield Zero(ring.add([value, ring.value([Term(-1, ring.one, (v,))], drag)]), sentence)
        exact = [(parts, weight, lagrangian) for parts, weight, holds in ring.derivations if holds]
        for parts, weight, series in [
            *exact,
            *[(ring.speeds, 2, drag)] * (self.kind == "rayleigh"),
        ]:
            image = ring.value(ring.multiplied(parts, weight), series)
            yield Zero(image, "It is not homogeneous, or not invariant.")
        thirds = combinations_with_replacement(ring.v, 3) if self.kind in NATURAL else ()
        for series, by in product([lagrangian, drag], thirds):
            third = ring.value([Term(1, ring.one, by)], series)
            yield Zero(third, "It is not quadratic in the velocities.")

    def existence(self, document: dict[str, Any]) -> str:
        if self.moves or self.kind == "rayleigh":
            raise Incomplete("For this type, only an explicit Lagrangian proves existence.")
        return super().existence(document)


def named(kind: Any) -> Any:
    """The name of a kind, which may have vector fields."""
    if not isinstance(kind, dict):
        check_shape(kind, KINDS, "among")
        return kind
    check_shape(kind, {"invariant": [{}, fm.MAX_NAMES]}, "among")
    require(len(kind) == 1, "among has to name one kind.")
    return "invariant"


class DefiniteExpansion(Expansion):
    """Series at the point itself, where the given matrix is g(p) once it satisfies all rows for
    g(p).
    """

    def entries(self, matrix: Rationals) -> Series:
        """By the coefficients of L: the coefficients of tr(matrix g)/2, half the values where g =
        matrix.
        """
        pairs = combinations_with_replacement(range(len(self.v)), 2)
        found = {
            self.units[self.v[i]] + self.units[self.v[j]]: self.arithmetic.number(matrix[i][j])
            for i, j in pairs
        }
        return self.settle(found)

    def matrix(self, elimination: Elimination) -> list[list[Any]]:
        given, orthogonal = self.question.member, self.question.orthogonal
        if not self.question.pinned:
            return super().matrix(elimination)
        if orthogonal:  # 0 if tr(orthogonal g) = 0 follows from the rows
            is_new = elimination.insert(self.entries(orthogonal))
            return [[self.arithmetic.number(Fraction(is_new))]]
        halves = [
            [x / 2 if i == j else x for j, x in enumerate(row)] for i, row in enumerate(given)
        ]
        values, one = self.entries(halves), self.arithmetic.number(Fraction(1))
        for pivot, row in zip(elimination.pivots, elimination.rows, strict=True):
            if pivot >> self.shift == self.offset:
                solved = self.solved(row | {pivot: one}, values)
                require(solved, "The multiplier does not satisfy the conditions at the point.")
        return self.hessian(values)


class Definite(Question):
    """A system, and the checks of certificates about definite Hessians at the point `near`."""

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        self.pinned, self.member, self.orthogonal = False, Rationals(), Rationals()
        super().__init__(tools, document, timed, claim)
        whole = {*self.variables, *self.parameters}
        require(whole <= {*self.near}, "near has to name the whole point.")

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        if self.pinned:
            numbers = {name: arithmetic.number(value) for name, value in self.near.items()}
            arithmetic.values |= numbers
        return DefiniteExpansion(arithmetic, degree)

    def modulo(self, degree: int, work: Callable[[Expansion], Any], count: int = 2) -> list[Any]:
        """The results at the point itself; for existence also at random points, which must
        agree.
        """
        if not degree or not (self.member or self.orthogonal):
            return super().modulo(degree, work, count)
        if self.functions or any("pi" in text or fm.is_irrational(text) for text in self.texts()):
            raise Incomplete("If f is not rational, only an explicit Lagrangian proves anything.")
        found = super().modulo(degree, work, count) if self.member else []
        self.pinned = True
        found += super().modulo(degree, work, count)
        self.pinned = False
        return found

    def symmetric(self, document: dict[str, Any], key: str) -> Rationals:
        size = len(self.coordinates)
        check_shape(document, {key: ((NUMBER,) * size,) * size}, "certificate")
        found = [[Fraction(x) for x in row] for row in document[key]]
        columns = [[*column] for column in zip(*found, strict=True)]
        require(found == columns, f"{key} is not symmetric.")
        return found

    def lagrangian(self, document: dict[str, Any]) -> str:
        told = super().lagrangian(document)
        formula = read_tokens(document.get("lagrangian"), "certificate.lagrangian")

        def real(ring: Expansion) -> None:
            rows = ring.hessian(value_of(ring, formula))
            sign = 1 if rows[0][0] > 0 else -1
            turned = [[entry * sign for entry in row] for row in rows]
            require(is_definite(turned), "The Hessian is not definite.")

        self.proven_in_balls(self.jet, real, f"{NOT_SHOWN} the Hessian is definite.")
        return told

    def existence(self, document: dict[str, Any]) -> str:
        self.member = self.symmetric(document, "multiplier")
        require(is_definite(self.member), "The multiplier is not positive definite.")
        return super().existence(document)

    def nonexistence(self, document: dict[str, Any]) -> str:
        self.orthogonal = self.symmetric(document, "orthogonal")
        good = any(map(any, self.orthogonal)) and is_definite(self.orthogonal, "with_their_rows")
        require(good, "orthogonal is zero, or not positive semidefinite.")
        return super().nonexistence(document).replace("regular", "definite")


def is_definite(
    matrix: list[list[Any]], zeros: Literal["refused", "with_their_rows"] = "refused"
) -> bool:
    """Whether symmetric elimination finds positive pivots only, or also zero pivots whose rows are
    zero (a semidefinite matrix).

    Unsettled if a ball does not decide.
    """
    rows = [[*row] for row in matrix]
    for k, row in enumerate(rows):
        if row[k] < 0 or (row[k] == 0 and (zeros == "refused" or any(row[k:]))):
            return False
        if row[k] == 0:
            continue
        if not row[k] > 0:
            raise Unsettled
        for other in rows[k + 1 :]:
            factor = other[k] / row[k]
            other[:] = [a - factor * b for a, b in zip(other, row, strict=True)]
    return True
