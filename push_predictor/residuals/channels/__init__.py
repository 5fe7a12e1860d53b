"""Where an effect may lie: the measurement, the mean motion, its variance, the wrench.

Import one module per channel; a channel imports no later step.
"""
