"""Other tools on the same systems: each in a process of its own, skipped where it is not installed."""
