"""Models trained on draws of rows and scored on held-out rows.

Import anything.
"""
