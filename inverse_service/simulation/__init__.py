"""Scenes become trajectories: derivation, methods as programs, runs, events, ensembles, errors and
their price.

Others use `scene_data` (what a scene is), `derivation`, `running.run_scene`, `precision`, and
`advice`.
"""
