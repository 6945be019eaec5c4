"""Nonholonomic systems: geometry, motion, associated second-order systems, the class of the paper."""
