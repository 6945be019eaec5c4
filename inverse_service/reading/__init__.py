"""Parse formulas in plain text and LaTeX into trees, find the names they use, and ask back if a
formula is ambiguous.

Other packages use `reader` (formulas and equations), `names` (declarations), and `document_names`
(documents).
"""
