"""Verdicts as explicit identities over the rationals, for other provers."""
