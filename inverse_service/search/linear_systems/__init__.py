"""Linear systems: quadratic Lagrangians from matrices, modes and roots."""
