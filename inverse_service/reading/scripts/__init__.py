"""Pasted programs that compute a system: read into one kind of tree, run in symbols, and asked for the
Lagrangian or the equations that they come to.

Nothing of a program is executed by Python: names, vectors, derivatives, and the program's own functions are evaluated here.
"""
