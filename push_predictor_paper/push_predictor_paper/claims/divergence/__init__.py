"""Claim: KL divergence of the models from repeated pushes.

`section.section` is the section of the report; the other modules belong to it.
"""
