"""Models tabulated over their domain: a prediction takes microseconds, whatever the number of training rows.

Import `tabulated_model`; the other modules build and check the tables.
"""
