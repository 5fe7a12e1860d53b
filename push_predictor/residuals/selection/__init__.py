"""Steps 6 to 8: screening, forward selection, rivals, names, and the smallest detectable effect.

Import `search`; the other modules are its parts.
"""
