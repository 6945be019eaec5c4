"""Measurements: the decision next to a plain SymPy pipeline, growth with n and with the order, cold
starts.

python -m benchmarks --help
"""
