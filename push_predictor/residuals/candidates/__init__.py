"""Steps 4 and 5: every mechanism with every covariate, cleared of what the model's inputs explain.

Import `candidates`; nothing here imports from the later steps.
"""
