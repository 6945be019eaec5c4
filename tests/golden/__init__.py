"""A hundred documents answered by two states of the code, and what their results differ in."""
