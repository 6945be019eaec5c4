"""Codes that a kernel leaves in its status where it stops."""

NOT_FINITE = 1
NO_CONVERGENCE, SINGULAR, GUARDED, WATCHED = 100, 200, 300, 400
TOO_SHORT, UNRESOLVED, NO_START = 2, 3, 4
UNOBSERVABLE = 1000
