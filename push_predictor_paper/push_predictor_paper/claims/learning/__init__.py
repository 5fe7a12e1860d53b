"""Claims of section V-A: learning curves; other kernels (goes beyond the paper).

Import `learning_curves` and `variants`.
"""
