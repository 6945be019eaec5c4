"""Explain verdicts step by step, and state them as theorems for Coq.

Other packages use `positive` and `negative` (explanations), `hierarchy` (sufficient conditions), `proofs`, and
`wording`.
"""
