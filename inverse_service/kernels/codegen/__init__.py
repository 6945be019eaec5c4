"""Kernels of formulas: a step of a method as a program, written as LLVM IR, compiled once, and
kept.

Others use `program` (what a step is), `symengine_trees` (its formulas), and `compiled`.
"""
