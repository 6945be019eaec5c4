"""The paper, statement by statement, recomputed."""
