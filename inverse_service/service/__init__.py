"""What the doors share: documents in and out, jobs, scenes, figures, and many machines."""
