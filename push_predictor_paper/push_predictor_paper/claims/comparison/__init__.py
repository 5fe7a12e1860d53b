"""Claims of section V-B: analytical model, GP and VHGP compared, also over speed.

Import `comparison`, `mean_gain` and `speed_error`.
"""
