"""Inverse problem of the calculus of variations: verdict, Lagrangian, proof."""

__version__ = "0.1.0"
