"""The methods as mathematics: their table of data, and discrete equations of the variational ones.

Others use `method_table`, `variational`, and `trajectory`. A new explicit method is one file of
data.
"""
