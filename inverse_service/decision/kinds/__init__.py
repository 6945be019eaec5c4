"""Each module defines one question: the unknown functions, the equations, and the matrix with its required rank."""
