"""Statistics of repeated pushes and of maps: modes, calibration, peaks, noise.

Import anything.
"""
