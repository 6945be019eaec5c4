"""The outcomes of a campaign as a page of Markdown."""

from __future__ import annotations

import os
import platform
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

from benchmarks.measured import commit
from inverse_service import __version__
from tests.soundness.cases import CHECKED_SHARE

Line = dict[str, Any]
VERDICTS = ("variational", "not_variational", "undetermined")
MEANING = {
    "generated": "systems made from a random Lagrangian; both questions where L contains no t, else L(t, q, q')",
    "random": "random right-hand sides; both questions, every certificate checked",
    "disguised": "generated systems in other coordinates: verdict, order and dimensions have to stay",
    "rewritten": "systems written otherwise by identities: verdict, order and dimensions have to stay",
    "corrupted": "spoilt certificates of pairs of a variational and another system: never valid",
}


def markdown(lines: Sequence[Line], counts: Mapping[str, int], seed: int, command: str) -> str:
    """The whole page, with a note if cases of the campaign are still to run."""
    parts = [
        "# Soundness",
        "A wrong verdict is the worst fault there is. This page counts them over many random systems.",
        f"Command: `{command}`, in short `make soundness`.",
        _versions(lines, seed),
        *_missing(lines, counts),
        "## Verdicts",
        _kinds_table(lines),
        "\n".join(f"- **{kind}**: {MEANING[kind]}." for kind in _kinds(lines)),
        "Certificates of generated and disguised systems are checked for "
        + ", ".join(f"n = {n}: one in {share}" for n, share in CHECKED_SHARE.items())
        + ". `incomplete` is the checker's time limit, or what neither rule of the checker settles; "
        "it never counts as confirmed.",
        "## By number of coordinates",
        _sizes_table(lines),
        "## Undetermined, by reason",
        _reasons(lines),
        "## Spoilt certificates",
        _corrupted(lines),
        "## Wrong verdicts",
        _wrong(lines),
    ]
    return "\n\n".join(parts) + "\n"


def _versions(lines: Sequence[Line], seed: int) -> str:
    names = ("python-flint", "numpy", "numba", "mpmath", "sympy")
    libraries = ", ".join(f"{name} {version(name)}" for name in names)
    seconds = sum(line["seconds"] for line in lines)
    return (
        f"inverse-service {__version__}, {commit()}, Python {platform.python_version()}, {platform.machine()}, "
        f"{os.cpu_count()} cores, {libraries}. Seed {seed}. {len(lines)} cases, {seconds:.0f} s of processor time, "
        "the making of the systems included."
    )


def _missing(lines: Sequence[Line], counts: Mapping[str, int]) -> list[str]:
    total = sum(counts.values())
    if len(lines) == total:
        return []
    rest = "The same command goes on; the tables count what has run."
    return [f"**Not ended:** {len(lines)} of {total} cases have run. {rest}"]


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(map(str, cells)) + " |" for cells in (head, rule, *rows))


def _kinds(lines: Sequence[Line]) -> list[str]:
    return list(dict.fromkeys(line["kind"] for line in lines))


def summary(lines: Sequence[Line]) -> Counter[str]:
    """How many verdicts, checks and wrong ones there are."""
    counts: Counter[str] = Counter(verdict for line in lines for verdict in line["verdicts"])
    for line in lines:
        counts.update({f"checked {verdict}": count for verdict, count in line["checked"].items()})
        counts.update(
            {f"corrupted {verdict}": count for verdict, count in line["corrupted"].items()}
        )
        counts["wrong"] += len(line["wrong"])
    return counts


def _kinds_table(lines: Sequence[Line]) -> str:
    rows = []
    for kind in _kinds(lines):
        of_kind = [line for line in lines if line["kind"] == kind]
        counts = summary(of_kind)
        checks = [counts[f"checked {verdict}"] for verdict in ("valid", "incomplete", "invalid")]
        rows.append(
            [
                kind,
                len(of_kind),
                *(counts[verdict] for verdict in VERDICTS),
                *checks,
                counts["wrong"],
            ]
        )
    head = ["kind", "cases", *(verdict.replace("_", " ") for verdict in VERDICTS)]
    return table([*head, "checked: valid", "incomplete", "invalid", "**wrong**"], rows)


def _sizes_table(lines: Sequence[Line]) -> str:
    rows = []
    for n in sorted({line["n"] for line in lines if line["n"]}):
        of_size = [line for line in lines if line["n"] == n]
        counts = summary(of_size)
        rows.append([n, len(of_size), *(counts[verdict] for verdict in VERDICTS), counts["wrong"]])
    return table(
        ["n", "cases", *(verdict.replace("_", " ") for verdict in VERDICTS), "wrong"], rows
    )


def _reasons(lines: Sequence[Line]) -> str:
    reasons = Counter(reason for line in lines for reason in line["reasons"])
    if not reasons:
        return "None."
    return table(["reason", "times"], reasons.most_common())


def _corrupted(lines: Sequence[Line]) -> str:
    counts = summary([line for line in lines if line["kind"] == "corrupted"])
    total = sum(counts[f"corrupted {verdict}"] for verdict in ("valid", "incomplete", "invalid"))
    if not total:
        return "None were made."
    invalid, incomplete, valid = (
        counts[f"corrupted {verdict}"] for verdict in ("invalid", "incomplete", "valid")
    )
    return (
        f"{total} certificates: {invalid} invalid, {incomplete} incomplete, {valid} valid (each of these would be a "
        "fault of the checker). Spoilt are the claim, the system, the rows, dimensions, characters, the series, "
        "the Lagrangian and its coefficients, each so that what is claimed is false by construction; forged are claims "
        "with terms that only look like zero, or do not look like it, at points far away, and with integrals."
    )


def _wrong(lines: Sequence[Line]) -> str:
    found = [
        (line["kind"], line["index"], sentence) for line in lines for sentence in line["wrong"]
    ]
    if not found:
        return "None."
    return "\n".join(f"- {kind} {index}: {sentence}" for kind, index, sentence in found)
