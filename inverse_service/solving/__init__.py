"""Answer the questions about one system, cell by cell: decide, search, certify, check, explain.

Other packages use `solving.solve`; `kind_answers`, `clock`, and `case_tree` answer additional
questions. `strata` and `side_conditions` serve the tree of special cases.
"""
