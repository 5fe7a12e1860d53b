"""Rollouts and planned pushes against the rig simulator.

`rollout`, `planner`, `planner_promises`, `risk` and `risk_picture` are scripts; the other modules belong to them.
"""
