"""The use cases: a document in, a result out; checking of results; one outline of an answer, printed as text and LaTeX.

Others use `documents`, `checking`, `own_lagrangian`, `derived`, `answers`, `growing`, `accepting`, `plain_data`,
`text_page`, and `latex_page`.
"""
