"""Recorded pushes: streams, rigs and push tables, read and written.

Import `read`, `write`, `load`, `streams`, `samples`, `rig` and `table`. The folders are `bag` (files), `windows` (push
windows) and `importers` (other formats).
"""
