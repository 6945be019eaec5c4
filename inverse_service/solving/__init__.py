"""Answer the questions about one system: decide, search, certify, check, explain.

Other packages use `solving.solve`; `kind_answers`, `clock`, and `special_cases` answer additional questions.
"""
