"""Parse formulas in plain text and LaTeX into trees, find the names they use, and ask back if a
formula is ambiguous.

Other packages use `reader` (formulas and equations), `names` (what a name is), `declarations` (what
a document declares), `time_derivatives` (what moves), and `document_names` (all names of one).
"""
