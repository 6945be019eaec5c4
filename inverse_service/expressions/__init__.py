"""Formulas as frozen trees: differentiation, the table of functions, printing, and evaluation at a
point.

Other packages use `tree` (the nodes of a formula), `derivative`, `collecting` (sums of products),
`printing`, and `evaluation`.
"""
