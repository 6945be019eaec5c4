"""A fitted system, and the members of its family that have a Lagrangian and are nearest to it.

Others use `fitted` (the system as data, and its metric) and `nearest_members.nearest`.
"""
