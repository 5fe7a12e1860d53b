"""Step 4: every mechanism with every covariate, and what is regressed out of each candidate.

Import `candidate` and `enumeration`; only `evidence` is imported here.
"""
