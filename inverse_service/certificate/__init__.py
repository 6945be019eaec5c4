"""The format of certificates (FORMAT.md), and the checker that judges a certificate from its
content alone.

This package imports nothing else of the project. Other packages use `checker` (the entry points),
`formulas` (the grammar and its limits), and `cell` (where a claim is valid).
"""
