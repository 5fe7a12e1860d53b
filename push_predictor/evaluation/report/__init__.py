"""The validation report: one HTML page with tables, maps and figures.

Import `page`; the other modules are its parts.
"""
