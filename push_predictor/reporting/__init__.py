"""What all report pages share: HTML templates and conventions of figures.

Import `html` and `canvas`.
"""
