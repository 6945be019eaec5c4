"""Small dense linear systems, written out: Gaussian elimination with row pivoting by selection, no branch."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.codegen.llvm_writer import LlvmWriter


def solve_dense(writer: LlvmWriter, matrix: Sequence[Sequence[str]], right: Sequence[str]) -> tuple[list[str], str]:
    """(solution of matrix x = right, determinant), in values of the writer."""
    size = len(right)
    if size == 1:
        return [writer.binary("/", right[0], matrix[0][0])], matrix[0][0]
    if size == 2:
        return _by_cramer(writer, matrix, right)
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    determinant = writer.number(1.0)
    for column in range(size):
        determinant = _pivot(writer, rows, column, determinant)
        determinant = writer.binary("*", determinant, rows[column][column])
        for row in range(column + 1, size):
            factor = writer.binary("/", rows[row][column], rows[column][column])
            for place in range(column + 1, size + 1):
                rows[row][place] = _less(writer, rows[row][place], factor, rows[column][place])
    return _back(writer, rows), determinant


def _less(writer: LlvmWriter, value: str, factor: str, other: str) -> str:
    return writer.binary("-", value, writer.binary("*", factor, other))


def _by_cramer(writer: LlvmWriter, matrix: Sequence[Sequence[str]], right: Sequence[str]) -> tuple[list[str], str]:
    (a, b), (c, d) = matrix
    determinant = _less(writer, writer.binary("*", a, d), b, c)
    first = _less(writer, writer.binary("*", right[0], d), b, right[1])
    second = _less(writer, writer.binary("*", a, right[1]), c, right[0])
    return [writer.binary("/", first, determinant), writer.binary("/", second, determinant)], determinant


def _pivot(writer: LlvmWriter, rows: list[list[str]], column: int, determinant: str) -> str:
    """The largest entry of the column comes up by exchanges, each of which turns the determinant's sign."""
    for row in range(column + 1, len(rows)):
        larger = writer.compare(">", writer.absolute(rows[row][column]), writer.absolute(rows[column][column]))
        for place in range(column, len(rows[row])):
            upper, lower = rows[column][place], rows[row][place]
            rows[column][place] = writer.select(larger, lower, upper)
            rows[row][place] = writer.select(larger, upper, lower)
        determinant = writer.select(larger, writer.negate(determinant), determinant)
    return determinant


def _back(writer: LlvmWriter, rows: Sequence[Sequence[str]]) -> list[str]:
    size = len(rows)
    solution = [""] * size
    for row in reversed(range(size)):
        value = rows[row][size]
        for place in range(row + 1, size):
            value = _less(writer, value, rows[row][place], solution[place])
        solution[row] = writer.binary("/", value, rows[row][row])
    return solution
