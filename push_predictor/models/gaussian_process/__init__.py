"""Gaussian process regression of one output: standard (`gp`) and variational heteroscedastic (`vhgp`).

Import `gp`, `vhgp`, `kernels`, `prediction` and `cross_validation`; the other modules are steps of their fits.
"""
