"""What whole statements of a text say, by rules over its signs with their spans (`reading.signs`).

A kind of statement is one module: the energies L = and T =, an action S = ∫ L dt, a metric ds^2 =,
equations d/dt dL/dx' - dL/dx = Q, vector fields, vectors, definitions. Its rules are made of the
parts in `sequences`, and its functions say what is read in the place of what they find. A new kind is
a new module, and its examples in `tests/doors/test_signs.py` and the corpus.
"""
