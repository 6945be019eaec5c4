"""Other tools on the same systems: each runs in its own process, and is skipped if it is not
installed.
"""
