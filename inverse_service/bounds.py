"""How much is tried, held and shown: one number for each kind of amount, wherever it is met.

Each was many numbers, one a place. Half and twice as much of each one changed nothing that was measured, so those of
a kind have one value; what half and twice of the whole kind change is the table in docs/records/search.md. A digit of a
difference, a degree of a theorem or the price of a step is no such amount and stays where it is used.
"""

from __future__ import annotations

# Terms of an expansion, and nodes of a formula, beyond which it is no longer worked with exactly.
TERMS = 4_000
# Terms of an expansion that is one of many, which may be left out.
EXPANSION = 500
# Terms of a long ansatz, and nodes of roots that are written shorter. With half the pendulum on a hoop has no L.
LARGE = 1_000
# Terms of a short ansatz, of a potential or of a form: elimination takes the third power. With 120 four of 1,000
# generated systems had no L; with 400 the pendulum on a hoop has none.
SMALL = 200
# Columns of a small linear system, whose coefficients may hold parameters. Twice as many complete a kinetic energy:
# with 40 a bead on a parabola was left to the ansatz.
COLUMNS = 40
# Candidates of a list that is gone through, simplest first: factors, letters, branches.
CANDIDATES = 12
# What is kept of the best ones, how often answers are answered, and points at which something has to hold.
FEW = 4
# Powers of a sum that are multiplied out.
POWER = 6
# Coordinates of what takes the fourth power of their number, or a symbolic determinant.
COORDINATES = 12
# Nodes of a formula that is a letter, or that is integrated.
NODES = 80
# Points that are drawn for each that is wanted, where f may be singular.
ATTEMPTS = 8
# Points that are drawn where most do not fit: a root has to be real, a number rational.
TRIES = 500
# Digits of floating-point numbers, and those that have to agree. With 20 two of 21 systems had no L.
DIGITS, AGREEING = 60, 40
# Numerators and denominators of a coefficient, and of exponents, rates and relations, which are smaller: with 500 the
# pendulum on a hoop has no L.
NUMBER, RATIO = 10**7, 1_000
# Units (see `deadline`) for a smaller system, and for the changes of coordinates that make one.
WORK = 500_000
# Nodes, terms or characters of one formula that a reader is shown.
SHOWN = 400
