"""Steps 1 to 3 and 5: data with covariates, the split by push, standardised residuals, regressing the inputs out.

Import anything; nothing here imports from the later steps.
"""
