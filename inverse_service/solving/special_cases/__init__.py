"""Determine for which parameter values, and which functions, a system is variational."""
