"""Planning of sequences of pushes past obstacles and the table's edges, at a bounded risk.

Import `around_obstacles`, `scene` and `targets`; the other modules are their parts.
"""
