"""One coordinate: last multipliers, Darboux polynomials, quadratures."""
