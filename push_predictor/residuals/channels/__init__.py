"""Where an effect may lie: motion, measurement, wrench, variance.

Import one module per channel.
"""
