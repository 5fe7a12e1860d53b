"""Claims of section VI-B: analytical model, GP and VHGP compared, also by speed.

Sections of the report: `section`, `mean_gain` and `speed_error`.
"""
