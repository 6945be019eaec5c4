"""Has a system a regular Lagrangian? Decided completely, cell by cell, with the certificate written.

Others use `deciding`, `certify`, and the records of `solutions`. A question about Lagrangians of one kind is a card
in `kinds`.
"""
