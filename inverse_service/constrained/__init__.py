"""The inverse problem on the constraints: has any regular Lagrangian a nonholonomic motion among its solutions?

Others ask `answering` for the whole answer about a motion, `nonholonomic_study` for the associated systems of a
document, and `reduced` for the equations of the free coordinates.
"""
