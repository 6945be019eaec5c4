"""The use cases: a document in, a result out; checking of results; one outline of an answer, printed as text and LaTeX.

Others use `documents`, `checking`, `forward`, `answers`, `growing`, and `text_page`.
"""
