"""Scene documents in, results of simulations out, and their figures for files: SVG and PNG.

Others use `scene_reading`, `simulating`, `work_precision`, `views`, and `drawing`.
"""
