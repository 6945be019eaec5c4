"""The inverse problem on constraints: does any regular Lagrangian have a nonholonomic motion among
its solutions?

Other packages use `answering` for the complete answer about a motion, `nonholonomic_study` for the
associated systems of a document, and `reduced` for the equations of the free coordinates.
"""
