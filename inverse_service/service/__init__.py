"""What the doors share: documents in and out, jobs, scenes, figures, kernels, and many machines."""
