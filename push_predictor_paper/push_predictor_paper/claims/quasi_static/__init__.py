"""Claim: the speed up to which the quasi-static assumption holds.

`section.section` is the section of the report; the other modules belong to it.
"""
