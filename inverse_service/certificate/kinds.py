"""Claims about Lagrangians of one kind, by the derivations Y that multiply these by a number: see FORMAT.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from functools import cached_property
from itertools import combinations, combinations_with_replacement, product
from typing import Any

from .checker import KindsOfRows, Question, Tools
from .formulas import MAX_NAMES, TEXT, Ended, Reader, check_shape, is_irrational, read_tokens, require
from .numbers import Arithmetic, Series
from .series import Expansion, Term

NATURAL, HOMOGENEOUS = ("natural", "riemannian", "rayleigh"), ("riemannian", "finsler")
Derivation = tuple[dict[int, Series], int, bool]  # its components, c of Y(L) = c L, and whether that holds exactly


class KindExpansion(Expansion):
    """Series as for any Lagrangian, and the conditions on those of a kind."""

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        super().__init__(arithmetic, degree)
        self.pushed = self.slopes  # those of f with its friction
        self.speeds = dict(zip(self.v, self.field[-2 * len(self.v) : -len(self.v)], strict=True))
        if self.question.without_drag:
            odd = {v: self.constant(Fraction(2 * k + 1)) for k, v in enumerate(self.v)}
            self.cubic, scaled = self.forces, [self.along(self.speeds, force) for force in self.forces]
            for _ in range(3):
                self.cubic = [self.along(odd, force) for force in self.cubic]
            self.forces = [self.add([force, once, self.along(self.speeds, once)], [1, -2, 1])
                           for force, once in zip(self.forces, scaled, strict=True)]  # fmt: skip
            self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]
            self.field[-len(self.v) :] = self.forces

    @cached_property
    def derivations(self) -> list[Derivation]:
        found: list[Derivation] = [({v: self.one}, 0, False) for v in self.v if self.question.kind in NATURAL]
        found += [(self.speeds, 2, True)] * (self.question.kind in HOMOGENEOUS)
        for move in self.question.moves:
            parts = {a: Reader(self, move[name]).value
                     for a, name in zip(self.q, self.question.coordinates, strict=True) if name in move}  # fmt: skip
            along = dict(zip(self.q, self.speeds.values(), strict=True))
            found.append((parts | {a + len(self.v): self.along(along, part) for a, part in parts.items()}, 0, True))
        return found

    def terms(self, kind: str, *place: int) -> list[Term]:
        if kind[0] not in "KS":
            return [*self.curl(kind[0], int(kind[1:]), *place)] if kind[0] in "CD" else super().terms(kind, *place)
        (parts, weight, _), by = self.derivations[int(kind[1:])], tuple(self.v[a] for a in place)
        if kind[0] == "S":  # g_ik s^k with s = Y(f) - Gamma(Y_v) - c f/2
            shifts = self.cubic if self.question.without_drag else [
                self.add([self.along(parts, f), self.along(dict(enumerate(self.field)), parts.get(v, {})), f],
                         [1, -1, -(weight // 2)]) for v, f in zip(self.v, self.forces, strict=True)]  # fmt: skip
            return [(1, shift, (by[0], v)) for v, shift in zip(self.v, shifts, strict=True)]
        turned = [(1, self.derivative(parts.get(v, {}), c), (b, v)) for v in self.v for b, c in (by, by[::-1])]
        return self.multiplied(parts, weight, by) + turned

    def curl(self, kind: str, k: int, i: int, j: int) -> Iterator[Term]:
        """d_w (g_il df^l/dv^j - g_jl df^l/dv^i): w = v^k, with 2 (d_(q^j) g_ik - d_(q^i) g_jk); or w = q^k, cyclic."""
        cycle = [(i, j, k), (j, k, i), (k, i, j)][: 1 if kind == "C" else 3]
        for (a, b, c), sign in product(cycle, (1, -1)):
            (i, j), w = (a, b)[::sign], (self.v if kind == "C" else self.q)[c]
            for v, slope in zip(self.v, self.pushed, strict=True):
                yield from ((sign, slope[j], (self.v[i], v, w)), (sign, self.derivative(slope[j], w), (self.v[i], v)))
            yield from [(2 * sign, self.one, (self.v[i], self.v[c], self.q[j]))] * (kind == "C")

    def multiplied(self, parts: dict[int, Series], weight: int, by: tuple[int, ...] = ()) -> list[Term]:
        """Y(L) - c L, of the derivative of L by some variables."""
        return [*((1, part, (*by, a)) for a, part in parts.items()), (-weight, self.one, by)]


class OfKind(Question):
    """A system, and the checks of certificates about its Lagrangians of one kind."""

    jet = 3

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        self.kind, self.moves, self.drag = claim["among"], list[dict[str, tuple[str, ...]]](), tuple[str, ...]()
        invariant = named(self.kind) == "invariant"
        for move in self.kind["invariant"] if invariant else ():
            check_shape(move, dict.fromkeys(move, TEXT), "among.invariant")
            self.moves.append({name: read_tokens(text, "among.invariant") for name, text in move.items()})
        require(not timed or self.kind not in HOMOGENEOUS, "A homogeneous Lagrangian is one without t.")
        if "rayleigh" in self.kind and claim["kind"] == "lagrangian":
            self.drag = read_tokens(claim.get("dissipation"), "certificate.dissipation")
            require(timed or "t" not in self.drag, "The dissipation contains t, but the question does not.")
        self.without_drag = self.kind == "rayleigh" and not self.drag
        super().__init__(tools, document, timed, claim)
        words = {token for move in self.moves for text in move.values() for token in text if token[:1].isalpha()}
        good = all(move and {*move} <= {*self.coordinates} for move in self.moves) and bool(self.moves) == invariant
        require(good, "A vector field has components along coordinates.")
        require(words <= {*self.coordinates, *self.parameters}, "A field may hold coordinates and parameters only.")
        require(not any(is_irrational(text) for move in self.moves for text in move.values()), "It is irrational.")

    def listed_rows(self) -> KindsOfRows:
        n, natural, even = len(self.coordinates), len(self.coordinates) * (self.kind in NATURAL), 2 * self.without_drag
        found = {} if self.kind == "rayleigh_general" or (even and self.timed) else super().listed_rows()
        count = natural + (self.kind in HOMOGENEOUS) + len(self.moves)
        for kind, k in product("CD" if "rayleigh" in self.kind else "", range(n)):  # (0, 0) is a row of zeros
            found[kind + str(k)] = 1, 2, list(combinations(range(n if kind == "C" else k), 2)) or [(0, 0)]
        found |= {f"K{s}": (1, 2, list(combinations_with_replacement(range(n), 2))) for s in range(count)}
        found |= {f"S{s}": (0, 2, [(i, i) for i in range(n)]) for s in even * [0] or range(natural, count)}
        return {kind: (order, depth + even, places) for kind, (order, depth, places) in found.items()}

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return KindExpansion(arithmetic, degree)

    def texts(self) -> list[tuple[str, ...]]:
        return [*super().texts(), *(text for move in self.moves for text in move.values()), self.drag]

    def prepare(
        self, read: Callable[[Any], object], formulas: Iterable[tuple[str, ...]] = (), rational: bool = True
    ) -> None:
        more = [text for text in self.texts()[len(super().texts()) :] if text]
        super().prepare(lambda ring: (read(ring), [Reader(ring, text).value for text in more]), formulas, rational)

    def residuals(self, ring: Any, lagrangian: Series) -> Iterator[tuple[Series, str]]:
        """Of L, E_i - dD/dv^i; then what has to be zero for L to be of the kind, and D quadratic and homogeneous."""
        drag = Reader(ring, self.drag).value if self.drag else {}
        for v, (value, sentence) in zip(ring.v, super().residuals(ring, lagrangian), strict=True):
            yield ring.add([value, ring.value([(-1, ring.one, (v,))], drag)]), sentence
        exact = [(parts, weight, lagrangian) for parts, weight, holds in ring.derivations if holds]
        for parts, weight, series in [*exact, *[(ring.speeds, 2, drag)] * (self.kind == "rayleigh")]:
            yield ring.value(ring.multiplied(parts, weight), series), "It is not homogeneous, or not invariant."
        thirds = combinations_with_replacement(ring.v, 3) if self.kind in NATURAL else ()
        for series, by in product([lagrangian, drag], thirds):
            yield ring.value([(1, ring.one, by)], series), "It is not quadratic in the velocities."

    def existence(self, document: dict[str, Any]) -> str:
        if self.moves or self.kind == "rayleigh":
            raise Ended("incomplete", "Of this kind only a Lagrangian itself proves that there is one.")
        return super().existence(document)


def named(kind: Any) -> Any:
    """The name of a kind, which may have vector fields."""
    if not isinstance(kind, dict):
        check_shape(kind, "natural|riemannian|finsler|positive_definite|rayleigh|rayleigh_general", "among")
        return kind
    check_shape(kind, {"invariant": [{}, MAX_NAMES]}, "among")
    require(len(kind) == 1, "among has to name one kind.")
    return "invariant"
