"""Explain verdicts step by step, and state them as theorems for Coq.

Other packages use `explaining` (how steps are said, and a positive answer), `negative`, `hierarchy`
(sufficient conditions), and `proofs`.
"""
