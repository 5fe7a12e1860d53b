"""The VHGP for thousands of rows: variational inference with inducing inputs.

Import `vhgp` and `fit`; the other modules are steps of them.
"""
