"""Mechanics by formulas: second-order systems, their tensors, motions on constraints, and what a
motion keeps.

Others use `second_order_system` (and how it is read), `conditions` (Phi, nabla Phi, R),
`constrained_motion`, `euler_lagrange`, `legendre`, and `first_integrals`.
"""
