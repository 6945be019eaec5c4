"""Jobs: what was asked, how far it is, and what came of it; kept in a store that survives kill
-9.
"""
