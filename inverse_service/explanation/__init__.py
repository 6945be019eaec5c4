"""The reasons of a verdict for people, step by step, and the same verdict as theorems for Coq.

Others use `positive` and `negative` (explanations), `hierarchy` (which conditions suffice), `proofs`, and `wording`.
"""
