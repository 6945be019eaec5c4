"""What a certificate says (FORMAT.md), and the checker that judges it from nothing else.

The room imports none of ours. Others use `checker` (its doors), `formulas` (the grammar and its
limits), and `cell` (where a claim holds).
"""
