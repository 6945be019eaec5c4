"""Mutation testing of checker and decision: a test has to detect each small change of their
source.
"""
