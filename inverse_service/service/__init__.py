"""What the doors share: documents in and out, jobs, scenes, figures, kernels, and many machines.

`warming` compiles the kernels once on a machine before any clock runs, `shipping` ahead of time for a wheel.
"""
