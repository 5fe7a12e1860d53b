"""Claim: up to which speed the quasi-static assumption holds.

Import `quasi_static.section`.
"""
