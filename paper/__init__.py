"""The paper, statement by statement, computed anew."""
