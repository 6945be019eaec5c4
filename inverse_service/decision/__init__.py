"""Decide completely whether a system has a regular Lagrangian, and write the certificate.

Other packages use `deciding`, `certify`, and the records of `solutions`. `helmholtz` and
`constrained` each define a type of question: the unknown functions, the equations, and the matrix
with its required rank.
"""
