"""Steps 1 to 3: recordings with covariates, the split by push, standardised residuals, the training baseline.

Import anything; nothing here imports from the later steps.
"""
