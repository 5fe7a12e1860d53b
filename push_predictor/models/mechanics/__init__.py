"""Quasi-static mechanics of pushing: limit surface, contact, and the analytical model of Lynch et al. (1992).

Import `analytical`, or `analytical_scalar` for single pushes without array overhead.
"""
