"""The format of certificates (FORMAT.md), and the checker that judges a certificate from its
content alone.

This package imports nothing else of the project, and other packages import `checker` alone, which
has the entry points and names what else they may use.
"""
