"""Rollouts and planned pushes against the rig simulator.

`rollout`, `planner` and `planner_promises` are scripts; the other modules belong to them.
"""
