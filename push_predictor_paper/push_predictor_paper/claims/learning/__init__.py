"""Claims of section VI-A: learning curves. Beyond the paper: other kernels.

Sections of the report: `learning_curves` and `variants`.
"""
