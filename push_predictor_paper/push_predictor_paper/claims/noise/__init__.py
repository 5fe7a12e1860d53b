"""Claims about the size and shape of the noise.

Import `noise.section`.
"""
