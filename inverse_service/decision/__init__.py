"""Decide completely, cell by cell, whether a system has a regular Lagrangian, and write the certificate.

Other packages use `deciding`, `certify`, and the records of `solutions`. `kinds` defines a question about each kind of
Lagrangian.
"""
