"""Formulas and documents of people: plain text and LaTeX to trees, which names they use, and what is asked back.

Others use `reader` (formulas and equations), `names` (what is declared), `document_names` (what a document says).
"""
