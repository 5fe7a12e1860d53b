"""What all report pages share: HTML and matplotlib conventions.

Import `html` and `canvas`.
"""
