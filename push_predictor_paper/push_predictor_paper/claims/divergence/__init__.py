"""Claim: KL divergence of the models from repeated pushes.

Import `divergence.section`.
"""
