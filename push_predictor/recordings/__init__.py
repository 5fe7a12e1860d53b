"""Recorded pushes: streams, rigs and push tables, and how they are read and written.

Import `read`, `load`, `streams`, `rig` and `table`; `bag`, `windows` and `importers` have folders of their own.
"""
