"""Darboux polynomials and first integrals of Gamma for several coordinates, as generators of ansatz terms."""
