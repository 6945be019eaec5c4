"""The kernels of this installation: compiled ahead of time for a wheel, or once on a machine before any clock runs."""
