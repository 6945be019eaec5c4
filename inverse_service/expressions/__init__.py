"""Formulas as frozen trees: calculus, the table of functions, printing, values at a point.

Others use `tree` (what a formula is), `derivative`, `collecting` (sums of products), `printing`, and `evaluation`.
"""
