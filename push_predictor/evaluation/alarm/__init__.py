"""The alarm: sequential evidence that a model no longer fits, valid after every push.

Import `evidence` and `scores`.
"""
