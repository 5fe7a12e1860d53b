"""Files of a validation run: windows and answers as they come, and the log that is written at the end.

Import anything from here; only `recordings` and `evaluation` are imported in turn.
"""
