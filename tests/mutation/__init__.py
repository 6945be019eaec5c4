"""Mutation testing of the heart: small changes of its source, each of which a test has to notice."""
