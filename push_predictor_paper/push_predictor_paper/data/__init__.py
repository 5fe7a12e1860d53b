"""What the claims are computed from: simulated recordings, repeated pushes, measured pushes.

Import anything.
"""
