"""The use cases: a document in, a result out; checking of results; the sheet of an answer, which
all printers print.

Others use `documents`, `checking`, `own_lagrangian`, `derived`, `answers`, `growing`, `accepting`,
`plain_data`, `sheets`, and `printed_pages`.
"""
