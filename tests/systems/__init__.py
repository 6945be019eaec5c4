"""Systems whose verdict is known from the literature or by an argument, and a second opinion on
them.
"""
