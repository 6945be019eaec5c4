"""Claims about Lagrangians of one kind, by the derivations Y that multiply these by a number: see FORMAT.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from functools import cached_property
from itertools import combinations_with_replacement, product
from typing import Any

from .checker import Question, Tools
from .formulas import MAX_NAMES, TEXT, VERDICTS, Ended, Reader, check_shape, is_irrational, read_tokens, require
from .numbers import Arithmetic, Series
from .series import Expansion, Row, Term

NATURAL, HOMOGENEOUS = ("natural", "riemannian", "rayleigh"), ("riemannian", "finsler")
Derivation = tuple[dict[int, Series], int, bool]  # its components, c of Y(L) = c L, and whether that holds exactly


class KindExpansion(Expansion):
    """Series as for any Lagrangian, and the conditions on those of a kind."""

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        super().__init__(arithmetic, degree)
        self.cubic = list[Series]()
        if self.question.kind == "rayleigh" and not self.question.drag:
            powers = [self.euler(force) for force in self.forces]
            self.cubic = [self.add(each, [0, 2, -3, 1]) for each in powers]
            self.forces = [self.add(each, [1, -2, 1, 0]) for each in powers]
            self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]
            self.field[-self.n :] = self.forces

    def euler(self, force: Series) -> list[Series]:
        """f, E f, E E f, E E E f with E = v^k d/dv^k."""
        speeds, found = dict(zip(self.v, self.field[-2 * self.n : -self.n], strict=True)), [force]
        while len(found) < 4:
            found.append(self.along(speeds, found[-1]))
        return found

    def along(self, parts: dict[int, Series], series: Series) -> Series:
        found = [self.multiply(part, self.derivative(series, a), self.degree) for a, part in parts.items()]
        return self.add(found) if found else {}

    @cached_property
    def derivations(self) -> list[Derivation]:
        one, speeds = self.constant(Fraction(1)), self.field[-2 * self.n : -self.n]
        found: list[Derivation] = []
        if self.question.kind in NATURAL:
            found += [({v: one}, 0, False) for v in self.v]
        if self.question.kind in HOMOGENEOUS:
            found.append((dict(zip(self.v, speeds, strict=True)), 2, True))
        for move in self.question.moves:
            parts = {a: Reader(self, move[name]).value
                     for a, name in zip(self.q, self.question.coordinates, strict=True) if name in move}  # fmt: skip
            rates = {a + self.n: self.along(dict(zip(self.q, speeds, strict=True)), part) for a, part in parts.items()}
            found.append((parts | rates, 0, True))
        return found

    def terms(self, kind: str, i: int, j: int) -> list[Term]:
        if kind[0] == "H":
            return super().terms(kind, i, j)
        (parts, weight, _), nothing = self.derivations[int(kind[1:])], self.shift + 8
        if self.cubic and kind[0] == "S":
            return [(s, i, k, 1, nothing, 0) for k, s in enumerate(self.cubic)]
        if kind[0] == "S":  # g_ij s^j with s = Y(f) - Gamma(Y_v) - c f/2
            around = dict(enumerate(self.field))
            found = ([self.along(parts, f), self.along(around, parts.get(v, {})), f]
                     for v, f in zip(self.v, self.forces, strict=True))  # fmt: skip
            return [(self.add(s, [1, -1, -(weight // 2)]), i, k, 1, nothing, 0) for k, s in enumerate(found)]
        rows = [(part, i, j, 1, 8 * a, self.units[a]) for a, part in parts.items()]
        rows.append((self.constant(Fraction(-weight)), i, j, 1, nothing, 0))
        for k, (b, c) in product(range(self.n), ((i, j), (j, i))):
            rows.append((self.derivative(parts.get(self.v[k], {}), self.v[c]), b, k, 1, nothing, 0))
        return rows

    def rows(self, degree: int) -> Iterator[Row]:
        yield from super().rows(degree)
        pairs = [*combinations_with_replacement(range(self.n), 2)]
        for kind, order in self.question.orders.items():
            for i, j in pairs if kind[0] == "K" else [(i, i) for i in range(self.n)] if kind[0] == "S" else ():
                yield from ((kind, i, j, alpha) for alpha in self.monomials(degree - order))


class OfKind(Question):
    """A system, and the checks of certificates about its Lagrangians of one kind."""

    jet = 3

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        super().__init__(tools, document, timed, claim)
        self.kind, self.moves, self.drag = claim["among"], list[dict[str, tuple[str, ...]]](), tuple[str, ...]()
        if isinstance(self.kind, dict):
            check_shape(self.kind, {"invariant": [{}, MAX_NAMES]}, "among")
            for move in self.kind["invariant"]:
                check_shape(move, dict.fromkeys(move, TEXT), "among.invariant")
                require(move and {*move} <= {*self.coordinates}, "A vector field has components along coordinates.")
                self.moves.append({name: read_tokens(text, "among.invariant") for name, text in move.items()})
            known = {*self.coordinates, *self.parameters}
            words = {token for move in self.moves for text in move.values() for token in text if token[:1].isalpha()}
            require(self.moves and words <= known, "A vector field may hold coordinates and parameters only.")
            require(not any(is_irrational(text) for move in self.moves for text in move.values()), "It is irrational.")
        else:
            check_shape(self.kind, "natural|riemannian|finsler|rayleigh", "among")
        require(not timed or self.kind not in HOMOGENEOUS, "A homogeneous Lagrangian is one without t.")
        if self.kind == "rayleigh" and claim["kind"] == "lagrangian":
            self.drag = read_tokens(claim.get("dissipation"), "certificate.dissipation")
            require(timed or "t" not in self.drag, "The dissipation contains t, but the question does not.")
        natural = len(self.coordinates) if self.kind in NATURAL else 0
        exact = [0] if self.kind == "rayleigh" else [natural] if self.kind in HOMOGENEOUS else [*range(len(self.moves))]
        count = natural + (self.kind in HOMOGENEOUS) + len(self.moves)
        self.orders = self.orders | {f"K{s}": 1 for s in range(count)} | {f"S{s}": 0 for s in exact}

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return KindExpansion(arithmetic, degree)

    def prepare(
        self, read: Callable[[Any], object], formulas: Iterable[tuple[str, ...]] = (), rational: bool = True
    ) -> None:
        more = [*(text for move in self.moves for text in move.values()), *[self.drag] * bool(self.drag)]
        super().prepare(
            lambda ring: (read(ring), [Reader(ring, text).value for text in more]), [*formulas, *more], rational
        )

    def dissipation(self, ring: Any) -> Series:
        return Reader(ring, self.drag).value if self.drag else {}

    def further(self, ring: Any, lagrangian: Series, drag: Series) -> list[tuple[Series, str]]:
        """What has to be zero for L to be of the kind, and D quadratic and homogeneous."""
        found = [(parts, weight, lagrangian) for parts, weight, exact in ring.derivations if exact]
        quadratic = [lagrangian] * (self.kind in NATURAL)
        if drag:
            speeds = {v: ring.names[name + "'"] for v, name in zip(ring.v, self.coordinates, strict=True)}
            quadratic, found = [*quadratic, drag], [*found, (speeds, 2, drag)]
        zeros = []
        for parts, weight, series in found:
            terms = [part.get(0, 0) * series.get(ring.units[a], 0) for a, part in parts.items()]
            zeros.append((sum(terms, -weight * series.get(0, 0)), "It is not homogeneous, or not invariant."))
        for series in quadratic:
            cubes = combinations_with_replacement([ring.units[v] for v in ring.v], 3)
            zeros += [(series.get(sum(units), 0), "It is not quadratic in the velocities.") for units in cubes]
        return [(ring.settle({0: value}), sentence) for value, sentence in zeros]

    def existence(self, document: dict[str, Any]) -> str:
        if self.moves or self.kind == "rayleigh":
            raise Ended("incomplete", "Of this kind only a Lagrangian itself proves that there is one.")
        return super().existence(document)


def certificates_of(kinds: Any, instead: Any) -> Iterator[tuple[Any, dict[str, Any], bool]]:
    """The answers of a result about kinds, what each certificate has to be about, and whether L may not hold t."""
    part = {"verdict": VERDICTS, "lagrangian?": {}, "certificate?": {}, "dissipation?": {}}
    check_shape(kinds, dict.fromkeys(kinds, part), "kinds")
    listed = [*kinds.items()]
    if instead is not None:
        check_shape(instead, {"kind": "time|rayleigh", "lagrangian": {}, "certificate": {}}, "instead")
        listed.append((instead["kind"], {**instead, "verdict": "variational"}))
    for kind, answer in listed:
        certificate = answer.get("certificate") or {}
        claimed, shown = certificate.get("among"), answer.get("dissipation")
        texts = (certificate.get("dissipation"), shown and shown.get("text"))
        read = [None if text is None else read_tokens(text, "dissipation") for text in texts]
        require(read[0] == read[1], "The dissipation of an answer is not the one that its certificate proves.")
        named = next(iter(claimed), None) if isinstance(claimed, dict) else claimed
        whole = claimed is None and (kind == "time" or (kind != "rayleigh" and answer["verdict"] == "not_variational"))
        require(whole or not certificate or named == kind, "A certificate is about another kind.")
        require(certificate or answer["verdict"] == "undetermined", "A kind has no proof.")
        yield claimed, answer, kind != "time"
