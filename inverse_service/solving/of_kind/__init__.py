"""Lagrangians of one kind: which there are, found among those that are known or proven to exist."""
