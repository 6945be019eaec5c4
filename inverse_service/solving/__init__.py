"""One system, its questions in the order of wanting: decide, search, certify, check, explain.

Others use `solving.solve`; `kind_answers`, `clock`, and `special_cases` answer what was asked besides.
"""
