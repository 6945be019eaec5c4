"""Exact arithmetic with formulas: the field over Q with its atoms, and the same formulas modulo a
prime.

Other packages use `exact_field` and `matrices` for proofs, `tower`, `modular`, and `flow` for
values modulo a prime, `real_branch` for the branch of roots and to test whether formulas vanish,
`sign_cases` for what differs by signs, `echelon` and `matrices` for elimination.
"""
