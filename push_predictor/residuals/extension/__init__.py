"""Steps 8 to 10: the extended model, the size of its effects, and the pushes that would separate rivals.

Import `extension`, `effect_size`, `experiment` and `advice`.
"""
