"""The residual loop: find what a model fails to explain, trace it to an effect, add it, measure again.

Import `trace`, `outcome` and `reporting`; the folders are the steps that docs/explanation/residual_loop.md numbers.
"""
