"""The data of the claims: simulated recordings, repeated pushes, measured pushes.

Any module may be imported.
"""
