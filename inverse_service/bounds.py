"""Bounds on what is tried, stored and shown: one number for each kind of amount, used everywhere.

Halving or doubling a single bound changed no measured result, so all bounds of a kind share one
value. The effect of halving or doubling a whole kind is in the table of docs/records/search.md. A
digit of a difference, a degree in a theorem or the price of a step is not such an amount and is
defined where it is used.
"""

# Terms of an expansion, and nodes of a formula, up to which exact computation continues.
TERMS = 4_000
# Terms of an expansion that is one of many and may be omitted.
EXPANSION = 500
# Terms of a long ansatz, and nodes of roots that are written shorter. With half the pendulum on a
# hoop has no L.
LARGE = 1_000
# Terms of a short ansatz, of a potential or of a form: elimination takes the third power. With 120
# four of 1,000 generated systems had no L; with 400 the pendulum on a hoop has none.
SMALL = 200
# Columns of a small linear system, whose coefficients may hold parameters. Twice as many complete a
# kinetic energy: with 40 a bead on a parabola was left to the ansatz.
COLUMNS = 40
# Candidates of a list that is searched, simplest first: factors, generators, branches.
CANDIDATES = 12
# The number of best candidates that are kept, of repeated passes, and of points at which a
# condition must hold.
FEW = 4
# Largest power of a sum that is multiplied out.
POWER = 6
# Coordinates in a computation whose cost is the fourth power of their number, or that has a
# symbolic determinant.
COORDINATES = 12
# Nodes of a formula that is a generator, or that is integrated.
NODES = 80
# Points that are drawn for each required one, because f may be singular.
ATTEMPTS = 8
# Points that are drawn if most are unsuitable: a root must be real, a number rational.
TRIES = 500
# Digits of floating-point numbers, and digits that must agree. With 20 two of 21 systems had no L.
DIGITS, AGREEING = 60, 40
# Numerators and denominators of a coefficient, and of exponents, rates and relations, which are
# smaller: with 500 the pendulum on a hoop has no L.
NUMBER, RATIO = 10**7, 1_000
# Units (see `deadline`) for a smaller system, and for the changes of coordinates that make one.
WORK = 500_000
# Nodes, terms or characters of one formula that is shown to a reader.
SHOWN = 400
