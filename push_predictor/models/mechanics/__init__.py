"""Quasi-static mechanics of pushing: the exact forward model, its fit, and its setting of Lynch et al. (1992).

Import `forward` for the model, `fitted` for it with values, `analytical` for the ellipsoid; `scalar.mechanics` and
`analytical_scalar` compute single pushes without array overhead.
"""
