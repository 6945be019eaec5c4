"""Formulas and loops as machine code.

`codegen` writes the kernels of formulas, `machine_code` compiles loops modulo a prime.
"""
