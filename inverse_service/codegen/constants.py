"""Codes that a kernel leaves in its status where it stops."""

NOT_FINITE = 1
NO_CONVERGENCE, SINGULAR, WATCHED = 100, 200, 300
