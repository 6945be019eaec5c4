"""Answer the questions about one system, cell by cell: decide, search, certify, check, explain.

Other packages use `solving.solve`; `kind_answers`, `clock`, and `members` answer additional
questions. `leaves`, `shorter_leaves`, `closed_members`, and `regularity` serve `members`.
"""
