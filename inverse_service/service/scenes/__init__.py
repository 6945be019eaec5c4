"""Scene documents in, results of simulations out.

Others use `scene_reading`, `simulating`, `work_precision`, and `prices`.
"""
